//! Grids, named random streams, Fourier transforms and fixed-order arithmetic: the foundation of every kernel.
//!
//! 1. A [`Geometry`] states the shape and position of a [`Grid`], which holds heights, classes or other values.
//! 2. [`Streams`] name the random numbers that fill it; a [`Counter`] draws them by place instead of by order.
//! 3. [`fft::RealFft2`], [`fft::even_spectrum`] and [`filters::gaussian_low_pass`] transform and smooth grids; [`ops`] and [`sums`] combine
//!    and summarise them in a fixed order.
//! 4. [`resample`] crops, coarsens and refines grids; [`triangulate`] decimates them to a mesh.
//! 5. A [`Surface`] has heights and gradients between the cell centres; [`Ground`] adds the class and the albedo that vehicles meet;
//!    [`height_patch`] is what a vehicle sees around itself.
//!
//! ```
//! use sastrugi_numeric::fft::RealFft2;
//! use sastrugi_numeric::filters::gaussian_low_pass;
//! use sastrugi_numeric::{Geometry, Grid, Streams, Surface, ops, sums};
//!
//! // White noise of 32 x 48 cells of 0.5 m, the same on every machine.
//! let mut stream = Streams::for_seed(42, "example").stream("heights");
//! let geometry = Geometry::square(32, 48, 0.5);
//! let noise = Grid::new(geometry, (0..geometry.len()).map(|_| stream.normal()).collect());
//!
//! // A low-pass of 2 cells leaves about 1 / (16 pi) of the variance; the rest is the residual.
//! let background = gaussian_low_pass(&noise, 2.0);
//! let residual = ops::combine(&noise, &background, |height, low| height - low);
//! assert!(sums::variance(&background.values) < 0.1 * sums::variance(&noise.values));
//!
//! // Mode 0 of the spectrum is the sum of all heights, and the inverse gives them back.
//! let fft = RealFft2::new(geometry.rows, geometry.cols);
//! let spectrum = fft.forward(&residual.values);
//! assert!((spectrum.values[0].re - sums::sum(&residual.values)).abs() < 1e-9);
//! let back = fft.inverse(spectrum);
//! assert!(back.iter().zip(&residual.values).all(|(a, b)| (a - b).abs() < 1e-12));
//!
//! // At a cell centre, the surface has the height of the cell.
//! let (x, y) = (geometry.x(3), geometry.y(2));
//! assert_eq!(noise.height(x, y), Some(noise.at(2, 3)));
//! ```
//!
//! # Conventions of all kernels
//! * SI units; names end in their unit.
//! * A grid cell `(row r, col c)` is the point `x = x0 + (c + 1/2) cell_x`, `y = y0 + (rows - r - 1/2) cell_y`:
//!   row 0 is north, x points east, y north, z up. `(x0, y0)` is the south-west corner. Heights between
//!   centres are bilinear; beyond the outer centres they are undefined.
//! * `NaN` marks a cell without data in floating-point grids.
//! * Forward transforms are unnormalised (`exp(-2 pi i k n / N)`); inverse transforms are divided by `N`.
//!
//! # Same bits everywhere
//! Kernels use only `+ - * /`, `sqrt` and the `libm` crate. Sums run in a fixed order. Transforms use the widest vectors of the CPU, but
//! apply to each number the same operations as narrow ones. Work is spread over threads only where each output element is computed by one
//! task from inputs that are already complete, so that the number of threads changes no bit.

pub mod counter;
pub mod fft;
pub mod filters;
pub mod grid;
pub mod ground;
pub mod ops;
pub mod patch;
pub mod resample;
pub mod simd;
pub mod streams;
pub mod sums;
pub mod surface;
pub mod triangulation;
pub mod turns;

pub use counter::{Counter, Poisson};
pub use grid::{Geometry, Grid};
pub use ground::{Ground, GroundClass, GroundGrid, GroundPoint, NoGround};
pub use patch::{PatchShape, height_patch, relative_height_patch};
pub use simd::uses_wide_vectors;
pub use streams::{Stream, Streams};
pub use surface::Surface;
pub use triangulation::{Triangulation, triangulate};
