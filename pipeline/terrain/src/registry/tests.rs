use super::*;
use crate::Input;
use sastrugi_numeric::{Geometry, Grid, Streams};
use serde_json::json;

#[test]
fn val_unknown_kinds_list_the_known_ones() {
    let error = prepare("fractal", &Value::Null).err().unwrap();
    assert_eq!(error.key, "kind");
    assert!(error.message.starts_with("`fractal` is not a terrain generator"), "{error}");
    for kind in kinds() {
        assert!(error.message.contains(&format!("`{}`", kind.kind)), "{}: {error}", kind.kind);
    }
}

/// Of two entries with the same name, the second would never be used.
#[test]
fn val_every_kind_has_its_own_name() {
    let mut names: Vec<&str> = kinds().iter().map(|kind| kind.kind).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), kinds().len(), "{names:?}");
    assert!(names.contains(&"multifractal"), "{names:?}");
}

/// Processor seconds of 1500 x 1500 cells on one thread, least of three calls of `terrain`, less 0.06 s per million cells for writing them
/// (for `cascade` also its map).
#[test]
fn val_estimates_are_within_a_factor_of_two_of_measured_times() {
    for (kind, measured_s) in [
        ("multifractal", 0.58),
        ("weierstrass_mandelbrot", 0.15),
        ("cascade", 1.20),
        ("mavs_perlin", 0.075),
        ("mavs_gaussian", 0.134),
        ("mavs_variable", 0.126),
        ("van_deusen", 0.152),
        ("ornstein_uhlenbeck", 0.129),
    ] {
        let generator = prepare(kind, &json!({ "size_px": [1500, 1500] })).unwrap();
        let ratio = generator.seconds() / measured_s;
        assert!((0.5..2.0).contains(&ratio), "{kind}: {ratio}");
    }
}

#[test]
fn val_part_of_a_layer_leaves_the_rest_at_its_defaults() {
    let generator = prepare("multifractal", &json!({"mid": {"sigma_px": 4.0}})).unwrap();
    let all = generator.parameters();
    assert_eq!(
        all["mid"],
        json!({"ridges": 32, "fractal_dimension": 2.45, "elevation_scale_m": 8e-8, "sigma_px": 4.0})
    );
    assert_eq!(all["size_px"], json!([1009, 1009]));
}

/// Parameters of a small surface of every kind, and its inputs.
fn small(kind: &str) -> (Value, Vec<Input>) {
    let mut params = json!({"size_m": [1.6, 1.2], "cell_m": 0.05});
    let mut inputs = Vec::new();
    if kind == "elaborate" {
        params["dem"] = json!("site");
        params["origin_m"] = json!([3.0, 3.0]);
        inputs.push(Grid::new(Geometry::square(9, 8, 1.0), (0..72).map(|k| f64::from(k * k % 7)).collect()).into());
    }
    (params, inputs)
}

#[test]
fn prop_parameters_read_back_to_the_same_generator() {
    for kind in kinds() {
        let (params, inputs) = small(kind.kind);
        let first = prepare(kind.kind, &params).unwrap();
        let second = prepare(kind.kind, &first.parameters()).unwrap();
        assert_eq!(first.kind(), kind.kind);
        assert_eq!(first.parameters(), second.parameters());
        assert_eq!(first.geometry(), second.geometry());
        assert_eq!((first.geometry().rows, first.geometry().cols), (24, 32), "{}", kind.kind);
        let streams = Streams::for_seed(1, "terrain");
        let made = first.generate(&streams, &inputs).unwrap();
        assert_eq!(made, second.generate(&streams, &inputs).unwrap());
        assert_eq!(made.heights.geometry, first.geometry());
        for map in &made.maps {
            assert_eq!(map.values.geometry, first.geometry(), "{} {}", kind.kind, map.name);
            assert!(!map.kind().description.is_empty(), "{} {}", kind.kind, map.name);
        }
    }
}

#[test]
fn val_unknown_parameters_and_non_tables_are_refused() {
    for kind in kinds() {
        let unknown = prepare(kind.kind, &json!({"sizes_px": [9, 9]})).err().unwrap();
        assert!(unknown.to_string().contains("sizes_px"), "{}: {unknown}", kind.kind);
        let list = prepare(kind.kind, &json!([1, 2])).err().unwrap();
        assert!(list.message.contains("must be a table of parameters"), "{}: {list}", kind.kind);
    }
    let nested = prepare("multifractal", &json!({"high": {"dimension": 2.3}})).err().unwrap();
    assert!(nested.to_string().contains("`dimension`"), "{nested}");
    assert_eq!(prepare("multifractal", &json!({"high": 2.3})).err().unwrap().key, "high");
}

#[test]
fn val_schemas_describe_every_parameter() {
    for kind in kinds() {
        let properties = kind.parameters["properties"].as_object().unwrap();
        assert!(properties.len() > 3, "{}", kind.kind);
        assert!(properties.values().all(|p| p["description"].is_string()), "{}", kind.kind);
        assert!(kind.parameters.get("required").is_none());
    }
}
