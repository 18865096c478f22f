use super::*;
use crate::testing::{Random, limits, map_of, oblong_map_of};

fn open(size: usize) -> TravelMap {
    map_of(size, size, limits(30.0, 30.0), |_, _| 0.0)
}

fn drawn(map: &TravelMap) -> Vec<String> {
    let [rows, cols] = map.shape();
    let cell = |row, col| if map.is_blocked(map.node(row, col)) { '#' } else { '.' };
    (0..rows).map(|row| (0..cols).map(|col| cell(row, col)).collect()).collect()
}

fn blocked(points: &[[f64; 2]], margin_m: f64) -> Vec<String> {
    let mut map = open(6);
    block(&mut map, &Polygon::new(vec![points.to_vec()]).unwrap(), margin_m).unwrap();
    drawn(&map)
}

#[test]
fn val_a_square_blocks_what_it_touches() {
    // North is up: row 0 covers 5 m to 6 m.
    let square = [[1.5, 1.5], [3.5, 1.5], [3.5, 3.5], [1.5, 3.5]];
    assert_eq!(blocked(&square, 0.0), ["......", "......", ".###..", ".###..", ".###..", "......"]);
    assert_eq!(blocked(&square, 0.6), ["......", ".###..", "#####.", "#####.", "#####.", ".###.."]);
}

#[test]
fn val_a_sliver_blocks_every_cell_that_its_edges_cross() {
    let sliver = [[0.5, 0.4], [5.5, 5.3], [5.5, 5.4]];
    let rows = blocked(&sliver, 0.0);
    assert_eq!(rows, [".....#", "....##", "...##.", "..##..", ".##...", "##...."]);
    // There is no path between cells that touch at a corner.
    for row in 1..6 {
        let (above, here) = (rows[row - 1].as_bytes(), rows[row].as_bytes());
        assert!((0..6).any(|col| above[col] == b'#' && here[col] == b'#'), "{rows:?}");
    }
}

#[test]
fn val_the_hollow_of_an_obstacle_stays_free() {
    let hollow = [[0.2, 0.2], [5.8, 0.2], [5.8, 5.8], [4.2, 5.8], [4.2, 1.8], [1.8, 1.8], [1.8, 5.8], [0.2, 5.8]];
    let rows = blocked(&hollow, 0.0);
    assert_eq!(rows, ["##..##", "##..##", "##..##", "##..##", "######", "######"]);
}

#[test]
fn val_holes_stay_free() {
    let square = |low: f64, high: f64| vec![[low, low], [high, low], [high, high], [low, high]];
    let mut map = open(6);
    block(&mut map, &Polygon::new(vec![square(0.2, 5.8), square(1.8, 4.2)]).unwrap(), 0.0).unwrap();
    assert_eq!(drawn(&map), ["######", "######", "##..##", "##..##", "######", "######"]);
}

/// A margin reaches equally far from marked cells and from a polygon that fills them.
#[test]
fn prop_marked_cells_block_like_the_square_that_fills_them() {
    let eps = 1e-9;
    for margin_m in [0.0, 0.6, 1.0, 1.2, 1.42, 2.3] {
        let square = [[2.0 + eps, 2.0 + eps], [3.0 - eps, 2.0 + eps], [3.0 - eps, 3.0 - eps], [2.0 + eps, 3.0 - eps]];
        let mut map = open(6);
        let mut marked = [false; 36];
        marked[3 * 6 + 2] = true;
        block_cells(&mut map, &marked, margin_m).unwrap();
        let reach = if margin_m > 0.0 { margin_m + eps } else { 0.0 };
        assert_eq!(drawn(&map), blocked(&square, reach), "{margin_m}");
    }
}

#[test]
fn val_invalid_polygons_are_refused() {
    let message = |points: &[[f64; 2]]| Polygon::new(vec![points.to_vec()]).unwrap_err().to_string();
    assert!(message(&[[0.0, 0.0]]).contains("a polygon of 1 point:"));
    assert!(message(&[[0.0, 0.0], [1.0, 1.0]]).contains("a polygon of 2 points:"));
    assert!(message(&[[0.0, 0.0], [1.0, 1.0], [1.0, 1.0], [0.0, 0.0]]).contains("2 points"));
    assert!(message(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]).contains("without area"));
    assert!(message(&[[0.0, 0.0], [1.0, f64::NAN], [2.0, 0.0]]).contains("(1, NaN)"));
    assert!(message(&[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 1.0]]).contains("edges 0 and 2 cross"));
    assert!(message(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [4.0, -3.0]]).contains("cross"), "folds back");
    assert!(message(&[[0.0, 0.0], [4.0, 0.0], [2.0, 0.0], [2.0, 3.0]]).contains("edges 0 and 1 cross"), "folds back");
    assert!(Polygon::new(vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]]).is_ok());
    assert!(Polygon::new(Vec::new()).is_err());
}

#[test]
fn val_a_margin_below_zero_is_refused() {
    let triangle = Polygon::new(vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]]).unwrap();
    for margin_m in [-1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(block(&mut open(3), &triangle, margin_m).unwrap_err().key, "margin_m");
    }
}

#[test]
fn prop_cells_are_blocked_as_points_in_them_are_inside() {
    let mut random = Random(50);
    let mut inside = 0;
    for _ in 0..200 {
        let points: Vec<[f64; 2]> = (0..3).map(|_| [0; 2].map(|_| 8.0 * random.unit() - 1.0)).collect();
        let Ok(polygon) = Polygon::new(vec![points]) else { continue };
        let mut map = open(6);
        block(&mut map, &polygon, 0.0).unwrap();
        for _ in 0..300 {
            let [x, y] = [0; 2].map(|_| 6.0 * random.unit());
            let (row, col) = map.heights().geometry.cell_at(x, y).unwrap();
            inside += usize::from(polygon.holds([x, y]));
            assert!(!polygon.holds([x, y]) || map.is_blocked(map.node(row, col)));
        }
    }
    assert!(inside > 1000, "{inside}");
}

/// Whether a line separates a triangle from a rectangle (separating axis theorem): parallel to a side of the one or of the other.
fn apart(triangle: &[[f64; 2]], rectangle: &[[f64; 2]]) -> bool {
    let normal = |k: usize| {
        let ([ax, ay], [bx, by]) = (triangle[k], triangle[(k + 1) % 3]);
        [ay - by, bx - ax]
    };
    [[1.0, 0.0], [0.0, 1.0], normal(0), normal(1), normal(2)].into_iter().any(|[nx, ny]| {
        let range = |points: &[[f64; 2]]| {
            let along = points.iter().map(|[x, y]| nx * x + ny * y);
            [along.clone().fold(f64::INFINITY, f64::min), along.fold(f64::NEG_INFINITY, f64::max)]
        };
        let ([low, high], [from, to]) = (range(triangle), range(rectangle));
        high < from || to < low
    })
}

#[test]
fn prop_a_triangle_blocks_exactly_the_cells_that_it_touches() {
    let mut random = Random(51);
    let mut counts = [0, 0];
    for _ in 0..200 {
        let points: Vec<[f64; 2]> = (0..3).map(|_| [0; 2].map(|_| 8.0 * random.unit() - 1.0)).collect();
        let mut map = open(6);
        block(&mut map, &Polygon::new(vec![points.clone()]).unwrap(), 0.0).unwrap();
        for node in 0..map.len() as Node {
            let [x, y] = map.position_m(node);
            let cell = [[x - 0.5, y - 0.5], [x + 0.5, y - 0.5], [x + 0.5, y + 0.5], [x - 0.5, y + 0.5]];
            assert_eq!(map.is_blocked(node), !apart(&points, &cell), "{points:?}, node {node}");
            counts[usize::from(map.is_blocked(node))] += 1;
        }
    }
    assert!(counts.iter().all(|count| *count > 1000), "free and blocked: {counts:?}");
}

/// Cells of 3 m x 4 m. The rectangle lies inside one of them, 1 m from all its sides.
#[test]
fn val_margins_over_oblong_cells_are_metres() {
    let blocked = |margin_m: f64| {
        let mut map = oblong_map_of(4, 4, limits(30.0, 30.0), |_, _| 0.0);
        let rectangle = vec![[104.0, 205.0], [105.0, 205.0], [105.0, 207.0], [104.0, 207.0]];
        block(&mut map, &Polygon::new(vec![rectangle]).unwrap(), margin_m).unwrap();
        drawn(&map)
    };
    assert_eq!(blocked(0.9), ["....", "....", ".#..", "...."]);
    // The corners of the cell are 1.41 m away.
    assert_eq!(blocked(1.2), ["....", ".#..", "###.", ".#.."]);
    assert_eq!(blocked(1.5), ["....", "###.", "###.", "###."]);
    // Around a marked cell, the second next column begins 3 m away, the second next row 4 m.
    let mut map = oblong_map_of(4, 4, limits(30.0, 30.0), |_, _| 0.0);
    let mut marked = [false; 16];
    marked[2 * 4 + 1] = true;
    block_cells(&mut map, &marked, 3.5).unwrap();
    assert_eq!(drawn(&map), ["....", "####", "####", "####"]);
}
