//! Surfaces that no model of the covariance describes: fits end, and their files can be read.

use super::*;
use sastrugi_schemas::fit::FitFile;

/// Cells of a side, and windows of 17 cells.
const CELLS: usize = 96;
const OUTER_SCALE_M: f64 = 1.0;

/// A surface of `height(column, row, noise)` m, of which the noise is standard normal.
fn surface(height: impl Fn(f64, f64, f64) -> f64) -> Grid {
    let mut s = Streams::for_seed(5, "hostile").stream("cells");
    let heights = (0..CELLS * CELLS).map(|k| height((k % CELLS) as f64, (k / CELLS) as f64, s.normal())).collect();
    Grid::new(Geometry::square(CELLS, CELLS, CELL_M), heights)
}

/// A surface with an exponential one of this sigma on it.
fn rough(sigma_m: f64, height: impl Fn(f64, f64) -> f64) -> Grid {
    let mut dem = field(0.2, CELLS, CELL_M, 7);
    let heights =
        dem.values.iter().enumerate().map(|(k, z)| height((k % CELLS) as f64, (k / CELLS) as f64) + sigma_m * z);
    dem.values = heights.collect();
    dem
}

fn few_values() -> Grid {
    let mut dem = field(0.28, CELLS, CELL_M, 2);
    let mut s = Streams::for_seed(6, "hostile").stream("cells");
    dem.values.iter_mut().filter(|_| s.uniform() < 0.45).for_each(|z| *z = f64::NAN);
    dem
}

fn anisotropic() -> Grid {
    let parameters = [("sigma_m", 0.1), ("range_m", 2.0), ("ratio", 0.1), ("azimuth_deg", 30.0)];
    field_of(&covariance("anisotropic:gaussian", &parameters), CELLS, 3)
}

/// Slopes, spikes, steps, waves, gaps and grooves.
fn hostile() -> Vec<(&'static str, Grid)> {
    let steps = |c: f64, r: f64| (c / 23.0).floor() + 0.3 * ((c + r) / 31.0).floor();
    let waves = |c: f64, r: f64| libm::sin(0.021 * c + 0.4) + 0.5 * libm::sin(0.017 * r);
    vec![
        ("white slope", surface(|c, r, noise| 0.05 * c - 0.02 * r + 1e-3 * noise)),
        ("slope", rough(1e-3, |c, r| 0.05 * c - 0.02 * r)),
        ("spike", rough(1e-4, |c, r| if c == 40.0 && r == 50.0 { 1e4 } else { 0.0 })),
        ("steps", surface(|c, r, _| steps(c, r))),
        ("one step", surface(|c, _, _| f64::from(u8::from(c > 48.0)))),
        ("rough steps", surface(|c, r, noise| steps(c, r) + 1e-3 * noise)),
        ("long waves", surface(|c, r, _| waves(c, r))),
        ("noisy waves", surface(|c, r, noise| waves(c, r) + 1e-5 * noise)),
        ("few values", few_values()),
        ("anisotropic", anisotropic()),
    ]
}

fn fitted(dem: &Grid, model: &str, find_objects: bool) -> Result<FitFile, FitError> {
    let parameters = FitParameters {
        outer_scale_m: OUTER_SCALE_M,
        model: model.to_owned(),
        bootstrap: 0,
        find_objects,
        ..FitParameters::default()
    };
    fit(dem, &parameters.try_into().unwrap(), &streams()).map(|outcome| outcome.fit)
}

/// The covariance of a surface of which the window leaves a millionth is as finite as any other, and a fixed share of the variance:
/// trimming, far beyond such a residual, has no effect on it.
#[test]
fn val_a_model_that_the_window_almost_removes_is_finite() {
    let dem = field(0.28, CELLS, CELL_M, 1);
    let s = settings(Mode::Corrected, OUTER_SCALE_M, 0.05);
    let case = Case::new(&dem, &s).unwrap();
    for bins in [case.bins.clone(), case.bins_of(Layout::DIRECTIONAL)] {
        let estimator = Estimator::rough(&case, &bins);
        let share = |sigma_m: f64| -> Vec<f64> {
            let model = covariance("gaussian", &[("sigma_m", sigma_m), ("range_m", 20.0 * OUTER_SCALE_M)]);
            estimator.mean(&model).iter().map(|m| m / (sigma_m * sigma_m)).collect()
        };
        let expected = share(1.0);
        assert!(expected[0] > 0.0 && expected[0] < 1e-5, "{expected:?}");
        for sigma_m in [1e-2, 1e-4, 1e-8] {
            let found = share(sigma_m);
            let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-6 * expected[0];
            assert!(found.iter().zip(&expected).all(is_near), "{sigma_m}: {found:?} {expected:?}");
        }
    }
}

/// A step whose rim is taken as objects is flat on both sides: the refusal names the cells that were left out, and how to keep them.
#[test]
fn val_cells_left_out_of_a_flat_surface_are_named() {
    let step = surface(|c, _, _| f64::from(u8::from(c > 48.0)));
    let refused = fitted(&step, "exponential", true).err().unwrap();
    assert!(matches!(refused, FitError::Constant { objects: 1.., .. }), "{refused}");
    let told = refused.to_string();
    assert!(told.starts_with("apart from ") && told.ends_with("set find_objects = false"), "{told}");
    assert!(fitted(&step, "exponential", false).is_ok());
}

/// Fits each surface with a model, with or without the search for objects: the fit is refused, or its file is read back as it was written.
fn check_files(cases: Vec<(&'static str, Grid, &str, bool)>) {
    let is_fitted = |(name, dem, model, find_objects): (&str, Grid, &str, bool)| {
        let found = match fitted(&dem, model, find_objects) {
            Ok(found) => found,
            Err(refused) => {
                println!("{name}, {model}: {refused}");
                return false;
            }
        };
        let text = serde_json::to_string(&found).unwrap();
        let back: FitFile = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{name}, {model}: {e}\n{text}"));
        assert_eq!(serde_json::to_string(&back).unwrap(), text, "{name}, {model}");
        true
    };
    let tried = cases.len();
    let count = cases.into_par_iter().map(is_fitted).filter(|fitted| *fitted).count();
    println!("{count} of {tried} surfaces were fitted");
    assert!(2 * count > tried, "{count}");
}

/// Of a smooth model, whose ranges end far beyond the window.
#[test]
fn prop_fit_files_of_hostile_surfaces_are_read_back() {
    check_files(hostile().into_iter().map(|(name, dem)| (name, dem, "gaussian", true)).collect());
}

/// The same with all models: `auto` tries nine.
#[test]
#[ignore = "slow: ./test --full"]
fn prop_fit_files_of_all_models_are_read_back() {
    // Side by side: the surfaces differ much in time.
    let tried = [("exponential,matern,gaussian", false), ("auto", false), ("auto", true)];
    tried.into_par_iter().for_each(|(model, find_objects)| {
        check_files(hostile().into_iter().map(|(name, dem)| (name, dem, model, find_objects)).collect());
    });
}
