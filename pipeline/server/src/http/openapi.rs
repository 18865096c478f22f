//! The description of the API: OpenAPI 3.1.

use super::ogc::OPENAPI;
use super::patch::{FIELDS, FORMATS};
use super::{Plain, Service};
use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// `GET /v1/openapi.json`
pub async fn description(State(service): State<Arc<Service>>, _: Plain) -> Response {
    ([(header::CONTENT_TYPE, OPENAPI)], Json(document(&service))).into_response()
}

/// A parameter of a query.
fn query(name: &str, schema: Value, description: &str) -> Value {
    json!({ "name": name, "in": "query", "required": false, "schema": schema, "description": description })
}

fn required(mut parameter: Value) -> Value {
    parameter["required"] = json!(true);
    parameter
}

fn number(low: f64, high: f64) -> Value {
    json!({ "type": "number", "minimum": low, "maximum": high })
}

/// A place, `a,b`.
const PLACE: &str = r"-?[0-9]{1,9}(\.[0-9]{1,6})?,-?[0-9]{1,9}(\.[0-9]{1,6})?";

fn text(pattern: &str, example: &str) -> Value {
    json!({ "type": "string", "pattern": format!("^{pattern}$"), "examples": [example] })
}

fn selection() -> Vec<Value> {
    let numbers = json!({ "type": "string", "pattern": "^([1-9][0-9]?(,[1-9][0-9]?)*)?$" });
    vec![
        query("phenomena", numbers, "Numbers of the processes that act; all when absent"),
        query("feature_min_m", number(0.0, 1e9), "Omit craters and rocks up to this width, m"),
    ]
}

fn sun() -> Vec<Value> {
    vec![
        query("sun_azimuth_deg", number(-360.0, 720.0), "Azimuth that the light comes from, clockwise from north"),
        query("sun_elevation_deg", number(0.1, 90.0), "Elevation of the light above the horizon"),
    ]
}

fn window() -> Vec<Value> {
    vec![
        query("origin", text(PLACE, "0,0"), "Position of the south-west sample, m; give it or `center`"),
        query("center", text(PLACE, "0,0"), "Position of the centre, snapped to the nearest sample, m"),
        query("size", text("[1-9][0-9]{0,3},[1-9][0-9]{0,3}", "64,64"), "Columns and rows; give it or `size_m`"),
        query(
            "size_m",
            text(r"[1-9][0-9]{0,5}(\.[0-9]{1,6})?,[1-9][0-9]{0,5}(\.[0-9]{1,6})?", "2,2"),
            "Size east-west and north-south, m",
        ),
        query("resolution_m", number(1e-6, 1e9), "Distance of the samples, m"),
    ]
}

fn words(words: &[&str]) -> Value {
    json!({ "type": "string", "enum": words })
}

fn patch() -> Vec<Value> {
    let mut all = window();
    all.extend([
        query("field", words(&FIELDS), "What the samples are"),
        query("format", words(&FORMATS), "GeoTIFF (COG), NumPy, float32 little-endian, or 16-bit PNG"),
        query("rotate", words(&["0", "90", "180", "270"]), "Counterclockwise, degrees"),
        query("flip", words(&["none", "horizontal", "vertical"]), "Mirror"),
        query(
            "downsample",
            json!({ "type": "integer", "minimum": 0, "maximum": 12 }),
            "Exponent m: one sample per block of 2^m x 2^m",
        ),
        query("method", words(&["point", "mean"]), "How blocks are reduced"),
    ]);
    all.extend(sun());
    all.extend(selection());
    all
}

fn tile() -> Vec<Value> {
    let mut all = sun();
    all.push(query("exaggeration", number(0.1, 100.0), "Vertical exaggeration"));
    all.push(selection().remove(0));
    all
}

/// What is said of one address and method.
struct Operation {
    path: &'static str,
    method: &'static str,
    summary: &'static str,
    parameters: Vec<Value>,
    /// Media types of what is answered with 200.
    media: &'static [&'static str],
}

fn operation(
    path: &'static str,
    summary: &'static str,
    parameters: Vec<Value>,
    media: &'static [&'static str],
) -> Operation {
    Operation { path, method: "get", summary, parameters, media }
}

const JSON: &[&str] = &["application/json"];

fn operations() -> Vec<Operation> {
    let point = vec![
        required(query("x", number(-1e12, 1e12), "Easting, m")),
        required(query("y", number(-1e12, 1e12), "Northing, m")),
        query("resolution_m", number(1e-6, 1e9), "Distance of the samples that the point lies between, m"),
    ];
    let profile = vec![
        required(query("line", text(&format!("{PLACE}(;{PLACE}){{1,99}}"), "0,0;10,5"), "Places along the line")),
        query("samples", json!({ "type": "integer", "minimum": 2, "maximum": 4096 }), "Number of samples"),
        query("resolution_m", number(1e-6, 1e9), "Distance of the samples of the ground, m"),
    ];
    let with_selection = |mut parameters: Vec<Value>| {
        parameters.extend(selection());
        parameters
    };
    let media = &["image/tiff; application=geotiff; profile=cloud-optimized", "application/octet-stream", "image/png"];
    vec![
        operation("/v1", "Landing page", vec![], JSON),
        operation("/v1/conformance", "Conformance classes", vec![], JSON),
        operation("/v1/openapi.json", "This description", vec![], &[OPENAPI]),
        operation("/v1/library", "What the tile library has done", vec![], JSON),
        operation("/v1/collections", "Worlds and rasters", vec![], JSON),
        operation("/v1/collections/{id}", "One collection", vec![], JSON),
        operation("/v1/collections/{id}/patch", "Samples of a window", patch(), media),
        operation(
            "/v1/collections/{id}/study",
            "A section of a study that makes the same patch",
            window(),
            &["text/plain; charset=utf-8"],
        ),
        operation("/v1/collections/{id}/point", "Values at a point", with_selection(point), JSON),
        operation("/v1/collections/{id}/profile", "Heights along a line", with_selection(profile), JSON),
        operation("/v1/collections/{id}/tracks", "Missions and rovers driven on a terrain", vec![], JSON),
        operation("/v1/collections/{id}/tracks/{track}", "One track", vec![], JSON),
        operation("/v1/collections/{id}/styles/{layer}/map/tiles", "Tile sets of a layer", vec![], JSON),
        operation("/v1/collections/{id}/styles/{layer}/map/tiles/{tms}", "A tile set", vec![], JSON),
        operation(
            "/v1/collections/{id}/styles/{layer}/map/tiles/{tms}/{level}/{row}/{col}",
            "A map tile",
            tile(),
            &["image/png"],
        ),
        operation("/v1/collections/{id}/xyz/{layer}/tilejson.json", "TileJSON for web-Mercator clients", vec![], JSON),
        operation(
            "/v1/collections/{id}/xyz/{layer}/{z}/{x}/{y}",
            "A map tile for web-Mercator clients",
            tile(),
            &["image/png"],
        ),
        operation("/v1/tileMatrixSets", "Tile matrix sets", vec![], JSON),
        operation("/v1/tileMatrixSets/{id}", "One tile matrix set", vec![], JSON),
        operation("/v1/jobs", "Jobs", vec![], JSON),
        Operation {
            method: "post",
            ..operation("/v1/jobs", "Start generating the tiles of an area in advance", vec![], JSON)
        },
        operation("/v1/jobs/{id}", "One job", vec![], JSON),
        Operation { method: "delete", ..operation("/v1/jobs/{id}", "Cancel a job", vec![], JSON) },
        operation(
            "/metrics",
            "Counters for Prometheus",
            vec![],
            &["application/openmetrics-text; version=1.0.0; charset=utf-8"],
        ),
    ]
}

/// The names in braces, as parameters.
fn in_path(path: &str, ids: &[&String]) -> Vec<Value> {
    let names = path.split('{').skip(1).filter_map(|part| part.split('}').next());
    let schema = |name: &str| match name {
        "id" if path.starts_with("/v1/jobs") => json!({ "type": "integer", "minimum": 1 }),
        "id" | "tms" => json!({ "type": "string", "enum": ids }),
        "layer" => json!({ "type": "string", "enum": crate::layers::ALL.map(crate::layers::Layer::name) }),
        "level" | "row" | "col" | "z" | "x" => json!({ "type": "integer", "minimum": 0, "maximum": 4_294_967_295u64 }),
        "y" => json!({ "type": "string", "pattern": "^[0-9]{1,9}\\.png$" }),
        _ => json!({ "type": "string" }),
    };
    names.map(|name| json!({ "name": name, "in": "path", "required": true, "schema": schema(name) })).collect()
}

fn document(service: &Service) -> Value {
    let ids: Vec<&String> = service.collections.keys().collect();
    let mut paths: Map<String, Value> = Map::new();
    for o in operations() {
        let mut parameters = in_path(o.path, &ids);
        parameters.extend(o.parameters);
        let content: Map<String, Value> = o.media.iter().map(|m| ((*m).to_owned(), json!({}))).collect();
        let (done, what) = if o.method == "post" { ("202", "Accepted") } else { ("200", "OK") };
        let mut responses = json!({ done: { "description": what, "content": content } });
        for (status, what) in problems(o.method) {
            responses[status] = problem(what);
        }
        let is_tile = o.path.ends_with("{col}") || o.path.ends_with("{y}");
        if is_tile {
            responses["204"] = json!({ "description": "There is no data in this tile" });
        }
        if is_tile || o.path.ends_with("/patch") {
            responses["206"] = json!({ "description": "The range that was asked for" });
            responses["304"] = json!({ "description": "Not modified" });
            responses["416"] = problem("The range lies beyond the end");
        }
        let mut entry = json!({ "summary": o.summary, "parameters": parameters, "responses": responses });
        if o.method == "post" {
            entry["requestBody"] =
                json!({ "required": true, "content": { "application/json": { "schema": order() } } });
        }
        let path = paths.entry(o.path.to_owned()).or_insert_with(|| json!({}));
        path[o.method] = entry;
    }
    let mut document = json!({
        "openapi": "3.1.0",
        "info": {
            "title": "sastrugi terrain server", "version": env!("CARGO_PKG_VERSION"), "license": { "name": "MIT OR Apache-2.0" },
            "description": "Patches of terrain at any place and resolution, and map tiles. Coordinates and heights are metres.",
        },
        "paths": paths,
        "components": { "schemas": { "Problem": {
            "type": "object", "required": ["type", "title", "status", "detail"],
            "properties": {
                "type": { "type": "string" }, "title": { "type": "string" }, "status": { "type": "integer" },
                "detail": { "type": "string", "description": "What is wrong, and what would be right" },
            },
        } } },
    });
    if service.token.is_some() {
        document["components"]["securitySchemes"] = json!({ "token": { "type": "http", "scheme": "bearer" } });
        document["security"] = json!([{ "token": [] }]);
    }
    document
}

fn problems(method: &str) -> Vec<(&'static str, &'static str)> {
    let mut all = vec![
        ("400", "A parameter is missing, unknown or out of range"),
        ("401", "The token is missing or wrong"),
        ("404", "There is no such thing, or no data"),
        ("405", "Method not allowed"),
        ("406", "No encoding that the client takes"),
        ("413", "A limit is exceeded"),
        ("414", "The address is too long"),
        ("421", "Host not allowed"),
        ("422", "Beyond the end of the world"),
        ("429", "Too many requests of one client are in progress"),
        ("500", "Internal error"),
        ("503", "The server is busy"),
    ];
    match method {
        "delete" => all.push(("409", "The job has ended")),
        "post" => all.push(("415", "The body is not JSON")),
        _ => {}
    }
    all
}

fn problem(description: &str) -> Value {
    let schema = json!({ "schema": { "$ref": "#/components/schemas/Problem" } });
    json!({ "description": description, "content": { "application/problem+json": schema } })
}

fn order() -> Value {
    json!({
        "type": "object", "additionalProperties": false, "required": ["collection", "bounds_m"],
        "properties": {
            "collection": { "type": "string" },
            "bounds_m": {
                "type": "array", "minItems": 4, "maxItems": 4, "items": number(-1e9, 1e9),
                "description": "West, south, east and north, m",
            },
            "resolution_m": { "type": ["number", "null"], "exclusiveMinimum": 0, "maximum": 1e9 },
            "phenomena": { "type": ["array", "null"], "items": { "type": "integer", "minimum": 1, "maximum": 99 } },
            "feature_min_m": number(0.0, 1e9),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// The description names every address, and no other.
    #[test]
    fn val_every_address_is_described() {
        let described: BTreeSet<&str> = operations().iter().map(|o| o.path).collect();
        let routed: BTreeSet<&str> = super::super::ROUTES.iter().map(|(path, _)| *path).collect();
        assert_eq!(described, routed);
    }

    /// It names the parameters that are taken, and no other.
    #[test]
    fn val_every_parameter_is_described() {
        let names = |path: &str| -> BTreeSet<String> {
            let all = operations();
            let found = all.iter().find(|o| o.path == path).unwrap();
            found.parameters.iter().map(|p| p["name"].as_str().unwrap().to_owned()).collect()
        };
        let own = |known: &[&str]| known.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<String>>();
        assert_eq!(names("/v1/collections/{id}/patch"), own(&super::super::patch::KNOWN));
        assert_eq!(names("/v1/collections/{id}/xyz/{layer}/{z}/{x}/{y}"), own(&super::super::tiles::KNOWN));
        let known = |own_names: &[&'static str]| own(&[own_names, &super::super::service::SELECTION].concat());
        assert_eq!(names("/v1/collections/{id}/point"), known(&super::super::values::POINT));
        assert_eq!(names("/v1/collections/{id}/profile"), known(&super::super::values::PROFILE));
    }
}
