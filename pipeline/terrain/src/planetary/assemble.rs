//! Assembles a world from checked parameters.

use super::craters::population::{Population, PowerLaw, Secondaries};
use super::craters::{Bombardment, Floor};
use super::levels::spacing;
use super::processes::{RawAlbedo, RawBaseSlope, RawDust, RawProcess, RawSecondaryCraters};
use super::rocks::Rocks;
use super::rocks::potential::Potential;
use super::texture::Amplitudes;
use super::world::{Albedo, Base, Step, Texture, World};
use sastrugi_numeric::{Counter, Streams};

/// A world of processes on a lattice with points `spacing_m` apart and texture anchors `2^anchor` spacings apart; rocks follow a
/// raster of their potential, if given.
pub fn world(
    processes: &[RawProcess],
    spacing_m: f64,
    anchor: u32,
    streams: &Streams,
    potential: Option<Potential>,
) -> World {
    Assembly::new(spacing_m, anchor).with(processes, streams, potential, |_| true)
}

/// Builder of a world.
pub struct Assembly {
    spacing_m: f64,
    anchor: u32,
    steps: Vec<Step>,
    /// Texture of the surface so far, for the floors of craters.
    floor: Option<Floor>,
    /// The nearest preceding primaries.
    primaries: Option<PowerLaw>,
    /// Whether the next craters share the order of time with those of the last step.
    same_time: bool,
}

impl Assembly {
    /// An empty world.
    pub fn new(spacing_m: f64, anchor: u32) -> Self {
        Self { spacing_m, anchor, steps: Vec::new(), floor: None, primaries: None, same_time: false }
    }

    /// Adds a smooth surface.
    pub fn add_base(&mut self, base: Base) {
        self.steps.push(Step::Base(base));
        self.same_time = false;
    }

    /// Adds roughness with `s_1` (m) and a Hurst exponent.
    pub fn add_texture(&mut self, roughness_m: f64, hurst: f64, counter: Counter) {
        let amplitudes = Amplitudes::new(hurst, self.spacing_m, self.anchor);
        self.floor = Some(Floor { roughness_m, amplitudes: amplitudes.clone(), anchor: self.anchor });
        self.steps.push(Step::Texture(Texture { counter, anchor: self.anchor, roughness_m, amplitudes }));
        self.same_time = false;
    }

    fn add_craters(&mut self, population: Box<dyn Population>) {
        if let Some(Step::Bombardment(last)) = self.steps.last_mut().filter(|_| self.same_time) {
            last.populations.push(population);
            return;
        }
        self.steps.push(Step::Bombardment(Bombardment { populations: vec![population], floor: self.floor.clone() }));
        self.same_time = true;
    }

    fn add_secondaries(&mut self, p: &RawSecondaryCraters, process: usize, counter: Counter) {
        if p.density > 0.0 {
            let background = PowerLaw::new(&p.background(), process, self.spacing_m, counter.at(0));
            self.add_craters(Box::new(background));
        }
        if let Some(primaries) = self.primaries.clone().filter(|_| p.per_primary > 0) {
            let parameters = p.around_primaries();
            self.add_craters(Box::new(Secondaries::new(primaries, process, counter.at(1), parameters)));
        }
    }

    /// The world with those processes of a list that `acts` selects by their index; rocks follow a raster of their potential, if given.
    /// The draws of a process are named by its kind and its number among that kind in the complete list, and the complete list also decides which
    /// craters share an order of time: whether one process acts does not affect the others. Secondaries keep their positions even if their
    /// primaries do not act.
    pub fn with(
        mut self,
        processes: &[RawProcess],
        streams: &Streams,
        potential: Option<Potential>,
        acts: impl Fn(usize) -> bool,
    ) -> World {
        let (mut rocks, mut albedo) = (None, None);
        let dust = processes.iter().enumerate().find_map(|(n, p)| match p {
            RawProcess::Dust(dust) if acts(n) => Some(dust),
            _ => None,
        });
        for (n, process) in processes.iter().enumerate() {
            let kind = process.kind();
            let number = 1 + processes[..n].iter().filter(|p| p.kind() == kind).count();
            let counter = Counter::new(&mut streams.stream(&format!("{kind}-{number}")));
            if !acts(n) {
                self.skip(process, n, counter);
                continue;
            }
            match process {
                RawProcess::BaseSlope(p) => self.add_base(slope(p, self.spacing_m, self.anchor)),
                RawProcess::Texture(p) => self.add_texture(p.roughness_m, p.hurst, counter),
                RawProcess::PrimaryCraters(p) => {
                    let primaries = PowerLaw::new(&p.power_law(), n, self.spacing_m, counter);
                    self.primaries = Some(primaries.clone());
                    self.add_craters(Box::new(primaries));
                }
                RawProcess::SecondaryCraters(p) => self.add_secondaries(p, n, counter),
                RawProcess::Rocks(p) => {
                    let parameters = p.parameters(dust.map_or(0.0, |d| d.thickness_m));
                    let mut placed = Rocks::new(parameters, self.spacing_m, counter);
                    potential.iter().for_each(|raster| placed.follow(raster.clone()));
                    rocks = Some((placed, self.steps.len()));
                    self.same_time = false;
                }
                RawProcess::Albedo(p) => albedo = Some(of_surface(p, dust, counter)),
                RawProcess::Dust(_) => {}
            }
        }
        World { steps: self.steps, rocks, albedo }
    }

    /// Skips a process that does not act.
    fn skip(&mut self, process: &RawProcess, number: usize, counter: Counter) {
        match process {
            RawProcess::BaseSlope(_) | RawProcess::Texture(_) | RawProcess::Rocks(_) => self.same_time = false,
            RawProcess::PrimaryCraters(p) => {
                self.primaries = Some(PowerLaw::new(&p.power_law(), number, self.spacing_m, counter));
            }
            RawProcess::SecondaryCraters(_) | RawProcess::Albedo(_) | RawProcess::Dust(_) => {}
        }
    }
}

fn of_surface(p: &RawAlbedo, dust: Option<&RawDust>, counter: Counter) -> Albedo {
    Albedo {
        counter,
        sand: [p.sand, p.sand_deviation],
        rock: [p.rock, p.rock_deviation],
        dust: dust.map_or([0.0; 2], |d| [d.albedo, d.cover]),
    }
}

/// A plane plus a bilinear surface through four corners.
fn slope(p: &RawBaseSlope, spacing_m: f64, anchor: u32) -> Base {
    let [east, north] = p.gradient.map(|g| g * spacing_m);
    let [sw, se, nw, ne] = p.corner_heights_m.unwrap_or_default();
    let side = spacing(anchor);
    Box::new(move |[x, y]| {
        let (u, v) = (x / side, y / side);
        let (south, north_edge) = (sw + (se - sw) * u, nw + (ne - nw) * u);
        (east * x + north * y) + (south + (north_edge - south) * v)
    })
}
