//! Features of frames: their description, their Arrow arrays, their statistics.

use super::{Stats, Summary};
use crate::parquet::{ELEMENT, element};
use arrow_array::{Array, ArrayRef, BooleanArray, FixedSizeListArray, Float32Array, Int64Array, ListArray};
use arrow_schema::{ArrowError, DataType, Field};
use parquet::schema::types::ColumnPath;
use serde_json::{Value, json};
use std::ops::Range;
use std::sync::Arc;

/// Type of a feature's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// 32-bit float.
    F32,
    /// 64-bit signed integer.
    I64,
    /// Boolean.
    Bool,
}

impl Kind {
    /// Name of the type in `meta/info.json`.
    const fn dtype(self) -> &'static str {
        match self {
            Self::F32 => "float32",
            Self::I64 => "int64",
            Self::Bool => "bool",
        }
    }

    const fn bytes(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::I64 => 8,
            Self::Bool => 1,
        }
    }

    const fn data_type(self) -> DataType {
        match self {
            Self::F32 => DataType::Float32,
            Self::I64 => DataType::Int64,
            Self::Bool => DataType::Boolean,
        }
    }
}

/// Shape of a feature in one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One value.
    Scalar,
    /// A vector of this length, above 1.
    Vector(usize),
    /// Rows and columns.
    Matrix([usize; 2]),
}

impl Shape {
    /// Number of values in a frame.
    pub const fn count(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vector(n) => n,
            Self::Matrix([rows, cols]) => rows * cols,
        }
    }

    /// Length of the last axis, over which statistics are not taken.
    const fn width(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vector(n) => n,
            Self::Matrix([_, cols]) => cols,
        }
    }

    fn to_json(self) -> Value {
        match self {
            Self::Scalar => json!([1]),
            Self::Vector(n) => json!([n]),
            Self::Matrix(sides) => json!(sides),
        }
    }
}

/// A feature of every frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Feature {
    /// Name, without `/`.
    pub name: &'static str,
    /// Type of its values.
    pub kind: Kind,
    /// Shape in one frame.
    pub shape: Shape,
    /// Names of the values of a vector, or of the axes of a matrix; empty for none.
    pub names: Vec<String>,
}

impl Feature {
    /// The features that the package expects in every dataset.
    pub(super) fn of_every_dataset() -> Vec<Self> {
        let scalar = |name, kind| Self { name, kind, shape: Shape::Scalar, names: vec![] };
        let integers = ["frame_index", "episode_index", "index", "task_index"].map(|name| scalar(name, Kind::I64));
        std::iter::once(scalar("timestamp", Kind::F32)).chain(integers).collect()
    }

    pub(super) fn to_json(&self) -> Value {
        let names = if self.names.is_empty() { Value::Null } else { json!(self.names) };
        json!({"dtype": self.kind.dtype(), "shape": self.shape.to_json(), "names": names})
    }

    /// Its column: a value, a list of fixed length, or a list of lists, as Hugging Face `datasets` stores `Value`, `List` and `Array2D`.
    pub(super) fn field(&self) -> Field {
        let value = self.kind.data_type();
        let data_type = match self.shape {
            Shape::Scalar => value,
            Shape::Vector(n) => DataType::FixedSizeList(element(value), n as i32),
            Shape::Matrix(_) => DataType::List(element(DataType::List(element(value)))),
        };
        Field::new(self.name, data_type, true)
    }

    /// Parquet path of its values, if they are floats.
    pub(super) fn float_path(&self) -> Option<ColumnPath> {
        let lists: &[&str] = match self.shape {
            Shape::Scalar => &[],
            Shape::Vector(_) => &["list", ELEMENT],
            Shape::Matrix(_) => &["list", ELEMENT, "list", ELEMENT],
        };
        let path: Vec<String> = std::iter::once(&self.name).chain(lists).map(|part| (*part).to_owned()).collect();
        (self.kind == Kind::F32).then(|| ColumnPath::new(path))
    }

    /// Size of the values of a frame, bytes.
    pub(super) const fn frame_bytes(&self) -> usize {
        self.kind.bytes() * self.shape.count()
    }

    /// Checks the values of an episode.
    ///
    /// # Panics
    /// If there are not `frames` times as many as in one frame, or they are of another type.
    pub(super) fn check(&self, values: &Values, frames: usize) {
        assert_eq!((values.kind(), values.len()), (self.kind, frames * self.shape.count()), "values of {}", self.name);
    }

    /// The values of some frames of an episode as a column.
    pub(super) fn array(&self, values: &Values, frames: &Range<usize>) -> Result<ArrayRef, ArrowError> {
        let count = self.shape.count();
        let flat = values.flat(count * frames.start..count * frames.end);
        match self.shape {
            Shape::Scalar => Ok(flat),
            Shape::Vector(n) => Ok(Arc::new(fixed(flat, n)?)),
            Shape::Matrix([rows, cols]) => {
                let lines = ListArray::from(fixed(flat, cols)?);
                Ok(Arc::new(ListArray::from(fixed(Arc::new(lines), rows)?)))
            }
        }
    }

    /// Statistics of the values of an episode.
    pub(super) fn stats(&self, values: &Values, frames: usize) -> Stats {
        let width = self.shape.width();
        let column = |k: usize| (k..values.len()).step_by(width).map(|at| values.at(at)).collect::<Vec<f64>>();
        Stats::of((0..width).map(column), frames as u64)
    }
}

/// Lists of equal length from their elements, one list after the other.
fn fixed(elements: ArrayRef, length: usize) -> Result<FixedSizeListArray, ArrowError> {
    FixedSizeListArray::try_new(element(elements.data_type().clone()), length as i32, elements, None)
}

/// One list that holds all elements.
pub(super) fn list_of_all(elements: ArrayRef) -> Result<ArrayRef, ArrowError> {
    let length = elements.len();
    Ok(Arc::new(ListArray::from(fixed(elements, length)?)))
}

/// Values of a feature in an episode, frame by frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// 32-bit floats.
    F32(Vec<f32>),
    /// 64-bit signed integers.
    I64(Vec<i64>),
    /// Booleans.
    Bool(Vec<bool>),
}

impl Values {
    /// Values of [`Feature::of_every_dataset`] for the next episode after those `written`.
    pub(super) fn of_every_dataset(frames: usize, fps: u32, written: &Summary, task: i64) -> [Self; 5] {
        let frame = || 0..frames as i64;
        let time_s = |frame: i64| (frame as f64 / f64::from(fps)) as f32;
        let same = |value: i64| Self::I64(vec![value; frames]);
        [
            Self::F32(frame().map(time_s).collect()),
            Self::I64(frame().collect()),
            same(written.episodes as i64),
            Self::I64(frame().map(|frame| written.frames as i64 + frame).collect()),
            same(task),
        ]
    }

    fn kind(&self) -> Kind {
        match self {
            Self::F32(_) => Kind::F32,
            Self::I64(_) => Kind::I64,
            Self::Bool(_) => Kind::Bool,
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::I64(values) => values.len(),
            Self::Bool(values) => values.len(),
        }
    }

    /// The value at a position; 0 or 1 for a boolean.
    fn at(&self, at: usize) -> f64 {
        match self {
            Self::F32(values) => f64::from(values[at]),
            Self::I64(values) => values[at] as f64,
            Self::Bool(values) => f64::from(u8::from(values[at])),
        }
    }

    /// Some of the values, one after the other.
    fn flat(&self, range: Range<usize>) -> ArrayRef {
        match self {
            Self::F32(values) => Arc::new(Float32Array::from(values[range].to_vec())),
            Self::I64(values) => Arc::new(Int64Array::from(values[range].to_vec())),
            Self::Bool(values) => Arc::new(BooleanArray::from(values[range].to_vec())),
        }
    }
}
