//! The rooms: who may import whom, as docs/ARCHITECTURE.md states it.

#![allow(clippy::unwrap_used, reason = "a test may end where it stands")]

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// `docs/ARCHITECTURE.md`, "Who may import whom", as data.
fn allowed() -> BTreeMap<&'static str, BTreeSet<&'static str>> {
    let stages = "schemas numeric roughness statistics terrain texture mobility navigation imaging store report";
    let table = [
        ("schemas", ""),
        ("numeric", ""),
        ("roughness", "numeric"),
        ("statistics", "numeric"),
        ("terrain", "numeric schemas roughness"),
        ("texture", "numeric schemas roughness statistics"),
        ("mobility", "numeric schemas roughness statistics"),
        ("navigation", "numeric schemas roughness statistics"),
        ("imaging", "numeric schemas"),
        ("store", "numeric schemas"),
        ("report", "statistics store imaging numeric schemas"),
        ("stages", stages),
        ("server", "stages terrain imaging store numeric schemas"),
        ("cli", "stages server report store schemas"),
        ("fixtures", "numeric"),
        ("tests", "schemas numeric statistics terrain mobility imaging store stages server fixtures"),
        (
            "benches",
            "schemas numeric roughness statistics terrain texture mobility navigation imaging store stages report fixtures",
        ),
    ];
    table.into_iter().map(|(room, uses)| (room, uses.split_whitespace().collect())).collect()
}

/// Crates that only one room may name.
const SOLE_USERS: [(&str, &str); 18] = [
    ("arrow-array", "store"),
    ("arrow-schema", "store"),
    ("parquet", "store"),
    ("mcap", "store"),
    ("foxglove", "store"),
    ("prost", "store"),
    ("geotiff-reader", "store"),
    ("geotiff-writer", "store"),
    ("tiff", "store"),
    ("tar", "store"),
    ("axum", "server"),
    ("hyper", "server"),
    ("tokio", "server"),
    ("tower-http", "server"),
    ("ureq", "server"),
    ("clap", "cli"),
    ("indicatif", "cli"),
    ("miette", "cli"),
];

/// Direct dependencies of each room: `(room, dependency, is a dev-dependency)`.
fn dependencies() -> Vec<(String, String, bool)> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(sastrugi_fixtures::workspace_root())
        .output()
        .unwrap();
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let mut all = Vec::new();
    for package in metadata["packages"].as_array().unwrap() {
        let room = package["name"].as_str().unwrap().trim_start_matches("sastrugi-").to_owned();
        for dependency in package["dependencies"].as_array().unwrap() {
            let name = dependency["name"].as_str().unwrap().to_owned();
            all.push((room.clone(), name, dependency["kind"].as_str() == Some("dev")));
        }
    }
    all
}

#[test]
fn val_rooms_import_only_what_they_may() {
    let allowed = allowed();
    let mut wrong = Vec::new();
    for (room, dependency, dev) in dependencies() {
        let Some(other) = dependency.strip_prefix("sastrugi-") else { continue };
        let may = allowed.get(room.as_str()).unwrap_or_else(|| panic!("room {room} is not in the table"));
        let dev_may = dev && ["statistics", "fixtures"].contains(&other);
        if !may.contains(other) && !dev_may {
            wrong.push(format!("{room} -> {other}"));
        }
    }
    assert_eq!(wrong, Vec::<String>::new());
}

#[test]
fn val_file_formats_and_terminals_have_one_room() {
    let wrong: Vec<String> = dependencies()
        .into_iter()
        .filter(|(room, _, _)| !["benches", "tests"].contains(&room.as_str()))
        .filter(|(room, name, _)| SOLE_USERS.iter().any(|(krate, user)| krate == name && user != room))
        .map(|(room, name, _)| format!("{room} -> {name}"))
        .collect();
    assert_eq!(wrong, Vec::<String>::new());
}
