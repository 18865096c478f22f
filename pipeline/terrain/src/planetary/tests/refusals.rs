//! What is refused, and where the refusal points.

use super::*;

fn refused(params: Value) -> String {
    let error = crate::prepare(KIND, &params).err().unwrap();
    assert!(error.message.len() > 10 && !error.message.contains('\n'), "{error}");
    error.key
}

fn process(process: Value) -> Value {
    json!({"processes": [{"kind": "primary_craters"}, process]})
}

#[test]
fn val_bad_lattices_are_refused() {
    for (key, bad) in [
        ("cell_m", json!({"cell_m": 0.0})),
        ("cell_m", json!({"cell_m": -0.02})),
        ("cell_m", json!({"cell_m": 0.03, "basic_spacing_m": 0.01})),
        ("cell_m", json!({"cell_m": 0.005, "basic_spacing_m": 0.01})),
        ("basic_spacing_m", json!({"basic_spacing_m": 0.0})),
        ("basic_spacing_m", json!({"basic_spacing_m": -1.0})),
        ("size_m", json!({"size_m": [0.0, 1.0]})),
        ("size_px", json!({"size_px": [2, 2]})),
        ("anchor_level", json!({"anchor_level": 41})),
        ("origin_m", json!({"origin_m": [0.013, 0.0]})),
        ("origin_m", json!({"origin_m": [1e15, 0.0]})),
        ("origin_m", json!({"origin_m": [0.0, 4.6e13], "cell_m": 0.01})),
        ("origin_m", json!({"origin_m": [1e18, 0.0], "cell_m": 1e15})),
    ] {
        assert_eq!(refused(bad.clone()), key, "{bad}");
    }
}

#[test]
fn val_bad_processes_are_refused() {
    for (key, bad) in [
        ("hurst", json!({"kind": "texture", "hurst": 0.0})),
        ("hurst", json!({"kind": "texture", "hurst": 1.01})),
        ("roughness_m", json!({"kind": "texture", "roughness_m": -0.1})),
        ("exponent", json!({"kind": "primary_craters", "exponent": 0.0})),
        ("density", json!({"kind": "primary_craters", "density": -1.0})),
        ("density", json!({"kind": "primary_craters", "density": 1e3})),
        ("diameter_min_m", json!({"kind": "primary_craters", "diameter_min_m": 0.0})),
        ("diameter_min_m", json!({"kind": "primary_craters", "diameter_min_m": 0.03})),
        ("diameter_max_m", json!({"kind": "primary_craters", "diameter_max_m": 0.4})),
        ("diameter_max_m", json!({"kind": "primary_craters", "diameter_max_m": 1e12})),
        ("depth_ratio", json!({"kind": "primary_craters", "depth_ratio": 1.0})),
        ("exponent", json!({"kind": "secondary_craters", "exponent": -3.5})),
        ("ring_radii", json!({"kind": "secondary_craters", "ring_radii": [5.0, 4.0]})),
        ("primary_min_m", json!({"kind": "secondary_craters", "primary_min_m": 0.5})),
        ("coverage", json!({"kind": "rocks", "coverage": 0.61})),
        ("coverage", json!({"kind": "rocks", "coverage": -0.1})),
        ("diameter_min_m", json!({"kind": "rocks", "diameter_min_m": 0.001})),
        ("sand", json!({"kind": "albedo", "sand": 1.5})),
        ("cover", json!({"kind": "dust", "cover": -0.5})),
    ] {
        assert_eq!(refused(process(bad.clone())), format!("processes.1.{key}"), "{bad}");
    }
    let twice = json!({"processes": [{"kind": "rocks"}, {"kind": "rocks"}]});
    assert_eq!(refused(twice), "processes.1.kind");
    let orphans = json!({"processes": [{"kind": "secondary_craters"}]});
    assert_eq!(refused(orphans), "processes.0.per_primary");
    let unknown = crate::prepare(KIND, &json!({"processes": [{"kind": "volcano"}]})).err().unwrap();
    assert!(unknown.message.contains("`secondary_craters`"), "{unknown}");
    assert!(crate::prepare(KIND, &process(json!({"kind": "texture", "hirst": 0.5}))).is_err());
}

/// Too many craters and rocks to look at.
#[test]
fn val_endless_work_is_refused() {
    let crowded = json!({
        "cell_m": 0.64, "basic_spacing_m": 0.01, "size_px": [16000, 16000],
        "processes": [{"kind": "primary_craters", "density": 0.5, "diameter_min_m": 0.05}, {"kind": "rocks"}]
    });
    assert_eq!(refused(crowded), "processes");
}

/// No rocks is a coverage of 0, not an error; an empty list is a plain.
#[test]
fn val_nothing_is_possible() {
    let bare = world(json!([{"kind": "rocks", "coverage": 0.0}]), 1).patch(&window(0, 0, 0, 50, 50));
    assert!(bare.class.iter().all(|c| *c == 0) && bare.heights.iter().all(|z| *z == 0.0));
    assert!(world(json!([]), 1).patch(&window(4, 0, 0, 9, 9)).heights.iter().all(|z| *z == 0.0));
}
