//! The ground around a rover's path as a grid, for recordings: heights, and rock or sand.

use sastrugi_numeric::{Geometry, Grid, Ground, GroundClass};
use sastrugi_schemas::topics::{RoverRecording, SeenArea};

/// Maximum number of cells of a grid.
const CELLS_MAX: f64 = 262_144.0;
/// Margin of the grid around the path and the areas seen from it, m.
const BEYOND_M: f64 = 1.0;

/// The ground around a path.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// Heights, m; NaN where the ground is unknown.
    pub heights: Grid,
    /// Class of each cell, rock or sand; `None` where it is unknown.
    pub classes: Grid<Option<GroundClass>>,
}

impl Surroundings {
    /// Samples of the ground around the path of a recording and around its ends, m: at the resolution of the ground, or coarser by a
    /// power of two if that would be too many cells.
    pub fn of(ground: &impl Ground, recording: &RoverRecording, ends_m: [[f64; 2]; 2]) -> Self {
        let seen = recording.cycles.iter().flat_map(|cycle| &cycle.areas).flat_map(|area: &SeenArea| &area.corners_m);
        let way = recording.states.iter().map(|state| &state.position_m);
        let places = || seen.clone().chain(way.clone()).map(|[x, y, _]| [*x, *y]).chain(ends_m);
        let end = |axis: usize, sign: f64| {
            sign * (places().map(|at| sign * at[axis]).fold(f64::NEG_INFINITY, f64::max) + BEYOND_M)
        };
        let geometry = geometry(ground.cell_m(), [end(0, -1.0), end(1, -1.0)], [end(0, 1.0), end(1, 1.0)]);
        let mut heights = Grid::filled(geometry, f64::NAN);
        let mut classes = Grid::filled(geometry, None);
        for row in 0..geometry.rows {
            for col in 0..geometry.cols {
                if let Ok(point) = ground.at(geometry.x(col), geometry.y(row)) {
                    heights.values[row * geometry.cols + col] = point.height_m;
                    classes.values[row * geometry.cols + col] = Some(point.class);
                }
            }
        }
        Self { heights, classes }
    }
}

/// A grid aligned to multiples of its cell size that covers a rectangle.
fn geometry(ground_cell_m: f64, low: [f64; 2], high: [f64; 2]) -> Geometry {
    let mut cell = ground_cell_m;
    while (high[0] - low[0]) * (high[1] - low[1]) > CELLS_MAX * cell * cell {
        cell *= 2.0;
    }
    let first = low.map(|at| libm::floor(at / cell));
    let count = |axis: usize| (libm::ceil(high[axis] / cell) - first[axis]).max(2.0) as usize;
    Geometry { rows: count(1), cols: count(0), cell: [cell; 2], origin: first.map(|k| k * cell) }
}
