//! `analyze`.

use crate::Verdict;
use crate::args::{Analyze, Common};
use crate::failure::{Code, Failure};
use crate::output::{columns, print, warn};
use sastrugi_schemas::tables::LogRow;
use sastrugi_schemas::{Record, counted};
use sastrugi_stages::Error;
use sastrugi_stages::verbs::analyze::{Judged, Request, write};
use sastrugi_stages::verbs::{LogSettings, numbers};
use serde_json::json;
use std::collections::BTreeSet;

/// `analyze`.
pub fn analyze(args: &Analyze, common: &Common) -> Verdict {
    let differentiator = serde_json::from_value(json!(args.differentiator)).map_err(|_| {
        Failure::usage(format!("`--differentiator {}`: must be second_difference or gradient", args.differentiator))
    })?;
    let settings = LogSettings {
        topic: args.topic.clone(),
        body_frame: args.body.clone(),
        fixed_frame: args.fixed.clone(),
        rate_hz: args.rate,
        band_hz: numbers::<2>("--band", &args.band)?,
        differentiator,
    };
    let mut once = BTreeSet::new();
    if let Some(twice) = args.logs.iter().find(|path| !once.insert(*path)) {
        return Err(Failure::usage(format!("{} is given twice", twice.display())));
    }
    let offset_m = numbers::<3>("--offset", &args.offset)?;
    let request = Request { settings, dem: args.dem.as_deref(), offset_m, group: args.group.clone() };
    let terrain = request.prepare()?;
    let (mut judged, mut refused): (Vec<Judged>, Vec<Error>) = (Vec::new(), Vec::new());
    for path in &args.logs {
        match request.judge(path, terrain.as_ref()) {
            Ok(one) => judged.push(one),
            Err(error) => refused.push(error),
        }
    }
    if judged.is_empty() {
        let mut refused = refused.into_iter();
        let first = refused.next().unwrap_or_else(|| Error::Usage("no logs".to_owned()));
        refused.for_each(|error| warn(&format!("sastrugi: {error}")));
        return Err(first.into());
    }
    refused.iter().for_each(|error| warn(&format!("sastrugi: {error}")));
    let rows: Vec<LogRow> = judged.iter().map(|one| one.row.clone()).collect();
    args.output.as_ref().map(|path| write(path, &rows)).transpose()?;
    let record: Vec<_> = judged.iter().map(|one| json!({ "log": one.row.to_json(), "notes": one.notes })).collect();
    let text: Vec<String> = judged.iter().map(text).collect();
    print(common.json, &json!(record), &text.join("\n\n"))?;
    let whole = refused.is_empty() && rows.iter().all(|row| row.broken.is_none());
    Ok(if whole { Code::Done } else { Code::Partial })
}

fn text(judged: &Judged) -> String {
    let Judged { row, notes } = judged;
    let verdict = |tells: bool| if tells { "" } else { "cannot tell" };
    let metric = |name: &str, value: f64, unit: &str, floor: f64, word: &str| {
        let cell = |v: f64| if v.is_finite() { format!("{v:.4}") } else { "-".to_owned() };
        vec![format!("  {name}"), cell(value), unit.to_owned(), cell(floor), word.to_owned()]
    };
    let plain = |name: &str, value: f64, unit: &str| metric(name, value, unit, f64::NAN, "");
    let band = format!("  vertical acceleration, {} to {} Hz", row.band_low_hz, row.band_high_hz);
    let mut rows = vec![
        ["  metric", "value", "", "noise floor", ""].map(str::to_owned).to_vec(),
        plain("time", row.time_s, "s"),
        plain("path length", row.path_length_m, "m"),
        metric(
            "vertical acceleration, RMS",
            row.rms_vertical_acceleration_m_s2,
            "m/s2",
            row.vertical_acceleration_floor_m_s2,
            verdict(row.vertical_acceleration_tells),
        ),
        metric(
            band.trim_start(),
            row.band_vertical_acceleration_m_s2,
            "m/s2",
            row.band_vertical_acceleration_floor_m_s2,
            &row.band_source.as_ref().map_or_else(String::new, |source| format!("from {source}")),
        ),
        metric(
            "pitch rate, RMS",
            row.rms_pitch_rate_deg_s,
            "deg/s",
            row.pitch_rate_floor_deg_s,
            verdict(row.pitch_rate_tells),
        ),
        metric(
            "roll rate, RMS",
            row.rms_roll_rate_deg_s,
            "deg/s",
            row.roll_rate_floor_deg_s,
            verdict(row.roll_rate_tells),
        ),
        plain("maximum pitch", row.max_pitch_deg, "deg"),
        plain("maximum roll", row.max_roll_deg, "deg"),
    ];
    if row.ground_share.is_finite() {
        rows.push(plain("minimum clearance", row.min_clearance_m, "m"));
        rows.push(plain("on class low", 100.0 * row.share_low, "%"));
        rows.push(plain("on class semi", 100.0 * row.share_semi, "%"));
        rows.push(plain("on class high", 100.0 * row.share_high, "%"));
    }
    let how = if row.resampled { "interpolated at" } else { "at" };
    let mut text = format!(
        "{}: {} ({}), {} samples {how} {} Hz\n{}",
        row.log_id,
        row.topic,
        row.message,
        row.samples,
        row.sample_rate_hz,
        columns(&rows)
    );
    if row.gaps > 0 {
        text.push_str(&format!("\n  {}, {:.2} s in total, not interpolated", counted(row.gaps, "gap"), row.gap_time_s));
    }
    notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    text
}
