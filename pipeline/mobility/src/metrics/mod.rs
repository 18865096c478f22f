//! Metrics of a traverse, computed from its recorded poses alone, so the same code evaluates simulated and external logs.
//!
//! With heights `z_k` and angles `a_k` sampled at the rate `f`:
//!
//! | metric | formula |
//! |---|---|
//! | vertical acceleration | `(z[k+1] - 2 z[k] + z[k-1]) f^2`, root mean square |
//! | pitch and roll rate | `(a[k+1] - a[k]) f` of the Euler angles, root mean square |
//! | body pitch and roll rate | recorded angular velocity about the body's y and x, root mean square |
//! | path length | sum of plan distances between samples |
//! | efficiency | plan distance between first and last sample divided by path length |
//! | cross-track error | distance of each sample from its foot on the line or polyline, root mean square and largest |
//!
//! The `gradient` differentiator takes central differences, one-sided at the ends, once for rates and twice for the
//! acceleration. Second differences attenuate a heave of frequency `w` by `sinc^2(w / 2f)`, two gradients by `sinc^2(w / f)`,
//! with `sinc x = sin x / x`. In a vehicle's band of 0.2 to 8 Hz sampled at 20 Hz, second differences preserve most of it.
//!
//! Euler angles are roll about x forward, pitch about y left (nose down positive), yaw about z up, applied in the order
//! yaw, pitch, roll. Source: Majhor and Bos, section 2.4, which leaves the differentiator open. Cost: one pass per metric.

pub mod log;
mod rows;
#[cfg(test)]
mod tests;
mod tracking;

pub use rows::{MissionLabels, mission_row, progress_m, replicate_row, sample_rows};
pub use tracking::{CrossTrack, cross_track};

use sastrugi_numeric::sums;
use sastrugi_schemas::topics::StateSample;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How recorded series are differentiated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Differentiator {
    /// Differences between neighbouring samples: first differences for rates, second differences for accelerations.
    #[default]
    SecondDifference,
    /// Central differences, applied twice for accelerations.
    Gradient,
}

/// Roll, pitch and yaw, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EulerAngles {
    /// About x forward, in [-pi, pi].
    pub roll: f64,
    /// About y left, nose down positive, in [-pi/2, pi/2].
    pub pitch: f64,
    /// About z up, counterclockwise from east, in [-pi, pi].
    pub yaw: f64,
}

impl EulerAngles {
    /// The angles of a unit quaternion `[x, y, z, w]` (map from base_link).
    ///
    /// ```
    /// use sastrugi_mobility::metrics::EulerAngles;
    /// use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};
    ///
    /// // Facing north: a quarter turn counterclockwise from east.
    /// let north = EulerAngles::of([0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2]);
    /// assert!((north.yaw - FRAC_PI_2).abs() < 1e-12);
    /// assert_eq!((north.roll, north.pitch), (0.0, 0.0));
    /// ```
    pub fn of([x, y, z, w]: [f64; 4]) -> Self {
        Self {
            roll: libm::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            pitch: libm::asin((2.0 * (w * y - z * x)).clamp(-1.0, 1.0)),
            yaw: libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        }
    }
}

/// Metrics of one traverse; NaN where the recording is too short.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metrics {
    /// Length of the path in plan, m.
    pub path_length_m: f64,
    /// Plan distance between first and last sample divided by path length; NaN for a vehicle that did not move.
    pub efficiency: f64,
    /// RMS vertical acceleration, m/s2.
    pub rms_vertical_acceleration_m_s2: f64,
    /// RMS rate of the pitch angle, rad/s.
    pub rms_pitch_rate_rad_s: f64,
    /// RMS rate of the roll angle, rad/s.
    pub rms_roll_rate_rad_s: f64,
    /// RMS angular velocity about the body's y axis, rad/s.
    pub rms_body_pitch_rate_rad_s: f64,
    /// RMS angular velocity about the body's x axis, rad/s.
    pub rms_body_roll_rate_rad_s: f64,
    /// Largest absolute pitch, rad.
    pub max_pitch_rad: f64,
    /// Largest absolute roll, rad.
    pub max_roll_rad: f64,
}

impl Metrics {
    /// Metrics of poses at a fixed rate.
    ///
    /// ```
    /// use sastrugi_mobility::metrics::{Differentiator, Metrics};
    /// use sastrugi_schemas::topics::StateSample;
    ///
    /// // East for 2 s at 1 m/s, rising with 1 m/s2, sampled at 10 Hz.
    /// let state = |k: u32| {
    ///     let time_s = 0.1 * f64::from(k);
    ///     StateSample {
    ///         time_s,
    ///         position_m: [time_s, 0.0, 0.5 * time_s * time_s],
    ///         orientation: [0.0, 0.0, 0.0, 1.0],
    ///         velocity_m_s: [1.0, 0.0, time_s],
    ///         angular_velocity_rad_s: [0.0; 3],
    ///     }
    /// };
    /// let states: Vec<StateSample> = (0..=20).map(state).collect();
    /// let metrics = Metrics::of(&states, 10.0, Differentiator::SecondDifference);
    /// assert!((metrics.path_length_m - 2.0).abs() < 1e-12);
    /// assert!((metrics.rms_vertical_acceleration_m_s2 - 1.0).abs() < 1e-9);
    /// assert_eq!(metrics.rms_pitch_rate_rad_s, 0.0);
    /// ```
    pub fn of(states: &[StateSample], sample_rate_hz: f64, differentiator: Differentiator) -> Self {
        let angles: Vec<EulerAngles> = states.iter().map(|s| EulerAngles::of(s.orientation)).collect();
        let heights: Vec<f64> = states.iter().map(|s| s.position_m[2]).collect();
        let (pitch, roll): (Vec<f64>, Vec<f64>) = angles.iter().map(|a| (a.pitch, a.roll)).unzip();
        let body_rate = |axis: usize| rms(&states.iter().map(|s| s.angular_velocity_rad_s[axis]).collect::<Vec<_>>());
        let path_length_m = path_length(states);
        Self {
            path_length_m,
            efficiency: displacement(states) / path_length_m,
            rms_vertical_acceleration_m_s2: rms(&differentiator.second(&heights, sample_rate_hz)),
            rms_pitch_rate_rad_s: rms(&differentiator.first(&unwrapped(&pitch), sample_rate_hz)),
            rms_roll_rate_rad_s: rms(&differentiator.first(&unwrapped(&roll), sample_rate_hz)),
            rms_body_pitch_rate_rad_s: body_rate(1),
            rms_body_roll_rate_rad_s: body_rate(0),
            max_pitch_rad: max_abs(&pitch),
            max_roll_rad: max_abs(&roll),
        }
    }
}

impl Differentiator {
    /// First derivative of a series.
    fn first(self, series: &[f64], rate_hz: f64) -> Vec<f64> {
        match self {
            Self::SecondDifference => series.windows(2).map(|w| (w[1] - w[0]) * rate_hz).collect(),
            Self::Gradient => gradient(series, rate_hz),
        }
    }

    /// Second derivative of a series.
    fn second(self, series: &[f64], rate_hz: f64) -> Vec<f64> {
        match self {
            Self::SecondDifference => {
                series.windows(3).map(|w| (w[2] - 2.0 * w[1] + w[0]) * rate_hz * rate_hz).collect()
            }
            Self::Gradient => gradient(&gradient(series, rate_hz), rate_hz),
        }
    }

    /// RMS of the first (`derivative` 1) or second derivative of white noise of variance 1, away from the ends: differences have
    /// twice the variance, second differences six times; central differences span two samples.
    fn noise_gain(self, derivative: u32, rate_hz: f64) -> f64 {
        let samples = match self {
            Self::SecondDifference => 1.0,
            Self::Gradient => 2.0,
        };
        let rate_hz = rate_hz / samples;
        if derivative == 2 { 6.0f64.sqrt() * rate_hz * rate_hz } else { 2.0f64.sqrt() * rate_hz }
    }
}

/// Central differences, one-sided at the ends; empty for fewer than two values.
fn gradient(series: &[f64], rate_hz: f64) -> Vec<f64> {
    let Some(last) = series.len().checked_sub(1).filter(|&last| last > 0) else { return Vec::new() };
    let between = |low: usize, high: usize| (series[high] - series[low]) * rate_hz / (high - low) as f64;
    (0..=last).map(|k| between(k.saturating_sub(1), (k + 1).min(last))).collect()
}

/// Unwrapped angles: without jumps of a full turn.
fn unwrapped(angles: &[f64]) -> Vec<f64> {
    let mut turns = 0.0;
    let jumps = angles.windows(2).map(|w| ((w[0] - w[1]) / std::f64::consts::TAU).round());
    let shifts = std::iter::once(0.0).chain(jumps);
    angles
        .iter()
        .zip(shifts)
        .map(|(angle, jump)| {
            turns += jump;
            angle + turns * std::f64::consts::TAU
        })
        .collect()
}

/// Root mean square; NaN without values.
fn rms(values: &[f64]) -> f64 {
    sums::mean(&values.iter().map(|v| v * v).collect::<Vec<_>>()).sqrt()
}

fn max_abs(values: &[f64]) -> f64 {
    values.iter().fold(f64::NAN, |largest, v| if largest.is_nan() { v.abs() } else { largest.max(v.abs()) })
}

fn path_length(states: &[StateSample]) -> f64 {
    sums::sum(&states.windows(2).map(|w| plan_distance(&w[0], &w[1])).collect::<Vec<_>>())
}

fn displacement(states: &[StateSample]) -> f64 {
    states.first().zip(states.last()).map_or(f64::NAN, |(first, last)| plan_distance(first, last))
}

fn plan_distance(a: &StateSample, b: &StateSample) -> f64 {
    let (dx, dy) = (b.position_m[0] - a.position_m[0], b.position_m[1] - a.position_m[1]);
    (dx * dx + dy * dy).sqrt()
}
