//! Quilting: patches of the measured residual, joined along cuts where they differ least.
//!
//! # What
//! Patches of the site are laid row by row, each onto an overlap with earlier ones.
//!
//! 1. Choose: every complete patch of the site (of a large site, of a part drawn for each patch) is compared over the overlap, by the sum of squared
//!    differences over the geometric mean of the two sums of squares, times a cost for cells that were laid more often than those of the site on
//!    average (`search.rs`). One of the patches within `tolerance` of the best is taken at random.
//! 2. Cut: dynamic programming finds the connected path with the least sum of squared differences through each strip of overlap
//!    (`cut.rs`). Cells beyond the path come from the new patch.
//! 3. Blend: the step that remains at the cut is spread over about two cells on each side (weights: the cut mask smoothed by (1, 2, 1) / 4,
//!    twice). Without it, every cut has a step of up to twice the usual increment.
//!
//! A periodic tile is a torus: the last patches of a row or column are also cut against the first.
//!
//! # Statistics
//! The rule of the source, the least sum of squared differences, prefers calm patches: on five sites it lowers the standard deviation by 17 to 40 % and
//! increments by 19 to 49 %. Cut and blend lower them by 1 to 2 % and by 3 %. Dividing by the squares removes the preference, but the roughest or the calmest
//! part of a site may then dominate the texture (0.85 to 1.26 of the standard deviation); the cost prevents that. The table gives ratios to the site (mean and
//! spread between textures), and the difference of `ln` of the flatness at a lag of one cell, for two to four textures of 256 x 256 cells by an independent
//! program (gravel: 128 x 128; its gaps were not closed):
//!
//! | site, cell; patch, cells | the source: deviation | increments | now: deviation | increments | flatness |
//! |---|---|---|---|---|---|
//! | synthetic, rough in patches; 40 | 0.79 +- 0.01 | 0.81 | 0.97 +- 0.02 | 0.98 | -0.2 +- 0.2 |
//! | gullies, 0.5 m; 67 | 0.83 | 0.81 | 1.06 +- 0.05 | 1.01 | -0.9 +- 1.0 |
//! | terraces, 1 m; 66 | 0.60 | 0.63 | 1.09 +- 0.06 | 1.07 | 0.1 +- 0.2 |
//! | mountain valley, 5 m; 60 | 0.71 | 0.64 | 0.98 +- 0.04 | 0.93 | -0.5 +- 0.3 |
//! | gravel bar, 0.02 m; 15 | 0.60 +- 0.06 | 0.51 | 0.96 +- 0.03 | 0.97 | -0.3 |
//!
//! # Copies
//! Places that would continue a neighbour as the site does are avoided, so a copied run is about one patch long. Only a site that is too small
//! breaks this rule. [`super::measured::Copies`] reports the result.
//!
//! # Source
//! Efros and Freeman 2001, Image quilting for texture synthesis and transfer, SIGGRAPH, 341-346, doi:10.1145/383259.383296, section 2.
//! Departures: a choice among all places by transforms (Kwatra et al. 2003, Graphcut textures, section 3.3, doi:10.1145/882262.882264), in parts of
//! large sites; differences relative to the squares; a cost of reuse (as in Kaspar et al. 2015, Self tuning texture optimization, Computer Graphics
//! Forum 34, 349, doi:10.1111/cgf.12565); masks; the blend; cuts on four sides, hence tori. Patches keep their orientation and height:
//! anisotropy and skewness stay.
//!
//! # Limits
//! * Patches have one size and are laid once; there are no passes from wide to narrow patches, as in the texture transfer of the source
//!   (section 3).
//! * Features wider than a patch are lost; a single striking feature (a boulder, a rut) recurs as often as its patch is chosen.
//! * On a site that is not stationary (half gullies, half plain) gullies start and end at cuts: crop the site to one kind of
//!   ground.
//! * A texture of few patches is a small sample: with 36 of them the standard deviation spreads by 4 to 6 % between textures, and the flatness of
//!   increments, which single cells may decide, by up to a factor of e. The standard deviations of the halves of the measured sites have ratios of 0.57 to 1.07.
//! * Cells near the border of a site or of a wide gap lie in few patches and are rarely copied.
//! * Gaps of less than about 13 cells are closed first, by direct sampling from the site itself ([`super::exemplar`]). Patches with a wider gap are not
//!   used: a site with many gets smaller patches; below [`PATCH_MIN`] cells it is refused.
//! * A texture shows nothing that the site does not have: one boulder never yields a second kind. The DEM licence extends to it.
//!
//! # Cost
//! Per patch, two transforms (three where a part of the site is searched) of at most 16 384 blocks and at most 32 blocks for each cell of the
//! patch, and 32 exact comparisons for each cell of a block, at most 16: 1024 x 1024 cells take some 800 patches of 48, 1 to 2 s, or 6200 of
//! 18, about 5 s, whatever the size of the site (estimates). Memory: 64 bytes per cell of the site, 24 per cell of the texture, and 8 MB.

pub mod cut;
mod search;

use super::exemplar::sampling::{self, Field};
use super::fft_ma::{CovarianceOf, without_default};
use super::measured::{self, Collage, Holes, Measured};
use super::residual::{ResidualKernel, ResidualParameters, Site};
use super::tile::{self, Tile};
use super::{Cost, SynthesisError};
use cut::Strips;
use sastrugi_numeric::{Grid, Streams};
use sastrugi_schemas::{Kind, ParameterError, limits};
use schemars::JsonSchema;
use search::{Search, Wanted};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Name of the method.
const NAME: &str = "quilting";
/// Width of a patch in correlation lengths (lag at which the correlation is 1/e), if not stated.
const PATCH_LENGTHS: usize = 6;
/// Widest patch that is chosen, share of the site's shorter side.
const PATCH_SHARE: f64 = 1.0 / 3.0;
/// Narrowest patch, cells: an overlap of three, in which a cut has a choice.
pub const PATCH_MIN: usize = 12;
/// A patch is narrowed until the complete patches of a site cover this share of its cells with data.
const COVERED_SHARE: f64 = 0.8;
/// Gaps are closed where at least half of a window of this many cells has data.
const GAP: usize = 13;
/// Operations for a block in three transforms and the ranking; for a cell of an exact comparison; for a cell of the site; estimates.
const OPERATIONS_PER_BLOCK: f64 = 180.0;
const OPERATIONS_PER_COMPARISON: f64 = 6.0;
const OPERATIONS_PER_PLACE: f64 = 500.0;
/// Fewest complete patches to choose from.
const PLACES_MIN: usize = 100;

/// Raw parameters of quilting, without those of its tile.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct QuiltingParameters {
    /// Side of a patch, m. Default: 6 times the lag at which the residual's correlation is 1/e, at most a third of the site and (periodic)
    /// half of the tile, and as narrow as the gaps of the site require.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub patch_m: Option<f64>,
    /// Overlap of neighbouring patches as a share of their side, in [0.1, 0.5]. Default 0.25.
    #[schemars(transform = limits::within(0.1, 0.5))]
    pub overlap: f64,
    /// Patches are drawn from those whose root mean square difference over the overlap, relative to the heights there, is at most
    /// `1 + tolerance` times the least, in [0, 1]. Default 0.1 (Efros and Freeman 2001).
    #[schemars(transform = limits::within(0.0, 1.0))]
    pub tolerance: f64,
    /// How evenly the site is used, in [0, 100]: the squared difference of a patch is multiplied by `1 + evenness * n` if its cells, on average, have
    /// been used n more times than those of the site. Default 4.
    #[schemars(transform = limits::within(0.0, 100.0))]
    pub evenness: f64,
    /// Whether the texture repeats without seams. Default true.
    pub periodic: bool,
    /// Base that the texture is for: with `surface`, for level or synthetic ground, it repeats the residual as it was measured; with `residual`, for a
    /// measured background, wavelengths near the fit's window are amplified, so that background and texture together have the covariance of the site.
    /// Default: `residual` on a measured DEM or the background of a fit, otherwise `surface`.
    #[schemars(transform = without_default)]
    pub covariance: CovarianceOf,
}

impl Default for QuiltingParameters {
    fn default() -> Self {
        Self {
            patch_m: None,
            overlap: 0.25,
            tolerance: 0.1,
            evenness: 4.0,
            periodic: true,
            covariance: CovarianceOf::Surface,
        }
    }
}

impl ResidualParameters for QuiltingParameters {
    const NAME: &'static str = NAME;
    type Source = Measured;
    type Kernel = Quilt;

    fn is_periodic(&self) -> bool {
        self.periodic
    }

    fn covariance(&self) -> CovarianceOf {
        self.covariance
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.patch_m.map(|m| ParameterError::positive("patch_m", m)).transpose()?;
        let ranges = [
            ("overlap", self.overlap, 0.1, 0.5),
            ("tolerance", self.tolerance, 0.0, 1.0),
            ("evenness", self.evenness, 0.0, 100.0),
        ];
        for (key, value, low, high) in ranges {
            if !(low..=high).contains(&value) {
                return Err(ParameterError::new(key, format!("is {value}; it must lie in [{low}, {high}]")));
            }
        }
        Ok(())
    }

    fn cost_of(&self, tile: &Tile, site: &Site) -> Cost {
        self.cost(site.cells, tile.geometry.len() as u64)
    }

    fn kernel(&self, tile: &Tile, measured: &Arc<Measured>) -> Result<Quilt, ParameterError> {
        Ok(Quilt { measured: measured.clone(), tile: tile.clone(), parameters: self.clone() })
    }
}

/// Quilting bound to a site.
pub struct Quilt {
    measured: Arc<Measured>,
    tile: Tile,
    parameters: QuiltingParameters,
}

impl ResidualKernel for Quilt {
    fn cost(&self) -> Cost {
        self.parameters.cost(self.measured.residual.geometry.len() as u64, self.tile.geometry.len() as u64)
    }

    fn make(&self, streams: &Streams) -> Result<(Vec<f64>, Vec<String>), SynthesisError> {
        let Collage { heights_m, copies } = synthesise(&self.measured, &self.tile, &self.parameters, streams)?;
        Ok((heights_m, vec![copies.to_string()]))
    }
}

impl QuiltingParameters {
    /// Cost of a tile of `cells` from a site of `places` cells, at most.
    fn cost(&self, places: u64, cells: u64) -> Cost {
        // Share of a patch that is new.
        let new = (1.0 - self.overlap) * (1.0 - self.overlap);
        let blocks = search::BLOCKS_PER_CELL as f64 / new;
        let compared = (search::CANDIDATES * search::FACTOR_MAX * search::FACTOR_MAX) as f64 * (1.0 - new) / new;
        let per_cell = OPERATIONS_PER_BLOCK * blocks + OPERATIONS_PER_COMPARISON * compared;
        Cost {
            memory_bytes: ((8 << 20) + 64 * places + 24 * cells).max(24 * places + measured::correlation_bytes(places)),
            operations: per_cell * cells as f64 + OPERATIONS_PER_PLACE * places as f64,
        }
    }

    /// Rows and columns of a patch.
    fn patch(&self, measured: &Measured, holes: &Holes, tile: &Tile) -> Result<[usize; 2], SynthesisError> {
        let (cell_m, site) = (measured.residual.geometry.cell, &measured.residual);
        // North-south and east-west, like rows and columns.
        let cells = |m: f64| [cell_m[1], cell_m[0]].map(|cell| ((m / cell).round() as usize).max(1));
        let limit_m = if tile.periodic {
            0.5 * tile.geometry.size().into_iter().fold(f64::INFINITY, f64::min)
        } else {
            f64::INFINITY
        };
        if let Some(patch_m) = self.patch_m {
            if patch_m > limit_m {
                return Err(SynthesisError::PatchTooWide { patch_m, limit_m });
            }
            return self.accepted(cells(patch_m), holes, site);
        }
        let [south, east] = measured.correlation_cells();
        let length_m = f64::max(south as f64 * cell_m[1], east as f64 * cell_m[0]);
        let side_m = site.geometry.size().into_iter().fold(f64::INFINITY, f64::min);
        let narrowest_m = PATCH_MIN as f64 * cell_m[0].max(cell_m[1]);
        if limit_m < narrowest_m {
            return Err(SynthesisError::PatchTooWide { patch_m: narrowest_m, limit_m });
        }
        let mut patch_m = (PATCH_LENGTHS as f64 * length_m).min(PATCH_SHARE * side_m).min(limit_m).max(narrowest_m);
        while patch_m > narrowest_m && covered_share(cells(patch_m), holes, site) < COVERED_SHARE {
            patch_m = (0.8 * patch_m).max(narrowest_m);
        }
        self.accepted(cells(patch_m), holes, site)
    }

    /// The patch, unless it is too narrow or has too few places.
    fn accepted(&self, patch: [usize; 2], holes: &Holes, site: &Grid) -> Result<[usize; 2], SynthesisError> {
        let cell_m = site.geometry.cell;
        let patch_m = patch[0] as f64 * cell_m[1];
        if patch[0].min(patch[1]) < PATCH_MIN {
            return Err(SynthesisError::PatchTooNarrow {
                patch_m,
                least_m: PATCH_MIN as f64 * cell_m[0].max(cell_m[1]),
            });
        }
        let places = holes.complete_windows(patch, 1).count();
        match places < PLACES_MIN {
            true => Err(SynthesisError::FewPlaces { method: NAME, places, least: PLACES_MIN, side_m: patch_m }),
            false => Ok(patch),
        }
    }
}

/// Share of the cells with data that lie in any complete patch.
fn covered_share(patch: [usize; 2], holes: &Holes, site: &Grid) -> f64 {
    let [rows, cols] = [site.rows(), site.cols()];
    // Starts of patches, with as many empty lines before the first as a patch can reach back.
    let padded = sastrugi_numeric::Geometry { rows: rows + patch[0], cols: cols + patch[1], ..site.geometry };
    let mut starts = Grid::filled(padded, 0.0);
    for [row, col] in holes.complete_windows(patch, 1) {
        starts.values[(row + patch[0]) * padded.cols + col + patch[1]] = f64::NAN;
    }
    let starts = Holes::of(&starts);
    let is_covered = |row: usize, col: usize| !starts.is_complete([row + 1, col + 1], patch);
    let covered: usize = (0..rows).map(|r| (0..cols).filter(|&c| is_covered(r, c)).count()).sum();
    covered as f64 / site.finite_count() as f64
}

/// Registry entry.
pub fn kind() -> Kind {
    Kind {
        family: "texture",
        kind: NAME,
        summary: "patches of the measured residual joined along least-error cuts; needs the DEM, whose licence extends to the texture",
        source: "Efros and Freeman 2001, section 2",
        parameters: tile::schema_of_site::<QuiltingParameters>(),
    }
}

/// Where patches lie.
struct Layout {
    /// Rows and columns of a patch.
    patch: [usize; 2],
    /// Least overlap, cells.
    overlap: [usize; 2],
    /// First rows, and first columns, of the patches.
    starts: [Vec<usize>; 2],
    /// Rows and columns of the canvas, which a tile that is not periodic need not fill.
    canvas: [usize; 2],
    periodic: bool,
}

impl Layout {
    fn new(patch: [usize; 2], overlap: f64, tile: &Tile) -> Self {
        let size = [tile.geometry.rows, tile.geometry.cols];
        let overlap = patch.map(|n| ((n as f64 * overlap).round() as usize).max(2));
        let step = [0, 1].map(|axis| patch[axis] - overlap[axis]);
        let starts = [0, 1].map(|axis| match tile.periodic {
            true => {
                let count = size[axis].div_ceil(step[axis]);
                (0..count).map(|k| k * size[axis] / count).collect()
            }
            false => {
                let count = size[axis].saturating_sub(overlap[axis]).div_ceil(step[axis]).max(1);
                (0..count).map(|k| k * step[axis]).collect::<Vec<usize>>()
            }
        });
        let canvas = [0, 1].map(|axis| match tile.periodic {
            true => size[axis],
            false => (starts[axis].len() - 1) * step[axis] + patch[axis],
        });
        Self { patch, overlap, starts, canvas, periodic: tile.periodic }
    }

    /// First cell of patch `[i, j]`.
    fn at(&self, place: [usize; 2]) -> [usize; 2] {
        [0, 1].map(|axis| self.starts[axis][place[axis]])
    }

    /// The strips of patch `[i, j]` that lie on earlier ones, at most half of it each.
    fn strips(&self, place: [usize; 2]) -> Strips {
        let before = |axis: usize| {
            let (starts, k) = (&self.starts[axis], place[axis]);
            if k == 0 { 0 } else { (starts[k - 1] + self.patch[axis] - starts[k]).min(self.patch[axis] / 2) }
        };
        let after = |axis: usize| match self.periodic && place[axis] > 0 {
            true => {
                let end = self.starts[axis][place[axis]] + self.patch[axis];
                end.saturating_sub(self.canvas[axis]).min(self.patch[axis] / 2)
            }
            false => 0,
        };
        Strips { before: [before(0), before(1)], after: [after(0), after(1)] }
    }

    /// The places of the site that would continue the neighbours of patch `[i, j]`; `laid` holds the places of earlier patches.
    fn continuations(&self, place: [usize; 2], laid: &[Option<[usize; 2]>]) -> Vec<[i64; 2]> {
        let here = self.at(place);
        let neighbours = (0..9).filter_map(|k| {
            let other = [self.neighbour(0, place[0], k / 3)?, self.neighbour(1, place[1], k % 3)?];
            let from = laid[other[0] * self.starts[1].len() + other[1]]?;
            let there = self.at(other);
            Some([0, 1].map(|axis| from[axis] as i64 + self.offset(axis, there[axis], here[axis])))
        });
        neighbours.collect()
    }

    /// The patch before (0), at (1) or after (2) number `k` along an axis.
    fn neighbour(&self, axis: usize, k: usize, step: usize) -> Option<usize> {
        let count = self.starts[axis].len();
        match self.periodic {
            true => Some((k + step + count - 1) % count),
            false => (k + step).checked_sub(1).filter(|n| *n < count),
        }
    }

    /// Cells from one start to another, the shorter way around a torus.
    fn offset(&self, axis: usize, from: usize, to: usize) -> i64 {
        let (direct, around) = (to as i64 - from as i64, self.canvas[axis] as i64);
        match self.periodic && 2 * direct.abs() > around {
            true => direct - around * direct.signum(),
            false => direct,
        }
    }
}

/// What has been laid so far.
struct Canvas {
    shape: [usize; 2],
    /// Heights, m; NaN where nothing lies.
    heights_m: Vec<f64>,
    /// Cells of the site that they come from.
    sources: Vec<u32>,
}

impl Canvas {
    fn new(shape: [usize; 2]) -> Self {
        let cells = shape[0] * shape[1];
        Self { shape, heights_m: vec![f64::NAN; cells], sources: vec![0; cells] }
    }

    /// Cells of a window, row by row, around the torus.
    fn cells(&self, at: [usize; 2], [rows, cols]: [usize; 2]) -> Vec<usize> {
        let wrapped = |axis: usize, k: usize| (at[axis] + k) % self.shape[axis];
        let line = |r: usize| wrapped(0, r) * self.shape[1];
        (0..rows).flat_map(|r| (0..cols).map(move |c| (r, c))).map(|(r, c)| line(r) + wrapped(1, c)).collect()
    }

    /// Lays the patch of the site that starts at `from` onto these cells.
    fn lay(&mut self, cells: &[usize], site: &Grid, from: [usize; 2], patch: [usize; 2], strips: &Strips) {
        let source = |k: usize| (from[0] + k / patch[1]) * site.cols() + from[1] + k % patch[1];
        let squares = cells.iter().enumerate().map(|(k, &cell)| {
            let off = self.heights_m[cell] - site.values[source(k)];
            if off.is_nan() { 0.0 } else { off * off }
        });
        let replaced = cut::replaced(&squares.collect::<Vec<f64>>(), patch, strips);
        let weights = weights(&replaced, patch);
        for (k, &cell) in cells.iter().enumerate() {
            let (known, new) = (self.heights_m[cell], site.values[source(k)]);
            self.heights_m[cell] = if known.is_nan() { new } else { (1.0 - weights[k]) * known + weights[k] * new };
            if replaced[k] || known.is_nan() {
                self.sources[cell] = source(k) as u32;
            }
        }
    }

    /// The part of the canvas that a tile of `rows` by `cols` fills, whose sources are cells of a closed site.
    fn tile(&self, [rows, cols]: [usize; 2], closed: &Field, site: &Grid) -> Collage {
        let lines = || (0..rows).map(move |r| r * self.shape[1]..r * self.shape[1] + cols);
        let sources: Vec<u32> =
            lines().flat_map(|line| &self.sources[line]).map(|&k| closed.sources[k as usize]).collect();
        let heights_m = lines().flat_map(|line| &self.heights_m[line]).copied().collect();
        Collage::new(heights_m, &sources, [rows, cols], site)
    }
}

/// Weights of a new patch over earlier ones: the mask of its cells, smoothed twice by (1, 2, 1) / 4 along both axes.
fn weights(replaced: &[bool], [rows, cols]: [usize; 2]) -> Vec<f64> {
    let smoothed = |values: &[f64], axis: usize| -> Vec<f64> {
        let (step, side) = if axis == 0 { (cols, rows) } else { (1, cols) };
        let at = |k: usize| {
            let along = if axis == 0 { k / cols } else { k % cols };
            let before = if along > 0 { values[k - step] } else { values[k] };
            let after = if along + 1 < side { values[k + step] } else { values[k] };
            0.25 * before + 0.5 * values[k] + 0.25 * after
        };
        (0..values.len()).map(at).collect()
    };
    let mask: Vec<f64> = replaced.iter().map(|&new| if new { 1.0 } else { 0.0 }).collect();
    [0, 1, 0, 1].into_iter().fold(mask, |values, axis| smoothed(&values, axis))
}

/// A texture of patches of a measured residual. Streams: `patches`, `gaps`.
///
/// # Errors
/// Cells that are not the site's; a site without data; a patch too wide for the tile, too narrow, or with too few complete places in the site.
pub fn synthesise(
    measured: &Measured,
    tile: &Tile,
    parameters: &QuiltingParameters,
    streams: &Streams,
) -> Result<Collage, SynthesisError> {
    measured.check(&tile.geometry, NAME)?;
    let closed = sampling::closed(&measured.residual, GAP, streams);
    let site = &closed.grid(measured.residual.geometry);
    let holes = Holes::of(site);
    let layout = Layout::new(parameters.patch(measured, &holes, tile)?, parameters.overlap, tile);
    let [down, across] = [0, 1].map(|axis| layout.starts[axis].len());
    let QuiltingParameters { tolerance, evenness, .. } = *parameters;
    let mut search = Search::new(site, &holes, layout.patch, layout.overlap, [tolerance, evenness]);
    let mut canvas = Canvas::new(layout.canvas);
    let mut laid: Vec<Option<[usize; 2]>> = vec![None; down * across];
    let mut stream = streams.stream("patches");
    for k in 0..down * across {
        let place = [k / across, k % across];
        let cells = canvas.cells(layout.at(place), layout.patch);
        let known: Vec<f64> = cells.iter().map(|&cell| canvas.heights_m[cell]).collect();
        let continuations = layout.continuations(place, &laid);
        let clearance = layout.overlap[0].min(layout.overlap[1]);
        let from = match k {
            0 => search.any(&mut stream),
            _ => search.choose(&Wanted { known: &known, continuations: &continuations, clearance }, &mut stream),
        };
        canvas.lay(&cells, site, from, layout.patch, &layout.strips(place));
        laid[k] = Some(from);
    }
    Ok(canvas.tile([tile.geometry.rows, tile.geometry.cols], &closed, &measured.residual))
}

#[cfg(test)]
mod tests;
