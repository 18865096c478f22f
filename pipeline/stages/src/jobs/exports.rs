//! Exports of a terrain for simulators, in `export/<id>/<simulator>/` of the release.

use crate::job::{JobError, Outcome, Product, Work};
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::study::Simulator;
use sastrugi_store::dem::simulators::{self, Cost, Fit};
use sastrugi_store::dem::{DemError, MeshLimits};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Folder in the release.
pub const FOLDER: &str = "export/";
/// Size of a released height, bytes; exports use the released heights.
const BYTES_PER_CELL: u64 = 8;

/// Ratio of the working memory of an export with a decimated mesh to that of one without decimation.
const DECIMATING: u64 = 4;

/// The simulators that a terrain is exported for, and the cost of each export.
#[derive(Clone, Debug, Default)]
pub struct Exports {
    costs: BTreeMap<Simulator, Cost>,
    /// Limits of their meshes.
    limits: Option<MeshLimits>,
}

impl Exports {
    /// Exports of terrains of this size.
    ///
    /// # Errors
    /// The reason why a simulator cannot import a terrain of this size.
    pub fn new(simulators: &BTreeSet<Simulator>, geometry: &Geometry) -> Result<Self, String> {
        let cost = |&simulator| Ok((simulator, simulators::check_size(geometry, simulator, Fit::Resample)?));
        let costs: Result<_, DemError> = simulators.iter().map(cost).collect();
        costs.map(|costs| Self { costs, limits: None }).map_err(|e| e.to_string())
    }

    /// The same exports with meshes decimated to within `error_max_m` of every post, if given.
    pub fn decimated(self, error_max_m: Option<f64>) -> Self {
        let limits = error_max_m.map(|_| MeshLimits { error_max_m, triangles_max: None });
        Self { limits, ..self }
    }

    /// True if no simulator was chosen.
    pub fn is_empty(&self) -> bool {
        self.costs.is_empty()
    }

    /// Adds the exports to the packing of the heights.
    pub fn packing(&self, heights: Value) -> Value {
        if self.is_empty() {
            return heights;
        }
        let mut packing = json!({ "heights": heights, "exports": self.simulators() });
        if let Some(limits) = &self.limits {
            packing["export_max_error_m"] = json!(limits.error_max_m);
        }
        packing
    }

    fn simulators(&self) -> Vec<Simulator> {
        self.costs.keys().copied().collect()
    }

    /// Working memory, bytes. Exports are written one after the other.
    pub fn memory_bytes(&self, cells: u64) -> u64 {
        let factor = |simulator| {
            if self.limits.is_some() && simulators::has_mesh(simulator) { DECIMATING } else { 1 }
        };
        let largest = self.costs.iter().map(|(simulator, cost)| factor(*simulator) * cost.memory_bytes).max();
        largest.map_or(0, |bytes| bytes + BYTES_PER_CELL * cells)
    }

    /// Total size of the files, bytes.
    pub fn bytes(&self) -> f64 {
        self.costs.values().map(|cost| cost.file_bytes as f64).sum()
    }

    /// Writes the exports of the terrain `id` from its released heights.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, work: &Work<'_>, id: &str, heights: &Grid, outcome: &mut Outcome) -> Result<(), JobError> {
        if self.is_empty() {
            return Ok(());
        }
        let heights = heights.as_stored();
        for simulator in self.simulators() {
            let name = simulator.name();
            let export = simulators::export(&heights, simulator, Fit::Resample, self.limits.as_ref());
            let export = export.map_err(JobError::new)?;
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
