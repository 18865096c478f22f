//! A smooth surface through the posts of a DEM.

use sastrugi_numeric::{Geometry, Grid};
use std::ops::Range;

/// Cubic convolution (Keys, 1981, doi:10.1109/TASSP.1981.1163711, a = -1/2): passes through every post, with continuous slope, and is
/// exact on parabolas. Beyond the outermost posts it continues at their height.
pub struct Background {
    /// Geometry of the complete DEM: positions are computed from it, so that parts of the DEM agree bit by bit.
    whole: Geometry,
    posts: Grid,
    /// Column and row (from the south) of the first of `posts` in the complete DEM.
    first: [usize; 2],
}

impl Background {
    /// The surface through posts at the centres of a grid's cells; at least 3 x 3, all with data.
    pub fn new(posts: Grid) -> Self {
        Self { whole: posts.geometry, posts, first: [0; 2] }
    }

    /// The surface through some of the posts of a DEM, for points between them.
    pub fn of_part(whole: Geometry, first: [usize; 2], posts: Grid) -> Self {
        Self { whole, posts, first }
    }

    /// Geometry of the complete DEM.
    pub fn geometry(&self) -> Geometry {
        self.whole
    }

    /// Height at a point, m.
    pub fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let (g, posts) = (&self.whole, &self.posts);
        let (col, across) = place(position(g, 0, x), g.cols);
        let (row, up) = place(position(g, 1, y), g.rows);
        let line = |j: usize| {
            let values = posts.row(posts.rows() - 1 - j);
            along(|i| values[i], posts.cols(), col - self.first[0], across)
        };
        along(line, posts.rows(), row - self.first[1], up)
    }
}

/// A point this close to a post, in posts, counts as lying on it: coordinates are rounded.
const AT_POST: f64 = 1e-6;

/// Whether a coordinate along an axis lies between the outer posts.
pub fn lies_between(g: &Geometry, axis: usize, at: f64) -> bool {
    let last = ([g.cols, g.rows][axis] - 1) as f64;
    (-AT_POST..=last + AT_POST).contains(&position(g, axis, at))
}

/// Columns or rows (from the south, axis 1) of the posts that [`Background::at`] uses between two coordinates, m.
pub fn around(g: &Geometry, axis: usize, [low, high]: [f64; 2]) -> Range<usize> {
    let count = [g.cols, g.rows][axis];
    let post = |at: f64| place(position(g, axis, at), count).0;
    post(low).saturating_sub(1)..(post(high) + 3).min(count)
}

/// Position of a coordinate along an axis, in posts from the first.
fn position(g: &Geometry, axis: usize, at: f64) -> f64 {
    (at - g.origin[axis]) / g.cell[axis] - 0.5
}

/// Post at or before a position, and the fraction of the way to the next post.
fn place(position: f64, count: usize) -> (usize, f64) {
    let position = position.clamp(0.0, (count - 1) as f64);
    let post = (position as usize).min(count - 2);
    (post, position - post as f64)
}

/// Interpolates between post `at` and the next from the four surrounding posts.
fn along(value: impl Fn(usize) -> f64, count: usize, at: usize, t: f64) -> f64 {
    let (here, next) = (value(at), value(at + 1));
    // Keys' condition beyond the ends: the third difference is 0.
    let before = if at > 0 { value(at - 1) } else { 3.0 * here - 3.0 * next + value(at + 2) };
    let after = if at + 2 < count { value(at + 2) } else { 3.0 * next - 3.0 * here + value(at - 1) };
    let (t2, t3) = (t * t, t * t * t);
    let weights = [t2 - 0.5 * (t + t3), 1.0 - 2.5 * t2 + 1.5 * t3, 0.5 * t + 2.0 * t2 - 1.5 * t3, 0.5 * (t3 - t2)];
    (weights[0] * before + weights[1] * here) + (weights[2] * next + weights[3] * after)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(f: impl Fn(f64, f64) -> f64) -> Background {
        let g = Geometry { rows: 7, cols: 9, cell: [2.0, 3.0], origin: [10.0, -4.0] };
        Background::new(Grid::new(g, (0..g.len()).map(|k| f(g.x(k % 9), g.y(k / 9))).collect()))
    }

    /// Halfway between two posts the weights of the four posts in a row are -1/16, 9/16, 9/16 and -1/16.
    #[test]
    fn val_weights_halfway_are_those_of_keys() {
        let row = [16.0, 32.0, 48.0, 0.0];
        let along_x = Grid::new(Geometry::square(4, 4, 1.0), (0..16).map(|k| row[k % 4]).collect());
        assert!((Background::new(along_x).at([2.0, 2.3]) - 44.0).abs() < 1e-12);
        // Row 0 lies in the north.
        let along_y = Grid::new(Geometry::square(4, 4, 1.0), (0..16).map(|k| row[3 - k / 4]).collect());
        assert!((Background::new(along_y).at([1.8, 2.0]) - 44.0).abs() < 1e-12);
    }

    #[test]
    fn val_parabolas_are_exact() {
        let f = |x: f64, y: f64| 1.0 + 0.3 * x - 2.0 * y + 0.05 * x * x - 0.02 * y * y + 0.07 * x * y;
        let background = of(f);
        for (x, y) in [(11.0, -2.5), (11.7, -2.0), (17.3, 4.4), (26.9, 15.4), (27.0, 15.5)] {
            assert!((background.at([x, y]) - f(x, y)).abs() < 1e-11, "{x} {y}");
        }
    }

    /// Passes through every post, with continuous value and slope across the lines of posts, and is level beyond the ends.
    #[test]
    fn prop_smooth_through_the_posts() {
        let f = |x: f64, y: f64| libm::sin(2.1 * x) * libm::cos(1.3 * y);
        let background = of(f);
        let g = background.posts.geometry;
        for k in 0..g.len() {
            let place = [g.x(k % 9), g.y(k / 9)];
            assert_eq!(background.at(place), background.posts.values[k]);
        }
        let slope = |x: f64| (background.at([x + 1e-6, 3.3]) - background.at([x - 1e-6, 3.3])) / 2e-6;
        assert!((slope(15.0 - 2e-6) - slope(15.0 + 2e-6)).abs() < 1e-4);
        assert_eq!(background.at([-1e9, 3.0]), background.at([11.0, 3.0]));
        assert!(background.at([1e300, f64::MAX]).is_finite());
    }
}
