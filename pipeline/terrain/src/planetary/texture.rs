//! Stochastic interpolation: roughness at every scale, from the coarsest points down.
//!
//! Anchors (points of the grid of spacing `2^anchor`) have height 0. Every other point has
//! $$ h = \frac{1}{4} \sum_{\text{parents}} h_p + s_1 \left(\frac{d}{1\,\text{m}}\right)^{H} g $$
//! with `d` the distance to its parents (m), `g` its own standard normal deviate, `s_1` the roughness (m) and `H` the Hurst exponent
//! in (0, 1]. Averages are linear, so the field added to a sloping base equals the stochastic interpolation of that base.
//!
//! Source: in the paper the amplitude is "a function of the spacing of the parents and of a random variable"; its form is left open. With a
//! power law, the PSD of profiles falls as `f^-(2 H + 1)`. The paper also lets roughness vary from place to place; here `s_1` and `H`
//! are constant over a world.
//!
//! Cost: one normal deviate per point, and about twenty per level for a patch of any size.

use super::levels::{Window, spacing};
use sastrugi_numeric::Counter;

/// Standard deviation of a point about the mean of its parents, at every spacing.
#[derive(Clone, Debug, PartialEq)]
pub struct Amplitudes {
    /// `d^H` with d the distance (m) to the parents of the points of level `2 k + 1` and `2 k + 2`, for every `k`.
    by_zoom: Vec<[f64; 2]>,
}

impl Amplitudes {
    /// Amplitudes per unit of `s_1` for points `spacing_m` apart, up to the spacing `2^anchor`.
    pub fn new(hurst: f64, spacing_m: f64, anchor: u32) -> Self {
        let of = |distance: f64| libm::pow(distance * spacing_m, hurst);
        let by_zoom = (0..anchor).map(|k| [of(spacing(k)), of(spacing(k) * std::f64::consts::SQRT_2)]).collect();
        Self { by_zoom }
    }
}

/// Heights of a window (row by row from the south), 0 at points of spacing `2^anchor`; `scale_m` is `s_1`.
///
/// `anchor` must not be above that of the amplitudes.
pub fn interpolate(window: &Window, anchor: u32, counter: Counter, scale_m: f64, amplitudes: &Amplitudes) -> Vec<f64> {
    // Grid to which the points belong.
    let zoom = window.zoom - u32::from(window.centred);
    if zoom >= anchor || scale_m == 0.0 {
        return vec![0.0; window.len()];
    }
    let parents = window.parents();
    let above = interpolate(&parents, anchor, counter, scale_m, amplitudes);
    let [axis, diagonal] = amplitudes.by_zoom[zoom as usize].map(|a| a * scale_m);
    if window.centred {
        return centre(window, &above, counter, diagonal);
    }
    refine(window, &parents, &above, |i, j| counter.at(j << window.zoom).at(i << window.zoom), axis, diagonal)
}

/// A centred window, from the grid points around its points.
fn centre(window: &Window, above: &[f64], counter: Counter, diagonal: f64) -> Vec<f64> {
    let cols = window.cols + 1;
    let mut field = Vec::with_capacity(window.len());
    for row in 0..window.rows {
        let (line, north) = (&above[row * cols..], &above[(row + 1) * cols..]);
        for col in 0..window.cols {
            let [i, j] = window.place(col, row);
            let parents = (line[col] + line[col + 1]) + (north[col] + north[col + 1]);
            field.push(0.25 * parents + diagonal * counter.at(j).at(i).normal());
        }
    }
    field
}

/// The window, from the points of twice its spacing.
fn refine(
    window: &Window,
    parents: &Window,
    above: &[f64],
    draw: impl Fn(i64, i64) -> Counter,
    axis: f64,
    diagonal: f64,
) -> Vec<f64> {
    // One more point on every side, for the parents of the outermost points.
    let (cols, rows) = (window.cols + 2, window.rows + 2);
    let (west, south) = (window.west - 1, window.south - 1);
    let mut field = vec![0.0; cols * rows];
    for row in 0..rows {
        let j = south + row as i64;
        let line = &above[(j.div_euclid(2) - parents.south) as usize * parents.cols..];
        let first = (west.rem_euclid(2) != j.rem_euclid(2)) as usize;
        for col in (first..cols).step_by(2) {
            let i = west + col as i64;
            let at = (i.div_euclid(2) - parents.west) as usize;
            field[row * cols + col] = if j & 1 == 0 {
                line[at]
            } else {
                let north = &line[parents.cols..];
                0.25 * ((line[at] + line[at + 1]) + (north[at] + north[at + 1])) + diagonal * draw(i, j).normal()
            };
        }
    }
    for row in 1..rows - 1 {
        let j = south + row as i64;
        let first = 1 + ((west + 1).rem_euclid(2) == j.rem_euclid(2)) as usize;
        for col in (first..cols - 1).step_by(2) {
            let k = row * cols + col;
            let parents = (field[k - 1] + field[k + 1]) + (field[k - cols] + field[k + cols]);
            field[k] = 0.25 * parents + axis * draw(west + col as i64, j).normal();
        }
    }
    (1..rows - 1).flat_map(|row| field[row * cols + 1..(row + 1) * cols - 1].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    const SPACING_M: f64 = 0.02;
    const HURST: f64 = 0.7;
    const ANCHOR: u32 = 3;

    /// The definition of the header with `s_1` = 0.5 m, point by point.
    fn defined([i, j]: [i64; 2], counter: Counter) -> f64 {
        let zoom = (i | j).trailing_zeros();
        if zoom >= ANCHOR {
            return 0.0;
        }
        let step = 1i64 << zoom;
        let diagonal = (i / step) & (j / step) & 1 == 1;
        let offsets = if diagonal { [[-1, -1], [1, -1], [-1, 1], [1, 1]] } else { [[-1, 0], [1, 0], [0, -1], [0, 1]] };
        let parents: f64 = offsets.iter().map(|[a, b]| defined([i + a * step, j + b * step], counter)).sum();
        let distance_m = SPACING_M * step as f64 * if diagonal { 2f64.sqrt() } else { 1.0 };
        0.25 * parents + 0.5 * libm::pow(distance_m, HURST) * counter.at(j).at(i).normal()
    }

    /// At every zoom and at cell centres, points are the mean of their parents plus a draw; anchors are 0.
    #[test]
    fn val_points_are_means_of_their_parents_plus_a_draw() {
        let counter = Counter::new(&mut Streams::for_seed(1, "texture").stream("points"));
        let amplitudes = Amplitudes::new(HURST, SPACING_M, ANCHOR);
        for (zoom, centred) in [(0, false), (1, false), (2, false), (1, true), (2, true), (3, true)] {
            let window = Window { zoom, west: -5, south: 2, cols: 11, rows: 9, centred };
            let found = interpolate(&window, ANCHOR, counter, 0.5, &amplitudes);
            for (k, z) in found.iter().enumerate() {
                let place = window.place(k % 11, k / 11);
                let wanted = defined(place, counter);
                assert!((z - wanted).abs() < 1e-12, "zoom {zoom} {place:?}: {z} {wanted}");
            }
            assert!(found.iter().any(|z| z.abs() > 1e-3));
        }
    }
}
