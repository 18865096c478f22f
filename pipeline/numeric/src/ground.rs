//! What the ground is at a point: its height, whether it is sand or rock, and its albedo.

use crate::grid::{Geometry, Grid};

/// What the ground is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroundClass {
    /// Everything but rock.
    Sand,
    /// Rock.
    Rock,
}

/// Ground at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPoint {
    /// Height, m.
    pub height_m: f64,
    /// What it is made of.
    pub class: GroundClass,
    /// Share of the light that it gives back, 0 to 1; NaN where it is not known.
    pub albedo: f64,
}

/// A point whose ground is not known. It is an error, never a height of 0.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("there is no ground at x = {x_m:.3}, y = {y_m:.3} m")]
pub struct NoGround {
    /// Easting, m.
    pub x_m: f64,
    /// Northing, m.
    pub y_m: f64,
}

/// Ground that can be asked point by point. Heights lie bilinearly between samples; class and albedo are those of the nearest one.
pub trait Ground {
    /// The ground at a point, in the coordinates of the terrain, m.
    ///
    /// # Errors
    /// A point whose ground is not known.
    fn at(&self, x_m: f64, y_m: f64) -> Result<GroundPoint, NoGround>;

    /// Distance between neighbouring samples, m.
    fn cell_m(&self) -> f64;
}

impl<G: Ground + ?Sized> Ground for &G {
    fn at(&self, x_m: f64, y_m: f64) -> Result<GroundPoint, NoGround> {
        (**self).at(x_m, y_m)
    }

    fn cell_m(&self) -> f64 {
        (**self).cell_m()
    }
}

/// Samples of a piece of ground, as many bytes as files hold.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundGrid {
    /// Heights, m.
    pub heights: Grid<f32>,
    /// Codes: 0 sand, 1 rock; all is sand where this is absent.
    pub class: Option<Vec<u8>>,
    /// Albedo; not known where this is absent.
    pub albedo: Option<Vec<f32>>,
}

impl GroundGrid {
    /// Ground without rocks.
    pub fn of_heights(heights: Grid<f32>) -> Self {
        Self { heights, class: None, albedo: None }
    }

    /// The ground at a point, `None` beyond the outer samples and next to one without data.
    pub fn sample(&self, x_m: f64, y_m: f64) -> Option<GroundPoint> {
        let g = &self.heights.geometry;
        let (i, across) = along((x_m - g.origin[0]) / g.cell[0] - 0.5, g.cols)?;
        let (j, up) = along((y_m - g.origin[1]) / g.cell[1] - 0.5, g.rows)?;
        let south = (g.rows - 1 - j) * g.cols + i;
        let north = south - g.cols;
        let [sw, se, nw, ne] = [south, south + 1, north, north + 1].map(|k| f64::from(self.heights.values[k]));
        let (low, high) = (sw + (se - sw) * across, nw + (ne - nw) * across);
        let height_m = low + (high - low) * up;
        let nearest = if up < 0.5 { south } else { north } + usize::from(across >= 0.5);
        let rock = self.class.as_ref().is_some_and(|class| class[nearest] == 1);
        height_m.is_finite().then(|| GroundPoint {
            height_m,
            class: if rock { GroundClass::Rock } else { GroundClass::Sand },
            albedo: self.albedo.as_ref().map_or(f64::NAN, |albedo| f64::from(albedo[nearest])),
        })
    }

    /// Shape and place.
    pub fn geometry(&self) -> Geometry {
        self.heights.geometry
    }
}

/// The sample before a position counted in samples, and how far beyond it the position lies, 0 to 1.
fn along(position: f64, count: usize) -> Option<(usize, f64)> {
    let last = count.checked_sub(2)?;
    if !(position >= 0.0 && position <= (last + 1) as f64) {
        return None;
    }
    let before = (position as usize).min(last);
    Some((before, position - before as f64))
}

impl Ground for GroundGrid {
    fn at(&self, x_m: f64, y_m: f64) -> Result<GroundPoint, NoGround> {
        self.sample(x_m, y_m).ok_or(NoGround { x_m, y_m })
    }

    fn cell_m(&self) -> f64 {
        self.heights.geometry.mean_cell()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surface;

    fn saddle() -> GroundGrid {
        let g = Geometry { rows: 5, cols: 6, cell: [0.5, 0.25], origin: [3.0, -2.0] };
        let heights = Grid::new(g, (0..30).map(|k| (k * k % 7) as f32).collect());
        let class = (0..30).map(|k| u8::from(k % 3 == 0)).collect();
        let albedo = (0..30).map(|k| k as f32).collect();
        GroundGrid { heights, class: Some(class), albedo: Some(albedo) }
    }

    /// Heights are those of [`Surface`]; class and albedo are the nearest sample's.
    #[test]
    fn val_ground_is_bilinear_and_nearest() {
        let ground = saddle();
        let g = ground.geometry();
        for (x, y) in [(3.4, -1.7), (4.9, -1.1), (5.75, -0.875), (3.25, -1.875)] {
            let point = ground.at(x, y).unwrap();
            assert!((point.height_m - ground.heights.height(x, y).unwrap()).abs() < 1e-12);
            let (row, col) = g.cell_at(x, y).unwrap();
            assert_eq!(point.albedo, (row * g.cols + col) as f64);
            assert_eq!(point.class == GroundClass::Rock, (row * g.cols + col).is_multiple_of(3));
        }
    }

    /// Beyond the outer samples, and beside a hole, there is no ground, and no height of 0.
    #[test]
    fn val_unknown_ground_is_an_error() {
        let mut ground = saddle();
        for (x, y) in [(3.1, -1.5), (4.0, -1.9), (5.9, -1.5), (f64::NAN, -1.5), (4.0, f64::INFINITY)] {
            assert!(ground.at(x, y).is_err(), "{x} {y}");
        }
        ground.heights.values[0] = f32::NAN;
        assert!(ground.at(3.3, -0.9).is_err() && ground.at(4.9, -1.5).is_ok());
        assert!(GroundGrid::of_heights(Grid::filled(Geometry::square(1, 3, 1.0), 0.0)).at(1.0, 0.5).is_err());
    }
}
