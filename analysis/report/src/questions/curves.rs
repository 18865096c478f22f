//! Spectra and height distributions of several heightfields in one frame.

use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot, WIDTH};
use crate::render::svg::{Paint, Stroke};
use crate::render::thin;
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::{HeightDistributionRow, PsdRow, TerrainRow};

/// Height of a chart, px.
pub const HEIGHT: f64 = 280.0;

/// Factor by which a spectrum may miss either end of a slope's band.
const END_MAX: f64 = 1.5;

/// A curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Name in the legend; `None` for one of many.
    pub name: Option<String>,
    /// Line.
    pub stroke: Stroke,
    /// Points in order of x.
    pub points: Vec<(f64, f64)>,
}

/// Ends of both axes.
#[derive(Clone, Copy, Debug)]
pub struct Ranges {
    x: (f64, f64),
    y: (f64, f64),
}

/// A straight line in log-log axes over a band of frequencies, through the mean of the points in that band.
#[derive(Clone, Copy, Debug)]
pub struct Slope {
    slope: f64,
    /// A point of the line, in logarithms.
    centre: (f64, f64),
    /// Ends of the band, cycles/m.
    band: [f64; 2],
}

/// Points of a spectrum, over ten decades at most. Beyond a band limit, and in rings without a mode in which the surface varies, densities
/// are rounding noise.
pub fn spectrum(rows: &[&PsdRow]) -> Vec<(f64, f64)> {
    let least = 1e-10 * rows.iter().map(|r| r.psd_m4).fold(0.0, f64::max);
    rows.iter().filter(|r| r.psd_m4 >= least).map(|r| (r.frequency_cycles_m, r.psd_m4)).collect()
}

/// Points of a histogram: the middle of each bin that has cells.
pub fn histogram(rows: &[&HeightDistributionRow]) -> Vec<(f64, f64)> {
    let middle = |r: &&HeightDistributionRow| (0.5 * (r.low_m + r.high_m), r.density_per_m);
    rows.iter().map(middle).filter(|p| p.1 > 0.0).collect()
}

/// Ranges that contain all curves.
pub fn ranges<'a>(curves: impl IntoIterator<Item = &'a Curve>) -> Ranges {
    let none = (f64::INFINITY, f64::NEG_INFINITY);
    let widen = |(low, high): (f64, f64), v: f64| (low.min(v), high.max(v));
    let points = curves.into_iter().flat_map(|c| c.points.iter());
    points.fold(Ranges { x: none, y: none }, |r, p| Ranges { x: widen(r.x, p.0), y: widen(r.y, p.1) })
}

/// The band in which the stage `roughness` fits the slope of a spectrum: from 4 cycles per shortest side to half the
/// Nyquist frequency, cycles/m.
pub fn slope_band(terrain: &TerrainRow) -> [f64; 2] {
    let side_m = (terrain.cols as f64 * terrain.cell_x_m).min(terrain.rows as f64 * terrain.cell_y_m);
    [4.0 / side_m, 0.25 / terrain.cell_x_m.max(terrain.cell_y_m)]
}

/// True if the curves cover the band of a fitted slope, up to the ends that their bins leave free. If they do not, densities beyond them are
/// rounding noise, to which the slope was fitted as well.
pub fn covers(band: [f64; 2], curves: &[Curve]) -> bool {
    let ends =
        |of: fn(f64, f64) -> f64, start: f64| curves.iter().flat_map(|c| c.points.iter()).map(|p| p.0).fold(start, of);
    ends(f64::min, f64::INFINITY) <= END_MAX * band[0] && ends(f64::max, 0.0) >= band[1] / END_MAX
}

/// A fitted slope through the middle of the curves in its band; `None` if either is unknown.
pub fn slope(slope: f64, band: [f64; 2], curves: &[Curve]) -> Option<Slope> {
    let points = curves.iter().flat_map(|c| c.points.iter()).filter(|p| p.0 >= band[0] && p.0 <= band[1]);
    let logs: Vec<(f64, f64)> = points.map(|p| (libm::log(p.0), libm::log(p.1))).collect();
    let [x, y] =
        [logs.iter().map(|l| l.0).collect::<Vec<_>>(), logs.iter().map(|l| l.1).collect()].map(|v| sums::mean(&v));
    (slope.is_finite() && x.is_finite() && y.is_finite()).then_some(Slope { slope, centre: (x, y), band })
}

/// Power spectral densities in log-log axes, with a fitted slope.
pub fn spectra(id: &str, curves: &[Curve], ranges: Ranges, slope: Option<Slope>) -> Plot {
    let dashed = Stroke::new(Paint::Ink, 1.6).dashed("6 4");
    let mut legend = entries(curves);
    if slope.is_some() && !legend.is_empty() {
        legend.push((Mark::Line(dashed), "fitted slope".into()));
    }
    let y = Axis::log(ranges.y.0 / 1.5, ranges.y.1 * 1.5);
    let x = (Axis::log(ranges.x.0 / 1.1, ranges.x.1 * 1.1), "spatial frequency, cycles/m");
    let mut plot = Plot::new((WIDTH, HEIGHT), x, (y, "power spectral density, m⁴"), &legend);
    draw(&mut plot, id, curves);
    if let Some(Slope { slope, centre, band }) = slope {
        let on_line = |x: f64| (x, libm::exp(centre.1 + slope * (libm::log(x) - centre.0)));
        plot.line(band.map(on_line), dashed);
    }
    plot.svg.close();
    plot
}

/// Height distributions.
pub fn distributions(id: &str, curves: &[Curve], ranges: Ranges) -> Plot {
    let x = (Axis::linear(ranges.x.0, ranges.x.1), "height, m");
    // A logarithmic axis shows the tails: a normal distribution is a parabola.
    let y = (Axis::log(ranges.y.0.max(1e-4 * ranges.y.1) / 1.5, 1.5 * ranges.y.1), "density, 1/m");
    let mut plot = Plot::new((WIDTH, HEIGHT), x, y, &entries(curves));
    draw(&mut plot, id, curves);
    plot.svg.close();
    plot
}

/// Curves of positive values in log-log axes.
pub fn log_log(id: &str, curves: &[Curve], x_title: &str, y_title: &str) -> Plot {
    let Ranges { x, y } = ranges(curves);
    let x = (Axis::log(x.0 / 1.1, x.1 * 1.1), x_title);
    let y = (Axis::log(y.0.max(y.1 * 1e-10) / 1.5, y.1 * 1.5), y_title);
    let mut plot = Plot::new((WIDTH, HEIGHT), x, y, &entries(curves));
    draw(&mut plot, id, curves);
    plot.svg.close();
    plot
}

/// Draws the curves inside a clip that stays open.
fn draw(plot: &mut Plot, id: &str, curves: &[Curve]) {
    plot.clip(&format!("{id}-clip"));
    for curve in curves {
        let placed = plot.place(curve.points.iter().copied());
        plot.svg.polyline(&thin::line(&placed, 1.0), curve.stroke);
    }
}

fn entries(curves: &[Curve]) -> Vec<Entry> {
    curves.iter().filter_map(|c| Some((Mark::Line(c.stroke), c.name.clone()?))).collect()
}
