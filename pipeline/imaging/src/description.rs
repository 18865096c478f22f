//! The JSON file that accompanies an image: all that is needed to derive heights from it.

use crate::photometry::Photometry;
use crate::pose::CameraPose;
use crate::sun::Sun;
use sastrugi_schemas::{ParameterError, limits, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Noise of a camera: a pixel of brightness `I` gets the standard deviation `sqrt(absolute^2 + (relative I)^2)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Noise {
    /// Part proportional to the brightness.
    #[schemars(transform = limits::not_negative)]
    pub relative: f64,
    /// Constant part, in units of the image (I/F).
    #[schemars(transform = limits::not_negative)]
    pub absolute: f64,
}

impl Noise {
    /// # Errors
    /// A part below 0.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::not_negative("relative", self.relative)?;
        ParameterError::not_negative("absolute", self.absolute).map(|_| ())
    }

    /// Standard deviation at a brightness.
    ///
    /// ```
    /// use sastrugi_imaging::Noise;
    ///
    /// let noise = Noise { relative: 0.01, absolute: 0.004 };
    /// assert!((noise.deviation(0.3) - 0.005).abs() < 1e-12);
    /// ```
    #[inline]
    pub fn deviation(&self, brightness: f64) -> f64 {
        let relative = self.relative * brightness;
        (self.absolute * self.absolute + relative * relative).sqrt()
    }

    /// True for a camera without noise.
    pub fn is_none(&self) -> bool {
        self.relative == 0.0 && self.absolute == 0.0
    }
}

/// The file that accompanies an image, `<image>.json`. Pixels hold `exposure * I + haze` plus noise, with `I` the brightness of the
/// ground ([`Photometry`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageDescription {
    /// File of the image, in the same folder.
    pub image: String,
    /// Sun.
    pub sun: Sun,
    /// Camera, in the coordinates of the surface.
    pub camera: CameraPose,
    /// Photometric function.
    #[serde(default)]
    pub photometry: Photometry,
    /// Factor applied to the brightness.
    #[serde(default = "one")]
    pub exposure: f64,
    /// Brightness added to every pixel (I/F).
    #[serde(default)]
    pub haze: f64,
    /// Noise of the image.
    #[serde(default)]
    pub noise: Noise,
    /// Source of a rendered image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rendered: Option<Rendered>,
}

/// Source of a rendered image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rendered {
    /// Id or file of the surface.
    pub surface: String,
    /// Rows and columns of the surface.
    pub surface_shape: [usize; 2],
    /// Its cell size east-west and north-south, m.
    pub surface_cell_m: [f64; 2],
    /// Id or file of the albedo map; absent if the ground has uniform albedo.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub albedo_map: Option<String>,
    /// Albedo where there is no map or the map has no data.
    pub albedo: f64,
    /// Rays along a side of a pixel.
    pub samples: u32,
    /// True with cast shadows.
    pub shadows: bool,
    /// Name of the random stream of the noise; absent without noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_stream: Option<String>,
}

fn one() -> f64 {
    1.0
}

impl ImageDescription {
    /// Checks every number.
    ///
    /// # Errors
    /// The first number that is out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        self.sun.check().map_err(|e| e.within("sun"))?;
        self.camera.check().map_err(|e| e.within("camera"))?;
        self.photometry.check().map_err(|e| e.within("photometry"))?;
        self.noise.check().map_err(|e| e.within("noise"))?;
        check_radiometry(self.exposure, self.haze)
    }
}

/// Checks exposure and haze.
pub(crate) fn check_radiometry(exposure: f64, haze: f64) -> Result<(), ParameterError> {
    ParameterError::positive("exposure", exposure)?;
    if haze.is_finite() {
        Ok(())
    } else {
        Err(ParameterError::new("haze", format!("is {}; it must be finite", shown(haze))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// The description of an external image needs only the image, its sun and its camera.
    #[test]
    fn val_a_short_description_is_enough() {
        let camera = json!({ "kind": "parallel", "azimuth_deg": 0.0, "elevation_deg": 90.0, "centre_m": [5.0, 5.0, 0.0],
            "pixel_m": 1.0, "rows": 10, "cols": 10 });
        let text =
            json!({ "image": "a.tif", "sun": { "azimuth_deg": 120.0, "elevation_deg": 45.0 }, "camera": camera });
        let description: ImageDescription = serde_json::from_value(text).unwrap();
        assert_eq!((description.exposure, description.haze, description.noise.is_none()), (1.0, 0.0, true));
        assert_eq!(description.check(), Ok(()));
        let key = |d: ImageDescription| d.check().err().map(|e| e.key).unwrap_or_default();
        let night = Sun { azimuth_deg: 0.0, elevation_deg: -3.0 };
        assert_eq!(key(ImageDescription { sun: night, ..description.clone() }), "sun.elevation_deg");
        assert_eq!(key(ImageDescription { exposure: 0.0, ..description.clone() }), "exposure");
        assert_eq!(key(ImageDescription { haze: f64::NAN, ..description.clone() }), "haze");
        let noise = Noise { relative: -0.1, absolute: 0.0 };
        assert_eq!(key(ImageDescription { noise, ..description }), "noise.relative");
    }

    #[test]
    fn val_noise_has_two_parts() {
        let noise = Noise { relative: 0.03, absolute: 0.04 };
        assert!((noise.deviation(1.0) - 0.05).abs() < 1e-15 && (noise.deviation(0.0) - 0.04).abs() < 1e-15);
    }
}
