//! `LICENSE`: the licence of the release and those of the measured data in it.

use super::described::{Described, authors, folded, page, source_line};
use super::spdx_list;
use std::fmt::Write as _;

/// The text of `LICENSE`.
pub fn text(described: &Described<'_>) -> String {
    let (head, sources) = (described.head, described.sources);
    let version = head.version.as_ref().map_or_else(String::new, |v| format!(", version {v}"));
    let what = folded(&format!("{}{version} ({}) by {}", head.title, head.date, authors(head)));
    let license = spdx_list::identifier(&head.license).unwrap_or_else(|| head.license.trim());
    let mut text = match spdx_list::is_listed(&head.license) {
        true => format!(
            "SPDX-License-Identifier: {0}\n\n{what} is licensed under {0}. The text of the licence is in the SPDX licence list under that identifier.\n",
            license,
        ),
        false => format!(
            "{what} is licensed under:\n\n{}\n\nIt is not in the SPDX licence list; ask the creators for its terms.\n",
            license
        ),
    };
    if let Some(page) = page(head) {
        let _ = writeln!(text, "{page}");
    }
    if !sources.is_empty() {
        text.push_str(
            "\nMeasured inputs in dem/ keep their own licences, and everything derived from them names its source. The text of a licence supplied with the data \
             is dem/<id>.license.txt.\n\n",
        );
        sources.iter().for_each(|source| text.push_str(&format!("- {}\n", source_line(source))));
    }
    text
}

/// Warning for a release under a licence that is not in the SPDX list.
pub fn license_warning(license: &str) -> Option<String> {
    let listed = spdx_list::is_listed(license);
    (!listed).then(|| {
        format!(
            "[study] license \"{license}\" is not in the SPDX list; use its SPDX identifier, such as CC-BY-4.0, if it has one"
        )
    })
}
