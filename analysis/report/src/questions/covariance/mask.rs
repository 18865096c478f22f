//! Which cells of the DEM a fit used.

use crate::ReportError;
use crate::content::{Figure, slug};
use crate::data::Data;
use crate::questions::relief::{Code, Words, codes};
use crate::render::colour::NO_DATA;
use sastrugi_schemas::tables::FitRow;

/// Codes of `fit/<id>.mask.tif`.
const CODES: [Code; 4] = [
    (0, [0xcf, 0xe3, 0xee], "used"),
    (1, [0xd5, 0x5e, 0x00], "trimmed, or an object"),
    (2, [0x4b, 0x4f, 0xa6], "window lacks data"),
    (255, NO_DATA, "no data"),
];

/// Map of the cells; `None` without the file.
pub fn figure(data: &Data, fit: &FitRow) -> Result<Option<Figure>, ReportError> {
    let path = format!("fit/{}.mask.tif", fit.fit_id);
    let Some(mask) = data.files.classes(&path)? else { return Ok(None) };
    let words = Words {
        id: slug(&format!("mask-{}", fit.fit_id)),
        title: format!("Cells used, {}.", fit.fit_id),
        caption: "Which cells entered the covariance, and why others did not.".into(),
    };
    codes(&mask, &path, &CODES, words).map(Some)
}
