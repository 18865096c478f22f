//! Stage `dem`: a measured DEM into metres, window applied.

use super::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::registry::{BuildError, Builder, Heightfield, InputPlace, input_file};
use crate::revision::Room;
use crate::runner::graph::Node;
use sastrugi_numeric::{Grid, resample};
use sastrugi_schemas::study::DemItem;
use sastrugi_store::dem::{self, Crs, Dem, ReadOptions};
use sastrugi_store::{atomic, digest};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Name of the stage.
pub const STAGE: &str = "dem";
/// File of every heightfield item.
pub const HEIGHTS: &str = "heights.tif";

struct DemJob {
    item: DemItem,
    path: PathBuf,
    extension: String,
    bytes: u64,
    sha256: String,
    /// Path of the original in the release.
    original: String,
    /// Coordinate system beside an ESRI ASCII grid, when there is one.
    sidecar: Option<PathBuf>,
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
        let input = input_file(builder.study.folder.join(&item.file))?;
        let extension = extension(&item.file);
        let original = original_path(&item.id, &item.file, &extension);
        builder.inputs.push(InputPlace { index, release_path: original.clone() });
        let sidecar = sidecar(&input.path, &extension);
        let side_input = sidecar.clone().map(input_file).transpose()?;
        let id = item.id.clone();
        let bytes = std::fs::metadata(&input.path).map_or(0, |m| m.len());
        let field = Heightfield {
            item: ItemRef::new(STAGE, &id),
            group: item.group.clone(),
            kind: extension.clone(),
            parameters: recipe(&item),
            stream: None,
            release_path: format!("dem/{id}.metric.tif"),
            cells: bytes,
        };
        let job = DemJob {
            item,
            path: input.path.clone(),
            extension,
            bytes,
            sha256: input.sha256.clone(),
            original,
            sidecar,
        };
        let node = Node {
            item: field.item.clone(),
            parents: Vec::new(),
            inputs: [input].into_iter().chain(side_input).collect(),
            stream: None,
            job: Box::new(job),
        };
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

/// The file's ending in lower case, `dat` where it has none that a release path can hold.
fn extension(file: &str) -> String {
    let ending = Path::new(file).extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let plain = !ending.is_empty() && ending.len() <= 8 && ending.bytes().all(|b| b.is_ascii_alphanumeric());
    if plain { ending } else { "dat".to_owned() }
}

/// Where the original goes in the release: an .hgt tile keeps its name, which says where it lies.
fn original_path(id: &str, file: &str, extension: &str) -> String {
    match Path::new(file).file_name().and_then(|n| n.to_str()) {
        Some(name) if extension == "hgt" => format!("dem/{id}/{name}"),
        _ => format!("dem/{id}.{extension}"),
    }
}

/// The .prj file beside an ESRI ASCII grid, which says whether it is geographic.
fn sidecar(path: &Path, extension: &str) -> Option<PathBuf> {
    Some(path.with_extension("prj")).filter(|prj| extension == "asc" && prj.is_file())
}

/// What decides the result beside the bytes of the files. The name counts for .hgt alone (see [`DemJob::recipe`]).
fn recipe(item: &DemItem) -> Value {
    json!({ "window": item.window, "cell_m": item.cell_m, "license": item.license, "attribution": item.attribution })
}

impl Job for DemJob {
    fn recipe(&self) -> Value {
        json!({ "original": self.original, "item": recipe(&self.item) })
    }

    fn rooms(&self) -> &'static [Room] {
        &[]
    }

    fn memory_bytes(&self) -> u64 {
        // Compressed integers may grow to eight times as many bytes, held twice while they are cut and converted.
        self.bytes.saturating_mul(24)
    }

    fn estimate(&self) -> Estimate {
        Estimate { seconds: 0.05 + self.bytes as f64 / 50e6, bytes: 3.0 * self.bytes as f64 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let (metric, notes) = import(&self.path, &self.item)?;
        dem::write(&work.output(HEIGHTS), &metric.grid, &metric.info.crs, &Default::default())
            .map_err(JobError::new)?;
        let original = format!("original.{}", self.extension);
        let bytes = std::fs::read(&self.path).map_err(|e| JobError::input(format!("{}: {e}", self.path.display())))?;
        if digest::of_bytes(&bytes) != self.sha256 {
            return Err(JobError::input(format!("{}: the file changed during the run", self.path.display())));
        }
        atomic::write(&work.output(&original), &bytes).map_err(JobError::new)?;
        let id = &self.item.id;
        let content = digest::heights(&metric.grid);
        let mut products = vec![
            Product::released(HEIGHTS, format!("dem/{id}.metric.tif"), Some(content)),
            Product::released(&original, self.original.clone(), None),
        ];
        if let Some(prj) = &self.sidecar {
            let text = std::fs::read(prj).map_err(|e| JobError::input(format!("{}: {e}", prj.display())))?;
            atomic::write(&work.output("original.prj"), &text).map_err(JobError::new)?;
            products.push(Product::released("original.prj", format!("dem/{id}.prj"), None));
        }
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
