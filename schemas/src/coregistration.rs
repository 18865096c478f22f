//! The co-registration of one DEM to another before they are subtracted.

use serde::{Deserialize, Serialize};

/// The subtracted DEM and its co-registration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Minus {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Its co-registration.
    pub coregistration: Coregistration,
}

/// The co-registration of B to A, and `A - B` before and after. NMAD is 1.4826 times the median absolute deviation from the median.
///
/// Files of version 0.1.0 lack the medians except the first, the standard errors, `shift_p` and `gained`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coregistration {
    /// Shift of B east and north, m; absent if the ground lacks slopes in two directions from which a shift could be estimated.
    pub shift_m: Option<[f64; 2]>,
    /// Raise of B at the centre of A, m. Without stable terrain it includes the median snow depth.
    pub raise_m: f64,
    /// Tilt of B eastwards and northwards about the centre of A, m/m.
    pub tilt: [f64; 2],
    /// Standard errors of shift, raise and tilt; absent if the fit did not converge or there are too few data.
    #[serde(default)]
    pub standard_errors: Option<StandardErrors>,
    /// p-value of the shift: probability of a shift at least this large if B needs none; absent without standard errors or shift.
    #[serde(default)]
    pub shift_p: Option<f64>,
    /// True if the shift improved the fit: it is significant (`shift_p` below 0.05) and, if it is one cell or more, the NMAD is smaller
    /// than with raise and tilt alone. Absent if not tested.
    #[serde(default)]
    pub gained: Option<bool>,
    /// Median of `A - B` before co-registration, m.
    pub median_before_m: f64,
    /// Median after raise and tilt without a shift, m.
    #[serde(default)]
    pub median_plane_m: Option<f64>,
    /// Median after co-registration, m.
    #[serde(default)]
    pub median_after_m: Option<f64>,
    /// NMAD of `A - B` before co-registration, m.
    pub nmad_before_m: f64,
    /// NMAD after raise and tilt without a shift, m.
    pub nmad_plane_m: f64,
    /// NMAD after co-registration, m.
    pub nmad_after_m: f64,
    /// Number of cells of A with data in both DEMs.
    pub cells: u64,
    /// Iterations of the horizontal fit.
    pub iterations: u32,
    /// True if the last iteration moved B by less than 0.005 cells; true without a shift.
    pub converged: bool,
}

/// Standard errors of a co-registration, from blocks of the difference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StandardErrors {
    /// Of the shift east and north, m; absent without a shift.
    pub shift_m: Option<[f64; 2]>,
    /// Of the raise at the centre of A, m.
    pub raise_m: f64,
    /// Of the tilt eastwards and northwards, m/m.
    pub tilt: [f64; 2],
    /// Number of blocks: intervals use Student's t with one degree of freedom fewer.
    pub blocks: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Files of version 0.1.0 are read; what they lack is absent.
    #[test]
    fn val_an_older_record_is_read() {
        let text = r#"{"shift_m": [0.07, -0.04], "raise_m": -3.0, "tilt": [0.0, 1e-3], "median_before_m": 3.1, "nmad_before_m": 0.2,
            "nmad_plane_m": 0.19, "nmad_after_m": 0.1, "cells": 9000, "iterations": 4, "converged": true}"#;
        let c: Coregistration = serde_json::from_str(text).unwrap();
        assert_eq!((c.shift_m, c.cells, c.converged), (Some([0.07, -0.04]), 9000, true));
        assert_eq!((c.gained, c.shift_p, &c.standard_errors, c.median_after_m), (None, None, &None, None));
        let again: Coregistration = serde_json::from_str(&serde_json::to_string(&c).unwrap()).unwrap();
        assert_eq!(again, c);
    }
}
