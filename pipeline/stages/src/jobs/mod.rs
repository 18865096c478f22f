//! Jobs: one file per stage, each the glue between a kernel and the files of an item.

pub mod coregistration;
pub mod dem;
pub mod exports;
pub mod fit;
pub mod mask;
pub mod missions;
pub mod original;
pub mod roughness;
pub mod scoreboard;
pub mod surface;
pub mod terrain;
pub mod texture;
pub mod traverse;

use crate::machine::{Fault, fault};
use crate::revision::Room;
use sastrugi_schemas::study::GeoTiff;
use sastrugi_schemas::tables::{
    CandidateCurveRow, CandidateRow, CovarianceRow, FitRow, HeightDistributionRow, LikelihoodProfileRow, MissionRow,
    ParameterRow, ProfilePsdRow, PsdRow, ReplicateRow, ScoreCovarianceRow, ScoreRow, StructureRow, SurfaceRow,
    TerrainRow,
};
use sastrugi_store::atomic::{self, Draft, DraftFile};
use sastrugi_store::dem::WriteOptions;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// Name of an item: its stage and its id.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ItemRef {
    /// Stage, as `terrain`.
    pub stage: String,
    /// Id, unique within the stage.
    pub id: String,
}

impl ItemRef {
    /// The item `id` of `stage`.
    pub fn new(stage: &str, id: &str) -> Self {
        Self { stage: stage.to_owned(), id: id.to_owned() }
    }
}

impl fmt::Display for ItemRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.stage, self.id)
    }
}

/// What one item of a study does. A job is glue: it reads the artifacts of its parents, calls a kernel, and writes files.
pub trait Job: Send + Sync {
    /// Everything in the study that decides what the result holds, defaults filled in.
    fn recipe(&self) -> Value;
    /// What decides only how the same heights are packed: items made from them stay as they are. Null for the usual way.
    fn packing(&self) -> Value {
        Value::Null
    }
    /// Rooms whose code decides the result, besides the ones that every job stands on.
    fn rooms(&self) -> &'static [Room];
    /// Peak working memory, bytes.
    fn memory_bytes(&self) -> u64;
    /// Rough cost, for `plan` and the progress bar.
    fn estimate(&self) -> Estimate;
    /// Does the work.
    ///
    /// # Errors
    /// Why this item has no result; the other items go on.
    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError>;
}

/// How the heights of a release are written.
fn raster_options(geotiff: GeoTiff) -> WriteOptions {
    WriteOptions { cloud_optimised: geotiff == GeoTiff::Cog, ..WriteOptions::default() }
}

/// What [`Job::packing`] says of rasters written with [`raster_options`].
fn raster_packing(geotiff: GeoTiff) -> Value {
    match geotiff {
        GeoTiff::Plain => Value::Null,
        GeoTiff::Cog => "cog".into(),
    }
}

/// Rough cost of an item on one core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Estimate {
    /// Time, s.
    pub seconds: f64,
    /// Bytes of its artifacts.
    pub bytes: f64,
}

/// Where a job finds its inputs and leaves its outputs.
pub struct Work<'a> {
    /// Folder for the outputs.
    pub folder: Draft<'a>,
    /// Folders of the parents' artifacts.
    pub parents: &'a BTreeMap<ItemRef, PathBuf>,
}

impl Work<'_> {
    /// A file of a parent.
    ///
    /// # Errors
    /// When the item is no parent (a bug in the stage's registration).
    pub fn parent(&self, item: &ItemRef, file: &str) -> Result<PathBuf, JobError> {
        let folder = self.parents.get(item).ok_or_else(|| JobError::new(format!("{item} is not a parent")))?;
        Ok(folder.join(file))
    }

    /// An output.
    pub fn output(&self, file: &str) -> DraftFile {
        self.folder.file(file)
    }

    /// Writes an output of a few bytes.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn write(&self, file: &str, bytes: &[u8]) -> Result<(), JobError> {
        atomic::write(&self.output(file), bytes).map_err(|e| JobError::at(&self.folder.0.join(file), e))
    }
}

/// What a job leaves behind.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Outcome {
    /// Files in the item's folder.
    pub products: Vec<Product>,
    /// Rows for the tables.
    pub rows: Rows,
    /// Sentences that a reader must know.
    pub notes: Vec<String>,
}

/// One file that a job made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Product {
    /// Name in the item's folder.
    pub file: String,
    /// Path in the release; absent for files that serve later stages only.
    pub release_path: Option<String>,
    /// Hash of the decoded content (heights, rows, messages), where there is one.
    pub content: Option<String>,
    /// Number of messages, for recordings.
    pub records: Option<u64>,
}

impl Product {
    /// A file that goes into the release.
    pub fn released(file: &str, release_path: String, content: Option<String>) -> Self {
        Self { file: file.to_owned(), release_path: Some(release_path), content, records: None }
    }

    /// A file for later stages.
    pub fn internal(file: &str) -> Self {
        Self { file: file.to_owned(), release_path: None, content: None, records: None }
    }
}

/// Rows of the release's tables.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Rows {
    /// Table `terrains`.
    pub terrains: Vec<TerrainRow>,
    /// Table `fits`.
    pub fits: Vec<FitRow>,
    /// Table `covariance`.
    pub covariance: Vec<CovarianceRow>,
    /// Table `candidates`.
    pub candidates: Vec<CandidateRow>,
    /// Table `candidate_curves`.
    pub candidate_curves: Vec<CandidateCurveRow>,
    /// Table `likelihood_profile`.
    pub likelihood_profile: Vec<LikelihoodProfileRow>,
    /// Table `surfaces`.
    pub surfaces: Vec<SurfaceRow>,
    /// Table `structure`.
    pub structure: Vec<StructureRow>,
    /// Table `profile_psd`.
    pub profile_psd: Vec<ProfilePsdRow>,
    /// Table `psd`.
    pub psd: Vec<PsdRow>,
    /// Table `height_distribution`.
    pub height_distribution: Vec<HeightDistributionRow>,
    /// Table `scoreboard`.
    pub scoreboard: Vec<ScoreRow>,
    /// Table `scoreboard_covariance`.
    pub scoreboard_covariance: Vec<ScoreCovarianceRow>,
    /// Table `missions`.
    pub missions: Vec<MissionRow>,
    /// Table `parameters`.
    pub parameters: Vec<ParameterRow>,
    /// Table `replicates`.
    pub replicates: Vec<ReplicateRow>,
}

/// Why an item has no result.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{message}")]
pub struct JobError {
    /// One sentence.
    pub message: String,
    /// Where the reason lies.
    pub cause: Cause,
}

/// Where the reason for a failure lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// In the item: other items are not concerned.
    Item,
    /// In the item's input data.
    Input,
    /// In the machine: every item would fail.
    Machine(Fault),
}

impl JobError {
    /// A failure of the item, with its reason.
    pub fn new(message: impl fmt::Display) -> Self {
        Self { message: message.to_string(), cause: Cause::Item }
    }

    /// A failure that lies in the input data.
    pub fn input(message: impl fmt::Display) -> Self {
        Self { message: message.to_string(), cause: Cause::Input }
    }

    /// A failure to read or write: the machine's where the error says so, else the item's.
    pub fn io(error: impl std::error::Error + 'static) -> Self {
        let cause = fault(&error).map_or(Cause::Item, Cause::Machine);
        Self { message: error.to_string(), cause }
    }

    /// The same about a file.
    pub fn at(path: &Path, error: std::io::Error) -> Self {
        Self::io(error).reworded(|words| format!("{}: {words}", path.display()))
    }

    /// The same with other words.
    pub fn reworded(self, words: impl FnOnce(&str) -> String) -> Self {
        Self { message: words(&self.message), ..self }
    }
}
