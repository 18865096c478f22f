//! No crater or rock is added that the DEM or images would have shown.

use super::*;
use crate::elaborate::bounds::Bound;

fn window() -> Value {
    json!({"origin_m": [104.0, 204.0], "size_px": [120, 120]})
}

fn with(extra: Value) -> Value {
    let mut all = window();
    all.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
    all
}

/// Rocks and craters, with a largest diameter of both.
fn up_to(diameter_max_m: f64) -> Value {
    json!([
        {"kind": "rocks", "coverage": 0.3, "diameter_max_m": diameter_max_m},
        {"kind": "primary_craters", "density": 0.05, "diameter_min_m": 0.3, "diameter_max_m": diameter_max_m},
        {
            "kind": "secondary_craters", "density": 0.05, "diameter_min_m": 0.3, "diameter_max_m": diameter_max_m,
            "primary_min_m": 8.0, "largest_ratio": 0.9
        }
    ])
}

/// The widest rock in a window of the world that refines a site, m.
fn widest_rock_m(images: Value) -> f64 {
    let mut raw = json!({"dem": "site", "cell_m": 0.16, "basic_spacing_m": 0.01, "processes": up_to(50.0)});
    raw.as_object_mut().unwrap().extend(images.as_object().unwrap().clone());
    let own = Elaborate::try_from(crate::registry::read::<RawElaborate>(&raw).unwrap()).unwrap();
    let inputs = [site(24, 24, [1.28, 1.28]).into()];
    let sorted = own.sorted(&inputs).unwrap();
    let basis = own.basis(&sorted, own.points(&sorted).unwrap()).unwrap();
    let world = own.model(&streams(), Arc::new(basis), |_| true).world;
    let area = Window { zoom: 0, west: 0, south: 0, cols: 20_000, rows: 20_000, centred: false };
    let rocks = world.rocks.as_ref().unwrap().0.find(&area, 0.0, None, |_| 0.3);
    assert!(rocks.len() > 1000);
    rocks[0].diameter_m
}

/// No rock is wider than two posts or the given number of pixels; over 40 000 m2 the widest come close to the bound.
#[test]
fn val_no_rock_is_wider_than_the_bound() {
    for (images, bound_m) in [
        (json!({}), 2.56),
        (json!({"image_resolution_m": 0.25}), 0.5),
        (json!({"image_resolution_m": 0.25, "image_pixels": 4.0}), 1.0),
        (json!({"image_resolution_m": 3.0}), 2.56),
    ] {
        let widest_m = widest_rock_m(images.clone());
        assert!(widest_m <= bound_m && widest_m > 0.9 * bound_m, "{images}: {widest_m} m");
    }
}

/// The bound acts as a largest diameter of every process, and is stated in a note.
#[test]
fn prop_a_bound_is_a_largest_diameter() {
    let dem = site(24, 24, [1.28, 1.28]);
    let bounded = refined(with(json!({"image_resolution_m": 0.4, "processes": up_to(50.0)})), &dem);
    let narrow = refined(with(json!({"processes": up_to(0.8)})), &dem);
    let wide = refined(with(json!({"processes": up_to(50.0)})), &dem);
    assert!(bounded.heights == narrow.heights && bounded.maps == narrow.maps);
    assert!(bounded.heights != wide.heights);
    let note = |made: &Terrain| made.notes.iter().find(|n| n.contains("craters and rocks")).cloned().unwrap();
    assert!(note(&bounded).contains("at most 0.800 m wide: images with 0.4 m pixels (2 pixels)"), "{}", note(&bounded));
    assert!(note(&wide).contains("at most 2.560 m wide: the DEM, with posts 1.280 m apart"), "{}", note(&wide));
    assert!(errors_at_posts(&bounded.heights, &dem, 100) < 1e-6);
}

/// Diameters that images would show are refused before anything is generated.
#[test]
fn val_diameters_above_the_bound_are_refused() {
    let refused = |extra: Value| {
        let mut all = json!({"dem": "a", "processes": [{"kind": "albedo"}, {"kind": "rocks", "diameter_min_m": 0.3}]});
        all.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        crate::prepare(KIND, &all).err().map(|e| (e.key.clone(), e.to_string()))
    };
    let (key, words) = refused(json!({"image_resolution_m": 0.1})).unwrap();
    assert!(key == "processes.1.diameter_min_m" && words.contains("wider than 0.2 m"), "{key}: {words}");
    assert_eq!(refused(json!({"image_resolution_m": 0.15})), None);
    for (key, bad) in [
        ("image_resolution_m", json!({"image_resolution_m": 0.0})),
        ("image_resolution_m", json!({"image_resolution_m": -0.3})),
        ("image_pixels", json!({"image_resolution_m": 0.3, "image_pixels": 0.5})),
        ("altimetry_points_m.1", json!({"altimetry_points_m": [[1.0, 2.0, 3.0], [1.0, 2.0]]})),
        ("altimetry", json!({"altimetry": ""})),
        ("albedo", json!({"albedo": ""})),
    ] {
        assert_eq!(refused(bad.clone()).map(|e| e.0).as_deref(), Some(key), "{bad}");
    }
    assert_eq!(Bound::Posts(1.0).and(Some(Bound::Pixels(1.0, 2.0))), Bound::Posts(1.0));
}

/// Two posts, or the given number of pixels; a process may start at the bound but not above it, and narrower ones stay as they are.
#[test]
fn val_bounds_by_hand() {
    assert_eq!((Bound::Posts(1.28).most_m(), Bound::Pixels(0.25, 3.0).most_m()), (2.56, 0.75));
    assert_eq!(Bound::Posts(1.0).and(Some(Bound::Pixels(0.5, 3.0))), Bound::Pixels(0.5, 3.0));
    let list = |low: f64, high: f64| -> Vec<planetary::RawProcess> {
        let rocks = json!([{"kind": "albedo"}, {"kind": "rocks", "diameter_min_m": low, "diameter_max_m": high}]);
        serde_json::from_value(rocks).unwrap()
    };
    let bounded = |low, high| Bound::Posts(1.0).apply(&list(low, high));
    assert_eq!(bounded(0.1, 5.0), Ok(list(0.1, 2.0)));
    assert_eq!(bounded(2.0, 5.0), Ok(list(2.0, 2.0)));
    assert_eq!(bounded(0.1, 1.5), Ok(list(0.1, 1.5)));
    assert_eq!(bounded(2.1, 5.0), Err((1, 2.1)));
    assert_eq!(Bound::Posts(1.0).note(&list(0.1, 1.5)[..1]), None);
}
