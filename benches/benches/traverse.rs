//! The Husky over the published terrains (1009^2 cells of 5 cm), on one core, compared with a floor: the height lookups of its
//! wheel rays alone.
//!
//! Items are time steps of 1/500 s, settling included: the real-time factor is items per second over 500. Targets: 1 500 000
//! steps per second and core; 40 times the real-time factor of MuJoCo, which drives the same missions on the same terrains in
//! the same run (`floors/traverse.py`, printed before the table with ours; its processor time is set against our elapsed
//! time, the fastest of three, so other work on the machine only lowers the ratio). It needs the environment that
//! `./test --full` or `tests/readers/set_up peer` installs. Run: `cargo bench -p sastrugi-benches --bench traverse`.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use sastrugi_benches::floor_in;
use sastrugi_mobility::missions::{Mission, MissionParameters, MissionSettings, StartCells, draw_missions};
use sastrugi_mobility::vehicle::{Ground, TraverseParameters, TraverseSettings, Vehicle, drive};
use sastrugi_numeric::{Grid, Streams, Surface};
use sastrugi_roughness::{ClassThresholds, classify, close_disk, moore_gradient};
use serde_json::json;
use std::time::Instant;

/// Missions of one terrain in a sample.
const MISSIONS: u32 = 5;
/// Rays of four wheels: three discs of thirteen.
const RAYS: usize = 4 * 3 * 13;

/// Fractal dimensions of the published terrains.
const DIMENSIONS: [f64; 3] = [2.3, 2.45, 2.6];

fn main() {
    for dimension in DIMENSIONS {
        let course = Course::new(dimension);
        let ours = course.real_time_factor();
        match course.peer().as_deref() {
            Some(&[theirs, steps]) => println!(
                "D = {dimension}: {ours:.0} times real time; MuJoCo {theirs:.1} ({steps:.0} steps/s); ratio {:.0}",
                ours / theirs
            ),
            _ => println!("D = {dimension}: {ours:.0} times real time; no Python with MuJoCo"),
        }
    }
    divan::main();
}

struct Course {
    vehicle: Vehicle,
    settings: TraverseSettings,
    dem: Grid,
    missions: Vec<Mission>,
}

impl Course {
    fn new(fractal_dimension: f64) -> Self {
        let params = json!({ "high": { "fractal_dimension": fractal_dimension } });
        let generator = sastrugi_terrain::prepare("multifractal", &params).expect("valid parameters");
        let dem = generator.generate(&Streams::for_seed(1, "terrain"), &[]).expect("a surface").heights.as_stored();
        let (vehicle, settings) = TraverseParameters::default().prepare().expect("valid parameters");
        let raw = MissionParameters { count: MISSIONS, ..MissionParameters::default() };
        let rules = MissionSettings::try_from(raw).expect("valid parameters");
        let classes = classify(&moore_gradient(&dem), &ClassThresholds::default());
        let classes = close_disk(&classes, vehicle.half_diagonal_m());
        let missions = draw_missions(&classes, &rules, StartCells::Low, &Streams::for_seed(1, "missions"));
        let missions = missions.expect("missions");
        Self { vehicle, settings, dem, missions }
    }

    /// Simulated over elapsed seconds, the faster of three runs.
    fn real_time_factor(&self) -> f64 {
        let ground = Ground::new(&self.dem, &self.vehicle).expect("cells finer than the vehicle");
        let run = || {
            let start = Instant::now();
            let steps = self.steps(&ground);
            steps as f64 / f64::from(self.settings.parameters().step_rate_hz) / start.elapsed().as_secs_f64()
        };
        (0..3).map(|_| run()).fold(0.0, f64::max)
    }

    /// MuJoCo's real-time factor and steps per second on the same missions.
    fn peer(&self) -> Option<Vec<f64>> {
        let folder = tempfile::tempdir().ok()?;
        let [heights, given] = ["heights", "given.json"].map(|name| folder.path().join(name));
        std::fs::write(&heights, self.dem.values.iter().flat_map(|z| z.to_le_bytes()).collect::<Vec<u8>>()).ok()?;
        let row = |mission: &Mission| {
            json!({
                "start_x_m": mission.start_m[0], "start_y_m": mission.start_m[1],
                "goal_x_m": mission.goal_m[0], "goal_y_m": mission.goal_m[1],
                "heading_deg": mission.heading_rad.to_degrees(),
            })
        };
        let geometry = self.dem.geometry;
        let text = json!({
            "rows": geometry.rows, "cols": geometry.cols, "cell_m": geometry.cell[0], "x0_m": geometry.x(0), "y0_m": geometry.y(geometry.rows - 1),
            "rules": self.settings.parameters(), "vehicle": self.vehicle.parameters(),
            "missions": self.missions.iter().map(row).collect::<Vec<_>>(),
        });
        std::fs::write(&given, text.to_string()).ok()?;
        floor_in("peer", "traverse.py", &[heights.to_str()?, given.to_str()?])
    }

    /// Time steps of all missions.
    fn steps(&self, ground: &Ground) -> usize {
        let parameters = self.settings.parameters();
        let rate = f64::from(parameters.step_rate_hz);
        let steps = |mission: &Mission| {
            let recording = drive(ground, &self.vehicle, &self.settings, mission).expect("a recording");
            let end_s = recording.events.last().map_or(0.0, |event| event.time_s);
            ((end_s + parameters.settle_s) * rate).round() as usize
        };
        self.missions.iter().map(steps).sum()
    }
}

#[divan::bench(sample_count = 10, args = DIMENSIONS)]
fn husky_steps(bencher: Bencher, fractal_dimension: f64) {
    let course = Course::new(fractal_dimension);
    let ground = Ground::new(&course.dem, &course.vehicle).expect("cells finer than the vehicle");
    bencher.counter(ItemsCount::new(course.steps(&ground))).bench_local(|| {
        for mission in &course.missions {
            let _ = black_box(drive(&ground, &course.vehicle, &course.settings, mission));
        }
    });
}

/// One bilinear height per ray and step, along the missions at driving speed.
#[divan::bench(sample_count = 10)]
fn floor_heights_of_all_rays(bencher: Bencher) {
    const STEPS: usize = 17_500;
    let course = Course::new(2.45);
    let dem = course.dem.to_f32();
    let mission = &course.missions[0];
    let ahead = [0, 1].map(|axis| (mission.goal_m[axis] - mission.start_m[axis]) / STEPS as f64);
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        let height = |k: usize| {
            let (step, ray) = ((k / RAYS) as f64, (k % RAYS) as f64);
            let x = mission.start_m[0] + ahead[0] * step + 0.003 * ray;
            let y = mission.start_m[1] + ahead[1] * step - 0.002 * ray;
            dem.height(x, y).unwrap_or(0.0)
        };
        (0..STEPS * RAYS).map(height).sum::<f64>()
    });
}

/// Preparation of heights, including the culling bound, for a vehicle: once per terrain.
#[divan::bench(sample_count = 10)]
fn prepare_ground_1009(bencher: Bencher) {
    let course = Course::new(2.45);
    bencher.counter(ItemsCount::new(course.dem.values.len())).bench_local(|| Ground::new(&course.dem, &course.vehicle));
}
