//! Windows of an elaborated DEM on the lattice of its parameters: all of one surface, at any zoom up to half the posts.

use super::{Elaborate, Model, RawElaborate, point};
use crate::generator::{Input, TerrainError};
use crate::planetary::{Patch, Request, SAND, Window};
use crate::windows::Windows;
use sastrugi_numeric::{Geometry, Streams};
use std::ops::Range;
use std::sync::atomic::Ordering;

/// A window near posts without data is halved down to this many samples, so that only its part without ground is left out.
const SIDE_MIN: usize = 16;

/// A DEM with its detail.
pub struct Elaborated {
    form: Elaborate,
    inputs: Vec<Input>,
    model: Model,
    dem: Geometry,
}

impl Elaborate {
    /// The surface of which this window is one, with the processes at some places of the list, from 0; the others keep their draws.
    ///
    /// # Errors
    /// Inputs that cannot be used.
    pub fn elaborated(
        &self,
        streams: &Streams,
        inputs: &[Input],
        acts: impl Fn(usize) -> bool,
    ) -> Result<Elaborated, TerrainError> {
        let sorted = self.sorted(inputs)?;
        let model = self.model(streams, &sorted, acts)?;
        let dem = sorted.dem.geometry;
        Ok(Elaborated { form: self.clone(), inputs: inputs.to_vec(), model, dem })
    }

    /// Basic spacing, m.
    pub fn spacing_m(&self) -> f64 {
        self.spacing_m
    }

    /// Where lattice point 0 lies in the DEM's coordinates, m.
    pub fn offset_m(&self) -> [f64; 2] {
        self.offset_m
    }

    /// Its parameters.
    pub fn raw(&self) -> &RawElaborate {
        &self.raw
    }

    /// The outer posts of its DEM: west, south, east and north, m, and the distance of posts, the shorter, m.
    ///
    /// # Errors
    /// Inputs that are missing.
    pub fn posts_of(&self, inputs: &[Input]) -> Result<([f64; 4], f64), TerrainError> {
        let g = self.sorted(inputs)?.dem.geometry;
        Ok(([g.x(0), g.y(g.rows - 1), g.x(g.cols - 1), g.y(0)], g.cell[0].min(g.cell[1])))
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
    /// Place of a lattice point in the DEM's coordinates, m.
    pub fn place(&self, point: [f64; 2]) -> [f64; 2] {
        self.form.place(point)
    }

    /// Columns or rows of a window that lie between the outer posts.
    fn inside(&self, axis: usize, count: usize, at: impl Fn(usize) -> f64) -> Range<usize> {
        let g = &self.dem;
        let [low, high] = [[g.x(0), g.x(g.cols - 1)], [g.y(g.rows - 1), g.y(0)]][axis];
        let place = |n: usize| at(n) * self.form.spacing_m + self.form.offset_m[axis];
        let first = (0..count).position(|n| place(n) >= low).unwrap_or(count);
        let last = (0..count).rposition(|n| place(n) <= high).map_or(0, |n| n + 1);
        first..last.max(first)
    }

    /// Makes the samples in some columns and rows of a window.
    fn fill(&self, request: &Request<'_>, cols: Range<usize>, rows: Range<usize>, into: &mut Patch) {
        if cols.is_empty() || rows.is_empty() || request.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
            return;
        }
        let whole = request.window;
        let (west, south) = (whole.west + cols.start as i64, whole.south + rows.start as i64);
        let window = Window { west, south, cols: cols.len(), rows: rows.len(), ..whole };
        match self.made(&Request { window, ..*request }) {
            Ok(made) => into.lay(&made, [cols.start, rows.start]),
            Err(_) if cols.len().max(rows.len()) > SIDE_MIN => {
                let halves = |r: Range<usize>| {
                    let middle = r.start + r.len().div_ceil(2);
                    [r.start..middle, middle..r.end]
                };
                for rows in halves(rows) {
                    halves(cols.clone()).into_iter().for_each(|cols| self.fill(request, cols, rows.clone(), into));
                }
            }
            // Posts without data: there is no ground.
            // Posts without data: there is no ground.
            Err(_) => {}
        }
    }

    fn made(&self, request: &Request<'_>) -> Result<Patch, TerrainError> {
        let here = self.form.in_window(request.window);
        let inputs = here.sorted(&self.inputs)?;
        let surroundings = here.surroundings(&inputs)?;
        let mut patch = self.model.world.made(request);
        here.settle(&inputs, surroundings, &self.model, request.feature_min_m, &mut patch)?;
        Ok(patch)
    }
}

impl Windows for Elaborated {
    fn patch_for(&self, request: &Request<'_>) -> Option<Patch> {
        let window = request.window;
        let mut patch = Patch::void(window);
        let cols = self.inside(0, window.cols, |n| window.x(n));
        let rows = self.inside(1, window.rows, |n| window.y(n));
        self.fill(request, cols, rows, &mut patch);
        (!request.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))).then_some(patch)
    }

    fn expected_seconds(&self, request: &Request<'_>) -> f64 {
        let window = request.window;
        let side_m = |count: usize| count as f64 * self.form.spacing_m * (1u64 << window.zoom) as f64;
        let posts = (side_m(window.cols) / self.dem.cell[0] + 4.0) * (side_m(window.rows) / self.dem.cell[1] + 4.0);
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
    /// Without ground.
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

    /// Takes over the samples of a part, from a column and row on.
    fn lay(&mut self, part: &Self, [col, row]: [usize; 2]) {
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
