//! The same study gives the same bytes with any number of threads, in any shards, after kills, and on any x86-64 CPU.

#![allow(clippy::unwrap_used, reason = "a test may end where it stands")]

#[cfg(target_arch = "x86_64")]
mod emulated;
mod every_stage;
mod offline;

use every_stage::EveryStage;
use sastrugi_tests::{
    area, differing, program, routed_study, run_in_shards, run_with_kills, sastrugi_in, sums, textured_study, write,
};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

fn run(folder: &Path, arguments: &[&str]) -> BTreeMap<String, String> {
    let mut all = vec!["run", "study.toml", "-o", "release", "--quiet"];
    all.extend(arguments);
    let call = sastrugi_in(folder, &all);
    assert_eq!(call.code, 0, "{}", call.stderr);
    sums(&folder.join("release"))
}

fn run_fresh(study: &str, arguments: &[&str]) -> BTreeMap<String, String> {
    let folder = area();
    write(folder.path(), "study.toml", study);
    run(folder.path(), arguments)
}

fn assert_same(a: &BTreeMap<String, String>, b: &BTreeMap<String, String>, what: &str) {
    assert!(a.len() > 20, "the release holds files");
    assert_eq!(differing(a, b), Vec::<String>::new(), "{what}");
}

#[test]
fn gold_threads_change_nothing() {
    let one = run_fresh(&routed_study(), &["--threads", "1"]);
    for threads in ["2", "8"] {
        assert_same(&one, &run_fresh(&routed_study(), &["--threads", threads]), threads);
    }
}

/// More teams and rovers than are run at once on one thread, and fewer than on 48.
#[test]
fn gold_teams_and_rovers_that_run_one_after_another_change_nothing() {
    let study = include_str!("many_runs.toml");
    let one = run_fresh(study, &["--threads", "1"]);
    assert_same(&one, &run_fresh(study, &["--threads", "48"]), "48 threads");
}

/// Textures that repeat a site: from stored statistics and from the DEM.
#[test]
fn gold_threads_and_shards_change_no_texture_of_a_site() {
    let one = run_fresh(&textured_study(), &["--threads", "1"]);
    assert_same(&one, &run_fresh(&textured_study(), &["--threads", "2"]), "two threads");
    let folder = area();
    write(folder.path(), "study.toml", &textured_study());
    assert_same(&one, &run_in_shards(folder.path(), "study.toml"), "shards");
}

#[test]
fn gold_shards_change_nothing() {
    let whole = run_fresh(&routed_study(), &[]);
    for count in [1, 3] {
        let folder = area();
        write(folder.path(), "study.toml", &routed_study());
        let mut merge = vec!["merge".to_owned()];
        for index in 1..=count {
            let (shard, part) = (format!("{index}/{count}"), format!("part{index}"));
            let arguments = ["run", "study.toml", "-o", &part, "--shard", &shard, "--quiet"];
            let call = sastrugi_in(folder.path(), &arguments);
            assert_eq!(call.code, 0, "{}", call.stderr);
            merge.push(part);
        }
        merge.extend(["-o", "release", "--quiet"].map(str::to_owned));
        let arguments: Vec<&str> = merge.iter().map(String::as_str).collect();
        let call = sastrugi_in(folder.path(), &arguments);
        assert_eq!(call.code, 0, "{}", call.stderr);
        assert_same(&whole, &sums(&folder.path().join("release")), "shards");
    }
}

/// Kills at times spread over the run (they need no seed: any times must do).
#[test]
fn gold_kills_change_nothing() {
    let whole = run_fresh(&routed_study(), &[]);
    let folder = area();
    let pauses_ms = [5, 40, 80, 120, 170, 230, 300, 380, 470, 570, 700, 900];
    assert_same(&whole, &run_with_kills(folder.path(), &routed_study(), &whole, &pauses_ms), "after kills");
    let left: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| !["release", "release.work", "study.toml"].contains(&name.as_str()))
        .collect();
    assert_eq!(left, Vec::<String>::new(), "nothing half-written stays");
}

/// The complete published traversal study: 1, 2 and 8 threads, and killed while it generates terrains, drives and (on most machines with two
/// cores) assembles the release: after shares of the time that two threads take, which add up to just less than all of it.
#[test]
#[ignore = "slow: ./test --full"]
fn gold_the_traversal_study_is_the_same_everywhere() {
    let study = std::fs::read_to_string(sastrugi_fixtures::study("majhor_2024.toml")).unwrap();
    let one = run_fresh(&study, &["--threads", "1"]);
    assert_same(&one, &run_fresh(&study, &["--threads", "8"]), "8 threads");
    let start = Instant::now();
    assert_same(&one, &run_fresh(&study, &["--threads", "2"]), "2 threads");
    let whole_ms = start.elapsed().as_millis() as u64;
    let pauses_ms = [19, 38, 41].map(|percent| percent * whole_ms / 100);
    assert_same(&one, &run_with_kills(area().path(), &study, &one, &pauses_ms), "after kills");
}

/// glibc is told that the CPU has neither FMA nor AVX2: its mathematical functions then change bits, ours must not.
/// Transforms, phases and contacts query the CPU directly, which this does not reach; `emulated.rs` compares whole releases without wide vectors.
#[test]
fn gold_the_cpu_changes_nothing() {
    let study = EveryStage::new();
    let plain = study.release("plain", &mut Command::new(program()));
    let narrow = ("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-FMA,-AVX2");
    let masked = study.release("masked", Command::new(program()).env(narrow.0, narrow.1));
    assert_same(&plain, &masked, "without FMA and AVX2");
}

/// Random streams are named by id, so one more terrain changes no artifact of the others.
#[test]
fn gold_an_added_terrain_changes_no_other_byte() {
    let folder = area();
    write(folder.path(), "study.toml", &routed_study());
    let before = run(folder.path(), &[]);
    let added = "[[terrain]]\nid = \"added\"\nkind = \"weierstrass_mandelbrot\"\nsize_px = [64, 64]\n\n[[terrain]]\nid = \"smooth\"";
    write(folder.path(), "study.toml", &routed_study().replacen("[[terrain]]\nid = \"smooth\"", added, 1));
    let plan = sastrugi_in(folder.path(), &["plan", "study.toml", "--json"]);
    let plan: serde_json::Value = serde_json::from_str(&plan.stdout).unwrap();
    let stale: Vec<&str> = plan["stale"].as_array().unwrap().iter().filter_map(|s| s["item"].as_str()).collect();
    assert_eq!(stale, ["terrain/added", "roughness/added"]);
    let after = run(folder.path(), &[]);
    let of_items = ["dem/", "terrain/", "classes/", "fit/", "texture/", "mcap/"];
    let changed: Vec<String> = differing(&before, &after)
        .into_iter()
        .filter(|p| of_items.iter().any(|folder| p.starts_with(folder)) && !p.contains("added"))
        .collect();
    assert_eq!(changed, Vec::<String>::new());
    assert!(after.contains_key("terrain/added.tif"));
}

/// A run of an edited study drops the results that it no longer needs, from the release and from the work area.
#[test]
fn gold_an_edited_study_drops_its_orphans() {
    let folder = area();
    write(folder.path(), "study.toml", &routed_study());
    let before = run(folder.path(), &[]);
    let work = folder.path().join("release.work/items/terrain/rough-0002");
    let kept = || std::fs::read_dir(&work).map_or(0, Iterator::count);
    let of_dropped = |sums: &BTreeMap<String, String>| sums.keys().filter(|p| p.contains("rough-0002")).count();
    assert!(of_dropped(&before) > 0 && kept() > 0, "{:?}", before.keys());
    write(folder.path(), "study.toml", &routed_study().replace("count = 2\n", "count = 1\n"));
    let after = run(folder.path(), &[]);
    assert_eq!((of_dropped(&after), kept()), (0, 0));
    assert_same(&after, &run_fresh(&routed_study().replace("count = 2\n", "count = 1\n"), &[]), "edited or fresh");
}
