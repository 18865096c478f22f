//! `analyze`: traversal metrics from logs of any origin.

use super::{Read, Reading, read};
use crate::error::Error;
use crate::operations::roughness::settings as roughness_settings;
use sastrugi_mobility::metrics::log::{AboveNoise, Analysis, LogSettings, OnGround, analyse, on_ground};
use sastrugi_numeric::Grid;
use sastrugi_roughness::{classify, moore_gradient};
use sastrugi_schemas::log::Log;
use sastrugi_schemas::study::RoughnessSection;
use sastrugi_schemas::tables::LogRow;
use sastrugi_schemas::topics::{EventKind, RoverEventKind};
use sastrugi_store::PROGRAM;
use sastrugi_store::mcap::{McapError, read_log};
use sastrugi_store::parquet::{TableMetadata, write_table};
use std::path::Path;

/// Accepted sampling rates, Hz.
const RATE_HZ: [f64; 2] = [1.0, 1000.0];

/// A request to analyse logs.
pub struct Request<'a> {
    /// Settings of the analysis.
    pub settings: LogSettings,
    /// Ground under the logs.
    pub dem: Option<&'a Path>,
    /// Offset from the log's positions to the DEM's coordinates, m.
    pub offset_m: [f64; 3],
    /// Label.
    pub group: Option<String>,
}

/// Ground under logs: heights and roughness classes.
pub struct Terrain {
    dem: Grid,
    classes: Grid<u8>,
}

/// An analysed log.
pub struct Judged {
    /// Its row.
    pub row: LogRow,
    /// Notes on how it was read.
    pub notes: Vec<String>,
}

impl Request<'_> {
    /// Checks the settings and reads the DEM.
    ///
    /// # Errors
    /// Rates or bands out of range; a DEM that cannot be read.
    pub fn prepare(&self) -> Result<Option<Terrain>, Error> {
        let LogSettings { rate_hz, band_hz: [low, high], .. } = self.settings;
        if !(RATE_HZ[0]..=RATE_HZ[1]).contains(&rate_hz) {
            return Err(Error::Usage(format!(
                "`--rate {rate_hz}`: must be between {} and {} Hz",
                RATE_HZ[0], RATE_HZ[1]
            )));
        }
        if !(low > 0.0 && high > low && high <= 0.5 * rate_hz) {
            let nyquist = 0.5 * rate_hz;
            return Err(Error::Usage(format!(
                "`--band {low},{high}`: must increase, start above 0 and end at or below half the rate, {nyquist} Hz"
            )));
        }
        let Some(path) = self.dem else { return Ok(None) };
        let Read { dem, .. } = read(path, &Reading::default())?;
        let thresholds = roughness_settings(&RoughnessSection::default())?.thresholds;
        let classes = classify(&moore_gradient(&dem.grid), &thresholds);
        Ok(Some(Terrain { dem: dem.grid, classes }))
    }

    /// Analyses one log.
    ///
    /// # Errors
    /// A file that is not MCAP, is damaged, or has no usable poses.
    pub fn judge(&self, path: &Path, terrain: Option<&Terrain>) -> Result<Judged, Error> {
        let log = read_log(path).map_err(|e| match e {
            McapError::Io { path, source } => Error::unreadable(&path, &source),
            McapError::Unusable { .. } => Error::Input(e.to_string()),
            other => Error::failed(other),
        })?;
        let found = analyse(&log, &self.settings).map_err(|e| {
            let broken = log.broken.as_ref().map_or_else(String::new, |b| format!(" ({b})"));
            Error::Input(format!("{}: {e}{broken}", path.display()))
        })?;
        let ground = terrain.map(|t| on_ground(&found, self.offset_m, &t.dem, &t.classes));
        let mut notes: Vec<String> = log.broken.iter().cloned().chain(found.notes.iter().cloned()).collect();
        notes.extend(log.unread.iter().map(|topic| format!("not read: {topic}")));
        if ground.is_some_and(|g| g.known_share == 0.0) {
            notes.push("no sample lies within the DEM; shift the log's positions with `--offset`".to_owned());
        }
        Ok(Judged { row: self.row(path, &log, &found, ground), notes })
    }

    fn row(&self, path: &Path, log: &Log, found: &Analysis, ground: Option<OnGround>) -> LogRow {
        let metrics = &found.metrics;
        let band = found.imu_acceleration.as_ref().map(|(b, _)| *b).or(found.band_acceleration);
        let source = band.map(|_| if found.imu_acceleration.is_some() { "imu" } else { "poses" });
        let floor = |figure: AboveNoise| figure.floor.to_degrees();
        let ground =
            ground.unwrap_or(OnGround { known_share: f64::NAN, clearance_m: [f64::NAN; 3], shares: [f64::NAN; 3] });
        LogRow {
            log_id: path.display().to_string(),
            group: self.group.clone(),
            topic: found.topic.clone(),
            message: found.schema.clone(),
            frame: found.frame.clone(),
            outcome: outcome(log),
            time_s: found.duration_s,
            path_length_m: metrics.path_length_m,
            efficiency: metrics.efficiency,
            rms_vertical_acceleration_m_s2: found.acceleration.rms,
            vertical_acceleration_floor_m_s2: found.acceleration.floor,
            vertical_acceleration_tells: found.acceleration.tells(),
            rms_pitch_rate_deg_s: found.pitch_rate.rms.to_degrees(),
            pitch_rate_floor_deg_s: floor(found.pitch_rate),
            pitch_rate_tells: found.pitch_rate.tells(),
            rms_roll_rate_deg_s: found.roll_rate.rms.to_degrees(),
            roll_rate_floor_deg_s: floor(found.roll_rate),
            roll_rate_tells: found.roll_rate.tells(),
            rms_body_pitch_rate_deg_s: metrics.rms_body_pitch_rate_rad_s.to_degrees(),
            rms_body_roll_rate_deg_s: metrics.rms_body_roll_rate_rad_s.to_degrees(),
            max_pitch_deg: metrics.max_pitch_rad.to_degrees(),
            max_roll_deg: metrics.max_roll_rad.to_degrees(),
            band_low_hz: self.settings.band_hz[0],
            band_high_hz: self.settings.band_hz[1],
            band_vertical_acceleration_m_s2: band.map_or(f64::NAN, |b| b.rms),
            band_source: source.map(str::to_owned),
            band_vertical_acceleration_floor_m_s2: band.map_or(f64::NAN, |b| b.floor),
            band_vertical_acceleration_poses_m_s2: found.band_acceleration.map_or(f64::NAN, |b| b.rms),
            samples: found.pieces.iter().map(|p| p.len() as i64).sum(),
            sample_rate_hz: found.sample_rate_hz,
            pose_rate_hz: found.pose_rate_hz,
            resampled: found.resampled,
            gaps: found.gaps_s.len() as i64,
            gap_time_s: found.gaps_s.iter().map(|[from, to]| to - from).sum(),
            ground_share: ground.known_share,
            min_clearance_m: ground.clearance_m[0],
            median_clearance_m: ground.clearance_m[1],
            share_low: ground.shares[0],
            share_semi: ground.shares[1],
            share_high: ground.shares[2],
            broken: log.broken.clone(),
        }
    }
}

/// Outcome of the mission, if the log has an event for it; other programs log other events.
fn outcome(log: &Log) -> Option<String> {
    const ROVERS: [RoverEventKind; 6] = [
        RoverEventKind::Reached,
        RoverEventKind::Lost,
        RoverEventKind::NoWay,
        RoverEventKind::DistanceLimit,
        RoverEventKind::CycleLimit,
        RoverEventKind::OffGround,
    ];
    let known = |name: &str| EventKind::outcome(name).is_some() || ROVERS.iter().any(|end| end.name() == name);
    log.events.iter().rev().map(|(_, name)| name).find(|name| known(name)).cloned()
}

/// Writes the table `logs`, sorted by log name.
///
/// # Errors
/// A log that is given twice; a file that cannot be written.
pub fn write(path: &Path, rows: &[LogRow]) -> Result<(), Error> {
    let metadata =
        TableMetadata { study_sha256: String::new(), seed: 0, version: PROGRAM.to_owned(), license: String::new() };
    let mut sorted: Vec<&LogRow> = rows.iter().collect();
    sorted.sort_by(|a, b| a.log_id.cmp(&b.log_id));
    write_table(path, sorted.into_iter().cloned(), Some(&metadata)).map(drop).map_err(Error::io)
}
