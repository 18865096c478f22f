//! Terrain patches, map tiles and the map page over HTTP. The only room that names an async runtime or a web framework.
//!
//! Kernels run on rayon, never on the threads of the runtime.

pub mod library;
