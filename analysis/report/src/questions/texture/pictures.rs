//! Pictures of a texture: beside the residual of its fit, tiled, on its base, or in the holes of a DEM.

use super::{amplitude, background};
use crate::ReportError;
use crate::content::{Figure, Numbers, slug};
use crate::data::Data;
use crate::questions::relief::{
    Style, Words, deviations, exaggeration_words, limit_m, middle_range, relief, relief_of,
};
use crate::render::{number as set, thin};
use sastrugi_imaging::hillshade::exaggeration;
use sastrugi_numeric::{Grid, sums};
use sastrugi_schemas::tables::TerrainRow;

/// Tiles along each side of the picture of a repeated texture.
const TILES: usize = 3;

/// Words of a picture of a texture.
fn words(texture: &TerrainRow, what: &str, title: &str, caption: String) -> Words {
    Words { id: slug(&format!("{what}-{}", texture.terrain_id)), title: title.into(), caption }
}

/// A base without and with its texture.
pub fn on_base(data: &Data, texture: &TerrainRow, base: &str, fit: &str) -> Result<Vec<Figure>, ReportError> {
    let covariance = if fit.is_empty() { "of its stated covariance".into() } else { format!("of fit {fit}") };
    let caption = format!("{}: {base} with a texture {covariance}; same colours and light.", texture.terrain_id);
    let below = words(texture, "base", "Base.", format!("{base} without the texture."));
    reliefs(data, texture, base, [below, words(texture, "textured", "Base with texture.", caption)])
}

/// A DEM before and after its holes were filled.
pub fn in_holes(data: &Data, texture: &TerrainRow, dem: &str) -> Result<Vec<Figure>, ReportError> {
    let caption = format!(
        "{}: the holes of {dem} filled with texture; measured cells keep their heights. Same colours and light.",
        texture.terrain_id
    );
    let before = words(texture, "holes", "With holes.", format!("{dem} as measured; grey cells have no data."));
    reliefs(data, texture, dem, [before, words(texture, "filled", "Filled.", caption)])
}

/// Shaded reliefs of a surface and of the texture on it, in one range of heights.
fn reliefs(data: &Data, texture: &TerrainRow, below: &str, words: [Words; 2]) -> Result<Vec<Figure>, ReportError> {
    let below = data.terrain(below).map_or("", |t| t.path.as_str());
    let paths = [below, texture.path.as_str()];
    let Some(range_m) = middle_range(data, &paths)? else { return Ok(Vec::new()) };
    let style = Some(Style { range_m, exaggeration: exaggeration(texture.rms_slope), pixels: 400 });
    let mut figures = Vec::new();
    for (path, words) in paths.into_iter().zip(words) {
        figures.extend(relief(data, path, style, words)?);
    }
    Ok(figures)
}

/// Measured residual and synthetic texture: the centre of each about its mean, with the same size in metres and the same colour range.
pub fn patches(data: &Data, texture: &TerrainRow, fit: &str) -> Result<Vec<Figure>, ReportError> {
    let Some((synthetic, removed)) = without_background(data, texture)? else { return Ok(Vec::new()) };
    let residual_path = format!("fit/{fit}.residual.tif");
    let measured = data.files.grid(&residual_path)?;
    let size = common_size(&synthetic, measured.as_ref());
    let patch = |grid: Grid| about_mean(&thin::centre(&grid, size));
    let (synthetic, measured) = (patch(synthetic), measured.map(patch));
    let limit = measured.iter().chain([&synthetic]).map(limit_m).filter(|v| *v > 0.0).fold(0.0, f64::max);
    let ground = format!("{} × {} m at the centre", set::significant(size[0], 3), set::significant(size[1], 3));
    let scaled =
        amplitude(texture).map_or_else(String::new, |factor| format!(", heights times {}", set::plain(factor, 4)));
    let alike = if measured.is_some() {
        "; same scale and colours. It is not detrended, so it may have longer waves than the residual"
    } else {
        ""
    };
    let mut figures = Vec::new();
    if let Some(measured) = measured {
        let caption = format!("Residual of fit {fit} about its mean, {ground}; grey cells did not enter the fit.");
        let around = words(texture, "measured", "Measured.", caption);
        figures.extend(deviations(&measured, &residual_path, limit, "not used", around)?);
    }
    let caption = format!("{}{removed} about its mean, {ground}{scaled}{alike}.", texture.terrain_id);
    let around = words(texture, "synthetic", "Synthetic.", caption);
    figures.extend(deviations(&synthetic, &texture.path, limit, "no data", around)?);
    figures.iter_mut().for_each(|figure| name_about_mean(&mut figure.numbers));
    Ok(figures)
}

/// True for one of these two.
pub fn is_patch(figure: &Figure) -> bool {
    ["measured-", "synthetic-"].iter().any(|what| figure.id.starts_with(what))
}

/// Names the ends of heights about their mean as such: the file has other heights.
fn name_about_mean(numbers: &mut Numbers) {
    for heading in &mut numbers.columns {
        if matches!(heading.name.as_str(), "low_m" | "high_m") {
            heading.name = heading.name.replace("_m", "_about_mean_m");
        }
    }
}

/// The heights of a texture, without the background that it may lie on, and words for what was removed.
fn without_background(data: &Data, texture: &TerrainRow) -> Result<Option<(Grid, String)>, ReportError> {
    let Some(grid) = data.files.grid(&texture.path)? else { return Ok(None) };
    let Some(fit) = background(texture) else { return Ok(Some((grid, String::new()))) };
    let below = data.files.grid(&format!("fit/{fit}.background.tif"))?;
    Ok(Some(match below.filter(|b| (b.rows(), b.cols()) == (grid.rows(), grid.cols())) {
        None => (grid, String::new()),
        Some(below) => {
            let heights = grid.values.iter().zip(&below.values).map(|(z, b)| z - b).collect();
            (Grid::new(grid.geometry, heights), format!(" without the background of {fit},"))
        }
    }))
}

fn mean_m(grid: &Grid) -> f64 {
    sums::mean(&sums::finite(&grid.values))
}

fn about_mean(grid: &Grid) -> Grid {
    let mean = mean_m(grid);
    grid.map(|z| z - mean)
}

/// The largest square that fits into both grids, m.
fn common_size(a: &Grid, b: Option<&Grid>) -> [f64; 2] {
    let sides = [Some(a), b].into_iter().flatten().flat_map(|g| g.geometry.size());
    [sides.fold(f64::INFINITY, f64::min); 2]
}

/// The texture tiled three by three, if it is periodic.
pub fn tiling(data: &Data, texture: &TerrainRow) -> Result<Option<Figure>, ReportError> {
    let Some(grid) = data.files.grid(&texture.path)?.filter(|_| repeats(texture)) else { return Ok(None) };
    let tiled = thin::tiled(&grid, TILES, 450);
    let (mean, limit) = (mean_m(&grid), limit_m(&grid));
    let range_m = (mean - limit, mean + limit);
    let style = Style { range_m, exaggeration: exaggeration(texture.rms_slope), pixels: 450 };
    let shading = exaggeration_words(style.exaggeration);
    let caption = format!(
        "{} repeated in both directions, as shaded relief; a seam would show as a line at a third of the side.{shading}",
        texture.terrain_id
    );
    let style = Some(style).filter(|s| s.range_m.0 < s.range_m.1);
    relief_of(&tiled, &texture.path, style, words(texture, "tiles", "Tiled three by three.", caption))
}

/// Whether a texture repeats without seams. `cholesky` never does and has no such parameter; other methods without it do.
fn repeats(texture: &TerrainRow) -> bool {
    let params: serde_json::Value = serde_json::from_str(&texture.params).unwrap_or_default();
    let stated = params.get("periodic").and_then(serde_json::Value::as_bool);
    texture.kind != "cholesky" && background(texture).is_none() && stated.unwrap_or(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::made_up;
    use sastrugi_numeric::Geometry;

    /// Lowest and highest value of a figure of deviations, m.
    fn ends(figures: &[Figure], what: &str) -> [f64; 2] {
        let figure = figures.iter().find(|f| f.id.starts_with(what)).unwrap();
        let row = &figure.numbers.rows[0];
        let at = |name: &str| {
            let column = figure.numbers.columns.iter().position(|c| c.name == name).unwrap();
            if let sastrugi_schemas::Cell::F64(value) = row[column] { value } else { f64::NAN }
        };
        [at("low_about_mean_m"), at("high_about_mean_m")]
    }

    /// A release whose texture is raised by `raise_m`, with these parameters; `background_m` is the level of the fit's background, on its cells.
    fn raised(raise_m: f64, background_m: f64, params: &str) -> (Data, TerrainRow) {
        let (mut data, mut shelf) = made_up::parts(1, 24);
        let grid = shelf.grids["texture/texture.tif"].map(|z| z + raise_m);
        shelf.grids.insert("fit/jacksboro-corrected.background.tif".into(), grid.map(|_| background_m));
        shelf.grids.insert("texture/texture.tif".into(), grid);
        data.files = Box::new(shelf);
        let mut texture = data.terrains.iter().find(|t| t.terrain_id == "texture").unwrap().clone();
        texture.params = params.into();
        (data, texture)
    }

    const ALONE: &str = r#"{"fit":"jacksboro-corrected","method":"fft_ma"}"#;

    /// A texture at -1000 m has the picture of one at 0 m, in the same colours.
    #[test]
    fn val_pictures_show_deviations_from_the_mean() {
        let pictures = |raise_m: f64| {
            let (data, texture) = raised(raise_m, 0.0, ALONE);
            let figures = patches(&data, &texture, "jacksboro-corrected").unwrap();
            (ends(&figures, "synthetic-"), figures)
        };
        let ([low, high], figures) = pictures(-1000.0);
        let ([level_low, level_high], _) = pictures(0.0);
        assert!(low < 0.0 && high > 0.0, "{low} {high}");
        assert!((low - level_low).abs() < 1e-6 && (high - level_high).abs() < 1e-6);
        assert!(figures[1].caption.starts_with("texture about its mean, "), "{}", figures[1].caption);
    }

    /// The colours of the tiled picture, whose ends its key states, are about the mean.
    #[test]
    fn val_tiles_are_coloured_about_their_mean() {
        let (data, texture) = raised(-1000.0, 0.0, ALONE);
        let svg = tiling(&data, &texture).unwrap().unwrap().svg.finish("tiles", "t", "d");
        let texts = svg.split('>').filter_map(|text| text.split('<').next());
        let ends: Vec<f64> = texts.filter_map(|text| text.replace('−', "-").parse().ok()).collect();
        assert!(ends.len() == 2 && ends.iter().all(|end| (end + 1000.0).abs() < 200.0), "{ends:?}");
    }

    /// On a background, the picture shows the texture alone, and is not tiled.
    #[test]
    fn val_a_background_is_not_part_of_the_picture() {
        let params = r#"{"fit":"jacksboro-corrected","onto":{"background":"jacksboro-corrected"},"method":"fft_ma"}"#;
        let (data, texture) = raised(-11.0, -11.0, params);
        let figures = patches(&data, &texture, "jacksboro-corrected").unwrap();
        let caption = &figures[1].caption;
        assert!(
            caption.starts_with("texture without the background of jacksboro-corrected, about its mean, "),
            "{caption}"
        );
        let (alone, plain) = raised(0.0, 0.0, ALONE);
        let expected = ends(&patches(&alone, &plain, "jacksboro-corrected").unwrap(), "synthetic-");
        let found = ends(&figures, "synthetic-");
        assert!([0, 1].iter().all(|k| (found[*k] - expected[*k]).abs() < 1e-9), "{found:?} {expected:?}");
        assert!(tiling(&data, &texture).unwrap().is_none() && tiling(&alone, &plain).unwrap().is_some());
        assert!(tiling(&alone, &TerrainRow { kind: "cholesky".into(), ..plain }).unwrap().is_none());
    }

    /// Without a measured surface, the caption names none.
    #[test]
    fn val_captions_name_only_what_is_drawn() {
        let (data, texture) = raised(0.0, 0.0, r#"{"fit":{"model":"exponential"},"method":"fft_ma"}"#);
        let figures = patches(&data, &texture, "").unwrap();
        let caption = &figures[0].caption;
        assert!(figures.len() == 1 && caption.ends_with(" m at the centre."), "{caption}");
        let (data, texture) = raised(0.0, 0.0, ALONE);
        let caption = &patches(&data, &texture, "jacksboro-corrected").unwrap()[1].caption;
        assert!(caption.contains("same scale and colours"), "{caption}");
    }

    /// A filled DEM is drawn with its holes and without.
    #[test]
    fn val_a_filled_dem_is_drawn_before_and_after() {
        let (mut data, mut shelf) = made_up::parts(1, 24);
        let holed = Grid::new(
            Geometry::square(4, 4, 1.0),
            (0..16).map(|k| if k == 5 { f64::NAN } else { f64::from(k) }).collect(),
        );
        shelf.grids.insert("texture/texture.tif".into(), holed.map(|z| if z.is_nan() { 5.0 } else { z }));
        shelf.grids.insert("dem/jacksboro.metric.tif".into(), holed);
        data.files = Box::new(shelf);
        let texture = data.terrains.iter().find(|t| t.terrain_id == "texture").unwrap();
        let figures = in_holes(&data, texture, "jacksboro").unwrap();
        let ids: Vec<&str> = figures.iter().map(|f| f.id.as_str()).collect();
        assert_eq!(ids, ["holes-texture", "filled-texture"]);
        let svg = |k: usize| figures[k].svg.finish("x", "t", "d");
        assert!(svg(0).contains("no data") && !svg(1).contains("no data"));
    }
}
