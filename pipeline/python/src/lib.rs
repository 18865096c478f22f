//! `sastrugi._native`: the part of the Python package that is written in Rust. Thin: every function makes one call into the stages or a kernel,
//! and releases the interpreter's lock meanwhile. Parameters and results that are not arrays pass as JSON; `sastrugi/*.py` gives them their
//! shape.
//!
//! # Flow
//!
//! 1. A function of `sastrugi/*.py` turns its arguments into arrays and JSON.
//! 2. A function here (`surfaces.rs`, `runs.rs`, `releases.rs`) calls `sastrugi_stages`; `rasters.rs` passes heightfields.
//! 3. `waiting.rs` reports progress and watches for Ctrl-C meanwhile; `errors.rs` makes any error a `SastrugiError`.
//!
//! # Example
//!
//! ```python
//! import sastrugi
//!
//! snow = sastrugi.Fit({"model": "exponential", "parameters": {"sigma_m": 0.05, "range_m": 0.2}})
//! site = snow.texture(size=(16.0, 12.0), cell=0.1, seed=1, phase="gaussian", periodic=False)
//! sastrugi.fit(site, outer_scale=1.0, bootstrap=0).model  # "exponential"
//! ```

mod errors;
mod rasters;
mod releases;
mod runs;
mod surfaces;
mod waiting;

use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs the command line: arguments with the name of the program first; returns the exit code.
#[pyfunction]
fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(move || sastrugi_cli::run(arguments) as u8)
}

/// The functions and classes behind `sastrugi`.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<rasters::Crs>()?;
    module.add_class::<releases::Table>()?;
    module.add_class::<releases::Ground>()?;
    module.add_function(wrap_pyfunction!(main, module)?)?;
    module.add_function(wrap_pyfunction!(rasters::read, module)?)?;
    module.add_function(wrap_pyfunction!(rasters::write, module)?)?;
    module.add_function(wrap_pyfunction!(surfaces::terrain, module)?)?;
    module.add_function(wrap_pyfunction!(surfaces::fit_array, module)?)?;
    module.add_function(wrap_pyfunction!(surfaces::fit_file, module)?)?;
    module.add_function(wrap_pyfunction!(surfaces::load_fit, module)?)?;
    module.add_function(wrap_pyfunction!(surfaces::save_fit, module)?)?;
    module.add_function(wrap_pyfunction!(surfaces::quoted, module)?)?;
    module.add_function(wrap_pyfunction!(surfaces::texture, module)?)?;
    module.add_function(wrap_pyfunction!(surfaces::roughness, module)?)?;
    module.add_function(wrap_pyfunction!(surfaces::coregister, module)?)?;
    module.add_function(wrap_pyfunction!(runs::run, module)?)?;
    module.add_function(wrap_pyfunction!(runs::traverse, module)?)?;
    module.add_function(wrap_pyfunction!(runs::navigate, module)?)?;
    module.add_function(wrap_pyfunction!(runs::analyze, module)?)?;
    module.add_function(wrap_pyfunction!(releases::recording, module)?)?;
    Ok(())
}
