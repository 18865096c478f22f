//! Published figures as data, for comparison beside ours. They are never used to tune anything.

use crate::data::Data;
use serde::Deserialize;

/// Figures of one publication, by group.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Paper {
    /// Authors.
    pub authors: String,
    /// Title.
    pub title: String,
    /// Labels of its groups, as numbers.
    pub groups: Vec<f64>,
    /// Terrains in each group.
    pub terrains_per_group: usize,
    /// Missions on each terrain.
    pub missions_per_terrain: usize,
    /// A figure for each group.
    pub values: Vec<Published>,
    /// A change from each group to the next.
    pub steps: Vec<Published>,
}

/// One published figure.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// What it is: a column of the tables `missions` or `terrains`, or `success`.
    pub figure: String,
    /// Words.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// By group, or from group to group.
    pub values: Vec<f64>,
    /// Where it is printed, and how it was derived where it is not.
    pub origin: String,
}

const MAJHOR: &str = include_str!("majhor.json");

/// The paper whose groups the release holds; `None` when there is none.
pub fn applicable(data: &Data) -> Option<Paper> {
    let paper: Paper = serde_json::from_str(MAJHOR).ok()?;
    let names: Vec<String> = data.terrain_groups().into_iter().map(|g| g.name).collect();
    let held = |group: &f64| names.iter().any(|n| same(n, *group));
    paper.groups.iter().all(held).then_some(paper)
}

/// True when the label is that number.
pub fn same(label: &str, group: f64) -> bool {
    label.trim().parse::<f64>().is_ok_and(|v| (v - group).abs() < 1e-9)
}

impl Paper {
    /// The published median of a figure in the group of that label.
    pub fn value(&self, figure: &str, label: &str) -> Option<f64> {
        let group = self.groups.iter().position(|g| same(label, *g))?;
        self.values.iter().find(|p| p.figure == figure)?.values.get(group).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_the_data_are_complete_and_agree_with_the_printed_steps() {
        let paper: Paper = serde_json::from_str(MAJHOR).unwrap();
        let n = paper.groups.len();
        assert!(paper.values.iter().all(|p| p.values.len() == n));
        assert!(paper.steps.iter().all(|p| p.values.len() == n - 1));
        // Printed steps of the medians: 0.397 and 0.281 m/s2, 5.29 and 2.13 deg/s, 3.5 and 2.02 deg/s; two digits.
        let printed = [[0.397, 0.281], [5.29, 2.13], [3.5, 2.02]];
        let columns = ["rms_vertical_acceleration_m_s2", "rms_pitch_rate_deg_s", "rms_roll_rate_deg_s"];
        for (column, steps) in columns.iter().zip(printed) {
            let v = &paper.values.iter().find(|p| p.figure == *column).unwrap().values;
            assert!((v[1] - v[0] - steps[0]).abs() < 0.01 && (v[2] - v[1] - steps[1]).abs() < 0.01, "{column}");
        }
    }

    #[test]
    fn val_labels_are_compared_as_numbers() {
        assert!(same("2.30", 2.3) && same("2.3", 2.3));
        assert!(!same("2.31", 2.3) && !same("rough", 2.3) && !same("nan", 2.3));
    }
}
