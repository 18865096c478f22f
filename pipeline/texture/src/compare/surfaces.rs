//! Compares two measured surfaces.

use super::heights::HeightCurve;
use super::verdict::{Finding, Null, decide, overall};
use super::{CompareError, CompareSettings, Comparison, Measure};
use crate::covariance::bins::Layout;
use crate::covariance::form::{Role, half_turn};
use crate::covariance::{Covariance, Form, LagBins, masked_covariance};
use crate::fit::FitError;
use crate::fit::case::Case;
use crate::fit::estimator::{Estimate, Estimator, Likelihood, Refits, ordinary};
use crate::fit::resampling::{self, Part, upper_p};
use rayon::prelude::*;
use sastrugi_numeric::{Grid, Streams, sums};
use std::f64::consts::PI;

/// Block bootstraps of each side; each gives four replicates.
const BLOCK_DRAWS: usize = 25;
/// Level of the warning that a model does not describe a side.
const MISFIT_LEVEL: f64 = 0.01;

/// The quantities of one surface that are compared.
#[derive(Clone, Debug)]
struct Measured {
    /// Search coordinates of the isotropic fit.
    at: Vec<f64>,
    /// Elongation `ln(1 / ratio) (cos 2 a, sin 2 a)`.
    elongation: [f64; 2],
    heights: HeightCurve,
    /// Generalised sum of squares of the isotropic fit per degree of freedom.
    misfit_ratio: f64,
}

/// One side: its data, estimators on rings and on bins by direction, and the isotropic and anisotropic estimates.
pub(super) struct Side<'a> {
    rings: Estimator<'a>,
    pub(super) directions: Estimator<'a>,
    round: Estimate,
    /// The anisotropic fit.
    pub(super) long: Estimate,
    heights: HeightCurve,
}

/// Compares two DEMs in metres with NaN where there is no data. Their grids may differ; each side is simulated on its own grid.
///
/// # Errors
/// A side that cannot be fitted (see [`FitError`]).
pub fn surfaces(a: &Grid, b: &Grid, settings: &CompareSettings, streams: &Streams) -> Result<Comparison, CompareError> {
    settings.check_simulations()?;
    let cases = [case("A", a, settings)?, case("B", b, settings)?];
    let directional = cases.each_ref().map(|c| c.bins_of(Layout::DIRECTIONAL));
    let form = &settings.form;
    let sides = [Side::new("A", &cases[0], &directional[0], form)?, Side::new("B", &cases[1], &directional[1], form)?];
    let measured = sides.each_ref().map(Side::measured);
    let share = weight(&cases);
    let pooled = pool(&sides, &measured, share);
    let marginal = measured[0].heights.pooled(&measured[1].heights, share);
    let count = settings.parameters().simulations as usize;
    let nulls = [("a", &sides[0]), ("b", &sides[1])]
        .map(|(name, side)| side.simulated(&pooled, count, &streams.child("null").child(name)));
    let widened = Widening::of(&sides, &nulls, streams);
    let findings = findings(&sides, &measured, &nulls, &marginal, &widened, settings);
    let alpha = settings.parameters().alpha;
    let quantities = decide(findings, alpha);
    let (answer, sentence) = overall(&quantities);
    Ok(Comparison {
        what: "surfaces",
        quantities,
        interleaved: None,
        blocks: None,
        answer,
        sentence,
        alpha,
        model: form.name().to_owned(),
        simulations: count,
        streams: streams.label(),
        notes: notes(&measured, &nulls, form, &widened),
    })
}

pub(super) fn case<'a>(
    side: &'static str,
    dem: &'a Grid,
    settings: &'a CompareSettings,
) -> Result<Case<'a>, CompareError> {
    Case::new(dem, &settings.fit).map_err(|error| CompareError::Side { side, error })
}

/// The weight of A: its share of the area used for the covariances.
fn weight(cases: &[Case; 2]) -> f64 {
    let [a, b] = cases.each_ref().map(|c| c.survey.kept as f64 * c.geometry.cell[0] * c.geometry.cell[1]);
    a / (a + b)
}

impl<'a> Side<'a> {
    pub(super) fn new(
        side: &'static str,
        case: &'a Case<'a>,
        directional: &'a LagBins,
        form: &Form,
    ) -> Result<Self, CompareError> {
        let rings = Estimator::new(case, &case.bins);
        let directions = Estimator::rough(case, directional);
        let naive = ordinary(case, &Form::parse("exponential")?);
        let (sigma_m, range_m) = (1.2 * naive.covariance.sigma_m(), 1.5 * naive.covariance.range_m());
        let round = rings.fit(form, sigma_m, range_m);
        if round.likelihood.is_none() {
            return Err(CompareError::NoLikelihood { side });
        }
        let cell_m = case.geometry.cell[0].max(case.geometry.cell[1]);
        let range_m = round.covariance.range_m();
        if round.covariance.is_stationary() && range_m <= cell_m {
            return Err(CompareError::Side { side, error: FitError::White { range_m, cell_m } });
        }
        let long = lengthened(&directions, &round).ok_or(CompareError::NoLikelihood { side })?;
        let residual = case.residual().map_err(|error| CompareError::Side { side, error })?;
        let heights = HeightCurve::of(&residual);
        Ok(Self { rings, directions, round, long, heights })
    }

    fn measured(&self) -> Measured {
        Measured {
            at: self.round.at.clone(),
            elongation: elongation(&self.long.at),
            heights: self.heights.clone(),
            misfit_ratio: self.round.misfit_ratio().unwrap_or(f64::NAN),
        }
    }

    /// Surfaces of a covariance on this side's grid and mask, measured as the side was. Deviations on a part are scaled to those of
    /// the complete raster.
    fn simulated(&self, covariance: &Covariance, count: usize, streams: &Streams) -> Vec<Measured> {
        let case = self.rings.case;
        let part = Part::of(case);
        let (cols, scale) = (part.cols, part.scale);
        let nulls = part.null_surfaces(case, covariance);
        let [round, long] = [(&self.rings, &self.round), (&self.directions, &self.long)]
            .map(|(estimator, own)| centred(estimator, &own.form, covariance));
        let freedom = (self.rings.bins.len().saturating_sub(round.at.len())).max(1) as f64;
        let (round_refits, long_refits) = (self.rings.refits(&round), self.directions.refits(&long));
        (0..count)
            .into_par_iter()
            .map(|k| {
                let null = nulls.one(&streams.child(&format!("surface-{k}")));
                let (trim, heights) = (null.trim, HeightCurve::of(&null.residual));
                let estimate = masked_covariance(&null.trimmed(), cols, case.max_lag);
                let refit = |estimator: &Estimator, refits: &Refits| {
                    refits.to(&estimator.bins.means(&estimate), trim.threshold_m)
                };
                let (near, far) = (refit(&self.rings, &round_refits), refit(&self.directions, &long_refits));
                let shrink = |found: &[f64], centre: &[f64]| -> Vec<f64> {
                    found.iter().zip(centre).map(|(f, c)| c + scale * (f - c)).collect()
                };
                Measured {
                    at: shrink(&near.at, &round.at),
                    elongation: elongation(&shrink(&far.at, &long.at)),
                    heights,
                    misfit_ratio: near.value * scale * scale / freedom,
                }
            })
            .collect()
    }

    /// Scatter of the isotropic coordinates and of the elongation over resampled blocks of the site.
    fn block_scatter(&self, streams: &Streams) -> Option<(Vec<f64>, f64)> {
        let draw = |estimator: &Estimator, estimate: &Estimate, name: &str| {
            let blocks = resampling::blocks(estimator.case, estimator.bins, true).unwrap_or_default();
            resampling::block_replicates(estimator, estimate, &blocks, BLOCK_DRAWS, &streams.child(name))
        };
        let (near, far) = (draw(&self.rings, &self.round, "rings"), draw(&self.directions, &self.long, "directions"));
        if near.is_empty() || far.is_empty() {
            return None;
        }
        let elongations: Vec<[f64; 2]> = far.iter().map(|at| elongation(at)).collect();
        Some((spread(&near), elongation_spread(&elongations)))
    }
}

/// The anisotropic fit on bins by direction, starting from the isotropic one there.
fn lengthened(directions: &Estimator, round: &Estimate) -> Option<Estimate> {
    let (sigma_m, range_m) = (round.covariance.sigma_m(), round.covariance.range_m());
    let near = directions.fit(&round.form, sigma_m, range_m);
    let form = round.form.with_axis();
    let at = directions.case.coordinates(&form).encode(&near.covariance);
    let from = Estimate { form, at, likelihood: Some(near.likelihood.clone()?), ..near };
    let end = directions.refit(&from, &directions.bins.covariance_m2, directions.case.survey.trim.threshold_m);
    let covariance = directions.case.coordinates(&from.form).decode(&end.at);
    Some(Estimate { covariance, at: end.at, ..from })
}

/// An estimate at a given covariance, with that covariance's weights, from which to fit simulated surfaces.
fn centred(estimator: &Estimator, form: &Form, covariance: &Covariance) -> Estimate {
    let isotropic = !form.is_anisotropic();
    let round = Covariance { ratio: 1.0, azimuth_deg: 0.0, ..scaled(covariance, covariance.ratio.sqrt()) };
    let covariance = if isotropic { round } else { covariance.clone() };
    let at = estimator.case.coordinates(form).encode(&covariance);
    let weights = estimator.weights(&covariance);
    let likelihood =
        weights.map(|weights| Likelihood { weights, chi2: 0.0, bins: estimator.bins.len(), scatter: None });
    Estimate { form: form.clone(), covariance, at, steps: 0, likelihood }
}

/// Multiplies ranges by a factor, where the model has a range.
fn scaled(covariance: &Covariance, factor: f64) -> Covariance {
    let mut scaled = covariance.clone();
    for term in &mut scaled.structures {
        term.range_m *= if term.model.scale_names().1.is_some() { factor } else { 1.0 };
    }
    scaled
}

/// The elongation: the last two coordinates of an anisotropic form.
fn elongation(at: &[f64]) -> [f64; 2] {
    [at[at.len() - 2], at[at.len() - 1]]
}

/// The pooled covariance of both sides: geometric means of sigma, b and shape, arithmetic means of nugget and elongation.
fn pool(sides: &[Side; 2], measured: &[Measured; 2], share: f64) -> Covariance {
    let [a, b] = sides.each_ref().map(|s| &s.round.covariance);
    let mean = |x: f64, y: f64| share * x + (1.0 - share) * y;
    let geometric = |x: f64, y: f64| libm::exp(mean(libm::log(x), libm::log(y)));
    let mut pooled = a.clone();
    for (term, (x, y)) in pooled.structures.iter_mut().zip(a.structures.iter().zip(&b.structures)) {
        term.sigma_m = geometric(x.sigma_m, y.sigma_m);
        term.range_m = geometric(x.range_m, y.range_m);
        term.shape = if x.shape > 0.0 { geometric(x.shape, y.shape) } else { x.shape };
    }
    pooled.nugget_m2 = mean(a.nugget_m2, b.nugget_m2);
    let [p, q] = [0, 1].map(|k| mean(measured[0].elongation[k], measured[1].elongation[k]));
    let ratio = libm::exp(-(p * p + q * q).sqrt());
    let azimuth_deg = half_turn(90.0 / PI * libm::atan2(q, p));
    Covariance { ratio, azimuth_deg, ..scaled(&pooled, 1.0 / ratio.sqrt()) }
}

/// Standard deviation of each coordinate.
fn spread(all: &[Vec<f64>]) -> Vec<f64> {
    let coordinate = |k: usize| -> Vec<f64> { all.iter().map(|at| at[k]).collect() };
    (0..all.first().map_or(0, Vec::len)).map(|k| sums::variance(&coordinate(k)).sqrt()).collect()
}

/// Root mean square distance of elongations from their mean.
fn elongation_spread(all: &[[f64; 2]]) -> f64 {
    let part = |k: usize| sums::variance(&all.iter().map(|e| e[k]).collect::<Vec<_>>());
    (part(0) + part(1)).sqrt()
}

/// How much more the sites' blocks scatter than surfaces of the model; at least 1.
struct Widening {
    coordinates: Vec<f64>,
    elongation: f64,
    /// Whether a side has too few blocks for this.
    unknown: bool,
}

impl Widening {
    fn of(sides: &[Side; 2], nulls: &[Vec<Measured>; 2], streams: &Streams) -> Self {
        let models = nulls.each_ref().map(|null| {
            let at: Vec<Vec<f64>> = null.iter().map(|m| m.at.clone()).collect();
            let elongations: Vec<[f64; 2]> = null.iter().map(|m| m.elongation).collect();
            (spread(&at), elongation_spread(&elongations))
        });
        let named = streams.child("blocks");
        let blocks = [("a", 0), ("b", 1)].map(|(name, k)| sides[k].block_scatter(&named.child(name)));
        let unknown = blocks.iter().any(Option::is_none);
        // A side without blocks is assumed to scatter like the model.
        let found = [0, 1].map(|k| blocks[k].clone().unwrap_or_else(|| models[k].clone()));
        let factor = |f: [f64; 2], m: [f64; 2]| {
            let ratio = (f[0] * f[0] + f[1] * f[1]).sqrt() / (m[0] * m[0] + m[1] * m[1]).sqrt();
            if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
        };
        let coordinate = |k: usize| factor([found[0].0[k], found[1].0[k]], [models[0].0[k], models[1].0[k]]);
        Self {
            coordinates: (0..models[0].0.len()).map(coordinate).collect(),
            elongation: factor([found[0].1, found[1].1], [models[0].1, models[1].1]),
            unknown,
        }
    }
}

fn findings(
    sides: &[Side; 2],
    measured: &[Measured; 2],
    nulls: &[Vec<Measured>; 2],
    marginal: &HeightCurve,
    widened: &Widening,
    settings: &CompareSettings,
) -> Vec<Finding> {
    let parameters = settings.parameters();
    let pairs = || nulls[0].iter().zip(&nulls[1]);
    let mut all = Vec::new();
    for (k, parameter) in settings.form.parameters().into_iter().enumerate() {
        let relative = match parameter.role {
            Role::Sigma(_) => parameters.equivalence_sigma,
            Role::Range(_) => parameters.equivalence_range,
            Role::Shape(_) => parameters.equivalence_shape,
            // A nugget of zero has no logarithm.
            Role::Nugget | Role::Ratio | Role::Azimuth => continue,
        };
        let draws = pairs().map(|(a, b)| b.at[k] - a.at[k]).collect();
        all.push(Finding {
            values: sides.each_ref().map(|s| Some(parameter.of(&s.round.covariance))),
            measure: Measure::LogRatio,
            bound: libm::log1p(relative),
            known: Ok((measured[1].at[k] - measured[0].at[k], Null::signed(draws, widened.coordinates[k]))),
            words: format!("the ratio of {}", parameter.name),
            name: parameter.name,
        });
    }
    let apart = |a: &Measured, b: &Measured| {
        let [p, q] = [0, 1].map(|k| b.elongation[k] - a.elongation[k]);
        (p * p + q * q).sqrt()
    };
    let draws = pairs().map(|(a, b)| apart(a, b)).collect();
    let [one, other] = sides.each_ref().map(|s| &s.long.covariance);
    all.push(Finding {
        name: "anisotropy".to_owned(),
        values: [Some(one.ratio), Some(other.ratio)],
        measure: Measure::Distance,
        bound: libm::log1p(parameters.equivalence_anisotropy),
        known: Ok((apart(&measured[0], &measured[1]), Null::distances(draws, widened.elongation))),
        words: elongation_words(one, other),
    });
    // The heights of a part scatter more than those of the complete raster.
    let scale = sides.each_ref().map(|s| Part::of(s.rings.case).scale);
    let scale = scale[0].max(scale[1]);
    let distance = |(a, b): (&Measured, &Measured)| {
        scale * a.heights.with_marginal(marginal).distance(&b.heights.with_marginal(marginal))
    };
    all.push(Finding {
        name: "height_distribution".to_owned(),
        values: [None, None],
        measure: Measure::Distance,
        bound: parameters.equivalence_heights,
        known: Ok((
            measured[0].heights.distance(&measured[1].heights),
            Null::distances(pairs().map(distance).collect(), 1.0),
        )),
        words: format!(
            "the distance between the height distributions (skewness {:.2} and {:.2}), in standard deviations,",
            measured[0].heights.skewness(),
            measured[1].heights.skewness()
        ),
    });
    all
}

/// The elongations of both sides as text.
pub fn elongation_words(a: &Covariance, b: &Covariance) -> String {
    format!(
        "the distance between the elongations (ratio {:.2} along {:.0} degrees, {:.2} along {:.0} degrees)",
        a.ratio, a.azimuth_deg, b.ratio, b.azimuth_deg
    )
}

fn notes(measured: &[Measured; 2], nulls: &[Vec<Measured>; 2], form: &Form, widened: &Widening) -> Vec<String> {
    let mut notes = Vec::new();
    for (side, (own, null)) in ["A", "B"].into_iter().zip(measured.iter().zip(nulls)) {
        let ratios: Vec<f64> = null.iter().map(|m| m.misfit_ratio).collect();
        let p = upper_p(own.misfit_ratio, &ratios);
        if p <= MISFIT_LEVEL {
            notes.push(format!(
                "{side}: the {} model does not describe the residual (p = {p:.3}); sigma and b therefore depend on window and \
                 model, and their null distribution is too narrow or too wide",
                form.name()
            ));
        }
    }
    if form.has_nugget() {
        notes.push("the nugget is fitted but not compared".to_owned());
    }
    if widened.unknown {
        notes.push("a side has fewer than nine blocks of two windows, so its stationarity was not examined".to_owned());
    }
    let most = widened.coordinates.iter().copied().fold(widened.elongation, f64::max);
    if most > 1.5 {
        notes.push(format!(
            "blocks of the sites scatter up to {most:.1} times as much as surfaces of the model; the null distributions were widened \
             accordingly"
        ));
    }
    notes
}
