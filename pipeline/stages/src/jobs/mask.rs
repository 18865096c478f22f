//! Stage `mask`: copies the mask files of fits and the obstacle files of routes into the release, and applies them.

use super::original::{self, MASK_STAGE, Original};
use crate::builder::{BuildError, Builder, InputPlace};
use crate::job::{ItemRef, JobError, Work};
use crate::operations::masks;
use crate::operations::place::{PLACE, Place};
use crate::operations::routes::Given;
use crate::study::Entry;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::fit::MaskSource;
use sastrugi_schemas::study::{Files, FitItem, RouteItem};
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
        let (release_path, sha256) = (copy.release_path().to_owned(), copy.sha256().to_owned());
        let node = copy.node(MASK_STAGE, id);
        let source = MaskSource { file: original::name(&release_path).to_owned(), sha256, excludes };
        let mask = Self { item: node.item.clone(), release_path: release_path.clone(), source };
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
