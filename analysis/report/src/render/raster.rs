//! Figures as PNG files, for documents and messages that do not accept SVG.
//!
//! The font is bundled, so that the same figure has the same bytes on any machine; characters outside it (scripts other than
//! Latin, Greek and Cyrillic) are drawn as empty boxes.

use crate::ReportError;
use resvg::{tiny_skia, usvg};
use std::sync::Arc;

/// DejaVu Sans, whose character widths `svg` uses.
const FONT: &[u8] = include_bytes!("fonts/DejaVuSans.ttf");
/// Its name.
const FAMILY: &str = "DejaVu Sans";
/// Pixels of the PNG per pixel of the figure: 192 dots per inch, sharp in print and on high-density screens.
const SCALE: f32 = 2.0;

/// An SVG figure as the bytes of a PNG file, with twice the width and height of the figure in pixels.
///
/// # Errors
/// [`ReportError::Raster`] when the text is not SVG, or the picture has no pixels or too many for the memory.
pub fn png(svg: &str) -> Result<Vec<u8>, ReportError> {
    let refused = |why: String| ReportError::Raster(why);
    let tree = usvg::Tree::from_str(svg, &options()).map_err(|e| refused(e.to_string()))?;
    let [width, height] = [tree.size().width(), tree.size().height()].map(|side| (SCALE * side).round() as u32);
    let pixels = tiny_skia::Pixmap::new(width, height);
    let mut pixels = pixels.ok_or_else(|| refused(format!("{width} × {height} pixels cannot be drawn")))?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
    pixels.encode_png().map_err(|e| refused(e.to_string()))
}

/// Options that replace every font family of a figure with the bundled one.
fn options() -> usvg::Options<'static> {
    let mut fonts = usvg::fontdb::Database::new();
    fonts.load_font_data(FONT.to_vec());
    fonts.set_sans_serif_family(FAMILY);
    usvg::Options { fontdb: Arc::new(fonts), font_family: FAMILY.to_owned(), ..usvg::Options::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::svg::{Anchor, Paint, Svg};

    /// Width and height of a PNG, and its pixels as RGBA.
    fn decoded(bytes: &[u8]) -> (u32, u32, Vec<u8>) {
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!(info.color_type, png::ColorType::Rgba);
        (info.width, info.height, pixels)
    }

    fn figure(draw: impl Fn(&mut Svg)) -> (u32, u32, Vec<u8>) {
        let mut svg = Svg::new(60.0, 20.0);
        svg.rect((0.0, 0.0), (60.0, 20.0), Paint::Paper, 1.0);
        draw(&mut svg);
        decoded(&super::png(&svg.finish("id", "title", "words")).unwrap())
    }

    #[test]
    fn val_shapes_are_placed_as_in_the_figure() {
        let (width, height, pixels) = figure(|svg| svg.rect((10.0, 5.0), (20.0, 10.0), Paint::Fixed([1, 2, 3]), 1.0));
        assert_eq!((width, height), (120, 40));
        let at = |x: usize, y: usize| &pixels[4 * (y * 120 + x)..][..4];
        assert_eq!([at(20, 10), at(59, 29)], [[1, 2, 3, 255]; 2]);
        assert_eq!([at(19, 10), at(60, 29), at(20, 9), at(59, 30)], [[255; 4]; 4]);
    }

    /// Text is drawn without any font of the machine.
    #[test]
    fn val_text_is_drawn_with_the_bundled_font() {
        for text in ["σ = 0.05 m²", "Скала", "Ångström"] {
            let (_, _, pixels) = figure(|svg| svg.text((0.0, 15.0), Anchor::Start, Paint::Ink, text));
            let dark = |i: usize| pixels[4 * i] < 128;
            let inked: Vec<usize> = (0..120 * 40).filter(|i| dark(*i)).collect();
            assert!(inked.len() > 100, "{text}: {} dark pixels", inked.len());
        }
    }

    #[test]
    fn val_invalid_figures_are_refused() {
        for bad in ["", "<svg", "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"0\" height=\"3\"/>"] {
            assert!(matches!(png(bad), Err(ReportError::Raster(_))), "{bad}");
        }
        let huge = Svg::new(1e9, 1e9).finish("id", "title", "words");
        assert!(matches!(png(&huge), Err(ReportError::Raster(_))));
    }
}
