//! Rocks: the potential that determines how many there may be, and the rocks themselves.
//!
//! The process sets the rock potential, the share of the ground that rocks cover, at its position in the list: uniform, or from a raster
//! ([`potential`]). Later craters clear it (inside and over most of the ejecta), and wide ones strew their own rocks around them, with a
//! coverage that falls exponentially with distance. The rocks are placed when everything else is done: as in the paper, large ones first,
//! which here means that where two rocks overlap, the higher top is visible.
//!
//! A rock is an ellipse of area `pi D^2 / 4` with a random azimuth and the profile of half an ellipsoid, of height
//! `(0.365 + 1.318 (f - 0.069)) D + 0.008 m` (our choice, after Golombek and Rapp, 1997): the more rocks, the taller. Its base is at the
//! height of the ground at the lattice point nearest to its centre, on the coarsest grid with a spacing of half a diameter or less, and
//! it has its own texture. Dust buries it from below: the rock ends where its smooth half ellipsoid drops below the dust.
//!
//! Placement: candidates strike the diamonds of `levels` with the density for a coverage of 0.6, which is never below the required density,
//! and are kept with the ratio of the two at their position as probability. Rocks therefore stay where they are when craters are added to a
//! world.

pub mod law;
pub mod potential;

use super::craters::population::{Crater, Near};
use super::craters::shape::{fall, fringe};
use super::levels::{RADIUS_SHARE, SizeRange, Window, floor_log2, size_ranges, spacing};
use super::texture::{Amplitudes, interpolate};
use law::Law;
use potential::Potential;
use sastrugi_numeric::{Counter, Poisson};
use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

/// Largest share of the ground that rocks may cover.
pub const COVERAGE_MAX: f64 = 0.6;
/// Distances in crater radii within which no rock is left, and beyond which all are.
const CLEARED_RADII: [f64; 2] = [2.5, 3.5];
/// The ratio of the shorter to the longer axis is uniform from this to 1.
const AXIS_RATIO_MIN: f64 = 0.6;
/// Roughness of a rock, at distances of its diameter, over its height.
const ROUGHNESS_SHARE: f64 = 0.05;
/// Hurst exponent of that roughness.
const ROUGHNESS_HURST: f64 = 0.8;

/// Words of a rock's own counter.
const DIAMETER: i64 = 0;
const ALONG: i64 = 1;
const ACROSS: i64 = 2;
const STAYS: i64 = 3;
const AXES: i64 = 4;
const AZIMUTH: i64 = 5;
const TEXTURE: i64 = 6;
const ALBEDO: i64 = 7;

/// Parameters of the rocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RockParameters {
    /// Share of the ground covered by all rocks.
    pub coverage: f64,
    /// Whether to compensate for the overlap of independently placed rocks.
    pub exact_union: bool,
    /// Smallest and largest diameter, m.
    pub diameters_m: [f64; 2],
    /// Height over diameter at a coverage of 0.069.
    pub height_ratio: f64,
    /// Growth of that ratio with coverage.
    pub height_gain: f64,
    /// Offset added to every height, m.
    pub height_offset_m: f64,
    /// Coverage by strewn rocks at the rim of a wide crater.
    pub crater_peak: f64,
    /// Distance over which that coverage falls by a factor e, radii.
    pub crater_decay_radii: f64,
    /// Craters below this diameter strew no rocks, m.
    pub crater_min_m: f64,
    /// Depth to which rocks are buried, m.
    pub buried_m: f64,
}

/// Rocks in one range of diameters.
#[derive(Clone, Debug)]
struct Bin {
    zoom: u32,
    /// `1 / D` of the smallest diameter, and that minus `1 / D` of the largest, 1/m.
    inverse: [f64; 2],
    /// Candidates have the density `bound / D^2`, 1/m3.
    bound: f64,
    mean: f64,
    per_diamond: Poisson,
}

/// Rocks of a world.
#[derive(Clone, Debug)]
pub struct Rocks {
    parameters: RockParameters,
    counter: Counter,
    spacing_m: f64,
    bins: Vec<Bin>,
    amplitudes: Amplitudes,
    /// Raster of the coverage, if it is not uniform.
    potential: Option<Potential>,
    /// Disks kept free of rocks: centre and radius, lattice units.
    clearings: Vec<([f64; 2], f64)>,
}

/// One rock.
#[derive(Clone, Copy, Debug)]
pub struct Rock {
    /// Diameter of the disk of the same area, m.
    pub diameter_m: f64,
    /// Centre, lattice units.
    pub centre: [f64; 2],
    /// Height of the top above its base, without dust, m.
    pub height_m: f64,
    /// Semi-axes, lattice units, the longer first.
    axes: [f64; 2],
    /// Sine and cosine of the azimuth of the longer axis, from east to north.
    azimuth: [f64; 2],
    /// Key of its albedo.
    pub albedo: Counter,
    texture: Counter,
    place: [i64; 4],
}

impl Bin {
    /// Upper bound of its rocks' diameters, m.
    fn widest_m(&self) -> f64 {
        1.0 / (self.inverse[0] - self.inverse[1])
    }
}

impl RockParameters {
    /// Fraction of the ground not covered by wider rocks that rocks up to `diameter_m` wide cover, given the coverage by all rocks; parts buried by
    /// dust count too.
    pub fn cover_below(&self, coverage: f64, diameter_m: f64) -> f64 {
        let [least, most] = self.diameters_m;
        if coverage <= 0.0 || diameter_m <= least {
            return 0.0;
        }
        let law = self.law(coverage);
        let (all, wider) = (
            law.cover_above(least) - law.cover_above(most),
            law.cover_above(diameter_m.min(most)) - law.cover_above(most),
        );
        if self.exact_union { (all - wider) / (1.0 - wider) } else { 1.0 - libm::exp(wider - all) }
    }

    fn law(&self, coverage: f64) -> Law {
        Law { coverage, exact_union: self.exact_union }
    }

    fn bins(&self, spacing_m: f64) -> Vec<Bin> {
        let law = self.law(COVERAGE_MAX);
        let bin = |range: SizeRange| {
            let [from, to] = range.diameters_m;
            // n D^2 falls with D.
            let bound = law.density(from) * from * from;
            let inverse = [1.0 / from, 1.0 / from - 1.0 / to];
            let mean = range.diamond_m2 * bound * inverse[1];
            Bin { zoom: range.zoom, inverse, bound, mean, per_diamond: Poisson::new(mean) }
        };
        size_ranges(self.diameters_m, spacing_m).map(bin).collect()
    }

    /// The coverage after a crater at `rho` radii from its centre.
    pub fn after_crater(&self, coverage: f64, crater: &Crater, rho: f64) -> f64 {
        let kept = coverage * (1.0 - fall(rho, CLEARED_RADII[0], CLEARED_RADII[1]));
        let strewn = if rho >= 1.0 && crater.diameter_m >= self.crater_min_m {
            self.crater_peak * libm::exp(-(rho - 1.0) / self.crater_decay_radii) * fringe(rho)
        } else {
            0.0
        };
        (kept + strewn).min(COVERAGE_MAX)
    }
}

impl Rocks {
    /// Rocks on a lattice.
    pub fn new(parameters: RockParameters, spacing_m: f64, counter: Counter) -> Self {
        let bins = parameters.bins(spacing_m);
        let coarsest = bins.last().map_or(0, |bin| bin.zoom);
        let amplitudes = Amplitudes::new(ROUGHNESS_HURST, spacing_m, coarsest);
        Self { parameters, counter, spacing_m, bins, amplitudes, potential: None, clearings: Vec::new() }
    }

    /// Makes the coverage follow a raster.
    pub fn follow(&mut self, potential: Potential) {
        self.potential = Some(potential);
    }

    /// The coverage before craters at a position (lattice units).
    pub fn coverage(&self, place: [f64; 2]) -> f64 {
        self.potential.as_ref().and_then(|raster| raster.at(place)).unwrap_or(self.parameters.coverage)
    }

    /// Share of the points of a window where the raster, if any, has no data.
    pub fn unknown_share(&self, window: &Window) -> f64 {
        let Some(raster) = &self.potential else { return 0.0 };
        let known = |k: &usize| raster.at([window.x(k % window.cols), window.y(k / window.cols)]).is_some();
        1.0 - (0..window.len()).filter(known).count() as f64 / window.len() as f64
    }

    /// Removes the rocks that may reach into disks, given by centre and radius, lattice units.
    pub fn keep_out(&mut self, clearings: Vec<([f64; 2], f64)>) {
        self.clearings = clearings;
    }

    /// Whether a rock with the longer semi-axis `long` may reach into a clearing.
    fn is_cleared(&self, [x, y]: [f64; 2], long: f64) -> bool {
        self.clearings.iter().any(|(centre, radius)| {
            let ([dx, dy], reach) = ([x - centre[0], y - centre[1]], radius + long);
            dx * dx + dy * dy < reach * reach
        })
    }

    /// Parameters.
    pub fn parameters(&self) -> &RockParameters {
        &self.parameters
    }

    /// How far from a point the centre or the base of a rock that covers it may lie, lattice units.
    pub fn reach(&self) -> f64 {
        let widest = self.parameters.diameters_m[1] / self.spacing_m;
        // The base of a rock may lie half a diagonal of half a diameter from its centre.
        long_axis(widest, AXIS_RATIO_MIN) + 0.36 * widest
    }

    /// The rocks wider than `diameter_min_m` that may cover a point of the window, largest first; `coverage` gives the coverage by all rocks at a
    /// position (lattice units).
    pub fn find(
        &self,
        window: &Window,
        diameter_min_m: f64,
        cancel: Option<&AtomicBool>,
        coverage: impl Fn([f64; 2]) -> f64,
    ) -> Vec<Rock> {
        let near = Near { window, margin: 0.0, cancel };
        let mut found = Vec::new();
        for bin in self.bins.iter().filter(|bin| bin.widest_m() > diameter_min_m) {
            window.visit_diamonds(bin.zoom, self.bin_reach(bin), |i, j| {
                if near.is_over() {
                    return;
                }
                let diamond = self.counter.at(j).at(i);
                for n in 0..i64::from(bin.per_diamond.count(diamond.uniform())) {
                    found.extend(self.rock(bin, [i, j, n], diamond.at(n), &near, &coverage));
                }
            });
        }
        found.retain(|rock: &Rock| rock.diameter_m > diameter_min_m);
        found.sort_unstable_by(|a, b| b.diameter_m.total_cmp(&a.diameter_m).then_with(|| a.place.cmp(&b.place)));
        found
    }

    /// How far from the centre of a bin's diamond its rocks reach, lattice units.
    fn bin_reach(&self, bin: &Bin) -> f64 {
        spacing(bin.zoom) + Self::widest_axis(bin)
    }

    /// Longest semi-axis in a bin, lattice units.
    fn widest_axis(bin: &Bin) -> f64 {
        long_axis(2.0 * RADIUS_SHARE * spacing(bin.zoom), AXIS_RATIO_MIN)
    }

    /// The candidate, if it may cover a point of the window, is kept, and is not buried.
    fn rock(
        &self,
        bin: &Bin,
        [i, j, n]: [i64; 3],
        own: Counter,
        near: &Near<'_>,
        coverage: impl Fn([f64; 2]) -> f64,
    ) -> Option<Rock> {
        let [inverse, span] = bin.inverse;
        let diameter_m = 1.0 / (inverse - own.at(DIAMETER).uniform() * span);
        let [s, t] = [ALONG, ACROSS].map(|word| (own.at(word).uniform() - 0.5) * spacing(bin.zoom));
        let centre = [i as f64 + (s + t), j as f64 + (s - t)];
        let ratio = AXIS_RATIO_MIN + (1.0 - AXIS_RATIO_MIN) * own.at(AXES).uniform();
        let long = long_axis(diameter_m, ratio) / self.spacing_m;
        if !near.touches(centre, long) {
            return None;
        }
        let here = coverage(centre);
        let wanted = if here > 0.0 { self.parameters.law(here).density(diameter_m) } else { 0.0 };
        if own.at(STAYS).uniform() * bin.bound >= wanted * diameter_m * diameter_m {
            return None;
        }
        if self.is_cleared(centre, long) {
            return None;
        }
        let height_m = self.height_m(diameter_m, here);
        let (sin, cos) = libm::sincos(PI * own.at(AZIMUTH).uniform());
        (height_m > self.parameters.buried_m).then(|| Rock {
            diameter_m,
            centre,
            height_m,
            axes: [long, long * ratio],
            azimuth: [sin, cos],
            albedo: own.at(ALBEDO),
            texture: own.at(TEXTURE),
            place: [i64::from(bin.zoom), j, i, n],
        })
    }

    fn height_m(&self, diameter_m: f64, coverage: f64) -> f64 {
        let p = &self.parameters;
        (p.height_ratio + p.height_gain * (coverage - 0.069)) * diameter_m + p.height_offset_m
    }

    /// Calls `f(k, height)` for every point of the window under the visible part of the rock: the point's index in the row-major
    /// values and the rock's height above its base there, minus the buried depth, m.
    pub fn cover(&self, rock: &Rock, window: &Window, mut f: impl FnMut(usize, f64)) {
        let Some(part) = window.part(rock.centre, rock.axes[0]) else { return };
        let anchor = floor_log2(0.5 * rock.diameter_m / self.spacing_m);
        let scale_m = ROUGHNESS_SHARE * rock.height_m / libm::pow(rock.diameter_m, ROUGHNESS_HURST);
        let texture = interpolate(&window.of_part(&part), anchor, rock.texture, scale_m, &self.amplitudes);
        let [sin, cos] = rock.azimuth;
        for (row, line) in part.rows.zip(texture.chunks_exact(part.cols.len())) {
            let dy = window.y(row) - rock.centre[1];
            for (col, texture) in part.cols.clone().zip(line) {
                let dx = window.x(col) - rock.centre[0];
                let (along, across) = ((dx * cos + dy * sin) / rock.axes[0], (dy * cos - dx * sin) / rock.axes[1]);
                let inside = 1.0 - (along * along + across * across);
                if inside < 0.0 {
                    continue;
                }
                let smooth_m = rock.height_m * inside.sqrt() - self.parameters.buried_m;
                if smooth_m >= 0.0 {
                    f(row * window.cols + col, smooth_m + texture);
                }
            }
        }
    }

    /// The lattice point at the base of a rock: binary logarithm of its grid's spacing, and the point in that spacing.
    pub fn base(&self, rock: &Rock) -> (u32, i64, i64) {
        let zoom = floor_log2(0.5 * rock.diameter_m / self.spacing_m);
        let [i, j] = rock.centre.map(|at| (at / spacing(zoom)).round() as i64);
        (zoom, i, j)
    }

    /// Expected number of rocks and diamonds that [`Self::find`] examines.
    pub fn work(&self, window: &Window, diameter_min_m: f64) -> f64 {
        let wide = self.bins.iter().filter(|bin| bin.widest_m() > diameter_min_m);
        wide.map(|bin| (1.0 + bin.mean) * window.diamonds(bin.zoom, self.bin_reach(bin))).sum()
    }

    /// Expected number of rocks that are kept and cover points of a window: in bins whose rocks are wider than its point spacing, and in other bins.
    pub fn set(&self, window: &Window) -> [f64; 2] {
        /// Share of the square about the widest rock of a bin that a rock of the bin covers.
        const UNDER_A_ROCK: f64 = 0.25;
        let stays = (self.parameters.coverage / COVERAGE_MAX).min(1.0);
        self.bins.iter().fold([0.0; 2], |[close, apart], bin| {
            let axis = Self::widest_axis(bin);
            let count = stays * bin.mean * window.ground(bin.zoom, axis);
            if spacing(window.zoom) > 2.0 * axis + 1.0 {
                [close, apart + UNDER_A_ROCK * count]
            } else {
                [close + count, apart]
            }
        })
    }

    /// Expected number of rocks found for a window, if each were as wide as the widest of its bin and all candidates were kept.
    pub fn held(&self, window: &Window) -> f64 {
        self.bins.iter().map(|bin| bin.mean * window.ground(bin.zoom, Self::widest_axis(bin))).sum()
    }
}

/// Longer semi-axis of an ellipse with the area of a disk.
fn long_axis(diameter: f64, ratio: f64) -> f64 {
    0.5 * diameter / ratio.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planetary::processes::RawRocks;
    use sastrugi_numeric::Streams;

    /// The points under a rock are those of an ellipse: its area is that of a disk of the diameter, and its second moments are
    /// `a^2 / 4` and `b^2 / 4` along its axes, the longer one at the azimuth from east to north. For radii of 40 points and more,
    /// counts scatter by 0.1 % about the area and moments by 0.4 % of `a^2 / 4`.
    #[test]
    fn val_rocks_are_ellipses() {
        let raw = RawRocks { diameter_min_m: 0.8, diameter_max_m: 1.2, ..RawRocks::default() };
        let counter = Counter::new(&mut Streams::for_seed(4, "terrain").stream("rocks"));
        let rocks = Rocks::new(raw.parameters(0.0), 0.01, counter);
        let area = Window { zoom: 0, west: 0, south: 0, cols: 4000, rows: 4000, centred: false };
        let mut all = rocks.find(&area, 0.0, None, |_| 0.3);
        all.retain(|rock| rock.centre.iter().all(|at| (100.0..3900.0).contains(at)));
        assert!(all.len() > 10, "{}", all.len());
        for rock in &all {
            let mut points = Vec::new();
            rocks.cover(rock, &area, |k, _| {
                points.push([area.x(k % 4000) - rock.centre[0], area.y(k / 4000) - rock.centre[1]]);
            });
            let disk = 0.25 * PI * rock.diameter_m * rock.diameter_m / 1e-4;
            assert!((points.len() as f64 / disk - 1.0).abs() < 0.01, "{rock:?}: {}", points.len());
            let ([a, b], [sin, cos]) = (rock.axes, rock.azimuth);
            assert!((AXIS_RATIO_MIN..=1.0).contains(&(b / a)), "{rock:?}");
            let moment = |of: fn(&[f64; 2]) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
            for (found, wanted) in [
                (moment(|p| p[0] * p[0]), a * a * cos * cos + b * b * sin * sin),
                (moment(|p| p[0] * p[1]), (a * a - b * b) * sin * cos),
                (moment(|p| p[1] * p[1]), a * a * sin * sin + b * b * cos * cos),
            ] {
                assert!((found - 0.25 * wanted).abs() < 0.003 * a * a, "{rock:?}: {found} {wanted}");
            }
        }
    }
}
