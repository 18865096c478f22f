//! What the jobs of a study and the verbs on single files do alike.

pub mod coregistration;
pub mod dem;
pub mod fits;
pub mod masks;
pub mod place;
pub mod roughness;
pub mod terrains;
pub mod textures;
