//! Published values as data, for comparison with ours. They are never used for tuning.

pub mod bayrak;
pub mod jpl;

use crate::data::Data;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Values of one publication, by group.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Paper {
    /// Authors.
    pub authors: String,
    /// Title.
    pub title: String,
    /// Labels of its groups, which are numbers.
    pub groups: Vec<f64>,
    /// Terrains in each group.
    pub terrains_per_group: usize,
    /// Missions on each terrain.
    pub missions_per_terrain: usize,
    /// Its figures, by the id of the figure in this report that shows the same.
    pub figures: BTreeMap<String, String>,
    /// Values for each group.
    pub values: Vec<Published>,
    /// A change from each group to the next.
    pub steps: Vec<Published>,
}

/// One published quantity.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// Quantity: a column of the table `missions` (median over successful missions) or `terrains` (median over terrains),
    /// or `success` (median over terrains, %), `success_percent` (of all missions), `time_outliers` (a count).
    pub figure: String,
    /// Name on the page.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// By group, or from group to group.
    pub values: Vec<f64>,
    /// Rounding error of each printed value: half a unit of its last digit, more if the value was derived.
    pub rounding: Vec<f64>,
    /// True for a change in per cent of the first value.
    #[serde(default)]
    pub relative: bool,
    /// Where it is printed, or how it was derived.
    pub origin: String,
}

const MAJHOR: &str = include_str!("majhor.json");

/// The paper whose groups the release has; `None` if there is none.
pub fn applicable(data: &Data) -> Option<Paper> {
    let paper: Paper = serde_json::from_str(MAJHOR).ok()?;
    let names: Vec<String> = data.terrain_groups().into_iter().map(|g| g.name).collect();
    let held = |group: &f64| names.iter().any(|n| same(n, *group));
    paper.groups.iter().all(held).then_some(paper)
}

/// True when the label is the number `group`.
pub fn same(label: &str, group: f64) -> bool {
    label.trim().parse::<f64>().is_ok_and(|v| (v - group).abs() < 1e-9)
}

impl Paper {
    /// The paper's values to be marked next to our medians, which are given by label. If the paper prints only changes: our median of
    /// its first group plus the changes up to each other group; the first group has no mark.
    pub fn marks(&self, figure: &str, ours: &[(&str, f64)]) -> Vec<Option<f64>> {
        let group = |label: &str| self.groups.iter().position(|g| same(label, *g));
        if let Some(printed) = self.values.iter().find(|p| p.figure == figure) {
            return ours.iter().map(|o| printed.values.get(group(o.0)?).copied()).collect();
        }
        let steps = self.steps.iter().find(|p| p.figure == figure && !p.relative);
        let first = ours.iter().find(|o| group(o.0) == Some(0)).map(|o| o.1);
        let mark = |label: &str| {
            let changes = steps?.values.get(..group(label)?).filter(|c| !c.is_empty())?;
            Some(first? + changes.iter().sum::<f64>())
        };
        ours.iter().map(|o| mark(o.0)).collect()
    }

    /// True for a quantity of which the paper prints only changes.
    pub fn prints_changes_only(&self, figure: &str) -> bool {
        !self.values.iter().any(|p| p.figure == figure) && self.steps.iter().any(|p| p.figure == figure)
    }
}

/// Title of a figure; it names the paper's figure if the release has the paper's groups.
pub fn title(data: &Data, id: &str, plain: &str) -> String {
    let of_paper = |paper: Paper| {
        let drawing = paper.figures.get(id)?;
        Some(format!("{plain} {drawing} of {}, redrawn from our data.", paper.authors))
    };
    applicable(data).and_then(of_paper).unwrap_or_else(|| plain.to_owned())
}

/// Meaning of the paper's mark, for a legend.
pub fn mark_in_words(paper: &Paper, figure: &str) -> String {
    if paper.prints_changes_only(figure) {
        "paper: its changes added to our first median".into()
    } else {
        "paper's median".into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_the_data_are_complete_and_agree_with_the_printed_steps() {
        let paper: Paper = serde_json::from_str(MAJHOR).unwrap();
        let n = paper.groups.len();
        assert!(paper.values.iter().all(|p| p.values.len() == n && p.rounding.len() == n));
        assert!(paper.steps.iter().all(|p| p.values.len() == n - 1 && p.rounding.len() == n - 1));
        for steps in paper.steps.iter().filter(|p| paper.values.iter().any(|v| v.figure == p.figure)) {
            let of = |p: &&Published| p.figure == steps.figure;
            let v = paper.values.iter().find(of).unwrap();
            for (k, printed) in steps.values.iter().enumerate() {
                let scale = if steps.relative { v.values[k] / 100.0 } else { 1.0 };
                let room = v.rounding[k] + v.rounding[k + 1] + scale * steps.rounding[k] + 1e-9;
                let step = v.values[k + 1] - v.values[k];
                assert!((step - scale * printed).abs() <= room, "{} {}: {step}", steps.name, steps.unit);
            }
        }
    }

    #[test]
    fn val_marks() {
        let paper: Paper = serde_json::from_str(MAJHOR).unwrap();
        let ours = [("2.30", 95.0), ("2.6", 60.0), ("other", 1.0)];
        assert_eq!(paper.marks("success", &ours), [None, Some(47.5), None]);
        assert_eq!(paper.marks("time_s", &ours), [Some(36.0), Some(37.0), None]);
        assert_eq!(paper.marks("nothing", &ours), [None, None, None]);
        assert!(paper.prints_changes_only("success") && !paper.prints_changes_only("time_s"));
    }

    #[test]
    fn val_labels_are_compared_as_numbers() {
        assert!(same("2.30", 2.3) && same("2.3", 2.3));
        assert!(!same("2.31", 2.3) && !same("rough", 2.3) && !same("nan", 2.3));
    }
}
