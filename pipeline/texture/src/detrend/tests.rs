use super::*;
use sastrugi_numeric::Streams;

/// The definition, as a double loop.
fn brute_force(values: &[f64], cols: usize, window: BoxWindow) -> BoxMean {
    let rows = values.len() / cols;
    let [hr, hc] = window.half;
    let (mut mean, mut count) = (Vec::new(), Vec::new());
    for r in 0..rows {
        for c in 0..cols {
            let cells = (r.saturating_sub(hr)..(r + hr + 1).min(rows))
                .flat_map(|i| (c.saturating_sub(hc)..(c + hc + 1).min(cols)).map(move |j| values[i * cols + j]));
            let data: Vec<f64> = cells.filter(|v| !v.is_nan()).collect();
            mean.push(data.iter().sum::<f64>() / data.len() as f64);
            count.push(data.len() as u32);
        }
    }
    BoxMean { mean, count }
}

fn field(rows: usize, cols: usize, share_missing: f64) -> Vec<f64> {
    let mut s = Streams::for_seed(1, "detrend-test").stream("field");
    (0..rows * cols).map(|_| if s.uniform() < share_missing { f64::NAN } else { s.normal() }).collect()
}

/// Absolute tolerance 1e-12 on values of unit variance; counts exact; no data agrees.
#[test]
fn val_box_mean_equals_the_definition() {
    for (rows, cols, half) in
        [(1, 1, [0, 0]), (7, 9, [1, 2]), (200, 150, [8, 5]), (300, 40, [3, 30]), (90, 70, [100, 1])]
    {
        for share in [0.0, 0.2, 0.95, 1.0] {
            let values = field(rows, cols, share);
            let fast = box_mean(&values, cols, BoxWindow { half });
            let slow = brute_force(&values, cols, BoxWindow { half });
            assert_eq!(fast.count, slow.count);
            for (a, b) in fast.mean.iter().zip(&slow.mean) {
                assert!((a - b).abs() < 1e-12 || (a.is_nan() && b.is_nan()), "{rows}x{cols} {half:?}: {a} {b}");
            }
        }
    }
}

/// Deviations from the average of what is not left out, by the double loop.
#[test]
fn val_deviations_equal_the_definition() {
    let (rows, cols, window) = (150, 90, BoxWindow { half: [8, 5] });
    let values = field(rows, cols, 0.2);
    for share in [0, 3] {
        let left_out: Vec<bool> = (0..values.len()).map(|k| k % 10 < share).collect();
        let kept: Vec<f64> = values.iter().zip(&left_out).map(|(&v, &out)| if out { f64::NAN } else { v }).collect();
        let mean = brute_force(&kept, cols, window).mean;
        for ((d, v), m) in deviations(&values, &left_out, cols, window).iter().zip(&values).zip(&mean) {
            assert!((d - (v - m).abs()).abs() < 1e-12 || (d.is_nan() && (v - m).is_nan()), "{d} {v} {m}");
        }
    }
}

/// Windows of the specification: 2 m is 33 cells of 6 cm and 21 cells of 10 cm.
#[test]
fn val_windows_are_odd() {
    assert_eq!(BoxWindow::nearest(2.0, [0.06; 2]).cells(), [33, 33]);
    assert_eq!(BoxWindow::nearest(2.0, [0.1; 2]).cells(), [21, 21]);
    assert_eq!(BoxWindow::nearest(2.0, [0.1, 0.5]).cells(), [5, 21]);
    assert_eq!(BoxWindow::nearest(0.0, [1.0; 2]).cells(), [1, 1]);
}

/// One thread or many: the same bits.
#[test]
fn prop_threads_change_no_bit() {
    let values = field(400, 30, 0.1);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| box_mean(&values, 30, BoxWindow { half: [4, 3] }).mean)
    };
    let bits = |v: Vec<f64>| v.into_iter().map(f64::to_bits).collect::<Vec<_>>();
    assert_eq!(bits(run(1)), bits(run(4)));
}
