//! LeRobot datasets, version 3.0 of its format: what the `lerobot` package reads with `LeRobotDataset(repo_id, root=FOLDER)`.
//!
//! ```text
//! meta/info.json                               features, rate, counts, splits
//! meta/stats.json                              statistics of every feature over all frames
//! meta/tasks.parquet                           texts of the tasks; the text is the index of the data frame
//! meta/episodes/chunk-000/file-000.parquet     a row for each episode: where its frames are, its statistics
//! data/chunk-000/file-000.parquet              a row for each frame
//! ```
//!
//! An episode is one mission, a frame one sample. Parquet files are filled up to 100 MB with whole episodes, 1000 files to a folder, as
//! the package does. Every episode passes through once: memory is bounded by one episode and one row group. The same
//! episodes give the same bytes. The folder is written beside its destination and renamed when it is complete.

mod features;
mod parts;
mod stats;

#[cfg(test)]
mod tests;

pub use features::{Feature, Kind, Shape, Values};
pub use stats::Stats;

use crate::atomic;
use crate::file;
use crate::parquet::{TableError, element};
use crate::release::{ReleaseError, Staging, sync_tree};
use arrow_array::{ArrayRef, Float64Array, Int64Array, StringArray};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parts::{Part, Parts, properties};
use serde_json::{Map, Value, json};
use std::collections::HashMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Version of the format.
const CODEBASE_VERSION: &str = "v3.0";
/// Files in a folder.
const CHUNK_FILES: u64 = 1000;
/// Size at which a Parquet file is full, MB of 2^20 bytes.
const FILE_MB: u64 = 100;
/// Where the frames are, in the words of the package.
const DATA_PATH: &str = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet";
const DATA: &str = "data";
const EPISODES: &str = "meta/episodes";
const INFO: &str = "meta/info.json";
const STATS: &str = "meta/stats.json";
const TASKS: &str = "meta/tasks.parquet";
/// Key of our own entry in `meta/info.json`; the package keeps unknown keys.
const OWN: &str = "sastrugi";
/// Most rows of a row group of frames: about 21 MiB with a patch of 32 x 32.
const FRAME_ROWS: usize = 4096;
/// Most bytes of a row group of frames, unless one frame has more.
const GROUP_BYTES: usize = 64 << 20;
/// Most values of a feature in one Arrow array, whose lists have offsets of 32 bits.
const VALUES_MAX: usize = i32::MAX as usize;
/// Rows of a row group of episodes.
const EPISODE_ROWS: usize = 1024;

/// Failure to write a dataset.
#[derive(Debug, thiserror::Error)]
pub enum LerobotError {
    /// The destination holds something else, and is left untouched.
    #[error("{}: the folder is not empty and not a LeRobot dataset written by sastrugi; choose a new folder", path.display())]
    Occupied {
        /// The folder.
        path: PathBuf,
    },
    /// A Parquet file could not be written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The folder could not be written.
    #[error(transparent)]
    Folder(#[from] ReleaseError),
}

/// What all episodes have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Name of the vehicle.
    pub robot: String,
    /// Frames per second.
    pub fps: u32,
    /// Features of a frame, except those of every dataset (`timestamp`, `frame_index`, `episode_index`, `index`, `task_index`).
    pub features: Vec<Feature>,
    /// Origin of the dataset, stored under `sastrugi` in `meta/info.json`.
    pub origin: Value,
}

/// One mission.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// Split; the episodes of a split come one after the other.
    pub split: String,
    /// Text of the task.
    pub task: String,
    /// Id of the terrain.
    pub terrain_id: String,
    /// Id of the mission on that terrain.
    pub mission_id: String,
    /// Outcome of the mission.
    pub outcome: String,
    /// Position of the first frame in the terrain's coordinates, m.
    pub start_m: [f64; 3],
    /// Number of frames.
    pub frames: usize,
    /// Values of each feature of the description, in its order.
    pub values: Vec<Values>,
}

/// A dataset that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Number of episodes.
    pub episodes: u64,
    /// Number of frames.
    pub frames: u64,
    /// Texts of the tasks.
    pub tasks: Vec<String>,
    /// Splits: name, first episode, and the episode after the last.
    pub splits: Vec<(String, u64, u64)>,
}

/// Refuses a destination that is a file, or a folder with files other than a dataset that this program wrote.
///
/// # Errors
/// [`LerobotError::Occupied`]; [`LerobotError::Folder`] if the folder cannot be read.
pub fn check_folder(folder: &Path) -> Result<(), LerobotError> {
    let occupied = || LerobotError::Occupied { path: folder.to_owned() };
    match fs::read_dir(folder).map(|mut entries| entries.next().is_none()) {
        Ok(true) => Ok(()),
        Ok(false) if is_ours(folder) => Ok(()),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(()),
        Err(e) if e.kind() != ErrorKind::NotADirectory => Err(ReleaseError::io(folder)(e).into()),
        Ok(false) | Err(_) => Err(occupied()),
    }
}

fn is_ours(folder: &Path) -> bool {
    let info = file::read(&folder.join(INFO)).unwrap_or_default();
    let info: Value = serde_json::from_slice(&info).unwrap_or_default();
    info["codebase_version"] == CODEBASE_VERSION && info[OWN].is_object()
}

/// Writes a dataset episode by episode.
pub struct DatasetWriter {
    staging: Staging,
    description: Description,
    /// Features of the description, then those of every dataset.
    features: Vec<Feature>,
    /// Frames of an episode that fit in one array of each feature.
    frames_at_once: usize,
    data: Parts,
    episodes: Parts,
    stats: Option<Vec<Stats>>,
    written: Summary,
}

impl DatasetWriter {
    /// Starts a dataset beside its destination.
    ///
    /// # Errors
    /// As [`check_folder`]; the folder cannot be created.
    pub fn beside(folder: &Path, description: Description) -> Result<Self, LerobotError> {
        Self::with_file_bytes(folder, description, FILE_MB << 20)
    }

    fn with_file_bytes(folder: &Path, description: Description, file_bytes: u64) -> Result<Self, LerobotError> {
        check_folder(folder)?;
        let staging = Staging::beside(folder)?;
        let features = [description.features.clone(), Feature::of_every_dataset()].concat();
        let fields: Vec<Field> = features.iter().map(Feature::field).collect();
        let floats = features.iter().filter_map(Feature::float_path);
        let parts = |name: &str, schema: SchemaRef, properties: WriterProperties| {
            Parts::new(staging.path().join(name), schema, properties, file_bytes)
        };
        let frame_bytes: usize = features.iter().map(Feature::frame_bytes).sum();
        let group_rows = (GROUP_BYTES / frame_bytes).clamp(1, FRAME_ROWS);
        let data = parts(DATA, Arc::new(Schema::new(fields)), properties(group_rows, floats));
        let episodes = parts(EPISODES, episode_schema(&features), properties(EPISODE_ROWS, std::iter::empty()));
        let most_values = features.iter().map(|feature| feature.shape.count()).max().unwrap_or(1);
        let frames_at_once = (VALUES_MAX / most_values).max(1);
        let written = Summary { episodes: 0, frames: 0, tasks: vec![], splits: vec![] };
        Ok(Self { staging, description, features, frames_at_once, data, episodes, stats: None, written })
    }

    /// Appends an episode.
    ///
    /// # Errors
    /// A file cannot be written.
    ///
    /// # Panics
    /// If the values do not have the shapes of the features, or a split is interrupted by another (bugs of the caller).
    pub fn push(&mut self, episode: &Episode) -> Result<(), LerobotError> {
        let task = self.task_index(&episode.task);
        let own = Values::of_every_dataset(episode.frames, self.description.fps, &self.written, task);
        let values: Vec<&Values> = episode.values.iter().chain(&own).collect();
        assert_eq!(values.len(), self.features.len(), "every feature has its values");
        self.features.iter().zip(&values).for_each(|(feature, values)| feature.check(values, episode.frames));
        let place = self.data.place(episode.frames as u64)?;
        for first in (0..episode.frames).step_by(self.frames_at_once) {
            let some = first..episode.frames.min(first + self.frames_at_once);
            let arrays = self.features.iter().zip(&values).map(|(feature, values)| feature.array(values, &some));
            self.data.write(arrays.collect())?;
        }
        let stats = self.features.iter().zip(&values).map(|(feature, values)| feature.stats(values, episode.frames));
        let stats: Vec<Stats> = stats.collect();
        let row_place = self.episodes.place(1)?;
        let row = self.episode_row(episode, place, row_place, &stats);
        self.episodes.write(row)?;
        match &mut self.stats {
            Some(all) => all.iter_mut().zip(&stats).for_each(|(all, one)| all.merge(one)),
            None => self.stats = Some(stats),
        }
        self.count(episode);
        Ok(())
    }

    /// Index of a task, which is added if it is new.
    fn task_index(&mut self, task: &str) -> i64 {
        let tasks = &mut self.written.tasks;
        let index = tasks.iter().position(|known| known == task).unwrap_or_else(|| {
            tasks.push(task.to_owned());
            tasks.len() - 1
        });
        index as i64
    }

    fn count(&mut self, episode: &Episode) {
        let Summary { episodes, frames, splits, .. } = &mut self.written;
        let last = splits.last_mut().filter(|(split, ..)| *split == episode.split);
        match last {
            Some((_, _, end)) => *end += 1,
            None => {
                assert!(splits.iter().all(|(split, ..)| *split != episode.split), "a split is one range of episodes");
                splits.push((episode.split.clone(), *episodes, *episodes + 1));
            }
        }
        *episodes += 1;
        *frames += episode.frames as u64;
    }

    /// The row of an episode, in the order of [`episode_schema`].
    fn episode_row(
        &self,
        episode: &Episode,
        [chunk, file]: [i64; 2],
        [row_chunk, row_file]: [i64; 2],
        stats: &[Stats],
    ) -> Vec<Result<ArrayRef, ArrowError>> {
        let (first, frames) = (self.written.frames as i64, episode.frames as i64);
        let integer = |value: i64| -> ArrayRef { Arc::new(Int64Array::from(vec![value])) };
        let float = |value: f64| -> ArrayRef { Arc::new(Float64Array::from(vec![value])) };
        let text = |value: &str| -> ArrayRef { Arc::new(StringArray::from(vec![value])) };
        let tasks = features::list_of_all(text(&episode.task));
        let counts = [self.written.episodes as i64, frames, chunk, file, first, first + frames, row_chunk, row_file];
        let labels = [&episode.terrain_id, &episode.mission_id, &episode.split, &episode.outcome];
        std::iter::once(tasks)
            .chain(counts.map(integer).map(Ok))
            .chain(labels.map(|label| Ok(text(label))))
            .chain(episode.start_m.map(float).map(Ok))
            .chain(stats.iter().flat_map(Stats::arrays))
            .collect()
    }

    /// Completes the dataset with further files, such as `README.md` (name and bytes), and gives the folder its name. A dataset that this
    /// program wrote there before is replaced.
    ///
    /// # Errors
    /// A file cannot be written, or the destination is occupied.
    pub fn finish(mut self, folder: &Path, files: &[(&str, Vec<u8>)]) -> Result<Summary, LerobotError> {
        self.data.close()?;
        self.episodes.close()?;
        self.write_tasks()?;
        let named = self.features.iter().map(|feature| feature.name.to_owned());
        let stats = named.zip(self.stats.iter().flatten().map(Stats::to_json));
        self.write_json(STATS, &Value::Object(stats.collect()))?;
        self.write_json(INFO, &self.info())?;
        for (name, bytes) in files {
            self.write(name, bytes)?;
        }
        check_folder(folder)?;
        sync_tree(self.staging.path())?;
        self.staging.put_in_place(folder)?;
        Ok(self.written)
    }

    fn info(&self) -> Value {
        let Description { robot, fps, origin, .. } = &self.description;
        let features = self.features.iter().map(|feature| (feature.name.to_owned(), feature.to_json()));
        let splits =
            self.written.splits.iter().map(|(name, first, end)| (name.clone(), json!(format!("{first}:{end}"))));
        let mut info = json!({
            "codebase_version": CODEBASE_VERSION,
            "robot_type": robot,
            "total_episodes": self.written.episodes,
            "total_frames": self.written.frames,
            "total_tasks": self.written.tasks.len(),
            "chunks_size": CHUNK_FILES,
            "data_files_size_in_mb": FILE_MB,
            "video_files_size_in_mb": 200,
            "fps": fps,
            "splits": splits.collect::<Map<String, Value>>(),
            "data_path": DATA_PATH,
            "video_path": null,
            "features": features.collect::<Map<String, Value>>(),
        });
        info[OWN] = origin.clone();
        info
    }

    /// The tasks as pandas writes a data frame whose index is named `task`.
    fn write_tasks(&self) -> Result<(), LerobotError> {
        let column = |name: &str, pandas: &str, numpy: &str| json!({"name": name, "field_name": name, "pandas_type": pandas, "numpy_type": numpy, "metadata": null});
        let pandas = json!({
            "index_columns": ["task"],
            "column_indexes": [{
                "name": null, "field_name": null, "pandas_type": "unicode", "numpy_type": "object",
                "metadata": {"encoding": "UTF-8"},
            }],
            "columns": [column("task_index", "int64", "int64"), column("task", "unicode", "object")],
            "creator": {"library": "sastrugi", "version": env!("CARGO_PKG_VERSION")},
            "pandas_version": "2.2.3",
        })
        .to_string();
        let metadata = HashMap::from([("pandas".to_owned(), pandas.clone())]);
        let fields = vec![Field::new("task_index", DataType::Int64, true), Field::new("task", DataType::Utf8, true)];
        let schema = Arc::new(Schema::new(fields).with_metadata(metadata));
        let pairs = vec![KeyValue::new("pandas".to_owned(), pandas)];
        let properties = properties(EPISODE_ROWS, std::iter::empty());
        let properties = properties.into_builder().set_key_value_metadata(Some(pairs)).build();
        let indices: ArrayRef = Arc::new(Int64Array::from_iter_values(0..self.written.tasks.len() as i64));
        let texts: ArrayRef = Arc::new(StringArray::from(self.written.tasks.clone()));
        let mut part = Part::create(self.staging.path().join(TASKS), schema, properties)?;
        part.write(vec![Ok(indices), Ok(texts)])?;
        Ok(part.finish()?)
    }

    fn write_json(&self, name: &str, value: &Value) -> Result<(), LerobotError> {
        self.write(name, format!("{value:#}\n").as_bytes())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), LerobotError> {
        let path = self.staging.path().join(name);
        Ok(atomic::write(&atomic::Draft(self.staging.path()).file(name), bytes).map_err(ReleaseError::io(&path))?)
    }
}

/// Columns of `meta/episodes`: those that the package requires, our labels, then the statistics.
fn episode_schema(features: &[Feature]) -> SchemaRef {
    let column = |data_type: &DataType| {
        let data_type = data_type.clone();
        move |name: &str| Field::new(name, data_type.clone(), true)
    };
    let counts = [
        "episode_index",
        "length",
        "data/chunk_index",
        "data/file_index",
        "dataset_from_index",
        "dataset_to_index",
        "meta/episodes/chunk_index",
        "meta/episodes/file_index",
    ];
    let labels = ["terrain_id", "mission_id", "split", "outcome"];
    let start = ["start_x_m", "start_y_m", "start_z_m"];
    let mut fields = vec![Field::new("tasks", DataType::List(element(DataType::Utf8)), true)];
    fields.extend(counts.map(column(&DataType::Int64)));
    fields.extend(labels.map(column(&DataType::Utf8)));
    fields.extend(start.map(column(&DataType::Float64)));
    fields.extend(features.iter().flat_map(|feature| Stats::fields(feature.name)));
    Arc::new(Schema::new(fields))
}
