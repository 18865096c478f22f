//! Verb `photoclinometry`.

use super::options;
use crate::Verdict;
use crate::args::{Common, Photoclinometry};
use crate::failure::Code;
use crate::output::{columns, print, significant};
use crate::progress::waiting;
use sastrugi_stages::verbs::photoclinometry::{self, Request};
use serde_json::Value;

/// `photoclinometry`.
pub fn photoclinometry(args: &Photoclinometry, common: &Common) -> Verdict {
    let options = options(&args.writing, &args.output)?;
    let seed = args.seed.unwrap_or(0);
    let request = Request { images: &args.images, set: &args.set, seed, output: &args.output, options };
    let result = waiting("inverting", common.quiet, || photoclinometry::photoclinometry(&request))?;
    print(common.json, &result, &as_text(&result))?;
    Ok(Code::Done)
}

fn as_text(result: &Value) -> String {
    let head = ["iteration", "brightness RMS", "height change", "stereo points"].map(str::to_owned).to_vec();
    let rounds = result["rounds"].as_array().into_iter().flatten().enumerate().map(|(k, round)| {
        let number = |key: &str| round[key].as_f64().unwrap_or(f64::NAN);
        let rms = format!("{} %", significant(100.0 * number("brightness_rms")));
        vec![
            (k + 1).to_string(),
            rms,
            format!("{} m", significant(number("change_m"))),
            round["stereo_points"].to_string(),
        ]
    });
    let rows: Vec<Vec<String>> = [head].into_iter().chain(rounds).collect();
    let grid = &result["grid"];
    let mut text = format!(
        "{}\n{}: {} x {} cells; condition number {}, correlation of albedo and slopes {}",
        columns(&rows),
        result["file"].as_str().unwrap_or_default(),
        grid["cols"],
        grid["rows"],
        shown(&result["condition"]),
        shown(&result["albedo_slope_correlation"]),
    );
    if let Some(sigma) = result["height_sigma_m"].as_f64() {
        text.push_str(&format!(", standard deviation of heights {} m", significant(sigma)));
    }
    let evaluation = &result["evaluation"];
    if evaluation.is_object() {
        text.push_str(&format!(
            "\n  against the truth: shading correlation {} (ceiling {}), slope error {} RMS (ceiling {}), height error {} m RMS",
            shown(&evaluation["shaded_correlation"]),
            shown(&evaluation["shaded_correlation_ceiling"]),
            shown(&evaluation["slope_error_rms"]),
            shown(&evaluation["slope_error_rms_ceiling"]),
            shown(&evaluation["height_error_rms_m"]),
        ));
    }
    let strings = |key: &str| {
        result[key].as_array().into_iter().flatten().filter_map(Value::as_str).map(str::to_owned).collect::<Vec<_>>()
    };
    text.push_str(&format!("\n  maps: {}", strings("maps").join(", ")));
    strings("notes").iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    text
}

fn shown(value: &Value) -> String {
    value.as_f64().map_or_else(|| "-".to_owned(), significant)
}
