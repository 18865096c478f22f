//! Masks applied to heights, and noise found where a mask says the ground is smooth.

use super::place::Place;
use crate::job::JobError;
use sastrugi_navigation::obstacles::Polygon;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_store::mask::{self, MaskError, MaskOptions, Obstacles};
use sastrugi_texture::noise::{self, ReferenceNoise};
use std::path::{Path, PathBuf};

/// The noise of heights whose place is known in the part that a file marks.
///
/// # Errors
/// A reference that cannot be used for the DEM, or that tells no noise.
pub fn noise_of_file(heights: &Grid, place: &Place, path: &Path) -> Result<ReferenceNoise, JobError> {
    let mut part = heights.clone();
    apply(&mut part, place, path, false)?;
    noise::of_reference(&part).map_err(|e| JobError::input(format!("{}: {e}", path.display())))
}

/// What masks dropped, for people.
pub fn share_note(share: f64) -> String {
    format!("masks dropped {:.2} % of the cells with data", 100.0 * share)
}

/// What was found in a noise reference, for people.
pub fn noise_note(found: &ReferenceNoise) -> String {
    let noise = &found.noise;
    let correlated = match (noise.correlated_sigma_m > 0.0, found.unresolved_to_m) {
        (true, _) => format!(
            " and noise of {:.2e} m that is correlated over {:.2e} m",
            noise.correlated_sigma_m, noise.correlated_range_m
        ),
        (false, Some(separation_m)) => format!(
            " (only white noise is taken: up to {separation_m:.2e} m the reference has relief, or noise correlated further)"
        ),
        (false, None) => String::new(),
    };
    format!(
        "noise reference: white noise of {:.2e} m per cell{correlated}, from {} second differences",
        noise.white_sigma_m, found.differences
    )
}

/// Applies masks to heights whose place is known. Returns the share of the cells with data that they dropped, `None` without
/// masks.
///
/// # Errors
/// A mask that cannot be used for the DEM, or cells of which none is left.
pub fn of_files(heights: &mut Grid, place: &Place, masks: &[(PathBuf, bool)]) -> Result<Option<f64>, JobError> {
    let before = heights.finite_count();
    for (path, excludes) in masks {
        apply(heights, place, path, *excludes)?;
    }
    if masks.is_empty() { Ok(None) } else { dropped_share(before, heights).map(Some) }
}

/// Leaves the heights that a mask keeps.
///
/// # Errors
/// A mask that cannot be used for the DEM.
pub fn apply(heights: &mut Grid, place: &Place, path: &Path, excludes: bool) -> Result<(), JobError> {
    let keep = mask::read_with(path, &place.whole(), &MaskOptions { invert: excludes }).map_err(mask_error)?;
    let kept = place.part(Grid::new(place.whole(), keep));
    heights.values.iter_mut().zip(&kept.values).filter(|(_, kept)| !**kept).for_each(|(height, _)| *height = f64::NAN);
    Ok(())
}

/// What a file of obstacles marks on heights whose place is known: polygons in the coordinates of the heights, and cells.
///
/// # Errors
/// Obstacles that cannot be used for the DEM.
pub fn obstacles(
    geometry: &Geometry,
    place: &Place,
    path: &Path,
) -> Result<(Vec<Polygon>, Option<Grid<bool>>), JobError> {
    match mask::read_obstacles(path, &place.whole()).map_err(mask_error)? {
        Obstacles::Cells(cells) => Ok((Vec::new(), Some(place.part(Grid::new(place.whole(), cells))))),
        Obstacles::Polygons(all) => {
            let moved = |ring: Vec<[f64; 2]>| ring.into_iter().map(|p| place.to_heights(p, geometry)).collect();
            let polygon = |rings: Vec<Vec<[f64; 2]>>| {
                Polygon::new(rings.into_iter().map(moved).collect())
                    .map_err(|e| JobError::input(format!("{}: failed to {e}", path.display())))
            };
            Ok((all.into_iter().map(polygon).collect::<Result<_, _>>()?, None))
        }
    }
}

/// Share of the cells with data that have none any more.
///
/// # Errors
/// When no cell has data.
pub fn dropped_share(before: usize, heights: &Grid) -> Result<f64, JobError> {
    match heights.finite_count() {
        0 => Err(JobError::input("the masks leave no cell of the DEM with data")),
        left => Ok(1.0 - left as f64 / before as f64),
    }
}

fn mask_error(error: MaskError) -> JobError {
    if error.unusable_input() { JobError::input(error) } else { JobError::io(error) }
}
