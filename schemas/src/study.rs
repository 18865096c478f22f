//! The envelope of a study file: the keys of each item other than its kernel parameters. The parameters themselves are defined
//! by the kernels; a section's table combines the keys of the envelope and the kernel.

use crate::topics::EventKind;
use crate::{ParameterError, limits};
use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Names and ids, as a regular expression for the JSON Schema.
const NAME: &str = "^[a-z0-9][a-z0-9.-]{0,63}$";
/// Text that is not blank.
const NOT_BLANK: &str = r"\S";
/// Days of a calendar, apart from the lengths of the months.
const DATE: &str = "^[0-9]{4}-(0[1-9]|1[0-2])-(0[1-9]|[12][0-9]|3[01])$";
/// Web addresses.
const ADDRESS: &str = r"^https?://[^\s]+$";
/// DOIs, after the Citation File Format.
const DOI: &str = r"^10\.[0-9]{4,9}(\.[0-9]+)?/[A-Za-z0-9._;()/:-]+$";
/// ORCID iDs, apart from their checksum.
const ORCID: &str = "^([0-9]{4}-){3}[0-9]{3}[0-9X]$";
/// Names of creators: more than commas.
const CREATOR: &str = r"[^,\s]";
/// Statistics of a point-cloud cell.
const CELL_STATISTIC: &str = r"^(mean|median|min|max|p[0-9]+(\.[0-9]+)?)$";

/// `[study]`: properties of the release.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudyHead {
    /// Short name, `[a-z0-9][a-z0-9.-]{0,63}`.
    #[schemars(regex(pattern = NAME))]
    pub name: String,
    /// Title of the release; default: the name.
    #[serde(default)]
    pub title: String,
    /// Description of the release, one paragraph.
    #[serde(default)]
    pub description: String,
    /// Seed of every random stream of the study.
    pub seed: u64,
    /// Date of the study, YYYY-MM-DD: the only date in any output.
    #[schemars(regex(pattern = DATE))]
    pub date: String,
    /// Version of the dataset, for citations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(regex(pattern = NOT_BLANK))]
    pub version: Option<String>,
    /// Web page of the dataset, `https://...`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(regex(pattern = ADDRESS))]
    pub url: Option<String>,
    /// DOI of the dataset, `10.<registrant>/<suffix>`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(regex(pattern = DOI))]
    pub doi: Option<String>,
    /// Licence of the release: an SPDX expression, or `LicenseRef-<name>` for terms of your own. A DEM whose licence does not permit it is
    /// refused; if that is unknown, a note says so.
    #[serde(default = "default_license")]
    #[schemars(regex(pattern = NOT_BLANK))]
    pub license: String,
    /// Creators: names of people and organisations, or tables `{ name = "Family, Given", orcid = "...", affiliation = "..." }`. Write people
    /// as `Family, Given` so that citations can separate the parts of a name.
    #[serde(default)]
    pub creators: Vec<Creator>,
    /// Names in `creators` that are organisations, not people.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub organizations: Vec<String>,
    /// Keywords of the dataset.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("uniqueItems" = true), inner(regex(pattern = NOT_BLANK)))]
    pub keywords: Vec<String>,
    /// Funding: grants as Zenodo identifiers (`<DOI of the funder>::<number of the grant>`), or any text.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("uniqueItems" = true), inner(regex(pattern = NOT_BLANK)))]
    pub funding: Vec<String>,
    /// Start time of every mission in MCAP files, ns since 1970-01-01 UTC.
    #[serde(default = "default_epoch_ns")]
    pub epoch_ns: u64,
    /// Flavour of the MCAP files.
    #[serde(default)]
    pub mcap: McapFlavour,
    /// Layout of the GeoTIFFs in `terrain/`, `texture/` and `dem/`.
    #[serde(default)]
    pub geotiff: GeoTiff,
    /// Whether terrains of different groups share their random draws.
    #[serde(default)]
    pub pairing: Pairing,
    /// Shares of the splits `train`, `validation` and `test` among the terrains of every group, such as `[0.7, 0.15, 0.15]`, or of `train` and
    /// `test`, such as `[0.8, 0.2]`; they must add up to 1. If some terrains have a group, terrains without one are left out. A split takes whole
    /// independent sets, at least one: terrains made from one another, or from the same random draws, stay together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub split: Option<Shares>,
}

/// A creator of a study.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "must be a name, or a table `{ name = \"Family, Given\", orcid = \"...\", affiliation = \"...\" }`"
)]
pub enum Creator {
    /// A name with identifiers.
    Described {
        /// Name; people as `Family, Given`.
        #[schemars(regex(pattern = CREATOR))]
        name: String,
        /// ORCID iD of a person, such as `0000-0002-1825-0097`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(regex(pattern = ORCID))]
        orcid: Option<String>,
        /// Affiliation of a person.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(regex(pattern = NOT_BLANK))]
        affiliation: Option<String>,
    },
    /// A name.
    Name(#[schemars(regex(pattern = CREATOR))] String),
}

impl Creator {
    /// The name.
    pub fn name(&self) -> &str {
        match self {
            Self::Name(name) | Self::Described { name, .. } => name,
        }
    }

    /// The ORCID iD.
    pub fn orcid(&self) -> Option<&str> {
        match self {
            Self::Name(_) => None,
            Self::Described { orcid, .. } => orcid.as_deref(),
        }
    }

    /// The affiliation.
    pub fn affiliation(&self) -> Option<&str> {
        match self {
            Self::Name(_) => None,
            Self::Described { affiliation, .. } => affiliation.as_deref(),
        }
    }
}

/// Shares of the splits of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be the shares of two or three splits, such as [0.8, 0.2] or [0.7, 0.15, 0.15]")]
#[schemars(transform = limits::within(0.0, 1.0))]
pub enum Shares {
    /// `train`, `validation`, `test`.
    Three([f64; 3]),
    /// `train`, `test`.
    Two([f64; 2]),
}

impl Shares {
    /// Shares of `train`, `validation` and `test`.
    ///
    /// ```
    /// use sastrugi_schemas::study::Shares;
    ///
    /// let shares: Shares = serde_json::from_str("[0.8, 0.2]").unwrap();
    /// // Without a split for validation:
    /// assert_eq!(shares.by_part(), [0.8, 0.0, 0.2]);
    /// ```
    pub fn by_part(self) -> [f64; 3] {
        match self {
            Self::Three(shares) => shares,
            Self::Two([train, test]) => [train, 0.0, test],
        }
    }
}

impl Default for StudyHead {
    fn default() -> Self {
        Self {
            name: "study".to_owned(),
            title: String::new(),
            description: String::new(),
            seed: 0,
            date: "2000-01-01".to_owned(),
            version: None,
            url: None,
            doi: None,
            license: default_license(),
            creators: Vec::new(),
            organizations: Vec::new(),
            keywords: Vec::new(),
            funding: Vec::new(),
            epoch_ns: default_epoch_ns(),
            mcap: McapFlavour::default(),
            geotiff: GeoTiff::default(),
            pairing: Pairing::default(),
            split: None,
        }
    }
}

fn default_license() -> String {
    "CC-BY-4.0".to_owned()
}

fn default_epoch_ns() -> u64 {
    1_700_000_000_000_000_000
}

/// Flavour of the MCAP files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum McapFlavour {
    /// Foxglove protobuf, for viewers.
    #[default]
    Viewer,
    /// ROS 2: CDR, one bag per mission.
    Ros2,
}

/// Layout of a GeoTIFF; heights are the same in both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GeoTiff {
    /// Tiled, without overviews.
    #[default]
    Plain,
    /// Cloud-optimised GeoTIFF: with overviews, readable in part over a network.
    Cog,
}

/// Whether terrains of different groups share their random draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pairing {
    /// Every terrain and every mission has its own draws.
    #[default]
    Independent,
    /// The k-th replicates of all terrains use the same random stream, so that they differ only in their parameters. Their missions
    /// come from the same draws, accepted or rejected by each terrain's own class map: if two terrains accept the same draw,
    /// their missions have the same start and goal.
    Common,
}

/// `[[dem]]`: a measured DEM.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DemItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// File, relative to the study file.
    pub file: String,
    /// Label for statistics.
    #[serde(default)]
    pub group: Option<String>,
    /// Part to use, `[x0, y0, x1, y1]`, in the DEM's own coordinates (m, or degrees for a geographic raster).
    #[serde(default)]
    pub window: Option<[f64; 4]>,
    /// Cell size east-west and north-south, m, for files that state none (.npy) and for point clouds, whose cells are square.
    #[serde(default)]
    #[schemars(transform = limits::positive)]
    pub cell_m: Option<[f64; 2]>,
    /// Statistic that gives the height of a point-cloud cell (.las, .laz): `mean` of its points (default), `median`, `min`, `max`, or
    /// a percentile such as `p90`.
    #[serde(default)]
    #[schemars(regex(pattern = CELL_STATISTIC))]
    pub statistic: Option<String>,
    /// Fill gaps of a point cloud up to this distance from its points, in cells; default: gaps are not filled.
    #[serde(default)]
    pub fill_cells: Option<u32>,
    /// Use only the ground points (class 2) of a point cloud.
    #[serde(default)]
    pub ground_only: Option<bool>,
    /// Licence of the data: an SPDX identifier, `public domain`, or `LicenseRef-<name>` with the terms in `license_file`. One that does not permit
    /// the licence of the release is refused; if that is unknown, a note says so.
    #[serde(default)]
    #[schemars(regex(pattern = NOT_BLANK))]
    pub license: Option<String>,
    /// File with the text of that licence, relative to the study file; it is copied into the release with the data.
    #[serde(default)]
    pub license_file: Option<String>,
    /// Attribution: whom to credit as the source.
    #[serde(default)]
    #[schemars(regex(pattern = NOT_BLANK))]
    pub attribution: Option<String>,
    /// How to cite the data.
    #[serde(default)]
    #[schemars(regex(pattern = NOT_BLANK))]
    pub citation: Option<String>,
}

/// `[[terrain]]`: one generated terrain, or several with `count` and `sweep`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TerrainItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// Generator (see `sastrugi kinds`).
    pub kind: String,
    /// Label for statistics.
    #[serde(default)]
    pub group: Option<String>,
    /// Replicates `<id>-0001`, `<id>-0002` ...; one item with the plain id when absent.
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub count: Option<u32>,
    /// Explicit seed instead of the study's; replicate k uses `seed + k - 1`.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One item (or one set of replicates) per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
    /// Also write a 16-bit PNG of the heights.
    #[serde(default)]
    pub png16: bool,
    /// Also export for these simulators, to `export/<id>/<simulator>/`, with the vehicles driven on the terrain as MJCF and URDF,
    /// `export/vehicle/<traverse id>.xml` and `.urdf`.
    #[serde(default)]
    pub exports: BTreeSet<Simulator>,
    /// Decimate the meshes of the exports (`gazebo`, `isaac`): maximum vertical distance of any post from the mesh, m. Default: not
    /// decimated.
    #[serde(default)]
    #[schemars(transform = limits::not_negative)]
    pub export_max_error_m: Option<f64>,
}

/// Simulator for which a terrain can be exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Simulator {
    /// Unreal Engine: 16-bit PNG of a valid landscape size.
    Unreal,
    /// Unity: 16-bit raw heightmap of 2^n + 1 posts per side.
    Unity,
    /// Gazebo: SDF model and world with a 16-bit PNG of 2^n + 1 posts per side.
    Gazebo,
    /// MuJoCo: MJCF with a height field of 32-bit numbers.
    Mujoco,
    /// Isaac Sim and other readers of OpenUSD: a mesh with collision.
    Isaac,
}

impl Simulator {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Unreal, Self::Unity, Self::Gazebo, Self::Mujoco, Self::Isaac];

    /// Name in studies, on the command line and of folders.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unreal => "unreal",
            Self::Unity => "unity",
            Self::Gazebo => "gazebo",
            Self::Mujoco => "mujoco",
            Self::Isaac => "isaac",
        }
    }
}

/// `[[fit]]`: a covariance fit of a measured DEM, detrended by a moving average.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FitItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// Id of the DEM to fit.
    pub dem: String,
    /// Mask, or list of masks, as files relative to the study file: only cells marked by all of them are fitted. GeoJSON polygons in
    /// the DEM's own coordinates, or the nonzero cells of a raster.
    #[serde(default)]
    pub mask: Files,
    /// As `mask`, for cells to exclude.
    #[serde(default)]
    pub exclude: Files,
    /// File, as for `mask`, that marks a part of the DEM known to be smooth, from which the DEM's white and correlated noise are
    /// estimated. Not with `noise_sigma_m` or `correlated_noise_sigma_m`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_reference: Option<String>,
    /// Id of a DEM to co-register to the first and subtract (snow depth); both must be in the same metric coordinate system.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minus: Option<String>,
    /// Seed for the random streams of the replicates; default: derived from the study's seed and the id.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One fit per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// None, one or several files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be a file name or a list of file names")]
pub enum Files {
    /// One file.
    One(String),
    /// A list.
    List(Vec<String>),
}

impl Default for Files {
    fn default() -> Self {
        Self::List(Vec::new())
    }
}

impl Files {
    /// The names, with their positions if given as a list.
    pub fn numbered(&self) -> Vec<(Option<usize>, &str)> {
        match self {
            Self::One(file) => vec![(None, file)],
            Self::List(files) => files.iter().enumerate().map(|(k, file)| (Some(k), file.as_str())).collect(),
        }
    }
}

/// `[[texture]]`: a synthetic surface with a given covariance, alone or added to a base.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TextureItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// Id of the fit to match, or an explicit covariance: `{ model = "exponential", sigma_m = 0.03, range_m = 0.28 }`.
    pub fit: FitReference,
    /// Synthesis method (see `sastrugi kinds`).
    #[serde(default = "default_method")]
    pub method: String,
    /// Several methods to compare, `"all"` or a list, instead of `method`: one texture `<id>-<method>` each, and the table
    /// `scoreboard`. `"all"` means every method that synthesises a covariance; if the fit has `statistics = true`, also those
    /// that repeat a site.
    #[serde(default)]
    pub methods: Option<Methods>,
    /// Number of realisations per method for the scoreboard.
    #[serde(default = "default_realisations")]
    #[schemars(range(min = 1, max = Self::REALISATIONS_MAX))]
    pub realisations: u32,
    /// Base to which the texture is added: the id of a terrain, DEM or other texture, or `{ background = "<fit id>" }`, the background that a fit
    /// removed. The result has the base's cells, size and position: leave out `size_m`, `size_px` and `cell_m`, or state the same ones. A base with
    /// `count` needs the same `count` here: replicate k is added to replicate k of the base. Default: no base, level ground.
    #[serde(default)]
    pub onto: Option<Onto>,
    /// Factor on the heights of the texture, above 0; 2 doubles their standard deviation. Textures of a coarse DEM are steep on finer cells (RMS
    /// slope of an exponential: about sigma sqrt(2 / (range times cell))); a smaller factor leaves ground of class `low` for missions. Not with
    /// `methods` or `fill`.
    #[serde(default = "one")]
    #[schemars(transform = limits::positive)]
    pub amplitude: f64,
    /// Local factor on the texture: the id of a raster of factors, or a table of factors by the slope of the base.
    #[serde(default)]
    pub modulate: Option<Modulate>,
    /// Id of a DEM whose holes are filled with texture conditioned on their surroundings; `method` must be `fft_ma` or one that repeats
    /// the site.
    #[serde(default)]
    pub fill: Option<String>,
    /// Label for statistics.
    #[serde(default)]
    pub group: Option<String>,
    /// Replicates `<id>-0001`, `<id>-0002` ...; one item with the plain id when absent.
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub count: Option<u32>,
    /// Explicit seed instead of the study's; replicate k uses `seed + k - 1`.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One item (or one set of replicates) per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

impl TextureItem {
    /// Maximum number of realisations of a scoreboard.
    pub const REALISATIONS_MAX: u32 = 1000;
}

fn one() -> f64 {
    1.0
}

/// Base of a texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "must be the id of a terrain, DEM or texture, or a table `{ background = \"<fit id>\" }`"
)]
pub enum Onto {
    /// Id of a terrain, DEM or texture.
    Id(String),
    /// The background of a fitted DEM.
    Background {
        /// Id of the fit.
        background: String,
    },
}

/// Local factor on a texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be the id of a raster, or a table with lists `slope_deg` and `factor`")]
pub enum Modulate {
    /// Id of a raster of factors, 0 or above.
    Raster(String),
    /// By the slope of the base: linear interpolation between the given slopes, constant beyond them.
    #[serde(rename_all = "snake_case")]
    Slope {
        /// Slopes, degrees, ascending.
        #[schemars(length(min = 1))]
        slope_deg: Vec<f64>,
        /// Factor at each slope.
        #[schemars(length(min = 1), transform = limits::not_negative)]
        factor: Vec<f64>,
    },
}

/// The covariance that a texture matches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be the id of a fit, or a table with `model` and its parameters")]
pub enum FitReference {
    /// Id of a fit.
    Id(String),
    /// An explicit covariance.
    Stated {
        /// Covariance model, as in fit files.
        model: String,
        /// Its parameters.
        #[serde(flatten)]
        parameters: BTreeMap<String, f64>,
    },
}

/// Synthesis methods.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be \"all\" or a list of synthesis methods")]
pub enum Methods {
    /// `all`.
    Word(String),
    /// Some.
    List(Vec<String>),
}

fn default_realisations() -> u32 {
    8
}

fn default_method() -> String {
    "fft_ma".to_owned()
}

/// `[[missions]]`: starts and goals on terrains, and the lines to follow between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MissionsItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// Line that missions follow (see `sastrugi kinds`): `straight`, a planned route (`routed`), or the `trail` of a terrain.
    #[serde(default)]
    pub kind: MissionKind,
    /// Ids of the terrains, textures or DEMs to draw missions on; the id of a replicated item includes all its replicates. Not for
    /// `routed` missions, which use those of `of`.
    #[serde(default)]
    pub terrains: Vec<String>,
    /// For `routed` missions: id of the straight missions whose starts and goals are used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Explicit seed instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
}

/// Line that a mission follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MissionKind {
    /// The straight line from start to goal.
    #[default]
    Straight,
    /// The planned route from the start to the goal of a straight mission.
    Routed,
    /// The trail of a terrain (`compose`, `operation = "trail"`).
    Trail,
}

/// `[[route]]`: routes planned over terrains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RouteItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study; routes are named `<id>-0001` ...
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// Ids of the terrains, textures or DEMs to plan on; the id of a replicated item includes all its replicates.
    #[schemars(length(min = 1))]
    pub terrains: Vec<String>,
    /// Start, `[x, y]` in the terrain's coordinates, m; default: drawn at random.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<[f64; 2]>,
    /// Goal, `[x, y]` in the terrain's coordinates, m; default: drawn at random.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<[f64; 2]>,
    /// Number of start-goal pairs to draw on each terrain, 1 to 9999; default 1. All route stages with the same rules draw the same pairs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = Self::PAIRS_MAX))]
    pub pairs: Option<u32>,
    /// Areas to avoid, as a file or list of files relative to the study file: GeoJSON polygons in the terrain's coordinates, or the
    /// nonzero cells of a raster.
    #[serde(default)]
    pub obstacles: Files,
    /// Vehicle whose slope limits apply (see `sastrugi kinds vehicle`); `max_up_deg` and `max_down_deg` override them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vehicle: Option<String>,
    /// For `cost = "raster"`: id of a raster (a DEM or terrain) of factors above 0, in the terrain's coordinates; NaN cells are blocked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost_raster: Option<String>,
    /// Explicit seed for drawing pairs, instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One stage per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

impl RouteItem {
    /// Maximum number of pairs on a terrain: the ids of their routes have four digits.
    pub const PAIRS_MAX: u32 = 9999;
}

/// `[[navigate]]`: a team that follows planned routes in formation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NavigateItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study; runs are named `<id>-0001` ... by the number of their route.
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// Id of the routes to follow.
    pub route: String,
    /// Number of runs along each route, 1 to 9999; default 1: `<id>-0001-01`, `<id>-0001-02` ..., which differ in their random draws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = Self::COUNT_MAX))]
    pub count: Option<u32>,
    /// Explicit seed instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One stage per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

impl NavigateItem {
    /// Maximum number of runs along a route, as many as of missions on a terrain.
    pub const COUNT_MAX: u32 = 9999;
}

/// `[[rover]]`: rovers that find their own way with limited sensing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoverItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study; rovers are named `<id>-0001` ...
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// Navigator: see `sastrugi kinds`.
    pub kind: String,
    /// Ids of the terrains, textures or DEMs to drive on; the id of a replicated item includes all its replicates. On a `planetary` terrain,
    /// rovers may leave the window: the world is generated around them. On other terrains, rocks and albedo come from the maps.
    #[schemars(length(min = 1))]
    pub terrains: Vec<String>,
    /// Distance between rows of a rover in `rover_samples`, m; 0 for one row per cycle; default 0.5.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::not_negative)]
    pub sample_m: Option<f64>,
    /// Number of rovers recorded as MCAP on each terrain, starting with the first; default 1, 0 for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record: Option<u32>,
    /// Explicit seed of starts and noise instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
    /// Sensitivity of the results to the navigator's parameters: trials with varied parameters, in addition to the plain trial.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perturb: Option<Perturb>,
    /// One stage per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// `[[image]]`: a rendered image of a surface, with sun and camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study. With several surfaces images are named `<id>-<surface>`.
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// Id of the terrain, texture or DEM to render; the id of a replicated item includes all its replicates. The albedo is that of the
    /// terrain's map, if it has one.
    pub surface: String,
    /// Explicit seed of the noise instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One image per value of a parameter: `sweep.<parameter> = [...]`, such as `sweep."sun.azimuth_deg" = [0, 120, 240]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// `perturb` of `[[rover]]`: elementary effects of the navigator's parameters (M. Morris, Technometrics 33, 1991). Along a trajectory each
/// parameter changes once, up or down, while worlds, starts and noise stay fixed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Perturb {
    /// Largest relative change in either direction, above 0 and below 1: 0.1 varies each parameter between 0.9 and 1.1 of its value.
    #[schemars(transform = limits::between(0.0, 1.0))]
    pub share: f64,
    /// Number of trajectories, 1 to 999; the same on every world.
    #[schemars(range(min = 1, max = Self::TRAJECTORIES_MAX))]
    pub trajectories: u32,
    /// Number of equally spaced values of each parameter, even, 2 to 64. A step spans `levels / 2` of them: 4 levels and a share of 0.1 have the factors
    /// 0.9, 0.967, 1.033 and 1.1, and steps of 0.133.
    #[schemars(range(min = 2, max = Self::LEVELS_MAX), extend("multipleOf" = 2))]
    pub levels: u32,
    /// Number of rovers per design and world; default: that of the trial, at most 10.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub rovers: Option<u32>,
    /// Parameters to vary: names of numbers, or of lists of numbers, which are scaled together; `noise.<name>` for those of the noise. Default: all
    /// parameters of the navigator. Parameters equal to 0 are left out and named in a note.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<String>,
}

impl Default for Perturb {
    fn default() -> Self {
        Self { share: 0.1, trajectories: 10, levels: 4, rovers: None, parameters: Vec::new() }
    }
}

impl Perturb {
    /// Maximum number of trajectories: item ids have three digits for it.
    pub const TRAJECTORIES_MAX: u32 = 999;
    /// Maximum number of levels.
    pub const LEVELS_MAX: u32 = 64;

    /// # Errors
    /// A value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        if !(self.share > 0.0 && self.share < 1.0) {
            let rule = "it must lie above 0 and below 1, such as 0.1 for 10 %";
            return Err(ParameterError::new("share", format!("is {}; {rule}", self.share)));
        }
        if !(1..=Self::TRAJECTORIES_MAX).contains(&self.trajectories) {
            let rule = format!("it must be 1 to {}", Self::TRAJECTORIES_MAX);
            return Err(ParameterError::new("trajectories", format!("is {}; {rule}", self.trajectories)));
        }
        if !(2..=Self::LEVELS_MAX).contains(&self.levels) || self.levels % 2 == 1 {
            let rule = format!("it must be even, 2 to {}", Self::LEVELS_MAX);
            return Err(ParameterError::new("levels", format!("is {}; {rule}", self.levels)));
        }
        if self.rovers == Some(0) {
            return Err(ParameterError::new("rovers", "is 0; it must be 1 or more"));
        }
        Ok(())
    }
}

/// `[[photoclinometry]]`: heights recovered from images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhotoclinometryItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study. If the images show several surfaces, there is one item `<id>-<surface>` for each.
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// Ids of images, three or more of each surface; the id of a swept image includes all its values.
    #[schemars(length(min = 1))]
    pub images: Vec<String>,
    /// Id of a coarse DEM: the start of the first round, and a soft constraint on the heights.
    #[serde(default)]
    pub coarse: Option<String>,
    /// Standard deviation of its heights, m.
    #[serde(default)]
    #[schemars(transform = limits::positive)]
    pub coarse_sigma_m: Option<f64>,
    /// File of measured points (columns `x`, `y`, `z`, `sigma`, m), each a soft constraint with its sigma, above 0. With `free_exposure`, three or
    /// more points determine the tilt.
    #[serde(default)]
    pub altimetry: Option<String>,
    /// Label for statistics.
    #[serde(default)]
    pub group: Option<String>,
    /// Explicit seed instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One inversion per value of a setting: `sweep.<setting> = [...]`, such as `sweep."first_image_errors.exposure" = [0.0, 0.02]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// `[[traverse]]`: a vehicle that drives missions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TraverseItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study; missions are recorded as `<id>-0001` ...
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// Id of the missions to drive.
    pub missions: String,
    /// Id of a raster (a DEM or terrain) of friction coefficients between tyre and ground, in the terrain's coordinates; where it
    /// has no data, the value of the surface applies.
    #[serde(default)]
    pub wheel_friction_raster: Option<String>,
    /// As `wheel_friction_raster`, for rolling resistance over normal force.
    #[serde(default)]
    pub rolling_resistance_raster: Option<String>,
    /// One run per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// `[[hypothesis]]`: a claim about groups of missions, stated before the run. It does not affect the run; the report tests it and shows
/// it separately from exploratory comparisons.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = by_test)]
pub struct HypothesisItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    #[schemars(regex(pattern = NAME))]
    pub id: String,
    /// Metric of the missions.
    pub statistic: Statistic,
    /// Labels of the groups: two for `difference` and `equivalence`, three or more in order for `trend`. A single claim at level 0.05 needs at
    /// least 4 terrains in each group for a difference, 2 for a trend over three groups, and 2 for equivalence; with paired terrains (`pairing =
    /// "common"`), 6, 3 and 2. A family of several claims needs more: `sastrugi plan` says how many are missing.
    #[schemars(length(min = 2), extend("uniqueItems" = true))]
    pub groups: Vec<String>,
    /// Id of the `[[traverse]]` whose missions are tested. It must drive all of these groups and have no sweep; required if several
    /// traverses drive them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub traverse: Option<String>,
    /// The claim, which determines the test. Every terrain counts once, with the mean of its missions: of all of them for `success`, of those that
    /// reached the goal for other metrics. Groups that share their draws are compared by blocks of paired terrains.
    pub test: HypothesisTest,
    /// Direction of the change from the first group to the last; default: either. The test remains two-sided; the estimate must have this sign as
    /// well. Not for `equivalence`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<Direction>,
    /// Only for `equivalence`: the smallest difference of means at which groups count as different, above 0, in the unit of the
    /// statistic (success: percentage points).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub margin: Option<f64>,
    /// Level of the test, above 0 and below 0.5.
    #[serde(default = "default_alpha")]
    #[schemars(transform = limits::between(0.0, ALPHA_MAX))]
    pub alpha: f64,
    /// Hypotheses of the same family share one level (Holm, 1979); those without a family form one family.
    #[serde(default)]
    pub family: String,
}

fn default_alpha() -> f64 {
    0.05
}

/// Levels lie below this.
const ALPHA_MAX: f64 = 0.5;
/// Groups of a trend, at least.
const TREND_GROUPS_MIN: usize = 3;

/// What [`HypothesisItem::check`] asks of groups, margin and direction.
fn by_test(schema: &mut Schema) {
    let is = |test: HypothesisTest| json!({ "properties": { "test": { "const": test } }, "required": ["test"] });
    let groups = |limits: Value| json!({ "properties": { "groups": limits } });
    let rules = json!([
        {
            "if": is(HypothesisTest::Trend),
            "then": groups(json!({ "minItems": TREND_GROUPS_MIN })),
            "else": groups(json!({ "maxItems": 2 })),
        },
        {
            "if": is(HypothesisTest::Equivalence),
            "then": { "required": ["margin"], "not": { "required": ["direction"] } },
            "else": { "not": { "required": ["margin"] } },
        },
    ]);
    schema.insert("allOf".to_owned(), rules);
}

impl HypothesisItem {
    /// Refuses claims that cannot be tested in any study.
    ///
    /// # Errors
    /// The first invalid key.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_schemas::study::HypothesisItem;
    /// use serde_json::{from_value, json};
    ///
    /// let claim = json!({ "id": "a", "statistic": "time_s", "groups": ["smooth", "rough"], "test": "equivalence" });
    /// let claim: HypothesisItem = from_value(claim).unwrap();
    /// assert_eq!(claim.check().unwrap_err().key, "margin");
    /// assert!(HypothesisItem { margin: Some(2.0), ..claim }.check().is_ok());
    /// ```
    pub fn check(&self) -> Result<(), ParameterError> {
        let refuse = |key: &str, message: String| Err(ParameterError::new(key, message));
        let (count, trend) = (self.groups.len(), self.test == HypothesisTest::Trend);
        if trend && count < TREND_GROUPS_MIN {
            return refuse("groups", format!("has {count}; a trend needs three or more, in order"));
        }
        if !trend && count != 2 {
            return refuse("groups", format!("has {count}; this test compares exactly two"));
        }
        if let Some(k) = (1..count).find(|&k| self.groups[..k].contains(&self.groups[k])) {
            return refuse(&format!("groups.{k}"), format!("names \"{}\" twice", self.groups[k]));
        }
        let equivalence = self.test == HypothesisTest::Equivalence;
        match self.margin {
            None if equivalence => refuse("margin", "is missing; an equivalence claim needs a margin".into())?,
            Some(_) if !equivalence => refuse("margin", "applies only to `test = \"equivalence\"`".into())?,
            Some(margin) => drop(ParameterError::positive("margin", margin)?),
            None => {}
        }
        if equivalence && self.direction.is_some() {
            return refuse("direction", "does not apply to equivalence".into());
        }
        if !(self.alpha > 0.0 && self.alpha < ALPHA_MAX) {
            return refuse("alpha", format!("is {}; it must be above 0 and below {ALPHA_MAX}", self.alpha));
        }
        Ok(())
    }
}

/// Metric of a hypothesis. Every terrain counts once, with the mean of its missions: of all missions for `success`, of the successful
/// ones for the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Statistic {
    /// Share of missions that reach their goal, %.
    Success,
    /// Straight distance over path length.
    Efficiency,
    /// Time to the goal, s.
    TimeS,
    /// Root mean square of the vertical acceleration, m/s2.
    RmsVerticalAccelerationMS2,
    /// Root mean square of the derivative of the pitch angle, deg/s.
    RmsPitchRateDegS,
    /// Root mean square of the derivative of the roll angle, deg/s.
    RmsRollRateDegS,
    /// Largest absolute pitch, deg.
    MaxPitchDeg,
    /// Largest absolute roll, deg.
    MaxRollDeg,
}

impl Statistic {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Success,
        Self::Efficiency,
        Self::TimeS,
        Self::RmsVerticalAccelerationMS2,
        Self::RmsPitchRateDegS,
        Self::RmsRollRateDegS,
        Self::MaxPitchDeg,
        Self::MaxRollDeg,
    ];

    /// Column of the table `missions`; `success` has no column.
    pub const fn column(self) -> &'static str {
        match self {
            Self::Success => "success",
            Self::Efficiency => "efficiency",
            Self::TimeS => "time_s",
            Self::RmsVerticalAccelerationMS2 => "rms_vertical_acceleration_m_s2",
            Self::RmsPitchRateDegS => "rms_pitch_rate_deg_s",
            Self::RmsRollRateDegS => "rms_roll_rate_deg_s",
            Self::MaxPitchDeg => "max_pitch_deg",
            Self::MaxRollDeg => "max_roll_deg",
        }
    }

    /// Value for a mission, from its outcome and the value in its [column](Self::column), which success does not have: 100 or 0 (%) for
    /// success; for others, NaN unless the mission reached its goal.
    pub fn given(self, outcome: &str, value: f64) -> f64 {
        match (self, outcome == EventKind::Success.name()) {
            (Self::Success, true) => 100.0,
            (Self::Success, false) => 0.0,
            (_, true) => value,
            (_, false) => f64::NAN,
        }
    }
}

/// Claim of a hypothesis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HypothesisTest {
    /// Two groups differ: rank-sum test (Wilcoxon, Mann and Whitney), signed-rank test (Wilcoxon) for paired terrains.
    Difference,
    /// The metric rises or falls over ordered groups: permutation test of the rank correlation of group and value, Page's test for paired terrains.
    Trend,
    /// The means of two groups differ by less than the margin: two one-sided t tests (Schuirmann, 1987).
    Equivalence,
}

/// Direction of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Up.
    Rises,
    /// Down.
    Falls,
}

/// `[roughness]`: settings for the roughness and classes of every heightfield.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RoughnessSection {
    /// Largest gradient of class `low`, m/m. The gradient of a cell is the steepest rise or fall to any of its eight neighbours: height difference
    /// over distance (Moore gradient). On rough ground it grows as cells become finer, so the same ground has less of class `low` at a smaller
    /// `cell_m`. Default: 50 height levels of 0.75/128 cm for each cm of distance (Majhor and Bos, section 2.3).
    #[schemars(transform = limits::positive)]
    pub low_max: f64,
    /// Largest gradient of class `semi`, m/m, above `low_max`; steeper cells have class `high`. Default: 140 such levels.
    #[schemars(transform = limits::positive)]
    pub semi_max: f64,
    /// Border excluded from the class shares, m (Majhor and Bos, section 2.4).
    #[schemars(transform = limits::not_negative)]
    pub border_m: f64,
    /// Radius of the disk of the morphological closing, m, about that of the vehicle: a place between rougher cells that is too narrow for the disk
    /// takes their class, so that smooth patches too small for the vehicle vanish. Starts and goals of missions lie on the closed classes; class
    /// shares are those before the closing. 0: no closing. Default: half the diagonal of a Husky A200's outline.
    #[schemars(transform = limits::not_negative)]
    pub closing_radius_m: f64,
    /// Window of the moving average that is subtracted for the band RMS, m; default: 41 cells.
    #[schemars(transform = limits::positive)]
    pub band_window_m: Option<f64>,
}

impl Default for RoughnessSection {
    fn default() -> Self {
        // 0.75/128 cm per level: Unreal Engine's Z scale of 0.75 % (Majhor and Bos, section 2.2).
        let level_cm = 0.75 / 128.0;
        Self {
            low_max: 50.0 * level_cm,
            semi_max: 140.0 * level_cm,
            border_m: 5.0,
            closing_radius_m: 0.57,
            band_window_m: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{from_value, json, to_value};

    /// Thresholds as published: 50 and 140 levels of 0.75/128 cm per cm.
    #[test]
    fn val_roughness_by_default() {
        let section: RoughnessSection = from_value(json!({})).unwrap();
        assert_eq!((section.low_max, section.semi_max), (0.292_968_75, 0.820_312_5));
        assert_eq!((section.border_m, section.closing_radius_m, section.band_window_m), (5.0, 0.57, None));
        assert!(from_value::<RoughnessSection>(json!({ "low": 1.0 })).is_err());
    }

    /// A statistic is named like its column, and only missions that reached their goal have other values than success.
    #[test]
    fn val_statistics_of_the_missions_that_arrived() {
        for statistic in Statistic::ALL {
            assert_eq!(to_value(statistic).unwrap(), statistic.column());
            let found = ["success", "stuck"].map(|outcome| statistic.given(outcome, 7.0));
            match statistic {
                Statistic::Success => assert_eq!(found, [100.0, 0.0]),
                _ => assert!(found[0] == 7.0 && found[1].is_nan(), "{statistic:?}"),
            }
        }
    }

    /// Each value at its bounds and beyond.
    #[test]
    fn val_perturbations_out_of_range_are_refused() {
        let refusal = |perturb: Perturb| perturb.check().err().map(|e| e.key).unwrap_or_default();
        let plain = Perturb::default;
        assert_eq!(refusal(plain()), "");
        for share in [1e-9, 0.999] {
            assert_eq!(refusal(Perturb { share, ..plain() }), "", "{share}");
        }
        for share in [0.0, 1.0, -0.1, f64::NAN] {
            assert_eq!(refusal(Perturb { share, ..plain() }), "share", "{share}");
        }
        for (trajectories, key) in [(1, ""), (999, ""), (0, "trajectories"), (1000, "trajectories")] {
            assert_eq!(refusal(Perturb { trajectories, ..plain() }), key, "{trajectories}");
        }
        for (levels, key) in [(2, ""), (64, ""), (0, "levels"), (1, "levels"), (3, "levels"), (66, "levels")] {
            assert_eq!(refusal(Perturb { levels, ..plain() }), key, "{levels}");
        }
        assert_eq!(refusal(Perturb { rovers: Some(0), ..plain() }), "rovers");
        assert_eq!(refusal(Perturb { rovers: Some(1), ..plain() }), "");
    }

    /// Values that may be written in two ways.
    #[test]
    fn val_short_and_long_forms() {
        let creators: Vec<Creator> = from_value(json!(["Lab", { "name": "Doe, Jane", "affiliation": "Lab" }])).unwrap();
        assert_eq!((creators[0].name(), creators[0].affiliation()), ("Lab", None));
        let jane = &creators[1];
        assert_eq!((jane.name(), jane.orcid(), jane.affiliation()), ("Doe, Jane", None, Some("Lab")));
        let refused = from_value::<Creator>(json!({ "name": "Doe", "mail": "x" })).unwrap_err().to_string();
        assert!(refused.contains("must be a name, or a table"), "{refused}");

        let shares = |value| from_value::<Shares>(value).map(Shares::by_part).ok();
        assert_eq!(shares(json!([0.5, 0.25, 0.25])), Some([0.5, 0.25, 0.25]));
        assert_eq!(shares(json!([0.75, 0.25])), Some([0.75, 0.0, 0.25]));
        assert_eq!((shares(json!([1.0])), shares(json!(0.5))), (None, None));

        let files = |value| from_value::<Files>(value).unwrap();
        assert_eq!(files(json!("a.tif")).numbered(), [(None, "a.tif")]);
        assert_eq!(files(json!(["a", "b"])).numbered(), [(Some(0), "a"), (Some(1), "b")]);
        assert_eq!(Files::default().numbered(), []);

        let onto = |value| from_value::<Onto>(value).ok();
        assert_eq!(onto(json!("site")), Some(Onto::Id("site".to_owned())));
        assert_eq!(onto(json!({ "background": "fit" })), Some(Onto::Background { background: "fit".to_owned() }));
        assert_eq!(onto(json!({ "fit": "fit" })), None);
        let stated = json!({ "model": "exponential", "sigma_m": 0.03, "range_m": 0.28 });
        let stated: FitReference = from_value(stated).unwrap();
        let FitReference::Stated { model, parameters } = &stated else { panic!("{stated:?}") };
        let values = [parameters["sigma_m"], parameters["range_m"]];
        assert_eq!((model.as_str(), parameters.len(), values), ("exponential", 2, [0.03, 0.28]));
    }

    /// Words of the command line and of folders are those of studies.
    #[test]
    fn val_simulators_have_one_name() {
        for simulator in Simulator::ALL {
            assert_eq!(to_value(simulator).unwrap(), simulator.name());
        }
    }

    /// Each rule is violated on its own.
    #[test]
    fn val_untestable_hypotheses_are_refused() {
        let base = serde_json::json!({ "id": "a", "statistic": "success", "groups": ["x", "y"], "test": "difference" });
        let refusal = |changes: &[(&str, serde_json::Value)]| {
            let mut item = base.clone();
            changes.iter().for_each(|(key, value)| item[*key] = value.clone());
            serde_json::from_value::<HypothesisItem>(item).unwrap().check().err().map(|e| e.key).unwrap_or_default()
        };
        let words = |list: &[&str]| serde_json::json!(list);
        assert_eq!(refusal(&[]), "");
        assert_eq!(refusal(&[("groups", words(&["x"]))]), "groups");
        assert_eq!(refusal(&[("groups", words(&["x", "x"]))]), "groups.1");
        assert_eq!(refusal(&[("test", "trend".into())]), "groups");
        assert_eq!(refusal(&[("test", "trend".into()), ("groups", words(&["x", "y", "z"]))]), "");
        assert_eq!(refusal(&[("test", "equivalence".into())]), "margin");
        assert_eq!(refusal(&[("test", "equivalence".into()), ("margin", 2.0.into())]), "");
        assert_eq!(refusal(&[("test", "equivalence".into()), ("margin", (-2.0).into())]), "margin");
        assert_eq!(refusal(&[("margin", 2.0.into())]), "margin");
        assert_eq!(refusal(&[("alpha", 0.0.into())]), "alpha");
        assert_eq!(refusal(&[("alpha", 0.6.into())]), "alpha");
        assert_eq!(refusal(&[("direction", "falls".into())]), "");
        let directed = [("test", "equivalence".into()), ("margin", 1.0.into()), ("direction", "falls".into())];
        assert_eq!(refusal(&directed), "direction");
    }
}
