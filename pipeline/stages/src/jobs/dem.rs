//! Stage `dem`: crops a measured DEM to its window and converts it to metres.

use super::original::{self, Original};
use super::rasters::{raster_options, raster_packing};
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield, InputPlace};
use crate::documents::terms::{self, Objection};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::operations::dem::{expected, input_error, to_metres, window_of};
use crate::operations::place::{PLACE, Place};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::Entry;
use sastrugi_schemas::study::{DemItem, GeoTiff};
use sastrugi_store::dem::points::GridSettings;
use sastrugi_store::dem::{self, Claimed, Dem, ReadOptions};
use sastrugi_store::digest;
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "dem";
struct DemJob {
    item: DemItem,
    original: ItemRef,
    /// Path of the original in the release.
    release_path: String,
    bytes: u64,
    claimed: Claimed,
    geotiff: GeoTiff,
}

/// Adds the items of `[[dem]]`.
///
/// # Errors
/// An invalid item, or a missing file.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    builder.each(STAGE, add_table)
}

fn add_table(builder: &mut Builder<'_>, entry: &Entry<'_>) -> Result<(), BuildError> {
    let (item, params): (DemItem, Value) = entry.read()?;
    entry.check_keys::<DemItem>(&params, &json!({}))?;
    builder.claim(entry, STAGE, &item.id)?;
    check(&item).map_err(|(key, message)| entry.error(key, format!("`{key}` {message}")))?;
    if let Some(Objection::Conflict(why)) = terms::objection(&item, &builder.study.head.license) {
        return Err(entry.error("license", format!("`license` {why}")).into());
    }
    builder.doubts.extend(terms::doubt(&item, &builder.study.head.license));
    let id = item.id.clone();
    let mut original = Original::of(&format!("dem/{id}"), &builder.study.folder, &item.file)?;
    if let Some(text) = &item.license_file {
        let release_path = format!("dem/{id}.license.txt");
        original.add(builder.study.folder.join(text), release_path.clone())?;
        builder.inputs.push(InputPlace { key: entry.path_of("license_file"), release_path });
    }
    let claimed = dem::claimed(&builder.study.folder.join(&item.file), &ReadOptions { cell_m: item.cell_m });
    // Other formats take at least one byte per cell.
    let claimed = claimed.unwrap_or_else(|| Claimed::size(original.bytes(), 0, None));
    let expected = expected(&claimed, item.window).map_err(|message| entry.error("window", message))?;
    let key = entry.path_of("file");
    builder.inputs.push(InputPlace { key, release_path: original.release_path().to_owned() });
    let field = Heightfield {
        item: ItemRef::new(STAGE, &id),
        group: Some(item.group.clone().unwrap_or_else(|| id.clone())),
        is_grouped: item.group.is_some(),
        variant: None,
        replicate: None,
        kind: original::extension(&item.file),
        parameters: Arc::new(recipe(&item)),
        streams: None,
        release_path: format!("dem/{id}.metric.tif"),
        cells: expected.map_or(claimed.cells, |geometry| geometry.len() as u64),
        raster_cells: Some(claimed.cells),
        cell_m: expected.map_or(claimed.cell_m, |geometry| Some(geometry.cell[0].min(geometry.cell[1]))),
        geometry: None,
        expected,
    };
    let (bytes, release_path, inputs) = (original.bytes(), original.release_path().to_owned(), original.inputs());
    let original = original.node(original::STAGE, &id);
    let geotiff = builder.study.head.geotiff;
    let job = DemJob { item, original: original.item.clone(), release_path, bytes, claimed, geotiff };
    let parents = vec![original.item.clone()];
    let node = Node { item: field.item.clone(), parents, inputs, stream: None, job: Box::new(job) };
    builder.node(original)?;
    builder.node(node)?;
    builder.heightfields.insert(id.clone(), field);
    builder.name_family(entry, &id, vec![id.clone()])?;
    Ok(())
}

fn check(item: &DemItem) -> Result<(), (&'static str, String)> {
    if let Some([x0, y0, x1, y1]) = item.window
        && !(x0 < x1 && y0 < y1)
    {
        return Err((
            "window",
            format!("is [{x0}, {y0}, {x1}, {y1}]; it must be [x0, y0, x1, y1] with x0 < x1 and y0 < y1"),
        ));
    }
    gridding(item).map_err(|message| ("statistic", message))?;
    for (key, text) in [("license", &item.license), ("attribution", &item.attribution), ("citation", &item.citation)] {
        if text.as_ref().is_some_and(|text| text.trim().is_empty()) {
            return Err((key, "is empty; omit it if it is unknown".to_owned()));
        }
    }
    match item.cell_m {
        Some(cell) if !cell.iter().all(|c| c.is_finite() && *c > 0.0) => {
            Err(("cell_m", format!("is {cell:?}; both sizes must be above 0")))
        }
        _ => Ok(()),
    }
}

/// Settings for gridding a point cloud.
fn gridding(item: &DemItem) -> Result<GridSettings, String> {
    let statistic = item.statistic.as_deref().map(str::parse).transpose()?.unwrap_or_default();
    let (fill_cells, ground_only) = (item.fill_cells.unwrap_or(0), item.ground_only.unwrap_or(false));
    Ok(GridSettings { statistic, fill_cells, ground_only, ..GridSettings::default() })
}

/// Everything that determines the result except the original, whose item is a parent. Licence, attribution and citation do not
/// affect it: they are added when the release is assembled.
fn recipe(item: &DemItem) -> Value {
    json!({
        "window": item.window,
        "cell_m": item.cell_m,
        "statistic": item.statistic,
        "fill_cells": item.fill_cells,
        "ground_only": item.ground_only,
    })
}

impl Job for DemJob {
    fn recipe(&self) -> Value {
        recipe(&self.item)
    }

    fn packing(&self) -> Value {
        raster_packing(self.geotiff)
    }

    fn rooms(&self) -> &'static [Room] {
        &[]
    }

    fn memory_bytes(&self) -> u64 {
        // Cropping and converting hold the heights twice, in addition to the file or its tiles. Gridding a point cloud takes
        // 40 bytes per cell, 8 bytes per point for a median, and 64 MiB for the cell-size search.
        let Claimed { cells, points, .. } = self.claimed;
        (128 << 20) + 2 * self.bytes + 40 * cells + 8 * points
    }

    fn estimate(&self) -> Estimate {
        Estimate { seconds: 0.05 + self.bytes as f64 / 50e6, bytes: 2.0 * self.bytes as f64 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let copy = work.parent(&self.original, original::name(&self.release_path))?;
        // Messages are part of the release, so they use the file's path in the release instead of its present one.
        let with_release_path =
            |e: JobError| e.reworded(|words| words.replace(&copy.display().to_string(), &self.release_path));
        let Imported { metric, place, notes } =
            import(&copy, &self.item, self.claimed.cells).map_err(with_release_path)?;
        dem::write(&work.output(HEIGHTS), &metric.grid, &metric.info.crs, &raster_options(self.geotiff))
            .map_err(JobError::io)?;
        let content = digest::heights(&metric.grid);
        let path = format!("dem/{}.metric.tif", self.item.id);
        let place = serde_json::to_vec(&place).map_err(JobError::new)?;
        work.write(PLACE, &place)?;
        let products = vec![Product::released(HEIGHTS, path, Some(content)), Product::internal(PLACE)];
        Ok(Outcome { products, notes })
    }
}

/// A DEM in metres, with its position in the original file.
struct Imported {
    metric: Dem,
    place: Place,
    notes: Vec<String>,
}

/// Reads the DEM of an item, for which this number of cells was planned, crops it to the window and converts degrees to metres.
fn import(path: &Path, item: &DemItem, planned: u64) -> Result<Imported, JobError> {
    let gridding = GridSettings { planned_cells: Some(planned), ..gridding(item).map_err(JobError::new)? };
    let options = ReadOptions { cell_m: item.cell_m };
    let read = dem::read_gridded(path, &options, &gridding).map_err(input_error)?;
    let cut = match item.window {
        Some(window) => window_of(&read.grid, window)?,
        None => read.grid.clone(),
    };
    let place = Place::of(&read.grid.geometry, &cut.geometry);
    let mut notes = read.info.notes.clone();
    let (metric, converted) = to_metres(Dem { grid: cut, info: read.info });
    notes.extend(converted);
    Ok(Imported { metric, place, notes })
}
