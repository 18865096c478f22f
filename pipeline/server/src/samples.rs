//! Samples of ground on a regular grid, and the operations on them before they are sent.

use crate::http::Problem;

/// Samples on a grid; row 0 is the northernmost, NaN marks no data.
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
    /// Share of the cell that rocks cover; 0 or 1 at a point.
    pub rock: Option<Vec<f32>>,
    /// Potential rock cover: share of the ground that rocks of all sizes may cover, 0 to 1.
    pub rock_potential: Option<Vec<f32>>,
}

/// How a block of samples is reduced to one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Thinning {
    /// The south-west sample of each block.
    Point,
    /// The mean of each block; NaN if any sample has no data.
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
    /// Samples without any data.
    pub fn empty(rows: usize, cols: usize) -> Self {
        Self { rows, cols, heights: vec![f32::NAN; rows * cols], albedo: None, rock: None, rock_potential: None }
    }

    /// Heights, albedo, rock and rock potential.
    pub fn fields(&self) -> [Option<&[f32]>; 4] {
        [Some(&self.heights), self.albedo.as_deref(), self.rock.as_deref(), self.rock_potential.as_deref()]
    }

    /// Memory used, bytes.
    pub fn bytes(&self) -> u64 {
        let values: usize = self.fields().into_iter().flatten().map(<[f32]>::len).sum();
        128 + 4 * values as u64
    }

    /// True if no sample has data.
    pub fn is_void(&self) -> bool {
        self.heights.iter().all(|z| z.is_nan())
    }

    /// Applies `f` to each field.
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

    /// Rearranges the samples: `from(row, col)` is the source of each output sample.
    fn rearranged(&self, [rows, cols]: [usize; 2], from: impl Fn(usize, usize) -> [usize; 2]) -> Self {
        self.each([rows, cols], |values| {
            let at = |k: usize| {
                let [row, col] = from(k / cols, k % cols);
                values[row * self.cols + col]
            };
            (0..rows * cols).map(at).collect()
        })
    }

    /// Rotated counterclockwise by quarter turns.
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

    /// Reduces each block of `2^m` x `2^m` samples to one; blocks are counted from the south-west.
    ///
    /// # Errors
    /// The number of rows or columns is not a multiple of the block's side.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_server::samples::{Samples, Thinning};
    ///
    /// let heights = (0..16).map(|k| k as f32).collect();
    /// let samples = Samples { heights, ..Samples::empty(4, 4) };
    /// // Row 0 is the northernmost: the south-west sample of the first block of 2 x 2 is 4, its mean (0 + 1 + 4 + 5) / 4.
    /// assert_eq!(samples.clone().thinned(1, Thinning::Point).unwrap().heights, [4.0, 6.0, 12.0, 14.0]);
    /// assert_eq!(samples.clone().thinned(1, Thinning::Mean).unwrap().heights, [2.5, 4.5, 10.5, 12.5]);
    /// assert!(samples.thinned(3, Thinning::Mean).is_err());
    /// ```
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

    /// Bilinear interpolation on a grid of positions, with rows `down` and columns `right` in sample spacings from the north-west sample; rock uses
    /// the nearest sample. Positions must lie inside the samples.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_server::samples::Samples;
    ///
    /// let samples = Samples { heights: vec![0.0, 1.0, 2.0, 3.0], ..Samples::empty(2, 2) };
    /// // One row, half-way between the two; three columns.
    /// assert_eq!(samples.between(&[0.5], &[0.0, 0.25, 1.0]).heights, [1.0, 1.25, 2.0]);
    /// ```
    pub fn between(&self, down: &[f64], right: &[f64]) -> Self {
        let (rows, cols) = (Spots::new(down, self.rows), Spots::new(right, self.cols));
        let shape = [down.len(), right.len()];
        let made = self.each(shape, |values| self.values_at(values, &rows, &cols, bilinear));
        let rock = self.rock.as_deref().map(|values| self.values_at(values, &rows, &cols, nearest));
        Self { rock, ..made }
    }

    /// Sets the samples selected by `at` to no data.
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

/// For each position along an axis: the preceding sample, and the fraction of a spacing beyond it.
struct Spots(Vec<(usize, f64)>);

impl Spots {
    fn new(places: &[f64], count: usize) -> Self {
        let before = |at: f64| (at.max(0.0) as usize).min(count.saturating_sub(2));
        Self(places.iter().map(|at| (before(*at), at - before(*at) as f64)).collect())
    }
}

/// Interpolates between the north-west, north-east, south-west and south-east samples, at fractions `down` and `right` from the first. A sample of
/// weight 0 may lack data.
fn bilinear([nw, ne, sw, se]: [f32; 4], [down, right]: [f64; 2]) -> f32 {
    let mix = |a: f32, b: f32| {
        let a = f64::from(a);
        if right == 0.0 { a } else { a + (f64::from(b) - a) * right }
    };
    // From the south, as in [`sastrugi_numeric::GroundGrid`].
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

    /// Acceptance 14: four quarter turns, and two mirrorings, are the identity; a quarter turn moves the east edge to the north.
    #[test]
    fn prop_turns_and_mirrors_cancel() {
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

    /// Acceptance 14: exact on planes, within rounding to single precision.
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

    /// A sample next to a hole is returned exactly; anything interpolated with the hole is not.
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

    /// East and west, or north and south, change places; twice the same mirror would not tell which.
    #[test]
    fn val_mirrors_have_their_axes() {
        let s = Samples { heights: (0..6).map(|k| k as f32).collect(), ..Samples::empty(2, 3) };
        assert_eq!(s.clone().flipped(Flip::Horizontal).heights, [2.0, 1.0, 0.0, 5.0, 4.0, 3.0]);
        assert_eq!(s.clone().flipped(Flip::Vertical).heights, [3.0, 4.0, 5.0, 0.0, 1.0, 2.0]);
        // Counterclockwise: the east column becomes the northern row.
        let turned = s.turned(1);
        assert_eq!((turned.rows, turned.cols, turned.heights), (3, 2, vec![2.0, 5.0, 1.0, 4.0, 0.0, 3.0]));
    }

    /// Half-way between two samples, rock is that of the northern and of the eastern one.
    #[test]
    fn val_rock_is_not_interpolated() {
        let s =
            Samples { heights: vec![0.0, 1.0, 2.0, 3.0], rock: Some(vec![0.1, 0.2, 0.3, 0.4]), ..Samples::empty(2, 2) };
        let made = s.between(&[0.5, 0.51], &[0.49, 0.5]);
        assert_eq!(made.rock, Some(vec![0.1, 0.2, 0.3, 0.4]));
        assert_eq!(made.heights[1], 1.5);
    }

    #[test]
    fn val_means_with_a_hole_are_holes() {
        let mut s = Samples { heights: vec![1.0; 16], ..Samples::empty(4, 4) };
        s.heights[5] = f32::NAN;
        let made = s.thinned(1, Thinning::Mean).unwrap().heights;
        assert!(made[0].is_nan() && made[1..] == [1.0; 3], "{made:?}");
    }

    #[test]
    fn val_samples_can_be_taken_out() {
        let s = numbered(2, 3).without(|k| k == 4);
        assert!(s.heights[4].is_nan() && s.rock.as_ref().is_some_and(|rock| rock[4].is_nan()));
        let left = |values: &[f32]| values.iter().filter(|v| !v.is_nan()).count();
        assert_eq!((left(&s.heights), s.rock.as_deref().map(left)), (5, Some(5)));
        assert!(!s.is_void() && s.without(|_| true).is_void());
    }
}
