//! The motion of a vehicle from an MCAP log of any origin: the form in which logs pass from the file readers to the metrics.

/// A log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// Streams of poses, in the order of their channels.
    pub poses: Vec<PoseStream>,
    /// Transforms between frames, one stream for each pair of frames on a topic.
    pub transforms: Vec<TransformStream>,
    /// Inertial measurement units.
    pub imus: Vec<ImuStream>,
    /// Outcomes stated in the log, in order of time: the names of its events.
    pub events: Vec<(i64, String)>,
    /// Where the file is truncated, as text; everything before has been read.
    pub broken: Option<String>,
    /// Topics with known messages in an unsupported encoding, as text.
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
    /// Angular velocity in the body's frame, rad/s, if the message has one.
    pub angular_velocity_rad_s: Option<[f64; 3]>,
}

/// Poses of one topic.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseStream {
    /// Topic.
    pub topic: String,
    /// Full name of its message.
    pub schema: String,
    /// Reference frame of the poses, from the first message.
    pub frame: String,
    /// Frame of the body; empty if the message does not state it.
    pub body: String,
    /// Poses, in file order.
    pub poses: Vec<TimedPose>,
}

/// Transforms of one pair of frames on one topic.
#[derive(Clone, Debug, PartialEq)]
pub struct TransformStream {
    /// Topic.
    pub topic: String,
    /// Parent frame.
    pub parent: String,
    /// Child frame.
    pub child: String,
    /// Pose of the child in the parent, in file order.
    pub poses: Vec<TimedPose>,
}

/// Measurements of one inertial measurement unit.
#[derive(Clone, Debug, PartialEq)]
pub struct ImuStream {
    /// Topic.
    pub topic: String,
    /// Full name of its message.
    pub schema: String,
    /// Frame of the unit; empty if the message does not state it.
    pub frame: String,
    /// Measurements, in file order.
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
