use super::*;
use sastrugi_numeric::{Geometry, Streams};
use std::f64::consts::TAU;

/// A surface known everywhere: waves of all directions, lengths 1.5 to 30 m, slopes of some tens of degrees.
struct Terrain {
    waves: Vec<[f64; 4]>,
}

impl Terrain {
    fn new(shortest_m: f64) -> Self {
        let mut s = Streams::for_seed(4, "coregister-test").stream("waves");
        let wave = |_| {
            let length = shortest_m * libm::exp(s.uniform() * libm::log(30.0 / shortest_m));
            let (sin, cos) = libm::sincos(TAU * s.uniform());
            [TAU / length * cos, TAU / length * sin, TAU * s.uniform(), 0.02 * length]
        };
        Self { waves: (0..60).map(wave).collect() }
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        self.waves.iter().map(|[kx, ky, phase, height]| height * libm::sin(kx * x + ky * y + phase)).sum()
    }

    fn grid(&self, geometry: Geometry, moved: [f64; 2], noise: f64, name: &str) -> Grid {
        let mut s = Streams::for_seed(5, "coregister-test").stream(name);
        let value = |k: usize| {
            let (x, y) = (geometry.x(k % geometry.cols), geometry.y(k / geometry.cols));
            self.height(x - moved[0], y - moved[1]) + noise * s.normal()
        };
        Grid::new(geometry, (0..geometry.len()).map(value).collect())
    }
}

fn square() -> Geometry {
    Geometry { rows: 120, cols: 140, cell: [0.5; 2], origin: [1000.0, 2000.0] }
}

/// The shift that was made is the one that is undone, to 0.05 cells, from sub-cell to three cells, with and without noise of 3 cm.
#[test]
fn val_shifts_are_recovered() {
    let terrain = Terrain::new(2.5);
    for (moved, noise) in [([0.15, -0.2], 0.0), ([0.25, 0.25], 0.03), ([-1.5, 0.9], 0.0), ([1.2, 1.4], 0.03)] {
        let a = terrain.grid(square(), [0.0; 2], noise, "a");
        let b = terrain.grid(square(), moved, noise, "b");
        let c = coregister(&a, &b).unwrap().coregistration;
        let error = [0, 1].map(|k| (c.shift_m[k] + moved[k]) / 0.5);
        assert!(error.iter().all(|e| e.abs() < 0.05), "{moved:?}: {error:?} cells, {c:?}");
        assert!(c.converged && c.nmad_after_m < 0.5 * c.nmad_before_m, "{c:?}");
        println!(
            "{moved:?} noise {noise}: {error:?} cells, {} rounds, {:.4} -> {:.4}",
            c.iterations, c.nmad_before_m, c.nmad_after_m
        );
    }
}

/// Raise and tilt beside a shift; trees on A (5 % of the cells, 6 m high) change nothing; holes of either stay holes.
#[test]
fn val_raise_tilt_trees_and_holes() {
    let terrain = Terrain::new(2.5);
    let mut a = terrain.grid(square(), [0.0; 2], 0.02, "a");
    let mut b = terrain.grid(square(), [0.3, -0.4], 0.02, "b");
    let g = square();
    let centre = [0, 1].map(|k| g.origin[k] + 0.5 * g.size()[k]);
    for k in 0..g.len() {
        let (x, y) = (g.x(k % g.cols) - centre[0], g.y(k / g.cols) - centre[1]);
        b.values[k] += 4.0 + 0.01 * x - 0.02 * y;
    }
    let mut s = Streams::for_seed(6, "coregister-test").stream("trees");
    a.values.iter_mut().for_each(|z| *z += if s.uniform() < 0.05 { 6.0 } else { 0.0 });
    a.values[70 * 140 + 10] = f64::NAN;
    b.values[50 * 140 + 90] = f64::NAN;
    let found = coregister(&a, &b).unwrap();
    let c = &found.coregistration;
    assert!((c.shift_m[0] + 0.3).abs() < 0.025 && (c.shift_m[1] - 0.4).abs() < 0.025, "{c:?}");
    // The plane was added to B where it lay: moved back by the shift it is lower by tilt times shift.
    assert!((c.raise_m + 4.0).abs() < 0.03, "{c:?}");
    assert!((c.tilt[0] + 0.01).abs() < 5e-4 && (c.tilt[1] - 0.02).abs() < 5e-4, "{c:?}");
    assert!(found.difference.at(70, 10).is_nan());
    assert!((49..=51).any(|r| (89..=91).any(|col| found.difference.at(r, col).is_nan())));
    assert!(c.nmad_after_m < 0.05, "{c:?}");
}

/// B of other cells, origin and extent.
#[test]
fn val_grids_may_differ() {
    let terrain = Terrain::new(5.0);
    let a = terrain.grid(square(), [0.0; 2], 0.0, "a");
    let other = Geometry { rows: 90, cols: 75, cell: [0.7, 0.6], origin: [1007.3, 1996.1] };
    let b = terrain.grid(other, [0.4, -0.6], 0.0, "b");
    let found = coregister(&a, &b).unwrap();
    let c = &found.coregistration;
    assert!((c.shift_m[0] + 0.4).abs() < 0.025 && (c.shift_m[1] - 0.6).abs() < 0.025, "{c:?}");
    assert_eq!(found.difference.geometry, a.geometry);
    assert_eq!(found.difference.finite_count() as u64, c.cells);
    assert!(c.cells < 140 * 120);
}

#[test]
fn prop_threads_change_no_bit() {
    let terrain = Terrain::new(2.5);
    let (a, b) = (terrain.grid(square(), [0.0; 2], 0.1, "a"), terrain.grid(square(), [0.3, 0.1], 0.1, "b"));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| coregister(&a, &b).unwrap().coregistration)
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn val_what_cannot_be_laid_is_refused() {
    let terrain = Terrain::new(2.5);
    let a = terrain.grid(square(), [0.0; 2], 0.0, "a");
    let far = terrain.grid(Geometry { origin: [5000.0, 2000.0], ..square() }, [0.0; 2], 0.0, "b");
    let message = coregister(&a, &far).err().unwrap().to_string();
    assert!(message.contains("do not overlap") && message.contains("5000"), "{message}");
    let mut sparse = a.clone();
    sparse.values[90..].fill(f64::NAN);
    assert!(matches!(coregister(&a, &sparse).err(), Some(CoregisterError::TooFewCells { cells: 0..90 })));
    let flat = Grid::filled(square(), 3.0);
    assert_eq!(coregister(&flat, &flat).err(), Some(CoregisterError::Flat));
}
