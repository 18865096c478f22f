//! Polygons of GeoJSON (RFC 7946: Polygon, MultiPolygon, Feature, FeatureCollection); a third coordinate is dropped.
//!
//! RFC 7946 repeats the first position of a ring as the last, which makes at least 4. As in GDAL, a ring that is not closed is also
//! accepted, and its last position is joined to the first: it needs at least 3 corners.

use sastrugi_schemas::counted;
use serde_json::Value;
use std::io::{self, BufRead};

/// Size of a value of a parsed text, bytes.
const VALUE: u64 = size_of::<Value>() as u64;

/// Fewest corners of a ring, without the repetition of the first.
const CORNERS_MIN: usize = 3;

/// A ring of at least 3 corners; the first may be repeated as the last.
pub type Ring = Vec<[f64; 2]>;
/// Rings to which the even-odd rule applies together.
pub type Polygon = Vec<Ring>;

/// Reads every polygon of a GeoJSON text.
pub fn parse(bytes: &[u8]) -> Result<Vec<Polygon>, String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let root: Value = serde_json::from_slice(bytes).map_err(|e| format!("not GeoJSON: {e}"))?;
    let mut polygons = vec![];
    object(&root, &mut polygons)?;
    if polygons.is_empty() {
        return Err("contains no polygons".to_owned());
    }
    Ok(polygons)
}

/// Approximate memory that [`parse`] needs, bytes: the text, its values and the polygons. The values are counted by the characters that
/// separate them, whether or not the text is GeoJSON.
///
/// # Errors
/// A text that cannot be read.
pub fn parsing_bytes(text: impl BufRead) -> io::Result<u64> {
    text.bytes().map(|byte| byte.map(bytes_at)).sum()
}

/// Memory that a character of a text stands for, bytes: itself, itself again as part of a string, and the value that it begins.
fn bytes_at(byte: u8) -> u64 {
    2 + match byte {
        // The next value of a list, which may have been allocated for twice as many.
        b',' => 2 * VALUE,
        // A list is allocated for four values at least; if it is a position, its two numbers are copied.
        b'[' => 5 * VALUE,
        // Entries and index of an object.
        b'{' => 8 * VALUE,
        // Half of the allocation of a string.
        b'"' => 32,
        _ => 0,
    }
}

fn object(value: &Value, polygons: &mut Vec<Polygon>) -> Result<(), String> {
    let kind = value.get("type").and_then(Value::as_str).ok_or("not GeoJSON: an object has no \"type\"")?;
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
            polygons.push(rings(polygon.as_array().ok_or("a polygon of a MultiPolygon is not a list of rings")?)?);
            Ok(())
        }),
        other => Err(format!("contains a {other}; only Polygon and MultiPolygon are supported")),
    }
}

fn list<'a>(value: &'a Value, key: &str) -> Result<&'a Vec<Value>, String> {
    value.get(key).and_then(Value::as_array).ok_or_else(|| format!("not GeoJSON: \"{key}\" is missing or not a list"))
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
    let closed = positions.len() > 1 && positions.first() == positions.last();
    let corners = positions.len() - usize::from(closed);
    if corners < CORNERS_MIN {
        return Err(format!(
            "a ring of a polygon has {}; it needs at least {CORNERS_MIN} (the first may be repeated as the last)",
            counted(corners, "corner")
        ));
    }
    Ok(positions)
}
