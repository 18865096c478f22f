//! Tables: errors and their ceilings, the inversions, octaves of wavelength.

use super::surfaces::Surface;
use crate::content::{Numbers, TableBlock, count, number, text};
use crate::data::Data;
use sastrugi_schemas::tables::PhotoclinometryRow;

/// Heading, unit and value of a column.
type Column = (&'static str, &'static str, fn(&PhotoclinometryRow) -> f64);

const ERRORS: [Column; 9] = [
    ("correlation of shading", "1", |r| r.shaded_correlation),
    ("ceiling", "1", |r| r.shaded_correlation_ceiling),
    ("slope error", "1", |r| r.slope_error_rms),
    ("ceiling", "1", |r| r.slope_error_rms_ceiling),
    ("true RMS slope", "1", |r| r.slope_rms),
    ("height error", "m", |r| r.height_error_rms_m),
    ("minus the plane", "m", |r| r.height_error_rms_detrended_m),
    ("uncertainty", "m", |r| r.height_sigma_m),
    ("true RMS height", "m", |r| r.height_rms_m),
];

/// Errors of every surface, with the error that averaging alone causes.
pub fn errors(surfaces: &[Surface]) -> TableBlock {
    let columns: Vec<(&str, &str)> =
        [("recovered", ""), ("setting", ""), ("truth", "")].into_iter().chain(ERRORS.map(|c| (c.0, c.1))).collect();
    let mut numbers = Numbers::computed("select * from 'tables/photoclinometry/*.parquet'", &columns);
    for surface in surfaces {
        let row = surface.row;
        let head = [text(surface.id()), text(row.variant.as_deref().unwrap_or_default()), text(&row.surface_id)];
        numbers.row(head.into_iter().chain(ERRORS.iter().map(|c| number(c.2(row)))));
    }
    TableBlock { id: "photoclinometry-errors".into(), caption: "Errors and their ceilings".into(), numbers }
}

/// Input and convergence of the inversions.
pub fn inversions(surfaces: &[Surface]) -> TableBlock {
    let columns = [
        ("recovered", ""),
        ("images", "1"),
        ("rows", "1"),
        ("cols", "1"),
        ("cell", "m"),
        ("lit images, mean", "1"),
        ("cells with albedo from neighbours", "%"),
        ("condition number, median", "1"),
        ("correlation of albedo and slopes", "1"),
        ("rounds", "1"),
        ("converged", ""),
        ("last change", "m"),
        ("brightness misfit", "%"),
        ("stereo points", "1"),
        ("noise / assumed noise", "1"),
        ("mean albedo", "1"),
    ];
    let mut numbers = Numbers::computed("select * from 'tables/photoclinometry/*.parquet'", &columns);
    let whole = |n: i64| count(n.max(0) as usize);
    for surface in surfaces {
        let row = surface.row;
        numbers.row([
            text(surface.id()),
            whole(row.images),
            whole(row.rows),
            whole(row.cols),
            number(row.cell_m),
            number(row.lit_mean),
            number(100.0 * row.share_leaning),
            number(row.condition),
            number(row.albedo_slope_correlation),
            whole(row.rounds),
            text(if row.converged { "yes" } else { "no" }),
            number(row.change_m),
            number(100.0 * row.brightness_rms),
            whole(row.stereo_points),
            number(row.noise_scale),
            number(row.albedo_mean),
        ]);
    }
    TableBlock { id: "photoclinometry".into(), caption: "Input and convergence of the inversions".into(), numbers }
}

/// Every octave of every surface.
pub fn bands(data: &Data) -> TableBlock {
    let names = [
        "photoclinometry_id",
        "octave",
        "wavelength_min_m",
        "wavelength_max_m",
        "modes",
        "truth_rms_m",
        "recovered_rms_m",
        "truth_slope_rms",
        "recovered_slope_rms",
        "covariance_m2",
        "coherence",
    ];
    let numbers = Numbers::select("", &data.photoclinometry_bands, &names);
    TableBlock {
        id: "photoclinometry-bands".into(),
        caption: "True and recovered surfaces by wavelength".into(),
        numbers,
    }
}
