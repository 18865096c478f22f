//! `compare`.

use super::cell;
use crate::Verdict;
use crate::args::{Common, Compare};
use crate::failure::{Code, Failure};
use crate::output::{columns, print};
use sastrugi_stages::verbs::compare::{self, Comparison, Quantity, Request, Side};
use sastrugi_stages::verbs::releases::{self, Files};
use sastrugi_stages::verbs::{numbers, parameters};
use serde_json::{Value, json};
use std::path::Path;

/// Maximum number of paths shown for each kind of difference.
const SHOWN: usize = 8;

/// `compare`.
pub fn compare(args: &Compare, common: &Common) -> Verdict {
    let mut params = json!({});
    parameters::assign(&mut params, &args.set)?;
    let numbers_given = [
        ("margin", args.margin),
        ("outer_scale_m", args.outer_scale),
        ("equivalence_sigma", args.equivalence_sigma),
        ("equivalence_range", args.equivalence_range),
        ("equivalence_anisotropy", args.equivalence_anisotropy),
        ("equivalence_heights", args.equivalence_heights),
    ];
    numbers_given.into_iter().filter_map(|(k, v)| Some((k, v?))).for_each(|(k, v)| params[k] = json!(v));
    args.simulations.iter().for_each(|n| params["simulations"] = json!(n));
    args.model.iter().for_each(|m| params["model"] = json!(m));
    if let Some(b) = args.b.as_deref().filter(|b| are_releases(&args.a, b)) {
        return of_releases(args, b, &params, common);
    }
    let window = |option: &str, text: &Option<String>| text.as_deref().map(|w| numbers::<4>(option, w)).transpose();
    let a = Side { path: &args.a, window: window("--window-a", &args.window_a)? };
    let b = match &args.b {
        Some(path) => Some(Side { path, window: window("--window-b", &args.window_b)? }),
        None => None,
    };
    let request = Request { a, b, parameters: params, seed: args.seed, cell_m: cell(args.cell.as_deref())? };
    let (comparison, record) = compare::compare(&request)?;
    print(common.json, &record, &text(&comparison))?;
    Ok(if args.fail_on_difference && comparison.differs() { Code::Difference } else { Code::Done })
}

/// A folder is a release; so is a missing path given together with a folder.
fn are_releases(a: &Path, b: &Path) -> bool {
    (a.is_dir() || b.is_dir()) && !a.is_file() && !b.is_file()
}

/// Two releases.
fn of_releases(args: &Compare, b: &Path, parameters: &Value, common: &Common) -> Verdict {
    if args.window_a.is_some() || args.window_b.is_some() || args.cell.is_some() {
        return Err(Failure::usage(
            "--window-a, --window-b and --cell apply to DEMs only; releases are compared in full",
        ));
    }
    let comparison = releases::compare(&args.a, b, parameters, args.seed)?;
    let record = serde_json::to_value(&comparison).map_err(Failure::failed)?;
    print(common.json, &record, &text_of_releases(&comparison))?;
    Ok(if args.fail_on_difference && comparison.differs() { Code::Difference } else { Code::Done })
}

fn text_of_releases(comparison: &releases::Comparison) -> String {
    let mut text = String::new();
    for (name, side) in ["A", "B"].iter().zip(&comparison.releases) {
        text.push_str(&format!("{name}: {} ({}, version {})\n", side.folder, side.name, side.version));
    }
    comparison.files.iter().for_each(|files| text.push_str(&text_of_files(files)));
    let interval = format!("{} % interval", 100.0 - 200.0 * comparison.parameters.alpha);
    let head = ["group", "metric", "terrains", "A", "B", "difference", &interval, "same within", "p (Holm)", "verdict"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(comparison.quantities.iter().map(row_of_releases));
    text.push_str(&format!("\n{}\n\n", columns(&rows)));
    text.push_str(&format!("{}: {}", comparison.answer.name(), comparison.sentence));
    comparison.notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    text
}

fn text_of_files(files: &Files) -> String {
    let mut text = format!("files: {} identical\n", files.equal);
    let kinds = [
        ("with the same content but other compression", &files.packaging),
        ("different", &files.different),
        ("only in A", &files.only_a),
        ("only in B", &files.only_b),
    ];
    for (what, paths) in kinds.into_iter().filter(|(_, paths)| !paths.is_empty()) {
        text.push_str(&format!("  {} {what}:", paths.len()));
        paths.iter().take(SHOWN).for_each(|path| text.push_str(&format!(" {path}")));
        text.push_str(if paths.len() > SHOWN { " ... (--json lists all)\n" } else { "\n" });
    }
    text
}

fn row_of_releases(q: &releases::Quantity) -> Vec<String> {
    let number = |v: Option<f64>| v.map_or_else(|| "-".to_owned(), |v| format!("{v:.4}"));
    let terrains =
        if q.paired { format!("{} pairs", q.terrains[0]) } else { format!("{}, {}", q.terrains[0], q.terrains[1]) };
    vec![
        q.group.clone(),
        q.figure.to_owned(),
        terrains,
        number(Some(q.a)),
        number(Some(q.b)),
        number(Some(q.difference)),
        q.interval.map_or_else(|| "-".to_owned(), |[low, high]| format!("{low:.4} to {high:.4}")),
        q.margin.map_or_else(|| "-".to_owned(), |margin| format!("+-{margin:.4}")),
        number(q.p_adjusted),
        q.answer.name().to_owned(),
    ]
}

fn text(comparison: &Comparison) -> String {
    let head = ["quantity", "A", "B", "difference", "interval", "same within", "p (Holm)", "verdict"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(comparison.quantities.iter().map(row));
    let mut text = columns(&rows);
    text.push_str(&format!("\n{}: {}", comparison.answer.name(), comparison.sentence));
    for q in &comparison.quantities {
        text.push_str(&format!("\n  {}: {}", q.name, q.why));
    }
    comparison.notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    text
}

fn row(q: &Quantity) -> Vec<String> {
    let number = |v: Option<f64>| v.map_or_else(|| "-".to_owned(), |v| format!("{v:.4}"));
    vec![
        q.name.clone(),
        number(q.a),
        number(q.b),
        q.difference.map_or_else(|| "-".to_owned(), |d| q.shown(d)),
        q.interval.map_or_else(|| "-".to_owned(), |[low, high]| format!("{} to {}", q.shown(low), q.shown(high))),
        q.bounds_shown(),
        q.p_adjusted.map_or_else(|| "-".to_owned(), |p| format!("{p:.3}")),
        q.answer.name().to_owned(),
    ]
}
