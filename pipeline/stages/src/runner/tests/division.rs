//! Division of a graph into shards.

use super::{Area, Line, all, diamond, graph, node};
use crate::runner::division::{Cost, common_ancestors, divide};
use crate::runner::graph::Graph;
use crate::runner::shard::{Part, owner};
use std::collections::BTreeSet;

/// A parent of many children, and items on their own.
fn wide(area: &Area) -> Graph {
    let mut nodes = vec![node(area.line("a"), &[])];
    for k in 0..30 {
        nodes.push(node(area.line(&format!("child-{k:02}")), &["a"]));
        nodes.push(node(Line { memory_bytes: k, ..area.line(&format!("own-{k:02}")) }, &[]));
    }
    graph(nodes)
}

/// Counted directly: the closures of the shards that hold an item.
#[test]
fn prop_common_ancestors_are_in_several_closures() {
    let area = Area::new();
    for graph in [diamond(&area), wide(&area)] {
        for count in [1, 2, 3, 7, 50] {
            let closure = |index: u32| {
                let part = Part { index, count };
                graph.closure((0..graph.len()).filter(|&p| part.owns(graph.key(p))))
            };
            let mut held = vec![0; graph.len()];
            (1..=count).flat_map(closure).for_each(|p| held[p] += 1);
            let expected: Vec<usize> = all(&graph).into_iter().filter(|p| held[*p] > 1).collect();
            let common = common_ancestors(&graph, count);
            assert_eq!(common, expected, "{count}");
            assert_eq!(graph.closure(common.iter().copied()), common, "closed under parents");
        }
    }
}

/// Every line takes 2 s and 3 bytes.
#[test]
fn val_a_division_adds_up() {
    let area = Area::new();
    let graph = wide(&area);
    let division = divide(&graph, 4);
    assert_eq!(division.study, Cost { items: 61, seconds: 122.0, bytes: 183.0, memory_bytes: 29 });
    assert_eq!(division.common_ancestors, Cost { items: 1, seconds: 2.0, bytes: 3.0, memory_bytes: 0 });
    assert_eq!(division.shards.iter().map(|shard| shard.own).sum::<usize>(), 61);
    let left: f64 = division.shards.iter().map(|shard| shard.left.seconds).sum();
    assert_eq!((left, division.seconds_with_cache), (120.0, 122.0));
    // Each shard that has the parent or a child computes the parent.
    let of_family = |p: &usize| *p == 0 || graph.node(*p).item.id.starts_with("child");
    let owners: BTreeSet<Option<u32>> =
        all(&graph).into_iter().filter(of_family).map(|p| owner(graph.key(p), 4)).collect();
    assert_eq!(division.seconds_without_cache, 120.0 + 2.0 * owners.len() as f64);
    assert!(division.shards.iter().all(|shard| shard.needed.items >= shard.own));
    assert!(division.advice[0].contains("without a shared cache (`--cache`) the shards take 1.0 times"));
    let shards: BTreeSet<u32> = division.shards.iter().map(|shard| shard.shard).collect();
    assert_eq!(shards, (1..=4).collect());
}

/// One long item: more shards than one idle beside it, and the plan says which item that is.
#[test]
fn val_shards_out_of_balance_are_named() {
    let area = Area::new();
    let one = graph(vec![node(area.line("long"), &[])]);
    let division = divide(&one, 8);
    assert_eq!((division.recommended, division.common_ancestors.items), (1, 0));
    let said = division.advice.join("\n");
    assert!(said.contains("takes 8.0 times as long as the mean, 2.0 s of it for s/long"), "{said}");
    assert!(said.contains("use 1 shard, the largest power of two"), "{said}");
    // Many equal items are divided further.
    assert!(divide(&wide(&area), 2).recommended >= 4);
}
