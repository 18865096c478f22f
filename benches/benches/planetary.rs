//! Planetary patches, compared with the random draws that a patch of texture alone needs.
//!
//! Target: 256 x 256 samples 2 cm apart with all processes within 60 ms on one core; the floor is one counter and one normal number per
//! sample. `patch_of_world` shows that time is proportional to the samples of a patch, not to the size of the world. Run one-threaded:
//! `RAYON_NUM_THREADS=1 cargo bench -p sastrugi-benches --bench planetary`.

use divan::Bencher;
use divan::counter::ItemsCount;
use sastrugi_numeric::{Counter, Geometry, Grid, Streams};
use sastrugi_terrain::Input;
use serde_json::{Value, json};

const SIDE: u32 = 256;

fn main() {
    divan::main();
}

fn streams() -> Streams {
    Streams::for_seed(1, "terrain")
}

fn bench_kind(bencher: Bencher, kind: &str, params: &Value, inputs: &[Input]) {
    let generator = sastrugi_terrain::prepare(kind, params).expect("the bench's own parameters are valid");
    let samples = generator.geometry().len();
    bencher.counter(ItemsCount::new(samples)).bench(|| generator.generate(&streams(), inputs));
}

fn all_processes() -> Value {
    json!([
        {"kind": "base_slope", "gradient": [0.02, 0.01]},
        {"kind": "texture"},
        {"kind": "rocks", "coverage": 0.176},
        {"kind": "primary_craters"},
        {"kind": "secondary_craters"},
        {"kind": "albedo"},
        {"kind": "dust"}
    ])
}

fn bench_planetary(bencher: Bencher, side: u32, cell_m: f64, processes: &Value) {
    // Far from the origin, where only anchors lie.
    let params = json!({
        "cell_m": cell_m, "basic_spacing_m": 0.01, "size_px": [side, side], "origin_m": [1280.0, 2560.0], "processes": processes
    });
    bench_kind(bencher, "planetary", &params, &[]);
}

/// The floor: one counter and one normal number per sample of the patch.
#[divan::bench(sample_count = 50)]
fn counters_and_normals_256(bencher: Bencher) {
    let root = Counter::new(&mut streams().stream("floor"));
    bencher.counter(ItemsCount::new(SIDE * SIDE)).bench(|| {
        let line = |j: i64| (0..i64::from(SIDE)).map(move |i| root.at(j).at(i).normal());
        (0..i64::from(SIDE)).flat_map(line).sum::<f64>()
    });
}

#[divan::bench(sample_count = 50)]
fn texture_256(bencher: Bencher) {
    bench_planetary(bencher, SIDE, 0.02, &json!([{"kind": "texture"}]));
}

#[divan::bench(sample_count = 50)]
fn texture_and_rocks_256(bencher: Bencher) {
    bench_planetary(bencher, SIDE, 0.02, &json!([{"kind": "texture"}, {"kind": "rocks", "coverage": 0.176}]));
}

#[divan::bench(sample_count = 50)]
fn texture_and_craters_256(bencher: Bencher) {
    bench_planetary(bencher, SIDE, 0.02, &json!([{"kind": "texture"}, {"kind": "primary_craters"}]));
}

/// The target.
#[divan::bench(sample_count = 50)]
fn all_processes_256(bencher: Bencher) {
    bench_planetary(bencher, SIDE, 0.02, &all_processes());
}

/// Patches of one world, from a rover's field of view to a field.
#[divan::bench(sample_count = 10, args = [3, 16, 64, 256, 1024])]
fn patch_of_world(bencher: Bencher, side: u32) {
    bench_planetary(bencher, side, 0.02, &all_processes());
}

/// 256 x 256 samples of one world, from 2 cm to 10 m apart.
#[divan::bench(sample_count = 10, args = [0.02, 0.16, 1.28, 10.24])]
fn zoom_of_world(bencher: Bencher, cell_m: f64) {
    let processes = json!([{"kind": "texture"}, {"kind": "rocks", "coverage": 0.176}, {"kind": "primary_craters"}]);
    bench_planetary(bencher, SIDE, cell_m, &processes);
}

/// 50 x 50 m at 5 cm between posts 90 m apart.
#[divan::bench(sample_count = 10)]
fn elaborate_1000(bencher: Bencher) {
    let hills = json!({"cell_m": 90.0, "size_px": [200, 200], "processes": [{"kind": "texture"}]});
    let dem = sastrugi_terrain::prepare("planetary", &hills).expect("valid").generate(&streams(), &[]);
    let dem = dem.expect("the bench's own DEM").heights;
    let dem = Grid { geometry: Geometry::square(200, 200, 90.0), ..dem };
    let params = json!({"dem": "hills", "origin_m": [5000.0, 5000.0], "size_m": [50.0, 50.0], "cell_m": 0.05});
    bench_kind(bencher, "elaborate", &params, &[dem.into()]);
}
