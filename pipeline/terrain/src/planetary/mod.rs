//! Planetary surfaces after JPL's synthetic terrain environment: any patch of a world, at any resolution, without making the world.
//!
//! # What
//! A world is a lattice of points, a basic spacing apart, and an ordered list of processes: `base_slope`, `texture`,
//! `primary_craters`, `secondary_craters`, `rocks`, `albedo`, `dust` (one module each says what it does). Every sample is a pure
//! function of the world and of its lattice point. Patches of twice the spacing hold every second sample of the finer ones,
//! overlapping patches agree, bit by bit.
//!
//! # Where the samples lie
//! Samples are values at points, never averages over cells. A patch of distance `cell_m` = basic spacing times `2^k` has its
//! south-west sample at `origin_m`, its others `cell_m` apart. A grid puts a sample at the centre of its cell: its south-west corner
//! is therefore half a cell south-west of `origin_m`, and the cells of zoom k + 1 are centred on every second sample of zoom k.
//!
//! # Source
//! The paper in `docs/papers/jpl.md`, after Gaskell's surface simulations; rocks after Golombek and Rapp (1997). What the paper
//! leaves open, and where we differ, stands there.
//!
//! # Order
//! Ground-shaping processes act in the order of the list. Craters of neighbouring crater processes strike in one order of time.
//! Rocks set their potential at their place in the list; craters below them in the list clear it and strew rocks; they are
//! set on the finished ground. Albedo and dust may stand anywhere.
//!
//! # Cost and memory
//! A patch costs what its own points and the craters and rocks that reach them cost, plus some tens of points a level: see
//! `benches/benches/planetary.rs`. Patches are made in tiles of 256 x 256 samples, each by one task with working memory of its
//! own, and with its own account of craters: a wide crater that reaches many tiles is looked at by each. Working memory goes with
//! the craters and rocks that a tile is expected to meet, 200 bytes each for every tile at work; it does not depend on the size of
//! the world. Each crater also needs the heights of some 50 to 200 points under it, made by the wider craters there: the time of dense
//! fields goes with the square of their density, which is bounded at about 20 times saturation.
//!
//! # When not to use it
//! Coarse patches hold point values: a coarse sample is as rough as a fine one, and may stand on a rock. For means over cells make the
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

/// Most time of a sample that a request is expected to take, s.
const SECONDS_PER_SAMPLE: f64 = 4e-7;
/// The same of a crater or rock that a tile looks at, s: 4e-7 to 1.1e-6 in the zooms of `jpl_planetary.toml`.
const SECONDS_PER_VISIT: f64 = 7e-7;
/// Rough time of a sample by itself, s.
const SECONDS_PER_OWN_SAMPLE: f64 = 2e-7;
/// Rough time of a place where a crater or rock may be, s.
const SECONDS_PER_PLACE: f64 = 7e-8;
/// Rough time of setting a rock on textured ground, s: among samples that lie close to each other, and between samples that lie farther apart than
/// the rock is wide.
const SECONDS_PER_ROCK: [f64; 2] = [5e-6, 1.1e-5];
/// The same on ground without texture, s.
const SECONDS_PER_ROCK_ON_PLAIN: [f64; 2] = [5e-7, 5e-7];
/// Rough time of a crater and of the ground under it, s.
const SECONDS_PER_CRATER: f64 = 1.5e-4;
/// Samples along the side of a tile.
const TILE: usize = 256;
/// Working memory of a tile for a sample of it: the patch, heights on the way, and what two levels of a texture need.
const BYTES_PER_TILE_SAMPLE: u64 = 120;
/// A crater or rock in the lists of a tile, with its plane.
const BYTES_PER_OBJECT: f64 = 200.0;
/// Squares of craters and what else a tile holds.
const BYTES_PER_TILE: u64 = 1 << 20;
/// No more tiles are at work at once.
const TILES_AT_WORK: usize = 64;

impl World {
    /// Rough time of [`World::patch_for`] on one core, s.
    pub fn expected_seconds(&self, request: &Request<'_>) -> f64 {
        let visits = self.expected_visits(&request.window, request.feature_min_m);
        SECONDS_PER_SAMPLE * request.window.len() as f64 + SECONDS_PER_VISIT * visits
    }

    /// A patch, made in tiles side by side.
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

/// The values of tiles in those of the window that they make up.
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

/// Binary logarithm of the spacing of a grid of lattice points that is nearest to `spacings` in proportion.
pub(crate) fn nearest_zoom(spacings: f64) -> u32 {
    levels::floor_log2(spacings * std::f64::consts::SQRT_2)
}

/// How many tiles a window is made in.
fn tiles(window: &Window) -> usize {
    window.cols.div_ceil(TILE) * window.rows.div_ceil(TILE)
}

/// The first tile of a window, which is as wide as any.
fn widest_tile(window: &Window) -> Window {
    Window { cols: window.cols.min(TILE), rows: window.rows.min(TILE), ..*window }
}

/// Rough time of a window of so many samples on one core, s: samples, and again those under rocks; places where craters and rocks are looked for;
/// the ground under each rock that is set and under each crater, which is made for its sake where it is not that of a sample.
pub(crate) fn seconds(samples: usize, work: &Work) -> f64 {
    let rocks = if work.is_textured { SECONDS_PER_ROCK } else { SECONDS_PER_ROCK_ON_PLAIN };
    let set: f64 = work.rocks_set.iter().zip(rocks).map(|(count, each)| each * count).sum();
    SECONDS_PER_OWN_SAMPLE * samples as f64 * (1.0 + work.under_rocks)
        + SECONDS_PER_PLACE * work.visits
        + set
        + SECONDS_PER_CRATER * work.craters
}

/// Peak memory of making a patch and of its grids, bytes.
pub(crate) fn memory_bytes(window: &Window, work: &Work) -> u64 {
    let tile_samples = widest_tile(window).len() as u64;
    let tile = BYTES_PER_TILE_SAMPLE * tile_samples + (BYTES_PER_OBJECT * work.tile_objects) as u64 + BYTES_PER_TILE;
    // Four fields of the patch beside those of its tiles or its grids.
    8 * 8 * window.len() as u64 + tiles(window).min(TILES_AT_WORK) as u64 * tile
}

/// A grid with row 0 in the north from values with row 0 in the south.
pub(crate) fn to_grid<T: Copy + Into<f64>>(geometry: Geometry, values: &[T]) -> Grid {
    Grid::new(geometry, values.chunks_exact(geometry.cols).rev().flatten().map(|&v| v.into()).collect())
}

/// The maps that a world has beside its heights.
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

/// What to know of a window where the raster of the rock potential has no data.
pub(crate) fn potential_note(world: &World, window: &Window) -> Option<String> {
    let (rocks, _) = world.rocks.as_ref()?;
    let (share, coverage) = (rocks.unknown_share(window), rocks.parameters().coverage);
    (share > 0.0).then(|| {
        format!(
            "the raster of the rock potential has no data at {:.1} % of the samples; `coverage`, {coverage}, holds there",
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
