//! One file per stage, the glue between a kernel and the files of an item, and what several of them share.

pub mod dem;
pub mod exports;
pub mod fit;
pub mod image;
pub mod inputs;
pub mod mask;
pub mod matched;
pub mod missions;
pub mod navigate;
pub mod original;
pub mod perturbation;
pub mod photoclinometry;
pub mod rasters;
pub mod roughness;
pub mod route;
pub mod rover;
pub mod rover_designs;
pub mod rover_effects;
pub mod scoreboard;
pub mod surface;
pub mod terrain;
pub mod texture;
pub mod traverse;
pub mod vehicle;
