//! Obstacle map for a rover that knows the complete terrain: cells with rocks that it cannot pass over, and sand that is too steep.
//!
//! The sand is approximated by a plane around every half metre of ground ([`super::contacts::sand_plane`]). Obstacles are samples of
//! rock higher above this plane than the obstacle height, and ground where the plane is too steep or the ground is unknown.

use super::contacts::sand_plane;
use super::sensing::Sensor;
use super::trial::Task;
use sastrugi_numeric::{Geometry, Ground, GroundClass, NoGround};

/// Spacing of the sand planes, m.
const BLOCK_M: f64 = 0.5;
/// Cells of the map along the side of such a block.
const CELLS: usize = 5;
/// Side of a cell of the map, m.
pub const CELL_M: f64 = BLOCK_M / CELLS as f64;

/// Limits beyond which ground is an obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObstacleLimits {
    /// Largest passable height of rocks above the sand, m.
    pub height_m: f64,
    /// Steepest passable sand, m per m.
    pub slope_max: f64,
    /// Distance that the centre of the rover keeps from obstacles, m.
    pub margin_m: f64,
}

impl Task {
    /// Limits of the rover: its centre keeps at least the distance of its wheels from rocks above its clearance and from sand
    /// steeper than its sensor accepts.
    pub fn obstacle_limits(&self) -> ObstacleLimits {
        let slope_max = match &self.sensor {
            Sensor::Rays(rays) => libm::tan(rays.tilt_max_rad),
            Sensor::Rectangles(rectangles) => rectangles.slope_max,
        };
        ObstacleLimits { height_m: self.clearance_m, slope_max, margin_m: self.chassis.track_m }
    }
}

/// Geometry of a map that covers a rectangle `[west, south, east, north]`, m, in whole blocks of cells of 0.1 m.
pub fn map_geometry([west, south, east, north]: [f64; 4]) -> Geometry {
    let first = |at: f64| libm::floor(at / BLOCK_M);
    let count = |low: f64, high: f64| ((libm::ceil(high / BLOCK_M) - first(low)).max(1.0)) as usize;
    Geometry {
        rows: CELLS * count(south, north),
        cols: CELLS * count(west, east),
        cell: [CELL_M; 2],
        origin: [first(west) * BLOCK_M, first(south) * BLOCK_M],
    }
}

/// Number of rows of blocks of a map.
pub fn block_rows(map: &Geometry) -> usize {
    map.rows / CELLS
}

/// Indices of the cells blocked by the obstacles in one row of blocks, counted from the north: cells whose centre lies within the
/// margin of an obstacle, and cells that contain one. Paths over free cells keep at least the margin minus half a cell diagonal from
/// every obstacle.
pub fn blocked(ground: &impl Ground, map: &Geometry, block_row: usize, limits: &ObstacleLimits) -> Vec<usize> {
    let mut cells = Blocked::new(map, block_row, limits.margin_m);
    let north = map.y(block_row * CELLS) + 0.5 * map.cell[1];
    for block in 0..map.cols / CELLS {
        let corner = [map.origin[0] + block as f64 * BLOCK_M, north - BLOCK_M];
        if obstacles(ground, corner, limits, |at| cells.mark(at)).is_err() {
            centres(corner).for_each(|at| cells.mark(at));
        }
    }
    cells.numbers()
}

/// Cells around a row of blocks.
struct Blocked<'a> {
    map: &'a Geometry,
    margin_m: f64,
    /// Cells within the margin along an axis.
    reach: usize,
    first_row: usize,
    marked: Vec<bool>,
}

impl<'a> Blocked<'a> {
    fn new(map: &'a Geometry, block_row: usize, margin_m: f64) -> Self {
        let reach = (libm::ceil(margin_m / map.mean_cell()) as usize + 1).min(map.rows.max(map.cols));
        let first_row = (block_row * CELLS).saturating_sub(reach);
        let last_row = (block_row * CELLS + CELLS + reach).min(map.rows);
        Self { map, margin_m, reach, first_row, marked: vec![false; (last_row - first_row) * map.cols] }
    }

    /// Marks the cells around an obstacle as blocked.
    fn mark(&mut self, [x, y]: [f64; 2]) {
        let Some((row, col)) = self.map.cell_at(x, y) else { return };
        let Self { map, reach, first_row, .. } = *self;
        let last_row = first_row + self.marked.len() / map.cols;
        for r in row.saturating_sub(reach).max(first_row)..(row + reach + 1).min(last_row) {
            for c in col.saturating_sub(reach)..(col + reach + 1).min(map.cols) {
                let [east, north] = [map.x(c) - x, map.y(r) - y];
                if (r, c) == (row, col) || east * east + north * north <= self.margin_m * self.margin_m {
                    self.marked[(r - first_row) * map.cols + c] = true;
                }
            }
        }
    }

    fn numbers(self) -> Vec<usize> {
        let first = self.first_row * self.map.cols;
        self.marked.into_iter().enumerate().filter(|(_, marked)| *marked).map(|(k, _)| first + k).collect()
    }
}

/// Centres of the cells of a block with this south-west corner.
fn centres([west, south]: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    let at = |k: usize| (k as f64 + 0.5) * CELL_M;
    (0..CELLS * CELLS).map(move |k| [west + at(k % CELLS), south + at(k / CELLS)])
}

/// Visits the obstacles in the block with this south-west corner.
fn obstacles(
    ground: &impl Ground,
    [west, south]: [f64; 2],
    limits: &ObstacleLimits,
    mut visit: impl FnMut([f64; 2]),
) -> Result<(), NoGround> {
    let centre = [west + 0.5 * BLOCK_M, south + 0.5 * BLOCK_M];
    let sand = sand_plane(ground, centre)?;
    let [ahead, left] = sand.slopes;
    if ahead * ahead + left * left > limits.slope_max * limits.slope_max {
        centres([west, south]).for_each(visit);
        return Ok(());
    }
    let count = libm::ceil(BLOCK_M / ground.cell_m()).max(CELLS as f64) as usize;
    let step_m = BLOCK_M / count as f64;
    for j in 0..count {
        for i in 0..count {
            let offset = [i, j].map(|n| (n as f64 + 0.5) * step_m - 0.5 * BLOCK_M);
            let at = [centre[0] + offset[0], centre[1] + offset[1]];
            let point = ground.at(at[0], at[1])?;
            if point.class == GroundClass::Rock && point.height_m - sand.height_m(offset) > limits.height_m {
                visit(at);
            }
        }
    }
    Ok(())
}
