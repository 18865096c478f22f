//! Heights at posts, in scene coordinates.

use crate::dem::checks::check_single_precision;
use crate::dem::raster::Refusal;
use sastrugi_numeric::resample::stretch;
use sastrugi_numeric::{Geometry, Grid};
use serde_json::{Value, json};

/// Heights whose cell centres are posts.
pub(super) struct Posts {
    /// Heights, m; row 0 is north. The geometry is in scene coordinates.
    pub heights: Grid,
    /// What to add to scene coordinates to get the DEM's, m.
    pub shift_m: [f64; 2],
    /// Columns and rows of the DEM.
    pub source: [usize; 2],
    /// True for a DEM that was brought from degrees to metres: `shift_m` knows nothing of its place then.
    pub from_degrees: bool,
    /// Lowest post, m.
    pub low_m: f64,
    /// Highest post, m.
    pub high_m: f64,
    how: How,
}

/// How the posts came from the DEM's cell centres.
enum How {
    /// They are the same.
    Same,
    /// They are those in the middle.
    Middle,
    /// They are others on its bilinear surface; their own is off by so much at most at the cell centres, m.
    Bilinear(f64),
}

impl Posts {
    /// The cell centres.
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

    /// The same, of a DEM that was brought from degrees to metres.
    pub fn of_degrees(self) -> Self {
        Self { from_degrees: true, ..self }
    }

    /// As [`Self::of`], for programs whose terrain has no holes.
    pub fn without_holes(grid: &Grid) -> Result<Self, Refusal> {
        check_holes(grid)?;
        Self::of(grid)
    }

    /// This many posts a side, over the same ground.
    pub fn resampled(grid: &Grid, size: usize) -> Result<Self, Refusal> {
        let whole = Self::without_holes(grid)?;
        let [cols, rows] = whole.source;
        if [size; 2] == whole.source {
            return Ok(whole);
        }
        let heights = stretch(&whole.heights, size, size);
        let back = stretch(&heights, rows, cols);
        let errors = back.values.iter().zip(&whole.heights.values).map(|(a, b)| (a - b).abs());
        Self::at(heights, grid, How::Bilinear(errors.fold(0.0, f64::max)))
    }

    /// The middle of the DEM, this many posts a side, which it has at least.
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

    /// From the first to the last post, east-west and north-south, m.
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

    /// From the lowest to the highest height, m; 1 for a plane, which has no height to scale.
    pub fn relief_m(&self) -> f64 {
        if self.high_m > self.low_m { self.high_m - self.low_m } else { 1.0 }
    }

    /// Rows from south to north, each west to east.
    pub fn rows_from_south<T>(grid: &Grid<T>) -> impl Iterator<Item = &[T]> {
        (0..grid.rows()).rev().map(|row| grid.row(row))
    }

    /// How the posts came from the DEM's cell centres.
    pub fn fitting(&self) -> Value {
        match self.how {
            How::Same => json!({ "method": "none" }),
            How::Middle => json!({ "method": "crop" }),
            How::Bilinear(error) => json!({ "method": "bilinear", "largest_difference_m": error }),
        }
    }

    /// The same as a sentence, where there is something to say.
    pub fn sentence(&self) -> Option<String> {
        let ([cols, rows], size) = (self.source, self.geometry().cols);
        let of = format!("{cols} x {rows} cell centres of the DEM");
        match self.how {
            How::Same => None,
            How::Middle => Some(format!("The {size} x {size} posts are the middle of the {of}, as they are")),
            How::Bilinear(error) => Some(format!(
                "The {size} x {size} posts are bilinear between the {of}, whose outer ones they keep; at the cell centres their \
                 surface is off by {error:.3e} m at most"
            )),
        }
    }
}

fn check_holes(grid: &Grid) -> Result<(), Refusal> {
    let holes = grid.values.len() - grid.finite_count();
    if holes == 0 {
        return Ok(());
    }
    let advice = "fill them (`sastrugi texture FIT.json --fill DEM`) or cut a window without them";
    Err(Refusal::new(format!("{holes} cells hold no data, and a height map has no holes; {advice}")))
}
