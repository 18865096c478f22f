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

/// Mixtures of Gaussians are met to 1 % of the variance at every lag, along any direction (a single Gaussian that falls
/// between two sizes to 3 %); the variance exactly.
#[test]
fn val_the_covariance_is_met() {
    for (name, limit, raw) in [
        ("exponential", 0.01, json!({ "size_m": [20.0, 20.0] })),
        ("gaussian", 0.03, json!({ "size_m": [20.0, 20.0] })),
        ("matern", 0.01, json!({ "size_m": [20.0, 20.0], "ratio": 0.4, "azimuth_deg": 60.0 })),
    ] {
        let texture = texture(name, raw);
        let lags = texture.covariance();
        assert!((lags[0].achieved_m2 - 0.09).abs() < 1e-12);
        let worst = lags.iter().map(|l| (l.achieved_m2 - l.wanted_m2).abs()).fold(0.0, f64::max);
        assert!(worst < limit * 0.09, "{name}: {}", worst / 0.09);
    }
}

/// The mean torus covariance of 20 tiles is the stated one. Null: equal; independent patches of a tile at least
/// `9.6^2 / (2 pi 0.6^2)` = 41: 5 % for the mean of 20; threshold 29 % of the variance (5.8 standard errors).
#[test]
fn stat_the_stated_covariance_is_made() {
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

/// Intermittency fattens the tails of increments over one cell and leaves the variance. Null of no effect: excess kurtosis of
/// 40 000 increments below 1; found above 2.
#[test]
fn stat_intermittency_fattens_small_increments() {
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
