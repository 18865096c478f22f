//! Stage `mask`: copies the mask files of fits and the obstacle files of routes into the release, and applies them.

use super::original::{self, MASK_STAGE, Original};
use crate::builder::{BuildError, Builder, Heightfield, InputPlace};
use crate::job::{ItemRef, JobError, Work};
use crate::operations::masks;
use crate::operations::place::{PLACE, Place};
use crate::operations::routes::Given;
use crate::study::Entry;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::fit::MaskSource;
use sastrugi_schemas::study::{Files, FitItem, RouteItem};
use sastrugi_store::mask::reading_bytes;
use sastrugi_texture::noise::{self, ReferenceNoise};
use std::path::Path;

/// A copied file that selects cells: a mask or noise reference of a fit, or obstacles of a route.
#[derive(Clone)]
pub struct Mask {
    /// The item that copies its file.
    pub item: ItemRef,
    /// Path in the release.
    release_path: String,
    /// Its entry in the fit file.
    pub source: MaskSource,
    /// Approximate memory for reading it, besides the cells that it selects, bytes.
    pub reading_bytes: u64,
}

/// Memory for the cells that a mask or obstacles select on a surface, bytes: one byte per cell of the complete raster while they are read,
/// and one for those inside a polygon.
pub fn selection_bytes(field: &Heightfield) -> u64 {
    2 * field.raster_cells.unwrap_or(field.cells)
}

/// Adds the copies of the mask files of a fit, and records their keys so that the released study can refer to the copies.
///
/// # Errors
/// A file that is missing or cannot be read.
pub fn add(builder: &mut Builder<'_>, entry: &Entry<'_>, item: &FitItem) -> Result<Vec<Mask>, BuildError> {
    let named = |files: &Files, key: &str, excludes: bool| {
        let one = |(k, file): (Option<usize>, &str)| {
            let mut path = entry.path_of(key);
            path.extend(k.map(|k| k.to_string()));
            (path, file.to_owned(), excludes)
        };
        files.numbered().into_iter().map(one).collect::<Vec<_>>()
    };
    let files = named(&item.mask, "mask", false).into_iter().chain(named(&item.exclude, "exclude", true));
    let copy = |(number, (key, file, excludes))| {
        Mask::copied(builder, &format!("{}-{}", item.id, number + 1), key, (file, excludes))
    };
    (0usize..).zip(files).map(copy).collect()
}

/// Adds the copies of the files that mark cells a route cannot enter.
///
/// # Errors
/// A file that is missing or cannot be read.
pub fn add_obstacles(builder: &mut Builder<'_>, entry: &Entry<'_>, item: &RouteItem) -> Result<Vec<Mask>, BuildError> {
    let files: Vec<(Option<usize>, String)> =
        item.obstacles.numbered().into_iter().map(|(k, file)| (k, file.to_owned())).collect();
    let copy = |(number, (k, file)): (usize, (Option<usize>, String))| {
        let mut key = entry.path_of("obstacles");
        key.extend(k.map(|k| k.to_string()));
        Mask::copied(builder, &format!("{}-{}", item.id, number + 1), key, (file, false))
    };
    files.into_iter().enumerate().map(copy).collect()
}

/// Adds the copy of the noise reference of a fit, if it has one.
///
/// # Errors
/// A file that is missing or cannot be read.
pub fn add_noise_reference(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    item: &FitItem,
) -> Result<Option<Mask>, BuildError> {
    let Some(file) = item.noise_reference.clone() else { return Ok(None) };
    let key = entry.path_of("noise_reference");
    Mask::copied(builder, &format!("{}-noise", item.id), key, (file, false)).map(Some)
}

impl Mask {
    fn copied(
        builder: &mut Builder<'_>,
        id: &str,
        key: Vec<String>,
        (file, excludes): (String, bool),
    ) -> Result<Self, BuildError> {
        let copy = Original::of(&format!("mask/{id}"), &builder.study.folder, &file)?;
        let path = builder.study.folder.join(&file);
        let reading_bytes = reading_bytes(&path).map_err(|e| BuildError::reading(&path, e))?;
        let (release_path, sha256) = (copy.release_path().to_owned(), copy.sha256().to_owned());
        let node = copy.node(MASK_STAGE, id);
        let source = MaskSource { file: original::name(&release_path).to_owned(), sha256, excludes };
        let mask = Self { item: node.item.clone(), release_path: release_path.clone(), source, reading_bytes };
        builder.inputs.push(InputPlace { key, release_path });
        builder.node(node)?;
        Ok(mask)
    }

    /// Removes the heights that the mask excludes.
    fn apply(&self, heights: &mut Grid, place: &Place, work: &Work<'_>) -> Result<(), JobError> {
        self.with_file(work, |path| masks::apply(heights, place, path, self.source.excludes))
    }

    /// Runs `act` on the file. Messages are part of the release, so they use the file's path in the release.
    fn with_file<T>(&self, work: &Work<'_>, act: impl FnOnce(&Path) -> Result<T, JobError>) -> Result<T, JobError> {
        let path = work.parent(&self.item, original::name(&self.release_path))?;
        act(&path).map_err(|e| e.reworded(|words| words.replace(&path.display().to_string(), &self.release_path)))
    }
}

/// The noise of the DEM of an item, estimated in its reference area.
///
/// # Errors
/// A reference that cannot be used for the DEM, or from which no noise can be estimated.
pub fn noise_of_item(
    heights: &Grid,
    dem: &ItemRef,
    reference: &Mask,
    work: &Work<'_>,
) -> Result<ReferenceNoise, JobError> {
    let place = Place::read(&work.parent(dem, PLACE)?, &heights.geometry)?;
    let mut part = heights.clone();
    reference.apply(&mut part, &place, work)?;
    noise::of_reference(&part).map_err(|e| JobError::input(format!("{}: {e}", reference.release_path)))
}

/// Applies the masks of an item to the heights of its DEM. Returns the share of the cells with data that they remove.
///
/// # Errors
/// A mask that cannot be used for the DEM, or masks that leave no cells.
pub fn of_item(heights: &mut Grid, dem: &ItemRef, masks: &[Mask], work: &Work<'_>) -> Result<Option<f64>, JobError> {
    if masks.is_empty() {
        return Ok(None);
    }
    let place = Place::read(&work.parent(dem, PLACE)?, &heights.geometry)?;
    let before = heights.finite_count();
    for one in masks {
        one.apply(heights, &place, work)?;
    }
    masks::dropped_share(before, heights).map(Some)
}

/// Adds the polygons and cells that the obstacles of an item mark on a terrain.
///
/// # Errors
/// Obstacles that cannot be used for the terrain.
pub fn add_marked(
    given: &mut Given,
    geometry: &Geometry,
    terrain: &ItemRef,
    files: &[Mask],
    work: &Work<'_>,
) -> Result<(), JobError> {
    let place = Place::read(&work.parent(terrain, PLACE)?, geometry)?;
    for file in files {
        let (polygons, cells) = file.with_file(work, |path| masks::obstacles(geometry, &place, path))?;
        given.polygons.extend(polygons);
        given.add_blocked(cells);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs;
    use crate::registry::section_names;
    use crate::study::Study;
    use serde_json::Value;

    /// Memory of an item of a study with a DEM of 144 cells, `site`, and another one, `large`.
    fn memory_bytes(folder: &Path, tables: &str, item: &ItemRef) -> u64 {
        let text = format!(
            "[study]\nname = \"masks\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"site\"\nfile = \"site.asc\"\n\
             [[dem]]\nid = \"large\"\nfile = \"large.asc\"\n{tables}"
        );
        let (study, errors) = Study::read(&text, folder, &section_names()).unwrap();
        let mut builder = Builder::new(&study, errors);
        jobs::dem::add(&mut builder).unwrap();
        jobs::fit::add(&mut builder).unwrap();
        jobs::route::add(&mut builder).unwrap();
        builder.check().unwrap();
        let position = builder.graph.find(item).unwrap();
        builder.graph.node(position).job.memory_bytes()
    }

    /// A DEM of 144 cells takes little, but not what is read with it: 2^26 cells according to a header, or a million corners.
    #[test]
    fn val_masks_obstacles_and_other_rasters_count_as_memory() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        let corners = "[0,1],".repeat(1_000_000);
        write("corners.geojson", &format!("{{\"type\": \"Polygon\", \"coordinates\": [[{corners}[0,0]]]}}"));
        let placed = "xllcorner 0\nyllcorner 0\ncellsize 1";
        write("site.asc", &format!("ncols 12\nnrows 12\n{placed}\n{}", "1 2 3 4 5 6 7 8 9 8 7 6\n".repeat(12)));
        write("large.asc", &format!("ncols 8192\nnrows 8192\n{placed}\n1\n"));
        let (heights, raster, polygon) = (8_u64 << 26, 16_u64 << 26, 5_000_000 * size_of::<Value>() as u64);
        let fit = |keys: &str| {
            let table = format!("[[fit]]\nid = \"f\"\ndem = \"site\"\nouter_scale_m = 3.0\n{keys}\n");
            memory_bytes(folder.path(), &table, &ItemRef::new(jobs::fit::STAGE, "f"))
        };
        let route = |keys: &str| {
            let table = format!("[[route]]\nid = \"r\"\nterrains = [\"site\"]\nmethod = \"grid\"\n{keys}\n");
            memory_bytes(folder.path(), &table, &ItemRef::new(jobs::route::STAGE, "r@site"))
        };
        assert!(fit("") < 300 << 20 && route("") < 100 << 20, "{} {}", fit(""), route(""));
        for (keys, least) in [
            ("mask = \"large.asc\"", raster),
            ("exclude = [\"corners.geojson\"]", polygon),
            ("noise_reference = \"large.asc\"", raster),
            ("minus = \"large\"", heights),
        ] {
            assert!(fit(keys) > least, "{keys}: {}", fit(keys));
        }
        for (keys, least) in [
            ("obstacles = \"corners.geojson\"", polygon),
            ("obstacles = [\"large.asc\", \"corners.geojson\"]", raster + polygon),
            ("cost = \"raster\"\ncost_raster = \"large\"", heights),
        ] {
            assert!(route(keys) > least, "{keys}: {}", route(keys));
        }
    }
}
