//! Strong components of a directed graph: vertices that can all reach one another (Tarjan, 1972).

use super::NONE;

/// The component of each vertex, numbered from 0. `successor(v, k)` is the k-th of at most `degree(v)` successors of v, or `None` if that edge is
/// missing.
pub fn components(count: u32, degree: impl Fn(u32) -> u32, successor: impl Fn(u32, u32) -> Option<u32>) -> Vec<u32> {
    let mut component = vec![NONE; count as usize];
    let mut order = vec![NONE; count as usize];
    let mut low = vec![NONE; count as usize];
    let mut path: Vec<(u32, u32)> = Vec::new();
    let mut stack: Vec<u32> = Vec::new();
    let (mut next, mut found) = (0, 0);
    for root in 0..count {
        if order[root as usize] != NONE {
            continue;
        }
        path.push((root, 0));
        while let Some((vertex, edge)) = path.pop() {
            let v = vertex as usize;
            if edge == 0 {
                (order[v], low[v]) = (next, next);
                next += 1;
                stack.push(vertex);
            }
            if edge < degree(vertex) {
                path.push((vertex, edge + 1));
                match successor(vertex, edge).map(|s| (s, s as usize)) {
                    Some((target, t)) if order[t] == NONE => path.push((target, 0)),
                    Some((_, t)) if component[t] == NONE => low[v] = low[v].min(order[t]),
                    _ => {}
                }
                continue;
            }
            if low[v] == order[v] {
                while let Some(member) = stack.pop() {
                    component[member as usize] = found;
                    if member == vertex {
                        break;
                    }
                }
                found += 1;
            }
            if let Some(&(parent, _)) = path.last() {
                low[parent as usize] = low[parent as usize].min(low[v]);
            }
        }
    }
    component
}
