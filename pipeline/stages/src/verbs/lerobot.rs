//! `convert --for lerobot`: the missions of a release as a LeRobot dataset.
//!
//! A mission is an episode and a sample is a frame: what the vehicle measures and sees of the ground is the observation, what its
//! controller commands is the action. Episodes are ordered by split, terrain and mission. Columns: docs/learning.md.

#[cfg(test)]
mod tests;

use crate::documents::{folded, hub_license, quoted, source_line};
use crate::error::Error;
use crate::operations::dem::input_error;
use crate::remote::check_local;
use crate::runner::assemble::DestinationLock;
use crate::splits::{OTHER, PARTS};
use crate::studies::check_outside;
use sastrugi_numeric::{Grid, PatchShape, relative_height_patch};
use sastrugi_schemas::manifest::Manifest;
use sastrugi_schemas::tables::{MissionRow, SampleRow, TerrainRow};
use sastrugi_schemas::topics::EventKind;
use sastrugi_schemas::{Record, counted};
use sastrugi_store::lerobot::{
    self, DatasetWriter, Description, Episode, Feature, Kind, LerobotError, Shape, Summary, Values,
};
use sastrugi_store::parquet::TableReader;
use sastrugi_store::release::{Release, ReleaseError};
use sastrugi_store::{PROGRAM, dem};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Default side of the height patch, m.
pub const PATCH_M: f64 = 3.2;
/// Default distance between its points, m.
pub const PATCH_CELL_M: f64 = 0.1;
/// Most points on a side of the patch: a megabyte for each frame.
const PATCH_POINTS_MAX: usize = 512;
/// Largest deviation of a sample from its time at the constant rate, s.
const TIME_TOLERANCE_S: f64 = 1e-6;

/// Position of base_link relative to the first frame, first in the state: coordinates of a map would lose digits in single precision.
const FROM_START: [&str; 3] = ["x_from_start_m", "y_from_start_m", "z_from_start_m"];

/// Name of a number of a sample, and where it is.
type Number = (&'static str, fn(&SampleRow) -> f64);
/// Name of a list of numbers of a sample, one for each wheel, and where it is.
type Numbers = (&'static str, fn(&SampleRow) -> &[f32]);

/// Columns of `samples` in the state.
const MEASURED: [Number; 17] = [
    ("qx", |row| row.qx),
    ("qy", |row| row.qy),
    ("qz", |row| row.qz),
    ("qw", |row| row.qw),
    ("vx_m_s", |row| row.vx_m_s),
    ("vy_m_s", |row| row.vy_m_s),
    ("vz_m_s", |row| row.vz_m_s),
    ("roll_deg", |row| row.roll_deg),
    ("pitch_deg", |row| row.pitch_deg),
    ("yaw_deg", |row| row.yaw_deg),
    ("roll_rate_deg_s", |row| row.roll_rate_deg_s),
    ("pitch_rate_deg_s", |row| row.pitch_rate_deg_s),
    ("yaw_rate_deg_s", |row| row.yaw_rate_deg_s),
    ("cross_track_m", |row| row.cross_track_m),
    ("heading_error_deg", |row| row.heading_error_deg),
    ("distance_to_goal_m", |row| row.distance_to_goal_m),
    ("chassis_force_n", |row| row.chassis_force_n),
];

/// Columns of `samples` with a value for each wheel, last in the state.
const OF_WHEELS: [Numbers; 7] = [
    ("wheel_normal_force_n", |row| &row.wheel_normal_force_n),
    ("wheel_longitudinal_force_n", |row| &row.wheel_longitudinal_force_n),
    ("wheel_lateral_force_n", |row| &row.wheel_lateral_force_n),
    ("wheel_slip_ratio", |row| &row.wheel_slip_ratio),
    ("wheel_spin_rad_s", |row| &row.wheel_spin_rad_s),
    ("wheel_torque_n_m", |row| &row.wheel_torque_n_m),
    ("wheel_steering_deg", |row| &row.wheel_steering_deg),
];

/// Columns of `samples` in the action.
const COMMANDED: [Number; 2] =
    [("command_speed_m_s", |row| row.command_speed_m_s), ("command_yaw_rate_deg_s", |row| row.command_yaw_rate_deg_s)];

/// What is converted, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Shape of the height patch.
    pub patch: PatchShape,
    /// Ids of the traverses whose missions are converted; empty for all.
    pub traverses: BTreeSet<String>,
}

/// The shape of a height patch given by options.
///
/// # Errors
/// A side that is not a whole number of cells, or has too many.
pub fn patch(size_m: f64, cell_m: f64) -> Result<PatchShape, Error> {
    let shape = PatchShape::new([size_m; 2], cell_m).filter(|shape| shape.rows() <= PATCH_POINTS_MAX);
    shape.ok_or_else(|| {
        Error::Usage(format!(
            "`--patch {size_m} --patch-cell {cell_m}`: the side must be a whole number of cells, 1 to {}",
            PATCH_POINTS_MAX
        ))
    })
}

/// A dataset that was written.
#[derive(Clone, Debug, Serialize)]
pub struct Converted {
    /// The folder.
    pub folder: PathBuf,
    /// Number of episodes.
    pub episodes: u64,
    /// Number of frames.
    pub frames: u64,
    /// Frames per second.
    pub fps: u32,
    /// Texts of the tasks.
    pub tasks: Vec<String>,
    /// Splits in their order: range of episodes by name, as `first:end`.
    pub splits: Map<String, Value>,
    /// Notes for the reader.
    pub notes: Vec<String>,
}

/// Converts the missions of a release to a LeRobot dataset in the folder `output`. The same release gives the same bytes.
///
/// # Errors
/// A folder that is not a release or has no missions; missions of several vehicles or rates; samples that are not evenly spaced; an output
/// within the release, that holds other files, or that another conversion is writing.
pub fn convert(release: &Path, output: &Path, settings: &Settings) -> Result<Converted, Error> {
    check_local(output)?;
    let refusal = "the dataset cannot be written into the release, which is sealed; choose a folder outside it";
    check_outside(release, output, &format!("{}: {refusal}", output.display()))?;
    let opened = Release::open(release)?;
    lerobot::check_folder(output).map_err(refused)?;
    let chosen = Chosen::of(&opened, settings)?;
    let _lock = DestinationLock::take(output)?;
    let mut export =
        Export { release: &opened, output, settings, chosen: &chosen, writer: None, counts: Counts::default() };
    for ((split, terrain), missions) in &chosen.missions {
        export.add_terrain(chosen.splits[*split], terrain, missions)?;
    }
    export.finish()
}

fn refused(error: LerobotError) -> Error {
    match error {
        LerobotError::Occupied { .. } => Error::Usage(error.to_string()),
        LerobotError::Table(error) => Error::io(error),
        LerobotError::Folder(error) => error.into(),
    }
}

/// The missions to convert.
struct Chosen {
    /// By number of the split and terrain, then by id.
    missions: BTreeMap<(usize, String), BTreeMap<String, MissionRow>>,
    /// Names of the splits, in the order of the dataset.
    splits: Vec<&'static str>,
    /// Heightfield of each terrain, as its path in the release.
    grounds: BTreeMap<String, String>,
    vehicle: String,
    fps: u32,
}

impl Chosen {
    fn of(release: &Release, settings: &Settings) -> Result<Self, Error> {
        let folder = release.folder().display();
        let rows: Vec<MissionRow> = release.rows()?;
        if rows.is_empty() {
            return Err(Error::Input(format!(
                "{folder}: has no missions; a dataset needs the samples of a [[traverse]]"
            )));
        }
        let known: BTreeSet<String> = rows.iter().map(|row| row.traverse_id.clone()).collect();
        let traverses = known.iter().cloned().collect::<Vec<_>>().join(", ");
        if let Some(unknown) = settings.traverses.difference(&known).next() {
            return Err(Error::Usage(format!(
                "`--traverse {unknown}`: {folder} has no such traverse, only {traverses}"
            )));
        }
        let is_chosen =
            |row: &MissionRow| settings.traverses.is_empty() || settings.traverses.contains(&row.traverse_id);
        let rows: Vec<MissionRow> = rows.into_iter().filter(is_chosen).collect();
        let described = |row: &MissionRow| format!("{} at {} Hz", row.vehicle, row.sample_rate_hz);
        let kinds: BTreeSet<String> = rows.iter().map(described).collect();
        if kinds.len() > 1 {
            let kinds = kinds.into_iter().collect::<Vec<_>>().join(", ");
            return Err(Error::Usage(format!(
                "{folder}: has missions of {kinds}, but a LeRobot dataset has one robot and one rate; choose with --traverse: \
                 {traverses}"
            )));
        }
        let first = &rows[0];
        let (vehicle, fps) = (first.vehicle.clone(), whole_rate(first.sample_rate_hz)?);
        // As the package itself, one split where the study has none.
        let is_split = rows.iter().any(|row| row.split.is_some());
        let splits: Vec<&'static str> =
            if is_split { PARTS.into_iter().chain([OTHER]).collect() } else { vec![PARTS[0]] };
        let rank = |row: &MissionRow| {
            let named = splits.iter().position(|split| Some(*split) == row.split.as_deref());
            named.unwrap_or(splits.len() - 1)
        };
        let mut missions: BTreeMap<(usize, String), BTreeMap<String, MissionRow>> = BTreeMap::new();
        for row in rows {
            let key = (rank(&row), row.terrain_id.clone());
            missions.entry(key).or_default().insert(row.mission_id.clone(), row);
        }
        let mut grounds = BTreeMap::new();
        release.for_each_row(|row: TerrainRow| drop(grounds.insert(row.terrain_id, row.path)))?;
        Ok(Self { missions, splits, grounds, vehicle, fps })
    }
}

/// The rate as a whole number, which the format requires.
fn whole_rate(rate_hz: f64) -> Result<u32, Error> {
    if rate_hz.fract() == 0.0 && (1.0..=1e6).contains(&rate_hz) {
        return Ok(rate_hz as u32);
    }
    Err(Error::Input(format!("samples at {rate_hz} Hz: LeRobot requires a whole number of frames per second")))
}

/// What was left out or filled.
#[derive(Default)]
struct Counts {
    left_out: u64,
    points: u64,
    unknown: u64,
}

/// A conversion under way.
struct Export<'a> {
    release: &'a Release,
    output: &'a Path,
    settings: &'a Settings,
    chosen: &'a Chosen,
    /// Number of wheels, and the dataset; from the first episode on.
    writer: Option<(usize, DatasetWriter)>,
    counts: Counts,
}

impl Export<'_> {
    fn add_terrain(
        &mut self,
        split: &str,
        terrain: &str,
        missions: &BTreeMap<String, MissionRow>,
    ) -> Result<(), Error> {
        let ground = self.ground(terrain)?;
        let samples = self.release.sealed(&format!("tables/samples/part-{terrain}.parquet"))?;
        for_each_mission(&samples, |rows| match missions.get(&rows[0].mission_id) {
            Some(mission) => self.add_mission(split, mission, rows, &ground),
            None => Ok(()),
        })
    }

    /// The heights on which the missions of a terrain were driven.
    fn ground(&self, terrain: &str) -> Result<Grid, Error> {
        let lacking = || Error::Input(format!("{}: table terrains lacks {terrain}", self.release.folder().display()));
        let file = self.release.sealed(self.chosen.grounds.get(terrain).ok_or_else(lacking)?)?;
        Ok(dem::read(&file).map_err(input_error)?.grid)
    }

    fn add_mission(
        &mut self,
        split: &str,
        mission: &MissionRow,
        rows: &[SampleRow],
        ground: &Grid,
    ) -> Result<(), Error> {
        check_times(rows, self.chosen.fps)?;
        let wheels = OF_WHEELS[0].1(&rows[0]).len();
        let (state, action) = (state(rows), commands(rows));
        let is_complete = rows.iter().all(|row| OF_WHEELS.iter().all(|(_, of)| of(row).len() == wheels));
        // A vehicle whose start has no ground has no command; one that diverged may exceed single precision.
        if !(is_complete && wheels > 0 && state.iter().chain(&action).all(|value| value.is_finite())) {
            self.counts.left_out += 1;
            return Ok(());
        }
        let (heights, known) = patches(rows, ground, &self.settings.patch);
        self.counts.points += known.len() as u64;
        self.counts.unknown += known.iter().filter(|known| !**known).count() as u64;
        let last = rows.len() - 1;
        let success = mission.outcome == EventKind::Success.name();
        let episode = Episode {
            split: split.to_owned(),
            task: task(mission),
            terrain_id: mission.terrain_id.clone(),
            mission_id: mission.mission_id.clone(),
            outcome: mission.outcome.clone(),
            start_m: [rows[0].x_m, rows[0].y_m, rows[0].z_m],
            frames: rows.len(),
            values: vec![
                Values::F32(state),
                Values::F32(heights),
                Values::Bool(known),
                Values::F32(action),
                Values::Bool((0..=last).map(|k| k == last).collect()),
                Values::Bool((0..=last).map(|k| k == last && success).collect()),
            ],
        };
        self.writer(wheels)?.push(&episode).map_err(refused)
    }

    /// The dataset, started with the first episode; all vehicles must have the same number of wheels.
    fn writer(&mut self, wheels: usize) -> Result<&mut DatasetWriter, Error> {
        if self.writer.is_none() {
            let description = self.description(wheels);
            let writer = DatasetWriter::beside(self.output, description).map_err(refused)?;
            self.writer = Some((wheels, writer));
        }
        match &mut self.writer {
            Some((count, writer)) if *count == wheels => Ok(writer),
            _ => {
                let name = &self.chosen.vehicle;
                Err(Error::Usage(format!("the vehicles named {name} differ in their wheels; choose with --traverse")))
            }
        }
    }

    fn description(&self, wheels: usize) -> Description {
        let manifest = self.release.manifest();
        let Settings { patch, .. } = self.settings;
        let origin = json!({
            "program": PROGRAM,
            "release": manifest.name,
            "made_with": manifest.version,
            "study_sha256": manifest.study_sha256,
            "seed": manifest.seed,
            "license": manifest.license,
            "patch": {"points": patch.rows(), "cell_m": patch.cell_m()},
        });
        Description {
            robot: self.chosen.vehicle.clone(),
            fps: self.chosen.fps,
            features: features(patch, wheels),
            origin,
        }
    }

    fn finish(self) -> Result<Converted, Error> {
        let Self { release, output, chosen, writer, counts, .. } = self;
        let Some((_, writer)) = writer else {
            let message = "no mission has samples with commands, so there is nothing to learn from";
            return Err(Error::Input(format!("{}: {message}", release.folder().display())));
        };
        let license = release.sealed("LICENSE")?;
        let license = sastrugi_store::file::read(&license).map_err(|e| Error::at(&license, e))?;
        let readme = readme(release.manifest()).into_bytes();
        let Summary { episodes, frames, tasks, splits } =
            writer.finish(output, &[("README.md", readme), ("LICENSE", license)]).map_err(refused)?;
        let splits = splits.into_iter().map(|(name, first, end)| (name, json!(format!("{first}:{end}")))).collect();
        let (folder, fps, notes) = (output.to_owned(), chosen.fps, counts.notes());
        Ok(Converted { folder, episodes, frames, fps, tasks, splits, notes })
    }
}

impl Counts {
    fn notes(&self) -> Vec<String> {
        let mut notes = vec![];
        if self.left_out > 0 {
            let missions = counted(self.left_out, "mission");
            notes.push(format!("left out {missions} without commands, or with values beyond single precision"));
        }
        if self.unknown > 0 {
            let share = 100.0 * self.unknown as f64 / self.points as f64;
            notes.push(format!(
                "{share:.2} % of the points of the height patches lie beyond the terrain or next to holes: they are 0, and \
                 observation.height_known is false there"
            ));
        }
        notes
    }
}

/// Calls `f` with the samples of each mission of a file, in order.
fn for_each_mission(file: &Path, mut f: impl FnMut(&[SampleRow]) -> Result<(), Error>) -> Result<(), Error> {
    let mut rows: Vec<SampleRow> = vec![];
    let lacking = || Error::Input(format!("{}: has a null in a column that requires a value", file.display()));
    for cells in TableReader::open(file, &SampleRow::TABLE).map_err(ReleaseError::from)? {
        let row = SampleRow::from_cells(cells.map_err(ReleaseError::from)?).ok_or_else(lacking)?;
        if rows.last().is_some_and(|last| last.mission_id != row.mission_id) {
            f(&rows)?;
            rows.clear();
        }
        rows.push(row);
    }
    if rows.is_empty() { Ok(()) } else { f(&rows) }
}

/// Refuses samples that are not evenly spaced from time 0.
fn check_times(rows: &[SampleRow], fps: u32) -> Result<(), Error> {
    for (k, row) in rows.iter().enumerate() {
        let expected_s = k as f64 / f64::from(fps);
        let is_even = row.sample == k as i64 && (row.time_s - expected_s).abs() <= TIME_TOLERANCE_S;
        if !is_even {
            let SampleRow { terrain_id, mission_id, sample, time_s, .. } = row;
            return Err(Error::Input(format!(
                "mission {mission_id} on {terrain_id}: sample {sample} is at {time_s} s, but {fps} frames per second put it at \
                 {expected_s} s; LeRobot requires a constant rate"
            )));
        }
    }
    Ok(())
}

/// Features of a frame, in the order of an episode's values.
fn features(patch: &PatchShape, wheels: usize) -> Vec<Feature> {
    let feature = |name, kind, shape, names| Feature { name, kind, shape, names };
    let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<String>>();
    let of_wheel = |(name, _): &(&str, fn(&SampleRow) -> &[f32])| {
        let name = (*name).to_owned();
        (0..wheels).map(move |wheel| format!("{name}[{wheel}]"))
    };
    let measured = MEASURED.iter().map(|(name, _)| (*name).to_owned());
    let state: Vec<String> =
        owned(&FROM_START).into_iter().chain(measured).chain(OF_WHEELS.iter().flat_map(of_wheel)).collect();
    let side = Shape::Matrix([patch.rows(), patch.cols()]);
    let axes = || owned(&["front_to_back", "left_to_right"]);
    vec![
        feature("observation.state", Kind::F32, Shape::Vector(state.len()), state),
        feature("observation.height_patch", Kind::F32, side, axes()),
        feature("observation.height_known", Kind::Bool, side, axes()),
        feature("action", Kind::F32, Shape::Vector(COMMANDED.len()), owned(&COMMANDED.map(|(name, _)| name))),
        feature("next.done", Kind::Bool, Shape::Scalar, vec![]),
        feature("next.success", Kind::Bool, Shape::Scalar, vec![]),
    ]
}

/// The states of all frames, one after the other.
fn state(rows: &[SampleRow]) -> Vec<f32> {
    let start = &rows[0];
    let of = |row: &SampleRow| {
        let moved = [row.x_m - start.x_m, row.y_m - start.y_m, row.z_m - start.z_m];
        let measured = MEASURED.map(|(_, of)| of(row));
        let single = moved.into_iter().chain(measured).map(|value| value as f32);
        single.chain(OF_WHEELS.iter().flat_map(|(_, of)| of(row).iter().copied())).collect::<Vec<f32>>()
    };
    rows.iter().flat_map(of).collect()
}

/// The actions of all frames, one after the other.
fn commands(rows: &[SampleRow]) -> Vec<f32> {
    rows.iter().flat_map(|row| COMMANDED.map(|(_, of)| of(row) as f32)).collect()
}

/// The height patches of all frames, m above the ground under base_link; and where they are known. Elsewhere they are 0.
fn patches(rows: &[SampleRow], ground: &Grid, shape: &PatchShape) -> (Vec<f32>, Vec<bool>) {
    let of = |row: &SampleRow| {
        let heights = relative_height_patch(ground, [row.x_m, row.y_m], row.yaw_deg.to_radians(), shape);
        heights.into_iter().map(|height| height as f32)
    };
    let heights: Vec<f32> = rows.iter().flat_map(of).collect();
    let known = heights.iter().map(|height| height.is_finite()).collect();
    (heights.into_iter().map(|height| if height.is_finite() { height } else { 0.0 }).collect(), known)
}

/// The task of a mission in words, the same for all missions of a group and variant.
fn task(mission: &MissionRow) -> String {
    let MissionRow { vehicle, group, variant, .. } = mission;
    let on = group.as_ref().map_or_else(String::new, |group| format!(" across terrain {group}"));
    let with = variant.as_ref().map_or_else(String::new, |variant| format!(" with {variant}"));
    format!("drive {vehicle} to the goal{on}{with}")
}

/// `README.md`: a dataset card.
fn readme(manifest: &Manifest) -> String {
    let Manifest { name, license, version, sources, .. } = manifest;
    let mut text = format!(
        "---\npretty_name: {}\n{}task_categories:\n  - robotics\ntags:\n  - LeRobot\n  - terrain\n  - sastrugi\n\
         configs:\n  - config_name: default\n    data_files: data/*/*.parquet\n---\n\n\
         # {}\n\n\
         Missions of the release `{name}` as a LeRobot dataset (format 3.0), converted by {PROGRAM}; the release was made with sastrugi \
         {version}. An episode is one mission, a frame one sample. Licence: {license}; terms of measured data in `LICENSE`.\n\n\
         `LeRobotDataset(\"{name}\", root=FOLDER)` reads it without a network. `meta/info.json` names the splits as ranges of episodes, and \
         the origin under `sastrugi`; `meta/episodes` names terrain, mission, outcome and the start in the terrain's coordinates.\n",
        quoted(name),
        hub_license(license),
        folded(name)
    );
    if !sources.is_empty() {
        text.push_str("\n## Sources\n\n");
    }
    for source in sources {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "- {}", source_line(source));
    }
    text
}
