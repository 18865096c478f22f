//! Verbs on single files.

use super::{lerobot, options, reading};
use crate::Verdict;
use crate::args::{self, Common, Convert, Info, Target};
use crate::failure::{Code, Failure};
use crate::output::{columns, print};
use sastrugi_schemas::counted;
use sastrugi_stages::operations::dem::to_metres;
use sastrugi_stages::studies;
use sastrugi_stages::verbs::{self, Read, Reading, describe_grid, numbers, read_as_it_is, transects};
use sastrugi_store::dem::simulators::{self, Fit};
use sastrugi_store::dem::{self, Dem, DemError, MeshLimits, Values};
use sastrugi_store::release::Release;
use sastrugi_store::transect::Transects;
use sastrugi_store::{mcap, mechanism};
use serde_json::{Value, json};
use std::path::Path;

fn failure(error: DemError) -> Failure {
    match error {
        DemError::Unfit { .. } => Failure::usage(error.to_string()),
        _ if error.unusable_input() => Failure::input(error),
        _ => Failure::failed(error),
    }
}

/// `convert`.
pub fn convert(args: &Convert, common: &Common) -> Verdict {
    if args.target == Some(Target::Lerobot) {
        return lerobot::convert(args, common);
    }
    lerobot::check_unused(args)?;
    let simulator = args.simulator();
    let of_vehicle = mechanism::Format::of_name(&args.output).filter(|_| simulator.is_none());
    if let Some(format) = of_vehicle {
        return convert_vehicle(args, format, common);
    }
    let output = args.output.display();
    let name = args.input.to_string_lossy();
    if verbs::vehicle::is_known(&name) && !args.input.exists() {
        let message = format!("{output}: {name} is a vehicle; a vehicle is written as {}", mechanism::WRITTEN_ENDINGS);
        return Err(Failure::usage(message));
    }
    let mut options = options(&args.writing, &args.output)?;
    let format = dem::Format::of_name(&args.output);
    let limits = mesh_limits(args, format)?;
    match (simulator, format) {
        (Some(_), _) if args.output.exists() && !args.output.is_dir() => {
            return Err(Failure::usage(format!("{output} is a file; with --for, OUT must be a folder")));
        }
        (None, None) => {
            let message = format!(
                "{output}: unknown extension; DEMs are written as {}, vehicles as {}",
                dem::WRITTEN_ENDINGS,
                mechanism::WRITTEN_ENDINGS
            );
            return Err(Failure::usage(message));
        }
        _ => {}
    }
    let window = args.window.as_deref().map(|w| numbers::<4>("--window", w)).transpose()?;
    let reading = Reading { window, masks: args.masks.all(), ..reading(&args.reading)? };
    simulator.map_or(Ok(()), |simulator| simulators::check_folder(&args.output, simulator)).map_err(failure)?;
    let Read { dem, notes, .. } = read_as_it_is(&args.input, &reading)?;
    let geographic = dem.info.crs.geographic;
    let in_metres = simulator.is_some() || format.is_some_and(dem::Format::in_metres);
    let (Dem { grid, info }, converted) = if in_metres { to_metres(dem) } else { (dem, None) };
    let lost = match simulator {
        Some(simulator) => {
            let fit = if args.crop { Fit::Crop } else { Fit::Resample };
            let export = if geographic { simulators::export_from_degrees } else { simulators::export };
            let export = export(&grid, simulator, fit, limits.as_ref()).map_err(failure)?;
            simulators::write(&args.output, &export).map_err(failure)?;
            export.notes
        }
        None => {
            options.values = info.values;
            let decimated = limits.map(|limits| dem::decimate(&args.output, &grid, &limits)).transpose();
            options.decimation = decimated.map_err(failure)?;
            dem::write(&args.output, &grid, &info.crs, &options).map_err(failure)?
        }
    };
    let notes: Vec<&String> = notes.iter().chain(&converted).chain(&lost).collect();
    let mut text = format!("{output}: {} x {} cells", grid.rows(), grid.cols());
    notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    let mut result = json!({ "file": args.output, "grid": describe_grid(&grid), "notes": notes });
    if let Some(decimation) = &options.decimation {
        result["mesh"] = decimation.to_json();
    }
    print(common.json, &result, &text)?;
    Ok(Code::Done)
}

/// Limits of a mesh; refuses them for outputs without a mesh.
fn mesh_limits(args: &Convert, format: Option<dem::Format>) -> Result<Option<MeshLimits>, Failure> {
    if args.surface.is_some() {
        let endings = mechanism::WRITTEN_ENDINGS;
        return Err(Failure::usage(format!(
            "{}: --surface applies to vehicles only ({endings})",
            args.output.display()
        )));
    }
    let limits = MeshLimits { error_max_m: args.max_error, triangles_max: args.triangles };
    if limits == MeshLimits::default() {
        return Ok(None);
    }
    let has_mesh = args.simulator().map_or(format.is_some_and(dem::Format::is_mesh), simulators::has_mesh);
    if has_mesh {
        return Ok(Some(limits));
    }
    let message = "--max-error and --triangles apply to meshes only: .obj, .glb, .usda, and --for gazebo or isaac";
    Err(Failure::usage(format!("{}: {message}", args.output.display())))
}

/// `convert` of a vehicle.
fn convert_vehicle(args: &Convert, format: mechanism::Format, common: &Common) -> Verdict {
    let output = args.output.display();
    let is_of_dem = args.window.is_some() || !args.masks.all().is_empty() || args.writing.cog;
    if is_of_dem || args.max_error.is_some() || args.triangles.is_some() {
        return Err(Failure::usage(format!(
            "{output}: the only option for a vehicle is --surface; the others apply to DEMs"
        )));
    }
    let name = args.input.to_string_lossy();
    let (vehicle, doubts) = verbs::vehicle::mechanism(&name, args.surface.as_deref())?;
    mechanism::write(&args.output, &vehicle, format).map_err(|e| Failure::failed(format!("{output}: {e}")))?;
    let notes: Vec<String> = doubts.into_iter().chain(mechanism::notes(&vehicle, format)).collect();
    let joints = vehicle.links.iter().map(|link| link.joints.len()).sum::<usize>();
    let mass_kg = vehicle.links.iter().map(|link| link.mass_kg).sum::<f64>();
    let mut text = format!("{output}: {}, {mass_kg:.3} kg, {}", vehicle.name, counted(joints, "joint"));
    notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    let result = json!({
        "file": args.output,
        "vehicle": vehicle.name,
        "format": format.name(),
        "mass_kg": mass_kg,
        "links": vehicle.links.len(),
        "joints": joints,
        "standing_height_m": vehicle.standing_height_m,
        "tyre_sag_m": vehicle.tyre_sag_m,
        "notes": notes,
    });
    print(common.json, &result, &text)?;
    Ok(Code::Done)
}

/// `hillshade`.
pub fn hillshade(args: &args::Hillshade, common: &Common) -> Verdict {
    let read = verbs::read(&args.dem, &reading(&args.reading)?)?;
    let result = verbs::hillshade::hillshade(&read, &args.output, args.pixels, args.exaggeration)?;
    let [cols, rows] = [&result["pixels"][0], &result["pixels"][1]];
    let mut text =
        format!("{}: {cols} x {rows} pixels, slopes exaggerated by {}", args.output.display(), result["exaggeration"]);
    read.notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    print(common.json, &result, &text)?;
    Ok(Code::Done)
}

/// `info`.
pub fn info(args: &Info, common: &Common) -> Verdict {
    let extension = args.path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let result = match extension.as_str() {
        _ if !args.path.exists() => return Err(Failure::input(format!("{}: no such file", args.path.display()))),
        _ if args.path.join(mcap::BAG).is_file() => mcap::describe_bag(&args.path).map_err(Failure::input)?,
        _ if holds_parquet(&args.path) => {
            let message = "a folder of Parquet files; name one of them, or the release that it belongs to";
            return Err(Failure::input(format!("{}: {message}", args.path.display())));
        }
        _ if args.path.is_dir() => release(&args.path)?,
        "mcap" => mcap::describe_file(&args.path).map_err(Failure::input)?,
        "parquet" => sastrugi_store::parquet::describe_file(&args.path).map_err(Failure::input)?,
        "json" => fit(&args.path)?,
        _ => raster(&args.path, &args.reading)?,
    };
    let notes = result["notes"].as_array().cloned().unwrap_or_default();
    let is_stated = |value: &Value| !value.is_null() && value.as_str() != Some("");
    let rows = result.as_object().into_iter().flatten().filter(|(key, value)| *key != "notes" && is_stated(value));
    let rows: Vec<Vec<String>> = rows.map(|(key, value)| vec![key.clone(), plain(value)]).collect();
    let mut text = columns(&rows);
    notes.iter().for_each(|note| text.push_str(&format!("\n  note: {}", plain(note))));
    print(common.json, &result, &text)?;
    Ok(Code::Done)
}

fn holds_parquet(folder: &Path) -> bool {
    let mut entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.any(|entry| entry.path().extension().is_some_and(|ending| ending == "parquet"))
}

fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

fn raster(path: &Path, settings: &args::Reading) -> Result<Value, Failure> {
    let reading = reading(settings)?;
    if let Some(found) = transects(path, &reading)? {
        return Ok(describe_transects(&found));
    }
    let read = read_as_it_is(path, &reading)?.dem;
    let info = &read.info;
    let mut result = json!({
        "what": if info.values == Values::Heights { "elevation raster" } else { "raster" },
        "format": info.format.name(),
        "dtype": info.dtype,
        "nodata": info.nodata,
        "values": info.values.description(),
        "unit": info.values.unit(),
        "coordinates": if info.crs.geographic { "degrees" } else { "m" },
        "epsg": info.crs.epsg,
        "crs": info.crs.name,
        "pixel_is_point": info.pixel_is_point,
    });
    if let (Some(all), Some(grid)) = (result.as_object_mut(), describe_grid(&read.grid).as_object()) {
        let name = |key: &str| match key.strip_prefix("height_") {
            Some(rest) if info.values.unit() != Some("m") => format!("value_{}", rest.trim_end_matches("_m")),
            _ => key.to_owned(),
        };
        all.extend(grid.iter().map(|(key, value)| (name(key), value.clone())));
        let share = read.grid.finite_count() as f64 / (read.grid.geometry.len() as f64).max(1.0);
        all.insert("valid_share".to_owned(), json!((1e4 * share).round() / 1e4));
        all.insert("heights_sha256".to_owned(), json!(sastrugi_store::digest::heights(&read.grid)));
        all.insert("notes".to_owned(), json!(info.notes));
    }
    Ok(result)
}

fn describe_transects(found: &Transects) -> Value {
    let heights = || found.profiles.iter().flatten();
    json!({
        "what": "transects",
        "profiles": found.names,
        "heights_each": found.profiles.first().map_or(0, Vec::len),
        "spacing_m": found.spacing_m,
        "missing": heights().filter(|z| z.is_nan()).count(),
        "height_min_m": heights().copied().reduce(f64::min),
        "height_max_m": heights().copied().reduce(f64::max),
    })
}

fn fit(path: &Path) -> Result<Value, Failure> {
    let fit = sastrugi_stages::verbs::texture::read_fit(path)?;
    Ok(json!({
        "what": "covariance fit",
        "mode": fit.mode,
        "model": fit.model,
        "verdict": fit.verdict,
        "parameters": fit.parameters,
        "window_m": fit.window_m,
        "bins": fit.lags_m.len(),
        "source": fit.source.map(|s| s.file),
        "warnings": fit.warnings,
    }))
}

fn release(path: &Path) -> Result<Value, Failure> {
    let release = Release::open(path).map_err(Failure::input)?;
    let manifest = release.manifest();
    let head = studies::head_of(path);
    let notes: Vec<String> = head.as_ref().err().map(ToString::to_string).into_iter().collect();
    let head = head.ok();
    Ok(json!({
        "what": "release",
        "name": manifest.name,
        "version": head.as_ref().and_then(|head| head.version.as_deref()),
        "date": head.as_ref().map(|head| &head.date),
        "doi": head.as_ref().and_then(|head| head.doi.as_deref()),
        "program": format!("{} {}", manifest.program, manifest.version),
        "seed": manifest.seed,
        "license": manifest.license,
        "study_sha256": manifest.study_sha256,
        "files": manifest.artifacts.len(),
        "bytes": manifest.artifacts.iter().map(|a| a.bytes).sum::<u64>(),
        "failed_items": manifest.failed.len(),
        "notes": notes,
    }))
}
