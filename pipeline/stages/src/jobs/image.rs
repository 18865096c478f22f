//! Stage `image`: renders a surface for a given sun and camera.

use super::rasters::{raster_options, raster_packing};
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield, Image};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::operations::dem::input_error;
use crate::operations::images::{self, Files, Ground, Made};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::entry::joined;
use crate::study::{Entry, Expanded, StudyError};
use sastrugi_imaging::RenderParameters;
use sastrugi_numeric::Streams;
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::{GeoTiff, ImageItem};
use sastrugi_schemas::tables::ImageRow;
use sastrugi_store::{dem, digest};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Name of the stage.
pub const STAGE: &str = "image";
/// The image, float32 brightness.
pub const IMAGE: &str = "image.tif";
/// Its description, `sastrugi_imaging::ImageDescription`.
pub const DESCRIPTION: &str = "image.json";
const PICTURE: &str = "image.png";
/// Albedo map of a terrain, next to its heights.
const ALBEDO: &str = "albedo.tif";
/// Approximate time of a ray and its shadow ray, s.
const SECONDS_PER_RAY: f64 = 5e-7;
/// Memory of a pixel, bytes: the point it sees, and the rasters derived from it.
const BYTES_PER_PIXEL: u64 = 120;
/// Memory of a cell, bytes: heights, albedo, highest points of blocks.
const BYTES_PER_CELL: u64 = 40;

/// The one kind of image.
pub fn kinds() -> Vec<Kind> {
    vec![images::kind()]
}

struct ImageJob {
    id: String,
    item_id: String,
    variant: Option<String>,
    surface_id: String,
    field: Heightfield,
    parameters: RenderParameters,
    streams: Streams,
    geotiff: GeoTiff,
}

/// Adds the items of `[[image]]`.
///
/// # Errors
/// An invalid item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    builder.each(STAGE, add_table)
}

fn add_table(builder: &mut Builder<'_>, entry: &Entry<'_>) -> Result<(), BuildError> {
    let (envelope, params): (ImageItem, Value) = entry.read()?;
    entry.check_keys::<ImageItem>(&params, &schema_of::<RenderParameters>())?;
    let expanded = entry.expand(&envelope.id, None, &envelope.sweep, &params)?;
    let rendered = expanded.iter().map(|one| parameters_of(entry, one)).collect::<Result<Vec<_>, _>>()?;
    let surfaces = builder.family(entry, "surface", &envelope.surface)?;
    for (k, (one, parameters)) in expanded.iter().zip(&rendered).enumerate() {
        for (j, surface) in surfaces.iter().enumerate() {
            let id = if surfaces.len() == 1 { one.id.clone() } else { format!("{}-{surface}", one.id) };
            builder.claim(entry, STAGE, &id)?;
            // Every image has its own noise, even within one sweep and with an explicit seed.
            let number = (k * surfaces.len() + j) as u64;
            let streams = builder.streams(STAGE, &id, envelope.seed, number);
            let pixels = pixels(builder.surface(entry, "surface", surface)?, parameters) as u64;
            let image =
                Image { item: ItemRef::new(STAGE, &id), id, pixels, surface: surface.clone(), sun: parameters.sun };
            add_one(builder, entry, &envelope, one, (image, parameters.clone(), streams))?;
        }
    }
    Ok(())
}

/// The parameters of an image.
fn parameters_of(entry: &Entry<'_>, one: &Expanded) -> Result<RenderParameters, StudyError> {
    let parameters: RenderParameters = read_parameters(&one.params).map_err(|e| entry.refuse(e))?;
    parameters.check().map_err(|e| entry.refuse(e))?;
    Ok(parameters)
}

fn add_one(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    envelope: &ImageItem,
    one: &Expanded,
    (image, parameters, streams): (Image, RenderParameters, Streams),
) -> Result<(), BuildError> {
    let field = builder.surface(entry, "surface", &image.surface)?.clone();
    let stream = (!parameters.noise.is_none()).then(|| streams.label());
    let parents = vec![field.item.clone()];
    let names: BTreeSet<&String> = [&envelope.id, &one.id, &image.id].into_iter().collect();
    for name in names {
        builder.images.entry(name.clone()).or_default().push(image.clone());
    }
    let job = ImageJob {
        id: image.id,
        item_id: envelope.id.clone(),
        variant: joined(field.variant.as_deref(), one.sweep.as_deref()),
        surface_id: image.surface,
        field,
        parameters,
        streams,
        geotiff: builder.study.head.geotiff,
    };
    builder.node(Node { item: image.item, parents, inputs: Vec::new(), stream, job: Box::new(job) })?;
    Ok(())
}

/// Approximate number of pixels of an image of a surface.
fn pixels(field: &Heightfield, parameters: &RenderParameters) -> f64 {
    let size = field.expected.map(|g| (g.size(), g.mean_cell()));
    size.map_or(field.cells as f64, |(size, cell)| parameters.camera.pixels(size, cell))
}

impl ImageJob {
    /// Number of rays.
    fn rays(&self) -> f64 {
        self.pixels() * f64::from(self.parameters.samples * self.parameters.samples)
    }

    fn pixels(&self) -> f64 {
        pixels(&self.field, &self.parameters)
    }

    fn ground(&self, work: &Work<'_>) -> Result<Ground, JobError> {
        let heights = dem::read(&work.parent(&self.field.item, HEIGHTS)?).map_err(input_error)?;
        let albedo = images::map(&work.parent(&self.field.item, ALBEDO)?)?;
        let albedo_name = albedo.as_ref().map(|_| format!("{}.albedo", self.surface_id));
        let name = self.surface_id.clone();
        Ok(Ground { heights: heights.grid, albedo, crs: heights.info.crs, name, albedo_name })
    }

    fn released(&self, ending: &str) -> String {
        format!("image/{}.{ending}", self.id)
    }

    fn row(&self, made: &Made) -> ImageRow {
        let (p, [rows, cols]) = (&self.parameters, made.shape());
        let rendered = made.description.rendered.as_ref();
        ImageRow {
            image_id: self.id.clone(),
            item_id: self.item_id.clone(),
            variant: self.variant.clone(),
            surface_id: self.surface_id.clone(),
            group: self.field.group.clone(),
            camera: p.camera.kind().to_owned(),
            sun_azimuth_deg: p.sun.azimuth_deg,
            sun_elevation_deg: p.sun.elevation_deg,
            rows: rows as i64,
            cols: cols as i64,
            pixel_m: made.rendering.pose.pixel_m().unwrap_or(f64::NAN),
            exposure: p.exposure,
            haze: p.haze,
            noise_relative: p.noise.relative,
            noise_absolute: p.noise.absolute,
            samples: p.samples.into(),
            has_albedo_map: rendered.is_some_and(|r| r.albedo_map.is_some()),
            mean_brightness: made.rendering.mean_brightness(),
            share_in_shadow: made.rendering.share_in_shadow(),
            share_without_ground: made.rendering.share_without_ground(),
            png_white: made.png_white,
            path: self.released("tif"),
        }
    }
}

impl Job for ImageJob {
    fn recipe(&self) -> Value {
        json!({
            "id": self.id,
            "item": self.item_id,
            "variant": self.variant,
            "surface": self.surface_id,
            "group": self.field.group,
            "parameters": self.parameters,
        })
    }

    fn packing(&self) -> Value {
        raster_packing(self.geotiff)
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Imaging]
    }

    fn memory_bytes(&self) -> u64 {
        BYTES_PER_CELL * self.field.cells + BYTES_PER_PIXEL * self.pixels() as u64
    }

    fn estimate(&self) -> Estimate {
        Estimate { seconds: SECONDS_PER_RAY * self.rays(), bytes: 5.0 * self.pixels() }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let ground = self.ground(work)?;
        let file = format!("{}.tif", self.id);
        let made = images::make(&ground, &self.parameters, &self.streams, &file).map_err(JobError::new)?;
        let (tif, json, png) = (work.output(IMAGE), work.output(DESCRIPTION), work.output(PICTURE));
        let files = Files { tif: Some((&tif).into()), json: Some((&json).into()), png: Some((&png).into()) };
        made.write(files, &ground.crs, &raster_options(self.geotiff))?;
        let content = digest::heights(&made.rendering.image());
        let products = vec![
            Product::released(IMAGE, self.released("tif"), Some(content)),
            Product::released(DESCRIPTION, self.released("json"), None),
            Product::released(PICTURE, self.released("png"), None),
        ];
        let mut outcome = Outcome { products, notes: Vec::new() };
        outcome.write_rows(work, [self.row(&made)])?;
        Ok(outcome)
    }
}
