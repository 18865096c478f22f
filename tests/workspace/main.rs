//! The rooms: who may import whom, as `docs/ARCHITECTURE.md` states it. Licences of what others made, pages whose commands are followed, and links.

#![allow(clippy::unwrap_used, reason = "a test may fail where it stands")]

mod licences;
mod notice;
mod pages;
mod walk;

use sastrugi_tests::{area, called};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

/// Rooms, and what each may import; `any` is one of these words.
type Rules = BTreeMap<String, BTreeSet<String>>;

/// Rooms whose dependencies on external crates are free: they check or measure what the others do.
const OBSERVERS: [&str; 2] = ["tests", "benches"];

/// The code blocks of ARCHITECTURE with arrows, the first of rooms, the second of external crates: `a, b -> c, d` on each line.
fn rules() -> [Rules; 2] {
    let page = std::fs::read_to_string(sastrugi_fixtures::workspace_root().join("docs/ARCHITECTURE.md")).unwrap();
    let section = page.split("Who may import whom").nth(1).unwrap().split("\n## ").next().unwrap();
    let blocks: Vec<Rules> = section.split("```").skip(1).step_by(2).map(block).collect();
    blocks.try_into().unwrap_or_else(|blocks: Vec<Rules>| panic!("{} blocks of rules, not 2", blocks.len()))
}

fn block(text: &str) -> Rules {
    let names = |list: &str| -> BTreeSet<String> { list.split(',').map(|name| name.trim().to_owned()).collect() };
    let mut rules = Rules::new();
    for line in text.trim().lines() {
        let (rooms, uses) = line.split_once("->").unwrap_or_else(|| panic!("{line}: no arrow"));
        for room in names(rooms) {
            assert!(rules.insert(room.clone(), names(uses)).is_none(), "{room} has two lines");
        }
    }
    rules
}

/// A direct dependency of a room.
struct Dependency {
    room: String,
    on: String,
    is_dev: bool,
}

/// The rooms of the workspace and their dependencies.
fn workspace() -> (BTreeSet<String>, Vec<Dependency>) {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(sastrugi_fixtures::workspace_root())
        .output()
        .unwrap();
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let mut rooms = BTreeSet::new();
    let mut dependencies = Vec::new();
    for package in metadata["packages"].as_array().unwrap() {
        let room = package["name"].as_str().unwrap().trim_start_matches("sastrugi-").to_owned();
        rooms.insert(room.clone());
        for dependency in package["dependencies"].as_array().unwrap() {
            let on = dependency["name"].as_str().unwrap().to_owned();
            dependencies.push(Dependency {
                room: room.clone(),
                on,
                is_dev: dependency["kind"].as_str() == Some("dev"),
            });
        }
    }
    (rooms, dependencies)
}

/// Dependencies that the rules do not allow, as `room -> crate`.
fn violations(dependencies: &[Dependency], [rooms, sole]: &[Rules; 2]) -> Vec<String> {
    let allows = |dependency: &Dependency| match dependency.on.strip_prefix("sastrugi-") {
        Some(other) => {
            let may = &rooms[&dependency.room];
            let may_in_tests = dependency.is_dev && rooms["dev-dependencies of any room"].contains(other);
            may.contains("any") || may.contains(other) || may_in_tests
        }
        None => {
            let mut owners = sole.iter().filter(|(_, crates)| crates.contains(&dependency.on)).peekable();
            let is_free = OBSERVERS.contains(&dependency.room.as_str()) || owners.peek().is_none();
            is_free || owners.any(|(room, _)| *room == dependency.room)
        }
    };
    dependencies.iter().filter(|d| !allows(d)).map(|d| format!("{} -> {}", d.room, d.on)).collect()
}

#[test]
fn val_rooms_import_only_what_architecture_allows() {
    let (rooms, dependencies) = workspace();
    let rules = rules();
    let named: BTreeSet<&String> = rules[0].keys().filter(|room| !room.contains(' ')).collect();
    assert_eq!(named, rooms.iter().collect(), "rooms of ARCHITECTURE and of the workspace");
    assert_eq!(violations(&dependencies, &rules), Vec::<String>::new());
}

/// Every rule about an external crate is about one that is used; the rules would refuse the contrary of what they say.
#[test]
fn val_the_rules_can_be_broken() {
    let (_, dependencies) = workspace();
    let rules = rules();
    for (room, crates) in &rules[1] {
        for name in crates {
            assert!(dependencies.iter().any(|d| d.room == *room && d.on == *name), "{room} does not use {name}");
        }
    }
    let broken = [
        ("numeric", "sastrugi-store", false),
        ("terrain", "sastrugi-texture", true),
        ("report", "parquet", false),
        ("stages", "tokio", false),
    ];
    for (room, on, is_dev) in broken {
        let dependency = Dependency { room: room.to_owned(), on: on.to_owned(), is_dev };
        assert_eq!(violations(&[dependency], &rules), [format!("{room} -> {on}")]);
    }
}

/// Every package that `cargo run` builds, with its features, is one that the tests build too: a checkout that has done one does not
/// compile it again for the other.
#[test]
fn val_run_and_test_share_one_build() {
    let packages = |selection: &[&str]| -> BTreeSet<String> {
        let output = Command::new(env!("CARGO"))
            .args(["tree", "--offline", "--prefix", "none", "--format", "{p} [{f}]", "--edges"])
            .args(selection)
            .current_dir(sastrugi_fixtures::workspace_root())
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).unwrap();
        text.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).filter(|line| !line.is_empty()).collect()
    };
    let of_run = packages(&["normal,build", "--package", "sastrugi-cli"]);
    assert!(of_run.len() > 100, "{}", of_run.len());
    let of_tests = packages(&["normal,build,dev", "--workspace"]);
    let again: Vec<&String> = of_run.difference(&of_tests).collect();
    assert!(
        again.is_empty(),
        "name them in pipeline/cli/Cargo.toml, with the features that the tests ask for: {again:#?}"
    );
}

/// `fuzz/` is a workspace of its own; it exercises the versions that the program ships.
#[test]
fn val_fuzz_targets_use_the_locked_versions() {
    let versions = |file: &str| -> BTreeSet<(String, String)> {
        let text = std::fs::read_to_string(sastrugi_fixtures::workspace_root().join(file)).unwrap();
        let value = |line: &str, key: &str| line.strip_prefix(key).map(|rest| rest.trim_matches('"').to_owned());
        let lines: Vec<&str> = text.lines().collect();
        let pair = |w: &[&str]| Some((value(w[0], "name = ")?, value(w[1], "version = ")?));
        lines.windows(2).filter_map(pair).collect()
    };
    let ours = versions("Cargo.lock");
    let names: BTreeSet<&String> = ours.iter().map(|(name, _)| name).collect();
    let fuzz = versions("fuzz/Cargo.lock");
    assert!(fuzz.len() > 100, "{}", fuzz.len());
    let other: Vec<_> = fuzz.iter().filter(|pair| names.contains(&pair.0) && !ours.contains(*pair)).collect();
    assert!(other.is_empty(), "copy Cargo.lock to fuzz/ and run `cargo update --workspace` there: {other:?}");
}

/// Every fuzz target is built by `fuzz/run`, starts from a seed, and has a row that states what it has run.
#[test]
fn val_every_fuzz_target_has_seeds_and_a_row() {
    let root = sastrugi_fixtures::workspace_root();
    let text = |file: &str| std::fs::read_to_string(root.join(file)).unwrap();
    let below = |folder: &str| -> BTreeSet<String> {
        let entries = std::fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap().path());
        entries.map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned()).collect()
    };
    let targets = below("fuzz/targets");
    assert!(targets.len() > 10, "{targets:?}");
    let manifest = text("fuzz/Cargo.toml");
    let built = manifest.split("[[bin]]").skip(1).map(|bin| bin.split('"').nth(1).unwrap().to_owned());
    assert_eq!(built.collect::<BTreeSet<_>>(), targets);
    for target in &targets {
        assert!(std::fs::read_dir(root.join("fuzz/seeds").join(target)).unwrap().next().is_some(), "{target}");
    }
    let page = text("CONTRIBUTING.md");
    let (_, table) = page.split_once("| target | reads |").unwrap();
    let rows = table
        .lines()
        .skip(2)
        .map_while(|line| line.strip_prefix("| `"))
        .map(|row| row.split('`').next().unwrap().to_owned());
    assert_eq!(rows.collect::<BTreeSet<_>>(), targets);
}

/// The build script of `stages` leaves modules of this name out of the revisions in cache keys.
#[test]
fn val_modules_named_tests_are_compiled_for_tests_only() {
    let root = sastrugi_fixtures::workspace_root();
    let listed = Command::new("git").args(["ls-files", "*.rs"]).current_dir(&root).output().unwrap();
    let listed = String::from_utf8(listed.stdout).unwrap();
    let mut count = 0;
    for file in listed.lines() {
        // A file that was deleted and not committed is still listed.
        let text = std::fs::read_to_string(root.join(file)).unwrap_or_default();
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        for pair in lines.windows(2).filter(|pair| ["mod tests;", "pub mod tests;", "mod tests {"].contains(&pair[1])) {
            assert_eq!(pair[0], "#[cfg(test)]", "{file}");
            count += 1;
        }
    }
    assert!(count > 100, "{count}");
}

/// Without a browser, `.ci/look` says that it looked at nothing, and fails where a page was to be looked at.
#[test]
fn val_a_look_without_a_browser_fails_if_it_is_wanted() {
    let path = area();
    let found = called(Command::new("bash").args(["-c", "command -v bash dirname"]));
    for program in found.stdout.lines().map(Path::new) {
        std::os::unix::fs::symlink(program, path.path().join(program.file_name().unwrap())).unwrap();
    }
    let script = sastrugi_fixtures::workspace_root().join(".ci/look");
    let look = |reports: &[&str], wanted: &str| {
        let mut bash = Command::new(path.path().join("bash"));
        called(bash.arg(&script).args(reports).env("PATH", path.path()).env("LOOK", wanted))
    };
    let words = "no Chromium is on the path, so no page was looked at";
    let skipped = look(&[], "");
    assert!(skipped.code == 0 && skipped.stdout.starts_with(&format!("SKIPPED: {words}")), "{}", skipped.stdout);
    for call in [look(&["report"], ""), look(&[], "required")] {
        assert!(call.code == 1 && call.stderr.contains(words), "{} {}", call.code, call.stderr);
    }
}
