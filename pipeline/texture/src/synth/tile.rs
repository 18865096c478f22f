//! Parameters common to all methods: size, cells, tiling, anisotropy and height distribution.

use super::Cost;
use super::marginal::Marginal;
use crate::covariance::Covariance;
use crate::covariance::form::half_turn;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Vecherin et al. 2022, Figure 5.
pub const DEFAULT_SIZE_M: [f64; 2] = [20.0; 2];
/// Vecherin et al. 2022, section 3.2.
pub const DEFAULT_CELL_M: f64 = 0.1;
/// Most cells of a texture: 2 GiB of heights, the limit for rasters that are read back.
pub const CELLS_MAX: u64 = 1 << 28;
/// A quotient this close to an integer counts as that integer.
const INTEGER_TOLERANCE: f64 = 1e-6;
/// Smallest ratio of anisotropy, as in fit files.
const RATIO_MIN: f64 = 0.02;
/// Width in ranges that a periodic tile needs for a Matern covariance, and a non-periodic one.
const SELF_AFFINE_RANGES: [f64; 2] = [16.0, 4.0];

/// Meaning of `cell_m` for a method that repeats a site.
const CELL_OF_SITE: &str = "Cell size of the site (the DEM of the fit), m: one number, or east-west and north-south. These methods work on no other \
    cells. Default: that cell size.";

/// Keys of a tile that only textures from a covariance have, and what a method that repeats a site keeps instead.
pub(super) const OF_COVARIANCE: [(&str, &str); 5] = [
    ("ratio", "directions"),
    ("azimuth_deg", "directions"),
    ("outer_m", "waves"),
    ("marginal", "heights"),
    ("marginal_m", "heights"),
];

/// Size of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be a number, or two numbers: east-west and north-south, m")]
#[schemars(transform = limits::positive)]
pub enum Cell {
    /// The same in both directions, m.
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
    /// The shape of the fitted residual's distribution.
    Measured,
}

/// Raw parameters common to all methods.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TileParameters {
    /// Size of one tile, east-west and north-south, m; instead of `size_px`. Default 20 x 20 (Vecherin et al. 2022,
    /// Figure 5). With `onto`, the result has the size of the base.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Size of one tile in cells, columns and rows; instead of `size_m`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 1)))]
    pub size_px: Option<[u32; 2]>,
    /// Cell size, m: one number, or east-west and north-south; with `onto`, that of the base. Default 0.1 (Vecherin et al. 2022, section 3.2).
    pub cell_m: Cell,
    /// How many times a periodic tile is repeated, as rows and columns of tiles. Default 1 x 1.
    #[schemars(inner(range(min = 1)))]
    pub tile: [u32; 2],
    /// Range across the long axis over range along it, in [0.02, 1]; replaces the fit's.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::within(RATIO_MIN, 1.0))]
    pub ratio: Option<f64>,
    /// Direction of the long axis, degrees clockwise from north; replaces the fit's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_deg: Option<f64>,
    /// Range of the stationary covariance that replaces a self-affine fit, m. Default: 1/16 of the shorter side of a periodic tile, 1/4 of
    /// that of a non-periodic one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub outer_m: Option<f64>,
    /// Height distribution: `normal` (default), or `measured`, the shape of the fitted residual's distribution, scaled to the variance of the
    /// covariance (trimming has cut its tails).
    pub marginal: Heights,
    /// Height distribution, instead of `marginal`: heights in m at equally spaced probabilities from 0 to 1, ascending. Default: normal.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 2))]
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
            return Err(ParameterError::new("tile", format!("is {down} x {across}; it must be at least 1 x 1")));
        }
        if !periodic && [down, across] != [1, 1] {
            let message = format!(
                "is {down} x {across}, but a texture with periodic = false has seams; increase its size instead"
            );
            return Err(ParameterError::new("tile", message));
        }
        let cells = (geometry.len() as u64).saturating_mul(u64::from(down)).saturating_mul(u64::from(across));
        if cells > CELLS_MAX {
            return Err(ParameterError::new("tile", format!("gives {cells} cells in total; the limit is {CELLS_MAX}")));
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
            tile.marginal(&[], || f64::NAN)?;
        }
        Ok(tile)
    }

    /// The height distribution, unless normal; `measured_m` are the fit's quantiles. The variance is asked for only where it counts.
    ///
    /// # Errors
    /// A table that is not a distribution; a fit without heights.
    pub fn marginal(
        &self,
        measured_m: &[f64],
        variance_m2: impl FnOnce() -> f64,
    ) -> Result<Option<Marginal>, ParameterError> {
        match (&self.parameters.marginal_m, self.parameters.marginal) {
            (None, Heights::Normal) => Ok(None),
            (Some(_), Heights::Measured) => Err(ParameterError::new(
                "marginal",
                "is `measured`, but `marginal_m` is given as well; give one of them",
            )),
            (Some(table), _) => Marginal::new(table).map(Some),
            (None, Heights::Measured) if measured_m.is_empty() => {
                let message = "is `measured`, but the fit file has no `height_quantiles_m`; fit the DEM again";
                Err(ParameterError::new("marginal", message))
            }
            (None, Heights::Measured) => Marginal::of_shape(measured_m, variance_m2()).map(Some),
        }
    }

    /// The ratio of ranges that replaces the fit's, if given.
    pub fn stated_ratio(&self) -> Option<f64> {
        self.parameters.ratio
    }

    /// Whether an anisotropy is given that replaces the fit's.
    pub fn turns(&self) -> bool {
        self.parameters.ratio.is_some() || self.parameters.azimuth_deg.is_some()
    }

    /// Shape and cells of all tiles together.
    pub fn whole(&self) -> Geometry {
        let [down, across] = self.parameters.tile.map(|n| n as usize);
        Geometry { rows: down * self.geometry.rows, cols: across * self.geometry.cols, ..self.geometry }
    }

    /// The tile, repeated as the parameters state.
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
        // Plain structs of numbers and strings always serialise.
        let parts = [serde_json::to_value(of_tile), serde_json::to_value(own)].map(Result::unwrap_or_default);
        let all = parts.iter().filter_map(Value::as_object).flatten();
        Value::Object(all.map(|(key, value)| (key.clone(), value.clone())).collect())
    }

    /// The same for a method that repeats a site, without the keys of [`OF_COVARIANCE`].
    pub(super) fn parameters_of_site(&self, own: &impl Serialize) -> Value {
        let mut all = self.parameters_with(own);
        if let Value::Object(map) = &mut all {
            map.retain(|key, _| !is_of_covariance(key));
        }
        all
    }

    /// The same tile with other numbers of rows and columns.
    pub(super) fn of_shape(&self, [rows, cols]: [usize; 2]) -> Self {
        Self { geometry: Geometry { rows, cols, ..self.geometry }, ..self.clone() }
    }

    /// A note if the size was rounded down.
    pub(super) fn note(&self) -> Option<String> {
        self.note.clone()
    }

    /// Cost of a tile including its repetition.
    pub fn repeated_cost(&self, tile: Cost) -> Cost {
        let whole = self.whole().len();
        let repeated = if whole > self.geometry.len() { 8 * whole as u64 } else { 0 };
        Cost { memory_bytes: tile.memory_bytes + repeated, ..tile }
    }

    /// The target: the fit's covariance with this texture's anisotropy, and with a range if it has none. Adds notes for the user.
    pub fn covariance(&self, fitted: Covariance, notes: &mut Vec<String>) -> Covariance {
        notes.extend(self.note.clone());
        let ratio = self.parameters.ratio.unwrap_or(fitted.ratio);
        let azimuth_deg = self.parameters.azimuth_deg.map_or(fitted.azimuth_deg, half_turn);
        let turned = Covariance { ratio, azimuth_deg, ..fitted };
        if self.parameters.azimuth_deg.is_some() && turned.is_isotropic() {
            notes.push("azimuth_deg has no effect: the ratio of the ranges is 1".to_owned());
        }
        if turned.is_stationary() {
            return turned;
        }
        let outer_m = self.parameters.outer_m.unwrap_or_else(|| self.outer_m());
        let stationary = turned.stationary(outer_m);
        notes.push(self_affine_note(&turned, &stationary, outer_m, self.geometry.cell[0].min(self.geometry.cell[1])));
        stationary
    }

    fn outer_m(&self) -> f64 {
        let [width_m, height_m] = self.geometry.size();
        let [periodic, other] = SELF_AFFINE_RANGES;
        width_m.min(height_m) / if self.periodic { periodic } else { other }
    }
}

/// Notes what a self-affine surface loses by being made stationary: increments at two distances.
fn self_affine_note(wanted: &Covariance, stationary: &Covariance, outer_m: f64, cell_m: f64) -> String {
    let half_square = |c: &Covariance, d: f64| c.structures.iter().map(|s| increment(s, d)).sum::<f64>();
    let share = |d: f64| 100.0 * (half_square(stationary, d) / half_square(wanted, d)).sqrt();
    format!(
        "a self-affine surface has no variance; it was replaced by a Matern one of range {outer_m} m, whose increments are {:.0} % \
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

/// Cells of one tile, and a note if the size was rounded down.
fn geometry(parameters: &TileParameters) -> Result<(Geometry, Option<String>), ParameterError> {
    let cell_m = parameters.cell_m.sides_m();
    for side in cell_m {
        ParameterError::positive("cell_m", side)?;
    }
    let (key, [cols, rows], cut_from_m) = match (parameters.size_m, parameters.size_px) {
        (Some(_), Some(_)) => {
            return Err(ParameterError::new(
                "size_m",
                "is given together with `size_px`; give the size either in metres or in cells",
            ));
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
            format!("gives {cols} x {rows} cells; there must be at least 1 x 1 and at most {CELLS_MAX} in total");
        return Err(ParameterError::new(key, message));
    }
    let geometry = Geometry { rows: rows as usize, cols: cols as usize, cell: cell_m, origin: [0.0; 2] };
    let note = cut_from_m.map(|[x, y]| {
        let ([dx, dy], [width_m, height_m]) = (cell_m, geometry.size());
        format!(
            "size {x} m x {y} m is not a whole number of cells of {dx} m x {dy} m; the texture is {width_m} m x {height_m} m"
        )
    });
    Ok((geometry, note))
}

/// Splits raw parameters into those of the tile and those of the method.
///
/// # Errors
/// An unknown key (the message lists the known ones); a value of the wrong type.
pub fn read<T: DeserializeOwned + JsonSchema>(raw: &Value) -> Result<(TileParameters, T), ParameterError> {
    let Value::Object(all) = raw else {
        return Err(ParameterError::new("", format!("{raw} is not a table of parameters")));
    };
    let (of_tile, own) = (names(&schema_of::<TileParameters>()), names(&schema_of::<T>()));
    if let Some(key) = all.keys().find(|k| !of_tile.contains(k) && !own.contains(k)) {
        let known = [own, of_tile].concat().join(", ");
        return Err(ParameterError::new(key, format!("is not a parameter of this method, which has {known}")));
    }
    let (tile, rest): (Map<_, _>, Map<_, _>) = all.clone().into_iter().partition(|(key, _)| of_tile.contains(key));
    Ok((read_parameters(&Value::Object(tile))?, read_parameters(&Value::Object(rest))?))
}

fn names(schema: &Value) -> Vec<String> {
    schema["properties"].as_object().into_iter().flat_map(|p| p.keys().cloned()).collect()
}

/// JSON Schema of a method's own parameters merged with the tile's.
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

/// The same for a method that repeats a site, without the keys of [`OF_COVARIANCE`].
pub(super) fn schema_of_site<T: JsonSchema>() -> Value {
    let mut all = schema::<T>();
    if let Some(properties) = all["properties"].as_object_mut() {
        properties.retain(|key, _| !is_of_covariance(key));
    }
    if let Some(cell) = all.pointer_mut("/properties/cell_m").and_then(Value::as_object_mut) {
        cell.remove("default");
        cell.insert("description".to_owned(), CELL_OF_SITE.into());
    }
    // The type of `marginal`.
    if let Some(types) = all["$defs"].as_object_mut() {
        types.retain(|name, _| name != "Heights");
    }
    all
}

fn is_of_covariance(key: &str) -> bool {
    OF_COVARIANCE.iter().any(|(of_covariance, _)| *of_covariance == key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::{Form, model};

    fn base() -> TileParameters {
        TileParameters::default()
    }

    fn self_affine() -> Covariance {
        let values = [("increment_1m_m", 0.1), ("hurst", 0.7)].map(|(k, v)| (k.to_owned(), v));
        Form::parse("self_affine").unwrap().covariance(&values.into()).unwrap()
    }

    /// Quotients that are whole but for rounding count as whole: 0.3 / 0.1 is 2.9999999999999996. Columns come first, rows second.
    #[test]
    fn val_cells_of_a_tile() {
        let geometry = |p: TileParameters| Tile::check(p, true).unwrap().geometry;
        assert_eq!(geometry(TileParameters { size_m: Some([0.3, 0.7]), ..base() }), Geometry::square(7, 3, 0.1));
        let oblong = geometry(TileParameters { size_px: Some([5, 4]), cell_m: Cell::Oblong([0.5, 0.25]), ..base() });
        assert_eq!(oblong, Geometry { rows: 4, cols: 5, cell: [0.5, 0.25], origin: [0.0; 2] });
        // The paper's tile.
        assert_eq!(geometry(base()), Geometry::square(200, 200, 0.1));
        let many = Tile::check(TileParameters { size_px: Some([5, 4]), tile: [2, 3], ..base() }, true).unwrap();
        assert_eq!(many.whole(), Geometry::square(8, 15, 0.1));
        let one = Cost { memory_bytes: 1000, operations: 7.0 };
        assert_eq!(many.repeated_cost(one), Cost { memory_bytes: 1000 + 8 * 120, operations: 7.0 });
    }

    /// A self-affine fit gets a range of 1/16 of the shorter side of a periodic tile, 1/4 of that of another, or the stated one.
    #[test]
    fn val_ranges_of_self_affine_textures() {
        let range_m = |outer_m: Option<f64>, periodic: bool| {
            let tile = Tile::check(TileParameters { size_m: Some([20.0, 10.0]), outer_m, ..base() }, periodic).unwrap();
            let mut notes = Vec::new();
            let covariance = tile.covariance(self_affine(), &mut notes);
            assert!(covariance.is_stationary() && notes.len() == 1 && notes[0].contains("no variance"), "{notes:?}");
            covariance.range_m()
        };
        assert_eq!((range_m(None, true), range_m(None, false), range_m(Some(3.0), true)), (0.625, 2.5, 3.0));
    }

    /// Ratio and azimuth of the texture replace the fit's, the azimuth reduced to half a turn; without a ratio an azimuth has no effect on an
    /// isotropic fit, and that is noted.
    #[test]
    fn val_anisotropy_of_a_texture() {
        let exponential = Covariance::new(model("exponential").unwrap(), 1.0, 0.5).unwrap();
        let of = |ratio: Option<f64>, azimuth_deg: Option<f64>, fitted: &Covariance| {
            let tile = Tile::check(TileParameters { ratio, azimuth_deg, ..base() }, true).unwrap();
            let mut notes = Vec::new();
            let found = tile.covariance(fitted.clone(), &mut notes);
            (found.ratio, found.azimuth_deg, notes.len(), tile.turns())
        };
        assert_eq!(of(None, None, &exponential), (1.0, 0.0, 0, false));
        assert_eq!(of(Some(0.5), Some(200.0), &exponential), (0.5, 20.0, 0, true));
        assert_eq!(of(None, Some(30.0), &exponential), (1.0, 30.0, 1, true));
        let long = Covariance { ratio: 0.25, azimuth_deg: 70.0, ..exponential };
        assert_eq!(of(None, None, &long), (0.25, 70.0, 0, false));
        assert_eq!(of(Some(0.75), None, &long), (0.75, 70.0, 0, true));
    }

    /// Each bad value is refused with its own key.
    #[test]
    fn val_refusals() {
        let key = |p: TileParameters, periodic: bool| Tile::check(p, periodic).err().map(|e| e.key);
        let table = || Some(vec![-1.0, 0.0, 1.0]);
        for (expected, parameters) in [
            ("tile", TileParameters { tile: [0, 1], ..base() }),
            ("tile", TileParameters { tile: [1, 0], ..base() }),
            ("tile", TileParameters { tile: [1000, 1000], ..base() }),
            ("ratio", TileParameters { ratio: Some(0.01), ..base() }),
            ("ratio", TileParameters { ratio: Some(f64::NAN), ..base() }),
            ("azimuth_deg", TileParameters { azimuth_deg: Some(f64::INFINITY), ..base() }),
            ("outer_m", TileParameters { outer_m: Some(0.0), ..base() }),
            ("cell_m", TileParameters { cell_m: Cell::Oblong([0.1, 0.0]), ..base() }),
            ("size_px", TileParameters { size_px: Some([0, 5]), ..base() }),
            ("size_m", TileParameters { size_px: Some([5, 5]), size_m: Some([1.0; 2]), ..base() }),
            ("marginal_m", TileParameters { marginal_m: Some(vec![1.0]), ..base() }),
            ("marginal", TileParameters { marginal_m: table(), marginal: Heights::Measured, ..base() }),
        ] {
            assert_eq!(key(parameters, true).as_deref(), Some(expected));
        }
        assert_eq!(key(TileParameters { marginal_m: table(), ratio: Some(1.0), ..base() }, true), None);
        // Only periodic tiles can be repeated.
        assert_eq!(key(TileParameters { tile: [1, 2], ..base() }, false).as_deref(), Some("tile"));
        assert_eq!(key(TileParameters { tile: [1, 2], ..base() }, true), None);
    }
}
