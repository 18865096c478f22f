//! Contents of the documents, and texts that several of them share.

use super::spdx_list;
use crate::runner::execute::Failure;
use crate::splits::{self, OTHER, PARTS, Splits};
use sastrugi_schemas::manifest::Source;
use sastrugi_schemas::study::{Creator, StudyHead};
use sastrugi_schemas::tables::{self, Table};
use sastrugi_store::release::Listed;
use sastrugi_terrain::{MAPS, MapKind};
use serde_json::Value;

/// Folders of a release.
pub const FOLDERS: [(&str, &str); 14] = [
    ("dem/", "measured DEMs as given, and their heights in metres (`.metric.tif`)"),
    ("mask/", "masks of the fits and obstacles of the routes"),
    ("input/", "input rasters and measured points for terrains and recovered surfaces"),
    ("terrain/", "generated heightfields, GeoTIFF, float32 metres, no data -9999, and maps on the same cells"),
    (
        "export/",
        "terrains for import into simulators (steps in `export/<terrain>/<simulator>/README.md`), and vehicles (`export/vehicle/`)",
    ),
    ("texture/", "synthesised textures, GeoTIFF, float32 metres, no data -9999"),
    ("classes/", "roughness classes: 0 low, 1 semi, 2 high, 255 no data; `.raw.tif`: before closing"),
    ("fit/", "covariance fits (JSON), with background, residual and mask of used cells"),
    (
        "route/",
        "planned routes, GeoJSON in the terrain's own coordinates (m), not WGS84 as in RFC 7946; `.blocked.tif`: 1 where obstacles block routes",
    ),
    (
        "image/",
        "rendered images, GeoTIFF, float32 brightness (I/F), no data -9999 where no ground is visible; `.json`: sun, camera and photometry; `.png`: for viewing",
    ),
    (
        "photoclinometry/",
        "surfaces recovered from images, GeoTIFF, float32 metres, no data -9999, with `.albedo.tif`, standard deviations (`.uncertainty.tif` of heights, m; `.slope-sigma.tif`; `.albedo-sigma.tif`), `.condition.tif` (condition number), `.lit.tif` (number of images in which a cell is lit), `.leaning.tif` (1 where the albedo is taken from neighbouring cells)",
    ),
    ("mcap/", "one recording per mission, team run or recorded rover"),
    ("tables/", "Parquet files, with units and descriptions in the column metadata"),
    ("report/", "report: open `index.html`, one offline page"),
];
/// The schema.org type of an organisation.
pub const ORGANIZATION: &str = "Organization";
/// Placeholder for a missing name.
const UNNAMED: &str = "unnamed";

/// A creator of, or contributor to, the release.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Maker<'a> {
    /// Name.
    pub name: &'a str,
    /// True for an organisation, false for a person.
    pub is_organization: bool,
    /// ORCID iD.
    pub orcid: Option<&'a str>,
    /// Affiliation of a person.
    pub affiliation: Option<&'a str>,
}

impl Maker<'_> {
    /// Type in schema.org.
    pub fn kind(&self) -> &'static str {
        if self.is_organization { ORGANIZATION } else { "Person" }
    }

    /// Page of the ORCID iD.
    pub fn page(&self) -> Option<String> {
        self.orcid.map(|orcid| format!("https://orcid.org/{orcid}"))
    }
}

/// Contents of the documents.
pub struct Described<'a> {
    /// The study's head.
    pub head: &'a StudyHead,
    /// Measured data.
    pub sources: &'a [Source],
    /// Files of the release, sorted by path, except documents, report, manifest and checksums.
    pub files: &'a [Listed],
    /// Split (training, validation or test) of each terrain.
    pub splits: &'a Splits,
    /// Items without a result.
    pub failures: &'a [Failure],
}

impl<'a> Described<'a> {
    /// Kinds of maps in the release.
    pub fn maps(&self) -> impl Iterator<Item = MapKind> {
        MAPS.into_iter().filter(|map| self.files.iter().any(|file| is_map(file.path(), map.name)))
    }

    /// Files of a table, in order.
    pub fn parts(&self, table: &str) -> impl Iterator<Item = &'a Listed> {
        let folder = format!("tables/{table}/");
        self.files.iter().filter(move |file| file.path().starts_with(&folder))
    }

    /// Paths of a table's files by split, files of rows without a split last; empty if the files are not divided by split.
    pub fn by_part(&self, table: &Table) -> Vec<(&'static str, Vec<&'a str>)> {
        let part = |path: &str| splits::of_file(table, part_name(path)?, self.splits);
        let of = |wanted: &'static str| {
            let paths = self.parts(table.name).map(Listed::path);
            (wanted, paths.filter(|path| part(path) == Some(wanted)).collect::<Vec<&'a str>>())
        };
        PARTS.into_iter().chain([OTHER]).map(of).filter(|(_, paths)| !paths.is_empty()).collect()
    }

    /// Creators of the release.
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
        folder == "report/" || self.files.iter().any(|file| file.path().starts_with(folder))
    }
}

/// Name of a table file, such as `a` for `tables/samples/part-a.parquet`.
fn part_name(path: &str) -> Option<&str> {
    path.rsplit('/').next()?.strip_prefix("part-")?.strip_suffix(".parquet")
}

/// Whether a file of the release is that map of a terrain; ids cannot have this suffix.
fn is_map(path: &str, name: &str) -> bool {
    let id = path.strip_prefix("terrain/").and_then(|file| file.strip_suffix(".tif"));
    id.is_some_and(|id| id.ends_with(&format!(".{name}")))
}

/// The files of a map.
pub fn map_files(map: MapKind) -> String {
    format!("terrain/*.{}.tif", map.name)
}

/// Description of a map, with unit.
pub fn map_words(map: MapKind) -> String {
    format!("{}{}", map.description, if map.unit == "m" { ", m" } else { "" })
}

/// Address of the dataset, if any.
pub fn page(head: &StudyHead) -> Option<String> {
    head.doi.as_ref().map(|doi| format!("https://doi.org/{doi}")).or_else(|| head.url.clone())
}

/// Citation of the dataset, on one line.
pub fn citation_line(head: &StudyHead) -> String {
    let version = head.version.as_ref().map_or_else(String::new, |v| format!(", version {v}"));
    let page = page(head).map_or_else(String::new, |page| format!(", {page}"));
    let year = head.date.get(..4).unwrap_or_default();
    folded(&format!("{} ({year}): {}{version}{page}", authors(head), head.title))
}

/// Names of the creators, joined.
pub fn authors(head: &StudyHead) -> String {
    let names: Vec<&str> = head.creators.iter().map(Creator::name).collect();
    if names.is_empty() { UNNAMED.to_owned() } else { names.join("; ") }
}

/// One line on measured data: attribution, licence, citation.
pub fn source_line(source: &Source) -> String {
    let Source { id, license, attribution, citation } = source;
    let attribution = attribution.as_ref().map_or_else(String::new, |who| format!(" {who}."));
    let license = license.as_ref().map_or_else(|| " No licence stated.".to_owned(), |l| format!(" Licence: {l}."));
    let citation = citation.as_ref().map_or_else(String::new, |c| format!(" Cite as: {c}"));
    folded(&format!("`{id}`:{attribution}{license}{citation}"))
}

/// Adds licence, attribution and citation of measured data to its schema.org description.
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

/// A YAML string in double quotes: a JSON string, with characters that YAML disallows or treats as line ends escaped by number.
pub fn quoted(text: &str) -> String {
    let escaped =
        |c: char| matches!(c, '\u{7f}'..='\u{9f}' | '\u{2028}' | '\u{2029}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}');
    let json = Value::String(text.to_owned()).to_string();
    let one = |c: char| if escaped(c) { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() };
    json.chars().map(one).collect()
}

/// Joins a text from a study onto one line, for formats in which lines matter.
pub fn folded(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_texts_for_formats_of_lines() {
        assert_eq!(folded(" a\n b\t c "), "a b c");
        assert_eq!(quoted("a \"b\"\n\u{2028}\u{7f}é"), "\"a \\\"b\\\"\\n\\u2028\\u007fé\"");
    }

    #[test]
    fn val_names_of_files() {
        assert_eq!(part_name("tables/samples/part-a-0001.parquet"), Some("a-0001"));
        assert_eq!((part_name("tables/samples/a.parquet"), part_name("tables/samples/part-a.csv")), (None, None));
        for (path, found) in [
            ("terrain/t.albedo.tif", true),
            ("terrain/t.tif", false),
            ("terrain/albedo.tif", false),
            ("image/t.albedo.tif", false),
            ("terrain/t.albedo.png", false),
        ] {
            assert_eq!(is_map(path, "albedo"), found, "{path}");
        }
    }

    /// The DOI goes before the address, both may be missing, and so may the creators.
    #[test]
    fn val_a_dataset_is_cited_in_one_line() {
        let names = ["Doe, Jane", "Snow Lab"].map(|name| Creator::Name(name.to_owned()));
        let bare =
            StudyHead { title: "Snow\n fields".to_owned(), date: "2026-11-21".to_owned(), ..StudyHead::default() };
        assert_eq!(citation_line(&bare), "unnamed (2026): Snow fields");
        let url = Some("https://example.org/snow".to_owned());
        let head = StudyHead { creators: names.to_vec(), version: Some("1.2".to_owned()), url, ..bare };
        let line = "Doe, Jane; Snow Lab (2026): Snow fields, version 1.2, ";
        assert_eq!(citation_line(&head), format!("{line}https://example.org/snow"));
        let head = StudyHead { doi: Some("10.5281/zenodo.1".to_owned()), ..head };
        assert_eq!(citation_line(&head), format!("{line}https://doi.org/10.5281/zenodo.1"));
    }

    #[test]
    fn val_measured_data_in_one_line() {
        let bare = Source { id: "site".to_owned(), ..Source::default() };
        assert_eq!(source_line(&bare), "`site`: No licence stated.");
        let words = |text: &str| Some(text.to_owned());
        let (license, attribution, citation) = (words("CC0-1.0"), words("The\nagency"), words("Agency (2000)"));
        let full = Source { license, attribution, citation, ..bare };
        assert_eq!(source_line(&full), "`site`: The agency. Licence: CC0-1.0. Cite as: Agency (2000)");
        let mut work = Value::Null;
        add_terms(&mut work, &full);
        let license = "https://spdx.org/licenses/CC0-1.0";
        let expected =
            serde_json::json!({ "license": license, "creditText": "The\nagency", "citation": "Agency (2000)" });
        assert_eq!(work, expected);
    }
}
