//! Ground at the scale of vehicles, after the Mississippi State University Autonomous Vehicle Simulator (MAVS).
//!
//! # Kinds
//! | kind | surface |
//! |---|---|
//! | [`MAVS_PERLIN`] | the published Algorithm 1: two layers of Perlin noise |
//! | [`MAVS_GAUSSIAN`] | Algorithm 2: an Ornstein-Uhlenbeck field over a layer of Perlin noise |
//! | [`MAVS_VARIABLE`] | Algorithm 3: octaves of Perlin noise, modulated by a field of scales |
//! | [`ORNSTEIN_UHLENBECK`] | Algorithm 2 as intended: a stationary field with a chosen covariance |
//! | [`VAN_DEUSEN`] | Algorithm 3 as intended: profiles with PSD `c f^-n` |
//! | [`GAP`], [`POTHOLE`], [`MAVS_PROFILE`] | a trench, round holes, a ridged surface from one profile |
//!
//! `compat = true` reproduces a published listing with its defects; the notes of the terrain name them. `docs/papers/mavs.md`
//! describes and quantifies the defects.
//!
//! # Coordinates
//! The value of cell (row, col) belongs to its centre, `x = origin + (col + 1/2) cell`, in the coordinates of a world that the
//! surface is part of; so adjacent tiles match.
//!
//! # Example
//! A surface scaled to an RMS height of 3 cm at the wavelengths that excite a vehicle.
//! ```
//! use sastrugi_numeric::Streams;
//! use sastrugi_roughness::{Detrended, Detrender, WaveBand};
//! use sastrugi_terrain::prepare;
//! use serde_json::json;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let params = json!({"size_m": [30.0, 24.0], "cell_m": 0.15, "roughness": {"band_m": [0.33, 5.4], "rms_m": 0.03}});
//! let terrain = prepare("van_deusen", &params)?.generate(&Streams::for_seed(1, "terrain"), &[])?;
//! let rms_m = Detrended::of(&terrain.heights, &WaveBand::new(0.33, 5.4)?, Detrender::Band).rms_m();
//! assert!((rms_m - 0.03).abs() < 1e-9);
//! # Ok(())
//! # }
//! ```
//!
//! # Source
//! *Terrain Roughness in MAVS* (documentation, Mississippi State University), and MAVS `random_surface.cpp`,
//! `random_scene.cpp`, `profile_2d.cpp`.

pub mod frame;
pub mod gap;
pub mod measure;
pub mod octaves;
pub mod ornstein_uhlenbeck;
pub mod perlin;
pub mod pothole;
pub mod profile;
#[cfg(test)]
mod tests;
pub mod two_layers;

/// Algorithm 1.
pub const MAVS_PERLIN: &str = "mavs_perlin";
/// Algorithm 2.
pub const MAVS_GAUSSIAN: &str = "mavs_gaussian";
/// Algorithm 3.
pub const MAVS_VARIABLE: &str = "mavs_variable";
/// Algorithm 2 as intended.
pub const ORNSTEIN_UHLENBECK: &str = "ornstein_uhlenbeck";
/// Algorithm 3 as intended.
pub const VAN_DEUSEN: &str = "van_deusen";
/// A trench.
pub const GAP: &str = "gap";
/// Round holes.
pub const POTHOLE: &str = "pothole";
/// A ridged surface from one profile.
pub const MAVS_PROFILE: &str = "mavs_profile";

/// Side of a cell of the published examples, m.
pub const DEFAULT_CELL_M: f64 = 0.15;
/// The 100 m of the published examples, in whole cells.
pub const DEFAULT_SIZE_PX: [u32; 2] = [666, 666];
/// Length of the high-frequency feature of the listings, m.
pub const DEFAULT_HI_LEN_M: f64 = 2.0;
/// Length of the low-frequency feature of the listings, m.
pub const DEFAULT_LO_LEN_M: f64 = 50.0;
/// Magnitude of the high-frequency feature, m; the listings use 0.2, 0.1 and 0.025 in different places, and recommend less
/// than 0.15.
pub const DEFAULT_HI_MAG_M: f64 = 0.05;
