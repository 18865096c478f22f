//! The documents of a release for people and catalogues: what it is, how to cite it, under which licence.

use super::assemble::Contents;
use sastrugi_schemas::manifest::Source;
use sastrugi_schemas::study::StudyHead;
use sastrugi_schemas::tables;
use std::fmt::Write as _;

/// `README.md`.
pub fn readme(contents: &Contents<'_>, sources: &[Source]) -> String {
    let head = &contents.study.head;
    let mut text = format!("# {}\n\n", head.title);
    if !head.description.is_empty() {
        let _ = writeln!(text, "{}\n", head.description);
    }
    let _ = writeln!(
        text,
        "Study `{}`, seed {}, {}. Licence: {}. Made with sastrugi {}; `sastrugi verify .` checks every file, and \
         `sastrugi verify . --recompute all` makes it again and compares the bytes.\n",
        head.name,
        head.seed,
        head.date,
        head.license,
        env!("CARGO_PKG_VERSION")
    );
    text.push_str(
        "| where | what |\n|---|---|\n\
         | `report/index.html` | report, one offline page |\n\
         | `study.toml` | the study: everything here follows from it |\n\
         | `dem/` | measured inputs, and the same in metres (`.metric.tif`) |\n\
         | `mask/` | masks of the fits |\n\
         | `terrain/`, `texture/` | heightfields, GeoTIFF, float32 metres, no data -9999 |\n\
         | `classes/` | roughness classes: 0 low, 1 semi, 2 high, 255 none; `.raw.tif` before closing |\n\
         | `fit/` | covariance fits (JSON), with background, residual and the cells used |\n\
         | `mcap/` | one recording per mission |\n\
         | `tables/` | Parquet, units and descriptions in the column metadata |\n\
         | `manifest.json`, `SHA256SUMS` | what each file is made from, and its checksum |\n\n",
    );
    text.push_str("| table | a row is |\n|---|---|\n");
    for table in tables::ALL {
        let _ = writeln!(text, "| `{}` | {} |", table.name, table.description);
    }
    if !sources.is_empty() {
        text.push_str(&sources_section(sources));
    }
    if !contents.failures.is_empty() {
        let _ = writeln!(
            text,
            "\n{} items failed; `manifest.json` lists them with their parameters:\n",
            contents.failures.len()
        );
        for failure in contents.failures {
            let _ = writeln!(text, "- `{}`: {}", failure.item, failure.message);
        }
    }
    text
}

/// Measured data with what their makers ask for.
fn sources_section(sources: &[Source]) -> String {
    let mut text = String::from(
        "\n## Sources\n\nMeasured data keep their own terms; `manifest.json` says which files come from which (`sources`).\n\n",
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
    format!("`{id}`:{attribution}{license}{citation}")
}

/// `CITATION.cff`, in the Citation File Format 1.2.0.
pub fn citation(head: &StudyHead, sources: &[Source]) -> String {
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
    line("license", is_spdx_identifier(&head.license).then_some(head.license.as_str()));
    text.push_str("authors:\n");
    let unnamed = ["unnamed".to_owned()];
    let authors = if head.creators.is_empty() { &unnamed[..] } else { &head.creators };
    for author in authors {
        let _ = writeln!(text, "  - name: {}", quoted(author));
    }
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

/// True for one identifier; the Citation File Format takes no expressions such as `MIT OR Apache-2.0`.
fn is_spdx_identifier(license: &str) -> bool {
    license.bytes().all(|b| b.is_ascii_alphanumeric() || b".-+".contains(&b))
}

/// `LICENSE`.
pub fn license(head: &StudyHead, sources: &[Source]) -> String {
    let version = head.version.as_ref().map_or_else(String::new, |v| format!(", version {v}"));
    let page = head.doi.as_ref().map(|doi| format!("https://doi.org/{doi}")).or_else(|| head.url.clone());
    let mut text = format!(
        "SPDX-License-Identifier: {0}\n\n{1}{version} ({2}) by {3} is licensed under {0}. Its text is found by that identifier in the SPDX licence list.\n",
        head.license,
        head.title,
        head.date,
        if head.creators.is_empty() { "unnamed".to_owned() } else { head.creators.join(", ") }
    );
    if let Some(page) = page {
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

/// A YAML string in double quotes; JSON's quoting is a part of YAML's.
fn quoted(text: &str) -> String {
    serde_json::Value::String(text.to_owned()).to_string()
}
