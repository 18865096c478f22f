//! Coordinate reference systems of point clouds: GeoTIFF keys (LAS 1.4, "Georeferencing Information using GeoTIFF") or
//! OGC well-known text (versions 1 and 2), converted to the form used for rasters.
//!
//! From well-known text, the name, the EPSG code and the units of the horizontal and the vertical system are kept.

use super::header::{PROJECTION, Record};
use crate::dem::crs::{Crs, GeoKey};
use crate::dem::raster::Refusal;

/// Records of `LASF_Projection`.
const WELL_KNOWN_TEXT: u16 = 2112;
const KEYS: u16 = 34735;
const DOUBLES: u16 = 34736;
const TEXTS: u16 = 34737;
const MODEL_TYPE: u16 = 1024;
const CITATION: u16 = 1026;
const GEODETIC_CRS: u16 = 2048;
const PROJECTED_CRS: u16 = 3072;
const LINEAR_UNITS: u16 = 3076;
const VERTICAL_UNITS: u16 = 4099;
const MODEL_PROJECTED: u16 = 1;
const MODEL_GEOCENTRIC: u16 = 3;
/// Maximum nesting depth of well-known text.
const DEPTH: usize = 24;

/// The system named by the records; the default (a local plane in metres) if they name none.
///
/// # Errors
/// Coordinates in degrees, or geocentric coordinates.
pub(super) fn of_records(records: &[Record], well_known_text: bool) -> Result<Crs, Refusal> {
    let of = |id: u16| {
        let wanted = |record: &&Record| record.user.eq_ignore_ascii_case(PROJECTION) && record.id == id;
        records.iter().find(wanted).map(|record| record.data.as_slice())
    };
    let text = || Some(String::from_utf8_lossy(of(WELL_KNOWN_TEXT)?).into_owned());
    let keys = || geotiff_keys(of(KEYS)?, of(DOUBLES).unwrap_or(&[]), of(TEXTS).unwrap_or(&[])).map(Crs::from_keys);
    let crs = if well_known_text {
        text().and_then(|text| of_text(&text)).or_else(keys)
    } else {
        keys().or_else(|| of_text(&text()?))
    };
    let crs = crs.unwrap_or_default();
    let geocentric = crs.keys.contains(&(MODEL_TYPE, GeoKey::Short(MODEL_GEOCENTRIC)));
    if crs.geographic || geocentric {
        let kind = if geocentric { "geocentric" } else { "in degrees of longitude and latitude" };
        let code = crs.epsg.map_or_else(String::new, |code| format!(" (EPSG:{code})"));
        return Err(Refusal::new(format!(
            "its coordinates are {kind}{code}; project the point cloud to metres before gridding"
        )));
    }
    Ok(crs)
}

/// The keys of a GeoTIFF directory, with its tables of doubles and text.
fn geotiff_keys(directory: &[u8], doubles: &[u8], texts: &[u8]) -> Option<Vec<(u16, GeoKey)>> {
    let words: Vec<u16> = directory.as_chunks().0.iter().map(|word| u16::from_le_bytes(*word)).collect();
    let count = usize::from(*words.get(3)?);
    let key = |[id, table, count, value]: &[u16; 4]| {
        let (count, first) = (usize::from(*count), usize::from(*value));
        let key = match *table {
            0 => GeoKey::Short(*value),
            DOUBLES => {
                let numbers = doubles.as_chunks().0.get(first..first + count)?;
                GeoKey::Double(numbers.iter().map(|number| f64::from_le_bytes(*number)).collect())
            }
            TEXTS => {
                let text = String::from_utf8_lossy(texts.get(first..first + count)?);
                GeoKey::Ascii(text.trim_end_matches('\0').to_owned())
            }
            _ => return None,
        };
        Some((*id, key))
    };
    let keys: Vec<(u16, GeoKey)> = words[4..].as_chunks().0.iter().take(count).filter_map(key).collect();
    (!keys.is_empty()).then_some(keys)
}

/// The system that well-known text describes.
pub(super) fn of_text(text: &str) -> Option<Crs> {
    let (root, _) = node(text.trim_start(), DEPTH)?;
    let compound = root.is(&["COMPD_CS", "COMPOUNDCRS"]);
    let parts = if compound { root.nodes.iter().collect() } else { vec![&root] };
    let horizontal = parts.iter().find(|part| part.is(&PROJECTED) || part.is(&GEOGRAPHIC) || part.is(&GEOCENTRIC));
    let vertical = parts.iter().find(|part| part.is(&["VERT_CS", "VERTCRS", "VERTICALCRS"]));
    let mut keys = vec![];
    if let Some(node) = horizontal {
        let projected = node.is(&PROJECTED);
        let (model, id) = if projected { (MODEL_PROJECTED, PROJECTED_CRS) } else { (2, GEODETIC_CRS) };
        let model = if node.is(&GEOCENTRIC) { MODEL_GEOCENTRIC } else { model };
        keys.push((MODEL_TYPE, GeoKey::Short(model)));
        keys.extend(node.epsg().map(|code| (id, GeoKey::Short(code))));
        keys.extend(node.unit().filter(|_| projected).map(|unit| (LINEAR_UNITS, GeoKey::Short(unit))));
    }
    keys.extend(vertical.and_then(|node| node.unit()).map(|unit| (VERTICAL_UNITS, GeoKey::Short(unit))));
    let name = horizontal.map_or(root.name(), |node| node.name());
    keys.push((CITATION, GeoKey::Ascii(name.to_owned())));
    Some(Crs::from_keys(keys))
}

const PROJECTED: [&str; 3] = ["PROJCS", "PROJCRS", "PROJECTEDCRS"];
const GEOGRAPHIC: [&str; 5] = ["GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS"];
const GEOCENTRIC: [&str; 1] = ["GEOCCS"];

/// `WORD["name", 1.0, OTHER[...], ...]`.
#[derive(Debug, Default)]
struct Node<'a> {
    word: &'a str,
    /// Texts, numbers and bare words, in order.
    values: Vec<&'a str>,
    nodes: Vec<Node<'a>>,
}

impl Node<'_> {
    fn is(&self, words: &[&str]) -> bool {
        words.iter().any(|word| self.word.eq_ignore_ascii_case(word))
    }

    fn name(&self) -> &str {
        self.values.first().copied().unwrap_or_default()
    }

    /// The code of the node itself, not of a child.
    fn epsg(&self) -> Option<u16> {
        let authority = self.nodes.iter().find(|node| node.is(&["AUTHORITY", "ID"]))?;
        let [kind, code, ..] = authority.values.as_slice() else { return None };
        if kind.eq_ignore_ascii_case("EPSG") { code.parse().ok() } else { None }
    }

    /// EPSG code of the unit of length, if known: metre, foot or US survey foot.
    fn unit(&self) -> Option<u16> {
        let axis = || self.nodes.iter().filter(|n| n.is(&["AXIS"])).flat_map(|n| &n.nodes);
        let unit = self.nodes.iter().chain(axis()).find(|node| node.is(&["UNIT", "LENGTHUNIT"]))?;
        let metres: f64 = unit.values.get(1)?.parse().ok()?;
        let known = [(9001, 1.0), (9002, 0.3048), (9003, 1200.0 / 3937.0)];
        let close = |m: f64| (metres / m - 1.0).abs() < 1e-7;
        unit.epsg().or_else(|| known.into_iter().find(|(_, m)| close(*m)).map(|(code, _)| code))
    }
}

/// Parses a node and returns it with the remaining text.
fn node(text: &str, depth: usize) -> Option<(Node<'_>, &str)> {
    let depth = depth.checked_sub(1)?;
    let open = text.find(['[', '(', '"', ',', ']', ')'])?;
    let mut node = Node { word: text[..open].trim(), ..Node::default() };
    let mut rest = text[open..].strip_prefix(['[', '('])?;
    loop {
        rest = rest.trim_start();
        if let Some(quoted) = rest.strip_prefix('"') {
            let (value, after) = quoted.split_once('"')?;
            node.values.push(value);
            rest = after;
        } else {
            let end = rest.find(['[', '(', ',', ']', ')'])?;
            if rest[end..].starts_with(['[', '(']) {
                let (child, after) = self::node(rest, depth)?;
                node.nodes.push(child);
                rest = after;
            } else {
                node.values.push(rest[..end].trim());
                rest = &rest[end..];
            }
        }
        rest = rest.trim_start();
        match rest.strip_prefix(',') {
            Some(after) => rest = after,
            None => return Some((node, rest.strip_prefix([']', ')'])?)),
        }
    }
}
