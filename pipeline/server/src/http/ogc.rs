//! Landing page, collections and tile sets as OGC API - Tiles has them.

use super::service::{Service, blocking, checked};
use super::{Pairs, Problem};
use crate::collections::Collection;
use crate::grid::TILE;
use crate::layers::Layer;
use axum::Json;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, header};
use serde_json::{Value, json};
use std::sync::Arc;

/// Side of a pixel that scale denominators refer to, m.
const STANDARD_PIXEL_M: f64 = 0.00028;
const JSON: &str = "application/json";
/// What is conformed to.
const CONFORMANCE: [&str; 6] = [
    "http://www.opengis.net/spec/ogcapi-common-1/1.0/conf/core",
    "http://www.opengis.net/spec/ogcapi-common-1/1.0/conf/json",
    "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/core",
    "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/tileset",
    "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/tilesets-list",
    "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/png",
];
/// Relation of a link to the tile sets of a map.
const MAP_TILESETS: &str = "http://www.opengis.net/def/rel/ogc/1.0/tilesets-map";
const SCHEME: &str = "http://www.opengis.net/def/rel/ogc/1.0/tiling-scheme";
const SCHEMES: &str = "http://www.opengis.net/def/rel/ogc/1.0/tiling-schemes";

/// Where clients find the server, as they call it.
pub fn base(headers: &HeaderMap) -> String {
    let host = headers.get(header::HOST).and_then(|value| value.to_str().ok()).unwrap_or("localhost");
    let plain = host.bytes().all(|b| b.is_ascii_alphanumeric() || b".:-[]".contains(&b));
    format!("http://{}", if plain { host } else { "localhost" })
}

fn link(href: String, rel: &str, media: &str, title: &str) -> Value {
    json!({ "href": href, "rel": rel, "type": media, "title": title })
}

/// `GET /v1`
pub async fn landing(
    State(service): State<Arc<Service>>,
    pairs: Pairs,
    headers: HeaderMap,
) -> Result<Json<Value>, Problem> {
    checked(pairs, &[])?;
    let v1 = format!("{}/v1", base(&headers));
    Ok(Json(json!({
        "title": "sastrugi terrain server",
        "description": format!("{} collections: patches of terrain at any place and resolution, and map tiles", service.collections.len()),
        "links": [
            link(v1.clone(), "self", JSON, "this page"),
            link(format!("{v1}/openapi.json"), "service-desc", "application/vnd.oai.openapi+json;version=3.1", "the API"),
            link(format!("{v1}/conformance"), "conformance", JSON, "what is conformed to"),
            link(format!("{v1}/collections"), "data", JSON, "worlds and rasters"),
            link(format!("{v1}/tileMatrixSets"), SCHEMES, JSON, "tile matrix sets"),
        ],
    })))
}

/// `GET /v1/conformance`
pub async fn conformance(pairs: Pairs) -> Result<Json<Value>, Problem> {
    checked(pairs, &[])?;
    Ok(Json(json!({ "conformsTo": CONFORMANCE })))
}

/// `GET /v1/collections`
pub async fn collections(
    State(service): State<Arc<Service>>,
    pairs: Pairs,
    headers: HeaderMap,
) -> Result<Json<Value>, Problem> {
    checked(pairs, &[])?;
    let base = base(&headers);
    blocking(move || {
        let all: Vec<Value> = service.collections.values().map(|c| described(c, &base)).collect();
        let links = [link(format!("{base}/v1/collections"), "self", JSON, "this list")];
        Ok(Json(json!({ "collections": all, "links": links })))
    })
    .await
}

/// `GET /v1/collections/{id}`
pub async fn collection(
    State(service): State<Arc<Service>>,
    Path(id): Path<String>,
    pairs: Pairs,
    headers: HeaderMap,
) -> Result<Json<Value>, Problem> {
    checked(pairs, &[])?;
    let (collection, base) = (Arc::clone(service.collection(&id)?), base(&headers));
    blocking(move || Ok(Json(described(&collection, &base)))).await
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
        all.insert("extent".to_owned(), json!({ "spatial": { "bbox": [[west, south, east, north]], "crs": crs(id) } }));
    }
    all
}

/// Name of the plane of a collection: its coordinates are metres from its own origin.
fn crs(id: &str) -> String {
    format!("urn:sastrugi:plane:{id}")
}

/// `GET /v1/tileMatrixSets`
pub async fn matrix_sets(
    State(service): State<Arc<Service>>,
    pairs: Pairs,
    headers: HeaderMap,
) -> Result<Json<Value>, Problem> {
    checked(pairs, &[])?;
    let base = base(&headers);
    let set = |id: &String| {
        let address = format!("{base}/v1/tileMatrixSets/{id}");
        json!({ "id": id, "title": id, "crs": crs(id), "links": [link(address, SCHEME, JSON, id)] })
    };
    Ok(Json(json!({ "tileMatrixSets": service.collections.keys().map(set).collect::<Vec<_>>() })))
}

/// `GET /v1/tileMatrixSets/{id}`
pub async fn matrix_set(
    State(service): State<Arc<Service>>,
    Path(id): Path<String>,
    pairs: Pairs,
) -> Result<Json<Value>, Problem> {
    checked(pairs, &[])?;
    let grid = service.collection(&id)?.grid();
    let matrix = |level: u32| {
        let [cols, rows] = grid.matrix(level);
        let cell = grid.resolution_m(level);
        json!({
            "id": level.to_string(), "scaleDenominator": cell / STANDARD_PIXEL_M, "cellSize": cell, "cornerOfOrigin": "topLeft",
            "pointOfOrigin": grid.origin_m, "tileWidth": TILE, "tileHeight": TILE, "matrixWidth": cols, "matrixHeight": rows,
        })
    };
    Ok(Json(json!({
        "id": id, "title": id, "crs": crs(&id), "orderedAxes": ["E", "N"],
        "tileMatrices": (0..grid.levels).map(matrix).collect::<Vec<_>>(),
    })))
}

fn checked_layer<'a>(collection: &Collection, layer: &'a str) -> Result<&'a str, Problem> {
    let known = Layer::of_name(layer).is_some_and(|l| collection.layers().contains(&l.name()));
    let layers = || collection.layers().join(", ");
    known
        .then_some(layer)
        .ok_or_else(|| Problem::not_found(format!("\"{}\" has no such layer; it has {}", collection.id, layers())))
}

/// `GET /v1/collections/{id}/styles/{layer}/map/tiles`
pub async fn tile_sets(
    State(service): State<Arc<Service>>,
    Path((id, layer)): Path<(String, String)>,
    pairs: Pairs,
    headers: HeaderMap,
) -> Result<Json<Value>, Problem> {
    checked(pairs, &[])?;
    let collection = service.collection(&id)?;
    let set = tile_set_of(collection, checked_layer(collection, &layer)?, &base(&headers));
    Ok(Json(json!({ "tilesets": [set] })))
}

/// `GET /v1/collections/{id}/styles/{layer}/map/tiles/{tms}`
pub async fn tile_set(
    State(service): State<Arc<Service>>,
    Path((id, layer, grid)): Path<(String, String, String)>,
    pairs: Pairs,
    headers: HeaderMap,
) -> Result<Json<Value>, Problem> {
    checked(pairs, &[])?;
    let collection = service.collection(&id)?;
    if grid != id {
        return Err(Problem::not_found(format!("the tiles of \"{id}\" lie in the tile matrix set \"{id}\"")));
    }
    Ok(Json(tile_set_of(collection, checked_layer(collection, &layer)?, &base(&headers))))
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
