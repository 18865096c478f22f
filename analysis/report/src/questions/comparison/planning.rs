//! What the next study needs: power of the tests by numbers of terrains and missions, from the scatter of this one.

use super::ALPHA;
use super::values::{Figure, Values, common_missions, share_pairs};
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
/// Difference of success that is looked for, points.
const POINTS: f64 = 10.0;
/// Difference of the other figures that is looked for, as a share of their mean.
const SHARE: f64 = 0.1;

/// The table and what it rests on; nothing where the scatter cannot be split.
pub fn blocks(data: &Data, figures: &[Figure], pairing: &Pairing) -> Vec<Block> {
    let table = table(data, figures, pairing);
    if table.numbers.rows.is_empty() {
        return Vec::new();
    }
    let units = if pairing.is_common() { "blocks of paired terrains" } else { "terrains in each of two groups" };
    let [of_blocks, of_both] = match pairing.is_common() {
        true => [" (of a block's differences from group to group)", " (of a pair's difference)"],
        false => [""; 2],
    };
    let words = format!(
        "How often a study of so many {units} would find a difference of {} points of success, or of a tenth of another \
         figure's mean, at {} % and without adjustment, if terrains and missions scatter as they do here. By simulation of the \
         test above on normal means of terrains, so good to about 3 points. Scatter is a standard deviation: between \
         terrains{of_blocks}, and between missions on one terrain{of_both}. More missions on the \
         same terrains help only as far as missions are what scatters.",
        set::fixed(POINTS, 0),
        set::fixed(100.0 * ALPHA, 0)
    );
    vec![Block::Heading("How many terrains the next study needs".into()), Block::Text(words), Block::Table(table)]
}

fn table(data: &Data, figures: &[Figure], pairing: &Pairing) -> TableBlock {
    let units = if pairing.is_common() { "blocks" } else { "terrains a group" };
    let heads = MISSIONS.map(|m| format!("{m} missions each"));
    let fixed = [("figure", ""), ("unit", ""), ("difference", ""), ("scatter between", ""), ("scatter within", "")];
    let columns: Vec<(&str, &str)> =
        fixed.into_iter().chain([(units, "")]).chain(heads.iter().map(|h| (h.as_str(), "%"))).collect();
    let mut numbers = Numbers::computed(sql::compared(data), &columns).with_mixed_units();
    for figure in figures {
        let Some(target) = target(figure, pairing) else { continue };
        let mut stream = stream(data, "power", figure.column);
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
                text(figure.name),
                text(figure.unit),
                number(target.difference),
                deviation(target.between),
                deviation(target.within),
                count(terrains),
            ];
            numbers.row(head.into_iter().chain(power));
        }
    }
    let caption = "Power of the next study, by missions on a terrain".into();
    TableBlock { id: "comparison-power".into(), caption, numbers }
}

/// What is looked for and its scatter: of paired groups from the differences of neighbours, of others within groups.
fn target(figure: &Figure, pairing: &Pairing) -> Option<Target> {
    let all: Vec<f64> = figure.groups.iter().flat_map(Values::numbers).collect();
    let difference = if figure.column == "success" { POINTS } else { SHARE * sums::mean(&all).abs() };
    let scatter = if pairing.is_common() { paired_scatter(figure) } else { scatter(figure) };
    let (between, within) = scatter?;
    (difference > 0.0).then_some(Target { difference, between, within })
}

/// Variance between terrains of a group and between missions of a terrain.
pub fn scatter(figure: &Figure) -> Option<(f64, f64)> {
    let of_group = |g: &Values| components::Group::of(&g.terrains.values().cloned().collect::<Vec<_>>());
    Components::within_groups(&figure.groups.iter().map(of_group).collect::<Vec<_>>())
}

/// Variance between blocks of the differences of neighbouring groups, and between the missions of a block; means over the
/// neighbours. Missions are paired too where groups share pairs: their difference is then what scatters. `None` where no neighbours
/// share blocks.
fn paired_scatter(figure: &Figure) -> Option<(f64, f64)> {
    let of_neighbours = |pair: &[Values]| {
        let groups = [&pair[0], &pair[1]];
        // Without pairs the missions of two groups have no order in common.
        let blocks = if share_pairs(&groups) { common_missions(&groups) } else { Vec::new() };
        let differences: Vec<Vec<f64>> =
            blocks.iter().map(|b| b[0].iter().zip(&b[1]).map(|(a, b)| b - a).collect()).collect();
        Components::within_groups(&[components::Group::of(&differences)])
    };
    let known: Vec<(f64, f64)> = figure.groups.windows(2).filter_map(of_neighbours).collect();
    let mean = |part: fn(&(f64, f64)) -> f64| sums::mean(&known.iter().map(part).collect::<Vec<_>>());
    (!known.is_empty()).then(|| (mean(|k| k.0), mean(|k| k.1)))
}
