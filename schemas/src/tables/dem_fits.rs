//! Table `dem_fits`: what `sastrugi fit A B C --table` writes.

use super::{Cell, CellType, Column, FitRow, Record, Table};
use serde::{Deserialize, Serialize};

/// One row per DEM fitted with the same settings: the columns of `fits` between the file and what went wrong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DemFitRow {
    /// DEM as it was named in the call.
    pub file: String,
    /// The fit; without one its figures are unknown.
    pub fit: FitRow,
    /// Why there is no fit.
    pub error: Option<String>,
}

const FITS: &[Column] = FitRow::TABLE.columns;

const FILE: Column = Column {
    name: "file",
    column_type: <String as CellType>::TYPE,
    key: true,
    unit: "",
    description: "DEM as it was named in the call.",
};

const ERROR: Column = Column {
    name: "error",
    column_type: <Option<String> as CellType>::TYPE,
    key: false,
    unit: "",
    description: "Why there is no fit; null where there is one.",
};

const COLUMNS: [Column; FITS.len() + 2] = {
    let mut columns = [ERROR; FITS.len() + 2];
    columns[0] = FILE;
    let mut k = 0;
    while k < FITS.len() {
        columns[k + 1] = FITS[k];
        k += 1;
    }
    columns
};

impl Record for DemFitRow {
    const TABLE: Table = Table {
        name: "dem_fits",
        description: "One row per DEM fitted by one call of `fit`: the columns of `fits`, the file, and why there is no fit.",
        columns: &COLUMNS,
    };

    fn cells(&self) -> Vec<Cell> {
        [self.file.to_cell()].into_iter().chain(self.fit.cells()).chain([self.error.to_cell()]).collect()
    }

    fn from_cells(cells: Vec<Cell>) -> Option<Self> {
        let mut cells = cells.into_iter();
        let file = CellType::from_cell(cells.next()?)?;
        let fit = FitRow::from_cells(cells.by_ref().take(FITS.len()).collect())?;
        Some(Self { file, fit, error: CellType::from_cell(cells.next()?)? })
    }
}
