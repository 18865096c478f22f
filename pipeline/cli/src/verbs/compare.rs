//! `compare`.

use super::cell;
use crate::Verdict;
use crate::args::{Common, Compare};
use crate::failure::Code;
use crate::output::{columns, print};
use sastrugi_stages::verbs::compare::{self, Comparison, Quantity, Request, Side};
use sastrugi_stages::verbs::{numbers, parameters};
use serde_json::json;

/// `compare`.
pub fn compare(args: &Compare, common: &Common) -> Verdict {
    let mut params = json!({});
    parameters::assign(&mut params, &args.set)?;
    let numbers_given = [
        ("outer_scale_m", args.outer_scale),
        ("equivalence_sigma", args.equivalence_sigma),
        ("equivalence_range", args.equivalence_range),
        ("equivalence_anisotropy", args.equivalence_anisotropy),
        ("equivalence_heights", args.equivalence_heights),
    ];
    numbers_given.into_iter().filter_map(|(k, v)| Some((k, v?))).for_each(|(k, v)| params[k] = json!(v));
    args.simulations.iter().for_each(|n| params["simulations"] = json!(n));
    args.model.iter().for_each(|m| params["model"] = json!(m));
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

fn text(comparison: &Comparison) -> String {
    let head = ["quantity", "A", "B", "difference", "interval", "same within", "p (Holm)", "answer"];
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
