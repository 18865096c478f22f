//! Ground at the scale of vehicles, after the Mississippi State University Autonomous Vehicle Simulator (MAVS).
//!
//! # Kinds
//! | kind | what |
//! |---|---|
//! | [`MAVS_PERLIN`] | the published Algorithm 1: two layers of Perlin noise |
//! | [`MAVS_GAUSSIAN`] | Algorithm 2: an Ornstein-Uhlenbeck field over a layer of Perlin noise |
//! | [`MAVS_VARIABLE`] | Algorithm 3: octaves of Perlin noise under a field of scales |
//! | [`ORNSTEIN_UHLENBECK`] | what Algorithm 2 is meant to be: a stationary field with a chosen covariance |
//! | [`VAN_DEUSEN`] | what Algorithm 3 is meant to be: profiles with density `c f^-n` |
//! | [`GAP`], [`POTHOLE`], [`MAVS_PROFILE`] | a trench, round holes, a ridged surface from one profile |
//!
//! `compat = true` gives a published listing with its defects; the notes of the terrain name them. What is wrong with the
//! listings, and by how much, is in `docs/papers/mavs.md`.
//!
//! # Coordinates
//! Cell (row, col) stands for its centre, `x = origin + (col + 1/2) cell`, in the coordinates of a world of which the surface
//! is a part; so tiles join.
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
/// Algorithm 2 as it is meant.
pub const ORNSTEIN_UHLENBECK: &str = "ornstein_uhlenbeck";
/// Algorithm 3 as it is meant.
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
/// Magnitude of the high-frequency feature, m; the listings have 0.2, 0.1 and 0.025 in different places, and advise less than
/// 0.15.
pub const DEFAULT_HI_MAG_M: f64 = 0.05;
