//! A measured residual to copy from, and how much of it a texture repeats.
//!
//! [`super::quilting`] and [`super::exemplar`] make a texture of cells of the site itself, so they need the residual (the DEM minus its
//! background), not its statistics. The texture is then derived from the DEM: the DEM licence extends to it, and it cannot be published
//! where the DEM cannot.
//!
//! Both methods know the source of each cell. [`Copies`] summarises it: how long the copied runs are, how much of the site occurs, and
//! how often one cell is repeated.

use super::SynthesisError;
use super::to_micrometres;
use crate::covariance::masked_covariance;
use crate::fit::{FitError, FitSettings, Heights, residual_with_quantiles};
use sastrugi_numeric::{Geometry, Grid, sums};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::{ParameterError, counted};
use std::f64::consts::E;

/// Relative difference of cell sizes that counts as rounding.
const CELL_TOLERANCE: f64 = 1e-6;
/// Largest difference between quantiles of the residual and those that the fit states, over their root mean square.
const QUANTILE_TOLERANCE: f64 = 1e-3;
/// Heights this close are the same, m.
const COPY_TOLERANCE_M: f64 = 1e-9;
/// Lags of the correlation reach this share of a side of the site,
const LAG_SHARE: usize = 4;
/// and at most this many cells, so that the tiles of its transforms stay small.
const LAG_MAX: usize = 256;

/// The residual of a measured site.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Heights minus background, m; NaN where there is no data or an object was left out. Cells as in the site.
    pub residual: Grid,
}

/// A texture of copied cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Collage {
    /// Heights, row-major, m.
    pub heights_m: Vec<f64>,
    /// What they repeat of the site.
    pub copies: Copies,
}

/// How much of a site a texture repeats.
#[derive(Clone, Debug, PartialEq)]
pub struct Copies {
    /// Longest run of cells that follow each other in the site as they do in the texture, along a column and along a row, cells.
    pub longest_run: [usize; 2],
    /// Mean of these runs, each cell counted once, along columns and along rows, cells.
    pub mean_run: [f64; 2],
    /// Share of the site's cells with data that occur in the texture.
    pub site_share: f64,
    /// Most times that one cell of the site occurs.
    pub uses_max: u32,
    /// Share of the texture's cells that have the height of their source; the others are blended or shifted.
    pub verbatim_share: f64,
}

impl Collage {
    /// A texture of `rows` by `cols` cells, of which cell k comes from cell `sources[k]` of the site.
    pub(super) fn new(heights_m: Vec<f64>, sources: &[u32], shape: [usize; 2], site: &Grid) -> Self {
        let is_copy = |(z, &k): (&f64, &u32)| (z - site.values[k as usize]).abs() <= COPY_TOLERANCE_M;
        let copied = heights_m.iter().zip(sources).filter(|&pair| is_copy(pair)).count();
        let verbatim_share = copied as f64 / heights_m.len() as f64;
        Self { copies: Copies { verbatim_share, ..Copies::of(sources, shape, site) }, heights_m }
    }
}

impl Measured {
    /// The residual of the DEM of a fit, computed as the fit did.
    ///
    /// # Errors
    /// A fit without settings; a DEM with other cells than the fit's, or without a residual; one whose residual has other heights than the fit states,
    /// such as that of another part, with other masks, or gridded by another statistic.
    pub fn of_fit(heights: &dyn Heights, fit: &FitFile) -> Result<Self, FitError> {
        let own_m = heights.geometry().cell;
        if let Some(cell_m) = fit.cell_m.filter(|m| (0..2).any(|k| (m[k] - own_m[k]).abs() > CELL_TOLERANCE * m[k])) {
            let [[x, y], [fit_x, fit_y]] = [own_m, cell_m].map(|sides| sides.map(to_micrometres));
            let message = format!(
                "has cells of {x} m x {y} m, but the fit was made on cells of {fit_x} m x {fit_y} m; give the DEM of the fit"
            );
            return Err(ParameterError::new("exemplar", message).into());
        }
        let (residual, quantiles_m) = residual_with_quantiles(heights, &FitSettings::of_fit(fit)?)?;
        check_quantiles(&quantiles_m, &fit.height_quantiles_m)?;
        Ok(Self { residual })
    }

    /// Refuses a texture whose cells are not those of the site.
    ///
    /// # Errors
    /// [`SynthesisError::OtherCells`]; [`SynthesisError::NoResidual`] if no cell of the site has data.
    pub(super) fn check(&self, tile: &Geometry, method: &'static str) -> Result<(), SynthesisError> {
        let (site_m, tile_m) = (self.residual.geometry.cell, tile.cell);
        if (0..2).any(|k| (tile_m[k] - site_m[k]).abs() > CELL_TOLERANCE * site_m[k]) {
            return Err(SynthesisError::OtherCells { method, site_m, tile_m });
        }
        if self.residual.values.iter().all(|z| !z.is_finite()) {
            return Err(SynthesisError::NoResidual { method });
        }
        Ok(())
    }

    /// Smallest lag at which the correlation has fallen below 1/e, north-south and east-west, cells: at least 1, at most a quarter of
    /// the side and [`LAG_MAX`]. The mean of a residual is 0.
    pub(super) fn correlation_cells(&self) -> [usize; 2] {
        let z = &self.residual;
        let limit = [z.rows(), z.cols()].map(|side| (side / LAG_SHARE).clamp(1, LAG_MAX));
        let found = masked_covariance(&z.values, z.cols(), limit);
        // Lags without pairs say nothing.
        let at = |lag: [isize; 2]| found.covariance(lag[0], lag[1]).unwrap_or(f64::NAN);
        let variance_m2 = at([0, 0]);
        [0, 1].map(|axis| {
            let along = |lag: usize| if axis == 0 { [lag as isize, 0] } else { [0, lag as isize] };
            (1..limit[axis]).find(|&lag| at(along(lag)) * E < variance_m2).unwrap_or(limit[axis])
        })
    }
}

/// Bytes that [`Measured::correlation_cells`] needs for a site of `cells` cells: the site, and transforms of tiles of up to 1024 x 1024 cells. A tile
/// with lags of a quarter of its side is padded to 2.25 times its cells and takes 48 bytes for each at the end, when spectra and sums are in memory;
/// two overlaps of 0.75 times its cells take 16. Lengths are rounded up to ones that transform fast.
pub(super) fn correlation_bytes(cells: u64) -> u64 {
    8 * cells + 150 * cells.min(1 << 20)
}

/// Operations of [`Measured::correlation_cells`], and of any covariance at lags of up to a quarter of the sides and [`LAG_MAX`]: transforms of heights and mask
/// on tiles that are padded to 2.25 times their cells. Overlaps of several tiles add 1.75 times the cells.
pub(super) fn correlation_operations(cells: u64) -> f64 {
    /// Most cells of a tile.
    const TILE: u64 = 1 << 20;
    /// Operations for padding and power of one padded cell.
    const PER_CELL: f64 = 10.0;
    let padding = if cells > TILE { 4.0 } else { 2.25 };
    let octaves = libm::log2(2.25 * cells.clamp(1, TILE) as f64);
    padding * cells as f64 * 2.0 * (2.5 * octaves + PER_CELL)
}

/// Refuses a residual that is not the fit's, by quantiles of its heights; a fit may state none.
fn check_quantiles(found_m: &[f64], fitted_m: &[f64]) -> Result<(), ParameterError> {
    let squares: Vec<f64> = fitted_m.iter().map(|q| q * q).collect();
    let limit_m = QUANTILE_TOLERANCE * sums::mean(&squares).sqrt();
    let is_near = |(found, fitted): (&f64, &f64)| (found - fitted).abs() <= limit_m;
    let is_same = found_m.len() == fitted_m.len() && found_m.iter().zip(fitted_m).all(is_near);
    if fitted_m.is_empty() || is_same {
        return Ok(());
    }
    let message =
        "does not give the residual of the fit: other heights, masks or gridding; give the DEM as it was fitted";
    Err(ParameterError::new("exemplar", message))
}

/// Counts of cells without data, by window.
pub(super) struct Holes {
    cols: usize,
    /// Cells without data north-west of each corner of a cell, row-major.
    counts: Vec<u32>,
}

impl Holes {
    /// The holes of a grid.
    pub(super) fn of(grid: &Grid) -> Self {
        let (rows, cols) = (grid.rows(), grid.cols() + 1);
        let mut counts = vec![0; (rows + 1) * cols];
        for r in 0..rows {
            let mut in_row = 0;
            for (c, z) in grid.row(r).iter().enumerate() {
                in_row += u32::from(!z.is_finite());
                counts[(r + 1) * cols + c + 1] = counts[r * cols + c + 1] + in_row;
            }
        }
        Self { cols, counts }
    }

    /// Number of cells without data in a window, which lies within the grid.
    pub(super) fn missing(&self, [row, col]: [usize; 2], [rows, cols]: [usize; 2]) -> u32 {
        let at = |r: usize, c: usize| self.counts[r * self.cols + c];
        at(row + rows, col + cols) + at(row, col) - at(row, col + cols) - at(row + rows, col)
    }

    /// Whether all cells of a window have data.
    pub(super) fn is_complete(&self, at: [usize; 2], shape: [usize; 2]) -> bool {
        self.missing(at, shape) == 0
    }

    /// First cells of the complete windows of a shape, every `step` cells each way, row by row.
    pub(super) fn complete_windows(&self, shape: [usize; 2], step: usize) -> impl Iterator<Item = [usize; 2]> {
        let sides = [self.counts.len() / self.cols - 1, self.cols - 1];
        let starts = move |axis: usize| (0..(sides[axis] + 1).saturating_sub(shape[axis])).step_by(step);
        let all = starts(0).flat_map(move |row| starts(1).map(move |col| [row, col]));
        all.filter(move |&at| self.is_complete(at, shape))
    }
}

impl std::fmt::Display for Copies {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { longest_run: [south, east], mean_run: [mean_south, mean_east], .. } = self;
        write!(
            f,
            "copied runs: {mean_south:.1} cells on average along columns and {mean_east:.1} along rows, at most {south} and {east}; \
             {:.0} % of the cells have the height of their source; {:.0} % of the site occurs, one of its cells {}",
            100.0 * self.verbatim_share,
            100.0 * self.site_share,
            counted(self.uses_max, "time")
        )
    }
}

impl Copies {
    /// The copies in a texture of `rows` by `cols` cells, of which cell k comes from cell `sources[k]` of the site.
    fn of(sources: &[u32], [rows, cols]: [usize; 2], site: &Grid) -> Self {
        let site_cols = site.cols() as u32;
        let follows_south = |a: u32, b: u32| b == a + site_cols;
        let follows_east = |a: u32, b: u32| b == a + 1 && !b.is_multiple_of(site_cols);
        let (south, south_mean) = runs(sources, cols, [cols, 1], rows, follows_south);
        let (east, east_mean) = runs(sources, rows, [1, cols], cols, follows_east);
        let mut uses = vec![0_u32; site.values.len()];
        sources.iter().for_each(|&source| uses[source as usize] += 1);
        let used = uses.iter().filter(|n| **n > 0).count();
        Self {
            longest_run: [south, east],
            mean_run: [south_mean, east_mean],
            site_share: used as f64 / site.finite_count() as f64,
            uses_max: uses.iter().copied().max().unwrap_or(0),
            verbatim_share: 1.0,
        }
    }
}

/// Longest and mean length of the runs along `lines` lines of `length` cells; `[step, stride]` leads to the next cell and the next line.
fn runs(
    sources: &[u32],
    lines: usize,
    [step, stride]: [usize; 2],
    length: usize,
    follows: impl Fn(u32, u32) -> bool,
) -> (usize, f64) {
    let (mut longest, mut squares) = (0, 0_u64);
    for line in 0..lines {
        let mut run = 0;
        for k in 0..length {
            run += 1;
            let here = line * stride + k * step;
            if k + 1 == length || !follows(sources[here], sources[here + step]) {
                longest = longest.max(run);
                squares += (run * run) as u64;
                run = 0;
            }
        }
    }
    // A run of n cells counts n times, once for each cell.
    (longest, squares as f64 / (lines * length) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    fn grid(rows: usize, cols: usize, f: impl Fn(usize, usize) -> f64) -> Grid {
        Grid::new(Geometry::square(rows, cols, 0.5), (0..rows * cols).map(|k| f(k / cols, k % cols)).collect())
    }

    /// By hand: two rows of the site under each other, of which the second is cut after two cells; then a row that continues around the
    /// end of a row of the site, which is no run.
    #[test]
    fn val_runs_by_hand() {
        let site = grid(4, 4, |_, _| 1.0);
        let sources = [0, 1, 2, 3, 4, 5, 10, 11, 2, 3, 4, 5];
        let copies = Copies::of(&sources, [3, 4], &site);
        assert_eq!(copies.longest_run, [2, 4]);
        // Along rows: 4; 2 and 2; 2 and 2. Along columns: (0, 4) and (1, 5) are runs of 2, everything else is alone.
        assert!((copies.mean_run[1] - (16.0 + 4.0 * 4.0) / 12.0).abs() < 1e-15);
        assert!((copies.mean_run[0] - (2.0 * 4.0 + 8.0) / 12.0).abs() < 1e-15);
        assert_eq!((copies.site_share, copies.uses_max), (0.5, 2));
        // Three of the heights are those of their sources.
        let heights_m = [1.0, 1.0 + 1e-12, 1.0, 2.0, 0.0, 1.5, 3.0, -1.0, 1.001, 7.0, 8.0, 9.0].to_vec();
        let collage = Collage::new(heights_m, &sources, [3, 4], &site);
        assert_eq!(collage.copies, Copies { verbatim_share: 0.25, ..copies });
    }

    /// Windows without holes, against a count of their cells.
    #[test]
    fn prop_complete_windows_have_no_hole() {
        let mut stream = Streams::for_seed(1, "measured-test").stream("holes");
        let values: Vec<f64> = (0..23 * 31).map(|_| if stream.uniform() < 0.06 { f64::NAN } else { 1.0 }).collect();
        let site = Grid::new(Geometry::square(23, 31, 1.0), values);
        let holes = Holes::of(&site);
        for (shape, step) in [([1, 1], 1), ([3, 4], 1), ([5, 2], 2), ([23, 1], 1), ([24, 1], 1), ([2, 31], 3)] {
            let mut expected = Vec::new();
            for row in (0..23).step_by(step).filter(|r| r + shape[0] <= 23) {
                for col in (0..31).step_by(step).filter(|c| c + shape[1] <= 31) {
                    if site.window(row, col, shape[0], shape[1]).finite_count() == shape[0] * shape[1] {
                        expected.push([row, col]);
                    }
                }
            }
            assert_eq!(holes.complete_windows(shape, step).collect::<Vec<_>>(), expected, "{shape:?} {step}");
        }
    }

    /// Two waves along the two axes, each with half of the variance: along one axis the other wave stays fully correlated, so the
    /// correlation falls below 1/e where `cos(2 pi lag / period) = 2 / e - 1`, after 0.2925 of the period: 11.7 of 40 cells, 5.9 of 20.
    #[test]
    fn val_correlation_of_waves() {
        let wave = |at: usize, period: f64| libm::cos(std::f64::consts::TAU * at as f64 / period);
        let site = grid(200, 200, |r, c| wave(r, 40.0) + wave(c, 20.0));
        let share = libm::acos(2.0 / E - 1.0) / std::f64::consts::TAU;
        let expected = [40.0, 20.0].map(|period| (share * period).ceil() as usize);
        assert_eq!(Measured { residual: site }.correlation_cells(), expected);
    }

    /// Without data at any lag, the longest lag is taken.
    #[test]
    fn val_correlation_of_one_cell() {
        let site = grid(9, 40, |r, c| if (r, c) == (4, 4) { 1.0 } else { f64::NAN });
        assert_eq!(Measured { residual: site }.correlation_cells(), [2, 10]);
    }

    #[test]
    fn val_refusals() {
        let measured = Measured { residual: grid(4, 4, |_, _| 0.0) };
        let tile = Geometry::square(4, 4, 0.1);
        assert_eq!(
            measured.check(&tile, "quilting").unwrap_err().to_string(),
            "`quilting` copies cells of the site, which are 0.5 m x 0.5 m, but those of the texture are 0.1 m x 0.1 m; set `cell_m` to \
             the site's, or resample the DEM"
        );
        assert!(measured.check(&Geometry::square(9, 9, 0.5 + 1e-9), "quilting").is_ok());
        let empty = Measured { residual: grid(4, 4, |_, _| f64::NAN) };
        assert_eq!(
            empty.check(&Geometry::square(4, 4, 0.5), "exemplar").unwrap_err().to_string(),
            "the measured residual has no cell with data for `exemplar` to copy; check the mask and the outer scale of the fit"
        );
    }
}
