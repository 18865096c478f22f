//! Where and when craters strike.

use super::shape::{EJECTA_RADII, Profile};
use crate::planetary::levels::{RADIUS_SHARE, SizeRange, Window, size_ranges, spacing};
use sastrugi_numeric::{Counter, Poisson};
use std::cell::RefCell;
use std::cmp::Ordering;
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering as Memory};

/// Words of a crater's own counter.
const DIAMETER: i64 = 0;
const ALONG: i64 = 1;
const ACROSS: i64 = 2;
const TIME: i64 = 3;
const TEXTURE: i64 = 4;

/// Slightly more than 1, so that bounds for skipping craters hold despite rounding.
const MORE: f64 = 1.0 + 1e-9;

/// Identity of a crater: process, bin, diamond, number, and, from 1, number among the secondaries of that primary, or else 0.
pub type Place = (usize, u32, i64, i64, i64, i64);

/// One crater.
#[derive(Clone, Copy, Debug)]
pub struct Crater {
    /// Time of impact, in 0 to 1; ties are broken by place.
    pub time: f64,
    /// Its identity.
    pub place: Place,
    /// Centre, lattice units.
    pub centre: [f64; 2],
    /// Radius, lattice units.
    pub radius: f64,
    /// Diameter, m.
    pub diameter_m: f64,
    /// Key of the texture of its floor.
    pub texture: Counter,
    /// Shape parameters of its process.
    pub style: Style,
}

/// Shape parameters common to the craters of a process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Depth over diameter of small craters.
    pub depth_ratio: f64,
    /// Whether depths are measured from the surface instead of the rim.
    pub below_datum: bool,
    /// Roughness of new floors over that of the surface.
    pub floor_roughness: f64,
}

impl Crater {
    /// Height above the surface that it struck.
    pub fn profile(&self) -> Profile {
        Profile::new(self.diameter_m, self.style.depth_ratio, self.style.below_datum)
    }

    /// Order of time, earliest first.
    pub fn order(&self, other: &Self) -> Ordering {
        self.time.total_cmp(&other.time).then_with(|| self.place.cmp(&other.place))
    }
}

/// A search area: points, and a margin around them, lattice units.
#[derive(Clone, Copy)]
pub struct Near<'a> {
    /// The points.
    pub window: &'a Window,
    /// Margin in addition to the craters' own reach.
    pub margin: f64,
    /// Set to true to cancel the search.
    pub cancel: Option<&'a AtomicBool>,
}

impl Near<'_> {
    /// Whether the search was cancelled.
    pub fn is_over(&self) -> bool {
        self.cancel.is_some_and(|flag| flag.load(Memory::Relaxed))
    }

    /// Whether a point or its margin may lie within `reach` of a centre.
    pub fn touches(&self, centre: [f64; 2], reach: f64) -> bool {
        self.window.part(centre, reach + self.margin).is_some()
    }
}

/// Cache of the secondaries of each primary.
#[derive(Default)]
pub struct Families {
    /// Secondaries up to this width are never requested, m.
    least_m: f64,
    met: RefCell<HashMap<Place, Rc<[Crater]>>>,
}

impl Families {
    /// An empty cache, for secondaries wider than `least_m` only.
    pub fn wider_than(least_m: f64) -> Self {
        Self { least_m, met: RefCell::default() }
    }

    /// Number of cached secondaries.
    #[cfg(test)]
    pub fn members(&self) -> usize {
        self.met.borrow().values().map(|family| family.len()).sum()
    }
}

/// A set of craters that can be searched by area.
pub trait Population: Send + Sync {
    /// Adds every crater wider than `diameter_min_m` whose ejecta may reach the search area.
    fn find(&self, near: &Near<'_>, diameter_min_m: f64, families: &Families, found: &mut Vec<Crater>);

    /// Expected number of craters and diamonds that [`Self::find`] examines.
    fn work(&self, near: &Near<'_>, diameter_min_m: f64) -> f64;

    /// Expected number of craters that it holds in memory; never an underestimate.
    fn held(&self, near: &Near<'_>) -> f64;
}

/// Craters in one range of diameters, a factor of 2 at most.
#[derive(Clone, Debug)]
struct Bin {
    /// Binary logarithm of the spacing of the grid whose diamonds contain them.
    zoom: u32,
    /// `D^-A` of the smallest diameter, and that minus `D^-A` of the largest.
    power: [f64; 2],
    diameter_max_m: f64,
    mean: f64,
    per_diamond: Poisson,
}

/// Craters that follow a power law: `N(>D) = density D^-A` per square metre between two diameters.
#[derive(Clone, Debug)]
pub struct PowerLaw {
    counter: Counter,
    process: usize,
    exponent: f64,
    style: Style,
    spacing_m: f64,
    bins: Vec<Bin>,
}

/// Parameters of a power law.
#[derive(Clone, Copy, Debug)]
pub struct PowerLawParameters {
    /// `density`, m^(A - 2).
    pub density: f64,
    /// A.
    pub exponent: f64,
    /// Smallest and largest diameter, m.
    pub diameters_m: [f64; 2],
    /// Shape.
    pub style: Style,
}

impl PowerLawParameters {
    /// Craters per square metre wider than `diameter_m`.
    fn above(&self, diameter_m: f64) -> f64 {
        self.density * libm::pow(diameter_m, -self.exponent)
    }

    fn bins(&self, spacing_m: f64) -> Vec<Bin> {
        let bin = |range: SizeRange| {
            let [from, to] = range.diameters_m;
            let mean = range.diamond_m2 * (self.above(from) - self.above(to));
            let power = libm::pow(from, -self.exponent);
            let power = [power, power - libm::pow(to, -self.exponent)];
            Bin { zoom: range.zoom, power, diameter_max_m: to, mean, per_diamond: Poisson::new(mean) }
        };
        size_ranges(self.diameters_m, spacing_m).map(bin).collect()
    }

    /// The largest mean number of craters in a diamond; infinite if any is NaN.
    pub fn mean_max(&self, spacing_m: f64) -> f64 {
        let mean = |bin: &Bin| if bin.mean.is_nan() { f64::INFINITY } else { bin.mean };
        self.bins(spacing_m).iter().map(mean).fold(0.0, f64::max)
    }
}

impl PowerLaw {
    /// The craters of process number `process` on a lattice.
    pub fn new(parameters: &PowerLawParameters, process: usize, spacing_m: f64, counter: Counter) -> Self {
        let bins = parameters.bins(spacing_m);
        let PowerLawParameters { exponent, style, .. } = *parameters;
        Self { counter, process, exponent, style, spacing_m, bins }
    }

    /// How far from the centre of a bin's diamond a feature that extends over `radii` crater radii can reach, lattice units.
    fn reach(bin: &Bin, radii: f64, near: &Near<'_>) -> f64 {
        (1.0 + RADIUS_SHARE * radii) * spacing(bin.zoom) + near.margin
    }

    /// Calls `f` for every crater wider than `diameter_min_m` that may reach the search area within `radii` radii.
    fn visit(&self, near: &Near<'_>, radii: f64, diameter_min_m: f64, mut f: impl FnMut(Crater)) {
        for bin in self.bins.iter().filter(|bin| bin.diameter_max_m > diameter_min_m) {
            near.window.visit_diamonds(bin.zoom, Self::reach(bin, radii, near), |i, j| {
                if near.is_over() {
                    return;
                }
                let diamond = self.counter.at(j).at(i);
                for n in 0..i64::from(bin.per_diamond.count(diamond.uniform())) {
                    // Most would be too far away even with the widest diameter of the bin: no need to draw theirs.
                    let centre = Self::centre(bin, [i, j], diamond.at(n));
                    if !near.touches(centre, radii * 0.5 * bin.diameter_max_m * MORE / self.spacing_m) {
                        continue;
                    }
                    let crater = self.crater(bin, [i, j], n, diamond.at(n));
                    if crater.diameter_m > diameter_min_m && near.touches(crater.centre, radii * crater.radius) {
                        f(crater);
                    }
                }
            });
        }
    }

    fn centre(bin: &Bin, [i, j]: [i64; 2], own: Counter) -> [f64; 2] {
        let [s, t] = [ALONG, ACROSS].map(|word| (own.at(word).uniform() - 0.5) * spacing(bin.zoom));
        [i as f64 + (s + t), j as f64 + (s - t)]
    }

    fn crater(&self, bin: &Bin, [i, j]: [i64; 2], n: i64, own: Counter) -> Crater {
        let [low, span] = bin.power;
        let diameter_m = libm::pow(low - own.at(DIAMETER).uniform() * span, -1.0 / self.exponent);
        Crater {
            time: own.at(TIME).uniform(),
            place: (self.process, bin.zoom, j, i, n, 0),
            centre: Self::centre(bin, [i, j], own),
            radius: 0.5 * diameter_m / self.spacing_m,
            diameter_m,
            texture: own.at(TEXTURE),
            style: self.style,
        }
    }

    /// Expected work of [`Self::visit`] if a crater costs `each` and a diamond 1.
    fn work_of_visit(&self, near: &Near<'_>, radii: f64, diameter_min_m: f64, each: f64) -> f64 {
        let wide = self.bins.iter().filter(|bin| bin.diameter_max_m > diameter_min_m);
        wide.map(|bin| (1.0 + each * bin.mean) * near.window.diamonds(bin.zoom, Self::reach(bin, radii, near))).sum()
    }

    /// Expected number of craters that [`Self::visit`] calls `f` for, if each were as wide as the widest of its bin.
    fn visited(&self, near: &Near<'_>, radii: f64, diameter_min_m: f64) -> f64 {
        let wide = self.bins.iter().filter(|bin| bin.diameter_max_m > diameter_min_m);
        let reach = |bin: &Bin| RADIUS_SHARE * radii * spacing(bin.zoom) + near.margin;
        wide.map(|bin| bin.mean * near.window.ground(bin.zoom, reach(bin))).sum()
    }
}

impl Population for PowerLaw {
    fn find(&self, near: &Near<'_>, diameter_min_m: f64, _families: &Families, found: &mut Vec<Crater>) {
        self.visit(near, EJECTA_RADII, diameter_min_m, |crater| found.push(crater));
    }

    fn work(&self, near: &Near<'_>, diameter_min_m: f64) -> f64 {
        self.work_of_visit(near, EJECTA_RADII, diameter_min_m, 1.0)
    }

    fn held(&self, near: &Near<'_>) -> f64 {
        self.visited(near, EJECTA_RADII, 0.0)
    }
}

/// Secondaries around the larger craters of a power law: the same number around each, at the time of their primary.
#[derive(Clone, Debug)]
pub struct Secondaries {
    /// The primaries.
    pub primaries: PowerLaw,
    /// Number of the secondaries' process.
    pub process: usize,
    /// Key of their draws.
    pub counter: Counter,
    /// Parameters.
    pub parameters: SecondaryParameters,
    /// D^-A of the smallest secondary over that of the largest.
    power: f64,
}

/// Parameters of secondaries around primaries.
#[derive(Clone, Copy, Debug)]
pub struct SecondaryParameters {
    /// Smallest primary with secondaries, m.
    pub primary_min_m: f64,
    /// Secondaries of each primary.
    pub count: u32,
    /// Largest secondary over its primary.
    pub largest_ratio: f64,
    /// Smallest over largest secondary.
    pub smallest_share: f64,
    /// A of their diameters.
    pub exponent: f64,
    /// Nearest and farthest secondary, radii of the primary.
    pub ring_radii: [f64; 2],
    /// Shape.
    pub style: Style,
}

impl SecondaryParameters {
    /// Reach of secondaries and their ejecta, radii of the primary.
    fn reach_radii(&self) -> f64 {
        self.ring_radii[1] + EJECTA_RADII * self.largest_ratio
    }

    /// Only primaries wider than this may have a secondary wider than `diameter_min_m`, m.
    fn parent_min_m(&self, diameter_min_m: f64) -> f64 {
        self.primary_min_m.max(diameter_min_m / self.largest_ratio)
    }
}

impl Secondaries {
    /// The secondaries of some primaries, of process number `process`.
    pub fn new(primaries: PowerLaw, process: usize, counter: Counter, parameters: SecondaryParameters) -> Self {
        let power = libm::pow(parameters.smallest_share, -parameters.exponent);
        Self { primaries, process, counter, parameters, power }
    }

    /// The secondaries of a primary, widest first; some of those up to `least_m` wide may be left out.
    fn family(&self, primary: &Crater, least_m: f64) -> Rc<[Crater]> {
        let p = &self.parameters;
        let (_, bin, j, i, n, _) = primary.place;
        let root = self.counter.at(i64::from(bin)).at(j).at(i).at(n);
        // D^-A falls with D: a secondary whose value exceeds that of the bound is too narrow; no need to compute its diameter.
        let most = libm::pow(least_m / (p.largest_ratio * primary.diameter_m), -p.exponent) * MORE;
        let wide = |m: &i64| self.relative_power(root.at(*m)) <= most;
        let members = (0..i64::from(p.count)).filter(wide);
        let mut family: Vec<Crater> = members.map(|m| self.secondary(primary, m, root.at(m))).collect();
        family.sort_unstable_by(|a, b| b.diameter_m.total_cmp(&a.diameter_m).then_with(|| a.place.cmp(&b.place)));
        family.into()
    }

    /// D^-A of a secondary, over that of the largest.
    fn relative_power(&self, own: Counter) -> f64 {
        self.power - own.at(DIAMETER).uniform() * (self.power - 1.0)
    }

    fn secondary(&self, primary: &Crater, m: i64, own: Counter) -> Crater {
        let p = &self.parameters;
        let largest_m = p.largest_ratio * primary.diameter_m;
        let diameter_m = largest_m * libm::pow(self.relative_power(own), -1.0 / p.exponent);
        // Density r^-2 over a ring: log r is uniform.
        let [near, far] = p.ring_radii;
        let distance = primary.radius * near * libm::pow(far / near, own.at(ALONG).uniform());
        let (sin, cos) = libm::sincos(TAU * own.at(ACROSS).uniform());
        let (_, bin, j, i, n, _) = primary.place;
        Crater {
            time: primary.time,
            place: (self.process, bin, j, i, n, 1 + m),
            centre: [primary.centre[0] + distance * cos, primary.centre[1] + distance * sin],
            radius: 0.5 * diameter_m / self.primaries.spacing_m,
            diameter_m,
            texture: own.at(TEXTURE),
            style: p.style,
        }
    }
}

impl Population for Secondaries {
    fn find(&self, near: &Near<'_>, diameter_min_m: f64, families: &Families, found: &mut Vec<Crater>) {
        let p = &self.parameters;
        self.primaries.visit(near, p.reach_radii(), p.parent_min_m(diameter_min_m), |primary| {
            let (_, bin, j, i, n, _) = primary.place;
            let key = (self.process, bin, j, i, n, 0);
            let family = {
                let mut met = families.met.borrow_mut();
                met.entry(key).or_insert_with(|| self.family(&primary, families.least_m)).clone()
            };
            let wide = family.iter().take_while(|c| c.diameter_m > diameter_min_m);
            found.extend(wide.filter(|c| near.touches(c.centre, EJECTA_RADII * c.radius)));
        });
    }

    fn work(&self, near: &Near<'_>, diameter_min_m: f64) -> f64 {
        let p = &self.parameters;
        self.primaries.work_of_visit(near, p.reach_radii(), p.parent_min_m(diameter_min_m), 1.0 + f64::from(p.count))
    }

    fn held(&self, near: &Near<'_>) -> f64 {
        let p = &self.parameters;
        self.primaries.visited(near, p.reach_radii(), p.primary_min_m) * f64::from(p.count)
    }
}
