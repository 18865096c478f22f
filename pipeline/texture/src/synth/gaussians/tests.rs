use super::*;
use crate::covariance::model;
use crate::synth::fft_ma::torus_covariance;
use crate::synth::{Synthesis, Texture};
use serde_json::{Value, json};

fn texture(raw: Value) -> Texture<Gaussians> {
    let covariance = Covariance::new(model("exponential").unwrap(), 0.3, 0.8).unwrap();
    let (of_tile, own) = tile::read::<GaussiansParameters>(&raw).unwrap();
    let tile = Tile::check(of_tile, own.is_periodic()).unwrap();
    Texture::new(&tile, &own, covariance.into()).unwrap()
}

/// The mean torus covariance of 20 tiles is the stated one. Null: equal. A tile has at least `L^2 / (2 pi a^2)` = 41
/// independent patches, so that its variance scatters by sqrt(2 / 41) = 22 %, the mean of 20 by 5 %; threshold 29 % of the
/// variance (5.8 standard errors, below 1e-8) at every lag up to 8 cells, along and across.
#[test]
fn stat_the_stated_covariance_is_achieved() {
    for raw in [
        json!({ "size_m": [9.6, 9.6], "scale_m": 0.6 }),
        json!({ "size_m": [9.6, 9.6], "scale_m": 0.6, "ratio": 0.5, "azimuth_deg": 90.0 }),
        json!({ "size_m": [9.6, 9.6], "scale_m": 0.6, "ratio": 0.5, "azimuth_deg": 30.0 }),
    ] {
        let texture = texture(raw);
        let mut mean = vec![0.0; 96 * 96];
        for seed in 0..20 {
            let grid = texture.generate(&Streams::for_seed(seed, "texture")).unwrap().grid;
            mean.iter_mut().zip(torus_covariance(&grid)).for_each(|(m, c)| *m += c / 20.0);
        }
        let achieved = texture.kernel.achieved();
        for k in 0..8 {
            let (east, south) = (achieved([0.1 * k as f64, 0.0]), achieved([0.0, -0.1 * k as f64]));
            assert!((mean[k] - east).abs() < 0.29 * 0.09, "{k} east: {} {east}", mean[k]);
            assert!((mean[96 * k] - south).abs() < 0.29 * 0.09, "{k} south: {} {south}", mean[96 * k]);
        }
    }
}

/// The variance is the fit's, and both correlations are 1/2 at the same distance.
#[test]
fn val_scale_follows_from_the_fit() {
    let texture = texture(json!({ "size_m": [20.0, 20.0] }));
    let half_m = 0.8 * std::f64::consts::LN_2;
    let achieved = texture.kernel.achieved();
    assert!((achieved([0.0; 2]) - 0.09).abs() < 1e-15);
    assert!((achieved([half_m, 0.0]) - 0.045).abs() < 1e-9);
    assert!(texture.notes().iter().any(|n| n.contains("differs from the fit's")), "{:?}", texture.notes());
}

/// The banded sum matches a direct sum over all bumps and periods: bumps wider than the tile, an oblique axis. The height A follows from the
/// variance by Campbell's formula, with the sum over the tile's periods.
#[test]
fn val_bumps_wrap_around_the_edges() {
    let geometry = Geometry { rows: 7, cols: 9, cell: [0.2, 0.3], origin: [0.0; 2] };
    let torus = Torus::new(geometry, 25.0);
    let class = Class { along_m: 0.9, across_m: 0.5, count: 5, variance_m2: 1.0 };
    let mut field = vec![0.0; 63];
    let streams = Streams::for_seed(3, "texture");
    torus.add(&class, &mut field, &streams, "bumps");
    let mut stream = streams.stream("bumps");
    let mut direct = vec![0.0; 63];
    for _ in 0..5 {
        let (u, v) = (stream.uniform() * 9.0 - 0.5, stream.uniform() * 7.0 - 0.5);
        let sign = if stream.bits() >> 63 == 0 { 1.0 } else { -1.0 };
        let (sin, cos) = libm::sincos(25f64.to_radians());
        for (k, z) in direct.iter_mut().enumerate() {
            for (i, j) in (-4..=4).flat_map(|i| (-4..=4).map(move |j| (i, j))) {
                let x = ((k % 9) as f64 - u + 9.0 * f64::from(i)) * 0.2;
                let y = -((k / 9) as f64 - v + 7.0 * f64::from(j)) * 0.3;
                let (s, t) = ((x * sin + y * cos) / 0.9, (x * cos - y * sin) / 0.5);
                *z += sign * libm::exp(-s * s - t * t);
            }
        }
    }
    let (sin, cos) = libm::sincos(25f64.to_radians());
    let periods = (-9..=9).flat_map(|i| (-9..=9).map(move |j| (1.8 * f64::from(i), 2.1 * f64::from(j))));
    let repeated: f64 = periods
        .map(|(x, y)| {
            let (s, t) = ((x * sin + y * cos) / 0.9, (x * cos - y * sin) / 0.5);
            libm::exp(-0.5 * (s * s + t * t))
        })
        .sum();
    let height = (1.0 / (5.0 / (1.8 * 2.1) * 0.5 * std::f64::consts::PI * 0.9 * 0.5 * repeated)).sqrt();
    assert!(field.iter().zip(&direct).all(|(a, b)| (a - height * b).abs() < 1e-6), "{height} {field:?} {direct:?}");
}

#[test]
fn prop_threads_change_no_bit() {
    let texture = texture(json!({ "size_px": [70, 90] }));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| texture.generate(&Streams::for_seed(9, "texture")).unwrap().grid.values)
    };
    assert!(run(1).iter().zip(&run(4)).all(|(a, b)| a.to_bits() == b.to_bits()));
}
