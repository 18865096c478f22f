//! Folders for import into simulators: the heights in a supported format, `import.json` with all values that the import requires,
//! and `README.md` with the steps.
//!
//! Posts are cell centres: the ground extends between the outer centres, `(cols - 1) x (rows - 1)` cells, and is not extrapolated.
//! Scene coordinates (x east, y north, z up, m) are the DEM's minus its south-west corner, because simulators use single precision;
//! for most generated terrains without `origin_m` they are the terrain's own. `scene_to_target` in `import.json` converts them to the
//! coordinates of the simulator, in whose axes and units all other numbers are.
//!
//! If a simulator only supports certain sizes, the DEM is resampled or cropped ([`Fit`]), as recorded in `import.json`; a DEM that
//! is too large is refused, not thinned.

mod gazebo;
mod isaac;
mod levels;
mod mujoco;
mod parts;
mod posts;
mod unity;
mod unreal;

#[cfg(test)]
mod tests;

use super::mesh::{self, Decimation, MeshLimits};
use super::raster::{DemError, Refusal};
use crate::atomic::{self, AtomicFile, Draft, FinishedFile};
use crate::file;
use parts::Parts;
use posts::Posts;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::study::Simulator;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::{fs, io};

const IMPORT: &str = "import.json";
const README: &str = "README.md";

/// Cost of an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cost {
    /// Approximate peak memory in addition to the DEM, bytes.
    pub memory_bytes: u64,
    /// Approximate size of the files, bytes.
    pub file_bytes: u64,
}

impl Cost {
    /// Cost for a number of posts, from measurements, rounded up: heights, levels or vertices, and the text of a mesh if any.
    fn of(simulator: Simulator, posts: u64) -> Self {
        let (memory, files) = match simulator {
            Simulator::Unreal | Simulator::Unity => (24, 2),
            Simulator::Gazebo => (130, 100),
            Simulator::Mujoco => (24, 4),
            Simulator::Isaac => (160, 90),
        };
        Self { memory_bytes: memory * posts, file_bytes: files * posts }
    }
}

/// How a DEM is fitted to a simulator that only supports certain sizes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fit {
    /// Resample to the smallest size that is large enough, over the same ground, bilinear between the cell centres: nothing is cut
    /// off, but peaks lose height.
    #[default]
    Resample,
    /// Crop to the largest size that fits, in the middle of the DEM: heights are unchanged.
    Crop,
}

/// Files to import into a simulator.
#[derive(Clone, Debug, PartialEq)]
pub struct Export {
    /// Files of the folder: name and bytes.
    pub files: Vec<(String, Vec<u8>)>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Supported sides in posts, ascending, of a simulator that only takes square terrains of certain sizes.
const fn sizes(simulator: Simulator) -> Option<&'static [usize]> {
    match simulator {
        Simulator::Unreal => Some(&unreal::SIZES),
        Simulator::Unity => Some(&unity::SIZES),
        Simulator::Gazebo => Some(&gazebo::SIZES),
        Simulator::Mujoco | Simulator::Isaac => None,
    }
}

/// Cost of exporting a DEM of this size.
///
/// # Errors
/// [`DemError::Unfit`] for fewer than two rows or columns, for more than the simulator supports, or for a crop, for fewer.
pub fn check_size(geometry: &Geometry, simulator: Simulator, fit: Fit) -> Result<Cost, DemError> {
    let side = size(geometry, simulator, fit).map_err(|refusal| refusal.unfit(Path::new(simulator.name())))?;
    Ok(Cost::of(simulator, side.map_or(geometry.len(), |side| side * side) as u64))
}

/// Advice for a DEM that is too large.
const SMALLER: &str = "choose a smaller size, or cut a window";

/// Posts per side, if the simulator only supports certain sizes.
fn size(g: &Geometry, simulator: Simulator, fit: Fit) -> Result<Option<usize>, Refusal> {
    let cells = format!("{} x {} cells", g.cols, g.rows);
    if g.rows < 2 || g.cols < 2 {
        return Err(Refusal::new(format!("a surface needs at least 2 x 2 cells, got {} x {}", g.cols, g.rows)));
    }
    if simulator == Simulator::Isaac && g.len() > mesh::MAX_CELLS {
        return Err(Refusal::new(format!("{cells} exceed the {} of a mesh; {SMALLER}", mesh::MAX_CELLS)));
    }
    let Some(sizes) = sizes(simulator) else { return Ok(None) };
    let (smallest, largest) = (sizes[0], sizes[sizes.len() - 1]);
    let (fitting, refusal) = match fit {
        Fit::Resample => (
            sizes.iter().find(|&&size| size >= g.cols.max(g.rows)),
            format!("{cells} are more than {largest} posts a side; {SMALLER}"),
        ),
        Fit::Crop => (
            sizes.iter().rfind(|&&size| size <= g.cols.min(g.rows)),
            format!("{cells} are fewer than {smallest} posts a side, the smallest crop; omit --crop"),
        ),
    };
    fitting.copied().ok_or_else(|| Refusal::new(refusal)).map(Some)
}

/// The files for a simulator, from heights in metres. The same heights give the same bytes. `limits` decimate the mesh, if the
/// folder contains one.
///
/// # Errors
/// [`DemError::Unfit`] as [`check_size`], for cells without data if the simulator does not support holes, and for heights beyond
/// single precision.
pub fn export(grid: &Grid, simulator: Simulator, fit: Fit, limits: Option<&MeshLimits>) -> Result<Export, DemError> {
    export_posts(simulator, posts(grid, simulator, fit), limits)
}

/// As [`export`], for a DEM converted from degrees to metres: the scene is not just a shift of its own coordinates, and the files
/// say so.
///
/// # Errors
/// As [`export`].
pub fn export_from_degrees(
    grid: &Grid,
    simulator: Simulator,
    fit: Fit,
    limits: Option<&MeshLimits>,
) -> Result<Export, DemError> {
    export_posts(simulator, posts(grid, simulator, fit).map(Posts::of_degrees), limits)
}

/// True for simulators whose folder contains a mesh, which may be decimated.
pub const fn has_mesh(simulator: Simulator) -> bool {
    matches!(simulator, Simulator::Gazebo | Simulator::Isaac)
}

fn export_posts(
    simulator: Simulator,
    posts: Result<Posts, Refusal>,
    limits: Option<&MeshLimits>,
) -> Result<Export, DemError> {
    let refused = |refusal: Refusal| refusal.unfit(Path::new(simulator.name()));
    let posts = posts.map_err(refused)?;
    let limits = limits.filter(|_| has_mesh(simulator));
    let decimation = limits.map(|limits| Decimation::new(&posts.heights, limits)).transpose().map_err(refused)?;
    let mut parts = parts(&posts, simulator, decimation.as_ref()).map_err(refused)?;
    if let Some(decimation) = &decimation {
        parts.settings["decimation"] = decimation.to_json();
    }
    let mut files = std::mem::take(&mut parts.files);
    files.push((IMPORT.to_owned(), import_json(&posts, &parts, simulator).into_bytes()));
    files.push((README.to_owned(), readme(&posts, &parts).into_bytes()));
    let notes = posts.sentence().into_iter().collect();
    Ok(Export { files, notes: mesh::with_decimation(notes, decimation.as_ref()) })
}

/// Refuses a folder with files other than an export for this simulator, which [`write()`] would overwrite.
///
/// # Errors
/// [`DemError::Unfit`] for such a folder, [`DemError::Io`] if it cannot be read.
pub fn check_folder(folder: &Path, simulator: Simulator) -> Result<(), DemError> {
    if is_vacant(folder).map_err(|source| DemError::Io { path: folder.to_owned(), source })? || holds(folder, simulator)
    {
        return Ok(());
    }
    let reason = format!("the folder has files but no export for {}; choose a new folder", simulator.name());
    Err(Refusal::new(reason).unfit(folder))
}

/// True if the folder does not exist or is empty; temporary files of running processes do not count.
fn is_vacant(folder: &Path) -> io::Result<bool> {
    match fs::read_dir(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(true),
        Err(e) => Err(e),
        Ok(entries) => {
            let names = entries.map(|entry| entry.map(|e| e.file_name()));
            let mut others = names.filter(|name| !name.as_ref().is_ok_and(|name| atomic::is_temporary(name)));
            others.next().transpose().map(|other| other.is_none())
        }
    }
}

/// True for a folder whose `import.json` was written by any version of this program for this simulator.
fn holds(folder: &Path, simulator: Simulator) -> bool {
    let name = |program: &str| program.split('/').next().map(str::to_owned);
    let text = file::read(&folder.join(IMPORT)).unwrap_or_default();
    let found: Value = serde_json::from_slice(&text).unwrap_or_default();
    let program = found["program"].as_str().and_then(name);
    program == name(crate::PROGRAM) && found["target"] == simulator.name()
}

/// Writes the files of an export to a folder, which is created if missing. See [`check_folder`] for an existing one. All files are complete
/// on disk before the first appears, so an export that fails leaves an earlier one as it was.
///
/// # Errors
/// [`DemError::Io`] if a file cannot be written, or a folder has its name; [`DemError::Unfit`] if a link, a pipe or a device has it.
pub fn write(folder: &Path, export: &Export) -> Result<(), DemError> {
    atomic::clear_leftovers(&folder.join(IMPORT));
    let is_new = !folder.exists();
    let finished = export.files.iter().map(|(name, bytes)| finish(folder, name, bytes));
    let finished: Result<Vec<FinishedFile>, DemError> = finished.collect();
    if finished.is_err() && is_new {
        // If this fails, an empty folder is left, which any export may use.
        let _ = fs::remove_dir(folder);
    }
    let (first, others): (Vec<_>, Vec<_>) = finished?.into_iter().partition(|file| file.path().ends_with(IMPORT));
    // `import.json` first, so that a later run can complete the folder of a killed one. Then files of an earlier export are removed: after
    // a kill between these renames the folder may be incomplete, but does not mix terrains.
    first.into_iter().try_for_each(put_in_place)?;
    others.iter().try_for_each(|file| remove(file.path()))?;
    others.into_iter().try_for_each(put_in_place)?;
    atomic::sync_folder(folder).map_err(failed(folder))
}

/// A file of the export, complete on disk but not in place.
fn finish(folder: &Path, name: &str, bytes: &[u8]) -> Result<FinishedFile, DemError> {
    let path = folder.join(name);
    atomic::check_replaced(&path).map_err(|e| Refusal::new(e.to_string()).unfit(&path))?;
    if path.is_dir() {
        let reason =
            "is a folder, but the export has a file of that name; move the folder, or choose a new one for the export";
        return Err(failed(&path)(io::Error::new(io::ErrorKind::IsADirectory, reason)));
    }
    // The folder is synced once, after all files.
    let file = AtomicFile::create(&Draft(folder).file(name)).and_then(|mut file| {
        file.write_all(bytes)?;
        file.finish()
    });
    file.map_err(failed(&path))
}

fn put_in_place(file: FinishedFile) -> Result<(), DemError> {
    let path = file.path().to_owned();
    file.put_in_place().map_err(failed(&path))
}

fn remove(path: &Path) -> Result<(), DemError> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(failed(path)(e)),
        _ => Ok(()),
    }
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> DemError {
    let path = path.to_owned();
    move |source| DemError::Io { path, source }
}

fn posts(grid: &Grid, simulator: Simulator, fit: Fit) -> Result<Posts, Refusal> {
    match size(&grid.geometry, simulator, fit)? {
        Some(size) if fit == Fit::Crop => Posts::cropped(grid, size),
        Some(size) => Posts::resampled(grid, size),
        None if simulator == Simulator::Mujoco => Posts::without_holes(grid),
        None => Posts::of(grid),
    }
}

fn parts(posts: &Posts, simulator: Simulator, decimation: Option<&Decimation>) -> Result<Parts, Refusal> {
    match simulator {
        Simulator::Unreal => unreal::parts(posts),
        Simulator::Unity => Ok(unity::parts(posts)),
        Simulator::Gazebo => gazebo::parts(posts, decimation),
        Simulator::Mujoco => Ok(mujoco::parts(posts)),
        Simulator::Isaac => isaac::parts(posts, decimation),
    }
}

fn import_json(posts: &Posts, parts: &Parts, simulator: Simulator) -> String {
    let g = posts.geometry();
    let value = json!({
        "program": crate::PROGRAM,
        "target": simulator.name(),
        "scene": {
            "axes": "x east, y north, z up, m",
            // Null if the DEM's own coordinates are degrees.
            "dem_minus_scene_m": (!posts.from_degrees).then_some(posts.shift_m),
            "south_west_post_m": posts.south_west_m(),
            "ground_m": posts.ground_m(),
            "height_min_m": posts.low_m,
            "height_max_m": posts.high_m,
        },
        "posts": [g.cols, g.rows],
        "spacing_m": g.cell,
        "cells_of_dem": posts.source,
        "fit": posts.fitting(),
        "target_axes": parts.axes,
        "scene_to_target": parts.scene_to_target,
        "settings": parts.settings,
    });
    format!("{value:#}\n")
}

fn readme(posts: &Posts, parts: &Parts) -> String {
    let (g, [east, north]) = (posts.geometry(), posts.ground_m().map(readable));
    let [spacing_x, spacing_y] = g.cell.map(readable);
    let mut text = format!("# Terrain for {}\n\n", parts.title);
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "Ground: {east} m east-west by {north} m north-south between the outer posts, heights from {} to {} m. {} x {} posts, \
         {spacing_x} x {spacing_y} m apart; a post is a point on the ground, not a cell.",
        readable(posts.low_m),
        readable(posts.high_m),
        g.cols,
        g.rows
    );
    let _ = match posts.sentence() {
        Some(sentence) => write!(text, " {sentence}.\n\n"),
        None => write!(text, " The posts are the cell centres of the DEM.\n\n"),
    };
    let _ = write!(
        text,
        "Scene coordinates (x east, y north, z up, m) {}; `scene_to_target` in `import.json` converts them to those of {}: {}. The \
         numbers below are also in `import.json`.\n\n",
        scene(posts),
        parts.title,
        parts.axes
    );
    for (k, step) in parts.steps.iter().enumerate() {
        let _ = writeln!(text, "{}. {step}", k + 1);
    }
    text
}

/// A number to read or type, rounded to six decimals, which hides rounding errors such as 50.400000000000006.
fn readable(value: f64) -> f64 {
    (value * 1e6).round() / 1e6 + 0.0
}

/// Origin of the scene coordinates, in words.
fn scene(posts: &Posts) -> String {
    match posts.shift_m {
        _ if posts.from_degrees => "are relative to the south-west corner of the DEM, which is in degrees".to_owned(),
        [x, y] => format!("are the DEM's minus ({x}, {y})"),
    }
}
