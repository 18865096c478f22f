//! One round of the fit of shift, raise and tilt.

use super::centre_and_spread;
use crate::fit::least_squares::Cholesky;
use rayon::prelude::*;
use sastrugi_numeric::surface::Surface;
use sastrugi_numeric::{Grid, sums};

/// Tukey's constant: 95 % efficiency on normal data (Holland and Welsch, 1977).
const BIWEIGHT: f64 = 4.685;
/// Unknowns: two offsets, raise, two tilts.
const UNKNOWNS: usize = 5;
/// Rounds of the plane alone.
const PLANE_ROUNDS: usize = 10;

/// Where B is read, and the plane that is added to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// B is read this far east and north of a cell of A, m.
    pub offset: [f64; 2],
    /// Added at the centre of A, m.
    pub raise: f64,
    /// Added eastwards and northwards, m/m.
    pub tilt: [f64; 2],
}

/// A, its slopes, and B.
pub struct Overlay<'a> {
    a: &'a Grid,
    b: &'a Grid,
    /// `dz/dx` and `dz/dy` of A; NaN beside cells without data.
    slopes: Vec<[f64; 2]>,
    centre: [f64; 2],
    /// Half the extent of A: unit of the columns of the tilt.
    reach: [f64; 2],
}

impl<'a> Overlay<'a> {
    pub fn new(a: &'a Grid, b: &'a Grid) -> Self {
        let (g, size) = (a.geometry, a.geometry.size());
        let centre = [0, 1].map(|k| g.origin[k] + 0.5 * size[k]);
        Self { a, b, slopes: slopes(a), centre, reach: size.map(|s| 0.5 * s) }
    }

    /// A less B as moved, m.
    pub fn difference(&self, terms: &Terms) -> Vec<f64> {
        let g = self.a.geometry;
        let mut all = vec![f64::NAN; g.len()];
        all.par_chunks_mut(g.cols).enumerate().for_each(|(row, line)| {
            let y = g.y(row);
            for (col, d) in line.iter_mut().enumerate() {
                let x = g.x(col);
                let plane = terms.raise + terms.tilt[0] * (x - self.centre[0]) + terms.tilt[1] * (y - self.centre[1]);
                let below = self.b.height(x + terms.offset[0], y + terms.offset[1]);
                *d = below.map_or(f64::NAN, |z| self.a.at(row, col) - z - plane);
            }
        });
        all
    }

    /// Raise and tilt alone, B where it lies.
    pub fn levelled(&self, start: Terms) -> Option<Terms> {
        (0..PLANE_ROUNDS).try_fold(start, |terms, _| self.step(&terms, 2))
    }

    /// A round of all unknowns.
    pub fn round(&self, terms: &Terms) -> Option<Terms> {
        self.step(terms, 0)
    }

    /// Weighted least squares of the present difference on the unknowns from `first` on; `None` when they cannot be told apart.
    fn step(&self, terms: &Terms, first: usize) -> Option<Terms> {
        let difference = self.difference(terms);
        let (centre, reach) = centre_and_reach(&difference);
        let disagreement = self.slope_disagreement(terms);
        let steep = centre_and_reach(&disagreement).1;
        let weights: Vec<f64> = difference
            .iter()
            .zip(&disagreement)
            .map(|(d, s)| biweight((d - centre) / reach) * biweight(s / steep))
            .collect();
        let (normal, gradient) = self.normal_equations(&difference, &weights, first);
        let factor = Cholesky::new(&normal, UNKNOWNS - first)?;
        let mut step = [0.0; UNKNOWNS];
        step[first..].copy_from_slice(&factor.solve(&gradient));
        Some(Terms {
            offset: [0, 1].map(|k| terms.offset[k] + step[k]),
            raise: terms.raise + step[2],
            tilt: [0, 1].map(|k| terms.tilt[k] + step[3 + k] / self.reach[k]),
        })
    }

    /// Size of the difference of the slopes of A and of B as moved, with the sign of the eastward one, so that its median
    /// is about 0.
    fn slope_disagreement(&self, terms: &Terms) -> Vec<f64> {
        let g = self.a.geometry;
        let of = |k: usize| {
            let (x, y) = (g.x(k % g.cols) + terms.offset[0], g.y(k / g.cols) + terms.offset[1]);
            self.b.height_and_gradient(x, y).map_or(f64::NAN, |(_, east, north)| {
                let [p, q] = [self.slopes[k][0] - east, self.slopes[k][1] - north];
                (p * p + q * q).sqrt().copysign(p)
            })
        };
        (0..g.len()).into_par_iter().with_min_len(1 << 12).map(of).collect()
    }

    /// `X'WX` (row-major) and `X'Wd`, row by row of A in order.
    fn normal_equations(&self, difference: &[f64], weights: &[f64], first: usize) -> (Vec<f64>, Vec<f64>) {
        let g = self.a.geometry;
        let n = UNKNOWNS - first;
        let rows: Vec<Vec<f64>> = (0..g.rows)
            .into_par_iter()
            .map(|row| {
                let mut sum = vec![0.0; n * n + n];
                for col in 0..g.cols {
                    let k = row * g.cols + col;
                    let (weight, [east, north]) = (weights[k], self.slopes[k]);
                    if weight > 0.0 {
                        let [x, y] = [(g.x(col), 0), (g.y(row), 1)].map(|(v, k)| (v - self.centre[k]) / self.reach[k]);
                        add(&mut sum, &[east, north, 1.0, x, y][first..], weight, difference[k]);
                    }
                }
                sum
            })
            .collect();
        let mut total: Vec<f64> =
            (0..n * n + n).map(|k| sums::sum(&rows.iter().map(|r| r[k]).collect::<Vec<_>>())).collect();
        let gradient = total.split_off(n * n);
        (total, gradient)
    }
}

/// Adds one cell to `X'WX` and `X'Wd`.
fn add(sum: &mut [f64], x: &[f64], weight: f64, difference: f64) {
    let n = x.len();
    for i in 0..n {
        for j in 0..n {
            sum[i * n + j] += weight * x[i] * x[j];
        }
        sum[n * n + i] += weight * x[i] * difference;
    }
}

/// Median, and where the biweight ends. Equal values have no spread, and nothing to weigh.
fn centre_and_reach(values: &[f64]) -> (f64, f64) {
    let (centre, spread) = centre_and_spread(&sums::finite(values));
    (centre, if spread > 0.0 { BIWEIGHT * spread } else { f64::INFINITY })
}

/// Tukey's biweight; 0 for no data.
fn biweight(share: f64) -> f64 {
    let rest = 1.0 - share * share;
    if rest > 0.0 { rest * rest } else { 0.0 }
}

/// Central differences; NaN where a neighbour is missing.
fn slopes(dem: &Grid) -> Vec<[f64; 2]> {
    let (rows, cols) = (dem.rows(), dem.cols());
    let [east, north] = dem.geometry.cell.map(|c| 0.5 / c);
    let at = |r: usize, c: usize| match r > 0 && c > 0 && r + 1 < rows && c + 1 < cols {
        true => {
            let slope = [(dem.at(r, c + 1) - dem.at(r, c - 1)) * east, (dem.at(r - 1, c) - dem.at(r + 1, c)) * north];
            if slope.iter().all(|s| s.is_finite()) { slope } else { [f64::NAN; 2] }
        }
        false => [f64::NAN; 2],
    };
    (0..rows).into_par_iter().flat_map_iter(|r| (0..cols).map(move |c| at(r, c))).collect()
}
