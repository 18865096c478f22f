//! How one DEM was co-registered to another before their difference was taken.

use serde::{Deserialize, Serialize};

/// The DEM that was subtracted, and how it was co-registered to the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Minus {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of the file.
    pub sha256: String,
    /// How it was moved.
    pub coregistration: Coregistration,
}

/// How B was moved to lie on A, and what that did to `A - B`. NMAD is 1.4826 times the median absolute deviation from the median.
///
/// Files of version 0.1.0 have neither medians but the first, nor standard errors, `shift_p` and `gained`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coregistration {
    /// B was moved this far east and north, m; absent where the ground has no slopes in two directions to find a shift by.
    pub shift_m: Option<[f64; 2]>,
    /// B was raised by this at the centre of A, m. Without stable terrain it holds the median snow depth.
    pub raise_m: f64,
    /// B was tilted by this eastwards and northwards about the centre of A, m/m.
    pub tilt: [f64; 2],
    /// Standard errors of all these; absent where the fit did not converge or the data is too little for them.
    #[serde(default)]
    pub standard_errors: Option<StandardErrors>,
    /// Probability of a shift as large as this or larger where B needs none; absent without standard errors or shift.
    #[serde(default)]
    pub shift_p: Option<f64>,
    /// True when the shift gained something: it is significant (`shift_p` below 0.05), and from one cell on the NMAD is smaller than
    /// with raise and tilt alone. Absent where it was not examined.
    #[serde(default)]
    pub gained: Option<bool>,
    /// Median of `A - B` before, m.
    pub median_before_m: f64,
    /// Median once B was raised and tilted where it lay, m.
    #[serde(default)]
    pub median_plane_m: Option<f64>,
    /// Median after all, m.
    #[serde(default)]
    pub median_after_m: Option<f64>,
    /// NMAD of `A - B` before, m.
    pub nmad_before_m: f64,
    /// NMAD once B was raised and tilted where it lay, m.
    pub nmad_plane_m: f64,
    /// NMAD after all, m.
    pub nmad_after_m: f64,
    /// Cells of A with data in both.
    pub cells: u64,
    /// Rounds of the horizontal fit.
    pub iterations: u32,
    /// True when the last round moved B by less than 0.005 cells; true without a shift.
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
    /// Blocks they are from: an interval takes Student's t with one degree of freedom fewer.
    pub blocks: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What version 0.1.0 wrote is read, and what it did not know is absent.
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
