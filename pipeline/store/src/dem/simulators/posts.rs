//! Heights at posts, in scene coordinates.

use crate::dem::checks::check_single_precision;
use crate::dem::raster::Refusal;
use sastrugi_numeric::resample::stretch;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::counted;
use serde_json::{Value, json};

/// Heights at posts, which are cell centres.
pub(super) struct Posts {
    /// Heights, m; row 0 is north. The geometry is in scene coordinates.
    pub heights: Grid,
    /// Offset from scene coordinates to the DEM's, m.
    pub shift_m: [f64; 2],
    /// Columns and rows of the DEM.
    pub source: [usize; 2],
    /// True for a DEM converted from degrees to metres, for which `shift_m` does not apply.
    pub from_degrees: bool,
    /// Lowest post, m.
    pub low_m: f64,
    /// Highest post, m.
    pub high_m: f64,
    how: How,
}

/// How the posts derive from the DEM's cell centres.
enum How {
    /// All cell centres.
    Same,
    /// The cell centres in the middle.
    Middle,
    /// Resampled from the bilinear surface; with the largest deviation at the DEM's cell centres, m.
    Bilinear(f64),
}

impl Posts {
    /// Posts at all cell centres.
    pub fn of(grid: &Grid) -> Result<Self, Refusal> {
        let g = grid.geometry;
        let heights = Grid { geometry: Geometry { origin: [0.0; 2], ..g }, values: grid.values.clone() };
        Self::at(heights, grid, How::Same)
    }

    fn at(heights: Grid, source: &Grid, how: How) -> Result<Self, Refusal> {
        let (low_m, high_m) = heights.range().ok_or_else(|| Refusal::new("no cell holds data"))?;
        check_single_precision([low_m, high_m, high_m - low_m].into_iter())?;
        let g = source.geometry;
        Ok(Self { heights, shift_m: g.origin, source: [g.cols, g.rows], from_degrees: false, low_m, high_m, how })
    }

    /// Marks the DEM as converted from degrees to metres.
    pub fn of_degrees(self) -> Self {
        Self { from_degrees: true, ..self }
    }

    /// As [`Self::of`], for simulators whose terrain cannot have holes.
    pub fn without_holes(grid: &Grid) -> Result<Self, Refusal> {
        check_holes(grid)?;
        Self::of(grid)
    }

    /// `size` posts per side, over the same ground.
    pub fn resampled(grid: &Grid, size: usize) -> Result<Self, Refusal> {
        let full = Self::without_holes(grid)?;
        let [cols, rows] = full.source;
        if [size; 2] == full.source {
            return Ok(full);
        }
        let heights = stretch(&full.heights, size, size);
        let back = stretch(&heights, rows, cols);
        let errors = back.values.iter().zip(&full.heights.values).map(|(a, b)| (a - b).abs());
        Self::at(heights, grid, How::Bilinear(errors.fold(0.0, f64::max)))
    }

    /// The middle of the DEM, `size` posts per side; the DEM must have at least that many.
    pub fn cropped(grid: &Grid, size: usize) -> Result<Self, Refusal> {
        let (rows, cols) = (grid.rows(), grid.cols());
        let mut heights = grid.window((rows - size) / 2, (cols - size) / 2, size, size);
        let g = &mut heights.geometry;
        g.origin = [g.origin[0] - grid.geometry.origin[0], g.origin[1] - grid.geometry.origin[1]];
        check_holes(&heights)?;
        Self::at(heights, grid, if [size; 2] == [cols, rows] { How::Same } else { How::Middle })
    }

    pub fn geometry(&self) -> &Geometry {
        &self.heights.geometry
    }

    /// Distance from the first to the last post, east-west and north-south, m.
    pub fn ground_m(&self) -> [f64; 2] {
        let g = self.geometry();
        [(g.cols - 1) as f64 * g.cell[0], (g.rows - 1) as f64 * g.cell[1]]
    }

    /// Scene coordinates of the south-west post, m.
    pub fn south_west_m(&self) -> [f64; 2] {
        [self.geometry().x(0), self.geometry().y(self.geometry().rows - 1)]
    }

    /// Scene coordinates of the middle of the ground, m.
    pub fn centre_m(&self) -> [f64; 2] {
        let (south_west, ground) = (self.south_west_m(), self.ground_m());
        [south_west[0] + 0.5 * ground[0], south_west[1] + 0.5 * ground[1]]
    }

    /// Relief, m; 1 for a level surface, which has no relief to scale by.
    pub fn relief_m(&self) -> f64 {
        if self.high_m > self.low_m { self.high_m - self.low_m } else { 1.0 }
    }

    /// Rows from south to north, each west to east.
    pub fn rows_from_south<T>(grid: &Grid<T>) -> impl Iterator<Item = &[T]> {
        (0..grid.rows()).rev().map(|row| grid.row(row))
    }

    /// How the posts derive from the DEM's cell centres, as JSON.
    pub fn fitting(&self) -> Value {
        match self.how {
            How::Same => json!({ "method": "none" }),
            How::Middle => json!({ "method": "crop" }),
            How::Bilinear(error) => json!({ "method": "bilinear", "largest_difference_m": error }),
        }
    }

    /// How the posts derive from the DEM's cell centres, as a sentence; `None` if they are the same.
    pub fn sentence(&self) -> Option<String> {
        let ([cols, rows], size) = (self.source, self.geometry().cols);
        let of = format!("{cols} x {rows} cell centres of the DEM");
        match self.how {
            How::Same => None,
            How::Middle => Some(format!("The {size} x {size} posts are the middle of the {of}, unchanged")),
            How::Bilinear(error) => Some(format!(
                "The {size} x {size} posts are bilinear between the {of} and cover the same ground; at those centres the surface of \
                 the posts deviates by at most {error:.3e} m"
            )),
        }
    }
}

fn check_holes(grid: &Grid) -> Result<(), Refusal> {
    let holes = grid.values.len() - grid.finite_count();
    if holes == 0 {
        return Ok(());
    }
    let advice = "fill them (`sastrugi texture FIT.json --fill DEM -o OUT.tif`) or cut a window without them";
    let cells = counted(holes, "cell");
    Err(Refusal::new(format!("the DEM has {cells} without data, but a height map cannot have holes; {advice}")))
}
