//! Compatibility of the licences of measured data with the licence of what is derived from them.
//!
//! A release contains derivatives of its DEMs (heights in metres, fits, textures), so its licence must be one that the
//! DEMs' licences permit for adaptations: Creative Commons, "Frequently Asked Questions", *If I derive or adapt material
//! offered under a Creative Commons license, which CC license(s) can I use?*, with its chart (boxes that are not recommended
//! count as refused); the database licences of Open Data Commons by their own texts. This is not legal advice: licences
//! missing from the table are left to the reader, with a note.

use sastrugi_schemas::study::DemItem;

/// Conditions of a licence on adaptations.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Terms {
    /// None.
    Free,
    /// Attribution.
    Attribution,
    /// Attribution and share-alike.
    ShareAlike,
    /// No commercial use.
    NonCommercial,
    /// No commercial use, and share-alike.
    NonCommercialShareAlike,
    /// No adaptations.
    NoDerivatives,
}

/// Families of licences: SPDX identifiers without their version, upper case.
const FAMILIES: [(&str, Terms); 14] = [
    ("PUBLIC-DOMAIN", Terms::Free),
    ("CC-PDDC", Terms::Free),
    ("CC0", Terms::Free),
    ("PDDL", Terms::Free),
    ("CC-BY", Terms::Attribution),
    ("ODC-BY", Terms::Attribution),
    ("CC-BY-SA", Terms::ShareAlike),
    ("ODBL", Terms::ShareAlike),
    ("CC-BY-NC", Terms::NonCommercial),
    ("CC-BY-NC-SA", Terms::NonCommercialShareAlike),
    ("CC-BY-ND", Terms::NoDerivatives),
    ("CC-BY-NC-ND", Terms::NoDerivatives),
    ("OGL-UK", Terms::Attribution),
    ("ETALAB", Terms::Attribution),
];

/// A licence in the table: its family and version, such as `("CC-BY-SA", "4.0")`.
struct Known {
    family: &'static str,
    version: String,
    terms: Terms,
}

/// Finds a licence by its SPDX identifier, ignoring case and treating blanks as hyphens.
fn known(license: &str) -> Option<Known> {
    let name = license.trim().to_uppercase().replace([' ', '_'], "-");
    FAMILIES.iter().find_map(|&(family, terms)| {
        let rest = name.strip_prefix(family)?;
        let version = rest.strip_prefix('-').unwrap_or(rest);
        let right = rest.is_empty() || (rest.starts_with('-') && is_version(version));
        right.then(|| Known { family, version: version.to_owned(), terms })
    })
}

/// True for a number, optionally followed by a region or organisation (`3.0-IGO`); an expression of several licences is not
/// a version.
fn is_version(text: &str) -> bool {
    let (number, port) = text.split_once('-').unwrap_or((text, ""));
    let digits =
        number.starts_with(|c: char| c.is_ascii_digit()) && number.bytes().all(|b| b.is_ascii_digit() || b == b'.');
    digits && port.len() <= 3 && port.bytes().all(|b| b.is_ascii_alphabetic())
}

/// A conflict or doubt between the licence of a release and that of its data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Objection {
    /// The data's licence does not permit it; the sentence says which licences would be valid.
    Conflict(String),
    /// One of the two licences is unknown.
    Unknown(String),
}

/// The objection to releasing derivatives of data under licence `source` under the licence `release`; `None` if the data
/// states no licence.
pub fn objection(source: &DemItem, release: &str) -> Option<Objection> {
    let stated = source.license.as_deref()?;
    let (Some(theirs), Some(ours)) = (known(stated), known(release)) else {
        let sentence = format!(
            "it is unknown whether data under \"{stated}\" may be released under \"{release}\"; check the licences yourself"
        );
        return Some(Objection::Unknown(sentence));
    };
    let reason = refusal(&theirs, &ours, stated)?;
    Some(Objection::Conflict(format!(
        "is \"{stated}\", but the release, which contains derivatives, is under \"{release}\": {reason}"
    )))
}

/// What a plan warns of: data without a stated licence, or one of which it is unknown whether it permits the release, unless the study supplies its
/// text, and so has read it.
pub fn doubt(source: &DemItem, release: &str) -> Option<String> {
    let why = match objection(source, release) {
        Some(Objection::Unknown(sentence)) if source.license_file.is_none() => sentence,
        None if source.license.is_none() => format!(
            "no `license` is stated; the release, which contains derivatives, is under \"{release}\": state the licence of the data"
        ),
        _ => return None,
    };
    Some(format!("dem \"{}\": {why}", source.id))
}

fn refusal(theirs: &Known, ours: &Known, stated: &str) -> Option<String> {
    let alike = ours.family == theirs.family && ours.version >= theirs.version;
    let non_commercial =
        matches!(ours.terms, Terms::NonCommercial | Terms::NonCommercialShareAlike) || ours.family == "CC-BY-NC-ND";
    match theirs.terms {
        Terms::Free => None,
        Terms::Attribution if ours.terms != Terms::Free => None,
        Terms::Attribution => Some(format!("[study] license must require attribution, like \"{stated}\"")),
        Terms::ShareAlike | Terms::NonCommercialShareAlike if alike => None,
        Terms::ShareAlike | Terms::NonCommercialShareAlike => {
            Some(format!("[study] license must also be \"{stated}\" or a later version of it"))
        }
        Terms::NonCommercial if non_commercial => None,
        Terms::NonCommercial => Some("[study] license must also be non-commercial, such as CC-BY-NC-4.0".to_owned()),
        Terms::NoDerivatives => Some("it permits no derivatives under any licence; use other data".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn between(source: &str, release: &str) -> Option<Objection> {
        let item = serde_json::json!({ "id": "a", "file": "a.tif", "license": source });
        objection(&serde_json::from_value(item).unwrap(), release)
    }

    /// The chart of the Creative Commons FAQ, row by row.
    #[test]
    fn val_the_chart_of_adapters_licences() {
        let releases = ["CC0-1.0", "CC-BY-4.0", "CC-BY-SA-4.0", "CC-BY-NC-4.0", "CC-BY-NC-SA-4.0", "CC-BY-NC-ND-4.0"];
        let rows = [
            ("public domain", [true; 6]),
            ("CC0-1.0", [true; 6]),
            ("PDDL-1.0", [true; 6]),
            ("CC-BY-4.0", [false, true, true, true, true, true]),
            ("CC BY 3.0", [false, true, true, true, true, true]),
            ("CC-BY-SA-4.0", [false, false, true, false, false, false]),
            ("cc-by-sa-3.0", [false, false, true, false, false, false]),
            ("CC-BY-NC-4.0", [false, false, false, true, true, true]),
            ("CC-BY-NC-SA-4.0", [false, false, false, false, true, false]),
            ("CC-BY-ND-4.0", [false; 6]),
            ("CC-BY-NC-ND-4.0", [false; 6]),
            ("ODbL-1.0", [false; 6]),
        ];
        for (source, permitted) in rows {
            for (release, permitted) in releases.into_iter().zip(permitted) {
                let found = between(source, release);
                assert_eq!(found.is_none(), permitted, "{source} to {release}: {found:?}");
                assert!(!matches!(found, Some(Objection::Unknown(_))));
            }
        }
    }

    #[test]
    fn val_unknown_licences_are_noted_and_unstated_ones_pass() {
        assert!(matches!(between("terms of the agency", "CC-BY-4.0"), Some(Objection::Unknown(_))));
        assert!(matches!(between("CC-BY-4.0", "MIT"), Some(Objection::Unknown(_))));
        assert!(matches!(between("CC-BYE-4.0", "CC-BY-4.0"), Some(Objection::Unknown(_))));
        assert!(matches!(between("CC-BY-4.0 AND CC-BY-NC-4.0", "CC-BY-4.0"), Some(Objection::Unknown(_))));
        assert!(matches!(between("CC-BY-4.0", "CC-BY-4.0 OR CC0-1.0"), Some(Objection::Unknown(_))));
        assert_eq!(between("CC-BY-3.0-IGO", "CC-BY-4.0"), None);
        assert!(matches!(between("CC-BY-SA-4.0", "CC-BY-SA-3.0"), Some(Objection::Conflict(_))));
        let item = serde_json::json!({ "id": "a", "file": "a.tif" });
        assert_eq!(objection(&serde_json::from_value(item).unwrap(), "CC-BY-4.0"), None);
    }
}
