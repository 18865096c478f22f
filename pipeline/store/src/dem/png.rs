//! Greyscale PNG: heights as 16-bit levels, for game engines and image programs.

use super::band::Values;
use super::checks::{cell_count, unplaced_claim};
use super::crs::Crs;
use super::raster::{Claimed, Dem, DemError, DemInfo, Format, MAX_CELLS, ReadOptions, Refusal, save, unplaced};
use crate::atomic::Target;
use sastrugi_numeric::Grid;
use sastrugi_schemas::counted;
use std::fs::File;
use std::io::{Cursor, Read, Seek};

/// Keyword of the text chunk with the scale from levels to heights.
const KEYWORD: &str = "sastrugi.height";

/// How levels of a 16-bit PNG become heights: `offset_m + step_m * level`; level 0 is no data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightScale {
    /// Height of level 0, m.
    pub offset_m: f64,
    /// Height of one level, m.
    pub step_m: f64,
}

impl HeightScale {
    /// Levels 1 to 65535 over the grid's range.
    fn of(grid: &Grid) -> Self {
        let (low, high) = grid.range().unwrap_or((0.0, 0.0));
        let step_m = if high > low { (high - low) / 65534.0 } else { 1.0 };
        Self { offset_m: low - step_m, step_m }
    }

    fn level(self, height: f64) -> u16 {
        if height.is_finite() { ((height - self.offset_m) / self.step_m).round().clamp(1.0, 65535.0) as u16 } else { 0 }
    }

    fn height(self, level: f64) -> f64 {
        if level == 0.0 { f64::NAN } else { self.offset_m + self.step_m * level }
    }

    /// The scale as a sentence.
    pub fn sentence(self, values: &Values) -> String {
        let what = if *values == Values::Heights { "heights" } else { "values" };
        let unit = values.unit().filter(|unit| *unit != "1").map_or_else(String::new, |unit| format!(" {unit}"));
        format!("{what} are {:?}{unit} + {:?}{unit} x level; level 0 is no data", self.offset_m, self.step_m)
    }

    fn parse(text: &str) -> Option<Self> {
        let (offset, step) = text.split_once(' ')?;
        let scale = Self { offset_m: offset.parse().ok()?, step_m: step.parse().ok()? };
        (scale.offset_m.is_finite() && scale.step_m.is_finite() && scale.step_m > 0.0).then_some(scale)
    }
}

/// True for the first bytes of a PNG.
pub(super) fn looks_like(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG")
}

/// Size according to the header: after the signature, and length and name of the first chunk, follow width and height.
pub(super) fn claimed(mut file: File, options: &ReadOptions) -> Option<Claimed> {
    let mut header = [0; 24];
    file.rewind().and_then(|()| file.read_exact(&mut header)).ok()?;
    let side = |at: usize| Some(u64::from(u32::from_be_bytes(header.get(at..at + 4)?.try_into().ok()?)));
    let (cols, rows) = (side(16)?, side(20)?);
    let cell_m = options.cell_m.map(|[x, y]| x.min(y));
    let size = Claimed::size(cols.saturating_mul(rows).min(MAX_CELLS), 0, cell_m);
    Some(Claimed { geometry: unplaced_claim(rows, cols, options), ..size })
}

/// Writes levels unscaled.
///
/// # Errors
/// The grid is too large for a PNG, or the file cannot be written.
pub fn write_png16<'a>(target: impl Into<Target<'a>>, grid: &Grid<u16>) -> Result<(), DemError> {
    let target = target.into();
    save(target, &levels(grid).map_err(|refusal| refusal.unfit(target.path))?)
}

/// The bytes of unscaled levels.
pub(super) fn levels(grid: &Grid<u16>) -> Result<Vec<u8>, Refusal> {
    encode(grid, None)
}

/// Writes heights as levels from the lowest (1) to the highest (65535), and returns the scale, which is also stored in a text
/// chunk of the file.
///
/// # Errors
/// As [`write_png16`].
pub fn write_png_heights<'a>(target: impl Into<Target<'a>>, grid: &Grid) -> Result<HeightScale, DemError> {
    let target = target.into();
    let (bytes, scale) = scaled(grid).map_err(|refusal| refusal.unfit(target.path))?;
    save(target, &bytes)?;
    Ok(scale)
}

/// The bytes of values as levels, and a note on their scale.
pub(super) fn render(grid: &Grid, values: &Values) -> Result<(Vec<u8>, Vec<String>), Refusal> {
    scaled(grid).map(|(bytes, scale)| (bytes, vec![scale.sentence(values)]))
}

fn scaled(grid: &Grid) -> Result<(Vec<u8>, HeightScale), Refusal> {
    let scale = HeightScale::of(grid);
    Ok((encode(&grid.map(|v| scale.level(v)), Some(scale))?, scale))
}

fn encode(grid: &Grid<u16>, scale: Option<HeightScale>) -> Result<Vec<u8>, Refusal> {
    let side =
        |n: usize| u32::try_from(n).map_err(|_| Refusal::new(format!("{n} pixels per side are too many for a PNG")));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side(grid.cols())?, side(grid.rows())?);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let failed = |e: png::EncodingError| Refusal::new(e.to_string());
    if let Some(scale) = scale {
        let text = format!("{} {}", scale.offset_m, scale.step_m);
        encoder.add_text_chunk(KEYWORD.to_owned(), text).map_err(failed)?;
    }
    let mut writer = encoder.write_header().map_err(failed)?;
    let data: Vec<u8> = grid.values.iter().flat_map(|v| v.to_be_bytes()).collect();
    writer.write_image_data(&data).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

/// Reads a greyscale PNG: heights if a text chunk gives the scale, levels otherwise.
pub(super) fn parse(bytes: &[u8], options: &ReadOptions) -> Result<Dem, Refusal> {
    let refused = |e: png::DecodingError| Refusal::new(format!("not a readable PNG: {e}"));
    let mut strict = png::DecodeOptions::default();
    // A damaged text chunk must not be skipped: it may hold the scale of the heights.
    strict.set_skip_ancillary_crc_failures(false);
    let mut reader = png::Decoder::new_with_options(Cursor::new(bytes), strict).read_info().map_err(refused)?;
    let info = reader.info();
    let (rows, cols, depth) = (u64::from(info.height), u64::from(info.width), info.bit_depth);
    let wide = match (info.color_type, depth) {
        (png::ColorType::Grayscale, png::BitDepth::Sixteen) => true,
        (png::ColorType::Grayscale, png::BitDepth::Eight) => false,
        (colour, depth) => {
            return Err(Refusal::new(format!("is a {colour:?} {depth:?} PNG; heights must be 8- or 16-bit greyscale")));
        }
    };
    let scale = info.uncompressed_latin1_text.iter().find(|t| t.keyword == KEYWORD).map(|t| {
        let wrong =
            || format!("text `{KEYWORD}` must be an offset and a step above 0, both in metres, got {:?}", t.text);
        HeightScale::parse(&t.text).ok_or_else(|| Refusal::new(wrong()))
    });
    let scale = scale.transpose()?;
    let cells = cell_count(rows, cols)?;
    // Deflate compresses by a factor of at most 1032.
    if cells as u64 > (bytes.len() as u64).saturating_mul(1032) {
        let (rows, cols) = (counted(rows, "row"), counted(cols, "column"));
        return Err(Refusal::new(format!("claims {rows} of {cols} in {} bytes", bytes.len())));
    }
    let mut data = vec![0; cells * if wide { 2 } else { 1 }];
    reader.next_frame(&mut data).map_err(refused)?;
    reader.finish().map_err(refused)?;
    let levels: Vec<f64> = if wide {
        data.chunks_exact(2).map(|v| f64::from(u16::from_be_bytes([v[0], v[1]]))).collect()
    } else {
        data.iter().map(|&v| f64::from(v)).collect()
    };
    let mut notes = vec![];
    if scale.is_none() {
        notes.push("the PNG has no height scale; levels are treated as metres".to_owned());
    }
    let values = levels.into_iter().map(|level| scale.map_or(level, |s| s.height(level))).collect();
    let geometry = unplaced(rows as usize, cols as usize, options, &mut notes);
    let info = DemInfo {
        format: Format::Png,
        dtype: if wide { "uint16" } else { "uint8" },
        nodata: None,
        crs: Crs::default(),
        values: Values::Heights,
        placed: false,
        pixel_is_point: false,
        notes,
    };
    Ok(Dem { grid: Grid::new(geometry, values), info })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    /// A text chunk damaged anywhere is refused: without it, levels would be read as metres.
    #[test]
    fn val_damaged_scales_are_refused() {
        let g = Geometry::square(8, 9, 1.0);
        let grid = Grid::new(g, (0..72).map(|k| 100.0 + 0.01 * f64::from(k)).collect());
        let (bytes, _) = scaled(&grid).unwrap();
        let start = bytes.windows(4).position(|name| name == b"tEXt").unwrap();
        let length = u32::from_be_bytes(bytes[start - 4..start].try_into().unwrap()) as usize;
        let options = ReadOptions::default();
        assert!(parse(&bytes, &options).unwrap().info.notes.iter().all(|note| !note.contains("no height scale")));
        for at in start - 4..start + 4 + length + 4 {
            for bit in 0..8 {
                let mut damaged = bytes.clone();
                damaged[at] ^= 1 << bit;
                assert!(parse(&damaged, &options).is_err(), "byte {at}, bit {bit}");
            }
        }
    }

    #[test]
    fn val_invalid_scales_are_refused() {
        for text in ["1.0", "1.0 zero", "1.0 0", "1.0 -2", "inf 1.0", "1.0 1.0 1.0"] {
            assert_eq!(HeightScale::parse(text), None, "{text}");
        }
        assert_eq!(HeightScale::parse("-2.5 0.001"), Some(HeightScale { offset_m: -2.5, step_m: 0.001 }));
    }
}
