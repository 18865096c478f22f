//! Statistics for judging a synthetic texture against the measured surface, most of which a fitted covariance does not prescribe.
//!
//! # What
//! For a residual (heights minus background), over cells with data ([`unfitted_statistics`]):
//! * `slope_distribution`: quantiles of the slope magnitude (central differences), m/m;
//! * `curvature_distribution`: quantiles of the Laplacian (five points), 1/m;
//! * `increment_flatness`: `ln (<d^4> / <d^2>^2)` of the increments d over lags of 1, 2, 4 ... cells, both axes together; ln 3 for
//!   a normal surface at every lag, more at short lags where roughness comes in patches;
//! * `third_order_structure`: `<d^3> / <d^2>^(3/2)` by lag, eastwards and northwards; 0 for a surface whose statistics do not
//!   change on reversing the axis, and for any normal surface;
//! * `extrema_density`: `ln` of the share of cells higher, or lower, than all eight neighbours;
//! * `directional_psd`: `ln` of the mean power in sectors of 30 degrees over the mean of all, between the longest increment (at least
//!   8 cells) and half the Nyquist frequency.
//!
//! [`surface_statistics`], for parts of a surface, counts half an extremum more of each kind, and one cell more: a smooth part may have no
//! extrema, and the logarithm of 0 is infinite. It also contains what a fit may set, and the shape of the sets above a level:
//! * `covariance`: mean product of the residuals, m²: at lag 0, then at lags of 1, 2, 3 ... cells east-west, north-south, and along both diagonals up to
//!   the same distance in cells;
//! * `height_distribution`: 99 quantiles over their root mean square, so that unit and sigma do not count; it is also the area above a level,
//!   the first Minkowski functional;
//! * `boundary_by_level` and `euler_by_level`: boundary length (1/m) and Euler characteristic (1/m²), per area, of the sets of the highest 10,
//!   20 ... 90 % of the cells ([`crate::minkowski()`]). Levels are shares of area, so that the height distribution does not count again.
//!
//! # Sources
//! Flatness and third-order structure function: Frisch, Turbulence (1995), sections 6.2 and 8.2. Density of extrema: Longuet-Higgins (1957).
//!
//! # Cost
//! Some 20 passes, two sorts and one transform of the raster; 80 bytes per cell. Compare statistics only between surfaces with
//! the same mask: holes leak into the spectrum.

use crate::lags::LagSums;
use crate::minkowski::{Minkowski, minkowski};
use sastrugi_numeric::fft::{RealFft2, smooth_length};
use sastrugi_numeric::{Grid, sums};
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

/// Number of quantiles of slopes and curvatures, at `(k + 1/2) / 19`.
const QUANTILES: usize = 19;
/// Number of quantiles of heights, at `(k + 1/2) / 99`.
const HEIGHTS: usize = 99;
/// Number of levels of the Minkowski functionals, at shares of `k / 10` of the area.
const LEVELS: usize = 9;
/// Least length of the longest waves of the sectors, cells: an octave above the shortest, which are of 4 cells.
const SECTOR_CELLS_MIN: usize = 8;
/// Sectors in half a turn.
const SECTORS: usize = 6;

/// One statistic.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistic {
    /// Name.
    pub name: &'static str,
    /// Values; NaN where there is no data.
    pub values: Vec<f64>,
    /// How two sets of values are compared.
    pub scale: Scale,
}

/// How the distance of two sets of values is expressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Root mean square difference, for values without a unit.
    Absolute,
    /// Root mean square difference over the root mean square of reference values, for values with a unit.
    Relative,
    /// Largest difference over the first of the reference values: for a covariance, the variance.
    First,
}

impl Scale {
    /// Distance of `a` from `b`, without a unit; all slices have the same length.
    ///
    /// ```
    /// use sastrugi_roughness::Scale;
    ///
    /// let (a, b, reference) = ([3.0, 1.0], [2.0, 4.0], [5.0, 5.0]);
    /// assert_eq!(Scale::Absolute.distance(&a, &b, &reference), 5.0f64.sqrt());
    /// assert_eq!(Scale::Relative.distance(&a, &b, &reference), 5.0f64.sqrt() / 5.0);
    /// assert_eq!(Scale::First.distance(&a, &b, &reference), 0.6);
    /// ```
    pub fn distance(self, a: &[f64], b: &[f64], reference: &[f64]) -> f64 {
        let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        match self {
            Self::Absolute => root_mean_square(&differences),
            Self::Relative => root_mean_square(&differences) / root_mean_square(reference),
            Self::First => {
                let largest = differences.iter().fold(0.0, |most, d| f64::max(most, d.abs()));
                reference.first().map_or(f64::NAN, |first| largest / first)
            }
        }
    }
}

fn root_mean_square(values: &[f64]) -> f64 {
    sums::mean(&values.iter().map(|v| v * v).collect::<Vec<_>>()).sqrt()
}

/// The statistics of a residual that a covariance does not prescribe, with increments over lags of up to `lag_max` cells.
pub fn unfitted_statistics(residual: &Grid, lag_max: usize) -> Vec<Statistic> {
    unfitted(residual, lag_max, [0.0, 0.0])
}

/// The same with numbers added to the extrema of each kind and to the cells among which they are counted.
fn unfitted(residual: &Grid, lag_max: usize, [extrema_more, cells_more]: [f64; 2]) -> Vec<Statistic> {
    let [maxima, minima, cells] = extrema(residual).map(|count| count as f64);
    let density = |count: f64| libm::log((count + extrema_more) / (cells + cells_more));
    let lags: Vec<usize> =
        std::iter::successors(Some(1), |l| Some(2 * l)).take_while(|l| *l <= lag_max.max(1)).collect();
    let (slope, curvature) = derivatives(residual);
    let increments = increments(residual, &lags);
    let with = |name, scale, values| Statistic { name, values, scale };
    vec![
        with("slope_distribution", Scale::Relative, quantiles(slope)),
        with("curvature_distribution", Scale::Relative, quantiles(curvature)),
        with("increment_flatness", Scale::Absolute, increments.iter().map(Moments::log_flatness).collect()),
        with("third_order_structure", Scale::Absolute, increments.iter().flat_map(Moments::skewness).collect()),
        with("extrema_density", Scale::Absolute, vec![density(maxima), density(minima)]),
        with("directional_psd", Scale::Absolute, directional_power(residual, lag_max)),
    ]
}

/// All statistics of a residual: those of [`unfitted_statistics`], then covariance up to `lag_max` cells, heights and Minkowski functionals.
pub fn surface_statistics(residual: &Grid, lag_max: usize) -> Vec<Statistic> {
    let mut heights = sums::finite(&residual.values);
    heights.sort_by(f64::total_cmp);
    let levels: Vec<f64> =
        (1..=LEVELS).map(|k| sums::quantile_sorted(&heights, k as f64 / (LEVELS + 1) as f64)).collect();
    let Minkowski { boundary_per_m, euler_per_m2 } = minkowski(residual, &levels);
    let with = |name, scale, values| Statistic { name, values, scale };
    let mut all = unfitted(residual, lag_max, [0.5, 1.0]);
    all.extend([
        with("covariance", Scale::First, covariance(residual, lag_max)),
        with("height_distribution", Scale::Absolute, standardised(&heights)),
        with("boundary_by_level", Scale::Relative, boundary_per_m),
        with("euler_by_level", Scale::Relative, euler_per_m2),
    ]);
    all
}

fn quantiles(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    (0..QUANTILES).map(|k| sums::quantile_sorted(&values, (k as f64 + 0.5) / QUANTILES as f64)).collect()
}

/// Quantiles of sorted heights over their root mean square.
fn standardised(sorted: &[f64]) -> Vec<f64> {
    let quantiles: Vec<f64> =
        (0..HEIGHTS).map(|k| sums::quantile_sorted(sorted, (k as f64 + 0.5) / HEIGHTS as f64)).collect();
    let size = root_mean_square(&quantiles);
    quantiles.into_iter().map(|q| q / size).collect()
}

/// Covariance at lag 0, then east-west, north-south, towards the south-east, and towards the south-west.
fn covariance(z: &Grid, lag_max: usize) -> Vec<f64> {
    let sums = LagSums::of(z, [lag_max; 2]);
    // A step along a diagonal is sqrt(2) cells long.
    let diagonal = lag_max.min(((lag_max as f64 * FRAC_1_SQRT_2) as usize).max(1));
    let along = |[south, east]: [isize; 2], most: usize| (1..=most as isize).map(move |l| [l * south, l * east]);
    let all = std::iter::once([0, 0])
        .chain(along([0, 1], lag_max))
        .chain(along([1, 0], lag_max))
        .chain(along([1, 1], diagonal))
        .chain(along([1, -1], diagonal));
    all.map(|[south, east]| sums.at(south, east).covariance()).collect()
}

/// Slope magnitudes and Laplacians of the cells whose four neighbours have data.
fn derivatives(z: &Grid) -> (Vec<f64>, Vec<f64>) {
    let [x, y] = z.geometry.cell;
    let (mut slopes, mut laplacians) = (Vec::new(), Vec::new());
    for r in 1..z.rows().saturating_sub(1) {
        let (above, row, below) = (z.row(r - 1), z.row(r), z.row(r + 1));
        for c in 1..z.cols().saturating_sub(1) {
            let (east, north) = ((row[c + 1] - row[c - 1]) / (2.0 * x), (above[c] - below[c]) / (2.0 * y));
            let bend =
                (row[c + 1] - 2.0 * row[c] + row[c - 1]) / (x * x) + (above[c] - 2.0 * row[c] + below[c]) / (y * y);
            if bend.is_finite() {
                slopes.push((east * east + north * north).sqrt());
                laplacians.push(bend);
            }
        }
    }
    (slopes, laplacians)
}

/// Moments of the increments over one lag, eastwards and northwards.
struct Moments {
    /// `[<d^2>, <d^3>, <d^4>]` of each axis.
    axes: [[f64; 3]; 2],
}

impl Moments {
    fn log_flatness(&self) -> f64 {
        let [second, fourth] = [0, 2].map(|k| 0.5 * (self.axes[0][k] + self.axes[1][k]));
        libm::log(fourth / (second * second))
    }

    fn skewness(&self) -> [f64; 2] {
        self.axes.map(|[second, third, _]| third / (second * second.sqrt()))
    }
}

fn increments(z: &Grid, lags: &[usize]) -> Vec<Moments> {
    let (rows, cols) = (z.rows(), z.cols());
    let of = |lag: usize, [north, east]: [usize; 2]| {
        let moments: Vec<[f64; 4]> = (lag * north..rows)
            .map(|r| {
                let (from, to) = (z.row(r), &z.row(r - lag * north)[(lag * east).min(cols)..]);
                from.iter().zip(to).map(|(a, b)| b - a).filter(|d| d.is_finite()).fold([0.0; 4], |[n, p, q, s], d| {
                    let square = d * d;
                    [n + 1.0, p + square, q + square * d, s + square * square]
                })
            })
            .collect();
        let total = [0, 1, 2, 3].map(|k| sums::sum(&moments.iter().map(|m| m[k]).collect::<Vec<_>>()));
        [1, 2, 3].map(|k| total[k] / total[0])
    };
    lags.iter().map(|&lag| Moments { axes: [of(lag, [0, 1]), of(lag, [1, 0])] }).collect()
}

/// Numbers of maxima and of minima, and of the cells whose eight neighbours have data.
fn extrema(z: &Grid) -> [u64; 3] {
    let mut counts = [0u64; 3];
    for r in 1..z.rows().saturating_sub(1) {
        for c in 1..z.cols().saturating_sub(1) {
            let own = z.at(r, c);
            let around = (r - 1..=r + 1).flat_map(|i| (c - 1..=c + 1).map(move |j| (i, j))).filter(|p| *p != (r, c));
            let (low, high, complete) =
                around.fold((f64::INFINITY, f64::NEG_INFINITY, own.is_finite()), |(l, h, w), (i, j)| {
                    let v = z.at(i, j);
                    (l.min(v), h.max(v), w && v.is_finite())
                });
            counts[0] += u64::from(complete && own > high);
            counts[1] += u64::from(complete && own < low);
            counts[2] += u64::from(complete);
        }
    }
    counts
}

/// `ln` of the mean power in each sector over the mean of all; sectors are centred at 0, 30 ... degrees clockwise from north.
fn directional_power(z: &Grid, lag_max: usize) -> Vec<f64> {
    let (rows, cols) = (z.rows(), z.cols());
    let [height, width] = [rows, cols].map(smooth_length);
    let fft = RealFft2::new(height, width);
    let hann = |k: usize, n: usize| 0.5 - 0.5 * libm::cos(TAU * (k as f64 + 0.5) / n as f64);
    let mut field = vec![0.0; height * width];
    for r in 0..rows {
        for (c, &v) in z.row(r).iter().enumerate() {
            field[r * width + c] = if v.is_finite() { v * hann(r, rows) * hann(c, cols) } else { 0.0 };
        }
    }
    let spectrum = fft.forward(&field);
    let cell = z.geometry.cell;
    let coarse = cell[0].max(cell[1]);
    let band = [1.0 / (lag_max.max(SECTOR_CELLS_MIN) as f64 * coarse), 0.25 / coarse];
    let mut sectors = [(0.0, 0.0); SECTORS];
    for (k, value) in spectrum.values.iter().enumerate() {
        let (kx, ky) = (k / height, k % height);
        let ky = if 2 * ky > height { ky as f64 - height as f64 } else { ky as f64 };
        // Rows count southwards, so a positive frequency across rows points south.
        let [east, north] = [kx as f64 / (width as f64 * cell[0]), -ky / (height as f64 * cell[1])];
        let frequency = (east * east + north * north).sqrt();
        if frequency < band[0] || frequency > band[1] {
            continue;
        }
        // The other half of the spectrum repeats these modes, except for the first and the middle column.
        let weight = if kx == 0 || 2 * kx == width { 1.0 } else { 2.0 };
        let turn = libm::atan2(east, north) / PI;
        let sector = ((turn - turn.floor()) * SECTORS as f64 + 0.5) as usize % SECTORS;
        sectors[sector].0 += weight * value.norm_sqr();
        sectors[sector].1 += weight;
    }
    let (power, modes) = sectors.iter().fold((0.0, 0.0), |(p, m), s| (p + s.0, m + s.1));
    sectors.iter().map(|(p, m)| libm::log(p / m * modes / power)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    fn grid(rows: usize, cols: usize, cell: [f64; 2], f: impl Fn(f64, f64) -> f64) -> Grid {
        let geometry = Geometry { rows, cols, cell, origin: [0.0; 2] };
        Grid::new(geometry, (0..rows * cols).map(|k| f(geometry.x(k % cols), geometry.y(k / cols))).collect())
    }

    /// The values of a statistic; one without any would pass every test of all of them.
    fn values(all: &[Statistic], name: &str) -> Vec<f64> {
        let found = all.iter().find(|s| s.name == name).unwrap().values.clone();
        assert!(!found.is_empty(), "{name} has no values");
        found
    }

    /// A paraboloid: its Laplacian is 2 (a + b) everywhere, and it has one maximum.
    #[test]
    fn val_a_paraboloid() {
        let z = grid(41, 61, [0.5, 0.25], |x, y| -0.3 * (x - 15.1) * (x - 15.1) - 0.2 * (y - 5.1) * (y - 5.1));
        let all = unfitted_statistics(&z, 4);
        assert!(values(&all, "curvature_distribution").iter().all(|v| (v + 1.0).abs() < 1e-9));
        let density = values(&all, "extrema_density");
        assert!((density[0] - libm::log(1.0 / (39.0 * 59.0))).abs() < 1e-12 && density[1] == f64::NEG_INFINITY);
        // With half an extremum more: 1.5 maxima and half a minimum of 39 x 59 + 1 cells.
        let density = values(&surface_statistics(&z, 4), "extrema_density");
        let expected = [1.5, 0.5].map(|count| libm::log(count / (39.0 * 59.0 + 1.0)));
        assert!(density.iter().zip(expected).all(|(d, e)| (d - e).abs() < 1e-12), "{density:?}");
    }

    /// A sawtooth that rises eastwards over 7 cells and falls over 1: d over one cell is 1 (7 of 8) or -7 (1 of 8), so that
    /// <d^2> = 7, <d^3> = -42, <d^4> = 301; northwards the increments are zero.
    #[test]
    fn val_a_sawtooth_by_hand() {
        let z = grid(16, 81, [1.0; 2], |x, _| (x - 0.5) % 8.0);
        let all = unfitted_statistics(&z, 1);
        let skewness = values(&all, "third_order_structure");
        assert!((skewness[0] + 42.0 / (7.0 * 7f64.sqrt())).abs() < 1e-12, "{skewness:?}");
        let flatness = values(&all, "increment_flatness")[0];
        assert!((flatness - libm::log(2.0 * 301.0 / 49.0)).abs() < 1e-12);
    }

    /// The same sawtooth, rising northwards.
    #[test]
    fn val_a_sawtooth_northwards() {
        let z = grid(81, 16, [1.0; 2], |_, y| (y - 0.5) % 8.0);
        let skewness = values(&unfitted_statistics(&z, 1), "third_order_structure");
        assert!(skewness[0].is_nan() && (skewness[1] + 42.0 / (7.0 * 7f64.sqrt())).abs() < 1e-12, "{skewness:?}");
    }

    /// `z = x^2 / 2` on cells of 1 m has slopes 1.5, 2.5 ... 19.5 in its inner row: quantile q is 1.5 + 18 q.
    #[test]
    fn val_quantiles_of_slopes() {
        let z = grid(3, 21, [1.0; 2], |x, _| 0.5 * x * x);
        let found = values(&unfitted_statistics(&z, 1), "slope_distribution");
        assert_eq!(found.len(), 19);
        for (k, slope) in found.iter().enumerate() {
            assert!((slope - (1.5 + 18.0 * (k as f64 + 0.5) / 19.0)).abs() < 1e-12, "{k}: {slope}");
        }
    }

    /// A chessboard of cells of -1 and 1, 8 rows and 12 columns: the covariance alternates between 1 and -1 along the axes, and is 1 at the two steps of
    /// either diagonal that are shorter than three cells; all pairs of neighbours are crossed at every level between, and 49 of the quantiles are opposite to 49 others. Corners cancel: as many squares of one as of three.
    #[test]
    fn val_a_chessboard() {
        let z =
            grid(8, 12, [0.5, 0.25], |x, y| if ((x / 0.5) as i32 + (y / 0.25) as i32) % 2 == 0 { 1.0 } else { -1.0 });
        let all = surface_statistics(&z, 3);
        assert_eq!(all.len(), 10);
        let covariance = values(&all, "covariance");
        let expected = [1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0];
        assert_eq!(covariance.len(), expected.len());
        assert!(covariance.iter().zip(expected).all(|(c, e)| (c - e).abs() < 1e-12), "{covariance:?}");
        let heights = values(&all, "height_distribution");
        assert!(heights.len() == 99 && heights[..49].iter().all(|q| *q == -heights[98]), "{heights:?}");
        // Levels of -1 (10 to 40 %) are exceeded by half of the cells, those of 1 by none.
        let boundary = values(&all, "boundary_by_level");
        let all_crossed = 0.25 * PI * (1.0 / 0.5 + 1.0 / 0.25);
        assert!((boundary[0] - all_crossed).abs() < 1e-12 && boundary[8] == 0.0, "{boundary:?}");
        assert!(values(&all, "euler_by_level").iter().all(|v| *v == 0.0));
    }

    /// Ridges towards the north-east, and their mirror image: the covariance is the same along the axes, and 1 along the ridges. Waves of 8 cells
    /// each way on 64 x 64 cells; sums over pairs miss whole waves by a tenth at most.
    #[test]
    fn val_diagonal_ridges_differ_along_the_diagonals() {
        let ridges = |sign: f64| {
            let z = grid(64, 64, [1.0; 2], |x, y| 2f64.sqrt() * libm::cos(TAU * (x - sign * y) / 8.0));
            values(&surface_statistics(&z, 4), "covariance")
        };
        let (north_east, north_west) = (ridges(1.0), ridges(-1.0));
        assert_eq!(north_east.len(), 1 + 4 + 4 + 2 + 2);
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 0.1;
        assert!(north_east.iter().zip(&north_west).take(9).all(near), "{north_east:?} {north_west:?}");
        // Two steps towards the south-east cross half a wave of ridges towards the north-east; those towards the south-west follow them.
        assert!((north_east[10] + 1.0).abs() < 0.1 && (north_east[12] - 1.0).abs() < 0.1, "{north_east:?}");
        assert!((north_west[10] - 1.0).abs() < 0.1 && (north_west[12] + 1.0).abs() < 0.1, "{north_west:?}");
    }

    /// The unit of the heights changes covariance, slopes and curvatures, and nothing else.
    #[test]
    fn prop_statistics_without_unit_keep_their_values() {
        let mut s = Streams::for_seed(2, "agreement-test").stream("noise");
        let z = Grid::new(Geometry::square(40, 50, 0.5), (0..2000).map(|_| s.normal()).collect());
        let (one, other) = (surface_statistics(&z, 4), surface_statistics(&z.map(|v| 8.0 * v), 4));
        for (a, b) in one.iter().zip(&other) {
            let factor = match a.name {
                "covariance" => 64.0,
                "slope_distribution" | "curvature_distribution" => 8.0,
                _ => 1.0,
            };
            let near = |(a, b): (&f64, &f64)| (factor * a - b).abs() < 1e-9 * (1.0 + b.abs());
            assert!(a.values.iter().zip(&b.values).all(near), "{}", a.name);
        }
    }

    /// A slope of 0.3 east and 0.4 north on oblong cells: 0.5 everywhere.
    #[test]
    fn val_slopes_of_a_plane() {
        let z = grid(7, 9, [0.5, 0.25], |x, y| 0.3 * x + 0.4 * y);
        assert!(values(&unfitted_statistics(&z, 2), "slope_distribution").iter().all(|s| (s - 0.5).abs() < 1e-12));
    }

    /// Waves that travel towards azimuth 60 degrees have their power in that sector, also with holes.
    #[test]
    fn val_power_lies_in_the_sector_of_the_waves() {
        let (sin, cos) = libm::sincos(60f64.to_radians());
        let mut z = grid(120, 150, [0.5, 0.4], |x, y| libm::sin(TAU * (x * sin + y * cos) / 4.0));
        z.values[3000..3400].fill(f64::NAN);
        let power = values(&unfitted_statistics(&z, 20), "directional_psd");
        let strongest = (0..SECTORS).max_by(|a, b| power[*a].total_cmp(&power[*b])).unwrap();
        assert_eq!(strongest, 2, "{power:?}");
        assert!(power[5] < power[2] - 4.0, "{power:?}");
    }

    /// Null: white noise. Flatness is 3 and third-order structure 0 at all lags; n = 40 000 cells, increments share cells, so
    /// standard errors are below 3 / 200; thresholds of 0.1 are beyond 6 standard errors (1e-9).
    #[test]
    fn stat_white_noise() {
        let mut s = Streams::for_seed(1, "agreement-test").stream("noise");
        let z = Grid::new(Geometry::square(200, 200, 1.0), (0..40_000).map(|_| s.normal()).collect());
        let all = unfitted_statistics(&z, 8);
        assert!(values(&all, "increment_flatness").iter().all(|v| (v - libm::log(3.0)).abs() < 0.1));
        assert!(values(&all, "third_order_structure").iter().all(|v| v.abs() < 0.1));
        // One in nine cells is the highest of its neighbourhood.
        assert!(values(&all, "extrema_density").iter().all(|v| (v - libm::log(1.0 / 9.0)).abs() < 0.1));
    }
}
