//! Images of surfaces, and surfaces from images: arrays in, arrays out.
//!
//! # From a surface to images and back
//! 1. [`RenderParameters`] hold sun, camera and response of the camera; [`CameraParameters::pose`] places the camera over the surface.
//! 2. [`render()`] renders an image of a [`Scene`]; an [`ImageDescription`] is the JSON file that accompanies it.
//! 3. [`photoclinometry::described::map`] and [`photoclinometry::described::images`] prepare described images for an inversion.
//! 4. [`photoclinometry::recover()`] recovers heights and albedo from three or more images.
//! 5. [`photoclinometry::evaluation::evaluate`] compares them with the truth.
//!
//! Underneath, [`photometry`] computes the brightness of a facet under a light and a view, [`mod@direction`] their unit vectors, and
//! [`camera`] the pixel of a ground point. For maps and screens, [`hillshade::hillshade`] shades relief and [`display::grey`] converts an
//! image to grey levels.
//!
//! ```
//! use sastrugi_imaging::photoclinometry::{Image, Known, Settings, recover};
//! use sastrugi_imaging::{RenderParameters, Scene, Sun, render};
//! use sastrugi_numeric::{Geometry, Grid, Streams};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Ground that rises by 0.2 to the east and falls by 0.1 to the north, seen from above under three suns.
//! let g = Geometry::square(16, 16, 2.0);
//! let heights = Grid::new(g, (0..g.len()).map(|k| 0.2 * g.x(k % 16) - 0.1 * g.y(k / 16)).collect());
//! let streams = Streams::for_seed(1, "example");
//! let mut images = Vec::new();
//! for azimuth_deg in [0.0, 120.0, 240.0] {
//!     let sun = Sun { azimuth_deg, elevation_deg: 45.0 };
//!     let parameters = RenderParameters { sun, albedo: 0.25, ..RenderParameters::default() };
//!     let made = render(&Scene { heights: &heights, albedo: None }, &parameters, &streams)?;
//!     images.push(Image {
//!         camera: made.pose.camera(),
//!         light: sun.direction(),
//!         exposure: 1.0,
//!         haze: 0.0,
//!         brightness: made.image().values,
//!     });
//! }
//!
//! // From level ground and an unknown albedo, the inversion finds both.
//! let start = Grid::filled(g, 0.0);
//! let settings = Settings { samples: 0, ..Settings::default() };
//! let found = recover(&images, &start, &Known::default(), &settings, &streams)?;
//! assert!(found.converged);
//! assert!(found.slopes.iter().all(|[p, q]| (p - 0.2).abs() < 1e-6 && (q + 0.1).abs() < 1e-6));
//! assert!(found.albedo.values.iter().all(|albedo| (albedo - 0.25).abs() < 1e-6));
//! // Two metres farther east, the ground is 0.4 m higher.
//! assert!((found.heights.at(8, 9) - found.heights.at(8, 8) - 0.4).abs() < 1e-4);
//! # Ok(())
//! # }
//! ```
//!
//! # Conventions
//! Vectors are `[east, north, up]`. Slopes are `p = dz/dx` (east) and `q = dz/dy` (north), and the unit normal of a facet is
//! `n = (-p, -q, 1) / sqrt(1 + p^2 + q^2)`. Pixel `(row, col)` of an image is centred on `(col + 1/2, row + 1/2)`, row 0 at the top.
//! Brightness is relative to a white Lambert surface that faces the light (radiance factor, I/F).

pub mod camera;
pub mod description;
pub mod direction;
pub mod display;
pub mod hillshade;
pub mod photoclinometry;
pub mod photometry;
pub mod pose;
pub mod render;
pub mod sun;

pub use camera::{Camera, ParallelCamera, PinholeCamera, Ray};
pub use description::{ImageDescription, Noise, Rendered};
pub use direction::direction;
pub use photometry::Photometry;
pub use pose::{CameraParameters, CameraPose};
pub use render::{RenderError, RenderParameters, Rendering, Scene, render};
pub use sun::Sun;
