//! Code that several jobs, or jobs and verbs, share.

pub mod coregistration;
pub mod dem;
pub mod drawn;
pub mod fits;
pub mod images;
pub mod inputs;
pub mod masks;
pub mod photoclinometry;
pub mod place;
pub mod planner;
pub mod roughness;
pub mod routes;
pub mod rovers;
pub mod terrains;
pub mod textures;
