//! Polygons of GeoJSON (RFC 7946: Polygon, MultiPolygon, Feature, FeatureCollection); a third coordinate is dropped.

use serde_json::Value;

/// A ring of positions, closed or not.
pub type Ring = Vec<[f64; 2]>;
/// Rings that take part in the even-odd rule together.
pub type Polygon = Vec<Ring>;

/// Reads every polygon of a GeoJSON text.
pub fn parse(bytes: &[u8]) -> Result<Vec<Polygon>, String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let root: Value = serde_json::from_slice(bytes).map_err(|e| format!("is not GeoJSON: {e}"))?;
    let mut polygons = vec![];
    object(&root, &mut polygons)?;
    if polygons.is_empty() {
        return Err("holds no polygon".to_owned());
    }
    Ok(polygons)
}

fn object(value: &Value, polygons: &mut Vec<Polygon>) -> Result<(), String> {
    let kind = value.get("type").and_then(Value::as_str).ok_or("is not GeoJSON: an object lacks its \"type\"")?;
    match kind {
        "FeatureCollection" => list(value, "features")?.iter().try_for_each(|feature| object(feature, polygons)),
        "Feature" => match value.get("geometry") {
            None | Some(Value::Null) => Ok(()),
            Some(geometry) => object(geometry, polygons),
        },
        "Polygon" => {
            polygons.push(rings(list(value, "coordinates")?)?);
            Ok(())
        }
        "MultiPolygon" => list(value, "coordinates")?.iter().try_for_each(|polygon| {
            polygons.push(rings(polygon.as_array().ok_or("a polygon of its MultiPolygon is not a list of rings")?)?);
            Ok(())
        }),
        other => Err(format!("holds a {other}; only Polygon and MultiPolygon are read")),
    }
}

fn list<'a>(value: &'a Value, key: &str) -> Result<&'a Vec<Value>, String> {
    value
        .get(key)
        .and_then(Value::as_array)
        .ok_or_else(|| format!("is not GeoJSON: \"{key}\" is missing or not a list"))
}

fn rings(values: &[Value]) -> Result<Polygon, String> {
    values.iter().map(ring).collect()
}

fn ring(value: &Value) -> Result<Ring, String> {
    let position = |position: &Value| {
        let [x, y] = [0, 1].map(|axis| position.get(axis).and_then(Value::as_f64));
        Some([x?, y?])
    };
    let positions: Option<Ring> = value.as_array().and_then(|all| all.iter().map(position).collect());
    let positions = positions.ok_or("a ring of a polygon is not a list of [x, y] positions")?;
    if positions.len() < 3 {
        return Err(format!(
            "a ring of a polygon has {} positions; it needs 4, the first one again as the last",
            positions.len()
        ));
    }
    Ok(positions)
}
