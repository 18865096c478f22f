//! Planets under the sun: the representative of each group of planetary terrains, rendered from above with its albedo and cast shadows.
//!
//! Drawing, as the shading of reliefs is: heights and albedo are thinned to the pixels of the picture before.

use super::representative;
use crate::ReportError;
use crate::content::{Figure, Numbers, count, number, slug, text};
use crate::data::{Data, Group};
use crate::questions::relief::{MAP_WIDTH, extent};
use crate::render::map::{Key, Map};
use crate::render::{number as set, picture, thin};
use sastrugi_imaging::{RenderParameters, Scene, Sun, display, render};
use sastrugi_numeric::Streams;
use sastrugi_schemas::tables::TerrainRow;

/// Kind of terrain with an albedo of its own.
const PLANETARY: &str = "planetary";
/// Low in the north-west, so that rocks and rims throw shadows.
const SUN: Sun = Sun { azimuth_deg: 315.0, elevation_deg: 25.0 };
/// Largest number of rows or columns of a picture.
const PIXELS: usize = 480;

/// One picture for each group.
pub fn figures(data: &Data, groups: &[Group<TerrainRow>]) -> Result<Vec<Figure>, ReportError> {
    let mut figures = Vec::new();
    for terrain in groups.iter().filter_map(representative).filter(|t| t.kind == PLANETARY) {
        figures.extend(figure(data, terrain)?);
    }
    Ok(figures)
}

fn figure(data: &Data, terrain: &TerrainRow) -> Result<Option<Figure>, ReportError> {
    let Some(heights) = data.files.grid(&terrain.path)? else { return Ok(None) };
    let map = terrain.path.strip_suffix(".tif").map(|path| format!("{path}.albedo.tif"));
    let albedo = map.map_or(Ok(None), |path| data.files.grid(&path))?;
    let step = thin::step(heights.rows(), heights.cols(), PIXELS);
    let thinned = thin::block_mean(&heights, step);
    let albedo = albedo.map(|grid| thin::block_mean(&grid, step));
    let parameters = RenderParameters { sun: SUN, samples: 1, ..RenderParameters::default() };
    let scene = Scene { heights: &thinned, albedo: albedo.as_ref() };
    // Without noise nothing is drawn at random.
    let Ok(rendering) = render(&scene, &parameters, &Streams::for_seed(0, PLANETARY)) else { return Ok(None) };
    let image = rendering.image();
    let picture = picture::brightness(&image, display::white(&image), PIXELS)?;
    let albedo_words = if albedo.is_some() { "its albedo" } else { "one albedo" };
    let columns = [("file", ""), ("rows", "1"), ("cols", "1"), ("mean brightness", "1"), ("in shadow", "%")];
    let mut numbers = Numbers::of_file(terrain.path.as_str(), &columns);
    numbers.row([
        text(&terrain.path),
        count(thinned.rows()),
        count(thinned.cols()),
        number(rendering.mean_brightness()),
        number(100.0 * rendering.share_in_shadow()),
    ]);
    Ok(Some(Figure {
        id: slug(&format!("rendered-{}", terrain.terrain_id)),
        title: "Under the sun.".into(),
        caption: format!(
            "{} from above with {albedo_words} and cast shadows{}; sun from {} degrees (north-west), {} degrees above the horizon.",
            terrain.terrain_id,
            if step > 1 { format!(", drawn from means over {step} × {step} cells") } else { String::new() },
            set::plain(SUN.azimuth_deg, 3),
            set::plain(SUN.elevation_deg, 3)
        ),
        description: format!("Rendered image of {}, {}.", terrain.path, extent(&heights)),
        svg: Map::new(&picture, MAP_WIDTH, &Key::Entries(&[])).svg,
        numbers,
    }))
}
