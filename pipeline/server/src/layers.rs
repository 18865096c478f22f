//! Layers of map tiles: how samples become colours.

use crate::grid::TILE;
use crate::samples::Samples;
use sastrugi_imaging::Sun;
use sastrugi_imaging::hillshade::shade_inner;
use sastrugi_store::picture::rgba_png;

/// A layer of map tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Hillshade tinted by height and albedo.
    Relief,
    /// Hillshade from one light source, grey.
    Hillshade,
    /// Share of rock, as a translucent overlay.
    Class,
    /// Albedo, grey.
    Albedo,
    /// Heights in the Terrarium encoding, in steps of 3.9 mm.
    Terrarium,
    /// Heights in the Terrain-RGB encoding, in steps of 0.1 m.
    TerrainRgb,
    /// Heights in steps of [`STEP_M`] above an offset of the collection.
    Elevation,
}

/// All layers.
pub const ALL: [Layer; 7] = [
    Layer::Relief,
    Layer::Hillshade,
    Layer::Class,
    Layer::Albedo,
    Layer::Terrarium,
    Layer::TerrainRgb,
    Layer::Elevation,
];

/// Step of the heights of [`Layer::Elevation`], m. It is below the roughness of the ground between two samples 1 cm apart.
pub const STEP_M: f64 = 5e-5;
/// Range of heights that the layer can encode, m: 2^24 steps.
pub const ELEVATION_SPAN_M: f64 = 16_777_216.0 * STEP_M;

/// Drawing parameters of a layer.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// Direction of the light.
    pub sun: Sun,
    /// Vertical exaggeration: factor on slopes.
    pub exaggeration: f64,
    /// Heights of the lowest and the highest tint, m.
    pub range_m: [f64; 2],
    /// Height of step 0 of [`Layer::Elevation`], m.
    pub offset_m: f64,
    /// Sample spacing, m.
    pub cell_m: f64,
}

/// Tints from the lowest to the highest ground.
const TINTS: [[f64; 3]; 5] =
    [[96.0, 82.0, 76.0], [139.0, 112.0, 92.0], [184.0, 148.0, 116.0], [213.0, 186.0, 152.0], [236.0, 224.0, 203.0]];
/// Albedo at which the ground has exactly its tint.
const PLAIN_ALBEDO: f64 = 0.25;

impl Layer {
    /// Name in URLs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Relief => "relief",
            Self::Hillshade => "hillshade",
            Self::Class => "class",
            Self::Albedo => "albedo",
            Self::Terrarium => "terrarium",
            Self::TerrainRgb => "terrain_rgb",
            Self::Elevation => "elevation",
        }
    }

    /// Layer with this name.
    pub fn of_name(name: &str) -> Option<Self> {
        ALL.into_iter().find(|layer| layer.name() == name)
    }

    /// One-line description.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Relief => "hillshade, tinted by height and albedo",
            Self::Hillshade => "hillshade from one light source",
            Self::Class => "share of the ground that rocks cover",
            Self::Albedo => "albedo, black 0 to white 0.5",
            Self::Terrarium => "height = 256 R + G + B / 256 - 32768 m",
            Self::TerrainRgb => "height = 0.1 (65536 R + 256 G + B) - 10000 m",
            Self::Elevation => "height = offset + 0.00005 (65536 R + 256 G + B) m",
        }
    }

    /// Field that the collection must have for this layer.
    pub fn field(self) -> Option<&'static str> {
        match self {
            Self::Class => Some("class"),
            Self::Albedo => Some("albedo"),
            _ => None,
        }
    }

    /// Finest pixel, m, for which the height steps of the encoding are small enough.
    pub fn finest_m(self) -> f64 {
        match self {
            Self::Terrarium | Self::TerrainRgb => 0.16 * (1.0 - 1e-9),
            _ => 0.0,
        }
    }

    /// Whether the layer depends on the light.
    pub fn is_lit(self) -> bool {
        matches!(self, Self::Relief | Self::Hillshade)
    }

    /// Whether no pixel of the tile has data; `samples` include a margin of one sample on every side.
    pub fn is_void(samples: &Samples) -> bool {
        (0..TILE * TILE).all(|k| samples.heights[at(k)].is_nan())
    }

    /// Draws a tile as PNG from its samples, which include a margin of one on every side; `None` if a height is outside the range of the encoding.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_imaging::Sun;
    /// use sastrugi_server::grid::TILE;
    /// use sastrugi_server::layers::{Layer, Style};
    /// use sastrugi_server::samples::Samples;
    ///
    /// let style = Style { sun: Sun::default(), exaggeration: 1.0, range_m: [0.0, 1.0], offset_m: 0.0, cell_m: 1.0 };
    /// let side = TILE + 2;
    /// let level = |height_m: f32| Samples { heights: vec![height_m; side * side], ..Samples::empty(side, side) };
    /// let png = Layer::Hillshade.draw(&level(0.0), &style);
    /// assert!(png.is_some_and(|bytes| bytes.starts_with(b"\x89PNG")));
    /// // Terrain-RGB ends at 1667 km.
    /// assert_eq!(Layer::TerrainRgb.draw(&level(2e6), &style), None);
    /// ```
    pub fn draw(self, samples: &Samples, style: &Style) -> Option<Vec<u8>> {
        let shade = if self.is_lit() { self.shade(samples, style) } else { Vec::new() };
        let mut pixels = Vec::with_capacity(TILE * TILE);
        for k in 0..TILE * TILE {
            let height = f64::from(samples.heights[at(k)]);
            if height.is_nan() {
                pixels.push([0; 4]);
                continue;
            }
            let value = |field: &Option<Vec<f32>>| field.as_ref().map(|v| f64::from(v[at(k)]));
            pixels.push(match self {
                Self::Hillshade => grey(f64::from(shade[k])),
                Self::Relief => {
                    let albedo = value(&samples.albedo).filter(|a| a.is_finite()).unwrap_or(PLAIN_ALBEDO);
                    let brightness = f64::from(shade[k]) / std::f64::consts::FRAC_1_SQRT_2;
                    // A quarter of the light is ambient, so that shadows keep their detail; level ground leaves headroom for slopes that face the
                    // light.
                    let light = 0.82 * (0.25 + 0.75 * brightness) * (0.4 + 0.6 * albedo / PLAIN_ALBEDO);
                    let [r, g, b] = tint(height, style.range_m).map(|c| level(c / 255.0 * light));
                    [r, g, b, 255]
                }
                Self::Class => {
                    let share = value(&samples.rock).unwrap_or(0.0).clamp(0.0, 1.0);
                    [214, 90, 32, level(0.85 * share)]
                }
                Self::Albedo => value(&samples.albedo).filter(|a| a.is_finite()).map_or([0; 4], |a| grey(2.0 * a)),
                Self::Terrarium => packed((height + 32768.0) * 256.0)?,
                Self::TerrainRgb => packed((height + 10000.0) / 0.1)?,
                Self::Elevation => packed((height - style.offset_m) / STEP_M)?,
            });
        }
        rgba_png([TILE, TILE], &pixels).ok()
    }

    fn shade(self, samples: &Samples, style: &Style) -> Vec<f32> {
        let shape = [samples.rows, samples.cols];
        shade_inner(&samples.heights, shape, style.cell_m, style.sun.direction(), style.exaggeration)
    }
}

/// Index of the sample under a pixel.
fn at(pixel: usize) -> usize {
    (pixel / TILE + 1) * (TILE + 2) + pixel % TILE + 1
}

/// Brightness 0 to 1 as a byte.
fn level(value: f64) -> u8 {
    (255.0 * value.clamp(0.0, 1.0)).round() as u8
}

fn grey(value: f64) -> [u8; 4] {
    let v = level(value);
    [v, v, v, 255]
}

/// An integer in three bytes; `None` if it is out of range.
fn packed(value: f64) -> Option<[u8; 4]> {
    let n = value.round();
    if !(0.0..16_777_216.0).contains(&n) {
        return None;
    }
    let [_, r, g, b] = (n as u32).to_be_bytes();
    Some([r, g, b, 255])
}

fn tint(height: f64, [low, high]: [f64; 2]) -> [f64; 3] {
    let last = TINTS.len() - 1;
    let at = if high > low { ((height - low) / (high - low)).clamp(0.0, 1.0) * last as f64 } else { 0.5 * last as f64 };
    let k = (at as usize).min(last - 1);
    let w = at - k as f64;
    [0, 1, 2].map(|c| TINTS[k][c] + (TINTS[k + 1][c] - TINTS[k][c]) * w)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Decoded heights agree within half a step.
    #[test]
    fn val_packed_heights_round_trip() {
        let unpack = |[r, g, b, _]: [u8; 4]| f64::from(r) * 65536.0 + f64::from(g) * 256.0 + f64::from(b);
        for height in [-1234.567, -0.001, 0.0, 3.25, 812.3456] {
            let terrarium = unpack(packed((height + 32768.0) * 256.0).unwrap()) / 256.0 - 32768.0;
            assert!((terrarium - height).abs() <= 0.5 / 256.0 + 1e-9);
            let rgb = unpack(packed((height + 10000.0) / 0.1).unwrap()) * 0.1 - 10000.0;
            assert!((rgb - height).abs() <= 0.05 + 1e-9);
        }
        let own = unpack(packed((0.123_456 + 400.0) / STEP_M).unwrap()) * STEP_M - 400.0;
        assert!((own - 0.123_456).abs() <= 0.5 * STEP_M + 1e-9);
        assert_eq!(packed(-1.0), None);
        assert_eq!(packed(16_777_216.0), None);
    }

    /// A tile is void if only the ground around it has data; pixels without an albedo are transparent.
    #[test]
    fn val_pixels_without_data_are_transparent() {
        let side = TILE + 2;
        let mut samples = Samples { heights: vec![f32::NAN; side * side], ..Samples::empty(side, side) };
        samples.heights[..side].fill(1.0);
        assert!(Layer::is_void(&samples));
        samples.heights[side + 1] = 1.0;
        samples.albedo = Some(vec![f32::NAN; side * side]);
        assert!(!Layer::is_void(&samples));
        let sun = Sun::default();
        let style = Style { sun, exaggeration: 1.0, range_m: [0.0, 1.0], offset_m: 0.0, cell_m: 1.0 };
        let drawn = Layer::Albedo.draw(&samples, &style).unwrap();
        let void = Layer::Albedo.draw(&Samples { heights: vec![f32::NAN; side * side], ..samples }, &style).unwrap();
        assert_eq!(drawn, void);
    }

    /// A tile's samples, with heights by row and column; the margin has row and column 0.
    fn samples(height: impl Fn(usize, usize) -> f32) -> Samples {
        let side = TILE + 2;
        let heights = (0..side * side).map(|k| height(k / side, k % side)).collect();
        Samples { heights, ..Samples::empty(side, side) }
    }

    fn style() -> Style {
        Style { sun: Sun::default(), exaggeration: 1.0, range_m: [0.0, 2.0], offset_m: 0.0, cell_m: 1.0 }
    }

    fn picture(pixel: impl Fn(usize, usize) -> [u8; 4]) -> Option<Vec<u8>> {
        let pixels: Vec<[u8; 4]> = (0..TILE * TILE).map(|k| pixel(k / TILE, k % TILE)).collect();
        rgba_png([TILE, TILE], &pixels).ok()
    }

    /// Pixel (row, column) shows the sample one row and one column further, because of the margin.
    #[test]
    fn val_pixels_show_the_samples_below_them() {
        let step = |row: usize, col: usize| row * (TILE + 2) + col;
        let heights = samples(|row, col| (step(row, col) as f64 * STEP_M) as f32);
        let expected = picture(|row, col| {
            let [_, r, g, b] = (step(row + 1, col + 1) as u32).to_be_bytes();
            [r, g, b, 255]
        });
        assert_eq!(Layer::Elevation.draw(&heights, &style()), expected);
    }

    /// Level ground 1 m high, half-way up the tints and under a sun 45 degrees high: brightness 0.707, which a relief shows at 0.82 of its tint.
    #[test]
    fn val_level_ground_has_known_colours() {
        let level = samples(|_, _| 1.0);
        for (layer, pixel) in [
            (Layer::Hillshade, [180, 180, 180, 255]),
            (Layer::Relief, [151, 121, 95, 255]),
            // 256 x 128 + 1 - 32768 m, 0.1 x (1 x 65536 + 134 x 256 + 170) - 10000 m, and 20 000 steps.
            (Layer::Terrarium, [128, 1, 0, 255]),
            (Layer::TerrainRgb, [1, 134, 170, 255]),
            (Layer::Elevation, [0, 78, 32, 255]),
            (Layer::Class, [214, 90, 32, 0]),
            (Layer::Albedo, [0, 0, 0, 0]),
        ] {
            assert_eq!(layer.draw(&level, &style()), picture(|_, _| pixel), "{}", layer.name());
        }
        let count = level.heights.len();
        let rocky = Samples { rock: Some(vec![1.0; count]), albedo: Some(vec![0.25; count]), ..level };
        assert_eq!(Layer::Class.draw(&rocky, &style()), picture(|_, _| [214, 90, 32, 217]));
        assert_eq!(Layer::Albedo.draw(&rocky, &style()), picture(|_, _| [128, 128, 128, 255]));
    }

    #[test]
    fn val_heights_outside_an_encoding_are_not_clipped() {
        let high = samples(|_, _| 2e6);
        for layer in [Layer::Terrarium, Layer::TerrainRgb, Layer::Elevation] {
            assert_eq!(layer.draw(&high, &style()), None, "{}", layer.name());
        }
        assert_eq!(Layer::Elevation.draw(&samples(|_, _| -0.001), &style()), None);
    }

    #[test]
    fn val_tints_run_from_the_lowest_to_the_highest_ground() {
        let of = |height: f64| tint(height, [0.0, 2.0]);
        assert_eq!([-9.0, 0.0, 2.0, 9.0].map(of), [TINTS[0], TINTS[0], TINTS[4], TINTS[4]]);
        assert_eq!([0.5, 1.0, 1.5].map(of), [TINTS[1], TINTS[2], TINTS[3]]);
        assert_eq!(of(0.25), [0, 1, 2].map(|c| 0.5 * (TINTS[0][c] + TINTS[1][c])));
        // Level ground has no range.
        assert_eq!(tint(7.0, [7.0, 7.0]), TINTS[2]);
    }

    #[test]
    fn val_layers_are_found_by_their_names() {
        for layer in ALL {
            assert_eq!(Layer::of_name(layer.name()), Some(layer));
        }
        assert_eq!([Layer::of_name("Relief"), Layer::of_name("")], [None, None]);
    }
}
