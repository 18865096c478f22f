//! Which cells of the DEM a fit was made from.

use crate::ReportError;
use crate::content::{Figure, Numbers, count, slug, text};
use crate::data::Data;
use crate::questions::relief::{MAP_WIDTH, extent};
use crate::render::chart::Mark;
use crate::render::colour::{NO_DATA, Rgb};
use crate::render::map::{Key, Map};
use crate::render::svg::Paint;
use crate::render::{number as set, picture};
use sastrugi_schemas::tables::FitRow;

/// Codes of `fit/<id>.mask.tif`, their colours and words.
const CODES: [(u8, Rgb, &str); 4] = [
    (0, [0xcf, 0xe3, 0xee], "used"),
    (1, [0xd5, 0x5e, 0x00], "trimmed, or an object"),
    (2, [0x4b, 0x4f, 0xa6], "window lacks data"),
    (255, NO_DATA, "no data"),
];

/// Map of the cells; `None` without the file.
pub fn figure(data: &Data, fit: &FitRow) -> Result<Option<Figure>, ReportError> {
    let path = format!("fit/{}.mask.tif", fit.fit_id);
    let Some(codes) = data.files.classes(&path)? else { return Ok(None) };
    let cells = |code: u8| codes.values.iter().filter(|c| **c == code).count();
    let present: Vec<(u8, Rgb, &str)> = CODES.into_iter().filter(|(code, _, _)| cells(*code) > 0).collect();
    let share = |code: u8| set::percent(cells(code) as f64 / codes.values.len().max(1) as f64, 1);
    let legend: Vec<_> = present
        .iter()
        .map(|(code, colour, words)| (Mark::Fill(Paint::Fixed(*colour)), format!("{words} {}", share(*code))))
        .collect();
    let colours: Vec<(u8, Rgb)> = present.iter().map(|(code, colour, _)| (*code, *colour)).collect();
    let picture = picture::codes(&codes, &colours, 400)?;
    let map = Map::new(&picture, MAP_WIDTH, &Key::Entries(&legend));
    let mut numbers = Numbers::of_file(path.clone(), &[("code", ""), ("cells", ""), ("meaning", "")]);
    present
        .iter()
        .for_each(|(code, _, words)| numbers.row([count(usize::from(*code)), count(cells(*code)), text(*words)]));
    Ok(Some(Figure {
        id: slug(&format!("mask-{}", fit.fit_id)),
        title: format!("Cells used, {}.", fit.fit_id),
        caption: "Which cells entered the covariance, and why others did not.".into(),
        description: format!("Map of the cells of {path}: {}, {} used.", extent(&codes), share(0)),
        svg: map.svg,
        numbers,
    }))
}
