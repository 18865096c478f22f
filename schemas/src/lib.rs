//! What crosses a boundary: the study envelope, parameter errors and kinds, rows of every Parquet table, the fit file,
//! the manifest, MCAP topics, vehicles as bodies on joints, and roughness classes. No algorithms, no file formats.

pub mod answer;
pub mod class;
pub mod coregistration;
pub mod fit;
pub mod kind;
pub mod log;
pub mod manifest;
pub mod mechanism;
pub mod study;
pub mod tables;
pub mod topics;

pub use answer::Answer;
pub use class::RoughnessClass;
pub use kind::{Kind, ParameterError, shown};
pub use tables::{Cell, Column, ColumnType, Record, Table};
