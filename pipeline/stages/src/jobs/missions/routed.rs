//! Missions along planned routes between the starts and goals of straight missions.
//!
//! If no route lies within the slope limits, the limits are raised step by step for that mission until one does. Every straight mission
//! therefore has a routed counterpart, and the two can be compared pair by pair. A note states how many missions needed raised limits.

use super::{MISSIONS, STAGE, file, read};
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield, unknown_id};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::operations::dem::input_error;
use crate::operations::drawn::{Drawn, Lines};
use crate::operations::room::{self, Lack};
use crate::operations::roughness::settings;
use crate::operations::routes::{Given, Site, planning_cells};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::Entry;
use sastrugi_mobility::missions::{Mission, Polyline};
use sastrugi_mobility::registry;
use sastrugi_mobility::vehicle::Vehicle;
use sastrugi_navigation::parameters::{Cost, RouteParameters};
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::{MissionsItem, RoughnessSection};
use sastrugi_schemas::{Kind, counted};
use sastrugi_store::dem;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// Step by which the slope limits are raised when no route lies within them, degrees.
const RELAXATION_DEG: f64 = 5.0;
/// Steepest limit tried, degrees.
const STEEPEST_DEG: f64 = 85.0;

/// How missions are routed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RoutedParameters {
    /// Vehicle that sets the slope limits, the rolling resistance and the wavelength band (see `sastrugi kinds vehicle`); required for
    /// `cost = "energy"` and `"band_rms"`.
    pub vehicle: Option<String>,
    /// Settings of the route planner.
    pub route: RouteParameters,
}

/// Description of this kind of missions.
pub fn kind() -> Kind {
    Kind {
        family: "missions",
        kind: "routed",
        summary: "planned and smoothed routes between the starts and goals of straight missions",
        source: "routes: Bayrak (2008) and docs/navigation.md; followed by pure pursuit (Coulter, 1992)",
        parameters: schema_of::<RoutedParameters>(),
    }
}

/// Settings that are the same on every heightfield.
struct Plan {
    parameters: RouteParameters,
    vehicle: Option<Vehicle>,
    roughness: RoughnessSection,
}

struct RoutedJob {
    plan: Arc<Plan>,
    straight: ItemRef,
    field: Heightfield,
    count: usize,
}

/// Adds the items of one table.
///
/// # Errors
/// An invalid item.
pub fn add(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    envelope: &MissionsItem,
    params: &Value,
) -> Result<(), BuildError> {
    let Some(of) = &envelope.of else {
        return Err(entry
            .error("of", "`of` is missing; name the straight missions whose starts and goals to use")
            .into());
    };
    if !envelope.terrains.is_empty() || envelope.seed.is_some() {
        let key = if envelope.seed.is_some() { "seed" } else { "terrains" };
        return Err(entry
            .error(
                key,
                format!("`{key}` does not apply to routed missions, which take their starts and goals from `of`"),
            )
            .into());
    }
    entry.check_keys::<MissionsItem>(params, &schema_of::<RoutedParameters>())?;
    let raw: RoutedParameters = read_parameters(params).map_err(|e| entry.refuse(e))?;
    raw.route.check().map_err(|e| entry.refuse(e.within("route")))?;
    let vehicle = raw.vehicle.as_deref().map(|name| registry::vehicle(name, &Map::new())).transpose();
    let vehicle = vehicle.map_err(|e| entry.refuse(e))?;
    let given = raw.route.check_given(vehicle.is_some(), false);
    given.map_err(|e| entry.refuse(e.within("route")))?;
    let Some(straight) = builder.missions.get(of).cloned() else {
        return Err(unknown_id(entry, "of", of, builder.missions.keys()).into());
    };
    let plan = Plan { parameters: raw.route.clone(), vehicle, roughness: builder.study.roughness.clone() };
    let plan = Arc::new(plan);
    let has_room = |_: &Heightfield, terrain: &Geometry| {
        let cells = planning_cells(terrain, &plan.parameters, plan.vehicle.as_ref());
        cells.map(drop).map_err(|e| Lack::from(e.within("route")))
    };
    room::check(builder, entry, straight.lines.iter().map(|line| &line.heightfield), has_room)?;
    let (mut all, mut rules) = (Vec::new(), None);
    for line in &straight.lines {
        let Some(field) = builder.heightfields.get(&line.heightfield).cloned() else { continue };
        let item = ItemRef::new(STAGE, &format!("{}@{}", envelope.id, line.heightfield));
        let parents = vec![field.item.clone(), line.item.clone()];
        let job = RoutedJob { plan: Arc::clone(&plan), straight: line.item.clone(), field, count: straight.count };
        builder.node(Node { item: item.clone(), parents, inputs: Vec::new(), stream: None, job: Box::new(job) })?;
        let rules = match &rules {
            Some((straight, known)) if Arc::ptr_eq(straight, &line.rules) => Arc::clone(known),
            _ => {
                let made = Arc::new(json!({ "straight": *line.rules, "routed": raw }));
                rules = Some((Arc::clone(&line.rules), Arc::clone(&made)));
                made
            }
        };
        all.push(Arc::new(Lines { item, rules, ..Lines::clone(line) }));
    }
    builder.missions.insert(envelope.id.clone(), Drawn { lines: all, ..straight });
    Ok(())
}

/// Ground prepared for the slope limits, and for raised limits as they are needed.
struct Grounds<'a> {
    heights: &'a Grid,
    plan: &'a Plan,
    given: Given,
    sites: Vec<Site>,
}

impl<'a> Grounds<'a> {
    fn new(heights: &'a Grid, plan: &'a Plan) -> Result<Self, JobError> {
        let thresholds = settings(&plan.roughness)?.thresholds;
        let given = Given { vehicle: plan.vehicle.clone(), thresholds, ..Given::default() };
        let first = Site::new(heights, &plan.parameters, &given)?;
        Ok(Self { heights, plan, given, sites: vec![first] })
    }

    /// The ground with limits raised the given number of times; `None` if they would be too steep.
    fn raised(&mut self, times: usize) -> Result<Option<&Site>, JobError> {
        while self.sites.len() <= times {
            let limits = self.sites[0].map().limits().degrees();
            let limits = limits.map(|deg| deg + RELAXATION_DEG * self.sites.len() as f64);
            if limits.iter().all(|deg| *deg > STEEPEST_DEG) {
                return Ok(None);
            }
            let [up, down] = limits.map(|deg| Some(deg.min(STEEPEST_DEG)));
            let parameters = RouteParameters { max_up_deg: up, max_down_deg: down, ..self.plan.parameters.clone() };
            self.sites.push(Site::new(self.heights, &parameters, &self.given)?);
        }
        Ok(self.sites.get(times))
    }

    /// The mission along its route, and how many times the limits were raised for it.
    fn routed(&mut self, mission: &Mission) -> Result<(Mission, usize), JobError> {
        for times in 0.. {
            let Some(site) = self.raised(times)? else { break };
            let pair = site.pair([mission.start_m, mission.goal_m])?;
            if let Some(route) = site.plan(&[pair])?.first().and_then(|found| found.route()) {
                let nodes = site.points(&route.smoothed);
                return Ok((along(mission, &nodes)?, times));
            }
        }
        Err(JobError::input(format!(
            "{}: no route connects start and goal at any slope; cells without data separate them",
            mission.id()
        )))
    }
}

/// The mission along a route. The ends of the route are cell centres; the mission runs from its exact start to its exact goal.
fn along(mission: &Mission, nodes: &[[f64; 3]]) -> Result<Mission, JobError> {
    let between = nodes.get(1..nodes.len().saturating_sub(1)).unwrap_or_default();
    let between = between.iter().map(|&[x, y, _]| [x, y]);
    let points: Vec<[f64; 2]> = [mission.start_m].into_iter().chain(between).chain([mission.goal_m]).collect();
    let line = Polyline::new(&points).map_err(|e| JobError::new(format!("{}: failed to {e}", mission.id())))?;
    Ok(Mission { draws: mission.draws, ..Mission::along(mission.index, line) })
}

impl Job for RoutedJob {
    fn recipe(&self) -> Value {
        let Plan { parameters, vehicle, roughness } = &*self.plan;
        json!({
            "straight": self.straight,
            "route": parameters,
            "vehicle": vehicle.as_ref().map(Vehicle::parameters),
            "roughness": (parameters.cost == Cost::Class).then_some(roughness),
        })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility, Room::Navigation, Room::Roughness]
    }

    fn memory_bytes(&self) -> u64 {
        (64 << 20) + 200 * self.field.cells
    }

    fn estimate(&self) -> Estimate {
        Estimate { seconds: 4e-7 * self.field.cells as f64 * self.count as f64, bytes: 2e3 * self.count as f64 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let heights = dem::read(&work.parent(&self.field.item, HEIGHTS)?).map_err(input_error)?.grid;
        let straight = read(&file(work, &self.straight)?)?;
        let mut grounds = Grounds::new(&heights, &self.plan)?;
        let routed = straight.iter().map(|mission| grounds.routed(mission)).collect::<Result<Vec<_>, _>>()?;
        let raised: Vec<usize> = routed.iter().map(|(_, times)| *times).filter(|times| *times > 0).collect();
        let missions: Vec<Mission> = routed.into_iter().map(|(mission, _)| mission).collect();
        work.write(MISSIONS, &serde_json::to_vec(&missions).map_err(JobError::new)?)?;
        let note = raised.iter().max().map(|most| {
            format!(
                "{} of {} had no route within the slope limits; there the limits were raised by up to {} degrees",
                raised.len(),
                counted(missions.len(), "mission"),
                RELAXATION_DEG * *most as f64
            )
        });
        Ok(Outcome { products: vec![Product::internal(MISSIONS)], notes: note.into_iter().collect() })
    }
}
