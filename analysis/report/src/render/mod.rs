//! Drawing: numbers, axes, colours, pictures, charts, maps and the page. Nothing here depends on what is drawn.

pub mod axis;
pub mod chart;
pub mod colour;
pub mod html;
pub mod map;
pub mod number;
pub mod picture;
pub mod raster;
pub mod svg;
pub mod thin;
