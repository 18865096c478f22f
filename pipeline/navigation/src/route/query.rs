//! One search over a prepared roadmap, with start and goal linked to it for this search only.

use crate::cost::Spot;
use crate::map::Node;
use crate::roadmap::{Roadmap, Way};
use crate::search::landmarks::{Landmarks, Target};
use crate::search::{Found, Network, astar};

/// The roadmap with two more vertices: the start, which has no incoming edges, and the goal, which has no outgoing ones.
pub(super) struct Query<'a> {
    roadmap: &'a Roadmap<'a>,
    landmarks: &'a Landmarks,
    start: Node,
    goal: Node,
    goal_spot: Spot,
    first_edges: Vec<(u32, f64)>,
    last_edges: Vec<(u32, f64)>,
    target: Target,
}

impl<'a> Query<'a> {
    pub(super) fn new(roadmap: &'a Roadmap<'a>, landmarks: &'a Landmarks, start: Node, goal: Node) -> Self {
        let at_goal = roadmap.len() as u32 + 1;
        let number = |(node, cost): (Node, f64)| {
            let vertex = if node == goal { Some(at_goal) } else { roadmap.vertex(node) };
            vertex.map(|vertex| (vertex, cost))
        };
        let first_edges = roadmap.links(start, Way::From, Some(goal)).into_iter().filter_map(number).collect();
        let last_edges: Vec<_> = roadmap.links(goal, Way::To, None).into_iter().filter_map(number).collect();
        let target = landmarks.target(&last_edges);
        Self { roadmap, landmarks, start, goal, goal_spot: roadmap.spot(goal), first_edges, last_edges, target }
    }

    /// The cheapest path, as nodes.
    pub(super) fn search(&self) -> Option<Found> {
        let [start, goal] = [0, 1].map(|k| self.roadmap.len() as u32 + k);
        let found = astar::search(self, start, goal)?;
        Some(Found { path: found.path.iter().map(|vertex| self.node(*vertex)).collect(), ..found })
    }

    fn node(&self, vertex: u32) -> Node {
        match (vertex as usize).checked_sub(self.roadmap.len()) {
            None => self.roadmap.nodes()[vertex as usize],
            Some(0) => self.start,
            Some(_) => self.goal,
        }
    }
}

impl Network for Query<'_> {
    fn len(&self) -> usize {
        self.roadmap.len() + 2
    }

    fn edges(&self, vertex: u32, mut visit: impl FnMut(u32, f64)) {
        let start = self.roadmap.len() as u32;
        if vertex >= start {
            // The goal has no outgoing edges; the search ends there.
            self.first_edges.iter().filter(|_| vertex == start).for_each(|(target, cost)| visit(*target, *cost));
            return;
        }
        self.roadmap.edges(vertex, &mut visit);
        let last = self.last_edges.iter().filter(|(source, _)| *source == vertex);
        last.for_each(|(_, cost)| visit(start + 1, *cost));
    }

    fn bound(&self, from: u32, _goal: u32) -> f64 {
        if (from as usize) < self.roadmap.len() {
            return self.roadmap.bound_to(from, self.goal_spot).max(self.landmarks.bound(from, &self.target));
        }
        // The start is expanded first and the goal last, whatever their bounds.
        0.0
    }
}
