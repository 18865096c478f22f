//! Licence identifiers of the SPDX list.

/// The crate's entry for a missing licence, which is not a licence.
const NO_LICENSE: &str = "NOASSERTION";

/// The SPDX identifier of a licence, ignoring case.
pub fn identifier(license: &str) -> Option<&'static str> {
    let license = license.trim();
    let names = spdx::identifiers::LICENSES.iter().map(|listed| listed.name);
    names.into_iter().find(|name| name.eq_ignore_ascii_case(license) && *name != NO_LICENSE)
}

/// Address of a licence: its page in the SPDX list, or the licence as stated.
pub fn address(license: &str) -> String {
    identifier(license).map_or_else(|| license.to_owned(), |id| format!("https://spdx.org/licenses/{id}"))
}

/// True for an expression made only of SPDX identifiers, such as `MIT OR Apache-2.0`.
pub fn is_listed(license: &str) -> bool {
    let of_list = |e: spdx::Expression| {
        e.requirements().all(|r| r.req.license.id().is_some_and(|id| identifier(id.name).is_some()))
    };
    let choices = || license.split(" OR ").all(|choice| identifier(choice).is_some());
    choices() || spdx::Expression::parse(license).is_ok_and(of_list)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_licences_have_the_identifiers_of_the_list() {
        assert_eq!(identifier("cc-by-4.0"), Some("CC-BY-4.0"));
        assert_eq!(identifier("DL-DE-BY-2.0"), Some("DL-DE-BY-2.0"));
        for other in ["NOASSERTION", "proprietary", "public-domain", "CC-BY-9.0", "MIT OR Apache-2.0", ""] {
            assert_eq!(identifier(other), None, "{other}");
        }
        assert!(is_listed("MIT OR Apache-2.0") && is_listed("cc-by-4.0"));
        assert!(is_listed("cc-by-4.0 OR MIT") && is_listed("GPL-2.0 OR MIT") && !is_listed("NOASSERTION OR MIT"));
        assert!(!is_listed("proprietary") && !is_listed("LicenseRef-ours") && !is_listed("MIT OR ours"));
    }
}
