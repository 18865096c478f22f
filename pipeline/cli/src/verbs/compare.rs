//! `compare`.

use super::cell;
use crate::Verdict;
use crate::args::{Common, Compare};
use crate::failure::{Code, Failure};
use crate::output::{columns, print};
use crate::progress::waiting;
use sastrugi_schemas::counted;
use sastrugi_stages::verbs::compare::{self, BlockEvidence, COPY_SIDE, Comparison, Copies, Quantity, Request, Side};
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
    let (by_statistics, cell_m) = (args.statistics, cell(args.cell.as_deref())?);
    let request = Request { a, b, by_statistics, parameters: params, seed: args.seed, cell_m };
    let (comparison, record) = waiting("comparing", common.quiet, || compare::compare(&request))?;
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
    if args.statistics {
        return Err(Failure::usage("--statistics applies to DEMs; releases are compared by their files and metrics"));
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
        ("with the same content, packaged differently", &files.packaging),
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
        if q.paired { counted(q.terrains[0], "pair") } else { format!("{}, {}", q.terrains[0], q.terrains[1]) };
    vec![
        q.group.clone(),
        q.name.to_owned(),
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
    let mut text = table(&comparison.quantities);
    if let Some(interleaved) = &comparison.interleaved {
        text.push_str(&format!("\ninterleaved blocks instead of halves:\n{}", table(interleaved)));
    }
    text.push_str(&format!("\n{}: {}", comparison.answer.name(), comparison.sentence));
    for q in &comparison.quantities {
        text.push_str(&format!("\n  {}: {}", q.name, q.why));
    }
    comparison.blocks.iter().for_each(|blocks| text.push_str(&format!("\n  {}", text_of_copies(blocks))));
    comparison.notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    text
}

/// The quantities; distances between parts of a site only where they are known.
fn table(quantities: &[Quantity]) -> String {
    let of_a_site = quantities.iter().any(|q| q.site.is_some());
    let site: &[&str] = if of_a_site { &["site: halves", "interleaved"] } else { &[] };
    let before = ["quantity", "A", "B", "difference"];
    let after = ["interval", "same within", "p (Holm)", "verdict"];
    let head: Vec<String> = before.iter().chain(site).chain(&after).map(|&name| name.to_owned()).collect();
    let rows = quantities.iter().map(|q| row(q, of_a_site));
    columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>())
}

fn row(q: &Quantity, of_a_site: bool) -> Vec<String> {
    let number = |v: Option<f64>| v.map_or_else(|| "-".to_owned(), |v| format!("{v:.4}"));
    let shown = |d: Option<f64>| d.map_or_else(|| "-".to_owned(), |d| q.shown(d));
    let mut cells = vec![q.name.clone(), number(q.a), number(q.b), shown(q.difference)];
    if of_a_site {
        cells.extend([q.site.and_then(|s| s.halves), q.site.and_then(|s| s.interleaved)].map(shown));
    }
    cells.extend([
        q.interval.map_or_else(|| "-".to_owned(), |[low, high]| format!("{} to {}", q.shown(low), q.shown(high))),
        q.bounds_shown(),
        q.p_adjusted.map_or_else(|| "-".to_owned(), |p| format!("{p:.3}")),
        q.answer.name().to_owned(),
    ]);
    cells
}

fn text_of_copies(blocks: &BlockEvidence) -> String {
    let found = |copies: &Copies| match copies.examined {
        0 => "- (no data)".to_owned(),
        _ => format!("{:.1} % (longest run {} cells)", 100.0 * copies.share, copies.longest_run_cells),
    };
    let copies = &blocks.copies;
    format!(
        "verbatim copies of {COPY_SIDE} x {COPY_SIDE} cells: from the site into the texture {}, within the texture {}, from one half of the \
         site into the other {}",
        found(&copies.of_site),
        found(&copies.of_itself),
        found(&copies.between_halves)
    )
}
