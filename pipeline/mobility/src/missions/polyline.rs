//! Polylines that a vehicle follows, and its progress along them.
//!
//! Progress is monotone: the foot of a point is the nearest point of the polyline between the previous foot and a window
//! beyond it; of two equally near points, the one nearer to the start. A line may therefore cross itself or close: as long as
//! its loops are longer than the window, the foot stays on the part that the vehicle is following. Cost: the segments inside
//! the window.

use sastrugi_schemas::counted;
use sastrugi_schemas::topics::StateSample;
use serde::{Deserialize, Serialize};

/// A polyline in plan, at least one segment of positive length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<[f64; 2]>", into = "Vec<[f64; 2]>")]
pub struct Polyline {
    /// Vertices `[x, y]`, m; consecutive ones differ.
    points_m: Vec<[f64; 2]>,
    /// Distance of each vertex along the polyline, m; increases from 0.
    along_m: Vec<f64>,
}

/// Why points do not form a polyline.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PolylineError {
    /// A coordinate is not finite.
    #[error("build a polyline: point {index} is ({x_m}, {y_m}) m; coordinates must be finite")]
    NotFinite {
        /// Number of the point, from 0.
        index: usize,
        /// Its x, m.
        x_m: f64,
        /// Its y, m.
        y_m: f64,
    },
    /// All points coincide, or there are fewer than two.
    #[error("build a polyline of {}: it has no length; give at least two distinct points", counted(.points, "point"))]
    NoLength {
        /// Number of points.
        points: usize,
    },
    /// Points so far apart that their distances are not finite.
    #[error("build a polyline: its length overflows; give coordinates in m")]
    TooLong,
}

/// The point of a polyline that is nearest to a given point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Distance along the polyline, m.
    pub along_m: f64,
    /// Distance to the foot, m, positive to the left of the polyline.
    pub cross_track_m: f64,
}

impl Polyline {
    /// The polyline through these points (m) in order; a point that repeats its predecessor is dropped.
    ///
    /// # Errors
    /// [`PolylineError`] for a coordinate that is not finite, or a length that is 0 or not finite.
    pub fn new(points_m: &[[f64; 2]]) -> Result<Self, PolylineError> {
        if let Some(index) = points_m.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            let [x_m, y_m] = points_m[index];
            return Err(PolylineError::NotFinite { index, x_m, y_m });
        }
        let mut line = Self { points_m: Vec::new(), along_m: Vec::new() };
        points_m.iter().for_each(|&point_m| line.push(point_m));
        match line.length_m() {
            length_m if !length_m.is_finite() => Err(PolylineError::TooLong),
            length_m if length_m > 0.0 => Ok(line),
            _ => Err(PolylineError::NoLength { points: points_m.len() }),
        }
    }

    fn push(&mut self, point_m: [f64; 2]) {
        let along_m = match (self.points_m.last(), self.along_m.last()) {
            (Some(&last_m), Some(along_m)) => {
                let next_m = along_m + super::distance(last_m, point_m);
                // A step below the rounding error of the length so far has no direction.
                if next_m <= *along_m {
                    return;
                }
                next_m
            }
            _ => 0.0,
        };
        self.points_m.push(point_m);
        self.along_m.push(along_m);
    }

    /// Vertices `[x, y]`, m.
    pub fn points_m(&self) -> &[[f64; 2]] {
        &self.points_m
    }

    /// Length, m.
    pub fn length_m(&self) -> f64 {
        self.along_m.last().copied().unwrap_or(0.0)
    }

    /// The point at a distance along the polyline (clamped to 0 and the length), m.
    pub fn point_at(&self, along_m: f64) -> [f64; 2] {
        let along_m = along_m.clamp(0.0, self.length_m());
        let (from, to) = self.segment(self.segment_at(along_m));
        let share = (along_m - from.1) / (to.1 - from.1);
        [0, 1].map(|axis| from.0[axis] + share * (to.0[axis] - from.0[axis]))
    }

    /// Direction at the start, counterclockwise from east, rad, in [-pi, pi].
    pub(crate) fn bearing_rad(&self) -> f64 {
        let ((a, _), (b, _)) = self.segment(0);
        libm::atan2(b[1] - a[1], b[0] - a[0])
    }

    /// The foot of a point (m), from `from_m` to `window_m` beyond it along the polyline.
    ///
    /// ```
    /// use sastrugi_mobility::missions::Polyline;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let corner = Polyline::new(&[[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])?;
    /// // Half a metre to the left of the second segment, 2 m up.
    /// let foot = corner.foot([2.5, 2.0], 1.0, 9.0);
    /// assert_eq!((foot.along_m, foot.cross_track_m), (5.0, 0.5));
    /// # Ok(())
    /// # }
    /// ```
    pub fn foot(&self, point_m: [f64; 2], from_m: f64, window_m: f64) -> Foot {
        let from_m = from_m.clamp(0.0, self.length_m());
        let to_m = from_m + window_m.max(0.0);
        let first = self.segment_at(from_m);
        let others = (first + 1..self.points_m.len() - 1).take_while(|&k| self.along_m[k] <= to_m);
        others.fold(self.foot_on(first, point_m, from_m, to_m), |nearest, k| {
            let foot = self.foot_on(k, point_m, from_m, to_m);
            if foot.cross_track_m.abs() < nearest.cross_track_m.abs() { foot } else { nearest }
        })
    }

    /// The feet of a vehicle's poses; none lies before its predecessor.
    pub fn feet(&self, states: &[StateSample], window_m: f64) -> Vec<Foot> {
        let next = |from_m: &mut f64, state: &StateSample| {
            let foot = self.foot([state.position_m[0], state.position_m[1]], *from_m, window_m);
            *from_m = foot.along_m;
            Some(foot)
        };
        states.iter().scan(0.0, next).collect()
    }

    /// The last segment that begins at or before a distance along the polyline.
    fn segment_at(&self, along_m: f64) -> usize {
        self.along_m[1..self.along_m.len() - 1].partition_point(|&begin_m| begin_m <= along_m)
    }

    /// Ends of a segment, each with its distance along the polyline, m.
    fn segment(&self, k: usize) -> (([f64; 2], f64), ([f64; 2], f64)) {
        ((self.points_m[k], self.along_m[k]), (self.points_m[k + 1], self.along_m[k + 1]))
    }

    /// The foot on one segment, between two distances along the polyline.
    fn foot_on(&self, k: usize, [x, y]: [f64; 2], from_m: f64, to_m: f64) -> Foot {
        let ((a, begin_m), (b, end_m)) = self.segment(k);
        let [cos, sin] = [0, 1].map(|axis| (b[axis] - a[axis]) / (end_m - begin_m));
        let beyond_m = (x - a[0]) * cos + (y - a[1]) * sin;
        let along_m = (begin_m + beyond_m).max(from_m.max(begin_m)).min(to_m.min(end_m));
        let (dx, dy) = (x - a[0] - (along_m - begin_m) * cos, y - a[1] - (along_m - begin_m) * sin);
        let left_m = dy * cos - dx * sin;
        Foot { along_m, cross_track_m: (dx * dx + dy * dy).sqrt().copysign(left_m) }
    }
}

impl TryFrom<Vec<[f64; 2]>> for Polyline {
    type Error = PolylineError;

    fn try_from(points_m: Vec<[f64; 2]>) -> Result<Self, PolylineError> {
        Self::new(&points_m)
    }
}

impl From<Polyline> for Vec<[f64; 2]> {
    fn from(line: Polyline) -> Self {
        line.points_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn line(points_m: &[[f64; 2]]) -> Polyline {
        Polyline::new(points_m).unwrap()
    }

    #[test]
    fn val_lengths_points_and_feet_of_a_corner() {
        let corner = line(&[[0.0, 0.0], [3.0, 0.0], [3.0, 0.0], [3.0, 4.0]]);
        assert_eq!((corner.length_m(), corner.points_m().len()), (7.0, 3));
        assert_eq!(
            [-1.0, 2.0, 3.0, 5.0, 9.0].map(|s| corner.point_at(s)),
            [[0.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 2.0], [3.0, 4.0]]
        );
        let foot = |p, from_m, window_m| {
            let foot = corner.foot(p, from_m, window_m);
            (foot.along_m, foot.cross_track_m)
        };
        assert_eq!(foot([1.0, 0.5], 0.0, 2.0), (1.0, 0.5));
        assert_eq!(foot([1.0, -0.5], 2.0, 2.0), (2.0, -(1.25f64).sqrt()));
        assert_eq!(foot([2.5, 2.0], 1.0, 9.0), (5.0, 0.5));
        assert_eq!(foot([2.5, 2.0], 1.0, 3.0), (4.0, 1.25f64.sqrt()));
        assert_eq!(foot([9.0, 4.0], 0.0, 9.0), (7.0, -6.0));
    }

    /// Where a line doubles back on itself, the window decides which pass a point belongs to.
    #[test]
    fn val_progress_stays_on_the_current_pass() {
        let there_and_back = line(&[[0.0, 0.0], [10.0, 0.0], [0.0, 0.0]]);
        assert_eq!(there_and_back.foot([4.0, 0.0], 3.0, 2.0).along_m, 4.0);
        assert_eq!(there_and_back.foot([4.0, 0.0], 15.0, 2.0).along_m, 16.0);
        assert_eq!(there_and_back.foot([0.0, 0.0], 0.0, 2.0).along_m, 0.0);
        // Without a window, the nearest point is the first one.
        assert_eq!(there_and_back.foot([4.0, 0.0], 0.0, 20.0).along_m, 4.0);
    }

    #[test]
    fn val_degenerate_polylines_are_refused() {
        let error = |points: &[[f64; 2]]| Polyline::new(points).unwrap_err();
        assert_eq!(error(&[]), PolylineError::NoLength { points: 0 });
        assert_eq!(error(&[[1.0, 2.0]; 3]), PolylineError::NoLength { points: 3 });
        assert!(error(&[[1.0, 2.0]]).to_string().starts_with("build a polyline of 1 point: it has no length"));
        assert!(error(&[[1.0, 2.0]; 3]).to_string().starts_with("build a polyline of 3 points: it has no length"));
        assert!(error(&[[0.0, 0.0], [f64::NAN, 2.0]]).to_string().contains("point 1 is (NaN, 2) m"));
        assert_eq!(error(&[[-1e308, 0.0], [1e308, 0.0]]), PolylineError::TooLong);
        assert_eq!(error(&[[0.0, 0.0], [1e-200, 0.0]]), PolylineError::NoLength { points: 2 });
    }

    proptest! {
        /// Feet never move back, never pass the window, and are as near as those of a dense search.
        #[test]
        fn prop_feet_are_monotone_and_nearest(
            points in prop::collection::vec(prop::array::uniform2(-5.0..5.0f64), 2..12),
            at in prop::array::uniform2(-6.0..6.0f64),
            from in 0.0..1.0f64,
            window_m in 0.0..8.0f64,
        ) {
            let line = line(&points);
            let from_m = from * line.length_m();
            let foot = line.foot(at, from_m, window_m);
            prop_assert!(foot.along_m >= from_m && foot.along_m <= (from_m + window_m).min(line.length_m()) + 1e-12);
            let end_m = (from_m + window_m).min(line.length_m());
            let distance = |share: f64| super::super::distance(at, line.point_at(from_m + share * (end_m - from_m)));
            let nearest = (0..=400).map(|k| distance(f64::from(k) / 400.0)).fold(f64::INFINITY, f64::min);
            prop_assert!(foot.cross_track_m.abs() <= nearest + 1e-9);
            prop_assert!((super::super::distance(at, line.point_at(foot.along_m)) - foot.cross_track_m.abs()).abs() < 1e-9);
        }

        #[test]
        fn prop_json_round_trips(points in prop::collection::vec(prop::array::uniform2(-5.0..5.0f64), 2..12)) {
            let text = serde_json::to_string(&line(&points)).unwrap();
            prop_assert_eq!(serde_json::from_str::<Polyline>(&text).unwrap(), line(&points));
        }
    }
}
