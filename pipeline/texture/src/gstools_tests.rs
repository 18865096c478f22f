//! Golden file with the `gstools` block of fit files and the covariances of this crate: `tests/interop/check_gstools.py` loads the
//! blocks in GSTools and compares. Refresh: `SASTRUGI_REFRESH=1 cargo test --release -p sastrugi-texture gstools`.

use crate::covariance::{Covariance, Form};
use crate::fit::report::gstools;
use sastrugi_schemas::fit::FitFile;
use serde_json::{Value, json};

/// Every kind of model that the block can express, with parameters of different sizes.
const CASES: [(&str, &[(&str, f64)]); 7] = [
    ("exponential", &[("sigma_m", 0.12), ("range_m", 0.28)]),
    ("gaussian", &[("sigma_m", 3.0), ("range_m", 20.0)]),
    ("spherical+nugget", &[("sigma_m", 0.5), ("range_m", 1.7), ("nugget_m2", 0.03)]),
    ("matern", &[("sigma_m", 0.1), ("range_m", 0.4), ("smoothness", 0.8)]),
    ("matern+nugget", &[("sigma_m", 0.1), ("range_m", 0.4), ("smoothness", 2.3), ("nugget_m2", 0.002)]),
    ("anisotropic:exponential", &[("sigma_m", 0.2), ("range_m", 0.9), ("ratio", 0.35), ("azimuth_deg", 27.0)]),
    (
        "anisotropic:matern+nugget",
        &[
            ("sigma_m", 0.2),
            ("range_m", 0.9),
            ("smoothness", 1.4),
            ("nugget_m2", 0.01),
            ("ratio", 0.6),
            ("azimuth_deg", 141.0),
        ],
    ),
];

fn case(model: &str, parameters: &[(&str, f64)]) -> Value {
    let fit = FitFile {
        model: model.to_owned(),
        parameters: parameters.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect(),
        ..FitFile::default()
    };
    let covariance = Covariance::of_fit(&fit).unwrap();
    let range = covariance.range_m();
    let shares = [[0.0, 0.0], [0.01, 0.0], [0.0, 0.3], [0.4, 0.4], [-0.7, 0.5], [1.1, -0.2], [0.3, 2.0]];
    let lags: Vec<[f64; 2]> = shares.iter().map(|s| s.map(|v| v * range)).collect();
    let values: Vec<f64> = lags.iter().map(|&lag| covariance.at(lag)).collect();
    let block = gstools(&Form::parse(model).unwrap(), &covariance);
    json!({ "model": model, "parameters": fit.parameters, "gstools": block, "lags_m": lags, "covariance_m2": values })
}

#[test]
fn gold_gstools_blocks() {
    let all: Vec<Value> = CASES.iter().map(|(model, parameters)| case(model, parameters)).collect();
    let text = serde_json::to_string_pretty(&all).unwrap() + "\n";
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/golden/gstools.json");
    if std::env::var_os("SASTRUGI_REFRESH").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &text).unwrap();
    }
    assert_eq!(std::fs::read_to_string(path).unwrap(), text);
}

#[test]
fn val_models_that_gstools_lacks_have_no_block() {
    for (model, parameters) in [
        ("self_affine", vec![("increment_1m_m", 0.1), ("hurst", 0.7)]),
        ("exponential+gaussian", vec![("sigma_m", 0.1), ("range_m", 0.3), ("sigma_2_m", 0.1), ("range_2_m", 1.0)]),
    ] {
        assert_eq!(case(model, &parameters)["gstools"], Value::Null);
    }
}
