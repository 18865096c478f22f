//! Folders of a terrain to import into simulators: `export/<id>/<simulator>/` of the release.

use super::{JobError, Outcome, Product, Work};
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::study::Simulator;
use sastrugi_store::atomic;
use sastrugi_store::dem::simulators::{self, BYTES_PER_CELL, Fit};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Folder in the release.
pub const FOLDER: &str = "export/";
/// Bytes of an export for each cell, for `plan`.
const RELEASED_BYTES_PER_CELL: f64 = 20.0;

/// The simulators that a terrain is exported for.
#[derive(Clone, Debug, Default)]
pub struct Exports(BTreeSet<Simulator>);

impl Exports {
    /// For terrains of this size.
    ///
    /// # Errors
    /// Why a simulator takes none of this size.
    pub fn new(simulators: &BTreeSet<Simulator>, geometry: &Geometry) -> Result<Self, String> {
        let check = |simulator: &Simulator| simulators::check_size(geometry, *simulator, Fit::Resample);
        simulators.iter().try_for_each(check).map_err(|e| e.to_string())?;
        Ok(Self(simulators.clone()))
    }

    /// Adds them to what says how the heights are packed.
    pub fn packing(&self, heights: Value) -> Value {
        if self.0.is_empty() { heights } else { json!({ "heights": heights, "exports": self.0 }) }
    }

    /// Working memory, bytes.
    pub fn memory_bytes(&self, cells: u64) -> u64 {
        if self.0.is_empty() { 0 } else { BYTES_PER_CELL * cells }
    }

    /// Bytes of their files.
    pub fn bytes(&self, cells: f64) -> f64 {
        RELEASED_BYTES_PER_CELL * cells * self.0.len() as f64
    }

    /// Writes the folders of the terrain `id`, of its heights as they are released.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, work: &Work<'_>, id: &str, heights: &Grid, outcome: &mut Outcome) -> Result<(), JobError> {
        for &simulator in &self.0 {
            let name = simulator.name();
            let export = simulators::export(&heights.as_stored(), simulator, Fit::Resample).map_err(JobError::new)?;
            for (file, bytes) in &export.files {
                let own = format!("{name}.{file}");
                atomic::write(&work.output(&own), bytes).map_err(JobError::new)?;
                outcome.products.push(Product::released(&own, format!("{FOLDER}{id}/{name}/{file}"), None));
            }
            outcome.notes.extend(export.notes.iter().map(|note| format!("{name}: {note}")));
        }
        Ok(())
    }
}
