//! Finer detail for a measured DEM.
//!
//! # What
//! A smooth background through the posts of the DEM (cubic convolution), and on it what the processes of [`crate::planetary`] make below
//! the spacing of the posts: texture, bounded craters, rocks. With S the surface so made, B the background and `I[.]` cubic convolution
//! between values at the posts,
//! $$ z = S - I\left[\, S(\text{posts}) - B(\text{posts}) \,\right] $$
//! so that z is the DEM's height at every post that is a lattice point, and the DEM's to within the slope times half a basic spacing
//! at the others.
//!
//! Texture parameters are fitted to the structure function of the DEM over lags of 1 to 8 posts (`fit`), unless given; its coarsest
//! points are the lattice spacing nearest to that of the posts.
//!
//! # The lattice
//! Samples lie at `origin_m` and whole cells from it, lattice points whole basic spacings from it, numbered from the origin of the DEM's
//! coordinates. The lattice is shifted so that samples lie on it, by half a cell at most. Windows of one cell whose origins differ by whole
//! cells have the same shift: they are windows of one surface, and agree bit by bit. So do windows of twice the cell with every second
//! sample, where their origin lies within half of the smaller cell of a whole number of larger ones; elsewhere they are shifted
//! otherwise, and have other detail.
//!
//! # Source
//! The paper's future work (section 1), and section 5 of Gaskell's scheme: "an interpolated surface begins with digital elevation and
//! albedo maps which define the basic scale to within a factor of a power of two". Where we depart:
//! * the DEM is not resampled to the lattice. The background goes through its own posts, whatever their distance, and residuals are
//!   taken at them;
//! * the residual is interpolated by cubic convolution instead of bilinearly, which would leave creases on the lines of posts as high
//!   as the texture;
//! * the background is cubic, not the average of parents, which leaves cusps at the posts.
//!
//! # When not to use it
//! The texture extrapolates a power law over decades of scale. Where the ground has another roughness below the posts (grass, gravel, a
//! ploughed field) give `hurst` and `roughness_m`, or take `texture = false` and add a measured texture to the background.

mod background;
mod fit;
mod params;
#[cfg(test)]
mod tests;

#[cfg(test)]
pub(crate) use fit::seen_through_the_lags;
pub use fit::{TextureFit, fit};
pub use params::{Elaborate, RawElaborate};

use crate::generator::{Generator, InputSurface, Terrain, TerrainError};
use crate::planetary::{self, Assembly, RawProcess, Window, World};
use background::Background;
use rayon::prelude::*;
use sastrugi_numeric::{Counter, Geometry, Grid, Streams};
use serde_json::Value;
use std::ops::Range;
use std::sync::Arc;

/// Name in the registry.
pub const KIND: &str = "elaborate";

/// Fewest posts along a side of the DEM.
const POSTS_MIN: usize = 4;
/// A DEM with more of its structure function from its tilt is not one to fit a texture to.
const TILT_SHARE_MAX: f64 = 0.3;
/// Largest crater or rock, posts.
const DIAMETER_POSTS: f64 = 2.0;
/// How far from a window the ground under its craters may reach, posts: ejecta of the widest, and their retained points.
const CRATER_POSTS: usize = 8;

/// Why a DEM cannot be refined.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
enum DemError {
    #[error("has {rows} x {cols} posts; at least 4 x 4 are needed")]
    TooSmall { rows: usize, cols: usize },
    #[error("has posts {post_m} m apart; `cell_m` is {cell_m} m and must be finer")]
    NotFiner { post_m: f64, cell_m: f64 },
    #[error(
        "has its outer posts at x {} to {}, y {} to {} m; the window's samples, x {} to {}, y {} to {} m, do not lie between them",
        dem[0], dem[1], dem[2], dem[3], window[0], window[1], window[2], window[3]
    )]
    Outside { dem: [f64; 4], window: [f64; 4] },
    #[error("has no data at x = {x}, y = {y} m, which the window needs; choose another window or fill the hole")]
    NoData { x: f64, y: f64 },
    #[error(
        "has too few posts with data for a fit of its texture; give `hurst` and `roughness_m`, or `texture = false`"
    )]
    NoFit,
    #[error(
        "has posts {post_m} m apart, and would show {what} wider than two of them; the smallest asked for is {diameter_m} m"
    )]
    Shows { post_m: f64, what: &'static str, diameter_m: f64 },
}

impl Elaborate {
    /// Place of a lattice point in the DEM's coordinates, m.
    fn place(&self, point: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|a| point[a] * self.spacing_m + self.offset_m[a])
    }

    /// The lattice point nearest to a place.
    fn nearest(&self, place: [f64; 2]) -> [i64; 2] {
        [0, 1].map(|a| ((place[a] - self.offset_m[a]) / self.spacing_m).round() as i64)
    }

    /// Columns and rows (from the south) of the posts that a window's samples lie between, two beyond on either side where there are.
    fn posts(&self, g: &Geometry) -> Result<[Range<usize>; 2], DemError> {
        let last = [self.window.cols - 1, self.window.rows - 1].map(|n| n as f64 * self.raw.cell_m);
        let [x, y] = self.raw.origin_m;
        let ends = [[x, x + last[0]], [y, y + last[1]]];
        let outer = [[g.x(0), g.x(g.cols - 1)], [g.y(g.rows - 1), g.y(0)]];
        if (0..2).any(|a| !(ends[a][0] >= outer[a][0] && ends[a][1] <= outer[a][1])) {
            let four = |p: [[f64; 2]; 2]| [p[0][0], p[0][1], p[1][0], p[1][1]];
            return Err(DemError::Outside { dem: four(outer), window: four(ends) });
        }
        Ok([0, 1].map(|a| {
            let post = |at: f64| ((at - outer[a][0]) / g.cell[a]) as usize;
            let count = [g.cols, g.rows][a];
            post(ends[a][0]).saturating_sub(1)..(post(ends[a][1]) + 3).min(count)
        }))
    }

    fn check_dem(&self, dem: &Grid, [cols, rows]: &[Range<usize>; 2]) -> Result<(), DemError> {
        let g = &dem.geometry;
        let margin = if self.raw.processes.is_empty() { 0 } else { CRATER_POSTS };
        let wide = |r: &Range<usize>, count: usize| r.start.saturating_sub(margin)..(r.end + margin).min(count);
        for j in wide(rows, g.rows) {
            for i in wide(cols, g.cols) {
                let row = g.rows - 1 - j;
                if !dem.at(row, i).is_finite() {
                    return Err(DemError::NoData { x: g.x(i), y: g.y(row) });
                }
            }
        }
        Ok(())
    }

    /// The processes, with nothing wider than two posts.
    fn bounded(&self, post_m: f64) -> Result<Vec<RawProcess>, DemError> {
        let most_m = DIAMETER_POSTS * post_m;
        let bound = |what: &'static str, low_m: f64, high_m: &mut f64| {
            *high_m = high_m.min(most_m);
            if low_m <= most_m { Ok(()) } else { Err(DemError::Shows { post_m, what, diameter_m: low_m }) }
        };
        let mut processes = self.raw.processes.clone();
        for process in &mut processes {
            match process {
                RawProcess::PrimaryCraters(p) => bound("craters", p.diameter_min_m, &mut p.diameter_max_m)?,
                RawProcess::SecondaryCraters(p) => bound("craters", p.diameter_min_m, &mut p.diameter_max_m)?,
                RawProcess::Rocks(p) => bound("rocks", p.diameter_min_m, &mut p.diameter_max_m)?,
                _ => {}
            }
        }
        Ok(processes)
    }

    /// Texture of the DEM, where it is asked for.
    fn texture(&self, dem: &Grid) -> Result<Option<TextureFit>, DemError> {
        if !self.raw.texture {
            return Ok(None);
        }
        if let (Some(hurst), Some(roughness_m)) = (self.raw.hurst, self.raw.roughness_m) {
            return Ok(Some(TextureFit { hurst, roughness_m, tilt_share: 0.0 }));
        }
        let fitted = fit(dem, self.raw.hurst).ok_or(DemError::NoFit)?;
        Ok(Some(TextureFit { roughness_m: self.raw.roughness_m.unwrap_or(fitted.roughness_m), ..fitted }))
    }

    /// The world of the detail, on the background.
    fn world(
        &self,
        background: Arc<Background>,
        processes: &[RawProcess],
        texture: Option<TextureFit>,
        anchor: u32,
        streams: &Streams,
    ) -> World {
        let mut assembly = Assembly::new(self.spacing_m, anchor);
        let own = self.clone();
        assembly.add_base(Box::new(move |point| background.at(own.place(point))));
        if let Some(t) = texture {
            assembly.add_texture(t.roughness_m, t.hurst, Counter::new(&mut streams.stream("texture-1")));
        }
        assembly.with(processes, streams)
    }

    /// What the world has at the posts (columns, and rows from the south) beyond the background.
    fn residual(
        &self,
        world: &World,
        background: &Background,
        g: Geometry,
        [cols, rows]: [Range<usize>; 2],
    ) -> Background {
        let posts = Geometry::square(rows.len(), cols.len(), 1.0);
        let at = |k: usize| {
            let (row, col) = (g.rows - rows.end + k / posts.cols, cols.start + k % posts.cols);
            let [i, j] = self.nearest([g.x(col), g.y(row)]);
            let point = Window { zoom: 0, west: i, south: j, cols: 1, rows: 1 };
            world.patch(&point).heights[0] - background.at(self.place([i as f64, j as f64]))
        };
        let values = (0..posts.len()).into_par_iter().map(at).collect();
        Background::of_part(g, [cols.start, rows.start], Grid::new(posts, values))
    }

    fn refine(&self, streams: &Streams, dem: &Grid) -> Result<Terrain, DemError> {
        let g = &dem.geometry;
        if g.rows < POSTS_MIN || g.cols < POSTS_MIN {
            return Err(DemError::TooSmall { rows: g.rows, cols: g.cols });
        }
        let post_m = g.cell[0].min(g.cell[1]);
        if self.raw.cell_m >= post_m {
            return Err(DemError::NotFiner { post_m, cell_m: self.raw.cell_m });
        }
        let posts = self.posts(g)?;
        self.check_dem(dem, &posts)?;
        let processes = self.bounded(post_m)?;
        let texture = self.texture(dem)?;
        let anchor = planetary::nearest_zoom(g.mean_cell() / self.spacing_m);
        let background = Arc::new(Background::new(without_holes(dem)));
        let world = self.world(background.clone(), &processes, texture, anchor, streams);
        let mut patch = world.tiled_patch(&self.window);
        let residual = self.residual(&world, &background, *g, posts);
        let window = self.window;
        patch.heights.par_chunks_mut(window.cols).enumerate().for_each(|(row, line)| {
            let take = |(col, z): (usize, &mut f64)| *z -= residual.at(self.place([window.x(col), window.y(row)]));
            line.iter_mut().enumerate().for_each(take);
        });
        let maps = planetary::maps(&world, self.geometry(), &patch);
        let heights = planetary::to_grid(self.geometry(), &patch.heights);
        let notes = texture.map_or_else(Vec::new, |t| self.texture_notes(&t, g));
        Ok(Terrain { heights, maps, lines: Vec::new(), notes })
    }

    fn texture_notes(&self, texture: &TextureFit, g: &Geometry) -> Vec<String> {
        let given = self.raw.hurst.is_some() && self.raw.roughness_m.is_some();
        let mut notes = vec![format!(
            "texture below the posts of {:.3} x {:.3} m: H = {:.3}, roughness {:.4} m at 1 m, {:.4} m at the cell ({})",
            g.cell[0],
            g.cell[1],
            texture.hurst,
            texture.roughness_m,
            texture.roughness_m * libm::pow(self.raw.cell_m, texture.hurst),
            if given { "given" } else { "fitted to lags of 1 to 8 posts" }
        )];
        if texture.tilt_share > TILT_SHARE_MAX {
            let percent = 100.0 * texture.tilt_share;
            notes.push(format!(
                "{percent:.0} % of the DEM's differences over the longest lag are its tilt, which the texture takes for roughness; give `hurst` and \
                 `roughness_m`"
            ));
        }
        notes
    }
}

/// The DEM with its mean where it has no data: far from the window, where only planes of distant craters ask.
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
        planetary::seconds(&self.window, &self.work)
    }

    fn notes(&self) -> Vec<String> {
        self.size.note().into_iter().collect()
    }

    fn inputs(&self) -> Vec<InputSurface> {
        vec![InputSurface { key: "dem".to_owned(), name: self.raw.dem.clone() }]
    }

    fn generate(&self, streams: &Streams, inputs: &[Grid]) -> Result<Terrain, TerrainError> {
        let failed = |reason: String| TerrainError::Input { surface: self.raw.dem.clone(), reason };
        let dem = inputs.first().ok_or_else(|| failed("is not there".to_owned()))?;
        self.refine(streams, dem).map_err(|e| failed(e.to_string()))
    }
}
