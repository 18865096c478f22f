//! `rover`.

use super::study::{code, limits, watch};
use crate::Verdict;
use crate::args::{Common, Place, Rover};
use crate::failure::Failure;
use crate::output::{columns, print, significant};
use sastrugi_schemas::counted;
use sastrugi_schemas::tables::RoverEffectRow;
use sastrugi_stages::studies::{self, RunRequest};
use sastrugi_stages::verbs::rover::{Estimated, PURPOSE, Request, Summary, load, share, summary};
use std::collections::BTreeMap;

/// Maximum number of parameters in a printed ranking.
const RANKED: usize = 10;

/// Drives the rovers of a study.
pub fn rover(args: &Rover, common: &Common) -> Verdict {
    let share = args.perturb.as_deref().map(share).transpose()?;
    let limits = limits(args.memory)?;
    let rovers = load(&args.study, &Request { share, trajectories: args.trajectories })?;
    let Place { output, work } = &args.place;
    let (work, replace) = (work.as_deref(), args.replace);
    rovers.check_destination(output, replace)?;
    let request = RunRequest { output, work, part: None, purpose: Some(PURPOSE), replace, limits };
    let (run, mut text) = watch(common, |reporter| Ok(studies::run(&rovers.loaded, &request, reporter)?))?;
    let summary = summary(&run.output)?;
    text.push_str("\n\n");
    text.push_str(&trials(&summary));
    for ranking in rankings(&summary.ranking) {
        text.push_str("\n\n");
        text.push_str(&ranking);
    }
    if !summary.ranking.is_empty() {
        text.push_str(
            "\nmu: mean effect; mu*: mean absolute effect, by which parameters are ranked; sigma: standard deviation between trajectories;\n\
             noise: the mu* to expect from changed paths alone.",
        );
    }
    let mut json = serde_json::to_value(&run).map_err(Failure::failed)?;
    json["trials"] = serde_json::to_value(&summary.trials).map_err(Failure::failed)?;
    json["effects"] = summary.effects.into();
    print(common.json, &json, &text)?;
    Ok(code(&run))
}

/// One line per trial.
fn trials(summary: &Summary) -> String {
    let heads = [
        "stage",
        "terrains",
        "variant",
        "rovers",
        "worlds",
        "arrived",
        "(95 %)",
        "mean e",
        "(95 %)",
        "e of arrived",
        "d0/mean d",
        "at limit",
        "off ground",
    ];
    let mut rows = vec![heads.map(str::to_owned).to_vec()];
    for trial in &summary.trials {
        let or_dash = |text: &Option<String>| text.clone().unwrap_or_else(|| "-".to_owned());
        rows.push(vec![
            trial.stage_id.clone(),
            or_dash(&trial.group),
            or_dash(&trial.variant),
            trial.rovers.to_string(),
            trial.worlds.to_string(),
            format!("{:.3}", trial.arrival.estimate),
            range(&trial.arrival),
            format!("{:.3}", trial.efficiency.estimate),
            range(&trial.efficiency),
            if trial.arrived == 0 { "-".to_owned() } else { format!("{:.3}", trial.efficiency_of_arrivals) },
            format!("{:.3}", trial.straight_over_mean_distance),
            trial.at_limit.to_string(),
            trial.off_ground.to_string(),
        ]);
    }
    let note = "e: straight line over distance driven plus distance left; d0/mean d: straight line over mean distance driven. Intervals resample worlds, not\n\
                rovers. Rovers stopped at a limit have censored distances, so d0/mean d depends on the limit. Rovers that left the ground count as e = 0.";
    format!("{}\n{note}", columns(&rows))
}

fn range(of: &Estimated) -> String {
    if of.low.is_nan() { "-".to_owned() } else { format!("{:.3} to {:.3}", of.low, of.high) }
}

/// One table per stage and group: effects on efficiency and arrival of changing each parameter by one share.
fn rankings(rows: &[RoverEffectRow]) -> Vec<String> {
    let mut groups: BTreeMap<_, Vec<&RoverEffectRow>> = BTreeMap::new();
    rows.iter().for_each(|row| groups.entry((&row.stage_id, &row.group, &row.variant)).or_default().push(row));
    groups.values().map(|rows| ranking(rows)).collect()
}

fn ranking(rows: &[&RoverEffectRow]) -> String {
    let of = |measure: &str| rows.iter().filter(|row| row.measure == measure).copied().collect::<Vec<_>>();
    let (efficiency, arrival) = (of("efficiency"), of("arrival"));
    let heads = [
        "  parameter",
        "value",
        "e: mu*",
        "(95 %)",
        "mu",
        "(95 %)",
        "sigma",
        "noise",
        "arrival: mu*",
        "(95 %)",
        "mu",
        "(95 %)",
    ];
    let mut lines = vec![heads.map(str::to_owned).to_vec()];
    let (some, none): (Vec<&RoverEffectRow>, Vec<_>) = efficiency.iter().partition(|row| row.mu_star > 0.0);
    for row in some.iter().take(RANKED) {
        let Some(arrives) = arrival.iter().find(|other| other.parameter == row.parameter) else { continue };
        let per = |value: f64| per_share(value, row.share);
        let range = |low: f64, high: f64| match low.is_nan() {
            true => "-".to_owned(),
            false => format!("{} to {}", per(low), per(high)),
        };
        let star = |row: &RoverEffectRow| range(row.mu_star_low, row.mu_star_high);
        let signed = |row: &RoverEffectRow| range(row.mu_low, row.mu_high);
        lines.push(vec![
            format!("  {}", row.parameter),
            base(row),
            per(row.mu_star),
            star(row),
            per(row.mu),
            signed(row),
            per(row.sigma),
            per(row.mu_star_noise),
            per(arrives.mu_star),
            star(arrives),
            per(arrives.mu),
            signed(arrives),
        ]);
    }
    let Some(first) = efficiency.first() else { return String::new() };
    let mut rest = String::new();
    if some.len() > RANKED {
        rest.push_str(&format!("\n  and {} with smaller effects (--json lists all)", some.len() - RANKED));
    }
    if !none.is_empty() {
        let names: Vec<&str> = none.iter().map(|row| row.parameter.as_str()).collect();
        rest.push_str(&format!("\n  no effect on e: {}", names.join(", ")));
    }
    format!(
        "{}: change for {} % of each parameter, {}, {}, {} in each\n{}{rest}",
        [&first.stage_id, &first.group, &first.variant].map(String::as_str).join(" ").trim_end(),
        significant(100.0 * first.share).trim_end_matches('0').trim_end_matches('.'),
        counted(first.trajectories, "trajectory"),
        counted(first.worlds, "world"),
        counted(first.rovers, "rover"),
        columns(&lines)
    )
}

/// The change caused by one share of a parameter.
fn per_share(value: f64, share: f64) -> String {
    if value.is_nan() {
        return "-".to_owned();
    }
    let text = format!("{:.4}", value * share);
    if text == "-0.0000" { "0.0000".to_owned() } else { text }
}

fn base(row: &RoverEffectRow) -> String {
    match (row.base.is_nan(), row.unit.as_str()) {
        (true, _) => "list".to_owned(),
        (false, "1") => row.base.to_string(),
        (false, unit) => format!("{} {unit}", row.base),
    }
}
