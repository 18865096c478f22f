//! `README.md`: a dataset card, with a head from which dataset hubs display the tables.

use super::described::{Described, FOLDERS, folded, map_files, map_words, page, quoted, source_line};
use super::spdx_list;
use sastrugi_schemas::manifest::Source;
use sastrugi_schemas::{Table, counted};
use std::fmt::Write as _;

/// Licence names of dataset hubs that are not the SPDX identifier in lower case.
const HUB_NAMES: [(&str, &str); 3] = [("PDDL-1.0", "pddl"), ("ODC-By-1.0", "odc-by"), ("ODbL-1.0", "odbl")];
/// SPDX identifiers that dataset hubs use in lower case.
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

/// Default tables of data loaders: the first of these that a release has.
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
        "Study `{}`,{version} seed {}, {}. Licence: {}. Made with sastrugi {}. `sastrugi verify .` checks every file; \
         `sastrugi verify . --recompute all` recomputes everything and compares the bytes.{page}\n",
        head.name,
        head.seed,
        head.date,
        head.license,
        env!("CARGO_PKG_VERSION")
    );
    if !head.funding.is_empty() {
        let _ = writeln!(text, "Funding: {}\n", folded(&head.funding.join("; ")));
    }
    text.push_str("| path | content |\n|---|---|\n| `study.toml` | the study, from which everything here follows |\n");
    for (folder, what) in FOLDERS.iter().filter(|(folder, _)| described.has(folder)) {
        let _ = writeln!(text, "| `{folder}` | {what} |");
    }
    for map in described.maps() {
        let _ = writeln!(text, "| `{}` | map of the heightfields: {} |", map_files(map), map_words(map));
    }
    text.push_str(
        "| `croissant.json` | description of the tables in Croissant, for data loaders |\n\
         | `ro-crate-metadata.json` | provenance: inputs and outputs of each stage |\n\
         | `.zenodo.json` | title, creators, licence, keywords and grants for a deposit on Zenodo |\n\
         | `manifest.json`, `SHA256SUMS` | inputs and checksum of each file |\n\n\
         | table | content |\n|---|---|\n",
    );
    for table in described.tables() {
        let _ = writeln!(text, "| `{}` | {} |", table.name, table.description);
    }
    if !described.sources.is_empty() {
        text.push_str(&sources_section(described.sources));
    }
    if !described.failures.is_empty() {
        let failed = counted(described.failures.len(), "item");
        let _ = writeln!(text, "\n{failed} failed (parameters in `manifest.json`):\n");
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

/// The files of a table for data loaders: by split if each file belongs to one, otherwise all together, which loaders call `train`.
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

/// Licence in the names of dataset hubs; licences unknown to them are given as `other` with their name.
pub fn hub_license(license: &str) -> String {
    let of_hub = |id: &str| {
        let known = HUB_NAMES.iter().find(|(spdx, _)| *spdx == id).map(|(_, name)| (*name).to_owned());
        known.or_else(|| HUB_IDENTIFIERS.contains(&id).then(|| id.to_lowercase()))
    };
    match spdx_list::identifier(license).and_then(of_hub) {
        Some(name) => format!("license: {name}\n"),
        None => format!("license: other\nlicense_name: {}\nlicense_link: LICENSE\n", quoted(license)),
    }
}

/// Measured data with attribution, licence and citation.
fn sources_section(sources: &[Source]) -> String {
    let mut text = String::from(
        "\n## Sources\n\nMeasured data keep their own terms; `manifest.json` states from which of them each raster, fit and recording is derived (`sources`).\n\n",
    );
    sources.iter().for_each(|source| text.push_str(&format!("- {}\n", source_line(source))));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_licences_have_the_names_of_hubs() {
        for (license, name) in [
            ("CC-BY-4.0", "license: cc-by-4.0\n"),
            ("mit", "license: mit\n"),
            ("ODbL-1.0", "license: odbl\n"),
            // Listed by SPDX, but not by hubs; and by neither.
            ("CC-BY-SA-2.0", "license: other\nlicense_name: \"CC-BY-SA-2.0\"\nlicense_link: LICENSE\n"),
            ("our \"own\"", "license: other\nlicense_name: \"our \\\"own\\\"\"\nlicense_link: LICENSE\n"),
        ] {
            assert_eq!(hub_license(license), name);
        }
    }
}
