//! Terrain generators: checked parameters and named random streams in, a heightfield out.
//!
//! One folder per generator, one line each in [`registry`]. Heights are metres on a grid whose south-west corner is the
//! origin. Generators count posts from the south-west: post `i` east and `j` north stands for the surface point
//! `(i cell, j cell)` of the generator's formula, and lies in column `i` and row `rows - 1 - j`.

pub mod cascade;
pub mod compose;
pub mod elaborate;
pub mod generator;
pub mod mavs;
pub mod multifractal;
pub mod planetary;
pub mod registry;
pub mod size;
pub mod spheroids;
pub mod weierstrass_mandelbrot;
pub mod windows;

pub use generator::{Generator, Holds, Input, Levels, Line, MAPS, Map, MapKind, NamedInput, Terrain, TerrainError};
pub use registry::{kinds, prepare};
pub use windows::Windows;
