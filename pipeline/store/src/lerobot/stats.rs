//! Statistics of a feature, as `lerobot.datasets.compute_stats` defines them: over frames and, for a matrix, over its rows, so that each has
//! the length of the last axis.

use super::features::list_of_all;
use crate::parquet::element;
use arrow_array::{ArrayRef, Float64Array, Int64Array};
use arrow_schema::{ArrowError, DataType, Field};
use sastrugi_numeric::sums;
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// Probabilities of the quantiles.
const PROBABILITIES: [f64; 5] = [0.01, 0.1, 0.5, 0.9, 0.99];
/// Names of the statistics, in their order.
const NAMES: [&str; 10] = ["min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"];

/// Statistics of a feature.
#[derive(Clone, Debug, PartialEq)]
pub struct Stats {
    /// Lowest values.
    pub min: Vec<f64>,
    /// Highest values.
    pub max: Vec<f64>,
    /// Means.
    pub mean: Vec<f64>,
    /// Mean squared deviations from the means.
    pub variance: Vec<f64>,
    /// Quantiles of 0.01, 0.1, 0.5, 0.9 and 0.99.
    pub quantiles: [Vec<f64>; 5],
    /// Number of frames.
    pub count: u64,
}

impl Stats {
    /// Statistics of columns of values, each with the same number of finite values, at least one.
    pub(super) fn of(columns: impl Iterator<Item = Vec<f64>>, count: u64) -> Self {
        let [min, max, mean, variance] = [(); 4].map(|()| vec![]);
        let mut stats = Self { min, max, mean, variance, quantiles: PROBABILITIES.map(|_| vec![]), count };
        for mut values in columns {
            stats.mean.push(sums::mean(&values));
            stats.variance.push(sums::variance(&values));
            values.sort_unstable_by(f64::total_cmp);
            stats.min.push(sums::quantile_sorted(&values, 0.0));
            stats.max.push(sums::quantile_sorted(&values, 1.0));
            for (quantiles, probability) in stats.quantiles.iter_mut().zip(PROBABILITIES) {
                quantiles.push(sums::quantile_sorted(&values, probability));
            }
        }
        stats
    }

    /// Adds the statistics of further frames. Extremes, means and variances are those of all frames together; quantiles are means of the
    /// quantiles, weighted by frames, as the package aggregates them.
    pub(super) fn merge(&mut self, other: &Self) {
        let count = self.count + other.count;
        let share = other.count as f64 / count as f64;
        self.min.iter_mut().zip(&other.min).for_each(|(mine, theirs)| *mine = mine.min(*theirs));
        self.max.iter_mut().zip(&other.max).for_each(|(mine, theirs)| *mine = mine.max(*theirs));
        let gaps: Vec<f64> = self.mean.iter().zip(&other.mean).map(|(mine, theirs)| theirs - mine).collect();
        move_towards(&mut self.mean, &other.mean, share);
        move_towards(&mut self.variance, &other.variance, share);
        let between = share * (1.0 - share);
        self.variance.iter_mut().zip(gaps).for_each(|(variance, gap)| *variance += between * gap * gap);
        self.quantiles.iter_mut().zip(&other.quantiles).for_each(|(mine, theirs)| move_towards(mine, theirs, share));
        self.count = count;
    }

    /// Standard deviations.
    pub fn std(&self) -> Vec<f64> {
        self.variance.iter().map(|variance| variance.sqrt()).collect()
    }

    /// All statistics but the count, before and after it in the order of [`NAMES`].
    fn floats(&self) -> ([Vec<f64>; 4], [Vec<f64>; 5]) {
        ([self.min.clone(), self.max.clone(), self.mean.clone(), self.std()], self.quantiles.clone())
    }

    pub(super) fn to_json(&self) -> Value {
        let (before, after) = self.floats();
        let floats = |values: Vec<f64>| json!(values);
        let all = before.map(floats).into_iter().chain([json!([self.count])]).chain(after.map(floats));
        NAMES.into_iter().map(str::to_owned).zip(all).collect::<Map<String, Value>>().into()
    }

    /// Columns of a feature's statistics in `meta/episodes`.
    pub(super) fn fields(feature: &str) -> Vec<Field> {
        let data_type = |name: &str| if name == "count" { DataType::Int64 } else { DataType::Float64 };
        let field =
            |name: &str| Field::new(format!("stats/{feature}/{name}"), DataType::List(element(data_type(name))), true);
        NAMES.map(field).into()
    }

    /// The values of these columns in one row.
    pub(super) fn arrays(&self) -> Vec<Result<ArrayRef, ArrowError>> {
        let (before, after) = self.floats();
        let floats = |values: Vec<f64>| list_of_all(Arc::new(Float64Array::from(values)));
        let count = list_of_all(Arc::new(Int64Array::from(vec![self.count as i64])));
        before.map(floats).into_iter().chain([count]).chain(after.map(floats)).collect()
    }
}

/// Moves each value by a share of the way to another.
fn move_towards(values: &mut [f64], others: &[f64], share: f64) {
    values.iter_mut().zip(others).for_each(|(value, other)| *value += share * (other - *value));
}
