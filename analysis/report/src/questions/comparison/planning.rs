//! Size of the next study: power of the tests by number of terrains and missions, from the scatter of this study.

use super::ALPHA;
use super::values::{Metric, Values, common_missions, share_pairs};
use crate::content::{Block, Numbers, TableBlock, count, number, text};
use crate::data::Data;
use crate::questions::clusters::{Pairing, stream};
use crate::questions::sql;
use crate::render::number as set;
use sastrugi_numeric::sums;
use sastrugi_statistics::power::Target;
use sastrugi_statistics::{Components, components};

/// Terrains in each group (or blocks), and missions on each.
const TERRAINS: [usize; 4] = [10, 20, 40, 80];
const MISSIONS: [usize; 3] = [5, 20, 80];
/// Difference of success to detect, percentage points.
const POINTS: f64 = 10.0;
/// Difference of the other metrics to detect, as a share of their mean.
const SHARE: f64 = 0.1;

/// The table and its assumptions; empty where the scatter cannot be split into components.
pub fn blocks(data: &Data, metrics: &[Metric], pairing: &Pairing) -> Vec<Block> {
    let table = table(data, metrics, pairing);
    if table.numbers.rows.is_empty() {
        return Vec::new();
    }
    let constant: Vec<&str> = metrics
        .iter()
        .filter(|metric| target(metric, pairing).is_some_and(|target| !varies(&target)))
        .map(|metric| metric.name)
        .collect();
    let left_out = match constant[..] {
        [] => String::new(),
        _ => {
            format!(" No power is given without scatter between terrains or between missions: {}.", constant.join(", "))
        }
    };
    let units = if pairing.is_common() { "blocks of paired terrains" } else { "terrains in each of two groups" };
    let [of_blocks, of_both] = match pairing.is_common() {
        true => [" (of a block's differences between groups)", " (of a pair's difference)"],
        false => [""; 2],
    };
    let words = format!(
        "The table gives the power of a study by its number of {units}: how often it would detect a difference of {} percentage \
         points in success, or of a tenth of another metric's mean, at {} % without adjustment, if terrains and missions scatter \
         as they do here. Power is simulated with the test above on normally distributed terrain means and is accurate to about \
         3 points. Scatter is a standard deviation: between terrains{of_blocks}, and between missions on one terrain{of_both}. \
         More missions on the same terrains help only with the scatter between missions.{left_out}",
        set::fixed(POINTS, 0),
        set::fixed(100.0 * ALPHA, 0)
    );
    vec![Block::Heading("How many terrains does the next study need?".into()), Block::Text(words), Block::Table(table)]
}

fn table(data: &Data, metrics: &[Metric], pairing: &Pairing) -> TableBlock {
    let units = if pairing.is_common() { "blocks" } else { "terrains per group" };
    let heads = MISSIONS.map(|m| format!("{m} missions each"));
    let fixed = [("metric", ""), ("unit", ""), ("difference", ""), ("scatter between", ""), ("scatter within", "")];
    let columns: Vec<(&str, &str)> =
        fixed.into_iter().chain([(units, "")]).chain(heads.iter().map(|h| (h.as_str(), "%"))).collect();
    let mut numbers = Numbers::computed(sql::compared(data), &columns).with_mixed_units();
    for metric in metrics {
        let Some(target) = target(metric, pairing).filter(varies) else { continue };
        let mut stream = stream(data, "power", metric.column);
        for terrains in TERRAINS {
            let power = MISSIONS.map(|missions| {
                let share = if pairing.is_common() {
                    target.of_pairs(terrains, missions, ALPHA, &mut stream)
                } else {
                    target.of_groups(terrains, missions, ALPHA, &mut stream)
                };
                number((100.0 * share).round())
            });
            let deviation = |variance: f64| number(variance.max(0.0).sqrt());
            let head = [
                text(metric.name),
                text(metric.unit),
                number(target.difference),
                deviation(target.between),
                deviation(target.within),
                count(terrains),
            ];
            numbers.row(head.into_iter().chain(power));
        }
    }
    let caption = "Power of the next study by number of missions on a terrain".into();
    TableBlock { id: "comparison-power".into(), caption, numbers }
}

/// Difference to detect and its scatter: from the differences of neighbouring groups if they are paired, otherwise within groups.
fn target(metric: &Metric, pairing: &Pairing) -> Option<Target> {
    let all: Vec<f64> = metric.groups.iter().flat_map(Values::numbers).collect();
    let difference = if metric.column == "success" { POINTS } else { SHARE * sums::mean(&all).abs() };
    let scatter = if pairing.is_common() { paired_scatter(metric) } else { scatter(metric) };
    let (between, within) = scatter?;
    (difference > 0.0).then_some(Target { difference, between, within })
}

/// True if there is scatter beyond rounding. Without any, the power of every study would be 100 %.
fn varies(target: &Target) -> bool {
    (target.between.max(0.0) + target.within.max(0.0)).sqrt() > 1e-9 * target.difference
}

/// Variance between the terrains of a group, and between the missions of a terrain.
pub fn scatter(metric: &Metric) -> Option<(f64, f64)> {
    let of_group = |g: &Values| components::Group::of(&g.terrains.values().cloned().collect::<Vec<_>>());
    Components::within_groups(&metric.groups.iter().map(of_group).collect::<Vec<_>>())
}

/// Variance of the differences of neighbouring groups between blocks, and between the missions of a block; means over the
/// neighbours. Where groups share pairs, missions are paired too, and the scatter is that of their differences. `None` where no
/// neighbours share blocks.
fn paired_scatter(metric: &Metric) -> Option<(f64, f64)> {
    let of_neighbours = |pair: &[Values]| {
        let groups = [&pair[0], &pair[1]];
        // Without pairs, the missions of two groups have no common order.
        let blocks = if share_pairs(&groups) { common_missions(&groups) } else { Vec::new() };
        let differences: Vec<Vec<f64>> =
            blocks.iter().map(|b| b[0].iter().zip(&b[1]).map(|(a, b)| b - a).collect()).collect();
        Components::within_groups(&[components::Group::of(&differences)])
    };
    let known: Vec<(f64, f64)> = metric.groups.windows(2).filter_map(of_neighbours).collect();
    let mean = |part: fn(&(f64, f64)) -> f64| sums::mean(&known.iter().map(part).collect::<Vec<_>>());
    (!known.is_empty()).then(|| (mean(|k| k.0), mean(|k| k.1)))
}
