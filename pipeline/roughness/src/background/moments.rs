//! Moments of the cell offsets in a window, and the weights of the least-squares plane through the cells.

use super::LEVERAGE_MAX;

/// Determinant as a share of `sxx syy` below which the cells of a window count as collinear.
const ON_A_LINE: f64 = 1e-9;

/// Sums, over the cells with data in a window, of powers of their offsets dx and dy from its centre, in cells east and south.
/// Exact, because they stay below 2^53.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Number of cells.
    pub n: f64,
    /// Sum of dx.
    pub x: f64,
    /// Sum of dy.
    pub y: f64,
    /// Sum of dx^2.
    pub xx: f64,
    /// Sum of dx dy.
    pub xy: f64,
    /// Sum of dy^2.
    pub yy: f64,
}

/// Weights `constant - east dx - south dy` of the cells with data in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    constant: f64,
    east: f64,
    south: f64,
}

impl Moments {
    /// Adds `count` cells at an offset `[south, east]`.
    pub fn add(&mut self, [south, east]: [isize; 2], count: f64) {
        let [x, y] = [east as f64, south as f64];
        self.n += count;
        self.x += count * x;
        self.y += count * y;
        self.xx += count * x * x;
        self.xy += count * x * y;
        self.yy += count * y * y;
    }

    /// Weights that give the height of the least-squares plane at the centre; `None` if the plane is not unique or extrapolated too
    /// far.
    pub fn weights(&self) -> Option<Weights> {
        let (weights, leverage) = self.plane();
        (leverage <= LEVERAGE_MAX).then_some(weights)
    }

    /// Weights that give the height of the least-squares plane at the centre, and the number of cells times the sum of squared
    /// weights; infinite if the cells lie on a line that misses the centre. The weights are those of the mean if the cells balance
    /// about the centre.
    pub fn plane(&self) -> (Weights, f64) {
        let Self { n, x, y, .. } = *self;
        let [cx, cy] = [x / n, y / n];
        let [sxx, sxy, syy] = [self.xx - x * cx, self.xy - x * cy, self.yy - y * cy];
        let determinant = sxx * syy - sxy * sxy;
        let slopes = if x == 0.0 && y == 0.0 {
            Some([0.0; 2])
        } else if determinant > ON_A_LINE * sxx * syy {
            Some([(syy * cx - sxy * cy) / determinant, (sxx * cy - sxy * cx) / determinant])
        } else if self.yy == 0.0 && sxx > 0.0 {
            // A transect has no slope across its line.
            Some([cx / sxx, 0.0])
        } else if self.xx == 0.0 && syy > 0.0 {
            Some([0.0, cy / syy])
        } else {
            None
        };
        let [east, south] = slopes.unwrap_or([0.0; 2]);
        let constant = 1.0 / n + east * cx + south * cy;
        (Weights { constant, east, south }, if slopes.is_some() { n * constant } else { f64::INFINITY })
    }
}

impl Weights {
    /// Weight of the cell at an offset `[south, east]`.
    pub fn at(&self, [dy, dx]: [isize; 2]) -> f64 {
        self.constant - self.east * dx as f64 - self.south * dy as f64
    }

    /// Weighted sum of the heights, from the sums of `z`, `dx z` and `dy z`.
    pub fn sum(&self, z: f64, xz: f64, yz: f64) -> f64 {
        self.constant * z - self.east * xz - self.south * yz
    }
}
