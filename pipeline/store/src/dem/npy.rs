//! NumPy arrays, versions 1 to 3 (Kern, NumPy Enhancement Proposal 1): two-dimensional, real, row 0 north.

use super::band::Values;
use super::checks::{cell_count, unplaced_claim};
use super::crs::Crs;
use super::raster::{Claimed, Dem, DemInfo, Format, MAX_CELLS, ReadOptions, Refusal, unplaced};
use sastrugi_numeric::Grid;
use sastrugi_schemas::counted;
use std::path::Path;

/// True for the first bytes of an array's file.
pub(super) fn looks_like(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x93NUMPY")
}

/// Reads an array.
pub(super) fn parse(bytes: &[u8], options: &ReadOptions) -> Result<Dem, Refusal> {
    let (header, data) = split(bytes).ok_or_else(|| Refusal::new("its NumPy header is truncated or invalid"))?;
    let field = |name| field(header, name).ok_or_else(|| Refusal::new(format!("its NumPy header has no {name}")));
    let descr = field("descr")?.trim_matches(['\'', '"']);
    let (element, big_endian) = element(descr)?;
    let (rows, cols) = shape(field("shape")?)?;
    let fortran = match field("fortran_order")? {
        "True" => true,
        "False" => false,
        other => return Err(Refusal::new(format!("its NumPy header has fortran_order {other:?}"))),
    };
    let cells = cell_count(rows, cols)?;
    if data.len() != cells * element.bytes {
        let (found, expected) = (counted(data.len(), "byte"), cells * element.bytes);
        return Err(Refusal::new(format!("holds {found} of data; {rows} x {cols} cells need {expected}")));
    }
    let (rows, cols) = (rows as usize, cols as usize);
    let stored: Vec<f64> = data.chunks_exact(element.bytes).map(|v| (element.decode)(v, big_endian)).collect();
    let values = if fortran { transposed(&stored, rows, cols) } else { stored };
    let mut notes = vec![];
    let geometry = unplaced(rows, cols, options, &mut notes);
    let info = DemInfo {
        format: Format::Npy,
        dtype: element.name,
        nodata: None,
        crs: Crs::default(),
        values: Values::Heights,
        placed: false,
        pixel_is_point: false,
        notes,
    };
    Ok(Dem { grid: Grid::new(geometry, values), info })
}

/// Most bytes read for a header; NumPy's own headers have 128.
const HEADER_BYTES_MAX: u64 = 1 << 16;

/// Size according to the header.
pub(super) fn claimed(path: &Path, options: &ReadOptions) -> Option<Claimed> {
    let head = crate::file::head(path, HEADER_BYTES_MAX).ok()?;
    let (header, _) = split(&head)?;
    let (rows, cols) = shape(field(header, "shape")?).ok()?;
    let cell_m = options.cell_m.map(|[x, y]| x.min(y));
    let size = Claimed::size(rows.saturating_mul(cols).min(MAX_CELLS), 0, cell_m);
    Some(Claimed { geometry: unplaced_claim(rows, cols, options), ..size })
}

/// Header text and data.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (length, start) = match bytes.get(6)? {
        1 => (usize::from(u16::from_le_bytes(bytes.get(8..10)?.try_into().ok()?)), 10),
        2 | 3 => (u32::from_le_bytes(bytes.get(8..12)?.try_into().ok()?) as usize, 12),
        _ => return None,
    };
    let end = start + length;
    Some((std::str::from_utf8(bytes.get(start..end)?).ok()?, bytes.get(end..)?))
}

/// Text of a field of the header, which is a machine-written Python literal.
fn field<'a>(header: &'a str, name: &str) -> Option<&'a str> {
    let at = [format!("'{name}':"), format!("\"{name}\":")].iter().find_map(|k| Some(header.find(k)? + k.len()))?;
    let rest = header.get(at..)?.trim_start();
    let end = if rest.starts_with('(') { rest.find(')')? + 1 } else { rest.find([',', '}'])? };
    Some(rest.get(..end)?.trim())
}

fn shape(text: &str) -> Result<(u64, u64), Refusal> {
    let sizes: Vec<&str> = text.trim_matches(['(', ')']).split(',').map(str::trim).filter(|s| !s.is_empty()).collect();
    let parsed: Option<Vec<u64>> = sizes.iter().map(|s| s.parse().ok()).collect();
    match parsed.as_deref() {
        Some(&[rows, cols]) => Ok((rows, cols)),
        _ => Err(Refusal::new(format!("is an array of shape {text}; heights must have two dimensions"))),
    }
}

struct Element {
    name: &'static str,
    bytes: usize,
    decode: fn(&[u8], bool) -> f64,
}

fn element(descr: &str) -> Result<(Element, bool), Refusal> {
    macro_rules! element {
        ($t:ty, $name:literal) => {
            Element {
                name: $name,
                bytes: size_of::<$t>(),
                decode: |bytes, big_endian| {
                    let mut array = [0; size_of::<$t>()];
                    array.copy_from_slice(bytes);
                    let value = if big_endian { <$t>::from_be_bytes(array) } else { <$t>::from_le_bytes(array) };
                    value as f64
                },
            }
        };
    }
    let kind = descr.trim_start_matches(['<', '>', '|', '=']);
    let element = match kind {
        "f4" => element!(f32, "float32"),
        "f8" => element!(f64, "float64"),
        "i1" => element!(i8, "int8"),
        "u1" => element!(u8, "uint8"),
        "i2" => element!(i16, "int16"),
        "u2" => element!(u16, "uint16"),
        "i4" => element!(i32, "int32"),
        "u4" => element!(u32, "uint32"),
        "i8" => element!(i64, "int64"),
        "u8" => element!(u64, "uint64"),
        _ => return Err(Refusal::new(format!("holds elements of type {descr}; heights must be real numbers"))),
    };
    Ok((element, descr.starts_with('>')))
}

fn transposed(columns: &[f64], rows: usize, cols: usize) -> Vec<f64> {
    (0..rows).flat_map(|r| (0..cols).map(move |c| columns[c * rows + r])).collect()
}

/// The heights as a float64 array, `NaN` for no data, and a note on what is lost.
pub(super) fn render(grid: &Grid) -> (Vec<u8>, Vec<String>) {
    let shape = format!("({}, {})", grid.rows(), grid.cols());
    let dictionary = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    // Magic, version and length take 10 bytes; with the header they fill a multiple of 64 bytes and end in a line feed.
    let padding = 63 - (10 + dictionary.len()) % 64;
    let header = format!("{dictionary}{}\n", " ".repeat(padding));
    let mut bytes = Vec::with_capacity(10 + header.len() + grid.values.len() * 8);
    bytes.extend(b"\x93NUMPY\x01\x00");
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(grid.values.iter().flat_map(|v| v.to_le_bytes()));
    (bytes, vec!["a .npy file does not store cell size, position or CRS".to_owned()])
}
