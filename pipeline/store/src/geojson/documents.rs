//! GeoJSON documents for tests: polygons in every kind of object, most of them valid, the others with one damage whose refusal is known.

use super::polygons::Polygon;
use proptest::prelude::*;
use proptest::sample::Index;
use serde_json::{Value, json};

/// A document, and what a reader must make of it.
#[derive(Clone, Debug)]
pub(crate) struct Document {
    /// The document.
    pub text: String,
    /// Its polygons, or words of the refusal.
    pub expected: Result<Vec<Polygon>, &'static str>,
}

/// What is wrong with a document.
#[derive(Clone, Copy, Debug)]
enum Damage {
    Nothing,
    Cut(Index),
    TwoCorners,
    TextForNumber,
    NumberForRings,
    UnknownKind,
}

/// The object that holds the polygons.
#[derive(Clone, Copy, Debug)]
enum Holder {
    /// The first polygon alone.
    Polygon,
    /// A MultiPolygon in a Feature.
    Feature,
    /// A Feature for each polygon, after one without a geometry.
    Collection,
}

/// Documents with up to 3 polygons of up to 3 rings, closed or not, within 1000 km of the origin.
pub(crate) fn documents() -> impl Strategy<Value = Document> {
    let ring = (prop::collection::vec(prop::array::uniform2(-1e6..1e6f64), 3..7), any::<bool>());
    let ring = ring.prop_map(|(mut ring, closed)| {
        let first = ring[0];
        ring.extend(closed.then_some(first));
        ring
    });
    let polygons = prop::collection::vec(prop::collection::vec(ring, 1..4), 1..4);
    let holder = prop::sample::select(vec![Holder::Polygon, Holder::Feature, Holder::Collection]);
    let damage = prop_oneof![
        5 => Just(Damage::Nothing),
        1 => any::<Index>().prop_map(Damage::Cut),
        1 => Just(Damage::TwoCorners),
        1 => Just(Damage::TextForNumber),
        1 => Just(Damage::NumberForRings),
        1 => Just(Damage::UnknownKind),
    ];
    (polygons, holder, damage).prop_map(|(polygons, holder, damage)| document(polygons, holder, damage))
}

fn document(mut polygons: Vec<Polygon>, holder: Holder, damage: Damage) -> Document {
    if matches!(holder, Holder::Polygon) {
        polygons.truncate(1);
    }
    let mut coordinates: Vec<Value> = polygons.iter().map(|polygon| json!(polygon)).collect();
    match damage {
        Damage::TwoCorners => coordinates[0][0] = json!([[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]]),
        Damage::TextForNumber => coordinates[0][0][1] = json!([1.0, "one"]),
        Damage::NumberForRings => coordinates[0] = json!(3),
        Damage::Nothing | Damage::Cut(_) | Damage::UnknownKind => {}
    }
    let text = held(coordinates, holder).to_string();
    let (text, expected) = match damage {
        Damage::Nothing => (text, Ok(polygons)),
        // The opening brace is kept, by which a text is recognised as GeoJSON.
        Damage::Cut(at) => (text[..1 + at.index(text.len() - 1)].to_owned(), Err("not GeoJSON: ")),
        Damage::TwoCorners => (text, Err("a ring of a polygon has 2 corners; it needs at least 3")),
        Damage::TextForNumber => (text, Err("a ring of a polygon is not a list of [x, y] positions")),
        Damage::NumberForRings => (text, Err("not a list")),
        Damage::UnknownKind => {
            (text.replacen("Polygon\"", "Pond\"", 1), Err("Pond; only Polygon and MultiPolygon are supported"))
        }
    };
    Document { text, expected }
}

fn held(mut polygons: Vec<Value>, holder: Holder) -> Value {
    let feature = |geometry: Value| json!({ "type": "Feature", "properties": { "id": 7 }, "geometry": geometry });
    let polygon = |coordinates: Value| json!({ "type": "Polygon", "coordinates": coordinates });
    match holder {
        Holder::Polygon => polygon(polygons.swap_remove(0)),
        Holder::Feature => feature(json!({ "type": "MultiPolygon", "coordinates": polygons })),
        Holder::Collection => {
            let features: Vec<Value> =
                [Value::Null].into_iter().chain(polygons.into_iter().map(polygon)).map(feature).collect();
            json!({ "type": "FeatureCollection", "features": features })
        }
    }
}
