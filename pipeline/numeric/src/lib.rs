//! Grids, named random streams, transforms and ordered arithmetic: the ground floor of every kernel.
//!
//! # Conventions (stated once, here)
//! * SI units; names end in their unit.
//! * A grid cell `(row r, col c)` is the point `x = x0 + (c + 1/2) cell_x`, `y = y0 + (rows - r - 1/2) cell_y`:
//!   row 0 is north, x points east, y north, z up. `(x0, y0)` is the south-west corner. Heights between
//!   centres are bilinear; beyond the outer centres they are undefined.
//! * `NaN` marks a cell without data in floating-point grids.
//! * Transforms are unnormalised forward (`exp(-2 pi i k n / N)`) and divided by `N` on the way back.
//!
//! # Same bits everywhere
//! Kernels use `+ - * /`, `sqrt` and the `libm` crate only; sums run in a fixed order; transforms take vectors as wide as
//! the CPU's, number by number with the operations of the narrow ones. Work is spread over threads only where each output element is computed by one task from inputs
//! that are already complete, so that the number of threads changes no bit.

pub mod counter;
pub mod fft;
pub mod filters;
pub mod grid;
pub mod ground;
pub mod ops;
pub mod resample;
mod simd;
pub mod streams;
pub mod sums;
pub mod surface;
pub mod triangulation;
pub mod turns;

pub use counter::{Counter, Poisson};
pub use grid::{Geometry, Grid};
pub use ground::{Ground, GroundClass, GroundGrid, GroundPoint, NoGround};
pub use streams::{Stream, Streams};
pub use surface::Surface;
pub use triangulation::{Triangulation, triangulate};
