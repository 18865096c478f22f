//! Spatial index of craters by the ground that they reach.

use super::population::{Crater, Near};
use super::shape::EJECTA_RADII;
use crate::planetary::levels::{Window, spacing};

/// Squares along each side.
const SIDE: usize = 16;

/// The craters of one bombardment that reach a window or its margin, and the squares of ground that each reaches.
pub struct Index {
    /// The craters, in order of time.
    pub craters: Vec<Crater>,
    /// South-west and north-east corners of the indexed ground, lattice units.
    corners: [[f64; 2]; 2],
    /// Distance between the window's points, lattice units.
    unit: f64,
    square: [f64; 2],
    /// For each square, indices in `craters`, ascending.
    reaching: Vec<Vec<u32>>,
}

impl Index {
    /// An index of craters that reach the search area.
    pub fn new(craters: Vec<Crater>, near: &Near<'_>) -> Self {
        let Near { window, margin, .. } = near;
        let [low, high] = window.corners();
        let corners = [low.map(|at| at - margin), high.map(|at| at + margin)];
        // One lattice unit more, so that the last points lie inside.
        let square = [0, 1].map(|axis| (corners[1][axis] - corners[0][axis] + 1.0) / SIDE as f64);
        let (unit, reaching) = (spacing(window.zoom), vec![Vec::new(); SIDE * SIDE]);
        let mut index = Self { craters: Vec::new(), corners, unit, square, reaching };
        for (number, crater) in craters.iter().enumerate() {
            let reach = EJECTA_RADII * crater.radius;
            let [(west, east), (south, north)] = [0, 1].map(|axis| {
                (index.along(axis, crater.centre[axis] - reach), index.along(axis, crater.centre[axis] + reach))
            });
            for row in south..=north {
                for col in west..=east {
                    index.reaching[row * SIDE + col].push(number as u32);
                }
            }
        }
        index.craters = craters;
        index
    }

    /// Column or row of squares at a coordinate; the nearest one outside.
    fn along(&self, axis: usize, at: f64) -> usize {
        (((at - self.corners[0][axis]) / self.square[axis]).max(0.0) as usize).min(SIDE - 1)
    }

    /// Craters that may reach a position within the margin, in order of time.
    pub fn at(&self, place: [f64; 2]) -> impl Iterator<Item = &Crater> {
        let square = self.along(1, place[1]) * SIDE + self.along(0, place[0]);
        self.reaching[square].iter().map(|n| &self.craters[*n as usize])
    }

    /// Craters that may reach a window, in order of time: those at its position if it is a single point within the margin, else all.
    pub fn of<'a>(&'a self, window: &Window) -> Box<dyn Iterator<Item = &'a Crater> + 'a> {
        if window.len() == 1 { Box::new(self.at([window.x(0), window.y(0)])) } else { Box::new(self.craters.iter()) }
    }

    /// Craters wider than `crater` that may reach its retained points, a window, in order of time; `None` if the index may not contain all of
    /// them: if the window extends beyond the indexed ground, or wider craters may lie between the points of that ground.
    pub fn wider(&self, crater: &Crater, window: &Window) -> Option<Vec<&Crater>> {
        let [low, high] = window.corners();
        let [lowest, highest] = self.corners;
        let inside = (0..2).all(|axis| low[axis] >= lowest[axis] && high[axis] <= highest[axis]);
        // Slightly more than the point spacing, to allow for rounding.
        if !inside || 2.0 * EJECTA_RADII * crater.radius < 1.001 * self.unit {
            return None;
        }
        let [(west, east), (south, north)] =
            [0, 1].map(|axis| (self.along(axis, low[axis]), self.along(axis, high[axis])));
        let squares = (south..=north).flat_map(|row| (west..=east).map(move |col| row * SIDE + col));
        let wide = |n: &u32| self.craters[*n as usize].diameter_m > crater.diameter_m;
        let mut numbers: Vec<u32> = squares.flat_map(|k| self.reaching[k].iter().copied().filter(wide)).collect();
        if (west, south) != (east, north) {
            numbers.sort_unstable();
            numbers.dedup();
        }
        Some(numbers.into_iter().map(|n| &self.craters[n as usize]).collect())
    }
}
