//! Parquet tables of a release: rows as plain structs, with unit and description of each column.
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

/// One column; part of the public contract.
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
    /// Description.
    pub description: &'static str,
}

/// One table; part of the public contract.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Table {
    /// Folder name under `tables/`.
    pub name: &'static str,
    /// Description of a row.
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
///
/// ```
/// use sastrugi_schemas::tables::by_name;
///
/// let missions = by_name("missions").unwrap();
/// let time = &missions.columns[missions.position("time_s").unwrap()];
/// assert_eq!((missions.key_count(), time.unit), (2, "s"));
/// assert!(by_name("mission").is_none());
/// ```
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
    /// Float. NaN is stored as null: a value is known or unknown.
    F64(f64),
    /// Text.
    Text(String),
    /// List of 32-bit floats. An element that is NaN is stored as null.
    F32List(Vec<f32>),
    /// List of 64-bit floats. An element that is NaN is stored as null.
    F64List(Vec<f64>),
}

/// Compares two rows by their keys, which are in the same columns.
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

/// Sorts the rows of several files of a table, each of them sorted, by their keys.
///
/// ```
/// use sastrugi_schemas::tables::{ParameterRow, in_order};
///
/// let row = |traverse_id: &str, parameter: &str| ParameterRow {
///     traverse_id: traverse_id.to_owned(),
///     parameter: parameter.to_owned(),
///     value: "1".to_owned(),
///     source: None,
/// };
/// let sorted = in_order(vec![row("b", "x"), row("a", "y"), row("a", "x")]);
/// assert_eq!(sorted, [row("a", "x"), row("a", "y"), row("b", "x")]);
/// ```
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
    /// A row from its values in column order; `None` if a value has the wrong type or a key is null.
    fn from_cells(cells: Vec<Cell>) -> Option<Self>;
}

/// Storage of a field type.
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

/// The name of a column, if given.
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

    /// Keys survive a round trip through JSON, the format of records in the work area.
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

    /// Names are found once, keys stand first and are words or whole numbers, and every column is described.
    #[test]
    fn val_tables_keep_their_contract() {
        let mut names: Vec<&str> = ALL.iter().map(|table| table.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), ALL.len());
        for table in ALL {
            assert_eq!(by_name(table.name).map(|found| found.description), Some(table.description));
            assert!(table.key_count() > 0, "{}", table.name);
            assert!(table.columns[table.key_count()..].iter().all(|column| !column.key), "{}: keys first", table.name);
            assert!(table.file_per.is_none_or(|key| table.position(key) == Some(0)), "{}", table.name);
            for (k, column) in table.columns.iter().enumerate() {
                let name = format!("{}.{}", table.name, column.name);
                assert_eq!(table.position(column.name), Some(k), "{name} is there twice");
                assert!(column.description.ends_with(['.', ')']), "{name}: {}", column.description);
                let is_word = matches!(column.column_type, ColumnType::Text | ColumnType::Bool);
                assert!(!is_word || column.unit.is_empty(), "{name}: {}", column.unit);
                if column.key {
                    assert!(matches!(column.column_type, ColumnType::Text | ColumnType::I64), "{name}");
                }
            }
        }
    }

    /// The end of a name tells the unit; the longest end counts.
    #[test]
    fn val_names_end_in_their_units() {
        let ends = [
            ("_cycles_m", "1/m"),
            ("_per_m", "1/m"),
            ("_n_m", "N m"),
            ("_deg_s", "deg/s"),
            ("_m_s2", "m/s2"),
            ("_m2", "m2"),
            ("_deg", "deg"),
            ("_hz", "Hz"),
            ("_m", "m"),
        ];
        let mut checked = 0;
        for (table, column) in ALL.iter().flat_map(|table| table.columns.iter().map(move |column| (table, column))) {
            if let Some((_, unit)) = ends.iter().find(|(end, _)| !column.key && column.name.ends_with(end)) {
                assert_eq!(column.unit, *unit, "{}.{}", table.name, column.name);
                checked += 1;
            }
        }
        assert!(checked > 200, "{checked}");
    }

    fn parameter(traverse_id: &str, parameter: &str) -> ParameterRow {
        let [traverse_id, parameter] = [traverse_id, parameter].map(str::to_owned);
        ParameterRow { traverse_id, parameter, value: "1".to_owned(), source: None }
    }

    #[test]
    fn val_rows_become_cells_and_return() {
        let row = ParameterRow { source: Some("a paper".to_owned()), ..parameter("t", "p") };
        let cells = row.cells();
        assert_eq!(cells, ["t", "p", "1", "a paper"].map(|word| Cell::Text(word.to_owned())));
        assert_eq!(ParameterRow::from_cells(cells.clone()).as_ref(), Some(&row));
        assert_eq!(ParameterRow::from_cells(cells[..3].to_vec()), None);
        // Of these only the source may be null.
        for (k, null_is_read) in [(0, false), (1, false), (2, false), (3, true)] {
            let mut cells = cells.clone();
            cells[k] = Cell::Null;
            assert_eq!(ParameterRow::from_cells(cells).is_some(), null_is_read, "{k}");
        }
        let mut wrong = cells.clone();
        wrong[2] = Cell::I64(1);
        assert_eq!(ParameterRow::from_cells(wrong), None);
        // Integers and floats are not taken for each other.
        assert_eq!((f64::from_cell(Cell::I64(1)), i64::from_cell(Cell::F64(1.0))), (None, None));
        assert_eq!([1.5, f64::NAN].map(|value| value.to_cell()), [Cell::F64(1.5), Cell::Null]);
        assert_eq!([Some(2_i64), None].map(|value| value.to_cell()), [Cell::I64(2), Cell::Null]);
        assert_eq!(Option::<f64>::from_cell(Cell::Null), Some(None));
        assert!(f64::from_cell(Cell::Null).is_some_and(f64::is_nan));
    }

    /// The first key counts before the second; rows with equal keys keep their order.
    #[test]
    fn val_rows_are_sorted_by_their_keys() {
        let named = |a: &str, b: &str, value: &str| ParameterRow { value: value.to_owned(), ..parameter(a, b) };
        let rows = vec![named("b", "a", "1"), named("a", "b", "2"), named("a", "a", "3"), named("a", "b", "4")];
        let values: Vec<String> = in_order(rows).into_iter().map(|row| row.value).collect();
        assert_eq!(values, ["3", "2", "4", "1"]);
        let text = |word: &str| Cell::Text(word.to_owned());
        assert_eq!(compare_keys(&[Cell::I64(9), text("a")], &[Cell::I64(10), text("a")]), Ordering::Less);
        assert_eq!(compare_keys(&[text("10"), text("b")], &[text("9"), text("a")]), Ordering::Less);
        assert_eq!(compare_keys(&[Cell::F64(-1.0)], &[Cell::F64(-2.0)]), Ordering::Greater);
        assert_eq!(compare_keys(&[Cell::Bool(false)], &[Cell::Bool(true)]), Ordering::Less);
        assert_eq!(compare_keys(&[text("a")], &[text("a")]), Ordering::Equal);
    }
}
