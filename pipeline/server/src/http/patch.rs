//! `patch`: samples at any position and resolution, in the requested format.

use super::answer::Answer;
use super::service::{Service, selection};
use super::{On, Pairs, Problem, Query};
use crate::collections::world::{Piece, Selection};
use crate::collections::{Collection, Ground};
use crate::samples::{Flip, Samples, Thinning};
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use axum::response::Response;
use sastrugi_imaging::{RenderParameters, Scene, Sun, render};
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_store::dem::{self, Crs, Values, WriteOptions};
use std::borrow::Cow;
use std::sync::Arc;

/// Query parameters of patches.
pub const KNOWN: [&str; 15] = [
    "origin",
    "center",
    "size",
    "size_m",
    "resolution_m",
    "field",
    "format",
    "rotate",
    "flip",
    "downsample",
    "method",
    "sun_azimuth_deg",
    "sun_elevation_deg",
    "phenomena",
    "feature_min_m",
];
/// Names of the fields.
pub const FIELDS: [&str; 5] = ["elevation", "albedo", "class", "rock_potential", "image"];
/// Names of the formats.
pub const FORMATS: [&str; 4] = ["tif", "npy", "raw", "png"];
/// Divisor of the sample limit for images, because rendering takes far longer than returning samples.
const IMAGE_PART: u64 = 4;
/// Blocks of at most 2^12 x 2^12 samples.
pub const DOWNSAMPLE_MAX: u32 = 12;

/// Position of the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Position of the south-west sample, m.
    pub origin_m: [f64; 2],
    /// Rows and columns.
    pub shape: [usize; 2],
    /// Sample spacing, m.
    pub step_m: f64,
}

impl Window {
    /// The window that a request describes.
    ///
    /// # Errors
    /// Parameters that are missing, exclude each other, or exceed a limit.
    pub fn of(query: &Query, collection: &Collection, most: u64) -> Result<Self, Problem> {
        let [cell_m, _] = collection.spacings_m();
        let (origin, center) = (query.pair("origin")?, query.pair("center")?);
        let step_m = query.number("resolution_m", [1e-6, 1e9])?.unwrap_or(cell_m);
        let shape = match (query.pair("size")?, query.pair("size_m")?) {
            (Some(size), None) => size,
            (None, Some(size_m)) => size_m.map(|m| (m / step_m).round()),
            _ => return Err(Problem::bad_request("give either `size` (samples) or `size_m` (metres)")),
        };
        if shape.iter().any(|n| !(*n >= 1.0 && n.fract() == 0.0)) {
            return Err(Problem::bad_request(if query.text("size").is_some() {
                "`size` must be two integers of at least 1, columns and rows".to_owned()
            } else {
                format!("`size_m` must be at least one sample spacing, {step_m} m")
            }));
        }
        if shape[0] * shape[1] > most as f64 {
            return Err(Problem::too_large(
                format!(
                    "{} x {} samples exceed the limit of {most}; request a smaller window, or several",
                    shape[0], shape[1]
                ),
                "samples_max",
                most,
            ));
        }
        let [cols, rows] = shape.map(|n| n as usize);
        let origin_m = match (origin, center) {
            (Some(origin), None) => origin,
            (None, Some(center)) => {
                let half = [cols, rows].map(|n| 0.5 * (n - 1) as f64 * step_m);
                snapped(collection, [center[0] - half[0], center[1] - half[1]], step_m)
            }
            _ => {
                return Err(Problem::bad_request("give either `origin` (south-west sample) or `center`"));
            }
        };
        Ok(Self { origin_m, shape: [rows, cols], step_m })
    }

    /// Geometry with each sample at the centre of its cell.
    pub fn geometry(&self) -> Geometry {
        let origin = self.origin_m.map(|at| at - 0.5 * self.step_m);
        Geometry { rows: self.shape[0], cols: self.shape[1], cell: [self.step_m; 2], origin }
    }
}

/// The nearest position with samples of its own; a window given by its centre may move by half a sample.
fn snapped(collection: &Collection, at: [f64; 2], step_m: f64) -> [f64; 2] {
    match &collection.ground {
        Ground::World(world) => world.snapped(at, step_m),
        Ground::Raster(raster) => {
            let g = &raster.geometry;
            [0, 1].map(|a| ((at[a] - g.origin[a]) / step_m - 0.5).round() * step_m + g.origin[a] + 0.5 * step_m)
        }
    }
}

/// Processing of the samples before they are sent.
#[derive(Clone, Copy, Debug)]
struct Treatment {
    field: &'static str,
    format: &'static str,
    quarters: u32,
    flip: Option<Flip>,
    downsample: u32,
    method: Thinning,
    sun: Sun,
}

impl Treatment {
    fn of(query: &Query, collection: &Collection) -> Result<Self, Problem> {
        let field = query.word("field", &FIELDS, "elevation")?;
        if !collection.fields().contains(&field) {
            let fields = collection.fields().join(", ");
            return Err(Problem::bad_request(format!(
                "`field`: \"{}\" has no {field}; it has {fields}",
                collection.id
            )));
        }
        let quarters = match query.word("rotate", &["0", "90", "180", "270"], "0")? {
            "90" => 1,
            "180" => 2,
            "270" => 3,
            _ => 0,
        };
        let flip = match query.word("flip", &["none", "horizontal", "vertical"], "none")? {
            "horizontal" => Some(Flip::Horizontal),
            "vertical" => Some(Flip::Vertical),
            _ => None,
        };
        let method = match query.word("method", &["point", "mean"], "point")? {
            "mean" => Thinning::Mean,
            _ => Thinning::Point,
        };
        let downsample = query.whole("downsample", [0, DOWNSAMPLE_MAX])?.unwrap_or(0);
        let format = query.word("format", &FORMATS, "tif")?;
        Ok(Self { field, format, quarters, flip, downsample, method, sun: sun(query)? })
    }

    /// False if the result is rotated or mirrored and so has no position on the ground.
    fn has_place(&self) -> bool {
        self.quarters == 0 && self.flip.is_none()
    }

    fn apply(&self, samples: Samples, window: &Window, crs: &Crs) -> Result<Answer, Problem> {
        let samples = samples.thinned(self.downsample, self.method)?;
        let step_m = window.step_m * f64::from(1u32 << self.downsample);
        // The mean belongs to the centre of its block.
        let middle = if self.method == Thinning::Mean { 0.5 * (step_m - window.step_m) } else { 0.0 };
        let origin_m = window.origin_m.map(|at| at + middle);
        let thinned = Window { origin_m, shape: [samples.rows, samples.cols], step_m };
        let mut geometry = thinned.geometry();
        let values = self.values(&samples, geometry)?;
        let field = Samples { heights: values, ..Samples::empty(samples.rows, samples.cols) };
        let field = field.turned(self.quarters);
        let field = match self.flip {
            Some(flip) => field.flipped(flip),
            None => field,
        };
        (geometry.rows, geometry.cols) = (field.rows, field.cols);
        let crs = if self.has_place() {
            crs.clone()
        } else {
            geometry.origin = [0.0; 2];
            Crs::default()
        };
        self.encode(&Grid::new(geometry, field.heights), &crs)
    }

    /// Values of the requested field.
    fn values(&self, samples: &Samples, geometry: Geometry) -> Result<Vec<f32>, Problem> {
        let there = |field: &Option<Vec<f32>>| {
            let name = self.field;
            field.clone().ok_or_else(|| {
                Problem::bad_request(format!(
                    "`phenomena` excludes the process that produces {name}; include it, or request another `field`"
                ))
            })
        };
        match self.field {
            "albedo" => there(&samples.albedo),
            "class" => there(&samples.rock),
            "rock_potential" => there(&samples.rock_potential),
            "image" => self.image(samples, geometry),
            _ => Ok(samples.heights.clone()),
        }
    }

    /// Renders the ground from straight above under the sun; ground outside the patch casts no shadow into it.
    fn image(&self, samples: &Samples, geometry: Geometry) -> Result<Vec<f32>, Problem> {
        let grid = |values: &Vec<f32>| Grid::new(geometry, values.iter().map(|v| f64::from(*v)).collect());
        let (heights, albedo) = (grid(&samples.heights), samples.albedo.as_ref().map(grid));
        let parameters = RenderParameters { sun: self.sun, ..RenderParameters::default() };
        let scene = Scene { heights: &heights, albedo: albedo.as_ref() };
        let made = render(&scene, &parameters, &Streams::for_seed(0, "image"))
            .map_err(|e| Problem::unprocessable(format!("the image cannot be rendered: {e}")))?;
        Ok(made.image().values.iter().map(|v| *v as f32).collect())
    }

    fn encode(&self, grid: &Grid<f32>, crs: &Crs) -> Result<Answer, Problem> {
        let g = grid.geometry;
        let double = || Grid::new(g, grid.values.iter().map(|v| f64::from(*v)).collect());
        let mut notes = Vec::new();
        let mut answer = match self.format {
            "raw" => {
                let bytes: Vec<u8> = grid.values.iter().flat_map(|v| v.to_le_bytes()).collect();
                Answer::new("application/octet-stream", bytes)
            }
            format => {
                let name = format!("patch.{format}");
                let options =
                    WriteOptions { cloud_optimised: format == "tif", values: self.kind(), ..WriteOptions::default() };
                let (bytes, warnings) = dem::encode(std::path::Path::new(&name), &double(), crs, &options)
                    .map_err(|e| Problem::unprocessable(e.to_string()))?;
                notes = warnings;
                Answer::new(media(format), bytes)
            }
        };
        if self.field == "image" {
            notes.push(self.sun_words());
        }
        let place = self.has_place().then(|| format!("{:?},{:?}", g.x(0), g.y(g.rows - 1)));
        let named = [
            ("grid-rows", g.rows.to_string()),
            ("grid-columns", g.cols.to_string()),
            ("grid-resolution-m", format!("{:?}", g.cell[0])),
            ("grid-origin-m", place.unwrap_or_default()),
            ("grid-note", notes.join("; ")),
        ];
        for (name, value) in named.into_iter().filter(|(_, value)| !value.is_empty()) {
            if let Ok(value) = HeaderValue::from_str(&value) {
                answer.more.push((HeaderName::from_static(name), value));
            }
        }
        let file =
            format!("inline; filename=\"{}.{}\"", self.field, if self.format == "raw" { "f32" } else { self.format });
        answer.more.extend(HeaderValue::from_str(&file).ok().map(|value| (header::CONTENT_DISPOSITION, value)));
        Ok(answer)
    }

    fn kind(&self) -> Values {
        let unitless = |description: Cow<'static, str>| Values::Quantity { unit: "1".into(), description };
        match self.field {
            "albedo" => unitless("albedo, share of the light that is reflected".into()),
            "class" => unitless("share of the cell that rocks cover".into()),
            "rock_potential" => unitless("potential rock cover, share of the ground".into()),
            "image" => unitless(format!("brightness, I/F; {}", self.sun_words()).into()),
            _ => Values::default(),
        }
    }

    /// Direction of the sun of an image.
    fn sun_words(&self) -> String {
        let Sun { azimuth_deg, elevation_deg } = self.sun;
        format!("sun at azimuth {azimuth_deg} and elevation {elevation_deg} degrees")
    }
}

fn media(format: &str) -> &'static str {
    match format {
        "tif" => "image/tiff; application=geotiff; profile=cloud-optimized",
        "png" => "image/png",
        _ => "application/octet-stream",
    }
}

/// The sun that a request describes.
///
/// # Errors
/// Angles out of bounds, such as a sun below the horizon.
pub fn sun(query: &Query) -> Result<Sun, Problem> {
    let default = Sun::default();
    Ok(Sun {
        azimuth_deg: query.number("sun_azimuth_deg", [-360.0, 720.0])?.unwrap_or(default.azimuth_deg),
        elevation_deg: query.number("sun_elevation_deg", [0.1, 90.0])?.unwrap_or(default.elevation_deg),
    })
}

/// `GET /v1/collections/{id}/patch`
pub async fn patch(
    State(service): State<Arc<Service>>,
    On(collection): On,
    pairs: Pairs,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let query = pairs.checked(&[&KNOWN])?;
    let (treatment, selection) = (Treatment::of(&query, &collection)?, selection(&collection, &query)?);
    let most = service.limits.samples / if treatment.field == "image" { IMAGE_PART } else { 1 };
    let window = Window::of(&query, &collection, most.max(1))?;
    let what = format!("patch {} {window:?} {treatment:?} {selection:?}", collection.digest());
    let make = async {
        let room = service.rooms.take(window.shape[0] * window.shape[1]).await;
        let room = room.map_err(|e| Problem::internal(e.to_string()))?;
        let samples = ground(&service, &collection, &window, &selection).await?;
        let crs = match &collection.ground {
            Ground::World(_) => Crs::default(),
            Ground::Raster(raster) => raster.crs.clone(),
        };
        let made = service.blocking(move || {
            let made = treatment.apply(samples, &window, &crs);
            drop(room);
            made
        });
        made.await.map(Some)
    };
    service.answers.answer(&headers, &what, make).await
}

async fn ground(
    service: &Service,
    collection: &Collection,
    window: &Window,
    selection: &Selection,
) -> Result<Samples, Problem> {
    let Window { origin_m, step_m, shape } = *window;
    let samples = service.samples(collection, origin_m, step_m, shape, selection, Piece::of(shape)).await?;
    if samples.is_void() {
        let [west, south, east, north] = collection.grid().bounds_m();
        return Err(Problem::not_found(format!(
            "no data in this window; \"{}\" covers x = {west:.2} to {east:.2} m, y = {south:.2} to {north:.2} m, possibly with voids",
            collection.id
        )));
    }
    Ok(samples)
}

/// `GET /v1/collections/{id}/study`: a study section that reproduces the patch.
pub async fn snippet(State(service): State<Arc<Service>>, On(collection): On, pairs: Pairs) -> Result<String, Problem> {
    let query = pairs.checked(&[&["origin", "center", "size", "size_m", "resolution_m"]])?;
    let Ground::World(world) = &collection.ground else {
        let id = &collection.id;
        return Err(Problem::bad_request(format!("\"{id}\" comes from a release; use the study.toml of the release")));
    };
    let window = Window::of(&query, &collection, service.limits.samples)?;
    let [rows, cols] = window.shape;
    world.snippet(window.origin_m, [cols, rows], window.step_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples lie at the centres of cells: the south-west one at the origin of the window.
    #[test]
    fn val_samples_are_centres_of_cells() {
        let geometry = Window { origin_m: [1.0, 2.0], shape: [3, 4], step_m: 0.5 }.geometry();
        assert_eq!((geometry.rows, geometry.cols, geometry.cell), (3, 4, [0.5; 2]));
        assert_eq!([geometry.x(0), geometry.x(3)], [1.0, 2.5]);
        assert_eq!([geometry.y(2), geometry.y(0)], [2.0, 3.0]);
    }

    fn query(pairs: &[(&str, &str)]) -> Query {
        Query::new(pairs.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect(), &KNOWN).unwrap()
    }

    #[test]
    fn val_the_sun_stands_above_the_horizon() {
        let at = |elevation: &str| sun(&query(&[("sun_azimuth_deg", "90"), ("sun_elevation_deg", elevation)]));
        assert_eq!(at("30").unwrap(), Sun { azimuth_deg: 90.0, elevation_deg: 30.0 });
        assert!(["0", "-5", "90.1", "nan"].iter().all(|elevation| at(elevation).is_err()));
        assert_eq!(sun(&query(&[])).unwrap(), Sun::default());
    }
}
