//! Folders of a terrain to import into simulators: `export/<id>/<simulator>/` of the release.

use crate::job::{JobError, Outcome, Product, Work};
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::study::Simulator;
use sastrugi_store::dem::DemError;
use sastrugi_store::dem::simulators::{self, Cost, Fit};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Folder in the release.
pub const FOLDER: &str = "export/";
/// Bytes of a height as it is released, which is what is exported.
const BYTES_PER_CELL: u64 = 8;

/// The simulators that a terrain is exported for, and what each export takes.
#[derive(Clone, Debug, Default)]
pub struct Exports(BTreeMap<Simulator, Cost>);

impl Exports {
    /// For terrains of this size.
    ///
    /// # Errors
    /// Why a simulator takes none of this size.
    pub fn new(simulators: &BTreeSet<Simulator>, geometry: &Geometry) -> Result<Self, String> {
        let cost = |&simulator| Ok((simulator, simulators::check_size(geometry, simulator, Fit::Resample)?));
        let costs: Result<_, DemError> = simulators.iter().map(cost).collect();
        costs.map(Self).map_err(|e| e.to_string())
    }

    /// Adds them to what says how the heights are packed.
    pub fn packing(&self, heights: Value) -> Value {
        if self.0.is_empty() { heights } else { json!({ "heights": heights, "exports": self.simulators() }) }
    }

    fn simulators(&self) -> Vec<Simulator> {
        self.0.keys().copied().collect()
    }

    /// Working memory, bytes: one export is made after the other.
    pub fn memory_bytes(&self, cells: u64) -> u64 {
        let largest = self.0.values().map(|cost| cost.memory_bytes).max();
        largest.map_or(0, |bytes| bytes + BYTES_PER_CELL * cells)
    }

    /// Bytes of their files.
    pub fn bytes(&self) -> f64 {
        self.0.values().map(|cost| cost.file_bytes as f64).sum()
    }

    /// Writes the folders of the terrain `id`, of its heights as they are released.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, work: &Work<'_>, id: &str, heights: &Grid, outcome: &mut Outcome) -> Result<(), JobError> {
        if self.0.is_empty() {
            return Ok(());
        }
        let heights = heights.as_stored();
        for simulator in self.simulators() {
            let name = simulator.name();
            let export = simulators::export(&heights, simulator, Fit::Resample, None).map_err(JobError::new)?;
            for (file, bytes) in &export.files {
                let own = format!("{name}.{file}");
                work.write(&own, bytes)?;
                outcome.products.push(Product::released(&own, format!("{FOLDER}{id}/{name}/{file}"), None));
            }
            outcome.notes.extend(export.notes.iter().map(|note| format!("{name}: {note}")));
        }
        Ok(())
    }
}
