//! Rovers on ground made up for the purpose. Trials on worlds of rocks are in `tests/rovers`.

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

/// A plane with rocks, known within a distance of the origin along either axis.
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

/// The published figures, and what the residual does to a rover that gives up (acceptance 17).
#[test]
fn val_efficiency() {
    for (straight_m, travelled_m, published) in [(25.0, 89.3, 0.280), (25.0, 902.5, 0.0277), (40.0, 44.9, 0.891)] {
        let e = efficiency(straight_m, travelled_m, 0.0);
        assert!((e - published).abs() < 5e-4, "{travelled_m}: {e}");
    }
    assert_eq!((efficiency(25.0, 0.0, 25.0), efficiency(25.0, 25.0, 25.0)), (1.0, 0.5));
}

/// A rover on a plane stands as the plane does, whatever its heading: tilt, and axes of the body by its quaternion.
#[test]
fn val_a_rover_on_a_plane_stands_on_it() {
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

/// On a plane no ray is a hazard, and every ray ends where it was aimed; a steeper plane tilts the rover.
#[test]
fn val_rays_meet_a_plane_where_they_are_aimed() {
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
    // A rock is a hazard where its front is, wherever in its column; a drop-off where the ray was aimed.
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

/// A rock is a hazard of the columns that meet it when it is higher than the hazard height; its own height is measured.
#[test]
fn val_rays_see_rocks_by_their_height() {
    let rock = |height_m: f64| Made::flat(&[([0.55, 0.28], 0.1, height_m)]);
    assert_eq!(hazards(&rock(0.05), &sojourner()), [false; 5]);
    assert_eq!(hazards(&rock(0.08), &sojourner()), [true, false, false, false, false]);
    let seen = view(&rock(0.05), &sojourner(), &ahead(1.0).pose());
    let highest = seen.rays.iter().filter_map(|ray| ray.height_m).fold(0.0, f64::max);
    assert!((highest - 0.05).abs() < 0.01, "{highest}");
}

/// Where the ground falls away nothing is hit, and that is a hazard; where it is not known, looking is an error.
#[test]
fn val_drop_offs_and_unknown_ground_differ() {
    let pit = Made::flat(&[([0.0; 2], 0.45, 5.0)]);
    assert_eq!(hazards(&pit, &sojourner()), [true; 5]);
    let edge = Made { known_m: 0.5, ..Made::flat(&[]) };
    let drive = run(&edge, &sojourner(), &ahead(5.0));
    assert!(matches!(drive.ending, Ending::OffGround(nowhere) if nowhere.x_m > 0.5), "{:?}", drive.ending);
    assert_eq!((drive.distance_m, drive.efficiency(), drive.counted_efficiency()), (0.0, 1.0, 0.0));
}

/// Each rule of the columns by itself.
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
    // Row to row: 0.07 within limits of 0.065 each.
    assert_eq!(flags(&sensor, &[(12, Some(0.04)), (13, Some(-0.03))]), [3]);
    // Column to column: the higher one.
    assert_eq!(flags(&sensor, &[(16, Some(0.035)), (12, Some(-0.035)), (13, Some(-0.02)), (17, Some(0.02))]), [4]);
    // Largest difference: a gentle ramp from -0.06 to 0.06 in all columns passes; with 0.045 more at one end it is 0.135 within 0.065 a row.
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

/// Rectangles: a rock above the clearance makes its own unsafe, at any tilt of the ground; a lower one none; steep sand all.
#[test]
fn val_rectangles_see_rocks_above_the_sand() {
    let at = |slopes: [f64; 2], height_m: f64| Made { slopes, ..Made::flat(&[([0.9, 0.7], 0.15, height_m)]) };
    for slopes in [[0.0, 0.0], [0.3, -0.2]] {
        assert_eq!(hazards(&at(slopes, 0.10), &schoppers()), [false; 4]);
        assert_eq!(hazards(&at(slopes, 0.16), &schoppers()), [true, false, false, false]);
    }
    assert_eq!(hazards(&at([0.5, 0.0], 0.0), &schoppers()), [true; 4]);
}

/// Without obstacles a rover drives straight: its way is the distance less the tolerance, to within a step.
#[test]
fn val_free_ground_is_crossed_straight() {
    for navigator in [sojourner(), schoppers()] {
        let drive = run(&Made::flat(&[]), &navigator, &ahead(25.0));
        assert!(drive.reached() && (drive.distance_m - 24.5).abs() <= 0.1, "{drive:?}");
        assert!(drive.efficiency() > 0.999 && drive.turns <= drive.cycles && drive.contacts.anywhere == 0);
    }
}

/// Both turn away from a rock in the way and arrive; neither drives over it.
#[test]
fn val_rocks_are_passed() {
    let ground = Made::flat(&[([5.0, 0.1], 0.4, 0.5), ([10.0, -0.2], 0.3, 0.3), ([15.0, 0.0], 0.6, 1.0)]);
    for navigator in [sojourner(), schoppers()] {
        let drive = run(&ground, &navigator, &ahead(20.0));
        assert!(drive.reached() && drive.contacts.anywhere == 0, "{drive:?}");
        assert!(drive.hazards > 0 && drive.efficiency() > 0.7);
    }
}

/// Shut in by a ring of rocks, a rover goes on to its limits, and is not said to have arrived.
#[test]
fn val_a_rover_that_is_shut_in_gives_up() {
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

/// A rock that comes under the rover counts once; one lower than the clearance does not count.
#[test]
fn val_contacts_are_counted_once() {
    let ground = Made::flat(&[([5.0, 0.0], 0.1, 0.2), ([8.0, 0.15], 0.1, 0.2), ([11.0, 0.0], 0.1, 0.1)]);
    let blind =
        Navigator::Sojourner(SojournerParameters { hazard_step_m: 9.0, hazard_span_m: 9.0, ..Default::default() });
    let drive = run(&ground, &blind, &ahead(15.0));
    assert!(drive.reached());
    assert_eq!((drive.contacts.anywhere, drive.contacts.on_centre_line), (2, 1));
}

/// The order of what is drawn does not matter: a draw is named by cycle and purpose. One more turn reshuffles nothing.
#[test]
fn prop_draws_are_named() {
    use super::draws::Purpose;
    let a = CycleDraws::new(noise().at(3), 17);
    let first = a.normal(Purpose::Turn);
    let _ = (a.normal(Purpose::Slip), a.normal_of(Purpose::Height, 9));
    assert_eq!(first, CycleDraws::new(noise().at(3), 17).normal(Purpose::Turn));
    assert_ne!(first, CycleDraws::new(noise().at(4), 17).normal(Purpose::Turn));
    assert_ne!(first, a.normal(Purpose::Heading));
}

/// Starts are drawn again until they and their goals have ground; the others stay where they were, and where there is no ground at all the
/// draws end.
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

/// The map of obstacles blocks the cells with a centre within the margin of a rock above the limit, on a slope as on level ground, and no
/// others, by the slow reference: every sample against every cell. Steep sand and unknown ground are blocked wholly.
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

/// Slip shortens drives; a rover that reckons its place by its commands then stops short of the goal, lost.
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

/// Each option of noise changes what it should and nothing else: turn, drive, heading after the drive, heights; and only dead reckoning parts
/// what the rover believes from where it is.
#[test]
fn val_each_noise_has_its_own_effect() {
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
    assert!(moved.turn_rad == 0.2 && moved.drive_m != 0.075 && scattered.real.heading_rad == exact.real.heading_rad);
    let (_, moved) = after(NoiseParameters { turn: 0.1, ..none });
    assert!(moved.turn_rad != 0.2 && (moved.turn_rad - 0.2).abs() < 0.1 && moved.drive_m == 0.1);
    let (drifted, moved) = after(NoiseParameters { drift_rad: 0.1, ..none });
    assert_eq!((moved.turn_rad, moved.drive_m, drifted.real.position_m), (0.2, 0.1, exact.real.position_m));
    assert_ne!(drifted.real.heading_rad, exact.real.heading_rad);
    let all = NoiseParameters { slip: 0.25, turn: 0.1, drift_rad: 0.1, dead_reckoning: true, ..none };
    let (reckoned, _) = after(all);
    assert!(reckoned.believed == exact.real && reckoned.real != exact.real);
    // The draws do not move: with another option besides, the turn is off by the same.
    let (_, alone) = after(NoiseParameters { turn: 0.1, ..none });
    let (_, beside) = after(NoiseParameters { turn: 0.1, slip: 0.3, slip_deviation: 0.2, drift_rad: 0.1, ..none });
    assert_eq!(alone.turn_rad, beside.turn_rad);
    // Heights: what is sensed changes, where it is sensed and how the rover stands does not.
    let ground = Made::flat(&[]);
    for navigator in [sojourner(), schoppers()] {
        let task = navigator.task(&RoverParameters::default());
        let body = Body::standing(&ground, &pose, &task.chassis).unwrap();
        let [plain, noisy] = [0.0, 0.3].map(|m| task.sensor.look(&ground, &pose, &body, m, &draws).unwrap());
        assert!(plain.areas.iter().zip(&noisy.areas).all(|(a, b)| a.corners_m == b.corners_m));
        assert!(plain.rays.iter().zip(&noisy.rays).all(|(a, b)| a.from_m == b.from_m && a.height_m != b.height_m));
        assert!(!plain.has_hazard() && plain.tilted == noisy.tilted);
    }
}

/// Censoring: the efficiency at half of the limit is that of the same rover with half of the limit, to within a step.
#[test]
fn val_half_of_the_limit_is_as_if_it_were_the_limit() {
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

/// Eight drawn heights are not taken for steps: each of the six beyond the least gap is near a whole step with a chance of 4 %, so that one of
/// 20 000 sets is with a chance of 1e-4; nor are the heights of seven boxes on level ground.
#[test]
fn stat_few_heights_are_no_steps() {
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

/// Heights in steps are told from others, whatever their offset: those of a 16-bit image over 4 km, of whole millimetres, of a float
/// raster; terraces of a few heights are ground.
#[test]
fn val_steps_of_heights_are_found() {
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
    // 29 levels of little relief, one of them missing; and a few terraces.
    let few: Vec<f32> = (0..30).filter(|k| *k != 7).map(|k| (0.061 * f64::from(k)) as f32).collect();
    assert!((height_step_m(&few).unwrap() - 0.061).abs() < 1e-6);
    assert_eq!(height_step_m(&[0.0, 0.5, 1.0, 1.5].repeat(100)), None);
    assert_eq!(height_step_m(&[]), None);
}

/// A recording tells what happened, with its numbers; its states are those that the metrics judge.
#[test]
fn val_recordings_hold_every_cycle() {
    use sastrugi_schemas::topics::RoverEventKind as Kind;
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
        assert!(recording.events.is_sorted_by(|a, b| a.time_s <= b.time_s));
        let last = recording.states.last().unwrap();
        assert!((last.time_s - drive.time_s).abs() <= 1.0 && drive.time_s >= last.time_s);
        // Speeds lead from state to state, turns aside.
        let driven: f64 = recording.states.iter().map(|s| libm::hypot(s.velocity_m_s[0], s.velocity_m_s[1])).sum();
        assert!((driven - drive.distance_m).abs() < 0.05 * drive.distance_m, "{driven} {}", drive.distance_m);
        assert_eq!(recording.cycles[0].areas.len(), if matches!(navigator, Navigator::Schoppers(_)) { 4 } else { 5 });
        assert!(recording.plans.is_empty());
    }
}

/// Starts lie on the circle, at equal angles, and more rovers leave headings where they were.
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

/// The sentence names what is wrong (section 8).
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
        (SojournerParameters { columns_m: vec![0.0, 0.1], ..p() }, "numbers that fall"),
        (SojournerParameters { rows_m: vec![0.2, 0.1], ..p() }, "numbers that rise"),
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

    /// e lies in 0 to 1 on any ground (acceptance 17), the residual is where the rover stopped, and a second run is the same to the bit.
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

/// No side is preferred: mirrored views and goals are answered by mirrored commands, in all of 40 drives of 300 cycles each, exactly. (Whole drives over
/// mirrored ground need not mirror: a rover that heads for its goal has an error of bearing of a rounding, which is neither left nor right, and
/// passes a rock dead ahead on the side of that rounding.)
#[test]
fn prop_a_mirrored_view_is_answered_the_mirrored_way() {
    let mut stream = Streams::for_seed(5, "rocks").stream("mirror");
    let (mut turns, mut backs) = (0, 0);
    for number in 0..40 {
        // Open and crowded ground by turns: a rover backs up after a full turn without a way.
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
    println!("{turns} turns, {backs} times back in 12000 cycles");
    assert!(turns > 2000 && backs > 20);
}

/// A mirrored ground is seen mirrored, from 200 poses beside rocks, all of them: no pixel's edge falls on a rock's.
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
