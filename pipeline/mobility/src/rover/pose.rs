//! Position, heading and attitude of a rover.

use sastrugi_numeric::{Ground, NoGround};
use std::f64::consts::{PI, TAU};

/// Position and heading in plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Centre, m.
    pub position_m: [f64; 2],
    /// Counterclockwise from east, rad.
    pub heading_rad: f64,
}

impl Pose {
    /// The rover's own axes.
    pub fn axes(&self) -> Axes {
        let (sin, cos) = libm::sincos(self.heading_rad);
        Axes { origin_m: self.position_m, sin, cos }
    }

    /// Transforms a point from the rover's own axes (ahead, left), m, to those of the terrain.
    pub fn to_ground(&self, point: [f64; 2]) -> [f64; 2] {
        self.axes().to_ground(point)
    }

    /// The pose after a turn to the left.
    pub fn turned(&self, angle_rad: f64) -> Self {
        Self { heading_rad: wrapped(self.heading_rad + angle_rad), ..*self }
    }

    /// The pose after a drive ahead; back if negative.
    pub fn driven(&self, distance_m: f64) -> Self {
        Self { position_m: self.to_ground([distance_m, 0.0]), ..*self }
    }

    /// Distance to a point, m.
    pub fn distance_m(&self, [x, y]: [f64; 2]) -> f64 {
        let (dx, dy) = (x - self.position_m[0], y - self.position_m[1]);
        (dx * dx + dy * dy).sqrt()
    }

    /// Turn to the left after which the rover faces a point, in -pi to pi.
    pub fn bearing_error_rad(&self, [x, y]: [f64; 2]) -> f64 {
        wrapped(libm::atan2(y - self.position_m[1], x - self.position_m[0]) - self.heading_rad)
    }
}

/// Axes of a rover (ahead, left), for transforming many points of one pose: sine and cosine of the heading are computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    origin_m: [f64; 2],
    sin: f64,
    cos: f64,
}

impl Axes {
    /// Transforms a point (ahead, left), m, to the axes of the terrain.
    #[inline]
    pub fn to_ground(&self, [ahead, left]: [f64; 2]) -> [f64; 2] {
        let Self { origin_m: [x, y], sin, cos } = *self;
        [x + ahead * cos - left * sin, y + ahead * sin + left * cos]
    }
}

/// An angle wrapped to -pi to pi.
pub fn wrapped(angle_rad: f64) -> f64 {
    let turns = (angle_rad / TAU).round();
    (angle_rad - turns * TAU).clamp(-PI, PI)
}

/// Wheel geometry of a rover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chassis {
    /// Distance of the axles from the centre, m.
    pub axle_m: f64,
    /// Distance of the wheels from the centre line, m.
    pub track_m: f64,
}

/// Height and attitude of a rover: the least-squares plane through the heights of its four wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Height of the plane at the centre, m.
    pub height_m: f64,
    /// Rise of the plane ahead and to the left, m per m.
    pub slopes: [f64; 2],
}

impl Body {
    /// A rover on its four wheels.
    ///
    /// # Errors
    /// A wheel over unknown ground.
    pub fn standing(ground: &impl Ground, pose: &Pose, chassis: &Chassis) -> Result<Self, NoGround> {
        let Chassis { axle_m: a, track_m: t } = *chassis;
        let axes = pose.axes();
        let wheel = |ahead: f64, left: f64| {
            let [x, y] = axes.to_ground([ahead, left]);
            ground.at(x, y).map(|point| point.height_m)
        };
        let [fl, fr, rl, rr] = [wheel(a, t)?, wheel(a, -t)?, wheel(-a, t)?, wheel(-a, -t)?];
        let (front, rear, left, right) = (fl + fr, rl + rr, fl + rl, fr + rr);
        Ok(Self { height_m: 0.25 * (front + rear), slopes: [(front - rear) / (4.0 * a), (left - right) / (4.0 * t)] })
    }

    /// Height of the plane at a point of the rover's own axes, m.
    pub fn height_at_m(&self, [ahead, left]: [f64; 2]) -> f64 {
        self.height_m + (self.slopes[0] * ahead + self.slopes[1] * left)
    }

    /// Angle between the plane and the horizontal, rad.
    pub fn tilt_rad(&self) -> f64 {
        let [ahead, left] = self.slopes;
        libm::atan((ahead * ahead + left * left).sqrt())
    }

    /// Roll (left side up) and pitch (nose down), rad, of a rover whose yaw is its heading.
    pub fn roll_pitch_rad(&self) -> [f64; 2] {
        let [ahead, left] = self.slopes;
        let pitch = -libm::atan(ahead);
        [libm::atan(left * libm::cos(pitch)), pitch]
    }

    /// Unit quaternion `[x, y, z, w]` of the body in the terrain's axes.
    pub fn orientation(&self, heading_rad: f64) -> [f64; 4] {
        let [roll, pitch] = self.roll_pitch_rad();
        let ((sr, cr), (sp, cp), (sy, cy)) =
            (libm::sincos(0.5 * roll), libm::sincos(0.5 * pitch), libm::sincos(0.5 * heading_rad));
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    }
}
