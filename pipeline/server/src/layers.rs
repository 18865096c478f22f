//! Layers of map tiles: samples as colours.

use crate::grid::TILE;
use crate::samples::Samples;
use sastrugi_imaging::Sun;
use sastrugi_imaging::hillshade::shade_inner;
use sastrugi_store::picture::rgba_png;

/// A layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Hillshade tinted by height and albedo.
    Relief,
    /// Brightness under one light, grey.
    Hillshade,
    /// Share of rock, as a veil.
    Class,
    /// Albedo, grey.
    Albedo,
    /// Heights as Terrarium packs them: steps of 3.9 mm.
    Terrarium,
    /// Heights as Terrain-RGB packs them: steps of 0.1 m.
    TerrainRgb,
    /// Heights in steps of [`STEP_M`] from an offset of the collection.
    Elevation,
}

/// Every layer.
pub const ALL: [Layer; 7] = [
    Layer::Relief,
    Layer::Hillshade,
    Layer::Class,
    Layer::Albedo,
    Layer::Terrarium,
    Layer::TerrainRgb,
    Layer::Elevation,
];

/// Step of the heights of [`Layer::Elevation`], m: below the roughness of the ground between two samples 1 cm apart.
pub const STEP_M: f64 = 5e-5;
/// Heights that it spans, m: 2^24 steps.
pub const ELEVATION_SPAN_M: f64 = 16_777_216.0 * STEP_M;

/// What a layer is drawn with.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// Where the light stands.
    pub sun: Sun,
    /// Factor on slopes.
    pub exaggeration: f64,
    /// Lowest and highest height of the tints, m.
    pub range_m: [f64; 2],
    /// Height of level 0 of [`Layer::Elevation`], m.
    pub offset_m: f64,
    /// Distance of the samples, m.
    pub cell_m: f64,
}

/// Tints from low to high ground.
const TINTS: [[f64; 3]; 5] =
    [[96.0, 82.0, 76.0], [139.0, 112.0, 92.0], [184.0, 148.0, 116.0], [213.0, 186.0, 152.0], [236.0, 224.0, 203.0]];
/// Albedo of the ground that is shown as it is tinted.
const PLAIN_ALBEDO: f64 = 0.25;

impl Layer {
    /// Name in addresses.
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

    /// The layer of a name.
    pub fn of_name(name: &str) -> Option<Self> {
        ALL.into_iter().find(|layer| layer.name() == name)
    }

    /// What it shows, for people.
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

    /// The field that a collection must have for it.
    pub fn field(self) -> Option<&'static str> {
        match self {
            Self::Class => Some("class"),
            Self::Albedo => Some("albedo"),
            _ => None,
        }
    }

    /// The finest pixels that its steps are fit for, m.
    pub fn finest_m(self) -> f64 {
        match self {
            Self::Terrarium | Self::TerrainRgb => 0.16 * (1.0 - 1e-9),
            _ => 0.0,
        }
    }

    /// Whether it depends on light.
    pub fn is_lit(self) -> bool {
        matches!(self, Self::Relief | Self::Hillshade)
    }

    /// Whether no pixel of a tile has data; its samples have one more on every side.
    pub fn is_void(samples: &Samples) -> bool {
        (0..TILE * TILE).all(|k| samples.heights[at(k)].is_nan())
    }

    /// PNG of a tile from its samples, which have one more on every side; `None` where a height is beyond what the packing can hold.
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
                    // A quarter of the light comes from everywhere, so that shades keep their detail; level ground leaves room for slopes that face
                    // the light.
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

/// The sample of a pixel.
fn at(pixel: usize) -> usize {
    (pixel / TILE + 1) * (TILE + 2) + pixel % TILE + 1
}

/// Level of a brightness.
fn level(value: f64) -> u8 {
    (255.0 * value.clamp(0.0, 1.0)).round() as u8
}

fn grey(value: f64) -> [u8; 4] {
    let v = level(value);
    [v, v, v, 255]
}

/// A whole number in three bytes; `None` beyond them.
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

    /// Heights come back from the three bytes to half a step.
    #[test]
    fn val_packed_heights_come_back() {
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

    /// A tile of which only the ground around it has data is void; ground without an albedo is left open.
    #[test]
    fn val_pixels_without_data_are_open() {
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
}
