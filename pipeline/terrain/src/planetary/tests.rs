//! Acceptance criteria are documented at each test.

mod agreement;
mod craters;
mod ground;
mod potential;
mod refusals;
mod rocks;
mod served;
mod texture;

use super::levels::Window;
use super::processes::{self, RawProcess};
use super::world::{Patch, World};
use super::{KIND, assemble, to_grid};
use sastrugi_numeric::{Geometry, Grid, Streams};
use serde_json::{Value, json};

/// A world of the processes on a lattice of 1 cm.
fn world(processes: Value, seed: u64) -> World {
    let processes: Vec<RawProcess> = serde_json::from_value(processes).unwrap();
    processes::check(&processes, 0.01).unwrap();
    assemble::world(&processes, 0.01, 20, &Streams::for_seed(seed, "terrain"), None)
}

fn window(zoom: u32, west: i64, south: i64, cols: usize, rows: usize) -> Window {
    Window { zoom, west, south, cols, rows, centred: false }
}

/// Heights as a grid with cells of `cell_m`.
fn heights(patch: &Patch, cell_m: f64) -> Grid {
    to_grid(Geometry::square(patch.window.rows, patch.window.cols, cell_m), &patch.heights)
}

/// Both kinds of secondaries in one process, as wide as the primaries, so that they share bins.
fn families() -> Value {
    json!([
        {"kind": "texture"},
        {"kind": "rocks"},
        {"kind": "primary_craters", "density": 0.08, "diameter_min_m": 0.5, "diameter_max_m": 60.0},
        {
            "kind": "secondary_craters", "density": 0.1, "exponent": 2.0, "diameter_min_m": 0.5, "diameter_max_m": 60.0,
            "per_primary": 200, "primary_min_m": 20.0
        },
        {"kind": "albedo"}
    ])
}

/// Every process, dense enough for a small patch to contain all of them.
fn everything() -> Value {
    json!([
        {"kind": "base_slope", "gradient": [0.05, -0.02], "corner_heights_m": [0.0, 3.0, -2.0, 7.0]},
        {"kind": "texture"},
        {"kind": "primary_craters", "density": 0.05, "diameter_min_m": 0.3, "diameter_max_m": 400.0},
        {"kind": "rocks", "coverage": 0.118},
        {"kind": "primary_craters", "density": 0.05, "diameter_min_m": 0.2, "diameter_max_m": 300.0},
        {"kind": "secondary_craters", "density": 0.01, "per_primary": 400},
        {"kind": "albedo"},
        {"kind": "dust"}
    ])
}
