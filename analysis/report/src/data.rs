//! Input of the page: the rows and files of one assembled release, read only through `sastrugi-store`.
//!
//! Tables are read once; rasters and samples are read one at a time, when a figure needs them. Whatever a release lacks is an empty
//! table or `None`; a file that exists but cannot be read is an error, and so is one that the manifest lists but that is missing. Of
//! missions and their starts, only the columns that the page needs are kept ([`Mission`], [`Start`]); of the curves of terrains, only
//! those of a random sample of each large group.

mod kept;

pub use kept::{Mission, Name, Names, Start};

use crate::ReportError;
use crate::sample::sample;
use sastrugi_numeric::{Grid, Stream, Streams};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::manifest::FailedItem;
use sastrugi_schemas::study::{HypothesisItem, RoughnessSection};
use sastrugi_schemas::tables::{
    CandidateCurveRow, CandidateRow, CovarianceRow, FitRow, FormationEventRow, FormationRow, FormationSampleRow,
    HeightDistributionRow, ImageRow, LikelihoodProfileRow, LogRow, ParameterRow, PhotoclinometryBandRow,
    PhotoclinometryRow, ProfilePsdRow, PsdRow, RoutePointRow, RouteRow, RoverEffectRow, RoverRow, RoverSampleRow,
    SampleRow, ScoreCovarianceRow, ScoreRow, StructureRow, SurfaceRow, TerrainRow,
};
use std::collections::{BTreeMap, BTreeSet};

/// Files of a release that are read on demand. Paths are relative to the release; `None` if there is no such file.
pub trait Files {
    /// Heights or residuals, NaN where there is no data.
    fn grid(&self, path: &str) -> Result<Option<Grid>, ReportError>;
    /// Roughness class codes.
    fn classes(&self, path: &str) -> Result<Option<Grid<u8>>, ReportError>;
    /// Recorded samples of these missions on a terrain, sorted by mission.
    fn samples(&self, terrain_id: &str, missions: &BTreeSet<&str>) -> Result<Vec<SampleRow>, ReportError>;
    /// Points of every route.
    fn route_points(&self) -> Result<Vec<RoutePointRow>, ReportError>;
    /// Recorded samples of every team on a terrain.
    fn formation_samples(&self, terrain_id: &str) -> Result<Vec<FormationSampleRow>, ReportError>;
    /// Recorded samples of every rover on a terrain.
    fn rover_samples(&self, terrain_id: &str) -> Result<Vec<RoverSampleRow>, ReportError>;
    /// A fit file.
    fn fit(&self, path: &str) -> Result<Option<FitFile>, ReportError>;
}

/// Number and size of the data files of the release.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stored {
    /// Number of all.
    pub files: usize,
    /// Number of recordings among them.
    pub recordings: usize,
    /// Size of all, bytes.
    pub bytes: u64,
}

impl Stored {
    /// Counts a file.
    pub fn add(&mut self, path: &str, bytes: u64) {
        self.files += 1;
        self.recordings += usize::from(path.ends_with(".mcap"));
        self.bytes += bytes;
    }
}

/// `[study]` of the study file, as far as the page shows it.
#[derive(Clone, Debug, Default)]
pub struct Study {
    /// Short name.
    pub name: String,
    /// Title.
    pub title: String,
    /// Version of the dataset; empty if the study states none.
    pub version: String,
    /// A paragraph.
    pub description: String,
    /// Seed of every random stream.
    pub seed: u64,
    /// Date of the study.
    pub date: String,
    /// Licence of the release.
    pub license: String,
    /// Names of its creators.
    pub creators: Vec<String>,
    /// Declared hypotheses.
    pub hypotheses: Vec<HypothesisItem>,
    /// Settings of the roughness classes.
    pub roughness: RoughnessSection,
}

/// Rows of a release; every table is sorted by its keys.
pub struct Data {
    /// The study.
    pub study: Study,
    /// SHA-256 of the release's `study.toml`.
    pub study_sha256: String,
    /// Version of the program that wrote the release.
    pub version: String,
    /// Data files of the release.
    pub stored: Stored,
    /// Items that failed. A release lists them once it is sealed.
    pub failed: Vec<FailedItem>,
    /// Heightfields.
    pub terrains: Vec<TerrainRow>,
    /// Ids of surfaces whose curves are not kept: generated terrains beyond a random sample of [`CURVES_MAX`] of their group, and textures that
    /// are not drawn, with their residuals. Of such a residual only the structure function over all directions is kept.
    pub without_curves: BTreeSet<String>,
    /// Fits.
    pub fits: Vec<FitRow>,
    /// Covariance bins.
    pub covariance: Vec<CovarianceRow>,
    /// Candidate models of the fits.
    pub candidates: Vec<CandidateRow>,
    /// Their curves at the bins.
    pub candidate_curves: Vec<CandidateCurveRow>,
    /// Profile likelihoods over the range.
    pub likelihood_profile: Vec<LikelihoodProfileRow>,
    /// Surface parameters.
    pub surfaces: Vec<SurfaceRow>,
    /// Structure functions.
    pub structure: Vec<StructureRow>,
    /// Spectra of profiles.
    pub profile_psd: Vec<ProfilePsdRow>,
    /// Spectra.
    pub psd: Vec<PsdRow>,
    /// Histograms of heights.
    pub heights: Vec<HeightDistributionRow>,
    /// Scoreboards of synthesis methods.
    pub scoreboard: Vec<ScoreRow>,
    /// Covariances of their methods.
    pub scoreboard_covariance: Vec<ScoreCovarianceRow>,
    /// Missions.
    pub missions: Vec<Mission>,
    /// Starts of missions with several starts.
    pub replicates: Vec<Start>,
    /// Routes.
    pub routes: Vec<RouteRow>,
    /// Rendered images.
    pub images: Vec<ImageRow>,
    /// Surfaces recovered from images.
    pub photoclinometry: Vec<PhotoclinometryRow>,
    /// The same by wavelength.
    pub photoclinometry_bands: Vec<PhotoclinometryBandRow>,
    /// Runs of teams.
    pub formations: Vec<FormationRow>,
    /// Events of these runs.
    pub formation_events: Vec<FormationEventRow>,
    /// Rovers.
    pub rovers: Vec<RoverRow>,
    /// Effects of their perturbed parameters.
    pub rover_effects: Vec<RoverEffectRow>,
    /// Every parameter of every run.
    pub parameters: Vec<ParameterRow>,
    /// Hashes of the heights of heightfields by path, once the release is sealed.
    pub contents: BTreeMap<String, String>,
    /// Another release to compare this one with.
    pub against: Option<Against>,
    /// Analysed logs to compare the missions with; `None` if none were given.
    pub logs: Option<Vec<LogRow>>,
    /// Files read on demand.
    pub files: Box<dyn Files>,
}

/// Another release.
pub struct Against {
    /// Name of its folder.
    pub name: String,
    /// Its data.
    pub data: Box<Data>,
}

/// Maximum number of terrains of a group whose curves (spectra, structure functions, histograms) are kept.
pub const CURVES_MAX: usize = 200;

/// End of the id under which a texture's stage stores its residual, after the detrending and trimming of the fit.
pub const RESIDUAL: &str = ".residual";

/// Names the surfaces whose curves no figure shows, from the tables that are read before the curves: the page knows what it draws, not the reader.
pub type Undrawn = fn(&Data) -> Vec<String>;

/// True for the structure function of a residual over all directions, with which every texture is judged.
pub(crate) fn is_judged(row: &StructureRow) -> bool {
    row.direction == "all" && row.surface_id.ends_with(RESIDUAL)
}

/// The generated terrains beyond a random sample of [`CURVES_MAX`] of each group and variant.
pub(crate) fn without_curves(seed: u64, terrains: &[TerrainRow]) -> BTreeSet<String> {
    let mut groups: BTreeMap<(&str, Option<&str>), Vec<&str>> = BTreeMap::new();
    for terrain in terrains.iter().filter(|terrain| terrain.stage == "terrain") {
        groups.entry((label(terrain), terrain.variant.as_deref())).or_default().push(&terrain.terrain_id);
    }
    let beyond = |((label, variant), ids): ((&str, Option<&str>), Vec<&str>)| {
        let mut stream = Streams::for_item(seed, "report", label).stream(variant.unwrap_or("curves"));
        let kept: BTreeSet<&str> = sample(ids.clone(), CURVES_MAX, &mut stream).into_iter().collect();
        ids.into_iter().filter(move |id| !kept.contains(id)).map(str::to_owned).collect::<Vec<_>>()
    };
    groups.into_iter().flat_map(beyond).collect()
}

/// Rows with one label, which are compared with other groups.
#[derive(Clone, Debug)]
pub struct Group<'a, R> {
    /// Label, with the run if the release has several.
    pub name: String,
    /// Label alone.
    pub label: String,
    /// Id of the run, for missions.
    pub run: Option<String>,
    /// Number among all groups of the release, which sets its colour.
    pub index: usize,
    /// Its rows, in the order of the table.
    pub rows: Vec<&'a R>,
}

impl Data {
    /// The random stream of a bootstrap or a sample, named by an item (a group) and by the quantity or what is drawn.
    pub fn stream(&self, item: &str, figure: &str) -> Stream {
        Streams::for_item(self.study.seed, "report", item).stream(figure)
    }

    /// Generated terrains by group, groups in natural order: the plain terrains, or all if every one is a variant.
    pub fn terrain_groups(&self) -> Vec<Group<'_, TerrainRow>> {
        let all: Vec<&TerrainRow> = self.of_stage("terrain").collect();
        self.grouping().grouped(plain(all, |t| t.variant.is_none()).into_iter().map(|t| ((label(t), None), t)))
    }

    /// Missions of the plain run by group, groups in natural order; all missions if every one belongs to a variant.
    pub fn mission_groups(&self) -> Vec<Group<'_, Mission>> {
        self.grouping().groups_of(plain(self.missions.iter().collect(), |m| m.variant.is_none()))
    }

    /// The missions of each variant, in the order of the table.
    pub fn missions_by_variant(&self) -> BTreeMap<&str, Vec<&Mission>> {
        let mut variants: BTreeMap<&str, Vec<&Mission>> = BTreeMap::new();
        for mission in &self.missions {
            if let Some(variant) = mission.variant.as_deref() {
                variants.entry(variant).or_default().push(mission);
            }
        }
        variants
    }

    /// What rows are grouped by. Takes a few passes over all missions, so build it once if you group several times.
    pub fn grouping(&self) -> Grouping<'_> {
        Grouping::of(self)
    }

    /// Ids of the runs of the plain missions; variants belong to these.
    fn runs(&self) -> Vec<&str> {
        let has_plain = self.missions.iter().any(|m| m.variant.is_none());
        let plain = self.missions.iter().filter(|m| !has_plain || m.variant.is_none());
        distinct(plain.map(|m| m.traverse_id.as_str())).into_iter().collect()
    }

    /// True when plain missions belong to several runs.
    pub fn has_several_runs(&self) -> bool {
        self.runs().len() > 1
    }

    /// Heightfields of a stage.
    pub fn of_stage<'a>(&'a self, stage: &'a str) -> impl Iterator<Item = &'a TerrainRow> {
        self.terrains.iter().filter(move |t| t.stage == stage)
    }

    /// The heightfield with an id.
    pub fn terrain(&self, id: &str) -> Option<&TerrainRow> {
        self.terrains.iter().find(|t| t.terrain_id == id)
    }

    /// Missions of the plain run on a terrain; all missions if every one belongs to a variant.
    pub fn missions_on(&self, terrain_id: &str) -> Vec<&Mission> {
        plain(of_key(&self.missions, |m| &m.terrain_id, terrain_id).iter().collect(), |m| m.variant.is_none())
    }

    /// Starts of a mission, the drawn one first; empty if it has only that.
    pub fn starts_of(&self, mission: &Mission) -> &[Start] {
        let on_terrain = of_key(&self.replicates, |r| &r.terrain_id, &mission.terrain_id);
        of_key(on_terrain, |r| &r.mission_id, &mission.mission_id)
    }

    /// Spectrum of a heightfield: bins with a positive frequency and density.
    pub fn spectrum(&self, id: &str) -> Vec<&PsdRow> {
        let usable = |r: &&PsdRow| r.frequency_cycles_m > 0.0 && r.psd_m4 > 0.0;
        of_key(&self.psd, |r| &r.surface_id, id).iter().filter(usable).collect()
    }

    /// Parameters of a surface.
    pub fn surface(&self, id: &str) -> Option<&SurfaceRow> {
        of_key(&self.surfaces, |s| &s.surface_id, id).first()
    }

    /// Structure function of a surface in a direction: lags with a positive value.
    pub fn structure_of(&self, id: &str, direction: &str) -> Vec<&StructureRow> {
        let usable = |r: &&StructureRow| r.direction == direction && r.lag_m > 0.0 && r.value_m2 > 0.0;
        of_key(&self.structure, |r| &r.surface_id, id).iter().filter(usable).collect()
    }

    /// Spectrum of a surface's profiles in a direction.
    pub fn profile_spectrum(&self, id: &str, direction: &str) -> Vec<&ProfilePsdRow> {
        let usable = |r: &&ProfilePsdRow| r.direction == direction && r.frequency_cycles_m > 0.0 && r.psd_m3 > 0.0;
        of_key(&self.profile_psd, |r| &r.surface_id, id).iter().filter(usable).collect()
    }

    /// Candidate models of a fit, the best first.
    pub fn candidates_of(&self, fit: &str) -> &[CandidateRow] {
        of_key(&self.candidates, |r| &r.fit_id, fit)
    }

    /// Curve of a candidate at the bins.
    pub fn candidate_curve(&self, fit: &str, rank: i64) -> Vec<&CandidateCurveRow> {
        let usable = |r: &&CandidateCurveRow| r.rank == rank && r.model_m2.is_finite();
        of_key(&self.candidate_curves, |r| &r.fit_id, fit).iter().filter(usable).collect()
    }

    /// Profile likelihood of a fit.
    pub fn profile_of(&self, fit: &str) -> Vec<&LikelihoodProfileRow> {
        let usable = |r: &&LikelihoodProfileRow| r.range_m > 0.0 && r.chi2_rise.is_finite();
        of_key(&self.likelihood_profile, |r| &r.fit_id, fit).iter().filter(usable).collect()
    }

    /// Histogram of a heightfield.
    pub fn histogram(&self, id: &str) -> Vec<&HeightDistributionRow> {
        of_key(&self.heights, |r| &r.surface_id, id).iter().filter(|r| r.density_per_m.is_finite()).collect()
    }
}

/// Labels, runs and numbers of all groups of a release.
pub struct Grouping<'a> {
    /// Labels of the terrains of missions that have none of their own, by terrain.
    of_terrains: BTreeMap<&'a str, &'a str>,
    /// Ids of the runs of the plain missions.
    runs: Vec<&'a str>,
    /// Number of each group of the release, by the key of its name.
    numbers: BTreeMap<Natural, usize>,
}

impl<'a> Grouping<'a> {
    fn of(data: &'a Data) -> Self {
        let unnamed = data.missions.iter().any(|m| m.group.is_none());
        let terrains = data.terrains.iter().filter(|_| unnamed);
        let of_terrains = terrains.map(|t| (t.terrain_id.as_str(), label(t))).collect();
        let mut grouping = Self { of_terrains, runs: data.runs(), numbers: BTreeMap::new() };
        let all = {
            let missions = data.missions.iter().map(grouping.names());
            let terrains = data.terrains.iter().map(|t| (label(t), None));
            distinct(terrains.chain(missions))
        };
        let keys: BTreeSet<Natural> = all.into_iter().map(|of| grouping.key(of)).collect();
        grouping.numbers = keys.into_iter().zip(0..).collect();
        grouping
    }

    /// Missions by group, groups in natural order. If the release has several runs, each is a separate group, because other vehicles
    /// or other paths are not repetitions.
    pub fn groups_of(&self, missions: Vec<&'a Mission>) -> Vec<Group<'a, Mission>> {
        let mut names = self.names();
        self.grouped(missions.into_iter().map(|m| (names(m), m)))
    }

    /// Function that returns label and run of a mission.
    fn names(&self) -> impl FnMut(&'a Mission) -> Of<'a> {
        let mut last: Option<(&'a Mission, Of<'a>)> = None;
        move |m| {
            // Missions of one terrain follow each other.
            let alike =
                |n: &Mission| n.traverse_id == m.traverse_id && n.terrain_id == m.terrain_id && n.group == m.group;
            let of_terrain = || self.of_terrains.get(m.terrain_id.as_str()).copied();
            let of = match last {
                Some((before, of)) if alike(before) => of,
                _ => (m.group.as_deref().or_else(of_terrain).unwrap_or("all"), run(&self.runs, m)),
            };
            last = Some((m, of));
            of
        }
    }

    /// Sort key of the name of a group, and the name.
    fn key(&self, (label, run): Of<'_>) -> Natural {
        match run {
            Some(run) if self.runs.len() > 1 => natural(&format!("{label}, {run}")),
            _ => natural(label),
        }
    }

    /// Rows by label and run. The number of a group does not depend on the rows.
    fn grouped<R>(&self, rows: impl Iterator<Item = (Of<'a>, &'a R)>) -> Vec<Group<'a, R>> {
        let mut groups: Vec<(Of, Vec<&R>)> = Vec::new();
        let (mut places, mut keys) = (BTreeMap::<Of, usize>::new(), BTreeMap::<Natural, usize>::new());
        for (of, row) in rows {
            let place = *places.entry(of).or_insert_with(|| {
                // Labels and runs may have one name.
                let place = *keys.entry(self.key(of)).or_insert(groups.len());
                if place == groups.len() {
                    groups.push((of, Vec::new()));
                }
                place
            });
            groups[place].1.push(row);
        }
        let group = |(key, place): (Natural, usize)| {
            let ((label, run), rows) = &mut groups[place];
            Group {
                index: self.numbers.get(&key).copied().unwrap_or(self.numbers.len()),
                name: key.1,
                label: (*label).to_owned(),
                run: run.map(str::to_owned),
                rows: std::mem::take(rows),
            }
        };
        keys.into_iter().map(group).collect()
    }
}

/// The different items; equal ones that follow each other are looked up once.
fn distinct<T: Ord + Copy>(items: impl Iterator<Item = T>) -> BTreeSet<T> {
    let mut all = BTreeSet::new();
    let mut last = None;
    for item in items {
        if last != Some(item) {
            all.insert(item);
            last = Some(item);
        }
    }
    all
}

/// The plain rows; all of them if none is plain.
fn plain<R>(mut rows: Vec<&R>, is_plain: impl Fn(&R) -> bool) -> Vec<&R> {
    if rows.iter().any(|r| is_plain(r)) {
        rows.retain(|r| is_plain(r));
    }
    rows
}

/// The run that a mission, or its plain counterpart, belongs to. A sweep appends its values to the id after a hyphen; other tables are
/// variants of a run if their ids begin with it in the same way (`husky-torque`).
fn run<'a>(runs: &[&'a str], mission: &Mission) -> Option<&'a str> {
    let belongs = |run: &&&str| {
        mission.traverse_id.strip_prefix(**run).is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
    };
    runs.iter().filter(belongs).max_by_key(|run| run.len()).copied()
}

/// The rows with one key, in a table sorted by it.
///
/// ```
/// use sastrugi_report::data::of_key;
///
/// let rows = [("a", 1), ("b", 2), ("b", 3), ("d", 4)];
/// assert_eq!(of_key(&rows, |row| row.0, "b"), [("b", 2), ("b", 3)]);
/// assert!(of_key(&rows, |row| row.0, "c").is_empty());
/// ```
pub fn of_key<'a, R>(rows: &'a [R], key: impl Fn(&R) -> &str, id: &str) -> &'a [R] {
    let from = rows.partition_point(|r| key(r) < id);
    &rows[from..][..rows[from..].partition_point(|r| key(r) <= id)]
}

/// The group of a heightfield: its label, or its generator if it has none.
pub fn label(terrain: &TerrainRow) -> &str {
    terrain.group.as_deref().unwrap_or(&terrain.kind)
}

/// Label and run.
type Of<'a> = (&'a str, Option<&'a str>);

/// Sort key of a label (numbers before words, numbers by value), and the label.
pub type Natural = (Vec<(u64, String)>, String);

/// A key under which `d2.3` < `d2.45` < `d10`: runs of digits and dots compare by value.
///
/// ```
/// use sastrugi_report::data::natural;
///
/// let mut labels = ["d10", "d2.45", "rough", "d2.3"];
/// labels.sort_by_key(|label| natural(label));
/// assert_eq!(labels, ["d2.3", "d2.45", "d10", "rough"]);
/// ```
pub fn natural(label: &str) -> Natural {
    let numeric = |c: &char| c.is_ascii_digit() || *c == '.';
    let chars: Vec<char> = label.chars().collect();
    let part = |run: &[char]| {
        let text: String = run.iter().collect();
        match text.parse::<f64>() {
            // The bits of non-negative floats sort as their values do.
            Ok(n) if run.iter().all(numeric) => (n.to_bits(), String::new()),
            _ => (u64::MAX, text),
        }
    };
    (chars.chunk_by(|a, b| numeric(a) == numeric(b)).map(part).collect(), label.to_owned())
}

/// Text of a key in the JSON parameters of a heightfield, such as `fit` of a texture.
pub fn parameter(terrain: &TerrainRow, key: &str) -> Option<String> {
    let params: serde_json::Value = serde_json::from_str(&terrain.params).ok()?;
    params.get(key)?.as_str().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The number of a group does not depend on which rows are grouped: it is the position of the group among all groups in natural order.
    #[test]
    fn prop_numbers_of_groups_do_not_depend_on_what_is_grouped() {
        let data = crate::tests::made_up::full(2, 24);
        let grouping = data.grouping();
        let mut numbers: BTreeMap<String, usize> = BTreeMap::new();
        let missions = data.mission_groups().into_iter().map(|group| (group.name, group.index));
        let terrains = data.terrain_groups().into_iter().map(|group| (group.name, group.index));
        for (name, index) in missions.chain(terrains) {
            assert_eq!(*numbers.entry(name.clone()).or_insert(index), index, "{name}");
        }
        let mut names: Vec<&String> = numbers.keys().collect();
        names.sort_by_key(|name| natural(name));
        assert!(names.len() > 2 && names.is_sorted_by(|a, b| numbers[*a] < numbers[*b]), "{numbers:?}");
        let variants = data.missions_by_variant();
        assert!(variants.len() > 2);
        let of_variants: usize = variants.values().map(Vec::len).sum();
        assert_eq!(of_variants, data.missions.iter().filter(|m| m.variant.is_some()).count());
        for (variant, missions) in variants {
            for group in grouping.groups_of(missions) {
                assert_eq!(numbers.get(&group.name), Some(&group.index), "{variant}");
                assert!(group.rows.iter().all(|m| m.variant.as_deref() == Some(variant)));
            }
        }
    }

    #[test]
    fn val_labels_sort_naturally() {
        let mut labels = ["d10", "2.6", "d2", "10", "2.45", "rough", "", "inf"];
        labels.sort_by_key(|l| natural(l));
        assert_eq!(labels, ["", "2.45", "2.6", "10", "d2", "d10", "inf", "rough"]);
    }

    #[test]
    fn val_plain_rows_come_first_or_all() {
        let [one, two, three] = [1, 2, 3];
        assert_eq!(plain(vec![&one, &two, &three], |n| *n != 2), [&1, &3]);
        assert_eq!(plain(vec![&one, &two], |_| false), [&1, &2]);
    }

    /// A group with many terrains keeps the curves of 200, the same each time; smaller groups keep all.
    #[test]
    fn prop_curves_of_a_sample_of_each_large_group() {
        let one = crate::tests::made_up::full(1, 24).terrains.swap_remove(0);
        let terrain = |group: &str, variant: Option<&str>, k: usize| TerrainRow {
            terrain_id: format!("{group}-{}-{k}", variant.unwrap_or("plain")),
            group: Some(group.into()),
            variant: variant.map(str::to_owned),
            stage: "terrain".into(),
            ..one.clone()
        };
        let mut terrains: Vec<TerrainRow> = (0..450).map(|k| terrain("large", None, k)).collect();
        terrains.extend((0..CURVES_MAX).map(|k| terrain("large", Some("v = 1"), k)));
        // More textures than the curves of a group: they are not sampled.
        terrains
            .extend((0..=CURVES_MAX).map(|k| TerrainRow { stage: "texture".into(), ..terrain("textures", None, k) }));
        let without = without_curves(7, &terrains);
        assert_eq!(without.len(), 250);
        assert!(without.iter().all(|id| id.starts_with("large-plain-")), "{without:?}");
        assert!(without == without_curves(7, &terrains) && without != without_curves(8, &terrains));
    }

    /// Textures are judged by the structure functions of their residuals over all directions.
    #[test]
    fn val_structure_functions_by_which_textures_are_judged() {
        let row = |id: &str, direction: &str| StructureRow {
            surface_id: id.into(),
            direction: direction.into(),
            bin: 0,
            lag_m: 1.0,
            value_m2: 1.0,
            pairs: 1,
        };
        let judged =
            [("a.residual", "all"), ("a.residual", "x"), ("a", "all")].map(|(id, way)| is_judged(&row(id, way)));
        assert_eq!(judged, [true, false, false]);
    }

    /// Every surface is found by its id, and no other.
    #[test]
    fn prop_surfaces_are_found_by_their_ids() {
        let data = crate::tests::made_up::full(1, 24);
        assert!(data.surfaces.len() > 3);
        for surface in &data.surfaces {
            assert_eq!(data.surface(&surface.surface_id).map(|found| &found.surface_id), Some(&surface.surface_id));
        }
        assert!(["", "nothing", "zzz"].iter().all(|id| data.surface(id).is_none()));
    }

    /// A variant belongs to the run whose id it extends after a hyphen, the longest of several; other ids are not runs.
    #[test]
    fn val_variants_belong_to_their_run() {
        let missions = crate::tests::made_up::full(1, 24).missions;
        let of = |id: &str| run(&["husky", "husky-soft"], &Mission { traverse_id: id.into(), ..missions[0].clone() });
        assert_eq!([of("husky"), of("husky-friction-0.5")], [Some("husky"); 2]);
        assert_eq!([of("husky-soft"), of("husky-soft-0.5")], [Some("husky-soft"); 2]);
        assert_eq!([of("huskies"), of("rover")], [None, None]);
    }
}
