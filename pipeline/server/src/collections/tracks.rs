//! Missions and rovers of a release, by the terrain that they were driven on.

use super::Collection;
use super::sealed::Sealed;
use crate::collections::Ground;
use crate::http::Problem;
use crate::http::problem::shortened;
use sastrugi_schemas::tables::{CellType, MissionRow, RoverRow, RoverSampleRow, SampleRow};
use sastrugi_schemas::{Cell, Record, Table};
use sastrugi_stages::verbs::served::SealedFile;
use sastrugi_store::parquet::TableFiles;
use sastrugi_store::release::{Release, TABLES};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest number of points sent per track.
const POINTS_MAX: usize = 5000;
/// Largest number of missions and rovers listed.
pub const LISTED_MAX: usize = 10_000;
/// Column of the terrain, in all tables.
const TERRAIN: &str = "terrain_id";

/// What drives on terrains, and the columns that its tables have under names of their own.
struct Kind {
    name: &'static str,
    drives: &'static Table,
    samples: &'static Table,
    id: &'static str,
    driver: &'static str,
    length_m: &'static str,
    heading_deg: &'static str,
}

static KINDS: [Kind; 2] = [
    Kind {
        name: "mission",
        drives: &MissionRow::TABLE,
        samples: &SampleRow::TABLE,
        id: "mission_id",
        driver: "vehicle",
        length_m: "path_length_m",
        heading_deg: "yaw_deg",
    },
    Kind {
        name: "rover",
        drives: &RoverRow::TABLE,
        samples: &RoverSampleRow::TABLE,
        id: "rover_id",
        driver: "navigator",
        length_m: "distance_m",
        heading_deg: "heading_deg",
    },
];

/// Time, position and heading at a point of a track.
type Pose = [f64; 5];
/// Names of the members of a [`Pose`] in an answer.
const POSE: [&str; 5] = ["time_s", "x_m", "y_m", "z_m", "heading_deg"];

/// Every n-th pose, and the last.
fn thinned(poses: &[Pose]) -> Vec<Pose> {
    let step = poses.len().div_ceil(POINTS_MAX).max(1);
    let last = poses.len().saturating_sub(1);
    poses.iter().enumerate().filter(|(k, _)| k % step == 0 || *k == last).map(|(_, pose)| *pose).collect()
}

/// A release whose missions and rovers are drawn on its terrains.
pub struct Drives {
    /// The release.
    pub release: Release,
    /// Hash of the tables.
    pub digest: String,
    /// Files of the tables, by table.
    files: BTreeMap<&'static str, Vec<Sealed>>,
    /// Number of missions and rovers on each terrain; `None` if a table could not be read.
    counts: Option<BTreeMap<String, usize>>,
}

impl Drives {
    /// Missions and rovers of a release. Counts them; a table that cannot be read is logged.
    pub fn open(release: Release) -> Self {
        let tables = KINDS.iter().flat_map(|kind| [kind.drives.name, kind.samples.name]);
        let files: BTreeMap<_, Vec<Sealed>> = tables.map(|table| (table, files_of(&release, table))).collect();
        let sums: Vec<&str> = files.values().flatten().map(Sealed::sha256).collect();
        let digest = super::digest(&format!("{} {}", crate::revision(), sums.join(",")));
        let mut drives = Self { release, digest, files, counts: None };
        drives.counts = drives.count().ok();
        drives
    }

    fn count(&self) -> Result<BTreeMap<String, usize>, Problem> {
        let mut counts = BTreeMap::new();
        for kind in &KINDS {
            self.visit(kind.drives, &[], [TERRAIN], &AtomicBool::new(false), |[terrain]| {
                *counts.entry(text(terrain)).or_insert(0) += 1;
                ControlFlow::Continue(())
            })?;
        }
        Ok(counts)
    }

    /// Calls `f` with some columns of the rows that have the wanted texts in other columns, until it breaks.
    ///
    /// # Errors
    /// A file has changed or cannot be read; `stop` was set, because nobody waits for the answer any more.
    fn visit<const N: usize>(
        &self,
        table: &'static Table,
        wanted: &[(&str, &str)],
        columns: [&str; N],
        stop: &AtomicBool,
        mut f: impl FnMut([Cell; N]) -> ControlFlow<()>,
    ) -> Result<(), Problem> {
        let unless_stopped = |cells: [Cell; N]| {
            if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { f(cells) }
        };
        still_wanted(stop)?;
        let paths = self.paths(table, wanted).map_err(Problem::internal)?;
        still_wanted(stop)?;
        let files = TableFiles::new(table, paths);
        let files = wanted.iter().fold(files, |files, (column, text)| files?.selecting(column, text));
        files.and_then(|files| files.visit(columns, unless_stopped)).map_err(|error| {
            tracing::warn!(release = %self.release.folder().display(), %error, "cannot read a table");
            Problem::internal(format!("table `{}` of the release cannot be read", table.name))
        })?;
        still_wanted(stop)
    }

    /// The files of a table, checked; of a table with one file per terrain, only that of the wanted terrain.
    fn paths(&self, table: &Table, wanted: &[(&str, &str)]) -> Result<Vec<PathBuf>, String> {
        let part = wanted.iter().find(|(column, _)| table.file_per == Some(*column));
        let part = part.map(|(_, text)| format!("part-{text}.parquet"));
        let files = self.files.get(table.name).into_iter().flatten();
        let files = files.filter(|file| part.as_ref().is_none_or(|name| file.is_named(name)));
        files.map(|file| file.path().map(PathBuf::from)).collect()
    }

    /// Poses of one mission or rover.
    fn poses(&self, kind: &Kind, terrain: &str, id: &str, stop: &AtomicBool) -> Result<Vec<Pose>, Problem> {
        let mut poses = Vec::new();
        let columns = ["time_s", "x_m", "y_m", "z_m", kind.heading_deg];
        self.visit(kind.samples, &[(TERRAIN, terrain), (kind.id, id)], columns, stop, |cells| {
            poses.push(cells.map(number));
            ControlFlow::Continue(())
        })?;
        Ok(thinned(&poses))
    }

    /// Whether a terrain has this mission or rover.
    fn has(&self, kind: &Kind, terrain: &str, id: &str, stop: &AtomicBool) -> Result<bool, Problem> {
        let mut has = false;
        self.visit(kind.drives, &[(TERRAIN, terrain), (kind.id, id)], [kind.id], stop, |_| {
            has = true;
            ControlFlow::Break(())
        })?;
        Ok(has)
    }
}

/// Ends a request that nobody waits for.
fn still_wanted(stop: &AtomicBool) -> Result<(), Problem> {
    if stop.load(Ordering::Relaxed) { Err(Problem::unavailable("the request was cancelled")) } else { Ok(()) }
}

/// The files of a table that the manifest lists.
fn files_of(release: &Release, table: &str) -> Vec<Sealed> {
    let folder = format!("{TABLES}/{table}/");
    let is_part = |path: &str| path.starts_with(&folder) && path.ends_with(".parquet");
    let own = release.manifest().artifacts.iter().filter(|artifact| is_part(&artifact.path));
    let file = |path: &str, sha256: &str| SealedFile { path: release.path(path), sha256: sha256.to_owned() };
    own.map(|artifact| Sealed::new(file(&artifact.path, &artifact.sha256))).collect()
}

fn text(cell: Cell) -> String {
    String::from_cell(cell).unwrap_or_default()
}

fn number(cell: Cell) -> f64 {
    f64::from_cell(cell).unwrap_or(f64::NAN)
}

impl Collection {
    fn driven_on(&self) -> Option<(&Drives, &str)> {
        match (&self.ground, &self.drives) {
            (Ground::Raster(raster), Some(drives)) => Some((drives, &raster.files.id)),
            _ => None,
        }
    }

    /// Number of missions and rovers; `None` if a table could not be read.
    pub fn tracks(&self) -> Option<usize> {
        let Some((drives, terrain)) = self.driven_on() else { return Some(0) };
        drives.counts.as_ref().map(|counts| counts.get(terrain).copied().unwrap_or(0))
    }

    /// The first missions and rovers, at most [`LISTED_MAX`]. Reads tables until `stop` is set: do not call it on the runtime's threads.
    ///
    /// # Errors
    /// A table has changed or cannot be read.
    pub fn track_list(&self, stop: &AtomicBool) -> Result<Vec<Value>, Problem> {
        let Some((drives, terrain)) = self.driven_on() else { return Ok(Vec::new()) };
        let mut tracks = Vec::new();
        for kind in &KINDS {
            let columns = [kind.id, kind.driver, "outcome", "time_s", kind.length_m];
            drives.visit(kind.drives, &[(TERRAIN, terrain)], columns, stop, |cells| {
                if tracks.len() == LISTED_MAX {
                    return ControlFlow::Break(());
                }
                tracks.push(describe(kind, cells));
                ControlFlow::Continue(())
            })?;
        }
        Ok(tracks)
    }

    /// One track. Reads tables until `stop` is set: do not call it on the runtime's threads.
    ///
    /// # Errors
    /// There is no track with this id; a table has changed or cannot be read.
    pub fn track(&self, id: &str, stop: &AtomicBool) -> Result<Value, Problem> {
        let unknown = || {
            let shown = shortened(id);
            Problem::not_found(format!("no such track on this terrain: \"{shown}\"; `tracks` lists them"))
        };
        let (drives, terrain) = self.driven_on().ok_or_else(unknown)?;
        for kind in &KINDS {
            // Ids are far fewer than samples.
            if drives.has(kind, terrain, id, stop)? {
                let poses = drives.poses(kind, terrain, id, stop)?;
                let column = |k: usize| json!(poses.iter().map(|pose| pose[k]).collect::<Vec<f64>>());
                let mut track: serde_json::Map<String, Value> =
                    POSE.iter().enumerate().map(|(k, name)| ((*name).to_owned(), column(k))).collect();
                track.insert("id".to_owned(), json!(id));
                return Ok(Value::Object(track));
            }
        }
        Err(unknown())
    }
}

fn describe(kind: &Kind, [id, driver, outcome, duration_s, length_m]: [Cell; 5]) -> Value {
    let (id, driver) = (text(id), text(driver));
    json!({
        "id": id, "kind": kind.name, "label": format!("{driver} {id}"), "outcome": text(outcome),
        "duration_s": number(duration_s), "length_m": number(length_m),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A track is thinned to at most 5000 points and its last one.
    #[test]
    fn val_thinned_tracks_keep_their_ends() {
        let pose = |k: usize| [0.0, 1.0, 2.0, 3.0, 4.0].map(|more| k as f64 + more);
        for (count, expected) in [(0, 0), (1, 1), (5000, 5000), (5001, 2501), (5002, 2502), (12_000, 4001)] {
            let poses: Vec<Pose> = (0..count).map(pose).collect();
            let kept = thinned(&poses);
            assert_eq!(kept.len(), expected, "{count}");
            assert_eq!((kept.first(), kept.last()), (poses.first(), poses.last()));
            assert!(kept.iter().all(|one| poses.contains(one)));
        }
    }

    /// Every column that is read exists in its table.
    #[test]
    fn val_the_tables_have_the_columns() {
        for kind in &KINDS {
            for column in [TERRAIN, kind.id, kind.driver, "outcome", "time_s", kind.length_m] {
                assert!(kind.drives.position(column).is_some(), "{} {column}", kind.name);
            }
            for column in [TERRAIN, kind.id, "time_s", "x_m", "y_m", "z_m", kind.heading_deg] {
                assert!(kind.samples.position(column).is_some(), "{} {column}", kind.name);
            }
            assert_eq!((kind.drives.file_per, kind.samples.file_per), (None, Some(TERRAIN)));
        }
    }
}
