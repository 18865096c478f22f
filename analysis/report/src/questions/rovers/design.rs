//! Designs side by side: efficiency and arrival for every combination of the swept parameters, one block for each group.

use super::sets::{Estimate, Set, variants};
use super::worlds::{ARRIVED, EFFICIENCY, OF_ARRIVALS, STRAIGHT};
use crate::content::{Block, Numbers, TableBlock, count, number, slug, text};
use crate::data::{Data, natural};
use crate::render::number as set_number;
use sastrugi_schemas::Cell;
use std::collections::BTreeSet;

/// Largest number of rows or columns of a block; the list has all combinations.
const VALUES_MAX: usize = 12;
/// The parameter that forms the rows if it is swept.
const SIZE: &str = "scale";

/// A combination: parameters and values in the order of the variant, and its set of rovers.
struct Design<'a> {
    values: Vec<(String, String)>,
    set: Set<'a>,
}

/// Designs that are swept together: stages that vary the same parameters with one navigator.
struct Family<'a> {
    name: String,
    parameters: Vec<String>,
    designs: Vec<Design<'a>>,
}

/// Text and tables; empty without variants.
pub fn blocks(data: &Data) -> Vec<Block> {
    let families = families(data);
    if families.is_empty() {
        return Vec::new();
    }
    let mut blocks = vec![Block::Heading("Designs".into()), Block::Text(WORDS.into())];
    for (k, family) in families.iter().enumerate() {
        blocks.extend(family.tables(k).into_iter().map(Block::Table));
    }
    blocks.push(Block::FoldedTable(list(&families)));
    blocks
}

const WORDS: &str = "Each cell gives the mean efficiency with its 95 % interval over worlds, then the share of rovers that reach the goal and their mean efficiency. All designs drive on \
the same worlds from the same starts, so differences between the cells of a block are less uncertain than their intervals suggest.";

/// Parameters and values of a variant: `clearance_m = 0.1, scale = 0.75`.
fn parse(variant: &str) -> Vec<(String, String)> {
    let part =
        |text: &str| text.split_once(" = ").map(|(name, value)| (name.trim().to_owned(), value.trim().to_owned()));
    variant.split(", ").filter_map(part).collect()
}

fn families(data: &Data) -> Vec<Family<'_>> {
    let mut families: Vec<Family> = Vec::new();
    for set in variants(data) {
        let values = parse(set.variant.unwrap_or_default());
        let mut parameters: Vec<String> = values.iter().map(|v| v.0.clone()).collect();
        // Size comes first, in the rows.
        parameters.sort_by_key(|p| p != SIZE);
        let name = set.navigator();
        match families.iter_mut().find(|f| f.name == name && f.parameters == parameters) {
            _ if values.is_empty() => {}
            Some(family) => family.designs.push(Design { values, set }),
            None => families.push(Family { name, parameters, designs: vec![Design { values, set }] }),
        }
    }
    families
}

impl Design<'_> {
    fn value(&self, parameter: &str) -> &str {
        self.values.iter().find(|v| v.0 == parameter).map_or("", |v| &v.1)
    }
}

impl Family<'_> {
    /// Values of a parameter in natural order.
    fn values(&self, parameter: Option<&String>) -> Vec<String> {
        let Some(parameter) = parameter else { return vec![String::new()] };
        let values: BTreeSet<_> = self.designs.iter().map(|d| natural(d.value(parameter))).collect();
        values.into_iter().map(|v| v.1).take(VALUES_MAX).collect()
    }

    /// Group, and the values of all parameters but the first two: they identify a block.
    fn block(&self, design: &Design) -> (crate::data::Natural, String) {
        let rest: Vec<String> =
            self.parameters.iter().skip(2).map(|p| format!(", {p} = {}", design.value(p))).collect();
        (natural(&design.set.group), rest.concat())
    }

    fn tables(&self, family: usize) -> Vec<TableBlock> {
        let blocks: BTreeSet<_> = self.designs.iter().map(|d| self.block(d)).collect();
        let (rows, columns) = (self.values(self.parameters.first()), self.values(self.parameters.get(1)));
        let table = |(k, block): (usize, (crate::data::Natural, String))| {
            let own: Vec<&Design> = self.designs.iter().filter(|d| self.block(d) == block).collect();
            let head = |value: &String| match self.parameters.get(1) {
                Some(parameter) => (format!("{parameter} = {value}"), ""),
                None => ("efficiency, reached".to_owned(), ""),
            };
            let heads: Vec<(String, &str)> =
                std::iter::once((self.parameters[0].clone(), "")).chain(columns.iter().map(head)).collect();
            let heads: Vec<(&str, &str)> = heads.iter().map(|(name, unit)| (name.as_str(), *unit)).collect();
            let mut numbers = Numbers::computed(query(own.iter().copied()), &heads);
            for row in &rows {
                let cells = columns.iter().map(|column| {
                    let is = |d: &&&Design| {
                        d.value(&self.parameters[0]) == row
                            && self.parameters.get(1).is_none_or(|p| d.value(p) == column)
                    };
                    own.iter().find(is).map_or(Cell::Null, |d| text(words(&d.set)))
                });
                numbers.row(std::iter::once(text(row)).chain(cells));
            }
            let caption = format!("{} rovers, {}{}", self.name, block.0.1, block.1);
            TableBlock { id: slug(&format!("rover-design-{}-{}", family + 1, k + 1)), caption, numbers }
        };
        blocks.into_iter().enumerate().map(table).collect()
    }
}

/// Efficiency with its interval, and arrival.
fn words(set: &Set) -> String {
    let efficiency = EFFICIENCY.pooled(set);
    let [low, high] = efficiency.ends();
    let interval = match efficiency.interval {
        Some(_) => format!(" ({} to {})", set_number::fixed(low, 2), set_number::fixed(high, 2)),
        None => String::new(),
    };
    let arrivals = match OF_ARRIVALS.pooled(set).value {
        e if e.is_finite() => format!(" at {}", set_number::fixed(e, 2)),
        _ => String::new(),
    };
    format!(
        "{}{interval}; {}{arrivals}",
        set_number::fixed(efficiency.value, 2),
        set_number::percent(ARRIVED.pooled(set).value, 0)
    )
}

/// Query for the rows of the table `rovers` from which designs are computed.
fn query<'a>(designs: impl IntoIterator<Item = &'a Design<'a>>) -> String {
    let stages: BTreeSet<String> = designs.into_iter().map(|d| crate::questions::sql::quoted(d.set.stage)).collect();
    format!(
        "select terrain_id, rover_id, \"group\", stage_id, variant, outcome, efficiency, straight_m, distance_m from 'tables/rovers/*.parquet' where stage_id in ({}) \
         and variant is not null",
        stages.into_iter().collect::<Vec<_>>().join(", ")
    )
}

/// Every combination with its numbers.
fn list(families: &[Family]) -> TableBlock {
    let columns = [
        ("navigator", ""),
        ("group", ""),
        ("variant", ""),
        ("worlds", "1"),
        ("rovers", "1"),
        ("mean efficiency", "1"),
        ("low", "1"),
        ("high", "1"),
        ("straight over mean distance", "1"),
        ("low", "1"),
        ("high", "1"),
        ("reached", "%"),
        ("low", "%"),
        ("high", "%"),
        ("efficiency of arrivals", "1"),
    ];
    let mut numbers = Numbers::computed(query(families.iter().flat_map(|f| &f.designs)), &columns);
    for (family, design) in families.iter().flat_map(|f| f.designs.iter().map(move |d| (f, d))) {
        let set = &design.set;
        let three = |e: Estimate, scale: f64| [e.value, e.ends()[0], e.ends()[1]].map(|v| number(scale * v));
        let head = [
            text(&family.name),
            text(&set.group),
            text(set.variant.unwrap_or_default()),
            count(set.worlds.len()),
            count(set.count()),
        ];
        let estimates =
            [three(EFFICIENCY.pooled(set), 1.0), three(STRAIGHT.pooled(set), 1.0), three(ARRIVED.pooled(set), 100.0)];
        let arrivals = number(OF_ARRIVALS.pooled(set).value);
        numbers.row(head.into_iter().chain(estimates.into_iter().flatten()).chain([arrivals]));
    }
    TableBlock { id: "rover-designs".into(), caption: "All designs".into(), numbers }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_variants_are_parsed() {
        let of = |v: &str| parse(v).into_iter().map(|(a, b)| format!("{a}:{b}")).collect::<Vec<_>>().join(" ");
        assert_eq!(of("clearance_m = 0.1, scale = 0.75"), "clearance_m:0.1 scale:0.75");
        assert_eq!(of("processes.0.coverage = 0.2, facing = goal"), "processes.0.coverage:0.2 facing:goal");
        assert_eq!(of("nonsense"), "");
    }
}
