//! Steps of teams over very rough hills, on one core.
//!
//! Before the table: time per step over complete runs by number of members, and relative to four members. Targets: four members 50 us, 100 members 2 ms.
//! Run: `cargo bench -p sastrugi-benches --bench formation`.

use divan::Bencher;
use sastrugi_navigation::formation::parameters::Shape;
use sastrugi_navigation::formation::{Team, TeamGround, TeamParameters};
use sastrugi_navigation::{CostModel, Ground, RouteSettings, SlopeCost, SlopeLimits, TravelMap, plan};
use sastrugi_numeric::Streams;
use serde_json::json;
use std::time::Instant;

const MEMBERS: [u32; 5] = [4, 10, 30, 100, 300];
/// Largest number of steps of a run that are timed.
const STEPS: u32 = 10_000;

fn main() {
    let course = Course::new();
    let on = TeamGround::new(course.ground());
    println!("members  steps  us per step  relative to four");
    let mut four = f64::NAN;
    for members in MEMBERS {
        let mut team = course.team(&on, members);
        let (begin, mut steps) = (Instant::now(), 0);
        while steps < STEPS && team.step().is_none() {
            steps += 1;
        }
        let step_us = begin.elapsed().as_secs_f64() * 1e6 / f64::from(steps);
        four = if members == 4 { step_us } else { four };
        println!("{members:7}  {steps:5}  {step_us:9.1}  {:15.1}", step_us / four);
    }
    divan::main();
}

/// Very rough hills with a route across.
struct Course {
    map: TravelMap,
    costs: CostModel,
    route_m: Vec<[f64; 2]>,
}

impl Course {
    fn new() -> Self {
        let params = json!({ "preset": "very_rough", "size_px": [1000, 1000] });
        let generator = sastrugi_terrain::prepare("spheroids", &params).expect("valid parameters");
        let heights = generator.generate(&Streams::for_seed(1, "terrain"), &[]).expect("a surface").heights;
        let map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0).expect("valid limits")).expect("a valid map");
        let costs = CostModel::new(SlopeCost::THESIS, None, &map).expect("valid costs");
        let ground = Ground { map: &map, costs: &costs, clearance: None };
        let route = plan(&ground, &RouteSettings::default(), [200, 200], [800, 800]).expect("a route");
        let route_m = route.smoothed.iter().map(|node| map.position_m(*node)).collect();
        Self { map, costs, route_m }
    }

    fn ground(&self) -> Ground<'_> {
        Ground { map: &self.map, costs: &self.costs, clearance: None }
    }

    /// A wedge with a spacing at which its members fit on the map.
    fn team<'a>(&self, on: &'a TeamGround<'_>, members: u32) -> Team<'a> {
        let parameters = TeamParameters {
            formation: Shape::Wedge,
            members: Some(members),
            spacing_m: if members > 30 { 3.0 } else { 10.0 },
            ..TeamParameters::default()
        };
        Team::new(on, &parameters, &self.route_m).expect("a team")
    }
}

/// A thousand steps from the start.
#[divan::bench(args = [4, 100], sample_count = 5)]
fn thousand_steps(bencher: Bencher, members: u32) {
    let course = Course::new();
    let on = TeamGround::new(course.ground());
    let start = course.team(&on, members);
    bencher.with_inputs(|| start.clone()).bench_local_values(|mut team| {
        (0..1000).for_each(|_| {
            team.step();
        });
        team
    });
}
