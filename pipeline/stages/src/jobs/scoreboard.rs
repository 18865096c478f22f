//! Stage `scoreboard`: compares all synthesis methods of a texture.

use super::fit::Site;
use super::matched::{Matched, seconds_per_operation};
use crate::job::{Estimate, Job, JobError, Outcome, Work};
use crate::revision::Room;
use sastrugi_numeric::Streams;
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::tables::{ScoreCovarianceRow, ScoreRow};
use sastrugi_texture::synth::scoreboard::{Score, score};
use sastrugi_texture::{Cost, Measured};
use serde_json::{Value, json};
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "scoreboard";

/// One method with its parameters.
pub struct Entrant {
    /// Method.
    pub method: String,
    /// Raw parameters.
    pub parameters: Value,
    /// Cost of one realisation; `None` if the method refused the parameters.
    pub cost: Option<Cost>,
}

/// The scoreboard of one texture.
pub struct ScoreboardJob {
    /// Id of the texture.
    pub id: String,
    /// The fit that the texture matches.
    pub matched: Matched,
    /// Methods.
    pub entrants: Vec<Entrant>,
    /// Realisations of each method.
    pub realisations: u32,
    /// The DEM of the fit, if a method copies from its residual.
    pub exemplar: Option<Site>,
    /// Random streams.
    pub streams: Streams,
}

impl ScoreboardJob {
    fn rows(
        &self,
        entrant: &Entrant,
        fit: &FitFile,
        measured: Option<&Arc<Measured>>,
    ) -> (ScoreRow, Vec<ScoreCovarianceRow>) {
        let scored = sastrugi_texture::prepare_from(&entrant.method, &entrant.parameters, fit, measured)
            .map_err(|e| e.to_string())
            .and_then(|s| score(s.as_ref(), &self.streams, self.realisations).map_err(|e| e.to_string()));
        match scored {
            Ok(score) => (self.row(entrant, &score), self.curve(entrant, &score)),
            Err(reason) => (self.refusal(entrant, reason), Vec::new()),
        }
    }

    fn row(&self, entrant: &Entrant, score: &Score) -> ScoreRow {
        ScoreRow {
            texture_id: self.id.clone(),
            method: entrant.method.clone(),
            covariance_error_max: score.error_max,
            covariance_error_rms: score.error_rms,
            realisations: i64::from(self.realisations),
            variance_mean: score.variance_mean,
            variance_spread: score.variance_spread,
            ratio_wanted: score.ratio_wanted,
            ratio_found: score.ratio_found,
            seam_jump_ratio: score.seam_jump_ratio,
            operations: score.cost.operations,
            memory_bytes: score.cost.memory_bytes as f64,
            refused: String::new(),
        }
    }

    fn refusal(&self, entrant: &Entrant, refused: String) -> ScoreRow {
        let none = f64::NAN;
        ScoreRow {
            texture_id: self.id.clone(),
            method: entrant.method.clone(),
            covariance_error_max: none,
            covariance_error_rms: none,
            realisations: 0,
            variance_mean: none,
            variance_spread: none,
            ratio_wanted: none,
            ratio_found: none,
            seam_jump_ratio: none,
            operations: none,
            memory_bytes: none,
            refused,
        }
    }

    fn curve(&self, entrant: &Entrant, score: &Score) -> Vec<ScoreCovarianceRow> {
        let row = |(bin, point): (usize, &sastrugi_texture::synth::scoreboard::CurvePoint)| ScoreCovarianceRow {
            texture_id: self.id.clone(),
            method: entrant.method.clone(),
            bin: bin as i64,
            lag_m: point.lag_m,
            wanted_m2: point.wanted_m2,
            achieved_m2: point.achieved_m2,
            measured_m2: point.measured_m2,
        };
        score.curve.iter().enumerate().map(row).collect()
    }
}

impl Job for ScoreboardJob {
    fn recipe(&self) -> Value {
        let methods: Vec<Value> =
            self.entrants.iter().map(|e| json!({ "method": e.method, "params": e.parameters })).collect();
        json!({ "fit": self.matched.describe(), "methods": methods, "realisations": self.realisations })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Roughness, Room::Statistics, Room::Texture]
    }

    fn memory_bytes(&self) -> u64 {
        let methods = self.entrants.iter().filter_map(|e| e.cost).map(|cost| cost.memory_bytes).max().unwrap_or(0);
        self.exemplar.as_ref().map_or(methods, |site| methods + site.memory_bytes())
    }

    fn estimate(&self) -> Estimate {
        let seconds = |e: &Entrant| e.cost.map(|cost| seconds_per_operation(&e.method) * cost.operations);
        let of_one: f64 = self.entrants.iter().filter_map(seconds).sum();
        Estimate { seconds: of_one * f64::from(self.realisations), bytes: 1e5 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let (mut scores, mut curves) = (Vec::new(), Vec::new());
        let mut entrants: Vec<&Entrant> = self.entrants.iter().collect();
        entrants.sort_by(|a, b| a.method.cmp(&b.method));
        let fit = self.matched.read(work)?;
        let measured = self.exemplar.as_ref().map(|site| site.residual(work)).transpose()?.map(Arc::new);
        for entrant in entrants {
            let (row, curve) = self.rows(entrant, &fit, measured.as_ref());
            scores.push(row);
            curves.extend(curve);
        }
        let mut outcome = Outcome::default();
        outcome.write_rows(work, scores)?;
        outcome.write_rows(work, curves)?;
        Ok(outcome)
    }
}
