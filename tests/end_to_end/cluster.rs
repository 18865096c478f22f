//! Shards that share a cache: each item is computed once, and the merged release is the one of a single machine, byte for byte.

use sastrugi_tests::{Called, area, called, differing, program, run_study, sastrugi_in, small_study, sums, write};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const SHARDS: u64 = 3;

/// Items of the small study.
const ITEMS: u64 = 19;

/// A call that must succeed; its JSON.
fn json(folder: &Path, arguments: &[&str]) -> Value {
    let call = sastrugi_in(folder, &[arguments, &["--json", "--quiet"]].concat());
    assert_eq!(call.code, 0, "{arguments:?}: {}", call.stderr);
    serde_json::from_str(&call.stdout).unwrap()
}

fn computed(summary: &Value) -> u64 {
    summary["computed"].as_u64().unwrap()
}

/// Runs one shard; returns its JSON.
fn shard(folder: &Path, index: u64, more: &[&str]) -> Value {
    let (part, output) = (format!("{index}/{SHARDS}"), format!("part-{index}"));
    json(folder, &[&["run", "study.toml", "--shard", &part, "-o", &output], more].concat())
}

fn merge(folder: &Path) -> Called {
    sastrugi_in(folder, &["merge", "part-1", "part-2", "part-3", "-o", "merged", "--quiet"])
}

fn merged(folder: &Path) -> BTreeMap<String, String> {
    let call = merge(folder);
    assert_eq!(call.code, 0, "{}", call.stderr);
    sums(&folder.join("merged"))
}

/// The folders of the entries of a cache, sorted.
fn entries(cache: &Path) -> Vec<PathBuf> {
    let below = |folder: PathBuf| fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
    let mut entries: Vec<PathBuf> = below(cache.join("entries")).into_iter().flat_map(below).collect();
    entries.sort();
    entries
}

fn drafts(cache: &Path) -> usize {
    fs::read_dir(cache.join("drafts")).unwrap().count()
}

/// Common ancestors once, then the shards: together they compute every item exactly once. Without the cache they compute more.
#[test]
fn val_shards_with_a_shared_cache_compute_each_item_once() {
    let folder = area();
    let path = folder.path();
    let whole = run_study(path, &small_study(), &[]);

    let division = json(path, &["plan", "study.toml", "--shards", "3"]);
    let shards = division["shards"].as_array().unwrap();
    assert_eq!(shards.iter().map(|s| s["own"].as_u64().unwrap()).sum::<u64>(), ITEMS);
    assert_eq!(division["study"]["items"], ITEMS);
    let planned: u64 = shards.iter().map(|s| s["needed"]["items"].as_u64().unwrap()).sum();

    let alone: u64 = (1..=SHARDS).map(|index| computed(&shard(path, index, &[]))).sum();
    assert_eq!(alone, planned, "the plan states what the shards compute without a cache");
    assert_eq!(differing(&whole, &merged(path)), [""; 0]);
    (1..=SHARDS).for_each(|index| fs::remove_dir_all(path.join(format!("part-{index}.work"))).unwrap());

    let ancestors = json(path, &["run", "study.toml", "--ancestors", "3", "--cache", "cache", "--work", "ancestors"]);
    assert_eq!(computed(&ancestors), division["common_ancestors"]["items"].as_u64().unwrap());
    assert!(computed(&ancestors) > 0 && alone > ITEMS, "{alone}");
    let shared: Vec<Value> = (1..=SHARDS).map(|index| shard(path, index, &["--cache", "cache"])).collect();
    let by_shards: Vec<u64> = shared.iter().map(computed).collect();
    let left: Vec<u64> = shards.iter().map(|s| s["left"]["items"].as_u64().unwrap()).collect();
    assert_eq!(by_shards, left, "the plan states what is left");
    assert_eq!(computed(&ancestors) + by_shards.iter().sum::<u64>(), ITEMS);
    assert_eq!(differing(&whole, &merged(path)), [""; 0]);
    assert_eq!((entries(&path.join("cache")).len() as u64, drafts(&path.join("cache"))), (ITEMS, 0));

    // One machine with this cache computes nothing, and gives the same bytes.
    let again = json(path, &["run", "study.toml", "-o", "again", "--cache", "cache"]);
    assert_eq!((computed(&again), again["cache"]["fetched"].as_u64()), (0, Some(ITEMS)));
    assert_eq!(differing(&whole, &sums(&path.join("again"))), [""; 0]);
}

/// Items that each shard of the quick start computes, and the time it takes, without and with a shared cache. Prints the rows of a table in
/// `docs/cluster.md`.
#[test]
#[ignore = "slow: runs the quick start in shards, twice"]
fn val_a_shared_cache_saves_the_common_ancestors() {
    let folder = area();
    let path = folder.path();
    let study = sastrugi_fixtures::workspace_root().join("fixtures/studies/quickstart.toml");
    let study = study.to_str().unwrap();
    let timed = |arguments: &[&str]| {
        let start = Instant::now();
        let summary = json(path, arguments);
        (computed(&summary), start.elapsed().as_secs_f64())
    };
    let shards = |name: &str, more: &[&str]| -> Vec<(u64, f64)> {
        let shard = |index| {
            let (part, output) = (format!("{index}/{SHARDS}"), format!("{name}-{index}"));
            timed(&[&["run", study, "--shard", &part, "-o", &output], more].concat())
        };
        (1..=SHARDS).map(shard).collect()
    };
    let sealed = |name: &str| {
        let parts: Vec<String> = (1..=SHARDS).map(|index| format!("{name}-{index}")).collect();
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        let call = sastrugi_in(path, &[&["merge", "-o", name, "--quiet"], &parts[..]].concat());
        assert_eq!(call.code, 0, "{}", call.stderr);
        sums(&path.join(name))
    };

    let alone = shards("alone", &[]);
    let ancestors = timed(&["run", study, "--ancestors", "3", "--cache", "cache", "--work", "ancestors"]);
    let shared = shards("shared", &["--cache", "cache"]);
    println!("| ancestors | | | {} | {:.0} s |", ancestors.0, ancestors.1);
    for (index, (before, after)) in alone.iter().zip(&shared).enumerate() {
        println!("| shard {} | {} | {:.0} s | {} | {:.0} s |", index + 1, before.0, before.1, after.0, after.1);
    }
    let sum =
        |shards: &[(u64, f64)]| shards.iter().fold((0_u64, 0.0_f64), |sum, shard| (sum.0 + shard.0, sum.1 + shard.1));
    let (before, after) = (sum(&alone), sum(&[&shared[..], &[ancestors]].concat()));
    println!("| all | {} | {:.0} s | {} | {:.0} s |", before.0, before.1, after.0, after.1);

    let items = json(path, &["plan", study, "--shards", "3"])["study"]["items"].as_u64().unwrap();
    assert_eq!(after.0, items, "each item is computed once");
    assert!(before.0 > items, "{}: the shards have no common ancestors", before.0);
    assert_eq!(differing(&sealed("alone"), &sealed("shared")), [""; 0]);
}

/// Starts a call in the background.
fn start(folder: &Path, arguments: &[&str]) -> Child {
    let mut command = Command::new(program());
    command.args(arguments).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().unwrap()
}

/// A shard that is killed several times, after it has published an item, goes on where it was; the others find what it had published.
#[test]
fn val_a_killed_shard_resumes() {
    let folder = area();
    let path = folder.path();
    let whole = run_study(path, &small_study(), &[]);
    let call = ["run", "study.toml", "--shard", "1/3", "-o", "part-1", "--cache", "cache", "--threads", "1", "--quiet"];
    let published = || {
        let is_there = path.join("cache/entries").is_dir();
        if is_there { entries(&path.join("cache")).len() } else { 0 }
    };
    for count in 1..=3 {
        let mut child = start(path, &call);
        while published() < count && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(2));
        }
        child.kill().and_then(|()| child.wait()).unwrap();
    }
    let before = published();
    let last = shard(path, 1, &["--cache", "cache"]);
    let ready = last["items"].as_u64().unwrap() - computed(&last);
    assert!(
        before > 0 && ready as usize >= before,
        "{before} entries were published, and {ready} items were not computed again"
    );
    shard(path, 2, &["--cache", "cache"]);
    shard(path, 3, &["--cache", "cache"]);
    assert_eq!(differing(&whole, &merged(path)), [""; 0]);
    // A cache without the work area of the killed shard serves as well: a requeued job may start on another machine.
    fs::remove_dir_all(path.join("part-1.work")).unwrap();
    assert_eq!(computed(&shard(path, 1, &["--cache", "cache"])), 0);
}

/// All shards and an undivided run, at the same time on one cache.
#[test]
fn val_runs_share_a_cache_at_the_same_time() {
    let folder = area();
    let path = folder.path();
    let whole = run_study(path, &small_study(), &[]);
    let mut children: Vec<Child> = (1..=SHARDS)
        .map(|index| {
            let (part, output) = (format!("{index}/{SHARDS}"), format!("part-{index}"));
            start(path, &["run", "study.toml", "--shard", &part, "-o", &output, "--cache", "cache", "--threads", "1"])
        })
        .collect();
    children.push(start(path, &["run", "study.toml", "-o", "again", "--cache", "cache", "--threads", "1"]));
    for child in &mut children {
        assert!(child.wait().unwrap().success());
    }
    assert_eq!(differing(&whole, &merged(path)), [""; 0]);
    assert_eq!(differing(&whole, &sums(&path.join("again"))), [""; 0]);
    assert_eq!((entries(&path.join("cache")).len() as u64, drafts(&path.join("cache"))), (ITEMS, 0));
}

/// Entries with a flipped byte, a lost file or half a record are computed again and replaced; the release is right.
#[test]
fn val_damaged_entries_are_never_used() {
    let folder = area();
    let path = folder.path();
    let whole = run_study(path, &small_study(), &["--cache", "cache"]);
    let damage = |(number, entry): (usize, &PathBuf)| {
        let files = fs::read_dir(entry).unwrap().map(|file| file.unwrap().path());
        let product = files.filter(|file| !file.ends_with("record.json")).min();
        match (number % 3, product) {
            (0, Some(product)) => {
                let mut bytes = fs::read(&product).unwrap();
                let middle = bytes.len() / 2;
                bytes[middle] ^= 0x10;
                fs::write(&product, bytes).unwrap();
            }
            (1, Some(product)) => fs::remove_file(&product).unwrap(),
            _ => {
                let record = fs::read(entry.join("record.json")).unwrap();
                fs::write(entry.join("record.json"), &record[..record.len() / 2]).unwrap();
            }
        }
    };
    let all = entries(&path.join("cache"));
    all.iter().step_by(2).enumerate().for_each(damage);
    let damaged = all.iter().step_by(2).count() as u64;
    let mended = json(path, &["run", "study.toml", "-o", "again", "--cache", "cache"]);
    assert_eq!(computed(&mended), damaged);
    assert_eq!(mended["cache"]["damaged"].as_array().unwrap().len() as u64, damaged);
    assert_eq!(differing(&whole, &sums(&path.join("again"))), [""; 0]);
    let intact = json(path, &["run", "study.toml", "-o", "third", "--cache", "cache"]);
    assert_eq!((computed(&intact), intact["cache"]["fetched"].as_u64()), (0, Some(ITEMS)));
    assert_eq!(differing(&whole, &sums(&path.join("third"))), [""; 0]);
}

/// A result of the ancestors that changed in their work area is computed and published by the same run, which needs no retry.
#[test]
fn val_changed_ancestors_are_computed_again() {
    let folder = area();
    let path = folder.path();
    write(path, "study.toml", &small_study());
    let ancestors = |cache| json(path, &["run", "study.toml", "--ancestors", "3", "--work", "work", "--cache", cache]);
    let all = computed(&ancestors("first"));
    assert!(all > 0);

    let below = |folder: PathBuf| fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let results = below(path.join("work/items")).flat_map(below).flat_map(below);
    let product = results.flat_map(below).filter(|file| !file.ends_with("record.json")).min().unwrap();
    let mut bytes = fs::read(&product).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&product, bytes).unwrap();
    let Value::Object(cache) = ancestors("second")["cache"].take() else { panic!("no cache") };
    let item = product.ancestors().nth(2).unwrap().strip_prefix(path.join("work/items")).unwrap();
    assert_eq!(cache["changed"], serde_json::json!([item.display().to_string()]));
    assert_eq!((cache["published"].as_u64(), &cache["problems"]), (Some(all), &serde_json::json!([])));
    assert_eq!(entries(&path.join("second")).len() as u64, all);
}

/// Another study finds what it has in common with the first, and its release is the one that it makes by itself.
#[test]
fn val_studies_share_what_they_have_in_common() {
    let folder = area();
    let path = folder.path();
    run_study(path, &small_study(), &["--cache", "cache"]);
    let other = small_study().replace("name = \"small\"", "name = \"other\"").replace("count = 3", "count = 2");
    write(path, "other.toml", &other);
    let shared = json(path, &["run", "other.toml", "-o", "shared", "--cache", "cache"]);
    assert!(computed(&shared) > 0 && shared["cache"]["fetched"].as_u64().unwrap() > 0, "{shared}");
    assert_eq!(computed(&json(path, &["run", "other.toml", "-o", "alone"])), ITEMS);
    assert_eq!(differing(&sums(&path.join("alone")), &sums(&path.join("shared"))), [""; 0]);
}

/// A cache that is only read is left as it is.
#[test]
fn val_a_cache_that_is_only_read() {
    let folder = area();
    let path = folder.path();
    let whole = run_study(path, &small_study(), &["--cache", "cache"]);
    fs::remove_dir_all(&entries(&path.join("cache"))[3]).unwrap();
    let before = entries(&path.join("cache"));
    let read = json(path, &["run", "study.toml", "-o", "again", "--cache", "cache", "--cache-read-only"]);
    assert_eq!((computed(&read), read["cache"]["read_only"].as_bool()), (1, Some(true)));
    assert_eq!(entries(&path.join("cache")), before);
    assert_eq!(differing(&whole, &sums(&path.join("again"))), [""; 0]);
    let refused = |more: &[&str], code: i32, words: &str| {
        let call = sastrugi_in(path, &[&["run", "study.toml", "-o", "new", "--quiet"], more].concat());
        assert!(call.code == code && call.stderr.contains(words), "{more:?}: {} {}", call.code, call.stderr);
        assert!(!path.join("new").exists());
    };
    refused(&["--cache-read-only"], 2, "--cache");
    // Ancestors go to the cache, not to a release.
    refused(&["--ancestors", "3", "--cache", "cache"], 2, "cannot be used with '--ancestors");
    refused(&["--cache", "nowhere", "--cache-read-only"], 65, "not a shared cache; the folder is missing or empty");
    refused(&["--cache", "release"], 2, "neither empty nor a shared cache");
    refused(&["--cache", "new/cache"], 2, "inside the output folder");
    assert!(!path.join("nowhere").exists());
}

/// While a program empties the cache again and again, shards compute what disappears.
#[test]
fn val_eviction_beside_running_shards() {
    let folder = area();
    let path = folder.path();
    let whole = run_study(path, &small_study(), &["--cache", "cache"]);
    let done = AtomicBool::new(false);
    let removed = std::thread::scope(|scope| {
        let evictor = scope.spawn(|| {
            let mut removed = 0;
            while !done.load(Ordering::Relaxed) {
                let pruned = json(path, &["cache", "cache", "--max-bytes", "1"]);
                removed += pruned["removed"].as_u64().unwrap();
            }
            removed
        });
        (1..=SHARDS).for_each(|index| drop(shard(path, index, &["--cache", "cache"])));
        done.store(true, Ordering::Relaxed);
        evictor.join().unwrap()
    });
    assert!(removed > ITEMS, "{removed}: nothing but the first entries was removed");
    assert_eq!(differing(&whole, &merged(path)), [""; 0]);
}

/// `cache` counts, removes by size and age, and creates nothing.
#[test]
fn val_a_cache_is_counted_and_pruned() {
    let folder = area();
    let path = folder.path();
    run_study(path, &small_study(), &["--cache", "cache"]);
    let all = json(path, &["cache", "cache"]);
    assert_eq!((all["entries"].as_u64(), all["removed"].as_u64()), (Some(ITEMS), Some(0)));
    let half = all["bytes"].as_u64().unwrap() / 2;
    let left = json(path, &["cache", "cache", "--max-bytes", &half.to_string()]);
    assert!(left["bytes"].as_u64().unwrap() <= half && left["removed"].as_u64().unwrap() > 0, "{left}");
    assert_eq!(left["entries"].as_u64().unwrap() + left["removed"].as_u64().unwrap(), ITEMS);
    assert_eq!(json(path, &["cache", "cache", "--max-age", "0"])["entries"], 0);
    assert_eq!(entries(&path.join("cache")).len(), 0);
    for (arguments, code) in [(["cache", "nowhere"], 65), (["cache", "release"], 2)] {
        assert_eq!(called(Command::new(program()).args(arguments).current_dir(path)).code, code);
    }
    assert!(!path.join("nowhere").exists());
}

/// A merge without a shard says what to run; once that has run, merging needs nothing else. Failed items are listed with their shard.
#[test]
fn val_merge_says_what_to_mend() {
    let folder = area();
    let path = folder.path();
    let whole = run_study(path, &small_study(), &[]);
    shard(path, 1, &["--cache", "cache"]);
    shard(path, 3, &["--cache", "cache"]);
    let call = merge(path);
    let advice =
        "part-2 is not a shard: it has no shard.json; shard 2 of 3 is missing; run the study again with `--shard 2/3`";
    assert!(call.code == 65 && call.stderr.contains(advice), "{} {}", call.code, call.stderr);
    let before = fs::metadata(path.join("part-1/shard.json")).unwrap().modified().unwrap();
    shard(path, 2, &["--cache", "cache"]);
    assert_eq!(differing(&whole, &merged(path)), [""; 0]);
    assert_eq!(fs::metadata(path.join("part-1/shard.json")).unwrap().modified().unwrap(), before);
    assert_eq!(differing(&whole, &merged(path)), [""; 0], "merging again gives the same");

    // A fit of a plane fails; nothing depends on it.
    let heights = ("1 ".repeat(60) + "\n").repeat(60);
    let head = "ncols 60\nnrows 60\nxllcorner 0\nyllcorner 0\ncellsize 1\n";
    write(path, "flat.asc", &(head.to_owned() + &heights));
    let flat = "\n[[dem]]\nid = \"flat\"\nfile = \"flat.asc\"\n\n[[fit]]\nid = \"plane\"\ndem = \"flat\"\nouter_scale_m = 9.0\n";
    write(path, "study.toml", &(small_study() + flat));
    let runs: Vec<Called> = (1..=SHARDS)
        .map(|index| {
            let (part, output) = (format!("{index}/{SHARDS}"), format!("part-{index}"));
            let call =
                ["run", "study.toml", "--shard", &part, "-o", &output, "--cache", "cache", "--replace", "--json"];
            sastrugi_in(path, &[&call[..], &["--quiet"]].concat())
        })
        .collect();
    let failed = runs.iter().position(|run| run.code == 3).unwrap() + 1;
    let call = sastrugi_in(path, &["merge", "part-1", "part-2", "part-3", "-o", "with-failure", "--quiet"]);
    assert_eq!(call.code, 3, "{}", call.stderr);
    assert!(call.stdout.contains(&format!("shard {failed}, fit/plane: ")), "{}", call.stdout);
    assert_eq!(sastrugi_in(path, &["run", "study.toml", "-o", "undivided", "--quiet"]).code, 3);
    assert_eq!(differing(&sums(&path.join("undivided")), &sums(&path.join("with-failure"))), [""; 0]);
}
