//! Heightfields between NumPy and the kernels: values row by row from the north, cell and origin in metres, coordinate system.

use crate::errors::{refused, usage};
use crate::waiting::waited;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyType;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_stages::Error;
use sastrugi_stages::arrays::Raster;
use sastrugi_stages::remote::check_file;
use sastrugi_stages::verbs::{self, Read, Reading};
use sastrugi_store::dem::{self, Compression, DemError, Format, GeoKey, WriteOptions};
use std::path::PathBuf;

/// A coordinate system, passed from file to file unchanged.
#[pyclass(frozen, name = "Crs", module = "sastrugi._native")]
#[derive(Clone)]
pub struct Crs(dem::Crs);

/// Value of a GeoTIFF key.
#[derive(FromPyObject, IntoPyObject)]
pub enum KeyValue {
    /// Code.
    Short(u16),
    /// Text.
    Ascii(String),
    /// Numbers.
    Double(Vec<f64>),
}

/// What a system consists of: whether it is in degrees, EPSG code, name and GeoTIFF keys.
type CrsParts = (bool, Option<u16>, String, Vec<(u16, KeyValue)>);

#[pymethods]
impl Crs {
    /// The system of these parts, which copies and pickles are made from.
    #[new]
    fn new(geographic: bool, epsg: Option<u16>, name: String, keys: Vec<(u16, KeyValue)>) -> Self {
        let value = |value| match value {
            KeyValue::Short(code) => GeoKey::Short(code),
            KeyValue::Ascii(text) => GeoKey::Ascii(text),
            KeyValue::Double(numbers) => GeoKey::Double(numbers),
        };
        let keys = keys.into_iter().map(|(key, of)| (key, value(of))).collect();
        Self(dem::Crs { geographic, epsg, name, keys })
    }

    /// How `copy` and `pickle` make it again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> (Bound<'py, PyType>, CrsParts) {
        let value = |value: &GeoKey| match value {
            GeoKey::Short(code) => KeyValue::Short(*code),
            GeoKey::Ascii(text) => KeyValue::Ascii(text.clone()),
            GeoKey::Double(numbers) => KeyValue::Double(numbers.clone()),
        };
        let dem::Crs { geographic, epsg, name, keys } = &self.0;
        let keys = keys.iter().map(|(key, of)| (*key, value(of))).collect();
        (py.get_type::<Self>(), (*geographic, *epsg, name.clone(), keys))
    }

    /// EPSG code, or None.
    #[getter]
    fn epsg(&self) -> Option<u16> {
        self.0.epsg
    }

    /// Name; empty if the file gave none.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    fn __repr__(&self) -> String {
        match (self.0.epsg, self.0.name.as_str()) {
            (Some(code), _) => format!("Crs(EPSG:{code})"),
            (None, "") => "Crs(local)".to_owned(),
            (None, name) => format!("Crs({name})"),
        }
    }
}

/// Values, cell, origin and coordinate system, as `Heightfield` takes them; a local plane has no system.
pub type Parts<'py> = (Bound<'py, PyArray2<f64>>, [f64; 2], [f64; 2], Option<Crs>);

/// An array of a grid's values.
pub fn array<'py>(py: Python<'py>, grid: Grid) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let shape = [grid.geometry.rows, grid.geometry.cols];
    grid.values.into_pyarray(py).reshape(shape)
}

/// A raster for Python.
pub fn parts(py: Python<'_>, raster: Raster) -> PyResult<Parts<'_>> {
    let Raster { grid, crs } = raster;
    let Geometry { cell, origin, .. } = grid.geometry;
    let crs = (crs != dem::Crs::default()).then_some(Crs(crs));
    Ok((array(py, grid)?, cell, origin, crs))
}

/// The raster of a `Heightfield`.
pub fn raster(heightfield: &Bound<'_, PyAny>) -> PyResult<Raster> {
    let values: PyReadonlyArray2<'_, f64> = heightfield.getattr("values")?.extract()?;
    let cell: [f64; 2] = heightfield.getattr("cell")?.extract()?;
    let origin: [f64; 2] = heightfield.getattr("origin")?.extract()?;
    let crs: Option<Bound<'_, Crs>> = heightfield.getattr("crs")?.extract()?;
    let values = values.as_array();
    let (rows, cols) = values.dim();
    let grid = Grid::new(Geometry { rows, cols, cell, origin }, values.iter().copied().collect());
    Raster::new(grid, crs.map_or_else(dem::Crs::default, |crs| crs.get().0.clone())).map_err(refused)
}

/// Reads a DEM as the verbs do, cropped to the window; degrees are converted to metres, or stay. Returns its parts and notes.
#[pyfunction]
pub fn read(
    py: Python<'_>,
    path: PathBuf,
    cell: Option<[f64; 2]>,
    window: Option<[f64; 4]>,
    in_metres: bool,
) -> PyResult<(Parts<'_>, Vec<String>)> {
    let reading = Reading { cell_m: cell, window, ..Reading::default() };
    let Read { dem, notes, .. } =
        waited(
            py,
            move || {
                if in_metres { verbs::read(&path, &reading) } else { verbs::read_as_it_is(&path, &reading) }
            },
        )?;
    Ok((parts(py, Raster { grid: dem.grid, crs: dem.info.crs })?, notes))
}

/// Writes a heightfield; the ending of the name decides on the format. Returns notes on what the format loses.
#[pyfunction]
pub fn write(
    py: Python<'_>,
    heightfield: &Bound<'_, PyAny>,
    path: PathBuf,
    compress: &str,
    cog: bool,
) -> PyResult<Vec<String>> {
    check_file(&path).map_err(refused)?;
    let compression = match compress {
        "none" => Compression::None,
        "deflate" => Compression::Deflate,
        "zstd" => Compression::Zstd,
        other => return Err(usage(format!("`compress` is \"{other}\"; it must be none, deflate or zstd"))),
    };
    if cog && Format::of_name(&path) != Some(Format::GeoTiff) {
        return Err(usage(format!("{}: `cog` requires a GeoTIFF (.tif)", path.display())));
    }
    let options = WriteOptions { compression, cloud_optimised: cog, ..WriteOptions::default() };
    let Raster { grid, crs } = raster(heightfield)?;
    waited(py, move || dem::write(&path, &grid, &crs, &options).map_err(write_error))
}

/// A grid that does not fit the format is bad usage.
fn write_error(error: DemError) -> Error {
    match error {
        DemError::Unfit { .. } => Error::Usage(error.to_string()),
        other => Error::io(other),
    }
}
