//! Brightness of a facet: a mixture of Lambert's law and the Lommel-Seeliger law.
//!
//! $$ I = \alpha \left[ L \mu_0 + S \frac{2 \mu_0}{\mu_0 + \mu} \right], \qquad I = 0 \text{ where } \mu_0 \le 0 \text{ or } \mu \le 0 $$
//!
//! | symbol | meaning | range |
//! |---|---|---|
//! | `alpha` | albedo | 0 to 1 |
//! | `mu_0` | cosine of the angle between normal and light | -1 to 1 |
//! | `mu` | cosine of the angle between normal and view | -1 to 1 |
//! | `L`, `S` | weights | 0.35 and 0.65 |
//!
//! # Source
//! The paper in `docs/papers/jpl.md` gives the weights of 35 and 65 %. The factor 2 follows A. S. McEwen, Photometric functions for
//! photoclinometry and other applications, Icarus 92 (1991): the brightness of a facet that faces light and view equals its albedo.

use crate::direction::{Vector, dot};
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Weights of the two laws.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Photometry {
    /// Weight of Lambert's law (the paper: 0.35).
    #[schemars(transform = limits::not_negative)]
    pub lambert: f64,
    /// Weight of the Lommel-Seeliger law (the paper: 0.65).
    #[schemars(transform = limits::not_negative)]
    pub lommel_seeliger: f64,
}

impl Default for Photometry {
    fn default() -> Self {
        Self { lambert: 0.35, lommel_seeliger: 0.65 }
    }
}

/// Brightness of a facet of albedo 1, and its derivatives with respect to the slopes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shade {
    /// Brightness.
    pub value: f64,
    /// Derivatives with respect to `p` and `q`.
    pub by_slope: [f64; 2],
}

impl Photometry {
    /// # Errors
    /// A weight below 0, or both 0.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::not_negative("lambert", self.lambert)?;
        ParameterError::not_negative("lommel_seeliger", self.lommel_seeliger)?;
        if self.lambert + self.lommel_seeliger == 0.0 {
            let message = "is 0, and so is `lommel_seeliger`: the ground would reflect nothing; at least one weight must be above 0";
            return Err(ParameterError::new("lambert", message));
        }
        Ok(())
    }

    /// Brightness of a facet of albedo 1 from its two cosines; 0 if it faces away from light or view.
    ///
    /// ```
    /// use sastrugi_imaging::Photometry;
    ///
    /// let photometry = Photometry::default();
    /// // A facet that faces both light and view has its albedo.
    /// assert!((photometry.brightness(1.0, 1.0) - 1.0).abs() < 1e-15);
    /// assert_eq!(photometry.brightness(-0.1, 1.0), 0.0);
    /// ```
    #[inline]
    pub fn brightness(&self, to_light: f64, to_view: f64) -> f64 {
        if to_light <= 0.0 || to_view <= 0.0 {
            return 0.0;
        }
        self.lambert * to_light + self.lommel_seeliger * 2.0 * to_light / (to_light + to_view)
    }

    /// Brightness of a facet of albedo 1 with slopes `p`, `q` under unit vectors to light and view.
    #[inline]
    pub fn of_slopes(&self, slopes: [f64; 2], light: Vector, view: Vector) -> f64 {
        let normal = [-slopes[0], -slopes[1], 1.0];
        let length = dot(normal, normal).sqrt();
        self.brightness(dot(normal, light) / length, dot(normal, view) / length)
    }

    /// The same with its derivatives; all 0 if the facet faces away from light or view.
    pub fn shade(&self, slopes: [f64; 2], light: Vector, view: Vector) -> Shade {
        let normal = [-slopes[0], -slopes[1], 1.0];
        let square = dot(normal, normal);
        let length = square.sqrt();
        let (to_light, to_view) = (dot(normal, light) / length, dot(normal, view) / length);
        if to_light <= 0.0 || to_view <= 0.0 {
            return Shade { value: 0.0, by_slope: [0.0; 2] };
        }
        let sum = to_light + to_view;
        let by_light = self.lambert + self.lommel_seeliger * 2.0 * to_view / (sum * sum);
        let by_view = -self.lommel_seeliger * 2.0 * to_light / (sum * sum);
        let by = |axis: usize| {
            let of = |to: Vector, cosine: f64| -to[axis] / length - cosine * slopes[axis] / square;
            by_light * of(light, to_light) + by_view * of(view, to_view)
        };
        Shade { value: self.brightness(to_light, to_view), by_slope: [by(0), by(1)] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direction::direction;
    use proptest::prelude::*;

    /// McEwen's normalisation: the brightness of a facet that faces both equals its albedo, since 0.35 + 0.65 = 1.
    #[test]
    fn val_a_facet_that_faces_light_and_view_has_its_albedo() {
        let up = [0.0, 0.0, 1.0];
        assert!((Photometry::default().of_slopes([0.0; 2], up, up) - 1.0).abs() < 1e-15);
        let light = direction(90.0, 30.0);
        // 0.35 sin 30 + 0.65 * 2 * 0.5 / 1.5.
        let expected = 0.35 * 0.5 + 0.65 / 1.5;
        assert!((Photometry::default().of_slopes([0.0; 2], light, up) - expected).abs() < 1e-15);
    }

    #[test]
    fn val_facets_facing_away_are_black() {
        let photometry = Photometry::default();
        let light = direction(90.0, 30.0);
        let dark = photometry.shade([1.8, 0.0], light, [0.0, 0.0, 1.0]);
        assert_eq!(dark, Shade { value: 0.0, by_slope: [0.0; 2] });
        assert_eq!(photometry.of_slopes([0.0; 2], light, [0.0, 0.0, -1.0]), 0.0);
    }

    proptest! {
        /// Derivatives against central differences, whose error is of third order, below 1e-7 at steps of 1e-4.
        #[test]
        fn prop_derivatives_match_differences(
            p in -0.6..0.6f64, q in -0.6..0.6f64, azimuth in 0.0..360.0f64, elevation in 40.0..85.0f64, lean in 60.0..90.0f64,
        ) {
            let photometry = Photometry::default();
            let (light, view) = (direction(azimuth, elevation), direction(azimuth + 100.0, lean));
            let shade = photometry.shade([p, q], light, view);
            let h = 1e-4;
            let value = |p, q| photometry.of_slopes([p, q], light, view);
            prop_assume!(value(p + h, q) > 0.0 && value(p - h, q) > 0.0 && value(p, q + h) > 0.0 && value(p, q - h) > 0.0);
            prop_assert!((shade.value - value(p, q)).abs() < 1e-14);
            prop_assert!((shade.by_slope[0] - (value(p + h, q) - value(p - h, q)) / (2.0 * h)).abs() < 1e-6);
            prop_assert!((shade.by_slope[1] - (value(p, q + h) - value(p, q - h)) / (2.0 * h)).abs() < 1e-6);
        }
    }
}
