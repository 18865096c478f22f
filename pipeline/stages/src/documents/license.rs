//! How the documents name a licence: by its identifier in the SPDX list, in the words of each format.

use super::quoted;
use std::collections::BTreeSet;

/// Identifiers that the Citation File Format 1.2.0 permits (`definitions.license-enum` of its `schema.json`,
/// doi 10.5281/zenodo.5171937). It is the SPDX list of its day: later identifiers make a file invalid.
const CITABLE: &str = include_str!("cff_1_2_0_licenses.txt");

/// What the crate lists beside the licences: that nothing is said of one.
const NO_LICENSE: &str = "NOASSERTION";

/// The identifier of the SPDX list that a licence is, whatever its case.
pub fn identifier(license: &str) -> Option<&'static str> {
    let license = license.trim();
    let names = spdx::identifiers::LICENSES.iter().map(|listed| listed.name);
    names.into_iter().find(|name| name.eq_ignore_ascii_case(license) && *name != NO_LICENSE)
}

/// Where a licence can be read: its page in the SPDX list, or the licence as it is stated.
pub fn address(license: &str) -> String {
    identifier(license).map_or_else(|| license.to_owned(), |id| format!("https://spdx.org/licenses/{id}"))
}

/// True for an expression of nothing but identifiers of the SPDX list, as `MIT OR Apache-2.0`.
pub fn is_listed(license: &str) -> bool {
    let of_list = |e: spdx::Expression| {
        e.requirements().all(|r| r.req.license.id().is_some_and(|id| identifier(id.name).is_some()))
    };
    let choices = || license.split(" OR ").all(|choice| identifier(choice).is_some());
    choices() || spdx::Expression::parse(license).is_ok_and(of_list)
}

/// The lines of `CITATION.cff` on a licence: identifiers as far as the format has them, an address for another, or a comment.
pub fn cited(license: &str) -> String {
    let citable = |part: &str| identifier(part).filter(|id| CITABLE.split_whitespace().any(|known| known == *id));
    let mut choices: Option<Vec<&str>> = license.split(" OR ").map(citable).collect();
    let mut seen = BTreeSet::new();
    choices.iter_mut().for_each(|all| all.retain(|id| seen.insert(*id)));
    let address = address(license);
    match choices.as_deref() {
        Some([one]) => format!("license: {}\n", quoted(one)),
        Some(several) => {
            several.iter().fold("license:\n".to_owned(), |text, id| text + &format!("  - {}\n", quoted(id)))
        }
        None if is_address(&address) => format!("license-url: {}\n", quoted(&address)),
        None => format!("# The format has no identifier for the licence {}; see the file LICENSE.\n", quoted(license)),
    }
}

fn is_address(text: &str) -> bool {
    let rest = text.strip_prefix("https://").or_else(|| text.strip_prefix("http://"));
    rest.is_some_and(|rest| !rest.is_empty() && rest.bytes().all(|b| b.is_ascii_graphic()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_licences_are_named_as_the_lists_have_them() {
        assert_eq!(identifier("cc-by-4.0"), Some("CC-BY-4.0"));
        assert_eq!(identifier("DL-DE-BY-2.0"), Some("DL-DE-BY-2.0"));
        for other in ["NOASSERTION", "proprietary", "public-domain", "CC-BY-9.0", "MIT OR Apache-2.0", ""] {
            assert_eq!(identifier(other), None, "{other}");
        }
        assert!(is_listed("MIT OR Apache-2.0") && is_listed("cc-by-4.0"));
        assert!(is_listed("cc-by-4.0 OR MIT") && is_listed("GPL-2.0 OR MIT") && !is_listed("NOASSERTION OR MIT"));
        assert!(!is_listed("proprietary") && !is_listed("LicenseRef-ours") && !is_listed("MIT OR ours"));
    }

    #[test]
    fn val_what_a_citation_says_of_a_licence() {
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
