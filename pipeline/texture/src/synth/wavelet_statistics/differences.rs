//! Weighted differences between neighbouring cells: their distributions, and fields with given distributions of them.
//!
//! Differences D_i z (increments over 1, 2, 4 ... cells along rows and columns and over one cell along diagonals, the Laplacian, the height
//! itself) are the finite-difference wavelets of a surface. A distribution is imposed on each by the monotone map between quantiles,
//! `d_i = M_i(D_i z)`, and the surface that comes nearest to all of them is
//!
//! `z + F^-1[ F( sum w_i D_i' (d_i - D_i z) ) / sum w_i |F D_i|^2 ]`, `1 / w_i` the sum of the squared weights of D_i
//!
//! (Heeger and Bergen 1995, with differences in place of subbands). After a few repetitions all distributions are nearly met.

use crate::synth::statistics::{spectrum, tails};
use rayon::prelude::*;
use sastrugi_numeric::Grid;
use sastrugi_numeric::fft::{HalfSpectrum, RealFft2};
use sastrugi_schemas::statistics::Difference;

/// Longest lag of an increment, cells.
const LAG_MAX: usize = 64;

/// Cells of a difference: rows south, columns east, weight.
type Stencil = Vec<(i32, i32, f64)>;

/// The differences of a residual, with lags up to `lag_max` cells and quantiles at `probabilities`.
pub fn measure(residual: &Grid, probabilities: &[f64], lag_max: usize) -> Vec<Difference> {
    let with_quantiles = |stencil: Stencil| {
        let mut values = of_grid(residual, &stencil);
        // A difference that no cell has says nothing.
        let quantiles_m = tails::quantiles(&mut values, probabilities);
        (!values.is_empty()).then_some(Difference { stencil, quantiles_m })
    };
    stencils(residual.geometry.cell, lag_max).into_iter().filter_map(with_quantiles).collect()
}

/// All differences for cells of `cell_m` east-west and north-south.
fn stencils(cell_m: [f64; 2], lag_max: usize) -> Vec<Stencil> {
    let lags =
        std::iter::successors(Some(1_i32), |lag| Some(lag * 2)).take_while(|lag| *lag <= lag_max.min(LAG_MAX) as i32);
    let increments = lags.flat_map(|lag| [vec![(0, 0, -1.0), (0, lag, 1.0)], vec![(0, 0, 1.0), (lag, 0, -1.0)]]);
    let diagonals = [vec![(0, 0, -1.0), (1, 1, 1.0)], vec![(0, 0, 1.0), (1, -1, -1.0)]];
    // Second derivatives, with the shorter side of a cell as the unit.
    let [east, south] = spectrum::weights(cell_m);
    let laplacian = vec![(0, 0, -2.0 * (east + south)), (0, 1, east), (0, -1, east), (1, 0, south), (-1, 0, south)];
    increments.chain(diagonals).chain([laplacian, vec![(0, 0, 1.0)]]).collect()
}

/// A difference at every cell of a raster where all its cells have data.
fn of_grid(z: &Grid, stencil: &Stencil) -> Vec<f64> {
    let (rows, cols) = (z.rows() as isize, z.cols() as isize);
    let at = |r: isize, c: isize| match (0..rows).contains(&r) && (0..cols).contains(&c) {
        true => z.at(r as usize, c as usize),
        false => f64::NAN,
    };
    let value = |r: isize, c: isize| -> f64 {
        stencil.iter().map(|&(south, east, weight)| weight * at(r + south as isize, c + east as isize)).sum()
    };
    let lines: Vec<Vec<f64>> =
        (0..rows).into_par_iter().map(|r| (0..cols).map(|c| value(r, c)).filter(|d| d.is_finite()).collect()).collect();
    lines.concat()
}

/// Differences with the distributions they shall have, on a torus.
pub struct Matcher<'a> {
    differences: &'a [Difference],
    probabilities: &'a [f64],
    rows: usize,
    cols: usize,
    /// `sum w_i |F D_i|^2` in the order of a half spectrum.
    normal: Vec<f64>,
}

impl<'a> Matcher<'a> {
    /// The differences of a fit on a torus with the given transform; one of them must be the height.
    pub fn new(
        differences: &'a [Difference],
        probabilities: &'a [f64],
        fft: &RealFft2,
        [rows, cols]: [usize; 2],
    ) -> Self {
        let mut normal = vec![0.0; (cols / 2 + 1) * rows];
        for difference in differences {
            let mut impulse = vec![0.0; rows * cols];
            impulse[0] = 1.0;
            let response = fft.forward(&applied(&difference.stencil, &impulse, cols, 1));
            let weight = weight(&difference.stencil);
            normal.iter_mut().zip(&response.values).for_each(|(sum, v)| *sum += weight * v.norm_sqr());
        }
        Self { differences, probabilities, rows, cols, normal }
    }

    /// Moves a field towards the distributions.
    pub fn step(&self, field: &mut [f64], fft: &RealFft2) {
        let mut pull = vec![0.0; field.len()];
        for Difference { stencil, quantiles_m } in self.differences {
            let weight = weight(stencil);
            let mut wanted = applied(stencil, field, self.cols, 1);
            let own = tails::quantiles(&mut wanted.clone(), self.probabilities);
            wanted.par_iter_mut().with_min_len(1 << 12).for_each(|d| {
                *d = weight * (tails::interpolated(&own, quantiles_m, *d) - *d);
            });
            let back = applied(stencil, &wanted, self.cols, -1);
            pull.iter_mut().zip(&back).for_each(|(sum, d)| *sum += d);
        }
        let HalfSpectrum { mut values, .. } = fft.forward(&pull);
        values.iter_mut().zip(&self.normal).for_each(|(v, normal)| *v /= *normal);
        let moved = fft.inverse(HalfSpectrum { rows: self.rows, cols: self.cols, values });
        field.iter_mut().zip(&moved).for_each(|(z, d)| *z += d);
    }
}

/// One over the sum of the squared weights of a difference, the mean of `|F D|^2`.
fn weight(stencil: &Stencil) -> f64 {
    1.0 / stencil.iter().map(|(_, _, weight)| weight * weight).sum::<f64>()
}

/// A difference of a field on a torus; with a `sign` of -1 its transpose.
fn applied(stencil: &Stencil, field: &[f64], cols: usize, sign: isize) -> Vec<f64> {
    let rows = (field.len() / cols) as isize;
    let mut out = vec![0.0; field.len()];
    out.par_chunks_mut(cols).enumerate().for_each(|(r, line)| {
        for &(south, east, weight) in stencil {
            let from = (r as isize + sign * south as isize).rem_euclid(rows) as usize * cols;
            let shift = (sign * east as isize).rem_euclid(cols as isize) as usize;
            let source = &field[from..from + cols];
            let (wrapped, ahead) = source.split_at(shift);
            let (near, far) = line.split_at_mut(cols - shift);
            near.iter_mut().zip(ahead).for_each(|(o, v)| *o += weight * v);
            far.iter_mut().zip(wrapped).for_each(|(o, v)| *o += weight * v);
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams, sums};

    fn noise(n: usize, purpose: &str) -> Vec<f64> {
        let mut stream = Streams::for_seed(1, "differences-test").stream(purpose);
        (0..n).map(|_| stream.normal()).collect()
    }

    #[test]
    fn val_stencils_by_hand() {
        let found = stencils([0.5, 1.0], 5);
        assert_eq!(found.len(), 2 * 3 + 2 + 2);
        assert_eq!(found[2], [(0, 0, -1.0), (0, 2, 1.0)]);
        assert_eq!(found[3], [(0, 0, 1.0), (2, 0, -1.0)]);
        assert_eq!(found[8], [(0, 0, -2.5), (0, 1, 1.0), (0, -1, 1.0), (1, 0, 0.25), (-1, 0, 0.25)]);
    }

    /// A plane that rises 3 m a column and 5 m a row southwards: increments eastwards are 3, northwards -5; a hole removes every difference
    /// that touches it.
    #[test]
    fn val_differences_of_a_plane_with_a_hole() {
        let plane = |k: usize| 3.0 * (k % 7) as f64 + 5.0 * (k / 7) as f64;
        let mut z = Grid::new(Geometry::square(6, 7, 1.0), (0..42).map(plane).collect());
        z.values[17] = f64::NAN;
        let all = stencils([1.0; 2], 1);
        let found: Vec<Vec<f64>> = all.iter().map(|s| of_grid(&z, s)).collect();
        let expected = [(3.0, 34), (-5.0, 33), (8.0, 28), (-2.0, 28), (0.0, 15)];
        for (k, (value, count)) in expected.into_iter().enumerate() {
            assert!(found[k].len() == count && found[k].iter().all(|d| *d == value), "{k}: {:?}", found[k]);
        }
    }

    /// On a torus: the definition, and `<D x, y> = <x, D' y>`.
    #[test]
    fn prop_the_transpose_of_a_difference() {
        let (rows, cols) = (5, 8);
        let (x, y) = (noise(40, "x"), noise(40, "y"));
        for stencil in stencils([1.0, 0.5], 4) {
            let forward = applied(&stencil, &x, cols, 1);
            for (k, found) in forward.iter().enumerate() {
                let cell = |south: i32, east: i32| {
                    let r = (k / cols) as i32 + south;
                    let c = (k % cols) as i32 + east;
                    x[r.rem_euclid(rows) as usize * cols + c.rem_euclid(cols as i32) as usize]
                };
                let expected: f64 = stencil.iter().map(|&(s, e, w)| w * cell(s, e)).sum();
                assert!((found - expected).abs() < 1e-12);
            }
            let back = applied(&stencil, &y, cols, -1);
            let [one, other] =
                [(&forward, &y), (&x, &back)].map(|(a, b)| a.iter().zip(b.iter()).map(|(a, b)| a * b).sum::<f64>());
            assert!((one - other).abs() < 1e-11, "{one} {other}");
        }
    }

    /// A field that has the distributions already stays as it is (but for increments across the edge of the raster, which are not among those
    /// measured); steps from a normal field bring the flatness of its increments from 3 to that of a field of spikes, 25.
    #[test]
    fn prop_steps_lead_to_the_distributions() {
        let side = 128;
        let geometry = Geometry::square(side, side, 1.0);
        let spikes: Vec<f64> = noise(side * side, "spikes").iter().map(|v| v * v * v).collect();
        let z = Grid::new(geometry, spikes);
        let probabilities = tails::probabilities();
        let differences = measure(&z, &probabilities, 4);
        let fft = RealFft2::new(side, side);
        let matcher = Matcher::new(&differences, &probabilities, &fft, [side; 2]);
        let flatness = |field: &[f64]| crate::synth::modulated::flatness_at(&Grid::new(geometry, field.to_vec()), 1);
        let mut own = z.values.clone();
        matcher.step(&mut own, &fft);
        let change: Vec<f64> = own.iter().zip(&z.values).map(|(a, b)| (a - b) * (a - b)).collect();
        assert!(sums::mean(&change) < 1e-3 * sums::variance(&z.values), "{}", sums::mean(&change));
        let mut field = noise(side * side, "start");
        assert!((flatness(&field) - 3.0).abs() < 0.3);
        (0..12).for_each(|_| matcher.step(&mut field, &fft));
        let (found, wanted) = (flatness(&field), flatness(&z.values));
        assert!(libm::log(found / wanted).abs() < 0.05, "{found} {wanted}");
    }
}
