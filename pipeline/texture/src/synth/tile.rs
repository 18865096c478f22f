//! Size, cells, repetition, anisotropy and height distribution: what the parameters of all methods have in common.

use super::Cost;
use super::marginal::Marginal;
use crate::covariance::Covariance;
use crate::covariance::form::half_turn;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Vecherin et al. 2022, Figure 5.
const DEFAULT_SIZE_M: [f64; 2] = [20.0; 2];
/// Vecherin et al. 2022, section 3.2.
const DEFAULT_CELL_M: f64 = 0.1;
/// Most cells of a texture: 2 GiB of heights, as many as a raster may have when it is read back.
pub const CELLS_MAX: u64 = 1 << 28;
/// A quotient this near to an integer is that integer.
const INTEGER_TOLERANCE: f64 = 1e-6;
/// Smallest ratio of anisotropy, that of fit files.
const RATIO_MIN: f64 = 0.02;
/// A periodic tile this many ranges wide holds a Matern covariance; fewer are enough when the field need not repeat.
const SELF_AFFINE_RANGES: [f64; 2] = [16.0, 4.0];

/// Size of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Cell {
    /// The same both ways, m.
    Square(f64),
    /// East-west and north-south, m.
    Oblong([f64; 2]),
}

impl Cell {
    fn sides_m(self) -> [f64; 2] {
        match self {
            Self::Square(side) => [side; 2],
            Self::Oblong(sides) => sides,
        }
    }
}

/// Where the height distribution comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Heights {
    /// Normal.
    #[default]
    Normal,
    /// The shape of the fitted residual's.
    Measured,
}

/// Raw parameters that every method has.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TileParameters {
    /// Size of one tile, east-west and north-south, m; in place of `size_px`. Default 20 x 20 (Vecherin et al. 2022,
    /// Figure 5).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_m: Option<[f64; 2]>,
    /// Size of one tile in cells, columns and rows; in place of `size_m`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_px: Option<[u32; 2]>,
    /// Cell size, m: one number, or east-west and north-south. Default 0.1 (Vecherin et al. 2022, section 3.2).
    pub cell_m: Cell,
    /// How often a periodic tile is repeated, rows and columns. Default once.
    pub tile: [u32; 2],
    /// Range across the long axis over range along it, in [0.02, 1]; in place of the fit's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ratio: Option<f64>,
    /// Direction of the long axis, degrees clockwise from north; in place of the fit's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_deg: Option<f64>,
    /// Range that a self-affine fit is given, m. Default: 1/16 of the shorter side of a periodic tile, 1/4 of one that is
    /// not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outer_m: Option<f64>,
    /// Height distribution: `normal` (default), or `measured`, the shape of the fitted residual's with the variance of the
    /// covariance (trimming has cut its tails).
    pub marginal: Heights,
    /// Height distribution, in place of `marginal`: heights in m at equally spaced probabilities from 0 to 1, ascending. Default: normal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub marginal_m: Option<Vec<f64>>,
}

impl Default for TileParameters {
    fn default() -> Self {
        Self {
            size_m: None,
            size_px: None,
            cell_m: Cell::Square(DEFAULT_CELL_M),
            tile: [1, 1],
            ratio: None,
            azimuth_deg: None,
            outer_m: None,
            marginal: Heights::Normal,
            marginal_m: None,
        }
    }
}

/// Checked parameters of a tile.
#[derive(Clone)]
pub struct Tile {
    parameters: TileParameters,
    /// One tile; its south-west corner is the origin.
    pub geometry: Geometry,
    /// Whether it repeats without seams.
    pub periodic: bool,
    note: Option<String>,
}

impl Tile {
    /// Checks raw parameters.
    ///
    /// # Errors
    /// A parameter out of range; repetition of a tile that is not periodic.
    pub fn check(parameters: TileParameters, periodic: bool) -> Result<Self, ParameterError> {
        let (geometry, note) = geometry(&parameters)?;
        let [down, across] = parameters.tile;
        if down == 0 || across == 0 {
            return Err(ParameterError::new(
                "tile",
                format!("is {down} x {across}; a tile stands at least once each way"),
            ));
        }
        if !periodic && [down, across] != [1, 1] {
            let message =
                format!("is {down} x {across}, but a texture with periodic = false has seams; make it larger instead");
            return Err(ParameterError::new("tile", message));
        }
        let cells = (geometry.len() as u64).saturating_mul(u64::from(down)).saturating_mul(u64::from(across));
        if cells > CELLS_MAX {
            return Err(ParameterError::new("tile", format!("gives {cells} cells in all; the most is {CELLS_MAX}")));
        }
        if let Some(ratio) = parameters.ratio.filter(|r| !(RATIO_MIN..=1.0).contains(r)) {
            return Err(ParameterError::new("ratio", format!("is {ratio}; it must lie in [{RATIO_MIN}, 1]")));
        }
        if let Some(azimuth) = parameters.azimuth_deg.filter(|a| !a.is_finite()) {
            return Err(ParameterError::new("azimuth_deg", format!("is {azimuth}; it must be finite")));
        }
        parameters.outer_m.map(|m| ParameterError::positive("outer_m", m)).transpose()?;
        let tile = Self { parameters, geometry, periodic, note };
        if tile.parameters.marginal_m.is_some() {
            tile.marginal(&[], f64::NAN)?;
        }
        Ok(tile)
    }

    /// The height distribution, unless normal; `measured_m` are the fit's quantiles.
    ///
    /// # Errors
    /// A table that is no distribution; a fit without heights.
    pub fn marginal(&self, measured_m: &[f64], variance_m2: f64) -> Result<Option<Marginal>, ParameterError> {
        match (&self.parameters.marginal_m, self.parameters.marginal) {
            (None, Heights::Normal) => Ok(None),
            (Some(_), Heights::Measured) => {
                Err(ParameterError::new("marginal", "is `measured` beside a table of heights; give one of them"))
            }
            (Some(table), _) => Marginal::new(table).map(Some),
            (None, Heights::Measured) if measured_m.is_empty() => {
                let message = "is `measured`, but the fit file has no `height_quantiles_m`; fit the DEM again";
                Err(ParameterError::new("marginal", message))
            }
            (None, Heights::Measured) => Marginal::of_shape(measured_m, variance_m2).map(Some),
        }
    }

    /// The ratio of ranges that is asked for in place of the fit's.
    pub fn stated_ratio(&self) -> Option<f64> {
        self.parameters.ratio
    }

    /// Whether an anisotropy other than the fit's is asked for.
    pub fn turns(&self) -> bool {
        self.parameters.ratio.is_some() || self.parameters.azimuth_deg.is_some()
    }

    /// All tiles together.
    pub fn whole(&self) -> Geometry {
        let [down, across] = self.parameters.tile.map(|n| n as usize);
        Geometry { rows: down * self.geometry.rows, cols: across * self.geometry.cols, ..self.geometry }
    }

    /// One tile laid as often as asked for.
    pub fn repeated(&self, tile: Grid) -> Grid {
        if self.parameters.tile == [1, 1] {
            return tile;
        }
        let whole = self.whole();
        let across = self.parameters.tile[1] as usize;
        let values = (0..whole.rows).flat_map(|r| tile.row(r % tile.rows()).repeat(across)).collect();
        Grid::new(whole, values)
    }

    /// The parameters with every default written out, and those of the method.
    pub fn parameters_with(&self, own: &impl Serialize) -> Value {
        let size_m = self.parameters.size_m.or(self.parameters.size_px.is_none().then_some(DEFAULT_SIZE_M));
        let of_tile = TileParameters { size_m, ..self.parameters.clone() };
        // Plain structs of numbers and words always have a JSON form.
        let parts = [serde_json::to_value(of_tile), serde_json::to_value(own)].map(Result::unwrap_or_default);
        let all = parts.iter().filter_map(Value::as_object).flatten();
        Value::Object(all.map(|(key, value)| (key.clone(), value.clone())).collect())
    }

    /// What it takes to lay a tile as often as asked for.
    pub fn repeated_cost(&self, tile: Cost) -> Cost {
        let whole = self.whole().len();
        let repeated = if whole > self.geometry.len() { 8 * whole as u64 } else { 0 };
        Cost { memory_bytes: tile.memory_bytes + repeated, ..tile }
    }

    /// What is asked for: the fit's covariance with this texture's anisotropy, and with a range where it has none. Adds the
    /// sentences a user should read.
    pub fn covariance(&self, fitted: Covariance, notes: &mut Vec<String>) -> Covariance {
        notes.extend(self.note.clone());
        let ratio = self.parameters.ratio.unwrap_or(fitted.ratio);
        let azimuth_deg = self.parameters.azimuth_deg.map_or(fitted.azimuth_deg, half_turn);
        let turned = Covariance { ratio, azimuth_deg, ..fitted };
        if self.parameters.azimuth_deg.is_some() && turned.is_isotropic() {
            notes.push("azimuth_deg changes nothing: the ratio of the ranges is 1".to_owned());
        }
        if turned.is_stationary() {
            return turned;
        }
        let outer_m = self.parameters.outer_m.unwrap_or_else(|| self.outer_m());
        let twin = turned.stationary(outer_m);
        notes.push(self_affine_note(&turned, &twin, outer_m, self.geometry.cell[0].min(self.geometry.cell[1])));
        twin
    }

    fn outer_m(&self) -> f64 {
        let [width_m, height_m] = self.geometry.size();
        let [periodic, other] = SELF_AFFINE_RANGES;
        width_m.min(height_m) / if self.periodic { periodic } else { other }
    }
}

/// What a self-affine surface loses by having a variance: increments at two distances.
fn self_affine_note(wanted: &Covariance, twin: &Covariance, outer_m: f64, cell_m: f64) -> String {
    let half_square = |c: &Covariance, d: f64| c.structures.iter().map(|s| increment(s, d)).sum::<f64>();
    let share = |d: f64| 100.0 * (half_square(twin, d) / half_square(wanted, d)).sqrt();
    format!(
        "a self-affine surface has no variance; it is made as a Matern one of range {outer_m} m, whose increments are {:.0} % \
         of the fit's over a cell of {cell_m} m and {:.0} % over {outer_m} m",
        share(cell_m),
        share(outer_m)
    )
}

/// `C(0) - C(d)` of one term.
fn increment(s: &crate::covariance::Structure, distance_m: f64) -> f64 {
    let at = |d: f64| s.model.correlation(d / s.range_m, s.shape);
    s.sigma_m * s.sigma_m * (at(0.0) - at(distance_m))
}

/// Cells of one tile, and the sentence about a size that was rounded down.
fn geometry(parameters: &TileParameters) -> Result<(Geometry, Option<String>), ParameterError> {
    let cell_m = parameters.cell_m.sides_m();
    for side in cell_m {
        ParameterError::positive("cell_m", side)?;
    }
    let (key, [cols, rows], cut_from_m) = match (parameters.size_m, parameters.size_px) {
        (Some(_), Some(_)) => {
            return Err(ParameterError::new("size_m", "stands beside `size_px`; give the size in metres or in cells"));
        }
        (None, Some(px)) => ("size_px", px.map(f64::from), None),
        (size_m, None) => {
            let size_m = size_m.unwrap_or(DEFAULT_SIZE_M);
            let cells = [0, 1].map(|k| size_m[k] / cell_m[k]);
            let is_whole = |n: f64| (n - n.round()).abs() <= INTEGER_TOLERANCE;
            let whole = cells.map(|n| if is_whole(n) { n.round() } else { n.floor() });
            ("size_m", whole, (!cells.into_iter().all(is_whole)).then_some(size_m))
        }
    };
    let cells = cols * rows;
    if !(cols >= 1.0 && rows >= 1.0 && cells <= CELLS_MAX as f64) {
        let message =
            format!("gives {cols} x {rows} cells; it must give at least one each way and at most {CELLS_MAX} in all");
        return Err(ParameterError::new(key, message));
    }
    let geometry = Geometry { rows: rows as usize, cols: cols as usize, cell: cell_m, origin: [0.0; 2] };
    let note = cut_from_m.map(|[x, y]| {
        let ([dx, dy], [width_m, height_m]) = (cell_m, geometry.size());
        format!(
            "size {x} m x {y} m is no whole number of cells of {dx} m x {dy} m; the texture is {width_m} m x {height_m} m"
        )
    });
    Ok((geometry, note))
}

/// Splits raw parameters into those of the tile and those of the method.
///
/// # Errors
/// An unknown key, with the known ones; a value of another type.
pub fn read<T: DeserializeOwned + JsonSchema>(raw: &Value) -> Result<(TileParameters, T), ParameterError> {
    let Value::Object(all) = raw else {
        return Err(ParameterError::new("", format!("{raw} is no table of parameters")));
    };
    let (of_tile, own) = (names(&schema_of::<TileParameters>()), names(&schema_of::<T>()));
    if let Some(key) = all.keys().find(|k| !of_tile.contains(k) && !own.contains(k)) {
        let known = [own, of_tile].concat().join(", ");
        return Err(ParameterError::new(key, format!("is no parameter of this method, which has {known}")));
    }
    let (tile, rest): (Map<_, _>, Map<_, _>) = all.clone().into_iter().partition(|(key, _)| of_tile.contains(key));
    Ok((read_parameters(&Value::Object(tile))?, read_parameters(&Value::Object(rest))?))
}

fn names(schema: &Value) -> Vec<String> {
    schema["properties"].as_object().into_iter().flat_map(|p| p.keys().cloned()).collect()
}

/// JSON Schema of a method's own parameters and the tile's, as one.
pub fn schema<T: JsonSchema>() -> Value {
    let (tile, mut own) = (schema_of::<TileParameters>(), schema_of::<T>());
    for part in ["properties", "$defs"] {
        let Some(of_tile) = tile[part].as_object() else { continue };
        match own[part].as_object_mut() {
            Some(map) => map.extend(of_tile.clone()),
            None => own[part] = Value::Object(of_tile.clone()),
        }
    }
    own
}
