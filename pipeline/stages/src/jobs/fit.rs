//! Stage `fit`: fits a covariance model to a DEM.

use super::dem as measured;
use super::mask::{self, Mask};
use super::photoclinometry;
use super::rasters::Raster;
use super::surface::{Surface, SurfaceRows};
use crate::builder::{BuildError, Builder, HEIGHTS};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::operations::dem::input_error;
use crate::operations::fits::{
    candidate_rows, check_noise_reference, covariance_rows, curve_rows, fit_row, noise_reference, profile_rows,
    to_json, with_source,
};
use crate::operations::place::{PLACE, Place};
use crate::operations::{coregistration, masks};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::{Entry, Expanded, StudyError};
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::Kind;
use sastrugi_schemas::coregistration::Minus;
use sastrugi_schemas::fit::{MaskSource, Source};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::FitItem;
use sastrugi_store::dem::{Crs, Dem};
use sastrugi_store::{dem, digest};
use sastrugi_texture::coregister::Coregistered;
use sastrugi_texture::noise::Noise;
use sastrugi_texture::{FitError, FitParameters, FitSettings, Measured, shown};
use serde_json::{Value, json};

/// Name of the stage.
pub const STAGE: &str = "fit";
/// Fit file.
pub const FIT: &str = "fit.json";
/// The background that was subtracted.
pub const BACKGROUND: &str = "background.tif";
const RESIDUAL: &str = "residual.tif";
const MASK: &str = "mask.tif";
/// Covariance at every lag; the coordinates of the raster are the lags.
const MAP: &str = "covariance.tif";

/// Approximate time to describe one cell of the residual and to write the rasters, s.
const SECONDS_PER_DESCRIBED_CELL: f64 = 1e-6;

/// The one kind of fit.
pub fn kinds() -> Vec<Kind> {
    sastrugi_texture::kinds().into_iter().filter(|k| k.family == STAGE).collect()
}

/// The DEM of a fit, and everything else that its residual depends on.
#[derive(Clone)]
pub struct Site {
    dem_id: String,
    dem: ItemRef,
    masks: Vec<Mask>,
    source: Source,
    noise_reference: Option<Mask>,
    minus: Option<Subtrahend>,
    settings: FitSettings,
    cells: u64,
    cell_m: Option<f64>,
    /// Memory for the cells that a mask selects, bytes.
    selection_bytes: u64,
}

/// The DEM of a fit as it is fitted.
struct Fitted {
    dem: Dem,
    settings: FitSettings,
    source: Source,
    notes: Vec<String>,
}

impl Site {
    /// The items that it is read from, the DEM first.
    pub fn parents(&self) -> Vec<ItemRef> {
        let others = self.masks.iter().chain(&self.noise_reference).map(|m| &m.item);
        [&self.dem].into_iter().chain(others).chain(self.minus.iter().map(|m| &m.dem.item)).cloned().collect()
    }

    /// Reads the DEM: masked, and minus another if there is one.
    fn read(&self, work: &Work<'_>) -> Result<Fitted, JobError> {
        let mut dem = dem::read(&work.parent(&self.dem, HEIGHTS)?).map_err(input_error)?;
        let mut settings = self.settings.clone();
        let mut notes = Vec::new();
        let mut source = self.source.clone();
        if let Some(reference) = &self.noise_reference {
            let noise = mask::noise_of_item(&dem.grid, &self.dem, reference, work)?;
            settings = settings.with_noise(&noise.noise).map_err(JobError::input)?;
            notes.push(masks::noise_note(&noise));
            let MaskSource { file, sha256, .. } = &reference.source;
            source.noise_reference = Some(noise_reference(file, sha256, &noise));
        }
        source.masked_share = mask::of_item(&mut dem.grid, &self.dem, &self.masks, work)?;
        notes.extend(source.masked_share.map(masks::share_note));
        if let Some(subtrahend) = &self.minus {
            let (difference, minus) = subtrahend.subtract(&self.dem, &dem, work)?;
            dem.grid = difference;
            notes.push(coregistration::sentence(&minus));
            source.minus = Some(minus);
        }
        Ok(Fitted { dem, settings, source, notes })
    }

    /// The residual as the fit computes it, before trimming.
    ///
    /// # Errors
    /// A DEM, mask or difference that cannot be read.
    pub fn residual(&self, work: &Work<'_>) -> Result<Measured, JobError> {
        let Fitted { dem, settings, .. } = self.read(work)?;
        Ok(Measured { residual: sastrugi_texture::residual(&dem.grid, &settings).map_err(JobError::new)? })
    }

    /// Most bytes that [`Self::residual`] needs: heights and residual, and the passes over them; or what is needed while they are read.
    pub fn memory_bytes(&self) -> u64 {
        let detrending = 8 * self.cells + self.settings.memory_bytes(self.cells, self.cell_m, 0);
        8 * self.cells + detrending.max(self.reading_bytes())
    }

    /// Most bytes that [`Self::read`] needs besides the heights. Masks, the noise reference and the other DEM are read one after the other.
    fn reading_bytes(&self) -> u64 {
        let largest = self.masks.iter().chain(&self.noise_reference).map(|mask| mask.reading_bytes).max();
        // The noise is that of a copy of the heights.
        let masked = largest.map_or(0, |bytes| bytes + self.selection_bytes + 8 * self.cells);
        // Co-registration takes 80 bytes per cell of the first DEM, and the difference 8.
        let subtracted = self.minus.as_ref().map_or(0, |minus| minus.dem.bytes + 88 * self.cells);
        masked.max(subtracted)
    }

    /// Number of cells.
    pub fn cells(&self) -> u64 {
        self.cells
    }
}

struct FitJob {
    id: String,
    site: Site,
    streams: Streams,
    /// Shape and position of the DEM, if known before the run.
    place: Option<Geometry>,
    /// Whether it was measured, and so may have holes.
    is_measured: bool,
}

/// A DEM that is co-registered to the fitted one and subtracted.
#[derive(Clone)]
struct Subtrahend {
    id: String,
    dem: Raster,
    source: Source,
}

impl Subtrahend {
    fn of(builder: &Builder<'_>, entry: &Entry<'_>, id: &str) -> Result<Self, BuildError> {
        let field = builder.surface(entry, "minus", id)?;
        let source = builder.source_of(id, field);
        Ok(Self { id: id.to_owned(), dem: field.into(), source })
    }

    /// The DEM of an item minus this one.
    fn subtract(&self, item: &ItemRef, dem: &Dem, work: &Work<'_>) -> Result<(Grid, Minus), JobError> {
        let other = self.dem.read(work)?;
        for (item, heights) in [(item, &dem.grid), (&self.dem.item, &other.grid)] {
            let place = Place::read(&work.parent(item, PLACE)?, &heights.geometry)?;
            if place.was_converted(&heights.geometry) {
                return Err(JobError::input(format!("{}: {}", item.id, coregistration::IN_DEGREES)));
            }
        }
        let Coregistered { difference, coregistration } = coregistration::coregistered(dem, &other)?;
        let Source { file, sha256, .. } = self.source.clone();
        Ok((difference, Minus { file, sha256, coregistration }))
    }
}

/// Adds the items of `[[fit]]`.
///
/// # Errors
/// An invalid item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    add_where(builder, false)
}

/// Adds the fits to surfaces recovered from images. They come after the fits to DEMs and terrains, because textures may come between the two.
///
/// # Errors
/// As [`add`].
pub fn add_of_recovered(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    add_where(builder, true)
}

fn add_where(builder: &mut Builder<'_>, recovered: bool) -> Result<(), BuildError> {
    builder.each(STAGE, |builder, entry| add_table(builder, entry, recovered))
}

fn add_table(builder: &mut Builder<'_>, entry: &Entry<'_>, recovered: bool) -> Result<(), BuildError> {
    let (item, params): (FitItem, Value) = entry.read()?;
    if photoclinometry::may_be_recovered(builder, &item.dem) != recovered {
        return Ok(());
    }
    entry.check_keys::<FitItem>(&params, &schema_of::<FitParameters>())?;
    check_noise_reference(item.noise_reference.is_some(), item.minus.is_some()).map_err(|e| entry.refuse(e))?;
    let expanded = entry.expand(&item.id, None, &item.sweep, &params)?;
    let settings = expanded.iter().map(|one| settings_of(entry, &item, one)).collect::<Result<Vec<_>, _>>()?;
    let field = builder.surface(entry, "dem", &item.dem)?.clone();
    if let Some(place) = &field.expected {
        settings.iter().try_for_each(|settings| check_place(entry, settings, place))?;
    }
    expanded.iter().try_for_each(|one| builder.claim(entry, STAGE, &one.id))?;
    let masks = mask::add(builder, entry, &item)?;
    let noise_reference = mask::add_noise_reference(builder, entry, &item)?;
    let mask_sources = masks.iter().map(|m| m.source.clone()).collect();
    let source = Source { masks: mask_sources, ..builder.source_of(&item.dem, &field) };
    let minus = item.minus.as_ref().map(|id| Subtrahend::of(builder, entry, id)).transpose()?;
    for (one, settings) in expanded.into_iter().zip(settings) {
        builder
            .prospects
            .insert(one.id.clone(), settings.prospect(field.expected.map(|place| place.cell), field.cells));
        let site = Site {
            dem_id: item.dem.clone(),
            dem: field.item.clone(),
            masks: masks.clone(),
            source: source.clone(),
            noise_reference: noise_reference.clone(),
            minus: minus.clone(),
            settings,
            cells: field.cells,
            cell_m: field.cell_m,
            selection_bytes: mask::selection_bytes(&field),
        };
        builder.sites.insert(one.id.clone(), site.clone());
        let parents = site.parents();
        let job = FitJob {
            id: one.id.clone(),
            site,
            streams: builder.streams(STAGE, &one.id, item.seed, 0),
            place: field.expected,
            is_measured: field.item.stage == measured::STAGE,
        };
        let node = Node {
            item: ItemRef::new(STAGE, &one.id),
            parents,
            inputs: Vec::new(),
            stream: Some(job.streams.label()),
            job: Box::new(job),
        };
        builder.node(node)?;
        builder.fits.push(one.id);
    }
    Ok(())
}

/// Refuses settings that a fit of a DEM of this shape would refuse.
fn check_place(entry: &Entry<'_>, settings: &FitSettings, dem: &Geometry) -> Result<(), StudyError> {
    settings.check_place(dem).map_err(|error| match error {
        FitError::Parameter(parameter) => entry.refuse(parameter),
        other => entry.error("outer_scale_m", other.to_string()),
    })
}

/// The settings of a fit.
fn settings_of(entry: &Entry<'_>, item: &FitItem, one: &Expanded) -> Result<FitSettings, StudyError> {
    let raw: FitParameters = read_parameters(&one.params).map_err(|e| entry.refuse(e))?;
    let settings = FitSettings::try_from(raw).map_err(|e| entry.refuse(e))?;
    if item.noise_reference.is_some() {
        // The noise itself is known only when the reference is read; whether the settings accept one can be checked now.
        settings
            .with_noise(&Noise { white_sigma_m: f64::MIN_POSITIVE, ..Noise::default() })
            .map_err(|e| entry.refuse(e))?;
    }
    Ok(settings)
}

impl Job for FitJob {
    fn recipe(&self) -> Value {
        let site = &self.site;
        let minus = site.minus.as_ref().map(|m| json!({ "dem": m.id, "source": m.source }));
        let noise_reference = site.noise_reference.as_ref().map(|n| &n.source);
        json!({
            "dem": site.dem_id,
            "source": site.source,
            "noise_reference": noise_reference,
            "minus": minus,
            "fit": site.settings.parameters(),
        })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Roughness, Room::Statistics, Room::Texture]
    }

    fn memory_bytes(&self) -> u64 {
        // After the fit: background, residual, mask and the statistics of the residual take 81 bytes per cell.
        let Site { settings, cells, cell_m, .. } = &self.site;
        let fit = settings.memory_bytes(*cells, *cell_m, rayon::current_num_threads() as u64);
        8 * cells + fit.max((256 << 20) + 81 * cells).max(self.site.reading_bytes())
    }

    fn estimate(&self) -> Estimate {
        let Site { settings, cells, .. } = &self.site;
        let fit = settings.seconds(*cells, self.place.as_ref(), self.is_measured);
        Estimate { seconds: fit + SECONDS_PER_DESCRIBED_CELL * *cells as f64, bytes: 1e6 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let Fitted { dem: read, settings, source, mut notes } = self.site.read(work)?;
        // The co-registration is a result even if the fit fails, so the error reports it.
        let failed = |e: FitError| match &source.minus {
            Some(minus) => JobError::new(format!("{e}; {}", coregistration::sentence(minus))),
            None => JobError::new(e),
        };
        let outcome = sastrugi_texture::fit(&read.grid, &settings, &self.streams).map_err(failed)?;
        let [background, residual] = outcome.rasters(&read.grid).map_err(JobError::new)?;
        let mask = shown::uses(&read.grid, &residual, &outcome);
        let band = shown::covariance_band(&residual, &outcome);
        let map = outcome.covariance_map();
        let fit = with_source(outcome.fit, source);
        // The verdict comes first because the summary of a run shows it. Warnings are in the fit file and the table.
        notes.insert(0, fit.verdict.clone());
        work.write(FIT, to_json(&fit)?.as_bytes())?;
        let id = &self.id;
        let mut products = vec![Product::released(FIT, format!("fit/{id}.json"), None)];
        for (file, grid) in [(BACKGROUND, &background), (RESIDUAL, &residual)] {
            dem::write(&work.output(file), grid, &read.info.crs, &Default::default()).map_err(JobError::io)?;
            products.push(Product::released(file, format!("fit/{id}.{file}"), Some(digest::heights(grid))));
        }
        dem::write(&work.output(MAP), &map, &Crs::default(), &Default::default()).map_err(JobError::io)?;
        products.push(Product::released(MAP, format!("fit/{id}.{MAP}"), Some(digest::heights(&map))));
        dem::write_classes(&work.output(MASK), &mask, &read.info.crs).map_err(JobError::io)?;
        products.push(Product::released(MASK, format!("fit/{id}.{MASK}"), Some(digest::classes(&mask))));
        let surface = Surface { id, stage: STAGE, fit_id: Some(id), grid: &residual };
        let mut outcome = Outcome { products, notes };
        outcome.write_rows(work, [fit_row(id, &self.site.dem_id, &fit)])?;
        outcome.write_rows(work, covariance_rows(id, &fit, &band))?;
        outcome.write_rows(work, candidate_rows(id, &fit))?;
        outcome.write_rows(work, curve_rows(id, &fit))?;
        outcome.write_rows(work, profile_rows(id, &fit))?;
        SurfaceRows::of_residual(&surface, &fit).write(work, &mut outcome)?;
        Ok(outcome)
    }
}
