//! Images, and the brightness of each map cell in them at the current heights.

use super::cell::Sample;
use crate::camera::Camera;
use crate::description::Noise;
use crate::direction::Vector;
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, sums};

/// Maximum number of samples of a cell along an axis.
const SAMPLES_MAX: usize = 16;
/// Weights of pixels below this are ignored, so that rounding does not spread missing pixels.
const SHARE_MIN: f64 = 1e-9;

/// A registered image.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Camera that took it.
    pub camera: Camera,
    /// Unit vector to the light.
    pub light: Vector,
    /// Recorded brightness of a surface of brightness 1; initial value.
    pub exposure: f64,
    /// Brightness added by haze; initial value.
    pub haze: f64,
    /// Brightness (I/F) of every pixel, rows from the top; NaN without data.
    pub brightness: Vec<f64>,
}

impl Image {
    /// Median of the pixels.
    pub(super) fn median(&self) -> f64 {
        sums::median(&sums::finite(&self.brightness))
    }

    /// Brightness at a position, bilinear between pixel centres; border pixels extend to the edge of the image. NaN outside, and next to
    /// missing pixels.
    pub fn at(&self, [col, row]: [f64; 2]) -> f64 {
        let [rows, cols] = self.camera.shape();
        let beyond = |v: f64, n: usize| v.is_nan() || v < -SHARE_MIN || v > n as f64 + SHARE_MIN;
        if beyond(col, cols) || beyond(row, rows) {
            return f64::NAN;
        }
        let place = |v: f64, n: usize| {
            let v = (v - 0.5).clamp(0.0, (n - 1) as f64);
            let first = (v as usize).min(n.saturating_sub(2));
            (first, v - first as f64)
        };
        let ((first_col, east), (first_row, south)) = (place(col, cols), place(row, rows));
        let mut sum = 0.0;
        for (r, down) in [(first_row, 1.0 - south), (first_row + 1, south)] {
            for (c, across) in [(first_col, 1.0 - east), (first_col + 1, east)] {
                if down > SHARE_MIN && across > SHARE_MIN {
                    sum += down * across * self.brightness[r * cols + c];
                }
            }
        }
        sum
    }
}

/// Brightness of the map's cells in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct Observed {
    /// Mean brightness of every cell; NaN where the image does not show it.
    pub brightness: Vec<f64>,
    /// Number of pixels in a cell, at least 1.
    pub pixels: Vec<f32>,
}

/// A surface on the map's cells.
#[derive(Clone, Copy)]
pub struct Relief<'a> {
    /// The map.
    pub geometry: &'a Geometry,
    /// Height of every cell, m; NaN where it is unknown.
    pub heights_m: &'a [f64],
}

impl Relief<'_> {
    /// Centre of a cell on the surface.
    pub fn point(&self, k: usize) -> Vector {
        let g = self.geometry;
        [g.x(k % g.cols), g.y(k / g.cols), self.heights_m[k]]
    }

    /// Slopes of a cell from the neighbouring heights: the mean over both edges, or one edge at a border or next to an unknown height; NaN if
    /// the cell itself has no height.
    pub fn slopes(&self, k: usize) -> [f64; 2] {
        if self.heights_m[k].is_nan() {
            return [f64::NAN; 2];
        }
        let [west, east, south, north] = self.edges(k).map(|edge| edge.filter(|slope| slope.is_finite()));
        let mean = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => 0.5 * (a + b),
            (a, b) => a.or(b).unwrap_or(0.0),
        };
        [mean(west, east), mean(south, north)]
    }

    /// Slopes over the edges of a cell: west, east, south, north; `None` beyond the border.
    pub fn edges(&self, k: usize) -> [Option<f64>; 4] {
        let (g, z) = (self.geometry, self.heights_m);
        let (r, c) = (k / g.cols, k % g.cols);
        let [cell_x, cell_y] = g.cell;
        [
            (c > 0).then(|| (z[k] - z[k - 1]) / cell_x),
            (c + 1 < g.cols).then(|| (z[k + 1] - z[k]) / cell_x),
            (r + 1 < g.rows).then(|| (z[k] - z[k + g.cols]) / cell_y),
            (r > 0).then(|| (z[k - g.cols] - z[k]) / cell_y),
        ]
    }
}

impl Observed {
    /// Projects every cell into the image. A cell that covers several pixels takes their mean: one sample per pixel covered along each axis (up
    /// to 16), on the plane through its centre.
    pub fn new(image: &Image, relief: Relief) -> Self {
        let cells: Vec<(f64, f32)> =
            (0..relief.geometry.len()).into_par_iter().with_min_len(1024).map(|k| one_cell(image, relief, k)).collect();
        let (brightness, pixels) = cells.into_iter().unzip();
        Self { brightness, pixels }
    }
}

fn one_cell(image: &Image, relief: Relief, k: usize) -> (f64, f32) {
    const NONE: (f64, f32) = (f64::NAN, 1.0);
    let (point, [p, q]) = (relief.point(k), relief.slopes(k));
    let [cell_x, cell_y] = relief.geometry.cell;
    let place = |u: f64, v: f64| {
        image.camera.project([point[0] + u * cell_x, point[1] + v * cell_y, point[2] + u * cell_x * p + v * cell_y * q])
    };
    let (Some(west), Some(east), Some(south), Some(north)) =
        (place(-0.5, 0.0), place(0.5, 0.0), place(0.0, -0.5), place(0.0, 0.5))
    else {
        return NONE;
    };
    let across = [east[0] - west[0], east[1] - west[1]];
    let up = [north[0] - south[0], north[1] - south[1]];
    let count =
        |v: [f64; 2]| ((v[0] * v[0] + v[1] * v[1]).sqrt() - 1e-6).ceil().clamp(1.0, SAMPLES_MAX as f64) as usize;
    let (columns, rows) = (count(across), count(up));
    let mut sum = 0.0;
    for row in 0..rows {
        for col in 0..columns {
            let at = place((col as f64 + 0.5) / columns as f64 - 0.5, (row as f64 + 0.5) / rows as f64 - 0.5);
            sum += at.map_or(f64::NAN, |at| image.at(at));
        }
    }
    let pixels = (across[0] * up[1] - across[1] * up[0]).abs().max(1.0);
    (sum / (columns * rows) as f64, pixels as f32)
}

/// Exposure and haze of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Recorded brightness of a surface of brightness 1.
    pub exposure: f64,
    /// Brightness added by haze.
    pub haze: f64,
}

/// All images with their calibrations and observed cells.
pub struct Stack<'a> {
    /// Images.
    pub images: &'a [Image],
    /// Exposure and haze of each image.
    pub calibrations: &'a [Calibration],
    /// Brightness of the cells in each image.
    pub observed: &'a [Observed],
    /// Brightness below which a pixel is in shadow, for every image.
    pub shadows: &'a [f64],
    /// Noise of a pixel.
    pub noise: Noise,
}

impl Stack<'_> {
    /// True where an image shows a cell, lit or not.
    pub fn seen(&self, k: usize) -> bool {
        self.observed.iter().any(|o| o.brightness[k].is_finite())
    }

    /// The cell as seen in image `image`; `None` in shadow, outside the image, and on facets that face away from the camera.
    pub fn sample(&self, image: usize, k: usize, relief: Relief) -> Option<Sample> {
        let (source, observed) = (&self.images[image], &self.observed[image]);
        let Calibration { exposure, haze } = self.calibrations[image];
        let raw = observed.brightness[k];
        if !raw.is_finite() || raw <= self.shadows[image] {
            return None;
        }
        let sigma = self.noise.deviation(raw) / f64::from(observed.pixels[k]).sqrt();
        Some(Sample {
            brightness: (raw - haze) / exposure,
            sigma: sigma / exposure,
            light: source.light,
            view: source.camera.view_from(relief.point(k)),
        })
    }
}
