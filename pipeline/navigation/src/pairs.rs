//! Random starts and goals.
//!
//! Both are cells drawn uniformly from those farther than a border from the edge, and redrawn until both are free and far enough apart. Whether a
//! path connects them is left to the search. Pair k draws from its own stream (`pair-0001`, `pair-0002`, ...), so requesting more pairs does not
//! change earlier ones; on maps with the same cells, draw n of a pair is the same on all of them.

use crate::map::{Node, TravelMap};
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Draws after which a pair is abandoned.
const DRAWS_MAX: u32 = 100_000;
/// Relative rounding error of distances between cells.
const ROUNDING: f64 = 1e-9;

/// Rules for drawing starts and goals.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PairParameters {
    /// Least straight-line distance from start to goal, m; half the shorter side of the terrain if absent.
    #[schemars(transform = limits::positive)]
    pub distance_min_m: Option<f64>,
    /// Least distance of starts and goals from the edge of the terrain, m.
    #[schemars(transform = limits::not_negative)]
    pub border_m: f64,
}

impl PairParameters {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::not_negative("border_m", self.border_m)?;
        self.distance_min_m.map(|m| ParameterError::positive("distance_min_m", m)).transpose().map(drop)
    }

    /// Least distance from start to goal on a terrain, m.
    fn distance_min_on_m(&self, terrain: &Geometry) -> f64 {
        let [width_m, height_m] = terrain.size();
        self.distance_min_m.unwrap_or(0.5 * width_m.min(height_m))
    }
}

/// A start and a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pair {
    /// Start node.
    pub start: Node,
    /// Goal node.
    pub goal: Node,
    /// Number of draws, at least 1.
    pub draws: u32,
}

/// Why no pairs could be drawn. Messages read after "failed to".
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PairError {
    /// The border leaves no cells.
    #[error(
        "draw starts and goals: a border of {border_m} m on every side leaves no cells of the terrain, which is {:.2} x {:.2} m; \
         `border_m` may be at most {border_max_m} m",
        size_m[0],
        size_m[1]
    )]
    Border {
        /// Border, m.
        border_m: f64,
        /// Extent of the terrain east-west and north-south, m.
        size_m: [f64; 2],
        /// Widest border that leaves cells, m, rounded down to 1 mm.
        border_max_m: f64,
    },
    /// The cells inside the border are closer together than starts and goals must be.
    #[error(
        "draw starts and goals: inside a border of {border_m} m cells are at most {longest_m:.2} m apart, but `distance_min_m` is \
         {distance_min_m:.2} m; lower it (by default it is half the shorter side of the terrain), or lower `border_m`"
    )]
    Distance {
        /// Border, m.
        border_m: f64,
        /// Distance between the farthest cells inside it, m.
        longest_m: f64,
        /// Least distance, m.
        distance_min_m: f64,
    },
    /// No draw satisfied the rules.
    #[error(
        "draw pair {number}: none of {draws} draws gave two free cells at least {distance_min_m} m apart; lower `distance_min_m`, or \
         block less of the terrain"
    )]
    Exhausted {
        /// Number of the pair, from 1.
        number: usize,
        /// Number of draws.
        draws: u32,
        /// Least distance, m.
        distance_min_m: f64,
    },
}

impl PairError {
    /// The key to change.
    pub fn key(&self) -> &'static str {
        match self {
            Self::Border { .. } => "border_m",
            Self::Distance { .. } | Self::Exhausted { .. } => "distance_min_m",
        }
    }
}

/// Checks that a terrain, if nothing on it is blocked, has places for starts and goals.
///
/// # Errors
/// A border that leaves no cells, or cells inside it that are all too close to each other.
pub fn check_size(terrain: &Geometry, rules: &PairParameters) -> Result<(), PairError> {
    let [[_, rows], [_, cols]] = inside(terrain, rules.border_m)?;
    let [dx, dy] = terrain.cell;
    let (x_m, y_m) = ((cols - 1) as f64 * dx, (rows - 1) as f64 * dy);
    let longest_m = (x_m * x_m + y_m * y_m).sqrt();
    let distance_min_m = rules.distance_min_on_m(terrain);
    match distance_min_m <= longest_m * (1.0 + ROUNDING) {
        true => Ok(()),
        false => Err(PairError::Distance { border_m: rules.border_m, longest_m, distance_min_m }),
    }
}

/// Draws pairs on a map.
///
/// # Errors
/// As [`check_size`], or rules that no draw satisfies.
///
/// # Examples
/// ```
/// use sastrugi_navigation::pairs::{PairParameters, draw_pairs};
/// use sastrugi_navigation::{SlopeLimits, TravelMap};
/// use sastrugi_numeric::{Geometry, Grid, Streams};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let heights = Grid::filled(Geometry::square(20, 20, 1.0), 0.0);
/// let map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0)?)?;
/// let rules = PairParameters { distance_min_m: Some(5.0), border_m: 2.0 };
/// let streams = Streams::for_seed(7, "route");
/// let pairs = draw_pairs(&map, &rules, 10, &streams)?;
/// assert!(pairs.iter().all(|pair| map.place(pair.start).iter().all(|at| (2..18).contains(at))));
/// // Requesting fewer gives the first of the same pairs.
/// assert_eq!(draw_pairs(&map, &rules, 4, &streams)?, pairs[..4]);
/// # Ok(())
/// # }
/// ```
pub fn draw_pairs(
    map: &TravelMap,
    rules: &PairParameters,
    count: usize,
    streams: &Streams,
) -> Result<Vec<Pair>, PairError> {
    let terrain = &map.heights().geometry;
    check_size(terrain, rules)?;
    let cells = inside(terrain, rules.border_m)?;
    let [[_, rows], [_, cols]] = cells;
    let distance_min_m = rules.distance_min_on_m(terrain);
    let pair = |index: usize| {
        let mut stream = streams.stream(&format!("pair-{:04}", index + 1));
        for draws in 1..=DRAWS_MAX {
            let mut node = || {
                let (row, col) = (stream.below(rows as u64), stream.below(cols as u64));
                map.node(cells[0][0] + row as usize, cells[1][0] + col as usize)
            };
            let (start, goal) = (node(), node());
            if !map.is_blocked(start) && !map.is_blocked(goal) && distance_m(map, start, goal) >= distance_min_m {
                return Ok(Pair { start, goal, draws });
            }
        }
        Err(PairError::Exhausted { number: index + 1, draws: DRAWS_MAX, distance_min_m })
    };
    (0..count).map(pair).collect()
}

/// First row and number of rows inside the border, and the same for columns.
fn inside(terrain: &Geometry, border_m: f64) -> Result<[[usize; 2]; 2], PairError> {
    let Geometry { rows, cols, cell: [dx, dy], .. } = *terrain;
    let within = |cells: usize, cell_m: f64| {
        let skip = libm::ceil((border_m / cell_m).min(cells as f64)) as usize;
        (cells > 2 * skip).then(|| [skip, cells - 2 * skip])
    };
    match (within(rows, dy), within(cols, dx)) {
        (Some(rows), Some(cols)) => Ok([rows, cols]),
        _ => Err(PairError::Border { border_m, size_m: terrain.size(), border_max_m: border_max_m(terrain) }),
    }
}

/// Widest border that leaves at least one cell, m, rounded down to 1 mm.
fn border_max_m(terrain: &Geometry) -> f64 {
    let Geometry { rows, cols, cell: [dx, dy], .. } = *terrain;
    let of = |cells: usize, cell_m: f64| (cells.saturating_sub(1) / 2) as f64 * cell_m;
    libm::floor(1e3 * of(rows, dy).min(of(cols, dx))) / 1e3
}

fn distance_m(map: &TravelMap, a: Node, b: Node) -> f64 {
    let ([x0, y0], [x1, y1]) = (map.position_m(a), map.position_m(b));
    ((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::SlopeLimits;
    use sastrugi_numeric::{Geometry, Grid};

    fn map(rows: usize, cols: usize, blocked: impl Fn(usize, usize) -> bool) -> TravelMap {
        let geometry = Geometry::square(rows, cols, 0.5);
        let height = |k: usize| if blocked(k / cols, k % cols) { f64::NAN } else { 0.0 };
        let heights = Grid::new(geometry, (0..rows * cols).map(height).collect());
        TravelMap::new(heights, SlopeLimits::new(30.0, 30.0).unwrap()).unwrap()
    }

    fn streams() -> Streams {
        Streams::for_item(7, "route", "hills")
    }

    #[test]
    fn prop_pairs_satisfy_the_rules() {
        let map = map(40, 60, |row, col| (row + col) % 3 == 0);
        let rules = PairParameters { distance_min_m: Some(8.0), border_m: 2.0 };
        let pairs = draw_pairs(&map, &rules, 200, &streams()).unwrap();
        assert_eq!(pairs.len(), 200);
        for pair in &pairs {
            assert!(distance_m(&map, pair.start, pair.goal) >= 8.0);
            for node in [pair.start, pair.goal] {
                let [row, col] = map.place(node);
                assert!((4..36).contains(&row) && (4..56).contains(&col) && !map.is_blocked(node));
            }
        }
        assert_eq!(draw_pairs(&map, &rules, 20, &streams()).unwrap(), pairs[..20]);
    }

    /// Starts of 4000 pairs over 4 quarters of a free map: chi-square with 3 degrees of freedom below 30.7 (false alarm 1e-6); detects a quarter
    /// drawn 15 % too often.
    #[test]
    fn stat_starts_are_uniform() {
        let map = map(40, 40, |_, _| false);
        let rules = PairParameters { distance_min_m: Some(0.5), border_m: 0.0 };
        let mut counts = [0.0f64; 4];
        for pair in draw_pairs(&map, &rules, 4000, &streams()).unwrap() {
            let [row, col] = map.place(pair.start);
            counts[2 * (row / 20) + col / 20] += 1.0;
        }
        let chi_square: f64 = counts.iter().map(|n| (n - 1000.0) * (n - 1000.0) / 1000.0).sum();
        assert!(chi_square < 30.7, "{counts:?}");
    }

    /// The default distance is half the shorter side: 10 m on 20 m x 30 m. A rule of half the longer side would allow none below 15 m.
    #[test]
    fn val_the_default_distance_is_half_the_shorter_side() {
        let map = map(40, 60, |_, _| false);
        let pairs = draw_pairs(&map, &PairParameters::default(), 300, &streams()).unwrap();
        let least_m = pairs.iter().map(|pair| distance_m(&map, pair.start, pair.goal)).fold(f64::INFINITY, f64::min);
        assert!((10.0..12.0).contains(&least_m), "{least_m}");
    }

    /// A border of 8 m leaves out two rows of 4 m and three columns of 3 m at each side, and nothing else.
    #[test]
    fn val_the_border_is_in_metres() {
        let map = crate::testing::oblong_map_of(10, 20, SlopeLimits::new(30.0, 30.0).unwrap(), |_, _| 0.0);
        let rules = PairParameters { distance_min_m: Some(1.0), border_m: 8.0 };
        let pairs = draw_pairs(&map, &rules, 1000, &streams()).unwrap();
        let nodes = pairs.iter().flat_map(|pair| [pair.start, pair.goal]);
        let places: Vec<[usize; 2]> = nodes.map(|node| map.place(node)).collect();
        let range = |axis: usize| {
            let along = places.iter().map(|place| place[axis]);
            [along.clone().min(), along.max()]
        };
        assert_eq!([range(0), range(1)], [[Some(2), Some(7)], [Some(3), Some(16)]]);
    }

    /// Starts and goals may be as far apart as the farthest cells inside the border, and no farther. A wide border alone can bring all cells
    /// closer together than the default distance.
    #[test]
    fn val_a_terrain_has_room_up_to_its_diagonal() {
        let terrain = Geometry::square(9, 12, 0.5);
        let has_room =
            |distance_min_m, border_m| check_size(&terrain, &PairParameters { distance_min_m, border_m }).is_ok();
        // Inside 1 m: 5 x 8 cells, whose outer centres are 2 m and 3.5 m apart.
        let longest_m = 16.25_f64.sqrt();
        assert!(has_room(Some(longest_m), 1.0) && !has_room(Some(longest_m + 1e-3), 1.0));
        assert!(has_room(None, 0.0) && !has_room(None, 2.0));
    }

    #[test]
    fn val_impossible_rules_are_refused() {
        let rules = |distance_min_m, border_m| PairParameters { distance_min_m: Some(distance_min_m), border_m };
        let free = map(10, 10, |_, _| false);
        let refused = |map: &TravelMap, distance_min_m, border_m| {
            draw_pairs(map, &rules(distance_min_m, border_m), 1, &streams()).unwrap_err()
        };
        // Ten cells of 0.5 m: a border of four leaves two of them, whose centres are 0.71 m apart along the diagonal.
        let error = refused(&free, 1.0, 2.5);
        assert_eq!(
            error.to_string(),
            "draw starts and goals: a border of 2.5 m on every side leaves no cells of the terrain, which is 5.00 x 5.00 m; \
             `border_m` may be at most 2 m"
        );
        assert_eq!(error.key(), "border_m");
        let error = refused(&free, 0.75, 2.0);
        assert!(error.to_string().contains("at most 0.71 m apart, but `distance_min_m` is 0.75 m"), "{error}");
        assert_eq!(error.key(), "distance_min_m");
        // Two cells are far enough apart, but blocked.
        let error = refused(&map(10, 10, |row, col| row + col > 2), 4.0, 0.0);
        assert!(error.to_string().contains("pair 1: none of 100000 draws"), "{error}");
        assert!(rules(-1.0, 0.0).check().is_err() && rules(1.0, f64::NAN).check().is_err());
    }
}
