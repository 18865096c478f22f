//! Terrain generators: checked parameters and named random streams in, a heightfield out.
//!
//! # What it is for
//! Synthetic ground for driving and sensing, from a trench of known depth to a planet that can be zoomed from 100 km to a pebble, and measured
//! DEMs refined below their post spacing. Each generator has its own folder, whose header gives formula, source and limits, and one entry in
//! [`registry`]. Nothing here reads or writes files.
//!
//! # The flow
//! 1. [`kinds`] lists the generators with the JSON Schema of their parameters;
//! 2. [`prepare`] checks parameters, and fills in the defaults: a [`Generator`], or an error that names the parameter;
//! 3. [`Generator::inputs`] names the surfaces that it needs (a DEM, a raster of rock shares, measured points), each an [`Input`];
//! 4. [`Generator::generate_checked`] draws from [`sastrugi_numeric::Streams`] and returns a [`Terrain`]: heights, [`Map`]s, [`Line`]s, notes;
//! 5. [`Windows`] serves any window of a world ([`planetary::World`]) or of a refined DEM ([`elaborate::Elaborated`]) without generating the rest.
//!
//! # Coordinates
//! Heights are in metres, on a grid whose origin is its south-west corner. Generators count posts from the south-west: post `i` east and
//! `j` north is the point `(i cell, j cell)` of the generator's formula, stored in column `i` and row `rows - 1 - j`.
//!
//! # Example
//! ```
//! use sastrugi_numeric::{Streams, sums};
//! use sastrugi_terrain::prepare;
//! use serde_json::json;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A multifractal cascade of 64 x 48 cells of 10 cm with heights of 30 cm RMS.
//! let generator = prepare("cascade", &json!({"size_px": [64, 48], "cell_m": 0.1, "rms_height_m": 0.3}))?;
//! let streams = Streams::for_seed(7, "terrain");
//! let terrain = generator.generate_checked(&streams, &[])?;
//! assert_eq!((terrain.heights.rows(), terrain.heights.cols()), (48, 64));
//! let rms_m = sums::variance(&terrain.heights.values).sqrt();
//! assert!((rms_m - 0.3).abs() < 1e-9);
//! // The map of the flux lies on the same cells.
//! assert_eq!((terrain.maps[0].name, terrain.maps[0].values.geometry), ("flux", terrain.heights.geometry));
//! // Its complete parameters and the same seed give the same bits.
//! let again = prepare(generator.kind(), &generator.parameters())?.generate_checked(&streams, &[])?;
//! assert_eq!(again, terrain);
//! # Ok(())
//! # }
//! ```

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
