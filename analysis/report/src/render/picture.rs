//! Rasters as PNG data URIs: shaded relief, deviations, shaded classes.

use super::colour::{self, Map, Rgb};
use super::thin;
use crate::ReportError;
use base64::Engine;
use sastrugi_imaging::{display, hillshade::hillshade};
use sastrugi_numeric::Grid;
use sastrugi_schemas::RoughnessClass;

/// A raster ready to be placed on a page, and the ground it covers.
#[derive(Clone, Debug)]
pub struct Picture {
    /// PNG as a data URI.
    pub data_uri: String,
    /// Extent east-west and north-south, m.
    pub size_m: [f64; 2],
    /// South-west corner, m.
    pub origin_m: [f64; 2],
    /// Columns and rows of the picture.
    pub pixels: [usize; 2],
}

/// Shades of the relief under classes.
const SHADES: usize = 63;

/// Heights coloured over `range` and shaded, with at most `most` pixels along a side.
///
/// # Errors
/// When the picture cannot be encoded.
pub fn relief(grid: &Grid, range: (f64, f64), exaggeration: f64, most: usize) -> Result<Picture, ReportError> {
    let thin = thinned(grid, most);
    Ok(placed(grid, data_uri(&shaded(&thin, range, exaggeration)?), [thin.cols(), thin.rows()]))
}

/// As [`relief`], between the lowest and the highest height: the bytes of a PNG file, and its columns and rows.
///
/// # Errors
/// When the picture cannot be encoded.
pub fn relief_png(grid: &Grid, exaggeration: f64, most: usize) -> Result<(Vec<u8>, [usize; 2]), ReportError> {
    let thin = thinned(grid, most);
    let range = thin.range().unwrap_or((0.0, 0.0));
    Ok((shaded(&thin, range, exaggeration)?, [thin.cols(), thin.rows()]))
}

fn shaded(thin: &Grid, range: (f64, f64), exaggeration: f64) -> Result<Vec<u8>, ReportError> {
    let shade = hillshade(thin, exaggeration);
    let map = colour::heights();
    rgb(thin, |i| lit(colour::pick(&map, share(thin.values[i], range)), shade.values[i]))
}

/// Values coloured over `range`, not shaded.
pub fn values(grid: &Grid, range: (f64, f64), most: usize) -> Result<Picture, ReportError> {
    coloured(grid, &colour::heights(), range, most)
}

/// Deviations coloured over `[-limit, limit]`, not shaded.
pub fn deviations(grid: &Grid, limit: f64, most: usize) -> Result<Picture, ReportError> {
    coloured(grid, &colour::deviations(), (-limit, limit), most)
}

/// Brightness as a camera shows it, with `white` as the brightness of white; pixels that see no ground are transparent.
///
/// # Errors
/// When the picture cannot be encoded.
pub fn brightness(image: &Grid, white: f64, most: usize) -> Result<Picture, ReportError> {
    let thin = thinned(image, most);
    let levels = display::grey(&thin, white);
    let png =
        encode_as(png::ColorType::GrayscaleAlpha, [thin.cols(), thin.rows()], levels.values.as_flattened(), None)?;
    Ok(placed(image, data_uri(&png), [thin.cols(), thin.rows()]))
}

fn coloured(grid: &Grid, map: &Map, range: (f64, f64), most: usize) -> Result<Picture, ReportError> {
    let thin = thinned(grid, most);
    let png = rgb(&thin, |i| colour::pick(map, share(thin.values[i], range)))?;
    Ok(placed(grid, data_uri(&png), [thin.cols(), thin.rows()]))
}

/// Classes in pale shades of their colours, over the relief.
pub fn classes(
    codes: &Grid<u8>,
    heights: Option<&Grid>,
    exaggeration: f64,
    most: usize,
) -> Result<Picture, ReportError> {
    let step = thin::step(codes.rows(), codes.cols(), most);
    let thin_codes = thin::block_majority(codes, step);
    let relief = heights.filter(|h| (h.rows(), h.cols()) == (codes.rows(), codes.cols()));
    let shade = relief.map(|h| hillshade(&thin::block_mean(h, step), exaggeration));
    let level = |i: usize| shade.as_ref().map_or(1.0, |s| s.values[i]);
    let pixels: Vec<u8> =
        thin_codes.values.iter().enumerate().map(|(i, &code)| palette_index(code, level(i))).collect();
    let [cols, rows] = [thin_codes.cols(), thin_codes.rows()];
    let png = encode(cols, rows, &pixels, Some(class_palette()))?;
    Ok(placed(codes, data_uri(&png), [cols, rows]))
}

/// Ground in the colours of its codes (the first colour if there are no codes), shaded without exaggeration: rocks and sand.
///
/// # Errors
/// When the picture cannot be encoded.
pub fn ground(
    heights: &Grid,
    codes: Option<&Grid<u8>>,
    colours: &[(u8, Rgb)],
    most: usize,
) -> Result<Picture, ReportError> {
    let step = thin::step(heights.rows(), heights.cols(), most);
    let thin_heights = thin::block_mean(heights, step);
    let shade = hillshade(&thin_heights, 1.0);
    let thin_codes = codes.map(|c| thin::block_majority(c, step));
    let plain = colours.first().map_or(colour::NO_DATA, |c| c.1);
    let colour_of = |i: usize| match &thin_codes {
        Some(codes) => colours.iter().find(|(code, _)| *code == codes.values[i]).map_or(colour::NO_DATA, |c| c.1),
        None => plain,
    };
    let png = rgb(&thin_heights, |i| lit(colour_of(i), shade.values[i]))?;
    Ok(placed(heights, data_uri(&png), [thin_heights.cols(), thin_heights.rows()]))
}

/// Codes in their colours, by majority; codes without a colour are drawn as no data.
pub fn codes(codes: &Grid<u8>, colours: &[(u8, Rgb)], most: usize) -> Result<Picture, ReportError> {
    let thin = thin::block_majority(codes, thin::step(codes.rows(), codes.cols(), most));
    let colour = |code: &u8| colours.iter().find(|(c, _)| c == code).map_or(colour::NO_DATA, |(_, colour)| *colour);
    let bytes: Vec<u8> = thin.values.iter().flat_map(colour).collect();
    let png = encode(thin.cols(), thin.rows(), &bytes, None)?;
    Ok(placed(codes, data_uri(&png), [thin.cols(), thin.rows()]))
}

/// Colour of a class on maps and in their legends.
pub fn class_colour(class: RoughnessClass) -> Rgb {
    colour::towards(class.colour(), [255; 3], 0.42)
}

/// The colours of a legend from low to high.
pub fn ramp(map: &Map, steps: usize) -> Vec<Rgb> {
    (0..steps).map(|i| colour::pick(map, (i as f64 + 0.5) / steps as f64)).collect()
}

fn thinned(grid: &Grid, most: usize) -> Grid {
    thin::block_mean(grid, thin::step(grid.rows(), grid.cols(), most))
}

fn share(value: f64, (low, high): (f64, f64)) -> f64 {
    if high > low { (value - low) / (high - low) } else { 0.5 }
}

/// A colour at a given shade; level ground keeps its colour.
fn lit(colour: Rgb, shade: f64) -> Rgb {
    let level = std::f64::consts::FRAC_1_SQRT_2;
    match shade < level {
        true => colour::towards([0x14, 0x18, 0x20], colour, 0.28 + 0.72 * shade / level),
        false => colour::towards(colour, [255; 3], 0.55 * (shade - level) / (1.0 - level)),
    }
}

fn class_palette() -> Vec<u8> {
    let shades = RoughnessClass::ALL.into_iter().flat_map(|class| {
        let shade = move |s: usize| 0.45 + 0.55 * s as f64 / (SHADES - 1) as f64;
        (0..SHADES).flat_map(move |s| colour::towards([0x30, 0x34, 0x3a], class_colour(class), shade(s)))
    });
    colour::NO_DATA.into_iter().chain(shades).collect()
}

/// Entry of [`class_palette`]; level ground has the class colour itself.
fn palette_index(code: u8, shade: f64) -> u8 {
    let level = (shade / std::f64::consts::FRAC_1_SQRT_2).clamp(0.0, 1.0);
    let level = if level.is_finite() { (level * (SHADES - 1) as f64).round() as usize } else { SHADES - 1 };
    RoughnessClass::from_code(code).map_or(0, |class| (1 + class as usize * SHADES + level) as u8)
}

fn rgb(thin: &Grid, paint: impl Fn(usize) -> Rgb) -> Result<Vec<u8>, ReportError> {
    let colour = |(i, v): (usize, &f64)| if v.is_finite() { paint(i) } else { colour::NO_DATA };
    let bytes: Vec<u8> = thin.values.iter().enumerate().flat_map(colour).collect();
    encode(thin.cols(), thin.rows(), &bytes, None)
}

fn placed<T>(full: &Grid<T>, data_uri: String, pixels: [usize; 2]) -> Picture {
    Picture { data_uri, size_m: full.geometry.size(), origin_m: full.geometry.origin, pixels }
}

/// PNG (RGB, or indexed if a palette is given).
fn encode(cols: usize, rows: usize, bytes: &[u8], palette: Option<Vec<u8>>) -> Result<Vec<u8>, ReportError> {
    let colour = if palette.is_some() { png::ColorType::Indexed } else { png::ColorType::Rgb };
    encode_as(colour, [cols, rows], bytes, palette)
}

fn encode_as(
    colour: png::ColorType,
    [cols, rows]: [usize; 2],
    bytes: &[u8],
    palette: Option<Vec<u8>>,
) -> Result<Vec<u8>, ReportError> {
    let size = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, size(cols), size(rows));
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_color(colour);
    encoder.set_compression(png::Compression::High);
    if let Some(palette) = palette {
        encoder.set_palette(palette);
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()?;
    Ok(file)
}

fn data_uri(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(png))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    fn decoded(picture: &Picture) -> (Vec<u8>, png::ColorType) {
        let text = picture.data_uri.strip_prefix("data:image/png;base64,").unwrap();
        let file = base64::engine::general_purpose::STANDARD.decode(text).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
        let mut out = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut out).unwrap();
        out.truncate(info.buffer_size());
        (out, info.color_type)
    }

    #[test]
    fn val_zero_deviation_is_the_middle_and_no_data_is_grey() {
        let grid = Grid::new(Geometry::square(1, 3, 1.0), vec![0.0, f64::NAN, 9.0]);
        let (bytes, _) = decoded(&deviations(&grid, 1.0, 512).unwrap());
        let map = colour::deviations();
        assert_eq!(bytes[..3], map[128]);
        assert_eq!(bytes[3..6], colour::NO_DATA);
        assert_eq!(bytes[6..], map[255]);
    }

    #[test]
    fn val_classes_keep_their_colours_on_level_ground() {
        let codes = Grid::new(Geometry::square(2, 2, 1.0), vec![0, 1, 2, 255]);
        let flat = Grid::filled(codes.geometry, 1.0);
        let picture = classes(&codes, Some(&flat), 1.0, 512).unwrap();
        let (bytes, _) = decoded(&picture);
        let palette = class_palette();
        let at = |i: usize| &palette[3 * usize::from(bytes[i])..][..3];
        for class in RoughnessClass::ALL {
            assert_eq!(at(class as usize), class_colour(class));
        }
        assert_eq!(at(3), colour::NO_DATA);
        assert!(palette.len() <= 3 * 256);
    }

    /// Level ground has the colour of its height; slopes that face the light in the north-west are lighter, those that face away darker.
    #[test]
    fn val_relief_is_lit_from_the_north_west() {
        let g = Geometry::square(5, 5, 1.0);
        let middle = |slope: f64| {
            let grid = Grid::new(g, (0..25).map(|k| slope * (g.y(k / 5) - g.x(k % 5))).collect());
            let (bytes, kind) = decoded(&relief(&grid, (-100.0, 100.0), 1.0, 512).unwrap());
            assert_eq!((bytes.len(), kind), (75, png::ColorType::Rgb));
            bytes[3 * 12..3 * 13].to_vec()
        };
        let level = middle(0.0);
        assert_eq!(level, colour::heights()[128]);
        // Heights rise towards the south-east where the slope is negative.
        let [lighter, darker] = [middle(-0.4), middle(0.4)];
        assert!((0..3).all(|c| lighter[c] > level[c] && level[c] > darker[c]), "{lighter:?} {level:?} {darker:?}");
    }

    /// Ends of the colours at the ends of the range, and beyond them.
    #[test]
    fn val_values_are_coloured_over_their_range() {
        let grid = Grid::new(Geometry::square(1, 5, 1.0), vec![-9.0, 2.0, 3.0, 4.0, 9.0]);
        let (bytes, _) = decoded(&values(&grid, (2.0, 4.0), 512).unwrap());
        let map = colour::heights();
        assert_eq!(bytes, [map[0], map[0], map[128], map[255], map[255]].concat());
    }

    #[test]
    fn prop_large_grids_are_thinned_and_may_be_flat() {
        let grid = Grid::filled(Geometry::square(1100, 30, 0.5), 2.0);
        let picture = relief(&grid, (2.0, 2.0), 1.0, 512).unwrap();
        assert_eq!(picture.pixels, [10, 367]);
        assert_eq!(picture.size_m, [15.0, 550.0]);
    }
}
