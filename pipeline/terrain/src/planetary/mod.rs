//! Planetary surfaces after JPL's synthetic terrain environment: any patch of a world, at any resolution, without generating the rest.
//!
//! # What
//! A world is a lattice of points, a basic spacing apart, and an ordered list of processes: `base_slope`, `texture`,
//! `primary_craters`, `secondary_craters`, `rocks`, `albedo`, `dust` (each described in its module). Every sample is a pure
//! function of the world and of its lattice point. A patch of twice the spacing contains every second sample of the finer one, and
//! overlapping patches agree, bit by bit.
//!
//! # Where the samples lie
//! Samples are values at points, never averages over cells. A patch with spacing `cell_m` = basic spacing times `2^k` has its
//! south-west sample at `origin_m` and the others `cell_m` apart. A grid has a sample at the centre of each cell: its south-west corner
//! is therefore half a cell south-west of `origin_m`, and the cells of zoom k + 1 are centred on every second sample of zoom k.
//!
//! # Source
//! The paper in `docs/papers/jpl.md`, after Gaskell's surface simulations; rocks after Golombek and Rapp (1997). That page lists what
//! the paper leaves open and where we depart from it.
//!
//! # Order
//! Ground-shaping processes act in the order of the list. Craters of adjacent crater processes strike in a common order of time.
//! Rocks set their potential at their position in the list; craters further down clear it and strew rocks; rocks are
//! placed on the finished ground. Albedo and dust may stand anywhere in the list.
//!
//! # Cost and memory
//! The cost of a patch is that of its own points and of the craters and rocks that reach them, plus some tens of points per level: see
//! `benches/benches/planetary.rs`. Patches are generated in tiles of 256 x 256 samples, one task each, with its own working memory
//! and its own list of craters: a wide crater that reaches many tiles is processed by each. Working memory is proportional to the
//! expected number of craters and rocks of a tile, 200 bytes each for every active tile; it does not depend on the size of
//! the world. Each crater also needs the heights of some 50 to 200 points under it, shaped by the wider craters there: the time for dense
//! fields grows with the square of their density, which is limited to about 20 times saturation.
//!
//! # Example
//! A patch of twice the spacing has every second sample of the finer one, rocks included.
//! ```
//! use sastrugi_numeric::Streams;
//! use sastrugi_terrain::planetary::{Planetary, RawPlanetary, Window};
//! use serde_json::json;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let raw: RawPlanetary = serde_json::from_value(json!({
//!     "basic_spacing_m": 0.01, "processes": [{"kind": "texture"}, {"kind": "rocks", "coverage": 0.118}]
//! }))?;
//! let world = Planetary::try_from(raw)?.world_of(&Streams::for_seed(1, "terrain"), |_| true)?;
//! let fine = world.patch(&Window { zoom: 0, west: -20, south: 40, cols: 41, rows: 21, centred: false });
//! let coarse = world.patch(&Window { zoom: 1, west: -10, south: 20, cols: 21, rows: 11, centred: false });
//! for (row, col) in (0..11).flat_map(|row| (0..21).map(move |col| (row, col))) {
//!     assert_eq!(coarse.heights[21 * row + col], fine.heights[41 * 2 * row + 2 * col]);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! # When not to use it
//! Coarse patches contain point values: a coarse sample is as rough as a fine one, and may lie on a rock. For means over cells, generate the
//! fine patch and average it.

mod assemble;
mod craters;
mod ground;
pub mod levels;
mod params;
mod processes;
mod rocks;
#[cfg(test)]
mod tests;
mod texture;
mod world;

pub(crate) use assemble::Assembly;
pub use ground::{BYTES_PER_TILE as GROUND_BYTES_PER_TILE, Clearing, View, WorldGround};
pub use levels::Window;
pub(crate) use params::{Lattice, WHOLE_TOLERANCE, Work, window_in_reach};
pub use params::{Planetary, RawPlanetary};
pub use processes::RawProcess;
pub(crate) use processes::{check as check_processes, check_texture, potential as potential_input};
pub use rocks::law::Law;
pub(crate) use rocks::potential::Potential;
pub use world::{Patch, ROCK, Request, SAND, World};

use crate::generator::{Generator, Input, Map, NamedInput, Terrain, TerrainError};
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid, Streams};
use serde_json::Value;

/// Name in the registry.
pub const KIND: &str = "planetary";

/// Upper estimate of the time per sample of a request, s.
const SECONDS_PER_SAMPLE: f64 = 4e-7;
/// Upper estimate of the time per crater or rock that a tile examines, s: 4e-7 to 1.1e-6 in the zooms of `jpl_planetary.toml`.
const SECONDS_PER_VISIT: f64 = 7e-7;
/// Rough time per sample, craters and rocks excluded, s.
const SECONDS_PER_OWN_SAMPLE: f64 = 2e-7;
/// Rough time to check one place for a crater or rock, s.
const SECONDS_PER_PLACE: f64 = 7e-8;
/// Rough time to place a rock on textured ground, s: if samples are closer together than the rock is wide, and if they are farther
/// apart.
const SECONDS_PER_ROCK: [f64; 2] = [5e-6, 1.1e-5];
/// The same on ground without texture, s.
const SECONDS_PER_ROCK_ON_PLAIN: [f64; 2] = [5e-7, 5e-7];
/// Rough time of a crater and of the ground under it, s.
const SECONDS_PER_CRATER: f64 = 1.5e-4;
/// Samples along the side of a tile.
const TILE: usize = 256;
/// Working memory of a tile per sample: the patch, intermediate heights, and two levels of a texture.
const BYTES_PER_TILE_SAMPLE: u64 = 120;
/// A crater or rock in the lists of a tile, with its plane.
const BYTES_PER_OBJECT: f64 = 200.0;
/// Crater index and other fixed data of a tile.
const BYTES_PER_TILE: u64 = 1 << 20;
/// Maximum number of tiles processed at once.
const TILES_AT_WORK: usize = 64;

impl World {
    /// Rough time of [`World::patch_for`] on one core, s.
    pub fn expected_seconds(&self, request: &Request<'_>) -> f64 {
        let visits = self.expected_visits(&request.window, request.feature_min_m);
        SECONDS_PER_SAMPLE * request.window.len() as f64 + SECONDS_PER_VISIT * visits
    }

    /// A patch, generated in parallel tiles.
    pub fn tiled_patch(&self, window: &Window) -> Patch {
        let tiles: Vec<(usize, usize)> =
            (0..window.rows).step_by(TILE).flat_map(|r| (0..window.cols).step_by(TILE).map(move |c| (r, c))).collect();
        let made: Vec<Patch> = tiles
            .par_iter()
            .map(|&(row, col)| {
                let (rows, cols) = (TILE.min(window.rows - row), TILE.min(window.cols - col));
                let (west, south) = (window.west + col as i64, window.south + row as i64);
                self.patch(&Window { west, south, cols, rows, ..*window })
            })
            .collect();
        let field = |of: fn(&Patch) -> &[f64]| joined(window, &made, of, 0.0);
        Patch {
            window: *window,
            heights: field(|p| &p.heights),
            albedo: field(|p| &p.albedo),
            class: joined(window, &made, |p| &p.class, SAND),
            rock_potential: field(|p| &p.rock_potential),
        }
    }
}

/// Assembles the values of tiles into those of the window.
fn joined<T: Copy>(window: &Window, tiles: &[Patch], of: fn(&Patch) -> &[T], empty: T) -> Vec<T> {
    let mut all = vec![empty; window.len()];
    for tile in tiles {
        let (col, row) = ((tile.window.west - window.west) as usize, (tile.window.south - window.south) as usize);
        for (r, line) in of(tile).chunks_exact(tile.window.cols).enumerate() {
            let from = (row + r) * window.cols + col;
            all[from..from + line.len()].copy_from_slice(line);
        }
    }
    all
}

/// Binary logarithm of the grid spacing, in lattice units, that is nearest to `spacings` in ratio.
pub(crate) fn nearest_zoom(spacings: f64) -> u32 {
    levels::floor_log2(spacings * std::f64::consts::SQRT_2)
}

/// Number of tiles of a window.
fn tiles(window: &Window) -> usize {
    window.cols.div_ceil(TILE) * window.rows.div_ceil(TILE)
}

/// The first tile of a window, which is as large as any other.
fn widest_tile(window: &Window) -> Window {
    Window { cols: window.cols.min(TILE), rows: window.rows.min(TILE), ..*window }
}

/// Rough time of a window with this number of samples on one core, s: samples, those under rocks twice; places checked for craters and rocks;
/// the ground under each placed rock and under each crater, which is computed specially if no sample lies there.
pub(crate) fn seconds(samples: usize, work: &Work) -> f64 {
    let rocks = if work.is_textured { SECONDS_PER_ROCK } else { SECONDS_PER_ROCK_ON_PLAIN };
    let set: f64 = work.rocks_set.iter().zip(rocks).map(|(count, each)| each * count).sum();
    SECONDS_PER_OWN_SAMPLE * samples as f64 * (1.0 + work.under_rocks)
        + SECONDS_PER_PLACE * work.visits
        + set
        + SECONDS_PER_CRATER * work.craters
}

/// Peak memory while generating a patch, including its grids, bytes.
pub(crate) fn memory_bytes(window: &Window, work: &Work) -> u64 {
    let tile_samples = widest_tile(window).len() as u64;
    let tile = BYTES_PER_TILE_SAMPLE * tile_samples + (BYTES_PER_OBJECT * work.tile_objects) as u64 + BYTES_PER_TILE;
    // Four fields of the patch, plus those of its tiles or its grids.
    8 * 8 * window.len() as u64 + tiles(window).min(TILES_AT_WORK) as u64 * tile
}

/// A grid with row 0 in the north from values with row 0 in the south.
pub(crate) fn to_grid<T: Copy + Into<f64>>(geometry: Geometry, values: &[T]) -> Grid {
    Grid::new(geometry, values.chunks_exact(geometry.cols).rev().flatten().map(|&v| v.into()).collect())
}

/// The maps of a world.
pub(crate) fn maps(world: &World, geometry: Geometry, patch: &Patch) -> Vec<Map> {
    let mut maps = Vec::new();
    if world.rocks.is_some() {
        maps.push(Map { name: "class", values: to_grid(geometry, &patch.class) });
        maps.push(Map { name: "rock-potential", values: to_grid(geometry, &patch.rock_potential) });
    }
    if world.albedo.is_some() {
        maps.push(Map { name: "albedo", values: to_grid(geometry, &patch.albedo) });
    }
    maps
}

/// A note if the raster of the rock potential has no data in part of a window.
pub(crate) fn potential_note(world: &World, window: &Window) -> Option<String> {
    let (rocks, _) = world.rocks.as_ref()?;
    let (share, coverage) = (rocks.unknown_share(window), rocks.parameters().coverage);
    (share > 0.0).then(|| {
        format!(
            "the rock potential raster has no data at {:.1} % of the samples; `coverage`, {coverage}, is used there",
            100.0 * share
        )
    })
}

impl Generator for Planetary {
    fn kind(&self) -> &'static str {
        KIND
    }

    fn geometry(&self) -> Geometry {
        let half = 0.5 * self.raw.cell_m;
        Geometry { origin: self.raw.origin_m.map(|at| at - half), ..self.size.geometry() }
    }

    fn parameters(&self) -> Value {
        serde_json::to_value(&self.raw).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        memory_bytes(&self.window, &self.work)
    }

    fn seconds(&self) -> f64 {
        seconds(self.window.len(), &self.work)
    }

    fn notes(&self) -> Vec<String> {
        self.size.note().into_iter().collect()
    }

    fn inputs(&self) -> Vec<NamedInput> {
        processes::potential(&self.raw.processes).into_iter().collect()
    }

    fn generate(&self, streams: &Streams, inputs: &[Input]) -> Result<Terrain, TerrainError> {
        let world = self.with_inputs(inputs)?.world(streams);
        let patch = world.tiled_patch(&self.window);
        let geometry = self.geometry();
        let maps = maps(&world, geometry, &patch);
        let notes = potential_note(&world, &self.window).into_iter().collect();
        Ok(Terrain { heights: to_grid(geometry, &patch.heights), maps, lines: Vec::new(), notes })
    }
}
