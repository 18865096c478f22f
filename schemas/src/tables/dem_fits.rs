//! Table `dem_fits`, written by `sastrugi fit A B C --table`.

use super::{Cell, CellType, Column, FitRow, Record, Table};
use serde_json::{Value, json};

super::table! {
    /// Columns of `dem_fits` that are not in `fits`.
    "dem_fits" BesideFit {
        /// Shift of the subtracted DEM (`--minus`) to the east; null without a shift.
        shift_east_m: f64 ["m"],
        /// Shift of the subtracted DEM to the north; null without a shift.
        shift_north_m: f64 ["m"],
        /// Raise of the subtracted DEM at the centre of the DEM.
        raise_m: f64 ["m"],
        /// NMAD of the difference before co-registration.
        nmad_before_m: f64 ["m"],
        /// NMAD of the difference after co-registration.
        nmad_after_m: f64 ["m"],
        /// Whether the shift improved the fit; null if not tested.
        gained: Option<bool> [""],
        /// The verdict on the fit, in one or two sentences.
        verdict: Option<String> [""],
        /// RMS of a texture from the fit over that of the residual, both detrended and trimmed.
        carried_rms_share: f64 ["1"],
    }
}

/// One row per DEM fitted with the same settings: the file, the columns of `fits`, the co-registration if a DEM was subtracted, the
/// verdict, and the error if the fit failed.
#[derive(Clone, Debug, PartialEq)]
pub struct DemFitRow {
    /// DEM, as named in the call.
    pub file: String,
    /// The fit; its values are unknown if it failed.
    pub fit: FitRow,
    /// Co-registration, verdict and RMS share of a texture; the co-registration is known even if the fit failed.
    pub beside: BesideFit,
    /// Error, if the fit failed.
    pub error: Option<String>,
}

const FITS: &[Column] = FitRow::TABLE.columns;
const BESIDE: &[Column] = BesideFit::TABLE.columns;

const FILE: Column = Column {
    name: "file",
    column_type: <String as CellType>::TYPE,
    key: true,
    unit: "",
    description: "DEM, as named in the call.",
};

const ERROR: Column = Column {
    name: "error",
    column_type: <Option<String> as CellType>::TYPE,
    key: false,
    unit: "",
    description: "Error, if the DEM could not be fitted; otherwise null.",
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
        description: "One row per DEM in a call of `fit`: file, columns of `fits`, co-registration, and error if the fit failed.",
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
