//! Closed forms, slow references, and invariances of images.

use super::*;
use crate::description::Noise;
use crate::direction::{along, direction, minus, unit};
use crate::pose::CameraParameters;
use crate::sun::Sun;
use proptest::prelude::*;
use sastrugi_numeric::{Geometry, Surface};

fn streams() -> Streams {
    Streams::for_seed(7, "image")
}

/// A surface `z(x, y)` on square cells from the origin.
fn surface(rows: usize, cols: usize, cell_m: f64, z: impl Fn(f64, f64) -> f64) -> Grid {
    let g = Geometry::square(rows, cols, cell_m);
    Grid::new(g, (0..rows).flat_map(|r| (0..cols).map(move |c| (g.x(c), g.y(r)))).map(|(x, y)| z(x, y)).collect())
}

/// Hills with a period of about 6 cells and slopes up to 50 degrees, on non-square cells, far from the origin.
fn hills(rows: usize, cols: usize) -> Grid {
    let g = Geometry { rows, cols, cell: [0.5, 0.75], origin: [1000.0, -300.0] };
    let z = |r: usize, c: usize| {
        let (r, c) = (r as f64, c as f64);
        0.6 * libm::sin(1.1 * c + 0.3 * r) + 0.5 * libm::cos(0.9 * r) + 0.3 * libm::sin(2.7 * r * c)
    };
    Grid::new(g, (0..rows).flat_map(|r| (0..cols).map(move |c| (r, c))).map(|(r, c)| z(r, c)).collect())
}

fn plain(sun: [f64; 2]) -> RenderParameters {
    let sun = Sun { azimuth_deg: sun[0], elevation_deg: sun[1] };
    RenderParameters { sun, albedo: 0.5, samples: 1, ..RenderParameters::default() }
}

fn image(heights: &Grid, parameters: &RenderParameters) -> Rendering {
    render(&Scene { heights, albedo: None }, parameters, &streams()).unwrap()
}

/// The place seen from straight above a point.
fn below(relief: &Relief<'_>, x: f64, y: f64) -> Hit {
    relief.first_hit([x, y, 0.0], [0.0, 0.0, -1.0], f64::NEG_INFINITY).unwrap()
}

/// Closed form: a plane from straight above, whatever the slope, the sun and the rays per pixel; 1e-12.
#[test]
fn val_planes_from_above_match_the_closed_form() {
    for (p, q, sun, samples) in
        [(0.0, 0.0, [30.0, 50.0], 1), (0.3, -0.2, [315.0, 45.0], 2), (-0.1, 0.4, [120.0, 70.0], 3)]
    {
        let plane = surface(9, 12, 0.5, |x, y| p * x + q * y + 3.0);
        let parameters = RenderParameters { samples, ..plain(sun) };
        let light = parameters.sun.direction();
        let expected = 0.5 * parameters.photometry.of_slopes([p, q], light, [0.0, 0.0, 1.0]);
        let made = image(&plane, &parameters);
        assert!(made.pixels.iter().all(|p| (p.brightness - expected).abs() < 1e-12), "{expected} {:?}", made.pixels[0]);
        assert_eq!((made.share_in_shadow(), made.image().geometry), (0.0, plane.geometry));
    }
}

/// A plane slightly steeper than the sun's rays is dark, one slightly flatter is lit, down to a sun elevation of 0.1 degrees.
#[test]
fn val_planes_along_the_rays_are_lit_or_dark() {
    for (elevation, azimuth) in [(0.1, 90.0), (0.1, 37.0), (20.0, 211.0), (60.0, 300.0)] {
        let light = direction(azimuth, elevation);
        let fall = libm::tan(elevation.to_radians());
        let across = unit([light[0], light[1], 0.0]);
        let dark_share = |steepness: f64| {
            let slope = |x: f64, y: f64| steepness * fall * (across[0] * x + across[1] * y);
            image(&surface(40, 40, 0.1, slope), &plain([azimuth, elevation])).share_in_shadow()
        };
        assert_eq!((dark_share(0.999), dark_share(1.001)), (0.0, 1.0), "{azimuth} {elevation}");
    }
}

/// The shadow of a wall of height h is h / tan(elevation) long, for suns along and across the wall's normal; 1e-6 m by bisection.
#[test]
fn val_the_shadow_of_a_wall_has_the_closed_form_length() {
    // The wall's foot is at the centre of column 59, its top at that of column 60.
    let wall = surface(50, 100, 0.1, |x, _| if x < 6.0 { 0.0 } else { 1.5 });
    let relief = Relief::new(&wall).unwrap();
    let top = wall.geometry.x(60);
    for (azimuth, elevation) in [(90.0, 45.0), (90.0, 25.0), (60.0, 40.0), (130.0, 70.0)] {
        let sun = direction(azimuth, elevation);
        let dark = |x: f64| {
            let hit = below(&relief, x, 2.6);
            relief.is_shadowed(&hit.place, hit.point_m[2], sun)
        };
        let (mut lit, mut shadowed) = (0.1, 5.8);
        assert!(!dark(lit) && dark(shadowed), "{azimuth} {elevation}");
        while shadowed - lit > 1e-8 {
            let middle = 0.5 * (lit + shadowed);
            if dark(middle) { shadowed = middle } else { lit = middle }
        }
        let length = 1.5 * sun[0] / sun[2];
        assert!((top - lit - length).abs() < 1e-6, "{azimuth} {elevation}: {} instead of {length}", top - lit);
    }
}

/// Cone of 30 degrees under a sun of 20 degrees: the shadow of its tip ends h / tan(20) away, and the lit side is brighter.
#[test]
fn val_a_cone_casts_a_shadow_to_its_tip() {
    let (height, side) = (2.0, libm::tan(30f64.to_radians()));
    let tip = [10.01, 10.01];
    let cone = surface(1001, 1001, 0.02, |x, y| {
        let away = ((x - tip[0]) * (x - tip[0]) + (y - tip[1]) * (y - tip[1])).sqrt();
        (height - side * away).max(0.0)
    });
    let made = image(&cone, &plain([270.0, 20.0]));
    let grid = made.image();
    let row = grid.geometry.cell_at(tip[0], tip[1]).unwrap().0;
    let dark = |x: f64| grid.at(row, grid.geometry.cell_at(x, tip[1]).unwrap().1) == 0.0;
    let end = tip[0] + height / libm::tan(20f64.to_radians());
    assert!(dark(end - 0.03) && !dark(end + 0.03) && dark(tip[0] + 0.1) && !dark(tip[0] - 0.1));
    let flat = grid.at(5, 5);
    assert!(grid.at(row, grid.geometry.cell_at(8.0, tip[1]).unwrap().1) > flat);
}

/// Sphere cap: normals by central differences; the error of the image falls with the square of the cell.
#[test]
fn conv_normals_of_a_sphere_are_of_second_order() {
    let (radius, depth) = (10.0, 9.0);
    let error = |cells: usize| {
        let cell = 8.0 / cells as f64;
        let height = |x: f64, y: f64| (radius * radius - (x - 4.0) * (x - 4.0) - (y - 4.0) * (y - 4.0)).sqrt() - depth;
        let cap = surface(cells, cells, cell, height);
        let made = image(&cap, &RenderParameters { shadows: false, ..plain([200.0, 60.0]) }).image();
        let parameters = plain([200.0, 60.0]);
        let exact = |x: f64, y: f64| {
            let z = height(x, y) + depth;
            let slopes = [-(x - 4.0) / z, -(y - 4.0) / z];
            0.5 * parameters.photometry.of_slopes(slopes, parameters.sun.direction(), [0.0, 0.0, 1.0])
        };
        // Over the same part of the cap, without the border, where differences are one-sided.
        let cells = (cells / 8..7 * cells / 8).flat_map(|r| (cells / 8..7 * cells / 8).map(move |c| (r, c)));
        let squares = cells.map(|(r, c)| made.at(r, c) - exact(cap.geometry.x(c), cap.geometry.y(r))).map(|e| e * e);
        mean(squares).sqrt()
    };
    let ratio = error(40) / error(80);
    assert!((3.8..4.2).contains(&ratio), "{ratio}");
}

/// Height of a ray above the surface by [`Surface`], NaN without ground.
fn above(heights: &Grid, origin: Vector, direction: Vector, s: f64) -> f64 {
    let [x, y, z] = along(origin, s, direction);
    heights.height(x, y).map_or(f64::NAN, |ground| z - ground)
}

/// First sign change found by marching in tiny steps (the last distance before it); infinite if there is none, `None` if the ray comes
/// from below the ground.
fn march(heights: &Grid, origin: Vector, direction: Vector, to: f64, step: f64) -> Option<f64> {
    let mut before = f64::NAN;
    for k in 0..(to / step) as usize {
        let now = above(heights, origin, direction, k as f64 * step);
        if now < 0.0 {
            return (before >= 0.0).then_some(k as f64 * step);
        }
        before = now;
    }
    Some(f64::INFINITY)
}

fn with_holes(mut heights: Grid) -> Grid {
    for k in [25, 26, 41, 160, 161, 162, 190] {
        heights.values[k] = f64::NAN;
    }
    heights
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// The fast walk finds the same hit as a march in steps of 1/2000 of a cell, with holes, from inside and outside. Grazing rays are
    /// excluded: ground missed by the march lies within one step's change of height of the ray, ground missed by the walk within 1 mm of it.
    #[test]
    fn prop_rays_hit_what_a_slow_march_hits(
        x in -2.0..10.0f64, y in -2.0..14.0f64, z in 0.5..6.0f64,
        azimuth in 0.0..360.0f64, elevation in -85.0..5.0f64, holes: bool,
    ) {
        let heights = hills(18, 16);
        let heights = if holes { with_holes(heights) } else { heights };
        let (origin, step) = ([1000.0 + x, -300.0 + y, z], 2.5e-4);
        let inside = above(&heights, origin, [0.0; 3], 0.0);
        prop_assume!(inside.is_nan() || inside > 0.0);
        let towards = direction(azimuth, elevation);
        let relief = Relief::new(&heights).unwrap();
        let hit = relief.first_hit(origin, towards, 0.0);
        let slow = march(&heights, origin, towards, 30.0, step);
        let least = |from: f64, to: f64, of: fn(f64) -> f64| {
            let steps = (from / step) as usize..(to / step) as usize;
            steps.map(|k| above(&heights, origin, towards, k as f64 * step)).filter(|f| f.is_finite()).map(of).fold(f64::INFINITY, f64::min)
        };
        let lowest = |to: f64| least(0.0, to, f64::abs);
        let is_touched = |slow: f64| least(slow, slow + 0.5, std::convert::identity) > -1e-3;
        match (hit, slow) {
            (Some(hit), Some(slow)) if slow.is_finite() => {
                let near = hit.distance_m > slow - 2.0 * step && hit.distance_m < slow + 1e-9;
                // Otherwise it hit ground that the march stepped over, or passed ground that it hardly touches.
                let other = if hit.distance_m < slow { lowest(hit.distance_m + step) < 1e-3 } else { is_touched(slow) };
                prop_assert!(near || other, "{hit:?} {slow}");
                let ground = heights.height(hit.point_m[0], hit.point_m[1]).unwrap_or(hit.point_m[2]);
                prop_assert!((ground - hit.point_m[2]).abs() < 1e-9);
                prop_assert!(minus(along(origin, hit.distance_m, towards), hit.point_m).iter().all(|d| d.abs() < 1e-8));
            }
            (None, None) => {}
            (None, Some(slow)) => prop_assert!(slow.is_infinite() || is_touched(slow), "march met ground at {slow}"),
            (Some(hit), _) => prop_assert!(lowest(hit.distance_m + step) < 1e-3, "{hit:?} {slow:?}"),
        }
    }

    /// Shadows against a march to the sun in steps of 0.25 mm, refined to 2.5 um where the ray is less than 2 mm above the ground: there,
    /// or next to a hole, steep ground may rise into the ray between two steps.
    #[test]
    fn prop_shadows_match_a_slow_march(
        x in 0.6..7.2f64, y in 0.8..12.0f64, azimuth in 0.0..360.0f64, elevation in 0.1..80.0f64, holes: bool,
    ) {
        let heights = hills(18, 16);
        let heights = if holes { with_holes(heights) } else { heights };
        let relief = Relief::new(&heights).unwrap();
        let from = relief.first_hit([1000.0 + x, -300.0 + y, 0.0], [0.0, 0.0, -1.0], f64::NEG_INFINITY);
        prop_assume!(from.is_some());
        let (from, sun) = (from.unwrap(), direction(azimuth, elevation));
        let fast = relief.is_shadowed(&from.place, from.point_m[2], sun);
        // A little above the ground, so that the march does not start in it.
        let start = along(from.point_m, 1e-7, [0.0, 0.0, 1.0]);
        let at = |k: f64| above(&heights, start, sun, k * 2.5e-4);
        let around = |k: i32| {
            let close = k > 1 && at(f64::from(k)) < 2e-3;
            let fine = if close { -99..100 } else { 0..1 };
            fine.map(move |part| f64::from(k) + 0.01 * f64::from(part))
        };
        let lowest = (1..60_000).flat_map(around).map(at).filter(|f| f.is_finite()).fold(f64::INFINITY, f64::min);
        prop_assume!(!(-1e-4..1e-4).contains(&lowest) || lowest.is_infinite());
        prop_assert_eq!(fast, lowest < 0.0, "{}", lowest);
    }

    /// For any camera, the point seen by a pixel projects to that pixel, lies on the ground, and is at the stated range.
    #[test]
    fn prop_pixels_see_the_ground_behind_them(
        azimuth in 0.0..360.0f64, elevation in 10.0..90.0f64, x in 1.0..7.0f64, y in 1.0..12.0f64, z in 0.2..4.0f64, pinhole: bool,
    ) {
        let heights = hills(18, 16);
        let camera = if pinhole {
            CameraParameters::Pinhole {
                position_m: [1000.0 + x, -300.0 + y, z], target_m: [1004.0, -293.0, 0.0], above_ground: true,
                field_of_view_deg: 70.0, size_px: [15, 11],
            }
        } else {
            CameraParameters::Parallel { azimuth_deg: azimuth, elevation_deg: elevation, pixel_m: Some(0.8), size_px: None, target_m: None }
        };
        let made = image(&heights, &RenderParameters { camera, ..plain([azimuth, 30.0]) });
        let camera = made.pose.camera();
        let [_, cols] = camera.shape();
        for (k, pixel) in made.pixels.iter().enumerate() {
            prop_assert_eq!(pixel.brightness.is_nan(), pixel.ground == 0.0);
            if pixel.ground == 0.0 {
                continue;
            }
            let at = camera.project(pixel.point_m).unwrap();
            prop_assert!((at[0] - (k % cols) as f64 - 0.5).abs() < 1e-6 && (at[1] - (k / cols) as f64 - 0.5).abs() < 1e-6, "{at:?}");
            let ray = camera.ray([(k % cols) as f64 + 0.5, (k / cols) as f64 + 0.5]);
            prop_assert!(minus(along(ray.origin_m, pixel.range_m, ray.direction), pixel.point_m).iter().all(|d| d.abs() < 1e-8));
        }
    }

    /// Brightness is proportional to the albedo, and a uniform map gives the same image as that albedo.
    #[test]
    fn prop_brightness_is_proportional_to_albedo(albedo in 0.05..1.0f64) {
        let heights = hills(9, 8);
        let parameters = RenderParameters { samples: 2, ..plain([100.0, 25.0]) };
        let plain = image(&heights, &parameters);
        let map = Grid::filled(heights.geometry, albedo);
        let made = render(&Scene { heights: &heights, albedo: Some(&map) }, &parameters, &streams()).unwrap();
        for (a, b) in plain.pixels.iter().zip(&made.pixels) {
            prop_assert!(a.ground == b.ground && a.shadow == b.shadow);
            prop_assert!(a.ground == 0.0 || (a.brightness * albedo / 0.5 - b.brightness).abs() < 1e-12);
        }
    }
}

/// Pinhole over a plane: every pixel sees the point where its ray hits the plane, or sky.
#[test]
fn val_a_pinhole_sees_a_plane_up_to_the_horizon() {
    let plane = surface(400, 400, 0.5, |_, _| 2.0);
    let camera = CameraParameters::Pinhole {
        position_m: [100.0, 20.0, 1.5],
        target_m: [100.0, 60.0, 1.5],
        above_ground: true,
        field_of_view_deg: 60.0,
        size_px: [32, 24],
    };
    let made = image(&plane, &RenderParameters { camera, ..plain([180.0, 40.0]) });
    let focal = 16.0 / libm::tan(30f64.to_radians());
    for (k, pixel) in made.pixels.iter().enumerate() {
        let (right, down) = ((k % 32) as f64 + 0.5 - 16.0, (k / 32) as f64 + 0.5 - 12.0);
        let ahead = 1.5 * focal / down;
        let point = [100.0 + right * ahead / focal, 20.0 + ahead, 2.0];
        let seen = down > 0.0 && point[1] <= 199.75 && point[0] >= 0.25 && point[0] <= 199.75;
        assert_eq!(pixel.ground > 0.0, seen, "{k}");
        assert!(!seen || minus(pixel.point_m, point).iter().all(|d| d.abs() < 1e-9), "{:?} {point:?}", pixel.point_m);
    }
    assert_eq!(made.share_without_ground(), 0.5);
}

/// A wall hides the ground behind it.
#[test]
fn val_a_wall_hides_what_is_behind_it() {
    let wall = surface(100, 100, 0.1, |_, y| if (5.0..5.3).contains(&y) { 1.0 } else { 0.0 });
    let camera = |elevation_deg| CameraParameters::Parallel {
        azimuth_deg: 180.0,
        elevation_deg,
        pixel_m: None,
        size_px: None,
        target_m: None,
    };
    let made = image(&wall, &RenderParameters { camera: camera(30.0), ..plain([180.0, 50.0]) });
    // Ground behind the wall is visible beyond the line of sight over its top, 1 m / tan(30 deg) behind it.
    let first = 5.3 + 1.0 / libm::tan(30f64.to_radians());
    let behind = made.pixels.iter().filter(|p| p.ground > 0.0 && p.point_m[2] == 0.0 && p.point_m[1] > 5.3);
    let nearest = behind.map(|p| p.point_m[1]).fold(f64::INFINITY, f64::min);
    assert!(nearest > first - 0.25 && nearest < first + 0.25, "{nearest} {first}");
}

/// One or four threads give the same bits, including noise.
#[test]
fn val_threads_change_no_bit() {
    let noise = Noise { relative: 0.02, absolute: 1e-3 };
    let camera = CameraParameters::Parallel {
        azimuth_deg: 40.0,
        elevation_deg: 35.0,
        pixel_m: Some(0.2),
        size_px: None,
        target_m: None,
    };
    let parameters = RenderParameters { camera, noise, samples: 3, ..plain([250.0, 20.0]) };
    let heights = with_holes(hills(18, 16));
    let bits = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let made = pool.install(|| image(&heights, &parameters));
        made.pixels
            .iter()
            .map(|p| (p.brightness.to_bits(), p.range_m.to_bits(), p.shadow.to_bits()))
            .collect::<Vec<_>>()
    };
    assert_eq!(bits(1), bits(4));
}

/// Pixels over holes see no ground; all other pixels are unchanged.
#[test]
fn val_holes_are_not_ground() {
    let mut plane = surface(12, 12, 1.0, |_, _| 5.0);
    let whole = image(&plane, &plain([90.0, 10.0]));
    plane.values[5 * 12 + 6] = f64::NAN;
    let made = image(&plane, &plain([90.0, 10.0]));
    let seen: Vec<usize> = (0..144).filter(|&k| made.pixels[k].ground == 0.0).collect();
    // A ray through the centre of a neighbouring cell lies on the border of a patch with data.
    assert_eq!(seen, [5 * 12 + 6]);
    for (a, b) in whole.pixels.iter().zip(&made.pixels).filter(|(_, b)| b.ground > 0.0) {
        assert_eq!(a.brightness, b.brightness);
    }
}

/// Through a hole in the ground, a low camera does not see the underside of the ground behind it.
#[test]
fn val_nothing_is_seen_from_below() {
    let heights = with_holes(hills(18, 16));
    let relief = Relief::new(&heights).unwrap();
    assert!(relief.first_hit([990.0, -295.0, -3.0], direction(80.0, 10.0), 0.0).is_none());
    assert!(relief.first_hit([1003.0, -295.0, -3.0], direction(80.0, 45.0), 0.0).is_none());
}

#[test]
fn val_invalid_scenes_are_refused() {
    let parameters = plain([90.0, 45.0]);
    let error = |heights: &Grid, albedo: Option<&Grid>| {
        render(&Scene { heights, albedo }, &parameters, &streams()).unwrap_err()
    };
    let line = surface(1, 8, 1.0, |x, _| x);
    assert_eq!(error(&line, None), RenderError::NoSurface { rows: 1, cols: 8 });
    let empty = surface(3, 3, 1.0, |_, _| f64::NAN);
    assert_eq!(error(&empty, None), RenderError::NoSurface { rows: 3, cols: 3 });
    let small = surface(2, 2, 1.0, |x, _| x);
    let shape = RenderError::AlbedoShape { albedo_rows: 1, albedo_cols: 8, rows: 2, cols: 2 };
    assert_eq!(error(&small, Some(&line)), shape);
    let bright = Grid::filled(small.geometry, 1.5);
    assert_eq!(error(&small, Some(&bright)), RenderError::AlbedoValue { value: 1.5 });
    let away = CameraParameters::Pinhole {
        position_m: [1.0, 1.0, 9.0],
        target_m: [1.0, 1.0, 99.0],
        above_ground: true,
        field_of_view_deg: 20.0,
        size_px: [4, 4],
    };
    let upwards = RenderParameters { camera: away, ..parameters.clone() };
    let nothing = render(&Scene { heights: &small, albedo: None }, &upwards, &streams()).unwrap_err();
    assert_eq!(nothing, RenderError::NothingSeen);
    assert_eq!(image(&small, &parameters).pixels.len(), 4);
    let key = |p: RenderParameters| p.check().unwrap_err().key;
    assert_eq!(key(RenderParameters { albedo: 1.1, ..parameters.clone() }), "albedo");
    assert_eq!(key(RenderParameters { samples: 0, ..parameters.clone() }), "samples");
    assert_eq!(key(RenderParameters { exposure: -1.0, ..parameters.clone() }), "exposure");
    assert_eq!(
        key(RenderParameters { sun: Sun { azimuth_deg: 0.0, elevation_deg: 0.0 }, ..parameters }),
        "sun.elevation_deg"
    );
}

/// A cell without albedo takes the default.
#[test]
fn val_albedo_without_data_is_the_default() {
    let plane = surface(4, 4, 1.0, |_, _| 0.0);
    let mut map = Grid::filled(plane.geometry, 0.2);
    map.values[0] = f64::NAN;
    let made = render(&Scene { heights: &plane, albedo: Some(&map) }, &plain([0.0, 90.0]), &streams()).unwrap();
    assert!((made.pixels[0].brightness - 0.5).abs() < 1e-15 && (made.pixels[15].brightness - 0.2).abs() < 1e-15);
}

/// Noise on a plane of brightness m: 40 000 independent pixels have the mean m and the standard deviation sqrt(a^2 + (r m)^2). Bounds are
/// 5 standard errors of the mean, sigma/200, and of the standard deviation, sigma/(200 sqrt 2): two tests, false alarm below 2e-6. A relative error of
/// sigma of 2 % would be detected.
#[test]
fn stat_noise_has_the_stated_deviation() {
    let plane = surface(200, 200, 1.0, |_, _| 0.0);
    let noise = Noise { relative: 0.03, absolute: 0.02 };
    let parameters = RenderParameters { noise, exposure: 2.0, haze: 0.1, ..plain([0.0, 90.0]) };
    let made = image(&plane, &parameters);
    let (expected, n) = (2.0 * 0.5 + 0.1, 40_000.0);
    let sigma = (0.02f64 * 0.02 + (0.03 * expected) * (0.03 * expected)).sqrt();
    let mean = made.mean_brightness();
    let variance = made.pixels.iter().map(|p| (p.brightness - mean) * (p.brightness - mean)).sum::<f64>() / (n - 1.0);
    assert!((mean - expected).abs() < 5.0 * sigma / n.sqrt(), "{mean}");
    assert!((variance.sqrt() - sigma).abs() < 5.0 * sigma / (2.0 * n).sqrt(), "{}", variance.sqrt());
    let again = render(&Scene { heights: &plane, albedo: None }, &parameters, &Streams::for_seed(8, "image")).unwrap();
    assert!(again.pixels[0].brightness != made.pixels[0].brightness);
}

/// Slopes are the mean of both sides on lines between patches, those of the patch inside it, and one-sided at the border of the ground.
#[test]
fn val_slopes_at_cell_centres_are_central_differences() {
    let heights = hills(6, 7);
    let relief = Relief::new(&heights).unwrap();
    let g = heights.geometry;
    let slopes = |x: f64, y: f64| relief.slopes(&below(&relief, x, y).place);
    let at = |r: usize, c: usize| heights.at(r, c);
    let [p, q] = slopes(g.x(3), g.y(2));
    assert!(
        (p - (at(2, 4) - at(2, 2)) / (2.0 * 0.5)).abs() < 1e-9
            && (q - (at(1, 3) - at(3, 3)) / (2.0 * 0.75)).abs() < 1e-9
    );
    let [p, _] = slopes(g.x(0), g.y(2));
    assert!((p - (at(2, 1) - at(2, 0)) / 0.5).abs() < 1e-9);
    let (x, y) = (g.x(3) + 0.1, g.y(2) + 0.2);
    let (_, p, q) = heights.height_and_gradient(x, y).unwrap();
    let own = slopes(x, y);
    assert!((own[0] - p).abs() < 1e-9 && (own[1] - q).abs() < 1e-9);
}

/// Without cast shadows, level ground behind a wall is as bright as elsewhere; the wall itself, which faces away from the sun, is dark
/// either way.
#[test]
fn val_cast_shadows_can_be_left_out() {
    let wall = surface(50, 100, 0.1, |x, _| if x < 6.0 { 0.0 } else { 1.5 });
    let parameters = plain([90.0, 45.0]);
    let with = image(&wall, &parameters).image();
    let without = image(&wall, &RenderParameters { shadows: false, ..parameters.clone() }).image();
    let level = 0.5 * parameters.photometry.of_slopes([0.0; 2], parameters.sun.direction(), [0.0, 0.0, 1.0]);
    // The shadow reaches from x = 6.05 to 4.55.
    let at = |grid: &Grid, x: f64| grid.at(25, grid.geometry.cell_at(x, 2.5).unwrap().1);
    assert_eq!((at(&with, 5.0), at(&with, 5.96), at(&without, 5.96)), (0.0, 0.0, 0.0));
    for lit in [at(&without, 5.0), at(&with, 4.0), at(&without, 4.0), at(&with, 8.0)] {
        assert!((lit - level).abs() < 1e-12, "{lit} {level}");
    }
}
