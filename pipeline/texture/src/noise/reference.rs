//! Estimates the noise of a DEM from a part of it that is smooth in reality (a road, a roof, still water under ice).
//!
//! Second differences `z(-k) - 2 z(0) + z(k)` along rows and along columns remove height and slope. Their robust standard deviation
//! (1.4826 times the median absolute value: Hampel, 1974) is little affected by the edge of a kerb. Over k cells of side d, noise with
//! white variance `w` and correlated variance `c` of range `r` has
//!
//! `V(k) = 6 w + c (6 - 8 exp(-(k d / r)^2) + 2 exp(-(2 k d / r)^2))`,
//!
//! so that V over separations from one cell to a quarter of the reference separates the two: weighted least squares, `w` and `c` not
//! negative, `r` by search. Correlated noise is reported if it improves the fit of V by more than [`GAIN_MIN`]; with white noise
//! alone this happens in fewer than 1 reference in 200. Relief of the reference that looks like such noise counts as noise. If V still
//! grows at the widest separation, or the formula misses it by a factor of [`MISS_MAX`], only white noise is reported, from the shortest
//! separation.

use super::Noise;
use crate::sizes::{NORMAL_CONSISTENCY, Sizes};
use sastrugi_numeric::Grid;
use sastrugi_schemas::counted;

/// Fewest differences; their robust standard deviation is then accurate to about a sixth.
const DIFFERENCES_MIN: u64 = 100;
/// Separations, cells.
const SEPARATIONS: [usize; 10] = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32];
/// Largest separation, as a share of the reference's rows or columns.
const SEPARATION_SHARE: f64 = 0.25;
/// Relative variance of V times the number of differences, for white noise: 2 for a variance, 2.7 for the median, 1.94 because
/// neighbouring differences share cells.
const VARIANCE_OF_ONE: f64 = 10.5;
/// Gain in chi-squared from which noise counts as correlated: p = 0.001 for two parameters. The largest gain in 510 simulated
/// references with white noise alone was 7.3.
const GAIN_MIN: f64 = 13.8;
/// Largest ratio of observed to fitted variance, or the reverse. The largest in 240 simulated references, correlated over up to
/// a quarter of their width, was 1.77.
const MISS_MAX: f64 = 2.0;
/// Second differences below this share of the largest height count as rounding (below this, in m, if no height exceeds 1 m).
const ROUNDING: f64 = 1e-11;
/// Ranges tried, in steps of 5 %.
const RANGE_STEP: f64 = 1.05;
/// Shortest range tried, cells; noise with a shorter range is practically white.
const RANGE_MIN_CELLS: f64 = 0.7;

/// Noise found in a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceNoise {
    /// The noise.
    pub noise: Noise,
    /// Second differences between neighbouring cells.
    pub differences: u64,
    /// Longest separation used, m, if the differences up to it match neither white noise nor correlated noise of a resolvable range:
    /// relief, or noise with a range beyond the width of the reference.
    pub unresolved_to_m: Option<f64>,
}

/// Why no noise can be estimated from a reference.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoiseError {
    /// Too small, or full of holes.
    #[error(
        "the noise reference has {} of three neighbouring cells with data within the DEM (and its window); at least \
         {DIFFERENCES_MIN} are needed: use a larger reference",
        counted(.found, "run")
    )]
    TooSmall {
        /// Runs found.
        found: u64,
    },
    /// More than half of it is exactly plane.
    #[error(
        "the noise reference is an exact plane: its heights were interpolated or rounded, so they show no noise; use another one"
    )]
    Plane,
}

/// Noise of the cells with data in `reference` (m; NaN outside it).
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid, Streams};
/// use sastrugi_texture::noise::of_reference;
///
/// // A sloping road, measured with noise of 1 cm: slope and height do not count.
/// let mut stream = Streams::for_seed(1, "example").stream("noise");
/// let g = Geometry::square(60, 60, 0.5);
/// let road = Grid::new(g, (0..g.len()).map(|k| 300.0 + 0.08 * g.x(k % 60) + 0.01 * stream.normal()).collect());
/// let found = of_reference(&road).unwrap();
/// assert_eq!(found.differences, 2 * 60 * 58);
/// assert!((found.noise.white_sigma_m / 0.01 - 1.0).abs() < 0.2);
/// ```
///
/// # Errors
/// A reference that is too small, or exactly plane.
pub fn of_reference(reference: &Grid) -> Result<ReferenceNoise, NoiseError> {
    let largest_m = reference.range().map_or(0.0, |(low, high)| low.abs().max(high.abs()));
    let [along, across] = [0, 1].map(|axis| second_differences(reference, axis, 1));
    let differences = along.count() + across.count();
    if differences < DIFFERENCES_MIN {
        return Err(NoiseError::TooSmall { found: differences });
    }
    if along.with(&across).exceeded_by(0.5) <= ROUNDING * largest_m.max(1.0) {
        return Err(NoiseError::Plane);
    }
    let observed = observed(reference);
    let white = least_squares(&observed, None);
    let longest_m = observed.iter().map(|o| o.separation_m).fold(0.0, f64::max);
    let shortest_m = RANGE_MIN_CELLS * reference.geometry.cell[0].min(reference.geometry.cell[1]);
    let ranges_m = std::iter::successors(Some(shortest_m), |r| Some(r * RANGE_STEP)).take_while(|r| *r <= longest_m);
    let better = |a: Solution, b: Solution| if b.chi2 < a.chi2 { b } else { a };
    let correlated = ranges_m.map(|range_m| least_squares(&observed, Some(range_m))).reduce(better);
    let found = |noise, unresolved_to_m| ReferenceNoise { noise, differences, unresolved_to_m };
    let Some(correlated) = correlated.filter(|s| white.chi2 - s.chi2 >= GAIN_MIN) else {
        return Ok(found(white.noise(), None));
    };
    // V has levelled off after two ranges.
    if 2.0 * correlated.range_m <= longest_m && observed.iter().all(|o| correlated.describes(o)) {
        return Ok(found(correlated.noise(), None));
    }
    let shortest = observed.iter().filter(|o| o.cells == 1);
    let white_m2 = shortest.map(|o| o.variance_m2 / 6.0).fold(f64::INFINITY, f64::min);
    Ok(found(Noise { white_sigma_m: white_m2.sqrt(), ..Noise::default() }, Some(longest_m)))
}

/// Variance of the second differences over one separation in one direction.
struct Observed {
    cells: usize,
    separation_m: f64,
    variance_m2: f64,
    /// Squared inverse of its relative standard error, for white noise.
    weight: f64,
}

/// Variances by separation, the shortest first.
fn observed(reference: &Grid) -> Vec<Observed> {
    let sides = [reference.cols(), reference.rows()];
    let mut all = Vec::new();
    for separation in SEPARATIONS {
        for axis in [0, 1] {
            let sizes = second_differences(reference, axis, separation);
            let fits = separation == 1 || separation as f64 <= SEPARATION_SHARE * sides[axis] as f64;
            if fits && sizes.count() >= DIFFERENCES_MIN {
                let deviation_m = NORMAL_CONSISTENCY * sizes.exceeded_by(0.5);
                all.push(Observed {
                    cells: separation,
                    separation_m: separation as f64 * reference.geometry.cell[axis],
                    variance_m2: deviation_m * deviation_m,
                    weight: sizes.count() as f64 / VARIANCE_OF_ONE,
                });
            }
        }
    }
    all
}

/// Sizes of the second differences over `separation` cells along rows (axis 0) or columns (axis 1).
fn second_differences(grid: &Grid, axis: usize, separation: usize) -> Sizes {
    let (rows, cols) = (grid.rows(), grid.cols());
    let [down, across] = if axis == 0 { [0, separation] } else { [separation, 0] };
    let mut sizes = Sizes::new();
    for r in down..rows.saturating_sub(down) {
        let [above, own, below] = [r - down, r, r + down].map(|r| grid.row(r));
        let difference = |c: usize| above[c - across] - 2.0 * own[c] + below[c + across];
        sizes.add(&(across..cols.saturating_sub(across)).map(difference).collect::<Vec<_>>());
    }
    sizes
}

/// Variances of white and correlated noise, m2, and their misfit.
#[derive(Clone, Copy)]
struct Solution {
    chi2: f64,
    white_m2: f64,
    correlated_m2: f64,
    range_m: f64,
}

impl Solution {
    /// True if the fitted variance is near the observed one.
    fn describes(&self, o: &Observed) -> bool {
        let fitted_m2 =
            6.0 * self.white_m2 + self.correlated_m2 * correlated_second_difference(o.separation_m / self.range_m);
        (1.0 / MISS_MAX..=MISS_MAX).contains(&(o.variance_m2 / fitted_m2))
    }

    fn noise(&self) -> Noise {
        Noise {
            white_sigma_m: self.white_m2.sqrt(),
            correlated_sigma_m: self.correlated_m2.sqrt(),
            correlated_range_m: if self.correlated_m2 > 0.0 { self.range_m } else { 0.0 },
        }
    }
}

/// The best non-negative variances: of white noise alone, or of white plus correlated noise of a given range. Errors are relative.
fn least_squares(observed: &[Observed], range_m: Option<f64>) -> Solution {
    let seen = |o: &Observed| {
        let correlated = range_m.map_or(0.0, |r| correlated_second_difference(o.separation_m / r));
        [6.0 / o.variance_m2, correlated / o.variance_m2]
    };
    let (mut matrix, mut vector) = ([[0.0; 2]; 2], [0.0; 2]);
    for o in observed {
        let terms = seen(o);
        for i in 0..2 {
            vector[i] += o.weight * terms[i];
            (0..2).for_each(|j| matrix[i][j] += o.weight * terms[i] * terms[j]);
        }
    }
    let alone = |k: usize| if matrix[k][k] > 0.0 { vector[k] / matrix[k][k] } else { 0.0 };
    let determinant = matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0];
    let both = [
        (vector[0] * matrix[1][1] - vector[1] * matrix[0][1]) / determinant,
        (vector[1] * matrix[0][0] - vector[0] * matrix[1][0]) / determinant,
    ];
    let chi2 = |x: &[f64; 2]| -> f64 {
        let error = |o: &Observed| 1.0 - seen(o).iter().zip(x).map(|(t, x)| t * x).sum::<f64>();
        observed.iter().map(|o| o.weight * error(o) * error(o)).sum()
    };
    [both, [alone(0), 0.0], [0.0, alone(1)]]
        .into_iter()
        .filter(|x| x.iter().all(|v| v.is_finite() && *v >= 0.0))
        .map(|x| Solution { chi2: chi2(&x), white_m2: x[0], correlated_m2: x[1], range_m: range_m.unwrap_or(0.0) })
        .min_by(|a, b| a.chi2.total_cmp(&b.chi2))
        .unwrap_or(Solution { chi2: f64::INFINITY, white_m2: 0.0, correlated_m2: 0.0, range_m: 0.0 })
}

/// Variance of a second difference of unit noise with a Gaussian correlation, over a separation in ranges.
fn correlated_second_difference(ranges: f64) -> f64 {
    let at = |x: f64| libm::exp(-x * x);
    6.0 - 8.0 * at(ranges) + 2.0 * at(2.0 * ranges)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::filtered::Measurement;
    use crate::covariance::{Covariance, Structure, models};
    use crate::fit::simulate::{Shape, Simulator};
    use sastrugi_numeric::{Geometry, Streams};

    const CELL_M: f64 = 0.1;

    /// A slope of 2 % with noise, of the given rows and columns.
    fn road(noise: Noise, [rows, cols]: [usize; 2], seed: u64) -> Grid {
        // The simulator adds measurement noise to a surface, here a flat one.
        let model: &'static dyn crate::covariance::Model = &models::exponential::Exponential;
        let flat = Covariance {
            structures: vec![Structure { model, sigma_m: 1e-9, range_m: CELL_M, shape: 0.0 }],
            nugget_m2: 0.0,
            ratio: 1.0,
            azimuth_deg: 0.0,
        };
        let measurement = Measurement { inner_scale_m: 0.0, noise };
        let shape = Shape { rows, cols, profiles: false };
        let simulator = Simulator::new(&flat, measurement, shape, [CELL_M; 2], 1.0);
        let mut heights = simulator.surface(&Streams::for_seed(seed, "noise-test"));
        heights.iter_mut().enumerate().for_each(|(k, z)| *z += 100.0 + 0.002 * (k % cols) as f64);
        Grid::new(Geometry::square(rows, cols, CELL_M), heights)
    }

    fn white(sigma_m: f64) -> Noise {
        Noise { white_sigma_m: sigma_m, ..Noise::default() }
    }

    /// White noise of 7 mm on a slope with a step (a kerb). Null: 2 * 200 * 198 differences, of which neighbours share cells;
    /// their robust deviation is accurate to about 0.6 %; limit 4 %, including the effect of the kerb's cells.
    #[test]
    fn stat_noise_on_a_slope_is_found() {
        let mut grid = road(white(0.007), [200, 200], 3);
        grid.values.iter_mut().enumerate().filter(|(k, _)| k % 200 > 120).for_each(|(_, z)| *z += 0.15);
        let found = of_reference(&grid).unwrap();
        assert_eq!(found.differences, 2 * 200 * 198);
        assert!((found.noise.white_sigma_m / 0.007 - 1.0).abs() < 0.04, "{found:?}");
    }

    /// White noise is not reported as correlated. Null: at most 1 in 200 by chance; more than 4 of 200 have a
    /// probability of 0.004.
    #[test]
    fn stat_white_noise_is_white() {
        let correlated = (0..200)
            .filter(|seed| of_reference(&road(white(0.01), [60, 100], *seed)).unwrap().noise.correlated_sigma_m > 0.0);
        assert!(correlated.count() <= 4);
    }

    /// Matching noise plus white noise. In 20 references of 40 x 100 cells simulated independently sigma scattered by 5 % and
    /// the range by 8 % at 3 cells; 16 references: limits of four standard errors.
    #[test]
    fn stat_correlated_noise_is_separated_from_white_noise() {
        let truth = Noise { white_sigma_m: 0.01, correlated_sigma_m: 0.01, correlated_range_m: 0.3 };
        let found: Vec<Noise> =
            (0..16).map(|seed| of_reference(&road(truth, [40, 100], seed)).unwrap().noise).collect();
        let mean = |of: fn(&Noise) -> f64| found.iter().map(of).sum::<f64>() / 16.0;
        let [sigma, correlated, range] =
            [mean(|n| n.white_sigma_m), mean(|n| n.correlated_sigma_m), mean(|n| n.correlated_range_m)];
        println!("white {sigma} m, correlated {correlated} m over {range} m");
        assert!((sigma / 0.01 - 1.0).abs() < 0.03, "{sigma}");
        assert!((correlated / 0.01 - 1.0).abs() < 0.05, "{correlated}");
        assert!((range / 0.3 - 1.0).abs() < 0.08, "{range}");
    }

    /// Large-scale relief, in one direction or in both, does not count as correlated noise.
    #[test]
    fn val_a_curved_reference_gives_white_noise_only() {
        bent([1.0, 0.0]);
        bent([0.0, 1.0]);
        bent([1.0, 1.0]);
    }

    fn bent([along, across]: [f64; 2]) {
        let mut grid = road(white(0.002), [200, 200], 5);
        let bump = |k: usize| 0.4 * libm::sin(std::f64::consts::PI * k as f64 / 200.0);
        grid.values.iter_mut().enumerate().for_each(|(k, z)| *z += along * bump(k % 200) + across * bump(k / 200));
        let found = of_reference(&grid).unwrap();
        assert!(found.unresolved_to_m.is_some(), "{found:?}");
        assert!(
            found.noise.correlated_sigma_m == 0.0 && (found.noise.white_sigma_m / 0.002 - 1.0).abs() < 0.05,
            "{found:?}"
        );
    }

    #[test]
    fn val_references_without_noise() {
        let plane = Grid::new(Geometry::square(20, 20, 1.0), (0..400).map(|k| 5.0 + 0.25 * (k % 20) as f64).collect());
        assert_eq!(of_reference(&plane), Err(NoiseError::Plane));
        assert_eq!(of_reference(&plane.map(|_| 0.0)), Err(NoiseError::Plane));
        let small = Grid::new(Geometry::square(5, 5, 1.0), (0..25).map(|k| (k * k % 7) as f64).collect());
        assert_eq!(of_reference(&small), Err(NoiseError::TooSmall { found: 30 }));
        let none = small.map(|_| f64::NAN);
        assert_eq!(of_reference(&none), Err(NoiseError::TooSmall { found: 0 }));
        for (found, runs) in [(1, "has 1 run of three"), (30, "has 30 runs of three")] {
            let sentence = NoiseError::TooSmall { found }.to_string();
            assert!(sentence.contains(runs), "{sentence}");
        }
    }
}
