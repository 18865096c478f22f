//! TIFF and GeoTIFF, read through `geotiff-reader`; a TIFF without GeoTIFF tags through `tiff`.
//!
//! `geotiff-reader` was chosen because it reads every combination of strips and tiles, LZW, deflate, Zstandard,
//! PackBits and LERC, predictors 1 to 3, BigTIFF and big-endian files tried bit for bit; it refuses files without
//! georeferencing. Both stand behind [`parse`].

use super::crs::{Crs, GeoKey};
use super::{Dem, DemInfo, Format, MAX_CELLS, ReadOptions, Refusal, cell_count};
use geotiff_reader::geokeys::{GeoKeyDirectory, GeoKeyValue};
use geotiff_reader::{GeoTiffFile, GeoTiffOpenOptions};
use sastrugi_numeric::{Geometry, Grid};
use std::io::Cursor;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

/// Raster bytes allowed per byte of file: Zstandard stores 128 KiB of one value in 4 bytes, and nothing does better.
const MAX_EXPANSION: u64 = 1 << 15;
/// Raster bytes allowed for any file.
const FREE_BYTES: u64 = 1 << 26;
const RASTER_PIXEL_IS_POINT: u16 = 2;
/// Note on a raster that says neither where it lies nor how large its cells are.
pub(super) const NO_CELL_SIZE: &str = "the file states no cell size; 1 m is assumed";
const SAMPLE_FORMATS_COMPLEX: [u16; 2] = [5, 6];
const PHOTOMETRIC_PALETTE: u16 = 3;

/// Reads a TIFF.
pub(super) fn parse(bytes: Vec<u8>, options: &ReadOptions) -> Result<Dem, Refusal> {
    let size = bytes.len() as u64;
    if let Some(mut decoder) = unreferenced(&bytes) {
        return parse_plain(&mut decoder, size, options);
    }
    let limits = GeoTiffOpenOptions { decode_output_bytes: MAX_CELLS as usize * 8, ..GeoTiffOpenOptions::default() };
    let file = GeoTiffFile::from_bytes_with_options(bytes, limits).map_err(|e| refused(&e))?;
    parse_georeferenced(&file, size, options)
}

/// A decoder of a TIFF that has no georeferencing.
fn unreferenced(bytes: &[u8]) -> Option<Decoder<Cursor<&[u8]>>> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MAX_CELLS as usize * 8;
    let mut decoder = Decoder::new(Cursor::new(bytes)).ok()?.with_limits(limits);
    let mut has = |tag| decoder.find_tag(tag).ok().flatten().is_some();
    let tags = [Tag::ModelPixelScaleTag, Tag::ModelTransformationTag, Tag::GeoKeyDirectoryTag];
    let referenced = tags.into_iter().any(&mut has);
    (!referenced).then_some(decoder)
}

fn refused(error: &dyn std::error::Error) -> Refusal {
    Refusal::new(format!("is no TIFF that can be read: {error}"))
}

fn parse_georeferenced(file: &GeoTiffFile, size: u64, options: &ReadOptions) -> Result<Dem, Refusal> {
    let ifd = file.tiff().ifd(file.base_ifd_index()).map_err(|e| refused(&e))?;
    single_band(u64::from(file.band_count()), ifd.photometric_interpretation())?;
    let sample_format = ifd.tag(Tag::SampleFormat.to_u16()).and_then(|tag| tag.value.as_u16());
    if sample_format.is_some_and(|format| SAMPLE_FORMATS_COMPLEX.contains(&format)) {
        return Err(Refusal::new("holds complex numbers, not heights"));
    }
    let layout = ifd.raster_layout().map_err(|e| refused(&e))?;
    let (rows, cols) = (u64::from(file.height()), u64::from(file.width()));
    affordable(cell_count(rows, cols)?, u64::from(layout.bits_per_sample).div_ceil(8), size)?;

    let nodata = file.nodata().and_then(parse_nodata);
    let (dtype, values) = read_samples(file, layout.sample_format, layout.bits_per_sample, nodata)?;
    let crs = Crs::from_keys(carried_keys(file.geokeys()));
    let mut notes = crs.unit_notes();
    let geometry = place(file, options, &mut notes)?;
    if values.len() != geometry.len() {
        return Err(Refusal::new(format!("holds {} values for {rows} x {cols} cells", values.len())));
    }
    let (grid, flipped) = north_up(file, Grid::new(geometry, values));
    notes.extend(flipped);
    let pixel_is_point = file.crs().raster_type == RASTER_PIXEL_IS_POINT;
    Ok(Dem { grid, info: DemInfo { format: Format::GeoTiff, dtype, nodata, crs, pixel_is_point, notes } })
}

fn single_band(bands: u64, photometric: Option<u16>) -> Result<(), Refusal> {
    if bands != 1 {
        return Err(Refusal::new(format!("has {bands} bands; a raster of heights has one")));
    }
    if photometric == Some(PHOTOMETRIC_PALETTE) {
        return Err(Refusal::new("holds palette colours, not heights"));
    }
    Ok(())
}

/// Refuses a raster that cannot have come from so few bytes.
fn affordable(cells: usize, bytes_per_cell: u64, size: u64) -> Result<(), Refusal> {
    let raster = cells as u64 * bytes_per_cell;
    if raster > FREE_BYTES.max(size.saturating_mul(MAX_EXPANSION)) {
        return Err(Refusal::new(format!("claims {cells} cells in a file of {size} bytes")));
    }
    Ok(())
}

fn read_samples(
    file: &GeoTiffFile,
    format: u16,
    bits: u16,
    nodata: Option<f64>,
) -> Result<(&'static str, Vec<f64>), Refusal> {
    macro_rules! read {
        ($t:ty, $name:literal) => {{
            let band = file.read_band::<$t>(0).map_err(|e| refused(&e))?;
            Ok(($name, band.iter().map(|&v| without(f64::from(v), nodata)).collect()))
        }};
    }
    match (format, bits) {
        (3, 32) => {
            // The text of a float32 raster's no-data value is rounded to float32 like the values.
            let nodata = nodata.map(|v| f64::from(v as f32));
            let band = file.read_band::<f32>(0).map_err(|e| refused(&e))?;
            Ok(("float32", band.iter().map(|&v| without(f64::from(v), nodata)).collect()))
        }
        (3, 64) => read!(f64, "float64"),
        (1, 8) => read!(u8, "uint8"),
        (2, 8) => read!(i8, "int8"),
        (1, 16) => read!(u16, "uint16"),
        (2, 16) => read!(i16, "int16"),
        (1, 32) => read!(u32, "uint32"),
        (2, 32) => read!(i32, "int32"),
        _ => Err(Refusal::new(format!("holds {bits}-bit values of TIFF sample format {format}, which are no heights"))),
    }
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
        return Err(Refusal::new("its rows are rotated; warp it to a north-up raster first"));
    }
    if t.pixel_width <= 0.0 {
        return Err(Refusal::new(format!("its columns run from east to west (pixel width {})", t.pixel_width)));
    }
    let south = t.origin_y + f64::min(0.0, t.pixel_height * rows as f64);
    Ok(Geometry { rows, cols, cell: [t.pixel_width, t.pixel_height.abs()], origin: [t.origin_x, south] })
}

/// Geometry of a raster that does not say where it lies.
pub(super) fn unplaced(rows: usize, cols: usize, options: &ReadOptions, notes: &mut Vec<String>) -> Geometry {
    let cell = options.cell_m.unwrap_or_else(|| {
        notes.push(NO_CELL_SIZE.to_owned());
        [1.0; 2]
    });
    Geometry { rows, cols, cell, origin: [0.0; 2] }
}

/// Turns a raster whose first row is the southern one.
fn north_up(file: &GeoTiffFile, grid: Grid) -> (Grid, Option<String>) {
    if file.transform().is_none_or(|t| t.pixel_height < 0.0) {
        return (grid, None);
    }
    let values = (0..grid.rows()).rev().flat_map(|r| grid.row(r).iter().copied()).collect();
    (Grid::new(grid.geometry, values), Some("its first row is the southern one; rows were turned".to_owned()))
}

/// A TIFF without any georeferencing.
fn parse_plain(decoder: &mut Decoder<Cursor<&[u8]>>, size: u64, options: &ReadOptions) -> Result<Dem, Refusal> {
    let bands = decoder.find_tag_unsigned::<u64>(Tag::SamplesPerPixel).map_err(|e| refused(&e))?;
    let photometric = decoder.find_tag_unsigned(Tag::PhotometricInterpretation).map_err(|e| refused(&e))?;
    single_band(bands.unwrap_or(1), photometric)?;
    let (cols, rows) = decoder.dimensions().map_err(|e| refused(&e))?;
    affordable(cell_count(u64::from(rows), u64::from(cols))?, 8, size)?;
    let nodata = decoder.get_tag_ascii_string(Tag::GdalNodata).ok().and_then(|text| parse_nodata(&text));
    let (dtype, values) = widened(decoder.read_image().map_err(|e| refused(&e))?, nodata)?;
    let mut notes = vec!["the TIFF has no georeferencing".to_owned()];
    let geometry = unplaced(rows as usize, cols as usize, options, &mut notes);
    if values.len() != geometry.len() {
        return Err(Refusal::new(format!("holds {} values for {rows} x {cols} cells", values.len())));
    }
    let crs = Crs::default();
    let info = DemInfo { format: Format::GeoTiff, dtype, nodata, crs, pixel_is_point: false, notes };
    Ok(Dem { grid: Grid::new(geometry, values), info })
}

fn widened(samples: DecodingResult, nodata: Option<f64>) -> Result<(&'static str, Vec<f64>), Refusal> {
    macro_rules! widen {
        ($values:expr, $name:literal) => {
            Ok(($name, $values.into_iter().map(|v| without(f64::from(v), nodata)).collect()))
        };
    }
    match samples {
        DecodingResult::F32(values) => {
            let nodata = nodata.map(|v| f64::from(v as f32));
            Ok(("float32", values.into_iter().map(|v| without(f64::from(v), nodata)).collect()))
        }
        DecodingResult::F64(values) => widen!(values, "float64"),
        DecodingResult::U8(values) => widen!(values, "uint8"),
        DecodingResult::I8(values) => widen!(values, "int8"),
        DecodingResult::U16(values) => widen!(values, "uint16"),
        DecodingResult::I16(values) => widen!(values, "int16"),
        DecodingResult::U32(values) => widen!(values, "uint32"),
        DecodingResult::I32(values) => widen!(values, "int32"),
        _ => Err(Refusal::new("holds values of a type that is no height")),
    }
}
