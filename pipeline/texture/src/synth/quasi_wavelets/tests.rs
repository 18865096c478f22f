use super::*;
use crate::covariance::model;
use crate::synth::fft_ma::torus_covariance;
use crate::synth::{Synthesis, Texture};
use sastrugi_numeric::sums;
use serde_json::{Value, json};

fn texture(name: &str, raw: Value) -> Texture<QuasiWavelets> {
    let covariance = Covariance::new(model(name).unwrap(), 0.3, 0.6).unwrap();
    let (of_tile, own) = tile::read::<QuasiWaveletsParameters>(&raw).unwrap();
    let tile = Tile::check(of_tile, own.is_periodic()).unwrap();
    Texture::new(&tile, &own, covariance.into()).unwrap()
}

/// Mixtures of Gaussians are reproduced to 1 % of the variance at every lag, along any direction (a single Gaussian between two
/// sizes to 3 %); the variance exactly.
#[test]
fn val_the_covariance_is_reproduced() {
    for (name, limit, raw) in [
        ("exponential", 0.01, json!({ "size_m": [20.0, 20.0] })),
        ("gaussian", 0.03, json!({ "size_m": [20.0, 20.0] })),
        ("matern", 0.01, json!({ "size_m": [20.0, 20.0], "ratio": 0.4, "azimuth_deg": 60.0 })),
    ] {
        let texture = texture(name, raw);
        let lags = texture.covariance();
        assert!((lags[0].achieved_m2 - 0.09).abs() < 1e-12);
        let worst = lags.iter().map(|l| (l.achieved_m2 - l.wanted_m2).abs()).max_by(f64::total_cmp).unwrap();
        assert!(worst < limit * 0.09, "{name}: {}", worst / 0.09);
    }
}

/// The mean torus covariance of 20 tiles is the stated one. Null: equal. A tile has at least `9.6^2 / (2 pi 0.6^2)` = 41 independent
/// patches: standard error 5 % for the mean of 20; threshold 29 % of the variance (5.8 standard errors).
#[test]
fn stat_the_stated_covariance_is_achieved() {
    let texture = texture("exponential", json!({ "size_m": [9.6, 9.6], "intermittency": 0.5 }));
    let mut mean = vec![0.0; 96 * 96];
    for seed in 0..20 {
        let grid = texture.generate(&Streams::for_seed(seed, "texture")).unwrap().grid;
        mean.iter_mut().zip(torus_covariance(&grid)).for_each(|(m, c)| *m += c / 20.0);
    }
    let achieved = texture.kernel.achieved();
    for (k, found) in mean.iter().enumerate().take(10) {
        let stated = achieved([0.1 * k as f64, 0.0]);
        assert!((found - stated).abs() < 0.29 * 0.09, "{k}: {found} {stated}");
    }
}

/// Intermittency makes the tails of increments over one cell heavier without changing the variance. Null of no effect: excess kurtosis
/// of 40 000 increments below 1; with it, above 2.
#[test]
fn stat_intermittency_makes_small_increments_heavy_tailed() {
    let kurtosis = |intermittency: f64| {
        let raw = json!({ "size_m": [20.0, 20.0], "intermittency": intermittency });
        let grid = texture("exponential", raw).generate(&Streams::for_seed(4, "texture")).unwrap().grid;
        let increments: Vec<f64> = (0..200)
            .flat_map(|r| (1..200).map(move |c| (r, c)))
            .map(|(r, c)| grid.at(r, c) - grid.at(r, c - 1))
            .collect();
        let square = sums::mean(&increments.iter().map(|d| d * d).collect::<Vec<_>>());
        sums::mean(&increments.iter().map(|d| d * d * d * d).collect::<Vec<_>>()) / (square * square) - 3.0
    };
    assert!(kurtosis(0.0) < 1.0 && kurtosis(2.0) > 2.0, "{} {}", kurtosis(0.0), kurtosis(2.0));
}

/// By hand: without a bound the minimum of the second is at (2, -1), with x >= 0 at (3/2, 0); of the first at (1, -1) and (1, 0). A positive
/// solution is left as it is.
#[test]
fn val_non_negative_least_squares_by_hand() {
    for (gram, right, expected) in [
        ([[2.0, 0.0], [0.0, 1.0]], [2.0, -1.0], [1.0, 0.0]),
        ([[2.0, 1.0], [1.0, 2.0]], [3.0, 0.0], [1.5, 0.0]),
        ([[2.0, 1.0], [1.0, 2.0]], [4.0, 5.0], [1.0, 2.0]),
    ] {
        let found = non_negative_least_squares(&gram.map(|row| row.to_vec()), &right);
        assert!((0..2).all(|k| (found[k] - expected[k]).abs() < 1e-12), "{found:?} {expected:?}");
    }
}

/// By hand: half axes 1, 1/2, 1/4 and 1/8 m (0.7 cells are 0.07 m) on a tile of 100 m2 with one bump per area of its half axes: 100, 400, 1600,
/// 6400. With an intermittency of 1 each class has as many fewer as its bumps are smaller; across the axis they are `ratio` as wide.
#[test]
fn val_classes_by_hand() {
    let tile = Geometry::square(100, 100, 0.1);
    let of = |intermittency: f64, ratio: f64| {
        let own = QuasiWaveletsParameters { size_ratio: 0.5, packing: 1.0, intermittency };
        classes(&own, &tile, 2.0, ratio).unwrap()
    };
    let plain = of(0.0, 1.0);
    assert_eq!(plain.iter().map(|c| c.along_m).collect::<Vec<_>>(), [1.0, 0.5, 0.25, 0.125]);
    assert_eq!(plain.iter().map(|c| c.count).collect::<Vec<_>>(), [100, 400, 1600, 6400]);
    for (class, (count, across_m)) in of(1.0, 0.5).iter().zip([(200, 0.5), (400, 0.25), (800, 0.125), (1600, 0.0625)]) {
        assert!(class.count.abs_diff(count) <= 1 && (class.across_m - across_m).abs() < 1e-15, "{class:?}");
    }
    // Bumps no wider than half the tile, whatever the covariance.
    let own = QuasiWaveletsParameters::default();
    assert_eq!(classes(&own, &tile, 1e6, 1.0).unwrap()[0].along_m, 5.0);
    let dense = QuasiWaveletsParameters { packing: 1e9, ..own };
    assert_eq!(classes(&dense, &tile, 2.0, 1.0).err().unwrap().key, "packing");
}
