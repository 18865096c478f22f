//! Craters by the ground that they reach.

use super::population::{Crater, Near};
use super::shape::EJECTA_RADII;
use crate::planetary::levels::{Window, spacing};

/// Squares along either side.
const SIDE: usize = 16;

/// The craters of one bombardment that reach a window or its margin, in order of time, with the squares of ground that each reaches.
pub struct Index {
    /// In order of time.
    pub craters: Vec<Crater>,
    origin: [f64; 2],
    square: [f64; 2],
    /// Places in `craters`, rising, by square.
    reaching: Vec<Vec<u32>>,
}

impl Index {
    /// An index of all craters that reach what is looked at.
    pub fn new(craters: Vec<Crater>, near: &Near<'_>) -> Self {
        let Near { window, margin, .. } = near;
        // A lattice unit more, so that the last points lie inside.
        let origin = [window.x(0) - margin, window.y(0) - margin];
        let span = |count: usize| (count - 1) as f64 * spacing(window.zoom) + 2.0 * margin + 1.0;
        let square = [span(window.cols), span(window.rows)].map(|s| s / SIDE as f64);
        let mut index = Self { craters: Vec::new(), origin, square, reaching: vec![Vec::new(); SIDE * SIDE] };
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

    /// Column or row of a place, the nearest for places outside.
    fn along(&self, axis: usize, at: f64) -> usize {
        (((at - self.origin[axis]) / self.square[axis]).max(0.0) as usize).min(SIDE - 1)
    }

    /// Craters that may reach a place within the margin, in order of time.
    pub fn at(&self, place: [f64; 2]) -> impl Iterator<Item = &Crater> {
        let square = self.along(1, place[1]) * SIDE + self.along(0, place[0]);
        self.reaching[square].iter().map(|n| &self.craters[*n as usize])
    }

    /// Craters that may reach a window: those of its place when it is one point within the margin, else all; in order of time.
    pub fn of<'a>(&'a self, window: &Window) -> Box<dyn Iterator<Item = &'a Crater> + 'a> {
        if window.len() == 1 { Box::new(self.at([window.x(0), window.y(0)])) } else { Box::new(self.craters.iter()) }
    }
}
