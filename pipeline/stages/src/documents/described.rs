//! What the documents tell of, and the words that several of them use.

use super::spdx_list;
use crate::runner::execute::Failure;
use sastrugi_schemas::manifest::{Artifact, Source};
use sastrugi_schemas::study::StudyHead;
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

/// What the documents tell of.
pub struct Described<'a> {
    /// The study's head.
    pub head: &'a StudyHead,
    /// Measured data.
    pub sources: &'a [Source],
    /// Files of the release, sorted by path: all but the documents, the report and what seals it.
    pub artifacts: &'a [Artifact],
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

    /// Who made the release: names, and their types in the words of schema.org.
    pub fn creators(&self) -> impl Iterator<Item = (&'a str, &'static str)> {
        let head = self.head;
        let names = head.creators.iter().map(String::as_str).chain(head.creators.is_empty().then_some("unnamed"));
        names.map(|name| (name, if head.organizations.iter().any(|o| o == name) { ORGANIZATION } else { "Person" }))
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
    if head.creators.is_empty() { "unnamed".to_owned() } else { head.creators.join("; ") }
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
