//! Missions and rovers of a release, by the terrain that they were driven on.

use super::Collection;
use crate::collections::Ground;
use crate::http::Problem;
use sastrugi_schemas::Record;
use sastrugi_schemas::tables::{MissionRow, RoverRow, RoverSampleRow, SampleRow};
use sastrugi_store::release::{Release, ReleaseError};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// Largest number of points sent per track.
const POINTS_MAX: usize = 5000;
/// Largest number of missions and rovers listed.
pub const LISTED_MAX: usize = 10_000;

/// Poses along a track.
#[derive(Default)]
struct Track {
    time_s: Vec<f64>,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    z_m: Vec<f64>,
    heading_deg: Vec<f64>,
}

impl Track {
    fn push(&mut self, time_s: f64, [x, y, z]: [f64; 3], heading_deg: f64) {
        self.time_s.push(time_s);
        self.x_m.push(x);
        self.y_m.push(y);
        self.z_m.push(z);
        self.heading_deg.push(heading_deg);
    }

    /// Every n-th point, and the last.
    fn thinned(self) -> Self {
        let step = self.time_s.len().div_ceil(POINTS_MAX).max(1);
        let last = self.time_s.len().saturating_sub(1);
        let mut thin = Self::default();
        for k in (0..self.time_s.len()).filter(|k| k % step == 0 || *k == last) {
            thin.push(self.time_s[k], [self.x_m[k], self.y_m[k], self.z_m[k]], self.heading_deg[k]);
        }
        thin
    }
}

/// A release whose missions and rovers are drawn on its terrains.
pub struct Drives {
    /// The release.
    pub release: Release,
    /// Number of missions and rovers on each terrain.
    counts: OnceLock<BTreeMap<String, usize>>,
}

impl Drives {
    /// Missions and rovers of a release.
    pub fn new(release: Release) -> Self {
        Self { release, counts: OnceLock::new() }
    }

    /// Calls `f` with every mission and rover.
    fn each(&self, mut f: impl FnMut(Drive)) -> Result<(), Problem> {
        rows(&self.release, |row: MissionRow| {
            f(Drive {
                terrain: row.terrain_id,
                kind: "mission",
                driver: row.vehicle,
                id: row.mission_id,
                outcome: row.outcome,
                duration_s: row.time_s,
                length_m: row.path_length_m,
            });
        })?;
        rows(&self.release, |row: RoverRow| {
            f(Drive {
                terrain: row.terrain_id,
                kind: "rover",
                driver: row.navigator,
                id: row.rover_id,
                outcome: row.outcome,
                duration_s: row.time_s,
                length_m: row.distance_m,
            });
        })
    }

    /// Number of missions and rovers on a terrain; 0 while the tables cannot be read.
    fn count(&self, terrain: &str) -> usize {
        let count = |counts: &BTreeMap<String, usize>| counts.get(terrain).copied().unwrap_or(0);
        if let Some(counts) = self.counts.get() {
            return count(counts);
        }
        let mut counts = BTreeMap::new();
        match self.each(|drive| *counts.entry(drive.terrain).or_insert(0) += 1) {
            Ok(()) => count(self.counts.get_or_init(|| counts)),
            Err(_) => 0,
        }
    }
}

/// One mission or rover.
struct Drive {
    terrain: String,
    kind: &'static str,
    driver: String,
    id: String,
    outcome: String,
    duration_s: f64,
    length_m: f64,
}

impl Drive {
    fn describe(&self) -> Value {
        let Self { kind, driver, id, outcome, duration_s, length_m, .. } = self;
        json!({
            "id": id, "kind": kind, "label": format!("{driver} {id}"), "outcome": outcome, "duration_s": duration_s, "length_m": length_m,
        })
    }
}

impl Collection {
    fn driven_on(&self) -> Option<(&Drives, &str)> {
        match (&self.ground, &self.drives) {
            (Ground::Raster(raster), Some(drives)) => Some((drives, &raster.files.id)),
            _ => None,
        }
    }

    /// Number of missions and rovers. The first call reads tables: do not call it on the runtime's threads.
    pub fn tracks(&self) -> usize {
        self.driven_on().map_or(0, |(drives, terrain)| drives.count(terrain))
    }

    /// The first missions and rovers, at most [`LISTED_MAX`]. Reads tables: do not call it on the runtime's threads.
    ///
    /// # Errors
    /// A table cannot be read.
    pub fn track_list(&self) -> Result<Vec<Value>, Problem> {
        let Some((drives, terrain)) = self.driven_on() else { return Ok(Vec::new()) };
        let mut tracks = Vec::new();
        drives.each(|drive| {
            if drive.terrain == terrain && tracks.len() < LISTED_MAX {
                tracks.push(drive.describe());
            }
        })?;
        Ok(tracks)
    }

    /// One track. Reads tables: do not call it on the runtime's threads.
    ///
    /// # Errors
    /// A table cannot be read, or there is no track with this id.
    pub fn track(&self, id: &str) -> Result<Value, Problem> {
        let mut track = Track::default();
        if let Some((Drives { release, .. }, terrain)) = self.driven_on() {
            let is = |own: &str, on: &str| own == id && on == terrain;
            rows(release, |s: SampleRow| {
                if is(&s.mission_id, &s.terrain_id) {
                    track.push(s.time_s, [s.x_m, s.y_m, s.z_m], s.yaw_deg);
                }
            })?;
            rows(release, |s: RoverSampleRow| {
                if is(&s.rover_id, &s.terrain_id) {
                    track.push(s.time_s, [s.x_m, s.y_m, s.z_m], s.heading_deg);
                }
            })?;
        }
        if track.time_s.is_empty() {
            return Err(Problem::not_found(format!("no such track on this terrain: \"{id}\"; `tracks` lists them")));
        }
        let t = track.thinned();
        Ok(json!({
            "id": id, "time_s": t.time_s, "x_m": t.x_m, "y_m": t.y_m, "z_m": t.z_m, "heading_deg": t.heading_deg,
        }))
    }
}

fn rows<R: Record>(release: &Release, f: impl FnMut(R)) -> Result<(), Problem> {
    release.for_each_row(f).map_err(|e: ReleaseError| Problem::internal(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A track is thinned to at most 5000 points and its last one.
    #[test]
    fn val_thinned_tracks_keep_their_ends() {
        let thinned = |count: usize| {
            let mut track = Track::default();
            for time_s in (0..count).map(|k| k as f64) {
                track.push(time_s, [1.0, 2.0, 3.0].map(|more| time_s + more), time_s + 4.0);
            }
            track.thinned()
        };
        for (count, expected) in [(0, 0), (1, 1), (5000, 5000), (5001, 2501), (5002, 2502), (12_000, 4001)] {
            let track = thinned(count);
            assert_eq!(track.time_s.len(), expected, "{count}");
            assert_eq!(track.time_s.first().copied(), (count > 0).then_some(0.0));
            assert_eq!(track.time_s.last().copied(), count.checked_sub(1).map(|last| last as f64));
            // Each column keeps to its own.
            for (k, time_s) in track.time_s.iter().enumerate() {
                let others = [track.x_m[k], track.y_m[k], track.z_m[k], track.heading_deg[k]];
                assert_eq!(others, [1.0, 2.0, 3.0, 4.0].map(|more| time_s + more));
            }
        }
    }
}
