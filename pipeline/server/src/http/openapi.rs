//! OpenAPI 3.1 description of the API.

use super::ogc::OPENAPI;
use super::patch::{DOWNSAMPLE_MAX, FIELDS, FORMATS};
use super::values::{CORNERS_MAX, SAMPLES_MAX};
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

/// A query parameter.
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

/// A position, `a,b`.
const PLACE: &str = r"-?[0-9]{1,9}(\.[0-9]{1,6})?,-?[0-9]{1,9}(\.[0-9]{1,6})?";

fn text(pattern: &str, example: &str) -> Value {
    json!({ "type": "string", "pattern": format!("^{pattern}$"), "examples": [example] })
}

fn selection() -> Vec<Value> {
    let numbers = json!({ "type": "string", "pattern": "^([1-9][0-9]?(,[1-9][0-9]?)*)?$" });
    vec![
        query("phenomena", numbers, "Numbers of the processes to apply, from 1; all if absent"),
        query("feature_min_m", number(0.0, 1e9), "Omit craters and rocks up to this width, m"),
    ]
}

fn sun() -> Vec<Value> {
    vec![
        query("sun_azimuth_deg", number(-360.0, 720.0), "Azimuth of the light, clockwise from north, degrees"),
        query("sun_elevation_deg", number(0.1, 90.0), "Elevation of the light above the horizon, degrees"),
    ]
}

fn window() -> Vec<Value> {
    vec![
        query("origin", text(PLACE, "0,0"), "Position of the south-west sample, m; give this or `center`"),
        query("center", text(PLACE, "0,0"), "Position of the centre, snapped to the nearest sample, m"),
        query("size", text("[1-9][0-9]{0,3},[1-9][0-9]{0,3}", "64,64"), "Columns and rows; give this or `size_m`"),
        query(
            "size_m",
            text(r"[1-9][0-9]{0,5}(\.[0-9]{1,6})?,[1-9][0-9]{0,5}(\.[0-9]{1,6})?", "2,2"),
            "Size east-west and north-south, m",
        ),
        query("resolution_m", number(1e-6, 1e9), "Sample spacing, m"),
    ]
}

fn words(words: &[&str]) -> Value {
    json!({ "type": "string", "enum": words })
}

fn patch() -> Vec<Value> {
    let mut all = window();
    all.extend([
        query("field", words(&FIELDS), "Field to return"),
        query("format", words(&FORMATS), "GeoTIFF (COG), NumPy, float32 little-endian, or 16-bit PNG"),
        query("rotate", words(&["0", "90", "180", "270"]), "Counterclockwise rotation, degrees"),
        query("flip", words(&["none", "horizontal", "vertical"]), "Mirror the patch"),
        query(
            "downsample",
            json!({ "type": "integer", "minimum": 0, "maximum": DOWNSAMPLE_MAX }),
            "Exponent m: one sample per block of 2^m x 2^m",
        ),
        query("method", words(&["point", "mean"]), "How each block is reduced to one sample"),
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

/// One method of one route.
struct Operation {
    path: &'static str,
    method: &'static str,
    summary: &'static str,
    parameters: Vec<Value>,
    /// Media types of a response with status 200.
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
        query(
            "resolution_m",
            number(1e-6, 1e9),
            "Spacing of the samples to interpolate between, m; a raster has its own",
        ),
    ];
    let corners = format!("{PLACE}(;{PLACE}){{1,{}}}", CORNERS_MAX - 1);
    let samples = json!({ "type": "integer", "minimum": 2, "maximum": SAMPLES_MAX });
    let profile = vec![
        required(query("line", text(&corners, "0,0;10,5"), "Corners of the line, m")),
        query("samples", samples, "Number of samples along the line"),
        query(
            "resolution_m",
            number(1e-6, 1e9),
            "Spacing of the ground samples to interpolate between, m; a raster has its own",
        ),
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
        operation("/v1/library", "Statistics of the tile library", vec![], JSON),
        operation("/v1/collections", "Worlds and rasters", vec![], JSON),
        operation("/v1/collections/{id}", "One collection", vec![], JSON),
        operation("/v1/collections/{id}/patch", "Samples of a window", patch(), media),
        operation(
            "/v1/collections/{id}/study",
            "A study section that reproduces the patch",
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
            "Prometheus metrics",
            vec![],
            &["application/openmetrics-text; version=1.0.0; charset=utf-8"],
        ),
    ]
}

/// The names in braces, as path parameters.
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
            responses["204"] = json!({ "description": "The tile has no data" });
        }
        if is_tile || o.path.ends_with("/patch") || o.path.ends_with("{track}") {
            responses["206"] = json!({ "description": "The requested range" });
            responses["304"] = json!({ "description": "Not modified" });
            responses["416"] = problem("The range starts beyond the end");
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
                "detail": { "type": "string", "description": "What is wrong, and what would be accepted" },
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
        ("404", "No such resource, or no data"),
        ("405", "Method not allowed"),
        ("406", "No acceptable encoding"),
        ("413", "A limit is exceeded"),
        ("414", "The URL is too long"),
        ("421", "Host not allowed"),
        ("422", "Beyond the end of the world, or an image of one row or column"),
        ("429", "The client has too many requests in progress"),
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
            "feature_min_m": { "type": ["number", "null"], "minimum": 0, "maximum": 1e9 },
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// The description covers exactly the routes.
    #[test]
    fn val_every_route_is_described() {
        let described: BTreeSet<&str> = operations().iter().map(|o| o.path).collect();
        let routed: BTreeSet<&str> = super::super::ROUTES.iter().map(|(path, _)| *path).collect();
        assert_eq!(described, routed);
    }

    /// It covers exactly the parameters that are accepted.
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

    /// The pattern of `line` allows exactly as many corners as the server accepts.
    #[test]
    fn val_lines_have_as_many_corners_as_the_server_accepts() {
        let all = operations();
        let profile = all.iter().find(|o| o.path.ends_with("/profile")).unwrap();
        let line = profile.parameters.iter().find(|p| p["name"] == "line").unwrap();
        let pattern = line["schema"]["pattern"].as_str().unwrap();
        // `^CORNER(;CORNER){1,MOST}$`
        let (_, counts) = pattern.rsplit_once("){").unwrap();
        let most: usize = counts.strip_prefix("1,").and_then(|rest| rest.strip_suffix("}$")).unwrap().parse().unwrap();
        let accepted = |corners: usize| {
            let text = vec!["0,0"; corners].join(";");
            let query = crate::http::Query::new(vec![("line".to_owned(), text)], &["line"]).unwrap();
            query.line("line", CORNERS_MAX).is_ok()
        };
        assert_eq!([1, 2, 1 + most, 2 + most].map(accepted), [false, true, true, false], "{pattern}");
    }
}
