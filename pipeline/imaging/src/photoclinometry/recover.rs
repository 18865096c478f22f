//! The rounds of an inversion.

use super::calibration;
use super::cell::{Fit, Prior, Problem, Sample};
use super::integration::{Constraint, HeightPoint, Stop, System};
use super::normal::Symmetric3;
use super::observation::{Calibration, Image, Observed, Relief, Stack};
use super::params::{Integration, NOISE, Settings};
use super::paths::integrate_along_paths;
use super::stereo;
use super::uncertainty;
use crate::description::Noise;
use crate::direction::Vector;
use crate::photometry::Photometry;
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid, Streams, sums};
use sastrugi_schemas::{ParameterError, counted};

/// Lights closer to one plane than this are refused: smallest over largest singular value of their unit vectors.
const COPLANAR: f64 = 0.002;
/// Condition number on level ground above which a warning is issued.
const CONDITION_WARNING: f64 = 20.0;
/// Largest distance, in cells, of neighbours from which a poorly lit cell takes its albedo.
const NEIGHBOURS_MAX: usize = 16;
/// Smallest spread of that albedo, relative to it.
const ALBEDO_SPREAD_MIN: f64 = 0.05;
/// Exposures have converged when their relative change is below this.
const CALIBRATION_TOLERANCE: f64 = 1e-5;
/// Smallest number of degrees of freedom for estimating the noise from residuals.
const FREEDOM_MIN: usize = 30;

/// A coarse DEM as a soft constraint.
#[derive(Clone, Debug, PartialEq)]
pub struct Coarse {
    /// Heights, m; each cell holds the mean over its area.
    pub dem: Grid,
    /// Standard deviation of a cell's height, m.
    pub sigma_m: f64,
}

/// Heights known in addition to the images.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Known {
    /// Points, such as from stereo or an altimeter.
    pub points: Vec<HeightPoint>,
    /// A coarse DEM.
    pub coarse: Option<Coarse>,
}

/// Statistics of one round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Round {
    /// Rms difference between the observed brightness and that of the integrated surface, as a share of the mean brightness.
    pub brightness_rms: f64,
    /// Rms change of heights, m.
    pub change_m: f64,
    /// Iterations of the integration (0 along paths).
    pub iterations: usize,
    /// Stereo points used.
    pub stereo_points: usize,
}

/// The result of an inversion.
#[derive(Clone, Debug, PartialEq)]
pub struct Recovered {
    /// Heights, m; NaN where no image shows the cell, or no path reaches it.
    pub heights: Grid,
    /// Slopes from the least squares, before integration to a surface.
    pub slopes: Vec<[f64; 2]>,
    /// Albedo; NaN where no image shows the cell.
    pub albedo: Grid,
    /// Covariance of `p`, `q` and albedo: `[pp, pq, pa, qq, qa, aa]`; NaN where unknown.
    pub covariances: Vec<[f64; 6]>,
    /// Standard deviation of heights, m (without constraints, of heights minus their mean); `None` if it was not requested.
    pub height_sigma: Option<Grid>,
    /// Number of images in which each cell is lit.
    pub lit: Grid<u8>,
    /// 1 in cells that take their albedo from their neighbours (lit in fewer than three images, or too poorly conditioned), 0 in others; NaN
    /// where no image shows the cell.
    pub leaning: Grid,
    /// Mean of `leaning` over the cells that an image shows.
    pub share_leaning: f64,
    /// Condition number of each cell's equations; infinite where they are underdetermined.
    pub condition: Grid,
    /// Multiple correlation of albedo and slopes of each cell.
    pub albedo_slope_correlation: Grid,
    /// Exposure and haze of every image.
    pub calibrations: Vec<Calibration>,
    /// Estimated noise relative to the assumed noise, from cells lit in four or more images; 1 if it was not estimated.
    pub noise_scale: f64,
    /// Statistics of every round.
    pub rounds: Vec<Round>,
    /// True if the heights converged within the allowed rounds.
    pub converged: bool,
    /// Warnings for the caller.
    pub warnings: Vec<String>,
}

/// Why the surface could not be recovered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecoverError {
    /// A setting is out of bounds.
    #[error(transparent)]
    Setting(#[from] ParameterError),
    /// Not enough images.
    #[error("{} cannot determine two slopes and an albedo; at least 3 are needed", counted(.0, "image"))]
    TooFewImages(usize),
    /// Lights lie in one plane.
    #[error(
        "the suns lie in one plane (smallest over largest singular value: {ratio:.1e}), so the slope across it cannot be separated from albedo; \
         spread them in azimuth, such as 0, 120 and 240 deg"
    )]
    CoplanarLights {
        /// Smallest over largest singular value of the unit vectors to the lights.
        ratio: f64,
    },
    /// A sun that is not above the horizon.
    #[error("the sun of image {0} is not above the horizon")]
    SunBelowHorizon(usize),
    /// The wrong number of pixels.
    #[error("image {image} has {}, its camera {expected}; they must be equal", counted(.found, "pixel"))]
    Size {
        /// Number of the image, from 1.
        image: usize,
        /// Pixels of its camera.
        expected: usize,
        /// Pixels of the image.
        found: usize,
    },
    /// Numbers that are not finite.
    #[error("{0} is not finite")]
    NotFinite(String),
    /// The map is too small.
    #[error("a map of {0} x {1} cells is too small; it must have at least 4 x 4 cells")]
    SmallMap(usize, usize),
    /// No cell is lit in three images.
    #[error(
        "no cell is lit in three images; look for images that are dark or show other ground, or have a wrong exposure, haze or camera"
    )]
    NothingLit,
    /// No cell is conditioned well enough.
    #[error(
        "no cell has a condition number below {condition_max} (the smallest is {least:.0}); spread the suns in azimuth (0, 120, 240 deg), give \
         `albedo` if it is known, or raise `condition_max`"
    )]
    NothingFirm {
        /// Smallest condition number of a cell.
        least: f64,
        /// Limit of the condition number.
        condition_max: f64,
    },
    /// Too many cells take their albedo from their neighbours.
    #[error(
        "{percent:.1} % of the cells would take their albedo from their neighbours ({dark:.1} % are lit in fewer than three images, {ill:.1} % have a \
         condition number above {condition_max}); the limit is {most:.0} %: use three or more suns spread in azimuth (0, 120, 240 deg) that light most of \
         the ground, give `albedo` if it is known, or raise `leaning_max`"
    )]
    MostlyLeaning {
        /// Share of the cells that an image shows, %.
        percent: f64,
        /// Share lit in fewer than three images, %.
        dark: f64,
        /// Share with poorly conditioned equations, %.
        ill: f64,
        /// Limit of the condition number.
        condition_max: f64,
        /// Largest share allowed, %.
        most: f64,
    },
}

/// Heights and albedo on the cells of `start`, whose heights are the initial surface.
///
/// # Errors
/// Images that do not determine slopes and albedo, have the wrong size or hold numbers that are not finite; settings out of bounds.
///
/// ```
/// use sastrugi_imaging::photoclinometry::{Known, RecoverError, Settings, recover};
/// use sastrugi_numeric::{Geometry, Grid, Streams};
///
/// // The example of the crate shows an inversion; without images it is refused.
/// let start = Grid::filled(Geometry::square(8, 8, 1.0), 0.0);
/// let found = recover(&[], &start, &Known::default(), &Settings::default(), &Streams::for_seed(1, "example"));
/// assert_eq!(found.unwrap_err(), RecoverError::TooFewImages(0));
/// ```
pub fn recover(
    images: &[Image],
    start: &Grid,
    known: &Known,
    settings: &Settings,
    streams: &Streams,
) -> Result<Recovered, RecoverError> {
    settings.check()?;
    check(images, start, known)?;
    let mut inversion = Inversion::new(images, start, known, settings, streams);
    inversion.warn_of_condition();
    while inversion.rounds.len() < settings.rounds && !inversion.converged {
        inversion.round()?;
    }
    Ok(inversion.finished())
}

fn check(images: &[Image], start: &Grid, known: &Known) -> Result<(), RecoverError> {
    if images.len() < 3 {
        return Err(RecoverError::TooFewImages(images.len()));
    }
    if start.rows() < 4 || start.cols() < 4 {
        return Err(RecoverError::SmallMap(start.rows(), start.cols()));
    }
    if start.finite_count() < start.values.len() {
        return Err(RecoverError::NotFinite("a height of the start".to_owned()));
    }
    let points = known.points.iter().flat_map(|p| [p.x_m, p.y_m, p.height_m, p.sigma_m]);
    let sigmas = known.points.iter().map(|p| p.sigma_m).chain(known.coarse.as_ref().map(|c| c.sigma_m));
    if points.into_iter().any(|v| !v.is_finite()) || sigmas.into_iter().any(|s| !s.is_finite() || s <= 0.0) {
        return Err(RecoverError::NotFinite("a known height or its standard deviation".to_owned()));
    }
    for (k, image) in images.iter().enumerate() {
        let [rows, cols] = image.camera.shape();
        if image.brightness.len() != rows * cols {
            return Err(RecoverError::Size { image: k + 1, expected: rows * cols, found: image.brightness.len() });
        }
        let numbers = image.light.into_iter().chain([image.exposure, image.haze]);
        if numbers.into_iter().any(|v| !v.is_finite()) || image.exposure <= 0.0 {
            return Err(RecoverError::NotFinite(format!("light, exposure or haze of image {}", k + 1)));
        }
        if image.brightness.iter().any(|v| v.is_infinite()) || image.median().is_nan() {
            return Err(RecoverError::NotFinite(format!("brightness of image {}", k + 1)));
        }
        if image.light[2] <= 0.0 {
            return Err(RecoverError::SunBelowHorizon(k + 1));
        }
    }
    check_lights(&images.iter().map(|image| image.light).collect::<Vec<_>>())
}

/// Rejects lights whose unit vectors lie in one plane.
///
/// # Errors
/// Lights in one plane.
///
/// ```
/// use sastrugi_imaging::direction;
/// use sastrugi_imaging::photoclinometry::check_lights;
///
/// assert!(check_lights(&[0.0, 120.0, 240.0].map(|azimuth| direction(azimuth, 45.0))).is_ok());
/// // North, south and straight above.
/// assert!(check_lights(&[direction(0.0, 45.0), direction(180.0, 45.0), direction(0.0, 90.0)]).is_err());
/// ```
pub fn check_lights(lights: &[Vector]) -> Result<(), RecoverError> {
    let mut normal = Symmetric3::default();
    lights.iter().for_each(|light| normal.add(*light, 1.0));
    let ratio = 1.0 / normal.condition();
    if ratio < COPLANAR { Err(RecoverError::CoplanarLights { ratio }) } else { Ok(()) }
}

/// The solution of a cell.
#[derive(Clone, Copy, Debug)]
struct Cell {
    fit: Fit,
    lit: u8,
    leaning: bool,
}

struct Inversion<'a> {
    images: &'a [Image],
    geometry: Geometry,
    start: &'a Grid,
    settings: &'a Settings,
    streams: &'a Streams,
    known: Vec<Constraint>,
    calibrations: Vec<Calibration>,
    noise: Noise,
    photometry: Photometry,
    noise_scale: f64,
    heights_m: Vec<f64>,
    cells: Vec<Option<Cell>>,
    /// Cells with slopes that no path reached in some round.
    unreached: Vec<bool>,
    system: Option<System>,
    rounds: Vec<Round>,
    converged: bool,
    warnings: Vec<String>,
}

impl<'a> Inversion<'a> {
    fn new(images: &'a [Image], start: &'a Grid, known: &Known, settings: &'a Settings, streams: &'a Streams) -> Self {
        let g = start.geometry;
        let mut constraints: Vec<Constraint> = known.points.iter().filter_map(|p| Constraint::point(&g, p)).collect();
        let mut warnings = Vec::new();
        let beyond = known.points.len() - constraints.len();
        if beyond > 0 {
            warnings.push(format!("ignored {beyond} of {} off the map", counted(known.points.len(), "point")));
        }
        if let Some(coarse) = &known.coarse {
            constraints.extend(Constraint::coarse(&g, &coarse.dem, coarse.sigma_m));
        }
        Self {
            images,
            geometry: g,
            start,
            settings,
            streams,
            known: constraints,
            calibrations: images.iter().map(|i| Calibration { exposure: i.exposure, haze: i.haze }).collect(),
            noise: settings.noise.unwrap_or(NOISE),
            photometry: settings.photometry.unwrap_or_default(),
            noise_scale: 1.0,
            heights_m: start.values.clone(),
            cells: vec![None; g.len()],
            unreached: vec![false; g.len()],
            system: None,
            rounds: Vec::new(),
            converged: false,
            warnings,
        }
    }

    /// Warns if a level cell in the middle of the map, lit in all images, is poorly conditioned.
    fn warn_of_condition(&mut self) {
        let g = &self.geometry;
        let relief = Relief { geometry: g, heights_m: &self.heights_m };
        let middle = relief.point(g.len() / 2 + g.cols / 2);
        let samples: Vec<Sample> = self
            .images
            .iter()
            .map(|image| {
                let view = image.camera.view_from(middle);
                let brightness = self.photometry.of_slopes([0.0; 2], image.light, view);
                Sample { brightness, sigma: 0.01 * brightness.max(1e-3), light: image.light, view }
            })
            .collect();
        let problem = Problem {
            photometry: &self.photometry,
            samples: &samples,
            prior: None,
            fixed_albedo: self.settings.albedo,
        };
        let condition = problem.solve(Some([0.0, 0.0, 1.0])).map_or(f64::INFINITY, |fit| fit.condition);
        if condition > CONDITION_WARNING {
            self.warnings.push(format!(
                "these sun positions barely separate slopes from albedo: the condition number on level ground is {condition:.0}"
            ));
        }
    }

    fn round(&mut self) -> Result<(), RecoverError> {
        let relief = Relief { geometry: &self.geometry, heights_m: &self.heights_m };
        let observed: Vec<Observed> = self.images.iter().map(|image| Observed::new(image, relief)).collect();
        let shadows: Vec<f64> = self
            .images
            .iter()
            .zip(&self.calibrations)
            .map(|(image, c)| c.haze + self.settings.shadow * (image.median() - c.haze).max(0.0))
            .collect();
        let stack = Stack {
            images: self.images,
            calibrations: &self.calibrations,
            observed: &observed,
            shadows: &shadows,
            noise: self.noise,
        };
        let cells = self.fit_cells(&stack, relief)?;
        self.check_leaning(&cells)?;
        let scale = self.estimated_noise(&cells);
        let slopes: Vec<[f64; 2]> = cells.iter().map(|cell| cell.map_or([0.0; 2], |c| c.fit.slopes)).collect();
        let information = information(&self.geometry, &cells);
        let points = self.stereo_points(&cells, relief);
        let mut constraints = self.known.clone();
        constraints.extend(points.iter().filter_map(|p| Constraint::point(&self.geometry, p)));
        let tied = !constraints.is_empty();
        let system = System::new(self.geometry, &information, constraints);
        let (mut heights_m, iterations) = self.integrate(&system, &slopes, &information);
        if !tied || self.settings.integration == Integration::Paths {
            let known = heights_m.iter().zip(&self.start.values).filter(|(z, _)| z.is_finite());
            let shift = sums::mean(&known.map(|(z, start)| start - z).collect::<Vec<_>>());
            heights_m.iter_mut().for_each(|z| *z += shift);
        }
        let change: Vec<f64> = heights_m.iter().zip(&self.heights_m).map(|(a, b)| (a - b) * (a - b)).collect();
        let change_m = sums::mean(&sums::finite(&change)).sqrt();
        let unreached: Vec<bool> =
            (0..heights_m.len()).map(|k| self.unreached[k] || (cells[k].is_some() && heights_m[k].is_nan())).collect();
        let predicted = Relief { geometry: &self.geometry, heights_m: &heights_m };
        let albedo: Vec<f64> = cells.iter().map(|c| c.map_or(f64::NAN, |c| c.fit.albedo)).collect();
        let brightness_rms = calibration::brightness_rms(&stack, &self.photometry, predicted, &albedo);
        let free = self.settings.free_exposure || self.settings.free_haze;
        let mut drift = 0.0;
        let mut calibrations = self.calibrations.clone();
        if free {
            let plane = self.mean_plane(&system, &slopes, &information);
            let free = [self.settings.free_exposure, self.settings.free_haze];
            let next = calibration::update(&stack, &self.photometry, predicted, &albedo, plane, free);
            drift = calibration::drift(&calibrations, &next);
            calibrations = next;
        }
        let rests = change_m < self.settings.tolerance * self.geometry.mean_cell();
        self.converged = rests && drift < CALIBRATION_TOLERANCE;
        self.rounds.push(Round { brightness_rms, change_m, iterations, stereo_points: points.len() });
        self.noise_scale = scale;
        self.unreached = unreached;
        (self.cells, self.heights_m, self.system, self.calibrations) = (cells, heights_m, Some(system), calibrations);
        Ok(())
    }

    /// Mean plane to which exposures are fitted: without constraints that of the start, otherwise that of the slopes alone, tilted to fit the
    /// constraints. `None` if the constraints determine no tilt, or only hazes are free: then the surface is not tilted.
    fn mean_plane(&self, system: &System, slopes: &[[f64; 2]], information: &[Option<[f64; 3]>]) -> Option<[f64; 2]> {
        if !system.tied() || self.settings.integration == Integration::Paths {
            return Some(calibration::plane(&self.geometry, &self.start.values));
        }
        if !self.settings.free_exposure {
            return None;
        }
        let alone = System::new(self.geometry, information, Vec::new());
        let heights_m = alone.solve(&alone.right_side(slopes, &[]), None, Stop::COARSE).heights_m;
        let [p, q] = calibration::plane(&self.geometry, &heights_m);
        let tilt = calibration::plane_through(&system.residuals(&heights_m))?;
        Some([p + tilt[0], q + tilt[1]])
    }

    /// Rejects an inversion in which too many cells take their albedo from their neighbours.
    fn check_leaning(&self, cells: &[Option<Cell>]) -> Result<(), RecoverError> {
        let shown = cells.iter().flatten().count() as f64;
        let percent =
            |of: &dyn Fn(&Cell) -> bool| 100.0 * cells.iter().flatten().filter(|c| of(c)).count() as f64 / shown;
        let (leaning, most) = (percent(&|c| c.leaning), 100.0 * self.settings.leaning_max);
        if self.settings.albedo.is_some() || leaning <= most {
            return Ok(());
        }
        Err(RecoverError::MostlyLeaning {
            percent: leaning,
            dark: percent(&|c| c.leaning && c.lit < 3),
            ill: percent(&|c| c.leaning && c.lit >= 3),
            condition_max: self.settings.condition_max,
            most,
        })
    }

    /// Fits first the cells lit in three or more images, then the others with the albedo of such cells around them.
    fn fit_cells(&self, stack: &Stack, relief: Relief) -> Result<Vec<Option<Cell>>, RecoverError> {
        let fixed = self.settings.albedo;
        let solve = |k: usize, samples: &mut Vec<Sample>, prior: Option<Prior>| {
            samples.clear();
            samples.extend((0..self.images.len()).filter_map(|image| stack.sample(image, k, relief)));
            if prior.is_none() && samples.len() < 3 {
                return None;
            }
            let start = if prior.is_some() { None } else { self.cells[k].map(|c| guess(&c.fit)) };
            let problem = Problem { photometry: &self.photometry, samples, prior, fixed_albedo: fixed };
            let fit = problem.solve(start)?;
            Some(Cell { fit, lit: samples.len().min(usize::from(u8::MAX)) as u8, leaning: prior.is_some() })
        };
        let cells = (0..self.geometry.len()).into_par_iter().with_min_len(256);
        let lit: Vec<Option<Cell>> = cells.clone().map_init(Vec::new, |samples, k| solve(k, samples, None)).collect();
        let firm = self.firm(lit)?;
        let albedos: Vec<f64> = firm.iter().flatten().map(|c| c.fit.albedo).collect();
        let global = [sums::mean(&albedos), sums::variance(&albedos).sqrt()];
        Ok(cells
            .map_init(Vec::new, |samples, k| match firm[k] {
                Some(cell) => Some(cell),
                None if stack.seen(k) => {
                    let albedo = albedo_around(&self.geometry, &firm, k).unwrap_or(global);
                    let albedo = [albedo[0], albedo[1].max(ALBEDO_SPREAD_MIN * albedo[0])];
                    let prior = Prior { albedo, slopes: relief.slopes(k), slope_sigma: self.settings.slope_prior };
                    solve(k, samples, Some(prior))
                }
                None => None,
            })
            .collect())
    }

    /// Keeps the cells lit in three or more images that are well enough conditioned.
    fn firm(&self, mut lit: Vec<Option<Cell>>) -> Result<Vec<Option<Cell>>, RecoverError> {
        let condition_max = self.settings.condition_max;
        let least = lit.iter().flatten().map(|c| c.fit.condition).reduce(f64::min).ok_or(RecoverError::NothingLit)?;
        if least >= condition_max {
            return Err(RecoverError::NothingFirm { least, condition_max });
        }
        lit.iter_mut().for_each(|cell| *cell = cell.filter(|c| c.fit.condition < condition_max));
        Ok(lit)
    }

    /// Square root of the sum of squared residuals divided by its expectation.
    fn estimated_noise(&self, cells: &[Option<Cell>]) -> f64 {
        if !self.settings.estimate_noise {
            return 1.0;
        }
        let unknowns = if self.settings.albedo.is_some() { 2 } else { 3 };
        let firm = || cells.iter().flatten().filter(|c| !c.leaning && usize::from(c.lit) > unknowns);
        let freedom: usize = firm().map(|c| usize::from(c.lit) - unknowns).sum();
        let squares: Vec<f64> = firm().map(|c| c.fit.chi_square).collect();
        if freedom < FREEDOM_MIN { 1.0 } else { (sums::sum(&squares) / freedom as f64).sqrt() }
    }

    /// Stereo points from the albedo of this round's cells, and from the slopes of the integrated surface once there is one. Empty if not
    /// requested.
    fn stereo_points(&self, cells: &[Option<Cell>], relief: Relief) -> Vec<HeightPoint> {
        let Some(settings) = &self.settings.stereo else { return Vec::new() };
        let surface = |k: usize| {
            let cell = cells[k].filter(|c| !c.leaning)?;
            Some((if self.rounds.is_empty() { cell.fit.slopes } else { relief.slopes(k) }, cell.fit.albedo))
        };
        let shade = |image: usize, k: usize| {
            let (slopes, albedo) = surface(k)?;
            let source = &self.images[image];
            let view = source.camera.view_from(relief.point(k));
            Some(albedo * self.photometry.of_slopes(slopes, source.light, view))
        };
        stereo::points(self.images, relief, &shade, settings)
    }

    fn integrate(&self, system: &System, slopes: &[[f64; 2]], information: &[Option<[f64; 3]>]) -> (Vec<f64>, usize) {
        match self.settings.integration {
            Integration::Poisson => {
                let right = system.right_side(slopes, &system.constraint_heights());
                let start = (!self.rounds.is_empty()).then_some(&self.heights_m[..]);
                let integrated = system.solve(&right, start, Stop::FINE);
                (integrated.heights_m, integrated.iterations)
            }
            Integration::Paths => {
                let good: Vec<bool> = information.iter().map(Option::is_some).collect();
                let paths = self.settings.paths;
                (integrate_along_paths(&self.geometry, slopes, &good, paths, self.streams), 0)
            }
        }
    }

    fn finished(mut self) -> Recovered {
        let g = self.geometry;
        let of = |f: &dyn Fn(&Cell) -> f64| -> Vec<f64> {
            self.cells.iter().map(|c| c.as_ref().map_or(f64::NAN, f)).collect()
        };
        let variance = self.noise_scale * self.noise_scale;
        let covariances: Vec<[f64; 6]> =
            self.cells.iter().map(|c| c.map_or([f64::NAN; 6], |c| c.fit.covariance.0.map(|v| v * variance))).collect();
        let height_sigma = match &self.system {
            Some(system) if self.settings.samples > 0 && self.settings.integration == Integration::Poisson => {
                let sigma = uncertainty::height_sigma(system, &covariances, self.settings.samples, self.streams);
                Some(Grid::new(g, masked(sigma, &self.cells)))
            }
            _ => None,
        };
        let leaning = Grid::new(g, of(&|c| f64::from(u8::from(c.leaning))));
        let share_leaning = sums::mean(&sums::finite(&leaning.values));
        if share_leaning > 0.0 {
            let percent = 100.0 * share_leaning;
            self.warnings.push(format!("{percent:.1} % of the cells take their albedo from their neighbours"));
        }
        let unreached = self.unreached.iter().filter(|u| **u).count();
        if unreached > 0 {
            self.warnings.push(format!(
                "no path from the centre reaches {} behind holes, so heights are missing there; `integration = \"poisson\"` recovers them",
                counted(unreached, "cell")
            ));
        }
        if !self.converged {
            let last = self.rounds.last().map_or(f64::NAN, |r| r.change_m);
            self.warnings
                .push(format!("heights did not converge: they still changed by {last:.2e} m in the last round"));
        }
        Recovered {
            slopes: self.cells.iter().map(|c| c.map_or([f64::NAN; 2], |c| c.fit.slopes)).collect(),
            albedo: Grid::new(g, of(&|c| c.fit.albedo)),
            lit: Grid::new(g, self.cells.iter().map(|c| c.map_or(0, |c| c.lit)).collect()),
            condition: Grid::new(g, of(&|c| c.fit.condition)),
            albedo_slope_correlation: Grid::new(g, of(&|c| c.fit.albedo_slope_correlation())),
            heights: Grid::new(g, masked(self.heights_m, &self.cells)),
            leaning,
            share_leaning,
            covariances,
            height_sigma,
            calibrations: self.calibrations,
            noise_scale: self.noise_scale,
            rounds: self.rounds,
            converged: self.converged,
            warnings: self.warnings,
        }
    }
}

fn guess(fit: &Fit) -> [f64; 3] {
    [fit.slopes[0], fit.slopes[1], fit.albedo]
}

fn masked(values: Vec<f64>, cells: &[Option<Cell>]) -> Vec<f64> {
    values.into_iter().zip(cells).map(|(v, c)| if c.is_some() { v } else { f64::NAN }).collect()
}

/// Mean and spread of the albedo of well-conditioned cells in the smallest square around a cell (3 to 33 cells along a side) that contains
/// at least three of them.
fn albedo_around(g: &Geometry, firm: &[Option<Cell>], k: usize) -> Option<[f64; 2]> {
    let (row, col) = (k / g.cols, k % g.cols);
    [1, 2, 4, 8, NEIGHBOURS_MAX].into_iter().find_map(|reach| {
        let rows = row.saturating_sub(reach)..=(row + reach).min(g.rows - 1);
        let cols = col.saturating_sub(reach)..=(col + reach).min(g.cols - 1);
        let albedos: Vec<f64> =
            rows.flat_map(|r| cols.clone().filter_map(move |c| firm[r * g.cols + c])).map(|c| c.fit.albedo).collect();
        (albedos.len() >= 3).then(|| [sums::mean(&albedos), sums::variance(&albedos).sqrt()])
    })
}

/// Information of every cell's slopes: the inverse of the sum of their covariance and the variance of slopes within a cell, by which the slope
/// at an edge may differ from that of the cell. That variance is the median of the squared half differences of neighbours.
fn information(g: &Geometry, cells: &[Option<Cell>]) -> Vec<Option<[f64; 3]>> {
    let halves = |axis: usize, pitch: usize| -> Vec<f64> {
        let pair = |k: usize| {
            let (a, b) = (cells[k]?.fit.slopes[axis], cells.get(k + pitch).copied().flatten()?.fit.slopes[axis]);
            (axis == 1 || !(k + 1).is_multiple_of(g.cols)).then_some(0.25 * (a - b) * (a - b))
        };
        (0..g.len()).filter_map(pair).collect()
    };
    let curvature = [sums::median(&halves(0, 1)), sums::median(&halves(1, g.cols))].map(|v| v.max(1e-12));
    cells
        .iter()
        .map(|cell| {
            let [pp, pq, _, qq, ..] = cell.as_ref()?.fit.covariance.0;
            let (a, c) = (pp + curvature[0], qq + curvature[1]);
            let determinant = a * c - pq * pq;
            (determinant > 0.0).then(|| [c / determinant, -pq / determinant, a / determinant])
        })
        .collect()
}
