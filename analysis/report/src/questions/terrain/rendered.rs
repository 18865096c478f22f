//! Every planetary and elaborated terrain rendered from above with its albedo and cast shadows. The representative of each group is drawn large;
//! the others are thumbnails.
//!
//! This is drawing, as the shading of reliefs is: heights and albedo are first thinned to the pixels of the picture.

use super::representative;
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, count, number, slug, text};
use crate::data::{Data, Group, Natural, label, natural};
use crate::questions::relief::{MAP_WIDTH, extent};
use crate::questions::sql::quoted;
use crate::render::chart::WIDTH;
use crate::render::map::{Key, Map};
use crate::render::picture::{self, Picture};
use crate::render::svg::{Anchor, Paint, Svg, fitted};
use crate::render::{number as set, thin};
use sastrugi_imaging::{RenderParameters, Rendering, Scene, Sun, display, render};
use sastrugi_numeric::{Grid, Streams, sums};
use sastrugi_schemas::tables::TerrainRow;
use std::collections::BTreeMap;

/// Kinds of terrain with an albedo of their own.
const KINDS: [&str; 2] = ["planetary", "elaborate"];
/// Low in the north-west, so that rocks and rims cast shadows.
const SUN: Sun = Sun { azimuth_deg: 315.0, elevation_deg: 25.0 };
/// Standard deviation of brightness over its mean below which a picture would look blank.
const CONTRAST_MIN: f64 = 0.1;
/// Largest number of rows or columns of a large picture.
const PIXELS: usize = 480;
/// The same of a thumbnail.
const THUMBNAIL_PIXELS: usize = 128;
/// Thumbnails on a page: about 15 kB each.
const THUMBNAILS_MAX: usize = 96;
/// Thumbnails in a row.
const COLUMNS: usize = 4;
/// Gap between thumbnails, px.
const GAP: f64 = 8.0;
/// Room for the id below a thumbnail, px.
const LABEL: f64 = 18.0;
/// Size of the id, px.
const LABEL_SIZE: f64 = 11.0;

/// A large picture for each group, thumbnails of the other terrains, and the number left out.
pub fn blocks(data: &Data, groups: &[Group<TerrainRow>]) -> Result<Vec<Block>, ReportError> {
    let large: Vec<&TerrainRow> = groups.iter().filter_map(representative).filter(|t| is_planet(t)).collect();
    let (mut figures, mut blank) = (Vec::new(), Vec::new());
    for terrain in &large {
        match view(data, terrain, PIXELS)? {
            Seen::View(view) => figures.push(figure(terrain, &view)),
            Seen::Blank => blank.push(*terrain),
            Seen::Absent => {}
        }
    }
    let others: Vec<&TerrainRow> = data
        .of_stage("terrain")
        .filter(|t| is_planet(t) && !large.iter().any(|l| l.terrain_id == t.terrain_id))
        .collect();
    let (drawn, left_out) = others.split_at(others.len().min(THUMBNAILS_MAX));
    for group in drawn.chunk_by(|a, b| label(a) == label(b)) {
        figures.extend(sheet(data, group, &mut blank)?);
    }
    let mut blocks = Vec::new();
    if !figures.is_empty() || !blank.is_empty() {
        blocks.extend([Block::Heading("Rendered views".into()), Block::Figures(figures)]);
        blocks.extend(left_blank(&blank).map(Block::Text));
    }
    if !left_out.is_empty() {
        blocks.push(Block::Text(format!(
            "{} of {} planetary and elaborated terrains {} not rendered here: to stay small, a page has the representative of each group and at \
             most {THUMBNAILS_MAX} thumbnails. An `[[image]]` renders any terrain of a study.",
            set::count(left_out.len()),
            set::count(left_out.len() + drawn.len() + large.len()),
            if left_out.len() == 1 { "is" } else { "are" }
        )));
    }
    Ok(blocks)
}

/// How many terrains of which groups would look blank; `None` if none would.
fn left_blank(terrains: &[&TerrainRow]) -> Option<String> {
    let mut groups: BTreeMap<Natural, usize> = BTreeMap::new();
    terrains.iter().for_each(|t| *groups.entry(natural(label(t))).or_default() += 1);
    let groups: Vec<String> = groups.into_iter().map(|(group, n)| format!("{} ({})", group.1, set::count(n))).collect();
    (!terrains.is_empty()).then(|| {
        format!(
            "{} would look blank, because the brightness in {} varies by less than {}: {}.",
            set::counted(terrains.len(), "terrain"),
            if terrains.len() == 1 { "its picture" } else { "their pictures" },
            set::percent(CONTRAST_MIN, 0),
            groups.join(", ")
        )
    })
}

fn is_planet(terrain: &TerrainRow) -> bool {
    KINDS.contains(&terrain.kind.as_str())
}

/// A rendered terrain.
struct View {
    rendering: Rendering,
    picture: Picture,
    /// Size of the whole terrain, in words.
    extent: String,
    /// Rows and columns rendered.
    shape: [usize; 2],
    /// Cells along a side of a pixel.
    step: usize,
    /// Size of a pixel on the ground, m.
    pixel_m: f64,
    with_albedo: bool,
}

/// What there is to see of a terrain.
enum Seen {
    View(Box<View>),
    /// The picture would look blank.
    Blank,
    /// The release does not have its heights, or they cannot be rendered.
    Absent,
}

/// Renders a terrain with at most `most` pixels along a side.
fn view(data: &Data, terrain: &TerrainRow, most: usize) -> Result<Seen, ReportError> {
    let Some(heights) = data.files.grid(&terrain.path)? else { return Ok(Seen::Absent) };
    let map = terrain.path.strip_suffix(".tif").map(|path| format!("{path}.albedo.tif"));
    let albedo = map.map_or(Ok(None), |path| data.files.grid(&path))?;
    let step = thin::step(heights.rows(), heights.cols(), most);
    let thinned = thin::block_mean(&heights, step);
    let albedo: Option<Grid> = albedo.map(|grid| thin::block_mean(&grid, step));
    let parameters = RenderParameters { sun: SUN, samples: 1, ..RenderParameters::default() };
    let scene = Scene { heights: &thinned, albedo: albedo.as_ref() };
    // Without noise, no random numbers are drawn.
    let Ok(rendering) = render(&scene, &parameters, &Streams::for_seed(0, KINDS[0])) else { return Ok(Seen::Absent) };
    let image = rendering.image();
    if contrast(&image) < CONTRAST_MIN {
        return Ok(Seen::Blank);
    }
    let picture = picture::brightness(&image, display::white(&image), most)?;
    Ok(Seen::View(Box::new(View {
        rendering,
        picture,
        extent: extent(&heights),
        shape: [thinned.rows(), thinned.cols()],
        step,
        pixel_m: thinned.geometry.mean_cell(),
        with_albedo: albedo.is_some(),
    })))
}

/// Standard deviation of an image over its mean.
fn contrast(image: &Grid) -> f64 {
    let values = sums::finite(&image.values);
    sums::variance(&values).sqrt() / sums::mean(&values)
}

const COLUMN_NAMES: [(&str, &str); 6] =
    [("file", ""), ("rows", "1"), ("cols", "1"), ("pixel", "m"), ("mean brightness", "1"), ("in shadow", "%")];

fn row(numbers: &mut Numbers, terrain: &TerrainRow, view: &View) {
    numbers.row([
        text(&terrain.path),
        count(view.shape[0]),
        count(view.shape[1]),
        number(view.pixel_m),
        number(view.rendering.mean_brightness()),
        number(100.0 * view.rendering.share_in_shadow()),
    ]);
}

fn sun_words() -> String {
    format!(
        "sun from {} degrees (north-west), {} degrees above the horizon",
        set::plain(SUN.azimuth_deg, 3),
        set::plain(SUN.elevation_deg, 3)
    )
}

fn figure(terrain: &TerrainRow, view: &View) -> Figure {
    let albedo_words = if view.with_albedo { "its albedo" } else { "uniform albedo" };
    let mut numbers = Numbers::of_file(terrain.path.as_str(), &COLUMN_NAMES);
    row(&mut numbers, terrain, view);
    let step = view.step;
    Figure {
        id: slug(&format!("rendered-{}", terrain.terrain_id)),
        title: format!("Rendered view, group {}.", label(terrain)),
        caption: format!(
            "{} from above with {albedo_words} and cast shadows, pixels of {}{}; {}.",
            terrain.terrain_id,
            set::with_unit(view.pixel_m, 3, "m"),
            if step > 1 { format!(" (averaged over {step} × {step} cells)") } else { String::new() },
            sun_words()
        ),
        description: format!("Rendered image of {}, {}.", terrain.path, view.extent),
        svg: Map::new(&view.picture, MAP_WIDTH, &Key::Entries(&[])).svg,
        numbers,
    }
}

/// Thumbnails of terrains with one label, each with its id below; those that would look blank are added to `blank`.
fn sheet<'a>(
    data: &Data,
    terrains: &[&'a TerrainRow],
    blank: &mut Vec<&'a TerrainRow>,
) -> Result<Option<Figure>, ReportError> {
    let mut views = Vec::new();
    for &terrain in terrains {
        match view(data, terrain, THUMBNAIL_PIXELS)? {
            Seen::View(view) => views.push((terrain, *view)),
            Seen::Blank => blank.push(terrain),
            Seen::Absent => {}
        }
    }
    let Some((first, _)) = views.first() else { return Ok(None) };
    let name = label(first);
    let width = (WIDTH - GAP * (COLUMNS - 1) as f64) / COLUMNS as f64;
    let height = views.iter().map(|(_, v)| shown(&v.picture, width).1).fold(0.0, f64::max);
    let lines = views.len().div_ceil(COLUMNS);
    let mut svg = Svg::new(WIDTH, lines as f64 * (height + LABEL + GAP));
    let ids: Vec<String> = views.iter().map(|(t, _)| quoted(&t.terrain_id)).collect();
    let query = format!("select path from 'tables/terrains/*.parquet' where terrain_id in ({})", ids.join(", "));
    let mut numbers = Numbers::computed(query, &COLUMN_NAMES);
    for (k, (terrain, view)) in views.iter().enumerate() {
        let corner = ((k % COLUMNS) as f64 * (width + GAP), (k / COLUMNS) as f64 * (height + LABEL + GAP));
        let size = shown(&view.picture, width);
        svg.picture(corner, size, &view.picture.data_uri, false);
        let words = fitted(&terrain.terrain_id, width, LABEL_SIZE);
        svg.text_sized((corner.0, corner.1 + size.1 + 13.0), Anchor::Start, Paint::Ink, LABEL_SIZE, &words);
        row(&mut numbers, terrain, view);
    }
    let with_albedo = views.iter().filter(|(_, v)| v.with_albedo).count();
    let albedo = match with_albedo {
        0 => "uniform albedo",
        n if n == views.len() => "mapped albedo",
        _ => "mapped albedo where there is a map",
    };
    Ok(Some(Figure {
        id: slug(&format!("thumbnails-{name}-{}", first.terrain_id)),
        title: format!("Rendered views, group {name}."),
        caption: format!(
            "{} from above with {albedo} and cast shadows, pixels of {}, each with its own white point; {}.",
            set::counted(views.len(), "terrain"),
            pixels(&views),
            sun_words()
        ),
        description: format!("Rendered thumbnails of {} of group {name}.", set::counted(views.len(), "terrain")),
        svg,
        numbers,
    }))
}

/// Size on the page of a picture in a box of a given width.
fn shown(picture: &Picture, width: f64) -> (f64, f64) {
    let [x, y] = picture.size_m;
    let scale = width / x.max(y);
    (scale * x, scale * y)
}

/// Size of the pixels of all views, in words.
fn pixels(views: &[(&TerrainRow, View)]) -> String {
    let sizes = || views.iter().map(|(_, v)| v.pixel_m);
    let (low, high) = sizes().fold((f64::INFINITY, 0.0_f64), |(a, b), v| (a.min(v), b.max(v)));
    let ends = [low, high].map(|v| set::with_unit(v, 3, "m"));
    if ends[0] == ends[1] { ends[0].clone() } else { ends.join(" to ") }
}
