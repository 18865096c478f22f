//! The stages, one file each: they connect a kernel to the files of an item. Helpers shared by several stages live here too.
//!
//! A stage has a function `add`, which reads its tables of the study and adds their items to the graph, and a [`Job`](crate::job::Job),
//! which reads the files of its parents, calls the kernel, and writes files and table rows.
//!
//! 1. Surfaces: [`mod@dem`] and [`original`], [`terrain`], [`fit`] with [`mask`] and [`matched`], [`texture`] with [`scoreboard`],
//!    [`photoclinometry`], [`image`].
//! 2. Descriptions: [`roughness`], [`mod@surface`].
//! 3. Missions: [`missions`], [`traverse`], [`route`], [`navigate`], [`rover`] with [`perturbation`], [`rover_designs`] and
//!    [`rover_effects`].
//! 4. Exports: [`exports`] of terrains, [`vehicle`].

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
