//! Pictures to look at: 8-bit grey PNG.

use crate::atomic::{self, Target};
use sastrugi_numeric::Grid;
use std::io;

/// Writes levels of grey with their opacity as a PNG.
///
/// # Errors
/// Too many pixels a side for a PNG, or a file that cannot be written.
pub fn write_grey<'a>(target: impl Into<Target<'a>>, pixels: &Grid<[u8; 2]>) -> io::Result<()> {
    atomic::write(target, &grey_png(pixels)?)
}

fn grey_png(pixels: &Grid<[u8; 2]>) -> io::Result<Vec<u8>> {
    let side =
        |n: usize| u32::try_from(n).map_err(|_| io::Error::other(format!("{n} pixels a side are too many for a PNG")));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side(pixels.cols())?, side(pixels.rows())?);
    encoder.set_color(png::ColorType::GrayscaleAlpha);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(io::Error::other)?;
    writer.write_image_data(pixels.values.as_flattened()).map_err(io::Error::other)?;
    writer.finish().map_err(io::Error::other)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    /// A PNG decoder gives back every level.
    #[test]
    fn val_levels_come_back() {
        let levels: Vec<[u8; 2]> = (0..12).map(|k| [20 * k, if k % 3 == 0 { 0 } else { 255 }]).collect();
        let file = grey_png(&Grid::new(Geometry::square(3, 4, 1.0), levels.clone())).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(file)).read_info().unwrap();
        let mut out = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut out).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (4, 3, png::ColorType::GrayscaleAlpha));
        assert_eq!(out, levels.as_flattened());
    }
}
