//! `.zenodo.json`: Zenodo's deposit metadata (<https://developers.zenodo.org/#deposit-metadata>; example:
//! <https://help.zenodo.org/docs/github/describe-software/zenodo-json>).
//!
//! Licences are Zenodo's identifiers: those of the SPDX list in lower case. Others are `other-open`, because Zenodo treats a dataset
//! without a licence as CC0; the notes then state the licence. Funding given as a Zenodo grant identifier is listed under `grants`,
//! the rest in the notes.

use super::described::{Described, Maker, source_line};
use super::spdx_list;
use serde_json::{Value, json};

/// Zenodo's identifier for licences not in its list.
const OTHER_LICENSE: &str = "other-open";
/// Prefix of funder DOIs.
const FUNDER: &str = "10.13039/";

/// The text of `.zenodo.json`.
pub fn text(described: &Described<'_>) -> String {
    let head = described.head;
    let about = if head.description.is_empty() { &head.title } else { &head.description };
    let mut deposit = json!({
        "title": head.title,
        "upload_type": "dataset",
        "description": html(about),
        "creators": described.creators().map(creator).collect::<Vec<_>>(),
        "access_right": "open",
        "license": license(&head.license),
        "publication_date": head.date,
    });
    let (grants, other): (Vec<&String>, Vec<&String>) = head.funding.iter().partition(|text| is_grant(text));
    let grants: Vec<Value> = grants.into_iter().map(|id| json!({ "id": id })).collect();
    // Not the DOI, which is that of the deposit itself.
    let page = head.url.as_ref().map(|page| json!([{ "identifier": page, "relation": "isAlternateIdentifier" }]));
    let sources: Vec<String> = described.sources.iter().map(source_line).collect();
    let optional = [
        ("version", head.version.as_ref().map(|version| json!(version))),
        ("keywords", listed(&head.keywords)),
        ("grants", listed(&grants)),
        ("references", listed(&sources)),
        ("related_identifiers", page),
        ("notes", notes(&head.license, &other).map(|text| json!(html(&text)))),
    ];
    for (key, value) in optional.into_iter().filter_map(|(key, value)| Some((key, value?))) {
        deposit[key] = value;
    }
    format!("{deposit:#}\n")
}

/// A list that is not empty.
fn listed<T: serde::Serialize>(list: &[T]) -> Option<Value> {
    (!list.is_empty()).then(|| json!(list))
}

fn creator(maker: Maker<'_>) -> Value {
    let mut creator = json!({ "name": maker.name });
    for (key, value) in [("orcid", maker.orcid), ("affiliation", maker.affiliation)] {
        if let Some(value) = value {
            creator[key] = json!(value);
        }
    }
    creator
}

/// Zenodo's identifier of a licence.
fn license(license: &str) -> String {
    spdx_list::identifier(license).map_or_else(|| OTHER_LICENSE.to_owned(), str::to_lowercase)
}

/// Metadata without a field of its own.
fn notes(license: &str, funding: &[&String]) -> Option<String> {
    let unlisted = spdx_list::identifier(license).is_none();
    let license = unlisted.then(|| format!("Licence: {license}; see the file LICENSE."));
    let funded: Vec<&str> = funding.iter().map(|text| text.as_str()).collect();
    let funding = (!funded.is_empty()).then(|| format!("Funding: {}.", funded.join("; ").trim_end_matches('.')));
    let notes: Vec<String> = license.into_iter().chain(funding).collect();
    (!notes.is_empty()).then(|| notes.join(" "))
}

/// Whether a grant is a Zenodo identifier: the funder's DOI and the grant number or, for the European Commission, the number alone.
fn is_grant(text: &str) -> bool {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let plain = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_graphic());
    match text.split_once("::") {
        Some((funder, grant)) => funder.strip_prefix(FUNDER).is_some_and(is_number) && plain(grant),
        None => is_number(text),
    }
}

/// Text as HTML, the format of Zenodo's descriptions and notes.
fn html(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_licences_have_zenodo_identifiers() {
        for (ours, theirs) in [
            ("CC-BY-4.0", "cc-by-4.0"),
            ("cc0-1.0", "cc0-1.0"),
            ("MIT OR Apache-2.0", "other-open"),
            ("proprietary", "other-open"),
        ] {
            assert_eq!(license(ours), theirs);
        }
        assert_eq!(notes("CC-BY-4.0", &[]), None);
        let fund = "a <fund>".to_owned();
        assert_eq!(notes("ours", &[&fund]).unwrap(), "Licence: ours; see the file LICENSE. Funding: a <fund>.");
        assert_eq!(html("a < b & c"), "a &lt; b &amp; c");
    }

    #[test]
    fn val_grants_are_distinguished_from_other_funding() {
        for grant in ["10.13039/501100000780::101122956", "10.13039/501100001711::200021_192342", "283595"] {
            assert!(is_grant(grant), "{grant}");
        }
        for other in ["", "SNSF 200021", "10.13039/::1", "10.13039/501100000780::", "10.5281/1::2", "a::b"] {
            assert!(!is_grant(other), "{other}");
        }
    }
}
