//! Rovers on synthetic test ground. Trials on rocky worlds are in `tests/rovers`.

use super::draws::CycleDraws;
use super::motion::NoiseParameters;
use super::policies::Situation;
use super::sensing::RaySensor;
use super::starts::{Facing, on_circle};
use super::*;
use proptest::prelude::*;
use sastrugi_numeric::{Counter, Ground, GroundClass, GroundPoint, NoGround, Streams};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A round rock with vertical sides: centre, radius and height, m.
type Rock = ([f64; 2], f64, f64);

/// A plane with rocks, known within a distance of the origin along each axis.
struct Made {
    slopes: [f64; 2],
    rocks: Vec<Rock>,
    known_m: f64,
}

impl Made {
    fn flat(rocks: &[Rock]) -> Self {
        Self { slopes: [0.0; 2], rocks: rocks.to_vec(), known_m: 1e4 }
    }
}

impl Ground for Made {
    fn at(&self, x: f64, y: f64) -> Result<GroundPoint, NoGround> {
        if !(x.abs() <= self.known_m && y.abs() <= self.known_m) {
            return Err(NoGround { x_m: x, y_m: y });
        }
        let over = self.rocks.iter().filter(|(c, r, _)| (x - c[0]) * (x - c[0]) + (y - c[1]) * (y - c[1]) < r * r);
        let height = over.map(|rock| rock.2).fold(0.0, f64::max);
        let class = if height > 0.0 { GroundClass::Rock } else { GroundClass::Sand };
        Ok(GroundPoint { height_m: self.slopes[0] * x + self.slopes[1] * y + height, class, albedo: 0.2 })
    }

    fn cell_m(&self) -> f64 {
        0.02
    }
}

fn sojourner() -> Navigator {
    Navigator::Sojourner(SojournerParameters::default())
}

fn schoppers() -> Navigator {
    Navigator::Schoppers(SchoppersParameters::default())
}

fn noise() -> Counter {
    Counter::new(&mut Streams::for_seed(1, "rover").stream("noise"))
}

fn ahead(distance_m: f64) -> Start {
    Start::facing([0.0; 2], [distance_m, 0.0])
}

fn run(ground: &Made, navigator: &Navigator, start: &Start) -> Drive {
    let task = navigator.task(&RoverParameters::default());
    drive(ground, &task, navigator.policy().as_mut(), start, noise(), |_| {})
}

fn view(ground: &Made, navigator: &Navigator, pose: &Pose) -> View {
    let task = navigator.task(&RoverParameters::default());
    let body = Body::standing(ground, pose, &task.chassis).unwrap();
    task.sensor.look(ground, pose, &body, 0.0, &CycleDraws::new(noise(), 0)).unwrap()
}

fn hazards(ground: &Made, navigator: &Navigator) -> Vec<bool> {
    view(ground, navigator, &ahead(1.0).pose()).areas.iter().map(|area| area.hazard).collect()
}

/// The published values, and the effect of the residual for a rover that gives up (acceptance 17).
#[test]
fn val_efficiency() {
    for (straight_m, travelled_m, published) in [(25.0, 89.3, 0.280), (25.0, 902.5, 0.0277), (40.0, 44.9, 0.891)] {
        let e = efficiency(straight_m, travelled_m, 0.0);
        assert!((e - published).abs() < 5e-4, "{travelled_m}: {e}");
    }
    assert_eq!((efficiency(25.0, 0.0, 25.0), efficiency(25.0, 25.0, 25.0)), (1.0, 0.5));
}

/// A rover on a plane has the attitude of the plane, whatever its heading: tilt, and body axes from its quaternion.
#[test]
fn val_a_rover_has_the_attitude_of_its_plane() {
    let ground = Made { slopes: [0.2, -0.1], ..Made::flat(&[]) };
    let chassis = Chassis { axle_m: 0.25, track_m: 0.2 };
    for heading_rad in [0.0, 1.0, -2.5, PI] {
        let pose = Pose { position_m: [3.0, 4.0], heading_rad };
        let body = Body::standing(&ground, &pose, &chassis).unwrap();
        assert!((body.tilt_rad() - libm::atan(0.05_f64.sqrt())).abs() < 1e-12);
        assert!((body.height_m - (0.6 - 0.4)).abs() < 1e-12);
        let [x, y, z, w] = body.orientation(heading_rad);
        let up = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
        let normal = [-0.2, 0.1, 1.0].map(|v| v / 1.05_f64.sqrt());
        assert!(up.iter().zip(normal).all(|(a, b)| (a - b).abs() < 1e-12), "{up:?} {normal:?}");
    }
}

/// On a plane, no ray is a hazard and every ray ends where it was aimed; on a steeper plane the rover tilts too much.
#[test]
fn val_rays_hit_a_plane_where_they_are_aimed() {
    let ground = Made { slopes: [0.3, 0.1], ..Made::flat(&[]) };
    let pose = Pose { position_m: [1.0, 2.0], heading_rad: 0.7 };
    let seen = view(&ground, &sojourner(), &pose);
    assert!(!seen.has_hazard() && seen.rays.len() == 20 && seen.areas.len() == 5);
    let p = SojournerParameters::default();
    for (k, ray) in seen.rays.iter().enumerate() {
        assert!(ray.height_m.unwrap().abs() < 1e-9);
        let aim = pose.to_ground([p.nose_m + p.rows_m[k % 4], p.columns_m[k / 4]]);
        assert!((0..2).all(|a| (ray.to_m[a] - aim[a]).abs() < 1e-9), "{k}");
    }
    // A rock is a hazard at its front, wherever in its column; a drop-off at the point where the ray was aimed.
    let hazards = |ground: &Made| -> Vec<(usize, Ray)> {
        let seen = view(ground, &sojourner(), &ahead(1.0).pose());
        seen.rays.into_iter().enumerate().filter(|(_, ray)| ray.hazard).collect()
    };
    let fronts = hazards(&Made::flat(&[([0.60, 0.0], 0.1, 0.3)]));
    assert!(!fronts.is_empty());
    for (k, Ray { place_m: [ahead, left], .. }) in fronts {
        let from_axis = ((ahead - 0.6) * (ahead - 0.6) + left * left).sqrt();
        assert!((from_axis - 0.1).abs() < 0.012 && ahead < 0.6, "{k}: {ahead} {left}");
    }
    let over_the_edge = hazards(&Made::flat(&[([0.0; 2], 0.45, 5.0)]));
    assert!(over_the_edge.len() >= 15);
    for (k, ray) in over_the_edge {
        let aim = [p.nose_m + p.rows_m[k % 4], p.columns_m[k / 4]];
        assert!(ray.height_m.is_none() && (0..2).all(|a| (ray.place_m[a] - aim[a]).abs() < 1e-12), "{k}");
    }
    let steep = Made { slopes: [0.6, 0.0], ..Made::flat(&[]) };
    assert!(view(&steep, &sojourner(), &ahead(1.0).pose()).tilted);
}

/// A rock higher than the hazard height is a hazard of the columns that hit it; the hits measure its height.
#[test]
fn val_rays_see_rocks_by_their_height() {
    let rock = |height_m: f64| Made::flat(&[([0.55, 0.28], 0.1, height_m)]);
    assert_eq!(hazards(&rock(0.05), &sojourner()), [false; 5]);
    assert_eq!(hazards(&rock(0.08), &sojourner()), [true, false, false, false, false]);
    let seen = view(&rock(0.05), &sojourner(), &ahead(1.0).pose());
    let highest = seen.rays.iter().filter_map(|ray| ray.height_m).fold(0.0, f64::max);
    assert!((highest - 0.05).abs() < 0.01, "{highest}");
}

/// Where the ground drops off, rays hit nothing, which is a hazard; where it is unknown, sensing is an error.
#[test]
fn val_drop_offs_and_unknown_ground_differ() {
    let pit = Made::flat(&[([0.0; 2], 0.45, 5.0)]);
    assert_eq!(hazards(&pit, &sojourner()), [true; 5]);
    let edge = Made { known_m: 0.5, ..Made::flat(&[]) };
    let drive = run(&edge, &sojourner(), &ahead(5.0));
    assert!(matches!(drive.ending, Ending::OffGround(nowhere) if nowhere.x_m > 0.5), "{:?}", drive.ending);
    assert_eq!((drive.distance_m, drive.efficiency(), drive.counted_efficiency()), (0.0, 1.0, 0.0));
}

/// Each rule of the columns separately.
#[test]
fn val_rules_of_the_columns() {
    let Sensor::Rays(sensor) = sojourner().task(&RoverParameters::default()).sensor else { unreachable!() };
    const NONE: [usize; 0] = [];
    let flags = |sensor: &RaySensor, changes: &[(usize, Option<f64>)]| {
        let mut heights = vec![Some(0.0); 20];
        changes.iter().for_each(|(k, v)| heights[*k] = *v);
        let flags = sensor.hazards(&heights);
        let columns = flags.chunks(4).enumerate().filter(|(_, rays)| rays.contains(&true));
        columns.map(|(k, _)| k).collect::<Vec<_>>()
    };
    assert_eq!(flags(&sensor, &[]), NONE);
    // Missing, too high, too low.
    assert_eq!(flags(&sensor, &[(5, None)]), [1]);
    assert_eq!(flags(&sensor, &[(8, Some(0.066)), (9, Some(0.03))]), [2]);
    assert_eq!(flags(&sensor, &[(11, Some(-0.06))]), NONE);
    // Row to row: a step of 0.07 between heights that are each within the limit of 0.065.
    assert_eq!(flags(&sensor, &[(12, Some(0.04)), (13, Some(-0.03))]), [3]);
    // Column to column: the higher one.
    assert_eq!(flags(&sensor, &[(16, Some(0.035)), (12, Some(-0.035)), (13, Some(-0.02)), (17, Some(0.02))]), [4]);
    // Largest difference: a gentle ramp from -0.06 to 0.06 in all columns passes; 0.045 more at one end gives 0.135, with at most
    // 0.065 per row.
    let ramp = |most: f64| -> Vec<(usize, Option<f64>)> {
        (0..20)
            .map(|k| {
                (k, Some([-0.06, -0.02, 0.02, most][k % 4] + 0.001 * (k / 4) as f64 * f64::from(u8::from(k % 4 == 3))))
            })
            .collect()
    };
    assert_eq!(flags(&sensor, &ramp(0.06)), NONE);
    let wide = RaySensor { span_m: 0.11, ..sensor };
    assert_eq!(flags(&wide, &ramp(0.06)), [4]);
}

/// Rectangles: a rock above the clearance makes its rectangle unsafe, at any tilt of the ground; a lower rock makes none unsafe;
/// steep sand makes all unsafe.
#[test]
fn val_rectangles_see_rocks_above_the_sand() {
    let at = |slopes: [f64; 2], height_m: f64| Made { slopes, ..Made::flat(&[([0.9, 0.7], 0.15, height_m)]) };
    for slopes in [[0.0, 0.0], [0.3, -0.2]] {
        assert_eq!(hazards(&at(slopes, 0.10), &schoppers()), [false; 4]);
        assert_eq!(hazards(&at(slopes, 0.16), &schoppers()), [true, false, false, false]);
    }
    assert_eq!(hazards(&at([0.5, 0.0], 0.0), &schoppers()), [true; 4]);
}

/// Without obstacles a rover drives straight: its path length is the distance minus the tolerance, to within a step.
#[test]
fn val_free_ground_is_crossed_straight() {
    for navigator in [sojourner(), schoppers()] {
        let drive = run(&Made::flat(&[]), &navigator, &ahead(25.0));
        assert!(drive.reached() && (drive.distance_m - 24.5).abs() <= 0.1, "{drive:?}");
        assert!(drive.efficiency() > 0.999 && drive.contacts.anywhere == 0);
        // At 0.01 m/s, with no turn for a rover that faces its goal.
        assert!(drive.turned_rad < 1e-9 && (drive.time_s / (100.0 * drive.distance_m) - 1.0).abs() < 1e-6, "{drive:?}");
        assert_eq!((drive.hazards, drive.reversals, drive.tilt_max_rad), (0, 0, 0.0));
        assert!((drive.straight_m - 25.0).abs() < 1e-12 && (drive.residual_m - (25.0 - drive.distance_m)).abs() < 1e-9);
    }
}

/// Both navigators turn away from a rock in the way and arrive; neither drives over it.
#[test]
fn val_rocks_are_passed() {
    let ground = Made::flat(&[([5.0, 0.1], 0.4, 0.5), ([10.0, -0.2], 0.3, 0.3), ([15.0, 0.0], 0.6, 1.0)]);
    for navigator in [sojourner(), schoppers()] {
        let drive = run(&ground, &navigator, &ahead(20.0));
        assert!(drive.reached() && drive.contacts.anywhere == 0, "{drive:?}");
        assert!(drive.hazards > 0 && drive.efficiency() > 0.7);
    }
}

/// Enclosed by a ring of rocks, a rover continues to its limits and does not count as arrived.
#[test]
fn val_an_enclosed_rover_gives_up() {
    let ring: Vec<Rock> = (0..60)
        .map(|k| {
            let (sin, cos) = libm::sincos(TAU * f64::from(k) / 60.0);
            ([3.0 * cos, 3.0 * sin], 0.3, 0.5)
        })
        .collect();
    let ground = Made::flat(&ring);
    for (navigator, name) in [
        (Navigator::Sojourner(SojournerParameters { distance_limit_m: 100.0, ..Default::default() }), "distance_limit"),
        (Navigator::Schoppers(SchoppersParameters { cycle_limit: 2000, ..Default::default() }), "cycle_limit"),
    ] {
        let drive = run(&ground, &navigator, &ahead(20.0));
        assert_eq!(drive.ending.name(), name);
        assert!(drive.efficiency() < 0.7 && drive.reversals + drive.hazards > 0, "{drive:?}");
        assert!(drive.residual_m > 16.0);
    }
}

/// A rock that comes under the rover counts once; a rock lower than the clearance does not count.
#[test]
fn val_contacts_are_counted_once() {
    let ground = Made::flat(&[([5.0, 0.0], 0.1, 0.2), ([8.0, 0.15], 0.1, 0.2), ([11.0, 0.0], 0.1, 0.1)]);
    let blind =
        Navigator::Sojourner(SojournerParameters { hazard_step_m: 9.0, hazard_span_m: 9.0, ..Default::default() });
    let drive = run(&ground, &blind, &ahead(15.0));
    assert!(drive.reached());
    assert_eq!((drive.contacts.anywhere, drive.contacts.on_centre_line), (2, 1));
}

/// The order of draws does not matter: a draw is identified by cycle and purpose. One more turn does not reshuffle the others.
#[test]
fn prop_draws_are_keyed_by_cycle_and_purpose() {
    use super::draws::Purpose;
    let a = CycleDraws::new(noise().at(3), 17);
    let first = a.normal(Purpose::Turn);
    let _ = (a.normal(Purpose::Slip), a.normal_of(Purpose::Height, 9));
    assert_eq!(first, CycleDraws::new(noise().at(3), 17).normal(Purpose::Turn));
    assert_ne!(first, CycleDraws::new(noise().at(4), 17).normal(Purpose::Turn));
    assert_ne!(first, a.normal(Purpose::Heading));
}

/// Starts are drawn again until they and their goals are on known ground; the other starts are unchanged, and if there is no ground
/// at all, drawing stops.
#[test]
fn prop_starts_are_drawn_on_the_ground() {
    let trial = RoverParameters {
        rovers: 50,
        starts: parameters::Starts::Drawn,
        radius_m: 5.0,
        distance_m: 2.0,
        ..Default::default()
    };
    let streams = Streams::for_seed(3, "rover");
    let east = |[x, _]: [f64; 2]| x > 0.0;
    let (anywhere, kept) = (trial.starts(&streams, |_| true), trial.starts(&streams, east));
    assert!(kept.iter().all(|s| east(s.start_m) && east(s.goal_m)));
    let had_ground = |s: &Start| east(s.start_m) && east(s.goal_m);
    assert!(anywhere.iter().zip(&kept).all(|(first, kept)| had_ground(first) == (first == kept)));
    assert!((5..45).contains(&anywhere.iter().filter(|s| had_ground(s)).count()));
    assert_eq!(trial.starts(&streams, |_| false).len(), 50);
}

/// The obstacle map blocks exactly the cells with a centre within the margin of a rock above the limit, on slopes and on level
/// ground, as a brute-force reference does: every sample against every cell. Steep sand and unknown ground are blocked completely.
#[test]
fn val_obstacles_are_mapped() {
    use super::contacts::sand_plane;
    use super::obstacles::{ObstacleLimits, block_rows, blocked, map_geometry};
    let limits = |margin_m: f64| ObstacleLimits { height_m: 0.13, slope_max: 0.4, margin_m };
    let map = map_geometry([-1.0, -1.0, 1.3, 1.0]);
    assert_eq!((map.rows, map.cols, map.origin), (20, 25, [-1.0, -1.0]));
    let of = |ground: &Made, margin_m: f64| -> Vec<bool> {
        let mut cells = vec![false; map.len()];
        for row in 0..block_rows(&map) {
            blocked(ground, &map, row, &limits(margin_m)).into_iter().for_each(|cell| cells[cell] = true);
        }
        cells
    };
    for (slopes, margin_m) in [([0.0, 0.0], 0.0), ([0.2, -0.3], 0.0), ([0.0, 0.0], 0.2), ([0.2, -0.3], 0.33)] {
        let ground = Made { slopes, ..Made::flat(&[([0.31, -0.42], 0.151, 0.2), ([-0.6, 0.6], 0.151, 0.1)]) };
        let mut expected = vec![false; map.len()];
        for k in 0..125 * 100 {
            let at = [-1.0 + 0.02 * (f64::from(k % 125) + 0.5), -1.0 + 0.02 * (f64::from(k / 125) + 0.5)];
            let middle = at.map(|v| 0.5 * (2.0 * v).floor() + 0.25);
            let above_m = {
                let sand = sand_plane(&ground, middle).unwrap();
                ground.at(at[0], at[1]).unwrap().height_m - sand.height_m([at[0] - middle[0], at[1] - middle[1]])
            };
            if ground.at(at[0], at[1]).unwrap().class != GroundClass::Rock || above_m <= 0.13 {
                continue;
            }
            for (cell, expected) in expected.iter_mut().enumerate() {
                let [x, y] = [map.x(cell % map.cols) - at[0], map.y(cell / map.cols) - at[1]];
                *expected |= x * x + y * y <= margin_m * margin_m || x.abs().max(y.abs()) < 0.05;
            }
        }
        assert_eq!(of(&ground, margin_m), expected, "{slopes:?} {margin_m}");
        assert!(expected.iter().any(|blocked| *blocked) && !expected.iter().all(|blocked| *blocked));
    }
    let steep = Made { slopes: [0.5, 0.0], ..Made::flat(&[]) };
    let unknown = Made { known_m: 0.5, ..Made::flat(&[]) };
    for margin_m in [0.0, 0.2] {
        assert!(of(&steep, margin_m).into_iter().all(|blocked| blocked));
        assert!(of(&unknown, margin_m).into_iter().all(|blocked| blocked));
    }
}

/// Slip shortens drives; a rover that navigates by dead reckoning then stops short of the goal, lost.
#[test]
fn val_slip_goes_unnoticed_by_dead_reckoning() {
    let trial = |dead_reckoning: bool| RoverParameters {
        noise: NoiseParameters { slip: 0.1, dead_reckoning, ..Default::default() },
        ..Default::default()
    };
    let run = |p: &RoverParameters| {
        let navigator = sojourner();
        drive(&Made::flat(&[]), &navigator.task(p), navigator.policy().as_mut(), &ahead(25.0), noise(), |_| {})
    };
    let (knowing, reckoning) = (run(&trial(false)), run(&trial(true)));
    assert!(knowing.reached());
    assert_eq!(reckoning.ending, Ending::Lost);
    assert!((reckoning.distance_m - 0.9 * 24.5).abs() < 0.1, "{reckoning:?}");
}

/// Each noise option changes its own quantity and nothing else: turn, drive, heading after the drive, heights. Only dead reckoning
/// makes the believed pose differ from the true pose.
#[test]
fn val_each_noise_has_its_own_effect() {
    use super::draws::Purpose;
    use super::motion::Poses;
    let pose = Pose { position_m: [1.0, 2.0], heading_rad: 0.3 };
    let command = Command { turn_rad: 0.2, drive_m: 0.1, stop: None };
    let draws = CycleDraws::new(noise(), 5);
    let after = |options: NoiseParameters| {
        let mut poses = Poses { real: pose, believed: pose };
        let moved = poses.carry_out(&command, &options, &draws);
        (poses, moved)
    };
    let none = NoiseParameters::default();
    let (exact, moved) = after(none);
    assert_eq!((moved.turn_rad, moved.drive_m, exact.believed), (0.2, 0.1, exact.real));
    let (slipped, moved) = after(NoiseParameters { slip: 0.25, ..none });
    assert_eq!((moved.turn_rad, slipped.real.heading_rad), (0.2, exact.real.heading_rad));
    assert!((moved.drive_m - 0.075).abs() < 1e-15 && slipped.believed == slipped.real);
    let (scattered, moved) = after(NoiseParameters { slip: 0.25, slip_deviation: 0.1, ..none });
    assert!(moved.turn_rad == 0.2 && scattered.real.heading_rad == exact.real.heading_rad);
    let slip = (0.25 + 0.1 * draws.normal(Purpose::Slip)).clamp(0.0, 1.0);
    assert!((moved.drive_m - 0.1 * (1.0 - slip)).abs() < 1e-15 && moved.drive_m != 0.075, "{moved:?} {slip}");
    let (_, moved) = after(NoiseParameters { turn: 0.1, ..none });
    assert!((moved.turn_rad - 0.2 * (1.0 + 0.1 * draws.normal(Purpose::Heading))).abs() < 1e-15, "{moved:?}");
    assert!(moved.turn_rad != 0.2 && moved.drive_m == 0.1, "{moved:?}");
    let (drifted, moved) = after(NoiseParameters { drift_rad: 0.1, ..none });
    assert_eq!((moved.turn_rad, moved.drive_m, drifted.real.position_m), (0.2, 0.1, exact.real.position_m));
    // The drift over 0.1 m is that over 1 m times the square root of 0.1.
    let drift_rad = drifted.real.heading_rad - exact.real.heading_rad;
    assert!((drift_rad - 0.1 * 0.1f64.sqrt() * draws.normal(Purpose::Drift)).abs() < 1e-12 && drift_rad != 0.0);
    let all = NoiseParameters { slip: 0.25, turn: 0.1, drift_rad: 0.1, dead_reckoning: true, ..none };
    let (reckoned, _) = after(all);
    assert!(reckoned.believed == exact.real && reckoned.real != exact.real);
    // The draws are independent: with another option enabled as well, the turn error is the same.
    let (_, alone) = after(NoiseParameters { turn: 0.1, ..none });
    let (_, beside) = after(NoiseParameters { turn: 0.1, slip: 0.3, slip_deviation: 0.2, drift_rad: 0.1, ..none });
    assert_eq!(alone.turn_rad, beside.turn_rad);
    // Heights: the sensed values change; the places where they are sensed and the attitude of the rover do not.
    let ground = Made::flat(&[]);
    for navigator in [sojourner(), schoppers()] {
        let task = navigator.task(&RoverParameters::default());
        let body = Body::standing(&ground, &pose, &task.chassis).unwrap();
        let [plain, noisy] = [0.0, 0.3].map(|m| task.sensor.look(&ground, &pose, &body, m, &draws).unwrap());
        assert!(plain.areas.iter().zip(&noisy.areas).all(|(a, b)| a.corners_m == b.corners_m));
        for (k, (exact, ray)) in plain.rays.iter().zip(&noisy.rays).enumerate() {
            let error_m = ray.height_m.unwrap() - exact.height_m.unwrap();
            assert!((error_m - 0.3 * draws.normal_of(Purpose::Height, k)).abs() < 1e-12, "{k}: {error_m}");
            assert!(exact.from_m == ray.from_m && error_m != 0.0);
        }
        assert_eq!(plain.rays.len(), if matches!(navigator, Navigator::Sojourner(_)) { 20 } else { 0 });
        assert!(!plain.has_hazard() && plain.tilted == noisy.tilted);
    }
}

/// Censoring: the efficiency at half of the limit equals that of the same rover with half the limit, to within a step.
#[test]
fn val_efficiency_at_half_the_limit() {
    let ring: Vec<Rock> = (0..60)
        .map(|k| {
            let (sin, cos) = libm::sincos(TAU * f64::from(k) / 60.0);
            ([3.0 * cos, 3.0 * sin], 0.3, 0.5)
        })
        .collect();
    let limited = |distance_limit_m: f64| {
        let navigator = Navigator::Sojourner(SojournerParameters { distance_limit_m, ..Default::default() });
        run(&Made::flat(&ring), &navigator, &ahead(20.0))
    };
    let (whole, half) = (limited(60.0), limited(30.0));
    assert_eq!([whole.ending, half.ending], [Ending::DistanceLimit; 2]);
    assert!((whole.efficiency_at_half(60.0) - half.efficiency()).abs() < 0.065 / 45.0);
    assert!(whole.efficiency_at_half(60.0) > whole.efficiency() + 0.1);
}

/// Eight random heights are not mistaken for quantised ones: each of the six gaps beyond the smallest is near a whole step with a
/// probability of 4 %, so one of 20 000 sets is with a probability of 1e-4. Nor are the heights of seven boxes on level ground.
#[test]
fn stat_few_heights_are_not_quantised() {
    use super::quantised::height_step_m;
    let mut stream = Streams::for_seed(5, "heights").stream("heights");
    let stepped = (0..20_000).filter(|_| {
        let mut heights_m = [0.0_f32; 8];
        heights_m[1..].iter_mut().for_each(|z| *z = stream.uniform_in(0.02, 0.6) as f32);
        height_step_m(&heights_m).is_some()
    });
    assert_eq!(stepped.count(), 0);
    assert_eq!(height_step_m(&[0.0, 0.2, 0.202, 0.332, 0.374, 0.402, 0.595, 0.597]), None);
}

/// Quantised heights are distinguished from others, whatever their offset: those of a 16-bit image over 4 km, of whole millimetres,
/// of a float raster; terraces of a few heights count as ground.
#[test]
fn val_quantised_heights_are_detected() {
    use super::quantised::height_step_m;
    let mut stream = Streams::for_seed(2, "heights").stream("heights");
    let drawn: Vec<f64> = (0..4000).map(|_| stream.uniform_in(-700.0, 3300.0)).collect();
    let in_steps = |step_m: f64, offset_m: f64| -> Vec<f32> {
        drawn.iter().map(|z| (offset_m + step_m * (z / step_m).round()) as f32).collect()
    };
    for (step_m, offset_m) in [(4000.0 / 65535.0, 0.0), (4000.0 / 65535.0, 12.345), (1.0, 0.0)] {
        let found = height_step_m(&in_steps(step_m, offset_m)).unwrap();
        assert!(
            (found / step_m - (found / step_m).round()).abs() < 0.02 && found >= 0.98 * step_m,
            "{step_m}: {found}"
        );
    }
    assert_eq!(height_step_m(&drawn.iter().map(|z| *z as f32).collect::<Vec<_>>()), None);
    // 29 levels of low relief, one of them missing; and a few terraces.
    let few: Vec<f32> = (0..30).filter(|k| *k != 7).map(|k| (0.061 * f64::from(k)) as f32).collect();
    assert!((height_step_m(&few).unwrap() - 0.061).abs() < 1e-6);
    assert_eq!(height_step_m(&[0.0, 0.5, 1.0, 1.5].repeat(100)), None);
    assert_eq!(height_step_m(&[]), None);
}

/// A recording holds all events with their values; its states are those from which the metrics are computed.
#[test]
fn val_recordings_hold_every_cycle() {
    use sastrugi_schemas::topics::{RoverCycle, RoverEventKind as Kind};
    let ground = Made::flat(&[([3.0, 0.05], 0.3, 0.4), ([7.0, 0.0], 0.1, 0.14)]);
    let recorded = |navigator: &Navigator, start: &Start| {
        let task = navigator.task(&RoverParameters::default());
        let (mut recorder, mut track) = (Recorder::new(&task), Track::new(&ground, &task, 1.0));
        let drive = drive(&ground, &task, navigator.policy().as_mut(), start, noise(), |cycle| {
            track.add(cycle);
            recorder.add(cycle, start.goal_m);
        });
        (drive, recorder.finish(&drive, track.finish().states, None))
    };
    let blind =
        Navigator::Sojourner(SojournerParameters { hazard_step_m: 9.0, hazard_span_m: 9.0, ..Default::default() });
    for (navigator, meets_rocks) in [(sojourner(), false), (schoppers(), false), (blind, true)] {
        let (drive, recording) = recorded(&navigator, &ahead(10.0));
        assert_eq!(recording.cycles.len(), drive.cycles as usize + 1, "the last cycle stops");
        let count = |kind: Kind| recording.events.iter().filter(|event| event.kind == kind).count();
        let contacts = drive.contacts.anywhere as usize;
        assert_eq!([count(Kind::Start), count(Kind::Reached), count(Kind::Contact)], [1, 1, contacts]);
        assert_eq!(contacts > 0, meets_rocks);
        assert!(meets_rocks || count(Kind::Hazard) > 0);
        let turns: Vec<_> = recording.events.iter().filter(|event| event.kind == Kind::Turn).collect();
        assert!(meets_rocks || !turns.is_empty());
        for event in turns {
            let here = |cycle: &&RoverCycle| cycle.time_s == event.time_s && cycle.moved[0] != 0.0;
            let cycle = recording.cycles.iter().find(here).unwrap();
            let words = if cycle.moved[0] > 0.0 { "turns left: " } else { "turns right: " };
            assert!(event.text.starts_with(words), "{}, {:?}", event.text, cycle.moved);
        }
        let lasted_s: f64 = recording.cycles.iter().flat_map(|cycle| cycle.durations_s).sum();
        assert!((lasted_s / drive.time_s - 1.0).abs() < 1e-9, "{lasted_s} {}", drive.time_s);
        let end = recording.cycles.last().unwrap();
        assert!((end.goal_distance_m - drive.residual_m).abs() < 1e-12 && end.moved == [0.0; 2]);
        assert!(recording.events.is_sorted_by(|a, b| a.time_s <= b.time_s));
        let last = recording.states.last().unwrap();
        assert!((last.time_s - drive.time_s).abs() <= 1.0 && drive.time_s >= last.time_s);
        // Except during turns, speeds integrate from state to state.
        let driven: f64 = recording.states.iter().map(|s| libm::hypot(s.velocity_m_s[0], s.velocity_m_s[1])).sum();
        assert!((driven - drive.distance_m).abs() < 0.05 * drive.distance_m, "{driven} {}", drive.distance_m);
        assert_eq!(recording.cycles[0].areas.len(), if matches!(navigator, Navigator::Schoppers(_)) { 4 } else { 5 });
        assert!(recording.plans.is_empty());
    }
}

/// Starts lie on the circle at equal angles, and a larger number of rovers leaves the earlier headings unchanged.
#[test]
fn val_starts_on_the_circle() {
    let streams = Streams::for_seed(3, "rover");
    let starts = on_circle(4, [1.0, 2.0], 25.0, Facing::Goal, &streams);
    let expected = [[26.0, 2.0], [1.0, 27.0], [-24.0, 2.0], [1.0, -23.0]];
    for (start, [x, y]) in starts.iter().zip(expected) {
        assert!((start.start_m[0] - x).abs() < 1e-12 && (start.start_m[1] - y).abs() < 1e-12);
        assert!(start.pose().bearing_error_rad([1.0, 2.0]).abs() < 1e-12);
    }
    assert!((starts[1].heading_rad + FRAC_PI_2).abs() < 1e-12);
    let [few, many] = [10, 20].map(|count| on_circle(count, [0.0; 2], 5.0, Facing::Drawn, &streams));
    assert!((0..10).all(|k| few[k].heading_rad == many[k].heading_rad));
}

/// A straight drive of 5.525 m in steps of 65 mm at 0.01 m/s: a pose every second, 10 mm apart, and a sample at the first step after
/// every metre, 16 steps or 1.04 m apart.
#[test]
fn val_tracks_are_sampled_by_time_and_by_distance() {
    let (ground, navigator, start) = (Made::flat(&[]), sojourner(), ahead(6.0));
    let task = navigator.task(&RoverParameters::default());
    let mut track = Track::new(&ground, &task, 1.0);
    let drive = drive(&ground, &task, navigator.policy().as_mut(), &start, noise(), |cycle| track.add(cycle));
    let tracked = track.finish();
    assert!((drive.distance_m - 5.525).abs() < 1e-9 && (drive.time_s - 552.5).abs() < 1e-6, "{drive:?}");
    assert_eq!(tracked.states.len(), 553);
    for (k, state) in tracked.states.iter().enumerate() {
        let [x, y, _] = state.position_m;
        assert!((state.time_s - k as f64).abs() < 1e-9, "{k}: {state:?}");
        assert!((x - 0.01 * k as f64).abs() < 1e-9 && y.abs() < 1e-9, "{k}: {state:?}");
    }
    assert!((tracked.metrics.path_length_m - 5.52).abs() < 1e-9);
    let distances: Vec<f64> = tracked.samples.iter().map(|sample| sample.distance_m).collect();
    assert_eq!(distances.len(), 6, "{distances:?}");
    assert!(distances.iter().enumerate().all(|(k, at)| (at - 1.04 * k as f64).abs() < 1e-9), "{distances:?}");
    assert!(tracked.samples.iter().all(|s| (s.x_m - s.distance_m).abs() < 1e-9 && s.heading_deg == 0.0));
}

/// A view of level ground in which these areas, from left to right, are hazards.
fn marked(navigator: &Navigator, hazards: &[bool]) -> View {
    let mut seen = view(&Made::flat(&[]), navigator, &ahead(1.0).pose());
    assert_eq!(seen.areas.len(), hazards.len());
    seen.areas.iter_mut().zip(hazards).for_each(|(area, hazard)| area.hazard = *hazard);
    seen
}

/// The command of a rover at the origin with its goal 20 m east.
fn decided(policy: &mut dyn Policy, view: &View, heading_rad: f64) -> Command {
    let pose = Pose { position_m: [0.0; 2], heading_rad };
    policy.decide(&Situation { pose, goal_m: [20.0, 0.0], view, draws: CycleDraws::new(noise(), 0) })
}

/// The Sojourner-like navigator: away from a hazard on one side, towards the goal at hazards on both sides; after a full turn (here five
/// turns of 80 deg) back by a step, then the other way; past a hazard 0.5 m straight on, in 8 steps of 65 mm; then to the goal.
#[test]
fn val_a_sojourner_turns_away_and_back() {
    let quiet = SojournerParameters { turn_noise_rad: 0.0, turn_deg: 80.0, ..Default::default() };
    let navigator = Navigator::Sojourner(quiet);
    let new = || navigator.policy();
    let turn_rad = 80f64.to_radians();
    let of = |hazards: &[usize]| marked(&navigator, &[0, 1, 2, 3, 4].map(|k| hazards.contains(&k)));
    let (left, right, both, clear) = (of(&[0, 1]), of(&[3]), of(&[0, 4]), of(&[]));
    assert_eq!(decided(new().as_mut(), &left, 0.0), Command::turn(-turn_rad));
    assert_eq!(decided(new().as_mut(), &right, 0.0), Command::turn(turn_rad));
    // The goal lies to the right of a rover that faces 1 rad north of it.
    assert_eq!(decided(new().as_mut(), &both, 1.0), Command::turn(-turn_rad));
    assert_eq!(decided(new().as_mut(), &both, -1.0), Command::turn(turn_rad));
    let mut rover = new();
    for _ in 0..5 {
        assert_eq!(decided(rover.as_mut(), &left, 0.0), Command::turn(-turn_rad));
    }
    assert_eq!((decided(rover.as_mut(), &left, 0.0), rover.state()), (Command::drive(-0.065), "back up"));
    assert_eq!(decided(rover.as_mut(), &left, 0.0), Command::turn(turn_rad));
    for _ in 0..8 {
        assert_eq!((decided(rover.as_mut(), &clear, 1.0), rover.state()), (Command::drive(0.065), "pass"));
    }
    // More than one turn away: first turn, then look again.
    assert_eq!(decided(rover.as_mut(), &clear, 2.0), Command::turn(-turn_rad));
    assert_eq!(decided(rover.as_mut(), &clear, 1.0), Command { turn_rad: -1.0, drive_m: 0.065, stop: None });
    assert_eq!(decided(rover.as_mut(), &clear, 0.1), Command::drive(0.065));
    let at_goal = Pose { position_m: [19.6, 0.2], heading_rad: 0.0 };
    let arrived = Situation { pose: at_goal, goal_m: [20.0, 0.0], view: &left, draws: CycleDraws::new(noise(), 0) };
    assert_eq!(rover.decide(&arrived), Command::stop(Stop::AtGoal));
}

/// The Schoppers-like navigator: to the side with more safe rectangles; committed for 0.55 m, in 6 steps of 0.1 m; then a tentative turn
/// to the goal, which it takes back if the way there is not free. After a full turn it backs up, and its commitment grows by half, to
/// 0.825 m in 9 steps.
#[test]
fn val_a_schoppers_commits_itself() {
    let rules = SchoppersParameters { commit_m: 0.55, turn_deg: 80.0, ..Default::default() };
    let navigator = Navigator::Schoppers(rules);
    let turn_rad = 80f64.to_radians();
    let of = |hazards: &[usize]| marked(&navigator, &[0, 1, 2, 3].map(|k| hazards.contains(&k)));
    let (clear, left_free, right_free, none) = (of(&[]), of(&[1, 2, 3]), of(&[0, 1]), of(&[0, 1, 2, 3]));
    let new = || navigator.policy();
    assert_eq!(decided(new().as_mut(), &left_free, 0.5), Command::turn(turn_rad));
    assert_eq!(decided(new().as_mut(), &right_free, -0.5), Command::turn(-turn_rad));
    // Nowhere is free: to the side of the goal.
    assert_eq!(decided(new().as_mut(), &none, 0.5), Command::turn(-turn_rad));
    let passes = |rover: &mut dyn Policy, steps: u32| {
        for step in 0..steps {
            assert_eq!((decided(rover, &clear, 2.0), rover.state()), (Command::drive(0.1), "pass"), "{step}");
        }
    };
    let mut rover = new();
    decided(rover.as_mut(), &left_free, 0.0);
    passes(rover.as_mut(), 6);
    // Free again: a turn to the goal, limited to one turn, and a step if the way there is free, or back if it is not.
    assert_eq!((decided(rover.as_mut(), &clear, 2.0), rover.state()), (Command::turn(-turn_rad), "turn to goal"));
    assert_eq!(decided(rover.as_mut(), &clear, 0.6), Command::drive(0.1));
    assert_eq!(decided(rover.as_mut(), &clear, 0.6), Command::turn(-0.6));
    let back = Command { turn_rad: 0.6, drive_m: 0.1, stop: None };
    assert_eq!((decided(rover.as_mut(), &none, 0.0), rover.state()), (back, "turn back"));
    // With the outer rectangle on the side of the goal unsafe, it drives on.
    assert_eq!((decided(rover.as_mut(), &of(&[3]), 0.6), rover.state()), (Command::drive(0.1), "drive"));
    let mut rover = new();
    for _ in 0..5 {
        assert_eq!(decided(rover.as_mut(), &left_free, 0.0), Command::turn(turn_rad));
    }
    assert_eq!((decided(rover.as_mut(), &left_free, 0.0), rover.state()), (Command::drive(-0.1), "back up"));
    assert_eq!(decided(rover.as_mut(), &left_free, 0.0), Command::turn(-turn_rad));
    passes(rover.as_mut(), 9);
    assert_eq!(decided(rover.as_mut(), &clear, 2.0), Command::turn(-turn_rad));
}

/// A scale of 2 doubles body, sensor and steps; heights of hazards, clearance, tolerance and limits stay.
#[test]
fn val_a_scale_applies_to_lengths_alone() {
    let trial = RoverParameters::default();
    let twice = Navigator::Sojourner(SojournerParameters { scale: 2.0, ..Default::default() }).task(&trial);
    assert_eq!((twice.chassis.axle_m, twice.chassis.track_m), (0.5, 0.4));
    assert_eq!((twice.clearance_m, twice.goal_tolerance_m, twice.distance_limit_m), (0.13, 0.5, 1500.0));
    let Sensor::Rays(rays) = twice.sensor else { panic!("a Sojourner has rays") };
    assert_eq!((rays.nose_m, rays.height_m, rays.step_m, rays.span_m), (0.64, 0.5, 0.065, 0.13));
    assert_eq!((rays.columns_m, rays.rows_m), (vec![0.6, 0.3, 0.0, -0.3, -0.6], vec![0.2, 0.4, 0.6, 0.9]));
    let twice = Navigator::Schoppers(SchoppersParameters { scale: 2.0, ..Default::default() }).task(&trial);
    let Sensor::Rectangles(sensor) = twice.sensor else { panic!("a Schoppers has rectangles") };
    assert_eq!((sensor.near_m, sensor.length_m, sensor.width_m, sensor.count), (0.6, 2.0, 4.0, 4));
    assert!((sensor.slope_max - 0.466_308).abs() < 1e-6 && sensor.clearance_m == 0.13);
    assert!((twice.turn_rate_rad_s - 7f64.to_radians()).abs() < 1e-15 && twice.speed_m_s == 0.01);
}

/// The plane through sand points is exact on a plane, alone or from two sets; fewer than ten points or points on a line give none.
#[test]
fn val_sand_planes_are_exact_on_a_plane() {
    use super::sand::PlaneSums;
    let sums = |from: u32, to: u32, at: fn(u32) -> [f64; 2]| {
        let mut sums = PlaneSums::default();
        (from..to).map(at).for_each(|[x, y]| sums.add([x, y], 2.0 + 0.3 * x - 0.2 * y));
        sums
    };
    let scattered: fn(u32) -> [f64; 2] = |k| [f64::from(k % 4), f64::from(k * k % 7)];
    for plane in [sums(0, 20, scattered).plane(), sums(0, 8, scattered).plus(&sums(8, 20, scattered)).plane()] {
        let plane = plane.unwrap();
        assert!((plane.level_m - 2.0).abs() < 1e-12, "{plane:?}");
        assert!((plane.slopes[0] - 0.3).abs() < 1e-12 && (plane.slopes[1] + 0.2).abs() < 1e-12, "{plane:?}");
        assert!((plane.height_m([5.0, 10.0]) - 1.5).abs() < 1e-12);
    }
    assert_eq!(sums(0, 9, scattered).plane(), None);
    assert!(sums(0, 10, scattered).plane().is_some());
    assert_eq!(sums(0, 20, |k| [f64::from(k), 2.0 * f64::from(k)]).plane(), None);
}

/// Null: starts are uniform in the disk of radius R, goals in all directions from them. n = 5000; mean squared distance R^2 / 2 (variance
/// R^4 / 12), mean offset 0 (variance R^2 / 4 per axis) and mean direction 0 (variance 1/2) within 5 standard errors (false alarm 6e-7
/// each). A distance uniform in [0, R) would give R^2 / 3, 40 standard errors off.
#[test]
fn stat_drawn_starts_are_uniform_in_the_disk() {
    use super::starts::{Disk, drawn};
    let disk = Disk { centre_m: [3.0, -2.0], radius_m: 5.0, distance_m: 2.0 };
    let starts = drawn(5000, &disk, Facing::Goal, &Streams::for_seed(4, "rover"), |_| true);
    let offsets: Vec<[f64; 2]> = starts.iter().map(|s| [s.start_m[0] - 3.0, s.start_m[1] + 2.0]).collect();
    let mean = |f: &dyn Fn(usize) -> f64| (0..5000).map(f).sum::<f64>() / 5000.0;
    let five_se = |variance: f64| 5.0 * (variance / 5000.0f64).sqrt();
    let squared = |k: usize| offsets[k][0] * offsets[k][0] + offsets[k][1] * offsets[k][1];
    assert!((0..5000).all(|k| squared(k) <= 25.0 * (1.0 + 1e-12)));
    assert!((mean(&squared) - 12.5).abs() < five_se(625.0 / 12.0), "{}", mean(&squared));
    for axis in [0, 1] {
        assert!(mean(&|k| offsets[k][axis]).abs() < five_se(25.0 / 4.0), "{axis}");
        let towards = |k: usize| 0.5 * (starts[k].goal_m[axis] - starts[k].start_m[axis]);
        assert!(mean(&towards).abs() < five_se(0.5), "{axis}");
    }
    assert!(starts.iter().all(|s| (s.pose().distance_m(s.goal_m) - 2.0).abs() < 1e-12));
    assert!(starts.iter().all(|s| s.pose().bearing_error_rad(s.goal_m).abs() < 1e-12));
}

/// The ground around a path: a metre beyond its ends, on the ground's own cells, or on cells coarser by a power of two if these are too
/// many; unknown ground has neither height nor class.
#[test]
fn val_surroundings_cover_the_path() {
    use sastrugi_schemas::topics::RoverRecording;
    let ground = Made { slopes: [0.5, 0.0], known_m: 2.5, ..Made::flat(&[([1.0, 0.5], 0.2, 0.3)]) };
    let around = Surroundings::of(&ground, &RoverRecording::default(), [[0.005, 0.005], [2.005, 1.005]]);
    let g = around.heights.geometry;
    assert_eq!(g.cell, [0.02; 2]);
    let (east, north) = (g.origin[0] + g.size()[0], g.origin[1] + g.size()[1]);
    for (low, high, [from, to]) in [(g.origin[0], east, [-0.995, 3.005]), (g.origin[1], north, [-0.995, 2.005])] {
        assert!(low <= from && low > from - 0.021 && high >= to - 1e-9 && high < to + 0.021, "{low} {high}");
    }
    let at = |x: f64, y: f64| {
        let (row, col) = g.cell_at(x, y).unwrap();
        (around.heights.at(row, col), around.classes.at(row, col))
    };
    let (height_m, class) = at(2.0, 1.0);
    assert!((height_m - 1.0).abs() < 0.006 && class == Some(GroundClass::Sand), "{height_m}");
    assert_eq!(at(1.0, 0.5).1, Some(GroundClass::Rock));
    let (height_m, class) = at(2.9, 0.0);
    assert!(height_m.is_nan() && class.is_none());
    let wide = Surroundings::of(&ground, &RoverRecording::default(), [[0.0, 0.0], [100.0, 100.0]]);
    assert!((wide.heights.geometry.cell[0] - 0.32).abs() < 1e-12, "102 m in at most 512 cells");
}

/// The message names the invalid parameter and its value (section 8).
#[test]
fn val_wrong_numbers_are_refused() {
    let said = |result: Result<(), sastrugi_schemas::ParameterError>| result.unwrap_err().to_string();
    let trial = RoverParameters::default;
    for (parameters, words) in [
        (RoverParameters { rovers: 0, ..trial() }, "`rovers` is 0"),
        (RoverParameters { radius_m: 0.0, ..trial() }, "`radius_m` is 0"),
        (RoverParameters { distance_m: f64::NAN, ..trial() }, "`distance_m` is NaN"),
        (RoverParameters { centre_m: [0.0, f64::INFINITY], ..trial() }, "`centre_m` holds inf"),
        (
            RoverParameters { noise: NoiseParameters { slip: 1.0, ..Default::default() }, ..trial() },
            "`noise.slip` is 1",
        ),
    ] {
        assert!(said(parameters.check()).contains(words), "{}", said(parameters.check()));
    }
    let p = SojournerParameters::default;
    for (parameters, words) in [
        (SojournerParameters { columns_m: vec![], ..p() }, "`columns_m` must hold 1 to 64"),
        (SojournerParameters { columns_m: vec![0.0, 0.1], ..p() }, "numbers in decreasing order"),
        (SojournerParameters { rows_m: vec![0.2, 0.1], ..p() }, "numbers in increasing order"),
        (SojournerParameters { rows_m: vec![-0.2, 0.1], ..p() }, "`rows_m.0` is -0.2"),
        (SojournerParameters { turn_deg: 0.0, ..p() }, "`turn_deg` is 0"),
        (SojournerParameters { cycle_limit: 0, ..p() }, "`cycle_limit` is 0"),
        (SojournerParameters { step_m: -1.0, ..p() }, "`step_m` is -1"),
    ] {
        assert!(said(parameters.check()).contains(words), "{}", said(parameters.check()));
    }
    let p = SchoppersParameters::default;
    assert!(said(SchoppersParameters { rectangles: 1, ..p() }.check()).contains("`rectangles` is 1"));
    assert!(said(SchoppersParameters { commit_growth: 0.5, ..p() }.check()).contains("`commit_growth` is 0.5"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// The efficiency lies in 0 to 1 on any ground (acceptance 17), the residual is measured from the final position, and a second run
    /// is bit for bit the same.
    #[test]
    fn prop_efficiency_is_a_share(
        seed in 0u64..1000, count in 0usize..40, schoppers_like in any::<bool>(), slope in -0.3f64..0.3,
    ) {
        let mut stream = Streams::for_seed(seed, "rocks").stream("rocks");
        let mut rock = || ([stream.uniform_in(1.0, 9.0), stream.uniform_in(-4.0, 4.0)], stream.uniform_in(0.05, 0.5), stream.uniform_in(0.0, 0.4));
        let rocks: Vec<Rock> = (0..count).map(|_| rock()).collect();
        let ground = Made { slopes: [slope, 0.1], ..Made::flat(&rocks) };
        let navigator = if schoppers_like {
            Navigator::Schoppers(SchoppersParameters { cycle_limit: 3000, ..Default::default() })
        } else {
            Navigator::Sojourner(SojournerParameters { cycle_limit: 3000, ..Default::default() })
        };
        let drive = run(&ground, &navigator, &ahead(10.0));
        let e = drive.efficiency();
        prop_assert!((0.0..=1.0).contains(&e) && (0.0..=1.0).contains(&drive.efficiency_at_half(100.0)));
        prop_assert!((drive.last.distance_m([10.0, 0.0]) - drive.residual_m).abs() < 1e-12);
        prop_assert_eq!(drive, run(&ground, &navigator, &ahead(10.0)));
    }
}

/// No side is preferred: mirrored views and goals give exactly mirrored commands, in all of 40 drives of 300 cycles each. (Complete
/// drives over mirrored ground need not mirror: a rover that heads for its goal has a bearing error of the order of rounding, whose
/// sign does not mirror, and passes a rock dead ahead on the side of that error.)
#[test]
fn prop_a_mirrored_view_gives_a_mirrored_command() {
    let mut stream = Streams::for_seed(5, "rocks").stream("mirror");
    let (mut turns, mut backs) = (0, 0);
    for number in 0..40 {
        // Open and crowded ground alternate: a rover backs up after a full turn without finding a way.
        let share = if number % 2 == 0 { 0.5 } else { 0.97 };
        let (mut rover, mut mirrored) = (schoppers().policy(), schoppers().policy());
        for cycle in 0..300 {
            let blocked: Vec<bool> = (0..4).map(|_| stream.uniform() < share).collect();
            let (heading_rad, goal_m) = (stream.uniform_in(-3.0, 3.0), [stream.uniform_in(1.0, 20.0), 0.0]);
            let seen = |hazards: Vec<bool>| {
                let mut view = view(&Made::flat(&[]), &schoppers(), &ahead(1.0).pose());
                view.areas.iter_mut().zip(hazards).for_each(|(area, hazard)| area.hazard = hazard);
                view
            };
            let [here, there] =
                [(seen(blocked.clone()), heading_rad), (seen(blocked.into_iter().rev().collect()), -heading_rad)];
            let decide = |policy: &mut dyn Policy, (view, heading_rad): &(View, f64)| {
                let pose = Pose { position_m: [0.0; 2], heading_rad: *heading_rad };
                policy.decide(&Situation { pose, goal_m, view, draws: CycleDraws::new(noise(), cycle) })
            };
            let (left, right) = (decide(rover.as_mut(), &here), decide(mirrored.as_mut(), &there));
            assert!(left.turn_rad == -right.turn_rad && left.drive_m == right.drive_m, "{left:?} {right:?}");
            turns += u32::from(left.turn_rad != 0.0);
            backs += u32::from(left.drive_m < 0.0);
        }
    }
    println!("{turns} turns, {backs} reversals in 12000 cycles");
    assert!(turns > 2000 && backs > 20);
}

/// Mirrored ground gives a mirrored view, from all of 200 poses near rocks: no pixel edge coincides with the edge of a rock.
#[test]
fn prop_mirrored_ground_is_seen_mirrored() {
    let mut stream = Streams::for_seed(6, "rocks").stream("mirror");
    let mut mixed = 0;
    for _ in 0..200 {
        let mut rock = || {
            (
                [stream.uniform_in(0.3, 2.0), stream.uniform_in(-1.2, 1.2)],
                stream.uniform_in(0.05, 0.4),
                stream.uniform_in(0.05, 0.4),
            )
        };
        let rocks = [rock(), rock(), rock()];
        let (y, heading_rad) = (stream.uniform_in(-0.5, 0.5), stream.uniform_in(-0.6, 0.6));
        let slopes = [stream.uniform_in(-0.2, 0.2), stream.uniform_in(-0.2, 0.2)];
        let seen = |sign: f64| -> Vec<bool> {
            let rocks: Vec<Rock> = rocks.iter().map(|(c, r, h)| ([c[0], sign * c[1]], *r, *h)).collect();
            let ground = Made { slopes: [slopes[0], sign * slopes[1]], ..Made::flat(&rocks) };
            let pose = Pose { position_m: [0.0, sign * y], heading_rad: sign * heading_rad };
            view(&ground, &schoppers(), &pose).areas.iter().map(|area| area.hazard).collect()
        };
        let (left, mut right) = (seen(1.0), seen(-1.0));
        right.reverse();
        assert_eq!(left, right);
        mixed += u32::from(left.iter().any(|h| *h) && !left.iter().all(|h| *h));
    }
    println!("{mixed} of 200 views have safe and unsafe rectangles");
    assert!(mixed > 50);
}
