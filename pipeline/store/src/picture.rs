//! 8-bit PNG pictures and map tiles.

use crate::atomic::{self, Target};
use sastrugi_numeric::Grid;
use std::io;

/// Writes levels of grey with their opacity as a PNG.
///
/// # Errors
/// Too many pixels per side for a PNG, or a file that cannot be written.
pub fn write_grey<'a>(target: impl Into<Target<'a>>, pixels: &Grid<[u8; 2]>) -> io::Result<()> {
    atomic::write(target, &grey_png(pixels)?)
}

fn grey_png(pixels: &Grid<[u8; 2]>) -> io::Result<Vec<u8>> {
    let shape = [pixels.rows(), pixels.cols()];
    encode(shape, png::ColorType::GrayscaleAlpha, png::Compression::Balanced, pixels.values.as_flattened())
}

/// The bytes of an RGBA PNG, rows from the north; compressed fast, for pictures that are viewed once.
///
/// # Errors
/// Too many pixels per side for a PNG.
pub fn rgba_png(shape: [usize; 2], pixels: &[[u8; 4]]) -> io::Result<Vec<u8>> {
    encode(shape, png::ColorType::Rgba, png::Compression::Fast, pixels.as_flattened())
}

fn encode(
    [rows, cols]: [usize; 2],
    color: png::ColorType,
    compression: png::Compression,
    data: &[u8],
) -> io::Result<Vec<u8>> {
    let side = |n: usize| {
        u32::try_from(n).map_err(|_| io::Error::other(format!("{n} pixels per side are too many for a PNG")))
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side(cols)?, side(rows)?);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(compression);
    let mut writer = encoder.write_header().map_err(io::Error::other)?;
    writer.write_image_data(data).map_err(io::Error::other)?;
    writer.finish().map_err(io::Error::other)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    /// A PNG decoder returns every level.
    #[test]
    fn val_levels_are_read_back() {
        let levels: Vec<[u8; 2]> = (0..12).map(|k| [20 * k, if k % 3 == 0 { 0 } else { 255 }]).collect();
        let file = grey_png(&Grid::new(Geometry::square(3, 4, 1.0), levels.clone())).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(file)).read_info().unwrap();
        let mut out = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut out).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (4, 3, png::ColorType::GrayscaleAlpha));
        assert_eq!(out, levels.as_flattened());
        let colours: Vec<[u8; 4]> = (0..12).map(|k| [k, 2 * k, 255 - k, if k == 5 { 0 } else { 255 }]).collect();
        let file = rgba_png([3, 4], &colours).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(file)).read_info().unwrap();
        let mut out = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut out).unwrap();
        assert_eq!(out, colours.as_flattened());
    }
}
