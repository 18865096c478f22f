//! Stage `vehicle`: exports the vehicles that drive on exported terrains, as MJCF and URDF in `export/vehicle/` of the release.

use super::exports;
use crate::builder::Builder;
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::StudyError;
use sastrugi_mobility::vehicle::{TraverseSettings, Vehicle};
use sastrugi_schemas::mechanism::Mechanism;
use sastrugi_store::mechanism::{self, Format};
use serde_json::{Value, json};

/// Name of the stage.
pub const STAGE: &str = "vehicle";
/// Folder in the exports of the release.
const FOLDER: &str = "vehicle/";
/// Approximate size of the files, bytes.
const BYTES: f64 = 2e4;

struct VehicleJob {
    /// Id of the run.
    id: String,
    mechanism: Mechanism,
    /// Everything that determines the files.
    recipe: Value,
}

/// Adds the vehicle of a run, with the friction of the run's surface.
///
/// # Errors
/// When the item cannot be added to the graph, which is a bug.
pub fn add(
    builder: &mut Builder<'_>,
    run: &str,
    vehicle: &Vehicle,
    settings: &TraverseSettings,
) -> Result<(), StudyError> {
    let surface = &settings.parameters().surface;
    let recipe = json!({ "vehicle": vehicle.name(), "parameters": vehicle.parameters(), "surface": surface });
    let job = VehicleJob { id: run.to_owned(), mechanism: vehicle.mechanism(surface), recipe };
    let item = ItemRef::new(STAGE, run);
    builder.node(Node { item, parents: Vec::new(), inputs: Vec::new(), stream: None, job: Box::new(job) })
}

impl Job for VehicleJob {
    fn recipe(&self) -> Value {
        self.recipe.clone()
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility]
    }

    fn memory_bytes(&self) -> u64 {
        BYTES as u64
    }

    fn estimate(&self) -> Estimate {
        Estimate { seconds: 1e-3, bytes: BYTES }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let mut outcome = Outcome::default();
        for format in Format::ALL {
            let file = format!("vehicle.{}", format.ending());
            work.write(&file, mechanism::render(&self.mechanism, format).as_bytes())?;
            let place = format!("{}{FOLDER}{}.{}", exports::FOLDER, self.id, format.ending());
            outcome.products.push(Product::released(&file, place, None));
            let notes = mechanism::notes(&self.mechanism, format);
            outcome.notes.extend(notes.iter().map(|note| format!("{}: {note}", format.name())));
        }
        Ok(outcome)
    }
}
