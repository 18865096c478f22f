//! `ro-crate-metadata.json`: provenance as an RO-Crate 1.1 (<https://w3id.org/ro/crate/1.1>) of the profile Process Run
//! Crate 0.5 (<https://w3id.org/ro/wfrun/process/0.5>): one `CreateAction` per stage, with the inputs and outputs of its items.
//! Measured data and masks are inputs of the study, so no action creates them. Folders represent their files; `manifest.json`
//! has the parents, stream and hash of each file.

use super::described::{Described, FOLDERS, Maker, ORGANIZATION, add_terms, citation_line, page};
use super::spdx_list;
use crate::job::ItemRef;
use crate::jobs::original;
use sastrugi_schemas::manifest::{PROGRAM as PROGRAM_NAME, Source};
use sastrugi_schemas::tables;
use sastrugi_store::release::{Listed, STUDY};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

const CRATE: &str = "https://w3id.org/ro/crate/1.1";
const PROFILE: &str = "https://w3id.org/ro/wfrun/process/0.5";
const PROGRAM: &str = "#sastrugi";
/// Files of the release itself: path, media type, description.
const OWN_FILES: [(&str, &str, &str); 8] = [
    (STUDY, "application/toml", "The study, from which everything else follows"),
    ("README.md", "text/markdown", "Contents of the release"),
    ("CITATION.cff", "application/yaml", "How to cite it"),
    (".zenodo.json", "application/json", "Metadata for a deposit on Zenodo"),
    ("LICENSE", "text/plain", "Its licence and those of the measured data in it"),
    ("croissant.json", "application/ld+json", "Description of its tables in Croissant"),
    ("manifest.json", "application/json", "Every file with its parents, random stream and hashes"),
    ("SHA256SUMS", "text/plain", "Checksum of every file"),
];

/// The text of `ro-crate-metadata.json`.
pub fn text(described: &Described<'_>) -> String {
    let stages = Stages::of(described);
    let mut parts: Vec<Value> = OWN_FILES.iter().map(own_file).collect();
    parts.extend(stages.entities(described));
    let mut graph = vec![descriptor(), root(described, &parts, &stages)];
    graph.extend(parts);
    graph.push(json!({ "@id": PROFILE, "@type": "CreativeWork", "name": "Process Run Crate", "version": "0.5" }));
    graph.push(program());
    graph.extend(license_entity(&described.head.license));
    graph.extend(described.creators().enumerate().map(creator));
    graph.extend(affiliations(described).into_iter().map(affiliation));
    graph.extend(described.head.funding.iter().enumerate().map(grant));
    graph.extend(described.sources.iter().map(work));
    graph.extend(stages.actions());
    // Terms of schema.org that are newer than the crate's context.
    let words = ["sha256", "creditText", "funding", "Grant"].map(|word| (word, format!("https://schema.org/{word}")));
    let later: BTreeMap<&str, String> = words.into();
    let metadata = json!({ "@context": [format!("{CRATE}/context"), later], "@graph": graph });
    format!("{metadata:#}\n")
}

fn descriptor() -> Value {
    json!({
        "@id": "ro-crate-metadata.json",
        "@type": "CreativeWork",
        "about": { "@id": "./" },
        "conformsTo": { "@id": CRATE },
    })
}

fn root(described: &Described<'_>, parts: &[Value], stages: &Stages) -> Value {
    let head = described.head;
    let mut root = json!({
        "@id": "./",
        "@type": "Dataset",
        "name": head.title,
        "description": if head.description.is_empty() { &head.title } else { &head.description },
        "datePublished": head.date,
        "license": { "@id": license_id(&head.license) },
        "author": described.creators().enumerate().map(|one| json!({ "@id": creator_id(&one) })).collect::<Vec<_>>(),
        "creditText": citation_line(head),
        "conformsTo": { "@id": PROFILE },
        "hasPart": parts.iter().map(|part| json!({ "@id": part["@id"] })).collect::<Vec<_>>(),
        "mentions": stages.made.keys().map(|stage| json!({ "@id": action_id(stage) })).collect::<Vec<_>>(),
        "isBasedOn": described.sources.iter().map(|s| json!({ "@id": source_id(s) })).collect::<Vec<_>>(),
    });
    let optional = [
        ("version", head.version.clone()),
        ("identifier", head.doi.as_ref().map(|doi| format!("https://doi.org/{doi}"))),
        ("url", page(head)),
    ];
    for (key, value) in optional {
        if let Some(value) = value {
            root[key] = json!(value);
        }
    }
    if !head.keywords.is_empty() {
        root["keywords"] = json!(head.keywords.join(", "));
    }
    if !head.funding.is_empty() {
        root["funding"] = (0..head.funding.len()).map(|n| json!({ "@id": grant_id(n) })).collect();
    }
    root
}

fn own_file((path, media, description): &(&str, &str, &str)) -> Value {
    json!({ "@id": path, "@type": "File", "name": path, "description": description, "encodingFormat": media })
}

/// A licence in the SPDX list by its page there, any other by the file LICENSE.
fn license_id(license: &str) -> String {
    spdx_list::identifier(license).map_or_else(|| "LICENSE".to_owned(), |_| spdx_list::address(license))
}

/// The entity of a licence that is not a file of the release.
fn license_entity(license: &str) -> Option<Value> {
    let name = spdx_list::identifier(license)?;
    let description = format!("The licence {name} of the SPDX list");
    Some(json!({ "@id": license_id(license), "@type": "CreativeWork", "name": name, "description": description }))
}

fn program() -> Value {
    json!({
        "@id": PROGRAM,
        "@type": "SoftwareApplication",
        "name": PROGRAM_NAME,
        "softwareVersion": env!("CARGO_PKG_VERSION"),
    })
}

/// The page of the ORCID iD, else the position: names would have to be escaped in an identifier, and two could become equal.
fn creator_id((position, maker): &(usize, Maker<'_>)) -> String {
    maker.page().unwrap_or_else(|| format!("#creator-{}", position + 1))
}

fn creator(one: (usize, Maker<'_>)) -> Value {
    let maker = one.1;
    let mut creator = json!({ "@id": creator_id(&one), "@type": maker.kind(), "name": maker.name });
    if let Some(affiliation) = maker.affiliation {
        creator["affiliation"] = json!({ "@id": affiliation_id(affiliation) });
    }
    creator
}

/// Affiliations of the creators, without repetition.
fn affiliations<'a>(described: &Described<'a>) -> BTreeSet<&'a str> {
    described.creators().filter_map(|maker| maker.affiliation).collect()
}

/// Letters and digits are kept, other characters are replaced by their number, so that different names stay different.
fn affiliation_id(name: &str) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() { c.to_string() } else { format!("-{:x}-", u32::from(c)) };
    format!("#affiliation-{}", name.chars().map(letter).collect::<String>())
}

fn affiliation(name: &str) -> Value {
    json!({ "@id": affiliation_id(name), "@type": ORGANIZATION, "name": name })
}

fn grant_id(position: usize) -> String {
    format!("#grant-{}", position + 1)
}

fn grant((position, text): (usize, &String)) -> Value {
    json!({ "@id": grant_id(position), "@type": "Grant", "name": text })
}

fn source_id(source: &Source) -> String {
    format!("#source-{}", source.id)
}

fn work(source: &Source) -> Value {
    let mut work = json!({ "@id": source_id(source), "@type": "CreativeWork", "name": source.id });
    add_terms(&mut work, source);
    work
}

/// Outputs and inputs of each stage, as entities of the crate.
#[derive(Default)]
struct Stages {
    /// Input files: measured data and masks.
    given: BTreeSet<String>,
    made: BTreeMap<String, BTreeSet<String>>,
    used: BTreeMap<String, BTreeSet<String>>,
}

impl Stages {
    fn of(described: &Described<'_>) -> Self {
        let mut stages = Self::default();
        let released = || described.files.iter().filter(|file| !file.origin().stage.is_empty());
        let mut of_item: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for file in released().filter(|file| !file.origin().item.is_empty()) {
            let item = ItemRef::new(&file.origin().stage, &file.origin().item).to_string();
            of_item.entry(item).or_default().insert(entity(file));
        }
        let (given, derived): (Vec<_>, Vec<_>) =
            released().partition(|file| original::only_copies(&file.origin().stage));
        stages.given = given.into_iter().map(entity).collect();
        for file in derived {
            let stage = &file.origin().stage;
            stages.made.entry(stage.clone()).or_default().insert(entity(file));
            let used = stages.used.entry(stage.clone()).or_insert_with(|| BTreeSet::from([STUDY.to_owned()]));
            used.extend(file.origin().parents.iter().filter_map(|parent| of_item.get(parent)).flatten().cloned());
        }
        stages.share_tables();
        stages.add_report(described);
        stages
    }

    /// Tables filled by several stages are derived from the inputs of all of them.
    fn share_tables(&mut self) {
        let shared: Vec<String> = self.made.keys().filter(|stage| stage.contains('+')).cloned().collect();
        for stage in shared {
            let used = stage.split('+').filter_map(|part| self.used.get(part)).flatten().cloned().collect();
            self.used.insert(stage, used);
        }
    }

    /// The report is derived from the study, the tables and the rasters.
    fn add_report(&mut self, described: &Described<'_>) {
        let shown = |file: &&Listed| file.path().starts_with("tables/") || file.path().ends_with(".tif");
        let derived = described.files.iter().filter(|file| !original::only_copies(&file.origin().stage));
        let used = derived.filter(shown).map(entity).chain([STUDY.to_owned()]).collect();
        self.used.insert("report".to_owned(), used);
        self.made.insert("report".to_owned(), BTreeSet::from(["report/".to_owned()]));
    }

    /// Folders and measured files.
    fn entities(&self, described: &Described<'_>) -> Vec<Value> {
        let all: BTreeSet<&String> = self.made.values().flatten().chain(&self.given).collect();
        all.into_iter().map(|id| described_entity(id, described)).collect()
    }

    fn actions(&self) -> impl Iterator<Item = Value> {
        let ids = |set: Option<&BTreeSet<String>>| -> Vec<Value> {
            set.into_iter().flatten().map(|id| json!({ "@id": id })).collect()
        };
        self.made.iter().map(move |(stage, made)| {
            json!({
                "@id": action_id(stage),
                "@type": "CreateAction",
                "name": format!("stage {stage}"),
                "instrument": { "@id": PROGRAM },
                "object": ids(self.used.get(stage)),
                "result": ids(Some(made)),
            })
        })
    }
}

fn action_id(stage: &str) -> String {
    format!("#stage-{}", stage.replace('+', "-"))
}

/// The entity of a file: itself if it is an input, else its folder.
fn entity(file: &Listed) -> String {
    let path = file.path();
    let words: Vec<&str> = path.split('/').collect();
    match words[..] {
        ["dem" | "mask" | "input", ..] => path.to_owned(),
        ["tables", table, ..] => format!("tables/{table}/"),
        [folder, _, ..] => format!("{folder}/"),
        _ => path.to_owned(),
    }
}

fn described_entity(id: &str, described: &Described<'_>) -> Value {
    // Files are sorted by path.
    if let Ok(place) = described.files.binary_search_by(|file| file.path().cmp(id)) {
        let found = &described.files[place];
        let mut file = json!({
            "@id": id,
            "@type": "File",
            "name": id,
            "contentSize": found.bytes().to_string(),
            "sha256": found.sha256(),
        });
        let sources = described.sources.iter().filter(|s| found.origin().sources.contains(&s.id));
        file["isBasedOn"] = sources.map(|s| json!({ "@id": source_id(s) })).collect();
        return file;
    }
    let name = id.trim_end_matches('/');
    let table = name.strip_prefix("tables/").and_then(tables::by_name).map(|table| table.description);
    let folder = || FOLDERS.iter().find(|(folder, _)| *folder == id).map(|(_, what)| *what);
    json!({ "@id": id, "@type": "Dataset", "name": name, "description": table.or_else(folder).unwrap_or_default() })
}
