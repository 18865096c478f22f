//! Quantities of one world, as a paper with a single world would print them: the mean over worlds, and the prediction band for one more world.

use super::sets::{Estimate, Set, World, efficiency, off_ground, reached, shown};
use crate::questions::clusters::LEVEL;
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::RoverRow;
use sastrugi_statistics::{Interval, prediction};

/// A quantity of a world.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    /// Name in the data of papers.
    pub id: &'static str,
    /// Name on the page.
    pub name: &'static str,
    /// Unit; `1` for pure numbers.
    pub unit: &'static str,
    /// Numerator and denominator for a world.
    pub totals: fn(&World) -> (f64, f64),
}

/// Mean of the rovers' efficiencies.
pub const EFFICIENCY: Quantity =
    Quantity { id: "mean_efficiency", name: "mean efficiency", unit: "1", totals: |w| w.total(efficiency) };
/// Mean efficiency of the rovers that arrive.
pub const OF_ARRIVALS: Quantity = Quantity {
    id: "efficiency_of_arrivals",
    name: "mean efficiency of arrivals",
    unit: "1",
    totals: |w| w.total(|r| if reached(r) { efficiency(r) } else { f64::NAN }),
};
/// Straight distance over distance driven.
pub const STRAIGHT: Quantity = Quantity {
    id: "straight_over_mean_distance",
    name: "straight over mean distance",
    unit: "1",
    totals: |w| (w.total(|r| stayed(r, r.straight_m)).0, w.total(|r| stayed(r, r.distance_m)).0),
};
/// Mean distance driven.
pub const DISTANCE: Quantity = Quantity {
    id: "mean_distance_m",
    name: "mean distance",
    unit: "m",
    totals: |w| w.total(|r| stayed(r, r.distance_m)),
};
/// Largest efficiency among a world's rovers.
pub const GREATEST: Quantity = Quantity {
    id: "greatest_efficiency",
    name: "greatest efficiency of a world",
    unit: "1",
    totals: |w| extreme(w, f64::max),
};
/// Smallest efficiency among a world's rovers.
pub const LEAST: Quantity = Quantity {
    id: "least_efficiency",
    name: "least efficiency of a world",
    unit: "1",
    totals: |w| extreme(w, f64::min),
};
/// Share of the rovers that arrive.
pub const ARRIVED: Quantity = Quantity {
    id: "reached",
    name: "rovers that reach the goal",
    unit: "1",
    totals: |w| w.total(|r| f64::from(u8::from(reached(r)))),
};
/// All quantities that papers print.
pub const PRINTED: [Quantity; 5] = [STRAIGHT, EFFICIENCY, DISTANCE, GREATEST, LEAST];

/// A value of a rover that stayed on the ground; NaN for the others, whose drive was cut short.
fn stayed(rover: &RoverRow, value: f64) -> f64 {
    if off_ground(rover) { f64::NAN } else { value }
}

/// The largest or smallest efficiency of a world, as a ratio to 1; 0 to 0 if no rover stayed on the ground.
fn extreme(world: &World, pick: fn(f64, f64) -> f64) -> (f64, f64) {
    world.values(shown).into_iter().reduce(pick).map_or((0.0, 0.0), |value| (value, 1.0))
}

impl Quantity {
    /// Value of a world; NaN if unknown.
    pub fn of(&self, world: &World) -> f64 {
        let (a, b) = (self.totals)(world);
        a / b
    }

    /// Known values of the worlds of a set, with their terrain.
    pub fn values<'a>(&self, set: &Set<'a>) -> Vec<(&'a str, f64)> {
        set.worlds.iter().map(|w| (w.terrain_id, self.of(w))).filter(|v| v.1.is_finite()).collect()
    }

    /// Value over all rovers of a set, with the interval over worlds.
    pub fn pooled(&self, set: &Set) -> Estimate {
        if self.id == ARRIVED.id {
            return arrived(set);
        }
        let estimate = set.ratio(|w| (self.totals)(w), LEVEL);
        Estimate { interval: estimate.interval.map(|i| self.within(set, i)), ..estimate }
    }

    /// Prediction band for one more world; `None` for a single world.
    pub fn one_more(&self, set: &Set) -> Option<Interval> {
        let values: Vec<f64> = self.values(set).into_iter().map(|v| v.1).collect();
        let band = prediction::one_more_positive(&values, LEVEL)?;
        Some(self.within(set, band))
    }

    /// An interval on a logarithmic scale, clipped to the possible values.
    fn within(&self, set: &Set, interval: Interval) -> Interval {
        let [least, most] = self.bounds(set);
        let (least, most) = (least.min(interval.estimate), most.max(interval.estimate));
        Interval { high: interval.high.clamp(least, most), low: interval.low.clamp(least, most), ..interval }
    }

    /// Smallest and largest possible value. Efficiencies end at 1. A rover drives at least the straight distance minus what was left at the end, so straight
    /// over mean distance may be slightly above 1.
    fn bounds(&self, set: &Set) -> [f64; 2] {
        let mean = |of: fn(&RoverRow) -> f64| {
            sums::mean(&sums::finite(&set.rovers().map(|r| stayed(r, of(r))).collect::<Vec<_>>()))
        };
        let straight_m = mean(|r| r.straight_m);
        let shortest_m = mean(|r| (r.straight_m - r.residual_m).max(0.0));
        let known = |value: f64, otherwise: f64| if value.is_finite() { value } else { otherwise };
        match self.id {
            id if [EFFICIENCY.id, OF_ARRIVALS.id, GREATEST.id, LEAST.id].contains(&id) => [0.0, 1.0],
            id if id == STRAIGHT.id => [0.0, known(straight_m / shortest_m, f64::INFINITY)],
            id if id == DISTANCE.id => [known(shortest_m, 0.0), f64::INFINITY],
            _ => [0.0, f64::INFINITY],
        }
    }
}

/// Share of the rovers that arrive, with its interval over worlds.
pub fn arrived(set: &Set) -> Estimate {
    share(set, |r| Some(reached(r)))
}

/// Share of rovers for which the predicate is true, among those for which it is known.
pub fn share(set: &Set, is: impl Fn(&RoverRow) -> Option<bool>) -> Estimate {
    let of = |r: &RoverRow| is(r).map_or(f64::NAN, |yes| f64::from(u8::from(yes)));
    let totals: Vec<(f64, f64)> = set.worlds.iter().map(|w| w.total(of)).filter(|t| t.1 > 0.0).collect();
    let (n, k) = (totals.iter().map(|t| t.1).sum::<f64>(), totals.len() as f64);
    let value = sums::sum(&totals.iter().map(|t| t.0).collect::<Vec<_>>()) / n;
    let residuals: f64 = totals.iter().map(|t| (t.0 - value * t.1) * (t.0 - value * t.1)).sum();
    let variance = k / (k - 1.0) * residuals / (n * n);
    let interval = sastrugi_statistics::proportion::of_clusters(value, variance, n as usize, totals.len(), LEVEL);
    Estimate { value, interval }
}
