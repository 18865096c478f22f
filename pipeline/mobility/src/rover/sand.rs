//! The sand around a rock: the least-squares plane through sand points.

/// Smallest number of points for a plane.
const SAND_MIN: f64 = 10.0;

/// A plane `z = level + slopes . (ahead, left)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SandPlane {
    /// Height at the origin, m.
    pub level_m: f64,
    /// Rise along both axes, m per m.
    pub slopes: [f64; 2],
}

/// Sums for a least-squares plane.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlaneSums {
    count: f64,
    first: [f64; 3],
    second: [f64; 5],
}

impl PlaneSums {
    /// Adds a point and its height.
    pub fn add(&mut self, [x, y]: [f64; 2], z: f64) {
        self.count += 1.0;
        [x, y, z].iter().zip(&mut self.first).for_each(|(v, sum)| *sum += v);
        [x * x, x * y, y * y, x * z, y * z].iter().zip(&mut self.second).for_each(|(v, sum)| *sum += v);
    }

    /// Adds the sums of another set of points.
    pub fn plus(mut self, other: &Self) -> Self {
        self.count += other.count;
        self.first.iter_mut().zip(other.first).for_each(|(a, b)| *a += b);
        self.second.iter_mut().zip(other.second).for_each(|(a, b)| *a += b);
        self
    }

    /// The plane; `None` for too few or collinear points.
    pub fn plane(&self) -> Option<SandPlane> {
        let n = self.count;
        let [x, y, z] = self.first.map(|sum| sum / n);
        let [xx, xy, yy, xz, yz] = self.second.map(|sum| sum / n);
        let (xx, xy, yy, xz, yz) = (xx - x * x, xy - x * y, yy - y * y, xz - x * z, yz - y * z);
        let determinant = xx * yy - xy * xy;
        if n < SAND_MIN || determinant <= 1e-9 * (xx + yy) * (xx + yy) {
            return None;
        }
        let slopes = [(yy * xz - xy * yz) / determinant, (xx * yz - xy * xz) / determinant];
        Some(SandPlane { level_m: z - slopes[0] * x - slopes[1] * y, slopes })
    }
}

impl SandPlane {
    /// Height at a point, m.
    pub fn height_m(&self, [x, y]: [f64; 2]) -> f64 {
        self.level_m + (self.slopes[0] * x + self.slopes[1] * y)
    }
}
