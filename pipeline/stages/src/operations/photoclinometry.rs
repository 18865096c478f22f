//! Heights from images as files: the same for studies and verbs.

use crate::job::JobError;
use crate::operations::dem::input_error;
use sastrugi_imaging::ImageDescription;
use sastrugi_imaging::photoclinometry::evaluation::{self, Band, Evaluation};
use sastrugi_imaging::photoclinometry::{Coarse, Known, RecoverError, Recovered, Settings, described, recover};
use sastrugi_numeric::{Geometry, Grid, Streams, Surface, sums};
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_store::atomic::Target;
use sastrugi_store::dem::{self, Crs, Values, WriteOptions};
use std::path::Path;

/// The one kind of inversion.
pub fn kind() -> Kind {
    Kind {
        family: "photoclinometry",
        kind: "photoclinometry",
        summary: "heights, albedo and their uncertainty from three or more registered images",
        source: "JPL synthetic terrain environment, section 2.3; Horn and Brooks (1986); numbers: our choice",
        parameters: schema_of::<Settings>(),
    }
}

/// An image with its description.
pub struct Described {
    /// Sun, camera and the rest.
    pub description: ImageDescription,
    /// Pixels, rows from the top.
    pub pixels: Vec<f64>,
    /// Coordinate system of the image, if it is a map.
    pub crs: Crs,
}

/// Reads a description, the JSON beside an image.
///
/// # Errors
/// A file that is missing or is no description.
pub fn read_description(path: &Path) -> Result<ImageDescription, JobError> {
    let text = std::fs::read(path).map_err(|e| JobError::input(format!("{}: {e}", path.display())))?;
    let wrong = |e: String| JobError::input(format!("{}: {e}", path.display()));
    let value = serde_json::from_slice(&text).map_err(|e| wrong(e.to_string()))?;
    let description: ImageDescription = read_parameters(&value).map_err(|e| wrong(e.to_string()))?;
    description.check().map_err(|e| wrong(e.to_string()))?;
    Ok(description)
}

/// Reads the pixels of an image.
///
/// # Errors
/// A raster that is missing, or of another size than its camera.
pub fn read_image(description: ImageDescription, path: &Path) -> Result<Described, JobError> {
    let raster = dem::read(path).map_err(input_error)?;
    let [rows, cols] = description.camera.camera().shape();
    let g = raster.grid.geometry;
    if (g.rows, g.cols) != (rows, cols) {
        let found = format!("{} x {} pixels, its camera {rows} x {cols}", g.rows, g.cols);
        return Err(JobError::input(format!("{}: the image has {found} (rows x columns)", path.display())));
    }
    Ok(Described { description, pixels: raster.grid.values, crs: raster.info.crs })
}

/// What else is known.
#[derive(Default)]
pub struct Beside {
    /// The true surface, to compare with.
    pub truth: Option<Grid>,
    /// A coarse DEM.
    pub coarse: Option<Coarse>,
    /// Height of level ground where rounds begin, m; what the middles of the images show when absent.
    pub level_m: Option<f64>,
}

/// A surface recovered, and how like the truth it is.
pub struct Made {
    /// The surface.
    pub recovered: Recovered,
    /// Its map.
    pub geometry: Geometry,
    /// Coordinate system of the images.
    pub crs: Crs,
    /// Comparison with the truth.
    pub evaluation: Option<Evaluation>,
    /// The same by wavelength.
    pub bands: Vec<Band>,
}

/// Recovers a surface.
///
/// # Errors
/// Images that do not determine it, a map without cells.
pub fn make(
    images: Vec<Described>,
    beside: Beside,
    settings: &Settings,
    streams: &Streams,
) -> Result<Made, RecoverError> {
    if images.len() < 3 {
        return Err(RecoverError::TooFewImages(images.len()));
    }
    let mut settings = settings.clone();
    let first = &images[0].description;
    let noise = (!first.noise.is_none()).then_some(first.noise);
    (settings.photometry, settings.noise) = (settings.photometry.or(Some(first.photometry)), settings.noise.or(noise));
    let poses: Vec<_> = images.iter().map(|i| i.description.camera).collect();
    let levels: Vec<f64> = poses.iter().map(described::level_m).collect();
    let level_m = beside.level_m.unwrap_or_else(|| sums::mean(&levels));
    let geometry = described::map(&poses, level_m, &settings)?;
    let crs = images.iter().map(|i| &i.crs).find(|crs| **crs != Crs::default()).cloned().unwrap_or_default();
    let stack = images.into_iter().map(|i| (i.description, i.pixels)).collect();
    let images = described::images(stack, &settings.first_image_errors);
    let start = start(&geometry, beside.coarse.as_ref(), level_m);
    let known = Known { points: Vec::new(), coarse: beside.coarse };
    let recovered = recover(&images, &start, &known, &settings, streams)?;
    let photometry = settings.photometry.unwrap_or_default();
    let (light, view) = (images[0].light, [0.0, 0.0, 1.0]);
    let heights = &recovered.heights;
    let truth = beside.truth.as_ref();
    let evaluation = truth.and_then(|truth| evaluation::evaluate(truth, heights, &photometry, light, view));
    let bands = truth.map(|truth| evaluation::bands(truth, heights)).unwrap_or_default();
    Ok(Made { recovered, geometry, crs, evaluation, bands })
}

/// Where rounds begin: the coarse DEM, as far as it goes, else level ground.
fn start(g: &Geometry, coarse: Option<&Coarse>, level_m: f64) -> Grid {
    let dem = coarse.map(|c| &c.dem).filter(|dem| dem.rows() >= 2 && dem.cols() >= 2);
    let level_m = dem.map_or(level_m, |dem| sums::mean(&sums::finite(&dem.values)));
    let at = |k: usize| {
        let d = &dem?.geometry;
        let x = g.x(k % g.cols).clamp(d.x(0), d.x(d.cols - 1));
        let y = g.y(k / g.cols).clamp(d.y(d.rows - 1), d.y(0));
        dem?.height(x, y)
    };
    Grid::new(*g, (0..g.len()).map(|k| at(k).unwrap_or(level_m)).collect())
}

/// Where the files of a surface go.
pub struct Files<'a> {
    /// Heights.
    pub heights: Target<'a>,
    /// Albedo.
    pub albedo: Target<'a>,
    /// Standard deviation of heights.
    pub uncertainty: Target<'a>,
    /// Images that show each cell lit.
    pub lit: Target<'a>,
}

impl Made {
    /// The rasters beside the heights: albedo, standard deviation of heights if it was asked for, lit images.
    pub fn maps(&self) -> [Option<Grid>; 3] {
        let lit = self.recovered.lit.map(f64::from);
        [Some(self.recovered.albedo.clone()), self.recovered.height_sigma.clone(), Some(lit)]
    }

    /// Writes the surface and its maps; returns sentences on what the format of the heights lost.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, files: Files<'_>, options: &WriteOptions) -> Result<Vec<String>, JobError> {
        let notes = dem::write(files.heights, &self.recovered.heights, &self.crs, options).map_err(JobError::io)?;
        let described = [
            ("1", "albedo"),
            ("m", "standard deviation of the height"),
            ("1", "number of images that show the cell lit"),
        ];
        for ((target, map), (unit, description)) in
            [files.albedo, files.uncertainty, files.lit].into_iter().zip(self.maps()).zip(described)
        {
            let Some(map) = map else { continue };
            let values = Values::Figures { unit: unit.into(), description: description.into() };
            dem::write(target, &map, &self.crs, &WriteOptions { values, ..options.clone() }).map_err(JobError::io)?;
        }
        Ok(notes)
    }

    /// Share of the cells that lean on the albedo of their neighbours.
    pub fn share_leaning(&self) -> f64 {
        let leaning = &self.recovered.leaning.values;
        leaning.iter().filter(|l| **l).count() as f64 / leaning.len() as f64
    }
}

/// Errors of the images are input, the others the caller's.
pub fn refusal(error: &RecoverError) -> JobError {
    match error {
        RecoverError::Setting(_) | RecoverError::TooFewImages(_) => JobError::new(error),
        _ => JobError::input(error),
    }
}
