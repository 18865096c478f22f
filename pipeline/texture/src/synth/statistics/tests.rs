use super::*;
use sastrugi_numeric::filters::gaussian_low_pass;
use sastrugi_numeric::{Geometry, Streams};

fn noise(rows: usize, cols: usize) -> Grid {
    let mut stream = Streams::for_seed(1, "statistics-test").stream("noise");
    Grid::new(Geometry::square(rows, cols, 0.1), (0..rows * cols).map(|_| stream.normal()).collect())
}

/// A site of half a million cells with the longest lags gives a section below 1 MB that reads back and passes its own check.
#[test]
fn val_a_section_stays_below_a_megabyte() {
    let found = measure(&gaussian_low_pass(&noise(700, 720), 2.0), [300, 300]).unwrap();
    let text = serde_json::to_string(&found).unwrap();
    assert!((100_000..1_000_000).contains(&text.len()), "{}", text.len());
    assert_eq!(lags::reach(&found.covariance), [256, 256]);
    assert_eq!((found.cells, found.cell_m, found.wavelets.octaves), (700 * 720, [0.1, 0.1], 5));
    let again: Statistics = serde_json::from_str(&text).unwrap();
    assert!(again.check().is_ok() && again == found);
    // A normal residual: no patches, and a flatness of 3 at short lags.
    assert!(found.modulation.log_variance < 0.1, "{:?}", found.modulation);
    assert!((found.modulation.flatness[0] - 3.0).abs() < 0.2, "{:?}", found.modulation.flatness);
}

/// The section does not depend on where the residual lies, and scales with it.
#[test]
fn prop_statistics_scale_with_the_heights() {
    let z = gaussian_low_pass(&noise(130, 140), 1.0);
    let (one, twice) = (measure(&z, [16, 16]).unwrap(), measure(&z.map(|v| 2.0 * v), [16, 16]).unwrap());
    // Powers of two are exact.
    assert!(one.heights_m.iter().zip(&twice.heights_m).all(|(a, b)| 2.0 * a == *b));
    assert!((twice.covariance.variance() / one.covariance.variance() - 4.0).abs() < 1e-12);
    for (a, b) in one.wavelets.mean_log.iter().zip(&twice.wavelets.mean_log) {
        // Logarithms are kept in single precision.
        assert!((b - a - std::f64::consts::LN_2).abs() < 1e-6);
    }
    assert_eq!(one.modulation.log_variance, twice.modulation.log_variance);
}

/// The same section on one and three threads.
#[test]
fn prop_threads_change_no_bit() {
    let z = gaussian_low_pass(&noise(150, 110), 1.0);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| serde_json::to_string(&measure(&z, [12, 12]).unwrap()).unwrap())
    };
    assert_eq!(on(1), on(3));
}

/// 130 x 140 cells have lags one by one only to 8, so that there are four cells for each number; the Laplacian keeps all of its lags.
#[test]
fn val_small_sites_state_fewer_lags() {
    let small = measure(&noise(130, 140), [24, 24]).unwrap();
    assert_eq!(
        (small.covariance.rows[8..].to_vec(), small.laplacian.rows.len()),
        (vec![8, 10, 12, 14, 16, 20, 24], 17)
    );
    assert!(CELLS_PER_NUMBER * small.numbers() <= 130 * 140 && small.check().is_ok());
    let found = measure(&noise(100, 100), [24, 24]);
    assert!(matches!(found, Err(StatisticsError::TooFewCells { cells: 10_000, .. })), "{found:?}");
    assert_eq!(
        StatisticsError::TooFewCells { cells: 10_000, numbers: 3000 }.to_string(),
        "the residual has 10000 cells with data; its statistics, 3000 numbers, need 4 for each, 12000: use a larger DEM"
    );
}

#[test]
fn val_refusals() {
    let z = noise(64, 64);
    let mut holed = z.clone();
    holed.values[0] = f64::NAN;
    assert_eq!(measure(&holed, [16, 16]), Err(StatisticsError::TooSmall { cells: CELLS_MIN - 1 }));
    assert_eq!(measure(&z, [3, 16]), Err(StatisticsError::ShortLag { lag: 3 }));
    assert_eq!(measure(&z.map(|_| 2.5), [16, 16]), Err(StatisticsError::Flat { height_m: 2.5 }));
    // A strip of seven rows has no lags to half its width.
    assert_eq!(measure(&noise(7, 700), [16, 16]), Err(StatisticsError::ShortLag { lag: 3 }));
    for (lag, cells) in [(1, "1 cell"), (3, "3 cells")] {
        assert_eq!(
            StatisticsError::ShortLag { lag }.to_string(),
            format!(
                "the largest lag of the covariance is {cells}; it must be at least 4: use a wider window or smaller cells"
            )
        );
    }
    let few = [1, 2].map(|cells| StatisticsError::TooSmall { cells }.to_string());
    assert!(few[0].starts_with("the residual has 1 cell with data;"), "{few:?}");
    assert!(few[1].starts_with("the residual has 2 cells with data;"), "{few:?}");
}
