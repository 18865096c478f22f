//! Verb `render`.

use super::{options, reading};
use crate::Verdict;
use crate::args::{Common, Render};
use crate::failure::Code;
use crate::output::{print, significant};
use crate::progress::waiting;
use sastrugi_stages::Error;
use sastrugi_stages::verbs::{self, numbers, parameters};
use serde_json::{Value, json};
use std::path::Path;

/// `render`.
pub fn render(args: &Render, common: &Common) -> Verdict {
    let [azimuth_deg, elevation_deg] = numbers::<2>("--sun", &args.sun).map_err(|_| {
        Error::Usage(format!(
            "`--sun {}`: expected azimuth and elevation in degrees, such as `--sun 120,20` for a sun in the south-east, 20 degrees above the horizon",
            args.sun
        ))
    })?;
    let mut params = json!({
        "sun": { "azimuth_deg": azimuth_deg, "elevation_deg": elevation_deg },
        "camera": camera(&args.camera, args.size.as_deref())?,
    });
    let one_albedo = args.albedo.as_deref().and_then(|albedo| albedo.parse::<f64>().ok());
    if let Some(albedo) = one_albedo {
        params["albedo"] = json!(albedo);
    }
    parameters::assign(&mut params, &args.set)?;
    let request = verbs::render::Request {
        surface: &args.surface,
        reading: reading(&args.reading)?,
        set_surface: &args.set_surface,
        albedo: args.albedo.as_deref().filter(|_| one_albedo.is_none()).map(Path::new),
        one_albedo: one_albedo.is_some(),
        parameters: params,
        seed: args.seed,
        output: &args.output,
        options: options(&args.writing, &args.output)?,
    };
    let result = waiting("rendering", common.quiet, || verbs::render::render(&request))?;
    print(common.json, &result, &as_text(&result))?;
    Ok(Code::Done)
}

fn as_text(result: &Value) -> String {
    let number = |key: &str| result[key].as_f64().unwrap_or(f64::NAN);
    let percent = |key: &str| format!("{:.1} %", 100.0 * number(key));
    let mut text = format!(
        "{}: {} x {} pixels, mean brightness {}; {} of the visible ground in shadow, {} of the image without ground",
        result["file"].as_str().unwrap_or_default(),
        result["pixels"][0],
        result["pixels"][1],
        significant(number("mean_brightness")),
        percent("share_in_shadow"),
        percent("share_without_ground"),
    );
    if let Some(file) = result["description_file"].as_str() {
        text.push_str(&format!("\n  {file}: sun and camera"));
    }
    let notes = result["notes"].as_array().into_iter().flatten().filter_map(Value::as_str);
    notes.for_each(|note| text.push_str(&format!("\n  note: {note}")));
    text
}

/// The parameters of a camera.
fn camera(text: &str, size: Option<&str>) -> Result<Value, Error> {
    let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
    let refused = || {
        Error::Usage(format!(
            "`--camera {text}`: expected nadir[:PIXEL_M], parallel:AZ,EL[,PIXEL_M] or pinhole:X,Y,Z,TO_X,TO_Y,TO_Z[,FOV_DEG]"
        ))
    };
    let words = rest.split(',').filter(|_| !rest.is_empty());
    let values: Vec<f64> = words.map(|w| w.trim().parse().map_err(|_| refused())).collect::<Result<_, _>>()?;
    let mut camera = match (kind, &values[..]) {
        ("nadir", []) => json!({ "kind": kind }),
        ("nadir", [pixel_m]) => json!({ "kind": kind, "pixel_m": pixel_m }),
        ("parallel", [azimuth, elevation]) => {
            json!({ "kind": kind, "azimuth_deg": azimuth, "elevation_deg": elevation })
        }
        ("parallel", [azimuth, elevation, pixel_m]) => {
            json!({ "kind": kind, "azimuth_deg": azimuth, "elevation_deg": elevation, "pixel_m": pixel_m })
        }
        ("pinhole", [x, y, z, to_x, to_y, to_z]) => {
            json!({ "kind": kind, "position_m": [x, y, z], "target_m": [to_x, to_y, to_z] })
        }
        ("pinhole", [x, y, z, to_x, to_y, to_z, fov]) => {
            json!({ "kind": kind, "position_m": [x, y, z], "target_m": [to_x, to_y, to_z], "field_of_view_deg": fov })
        }
        _ => return Err(refused()),
    };
    match size {
        Some(_) if kind == "nadir" => {
            return Err(Error::Usage(
                "`--size` applies to parallel and pinhole cameras only; nadir covers the surface".to_owned(),
            ));
        }
        Some(size) => camera["size_px"] = json!(pixels(size)?),
        None => {}
    }
    Ok(camera)
}

/// Columns and rows.
fn pixels(size: &str) -> Result<[u64; 2], Error> {
    let whole = |v: f64| (v.fract() == 0.0 && (1.0..1e9).contains(&v)).then_some(v as u64);
    let [cols, rows] = numbers::<2>("--size", size)?.map(whole);
    cols.zip(rows)
        .map(|(cols, rows)| [cols, rows])
        .ok_or_else(|| Error::Usage(format!("`--size {size}`: columns and rows must be whole numbers above 0")))
}
