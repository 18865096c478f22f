//! Types shared between crates and with readers: the study envelope, parameter errors and kinds, rows of all Parquet tables, the fit
//! file, the manifest, MCAP topics, vehicles as bodies on joints, and roughness classes. No algorithms, no file formats.
//!
//! What passes through here, from a study to its readers:
//!
//! 1. A table of a study becomes a type of [`study`] and the raw parameters of a kernel with [`kind::read_parameters`] or
//!    [`kind::read_all`]; a [`ParameterError`] names the key that is wrong. [`kind::schema_of`] is the JSON Schema that editors check.
//! 2. Registries describe their generators, methods and vehicles as [`Kind`]s.
//! 3. Results are rows of [`tables`]: each row type is a [`Record`], whose [`Table`] holds the names, units and descriptions of the
//!    columns.
//! 4. Fits are [`fit::FitFile`]s, recordings have the [`topics`] listed here, and [`manifest::Manifest`] says where each file came from.
//!
//! # Example
//!
//! A row of a table: what its columns mean, and how it converts to cells and JSON and back.
//!
//! ```
//! use sastrugi_schemas::tables::PsdRow;
//! use sastrugi_schemas::{Cell, Record};
//! use serde_json::json;
//!
//! let row =
//!     PsdRow { surface_id: "hill".to_owned(), bin: 3, frequency_cycles_m: 0.25, psd_m4: f64::NAN, modes: 12 };
//! let frequency = &PsdRow::TABLE.columns[2];
//! assert_eq!((frequency.name, frequency.unit, frequency.key), ("frequency_cycles_m", "1/m", false));
//!
//! // A number that is not known is null.
//! assert_eq!(row.cells()[3], Cell::Null);
//! assert_eq!(
//!     row.to_json(),
//!     json!({ "surface_id": "hill", "bin": 3, "frequency_cycles_m": 0.25, "psd_m4": null, "modes": 12 })
//! );
//! assert!(PsdRow::from_cells(row.cells()).is_some_and(|again| again.psd_m4.is_nan() && again.modes == 12));
//!
//! // Keys are never null.
//! let mut cells = row.cells();
//! cells[0] = Cell::Null;
//! assert!(PsdRow::from_cells(cells).is_none());
//! ```

pub mod answer;
pub mod class;
pub mod coregistration;
pub mod fit;
pub mod kind;
pub mod limits;
pub mod log;
pub mod manifest;
pub mod mechanism;
pub mod statistics;
pub mod study;
pub mod tables;
pub mod topics;

pub use answer::Answer;
pub use class::RoughnessClass;
pub use kind::{Kind, ParameterError, capital, counted, shown};
pub use tables::{Cell, Column, ColumnType, Record, Table};
