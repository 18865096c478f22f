//! `CITATION.cff`: how to cite the release, in the Citation File Format 1.2.0.

use super::described::{Described, Maker, quoted, source_line};
use super::spdx_list;
use sastrugi_schemas::manifest::Source;
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Identifiers allowed by the Citation File Format 1.2.0 (`definitions.license-enum` of its `schema.json`,
/// doi 10.5281/zenodo.5171937). It is the SPDX list at the time of that version; later identifiers make a file invalid.
const CITABLE: &str = include_str!("cff_1_2_0_licenses.txt");

/// The text of `CITATION.cff`.
pub fn text(described: &Described<'_>) -> String {
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
    text.push_str(&cited(&head.license));
    if !head.keywords.is_empty() {
        text.push_str("keywords:\n");
        head.keywords.iter().for_each(|word| text.push_str(&format!("  - {}\n", quoted(word))));
    }
    text.push_str("authors:\n");
    text.extend(described.creators().map(author));
    if !sources.is_empty() {
        text.push_str("references:\n");
        sources.iter().for_each(|source| text.push_str(&reference(source)));
    }
    text
}

/// The licence lines of `CITATION.cff`: identifiers if the format has them, otherwise an address or a comment.
fn cited(license: &str) -> String {
    let citable =
        |part: &str| spdx_list::identifier(part).filter(|id| CITABLE.split_whitespace().any(|known| known == *id));
    let mut choices: Option<Vec<&str>> = license.split(" OR ").map(citable).collect();
    let mut seen = BTreeSet::new();
    choices.iter_mut().for_each(|all| all.retain(|id| seen.insert(*id)));
    let address = spdx_list::address(license);
    match choices.as_deref() {
        Some([one]) => format!("license: {}\n", quoted(one)),
        Some(several) => {
            several.iter().fold("license:\n".to_owned(), |text, id| text + &format!("  - {}\n", quoted(id)))
        }
        None if is_address(&address) => format!("license-url: {}\n", quoted(&address)),
        None => format!("# This format has no identifier for the licence {}; see the file LICENSE.\n", quoted(license)),
    }
}

fn is_address(text: &str) -> bool {
    let rest = text.strip_prefix("https://").or_else(|| text.strip_prefix("http://"));
    rest.is_some_and(|rest| !rest.is_empty() && rest.bytes().all(|b| b.is_ascii_graphic()))
}

/// Measured data as a reference of the dataset.
fn reference(source: &Source) -> String {
    let author = source.attribution.as_deref().unwrap_or("unnamed");
    format!(
        "  - type: data\n    title: {}\n    authors:\n      - name: {}\n    notes: {}\n",
        quoted(&format!("Measured elevation data {}", source.id)),
        quoted(author),
        quoted(&source_line(source))
    )
}

/// An author of `CITATION.cff`. `name` is for organisations; a person's name is split only if written as `Family, Given`,
/// otherwise it becomes an alias.
fn author(maker: Maker<'_>) -> String {
    let name = maker.name;
    if maker.is_organization {
        return format!("  - name: {}\n", quoted(name));
    }
    let parts = name.split_once(',').map(|(family, given)| (family.trim(), given.trim()));
    let mut text = match parts {
        Some((family, given)) if !family.is_empty() && !given.is_empty() => {
            format!("  - family-names: {}\n    given-names: {}\n", quoted(family), quoted(given))
        }
        _ => format!("  - alias: {}\n", quoted(name)),
    };
    let more = [("orcid", maker.page()), ("affiliation", maker.affiliation.map(str::to_owned))];
    for (key, value) in more.into_iter().filter_map(|(key, value)| Some((key, value?))) {
        let _ = writeln!(text, "    {key}: {}", quoted(&value));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_people_are_cited_with_orcid_and_affiliation() {
        let orcid = Some("0000-0002-1825-0097");
        let jane = Maker { name: "Doe, Jane", is_organization: false, orcid, affiliation: Some("Snow Lab") };
        assert_eq!(
            author(jane),
            "  - family-names: \"Doe\"\n    given-names: \"Jane\"\n    orcid: \"https://orcid.org/0000-0002-1825-0097\"\n    affiliation: \"Snow Lab\"\n"
        );
        let lab = Maker { name: "Snow Lab", is_organization: true, orcid: None, affiliation: Some("A university") };
        assert_eq!(author(lab), "  - name: \"Snow Lab\"\n");
    }

    #[test]
    fn val_licence_lines_of_a_citation() {
        for (license, lines) in [
            ("CC-BY-4.0", "license: \"CC-BY-4.0\"\n"),
            ("odbl-1.0", "license: \"ODbL-1.0\"\n"),
            ("MIT OR Apache-2.0", "license:\n  - \"MIT\"\n  - \"Apache-2.0\"\n"),
            ("CC-BY-4.0 OR cc-by-4.0", "license: \"CC-BY-4.0\"\n"),
            ("DL-DE-BY-2.0", "license-url: \"https://spdx.org/licenses/DL-DE-BY-2.0\"\n"),
            ("https://example.org/terms", "license-url: \"https://example.org/terms\"\n"),
        ] {
            assert_eq!(cited(license), lines);
        }
        for other in ["proprietary", "MIT AND Apache-2.0", "two\nlines", "https://", "https://a b"] {
            let lines = cited(other);
            assert!(lines.starts_with("# ") && lines.lines().count() == 1, "{lines}");
        }
    }
}
