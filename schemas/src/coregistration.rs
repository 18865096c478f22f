//! How one DEM was laid onto another before their difference was taken.

use serde::{Deserialize, Serialize};

/// The DEM that was subtracted, and how it was laid onto the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Minus {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of the file.
    pub sha256: String,
    /// How it was moved.
    pub coregistration: Coregistration,
}

/// How B was moved to lie on A, and what that did to `A - B`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coregistration {
    /// B was moved this far east and north, m.
    pub shift_m: [f64; 2],
    /// B was raised by this at the centre of A, m. Without stable terrain it holds the median snow depth.
    pub raise_m: f64,
    /// B was tilted by this eastwards and northwards about the centre of A, m/m.
    pub tilt: [f64; 2],
    /// Median of `A - B` before, m.
    pub median_before_m: f64,
    /// 1.4826 times the median absolute deviation of `A - B` from its median (NMAD) before, m.
    pub nmad_before_m: f64,
    /// NMAD once B was raised and tilted where it lay, m.
    pub nmad_plane_m: f64,
    /// NMAD after all, m.
    pub nmad_after_m: f64,
    /// Cells of A with data in both.
    pub cells: u64,
    /// Rounds of the horizontal fit.
    pub iterations: u32,
    /// True when the last round moved B by less than 0.005 cells.
    pub converged: bool,
}
