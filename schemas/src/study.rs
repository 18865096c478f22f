//! The envelope of a study file: what stands around the parameters of each item. The parameters themselves belong to
//! the kernels; a section's table is its envelope's keys and the kernel's keys together.

use crate::ParameterError;
use crate::tables::MissionRow;
use crate::topics::EventKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// `[study]`: the release as a whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudyHead {
    /// Short name, `[a-z0-9][a-z0-9.-]{0,63}`.
    pub name: String,
    /// Title of the release; the name when absent.
    #[serde(default)]
    pub title: String,
    /// A paragraph for readers of the release.
    #[serde(default)]
    pub description: String,
    /// Seed of every random stream of the study.
    pub seed: u64,
    /// Date of the study, YYYY-MM-DD: the only date in any output.
    pub date: String,
    /// Version of the dataset, as its readers cite it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// Page of the dataset, `https://...`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub url: Option<String>,
    /// DOI of the dataset, `10.<registrant>/<suffix>`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub doi: Option<String>,
    /// Licence of the release as an SPDX expression; it must be one that the licences of its DEMs permit.
    #[serde(default = "default_license")]
    pub license: String,
    /// People and organisations that made the study: names, or tables `{ name = "Family, Given", orcid = "...", affiliation = "..." }`. Write people
    /// as `Family, Given` so that citations can tell the parts of a name apart.
    #[serde(default)]
    pub creators: Vec<Creator>,
    /// Those of `creators` that are organisations.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub organizations: Vec<String>,
    /// Words to find the dataset by.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keywords: Vec<String>,
    /// Grants that paid for it: identifiers as Zenodo has them (`<DOI of the funder>::<number of the grant>`), or any text.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub funding: Vec<String>,
    /// Start of every mission's clock in MCAP files, ns since 1970-01-01 UTC.
    #[serde(default = "default_epoch_ns")]
    pub epoch_ns: u64,
    /// Flavour of the MCAP files.
    #[serde(default)]
    pub mcap: McapFlavour,
    /// Layout of the GeoTIFFs in `terrain/`, `texture/` and `dem/`.
    #[serde(default)]
    pub geotiff: GeoTiff,
    /// Whether groups share their random draws.
    #[serde(default)]
    pub pairing: Pairing,
    /// Shares of the parts `train`, `validation` and `test` among the terrains of every group, as `[0.7, 0.15, 0.15]`, or of `train` and `test`, as
    /// `[0.8, 0.2]`; they add up to 1. Terrains without a group take no part where others have one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub split: Option<Shares>,
}

/// Who made a study, or took part in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "must be a name, or a table `{ name = \"Family, Given\", orcid = \"...\", affiliation = \"...\" }`"
)]
pub enum Creator {
    /// A name and what identifies its bearer.
    Described {
        /// Name; people as `Family, Given`.
        name: String,
        /// ORCID iD of a person, as `0000-0002-1825-0097`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        orcid: Option<String>,
        /// Organisation that a person works for.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        affiliation: Option<String>,
    },
    /// A name.
    Name(String),
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

    /// The organisation that a person works for.
    pub fn affiliation(&self) -> Option<&str> {
        match self {
            Self::Name(_) => None,
            Self::Described { affiliation, .. } => affiliation.as_deref(),
        }
    }
}

/// Shares of the parts of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected the shares of two or three parts, as [0.8, 0.2] or [0.7, 0.15, 0.15]")]
pub enum Shares {
    /// `train`, `validation`, `test`.
    Three([f64; 3]),
    /// `train`, `test`.
    Two([f64; 2]),
}

impl Shares {
    /// Shares of `train`, `validation` and `test`.
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

/// Layout of a GeoTIFF. The heights are the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GeoTiff {
    /// Tiles, without overviews.
    #[default]
    Plain,
    /// With overviews, laid out so that a part can be read over a network (cloud-optimised GeoTIFF).
    Cog,
}

/// Whether terrains of different groups share their random draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pairing {
    /// Every terrain and every mission is drawn by itself.
    #[default]
    Independent,
    /// The k-th replicates of all terrains draw from one stream, so that they differ by their parameters alone. Their missions
    /// come from the same draws, each accepted by the terrain's own class map: where two terrains accept the same draw,
    /// their missions lead from the same start to the same goal.
    Common,
}

/// `[[dem]]`: a measured DEM.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DemItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    pub id: String,
    /// File, relative to the study file.
    pub file: String,
    /// Label for statistics.
    #[serde(default)]
    pub group: Option<String>,
    /// Part to use, `[x0, y0, x1, y1]` in the DEM's own coordinates (m, or degrees for a geographic raster).
    #[serde(default)]
    pub window: Option<[f64; 4]>,
    /// Cell size east-west and north-south, m, for files that carry none (.npy) and for point clouds, whose cells are square.
    #[serde(default)]
    pub cell_m: Option<[f64; 2]>,
    /// Height of a cell of a point cloud (.las, .laz): `mean` of its points (default), `median`, `min`, `max`, or `p90` for
    /// the 90th percentile.
    #[serde(default)]
    pub statistic: Option<String>,
    /// Fill the gaps of a point cloud up to this many cells from its points; none are filled when absent.
    #[serde(default)]
    pub fill_cells: Option<u32>,
    /// Take only the ground points (class 2) of a point cloud.
    #[serde(default)]
    pub ground_only: Option<bool>,
    /// Licence of the data as an SPDX identifier, or `public domain`.
    #[serde(default)]
    pub license: Option<String>,
    /// File with the text of that licence, relative to the study file; it goes into the release beside the data.
    #[serde(default)]
    pub license_file: Option<String>,
    /// Whom to name as the source.
    #[serde(default)]
    pub attribution: Option<String>,
    /// How the data asks to be cited.
    #[serde(default)]
    pub citation: Option<String>,
}

/// `[[terrain]]`: a generated terrain, or as many as `count` and `sweep` say.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TerrainItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    pub id: String,
    /// Generator (see `sastrugi kinds`).
    pub kind: String,
    /// Label for statistics.
    #[serde(default)]
    pub group: Option<String>,
    /// Replicates `<id>-0001`, `<id>-0002` ...; one item with the plain id when absent.
    #[serde(default)]
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
    /// Also write folders to import into simulators, `export/<id>/<simulator>/`, and the vehicles that drive there as MJCF and URDF,
    /// `export/vehicle/<traverse id>.xml` and `.urdf`.
    #[serde(default)]
    pub exports: BTreeSet<Simulator>,
    /// Decimate the meshes of the exports (`gazebo`, `isaac`): no post is farther from them than this, vertically, m. Not decimated
    /// when absent.
    #[serde(default)]
    pub export_max_error_m: Option<f64>,
}

/// Program into which a terrain can be imported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Simulator {
    /// Unreal Engine: 16-bit PNG of a valid landscape size.
    Unreal,
    /// Unity: 16-bit raw heightmap of 2^n + 1 posts a side.
    Unity,
    /// Gazebo: SDF model and world with a 16-bit PNG of 2^n + 1 posts a side.
    Gazebo,
    /// MuJoCo: MJCF with a height field of 32-bit numbers.
    Mujoco,
    /// Isaac Sim and others that read OpenUSD: a mesh with collision.
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

/// `[[fit]]`: the covariance of a measured DEM, detrended by a moving average.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FitItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    pub id: String,
    /// Id of the DEM to fit.
    pub dem: String,
    /// Mask, or list of masks: files, relative to the study file, of the cells that take part; with several, those that all
    /// of them mark. GeoJSON with polygons in the DEM's own coordinates, or a raster that is not 0 there.
    #[serde(default)]
    pub mask: Files,
    /// As `mask`, for cells that take no part.
    #[serde(default)]
    pub exclude: Files,
    /// File, as `mask`, of a part of the DEM that is smooth in reality: the DEM's noise, white and correlated, is found there. Not
    /// with `noise_sigma_m` or `correlated_noise_sigma_m`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_reference: Option<String>,
    /// Id of a DEM that is co-registered to the first and subtracted (snow depth), both in one metric coordinate system.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minus: Option<String>,
    /// Seed of the replicates' random streams; follows from the study's seed and the id when absent.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One fit per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// No file, one, or several.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a file name or a list of file names")]
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
    /// The names, each with its position in the list when there is a list.
    pub fn numbered(&self) -> Vec<(Option<usize>, &str)> {
        match self {
            Self::One(file) => vec![(None, file)],
            Self::List(files) => files.iter().enumerate().map(|(k, file)| (Some(k), file.as_str())).collect(),
        }
    }
}

/// `[[texture]]`: a synthetic surface with a given covariance, alone or on a base.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TextureItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    pub id: String,
    /// Id of the fit to match, or a stated covariance: `{ model = "exponential", sigma_m = 0.03, range_m = 0.28 }`.
    pub fit: FitReference,
    /// Synthesis method (see `sastrugi kinds`).
    #[serde(default = "default_method")]
    pub method: String,
    /// Several methods side by side, `"all"` or a list, in place of `method`: a texture `<id>-<method>` of each, and the
    /// table `scoreboard`.
    #[serde(default)]
    pub methods: Option<Methods>,
    /// Realisations of each method that the scoreboard measures.
    #[serde(default = "default_realisations")]
    pub realisations: u32,
    /// What the texture is added to: the id of a terrain or DEM, or `{ background = "<fit id>" }`, the background that a fit took
    /// off; the texture stands alone when absent.
    #[serde(default)]
    pub onto: Option<Onto>,
    /// Factor on the heights of the texture, above 0: 2 doubles their standard deviation. Not with `methods` or `fill`.
    #[serde(default = "one")]
    pub amplitude: f64,
    /// Factor of the texture on its base: the id of a raster of factors, or a table by the base's slope.
    #[serde(default)]
    pub modulate: Option<Modulate>,
    /// Id of a DEM whose holes are filled with texture that fits what is around them.
    #[serde(default)]
    pub fill: Option<String>,
    /// Label for statistics.
    #[serde(default)]
    pub group: Option<String>,
    /// Replicates `<id>-0001`, `<id>-0002` ...; one item with the plain id when absent.
    #[serde(default)]
    pub count: Option<u32>,
    /// Explicit seed instead of the study's; replicate k uses `seed + k - 1`.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One item (or one set of replicates) per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

fn one() -> f64 {
    1.0
}

/// Base of a texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "`onto` is the id of a terrain or DEM, or a table `{ background = \"<fit id>\" }`"
)]
pub enum Onto {
    /// Id of a terrain or DEM.
    Id(String),
    /// The DEM without its texture.
    Background {
        /// Id of the fit that took the background off its DEM.
        background: String,
    },
}

/// Factor of a texture on its base.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "`modulate` is the id of a raster, or a table with lists `slope_deg` and `factor`")]
pub enum Modulate {
    /// Id of a raster of factors, 0 or above.
    Raster(String),
    /// By the base's slope: straight lines between the slopes given, the outer factors beyond them.
    #[serde(rename_all = "snake_case")]
    Slope {
        /// Slopes, degrees, ascending.
        slope_deg: Vec<f64>,
        /// Factor at each slope.
        factor: Vec<f64>,
    },
}

/// What a texture matches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "`fit` is the id of a fit, or a table with `model` and the numbers of that model")]
pub enum FitReference {
    /// Id of a fit.
    Id(String),
    /// A covariance without a measured surface.
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
#[serde(untagged, expecting = "`methods` is \"all\" or a list of synthesis methods")]
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

/// `[[missions]]`: starts and goals on terrains, and the lines between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MissionsItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    pub id: String,
    /// What a mission follows (see `sastrugi kinds`): `straight` lines, `routed` paths or the `trail` of a terrain.
    #[serde(default)]
    pub kind: MissionKind,
    /// Ids of the terrains, textures or DEMs to draw missions on; the id of a replicated item stands for all of them. Not for
    /// `routed` missions, which have those of `of`.
    #[serde(default)]
    pub terrains: Vec<String>,
    /// For `routed` missions: id of the straight missions whose starts and goals they have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Explicit seed instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
}

/// What a mission follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MissionKind {
    /// The straight line from start to goal.
    #[default]
    Straight,
    /// The planned route from the start to the goal of a straight mission.
    Routed,
    /// The trail that a terrain was given (`compose`, `operation = "trail"`).
    Trail,
}

/// `[[route]]`: planned paths over terrains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RouteItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study; routes are named `<id>-0001` ...
    pub id: String,
    /// Ids of the terrains, textures or DEMs to plan on; the id of a replicated item stands for all of them.
    pub terrains: Vec<String>,
    /// Start, `[x, y]` in the terrain's coordinates, m; drawn when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<[f64; 2]>,
    /// Goal, `[x, y]` in the terrain's coordinates, m; drawn when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<[f64; 2]>,
    /// Pairs of start and goal to draw on each terrain; 1 when absent. All route stages with the same rules draw the same pairs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pairs: Option<u32>,
    /// File, or list of files, relative to the study file, of what cannot be entered: GeoJSON with polygons in the terrain's
    /// coordinates, or a raster that is not 0 there.
    #[serde(default)]
    pub obstacles: Files,
    /// Vehicle whose limits of slope hold (see `sastrugi kinds`); `max_up_deg` and `max_down_deg` override them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vehicle: Option<String>,
    /// Id of a raster (a DEM or terrain) of factors above 0 for `cost = "raster"`, in the terrain's coordinates; NaN is blocked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost_raster: Option<String>,
    /// Explicit seed of drawn pairs instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One stage per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// `[[navigate]]`: a team in formation along planned routes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NavigateItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study; runs are named `<id>-0001` ... by the number of their route.
    pub id: String,
    /// Id of the routes to follow.
    pub route: String,
    /// Runs along each route, `<id>-0001-01`, `<id>-0001-02` ..., which differ by their random draws; one run when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u32>,
    /// Explicit seed instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One stage per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// `[[rover]]`: rovers that find their own way by what they sense.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoverItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study; rovers are named `<id>-0001` ...
    pub id: String,
    /// Navigator: see `sastrugi kinds`.
    pub kind: String,
    /// Ids of the terrains, textures or DEMs to drive on; the id of a replicated item stands for all of them. Of a `planetary` terrain rovers
    /// drive on the whole world, which is made around them, not on its window alone; rocks and albedo of other terrains are those of their maps.
    pub terrains: Vec<String>,
    /// Distance between two rows of `rover_samples` of a rover, m; 0 for a row every cycle; 0.5 when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample_m: Option<f64>,
    /// Rovers of each terrain that are recorded as MCAP files, the first ones; 1 when absent, 0 for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record: Option<u32>,
    /// Explicit seed of starts and noise instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
    /// Which number of the navigator matters most? Trials with changed numbers, beside the plain one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perturb: Option<Perturb>,
    /// One stage per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// `[[image]]`: a rendered image of a surface under a sun and a camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study. With several surfaces images are named `<id>-<surface>`.
    pub id: String,
    /// Id of the terrain, texture or DEM to look at; the id of a replicated item stands for all of them. Its albedo is that of the
    /// terrain's map, where it has one.
    pub surface: String,
    /// Explicit seed of the noise instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One image per value of a parameter: `sweep.<parameter> = [...]`, as `sweep."sun.azimuth_deg" = [0, 120, 240]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// `perturb` of `[[rover]]`: elementary effects of the navigator's numbers (M. Morris, Technometrics 33, 1991). Along a trajectory each
/// parameter moves once, up or down, while worlds, starts and noise stay.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Perturb {
    /// Largest relative change to either side, above 0 and below 1: 0.1 moves each parameter between 0.9 and 1.1 of its value.
    pub share: f64,
    /// Trajectories, 1 to 999; the same ones on every world.
    pub trajectories: u32,
    /// Equally spaced values of each parameter, even, 2 to 64. A step is `levels / 2` of them: 4 levels and a share of 0.1 have the factors
    /// 0.9, 0.967, 1.033 and 1.1, and steps of 0.133.
    pub levels: u32,
    /// Rovers of each design on each world; those of the trial, but at most 10, when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rovers: Option<u32>,
    /// Parameters to move: names of numbers or of lists of numbers, which are scaled as a whole; `noise.<name>` for those of the noise. All of the
    /// navigator's when empty. Those of value 0 are left out, and named in a note.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<String>,
}

impl Default for Perturb {
    fn default() -> Self {
        Self { share: 0.1, trajectories: 10, levels: 4, rovers: None, parameters: Vec::new() }
    }
}

impl Perturb {
    /// Most trajectories: three digits in the ids of their items.
    pub const TRAJECTORIES_MAX: u32 = 999;
    /// Most levels.
    pub const LEVELS_MAX: u32 = 64;

    /// # Errors
    /// A value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        if !(self.share > 0.0 && self.share < 1.0) {
            let rule = "it must lie above 0 and below 1, as 0.1 for 10 %";
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
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study. Where the images show several surfaces, one `<id>-<surface>` for each.
    pub id: String,
    /// Ids of images; the id of a swept image stands for all of its images. Three or more of each surface.
    pub images: Vec<String>,
    /// Id of a coarse DEM that holds the heights: rounds begin there, and it is a soft constraint.
    #[serde(default)]
    pub coarse: Option<String>,
    /// Standard deviation of the heights of its cells, m.
    #[serde(default)]
    pub coarse_sigma_m: Option<f64>,
    /// File of measured points (columns `x`, `y`, `z`, `sigma`, m), each a soft constraint with its sigma, above 0. Beside `free_exposure` three or more
    /// points settle the tilt.
    #[serde(default)]
    pub altimetry: Option<String>,
    /// Label for statistics.
    #[serde(default)]
    pub group: Option<String>,
    /// Explicit seed instead of the study's.
    #[serde(default)]
    pub seed: Option<u64>,
    /// One inversion per value of a setting: `sweep.<setting> = [...]`, as `sweep."first_image_errors.exposure" = [0.0, 0.02]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// `[[traverse]]`: a vehicle that drives missions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TraverseItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study; missions are recorded as `<id>-0001` ...
    pub id: String,
    /// Id of the missions to drive.
    pub missions: String,
    /// Id of a raster (a DEM or terrain) of friction coefficients between tyre and ground, in the terrain's coordinates; where
    /// it holds no data the surface's own counts.
    #[serde(default)]
    pub wheel_friction_raster: Option<String>,
    /// As `wheel_friction_raster`, of rolling resistance over normal force.
    #[serde(default)]
    pub rolling_resistance_raster: Option<String>,
    /// One run per value of a parameter: `sweep.<parameter> = [...]`.
    #[serde(default)]
    pub sweep: BTreeMap<String, Vec<serde_json::Value>>,
}

/// `[[hypothesis]]`: a claim about groups of missions, stated before the run. It computes nothing: the report tests it and shows it
/// apart from everything that was not stated beforehand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HypothesisItem {
    /// Id, `[a-z0-9][a-z0-9.-]{0,63}`, unique in the study.
    pub id: String,
    /// Figure of the missions.
    pub statistic: Statistic,
    /// Labels of the groups: two for `difference` and `equivalence`, three or more in their order for `trend`.
    pub groups: Vec<String>,
    /// Id of the `[[traverse]]` whose missions are meant, one that drives all of these groups and has no sweep; needed where several
    /// drive them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub traverse: Option<String>,
    /// What is claimed.
    pub test: HypothesisTest,
    /// Which way the figure goes from the first group to the last; either way when absent. Not for `equivalence`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<Direction>,
    /// For `equivalence` alone: the difference of means from which on groups count as different, in the unit of the statistic
    /// (success: percentage points), above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin: Option<f64>,
    /// Level of the test, above 0 and below 0.5.
    #[serde(default = "default_alpha")]
    pub alpha: f64,
    /// Hypotheses with the same text share one level (Holm, 1979); all that name none are one family.
    #[serde(default)]
    pub family: String,
}

fn default_alpha() -> f64 {
    0.05
}

impl HypothesisItem {
    /// Refuses what no test can be made of, whatever the study.
    ///
    /// # Errors
    /// The first key that is wrong.
    pub fn check(&self) -> Result<(), ParameterError> {
        let refuse = |key: &str, message: String| Err(ParameterError::new(key, message));
        let (count, trend) = (self.groups.len(), self.test == HypothesisTest::Trend);
        if trend && count < 3 {
            return refuse("groups", format!("has {count}; a trend goes over three or more, in their order"));
        }
        if !trend && count != 2 {
            return refuse("groups", format!("has {count}; this test compares two"));
        }
        if let Some(k) = (1..count).find(|&k| self.groups[..k].contains(&self.groups[k])) {
            return refuse(&format!("groups.{k}"), format!("names \"{}\" twice", self.groups[k]));
        }
        let equivalence = self.test == HypothesisTest::Equivalence;
        match self.margin {
            None if equivalence => refuse("margin", "is missing; equivalence is claimed within a margin".into())?,
            Some(_) if !equivalence => refuse("margin", "is for `test = \"equivalence\"` alone".into())?,
            Some(margin) => drop(ParameterError::positive("margin", margin)?),
            None => {}
        }
        if equivalence && self.direction.is_some() {
            return refuse("direction", "has no meaning for equivalence".into());
        }
        if !(self.alpha > 0.0 && self.alpha < 0.5) {
            return refuse("alpha", format!("is {}; it must be above 0 and below 0.5", self.alpha));
        }
        Ok(())
    }
}

/// Figure of the missions that a hypothesis is about. Every terrain counts once, by the mean of its missions: of all for
/// `success`, of the successful ones for the others.
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

    /// Column of the table `missions`; `success` is that of no column.
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

    /// Value of a mission: of success 100 or 0 (%), of others NaN unless it reached its goal.
    pub fn of(self, mission: &MissionRow) -> f64 {
        let succeeded = mission.outcome == EventKind::Success.name();
        match self {
            Self::Success if succeeded => 100.0,
            Self::Success => 0.0,
            _ if !succeeded => f64::NAN,
            Self::Efficiency => mission.efficiency,
            Self::TimeS => mission.time_s,
            Self::RmsVerticalAccelerationMS2 => mission.rms_vertical_acceleration_m_s2,
            Self::RmsPitchRateDegS => mission.rms_pitch_rate_deg_s,
            Self::RmsRollRateDegS => mission.rms_roll_rate_deg_s,
            Self::MaxPitchDeg => mission.max_pitch_deg,
            Self::MaxRollDeg => mission.max_roll_deg,
        }
    }
}

/// What a hypothesis claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HypothesisTest {
    /// Two groups differ.
    Difference,
    /// The figure rises or falls over ordered groups.
    Trend,
    /// The means of two groups differ by less than the margin.
    Equivalence,
}

/// Which way a figure goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Up.
    Rises,
    /// Down.
    Falls,
}

/// `[roughness]`: how every heightfield is classified and described.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RoughnessSection {
    /// Largest Moore gradient of class `low`, m/m (50 levels of 0.75/128 cm per cm; Majhor and Bos, section 2.3).
    pub low_max: f64,
    /// Largest Moore gradient of class `semi`, m/m (140 levels per cm).
    pub semi_max: f64,
    /// Border left out of the class shares, m (Majhor and Bos, section 2.4).
    pub border_m: f64,
    /// Radius of the disk of the morphological closing, m (half diagonal of a Husky A200's outline).
    pub closing_radius_m: f64,
    /// Window of the moving average below which the band RMS is taken, m; 41 cells when absent.
    pub band_window_m: Option<f64>,
}

impl Default for RoughnessSection {
    fn default() -> Self {
        // 0.75/128 cm a level: Unreal Engine's Z scale of 0.75 % (Majhor and Bos, section 2.2).
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

    /// Every rule is broken alone.
    #[test]
    fn val_hypotheses_that_no_test_fits_are_refused() {
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
