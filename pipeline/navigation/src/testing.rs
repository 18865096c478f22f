//! Test grounds.

use crate::cost::{CostModel, SlopeCost};
use crate::line::Ground;
use crate::map::{Direction, Neighbourhood, Node, SlopeLimits, TravelMap};
use sastrugi_numeric::{Geometry, Grid};

/// Both neighbourhoods.
pub const NEIGHBOURHOODS: [Neighbourhood; 2] = [Neighbourhood::Four, Neighbourhood::Eight];

/// A stream of random numbers (SplitMix64; Steele et al., 2014).
pub struct Random(pub u64);

impl Random {
    /// A number at least 0 and below `end`.
    pub fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % end
    }

    /// A number at least 0 and below 1.
    pub fn unit(&mut self) -> f64 {
        self.below(1 << 53) as f64 / (1u64 << 53) as f64
    }
}

/// Slope limits, degrees.
pub fn limits(up_deg: f64, down_deg: f64) -> SlopeLimits {
    SlopeLimits::new(up_deg, down_deg).unwrap()
}

/// A map with cells of 1 m and heights given by row and column.
pub fn map_of(rows: usize, cols: usize, limits: SlopeLimits, z: impl Fn(usize, usize) -> f64) -> TravelMap {
    let heights = (0..rows * cols).map(|k| z(k / cols, k % cols)).collect();
    TravelMap::new(Grid::new(Geometry::square(rows, cols, 1.0), heights), limits).unwrap()
}

/// A map whose cells are 3 m east-west and 4 m north-south, so that diagonals are 5 m; its south-west corner is at (100, 200). It shows exchanged axes,
/// which square cells hide.
pub fn oblong_map_of(rows: usize, cols: usize, limits: SlopeLimits, z: impl Fn(usize, usize) -> f64) -> TravelMap {
    let heights = (0..rows * cols).map(|k| z(k / cols, k % cols)).collect();
    let geometry = Geometry { rows, cols, cell: [3.0, 4.0], origin: [100.0, 200.0] };
    TravelMap::new(Grid::new(geometry, heights), limits).unwrap()
}

/// Level ground; `#` is blocked.
pub fn drawn(lines: &[&str]) -> TravelMap {
    let mut map = map_of(lines.len(), lines[0].len(), limits(30.0, 30.0), |_, _| 0.0);
    for (row, line) in lines.iter().enumerate() {
        line.bytes().enumerate().filter(|(_, b)| *b == b'#').for_each(|(col, _)| map.block(map.node(row, col)));
    }
    map
}

/// Hills made of upper halves of random spheroids (the thesis, Algorithm 10), `per_million` of them per million nodes.
pub fn hills(size: usize, per_million: f64, minor_max: u64, seed: u64) -> TravelMap {
    let mut random = Random(seed);
    let mut heights = Grid::filled(Geometry::square(size, size, 1.0), 0.0);
    for _ in 0..((per_million * (size * size) as f64 / 1e6).ceil() as usize) {
        let [col, row] = [0; 2].map(|_| random.below(size as u64) as i64);
        let radius = 1 + random.below(100) as i64;
        let height = (1 + random.below(minor_max.min(radius as u64))) as f64;
        for (r, c) in (row - radius..=row + radius).flat_map(|r| (col - radius..=col + radius).map(move |c| (r, c))) {
            let share = ((r - row).pow(2) + (c - col).pow(2)) as f64 / radius.pow(2) as f64;
            let inside = (0..size as i64).contains(&r) && (0..size as i64).contains(&c);
            if inside && share < 1.0 {
                heights.values[r as usize * size + c as usize] += height * (1.0 - share).sqrt();
            }
        }
    }
    TravelMap::new(heights, limits(30.0, 30.0)).unwrap()
}

/// Rough ground with a share of blocked cells.
pub fn rough(rows: usize, cols: usize, blocked: f64, relief_m: f64, random: &mut Random) -> TravelMap {
    let heights: Vec<f64> = (0..rows * cols).map(|_| relief_m * random.unit()).collect();
    let mut map = map_of(rows, cols, limits(30.0, 25.0), |r, c| heights[r * cols + c]);
    (0..map.len() as Node).filter(|_| random.unit() < blocked).for_each(|node| map.block(node));
    map
}

/// Two distinct free nodes.
pub fn ends(map: &TravelMap, random: &mut Random) -> Option<[Node; 2]> {
    let free: Vec<Node> = (0..map.len() as Node).filter(|node| !map.is_blocked(*node)).collect();
    let mut draw = || free.get(random.below(free.len().max(1) as u64) as usize).copied();
    let [start, goal] = [draw()?, draw()?];
    (start != goal).then_some([start, goal])
}

/// Costs as in the thesis.
pub fn thesis_costs(map: &TravelMap) -> CostModel {
    CostModel::new(SlopeCost::THESIS, None, map).unwrap()
}

/// Ground without clearance.
pub fn ground<'a>(map: &'a TravelMap, costs: &'a CostModel) -> Ground<'a> {
    Ground { map, costs, clearance: None }
}

/// Whether a step is allowed, from the definition and without a table.
pub fn may_step_by_definition(map: &TravelMap, node: Node, direction: Direction) -> bool {
    let Some(target) = map.neighbour(node, direction) else { return false };
    let [row, col] = map.place(node);
    let [target_row, target_col] = map.place(target);
    let corners = [map.node(row, target_col), map.node(target_row, col)];
    if [node, target, corners[0], corners[1]].iter().any(|n| map.is_blocked(*n)) {
        return false;
    }
    let [start, end] = [map.point(node), map.point(target)];
    let height_m = |t: f64| map.height_at_m([0, 1].map(|k| start[k] + (end[k] - start[k]) * t)).unwrap();
    [0.0, 0.25, 0.5, 0.75].iter().all(|t| {
        let slope = (height_m(t + 0.25) - height_m(*t)) / (0.25 * map.step_m(direction));
        map.limits().allow(slope)
    })
}

/// A tilted plane whose heights rise northward by `slope` per metre.
pub fn plane(rows: usize, cols: usize, slope: f64, limit_deg: f64) -> TravelMap {
    map_of(rows, cols, limits(limit_deg, limit_deg), |row, _| slope * (rows - 1 - row) as f64)
}
