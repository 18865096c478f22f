//! Maps of one recovered surface: shaded relief of the true and the recovered surface, their difference, albedo, uncertainty, number of
//! lit images.

use super::surfaces::Surface;
use crate::ReportError;
use crate::content::{Figure, slug};
use crate::data::Data;
use crate::questions::relief::{Style, Words, deviations, exaggeration_words, limit_m, percentiles, relief_of, values};
use crate::render::number as set;
use sastrugi_imaging::hillshade::exaggeration;
use sastrugi_imaging::photoclinometry::evaluation::aligned;
use sastrugi_numeric::resample::block_means;
use sastrugi_numeric::{Grid, sums};

/// Largest number of rows or columns of a picture.
const PIXELS: usize = 400;

/// The maps for which the release has files.
pub fn figures(data: &Data, surface: &Surface) -> Result<Vec<Figure>, ReportError> {
    let Some(recovered) = data.files.grid(&surface.row.path)? else { return Ok(Vec::new()) };
    let truth = truth(data, surface, &recovered)?;
    let mut figures = reliefs(surface, truth.as_ref().map(|t| (t.0, &t.1)), &recovered)?;
    if let Some((_, truth)) = &truth {
        figures.extend(errors(surface, truth, &recovered)?);
    }
    figures.extend(albedos(data, surface, &recovered)?);
    figures.extend(uncertainty(data, surface)?);
    figures.extend(lit(data, surface)?);
    Ok(figures)
}

/// The true and the recovered surface.
pub fn both(data: &Data, surface: &Surface) -> Result<Vec<Figure>, ReportError> {
    let Some(recovered) = data.files.grid(&surface.row.path)? else { return Ok(Vec::new()) };
    let truth = truth(data, surface, &recovered)?;
    reliefs(surface, truth.as_ref().map(|t| (t.0, &t.1)), &recovered)
}

/// Path and heights of the true surface, averaged over the cells of the recovered one, if the release has it.
fn truth<'a>(data: &'a Data, surface: &Surface, recovered: &Grid) -> Result<Option<(&'a str, Grid)>, ReportError> {
    let Some(terrain) = data.terrain(&surface.row.surface_id) else { return Ok(None) };
    let heights = data.files.grid(&terrain.path)?;
    Ok(heights.map(|grid| (terrain.path.as_str(), on_cells(&grid, recovered))))
}

/// A raster averaged over the cells of another.
fn on_cells(grid: &Grid, cells: &Grid) -> Grid {
    let (fine, finer) = aligned(grid, &cells.geometry);
    block_means(&fine, finer)
}

fn words(what: &str, surface: &Surface, title: &str, caption: String) -> Words {
    Words { id: slug(&format!("{what}-{}", surface.id())), title: title.into(), caption }
}

fn companion(surface: &Surface, ending: &str) -> String {
    let stem = surface.row.path.strip_suffix(".tif").unwrap_or(&surface.row.path);
    format!("{stem}.{ending}.tif")
}

/// Minus its mean over the cells with data.
fn centred(grid: &Grid) -> Grid {
    let mean = sums::mean(&sums::finite(&grid.values));
    grid.map(|v| v - mean)
}

/// Both surfaces minus their means, with the same light, colour range and exaggeration.
fn reliefs(surface: &Surface, truth: Option<(&str, &Grid)>, recovered: &Grid) -> Result<Vec<Figure>, ReportError> {
    let recovered = centred(recovered);
    let truth = truth.map(|(path, grid)| (path, centred(grid)));
    // The truth sets the colour range: a tilted result would leave no contrast for the relief.
    let Some(range_m) = percentiles(truth.as_ref().map_or(&recovered, |t| &t.1)) else { return Ok(Vec::new()) };
    let style = Style { range_m, exaggeration: exaggeration(surface.row.slope_rms), pixels: PIXELS };
    let shading = exaggeration_words(style.exaggeration);
    let mut figures = Vec::new();
    if let Some((path, grid)) = &truth {
        let caption =
            format!("{}, averaged over the cells of the map, minus its mean.{shading}", surface.row.surface_id);
        figures.extend(relief_of(
            grid,
            path,
            Some(style),
            words("photoclinometry-truth", surface, "True surface.", caption),
        )?);
    }
    let beside = if truth.is_some() { " Light, colours and scale are those of the true surface." } else { "" };
    let caption = format!("{}, minus its mean.{beside}{shading}", surface.id());
    let words = words("photoclinometry-heights", surface, "Recovered surface.", caption);
    figures.extend(relief_of(&recovered, &surface.row.path, Some(style), words)?);
    Ok(figures)
}

/// Recovered minus true heights, minus their mean.
fn errors(surface: &Surface, truth: &Grid, recovered: &Grid) -> Result<Option<Figure>, ReportError> {
    let values = recovered.values.iter().zip(&truth.values).map(|(r, t)| r - t).collect();
    let errors = centred(&Grid::new(recovered.geometry, values));
    let limit = limit_m(&errors);
    let limit = if limit > 0.0 { limit } else { f64::MIN_POSITIVE };
    let caption = format!(
        "Recovered minus true heights, minus the mean. Colours span ±{}; larger errors have the end colours. RMS {}, or {} after subtracting the \
         plane.",
        set::with_unit(limit, 3, "m"),
        set::with_unit(surface.row.height_error_rms_m, 3, "m"),
        set::with_unit(surface.row.height_error_rms_detrended_m, 3, "m")
    );
    let words = words("photoclinometry-error", surface, "Height error.", caption);
    deviations(&errors, &surface.row.path, limit, "not recovered", words)
}

/// Recovered albedo, preceded by the true albedo if the surface has a map of it.
fn albedos(data: &Data, surface: &Surface, recovered: &Grid) -> Result<Vec<Figure>, ReportError> {
    let path = companion(surface, "albedo");
    let Some(found) = data.files.grid(&path)? else { return Ok(Vec::new()) };
    let stem = data.terrain(&surface.row.surface_id).and_then(|t| t.path.strip_suffix(".tif"));
    let true_path = stem.map(|stem| format!("{stem}.albedo.tif"));
    let truth = match &true_path {
        Some(path) => data.files.grid(path)?.map(|grid| on_cells(&grid, recovered)),
        None => None,
    };
    let ends = [Some(&found), truth.as_ref()].into_iter().flatten().filter_map(percentiles);
    let range = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (low, high)| (a.min(low), b.max(high)));
    let span = "Colours end at the 1st and 99th percentile";
    let mut figures = Vec::new();
    if let Some((grid, path)) = truth.as_ref().zip(true_path.as_deref()) {
        let caption = format!("Averaged over the cells of the map. {span} of both maps.");
        let words = words("photoclinometry-true-albedo", surface, "True albedo.", caption);
        figures.extend(values(grid, path, (range, "albedo"), words)?);
    }
    let beside = if truth.is_some() {
        "Colours are those of the true albedo.".into()
    } else {
        format!("{span}. The true surface has a uniform albedo.")
    };
    let caption = format!("Mean {}. {beside}", set::significant(surface.row.albedo_mean, 3));
    let words = words("photoclinometry-albedo", surface, "Recovered albedo.", caption);
    figures.extend(values(&found, &path, (range, "albedo"), words)?);
    Ok(figures)
}

fn uncertainty(data: &Data, surface: &Surface) -> Result<Option<Figure>, ReportError> {
    let path = companion(surface, "uncertainty");
    let Some(grid) = data.files.grid(&path)? else { return Ok(None) };
    let Some((_, high)) = percentiles(&grid) else { return Ok(None) };
    let caption = format!(
        "Standard deviation of the heights due to image noise; RMS {}. Colours end at 0 and the 99th percentile.",
        set::with_unit(surface.row.height_sigma_m, 3, "m")
    );
    let words = words("photoclinometry-uncertainty", surface, "Uncertainty.", caption);
    values(&grid, &path, ((0.0, high), "uncertainty, m"), words)
}

fn lit(data: &Data, surface: &Surface) -> Result<Option<Figure>, ReportError> {
    let path = companion(surface, "lit");
    let Some(grid) = data.files.grid(&path)? else { return Ok(None) };
    let shown: Vec<f64> = grid.values.iter().copied().filter(|n| *n > 0.0).collect();
    let few = shown.iter().filter(|n| **n < 3.0).count() as f64 / shown.len().max(1) as f64;
    let caption = format!(
        "Number of images that show a cell lit, of {} in all. {} of the cells that are lit at all are lit in fewer than three.",
        set::count(surface.row.images.max(0) as usize),
        set::percent(few, 1)
    );
    let words = words("photoclinometry-lit", surface, "Lit images.", caption);
    values(&grid, &path, ((0.0, surface.row.images as f64), "images"), words)
}
