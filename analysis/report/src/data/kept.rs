//! Rows of the tables that grow with the missions, with only the columns that the page needs.
//!
//! A name that many rows have (a terrain, a run, a vehicle) is stored once. A [`Mission`] takes 272 bytes, and about 150 more for the
//! names that are its own (`pair_id` and `path`); a [`Start`] takes 56.

use sastrugi_schemas::study::Statistic;
use sastrugi_schemas::tables::{CellType, MissionRow, ReplicateRow};
use sastrugi_schemas::{Cell, ColumnType, Record, Table};
use std::borrow::Borrow;
use std::collections::HashSet;
use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

/// Text that rows can share.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Name(Arc<str>);

impl Name {
    /// The text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Deref for Name {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl Borrow<str> for Name {
    fn borrow(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl From<&str> for Name {
    fn from(text: &str) -> Self {
        Self(text.into())
    }
}

impl From<String> for Name {
    fn from(text: String) -> Self {
        Self(text.into())
    }
}

impl From<&Name> for String {
    fn from(name: &Name) -> Self {
        name.as_str().to_owned()
    }
}

impl PartialEq<&str> for Name {
    fn eq(&self, other: &&str) -> bool {
        self.as_str() == *other
    }
}

impl CellType for Name {
    const TYPE: ColumnType = ColumnType::Text;

    fn to_cell(&self) -> Cell {
        Cell::Text(self.into())
    }

    fn from_cell(cell: Cell) -> Option<Self> {
        String::from_cell(cell).map(Self::from)
    }
}

/// The names that rows share, while they are read.
#[derive(Default)]
pub struct Names(HashSet<Name>);

/// The column whose names are unique: a search for equal names would take memory for each row.
const OWN: &str = "path";

/// A value in which names can be replaced by equal ones that are stored already.
trait Share {
    fn share(&mut self, names: &mut Names);
}

impl Share for Name {
    fn share(&mut self, names: &mut Names) {
        match names.0.get(self.as_str()) {
            Some(known) => *self = known.clone(),
            None => {
                names.0.insert(self.clone());
            }
        }
    }
}

impl Share for Option<Name> {
    fn share(&mut self, names: &mut Names) {
        if let Some(name) = self {
            name.share(names);
        }
    }
}

impl Share for f64 {
    fn share(&mut self, _: &mut Names) {}
}

impl Share for i64 {
    fn share(&mut self, _: &mut Names) {}
}

impl Mission {
    /// The value of a statistic: 100 or 0 (%) for success; for others, NaN unless it reached its goal.
    pub fn of(&self, statistic: Statistic) -> f64 {
        let value = match statistic {
            Statistic::Success => f64::NAN,
            Statistic::Efficiency => self.efficiency,
            Statistic::TimeS => self.time_s,
            Statistic::RmsVerticalAccelerationMS2 => self.rms_vertical_acceleration_m_s2,
            Statistic::RmsPitchRateDegS => self.rms_pitch_rate_deg_s,
            Statistic::RmsRollRateDegS => self.rms_roll_rate_deg_s,
            Statistic::MaxPitchDeg => self.max_pitch_deg,
            Statistic::MaxRollDeg => self.max_roll_deg,
        };
        statistic.given(&self.outcome, value)
    }
}

/// Declares a row with some of the columns of a table. As cells, the others are null.
macro_rules! kept {
    ($(#[doc = $row_doc:literal])+ $row:ident of $whole:ident { $($field:ident: $type:ty,)+ }) => {
        $(#[doc = $row_doc])+
        #[derive(Clone, Debug, PartialEq)]
        pub struct $row {
            $(#[doc = concat!("Column `", stringify!($field), "`.")] pub $field: $type,)+
        }

        impl $row {
            /// From a complete row.
            ///
            /// # Panics
            /// When the table lacks one of the columns (a bug).
            pub fn from_row(row: &$whole) -> Self {
                Self::from_cells(row.cells()).unwrap_or_else(|| panic!("table {} lacks a column", Self::TABLE.name))
            }

            /// Shares its names with the rows before.
            pub fn share(&mut self, names: &mut Names) {
                $(if stringify!($field) != OWN {
                    self.$field.share(names);
                })+
            }
        }

        impl Record for $row {
            const TABLE: Table = $whole::TABLE;

            fn cells(&self) -> Vec<Cell> {
                let mut cells = vec![Cell::Null; Self::TABLE.columns.len()];
                $(if let Some(at) = Self::TABLE.position(stringify!($field)) {
                    cells[at] = self.$field.to_cell();
                })+
                cells
            }

            fn from_cells(mut cells: Vec<Cell>) -> Option<Self> {
                let mut take = |column: &str| Some(std::mem::replace(cells.get_mut(Self::TABLE.position(column)?)?, Cell::Null));
                Some(Self { $($field: CellType::from_cell(take(stringify!($field))?)?,)+ })
            }
        }
    };
}

kept! {
    /// A mission.
    Mission of MissionRow {
        terrain_id: Name,
        mission_id: Name,
        group: Option<Name>,
        variant: Option<Name>,
        pair_id: Name,
        traverse_id: Name,
        vehicle: Name,
        start_x_m: f64,
        start_y_m: f64,
        goal_x_m: f64,
        goal_y_m: f64,
        outcome: Name,
        time_s: f64,
        path_length_m: f64,
        progress_m: f64,
        efficiency: f64,
        rms_vertical_acceleration_m_s2: f64,
        rms_pitch_rate_deg_s: f64,
        rms_roll_rate_deg_s: f64,
        rms_body_pitch_rate_deg_s: f64,
        rms_body_roll_rate_deg_s: f64,
        max_pitch_deg: f64,
        max_roll_deg: f64,
        sample_rate_hz: f64,
        path: Name,
    }
}

kept! {
    /// A start of a mission with several starts.
    Start of ReplicateRow {
        terrain_id: Name,
        mission_id: Name,
        replicate: i64,
        outcome: Name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sizes that documentation states.
    #[test]
    fn val_rows_are_small() {
        assert_eq!((size_of::<Mission>(), size_of::<Start>()), (272, 56));
    }

    /// Every column that is kept has its value, also as cells; the others are null.
    #[test]
    fn prop_kept_columns_are_those_of_the_row() {
        for mission in crate::tests::made_up::full(1, 24).missions {
            let cells = mission.cells();
            assert_eq!(cells.len(), MissionRow::TABLE.columns.len());
            let of = |column: &str| cells[MissionRow::TABLE.position(column).unwrap()].clone();
            assert_eq!(of("terrain_id"), Cell::Text(mission.terrain_id.to_string()));
            assert_eq!((of("time_s"), of("draws")), (Cell::F64(mission.time_s), Cell::Null));
            let again = Mission::from_cells(cells.clone()).unwrap();
            assert_eq!((again.path.as_str(), again.cells()), (mission.path.as_str(), cells));
        }
    }

    /// A statistic is the value of its column.
    #[test]
    fn val_statistics_are_those_of_their_columns() {
        // Every number of the row is the position of its column.
        let cell = |(k, column): (usize, &sastrugi_schemas::Column)| match (column.name, column.column_type) {
            ("outcome", _) => Cell::Text("success".to_owned()),
            (_, ColumnType::Text) => Cell::Text(String::new()),
            _ => Cell::F64(k as f64),
        };
        let arrived = Mission::from_cells(MissionRow::TABLE.columns.iter().enumerate().map(cell).collect()).unwrap();
        for statistic in Statistic::ALL.into_iter().filter(|statistic| *statistic != Statistic::Success) {
            let column = MissionRow::TABLE.position(statistic.column()).unwrap();
            assert_eq!(arrived.of(statistic), column as f64, "{statistic:?}");
        }
        assert_eq!(arrived.of(Statistic::Success), 100.0);
    }

    /// Equal names are stored once.
    #[test]
    fn val_names_are_shared() {
        let mut names = Names::default();
        let mut missions = crate::tests::made_up::full(1, 24).missions;
        missions.iter_mut().for_each(|mission| mission.share(&mut names));
        let [first, second] = [&missions[0], &missions[1]];
        assert!(
            Arc::ptr_eq(&first.terrain_id.0, &second.terrain_id.0) && Arc::ptr_eq(&first.vehicle.0, &second.vehicle.0)
        );
        assert!(first.mission_id != second.mission_id && first.terrain_id == "d2.30-0000");
        assert!(!names.0.contains(first.path.as_str()) && names.0.contains(first.pair_id.as_str()));
    }
}
