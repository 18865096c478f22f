//! Map tiles: by level, row and column of the collection's own grid, and by z, x, y for web-Mercator clients.

use super::answer::Answer;
use super::ogc::check_matrix_set;
use super::patch::sun;
use super::service::{Service, selection};
use super::{Base, On, Pairs, Plain, Problem, Query, Segments};
use crate::collections::{Collection, Ground};
use crate::grid::{TILE, TileIndex, WINDOW_TILE, WINDOW_ZOOM, of_web_mercator};
use crate::layers::{ELEVATION_SPAN_M, Layer, STEP_M, Style};
use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use serde_json::{Value, json};
use std::sync::Arc;

/// Length of the equator that web-Mercator clients assume, m.
const EQUATOR_M: f64 = 40_075_016.685_578_49;

/// Query parameters of tiles.
pub const KNOWN: [&str; 4] = ["sun_azimuth_deg", "sun_elevation_deg", "exaggeration", "phenomena"];

/// `GET /v1/collections/{id}/styles/{layer}/map/tiles/{tms}/{level}/{row}/{col}`
pub async fn tile(
    State(service): State<Arc<Service>>,
    On(collection): On,
    Segments((_, layer, set, level, row, col)): Segments<(String, String, String, String, String, String)>,
    pairs: Pairs,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    check_matrix_set(&collection, &set)?;
    let [level, row, col] = integers([&level, &row, &col])?;
    send(&service, &collection, &layer, TileIndex { level, row, col }, pairs, &headers).await
}

/// `GET /v1/collections/{id}/xyz/{layer}/{z}/{x}/{y}.png`
pub async fn xyz(
    State(service): State<Arc<Service>>,
    On(collection): On,
    Segments((_, layer, z, x, y)): Segments<(String, String, String, String, String)>,
    pairs: Pairs,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let y = y.strip_suffix(".png").unwrap_or(&y);
    let [z, x, y] = integers([&z, &x, y])?;
    let tile = of_web_mercator(z, x, y).ok_or_else(|| {
        let [col, row] = WINDOW_TILE;
        Problem::not_found(format!("outside the map, which covers the tile {WINDOW_ZOOM}/{col}/{row} and its subtiles"))
    })?;
    send(&service, &collection, &layer, tile, pairs, &headers).await
}

fn integers<const N: usize>(texts: [&str; N]) -> Result<[u32; N], Problem> {
    let mut numbers = [0; N];
    for (number, text) in numbers.iter_mut().zip(texts) {
        let digits = Some(text).filter(|text| text.bytes().all(|b| b.is_ascii_digit()));
        *number = digits
            .and_then(|text| text.parse().ok())
            .ok_or_else(|| Problem::not_found("level, row and column of a tile must be integers"))?;
    }
    Ok(numbers)
}

async fn send(
    service: &Service,
    collection: &Arc<Collection>,
    layer: &str,
    tile: TileIndex,
    pairs: Pairs,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let layer = collection.layer(layer)?;
    let query = pairs.checked(&[&KNOWN])?;
    let grid = collection.grid();
    if !grid.has(tile) {
        let levels = grid.levels - 1;
        return Err(Problem::not_found(format!(
            "no such tile: the level must be 0 to {levels}, and the row and column inside the collection"
        )));
    }
    let phenomena = selection(collection, &query)?.phenomena;
    let style = style(collection, &query, tile.level)?;
    let what = format!("tile {} {} {tile:?} {phenomena:?} {style:?}", collection.digest(), layer.name());
    let make = async {
        let samples = match &collection.ground {
            Ground::World(world) => world.map_tile(&service.maker(), tile, phenomena.as_deref()).await?,
            Ground::Raster(raster) => {
                let (raster, levels) = (Arc::clone(raster), service.levels(raster).await?);
                service.blocking(move || Ok(Arc::new(raster.tile(&levels, tile)))).await?
            }
        };
        if Layer::is_void(&samples) {
            return Ok(None);
        }
        let drawn = service.blocking(move || Ok(layer.draw(&samples, &style))).await?;
        let png = drawn.ok_or_else(|| {
            Problem::not_found(format!("heights of this tile are outside the range of `{}`; use `patch`", layer.name()))
        })?;
        Ok(Some(Answer::new("image/png", png)))
    };
    service.answers.answer(headers, &what, make).await
}

fn style(collection: &Collection, query: &Query, level: u32) -> Result<Style, Problem> {
    let (range_m, middle_m) = heights(collection);
    Ok(Style {
        sun: sun(query)?,
        exaggeration: query.number("exaggeration", [0.1, 100.0])?.unwrap_or(1.0),
        range_m,
        offset_m: offset_m(middle_m),
        cell_m: collection.grid().resolution_m(level),
    })
}

/// Heights of the lowest and the highest tint, and the height that `elevation` is centred on, m.
fn heights(collection: &Collection) -> ([f64; 2], f64) {
    match &collection.ground {
        Ground::World(world) => (world.height_range_m(), world.middle_height_m()),
        Ground::Raster(raster) => {
            let [low, high] = raster.files.height_range_m;
            ([low, high], 0.5 * (low + high))
        }
    }
}

/// Height of step 0 of [`Layer::Elevation`], rounded to 1 m, for a given height at the middle of its range.
fn offset_m(middle_m: f64) -> f64 {
    (middle_m - 0.5 * ELEVATION_SPAN_M).round()
}

/// `GET /v1/collections/{id}/xyz/{layer}/tilejson.json`
pub async fn tilejson(
    On(collection): On,
    Segments((id, layer)): Segments<(String, String)>,
    _: Plain,
    Base(host): Base,
) -> Result<Json<Value>, Problem> {
    let layer = collection.layer(&layer)?;
    let mut json = json!({
        "tilejson": "3.0.0",
        "name": format!("{id}: {}", layer.summary()),
        "tiles": [format!("{host}/v1/collections/{id}/xyz/{}/{{z}}/{{x}}/{{y}}.png", layer.name())],
        "minzoom": WINDOW_ZOOM,
        "maxzoom": WINDOW_ZOOM + finest_level(&collection, layer),
        "bounds": window_degrees(&collection),
        "scheme": "xyz",
        "description": "A planar map placed in one tile of the web-Mercator map: distances and areas that a client computes from \
                        longitude and latitude are meaningless; use `metres_per_pixel`. For true slopes, multiply heights by `vertical_scale`.",
        "vertical_scale": vertical_scale(collection.grid().resolution_m(0)),
        "metres_per_pixel": (0..collection.grid().levels).map(|l| collection.grid().resolution_m(l)).collect::<Vec<_>>(),
    });
    let (_, middle_m) = heights(&collection);
    let encoding = match layer {
        Layer::Terrarium => Some(json!({ "encoding": "terrarium" })),
        Layer::TerrainRgb => Some(json!({ "encoding": "mapbox" })),
        Layer::Elevation => Some(json!({
            "encoding": "custom", "redFactor": 65536.0 * STEP_M, "greenFactor": 256.0 * STEP_M, "blueFactor": STEP_M,
            "baseShift": -offset_m(middle_m), "offset_m": offset_m(middle_m), "step_m": STEP_M,
        })),
        _ => None,
    };
    if let (Value::Object(json), Some(Value::Object(encoding))) = (&mut json, encoding) {
        json.extend(encoding);
    }
    Ok(Json(json))
}

/// Factor on heights that makes slopes true in a web-Mercator client: ratio of the distances that the client assumes to the true ones, whose pixels of
/// level 0 are `resolution_m` wide.
fn vertical_scale(resolution_m: f64) -> f64 {
    EQUATOR_M / (TILE << WINDOW_ZOOM) as f64 / resolution_m
}

/// The finest level of a layer that is offered to web-Mercator clients.
fn finest_level(collection: &Collection, layer: Layer) -> u32 {
    let grid = collection.grid();
    let fits = |level: &u32| grid.resolution_m(*level) >= layer.finest_m();
    (0..grid.levels).rev().find(fits).unwrap_or(0)
}

/// West, south, east and north of the level-0 tiles in a web-Mercator client, degrees.
fn window_degrees(collection: &Collection) -> [f64; 4] {
    let [cols, rows] = collection.grid().matrix(0);
    let side = 360.0 / f64::from(1u32 << WINDOW_ZOOM);
    let [west, north] = [WINDOW_TILE[0], WINDOW_TILE[1]].map(f64::from);
    // At the equator, degrees of latitude and of longitude agree in length to 1 part in 10 000.
    let latitude = |row: f64| {
        let y = std::f64::consts::PI * (1.0 - 2.0 * row / f64::from(1u32 << WINDOW_ZOOM));
        libm::atan(libm::sinh(y)).to_degrees()
    };
    let longitude = |col: f64| col * side - 180.0;
    [longitude(west), latitude(north + f64::from(rows)), longitude(west + f64::from(cols)), latitude(north)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_numbers_of_tiles_are_digits() {
        assert_eq!(integers(["0", "17", "4294967295"]).unwrap(), [0, 17, u32::MAX]);
        for text in ["", "-1", "+1", "1.0", "0x1", " 1", "4294967296"] {
            assert!(integers(["0", text]).is_err(), "{text}");
        }
    }

    /// Zoom 8 has 65 536 pixels around the equator, each 611.5 m wide.
    #[test]
    fn val_slopes_are_true_with_the_vertical_scale() {
        assert!((vertical_scale(655.36) - 0.933_069).abs() < 1e-6);
        assert_eq!(vertical_scale(1.0), 2.0 * vertical_scale(2.0));
    }

    /// The range of `elevation`, 838.8608 m, is centred on the middle height, to within half a metre.
    #[test]
    fn val_elevation_is_centred_on_the_middle_height() {
        assert_eq!([offset_m(0.0), offset_m(1000.0), offset_m(-3000.0)], [-419.0, 581.0, -3419.0]);
    }
}
