//! Colour maps and the palette.
//!
//! The maps are defined in Oklab (B. Ottosson, A perceptual color space for image processing, 2020): lightness is linear
//! along the map, so that equal steps of the value look equally large and the map remains readable in grey and with any
//! colour vision. The categorical colours follow M. Okabe and K. Ito, Color universal design, 2008.

/// sRGB colour.
pub type Rgb = [u8; 3];
/// A colour map as 256 colours.
pub type Map = [Rgb; 256];

/// Position on the map (0..1), then lightness, chroma and hue (degrees) in Oklab.
type Stop = (f64, f64, f64, f64);

/// Heights: deep blue, teal, green, sand, cream.
const HEIGHTS: [Stop; 5] = [
    (0.0, 0.30, 0.085, 262.0),
    (0.25, 0.46, 0.075, 215.0),
    (0.5, 0.62, 0.090, 150.0),
    (0.75, 0.78, 0.100, 95.0),
    (1.0, 0.94, 0.045, 80.0),
];
/// Deviations: blue below, white at zero, rust above; equally dark at both ends.
const DEVIATIONS: [Stop; 5] = [
    (0.0, 0.38, 0.110, 255.0),
    (0.25, 0.67, 0.090, 250.0),
    (0.5, 0.96, 0.000, 0.0),
    (0.75, 0.67, 0.100, 50.0),
    (1.0, 0.38, 0.105, 45.0),
];
/// Colour of cells without data.
pub const NO_DATA: Rgb = [0xa9, 0xad, 0xb2];

/// The map for heights.
pub fn heights() -> Map {
    map(&HEIGHTS)
}

/// The map for deviations about zero.
pub fn deviations() -> Map {
    map(&DEVIATIONS)
}

/// Colour of a map at a share in 0..1.
pub fn pick(map: &Map, share: f64) -> Rgb {
    map[(share.clamp(0.0, 1.0) * 255.0).round() as usize & 255]
}

/// `colour` moved towards `target` by a share in 0..1.
pub fn towards(colour: Rgb, target: Rgb, share: f64) -> Rgb {
    let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * share).round() as u8;
    [mix(colour[0], target[0]), mix(colour[1], target[1]), mix(colour[2], target[2])]
}

/// `#rrggbb`.
pub fn hex([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn map(stops: &[Stop]) -> Map {
    std::array::from_fn(|i| {
        let t = i as f64 / 255.0;
        let above = stops.iter().position(|s| s.0 >= t).unwrap_or(stops.len() - 1).max(1);
        let (from, to) = (stops[above - 1], stops[above]);
        let share = (t - from.0) / (to.0 - from.0);
        let ([l0, a0, b0], [l1, a1, b1]) = (lab(from), lab(to));
        srgb([l0 + (l1 - l0) * share, a0 + (a1 - a0) * share, b0 + (b1 - b0) * share])
    })
}

fn lab((_, lightness, chroma, hue_deg): Stop) -> [f64; 3] {
    let (sin, cos) = libm::sincos(hue_deg.to_radians());
    [lightness, chroma * cos, chroma * sin]
}

/// Oklab to sRGB (matrices of Ottosson, 2020).
fn srgb([lightness, a, b]: [f64; 3]) -> Rgb {
    let cube = |v: f64| v * v * v;
    let l = cube(lightness + 0.3963377774 * a + 0.2158037573 * b);
    let m = cube(lightness - 0.1055613458 * a - 0.0638541728 * b);
    let s = cube(lightness - 0.0894841775 * a - 1.2914855480 * b);
    [
        4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
        -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
        -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s,
    ]
    .map(encode)
}

/// Transfer function of sRGB (IEC 61966-2-1).
fn encode(linear: f64) -> u8 {
    let v = linear.clamp(0.0, 1.0);
    let encoded = if v <= 0.0031308 { 12.92 * v } else { 1.055 * libm::pow(v, 1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE lightness of an sRGB colour (D65).
    fn lightness(colour: Rgb) -> f64 {
        let decode = |c: u8| {
            let v = f64::from(c) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
        };
        let y = 0.2126 * decode(colour[0]) + 0.7152 * decode(colour[1]) + 0.0722 * decode(colour[2]);
        116.0 * libm::cbrt(y) - 16.0
    }

    #[test]
    fn prop_heights_rise_in_lightness() {
        let l: Vec<f64> = heights().into_iter().map(lightness).collect();
        assert!(l.windows(2).all(|w| w[1] > w[0] - 0.15), "no step darkens by more than rounding");
        assert!((0..16).all(|i| l[16 * i + 15] > l[16 * i]));
        assert!(l[255] - l[0] > 55.0);
    }

    #[test]
    fn prop_deviations_are_lightest_in_the_middle() {
        let l: Vec<f64> = deviations().into_iter().map(lightness).collect();
        assert!(l[..128].windows(2).all(|w| w[1] > w[0] - 0.15));
        assert!(l[128..].windows(2).all(|w| w[1] < w[0] + 0.15));
        assert!((l[0] - l[255]).abs() < 5.0, "{} {}", l[0], l[255]);
    }

    #[test]
    fn val_oklab_of_white_and_grey() {
        assert_eq!(srgb([1.0, 0.0, 0.0]), [255, 255, 255]);
        assert_eq!(srgb([0.0, 0.0, 0.0]), [0, 0, 0]);
        assert_eq!(hex([1, 160, 255]), "#01a0ff");
        assert_eq!(towards([0, 100, 200], [255, 255, 255], 1.0), [255, 255, 255]);
    }
}
