//! TIFF and GeoTIFF, read through `geotiff-reader`; a TIFF without GeoTIFF tags through `tiff`.
//!
//! `geotiff-reader` was chosen because it reads all tested combinations of strips and tiles, LZW, deflate, Zstandard, PackBits
//! and LERC, predictors 1 to 3, BigTIFF and big-endian files bit for bit; it refuses files without georeferencing. [`parse`]
//! and, for row-wise reading, [`Raster`] wrap both.

use super::band::{self, Values};
use super::checks::cell_count;
use super::crs::{Crs, GeoKey};
use super::raster::{Claimed, Dem, DemError, DemInfo, Format, MAX_CELLS, ReadOptions, Refusal, unplaced};
use geotiff_reader::geokeys::{GeoKeyDirectory, GeoKeyValue};
use geotiff_reader::{GeoTiffFile, GeoTiffOpenOptions};
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::counted;
use std::error::Error;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::iter::successors;
use std::ops::Range;
use std::path::Path;
use tiff::decoder::ifd::Value;
use tiff::decoder::{ChunkType, Decoder, DecodingResult, IfdDecoder, Limits};
use tiff::tags::Tag;
use tiff_reader::TiffError;

/// Raster bytes allowed per byte of file: Zstandard, the best case, stores 128 KiB of one value in 4 bytes.
const MAX_EXPANSION: u64 = 1 << 15;
/// Raster bytes allowed for any file, however small.
const FREE_BYTES: u64 = 1 << 26;
/// Most bytes of decoded strips and tiles kept for the next read.
const KEPT_BYTES_MAX: u64 = 1 << 28;
/// Most strips and tiles kept.
const KEPT_BLOCKS_MAX: usize = 1 << 14;
/// Cells decoded together when the whole raster is read.
const TOGETHER_CELLS: usize = 1 << 20;
const RASTER_PIXEL_IS_POINT: u16 = 2;
const SAMPLE_FORMATS_COMPLEX: [u16; 2] = [5, 6];
const PHOTOMETRIC_PALETTE: u16 = 3;

/// True for the first bytes of a TIFF.
pub(super) fn looks_like(bytes: &[u8]) -> bool {
    matches!(bytes, [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..])
}

/// Reads a TIFF from its file, strip by strip or tile by tile.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Dem, DemError> {
    Raster::open(path, options, 0)?.whole().map_err(|refusal| refusal.about(path))
}

/// Size and position according to the header.
pub(super) fn claimed(path: &Path, options: &ReadOptions) -> Option<Claimed> {
    let Raster { geometry, info, .. } = Raster::open(path, options, 0).ok()?;
    Some(Claimed::raster(geometry, info.crs.geographic))
}

/// Reads a TIFF that is in memory.
pub(super) fn parse(bytes: Vec<u8>, options: &ReadOptions) -> Result<Dem, Refusal> {
    let size = bytes.len() as u64;
    let raster = if unreferenced(Cursor::new(&bytes[..])).is_some() {
        Raster::plain(unreferenced(Cursor::new(bytes)), size, options)?
    } else {
        let file = GeoTiffFile::from_bytes_with_options(bytes, limits([0, 0])).map_err(|e| refused(&e))?;
        Raster::referenced(file, size, options)?
    };
    raster.whole()
}

/// Options of a decoder whose cache is limited to a number of decoded strips or tiles and to a number of bytes.
fn limits([block_cache_slots, block_cache_bytes]: [usize; 2]) -> GeoTiffOpenOptions {
    let decode_output_bytes = MAX_CELLS as usize * 8;
    GeoTiffOpenOptions { decode_output_bytes, block_cache_slots, block_cache_bytes, ..GeoTiffOpenOptions::default() }
}

/// Number and bytes of the strips or tiles in `rows_of_blocks` rows of them, at most [`KEPT_BYTES_MAX`].
fn kept(file: &GeoTiffFile, rows_of_blocks: usize) -> Result<[usize; 2], Refusal> {
    let ifd = file.tiff().ifd(file.base_ifd_index()).map_err(|e| refused(&e))?;
    let bits = ifd.raster_layout().map_err(|e| refused(&e))?.bits_per_sample;
    let (wide, high) = match (ifd.tile_width(), ifd.tile_height()) {
        (Some(wide), Some(high)) if ifd.is_tiled() => (wide, high),
        _ => (file.width(), ifd.rows_per_strip()),
    };
    let blocks = rows_of_blocks.saturating_mul(file.width().div_ceil(wide.max(1)) as usize);
    let cells = u64::from(wide).saturating_mul(u64::from(high.min(file.height())));
    let bytes = cells.saturating_mul(u64::from(bits).div_ceil(8)).saturating_mul(blocks as u64);
    // Every cache slot takes memory of its own.
    Ok([blocks.min(KEPT_BLOCKS_MAX), bytes.min(KEPT_BYTES_MAX) as usize])
}

/// A decoder for a TIFF without georeferencing; `None` if it has some.
fn unreferenced<R: Read + Seek>(reader: R) -> Option<Decoder<R>> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MAX_CELLS as usize * 8;
    let mut decoder = Decoder::new(reader).ok()?.with_limits(limits);
    let tags = [Tag::ModelPixelScaleTag, Tag::ModelTransformationTag, Tag::GeoKeyDirectoryTag];
    let ifd = decoder.image_ifd();
    let referenced = tags.into_iter().any(|tag| ifd.directory().contains(tag));
    (!referenced).then_some(decoder)
}

fn refused(error: &(dyn Error + 'static)) -> Refusal {
    let cause = successors(Some(error), |&e| e.source()).find_map(|e| e.downcast_ref());
    match cause {
        Some(TiffError::DecodeOutputAllocationFailed { requested, .. }) => {
            Refusal::lack_of_memory(format!("out of memory: {requested} bytes cannot be allocated"))
        }
        _ => Refusal::new(format!("not a readable TIFF: {error}")),
    }
}

/// An open TIFF of heights, with nothing decoded yet.
pub(super) struct Raster<R: Read + Seek> {
    pixels: Pixels<R>,
    pub geometry: Geometry,
    pub info: DemInfo,
    /// Rows that are decoded together: those of a strip or a tile.
    pub block_rows: usize,
}

enum Pixels<R: Read + Seek> {
    Referenced {
        file: Box<GeoTiffFile>,
        /// Sample format and bits.
        stored: (u16, u16),
        /// The first row is the southern one.
        south_first: bool,
    },
    Plain(Box<Decoder<R>>),
}

impl Raster<BufReader<File>> {
    /// Opens a TIFF for row-wise reading. `rows_of_blocks` rows of decoded strips or tiles are kept for the next read.
    pub fn open(path: &Path, options: &ReadOptions, rows_of_blocks: usize) -> Result<Self, DemError> {
        let reading = |e| DemError::reading(path, e);
        let file = crate::file::open(path).map_err(reading)?;
        let size = file.metadata().map_err(reading)?.len();
        let plain = unreferenced(BufReader::new(file));
        let raster = if plain.is_some() {
            Self::plain(plain, size, options)
        } else {
            let keeping = |blocks| GeoTiffFile::open_with_options(path, limits(blocks)).map_err(|e| refused(&e));
            let file = keeping([0, 0]).and_then(|file| match rows_of_blocks {
                0 => Ok(file),
                _ => kept(&file, rows_of_blocks).and_then(keeping),
            });
            file.and_then(|file| Self::referenced(file, size, options))
        };
        raster.map_err(|refusal| refusal.about(path))
    }
}

impl<R: Read + Seek> Raster<R> {
    fn referenced(file: GeoTiffFile, size: u64, options: &ReadOptions) -> Result<Self, Refusal> {
        let ifd = file.tiff().ifd(file.base_ifd_index()).map_err(|e| refused(&e))?;
        single_band(u64::from(file.band_count()), ifd.photometric_interpretation())?;
        let sample_format = ifd.tag(Tag::SampleFormat.to_u16()).and_then(|tag| tag.value.as_u16());
        if sample_format.is_some_and(|format| SAMPLE_FORMATS_COMPLEX.contains(&format)) {
            return Err(Refusal::new("holds complex numbers, not heights"));
        }
        let layout = ifd.raster_layout().map_err(|e| refused(&e))?;
        let stored = (layout.sample_format, layout.bits_per_sample);
        affordable(file.height(), file.width(), u64::from(stored.1).div_ceil(8), size)?;
        let dtype = dtype(stored.0, stored.1)?;
        let nodata = file.nodata().and_then(parse_nodata);
        let crs = Crs::from_keys(carried_keys(file.geokeys()));
        let metadata = ifd.tag(band::TAG);
        let values = metadata.and_then(|tag| tag.value.as_str()).map(Values::of_metadata).unwrap_or_default();
        let mut notes = crs.unit_notes();
        notes.extend(values.note());
        let placed = file.transform().is_some();
        let geometry = place(&file, options, &mut notes)?;
        let south_first = file.transform().is_some_and(|t| t.pixel_height >= 0.0);
        if south_first {
            notes.push("the first row is the southern one; rows were flipped".to_owned());
        }
        let pixel_is_point = file.crs().raster_type == RASTER_PIXEL_IS_POINT;
        let info = DemInfo { format: Format::GeoTiff, dtype, nodata, crs, values, placed, pixel_is_point, notes };
        let tile = ifd.tile_width().zip(ifd.tile_height()).filter(|_| ifd.is_tiled());
        if let Some((wide, high)) = tile {
            affordable(high, wide, u64::from(stored.1).div_ceil(8), size)?;
        }
        let block_rows = tile.map_or_else(|| ifd.rows_per_strip(), |(_, high)| high);
        let block_rows = (block_rows as usize).clamp(1, geometry.rows);
        Ok(Self {
            pixels: Pixels::Referenced { file: Box::new(file), stored, south_first },
            geometry,
            info,
            block_rows,
        })
    }

    /// A TIFF without any georeferencing.
    fn plain(decoder: Option<Decoder<R>>, size: u64, options: &ReadOptions) -> Result<Self, Refusal> {
        let mut decoder = decoder.ok_or_else(|| Refusal::new("not a readable TIFF"))?;
        check_counts(&decoder.image_ifd(), size)?;
        let mut number = |tag| decoder.find_tag_unsigned::<u64>(tag).map_err(|e| refused(&e));
        let bands = number(Tag::SamplesPerPixel)?.unwrap_or(1);
        let photometric = number(Tag::PhotometricInterpretation)?.and_then(|n| u16::try_from(n).ok());
        let stored = [number(Tag::SampleFormat)?.unwrap_or(1), number(Tag::BitsPerSample)?.unwrap_or(1)];
        single_band(bands, photometric)?;
        let (cols, rows) = decoder.dimensions().map_err(|e| refused(&e))?;
        affordable(rows, cols, 8, size)?;
        let [format, bits] = stored.map(|n| u16::try_from(n).unwrap_or(u16::MAX));
        let dtype = dtype(format, bits)?;
        let mut text = |tag| match decoder.find_tag(tag) {
            Ok(found) => found.map(Value::into_string).transpose().map_err(|e| refused(&e)),
            Err(e) => Err(refused(&e)),
        };
        let nodata = text(Tag::GdalNodata)?.and_then(|text| parse_nodata(&text));
        // Metadata may be in any encoding, and most of it is for other programs.
        let metadata = text(Tag::Unknown(band::TAG)).ok().flatten();
        let values = metadata.map(|text| Values::of_metadata(&text)).unwrap_or_default();
        let mut notes = vec!["the TIFF has no georeferencing".to_owned()];
        notes.extend(values.note());
        let geometry = unplaced(rows as usize, cols as usize, options, &mut notes);
        let crs = Crs::default();
        let (placed, pixel_is_point) = (false, false);
        let info = DemInfo { format: Format::GeoTiff, dtype, nodata, crs, values, placed, pixel_is_point, notes };
        let (wide, high) = decoder.chunk_dimensions();
        if wide == 0 || high == 0 {
            return Err(Refusal::new("has empty strips or tiles"));
        }
        // A strip may state more rows than the raster has, by default 2^32 - 1; a tile is decoded whole.
        let high = if decoder.get_chunk_type() == ChunkType::Strip { high.min(rows) } else { high };
        affordable(high, wide, 8, size)?;
        let block_rows = (high as usize).min(geometry.rows);
        Ok(Self { pixels: Pixels::Plain(Box::new(decoder)), geometry, info, block_rows })
    }

    fn whole(mut self) -> Result<Dem, Refusal> {
        let Geometry { rows, cols, .. } = self.geometry;
        let mut values = Vec::with_capacity(cell_count(rows as u64, cols as u64)?);
        let step = (TOGETHER_CELLS / cols).max(1).next_multiple_of(self.block_rows);
        for first in (0..rows).step_by(step) {
            self.add_window(first..(first + step).min(rows), 0..cols, &mut values)?;
        }
        Ok(Dem { grid: Grid::new(self.geometry, values), info: self.info })
    }

    /// Heights of rows (from the north) and columns, which must be in range; `NaN` means no data.
    pub fn window(&mut self, rows: Range<usize>, cols: Range<usize>) -> Result<Vec<f64>, Refusal> {
        let mut values = Vec::with_capacity(rows.len() * cols.len());
        self.add_window(rows, cols, &mut values)?;
        Ok(values)
    }

    /// Appends what [`Self::window`] returns.
    fn add_window(&mut self, rows: Range<usize>, cols: Range<usize>, values: &mut Vec<f64>) -> Result<(), Refusal> {
        let (g, nodata, before) = (&self.geometry, self.info.nodata, values.len());
        match &mut self.pixels {
            Pixels::Plain(decoder) => values.extend(plain_window(decoder, g, nodata, &rows, &cols)?),
            Pixels::Referenced { file, stored, south_first: false } => {
                stored_window(file, *stored, nodata, &rows, &cols, values)?;
            }
            Pixels::Referenced { file, stored, south_first: true } => {
                let from_south = g.rows - rows.end..g.rows - rows.start;
                let mut flipped = Vec::with_capacity(rows.len() * cols.len());
                stored_window(file, *stored, nodata, &from_south, &cols, &mut flipped)?;
                values.extend(flipped.chunks_exact(cols.len()).rev().flatten());
            }
        }
        let (found, count, wide) = (values.len() - before, rows.len(), cols.len());
        if found != count * wide {
            return Err(Refusal::new(format!("holds {found} values for {count} x {wide} cells")));
        }
        Ok(())
    }
}

fn single_band(bands: u64, photometric: Option<u16>) -> Result<(), Refusal> {
    if bands != 1 {
        return Err(Refusal::new(format!("has {bands} bands; a raster of heights must have one")));
    }
    if photometric == Some(PHOTOMETRIC_PALETTE) {
        return Err(Refusal::new("holds palette colours, not heights"));
    }
    Ok(())
}

/// Refuses a tag with more values than the file has bytes: the decoder allocates memory for a text of any length.
fn check_counts(ifd: &IfdDecoder<'_>, size: u64) -> Result<(), Refusal> {
    match ifd.directory().iter().map(|(_, entry)| entry.count()).find(|count| *count > size) {
        Some(count) => Err(Refusal::new(format!("claims {count} values of a tag in a file of {size} bytes"))),
        None => Ok(()),
    }
}

/// Refuses a raster too large to be stored in so few bytes.
fn affordable(rows: u32, cols: u32, bytes_per_cell: u64, size: u64) -> Result<(), Refusal> {
    if rows == 0 || cols == 0 {
        return Err(Refusal::new(format!("has no cells ({}, {})", counted(rows, "row"), counted(cols, "column"))));
    }
    let cells = u64::from(rows) * u64::from(cols);
    if cells.saturating_mul(bytes_per_cell) > FREE_BYTES.max(size.saturating_mul(MAX_EXPANSION)) {
        return Err(Refusal::new(format!("claims {cells} cells in a file of {size} bytes")));
    }
    Ok(())
}

/// Name of the type of stored heights.
fn dtype(format: u16, bits: u16) -> Result<&'static str, Refusal> {
    match (format, bits) {
        (3, 32) => Ok("float32"),
        (3, 64) => Ok("float64"),
        (1, 8) => Ok("uint8"),
        (2, 8) => Ok("int8"),
        (1, 16) => Ok("uint16"),
        (2, 16) => Ok("int16"),
        (1, 32) => Ok("uint32"),
        (2, 32) => Ok("int32"),
        _ => Err(Refusal::new(format!(
            "holds {bits}-bit values of TIFF sample format {format}, which is not supported for heights"
        ))),
    }
}

/// Appends rows and columns of a georeferenced file, in the file's own order, to `values`.
fn stored_window(
    file: &GeoTiffFile,
    stored: (u16, u16),
    nodata: Option<f64>,
    rows: &Range<usize>,
    cols: &Range<usize>,
    values: &mut Vec<f64>,
) -> Result<(), Refusal> {
    macro_rules! read {
        ($t:ty, $nodata:expr) => {{
            let band = file.read_band_window::<$t>(0, rows.start, cols.start, rows.len(), cols.len());
            let band = band.map_err(|e| refused(&e))?;
            let nodata = $nodata;
            match band.as_slice() {
                Some(band) => values.extend(band.iter().map(|&v| without(f64::from(v), nodata))),
                None => values.extend(band.iter().map(|&v| without(f64::from(v), nodata))),
            }
            Ok(())
        }};
    }
    match stored {
        (3, 32) => read!(f32, single(nodata)),
        (3, 64) => read!(f64, nodata),
        (1, 8) => read!(u8, nodata),
        (2, 8) => read!(i8, nodata),
        (1, 16) => read!(u16, nodata),
        (2, 16) => read!(i16, nodata),
        (1, 32) => read!(u32, nodata),
        (2, 32) => read!(i32, nodata),
        (format, bits) => dtype(format, bits).map(drop),
    }
}

/// Rounds the no-data value of a float32 raster, which is stored as text, to float32 like the values.
fn single(nodata: Option<f64>) -> Option<f64> {
    nodata.map(|v| f64::from(v as f32))
}

fn without(value: f64, nodata: Option<f64>) -> f64 {
    if Some(value) == nodata { f64::NAN } else { value }
}

fn parse_nodata(text: &str) -> Option<f64> {
    text.trim_matches(|c: char| c.is_whitespace() || c == '\0').parse().ok()
}

fn carried_keys(directory: &GeoKeyDirectory) -> Vec<(u16, GeoKey)> {
    let value = |v: &GeoKeyValue| match v {
        GeoKeyValue::Short(v) => GeoKey::Short(*v),
        GeoKeyValue::Double(v) => GeoKey::Double(v.clone()),
        GeoKeyValue::Ascii(v) => GeoKey::Ascii(v.clone()),
    };
    directory.keys.iter().map(|key| (key.id, value(&key.value))).collect()
}

fn place(file: &GeoTiffFile, options: &ReadOptions, notes: &mut Vec<String>) -> Result<Geometry, Refusal> {
    let (rows, cols) = (file.height() as usize, file.width() as usize);
    let Some(t) = file.transform() else {
        return Ok(unplaced(rows, cols, options, notes));
    };
    if t.skew_x != 0.0 || t.skew_y != 0.0 {
        return Err(Refusal::new("the raster is rotated; warp it to north-up first"));
    }
    if t.pixel_width <= 0.0 {
        return Err(Refusal::new(format!(
            "columns run from east to west (pixel width {}); flip the raster first",
            t.pixel_width
        )));
    }
    let south = t.origin_y + f64::min(0.0, t.pixel_height * rows as f64);
    Ok(Geometry { rows, cols, cell: [t.pixel_width, t.pixel_height.abs()], origin: [t.origin_x, south] })
}

/// Rows and columns of a file without georeferencing, cut from the strips or tiles that hold them.
fn plain_window<R: Read + Seek>(
    decoder: &mut Decoder<R>,
    g: &Geometry,
    nodata: Option<f64>,
    rows: &Range<usize>,
    cols: &Range<usize>,
) -> Result<Vec<f64>, Refusal> {
    let (wide, high) = decoder.chunk_dimensions();
    let (wide, high) = ((wide as usize).min(g.cols), (high as usize).min(g.rows));
    let across = g.cols.div_ceil(wide);
    let mut values = vec![f64::NAN; rows.len() * cols.len()];
    for band in rows.start / high..rows.end.div_ceil(high) {
        for k in cols.start / wide..cols.end.div_ceil(wide) {
            let index = u32::try_from(band * across + k).map_err(|e| refused(&e))?;
            let part = widened(decoder.read_chunk(index).map_err(|e| refused(&e))?, nodata)?;
            let (col, part_cols) = (k * wide, wide.min(g.cols - k * wide));
            let (from, to) = (cols.start.max(col), cols.end.min(col + part_cols));
            for (line, row) in part.chunks_exact(part_cols).zip(band * high..).filter(|(_, row)| rows.contains(row)) {
                let at = (row - rows.start) * cols.len() + from - cols.start;
                values[at..at + to - from].copy_from_slice(&line[from - col..to - col]);
            }
        }
    }
    Ok(values)
}

fn widened(samples: DecodingResult, nodata: Option<f64>) -> Result<Vec<f64>, Refusal> {
    macro_rules! widen {
        ($values:expr, $nodata:expr) => {
            Ok($values.into_iter().map(|v| without(f64::from(v), $nodata)).collect())
        };
    }
    match samples {
        DecodingResult::F32(values) => widen!(values, single(nodata)),
        DecodingResult::F64(values) => widen!(values, nodata),
        DecodingResult::U8(values) => widen!(values, nodata),
        DecodingResult::I8(values) => widen!(values, nodata),
        DecodingResult::U16(values) => widen!(values, nodata),
        DecodingResult::I16(values) => widen!(values, nodata),
        DecodingResult::U32(values) => widen!(values, nodata),
        DecodingResult::I32(values) => widen!(values, nodata),
        _ => Err(Refusal::new("holds values of a type that is not supported for heights")),
    }
}
