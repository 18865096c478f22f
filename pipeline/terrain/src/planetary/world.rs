//! A world: everything that is the same for all of its patches, and how a patch of it is made.

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

/// Height of a smooth base at a place in lattice units, m.
pub type Base = Box<dyn Fn([f64; 2]) -> f64 + Send + Sync>;

/// What shapes the ground, in order.
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
    /// Albedo of the dust, and the share of the ground that it covers.
    pub dust: [f64; 2],
}

/// Everything that patches of one world have in common.
pub struct World {
    /// What shapes the ground, in order.
    pub steps: Vec<Step>,
    /// The rocks, and how many of the steps precede them.
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
    /// Albedo, 0 to 1; 0 in a world without.
    pub albedo: Vec<f64>,
    /// [`SAND`] or [`ROCK`].
    pub class: Vec<u8>,
    /// Share of the ground that all rocks cover.
    pub rock_potential: Vec<f64>,
}

/// What is asked of a world.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// The points.
    pub window: Window,
    /// Craters and rocks that are not wider are left out, m; 0 leaves out none. The craters that stay are not changed by it, since the plane of
    /// each sees wider ones only; rocks stay where they are, at the height of the ground without the craters that are left out.
    pub feature_min_m: f64,
    /// Once true, the patch is no longer wanted.
    pub cancel: Option<&'a AtomicBool>,
}

/// What was met on the way to one patch.
struct Survey<'w> {
    world: &'w World,
    feature_min_m: f64,
    cancel: Option<&'w AtomicBool>,
    /// For every step, the craters that may reach what is looked at.
    craters: Vec<Index>,
    planes: RefCell<HashMap<Place, Plane>>,
    families: Families,
}

impl World {
    /// The samples of a window: a pure function of the world, bit by bit the same whatever else is looked at.
    pub fn patch(&self, window: &Window) -> Patch {
        self.made(&Request { window: *window, feature_min_m: 0.0, cancel: None })
    }

    /// The samples that are asked for, made on this thread; `None` once they are no longer wanted.
    pub fn patch_for(&self, request: &Request<'_>) -> Option<Patch> {
        let patch = self.made(request);
        (!is_set(request.cancel)).then_some(patch)
    }

    /// The samples of a request; of one that is no longer wanted any.
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

    /// A window, with what must be known around it to set rocks on its ground.
    fn near<'a>(&self, window: &'a Window) -> Near<'a> {
        Near { window, margin: self.rocks.as_ref().map_or(0.0, |(rocks, _)| rocks.reach()), cancel: None }
    }

    /// Expected number of craters and rocks that a patch holds in memory, not below the true one.
    pub fn expected_objects(&self, window: &Window) -> f64 {
        let near = self.near(window);
        let rocks = self.rocks.as_ref().map_or(0.0, |(rocks, _)| rocks.held(window));
        self.populations().map(|p| p.held(&near)).sum::<f64>() + rocks
    }

    /// Expected number of craters that a patch meets, not below the true one.
    pub fn expected_craters(&self, window: &Window) -> f64 {
        let near = self.near(window);
        self.populations().map(|p| p.held(&near)).sum()
    }

    /// Expected number of rocks that are set in a patch: among samples that lie close to each other, and between others.
    pub fn expected_rocks(&self, window: &Window) -> [f64; 2] {
        self.rocks.as_ref().map_or([0.0; 2], |(rocks, _)| rocks.set(window))
    }

    /// How many rocks lie over a point on average, and the ground about them that is looked at with them.
    pub fn rock_layers(&self) -> f64 {
        /// Rectangle about an ellipse of any direction over the ellipse.
        const RECTANGLE: f64 = 1.6;
        let coverage = self.rocks.as_ref().map_or(0.0, |(rocks, _)| rocks.parameters().coverage);
        -RECTANGLE * libm::log1p(-coverage)
    }

    /// Expected number of craters and rocks wider than `feature_min_m` that a patch draws, and of the places where it looks for them; time
    /// goes with it and with the number of points.
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
    /// Points of which nothing beyond themselves must be known.
    fn near<'a>(&'a self, window: &'a Window) -> Near<'a> {
        Near { window, margin: 0.0, cancel: self.cancel }
    }

    /// For every step, the craters that may reach what is looked at.
    fn index(&self, near: &Near<'_>) -> Vec<Index> {
        let of_step = |step: &Step| match step {
            Step::Bombardment(bombardment) => self.craters(bombardment, near, self.feature_min_m),
            _ => Vec::new(),
        };
        self.world.steps.iter().map(|step| Index::new(of_step(step), near)).collect()
    }

    /// Craters wider than `diameter_min_m` that may reach what is looked at, in order of time.
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

    /// Lets a step act on the heights of a window.
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

    /// The plane that a crater of a step is set on.
    fn plane(&self, step: usize, crater: &Crater) -> Plane {
        if let Some(plane) = self.planes.borrow().get(&crater.place) {
            return *plane;
        }
        let window = retained_window(crater);
        let plane = Plane::fit(crater, &window, &self.ground_before(step, crater, &window));
        self.planes.borrow_mut().insert(crater.place, plane);
        plane
    }

    /// Rock potential, and rocks on the ground, whose place in the list is after so many steps.
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

/// The rock coverage at a place after a crater.
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
