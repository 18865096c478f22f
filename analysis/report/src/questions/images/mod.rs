//! What the cameras see: the rendered images of the release.

use super::Question;
use super::relief::MAP_WIDTH;
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, count, number, slug, text};
use crate::data::Data;
use crate::render::map::{Key, Map};
use crate::render::svg::Svg;
use crate::render::{number as set, picture};
use sastrugi_imaging::display;
use sastrugi_schemas::tables::ImageRow;
use std::collections::BTreeSet;

/// Registry entry.
pub const QUESTION: Question = Question { id: "images", name: "Images", title: "What do the cameras see?", answer };

/// Images drawn; all are in the table.
const DRAWN_MAX: usize = 12;
/// Largest number of rows or columns of a picture.
const PIXELS: usize = 640;
/// Camera whose images are maps.
const NADIR: &str = "nadir";
const WORDS: &str = "Brightness is the radiance of the ground over that of a white Lambert surface facing the sun (I/F). The ground \
scatters 35 % Lambert and 65 % Lommel-Seeliger unless the study states otherwise. Cast shadows are black; pixels that see no ground \
are left out. Each picture has its own white point, the brightness that one pixel in 200 exceeds, and a display gamma of 2.2.";

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    if data.images.is_empty() {
        return Ok(Vec::new());
    }
    let mut figures = Vec::new();
    for image in data.images.iter().take(DRAWN_MAX) {
        figures.extend(figure(data, image)?);
    }
    let surfaces = data.images.iter().map(|i| i.surface_id.as_str()).collect::<BTreeSet<_>>().len();
    let shown = match data.images.len() > DRAWN_MAX {
        true => format!(" The first {DRAWN_MAX} are shown; the table lists all."),
        false => String::new(),
    };
    let holds = format!(
        "The release has {} of {}.{shown}",
        set::counted(data.images.len(), "rendered image"),
        set::counted(surfaces, "surface")
    );
    let mut blocks = vec![Block::Text(holds), Block::Text(WORDS.into())];
    blocks.push(Block::Figures(figures));
    blocks.push(Block::Table(table(data)));
    Ok(blocks)
}

/// The first image; empty if the release has none.
pub(super) fn picture(data: &Data) -> Result<Vec<Figure>, ReportError> {
    let first = data.images.first().map(|image| figure(data, image)).transpose()?;
    Ok(first.flatten().into_iter().collect())
}

fn figure(data: &Data, image: &ImageRow) -> Result<Option<Figure>, ReportError> {
    let Some(grid) = data.files.grid(&image.path)? else { return Ok(None) };
    let picture = picture::brightness(&grid, display::white(&grid), PIXELS)?;
    let svg =
        if image.camera == NADIR { Map::new(&picture, MAP_WIDTH, &Key::Entries(&[])).svg } else { plain(&picture) };
    let mut numbers = Numbers::of_file(image.path.as_str(), &[("file", ""), ("rows", "1"), ("cols", "1")]);
    numbers.row([text(&image.path), count(grid.rows()), count(grid.cols())]);
    Ok(Some(Figure {
        id: slug(&format!("image-{}", image.image_id)),
        title: format!("Image {}.", image.image_id),
        caption: caption(image),
        description: format!("Rendered image of {}, {} x {} pixels.", image.surface_id, image.cols, image.rows),
        svg,
        numbers,
    }))
}

/// A picture without a scale: the ground size of its pixels varies.
fn plain(picture: &picture::Picture) -> Svg {
    let [width, height] = picture.size_m;
    let size = (MAP_WIDTH, MAP_WIDTH * height / width);
    let mut svg = Svg::new(size.0, size.1);
    svg.picture((0.0, 0.0), size, &picture.data_uri, false);
    svg
}

fn caption(image: &ImageRow) -> String {
    let albedo = if image.has_albedo_map { "albedo from its map" } else { "uniform albedo" };
    let pixel = if image.pixel_m.is_finite() {
        format!(", pixels of {}", set::with_unit(image.pixel_m, 3, "m"))
    } else {
        String::new()
    };
    format!(
        "{}, {} camera{pixel}, {albedo}; sun from {} degrees (clockwise from north), {} degrees above the horizon.",
        image.surface_id,
        image.camera,
        set::plain(image.sun_azimuth_deg, 4),
        set::plain(image.sun_elevation_deg, 4)
    )
}

fn table(data: &Data) -> TableBlock {
    let columns = [
        ("image", ""),
        ("surface", ""),
        ("camera", ""),
        ("sun azimuth", "deg"),
        ("sun elevation", "deg"),
        ("mean brightness", "1"),
        ("in shadow", "%"),
        ("without ground", "%"),
    ];
    let mut numbers = Numbers::computed("select * from 'tables/images/*.parquet'", &columns);
    for image in &data.images {
        numbers.row([
            text(&image.image_id),
            text(&image.surface_id),
            text(&image.camera),
            number(image.sun_azimuth_deg),
            number(image.sun_elevation_deg),
            number(image.mean_brightness),
            number(100.0 * image.share_in_shadow),
            number(100.0 * image.share_without_ground),
        ]);
    }
    TableBlock { id: "images".into(), caption: "Rendered images".into(), numbers }
}
