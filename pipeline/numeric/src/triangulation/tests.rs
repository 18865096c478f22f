use super::*;
use crate::grid::Geometry;
use proptest::prelude::*;
use std::collections::BTreeSet;

fn grid(rows: usize, cols: usize, height: impl Fn(usize, usize) -> f64) -> Grid {
    let g = Geometry { rows, cols, cell: [0.5, 0.2], origin: [100.0, -7.0] };
    Grid::new(g, (0..g.len()).map(|k| height(k / cols, k % cols)).collect())
}

/// Ground with bumps of two sizes.
fn bumpy(rows: usize, cols: usize) -> Grid {
    grid(rows, cols, |row, col| {
        let (x, y) = (col as f64, row as f64);
        libm::sin(x / 7.0) + libm::cos(y / 5.0) + 0.1 * libm::sin(x * y / 11.0)
    })
}

fn limits(error_max: f64) -> Limits {
    Limits { error_max, triangles_max: None }
}

/// The triangles of the complete surface between neighbouring cells, as sets of cells.
fn whole(grid: &Grid) -> BTreeSet<BTreeSet<usize>> {
    let cols = grid.cols();
    let squares = (1..grid.rows()).flat_map(|row| (1..cols).map(move |col| row * cols + col));
    let triangles = squares.flat_map(|se| {
        let [nw, ne, sw] = [se - cols - 1, se - cols, se - 1];
        [[nw, sw, se], [nw, se, ne]]
    });
    triangles.filter(|t| t.iter().all(|&cell| grid.values[cell].is_finite())).map(|t| t.into_iter().collect()).collect()
}

fn corners(found: &Triangulation) -> Vec<[usize; 3]> {
    found.triangles.iter().map(|triangle| triangle.map(|corner| found.cells[corner as usize])).collect()
}

/// Largest and root mean square vertical distance of all posts, by searching every triangle for each of them, in metres.
fn slow_errors(grid: &Grid, found: &Triangulation) -> (f64, f64, usize) {
    let g = &grid.geometry;
    let place = |cell: usize| [g.x(cell % g.cols), g.y(cell / g.cols), grid.values[cell]];
    let triangles: Vec<[[f64; 3]; 3]> = corners(found).iter().map(|cells| cells.map(place)).collect();
    let of_post = |cell: usize| {
        let [x, y, z] = place(cell);
        let errors = triangles.iter().filter_map(|[a, b, c]| {
            let turn = |p: &[f64; 3], q: &[f64; 3]| (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
            let shares = [turn(b, c), turn(c, a), turn(a, b)];
            let area: f64 = shares.iter().sum();
            let on = shares.iter().all(|share| *share >= -1e-9 * area);
            on.then(|| (z - (shares[0] * a[2] + shares[1] * b[2] + shares[2] * c[2]) / area).abs())
        });
        errors.reduce(f64::max)
    };
    let errors: Vec<f64> = (0..g.len()).filter_map(of_post).collect();
    let squares: f64 = errors.iter().map(|e| e * e).sum();
    let largest = errors.iter().copied().fold(0.0, f64::max);
    (largest, (squares / errors.len().max(1) as f64).sqrt(), errors.len())
}

/// Total area of the triangles in half cells; checks that each of them faces up.
fn half_cells(grid: &Grid, found: &Triangulation) -> i64 {
    let point = |cell: usize| [(cell % grid.cols()) as i64, (grid.rows() - 1 - cell / grid.cols()) as i64];
    let areas = corners(found).into_iter().map(|cells| doubled_area(cells.map(point)));
    areas.inspect(|area| assert!(*area > 0)).sum()
}

#[test]
fn val_a_plane_takes_two_triangles() {
    let plane = grid(17, 23, |row, col| 0.1 * row as f64 - 0.3 * col as f64);
    let found = triangulate(&plane, &limits(1e-9)).unwrap();
    assert_eq!((found.cells, found.triangles.len()), (vec![0, 22, 16 * 23, 17 * 23 - 1], 2));
    assert!(found.error_max < 1e-9 && found.error_rms <= found.error_max);
}

/// The reported errors equal those of a slow evaluation and stay below the limit, and a smaller limit needs more triangles.
#[test]
fn val_errors_are_those_of_every_post() {
    let ground = bumpy(41, 60);
    let mut before = 2;
    for limit in [1.0, 0.3, 0.1, 0.03, 0.01] {
        let found = triangulate(&ground, &limits(limit)).unwrap();
        let (largest, rms, posts) = slow_errors(&ground, &found);
        assert_eq!(posts, 41 * 60);
        assert!(found.error_max <= limit && (largest - found.error_max).abs() < 1e-12, "{largest} {limit}");
        assert!((rms - found.error_rms).abs() < 1e-12, "{rms} {}", found.error_rms);
        assert!(found.triangles.len() > before, "{limit}: {}", found.triangles.len());
        assert_eq!(half_cells(&ground, &found), 2 * 40 * 59);
        before = found.triangles.len();
    }
    assert!(before < 2 * 40 * 59);
}

/// The number of triangles is the maximum or one less; with both limits, the one met first applies.
#[test]
fn val_a_number_of_triangles() {
    let ground = bumpy(33, 20);
    for most in [2, 3, 50, 51, 400] {
        let found = triangulate(&ground, &Limits { error_max: 0.0, triangles_max: Some(most) }).unwrap();
        assert!((most - 1..=most).contains(&found.triangles.len()), "{most}: {}", found.triangles.len());
    }
    let both = triangulate(&ground, &Limits { error_max: 0.3, triangles_max: Some(400) }).unwrap();
    assert_eq!(both, triangulate(&ground, &limits(0.3)).unwrap());
}

/// Of equal spikes in different triangles, the northern one is inserted first; in one triangle, the southern one.
#[test]
fn val_equal_errors_have_a_fixed_order() {
    let limits = Limits { error_max: 0.0, triangles_max: Some(4) };
    for (spikes, first) in [([[2, 6], [6, 2]], 24), ([[2, 6], [3, 7]], 34)] {
        let spiked = grid(9, 9, |row, col| if spikes.contains(&[row, col]) { 1.0 } else { 0.0 });
        let found = triangulate(&spiked, &limits).unwrap();
        assert_eq!((found.cells, found.triangles.len()), (vec![0, 8, first, 72, 80], 4));
    }
}

/// One spike of 1 m among 25 posts, on the common edge of both triangles, counts once.
#[test]
fn val_errors_of_one_spike() {
    let spiked = grid(5, 5, |row, col| if [row, col] == [2, 2] { 1.0 } else { 0.0 });
    let found = triangulate(&spiked, &Limits { error_max: 0.0, triangles_max: Some(2) }).unwrap();
    assert_eq!((found.triangles.len(), found.error_max), (2, 1.0));
    assert!((found.error_rms - 0.2).abs() < 1e-15);
}

#[test]
fn val_no_surface() {
    let found = |grid: Grid| triangulate(&grid, &limits(0.1));
    assert_eq!(found(grid(2, 2, |_, _| 1.0)).map(|found| found.triangles.len()), Some(2));
    assert_eq!(found(grid(1, 5, |_, _| 1.0)), None);
    assert_eq!(found(grid(5, 1, |_, _| 1.0)), None);
    assert_eq!(found(grid(4, 4, |row, col| if (row + col) % 2 == 0 { 1.0 } else { f64::NAN })), None);
}

/// A hole in a flat surface: the hole and its rim are preserved, and the flat part needs few triangles.
#[test]
fn val_holes_stay_holes() {
    let pitted =
        grid(30, 30, |row, col| if (10..14).contains(&row) && (12..15).contains(&col) { f64::NAN } else { 2.0 });
    let found = triangulate(&pitted, &limits(0.001)).unwrap();
    assert_eq!(half_cells(&pitted, &found), whole(&pitted).len() as i64);
    assert!(found.cells.iter().all(|&cell| pitted.values[cell].is_finite()));
    assert!((20..200).contains(&found.triangles.len()), "{}", found.triangles.len());
}

proptest! {
    /// For any size, heights and holes: an error limit of 0 reproduces the complete surface, other limits are met, the triangles cover the same
    /// area as the complete surface, and the same call gives the same triangles.
    #[test]
    fn prop_limits_hold_around_any_holes(
        rows in 2_usize..12,
        cols in 2_usize..12,
        values in prop::collection::vec((-1.0_f64..1.0, 0_u8..10), 144),
        holes in 0_u8..5,
    ) {
        let rough = grid(rows, cols, |row, col| {
            let (height, hole) = values[12 * row + col];
            if hole < holes { f64::NAN } else { height }
        });
        let surface = whole(&rough);
        let Some(all) = triangulate(&rough, &limits(0.0)) else {
            prop_assert!(surface.is_empty());
            return Ok(());
        };
        let found: BTreeSet<BTreeSet<usize>> = corners(&all).into_iter().map(|t| t.into_iter().collect()).collect();
        prop_assert_eq!(found, surface.clone());
        let some = triangulate(&rough, &limits(0.5)).unwrap();
        let (largest, _, posts) = slow_errors(&rough, &some);
        prop_assert!(some.error_max <= 0.5 && (largest - some.error_max).abs() < 1e-12);
        prop_assert_eq!(posts, surface.iter().flatten().collect::<BTreeSet<_>>().len());
        prop_assert_eq!(half_cells(&rough, &some), surface.len() as i64);
        prop_assert!(some.triangles.len() <= all.triangles.len());
        prop_assert_eq!(some, triangulate(&rough, &limits(0.5)).unwrap());
    }
}
