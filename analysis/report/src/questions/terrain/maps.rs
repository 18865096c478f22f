//! Maps that generators wrote with the heights: one picture of each kind.

use super::representative;
use crate::ReportError;
use crate::content::{Figure, slug};
use crate::data::{Data, Group};
use crate::questions::relief::{Code, Words, codes, percentiles, values};
use crate::render::colour::NO_DATA;
use sastrugi_numeric::Grid;
use sastrugi_schemas::tables::TerrainRow;

/// The map of codes.
const CLASS: &str = "class";
/// Its codes.
const GROUND: [Code; 3] =
    [(0, [0xe8, 0xd3, 0xa2], "sand"), (1, [0x5d, 0x52, 0x4a], "rock"), (NOTHING, NO_DATA, "no data")];
/// Code of cells without data.
const NOTHING: u8 = 255;

/// A kind of map: its name in file names, its title, and the quantity that its colours show, with the unit that generators state.
const KINDS: [[&str; 3]; 6] = [
    [CLASS, "Sand and rock.", "ground type"],
    ["albedo", "Albedo.", "albedo"],
    ["rock-potential", "Rock potential.", "rock potential"],
    ["rms-measured", "Measured roughness.", "RMS in the band, m"],
    ["rms-predicted", "Predicted roughness.", "RMS in the band, m"],
    ["flux", "Flux of the cascade.", "flux, mean 1"],
];

/// A picture of each kind, of the first group whose representative has such a map with more than one value.
pub fn figures(data: &Data, groups: &[Group<TerrainRow>]) -> Result<Vec<Figure>, ReportError> {
    let mut figures = Vec::new();
    for kind in KINDS {
        for terrain in groups.iter().filter_map(representative) {
            if let Some(figure) = figure(data, terrain, kind)? {
                figures.push(figure);
                break;
            }
        }
    }
    Ok(figures)
}

fn figure(
    data: &Data,
    terrain: &TerrainRow,
    [name, title, quantity]: [&str; 3],
) -> Result<Option<Figure>, ReportError> {
    let Some(heights) = terrain.path.strip_suffix(".tif") else { return Ok(None) };
    let path = format!("{heights}.{name}.tif");
    let Some(grid) = data.files.grid(&path)? else { return Ok(None) };
    let Some(range) = range(&grid) else { return Ok(None) };
    let words = Words {
        id: slug(&format!("map-{name}-{}", terrain.terrain_id)),
        title: title.into(),
        caption: format!("{}, map {name}: {quantity}.", terrain.terrain_id),
    };
    if name == CLASS {
        let code = |v: f64| if v.is_finite() { v as u8 } else { NOTHING };
        return codes(&grid.map(code), &path, &GROUND, words).map(Some);
    }
    values(&grid, &path, (range, quantity), words)
}

/// Ends of the colours: percentiles, or the full range if the percentiles are equal; `None` for a map with one value.
fn range(grid: &Grid) -> Option<(f64, f64)> {
    [percentiles(grid), grid.range()].into_iter().flatten().find(|(low, high)| high > low)
}
