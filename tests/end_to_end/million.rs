//! Memory of studies with very many missions, as `docs/scaling.md` states it.

use sastrugi_tests::synthetic::{self, MISSIONS_PER_TERRAIN, Shape};
use sastrugi_tests::{area, peak_kib, sastrugi_in, write};
use std::path::Path;

/// Bound on the memory of each further mission of a plan, bytes; 205 were measured.
const PLAN_MAX: f64 = 400.0;
/// The same of a report: 1 GB for a million. 990 were measured between 10 000 and 100 000 missions and 720 beyond, on two cores; the peak depends
/// on their number.
const REPORT_MAX: f64 = 1000.0;

/// A study that expands to this many missions on terrains of [`MISSIONS_PER_TERRAIN`].
fn study(folder: &Path, missions: usize) {
    let terrains = missions.div_ceil(MISSIONS_PER_TERRAIN);
    let text = format!(
        "[study]\nname = \"many\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"t\"\nkind = \"multifractal\"\nsize_px = [64, 64]\n\
         count = {terrains}\n\n[[missions]]\nid = \"m\"\nterrains = [\"t\"]\ncount = {MISSIONS_PER_TERRAIN}\n\
         length_m = 2.0\nborder_m = 0.5\n\n[[traverse]]\nid = \"h\"\n\
         missions = \"m\"\n"
    );
    write(folder, "study.toml", &text);
}

/// Bytes that each further mission takes between two numbers of missions.
fn growth(peak_kib: impl Fn(usize) -> u64) -> f64 {
    let (few, many) = (20_000, 200_000);
    let [low, high] = [few, many].map(peak_kib);
    let each = 1024.0 * (high as f64 - low as f64) / (many - few) as f64;
    let cores = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    println!("{few} missions: {low} KiB, {many}: {high} KiB, {each:.0} B each, on {cores} cores");
    assert!(high > low, "{high} KiB for {many} missions, {low} KiB for {few}");
    each
}

#[test]
#[ignore = "slow: plans 200 000 missions"]
fn val_a_plan_takes_little_memory_for_a_mission() {
    let folder = area();
    let each = growth(|missions| {
        study(folder.path(), missions);
        peak_kib(folder.path(), &["plan", "study.toml", "-o", "release"])
    });
    assert!(each < PLAN_MAX, "{each} bytes");
}

#[test]
#[ignore = "slow: reports on 200 000 missions"]
fn val_a_report_takes_little_memory_for_a_mission() {
    let folder = area();
    let each = growth(|missions| {
        let name = format!("release-{missions}");
        synthetic::release(&folder.path().join(&name), &Shape::of_missions(missions)).unwrap();
        peak_kib(folder.path(), &["report", &name, "-o", &format!("report-{missions}"), "--quiet"])
    });
    assert!(each < REPORT_MAX, "{each} bytes");
    // What is listed and drawn is bounded: one file alone would have 60 MB with all missions.
    let bytes = folder_bytes(&folder.path().join("report-200000"));
    assert!(bytes < 50_000_000, "{bytes} bytes");
}

/// Bytes of all files of a folder.
fn folder_bytes(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let bytes = |entry: std::fs::DirEntry| match entry.path().is_dir() {
        true => folder_bytes(&entry.path()),
        false => entry.metadata().unwrap().len(),
    };
    entries.map(bytes).sum()
}

/// A synthetic release is a release: intact, described, and with a report that counts its missions.
#[test]
fn val_synthetic_releases_are_releases() {
    let folder = area();
    synthetic::release(&folder.path().join("release"), &Shape::of_missions(130)).unwrap();
    let verified = sastrugi_in(folder.path(), &["verify", "release"]);
    assert_eq!(verified.code, 0, "{}{}", verified.stdout, verified.stderr);
    let report = sastrugi_in(folder.path(), &["report", "release", "-o", "report", "--quiet"]);
    assert_eq!(report.code, 0, "{}", report.stderr);
    let page = std::fs::read_to_string(folder.path().join("report/index.html")).unwrap();
    // 130 missions take seven terrains of 20.
    assert!(page.contains("<b>140</b> missions") && page.contains("<b>7</b> terrains"), "{}", &page[..2000]);
}

/// So is one with paired groups, variants and textures: its report compares with the paper, orders the variants, and judges the textures.
#[test]
fn val_synthetic_releases_of_every_shape_are_releases() {
    let folder = area();
    let shape = Shape { missions: 540, is_paired: true, variants: 2, has_textures: true };
    synthetic::release(&folder.path().join("release"), &shape).unwrap();
    let verified = sastrugi_in(folder.path(), &["verify", "release"]);
    assert_eq!(verified.code, 0, "{}{}", verified.stdout, verified.stderr);
    let report = sastrugi_in(folder.path(), &["report", "release", "-o", "report", "--quiet"]);
    assert_eq!(report.code, 0, "{}", report.stderr);
    let page = std::fs::read_to_string(folder.path().join("report/index.html")).unwrap();
    for words in [
        "How does this compare with published results?",
        "How sensitive are the results to the parameters?",
        "4 of 9 textures are drawn",
        "Of 9 textures compared with their measured surfaces",
    ] {
        assert!(page.contains(words), "{words}");
    }
}

/// The files of a release are hard links to those of the work area: nothing is copied on one file system.
#[cfg(unix)]
#[test]
fn val_files_of_a_release_are_linked() {
    use std::os::unix::fs::MetadataExt;
    let folder = area();
    study(folder.path(), 20);
    let text = std::fs::read_to_string(folder.path().join("study.toml")).unwrap();
    let study = [
        ("count = 20\nlength_m = 2.0\nborder_m = 0.5\n", "count = 2\nlength_m = 5.0\nborder_m = 1.5\n"),
        ("size_px = [64, 64]", "size_px = [320, 300]"),
    ];
    let study = study.iter().fold(text, |text, (small, large)| text.replace(small, large));
    sastrugi_tests::run_study(folder.path(), &study, &[]);
    let release = folder.path().join("release");
    let names = |path: &str| std::fs::metadata(release.join(path)).unwrap().nlink();
    assert_eq!(["terrain/t-0001.tif", "mcap/t-0001/h-0001.mcap", "manifest.json"].map(names), [2, 2, 1]);
}
