//! `photoclinometry`: recovers heights and albedo from described images.

use super::{Reading, parameters, read};
use crate::error::Error;
use crate::jobs::photoclinometry::STAGE;
use crate::operations::photoclinometry::{
    self, Beside, Described, MAPS, Made, Map, read_description, read_image, read_points, refusal,
};
use crate::remote::check_file;
use sastrugi_imaging::ImageDescription;
use sastrugi_imaging::photoclinometry::{Coarse, RecoverError, Settings};
use sastrugi_numeric::{Streams, sums};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_store::dem::{Format, WriteOptions};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// `IMAGES.toml`: images and auxiliary data. Paths are relative to the file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImagesFile {
    /// Image descriptions: the JSON files that `render` and releases write next to images.
    pub images: Vec<String>,
    /// Images described here, with the same keys.
    pub image: Vec<ImageDescription>,
    /// Coarse DEM that constrains the heights: the first round starts from it, and it is a soft constraint.
    pub coarse: Option<String>,
    /// Standard deviation of its heights, m.
    pub coarse_sigma_m: Option<f64>,
    /// CSV file of measured points (columns `x`, `y`, `z`, `sigma`, m), each a soft constraint with its sigma, above 0.
    pub altimetry: Option<String>,
    /// Height of the level ground from which the first round starts, m; default: from the centres of the images.
    pub level_m: Option<f64>,
    /// True surface to compare with.
    pub truth: Option<String>,
    /// Settings (see `sastrugi kinds photoclinometry`).
    pub settings: Settings,
}

/// What to recover.
pub struct Request<'a> {
    /// `IMAGES.toml`.
    pub images: &'a Path,
    /// `name=value` pairs of settings.
    pub set: &'a [String],
    /// Seed of the random streams.
    pub seed: u64,
    /// DEM to write; the maps are written next to it.
    pub output: &'a Path,
    /// How to write.
    pub options: WriteOptions,
}

/// Recovers a surface and writes it with its maps. Returns a description of the result.
///
/// # Errors
/// Unknown keys, images that cannot be read or do not determine a surface, files that cannot be written.
pub fn photoclinometry(request: &Request<'_>) -> Result<Value, Error> {
    if Format::of_name(request.output) != Some(Format::GeoTiff) {
        return Err(Error::Usage(format!(
            "{}: heights and maps are written as GeoTIFF; use the extension .tif",
            request.output.display()
        )));
    }
    let file = read_file(request)?;
    file.settings.check().map_err(Error::from)?;
    let outputs: Vec<PathBuf> = [request.output.to_path_buf()]
        .into_iter()
        .chain(MAPS.iter().map(|(ending, ..)| request.output.with_extension(ending)))
        .collect();
    outputs.iter().try_for_each(|path| check_file(path))?;
    let folder = request.images.parent().unwrap_or(Path::new("."));
    let (images, mut inputs) = described(&file, folder)?;
    let others = [&file.coarse, &file.altimetry, &file.truth].into_iter().flatten();
    inputs.extend(others.map(|name| folder.join(name)));
    let [outputs, inputs] = [&outputs, &inputs].map(|all| all.iter().map(PathBuf::as_path).collect::<Vec<_>>());
    super::check_distinct(&outputs, &inputs)?;
    let streams = Streams::for_seed(request.seed, STAGE);
    let made = photoclinometry::make(images, beside(&file, folder)?, &file.settings, &streams).map_err(refused)?;
    let beside = |map: Map| {
        let path = request.output.with_extension(map.ending);
        (map, path)
    };
    let maps: Vec<(Map, PathBuf)> = made.maps().into_iter().map(beside).collect();
    let targets = maps.iter().map(|(map, path)| (map, path.as_path().into()));
    // Remove maps of an earlier surface of the same name.
    for path in outputs[1..].iter().filter(|path| !maps.iter().any(|(_, written)| written == *path)) {
        match std::fs::remove_file(path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::at(path, e)),
            _ => {}
        }
    }
    let mut notes = made.write(request.output.into(), targets, &request.options)?;
    notes.extend(made.recovered.warnings.iter().cloned());
    Ok(description(request, &made, &maps, notes))
}

fn refused(error: RecoverError) -> Error {
    match error {
        RecoverError::Setting(e) => e.into(),
        RecoverError::TooFewImages(_) | RecoverError::CoplanarLights { .. } => Error::Usage(error.to_string()),
        _ => refusal(&error).into(),
    }
}

fn read_file(request: &Request<'_>) -> Result<ImagesFile, Error> {
    let mut table = parameters::read_file(request.images)?;
    if !request.set.is_empty() {
        let mut settings = table.get("settings").cloned().unwrap_or_else(|| json!({}));
        parameters::assign(&mut settings, request.set)?;
        table["settings"] = settings;
    }
    parameters::check_schema(&table, &schema_of::<ImagesFile>(), "photoclinometry")?;
    Ok(read_parameters(&table)?)
}

/// The images, and their files.
fn described(file: &ImagesFile, folder: &Path) -> Result<(Vec<Described>, Vec<PathBuf>), Error> {
    let mut all: Vec<(ImageDescription, PathBuf)> = Vec::new();
    for (k, name) in file.images.iter().enumerate() {
        if file.images[..k].contains(name) {
            return Err(Error::Usage(format!(
                "`images` lists {name} twice, which would count its noise as independent"
            )));
        }
        let path = folder.join(name);
        let description = read_description(&path)?;
        let image = path.with_file_name(&description.image);
        all.push((description, image));
    }
    for (k, description) in file.image.iter().enumerate() {
        description.check().map_err(|e| e.within(&format!("image.{k}")))?;
        all.push((description.clone(), folder.join(&description.image)));
    }
    let paths = all.iter().map(|(_, path)| path.clone()).collect();
    let images = all.into_iter().map(|(description, path)| read_image(description, &path)).collect::<Result<_, _>>()?;
    Ok((images, paths))
}

fn beside(file: &ImagesFile, folder: &Path) -> Result<Beside, Error> {
    let dem = |name: &String| Ok::<_, Error>(read(&folder.join(name), &Reading::default())?.dem.grid);
    let coarse = match (&file.coarse, file.coarse_sigma_m) {
        (Some(name), Some(sigma_m)) => {
            ParameterError::positive("coarse_sigma_m", sigma_m)?;
            Some(Coarse { dem: dem(name)?, sigma_m })
        }
        (None, None) => None,
        _ => return Err(Error::Usage("`coarse` and `coarse_sigma_m` must be given together".to_owned())),
    };
    let points = file.altimetry.as_ref().map(|name| read_points(&folder.join(name))).transpose()?.unwrap_or_default();
    Ok(Beside { truth: file.truth.as_ref().map(dem).transpose()?, coarse, points, level_m: file.level_m })
}

fn description(request: &Request<'_>, made: &Made, maps: &[(Map, PathBuf)], notes: Vec<String>) -> Value {
    let r = &made.recovered;
    let median = |values: &[f64]| sums::median(&sums::finite(values));
    let rounds: Vec<Value> = r
        .rounds
        .iter()
        .map(|round| {
            json!({
                "brightness_rms": round.brightness_rms,
                "change_m": round.change_m,
                "iterations": round.iterations,
                "stereo_points": round.stereo_points,
            })
        })
        .collect();
    let calibrations: Vec<Value> =
        r.calibrations.iter().map(|c| json!({ "exposure": c.exposure, "haze": c.haze })).collect();
    let evaluation = made.evaluation.map(|e| {
        json!({
            "cells": e.cells,
            "shaded_correlation": e.shaded_correlation,
            "shaded_correlation_ceiling": e.shaded_correlation_ceiling,
            "slope_error_rms": e.slope_error_rms,
            "slope_error_rms_ceiling": e.slope_error_rms_ceiling,
            "slope_rms": e.slope_rms,
            "height_error_rms_m": e.height_error_rms_m,
            "height_error_rms_detrended_m": e.height_error_rms_detrended_m,
            "height_rms_m": e.height_rms_m,
        })
    });
    let files: Vec<String> = maps.iter().map(|(_, path)| path.display().to_string()).collect();
    json!({
        "file": request.output.display().to_string(),
        "maps": files,
        "seed": request.seed,
        "grid": super::describe_grid(&r.heights),
        "rounds": rounds,
        "converged": r.converged,
        "share_leaning": made.recovered.share_leaning,
        "condition": median(&r.condition.values),
        "albedo_slope_correlation": median(&r.albedo_slope_correlation.values),
        "noise_scale": r.noise_scale,
        "height_sigma_m": r.height_sigma.as_ref().map(|s| median(&s.values)),
        "calibrations": calibrations,
        "evaluation": evaluation,
        "notes": notes,
    })
}
