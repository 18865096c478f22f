//! Applies masks to heights, and estimates noise where a mask marks smooth ground.

use super::place::Place;
use crate::job::JobError;
use sastrugi_navigation::obstacles::Polygon;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_store::mask::{self, MaskError, MaskOptions, Obstacles};
use sastrugi_texture::noise::{self, ReferenceNoise};
use std::path::{Path, PathBuf};

/// The noise of heights with a known position, estimated in the part marked by a file.
///
/// # Errors
/// A reference that cannot be used for the DEM, or from which no noise can be estimated.
pub fn noise_of_file(heights: &Grid, place: &Place, path: &Path) -> Result<ReferenceNoise, JobError> {
    let mut part = heights.clone();
    apply(&mut part, place, path, false)?;
    noise::of_reference(&part).map_err(|e| JobError::input(format!("{}: {e}", path.display())))
}

/// A note on the share of cells that masks removed.
pub fn share_note(share: f64) -> String {
    format!("masks dropped {:.2} % of the cells with data", 100.0 * share)
}

/// A note on the noise found in a noise reference.
pub fn noise_note(found: &ReferenceNoise) -> String {
    let noise = &found.noise;
    let correlated = match (noise.correlated_sigma_m > 0.0, found.unresolved_to_m) {
        (true, _) => format!(
            " and noise of {:.2e} m correlated over {:.2e} m",
            noise.correlated_sigma_m, noise.correlated_range_m
        ),
        (false, Some(separation_m)) => format!(
            " (only white noise is used: up to {separation_m:.2e} m, the reference contains relief or noise with a longer correlation)"
        ),
        (false, None) => String::new(),
    };
    format!(
        "noise reference: white noise of {:.2e} m per cell{correlated}, from {} second differences",
        noise.white_sigma_m, found.differences
    )
}

/// Applies masks to heights with a known position. Returns the share of the cells with data that they remove, `None` without
/// masks.
///
/// # Errors
/// A mask that cannot be used for the DEM, or masks that leave no cells.
pub fn of_files(heights: &mut Grid, place: &Place, masks: &[(PathBuf, bool)]) -> Result<Option<f64>, JobError> {
    let before = heights.finite_count();
    for (path, excludes) in masks {
        apply(heights, place, path, *excludes)?;
    }
    if masks.is_empty() { Ok(None) } else { dropped_share(before, heights).map(Some) }
}

/// Removes the heights that a mask excludes.
///
/// # Errors
/// A mask that cannot be used for the DEM.
pub fn apply(heights: &mut Grid, place: &Place, path: &Path, excludes: bool) -> Result<(), JobError> {
    let keep = mask::read_with(path, &place.whole(), &MaskOptions { invert: excludes }).map_err(mask_error)?;
    let kept = place.part(Grid::new(place.whole(), keep));
    heights.values.iter_mut().zip(&kept.values).filter(|(_, kept)| !**kept).for_each(|(height, _)| *height = f64::NAN);
    Ok(())
}

/// The obstacles that a file marks on heights with a known position: polygons in the coordinates of the heights, or cells.
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

/// Share of the cells with data that masks removed.
///
/// # Errors
/// When no cell with data is left.
pub fn dropped_share(before: usize, heights: &Grid) -> Result<f64, JobError> {
    match heights.finite_count() {
        0 => Err(JobError::input("the masks leave no cell of the DEM with data")),
        left => Ok(1.0 - left as f64 / before as f64),
    }
}

fn mask_error(error: MaskError) -> JobError {
    if error.unusable_input() { JobError::input(error) } else { JobError::io(error) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: Geometry = Geometry { rows: 4, cols: 6, cell: [1.0, 2.0], origin: [10.0, 20.0] };
    /// The north-western part of the raster: two columns and three rows.
    const CORNER: &str = r#"{"type": "Polygon", "coordinates": [[[10, 22], [12, 22], [12, 28], [10, 28], [10, 22]]]}"#;

    fn mask(folder: &tempfile::TempDir) -> PathBuf {
        let path = folder.path().join("mask.geojson");
        std::fs::write(&path, CORNER).unwrap();
        path
    }

    fn left(grid: &Grid) -> Vec<usize> {
        (0..grid.values.len()).filter(|&k| grid.values[k].is_finite()).collect()
    }

    /// A mask keeps what it marks, or drops it; the share counts cells with data only.
    #[test]
    fn val_masks_keep_or_drop_what_they_mark() {
        let folder = tempfile::tempdir().unwrap();
        let (path, place) = (mask(&folder), Place::of(&WHOLE, &WHOLE));
        let mut heights = Grid::filled(WHOLE, 1.0);
        heights.values[0] = f64::NAN;
        let mut kept = heights.clone();
        let share = of_files(&mut kept, &place, &[(path.clone(), false)]).unwrap().unwrap();
        assert_eq!(left(&kept), [1, 6, 7, 12, 13]);
        assert!((share - 18.0 / 23.0).abs() < 1e-12, "{share}");
        let mut rest = heights.clone();
        let share = of_files(&mut rest, &place, &[(path.clone(), true)]).unwrap().unwrap();
        assert_eq!(left(&rest).len(), 18);
        assert!((share - 5.0 / 23.0).abs() < 1e-12, "{share}");
        assert_eq!(of_files(&mut heights, &place, &[]).unwrap(), None);
        let error = of_files(&mut heights, &place, &[(path.clone(), false), (path, true)]).unwrap_err().message;
        assert_eq!(error, "the masks leave no cell of the DEM with data");
    }

    /// A mask covers the complete raster, from which the heights are a window.
    #[test]
    fn val_masks_cover_the_raster_of_a_window() {
        let folder = tempfile::tempdir().unwrap();
        let window = WHOLE.window(1, 1, 3, 4);
        let mut heights = Grid::filled(window, 1.0);
        apply(&mut heights, &Place::of(&WHOLE, &window), &mask(&folder), false).unwrap();
        // Of the marked cells, rows 1 and 2 of column 1 lie in the window.
        assert_eq!(left(&heights), [0, 4]);
    }

    /// Obstacles move with heights that were converted to metres: one unit of the raster is 10 m to the east and 5 m to the north.
    #[test]
    fn val_obstacles_are_in_the_coordinates_of_the_heights() {
        let folder = tempfile::tempdir().unwrap();
        let metres = Geometry { cell: [10.0, 10.0], origin: [0.0; 2], ..WHOLE };
        let (polygons, cells) = obstacles(&metres, &Place::of(&WHOLE, &WHOLE), &mask(&folder)).unwrap();
        assert!(polygons.len() == 1 && cells.is_none());
        let ring = &polygons[0].rings()[0];
        for corner in [[0.0, 10.0], [20.0, 10.0], [20.0, 40.0], [0.0, 40.0]] {
            assert!(ring.contains(&corner), "{corner:?} {ring:?}");
        }
    }
}
