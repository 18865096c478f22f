//! ESRI ASCII grids: a header of keys and values, then rows from the north.

use super::band::Values;
use super::checks::{cell_count, free_of_no_data_value};
use super::crs::Crs;
use super::raster::{Claimed, Dem, DemInfo, Format, NO_DATA, Refusal};
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::counted;
use std::fmt::Write;
use std::io::ErrorKind;
use std::iter::Peekable;
use std::path::{Path, PathBuf};

/// Cell sizes of common global grids in arc seconds. No grid in metres has them by chance, because in degrees they have no short
/// decimal form.
const ARC_SECONDS: [f64; 10] = [1.0 / 9.0, 1.0 / 3.0, 1.0, 2.0, 3.0, 5.0, 6.0, 10.0, 15.0, 30.0];

/// Bytes of a file that are searched for its header.
const HEADER_BYTES_MAX: u64 = 1 << 12;

/// Bytes of a `.prj` file that are read.
const PRJ_BYTES_MAX: u64 = 1 << 16;

/// Beginnings of systems in well-known text, and whether they are in degrees. Those of a plane without a place on the globe count as projected.
const SYSTEMS: [(&str, bool); 6] = [
    ("PROJ", false),
    ("LOCAL_CS", false),
    ("ENGCRS", false),
    ("ENGINEERINGCRS", false),
    ("GEOG", true),
    ("GEOD", true),
];

/// True for the text of an ESRI ASCII grid: its first word is a header key.
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    words(bytes).next().is_some_and(|word| matches!(Key::of(word), Some(Key::Columns | Key::Rows)))
}

/// Whitespace-separated words of the file.
fn words(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Key {
    Columns,
    Rows,
    XCorner,
    YCorner,
    XCentre,
    YCentre,
    Cell,
    CellX,
    CellY,
    NoData,
}

impl Key {
    fn of(word: &[u8]) -> Option<Self> {
        match word.to_ascii_lowercase().as_slice() {
            b"ncols" => Some(Self::Columns),
            b"nrows" => Some(Self::Rows),
            b"xllcorner" => Some(Self::XCorner),
            b"yllcorner" => Some(Self::YCorner),
            b"xllcenter" => Some(Self::XCentre),
            b"yllcenter" => Some(Self::YCentre),
            b"cellsize" => Some(Self::Cell),
            b"dx" | b"xdim" => Some(Self::CellX),
            b"dy" | b"ydim" => Some(Self::CellY),
            b"nodata_value" | b"nodata" => Some(Self::NoData),
            _ => None,
        }
    }
}

#[derive(Default)]
struct Header {
    rows: Option<u64>,
    cols: Option<u64>,
    corner: [Option<f64>; 2],
    centre: [Option<f64>; 2],
    cell: [Option<f64>; 2],
    nodata: Option<f64>,
}

impl Header {
    /// The keys and numbers before the first height.
    fn read<'a>(words: &mut Peekable<impl Iterator<Item = &'a [u8]>>) -> Result<Self, Refusal> {
        let mut header = Self::default();
        while let Some(key) = words.peek().copied().and_then(Key::of) {
            words.next();
            let value = words.next().ok_or_else(|| Refusal::new("the header of the ASCII grid is truncated"))?;
            header.set(key, value)?;
        }
        Ok(header)
    }

    fn set(&mut self, key: Key, word: &[u8]) -> Result<(), Refusal> {
        match key {
            Key::Columns => self.cols = Some(count(word, "ncols")?),
            Key::Rows => self.rows = Some(count(word, "nrows")?),
            Key::XCorner => self.corner[0] = Some(number(word)?),
            Key::YCorner => self.corner[1] = Some(number(word)?),
            Key::XCentre => self.centre[0] = Some(number(word)?),
            Key::YCentre => self.centre[1] = Some(number(word)?),
            Key::Cell => self.cell = [Some(number(word)?); 2],
            Key::CellX => self.cell[0] = Some(number(word)?),
            Key::CellY => self.cell[1] = Some(number(word)?),
            Key::NoData => self.nodata = Some(number(word)?),
        }
        Ok(())
    }

    fn geometry(&self) -> Result<Geometry, Refusal> {
        let missing = |what: &str| Refusal::new(format!("the header of the ASCII grid has no {what}"));
        let (rows, cols) = (self.rows.ok_or_else(|| missing("nrows"))?, self.cols.ok_or_else(|| missing("ncols"))?);
        cell_count(rows, cols)?;
        let mut cell = [0.0; 2];
        let mut origin = [0.0; 2];
        for axis in 0..2 {
            cell[axis] = self.cell[axis].ok_or_else(|| missing("cellsize"))?;
            let centre = self.centre[axis].map(|c| c - 0.5 * cell[axis]);
            origin[axis] = self.corner[axis].or(centre).ok_or_else(|| missing("xllcorner and yllcorner"))?;
        }
        Ok(Geometry { rows: rows as usize, cols: cols as usize, cell, origin })
    }
}

fn quoted(word: &[u8]) -> String {
    let start: String = String::from_utf8_lossy(word).chars().take(24).collect();
    format!("\"{}\"", start.escape_debug())
}

fn number(word: &[u8]) -> Result<f64, Refusal> {
    let parsed = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
    parsed.ok_or_else(|| Refusal::new(format!("the ASCII grid contains {} instead of a number", quoted(word))))
}

fn count(word: &[u8], key: &str) -> Result<u64, Refusal> {
    let parsed = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
    parsed.ok_or_else(|| Refusal::new(format!("{key} of the ASCII grid must be a count, got {}", quoted(word))))
}

/// Reads an ESRI ASCII grid, with its `.prj` file if there is one.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Dem, Refusal> {
    let mut words = words(bytes).peekable();
    let header = Header::read(&mut words)?;
    let geometry = header.geometry()?;
    let cells = geometry.len();
    // Every value takes a character and a separator.
    if cells as u64 * 2 - 1 > bytes.len() as u64 {
        let (rows, cols) = (counted(geometry.rows, "row"), counted(geometry.cols, "column"));
        return Err(Refusal::new(format!("claims {rows} of {cols} in {} bytes", bytes.len())));
    }
    let (values, integers) = read_values(words, cells, header.nodata)?;
    let (crs, notes) = crs_of(path, &geometry)?;
    let dtype = if integers { "int32" } else { "float32" };
    let info = DemInfo {
        format: Format::EsriAscii,
        dtype,
        nodata: header.nodata,
        crs,
        values: Values::Heights,
        placed: true,
        pixel_is_point: false,
        notes,
    };
    Ok(Dem { grid: Grid::new(geometry, values), info })
}

/// Size and position according to the header and the `.prj` file.
pub(super) fn claimed(path: &Path) -> Option<Claimed> {
    let head = crate::file::head(path, HEADER_BYTES_MAX).ok()?;
    let mut words = words(&head).peekable();
    let header = Header::read(&mut words).ok()?;
    // If nothing follows the header, the bytes read may end in the middle of a number.
    words.peek()?;
    let geometry = header.geometry().ok()?;
    Some(Claimed::raster(geometry, crs_of(path, &geometry).ok()?.0.geographic))
}

/// The file that states the system of a grid, which need not exist.
pub(super) fn prj_beside(path: &Path) -> PathBuf {
    path.with_extension("prj")
}

/// The system of a grid: that of its `.prj` file, or a guess without one.
fn crs_of(path: &Path, geometry: &Geometry) -> Result<(Crs, Vec<String>), Refusal> {
    let prj = prj_beside(path);
    let refused = |why: &str| {
        let name = prj.file_name().unwrap_or_default().to_string_lossy();
        Refusal::new(format!(
            "the file {name} beside it {why}; write the system of the grid as well-known text, or move the file elsewhere if it does not describe the grid"
        ))
    };
    match crate::file::head(&prj, PRJ_BYTES_MAX) {
        Ok(text) => named_crs(&String::from_utf8_lossy(&text))
            .map(|crs| (crs, vec![]))
            .ok_or_else(|| refused("does not state a projected or geographic coordinate system as well-known text")),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(guess_crs(geometry)),
        Err(e) => Err(refused(&format!("cannot be read ({e})"))),
    }
}

fn read_values<'a>(
    words: impl Iterator<Item = &'a [u8]>,
    cells: usize,
    nodata: Option<f64>,
) -> Result<(Vec<f64>, bool), Refusal> {
    let mut values = Vec::with_capacity(cells);
    let mut integers = true;
    for word in words {
        if values.len() == cells {
            return Err(Refusal::new(format!(
                "has more than the {} that its header declares",
                counted(cells, "value")
            )));
        }
        let value = number(word)?;
        integers &= word.iter().all(|b| matches!(b, b'0'..=b'9' | b'-' | b'+'));
        values.push(if Some(value) == nodata { f64::NAN } else { value });
    }
    if values.len() < cells {
        let declared = counted(cells, "value");
        return Err(Refusal::new(format!("has {} of the {declared} that its header declares", values.len())));
    }
    Ok((values, integers))
}

/// Kind and name of the system in a `.prj` file: well-known text, or the older form that begins with a line such as `Projection UTM`.
fn named_crs(text: &str) -> Option<Crs> {
    let text = text.trim_start_matches('\u{feff}');
    let of_kind = |name: &str, geographic: bool| {
        let crs = if geographic { Crs::wgs84() } else { Crs::default() };
        Crs { name: name.to_owned(), ..crs }
    };
    let mut words = text.split_whitespace();
    if words.next()?.eq_ignore_ascii_case("projection") {
        return words.next().map(|name| of_kind(name, name.eq_ignore_ascii_case("geographic")));
    }
    let parts: Vec<&str> = text.split('"').collect();
    let outside: String = parts.iter().step_by(2).map(|part| part.to_ascii_uppercase()).collect();
    let count = |brackets: [char; 2]| outside.matches(brackets).count();
    // A truncated text.
    if parts.len() < 3 || parts.len().is_multiple_of(2) || count(['[', '(']) != count([']', ')']) {
        return None;
    }
    // A projected system contains a geographic one.
    let found = SYSTEMS.iter().filter_map(|(word, geographic)| Some((outside.find(word)?, *geographic)));
    found.min().map(|(_, geographic)| of_kind(parts[1], geographic))
}

/// The format has no reference system; coordinates on the globe with a common arc-second spacing are treated as degrees.
fn guess_crs(g: &Geometry) -> (Crs, Vec<String>) {
    let [width, height] = g.size();
    let on_globe = g.origin[0] >= -180.01
        && g.origin[0] + width <= 360.01
        && g.origin[1] >= -90.01
        && g.origin[1] + height <= 90.01;
    let seconds = 3600.0 * g.cell[1];
    if on_globe && ARC_SECONDS.iter().any(|s| (seconds / s - 1.0).abs() < 1e-5) {
        let note = format!("coordinates are treated as degrees on WGS 84 (cells of {seconds:.4} arc seconds)");
        return (Crs::wgs84(), vec![note]);
    }
    (Crs::default(), vec!["the file names no reference system; coordinates are treated as metres".to_owned()])
}

/// The grid as text, with the shortest decimals that read back to the same numbers, and notes on what is lost.
pub(super) fn render(grid: &Grid, crs: &Crs) -> Result<(Vec<u8>, Vec<String>), Refusal> {
    free_of_no_data_value(grid)?;
    let g = &grid.geometry;
    let cell = if g.cell[0] == g.cell[1] {
        format!("cellsize {}", g.cell[0])
    } else {
        format!("dx {}\ndy {}", g.cell[0], g.cell[1])
    };
    let mut text = format!(
        "ncols {}\nnrows {}\nxllcorner {}\nyllcorner {}\n{cell}\nNODATA_value {NO_DATA}\n",
        g.cols, g.rows, g.origin[0], g.origin[1]
    );
    for row in 0..g.rows {
        for (col, &value) in grid.row(row).iter().enumerate() {
            let separator = if col + 1 == g.cols { '\n' } else { ' ' };
            let value = if value.is_nan() { NO_DATA } else { value };
            // Writing to a string cannot fail.
            let _ = write!(text, "{value}{separator}");
        }
    }
    Ok((text.into_bytes(), crs.loss_notes()))
}
