//! One round of the fit of shift, raise and tilt.
//!
//! Unknowns are the offset (east, north), the raise and the tilts. z is a cell's row `(dA/dx, dA/dy, 1, x, y)` with the slopes of A,
//! and b the same with the slopes of B as moved; d is the difference and w its weight. The fit ends where the score
//! `sum w z d` is zero. Near that point the step is `(sum w z b')^-1 sum w z d`: noise in the slopes of A and of B is independent and
//! averages out of `z b'`, but adds to `z z'`, so that the Gauss-Newton step `(sum w z z')^-1 sum w z d` is too short
//! where slopes are mostly noise (attenuation). Far from it the slopes of A and B may disagree; there the shorter Gauss-Newton step
//! is taken, which always descends.

use super::centre_and_spread;
use super::equations::{Equations, UNKNOWNS};
use super::uncertainty::Uncertainty;
use rayon::prelude::*;
use sastrugi_numeric::surface::Surface;
use sastrugi_numeric::{Grid, sums};
use std::ops::Range;

/// Tukey's constant: 95 % efficiency on normal data (Holland and Welsch, 1977).
const BIWEIGHT: f64 = 4.685;
/// Rounds of the fit of raise and tilt alone.
const PLANE_ROUNDS: usize = 10;
/// Approximate number of blocks for standard errors.
const BLOCKS: f64 = 25.0;

/// Where B is sampled, and the plane that is added to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// B is sampled this far east and north of a cell of A, m.
    pub offset: [f64; 2],
    /// Added at the centre of A, m.
    pub raise: f64,
    /// Added eastwards and northwards, m/m.
    pub tilt: [f64; 2],
}

/// A minus B as moved, m.
pub fn minus(a: &Grid, b: &Grid, terms: &Terms) -> Vec<f64> {
    let g = a.geometry;
    let centre = centre(a);
    let mut all = vec![f64::NAN; g.len()];
    all.par_chunks_mut(g.cols).enumerate().for_each(|(row, line)| {
        let y = g.y(row);
        for (col, d) in line.iter_mut().enumerate() {
            let x = g.x(col);
            let plane = terms.raise + terms.tilt[0] * (x - centre[0]) + terms.tilt[1] * (y - centre[1]);
            let below = b.height(x + terms.offset[0], y + terms.offset[1]);
            *d = below.map_or(f64::NAN, |z| a.at(row, col) - z - plane);
        }
    });
    all
}

fn centre(grid: &Grid) -> [f64; 2] {
    let (g, size) = (grid.geometry, grid.geometry.size());
    [0, 1].map(|k| g.origin[k] + 0.5 * size[k])
}

/// A, its slopes, and B.
pub struct Overlay<'a> {
    a: &'a Grid,
    b: &'a Grid,
    /// `dz/dx` and `dz/dy` of A; NaN next to no-data cells.
    slopes: Vec<[f64; 2]>,
    centre: [f64; 2],
    /// Half the extent of A: unit of the columns of the tilt.
    reach: [f64; 2],
}

/// A and B as moved, cell by cell of A.
struct Compared {
    /// A minus B, m.
    difference: Vec<f64>,
    /// Median of the difference, m.
    centre: f64,
    /// Distance from the median at which the biweight reaches 0, m.
    reach: f64,
    /// `dz/dx` and `dz/dy` of B; NaN where undefined.
    slopes: Vec<[f64; 2]>,
    /// Weight by the agreement of the slopes of A and B; 0 where either is undefined.
    agreement: Vec<f64>,
}

impl<'a> Overlay<'a> {
    pub fn new(a: &'a Grid, b: &'a Grid) -> Self {
        Self { a, b, slopes: slopes(a), centre: centre(a), reach: a.geometry.size().map(|s| 0.5 * s) }
    }

    /// Smaller side of A's cells, m.
    pub fn cell_m(&self) -> f64 {
        self.a.geometry.cell[0].min(self.a.geometry.cell[1])
    }

    /// A minus B as moved, m.
    pub fn difference(&self, terms: &Terms) -> Vec<f64> {
        minus(self.a, self.b, terms)
    }

    /// Fits raise and tilt alone, without moving B; `None` if the common cells do not determine a plane.
    pub fn levelled(&self, start: Terms) -> Option<Terms> {
        (0..PLANE_ROUNDS).try_fold(start, |terms, _| {
            let step = self.equations(&self.compare(&terms)).downhill(2)?;
            Some(self.moved(&terms, 2, &step))
        })
    }

    /// One round for all unknowns; `None` if they are not identifiable.
    pub fn round(&self, terms: &Terms) -> Option<Terms> {
        let equations = self.equations(&self.compare(terms));
        let downhill = equations.downhill(0)?;
        let near = |step: &Vec<f64>| {
            let length = (step[0] * step[0] + step[1] * step[1]).sqrt();
            length < self.cell_m() && step[0] * downhill[0] + step[1] * downhill[1] > 0.0
        };
        Some(self.moved(terms, 0, &equations.straight(0).filter(near).unwrap_or(downhill)))
    }

    /// Standard errors at the end of the fit, with or without a shift among the unknowns; `None` with too little data.
    pub fn uncertainty(&self, terms: &Terms, shifted: bool, resolution_m: f64) -> Option<Uncertainty> {
        let units = [1.0, 1.0, 1.0, 1.0 / self.reach[0], 1.0 / self.reach[1]];
        let blocks = self.blocks(&self.compare(terms));
        Uncertainty::of_blocks(&blocks, if shifted { 0 } else { 2 }, units, resolution_m)
    }

    /// Terms after a step of the unknowns from `first` on.
    fn moved(&self, terms: &Terms, first: usize, by: &[f64]) -> Terms {
        let mut step = [0.0; UNKNOWNS];
        step[first..].copy_from_slice(by);
        Terms {
            offset: [0, 1].map(|k| terms.offset[k] + step[k]),
            raise: terms.raise + step[2],
            tilt: [0, 1].map(|k| terms.tilt[k] + step[3 + k] / self.reach[k]),
        }
    }

    fn compare(&self, terms: &Terms) -> Compared {
        let g = self.a.geometry;
        let difference = self.difference(terms);
        let (centre, reach) = centre_and_reach(&difference);
        let gradient = |k: usize| {
            let (x, y) = (g.x(k % g.cols) + terms.offset[0], g.y(k / g.cols) + terms.offset[1]);
            self.b.height_and_gradient(x, y).map_or([f64::NAN; 2], |(_, east, north)| [east, north])
        };
        let slopes: Vec<[f64; 2]> = (0..g.len()).into_par_iter().with_min_len(1 << 12).map(gradient).collect();
        let agreement = agreement(&self.slopes, &slopes);
        Compared { difference, centre, reach, slopes, agreement }
    }

    /// Equations of all cells, summed row by row of A.
    fn equations(&self, compared: &Compared) -> Equations {
        let g = self.a.geometry;
        let rows: Vec<Equations> =
            (0..g.rows).into_par_iter().map(|row| self.equations_of(compared, row..row + 1, 0..g.cols)).collect();
        Equations::sum(&rows)
    }

    /// Equations of a rectangle of A.
    fn equations_of(&self, compared: &Compared, rows: Range<usize>, cols: Range<usize>) -> Equations {
        let g = self.a.geometry;
        let mut sum = Equations::NONE;
        for row in rows {
            let y = (g.y(row) - self.centre[1]) / self.reach[1];
            for col in cols.clone() {
                let k = row * g.cols + col;
                let share = (compared.difference[k] - compared.centre) / compared.reach;
                if compared.agreement[k] > 0.0 && share.abs() < 1.0 {
                    let x = (g.x(col) - self.centre[0]) / self.reach[0];
                    let ([ae, an], [be, bn]) = (self.slopes[k], compared.slopes[k]);
                    let [weight, derivative] = biweight(share).map(|w| w * compared.agreement[k]);
                    sum.add(&[ae, an, 1.0, x, y], &[be, bn, 1.0, x, y], weight, compared.difference[k]);
                    sum.0[Equations::DERIVATIVES] += derivative;
                }
            }
        }
        sum
    }

    /// Equations of some 25 nearly square blocks that cover the bounding rectangle of the common cells.
    fn blocks(&self, compared: &Compared) -> Vec<Equations> {
        let g = self.a.geometry;
        let Some([rows, cols]) = occupied(&compared.agreement, g.cols) else { return Vec::new() };
        let [width, height] = [cols.len() as f64 * g.cell[0], rows.len() as f64 * g.cell[1]];
        let side = (width * height / BLOCKS).sqrt();
        let [rows, cols] = [(rows, height), (cols, width)].map(|(range, size)| parts(&range, (size / side).round()));
        let of_row = |row: &Range<usize>| -> Vec<Equations> {
            cols.iter().map(|col| self.equations_of(compared, row.clone(), col.clone())).collect()
        };
        let all: Vec<Vec<Equations>> = rows.par_iter().map(of_row).collect();
        all.into_iter().flatten().filter(|block| block.weight() > 0.0).collect()
    }
}

/// Rows and columns between the first and the last positive value.
fn occupied(values: &[f64], cols: usize) -> Option<[Range<usize>; 2]> {
    let mut found: Option<[Range<usize>; 2]> = None;
    for k in (0..values.len()).filter(|&k| values[k] > 0.0) {
        let (row, col) = (k / cols, k % cols);
        let [rows, cols] = found.get_or_insert([row..row + 1, col..col + 1]);
        rows.end = row + 1;
        *cols = cols.start.min(col)..cols.end.max(col + 1);
    }
    found
}

/// Splits a range into `count` nearly equal parts, or into single members if it has fewer.
fn parts(range: &Range<usize>, count: f64) -> Vec<Range<usize>> {
    let count = (count as usize).clamp(1, range.len().max(1));
    let end = |k: usize| range.start + k * range.len() / count;
    (0..count).map(|k| end(k)..end(k + 1)).collect()
}

/// Median, and the distance from it at which the biweight reaches 0; infinite if all values are equal.
fn centre_and_reach(values: &[f64]) -> (f64, f64) {
    let (centre, spread) = centre_and_spread(&sums::finite(values));
    (centre, if spread > 0.0 { BIWEIGHT * spread } else { f64::INFINITY })
}

/// Tukey's biweight w, and the derivative of w times its argument, at a share (below 1) of its reach.
fn biweight(share: f64) -> [f64; 2] {
    let rest = 1.0 - share * share;
    [rest * rest, rest * (1.0 - 5.0 * share * share)]
}

/// Weights by the difference between the slopes of A and B, from its median (which removes a tilt of the complete surface): 1 up to half
/// the reach, then decreasing to 0 like the biweight. A weight that already decreased within the scatter of noise would favour cells where
/// the noise of A and B happens to agree, and noise would be taken for relief.
fn agreement(a: &[[f64; 2]], b: &[[f64; 2]]) -> Vec<f64> {
    let medians = [0, 1].map(|k| {
        let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a[k] - b[k]).collect();
        sums::median(&sums::finite(&differences))
    });
    // Given the sign of the eastward component, so that the median is about 0.
    let size = |(a, b): (&[f64; 2], &[f64; 2])| {
        let [p, q] = [0, 1].map(|k| a[k] - b[k] - medians[k]);
        (p * p + q * q).sqrt().copysign(p)
    };
    let sizes: Vec<f64> = a.iter().zip(b).map(size).collect();
    let reach = centre_and_reach(&sizes).1;
    let weight = |size: &f64| match size.abs() / reach {
        share if share < 0.5 => 1.0,
        share if share < 1.0 => biweight(2.0 * share - 1.0)[0],
        _ => 0.0,
    };
    sizes.iter().map(weight).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    /// The second number is the derivative of the first times its argument, here by central differences.
    #[test]
    fn val_biweight_and_its_derivative() {
        assert_eq!((biweight(0.0), biweight(1.0)), ([1.0, 1.0], [0.0, -0.0]));
        for k in 1..20 {
            let (share, step) = (0.05 * f64::from(k), 1e-5);
            let product = |s: f64| s * biweight(s)[0];
            let slope = (product(share + step) - product(share - step)) / (2.0 * step);
            assert!((biweight(share)[1] - slope).abs() < 1e-8, "{share}: {slope}");
        }
        assert!((biweight(0.5)[0] - 0.5625).abs() < 1e-15);
    }

    /// Slopes of a plane on cells of 0.5 m by 2 m: east and north, signs included; undefined at the rim and next to a hole.
    #[test]
    fn val_slopes_of_a_plane() {
        let g = Geometry { rows: 5, cols: 6, cell: [0.5, 2.0], origin: [3.0, 4.0] };
        let mut plane = Grid::new(g, (0..30).map(|k| 0.25 * g.x(k % 6) - 0.5 * g.y(k / 6)).collect());
        plane.values[13] = f64::NAN;
        let found = slopes(&plane);
        let defined: Vec<usize> = (0..30).filter(|k| found[*k][0].is_finite()).collect();
        // The rows 1 to 3 and columns 1 to 4, but for the neighbours of (2, 1); the hole itself has four neighbours with data.
        assert_eq!(defined, [8, 9, 10, 13, 15, 16, 20, 21, 22]);
        assert!(defined.iter().all(|k| found[*k] == [0.25, -0.5]), "{found:?}");
    }

    /// Parts cover a range without gaps; a range of fewer members than parts is split into single ones.
    #[test]
    fn val_parts_cover_a_range() {
        assert_eq!(parts(&(3..13), 3.0), [3..6, 6..9, 9..13]);
        assert_eq!(parts(&(3..5), 7.0), [3..4, 4..5]);
        assert_eq!(parts(&(0..4), 0.0).first(), Some(&(0..4)));
        assert_eq!(occupied(&[0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0, 0.0], 4), Some([0..2, 0..3]));
        assert_eq!(occupied(&[0.0; 6], 3), None);
    }
}
