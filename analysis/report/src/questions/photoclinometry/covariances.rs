//! Covariance of the true and the recovered surface, where the study fits both.

use super::surfaces::Surface;
use crate::content::{Block, Figure, Numbers, TableBlock, count, number, slug, text};
use crate::data::Data;
use crate::questions::curves::HEIGHT;
use crate::questions::sql::quoted;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot, WIDTH};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::{CovarianceRow, FitRow};

/// Largest ratio of the windows of two fits that are compared.
const WINDOWS_MAX: f64 = 1.1;
/// Pairs drawn; all are in the table.
const DRAWN_MAX: usize = 6;
const TRUTH: Stroke = Stroke { paint: Paint::Ink, width: 2.0, dash: "", opacity: 1.0 };
const RECOVERED: Stroke = Stroke { paint: Paint::Series(0), width: 2.0, dash: "7 3", opacity: 1.0 };
const WORDS: &str = "Isotropic covariances of the residuals of two fits, whose windows have nearly the same size. The difference is the RMS over \
the lags of the recovered surface, with the truth's covariance interpolated between its own lags, as a share of the truth's covariance at the \
shortest of these lags. The band RMS below the window needs no model. If the range is not identified, sigma and b are meaningless, but their \
ratio is not.";

/// Fits of a true surface and of one recovered from its images, in the same mode with similar windows.
pub struct Pair<'a> {
    /// Fit of the true surface.
    pub truth: &'a FitRow,
    /// Fit of the recovered surface.
    pub recovered: &'a FitRow,
    true_bins: Vec<&'a CovarianceRow>,
    bins: Vec<&'a CovarianceRow>,
}

/// All pairs, in the order of the surfaces.
pub fn pairs<'a>(data: &'a Data, surfaces: &[Surface]) -> Vec<Pair<'a>> {
    let of = |id: &str| data.fits.iter().filter(|f| f.dem_id == id).collect::<Vec<&FitRow>>();
    let pair = |s: &Surface| -> Vec<Pair<'a>> {
        let truths = of(&s.row.surface_id);
        let with_truth = |recovered: &'a FitRow| {
            let truth = truths.iter().find(|t| comparable(t, recovered))?;
            Some(Pair { truth, recovered, true_bins: rings(data, truth), bins: rings(data, recovered) })
        };
        of(s.id()).into_iter().filter_map(with_truth).collect()
    };
    surfaces.iter().flat_map(pair).collect()
}

/// Same mode, and windows of the same size up to rounding to whole cells.
fn comparable(a: &FitRow, b: &FitRow) -> bool {
    let alike = |a: f64, b: f64| a.max(b) <= WINDOWS_MAX * a.min(b);
    a.mode == b.mode && alike(a.window_x_m, b.window_x_m) && alike(a.window_y_m, b.window_y_m)
}

fn rings<'a>(data: &'a Data, fit: &FitRow) -> Vec<&'a CovarianceRow> {
    let isotropic =
        |r: &&CovarianceRow| r.fit_id == fit.fit_id && r.azimuth_deg.is_none() && r.covariance_m2.is_finite();
    data.covariance.iter().filter(isotropic).collect()
}

impl Pair<'_> {
    /// Covariance of the truth at a lag, linear between its bins; `None` beyond them.
    fn truth_at(&self, lag_m: f64) -> Option<f64> {
        let between = self.true_bins.windows(2).find(|w| w[0].lag_m <= lag_m && lag_m <= w[1].lag_m)?;
        let share = (lag_m - between[0].lag_m) / (between[1].lag_m - between[0].lag_m);
        Some(between[0].covariance_m2 + share * (between[1].covariance_m2 - between[0].covariance_m2))
    }

    /// True and recovered covariance at the lags that both have, except lag 0, which includes the noise of a cell.
    fn common(&self) -> Vec<(f64, f64)> {
        self.bins
            .iter()
            .filter(|b| b.lag_m > 0.0)
            .filter_map(|b| Some((self.truth_at(b.lag_m)?, b.covariance_m2)))
            .collect()
    }

    /// RMS difference over the truth's covariance at the shortest common lag; NaN without common lags.
    fn difference(&self) -> f64 {
        let common = self.common();
        let squares: Vec<f64> = common.iter().map(|(t, r)| (r - t) * (r - t)).collect();
        common.first().map_or(f64::NAN, |first| sums::mean(&squares).sqrt() / first.0.abs())
    }

    /// The verdict on covariance.
    pub fn sentence(&self) -> String {
        format!(
            "Its covariance differs from the truth's by {} (RMS over lags); its band RMS below a window of {} is {} of the truth's.",
            set::percent(self.difference(), 0),
            set::with_unit(self.truth.window_x_m, 3, "m"),
            set::percent(self.recovered.band_rms_m / self.truth.band_rms_m, 0)
        )
    }
}

/// Text, figures and the table; empty where no surface has fits of both itself and its truth.
pub fn blocks(data: &Data, pairs: &[Pair]) -> Vec<Block> {
    if pairs.is_empty() {
        let both = data.photoclinometry.iter().any(|r| data.fits.iter().any(|f| f.dem_id == r.photoclinometry_id));
        let missing = "Covariances cannot be compared: recovered surfaces have fits, but no true surface has one with a window of nearly the \
                       same size. Add a `[[fit]]` of each with the same `outer_scale_m`.";
        return if both { vec![Block::Text(missing.into())] } else { Vec::new() };
    }
    let figures = pairs.iter().take(DRAWN_MAX).map(figure).collect();
    vec![
        Block::Heading("Covariance".into()),
        Block::Text(WORDS.into()),
        Block::Figures(figures),
        Block::Table(table(pairs)),
    ]
}

fn figure(pair: &Pair) -> Figure {
    let id = slug(&format!("photoclinometry-covariance-{}", pair.recovered.fit_id));
    let all = || pair.true_bins.iter().chain(&pair.bins);
    let values = || all().map(|b| b.covariance_m2);
    let (low, high) = (values().fold(0.0, f64::min), values().fold(0.0, f64::max));
    let x = Axis::linear(0.0, 1.03 * all().map(|b| b.lag_m).fold(0.0, f64::max));
    let y = Axis::linear(low - 0.04 * (high - low), high + 0.06 * (high - low));
    let legend: Vec<Entry> = vec![
        (Mark::Track(TRUTH, Symbol::Disc), format!("truth ({})", pair.truth.dem_id)),
        (Mark::Track(RECOVERED, Symbol::Square), pair.recovered.dem_id.clone()),
    ];
    let mut plot = Plot::new((WIDTH, HEIGHT), (x, "lag, m"), (y, "covariance, m²"), &legend);
    plot.line([(0.0, 0.0), (x.range().1, 0.0)], Stroke::new(Paint::Muted, 1.0));
    plot.clip(&format!("{id}-clip"));
    for (bins, stroke, symbol) in [(&pair.true_bins, TRUTH, Symbol::Disc), (&pair.bins, RECOVERED, Symbol::Square)] {
        let points = || bins.iter().map(|b| (b.lag_m, b.covariance_m2));
        plot.line(points(), stroke);
        for at in plot.place(points()) {
            plot.svg.symbol(symbol, at, 2.8, stroke.paint);
        }
    }
    plot.svg.close();
    let ids = [&pair.truth.fit_id, &pair.recovered.fit_id].map(|id| quoted(id)).join(", ");
    let numbers = Numbers::select(
        &format!("fit_id in ({ids}) and azimuth_deg is null"),
        all().copied(),
        &["fit_id", "bin", "lag_m", "covariance_m2", "pairs"],
    );
    Figure {
        id,
        title: format!("Covariance of {} and its truth.", pair.recovered.dem_id),
        caption: format!(
            "Fits {} and {}; lag 0 includes the noise of a cell.",
            pair.truth.fit_id, pair.recovered.fit_id
        ),
        description: format!(
            "Covariance of the truth and of {} against lag. {}",
            pair.recovered.dem_id,
            pair.sentence()
        ),
        svg: plot.svg,
        numbers,
    }
}

/// A fitted number with the ends of its interval.
type Fitted = (&'static str, &'static str, fn(&FitRow) -> [f64; 3]);

const FITTED: [Fitted; 4] = [
    ("band RMS below the window", "m", |f| [f.band_rms_m, f64::NAN, f64::NAN]),
    ("σ", "m", |f| [f.sigma_m, f.sigma_low_m, f.sigma_high_m]),
    ("range b", "m", |f| [f.range_m, f.range_low_m, f.range_high_m]),
    ("σ²/b", "m", |f| [f.sigma2_over_range_m, f.sigma2_over_range_low_m, f.sigma2_over_range_high_m]),
];

fn table(pairs: &[Pair]) -> TableBlock {
    let columns = [
        ("surface", ""),
        ("model", ""),
        ("parameter", ""),
        ("unit", ""),
        ("truth", ""),
        ("low", ""),
        ("high", ""),
        ("recovered", ""),
        ("low", ""),
        ("high", ""),
        ("recovered over truth", "1"),
        ("common lags", "1"),
        ("covariance difference", "%"),
    ];
    let mut numbers = Numbers::computed("select * from 'tables/fits/*.parquet'", &columns).with_mixed_units();
    for pair in pairs {
        // Other models have other parameters.
        let shared = if pair.truth.model == pair.recovered.model { FITTED.len() } else { 1 };
        let model = if shared > 1 {
            pair.truth.model.clone()
        } else {
            format!("{} / {}", pair.truth.model, pair.recovered.model)
        };
        for (k, (name, unit, of)) in FITTED.iter().take(shared).enumerate() {
            let (truth, recovered) = (of(pair.truth), of(pair.recovered));
            let once = |v| if k == 0 { v } else { number(f64::NAN) };
            numbers.row(
                [text(&pair.recovered.dem_id), text(&model), text(*name), text(*unit)]
                    .into_iter()
                    .chain(truth.map(number))
                    .chain(recovered.map(number))
                    .chain([
                        number(recovered[0] / truth[0]),
                        once(count(pair.common().len())),
                        once(number(100.0 * pair.difference())),
                    ]),
            );
        }
    }
    TableBlock {
        id: "photoclinometry-covariance".into(),
        caption: "Fits of true and recovered surfaces, with their intervals".into(),
        numbers,
    }
}
