//! `navigate`.

use super::study::{finish_run, limits};
use crate::Verdict;
use crate::args::{Common, Navigate, Place};
use crate::failure::{Code, Failure};
use crate::output::{columns, print, significant};
use sastrugi_stages::verbs::navigate::{Request, is_route_file, release, route};
use sastrugi_stages::verbs::{numbers, parameters, traverse};
use serde_json::{Value, json};
use std::path::Path;

/// Plans a route, optionally with a team that follows it.
pub fn navigate(args: &Navigate, common: &Common) -> Verdict {
    let mut search = json!({ "method": args.method });
    parameters::assign(&mut search, &args.set)?;
    let team = |formation: &String| {
        let mut team = json!({ "formation": formation });
        parameters::assign(&mut team, &args.team).map(|()| team)
    };
    let request = Request {
        dem: &args.dem,
        start: numbers("--start", &args.start)?,
        goal: numbers("--goal", &args.goal)?,
        vehicle: args.vehicle.as_deref(),
        obstacles: &args.obstacles,
        route: search,
        team: args.formation.as_ref().map(team).transpose()?,
    };
    let Place { output, work } = &args.place;
    if is_route_file(output) {
        return route_alone(&request, output, common);
    }
    let place = traverse::Place { output, work: work.as_deref(), replace: args.replace, limits: limits(None)? };
    finish_run(common, |reporter| Ok(release(&request, &args.date, &place, reporter)?))
}

fn route_alone(request: &Request<'_>, output: &Path, common: &Common) -> Verdict {
    let result = route(request, output)?;
    let rows = result["route"].as_object().ok_or_else(|| Failure::failed("the route has no metrics"))?;
    let rows: Vec<Vec<String>> = rows.iter().map(|(name, value)| vec![format!("  {name}"), shown(value)]).collect();
    let mut text = format!("{}\n{}", output.display(), columns(&rows));
    for note in result["notes"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        text.push_str(&format!("\n  note: {note}"));
    }
    print(common.json, &result, &text)?;
    Ok(Code::Done)
}

fn shown(value: &Value) -> String {
    match value.as_f64() {
        Some(number) if !value.is_u64() => significant(number),
        _ => value.to_string(),
    }
}
