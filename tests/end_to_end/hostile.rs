//! Hostile folders: lists of paths that lead out of them, numbers that no program can process; and folders left by a killed call.

use sastrugi_tests::{Called, area, program, sastrugi_in, small_study, sums, write};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

fn release_in(folder: &Path) {
    write(folder, "study.toml", &small_study());
    let call = sastrugi_in(folder, &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
}

fn ends_with(call: &Called, code: i32, words: &str) {
    let said = format!("{}{}", call.stdout, call.stderr);
    assert!(call.code == code && said.contains(words), "expected {code} and \"{words}\": {} {said}", call.code);
}

/// A path outside a release is refused by every verb that would read it, and nothing is packed.
#[test]
fn val_lists_of_a_release_stay_inside() {
    let folder = area();
    let path = folder.path();
    release_in(path);
    let manifest = fs::read_to_string(path.join("release/manifest.json")).unwrap();
    let named = sums(&path.join("release"));
    let mut tables = named.keys().filter(|name| name.starts_with("tables/missions/"));
    let table = tables.next().unwrap();
    let other = named.keys().find(|name| name.starts_with("tables/samples/")).unwrap();
    let secret = write(path, "secret", "mine").display().to_string();
    for (place, words) in [
        (secret.as_str(), "cannot be a file of a release"),
        ("../secret", "cannot be a file of a release"),
        ("tables/../../secret", "cannot be a file of a release"),
        (other, "twice"),
    ] {
        let quoted = |name: &str| format!("\"path\": \"{name}\"");
        let changed = manifest.replacen(&quoted(table), &quoted(place), 1);
        assert_ne!(changed, manifest);
        fs::write(path.join("release/manifest.json"), changed).unwrap();
        for arguments in [
            &["report", "release", "-o", "page"][..],
            &["info", "release"],
            &["compare", "release", "release"],
            &["pack", "release", "-o", "a.tar"],
        ] {
            let call = sastrugi_in(path, arguments);
            assert!([4, 65].contains(&call.code), "{place} {arguments:?}: {} {}", call.code, call.stderr);
            let said = format!("{}{}", call.stdout, call.stderr);
            assert!(said.contains(words), "{place} {arguments:?}: {said}");
        }
        ends_with(&sastrugi_in(path, &["verify", "release"]), 4, words);
        assert!(!path.join("a.tar").exists() && !path.join("page").exists());
    }
    fs::write(path.join("release/manifest.json"), manifest).unwrap();
    assert_eq!(sastrugi_in(path, &["verify", "release", "--quiet"]).code, 0);
    fs::create_dir_all(path.join("release/more/folders")).unwrap();
    ends_with(&sastrugi_in(path, &["verify", "release"]), 4, "more/folders/");
}

/// Records of shards and of work areas are trusted as little as manifests.
#[test]
fn val_records_of_items_stay_inside() {
    let folder = area();
    let path = folder.path();
    release_in(path);
    let whole = sums(&path.join("release"));
    for part in ["1/2", "2/2"] {
        let output = format!("part-{}", &part[..1]);
        let call = sastrugi_in(path, &["run", "study.toml", "--shard", part, "-o", &output, "--quiet"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
    }
    let merge = || sastrugi_in(path, &["merge", "part-1", "part-2", "-o", "merged", "--quiet"]);

    let description = fs::read_to_string(path.join("part-1/shard.json")).unwrap();
    for (from, to) in [
        ("\"count\": 2", "\"count\": 1000000000"),
        ("\"count\": 2", "\"count\": 0"),
        ("\"index\": 1", "\"index\": 3"),
        ("\"stage\": \"", "\"stage\": \"../../"),
    ] {
        let changed = description.replace(from, to);
        assert_ne!(changed, description, "{from}");
        fs::write(path.join("part-1/shard.json"), changed).unwrap();
        ends_with(&merge(), 65, "shard.json");
    }
    fs::write(path.join("part-1/shard.json"), description).unwrap();

    // A record that names a file elsewhere is invalid: the shard is damaged, and a work area recomputes the item.
    write(path, "secret", "mine");
    let records = |root: &str| {
        let mut found = vec![path.join(root)];
        let mut records = Vec::new();
        while let Some(place) = found.pop() {
            if place.is_dir() {
                found.extend(fs::read_dir(place).unwrap().map(|entry| entry.unwrap().path()));
            } else if place.ends_with("record.json") {
                records.push(place);
            }
        }
        records
    };
    let lead_out = |record: &Path| {
        let mut value: serde_json::Value = serde_json::from_str(&fs::read_to_string(record).unwrap()).unwrap();
        let Some(file) = value["files"].as_array_mut().and_then(|files| files.first_mut()) else { return false };
        let up = "../".repeat(record.strip_prefix(path).unwrap().components().count() - 1);
        file["file"] = format!("{up}secret").into();
        fs::write(record, value.to_string()).unwrap();
        true
    };
    let in_shard = records("part-1/items").into_iter().find(|record| lead_out(record)).unwrap();
    ends_with(&merge(), 65, "missing or damaged");
    assert!(in_shard.is_file() && !path.join("merged").exists());
    records("release.work/items").iter().find(|record| lead_out(record)).unwrap();
    let again = sastrugi_in(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!((again.code, sums(&path.join("release"))), (0, whole), "{}", again.stderr);
}

/// Killed at any time, `report` has written a complete page or none, and an existing page stays until the next is complete.
#[test]
fn val_a_killed_report_is_complete_or_absent() {
    let folder = area();
    let path = folder.path();
    release_in(path);
    let report = || {
        let mut command = Command::new(program());
        command.args(["report", "release", "-o", "page", "--quiet"]).current_dir(path);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    let begun = std::time::Instant::now();
    assert!(report().status().unwrap().success());
    let whole_s = begun.elapsed().as_secs_f64();
    let page = || fs::read(path.join("page/index.html")).ok();
    let expected = page().unwrap();
    let figures = || fs::read_dir(path.join("page/figures")).unwrap().count();
    let expected_figures = figures();
    for k in 0..12 {
        if k == 6 {
            fs::remove_dir_all(path.join("page")).unwrap();
        }
        let mut child = report().spawn().unwrap();
        std::thread::sleep(Duration::from_secs_f64(whole_s * f64::from(k % 6) / 5.0));
        // It may have exited by itself.
        let _ = child.kill();
        child.wait().unwrap();
        if k < 6 || path.join("page").exists() {
            assert!(page().is_some_and(|found| found == expected) && figures() == expected_figures, "{k}");
        }
    }
    assert!(report().status().unwrap().success());
    let left = |prefix: &str| {
        let names = fs::read_dir(path).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
        names.filter(|name| name.starts_with(prefix)).collect::<Vec<_>>()
    };
    assert_eq!(left("."), Vec::<String>::new(), "drafts of killed reports are removed by the next");

    // Files that are not part of a report are not replaced, and files that only an earlier report had do not stay.
    fs::write(path.join("page/figures/old.svg"), "<svg/>").unwrap();
    assert!(report().status().unwrap().success());
    assert!(!path.join("page/figures/old.svg").exists() && figures() == expected_figures);
    fs::write(path.join("page/thesis.tex"), "mine").unwrap();
    assert_eq!(report().status().unwrap().code(), Some(2));
    assert!(path.join("page/thesis.tex").is_file());

    // A file of that name is not replaced, either.
    write(path, "diary", "mine");
    let call = sastrugi_in(path, &["report", "release", "-o", "diary", "--quiet"]);
    let said: String = call.stderr.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    assert!(call.code == 2 && said.contains("diary is a file, not a folder"), "{} {said}", call.code);
    assert_eq!(fs::read_to_string(path.join("diary")).unwrap(), "mine");
}

/// A point cloud on which the decoder panics (found by fuzzing) is refused in one sentence, without the panic's message.
#[test]
fn val_a_panic_of_a_decoder_is_not_printed() {
    let folder = area();
    let seed = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/seeds/points/panic.laz");
    fs::copy(seed, folder.path().join("cloud.laz")).unwrap();
    let call = sastrugi_in(folder.path(), &["info", "cloud.laz"]);
    ends_with(&call, 65, "cloud.laz is damaged: its points cannot be decoded");
    assert_eq!(call.stderr.trim_end().lines().count(), 1, "{}", call.stderr);
}

/// A point cloud with 20 kB of 0xff amid its points: a decoder that recursed with each code overflowed its stack, which ended every verb with 134.
#[test]
fn val_endless_switches_of_a_cloud_are_refused() {
    let folder = area();
    let path = folder.path();
    let seed = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/seeds/points/endless_switches.laz");
    let cloud = fs::read(seed).unwrap();
    assert!(cloud.chunk_by(|a, b| a == b).any(|run| run[0] == 0xff && run.len() >= 20_000));
    fs::write(path.join("cloud.laz"), cloud).unwrap();
    let dem = "[[dem]]\nid = \"a\"\nfile = \"cloud.laz\"\ncell_m = [0.2, 0.2]\n";
    write(path, "study.toml", &format!("[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n{dem}"));
    for arguments in [
        &["info", "cloud.laz"][..],
        &["roughness", "cloud.laz"],
        &["convert", "cloud.laz", "new.tif"],
        &["fit", "cloud.laz", "--outer-scale", "2", "-o", "fit.json"],
        &["run", "study.toml", "-o", "release", "--quiet"],
    ] {
        ends_with(&sastrugi_in(path, arguments), 65, "is damaged: times switch");
    }
    assert!(["new.tif", "fit.json", "release"].iter().all(|name| !path.join(name).exists()));
}

/// One flipped bit of a point, 16 km outside the box of the header: the grid would take gigabytes for which nothing was planned.
#[test]
fn val_a_point_outside_the_box_of_its_cloud_is_refused() {
    let folder = area();
    let path = folder.path();
    let seed = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/seeds/points/b.las");
    let mut cloud = fs::read(seed).unwrap();
    fs::write(path.join("cloud.las"), &cloud).unwrap();
    write(
        path,
        "study.toml",
        "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"a\"\nfile = \"cloud.las\"\ncell_m = [0.2, 0.2]\n",
    );
    let run = || sastrugi_in(path, &["run", "study.toml", "-o", "release", "--memory", "0.3", "--quiet"]);
    ends_with(&run(), 0, "");
    fs::remove_dir_all(path.join("release")).unwrap();
    let point = u32::from_le_bytes(cloud[96..100].try_into().unwrap()) as usize;
    cloud[point + 3] ^= 1;
    fs::write(path.join("cloud.las"), cloud).unwrap();
    ends_with(&run(), 65, "header states x");
    assert!(!path.join("release").exists());
}
