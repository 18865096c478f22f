//! Code shared by several jobs, or by jobs and verbs.
//!
//! | task | module |
//! |---|---|
//! | read and prepare a DEM | [`mod@dem`] (window, metres), [`place`] (position in its raster), [`masks`], [`coregistration`] |
//! | generate and write surfaces | [`terrains`], [`inputs`], [`textures`], [`fits`] (file and table rows) |
//! | render images and recover heights from them | [`images`], [`photoclinometry`] |
//! | plan and drive | [`routes`], [`drawn`] (missions of other sections), [`rovers`], [`planner`], [`roughness`] (settings), [`room`] on surfaces |

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
pub mod room;
pub mod roughness;
pub mod routes;
pub mod rovers;
pub mod terrains;
pub mod textures;
