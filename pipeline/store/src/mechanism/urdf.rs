//! URDF, the robot description of ROS.
//!
//! A URDF joint has one degree of freedom. Between two joints of a wheel there is a carrier, a link with [`CARRIER_SHARE`] of the
//! wheel's mass, because engines drop or refuse massless links. `effort` and `velocity` are the limits of the motor; for a passive
//! joint, the largest force of its spring and [`PASSIVE_SPEED`].

use super::{axis, children, escaped, head, numbers};
use sastrugi_schemas::mechanism::{GroundFriction, Joint, Link, Mechanism, Motion, Motor, Servo, Shape};
use std::fmt::Write;

/// Share of a link's mass assigned to each carrier before it.
const CARRIER_SHARE: f64 = 0.01;
/// Speed limit of passive joints, m/s or rad/s: URDF requires one, the model has none.
const PASSIVE_SPEED: f64 = 100.0;
/// Rotates the axis of a cylinder from z to y.
const ABOUT_Y: &str = "1.5707963267948966 0 0";

pub(super) fn render(mechanism: &Mechanism) -> String {
    let mut text = String::from("<?xml version=\"1.0\"?>\n<!--\n");
    // Writing to a string cannot fail.
    for line in head(mechanism) {
        let _ = writeln!(text, "  {line}");
    }
    text.push_str(
        "  URDF has no springs and no rolling resistance: both are given in comments. Friction is given in gazebo elements.\n  \
         base_link moves freely. Wheels may overlap the chassis box: disable self-collision of the vehicle.\n",
    );
    if !mechanism.couplings.is_empty() {
        text.push_str(
            "  The differential between the rockers closes a loop, which URDF cannot express; mimic replaces it. In an engine that\n  \
             ignores mimic the chassis swings freely.\n",
        );
    }
    let _ = writeln!(text, "-->\n<robot name=\"{}\">", escaped(&mechanism.name));
    children(mechanism, None).for_each(|(number, root)| {
        link(&mut text, &root.name, &Mass::of(root, 1.0), root.shape.as_ref());
        below(&mut text, mechanism, number, root);
    });
    mechanism.links.iter().for_each(|link| gazebo(&mut text, link, &mechanism.friction));
    text.push_str("</robot>\n");
    text
}

/// All descendants of a link.
fn below(text: &mut String, mechanism: &Mechanism, number: usize, parent: &Link) {
    for (child, link) in children(mechanism, Some(number)) {
        hang(text, mechanism, &parent.name, link);
        below(text, mechanism, child, link);
    }
}

/// A link with its joints to the parent, and a carrier between two joints.
fn hang(text: &mut String, mechanism: &Mechanism, parent: &str, child: &Link) {
    let carriers = child.joints.len().saturating_sub(1);
    let mut above = parent.to_owned();
    let mut origin = child.origin_m;
    for (number, one) in child.joints.iter().enumerate() {
        let is_last = number == carriers;
        let name = if is_last { child.name.clone() } else { format!("{}_carrier", one.name) };
        if is_last {
            let mass = Mass::of(child, 1.0 - CARRIER_SHARE * carriers as f64);
            link(text, &name, &mass, child.shape.as_ref());
        } else {
            link(text, &name, &Mass::carrier(child), None);
        }
        joint(text, mechanism, one, [above.as_str(), name.as_str()], &origin);
        above = name;
        origin = [0.0; 3];
    }
}

/// Mass properties of a link.
struct Mass {
    kg: f64,
    centre_m: [f64; 3],
    inertia_kg_m2: [f64; 3],
}

impl Mass {
    /// A share of a link's mass, with its full moments of inertia.
    fn of(link: &Link, share: f64) -> Self {
        Self { kg: share * link.mass_kg, centre_m: link.centre_of_mass_m, inertia_kg_m2: link.inertia_kg_m2 }
    }

    /// Mass properties of a carrier: its share of the link's mass, and about every axis its share of the link's smallest moment of
    /// inertia.
    fn carrier(link: &Link) -> Self {
        let [x, y, z] = link.inertia_kg_m2;
        Self {
            kg: CARRIER_SHARE * link.mass_kg,
            centre_m: link.centre_of_mass_m,
            inertia_kg_m2: [CARRIER_SHARE * x.min(y).min(z); 3],
        }
    }
}

fn link(text: &mut String, name: &str, mass: &Mass, shape: Option<&Shape>) {
    let [x, y, z] = mass.inertia_kg_m2;
    let _ = write!(
        text,
        "  <link name=\"{}\">\n    <inertial>\n      <origin xyz=\"{}\" rpy=\"0 0 0\"/>\n      <mass value=\"{}\"/>\n      \
         <inertia ixx=\"{x}\" ixy=\"0\" ixz=\"0\" iyy=\"{y}\" iyz=\"0\" izz=\"{z}\"/>\n    </inertial>\n",
        escaped(name),
        numbers(&mass.centre_m),
        mass.kg
    );
    if let Some(shape) = shape {
        let geometry = geometry(shape);
        for element in ["visual", "collision"] {
            let _ = writeln!(text, "    <{element}>\n{geometry}    </{element}>");
        }
    }
    text.push_str("  </link>\n");
}

fn geometry(shape: &Shape) -> String {
    let (origin, turn, solid) = match shape {
        Shape::Box { size_m, centre_m } => (numbers(centre_m), "0 0 0", format!("<box size=\"{}\"/>", numbers(size_m))),
        Shape::Wheel { radius_m, width_m } => {
            (numbers(&[0.0; 3]), ABOUT_Y, format!("<cylinder radius=\"{radius_m}\" length=\"{width_m}\"/>"))
        }
    };
    format!("      <origin xyz=\"{origin}\" rpy=\"{turn}\"/>\n      <geometry>{solid}</geometry>\n")
}

fn joint(text: &mut String, mechanism: &Mechanism, joint: &Joint, [parent, child]: [&str; 2], origin: &[f64; 3]) {
    let kind = match (joint.motion, joint.range) {
        (Motion::SlideZ, _) => "prismatic",
        (_, Some(_)) => "revolute",
        (_, None) => "continuous",
    };
    let _ = write!(
        text,
        "  <joint name=\"{}\" type=\"{kind}\">\n    <parent link=\"{}\"/>\n    <child link=\"{}\"/>\n    \
         <origin xyz=\"{}\" rpy=\"0 0 0\"/>\n    <axis xyz=\"{}\"/>\n",
        escaped(&joint.name),
        escaped(parent),
        escaped(child),
        numbers(origin),
        axis(joint.motion)
    );
    let stops = joint.range.map_or_else(String::new, |[lower, upper]| format!("lower=\"{lower}\" upper=\"{upper}\" "));
    let [effort, velocity] = limits(mechanism, joint);
    let _ = writeln!(text, "    <limit {stops}effort=\"{effort}\" velocity=\"{velocity}\"/>");
    let _ = writeln!(text, "    <dynamics damping=\"{}\" friction=\"0\"/>", joint.damping);
    if let Some(coupling) = mechanism.couplings.iter().find(|coupling| coupling.follower == joint.name) {
        let _ = writeln!(
            text,
            "    <mimic joint=\"{}\" multiplier=\"{}\" offset=\"0\"/>",
            escaped(&coupling.leader),
            coupling.ratio
        );
    }
    if let Some(spring) = &joint.spring {
        let _ = writeln!(
            text,
            "    <!-- spring: stiffness {} N/m, unloaded at {} m; damping {} N s/m -->",
            spring.stiffness_n_m, spring.unloaded_m, joint.damping
        );
    }
    text.push_str("  </joint>\n");
}

/// Largest force or torque, and largest speed, of a joint.
fn limits(mechanism: &Mechanism, joint: &Joint) -> [f64; 2] {
    let is_driven = |motor: &&Motor| motor.joints.contains(&joint.name);
    match mechanism.motors.iter().find(is_driven).map(|motor| (motor.servo, motor.joints.len())) {
        Some((Servo::Speed { torque_limit_n_m, speed_limit_rad_s, .. }, joints)) => {
            [torque_limit_n_m / joints as f64, speed_limit_rad_s]
        }
        Some((Servo::Angle { stiffness_n_m, rate_limit_rad_s, .. }, _)) => {
            let travel = joint.range.map_or(0.0, |[low, high]| high - low);
            [stiffness_n_m * travel, rate_limit_rad_s]
        }
        None => [joint.spring.map_or(0.0, |spring| spring.force_max_n), PASSIVE_SPEED],
    }
}

/// Friction of a link, as Gazebo reads it.
fn gazebo(text: &mut String, link: &Link, friction: &GroundFriction) {
    let (coefficient, rolling) = match link.shape {
        None => return,
        Some(Shape::Box { .. }) => (friction.belly, String::new()),
        Some(Shape::Wheel { .. }) => {
            (friction.wheel, format!(" <!-- rolling resistance {} of the load -->", friction.rolling))
        }
    };
    let _ = writeln!(
        text,
        "  <gazebo reference=\"{}\"><mu1>{coefficient}</mu1><mu2>{coefficient}</mu2></gazebo>{rolling}",
        escaped(&link.name)
    );
}
