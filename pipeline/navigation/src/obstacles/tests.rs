use super::*;
use crate::testing::{Random, limits, map_of};

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
    // No way through between cells that touch at a corner.
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

/// A margin reaches as far from marked cells as from a polygon that fills them.
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
fn val_polygons_that_are_no_obstacles_are_refused() {
    let message = |points: &[[f64; 2]]| Polygon::new(vec![points.to_vec()]).unwrap_err().to_string();
    assert!(message(&[[0.0, 0.0], [1.0, 1.0]]).contains("2 points"));
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
    for _ in 0..200 {
        let points: Vec<[f64; 2]> = (0..3).map(|_| [0; 2].map(|_| 8.0 * random.unit() - 1.0)).collect();
        let Ok(polygon) = Polygon::new(vec![points]) else { continue };
        let mut map = open(6);
        block(&mut map, &polygon, 0.0).unwrap();
        for _ in 0..300 {
            let [x, y] = [0; 2].map(|_| 6.0 * random.unit());
            let (row, col) = map.heights().geometry.cell_at(x, y).unwrap();
            assert!(!polygon.holds([x, y]) || map.is_blocked(map.node(row, col)));
        }
    }
}
