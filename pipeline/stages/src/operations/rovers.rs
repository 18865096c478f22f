//! Ground for rovers, and words about their drives: the same for studies and verbs.

use crate::builder::Heightfield;
use crate::job::JobError;
use crate::operations::dem::input_error;
use sastrugi_mobility::rover::trial::Task;
use sastrugi_mobility::rover::{Drive, Ending, RoverParameters, Start};
use sastrugi_numeric::{Grid, GroundGrid, Streams};
use sastrugi_schemas::ParameterError;
use sastrugi_store::dem;
use sastrugi_terrain::planetary::{self, Clearing, GROUND_BYTES_PER_TILE, Planetary, RawPlanetary, WorldGround};
use std::path::Path;

/// Tiles of a world that are kept: 400 squares of 5 m at samples of 2 cm, 0.24 GB.
const TILES: usize = 400;
/// Maps of a terrain beside its heights.
const CLASS: &str = "class.tif";
const ALBEDO: &str = "albedo.tif";

/// Ground to drive on.
pub enum Grounds {
    /// A whole world, made around the rovers.
    World(Box<WorldGround>),
    /// The cells of a heightfield.
    Grid(GroundGrid),
}

impl Grounds {
    /// Whether rovers can be asked to drive there.
    ///
    /// # Errors
    /// A distance of samples that the world does not have.
    pub fn check(field: &Heightfield, parameters: &RoverParameters) -> Result<(), ParameterError> {
        match planetary(field)? {
            Some(world) => world.ground(&Streams::for_seed(0, STREAM), parameters.cell_m, &[], 1).map(|_| ()),
            None => Ok(()),
        }
    }

    /// The ground of a terrain; `heights` is its file, beside which its maps lie.
    ///
    /// # Errors
    /// Files that cannot be read.
    pub fn new(
        field: &Heightfield,
        heights: &Path,
        parameters: &RoverParameters,
        starts: &[Start],
    ) -> Result<Self, JobError> {
        if let (Some(world), Some(streams)) = (planetary(field).map_err(JobError::new)?, &field.streams) {
            let clearing = |centre_m: [f64; 2]| Clearing { centre_m, radius_m: parameters.clear_m };
            let places = starts.iter().map(|s| s.start_m).chain(starts.iter().map(|s| s.goal_m));
            let mut clearings: Vec<Clearing> = places.map(clearing).collect();
            // Rovers of a circle have one goal.
            clearings.dedup();
            let ground = world.ground(streams, parameters.cell_m, &clearings, TILES).map_err(JobError::new)?;
            return Ok(Self::World(Box::new(ground)));
        }
        let heights_m = dem::read(heights).map_err(input_error)?.grid.to_f32();
        let map = |name: &str| -> Result<Option<Grid>, JobError> {
            let path = heights.with_file_name(name);
            path.is_file().then(|| dem::read(&path).map(|read| read.grid).map_err(input_error)).transpose()
        };
        let class = map(CLASS)?.map(|grid| grid.values.iter().map(|code| u8::from(*code >= 0.5)).collect());
        let albedo = map(ALBEDO)?.map(|grid| grid.to_f32().values);
        Ok(Self::Grid(GroundGrid { heights: heights_m, class, albedo }))
    }

    /// Peak memory, bytes.
    pub fn memory_bytes(field: &Heightfield) -> u64 {
        if field.kind == planetary::KIND { TILES as u64 * GROUND_BYTES_PER_TILE } else { 40 * field.cells }
    }
}

/// Any word: whether a world has samples at a distance does not depend on its draws.
const STREAM: &str = "terrain";

/// The world of a planetary terrain.
fn planetary(field: &Heightfield) -> Result<Option<Planetary>, ParameterError> {
    if field.kind != planetary::KIND {
        return Ok(None);
    }
    let raw: RawPlanetary = sastrugi_schemas::kind::read_parameters(&field.parameters)?;
    Planetary::try_from(raw).map(Some)
}

/// Why a rover went no farther, in words.
pub fn note(drive: &Drive, task: &Task) -> Option<String> {
    let Drive { residual_m, .. } = drive;
    match drive.ending {
        Ending::Reached => None,
        Ending::Lost => Some(format!("believed to be at the goal, which was {residual_m:.2} m away")),
        Ending::NoWay => Some("knew of no way to the goal".to_owned()),
        Ending::DistanceLimit => {
            Some(format!("drove {} m, the limit, and was {residual_m:.2} m from the goal", task.distance_limit_m))
        }
        Ending::CycleLimit => {
            Some(format!("took {} cycles, the limit, and was {residual_m:.2} m from the goal", task.cycle_limit))
        }
        Ending::OffGround(nowhere) => Some(nowhere.to_string()),
    }
}
