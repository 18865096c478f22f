//! Clusters that a bootstrap resamples: whole terrains, because missions on one terrain are correlated; if groups share their
//! random draws (common pairs), whole blocks of paired terrains, because these are correlated too.

use crate::data::{Data, Group, Mission};
use sastrugi_numeric::{Stream, sums};
use sastrugi_statistics::{Interval, cluster_interval};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

/// Bootstrap samples behind an interval.
pub const REPLICATES: usize = 1000;
/// Fewest bootstrap samples: with very many missions a sample takes long, and this many still determine the ends of a band.
const REPLICATES_MIN: usize = 250;
/// Total number of resampled values of an interval, above which fewer samples are drawn.
const DRAWN_MAX: usize = 10_000_000;
/// Nominal coverage of an interval of an estimate.
pub const LEVEL: f64 = 0.95;
/// Coverage of a sampling band, 5 to 95 %.
pub const BAND: f64 = 0.9;

/// The random stream of a bootstrap, named by the item that is resampled (a group) and by the quantity.
pub fn stream(data: &Data, item: &str, figure: &str) -> Stream {
    data.stream(item, figure)
}

/// Median of a group's values, which are given with their terrains, and its sampling band.
pub fn band(data: &Data, group: &str, figure: &str, values: &[(&str, f64)]) -> Option<Interval> {
    median_interval(data, group, figure, values, BAND)
}

/// Interval of the median of values, which are given with their clusters: that of [`Clusters::interval`], but without a copy of the values
/// for each bootstrap sample.
pub fn median_interval(data: &Data, group: &str, figure: &str, values: &[(&str, f64)], level: f64) -> Option<Interval> {
    let mut values: Vec<(&str, f64)> = values.iter().copied().filter(|v| v.1.is_finite()).collect();
    // Resampling keeps the order, and the median of sorted values is fast.
    values.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (clusters, items) = numbered(&values);
    let median = |drawn: &[Vec<usize>]| {
        let times = times(&drawn[0], clusters);
        sums::median_counted(items.iter().map(|(cluster, value)| (*value, times[*cluster])))
    };
    cluster_interval(&[clusters], replicates(items.len()), level, &mut stream(data, group, figure), median)
}

/// Number of bootstrap samples for an interval of this many values: [`REPLICATES`] up to 10 000 of them.
pub fn replicates(values: usize) -> usize {
    (DRAWN_MAX / values.max(1)).clamp(REPLICATES_MIN, REPLICATES)
}

/// How often each of `clusters` clusters was drawn.
pub fn times(drawn: &[usize], clusters: usize) -> Vec<usize> {
    let mut times = vec![0; clusters];
    drawn.iter().for_each(|&c| times[c] += 1);
    times
}

/// The block of a pair: its id without the number of the mission.
pub fn block(pair_id: &str) -> &str {
    pair_id.rsplit_once('-').map_or(pair_id, |(block, _)| block)
}

/// True when missions of at least two groups have a `pair_id` in common.
pub fn paired(groups: &[Group<Mission>]) -> bool {
    if groups.len() < 2 {
        return false;
    }
    let mut first: HashMap<&str, usize> = HashMap::new();
    let mut missions = groups.iter().enumerate().flat_map(|(g, group)| group.rows.iter().map(move |m| (g, *m)));
    missions.any(|(g, mission)| *first.entry(&mission.pair_id).or_insert(g) != g)
}

/// The different names, in order. Most names of missions occur many times.
fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> BTreeSet<&'a str> {
    names.collect::<HashSet<&str>>().into_iter().collect()
}

/// Which cluster each terrain of a comparison belongs to.
#[derive(Clone, Debug)]
pub struct Pairing<'a> {
    blocks: BTreeMap<&'a str, &'a str>,
}

impl<'a> Pairing<'a> {
    /// The pairing of the release's plain groups.
    pub fn of(data: &'a Data) -> Self {
        Self::among(&data.mission_groups())
    }

    /// The pairing of groups: blocks if groups share pairs, otherwise terrains.
    pub fn among(groups: &[Group<'a, Mission>]) -> Self {
        let missions = groups.iter().flat_map(|g| g.rows.iter().copied());
        let entry = |m: &'a Mission| (m.terrain_id.as_str(), block(&m.pair_id));
        Self { blocks: if paired(groups) { missions.map(entry).collect() } else { BTreeMap::new() } }
    }

    /// True when groups share pairs.
    pub fn is_common(&self) -> bool {
        !self.blocks.is_empty()
    }

    /// The cluster of a terrain.
    pub fn cluster(&self, terrain_id: &'a str) -> &'a str {
        self.blocks.get(terrain_id).copied().unwrap_or(terrain_id)
    }
}

/// Number of clusters, and every item with the number of its cluster in the order of their names.
pub fn numbered<T: Copy>(items: &[(&str, T)]) -> (usize, Vec<(usize, T)>) {
    let names = distinct(items.iter().map(|i| i.0));
    let numbers: HashMap<&str, usize> = names.into_iter().enumerate().map(|(k, name)| (name, k)).collect();
    (numbers.len(), items.iter().map(|(name, item)| (numbers[name], *item)).collect())
}

/// Items of several groups by cluster. Groups that have a cluster in common are resampled together.
#[derive(Clone, Debug)]
pub struct Clusters<T> {
    /// Clusters in each independent sample.
    samples: Vec<usize>,
    /// For each group, its sample, and its items with their cluster in that sample, in the order given.
    groups: Vec<(usize, Vec<(usize, T)>)>,
}

impl<T: Copy> Clusters<T> {
    /// From the clusters and items of each group.
    pub fn new(groups: &[Vec<(&str, T)>]) -> Self {
        let names: Vec<BTreeSet<&str>> = groups.iter().map(|g| distinct(g.iter().map(|v| v.0))).collect();
        let common = names.iter().enumerate().any(|(i, a)| names[..i].iter().any(|b| !a.is_disjoint(b)));
        let samples: Vec<BTreeSet<&str>> = if common { vec![names.into_iter().flatten().collect()] } else { names };
        let of_group = |(g, items): (usize, &Vec<(&str, T)>)| {
            let sample = if common { 0 } else { g };
            let numbers: HashMap<&str, usize> = samples[sample].iter().enumerate().map(|(i, n)| (*n, i)).collect();
            (sample, items.iter().map(|(name, item)| (numbers[name], *item)).collect())
        };
        let groups = groups.iter().enumerate().map(of_group).collect();
        Self { samples: samples.iter().map(BTreeSet::len).collect(), groups }
    }

    /// The items of every group when these clusters are drawn, each as often as its cluster, in their original order.
    pub fn pooled(&self, drawn: &[Vec<usize>]) -> Vec<Vec<T>> {
        let times: Vec<Vec<usize>> = drawn.iter().zip(&self.samples).map(|(drawn, n)| times(drawn, *n)).collect();
        let group = |(sample, items): &(usize, Vec<(usize, T)>)| {
            let mut pooled = Vec::with_capacity(items.len());
            for (cluster, item) in items {
                (0..times[*sample][*cluster]).for_each(|_| pooled.push(*item));
            }
            pooled
        };
        self.groups.iter().map(group).collect()
    }

    /// Percentile interval of a statistic of the items of every group; `None` with fewer than two clusters.
    pub fn interval(&self, stream: &mut Stream, level: f64, statistic: impl Fn(&[Vec<T>]) -> f64) -> Option<Interval> {
        let values: usize = self.groups.iter().map(|g| g.1.len()).sum();
        cluster_interval(&self.samples, replicates(values), level, stream, |drawn| statistic(&self.pooled(drawn)))
    }
}

impl Clusters<f64> {
    /// As [`Self::interval`], for a function of the medians of the groups, whose values are sorted. Values are not copied for each bootstrap
    /// sample.
    pub fn interval_of_medians(
        &self,
        stream: &mut Stream,
        level: f64,
        statistic: impl Fn(&[f64]) -> f64,
    ) -> Option<Interval> {
        let values: usize = self.groups.iter().map(|g| g.1.len()).sum();
        cluster_interval(&self.samples, replicates(values), level, stream, |drawn| {
            let times: Vec<Vec<usize>> = drawn.iter().zip(&self.samples).map(|(drawn, n)| times(drawn, *n)).collect();
            let median = |(sample, items): &(usize, Vec<(usize, f64)>)| {
                sums::median_counted(items.iter().map(|(cluster, value)| (*value, times[*sample][*cluster])))
            };
            statistic(&self.groups.iter().map(median).collect::<Vec<_>>())
        })
    }
}

/// The clusters that intervals resample, in words.
pub fn in_words(pairing: &Pairing) -> &'static str {
    if pairing.is_common() { "blocks of paired terrains" } else { "terrains" }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    #[test]
    fn val_blocks() {
        assert_eq!(block("straight-0003-0017"), "straight-0003");
        assert_eq!(block("alone"), "alone");
    }

    /// The same bits as the median of the pooled values of each bootstrap sample, which are listed one by one.
    #[test]
    fn prop_a_band_is_that_of_pooled_values() {
        let data = crate::tests::made_up::empty();
        let mut s = Streams::for_seed(1, "clusters-test").stream("band");
        for n in [1, 2, 7, 60, 61] {
            let names: Vec<String> = (0..n).map(|_| format!("t{}", s.below(9))).collect();
            let values: Vec<(&str, f64)> =
                names.iter().map(|name| (name.as_str(), (4.0 * s.normal()).round())).collect();
            let fast = [BAND, LEVEL].map(|level| median_interval(&data, "group", "figure", &values, level));
            assert_eq!(band(&data, "group", "figure", &values), fast[0]);
            let pooled = Clusters::new(&[values]);
            let median = |pooled: &[Vec<f64>]| sums::median(&pooled[0]);
            let slow = [BAND, LEVEL].map(|level| pooled.interval(&mut stream(&data, "group", "figure"), level, median));
            assert_eq!(fast, slow, "{n}");
        }
    }

    /// The same bits as the medians of the pooled values, for groups with their own clusters and with common ones, some of which lack values in
    /// one group.
    #[test]
    fn prop_intervals_of_medians_are_those_of_pooled_values() {
        let mut s = Streams::for_seed(2, "clusters-test").stream("medians");
        for (n, clusters) in [(3, 9), (40, 9), (41, 3), (200, 50)] {
            let names: Vec<String> = (0..2 * n).map(|_| format!("t{}", s.below(clusters))).collect();
            let values = [(); 2].map(|()| (0..n).map(|_| (4.0 * s.normal()).round()).collect::<Vec<f64>>());
            let of = |names: &[String], values: &[f64], prefix: &str| {
                let mut items: Vec<(String, f64)> =
                    names.iter().zip(values).map(|(name, value)| (format!("{prefix}{name}"), *value)).collect();
                items.sort_by(|a, b| a.1.total_cmp(&b.1));
                items
            };
            for prefix in ["", "own-"] {
                let items = [of(&names[..n], &values[0], ""), of(&names[n..], &values[1], prefix)];
                let groups =
                    items.each_ref().map(|g| g.iter().map(|(name, v)| (name.as_str(), *v)).collect::<Vec<_>>());
                let clusters = Clusters::new(&groups);
                let stream = || Streams::for_seed(3, "clusters-test").stream("drawn");
                let change = |medians: &[f64]| medians[1] - 0.5 * medians[0];
                let fast = clusters.interval_of_medians(&mut stream(), BAND, change);
                let slow = clusters.interval(&mut stream(), BAND, |pooled| {
                    change(&[sums::median(&pooled[0]), sums::median(&pooled[1])])
                });
                assert!(fast.is_some() || n < 9, "{n}");
                assert_eq!(format!("{fast:?}"), format!("{slow:?}"), "{n} {prefix}");
            }
        }
    }

    /// Two groups share pairs if any mission of one has the pair of a mission of the other; a pair that is twice in one group does not count.
    #[test]
    fn val_pairs_between_groups() {
        let missions = crate::tests::made_up::full(1, 24).missions;
        let with = |pair: &str| Mission { pair_id: pair.into(), ..missions[0].clone() };
        let [a, b] = ["a", "b"].map(with);
        let group = |rows: Vec<_>| Group { name: String::new(), label: String::new(), run: None, index: 0, rows };
        assert!(paired(&[group(vec![&a]), group(vec![&b]), group(vec![&b, &a])]));
        assert!(!paired(&[group(vec![&a, &a]), group(vec![&b, &b])]) && !paired(&[group(vec![&a, &a])]));
    }

    /// Groups with common clusters are resampled together, so the difference of equal groups has no scatter; independent groups do.
    #[test]
    fn val_common_clusters_are_resampled_together() {
        let group = |names: &'static str| names.split(' ').zip((0..9).map(f64::from)).collect::<Vec<_>>();
        let (a, b) = (group("a b c d e f g h i"), group("j k l m n o p q r"));
        let difference = |v: &[Vec<f64>]| v[1].iter().sum::<f64>() - v[0].iter().sum::<f64>();
        let mut s = Streams::for_seed(1, "clusters-test").stream("pairs");
        let together = Clusters::new(&[a.clone(), a.clone()]);
        let i = together.interval(&mut s, 0.9, difference).unwrap();
        assert_eq!((&together.samples[..], i.low, i.high), (&[9][..], 0.0, 0.0));
        let apart = Clusters::new(&[a, b]);
        let i = apart.interval(&mut s, 0.9, difference).unwrap();
        assert!(apart.samples == [9, 9] && i.low < -5.0 && i.high > 5.0, "{i:?}");
    }
}
