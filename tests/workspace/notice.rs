//! `THIRD-PARTY.md`: what others made of the program, its page, the wheel and the checkout, with the texts of the licences.

use super::licences::{Graph, Package, Rules, expression, graph, licence_of, linked, read, rules, terms};
use sha2::Digest;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

const FILE: &str = "THIRD-PARTY.md";
/// Texts by the page's own build: `NAME VERSION (LICENCE)`, an empty line and the text of each package, between lines.
const PAGE: &str = "pipeline/server/page/dist/licences.txt";
const NO_TEXT: &str = "The package carries no licence file.";
const REFRESH: &str = "SASTRUGI_REFRESH=1 cargo test --release --workspace --test workspace notice";
const FENCE: &str = "````";

/// Texts with those they are of, each once whatever its line breaks, in the order of their first use.
#[derive(Default)]
struct Texts {
    found: Vec<Text>,
    places: BTreeMap<String, usize>,
}

struct Text {
    id: String,
    of: Vec<String>,
    text: String,
}

impl Texts {
    /// Adds a text of something, and returns its id: the beginning of the hash of its words.
    fn add(&mut self, text: &str, of: &str) -> String {
        let words: Vec<&str> = text.split_whitespace().collect();
        let digest = sha2::Sha256::digest(words.join(" ").as_bytes());
        let id: String = digest.iter().take(4).map(|byte| format!("{byte:02x}")).collect();
        let place = *self.places.entry(id.clone()).or_insert(self.found.len());
        if place == self.found.len() {
            self.found.push(Text { id: id.clone(), of: Vec::new(), text: tidied(text) });
        }
        let users = &mut self.found[place].of;
        if users.last().is_none_or(|last| last != of) {
            users.push(of.to_owned());
        }
        id
    }

    fn sections(&self) -> String {
        let section = |text: &Text| {
            assert!(!text.text.contains(FENCE), "the text of {:?} ends the block that it stands in", text.of);
            format!("\n### {}\n\nOf {}.\n\n{FENCE}\n{}\n{FENCE}\n", text.id, text.of.join(", "), text.text)
        };
        self.found.iter().map(section).collect()
    }
}

/// A text without empty lines around it or blanks at the ends of lines.
fn tidied(text: &str) -> String {
    let text = text.replace("\r\n", "\n");
    let lines: Vec<&str> = text.trim_matches('\n').split('\n').map(str::trim_end).collect();
    lines.join("\n")
}

/// The standard text of a licence, for what ships none: our own copy, without our name.
fn standard(licence: &str) -> String {
    let expression = expression(licence).unwrap();
    let suffices = |name: &str| expression.evaluate(|wanted| wanted.to_string() == name);
    if suffices("Apache-2.0") {
        return read("LICENSE-APACHE");
    }
    assert!(suffices("MIT"), "{licence}: ships no text, and there is no standard text of this licence here");
    let text = read("LICENSE-MIT");
    let holder = text.lines().find(|line| line.starts_with("Copyright")).unwrap();
    text.replace(holder, "Copyright (c) the holders named above")
}

/// The texts of a crate, each with whom it is of.
fn texts_of(package: &Package, rules: &Rules) -> Vec<(String, String)> {
    let name = format!("{} {}", package.name, package.version);
    let read = |file: &str| String::from_utf8_lossy(&fs::read(package.folder.join(file)).unwrap()).into_owned();
    let own = terms(&package.folder).into_iter().filter(|file| !file.contains('/'));
    let mut texts: Vec<(String, String)> = own.map(|file| (read(&file), name.clone())).collect();
    if texts.is_empty() {
        texts.push((standard(&licence_of(package, rules)), format!("{name} (copyright {})", holders(package))));
    }
    let inside = rules.inside.iter().filter(|inside| inside.package == package.name);
    texts.extend(inside.map(|inside| (read(&inside.file), format!("{name} ({})", inside.file))));
    texts
}

/// The authors that a crate states, without their addresses.
fn holders(package: &Package) -> String {
    let names: Vec<&str> = package.authors.iter().filter_map(|author| author.split(" <").next()).collect();
    if names.is_empty() { format!("the authors of {}", package.name) } else { names.join(", ") }
}

/// Name, version, licence and text of the packages in the page.
fn packages(page: &str) -> Vec<[&str; 4]> {
    let rule = format!("\n{}\n\n", "-".repeat(72));
    let (_, body) = page.split_once("\n\n").unwrap();
    body.split(&rule).map(|part| package(part).unwrap_or_else(|| panic!("{PAGE}: {part}"))).collect()
}

fn package(part: &str) -> Option<[&str; 4]> {
    let (head, text) = part.split_once("\n\n")?;
    let (name, rest) = head.split_once(' ')?;
    let (version, licence) = rest.strip_suffix(')')?.split_once(" (")?;
    Some([name, version, licence, text])
}

/// A line of a table.
fn row(cells: &[&str]) -> String {
    format!("| {} |\n", cells.join(" | "))
}

/// The head of a table.
fn head(cells: &[&str]) -> String {
    row(cells) + &format!("|{}\n", "---|".repeat(cells.len()))
}

fn notice(graph: &Graph, rules: &Rules, page: &str) -> String {
    let mut texts = Texts::default();
    let mut crates = head(&["crate", "version", "licence", "texts"]);
    for package in linked(graph) {
        let ids: Vec<String> = texts_of(package, rules).iter().map(|(text, of)| texts.add(text, of)).collect();
        crates += &row(&[&package.name, &package.version, &licence_of(package, rules), &ids.join(" ")]);
    }
    let mut bundled = head(&["package", "version", "licence", "texts"]);
    for [name, version, licence, text] in packages(page) {
        let id = if text.trim() == NO_TEXT {
            texts.add(&standard(licence), &format!("{name} {version} (copyright the authors of {name})"))
        } else {
            texts.add(text, &format!("{name} {version}"))
        };
        bundled += &row(&[name, version, licence, &id]);
    }
    let mut other = head(&["what", "where", "licence", "texts"]);
    for shipped in &rules.shipped {
        let text = match (&shipped.text, &shipped.copyright) {
            (Some(file), _) => Some(read(file)),
            (None, Some(_)) => Some(standard(&shipped.licence)),
            (None, None) => None,
        };
        let holders = shipped.copyright.as_ref().map(|holders| format!(" (copyright {holders})")).unwrap_or_default();
        let id = text.map(|text| texts.add(&text, &format!("{}{holders}", shipped.name))).unwrap_or_default();
        other += &row(&[&shipped.name, &shipped.place, &shipped.licence, &id]);
    }
    format!(
        "# Third-party notices

sastrugi is licensed under MIT OR Apache-2.0 (`LICENSE-MIT`, `LICENSE-APACHE`). The program, the Python wheel and the checkout also contain work of
others, listed here with its licences. Whoever passes one of them on passes this file on with it.

What ships no text of its licence has the standard text, with the holders that it states. The text of several crates stands once, even if its line breaks
differ. `{REFRESH}` writes this file.

## Crates in the program and in the wheel

{crates}
## Packages in the page of the terrain server

{bundled}
## Fonts, data and the standard library

{other}
## Texts
{}",
        texts.sections()
    )
}

#[test]
fn gold_the_notice_is_current() {
    let now = notice(&graph(), &rules(), &read(PAGE));
    let path = sastrugi_fixtures::workspace_root().join(FILE);
    if std::env::var_os("SASTRUGI_REFRESH").is_some() {
        fs::write(&path, &now).unwrap();
    }
    let kept = read(FILE);
    let rows =
        |text: &str| -> BTreeSet<String> { text.lines().filter(|l| l.starts_with("| ")).map(str::to_owned).collect() };
    let (old, new) = (rows(&kept), rows(&now));
    let gone: Vec<&String> = old.difference(&new).collect();
    let added: Vec<&String> = new.difference(&old).collect();
    assert!(gone.is_empty() && added.is_empty(), "{FILE} lists {gone:?}, but not {added:?}; refresh it: {REFRESH}");
    assert!(now == kept, "{FILE} is stale; refresh it: {REFRESH}");
}

#[test]
fn val_identical_texts_stand_once() {
    let mut texts = Texts::default();
    let first = texts.add("\n\nYou may\r\nuse it.  \n", "a 1.0.0");
    assert_eq!(texts.add("You may use\nit.", "b 1.0.0"), first);
    assert_eq!(texts.add("You may use it.", "b 1.0.0"), first);
    let other = texts.add("You may not use it.", "c 1.0.0");
    let expected = format!(
        "\n### {first}\n\nOf a 1.0.0, b 1.0.0.\n\n````\nYou may\nuse it.\n````\n\n### {other}\n\nOf c 1.0.0.\n\n````\nYou may not use it.\n````\n"
    );
    assert_eq!(texts.sections(), expected);
}

#[test]
fn val_standard_texts_do_not_name_us() {
    let mit = standard("MIT");
    assert!(mit.contains("Copyright (c) the holders named above") && !mit.contains("sastrugi"), "{mit}");
    assert!(standard("MIT OR Apache-2.0").contains("Version 2.0, January 2004"));
}

#[test]
#[should_panic(expected = "no standard text")]
fn val_a_standard_text_is_not_made_up() {
    standard("ISC");
}

#[test]
fn val_packages_of_the_page_are_read() {
    let rule = "-".repeat(72);
    let page =
        format!("Preface.\n\n@a/b 1.0.0 (MIT)\n\nText.\n\nMore.\n\n{rule}\n\nc 2.0.0 ((MIT AND Zlib))\n\n{NO_TEXT}\n");
    let expected = [
        ["@a/b", "1.0.0", "MIT", "Text.\n\nMore.\n"],
        ["c", "2.0.0", "(MIT AND Zlib)", "The package carries no licence file.\n"],
    ];
    assert_eq!(packages(&page), expected);
}
