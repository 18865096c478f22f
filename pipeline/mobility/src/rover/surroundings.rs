//! The ground around a rover's way as a grid, for recordings: heights, and what is rock.

use sastrugi_numeric::{Geometry, Grid, Ground, GroundClass};
use sastrugi_schemas::topics::{RoverRecording, SeenArea};

/// Most cells of a grid.
const CELLS_MAX: f64 = 262_144.0;
/// How far the grid reaches beyond the way and what was seen from it, m.
const BEYOND_M: f64 = 1.0;

/// The ground around a way.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// Heights, m; NaN where the ground is not known.
    pub heights: Grid,
    /// Whether it is rock, cell by cell; `None` where it is not known.
    pub classes: Grid<Option<GroundClass>>,
}

impl Surroundings {
    /// Samples of the ground around the way of a recording and around its ends, m: as fine as the ground, or two, four ... times coarser where
    /// that would be too many.
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

/// Cells at whole multiples of their side that hold a rectangle.
fn geometry(ground_cell_m: f64, low: [f64; 2], high: [f64; 2]) -> Geometry {
    let mut cell = ground_cell_m;
    while (high[0] - low[0]) * (high[1] - low[1]) > CELLS_MAX * cell * cell {
        cell *= 2.0;
    }
    let first = low.map(|at| libm::floor(at / cell));
    let count = |axis: usize| (libm::ceil(high[axis] / cell) - first[axis]).max(2.0) as usize;
    Geometry { rows: count(1), cols: count(0), cell: [cell; 2], origin: first.map(|k| k * cell) }
}
