//! Texture parameters from the second differences of a measured DEM.
//!
//! `D(h)` is the mean square of `z(x - h) - 2 z(x) + z(x + h)`, over lags h of 1 to 8 posts along both axes. Unlike the structure function
//! of first differences, it is not affected by the slope that every DEM has (Istas and Lang, 1997; Kent and Wood, 1997). The slope of
//! log D over log h, fitted by least squares with one intercept per axis, is `2 H` on a self-affine surface; the intercepts give its
//! roughness.
//!
//! Samples of stochastic interpolation are not self-affine over so few lags: the finest points differ from their neighbours by more than
//! a power law predicts. Half the slope of a texture of exponent H is 0.42 for H = 0.5 and 0.63 for 0.8 (measured; tables below). The fit
//! is therefore the texture that has the DEM's slope and intercept when measured over the same lags.
//!
//! The fit describes the DEM at lags of one post spacing and above; that the power law continues below is an assumption.

use sastrugi_numeric::{Grid, sums};

/// Longest lag, posts.
const LAG_MAX: usize = 8;
/// Minimum number of lags along an axis.
const LAGS_MIN: usize = 3;
/// Maximum number of differences per lag; larger DEMs use every second, third ... profile and difference.
const DIFFERENCES_MAX: f64 = 4e6;
/// H of a DEM without relief.
const HURST_FLAT: f64 = 0.8;
/// Rounding of heights, as a share of the largest: smaller differences count as a plane.
const ROUNDING: f64 = 1e-12;
/// Half the slope of textures of H = 0.1, 0.2 ... 1 over lags of 1 to 8 points; 20 levels, 60 000 positions.
const HALF_SLOPES: [f64; 10] = [0.2361, 0.2740, 0.3178, 0.3677, 0.4240, 0.4867, 0.5559, 0.6312, 0.7123, 0.7988];
/// `exp(mean(log D - 2 H log h) / 2)` over `s_1` of the same, h in m.
const FACTORS: [f64; 10] = [2.606, 2.433, 2.292, 2.180, 2.094, 2.035, 2.002, 1.997, 2.023, 2.087];

/// Parameters of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureFit {
    /// H.
    pub hurst: f64,
    /// `s_1`, m.
    pub roughness_m: f64,
}

/// The texture of a DEM, with a given or a fitted H. `None` if, along either axis, fewer than 3 lags have three posts in a row with data.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_terrain::elaborate::fit;
///
/// let posts = Geometry::square(20, 20, 2.0);
/// let plane = Grid::new(posts, (0..400).map(|k| 0.3 * posts.x(k % 20) - 0.1 * posts.y(k / 20)).collect());
/// assert_eq!(fit(&plane, None).map(|texture| texture.roughness_m), Some(0.0));
/// assert_eq!(fit(&plane.window(0, 0, 6, 20), None), None);
/// ```
pub fn fit(dem: &Grid, hurst: Option<f64>) -> Option<TextureFit> {
    let axes = [along_axis(dem, 0)?, along_axis(dem, 1)?];
    let highest = dem.values.iter().filter(|z| z.is_finite()).fold(0.0, |high: f64, z| high.max(z.abs()));
    let rounding = (ROUNDING * highest) * (ROUNDING * highest);
    if axes.iter().flatten().any(|l| l.square <= rounding) {
        return Some(TextureFit { hurst: hurst.unwrap_or(HURST_FLAT), roughness_m: 0.0 });
    }
    let points =
        axes.map(|lags| lags.into_iter().map(|l| [libm::log(l.lag_m), libm::log(l.square)]).collect::<Vec<_>>());
    let hurst = hurst.unwrap_or_else(|| hurst_of(0.5 * common_slope(&points)));
    let intercepts = points.each_ref().map(|points| {
        let [x, y] = centre(points);
        y - 2.0 * hurst * x
    });
    let spread_m = libm::exp(0.25 * (intercepts[0] + intercepts[1]));
    Some(TextureFit { hurst, roughness_m: spread_m / factor(hurst) })
}

/// Half slope and factor of a texture of exponent `hurst`, interpolated linearly between the measured values.
pub fn half_slope_and_factor(hurst: f64) -> [f64; 2] {
    let position = (10.0 * hurst - 1.0).clamp(0.0, 9.0);
    let low = (position as usize).min(8);
    [HALF_SLOPES, FACTORS].map(|t| t[low] + (t[low + 1] - t[low]) * (position - low as f64))
}

fn factor(hurst: f64) -> f64 {
    half_slope_and_factor(hurst)[1]
}

/// The exponent of the texture with this half slope; 0.1 to 1.
fn hurst_of(half_slope: f64) -> f64 {
    let above = HALF_SLOPES.partition_point(|s| *s < half_slope).clamp(1, 9);
    let (low, high) = (HALF_SLOPES[above - 1], HALF_SLOPES[above]);
    let position = (above - 1) as f64 + ((half_slope - low) / (high - low)).clamp(0.0, 1.0);
    0.1 * (position + 1.0)
}

fn centre(points: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|k| sums::mean(&points.iter().map(|p| p[k]).collect::<Vec<_>>()))
}

/// One slope for both axes.
fn common_slope(axes: &[Vec<[f64; 2]>; 2]) -> f64 {
    let (mut along, mut squares) = (0.0, 0.0);
    for points in axes {
        let [x, y] = centre(points);
        along += points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum::<f64>();
        squares += points.iter().map(|p| (p[0] - x) * (p[0] - x)).sum::<f64>();
    }
    along / squares
}

/// Second differences of heights at one lag.
#[derive(Clone, Copy)]
struct Lag {
    lag_m: f64,
    /// Mean square, m2.
    square: f64,
}

/// The lags along x (0) or y (1), shortest first.
fn along_axis(dem: &Grid, axis: usize) -> Option<Vec<Lag>> {
    let side = [dem.cols(), dem.rows()][axis];
    let lags: Vec<Lag> = (1..=LAG_MAX).filter(|lag| 2 * lag < side).filter_map(|lag| lag_of(dem, axis, lag)).collect();
    (lags.len() >= LAGS_MIN).then_some(lags)
}

fn lag_of(dem: &Grid, axis: usize, lag: usize) -> Option<Lag> {
    let step = libm::ceil((dem.values.len() as f64 / DIFFERENCES_MAX).sqrt()) as usize;
    let (rows, cols) = (dem.rows(), dem.cols());
    // Every `step`-th profile along the axis, and every `step`-th difference in it.
    let (profiles, differences, along, across) =
        if axis == 0 { (rows, cols - 2 * lag, 1, cols) } else { (cols, rows - 2 * lag, cols, 1) };
    let squares: Vec<f64> = (0..profiles)
        .step_by(step)
        .flat_map(|p| (0..differences).step_by(step).map(move |k| p * across + k * along))
        .map(|k| dem.values[k] - 2.0 * dem.values[k + lag * along] + dem.values[k + 2 * lag * along])
        .filter(|d| d.is_finite())
        .map(|d| d * d)
        .collect();
    (!squares.is_empty()).then(|| Lag { lag_m: lag as f64 * dem.geometry.cell[axis], square: sums::mean(&squares) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    /// On `z = a (x^2 + y^2)` all second differences over h are `2 a h^2`. For H = 1 the fit is the geometric mean of `2 a h` over the lags of
    /// both axes, divided by the table's 2.087; the fitted H is limited to 1.
    #[test]
    fn val_a_paraboloid_has_its_closed_form() {
        let g = Geometry { rows: 20, cols: 18, cell: [2.0, 3.0], origin: [5.0, -7.0] };
        let height = |k: usize| {
            let (x, y) = (g.x(k % 18), g.y(k / 18));
            0.01 * (x * x + y * y) + 0.5 * x - 0.2 * y
        };
        let dem = Grid::new(g, (0..g.len()).map(height).collect());
        // The eighth root of 8! is the geometric mean of 1 to 8.
        let mean_lag_m = libm::pow(40_320.0, 0.125) * 6f64.sqrt();
        for hurst in [Some(1.0), None] {
            let found = fit(&dem, hurst).unwrap();
            assert_eq!(found.hurst, 1.0);
            assert!((found.roughness_m * 2.087 / (0.02 * mean_lag_m) - 1.0).abs() < 1e-9, "{found:?}");
        }
    }

    /// Each exponent of the table comes back from its half slope, and halfway between two of them their mean; beyond the table, its ends.
    #[test]
    fn val_exponents_come_back_from_their_half_slopes() {
        for (k, (half_slope, of_table)) in HALF_SLOPES.into_iter().zip(FACTORS).enumerate() {
            let hurst = 0.1 * (k + 1) as f64;
            let [slope, factor] = half_slope_and_factor(hurst);
            assert!((slope - half_slope).abs() < 1e-12 && (factor - of_table).abs() < 1e-12, "{hurst}");
            assert!((hurst_of(half_slope) - hurst).abs() < 1e-12, "{hurst}");
        }
        assert!((hurst_of(0.5 * (HALF_SLOPES[4] + HALF_SLOPES[5])) - 0.55).abs() < 1e-12);
        assert!((factor(0.55) - 0.5 * (FACTORS[4] + FACTORS[5])).abs() < 1e-12);
        assert_eq!((hurst_of(-1.0), hurst_of(2.0)), (0.1, 1.0));
    }
}
