//! Laying one DEM onto another, and their difference (snow depth: snow-on less snow-off).
//!
//! # What
//! B is moved horizontally by (e, n), raised and tilted so that `A(x, y) - B(x - e, y - n) - w - p x - q y` is as small as
//! can be, x and y from the centre of A. A is left where it is, and the difference is taken on its cells, B bilinear.
//!
//! # How
//! Nuth and Kääb (2011), Eq. 2: B displaced by (u, v) leaves `dh / tan s = -u sin a - v cos a + w / tan s`, s slope and a
//! aspect of the terrain: a cosine of the aspect. The horizontal shift is the amplitude and phase of that cosine; B is moved and the
//! fit repeated until it moves no more.
//!
//! Where we depart: Nuth and Kääb fit medians of `dh / tan s` by aspect and leave out slopes below 5 degrees, where the quotient
//! is noise. Noise is in the heights, so that the quotient's weight is `tan^2 s`; with this weight the cosine becomes
//! `dh = u dz/dx + v dz/dy + w`, no slope is left out, and raise and tilt (`+ p x + q y`), which a hillside's
//! slope would otherwise be taken for, are found in the same equations. Outliers (trees, cars, avalanches) count little: Tukey's
//! biweight at 4.685 NMAD (Holland and Welsch, 1977) on `dh` and on the difference of the slopes of A and B, since a tree on either
//! falsifies the slopes of cells beside it that are right themselves. Slopes are A's, by central differences; their noise does not bias
//! the shift, because that of a symmetric difference does not correlate with the height at its centre.
//!
//! The fit starts from B where it is and finds shifts up to about the range of the terrain's relief; `nmad_after_m` says whether it
//! did. Without stable terrain `raise_m` and `tilt` take the mean depth and its trend with them: the difference keeps the
//! texture of the snow, not its mean depth.
//!
//! # Cost
//! Some 60 operations per cell and round, usually under 10 rounds; 40 bytes per cell of A.

mod rounds;

use crate::sizes::NORMAL_CONSISTENCY;
use rounds::{Overlay, Terms};
use sastrugi_numeric::{Grid, sums};
use sastrugi_schemas::coregistration::Coregistration;

/// Fewest common cells.
const CELLS_MIN: usize = 100;
/// Most rounds.
const ROUNDS: u32 = 50;
/// A round that moves B by less than this share of a cell is the last.
const CONVERGED_CELLS: f64 = 0.005;

/// A difference of DEMs.
#[derive(Clone, Debug)]
pub struct Coregistered {
    /// A less B as moved, on A's grid, m; NaN where either has no data.
    pub difference: Grid,
    /// How B was moved.
    pub coregistration: Coregistration,
}

/// DEMs that cannot be laid onto each other.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CoregisterError {
    /// They lie apart.
    #[error(
        "the DEMs do not overlap: the first covers {a:?}, the second {b:?} (x0, y0, x1, y1); both must be in one coordinate system"
    )]
    Apart {
        /// Rectangle of the first, m.
        a: [f64; 4],
        /// Rectangle of the second, m.
        b: [f64; 4],
    },
    /// They have too little in common.
    #[error("the DEMs have {cells} cells with data in common; a coregistration needs at least {CELLS_MIN}")]
    TooFewCells {
        /// Common cells.
        cells: usize,
    },
    /// Nothing to align by.
    #[error(
        "the common part has no slopes in two directions, so that no horizontal shift can be found; subtract the DEMs as they are"
    )]
    Flat,
}

/// Lays B onto A and takes the difference. Both in metres and in one coordinate system; cells, origins and extents may differ.
///
/// # Errors
/// See [`CoregisterError`].
pub fn coregister(a: &Grid, b: &Grid) -> Result<Coregistered, CoregisterError> {
    let overlay = Overlay::new(a, b);
    let before = overlay.difference(&Terms::default());
    let common = sums::finite(&before);
    if common.len() < CELLS_MIN {
        let [ra, rb] = [rectangle(a), rectangle(b)];
        let apart = ra[0] >= rb[2] || rb[0] >= ra[2] || ra[1] >= rb[3] || rb[1] >= ra[3];
        return Err(if apart {
            CoregisterError::Apart { a: ra, b: rb }
        } else {
            CoregisterError::TooFewCells { cells: common.len() }
        });
    }
    let (median, nmad) = centre_and_spread(&common);
    let plane = overlay.levelled(Terms { raise: median, ..Terms::default() }).ok_or(CoregisterError::Flat)?;
    let nmad_plane = centre_and_spread(&sums::finite(&overlay.difference(&plane))).1;
    let cell_m = a.geometry.cell[0].min(a.geometry.cell[1]);
    let (mut terms, mut iterations, mut converged) = (plane, 0, false);
    while iterations < ROUNDS && !converged {
        let next = overlay.round(&terms).ok_or(CoregisterError::Flat)?;
        let [u, v] = [0, 1].map(|k| next.offset[k] - terms.offset[k]);
        converged = (u * u + v * v).sqrt() < CONVERGED_CELLS * cell_m;
        (terms, iterations) = (next, iterations + 1);
    }
    let difference = overlay.difference(&terms);
    let after = sums::finite(&difference);
    if after.len() < CELLS_MIN {
        return Err(CoregisterError::TooFewCells { cells: after.len() });
    }
    let coregistration = Coregistration {
        shift_m: terms.offset.map(|o| -o),
        raise_m: terms.raise,
        tilt: terms.tilt,
        median_before_m: median,
        nmad_before_m: nmad,
        nmad_plane_m: nmad_plane,
        nmad_after_m: centre_and_spread(&after).1,
        cells: after.len() as u64,
        iterations,
        converged,
    };
    Ok(Coregistered { difference: Grid::new(a.geometry, difference), coregistration })
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
