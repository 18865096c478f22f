//! What the program prints, frozen: the help of every verb and the text of common calls. Refresh, after looking at the difference, with
//! `INSTA_UPDATE=always cargo test --release --workspace --test cli snapshots`.

use sastrugi_tests::{area, sastrugi_in, write};
use std::path::Path;

/// Two terrains, two missions on each: less than a second.
const STUDY: &str = r#"
[study]
name = "small"
seed = 7
date = "2026-01-01"
license = "CC0-1.0"
creators = ["Doe, Jane"]

[[terrain]]
id = "a"
kind = "weierstrass_mandelbrot"
size_px = [64, 64]
cell_m = 0.2
elevation_scale_m = 1e-9
count = 2

[[missions]]
id = "m"
terrains = ["a"]
count = 2
length_m = 4.0
border_m = 1.5

[[traverse]]
id = "t"
missions = "m"
vehicle = "husky_a200"
"#;

/// Units that follow what changes from run to run or with every change of the code: times, sizes of files and memory.
const UNSTEADY: [&str; 7] = ["s", "s,", "kB", "kB,", "MB", "bytes", "bytes,"];

/// A line with those numbers, and checksums, masked.
fn steady(line: &str) -> String {
    if line.starts_with("bytes  ") {
        return "bytes  _".to_owned();
    }
    let words: Vec<&str> = line.split(' ').collect();
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    let masked = |(i, word): (usize, &&str)| {
        let is_unsteady = is_number(word) && words.get(i + 1).is_some_and(|next| UNSTEADY.contains(next));
        let is_sum = word.len() == 64 && word.bytes().all(|b| b.is_ascii_hexdigit());
        if is_unsteady || is_sum { "_".to_owned() } else { (*word).to_owned() }
    };
    words.iter().enumerate().map(masked).collect::<Vec<_>>().join(" ")
}

/// Exit code, standard output and standard error of a call, as one text.
fn printed(folder: &Path, line: &str) -> String {
    let call = sastrugi_in(folder, &line.split(' ').collect::<Vec<_>>());
    let text = format!("$ sastrugi {line}\n{}{}[exit code {}]\n", call.stdout, call.stderr, call.code);
    // Which items are reported as done, and how many of them, depends on the time that they take.
    let is_progress = |line: &&str| line.split_once("/8 items, ").is_some_and(|(done, _)| done.parse::<u32>().is_ok());
    text.lines().filter(|line| !is_progress(line)).map(|line| format!("{}\n", steady(line))).collect()
}

#[test]
fn val_only_unsteady_numbers_are_masked() {
    let line = format!("rel: 8 items, 0.6 s, 64 files, 778.3 kB, 0.2 m, 40 bytes {}", "0a".repeat(32));
    assert_eq!(steady(&line), "rel: 8 items, _ s, 64 files, _ kB, 0.2 m, _ bytes _");
}

#[test]
fn gold_help_of_every_verb() {
    let folder = area();
    let help = printed(folder.path(), "--help");
    let verbs: Vec<&str> = help
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"))
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(verbs.contains(&"run") && verbs.contains(&"serve"), "{verbs:?}");
    insta::assert_snapshot!("help", help);
    for verb in verbs.into_iter().filter(|verb| *verb != "help") {
        insta::assert_snapshot!(format!("help_{verb}"), printed(folder.path(), &format!("{verb} --help")));
    }
}

/// One study from plan to archive.
#[test]
fn gold_a_study_from_plan_to_archive() {
    let folder = area();
    let path = folder.path();
    write(path, "study.toml", STUDY);
    let calls = [
        "plan study.toml",
        "run study.toml",
        "plan study.toml",
        "info release",
        "verify release",
        "compare release release",
        "pack release -o release.tar",
        "report release -o page",
    ];
    insta::assert_snapshot!("study", calls.map(|call| printed(path, call)).join("\n"));
}

/// One DEM from heights to fit, texture and route.
#[test]
fn gold_a_dem_from_heights_to_route() {
    let folder = area();
    let path = folder.path();
    let calls = [
        "terrain ornstein_uhlenbeck --seed 3 --set size_px=[128,128] --set cell_m=0.1 -o a.tif",
        "info a.tif",
        "roughness a.tif",
        "fit a.tif --outer-scale 2 --bootstrap 39 -o fit.json",
        "texture fit.json --size 8x8 --cell 0.1 --seed 1 -o b.tif",
        "compare fit.json fit.json",
        "hillshade a.tif -o a.png",
        "convert a.tif a.asc",
        "navigate a.tif --start 2,2 --goal 10,10 -o route.geojson",
    ];
    insta::assert_snapshot!("dem", calls.map(|call| printed(path, call)).join("\n"));
}

/// Lists, schemas, and a study with three mistakes.
#[test]
fn gold_lists_and_refusals() {
    let folder = area();
    let path = folder.path();
    write(
        path,
        "bad.toml",
        &STUDY.replace("seed = 7", "sed = 7").replace("husky_a200", "husky").replace("count = 2\n", "count = 0\n"),
    );
    let calls = [
        "kinds",
        "kinds husky_a200",
        "kinds multifractal",
        "schema missions",
        "init -o new.toml",
        "plan bad.toml",
        "run absent.toml",
    ];
    insta::assert_snapshot!("lists", calls.map(|call| printed(path, call)).join("\n"));
}
