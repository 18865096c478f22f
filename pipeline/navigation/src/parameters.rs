//! Route parameters, as a study states them.

use crate::cost::SlopeCost;
use crate::map::{Neighbourhood, SlopeLimits};
use crate::route::{self, RouteSettings};
use crate::vertices::VertexSettings;
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[cfg(test)]
mod tests;

/// Steepest climb and descent if neither the study nor a vehicle states them, degrees. The thesis gives no value.
const SLOPE_MAX_DEG: f64 = 30.0;

/// Search method of a route.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Search {
    /// A* over all cells.
    #[default]
    Grid,
    /// A* over a roadmap of the cells where the ground changes (Bayrak, 2008).
    Roadmap,
    /// Lazy Theta* over all cells, with straight legs at any angle (Nash, Koenig and Tovey, 2010).
    ThetaStar,
    /// Anytime weighted A* over all cells: it improves its path until the path is the cheapest or the expansions are used up.
    Anytime,
}

impl Search {
    /// All methods.
    pub const ALL: [Self; 4] = [Self::Grid, Self::Roadmap, Self::ThetaStar, Self::Anytime];

    /// Name in studies and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Grid => "grid",
            Self::Roadmap => "roadmap",
            Self::ThetaStar => "theta_star",
            Self::Anytime => "anytime",
        }
    }
}

/// Costs of travel besides length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cost {
    /// Slope: `1 + up_weight s` uphill, `1 + down_weight s` downhill.
    #[default]
    Slope,
    /// Energy that the vehicle needs, relative to level ground, from its rolling resistance.
    Energy,
    /// Slope, multiplied by a factor for the cell's roughness class.
    Class,
    /// Slope, multiplied by `1 + band_rms_weight_per_m` times the RMS of heights around the cell in the vehicle's band of wavelengths.
    BandRms,
    /// Slope, multiplied by a factor from a raster.
    Raster,
}

impl Cost {
    /// Name in studies and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Slope => "slope",
            Self::Energy => "energy",
            Self::Class => "class",
            Self::BandRms => "band_rms",
            Self::Raster => "raster",
        }
    }
}

/// Parameters of a route.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RouteParameters {
    /// Search method.
    pub method: Search,
    /// Neighbours of a cell: 4, or 8 with the diagonals, which never cut the corner of a blocked cell.
    #[schemars(range(min = 4, max = 8), extend("multipleOf" = 4))]
    pub neighbours: u8,
    /// Plan on cells of about this size, m, each the mean of an integer number of terrain cells; the terrain's own cells if absent.
    #[schemars(transform = limits::positive)]
    pub plan_cell_m: Option<f64>,
    /// `roadmap`: drop critical points that differ in height from the adjacent ones by no more than this, m; the cell size if absent.
    #[schemars(transform = limits::not_negative)]
    pub step_over_m: Option<f64>,
    /// `roadmap`: height-difference threshold: change of height after which a line of cells gets another vertex, m; none if absent.
    #[schemars(transform = limits::positive)]
    pub threshold_m: Option<f64>,
    /// `roadmap`: add vertices until the roadmap connects everything that the ground connects.
    pub repair: bool,
    /// `roadmap`: follow the thesis' listings as printed, even where they contradict its text or have no effect.
    pub literal: bool,
    /// `anytime`: the first path costs at most this many times the optimum.
    #[schemars(transform = limits::half_open(1.0, f64::INFINITY))]
    pub suboptimality: f64,
    /// `anytime`: number of expansions after which the best path so far is used.
    #[schemars(range(min = 1))]
    pub expansions_max: Option<u64>,
    /// Cost that smoothing may add for each waypoint that it removes, metres of level ground.
    #[schemars(transform = limits::not_negative)]
    pub smoothing_tolerance_m: f64,
    /// Steepest climb, degrees; the vehicle's if absent, or 30 without a vehicle.
    #[schemars(transform = limits::between(0.0, 90.0))]
    pub max_up_deg: Option<f64>,
    /// Steepest descent, degrees; the vehicle's if absent, or 30 without a vehicle.
    #[schemars(transform = limits::between(0.0, 90.0))]
    pub max_down_deg: Option<f64>,
    /// Costs of travel besides length.
    pub cost: Cost,
    /// Weight of climbing.
    #[schemars(transform = limits::not_negative)]
    pub up_weight: f64,
    /// Weight of descending.
    #[schemars(transform = limits::not_negative)]
    pub down_weight: f64,
    /// `cost = "energy"`: least cost per metre, above 0 and at most 1, because descents return no energy.
    pub energy_floor: f64,
    /// `cost = "class"`: factors of low, semi and high roughness.
    #[schemars(transform = limits::positive)]
    pub class_factors: [f64; 3],
    /// `cost = "band_rms"`: weight of the RMS, 1/m.
    #[schemars(transform = limits::not_negative)]
    pub band_rms_weight_per_m: f64,
    /// Width of the team, m: narrower gaps cost more (CanFit); gaps are ignored if absent.
    #[schemars(transform = limits::positive)]
    pub width_m: Option<f64>,
    /// Weight of narrow gaps: cost is multiplied by `1 + weight (width / gap - 1)`, at most `clearance_max`.
    #[schemars(transform = limits::not_negative)]
    pub clearance_weight: f64,
    /// Largest factor for a narrow gap.
    #[schemars(transform = limits::half_open(1.0, f64::INFINITY))]
    pub clearance_max: f64,
    /// Distance kept from obstacles, m.
    #[schemars(transform = limits::not_negative)]
    pub obstacle_margin_m: f64,
}

impl Default for RouteParameters {
    fn default() -> Self {
        Self {
            method: Search::Grid,
            neighbours: 8,
            plan_cell_m: None,
            step_over_m: None,
            threshold_m: None,
            repair: true,
            literal: false,
            suboptimality: 2.0,
            expansions_max: None,
            smoothing_tolerance_m: 0.0,
            max_up_deg: None,
            max_down_deg: None,
            cost: Cost::Slope,
            up_weight: 1.0,
            down_weight: 1.0,
            energy_floor: 0.1,
            class_factors: [1.0, 2.0, 4.0],
            band_rms_weight_per_m: 20.0,
            width_m: None,
            clearance_weight: 1.0,
            clearance_max: 10.0,
            obstacle_margin_m: 0.0,
        }
    }
}

impl RouteParameters {
    /// Refuses values that are out of range on any terrain.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        self.neighbourhood()?;
        for (key, value) in
            [("plan_cell_m", self.plan_cell_m), ("threshold_m", self.threshold_m), ("width_m", self.width_m)]
        {
            value.map(|m| ParameterError::positive(key, m)).transpose()?;
        }
        self.step_over_m.map(|m| ParameterError::not_negative("step_over_m", m)).transpose()?;
        if !(self.suboptimality >= 1.0 && self.suboptimality.is_finite()) {
            return Err(at_least_1("suboptimality", self.suboptimality));
        }
        if self.expansions_max == Some(0) {
            return Err(ParameterError::new("expansions_max", "is 0; it must be at least 1"));
        }
        ParameterError::not_negative("smoothing_tolerance_m", self.smoothing_tolerance_m)?;
        self.limits([SLOPE_MAX_DEG; 2])?;
        self.linear_cost().check()?;
        self.slope_cost(1.0)?;
        for (k, factor) in self.class_factors.into_iter().enumerate() {
            ParameterError::positive(&format!("class_factors.{k}"), factor)?;
        }
        ParameterError::not_negative("band_rms_weight_per_m", self.band_rms_weight_per_m)?;
        ParameterError::not_negative("clearance_weight", self.clearance_weight)?;
        if !(self.clearance_max >= 1.0 && self.clearance_max.is_finite()) {
            return Err(at_least_1("clearance_max", self.clearance_max));
        }
        ParameterError::not_negative("obstacle_margin_m", self.obstacle_margin_m).map(drop)
    }

    /// Refuses a cost whose input is missing, or an input that the cost does not use.
    ///
    /// # Errors
    /// A cost without the vehicle or raster that it needs, or a raster with another cost.
    pub fn check_given(&self, has_vehicle: bool, has_raster: bool) -> Result<(), ParameterError> {
        let refuse = |message: String| Err(ParameterError::new("cost", message));
        match self.cost {
            Cost::Energy | Cost::BandRms if !has_vehicle => {
                refuse(format!("is \"{}\", which needs a vehicle", self.cost.name()))
            }
            Cost::Raster if !has_raster => {
                refuse("is \"raster\", which needs the `cost_raster` of a [[route]]".to_owned())
            }
            Cost::Raster => Ok(()),
            _ if has_raster => {
                refuse(format!("is \"{}\"; `cost_raster` requires `cost = \"raster\"`", self.cost.name()))
            }
            _ => Ok(()),
        }
    }

    /// The steps that are allowed.
    ///
    /// # Errors
    /// A number of neighbours other than 4 or 8.
    pub fn neighbourhood(&self) -> Result<Neighbourhood, ParameterError> {
        match self.neighbours {
            4 => Ok(Neighbourhood::Four),
            8 => Ok(Neighbourhood::Eight),
            other => Err(ParameterError::new("neighbours", format!("is {other}; a cell has 4 or 8 neighbours"))),
        }
    }

    /// Slope limits; `vehicle_deg` holds the vehicle's limits uphill and downhill, degrees.
    ///
    /// # Errors
    /// A limit that is not above 0 and below 90 degrees.
    pub fn limits(&self, vehicle_deg: [f64; 2]) -> Result<SlopeLimits, ParameterError> {
        let [up_deg, down_deg] = vehicle_deg;
        SlopeLimits::new(self.max_up_deg.unwrap_or(up_deg), self.max_down_deg.unwrap_or(down_deg))
    }

    /// Slope limits without a vehicle, degrees.
    pub const WITHOUT_VEHICLE_DEG: [f64; 2] = [SLOPE_MAX_DEG; 2];

    /// Cost of slopes; `rolling_resistance` is the vehicle's, for `cost = "energy"`.
    ///
    /// # Errors
    /// Values out of range.
    pub fn slope_cost(&self, rolling_resistance: f64) -> Result<SlopeCost, ParameterError> {
        let cost = match self.cost {
            Cost::Energy => SlopeCost::Energy { resistance: rolling_resistance, floor: self.energy_floor },
            _ => self.linear_cost(),
        };
        cost.check().map_err(|e| match e.key.as_str() {
            "floor" => ParameterError { key: "energy_floor".to_owned(), ..e },
            _ => e,
        })?;
        Ok(cost)
    }

    fn linear_cost(&self) -> SlopeCost {
        SlopeCost::Linear { up: self.up_weight, down: self.down_weight }
    }

    /// Factor of a cell for its roughness class (0 low, 1 semi, 2 high); cells without a class count as high.
    pub fn class_factor(&self, code: u8) -> f64 {
        self.class_factors.get(usize::from(code)).copied().unwrap_or(self.class_factors[2])
    }

    /// Factor of a cell for the RMS around it, m.
    pub fn band_rms_factor(&self, rms_m: f64) -> f64 {
        1.0 + self.band_rms_weight_per_m * rms_m
    }

    /// Settings of the search, for cells of size `cell_m`.
    ///
    /// # Errors
    /// Values out of range.
    pub fn settings(&self, cell_m: f64) -> Result<RouteSettings, ParameterError> {
        let method = match self.method {
            Search::Grid => route::Method::GridAstar,
            Search::Roadmap => route::Method::Roadmap(self.vertex_settings(cell_m)?),
            Search::ThetaStar => route::Method::ThetaStar,
            Search::Anytime => {
                route::Method::Anytime { weight: self.suboptimality, budget: self.expansions_max.unwrap_or(u64::MAX) }
            }
        };
        let settings = RouteSettings {
            method,
            neighbourhood: self.neighbourhood()?,
            landmarks: 0,
            smoothing_tolerance: self.smoothing_tolerance_m,
        };
        settings.check()?;
        Ok(settings)
    }

    fn vertex_settings(&self, cell_m: f64) -> Result<VertexSettings, ParameterError> {
        let settings = VertexSettings {
            step_over_m: self.step_over_m.unwrap_or(cell_m),
            threshold_m: self.threshold_m,
            repair: self.repair,
            literal_filter: self.literal,
            literal_border: self.literal,
            literal_alone: self.literal,
        };
        settings.check()?;
        Ok(settings)
    }
}

fn at_least_1(key: &str, value: f64) -> ParameterError {
    ParameterError::new(key, format!("is {value}; it must be finite and at least 1"))
}
