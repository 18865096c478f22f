//! Landing page, collections and tile sets of OGC API - Tiles.

use super::service::Service;
use super::{Base, On, Plain, Problem, Segments};
use crate::collections::Collection;
use crate::grid::TILE;
use axum::Json;
use axum::extract::State;
use serde_json::{Value, json};
use std::sync::Arc;

/// Pixel size that scale denominators refer to, m.
const STANDARD_PIXEL_M: f64 = 0.00028;
const JSON: &str = "application/json";
/// Media type of the API description.
pub const OPENAPI: &str = "application/vnd.oai.openapi+json;version=3.1";
/// Conformance classes that the server implements.
const CONFORMANCE: [&str; 7] = [
    "http://www.opengis.net/spec/ogcapi-common-1/1.0/conf/core",
    "http://www.opengis.net/spec/ogcapi-common-1/1.0/conf/landing-page",
    "http://www.opengis.net/spec/ogcapi-common-1/1.0/conf/json",
    "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/core",
    "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/tileset",
    "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/tilesets-list",
    "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/png",
];
/// Link relation: the tile sets of a map.
const MAP_TILESETS: &str = "http://www.opengis.net/def/rel/ogc/1.0/tilesets-map";
/// Link relation: the conformance classes. Clients of the first drafts look for the plain word.
const CONFORMANCE_RELATION: &str = "http://www.opengis.net/def/rel/ogc/1.0/conformance";
const SCHEME: &str = "http://www.opengis.net/def/rel/ogc/1.0/tiling-scheme";
const SCHEMES: &str = "http://www.opengis.net/def/rel/ogc/1.0/tiling-schemes";

fn link(href: String, rel: &str, media: &str, title: &str) -> Value {
    json!({ "href": href, "rel": rel, "type": media, "title": title })
}

/// `GET /v1`
pub async fn landing(State(service): State<Arc<Service>>, _: Plain, Base(base): Base) -> Json<Value> {
    let v1 = format!("{base}/v1");
    Json(json!({
        "title": "sastrugi terrain server",
        "description": "Patches of terrain at any place and resolution, and map tiles",
        "collections": service.collections.len(),
        "links": [
            link(v1.clone(), "self", JSON, "this page"),
            link(format!("{v1}/openapi.json"), "service-desc", OPENAPI, "API description"),
            link(format!("{v1}/conformance"), CONFORMANCE_RELATION, JSON, "conformance classes"),
            link(format!("{v1}/conformance"), "conformance", JSON, "conformance classes"),
            link(format!("{v1}/collections"), "data", JSON, "worlds and rasters"),
            link(format!("{v1}/tileMatrixSets"), SCHEMES, JSON, "tile matrix sets"),
        ],
    }))
}

/// `GET /v1/conformance`
pub async fn conformance(_: Plain) -> Json<Value> {
    Json(json!({ "conformsTo": CONFORMANCE }))
}

/// `GET /v1/collections`
pub async fn collections(
    State(service): State<Arc<Service>>,
    _: Plain,
    Base(base): Base,
) -> Result<Json<Value>, Problem> {
    let own = Arc::clone(&service);
    let describe = move || {
        let all: Vec<Value> = own.collections.values().map(|c| described(c, &base)).collect();
        let links = [link(format!("{base}/v1/collections"), "self", JSON, "this list")];
        Ok(Json(json!({ "collections": all, "links": links })))
    };
    service.blocking(describe).await
}

/// `GET /v1/collections/{id}`
pub async fn collection(
    State(service): State<Arc<Service>>,
    On(collection): On,
    _: Plain,
    Base(base): Base,
) -> Result<Json<Value>, Problem> {
    service.blocking(move || Ok(Json(described(&collection, &base)))).await
}

fn described(collection: &Collection, base: &str) -> Value {
    let id = &collection.id;
    let own = format!("{base}/v1/collections/{id}");
    let mut all = collection.describe();
    let mut links = vec![link(own.clone(), "self", JSON, id)];
    for layer in collection.layers() {
        links.push(link(format!("{own}/styles/{layer}/map/tiles"), MAP_TILESETS, JSON, layer));
    }
    if let Value::Object(all) = &mut all {
        all.insert("links".to_owned(), json!(links));
        let [west, south, east, north] = collection.grid().bounds_m();
        let plane = format!("urn:sastrugi:plane:{id}");
        all.insert("extent".to_owned(), json!({ "spatial": { "bbox": [[west, south, east, north]], "crs": plane } }));
    }
    all
}

/// The plane of a collection, in metres from its own origin, as PROJJSON; tile matrix sets accept it for a CRS that no registry names.
fn crs(id: &str) -> Value {
    let axis = |name: &str, letter: &str, direction: &str| json!({ "name": name, "abbreviation": letter, "direction": direction, "unit": "metre" });
    json!({ "wkt": {
        "$schema": "https://proj.org/schemas/v0.7/projjson.schema.json",
        "type": "EngineeringCRS", "name": id, "datum": { "name": id },
        "coordinate_system": {
            "subtype": "Cartesian", "axis": [axis("Easting", "E", "east"), axis("Northing", "N", "north")],
        },
    } })
}

/// `GET /v1/tileMatrixSets`
pub async fn matrix_sets(State(service): State<Arc<Service>>, _: Plain, Base(base): Base) -> Json<Value> {
    let set = |id: &String| {
        let address = format!("{base}/v1/tileMatrixSets/{id}");
        let links = [link(address.clone(), "self", JSON, id), link(address, SCHEME, JSON, id)];
        json!({ "id": id, "title": id, "crs": crs(id), "links": links })
    };
    Json(json!({ "tileMatrixSets": service.collections.keys().map(set).collect::<Vec<_>>() }))
}

/// `GET /v1/tileMatrixSets/{id}`
pub async fn matrix_set(On(collection): On, _: Plain) -> Json<Value> {
    let (id, grid) = (&collection.id, collection.grid());
    let matrix = |level: u32| {
        let [cols, rows] = grid.matrix(level);
        let cell = grid.resolution_m(level);
        json!({
            "id": level.to_string(), "scaleDenominator": cell / STANDARD_PIXEL_M, "cellSize": cell, "cornerOfOrigin": "topLeft",
            "pointOfOrigin": grid.origin_m, "tileWidth": TILE, "tileHeight": TILE, "matrixWidth": cols, "matrixHeight": rows,
        })
    };
    Json(json!({
        "id": id, "title": id, "crs": crs(id), "orderedAxes": ["E", "N"],
        "tileMatrices": (0..grid.levels).map(matrix).collect::<Vec<_>>(),
    }))
}

/// Refuses a tile matrix set other than the collection's own.
///
/// # Errors
/// Any other tile matrix set.
pub fn check_matrix_set(collection: &Collection, set: &str) -> Result<(), Problem> {
    let id = &collection.id;
    if set == id {
        return Ok(());
    }
    Err(Problem::not_found(format!("no such tile matrix set; the only one of \"{id}\" is \"{id}\"")))
}

/// `GET /v1/collections/{id}/styles/{layer}/map/tiles`
pub async fn tile_sets(
    On(collection): On,
    Segments((_, layer)): Segments<(String, String)>,
    _: Plain,
    Base(base): Base,
) -> Result<Json<Value>, Problem> {
    let set = tile_set_of(&collection, collection.layer(&layer)?.name(), &base);
    Ok(Json(json!({ "tilesets": [set] })))
}

/// `GET /v1/collections/{id}/styles/{layer}/map/tiles/{tms}`
pub async fn tile_set(
    On(collection): On,
    Segments((_, layer, set)): Segments<(String, String, String)>,
    _: Plain,
    Base(base): Base,
) -> Result<Json<Value>, Problem> {
    check_matrix_set(&collection, &set)?;
    Ok(Json(tile_set_of(&collection, collection.layer(&layer)?.name(), &base)))
}

fn tile_set_of(collection: &Collection, layer: &str, base: &str) -> Value {
    let id = &collection.id;
    let own = format!("{base}/v1/collections/{id}/styles/{layer}/map/tiles/{id}");
    let template = json!({
        "href": format!("{own}/{{tileMatrix}}/{{tileRow}}/{{tileCol}}"), "rel": "item", "type": "image/png", "templated": true,
        "title": format!("{layer} of {id}"),
    });
    let scheme = format!("{base}/v1/tileMatrixSets/{id}");
    json!({
        "title": format!("{layer} of {id}"), "dataType": "map", "crs": crs(id), "tileMatrixSetURI": scheme,
        "links": [link(own, "self", JSON, "this tile set"), link(scheme.clone(), SCHEME, JSON, "tile matrix set"), template],
    })
}
