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

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let textures: BTreeSet<&str> = data.scoreboard.iter().map(|s| s.texture_id.as_str()).collect();
    let mut blocks = Vec::new();
    for texture in textures {
        let scores: Vec<&ScoreRow> = data.scoreboard.iter().filter(|s| s.texture_id == texture).collect();
        blocks.push(Block::Heading(format!("Texture {texture}")));
        blocks.extend(best(&scores).map(Block::Text));
        blocks.push(Block::Figures(figures(data, texture, &scores)));
        blocks.push(Block::Table(table(texture, &scores)));
        let refused = scores.iter().filter(|s| !s.refused.is_empty());
        blocks.extend(refused.map(|s| Block::Text(format!("{} was not used: {}.", s.method, s.refused))));
    }
    Ok(blocks)
}

/// The method with the smallest error, in a sentence; `None` where no error is known.
fn best(scores: &[&ScoreRow]) -> Option<String> {
    let known = scores.iter().filter(|s| s.refused.is_empty() && s.covariance_error_max.is_finite());
    let best = known.min_by(|a, b| a.covariance_error_max.total_cmp(&b.covariance_error_max))?;
    Some(format!(
        "{} comes closest to the target covariance: its largest error is {} % of the variance.",
        best.method,
        set::significant(100.0 * best.covariance_error_max, 2)
    ))
}

fn curve<'a>(data: &'a Data, texture: &str, method: &str) -> Vec<&'a ScoreCovarianceRow> {
    data.scoreboard_covariance.iter().filter(|r| r.texture_id == texture && r.method == method).collect()
}

/// One figure per method that was used, on common axes.
fn figures(data: &Data, texture: &str, scores: &[&ScoreRow]) -> Vec<Figure> {
    let curves: Vec<(&ScoreRow, Vec<&ScoreCovarianceRow>)> =
        scores.iter().map(|s| (*s, curve(data, texture, &s.method))).filter(|(_, curve)| !curve.is_empty()).collect();
    let all = || curves.iter().flat_map(|(_, curve)| curve.iter());
    let variance = all().map(|r| r.wanted_m2).fold(0.0, f64::max);
    let far = all().filter(|r| r.wanted_m2 > DRAWN_SHARE * variance).map(|r| r.lag_m).fold(0.0, f64::max);
    let near = || all().filter(|r| r.lag_m <= far).flat_map(|r| [r.wanted_m2, r.achieved_m2, r.measured_m2]);
    let (low, high) = (near().fold(0.0, f64::min), near().fold(0.0, f64::max));
    let x = Axis::linear(0.0, 1.03 * far);
    let y = Axis::linear(low - 0.04 * (high - low), high + 0.06 * (high - low));
    curves.iter().map(|(score, curve)| figure(texture, score, curve, x, y)).collect()
}

fn figure(texture: &str, score: &ScoreRow, curve: &[&ScoreCovarianceRow], x: Axis, y: Axis) -> Figure {
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
    let error = |factor: f64, unit: &str| match expected {
        true => format!("largest error {}{unit}", set::significant(factor * score.covariance_error_max, 2)),
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
    plot.note(0, &error(100.0, " %"));
    let names = ["bin", "lag_m", "wanted_m2", "achieved_m2", "measured_m2"];
    let query = format!("texture_id = {} and method = {}", quoted(texture), quoted(&score.method));
    Figure {
        id,
        title: format!("{}.", score.method),
        caption: "Covariance along rows: the target, the expectation of the method, and the mean over n realisations."
            .into(),
        description: format!("Covariance of method {} against lag; {}.", score.method, error(1.0, " of the variance")),
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
