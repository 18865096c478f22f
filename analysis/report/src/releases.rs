//! Comparison of two releases, quantity by quantity and group by group, for the verb `compare` and for the report's section on
//! another release.
//!
//! Terrains are the units: a terrain's value is the mean over its missions (success: all missions; other metrics: successful
//! missions only). If all terrains of the smaller group are in both releases, with equal heights or from the same random draws
//! under one id, they are compared in pairs; other groups are compared as independent samples. Tests and shifts are those of
//! [`Difference`], with Holm's adjustment over all quantities. A difference of means whose interval of coverage `1 - 2 alpha` lies
//! within the margin does not matter (two one-sided tests).

use crate::data::Mission;
use sastrugi_numeric::{Streams, sums};
use sastrugi_schemas::study::Statistic;
use sastrugi_schemas::tables::TerrainRow;
use sastrugi_schemas::{Answer, Record};
use sastrugi_statistics::{Difference, Interval, MeanDifference, holm, permutation};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Name of the random streams.
pub const STREAMS: &str = "compare";
/// Margin of equivalence: a share of the other release's mean; for success and class shares, a share of one.
pub const MARGIN: f64 = 0.05;

/// A quantity of a terrain: column, scale of the margin, value.
type OfTerrain = (&'static str, Option<f64>, fn(&TerrainRow) -> f64);

/// Quantities of a terrain, with the scale of the margin if it is not the mean.
const OF_TERRAINS: [OfTerrain; 7] = [
    ("relief_m", None, |t| t.relief_m),
    ("rms_height_m", None, |t| t.rms_height_m),
    ("rms_slope", None, |t| t.rms_slope),
    ("share_low", Some(1.0), |t| t.share_low),
    ("share_semi", Some(1.0), |t| t.share_semi),
    ("share_high", Some(1.0), |t| t.share_high),
    ("psd_slope", None, |t| t.psd_slope),
];

/// Settings of the verdicts.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Difference of means that does not matter, as [`MARGIN`].
    pub margin: f64,
    /// Probability of any false "different", and of each false "same".
    pub alpha: f64,
}

/// A quantity of a group in two releases, A and B. There is one value per terrain; differences are B minus A.
#[derive(Clone, Debug, Serialize)]
pub struct Quantity {
    /// Table.
    pub table: &'static str,
    /// Label of the group, with the variant, and with the run if there are several.
    pub group: String,
    /// Column, or `success`.
    pub name: &'static str,
    /// Unit of the column.
    pub unit: &'static str,
    /// Number of terrains in A and B that were compared.
    pub terrains: [usize; 2],
    /// True when terrains are compared in pairs.
    pub paired: bool,
    /// Number of terrains in A and B that have no partner and were left out.
    pub left_out: [usize; 2],
    /// True when all terrains have the same values in both.
    pub equal: bool,
    /// Mean of A.
    pub a: f64,
    /// Mean of B.
    pub b: f64,
    /// Hodges and Lehmann's shift, with an interval of coverage `1 - alpha`; an unbounded end is null.
    pub shift: Option<[f64; 3]>,
    /// Cliff's delta, with an interval of coverage `1 - alpha`.
    pub delta: Option<[f64; 3]>,
    /// Difference of means.
    pub difference: f64,
    /// Its interval with coverage `1 - 2 alpha`, which decides `same`.
    pub interval: Option<[f64; 2]>,
    /// Largest difference of means that does not matter.
    pub margin: Option<f64>,
    /// p of the rank test.
    pub p: Option<f64>,
    /// The same after Holm's adjustment over all quantities of the comparison.
    pub p_adjusted: Option<f64>,
    /// p of the two one-sided tests.
    pub p_equivalence: Option<f64>,
    /// Same: equal, or within the margin. Different: by the adjusted `p`, and not shown to be the same.
    pub answer: Answer,
}

/// Sum and number of finite values.
type Mean = (f64, usize);

/// Key under which rows are compared.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    table: &'static str,
    label: String,
    variant: Option<String>,
    run: Option<String>,
}

/// Values of a metric.
#[derive(Clone, Debug)]
struct Metric {
    unit: &'static str,
    /// Scale of the margin, if it is not the mean.
    scale: Option<f64>,
    by_terrain: BTreeMap<String, Mean>,
}

/// Metrics by column.
type ByMetric = BTreeMap<&'static str, Metric>;

/// Metrics of a release, summed row by row: memory grows with the terrains, not with the missions.
#[derive(Clone, Debug, Default)]
pub struct Metrics {
    values: BTreeMap<Place, ByMetric>,
    /// Label, hash of the heights and name of the random stream of every terrain.
    terrains: BTreeMap<String, Terrain>,
}

#[derive(Clone, Debug)]
struct Terrain {
    label: String,
    content: Option<String>,
    stream: Option<String>,
}

impl Metrics {
    /// Adds a terrain, with the hash of its heights if the release states it. Must precede the missions on it.
    pub fn add_terrain(&mut self, row: &TerrainRow, content: Option<&str>) {
        let (table, label) = (TerrainRow::TABLE.name, crate::data::label(row).to_owned());
        let place = Place { table, label: label.clone(), variant: row.variant.clone(), run: None };
        for (metric, scale, value) in OF_TERRAINS {
            self.add(&place, (metric, unit::<TerrainRow>(metric), scale), &row.terrain_id, value(row));
        }
        let (content, stream) = (content.map(str::to_owned), row.stream.clone());
        self.terrains.insert(row.terrain_id.clone(), Terrain { label, content, stream });
    }

    /// Adds a mission.
    pub fn add_mission(&mut self, row: &Mission) {
        let of_terrain = || self.terrains.get(row.terrain_id.as_str()).map(|t| t.label.clone());
        let label = row.group.as_ref().map(String::from).or_else(of_terrain).unwrap_or_else(|| "all".to_owned());
        let (variant, run) = (row.variant.as_ref().map(String::from), Some(String::from(&row.traverse_id)));
        let place = Place { table: Mission::TABLE.name, label, variant, run };
        for statistic in Statistic::ALL {
            let metric = statistic.column();
            let (unit, scale) = match statistic {
                Statistic::Success => ("%", Some(100.0)),
                _ => (unit::<Mission>(metric), None),
            };
            self.add(&place, (metric, unit, scale), &row.terrain_id, row.of(statistic));
        }
    }

    fn add(
        &mut self,
        place: &Place,
        (metric, unit, scale): (&'static str, &'static str, Option<f64>),
        terrain: &str,
        value: f64,
    ) {
        if !self.values.contains_key(place) {
            self.values.insert(place.clone(), ByMetric::new());
        }
        let Some(metrics) = self.values.get_mut(place).filter(|_| value.is_finite()) else { return };
        let none = || Metric { unit, scale, by_terrain: BTreeMap::new() };
        let by_terrain = &mut metrics.entry(metric).or_insert_with(none).by_terrain;
        match by_terrain.get_mut(terrain) {
            Some((sum, count)) => (*sum, *count) = (*sum + value, *count + 1),
            None => drop(by_terrain.insert(terrain.to_owned(), (value, 1))),
        }
    }

    /// True when missions of one group and variant belong to several runs.
    fn has_several_runs(&self) -> bool {
        let mut places: Vec<_> = self.values.keys().map(|p| (p.table, &p.label, &p.variant)).collect();
        places.dedup();
        places.len() < self.values.len()
    }

    /// Metrics by place, without the run unless `with_runs`.
    fn by_place(&self, with_runs: bool) -> BTreeMap<Place, &ByMetric> {
        let of = |place: &Place| Place { run: place.run.clone().filter(|_| with_runs), ..place.clone() };
        self.values.iter().map(|(place, metrics)| (of(place), metrics)).collect()
    }

    /// True when a terrain is the same in both, or comes from the same random draws.
    fn shares_ground(&self, other: &Self, terrain: &str) -> bool {
        let same = |a: &Option<String>, b: &Option<String>| a.is_some() && a == b;
        let both = self.terrains.get(terrain).zip(other.terrains.get(terrain));
        both.is_some_and(|(a, b)| same(&a.content, &b.content) || same(&a.stream, &b.stream))
    }
}

impl Place {
    /// Group, variant and run.
    fn in_words(&self) -> String {
        let parts = [Some(&self.label), self.variant.as_ref(), self.run.as_ref()];
        parts.into_iter().flatten().cloned().collect::<Vec<_>>().join(", ")
    }
}

/// Every quantity that both releases have, and the groups that only A and only B has.
pub fn compare(a: &Metrics, b: &Metrics, settings: Settings, streams: &Streams) -> (Vec<Quantity>, [Vec<String>; 2]) {
    let with_runs = a.has_several_runs() || b.has_several_runs();
    let (of_a, of_b) = (a.by_place(with_runs), b.by_place(with_runs));
    let mut compared = Vec::new();
    for (place, metrics) in &of_a {
        let Some(others) = of_b.get(place) else { continue };
        let terrains = |metrics: &ByMetric| -> BTreeSet<String> {
            metrics.values().flat_map(|metric| metric.by_terrain.keys().cloned()).collect()
        };
        let (here, there) = (terrains(metrics), terrains(others));
        let shared: BTreeSet<&String> = here.intersection(&there).filter(|t| a.shares_ground(b, t)).collect();
        let paired = !shared.is_empty() && shared.len() == here.len().min(there.len());
        for (name, first) in *metrics {
            if let Some(second) = others.get(name) {
                compared.push((place, *name, first, Sides::of(first, second, paired.then_some(&shared))));
            }
        }
    }
    let draws = permutation::draws(compared.len(), settings.alpha);
    let of = |(place, name, metric, sides): &(&Place, _, &Metric, Sides)| {
        quantity(place, (*name, *metric), sides, settings, draws, streams)
    };
    let mut quantities: Vec<Quantity> = compared.iter().map(of).collect();
    judge(&mut quantities, settings.alpha);
    let alone = |one: &BTreeMap<Place, _>, other: &BTreeMap<Place, _>| {
        let only = one.keys().filter(|place| !other.contains_key(*place));
        only.map(|place| format!("{} ({})", place.in_words(), place.table)).collect()
    };
    (quantities, [alone(&of_a, &of_b), alone(&of_b, &of_a)])
}

/// Values of both releases: of the terrains that they share, or of all.
struct Sides {
    first: Vec<f64>,
    second: Vec<f64>,
    paired: bool,
    left_out: [usize; 2],
}

impl Sides {
    fn of(a: &Metric, b: &Metric, shared: Option<&BTreeSet<&String>>) -> Self {
        let mean = |(sum, n): &Mean| sum / *n as f64;
        let (a, b) = (&a.by_terrain, &b.by_terrain);
        let Some(shared) = shared else {
            let all = |of: &BTreeMap<String, Mean>| of.values().map(mean).collect();
            return Self { first: all(a), second: all(b), paired: false, left_out: [0; 2] };
        };
        let pair = |(terrain, value): (&String, &Mean)| {
            Some((mean(value), mean(b.get(terrain).filter(|_| shared.contains(terrain))?)))
        };
        let (first, second): (Vec<f64>, Vec<f64>) = a.iter().filter_map(pair).unzip();
        let left_out = [a.len() - first.len(), b.len() - first.len()];
        Self { first, second, paired: true, left_out }
    }
}

fn unit<R: Record>(column: &str) -> &'static str {
    R::TABLE.columns.iter().find(|c| c.name == column).map_or("1", |c| c.unit)
}

/// A quantity without its answer, which needs all of them.
fn quantity(
    place: &Place,
    (name, metric): (&'static str, &Metric),
    sides: &Sides,
    settings: Settings,
    draws: usize,
    streams: &Streams,
) -> Quantity {
    let Sides { first, second, paired, left_out } = sides;
    let (table, group) = (place.table, place.in_words());
    let mut stream = streams.stream(&format!("{table}/{group}/{name}"));
    let pairs = first.iter().zip(second).map(|(a, b)| [*a, *b]);
    let Difference { test, effect, means } = match paired {
        true => Difference::of_pairs(pairs, 1.0 - settings.alpha, draws, &mut stream),
        false => Difference::apart(first, second, 1.0 - settings.alpha, draws, &mut stream),
    };
    let equal = !first.is_empty() && first == second && *left_out == [0; 2];
    let scale = metric.scale.unwrap_or_else(|| sums::mean(first).abs());
    let margin = Some(settings.margin * scale).filter(|margin| *margin > 0.0);
    let known = |p: f64| Some(p).filter(|p| !p.is_nan());
    let three = |i: Interval| [i.estimate, i.low, i.high];
    let scattered = means.filter(MeanDifference::scatters);
    let interval = scattered.map(|m| m.interval(1.0 - 2.0 * settings.alpha));
    let [a, b] = [first, second].map(|values| sums::mean(values));
    Quantity {
        table,
        group,
        name,
        unit: metric.unit,
        terrains: [first.len(), second.len()],
        paired: *paired,
        left_out: *left_out,
        equal,
        a,
        b,
        shift: effect.map(|e| three(e.shift)),
        delta: effect.map(|e| three(e.delta)),
        difference: b - a,
        interval: interval.map(|i| [i.low, i.high]),
        margin,
        p: test.filter(|_| !equal).map(|test| test.p),
        p_adjusted: None,
        p_equivalence: means.zip(margin).and_then(|(m, margin)| known(m.equivalence_p(margin))),
        answer: if equal { Answer::Same } else { Answer::CannotTell },
    }
}

/// Sets the answers: equal values are the same, and so are means within the margin; other quantities are different by the adjusted `p`.
fn judge(quantities: &mut [Quantity], alpha: f64) {
    let p: Vec<f64> = quantities.iter().map(|q| q.p.unwrap_or(f64::NAN)).collect();
    for (quantity, adjusted) in quantities.iter_mut().zip(holm(&p)) {
        quantity.p_adjusted = Some(adjusted).filter(|p| !p.is_nan());
        if quantity.p_equivalence.is_some_and(|p| p <= alpha) {
            quantity.answer = Answer::Same;
        } else if adjusted <= alpha {
            quantity.answer = Answer::Different;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: [&str; 4] = ["a", "b", "c", "d"];

    /// Normal values with mean 10 of four quantities, on terrains whose random streams are named by `seed`, raised by `shift`.
    fn drawn(terrains: usize, seed: u64, shift: f64) -> Metrics {
        let mut stream = Streams::for_seed(seed, "drawn").stream("values");
        let mut metrics = Metrics::default();
        let place = Place { table: "missions", label: "g".to_owned(), variant: None, run: None };
        for k in 0..terrains {
            let terrain = format!("t-{k:04}");
            for metric in COLUMNS {
                metrics.add(&place, (metric, "m", None), &terrain, 10.0 + shift + stream.normal());
            }
            let of = Terrain { label: "g".into(), content: None, stream: Some(seed.to_string()) };
            metrics.terrains.insert(terrain, of);
        }
        metrics
    }

    fn compared(a: &Metrics, b: &Metrics) -> Vec<Quantity> {
        compare(a, b, Settings { margin: 0.05, alpha: 0.05 }, &Streams::for_seed(1, "compare")).0
    }

    /// Null: both releases have normal values from one distribution, 7 terrains each, four quantities. Statistic: comparisons
    /// with any "different" among 200, each with probability 0.05 at most. More than 27 have a probability below 1e-6; a
    /// test without adjustment (rate 0.19) would give about 37.
    #[test]
    fn stat_differences_are_rarely_found_under_the_null() {
        let any = |k: u64| {
            let found = compared(&drawn(7, 2 * k + 10, 0.0), &drawn(7, 2 * k + 11, 0.0));
            found.iter().any(|q| q.answer == Answer::Different)
        };
        let wrong = (0..200).filter(|k| any(*k)).count();
        assert!(wrong <= 27, "{wrong} of 200");
    }

    #[test]
    fn val_answers() {
        let a = drawn(20, 1, 0.0);
        let all = |quantities: Vec<Quantity>, answer| quantities.iter().all(|q| q.answer == answer);
        // Equal values; the same terrains raised by a little more and by a little less than the margin.
        assert!(all(compared(&a, &a), Answer::Same));
        let raised = |by: f64| {
            let mut b = drawn(20, 1, 0.0);
            let metrics = b.values.values_mut().flat_map(BTreeMap::values_mut);
            let means = metrics.flat_map(|metric| metric.by_terrain.values_mut());
            means.enumerate().for_each(|(k, (sum, _))| *sum += by + 1e-3 * (k % 7) as f64);
            b
        };
        let (above, below) = (compared(&a, &raised(1.0)), compared(&a, &raised(0.1)));
        // Two of 2^20 arrangements of signs are as extreme; of the 9999 that are drawn none is expected.
        assert!(above.iter().all(|q| q.paired && q.p.is_some_and(|p| p <= 3e-4)), "{above:?}");
        assert!(all(above, Answer::Different) && all(below, Answer::Same));
        // Different terrains: too few to tell, far apart, and a single one.
        assert!(all(compared(&drawn(4, 2, 0.0), &drawn(4, 3, 0.0)), Answer::CannotTell));
        let apart = compared(&a, &drawn(20, 2, 5.0));
        assert!(apart.iter().all(|q| !q.paired) && all(apart, Answer::Different));
        let one = compared(&drawn(1, 2, 0.0), &drawn(1, 3, 0.0));
        assert!(one.iter().all(|q| q.p == Some(1.0) && q.p_equivalence.is_none()) && all(one, Answer::CannotTell));
    }

    /// Two of three missions arrive, with pitch rates of 10 and 20 deg/s: success is 200 / 3 %, the pitch rate 15 deg/s, whatever the rate
    /// of the mission that was stuck. Margins are 5 points of success and 5 % of the mean.
    #[test]
    fn val_a_terrain_counts_by_the_mean_of_its_missions() {
        let mut data = crate::tests::made_up::full(1, 24);
        let (terrain, mission) = (data.terrains.swap_remove(0), data.missions.swap_remove(0));
        let mission = Mission { variant: None, ..mission };
        let metrics = |pitch: [f64; 3]| {
            let mut metrics = Metrics::default();
            metrics.add_terrain(&terrain, Some("hash"));
            for (outcome, rms_pitch_rate_deg_s) in ["success", "success", "stuck"].into_iter().zip(pitch) {
                let (terrain_id, outcome, group) =
                    (terrain.terrain_id.as_str().into(), outcome.into(), Some("g".into()));
                let row = Mission { terrain_id, outcome, group, rms_pitch_rate_deg_s, ..mission.clone() };
                metrics.add_mission(&row);
            }
            metrics
        };
        let of = |quantities: &[Quantity], name: &str| quantities.iter().find(|q| q.name == name).unwrap().clone();
        let same = compared(&metrics([10.0, 20.0, 90.0]), &metrics([10.0, 20.0, 30.0]));
        assert!(same.iter().all(|q| q.equal && q.answer == Answer::Same), "{same:?}");
        let (success, pitch) = (of(&same, "success"), of(&same, "rms_pitch_rate_deg_s"));
        assert!((success.a - 200.0 / 3.0).abs() < 1e-12 && (pitch.a - 15.0).abs() < 1e-12, "{success:?} {pitch:?}");
        assert!((success.margin.unwrap() - 5.0).abs() < 1e-12 && (pitch.margin.unwrap() - 0.75).abs() < 1e-12);
        assert_eq!((success.table, success.group.as_str(), success.unit, pitch.unit), ("missions", "g", "%", "deg/s"));
        let relief = of(&same, "relief_m");
        assert_eq!((relief.table, relief.a, relief.unit), ("terrains", terrain.relief_m, "m"));
        // Differences are B minus A.
        let pitch = of(&compared(&metrics([10.0, 20.0, 0.0]), &metrics([16.0, 20.0, 0.0])), "rms_pitch_rate_deg_s");
        assert!((pitch.difference - 3.0).abs() < 1e-12 && pitch.terrains == [1, 1] && pitch.paired && !pitch.equal);
    }

    /// A release with more terrains than the other, and one that lacks a value on one terrain: terrains that both have are pairs.
    #[test]
    fn val_shared_terrains_are_pairs() {
        let (few, more) = (drawn(12, 1, 0.0), drawn(20, 1, 0.0));
        for q in compared(&few, &more) {
            assert_eq!((q.paired, q.terrains, q.left_out, q.equal), (true, [12, 12], [0, 8], false));
            // No difference on 12 terrains: a sign test against the margin, 2^-12.
            assert_eq!((q.p, q.p_equivalence, q.answer), (Some(1.0), Some(1.0 / 4096.0), Answer::Same));
        }
        let mut without = drawn(12, 1, 0.0);
        let metrics = without.values.values_mut().flat_map(BTreeMap::values_mut);
        metrics.take(1).for_each(|metric| assert!(metric.by_terrain.remove("t-0003").is_some()));
        let found: Vec<(bool, usize, bool)> =
            compared(&few, &without).iter().map(|q| (q.paired, q.terrains[0], q.equal)).collect();
        assert_eq!(found, [(true, 11, false), (true, 12, true), (true, 12, true), (true, 12, true)]);
    }

    /// Only one terrain of many in common: the others are not left out.
    #[test]
    fn val_groups_that_share_few_terrains_are_not_paired() {
        let (a, mut b) = (drawn(20, 1, 0.0), drawn(20, 2, 0.0));
        b.terrains.insert("t-0000".into(), a.terrains["t-0000"].clone());
        assert!(compared(&a, &b).iter().all(|q| !q.paired && q.terrains == [20, 20] && !q.equal));
    }

    /// Every terrain is raised by the same small amount: a significant difference, but within the margin.
    #[test]
    fn val_a_constant_difference_within_the_margin_counts_as_the_same() {
        let (a, mut b) = (drawn(20, 1, 0.0), drawn(20, 1, 0.0));
        for metric in b.values.values_mut().flat_map(BTreeMap::values_mut) {
            metric.by_terrain.values_mut().for_each(|(sum, _)| *sum += 0.05);
        }
        for q in compared(&a, &b) {
            assert!(q.p.is_some_and(|p| p < 1e-3) && q.answer == Answer::Same, "{q:?}");
        }
    }

    /// Runs with different names are compared if each release has one, and are kept separate if there are two.
    #[test]
    fn val_several_runs_are_kept_separate() {
        let renamed = |run: &str| {
            let mut metrics = drawn(5, 1, 0.0);
            let old = std::mem::take(&mut metrics.values);
            metrics.values = old.into_iter().map(|(p, f)| (Place { run: Some(run.to_owned()), ..p }, f)).collect();
            metrics
        };
        let (one, mut two) = (renamed("husky"), renamed("jackal"));
        assert!(compared(&one, &two).iter().all(|q| q.group == "g" && q.equal));
        two.values.extend(renamed("husky").values);
        let (quantities, alone) =
            compare(&one, &two, Settings { margin: 0.05, alpha: 0.05 }, &Streams::for_seed(1, "c"));
        assert!(quantities.len() == 4 && quantities.iter().all(|q| q.group == "g, husky"));
        assert_eq!(alone, [vec![], vec!["g, jackal (missions)".to_owned()]]);
    }
}
