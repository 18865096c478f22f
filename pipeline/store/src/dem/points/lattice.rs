//! Assignment of points to cells.

use super::survey::Survey;
use crate::dem::raster::{MAX_CELLS, Refusal};
use sastrugi_numeric::Geometry;
use sastrugi_schemas::shown;

/// Integers up to this bound are exact.
const MAX_INDEX: f64 = 9_007_199_254_740_992.0;

/// The cells that cover a cloud, aligned to integer multiples of the cell size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    cell_m: f64,
    /// Western, southern and northern border, in cells.
    west: f64,
    south: f64,
    north: f64,
    /// Shape.
    pub rows: usize,
    pub cols: usize,
}

impl Lattice {
    /// The lattice that covers all points of a survey.
    pub fn new(survey: &Survey, cell_m: f64) -> Result<Self, Refusal> {
        let [west, south] = survey.low.map(|low| (low / cell_m).floor());
        let east = (survey.high[0] / cell_m).floor() + 1.0;
        let north = (survey.high[1] / cell_m).ceil().max(south + 1.0);
        if ![west, south, east, north].iter().all(|border| border.abs() < MAX_INDEX) {
            let ([x0, y0], [x1, y1]) = (survey.low.map(shown), survey.high.map(shown));
            return Err(Refusal::new(format!(
                "its points from [{x0}, {y0}] to [{x1}, {y1}] m are too far from the origin for cells of {} m",
                shown(cell_m)
            )));
        }
        let (cols, rows) = (east - west, north - south);
        // Both are integers below 2^54. Their product may be rounded, but not where it matters.
        if cols * rows > MAX_CELLS as f64 {
            let [width, height] = [0, 1].map(|axis| shown(survey.high[axis] - survey.low[axis]));
            let [rows, cols, cell] = [rows, cols, cell_m].map(shown);
            return Err(Refusal::new(format!(
                "covers {width} x {height} m, which is {rows} x {cols} cells of {cell} m; at most {MAX_CELLS} cells are allowed"
            )));
        }
        Ok(Self { cell_m, west, south, north, rows: rows as usize, cols: cols as usize })
    }

    /// Refuses more cells than were planned for a cloud without a given cell size.
    pub fn check_planned(&self, points: u64, planned: u64) -> Result<(), Refusal> {
        let Self { rows, cols, .. } = self;
        if (rows * cols) as u64 <= planned {
            return Ok(());
        }
        Err(Refusal::new(format!(
            "its {points} points lie in a box of {rows} x {cols} cells of {} m, more than the {planned} cells planned for them; \
             convert it to a raster, or, if it is a [[dem]], set its `cell_m`",
            shown(self.cell_m)
        )))
    }

    /// Row and column of a point of the survey.
    pub fn cell(&self, [x, y]: [f64; 2]) -> (usize, usize) {
        let col = (x / self.cell_m).floor() - self.west;
        let row = self.north - (y / self.cell_m).ceil();
        ((row as usize).min(self.rows - 1), col as usize)
    }

    pub fn geometry(&self) -> Geometry {
        let origin = [self.west * self.cell_m, self.south * self.cell_m];
        Geometry { rows: self.rows, cols: self.cols, cell: [self.cell_m; 2], origin }
    }
}
