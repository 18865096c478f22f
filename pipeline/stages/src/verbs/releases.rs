//! `compare` for two releases: which files differ, and do their figures?
//!
//! Files are compared by the hashes in the manifests. Figures are compared group by group with terrains as the units: a
//! terrain's value is the mean over its missions (for all but success, over the successful ones). Where both releases have the same terrains, or terrains from the same
//! random draws, terrains are compared in pairs, else as two independent groups. Labels of the releases are permuted
//! (`p`, adjusted by Holm over all figures); a difference of means whose interval of coverage `1 - 2 alpha` lies within the
//! margin is none that matters (two one-sided tests).

use super::parameters;
use crate::error::Error;
use crate::runner::assemble::release_error;
use rayon::prelude::*;
use sastrugi_numeric::{Streams, sums};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::manifest::Artifact;
use sastrugi_schemas::tables::{MissionRow, TerrainRow};
use sastrugi_schemas::topics::EventKind;
use sastrugi_schemas::{ParameterError, Record};
use sastrugi_statistics::{MeanDifference, holm, permutation};
use sastrugi_store::release::Release;
pub use sastrugi_texture::compare::Answer;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Name of the random streams.
const STAGE: &str = "compare";
/// Arrangements of the labels that are looked at, where they are not all.
const DRAWS: usize = 9999;
/// Figures of a terrain.
const OF_TERRAINS: [Figure<TerrainRow>; 7] = [
    ("relief_m", |t| t.relief_m),
    ("rms_height_m", |t| t.rms_height_m),
    ("rms_slope", |t| t.rms_slope),
    ("share_low", |t| t.share_low),
    ("share_semi", |t| t.share_semi),
    ("share_high", |t| t.share_high),
    ("psd_slope", |t| t.psd_slope),
];
/// Figures of a mission; `success` is 1 for the missions that reached their goal, and the others are theirs alone, as in the
/// report.
const OF_MISSIONS: [Figure<MissionRow>; 8] = [
    ("success", |m| f64::from(succeeded(m))),
    ("efficiency", |m| of_success(m, m.efficiency)),
    ("time_s", |m| of_success(m, m.time_s)),
    ("rms_vertical_acceleration_m_s2", |m| of_success(m, m.rms_vertical_acceleration_m_s2)),
    ("rms_pitch_rate_deg_s", |m| of_success(m, m.rms_pitch_rate_deg_s)),
    ("rms_roll_rate_deg_s", |m| of_success(m, m.rms_roll_rate_deg_s)),
    ("max_pitch_deg", |m| of_success(m, m.max_pitch_deg)),
    ("max_roll_deg", |m| of_success(m, m.max_roll_deg)),
];

fn succeeded(mission: &MissionRow) -> bool {
    mission.outcome == EventKind::Success.name()
}

fn of_success(mission: &MissionRow, value: f64) -> f64 {
    if succeeded(mission) { value } else { f64::NAN }
}

/// Figures that are shares of one: their margin is in points.
const SHARES: [&str; 4] = ["success", "share_low", "share_semi", "share_high"];

/// A figure of a row: its name and value.
type Figure<R> = (&'static str, fn(&R) -> f64);

/// Parameters of the comparison.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Parameters {
    /// Difference of means that counts as none: a share of A's mean; for success and the shares of classes, of one.
    pub margin: f64,
    /// Probability of any false "different" in the comparison, and of each false "same".
    pub alpha: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self { margin: 0.05, alpha: 0.05 }
    }
}

impl Parameters {
    fn check(self) -> Result<Self, ParameterError> {
        if !(self.margin.is_finite() && self.margin > 0.0) {
            return Err(ParameterError::new("margin", format!("is {}; it must be above 0", self.margin)));
        }
        if !(self.alpha > 0.0 && self.alpha < 0.5) {
            return Err(ParameterError::new("alpha", format!("is {}; it must be above 0 and below 0.5", self.alpha)));
        }
        Ok(self)
    }
}

/// Two releases beside each other.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Always `releases`.
    pub what: &'static str,
    /// A and B.
    pub releases: [Side; 2],
    /// True when both were made from one study by one version: then every byte should be the same.
    pub same_study_and_version: bool,
    /// Files; absent where the versions differ, whose bytes cannot be compared.
    pub files: Option<Files>,
    /// Figures of the groups that both have.
    pub quantities: Vec<Quantity>,
    /// The answer over all figures.
    pub answer: Answer,
    /// The answer in words.
    pub sentence: String,
    /// What a reader must know.
    pub notes: Vec<String>,
    /// Parameters of the comparison.
    pub parameters: Parameters,
    /// Seed of the permutations.
    pub seed: u64,
}

impl Comparison {
    /// True when a figure is different, or a byte where none should be.
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
    /// Number of files with the same bytes.
    pub equal: usize,
    /// Other bytes, but the same heights, rows or messages.
    pub packaging: Vec<String>,
    /// Other bytes and other content, or content that has no hash of its own.
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

/// A figure of a group in both releases. Values are one per terrain.
#[derive(Clone, Debug, Serialize)]
pub struct Quantity {
    /// Table.
    pub table: &'static str,
    /// Label of the group, with the variant and the run where there are such.
    pub group: String,
    /// Column, or `success`.
    pub figure: &'static str,
    /// Unit of the figure.
    pub unit: &'static str,
    /// Terrains in A and B.
    pub terrains: [usize; 2],
    /// True when terrains are compared in pairs.
    pub paired: bool,
    /// Mean of A.
    pub a: f64,
    /// Mean of B.
    pub b: f64,
    /// B less A.
    pub difference: f64,
    /// Interval of the difference with coverage `1 - alpha`.
    pub interval: Option<[f64; 2]>,
    /// Differences up to this count as none.
    pub margin: Option<f64>,
    /// Of the permutation test.
    pub p: Option<f64>,
    /// The same after Holm, over all figures of the comparison.
    pub p_adjusted: Option<f64>,
    /// Of the two one-sided tests.
    pub p_equivalence: Option<f64>,
    /// The answer.
    pub answer: Answer,
}

/// Compares two releases.
///
/// # Errors
/// Unknown parameters, folders that are no releases, tables that cannot be read.
pub fn compare(a: &Path, b: &Path, parameters: &Value, seed: u64) -> Result<Comparison, Error> {
    parameters::check_schema(parameters, &schema_of::<Parameters>(), STAGE)?;
    let parameters = read_parameters::<Parameters>(parameters)?.check()?;
    let releases = [open(a)?, open(b)?];
    let [of_a, of_b] = [Figures::of(&releases[0])?, Figures::of(&releases[1])?];
    let streams = Streams::for_seed(seed, STAGE);
    let keys: Vec<&Key> = of_a.keys_in(&of_b).collect();
    let mut quantities: Vec<Quantity> =
        keys.into_par_iter().map(|key| quantity(key, &of_a, &of_b, &parameters, &streams)).collect();
    judge(&mut quantities, parameters.alpha);
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
        comparison.notes.push(format!("{versions}: not comparable byte by byte"));
    } else if !same_study {
        comparison.notes.push("made from different studies: their files are not expected to be equal".to_owned());
    }
    comparison.notes.extend(of_a.alone("A", &of_b));
    comparison.notes.extend(of_b.alone("B", &of_a));
    Ok(comparison)
}

fn open(folder: &Path) -> Result<Release, Error> {
    Release::open(folder).map_err(release_error)
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

/// Table, group, figure and its unit.
type Key = (&'static str, String, &'static str, &'static str);

/// What is compared of one release.
#[derive(Default)]
struct Figures {
    /// Sum and number of finite values by terrain.
    values: BTreeMap<Key, BTreeMap<String, (f64, usize)>>,
    /// What tells whether a terrain is the other release's: hash of its heights, words of its random streams.
    grounds: BTreeMap<String, (Option<String>, Option<String>)>,
}

impl Figures {
    fn of(release: &Release) -> Result<Self, Error> {
        let mut figures = Self::default();
        let contents: BTreeMap<&str, &Option<String>> =
            release.manifest().artifacts.iter().map(|a| (a.path.as_str(), &a.origin.content_sha256)).collect();
        let terrain = |row: TerrainRow| {
            let group = label([row.group.as_deref(), row.variant.as_deref(), None]);
            figures.add(&OF_TERRAINS, &row, &row.terrain_id, &group);
            let content = contents.get(row.path.as_str()).and_then(|content| (*content).clone());
            figures.grounds.insert(row.terrain_id, (content, row.stream));
        };
        release.for_each_row(terrain).map_err(release_error)?;
        let mission = |row: MissionRow| {
            let group = label([row.group.as_deref(), row.variant.as_deref(), Some(&row.traverse_id)]);
            figures.add(&OF_MISSIONS, &row, &row.terrain_id, &group);
        };
        release.for_each_row(mission).map_err(release_error)?;
        Ok(figures)
    }

    fn add<R: Record>(&mut self, of_row: &[Figure<R>], row: &R, terrain: &str, group: &str) {
        for (name, value) in of_row {
            let value = value(row);
            if value.is_finite() {
                let unit = R::TABLE.columns.iter().find(|column| column.name == *name).map_or("1", |c| c.unit);
                let by_terrain = self.values.entry((R::TABLE.name, group.to_owned(), name, unit)).or_default();
                let (sum, count) = by_terrain.entry(terrain.to_owned()).or_insert((0.0, 0));
                (*sum, *count) = (*sum + value, *count + 1);
            }
        }
    }

    /// Figures that both have.
    fn keys_in<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = &'a Key> {
        self.values.keys().filter(|key| other.values.contains_key(*key))
    }

    /// The sentence on groups that only this one has.
    fn alone(&self, name: &str, other: &Self) -> Option<String> {
        let groups: BTreeSet<String> = self
            .values
            .keys()
            .filter(|key| !other.values.contains_key(*key))
            .map(|(table, group, ..)| format!("{group} ({table})"))
            .collect();
        let list: Vec<String> = groups.into_iter().collect();
        (!list.is_empty()).then(|| format!("only in {name}: {}", list.join("; ")))
    }

    /// Means by terrain.
    fn means(&self, key: &Key) -> BTreeMap<&str, f64> {
        self.values.get(key).into_iter().flatten().map(|(id, (sum, n))| (id.as_str(), sum / *n as f64)).collect()
    }

    /// True when a terrain is the same in both, or made from the same random draws.
    fn shares_ground(&self, other: &Self, terrain: &str) -> bool {
        let both = self.grounds.get(terrain).zip(other.grounds.get(terrain));
        both.is_some_and(|((content, stream), (content_b, stream_b))| {
            (content.is_some() && content == content_b) || (stream.is_some() && stream == stream_b)
        })
    }
}

/// Group, variant and run, as far as there are such.
fn label(parts: [Option<&str>; 3]) -> String {
    let named: Vec<&str> = parts.into_iter().flatten().collect();
    if named.is_empty() { "all".to_owned() } else { named.join(", ") }
}

/// A figure without its answer, which needs all of them.
fn quantity(key: &Key, a: &Figures, b: &Figures, parameters: &Parameters, streams: &Streams) -> Quantity {
    let (table, group, figure, unit) = key.clone();
    let (by_a, by_b) = (a.means(key), b.means(key));
    let paired = by_a.keys().eq(by_b.keys()) && by_a.keys().all(|terrain| a.shares_ground(b, terrain));
    let [first, second] = [&by_a, &by_b].map(|means| means.values().copied().collect::<Vec<f64>>());
    let pairs = first.iter().zip(&second).map(|(a, b)| [*a, *b]);
    let differences = if paired { permutation::differences(pairs) } else { vec![] };
    let mut stream = streams.stream(&format!("{table}/{group}/{figure}"));
    let test = match paired {
        true => permutation::paired(&differences, DRAWS, &mut stream, |d| sums::mean(d).abs()),
        false => {
            permutation::two_groups(&first, &second, DRAWS, &mut stream, |a, b| (sums::mean(b) - sums::mean(a)).abs())
        }
    };
    let difference =
        if paired { MeanDifference::of_pairs(&differences) } else { MeanDifference::between(&first, &second) };
    let scale = if SHARES.contains(&figure) { 1.0 } else { sums::mean(&first).abs() };
    let margin = Some(parameters.margin * scale).filter(|margin| *margin > 0.0);
    let interval = difference.map(|d| d.interval(1.0 - parameters.alpha));
    Quantity {
        table,
        group,
        figure,
        unit,
        terrains: [first.len(), second.len()],
        paired,
        a: sums::mean(&first),
        b: sums::mean(&second),
        difference: sums::mean(&second) - sums::mean(&first),
        interval: interval.map(|i| [i.low, i.high]),
        margin,
        p: test.filter(|_| first != second).map(|test| test.p),
        p_adjusted: None,
        p_equivalence: difference.zip(margin).map(|(d, margin)| d.equivalence_p(margin)),
        answer: if first == second { Answer::Same } else { Answer::CannotTell },
    }
}

/// Answers: equal values are the same; so are means within the margin; other figures are different by the adjusted `p`.
fn judge(quantities: &mut [Quantity], alpha: f64) {
    let p: Vec<f64> = quantities.iter().map(|q| q.p.unwrap_or(f64::NAN)).collect();
    for (quantity, adjusted) in quantities.iter_mut().zip(holm(&p)) {
        quantity.p_adjusted = Some(adjusted).filter(|p| !p.is_nan());
        if quantity.p_equivalence.is_some_and(|p| p <= alpha) {
            quantity.answer = Answer::Same;
        } else if adjusted <= alpha {
            quantity.answer = Answer::Different;
        }
    }
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
        _ if n == 0 => "no table holds a group that both releases have".to_owned(),
        Answer::Same => format!("all {n} figures are the same within the margin"),
        Answer::Different => {
            let names = quantities.iter().filter(|q| q.answer == Answer::Different);
            let names: Vec<String> = names.map(|q| format!("{} of {}", q.figure, q.group)).collect();
            format!("{} of {n} figures differ: {}", names.len(), names.join("; "))
        }
        Answer::CannotTell => format!(
            "no figure is shown to differ; {same} of {n} are the same within the margin, of the others the data rules out \
             neither"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIGURES: [&str; 4] = ["a", "b", "c", "d"];

    /// Normal values of mean 10 of four figures on terrains whose random streams are named by `seed`, raised by `shift`.
    fn drawn(terrains: usize, seed: u64, shift: f64) -> Figures {
        let mut stream = Streams::for_seed(seed, "drawn").stream("values");
        let mut figures = Figures::default();
        for k in 0..terrains {
            let terrain = format!("t-{k:04}");
            for name in FIGURES {
                let by_terrain = figures.values.entry(("missions", "g".to_owned(), name, "m")).or_default();
                by_terrain.insert(terrain.clone(), (10.0 + shift + stream.normal(), 1));
            }
            figures.grounds.insert(terrain, (None, Some(seed.to_string())));
        }
        figures
    }

    fn compared(a: &Figures, b: &Figures, margin: f64) -> Vec<Quantity> {
        let (parameters, streams) = (Parameters { margin, alpha: 0.05 }, Streams::for_seed(1, STAGE));
        let mut quantities: Vec<Quantity> =
            a.keys_in(b).map(|key| quantity(key, a, b, &parameters, &streams)).collect();
        judge(&mut quantities, parameters.alpha);
        quantities
    }

    /// Null: both releases have normal values of one distribution, 7 terrains each, four figures. Statistic: comparisons
    /// with any "different" among 200, each with probability 0.05 at most. More than 27 have a probability below 1e-6; a
    /// test that took the figures one by one (rate 0.19) would give some 37.
    #[test]
    fn stat_any_difference_is_found_seldom_where_there_is_none() {
        let any = |k: u64| {
            let found = compared(&drawn(7, 2 * k + 10, 0.0), &drawn(7, 2 * k + 11, 0.0), 0.05);
            found.iter().any(|q| q.answer == Answer::Different)
        };
        let wrong = (0..200).filter(|k| any(*k)).count();
        assert!(wrong <= 27, "{wrong} of 200");
    }

    #[test]
    fn val_answers() {
        let a = drawn(20, 1, 0.0);
        let all = |quantities: Vec<Quantity>, answer| quantities.iter().all(|q| q.answer == answer);
        // Equal values; the same terrains raised by a little more and by a little less than the margin.
        assert!(all(compared(&a, &a, 0.05), Answer::Same));
        let raised = |by: f64| {
            let mut b = drawn(20, 1, 0.0);
            let sums = b.values.values_mut().flat_map(BTreeMap::values_mut);
            sums.enumerate().for_each(|(k, (sum, _))| *sum += by + 1e-3 * (k % 7) as f64);
            b
        };
        let (above, below) = (compared(&a, &raised(1.0), 0.05), compared(&a, &raised(0.1), 0.05));
        // Two of 2^20 arrangements of signs are as extreme; of the 9999 that are drawn none is expected.
        assert!(above.iter().all(|q| q.paired && q.p.is_some_and(|p| p <= 3e-4)), "{above:?}");
        assert!(all(above, Answer::Different) && all(below, Answer::Same));
        // Other terrains: too few to tell, far apart, and a single one.
        assert!(all(compared(&drawn(4, 2, 0.0), &drawn(4, 3, 0.0), 0.05), Answer::CannotTell));
        let apart = compared(&a, &drawn(20, 2, 5.0), 0.05);
        assert!(apart.iter().all(|q| !q.paired) && all(apart, Answer::Different));
        let one = compared(&drawn(1, 2, 0.0), &drawn(1, 3, 0.0), 0.05);
        assert!(one.iter().all(|q| q.p == Some(1.0) && q.p_equivalence.is_none()) && all(one, Answer::CannotTell));
    }
}
