//! What a release holds: tables, ground and recordings.

use crate::errors::{refused, usage};
use crate::rasters::raster;
use crate::waiting::waited;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict, PyString};
use sastrugi_numeric::{Grid, PatchShape, height_patch, relative_height_patch};
use sastrugi_schemas::log::{Log, TimedPose};
use sastrugi_schemas::tables::ALL;
use sastrugi_schemas::{Cell, ColumnType};
use sastrugi_stages::Error;
use sastrugi_store::mcap::{McapError, read_log};
use sastrugi_store::parquet::{TableError, TableFiles};
use std::collections::HashMap;
use std::path::PathBuf;

/// Most distinct texts of a column that are shared as objects: ids of terrains, splits, outcomes.
const TEXTS_SHARED: usize = 1 << 10;

/// Arrays of floats.
type Floats<'py> = Vec<Bound<'py, PyArray1<f64>>>;

/// A table of a release, or some of its rows.
#[pyclass(frozen, name = "Table", module = "sastrugi._native")]
pub struct Table(TableFiles);

fn unusable(error: TableError) -> PyErr {
    refused(if error.unusable_input() { Error::Input(error.to_string()) } else { Error::io(error) })
}

#[pymethods]
impl Table {
    /// The table of this name, in these files.
    #[new]
    fn new(name: &str, paths: Vec<PathBuf>) -> PyResult<Self> {
        let table = ALL.iter().find(|table| table.name == name).ok_or_else(|| {
            let known: Vec<&str> = ALL.iter().map(|table| table.name).collect();
            usage(format!("there is no table {name}; known: {}", known.join(", ")))
        })?;
        TableFiles::new(table, paths).map(Self).map_err(unusable)
    }

    /// The rows with this text in a column.
    fn selecting(&self, column: &str, text: &str) -> PyResult<Self> {
        self.0.clone().selecting(column, text).map(Self).map_err(|e| usage(e.to_string()))
    }

    /// The rows whose text in a column lies between `first` and `last`, inclusive.
    fn between(&self, column: &str, first: &str, last: &str) -> PyResult<Self> {
        self.0.clone().between(column, first, last).map(Self).map_err(|e| usage(e.to_string()))
    }

    /// Name of the table.
    #[getter]
    fn name(&self) -> &'static str {
        self.0.table().name
    }

    /// Names of the columns, with type (`text`, `f64`, `i64`, `bool`, `f32_list`, `f64_list`), unit and description.
    fn columns(&self) -> Vec<(&'static str, &'static str, &'static str, &'static str)> {
        let columns = self.0.table().columns.iter();
        columns.map(|c| (c.name, type_name(c.column_type), c.unit, c.description)).collect()
    }

    /// Number of rows.
    fn rows(&self, py: Python<'_>) -> PyResult<u64> {
        py.detach(|| self.0.rows()).map_err(unusable)
    }

    /// The values of a column: an array of floats (NaN for null), or of integers or booleans without nulls; otherwise a list.
    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let table = self.0.table();
        let place = table.position(name).ok_or_else(|| {
            let known: Vec<&str> = table.columns.iter().map(|column| column.name).collect();
            usage(format!("table {} has no column {name}; known: {}", table.name, known.join(", ")))
        })?;
        match table.columns[place].column_type {
            ColumnType::F64 => {
                let floats = py.detach(|| self.0.floats(name)).map_err(unusable)?;
                return Ok(floats.into_pyarray(py).into_any());
            }
            ColumnType::I64 => {
                if let Some(integers) = py.detach(|| self.0.integers(name)).map_err(unusable)? {
                    return Ok(integers.into_pyarray(py).into_any());
                }
            }
            ColumnType::Text | ColumnType::Bool | ColumnType::F32List | ColumnType::F64List => {}
        }
        let cells = py.detach(|| self.0.column(name)).map_err(unusable)?;
        objects(py, table.columns[place].column_type, cells)
    }

    /// Runs of rows with the same text in a column, read in one pass: the text, and an array for each column of `floats`.
    fn runs<'py>(&self, py: Python<'py>, column: &str, floats: Vec<String>) -> PyResult<Vec<(String, Floats<'py>)>> {
        let read = || {
            let floats: Vec<&str> = floats.iter().map(String::as_str).collect();
            self.0.runs(column, &floats)
        };
        let runs = py.detach(read).map_err(unusable)?;
        let arrays = |floats: Vec<Vec<f64>>| -> Floats<'py> {
            floats.into_iter().map(|values| values.into_pyarray(py)).collect()
        };
        Ok(runs.into_iter().map(|run| (run.text, arrays(run.floats))).collect())
    }

    /// The rows as an `ArrowArrayStream` (Arrow PyCapsule interface). The schema is that of the table, whatever is asked for.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // The interface allows to ignore a wish that cannot be met, and the consumer then converts.
        drop(requested_schema);
        PyCapsule::new_with_value(py, self.0.stream(), c"arrow_array_stream")
    }

    /// The schema as an `ArrowSchema` (Arrow PyCapsule interface).
    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        PyCapsule::new_with_value(py, self.0.c_schema().map_err(unusable)?, c"arrow_schema")
    }
}

fn type_name(column: ColumnType) -> &'static str {
    match column {
        ColumnType::Text => "text",
        ColumnType::F64 => "f64",
        ColumnType::I64 => "i64",
        ColumnType::Bool => "bool",
        ColumnType::F32List => "f32_list",
        ColumnType::F64List => "f64_list",
    }
}

/// Values for NumPy: an array of booleans, or a list.
fn objects<'py>(py: Python<'py>, column: ColumnType, cells: Vec<Cell>) -> PyResult<Bound<'py, PyAny>> {
    let flag = |cell: &Cell| if let Cell::Bool(flag) = cell { Some(*flag) } else { None };
    if column == ColumnType::Bool
        && let Some(flags) = cells.iter().map(flag).collect::<Option<Vec<bool>>>()
    {
        return Ok(flags.into_pyarray(py).into_any());
    }
    let mut texts = HashMap::new();
    let one = |cell: Cell| -> PyResult<Bound<'py, PyAny>> {
        Ok(match cell {
            Cell::Null => py.None().into_bound(py),
            Cell::Bool(flag) => flag.into_pyobject(py)?.to_owned().into_any(),
            Cell::I64(number) => number.into_pyobject(py)?.into_any(),
            Cell::F64(number) => number.into_pyobject(py)?.into_any(),
            Cell::Text(text) => shared_text(py, &mut texts, text),
            Cell::F32List(all) => all.into_iter().map(f64::from).collect::<Vec<f64>>().into_pyarray(py).into_any(),
            Cell::F64List(all) => all.into_pyarray(py).into_any(),
        })
    };
    let list = cells.into_iter().map(one).collect::<PyResult<Vec<_>>>()?;
    Ok(list.into_pyobject(py)?.into_any())
}

/// A text as an object: the same object for a text that was seen recently.
fn shared_text<'py>(py: Python<'py>, seen: &mut HashMap<String, Bound<'py, PyAny>>, text: String) -> Bound<'py, PyAny> {
    if let Some(object) = seen.get(&text) {
        return object.clone();
    }
    if seen.len() == TEXTS_SHARED {
        seen.clear();
    }
    let object = PyString::new(py, &text).into_any();
    seen.insert(text, object.clone());
    object
}

/// Heights that stay in memory, to take many patches of them.
#[pyclass(frozen, name = "Ground", module = "sastrugi._native")]
pub struct Ground(Grid);

#[pymethods]
impl Ground {
    /// The ground of a heightfield.
    #[new]
    fn new(heightfield: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(raster(heightfield)?.grid))
    }

    /// Bilinear heights around (x, y), turned to the heading: row 0 ahead, column 0 to the left; NaN beyond the outer cell centres and next to
    /// holes. With `relative`, above the height at (x, y).
    fn patch<'py>(
        &self,
        py: Python<'py>,
        centre: [f64; 2],
        heading_rad: f64,
        size: [f64; 2],
        cell: f64,
        relative: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let shape = PatchShape::new(size, cell).ok_or_else(|| {
            let [along, across] = size;
            usage(format!(
                "`size` is {along} x {across} m with `cell` {cell} m; each side must be a whole number of cells, 1 to {}",
                PatchShape::POINTS_MAX
            ))
        })?;
        let heights = py.detach(|| match relative {
            true => relative_height_patch(&self.0, centre, heading_rad, &shape),
            false => height_patch(&self.0, centre, heading_rad, &shape),
        });
        heights.into_pyarray(py).reshape([shape.rows(), shape.cols()])
    }
}

/// Poses of a recording, or of any log that `analyze` reads: a list of streams, each a dict with `topic`, `frame`, `body`, `time_ns` (int64),
/// `position` (samples x 3, m) and `orientation` (samples x 4, quaternion x, y, z, w).
#[pyfunction]
pub fn recording<'py>(py: Python<'py>, path: PathBuf) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let log: Log = waited(py, move || {
        read_log(&path).map_err(|e| match e {
            McapError::Io { path, source } => Error::unreadable(&path, &source),
            McapError::Unusable { .. } => Error::Input(e.to_string()),
            other => Error::failed(other),
        })
    })?;
    let poses = log.poses.iter().map(|s| (&s.topic, &s.frame, &s.body, &s.poses));
    let transforms = log.transforms.iter().map(|s| (&s.topic, &s.parent, &s.child, &s.poses));
    poses.chain(transforms).map(|(topic, frame, body, poses)| stream(py, [topic, frame, body], poses)).collect()
}

fn stream<'py>(
    py: Python<'py>,
    [topic, frame, body]: [&String; 3],
    poses: &[TimedPose],
) -> PyResult<Bound<'py, PyDict>> {
    let table = |values: Vec<f64>, width: usize| values.into_pyarray(py).reshape([poses.len(), width]);
    let times: Vec<i64> = poses.iter().map(|pose| pose.time_ns).collect();
    let stream = PyDict::new(py);
    stream.set_item("topic", topic)?;
    stream.set_item("frame", frame)?;
    stream.set_item("body", body)?;
    stream.set_item("time_ns", times.into_pyarray(py))?;
    stream.set_item("position", table(poses.iter().flat_map(|pose| pose.position_m).collect(), 3)?)?;
    stream.set_item("orientation", table(poses.iter().flat_map(|pose| pose.orientation).collect(), 4)?)?;
    Ok(stream)
}
