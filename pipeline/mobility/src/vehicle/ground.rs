//! The ground under a vehicle: stored heights, bilinear between cell centres, and an upper bound on them.
//!
//! All missions on one terrain share a [`Ground`]. In addition to the heights it holds their *ceiling*: for every bilinear
//! cell, the largest height of any cell centre within the vehicle's `reach` of a point of the cell, widened by one more cell
//! for the interpolation. A group of contact points whose lowest point lies above the ceiling at its centre touches nothing
//! and can be skipped; the result is bit for bit the same. Where a centre within reach has no data, or lies beyond the
//! terrain, the ceiling is infinite and nothing is skipped.
//!
//! Heights of four points are computed side by side ([`Ground::cells`]), with the bits of one at a time. The four corners of a bilinear
//! cell are stored together: 16 bytes, found with one check.
//!
//! Memory: twenty bytes per cell and a rim of one vehicle length. Cost of building: two running maxima over the grid.

use super::Vehicle;
use super::lanes::LANES;
use super::surface::{Friction, SurfaceMap};
use pulp::{Simd, cast};
use sastrugi_numeric::Grid;
use sastrugi_numeric::simd::Vectors;

/// Why a vehicle cannot drive on a terrain.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GroundError {
    /// The cells are coarser than the vehicle.
    #[error(
        "drive `{vehicle}` on cells of {cell_m} m: they are larger than its wheelbase of {wheelbase_m} m; first add detail \
         below the cell size with an `elaborate` terrain"
    )]
    CellTooLarge {
        /// Larger side of a cell, m.
        cell_m: f64,
        /// Distance between the outer axles, m.
        wheelbase_m: f64,
        /// Name of the vehicle.
        vehicle: String,
    },
    /// The cells are so fine that a vehicle covers too many of them, or their size is not a finite positive number.
    #[error(
        "drive `{vehicle}` on cells of {cell_m} m: the vehicle extends over more than {limit} cells; resample the terrain first"
    )]
    CellTooSmall {
        /// Smaller side of a cell, m.
        cell_m: f64,
        /// Largest number of cells allowed between the vehicle's centre and its farthest contact point.
        limit: f64,
        /// Name of the vehicle.
        vehicle: String,
    },
    /// Fewer than two rows or columns: no bilinear cell.
    #[error("drive on a terrain of {rows} x {cols} cells; it needs at least 2 x 2")]
    TooSmall {
        /// Rows.
        rows: usize,
        /// Columns.
        cols: usize,
    },
}

/// Heights of a terrain, prepared for one vehicle.
#[derive(Clone, Debug)]
pub struct Ground {
    /// Cell centres east-west, rim included.
    cols: usize,
    /// Position of the south-west cell centre, rim included, m.
    origin: [f64; 2],
    inverse_cell: [f64; 2],
    /// Outermost cell centres of the terrain: west, south, east, north, m.
    bounds: [f64; 4],
    /// Heights at the corners of each bilinear cell, in the order of [`Ground::corners`], south row first; NaN in the rim and where
    /// there is no data.
    heights: Vec<[f32; 4]>,
    /// Upper bound on the heights within reach of the bilinear cell whose south-west corner is here.
    ceiling: Vec<f32>,
    /// See [`Ground::steepness`].
    steepness: f64,
    reach_m: f64,
    extent_m: f64,
    surface: Option<SurfaceMap>,
    warnings: Vec<String>,
    vectors: Vectors,
}

/// Rejects cells, m, that are larger than the vehicle: they do not resolve the relief that excites it.
///
/// # Errors
/// [`GroundError::CellTooLarge`].
pub fn check_scale(cell_m: f64, vehicle: &Vehicle) -> Result<(), GroundError> {
    let wheelbase_m = vehicle.wheelbase_m();
    if cell_m <= wheelbase_m {
        return Ok(());
    }
    Err(GroundError::CellTooLarge { cell_m, wheelbase_m, vehicle: vehicle.name().to_owned() })
}

/// Largest number of cells between a vehicle's centre and its farthest contact point.
const EXTENT_MAX_CELLS: f64 = 1000.0;

impl Ground {
    /// The ground of a terrain (heights in m, NaN without data; rounded to single precision as a release stores them) for
    /// a vehicle.
    ///
    /// # Errors
    /// [`GroundError`] for cells larger than the wheelbase or far too fine, and for terrains without a bilinear cell.
    ///
    /// ```
    /// use sastrugi_mobility::vehicle::{Ground, GroundError, TraverseParameters};
    /// use sastrugi_numeric::{Geometry, Grid};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let (husky, _) = TraverseParameters::default().prepare()?;
    /// let terrain = |cell_m: f64| Grid::filled(Geometry::square(40, 40, cell_m), 0.0);
    /// assert!(Ground::new(&terrain(0.05), &husky)?.warnings().is_empty());
    /// // Cells larger than a wheel are warned of; cells larger than the wheelbase are refused.
    /// assert_eq!(Ground::new(&terrain(0.3), &husky)?.warnings().len(), 1);
    /// assert!(matches!(Ground::new(&terrain(1.0), &husky), Err(GroundError::CellTooLarge { .. })));
    /// # Ok(())
    /// # }
    /// ```
    pub fn new(dem: &Grid, vehicle: &Vehicle) -> Result<Self, GroundError> {
        let geometry = dem.geometry;
        let coarse_m = geometry.cell[0].max(geometry.cell[1]);
        let fine_m = geometry.cell[0].min(geometry.cell[1]);
        let name = || vehicle.name().to_owned();
        if geometry.rows < 2 || geometry.cols < 2 {
            return Err(GroundError::TooSmall { rows: geometry.rows, cols: geometry.cols });
        }
        check_scale(coarse_m, vehicle)?;
        let few_cells = fine_m * EXTENT_MAX_CELLS >= vehicle.extent_m();
        if !few_cells {
            return Err(GroundError::CellTooSmall { cell_m: fine_m, limit: EXTENT_MAX_CELLS, vehicle: name() });
        }
        let rim = geometry.cell.map(|cell| (vehicle.extent_m() / cell).ceil() as usize + 2);
        let (heights, cols) = framed(dem, rim);
        let reach = geometry.cell.map(|cell| (vehicle.reach_m() / cell).ceil() as usize);
        Ok(Self {
            cols,
            origin: [
                geometry.x(0) - rim[0] as f64 * geometry.cell[0],
                geometry.y(geometry.rows - 1) - rim[1] as f64 * geometry.cell[1],
            ],
            inverse_cell: geometry.cell.map(|cell| 1.0 / cell),
            bounds: [geometry.x(0), geometry.y(geometry.rows - 1), geometry.x(geometry.cols - 1), geometry.y(0)],
            ceiling: ceiling(&heights, cols, reach),
            heights: cornered(&heights, cols),
            steepness: steepness(dem),
            reach_m: vehicle.reach_m(),
            extent_m: vehicle.extent_m(),
            surface: None,
            warnings: cell_warning(coarse_m, vehicle).into_iter().collect(),
            vectors: Vectors::best(),
        })
    }

    /// The same ground with a spatially varying surface.
    pub fn with_surface(mut self, surface: SurfaceMap) -> Self {
        self.surface = Some(surface);
        self
    }

    /// True when the ground has a surface map.
    pub(crate) fn has_surface(&self) -> bool {
        self.surface.is_some()
    }

    /// Coefficients at a point, if the ground has a surface map.
    #[inline(always)]
    pub(crate) fn friction(&self, x: f64, y: f64) -> Option<Friction> {
        self.surface.as_ref().map(|surface| surface.at(x, y))
    }

    /// Warnings about this terrain, for readers of the results.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// True when ceiling and rim are wide enough for the vehicle.
    pub(crate) fn carries(&self, vehicle: &Vehicle) -> bool {
        self.reach_m >= vehicle.reach_m() && self.extent_m >= vehicle.extent_m()
    }

    /// True when the point lies between the outermost cell centres.
    pub(crate) fn contains(&self, x: f64, y: f64) -> bool {
        let [west, south, east, north] = self.bounds;
        x >= west && x <= east && y >= south && y <= north
    }

    /// Height at a point, m; NaN where undefined.
    #[inline(always)]
    pub(crate) fn height(&self, x: f64, y: f64) -> f64 {
        let (k, fx, fy) = self.locate(x, y);
        let [sw, nw, se, ne] = self.corners(k);
        let (low, high) = (sw + (se - sw) * fx, nw + (ne - nw) * fx);
        low + (high - low) * fy
    }

    /// The vectors in which contact points are computed.
    #[inline(always)]
    pub(crate) fn vectors(&self) -> Vectors {
        self.vectors
    }

    /// The bilinear cells of four points.
    #[inline(always)]
    pub(crate) fn cells<S: Simd>(&self, simd: S, x: S::f64s, y: S::f64s) -> Cells<S> {
        let ([x0, y0], [per_x, per_y]) = (self.origin, self.inverse_cell);
        let u = simd.mul_f64s(simd.sub_f64s(x, simd.splat_f64s(x0)), simd.splat_f64s(per_x));
        let v = simd.mul_f64s(simd.sub_f64s(y, simd.splat_f64s(y0)), simd.splat_f64s(per_y));
        let ((i, west), (j, south)) = (floors(simd, u), floors(simd, v));
        let corners: [S::f64s; LANES] = [
            cast(self.corners(self.index(i[0], j[0]))),
            cast(self.corners(self.index(i[1], j[1]))),
            cast(self.corners(self.index(i[2], j[2]))),
            cast(self.corners(self.index(i[3], j[3]))),
        ];
        // Of four vectors, this is the transposition.
        let [south_west, north_west, south_east, north_east] = simd.deinterleave_shfl_f64s(corners);
        Cells {
            simd,
            south_west,
            south_east,
            north_west,
            north_east,
            fx: simd.sub_f64s(u, west),
            fy: simd.sub_f64s(v, south),
            per_cell: [simd.splat_f64s(per_x), simd.splat_f64s(per_y)],
        }
    }

    /// Derivatives `(dz/dx, dz/dy)` of the height at a point; NaN where undefined.
    #[cfg(test)]
    pub(crate) fn gradient(&self, x: f64, y: f64) -> (f64, f64) {
        let (k, fx, fy) = self.locate(x, y);
        let [sw, nw, se, ne] = self.corners(k);
        let (low, high) = (se - sw, ne - nw);
        let dx = (low + (high - low) * fy) * self.inverse_cell[0];
        let dy = ((nw + high * fx) - (sw + low * fx)) * self.inverse_cell[1];
        (dx, dy)
    }

    /// Upper bound on the heights within `reach_m` of this point in plan, m; infinite where a height may be undefined.
    #[inline(always)]
    pub(crate) fn ceiling(&self, x: f64, y: f64) -> f64 {
        let (k, _, _) = self.locate(x, y);
        self.ceiling.get(k).map_or(f64::INFINITY, |&z| f64::from(z))
    }

    /// Largest loss of height above the ground of a point that moves by 1 m, m; infinite for ground with holes.
    #[inline(always)]
    pub(crate) fn steepness(&self) -> f64 {
        self.steepness
    }

    /// The same ground without a ceiling or a bound on its slopes: every contact point is checked in every step.
    #[cfg(test)]
    pub(crate) fn without_culling(mut self) -> Self {
        self.ceiling.fill(f32::INFINITY);
        self.steepness = f64::INFINITY;
        self
    }

    /// The same ground, its contacts computed with other vectors.
    #[cfg(test)]
    pub(crate) fn with_vectors(self, vectors: Vectors) -> Self {
        Self { vectors, ..self }
    }

    /// Index of the south-west corner of the bilinear cell that contains a point, and the position within the cell (0 to 1).
    #[inline(always)]
    fn locate(&self, x: f64, y: f64) -> (usize, f64, f64) {
        let u = (x - self.origin[0]) * self.inverse_cell[0];
        let v = (y - self.origin[1]) * self.inverse_cell[1];
        let ((i, west), (j, south)) = (floor(u), floor(v));
        (self.index(i, j), u - west, v - south)
    }

    /// Index of the cell centre whose column and row are the low bits of two shifted positions ([`SHIFT`]).
    #[inline(always)]
    fn index(&self, col: u64, row: u64) -> usize {
        (row as u32 as usize).wrapping_mul(self.cols).wrapping_add(col as u32 as usize)
    }

    /// Heights south-west, north-west, south-east, north-east of a bilinear cell; NaN beyond the rim.
    #[inline(always)]
    fn corners(&self, k: usize) -> [f64; 4] {
        match self.heights.get(k) {
            Some(&[sw, nw, se, ne]) => [f64::from(sw), f64::from(nw), f64::from(se), f64::from(ne)],
            None => [f64::NAN; 4],
        }
    }
}

/// The bilinear cells that contain four points, and the positions (0 to 1) within them.
pub(crate) struct Cells<S: Simd> {
    simd: S,
    south_west: S::f64s,
    south_east: S::f64s,
    north_west: S::f64s,
    north_east: S::f64s,
    fx: S::f64s,
    fy: S::f64s,
    /// Cells per metre along x and along y.
    per_cell: [S::f64s; 2],
}

impl<S: Simd> Cells<S> {
    /// Heights of the points, m; NaN where undefined.
    #[inline(always)]
    pub(crate) fn heights(&self) -> S::f64s {
        let low = between(self.simd, self.south_west, self.south_east, self.fx);
        let high = between(self.simd, self.north_west, self.north_east, self.fx);
        between(self.simd, low, high, self.fy)
    }

    /// Derivatives of the heights along x and along y; NaN where undefined.
    #[inline(always)]
    pub(crate) fn gradients(&self) -> [S::f64s; 2] {
        let simd = self.simd;
        let low = simd.sub_f64s(self.south_east, self.south_west);
        let high = simd.sub_f64s(self.north_east, self.north_west);
        let rise_x = simd.add_f64s(low, simd.mul_f64s(simd.sub_f64s(high, low), self.fy));
        let north = simd.add_f64s(self.north_west, simd.mul_f64s(high, self.fx));
        let south = simd.add_f64s(self.south_west, simd.mul_f64s(low, self.fx));
        let rise_y = simd.sub_f64s(north, south);
        [simd.mul_f64s(rise_x, self.per_cell[0]), simd.mul_f64s(rise_y, self.per_cell[1])]
    }
}

/// `from + (to - from) share`
#[inline(always)]
fn between<S: Simd>(simd: S, from: S::f64s, to: S::f64s, share: S::f64s) -> S::f64s {
    simd.add_f64s(from, simd.mul_f64s(simd.sub_f64s(to, from), share))
}

/// Adding 3 x 2^51 leaves an integer in the low bits of the sum, for positions up to 2^31.
const SHIFT: f64 = 6_755_399_441_055_744.0;

/// Floor of a position in cells, as low bits and as number (the rim keeps positions positive near the terrain). A position half a
/// rounding error below a cell is assigned to that cell or to its neighbour; the bilinear surface is the same there.
#[inline(always)]
fn floor(position: f64) -> (u64, f64) {
    let shifted = (position - 0.5) + SHIFT;
    (shifted.to_bits(), shifted - SHIFT)
}

/// [`floor`] of four positions.
#[inline(always)]
fn floors<S: Simd>(simd: S, positions: S::f64s) -> ([u64; LANES], S::f64s) {
    let shift = simd.splat_f64s(SHIFT);
    let shifted = simd.add_f64s(simd.sub_f64s(positions, simd.splat_f64s(0.5)), shift);
    (cast(shifted), simd.sub_f64s(shifted, shift))
}

fn cell_warning(cell_m: f64, vehicle: &Vehicle) -> Option<String> {
    let radius_m = vehicle.parameters().wheels.radius_m;
    (cell_m > radius_m).then(|| {
        format!(
            "cells of {cell_m} m are larger than the wheel radius of {radius_m} m: bumps at the scale of the wheels are missing, \
             and vibration is underestimated"
        )
    })
}

/// The heights in single precision, south row first, inside a rim without data; and the new number of columns.
fn framed(dem: &Grid, rim: [usize; 2]) -> (Vec<f32>, usize) {
    let cols = dem.cols() + 2 * rim[0];
    let mut heights = vec![f32::NAN; cols * (dem.rows() + 2 * rim[1])];
    let south_first = (0..dem.rows()).rev().map(|row| dem.row(row));
    for (target, source) in heights.chunks_exact_mut(cols).skip(rim[1]).zip(south_first) {
        for (t, &s) in target[rim[0]..].iter_mut().zip(source) {
            // A value that overflows single precision becomes no data.
            *t = Some(s as f32).filter(|z| z.is_finite()).unwrap_or(f32::NAN);
        }
    }
    (heights, cols)
}

/// Each height with those north, east and north-east of it; NaN in the northernmost row, which belongs to the rim.
fn cornered(heights: &[f32], cols: usize) -> Vec<[f32; 4]> {
    let mut corners = Vec::with_capacity(heights.len());
    let cells = heights.windows(2).zip(heights[cols..].windows(2));
    corners.extend(cells.map(|(south, north)| [south[0], north[0], south[1], north[1]]));
    corners.resize(heights.len(), [f32::NAN; 4]);
    corners
}

/// `sqrt(1 + L^2)` with the steepest slopes of the bilinear surface along either axis, `L^2 = Lx^2 + Ly^2`: both are slopes
/// between neighbouring cell centres.
fn steepness(dem: &Grid) -> f64 {
    if dem.finite_count() < dem.values.len() {
        return f64::INFINITY;
    }
    let [cell_x, cell_y] = dem.geometry.cell;
    // A value that overflows single precision is infinite here too.
    let steepest = |a: &[f64], b: &[f64], cell: f64| {
        a.iter().zip(b).fold(0.0f64, |most, (&a, &b)| most.max((f64::from(a as f32) - f64::from(b as f32)).abs()))
            / cell
    };
    let along_x = (0..dem.rows()).map(|row| steepest(dem.row(row), &dem.row(row)[1..], cell_x));
    let along_y = (1..dem.rows()).map(|row| steepest(dem.row(row - 1), dem.row(row), cell_y));
    let (x, y) = (along_x.fold(0.0, f64::max), along_y.fold(0.0, f64::max));
    (1.0 + x * x + y * y).sqrt()
}

/// Largest height within `reach` cells of each bilinear cell and one cell more; infinite where one is not finite.
fn ceiling(heights: &[f32], cols: usize, reach: [usize; 2]) -> Vec<f32> {
    let known: Vec<f32> = heights.iter().map(|&z| if z.is_finite() { z } else { f32::INFINITY }).collect();
    let along_rows = running_max(&known, 1, reach[0]);
    running_max(&along_rows, cols, reach[1])
}

/// Maximum of `values[k - (reach + 1) stride ..= k + (reach + 2) stride]` in steps of `stride`; infinite at the ends.
fn running_max(values: &[f32], stride: usize, reach: usize) -> Vec<f32> {
    let (before, after) = ((reach + 1) * stride, (reach + 2) * stride);
    let mut result = vec![f32::INFINITY; values.len()];
    let Some(inner) = values.len().checked_sub(before + after) else { return result };
    let target = &mut result[before..before + inner];
    target.copy_from_slice(&values[..inner]);
    for offset in (stride..=before + after).step_by(stride) {
        for (t, &v) in target.iter_mut().zip(&values[offset..]) {
            *t = if v > *t { v } else { *t };
        }
    }
    result
}
