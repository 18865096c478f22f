//! Search coordinates for a covariance's parameters: dimensionless, smooth, without discontinuities.
//!
//! * sigma, b and shapes: their logarithms; b is the geometric mean of both axes, so that ratio and b are not coupled;
//! * nugget: a share of the data's variance;
//! * anisotropy: `ln(1 / ratio) (cos 2 a, sin 2 a)`, which is continuous over half a turn and 0 for an isotropic surface.

use crate::covariance::form::{Role, half_turn};
use crate::covariance::{Covariance, Form};
use std::f64::consts::PI;

/// Largest range the search may reach, in windows.
pub const RANGE_MAX_WINDOWS: f64 = 20.0;
/// Largest nugget, in variances of the data.
const NUGGET_MAX: f64 = 2.0;
/// Largest `ln(1 / ratio)`.
const ELONGATION_MAX: f64 = 3.0;
/// Elongation at the start of an anisotropic search: from an exactly isotropic start the azimuth has no gradient.
const ELONGATION_START: f64 = 0.05;

/// The search coordinates of a form for given data.
pub struct Coordinates<'a> {
    /// The form.
    pub form: &'a Form,
    /// Variance of the residual, m2.
    pub variance_m2: f64,
    /// Smaller cell size, m.
    pub cell_m: f64,
    /// Width of the window, m.
    pub window_m: f64,
}

impl Coordinates<'_> {
    fn roles(&self) -> impl Iterator<Item = Role> {
        self.form.parameters().into_iter().map(|p| p.role)
    }

    /// Bounds of each coordinate.
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        let sigma = 0.5 * libm::log(self.variance_m2);
        let range = (libm::log(0.05 * self.cell_m), libm::log(RANGE_MAX_WINDOWS * self.window_m));
        let bound = |role| match role {
            Role::Sigma(k) => match self.form.terms()[k].scale_names().1 {
                Some(_) => (sigma - 5.0, sigma + 7.0),
                // Increments over 1 m, however far 1 m is from this window.
                None => (sigma - 30.0, sigma + 30.0),
            },
            Role::Range(_) => range,
            Role::Shape(k) => {
                let (low, high) = self.form.terms()[k].shape().map_or((1.0, 1.0), |s| s.bounds);
                (libm::log(low), libm::log(high))
            }
            Role::Nugget => (0.0, NUGGET_MAX),
            Role::Ratio | Role::Azimuth => (-ELONGATION_MAX, ELONGATION_MAX),
        };
        self.roles().map(bound).collect()
    }

    /// Coordinates of a covariance.
    pub fn encode(&self, covariance: &Covariance) -> Vec<f64> {
        let elongation =
            (-libm::log(covariance.ratio)).max(if covariance.is_isotropic() { ELONGATION_START } else { 0.0 });
        let (sin, cos) = libm::sincos(2.0 * covariance.azimuth_deg.to_radians());
        let value = |role| match role {
            Role::Sigma(k) => libm::log(covariance.structures[k].sigma_m),
            Role::Range(k) => libm::log(covariance.structures[k].range_m * covariance.ratio.sqrt()),
            Role::Shape(k) => libm::log(covariance.structures[k].shape),
            Role::Nugget => covariance.nugget_m2 / self.variance_m2,
            Role::Ratio => elongation * cos,
            Role::Azimuth => elongation * sin,
        };
        let bounds = self.bounds();
        self.roles().map(value).zip(bounds).map(|(v, (low, high))| v.clamp(low, high)).collect()
    }

    /// The covariance at coordinates.
    pub fn decode(&self, at: &[f64]) -> Covariance {
        let mut covariance = self.form.unit();
        let mut axis = [0.0; 2];
        for (role, &v) in self.roles().zip(at) {
            match role {
                Role::Sigma(k) => covariance.structures[k].sigma_m = libm::exp(v),
                Role::Range(k) => covariance.structures[k].range_m = libm::exp(v),
                Role::Shape(k) => covariance.structures[k].shape = libm::exp(v),
                Role::Nugget => covariance.nugget_m2 = v * self.variance_m2,
                Role::Ratio => axis[0] = v,
                Role::Azimuth => axis[1] = v,
            }
        }
        let elongation = (axis[0] * axis[0] + axis[1] * axis[1]).sqrt().min(ELONGATION_MAX);
        if elongation > 0.0 {
            covariance.ratio = libm::exp(-elongation);
            covariance.azimuth_deg = half_turn(90.0 / PI * libm::atan2(axis[1], axis[0]));
            for term in &mut covariance.structures {
                let along = term.range_m / covariance.ratio.sqrt();
                // A model without a range keeps 1 m along the axis.
                term.range_m = if term.model.scale_names().1.is_some() { along } else { term.range_m };
            }
        }
        covariance
    }

    /// Starting points, given sigma and b of an exponential fitted to the same data.
    pub fn starts(&self, sigma_m: f64, range_m: f64) -> Vec<Vec<f64>> {
        let single = |range_m: f64| {
            let mut start = self.form.unit();
            let count = start.structures.len() as f64;
            for (k, term) in start.structures.iter_mut().enumerate() {
                term.sigma_m = sigma_m / count.sqrt();
                if term.model.scale_names().1.is_some() {
                    // The terms of a sum start with ranges a factor of five apart, around the given range.
                    term.range_m = range_m * [1.0, 5.0][k.min(1)] / [1.0, 2.2][(count as usize - 1).min(1)];
                } else {
                    term.sigma_m = sigma_m * libm::exp(-term.shape * libm::log(range_m)) * std::f64::consts::SQRT_2;
                }
            }
            start.nugget_m2 = if self.form.has_nugget() { 0.05 * self.variance_m2 } else { 0.0 };
            self.encode(&start)
        };
        let ranges =
            if self.form.terms().len() > 1 { vec![range_m, 0.3 * range_m, 3.0 * range_m] } else { vec![range_m] };
        ranges.into_iter().map(single).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prop_coordinates_round_trip() {
        for name in ["exponential", "matern+nugget", "self_affine", "anisotropic:exponential+gaussian"] {
            let form = Form::parse(name).unwrap();
            let coordinates = Coordinates { form: &form, variance_m2: 2.0, cell_m: 0.1, window_m: 2.0 };
            let bounds = coordinates.bounds();
            assert_eq!(bounds.len(), form.parameters().len());
            let at: Vec<f64> = bounds
                .iter()
                .enumerate()
                .map(|(k, (low, high))| low + (high - low) * (0.45 + 0.02 * k as f64))
                .collect();
            let back = coordinates.encode(&coordinates.decode(&at));
            at.iter().zip(&back).for_each(|(a, b)| assert!((a - b).abs() < 1e-9, "{name}: {at:?} {back:?}"));
        }
    }
}
