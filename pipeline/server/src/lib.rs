//! HTTP server for terrain patches, map tiles and the map page. The only room that depends on an async runtime or a web framework.
//! Kernels run on the library's worker threads and on blocking threads, never on the runtime's own threads.
//!
//! # Flow
//!
//! 1. [`serve`] opens the worlds and releases named in its [`Settings`] as [`collections`], and listens.
//! 2. [`http`] checks a request against the limits, reads its parameters and finds its collection.
//! 3. A release is read from its files. A world is generated in tiles, which the [`library`] caches and generates once for all who wait.
//! 4. The [`samples`] are thinned, rotated and encoded as a patch, or coloured as a [`layers::Layer`] of a tile of the collection's [`grid`].
//! 5. [`client::Client`] fetches patches from Rust.
//!
//! # Example
//!
//! Serves a world that is a plane, and fetches a patch of it:
//!
//! ```
//! use sastrugi_server::client::{Client, Patch};
//! use sastrugi_server::{LibrarySettings, Limits, Settings, Stop, serve};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // It rises by 0.1 per metre eastward; samples are 2 cm apart.
//! let folder = tempfile::tempdir()?;
//! let file = folder.path().join("ramp.toml");
//! std::fs::write(
//!     &file,
//!     "kind = 'planetary'\nseed = 1\ncell_m = 0.02\nprocesses = [{ kind = 'base_slope', gradient = [0.1, 0.0] }]\n",
//! )?;
//! let settings = Settings {
//!     paths: vec![file],
//!     listen: "127.0.0.1:0".parse()?,
//!     library: LibrarySettings { folder: None, disk_bytes: 0, memory_bytes: 64 << 20, workers: 1, queue: 64 },
//!     limits: Limits::default(),
//!     token: None,
//!     origins: Vec::new(),
//! };
//! let stop = Stop::default();
//! let (tell, told) = std::sync::mpsc::channel();
//! let stopped = stop.clone();
//! let server = std::thread::spawn(move || {
//!     serve(&settings, &stopped, |address, _| drop(tell.send(address))).map_err(|error| error.to_string())
//! });
//!
//! // Four columns and three rows, with the south-west sample at the origin.
//! let client = Client::new(&format!("http://{}", told.recv()?));
//! let heights = client.patch(&Patch::new("ramp", [0.0, 0.0], [4, 3]))?;
//! assert_eq!((heights.rows(), heights.cols(), heights.geometry.cell), (3, 4, [0.02; 2]));
//! assert!((heights.at(2, 3) - heights.at(2, 0) - 0.006).abs() < 1e-6);
//! assert!((heights.at(0, 0) - heights.at(2, 0)).abs() < 1e-6);
//!
//! drop(client);
//! stop.stop();
//! server.join().map_err(|_| "the server panicked")??;
//! # Ok(())
//! # }
//! ```

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

/// Revision of everything that responses depend on.
pub fn revision() -> String {
    let own = env!("CARGO_PKG_VERSION");
    format!("{own} {} answers {ANSWERS}", sastrugi_stages::verbs::served::revision())
}

/// Version of the response formats; increment it when the output of a layer or a format changes.
const ANSWERS: u32 = 2;
