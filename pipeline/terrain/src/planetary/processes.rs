//! The processes that shape a surface: their parameters and the checks on them.

use super::craters::population::{PowerLawParameters, SecondaryParameters, Style};
use super::rocks::{COVERAGE_MAX, RockParameters};
use crate::generator::NamedInput;
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Smallest crater, basic spacings: its retained points need a quarter of its diameter as spacing.
const CRATER_SPACINGS_MIN: f64 = 4.0;
/// Largest crater, basic spacings: far larger than any planet.
const CRATER_SPACINGS_MAX: f64 = (1u64 << 40) as f64;
/// Largest rock, m: craters must be known as far around a patch as rocks reach.
const ROCK_MAX_M: f64 = 50.0;
/// Largest mean number of craters of diameters D to 2 D in a diamond, which covers 32 D^2 of ground. For A = 2 it is 24 times the density,
/// so this limit is 20 times saturation. Time grows with its square.
const CRATERS_PER_DIAMOND_MAX: f64 = 40.0;
/// Smallest and largest exponent of a power law: beyond these, powers of diameters exceed double precision.
const EXPONENTS: [f64; 2] = [0.1, 20.0];
/// Smallest ratio of the smallest to the largest secondary, for the same reason.
const SMALLEST_SHARE_MIN: f64 = 1e-3;
/// Maximum number of secondaries around a primary.
const PER_PRIMARY_MAX: u32 = 100_000;

/// A smooth slope.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawBaseSlope {
    /// Rise to the east and to the north, m per m.
    pub gradient: [f64; 2],
    /// Heights at the south-west, south-east, north-west and north-east corners of a square with its south-west corner at the origin and
    /// the anchor spacing as side, m; bilinear between and beyond them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corner_heights_m: Option<[f64; 4]>,
}

/// Roughness at every scale.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawTexture {
    /// Standard deviation of a point about the mean of its parents 1 m away, m; 0 or above (not published; our choice).
    #[schemars(transform = limits::not_negative)]
    pub roughness_m: f64,
    /// Hurst exponent H, above 0 to 1: the PSD of profiles falls as f^-(2 H + 1) (not published; our choice).
    #[schemars(transform = limits::above(0.0, 1.0))]
    pub hurst: f64,
}

impl Default for RawTexture {
    fn default() -> Self {
        Self { roughness_m: 0.02, hurst: 0.8 }
    }
}

/// Level from which the depth of a crater is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Datum {
    /// From the crest of the rim.
    Rim,
    /// From the surface that was struck.
    Surface,
}

/// Craters of impacts from space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPrimaryCraters {
    /// Craters wider than 1 m per square metre, if the power law extended to 1 m (0.079 is saturation: Trask, 1966; 0.008, a tenth of it,
    /// is our choice).
    #[schemars(transform = limits::not_negative)]
    pub density: f64,
    /// Exponent A of N(>D) = density D^-A, 0.1 to 20 (the paper: about 2).
    #[schemars(transform = limits::within(EXPONENTS[0], EXPONENTS[1]))]
    pub exponent: f64,
    /// Smallest diameter, m; at least 4 basic spacings.
    #[schemars(transform = limits::positive)]
    pub diameter_min_m: f64,
    /// Largest diameter, m (the paper's example: 1000).
    #[schemars(transform = limits::positive)]
    pub diameter_max_m: f64,
    /// Depth over diameter of small craters (the paper: 0.2); no crater is deeper than 6 km.
    #[schemars(transform = limits::between(0.0, 1.0))]
    pub depth_ratio: f64,
    /// Level from which the depth is measured.
    pub datum: Datum,
    /// Roughness of new floors over that of the surface (not published; our choice).
    #[schemars(transform = limits::not_negative)]
    pub floor_roughness: f64,
}

impl Default for RawPrimaryCraters {
    fn default() -> Self {
        Self {
            density: 0.008,
            exponent: 2.0,
            diameter_min_m: 0.5,
            diameter_max_m: 1000.0,
            depth_ratio: 0.2,
            datum: Datum::Rim,
            floor_roughness: 0.5,
        }
    }
}

/// Craters formed by the ejecta of other impacts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSecondaryCraters {
    /// Uniformly distributed secondaries of primaries that are not in the list: craters wider than 1 m per square metre, if the power law
    /// extended to 1 m; 0 for none.
    #[schemars(transform = limits::not_negative)]
    pub density: f64,
    /// Smallest diameter of these uniform secondaries, m; at least 4 basic spacings.
    #[schemars(transform = limits::positive)]
    pub diameter_min_m: f64,
    /// Largest diameter of these uniform secondaries, m.
    #[schemars(transform = limits::positive)]
    pub diameter_max_m: f64,
    /// Exponent A of N(>D) = density D^-A, also for secondaries around primaries, 0.1 to 20 (the paper: 3.5).
    #[schemars(transform = limits::within(EXPONENTS[0], EXPONENTS[1]))]
    pub exponent: f64,
    /// Secondaries around each wide crater of the nearest preceding `primary_craters`; 0 for none (our choice: the number for which the
    /// power law gives one of the largest size).
    #[schemars(range(max = PER_PRIMARY_MAX))]
    pub per_primary: u32,
    /// Smallest crater with secondaries, m (our choice).
    #[schemars(transform = limits::positive)]
    pub primary_min_m: f64,
    /// Largest secondary over its primary (our choice).
    #[schemars(transform = limits::between(0.0, 1.0))]
    pub largest_ratio: f64,
    /// Smallest over largest secondary of a primary, above 0.001 and below 1 (our choice).
    #[schemars(transform = limits::between(SMALLEST_SHARE_MIN, 1.0))]
    pub smallest_share: f64,
    /// Nearest and farthest secondary, radii of the primary; their density falls with the square of the distance (our choice).
    #[schemars(transform = limits::within(1.0, 100.0))]
    pub ring_radii: [f64; 2],
    /// Depth over diameter (Pike and Wilhelms, 1978: about half that of primaries).
    #[schemars(transform = limits::between(0.0, 1.0))]
    pub depth_ratio: f64,
    /// Level from which the depth is measured.
    pub datum: Datum,
    /// Roughness of new floors over that of the surface.
    #[schemars(transform = limits::not_negative)]
    pub floor_roughness: f64,
}

impl Default for RawSecondaryCraters {
    fn default() -> Self {
        Self {
            density: 0.0,
            diameter_min_m: 0.5,
            diameter_max_m: 50.0,
            exponent: 3.5,
            per_primary: 1448,
            primary_min_m: 100.0,
            largest_ratio: 0.05,
            smallest_share: 0.125,
            ring_radii: [3.0, 16.0],
            depth_ratio: 0.1,
            datum: Datum::Rim,
            floor_roughness: 0.5,
        }
    }
}

/// How many rocks give a coverage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RockLaw {
    /// Enough for their union to cover the prescribed share, although they overlap.
    ExactUnion,
    /// As published, for rocks that do not overlap: placed independently, they cover less.
    Literal,
}

/// Rocks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawRocks {
    /// Share of the ground that all rocks cover, 0 to 0.6 (Golombek and Rapp, 1997: 0.069 at Viking 1, 0.176 at Viking 2).
    #[schemars(transform = limits::within(0.0, COVERAGE_MAX))]
    pub coverage: f64,
    /// Raster of spatially varying coverage, in the coordinates of the surface: an id in a study (`<id>.rock-potential` for the map of a
    /// terrain) or a file. Bilinear between its cells; where it has no data, `coverage` is used.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub potential: Option<String>,
    /// Smallest diameter, m; at least a basic spacing (our choice).
    #[schemars(transform = limits::positive)]
    pub diameter_min_m: f64,
    /// Largest diameter, m; at most 50 (our choice).
    #[schemars(transform = limits::above(0.0, ROCK_MAX_M))]
    pub diameter_max_m: f64,
    /// How many rocks give a coverage.
    pub law: RockLaw,
    /// Height over diameter where rocks cover 0.069 (our choice, after Golombek and Rapp, 1997).
    #[schemars(transform = limits::not_negative)]
    pub height_ratio: f64,
    /// Increase of that ratio per unit of coverage (giving 0.506 at 0.176; our choice: rockier ground has taller rocks).
    pub height_gain: f64,
    /// Offset added to every height, m (our choice).
    pub height_offset_m: f64,
    /// Coverage by the rocks that a wide crater strews, at its rim (our choice).
    #[schemars(transform = limits::within(0.0, COVERAGE_MAX))]
    pub crater_peak: f64,
    /// Distance over which that coverage falls by a factor e, crater radii (our choice).
    #[schemars(transform = limits::positive)]
    pub crater_decay_radii: f64,
    /// Craters narrower than this strew no rocks, m (our choice).
    #[schemars(transform = limits::not_negative)]
    pub crater_min_m: f64,
}

impl Default for RawRocks {
    fn default() -> Self {
        Self {
            coverage: 0.069,
            potential: None,
            diameter_min_m: 0.03,
            diameter_max_m: 5.0,
            law: RockLaw::ExactUnion,
            height_ratio: 0.365,
            height_gain: 1.318,
            height_offset_m: 0.008,
            crater_peak: 0.3,
            crater_decay_radii: 1.0,
            crater_min_m: 5.0,
        }
    }
}

/// Albedo of the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawAlbedo {
    /// Mean albedo of sand (our choice).
    #[schemars(transform = limits::within(0.0, 1.0))]
    pub sand: f64,
    /// Standard deviation of the sand's albedo from point to point.
    #[schemars(transform = limits::within(0.0, 1.0))]
    pub sand_deviation: f64,
    /// Mean albedo of rocks (our choice).
    #[schemars(transform = limits::within(0.0, 1.0))]
    pub rock: f64,
    /// Standard deviation of the rocks' albedo from rock to rock.
    #[schemars(transform = limits::within(0.0, 1.0))]
    pub rock_deviation: f64,
}

impl Default for RawAlbedo {
    fn default() -> Self {
        Self { sand: 0.25, sand_deviation: 0.02, rock: 0.16, rock_deviation: 0.03 }
    }
}

/// Dust over everything: it buries rocks and, if there is an albedo, brightens the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawDust {
    /// Thickness, m: rocks protrude by that much less and cover less ground; lower ones vanish (our choice).
    #[schemars(transform = limits::not_negative)]
    pub thickness_m: f64,
    /// Albedo of the dust (our choice).
    #[schemars(transform = limits::within(0.0, 1.0))]
    pub albedo: f64,
    /// Share of every point that the dust covers, 0 to 1 (our choice).
    #[schemars(transform = limits::within(0.0, 1.0))]
    pub cover: f64,
}

impl Default for RawDust {
    fn default() -> Self {
        Self { thickness_m: 0.01, albedo: 0.3, cover: 0.5 }
    }
}

/// One process that shapes the surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum RawProcess {
    /// A smooth slope.
    BaseSlope(RawBaseSlope),
    /// Roughness at every scale.
    Texture(RawTexture),
    /// Craters of impacts from space.
    PrimaryCraters(RawPrimaryCraters),
    /// Craters formed by the ejecta of other impacts.
    SecondaryCraters(RawSecondaryCraters),
    /// Rocks.
    Rocks(RawRocks),
    /// Albedo of the ground.
    Albedo(RawAlbedo),
    /// Dust over everything.
    Dust(RawDust),
}

impl RawProcess {
    /// Name in `kind = "..."`.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::BaseSlope(_) => "base_slope",
            Self::Texture(_) => "texture",
            Self::PrimaryCraters(_) => "primary_craters",
            Self::SecondaryCraters(_) => "secondary_craters",
            Self::Rocks(_) => "rocks",
            Self::Albedo(_) => "albedo",
            Self::Dust(_) => "dust",
        }
    }

    /// A short description.
    pub fn summary(&self) -> String {
        match self {
            Self::BaseSlope(_) => "regional slope".to_owned(),
            Self::Texture(p) => format!("roughness {} m at 1 m, Hurst exponent {}", p.roughness_m, p.hurst),
            Self::PrimaryCraters(p) => format!("crater diameters {} m to {} m", p.diameter_min_m, p.diameter_max_m),
            Self::SecondaryCraters(_) => "craters formed by ejecta of larger ones".to_owned(),
            Self::Rocks(p) => format!("rocks over {:.1} % of the ground", 100.0 * p.coverage),
            Self::Albedo(_) => "surface albedo".to_owned(),
            Self::Dust(p) => format!("dust layer {} m thick", p.thickness_m),
        }
    }

    /// Checks the process by itself, on a lattice with points `spacing_m` apart.
    fn check(&self, spacing_m: f64) -> Result<(), ParameterError> {
        match self {
            Self::BaseSlope(p) => p.check(),
            Self::Texture(p) => p.check(),
            Self::PrimaryCraters(p) => p.check(spacing_m),
            Self::SecondaryCraters(p) => p.check(spacing_m),
            Self::Rocks(p) => p.check(spacing_m),
            Self::Albedo(p) => p.check(),
            Self::Dust(p) => p.check(),
        }
    }
}

/// Checks a list of processes on a lattice with points `spacing_m` apart.
///
/// # Errors
/// The first value out of range, a repeated process that may occur only once, or secondaries without primaries.
pub fn check(processes: &[RawProcess], spacing_m: f64) -> Result<(), ParameterError> {
    for (n, process) in processes.iter().enumerate() {
        let here = |e: ParameterError| e.within(&n.to_string()).within("processes");
        process.check(spacing_m).map_err(here)?;
        let before = &processes[..n];
        let once = matches!(process, RawProcess::Rocks(_) | RawProcess::Albedo(_) | RawProcess::Dust(_));
        if once && before.iter().any(|p| p.kind() == process.kind()) {
            let message = format!("is `{}` a second time; it may occur only once in the list", process.kind());
            return Err(here(ParameterError::new("kind", message)));
        }
        if let RawProcess::SecondaryCraters(p) = process
            && p.per_primary > 0
            && !before.iter().any(|p| matches!(p, RawProcess::PrimaryCraters(_)))
        {
            let message = format!(
                "is {}, but no `primary_craters` precede it in the list; add them before it, or set it to 0",
                p.per_primary
            );
            return Err(here(ParameterError::new("per_primary", message)));
        }
    }
    Ok(())
}

/// The raster of the rock potential named in a list, if any.
pub fn potential(processes: &[RawProcess]) -> Option<NamedInput> {
    let of = |(n, process): (usize, &RawProcess)| match process {
        RawProcess::Rocks(RawRocks { potential: Some(name), .. }) => {
            Some(NamedInput::values(&format!("processes.{n}.potential"), name))
        }
        _ => None,
    };
    processes.iter().enumerate().find_map(of)
}

fn finite(key: &str, values: &[f64]) -> Result<(), ParameterError> {
    match values.iter().find(|v| !v.is_finite()) {
        Some(v) => Err(ParameterError::new(key, format!("contains {v}; all its numbers must be finite"))),
        None => Ok(()),
    }
}

/// Checks that a value lies in `low` to `high`, both included.
fn within(key: &str, value: f64, low: f64, high: f64) -> Result<(), ParameterError> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(ParameterError::new(key, format!("is {value}; it must lie in {low} to {high}")))
    }
}

/// Checks the smallest and largest crater diameter on a lattice with points `spacing_m` apart.
fn crater_diameters(both: [f64; 2], spacing_m: f64) -> Result<(), ParameterError> {
    diameters(both, [CRATER_SPACINGS_MIN * spacing_m, CRATER_SPACINGS_MAX * spacing_m])
}

/// Checks that two diameters are in order and lie in `least_m` to `most_m`.
fn diameters([low, high]: [f64; 2], [least_m, most_m]: [f64; 2]) -> Result<(), ParameterError> {
    ParameterError::positive("diameter_min_m", low)?;
    ParameterError::positive("diameter_max_m", high)?;
    if low < least_m {
        let message = format!("is {low} m; the lattice resolves diameters of at least {least_m} m");
        return Err(ParameterError::new("diameter_min_m", message));
    }
    if high > most_m {
        return Err(ParameterError::new("diameter_max_m", format!("is {high} m; it must be at most {most_m} m")));
    }
    if high < low {
        let message = format!("is {high} m; it must be at least `diameter_min_m`, {low} m");
        return Err(ParameterError::new("diameter_max_m", message));
    }
    Ok(())
}

/// Checks a power law of craters: diameters that the lattice resolves, and a density that can be computed in reasonable time.
fn check_power_law(law: &PowerLawParameters, spacing_m: f64) -> Result<(), ParameterError> {
    ParameterError::not_negative("density", law.density)?;
    within("exponent", law.exponent, EXPONENTS[0], EXPONENTS[1])?;
    crater_diameters(law.diameters_m, spacing_m)?;
    ParameterError::between("depth_ratio", law.style.depth_ratio, 0.0, 1.0)?;
    ParameterError::not_negative("floor_roughness", law.style.floor_roughness)?;
    let mean = law.mean_max(spacing_m);
    if mean <= CRATERS_PER_DIAMOND_MAX {
        return Ok(());
    }
    let message = format!(
        "gives {mean:.3e} craters of diameters D to 2 D per 32 D^2 of ground; the limit is {CRATERS_PER_DIAMOND_MAX}, 20 times \
         saturation"
    );
    Err(ParameterError::new("density", message))
}

impl RawBaseSlope {
    fn check(&self) -> Result<(), ParameterError> {
        finite("gradient", &self.gradient)?;
        finite("corner_heights_m", self.corner_heights_m.as_ref().map_or(&[], |c| &c[..]))
    }
}

impl RawTexture {
    fn check(&self) -> Result<(), ParameterError> {
        check_texture(self.roughness_m, self.hurst)
    }
}

/// Checks roughness and Hurst exponent of a texture.
///
/// # Errors
/// A value out of range.
pub fn check_texture(roughness_m: f64, hurst: f64) -> Result<(), ParameterError> {
    ParameterError::not_negative("roughness_m", roughness_m)?;
    if hurst > 0.0 && hurst <= 1.0 {
        Ok(())
    } else {
        Err(ParameterError::new("hurst", format!("is {hurst}; it must be above 0 and at most 1")))
    }
}

impl RawPrimaryCraters {
    /// Parameters of the kernel.
    pub fn power_law(&self) -> PowerLawParameters {
        PowerLawParameters {
            density: self.density,
            exponent: self.exponent,
            diameters_m: [self.diameter_min_m, self.diameter_max_m],
            style: style(self.depth_ratio, self.datum, self.floor_roughness),
        }
    }

    fn check(&self, spacing_m: f64) -> Result<(), ParameterError> {
        check_power_law(&self.power_law(), spacing_m)
    }
}

fn style(depth_ratio: f64, datum: Datum, floor_roughness: f64) -> Style {
    Style { depth_ratio, below_datum: datum == Datum::Surface, floor_roughness }
}

impl RawSecondaryCraters {
    /// The uniformly distributed secondaries.
    pub fn background(&self) -> PowerLawParameters {
        PowerLawParameters {
            density: self.density,
            exponent: self.exponent,
            diameters_m: [self.diameter_min_m, self.diameter_max_m],
            style: style(self.depth_ratio, self.datum, self.floor_roughness),
        }
    }

    /// The secondaries around primaries.
    pub fn around_primaries(&self) -> SecondaryParameters {
        SecondaryParameters {
            primary_min_m: self.primary_min_m,
            count: self.per_primary,
            largest_ratio: self.largest_ratio,
            smallest_share: self.smallest_share,
            exponent: self.exponent,
            ring_radii: self.ring_radii,
            style: style(self.depth_ratio, self.datum, self.floor_roughness),
        }
    }

    fn check(&self, spacing_m: f64) -> Result<(), ParameterError> {
        let least_m = CRATER_SPACINGS_MIN * spacing_m;
        check_power_law(&self.background(), spacing_m)?;
        ParameterError::positive("primary_min_m", self.primary_min_m)?;
        ParameterError::between("largest_ratio", self.largest_ratio, 0.0, 1.0)?;
        ParameterError::between("smallest_share", self.smallest_share, SMALLEST_SHARE_MIN, 1.0)?;
        within("per_primary", f64::from(self.per_primary), 0.0, f64::from(PER_PRIMARY_MAX))?;
        let [near, far] = self.ring_radii;
        if !(near >= 1.0 && far > near && far <= 100.0) {
            let message = format!("is [{near}, {far}]; it must rise from 1 or more to 100 or less");
            return Err(ParameterError::new("ring_radii", message));
        }
        let smallest_m = self.primary_min_m * self.largest_ratio * self.smallest_share;
        if self.per_primary > 0 && smallest_m < least_m {
            let message = format!(
                "is {} m, which gives secondaries of {smallest_m} m; the lattice resolves diameters of at least {least_m} m",
                self.primary_min_m
            );
            return Err(ParameterError::new("primary_min_m", message));
        }
        Ok(())
    }
}

impl RawRocks {
    /// Parameters of the kernel, for rocks buried to `buried_m`.
    pub fn parameters(&self, buried_m: f64) -> RockParameters {
        RockParameters {
            coverage: self.coverage,
            exact_union: self.law == RockLaw::ExactUnion,
            diameters_m: [self.diameter_min_m, self.diameter_max_m],
            height_ratio: self.height_ratio,
            height_gain: self.height_gain,
            height_offset_m: self.height_offset_m,
            crater_peak: self.crater_peak,
            crater_decay_radii: self.crater_decay_radii,
            crater_min_m: self.crater_min_m,
            buried_m,
        }
    }

    fn check(&self, spacing_m: f64) -> Result<(), ParameterError> {
        within("coverage", self.coverage, 0.0, COVERAGE_MAX)?;
        if self.potential.as_ref().is_some_and(String::is_empty) {
            return Err(ParameterError::new("potential", "is empty; it must name a raster"));
        }
        diameters([self.diameter_min_m, self.diameter_max_m], [spacing_m, ROCK_MAX_M])?;
        ParameterError::not_negative("height_ratio", self.height_ratio)?;
        finite("height_gain", &[self.height_gain])?;
        finite("height_offset_m", &[self.height_offset_m])?;
        within("crater_peak", self.crater_peak, 0.0, COVERAGE_MAX)?;
        ParameterError::positive("crater_decay_radii", self.crater_decay_radii)?;
        ParameterError::not_negative("crater_min_m", self.crater_min_m)?;
        Ok(())
    }
}

impl RawAlbedo {
    fn check(&self) -> Result<(), ParameterError> {
        within("sand", self.sand, 0.0, 1.0)?;
        within("sand_deviation", self.sand_deviation, 0.0, 1.0)?;
        within("rock", self.rock, 0.0, 1.0)?;
        within("rock_deviation", self.rock_deviation, 0.0, 1.0)
    }
}

impl RawDust {
    fn check(&self) -> Result<(), ParameterError> {
        ParameterError::not_negative("thickness_m", self.thickness_m)?;
        within("albedo", self.albedo, 0.0, 1.0)?;
        within("cover", self.cover, 0.0, 1.0)
    }
}
