//! Conversion of an image to 8-bit grey for display.
//!
//! Black is brightness 0; white is the brightness exceeded by one pixel in 200, so a few glints do not darken the image. Between them,
//! levels follow brightness to the power 1/2.2, which screens invert. Pixels that see no ground are transparent.

use sastrugi_numeric::{Grid, sums};

/// Share of the pixels that are shown below white.
const WHITE_QUANTILE: f64 = 0.995;
/// Exponent by which screens convert levels to light.
const GAMMA: f64 = 2.2;

/// The brightness that is displayed as white; NaN if no pixel sees ground.
pub fn white(image: &Grid) -> f64 {
    let mut values = sums::finite(&image.values);
    values.sort_by(f64::total_cmp);
    sums::quantile_sorted(&values, WHITE_QUANTILE)
}

/// Level and opacity of every pixel, 0 to 255, with `white` as the brightness of white.
///
/// ```
/// use sastrugi_imaging::display::grey;
/// use sastrugi_numeric::{Geometry, Grid};
///
/// // Black, white, brighter than white, and no ground.
/// let image = Grid::new(Geometry::square(1, 4, 1.0), vec![0.0, 0.4, 9.0, f64::NAN]);
/// assert_eq!(grey(&image, 0.4).values, [[0, 255], [255, 255], [255, 255], [0, 0]]);
/// ```
pub fn grey(image: &Grid, white: f64) -> Grid<[u8; 2]> {
    image.map(|brightness| match brightness {
        b if !b.is_finite() => [0, 0],
        b if b >= white => [255, 255],
        b => [(255.0 * libm::pow((b / white).max(0.0), 1.0 / GAMMA)).round() as u8, 255],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    #[test]
    fn val_levels_follow_the_stated_curve() {
        let g = Geometry::square(1, 5, 1.0);
        let image = Grid::new(g, vec![-0.1, 0.0, 0.5, 1.0, f64::NAN]);
        let middle = (255.0 * libm::pow(0.5, 1.0 / 2.2)).round() as u8;
        assert_eq!(middle, 186);
        assert_eq!(grey(&image, 1.0).values, [[0, 255], [0, 255], [middle, 255], [255, 255], [0, 0]]);
    }

    /// One bright pixel in a thousand does not set the white level.
    #[test]
    fn val_a_glint_does_not_darken_the_image() {
        let g = Geometry::square(10, 100, 1.0);
        let mut image = Grid::filled(g, 0.2);
        image.values[17] = 50.0;
        assert_eq!(white(&image), 0.2);
        assert!(white(&Grid::filled(g, f64::NAN)).is_nan());
    }
}
