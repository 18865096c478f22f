//! Costs of travel: length, slope, and a factor for the ground at each node.
//!
//! A step of horizontal length d and rise dz costs `sqrt(d^2 + dz^2) g(dz / d) f`, where f is the mean of the factors of both nodes. The thesis only
//! requires that steep steps cost more; `g(s) = 1 + k_up max(s, 0) + k_down max(-s, 0)` is our reading. Costs are in metres of level ground.

use crate::map::{Direction, Neighbourhood, Node, TravelMap};
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[cfg(test)]
mod tests;

/// Cost of a metre of path, as a function of slope.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum SlopeCost {
    /// `1 + up max(s, 0) + down max(-s, 0)`.
    Linear {
        /// Weight of climbing, 0 or above.
        up: f64,
        /// Weight of descending, 0 or above.
        down: f64,
    },
    /// Energy that a vehicle needs relative to level ground: `max(floor, 1 + s / resistance)`. The floor limits what a descent can save.
    Energy {
        /// Rolling resistance, a share of the weight, above 0.
        resistance: f64,
        /// Least cost per metre, above 0 and at most 1.
        floor: f64,
    },
}

impl SlopeCost {
    /// Cost of slopes as in the thesis, with weights of 1.
    pub const THESIS: Self = Self::Linear { up: 1.0, down: 1.0 };

    /// Refuses weights out of range.
    ///
    /// # Errors
    /// The first weight out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        match *self {
            Self::Linear { up, down } => {
                ParameterError::not_negative("up_weight", up)?;
                ParameterError::not_negative("down_weight", down).map(drop)
            }
            Self::Energy { resistance, floor } => {
                ParameterError::positive("resistance", resistance)?;
                ParameterError::positive("floor", floor)?;
                match floor <= 1.0 {
                    true => Ok(()),
                    false => Err(ParameterError::new("floor", format!("is {floor}; it must be at most 1"))),
                }
            }
        }
    }

    /// Cost per metre at a slope (rise over run in the direction of travel).
    #[inline]
    pub fn at(&self, slope: f64) -> f64 {
        match *self {
            Self::Linear { up, down } => 1.0 + up * slope.max(0.0) + down * (-slope).max(0.0),
            Self::Energy { resistance, floor } => (1.0 + slope / resistance).max(floor),
        }
    }

    fn least(&self) -> f64 {
        match *self {
            Self::Linear { .. } => 1.0,
            Self::Energy { floor, .. } => floor,
        }
    }
}

/// Costs of travel over a map.
#[derive(Clone, Debug)]
pub struct CostModel {
    slope: SlopeCost,
    /// Factor of each node.
    factors: Option<Vec<f64>>,
    least: f64,
}

impl CostModel {
    /// Costs from slope, multiplied by a factor per node if there are factors (roughness class, band RMS, a raster).
    ///
    /// # Errors
    /// Weights out of range; a number of factors other than that of nodes; a factor of a free node that is not positive and finite.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_navigation::{CostModel, Direction, SlopeCost, SlopeLimits, TravelMap};
    /// use sastrugi_numeric::{Geometry, Grid};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let heights = Grid::new(Geometry::square(2, 2, 1.0), vec![0.75, 0.75, 0.0, 0.0]);
    /// let map = TravelMap::new(heights, SlopeLimits::new(40.0, 40.0)?)?;
    /// let costs = CostModel::new(SlopeCost::Linear { up: 2.0, down: 0.5 }, None, &map)?;
    /// // 1 m along and 0.75 m up are 1.25 m of path.
    /// let (north, south) = (Direction { rows: -1, cols: 0 }, Direction { rows: 1, cols: 0 });
    /// assert_eq!(costs.step(&map, map.node(1, 0), map.node(0, 0), north), 1.25 * (1.0 + 2.0 * 0.75));
    /// assert_eq!(costs.step(&map, map.node(0, 0), map.node(1, 0), south), 1.25 * (1.0 + 0.5 * 0.75));
    /// # Ok(())
    /// # }
    /// ```
    pub fn new(slope: SlopeCost, factors: Option<Vec<f64>>, map: &TravelMap) -> Result<Self, ParameterError> {
        slope.check()?;
        let mut least = slope.least();
        if let Some(factors) = &factors {
            if factors.len() != map.len() {
                let message = format!("has {} values for {} cells", factors.len(), map.len());
                return Err(ParameterError::new("factors", message));
            }
            let free = || (0..map.len() as Node).filter(|node| !map.is_blocked(*node));
            let valid = |factor: f64| factor > 0.0 && factor.is_finite();
            if let Some(node) = free().find(|node| !valid(factors[*node as usize])) {
                let ([row, col], factor) = (map.place(node), factors[node as usize]);
                let message = format!("is {factor} at row {row}, column {col}; it must be a finite number above 0");
                return Err(ParameterError::new("factors", message));
            }
            least *= free().map(|node| factors[node as usize]).reduce(f64::min).unwrap_or(1.0);
        }
        Ok(Self { slope, factors, least })
    }

    /// The cost of slopes.
    pub fn slope(&self) -> SlopeCost {
        self.slope
    }

    /// Least cost per metre of path, which search bounds rely on.
    pub fn least(&self) -> f64 {
        self.least
    }

    /// Cost of a step to a neighbour, whether the step is allowed or not.
    #[inline]
    pub fn step(&self, map: &TravelMap, node: Node, target: Node, direction: Direction) -> f64 {
        let run_m = map.step_m(direction);
        let rise_m = map.height_m(target) - map.height_m(node);
        let factor = self.factors.as_ref().map_or(1.0, |f| 0.5 * (f[node as usize] + f[target as usize]));
        self.piece(run_m, rise_m) * factor
    }

    /// Cost of a straight piece where the factor is 1.
    #[inline]
    pub fn piece(&self, run_m: f64, rise_m: f64) -> f64 {
        (run_m * run_m + rise_m * rise_m).sqrt() * self.slope.at(rise_m / run_m)
    }

    /// Whether any node has a factor other than 1.
    pub(crate) fn has_factors(&self) -> bool {
        self.factors.is_some()
    }

    /// Factor of a node.
    #[inline]
    pub fn factor(&self, node: Node) -> f64 {
        self.factors.as_ref().map_or(1.0, |f| f[node as usize])
    }

    /// A lower bound on the cost of any path of steps between two nodes: the shortest possible length at the least cost per metre.
    #[inline]
    pub fn bound(&self, map: &TravelMap, from: Node, to: Node, neighbourhood: Neighbourhood) -> f64 {
        self.bound_between(map, Spot::of(map, from), Spot::of(map, to), neighbourhood)
    }

    /// The same from horizontal lengths alone, for ground of unknown height.
    #[inline]
    pub fn level_bound(&self, map: &TravelMap, from: Node, to: Node, neighbourhood: Neighbourhood) -> f64 {
        self.least * by_steps_m(map.cell_m(), Spot::of(map, from).apart(Spot::of(map, to)), neighbourhood)
    }

    /// A lower bound on the cost of any path between two nodes, including lines at any angle.
    #[inline]
    pub fn straight(&self, map: &TravelMap, from: Node, to: Node) -> f64 {
        self.least * straight_m(map.cell_m(), Spot::of(map, from).apart(Spot::of(map, to)))
    }

    /// As [`Self::bound`], for known spots.
    #[inline]
    pub(crate) fn bound_between(&self, map: &TravelMap, from: Spot, to: Spot, neighbourhood: Neighbourhood) -> f64 {
        let (apart, cell_m) = (from.apart(to), map.cell_m());
        self.least * by_steps_m(cell_m, apart, neighbourhood).max(straight_m(cell_m, apart))
    }
}

/// Row, column and height in m of a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot([f64; 3]);

impl Spot {
    #[inline]
    pub(crate) fn of(map: &TravelMap, node: Node) -> Self {
        let [row, col] = map.point(node);
        Self([row, col, map.height_m(node)])
    }

    /// Rows, columns and metres of height between two spots.
    #[inline]
    fn apart(self, other: Self) -> [f64; 3] {
        [0, 1, 2].map(|k| (self.0[k] - other.0[k]).abs())
    }
}

/// Length of the shortest path of steps over level ground, m.
#[inline]
fn by_steps_m([dx, dy]: [f64; 2], [down, across, _]: [f64; 3], neighbourhood: Neighbourhood) -> f64 {
    match neighbourhood {
        Neighbourhood::Four => across * dx + down * dy,
        Neighbourhood::Eight => {
            let both = across.min(down);
            both * (dx * dx + dy * dy).sqrt() + (across - both) * dx + (down - both) * dy
        }
    }
}

/// Length of the straight line including rise, m.
#[inline]
fn straight_m([dx, dy]: [f64; 2], [down, across, rise_m]: [f64; 3]) -> f64 {
    ((across * dx) * (across * dx) + (down * dy) * (down * dy) + rise_m * rise_m).sqrt()
}
