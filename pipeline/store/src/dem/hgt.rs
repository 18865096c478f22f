//! SRTM tiles: one degree of big-endian 16-bit posts, 1201 or 3601 per side; the outer ones are shared with the neighbours.
//! The name gives the south-western post; posts are cell centres, so the grid extends half a cell beyond the degree.

use super::band::Values;
use super::crs::Crs;
use super::raster::{Claimed, Dem, DemInfo, Format, Refusal};
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::counted;
use std::fs::File;
use std::path::Path;

const VOID: i16 = i16::MIN;
const SIDES: [usize; 2] = [1201, 3601];

/// Reads a tile.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Dem, Refusal> {
    let side = SIDES.into_iter().find(|n| n * n * 2 == bytes.len()).ok_or_else(|| {
        Refusal::new(format!(
            "has {}; an .hgt tile has 2884802 (3 arc seconds) or 25934402 (1 arc second)",
            counted(bytes.len(), "byte")
        ))
    })?;
    let geometry = tile(corner(path)?, side);
    let height = |post: &[u8]| match i16::from_be_bytes([post[0], post[1]]) {
        VOID => f64::NAN,
        v => f64::from(v),
    };
    let values = bytes.chunks_exact(2).map(height).collect();
    let info = DemInfo {
        format: Format::Hgt,
        dtype: "int16",
        nodata: Some(f64::from(VOID)),
        crs: Crs::wgs84(),
        values: Values::Heights,
        placed: true,
        pixel_is_point: true,
        notes: vec![],
    };
    Ok(Dem { grid: Grid::new(geometry, values), info })
}

/// Size and position according to name and length of the file.
pub(super) fn claimed(path: &Path, file: &File) -> Option<Claimed> {
    let bytes = file.metadata().ok()?.len();
    let side = SIDES.into_iter().find(|n| (n * n * 2) as u64 == bytes)?;
    Some(Claimed::raster(tile(corner(path).ok()?, side), true))
}

fn tile(corner: [f64; 2], side: usize) -> Geometry {
    let cell = 1.0 / (side - 1) as f64;
    Geometry { rows: side, cols: side, cell: [cell; 2], origin: corner.map(|c| c - 0.5 * cell) }
}

/// Longitude and latitude of the south-western post, from a name such as `N44W072` (endings and suffixes ignored).
fn corner(path: &Path) -> Result<[f64; 2], Refusal> {
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
    parse_corner(name)
        .ok_or_else(|| Refusal::new("an .hgt tile must be named after its south-western corner, such as N44W072.hgt"))
}

fn parse_corner(name: &str) -> Option<[f64; 2]> {
    let signed = |text: &str, positive: char, negative: char, limit: u16| {
        let letter = text.chars().next()?.to_ascii_uppercase();
        let digits = text.get(1..)?;
        let degrees: u16 = digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse().ok())??;
        let sign = if letter == positive { 1.0 } else { -1.0 };
        ((letter == positive || letter == negative) && degrees <= limit).then_some(sign * f64::from(degrees))
    };
    Some([signed(name.get(3..7)?, 'E', 'W', 180)?, signed(name.get(..3)?, 'N', 'S', 90)?])
}

/// The grid as a tile of whole metres.
pub(super) fn render(path: &Path, grid: &Grid, crs: &Crs) -> Result<(Vec<u8>, Vec<String>), Refusal> {
    let g = &grid.geometry;
    if g.rows != g.cols || !SIDES.contains(&g.rows) {
        let shape = format!("{} x {}", g.rows, g.cols);
        return Err(Refusal::new(format!("an .hgt tile must have 1201 x 1201 or 3601 x 3601 posts, got {shape}")));
    }
    let expected = tile(corner(path)?, g.rows);
    let shift = (0..2).map(|a| (g.origin[a] - expected.origin[a]).abs()).fold(0.0, f64::max);
    if crs.geographic && shift > 0.5 * expected.cell[0] {
        return Err(Refusal::new(format!("the grid is {shift} degrees away from the position in the file name")));
    }
    let mut bytes = Vec::with_capacity(g.len() * 2);
    for &value in &grid.values {
        bytes.extend(post(value)?.to_be_bytes());
    }
    let mut notes = vec!["heights are rounded to whole metres in an .hgt tile".to_owned()];
    if !crs.geographic {
        notes.push("an .hgt tile covers one degree; the grid's own cell size and position are lost".to_owned());
    }
    Ok((bytes, notes))
}

fn post(value: f64) -> Result<i16, Refusal> {
    let metres = value.round();
    if value.is_nan() {
        Ok(VOID)
    } else if metres > f64::from(VOID) && metres <= f64::from(i16::MAX) {
        Ok(metres as i16)
    } else {
        Err(Refusal::new(format!("the height {value} m does not fit in 16 bits")))
    }
}
