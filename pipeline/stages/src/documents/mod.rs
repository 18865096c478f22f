//! The documents of a release for people and catalogues: what it is, how to cite it, under which licence.

mod croissant;
pub mod license;
mod ro_crate;
pub mod sources;
pub mod terms;

pub use croissant::croissant;
pub use ro_crate::ro_crate;

use crate::runner::execute::Failure;
use sastrugi_schemas::manifest::{Artifact, Source};
use sastrugi_schemas::study::StudyHead;
use sastrugi_schemas::tables;
use sastrugi_terrain::{MAPS, MapKind};
use serde_json::Value;
use std::fmt::Write as _;

/// Whether a file of the release is that map of a terrain. No id ends so.
fn is_map(path: &str, name: &str) -> bool {
    let id = path.strip_prefix("terrain/").and_then(|file| file.strip_suffix(".tif"));
    id.is_some_and(|id| id.ends_with(&format!(".{name}")))
}

/// The files of a map.
fn map_files(map: MapKind) -> String {
    format!("terrain/*.{}.tif", map.name)
}

/// What a map shows, with its unit where it has one.
fn map_words(map: MapKind) -> String {
    format!("{}{}", map.description, if map.unit == "m" { ", m" } else { "" })
}

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

/// Folders of a release.
const FOLDERS: [(&str, &str); 10] = [
    ("dem/", "measured inputs, and the same in metres (`.metric.tif`)"),
    ("mask/", "masks of the fits"),
    ("terrain/", "generated heightfields, GeoTIFF, float32 metres, no data -9999; maps of the same cells beside them"),
    ("export/", "terrains to import into simulators: `export/<terrain>/<simulator>/README.md` says how"),
    ("texture/", "synthesised textures, GeoTIFF, float32 metres, no data -9999"),
    ("classes/", "roughness classes: 0 low, 1 semi, 2 high, 255 none; `.raw.tif` before closing"),
    ("fit/", "covariance fits (JSON), with background, residual and the cells used"),
    ("mcap/", "one recording per mission"),
    ("tables/", "Parquet, units and descriptions in the column metadata"),
    ("report/", "report: `index.html`, one offline page"),
];
/// A creator that is no person, in the words of schema.org.
const ORGANIZATION: &str = "Organization";
/// Names under which dataset hubs know licences, where they are not the SPDX identifier in lower case.
const HUB_NAMES: [(&str, &str); 3] = [("PDDL-1.0", "pddl"), ("ODC-By-1.0", "odc-by"), ("ODbL-1.0", "odbl")];
/// Identifiers that dataset hubs know in lower case.
const HUB_IDENTIFIERS: [&str; 20] = [
    "Apache-2.0",
    "MIT",
    "CC0-1.0",
    "CC-BY-2.0",
    "CC-BY-2.5",
    "CC-BY-3.0",
    "CC-BY-4.0",
    "CC-BY-SA-3.0",
    "CC-BY-SA-4.0",
    "CC-BY-NC-2.0",
    "CC-BY-NC-3.0",
    "CC-BY-NC-4.0",
    "CC-BY-ND-4.0",
    "CC-BY-NC-ND-3.0",
    "CC-BY-NC-ND-4.0",
    "CC-BY-NC-SA-2.0",
    "CC-BY-NC-SA-3.0",
    "CC-BY-NC-SA-4.0",
    "GPL-3.0",
    "LGPL-3.0",
];

impl<'a> Described<'a> {
    /// Maps that some terrain has.
    fn maps(&self) -> impl Iterator<Item = MapKind> {
        MAPS.into_iter().filter(|map| self.artifacts.iter().any(|artifact| is_map(&artifact.path, map.name)))
    }

    /// Files of a table, in order.
    fn parts(&self, table: &str) -> impl Iterator<Item = &'a Artifact> {
        let folder = format!("tables/{table}/");
        self.artifacts.iter().filter(move |artifact| artifact.path.starts_with(&folder))
    }

    /// Who made the release: names, and their types in the words of schema.org.
    fn creators(&self) -> impl Iterator<Item = (&'a str, &'static str)> {
        let head = self.head;
        let names = head.creators.iter().map(String::as_str).chain(head.creators.is_empty().then_some("unnamed"));
        names.map(|name| (name, if head.organizations.iter().any(|o| o == name) { ORGANIZATION } else { "Person" }))
    }

    /// Tables that have a file.
    fn tables(&self) -> impl Iterator<Item = &'static tables::Table> {
        tables::ALL.into_iter().filter(|table| self.parts(table.name).next().is_some())
    }

    fn has(&self, folder: &str) -> bool {
        folder == "report/" || self.artifacts.iter().any(|artifact| artifact.path.starts_with(folder))
    }
}

/// `README.md`: a dataset card, whose head lets hubs show the tables.
pub fn readme(described: &Described<'_>) -> String {
    let head = described.head;
    let mut text = format!("{}# {}\n\n", card(described), folded(&head.title));
    if !head.description.is_empty() {
        let _ = writeln!(text, "{}\n", head.description);
    }
    let version = head.version.as_ref().map_or_else(String::new, |v| format!(" version {v},"));
    let page = page(head).map_or_else(String::new, |page| format!(" {page}"));
    let _ = writeln!(
        text,
        "Study `{}`,{version} seed {}, {}. Licence: {}. Made with sastrugi {}; `sastrugi verify .` checks every file, and \
         `sastrugi verify . --recompute all` makes it again and compares the bytes.{page}\n",
        head.name,
        head.seed,
        head.date,
        head.license,
        env!("CARGO_PKG_VERSION")
    );
    text.push_str("| where | what |\n|---|---|\n| `study.toml` | the study: everything here follows from it |\n");
    for (folder, what) in FOLDERS.iter().filter(|(folder, _)| described.has(folder)) {
        let _ = writeln!(text, "| `{folder}` | {what} |");
    }
    for map in described.maps() {
        let _ = writeln!(text, "| `{}` | map beside heights: {} |", map_files(map), map_words(map));
    }
    text.push_str(
        "| `croissant.json` | the tables in Croissant, for data loaders |\n\
         | `ro-crate-metadata.json` | which stage made what from what |\n\
         | `manifest.json`, `SHA256SUMS` | what each file is made from, and its checksum |\n\n\
         | table | a row is |\n|---|---|\n",
    );
    for table in described.tables() {
        let _ = writeln!(text, "| `{}` | {} |", table.name, table.description);
    }
    if !described.sources.is_empty() {
        text.push_str(&sources_section(described.sources));
    }
    if !described.failures.is_empty() {
        let _ = writeln!(
            text,
            "\n{} items failed; `manifest.json` lists them with their parameters:\n",
            described.failures.len()
        );
        for failure in described.failures {
            let _ = writeln!(text, "- `{}`: {}", failure.item, failure.message);
        }
    }
    text
}

/// The head of a dataset card: YAML between two lines of hyphens.
fn card(described: &Described<'_>) -> String {
    let head = described.head;
    let mut text = format!("---\npretty_name: {}\n{}", quoted(&head.title), hub_license(&head.license));
    text.push_str("tags:\n  - terrain\n  - elevation\n  - robotics\n  - synthetic\n  - sastrugi\n");
    let mut tables = described.tables().peekable();
    if tables.peek().is_some() {
        text.push_str("configs:\n");
    }
    for table in tables {
        let _ = writeln!(text, "  - config_name: {0}\n    data_files: \"tables/{0}/*.parquet\"", table.name);
    }
    text + "---\n\n"
}

/// Hubs know a list of licences by names of their own; others are named beside `other`.
fn hub_license(license: &str) -> String {
    let of_hub = |id: &str| {
        let known = HUB_NAMES.iter().find(|(spdx, _)| *spdx == id).map(|(_, name)| (*name).to_owned());
        known.or_else(|| HUB_IDENTIFIERS.contains(&id).then(|| id.to_lowercase()))
    };
    match license::identifier(license).and_then(of_hub) {
        Some(name) => format!("license: {name}\n"),
        None => format!("license: other\nlicense_name: {}\nlicense_link: LICENSE\n", quoted(license)),
    }
}

/// Adds what measured data asks for to its description in the words of schema.org.
fn add_terms(work: &mut Value, source: &Source) {
    let terms = [
        ("license", source.license.as_deref().map(license::address)),
        ("creditText", source.attribution.clone()),
        ("citation", source.citation.clone()),
    ];
    for (key, value) in terms.into_iter().filter_map(|(key, value)| Some((key, value?))) {
        work[key] = Value::String(value);
    }
}

/// Where the dataset is found, if anywhere.
fn page(head: &StudyHead) -> Option<String> {
    head.doi.as_ref().map(|doi| format!("https://doi.org/{doi}")).or_else(|| head.url.clone())
}

/// One line to cite the dataset by.
fn citation_line(head: &StudyHead) -> String {
    let version = head.version.as_ref().map_or_else(String::new, |v| format!(", version {v}"));
    let page = page(head).map_or_else(String::new, |page| format!(", {page}"));
    let year = head.date.get(..4).unwrap_or_default();
    folded(&format!("{} ({year}): {}{version}{page}", authors(head), head.title))
}

fn authors(head: &StudyHead) -> String {
    if head.creators.is_empty() { "unnamed".to_owned() } else { head.creators.join("; ") }
}

/// Measured data with what their makers ask for.
fn sources_section(sources: &[Source]) -> String {
    let mut text = String::from(
        "\n## Sources\n\nMeasured data keep their own terms; `manifest.json` says which rasters, fits and recordings come from which (`sources`).\n\n",
    );
    sources.iter().for_each(|source| text.push_str(&format!("- {}\n", sentence(source))));
    text
}

/// One line on measured data: whose it is, under which licence, how to cite it.
fn sentence(source: &Source) -> String {
    let Source { id, license, attribution, citation } = source;
    let attribution = attribution.as_ref().map_or_else(String::new, |who| format!(" {who}."));
    let license = license.as_ref().map_or_else(|| " No licence stated.".to_owned(), |l| format!(" Licence: {l}."));
    let citation = citation.as_ref().map_or_else(String::new, |c| format!(" Cite as: {c}"));
    folded(&format!("`{id}`:{attribution}{license}{citation}"))
}

/// `CITATION.cff`, in the Citation File Format 1.2.0.
pub fn citation(described: &Described<'_>) -> String {
    let (head, sources) = (described.head, described.sources);
    let mut text = format!(
        "cff-version: 1.2.0\nmessage: \"If you use this dataset, please cite it as below.\"\ntype: dataset\ntitle: {}\ndate-released: {}\n",
        quoted(&head.title),
        head.date
    );
    let mut line = |key: &str, value: Option<&str>| {
        if let Some(value) = value.filter(|v| !v.is_empty()) {
            let _ = writeln!(text, "{key}: {}", quoted(value));
        }
    };
    line("abstract", Some(&head.description));
    line("version", head.version.as_deref());
    line("doi", head.doi.as_deref());
    line("url", head.url.as_deref());
    text.push_str(&license::cited(&head.license));
    text.push_str("authors:\n");
    text.extend(described.creators().map(author));
    if !sources.is_empty() {
        text.push_str("references:\n");
        sources.iter().for_each(|source| text.push_str(&reference(source)));
    }
    text
}

/// Measured data as a work that the dataset refers to.
fn reference(source: &Source) -> String {
    let author = source.attribution.as_deref().unwrap_or("unnamed");
    format!(
        "  - type: data\n    title: {}\n    authors:\n      - name: {}\n    notes: {}\n",
        quoted(&format!("Measured elevation data {}", source.id)),
        quoted(author),
        quoted(&sentence(source))
    )
}

/// An author of `CITATION.cff`: `name` is for what is no person. Which part of a person's name is which only `Family, Given`
/// tells; a name in one piece is what they are called.
fn author((name, kind): (&str, &str)) -> String {
    let parts = name.split_once(',').map(|(family, given)| (family.trim(), given.trim()));
    match parts {
        _ if kind == ORGANIZATION => format!("  - name: {}\n", quoted(name)),
        Some((family, given)) if !family.is_empty() && !given.is_empty() => {
            format!("  - family-names: {}\n    given-names: {}\n", quoted(family), quoted(given))
        }
        _ => format!("  - alias: {}\n", quoted(name)),
    }
}

/// `LICENSE`.
pub fn license(described: &Described<'_>) -> String {
    let (head, sources) = (described.head, described.sources);
    let version = head.version.as_ref().map_or_else(String::new, |v| format!(", version {v}"));
    let what = folded(&format!("{}{version} ({}) by {}", head.title, head.date, authors(head)));
    let license = license::identifier(&head.license).unwrap_or_else(|| head.license.trim());
    let mut text = match license::is_listed(&head.license) {
        true => format!(
            "SPDX-License-Identifier: {0}\n\n{what} is licensed under {0}. Its text is found by that identifier in the SPDX licence list.\n",
            license,
        ),
        false => format!(
            "{what} is licensed under:\n\n{}\n\nThe SPDX licence list does not have it; its terms are to be had from the creators.\n",
            license
        ),
    };
    if let Some(page) = page(head) {
        let _ = writeln!(text, "{page}");
    }
    if !sources.is_empty() {
        text.push_str(
            "\nMeasured inputs in dem/ keep their own licences, and what comes from them names its source:\n\n",
        );
        sources.iter().for_each(|source| text.push_str(&format!("- {}\n", sentence(source))));
    }
    text
}

/// A YAML string in double quotes: JSON's, with what YAML does not take as it is, or takes for the end of a line, by its number.
fn quoted(text: &str) -> String {
    let escaped =
        |c: char| matches!(c, '\u{7f}'..='\u{9f}' | '\u{2028}' | '\u{2029}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}');
    let json = serde_json::Value::String(text.to_owned()).to_string();
    let one = |c: char| if escaped(c) { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() };
    json.chars().map(one).collect()
}

/// On one line: words of a study in a text whose lines mean something.
fn folded(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
