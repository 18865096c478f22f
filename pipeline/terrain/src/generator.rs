//! What every generator offers.

use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::ParameterError;
use serde_json::Value;

/// A coordinate for a message, m: to the micrometre, since conversions leave digits that mean nothing.
pub(crate) fn told(coordinate_m: f64) -> f64 {
    (1e6 * coordinate_m).round() / 1e6
}

/// Rough time of a cell of most generators, s.
const SECONDS_PER_CELL: f64 = 4e-7;

/// A generator with checked parameters.
pub trait Generator: Send + Sync {
    /// Name in `kind = "..."`.
    fn kind(&self) -> &'static str;

    /// Shape and place of the heightfield.
    fn geometry(&self) -> Geometry;

    /// The full checked parameters, defaults filled in and the size in cells. [`crate::prepare`] reads them back to the
    /// same generator.
    fn parameters(&self) -> Value;

    /// Peak working memory of [`Self::generate`], its result included, bytes.
    fn memory_bytes(&self) -> u64;

    /// Rough time of [`Self::generate`] on one core, s.
    fn seconds(&self) -> f64 {
        SECONDS_PER_CELL * self.geometry().len() as f64
    }

    /// Sentences that a reader of the result should know, such as a size that was rounded down.
    fn notes(&self) -> Vec<String>;

    /// What it takes as input, as its parameters name it.
    fn inputs(&self) -> Vec<NamedInput> {
        Vec::new()
    }

    /// Whether inputs of these shapes and places can serve, before their values are read. They are those of [`Self::inputs`], in that order;
    /// `None` where shape and place are not known yet. [`Self::generate`] refuses the same in the same words.
    ///
    /// # Errors
    /// An input that cannot serve, by the parameter that decides it.
    fn check_places(&self, _places: &[Option<Geometry>]) -> Result<(), ParameterError> {
        Ok(())
    }

    /// The heightfield, with what belongs to it. `inputs` are those of [`Self::inputs`], in that order.
    ///
    /// # Errors
    /// A [`TerrainError`] where the parameters are possible one by one but give no usable surface together.
    fn generate(&self, streams: &Streams, inputs: &[Input]) -> Result<Terrain, TerrainError>;

    /// As [`Self::generate`], and the heights are finite and not the same everywhere, whatever the parameters: in single precision, in
    /// which files hold them.
    ///
    /// # Errors
    /// As [`Self::generate`]; heights beyond all numbers, or without relief.
    fn generate_checked(&self, streams: &Streams, inputs: &[Input]) -> Result<Terrain, TerrainError> {
        let made = self.generate(streams, inputs)?;
        let part = "the heights";
        if let Some(&value) = made.heights.values.iter().find(|z| !(**z as f32).is_finite()) {
            return Err(TerrainError::Unrepresentable { part, figure: "one of them", value });
        }
        match made.heights.range() {
            Some((low, high)) if high as f32 > low as f32 => Ok(made),
            _ => Err(TerrainError::Level { part }),
        }
    }

    /// The heights as 16-bit levels, for generators that define them.
    fn levels(&self, _heights: &Grid) -> Option<Levels> {
        None
    }
}

/// What a generator takes as input, by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedInput {
    /// Dotted path of the parameter that names it.
    pub key: String,
    /// Its name: an id in a study, a file on the command line.
    pub name: String,
    /// What it holds.
    pub holds: Holds,
}

impl NamedInput {
    /// Heights that the parameter `key` names.
    pub fn heights(key: &str, name: &str) -> Self {
        Self { key: key.to_owned(), name: name.to_owned(), holds: Holds::Heights }
    }

    /// A raster of other values.
    pub fn values(key: &str, name: &str) -> Self {
        Self { holds: Holds::Values, ..Self::heights(key, name) }
    }

    /// Measured points.
    pub fn points(key: &str, name: &str) -> Self {
        Self { holds: Holds::Points, ..Self::heights(key, name) }
    }

    /// An error about it.
    pub(crate) fn error(&self, reason: impl Into<String>) -> TerrainError {
        TerrainError::Input { surface: self.name.clone(), reason: reason.into() }
    }
}

/// What an input holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holds {
    /// Heights of a surface; in a study those of an item.
    Heights,
    /// A raster of other values; in a study also a map of an item, or a file.
    Values,
    /// Measured points, in a file.
    Points,
}

/// An input.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Heights or other values.
    Grid(Grid),
    /// Points `[x, y, z, sigma]`, m; sigma is 0 for a point that counts as exact.
    Points(Vec<[f64; 4]>),
}

impl From<Grid> for Input {
    fn from(grid: Grid) -> Self {
        Self::Grid(grid)
    }
}

/// What a map shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapKind {
    /// Name; its file is called `<id>.<name>.tif`, and no id ends so.
    pub name: &'static str,
    /// Unit of the values, `1` for plain numbers; empty for codes, which have no means.
    pub unit: &'static str,
    /// What the values are.
    pub description: &'static str,
}

/// Every map.
pub const MAPS: [MapKind; 6] = [
    MapKind { name: "albedo", unit: "1", description: "share of the light that the ground gives back, 0 to 1" },
    MapKind { name: "class", unit: "", description: "what the ground is: 0 sand, 1 rock" },
    MapKind { name: "flux", unit: "1", description: "flux of the cascade that the heights integrate, mean 1" },
    MapKind {
        name: "rms-measured",
        unit: "m",
        description: "RMS of profiles in the band, in windows of three times its longest wavelength",
    },
    MapKind {
        name: "rms-predicted",
        unit: "m",
        description: "RMS of profiles in the band, by the rule that the roughness varies by",
    },
    MapKind { name: "rock-potential", unit: "1", description: "share of the ground that all rocks may cover, 0 to 1" },
];

/// A heightfield, and what else its generator knows of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    /// Heights, m.
    pub heights: Grid,
    /// Rasters on the same cells.
    pub maps: Vec<Map>,
    /// Lines on the ground.
    pub lines: Vec<Line>,
    /// Sentences that only making it could tell, such as figures that were measured on the way.
    pub notes: Vec<String>,
}

impl From<Grid> for Terrain {
    fn from(heights: Grid) -> Self {
        Self { heights, maps: Vec::new(), lines: Vec::new(), notes: Vec::new() }
    }
}

/// A raster beside the heights, on the same cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Name of one of [`MAPS`].
    pub name: &'static str,
    /// The values; NaN where there are none.
    pub values: Grid,
}

impl Map {
    /// What it shows.
    pub fn kind(&self) -> MapKind {
        let nameless = MapKind { name: self.name, unit: "", description: "" };
        MAPS.into_iter().find(|kind| kind.name == self.name).unwrap_or(nameless)
    }
}

/// A polyline on the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Name, its own among the lines of a terrain: `trail`, then `trail-2` ...
    pub name: String,
    /// Points `[x, y, z]` in the coordinates of the heights, z on the surface, m; of a closed line the last is the first.
    pub points_m: Vec<[f64; 3]>,
}

/// Heights as 16-bit levels, as in a greyscale PNG: `height_m = (level - zero_level) * metres_per_level`.
#[derive(Clone, Debug, PartialEq)]
pub struct Levels {
    /// The levels.
    pub grid: Grid<u16>,
    /// Height of one level, m.
    pub metres_per_level: f64,
    /// Level of height 0.
    pub zero_level: u16,
}

/// Why a generator with valid parameters has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TerrainError {
    /// Waves so long, or so cancelled, that the surface drowns in rounding errors.
    #[error(
        "resolve the relief: {relief_m:e} m from waves of together {amplitude_m:e} m is within reach of rounding errors; \
         choose a shorter sampling length or a larger size"
    )]
    NoRelief {
        /// Highest less lowest height, m.
        relief_m: f64,
        /// Sum of all wave amplitudes, m.
        amplitude_m: f64,
    },
    /// Nothing that could be scaled, or driven over.
    #[error("find relief in {part}: the height is the same everywhere")]
    Level {
        /// What was made.
        part: &'static str,
    },
    /// A figure that cannot be worked with.
    #[error("make {part}: {figure} is {value:e}; choose less extreme parameters")]
    Unrepresentable {
        /// Which values.
        part: &'static str,
        /// Name of the figure.
        figure: &'static str,
        /// The figure.
        value: f64,
    },
    /// An input surface is not usable.
    #[error("use \"{surface}\": it {reason}")]
    Input {
        /// Its name in the parameters.
        surface: String,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// A trail that cannot be laid on the ground.
    #[error("lay the trail: {reason}")]
    Trail {
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// Nothing in a band of wavelengths to scale.
    #[error(
        "measure roughness in wavelengths of {min_m} to {max_m} m: the surface has none there; choose another band"
    )]
    NoRoughness {
        /// Shortest wavelength, m.
        min_m: f64,
        /// Longest wavelength, m.
        max_m: f64,
    },
    /// A covariance that does not fit a torus of twice the surface.
    #[error(
        "embed the covariance: {share:.1e} of its spectrum is negative; choose a shorter correlation length or a larger size"
    )]
    Covariance {
        /// Sizes of the negative eigenvalues over the sizes of all.
        share: f64,
    },
    /// A filtered layer or the product of layers is the same everywhere.
    #[error("find relief in {part}: it is flat after filtering; choose a smaller sigma or a larger size")]
    Flat {
        /// Name of the layer, or `the product of the layers`.
        part: &'static str,
    },
}
