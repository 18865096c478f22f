//! Parquet tables of a release: one file per table, rows as plain structs, units and descriptions beside each column.
//!
//! A row type is declared once by the macro `table!`; the column list, the reading order and the cells follow from it.

pub mod candidate_curves;
pub mod candidates;
pub mod covariance;
pub mod dem_fits;
pub mod fits;
pub mod formation_events;
pub mod formation_samples;
pub mod formations;
pub mod height_distribution;
pub mod images;
pub mod likelihood_profile;
pub mod logs;
pub mod missions;
pub mod parameters;
pub mod photoclinometry;
pub mod profile_psd;
pub mod psd;
pub mod replicates;
pub mod route_points;
pub mod routes;
pub mod rover_designs;
pub mod rover_effects;
pub mod rover_samples;
pub mod rovers;
pub mod samples;
pub mod scoreboard;
pub mod structure;
pub mod surfaces;
pub mod terrains;

pub use candidate_curves::CandidateCurveRow;
pub use candidates::CandidateRow;
pub use covariance::CovarianceRow;
pub use dem_fits::{BesideFit, DemFitRow};
pub use fits::FitRow;
pub use formation_events::FormationEventRow;
pub use formation_samples::FormationSampleRow;
pub use formations::FormationRow;
pub use height_distribution::HeightDistributionRow;
pub use images::ImageRow;
pub use likelihood_profile::LikelihoodProfileRow;
pub use logs::LogRow;
pub use missions::MissionRow;
pub use parameters::ParameterRow;
pub use photoclinometry::{PhotoclinometryBandRow, PhotoclinometryRow};
pub use profile_psd::ProfilePsdRow;
pub use psd::PsdRow;
pub use replicates::ReplicateRow;
pub use route_points::RoutePointRow;
pub use routes::RouteRow;
pub use rover_designs::RoverDesignRow;
pub use rover_effects::RoverEffectRow;
pub use rover_samples::RoverSampleRow;
pub use rovers::RoverRow;
pub use samples::SampleRow;
pub use scoreboard::{ScoreCovarianceRow, ScoreRow};
pub use structure::StructureRow;
pub use surfaces::SurfaceRow;
pub use terrains::TerrainRow;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::cmp::Ordering;

/// Storage type of a column. Every column may hold nulls except key columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ColumnType {
    /// UTF-8.
    Text,
    /// 64-bit float.
    F64,
    /// 64-bit signed integer.
    I64,
    /// Boolean.
    Bool,
    /// List of 32-bit floats, whose elements may be null.
    F32List,
    /// List of 64-bit floats, whose elements may be null.
    F64List,
}

/// One column: part of the contract with readers.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Column {
    /// Name, snake case, unit at the end.
    pub name: &'static str,
    /// Storage type.
    pub column_type: ColumnType,
    /// Key columns come first, sort the table and are never null.
    pub key: bool,
    /// Unit (`m`, `m/s2`, `deg`, `1` for pure numbers, empty for words).
    pub unit: &'static str,
    /// What it is.
    pub description: &'static str,
}

/// One table: part of the contract with readers.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Table {
    /// Folder name under `tables/`.
    pub name: &'static str,
    /// What a row is.
    pub description: &'static str,
    /// Columns in order.
    pub columns: &'static [Column],
    /// Key column by which a release splits the table into files; `None`: one file.
    #[serde(skip)]
    pub file_per: Option<&'static str>,
}

impl Table {
    /// Number of key columns.
    pub fn key_count(&self) -> usize {
        self.columns.iter().take_while(|c| c.key).count()
    }

    /// Position of a column.
    pub fn position(&self, column: &str) -> Option<usize> {
        self.columns.iter().position(|c| c.name == column)
    }
}

/// All tables, in the order of the report and of `schema`.
pub const ALL: [&Table; 31] = [
    &TerrainRow::TABLE,
    &SurfaceRow::TABLE,
    &FitRow::TABLE,
    &CovarianceRow::TABLE,
    &CandidateRow::TABLE,
    &CandidateCurveRow::TABLE,
    &LikelihoodProfileRow::TABLE,
    &PsdRow::TABLE,
    &ProfilePsdRow::TABLE,
    &StructureRow::TABLE,
    &HeightDistributionRow::TABLE,
    &ScoreRow::TABLE,
    &ScoreCovarianceRow::TABLE,
    &MissionRow::TABLE,
    &ReplicateRow::TABLE,
    &SampleRow::TABLE,
    &ParameterRow::TABLE,
    &RouteRow::TABLE,
    &RoutePointRow::TABLE,
    &FormationRow::TABLE,
    &FormationSampleRow::TABLE,
    &FormationEventRow::TABLE,
    &RoverRow::TABLE,
    &RoverSampleRow::TABLE,
    &ImageRow::TABLE,
    &RoverDesignRow::TABLE,
    &RoverEffectRow::TABLE,
    &PhotoclinometryRow::TABLE,
    &PhotoclinometryBandRow::TABLE,
    &LogRow::TABLE,
    &DemFitRow::TABLE,
];

/// The table of that name.
pub fn by_name(name: &str) -> Option<&'static Table> {
    ALL.into_iter().find(|t| t.name == name)
}

/// One value of a row. As JSON it is the bare value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Cell {
    /// No value.
    Null,
    /// Boolean.
    Bool(bool),
    /// Integer.
    I64(i64),
    /// Float. NaN is stored as null: a figure is known or it is not.
    F64(f64),
    /// Text.
    Text(String),
    /// List of 32-bit floats. An element that is NaN is stored as null.
    F32List(Vec<f32>),
    /// List of 64-bit floats. An element that is NaN is stored as null.
    F64List(Vec<f64>),
}

/// The order of two rows by their keys, which stand in the same columns.
pub fn compare_keys(a: &[Cell], b: &[Cell]) -> Ordering {
    let pairs = a.iter().zip(b).map(|(a, b)| match (a, b) {
        (Cell::Text(a), Cell::Text(b)) => a.cmp(b),
        (Cell::I64(a), Cell::I64(b)) => a.cmp(b),
        (Cell::Bool(a), Cell::Bool(b)) => a.cmp(b),
        (Cell::F64(a), Cell::F64(b)) => a.total_cmp(b),
        _ => Ordering::Equal,
    });
    pairs.fold(Ordering::Equal, Ordering::then)
}

/// Rows of several files of a table, each sorted, in the order of their keys.
pub fn in_order<R: Record>(rows: Vec<R>) -> Vec<R> {
    let keys = |row: &R| {
        let mut cells = row.cells();
        cells.truncate(R::TABLE.key_count());
        cells
    };
    let mut keyed: Vec<(Vec<Cell>, R)> = rows.into_iter().map(|row| (keys(&row), row)).collect();
    keyed.sort_by(|(a, _), (b, _)| compare_keys(a, b));
    keyed.into_iter().map(|(_, row)| row).collect()
}

/// A row type.
pub trait Record: Clone + Send {
    /// Its table.
    const TABLE: Table;
    /// The row's values in column order.
    fn cells(&self) -> Vec<Cell>;
    /// The row as a JSON object, by column.
    fn to_json(&self) -> Value {
        let value = |(column, cell): (&Column, Cell)| (column.name.to_owned(), json!(cell));
        Self::TABLE.columns.iter().zip(self.cells()).map(value).collect::<Map<String, Value>>().into()
    }
    /// A row from its values in column order; `None` when a value has the wrong type or a key is null.
    fn from_cells(cells: Vec<Cell>) -> Option<Self>;
}

/// How a field type is stored.
pub trait CellType: Sized {
    /// Storage type.
    const TYPE: ColumnType;
    /// Value to cell.
    fn to_cell(&self) -> Cell;
    /// Cell to value.
    fn from_cell(cell: Cell) -> Option<Self>;
}

impl CellType for String {
    const TYPE: ColumnType = ColumnType::Text;
    fn to_cell(&self) -> Cell {
        Cell::Text(self.clone())
    }
    fn from_cell(cell: Cell) -> Option<Self> {
        if let Cell::Text(v) = cell { Some(v) } else { None }
    }
}
impl CellType for f64 {
    const TYPE: ColumnType = ColumnType::F64;
    fn to_cell(&self) -> Cell {
        if self.is_nan() { Cell::Null } else { Cell::F64(*self) }
    }
    fn from_cell(cell: Cell) -> Option<Self> {
        match cell {
            Cell::F64(v) => Some(v),
            Cell::Null => Some(f64::NAN),
            _ => None,
        }
    }
}
impl CellType for i64 {
    const TYPE: ColumnType = ColumnType::I64;
    fn to_cell(&self) -> Cell {
        Cell::I64(*self)
    }
    fn from_cell(cell: Cell) -> Option<Self> {
        if let Cell::I64(v) = cell { Some(v) } else { None }
    }
}
impl CellType for bool {
    const TYPE: ColumnType = ColumnType::Bool;
    fn to_cell(&self) -> Cell {
        Cell::Bool(*self)
    }
    fn from_cell(cell: Cell) -> Option<Self> {
        if let Cell::Bool(v) = cell { Some(v) } else { None }
    }
}
impl CellType for Vec<f32> {
    const TYPE: ColumnType = ColumnType::F32List;
    fn to_cell(&self) -> Cell {
        Cell::F32List(self.clone())
    }
    fn from_cell(cell: Cell) -> Option<Self> {
        if let Cell::F32List(v) = cell { Some(v) } else { None }
    }
}
impl CellType for Vec<f64> {
    const TYPE: ColumnType = ColumnType::F64List;
    fn to_cell(&self) -> Cell {
        Cell::F64List(self.clone())
    }
    fn from_cell(cell: Cell) -> Option<Self> {
        if let Cell::F64List(v) = cell { Some(v) } else { None }
    }
}
impl<T: CellType> CellType for Option<T> {
    const TYPE: ColumnType = T::TYPE;
    fn to_cell(&self) -> Cell {
        self.as_ref().map_or(Cell::Null, T::to_cell)
    }
    fn from_cell(cell: Cell) -> Option<Self> {
        if cell == Cell::Null { Some(None) } else { T::from_cell(cell).map(Some) }
    }
}

/// The name of a column, where one is given.
macro_rules! name_of {
    () => {
        None
    };
    ($column:ident) => {
        Some(stringify!($column))
    };
}
pub(crate) use name_of;

/// Declares a row type and its table together.
macro_rules! table {
    (
        $(#[doc = $table_doc:literal])+
        $table:literal $row:ident $(file per $file_per:ident)? {
            $(keys { $($(#[doc = $key_doc:literal])+ $key:ident: $key_type:ty,)+ })?
            $($(#[doc = $doc:literal])+ $field:ident: $type:ty [$unit:literal],)+
        }
    ) => {
        $(#[doc = $table_doc])+
        #[derive(Clone, Debug, PartialEq)]
        pub struct $row {
            $($($(#[doc = $key_doc])+ pub $key: $key_type,)+)?
            $($(#[doc = $doc])+ pub $field: $type,)+
        }

        impl $crate::tables::Record for $row {
            const TABLE: $crate::tables::Table = $crate::tables::Table {
                name: $table,
                description: concat!($($table_doc),+).trim_ascii(),
                columns: &[
                    $($($crate::tables::Column {
                        name: stringify!($key),
                        column_type: <$key_type as $crate::tables::CellType>::TYPE,
                        key: true,
                        unit: "",
                        description: concat!($($key_doc),+).trim_ascii(),
                    },)+)?
                    $($crate::tables::Column {
                        name: stringify!($field),
                        column_type: <$type as $crate::tables::CellType>::TYPE,
                        key: false,
                        unit: $unit,
                        description: concat!($($doc),+).trim_ascii(),
                    },)+
                ],
                file_per: $crate::tables::name_of!($($file_per)?),
            };

            fn cells(&self) -> Vec<$crate::tables::Cell> {
                use $crate::tables::CellType;
                vec![$($(self.$key.to_cell(),)+)? $(self.$field.to_cell(),)+]
            }

            fn from_cells(cells: Vec<$crate::tables::Cell>) -> Option<Self> {
                use $crate::tables::CellType;
                let mut cells = cells.into_iter();
                Some(Self {
                    $($($key: CellType::from_cell(cells.next()?)?,)+)?
                    $($field: CellType::from_cell(cells.next()?)?,)+
                })
            }
        }
    };
}
pub(crate) use table;

#[cfg(test)]
mod tests {
    use super::*;

    /// Keys pass through the records of the work area as JSON.
    #[test]
    fn val_cells_pass_through_json() {
        let text = |word: &str| Cell::Text(word.to_owned());
        let cells = [
            Cell::Null,
            Cell::Bool(true),
            Cell::I64(i64::MAX),
            Cell::I64(-1),
            Cell::F64(1.0),
            Cell::F64(-0.25),
            text(""),
            text("12"),
            text("null"),
            Cell::F32List(vec![0.5]),
        ];
        let text = serde_json::to_string(&cells).unwrap();
        assert_eq!(text, "[null,true,9223372036854775807,-1,1.0,-0.25,\"\",\"12\",\"null\",[0.5]]");
        assert_eq!(serde_json::from_str::<Vec<Cell>>(&text).unwrap(), cells);
    }
}
