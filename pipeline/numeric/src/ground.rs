//! Properties of the ground at a point: height, class (sand or rock) and albedo.

use crate::grid::{Geometry, Grid};

/// Class of the ground.
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
    /// Sand or rock.
    pub class: GroundClass,
    /// Share of the light that is reflected, 0 to 1; NaN if unknown.
    pub albedo: f64,
}

/// A point where the ground is unknown. This is an error, never a height of 0.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("there is no ground at x = {x_m:.3}, y = {y_m:.3} m")]
pub struct NoGround {
    /// Easting, m.
    pub x_m: f64,
    /// Northing, m.
    pub y_m: f64,
}

/// Ground that is evaluated point by point. Heights are interpolated bilinearly between samples; class and albedo are those of the nearest
/// sample.
pub trait Ground {
    /// The ground at a point, in the coordinates of the terrain, m.
    ///
    /// # Errors
    /// A point where the ground is unknown.
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

/// Samples of a piece of ground, in the same precision as in files.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid, Ground, GroundClass, GroundGrid};
///
/// let mut ground = GroundGrid::of_heights(Grid::new(Geometry::square(2, 2, 1.0), vec![0.0, 0.0, 0.0, 1.0]));
/// ground.class = Some(vec![0, 0, 0, 1]);
/// // Heights are interpolated; the class is that of the nearest sample, here the rock in the south-east.
/// let point = ground.at(1.25, 0.75)?;
/// assert_eq!((point.height_m, point.class), (0.5625, GroundClass::Rock));
/// // Beyond the outer samples, there is no ground.
/// assert!(ground.at(1.75, 0.75).is_err());
/// # Ok::<(), sastrugi_numeric::NoGround>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct GroundGrid {
    /// Heights, m.
    pub heights: Grid<f32>,
    /// Codes: 0 sand, 1 rock. If absent, all ground is sand.
    pub class: Option<Vec<u8>>,
    /// Albedo. If absent, it is unknown.
    pub albedo: Option<Vec<f32>>,
}

impl GroundGrid {
    /// Ground without rocks.
    pub fn of_heights(heights: Grid<f32>) -> Self {
        Self { heights, class: None, albedo: None }
    }

    /// The ground at a point; `None` beyond the outer samples and next to a sample without data.
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

    /// Shape and position.
    pub fn geometry(&self) -> Geometry {
        self.heights.geometry
    }
}

/// The sample before a position measured in samples, and the fraction by which the position exceeds it, 0 to 1.
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

    /// Heights are those of [`Surface`]; class and albedo are those of the nearest sample.
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

    /// Beyond the outer samples and next to a hole, there is no ground, not a height of 0.
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

    /// Without maps, all ground is sand of unknown albedo; a point without ground is named.
    #[test]
    fn val_ground_without_maps() {
        let g = Geometry { rows: 3, cols: 3, cell: [2.0, 1.0], origin: [10.0, 100.0] };
        let ground = GroundGrid::of_heights(Grid::filled(g, 0.5));
        let point = ground.at(13.0, 101.0).unwrap();
        assert_eq!((point.height_m, point.class, ground.cell_m()), (0.5, GroundClass::Sand, 1.5));
        assert!(point.albedo.is_nan());
        let nowhere = ground.at(9.5, 101.25).unwrap_err();
        assert_eq!(nowhere, NoGround { x_m: 9.5, y_m: 101.25 });
        assert_eq!(nowhere.to_string(), "there is no ground at x = 9.500, y = 101.250 m");
        // The outer centres themselves are ground.
        let beyond = [(10.99, 101.0), (15.01, 101.0), (13.0, 100.49), (13.0, 102.51)];
        assert!([(11.0, 100.5), (15.0, 102.5)].iter().all(|(x, y)| ground.at(*x, *y).is_ok()));
        assert!(beyond.iter().all(|(x, y)| ground.at(*x, *y).is_err()));
    }
}
