//! What the documents tell of, and the words that several of them use.

use super::spdx_list;
use crate::runner::execute::Failure;
use crate::splits::{self, OTHER, PARTS, Splits};
use sastrugi_schemas::manifest::{Artifact, Source};
use sastrugi_schemas::study::{Creator, StudyHead};
use sastrugi_schemas::tables::{self, Table};
use sastrugi_terrain::{MAPS, MapKind};
use serde_json::Value;

/// Folders of a release.
pub const FOLDERS: [(&str, &str); 14] = [
    ("dem/", "measured inputs, and the same in metres (`.metric.tif`)"),
    ("mask/", "masks of the fits, obstacles of the routes"),
    ("input/", "rasters and measured points that terrains and recovered surfaces are made with"),
    ("terrain/", "generated heightfields, GeoTIFF, float32 metres, no data -9999; maps of the same cells beside them"),
    (
        "export/",
        "terrains to import into simulators: `export/<terrain>/<simulator>/README.md` says how; `export/vehicle/`: the vehicles",
    ),
    ("texture/", "synthesised textures, GeoTIFF, float32 metres, no data -9999"),
    ("classes/", "roughness classes: 0 low, 1 semi, 2 high, 255 none; `.raw.tif` before closing"),
    ("fit/", "covariance fits (JSON), with background, residual and the cells used"),
    (
        "route/",
        "planned routes, GeoJSON in the terrain's own coordinates (m), not RFC 7946's WGS84; `.blocked.tif`: 1 where obstacles keep routes out",
    ),
    (
        "image/",
        "rendered images, GeoTIFF, float32 brightness (I/F), no data -9999 where no ground is seen; `.json`: sun, camera and the rest; `.png` to look at",
    ),
    (
        "photoclinometry/",
        "surfaces recovered from images, GeoTIFF, float32 metres, no data -9999; beside them `.albedo.tif`, standard deviations (`.uncertainty.tif` of heights, m; `.slope-sigma.tif`; `.albedo-sigma.tif`), `.condition.tif` (condition number), `.lit.tif` (images that show a cell lit), `.leaning.tif` (1 where the albedo leans on neighbours)",
    ),
    ("mcap/", "one recording per mission, run of a team, or recorded rover"),
    ("tables/", "Parquet, units and descriptions in the column metadata"),
    ("report/", "report: `index.html`, one offline page"),
];
/// Type of a creator that is not a person, in the words of schema.org.
pub const ORGANIZATION: &str = "Organization";
/// Name of a creator who has none.
const UNNAMED: &str = "unnamed";

/// Who made the release, or took part in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Maker<'a> {
    /// Name.
    pub name: &'a str,
    /// True for an organisation, false for a person.
    pub is_organization: bool,
    /// ORCID iD.
    pub orcid: Option<&'a str>,
    /// Organisation that a person works for.
    pub affiliation: Option<&'a str>,
}

impl Maker<'_> {
    /// Type in the words of schema.org.
    pub fn kind(&self) -> &'static str {
        if self.is_organization { ORGANIZATION } else { "Person" }
    }

    /// Page of the ORCID iD.
    pub fn page(&self) -> Option<String> {
        self.orcid.map(|orcid| format!("https://orcid.org/{orcid}"))
    }
}

/// What the documents tell of.
pub struct Described<'a> {
    /// The study's head.
    pub head: &'a StudyHead,
    /// Measured data.
    pub sources: &'a [Source],
    /// Files of the release, sorted by path: all but the documents, the report and what seals it.
    pub artifacts: &'a [Artifact],
    /// Which terrains are for training, validation and test.
    pub splits: &'a Splits,
    /// Items without a result.
    pub failures: &'a [Failure],
}

impl<'a> Described<'a> {
    /// Maps that some terrain has.
    pub fn maps(&self) -> impl Iterator<Item = MapKind> {
        MAPS.into_iter().filter(|map| self.artifacts.iter().any(|artifact| is_map(&artifact.path, map.name)))
    }

    /// Files of a table, in order.
    pub fn parts(&self, table: &str) -> impl Iterator<Item = &'a Artifact> {
        let folder = format!("tables/{table}/");
        self.artifacts.iter().filter(move |artifact| artifact.path.starts_with(&folder))
    }

    /// Paths of a table's files by the part that their rows are in, those in none last; empty where the files do not tell parts apart.
    pub fn by_part(&self, table: &Table) -> Vec<(&'static str, Vec<&'a str>)> {
        let part = |path: &str| splits::of_file(table, part_name(path)?, self.splits);
        let of = |wanted: &'static str| {
            let paths = self.parts(table.name).map(|artifact| artifact.path.as_str());
            (wanted, paths.filter(|path| part(path) == Some(wanted)).collect::<Vec<&'a str>>())
        };
        PARTS.into_iter().chain([OTHER]).map(of).filter(|(_, paths)| !paths.is_empty()).collect()
    }

    /// Who made the release.
    pub fn creators(&self) -> impl Iterator<Item = Maker<'a>> {
        let head = self.head;
        let is_organization = move |name: &str| head.organizations.iter().any(|organization| organization == name);
        let maker = move |creator: &'a Creator| Maker {
            name: creator.name(),
            is_organization: is_organization(creator.name()),
            orcid: creator.orcid(),
            affiliation: creator.affiliation(),
        };
        let unnamed = Maker { name: UNNAMED, is_organization: false, orcid: None, affiliation: None };
        head.creators.iter().map(maker).chain(head.creators.is_empty().then_some(unnamed))
    }

    /// Tables that have a file.
    pub fn tables(&self) -> impl Iterator<Item = &'static Table> {
        tables::ALL.into_iter().filter(|table| self.parts(table.name).next().is_some())
    }

    /// Whether the release has files in that folder; the report is written after the documents.
    pub fn has(&self, folder: &str) -> bool {
        folder == "report/" || self.artifacts.iter().any(|artifact| artifact.path.starts_with(folder))
    }
}

/// Name of a file of a table: `a` of `tables/samples/part-a.parquet`.
fn part_name(path: &str) -> Option<&str> {
    path.rsplit('/').next()?.strip_prefix("part-")?.strip_suffix(".parquet")
}

/// Whether a file of the release is that map of a terrain. No id ends so.
fn is_map(path: &str, name: &str) -> bool {
    let id = path.strip_prefix("terrain/").and_then(|file| file.strip_suffix(".tif"));
    id.is_some_and(|id| id.ends_with(&format!(".{name}")))
}

/// The files of a map.
pub fn map_files(map: MapKind) -> String {
    format!("terrain/*.{}.tif", map.name)
}

/// What a map shows, with its unit where it has one.
pub fn map_words(map: MapKind) -> String {
    format!("{}{}", map.description, if map.unit == "m" { ", m" } else { "" })
}

/// Where the dataset is found, if anywhere.
pub fn page(head: &StudyHead) -> Option<String> {
    head.doi.as_ref().map(|doi| format!("https://doi.org/{doi}")).or_else(|| head.url.clone())
}

/// One line to cite the dataset by.
pub fn citation_line(head: &StudyHead) -> String {
    let version = head.version.as_ref().map_or_else(String::new, |v| format!(", version {v}"));
    let page = page(head).map_or_else(String::new, |page| format!(", {page}"));
    let year = head.date.get(..4).unwrap_or_default();
    folded(&format!("{} ({year}): {}{version}{page}", authors(head), head.title))
}

/// Names of the creators in one text.
pub fn authors(head: &StudyHead) -> String {
    let names: Vec<&str> = head.creators.iter().map(Creator::name).collect();
    if names.is_empty() { UNNAMED.to_owned() } else { names.join("; ") }
}

/// One line on measured data: whose it is, under which licence, how to cite it.
pub fn source_line(source: &Source) -> String {
    let Source { id, license, attribution, citation } = source;
    let attribution = attribution.as_ref().map_or_else(String::new, |who| format!(" {who}."));
    let license = license.as_ref().map_or_else(|| " No licence stated.".to_owned(), |l| format!(" Licence: {l}."));
    let citation = citation.as_ref().map_or_else(String::new, |c| format!(" Cite as: {c}"));
    folded(&format!("`{id}`:{attribution}{license}{citation}"))
}

/// Adds what measured data asks for to its description in the words of schema.org.
pub fn add_terms(work: &mut Value, source: &Source) {
    let terms = [
        ("license", source.license.as_deref().map(spdx_list::address)),
        ("creditText", source.attribution.clone()),
        ("citation", source.citation.clone()),
    ];
    for (key, value) in terms.into_iter().filter_map(|(key, value)| Some((key, value?))) {
        work[key] = Value::String(value);
    }
}

/// A YAML string in double quotes: JSON's, with what YAML does not take as it is, or takes for the end of a line, by its number.
pub fn quoted(text: &str) -> String {
    let escaped =
        |c: char| matches!(c, '\u{7f}'..='\u{9f}' | '\u{2028}' | '\u{2029}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}');
    let json = Value::String(text.to_owned()).to_string();
    let one = |c: char| if escaped(c) { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() };
    json.chars().map(one).collect()
}

/// On one line: words of a study in a text whose lines mean something.
pub fn folded(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
