//! Figures of a log of any origin: those of a simulated mission, by the same code, and what the log's noise lets one say.
//!
//! A pose stream is cut at gaps (longer than five usual intervals and 0.25 s); each piece is taken as it is where its poses are
//! even at the sampling rate, and interpolated at that rate otherwise, without any filter, as a simulation samples. Root mean
//! squares are pooled over the pieces.
//!
//! Second differences of heights at 20 Hz raise noise: 1 mm of white noise gives 0.98 m/s2. A floor stands beside each root
//! mean square: what white noise gives, of the smaller of two upper bounds of its density: the top eighth of the spectrum, and
//! the quietest second of a vehicle at rest. Below three floors the answer is "cannot tell". Recordings of our own
//! messages hold what was simulated, but for its rounding to 2^-20 m (2.7e-4 m/s2): their floors are 0. Our ROS 2 bags hold the same
//! poses, but their messages do not say so: their floors are estimated as for any log.
//!
//! Beside the second difference, the vertical acceleration in one band (0.2 to 8 Hz unless told otherwise), from the spectrum of
//! the heights and, where there is an inertial measurement unit, from its specific force turned upright by the poses: the same
//! band on both sides, whatever the rates. The unit's figure is the one to prefer.
//!
//! Cost: a few passes over the poses, and 10 s of samples times the bins of a segment per half segment.

mod frames;
mod ground;
mod series;
mod spectrum;
#[cfg(test)]
mod tests;

pub use ground::{OnGround, on_ground};

use super::{Differentiator, EulerAngles, Metrics};
use sastrugi_schemas::log::{ImuStream, Log, PoseStream, TimedPose};
use sastrugi_schemas::topics::StateSample;
use series::Rotation;
use spectrum::Spectrum;

/// Standard gravity, m/s2.
const GRAVITY_M_S2: f64 = 9.80665;
/// A figure tells something above this many floors.
const FLOORS: f64 = 3.0;
/// A vehicle rests over a second in which it moves by less than this, m.
const REST_M: f64 = 0.02;

/// Why a log has no figures.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LogError {
    /// Nothing tells where a body is.
    #[error(
        "no pose stream: it takes Odometry, PoseStamped or TFMessage (ROS 2), or PoseInFrame, Odometry or FrameTransform(s) \
         (Foxglove){unread}"
    )]
    NoPoses {
        /// Topics that could not be read, in words.
        unread: String,
    },
    /// The named topic has no poses.
    #[error("no poses on the topic `{topic}`; there are some on {known}")]
    NoTopic {
        /// What was asked for.
        topic: String,
        /// What there is.
        known: String,
    },
    /// The transforms do not lead to a frame.
    #[error("no transforms lead to the frame `{frame}`; they lead to {}", known.join(", "))]
    NoFrame {
        /// What was asked for.
        frame: String,
        /// What there is.
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
    /// A quaternion that is no rotation.
    #[error("on {topic}, the orientation of pose {message} has the length {length}; a quaternion has the length 1")]
    Orientation {
        /// Topic.
        topic: String,
        /// Number of the pose, from 1.
        message: usize,
        /// Length of the quaternion.
        length: f64,
    },
    /// Fewer than three usable poses.
    #[error("{poses} usable poses on {topic}; figures take at least 3")]
    TooFew {
        /// Topic.
        topic: String,
        /// Usable poses.
        poses: usize,
    },
}

/// How a log is judged.
#[derive(Clone, Debug, PartialEq)]
pub struct LogSettings {
    /// Topic of the poses; the best one when absent.
    pub topic: Option<String>,
    /// Frame that is followed where poses come as transforms.
    pub body_frame: String,
    /// Frame in which it moves; the root of the transforms when absent.
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

/// A root mean square with what white noise alone would give.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AboveNoise {
    /// Root mean square.
    pub rms: f64,
    /// Of the noise; NaN where it could not be told.
    pub floor: f64,
}

impl AboveNoise {
    /// True above three floors.
    pub fn tells(&self) -> bool {
        self.rms >= FLOORS * self.floor
    }
}

/// Figures of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    /// Topic of the poses.
    pub topic: String,
    /// Message, or what was composed.
    pub schema: String,
    /// Frame in which the body moves.
    pub frame: String,
    /// Other streams of poses, in words.
    pub others: Vec<String>,
    /// Poses used.
    pub poses: usize,
    /// Time of the first pose, ns since 1970-01-01 UTC.
    pub start_ns: i64,
    /// From the first to the last pose, s.
    pub duration_s: f64,
    /// Gaps: from and to, s after the first pose.
    pub gaps_s: Vec<[f64; 2]>,
    /// Usual rate of the poses, Hz.
    pub pose_rate_hz: f64,
    /// Rate of the samples that figures are taken from, Hz.
    pub sample_rate_hz: f64,
    /// True when poses were interpolated to even times.
    pub resampled: bool,
    /// Figures as of a mission, pooled over the pieces.
    pub metrics: Metrics,
    /// Vertical acceleration by second differences, m/s2.
    pub acceleration: AboveNoise,
    /// Rate of the pitch angle, rad/s.
    pub pitch_rate: AboveNoise,
    /// Rate of the roll angle, rad/s.
    pub roll_rate: AboveNoise,
    /// Vertical acceleration in the band from the heights, m/s2.
    pub band_acceleration: Option<AboveNoise>,
    /// The same from an inertial measurement unit, and its topic.
    pub imu_acceleration: Option<(AboveNoise, String)>,
    /// Pieces without gaps.
    pub pieces: Vec<Vec<StateSample>>,
    /// What a reader should know.
    pub notes: Vec<String>,
}

/// Judges a log.
///
/// # Errors
/// [`LogError`]
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
            "poses come at {sample_rate_hz:.3} Hz, below the {} Hz of the figures: fast motion is missing from them",
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
        acceleration: noise.beside(metrics.rms_vertical_acceleration_m_s2, |s| s.position_m[2], 2),
        pitch_rate: noise.beside(metrics.rms_pitch_rate_rad_s, |s| EulerAngles::of(s.orientation).pitch, 1),
        roll_rate: noise.beside(metrics.rms_roll_rate_rad_s, |s| EulerAngles::of(s.orientation).roll, 1),
        band_acceleration: Spectrum::of(&heights, sample_rate_hz).map(|s| in_band(&s, settings.band_hz, 2, exact)),
        imu_acceleration,
        metrics,
        pieces,
        notes,
    })
}

/// The rate of the figures, or that of the poses where it is lower by more than their jitter.
fn rate(wanted_hz: f64, pose_rate_hz: f64) -> f64 {
    if pose_rate_hz > 0.95 * wanted_hz { wanted_hz } else { pose_rate_hz }
}

fn in_band(spectrum: &Spectrum, band_hz: [f64; 2], derivative: i32, exact: bool) -> AboveNoise {
    let rms = spectrum.band_rms(band_hz, derivative);
    let density = if exact { 0.0 } else { spectrum.top() };
    AboveNoise { rms, floor: spectrum.noise_rms(band_hz, derivative, density) }
}

/// Poses without noise.
const SIMULATED: &str = "sastrugi.VehicleState";

/// Messages that pose a body, the best first: those that tell which body come before those that do not.
const PREFERRED: [&str; 6] = [
    SIMULATED,
    "nav_msgs/msg/Odometry",
    "foxglove.Odometry",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/PoseStamped",
    "foxglove.PoseInFrame",
];

/// The stream to judge, and the others in words.
fn chosen(log: &Log, settings: &LogSettings) -> Result<(PoseStream, Vec<String>), LogError> {
    let words = |stream: &PoseStream| format!("{} ({}, {} poses)", stream.topic, stream.schema, stream.poses.len());
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
        None => return Err(nothing(log, settings, &streams)),
    };
    let all = streams.into_iter().chain(of_transforms.as_ref().ok());
    let others = all.filter(|s| s.topic != chosen.topic || s.schema != chosen.schema).map(words).collect();
    Ok((chosen, others))
}

fn nothing(log: &Log, settings: &LogSettings, streams: &[&PoseStream]) -> LogError {
    let known: Vec<&str> = streams.iter().map(|s| s.topic.as_str()).collect();
    match &settings.topic {
        Some(topic) if !known.is_empty() => LogError::NoTopic { topic: topic.clone(), known: known.join(", ") },
        _ if log.unread.is_empty() => LogError::NoPoses { unread: String::new() },
        _ => LogError::NoPoses { unread: format!("; not read: {}", log.unread.join(", ")) },
    }
}

/// Figures over all pieces: lengths add up, squares are pooled by their number of samples.
fn pooled(pieces: &[Vec<StateSample>], rate_hz: f64, differentiator: Differentiator) -> Metrics {
    let all: Vec<(f64, Metrics)> =
        pieces.iter().map(|p| (p.len() as f64, Metrics::of(p, rate_hz, differentiator))).collect();
    if let [(_, only)] = all[..] {
        return only;
    }
    let rms = |figure: fn(&Metrics) -> f64| {
        let known = || all.iter().filter(|(_, m)| figure(m).is_finite());
        let squares: f64 = known().map(|(n, m)| n * figure(m) * figure(m)).sum();
        (squares / known().map(|(n, _)| n).sum::<f64>()).sqrt()
    };
    let largest = |figure: fn(&Metrics) -> f64| all.iter().map(|(_, m)| figure(m)).fold(f64::NAN, f64::max);
    let path_length_m = all.iter().map(|(_, m)| m.path_length_m).sum();
    Metrics {
        path_length_m,
        // The way through a gap is not known.
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

/// Noise of a series of the states.
struct Noise<'a> {
    pieces: &'a [Vec<StateSample>],
    rate_hz: f64,
    differentiator: Differentiator,
    /// There is none.
    exact: bool,
}

impl Noise<'_> {
    /// A root mean square of a derivative beside its floor.
    fn beside(&self, rms: f64, figure: fn(&StateSample) -> f64, derivative: u32) -> AboveNoise {
        if self.exact {
            return AboveNoise { rms, floor: 0.0 };
        }
        let series: Vec<Vec<f64>> = self.pieces.iter().map(|p| p.iter().map(figure).collect()).collect();
        let of_spectrum = Spectrum::of(&series, self.rate_hz).map(|s| {
            // White noise of variance 1 has differences of variance 2, and second differences of variance 6.
            let gain = if derivative == 2 { 6.0f64.sqrt() * self.rate_hz } else { 2.0f64.sqrt() };
            s.noise_sigma(s.top()) * gain * self.rate_hz
        });
        AboveNoise { rms, floor: of_spectrum.unwrap_or(f64::NAN).min(self.at_rest(&series, derivative)) }
    }

    /// The quietest second at rest; NaN where there is none.
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

/// Vertical acceleration by an inertial measurement unit, even pieces.
struct Upright {
    pieces: Vec<Vec<f64>>,
    rate_hz: f64,
    note: Option<String>,
}

/// The unit's specific force in the fixed frame less gravity, upwards, at the unit's usual rate.
fn upright(imu: &ImuStream, log: &Log, poses: &[TimedPose], settings: &LogSettings) -> Upright {
    let aligned = imu.frame.is_empty() || imu.frame == settings.body_frame;
    let mount = (!aligned)
        .then(|| frames::path(&log.transforms, &imu.frame, Some(&settings.body_frame)).ok()?.poses.first().copied())
        .flatten();
    let note = (!aligned && mount.is_none()).then(|| {
        format!("no transform tells how `{}` lies in `{}`; they are taken as parallel", imu.frame, settings.body_frame)
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
        // As a pose, so that pieces and interpolation are those of poses.
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
