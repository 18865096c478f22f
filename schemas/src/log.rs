//! What an MCAP log of any origin says about a vehicle's motion: the form in which recordings pass from files to figures.

/// A log as read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// Streams of poses, in the order of their channels.
    pub poses: Vec<PoseStream>,
    /// Transforms between frames, one for each pair of frames of a topic.
    pub transforms: Vec<TransformStream>,
    /// Inertial measurement units.
    pub imus: Vec<ImuStream>,
    /// Outcomes that the log itself states, in order of time: the names of its events.
    pub events: Vec<(i64, String)>,
    /// Where the file breaks off, in words; what stands before it has been read.
    pub broken: Option<String>,
    /// Topics of known messages in an encoding that is not read, in words.
    pub unread: Vec<String>,
}

/// The pose of a body in a fixed frame at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedPose {
    /// Time of the measurement, ns since 1970-01-01 UTC.
    pub time_ns: i64,
    /// Position, m.
    pub position_m: [f64; 3],
    /// Orientation quaternion (fixed frame from body) `[x, y, z, w]`.
    pub orientation: [f64; 4],
    /// Angular velocity in the body's frame, rad/s, where the message has one.
    pub angular_velocity_rad_s: Option<[f64; 3]>,
}

/// Poses of one topic.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseStream {
    /// Topic.
    pub topic: String,
    /// Full name of its message.
    pub schema: String,
    /// Frame that the poses are in, as the first message says.
    pub frame: String,
    /// Frame that is posed; empty where the message does not say.
    pub body: String,
    /// Poses in the order of the file.
    pub poses: Vec<TimedPose>,
}

/// Transforms of one pair of frames on one topic.
#[derive(Clone, Debug, PartialEq)]
pub struct TransformStream {
    /// Topic.
    pub topic: String,
    /// Frame that the transforms lead to.
    pub parent: String,
    /// Frame that they come from.
    pub child: String,
    /// Pose of the child in the parent, in the order of the file.
    pub poses: Vec<TimedPose>,
}

/// Measurements of one inertial measurement unit.
#[derive(Clone, Debug, PartialEq)]
pub struct ImuStream {
    /// Topic.
    pub topic: String,
    /// Full name of its message.
    pub schema: String,
    /// Frame of the unit; empty where the message does not say.
    pub frame: String,
    /// Measurements in the order of the file.
    pub samples: Vec<TimedForce>,
}

/// An inertial measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedForce {
    /// Time of the measurement, ns since 1970-01-01 UTC.
    pub time_ns: i64,
    /// Angular velocity in the unit's frame, rad/s.
    pub angular_velocity_rad_s: [f64; 3],
    /// Specific force in the unit's frame (+g upwards at rest), m/s2.
    pub specific_force_m_s2: [f64; 3],
}
