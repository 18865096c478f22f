//! Stage `photoclinometry`: recovers a surface from its images.

use super::image::{DESCRIPTION, IMAGE};
use super::original::{self, INPUT_STAGE, Original};
use super::rasters::{raster_options, raster_packing};
use super::{fit, image};
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield, Image, InputPlace, unknown_id};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::operations::dem::input_error;
use crate::operations::photoclinometry::{self, Beside, Made, Map, read_description, read_image, read_points, refusal};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::entry::joined;
use crate::study::{Entry, Expanded, StudyError};
use sastrugi_imaging::photoclinometry::{Coarse, HeightPoint, Settings, check_lights};
use sastrugi_numeric::{Streams, sums};
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::{GeoTiff, PhotoclinometryItem};
use sastrugi_schemas::tables::{PhotoclinometryBandRow, PhotoclinometryRow};
use sastrugi_store::{altimetry, dem, digest};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "photoclinometry";
/// Approximate time of a cell of one image in a round, s.
const SECONDS_PER_SAMPLE: f64 = 4.5e-7;
/// Approximate time of a cell in one perturbed solution, s.
const SECONDS_PER_PERTURBED: f64 = 1.1e-6;
/// Memory of a cell without its images, bytes.
const BYTES_PER_CELL: u64 = 600;
/// Memory of a cell of the surface with which the result is compared, bytes: its heights, and those heights resampled to the map.
const BYTES_PER_TRUE_CELL: u64 = 24;
/// Memory of a cell of one image, bytes.
const BYTES_PER_SAMPLE: u64 = 48;

/// The one kind of inversion.
pub fn kinds() -> Vec<Kind> {
    vec![photoclinometry::kind()]
}

struct PhotoclinometryJob {
    id: String,
    item_id: String,
    variant: Option<String>,
    group: Option<String>,
    surface: (String, ItemRef),
    images: Vec<Image>,
    coarse: Option<(ItemRef, f64)>,
    altimetry: Option<Altimetry>,
    settings: Settings,
    streams: Streams,
    cells: u64,
    /// Number of cells of the surface that the images show.
    truth_cells: u64,
    geotiff: GeoTiff,
}

/// Measured points, copied from a file next to the study.
#[derive(Clone)]
struct Altimetry {
    item: ItemRef,
    release_path: String,
    /// Most memory for reading it, bytes.
    reading_bytes: u64,
}

/// Adds the items of `[[photoclinometry]]`, and the fits to the surfaces they recover.
///
/// # Errors
/// An invalid item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    builder.each(STAGE, add_table)?;
    fit::add_of_recovered(builder)
}

fn add_table(builder: &mut Builder<'_>, entry: &Entry<'_>) -> Result<(), BuildError> {
    let (item, params): (PhotoclinometryItem, Value) = entry.read()?;
    entry.check_keys::<PhotoclinometryItem>(&params, &schema_of::<Settings>())?;
    let expanded = entry.expand(&item.id, None, &item.sweep, &params)?;
    let inverted = expanded.iter().map(|one| settings_of(entry, one)).collect::<Result<Vec<_>, _>>()?;
    let by_surface = images_by_surface(builder, entry, &item)?;
    let coarse = coarse(builder, entry, &item)?;
    let altimetry = altimetry(builder, entry, &item)?;
    let mut ids = Vec::new();
    for (k, (one, settings)) in expanded.iter().zip(&inverted).enumerate() {
        for (j, (surface, images)) in by_surface.iter().enumerate() {
            check_suns(entry, images, settings)?;
            let id = if by_surface.len() == 1 { one.id.clone() } else { format!("{}-{surface}", one.id) };
            builder.claim(entry, STAGE, &id)?;
            let number = (k * by_surface.len() + j) as u64;
            let streams = builder.streams(STAGE, &id, item.seed, number);
            let field = builder.surface(entry, "images", surface)?.clone();
            let job = PhotoclinometryJob {
                id: id.clone(),
                item_id: item.id.clone(),
                variant: joined(field.variant.as_deref(), one.sweep.as_deref()),
                group: item.group.clone().or_else(|| field.group.clone().filter(|_| field.is_grouped)),
                surface: (surface.clone(), field.item.clone()),
                images: images.clone(),
                coarse: coarse.clone(),
                altimetry: altimetry.clone(),
                cells: cells(&field, settings, images),
                truth_cells: field.cells,
                settings: settings.clone(),
                streams,
                geotiff: builder.study.head.geotiff,
            };
            add_one(builder, one, field, job)?;
            ids.push(id);
        }
    }
    builder.name_family(entry, &item.id, ids)?;
    Ok(())
}

/// The settings of an inversion.
fn settings_of(entry: &Entry<'_>, one: &Expanded) -> Result<Settings, StudyError> {
    let settings: Settings = read_parameters(&one.params).map_err(|e| entry.refuse(e))?;
    settings.check().map_err(|e| entry.refuse(e))?;
    Ok(settings)
}

/// Adds a surface to the graph and to the heightfields.
fn add_one(
    builder: &mut Builder<'_>,
    one: &Expanded,
    truth: Heightfield,
    job: PhotoclinometryJob,
) -> Result<(), BuildError> {
    let item = ItemRef::new(STAGE, &job.id);
    let field = Heightfield {
        item: item.clone(),
        group: job.group.clone().or_else(|| one.sweep.clone()),
        is_grouped: job.group.is_some() || one.sweep.is_some(),
        variant: job.variant.clone().filter(|_| job.group.is_some()),
        replicate: truth.replicate,
        kind: STAGE.to_owned(),
        parameters: Arc::new(job.recipe()),
        streams: Some(job.streams.clone()),
        release_path: job.released("tif"),
        cells: job.cells,
        raster_cells: None,
        cell_m: job.settings.cell_m,
        geometry: None,
        expected: None,
    };
    let images = job.images.iter().map(|i| &i.item);
    let known = [job.coarse.as_ref().map(|(item, _)| item), job.altimetry.as_ref().map(|points| &points.item)];
    let others = [&job.surface.1].into_iter().chain(known.into_iter().flatten());
    let parents: BTreeSet<ItemRef> = others.chain(images).cloned().collect();
    let stream = Some(job.streams.label());
    let id = job.id.clone();
    let parents = parents.into_iter().collect();
    builder.node(Node { item, parents, inputs: Vec::new(), stream, job: Box::new(job) })?;
    builder.heightfields.insert(id, field);
    Ok(())
}

/// The images of each surface, in the order of the study.
fn images_by_surface(
    builder: &Builder<'_>,
    entry: &Entry<'_>,
    item: &PhotoclinometryItem,
) -> Result<Vec<(String, Vec<Image>)>, BuildError> {
    let mut by_surface: Vec<(String, Vec<Image>)> = Vec::new();
    for (k, id) in item.images.iter().enumerate() {
        let key = format!("images.{k}");
        let Some(images) = builder.images.get(id) else {
            return Err(unknown_id(entry, &key, id, builder.images.keys()).into());
        };
        for image in images {
            match by_surface.iter_mut().find(|(surface, _)| *surface == image.surface) {
                Some((_, known)) if known.contains(image) => {
                    return Err(entry.error(&key, format!("the image \"{}\" is named twice", image.id)).into());
                }
                Some((_, known)) => known.push(image.clone()),
                None => by_surface.push((image.surface.clone(), vec![image.clone()])),
            }
        }
    }
    match by_surface.iter().find(|(_, images)| images.len() < 3) {
        Some((surface, images)) => {
            let message = format!(
                "`images` has {} of \"{surface}\"; at least 3 are needed to determine two slopes and an albedo",
                images.len()
            );
            Err(entry.error("images", message).into())
        }
        None if by_surface.is_empty() => Err(entry.error("images", "`images` is empty; at least 3 are needed").into()),
        None => Ok(by_surface),
    }
}

/// Refuses sun directions, as given to the inversion, that cannot separate slopes from albedo.
fn check_suns(entry: &Entry<'_>, images: &[Image], settings: &Settings) -> Result<(), BuildError> {
    let sun = |(k, image): (usize, &Image)| match k {
        0 => settings.first_image_errors.sun(image.sun).direction(),
        _ => image.sun.direction(),
    };
    let lights: Vec<_> = images.iter().enumerate().map(sun).collect();
    check_lights(&lights).map_err(|e| entry.error("images", e.to_string()).into())
}

/// A copy of the measured points in the release.
fn altimetry(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    item: &PhotoclinometryItem,
) -> Result<Option<Altimetry>, BuildError> {
    let Some(file) = &item.altimetry else { return Ok(None) };
    let id = format!("{}-altimetry", item.id);
    let copy = Original::of(&format!("input/{id}"), &builder.study.folder, file)?;
    let release_path = copy.release_path().to_owned();
    let node = copy.node(INPUT_STAGE, &id);
    let path = builder.study.folder.join(file);
    let reading_bytes = altimetry::reading_bytes(&path).map_err(|e| BuildError::reading(&path, e))?;
    let made = Altimetry { item: node.item.clone(), release_path: release_path.clone(), reading_bytes };
    builder.node(node)?;
    builder.inputs.push(InputPlace { key: entry.path_of("altimetry"), release_path });
    Ok(Some(made))
}

/// The coarse DEM with its standard deviation.
fn coarse(
    builder: &Builder<'_>,
    entry: &Entry<'_>,
    item: &PhotoclinometryItem,
) -> Result<Option<(ItemRef, f64)>, BuildError> {
    match (&item.coarse, item.coarse_sigma_m) {
        (None, None) => Ok(None),
        (Some(id), Some(sigma_m)) if sigma_m.is_finite() && sigma_m > 0.0 => {
            Ok(Some((builder.surface(entry, "coarse", id)?.item.clone(), sigma_m)))
        }
        (Some(_), Some(sigma_m)) => {
            Err(entry.error("coarse_sigma_m", format!("`coarse_sigma_m` is {sigma_m}; it must be above 0")).into())
        }
        (Some(_), None) => {
            Err(entry.error("coarse", "`coarse` needs `coarse_sigma_m`, the standard deviation of its heights").into())
        }
        (None, Some(_)) => {
            Err(entry.error("coarse_sigma_m", "`coarse_sigma_m` describes `coarse`, which is missing").into())
        }
    }
}

/// Approximate number of cells of the map: the number of pixels of the largest image, unless `cell_m` is given.
fn cells(truth: &Heightfield, settings: &Settings, images: &[Image]) -> u64 {
    match truth.expected.zip(settings.cell_m) {
        Some((g, cell_m)) => (g.size()[0] * g.size()[1] / (cell_m * cell_m)) as u64,
        None => images.iter().map(|image| image.pixels).max().unwrap_or(truth.cells),
    }
}

impl PhotoclinometryJob {
    fn released(&self, ending: &str) -> String {
        format!("photoclinometry/{}.{ending}", self.id)
    }

    /// The measured points. Messages are part of the release, so they use the file's path in the release.
    fn points(&self, work: &Work<'_>) -> Result<Vec<HeightPoint>, JobError> {
        let Some(Altimetry { item, release_path, .. }) = &self.altimetry else { return Ok(Vec::new()) };
        let path = work.parent(item, original::name(release_path))?;
        read_points(&path).map_err(|e| e.reworded(|words| words.replace(&path.display().to_string(), release_path)))
    }

    fn made(&self, work: &Work<'_>) -> Result<Made, JobError> {
        let mut images = Vec::new();
        for image in &self.images {
            let description = read_description(&work.parent(&image.item, DESCRIPTION)?)?;
            images.push(read_image(description, &work.parent(&image.item, IMAGE)?)?);
        }
        let heights = |item: &ItemRef| Ok(dem::read(&work.parent(item, HEIGHTS)?).map_err(input_error)?.grid);
        let coarse = match &self.coarse {
            Some((item, sigma_m)) => Some(Coarse { dem: heights(item)?, sigma_m: *sigma_m }),
            None => None,
        };
        let points = self.points(work)?;
        let beside = Beside { truth: Some(heights(&self.surface.1)?), coarse, points, level_m: None };
        photoclinometry::make(images, beside, &self.settings, &self.streams).map_err(|e| refusal(&e))
    }

    fn row(&self, made: &Made) -> PhotoclinometryRow {
        let r = &made.recovered;
        let last = r.rounds.last();
        let known = |values: &[f64]| sums::finite(values);
        let sigma = r
            .height_sigma
            .as_ref()
            .map_or(f64::NAN, |s| sums::mean(&known(&s.values).iter().map(|v| v * v).collect::<Vec<_>>()).sqrt());
        let e = made.evaluation;
        let metric =
            |of: fn(&sastrugi_imaging::photoclinometry::evaluation::Evaluation) -> f64| e.as_ref().map_or(f64::NAN, of);
        PhotoclinometryRow {
            photoclinometry_id: self.id.clone(),
            item_id: self.item_id.clone(),
            variant: self.variant.clone(),
            group: self.group.clone(),
            surface_id: self.surface.0.clone(),
            images: self.images.len() as i64,
            rows: made.geometry.rows as i64,
            cols: made.geometry.cols as i64,
            cell_m: made.geometry.mean_cell(),
            rounds: r.rounds.len() as i64,
            converged: r.converged,
            brightness_rms: last.map_or(f64::NAN, |r| r.brightness_rms),
            change_m: last.map_or(f64::NAN, |r| r.change_m),
            stereo_points: last.map_or(0, |r| r.stereo_points as i64),
            lit_mean: sums::mean(&r.lit.map(f64::from).values),
            share_leaning: made.recovered.share_leaning,
            condition: sums::median(&known(&r.condition.values)),
            albedo_slope_correlation: sums::median(&known(&r.albedo_slope_correlation.values)),
            noise_scale: r.noise_scale,
            height_sigma_m: sigma,
            albedo_mean: sums::mean(&known(&r.albedo.values)),
            cells: e.map(|e| e.cells as i64),
            shaded_correlation: metric(|e| e.shaded_correlation),
            shaded_correlation_ceiling: metric(|e| e.shaded_correlation_ceiling),
            slope_error_rms: metric(|e| e.slope_error_rms),
            slope_error_rms_ceiling: metric(|e| e.slope_error_rms_ceiling),
            slope_rms: metric(|e| e.slope_rms),
            height_error_rms_m: metric(|e| e.height_error_rms_m),
            height_error_rms_detrended_m: metric(|e| e.height_error_rms_detrended_m),
            height_rms_m: metric(|e| e.height_rms_m),
            path: self.released("tif"),
        }
    }

    fn band_rows(&self, made: &Made) -> Vec<PhotoclinometryBandRow> {
        let row = |b: &sastrugi_imaging::photoclinometry::evaluation::Band| PhotoclinometryBandRow {
            photoclinometry_id: self.id.clone(),
            octave: b.octave as i64,
            wavelength_min_m: b.wavelength_min_m,
            wavelength_max_m: b.wavelength_max_m,
            modes: b.modes as i64,
            truth_rms_m: b.truth_rms_m,
            recovered_rms_m: b.recovered_rms_m,
            truth_slope_rms: b.truth_slope_rms,
            recovered_slope_rms: b.recovered_slope_rms,
            covariance_m2: b.covariance_m2,
            coherence: b.coherence,
        };
        made.bands.iter().map(row).collect()
    }
}

impl Job for PhotoclinometryJob {
    fn recipe(&self) -> Value {
        let images: Vec<&String> = self.images.iter().map(|i| &i.id).collect();
        let coarse = self.coarse.as_ref().map(|(item, sigma_m)| json!({ "dem": item.to_string(), "sigma_m": sigma_m }));
        json!({
            "id": self.id,
            "item": self.item_id,
            "variant": self.variant,
            "group": self.group,
            "surface": self.surface.0,
            "images": images,
            "coarse": coarse,
            "altimetry": self.altimetry.as_ref().map(|points| &points.release_path),
            "settings": self.settings,
        })
    }

    fn packing(&self) -> Value {
        raster_packing(self.geotiff)
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Imaging]
    }

    fn memory_bytes(&self) -> u64 {
        let map = self.cells * (BYTES_PER_CELL + BYTES_PER_SAMPLE * self.images.len() as u64);
        let points = self.altimetry.as_ref().map_or(0, |points| points.reading_bytes);
        (32 << 20) + map + BYTES_PER_TRUE_CELL * self.truth_cells + points
    }

    fn estimate(&self) -> Estimate {
        let cells = self.cells as f64;
        let rounds = 3.0 * SECONDS_PER_SAMPLE * self.images.len() as f64;
        let samples = SECONDS_PER_PERTURBED * self.settings.samples as f64;
        Estimate { seconds: cells * (rounds + samples), bytes: 24.0 * cells }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let made = self.made(work)?;
        let beside = |map: Map| {
            let file = work.output(map.ending);
            (map, file)
        };
        let maps: Vec<_> = made.maps().into_iter().map(beside).collect();
        let targets = maps.iter().map(|(map, file)| (map, file.into()));
        let mut notes = made.write((&work.output(HEIGHTS)).into(), targets, &raster_options(self.geotiff))?;
        notes.extend(made.recovered.warnings.iter().cloned());
        let content = digest::heights(&made.recovered.heights);
        let mut products = vec![Product::released(HEIGHTS, self.released("tif"), Some(content))];
        let product =
            |map: &Map| Product::released(map.ending, self.released(map.ending), Some(digest::heights(&map.values)));
        products.extend(maps.iter().map(|(map, _)| product(map)));
        let mut outcome = Outcome { products, notes };
        outcome.write_rows(work, [self.row(&made)])?;
        outcome.write_rows(work, self.band_rows(&made))?;
        Ok(outcome)
    }
}

/// True if the id names a recovered surface, or if it is unknown so far and the study declares recovered surfaces.
pub(super) fn may_be_recovered(builder: &Builder<'_>, id: &str) -> bool {
    let sections = [STAGE, image::STAGE];
    let declared = sections.iter().all(|s| builder.study.entries(s).is_ok_and(|entries| !entries.is_empty()));
    match builder.heightfields.get(id) {
        Some(field) => field.item.stage == STAGE,
        None => declared,
    }
}
