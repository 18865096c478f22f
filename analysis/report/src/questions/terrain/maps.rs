//! Maps that generators wrote beside the heights: one picture of each kind.

use super::representative;
use crate::ReportError;
use crate::content::{Figure, slug};
use crate::data::{Data, Group};
use crate::questions::relief::{Words, percentiles, values};
use sastrugi_numeric::Grid;
use sastrugi_schemas::tables::TerrainRow;

/// A kind of map: its name in the name of its files, a title, and what its colours show, with the unit that generators state.
const KINDS: [[&str; 3]; 6] = [
    ["class", "Sand and rock.", "0 sand, 1 rock"],
    ["albedo", "Albedo.", "albedo"],
    ["rock-potential", "Rock potential.", "rock potential"],
    ["rms-measured", "Measured roughness.", "RMS in the band, m"],
    ["rms-predicted", "Predicted roughness.", "RMS in the band, m"],
    ["flux", "Flux of the cascade.", "flux, mean 1"],
];

/// A picture of each kind: of the first group whose representative has such a map, where that is not the same everywhere.
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
    values(&grid, &path, (range, quantity), words)
}

/// Ends of the colours: percentiles, or what there is where these are one value; `None` for a map of one value.
fn range(grid: &Grid) -> Option<(f64, f64)> {
    [percentiles(grid), grid.range()].into_iter().flatten().find(|(low, high)| high > low)
}
