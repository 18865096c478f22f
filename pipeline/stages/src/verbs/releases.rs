//! `compare` for two releases: which files differ, and do the metrics differ?
//!
//! Files are compared by the hashes in the manifests, metrics as described in [`sastrugi_report::releases`].

use super::parameters;
use crate::error::Error;
use sastrugi_numeric::Streams;
use sastrugi_report::data::Mission;
pub use sastrugi_report::releases::Quantity;
use sastrugi_report::releases::{self, Metrics, Settings};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::manifest::Artifact;
use sastrugi_schemas::tables::TerrainRow;
use sastrugi_schemas::{Answer, ParameterError};
use sastrugi_store::release::Release;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Name of the random streams.
const STAGE: &str = releases::STREAMS;

/// Parameters of the comparison.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Parameters {
    /// Largest difference of means that counts as the same: a share of A's mean; for success and class shares, an absolute difference.
    pub margin: f64,
    /// Probability of any false "different" in the comparison, and of each false "same".
    pub alpha: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self { margin: releases::MARGIN, alpha: 0.05 }
    }
}

impl Parameters {
    fn check(self) -> Result<Self, ParameterError> {
        if !(self.margin.is_finite() && self.margin > 0.0) {
            return Err(ParameterError::new("margin", format!("must be above 0, got {}", self.margin)));
        }
        if !(self.alpha > 0.0 && self.alpha < 0.5) {
            return Err(ParameterError::new("alpha", format!("must be above 0 and below 0.5, got {}", self.alpha)));
        }
        Ok(self)
    }
}

/// Comparison of two releases.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Always `releases`.
    pub what: &'static str,
    /// A and B.
    pub releases: [Side; 2],
    /// True when both were made from the same study by the same version, so that every byte should be equal.
    pub same_study_and_version: bool,
    /// Files; absent if the versions differ, since bytes are then not comparable.
    pub files: Option<Files>,
    /// Metrics of the groups that both have.
    pub quantities: Vec<Quantity>,
    /// The verdict over all metrics.
    pub answer: Answer,
    /// The verdict in one sentence.
    pub sentence: String,
    /// Notes for the reader.
    pub notes: Vec<String>,
    /// Parameters of the comparison.
    pub parameters: Parameters,
    /// Seed of the permutations.
    pub seed: u64,
}

impl Comparison {
    /// True when a metric is different, or a byte that should be equal.
    pub fn differs(&self) -> bool {
        let bytes = self.same_study_and_version && self.files.as_ref().is_some_and(|files| !files.are_equal());
        self.answer == Answer::Different || bytes
    }
}

/// A release as its manifest names it.
#[derive(Clone, Debug, Serialize)]
pub struct Side {
    /// Folder.
    pub folder: String,
    /// Name of the study.
    pub name: String,
    /// SHA-256 of the study.
    pub study_sha256: String,
    /// Version of the program.
    pub version: String,
}

/// Files of two releases by path.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Files {
    /// Number of identical files.
    pub equal: usize,
    /// Files with different bytes but the same heights, rows or messages.
    pub packaging: Vec<String>,
    /// Files with different content, or with different bytes and no content hash.
    pub different: Vec<String>,
    /// Only in A.
    pub only_a: Vec<String>,
    /// Only in B.
    pub only_b: Vec<String>,
}

impl Files {
    fn of(a: &[Artifact], b: &[Artifact]) -> Self {
        let by_path = |artifacts: &[Artifact]| -> BTreeMap<String, (String, Option<String>)> {
            let entry = |a: &Artifact| (a.path.clone(), (a.sha256.clone(), a.origin.content_sha256.clone()));
            artifacts.iter().map(entry).collect()
        };
        let (a, mut b) = (by_path(a), by_path(b));
        let mut files = Self::default();
        for (path, (sha256, content)) in a {
            match b.remove(&path) {
                None => files.only_a.push(path),
                Some((other, _)) if other == sha256 => files.equal += 1,
                Some((_, other)) if content.is_some() && other == content => files.packaging.push(path),
                Some(_) => files.different.push(path),
            }
        }
        files.only_b = b.into_keys().collect();
        files
    }

    /// True when both releases have the same files with the same bytes.
    pub fn are_equal(&self) -> bool {
        [&self.packaging, &self.different, &self.only_a, &self.only_b].into_iter().all(Vec::is_empty)
    }
}

/// Compares two releases.
///
/// # Errors
/// Unknown parameters, folders that are not releases, tables that cannot be read.
pub fn compare(a: &Path, b: &Path, parameters: &Value, seed: u64) -> Result<Comparison, Error> {
    parameters::check_schema(parameters, &schema_of::<Parameters>(), STAGE)?;
    let parameters = read_parameters::<Parameters>(parameters)?.check()?;
    let releases = [open(a)?, open(b)?];
    let [of_a, of_b] = [metrics(&releases[0])?, metrics(&releases[1])?];
    let settings = Settings { margin: parameters.margin, alpha: parameters.alpha };
    let (quantities, alone) = releases::compare(&of_a, &of_b, settings, &Streams::for_seed(seed, STAGE));
    let [one, other] = releases.each_ref().map(Release::manifest);
    let same_version = one.version == other.version;
    let same_study = one.study_sha256 == other.study_sha256;
    let answer = answer(&quantities);
    let mut comparison = Comparison {
        what: "releases",
        releases: releases.each_ref().map(Side::of),
        same_study_and_version: same_version && same_study,
        files: same_version.then(|| Files::of(&one.artifacts, &other.artifacts)),
        sentence: sentence(&quantities, answer),
        quantities,
        answer,
        notes: Vec::new(),
        parameters,
        seed,
    };
    if !same_version {
        let versions = format!("made by versions {} and {}", one.version, other.version);
        comparison.notes.push(format!("{versions}; bytes cannot be compared"));
    } else if !same_study {
        comparison.notes.push("made from different studies; files are not expected to be identical".to_owned());
    }
    let only = |(name, groups): (&str, Vec<String>)| format!("only in {name}: {}", groups.join("; "));
    comparison.notes.extend(["A", "B"].into_iter().zip(alone).filter(|(_, groups)| !groups.is_empty()).map(only));
    Ok(comparison)
}

fn open(folder: &Path) -> Result<Release, Error> {
    Release::open(folder).map_err(Error::from)
}

impl Side {
    fn of(release: &Release) -> Self {
        let manifest = release.manifest();
        Self {
            folder: release.folder().display().to_string(),
            name: manifest.name.clone(),
            study_sha256: manifest.study_sha256.clone(),
            version: manifest.version.clone(),
        }
    }
}

/// The metrics of one release.
fn metrics(release: &Release) -> Result<Metrics, Error> {
    let mut metrics = Metrics::default();
    let contents: BTreeMap<&str, Option<&str>> =
        release.manifest().artifacts.iter().map(|a| (a.path.as_str(), a.origin.content_sha256.as_deref())).collect();
    let content = |path: &str| contents.get(path).copied().flatten();
    release
        .for_each_row(|row: TerrainRow| metrics.add_terrain(&row, content(&row.path)))
        .and_then(|()| release.for_each_row(|row: Mission| metrics.add_mission(&row)))?;
    Ok(metrics)
}

fn answer(quantities: &[Quantity]) -> Answer {
    let any = |answer| quantities.iter().any(|q| q.answer == answer);
    match () {
        () if any(Answer::Different) => Answer::Different,
        () if any(Answer::CannotTell) || quantities.is_empty() => Answer::CannotTell,
        () => Answer::Same,
    }
}

fn sentence(quantities: &[Quantity], answer: Answer) -> String {
    let count = |answer| quantities.iter().filter(|q| q.answer == answer).count();
    let (n, same) = (quantities.len(), count(Answer::Same));
    match answer {
        _ if n == 0 => "the releases have no group in common".to_owned(),
        Answer::Same => format!("all {n} metrics are the same within the margin"),
        Answer::Different => {
            let names = quantities.iter().filter(|q| q.answer == Answer::Different);
            let names: Vec<String> = names.map(|q| format!("{} of {}", q.name, q.group)).collect();
            format!("the releases differ in {} of {n} metrics: {}", names.len(), names.join("; "))
        }
        Answer::CannotTell => format!(
            "no metric differs significantly; {same} of {n} {} the same within the margin; for the others the data cannot \
             tell",
            if same == 1 { "is" } else { "are" }
        ),
    }
}
