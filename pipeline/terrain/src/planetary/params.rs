//! Parameters of the planetary surface.

use super::assemble;
use super::levels::{Window, spacing};
use super::processes::{self, RawAlbedo, RawPrimaryCraters, RawProcess, RawRocks, RawTexture};
use super::rocks::potential::Potential;
use super::world::World;
use super::{tiles, widest_tile};
use crate::generator::{Input, TerrainError};
use crate::size::{MIN_SIDE_PX, Size};
use sastrugi_numeric::Streams;
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Coarsest basic spacing chosen by default, m.
const SPACING_MAX_M: f64 = 0.0125;
/// Samples of a patch if no size is given.
const DEFAULT_SIZE_PX: [u32; 2] = [512, 512];
/// Largest K.
const ANCHOR_LEVEL_MAX: u32 = 40;
/// Largest lattice coordinate, so that coordinates are exact integers in double precision.
pub(super) const LATTICE_MAX: f64 = (1u64 << 52) as f64;
/// A quotient this close to a whole number counts as that number.
pub const WHOLE_TOLERANCE: f64 = 1e-6;
/// Maximum number of doublings from the default basic spacing to the sample spacing.
const ZOOM_MAX: u32 = 61;
/// Maximum number of craters and rocks that a surface may have to examine; counted once for each tile that does.
const OBJECTS_MAX: f64 = (1u64 << 28) as f64;

/// Planetary surface.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPlanetary {
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Samples east and north; 512 x 512 if no size is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Distance between samples, m: the basic spacing times a power of 2 (the paper's rovers: 0.02).
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// Distance between lattice points, m (the paper: a few millimetres to 0.01). Part of the world: another spacing gives another world.
    /// By default `cell_m` divided by the smallest power of 2 that gives at most 0.0125 m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub basic_spacing_m: Option<f64>,
    /// K: the coarsest points of the texture are 2^K basic spacings apart; at most 40 (our choice: 20).
    #[schemars(range(max = ANCHOR_LEVEL_MAX))]
    pub anchor_level: u32,
    /// Position of the south-west sample in the world, m; whole multiples of the cell.
    pub origin_m: [f64; 2],
    /// The processes that shape the surface, in order: tables with a `kind` of `base_slope`, `texture`, `primary_craters`,
    /// `secondary_craters`, `rocks`, `albedo`, `dust`.
    pub processes: Vec<RawProcess>,
}

impl Default for RawPlanetary {
    fn default() -> Self {
        let processes = vec![
            RawProcess::Texture(RawTexture::default()),
            RawProcess::Rocks(RawRocks::default()),
            RawProcess::PrimaryCraters(RawPrimaryCraters::default()),
            RawProcess::Albedo(RawAlbedo::default()),
        ];
        Self {
            size_m: None,
            size_px: None,
            cell_m: 0.02,
            basic_spacing_m: None,
            anchor_level: 20,
            origin_m: [0.0; 2],
            processes,
        }
    }
}

/// Checked parameters of a planetary surface.
#[derive(Clone, Debug)]
pub struct Planetary {
    pub(super) raw: RawPlanetary,
    pub(super) size: Size,
    pub(super) spacing_m: f64,
    pub(super) window: Window,
    pub(super) work: Work,
    /// The raster of the rock potential, once it has been read.
    potential: Option<Potential>,
}

impl TryFrom<RawPlanetary> for Planetary {
    type Error = ParameterError;

    fn try_from(raw: RawPlanetary) -> Result<Self, ParameterError> {
        let Lattice { spacing_m, zoom, cell_m } = Lattice::check(raw.basic_spacing_m, raw.cell_m)?;
        let size = Size::check(raw.size_m, raw.size_px, cell_m, DEFAULT_SIZE_PX)?;
        if raw.anchor_level > ANCHOR_LEVEL_MAX {
            let message = format!("is {}; it must be at most {ANCHOR_LEVEL_MAX}", raw.anchor_level);
            return Err(ParameterError::new("anchor_level", message));
        }
        processes::check(&raw.processes, spacing_m)?;
        let [west, south] = raw.origin_m.map(|at| column(at, cell_m));
        let window = Window { zoom, west: west?, south: south?, cols: size.cols(), rows: size.rows(), centred: false };
        let work = window_in_reach(&raw.processes, spacing_m, &window)?;
        let origin_m = [window.west, window.south].map(|column| column as f64 * cell_m);
        let (size_px, basic_spacing_m) = (Some(size.px), Some(spacing_m));
        let raw = RawPlanetary { size_m: None, size_px, cell_m, basic_spacing_m, origin_m, ..raw };
        Ok(Self { raw, size, spacing_m, window, work, potential: None })
    }
}

impl Planetary {
    /// The same with the inputs that its parameters name (in the order of [`crate::Generator::inputs`]).
    ///
    /// # Errors
    /// An input that is missing or cannot be used.
    pub fn with_inputs(&self, inputs: &[Input]) -> Result<Self, TerrainError> {
        let Some(named) = processes::potential(&self.raw.processes) else { return Ok(self.clone()) };
        let Some(Input::Grid(raster)) = inputs.first() else { return Err(named.error("is missing")) };
        let potential = Potential::new(raster, self.spacing_m, [0.0; 2]).map_err(|reason| named.error(reason))?;
        Ok(Self { potential: Some(potential), ..self.clone() })
    }

    /// Checks that it has all inputs that its parameters name.
    ///
    /// # Errors
    /// The key of a missing input.
    pub(super) fn check_inputs(&self) -> Result<(), ParameterError> {
        match processes::potential(&self.raw.processes) {
            Some(named) if self.potential.is_none() => Err(ParameterError::new(named.key, "has not been read")),
            _ => Ok(()),
        }
    }

    /// Checks that its world has samples `cell_m` apart.
    ///
    /// # Errors
    /// A distance that is not the basic spacing times a power of 2.
    pub fn check_samples(&self, cell_m: f64) -> Result<(), ParameterError> {
        Lattice::check(Some(self.spacing_m), cell_m).map(|_| ())
    }

    /// The parameters, with defaults filled in.
    pub fn raw(&self) -> &RawPlanetary {
        &self.raw
    }

    /// Distance between lattice points, m.
    pub fn spacing_m(&self) -> f64 {
        self.spacing_m
    }

    /// The world in which only the processes act whose index in the list (from 0) `acts` selects; their numbers and draws do not change.
    ///
    /// # Errors
    /// An input that has not been read ([`Self::with_inputs`]).
    pub fn world_of(&self, streams: &Streams, acts: impl Fn(usize) -> bool) -> Result<World, ParameterError> {
        self.check_inputs()?;
        let assembly = assemble::Assembly::new(self.spacing_m, self.raw.anchor_level);
        Ok(assembly.with(&self.raw.processes, streams, self.potential.clone(), acts))
    }

    /// The world that the patch is part of.
    pub(crate) fn world(&self, streams: &Streams) -> World {
        let potential = self.potential.clone();
        assemble::world(&self.raw.processes, self.spacing_m, self.raw.anchor_level, streams, potential)
    }
}

/// Spacings of the lattice and of the samples on it.
pub struct Lattice {
    /// Basic spacing, m.
    pub spacing_m: f64,
    /// Number of doublings from the basic spacing to the sample spacing.
    pub zoom: u32,
    /// Distance between samples, m: exactly `spacing_m 2^zoom`.
    pub cell_m: f64,
}

impl Lattice {
    /// The lattice with a given basic spacing, or with the default one for the distance between samples.
    ///
    /// # Errors
    /// A distance that is not the basic spacing times a power of 2.
    pub fn check(basic_spacing_m: Option<f64>, cell_m: f64) -> Result<Self, ParameterError> {
        ParameterError::positive("cell_m", cell_m)?;
        let Some(spacing_m) = basic_spacing_m else {
            let zoom = (0..ZOOM_MAX).find(|k| cell_m / spacing(*k) <= SPACING_MAX_M).unwrap_or(ZOOM_MAX);
            return Ok(Self { spacing_m: cell_m / spacing(zoom), zoom, cell_m });
        };
        ParameterError::positive("basic_spacing_m", spacing_m)?;
        let ratio = cell_m / spacing_m;
        match (0..40).find(|k| (ratio / spacing(*k) - 1.0).abs() < WHOLE_TOLERANCE) {
            Some(zoom) => Ok(Self { spacing_m, zoom, cell_m: spacing_m * spacing(zoom) }),
            None => {
                let message =
                    format!("is {cell_m} m, {ratio} times the basic spacing; it must be 1, 2, 4, 8 ... times");
                Err(ParameterError::new("cell_m", message))
            }
        }
    }
}

/// The column or row of samples at a coordinate.
fn column(at_m: f64, cell_m: f64) -> Result<i64, ParameterError> {
    let quotient = at_m / cell_m;
    if !quotient.is_finite() || quotient.abs() > LATTICE_MAX {
        return Err(ParameterError::new(
            "origin_m",
            format!("contains {at_m} m; the world ends at 2^52 basic spacings"),
        ));
    }
    // The quotient is only as exact as its own last digits.
    if (quotient - quotient.round()).abs() > WHOLE_TOLERANCE + 4.0 * f64::EPSILON * quotient.abs() {
        let nearest_m = quotient.round() * cell_m;
        let message =
            format!("contains {at_m} m, not a whole multiple of the {cell_m} m cell; the nearest is {nearest_m} m");
        return Err(ParameterError::new("origin_m", message));
    }
    Ok(quotient.round() as i64)
}

/// Expected work for the craters and rocks of a window.
#[derive(Clone, Copy, Debug)]
pub struct Work {
    /// Craters and rocks that one tile is expected to hold in memory.
    pub tile_objects: f64,
    /// Craters and rocks to examine, and places to check for them, in all tiles.
    pub visits: f64,
    /// Expected number of craters in all tiles.
    pub craters: f64,
    /// Rocks placed in all tiles: those wider than the sample spacing, and those narrower.
    pub rocks_set: [f64; 2],
    /// Samples under rocks per sample of the window, counted once per rock where rocks overlap.
    pub under_rocks: f64,
    /// Whether the ground has a texture.
    pub is_textured: bool,
}

/// Expected work of a window in a world with these processes.
///
/// # Errors
/// A window beyond the end of the world, or too many craters and rocks to examine.
pub fn window_in_reach(processes: &[RawProcess], spacing_m: f64, window: &Window) -> Result<Work, ParameterError> {
    let ends = [(window.west, window.cols), (window.south, window.rows)];
    let far = |(first, count): (i64, usize)| (first.unsigned_abs() as f64 + count as f64) * spacing(window.zoom);
    if ends.into_iter().any(|end| far(end) > LATTICE_MAX) {
        let message = "puts the window beyond the end of the world, 2^52 basic spacings from its origin";
        return Err(ParameterError::new("origin_m", message));
    }
    // The expected numbers do not depend on the seed.
    let world = assemble::world(processes, spacing_m, 0, &Streams::for_seed(0, "terrain"), None);
    let tile = widest_tile(window);
    let visits = world.expected_visits(&tile, 0.0) * tiles(window) as f64;
    if visits <= OBJECTS_MAX {
        let is_textured = processes.iter().any(|process| matches!(process, RawProcess::Texture(_)));
        let of_all = |of_tile: f64| of_tile * tiles(window) as f64;
        return Ok(Work {
            tile_objects: world.expected_objects(&tile),
            visits,
            craters: of_all(world.expected_craters(&tile)),
            rocks_set: world.expected_rocks(&tile).map(of_all),
            under_rocks: world.rock_layers(),
            is_textured,
        });
    }
    let message = format!(
        "give {visits:.1e} craters and rocks to examine for this surface, above the limit of {OBJECTS_MAX:.1e}; raise their \
         smallest diameters, or choose fewer cells"
    );
    Err(ParameterError::new("processes", message))
}
