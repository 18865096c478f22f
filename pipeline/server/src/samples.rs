//! Samples of ground on a regular grid, and what can be done with them on their way to a client.

use crate::http::Problem;

/// Samples, row 0 in the north; NaN without data.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub cols: usize,
    /// Heights, m.
    pub heights: Vec<f32>,
    /// Albedo, 0 to 1.
    pub albedo: Option<Vec<f32>>,
    /// Share of the cell that rocks cover: 0 or 1 at a point.
    pub rock: Option<Vec<f32>>,
    /// Share of the ground that all rocks may cover, 0 to 1.
    pub rock_potential: Option<Vec<f32>>,
}

/// How samples are thinned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Thinning {
    /// The south-west sample of each block.
    Point,
    /// The mean of each block; NaN where a sample has no data.
    Mean,
}

/// Mirror images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flip {
    /// West becomes east.
    Horizontal,
    /// North becomes south.
    Vertical,
}

impl Samples {
    /// Samples without data.
    pub fn empty(rows: usize, cols: usize) -> Self {
        Self { rows, cols, heights: vec![f32::NAN; rows * cols], albedo: None, rock: None, rock_potential: None }
    }

    /// Heights, albedo, rock and rock potential.
    pub fn fields(&self) -> [Option<&[f32]>; 4] {
        [Some(&self.heights), self.albedo.as_deref(), self.rock.as_deref(), self.rock_potential.as_deref()]
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> u64 {
        let values: usize = self.fields().into_iter().flatten().map(<[f32]>::len).sum();
        128 + 4 * values as u64
    }

    /// True where no sample has data.
    pub fn is_void(&self) -> bool {
        self.heights.iter().all(|z| z.is_nan())
    }

    /// The same samples, each field by `f`.
    fn each(&self, [rows, cols]: [usize; 2], f: impl Fn(&[f32]) -> Vec<f32>) -> Self {
        Self {
            rows,
            cols,
            heights: f(&self.heights),
            albedo: self.albedo.as_deref().map(&f),
            rock: self.rock.as_deref().map(&f),
            rock_potential: self.rock_potential.as_deref().map(&f),
        }
    }

    /// The samples at other rows and columns: `from(row, col)` tells which one comes there.
    fn rearranged(&self, [rows, cols]: [usize; 2], from: impl Fn(usize, usize) -> [usize; 2]) -> Self {
        self.each([rows, cols], |values| {
            let at = |k: usize| {
                let [row, col] = from(k / cols, k % cols);
                values[row * self.cols + col]
            };
            (0..rows * cols).map(at).collect()
        })
    }

    /// Turned counterclockwise by quarters.
    pub fn turned(self, quarters: u32) -> Self {
        let (rows, cols) = (self.rows, self.cols);
        match quarters % 4 {
            1 => self.rearranged([cols, rows], |r, c| [c, cols - 1 - r]),
            2 => self.rearranged([rows, cols], |r, c| [rows - 1 - r, cols - 1 - c]),
            3 => self.rearranged([cols, rows], |r, c| [rows - 1 - c, r]),
            _ => self,
        }
    }

    /// Mirrored.
    pub fn flipped(self, flip: Flip) -> Self {
        let (rows, cols) = (self.rows, self.cols);
        match flip {
            Flip::Horizontal => self.rearranged([rows, cols], |r, c| [r, cols - 1 - c]),
            Flip::Vertical => self.rearranged([rows, cols], |r, c| [rows - 1 - r, c]),
        }
    }

    /// One sample for each block of `2^m` x `2^m`, counted from the south-west.
    ///
    /// # Errors
    /// A number of rows or columns that the blocks do not fill.
    pub fn thinned(self, m: u32, by: Thinning) -> Result<Self, Problem> {
        let side = 1usize << m;
        if !self.rows.is_multiple_of(side) || !self.cols.is_multiple_of(side) {
            return Err(Problem::bad_request(format!(
                "`downsample`: {} x {} samples cannot be divided into blocks of {side} x {side}; make `size` a multiple of {side}",
                self.cols, self.rows
            )));
        }
        if m == 0 {
            return Ok(self);
        }
        let shape = [self.rows / side, self.cols / side];
        Ok(match by {
            Thinning::Point => self.rearranged(shape, |r, c| [side * (r + 1) - 1, side * c]),
            Thinning::Mean => self.each(shape, |values| {
                let of_block = |k: usize| {
                    let (row, col) = (side * (k / shape[1]), side * (k % shape[1]));
                    let lines =
                        (row..row + side).flat_map(|r| &values[r * self.cols + col..r * self.cols + col + side]);
                    (lines.map(|v| f64::from(*v)).sum::<f64>() / (side * side) as f64) as f32
                };
                (0..shape[0] * shape[1]).map(of_block).collect()
            }),
        })
    }

    /// Bilinear values on a grid of places, rows `down` and columns `right` counted in samples from the north-west one; rock by the nearest
    /// sample. Places lie inside.
    pub fn between(&self, down: &[f64], right: &[f64]) -> Self {
        let (rows, cols) = (Spots::new(down, self.rows), Spots::new(right, self.cols));
        let shape = [down.len(), right.len()];
        let made = self.each(shape, |values| self.values_at(values, &rows, &cols, bilinear));
        let rock = self.rock.as_deref().map(|values| self.values_at(values, &rows, &cols, nearest));
        Self { rock, ..made }
    }

    /// Without data at some samples.
    pub fn without(mut self, at: impl Fn(usize) -> bool) -> Self {
        let fields = [Some(&mut self.heights), self.albedo.as_mut(), self.rock.as_mut(), self.rock_potential.as_mut()];
        for values in fields.into_iter().flatten() {
            values.iter_mut().enumerate().filter(|(k, _)| at(*k)).for_each(|(_, v)| *v = f32::NAN);
        }
        self
    }

    fn values_at(
        &self,
        values: &[f32],
        rows: &Spots,
        cols: &Spots,
        rule: impl Fn([f32; 4], [f64; 2]) -> f32,
    ) -> Vec<f32> {
        let mut made = Vec::with_capacity(rows.0.len() * cols.0.len());
        for &(row, down) in &rows.0 {
            let [north, south] =
                [row, (row + 1).min(self.rows - 1)].map(|r| &values[r * self.cols..(r + 1) * self.cols]);
            made.extend(cols.0.iter().map(|&(col, right)| {
                let east = (col + 1).min(self.cols - 1);
                rule([north[col], north[east], south[col], south[east]], [down, right])
            }));
        }
        made
    }
}

/// The sample before each place along an axis, and how far beyond it the place lies.
struct Spots(Vec<(usize, f64)>);

impl Spots {
    fn new(places: &[f64], count: usize) -> Self {
        let before = |at: f64| (at.max(0.0) as usize).min(count.saturating_sub(2));
        Self(places.iter().map(|at| (before(*at), at - before(*at) as f64)).collect())
    }
}

/// Between the north-west, north-east, south-west and south-east sample, `down` and `right` of the first; one that has no weight need not have
/// data.
fn bilinear([nw, ne, sw, se]: [f32; 4], [down, right]: [f64; 2]) -> f32 {
    let mix = |a: f32, b: f32| {
        let a = f64::from(a);
        if right == 0.0 { a } else { a + (f64::from(b) - a) * right }
    };
    // From the south, as [`sastrugi_numeric::GroundGrid`] does.
    let up = 1.0 - down;
    (if up == 0.0 {
        mix(sw, se)
    } else if down == 0.0 {
        mix(nw, ne)
    } else {
        let (low, high) = (mix(sw, se), mix(nw, ne));
        low + (high - low) * up
    }) as f32
}

fn nearest(corners: [f32; 4], [down, right]: [f64; 2]) -> f32 {
    corners[2 * usize::from(down > 0.5) + usize::from(right >= 0.5)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered(rows: usize, cols: usize) -> Samples {
        let heights: Vec<f32> = (0..rows * cols).map(|k| (k * k % 31) as f32).collect();
        Samples { rock: Some(heights.iter().map(|z| z % 2.0).collect()), heights, ..Samples::empty(rows, cols) }
    }

    /// Acceptance 14: four quarter turns, and two mirrors, change nothing; a turn carries the east edge to the north.
    #[test]
    fn prop_turns_and_mirrors_come_back() {
        for (rows, cols) in [(1, 1), (3, 5), (4, 4), (1, 7)] {
            let s = numbered(rows, cols);
            assert_eq!(s.clone().turned(1).turned(1).turned(1).turned(1), s);
            assert_eq!(s.clone().turned(1).turned(3), s);
            assert_eq!(s.clone().turned(2), s.clone().turned(1).turned(1));
            for flip in [Flip::Horizontal, Flip::Vertical] {
                assert_eq!(s.clone().flipped(flip).flipped(flip), s);
            }
            let turned = s.clone().turned(1);
            assert_eq!(turned.heights[0], s.heights[cols - 1]);
            assert_eq!(s.clone().flipped(Flip::Horizontal).flipped(Flip::Vertical), s.turned(2));
        }
    }

    /// Acceptance 14: exact on planes, within a rounding of single precision.
    #[test]
    fn prop_bilinear_is_exact_on_planes() {
        let (rows, cols) = (6, 9);
        let plane = |down: f64, right: f64| 3.0 - 0.25 * down + 0.5 * right;
        let heights = (0..rows * cols).map(|k| plane((k / cols) as f64, (k % cols) as f64) as f32).collect();
        let s = Samples { heights, ..Samples::empty(rows, cols) };
        let down: Vec<f64> = (0..5).map(|r| 0.3 + 0.9 * f64::from(r)).collect();
        let right: Vec<f64> = (0..10).map(|c| 0.1 + 0.77 * f64::from(c)).collect();
        let made = s.between(&down, &right);
        for (k, z) in made.heights.iter().enumerate() {
            assert!((f64::from(*z) - plane(down[k / 10], right[k % 10])).abs() < 1e-6);
        }
    }

    /// A sample itself comes back beside a hole; anything between the two does not.
    #[test]
    fn val_holes_stay_holes() {
        let mut s = numbered(3, 3);
        s.heights[4] = f32::NAN;
        assert_eq!(s.between(&[1.0], &[0.0]).heights[0], s.heights[3]);
        assert!(s.between(&[1.0], &[0.2]).heights[0].is_nan());
        assert!(s.clone().thinned(0, Thinning::Mean).unwrap().heights[4].is_nan());
        assert!(s.thinned(1, Thinning::Mean).is_err());
    }

    #[test]
    fn val_blocks_are_thinned_by_point_or_mean() {
        let s = Samples { heights: (0..16).map(|k| k as f32).collect(), ..Samples::empty(4, 4) };
        assert_eq!(s.clone().thinned(1, Thinning::Point).unwrap().heights, [4.0, 6.0, 12.0, 14.0]);
        assert_eq!(s.thinned(1, Thinning::Mean).unwrap().heights, [2.5, 4.5, 10.5, 12.5]);
    }
}
