//! Routes as a FeatureCollection of LineStrings.

use super::GeoJsonError;
use crate::atomic::{self, Target};
use crate::dem::Crs;
use serde_json::{Map, Value, json};

/// Note for readers that expect RFC 7946, as a foreign member of the collection.
const NOTE: &str = "coordinates are x and y in the DEM's own coordinate reference system, and height in m; not longitude and \
                    latitude on WGS 84 (RFC 7946)";
/// WGS 84, whose EPSG definition puts the latitude first.
const WGS84: u16 = 4326;

/// A line with its properties.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// At least 2 positions `[x, y, z]`: x and y in the DEM's own coordinates, z in m.
    pub positions: Vec<[f64; 3]>,
    /// Properties of the feature.
    pub properties: Map<String, Value>,
}

/// Writes routes, one feature per line; numbers are the shortest that read back as the same 64-bit numbers. The member `crs` is
/// written if the system has an EPSG code.
///
/// # Errors
/// [`GeoJsonError::Unfit`] for a route of fewer than 2 positions, or with a number that is not finite; [`GeoJsonError::Io`].
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_store::dem::Crs;
/// use sastrugi_store::geojson::{Route, write_routes};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("routes.geojson");
/// let mut route = Route { positions: vec![[0.5, 1.0, 2.0], [3.0, 4.0, 5.25]], properties: Default::default() };
/// route.properties.insert("cost".to_owned(), serde_json::json!(12.5));
/// let crs = Crs { epsg: Some(32633), ..Crs::default() };
/// write_routes(&path, Some(&crs), &[route])?;
///
/// let written: serde_json::Value = serde_json::from_slice(&std::fs::read(&path)?)?;
/// assert_eq!(written["crs"]["properties"]["name"], "urn:ogc:def:crs:EPSG::32633");
/// assert_eq!(written["features"][0]["geometry"]["coordinates"][1][2], 5.25);
/// assert_eq!(written["features"][0]["properties"]["cost"], 12.5);
/// # Ok(())
/// # }
/// ```
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

/// A named system as in GeoJSON 1.0, with x before y.
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
        return unfit(format!("route {number} contains {value}; every number must be finite"));
    }
    let geometry = json!({ "type": "LineString", "coordinates": route.positions });
    Ok(json!({ "type": "Feature", "properties": route.properties, "geometry": geometry }).to_string())
}
