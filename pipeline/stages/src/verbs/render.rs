//! `render`: one image of a DEM or of a generated surface.

use super::{Reading, parameters, read, terrain};
use crate::error::Error;
use crate::jobs::image::STAGE;
use crate::operations::images::{self, Files, Ground, Made};
use crate::remote::check_file;
use sastrugi_imaging::{RenderError, RenderParameters};
use sastrugi_numeric::Streams;
use sastrugi_schemas::kind::read_parameters;
use sastrugi_store::dem::{Crs, WriteOptions};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Suffix of the albedo map next to a DEM.
const ALBEDO_ENDING: &str = "albedo.tif";

/// What to render.
pub struct Request<'a> {
    /// A DEM, a generator's name, or a TOML file with `kind` and its parameters.
    pub surface: &'a str,
    /// How a DEM is read.
    pub reading: Reading,
    /// `name=value` pairs of a generator.
    pub set_surface: &'a [String],
    /// Albedo raster, used instead of the map next to the DEM.
    pub albedo: Option<&'a Path>,
    /// True if the map next to the surface is ignored.
    pub one_albedo: bool,
    /// Parameters of the image.
    pub parameters: Value,
    /// Seed of the random streams of surface and noise; default: that of the specification, or 0.
    pub seed: Option<u64>,
    /// Output: a GeoTIFF, with a description next to it, or a PNG.
    pub output: &'a Path,
    /// How to write.
    pub options: WriteOptions,
}

/// Format of the output.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Output {
    Tiff,
    Png,
}

/// Renders an image and writes it. An item of a study with the same surface, parameters and explicit `seed` has the same bytes. Returns a description of the image.
///
/// # Errors
/// A surface or albedo that cannot be read, parameters out of range, a camera that sees no ground, a file that cannot be written.
pub fn render(request: &Request<'_>) -> Result<Value, Error> {
    let kind = images::kind();
    parameters::check(&request.parameters, &kind)?;
    let parameters: RenderParameters = read_parameters(&request.parameters)?;
    parameters.check()?;
    let output = output_of(request.output)?;
    let description = (output == Output::Tiff).then(|| request.output.with_extension("json"));
    let outputs: Vec<&Path> = [request.output].into_iter().chain(description.as_deref()).collect();
    outputs.iter().try_for_each(|path| check_file(path))?;
    let (ground, seed, notes) = ground(request, &outputs)?;
    let streams = Streams::for_seed(seed, STAGE);
    let file = request.output.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let made = images::make(&ground, &parameters, &streams, &file).map_err(|e| refused(request.surface, e))?;
    let files = match output {
        Output::Tiff => {
            Files { tif: Some(request.output.into()), json: description.as_deref().map(Into::into), png: None }
        }
        Output::Png => Files { tif: None, json: None, png: Some(request.output.into()) },
    };
    made.write(files, &ground.crs, &request.options)?;
    let mut said = described(request, &made, description.as_deref());
    said["seed"] = json!(seed);
    said["notes"] = json!(notes);
    Ok(said)
}

fn output_of(path: &Path) -> Result<Output, Error> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match ending.as_str() {
        "tif" | "tiff" => Ok(Output::Tiff),
        "png" => Ok(Output::Png),
        _ => Err(Error::Usage(format!("{}: images are written as .tif or .png", path.display()))),
    }
}

/// The surface with its albedo, the seed, and notes on how it was read.
fn ground(request: &Request<'_>, outputs: &[&Path]) -> Result<(Ground, u64, Vec<String>), Error> {
    let (mut ground, seed, notes) =
        if is_generator(request.surface) { generated(request)? } else { measured(request, outputs)? };
    if request.one_albedo {
        (ground.albedo, ground.albedo_name) = (None, None);
    }
    if let Some(path) = request.albedo {
        super::check_distinct(outputs, &[path])?;
        ground.albedo = Some(read(path, &Reading::default())?.dem.grid);
        ground.albedo_name = Some(path.display().to_string());
    }
    Ok((ground, seed, notes))
}

/// Whether a surface is generated: a name that is not a file is taken for a generator.
fn is_generator(surface: &str) -> bool {
    let is_spec = surface.to_ascii_lowercase().ends_with(".toml");
    is_spec || sastrugi_terrain::kinds().iter().any(|k| k.kind == surface) && !Path::new(surface).exists()
}

fn generated(request: &Request<'_>) -> Result<(Ground, u64, Vec<String>), Error> {
    let prepared = terrain::prepare(request.surface, request.set_surface, request.seed)?;
    let (made, crs) = prepared.make()?;
    // As it is read by an item of a study.
    let albedo = made.maps.iter().find(|map| map.name == "albedo").map(|map| map.values.as_stored());
    let albedo_name = albedo.as_ref().map(|_| "albedo".to_owned());
    let name = request.surface.to_owned();
    Ok((
        Ground { heights: made.heights.as_stored(), albedo, crs, name, albedo_name },
        prepared.seed(),
        prepared.notes(),
    ))
}

fn measured(request: &Request<'_>, outputs: &[&Path]) -> Result<(Ground, u64, Vec<String>), Error> {
    let path = Path::new(request.surface);
    super::check_distinct(outputs, &[path])?;
    if !request.set_surface.is_empty() {
        return Err(Error::Usage(format!("`--set-surface` applies to generators only; {} is a DEM", request.surface)));
    }
    let read = read(path, &request.reading)?;
    let beside: PathBuf = path.with_extension(ALBEDO_ENDING);
    let wanted = request.albedo.is_none() && !request.one_albedo;
    let albedo = if wanted { images::map(&beside)? } else { None };
    let albedo_name = albedo.as_ref().map(|_| beside.display().to_string());
    let crs: Crs = read.dem.info.crs;
    let name = request.surface.to_owned();
    Ok((Ground { heights: read.dem.grid, albedo, crs, name, albedo_name }, request.seed.unwrap_or(0), read.notes))
}

/// An unsuitable camera is bad usage; unusable surfaces and maps are bad input.
fn refused(surface: &str, error: RenderError) -> Error {
    match error {
        RenderError::Parameter(e) => e.into(),
        RenderError::NothingSeen => Error::Usage(format!("{surface}: {error}")),
        _ => Error::Input(format!("{surface}: {error}")),
    }
}

fn described(request: &Request<'_>, made: &Made, description: Option<&Path>) -> Value {
    let rendering = &made.rendering;
    json!({
        "file": request.output.display().to_string(),
        "description_file": description.map(|path| path.display().to_string()),
        "pixels": [made.shape()[1], made.shape()[0]],
        "mean_brightness": rendering.mean_brightness(),
        "share_in_shadow": rendering.share_in_shadow(),
        "share_without_ground": rendering.share_without_ground(),
        "png_white": made.png_white,
        "description": made.description,
    })
}
