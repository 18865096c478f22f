//! Parameters of an image: light, camera and camera response.

use crate::description::{Noise, check_radiometry};
use crate::photometry::Photometry;
use crate::pose::CameraParameters;
use crate::sun::Sun;
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum number of rays along a side of a pixel.
pub const SAMPLES_MAX: u32 = 64;

/// Parameters of an image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RenderParameters {
    /// Sun: `{ azimuth_deg, elevation_deg }`.
    pub sun: Sun,
    /// Camera: `{ kind = "nadir" }` straight down on the complete surface, `{ kind = "parallel", azimuth_deg, elevation_deg }`, or
    /// `{ kind = "pinhole", position_m, target_m }`.
    pub camera: CameraParameters,
    /// Photometric function.
    pub photometry: Photometry,
    /// Albedo where the surface has no albedo map, 0 to 1 (default: sand of `planetary`).
    #[schemars(transform = limits::within(0.0, 1.0))]
    pub albedo: f64,
    /// Factor applied to the brightness.
    #[schemars(transform = limits::positive)]
    pub exposure: f64,
    /// Brightness added to every pixel (I/F).
    pub haze: f64,
    /// Noise of the camera; none when absent.
    pub noise: Noise,
    /// Rays along a side of a pixel: a pixel is the mean of `samples` x `samples` rays.
    #[schemars(range(min = 1, max = SAMPLES_MAX))]
    pub samples: u32,
    /// Whether to render cast shadows; facets that face away from the sun are dark either way.
    pub shadows: bool,
}

impl Default for RenderParameters {
    fn default() -> Self {
        Self {
            sun: Sun::default(),
            camera: CameraParameters::default(),
            photometry: Photometry::default(),
            albedo: 0.25,
            exposure: 1.0,
            haze: 0.0,
            noise: Noise::default(),
            samples: 2,
            shadows: true,
        }
    }
}

impl RenderParameters {
    /// # Errors
    /// The first parameter that is out of range, whatever the surface.
    pub fn check(&self) -> Result<(), ParameterError> {
        self.sun.check().map_err(|e| e.within("sun"))?;
        self.camera.check().map_err(|e| e.within("camera"))?;
        self.photometry.check().map_err(|e| e.within("photometry"))?;
        self.noise.check().map_err(|e| e.within("noise"))?;
        check_radiometry(self.exposure, self.haze)?;
        if !(0.0..=1.0).contains(&self.albedo) {
            let message = format!("is {}; it must lie between 0 and 1", sastrugi_schemas::shown(self.albedo));
            return Err(ParameterError::new("albedo", message));
        }
        if !(1..=SAMPLES_MAX).contains(&self.samples) {
            let message = format!("is {}; it must lie between 1 and {SAMPLES_MAX}", self.samples);
            return Err(ParameterError::new("samples", message));
        }
        Ok(())
    }
}
