//! Finer detail for a measured DEM.
//!
//! # What
//! A smooth background through the posts of the DEM (cubic convolution), plus the detail that the processes of [`crate::planetary`] add
//! below the post spacing: texture, bounded craters, rocks. With S the background plus detail, B the background and `I[.]` cubic
//! convolution between values at the posts,
//! $$ z = S - I\left[\, S(\text{posts}) - B(\text{posts}) \,\right] $$
//! so that z equals the DEM at every post that is a lattice point, and at the other posts to within the slope times half a basic
//! spacing.
//!
//! Craters and rocks that the DEM, or images of the site, would have shown are not added (`bounds`). Sparse altimetry moves the surface
//! onto measured points (`altimetry`). With a measured albedo A, its background `B_A` and the albedo P of the processes, the albedo map
//! is
//! $$ a = B_A + P - I\left[\, P(\text{cells of } A) \,\right] $$
//! limited to 0 to 1. It equals the measurement at the centres of its cells, just as heights equal the DEM at posts. Without an `albedo`
//! process it is smooth.
//!
//! Texture parameters are fitted to the second differences of the DEM over lags of 1 to 8 posts (`fit`), unless given; the coarsest
//! texture points have the lattice spacing closest to that of the posts.
//!
//! # The lattice
//! Samples lie at `origin_m` and whole cells from it, lattice points whole basic spacings from it, numbered from the origin of the DEM's
//! coordinates. The lattice is shifted, by at most half a cell, so that samples lie on it. Windows with the same cell whose origins differ by
//! whole cells have the same shift: they are windows of one surface, and agree bit by bit. Windows of twice the cell agree with every second
//! sample if their origin lies within half of the smaller cell of a whole number of larger cells; otherwise they have a different shift, and
//! thus different detail.
//!
//! # Source
//! The paper's future work (section 1), and section 5 of Gaskell's scheme: "an interpolated surface begins with digital elevation and
//! albedo maps which define the basic scale to within a factor of a power of two". Where we depart:
//! * the DEM is not resampled to the lattice. The background passes through its own posts, whatever their spacing, and residuals are
//!   evaluated there;
//! * the residual is interpolated by cubic convolution; bilinear interpolation would leave creases along the lines of posts as high
//!   as the texture;
//! * the background is cubic; the average of parents would leave cusps at the posts.
//!
//! # Example
//! ```
//! use sastrugi_numeric::{Geometry, Grid, Streams, Surface};
//! use sastrugi_terrain::{Input, prepare};
//! use serde_json::json;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // 9 x 8 posts, 1 m apart, refined to samples of 25 cm with a given texture.
//! let posts = Geometry::square(9, 8, 1.0);
//! let dem = Grid::new(posts, (0..72).map(|k| f64::from(k * k % 7)).collect());
//! let params = json!({
//!     "dem": "site", "cell_m": 0.25, "origin_m": [3.0, 3.0], "size_px": [16, 16], "hurst": 0.7, "roughness_m": 0.02
//! });
//! let heights = prepare("elaborate", &params)?
//!     .generate(&Streams::for_seed(1, "terrain"), &[Input::from(dem.clone())])?
//!     .heights;
//! // The surface passes through the posts, here that of row 5 and column 3.
//! let height_m = heights.height(posts.x(3), posts.y(5)).ok_or("the post lies in the window")?;
//! assert!((height_m - dem.at(5, 3)).abs() < 1e-6);
//! # Ok(())
//! # }
//! ```
//!
//! # When not to use it
//! The texture extrapolates a power law over decades of scale. Where the roughness of the ground is different below the post spacing (grass,
//! gravel, a ploughed field), set `hurst` and `roughness_m`, or set `texture = false` and add a measured texture to the background.

mod altimetry;
mod background;
mod bounds;
mod fit;
mod params;
#[cfg(test)]
mod tests;
mod windows;

#[cfg(test)]
pub(crate) use fit::half_slope_and_factor;
pub use fit::{TextureFit, fit};
pub use params::{Elaborate, RawElaborate};
pub use windows::Elaborated;

use crate::generator::{Generator, Input, Map, NamedInput, Terrain, TerrainError, rounded_coordinate};
use crate::planetary::{self, Assembly, Patch, Potential, RawProcess, Request, Window, Work, World};
use altimetry::{AltimetryError, Correction, Points, Posts};
use background::Background;
use bounds::Bound;
use rayon::prelude::*;
use sastrugi_numeric::{Counter, Geometry, Grid, Streams};
use sastrugi_schemas::ParameterError;
use serde_json::Value;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Name in the registry.
pub const KIND: &str = "elaborate";

/// Minimum number of posts along a side of the DEM.
const POSTS_MIN: usize = 4;
/// How far from a window the ground under its craters may extend, posts: ejecta of the widest, and their retained points.
const CRATER_POSTS: usize = 8;

/// Why a DEM or another input cannot be used. Messages read after "it".
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
enum DemError {
    #[error("is missing")]
    Missing,
    #[error("has {rows} x {cols} posts; at least 4 x 4 are needed")]
    TooSmall { rows: usize, cols: usize },
    #[error("has posts {post_m} m apart; `cell_m` is {cell_m} m but must be finer")]
    NotFiner { post_m: f64, cell_m: f64 },
    #[error(
        "has its outer posts at x {} to {}, y {} to {} m; the window's samples, x {} to {}, y {} to {} m, do not lie between them",
        dem[0], dem[1], dem[2], dem[3], window[0], window[1], window[2], window[3]
    )]
    Outside { dem: [f64; 4], window: [f64; 4] },
    #[error("has no data at x = {x}, y = {y} m, where the window needs it; choose another window or fill the hole")]
    NoData { x: f64, y: f64 },
    #[error(
        "has too few posts with data to fit its texture: at least 7 in a row are needed in both directions; set `hurst` and `roughness_m`, or `texture = false`"
    )]
    NoFit,
    #[error(
        "has posts {post_m} m apart, so any {what} wider than two posts would show in it; the smallest requested is {diameter_m} m"
    )]
    Shows { post_m: f64, what: &'static str, diameter_m: f64 },
    #[error("has an albedo of {albedo} at x = {x}, y = {y} m; albedo must lie in 0 to 1")]
    AlbedoOutOfRange { albedo: f64, x: f64, y: f64 },
    #[error("is not usable as altimetry: {0}")]
    Altimetry(AltimetryError),
}

impl DemError {
    /// The parameter that causes the error; `input` is the one that names the input.
    fn key<'a>(&self, input: &'a str) -> &'a str {
        match self {
            Self::Outside { .. } => "origin_m",
            Self::NotFiner { .. } => "cell_m",
            Self::Shows { .. } => "processes",
            _ => input,
        }
    }
}

/// Columns and rows (from the south) of posts.
type Part = [Range<usize>; 2];

/// The inputs, each under its role.
struct Inputs<'a> {
    dem: &'a Grid,
    albedo: Option<&'a Grid>,
    /// `[x, y, z, sigma]`, m.
    points: Vec<[f64; 4]>,
    potential: Option<&'a Grid>,
}

/// The parts of the inputs that the samples of a window depend on.
struct Surroundings {
    /// Posts of the DEM.
    posts: Part,
    /// Altimetry points within reach.
    points: Points,
    /// Posts of the measured albedo.
    albedo: Option<Part>,
}

/// The data of an elaborated DEM that do not depend on the window or on which processes act.
struct Basis {
    background: Arc<Background>,
    /// The measured albedo.
    albedo: Option<Background>,
    points: Points,
    potential: Option<Potential>,
    /// The processes, limited to what neither the DEM nor images would show.
    processes: Vec<RawProcess>,
    texture: Option<TextureFit>,
    notes: Vec<String>,
}

/// The surface generated by a selection of the processes.
struct Model {
    basis: Arc<Basis>,
    /// The background with the detail.
    world: World,
}

/// How a window is computed.
#[derive(Clone, Copy)]
struct Pace<'a> {
    /// Craters and rocks up to this width are left out, m.
    least_m: f64,
    /// Set when the window is cancelled.
    cancel: Option<&'a AtomicBool>,
    /// Whether to use all threads or only this one.
    on_all: bool,
}

impl Pace<'_> {
    /// A complete window on all threads.
    const WHOLE: Self = Self { least_m: 0.0, cancel: None, on_all: true };

    fn is_over(&self) -> bool {
        self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// The values of `f` for 0 to `count - 1`; 0 for those after cancellation.
    fn values(&self, count: usize, f: impl Fn(usize) -> f64 + Sync) -> Vec<f64> {
        let value = |k: usize| if self.is_over() { 0.0 } else { f(k) };
        if self.on_all { (0..count).into_par_iter().map(value).collect() } else { (0..count).map(value).collect() }
    }
}

impl NamedInput {
    /// An error about this input.
    fn failed(&self, error: &DemError) -> TerrainError {
        self.error(error.to_string())
    }
}

impl Elaborate {
    /// Position of a lattice point in the DEM's coordinates, m.
    fn place(&self, point: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|a| point[a] * self.spacing_m + self.offset_m[a])
    }

    /// The lattice point nearest to a position.
    fn nearest(&self, place: [f64; 2]) -> [i64; 2] {
        [0, 1].map(|a| ((place[a] - self.offset_m[a]) / self.spacing_m).round() as i64)
    }

    /// Smallest and largest coordinate of the window's samples along x and y, m.
    fn ends(&self) -> [[f64; 2]; 2] {
        let last = [self.window.cols - 1, self.window.rows - 1].map(|n| n as f64 * self.raw.cell_m);
        [0, 1].map(|a| [self.raw.origin_m[a], self.raw.origin_m[a] + last[a]])
    }

    /// The posts that enclose the window's samples and the ground up to `beyond_m` around them, plus two on either side where they
    /// exist.
    fn posts(&self, g: &Geometry, beyond_m: f64) -> Result<Part, DemError> {
        let ends = self.ends();
        let outer = [[g.x(0), g.x(g.cols - 1)], [g.y(g.rows - 1), g.y(0)]];
        if (0..2).any(|a| ends[a].iter().any(|at| !background::lies_between(g, a, *at))) {
            let four = |p: [[f64; 2]; 2]| [p[0][0], p[0][1], p[1][0], p[1][1]];
            return Err(DemError::Outside {
                dem: four(outer).map(rounded_coordinate),
                window: four(ends).map(rounded_coordinate),
            });
        }
        // The positions of the outer samples to the last bit: `Background::at` uses the posts around these.
        let w = &self.window;
        let low = self.place([w.x(0), w.y(0)]);
        let high = self.place([w.x(w.cols - 1), w.y(w.rows - 1)]);
        Ok([0, 1].map(|a| background::around(g, a, [low[a] - beyond_m, high[a] + beyond_m])))
    }

    /// Distance around a sample within which the DEM must have data, posts.
    fn margin(&self) -> usize {
        if self.raw.processes.is_empty() { 0 } else { CRATER_POSTS }
    }

    /// Checks that the posts of a part of a raster, and `margin` posts around it, have data.
    fn check_raster(&self, raster: &Grid, part: &Part, margin: usize) -> Result<(), DemError> {
        let [cols, rows] = part;
        let g = &raster.geometry;
        for j in widened(rows, margin, g.rows) {
            for i in widened(cols, margin, g.cols) {
                let row = g.rows - 1 - j;
                if !raster.at(row, i).is_finite() {
                    return Err(DemError::NoData { x: g.x(i), y: g.y(row) });
                }
            }
        }
        Ok(())
    }

    /// Checks whether the rasters can be used at all, regardless of the window.
    fn check_inputs(&self, inputs: &Inputs<'_>) -> Result<(), TerrainError> {
        self.check_size(&inputs.dem.geometry).map_err(|e| self.dem().failed(&e))?;
        let (Some(albedo), Some(name)) = (inputs.albedo, self.albedo()) else { return Ok(()) };
        let g = &albedo.geometry;
        self.check_size(g).map_err(|e| name.failed(&e))?;
        match albedo.values.iter().position(|a| a.is_finite() && !(0.0..=1.0).contains(a)) {
            None => Ok(()),
            Some(k) => {
                let (albedo, x, y) = (albedo.values[k], g.x(k % g.cols), g.y(k / g.cols));
                Err(name.failed(&DemError::AlbedoOutOfRange { albedo, x, y }))
            }
        }
    }

    /// Checks whether a DEM or an albedo of this shape and position can be used.
    fn check_place(&self, name: &NamedInput, g: &Geometry) -> Result<(), DemError> {
        self.check_size(g)?;
        self.posts(g, 0.0)?;
        if *name == self.dem() {
            self.bounded(g.cell[0].min(g.cell[1]))?;
        }
        Ok(())
    }

    /// Checks that a raster has enough posts, farther apart than the samples.
    fn check_size(&self, g: &Geometry) -> Result<(), DemError> {
        let post_m = g.cell[0].min(g.cell[1]);
        if g.rows < POSTS_MIN || g.cols < POSTS_MIN {
            Err(DemError::TooSmall { rows: g.rows, cols: g.cols })
        } else if self.raw.cell_m >= post_m {
            Err(DemError::NotFiner { post_m, cell_m: self.raw.cell_m })
        } else {
            Ok(())
        }
    }

    /// The processes without features that the DEM or images would show, and a note on the bound.
    fn bounded(&self, post_m: f64) -> Result<(Vec<RawProcess>, Option<String>), DemError> {
        let bound = Bound::Posts(post_m).and(self.images);
        let shown = |(n, diameter_m): (usize, f64)| {
            let is_rocks = matches!(self.raw.processes[n], RawProcess::Rocks(_));
            DemError::Shows { post_m, what: if is_rocks { "rocks" } else { "craters" }, diameter_m }
        };
        let processes = bound.apply(&self.raw.processes).map_err(shown)?;
        Ok((processes, bound.note(&self.raw.processes)))
    }

    /// Texture of the DEM, if requested.
    fn texture(&self, dem: &Grid) -> Result<Option<TextureFit>, DemError> {
        if !self.raw.texture {
            return Ok(None);
        }
        if let (Some(hurst), Some(roughness_m)) = (self.raw.hurst, self.raw.roughness_m) {
            return Ok(Some(TextureFit { hurst, roughness_m }));
        }
        let fitted = fit(dem, self.raw.hurst).ok_or(DemError::NoFit)?;
        Ok(Some(TextureFit { roughness_m: self.raw.roughness_m.unwrap_or(fitted.roughness_m), ..fitted }))
    }

    /// The surface of a basis; `acts` selects the processes by their index in the list.
    fn model(&self, streams: &Streams, basis: Arc<Basis>, acts: impl Fn(usize) -> bool) -> Model {
        let (background, own) = (Arc::clone(&basis.background), self.clone());
        let anchor = planetary::nearest_zoom(background.geometry().mean_cell() / self.spacing_m);
        let mut assembly = Assembly::new(self.spacing_m, anchor);
        assembly.add_base(Box::new(move |point| background.at(own.place(point))));
        if let Some(t) = basis.texture {
            assembly.add_texture(t.roughness_m, t.hurst, Counter::new(&mut streams.stream("texture-1")));
        }
        let world = assembly.with(&basis.processes, streams, basis.potential.clone(), acts);
        Model { basis, world }
    }

    /// A quantity of the detail at the posts of a part, interpolated like the background.
    fn detail(
        &self,
        g: Geometry,
        [cols, rows]: &Part,
        pace: Pace<'_>,
        of: impl Fn([i64; 2]) -> f64 + Sync,
    ) -> Background {
        let posts = Geometry::square(rows.len(), cols.len(), 1.0);
        let values = pace.values(posts.len(), |k| {
            let (row, col) = (g.rows - rows.end + k / posts.cols, cols.start + k % posts.cols);
            of(self.nearest([g.x(col), g.y(row)]))
        });
        Background::of_part(g, [cols.start, rows.start], Grid::new(posts, values))
    }

    /// Replaces the values of a window by a function of their lattice point and old value.
    fn change(&self, values: &mut [f64], pace: Pace<'_>, by: impl Fn([f64; 2], f64) -> f64 + Sync) {
        let window = self.window;
        let line = |(row, line): (usize, &mut [f64])| {
            let change = |(col, v): (usize, &mut f64)| *v = by([window.x(col), window.y(row)], *v);
            if !pace.is_over() {
                line.iter_mut().enumerate().for_each(change);
            }
        };
        if pace.on_all {
            values.par_chunks_mut(window.cols).enumerate().for_each(line);
        } else {
            values.chunks_mut(window.cols).enumerate().for_each(line);
        }
    }

    /// The altimetry of a DEM.
    fn points(&self, inputs: &Inputs<'_>) -> Result<Points, TerrainError> {
        let dem = inputs.dem;
        let posts = Posts { geometry: dem.geometry, spacing_m: self.spacing_m, offset_m: self.offset_m };
        let made = Points::new(posts, &inputs.points, |col, row| dem.at(dem.rows() - 1 - row, col));
        made.map_err(|e| {
            let listed = || NamedInput::points("altimetry_points_m", "altimetry_points_m");
            self.altimetry().unwrap_or_else(listed).failed(&DemError::Altimetry(e))
        })
    }

    /// How far altimetry moves the surface `world` minus `residual`.
    fn correction(&self, points: &Points, world: Bounded<'_>, residual: &Background) -> Correction {
        let corners = points.corners();
        let heights = world.pace.values(corners.len(), |k| {
            let [i, j] = corners[k];
            world.sample([i, j]).heights[0] - residual.at(self.place([i as f64, j as f64]))
        });
        let known: BTreeMap<[i64; 2], f64> = corners.into_iter().zip(heights).collect();
        points.correction(|corner| known.get(&corner).copied().unwrap_or(f64::NAN))
    }

    /// The measured albedo at the window's samples, plus the detail of the processes.
    fn measured_albedo(&self, measured: &Background, part: &Part, world: Bounded<'_>, patch: &mut Patch) {
        let detail = self.detail(measured.geometry(), part, world.pace, |point| world.sample(point).albedo[0]);
        self.change(&mut patch.albedo, world.pace, |point, own| {
            let place = self.place(point);
            (measured.at(place) + (own - detail.at(place))).clamp(0.0, 1.0)
        });
    }

    /// The data shared by all windows and selections of processes.
    fn basis(&self, inputs: &Inputs<'_>, points: Points) -> Result<Basis, TerrainError> {
        let (dem, of_dem) = (inputs.dem, |e: DemError| self.dem().failed(&e));
        let g = &dem.geometry;
        let (processes, bound_note) = self.bounded(g.cell[0].min(g.cell[1])).map_err(of_dem)?;
        let potential = self.potential(inputs)?;
        let texture = self.texture(dem).map_err(of_dem)?;
        let mut notes = texture.map_or_else(Vec::new, |t| self.texture_notes(&t, g));
        notes.extend(bound_note);
        let background = Arc::new(Background::new(without_holes(dem)));
        let albedo = inputs.albedo.map(|albedo| Background::new(without_holes(albedo)));
        Ok(Basis { background, albedo, points, potential, processes, texture, notes })
    }

    /// The posts of the DEM and of the albedo, and the altimetry, that the window depends on.
    fn surroundings(
        &self,
        dem: &Geometry,
        albedo: Option<Geometry>,
        points: &Points,
    ) -> Result<Surroundings, TerrainError> {
        let posts = self.posts(dem, self.altimetry_m(dem, points)).map_err(|e| self.dem().failed(&e))?;
        let lattice = |point: [f64; 2]| [0, 1].map(|a| (point[a] - self.offset_m[a]) / self.spacing_m);
        let [[west, east], [south, north]] = self.ends();
        let points = points.within_reach(lattice([west, south]), lattice([east, north]));
        let albedo = match (albedo, self.albedo()) {
            (Some(albedo), Some(name)) => Some(self.posts(&albedo, 0.0).map_err(|e| name.failed(&e))?),
            _ => None,
        };
        Ok(Surroundings { posts, points, albedo })
    }

    /// Distance around a sample within which the ground affects the altimetry that may move it, m.
    fn altimetry_m(&self, dem: &Geometry, points: &Points) -> f64 {
        if points.is_empty() {
            return 0.0;
        }
        // The lattice points around a point may lie one spacing beyond its reach.
        dem.cell[0].max(dem.cell[1]) + 2.0 * self.spacing_m
    }

    /// Checks that there are data all around the window.
    fn check_data(&self, inputs: &Inputs<'_>, around: &Surroundings) -> Result<(), TerrainError> {
        self.check_raster(inputs.dem, &around.posts, self.margin()).map_err(|e| self.dem().failed(&e))?;
        match (inputs.albedo, self.albedo(), &around.albedo) {
            (Some(albedo), Some(name), Some(part)) => self.check_raster(albedo, part, 0).map_err(|e| name.failed(&e)),
            _ => Ok(()),
        }
    }

    /// Turns samples of the model into samples of the surface, which passes through the posts and the altimetry; also sets the measured albedo,
    /// if any.
    fn settle(&self, around: &Surroundings, model: &Model, pace: Pace<'_>, patch: &mut Patch) -> Option<Correction> {
        let (world, background) = (Bounded { world: &model.world, pace }, &model.basis.background);
        let residual = self.detail(background.geometry(), &around.posts, pace, |[i, j]| {
            world.sample([i, j]).heights[0] - background.at(self.place([i as f64, j as f64]))
        });
        self.change(&mut patch.heights, pace, |point, z| z - residual.at(self.place(point)));
        let correction = (!around.points.is_empty()).then(|| self.correction(&around.points, world, &residual));
        if let Some(correction) = &correction {
            self.change(&mut patch.heights, pace, |point, z| z + correction.at(point));
        }
        if let (Some(albedo), Some(part)) = (&model.basis.albedo, &around.albedo) {
            self.measured_albedo(albedo, part, world, patch);
        }
        correction
    }

    fn refine(&self, streams: &Streams, inputs: &Inputs<'_>) -> Result<Terrain, TerrainError> {
        self.check_inputs(inputs)?;
        let points = self.points(inputs)?;
        let around = self.surroundings(&inputs.dem.geometry, inputs.albedo.map(|albedo| albedo.geometry), &points)?;
        self.check_data(inputs, &around)?;
        let model = self.model(streams, Arc::new(self.basis(inputs, points)?), |_| true);
        let mut patch = model.world.tiled_patch(&self.window);
        let correction = self.settle(&around, &model, Pace::WHOLE, &mut patch);
        let mut maps = planetary::maps(&model.world, self.geometry(), &patch);
        if inputs.albedo.is_some() && model.world.albedo.is_none() {
            maps.push(Map { name: "albedo", values: planetary::to_grid(self.geometry(), &patch.albedo) });
        }
        let heights = planetary::to_grid(self.geometry(), &patch.heights);
        let mut notes = model.basis.notes.clone();
        notes.extend(correction.map(|c| c.note()));
        notes.extend(planetary::potential_note(&model.world, &self.window));
        Ok(Terrain { heights, maps, lines: Vec::new(), notes })
    }

    /// The raster that the rocks follow.
    fn potential(&self, inputs: &Inputs<'_>) -> Result<Option<Potential>, TerrainError> {
        let (Some(raster), Some(name)) = (inputs.potential, planetary::potential_input(&self.raw.processes)) else {
            return Ok(None);
        };
        let made = Potential::new(raster, self.spacing_m, self.offset_m);
        made.map(Some).map_err(|reason| name.error(reason))
    }

    fn texture_notes(&self, texture: &TextureFit, g: &Geometry) -> Vec<String> {
        let given = self.raw.hurst.is_some() && self.raw.roughness_m.is_some();
        vec![format!(
            "texture below the post spacing of {:.3} x {:.3} m: H = {:.3}, roughness {:.4} m at 1 m, {:.4} m at the cell ({})",
            g.cell[0],
            g.cell[1],
            texture.hurst,
            texture.roughness_m,
            texture.roughness_m * libm::pow(self.raw.cell_m, texture.hurst),
            if given { "given" } else { "fitted to lags of 1 to 8 posts" }
        )]
    }

    fn dem(&self) -> NamedInput {
        NamedInput::heights("dem", &self.raw.dem)
    }

    fn albedo(&self) -> Option<NamedInput> {
        self.raw.albedo.as_ref().map(|name| NamedInput::values("albedo", name))
    }

    fn altimetry(&self) -> Option<NamedInput> {
        self.raw.altimetry.as_ref().map(|name| NamedInput::points("altimetry", name))
    }

    /// The inputs, assigned to their roles.
    fn sorted<'a>(&self, inputs: &'a [Input]) -> Result<Inputs<'a>, TerrainError> {
        let mut given = inputs.iter();
        let mut grid = |name: Option<NamedInput>| match (name, &mut given) {
            (None, _) => Ok(None),
            (Some(name), given) => match given.next() {
                Some(Input::Grid(grid)) => Ok(Some(grid)),
                _ => Err(name.failed(&DemError::Missing)),
            },
        };
        let dem = grid(Some(self.dem()))?.ok_or_else(|| self.dem().failed(&DemError::Missing))?;
        let albedo = grid(self.albedo())?;
        let potential = grid(planetary::potential_input(&self.raw.processes))?;
        let mut points = match (self.altimetry(), given.next()) {
            (None, _) => Vec::new(),
            (Some(_), Some(Input::Points(points))) => points.clone(),
            (Some(name), _) => return Err(name.failed(&DemError::Missing)),
        };
        let listed = |p: &Vec<f64>| [0, 1, 2, 3].map(|k| p.get(k).copied().unwrap_or(0.0));
        points.extend(self.raw.altimetry_points_m.iter().map(listed));
        Ok(Inputs { dem, albedo, points, potential })
    }
}

/// A world limited to craters and rocks wider than `pace.least_m`.
#[derive(Clone, Copy)]
struct Bounded<'a> {
    world: &'a World,
    pace: Pace<'a>,
}

impl Bounded<'_> {
    /// One lattice point.
    fn sample(self, [west, south]: [i64; 2]) -> Patch {
        self.world.made(&Request { window: point(west, south), feature_min_m: self.pace.least_m, cancel: None })
    }
}

/// A range of posts, extended by `margin` on either side where they exist.
fn widened(posts: &Range<usize>, margin: usize, count: usize) -> Range<usize> {
    posts.start.saturating_sub(margin)..(posts.end + margin).min(count)
}

/// The window of one lattice point.
fn point(west: i64, south: i64) -> Window {
    Window { zoom: 0, west, south, cols: 1, rows: 1, centred: false }
}

/// The DEM with no data replaced by its mean: far from the window, where only the planes of distant craters use it.
fn without_holes(dem: &Grid) -> Grid {
    let mean = sastrugi_numeric::sums::mean(&sastrugi_numeric::sums::finite(&dem.values));
    dem.map(|z| if z.is_finite() { z } else { mean })
}

impl Generator for Elaborate {
    fn kind(&self) -> &'static str {
        KIND
    }

    fn geometry(&self) -> Geometry {
        let half = 0.5 * self.raw.cell_m;
        Geometry { origin: self.raw.origin_m.map(|at| at - half), ..self.size.geometry() }
    }

    fn parameters(&self) -> Value {
        serde_json::to_value(&self.raw).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        planetary::memory_bytes(&self.window, &self.work)
    }

    fn seconds(&self) -> f64 {
        planetary::seconds(self.window.len(), &Work { is_textured: self.raw.texture, ..self.work })
    }

    fn notes(&self) -> Vec<String> {
        self.size.note().into_iter().collect()
    }

    fn inputs(&self) -> Vec<NamedInput> {
        let rasters = [Some(self.dem()), self.albedo(), planetary::potential_input(&self.raw.processes)];
        rasters.into_iter().flatten().chain(self.altimetry()).collect()
    }

    fn check_places(&self, places: &[Option<Geometry>]) -> Result<(), ParameterError> {
        for (name, place) in self.inputs().iter().zip(places) {
            let Some(g) = place.filter(|_| *name == self.dem() || Some(name) == self.albedo().as_ref()) else {
                continue;
            };
            self.check_place(name, &g).map_err(|error| {
                let message = format!("does not suit \"{}\", which {error}", name.name);
                ParameterError::new(error.key(&name.key), message)
            })?;
        }
        Ok(())
    }

    fn generate(&self, streams: &Streams, inputs: &[Input]) -> Result<Terrain, TerrainError> {
        self.refine(streams, &self.sorted(inputs)?)
    }
}
