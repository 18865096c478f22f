//! From degrees to metres, crops and thinning.

use crate::grid::{Geometry, Grid};

/// Semi-major axis of WGS 84, m.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// First eccentricity squared of WGS 84.
const ECCENTRICITY_SQUARED: f64 = 6.694_379_990_14e-3;

/// Metres per degree of longitude and of latitude at a latitude on the WGS 84 ellipsoid: radii of curvature in the
/// prime vertical and in the meridian (Torge, Geodesy, 2001, section 4.1).
pub fn metres_per_degree(latitude_deg: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(latitude_deg.to_radians());
    let w2 = 1.0 - ECCENTRICITY_SQUARED * sin * sin;
    let prime_vertical = SEMI_MAJOR_M / w2.sqrt();
    let meridian = SEMI_MAJOR_M * (1.0 - ECCENTRICITY_SQUARED) / (w2 * w2.sqrt());
    [(prime_vertical * cos).to_radians(), meridian.to_radians()]
}

/// The grid with its cells in metres instead of degrees ([`in_metres`]). No height is resampled.
pub fn geographic_to_metres(grid: &Grid) -> Grid {
    Grid { geometry: in_metres(&grid.geometry), values: grid.values.clone() }
}

/// A geographic geometry with its cells in metres instead of degrees, scaled at the latitude of its centre; its south-west
/// corner becomes the origin. The scale error towards the northern and southern edges is `tan(latitude) * half height`:
/// about 0.9 % for a 1 degree tile at 45 degrees.
pub fn in_metres(g: &Geometry) -> Geometry {
    let centre = g.origin[1] + 0.5 * g.size()[1];
    let [east, north] = metres_per_degree(centre);
    Geometry { cell: [g.cell[0] * east, g.cell[1] * north], origin: [0.0; 2], ..*g }
}

/// The cells whose centres lie in the closed rectangle `[x0, y0, x1, y1]`, or `None` when there is none.
pub fn crop(grid: &Grid, rectangle: [f64; 4]) -> Option<Grid> {
    let g = &grid.geometry;
    let [x0, y0, x1, y1] = rectangle;
    let cols: Vec<usize> = (0..g.cols).filter(|&c| g.x(c) >= x0 && g.x(c) <= x1).collect();
    let rows: Vec<usize> = (0..g.rows).filter(|&r| g.y(r) >= y0 && g.y(r) <= y1).collect();
    Some(grid.window(*rows.first()?, *cols.first()?, rows.len(), cols.len()))
}

/// Every `step`-th cell of every `step`-th row, from the centre of the first block on; for drawing, not for statistics.
pub fn thin(grid: &Grid, step: usize) -> Grid {
    let step = step.max(1);
    let g = grid.geometry;
    let pick = |n: usize| (step / 2..n).step_by(step);
    let values: Vec<f64> = pick(g.rows).flat_map(|r| pick(g.cols).map(move |c| grid.at(r, c))).collect();
    let (rows, cols) = (pick(g.rows).count(), pick(g.cols).count());
    let cell = [g.cell[0] * step as f64, g.cell[1] * step as f64];
    Grid::new(Geometry { rows, cols, cell, origin: g.origin }, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the WGS 84 ellipsoid (NGA.STND.0036, 2014): 111 319.49 m per degree of longitude and 110 574.3 m per
    /// degree of latitude at the equator; 111 132.95 m per degree of latitude at 45 degrees.
    #[test]
    fn val_metres_per_degree() {
        let [east, north] = metres_per_degree(0.0);
        assert!((east - 111_319.49).abs() < 0.01 && (north - 110_574.3).abs() < 0.1);
        assert!((metres_per_degree(45.0)[1] - 111_131.7).abs() < 1.5);
    }

    #[test]
    fn val_crop_keeps_centres_inside() {
        let grid = Grid::new(Geometry::square(4, 5, 1.0), (0..20).map(f64::from).collect());
        let part = crop(&grid, [1.0, 1.0, 3.0, 3.0]).unwrap();
        assert_eq!((part.rows(), part.cols()), (2, 2));
        assert_eq!(part.values, vec![6.0, 7.0, 11.0, 12.0]);
        assert!(crop(&grid, [9.0, 9.0, 10.0, 10.0]).is_none());
    }
}
