//! Stage `dem`: a measured DEM into metres, window applied.

use super::original::{self, Original};
use super::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::registry::{BuildError, Builder, Heightfield, InputPlace};
use crate::revision::Room;
use crate::runner::graph::Node;
use sastrugi_numeric::{Grid, resample};
use sastrugi_schemas::study::DemItem;
use sastrugi_store::dem::{self, Crs, Dem, ReadOptions};
use sastrugi_store::digest;
use serde_json::{Value, json};
use std::path::Path;

/// Name of the stage.
pub const STAGE: &str = "dem";
/// File of every heightfield item.
pub const HEIGHTS: &str = "heights.tif";

struct DemJob {
    item: DemItem,
    original: ItemRef,
    /// Path of the original in the release.
    release_path: String,
    bytes: u64,
}

/// Adds the items of `[[dem]]`.
///
/// # Errors
/// A wrong item, or a file that is not there.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    for (index, entry) in builder.study.entries(STAGE)?.into_iter().enumerate() {
        let (item, params): (DemItem, Value) = entry.read()?;
        entry.check_keys::<DemItem>(&params, &json!({}))?;
        builder.claim(&entry, STAGE, &item.id)?;
        check(&item).map_err(|(key, message)| entry.error(key, format!("`{key}` {message}")))?;
        let id = item.id.clone();
        let original = Original::of(&id, &builder.study.folder, &item.file)?;
        builder.inputs.push(InputPlace { index, release_path: original.release_path().to_owned() });
        let field = Heightfield {
            item: ItemRef::new(STAGE, &id),
            group: item.group.clone(),
            kind: original::extension(&item.file),
            parameters: recipe(&item),
            stream: None,
            release_path: format!("dem/{id}.metric.tif"),
            cells: original.bytes(),
        };
        let (bytes, release_path, inputs) = (original.bytes(), original.release_path().to_owned(), original.inputs());
        let original = original.node(&id);
        let job = DemJob { item, original: original.item.clone(), release_path, bytes };
        let parents = vec![original.item.clone()];
        let node = Node { item: field.item.clone(), parents, inputs, stream: None, job: Box::new(job) };
        builder.node(&entry, original)?;
        builder.node(&entry, node)?;
        builder.heightfield(&entry, &id, field)?;
        builder.families.insert(id.clone(), vec![id]);
    }
    Ok(())
}

fn check(item: &DemItem) -> Result<(), (&'static str, String)> {
    if let Some([x0, y0, x1, y1]) = item.window
        && !(x0 < x1 && y0 < y1)
    {
        return Err((
            "window",
            format!("is [{x0}, {y0}, {x1}, {y1}]; it is [x0, y0, x1, y1] with x0 < x1 and y0 < y1"),
        ));
    }
    match item.cell_m {
        Some(cell) if !cell.iter().all(|c| c.is_finite() && *c > 0.0) => {
            Err(("cell_m", format!("is {cell:?}; both sizes must be above 0")))
        }
        _ => Ok(()),
    }
}

/// What decides the result beside the original, whose item is a parent.
fn recipe(item: &DemItem) -> Value {
    json!({ "window": item.window, "cell_m": item.cell_m, "license": item.license, "attribution": item.attribution })
}

impl Job for DemJob {
    fn recipe(&self) -> Value {
        recipe(&self.item)
    }

    fn rooms(&self) -> &'static [Room] {
        &[]
    }

    fn memory_bytes(&self) -> u64 {
        // Compressed integers may grow to eight times as many bytes, held twice while they are cut and converted.
        self.bytes.saturating_mul(24)
    }

    fn estimate(&self) -> Estimate {
        Estimate { seconds: 0.05 + self.bytes as f64 / 50e6, bytes: 2.0 * self.bytes as f64 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let copy = work.parent(&self.original, original::name(&self.release_path))?;
        // Messages are part of the release: they name the file as it is called there, wherever it lies now.
        let name_it =
            |e: JobError| JobError { message: e.message.replace(&copy.display().to_string(), &self.release_path), ..e };
        let (metric, notes) = import(&copy, &self.item).map_err(name_it)?;
        dem::write(&work.output(HEIGHTS), &metric.grid, &metric.info.crs, &Default::default())
            .map_err(JobError::new)?;
        let content = digest::heights(&metric.grid);
        let path = format!("dem/{}.metric.tif", self.item.id);
        let products = vec![Product::released(HEIGHTS, path, Some(content))];
        Ok(Outcome { products, notes, ..Outcome::default() })
    }
}

/// Reads a DEM as an item of a study asks for it: window cut, degrees turned into metres.
fn import(path: &Path, item: &DemItem) -> Result<(Dem, Vec<String>), JobError> {
    let read = dem::read_with(path, &ReadOptions { cell_m: item.cell_m }).map_err(|e| input_error(&e))?;
    let cut = match item.window {
        Some(window) => window_of(&read.grid, window)?,
        None => read.grid.clone(),
    };
    Ok(to_metres(Dem { grid: cut, info: read.info }))
}

/// The cells of a window in the DEM's own coordinates.
///
/// # Errors
/// A window without cells, or without data.
pub fn window_of(grid: &Grid, window: [f64; 4]) -> Result<Grid, JobError> {
    let g = &grid.geometry;
    let reach = [g.origin[0], g.origin[1], g.origin[0] + g.size()[0], g.origin[1] + g.size()[1]];
    let part = resample::crop(grid, window).ok_or_else(|| {
        JobError::input(format!("the window {window:?} holds no cell of the DEM, which covers {reach:?}"))
    })?;
    if part.finite_count() == 0 {
        return Err(JobError::input(format!("the window {window:?} holds no cell with data")));
    }
    Ok(part)
}

/// A DEM in metres, and a warning where it was in degrees.
pub fn to_metres(dem: Dem) -> (Dem, Vec<String>) {
    let mut notes = dem.info.notes.clone();
    if !dem.info.crs.geographic {
        return (dem, notes);
    }
    let before = dem.grid.geometry;
    let grid = resample::geographic_to_metres(&dem.grid);
    let latitude = before.origin[1] + 0.5 * before.size()[1];
    notes.push(format!(
        "geographic raster converted to metres at its centre latitude {latitude:.4} deg: cells of {:.3} x {:.3} m",
        grid.geometry.cell[0], grid.geometry.cell[1]
    ));
    (Dem { grid, info: dem::DemInfo { crs: Crs::default(), ..dem.info } }, notes)
}

/// A store error as a job's.
pub fn input_error(error: &dem::DemError) -> JobError {
    if error.unusable_input() { JobError::input(error) } else { JobError::new(error) }
}
