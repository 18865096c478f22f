//! Hurst exponent from the structure function.
//!
//! A self-affine surface has `D(h) = <(z(x + h) - z(x))^2> ~ |h|^(2H)`, 0 < H < 1 (Mandelbrot and Van Ness, 1968; H = 0 for
//! white noise, 1 for a plane). H is half the slope of log D over log h, by ordinary least squares over lags along x and along
//! y, half an octave apart, with a common slope and a separate intercept for each axis, so that neither oblong cells nor
//! anisotropy bias it. H depends on the range of lags, by default from 1 cell to an eighth of the shorter side. On a surface
//! with an inner or an outer scale, H holds for that range only.
//!
//! Standard error: delete-one jackknife over 4 x 4 blocks of the surface (a pair belongs to the block of its western or
//! northern cell). It covers sampling error within this surface, not misfit of the power law.
//!
//! Cost: one difference per cell and lag.

use rayon::prelude::*;
use sastrugi_numeric::{Grid, sums};
use serde::Serialize;

/// Blocks along each axis; the jackknife leaves out one at a time.
const BLOCKS: usize = 4;
/// Default largest lag over the shorter side.
const LAG_SHARE: f64 = 1.0 / 8.0;
/// Lags per doubling.
const LAGS_PER_OCTAVE: f64 = 2.0;
/// Fewest lags along each axis.
const LAGS_MIN: usize = 3;

/// A Hurst exponent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Hurst {
    /// H.
    pub exponent: f64,
    /// Jackknife standard error of H.
    pub standard_error: f64,
    /// Shortest and longest lag used, m.
    pub lags_m: [f64; 2],
}

/// Hurst exponent over `lags_m` (to the nearest cell). `None` with fewer than three lags along an axis, or if a lag has no pairs.
///
/// # Examples
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_roughness::hurst;
///
/// let geometry = Geometry::square(64, 64, 0.5);
/// let plane = Grid::new(geometry, (0..64 * 64).map(|k| geometry.x(k % 64) - 2.0 * geometry.y(k / 64)).collect());
/// let found = hurst(&plane, Some([0.5, 4.0])).unwrap();
/// assert!((found.exponent - 1.0).abs() < 1e-9);
/// assert_eq!(found.lags_m, [0.5, 4.0]);
/// assert!(hurst(&Grid::filled(geometry, 1.0), None).is_none());
/// ```
pub fn hurst(dem: &Grid, lags_m: Option<[f64; 2]>) -> Option<Hurst> {
    let g = &dem.geometry;
    let side = g.size()[0].min(g.size()[1]);
    let [low, high] = lags_m.unwrap_or([g.cell[0].max(g.cell[1]), LAG_SHARE * side]);
    let lags: Vec<Lag> = [0, 1].into_iter().flat_map(|axis| lags_along(axis, dem, [low, high])).collect();
    if [0, 1].iter().any(|axis| lags.iter().filter(|l| l.axis == *axis).count() < LAGS_MIN) {
        return None;
    }
    let blocks: Vec<Vec<Sum>> = lags.par_iter().map(|lag| sums_by_block(dem, lag)).collect();
    let without = |left_out: Option<usize>| slope(&lags, &blocks, left_out).filter(|h| h.is_finite());
    let exponent = without(None)?;
    let partial = (0..BLOCKS * BLOCKS).map(|k| without(Some(k))).collect::<Option<Vec<f64>>>()?;
    let standard_error = ((partial.len() - 1) as f64 * sums::variance(&partial)).sqrt();
    let ends = lags.iter().fold([f64::INFINITY, 0.0], |[a, b], l| [a.min(l.lag_m), f64::max(b, l.lag_m)]);
    Some(Hurst { exponent, standard_error, lags_m: ends })
}

/// A lag along x (axis 0) or y (axis 1).
struct Lag {
    axis: usize,
    cells: usize,
    lag_m: f64,
}

/// Lags in whole cells, from the one nearest to the lower end up to the upper end, half an octave apart where that exceeds one
/// cell; at most half the side.
fn lags_along(axis: usize, dem: &Grid, [low, high]: [f64; 2]) -> Vec<Lag> {
    let cell = dem.geometry.cell[axis];
    let most = [dem.cols(), dem.rows()][axis] / 2;
    let mut all: Vec<usize> = (0..64)
        .map(|k| low.max(cell) / cell * libm::exp2(f64::from(k) / LAGS_PER_OCTAVE))
        .take_while(|lag| *lag <= most as f64)
        .map(|lag| lag.round() as usize)
        .collect();
    all.dedup();
    let lag = |cells: usize| Lag { axis, cells, lag_m: cells as f64 * cell };
    all.into_iter().map(lag).take_while(|l| l.lag_m <= high * (1.0 + 1e-9)).collect()
}

/// Sum of squared increments, and number of pairs.
#[derive(Clone, Copy, Default)]
struct Sum {
    squares: f64,
    pairs: f64,
}

impl Sum {
    fn and(self, other: Self) -> Self {
        Self { squares: self.squares + other.squares, pairs: self.pairs + other.pairs }
    }
}

/// Sums over the pairs of a lag by the block of their western or northern cell.
fn sums_by_block(dem: &Grid, lag: &Lag) -> Vec<Sum> {
    let (rows, cols) = (dem.rows(), dem.cols());
    let (down, right) = if lag.axis == 0 { (0, lag.cells) } else { (lag.cells, 0) };
    let mut blocks = vec![Sum::default(); BLOCKS * BLOCKS];
    let edge = |k: usize, n: usize| k * n / BLOCKS;
    for block_row in 0..BLOCKS {
        for r in edge(block_row, rows)..edge(block_row + 1, rows).min(rows - down) {
            let (here, there) = (dem.row(r), dem.row(r + down));
            for block_col in 0..BLOCKS {
                let (from, to) = (edge(block_col, cols), edge(block_col + 1, cols).min(cols - right));
                if from < to {
                    let block = &mut blocks[block_row * BLOCKS + block_col];
                    *block = block.and(of_run(&here[from..to], &there[from + right..to + right]));
                }
            }
        }
    }
    blocks
}

/// Number of parallel accumulators; fixed, so that the order of summation is the same on every machine.
const LANES: usize = 8;

/// Sum over the pairs of two equally long runs of cells.
fn of_run(a: &[f64], b: &[f64]) -> Sum {
    let (mut squares, mut pairs) = ([0.0; LANES], [0.0; LANES]);
    let mut add = |lane: usize, a: f64, b: f64| {
        let d = a - b;
        let finite = is_finite(d);
        squares[lane] += if finite { d * d } else { 0.0 };
        pairs[lane] += if finite { 1.0 } else { 0.0 };
    };
    let (chunks_a, rest_a) = a.as_chunks::<LANES>();
    let (chunks_b, rest_b) = b.as_chunks::<LANES>();
    for (a, b) in chunks_a.iter().zip(chunks_b) {
        (0..LANES).for_each(|k| add(k, a[k], b[k]));
    }
    rest_a.iter().zip(rest_b).for_each(|(a, b)| add(0, *a, *b));
    let total = |lanes: [f64; LANES]| lanes.into_iter().fold(0.0, |total, lane| total + lane);
    Sum { squares: total(squares), pairs: total(pairs) }
}

/// As [`f64::is_finite`], which is compiled to a comparison of 64-bit integers; the vectors that every CPU has only compare floats.
#[inline(always)]
pub(crate) fn is_finite(value: f64) -> bool {
    value * 0.0 == 0.0
}

/// Half the common slope of log D over log h.
fn slope(lags: &[Lag], blocks: &[Vec<Sum>], left_out: Option<usize>) -> Option<f64> {
    let joined = |sums: &Vec<Sum>| {
        let kept = sums.iter().enumerate().filter(|(k, _)| Some(*k) != left_out);
        kept.fold(Sum::default(), |total, (_, s)| total.and(*s))
    };
    let mut points: [Vec<[f64; 2]>; 2] = Default::default();
    for (lag, sums) in lags.iter().zip(blocks) {
        let sum = joined(sums);
        points[lag.axis].push([libm::log(lag.lag_m), libm::log(sum.squares / sum.pairs)]);
    }
    let (mut along, mut squares) = (0.0, 0.0);
    for points in &points {
        let mean = |k: usize| sums::mean(&points.iter().map(|p| p[k]).collect::<Vec<_>>());
        let (x0, y0) = (mean(0), mean(1));
        along += points.iter().map(|p| (p[0] - x0) * (p[1] - y0)).sum::<f64>();
        squares += points.iter().map(|p| (p[0] - x0) * (p[0] - x0)).sum::<f64>();
    }
    (squares > 0.0).then_some(0.5 * along / squares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2};
    use sastrugi_numeric::{Geometry, Stream, Streams};

    fn stream(purpose: &str) -> Stream {
        Streams::for_seed(1, "hurst-test").stream(purpose)
    }

    /// The sum over a run, with pairs of eight lanes in turn and the rest in the first, by bits; NaN, infinity and differences that overflow are
    /// no pairs.
    #[test]
    fn prop_runs_are_summed_lane_by_lane() {
        let mut s = stream("runs");
        let mut value = |k: usize| match k % 13 {
            5 => [f64::NAN, f64::INFINITY, f64::MAX, -f64::MAX][k / 13 % 4],
            _ => s.normal(),
        };
        for n in (0..40).chain([1000]) {
            let [a, b]: [Vec<f64>; 2] = [0, 13].map(|shift| (0..n).map(|k| value(k + shift)).collect());
            let mut lanes = [Sum::default(); LANES];
            for k in (0..n).filter(|&k| (a[k] - b[k]).is_finite()) {
                let lane = if k < n / LANES * LANES { k % LANES } else { 0 };
                lanes[lane] = lanes[lane].and(Sum { squares: (a[k] - b[k]) * (a[k] - b[k]), pairs: 1.0 });
            }
            let (expected, found) = (lanes.into_iter().fold(Sum::default(), Sum::and), of_run(&a, &b));
            assert_eq!((found.squares.to_bits(), found.pairs), (expected.squares.to_bits(), expected.pairs), "{n}");
        }
        for value in [0.0, -0.0, 5e-324, -1.5, f64::MAX, -f64::MAX, f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
            assert_eq!(is_finite(value), value.is_finite(), "{value}");
        }
    }

    #[test]
    fn val_a_plane_has_exponent_one() {
        let g = Geometry { rows: 90, cols: 120, cell: [0.5, 0.8], origin: [0.0; 2] };
        let dem = Grid::new(g, (0..g.len()).map(|k| 0.3 * g.x(k % 120) + g.y(k / 120)).collect());
        let found = hurst(&dem, None).unwrap();
        assert!((found.exponent - 1.0).abs() < 1e-10 && found.standard_error < 1e-10, "{found:?}");
        // From the coarser cell, 0.8 m, to at most an eighth of 60 m: 2, 3, 5, 6, 9 and 13 cells along x, 1, 2, 3, 4, 6 and 8 along y.
        assert!((found.lags_m[0] - 0.8).abs() < 1e-12 && (found.lags_m[1] - 6.5).abs() < 1e-12, "{found:?}");
    }

    /// White noise: H = 0. Threshold 7 jackknife standard errors (of 16 blocks: t of 15 degrees of freedom, 4e-6), which
    /// must themselves be below 0.01; also with a third of the cells missing.
    #[test]
    fn stat_white_noise_has_exponent_zero() {
        for hole_share in [0.0, 0.33] {
            let mut s = stream("white");
            let mut value = || if s.uniform() < hole_share { f64::NAN } else { s.normal() };
            let dem = Grid::new(Geometry::square(300, 400, 0.1), (0..120_000).map(|_| value()).collect());
            let found = hurst(&dem, None).unwrap();
            assert!(found.exponent.abs() < 7.0 * found.standard_error && found.standard_error < 0.01, "{found:?}");
        }
    }

    /// The sum of two Brownian lines, one along each axis: H = 1/2 exactly along both. Threshold as above.
    #[test]
    fn stat_brownian_lines_have_exponent_one_half() {
        let mut s = stream("walk");
        let mut walk = || -> Vec<f64> {
            let mut z = 0.0;
            let mut step = || {
                z += s.normal();
                z
            };
            (0..1024).map(|_| step()).collect()
        };
        let (east, south) = (walk(), walk());
        let dem = Grid::new(
            Geometry::square(1024, 1024, 0.1),
            (0..1 << 20).map(|k| east[k % 1024] + south[k / 1024]).collect(),
        );
        let found = hurst(&dem, Some([0.1, 6.4])).unwrap();
        assert!((found.exponent - 0.5).abs() < 7.0 * found.standard_error, "{found:?}");
        assert!(found.standard_error < 0.08, "{found:?}");
    }

    /// Density `f^(-2 (H + 1))` at a mode of a surface sampled every cell, f in modes, including aliases from beyond the Nyquist
    /// frequency.
    fn sampled_density(kx: f64, ky: f64, n: f64, h: f64) -> f64 {
        let aliases = (-2..=2).flat_map(|i| (-2..=2).map(move |j| (kx + f64::from(i) * n, ky + f64::from(j) * n)));
        aliases.map(|(x, y)| libm::pow(x * x + y * y, -h - 1.0)).sum()
    }

    /// Periodic surfaces of exponent H, at lags of 1 to 4 cells of 256. The missing power below one cycle per period raises H by
    /// 0.01 to 0.03, sampling scatters by 0.01; tolerance 0.06. Catches the slope of D mistaken for H, and semivariances at
    /// wrong lags.
    #[test]
    fn stat_fractional_surfaces() {
        for h in [0.3, 0.5, 0.7] {
            let n = 256;
            let mut s = stream("fractional");
            let noise: Vec<f64> = (0..n * n).map(|_| s.normal()).collect();
            let fft = RealFft2::new(n, n);
            let mut spectrum: HalfSpectrum = fft.forward(&noise);
            for (kx, column) in spectrum.values.chunks_exact_mut(n).enumerate() {
                for (ky, v) in column.iter_mut().enumerate().filter(|(ky, _)| kx + ky > 0) {
                    *v *= sampled_density(kx as f64, ky.min(n - ky) as f64, n as f64, h).sqrt();
                }
            }
            spectrum.values[0] = Complex64::default();
            let dem = Grid::new(Geometry::square(n, n, 1.0), fft.inverse(spectrum));
            let found = hurst(&dem, Some([1.0, 4.0])).unwrap();
            assert!((found.exponent - h).abs() < 0.06, "{h}: {found:?}");
            assert!(found.standard_error < 0.04, "{found:?}");
        }
    }

    #[test]
    fn val_surfaces_without_a_hurst_exponent() {
        assert!(hurst(&Grid::filled(Geometry::square(300, 300, 1.0), f64::NAN), None).is_none());
        assert!(hurst(&Grid::filled(Geometry::square(300, 300, 1.0), 1.0), None).is_none());
        assert!(hurst(&Grid::filled(Geometry::square(3, 3, 1.0), 1.0), None).is_none());
        assert!(hurst(&Grid::filled(Geometry::square(1, 1, 1.0), 1.0), Some([1.0, 9.0])).is_none());
        let spike = Grid::new(Geometry::square(64, 64, 1.0), (0..4096).map(f64::from).collect());
        assert!(hurst(&spike, Some([9.0, 3.0])).is_none());
    }
}
