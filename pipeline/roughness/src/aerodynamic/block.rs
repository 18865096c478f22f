//! Sums over blocks of the raster. All inputs of z0 are additive, so the jackknife can leave out a block.

use super::crossings::{self, Profiled};
use super::partition::SIDE;
use super::{ObstacleHeight, Wind};
use rayon::prelude::*;
use sastrugi_numeric::Grid;
use std::ops::Range;

/// Sums over the cells with data of one block, or of several.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    cells: f64,
    height: f64,
    square: f64,
    cells_above: f64,
    height_above: f64,
    patches: f64,
    /// By wind direction.
    pub(super) directions: Vec<DirectionSums>,
}

/// Sums of one wind direction.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DirectionSums {
    /// Windward slopes.
    faces: f64,
    profiled: Profiled,
}

impl Sums {
    fn zero(directions: usize) -> Self {
        let directions = vec![DirectionSums::default(); directions];
        Self { cells: 0.0, height: 0.0, square: 0.0, cells_above: 0.0, height_above: 0.0, patches: 0.0, directions }
    }

    fn add(&mut self, other: &Self) {
        self.cells += other.cells;
        self.height += other.height;
        self.square += other.square;
        self.cells_above += other.cells_above;
        self.height_above += other.height_above;
        self.patches += other.patches;
        for (own, others) in self.directions.iter_mut().zip(&other.directions) {
            own.faces += others.faces;
            own.profiled.add(&others.profiled);
        }
    }

    /// Sum of all blocks, or of all but `left_out`.
    pub fn without(blocks: &[Self], left_out: Option<usize>, directions: usize) -> Self {
        let mut total = Self::zero(directions);
        blocks.iter().enumerate().filter(|(k, _)| Some(*k) != left_out).for_each(|(_, block)| total.add(block));
        total
    }

    pub fn has_data(&self) -> bool {
        self.cells > 0.0
    }

    /// Standard deviation of the heights, m.
    pub fn sigma_m(&self) -> f64 {
        let mean = self.height / self.cells;
        let variance = self.square / self.cells - mean * mean;
        // Rounding may give a value below zero.
        if variance < 0.0 { 0.0 } else { variance.sqrt() }
    }

    /// Effective height of the obstacles, m.
    pub fn obstacle_height_m(&self, kind: ObstacleHeight) -> f64 {
        match kind {
            ObstacleHeight::TwoSigma => 2.0 * self.sigma_m(),
            ObstacleHeight::MeanAbove if self.cells_above == 0.0 && self.has_data() => 0.0,
            ObstacleHeight::MeanAbove => self.height_above / self.cells_above,
        }
    }

    pub fn frontal_area_index(&self, direction: usize) -> f64 {
        self.directions[direction].faces / self.patches
    }

    pub fn upcrossings_per_m(&self, direction: usize) -> f64 {
        self.directions[direction].profiled.upcrossings_per_m()
    }

    fn add_height(&mut self, z: f64) {
        self.cells += 1.0;
        self.height += z;
        self.square += z * z;
        if z > 0.0 {
            self.cells_above += 1.0;
            self.height_above += z;
        }
    }

    /// Adds the bilinear patch south-east of a cell, with its gradient.
    fn add_patch(&mut self, [east, north]: [f64; 2], winds: &[Wind]) {
        self.patches += 1.0;
        for (sums, wind) in self.directions.iter_mut().zip(winds) {
            sums.faces += (-(east * wind.sin + north * wind.cos)).max(0.0);
        }
    }
}

/// Sums of each block of a detrended surface, row by row.
pub(super) fn sums_of(surface: &Grid, winds: &[Wind]) -> Vec<Sums> {
    let part = |k: usize, cells: usize| (k * cells).div_ceil(SIDE)..((k + 1) * cells).div_ceil(SIDE);
    let of_block = |block: usize| {
        let (rows, cols) = (part(block / SIDE, surface.rows()), part(block % SIDE, surface.cols()));
        let mut total = Sums::zero(winds.len());
        rows.for_each(|row| total.add(&sums_of_row(surface, row, cols.clone(), winds)));
        total
    };
    let mut blocks: Vec<Sums> = (0..SIDE * SIDE).into_par_iter().map(of_block).collect();
    let sigma_m = Sums::without(&blocks, None, winds.len()).sigma_m();
    for (direction, profiled) in crossings::along(surface, winds, sigma_m).iter().enumerate() {
        for (block, own) in blocks.iter_mut().zip(profiled) {
            block.directions[direction].profiled = *own;
        }
    }
    blocks
}

fn sums_of_row(surface: &Grid, row: usize, cols: Range<usize>, winds: &[Wind]) -> Sums {
    let mut sums = Sums::zero(winds.len());
    let own = surface.row(row);
    cols.clone().map(|col| own[col]).filter(|z| z.is_finite()).for_each(|z| sums.add_height(z));
    if row + 1 < surface.rows() {
        let [east_m, north_m] = surface.geometry.cell.map(|cell_m| 2.0 * cell_m);
        let south = surface.row(row + 1);
        for col in cols.filter(|col| col + 1 < own.len()) {
            let [nw, ne, sw, se] = [own[col], own[col + 1], south[col], south[col + 1]];
            let gradient = [(ne + se - nw - sw) / east_m, (nw + ne - sw - se) / north_m];
            if gradient.iter().all(|slope| slope.is_finite()) {
                sums.add_patch(gradient, winds);
            }
        }
    }
    sums
}
