//! How a study divides into shards: which shards need an item, and what each shard costs.
//!
//! A shard needs its own items and their ancestors. An ancestor that several shards need is computed by each of them, unless they share a
//! cache that already has it. All costs are estimates for one core and an empty work area.

use super::graph::Graph;
use super::shard::owner;
use sastrugi_schemas::counted;
use serde::Serialize;

/// The share of reserved time that must be used for a number of shards to be recommended.
const USED_MIN: f64 = 0.5;
/// Maximum number of shards that is recommended.
const RECOMMENDED_MAX: u32 = 4096;
/// How much longer than the mean a shard may take before the plan says so.
const BALANCE_MAX: f64 = 1.5;

/// The shards that need an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Need {
    One(u32),
    Several,
}

impl Need {
    fn and(self, other: Self) -> Self {
        if self == other { self } else { Self::Several }
    }
}

/// The shards that need each item, as their own or as an ancestor of their own.
fn needs(graph: &Graph, count: u32) -> Vec<Need> {
    let mut needs: Vec<Need> =
        (0..graph.len()).map(|p| owner(graph.key(p), count).map_or(Need::Several, Need::One)).collect();
    // Children come after their parents, so each item has heard of all its descendants when its turn comes.
    for position in (0..graph.len()).rev() {
        for parent in graph.parents(position) {
            needs[parent] = needs[parent].and(needs[position]);
        }
    }
    needs
}

/// The common ancestors: items that more than one of `count` shards need, sorted. The parents of each are among them.
pub fn common_ancestors(graph: &Graph, count: u32) -> Vec<usize> {
    let several = |(position, need): (usize, Need)| (need == Need::Several).then_some(position);
    needs(graph, count).into_iter().enumerate().filter_map(several).collect()
}

/// Cost of some items on one core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Number of items.
    pub items: usize,
    /// Time, s.
    pub seconds: f64,
    /// Size of their files, bytes.
    pub bytes: f64,
    /// Peak working memory of the item that needs most, bytes.
    pub memory_bytes: u64,
}

impl Cost {
    fn of(graph: &Graph, positions: impl IntoIterator<Item = usize>) -> Self {
        positions.into_iter().fold(Self::default(), |cost, position| {
            let job = &graph.node(position).job;
            let estimate = job.estimate();
            Self {
                items: cost.items + 1,
                seconds: cost.seconds + estimate.seconds,
                bytes: cost.bytes + estimate.bytes,
                memory_bytes: cost.memory_bytes.max(job.memory_bytes()),
            }
        })
    }
}

/// One shard of a study.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ShardCost {
    /// Number of the shard, from 1.
    pub shard: u32,
    /// Its own items.
    pub own: usize,
    /// All it needs: its own items and their ancestors.
    pub needed: Cost,
    /// What is left to compute if a shared cache has the common ancestors.
    pub left: Cost,
}

/// A study divided into shards.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Division {
    /// The complete study.
    pub study: Cost,
    /// The items that more than one shard needs.
    pub common_ancestors: Cost,
    /// The shards.
    pub shards: Vec<ShardCost>,
    /// Time of all shards together if each computes all it needs, s.
    pub seconds_without_cache: f64,
    /// Time of the common ancestors and of all shards together with a shared cache, s: that of the study.
    pub seconds_with_cache: f64,
    /// The largest power of two of shards that use at least half of the time that is reserved for them.
    pub recommended: u32,
    /// What to know before the shards are started, one sentence each.
    pub advice: Vec<String>,
}

/// Divides a study into `count` shards.
pub fn divide(graph: &Graph, count: u32) -> Division {
    let study = Cost::of(graph, 0..graph.len());
    let shards = shards(graph, count);
    let mut division = Division {
        study,
        common_ancestors: Cost::of(graph, common_ancestors(graph, count)),
        seconds_without_cache: shards.iter().map(|shard| shard.needed.seconds).sum(),
        seconds_with_cache: study.seconds,
        recommended: recommended(graph, study),
        shards,
        advice: Vec::new(),
    };
    division.advice = advice(graph, &division, count);
    division
}

fn shards(graph: &Graph, count: u32) -> Vec<ShardCost> {
    let mut own = vec![Vec::new(); count as usize];
    let mut left = own.clone();
    for (position, need) in needs(graph, count).into_iter().enumerate() {
        if let Some(shard) = owner(graph.key(position), count) {
            own[shard as usize - 1].push(position);
        }
        if let Need::One(shard) = need {
            left[shard as usize - 1].push(position);
        }
    }
    let shard = |(shard, (own, left)): (u32, (Vec<usize>, Vec<usize>))| ShardCost {
        shard,
        own: own.len(),
        needed: Cost::of(graph, graph.closure(own)),
        left: Cost::of(graph, left),
    };
    (1..=count).zip(own.into_iter().zip(left)).map(shard).collect()
}

/// Time of the common ancestors, and of the longest of `count` shards after them, s.
fn phases(graph: &Graph, count: u32) -> (f64, f64) {
    let (mut common, mut shards) = (0.0, vec![0.0; count as usize]);
    for (position, need) in needs(graph, count).into_iter().enumerate() {
        let seconds = graph.node(position).job.estimate().seconds;
        match need {
            Need::One(shard) => shards[shard as usize - 1] += seconds,
            Need::Several => common += seconds,
        }
    }
    (common, shards.into_iter().fold(0.0, f64::max))
}

fn recommended(graph: &Graph, study: Cost) -> u32 {
    let most = RECOMMENDED_MAX.min(u32::try_from(study.items).unwrap_or(u32::MAX));
    let is_busy = |count: &u32| {
        let (common, longest) = phases(graph, *count);
        common + f64::from(*count) * longest <= study.seconds / USED_MIN
    };
    std::iter::successors(Some(1u32), |count: &u32| Some(count * 2))
        .take_while(|count| *count <= most)
        .filter(is_busy)
        .max()
        .unwrap_or(1)
}

fn advice(graph: &Graph, division: &Division, count: u32) -> Vec<String> {
    let mut advice = Vec::new();
    let Division { study, common_ancestors, shards, seconds_without_cache, recommended, .. } = division;
    if common_ancestors.items > 0 {
        let times = seconds_without_cache / study.seconds.max(f64::MIN_POSITIVE);
        advice.push(format!(
            "{} needed by more than one shard: without a shared cache (`--cache`) the shards take {times:.1} times as long \
             together as with one",
            counted(common_ancestors.items, "item")
        ));
    }
    let longest = shards.iter().max_by(|a, b| a.left.seconds.total_cmp(&b.left.seconds));
    let mean = shards.iter().map(|shard| shard.left.seconds).sum::<f64>() / f64::from(count);
    if let Some(longest) = longest.filter(|longest| longest.left.seconds > BALANCE_MAX * mean) {
        let times = longest.left.seconds / mean.max(f64::MIN_POSITIVE);
        let item = longest_item(graph, longest.shard, count);
        advice.push(format!(
            "the shards are out of balance: shard {} takes {times:.1} times as long as the mean, {item}",
            longest.shard
        ));
    }
    if *recommended < count {
        advice.push(format!(
            "use {}, the largest power of two at which the shards use at least half of the time reserved for them",
            counted(*recommended, "shard")
        ));
    }
    advice
}

/// The item that takes longest in a shard beside the common ancestors, as a clause.
fn longest_item(graph: &Graph, shard: u32, count: u32) -> String {
    let left = needs(graph, count).into_iter().enumerate().filter(|(_, need)| *need == Need::One(shard));
    let timed = left.map(|(position, _)| (graph.node(position).job.estimate().seconds, &graph.node(position).item));
    let longest = timed.max_by(|a, b| a.0.total_cmp(&b.0));
    longest.map_or_else(String::new, |(seconds, item)| format!("{seconds:.1} s of it for {item}"))
}
