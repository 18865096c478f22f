use crate::search::components::components;
use crate::testing::Random;

#[test]
fn prop_components_agree_with_petgraph() {
    let mut random = Random(20);
    for _ in 0..300 {
        let count = 1 + random.below(20) as u32;
        let edges: Vec<(u32, u32)> = (0..random.below(40))
            .map(|_| (random.below(count.into()) as u32, random.below(count.into()) as u32))
            .collect();
        let of = |v: u32| edges.iter().filter(move |edge| edge.0 == v).map(|edge| edge.1);
        // The last successor of each vertex is missing, like a step off the map.
        let ours = components(count, |v| of(v).count() as u32 + 1, |v, k| of(v).nth(k as usize));
        let mut graph = petgraph::graph::DiGraph::<(), ()>::from_edges(&edges);
        while graph.node_count() < count as usize {
            graph.add_node(());
        }
        let mut expected = vec![0; count as usize];
        for (number, members) in petgraph::algo::tarjan_scc(&graph).iter().enumerate() {
            members.iter().for_each(|member| expected[member.index()] = number);
        }
        for a in 0..count as usize {
            (0..a).for_each(|b| assert_eq!(ours[a] == ours[b], expected[a] == expected[b]));
        }
    }
}
