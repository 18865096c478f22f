//! The trials of the JPL paper: rovers on worlds of rocks (planetary.md, acceptance 18 and 19).

#![allow(clippy::unwrap_used, reason = "a test may end where it stands")]

use rayon::prelude::*;
use sastrugi_mobility::rover::{
    Cycle, Drive, Navigator, RoverParameters, SchoppersParameters, SojournerParameters, Start, drive,
};
use sastrugi_numeric::{Counter, Ground, GroundClass, GroundPoint, NoGround, Streams};
use sastrugi_terrain::planetary::{Clearing, Planetary, RawPlanetary};
use serde_json::{Value, json};

/// Flat sand with rocks of 0.04 to 4 m, on which the specification's values were measured.
fn world(coverage: f64) -> Planetary {
    let rocks = json!({"kind": "rocks", "coverage": coverage, "diameter_min_m": 0.04, "diameter_max_m": 4.0});
    let processes = json!([rocks]);
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
    let starts = parameters.starts(&Streams::for_seed(seed, "rover"), |_| true);
    let clearing = |centre_m: [f64; 2]| Clearing { centre_m, radius_m: parameters.clear_m };
    let clearings: Vec<Clearing> = starts.iter().flat_map(|s| [clearing(s.start_m), clearing(s.goal_m)]).collect();
    let ground = world(coverage).ground(&streams, parameters.cell_m, &clearings, 400).unwrap();
    let task = navigator.task(parameters);
    let noise = Counter::new(&mut Streams::for_seed(seed, "rover").stream("noise"));
    let one = |(k, start): (usize, &Start)| {
        let mut policy = navigator.policy();
        drive(&ground.view(), &task, policy.as_mut(), start, noise.at(k as i64), |_| {})
    };
    starts.par_iter().enumerate().map(one).collect()
}

fn mean(values: impl Iterator<Item = f64> + Clone) -> f64 {
    values.clone().sum::<f64>() / values.count() as f64
}

/// Mean distance, distance from start to goal over it, mean, smallest and largest efficiency, and the share that arrived.
fn summary(drives: &[Drive]) -> [f64; 6] {
    let distance_m = mean(drives.iter().map(|d| d.distance_m));
    let e = drives.iter().map(Drive::efficiency);
    let (least, most) = e.clone().fold((1.0, 0.0), |(low, high): (f64, f64), e| (low.min(e), high.max(e)));
    let reached = mean(drives.iter().map(|d| f64::from(u8::from(d.reached()))));
    [distance_m, drives[0].straight_m / distance_m, mean(e), least, most, reached]
}

/// Trials on several worlds together.
fn pooled(navigator: &Navigator, parameters: &RoverParameters, coverage: f64, worlds: u64) -> Vec<Drive> {
    (0..worlds).flat_map(|seed| trial(navigator, parameters, coverage, seed)).collect()
}

/// Acceptance 18, 100 rovers of 25 m: d0 over the mean distance falls with the density of rocks and lies in 0.04 to 0.16 at 17.6 % (the paper:
/// 25 / 280 = 0.089), and the spread of e is smallest at 6.9 %. Eight single worlds gave 0.05 to 0.13 at 17.6 %: the band
/// extends 3 of their standard deviations to either side, false alarm below 0.5 % for another seed; this one is fixed.
#[test]
#[ignore = "slow: ./test --full"]
fn stat_sojourner_like_rovers_slow_down_with_rocks() {
    let navigator = Navigator::Sojourner(SojournerParameters::default());
    let mut last = [f64::INFINITY, 0.0];
    for coverage in [0.069, 0.088, 0.118, 0.176] {
        let drives = trial(&navigator, &RoverParameters::default(), coverage, 1);
        let [distance_m, ratio, e, least, most, reached] = summary(&drives);
        println!("{coverage}: {distance_m:.1} m, {ratio:.3}, e {e:.3} ({least:.3} to {most:.3}), {reached:.2} arrived");
        assert!(ratio < last[0], "{coverage}: {ratio}");
        assert!(coverage > 0.1 || reached >= 0.98);
        if coverage == 0.069 {
            last[1] = most - least;
        }
        assert!(most - least >= last[1], "{coverage}: spread {}", most - least);
        assert!(coverage != 0.176 || (0.04..=0.16).contains(&ratio), "{ratio}");
        last[0] = ratio;
    }
}

/// Acceptance 19: Schoppers-like rovers at 8.8 % over 40 m: d0 over the mean distance in 0.85 to 0.93 (the paper: 40 / 44.9 = 0.891), at
/// least 95 % arrive, and at least 95 % pass no rock above the clearance on their centre line. Rovers that face the goal at
/// the start, which the paper does not say, have 0.94.
#[test]
#[ignore = "slow: ./test --full"]
fn stat_schoppers_like_rovers_arrive() {
    let navigator = Navigator::Schoppers(SchoppersParameters::default());
    let parameters = RoverParameters { radius_m: 40.0, ..RoverParameters::default() };
    let drives = pooled(&navigator, &parameters, 0.088, 4);
    let [distance_m, ratio, e, least, most, reached] = summary(&drives);
    println!("{distance_m:.1} m, {ratio:.3}, e {e:.3} ({least:.3} to {most:.3}), {reached:.3} arrived");
    assert!((0.85..=0.93).contains(&ratio) && reached >= 0.95);
    let clean = mean(drives.iter().map(|d| f64::from(u8::from(d.contacts.on_centre_line == 0))));
    assert!(clean >= 0.95, "{clean}");
}

/// The planner for comparison, as a study creates it.
fn planner(parameters: &Value) -> (Navigator, RoverParameters) {
    sastrugi_stages::jobs::rover::prepare(Navigator::PLANNER, parameters).unwrap()
}

/// Every navigator on one world at four densities, 25 rovers of 25 m (the table of docs/rovers.md). The planner that sees rectangles: up to 8.8 % rocks
/// at least 24 arrive, with d0 over the mean distance of at least 0.93 (here 25, 0.994 and 0.986). The planner on rays, up to 8.8 %: at
/// least 22 arrive, and it meets no more rocks than the rules on the same rays. When it placed a hazard anywhere in its strip, 18 arrived at 8.8 %, with
/// 3 contacts each, compared with 0.9 for the rules. Everything is fixed by the seed, so false alarms come only from changes of the code. If each
/// drive failed with a probability of 2 %, fewer than 22 of 25 would arrive with a probability of 0.2 % at either density.
#[test]
#[ignore = "slow: ./test --full"]
fn stat_planners_beside_navigators() {
    let default = RoverParameters::default;
    let navigators = [
        ("rays, rules", (Navigator::Sojourner(SojournerParameters::default()), default())),
        ("rays, plans", planner(&json!({"sensor": "rays"}))),
        ("rectangles, rules", (Navigator::Schoppers(SchoppersParameters::default()), default())),
        ("rectangles, plans", planner(&json!({"sensor": "rectangles"}))),
    ]
    .map(|(name, (navigator, parameters))| (name, (navigator, RoverParameters { rovers: 25, ..parameters })));
    for coverage in [0.069, 0.088, 0.118, 0.176] {
        let mut by_rules = f64::NAN;
        for (name, (navigator, parameters)) in &navigators {
            let drives = trial(navigator, parameters, coverage, 1);
            let [distance_m, ratio, e, least, most, reached] = summary(&drives);
            let no_way = drives.iter().filter(|d| d.ending.name() == "no_way").count();
            let contacts = mean(drives.iter().map(|d| f64::from(d.contacts.anywhere)));
            println!(
                "{coverage} {name}: {distance_m:.1} m, {ratio:.3}, e {e:.3} ({least:.3} to {most:.3}), {reached:.2} arrived, {no_way} no way, {contacts:.2} contacts"
            );
            assert!(drives.iter().all(|d| !d.reached() || d.residual_m <= 0.5));
            match *name {
                "rays, rules" => by_rules = contacts,
                "rays, plans" if coverage < 0.1 => {
                    assert!(reached >= 0.88 && contacts <= by_rules, "{coverage}: {reached} {contacts} {by_rules}");
                }
                "rectangles, plans" if coverage < 0.1 => {
                    assert!(reached >= 0.95 && ratio >= 0.93, "{coverage}: {reached} {ratio}");
                }
                _ => {}
            }
        }
    }
}

/// Level sand with hemispheres: centres and radii, m.
struct Hemispheres(Vec<([f64; 2], f64)>);

impl Ground for Hemispheres {
    fn at(&self, x: f64, y: f64) -> Result<GroundPoint, NoGround> {
        let squared_m2 = |(c, r): &([f64; 2], f64)| r * r - (x - c[0]) * (x - c[0]) - (y - c[1]) * (y - c[1]);
        let height_m = self.0.iter().map(|rock| squared_m2(rock).max(0.0).sqrt()).fold(0.0, f64::max);
        let class = if height_m > 0.0 { GroundClass::Rock } else { GroundClass::Sand };
        Ok(GroundPoint { height_m, class, albedo: 0.2 })
    }

    fn cell_m(&self) -> f64 {
        0.02
    }
}

/// Five rows of rocks of 0.3 m across the straight line, 2.5 m apart, each with a gate of 1.4 m, alternately 1 m to its left and to its right.
fn slalom(first_side: f64) -> Hemispheres {
    let radius_m = 0.3;
    let row = |n: i32| {
        let (along_m, gate_m) = (2.5 * f64::from(n + 1), first_side * f64::from(1 - 2 * (n % 2)));
        let offsets = (0..14).map(|k| 0.7 + radius_m + 0.5 * f64::from(k));
        offsets.flat_map(move |at| [gate_m + at, gate_m - at]).map(move |across_m| ([along_m, across_m], radius_m))
    };
    Hemispheres((0..5).flat_map(row).collect())
}

/// Both planners pass a slalom without touching a rock. When a planner placed a hazard anywhere in its strip, the one on rays met rocks 20 times and
/// gave up.
#[test]
fn val_planners_pass_a_slalom() {
    for sensor in ["rays", "rectangles"] {
        let (navigator, parameters) = planner(&json!({"sensor": sensor}));
        for first_side in [1.0, -1.0] {
            let start = Start::facing([0.0; 2], [15.0, 0.0]);
            let noise = Counter::new(&mut Streams::for_seed(1, "rover").stream("noise"));
            let task = navigator.task(&parameters);
            let drive = drive(&slalom(first_side), &task, navigator.policy().as_mut(), &start, noise, |_| {});
            assert!(drive.reached() && drive.contacts.anywhere == 0, "{sensor} {first_side}: {drive:?}");
            // Through all gates: around the ends of the rows it would be 26 m. With rectangles of half a metre, some gates may look closed.
            assert!(sensor == "rectangles" || drive.distance_m < 20.0, "{first_side}: {}", drive.distance_m);
        }
    }
}

/// With a cache for one tile of the ground and for all, rovers behave the same to the last bit (section 11).
#[test]
fn prop_tracks_do_not_depend_on_the_cache() {
    let parameters = RoverParameters { rovers: 3, radius_m: 6.0, ..RoverParameters::default() };
    let navigator = Navigator::Sojourner(SojournerParameters::default());
    let [small, large] = [1, 64].map(|tiles| {
        let streams = Streams::for_seed(3, "terrain");
        let ground = world(0.118).ground(&streams, 0.02, &[], tiles).unwrap();
        let starts = parameters.starts(&Streams::for_seed(3, "rover"), |_| true);
        let noise = Counter::new(&mut Streams::for_seed(3, "rover").stream("noise"));
        let track = |(k, start): (usize, &Start)| {
            let mut track = Vec::new();
            let each = |cycle: &Cycle<'_>| track.push((cycle.poses.real, cycle.view.clone()));
            let ended = drive(
                &ground.view(),
                &navigator.task(&parameters),
                navigator.policy().as_mut(),
                start,
                noise.at(k as i64),
                each,
            );
            (ended, track)
        };
        let tracks: Vec<_> = starts.iter().enumerate().map(track).collect();
        (tracks, ground.tiles_made())
    });
    assert!(large.0.len() == 3 && large.0.iter().all(|(_, track)| !track.is_empty()), "rovers drive");
    assert_eq!(small.0, large.0);
    assert!(small.1 > large.1, "{} {}", small.1, large.1);
}

/// A change of the world far from a rover's path changes nothing: common random numbers. Navigators that differ in clearance share world,
/// starts and noise.
#[test]
fn prop_designs_share_their_noise() {
    let parameters = RoverParameters { rovers: 4, radius_m: 5.0, ..RoverParameters::default() };
    let of = |clearance_m: f64| {
        let navigator = Navigator::Sojourner(SojournerParameters { clearance_m, ..Default::default() });
        trial(&navigator, &parameters, 0.088, 9)
    };
    let (a, b) = (of(0.13), of(0.02));
    assert_eq!([a.len(), b.len()], [4; 2]);
    assert!(a.iter().zip(&b).all(|(a, b)| a.last == b.last && a.distance_m == b.distance_m));
    assert!(a.iter().zip(&b).any(|(a, b)| a.contacts != b.contacts));
}
