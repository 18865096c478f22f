//! Parts of an inversion one by one, against closed forms, on cells that are not square.

use super::accuracy::streams;
use crate::camera::{Camera, ParallelCamera};
use crate::direction::{Vector, direction};
use crate::photoclinometry::cell::{Prior, Problem, Sample};
use crate::photoclinometry::integration::{Stop, System};
use crate::photoclinometry::paths::integrate_along_paths;
use crate::photoclinometry::uncertainty::coverage;
use crate::photoclinometry::*;
use crate::photometry::Photometry;
use sastrugi_numeric::{Geometry, Grid, sums};

const SLOPES: [f64; 2] = [0.3, -0.2];

/// Cells of 0.5 by 2 m, far from square and from the origin.
fn geometry() -> Geometry {
    Geometry { rows: 6, cols: 9, cell: [0.5, 2.0], origin: [7.0, -3.0] }
}

fn height(x: f64, y: f64) -> f64 {
    SLOPES[0] * x + SLOPES[1] * y + 4.0
}

/// Heights of a plane with the gradient [`SLOPES`].
fn plane() -> Grid {
    let g = geometry();
    Grid::new(g, (0..g.len()).map(|k| height(g.x(k % g.cols), g.y(k / g.cols))).collect())
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

/// Pixel centres have their own values, positions between them bilinear ones; border pixels extend to the edge, beyond which, as next to
/// a missing pixel, there is nothing.
#[test]
fn val_images_are_bilinear_between_pixels() {
    let camera = Camera::Parallel(ParallelCamera::new([0.0, 90.0], [0.0; 3], 1.0, [2, 3]));
    let light = [0.0, 0.0, 1.0];
    let brightness = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    let mut image = Image { camera, light, exposure: 1.0, haze: 0.0, brightness };
    for (at, expected) in [
        ([0.5, 0.5], 1.0),
        ([2.5, 1.5], 6.0),
        ([1.0, 1.0], 3.0),
        ([2.25, 0.5], 2.75),
        ([0.5, 0.75], 1.75),
        ([0.0, 0.0], 1.0),
        ([3.0, 2.0], 6.0),
    ] {
        assert!(near(image.at(at), expected), "{at:?}: {}", image.at(at));
    }
    for beyond in [[-0.1, 1.0], [3.1, 1.0], [1.0, 2.1], [1.0, -0.1], [f64::NAN, 1.0]] {
        assert!(image.at(beyond).is_nan(), "{beyond:?}");
    }
    image.brightness[5] = f64::NAN;
    assert!(image.at([2.0, 1.0]).is_nan() && near(image.at([1.5, 1.5]), 5.0) && near(image.at([2.5, 0.5]), 3.0));
}

/// Slopes of a plane are those of the plane in every cell, at borders and next to holes too; rows run south, y north.
#[test]
fn val_slopes_of_a_plane() {
    let mut heights = plane();
    let g = heights.geometry;
    let corner = Relief { geometry: &g, heights_m: &heights.values }.edges(0);
    // No cell lies west or north of the north-west corner.
    assert!(corner[0].is_none() && corner[3].is_none(), "{corner:?}");
    assert!(near(corner[1].unwrap(), SLOPES[0]) && near(corner[2].unwrap(), SLOPES[1]), "{corner:?}");
    heights.values[22] = f64::NAN;
    let relief = Relief { geometry: &g, heights_m: &heights.values };
    for k in (0..g.len()).filter(|&k| k != 22) {
        let [p, q] = relief.slopes(k);
        assert!(near(p, SLOPES[0]) && near(q, SLOPES[1]), "{k}: {p} {q}");
    }
    assert!(relief.slopes(22).iter().all(|slope| slope.is_nan()));
}

/// A plane has one brightness, that of its facet.
#[test]
fn val_a_plane_is_shaded_evenly() {
    let (light, view) = (direction(40.0, 50.0), direction(200.0, 80.0));
    let photometry = Photometry::default();
    let expected = photometry.of_slopes(SLOPES, light, view);
    let shaded = evaluation::shaded(&plane(), &photometry, light, view);
    assert!(expected > 0.1, "{expected}");
    assert!(shaded.values.iter().all(|v| near(*v, expected)), "{expected} {:?}", shaded.values);
}

/// From the exact slopes of a plane, paths and least squares both give the plane, apart from its mean.
#[test]
fn val_a_plane_is_integrated_exactly() {
    let heights = plane();
    let g = heights.geometry;
    let slopes = vec![SLOPES; g.len()];
    let mean = sums::mean(&heights.values);
    let system = System::new(g, &vec![Some([4.0, 1.0, 2.0]); g.len()], vec![]);
    let squares = system.solve(&system.right_side(&slopes, &[]), None, Stop::FINE).heights_m;
    let paths = integrate_along_paths(&g, &slopes, &vec![true; g.len()], 9, &streams());
    let expected: Vec<f64> = heights.values.iter().map(|z| z - mean).collect();
    let agree = |found: &[f64], tolerance: f64| found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < tolerance);
    assert!(agree(&squares, 1e-7), "{squares:?} {expected:?}");
    assert!(agree(&paths, 1e-9), "{paths:?} {expected:?}");
}

/// A point is a weighted mean of the four cells around it, which is exact on a plane; beyond the outer centres there is none.
#[test]
fn val_a_point_is_bilinear_between_cells() {
    let heights = plane();
    let g = heights.geometry;
    let at = |x_m: f64, y_m: f64| Constraint::point(&g, &HeightPoint { x_m, y_m, height_m: 1.5, sigma_m: 0.2 });
    for (x, y) in [(8.1, 0.3), (7.25, -2.0), (11.25, 8.0), (9.999, 5.4)] {
        let found = at(x, y).unwrap();
        let total: f64 = found.cells.iter().map(|(_, weight)| weight).sum();
        let mean: f64 = found.cells.iter().map(|&(k, weight)| weight * heights.values[k]).sum();
        assert!(near(total, 1.0) && near(mean, height(x, y)), "{x} {y}: {found:?}");
        assert_eq!((found.height_m, found.sigma_m), (1.5, 0.2));
    }
    for (x, y) in [(7.2, 0.0), (11.3, 0.0), (9.0, -2.1), (9.0, 8.1)] {
        assert_eq!(at(x, y), None, "{x} {y}");
    }
}

/// A cell of a coarse DEM holds the mean of the cells in it; one without data, or that the map covers by half or less, none. A finer DEM
/// holds every cell at its own height.
#[test]
fn val_a_coarse_dem_holds_means() {
    let g = Geometry::square(4, 5, 1.0);
    // Cells of 2 m: the third column is covered by half.
    let mut dem = Grid::new(Geometry::square(2, 3, 2.0), vec![10.0, 11.0, 12.0, 13.0, 14.0, 15.0]);
    let cells = |c: &Constraint| c.cells.iter().map(|(k, _)| *k).collect::<Vec<_>>();
    let found = Constraint::coarse(&g, &dem, 0.3);
    assert_eq!(found.iter().map(|c| c.height_m).collect::<Vec<_>>(), [10.0, 11.0, 13.0, 14.0]);
    assert_eq!((cells(&found[0]), cells(&found[3])), (vec![0, 1, 5, 6], vec![12, 13, 17, 18]));
    assert!(found.iter().all(|c| c.sigma_m == 0.3 && c.cells.iter().all(|(_, weight)| *weight == 0.25)));
    dem.values[1] = f64::NAN;
    assert_eq!(Constraint::coarse(&g, &dem, 0.3).len(), 3);
    let fine = Geometry::square(16, 20, 0.25);
    let slope = Grid::new(fine, (0..fine.len()).map(|k| 0.5 * fine.x(k % fine.cols)).collect());
    let found = Constraint::coarse(&g, &slope, 0.3);
    assert_eq!(found.len(), 20);
    assert!(found.iter().enumerate().all(|(k, c)| cells(c) == [k] && near(c.height_m, 0.5 * g.x(k % 5))), "{found:?}");
}

/// Three suns at azimuths 0, 120 and 240 seen from above.
fn samples(slopes: [f64; 2], albedo: f64, sigma: f64) -> Vec<Sample> {
    let view: Vector = [0.0, 0.0, 1.0];
    let sample = |azimuth: f64| {
        let light = direction(azimuth, 45.0);
        Sample { brightness: albedo * Photometry::default().of_slopes(slopes, light, view), sigma, light, view }
    };
    [0.0, 120.0, 240.0].map(sample).to_vec()
}

/// Exact brightness gives exact slopes and albedo, and no residual.
#[test]
fn val_a_cell_is_solved_exactly() {
    for (slopes, albedo) in [([0.0, 0.0], 0.25), ([0.2, -0.1], 0.3), ([-0.35, 0.25], 0.05)] {
        let samples = samples(slopes, albedo, 0.01);
        let photometry = Photometry::default();
        let problem = Problem { photometry: &photometry, samples: &samples, prior: None, fixed_albedo: None };
        let fit = problem.solve(None).unwrap();
        let errors = [fit.slopes[0] - slopes[0], fit.slopes[1] - slopes[1], fit.albedo - albedo];
        assert!(errors.iter().all(|e| e.abs() < 1e-8) && fit.chi_square < 1e-9, "{fit:?}");
        let known = Problem { fixed_albedo: Some(albedo), ..problem }.solve(None).unwrap();
        assert!((0..2).all(|k| (known.slopes[k] - slopes[k]).abs() < 1e-8), "{known:?}");
        assert_eq!((known.albedo, known.covariance.0[5]), (albedo, 0.0));
    }
}

/// On level ground three equal suns have no preferred direction: both slopes are equally uncertain, independent of each other and of the
/// albedo. Twice the noise is four times the covariance.
#[test]
fn val_a_level_cell_has_an_even_uncertainty() {
    let photometry = Photometry::default();
    let of = |sigma: f64| {
        let samples = samples([0.0; 2], 0.3, sigma);
        Problem { photometry: &photometry, samples: &samples, prior: None, fixed_albedo: None }.solve(None).unwrap()
    };
    let (one, two) = (of(0.01), of(0.02));
    let [pp, pq, pa, qq, qa, aa] = one.covariance.0;
    assert!((pp / qq - 1.0).abs() < 1e-6 && pq.abs() < 1e-6 * pp, "{one:?}");
    assert!(pa.abs().max(qa.abs()) < 1e-6 * (pp * aa).sqrt() && one.albedo_slope_correlation() < 1e-6, "{one:?}");
    assert!((two.covariance.0[0] / pp - 4.0).abs() < 1e-6 && (two.covariance.0[5] / aa - 4.0).abs() < 1e-6);
    assert!((two.condition / one.condition - 1.0).abs() < 1e-6, "the condition does not depend on the noise");
    // The variance of the albedo of three suns: `sigma^2 / (3 S^2)`, with the brightness S of level ground of albedo 1.
    let shade = 0.35 * 0.5f64.sqrt() + 1.3 * 0.5f64.sqrt() / (1.0 + 0.5f64.sqrt());
    assert!((aa / (0.0001 / (3.0 * shade * shade)) - 1.0).abs() < 1e-6, "{aa}");
}

/// A cell lit in one image keeps its prior where the image does not contradict it, and has its uncertainty across the sun.
#[test]
fn val_a_dark_cell_keeps_its_prior() {
    let photometry = Photometry::default();
    let all = samples([0.1, 0.2], 0.3, 1e-3);
    let prior = Some(Prior { albedo: [0.3, 1e-6], slopes: [0.1, 0.2], slope_sigma: 0.3 });
    let problem = Problem { photometry: &photometry, samples: &all[..1], prior, fixed_albedo: None };
    let fit = problem.solve(None).unwrap();
    assert!((fit.slopes[0] - 0.1).abs() < 1e-8 && (fit.slopes[1] - 0.2).abs() < 1e-8, "{fit:?}");
    // The sun in the north determines the slope to the north alone.
    assert!(fit.covariance.0[3] < 0.01 * fit.covariance.0[0], "{fit:?}");
    assert!(fit.covariance.0[0] <= 0.09 * (1.0 + 1e-9), "{fit:?}");
}

/// The larger of the relative change of an exposure and the change of a haze over its exposure.
#[test]
fn val_drift_is_the_largest_change() {
    let of = |exposure: f64, haze: f64| Calibration { exposure, haze };
    let before = [of(1.0, 0.02), of(2.0, 0.0)];
    assert!(near(calibration::drift(&before, &[of(0.9, 0.02), of(2.0, 0.0)]), 0.1));
    assert!(near(calibration::drift(&before, &[of(1.0, 0.02), of(2.0, -0.3)]), 0.15));
    assert_eq!(calibration::drift(&before, &before), 0.0);
}

#[test]
fn val_coverage_counts_errors_of_either_sign() {
    assert_eq!(coverage(&[1.0, -2.0, 3.0, -5.0], &[2.0; 4], 1.0), 0.5);
    assert_eq!(coverage(&[1.0, -2.0, 3.0, -5.0], &[2.0; 4], 2.0), 0.75);
}
