//! `README.md`: a dataset card, whose head lets hubs show the tables.

use super::described::{Described, FOLDERS, folded, map_files, map_words, page, quoted, source_line};
use super::spdx_list;
use sastrugi_schemas::Table;
use sastrugi_schemas::manifest::Source;
use std::fmt::Write as _;

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

/// Tables that a data loader opens where no other is asked for: the first of them that a release has.
const FIRST_TABLES: [&str; 4] = ["missions", "rovers", "formations", "terrains"];

/// The text of `README.md`.
pub fn text(described: &Described<'_>) -> String {
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
    if !head.funding.is_empty() {
        let _ = writeln!(text, "Funding: {}\n", folded(&head.funding.join("; ")));
    }
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
         | `.zenodo.json` | title, creators, licence, keywords and grants for a deposit on Zenodo |\n\
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
    let tables: Vec<&Table> = described.tables().collect();
    if !tables.is_empty() {
        text.push_str("configs:\n");
    }
    let names = || tables.iter().map(|table| table.name);
    let default = FIRST_TABLES.into_iter().find(|first| names().any(|name| name == *first)).or_else(|| names().next());
    for table in &tables {
        let is_default = if default == Some(table.name) { "    default: true\n" } else { "" };
        let _ = write!(text, "  - config_name: {}\n{is_default}{}", table.name, data_files(table, described));
    }
    text + "---\n\n"
}

/// The files of a table for data loaders: by part where each is of one, else in all, which loaders call `train`.
fn data_files(table: &Table, described: &Described<'_>) -> String {
    let parts = described.by_part(table);
    if parts.is_empty() {
        return format!("    data_files: \"tables/{}/*.parquet\"\n", table.name);
    }
    let mut text = "    data_files:\n".to_owned();
    for (part, paths) in parts {
        let _ = writeln!(text, "      - split: {part}\n        path:");
        paths.iter().for_each(|path| text.push_str(&format!("          - {}\n", quoted(path))));
    }
    text
}

/// Hubs know a list of licences by names of their own; others are named beside `other`.
fn hub_license(license: &str) -> String {
    let of_hub = |id: &str| {
        let known = HUB_NAMES.iter().find(|(spdx, _)| *spdx == id).map(|(_, name)| (*name).to_owned());
        known.or_else(|| HUB_IDENTIFIERS.contains(&id).then(|| id.to_lowercase()))
    };
    match spdx_list::identifier(license).and_then(of_hub) {
        Some(name) => format!("license: {name}\n"),
        None => format!("license: other\nlicense_name: {}\nlicense_link: LICENSE\n", quoted(license)),
    }
}

/// Measured data with what their makers ask for.
fn sources_section(sources: &[Source]) -> String {
    let mut text = String::from(
        "\n## Sources\n\nMeasured data keep their own terms; `manifest.json` says which rasters, fits and recordings come from which (`sources`).\n\n",
    );
    sources.iter().for_each(|source| text.push_str(&format!("- {}\n", source_line(source))));
    text
}
