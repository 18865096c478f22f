//! `coregister`.

use super::{options, reading};
use crate::Verdict;
use crate::args::{Common, Coregister};
use crate::failure::{Code, Failure};
use crate::output::{columns, print};
use crate::progress::waiting;
use sastrugi_schemas::coregistration::Coregistration;
use sastrugi_stages::operations::coregistration::{rounds, verdict};
use sastrugi_stages::verbs::coregister::{self, Request};
use sastrugi_stages::verbs::{Reading, numbers};
use sastrugi_store::dem::WriteOptions;

/// `coregister`.
pub fn coregister(args: &Coregister, common: &Common) -> Verdict {
    let window = args.window.as_deref().map(|w| numbers::<4>("--window", w)).transpose()?;
    let options = match &args.output {
        Some(output) => options(&args.writing, output)?,
        None => WriteOptions::default(),
    };
    let reading = Reading { window, masks: args.masks.all(), ..reading(&args.reading)? };
    let request = Request { a: &args.a, b: &args.b, output: args.output.as_deref(), options, reading };
    let done = waiting("aligning", common.quiet, || coregister::coregister(&request))?;
    let mut text = describe(&done.coregistration);
    args.output.iter().for_each(|output| text.push_str(&format!("\n{}: A minus B", output.display())));
    done.notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    print(common.json, &serde_json::to_value(&done).map_err(Failure::failed)?, &text)?;
    Ok(Code::Done)
}

/// A co-registration as text: how B was moved, the difference before and after, and the verdict.
pub fn describe(c: &Coregistration) -> String {
    let moved = moves(c).map(|(name, value, error)| vec![name.to_owned(), value, error]);
    let head = ["B was", "by", "standard error"].map(str::to_owned).to_vec();
    let known = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{} m", fixed(v, 4)));
    let steps = [
        ("before", Some(c.median_before_m), c.nmad_before_m),
        ("raised and tilted", c.median_plane_m, c.nmad_plane_m),
        ("shifted as well", c.median_after_m, c.nmad_after_m),
    ];
    let steps = &steps[..if c.shift_m.is_some() { 3 } else { 2 }];
    let steps = steps.iter().map(|(name, median, nmad)| vec![(*name).to_owned(), known(*median), known(Some(*nmad))]);
    let spread = ["A - B", "median", "NMAD"].map(str::to_owned).to_vec();
    let rows: Vec<Vec<String>> = [head].into_iter().chain(moved).chain([Vec::new(), spread]).chain(steps).collect();
    let blocks =
        c.standard_errors.as_ref().map_or_else(String::new, |e| format!(", standard errors from {} blocks", e.blocks));
    let counts = format!("{} cells, {}{blocks}", c.cells, rounds(c));
    format!("{}\n\n{counts}\n{}", columns(&rows), verdict(c))
}

/// Formats with this number of decimals; zero without sign.
fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if text.contains(|c| matches!(c, '1'..='9')) { text } else { text.replace('-', "") }
}

/// Name, value and standard error of each move of B.
fn moves(c: &Coregistration) -> [(&'static str, String, String); 5] {
    let none = || "-".to_owned();
    let metres = |value: Option<f64>| value.map_or_else(none, |v| format!("{} m", fixed(v, 4)));
    let slope = |value: Option<f64>| value.map_or_else(none, |v| format!("{} m/m", fixed(v, 6)));
    let errors = c.standard_errors.as_ref();
    let shift = |k: usize| metres(c.shift_m.map(|s| s[k]));
    let shift_error = |k: usize| metres(errors.and_then(|e| e.shift_m).map(|e| e[k]));
    let tilt = |k: usize| (slope(Some(c.tilt[k])), slope(errors.map(|e| e.tilt[k])));
    let [(east, east_error), (north, north_error)] = [tilt(0), tilt(1)];
    [
        ("moved east", shift(0), shift_error(0)),
        ("moved north", shift(1), shift_error(1)),
        ("raised", metres(Some(c.raise_m)), metres(errors.map(|e| e.raise_m))),
        ("tilted up eastwards", east, east_error),
        ("tilted up northwards", north, north_error),
    ]
}
