use super::*;
use crate::covariance::model;
use crate::synth::{Synthesis, Texture};
use serde_json::json;

fn covariance(name: &str, range_m: f64) -> Covariance {
    Covariance::new(model(name).unwrap(), 0.2, range_m).unwrap()
}

fn kernel(size_px: [u32; 2], covariance: &Covariance) -> Result<Cholesky, ParameterError> {
    let raw = json!({ "size_px": size_px, "cell_m": [0.1, 0.12] });
    let (of_tile, own) = tile::read::<CholeskyParameters>(&raw)?;
    let tile = Tile::check(of_tile, own.is_periodic())?;
    own.check(&tile)?;
    own.kernel(&tile, covariance, &covariance.clone().into())
}

/// `L L'` is the covariance matrix to 2e-9 of the variance (the jitter added to each cell), even if the last block is not
/// full or the matrix is singular to rounding.
#[test]
fn val_the_factor_reproduces_the_matrix() {
    for (size_px, name, tolerance) in
        [([10, 15], "exponential", 2e-9), ([12, 12], "gaussian", 2e-9), ([3, 2], "spherical", 2e-9)]
    {
        let made = kernel(size_px, &covariance(name, 0.8)).unwrap();
        let cells = made.tile.len();
        let factor = Factor::new(cells.div_ceil(BLOCK), |i, j| made.block(i, j));
        let unit = |k: usize| (0..cells).map(|i| if i == k { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
        let columns: Vec<Vec<f64>> = (0..cells).map(|k| factor.times(&unit(k))).collect();
        for (a, b) in (0..cells).flat_map(|a| (0..=a).map(move |b| (a, b))) {
            let found: f64 = columns.iter().map(|column| column[a] * column[b]).sum();
            let (dr, dc) = (
                (a / size_px[0] as usize) as f64 - (b / size_px[0] as usize) as f64,
                (a % size_px[0] as usize) as f64 - (b % size_px[0] as usize) as f64,
            );
            let wanted = made.covariance.at([0.1 * dc, -0.12 * dr]);
            assert!((found - wanted).abs() <= tolerance * 0.04, "{name} {a} {b}: {found} {wanted}");
        }
    }
}

#[test]
fn val_memory_is_stated_and_limited() {
    let error = kernel([200, 200], &covariance("exponential", 1.0)).err().unwrap().to_string();
    assert!(error.contains("12.8 GB") && error.contains("0.8 GB"), "{error}");
    let largest = kernel([100, 100], &covariance("exponential", 1.0)).unwrap();
    assert!((largest.cost().memory_bytes as f64 / 4.026e8 - 1.0).abs() < 0.01);
    assert!(largest.notes()[0].contains("0.403 GB"), "{:?}", largest.notes());
}

/// Results are identical to the bit for any number of threads.
#[test]
fn prop_threads_change_no_bit() {
    let (of_tile, own) = tile::read::<CholeskyParameters>(&json!({ "size_px": [17, 13] })).unwrap();
    let tile = Tile::check(of_tile, own.is_periodic()).unwrap();
    let texture = Texture::new(&tile, &own, covariance("exponential", 0.5).into()).unwrap();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| texture.generate(&Streams::for_seed(9, "texture")).unwrap().grid.values)
    };
    assert!(run(1).iter().zip(&run(4)).all(|(a, b)| a.to_bits() == b.to_bits()));
}
