//! Windows of an elaborated DEM on the lattice of its parameters: all belong to one surface, at any zoom up to half the post spacing.

use super::background::{Background, around, lies_between};
use super::{Elaborate, Model, Pace, RawElaborate, point, widened};
use crate::generator::{Input, TerrainError};
use crate::planetary::{Patch, Request, SAND, Window};
use crate::windows::Windows;
use sastrugi_numeric::{Geometry, Grid, Streams};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A DEM with its detail.
pub struct Elaborated {
    form: Elaborate,
    model: Model,
    /// Coverage of the DEM and of the measured albedo.
    cover: Arc<[Cover]>,
}

/// Where a raster provides ground: a sample has ground if all posts that it depends on have data. This depends only on the position of the
/// sample, so that all windows agree.
struct Cover {
    geometry: Geometry,
    /// Distance around a sample within which posts affect it, m.
    beyond_m: f64,
    /// Additional posts around those.
    margin: usize,
    /// Summed-area table: number of posts without data south and west of each corner; rows from the south, one entry more than columns.
    missing: Vec<u32>,
}

impl Cover {
    fn of(raster: &Grid, beyond_m: f64, margin: usize) -> Self {
        let geometry = raster.geometry;
        let (rows, cols) = (geometry.rows, geometry.cols);
        let mut missing = vec![0; (rows + 1) * (cols + 1)];
        for row in 0..rows {
            let mut of_row = 0;
            for col in 0..cols {
                of_row += u32::from(!raster.at(rows - 1 - row, col).is_finite());
                missing[(row + 1) * (cols + 1) + col + 1] = missing[row * (cols + 1) + col + 1] + of_row;
            }
        }
        Self { geometry, beyond_m, margin, missing }
    }

    /// The columns or rows (from the south) of posts that a coordinate along an axis depends on; `None` beyond the outer posts.
    fn posts(&self, axis: usize, at_m: f64) -> Option<Range<usize>> {
        let g = &self.geometry;
        lies_between(g, axis, at_m).then(|| {
            let posts = around(g, axis, [at_m - self.beyond_m, at_m + self.beyond_m]);
            widened(&posts, self.margin, [g.cols, g.rows][axis])
        })
    }

    /// Whether all posts of a part have data.
    fn is_complete(&self, cols: &Range<usize>, rows: &Range<usize>) -> bool {
        let south_west = |row: usize, col: usize| self.missing[row * (self.geometry.cols + 1) + col];
        south_west(rows.end, cols.end) + south_west(rows.start, cols.start)
            == south_west(rows.start, cols.end) + south_west(rows.end, cols.start)
    }
}

impl Elaborate {
    /// The surface that this window is part of.
    ///
    /// # Errors
    /// Inputs that cannot be used.
    pub fn elaborated(&self, streams: &Streams, inputs: &[Input]) -> Result<Elaborated, TerrainError> {
        let sorted = self.sorted(inputs)?;
        self.check_inputs(&sorted)?;
        let points = self.points(&sorted)?;
        let beyond_m = self.altimetry_m(&sorted.dem.geometry, &points);
        let basis = self.basis(&sorted, points)?;
        let albedo = sorted.albedo.map(|albedo| Cover::of(albedo, 0.0, 0));
        let dem = Cover::of(sorted.dem, beyond_m, self.margin());
        let cover = std::iter::once(dem).chain(albedo).collect();
        Ok(Elaborated { form: self.clone(), model: self.model(streams, Arc::new(basis), |_| true), cover })
    }

    /// The same surface in another window of its lattice.
    fn in_window(&self, window: Window) -> Self {
        let first = [window.x(0), window.y(0)];
        let cell_m = self.spacing_m * (1u64 << window.zoom) as f64;
        let raw = RawElaborate { cell_m, origin_m: self.place(first), ..self.raw.clone() };
        Self { raw, window, ..self.clone() }
    }
}

impl Elaborated {
    /// The same surface with only the processes whose index in the list (from 0) `acts` selects; their draws do not change.
    pub fn selecting(&self, streams: &Streams, acts: impl Fn(usize) -> bool) -> Self {
        let model = self.form.model(streams, Arc::clone(&self.model.basis), acts);
        Self { form: self.form.clone(), model, cover: Arc::clone(&self.cover) }
    }

    /// Basic spacing, m.
    pub fn spacing_m(&self) -> f64 {
        self.form.spacing_m
    }

    /// Position of lattice point 0 in the DEM's coordinates, m.
    pub fn offset_m(&self) -> [f64; 2] {
        self.form.offset_m
    }

    /// The parameters.
    pub fn raw(&self) -> &RawElaborate {
        &self.form.raw
    }

    /// Geometry of its DEM.
    pub fn posts(&self) -> Geometry {
        self.model.basis.background.geometry()
    }

    /// Position of a lattice point in the DEM's coordinates, m.
    pub fn place(&self, point: [f64; 2]) -> [f64; 2] {
        self.form.place(point)
    }

    /// Which samples of a window have ground, row by row from the south.
    fn has_ground(&self, window: &Window) -> Vec<bool> {
        let mut has = vec![true; window.len()];
        for cover in self.cover.iter() {
            let place = |n: usize| self.place([window.x(n), window.y(n)]);
            let cols: Vec<_> = (0..window.cols).map(|n| cover.posts(0, place(n)[0])).collect();
            for (n, line) in has.chunks_exact_mut(window.cols).enumerate() {
                let rows = cover.posts(1, place(n)[1]);
                for (has, cols) in line.iter_mut().zip(&cols) {
                    *has &= rows.as_ref().zip(cols.as_ref()).is_some_and(|(rows, cols)| cover.is_complete(cols, rows));
                }
            }
        }
        has
    }

    /// The samples of a window that lies completely between the outer posts; values without ground are meaningless.
    fn made(&self, request: &Request<'_>) -> Result<Patch, TerrainError> {
        let here = self.form.in_window(request.window);
        let basis = &self.model.basis;
        let albedo = basis.albedo.as_ref().map(Background::geometry);
        let around = here.surroundings(&self.posts(), albedo, &basis.points)?;
        let mut patch = self.model.world.made(request);
        let pace = Pace { least_m: request.feature_min_m, cancel: request.cancel, on_all: false };
        here.settle(&around, &self.model, pace, &mut patch);
        Ok(patch)
    }
}

/// The smallest range of columns and rows that contains all wanted samples.
fn bounding_range(window: &Window, wanted: &[bool]) -> Option<[Range<usize>; 2]> {
    let row = |row: &usize| wanted[row * window.cols..(row + 1) * window.cols].contains(&true);
    let col = |col: &usize| wanted[*col..].iter().step_by(window.cols).any(|wanted| *wanted);
    let (rows, cols) = (0..window.rows, 0..window.cols);
    let rows = rows.clone().find(row)?..rows.rev().find(row)? + 1;
    Some([cols.clone().find(col)?..cols.rev().find(col)? + 1, rows])
}

impl Windows for Elaborated {
    fn patch_for(&self, request: &Request<'_>) -> Option<Patch> {
        let whole = request.window;
        let mut patch = Patch::void(whole);
        let has_ground = self.has_ground(&whole);
        if let Some([cols, rows]) = bounding_range(&whole, &has_ground) {
            let (west, south) = (whole.west + cols.start as i64, whole.south + rows.start as i64);
            let window = Window { west, south, cols: cols.len(), rows: rows.len(), ..whole };
            let made = self.made(&Request { window, ..*request }).ok()?;
            patch.copy_from(&made, [cols.start, rows.start]);
            patch.clear(|k| !has_ground[k]);
        }
        (!request.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))).then_some(patch)
    }

    fn expected_seconds(&self, request: &Request<'_>) -> f64 {
        let window = request.window;
        let side_m = |count: usize| count as f64 * self.form.spacing_m * (1u64 << window.zoom) as f64;
        let [x, y] = self.posts().cell;
        let posts = (side_m(window.cols) / x + 4.0) * (side_m(window.rows) / y + 4.0);
        let one = Request { window: point(window.west << window.zoom, window.south << window.zoom), ..*request };
        self.model.world.expected_seconds(request) + posts * self.model.world.expected_seconds(&one)
    }

    fn has_rocks(&self) -> bool {
        self.model.world.has_rocks()
    }

    fn rock_cover_below(&self, coverage: f64, diameter_m: f64) -> f64 {
        self.model.world.rock_cover_below(coverage, diameter_m)
    }

    fn has_albedo(&self) -> bool {
        self.model.world.albedo.is_some() || self.form.raw.albedo.is_some()
    }
}

impl Patch {
    /// A patch without ground.
    fn void(window: Window) -> Self {
        let count = window.len();
        Self {
            window,
            heights: vec![f64::NAN; count],
            albedo: vec![f64::NAN; count],
            class: vec![SAND; count],
            rock_potential: vec![f64::NAN; count],
        }
    }

    /// Removes the ground from the selected samples.
    fn clear(&mut self, which: impl Fn(usize) -> bool) {
        for k in (0..self.heights.len()).filter(|k| which(*k)) {
            (self.heights[k], self.albedo[k], self.rock_potential[k]) = (f64::NAN, f64::NAN, f64::NAN);
            self.class[k] = SAND;
        }
    }

    /// Copies the samples of a part to this patch, starting at a column and row.
    fn copy_from(&mut self, part: &Self, [col, row]: [usize; 2]) {
        let (from, to) = (part.window.cols, self.window.cols);
        for r in 0..part.window.rows {
            let (own, its) = ((row + r) * to + col, r * from);
            self.heights[own..own + from].copy_from_slice(&part.heights[its..its + from]);
            self.albedo[own..own + from].copy_from_slice(&part.albedo[its..its + from]);
            self.class[own..own + from].copy_from_slice(&part.class[its..its + from]);
            self.rock_potential[own..own + from].copy_from_slice(&part.rock_potential[its..its + from]);
        }
    }
}
