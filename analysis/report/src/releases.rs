//! Two releases beside each other, figure by figure and group by group: what the verb `compare` and the report's section on another
//! release both say.
//!
//! Terrains are the units: a terrain's value is the mean over its missions (of success: of all; of other figures: of the
//! successful ones). Terrains that both releases have, with equal heights or from the same random draws under one id, are compared in
//! pairs, and a group that has such terrains by these alone; other groups are compared as independent samples. Tests and shifts are
//! those of [`Difference`], adjusted by Holm over all figures; a difference of means whose interval of coverage `1 - 2 alpha` lies
//! within the margin is none that matters (two one-sided tests).

use sastrugi_numeric::{Streams, sums};
use sastrugi_schemas::study::Statistic;
use sastrugi_schemas::tables::{MissionRow, TerrainRow};
use sastrugi_schemas::{Answer, Record};
use sastrugi_statistics::{Difference, Interval, MeanDifference, holm, permutation};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Margin of equivalence: a share of the other release's mean; of success and the shares of classes, of one.
pub const MARGIN: f64 = 0.05;

/// A figure of a terrain: column, scale of the margin, value.
type OfTerrain = (&'static str, Option<f64>, fn(&TerrainRow) -> f64);

/// Figures of a terrain, with the scale of the margin where it is not the mean.
const OF_TERRAINS: [OfTerrain; 7] = [
    ("relief_m", None, |t| t.relief_m),
    ("rms_height_m", None, |t| t.rms_height_m),
    ("rms_slope", None, |t| t.rms_slope),
    ("share_low", Some(1.0), |t| t.share_low),
    ("share_semi", Some(1.0), |t| t.share_semi),
    ("share_high", Some(1.0), |t| t.share_high),
    ("psd_slope", None, |t| t.psd_slope),
];

/// How figures are judged.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Difference of means that counts as none, as [`MARGIN`].
    pub margin: f64,
    /// Probability of any false "different", and of each false "same".
    pub alpha: f64,
}

/// A figure of a group in two releases, A and B. Values are one per terrain; differences are B less A.
#[derive(Clone, Debug, Serialize)]
pub struct Quantity {
    /// Table.
    pub table: &'static str,
    /// Label of the group, with the variant and the run where there are several.
    pub group: String,
    /// Column, or `success`.
    pub figure: &'static str,
    /// Unit of the figure.
    pub unit: &'static str,
    /// Terrains in A and B that were compared.
    pub terrains: [usize; 2],
    /// True when terrains are compared in pairs.
    pub paired: bool,
    /// True when the terrains compared have the same values in both.
    pub equal: bool,
    /// Mean of A.
    pub a: f64,
    /// Mean of B.
    pub b: f64,
    /// Hodges and Lehmann's shift, with an interval of coverage `1 - alpha`; an end that the terrains do not tell is null.
    pub shift: Option<[f64; 3]>,
    /// Cliff's delta, with an interval of coverage `1 - alpha`.
    pub delta: Option<[f64; 3]>,
    /// Difference of means.
    pub difference: f64,
    /// Its interval with coverage `1 - 2 alpha`, by which `same` is decided.
    pub interval: Option<[f64; 2]>,
    /// Differences of means up to this count as none.
    pub margin: Option<f64>,
    /// Of the rank test.
    pub p: Option<f64>,
    /// The same after Holm, over all figures of the comparison.
    pub p_adjusted: Option<f64>,
    /// Of the two one-sided tests.
    pub p_equivalence: Option<f64>,
    /// Same: equal, or within the margin. Different: by the adjusted `p`, and not shown to be the same.
    pub answer: Answer,
}

/// Sum and number of finite values.
type Mean = (f64, usize);

/// Where rows are compared: table, label, variant, run.
type Place = (&'static str, String, Option<String>, Option<String>);

/// Every figure, by terrain.
type ByFigure = BTreeMap<Name, BTreeMap<String, Mean>>;

/// Figures of a release, summed row by row: memory grows with the terrains, not with the missions.
#[derive(Clone, Debug, Default)]
pub struct Figures {
    /// By place and figure: by terrain.
    values: BTreeMap<Place, ByFigure>,
    /// Label, hash of the heights and words of the random streams of every terrain.
    terrains: BTreeMap<String, Terrain>,
}

/// Column, unit, and the scale of the margin where it is not the mean.
#[derive(Clone, Copy, Debug)]
struct Name {
    figure: &'static str,
    unit: &'static str,
    scale: Option<f64>,
}

impl PartialEq for Name {
    fn eq(&self, other: &Self) -> bool {
        self.figure == other.figure
    }
}

impl Eq for Name {}

impl PartialOrd for Name {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Name {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.figure.cmp(other.figure)
    }
}

#[derive(Clone, Debug)]
struct Terrain {
    label: String,
    content: Option<String>,
    stream: Option<String>,
}

impl Figures {
    /// Adds a terrain, with the hash of its heights where the release states it. Before the missions on it.
    pub fn add_terrain(&mut self, row: &TerrainRow, content: Option<&str>) {
        let label = crate::data::label(row).to_owned();
        let place = (TerrainRow::TABLE.name, label.clone(), row.variant.clone(), None);
        for (figure, scale, value) in OF_TERRAINS {
            let name = Name { figure, unit: unit::<TerrainRow>(figure), scale };
            self.add(&place, name, &row.terrain_id, value(row));
        }
        let (content, stream) = (content.map(str::to_owned), row.stream.clone());
        self.terrains.insert(row.terrain_id.clone(), Terrain { label, content, stream });
    }

    /// Adds a mission.
    pub fn add_mission(&mut self, row: &MissionRow) {
        let of_terrain = || self.terrains.get(&row.terrain_id).map(|t| t.label.clone());
        let label = row.group.clone().or_else(of_terrain).unwrap_or_else(|| "all".to_owned());
        let place = (MissionRow::TABLE.name, label, row.variant.clone(), Some(row.traverse_id.clone()));
        for statistic in Statistic::ALL {
            let success = statistic == Statistic::Success;
            let figure = statistic.column();
            let unit = if success { "%" } else { unit::<MissionRow>(figure) };
            let name = Name { figure, unit, scale: success.then_some(100.0) };
            self.add(&place, name, &row.terrain_id, statistic.of(row));
        }
    }

    fn add(&mut self, place: &Place, name: Name, terrain: &str, value: f64) {
        if !self.values.contains_key(place) {
            self.values.insert(place.clone(), BTreeMap::new());
        }
        let Some(figures) = self.values.get_mut(place).filter(|_| value.is_finite()) else { return };
        let of_terrains = figures.entry(name).or_default();
        match of_terrains.get_mut(terrain) {
            Some((sum, count)) => (*sum, *count) = (*sum + value, *count + 1),
            None => drop(of_terrains.insert(terrain.to_owned(), (value, 1))),
        }
    }

    /// True when missions of one group and variant belong to several runs.
    fn has_several_runs(&self) -> bool {
        let mut places: Vec<_> = self.values.keys().map(|(table, label, variant, _)| (table, label, variant)).collect();
        places.dedup();
        places.len() < self.values.len()
    }

    /// Figures by table and the words of the group.
    fn by_group(&self, with_runs: bool) -> BTreeMap<(&'static str, String), &ByFigure> {
        let key = |(table, label, variant, run): &Place| {
            let parts = [Some(label), variant.as_ref(), run.as_ref().filter(|_| with_runs)];
            (*table, parts.into_iter().flatten().cloned().collect::<Vec<_>>().join(", "))
        };
        self.values.iter().map(|(place, figures)| (key(place), figures)).collect()
    }

    /// True when a terrain is the same in both, or made from the same random draws.
    fn shares_ground(&self, other: &Self, terrain: &str) -> bool {
        let same = |a: &Option<String>, b: &Option<String>| a.is_some() && a == b;
        let both = self.terrains.get(terrain).zip(other.terrains.get(terrain));
        both.is_some_and(|(a, b)| same(&a.content, &b.content) || same(&a.stream, &b.stream))
    }
}

/// Every figure that both releases have, and the groups that only A and only B has.
pub fn compare(a: &Figures, b: &Figures, settings: Settings, streams: &Streams) -> (Vec<Quantity>, [Vec<String>; 2]) {
    let with_runs = a.has_several_runs() || b.has_several_runs();
    let (of_a, of_b) = (a.by_group(with_runs), b.by_group(with_runs));
    let mut compared = Vec::new();
    for ((table, group), figures) in &of_a {
        let Some(others) = of_b.get(&(*table, group.clone())) else { continue };
        let terrains: BTreeSet<&String> = figures.values().flat_map(BTreeMap::keys).collect();
        let paired = terrains.into_iter().any(|t| a.shares_ground(b, t));
        for (name, first) in figures.iter() {
            let Some(second) = others.get(name) else { continue };
            let shared = |t: &str| paired && a.shares_ground(b, t);
            compared.push(((*table, group.as_str(), *name), Sides::of(first, second, paired, shared)));
        }
    }
    let draws = permutation::draws(compared.len(), settings.alpha);
    let of = |(key, sides): &(_, Sides)| quantity(*key, sides, settings, draws, streams);
    let mut quantities: Vec<Quantity> = compared.iter().map(of).collect();
    judge(&mut quantities, settings.alpha);
    let alone = |one: &BTreeMap<(&str, String), _>, other: &BTreeMap<(&str, String), _>| {
        let only = one.keys().filter(|key| !other.contains_key(*key));
        only.map(|(table, group)| format!("{group} ({table})")).collect()
    };
    (quantities, [alone(&of_a, &of_b), alone(&of_b, &of_a)])
}

/// Values of both releases: of the terrains that they share, or of each.
struct Sides {
    first: Vec<f64>,
    second: Vec<f64>,
    paired: bool,
}

impl Sides {
    fn of(a: &BTreeMap<String, Mean>, b: &BTreeMap<String, Mean>, paired: bool, shared: impl Fn(&str) -> bool) -> Self {
        let mean = |(sum, n): &Mean| sum / *n as f64;
        if !paired {
            let all = |of: &BTreeMap<String, Mean>| of.values().map(mean).collect();
            return Self { first: all(a), second: all(b), paired };
        }
        let pair =
            |(terrain, value): (&String, &Mean)| Some((mean(value), mean(b.get(terrain).filter(|_| shared(terrain))?)));
        let (first, second): (Vec<f64>, Vec<f64>) = a.iter().filter_map(pair).unzip();
        Self { first, second, paired }
    }
}

fn unit<R: Record>(column: &str) -> &'static str {
    R::TABLE.columns.iter().find(|c| c.name == column).map_or("1", |c| c.unit)
}

/// A figure without its answer, which needs all of them.
fn quantity(
    (table, group, name): (&'static str, &str, Name),
    sides: &Sides,
    settings: Settings,
    draws: usize,
    streams: &Streams,
) -> Quantity {
    let Sides { first, second, paired } = sides;
    let mut stream = streams.stream(&format!("{table}/{group}/{}", name.figure));
    let pairs = first.iter().zip(second).map(|(a, b)| [*a, *b]);
    let Difference { test, effect, means } = match paired {
        true => Difference::of_pairs(pairs, 1.0 - settings.alpha, draws, &mut stream),
        false => Difference::apart(first, second, 1.0 - settings.alpha, draws, &mut stream),
    };
    let equal = !first.is_empty() && first == second;
    let scale = name.scale.unwrap_or_else(|| sums::mean(first).abs());
    let margin = Some(settings.margin * scale).filter(|margin| *margin > 0.0);
    let known = |p: f64| Some(p).filter(|p| !p.is_nan());
    let three = |i: Interval| [i.estimate, i.low, i.high];
    let scattered = means.filter(MeanDifference::scatters);
    let interval = scattered.map(|m| m.interval(1.0 - 2.0 * settings.alpha));
    let [a, b] = [first, second].map(|values| sums::mean(values));
    Quantity {
        table,
        group: group.to_owned(),
        figure: name.figure,
        unit: name.unit,
        terrains: [first.len(), second.len()],
        paired: *paired,
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

/// Answers: equal values are the same; so are means within the margin; other figures are different by the adjusted `p`.
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

    /// Normal values of mean 10 of four figures on terrains whose random streams are named by `seed`, raised by `shift`.
    fn drawn(terrains: usize, seed: u64, shift: f64) -> Figures {
        let mut stream = Streams::for_seed(seed, "drawn").stream("values");
        let mut figures = Figures::default();
        let place = ("missions", "g".to_owned(), None, None);
        for k in 0..terrains {
            let terrain = format!("t-{k:04}");
            for figure in COLUMNS {
                figures.add(&place, Name { figure, unit: "m", scale: None }, &terrain, 10.0 + shift + stream.normal());
            }
            let of = Terrain { label: "g".into(), content: None, stream: Some(seed.to_string()) };
            figures.terrains.insert(terrain, of);
        }
        figures
    }

    fn compared(a: &Figures, b: &Figures) -> Vec<Quantity> {
        compare(a, b, Settings { margin: 0.05, alpha: 0.05 }, &Streams::for_seed(1, "compare")).0
    }

    /// Null: both releases have normal values of one distribution, 7 terrains each, four figures. Statistic: comparisons
    /// with any "different" among 200, each with probability 0.05 at most. More than 27 have a probability below 1e-6; a
    /// test that took the figures one by one (rate 0.19) would give some 37.
    #[test]
    fn stat_any_difference_is_found_seldom_where_there_is_none() {
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
            let means = b.values.values_mut().flat_map(BTreeMap::values_mut).flat_map(BTreeMap::values_mut);
            means.enumerate().for_each(|(k, (sum, _))| *sum += by + 1e-3 * (k % 7) as f64);
            b
        };
        let (above, below) = (compared(&a, &raised(1.0)), compared(&a, &raised(0.1)));
        // Two of 2^20 arrangements of signs are as extreme; of the 9999 that are drawn none is expected.
        assert!(above.iter().all(|q| q.paired && q.p.is_some_and(|p| p <= 3e-4)), "{above:?}");
        assert!(all(above, Answer::Different) && all(below, Answer::Same));
        // Other terrains: too few to tell, far apart, and a single one.
        assert!(all(compared(&drawn(4, 2, 0.0), &drawn(4, 3, 0.0)), Answer::CannotTell));
        let apart = compared(&a, &drawn(20, 2, 5.0));
        assert!(apart.iter().all(|q| !q.paired) && all(apart, Answer::Different));
        let one = compared(&drawn(1, 2, 0.0), &drawn(1, 3, 0.0));
        assert!(one.iter().all(|q| q.p == Some(1.0) && q.p_equivalence.is_none()) && all(one, Answer::CannotTell));
    }

    /// A release with more terrains than the other, and one in which a figure lacks on a terrain: those that both have are pairs.
    #[test]
    fn val_shared_terrains_are_pairs() {
        let (few, more) = (drawn(12, 1, 0.0), drawn(20, 1, 0.0));
        for q in compared(&few, &more) {
            assert_eq!((q.paired, q.terrains, q.equal, q.answer), (true, [12, 12], true, Answer::Same));
        }
        let mut without = drawn(12, 1, 0.0);
        let figures = without.values.values_mut().flat_map(BTreeMap::values_mut);
        figures.take(1).for_each(|of| assert!(of.remove("t-0003").is_some()));
        let found: Vec<(bool, usize, bool)> =
            compared(&few, &without).iter().map(|q| (q.paired, q.terrains[0], q.equal)).collect();
        assert_eq!(found, [(true, 11, true), (true, 12, true), (true, 12, true), (true, 12, true)]);
    }

    /// Runs of other names are one another's while there is one in each release, and are told apart where there are two.
    #[test]
    fn val_runs_are_told_apart_where_there_are_several() {
        let renamed = |run: &str| {
            let mut figures = drawn(5, 1, 0.0);
            let old = std::mem::take(&mut figures.values);
            figures.values = old.into_iter().map(|(p, f)| ((p.0, p.1, p.2, Some(run.to_owned())), f)).collect();
            figures
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
