//! Which synthesis method to use: all of them on one fit, with their covariances and the target.

use super::Question;
use super::curves::HEIGHT;
use super::sql::quoted;
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, slug};
use crate::data::Data;
use crate::render::axis::Axis;
use crate::render::chart::{Mark, Plot, WIDTH};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke};
use sastrugi_schemas::tables::{ScoreCovarianceRow, ScoreRow};
use std::collections::BTreeSet;

/// Registry entry.
pub const QUESTION: Question = Question {
    id: "scoreboard",
    name: "Methods",
    title: "Which synthesis method reproduces the target covariance?",
    answer,
};

/// The figure ends where the target covariance has fallen to this share.
const DRAWN_SHARE: f64 = 0.005;
/// Share of the variance below which errors are rounding, and methods with errors this close are equal.
const ROUNDING: f64 = 1e-6;

/// A method with its covariance by lag.
type Curve<'a> = (&'a ScoreRow, Vec<&'a ScoreCovarianceRow>);

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let textures: BTreeSet<&str> = data.scoreboard.iter().map(|s| s.texture_id.as_str()).collect();
    let mut blocks = Vec::new();
    for texture in textures {
        let scores: Vec<&ScoreRow> = data.scoreboard.iter().filter(|s| s.texture_id == texture).collect();
        let curves: Vec<Curve<'_>> = scores.iter().filter_map(|score| curve(data, score)).collect();
        blocks.push(Block::Heading(format!("Texture {texture}")));
        blocks.extend(ranking(&curves).map(Block::Text));
        blocks.push(Block::Figures(curves.iter().map(|one| figure(texture, one, axes(one, &curves))).collect()));
        blocks.push(Block::Table(table(texture, &scores)));
        let refused = scores.iter().filter(|s| !s.refused.is_empty());
        blocks.extend(refused.map(|s| Block::Text(format!("{} was not used: {}.", s.method, s.refused))));
    }
    Ok(blocks)
}

/// A method that was used, with its curve; `None` without one.
fn curve<'a>(data: &'a Data, score: &'a ScoreRow) -> Option<Curve<'a>> {
    let is_own = |r: &&ScoreCovarianceRow| r.texture_id == score.texture_id && r.method == score.method;
    let rows: Vec<&ScoreCovarianceRow> = data.scoreboard_covariance.iter().filter(is_own).collect();
    (score.refused.is_empty() && !rows.is_empty()).then_some((score, rows))
}

/// Variance that a method should have, m².
fn target_m2((_, rows): &Curve<'_>) -> f64 {
    rows.first().map_or(f64::NAN, |row| row.wanted_m2)
}

/// Whether two methods have one target. Those that repeat a site have the covariance of its residual, others that of the fit.
fn share_target(a: &Curve<'_>, b: &Curve<'_>) -> bool {
    let (a, b) = (target_m2(a), target_m2(b));
    (a - b).abs() <= ROUNDING * a.abs()
}

/// Which method has the smallest error, and which methods cannot be compared; `None` where no error is known.
fn ranking(curves: &[Curve<'_>]) -> Option<String> {
    let error = |(score, _): &Curve<'_>| score.covariance_error_max;
    let (known, unknown): (Vec<&Curve<'_>>, Vec<&Curve<'_>>) = curves.iter().partition(|one| error(one).is_finite());
    let best = *known.iter().min_by(|a, b| error(a).total_cmp(&error(b)))?;
    let ranked = match known.as_slice() {
        [one] => format!("The largest error of {} is {}.", one.0.method, share(error(one))),
        all if all.iter().any(|one| !share_target(one, best)) => {
            let each = all.iter().map(|one| format!("{} {}", one.0.method, share(error(one))));
            format!("The largest errors are: {}.", each.collect::<Vec<_>>().join("; "))
        }
        all => {
            let equal = all.iter().copied().filter(|one| error(one) - error(best) <= ROUNDING);
            let equal: Vec<&Curve<'_>> = equal.collect();
            let (come, errors) = if equal.len() == 1 { ("comes", "error is") } else { ("come", "errors are") };
            format!(
                "{} {come} closest to the target covariance: the largest {errors} {}.",
                names(&equal),
                share(error(best))
            )
        }
    };
    let untold = match unknown.as_slice() {
        [] => String::new(),
        _ => format!(" Not ranked, because the mean covariance is not known beforehand: {}.", names(&unknown)),
    };
    Some(format!("{ranked}{untold}{}", targets(curves)))
}

/// An error as a share of the variance.
fn share(error: f64) -> String {
    if error < ROUNDING {
        format!("below {} % of the variance", set::plain(100.0 * ROUNDING, 1))
    } else {
        format!("{} % of the variance", set::significant(100.0 * error, 2))
    }
}

fn names(curves: &[&Curve<'_>]) -> String {
    set::listed(&curves.iter().map(|(score, _)| score.method.as_str()).collect::<Vec<_>>())
}

/// A sentence on the targets if they differ.
fn targets(curves: &[Curve<'_>]) -> String {
    if curves.iter().all(|one| share_target(one, &curves[0])) {
        return String::new();
    }
    let target = |one: &Curve<'_>| set::with_unit(target_m2(one), 3, "m²");
    let each: Vec<String> = curves.iter().map(|one| format!("{} {}", one.0.method, target(one))).collect();
    format!(
        " The methods have different targets ({} at lag 0), because those that repeat a site aim at the covariance of its residual, others at \
         that of the fit: errors and curves can be compared only where the target is the same.",
        each.join(", ")
    )
}

/// Axes of a method, the same for all that have its target.
fn axes(one: &Curve<'_>, curves: &[Curve<'_>]) -> (Axis, Axis) {
    let all = || curves.iter().filter(move |other| share_target(one, other)).flat_map(|(_, rows)| rows.iter());
    let variance = all().map(|r| r.wanted_m2).fold(0.0, f64::max);
    let far = all().filter(|r| r.wanted_m2 > DRAWN_SHARE * variance).map(|r| r.lag_m).fold(0.0, f64::max);
    let near = || all().filter(|r| r.lag_m <= far).flat_map(|r| [r.wanted_m2, r.achieved_m2, r.measured_m2]);
    let (low, high) = (near().fold(0.0, f64::min), near().fold(0.0, f64::max));
    let x = Axis::linear(0.0, 1.03 * far);
    (x, Axis::linear(low - 0.04 * (high - low), high + 0.06 * (high - low)))
}

fn figure(texture: &str, (score, curve): &Curve<'_>, (x, y): (Axis, Axis)) -> Figure {
    let id = slug(&format!("scoreboard-{texture}-{}", score.method));
    let wanted = Stroke { paint: Paint::Ink, width: 4.5, dash: "", opacity: 0.3 };
    let achieved = Stroke::new(Paint::Series(1), 2.0);
    let measured = Stroke::new(Paint::Series(0), 1.8).dashed("4 3");
    // A method that repeats a site does not know its mean covariance beforehand.
    let expected = score.covariance_error_max.is_finite();
    let legend: Vec<(Mark, String)> = [
        Some((Mark::Line(wanted), "target".to_owned())),
        expected.then(|| (Mark::Line(achieved), "expected".to_owned())),
        Some((Mark::Line(measured), format!("mean, n = {}", score.realisations))),
    ]
    .into_iter()
    .flatten()
    .collect();
    let error = match expected {
        true => format!("largest error {}", share(score.covariance_error_max)),
        false => "mean covariance not known beforehand".to_owned(),
    };
    let mut plot = Plot::new((WIDTH, HEIGHT + 20.0), (x, "lag, m"), (y, "covariance, m²"), &legend);
    plot.line([(0.0, 0.0), (x.range().1, 0.0)], Stroke::new(Paint::Muted, 1.0));
    plot.clip(&format!("{id}-clip"));
    plot.line(curve.iter().map(|r| (r.lag_m, r.wanted_m2)), wanted);
    if expected {
        plot.line(curve.iter().map(|r| (r.lag_m, r.achieved_m2)), achieved);
    }
    plot.line(curve.iter().map(|r| (r.lag_m, r.measured_m2)), measured);
    plot.svg.close();
    plot.note(0, error.trim_end_matches(" of the variance"));
    let names = ["bin", "lag_m", "wanted_m2", "achieved_m2", "measured_m2"];
    let query = format!("texture_id = {} and method = {}", quoted(texture), quoted(&score.method));
    let expectation = if expected { ", the expectation of the method," } else { "" };
    let count = usize::try_from(score.realisations).unwrap_or(0);
    Figure {
        id,
        title: format!("{}.", score.method),
        caption: format!(
            "Covariance along rows: the target{expectation} and the mean over {}.",
            set::counted(count, "realisation")
        ),
        description: format!("Covariance of method {} against lag; {error}.", score.method),
        svg: plot.svg,
        numbers: Numbers::select(&query, curve.iter().copied(), &names),
    }
}

fn table(texture: &str, scores: &[&ScoreRow]) -> TableBlock {
    let names = [
        "method",
        "covariance_error_max",
        "covariance_error_rms",
        "variance_mean",
        "variance_spread",
        "ratio_wanted",
        "ratio_found",
        "seam_jump_ratio",
        "operations",
        "memory_bytes",
    ];
    let query = format!("texture_id = {}", quoted(texture));
    TableBlock {
        id: slug(&format!("scoreboard-{texture}")),
        caption: format!(
            "Methods for texture {texture}. Errors, variances and their spread are shares of the target variance; a seam jump of 1 \
             means no seam; operations and bytes are predictions."
        ),
        numbers: Numbers::select(&query, scores.iter().copied(), &names),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::made_up;

    /// Scoreboard of a texture `t`: method, largest error, variance of its target, m².
    fn release(methods: &[(&str, f64, f64)]) -> Data {
        let mut data = made_up::empty();
        for &(method, covariance_error_max, variance_m2) in methods {
            data.scoreboard.push(ScoreRow {
                texture_id: "t".into(),
                method: method.into(),
                covariance_error_max,
                covariance_error_rms: covariance_error_max,
                realisations: 4,
                variance_mean: 1.0,
                variance_spread: 0.1,
                ratio_wanted: 1.0,
                ratio_found: 1.0,
                seam_jump_ratio: 1.0,
                operations: 1e6,
                memory_bytes: 1e6,
                refused: String::new(),
            });
            data.scoreboard_covariance.extend((0..20).map(|bin| {
                let lag_m = 0.1 * bin as f64;
                let wanted_m2 = variance_m2 * libm::exp(-lag_m);
                let known = if covariance_error_max.is_finite() { wanted_m2 } else { f64::NAN };
                let (texture_id, method) = ("t".into(), method.into());
                ScoreCovarianceRow {
                    texture_id,
                    method,
                    bin,
                    lag_m,
                    wanted_m2,
                    achieved_m2: known,
                    measured_m2: wanted_m2,
                }
            }));
        }
        data
    }

    fn said(methods: &[(&str, f64, f64)]) -> String {
        let data = release(methods);
        let curves: Vec<Curve<'_>> = data.scoreboard.iter().filter_map(|score| curve(&data, score)).collect();
        ranking(&curves).unwrap_or_default()
    }

    /// One method is the best only of several whose errors are known, with one target; equal ones are named together.
    #[test]
    fn val_methods_are_ranked_only_where_they_can_be() {
        assert_eq!(
            said(&[("fft_ma", 0.0, 0.9), ("gaussians", 0.187, 0.9), ("quasi_wavelets", 0.00079, 0.9)]),
            "fft_ma comes closest to the target covariance: the largest error is below 0.0001 % of the variance."
        );
        assert_eq!(
            said(&[("cholesky", 1e-15, 0.9), ("fft_ma", 0.0, 0.9), ("gaussians", 0.187, 0.9)]),
            "cholesky and fft_ma come closest to the target covariance: the largest errors are below 0.0001 % of the variance."
        );
        let three = said(&[("cholesky", 0.0, 0.9), ("fft_ma", 0.0, 0.9), ("gaussians", 0.0, 0.9)]);
        assert!(three.starts_with("cholesky, fft_ma and gaussians come closest"), "{three}");
        let only = said(&[("fft_ma", 0.00079, 0.1731), ("wavelet_statistics", f64::NAN, 0.00348)]);
        assert!(
            only.starts_with("The largest error of fft_ma is 0.079 % of the variance. Not ranked, because"),
            "{only}"
        );
        assert!(
            only.contains("(fft_ma 0.173 m², wavelet_statistics 0.00348 m² at lag 0)") && !only.contains("closest")
        );
        let apart = said(&[("fft_ma", 0.0, 0.9), ("gaussians", 0.187, 0.5)]);
        assert!(
            apart.contains("gaussians 19 % of the variance. The methods have different targets")
                && apart.ends_with("errors and curves can be compared only where the target is the same.")
                && !apart.contains("closest"),
            "{apart}"
        );
        assert_eq!(said(&[("quilting", f64::NAN, 0.9)]), "");
        assert_eq!(said(&[]), "");
    }

    /// A method whose target is 50 times lower has axes of its own; those with one target share theirs.
    #[test]
    fn val_frames_are_those_of_a_target() {
        let data = release(&[("cholesky", 0.0, 0.9), ("fft_ma", 0.0, 0.9), ("quilting", f64::NAN, 0.018)]);
        let curves: Vec<Curve<'_>> = data.scoreboard.iter().filter_map(|score| curve(&data, score)).collect();
        let top = |k: usize| axes(&curves[k], &curves).1.range().1;
        assert!(top(0) == top(1) && top(0) > 0.9 && top(2) > 0.018 && top(2) < 0.03, "{} {}", top(0), top(2));
    }

    /// Captions name what is drawn, with the number of realisations.
    #[test]
    fn val_captions_name_what_is_drawn() {
        let data = release(&[("fft_ma", 0.0, 0.9), ("quilting", f64::NAN, 0.9)]);
        let blocks = answer(&data).unwrap();
        let figures = blocks.iter().find_map(|b| if let Block::Figures(figures) = b { Some(figures) } else { None });
        let captions: Vec<&str> = figures.unwrap().iter().map(|f| f.caption.as_str()).collect();
        assert_eq!(
            captions,
            [
                "Covariance along rows: the target, the expectation of the method, and the mean over 4 realisations.",
                "Covariance along rows: the target and the mean over 4 realisations."
            ]
        );
    }
}
