//! Values at points and along lines, and the tracks of a release.

use super::answer::Answer;
use super::service::{SELECTION, Service, selection};
use super::{On, Pairs, Plain, Problem, Segments};
use crate::collections::world::{FEATURE_PIXELS, Piece, Selection};
use crate::collections::{Collection, Ground};
use crate::grid::TILE;
use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tokio::task::JoinSet;

/// Parameters of a point and of a profile, in addition to the selection.
pub const POINT: [&str; 3] = ["x", "y", "resolution_m"];
/// See [`POINT`].
pub const PROFILE: [&str; 3] = ["line", "samples", "resolution_m"];
/// A profile with at least this many samples per tile is taken from tiles.
const SHARED: usize = 16;
/// Largest number of samples of a profile.
pub const SAMPLES_MAX: u32 = 4096;
/// Default number of samples of a profile.
const SAMPLES: u32 = 256;
/// Largest number of corners of a line.
pub const CORNERS_MAX: usize = 1000;
/// Parts of a profile that are computed concurrently.
const PARTS: usize = 16;

/// `GET /v1/collections/{id}/point`
pub async fn point(
    State(service): State<Arc<Service>>,
    On(collection): On,
    pairs: Pairs,
) -> Result<Json<Value>, Problem> {
    let query = pairs.checked(&[&POINT, &SELECTION])?;
    let far = [-1e12, 1e12];
    let [x, y] = [query.number_of("x", far)?, query.number_of("y", far)?];
    let [_, finest_m] = collection.spacings_m();
    let step_m = query.number("resolution_m", [1e-6, 1e9])?.unwrap_or(finest_m);
    let selection = selection(&collection, &query)?;
    let s = service.samples(&collection, [x, y], step_m, [1, 1], &selection, Piece::Alone).await?;
    let first = |field: &Option<Vec<f32>>| field.as_ref().map(|v| v[0]).filter(|v| v.is_finite());
    Ok(Json(json!({
        "x_m": x,
        "y_m": y,
        "elevation_m": finite(s.heights[0]),
        "class": first(&s.rock).map(|share| if share >= 0.5 { "rock" } else { "sand" }),
        "rock_share": first(&s.rock),
        "albedo": first(&s.albedo),
        "rock_potential": first(&s.rock_potential),
        "resolution_m": collection.between_m(step_m),
    })))
}

fn finite(value: f32) -> Option<f32> {
    value.is_finite().then_some(value)
}

/// `GET /v1/collections/{id}/profile`
pub async fn profile(
    State(service): State<Arc<Service>>,
    On(collection): On,
    pairs: Pairs,
) -> Result<Json<Value>, Problem> {
    let query = pairs.checked(&[&PROFILE, &SELECTION])?;
    let line = query.line("line", CORNERS_MAX)?;
    let count = query.whole("samples", [2, SAMPLES_MAX])?.unwrap_or(SAMPLES) as usize;
    let (distances_m, places) = along(&line, count)
        .ok_or_else(|| Problem::bad_request("`line` has no length; give at least two different positions"))?;
    let apart_m = distances_m[count - 1] / (count - 1) as f64;
    let [_, finest_m] = collection.spacings_m();
    // A spacing of the map, so that slightly different lines share tiles.
    let coarsest_m = collection.grid().resolution_m(0);
    let unasked_m = || (finest_m * libm::exp2(libm::floor(libm::log2(apart_m / finest_m)).max(0.0))).min(coarsest_m);
    let step_m = query.number("resolution_m", [1e-6, 1e9])?.unwrap_or_else(unasked_m);
    let mut selection = selection(&collection, &query)?;
    let piece = if apart_m * SHARED as f64 <= TILE as f64 * step_m { Piece::Tiles } else { Piece::Alone };
    if let Ground::World(world) = &collection.ground {
        if query.text("feature_min_m").is_none() && step_m > finest_m {
            // As in map tiles of this resolution.
            selection.feature_min_m = FEATURE_PIXELS * step_m;
        }
        world.check_places(&places, step_m, &selection, piece, service.limits.work_s)?;
    }
    let feature_min_m = selection.feature_min_m;
    let heights = heights(&service, &collection, &places, step_m, (selection, piece)).await?;
    Ok(Json(json!({
        "distance_m": distances_m,
        "x_m": places.iter().map(|p| p[0]).collect::<Vec<_>>(),
        "y_m": places.iter().map(|p| p[1]).collect::<Vec<_>>(),
        "elevation_m": heights.into_iter().map(finite).collect::<Vec<_>>(),
        "resolution_m": collection.between_m(step_m),
        "feature_min_m": feature_min_m,
    })))
}

async fn heights(
    service: &Arc<Service>,
    collection: &Arc<Collection>,
    places: &[[f64; 2]],
    step_m: f64,
    (selection, piece): (Selection, Piece),
) -> Result<Vec<f32>, Problem> {
    let mut parts = JoinSet::new();
    let size = places.len().div_ceil(PARTS);
    for (n, part) in places.chunks(size).enumerate() {
        let (service, collection, selection) = (Arc::clone(service), Arc::clone(collection), selection.clone());
        let part = part.to_vec();
        parts.spawn(async move {
            let mut heights = Vec::with_capacity(part.len());
            for place in part {
                let made = service.samples(&collection, place, step_m, [1, 1], &selection, piece).await?;
                heights.push(made.heights[0]);
            }
            Ok::<_, Problem>((n, heights))
        });
    }
    let mut all = vec![f32::NAN; places.len()];
    while let Some(joined) = parts.join_next().await {
        let (n, heights) = joined.map_err(|e| Problem::internal(e.to_string()))??;
        all[n * size..n * size + heights.len()].copy_from_slice(&heights);
    }
    Ok(all)
}

/// Evenly spaced positions along a line and their distances from its start; `None` if it has no length.
fn along(line: &[[f64; 2]], count: usize) -> Option<(Vec<f64>, Vec<[f64; 2]>)> {
    let mut ends = vec![0.0];
    for pair in line.windows(2) {
        let [dx, dy] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
        ends.push(ends[ends.len() - 1] + libm::hypot(dx, dy));
    }
    let length = ends[ends.len() - 1];
    if length <= 0.0 {
        return None;
    }
    let distances: Vec<f64> = (0..count).map(|k| length * k as f64 / (count - 1) as f64).collect();
    let place = |at: &f64| {
        let leg = ends.partition_point(|end| end <= at).clamp(1, line.len() - 1);
        let span = ends[leg] - ends[leg - 1];
        let w = if span > 0.0 { ((at - ends[leg - 1]) / span).clamp(0.0, 1.0) } else { 0.0 };
        [0, 1].map(|a| line[leg - 1][a] + (line[leg][a] - line[leg - 1][a]) * w)
    };
    let places = distances.iter().map(place).collect();
    Some((distances, places))
}

/// `GET /v1/collections/{id}/tracks`
pub async fn tracks(State(service): State<Arc<Service>>, On(collection): On, _: Plain) -> Result<Json<Value>, Problem> {
    let list = move |stop: &AtomicBool| {
        Ok(Json(json!({ "tracks": collection.track_list(stop)?, "total": collection.tracks() })))
    };
    service.reading(list).await
}

/// `GET /v1/collections/{id}/tracks/{track}`
pub async fn track(
    State(service): State<Arc<Service>>,
    On(collection): On,
    Segments((_, track)): Segments<(String, String)>,
    _: Plain,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let tables = collection.drives.as_ref().map(|drives| drives.digest.as_str()).unwrap_or_default();
    let what = format!("track {tables} {} {track}", collection.id);
    let make = async {
        let collection = Arc::clone(&collection);
        let json = service.reading(move |stop| collection.track(&track, stop)).await?;
        Ok(Some(Answer::new("application/json", json.to_string())))
    };
    service.answers.answer(&headers, &what, make).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_places_lie_evenly_along_a_line() {
        let (distances, places) = along(&[[0.0, 0.0], [3.0, 4.0], [3.0, 9.0]], 5).unwrap();
        assert_eq!(distances, [0.0, 2.5, 5.0, 7.5, 10.0]);
        assert_eq!(places, [[0.0, 0.0], [1.5, 2.0], [3.0, 4.0], [3.0, 6.5], [3.0, 9.0]]);
        assert_eq!(along(&[[1.0, 1.0], [1.0, 1.0]], 5), None);
        // A repeated corner adds nothing.
        let (distances, places) = along(&[[0.0, 0.0], [0.0, 0.0], [4.0, 0.0], [4.0, 0.0]], 3).unwrap();
        assert_eq!((distances, places), (vec![0.0, 2.0, 4.0], vec![[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]]));
    }
}
