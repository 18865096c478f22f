//! GeoTIFF writer for releases: one band, little-endian, tiles of 256 x 256, directory first, PixelIsArea.
//!
//! A cloud-optimised file also contains overviews down to one tile; each cell is the mean of up to 2 x 2 finite cells of the
//! level before (for codes, one of them). Directories come first, from the largest level to the smallest; then the tiles,
//! smallest level first.
//!
//! The writer is our own because the need is small and the bytes must depend on the grid alone, not on clock, host or CPU.
//! Deflate runs in `flate2`; the output of its pure-Rust backends does not depend on the CPU (their vector code only compares
//! and sums, with the same result), and a golden hash in the tests pins the bytes. Predictor 3 is that of Adobe Photoshop TIFF
//! Technical Note 3 (2005).

use super::band::{self, Values};
use super::checks::{check_single_precision, free_of_no_data_value};
use super::crs::{Crs, GeoKey, RASTER_TYPE};
use super::raster::{Compression, NO_DATA, Refusal, WriteOptions};
use flate2::write::ZlibEncoder;
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::RoughnessClass;
use std::io::Write;

const TILE: usize = 256;
/// Bytes before the first directory.
const HEADER: usize = 8;
/// Tag for the kind of an image: the full raster, or one of its overviews.
const SUBFILE: u16 = 254;
const FULL: u32 = 0;
const REDUCED: u32 = 1;
/// Upper bound on memory per cell while writing, bytes: the cell in single precision; and, if deflate gains nothing, the cell with its
/// share of the overviews, once in tiles and once in the file.
pub(super) const MEMORY_PER_CELL: u64 = 16;
/// Deflate level: the usual compromise.
const LEVEL: u32 = 6;
const COMPRESSION_NONE: u16 = 1;
const COMPRESSION_DEFLATE: u16 = 8;
/// As written by GDAL.
const COMPRESSION_ZSTD: u16 = 50000;
/// zstd's own default.
const ZSTD_LEVEL: i32 = 3;
const PREDICTOR_NONE: u16 = 1;
const PREDICTOR_FLOAT: u16 = 3;
const SAMPLE_UNSIGNED: u16 = 1;
const SAMPLE_FLOAT: u16 = 3;
const RASTER_PIXEL_IS_AREA: u16 = 1;
/// Heights as float32. In addition to the grid it needs [`MEMORY_PER_CELL`] bytes per cell.
pub(super) fn heights(grid: &Grid, crs: &Crs, options: &WriteOptions) -> Result<Vec<u8>, Refusal> {
    let compression = options.compression;
    check_single_precision(grid.values.iter().copied())?;
    let mut level = grid.to_f32();
    free_of_no_data_value(&level)?;
    let encode = |mut tile: Vec<f32>| {
        tile.iter_mut().filter(|v| v.is_nan()).for_each(|v| *v = NO_DATA as f32);
        match compression {
            Compression::None => Ok(tile.iter().flat_map(|v| v.to_le_bytes()).collect()),
            Compression::Deflate => deflated(&float_predicted(&tile)),
            Compression::Zstd => zstandard(&float_predicted(&tile)),
        }
    };
    let (code, predictor) = match compression {
        Compression::None => (COMPRESSION_NONE, PREDICTOR_NONE),
        Compression::Deflate => (COMPRESSION_DEFLATE, PREDICTOR_FLOAT),
        Compression::Zstd => (COMPRESSION_ZSTD, PREDICTOR_FLOAT),
    };
    let image = |subfile, level: &Grid<f32>| {
        let tags = [sample_tags(code, predictor, 32, SAMPLE_FLOAT), vec![Tag::long(SUBFILE, &[subfile])]].concat();
        image(tags, level, NO_DATA as f32, encode)
    };
    let mut full = image(FULL, &level)?;
    full.tags.push(Tag::ascii(band::TAG, &options.values.metadata()));
    full.tags.extend(georeference(&grid.geometry, crs)?);
    let mut images = vec![full];
    let reduced = if matches!(options.values, Values::Codes { .. }) { thinned } else { halved };
    while options.cloud_optimised && level.rows().max(level.cols()) > TILE {
        level = reduced(&level);
        images.push(image(REDUCED, &level)?);
    }
    assemble(images)
}

/// Geometry of the next level.
fn doubled(g: Geometry) -> Geometry {
    Geometry { rows: g.rows.div_ceil(2), cols: g.cols.div_ceil(2), cell: g.cell.map(|c| 2.0 * c), ..g }
}

/// The next level for codes: the north-western of 2 x 2 cells.
fn thinned(grid: &Grid<f32>) -> Grid<f32> {
    let geometry = doubled(grid.geometry);
    let code = |at: usize| grid.at(2 * (at / geometry.cols), 2 * (at % geometry.cols));
    Grid::new(geometry, (0..geometry.len()).map(code).collect())
}

/// The next level: half as many rows and columns, each cell the mean of the finite ones among 2 x 2.
fn halved(grid: &Grid<f32>) -> Grid<f32> {
    let g = grid.geometry;
    let geometry = doubled(g);
    let mean = |at: usize| {
        let (row, col) = (2 * (at / geometry.cols), 2 * (at % geometry.cols));
        let block = (row..(row + 2).min(g.rows)).flat_map(|r| (col..(col + 2).min(g.cols)).map(move |c| (r, c)));
        let finite = block.map(|(r, c)| f64::from(grid.values[r * g.cols + c])).filter(|v| v.is_finite());
        let (count, sum) = finite.fold((0.0, -0.0), |(count, sum), v| (count + 1.0, sum + v));
        (sum / count) as f32
    };
    Grid::new(geometry, (0..geometry.len()).into_par_iter().map(mean).collect())
}

/// Classes as 8-bit codes.
pub(super) fn classes(grid: &Grid<u8>, crs: &Crs) -> Result<Vec<u8>, Refusal> {
    let mut tags = sample_tags(COMPRESSION_DEFLATE, PREDICTOR_NONE, 8, SAMPLE_UNSIGNED);
    tags.push(Tag::long(SUBFILE, &[FULL]));
    let mut full = image(tags, grid, RoughnessClass::NO_DATA, |tile| deflated(&tile))?;
    full.tags.extend(georeference(&grid.geometry, crs)?);
    assemble(vec![full])
}

fn sample_tags(compression: u16, predictor: u16, bits: u16, format: u16) -> Vec<Tag> {
    vec![
        Tag::short(258, &[bits]),
        Tag::short(259, &[compression]),
        Tag::short(317, &[predictor]),
        Tag::short(339, &[format]),
    ]
}

/// One level of a file: its directory and its tiles.
struct Image {
    tags: Vec<Tag>,
    tiles: Vec<Vec<u8>>,
}

/// A level, from the tags that describe its samples and the samples themselves.
fn image<T: Copy + Send + Sync + std::fmt::Display>(
    mut tags: Vec<Tag>,
    grid: &Grid<T>,
    no_data: T,
    encode: impl Fn(Vec<T>) -> Result<Vec<u8>, Refusal> + Sync,
) -> Result<Image, Refusal> {
    let g = &grid.geometry;
    let (down, across) = (g.rows.div_ceil(TILE), g.cols.div_ceil(TILE));
    let tile = |n: usize| encode(cut(grid, n / across, n % across, no_data));
    let tiles = (0..down * across).into_par_iter().map(tile).collect::<Result<Vec<_>, _>>()?;
    tags.extend([
        Tag::long(256, &[to_u32(g.cols)?]),
        Tag::long(257, &[to_u32(g.rows)?]),
        Tag::short(262, &[1]),
        Tag::short(277, &[1]),
        Tag::short(284, &[1]),
        Tag::short(322, &[TILE as u16]),
        Tag::short(323, &[TILE as u16]),
        Tag::ascii(42113, &no_data.to_string()),
    ]);
    Ok(Image { tags, tiles })
}

fn to_u32(n: usize) -> Result<u32, Refusal> {
    u32::try_from(n).map_err(|_| Refusal::new("the raster does not fit in a TIFF of 4 GiB"))
}

/// Tile `(down, across)`, padded with no data.
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

/// A single frame from a single thread, for identical bytes everywhere.
fn zstandard(bytes: &[u8]) -> Result<Vec<u8>, Refusal> {
    zstd::bulk::compress(bytes, ZSTD_LEVEL).map_err(|e| Refusal::new(format!("zstd failed: {e}")))
}

/// Position and reference system of the full level.
fn georeference(g: &Geometry, crs: &Crs) -> Result<Vec<Tag>, Refusal> {
    Ok(place_tags(g).into_iter().chain(key_tags(crs)?).collect())
}

fn place_tags(g: &Geometry) -> [Tag; 2] {
    let north = g.origin[1] + g.rows as f64 * g.cell[1];
    [Tag::double(33550, &[g.cell[0], g.cell[1], 0.0]), Tag::double(33922, &[0.0, 0.0, 0.0, g.origin[0], north, 0.0])]
}

/// The key directory with its two value stores; none for a local plane (without it, PixelIsArea is implied).
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

/// An entry of the directory.
#[derive(Clone)]
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

    /// Bytes stored outside the entry, padded to an even number.
    fn outside(&self) -> usize {
        if self.bytes.len() > 4 { self.bytes.len().next_multiple_of(2) } else { 0 }
    }
}

/// Writes the header, the directory and values of each image, and the tiles, those of the last image first.
fn assemble(mut images: Vec<Image>) -> Result<Vec<u8>, Refusal> {
    const OFFSETS: u16 = 324;
    for Image { tags, tiles } in &mut images {
        let sizes = tiles.iter().map(|t| to_u32(t.len())).collect::<Result<Vec<_>, _>>()?;
        tags.push(Tag::long(OFFSETS, &vec![0; tiles.len()]));
        tags.push(Tag::long(325, &sizes));
        tags.sort_by_key(|tag| tag.id);
    }
    let padded = |tile: &Vec<u8>| tile.len().next_multiple_of(2);
    let tiles_at = HEADER + images.iter().map(Image::directory).sum::<usize>();
    let total = tiles_at + images.iter().flat_map(|image| &image.tiles).map(padded).sum::<usize>();
    to_u32(total)?;
    let mut at = tiles_at;
    for Image { tags, tiles } in images.iter_mut().rev() {
        let starts = tiles.iter().map(|tile| {
            let start = at as u32;
            at += padded(tile);
            start
        });
        let offsets = Tag::long(OFFSETS, &starts.collect::<Vec<_>>());
        tags.iter_mut().filter(|tag| tag.id == OFFSETS).for_each(|tag| *tag = offsets.clone());
    }

    let mut out = Vec::with_capacity(total);
    out.extend(b"II\x2a\0");
    out.extend((HEADER as u32).to_le_bytes());
    for (number, image) in images.iter().enumerate() {
        let next = if number + 1 < images.len() { out.len() + image.directory() } else { 0 };
        image.write_directory(&mut out, next);
    }
    // Each tile is dropped once it is in the output.
    for tile in images.into_iter().rev().flat_map(|image| image.tiles) {
        out.extend(tile);
        out.resize(out.len().next_multiple_of(2), 0);
    }
    Ok(out)
}

impl Image {
    /// Bytes of the entries, their count and the offset of the next directory.
    fn entries(&self) -> usize {
        2 + 12 * self.tags.len() + 4
    }

    /// Bytes of the directory including its values.
    fn directory(&self) -> usize {
        self.entries() + self.tags.iter().map(Tag::outside).sum::<usize>()
    }

    /// Appends the directory; `next` is the offset of the next one, 0 for none.
    fn write_directory(&self, out: &mut Vec<u8>, next: usize) {
        let mut at = out.len() + self.entries();
        out.extend((self.tags.len() as u16).to_le_bytes());
        for tag in &self.tags {
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
        out.extend((next as u32).to_le_bytes());
        for bytes in self.tags.iter().filter(|t| t.outside() > 0).map(|t| &t.bytes) {
            out.extend(bytes);
            out.resize(out.len().next_multiple_of(2), 0);
        }
    }
}
