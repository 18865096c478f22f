//! Generators stay within the memory that they state.

use peak_alloc::PeakAlloc;
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_terrain::{Input, kinds, prepare};
use serde_json::{Value, json};

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// Allowance beyond the stated memory, bytes: tables, and the pool's stacks.
const SMALL: f64 = 4e6;
/// Largest permitted ratio of stated to measured memory. With craters and rocks the statement covers the worst tile, which a surface may not
/// contain.
const SLACK: f64 = 4.0;
const SLACK_OF_FEATURES: f64 = 16.0;

/// Peak memory while generating a surface, measured and stated, bytes.
fn measured(kind: &str, params: &Value, inputs: &[Input], threads: usize) -> [f64; 2] {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
    pool.install(|| {
        let generator = prepare(kind, params).expect("the parameters are valid");
        let before = ALLOCATED.current_usage();
        ALLOCATED.reset_peak_usage();
        let made = generator.generate_checked(&Streams::for_seed(1, "terrain"), inputs).expect("a surface");
        let peak = ALLOCATED.peak_usage() - before;
        drop(made);
        [peak as f64, generator.memory_bytes() as f64]
    })
}

/// A DEM of `side` x `side` posts, 5 m apart.
fn dem(side: usize) -> Input {
    let mut geometry = Geometry::square(side, side, 5.0);
    geometry.origin = [0.0; 2];
    let height = |k: usize| {
        let (row, col) = ((k / side) as f64, (k % side) as f64);
        0.3 * row + 0.1 * col + ((k * 7919) % 101) as f64 / 101.0
    };
    Input::Grid(Grid::new(geometry, (0..side * side).map(height).collect()))
}

/// Every kind, with parameters of a moderately large surface.
fn cases() -> Vec<(&'static str, Value, Vec<Input>)> {
    // The other kinds need parameters and follow below.
    let plain = kinds().into_iter().map(|k| k.kind).filter(|k| !["planetary", "elaborate", "compose"].contains(k));
    let sized =
        |kind: &'static str| [[1000, 1000], [300, 2500]].map(|size| (kind, json!({ "size_px": size }), Vec::new()));
    let mut all: Vec<_> = plain.flat_map(sized).collect();
    let processes = json!([
        { "kind": "texture" }, { "kind": "primary_craters" }, { "kind": "rocks", "coverage": 0.118 }, { "kind": "albedo" }
    ]);
    for cell_m in [0.02, 0.64] {
        let params = json!({
            "size_px": [1000, 1000], "cell_m": cell_m, "basic_spacing_m": 0.01, "processes": processes,
        });
        all.push(("planetary", params, Vec::new()));
    }
    let elaborate = json!({
        "dem": "d", "size_px": [1000, 1000], "cell_m": 0.08, "basic_spacing_m": 0.01, "origin_m": [100.0, 100.0],
        "processes": [{ "kind": "rocks", "coverage": 0.118 }],
    });
    all.push(("elaborate", elaborate, vec![dem(100)]));
    let compose = json!({
        "size_px": [1000, 1000], "cell_m": 0.05,
        "processes": [
            { "kind": "multifractal" }, { "operation": "add", "kind": "gap" }
        ],
    });
    all.push(("compose", compose, Vec::new()));
    all
}

#[test]
fn val_generators_stay_within_their_stated_memory() {
    let mut wrong = Vec::new();
    for (kind, params, inputs) in cases() {
        for threads in [1, 4] {
            let [peak, stated] = measured(kind, &params, &inputs, threads);
            println!("{kind} {params} {threads} threads: {:.1} MB, stated {:.1} MB", 1e-6 * peak, 1e-6 * stated);
            let slack = if params.to_string().contains("rocks") { SLACK_OF_FEATURES } else { SLACK };
            if peak > stated + SMALL || stated > slack * peak + SMALL {
                wrong.push((kind, threads, peak, stated));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}
