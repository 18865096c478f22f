//! Recovers heights from image files. Shared by studies and verbs.

use crate::job::JobError;
use crate::operations::dem::input_error;
use sastrugi_imaging::photoclinometry::evaluation::{self, Band, Evaluation};
use sastrugi_imaging::photoclinometry::{
    Coarse, HeightPoint, Known, RecoverError, Recovered, Settings, described, recover,
};
use sastrugi_imaging::{CameraPose, ImageDescription};
use sastrugi_numeric::{Geometry, Grid, Streams, Surface, sums};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::{Kind, counted};
use sastrugi_store::altimetry;
use sastrugi_store::atomic::Target;
use sastrugi_store::dem::{self, Crs, Values, WriteOptions};
use std::path::Path;

/// Maps next to the heights: suffix of the file name after the id, unit, and description.
pub const MAPS: [(&str, &str, &str); 7] = [
    ("albedo.tif", "1", "albedo"),
    ("uncertainty.tif", "m", "standard deviation of the height"),
    ("lit.tif", "1", "number of images in which the cell is lit"),
    ("slope-sigma.tif", "1", "standard deviation of the slope (root of the sum of both variances)"),
    ("albedo-sigma.tif", "1", "standard deviation of the albedo"),
    ("condition.tif", "1", "condition number of the equations of the cell; no data where they are underdetermined"),
    ("leaning.tif", "1", "1 where the albedo relies on that of neighbours, 0 elsewhere"),
];
/// Minimum width of a pixel in cells of the truth for images to be independent of the recovered surface.
const TRUTH_CELLS_MIN: f64 = 4.0;

/// The one kind of inversion.
pub fn kind() -> Kind {
    Kind {
        family: "photoclinometry",
        kind: "photoclinometry",
        summary: "heights, albedo and their uncertainty from three or more registered images",
        source: "JPL synthetic terrain environment, section 2.3; Horn and Brooks (1986); default values are our choice",
        parameters: schema_of::<Settings>(),
    }
}

/// An image with its description.
pub struct Described {
    /// Sun, camera, photometry and noise.
    pub description: ImageDescription,
    /// Pixels, rows from the top.
    pub pixels: Vec<f64>,
    /// Coordinate system of the image, if it is a map.
    pub crs: Crs,
}

/// Reads the description of an image, the JSON file next to it.
///
/// # Errors
/// A file that is missing or not a description.
pub fn read_description(path: &Path) -> Result<ImageDescription, JobError> {
    let text = sastrugi_store::file::read(path).map_err(|e| JobError::input(format!("{}: {e}", path.display())))?;
    let invalid = |e: String| JobError::input(format!("{}: {e}", path.display()));
    let value = serde_json::from_slice(&text).map_err(|e| invalid(e.to_string()))?;
    let description: ImageDescription = read_parameters(&value).map_err(|e| invalid(e.to_string()))?;
    description.check().map_err(|e| invalid(e.to_string()))?;
    Ok(description)
}

/// Reads the pixels of an image.
///
/// # Errors
/// A raster that is missing, or whose size differs from that of its camera.
pub fn read_image(description: ImageDescription, path: &Path) -> Result<Described, JobError> {
    let raster = dem::read(path).map_err(input_error)?;
    let [rows, cols] = description.camera.camera().shape();
    let g = raster.grid.geometry;
    if (g.rows, g.cols) != (rows, cols) {
        let found = format!("{} x {} pixels but its camera has {rows} x {cols}", g.rows, g.cols);
        return Err(JobError::input(format!("{}: the image has {found} (rows x columns)", path.display())));
    }
    Ok(Described { description, pixels: raster.grid.values, crs: raster.info.crs })
}

/// Reads measured points, each with its standard deviation.
///
/// # Errors
/// A file that is missing or contains no such points, or a point without a standard deviation above 0.
pub fn read_points(path: &Path) -> Result<Vec<HeightPoint>, JobError> {
    let points = altimetry::read(path).map_err(input_error)?;
    let one = |(k, [x_m, y_m, height_m, sigma_m]): (usize, [f64; 4])| {
        if sigma_m > 0.0 {
            return Ok(HeightPoint { x_m, y_m, height_m, sigma_m });
        }
        let message = format!(
            "{}: point {} has no `sigma` above 0; the column `sigma` must hold the standard deviation of each height, m",
            path.display(),
            k + 1
        );
        Err(JobError::input(message))
    };
    points.into_iter().enumerate().map(one).collect()
}

/// Other data on the surface.
#[derive(Default)]
pub struct Beside {
    /// The true surface, for comparison.
    pub truth: Option<Grid>,
    /// A coarse DEM.
    pub coarse: Option<Coarse>,
    /// Measured points.
    pub points: Vec<HeightPoint>,
    /// Height of the level ground from which iteration starts, m; if absent, that shown at the centres of the images.
    pub level_m: Option<f64>,
}

/// A recovered surface, and its comparison with the truth.
pub struct Made {
    /// The surface.
    pub recovered: Recovered,
    /// Geometry of its map.
    pub geometry: Geometry,
    /// Coordinate system of the images.
    pub crs: Crs,
    /// Comparison with the truth.
    pub evaluation: Option<Evaluation>,
    /// Comparison by wavelength.
    pub bands: Vec<Band>,
}

/// Recovers a surface.
///
/// # Errors
/// Images that do not determine the surface, or a map without cells.
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
    // Truth and result are shaded with the photometry and light of the first image, even if a sweep changes those of the inversion.
    let (photometry, light) = (first.photometry, first.sun.direction());
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
    let aside = beside.coarse.as_ref().filter(|coarse| !holds_any(&geometry, &coarse.dem));
    let aside = aside.map(|_| "the coarse DEM has no cell on the map, so it constrains nothing".to_owned());
    let known = Known { points: beside.points, coarse: beside.coarse };
    let mut recovered = recover(&images, &start, &known, &settings, streams)?;
    let truth = beside.truth.as_ref();
    let heights = &recovered.heights;
    let evaluation = truth.and_then(|truth| evaluation::evaluate(truth, heights, &photometry, light, [0.0, 0.0, 1.0]));
    let note = match (truth, evaluation) {
        (Some(truth), Some(_)) => same_cells(truth, &poses, &geometry),
        (Some(_), None) => Some("the true surface and the map share too few cells for a comparison".to_owned()),
        (None, _) => None,
    };
    let bands = truth.map(|truth| evaluation::bands(truth, heights)).unwrap_or_default();
    recovered.warnings.extend(note);
    recovered.warnings.extend(aside);
    Ok(Made { recovered, geometry, crs, evaluation, bands })
}

/// Whether any cell of a DEM with data has its centre on the map.
fn holds_any(map: &Geometry, dem: &Grid) -> bool {
    let on_map = |k: usize| map.cell_at(dem.geometry.x(k % dem.cols()), dem.geometry.y(k / dem.cols())).is_some();
    (0..dem.values.len()).any(|k| dem.values[k].is_finite() && on_map(k))
}

/// A note if a pixel is less than four cells of the truth wide.
fn same_cells(truth: &Grid, poses: &[CameraPose], map: &Geometry) -> Option<String> {
    let pixel_m = poses.iter().filter_map(CameraPose::pixel_m).reduce(f64::min).unwrap_or(map.mean_cell());
    let cells = pixel_m / truth.geometry.mean_cell();
    (cells < TRUTH_CELLS_MIN - 1e-6).then(|| {
        format!(
            "a pixel is {} of the true surface wide, fewer than {TRUTH_CELLS_MIN}: images rendered from it contain little relief below the pixel size, and \
             errors are underestimated",
            counted(significant(cells), "cell")
        )
    })
}

/// Rounds to three significant digits.
fn significant(value: f64) -> f64 {
    let scale = libm::pow(10.0, 2.0 - libm::floor(libm::log10(value)));
    (value * scale).round() / scale
}

/// The surface from which iteration starts: the coarse DEM where it has data, otherwise level ground.
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

/// A raster next to the heights.
pub struct Map {
    /// Suffix of its file name after the id.
    pub ending: &'static str,
    unit: &'static str,
    description: &'static str,
    /// Values on the cells of the heights.
    pub values: Grid,
}

impl Map {
    /// Writes the raster.
    ///
    /// # Errors
    /// A file that cannot be written.
    fn write(&self, target: Target<'_>, crs: &Crs, options: &WriteOptions) -> Result<(), JobError> {
        let values = Values::Quantity { unit: self.unit.into(), description: self.description.into() };
        let options = WriteOptions { values, ..options.clone() };
        dem::write(target, &self.values, crs, &options).map(|_| ()).map_err(JobError::io)
    }
}

impl Made {
    /// The rasters next to the heights, in the order of [`MAPS`]; the standard deviation of heights only if it was computed.
    pub fn maps(&self) -> Vec<Map> {
        let r = &self.recovered;
        let of = |f: &dyn Fn(&[f64; 6]) -> f64| Grid::new(self.geometry, r.covariances.iter().map(f).collect());
        let values = [
            Some(r.albedo.clone()),
            r.height_sigma.clone(),
            Some(r.lit.map(f64::from)),
            Some(of(&|[pp, _, _, qq, ..]| (pp + qq).sqrt())),
            Some(of(&|covariance| covariance[5].sqrt())),
            Some(r.condition.map(|c| if c.is_finite() { c } else { f64::NAN })),
            Some(r.leaning.clone()),
        ];
        let map = |((ending, unit, description), values): (_, Option<Grid>)| {
            Some(Map { ending, unit, description, values: values? })
        };
        MAPS.into_iter().zip(values).filter_map(map).collect()
    }

    /// Writes the surface and its maps; returns notes on what the format of the heights could not store.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write<'a>(
        &self,
        heights: Target<'_>,
        maps: impl IntoIterator<Item = (&'a Map, Target<'a>)>,
        options: &WriteOptions,
    ) -> Result<Vec<String>, JobError> {
        // Heights are written last, so that their presence implies that of their maps.
        maps.into_iter().try_for_each(|(map, target)| map.write(target, &self.crs, options))?;
        dem::write(heights, &self.recovered.heights, &self.crs, options).map_err(JobError::io)
    }
}

/// Converts an error to that of a job: errors of the images are errors of the input, the others are the caller's.
pub fn refusal(error: &RecoverError) -> JobError {
    match error {
        RecoverError::Setting(_) | RecoverError::TooFewImages(_) => JobError::new(error),
        _ => JobError::input(error),
    }
}
