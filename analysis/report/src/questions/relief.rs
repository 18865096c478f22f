//! Maps of one raster: shaded relief, deviations, values, codes.

use crate::ReportError;
use crate::content::{Figure, Numbers, count, number, text};
use crate::data::Data;
use crate::render::chart::Mark;
use crate::render::colour::Rgb;
use crate::render::map::{Key, Map};
use crate::render::svg::Paint;
use crate::render::{colour, number as set, picture, thin};
use sastrugi_numeric::{Grid, sums};
use sastrugi_schemas::Cell;

/// Width of a map that stands next to others, px.
pub const MAP_WIDTH: f64 = 320.0;

/// How a relief is drawn; the same for all maps that are compared.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// Heights at either end of the colours, m.
    pub range_m: (f64, f64),
    /// Factor on the slopes before shading.
    pub exaggeration: f64,
    /// Largest number of rows or columns of the picture.
    pub pixels: usize,
}

/// The text around a map.
#[derive(Clone, Debug)]
pub struct Words {
    /// Name of its files.
    pub id: String,
    /// Title.
    pub title: String,
    /// Caption.
    pub caption: String,
}

/// The exaggeration in a caption; empty for none.
pub fn exaggeration_words(exaggeration: f64) -> String {
    if exaggeration > 1.0 {
        format!(" Slopes are exaggerated {}-fold.", set::fixed(exaggeration, 0))
    } else {
        String::new()
    }
}

/// Smallest share of the relief between the 1st and 99th percentile for which the colours end at these percentiles.
const MIDDLE_SHARE: f64 = 0.25;
/// How far below level ground the colours begin, as a share of the relief: the darkest would hide its shading.
const BELOW_GROUND: f64 = 0.5;

/// The ends of the colours of a surface: the 1st and 99th percentile of its heights, or its lowest and highest height where the percentiles
/// span less than a quarter of the relief. On level ground, the few cells that stand out are all there is to see; where they stand on it, the
/// colours begin below the ground. `None` without data.
fn colour_range(grid: &Grid) -> Option<(f64, f64)> {
    let (lowest, highest) = grid.range()?;
    let [low, middle, high] = quantiles(grid, [0.01, 0.5, 0.99])?;
    let relief = highest - lowest;
    Some(match high - low < MIDDLE_SHARE * relief {
        true if middle - lowest < MIDDLE_SHARE * relief => (lowest - BELOW_GROUND * relief, highest),
        true => (lowest, highest),
        false => (low, high),
    })
}

/// 1st and 99th percentile of a grid thinned for display; `None` without data.
pub fn percentiles(grid: &Grid) -> Option<(f64, f64)> {
    let [low, high] = quantiles(grid, [0.01, 0.99])?;
    Some((low, high))
}

/// Quantiles of a grid thinned for display; `None` without data.
fn quantiles<const N: usize>(grid: &Grid, shares: [f64; N]) -> Option<[f64; N]> {
    let thin = thin::block_mean(grid, thin::step(grid.rows(), grid.cols(), 256));
    let mut values = sums::finite(&thin.values);
    values.sort_by(f64::total_cmp);
    let quantiles = shares.map(|share| sums::quantile_sorted(&values, share));
    quantiles.iter().all(|v| v.is_finite()).then_some(quantiles)
}

/// A class map and the disk with which it was closed, in words.
pub fn class_map_words(data: &Data) -> String {
    let radius_m = data.study.roughness.closing_radius_m;
    if radius_m > 0.0 {
        format!("class map, closed with a disk of radius {} m,", set::plain(radius_m, 3))
    } else {
        "class map, not closed,".into()
    }
}

/// The smallest range of heights that contains the colour ranges of all files. `None` without any data.
pub fn middle_range(data: &Data, paths: &[&str]) -> Result<Option<(f64, f64)>, ReportError> {
    let mut range: Option<(f64, f64)> = None;
    for path in paths {
        let Some(grid) = data.files.grid(path)? else { continue };
        if let Some((low, high)) = colour_range(&grid) {
            range = Some(range.map_or((low, high), |(a, b)| (a.min(low), b.max(high))));
        }
    }
    Ok(range)
}

/// Shaded relief of the file at `path`; `None` when the release has no such file or the file has no data.
pub fn relief(data: &Data, path: &str, style: Option<Style>, words: Words) -> Result<Option<Figure>, ReportError> {
    let Some(grid) = data.files.grid(path)? else { return Ok(None) };
    relief_of(&grid, path, style, words)
}

/// Shaded relief of a grid that comes from the file at `path`; `None` without data.
pub fn relief_of(grid: &Grid, path: &str, style: Option<Style>, words: Words) -> Result<Option<Figure>, ReportError> {
    let Some(own_range) = grid.range() else { return Ok(None) };
    let style = style.unwrap_or(Style { range_m: own_range, exaggeration: 1.0, pixels: 400 });
    let picture = picture::relief(grid, style.range_m, style.exaggeration, style.pixels)?;
    let absent = (grid.finite_count() < grid.values.len()).then_some((colour::NO_DATA, "no data"));
    let colours = picture::ramp(&colour::heights(), 40);
    let key = Key::Ramp { colours: &colours, range: style.range_m, title: "height, m", absent };
    let map = Map::new(&picture, MAP_WIDTH, &key);
    let description = format!("Shaded relief of {}: {}.", path, extent(grid));
    Ok(Some(figure(words, description, map, numbers(path, grid, own_range))))
}

/// Deviations of a grid, coloured over `[-limit_m, limit_m]`; `absent` names the grey cells.
pub fn deviations(
    grid: &Grid,
    path: &str,
    limit_m: f64,
    absent: &str,
    words: Words,
) -> Result<Option<Figure>, ReportError> {
    let Some(own_range) = grid.range() else { return Ok(None) };
    let picture = picture::deviations(grid, limit_m, 400)?;
    let absent = (grid.finite_count() < grid.values.len()).then_some((colour::NO_DATA, absent));
    let colours = picture::ramp(&colour::deviations(), 40);
    let key = Key::Ramp { colours: &colours, range: (-limit_m, limit_m), title: "deviation, m", absent };
    let map = Map::new(&picture, MAP_WIDTH, &key);
    let description = format!("Map of deviations of {path}: {}.", extent(grid));
    Ok(Some(figure(words, description, map, numbers(path, grid, own_range))))
}

/// A map that accompanies heights, in plain colours over `range`; `title` is the quantity and its unit.
pub fn values(
    grid: &Grid,
    path: &str,
    (range, title): ((f64, f64), &str),
    words: Words,
) -> Result<Option<Figure>, ReportError> {
    let Some(own_range) = grid.range() else { return Ok(None) };
    let picture = picture::values(grid, range, 400)?;
    let absent = (grid.finite_count() < grid.values.len()).then_some((colour::NO_DATA, "no data"));
    let colours = picture::ramp(&colour::heights(), 40);
    let map = Map::new(&picture, MAP_WIDTH, &Key::Ramp { colours: &colours, range, title, absent });
    let description = format!("Map of {path}: {}.", extent(grid));
    Ok(Some(figure(words, description, map, numbers_of(path, grid, own_range, ""))))
}

/// A code of a raster, its colour and meaning.
pub type Code = (u8, Rgb, &'static str);

/// A raster of codes in their colours; the legend lists the codes that occur, with their shares.
pub fn codes(grid: &Grid<u8>, path: &str, codes: &[Code], words: Words) -> Result<Figure, ReportError> {
    let cells = |code: u8| grid.values.iter().filter(|c| **c == code).count();
    let present: Vec<Code> = codes.iter().copied().filter(|(code, _, _)| cells(*code) > 0).collect();
    let share = |code: u8| set::percent(cells(code) as f64 / grid.values.len().max(1) as f64, 1);
    let named = |(code, _, meaning): &Code| format!("{meaning} {}", share(*code));
    let legend: Vec<_> = present.iter().map(|c| (Mark::Fill(Paint::Fixed(c.1)), named(c))).collect();
    let colours: Vec<(u8, Rgb)> = present.iter().map(|(code, colour, _)| (*code, *colour)).collect();
    let map = Map::new(&picture::codes(grid, &colours, 400)?, MAP_WIDTH, &Key::Entries(&legend));
    let mut numbers = Numbers::of_file(path, &[("code", ""), ("cells", ""), ("meaning", "")]);
    for (code, _, meaning) in &present {
        numbers.row([count(usize::from(*code)), count(cells(*code)), text(*meaning)]);
    }
    let shares: Vec<String> = present.iter().map(named).collect();
    let description = format!("Map of {path}: {}; {}.", extent(grid), shares.join(", "));
    Ok(figure(words, description, map, numbers))
}

/// Two and a half standard deviations of the cells with data.
pub fn limit_m(grid: &Grid) -> f64 {
    2.5 * sums::variance(&sums::finite(&grid.values)).sqrt()
}

/// Size and cell in words.
pub fn extent<T>(grid: &Grid<T>) -> String {
    let ([x, y], [cell_x, cell_y]) = (grid.geometry.size(), grid.geometry.cell);
    let short = |v| set::significant(v, 3);
    let cell = if (cell_x - cell_y).abs() <= 1e-6 * cell_x {
        short(cell_x)
    } else {
        format!("{} × {}", short(cell_x), short(cell_y))
    };
    format!("{} × {} m, {} × {} cells of {cell} m", short(x), short(y), grid.cols(), grid.rows())
}

fn figure(words: Words, description: String, map: Map, numbers: Numbers) -> Figure {
    let Words { id, title, caption } = words;
    Figure { id, title, caption, description, svg: map.svg, numbers }
}

fn numbers(path: &str, grid: &Grid, range_m: (f64, f64)) -> Numbers {
    numbers_of(path, grid, range_m, "m")
}

/// Size of a raster, and its lowest and highest value in `unit`, which is empty for anything but metres.
fn numbers_of(path: &str, grid: &Grid, (low, high): (f64, f64), unit: &str) -> Numbers {
    let g = grid.geometry;
    let columns = [
        ("file", ""),
        ("rows", "1"),
        ("cols", "1"),
        ("cell_x_m", "m"),
        ("cell_y_m", "m"),
        (if unit == "m" { "low_m" } else { "low" }, unit),
        (if unit == "m" { "high_m" } else { "high" }, unit),
    ];
    let mut numbers = Numbers::of_file(path, &columns);
    let int = |n: usize| Cell::I64(n as i64);
    numbers.row([
        text(path),
        int(g.rows),
        int(g.cols),
        number(g.cell[0]),
        number(g.cell[1]),
        number(low),
        number(high),
    ]);
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    /// A rock of 1 m on level ground: the colours begin half its height below the ground, which would otherwise have the darkest. Above a hole, level
    /// ground is light, and hills have their percentiles.
    #[test]
    fn val_level_ground_is_not_black() {
        let geometry = Geometry::square(20, 20, 1.0);
        let of = |height: &dyn Fn(usize) -> f64| {
            colour_range(&Grid::new(geometry, (0..geometry.len()).map(height).collect())).unwrap()
        };
        assert_eq!(of(&|k| if k == 210 { 1.0 } else { 0.0 }), (-0.5, 1.0));
        assert_eq!(of(&|k| if k == 210 { -1.0 } else { 0.0 }), (-1.0, 0.0));
        let (low, high) = of(&|k| k as f64);
        assert!(low > 0.0 && high < 399.0, "{low} {high}");
    }
}
