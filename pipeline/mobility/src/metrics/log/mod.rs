//! Metrics of a log of any origin: the metrics of a simulated mission, computed by the same code, with the noise floor of the
//! log.
//!
//! A pose stream is cut at gaps (longer than five median intervals and 0.25 s). A piece whose poses are evenly spaced at the
//! sampling rate is used unchanged; any other piece is interpolated at that rate, without a filter, as a simulation samples.
//! Root mean squares are pooled over the pieces.
//!
//! Second differences of heights at 20 Hz amplify noise: 1 mm of white noise gives 0.98 m/s2. Each root mean square therefore
//! comes with a floor: the value that white noise alone would give, for the smaller of two upper bounds on the noise density,
//! the top eighth of the spectrum and the quietest second of a vehicle at rest. Below three floors the answer is "cannot tell".
//! Recordings in sastrugi's own messages hold the simulated poses, rounded to 2^-20 m (2.7e-4 m/s2), so their floors are 0.
//! sastrugi's ROS 2 bags hold the same poses, but their messages do not identify them as simulated: their floors are estimated
//! as for any log.
//!
//! In addition to the second difference, the vertical acceleration is computed in one band (0.2 to 8 Hz by default), from the
//! spectrum of the heights and, if there is an inertial measurement unit, from its specific force rotated upright by the poses.
//! Both use the same band, whatever the rates. Prefer the value of the unit.
//!
//! Cost: a few passes over the poses, plus 10 s of samples times the bins of a segment per half segment.

mod frames;
mod ground;
mod series;
mod spectrum;
#[cfg(test)]
mod tests;

pub use ground::{OnGround, on_ground};

use super::{Differentiator, EulerAngles, Metrics};
use sastrugi_schemas::counted;
use sastrugi_schemas::log::{ImuStream, Log, PoseStream, TimedPose};
use sastrugi_schemas::topics::StateSample;
use series::Rotation;
use spectrum::Spectrum;

/// Standard gravity, m/s2.
const GRAVITY_M_S2: f64 = 9.80665;
/// A metric is significant above this many noise floors.
const FLOORS: f64 = 3.0;
/// A vehicle that moves by less than this within a second is at rest, m.
const REST_M: f64 = 0.02;

/// Why a log cannot be analysed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LogError {
    /// The log holds no poses.
    #[error(
        "no pose stream: the log must contain Odometry, PoseStamped or TFMessage (ROS 2), or PoseInFrame, Odometry or \
         FrameTransform(s) (Foxglove) messages{unread}"
    )]
    NoPoses {
        /// Topics that could not be read, as text.
        unread: String,
    },
    /// The named topic has no poses.
    #[error("no poses on the topic `{topic}`; topics with poses: {known}")]
    NoTopic {
        /// The requested topic.
        topic: String,
        /// Topics with poses.
        known: String,
    },
    /// The transforms do not lead to a frame.
    #[error("no transforms lead to the frame `{frame}`; they lead to {}", known.join(", "))]
    NoFrame {
        /// The requested frame.
        frame: String,
        /// Frames that the transforms lead to.
        known: Vec<String>,
    },
    /// Time goes backwards.
    #[error("on {topic}, time goes back by {back_s} s at pose {message}; cut the log there, or name another topic")]
    Backwards {
        /// Topic.
        topic: String,
        /// Number of the pose, from 1.
        message: usize,
        /// By how much, s.
        back_s: f64,
    },
    /// A quaternion that is not a rotation.
    #[error("on {topic}, the orientation quaternion of pose {message} has length {length}; it must have length 1")]
    Orientation {
        /// Topic.
        topic: String,
        /// Number of the pose, from 1.
        message: usize,
        /// Length of the quaternion.
        length: f64,
    },
    /// Fewer than three usable poses.
    #[error("too few usable poses on {topic}: metrics need at least 3, got {poses}")]
    TooFew {
        /// Topic.
        topic: String,
        /// Usable poses.
        poses: usize,
    },
}

/// Settings of the analysis of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct LogSettings {
    /// Topic of the poses; chosen by message type when absent.
    pub topic: Option<String>,
    /// Frame of the body, where poses come as transforms.
    pub body_frame: String,
    /// Frame in which the body moves; the root of the transforms when absent.
    pub fixed_frame: Option<String>,
    /// Sampling rate, Hz; a log with fewer poses keeps its own rate.
    pub rate_hz: f64,
    /// Band of the acceleration, Hz.
    pub band_hz: [f64; 2],
    /// How series are differentiated.
    pub differentiator: Differentiator,
}

impl Default for LogSettings {
    fn default() -> Self {
        Self {
            topic: None,
            body_frame: "base_link".to_owned(),
            fixed_frame: None,
            rate_hz: 20.0,
            band_hz: [0.2, 8.0],
            differentiator: Differentiator::default(),
        }
    }
}

/// A root mean square and its noise floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AboveNoise {
    /// Root mean square.
    pub rms: f64,
    /// Root mean square of white noise alone; NaN where it could not be estimated.
    pub floor: f64,
}

impl AboveNoise {
    /// True when the root mean square is at least three noise floors.
    pub fn tells(&self) -> bool {
        self.rms >= FLOORS * self.floor
    }
}

/// Metrics of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    /// Topic of the poses.
    pub topic: String,
    /// Type of the messages, or the chain of transforms.
    pub schema: String,
    /// Frame in which the body moves.
    pub frame: String,
    /// Other pose streams, as text.
    pub others: Vec<String>,
    /// Poses used.
    pub poses: usize,
    /// Time of the first pose, ns since 1970-01-01 UTC.
    pub start_ns: i64,
    /// From the first to the last pose, s.
    pub duration_s: f64,
    /// Gaps: start and end, s after the first pose.
    pub gaps_s: Vec<[f64; 2]>,
    /// Median rate of the poses, Hz.
    pub pose_rate_hz: f64,
    /// Rate of the samples from which metrics are computed, Hz.
    pub sample_rate_hz: f64,
    /// True when poses were interpolated to evenly spaced times.
    pub resampled: bool,
    /// Metrics as of a mission, pooled over the pieces.
    pub metrics: Metrics,
    /// Vertical acceleration by second differences, m/s2.
    pub acceleration: AboveNoise,
    /// Rate of the pitch angle, rad/s.
    pub pitch_rate: AboveNoise,
    /// Rate of the roll angle, rad/s.
    pub roll_rate: AboveNoise,
    /// Vertical acceleration in the band, from the heights, m/s2.
    pub band_acceleration: Option<AboveNoise>,
    /// The same from an inertial measurement unit, and its topic.
    pub imu_acceleration: Option<(AboveNoise, String)>,
    /// Pieces without gaps.
    pub pieces: Vec<Vec<StateSample>>,
    /// Notes for the reader.
    pub notes: Vec<String>,
}

/// Analyses a log.
///
/// # Errors
/// [`LogError`]
///
/// ```
/// use sastrugi_mobility::metrics::log::{LogSettings, analyse};
/// use sastrugi_schemas::log::{Log, PoseStream, TimedPose};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // Odometry at 20 Hz of a vehicle that drives east at 1 m/s for 10 s.
/// let pose = |k: i64| TimedPose {
///     time_ns: 50_000_000 * k,
///     position_m: [0.05 * k as f64, 0.0, 0.0],
///     orientation: [0.0, 0.0, 0.0, 1.0],
///     angular_velocity_rad_s: None,
/// };
/// let stream = PoseStream {
///     topic: "/odom".to_owned(),
///     schema: "nav_msgs/msg/Odometry".to_owned(),
///     frame: "odom".to_owned(),
///     body: "base_link".to_owned(),
///     poses: (0..=200).map(pose).collect(),
/// };
/// let log = Log { poses: vec![stream], ..Log::default() };
/// let analysis = analyse(&log, &LogSettings::default())?;
/// assert!((analysis.metrics.path_length_m - 10.0).abs() < 1e-9);
/// assert!(!analysis.resampled && analysis.gaps_s.is_empty());
/// # Ok(())
/// # }
/// ```
pub fn analyse(log: &Log, settings: &LogSettings) -> Result<Analysis, LogError> {
    let (stream, others) = chosen(log, settings)?;
    let (poses, mut notes) = series::cleaned(&stream)?;
    let times: Vec<i64> = poses.iter().map(|pose| pose.time_ns).collect();
    let start_ns = times[0];
    let seconds = |time_ns: i64| (time_ns - start_ns) as f64 * 1e-9;
    let pose_rate_hz = 1.0 / series::interval_s(&times);
    let sample_rate_hz = rate(settings.rate_hz, pose_rate_hz);
    if sample_rate_hz < settings.rate_hz {
        notes.push(format!(
            "poses come at {sample_rate_hz:.3} Hz, below the {} Hz sampling rate of the metrics: they miss fast motion",
            settings.rate_hz
        ));
    }
    let ranges = series::pieces(&times);
    let resampled = ranges.iter().any(|[first, last]| !series::is_even(&times[*first..=*last], sample_rate_hz));
    let piece = |[first, last]: &[usize; 2]| series::states(&poses[*first..=*last], sample_rate_hz, start_ns);
    let pieces: Vec<Vec<StateSample>> = ranges.iter().map(piece).collect();
    let metrics = pooled(&pieces, sample_rate_hz, settings.differentiator);
    let exact = stream.schema == SIMULATED;
    let noise = Noise { pieces: &pieces, rate_hz: sample_rate_hz, differentiator: settings.differentiator, exact };
    let heights: Vec<Vec<f64>> = pieces.iter().map(|p| p.iter().map(|s| s.position_m[2]).collect()).collect();
    let imu_acceleration = log.imus.iter().max_by_key(|imu| imu.samples.len()).and_then(|imu| {
        let upright = upright(imu, log, &poses, settings);
        notes.extend(upright.note);
        let spectrum = Spectrum::of(&upright.pieces, upright.rate_hz)?;
        Some((in_band(&spectrum, settings.band_hz, 0, exact), imu.topic.clone()))
    });
    Ok(Analysis {
        topic: stream.topic,
        schema: stream.schema,
        frame: stream.frame,
        others,
        poses: poses.len(),
        start_ns,
        duration_s: seconds(times[times.len() - 1]),
        gaps_s: ranges.windows(2).map(|w| [seconds(times[w[0][1]]), seconds(times[w[1][0]])]).collect(),
        pose_rate_hz,
        sample_rate_hz,
        resampled,
        acceleration: noise.with_floor(metrics.rms_vertical_acceleration_m_s2, |s| s.position_m[2], 2),
        pitch_rate: noise.with_floor(metrics.rms_pitch_rate_rad_s, |s| EulerAngles::of(s.orientation).pitch, 1),
        roll_rate: noise.with_floor(metrics.rms_roll_rate_rad_s, |s| EulerAngles::of(s.orientation).roll, 1),
        band_acceleration: Spectrum::of(&heights, sample_rate_hz).map(|s| in_band(&s, settings.band_hz, 2, exact)),
        imu_acceleration,
        metrics,
        pieces,
        notes,
    })
}

/// The sampling rate of the metrics: the desired rate, or that of the poses if it is lower by more than their jitter.
fn rate(wanted_hz: f64, pose_rate_hz: f64) -> f64 {
    if pose_rate_hz > 0.95 * wanted_hz { wanted_hz } else { pose_rate_hz }
}

fn in_band(spectrum: &Spectrum, band_hz: [f64; 2], derivative: i32, exact: bool) -> AboveNoise {
    let rms = spectrum.band_rms(band_hz, derivative);
    let density = if exact { 0.0 } else { spectrum.top() };
    AboveNoise { rms, floor: spectrum.noise_rms(band_hz, derivative, density) }
}

/// Message type of poses without noise.
const SIMULATED: &str = "sastrugi.VehicleState";

/// Message types with poses, in order of preference: types that identify the body come before those that do not.
const PREFERRED: [&str; 6] = [
    SIMULATED,
    "nav_msgs/msg/Odometry",
    "foxglove.Odometry",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/PoseStamped",
    "foxglove.PoseInFrame",
];

/// The stream to analyse, and the others as text.
fn chosen(log: &Log, settings: &LogSettings) -> Result<(PoseStream, Vec<String>), LogError> {
    let words =
        |stream: &PoseStream| format!("{} ({}, {})", stream.topic, stream.schema, counted(stream.poses.len(), "pose"));
    let of_transforms = frames::path(&log.transforms, &settings.body_frame, settings.fixed_frame.as_deref());
    let mut streams: Vec<&PoseStream> = log.poses.iter().collect();
    let rank = |s: &PoseStream| PREFERRED.iter().position(|p| *p == s.schema).unwrap_or(PREFERRED.len());
    streams.sort_by_key(|s| (rank(s), std::cmp::Reverse(s.poses.len())));
    let found = match &settings.topic {
        None => streams.first().copied(),
        Some(topic) => streams.iter().find(|s| s.topic == *topic).copied(),
    };
    let by_transforms = settings.topic.as_ref().is_some_and(|t| log.transforms.iter().any(|s| s.topic == *t));
    let chosen = match found {
        Some(stream) => stream.clone(),
        None if by_transforms || (settings.topic.is_none() && !log.transforms.is_empty()) => of_transforms.clone()?,
        None => return Err(no_stream(log, settings, &streams)),
    };
    let all = streams.into_iter().chain(of_transforms.as_ref().ok());
    let others = all.filter(|s| s.topic != chosen.topic || s.schema != chosen.schema).map(words).collect();
    Ok((chosen, others))
}

fn no_stream(log: &Log, settings: &LogSettings, streams: &[&PoseStream]) -> LogError {
    let known: Vec<&str> = streams.iter().map(|s| s.topic.as_str()).collect();
    match &settings.topic {
        Some(topic) if !known.is_empty() => LogError::NoTopic { topic: topic.clone(), known: known.join(", ") },
        _ if log.unread.is_empty() => LogError::NoPoses { unread: String::new() },
        _ => LogError::NoPoses { unread: format!("; not read: {}", log.unread.join(", ")) },
    }
}

/// Metrics over all pieces: lengths are summed, mean squares are weighted by their number of samples.
fn pooled(pieces: &[Vec<StateSample>], rate_hz: f64, differentiator: Differentiator) -> Metrics {
    let all: Vec<(f64, Metrics)> =
        pieces.iter().map(|p| (p.len() as f64, Metrics::of(p, rate_hz, differentiator))).collect();
    if let [(_, only)] = all[..] {
        return only;
    }
    let rms = |metric: fn(&Metrics) -> f64| {
        let known = || all.iter().filter(|(_, m)| metric(m).is_finite());
        let squares: f64 = known().map(|(n, m)| n * metric(m) * metric(m)).sum();
        (squares / known().map(|(n, _)| n).sum::<f64>()).sqrt()
    };
    let largest = |metric: fn(&Metrics) -> f64| all.iter().map(|(_, m)| metric(m)).fold(f64::NAN, f64::max);
    let path_length_m = all.iter().map(|(_, m)| m.path_length_m).sum();
    Metrics {
        path_length_m,
        // The path through a gap is unknown.
        efficiency: f64::NAN,
        rms_vertical_acceleration_m_s2: rms(|m| m.rms_vertical_acceleration_m_s2),
        rms_pitch_rate_rad_s: rms(|m| m.rms_pitch_rate_rad_s),
        rms_roll_rate_rad_s: rms(|m| m.rms_roll_rate_rad_s),
        rms_body_pitch_rate_rad_s: rms(|m| m.rms_body_pitch_rate_rad_s),
        rms_body_roll_rate_rad_s: rms(|m| m.rms_body_roll_rate_rad_s),
        max_pitch_rad: largest(|m| m.max_pitch_rad),
        max_roll_rad: largest(|m| m.max_roll_rad),
    }
}

/// Noise estimator for series of the states.
struct Noise<'a> {
    pieces: &'a [Vec<StateSample>],
    rate_hz: f64,
    differentiator: Differentiator,
    /// The poses are without noise.
    exact: bool,
}

impl Noise<'_> {
    /// The root mean square of a derivative with its noise floor.
    fn with_floor(&self, rms: f64, value: fn(&StateSample) -> f64, derivative: u32) -> AboveNoise {
        if self.exact {
            return AboveNoise { rms, floor: 0.0 };
        }
        let series: Vec<Vec<f64>> = self.pieces.iter().map(|p| p.iter().map(value).collect()).collect();
        let gain = self.differentiator.noise_gain(derivative, self.rate_hz);
        let of_spectrum = Spectrum::of(&series, self.rate_hz).map(|s| s.noise_sigma(s.top()) * gain);
        AboveNoise { rms, floor: of_spectrum.unwrap_or(f64::NAN).min(self.at_rest(&series, derivative)) }
    }

    /// Root mean square over the quietest second at rest; NaN if the vehicle never rests.
    fn at_rest(&self, series: &[Vec<f64>], derivative: u32) -> f64 {
        let window = (self.rate_hz.round() as usize).max(4);
        let mut quietest = f64::NAN;
        for (piece, values) in self.pieces.iter().zip(series) {
            for start in (0..(values.len() + 1).saturating_sub(window)).step_by(window / 2) {
                let [a, b] = [start, start + window - 1].map(|k| piece[k].position_m);
                let moved = (0..3).map(|i| (b[i] - a[i]) * (b[i] - a[i])).sum::<f64>().sqrt();
                if moved < REST_M {
                    let part = &values[start..start + window];
                    let derived = match derivative {
                        2 => self.differentiator.second(part, self.rate_hz),
                        _ => self.differentiator.first(part, self.rate_hz),
                    };
                    quietest = quietest.min(super::rms(&derived));
                }
            }
        }
        quietest
    }
}

/// Vertical acceleration from an inertial measurement unit, in evenly sampled pieces.
struct Upright {
    pieces: Vec<Vec<f64>>,
    rate_hz: f64,
    note: Option<String>,
}

/// The upward component of the unit's specific force in the fixed frame, minus gravity, at the unit's median rate.
fn upright(imu: &ImuStream, log: &Log, poses: &[TimedPose], settings: &LogSettings) -> Upright {
    let aligned = imu.frame.is_empty() || imu.frame == settings.body_frame;
    let mount = (!aligned)
        .then(|| frames::path(&log.transforms, &imu.frame, Some(&settings.body_frame)).ok()?.poses.first().copied())
        .flatten();
    let note = (!aligned && mount.is_none()).then(|| {
        format!("no transform from `{}` to `{}`; the frames are assumed to be parallel", imu.frame, settings.body_frame)
    });
    let turn = Rotation(mount.map_or([0.0, 0.0, 0.0, 1.0], |pose| pose.orientation));
    let mut last = 0;
    let upwards = imu.samples.iter().filter_map(|sample| {
        while last + 1 < poses.len() && poses[last + 1].time_ns <= sample.time_ns {
            last += 1;
        }
        let (before, after) = (&poses[last], poses.get(last + 1)?);
        let known = before.time_ns <= sample.time_ns && sample.specific_force_m_s2.iter().all(|v| v.is_finite());
        let pose = known.then(|| series::between(before, after, sample.time_ns))?;
        let force = Rotation(pose.orientation).of(turn.of(sample.specific_force_m_s2));
        // Stored as a pose, so that it is cut and interpolated like poses.
        Some(TimedPose { position_m: [0.0, 0.0, force[2] - GRAVITY_M_S2], ..pose })
    });
    let mut upwards: Vec<TimedPose> = upwards.collect();
    upwards.sort_by_key(|pose| pose.time_ns);
    upwards.dedup_by_key(|pose| pose.time_ns);
    let times: Vec<i64> = upwards.iter().map(|pose| pose.time_ns).collect();
    if times.len() < 3 {
        return Upright { pieces: Vec::new(), rate_hz: f64::NAN, note };
    }
    let rate_hz = 1.0 / series::interval_s(&times);
    let piece = |[first, last]: [usize; 2]| {
        let states = series::states(&upwards[first..=last], rate_hz, 0);
        states.iter().map(|state| state.position_m[2]).collect()
    };
    Upright { pieces: series::pieces(&times).into_iter().map(piece).collect(), rate_hz, note }
}
