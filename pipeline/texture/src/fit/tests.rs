use super::*;
use crate::synth::Synthesis;
use crate::synth::fft_ma::{FftMa, FftMaParameters, Phase};
use sastrugi_numeric::{Geometry, Streams};

const CELL_M: f64 = 0.06;

/// A normal field with an exponential covariance of unit sigma, cut from a larger torus.
fn field(range_m: f64, cells: usize, cell_m: f64, seed: u64) -> Grid {
    let covariance = Covariance::new(crate::covariance::model("exponential").unwrap(), 1.0, range_m).unwrap();
    let size_m = [cells as f64 * cell_m; 2];
    let parameters = FftMaParameters { size_m, cell_m, phase: Phase::Gaussian, periodic: false };
    FftMa::new(parameters, covariance).unwrap().generate(&Streams::for_seed(seed, "fit-test")).unwrap().grid
}

fn settings(mode: Mode, outer_scale_m: f64) -> FitSettings {
    FitParameters { mode, outer_scale_m, ..FitParameters::default() }.try_into().unwrap()
}

fn estimate(dem: &Grid, settings: &FitSettings) -> [f64; 2] {
    let fit = fit(dem, settings).unwrap().fit;
    ["sigma_m", "range_m"].map(|k| fit.parameters[k])
}

/// Relative bias and scatter of sigma and b over `count` fields.
fn study(range_m: f64, cells: usize, count: u64, settings: &FitSettings, spoil: fn(&mut Grid, u64)) -> [[f64; 2]; 2] {
    let estimates: Vec<[f64; 2]> = (0..count)
        .map(|seed| {
            let mut dem = field(range_m, cells, CELL_M, seed);
            spoil(&mut dem, seed);
            estimate(&dem, settings)
        })
        .collect();
    [(0, 1.0), (1, range_m)].map(|(k, truth)| {
        let values: Vec<f64> = estimates.iter().map(|e| e[k] / truth).collect();
        [sums::mean(&values) - 1.0, sums::variance(&values).sqrt()]
    })
}

fn untouched(_: &mut Grid, _: u64) {}

#[test]
#[ignore]
fn probe() {
    for (b, w) in [(0.28, 2.0), (1.0, 2.0), (0.28, 1.0), (0.28, 4.0), (1.0, 4.0)] {
        for mode in [Mode::Paper, Mode::Corrected] {
            println!("b {b} w {w} {mode:?}: {:?}", study(b, 512, 30, &settings(mode, w), untouched));
        }
    }
}
