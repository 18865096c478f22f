use super::*;
use crate::size::Size;
use sastrugi_numeric::sums;

/// Point by point, unlike the row-wise [`sum`].
impl Perlin {
    /// The noise at a point, in lattice cells.
    fn at(&self, x: f64, y: f64) -> f64 {
        let (line, place) = (self.line(y), Place::of(x));
        let node = |column| self.node(column, &line);
        blended(node(place.lattice), node(place.lattice.wrapping_add(1)), place.ahead, place.blend)
    }
}

fn drawn(seed: u64) -> Perlin {
    Perlin::draw(&mut Streams::for_seed(seed, "perlin-test").stream("lattice"))
}

/// Values of FastNoise 0.4.1 (evaluated in double precision, with its permutation for seed 1337), frozen.
#[test]
fn val_equals_fastnoise() {
    let noise = Perlin {
        permutation: [
            126, 26, 60, 40, 239, 145, 75, 108, 67, 106, 180, 51, 203, 88, 221, 191, 233, 130, 164, 8, 122, 117, 128,
            92, 68, 208, 200, 118, 54, 100, 98, 211, 28, 190, 39, 95, 198, 159, 220, 113, 237, 217, 93, 155, 132, 41,
            227, 91, 140, 11, 80, 147, 205, 71, 30, 101, 235, 206, 121, 83, 27, 44, 183, 29, 53, 146, 104, 77, 226, 69,
            219, 22, 115, 17, 218, 35, 144, 251, 212, 214, 151, 87, 181, 232, 125, 196, 158, 139, 74, 65, 123, 7, 254,
            136, 25, 222, 55, 238, 46, 6, 72, 64, 107, 47, 160, 241, 154, 49, 33, 24, 5, 131, 213, 194, 185, 31, 20,
            63, 207, 119, 143, 156, 34, 59, 204, 168, 142, 231, 216, 23, 161, 21, 225, 10, 188, 248, 0, 137, 172, 148,
            45, 43, 70, 176, 250, 153, 228, 246, 171, 57, 187, 244, 174, 2, 16, 14, 138, 229, 150, 73, 247, 243, 182,
            120, 90, 170, 15, 178, 255, 109, 141, 99, 245, 32, 38, 62, 202, 162, 56, 186, 167, 103, 169, 116, 13, 89,
            201, 111, 165, 133, 134, 195, 114, 199, 236, 48, 184, 78, 149, 18, 223, 86, 242, 152, 81, 127, 179, 173,
            97, 230, 252, 94, 197, 215, 105, 253, 175, 76, 193, 19, 112, 249, 3, 157, 84, 135, 166, 50, 129, 102, 58,
            79, 12, 209, 110, 96, 224, 66, 9, 52, 192, 4, 124, 177, 61, 37, 189, 85, 240, 1, 42, 210, 163, 234, 82, 36,
        ],
    };
    let table = [
        (-3.7000, 250.30, 0.4198259654400033),
        (9.9180, 242.99, 0.09161051493908046),
        (23.5360, 235.68, -0.7894058562375974),
        (37.1540, 228.37, -0.32058499840194443),
        (50.7720, 221.06, -0.1591256083602473),
        (64.3900, 213.75, -0.2565059140945425),
        (78.0080, 206.44, -0.261025289773121),
        (91.6260, 199.13, 0.4739203597946201),
        (105.2440, 191.82, -0.2357753137120875),
        (118.8620, 184.51, -0.43363132667587073),
        (132.4800, 177.20, 0.48703084566151345),
        (146.0980, 169.89, -0.09242223319922727),
        (159.7160, 162.58, -0.4971159271669754),
        (173.3340, 155.27, -0.4819696768055202),
        (186.9520, 147.96, 0.04088443875030265),
        (200.5700, 140.65, 0.048424222982621445),
        (214.1880, 133.34, 0.3023317443374538),
        (227.8060, 126.03, 0.22481738362325498),
        (241.4240, 118.72, 0.3918235568952347),
        (255.0420, 111.41, -0.042023032224192715),
    ];
    for (x, y, value) in table {
        assert!((noise.at(x, y) - value).abs() < 1e-14, "{x} {y}: {} {value}", noise.at(x, y));
    }
}

/// Rows of layers equal the noise point by point, even far from the world's origin.
#[test]
fn prop_rows_equal_their_points() {
    let streams = Streams::for_seed(5, "perlin-test");
    let layers = [("a", 2.7, 0.3), ("b", 0.11, 0.05)].map(|(name, w, a)| Layer::draw(&streams, name, w, a));
    let size = Size::check(None, Some([61, 37]), 0.1, [1, 1]).unwrap();
    for origin in [[0.0, 0.0], [-1234.5, 98_765.4]] {
        let frame = Frame::check(size, origin).unwrap();
        let rows = sum(&layers, &frame);
        for (k, z) in rows.values.iter().enumerate() {
            let (x, y) = (frame.x_m(k % 61), frame.y_m(k / 61));
            let at = |l: &Layer| l.amplitude * l.noise.at(l.cells(x, 0), l.cells(y, 1));
            assert_eq!(*z, at(&layers[0]) + at(&layers[1]), "{x} {y}");
        }
    }
}

/// Over 2 million points of 400 noises: RMS 0.249 +- 0.004, 99 % below 0.543 (to 0.01), magnitudes never above 1. The RMS of one
/// noise scatters by 0.01 with its permutation, that of 400 by 0.0005.
#[test]
fn stat_range_and_rms() {
    let mut values = Vec::new();
    for seed in 0..400 {
        let (noise, mut s) = (drawn(seed), Streams::for_seed(seed, "perlin-test").stream("points"));
        values.extend((0..5000).map(|_| noise.at(s.uniform_in(-256.0, 256.0), s.uniform_in(-256.0, 256.0))));
    }
    let rms = sums::mean(&values.iter().map(|v| v * v).collect::<Vec<_>>()).sqrt();
    assert!((rms - 0.249).abs() < 0.004 && (rms - MEAN_SQUARE.sqrt()).abs() < 0.003, "{rms}");
    values.sort_by(f64::total_cmp);
    assert!(values[0] >= -1.0 && values[values.len() - 1] <= 1.0);
    let high = sums::quantile_sorted(&values, 0.99);
    assert!((high - 0.543).abs() < 0.01, "{high}");
}

#[test]
fn val_zero_at_lattice_points_and_periodic() {
    let noise = drawn(1);
    for k in -40..40 {
        assert_eq!(noise.at(f64::from(k), f64::from(7 * k)), 0.0);
        let (x, y) = (0.37 + f64::from(k), 0.61 - f64::from(k));
        assert!((noise.at(x, y) - noise.at(x + 256.0, y - 512.0)).abs() < 1e-12);
    }
}

/// Value, slope and curvature are continuous across lattice lines: differences over h leave h times the third
/// derivative (below 300).
#[test]
fn val_smooth_across_cells() {
    let (noise, h) = (drawn(2), 1e-4);
    for k in 0..200 {
        let (edge, along) = (f64::from(k), 0.137 + 0.71 * f64::from(k));
        for at in [|n: &Perlin, e: f64, a: f64| n.at(e, a), |n: &Perlin, e: f64, a: f64| n.at(a, e)] {
            let z = |step: f64| at(&noise, edge + step * h, along);
            let (before, after) = (z(0.0) - z(-1.0), z(1.0) - z(0.0));
            assert!((after - before).abs() / h < 300.0 * h, "{k}");
            let (before, after) = (z(0.0) - 2.0 * z(-1.0) + z(-2.0), z(2.0) - 2.0 * z(1.0) + z(0.0));
            assert!((after - before).abs() / (h * h) < 600.0 * h + 1e-6, "{k}: {before} {after}");
        }
    }
}

/// Autocorrelation along an axis: `(int a a' int b^2 + int b b' int a^2) / (2 int a^2 int b^2)`, which is 0.959, 0.763, 0.477,
/// 0.283, -0.014 and -0.135 at 0.1 to 1 cells. 400 noises of 2000 pairs: standard error below 0.004 (half of it from the
/// permutations); bound at 6 standard errors.
#[test]
fn stat_autocorrelation() {
    let b = |t: f64| if t.abs() < 1.0 { 1.0 - quintic(t.abs()) } else { 0.0 };
    let product = |lag: f64, f: &dyn Fn(f64) -> f64| -> f64 {
        let step = 1e-3;
        (-1000..1000).map(|k| (f64::from(k) + 0.5) * step).map(|t| step * f(t) * f(t + lag)).sum()
    };
    for (lag, stated) in [(0.1, 0.959), (0.25, 0.763), (0.4, 0.477), (0.5, 0.283), (0.7, -0.014), (1.0, -0.135)] {
        let wanted =
            (product(lag, &|t| t * b(t)) * SQUARED_B + product(lag, &b) * SQUARED_A) / (2.0 * SQUARED_A * SQUARED_B);
        assert!((wanted - stated).abs() < 1e-3, "{lag}: {wanted}");
        let mut products = Vec::new();
        for seed in 0..400 {
            let (noise, mut s) = (drawn(seed), Streams::for_seed(seed, "perlin-test").stream("pairs"));
            products.extend((0..2000).map(|_| {
                let (x, y) = (256.0 * s.uniform(), 256.0 * s.uniform());
                noise.at(x, y) * noise.at(x + lag, y)
            }));
        }
        let found = sums::mean(&products) / MEAN_SQUARE;
        assert!((found - wanted).abs() < 0.024, "{lag}: {found} {wanted}");
    }
}

/// The spectrum integrates to the noise's variance, and its first moment gives Van Deusen's constant.
#[test]
fn val_spectrum() {
    let squares = |f: fn(f64) -> f64| 2.0 * integral(0.0, 1.0, |t| f(t) * f(t));
    assert!((squares(|t| 1.0 - quintic(t)) - SQUARED_B).abs() < 1e-6);
    assert!((squares(|t| t * (1.0 - quintic(t))) - SQUARED_A).abs() < 1e-6);
    assert!((MEAN_SQUARE.sqrt() - 0.2500).abs() < 1e-4, "{}", MEAN_SQUARE.sqrt());
    assert!((variance_between([0.0, 100.0]) / MEAN_SQUARE - 1.0).abs() < 1e-5);
    assert!((moment(0.0) / MEAN_SQUARE - 1.0).abs() < 1e-3, "{}", moment(0.0));
    let constant = moment(1.0) / libm::log(2.0);
    assert!((constant - 0.0351).abs() < 5e-5, "{constant}");
    assert!(variance_between([0.2, 0.4]) > 0.0 && variance_between([9.0, 10.0]) == 0.0);
}
