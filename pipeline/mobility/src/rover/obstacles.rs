//! What a rover that knows the whole map would keep clear of: cells with rocks that it cannot pass over, and sand that is too steep.
//!
//! The sand is known by its plane around every half metre of ground ([`super::contacts::sand_plane`]). A cell is blocked where a sample of
//! rock stands higher above it than the obstacle height, where the plane is too steep, or where the ground is not known.

use super::contacts::sand_plane;
use super::sensing::Sensor;
use super::trial::Task;
use sastrugi_numeric::{Geometry, Ground, GroundClass, NoGround};

/// Distance between places where the plane of the sand is found, m.
const BLOCK_M: f64 = 0.5;
/// Cells of the map along the side of such a block.
const CELLS: usize = 5;

/// What stops a rover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObstacleLimits {
    /// Rocks may stand this high above the sand, m.
    pub height_m: f64,
    /// Steepest sand, m per m.
    pub slope_max: f64,
}

impl Task {
    /// What the rover's body cannot do: rocks above its clearance, and sand steeper than its sensor lets it drive on.
    pub fn obstacle_limits(&self) -> ObstacleLimits {
        let slope_max = match &self.sensor {
            Sensor::Rays(rays) => libm::tan(rays.tilt_max_rad),
            Sensor::Rectangles(rectangles) => rectangles.slope_max,
        };
        ObstacleLimits { height_m: self.clearance_m, slope_max }
    }

    /// Least distance between a blocked cell of `cell_m` and a cell of the rover's centre, m: half of its track less a cell, since rock and centre lie
    /// half a cell inside their own on average. A way may so pass rocks at half of the track less a cell, and gaps that are narrower
    /// than the body by up to two cells: it is a bound of how short ways can be, not a way to drive.
    pub fn obstacle_margin_m(&self, cell_m: f64) -> f64 {
        (self.chassis.track_m - cell_m).max(0.0)
    }
}

/// Shape and place of a map that holds a rectangle `[west, south, east, north]`, m: whole blocks of cells of 0.1 m.
pub fn map_geometry([west, south, east, north]: [f64; 4]) -> Geometry {
    let first = |at: f64| libm::floor(at / BLOCK_M);
    let count = |low: f64, high: f64| ((libm::ceil(high / BLOCK_M) - first(low)).max(1.0)) as usize;
    let cell = BLOCK_M / CELLS as f64;
    Geometry {
        rows: CELLS * count(south, north),
        cols: CELLS * count(west, east),
        cell: [cell; 2],
        origin: [first(west) * BLOCK_M, first(south) * BLOCK_M],
    }
}

/// Number of rows of blocks of a map.
pub fn block_rows(map: &Geometry) -> usize {
    map.rows / CELLS
}

/// Cells of one row of blocks, counted from the north, that are blocked: `CELLS` rows of the map.
pub fn blocked(ground: &impl Ground, map: &Geometry, block_row: usize, limits: &ObstacleLimits) -> Vec<bool> {
    let mut cells = vec![false; CELLS * map.cols];
    let north = map.y(block_row * CELLS) + 0.5 * map.cell[1];
    for block in 0..map.cols / CELLS {
        let west = map.origin[0] + block as f64 * BLOCK_M;
        let corner = [west, north - BLOCK_M];
        let mut part = [false; CELLS * CELLS];
        if block_cells(ground, corner, limits, &mut part).is_err() {
            part.fill(true);
        }
        for (k, blocked) in part.into_iter().enumerate() {
            // Of the part row 0 is in the south.
            let (row, col) = (CELLS - 1 - k / CELLS, block * CELLS + k % CELLS);
            cells[row * map.cols + col] = blocked;
        }
    }
    cells
}

/// The cells of a block with its south-west corner.
fn block_cells(
    ground: &impl Ground,
    [west, south]: [f64; 2],
    limits: &ObstacleLimits,
    cells: &mut [bool],
) -> Result<(), NoGround> {
    let centre = [west + 0.5 * BLOCK_M, south + 0.5 * BLOCK_M];
    let sand = sand_plane(ground, centre)?;
    let [ahead, left] = sand.slopes;
    if ahead * ahead + left * left > limits.slope_max * limits.slope_max {
        cells.fill(true);
        return Ok(());
    }
    let count = libm::ceil(BLOCK_M / ground.cell_m()).max(CELLS as f64) as usize;
    let step_m = BLOCK_M / count as f64;
    for j in 0..count {
        for i in 0..count {
            let offset = [i, j].map(|n| (n as f64 + 0.5) * step_m - 0.5 * BLOCK_M);
            let point = ground.at(centre[0] + offset[0], centre[1] + offset[1])?;
            if point.class == GroundClass::Rock && point.height_m - sand.height_m(offset) > limits.height_m {
                cells[j * CELLS / count * CELLS + i * CELLS / count] = true;
            }
        }
    }
    Ok(())
}
