//! A world: the data common to all its patches, and the generation of a patch.

use super::craters::index::Index;
use super::craters::population::{Crater, Families, Near, Place, Population};
use super::craters::shape::EJECTA_RADII;
use super::craters::{Bombardment, Plane, retained_window};
use super::levels::Window;
use super::rocks::Rocks;
use super::texture::{Amplitudes, interpolate};
use sastrugi_numeric::Counter;
use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};

/// Code of sand in the class map.
pub const SAND: u8 = 0;
/// Code of rock in the class map.
pub const ROCK: u8 = 1;

/// Height of a smooth base at a position in lattice units, m.
pub type Base = Box<dyn Fn([f64; 2]) -> f64 + Send + Sync>;

/// One step that shapes the ground.
pub enum Step {
    /// A smooth surface is added.
    Base(Base),
    /// Roughness is added.
    Texture(Texture),
    /// Craters strike.
    Bombardment(Bombardment),
}

/// Roughness at every scale.
pub struct Texture {
    /// Key of its draws.
    pub counter: Counter,
    /// Binary logarithm of the spacing of its anchors.
    pub anchor: u32,
    /// `s_1`, m.
    pub roughness_m: f64,
    /// `d^H`.
    pub amplitudes: Amplitudes,
}

/// Albedo of sand and rock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Albedo {
    /// Key of the draws of sand.
    pub counter: Counter,
    /// Mean and standard deviation of sand.
    pub sand: [f64; 2],
    /// Mean and standard deviation of rocks.
    pub rock: [f64; 2],
    /// Albedo of the dust, and the share of every point that it covers.
    pub dust: [f64; 2],
}

/// The data common to all patches of a world.
pub struct World {
    /// The steps that shape the ground, in order.
    pub steps: Vec<Step>,
    /// The rocks, and the number of steps that precede them.
    pub rocks: Option<(Rocks, usize)>,
    /// The albedo.
    pub albedo: Option<Albedo>,
}

/// Samples of a world at the lattice points of a window, row by row from the south.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// The points.
    pub window: Window,
    /// Heights, m.
    pub heights: Vec<f64>,
    /// Albedo, 0 to 1; 0 in a world without albedo.
    pub albedo: Vec<f64>,
    /// [`SAND`] or [`ROCK`].
    pub class: Vec<u8>,
    /// Share of the ground that rocks may cover.
    pub rock_potential: Vec<f64>,
}

/// A request for samples of a world.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// The points.
    pub window: Window,
    /// Craters and rocks up to this width are left out, m; 0 leaves out none. The remaining craters do not change, because the plane of
    /// each depends on wider ones only; rocks stay where they are, at the height of the ground without the omitted craters.
    pub feature_min_m: f64,
    /// Set to true to cancel the request.
    pub cancel: Option<&'a AtomicBool>,
}

/// Working data of one patch.
struct Survey<'w> {
    world: &'w World,
    feature_min_m: f64,
    cancel: Option<&'w AtomicBool>,
    /// For every step, the craters that may reach the window or its margin.
    craters: Vec<Index>,
    planes: RefCell<HashMap<Place, Plane>>,
    families: Families,
}

impl World {
    /// The samples of a window: a pure function of the world, bit-identical whatever other windows are generated.
    pub fn patch(&self, window: &Window) -> Patch {
        self.made(&Request { window: *window, feature_min_m: 0.0, cancel: None })
    }

    /// The requested samples, computed on this thread; `None` if the request was cancelled.
    pub fn patch_for(&self, request: &Request<'_>) -> Option<Patch> {
        let patch = self.made(request);
        (!is_set(request.cancel)).then_some(patch)
    }

    /// The samples of a request; arbitrary values if it was cancelled.
    pub(crate) fn made(&self, request: &Request<'_>) -> Patch {
        let window = &request.window;
        let count = window.len();
        let mut patch = Patch {
            window: *window,
            heights: vec![0.0; count],
            albedo: vec![0.0; count],
            class: vec![SAND; count],
            rock_potential: vec![0.0; count],
        };
        if window.is_empty() {
            return patch;
        }
        let Request { feature_min_m, cancel, .. } = *request;
        let (planes, families) = (RefCell::default(), Families::wider_than(feature_min_m));
        let mut survey = Survey { world: self, feature_min_m, cancel, craters: Vec::new(), planes, families };
        survey.craters = survey.index(&Near { cancel, ..self.near(window) });
        patch.heights = survey.ground(window);
        if let Some(albedo) = &self.albedo {
            patch.albedo = albedo.of_sand(window);
        }
        if let Some((rocks, after)) = &self.rocks {
            survey.set_rocks(rocks, *after, &mut patch);
        }
        patch
    }

    /// A window, with the margin within which craters must be known to place rocks on its ground.
    fn near<'a>(&self, window: &'a Window) -> Near<'a> {
        Near { window, margin: self.rocks.as_ref().map_or(0.0, |(rocks, _)| rocks.reach()), cancel: None }
    }

    /// Expected number of craters and rocks that a patch holds in memory; never an underestimate.
    pub fn expected_objects(&self, window: &Window) -> f64 {
        let near = self.near(window);
        let rocks = self.rocks.as_ref().map_or(0.0, |(rocks, _)| rocks.held(window));
        self.populations().map(|p| p.held(&near)).sum::<f64>() + rocks
    }

    /// Expected number of craters that reach a patch; never an underestimate.
    pub fn expected_craters(&self, window: &Window) -> f64 {
        let near = self.near(window);
        self.populations().map(|p| p.held(&near)).sum()
    }

    /// Expected number of rocks placed in a patch: those wider than the sample spacing, and those narrower.
    pub fn expected_rocks(&self, window: &Window) -> [f64; 2] {
        self.rocks.as_ref().map_or([0.0; 2], |(rocks, _)| rocks.set(window))
    }

    /// Mean number of rocks over a point, including the surrounding ground that is examined with them.
    pub fn rock_layers(&self) -> f64 {
        /// Area of the bounding rectangle of an ellipse of any azimuth, over that of the ellipse.
        const RECTANGLE: f64 = 1.6;
        let coverage = self.rocks.as_ref().map_or(0.0, |(rocks, _)| rocks.parameters().coverage);
        -RECTANGLE * libm::log1p(-coverage)
    }

    /// Expected number of craters and rocks wider than `feature_min_m` that a patch draws, plus the places where it looks for them; the time
    /// grows with it and with the number of points.
    pub fn expected_visits(&self, window: &Window, feature_min_m: f64) -> f64 {
        let near = self.near(window);
        let rocks = self.rocks.as_ref().map_or(0.0, |(rocks, _)| rocks.work(window, feature_min_m));
        self.populations().map(|p| p.work(&near, feature_min_m)).sum::<f64>() + rocks
    }

    fn populations(&self) -> impl Iterator<Item = &dyn Population> {
        let bombardments = self.steps.iter().filter_map(|s| if let Step::Bombardment(b) = s { Some(b) } else { None });
        bombardments.flat_map(|b| b.populations.iter().map(|p| &**p))
    }
}

impl Albedo {
    fn of_sand(&self, window: &Window) -> Vec<f64> {
        let points = (0..window.rows).flat_map(|row| (0..window.cols).map(move |col| (row, col)));
        let at = |(row, col): (usize, usize)| {
            let [i, j] = window.place(col, row);
            self.value(self.sand, self.counter.at(j).at(i))
        };
        points.map(at).collect()
    }

    fn value(&self, [mean, deviation]: [f64; 2], draw: Counter) -> f64 {
        let clean = (mean + deviation * draw.normal()).clamp(0.0, 1.0);
        let [dust, cover] = self.dust;
        clean + cover * (dust - clean)
    }
}

impl Survey<'_> {
    /// A window without margin.
    fn near<'a>(&'a self, window: &'a Window) -> Near<'a> {
        Near { window, margin: 0.0, cancel: self.cancel }
    }

    /// For every step, the craters that may reach the window or its margin.
    fn index(&self, near: &Near<'_>) -> Vec<Index> {
        let of_step = |step: &Step| match step {
            Step::Bombardment(bombardment) => self.craters(bombardment, near, self.feature_min_m),
            _ => Vec::new(),
        };
        self.world.steps.iter().map(|step| Index::new(of_step(step), near)).collect()
    }

    /// Craters wider than `diameter_min_m` that may reach the window or its margin, in order of time.
    fn craters(&self, bombardment: &Bombardment, near: &Near<'_>, diameter_min_m: f64) -> Vec<Crater> {
        let mut found = Vec::new();
        bombardment.populations.iter().for_each(|p| p.find(near, diameter_min_m, &self.families, &mut found));
        found.sort_unstable_by(Crater::order);
        found
    }

    /// Heights of the ground without rocks, m.
    fn ground(&self, window: &Window) -> Vec<f64> {
        let mut heights = vec![0.0; window.len()];
        for (number, (step, craters)) in self.world.steps.iter().zip(&self.craters).enumerate() {
            self.act(number, step, window, &mut heights, craters.of(window));
        }
        heights
    }

    /// Heights of the ground just before a crater of step `last` strikes, shaped by wider craters only, m.
    fn ground_before(&self, last: usize, crater: &Crater, window: &Window) -> Vec<f64> {
        let mut heights = vec![0.0; window.len()];
        for (number, step) in self.world.steps[..=last].iter().enumerate() {
            let earlier = |c: &&Crater| number < last || c.order(crater).is_lt();
            match (step, self.craters[number].wider(crater, window)) {
                (Step::Bombardment(b), None) => {
                    let found = self.craters(b, &self.near(window), crater.diameter_m);
                    self.act(number, step, window, &mut heights, found.iter().filter(earlier));
                }
                (_, known) => {
                    let known = known.into_iter().flatten().filter(earlier);
                    self.act(number, step, window, &mut heights, known);
                }
            }
        }
        heights
    }

    /// Applies a step to the heights of a window.
    fn act<'c>(
        &self,
        number: usize,
        step: &Step,
        window: &Window,
        heights: &mut [f64],
        craters: impl Iterator<Item = &'c Crater>,
    ) {
        match step {
            Step::Base(base) => add_base(base, window, heights),
            Step::Texture(t) => {
                let field = interpolate(window, t.anchor, t.counter, t.roughness_m, &t.amplitudes);
                heights.iter_mut().zip(field).for_each(|(h, f)| *h += f);
            }
            Step::Bombardment(b) => craters
                .take_while(|_| !is_set(self.cancel))
                .for_each(|c| b.strike(window, heights, c, || self.plane(number, c))),
        }
    }

    /// The reference plane of a crater of a step.
    fn plane(&self, step: usize, crater: &Crater) -> Plane {
        if let Some(plane) = self.planes.borrow().get(&crater.place) {
            return *plane;
        }
        let window = retained_window(crater);
        let plane = Plane::fit(crater, &window, &self.ground_before(step, crater, &window));
        self.planes.borrow_mut().insert(crater.place, plane);
        plane
    }

    /// Sets the rock potential and places the rocks; they follow the first `after` steps of the list.
    fn set_rocks(&self, rocks: &Rocks, after: usize, patch: &mut Patch) {
        let (window, later) = (patch.window, &self.craters[after..]);
        for (k, potential) in patch.rock_potential.iter_mut().enumerate() {
            *potential = rocks.coverage([window.x(k % window.cols), window.y(k / window.cols)]);
        }
        let wanted = |_: &&Crater| !is_set(self.cancel);
        later.iter().flat_map(|index| &index.craters).take_while(wanted).for_each(|c| change_all(rocks, c, patch));
        let coverage = |at: [f64; 2]| {
            let alone = rocks.coverage(at);
            later.iter().flat_map(|index| index.at(at)).fold(alone, |f, c| change(rocks, f, c, at))
        };
        let ground = patch.heights.clone();
        let mut tops = vec![f64::NEG_INFINITY; ground.len()];
        let found = rocks.find(&window, self.feature_min_m, self.cancel, coverage);
        for rock in found.into_iter().take_while(|_| !is_set(self.cancel)) {
            let (zoom, i, j) = rocks.base(&rock);
            let base = match window.find(zoom, i, j) {
                Some(k) => ground[k],
                None => self.ground(&Window::point(zoom, i, j))[0],
            };
            let albedo = self.world.albedo.map(|albedo| albedo.value(albedo.rock, rock.albedo));
            rocks.cover(&rock, &window, |k, height| {
                let top = base + height;
                patch.class[k] = ROCK;
                if top > tops[k] {
                    tops[k] = top;
                    patch.heights[k] = f64::max(ground[k], top);
                    patch.albedo[k] = albedo.unwrap_or(0.0);
                }
            });
        }
    }
}

fn is_set(cancel: Option<&AtomicBool>) -> bool {
    cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))
}

/// The rock coverage at a position after a crater.
fn change(rocks: &Rocks, coverage: f64, crater: &Crater, [x, y]: [f64; 2]) -> f64 {
    let [dx, dy] = [x - crater.centre[0], y - crater.centre[1]];
    let rho = (dx * dx + dy * dy).sqrt() / crater.radius;
    if rho < EJECTA_RADII { rocks.parameters().after_crater(coverage, crater, rho) } else { coverage }
}

/// The rock potential of a patch after a crater.
fn change_all(rocks: &Rocks, crater: &Crater, patch: &mut Patch) {
    let window = patch.window;
    let Some(part) = window.part(crater.centre, EJECTA_RADII * crater.radius) else { return };
    for row in part.rows {
        for col in part.cols.clone() {
            let potential = &mut patch.rock_potential[row * window.cols + col];
            *potential = change(rocks, *potential, crater, [window.x(col), window.y(row)]);
        }
    }
}

fn add_base(base: &Base, window: &Window, heights: &mut [f64]) {
    for (k, height) in heights.iter_mut().enumerate() {
        *height += base([window.x(k % window.cols), window.y(k / window.cols)]);
    }
}
