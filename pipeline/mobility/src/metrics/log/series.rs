//! Pose series: validation, pieces without gaps, even sampling.

use super::LogError;
use sastrugi_numeric::sums;
use sastrugi_schemas::counted;
use sastrugi_schemas::log::{PoseStream, TimedPose};
use sastrugi_schemas::topics::StateSample;

/// A gap is longer than this many median intervals and than [`GAP_MIN_S`].
const GAP_INTERVALS: f64 = 5.0;
/// Shortest gap, s.
const GAP_MIN_S: f64 = 0.25;
/// Largest accepted deviation of a quaternion's length from 1.
const LENGTH_TOLERANCE: f64 = 1e-2;
/// Quaternions whose length deviates by less are not normalised, so that a recording in steps of 2^-20 is analysed bit for bit
/// as recorded.
const ROUNDING: f64 = 4e-6;
/// Intervals count as even if each is within this share of the median.
const EVEN: f64 = 1e-3;

/// A rotation as unit quaternion `[x, y, z, w]`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rotation(pub [f64; 4]);

impl Rotation {
    /// A rotated vector: v + 2 w (q x v) + 2 q x (q x v).
    pub(super) fn of(self, v: [f64; 3]) -> [f64; 3] {
        let [x, y, z, w] = self.0;
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let t = cross([x, y, z], v).map(|c| 2.0 * c);
        let u = cross([x, y, z], t);
        std::array::from_fn(|i| v[i] + w * t[i] + u[i])
    }

    /// This rotation after another: the product of the quaternions.
    pub(super) fn after(self, [x, y, z, w]: [f64; 4]) -> [f64; 4] {
        let [a, b, c, d] = self.0;
        [
            d * x + a * w + b * z - c * y,
            d * y - a * z + b * w + c * x,
            d * z + a * y - b * x + c * w,
            d * w - a * x - b * y - c * z,
        ]
    }
}

/// Interpolates between two poses: positions linearly, orientations along the shorter arc (by the normalised mean of the
/// quaternions, which deviates by less than 1e-4 of the angle for turns of a few degrees).
pub(super) fn between(before: &TimedPose, after: &TimedPose, time_ns: i64) -> TimedPose {
    let share = (time_ns - before.time_ns) as f64 / (after.time_ns - before.time_ns) as f64;
    let mix = |a: f64, b: f64| a + (b - a) * share;
    let near = before.orientation.iter().zip(&after.orientation).map(|(a, b)| a * b).sum::<f64>() >= 0.0;
    let sign = if near { 1.0 } else { -1.0 };
    let mixed: [f64; 4] = std::array::from_fn(|i| mix(before.orientation[i], sign * after.orientation[i]));
    let length = mixed.iter().map(|c| c * c).sum::<f64>().sqrt();
    let rates = before.angular_velocity_rad_s.zip(after.angular_velocity_rad_s);
    TimedPose {
        time_ns,
        position_m: std::array::from_fn(|i| mix(before.position_m[i], after.position_m[i])),
        orientation: mixed.map(|c| c / length),
        angular_velocity_rad_s: rates.map(|(a, b)| std::array::from_fn(|i| mix(a[i], b[i]))),
    }
}

/// Usable poses in order of time, and notes on those dropped.
pub(super) fn cleaned(stream: &PoseStream) -> Result<(Vec<TimedPose>, Vec<String>), LogError> {
    let (mut poses, mut unusable, mut repeated): (Vec<TimedPose>, u64, u64) = (Vec::new(), 0, 0);
    for (index, pose) in stream.poses.iter().enumerate() {
        let numbers = pose.position_m.iter().chain(&pose.orientation);
        if !numbers.clone().all(|v| v.is_finite()) {
            unusable += 1;
            continue;
        }
        let length = pose.orientation.iter().map(|c| c * c).sum::<f64>().sqrt();
        if (length - 1.0).abs() > LENGTH_TOLERANCE {
            return Err(LogError::Orientation { topic: stream.topic.clone(), message: index + 1, length });
        }
        match poses.last().map(|last| pose.time_ns - last.time_ns) {
            Some(0) => repeated += 1,
            Some(step) if step < 0 => {
                let back_s = -step as f64 * 1e-9;
                return Err(LogError::Backwards { topic: stream.topic.clone(), message: index + 1, back_s });
            }
            _ if (length - 1.0).abs() < ROUNDING => poses.push(*pose),
            _ => poses.push(TimedPose { orientation: pose.orientation.map(|c| c / length), ..*pose }),
        }
    }
    if poses.len() < 3 {
        return Err(LogError::TooFew { topic: stream.topic.clone(), poses: poses.len() });
    }
    let mut notes = Vec::new();
    if unusable > 0 {
        notes.push(format!("dropped {} with numbers that are not finite", counted(unusable, "pose")));
    }
    if repeated > 0 {
        notes.push(format!("dropped {} with the same time as the previous one", counted(repeated, "pose")));
    }
    Ok((poses, notes))
}

/// Median interval between times, s.
pub(super) fn interval_s(times_ns: &[i64]) -> f64 {
    let steps: Vec<f64> = times_ns.windows(2).map(|w| (w[1] - w[0]) as f64 * 1e-9).collect();
    sums::median(&steps)
}

/// Indices of the first and last element of every piece without a gap.
pub(super) fn pieces(times_ns: &[i64]) -> Vec<[usize; 2]> {
    let longest_s = (GAP_INTERVALS * interval_s(times_ns)).max(GAP_MIN_S);
    let mut pieces = Vec::new();
    let mut first = 0;
    for (k, w) in times_ns.windows(2).enumerate() {
        if (w[1] - w[0]) as f64 * 1e-9 > longest_s {
            pieces.push([first, k]);
            first = k + 1;
        }
    }
    pieces.push([first, times_ns.len().saturating_sub(1)]);
    pieces
}

/// True when all intervals match a rate.
pub(super) fn is_even(times_ns: &[i64], rate_hz: f64) -> bool {
    times_ns.windows(2).all(|w| ((w[1] - w[0]) as f64 * 1e-9 * rate_hz - 1.0).abs() < EVEN)
}

/// Evenly sampled states from the first pose on: the poses themselves if they are evenly spaced, interpolated otherwise. Times
/// are relative to `zero_ns`.
pub(super) fn states(poses: &[TimedPose], rate_hz: f64, zero_ns: i64) -> Vec<StateSample> {
    let times: Vec<i64> = poses.iter().map(|pose| pose.time_ns).collect();
    let even = if is_even(&times, rate_hz) { poses.to_vec() } else { sampled(poses, &times, rate_hz) };
    let state = |(k, pose): (usize, &TimedPose)| StateSample {
        time_s: (pose.time_ns - zero_ns) as f64 * 1e-9,
        position_m: pose.position_m,
        orientation: pose.orientation,
        velocity_m_s: [f64::NAN; 3],
        angular_velocity_rad_s: pose.angular_velocity_rad_s.unwrap_or_else(|| rates(&even, k, rate_hz)),
    };
    even.iter().enumerate().map(state).collect()
}

fn sampled(poses: &[TimedPose], times: &[i64], rate_hz: f64) -> Vec<TimedPose> {
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return Vec::new() };
    let instants = (0u64..).map(|k| first + (k as f64 / rate_hz * 1e9).round() as i64).take_while(|t| *t <= last);
    let at = |time_ns: i64| {
        let after = times.partition_point(|t| *t < time_ns);
        if times[after] == time_ns { poses[after] } else { between(&poses[after - 1], &poses[after], time_ns) }
    };
    instants.map(at).collect()
}

/// Angular velocity in the body frame from neighbouring orientations: twice the vector part of the rotation between them,
/// divided by the time between them (second-order accurate in the rotation).
fn rates(poses: &[TimedPose], k: usize, rate_hz: f64) -> [f64; 3] {
    let (low, high) = (k.saturating_sub(1), (k + 1).min(poses.len() - 1));
    if low == high {
        return [f64::NAN; 3];
    }
    let [x, y, z, w] = poses[low].orientation;
    let [a, b, c, d] = Rotation([-x, -y, -z, w]).after(poses[high].orientation);
    let scale = 2.0 * rate_hz / (high - low) as f64 * if d < 0.0 { -1.0 } else { 1.0 };
    [a * scale, b * scale, c * scale]
}
