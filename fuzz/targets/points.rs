//! Point clouds, LAS and LAZ; the last byte selects how they are gridded.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_store::dem::points::{GridSettings, Statistic};
use sastrugi_store::dem::{self, ReadOptions};

const CELL_M: f64 = 0.5;
/// Most cells of a given size: as many as a header claims are made, so that memory is planned for them first.
const CELLS_MAX: u64 = 1 << 22;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = file("a.las", bytes);
    let plain = GridSettings::default();
    let settings = match bytes.last().map_or(0, |last| last % 5) {
        0 => plain,
        1 => GridSettings { statistic: Statistic::Median, fill_cells: 3, ..plain },
        2 => GridSettings { statistic: Statistic::Percentile(90.0), ground_only: true, ..plain },
        3 => GridSettings { statistic: Statistic::Max, planned_cells: Some(1000), ..plain },
        _ => GridSettings { cell_m: Some(CELL_M), statistic: Statistic::Min, fill_cells: 1, ..plain },
    };
    let options = ReadOptions { cell_m: settings.cell_m.map(|cell_m| [cell_m; 2]) };
    let claimed = dem::claimed(&path, &options);
    if settings.cell_m.is_none() || claimed.is_some_and(|claimed| claimed.cells <= CELLS_MAX) {
        let _ = dem::read_gridded(&path, &options, &settings);
    }
});
