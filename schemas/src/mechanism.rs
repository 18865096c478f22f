//! A vehicle as rigid bodies connected by joints, from which its files for other simulators are written. SI units.
//!
//! With all joints at zero, the frames of all links are parallel to base_link (x forward, y left, z up).

/// A vehicle as rigid bodies connected by joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Mechanism {
    /// Name, such as `husky_a200`.
    pub name: String,
    /// Bodies, parents before their children. The first is the chassis, `base_link`, which moves freely.
    pub links: Vec<Link>,
    /// Coupled joints without a motor.
    pub couplings: Vec<Coupling>,
    /// Motors.
    pub motors: Vec<Motor>,
    /// Friction of the ground for which the file is written.
    pub friction: GroundFriction,
    /// Height of base_link above level ground with all joints at zero and rigid wheels, m.
    pub standing_height_m: f64,
    /// Deflection of the tyres under the vehicle's weight, m. The wheels of a mechanism are rigid.
    pub tyre_sag_m: f64,
}

/// A rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Name, such as `front_left_wheel`.
    pub name: String,
    /// Index of the parent body; none for the chassis.
    pub parent: Option<usize>,
    /// Origin of its frame in that of its parent with all joints at zero, m.
    pub origin_m: [f64; 3],
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in its own frame, m.
    pub centre_of_mass_m: [f64; 3],
    /// Moments of inertia about x, y, z through the centre of mass, kg m2; products of inertia are 0.
    pub inertia_kg_m2: [f64; 3],
    /// Collision shape.
    pub shape: Option<Shape>,
    /// Joints to the parent, the first next to it. All pass through the origin of the link.
    pub joints: Vec<Joint>,
}

/// Shape of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A box along the axes.
    Box {
        /// Length, width and height, m.
        size_m: [f64; 3],
        /// Its centre in the frame of the link, m.
        centre_m: [f64; 3],
    },
    /// A cylinder about y, centred at the origin of the link.
    Wheel {
        /// Radius, m.
        radius_m: f64,
        /// Width, m.
        width_m: f64,
    },
}

/// Degree of freedom of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Along z, up positive, m.
    SlideZ,
    /// About y, nose down (and rolling forward) positive, rad.
    TurnY,
    /// About z, to the left positive, rad.
    TurnZ,
}

/// A joint with one degree of freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name, such as `front_left_wheel_spin`.
    pub name: String,
    /// Degree of freedom.
    pub motion: Motion,
    /// Stops, m or rad; none for the spin of a wheel.
    pub range: Option<[f64; 2]>,
    /// Damping, N s/m or N m s/rad.
    pub damping: f64,
    /// Spring along the joint.
    pub spring: Option<Spring>,
}

/// A linear spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// Stiffness, N/m.
    pub stiffness_n_m: f64,
    /// Position of the joint at which the spring force is zero, m.
    pub unloaded_m: f64,
    /// Its largest force between the stops, N.
    pub force_max_n: f64,
}

/// Two joints that move together: `follower = ratio * leader`.
#[derive(Clone, Debug, PartialEq)]
pub struct Coupling {
    /// Leading joint.
    pub leader: String,
    /// Following joint.
    pub follower: String,
    /// Position of the follower over that of the leader.
    pub ratio: f64,
}

/// A motor.
#[derive(Clone, Debug, PartialEq)]
pub struct Motor {
    /// Name, such as `left_motor`.
    pub name: String,
    /// Joints that it drives, all at the same speed.
    pub joints: Vec<String>,
    /// Its control.
    pub servo: Servo,
}

/// Control of a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Servo {
    /// A commanded speed of the joints.
    Speed {
        /// Torque of all joints together over the difference of speeds, N m s/rad.
        gain_n_m_s: f64,
        /// Largest torque of all joints together, N m.
        torque_limit_n_m: f64,
        /// Largest speed that the vehicle's controller commands, rad/s.
        speed_limit_rad_s: f64,
    },
    /// A commanded angle, independent of the load.
    Angle {
        /// Torque over the difference of angles, N m/rad.
        stiffness_n_m: f64,
        /// Torque over the rate of the angle, N m s/rad.
        damping_n_m_s: f64,
        /// Largest change of the commanded angle, rad/s.
        rate_limit_rad_s: f64,
    },
}

/// Friction of the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundFriction {
    /// Name of the surface, such as `hard_soil`.
    pub surface: String,
    /// Friction coefficient between tyre and ground.
    pub wheel: f64,
    /// Friction coefficient between chassis and ground.
    pub belly: f64,
    /// Rolling resistance over normal force.
    pub rolling: f64,
}
