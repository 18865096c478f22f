//! Licences of what others made: crates, packages of the server's page, fonts, data. `licences.toml` says which are allowed.

use serde_json::{Value, json};
use spdx::{Expression, ParseMode};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use toml_edit::{DocumentMut, Item, Table};

/// The platform that the promises hold for: its dependencies are checked, whatever machine runs the test.
const PLATFORM: &str = "x86_64-unknown-linux-gnu";
const RULES: &str = "tests/workspace/licences.toml";
const LOCK: &str = "pipeline/server/page/package-lock.json";
/// Folders of the checkout with files by others.
const FOLDERS: [&str; 3] = ["analysis/report/src/render/fonts", "fixtures/dem", "fixtures/routes"];
/// Beginnings of the names of files that state terms, in small letters.
const TERMS: [&str; 6] = ["license", "licence", "copying", "notice", "unlicense", "copyright"];

/// A crate of the dependency graph.
pub struct Package {
    pub name: String,
    pub version: String,
    /// As its Cargo.toml states it.
    licence: String,
    pub authors: Vec<String>,
    pub folder: PathBuf,
    is_ours: bool,
    /// Kinds of its targets: `lib`, `bin`, `proc-macro` ...
    kinds: BTreeSet<String>,
    uses: Vec<Use>,
}

/// A dependency of a crate.
struct Use {
    on: String,
    /// False for build scripts and tests.
    is_linked: bool,
}

/// Crates by cargo's ids.
pub type Graph = BTreeMap<String, Package>;

/// `licences.toml`.
pub struct Rules {
    allowed: BTreeSet<String>,
    not_linked: Vec<String>,
    pub inside: Vec<Inside>,
    pub shipped: Vec<Shipped>,
}

/// Work of others inside a crate.
pub struct Inside {
    pub package: String,
    pub file: String,
    licence: String,
}

/// What is neither a crate nor a package of the page.
pub struct Shipped {
    pub name: String,
    pub place: String,
    pub licence: String,
    files: Vec<String>,
    pub text: Option<String>,
    pub copyright: Option<String>,
}

/// Something that others made, under a licence.
struct Part {
    /// Name and version.
    name: String,
    licence: String,
    /// Who pulls it in.
    by: String,
}

/// A file of the checkout.
pub fn read(file: &str) -> String {
    let path = sastrugi_fixtures::workspace_root().join(file);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

pub fn rules() -> Rules {
    let document: DocumentMut = read(RULES).parse().unwrap();
    let word = |table: &Table, key: &str| table.get(key).and_then(|item| item.as_str()).map(str::to_owned);
    let needed =
        |table: &Table, key: &str| word(table, key).unwrap_or_else(|| panic!("{RULES}: no `{key}` in {table}"));
    let inside = |table: &Table| Inside {
        package: needed(table, "crate"),
        file: needed(table, "file"),
        licence: needed(table, "licence"),
    };
    let shipped = |table: &Table| Shipped {
        name: needed(table, "name"),
        place: needed(table, "place"),
        licence: needed(table, "licence"),
        files: table.get("files").map(strings).unwrap_or_default(),
        text: word(table, "text"),
        copyright: word(table, "copyright"),
    };
    Rules {
        allowed: strings(&document["allowed"]).into_iter().collect(),
        not_linked: strings(&document["not_linked"]),
        inside: document["inside"].as_array_of_tables().unwrap().iter().map(inside).collect(),
        shipped: document["shipped"].as_array_of_tables().unwrap().iter().map(shipped).collect(),
    }
}

fn strings(item: &Item) -> Vec<String> {
    item.as_array().unwrap().iter().map(|value| value.as_str().unwrap().to_owned()).collect()
}

/// The dependency graph of the workspace.
pub fn graph() -> Graph {
    let arguments = ["metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform", PLATFORM];
    let root = sastrugi_fixtures::workspace_root();
    let output = Command::new(env!("CARGO")).args(arguments).current_dir(root).output().unwrap();
    let why = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo does not know all dependencies; `cargo fetch` downloads them\n{why}");
    graph_of(&serde_json::from_slice(&output.stdout).unwrap())
}

fn graph_of(metadata: &Value) -> Graph {
    let used = |dependency: &Value| Use {
        on: text(&dependency["pkg"]),
        is_linked: list(&dependency["dep_kinds"]).iter().any(|kind| kind["kind"].is_null()),
    };
    let nodes = list(&metadata["resolve"]["nodes"]);
    let mut uses: BTreeMap<String, Vec<Use>> =
        nodes.iter().map(|node| (text(&node["id"]), list(&node["deps"]).iter().map(used).collect())).collect();
    let package = |package: &Value| {
        let id = text(&package["id"]);
        let targets = list(&package["targets"]).iter();
        let found = Package {
            name: text(&package["name"]),
            version: text(&package["version"]),
            licence: text(&package["license"]),
            authors: list(&package["authors"]).iter().map(text).collect(),
            folder: Path::new(&text(&package["manifest_path"])).parent().unwrap().to_owned(),
            is_ours: package["source"].is_null(),
            kinds: targets.flat_map(|target| list(&target["kind"])).map(text).collect(),
            uses: uses.remove(&id).unwrap_or_default(),
        };
        (id, found)
    };
    list(&metadata["packages"]).iter().map(package).collect()
}

/// The empty text for null.
fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

/// Crates of others in our programs and modules: all that they reach other than through build scripts and macros. Sorted by name.
pub fn linked(graph: &Graph) -> Vec<&Package> {
    // The programs of the tests and of the benches stay here.
    let ships = |package: &Package| {
        let is_program = ["bin", "cdylib"].iter().any(|kind| package.kinds.contains(*kind));
        package.is_ours && !["sastrugi-tests", "sastrugi-benches"].contains(&package.name.as_str()) && is_program
    };
    let mut waiting: Vec<&String> = graph.iter().filter(|(_, package)| ships(package)).map(|(id, _)| id).collect();
    let mut reached = BTreeSet::new();
    while let Some(id) = waiting.pop() {
        let package = &graph[id];
        if !package.kinds.contains("proc-macro") && reached.insert(id) {
            waiting.extend(package.uses.iter().filter(|used| used.is_linked).map(|used| &used.on));
        }
    }
    let mut found: Vec<&Package> =
        reached.into_iter().map(|id| &graph[id]).filter(|package| !package.is_ours).collect();
    found.sort_by_key(|package| (&package.name, &package.version));
    found
}

/// The shortest way from a room to each crate, as `cli -> clap -> clap_derive`.
fn ways(graph: &Graph) -> BTreeMap<&str, String> {
    let ours = graph.iter().filter(|(_, package)| package.is_ours);
    let room = |package: &Package| package.name.trim_start_matches("sastrugi-").to_owned();
    let mut ways: BTreeMap<&str, String> = ours.map(|(id, package)| (id.as_str(), room(package))).collect();
    let mut waiting: VecDeque<&str> = ways.keys().copied().collect();
    while let Some(id) = waiting.pop_front() {
        for used in &graph[id].uses {
            if !ways.contains_key(used.on.as_str()) {
                let way = format!("{} -> {}", ways[id], graph[&used.on].name);
                ways.insert(&used.on, way);
                waiting.push_back(&used.on);
            }
        }
    }
    ways
}

/// The licence of a crate and of what is inside it.
pub fn licence_of(package: &Package, rules: &Rules) -> String {
    let bracketed = |licence: &str| if licence.contains(" OR ") { format!("({licence})") } else { licence.to_owned() };
    let inside = rules.inside.iter().filter(|i| i.package == package.name && i.licence != package.licence);
    inside.fold(package.licence.clone(), |licence, i| format!("{} AND {}", bracketed(&licence), bracketed(&i.licence)))
}

/// Everything that others made.
fn parts(graph: &Graph, rules: &Rules) -> Vec<Part> {
    let ways = ways(graph);
    let crates = graph.iter().filter(|(_, package)| !package.is_ours).map(|(id, package)| Part {
        name: format!("{} {}", package.name, package.version),
        licence: licence_of(package, rules),
        by: ways[id.as_str()].clone(),
    });
    let lock: Value = serde_json::from_str(&read(LOCK)).unwrap();
    let packages = lock["packages"].as_object().unwrap().iter().filter(|(path, _)| !path.is_empty());
    let packages = packages.map(|(path, package)| Part {
        name: format!("{} {}", path.trim_start_matches("node_modules/"), text(&package["version"])),
        licence: text(&package["license"]),
        by: LOCK.to_owned(),
    });
    let shipped = rules.shipped.iter().map(|shipped| Part {
        name: shipped.name.clone(),
        licence: shipped.licence.clone(),
        by: format!("the {}", shipped.place),
    });
    crates.chain(packages).chain(shipped).collect()
}

/// A licence as crates and packages state it.
pub fn expression(licence: &str) -> Option<Expression> {
    Expression::parse_mode(licence, ParseMode::LAX).ok()
}

/// Why a part may not be used; `None` if it may.
fn refusal(part: &Part, allowed: &BTreeSet<String>) -> Option<String> {
    let Part { name, licence, by } = part;
    let Some(expression) = expression(licence) else {
        return Some(format!("{name} ({by}): its licence `{licence}` is not an SPDX expression"));
    };
    let may = expression.evaluate(|wanted| allowed.contains(&wanted.to_string()));
    (!may).then(|| format!("{name} ({by}): {RULES} does not allow its licence {licence}"))
}

/// Files that state terms, in a folder and below, as paths from there; sorted.
pub fn terms(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = entry.file_name().to_string_lossy().into_owned();
        let lower = name.to_lowercase();
        if entry.path().is_dir() && !name.starts_with('.') {
            found.extend(terms(&entry.path()).into_iter().map(|inner| format!("{name}/{inner}")));
        } else if TERMS.iter().any(|start| lower.starts_with(start)) && !lower.ends_with(".rs") {
            found.push(name);
        }
    }
    found.sort();
    found
}

#[test]
fn val_every_licence_is_allowed() {
    let rules = rules();
    let parts = parts(&graph(), &rules);
    assert!(parts.len() > 400, "{} crates, packages and files", parts.len());
    let refused: Vec<String> = parts.iter().filter_map(|part| refusal(part, &rules.allowed)).collect();
    assert!(refused.is_empty(), "{}", refused.join("\n"));
    // What nothing states any more is no longer allowed.
    let stated = parts.iter().filter_map(|part| expression(&part.licence));
    let stated: BTreeSet<String> =
        stated.flat_map(|e| e.requirements().map(|r| r.req.to_string()).collect::<Vec<_>>()).collect();
    assert_eq!(rules.allowed.difference(&stated).collect::<Vec<_>>(), Vec::<&String>::new(), "in {RULES}, but unused");
}

#[test]
fn val_other_licences_are_refused() {
    let allowed: BTreeSet<String> = ["MIT", "Apache-2.0"].map(str::to_owned).into();
    let refusal = |licence: &str| {
        let part = Part { name: "a 1.2.3".to_owned(), licence: licence.to_owned(), by: "cli -> a".to_owned() };
        refusal(&part, &allowed)
    };
    for accepted in
        ["MIT", "MIT/Apache-2.0", "Apache-2.0 / MIT", "GPL-2.0-only OR MIT", "(MIT OR GPL-3.0-only) AND Apache-2.0"]
    {
        assert_eq!(refusal(accepted), None, "{accepted}");
    }
    for refused in ["GPL-3.0-only", "MIT AND GPL-2.0-only", "Apache-2.0 WITH LLVM-exception"] {
        let sentence = format!("a 1.2.3 (cli -> a): {RULES} does not allow its licence {refused}");
        assert_eq!(refusal(refused), Some(sentence));
    }
    for unclear in ["", "see LICENSE"] {
        let sentence = format!("a 1.2.3 (cli -> a): its licence `{unclear}` is not an SPDX expression");
        assert_eq!(refusal(unclear), Some(sentence));
    }
}

/// A program uses `a`, which uses a macro; `b` is for tests alone, `c` for the build script of `a`.
#[test]
fn val_what_is_linked_and_who_pulls_it_in() {
    let package = |name: &str, kind: &str, source: Value| {
        json!({"id": name, "name": name, "version": "1.0.0", "license": "MIT", "authors": [], "source": source,
            "manifest_path": format!("/{name}/Cargo.toml"), "targets": [{"kind": [kind]}]})
    };
    let uses = |on: &str, kind: Value| json!({"pkg": on, "dep_kinds": [{"kind": kind}]});
    let node = |id: &str, deps: Vec<Value>| json!({"id": id, "deps": deps});
    let graph = graph_of(&json!({
        "packages": [
            package("sastrugi-cli", "bin", Value::Null),
            package("a", "lib", json!("registry")),
            package("b", "lib", json!("registry")),
            package("c", "lib", json!("registry")),
            package("macro", "proc-macro", json!("registry")),
            package("syn", "lib", json!("registry")),
        ],
        "resolve": {"nodes": [
            node("sastrugi-cli", vec![uses("a", Value::Null), uses("b", json!("dev"))]),
            node("a", vec![uses("macro", Value::Null), uses("c", json!("build"))]),
            node("macro", vec![uses("syn", Value::Null)]),
        ]},
    }));
    let names: Vec<&str> = linked(&graph).iter().map(|package| package.name.as_str()).collect();
    assert_eq!(names, ["a"]);
    assert_eq!(ways(&graph)["syn"], "cli -> a -> macro -> syn");
    assert_eq!(ways(&graph)["b"], "cli -> b");
}

#[test]
fn val_every_file_by_others_has_its_licence() {
    let rules = rules();
    let root = sastrugi_fixtures::workspace_root();
    let named: BTreeSet<&String> =
        rules.shipped.iter().flat_map(|shipped| shipped.files.iter().chain(&shipped.text)).collect();
    for file in &named {
        assert!(root.join(file).is_file(), "{RULES} names {file}, which is absent");
    }
    for folder in FOLDERS {
        for entry in fs::read_dir(root.join(folder)).unwrap().map(Result::unwrap) {
            let file = format!("{folder}/{}", entry.file_name().to_string_lossy());
            let is_ours = [".md", ".py"].iter().any(|end| file.ends_with(end));
            assert!(
                is_ours || named.contains(&file),
                "{file}: who made it, and under which licence? Say it in {RULES}"
            );
        }
    }
}

/// The licence of a crate may leave out the libraries that it carries: whoever finds their terms has to say what they cover.
#[test]
fn val_terms_inside_linked_crates_are_known() {
    let rules = rules();
    let graph = graph();
    let mut unknown = Vec::new();
    for package in linked(&graph) {
        for file in terms(&package.folder).iter().filter(|file| file.contains('/')) {
            let path = format!("{}/{file}", package.name);
            let is_inside = rules.inside.iter().any(|i| i.package == package.name && i.file == *file);
            let is_known = is_inside || rules.not_linked.iter().any(|start| path.starts_with(start));
            unknown.extend((!is_known).then_some(path));
        }
    }
    assert!(
        unknown.is_empty(),
        "is what these cover linked? Say it in {RULES}, as `inside` or `not_linked`: {unknown:?}"
    );
}
