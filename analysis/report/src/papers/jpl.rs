//! Published values of the rover trials of the JPL synthetic terrain environment (section 4).

use serde::Deserialize;

const JPL: &str = include_str!("jpl.json");

/// The trials.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trials {
    /// Title of the paper.
    pub title: String,
    /// One for each navigator.
    pub trials: Vec<PublishedTrial>,
}

/// One circle of rovers on one world.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedTrial {
    /// Navigator, as in the table `rovers`.
    pub navigator: String,
    /// Name on the page.
    pub name: String,
    /// Share of the ground under rocks.
    pub coverage: f64,
    /// Distance from start to goal, m.
    pub straight_m: f64,
    /// Rovers on the circle.
    pub rovers: usize,
    /// Published values.
    pub values: Vec<PublishedValue>,
}

/// One published value.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedValue {
    /// Name of the quantity of a world.
    pub figure: String,
    /// Value: a pure number, or metres if the name ends in `_m`.
    pub value: f64,
    /// Half a unit of its last digit.
    pub rounding: f64,
    /// Where it is printed.
    pub origin: String,
}

/// The paper's trials.
pub fn trials() -> Option<Trials> {
    serde_json::from_str(JPL).ok()
}

impl Trials {
    /// The trial of a navigator, with share of rocks and distance within 1 %.
    pub fn of(&self, navigator: &str, coverage: f64, straight_m: f64) -> Option<&PublishedTrial> {
        let near = |a: f64, b: f64| (a - b).abs() <= 0.01 * b;
        self.trials
            .iter()
            .find(|t| t.navigator == navigator && near(coverage, t.coverage) && near(straight_m, t.straight_m))
    }
}

impl PublishedTrial {
    /// The published value of a quantity.
    pub fn value(&self, figure: &str) -> Option<f64> {
        self.values.iter().find(|v| v.figure == figure).map(|v| v.value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published values are consistent: 25 m over 280, 89.3 and 902.5 m, 40 m over 44.9 m.
    #[test]
    fn val_published_values_are_consistent() {
        let all = trials().unwrap();
        for trial in &all.trials {
            let of = |figure: &str| trial.values.iter().find(|v| v.figure == figure).unwrap();
            let (ratio, mean) = (of("straight_over_mean_distance"), of("mean_distance_m"));
            let ends = [mean.value + mean.rounding, mean.value - mean.rounding].map(|m| trial.straight_m / m);
            assert!(ratio.value + ratio.rounding >= ends[0] && ratio.value - ratio.rounding <= ends[1], "{trial:?}");
        }
        let sojourner = all.of("sojourner_like", 0.176, 25.1).unwrap();
        assert!((sojourner.value("greatest_efficiency").unwrap() - 25.0 / 89.3).abs() < 5e-4);
        assert!((sojourner.value("least_efficiency").unwrap() - 25.0 / 902.5).abs() < 5e-5);
        assert!(all.of("sojourner_like", 0.118, 25.0).is_none() && all.of("planner", 0.176, 25.0).is_none());
    }
}
