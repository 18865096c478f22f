use super::documents::documents;
use super::*;
use crate::dem::Crs;
use crate::mask::{Obstacles, read_obstacles};
use proptest::prelude::*;
use sastrugi_numeric::Geometry;
use serde_json::{Map, Value, json};

fn written(crs: Option<&Crs>, routes: &[Route]) -> Result<Value, GeoJsonError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("routes.geojson");
    write_routes(&path, crs, routes)?;
    Ok(serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap())
}

fn route(positions: &[[f64; 3]]) -> Route {
    let properties = json!({ "route_id": "a-1", "cost": 12.5, "arrived": true });
    Route { positions: positions.to_vec(), properties: properties.as_object().unwrap().clone() }
}

fn obstacles_of(text: &str) -> Result<Obstacles, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("obstacles.geojson");
    std::fs::write(&path, text).unwrap();
    read_obstacles(&path, &Geometry::square(4, 4, 1.0)).map_err(|error| {
        assert!(error.unusable_input());
        error.to_string()
    })
}

#[test]
fn val_routes_are_lines_with_properties() {
    let routes = [route(&[[0.5, 1.0, 2.0], [3.0, -4.0, 5.25]]), route(&[[0.0; 3], [1.0; 3], [2.0; 3]])];
    let crs = Crs { epsg: Some(32633), ..Crs::default() };
    let found = written(Some(&crs), &routes).unwrap();
    assert_eq!(found["type"], "FeatureCollection");
    assert_eq!(found["crs"], json!({"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32633"}}));
    assert!(found["note"].as_str().unwrap().contains("not longitude and latitude on WGS 84"));
    let feature = &found["features"][0];
    assert_eq!(feature["geometry"], json!({"type": "LineString", "coordinates": [[0.5, 1.0, 2.0], [3.0, -4.0, 5.25]]}));
    assert_eq!(feature["properties"], json!({"route_id": "a-1", "cost": 12.5, "arrived": true}));
    assert_eq!(found["features"].as_array().unwrap().len(), 2);
}

/// Without an EPSG code there is no `crs`; WGS 84 gets the name that puts the longitude first.
#[test]
fn val_the_system_is_named_if_it_has_a_code() {
    let routes = [route(&[[0.0; 3], [1.0; 3]])];
    for crs in [None, Some(&Crs::default())] {
        assert!(written(crs, &routes).unwrap().get("crs").is_none());
    }
    let found = written(Some(&Crs::wgs84()), &routes).unwrap();
    assert_eq!(found["crs"]["properties"]["name"], "urn:ogc:def:crs:OGC:1.3:CRS84");
    assert_eq!(written(None, &[]).unwrap()["features"], json!([]));
}

#[test]
fn val_invalid_routes_are_refused() {
    for (positions, words) in [
        (vec![], "route 2 needs at least 2 positions, got 0"),
        (vec![[0.0; 3]], "route 2 needs at least 2 positions, got 1"),
        (vec![[0.0; 3], [0.0, f64::NAN, 0.0]], "route 2 contains NaN; every number must be finite"),
    ] {
        let refusal = written(None, &[route(&[[0.0; 3], [1.0; 3]]), route(&positions)]).unwrap_err();
        assert_eq!(refusal.to_string(), words);
    }
}

#[test]
fn val_obstacles_keep_their_rings() {
    let ring = "[[0, 0, 7], [2, 0, 7], [2, 2, 7], [0, 0, 7]]";
    let expected = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 0.0]];
    let hole = "[[1, 0.5], [1.5, 0.5], [1.5, 1], [1, 0.5]]";
    let polygon = format!("{{\"type\": \"Polygon\", \"coordinates\": [{ring}, {hole}]}}");
    let Obstacles::Polygons(found) = obstacles_of(&polygon).unwrap() else { panic!("polygons") };
    assert_eq!((found.len(), found[0].len(), &found[0][0]), (1, 2, &expected));
    // As GDAL does, an unclosed ring is accepted as it is.
    let open = "{\"type\": \"Polygon\", \"coordinates\": [[[0, 0], [2, 0], [2, 2]]]}";
    assert_eq!(obstacles_of(open).unwrap(), Obstacles::Polygons(vec![vec![expected[..3].to_vec()]]));
    let multi = format!("{{\"type\": \"MultiPolygon\", \"coordinates\": [[{ring}], [{ring}]]}}");
    let feature = format!("{{\"type\": \"Feature\", \"properties\": null, \"geometry\": {multi}}}");
    let collection = format!("{{\"type\": \"FeatureCollection\", \"features\": [{feature}]}}");
    assert_eq!(obstacles_of(&collection).unwrap(), Obstacles::Polygons(vec![vec![expected.clone()], vec![expected]]));
}

#[test]
fn val_unusable_obstacles_are_refused() {
    for (text, words) in [
        (
            "{\"type\": \"Polygon\", \"coordinates\": [[[0, 0], [1, 1]]]}",
            "a ring of a polygon has 2 corners; it needs at least 3 (the first may be repeated as the last)",
        ),
        ("{\"type\": \"Polygon\", \"coordinates\": [[[0, 0], [1, 1], [0, 0]]]}", "a ring of a polygon has 2 corners"),
        ("{\"type\": \"Polygon\", \"coordinates\": [[[0, 0]]]}", "a ring of a polygon has 1 corner;"),
        ("{\"type\": \"Polygon\", \"coordinates\": [[]]}", "a ring of a polygon has 0 corners"),
        ("{\"type\": \"Point\", \"coordinates\": [1, 2]}", "contains a Point; only Polygon and MultiPolygon"),
        ("{\"a\": 1}", "has no \"type\""),
        ("{no", "not GeoJSON"),
    ] {
        let refusal = obstacles_of(text).unwrap_err();
        assert!(refusal.contains(words) && refusal.contains("obstacles.geojson"), "{refusal}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Numbers are read back bit for bit.
    #[test]
    fn prop_numbers_are_read_back(positions in prop::collection::vec(prop::array::uniform3(prop::num::f64::NORMAL | prop::num::f64::ZERO), 2..6)) {
        let found = written(None, &[Route { positions: positions.clone(), properties: Map::new() }]).unwrap();
        let read: Vec<[f64; 3]> = serde_json::from_value(found["features"][0]["geometry"]["coordinates"].clone()).unwrap();
        let bits = |all: &[[f64; 3]]| all.as_flattened().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&read), bits(&positions));
    }

    /// The rings of an undamaged document are read back bit for bit; a damaged one is refused with the reason.
    #[test]
    fn prop_documents_are_read_back_or_refused_with_the_reason(document in documents()) {
        match (obstacles_of(&document.text), document.expected) {
            (Ok(found), Ok(polygons)) => prop_assert_eq!(found, Obstacles::Polygons(polygons)),
            (Err(message), Err(words)) => prop_assert!(message.contains(words), "{}", message),
            (found, expected) => prop_assert!(false, "found {:?}, expected {:?}", found, expected),
        }
    }
}
