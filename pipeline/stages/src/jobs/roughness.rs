//! Stage `roughness`: describes and classifies every heightfield of a study.

use super::surface::{Surface, SurfaceRows};
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work, joined, parsed};
use crate::operations::dem::input_error;
use crate::operations::roughness::settings;
use crate::revision::Room;
use crate::runner::graph::Node;
use sastrugi_numeric::Grid;
use sastrugi_roughness::{Summary, classify, close_disk, describe_classified, moore_gradient};
use sastrugi_schemas::study::RoughnessSection;
use sastrugi_schemas::tables::TerrainRow;
use sastrugi_store::{dem, digest};
use serde_json::{Value, json};
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "roughness";
/// Class map, closed.
pub const CLASSES: &str = "classes.tif";
/// Class map before closing.
pub const CLASSES_RAW: &str = "classes.raw.tif";

/// Approximate time per cell, s: gradients, pair sums, spectra, and writing the class maps. Measured on grids from 256 x 256 to
/// 1126 x 1126 cells.
const SECONDS_PER_CELL: f64 = 4.5e-7;

/// Adds one item for every heightfield of the study, which describes and classifies it.
///
/// # Errors
/// Only from adding items to the graph; no study causes one.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    // Shared by all items, to keep the memory of each small.
    let section = Arc::new(builder.study.roughness.clone());
    let mut nodes = Vec::new();
    let mut last: Option<(&Heightfield, Arc<str>)> = None;
    for (id, field) in &builder.heightfields {
        let shared = match &last {
            Some((before, shared)) if are_alike(before, field) => Arc::clone(shared),
            _ => shared_recipe(&section, field).into(),
        };
        last = Some((field, Arc::clone(&shared)));
        let job = RoughnessJob { id: id.clone(), field: field.clone(), section: Arc::clone(&section), shared };
        let parents = vec![field.item.clone()];
        nodes.push(Node { item: item(id), parents, inputs: Vec::new(), stream: None, job: Box::new(job) });
    }
    Ok(nodes.into_iter().try_for_each(|node| builder.node(node))?)
}

/// True if two heightfields have the same shared part of the recipe; replicates do, and follow each other.
fn are_alike(a: &Heightfield, b: &Heightfield) -> bool {
    Arc::ptr_eq(&a.parameters, &b.parameters) && (&a.group, &a.variant, &a.kind) == (&b.group, &b.variant, &b.kind)
}

/// What the replicates of a heightfield share of their recipes, as JSON.
fn shared_recipe(section: &RoughnessSection, field: &Heightfield) -> String {
    let shared = json!({
        "section": section,
        "group": field.group,
        "variant": field.variant,
        "kind": field.kind,
        "params": *field.parameters,
    });
    shared.to_string()
}

/// Describes one heightfield.
struct RoughnessJob {
    id: String,
    field: Heightfield,
    section: Arc<RoughnessSection>,
    /// What it shares of its recipe.
    shared: Arc<str>,
}

impl RoughnessJob {
    fn terrain_row(&self, grid: &Grid, summary: &Summary) -> TerrainRow {
        let heights = &summary.heights;
        TerrainRow {
            terrain_id: self.id.clone(),
            group: self.field.group.clone(),
            variant: self.field.variant.clone(),
            // Filled in when the release is assembled: changing the split must not recompute anything.
            split: None,
            stage: self.field.item.stage.clone(),
            kind: self.field.kind.clone(),
            params: self.field.parameters.to_string(),
            rows: grid.rows() as i64,
            cols: grid.cols() as i64,
            cell_x_m: grid.geometry.cell[0],
            cell_y_m: grid.geometry.cell[1],
            valid_share: summary.valid_share,
            height_min_m: heights.min_m,
            height_max_m: heights.max_m,
            relief_m: heights.relief_m,
            rms_height_m: heights.rms_m,
            skewness: heights.skewness,
            kurtosis: heights.kurtosis,
            rms_slope: summary.rms_slope,
            band_rms_m: summary.band_rms_m,
            band_window_m: summary.band_window_m,
            share_low: summary.shares.low,
            share_semi: summary.shares.semi,
            share_high: summary.shares.high,
            share_border_m: summary.share_border_m,
            psd_slope: summary.psd_slope,
            stream: self.field.stream(),
            path: self.field.release_path.clone(),
        }
    }
}

impl Job for RoughnessJob {
    fn recipe(&self) -> Value {
        parsed(&self.recipe_text())
    }

    fn recipe_text(&self) -> String {
        joined(&[&self.shared, &json!({ "path": self.field.release_path }).to_string()])
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Roughness]
    }

    fn memory_bytes(&self) -> u64 {
        // Heights, and the padded transforms of pair sums: 81 bytes per cell, measured at 4096 x 4096 cells with holes.
        (64 << 20) + 88 * self.field.cells
    }

    fn estimate(&self) -> Estimate {
        let cells = self.field.cells as f64;
        Estimate { seconds: 0.02 + SECONDS_PER_CELL * cells, bytes: 1e5 + 0.3 * cells }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let read = dem::read(&work.parent(&self.field.item, HEIGHTS)?).map_err(input_error)?;
        let settings = settings(&self.section)?;
        let raw = classify(&moore_gradient(&read.grid), &settings.thresholds);
        let summary = describe_classified(&read.grid, &raw, &settings);
        let closed = close_disk(&raw, self.section.closing_radius_m);
        dem::write_classes(&work.output(CLASSES), &closed, &read.info.crs).map_err(JobError::io)?;
        dem::write_classes(&work.output(CLASSES_RAW), &raw, &read.info.crs).map_err(JobError::io)?;
        let id = &self.id;
        let products = vec![
            Product::released(CLASSES, format!("classes/{id}.tif"), Some(digest::classes(&closed))),
            Product::released(CLASSES_RAW, format!("classes/{id}.raw.tif"), Some(digest::classes(&raw))),
        ];
        let mut outcome = Outcome { products, notes: Vec::new() };
        outcome.write_rows(work, [self.terrain_row(&read.grid, &summary)])?;
        let surface = Surface { id, stage: &self.field.item.stage, fit_id: None, grid: &read.grid };
        SurfaceRows::of(&surface, &summary.spectrum, &summary.histogram, &summary.areal).write(work, &mut outcome)?;
        Ok(outcome)
    }
}

/// The item that describes a heightfield.
pub fn item(id: &str) -> ItemRef {
    ItemRef::new(STAGE, id)
}
