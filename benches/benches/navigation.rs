//! Routes over the hills of the published maps, on one core.
//!
//! Before the table, in CPU time: for each preset on 1000 x 1000 nodes, the share of vertices, the speed-up of the roadmap search over the grid search
//! (medians of 5), and smoothed costs relative to the grid, all by the fine integral; how both grow with the map; on 2000 x 2000 nodes, our A* over the
//! grid compared with those of the crates `pathfinding` and `petgraph` with the same steps, costs and bound, and the memory of the process.
//! Targets: roadmap at least 10 times faster, smoothed cost at most 1.05 (threshold 2 m) and 1.4 (without); 2000 x 2000 nodes: vertices
//! and edges 1.5 s, roadmap search 30 ms, grid search 4 s, 1000 searches of a prepared roadmap 2 s, 600 MB.
//! Run: `cargo bench -p sastrugi-benches --bench navigation`.

use divan::{Bencher, black_box};
use sastrugi_navigation::map::Node;
use sastrugi_navigation::roadmap::Roadmap;
use sastrugi_navigation::search::grid::GridNetwork;
use sastrugi_navigation::search::{Network, astar};
use sastrugi_navigation::vertices::{VertexSettings, Vertices};
use sastrugi_navigation::{
    CostModel, Ground, Method, Neighbourhood, Planner, Route, RouteSettings, SlopeCost, SlopeLimits, TravelMap,
};
use sastrugi_numeric::Streams;
use serde_json::json;

const PRESETS: [&str; 3] = ["plain", "rough", "very_rough"];
const FOUR: Neighbourhood = Neighbourhood::Four;

fn main() {
    PRESETS.into_iter().for_each(compare_methods);
    PRESETS.into_iter().for_each(time_large);
    [250, 500, 1000, 2000].into_iter().for_each(time_growth);
    compare_crates();
    divan::main();
}

/// Hills with the costs of the thesis.
struct Course {
    map: TravelMap,
    costs: CostModel,
}

impl Course {
    fn new(size: usize, preset: &str) -> Self {
        let params = json!({ "preset": preset, "size_px": [size, size] });
        let generator = sastrugi_terrain::prepare("spheroids", &params).expect("valid parameters");
        let heights = generator.generate(&Streams::for_seed(1, "terrain"), &[]).expect("a surface").heights;
        let map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0).expect("valid limits")).expect("a valid map");
        let costs = CostModel::new(SlopeCost::THESIS, None, &map).expect("valid costs");
        Self { map, costs }
    }

    fn ground(&self) -> Ground<'_> {
        Ground { map: &self.map, costs: &self.costs, clearance: None }
    }

    fn grid(&self) -> GridNetwork<'_> {
        GridNetwork { ground: self.ground(), neighbourhood: FOUR }
    }

    /// Opposite corners, a twentieth of the side away from the borders.
    fn ends(&self) -> [Node; 2] {
        let [rows, cols] = self.map.shape();
        [self.map.node(rows / 20, cols / 20), self.map.node(rows - rows / 20, cols - cols / 20)]
    }

    fn planner(&self, settings: RouteSettings) -> Planner<'_> {
        Planner::new(self.ground(), settings).expect("valid settings")
    }

    fn roadmap(&self, threshold_m: Option<f64>) -> Roadmap<'_> {
        let settings = VertexSettings { threshold_m, ..VertexSettings::default() };
        let vertices = Vertices::of(&self.map, FOUR, &settings, &self.ends());
        Roadmap::new(self.ground(), &vertices.marks, FOUR)
    }

    fn route(&self, method: Method) -> Route {
        let [start, goal] = self.ends().map(|node| self.map.place(node));
        let settings = RouteSettings { method, ..RouteSettings::default() };
        sastrugi_navigation::plan(&self.ground(), &settings, start, goal).expect("a route")
    }
}

/// CPU time of this thread, s, which excludes other work on the machine.
fn processor_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split_whitespace().next().and_then(|word| word.parse().ok()).map_or(f64::NAN, |ns: f64| 1e-9 * ns)
}

/// CPU time of a call, s.
fn timed<T>(run: impl FnOnce() -> T) -> (f64, T) {
    let start = processor_s();
    let result = black_box(run());
    (processor_s() - start, result)
}

/// Median of five samples of a call, s; the CPU clock has a resolution of some ms, so each sample repeats short calls.
fn median_s<T>(mut run: impl FnMut() -> T) -> f64 {
    const SAMPLE_S: f64 = 0.1;
    let sample = |_| {
        let (start, mut calls) = (processor_s(), 0.0);
        while processor_s() - start < SAMPLE_S {
            black_box(run());
            calls += 1.0;
        }
        (processor_s() - start) / calls
    };
    let mut samples: Vec<f64> = (0..5).map(sample).collect();
    samples.sort_by(f64::total_cmp);
    samples[2]
}

fn compare_methods(preset: &str) {
    let course = Course::new(1000, preset);
    let threshold = |threshold_m| Method::Roadmap(VertexSettings { threshold_m, ..VertexSettings::default() });
    let [grid, hdt2, plain] = [Method::GridAstar, threshold(Some(2.0)), threshold(None)].map(|m| course.route(m));
    let roadmap = course.roadmap(None);
    let ends = course.ends().map(|node| roadmap.vertex(node).expect("a vertex"));
    let [start, goal] = course.ends();
    let by_cells_s = median_s(|| astar::search(&course.grid(), start, goal));
    let by_roads_s = median_s(|| astar::search(&roadmap, ends[0], ends[1]));
    println!(
        "{preset}, 1000: vertices {:.3} % (repair added {}), grid {:.1} ms, roadmap {:.2} ms, {:.0} times faster; \
         smoothed cost over grid: threshold 2 m {:.3}, none {:.3}",
        100.0 * plain.vertices as f64 / course.map.len() as f64,
        plain.repaired,
        1e3 * by_cells_s,
        1e3 * by_roads_s,
        by_cells_s / by_roads_s,
        hdt2.smoothed_score.cost / grid.smoothed_score.cost,
        plain.smoothed_score.cost / grid.smoothed_score.cost,
    );
}

/// Measures the targets for 2000 x 2000 nodes.
fn time_large(preset: &str) {
    let course = Course::new(2000, preset);
    let (read_s, _) = timed(|| TravelMap::new(course.map.heights().clone(), course.map.limits()));
    let (build_s, roadmap) = timed(|| course.roadmap(None));
    let ends = course.ends().map(|node| roadmap.vertex(node).expect("a vertex"));
    let found = astar::search(&roadmap, ends[0], ends[1]).expect("a path");
    println!(
        "{preset}, 2000: map {read_s:.2} s, vertices and edges {build_s:.2} s, roadmap of {} vertices searched in {:.1} ms \
         ({} expansions), peak memory {} MB",
        roadmap.len(),
        1e3 * median_s(|| astar::search(&roadmap, ends[0], ends[1])),
        found.expansions,
        peak_mb().unwrap_or(0)
    );
}

/// Growth of the work with the side of the map, on very rough hills.
fn time_growth(size: usize) {
    let course = Course::new(size, "very_rough");
    let (build_s, roadmap) = timed(|| course.roadmap(None));
    let ends = course.ends().map(|node| roadmap.vertex(node).expect("a vertex"));
    let [start, goal] = course.ends();
    println!(
        "very_rough, {size}: vertices and edges {:.1} ms, grid search {:.1} ms, roadmap search {:.2} ms",
        1e3 * build_s,
        1e3 * median_s(|| astar::search(&course.grid(), start, goal)),
        1e3 * median_s(|| astar::search(&roadmap, ends[0], ends[1])),
    );
}

/// A cost that can be ordered, as `pathfinding` requires.
#[derive(Clone, Copy, PartialEq)]
struct Cost(f64);

impl Eq for Cost {}

impl Ord for Cost {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Cost {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl std::ops::Add for Cost {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl pathfinding::num_traits::Zero for Cost {
    fn zero() -> Self {
        Self(0.0)
    }

    fn is_zero(&self) -> bool {
        self.0 == 0.0
    }
}

fn compare_crates() {
    let course = Course::new(2000, "very_rough");
    let (grid, [start, goal]) = (course.grid(), course.ends());
    let report = |name: &str, run: &dyn Fn() -> f64| {
        let (seconds, cost) = timed(run);
        println!("2000, very_rough, grid by {name}: {seconds:.2} s, cost {cost:.6}");
    };
    report("ours", &|| astar::search(&grid, start, goal).expect("a path").cost);
    println!("peak memory of the process so far: {} MB", peak_mb().unwrap_or(0));
    report("pathfinding", &|| {
        let successors = |node: &Node| {
            let mut next = Vec::with_capacity(4);
            grid.edges(*node, |target, cost| next.push((target, Cost(cost))));
            next
        };
        let bound = |node: &Node| Cost(grid.bound(*node, goal));
        pathfinding::prelude::astar(&start, successors, bound, |node| *node == goal).expect("a path").1.0
    });
    let mut edges = Vec::new();
    (0..grid.len() as Node).for_each(|node| grid.edges(node, |target, cost| edges.push((node, target, cost))));
    let graph = petgraph::graph::DiGraph::<(), f64>::from_edges(edges);
    report("petgraph (graph built before)", &|| {
        let bound = |node: petgraph::graph::NodeIndex| grid.bound(node.index() as Node, goal);
        let found = petgraph::algo::astar(&graph, start.into(), |n| n == goal.into(), |edge| *edge.weight(), bound);
        found.expect("a path").0
    });
}

/// Peak memory of the process.
fn peak_mb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? / 1024)
}

#[divan::bench(sample_count = 5, sample_size = 1, args = PRESETS)]
fn vertices_and_edges_2000(bencher: Bencher, preset: &str) {
    let course = Course::new(2000, preset);
    bencher.bench_local(|| course.roadmap(None));
}

#[divan::bench(sample_count = 5, sample_size = 1, args = PRESETS)]
fn search_roadmap_2000(bencher: Bencher, preset: &str) {
    let course = Course::new(2000, preset);
    let roadmap = course.roadmap(None);
    let ends = course.ends().map(|node| roadmap.vertex(node).expect("a vertex"));
    bencher.bench_local(|| astar::search(&roadmap, ends[0], ends[1]));
}

#[divan::bench(sample_count = 3, sample_size = 1, args = PRESETS)]
fn search_grid_2000(bencher: Bencher, preset: &str) {
    let course = Course::new(2000, preset);
    let (grid, [start, goal]) = (course.grid(), course.ends());
    bencher.bench_local(|| astar::search(&grid, start, goal));
}

/// A thousand searches between nodes spread over the map, without (0) and with landmarks.
#[divan::bench(sample_count = 1, sample_size = 1, args = [0, 8])]
fn thousand_searches_2000(bencher: Bencher, landmarks: u32) {
    let course = Course::new(2000, "rough");
    let planner = course.planner(RouteSettings { landmarks, ..RouteSettings::default() });
    let node = |k: u64| (k.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as Node % course.map.len() as Node;
    bencher.bench_local(|| (0..1000).filter(|k| planner.search([node(2 * k), node(2 * k + 1)]).is_ok()).count());
}

/// The table of steps that is built when a map is read.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn read_map_2000(bencher: Bencher) {
    let course = Course::new(2000, "rough");
    bencher.bench_local(|| TravelMap::new(course.map.heights().clone(), course.map.limits()));
}
