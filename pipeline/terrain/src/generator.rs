//! The interface of every generator, and the types it takes and returns.

use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::ParameterError;
use serde_json::Value;

/// A coordinate in m, rounded to the micrometre for messages: conversions leave meaningless digits.
pub(crate) fn rounded_coordinate(coordinate_m: f64) -> f64 {
    (1e6 * coordinate_m).round() / 1e6
}

/// Rough time per cell of most generators, s.
const SECONDS_PER_CELL: f64 = 6e-8;

/// A generator with checked parameters.
///
/// Generators of this crate come from [`crate::prepare`]; any other ground needs six methods:
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid, Streams};
/// use sastrugi_terrain::{Generator, Input, Terrain, TerrainError};
/// use serde_json::{Value, json};
///
/// /// A ramp that rises by 0.1 m from column to column.
/// struct Ramp(Geometry);
///
/// impl Generator for Ramp {
///     fn kind(&self) -> &'static str {
///         "ramp"
///     }
///
///     fn geometry(&self) -> Geometry {
///         self.0
///     }
///
///     fn parameters(&self) -> Value {
///         json!({ "size_px": [self.0.cols, self.0.rows], "cell_m": self.0.cell[0] })
///     }
///
///     fn memory_bytes(&self) -> u64 {
///         8 * self.0.len() as u64
///     }
///
///     fn notes(&self) -> Vec<String> {
///         Vec::new()
///     }
///
///     fn generate(&self, _streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
///         let heights = (0..self.0.len()).map(|k| 0.1 * (k % self.0.cols) as f64).collect();
///         Ok(Terrain::from(Grid::new(self.0, heights)))
///     }
/// }
///
/// # fn main() -> Result<(), TerrainError> {
/// let ramp: Box<dyn Generator> = Box::new(Ramp(Geometry::square(4, 11, 0.5)));
/// let terrain = ramp.generate_checked(&Streams::for_seed(1, "terrain"), &[])?;
/// assert_eq!(terrain.heights.range(), Some((0.0, 1.0)));
/// # Ok(())
/// # }
/// ```
pub trait Generator: Send + Sync {
    /// Name in `kind = "..."`.
    fn kind(&self) -> &'static str;

    /// Shape and position of the heightfield.
    fn geometry(&self) -> Geometry;

    /// All checked parameters, with defaults filled in and the size in cells. [`crate::prepare`] reads them back into the
    /// same generator.
    fn parameters(&self) -> Value;

    /// Peak working memory of [`Self::generate`], including its result, bytes.
    fn memory_bytes(&self) -> u64;

    /// Rough time of [`Self::generate`] on one core, s.
    fn seconds(&self) -> f64 {
        SECONDS_PER_CELL * self.geometry().len() as f64
    }

    /// Notes for users of the result, such as a size that was rounded down.
    fn notes(&self) -> Vec<String>;

    /// The inputs that its parameters name.
    fn inputs(&self) -> Vec<NamedInput> {
        Vec::new()
    }

    /// Checks the shapes and positions of the inputs before their values are read. `_places` follows the order of [`Self::inputs`];
    /// `None` where shape and position are not known yet. [`Self::generate`] refuses the same inputs with the same message.
    ///
    /// # Errors
    /// An unsuitable input, under the key of the parameter that makes it so.
    fn check_places(&self, _places: &[Option<Geometry>]) -> Result<(), ParameterError> {
        Ok(())
    }

    /// The heightfield with its maps, lines and notes. `inputs` follows the order of [`Self::inputs`].
    ///
    /// # Errors
    /// A [`TerrainError`] where parameters that are valid individually give no usable surface in combination.
    fn generate(&self, streams: &Streams, inputs: &[Input]) -> Result<Terrain, TerrainError>;

    /// As [`Self::generate`], and also checks that the heights are finite and not all equal in single precision, in which files
    /// store them.
    ///
    /// # Errors
    /// As [`Self::generate`]; heights that are not finite, or have no relief.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_numeric::{Geometry, Grid, Streams};
    /// use sastrugi_terrain::{Input, TerrainError, prepare};
    /// use serde_json::json;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let generator = prepare("compose", &json!({"size_px": [8, 6], "cell_m": 0.5, "processes": [{"of": "flat"}]}))?;
    /// assert_eq!(generator.inputs()[0].name, "flat");
    /// let inputs = [Input::from(Grid::filled(Geometry::square(6, 8, 0.5), 1.0))];
    /// let streams = Streams::for_seed(1, "terrain");
    /// assert_eq!(generator.generate(&streams, &inputs)?.heights.range(), Some((1.0, 1.0)));
    /// assert!(matches!(generator.generate_checked(&streams, &inputs), Err(TerrainError::Level { .. })));
    /// # Ok(())
    /// # }
    /// ```
    fn generate_checked(&self, streams: &Streams, inputs: &[Input]) -> Result<Terrain, TerrainError> {
        let made = self.generate(streams, inputs)?;
        let part = "the heights";
        if let Some(&value) = made.heights.values.iter().find(|z| !(**z as f32).is_finite()) {
            return Err(TerrainError::Unrepresentable { part, quantity: "one of them", value });
        }
        match made.heights.range() {
            Some((low, high)) if high as f32 > low as f32 => Ok(made),
            _ => Err(TerrainError::Level { part }),
        }
    }

    /// The heights as 16-bit levels, for generators that define such levels.
    ///
    /// ```
    /// use sastrugi_numeric::Streams;
    /// use sastrugi_terrain::prepare;
    /// use serde_json::json;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let generator = prepare("multifractal", &json!({"size_px": [60, 50]}))?;
    /// let heights = generator.generate(&Streams::for_seed(1, "terrain"), &[])?.heights;
    /// let levels = generator.levels(&heights).ok_or("a multifractal has levels")?;
    /// let height_m = |level: u16| (f64::from(level) - f64::from(levels.zero_level)) * levels.metres_per_level;
    /// assert!(levels.grid.values.iter().zip(&heights.values).all(|(level, z)| (height_m(*level) - z).abs() < 1e-9));
    /// # Ok(())
    /// # }
    /// ```
    fn levels(&self, _heights: &Grid) -> Option<Levels> {
        None
    }
}

/// An input of a generator, by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedInput {
    /// Dotted path of the parameter that names it.
    pub key: String,
    /// Its name: an id in a study, a file on the command line.
    pub name: String,
    /// What it contains.
    pub holds: Holds,
}

impl NamedInput {
    /// Heights named by the parameter `key`.
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

/// What an input contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holds {
    /// Heights of a surface; in a study, of an item.
    Heights,
    /// A raster of other values; in a study, also a map of an item, or a file.
    Values,
    /// Measured points, in a file.
    Points,
}

/// An input.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Heights or other values.
    Grid(Grid),
    /// Points `[x, y, z, sigma]`, m; sigma is 0 for a point treated as exact.
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
    /// Name; its file is `<id>.<name>.tif`, and no id may end that way.
    pub name: &'static str,
    /// Unit of the values, `1` for dimensionless numbers; empty for codes, which cannot be averaged.
    pub unit: &'static str,
    /// Meaning of the values.
    pub description: &'static str,
}

/// Every map.
pub const MAPS: [MapKind; 6] = [
    MapKind { name: "albedo", unit: "1", description: "fraction of the light that the ground reflects, 0 to 1" },
    MapKind { name: "class", unit: "", description: "ground material: 0 sand, 1 rock" },
    MapKind {
        name: "flux",
        unit: "1",
        description: "flux of the cascade, mean 1; the heights are its fractional integral",
    },
    MapKind {
        name: "rms-measured",
        unit: "m",
        description: "measured RMS height of profiles in the band, in windows of three times its longest wavelength",
    },
    MapKind {
        name: "rms-predicted",
        unit: "m",
        description: "RMS height of profiles in the band that the roughness rule predicts",
    },
    MapKind { name: "rock-potential", unit: "1", description: "fraction of the ground that rocks may cover, 0 to 1" },
];

/// A heightfield with the maps, lines and notes of its generator.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    /// Heights, m.
    pub heights: Grid,
    /// Rasters on the same cells.
    pub maps: Vec<Map>,
    /// Lines on the ground.
    pub lines: Vec<Line>,
    /// Notes that depend on the result, such as statistics measured while generating it.
    pub notes: Vec<String>,
}

impl From<Grid> for Terrain {
    fn from(heights: Grid) -> Self {
        Self { heights, maps: Vec::new(), lines: Vec::new(), notes: Vec::new() }
    }
}

/// A raster on the cells of the heights.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Name of one of [`MAPS`].
    pub name: &'static str,
    /// The values; NaN for no data.
    pub values: Grid,
}

impl Map {
    /// What the map shows.
    ///
    /// ```
    /// use sastrugi_numeric::{Geometry, Grid};
    /// use sastrugi_terrain::Map;
    ///
    /// let albedo = Map { name: "albedo", values: Grid::filled(Geometry::square(3, 3, 1.0), 0.25) };
    /// assert_eq!(albedo.kind().unit, "1");
    /// ```
    pub fn kind(&self) -> MapKind {
        let unknown = MapKind { name: self.name, unit: "", description: "" };
        MAPS.into_iter().find(|kind| kind.name == self.name).unwrap_or(unknown)
    }
}

/// A polyline on the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Name, unique among the lines of a terrain: `trail`, then `trail-2` ...
    pub name: String,
    /// Points `[x, y, z]` in the coordinates of the heights, z on the surface, m; a closed line ends with its first point.
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

/// Why a generator with valid parameters has no result. Messages read after "failed to".
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TerrainError {
    /// Waves so long, or cancelling so completely, that the relief is below rounding error.
    #[error(
        "resolve the relief: {relief_m:e} m is below the rounding error of waves whose amplitudes sum to {amplitude_m:e} m; \
         choose a shorter sampling length or a larger size"
    )]
    NoRelief {
        /// Highest minus lowest height, m.
        relief_m: f64,
        /// Sum of all wave amplitudes, m.
        amplitude_m: f64,
    },
    /// No relief to scale or to drive over.
    #[error("find relief in {part}: the height is the same everywhere")]
    Level {
        /// The surface, or the part of it.
        part: &'static str,
    },
    /// A value that is not finite, or zero where it must not be.
    #[error("compute {part}: {quantity} is {value:e}; choose less extreme parameters")]
    Unrepresentable {
        /// What was being computed.
        part: &'static str,
        /// Name of the quantity.
        quantity: &'static str,
        /// Its value.
        value: f64,
    },
    /// An input surface that cannot be used.
    #[error("use \"{surface}\": it {reason}")]
    Input {
        /// Its name in the parameters.
        surface: String,
        /// What is wrong, and what would be right; read after "it".
        reason: String,
    },
    /// A trail that does not fit the ground.
    #[error("lay the trail: {reason}")]
    Trail {
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// No relief in a band of wavelengths.
    #[error(
        "measure roughness at wavelengths of {min_m} to {max_m} m: the surface has no relief in this band; choose another"
    )]
    NoRoughness {
        /// Shortest wavelength, m.
        min_m: f64,
        /// Longest wavelength, m.
        max_m: f64,
    },
    /// A covariance that cannot be embedded in a torus of twice the surface.
    #[error(
        "embed the covariance: {share:.1e} of its spectrum is negative; choose a shorter correlation length or a larger size"
    )]
    Covariance {
        /// Sum of the magnitudes of the negative eigenvalues over that of all.
        share: f64,
    },
    /// A filtered layer or the product of layers is the same everywhere.
    #[error("find relief in {part}: it is flat after filtering; choose a smaller sigma or a larger size")]
    Flat {
        /// Name of the layer, or `the product of the layers`.
        part: &'static str,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A generator of given heights.
    struct Fixed(Grid);

    impl Generator for Fixed {
        fn kind(&self) -> &'static str {
            "fixed"
        }

        fn geometry(&self) -> Geometry {
            self.0.geometry
        }

        fn parameters(&self) -> Value {
            Value::Null
        }

        fn memory_bytes(&self) -> u64 {
            0
        }

        fn notes(&self) -> Vec<String> {
            Vec::new()
        }

        fn generate(&self, _streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
            Ok(self.0.clone().into())
        }
    }

    fn fixed(heights: &[f64]) -> Fixed {
        Fixed(Grid::new(Geometry::square(1, heights.len(), 1.0), heights.to_vec()))
    }

    /// Heights that single precision cannot hold, or that it makes equal.
    #[test]
    fn val_heights_that_files_cannot_hold_are_refused() {
        let checked = |heights: &[f64]| fixed(heights).generate_checked(&Streams::for_seed(1, "terrain"), &[]);
        for usable in [[0.0, 1.0], [1.0, 1.000_001], [-3.0, 0.0]] {
            assert_eq!(checked(&usable).map(|made| made.heights.values), Ok(usable.to_vec()));
        }
        for bad in [1e39, -1e39, f64::INFINITY] {
            let expected = TerrainError::Unrepresentable { part: "the heights", quantity: "one of them", value: bad };
            assert_eq!(checked(&[0.0, bad]), Err(expected));
        }
        let missing = checked(&[f64::NAN, 0.0]);
        assert!(matches!(missing, Err(TerrainError::Unrepresentable { value, .. }) if value.is_nan()), "{missing:?}");
        for level in [[5.0, 5.0], [1.0, 1.000_000_001]] {
            assert_eq!(checked(&level), Err(TerrainError::Level { part: "the heights" }));
        }
    }

    #[test]
    fn val_seconds_grow_with_the_cells() {
        assert!((fixed(&[0.0; 5]).seconds() / 3e-7 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn val_maps_are_described_by_their_name() {
        let kind = |name| Map { name, values: Grid::filled(Geometry::square(1, 1, 1.0), 0.0) }.kind();
        assert_eq!((kind("flux").unit, kind("rms-measured").unit, kind("class").unit), ("1", "m", ""));
        assert_eq!(kind("slope"), MapKind { name: "slope", unit: "", description: "" });
        assert!(MAPS.windows(2).all(|pair| pair[0].name < pair[1].name), "names must be unique and sorted");
    }

    #[test]
    fn val_coordinates_are_rounded_to_the_micrometre() {
        assert_eq!([0.1 + 0.2, -1.000_000_4, 2.000_000_6].map(rounded_coordinate), [0.3, -1.0, 2.000_001]);
    }
}
