//! GeoTIFF as releases hold it: one band, little-endian, tiles of 256 x 256, directory first, PixelIsArea.
//!
//! A writer of our own, because what is needed is small and its bytes must follow from the grid alone: no clock, no
//! host, no CPU. Deflate runs in `flate2`; whichever pure-Rust backend it is built with chooses its output without
//! regard to the CPU (vector code there compares and sums, with the same result), and a golden hash in the tests holds
//! the bytes. Predictor 3 is that of Adobe Photoshop TIFF Technical Note 3 (2005).

use super::crs::{Crs, GeoKey, RASTER_TYPE};
use super::{Compression, NO_DATA, Refusal, free_of_no_data_value};
use flate2::write::ZlibEncoder;
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::RoughnessClass;
use std::io::Write;

const TILE: usize = 256;
/// Level of deflate: the usual compromise.
const LEVEL: u32 = 6;
const COMPRESSION_NONE: u16 = 1;
const COMPRESSION_DEFLATE: u16 = 8;
/// As GDAL writes it.
const COMPRESSION_ZSTD: u16 = 50000;
/// zstd's own default.
const ZSTD_LEVEL: i32 = 3;
const PREDICTOR_NONE: u16 = 1;
const PREDICTOR_FLOAT: u16 = 3;
const SAMPLE_UNSIGNED: u16 = 1;
const SAMPLE_FLOAT: u16 = 3;
const RASTER_PIXEL_IS_AREA: u16 = 1;
/// Unit of the band, where GDAL looks for it.
const UNIT_METRE: &str =
    "<GDALMetadata>\n  <Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">m</Item>\n</GDALMetadata>\n";

/// Heights as float32.
pub(super) fn heights(grid: &Grid, crs: &Crs, compression: Compression) -> Result<Vec<u8>, Refusal> {
    let rounded = grid.as_stored();
    free_of_no_data_value(&rounded)?;
    let stored: Vec<f32> = rounded.values.iter().map(|&v| if v.is_nan() { NO_DATA } else { v } as f32).collect();
    if let Some(at) = stored.iter().position(|v| v.is_infinite()) {
        return Err(Refusal::new(format!("the height {} m does not fit in single precision", grid.values[at])));
    }
    let stored = Grid::new(grid.geometry, stored);
    let encode = |tile: Vec<f32>| match compression {
        Compression::None => Ok(tile.iter().flat_map(|v| v.to_le_bytes()).collect()),
        Compression::Deflate => deflated(&float_predicted(&tile)),
        Compression::Zstd => zstandard(&float_predicted(&tile)),
    };
    let (code, predictor) = match compression {
        Compression::None => (COMPRESSION_NONE, PREDICTOR_NONE),
        Compression::Deflate => (COMPRESSION_DEFLATE, PREDICTOR_FLOAT),
        Compression::Zstd => (COMPRESSION_ZSTD, PREDICTOR_FLOAT),
    };
    let mut tags = sample_tags(code, predictor, 32, SAMPLE_FLOAT);
    tags.push(Tag::ascii(42112, UNIT_METRE));
    file(tags, &stored, crs, NO_DATA as f32, encode)
}

/// Classes as 8-bit codes.
pub(super) fn classes(grid: &Grid<u8>, crs: &Crs) -> Result<Vec<u8>, Refusal> {
    let tags = sample_tags(COMPRESSION_DEFLATE, PREDICTOR_NONE, 8, SAMPLE_UNSIGNED);
    file(tags, grid, crs, RoughnessClass::NO_DATA, |tile| deflated(&tile))
}

fn sample_tags(compression: u16, predictor: u16, bits: u16, format: u16) -> Vec<Tag> {
    vec![
        Tag::short(258, &[bits]),
        Tag::short(259, &[compression]),
        Tag::short(317, &[predictor]),
        Tag::short(339, &[format]),
    ]
}

/// A file from the tags that describe samples, and the samples.
fn file<T: Copy + Send + Sync + std::fmt::Display>(
    mut tags: Vec<Tag>,
    grid: &Grid<T>,
    crs: &Crs,
    no_data: T,
    encode: impl Fn(Vec<T>) -> Result<Vec<u8>, Refusal> + Sync,
) -> Result<Vec<u8>, Refusal> {
    let g = &grid.geometry;
    let (down, across) = (g.rows.div_ceil(TILE), g.cols.div_ceil(TILE));
    let tile = |n: usize| encode(cut(grid, n / across, n % across, no_data));
    let tiles = (0..down * across).into_par_iter().map(tile).collect::<Result<Vec<_>, _>>()?;
    tags.extend([
        Tag::long(254, &[0]),
        Tag::long(256, &[to_u32(g.cols)?]),
        Tag::long(257, &[to_u32(g.rows)?]),
        Tag::short(262, &[1]),
        Tag::short(277, &[1]),
        Tag::short(284, &[1]),
        Tag::short(322, &[TILE as u16]),
        Tag::short(323, &[TILE as u16]),
        Tag::ascii(42113, &no_data.to_string()),
    ]);
    tags.extend(place_tags(g));
    tags.extend(key_tags(crs)?);
    assemble(tags, &tiles)
}

fn to_u32(n: usize) -> Result<u32, Refusal> {
    u32::try_from(n).map_err(|_| Refusal::new("the raster does not fit in a TIFF of 4 GiB"))
}

/// Tile `(down, across)`, filled up with no data.
fn cut<T: Copy>(grid: &Grid<T>, down: usize, across: usize, no_data: T) -> Vec<T> {
    let mut tile = vec![no_data; TILE * TILE];
    let (row0, col0) = (down * TILE, across * TILE);
    let cols = TILE.min(grid.cols() - col0);
    for (row, line) in (row0..grid.rows()).zip(tile.chunks_exact_mut(TILE)) {
        line[..cols].copy_from_slice(&grid.row(row)[col0..col0 + cols]);
    }
    tile
}

/// Each row as its four byte planes, most significant first, then as differences of neighbouring bytes.
fn float_predicted(tile: &[f32]) -> Vec<u8> {
    let mut out = Vec::with_capacity(tile.len() * 4);
    for row in tile.chunks_exact(TILE) {
        let planes = (0..4).flat_map(|plane| row.iter().map(move |v| v.to_be_bytes()[plane]));
        let mut previous = 0u8;
        out.extend(planes.map(|byte| {
            let difference = byte.wrapping_sub(previous);
            previous = byte;
            difference
        }));
    }
    out
}

fn deflated(bytes: &[u8]) -> Result<Vec<u8>, Refusal> {
    let mut encoder = ZlibEncoder::new(Vec::with_capacity(bytes.len() / 2), flate2::Compression::new(LEVEL));
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.map_err(|e| Refusal::new(format!("deflate failed: {e}")))
}

/// One frame, one thread: the same bytes everywhere.
fn zstandard(bytes: &[u8]) -> Result<Vec<u8>, Refusal> {
    zstd::bulk::compress(bytes, ZSTD_LEVEL).map_err(|e| Refusal::new(format!("zstd failed: {e}")))
}

fn place_tags(g: &Geometry) -> [Tag; 2] {
    let north = g.origin[1] + g.rows as f64 * g.cell[1];
    [Tag::double(33550, &[g.cell[0], g.cell[1], 0.0]), Tag::double(33922, &[0.0, 0.0, 0.0, g.origin[0], north, 0.0])]
}

/// The key directory with its two stores of values; none for a local plane (PixelIsArea is what its absence means).
fn key_tags(crs: &Crs) -> Result<Vec<Tag>, Refusal> {
    if crs.keys.is_empty() {
        return Ok(vec![]);
    }
    const DOUBLES: u16 = 34736;
    const TEXTS: u16 = 34737;
    let raster_type = (RASTER_TYPE, GeoKey::Short(RASTER_PIXEL_IS_AREA));
    let mut keys: Vec<&(u16, GeoKey)> = crs.keys.iter().chain([&raster_type]).collect();
    keys.sort_by_key(|(id, _)| *id);
    let small = |n: usize| u16::try_from(n).map_err(|_| Refusal::new("the GeoTIFF keys do not fit in their directory"));
    let (mut directory, mut doubles, mut text) = (vec![1, 1, 0, small(keys.len())?], vec![], String::new());
    for (id, key) in keys {
        directory.extend(match key {
            GeoKey::Short(code) => [*id, 0, 1, *code],
            GeoKey::Double(values) => {
                let at = small(doubles.len())?;
                doubles.extend_from_slice(values);
                [*id, DOUBLES, small(values.len())?, at]
            }
            GeoKey::Ascii(value) => {
                let at = small(text.len())?;
                text.push_str(value);
                text.push('|');
                [*id, TEXTS, small(value.len() + 1)?, at]
            }
        });
    }
    let mut tags = vec![Tag::short(34735, &directory)];
    if !doubles.is_empty() {
        tags.push(Tag::double(DOUBLES, &doubles));
    }
    if !text.is_empty() {
        tags.push(Tag::ascii(TEXTS, &text));
    }
    Ok(tags)
}

/// One entry of the directory.
struct Tag {
    id: u16,
    kind: u16,
    count: usize,
    bytes: Vec<u8>,
}

impl Tag {
    fn ascii(id: u16, text: &str) -> Self {
        let bytes = [text.as_bytes(), &[0]].concat();
        Self { id, kind: 2, count: bytes.len(), bytes }
    }
    fn short(id: u16, values: &[u16]) -> Self {
        Self { id, kind: 3, count: values.len(), bytes: values.iter().flat_map(|v| v.to_le_bytes()).collect() }
    }
    fn long(id: u16, values: &[u32]) -> Self {
        Self { id, kind: 4, count: values.len(), bytes: values.iter().flat_map(|v| v.to_le_bytes()).collect() }
    }
    fn double(id: u16, values: &[f64]) -> Self {
        Self { id, kind: 12, count: values.len(), bytes: values.iter().flat_map(|v| v.to_le_bytes()).collect() }
    }

    /// Bytes outside of the entry, padded to an even number.
    fn outside(&self) -> usize {
        if self.bytes.len() > 4 { self.bytes.len().next_multiple_of(2) } else { 0 }
    }
}

/// Header, directory, values of the directory, tiles.
fn assemble(mut tags: Vec<Tag>, tiles: &[Vec<u8>]) -> Result<Vec<u8>, Refusal> {
    const OFFSETS: u16 = 324;
    let sizes = tiles.iter().map(|t| to_u32(t.len())).collect::<Result<Vec<_>, _>>()?;
    tags.push(Tag::long(OFFSETS, &vec![0; tiles.len()]));
    tags.push(Tag::long(325, &sizes));
    tags.sort_by_key(|tag| tag.id);
    let values_at = 8 + 2 + 12 * tags.len() + 4;
    let tiles_at = values_at + tags.iter().map(Tag::outside).sum::<usize>();
    let total = tiles_at + tiles.iter().map(|t| t.len().next_multiple_of(2)).sum::<usize>();
    to_u32(total)?;
    let starts = tiles.iter().scan(tiles_at as u32, |at, tile| {
        let start = *at;
        *at += tile.len().next_multiple_of(2) as u32;
        Some(start)
    });
    let offsets = Tag::long(OFFSETS, &starts.collect::<Vec<_>>());
    if let Some(tag) = tags.iter_mut().find(|tag| tag.id == OFFSETS) {
        *tag = offsets;
    }

    let mut out = Vec::with_capacity(total);
    out.extend(b"II\x2a\0\x08\0\0\0");
    out.extend((tags.len() as u16).to_le_bytes());
    let mut at = values_at;
    for tag in &tags {
        out.extend(tag.id.to_le_bytes());
        out.extend(tag.kind.to_le_bytes());
        out.extend((tag.count as u32).to_le_bytes());
        if tag.outside() > 0 {
            out.extend((at as u32).to_le_bytes());
            at += tag.outside();
        } else {
            out.extend(&tag.bytes);
            out.extend(&[0; 4][tag.bytes.len()..]);
        }
    }
    out.extend([0; 4]);
    for bytes in tags.iter().filter(|t| t.outside() > 0).map(|t| &t.bytes).chain(tiles) {
        out.extend(bytes);
        out.resize(out.len().next_multiple_of(2), 0);
    }
    Ok(out)
}
