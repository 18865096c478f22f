//! Surfaces combined by an ordered list of processes.
//!
//! # What
//! Heights start at 0 m everywhere; each process modifies the result of the previous ones. z are the heights so far, o is the operand
//! (another generator on the same cells, or another surface of the study) times `factor`, and w the weight (0 to 1) of `region`, 1 without a
//! region:
//!
//! | operation | result |
//! |---|---|
//! | `add` | `z + w o` |
//! | `multiply` | `z (1 - w + w o)` |
//! | `blend` | `(1 - w) z + w o`: the operand replaces z |
//! | `mask` | `w z + (1 - w) outside_m` |
//! | `clip` | z limited to `low_m` to `high_m` |
//! | `scale_to_relief` | z scaled about its mean so that highest minus lowest height is `relief_m` |
//! | `trail` | z with a vehicle trail pressed into it: [`trail`] |
//!
//! A region is defined by another generator or surface m: w rises as `3 t^2 - 2 t^3`, with `t = (m - from) / (to - from)` limited to 0 to 1;
//! `from` above `to` reverses it.
//!
//! Each generator draws from its own streams, named by the number of the process. Surfaces of the study are interpolated bilinearly at the
//! centres of the cells and must cover all of them.
//!
//! Maps of generators (`class`, `albedo` ...) are kept where their process takes effect (w above 0); of two maps with the same name the
//! later wins. They have no data where no process provides any, where a blend replaces the operand (w = 1), and outside a mask. Roughness
//! maps are dropped, because they describe the operand alone. Notes that begin with `process k alone` (k from 1) describe it alone too.
//!
//! The centre line of every trail becomes a line of the surface (`trail`, `trail-2` ... in order), with the heights of the finished
//! surface; lines of operands are kept.
//!
//! # Example
//! ```
//! use sastrugi_numeric::{Geometry, Grid, Streams};
//! use sastrugi_terrain::{Input, prepare};
//! use serde_json::json;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let processes = json!([{"of": "ramp"}, {"operation": "clip", "high_m": 2.0}]);
//! let generator = prepare("compose", &json!({"size_px": [8, 6], "cell_m": 0.5, "processes": processes}))?;
//! let cells = Geometry::square(6, 8, 0.5);
//! let ramp = Grid::new(cells, (0..48).map(|k| cells.x(k % 8)).collect());
//! let terrain = generator.generate(&Streams::for_seed(1, "terrain"), &[Input::from(ramp)])?;
//! assert_eq!(terrain.heights.row(0), [0.25, 0.75, 1.25, 1.75, 2.0, 2.0, 2.0, 2.0]);
//! # Ok(())
//! # }
//! ```
//!
//! # Cost
//! That of the generators, run one after the other; three additional grids.

mod params;
#[cfg(test)]
mod tests;
pub mod trail;

pub use params::{Compose, Operation, RawCompose, RawProcess, RawRegion};

use crate::generator::{Generator, Input, Line, MAPS, Map, NamedInput, Terrain, TerrainError, rounded_coordinate};
use params::{COMMON, Operand, Part, Process, Region, Step};
use sastrugi_numeric::{Geometry, Grid, Streams, Surface, ops, sums};
use sastrugi_schemas::ParameterError;
use serde_json::Value;

/// Name in the registry.
pub const KIND: &str = "compose";

/// Rough time per cell and process to combine the heights, s.
const SECONDS_PER_JOIN: f64 = 2e-8;

impl Operand {
    fn inputs(&self) -> Vec<NamedInput> {
        match self {
            Self::Surface(base) => vec![base.clone()],
            Self::Generator { generator, key } => {
                let within = |b: NamedInput| NamedInput { key: format!("{key}.{}", b.key), ..b };
                generator.inputs().into_iter().map(within).collect()
            }
        }
    }

    fn memory_bytes(&self) -> u64 {
        match self {
            Self::Surface(_) => 0,
            Self::Generator { generator, .. } => generator.memory_bytes(),
        }
    }

    fn seconds(&self) -> f64 {
        match self {
            Self::Surface(_) => 0.0,
            Self::Generator { generator, .. } => generator.seconds(),
        }
    }

    /// Whether inputs of these shapes and positions can be used on the cells of `geometry`.
    fn check_places(&self, geometry: &Geometry, places: &[Option<Geometry>]) -> Result<(), ParameterError> {
        match (self, places) {
            (Self::Surface(base), [Some(surface)]) => check_reach(surface, geometry)
                .map_err(|reason| ParameterError::new(&base.key, format!("names \"{}\", which {reason}", base.name))),
            (Self::Surface(_), _) => Ok(()),
            (Self::Generator { generator, key }, places) => generator.check_places(places).map_err(|e| {
                // Size and position are set by the composition.
                if COMMON.contains(&e.key.as_str()) { e } else { e.within(key) }
            }),
        }
    }

    /// The values on the cells of `geometry`; removes its inputs from the front of `inputs`.
    fn values(&self, geometry: &Geometry, streams: &Streams, inputs: &mut &[Input]) -> Result<Terrain, TerrainError> {
        let (own, rest) = inputs.split_at(self.inputs().len().min(inputs.len()));
        *inputs = rest;
        match (self, own) {
            (Self::Generator { generator, .. }, own) => generator.generate(streams, own),
            (Self::Surface(base), [Input::Grid(surface)]) => sampled(base, surface, geometry).map(Terrain::from),
            (Self::Surface(base), _) => Err(base.error("is missing")),
        }
    }
}

/// How far cell centres may lie beyond the outer centres of a surface, in cells of the surface: coordinates are rounded.
const REACH_TOLERANCE: f64 = 1e-6;

/// Checks that a surface covers the centres of all `cells`; the reason if not.
fn check_reach(surface: &Geometry, cells: &Geometry) -> Result<(), String> {
    let [has, needs] = [surface, cells].map(|g| [[g.x(0), g.x(g.cols - 1)], [g.y(g.rows - 1), g.y(0)]]);
    let reaches = |axis: usize| {
        let tolerance = REACH_TOLERANCE * surface.cell[axis];
        needs[axis][0] >= has[axis][0] - tolerance && needs[axis][1] <= has[axis][1] + tolerance
    };
    if reaches(0) && reaches(1) {
        return Ok(());
    }
    let [[[x0, x1], [y0, y1]], [[west, east], [south, north]]] =
        [has, needs].map(|ends| ends.map(|axis| axis.map(rounded_coordinate)));
    Err(format!(
        "covers x {x0} to {x1}, y {y0} to {y1} m (centres of its outer cells), but the new cells reach from x {west} to {east}, y {south} to \
         {north} m; move `origin_m`, or make the new surface smaller"
    ))
}

/// A surface at the centres of other cells.
fn sampled(base: &NamedInput, surface: &Grid, geometry: &Geometry) -> Result<Grid, TerrainError> {
    let has = &surface.geometry;
    check_reach(has, geometry).map_err(|reason| base.error(reason))?;
    // A point within rounding of an outer centre counts as lying on it.
    let (west, south) = (has.origin[0] + 0.5 * has.cell[0], has.origin[1] + 0.5 * has.cell[1]);
    let within =
        |v: f64, low: f64, count: usize, cell: f64| low + cell * ((v - low) / cell).clamp(0.0, (count - 1) as f64);
    let at = |k: usize| {
        let (x, y) = (geometry.x(k % geometry.cols), geometry.y(k / geometry.cols));
        let (x, y) = (within(x, west, has.cols, has.cell[0]), within(y, south, has.rows, has.cell[1]));
        surface.height(x, y).ok_or_else(|| {
            let reason = format!("has no height at x = {x} m, y = {y} m; it must cover the centres of all cells");
            base.error(reason)
        })
    };
    Ok(Grid::new(*geometry, (0..geometry.len()).map(at).collect::<Result<_, _>>()?))
}

impl Region {
    /// The weight for a value of the region's surface.
    fn weight(&self, value: f64) -> f64 {
        let t = ((value - self.from) / (self.to - self.from)).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }
}

/// State of a run: what the processes so far have produced.
struct Running<'a> {
    geometry: Geometry,
    streams: Streams,
    inputs: &'a [Input],
    maps: Vec<Map>,
    /// Points `[x, y]` of the lines so far, m.
    lines: Vec<Vec<[f64; 2]>>,
    notes: Vec<String>,
}

/// Maps that describe an operand's own heights, not the composed ones.
const MAPS_OF_HEIGHTS: [&str; 2] = ["rms-measured", "rms-predicted"];

impl Running<'_> {
    /// The operand's result, placed on the cells of the composition: a generator may place its samples elsewhere in its own. Keeps its notes.
    fn made(
        &mut self,
        (part, number): (Part, usize),
        operand: &Operand,
        streams: &Streams,
    ) -> Result<Terrain, TerrainError> {
        let made = operand.values(&self.geometry, streams, &mut self.inputs)?;
        self.notes.extend(made.notes.iter().map(|note| part.note(number, note)));
        let placed = |values: Grid| Grid::new(self.geometry, values.values);
        let maps = made.maps.into_iter().map(|map| Map { values: placed(map.values), ..map }).collect();
        Ok(Terrain { heights: placed(made.heights), maps, lines: made.lines, notes: Vec::new() })
    }

    /// The weights of a region; 1 everywhere without a region.
    fn weights(&mut self, region: Option<&Region>, streams: &Streams, number: usize) -> Result<Grid, TerrainError> {
        match region {
            None => Ok(Grid::filled(self.geometry, 1.0)),
            Some(region) => {
                let made = self.made((Part::Region, number), &region.operand, &streams.child("region"))?;
                Ok(made.heights.map(|v| region.weight(v)))
            }
        }
    }

    /// Clears the maps so far in every cell whose weight is `cleared`.
    fn clear_maps(&mut self, weights: &Grid, cleared: fn(f64) -> bool) {
        for map in &mut self.maps {
            map.values = ops::combine(&map.values, weights, |v, w| if cleared(w) { f64::NAN } else { v });
        }
    }

    /// Merges the maps of an operand into those so far, where its weight is above 0.
    fn merge_maps(&mut self, maps: Vec<Map>, weights: &Grid) {
        for map in maps.into_iter().filter(|map| !MAPS_OF_HEIGHTS.contains(&map.name)) {
            let values = ops::combine(&map.values, weights, |v, w| if w > 0.0 { v } else { f64::NAN });
            match self.maps.iter_mut().find(|below| below.name == map.name) {
                Some(below) => {
                    below.values =
                        ops::combine(&below.values, &values, |old, new| if new.is_nan() { old } else { new });
                }
                None => self.maps.push(Map { values, ..map }),
            }
        }
    }

    fn apply(&mut self, mut z: Grid, number: usize, process: &Process) -> Result<Grid, TerrainError> {
        let streams = self.streams.child(&format!("process-{number}"));
        match &process.step {
            Step::Clip { low_m, high_m } => Ok(z.map(|v| v.clamp(*low_m, *high_m))),
            Step::ScaleToRelief { relief_m } => scaled_to_relief(&z, *relief_m),
            Step::Trail(trail) => {
                self.lines.push(trail.lay(&mut z)?);
                Ok(z)
            }
            Step::Mask { region, outside_m } => {
                let weights = self.weights(Some(region), &streams, number)?;
                self.clear_maps(&weights, |w| w == 0.0);
                Ok(ops::combine(&z, &weights, |z, w| w * z + (1.0 - w) * outside_m))
            }
            Step::Join { join, operand, factor, region } => {
                let made = self.made((Part::Operand, number), operand, &streams)?;
                let weights = self.weights(region.as_ref(), &streams, number)?;
                if matches!(join, params::Join::Blend) {
                    self.clear_maps(&weights, |w| w == 1.0);
                }
                self.merge_maps(made.maps, &weights);
                self.lines
                    .extend(made.lines.iter().map(|line| line.points_m.iter().map(|&[x, y, _]| [x, y]).collect()));
                Ok(join.of(z, &made.heights.map(|v| v * factor), &weights))
            }
        }
    }
}

impl params::Join {
    fn of(self, z: Grid, operand: &Grid, weights: &Grid) -> Grid {
        match self {
            Self::Add => ops::add(&z, &ops::multiply(weights, operand)),
            Self::Multiply => {
                let factors = ops::combine(weights, operand, |w, o| 1.0 - w + w * o);
                ops::multiply(&z, &factors)
            }
            Self::Blend => {
                let kept = ops::combine(&z, weights, |z, w| (1.0 - w) * z);
                ops::add(&kept, &ops::multiply(weights, operand))
            }
        }
    }
}

/// Lines on a surface; points outside its cells, or where it has no height, are left out.
fn lines_on(heights: &Grid, lines: Vec<Vec<[f64; 2]>>) -> Vec<Line> {
    let on_ground = |&[x, y]: &[f64; 2]| heights.height(x, y).map(|z| [x, y, z]);
    let line = |(k, points_m): (usize, Vec<[f64; 2]>)| Line {
        name: if k == 0 { "trail".to_owned() } else { format!("trail-{}", k + 1) },
        points_m: points_m.iter().filter_map(on_ground).collect(),
    };
    lines.into_iter().enumerate().map(line).collect()
}

fn scaled_to_relief(z: &Grid, relief_m: f64) -> Result<Grid, TerrainError> {
    let (low, high) = z.range().unwrap_or((0.0, 0.0));
    let mean = sums::mean(&z.values);
    let scale = relief_m / (high - low);
    let level = || TerrainError::Level { part: "the processes so far" };
    if scale.is_finite() { Ok(z.map(|v| mean + (v - mean) * scale)) } else { Err(level()) }
}

impl Generator for Compose {
    fn kind(&self) -> &'static str {
        KIND
    }

    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn parameters(&self) -> Value {
        self.parameters.clone()
    }

    fn memory_bytes(&self) -> u64 {
        // Heights, an operand, weights, their product and the sum, and the maps so far, in addition to the largest generator.
        let most = self.processes.iter().flat_map(Process::operands).map(Operand::memory_bytes).max();
        most.unwrap_or(0) + 8 * (5 + MAPS.len() as u64) * self.geometry.len() as u64
    }

    fn seconds(&self) -> f64 {
        let joining = SECONDS_PER_JOIN * (self.processes.len() * self.geometry.len()) as f64;
        joining + self.processes.iter().flat_map(Process::operands).map(Operand::seconds).sum::<f64>()
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn inputs(&self) -> Vec<NamedInput> {
        self.processes.iter().flat_map(Process::operands).flat_map(Operand::inputs).collect()
    }

    fn check_places(&self, places: &[Option<Geometry>]) -> Result<(), ParameterError> {
        let mut rest = places;
        for operand in self.processes.iter().flat_map(Process::operands) {
            let (own, others) = rest.split_at(operand.inputs().len().min(rest.len()));
            rest = others;
            operand.check_places(&self.geometry, own)?;
        }
        Ok(())
    }

    fn generate(&self, streams: &Streams, inputs: &[Input]) -> Result<Terrain, TerrainError> {
        let geometry = self.geometry;
        let mut running = Running {
            geometry,
            streams: streams.clone(),
            inputs,
            maps: Vec::new(),
            lines: Vec::new(),
            notes: Vec::new(),
        };
        let mut heights = Grid::filled(geometry, 0.0);
        for (k, process) in self.processes.iter().enumerate() {
            heights = running.apply(heights, k + 1, process)?;
        }
        let maps = running.maps.into_iter().filter(|map| map.values.finite_count() > 0).collect();
        let lines = lines_on(&heights, running.lines);
        Ok(Terrain { heights, maps, lines, notes: running.notes })
    }
}
