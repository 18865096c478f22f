//! Conditional simulation: the holes of a measured surface filled with texture that fits what is around them.
//!
//! `z = z_u + K[z_m - z_u]`, z_m the measured heights, z_u an unconditional normal field with the fitted covariance, K their
//! kriging from cells around the hole. What is made has the covariance on average, also between filled and measured cells,
//! and measured cells keep their heights to the bit.
//!
//! K is kriging with a plane as drift, because the fitted covariance is that of the texture and the background beneath
//! it is not known: weights w with `sum of w_j C(h_ij) + drift = C(h_i0)`, `sum of w_j f(x_j) = f(x_0)` for `f = 1, x, y`. A
//! hole that is open to one side has the mean alone as drift: planes run away there. Cells with data in fewer than
//! nine directions lie outside of what was measured rather than in a hole of it, and stay without data. The cells that are used lie in
//! 16 directions from the one that is filled, the first three with data in each: those farther away are screened.
//!
//! Source: Journel and Huijbregts 1978, Mining Geostatistics, section VII.A; Chiles and Delfiner 2012, Geostatistics, sections
//! 3.4 and 7.3. A self-affine covariance is made as its stationary twin over the DEM's longer side, or over as much of it as a
//! torus of 2^24 cells has room for.
//!
//! Cost, for each filled cell: one system of at most 51 equations, and steps along the rays. Memory: a torus that is the DEM
//! and the reach of the covariance wide, 18 bytes a cell.

use super::fft_ma::{self, FftMaParameters, Phase};
use super::tile::{Cell, TileParameters};
use super::{Synthesis, reach};
use crate::covariance::Covariance;
use rayon::prelude::*;
use sastrugi_numeric::fft::smooth_length;
use sastrugi_numeric::{Grid, Streams};
use sastrugi_schemas::ParameterError;

/// Directions in which measured cells are looked for, cells south and east.
const RAYS: [[isize; 2]; 16] = [
    [0, 1],
    [1, 2],
    [1, 1],
    [2, 1],
    [1, 0],
    [2, -1],
    [1, -1],
    [1, -2],
    [0, -1],
    [-1, -2],
    [-1, -1],
    [-2, -1],
    [-1, 0],
    [-2, 1],
    [-1, 1],
    [-1, 2],
];
/// Measured cells used in each direction.
const PER_RAY: usize = 3;
/// Directions that must hold data for a plane as drift.
const SURROUNDED: usize = 13;
/// Directions that must hold data for a cell to be filled.
const ENCLOSED: usize = 9;
/// Most cells of the torus of a self-affine covariance's twin.
const TWIN_CELLS: f64 = (1u32 << 24) as f64;
/// Fewest cells of its range.
const OUTER_CELLS_MIN: f64 = 32.0;
/// Share of the variance that two cells are taken to differ by at least, so that smooth covariances can be solved.
const JITTER: f64 = 1e-9;

/// A filled surface.
#[derive(Clone, Debug)]
pub struct Filled {
    /// Heights, m.
    pub grid: Grid,
    /// Cells that were filled.
    pub cells: usize,
    /// Cells that stay without data: there is none around them.
    pub left: usize,
    /// Range of the stationary surface that stood in for a self-affine one, m.
    pub twin_range_m: Option<f64>,
}

impl std::fmt::Display for Filled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} cells without data were filled", self.cells)?;
        if self.left > 0 {
            write!(f, "; {} stay without: there is no data around them", self.left)?;
        }
        if let Some(range_m) = self.twin_range_m {
            write!(f, "; the self-affine fit was made as a Matern one of range {range_m} m")?;
        }
        Ok(())
    }
}

/// Why a surface cannot be filled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FillError {
    /// Nothing to go by.
    #[error("the DEM holds no data")]
    NoData,
    /// The unconditional field cannot be made.
    #[error("{0}")]
    Field(String),
}

impl From<ParameterError> for FillError {
    fn from(error: ParameterError) -> Self {
        Self::Field(error.to_string())
    }
}

/// The surface with the cells of its holes (NaN, data around) filled.
///
/// # Errors
/// A surface without data; one too large for an unconditional field.
pub fn fill(dem: &Grid, covariance: &Covariance, streams: &Streams) -> Result<Filled, FillError> {
    if dem.finite_count() == 0 {
        return Err(FillError::NoData);
    }
    let twin = stationary(dem, covariance);
    let twin_range_m = (!covariance.is_stationary()).then(|| twin.range_m());
    let covariance = twin;
    let unconditional = unconditional(dem, &covariance, streams)?;
    let holes: Vec<usize> = (0..dem.values.len()).filter(|k| !dem.values[*k].is_finite()).collect();
    let fill_one = |k: &usize| estimate(dem, &unconditional, &covariance, [k / dem.cols(), k % dem.cols()]);
    let filled: Vec<f64> = holes.par_iter().map(fill_one).collect();
    let mut grid = dem.clone();
    let left = filled.iter().filter(|z| z.is_nan()).count();
    holes.iter().zip(&filled).for_each(|(k, z)| grid.values[*k] = *z);
    Ok(Filled { grid, cells: holes.len() - left, left, twin_range_m })
}

/// The covariance, or its twin with the longest range whose torus is not too large.
fn stationary(dem: &Grid, covariance: &Covariance) -> Covariance {
    let [width_m, height_m] = dem.geometry.size();
    let [dx, dy] = dem.geometry.cell;
    // A DEM of its own size again each way is always room.
    let room = TWIN_CELLS.max(4.0 * dem.values.len() as f64);
    let has_room = |twin: &Covariance| {
        let [across, down] = torus_px(dem, twin);
        f64::from(across) * f64::from(down) <= room
    };
    let mut outer_m = width_m.max(height_m);
    let mut twin = covariance.stationary(outer_m);
    while !has_room(&twin) && outer_m > OUTER_CELLS_MIN * dx.max(dy) {
        outer_m *= 0.5;
        twin = covariance.stationary(outer_m);
    }
    twin
}

/// A normal field with the covariance on the cells of the DEM, from a torus so wide that its edges do not know each other.
fn unconditional(dem: &Grid, covariance: &Covariance, streams: &Streams) -> Result<Grid, FillError> {
    let g = dem.geometry;
    let parameters = TileParameters {
        size_px: Some(torus_px(dem, covariance)),
        cell_m: Cell::Oblong(g.cell),
        ..TileParameters::default()
    };
    let own = FftMaParameters { phase: Phase::Gaussian, ..FftMaParameters::default() };
    let texture = fft_ma::texture(parameters, &own, covariance.clone())?;
    let made = texture.generate(streams).map_err(|e| FillError::Field(e.to_string()))?;
    Ok(Grid { geometry: g, ..made.grid.window(0, 0, g.rows, g.cols) })
}

/// Columns and rows of a torus whose edges do not know each other across the DEM.
fn torus_px(dem: &Grid, covariance: &Covariance) -> [u32; 2] {
    let (g, torus_m) = (dem.geometry, reach::torus_m(covariance));
    [(g.cols, 0), (g.rows, 1)].map(|(n, axis)| {
        let torus = torus_m[axis] / g.cell[axis];
        smooth_length((torus.ceil() as usize).max(n + (0.5 * torus).ceil() as usize)) as u32
    })
}

/// Measured cells around a hole's cell, and in how many directions there are any.
fn neighbours(dem: &Grid, [row, col]: [usize; 2]) -> (Vec<[usize; 2]>, usize) {
    let mut cells: Vec<[usize; 2]> = Vec::with_capacity(RAYS.len() * PER_RAY);
    let mut hit = 0;
    for [south, east] in RAYS {
        let at = |step: isize| {
            let (r, c) = (row as isize + step * south, col as isize + step * east);
            let inside = r >= 0 && c >= 0 && (r as usize) < dem.rows() && (c as usize) < dem.cols();
            inside.then_some([r as usize, c as usize])
        };
        let found = (1..).map_while(at).filter(|[r, c]| dem.at(*r, *c).is_finite()).take(PER_RAY);
        let before = cells.len();
        cells.extend(found);
        hit += usize::from(cells.len() > before);
    }
    (cells, hit)
}

/// Height of one cell of a hole; NaN outside of what was measured.
fn estimate(dem: &Grid, unconditional: &Grid, covariance: &Covariance, at: [usize; 2]) -> f64 {
    let (cells, hit) = neighbours(dem, at);
    let [dx, dy] = dem.geometry.cell;
    let here = unconditional.at(at[0], at[1]);
    if hit < ENCLOSED {
        return f64::NAN;
    }
    let n = cells.len();
    let drift = if hit >= SURROUNDED && n >= 8 { 3 } else { 1 };
    let lag = |a: [usize; 2], b: [usize; 2]| [(b[1] as f64 - a[1] as f64) * dx, (a[0] as f64 - b[0] as f64) * dy];
    // Places in units of the farthest neighbour, so that the drift's numbers are like the covariances'.
    let far = cells.iter().map(|c| lag(at, *c)).fold(0.0, |m: f64, [x, y]| m.max(x.abs()).max(y.abs()));
    let variance_m2 = covariance.at_distance(0.0);
    let size = n + drift;
    let mut matrix = vec![0.0; size * (size + 1)];
    let width = size + 1;
    for (i, a) in cells.iter().enumerate() {
        for (j, b) in cells.iter().enumerate().skip(i) {
            let value = covariance.at(lag(*a, *b)) / variance_m2 + if i == j { JITTER } else { 0.0 };
            matrix[i * width + j] = value;
            matrix[j * width + i] = value;
        }
        let [x, y] = lag(at, *a).map(|d| d / far);
        for (k, f) in [1.0, x, y].into_iter().take(drift).enumerate() {
            matrix[i * width + n + k] = f;
            matrix[(n + k) * width + i] = f;
        }
        matrix[i * width + size] = covariance.at(lag(at, *a)) / variance_m2;
    }
    // The drift's functions at the cell itself: 1, 0, 0.
    matrix[n * width + size] = 1.0;
    let weights = solve(&mut matrix, size);
    let difference = |[r, c]: &[usize; 2]| dem.at(*r, *c) - unconditional.at(*r, *c);
    here + cells.iter().zip(&weights).map(|(cell, w)| w * difference(cell)).sum::<f64>()
}

/// Solves a system with its right side as the last column, by elimination with row pivoting.
fn solve(matrix: &mut [f64], size: usize) -> Vec<f64> {
    let width = size + 1;
    for k in 0..size {
        let pivot =
            (k..size).fold(
                k,
                |best, row| {
                    if matrix[row * width + k].abs() > matrix[best * width + k].abs() { row } else { best }
                },
            );
        if pivot != k {
            (k..width).for_each(|c| matrix.swap(k * width + c, pivot * width + c));
        }
        let (above, below) = matrix.split_at_mut((k + 1) * width);
        let lead = &above[k * width..];
        for line in below.chunks_exact_mut(width) {
            let factor = line[k] / lead[k];
            if factor != 0.0 {
                (k..width).for_each(|c| line[c] -= factor * lead[c]);
            }
        }
    }
    let mut x = vec![0.0; size];
    for k in (0..size).rev() {
        let known: f64 = (k + 1..size).map(|c| matrix[k * width + c] * x[c]).sum();
        x[k] = (matrix[k * width + size] - known) / matrix[k * width + k];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::model;
    use sastrugi_numeric::{Geometry, sums};

    fn exponential() -> Covariance {
        Covariance::new(model("exponential").unwrap(), 0.1, 0.5).unwrap()
    }

    fn surface(seed: u64) -> Grid {
        let blank = Grid::filled(Geometry::square(40, 40, 0.1), 0.0);
        unconditional(&blank, &exponential(), &Streams::for_seed(seed, "truth")).unwrap()
    }

    fn with_hole(surface: &Grid) -> Grid {
        let mut holed = surface.clone();
        (14..24).flat_map(|r| (12..26).map(move |c| r * 40 + c)).for_each(|k| holed.values[k] = f64::NAN);
        holed
    }

    /// Measured cells keep their bits, every hole is filled, a tilt of the whole passes through: the plane is the drift.
    #[test]
    fn val_measured_cells_stay_and_planes_pass() {
        let truth = surface(1);
        let fill = |dem: &Grid| fill(dem, &exponential(), &Streams::for_seed(2, "texture")).unwrap();
        let filled = fill(&with_hole(&truth));
        assert_eq!(filled.cells, 140);
        let holed = with_hole(&truth);
        let same = |(a, b): (&f64, &f64)| b.is_nan() || a.to_bits() == b.to_bits();
        assert!(filled.grid.values.iter().zip(&holed.values).all(same));
        assert_eq!(filled.grid.finite_count(), 1600);
        let plane = |k: usize| 5.0 + 0.3 * (k % 40) as f64 - 0.2 * (k / 40) as f64;
        let tilted = Grid::new(truth.geometry, truth.values.iter().enumerate().map(|(k, z)| z + plane(k)).collect());
        let tilted = fill(&with_hole(&tilted)).grid;
        let off = (0..1600).map(|k| (tilted.values[k] - plane(k) - filled.grid.values[k]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-6, "{off}");
    }

    /// A self-affine surface of a size whose own twin would need a torus of 30 sides.
    #[test]
    fn val_self_affine_surfaces_are_filled() {
        let parameters = [("increment_1m_m".to_owned(), 0.1), ("hurst".to_owned(), 0.6)].into();
        let covariance = crate::covariance::Form::parse("self_affine").unwrap().covariance(&parameters).unwrap();
        let geometry = Geometry::square(300, 300, 0.1);
        let twin = stationary(&Grid::filled(geometry, 0.0), &covariance);
        assert!(twin.is_stationary() && twin.range_m() < 30.0 && twin.range_m() >= 1.6, "{}", twin.range_m());
        let mut holed = unconditional(&Grid::filled(geometry, 0.0), &twin, &Streams::for_seed(1, "truth")).unwrap();
        (100..110).flat_map(|r| (90..104).map(move |c| r * 300 + c)).for_each(|k| holed.values[k] = f64::NAN);
        assert_eq!(fill(&holed, &covariance, &Streams::for_seed(2, "texture")).unwrap().cells, 140);
    }

    /// Steps of one cell, inside the hole and across its edge, have the covariance's mean square `2 (C(0) - C(1))`. Null:
    /// they do; 40 surfaces, some 28 independent steps of each: standard error of a mean square `sqrt(2 / 1100)` = 4 %;
    /// threshold 25 % (6 standard errors, below 1e-8). Kriging alone, which smooths, falls far below.
    #[test]
    fn stat_filled_cells_are_as_rough_as_measured_ones() {
        let covariance = exponential();
        let exact = 2.0 * (covariance.at_distance(0.0) - covariance.at_distance(0.1));
        let (mut inside, mut across) = (Vec::new(), Vec::new());
        for seed in 0..40 {
            let dem = with_hole(&surface(100 + seed));
            let grid = fill(&dem, &covariance, &Streams::for_seed(seed, "texture")).unwrap().grid;
            for c in 12..26 {
                let square = |a: f64, b: f64| (a - b) * (a - b);
                across.push(square(grid.at(13, c), grid.at(14, c)));
                across.push(square(grid.at(23, c), grid.at(24, c)));
                inside.push(square(grid.at(17, c), grid.at(18, c)));
                inside.push(square(grid.at(20, c), grid.at(21, c)));
            }
        }
        let (inside, across) = (sums::mean(&inside) / exact, sums::mean(&across) / exact);
        assert!((inside - 1.0).abs() < 0.25 && (across - 1.0).abs() < 0.25, "{inside} {across}");
    }

    #[test]
    fn val_open_holes_and_empty_surfaces() {
        let mut dem = surface(3);
        // A bay that is open to the west has data in nine directions near its east end; what lies south does not count.
        (10..14).flat_map(|r| (0..20).map(move |c| r * 40 + c)).for_each(|k| dem.values[k] = f64::NAN);
        (30..40).flat_map(|r| (0..40).map(move |c| r * 40 + c)).for_each(|k| dem.values[k] = f64::NAN);
        let streams = Streams::for_seed(1, "texture");
        let filled = fill(&dem, &exponential(), &streams).unwrap();
        assert!(filled.grid.at(12, 18).is_finite() && filled.grid.at(38, 20).is_nan());
        assert_eq!((filled.cells + filled.left, filled.grid.finite_count()), (480, 1120 + filled.cells));
        let empty = Grid::filled(dem.geometry, f64::NAN);
        assert_eq!(fill(&empty, &exponential(), &streams).unwrap_err(), FillError::NoData);
    }
}
