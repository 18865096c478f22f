//! The pages: each ends with what to do next, and links from page to page lead somewhere.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// All pages of the checkout that are written by hand or generated for readers.
fn pages() -> Vec<PathBuf> {
    let root = sastrugi_fixtures::workspace_root();
    let mut pages = manual();
    pages.extend(["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|name| root.join(name)));
    pages
}

/// The pages of the manual.
fn manual() -> Vec<PathBuf> {
    let root = sastrugi_fixtures::workspace_root();
    let mut pages = Vec::new();
    for folder in ["docs", "docs/papers"] {
        let files = fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap().path());
        pages.extend(files.filter(|path| path.extension().is_some_and(|ending| ending == "md")));
    }
    pages
}

/// The lines of a page outside its blocks of code.
fn prose(page: &Path) -> Vec<String> {
    let text = fs::read_to_string(page).unwrap();
    let mut is_code = false;
    let mut lines = Vec::new();
    for line in text.lines() {
        if line.starts_with("```") {
            is_code = !is_code;
        } else if !is_code {
            lines.push(line.to_owned());
        }
    }
    lines
}

/// Anchors of the headings of a page, as GitHub makes them.
fn anchors(page: &Path) -> BTreeSet<String> {
    let anchor = |heading: &String| -> String {
        let words = heading.trim_start_matches('#').trim().to_lowercase().replace(' ', "-");
        words.chars().filter(|c| c.is_alphanumeric() || ['-', '_'].contains(c)).collect()
    };
    prose(page).iter().filter(|line| line.starts_with('#')).map(anchor).collect()
}

/// A reader can say after each page what to do next.
#[test]
fn val_every_page_says_what_to_do_next() {
    let pages = manual();
    assert!(pages.len() > 25, "{} pages", pages.len());
    for page in pages {
        let lines = prose(&page);
        let end = lines[lines.len().saturating_sub(5)..].join("\n");
        assert!(end.contains("Next"), "{} ends with: {end}", page.display());
    }
}

#[test]
fn val_links_between_pages_lead_somewhere() {
    let mut followed = 0;
    for page in pages() {
        let text = prose(&page).join("\n");
        let targets = text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target);
        for target in targets.filter(|target| !target.starts_with("http") && !target.contains(char::is_whitespace)) {
            let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
            let to = if path.is_empty() { page.clone() } else { page.with_file_name(path) };
            assert!(to.exists(), "{}: there is no {target}", page.display());
            assert!(anchor.is_empty() || anchors(&to).contains(anchor), "{}: there is no {target}", page.display());
            followed += 1;
        }
    }
    assert!(followed > 300, "{followed} links");
}
