//! Co-registration of one DEM to another, and their difference (snow depth: snow-on minus snow-off).
//!
//! # Model
//! B is shifted horizontally by (e, n), raised by w and tilted by (p, q) to minimise `A(x, y) - B(x - e, y - n) - w - p x - q y`,
//! x and y from the centre of A. A stays in place, and the difference is computed on its cells, with B interpolated bilinearly.
//!
//! # Method
//! Nuth and Kääb (2011), Eq. 2: if B is displaced by (u, v), `dh / tan s = -u sin a - v cos a + w / tan s`, s slope and a
//! aspect of the terrain: a cosine of the aspect. The horizontal shift is the amplitude and phase of that cosine; B is shifted and
//! the fit repeated until convergence.
//!
//! Departures: Nuth and Kääb fit medians of `dh / tan s` by aspect and leave out slopes below 5 degrees, where the quotient
//! is noise. The noise is in the heights, so that the quotient's weight is `tan^2 s`; with this weight the cosine becomes
//! `dh = u dz/dx + v dz/dy + w`, no slope is left out, and raise and tilt (`+ p x + q y`), which could otherwise be mistaken for
//! the slope of a hillside, are found by the same equations. Outliers (trees, cars, avalanches) are down-weighted by Tukey's
//! biweight at 4.685 NMAD (Holland and Welsch, 1977) on `dh`. Cells are also left out where the slopes of A and B disagree, since a
//! tree on either falsifies the slopes of neighbouring cells whose own heights are right. Slopes are A's, by central differences; their
//! noise does not bias the shift, because that of a symmetric difference is uncorrelated with the height at its centre.
//!
//! # Uncertainty
//! Standard errors are those of a delete-one-block jackknife (`uncertainty.rs`): residuals of neighbouring cells are correlated, and
//! standard errors that assumed independence would be far too small. [`gained`](Coregistration::gained) states whether the shift is
//! larger than they explain. For a shift of one cell or more NMAD must decrease as well, which it would not if the shift were wrong by
//! more than the range of the relief. Below one cell NMAD proves nothing: interpolating B between its cells averages its noise, so that
//! NMAD decreases for no good reason if B should be read at its cells, and increases at the right shift if B lay between them.
//!
//! The fit starts from the position of B as given and finds shifts up to about the range of the terrain's relief; `nmad_after_m` shows
//! whether it did. On ground without slopes in two directions B is only raised and tilted. Without stable terrain `raise_m` and
//! `tilt` absorb the mean depth and its trend: the difference keeps the texture of the snow, not its mean depth.
//!
//! # Cost
//! Some 100 operations per cell and round, usually under 10 rounds; 80 bytes per cell of A.

mod equations;
mod rounds;
mod uncertainty;

use crate::sizes::NORMAL_CONSISTENCY;
use rounds::{Overlay, Terms};
use sastrugi_numeric::{Grid, sums};
use sastrugi_schemas::coregistration::{Coregistration, StandardErrors};
use sastrugi_schemas::counted;
use uncertainty::Uncertainty;

/// Fewest common cells.
const CELLS_MIN: usize = 100;
/// Most rounds.
const ROUNDS: u32 = 50;
/// Converged when a round moves B by less than this share of a cell.
const CONVERGED_CELLS: f64 = 0.005;
/// Largest p-value of a significant shift.
pub const SIGNIFICANCE: f64 = 0.05;

/// A difference of DEMs.
#[derive(Clone, Debug)]
pub struct Coregistered {
    /// A minus B as moved, on A's grid, m; NaN where either has no data.
    pub difference: Grid,
    /// How B was moved.
    pub coregistration: Coregistration,
}

/// Why two DEMs cannot be co-registered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CoregisterError {
    /// They do not overlap.
    #[error(
        "the DEMs do not overlap: the first covers {a:?}, the second {b:?} (x0, y0, x1, y1); both must use the same coordinate system"
    )]
    Apart {
        /// Rectangle of the first, m.
        a: [f64; 4],
        /// Rectangle of the second, m.
        b: [f64; 4],
    },
    /// Too few common cells.
    #[error(
        "the DEMs have only {} with data in common; co-registration needs at least {CELLS_MIN}",
        counted(.cells, "cell")
    )]
    TooFewCells {
        /// Common cells.
        cells: usize,
    },
    /// Data is too sparse for slopes, or lies on one line.
    #[error("no plane can be fitted to the difference: too few common cells have data on all four sides")]
    Scattered,
}

/// Co-registers B to A and computes the difference. Both must be in metres and in the same coordinate system; cells, origins and
/// extents may differ.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_texture::coregister::coregister;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // Smooth ground with slopes in all directions, and the same ground 0.4 m too far east, 0.2 m too far south and 5 m too high.
/// let ground = |x: f64, y: f64| 2.0 * (0.3 * x).sin() + 1.5 * (0.25 * y + 0.1 * x).cos();
/// let g = Geometry::square(60, 60, 1.0);
/// let grid = |height: &dyn Fn(f64, f64) -> f64| {
///     Grid::new(g, (0..g.len()).map(|k| height(g.x(k % 60), g.y(k / 60))).collect())
/// };
/// let a = grid(&ground);
/// let b = grid(&|x, y| ground(x - 0.4, y + 0.2) + 5.0);
/// let found = coregister(&a, &b)?.coregistration;
/// let shift = found.shift_m.unwrap();
/// assert!((shift[0] + 0.4).abs() < 0.05 && (shift[1] - 0.2).abs() < 0.05);
/// assert!((found.raise_m + 5.0).abs() < 0.05);
/// assert!(found.converged && found.nmad_after_m < found.nmad_before_m);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// See [`CoregisterError`].
pub fn coregister(a: &Grid, b: &Grid) -> Result<Coregistered, CoregisterError> {
    let overlay = Overlay::new(a, b);
    let before = sums::finite(&overlay.difference(&Terms::default()));
    if before.len() < CELLS_MIN {
        return Err(too_few(a, b, before.len()));
    }
    let (median_before_m, nmad_before_m) = centre_and_spread(&before);
    let plane =
        overlay.levelled(Terms { raise: median_before_m, ..Terms::default() }).ok_or(CoregisterError::Scattered)?;
    let (median_plane_m, nmad_plane_m) = centre_and_spread(&sums::finite(&overlay.difference(&plane)));
    let resolution_m = CONVERGED_CELLS * overlay.cell_m();
    let shifted = shifted(&overlay, plane, resolution_m);
    let Search { terms, iterations, converged } =
        shifted.unwrap_or(Search { terms: plane, iterations: 0, converged: true });
    let difference = overlay.difference(&terms);
    let after = sums::finite(&difference);
    if after.len() < CELLS_MIN {
        return Err(CoregisterError::TooFewCells { cells: after.len() });
    }
    let (median_after_m, nmad_after_m) = centre_and_spread(&after);
    let uncertainty = if converged { overlay.uncertainty(&terms, shifted.is_some(), resolution_m) } else { None };
    let shift_m = shifted.map(|_| terms.offset.map(|o| -o));
    let shift_p = uncertainty.as_ref().zip(shift_m).and_then(|(u, shift)| u.probability_beyond(shift));
    let near = shift_m.is_some_and(|[east, north]| (east * east + north * north).sqrt() < overlay.cell_m());
    let gained = |p: f64| p < SIGNIFICANCE && (near || nmad_after_m < nmad_plane_m);
    let coregistration = Coregistration {
        shift_m,
        raise_m: terms.raise,
        tilt: terms.tilt,
        standard_errors: uncertainty.map(Uncertainty::standard_errors),
        shift_p,
        gained: shift_p.map(gained),
        median_before_m,
        median_plane_m: Some(median_plane_m),
        median_after_m: Some(median_after_m),
        nmad_before_m,
        nmad_plane_m,
        nmad_after_m,
        cells: after.len() as u64,
        iterations,
        converged,
    };
    Ok(Coregistered { difference: Grid::new(a.geometry, difference), coregistration })
}

/// A minus B, with B moved by a co-registration to other cells of the same raster, such as stable terrain; on A's grid, m.
pub fn difference(a: &Grid, b: &Grid, coregistration: &Coregistration) -> Grid {
    let offset = coregistration.shift_m.map_or([0.0; 2], |shift| shift.map(|s| -s));
    let terms = Terms { offset, raise: coregistration.raise_m, tilt: coregistration.tilt };
    Grid::new(a.geometry, rounds::minus(a, b, &terms))
}

/// Where the search for a shift ended.
#[derive(Clone, Copy)]
struct Search {
    terms: Terms,
    iterations: u32,
    converged: bool,
}

/// Iterates from `start` until B moves by less than `resolution_m`; `None` if the ground has no slopes in two directions.
fn shifted(overlay: &Overlay<'_>, start: Terms, resolution_m: f64) -> Option<Search> {
    let mut search = Search { terms: overlay.round(&start)?, iterations: 1, converged: false };
    let mut before = start;
    loop {
        let [u, v] = [0, 1].map(|k| search.terms.offset[k] - before.offset[k]);
        search.converged = (u * u + v * v).sqrt() < resolution_m;
        if search.converged || search.iterations == ROUNDS {
            return Some(search);
        }
        // B may have been moved to where the two no longer overlap.
        let Some(next) = overlay.round(&search.terms) else { return Some(search) };
        before = search.terms;
        search = Search { terms: next, iterations: search.iterations + 1, converged: false };
    }
}

fn too_few(a: &Grid, b: &Grid, cells: usize) -> CoregisterError {
    let [a, b] = [rectangle(a), rectangle(b)];
    let apart = a[0] >= b[2] || b[0] >= a[2] || a[1] >= b[3] || b[1] >= a[3];
    if apart { CoregisterError::Apart { a, b } } else { CoregisterError::TooFewCells { cells } }
}

/// `[x0, y0, x1, y1]`.
fn rectangle(grid: &Grid) -> [f64; 4] {
    let (g, size) = (grid.geometry, grid.geometry.size());
    [g.origin[0], g.origin[1], g.origin[0] + size[0], g.origin[1] + size[1]]
}

/// Median, and 1.4826 times the median absolute deviation from it.
fn centre_and_spread(values: &[f64]) -> (f64, f64) {
    let centre = sums::median(values);
    let deviations: Vec<f64> = values.iter().map(|v| (v - centre).abs()).collect();
    (centre, NORMAL_CONSISTENCY * sums::median(&deviations))
}

#[cfg(test)]
mod tests;
