//! Invalid parameters are refused under the right key.

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
        ("origin_m", json!({"origin_m": [10000.01, 0.0]})),
        ("origin_m", json!({"origin_m": [1e15, 0.0]})),
        ("origin_m", json!({"origin_m": [0.0, 4.6e13], "cell_m": 0.01})),
        ("origin_m", json!({"origin_m": [1e18, 0.0], "cell_m": 1e15})),
        ("origin_m", json!({"origin_m": [81.92 * (1u64 << 51) as f64, 0.0], "cell_m": 81.92, "basic_spacing_m": 0.01})),
        ("origin_m", json!({"cell_m": 0.0125 * (1u64 << 55) as f64})),
        ("origin_m", json!({"cell_m": 1e300, "processes": []})),
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
        ("density", json!({"kind": "primary_craters", "density": 1.7})),
        ("density", json!({"kind": "secondary_craters", "density": 5.0})),
        ("exponent", json!({"kind": "primary_craters", "exponent": 1e3})),
        ("exponent", json!({"kind": "primary_craters", "exponent": 0.01})),
        ("smallest_share", json!({"kind": "secondary_craters", "smallest_share": 1e-9})),
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
        ("diameter_max_m", json!({"kind": "rocks", "diameter_max_m": 1e5})),
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
    let misspelt = crate::prepare(KIND, &process(json!({"kind": "texture", "hirst": 0.5}))).err().unwrap();
    assert!(misspelt.message.contains("`hirst`"), "{misspelt}");
}

/// Too many craters and rocks to examine.
#[test]
fn val_excessive_work_is_refused() {
    let crowded = json!({
        "cell_m": 0.64, "basic_spacing_m": 0.01, "size_px": [16000, 16000],
        "processes": [{"kind": "primary_craters", "density": 0.5, "diameter_min_m": 0.05}, {"kind": "rocks"}]
    });
    assert_eq!(refused(crowded), "processes");
    // Every tile examines the tens of thousands of secondaries around each wide crater again.
    let families = |side: u32| {
        json!({
            "cell_m": 0.02, "size_px": [side, side],
            "processes": [{"kind": "primary_craters", "density": 0.16}, {"kind": "secondary_craters", "per_primary": 100_000}]
        })
    };
    assert!(crate::prepare(KIND, &families(256)).is_ok());
    assert_eq!(refused(families(16_000)), "processes");
}

/// Mean numbers that are NaN.
#[test]
fn val_densities_beyond_double_precision_are_refused() {
    let tiny = json!({
        "cell_m": 1e-300, "basic_spacing_m": 1e-300,
        "processes": [{"kind": "primary_craters", "exponent": 20.0, "diameter_min_m": 1e-299, "diameter_max_m": 1e-298}]
    });
    assert_eq!(refused(tiny), "processes.0.density");
}

/// Stated memory includes the craters and rocks of every active tile.
#[test]
fn val_memory_grows_with_the_objects() {
    let of = |per_primary: u32| {
        let processes = json!([{"kind": "primary_craters"}, {"kind": "secondary_craters", "per_primary": per_primary}]);
        let params = json!({"cell_m": 0.02, "size_px": [512, 512], "processes": processes});
        crate::prepare(KIND, &params).unwrap().memory_bytes()
    };
    let (none, few, many) = (of(0), of(1000), of(100_000));
    assert!(many > 10 * few && few > none && none < 200 << 20, "{none} {few} {many}");
}

/// A coverage of 0 gives no rocks and is not an error; an empty list gives a plain; an empty window gives an empty patch.
#[test]
fn val_empty_worlds_and_windows_are_valid() {
    let bare = world(json!([{"kind": "rocks", "coverage": 0.0}]), 1).patch(&window(0, 0, 0, 50, 50));
    assert!(bare.class.iter().all(|c| *c == 0) && bare.heights.iter().all(|z| *z == 0.0));
    assert!(world(json!([]), 1).patch(&window(4, 0, 0, 9, 9)).heights.iter().all(|z| *z == 0.0));
    let full = world(everything(), 1);
    for (cols, rows) in [(0, 0), (0, 5), (5, 0)] {
        let none = window(3, 7, -7, cols, rows);
        assert!(full.patch(&none).heights.is_empty() && full.tiled_patch(&none).class.is_empty());
    }
}
