//! Images of surfaces, and surfaces from images: arrays in, arrays out.
//!
//! * [`photometry`] tells how bright a facet is under a light and a view, [`mod@direction`] where these are, [`camera`] which pixel a
//!   point of the ground falls on.
//! * [`photoclinometry`] finds heights and albedo from three or more images.
//! * [`sun`] and [`pose`] are the light and the camera as a study says them, [`description`] is the file beside an image.
//! * [`mod@render`] makes images; [`hillshade`] shades relief as maps do, [`display`] turns an image into levels of grey.
//!
//! # Conventions
//! Vectors are `[east, north, up]`. Slopes are `p = dz/dx` (east) and `q = dz/dy` (north), and the unit normal of a facet is
//! `n = (-p, -q, 1) / sqrt(1 + p^2 + q^2)`. Pixel `(row, col)` of an image is centred on `(col + 1/2, row + 1/2)`, row 0 at the top.
//! Brightness is that of a surface over that of a white Lambert surface which faces the light (radiance factor, I/F).

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
