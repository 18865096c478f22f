//! Cycles of rovers on a world with 17.6 % rocks at 2 cm, compared with the look-ups of the ground that they need.
//!
//! A cycle of rays looks up about 700 points of the ground, one of rectangles 5000; the floors look up as many points of one tile row,
//! in order. Run one-threaded: `RAYON_NUM_THREADS=1 cargo bench -p sastrugi-benches --bench rovers`.

use divan::Bencher;
use divan::counter::ItemsCount;
use sastrugi_mobility::rover::{Navigator, RoverParameters, SchoppersParameters, SojournerParameters, Start, drive};
use sastrugi_numeric::{Counter, Ground, Streams};
use sastrugi_terrain::planetary::{Planetary, RawPlanetary, WorldGround};
use serde_json::json;

/// Cycles of a run.
const CYCLES: u32 = 500;
/// Points that a cycle looks up.
const RAYS: u32 = 700;
const RECTANGLES: u32 = 5000;

fn main() {
    divan::main();
}

fn ground() -> WorldGround {
    let raw = RawPlanetary {
        size_px: Some([16, 16]),
        basic_spacing_m: Some(0.01),
        processes: serde_json::from_value(json!([
            {"kind": "rocks", "coverage": 0.176, "diameter_min_m": 0.04, "diameter_max_m": 4.0}
        ]))
        .expect("the bench's own parameters are valid"),
        ..RawPlanetary::default()
    };
    let world = Planetary::try_from(raw).expect("the bench's own parameters are valid");
    world.ground(&Streams::for_seed(1, "terrain"), 0.02, &[], 400).expect("2 cm are twice the basic spacing")
}

/// Cycles of one rover, with its tiles generated in advance.
fn bench_cycles(bencher: Bencher, navigator: &Navigator) {
    let ground = ground();
    let task = navigator.task(&RoverParameters::default());
    let start = Start::facing([0.0; 2], [25.0, 0.0]);
    let noise = Counter::new(&mut Streams::for_seed(1, "rover").stream("noise"));
    let run = || drive(&ground.view(), &task, navigator.policy().as_mut(), &start, noise, |_| {});
    let cycles = run().cycles;
    bencher.counter(ItemsCount::new(cycles)).bench(run);
}

#[divan::bench(sample_count = 20)]
fn sojourner_like(bencher: Bencher) {
    bench_cycles(bencher, &Navigator::Sojourner(SojournerParameters { cycle_limit: CYCLES, ..Default::default() }));
}

#[divan::bench(sample_count = 20)]
fn schoppers_like(bencher: Bencher) {
    bench_cycles(bencher, &Navigator::Schoppers(SchoppersParameters { cycle_limit: CYCLES, ..Default::default() }));
}

/// The floors: the look-ups of the same number of cycles, over a square of 1 m.
fn bench_lookups(bencher: Bencher, points: u32) {
    let ground = ground();
    let look = || {
        let view = ground.view();
        let height = |k: u32| {
            let [x, y] = [k % 50, k / 50 % 50].map(|n| 0.02 * f64::from(n));
            view.at(x, y).map_or(0.0, |point| point.height_m)
        };
        (0..CYCLES * points).map(height).sum::<f64>()
    };
    look();
    bencher.counter(ItemsCount::new(CYCLES)).bench(look);
}

#[divan::bench(sample_count = 20)]
fn lookups_of_rays(bencher: Bencher) {
    bench_lookups(bencher, RAYS);
}

#[divan::bench(sample_count = 20)]
fn lookups_of_rectangles(bencher: Bencher) {
    bench_lookups(bencher, RECTANGLES);
}
