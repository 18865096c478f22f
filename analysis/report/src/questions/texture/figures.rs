//! Surface parameters of the measured residual and of the texture, side by side.

use crate::content::{Numbers, TableBlock, number, slug, text};
use crate::data::{Data, RESIDUAL};
use crate::questions::sql::quoted;
use crate::render::number as set;
use sastrugi_schemas::Cell;
use sastrugi_schemas::tables::{SurfaceRow, TerrainRow};

/// A surface parameter: name, unit, value.
type Row = (&'static str, &'static str, fn(&SurfaceRow) -> f64);

const ROWS: [Row; 15] = [
    ("RMS height Sq", "m", |s| s.sq_m),
    ("mean height Sa", "m", |s| s.sa_m),
    ("skewness Ssk", "1", |s| s.ssk),
    ("kurtosis Sku", "1", |s| s.sku),
    ("peak Sp", "m", |s| s.sp_m),
    ("pit Sv", "m", |s| s.sv_m),
    ("relief Sz", "m", |s| s.sz_m),
    ("RMS slope Sdq", "1", |s| s.sdq),
    ("RMS slope, E-W", "1", |s| s.rms_slope_x),
    ("RMS slope, N-S", "1", |s| s.rms_slope_y),
    ("length Sal", "m", |s| s.sal_m),
    ("aspect ratio Str", "1", |s| s.aspect_ratio),
    ("direction Std", "deg", |s| s.direction_deg),
    ("Hurst exponent", "1", |s| s.hurst_exponent),
    ("standard error", "1", |s| s.hurst_standard_error),
];

/// Id under which a texture's stage stores its residual, after the detrending and trimming of the fit.
pub fn residual_id(texture: &TerrainRow) -> String {
    format!("{}{RESIDUAL}", texture.terrain_id)
}

/// Columns: measured residual, residual of the texture, texture as synthesised; without rows if the release describes none of them.
pub fn table(data: &Data, texture: &TerrainRow, fit: &str) -> TableBlock {
    let residual = residual_id(texture);
    let made = super::synthesised(texture);
    let sides = [
        ("measured", "residual of the fit".to_owned(), data.surface(fit)),
        ("texture residual", "texture after the same detrending and trimming".to_owned(), data.surface(&residual)),
        (made.as_str(), format!("texture {made}"), data.surface(&texture.terrain_id)),
    ];
    let present: Vec<(&str, String, &SurfaceRow)> =
        sides.into_iter().filter_map(|(name, words, s)| Some((name, words, s?))).collect();
    let columns: Vec<(&str, &str)> =
        [("parameter", "")].into_iter().chain(present.iter().map(|(name, ..)| (*name, ""))).collect();
    let query = format!(
        "select * from 'tables/surfaces/*.parquet' where surface_id in ({})",
        [fit, &residual, &texture.terrain_id].map(quoted).join(", ")
    );
    let mut numbers = Numbers::computed(query, &columns);
    for (name, unit, figure) in ROWS.iter().filter(|_| !present.is_empty()) {
        let unit = set::unit(unit);
        let label = if unit.is_empty() { (*name).to_owned() } else { format!("{name}, {unit}") };
        let values = present.iter().map(|(.., s)| rounded(figure(s), name));
        numbers.row([text(label)].into_iter().chain(values));
    }
    if !present.is_empty() {
        numbers.row([text("lags of the exponent, m")].into_iter().chain(present.iter().map(|(.., s)| lags(s))));
    }
    let words: Vec<&str> = present.iter().map(|(_, words, _)| words.as_str()).collect();
    let note = if data.surface(&residual).is_some() { super::residual_note(texture) } else { "" };
    let caption = format!("Surface parameters: {}.{note}", words.join("; "));
    let caption = caption.trim_end_matches('.').to_owned();
    TableBlock { id: slug(&format!("figures-of-{}", texture.terrain_id)), caption, numbers }
}

/// Range of lags of the Hurst exponent.
fn lags(surface: &SurfaceRow) -> Cell {
    let ends = [surface.hurst_lag_min_m, surface.hurst_lag_max_m];
    match ends.iter().all(|v| v.is_finite()) {
        true => text(ends.map(|v| set::significant(v, 3)).join(" to ")),
        false => Cell::Null,
    }
}

/// Values of one column differ in magnitude, so each is given as text with its own digits.
fn rounded(value: f64, name: &str) -> Cell {
    match (value.is_finite(), name) {
        (false, _) => number(value),
        (true, "direction Std") => text(set::fixed(value, 0)),
        (true, "standard error") => text(set::significant(value, 2)),
        (true, "skewness Ssk") => text(set::fixed(value, 3)),
        (true, _) => text(set::significant(value, 3)),
    }
}
