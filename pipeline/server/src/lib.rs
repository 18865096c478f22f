//! Terrain patches, map tiles and the map page over HTTP. The only room that names an async runtime or a web framework.
//!
//! * [`collections`]: what is served: worlds, made on demand, and the rasters of releases. [`samples`]: what they give.
//! * [`library`]: tiles that were made once.
//! * [`grid`], [`layers`]: where map tiles lie, and how samples become colours.
//! * [`http`]: addresses, parameters, answers, limits. [`client`]: the other end of the line.
//!
//! Kernels run on the workers of the library and on blocking threads, never on those of the runtime.

pub mod client;
pub mod collections;
pub mod grid;
pub mod http;
pub mod layers;
pub mod library;
pub mod samples;
mod serve;

pub use http::Limits;
pub use library::Settings as LibrarySettings;
pub use serve::{Settings, Stop, serve};

/// Revision of all that answers depend on.
pub fn revision() -> String {
    let own = env!("CARGO_PKG_VERSION");
    format!("{own} {} answers {ANSWERS}", sastrugi_stages::verbs::served::revision())
}

/// Number of the form of answers; it changes when a layer or a format comes out otherwise.
const ANSWERS: u32 = 1;
