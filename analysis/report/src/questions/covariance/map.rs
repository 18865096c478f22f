//! The covariance of a fit's residual at every lag, in all directions.

use crate::ReportError;
use crate::content::{Figure, Numbers, number, slug, text};
use crate::data::Data;
use crate::questions::relief::{MAP_WIDTH, extent};
use crate::render::map::{Key, Map};
use crate::render::{colour, picture};
use sastrugi_schemas::Cell;
use sastrugi_schemas::tables::FitRow;

/// Map over the lags; `None` without the file, or where all lags lie on one line (transects).
pub fn figure(data: &Data, fit: &FitRow) -> Result<Option<Figure>, ReportError> {
    let path = format!("fit/{}.covariance.tif", fit.fit_id);
    let Some(grid) = data.files.grid(&path)? else { return Ok(None) };
    let middle = grid.values.len() / 2;
    let variance_m2 = grid.values.get(middle).copied().filter(|v| *v > 0.0);
    let Some(variance_m2) = variance_m2.filter(|_| grid.rows() > 1) else { return Ok(None) };
    let picture = picture::deviations(&grid, variance_m2, 400)?;
    let absent = (grid.finite_count() < grid.values.len()).then_some((colour::NO_DATA, "no pairs"));
    let colours = picture::ramp(&colour::deviations(), 40);
    let key = Key::Ramp { colours: &colours, range: (-variance_m2, variance_m2), title: "covariance, m²", absent };
    let columns =
        [("file", ""), ("rows", "1"), ("cols", "1"), ("cell_x_m", "m"), ("cell_y_m", "m"), ("variance_m2", "m2")];
    let mut numbers = Numbers::of_file(path.clone(), &columns);
    let int = |n: usize| Cell::I64(n as i64);
    let [cell_x, cell_y] = grid.geometry.cell;
    let row = [int(grid.rows()), int(grid.cols()), number(cell_x), number(cell_y), number(variance_m2)];
    numbers.row([text(&path)].into_iter().chain(row));
    Ok(Some(Figure {
        id: slug(&format!("covariance-map-{}", fit.fit_id)),
        title: format!("Covariance at every lag, {}.", fit.fit_id),
        caption: "Lag zero is at the centre; an isotropic texture gives circular rings.".into(),
        description: format!("Map of the covariance {path} about lag zero: {}.", extent(&grid)),
        svg: Map::new(&picture, MAP_WIDTH, &key).svg,
        numbers,
    }))
}
