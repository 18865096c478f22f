//! The trials of the JPL paper: rovers on worlds of rocks (planetary.md, acceptance 18 and 19).

#![allow(clippy::unwrap_used, reason = "a test may end where it stands")]

use rayon::prelude::*;
use sastrugi_mobility::rover::{
    Drive, Navigator, RoverParameters, SchoppersParameters, SojournerParameters, drive,
};
use sastrugi_numeric::{Counter, Streams};
use sastrugi_terrain::planetary::{Clearing, Planetary, RawPlanetary};
use serde_json::json;

/// Flat sand with rocks of 0.04 to 4 m, on which the specification's figures were measured.
fn world(coverage: f64) -> Planetary {
    let processes = json!([{"kind": "rocks", "coverage": coverage, "diameter_min_m": 0.04, "diameter_max_m": 4.0}]);
    let raw = RawPlanetary {
        size_px: Some([16, 16]),
        basic_spacing_m: Some(0.01),
        processes: serde_json::from_value(processes).unwrap(),
        ..RawPlanetary::default()
    };
    Planetary::try_from(raw).unwrap()
}

/// All rovers of a trial on one world.
fn trial(navigator: &Navigator, parameters: &RoverParameters, coverage: f64, seed: u64) -> Vec<Drive> {
    let streams = Streams::for_seed(seed, "terrain");
    let starts = parameters.starts(&Streams::for_seed(seed, "rover"));
    let clearing = |centre_m: [f64; 2]| Clearing { centre_m, radius_m: parameters.clear_m };
    let clearings: Vec<Clearing> = starts.iter().flat_map(|s| [clearing(s.start_m), clearing(s.goal_m)]).collect();
    let ground = world(coverage).ground(&streams, parameters.cell_m, &clearings, 400).unwrap();
    let task = navigator.task(parameters);
    let noise = Counter::new(&mut Streams::for_seed(seed, "rover").stream("noise"));
    let one = |(k, start): (usize, &sastrugi_mobility::rover::Start)| {
        let mut policy = navigator.policy();
        drive(&ground.view(), &task, policy.as_mut(), start, noise.at(k as i64), |_| {})
    };
    starts.par_iter().enumerate().map(one).collect()
}

fn mean(values: impl Iterator<Item = f64> + Clone) -> f64 {
    values.clone().sum::<f64>() / values.count() as f64
}

/// Mean distance, distance from start to goal over it, mean efficiency, its least and greatest, and the share that arrived.
fn summary(drives: &[Drive]) -> [f64; 6] {
    let distance_m = mean(drives.iter().map(|d| d.distance_m));
    let e = drives.iter().map(Drive::efficiency);
    let (least, most) = e.clone().fold((1.0, 0.0), |(low, high): (f64, f64), e| (low.min(e), high.max(e)));
    let reached = mean(drives.iter().map(|d| f64::from(u8::from(d.reached()))));
    [distance_m, drives[0].straight_m / distance_m, mean(e), least, most, reached]
}

#[test]
#[ignore = "prints"]
fn stat_explore() {
    for (coverage, seeds) in [(0.069, 2), (0.088, 2), (0.118, 2), (0.176, 4)] {
        for seed in 0..seeds {
            let began = std::time::Instant::now();
            let drives = trial(
                &Navigator::Sojourner(SojournerParameters::default()),
                &RoverParameters::default(),
                coverage,
                seed,
            );
            println!("sojourner {coverage} {seed}: {:.3?} {:.1} s contacts {} {}", summary(&drives), began.elapsed().as_secs_f64(), drives.iter().map(|d| d.contacts.anywhere).sum::<u32>(), drives.iter().filter(|d| d.contacts.on_centre_line > 0).count());
        }
    }
    for seed in 0..4 {
        let began = std::time::Instant::now();
        let parameters = RoverParameters { radius_m: 40.0, ..RoverParameters::default() };
        let drives = trial(&Navigator::Schoppers(SchoppersParameters::default()), &parameters, 0.088, seed);
        println!("schoppers {seed}: {:.3?} {:.1} s contacts {} {}", summary(&drives), began.elapsed().as_secs_f64(), drives.iter().map(|d| d.contacts.anywhere).sum::<u32>(), drives.iter().filter(|d| d.contacts.on_centre_line > 0).count());
    }
}
