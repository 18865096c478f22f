//! Table `dem_fits`: what `sastrugi fit A B C --table` writes.

use super::{Cell, CellType, Column, FitRow, Record, Table};
use serde_json::{Value, json};

super::table! {
    /// Columns of `dem_fits` that `fits` does not have.
    "dem_fits" BesideFit {
        /// The subtracted DEM (`--minus`) was moved this far east; null without a shift.
        shift_east_m: f64 ["m"],
        /// The subtracted DEM was moved this far north; null without a shift.
        shift_north_m: f64 ["m"],
        /// The subtracted DEM was raised by this at the centre of the DEM.
        raise_m: f64 ["m"],
        /// NMAD of the difference before co-registration.
        nmad_before_m: f64 ["m"],
        /// NMAD of the difference after co-registration.
        nmad_after_m: f64 ["m"],
        /// Whether the shift gained something; null where it was not examined.
        gained: Option<bool> [""],
        /// What the fit is good for, in a sentence or two.
        verdict: Option<String> [""],
        /// Root mean square of a texture from the fit over that of the residual, both detrended and trimmed.
        carried_rms_share: f64 ["1"],
    }
}

/// One row per DEM fitted with the same settings: the file, the columns of `fits`, the co-registration where a DEM was
/// subtracted, what the fit is good for, and what went wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct DemFitRow {
    /// DEM as it was named in the call.
    pub file: String,
    /// The fit; without one its figures are unknown.
    pub fit: FitRow,
    /// Co-registration, verdict and what a texture carries; a co-registration is known without a fit too.
    pub beside: BesideFit,
    /// Why there is no fit.
    pub error: Option<String>,
}

const FITS: &[Column] = FitRow::TABLE.columns;
const BESIDE: &[Column] = BesideFit::TABLE.columns;

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

const COLUMNS: [Column; FITS.len() + BESIDE.len() + 2] = {
    let mut columns = [ERROR; FITS.len() + BESIDE.len() + 2];
    columns[0] = FILE;
    let mut k = 0;
    while k < FITS.len() {
        columns[k + 1] = FITS[k];
        k += 1;
    }
    let mut k = 0;
    while k < BESIDE.len() {
        columns[FITS.len() + k + 1] = BESIDE[k];
        k += 1;
    }
    columns
};

impl Record for DemFitRow {
    const TABLE: Table = Table {
        name: "dem_fits",
        description: "One row per DEM fitted by one call of `fit`: file, columns of `fits`, co-registration, why there is no fit.",
        columns: &COLUMNS,
        file_per: None,
    };

    fn cells(&self) -> Vec<Cell> {
        let inner = self.fit.cells().into_iter().chain(self.beside.cells());
        [self.file.to_cell()].into_iter().chain(inner).chain([self.error.to_cell()]).collect()
    }

    /// The fit is a nested object.
    fn to_json(&self) -> Value {
        let mut object = json!({ "file": self.file, "fit": self.fit.to_json() });
        if let (Value::Object(all), Value::Object(beside)) = (&mut object, self.beside.to_json()) {
            all.extend(beside);
        }
        object["error"] = json!(self.error);
        object
    }

    fn from_cells(cells: Vec<Cell>) -> Option<Self> {
        let mut cells = cells.into_iter();
        let file = CellType::from_cell(cells.next()?)?;
        let fit = FitRow::from_cells(cells.by_ref().take(FITS.len()).collect())?;
        let beside = BesideFit::from_cells(cells.by_ref().take(BESIDE.len()).collect())?;
        Some(Self { file, fit, beside, error: CellType::from_cell(cells.next()?)? })
    }
}
