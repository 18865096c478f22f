//! From a study to a sealed release, and its verification.

#![allow(clippy::unwrap_used, reason = "a test may end where it stands")]

mod bucket;
mod cluster;
mod costs;
mod hostile;
mod image;
mod inputs;
mod machine;
mod million;
mod perturb;
mod photoclinometry;
mod prototype;
mod recipes;
mod route;
mod rover;
mod serve;
mod serve_faults;
mod team;
mod textures;
mod traverse;

use sastrugi_tests::{area, rows, sastrugi_in, small_study, sums, write};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn release_in(folder: &Path) {
    write(folder, "study.toml", &small_study());
    let call = sastrugi_in(folder, &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
}

#[test]
fn val_a_release_has_its_layout() {
    let folder = area();
    release_in(folder.path());
    let sums = sums(&folder.path().join("release"));
    for path in [
        "README.md",
        "CITATION.cff",
        "LICENSE",
        "croissant.json",
        "ro-crate-metadata.json",
        ".zenodo.json",
        "study.toml",
        "manifest.json",
        "dem/site.tif",
        "dem/site.metric.tif",
        "terrain/rough-0001.tif",
        "terrain/smooth.tif",
        "texture/tile.tif",
        "classes/rough-0001.tif",
        "fit/fit.json",
        "fit/fit.residual.tif",
        "mcap/rough-0001/husky-0001.mcap",
        "tables/terrains/part-0000.parquet",
        "tables/fits/part-0000.parquet",
        "tables/covariance/part-0000.parquet",
        "tables/missions/part-0000.parquet",
        "tables/samples/part-rough-0001.parquet",
        "report/index.html",
    ] {
        assert!(sums.contains_key(path), "{path} is missing from {:?}", sums.keys());
    }
    let study = fs::read_to_string(folder.path().join("release/study.toml")).unwrap();
    assert!(study.contains("file = \"dem/site.tif\""), "the study points into the release");
    let original = fs::read(sastrugi_fixtures::jacksboro()).unwrap();
    assert_eq!(fs::read(folder.path().join("release/dem/site.tif")).unwrap(), original);
}

/// The snow paper's study: scenes, tiles, and a scoreboard in which Cholesky refuses the large scene.
#[test]
fn val_the_snow_study_compares_the_methods() {
    let folder = area();
    let study = sastrugi_fixtures::study("vecherin_2022.toml");
    let call = sastrugi_in(folder.path(), &["run", study.to_str().unwrap(), "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let sums = sums(&folder.path().join("release"));
    for path in [
        "texture/scene-0.28.tif",
        "texture/tiled-0.28.tif",
        "texture/methods-quasi-wavelets.tif",
        "texture/methods-small-cholesky.tif",
        "tables/scoreboard/part-0000.parquet",
        "tables/scoreboard_covariance/part-0000.parquet",
    ] {
        assert!(sums.contains_key(path), "{path} is missing from {:?}", sums.keys());
    }
    assert!(!sums.contains_key("texture/methods-cholesky.tif"));
    let page = fs::read_to_string(folder.path().join("release/report/index.html")).unwrap();
    assert!(page.contains("12.8 GB") && page.contains("Which synthesis method"));
}

#[test]
fn val_the_report_is_self_contained() {
    let folder = area();
    release_in(folder.path());
    let page = fs::read_to_string(folder.path().join("release/report/index.html")).unwrap();
    for fetch in ["src=\"http", "href=\"http", "url(http", "@import", "<script src", "<link rel=\"stylesheet\""] {
        assert!(!page.contains(fetch), "the page fetches: {fetch}");
    }
    assert!(page.contains("<svg") && page.contains("data:image/png;base64,"));
    let readable: String =
        page.split("data:image/png;base64,").map(|part| part.split_once('"').map_or("", |p| p.1)).collect();
    assert!(!readable.contains("NaN"), "a figure shows NaN");
    let call = sastrugi_in(folder.path(), &["report", "release", "-o", "again", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    assert!(folder.path().join("again/index.html").exists());
    let inside = sastrugi_in(folder.path(), &["report", "release", "-o", "release/report2", "--quiet"]);
    assert_eq!(inside.code, 2, "{}", inside.stderr);
}

/// Any flipped, missing, extra or truncated file gives exit 4 and is named.
#[test]
fn val_verify_names_every_damage() {
    let folder = area();
    release_in(folder.path());
    let release = folder.path().join("release");
    let verify = || {
        let call = sastrugi_in(folder.path(), &["verify", "release", "--quiet"]);
        (call.code, format!("{}{}", call.stdout, call.stderr))
    };
    assert_eq!(verify().0, 0, "{}", verify().1);
    let paths: Vec<String> = sums(&release).keys().cloned().collect();
    let (mut flips, mut cuts) = (0, 0);
    for path in paths.iter().filter(|p| !p.starts_with("report/figures") && !p.starts_with("report/data")) {
        let file = release.join(path);
        let bytes = fs::read(&file).unwrap();
        let mut flipped = bytes.clone();
        let middle = flipped.len() / 2;
        flipped[middle] ^= 0x10;
        fs::write(&file, &flipped).unwrap();
        let (code, said) = verify();
        assert!(code == 4 && said.contains(path.as_str()), "{path} flipped: {code} {said}");
        flips += 1;
        fs::write(&file, &bytes[..bytes.len() - 1]).unwrap();
        let (code, said) = verify();
        assert!(code == 4 && said.contains(path.as_str()), "{path} truncated: {code} {said}");
        cuts += 1;
        fs::write(&file, &bytes).unwrap();
    }
    assert!(flips > 30 && cuts == flips);
    fs::rename(release.join("terrain/smooth.tif"), folder.path().join("aside")).unwrap();
    let (code, said) = verify();
    assert!(code == 4 && said.contains("terrain/smooth.tif"), "missing: {code} {said}");
    fs::rename(folder.path().join("aside"), release.join("terrain/smooth.tif")).unwrap();
    fs::write(release.join("terrain/extra.tif"), b"x").unwrap();
    let (code, said) = verify();
    assert!(code == 4 && said.contains("terrain/extra.tif"), "extra: {code} {said}");
    fs::remove_file(release.join("terrain/extra.tif")).unwrap();
    let sums_file = release.join("SHA256SUMS");
    let text = fs::read_to_string(&sums_file).unwrap();
    fs::write(&sums_file, text.lines().skip(1).collect::<Vec<_>>().join("\n")).unwrap();
    assert_eq!(verify().0, 4, "a shortened SHA256SUMS");
    fs::write(&sums_file, text).unwrap();
    assert_eq!(verify().0, 0);
}

#[test]
fn val_verify_recomputes_and_compares() {
    let folder = area();
    release_in(folder.path());
    let scratch = area();
    for (arguments, count) in [(["--recompute", "4"], 4), (["--recompute", "all"], 19)] {
        let mut call = std::process::Command::new(sastrugi_tests::program());
        call.args(["verify", "release", "--json", "--quiet"]).args(arguments);
        let call = sastrugi_tests::called(call.current_dir(folder.path()).env("TMPDIR", scratch.path()));
        assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
        let verification: Value = serde_json::from_str(&call.stdout).unwrap();
        assert_eq!(verification["recomputed"].as_array().unwrap().len(), count);
    }
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 3, "{left:?}");
    assert_eq!(fs::read_dir(scratch.path()).unwrap().count(), 0, "the scratch stays behind");
    // A forged release whose heights do not follow from its study, with consistent checksums.
    let release = folder.path().join("release");
    let study = fs::read_to_string(release.join("study.toml")).unwrap();
    forge_study(&release, &study.replace("seed = 7", "seed = 8"));
    assert_eq!(sastrugi_in(folder.path(), &["verify", "release", "--quiet"]).code, 0, "the forgery agrees with itself");
    let call = sastrugi_in(folder.path(), &["verify", "release", "--recompute", "all", "--quiet"]);
    assert_eq!(call.code, 4, "{}{}", call.stdout, call.stderr);
    assert!(call.stdout.contains("terrain/smooth.tif"), "{}", call.stdout);
    // A study that gives the same heights but other metrics: the tables differ.
    forge_study(&release, &study.replace("[[dem]]", "[roughness]\nborder_m = 1.0\n\n[[dem]]"));
    let call = sastrugi_in(folder.path(), &["verify", "release", "--recompute", "18", "--quiet"]);
    assert_eq!(call.code, 4, "{}{}", call.stdout, call.stderr);
    assert!(call.stdout.contains("tables/terrains"), "{}", call.stdout);
}

/// A manifest that was changed together with its checksums: its statements on files and on the release are recomputed.
#[test]
fn val_verify_names_what_a_changed_manifest_states() {
    let folder = area();
    release_in(folder.path());
    let release = folder.path().join("release");
    let recording = "mcap/rough-0001/husky-0001.mcap";
    let of_files = [
        ("classes/smooth.tif", "stage", "terrain".into()),
        ("terrain/smooth.tif", "stream", "7/terrain/other".into()),
        ("fit/fit.json", "parents", serde_json::json!(["dem/other"])),
        ("fit/fit.json", "sources", serde_json::json!([])),
        ("texture/tile.tif", "content_sha256", "00".into()),
        (recording, "records", 1.into()),
    ];
    let of_release = [
        ("name", "other".into()),
        ("seed", 8.into()),
        ("license", "CC0-1.0".into()),
        ("sources", serde_json::json!([])),
        ("failed", serde_json::json!([{ "stage": "dem", "item": "site", "error": "bad", "parameters": null }])),
        ("notes", serde_json::json!([{ "stage": "dem", "item": "site", "note": "good" }])),
    ];
    forge_manifest(&release, |manifest| {
        for (path, key, value) in &of_files {
            artifact_of(manifest, path)[*key] = value.clone();
        }
        for (key, value) in &of_release {
            manifest[*key] = value.clone();
        }
        artifact_of(manifest, recording)["maker"] = "unknown".into();
    });
    assert_eq!(sastrugi_in(folder.path(), &["verify", "release", "--quiet"]).code, 0, "the forgery agrees with itself");
    let verify = |count: &str| {
        let call = sastrugi_in(folder.path(), &["verify", "release", "--recompute", count, "--quiet"]);
        assert_eq!(call.code, 4, "{count}: {}{}", call.stdout, call.stderr);
        call.stdout
    };
    let named = |said: &str, path: &str, key: &str| {
        let sentence = format!("{path}: when recomputed, `{key}` differs");
        assert!(said.contains(&sentence), "\"{sentence}\" is not said: {said}");
    };
    let (all, items) = (verify("all"), verify("19"));
    // Values that sastrugi never writes are noticed when everything is recomputed.
    named(&all, recording, "maker");
    for said in [all, items] {
        of_files.iter().for_each(|(path, key, _)| named(&said, path, key));
        of_release.iter().for_each(|(key, _)| named(&said, "manifest.json", key));
    }
}

/// A release whose import failed contains the measured file and can be reproduced from itself.
#[test]
fn val_a_failed_import_keeps_its_input() {
    let folder = area();
    let broken = format!("{}\n[[dem]]\nid = \"broken\"\nfile = \"broken.tif\"\n", small_study());
    write(folder.path(), "study.toml", &broken);
    write(folder.path(), "broken.tif", "no raster");
    let run = ["run", "study.toml", "-o", "release", "--quiet"];
    let call = sastrugi_in(folder.path(), &run);
    assert_eq!(call.code, 3, "{}{}", call.stdout, call.stderr);
    assert_eq!(fs::read(folder.path().join("release/dem/broken.tif")).unwrap(), b"no raster");
    let plan = sastrugi_in(folder.path(), &["plan", "study.toml", "-o", "release"]);
    assert!(
        plan.code == 0 && plan.stdout.contains("dem/broken") && plan.stdout.contains("failed before: "),
        "{}",
        plan.stdout
    );
    fs::remove_file(folder.path().join("broken.tif")).unwrap();
    let again = sastrugi_in(folder.path(), &["verify", "release", "--recompute", "all", "--quiet"]);
    assert_eq!(again.code, 0, "{}{}", again.stdout, again.stderr);
    // Alone, it does not give a release.
    let head = broken.split("[[dem]]").next().unwrap();
    write(folder.path(), "broken.tif", "no raster");
    write(folder.path(), "alone.toml", &format!("{head}[[dem]]\nid = \"broken\"\nfile = \"broken.tif\"\n"));
    let alone = sastrugi_in(folder.path(), &["run", "alone.toml", "-o", "other", "--quiet"]);
    assert!(alone.code == 65 && !folder.path().join("other").exists(), "{} {}", alone.code, alone.stderr);
}

/// `plan` reads a work area that a run is using and changes nothing there.
#[test]
fn val_a_plan_only_reads() {
    let folder = area();
    release_in(folder.path());
    let unfinished =
        folder.path().join("release.work/items/terrain/smooth/unfinished-0123456789abcdef0123456789abcdef");
    fs::create_dir(&unfinished).unwrap();
    let lock = fs::File::open(folder.path().join("release.work/lock")).unwrap();
    lock.try_lock().unwrap();
    let call = sastrugi_in(folder.path(), &["plan", "study.toml", "-o", "release"]);
    assert!(call.code == 0 && call.stdout.contains("0 to compute"), "{}{}", call.stdout, call.stderr);
    assert!(unfinished.exists());
    let none = sastrugi_in(folder.path(), &["plan", "study.toml", "-o", "nothing"]);
    assert!(none.code == 0 && none.stdout.contains("new") && !folder.path().join("nothing.work").exists());
}

/// A study that was changed together with the checksums: the manifest and every table state the one that was run.
#[test]
fn val_verify_notices_another_study() {
    let folder = area();
    release_in(folder.path());
    let release = folder.path().join("release");
    let ours = fs::read_to_string(release.join("study.toml")).unwrap();
    let theirs = ours.replace("seed = 7", "seed = 8");
    let [run, other] = [&ours, &theirs].map(|text| sha256(text.as_bytes()));
    forge(&release, "study.toml", theirs.as_bytes());
    let line = format!("study.toml: inconsistent: has SHA-256 {other}, but `study_sha256` in manifest.json is {run}");
    for arguments in [&["verify", "release", "--quiet"][..], &["pack", "release", "-o", "a.tar", "--quiet"]] {
        let call = sastrugi_in(folder.path(), arguments);
        assert!(call.code == 4 && call.stdout.contains(&line), "{}{}", call.stdout, call.stderr);
    }
    assert!(!folder.path().join("a.tar").exists());

    forge_manifest(&release, |manifest| manifest["study_sha256"] = other.as_str().into());
    let call = sastrugi_in(folder.path(), &["verify", "release", "--quiet"]);
    let line = format!("was made from the study with SHA-256 {run}, but `study_sha256` in manifest.json is {other}");
    let tables = sums(&release).into_keys().filter(|path| path.starts_with("tables/")).count();
    assert_eq!((call.code, call.stdout.matches(&line).count()), (4, tables), "{}", call.stdout);
}

/// A release whose study names a file elsewhere, consistent in itself: nothing is computed from that file.
#[test]
fn val_a_release_is_recomputed_from_its_own_files() {
    let folder = area();
    let dem = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n4 5 6\n";
    let secret = write(folder.path(), "secret.asc", dem);
    let study =
        "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[dem]]\nid = \"d\"\nfile = \"secret.asc\"\n";
    write(folder.path(), "study.toml", study);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let release = folder.path().join("release");
    let released = fs::read_to_string(release.join("study.toml")).unwrap();
    assert!(released.contains("\"dem/d.asc\""), "{released}");
    let verify = |more: &[&str]| sastrugi_in(folder.path(), &[&["verify", "release", "--quiet"][..], more].concat());
    let absolute = secret.display().to_string();
    for file in ["../secret.asc", "dem/../../secret.asc", absolute.as_str()] {
        forge_study(&release, &released.replace("dem/d.asc", file));
        assert_eq!(verify(&[]).code, 0, "{file}: the forgery agrees with itself");
        for count in ["all", "1"] {
            let call = verify(&["--recompute", count]);
            let is_told = call.stderr.contains("secret.asc, which is outside the release");
            assert!(call.code == 65 && is_told, "{file} {count}: {} {}{}", call.code, call.stdout, call.stderr);
        }
    }
    forge_study(&release, &released);
    let call = verify(&["--recompute", "all"]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// Replaces a file and updates manifest and checksums.
fn forge(release: &Path, path: &str, bytes: &[u8]) {
    fs::write(release.join(path), bytes).unwrap();
    forge_manifest(release, |manifest| {
        let artifact = artifact_of(manifest, path);
        artifact["bytes"] = bytes.len().into();
        artifact["sha256"] = sha256(bytes).into();
    });
}

/// Replaces the study, and its hash in the manifest and in every table.
fn forge_study(release: &Path, text: &str) {
    let manifest: Value = serde_json::from_slice(&fs::read(release.join("manifest.json")).unwrap()).unwrap();
    let (before, after) = (manifest["study_sha256"].as_str().unwrap(), sha256(text.as_bytes()));
    for path in sums(release).into_keys().filter(|path| path.starts_with("tables/")) {
        let mut bytes = fs::read(release.join(&path)).unwrap();
        let at = bytes.windows(before.len()).position(|part| part == before.as_bytes()).unwrap();
        bytes[at..at + after.len()].copy_from_slice(after.as_bytes());
        forge(release, &path, &bytes);
    }
    forge(release, "study.toml", text.as_bytes());
    forge_manifest(release, |manifest| manifest["study_sha256"] = after.into());
}

fn artifact_of<'a>(manifest: &'a mut Value, path: &str) -> &'a mut Value {
    manifest["artifacts"].as_array_mut().unwrap().iter_mut().find(|a| a["path"] == path).unwrap()
}

/// Changes the manifest and updates the checksums.
fn forge_manifest(release: &Path, change: impl FnOnce(&mut Value)) {
    let path = release.join("manifest.json");
    let mut manifest: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut manifest);
    fs::write(&path, serde_json::to_string_pretty(&manifest).unwrap() + "\n").unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let artifacts = manifest["artifacts"].as_array().unwrap().iter();
    let mut sums: Vec<(String, String)> = artifacts.map(|a| (text(&a["path"]), text(&a["sha256"]))).collect();
    sums.push(("manifest.json".to_owned(), sha256(&fs::read(&path).unwrap())));
    sums.sort();
    let lines = sums.iter().map(|(path, sha256)| format!("{sha256}  {path}\n"));
    fs::write(release.join("SHA256SUMS"), lines.collect::<String>()).unwrap();
}

fn sha256(bytes: &[u8]) -> String {
    use sha2::Digest;
    sha2::Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

/// `sha256sum -c` agrees.
#[test]
fn val_sha256sum_reads_the_sums() {
    let folder = area();
    release_in(folder.path());
    let mut command = std::process::Command::new("sha256sum");
    let call = sastrugi_tests::called(
        command.args(["--check", "--strict", "--quiet", "SHA256SUMS"]).current_dir(folder.path().join("release")),
    );
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// Changes one bit in the middle of a file.
fn flip(path: &Path) {
    let mut bytes = fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(path, bytes).unwrap();
}

/// Results that were changed in the work area are detected and dropped together, by a run and by a shard, and recomputed by the next run.
#[test]
fn val_changed_results_are_not_sealed() {
    let folder = area();
    release_in(folder.path());
    let whole = sums(&folder.path().join("release"));
    let below = |folder: &Path| -> Vec<_> { fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect() };
    let run = ["run", "study.toml", "-o", "release", "--quiet"];
    let shard = ["run", "study.toml", "--shard", "1/1", "--work", "release.work", "-o", "shard", "--quiet"];
    for arguments in [run.as_slice(), shard.as_slice()] {
        let terrains = below(&folder.path().join("release.work/items/terrain"));
        assert_eq!(terrains.len(), 3);
        terrains.iter().flat_map(|item| below(item)).for_each(|result| flip(&result.join("heights.tif")));
        let call = sastrugi_in(folder.path(), arguments);
        let words = ", and so were 2 other results; these results were removed; run again";
        assert!(call.code == 1 && call.stderr.contains("terrain/rough"), "{} {}", call.code, call.stderr);
        assert!(call.stderr.contains(words), "{}", call.stderr);
        release_in(folder.path());
        assert_eq!(sums(&folder.path().join("release")), whole);
    }
}

/// Nothing is written into a sealed release, by whatever path it is reached.
#[test]
fn val_a_sealed_release_stays_sealed() {
    let folder = area();
    release_in(folder.path());
    std::os::unix::fs::symlink(folder.path().join("release"), folder.path().join("link")).unwrap();
    for output in ["release/new", "other/../release/new", "link/new"] {
        let call = sastrugi_in(folder.path(), &["report", "release", "-o", output, "--quiet"]);
        assert_eq!(call.code, 2, "{output}: {}", call.stderr);
    }
    let inside = ["run", "study.toml", "-o", "release", "--work", "release/work", "--quiet"];
    assert_eq!(sastrugi_in(folder.path(), &inside).code, 2);
    assert_eq!(sastrugi_in(folder.path(), &["verify", "release", "--quiet"]).code, 0);
}

/// A file of some item; which items a shard has depends on their keys.
fn first_product(items: &Path) -> std::path::PathBuf {
    let below = |folder: &Path| -> Vec<_> { fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect() };
    let files = below(items).iter().flat_map(|stage| below(stage)).flat_map(|item| below(&item)).collect::<Vec<_>>();
    files.into_iter().find(|f| !f.ends_with("record.json")).unwrap()
}

/// Shards that do not fit together are refused with the reason.
#[test]
fn val_merge_refuses_what_does_not_fit() {
    let folder = area();
    let path = folder.path();
    write(path, "study.toml", &small_study());
    write(path, "other.toml", &small_study().replace("seed = 7", "seed = 8"));
    let shard = |study: &str, part: &str, output: &str| {
        let call = sastrugi_in(path, &["run", study, "--shard", part, "-o", output, "--quiet"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
    };
    shard("study.toml", "1/2", "a");
    shard("study.toml", "2/2", "b");
    shard("other.toml", "2/2", "c");
    // A complete shard is replaced by no other.
    let call = sastrugi_in(path, &["run", "study.toml", "--shard", "2/2", "-o", "a", "--quiet"]);
    assert!(call.code == 2 && call.stderr.contains("a is shard 1 of 2; choose another folder"), "{}", call.stderr);
    let refused = |shards: &[&str], words: &str| {
        let mut all = vec!["merge"];
        all.extend(shards);
        all.extend(["-o", "merged", "--quiet"]);
        let call = sastrugi_in(path, &all);
        assert!(call.code == 65 && call.stderr.contains(words), "{shards:?}: {} {}", call.code, call.stderr);
        assert!(!path.join("merged").exists());
    };
    refused(&["a"], "shard 2 of 2 is missing; run the study again with `--shard 2/2`");
    refused(
        &["a", "b", "nowhere"],
        "nowhere is not a shard: it has no shard.json; all 2 shards are present without it",
    );
    refused(&["a", "nowhere"], "nowhere is not a shard: it has no shard.json; shard 2 of 2 is missing");
    refused(&["a", "a"], "both shard 1");
    refused(&["a", "c"], "another study");
    flip(&first_product(&path.join("b/items")));
    refused(&["a", "b"], "missing or damaged; run the study again with `--shard 2/2`");
}

/// `analyze` finds in a recording the metrics that the release's table has for the mission, bit for bit.
#[test]
fn val_a_recording_has_the_metrics_of_its_mission() {
    for flavour in ["viewer", "ros2"] {
        let folder = area();
        let study = small_study().replace("seed = 7\n", &format!("seed = 7\nmcap = \"{flavour}\"\n"));
        write(folder.path(), "study.toml", &study);
        let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
        recordings_are_judged_as_missions(folder.path());
        if flavour == "ros2" {
            bags_are_judged_as_their_files(folder.path());
        }
        let call = sastrugi_in(folder.path(), &["verify", "release", "--recompute", "all", "--quiet"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
    }
}

/// A bag is named by its folder; other folders are refused with advice.
fn bags_are_judged_as_their_files(folder: &Path) {
    let bag = "release/mcap/smooth/husky-0001";
    let json = |arguments: &[&str]| -> Value {
        let call = sastrugi_in(folder, &[arguments, &["--json"]].concat());
        assert_eq!(call.code, 0, "{arguments:?}: {}", call.stderr);
        serde_json::from_str(&call.stdout).unwrap()
    };
    let file = format!("{bag}/husky-0001.mcap");
    let (mut of_bag, of_file) = (json(&["analyze", bag]), json(&["analyze", &file]));
    assert_eq!(of_bag[0]["log"]["log_id"], bag);
    of_bag[0]["log"]["log_id"] = file.as_str().into();
    assert_eq!(of_bag, of_file);
    let described = json(&["info", bag]);
    assert_eq!((&described["what"], &described["husky-0001.mcap"]), (&"ROS 2 bag".into(), &json(&["info", &file])));
    let refused = |words: &str| {
        let call = sastrugi_in(folder, &["analyze", "bag"]);
        assert!(call.code == 65 && call.stderr.contains(words), "{} {}", call.code, call.stderr);
    };
    fs::create_dir(folder.join("bag")).unwrap();
    refused("give an .mcap file");
    write(&folder.join("bag"), "metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths:\n    - a.db3\n");
    refused("`ros2 bag convert`");
}

fn recordings_are_judged_as_missions(folder: &Path) {
    let missions = rows(&folder.join("release"), "missions");
    assert!(!missions.is_empty());
    for mission in &missions {
        let text = |column: &str| mission[column].as_str().unwrap().to_owned();
        let call = sastrugi_in(folder, &["analyze", &format!("release/{}", text("path")), "--json"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
        let found: Value = serde_json::from_str(&call.stdout).unwrap();
        let log = &found[0]["log"];
        assert_eq!(log["outcome"].as_str().unwrap(), text("outcome"));
        // ROS 2 messages do not state that they are simulated (docs/analyze.md).
        let simulated = log["message"] == "sastrugi.VehicleState";
        assert_eq!(log["vertical_acceleration_floor_m_s2"].as_f64() == Some(0.0), simulated, "{log}");
        for column in [
            "path_length_m",
            "rms_vertical_acceleration_m_s2",
            "rms_pitch_rate_deg_s",
            "rms_roll_rate_deg_s",
            "rms_body_pitch_rate_deg_s",
            "rms_body_roll_rate_deg_s",
            "max_pitch_deg",
            "max_roll_deg",
            "sample_rate_hz",
        ] {
            assert_eq!(log[column].as_f64(), mission[column].as_f64(), "{}: {column}", text("path"));
        }
    }
}
