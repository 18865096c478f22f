//! Routes as a FeatureCollection of LineStrings.

use super::GeoJsonError;
use crate::atomic::{self, Target};
use crate::dem::Crs;
use serde_json::{Map, Value, json};

/// What a reader of RFC 7946 must know, as a foreign member of the collection.
const NOTE: &str = "coordinates are x and y in the DEM's own coordinate reference system and the height in m, not longitude and \
                    latitude on WGS 84 (RFC 7946)";
/// WGS 84, whose EPSG name puts the latitude first.
const WGS84: u16 = 4326;

/// A line and what is said of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// Positions `[x, y, z]`: x and y in the DEM's own coordinates, z in m; at least 2.
    pub positions: Vec<[f64; 3]>,
    /// Properties of the feature.
    pub properties: Map<String, Value>,
}

/// Writes routes, one feature a line; numbers have the digits that read back as the same 64-bit ones. The member `crs` is there for a
/// system with an EPSG code.
///
/// # Errors
/// [`GeoJsonError::Unfit`] for a route of fewer than 2 positions, or with a number that is not finite; [`GeoJsonError::Io`].
pub fn write_routes<'a>(
    target: impl Into<Target<'a>>,
    crs: Option<&Crs>,
    routes: &[Route],
) -> Result<(), GeoJsonError> {
    let target = target.into();
    let text = text(crs, routes)?;
    atomic::write(target, text.as_bytes()).map_err(|source| GeoJsonError::Io { path: target.path.to_owned(), source })
}

fn text(crs: Option<&Crs>, routes: &[Route]) -> Result<String, GeoJsonError> {
    let features = routes.iter().zip(1..).map(|(route, number)| feature(route, number));
    let features: Vec<String> = features.collect::<Result<_, _>>()?;
    let crs = crs.and_then(|crs| crs.epsg).map(|code| format!("\"crs\": {},\n", named(code))).unwrap_or_default();
    let note = json!(NOTE);
    let features = features.join(",\n");
    Ok(format!("{{\"type\": \"FeatureCollection\",\n{crs}\"note\": {note},\n\"features\": [\n{features}\n]}}\n"))
}

/// A named system of GeoJSON 1.0, with x before y.
fn named(epsg: u16) -> Value {
    let name = match epsg {
        WGS84 => "urn:ogc:def:crs:OGC:1.3:CRS84".to_owned(),
        code => format!("urn:ogc:def:crs:EPSG::{code}"),
    };
    json!({ "type": "name", "properties": { "name": name } })
}

fn feature(route: &Route, number: usize) -> Result<String, GeoJsonError> {
    let unfit = |reason: String| Err(GeoJsonError::Unfit { reason });
    if route.positions.len() < 2 {
        return unfit(format!("route {number} needs at least 2 positions, got {}", route.positions.len()));
    }
    if let Some(value) = route.positions.as_flattened().iter().find(|value| !value.is_finite()) {
        return unfit(format!("route {number} holds {value}; every number must be finite"));
    }
    let geometry = json!({ "type": "LineString", "coordinates": route.positions });
    Ok(json!({ "type": "Feature", "properties": route.properties, "geometry": geometry }).to_string())
}
