//! Fits of textures with measurement noise.

use super::*;
use crate::covariance::filtered::Measurement;
use crate::fit::simulate::{Shape, Simulator};

const TRUTH: Noise = Noise { white_sigma_m: 0.01, correlated_sigma_m: 0.02, correlated_range_m: 0.18 };
const SIGMA_M: f64 = 0.05;
const RANGE_M: f64 = 0.28;

/// A measured field on ground that rises eastwards by `slope`.
fn measured(noise: Noise, slope: f64, seed: u64) -> Grid {
    let cells = 256;
    let truth = covariance("exponential", &[("sigma_m", SIGMA_M), ("range_m", RANGE_M)]);
    let shape = Shape { rows: cells, cols: cells, profiles: false };
    let simulator = Simulator::new(&truth, Measurement { inner_scale_m: 0.0, noise }, shape, [CELL_M; 2], 1.0);
    let mut heights = simulator.surface(&Streams::for_seed(seed, "noise-fit"));
    heights.iter_mut().enumerate().for_each(|(k, z)| *z += slope * CELL_M * (k % cells) as f64);
    Grid::new(Geometry::square(cells, cells, CELL_M), heights)
}

fn noisy(model: &str) -> FitSettings {
    with_bootstrap(model, 0).with_noise(&TRUTH).unwrap()
}

/// Stated correlated noise is removed: means of 16 fields on a slope of 20 %. One field scatters by 2.3 % in sigma and 5.5 % in b, so
/// four standard errors are 2.3 % and 5.5 %. Without the statement sigma comes out about a tenth too large.
#[test]
fn stat_correlated_noise_is_removed() {
    let found: Vec<[f64; 3]> = (0..16u64)
        .into_par_iter()
        .map(|seed| {
            let dem = measured(TRUTH, 0.2, seed);
            let fitted = |settings: &FitSettings| fit(&dem, settings, &streams()).unwrap().fit.parameters;
            let stated = fitted(&noisy("exponential"));
            [stated["sigma_m"], stated["range_m"], fitted(&with_bootstrap("exponential", 0))["sigma_m"]]
        })
        .collect();
    let mean = |k: usize| sums::mean(&found.iter().map(|f| f[k]).collect::<Vec<_>>());
    let bias = [mean(0) / SIGMA_M - 1.0, mean(1) / RANGE_M - 1.0, mean(2) / SIGMA_M - 1.0];
    println!("{bias:?}");
    assert!(bias[0].abs() < 0.023 && bias[1].abs() < 0.055, "{bias:?}");
    assert!(bias[2] > 0.05, "{bias:?}");
}

/// The measured covariance is stored without the noise: mean over 16 fields of its standard deviation over that of the same
/// surfaces without noise; four standard errors as above.
#[test]
fn stat_a_covariance_map_has_no_noise() {
    let sigma = |dem: &Grid, settings: &FitSettings| {
        let map = fit(dem, settings, &streams()).unwrap().fit.map.unwrap();
        map.covariance_m2[map.max_lag[1]].sqrt()
    };
    let ratios: Vec<f64> = (0..16u64)
        .into_par_iter()
        .map(|seed| {
            let quiet = sigma(&measured(Noise::default(), 0.0, seed), &with_bootstrap("empirical", 0));
            sigma(&measured(TRUTH, 0.0, seed + 100), &noisy("empirical")) / quiet
        })
        .collect();
    let mean = sums::mean(&ratios);
    println!("{mean}");
    assert!((mean - 1.0).abs() < 0.02, "{mean}");
}

/// Blocks of one site have the site's sigma on average, whatever the noise.
#[test]
fn stat_local_maps_have_no_noise() {
    let dem = measured(TRUTH, 0.0, 7);
    let outcome = fit(&dem, &noisy("exponential"), &streams()).unwrap();
    let maps = outcome.local_maps(&dem, Some(4.0)).unwrap();
    let sigma_m = sums::mean(&maps.sigma_m.unwrap().values);
    let site_m = outcome.fit.parameters["sigma_m"];
    // 16 blocks.
    assert!((sigma_m / site_m - 1.0).abs() < 4.0 * maps.sigma_error / 4.0 + 0.01, "{sigma_m} {site_m}");
}

/// Noise that leaves nothing for a texture, or is incomplete, is refused with the parameter's name.
#[test]
fn val_impossible_noise_is_refused() {
    let key = |noise: [f64; 3]| {
        let [noise_sigma_m, correlated_noise_sigma_m, correlated_noise_range_m] = noise;
        let parameters = FitParameters {
            noise_sigma_m,
            correlated_noise_sigma_m,
            correlated_noise_range_m,
            bootstrap: 0,
            ..FitParameters::default()
        };
        FitSettings::try_from(parameters).err().map(|e| e.key)
    };
    assert_eq!(key([0.01, 0.02, 0.3]), None);
    for noise in [[0.0, 0.01, 0.0], [0.0, 0.0, 0.3], [0.0, 0.01, 2.0], [0.0, 0.01, -1.0]] {
        assert_eq!(key(noise).as_deref(), Some("correlated_noise_range_m"), "{noise:?}");
    }
    assert_eq!(key([0.0, f64::NAN, 0.3]).as_deref(), Some("correlated_noise_sigma_m"));
    let unknown = FitParameters { model: "nonsense".to_owned(), ..FitParameters::default() };
    assert!(FitSettings::try_from(unknown).err().unwrap().message.ends_with("`empirical`, the measured covariance"));
    let loud = Noise { correlated_sigma_m: 0.2, ..TRUTH };
    let settings = with_bootstrap("exponential", 0).with_noise(&loud).unwrap();
    let refused = fit(&measured(TRUTH, 0.0, 1), &settings, &streams()).err().unwrap().to_string();
    assert!(refused.contains("m of noise in the residual"), "{refused}");
}

/// A texture with the true covariance reproduces the residual except for its noise; both kinds of fit report this.
#[test]
fn val_noise_does_not_count_in_what_a_texture_reproduces() {
    let dem = measured(TRUTH, 0.0, 3);
    for model in ["exponential", "empirical"] {
        let carried = fit(&dem, &noisy(model), &streams()).unwrap().fit.carried.unwrap();
        assert!((carried.rms_share - 1.0).abs() < 0.03, "{model}: {carried:?}");
        assert!(!carried.increments.is_empty(), "{model}: {carried:?}");
        assert!(carried.increments.iter().all(|o| (o.share - 1.0).abs() < 0.1), "{model}: {carried:?}");
    }
}
