use super::*;
use sastrugi_numeric::Streams;

/// Cells with data in the window of a cell: offset `[south, east]`, and height.
fn window_cells(values: &[f64], cols: usize, window: BoxWindow, cell: usize) -> Vec<([f64; 2], f64)> {
    let (rows, [r, c]) = (values.len() / cols, [cell / cols, cell % cols]);
    let [hr, hc] = window.half;
    let all = (r.saturating_sub(hr)..(r + hr + 1).min(rows))
        .flat_map(|i| (c.saturating_sub(hc)..(c + hc + 1).min(cols)).map(move |j| [i, j]));
    all.map(|[i, j]| ([i as f64 - r as f64, j as f64 - c as f64], values[i * cols + j]))
        .filter(|(_, z)| !z.is_nan())
        .collect()
}

/// Solution of a small symmetric system by Gauss-Jordan elimination with pivots on the diagonal; `None` when singular.
fn solve<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> Option<[f64; N]> {
    let scale: Vec<f64> = (0..N).map(|k| a[k][k]).collect();
    for k in 0..N {
        if a[k][k] <= 1e-9 * scale[k] {
            return None;
        }
        for i in (0..N).filter(|&i| i != k) {
            let factor = a[i][k] / a[k][k];
            let pivot = a[k];
            a[i].iter_mut().zip(pivot).for_each(|(x, p)| *x -= factor * p);
            b[i] -= factor * b[k];
        }
    }
    Some(std::array::from_fn(|k| b[k] / a[k][k]))
}

/// Reference: the least-squares plane of each partial window from its normal equations, and its variance.
fn by_definition(cells: &[([f64; 2], f64)], window: BoxWindow) -> f64 {
    let n = cells.len();
    let mean = cells.iter().map(|(_, z)| z).sum::<f64>() / n as f64;
    if n == window.area() {
        return mean;
    }
    let mut normal = [[0.0; 3]; 3];
    let mut right = [0.0; 3];
    for ([y, x], z) in cells {
        let row = [1.0, *x, *y];
        for i in 0..3 {
            (0..3).for_each(|j| normal[i][j] += row[i] * row[j]);
            right[i] += row[i] * z;
        }
    }
    if normal[0][1] == 0.0 && normal[0][2] == 0.0 {
        return mean;
    }
    // A window of a single row or column only has a slope along itself.
    for k in [1, 2] {
        if normal[k][k] == 0.0 {
            normal[k][k] = 1.0;
        }
    }
    let weights = solve(normal, [1.0, 0.0, 0.0]);
    let variance = weights.map_or(f64::INFINITY, |w| w[0]);
    // Close to the bound either result is acceptable.
    if n == 0 || n as f64 * variance > LEVERAGE_MAX {
        return f64::NAN;
    }
    solve(normal, right).map_or(f64::NAN, |plane| plane[0])
}

fn brute_force(values: &[f64], cols: usize, window: BoxWindow, at_partial: AtPartial) -> Background {
    let cells = |k: usize| window_cells(values, cols, window, k);
    let height = |k: usize| match at_partial {
        AtPartial::Plane => by_definition(&cells(k), window),
        AtPartial::Mean => cells(k).iter().map(|(_, z)| z).sum::<f64>() / cells(k).len() as f64,
    };
    Background {
        height_m: (0..values.len()).map(height).collect(),
        count: (0..values.len()).map(|k| cells(k).len() as u32).collect(),
    }
}

fn field(rows: usize, cols: usize, share_missing: f64) -> Vec<f64> {
    let mut s = Streams::for_seed(1, "detrend-test").stream("field");
    (0..rows * cols).map(|_| if s.uniform() < share_missing { f64::NAN } else { s.normal() }).collect()
}

const SHAPES: [(usize, usize, [usize; 2]); 6] =
    [(1, 1, [0, 0]), (7, 9, [1, 2]), (200, 150, [8, 5]), (300, 40, [3, 30]), (90, 70, [100, 1]), (5, 400, [0, 9])];

/// Absolute tolerance 1e-12 on values of unit variance (1e-11 for planes, whose sums are larger by the window size); counts and
/// no-data cells agree exactly.
#[test]
fn val_the_background_equals_the_definition() {
    for (rows, cols, half) in SHAPES {
        for share in [0.0, 0.2, 0.95, 1.0] {
            for (at_partial, tolerance) in [(AtPartial::Mean, 1e-12), (AtPartial::Plane, 1e-11)] {
                let values = field(rows, cols, share);
                let fast = background(&values, cols, BoxWindow { half }, at_partial);
                let slow = brute_force(&values, cols, BoxWindow { half }, at_partial);
                assert_eq!(fast.count, slow.count);
                for (k, (a, b)) in fast.height_m.iter().zip(&slow.height_m).enumerate() {
                    let agree = (a - b).abs() < tolerance || (a.is_nan() && b.is_nan());
                    assert!(agree, "{rows}x{cols} {half:?}, {share}, cell {k}: {a} {b}");
                }
            }
        }
    }
}

/// Deviations from the background of the cells that are not left out, by the definition.
#[test]
fn val_deviations_equal_the_definition() {
    let (rows, cols, window) = (150, 90, BoxWindow { half: [8, 5] });
    let values = field(rows, cols, 0.2);
    for share in [0, 3] {
        let left_out: Vec<bool> = (0..values.len()).map(|k| k % 10 < share).collect();
        let kept: Vec<f64> = values.iter().zip(&left_out).map(|(&v, &out)| if out { f64::NAN } else { v }).collect();
        let expected = brute_force(&kept, cols, window, AtPartial::Plane).height_m;
        for ((d, v), m) in deviations(&values, &left_out, cols, window).iter().zip(&values).zip(&expected) {
            assert!((d - (v - m).abs()).abs() < 1e-11 || (d.is_nan() && (v - m).is_nan()), "{d} {v} {m}");
        }
    }
}

/// A plane of 100 % slope in any direction, 3000 m above sea level, is its own background to 1e-9 m at borders, corners, and
/// scattered and blocky holes. The mean of partial windows is off by more than 0.3 m.
#[test]
fn val_planes_are_their_own_background() {
    let (rows, cols, window) = (200, 260, BoxWindow { half: [16, 16] });
    for azimuth_deg in [0.0f64, 30.0, 45.0, 90.0, 200.0] {
        let (sin, cos) = libm::sincos(azimuth_deg.to_radians());
        for share in [0.0, 0.15] {
            let plane = |k: usize| 3000.0 + 0.06 * (sin * (k % cols) as f64 - cos * (k / cols) as f64);
            let holes = field(rows, cols, share);
            let mut values: Vec<f64> =
                (0..rows * cols).map(|k| if holes[k].is_nan() { f64::NAN } else { plane(k) }).collect();
            (60..90).for_each(|r| values[r * cols + 100..r * cols + 140].fill(f64::NAN));
            let worst = |at_partial| {
                let found = background(&values, cols, window, at_partial);
                let at = |k: usize| if found.count[k] > 0 { (found.height_m[k] - plane(k)).abs() } else { 0.0 };
                (0..rows * cols).map(at).filter(|d| !d.is_nan()).fold(0.0, f64::max)
            };
            assert!(worst(AtPartial::Plane) < 1e-9, "{azimuth_deg}, {share}: {:e}", worst(AtPartial::Plane));
            assert!(worst(AtPartial::Mean) > 0.3, "{azimuth_deg}, {share}");
        }
    }
}

/// Variance of the plane at the centre times the number of cells, in closed form: 1 for a complete window, and `3 m / (m + 2)` more for
/// each axis of which the window has only the half from the centre to m cells: about 4 at a straight border, 7 in a corner.
#[test]
fn val_leverages() {
    let leverage = |rows: std::ops::RangeInclusive<isize>, cols: std::ops::RangeInclusive<isize>| {
        let mut m = Moments::default();
        let offsets: Vec<[isize; 2]> = rows.flat_map(|r| cols.clone().map(move |c| [r, c])).collect();
        offsets.iter().for_each(|offset| m.add(*offset, 1.0));
        let weights = m.weights()?;
        let squares: f64 = offsets.iter().map(|o| weights.at(*o) * weights.at(*o)).sum();
        assert!((offsets.iter().map(|o| weights.at(*o)).sum::<f64>() - 1.0).abs() < 1e-12);
        Some(squares * offsets.len() as f64)
    };
    assert!((leverage(-100..=100, -100..=100).unwrap() - 1.0).abs() < 1e-12);
    let half = 300.0 / 102.0;
    assert!((leverage(-100..=100, 0..=100).unwrap() - 1.0 - half).abs() < 1e-9);
    assert!((leverage(0..=100, -100..=0).unwrap() - 1.0 - 2.0 * half).abs() < 1e-9);
    assert_eq!(leverage(20..=100, 0..=100), None);
    assert_eq!(leverage(3..=3, 0..=4), None);
    assert!((leverage(0..=0, 0..=100).unwrap() - 1.0 - half).abs() < 1e-9);
}

/// A window is the odd number of cells nearest to its length: 2 m is 33 cells of 6 cm and 21 cells of 10 cm.
#[test]
fn val_windows_are_odd() {
    assert_eq!(BoxWindow::nearest(2.0, [0.06; 2]).cells(), [33, 33]);
    assert_eq!(BoxWindow::nearest(2.0, [0.1; 2]).cells(), [21, 21]);
    assert_eq!(BoxWindow::nearest(2.0, [0.1, 0.5]).cells(), [5, 21]);
    assert_eq!(BoxWindow::nearest(0.0, [1.0; 2]).cells(), [1, 1]);
}

/// One thread or many: bit-identical results.
#[test]
fn prop_results_do_not_depend_on_the_number_of_threads() {
    let values = field(400, 30, 0.1);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| background(&values, 30, BoxWindow { half: [4, 3] }, AtPartial::Plane).height_m)
    };
    let bits = |v: Vec<f64>| v.into_iter().map(f64::to_bits).collect::<Vec<_>>();
    assert_eq!(bits(run(1)), bits(run(4)));
}

#[test]
fn val_odd_windows() {
    assert_eq!([0.0, 0.1, 0.29, 0.3, 0.41, 0.5, -1.0, f64::NAN].map(|w| odd_cells(w, 0.1)), [1, 1, 3, 3, 5, 5, 1, 1]);
    assert!(odd_cells(f64::INFINITY, 0.1) > 1);
}

/// Cells without data, and those whose window is at most half full, have no background.
#[test]
fn val_sparse_windows_have_no_background() {
    let window = BoxWindow { half: [2, 1] };
    let values = field(20, 30, 0.4);
    let dem = Grid::new(sastrugi_numeric::Geometry::square(20, 30, 1.0), values.clone());
    let full = brute_force(&values, 30, window, AtPartial::Mean);
    let found = background_of(&dem, window, AtPartial::Mean, 0.5);
    for (k, m) in found.values.iter().enumerate() {
        let defined = !values[k].is_nan() && 2 * full.count[k] > 15;
        assert_eq!(m.is_nan(), !defined, "{k}");
        assert!(!defined || (m - full.height_m[k]).abs() < 1e-12, "{k}");
    }
}
