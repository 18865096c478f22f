//! No user data is lost: folders of other programs, links, full disks, good releases.

use sastrugi_tests::{area, called, peak_kib_with, program, rows, sastrugi_in, small_study, sums, write};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const STUDY: &str = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"t\"\nkind = \"multifractal\"\n\
    size_px = [64, 64]\n\n[[dem]]\nid = \"d\"\nfile = \"d.asc\"\n";
const DEM: &str = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n4 5 6\n";

fn study(folder: &Path) {
    write(folder, "study.toml", STUDY);
    write(folder, "d.asc", DEM);
}

fn run(folder: &Path, more: &[&str]) -> sastrugi_tests::Called {
    sastrugi_in(folder, &[&["run", "study.toml", "-o", "release", "--quiet"], more].concat())
}

#[test]
fn val_a_folder_that_is_not_a_work_area_is_left_alone() {
    let folder = area();
    study(folder.path());
    let mine = folder.path().join("photos/items/terrain/t/holiday");
    fs::create_dir_all(&mine).unwrap();
    fs::write(mine.join("a.jpg"), "a").unwrap();
    let call = run(folder.path(), &["--work", "photos"]);
    assert!(call.code == 2 && call.stderr.contains("nor a sastrugi work area"), "{} {}", call.code, call.stderr);
    assert!(mine.join("a.jpg").is_file() && !folder.path().join("photos/lock").exists());

    // In a sastrugi work area, only entries with the name of a result are ever removed.
    assert_eq!(run(folder.path(), &[]).code, 0);
    let kept = folder.path().join("release.work/items/terrain/t/notes");
    let orphan = folder.path().join("release.work/items/terrain/t/unfinished-0123456789abcdef0123456789abcdef");
    [&kept, &orphan].into_iter().for_each(|path| fs::create_dir(path).unwrap());
    assert_eq!(run(folder.path(), &[]).code, 0);
    assert!(kept.is_dir() && !orphan.exists());
}

#[cfg(unix)]
#[test]
fn val_links_in_a_work_area_are_not_followed() {
    use std::os::unix::fs::symlink;
    let folder = area();
    let path = folder.path();
    study(path);
    assert_eq!(run(path, &[]).code, 0);
    let elsewhere = path.join("elsewhere");
    let precious = elsewhere.join("terrain/t/unfinished-0123456789abcdef0123456789abcdef");
    fs::create_dir_all(&precious).unwrap();
    fs::remove_dir_all(path.join("release.work/items")).unwrap();
    symlink(&elsewhere, path.join("release.work/items")).unwrap();
    let call = run(path, &[]);
    assert!(call.code == 2 && call.stderr.contains("symbolic link"), "{} {}", call.code, call.stderr);
    assert!(precious.is_dir());
    fs::remove_file(path.join("release.work/items")).unwrap();

    write(path, "diary.txt", "dear diary");
    fs::remove_file(path.join("release.work/lock")).unwrap();
    for lock in ["release.work/lock", ".sastrugi-lock-release"] {
        symlink(path.join("diary.txt"), path.join(lock)).unwrap();
        let call = run(path, &[]);
        assert!(
            call.code == 1 && call.stderr.contains("cannot be used as a lock"),
            "{lock}: {} {}",
            call.code,
            call.stderr
        );
        assert_eq!(fs::read_to_string(path.join("diary.txt")).unwrap(), "dear diary");
        fs::remove_file(path.join(lock)).unwrap();
    }
    assert_eq!(run(path, &[]).code, 0);
}

/// A limit on file sizes simulates a full disk: the run stops, and the existing release stays.
#[cfg(unix)]
#[test]
fn val_machine_errors_are_not_failed_items() {
    let folder = area();
    let path = folder.path();
    write(path, "study.toml", &small_study());
    assert_eq!(run(path, &[]).code, 0);
    let before = sums(&path.join("release"));
    fs::remove_dir_all(path.join("release.work")).unwrap();
    let limited = format!("ulimit -f 8; exec {} run study.toml -o release --quiet", program().display());
    let call = called(Command::new("bash").args(["-c", &limited]).current_dir(path));
    assert_eq!(call.code, 1, "{}", call.stderr);
    let words = ["File too large", "release.work", "without writing a release"];
    assert!(words.iter().all(|word| call.stderr.contains(word)), "{}", call.stderr);
    assert_eq!(sums(&path.join("release")), before);
    assert_eq!(run(path, &[]).code, 0);
    assert_eq!(sums(&path.join("release")), before);
}

/// Every verb that writes a file says that the disk is full, and leaves neither the file nor a part of it; an earlier file stays.
#[cfg(unix)]
#[test]
fn val_a_full_disk_leaves_no_part_of_a_file() {
    let folder = area();
    let path = folder.path();
    let ground = sastrugi_in(path, &["terrain", "mavs_perlin", "-o", "ground.tif"]);
    assert_eq!(ground.code, 0, "{}", ground.stderr);
    study(path);
    assert_eq!(run(path, &[]).code, 0);
    write(path, "new.asc", "earlier");
    let before = names(path);
    for arguments in [
        "terrain mavs_perlin -o new.tif",
        "convert ground.tif new.asc",
        "convert ground.tif new.npy",
        "convert ground.tif new.png",
        "convert ground.tif new.obj",
        "convert ground.tif new.glb",
        "convert ground.tif new.usda",
        "hillshade ground.tif -o new.png",
        "render ground.tif -o new.tif",
        "pack release -o new.tar.zst",
        "report release -o new",
    ] {
        let limited = format!("ulimit -f 8; exec {} {arguments}", program().display());
        let call = called(Command::new("bash").args(["-c", &limited]).current_dir(path));
        assert!(call.code == 1 && call.stderr.contains("File too large"), "{arguments}: {} {}", call.code, call.stderr);
        assert_eq!(names(path), before, "{arguments}");
    }
    assert_eq!(fs::read_to_string(path.join("new.asc")).unwrap(), "earlier");
}

/// Names in a folder, sorted.
#[cfg(unix)]
fn names(folder: &Path) -> Vec<std::ffi::OsString> {
    let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    names
}

/// Pipes and devices, which may never end or never start, are not read, whether named on the command line or in a study.
#[cfg(unix)]
#[test]
fn val_pipes_and_devices_are_refused_as_input() {
    let folder = area();
    let path = folder.path();
    study(path);
    assert!(Command::new("mkfifo").arg(path.join("pipe")).status().unwrap().success());
    std::os::unix::fs::symlink("/dev/zero", path.join("zero.tif")).unwrap();
    let calls = [
        vec!["info", "pipe"],
        vec!["info", "zero.tif"],
        vec!["fit", "pipe", "-o", "fit.json"],
        vec!["roughness", "zero.tif"],
        vec!["plan", "pipe"],
        vec!["run", "pipe", "-o", "release"],
        vec!["analyze", "pipe"],
        vec!["convert", "zero.tif", "out.asc"],
        vec!["traverse", "pipe", "-o", "release"],
        vec!["traverse", "zero.tif", "-o", "release"],
        vec!["navigate", "pipe", "--start", "0,0", "--goal", "1,1", "-o", "release"],
        vec!["navigate", "d.asc", "--start", "0,0", "--goal", "1,1", "--obstacles", "pipe", "-o", "release"],
    ];
    for arguments in calls {
        let call = sastrugi_in(path, &arguments);
        let word = if arguments.contains(&"pipe") { "is a pipe" } else { "is a device" };
        assert!(call.code == 65 && call.stderr.contains(word), "{arguments:?}: {} {}", call.code, call.stderr);
    }
    for name in ["pipe", "zero.tif"] {
        write(path, "study.toml", &STUDY.replace("d.asc", name));
        let call = run(path, &[]);
        assert!(call.code == 65 && call.stderr.contains(name), "{name}: {} {}", call.code, call.stderr);
    }
}

/// An output takes the place of the file that has its name. A pipe, a device or a link stays, and is refused before any work.
#[cfg(unix)]
#[test]
fn val_pipes_devices_and_links_are_not_replaced() {
    let folder = area();
    let path = folder.path();
    study(path);
    assert!(Command::new("mkfifo").arg(path.join("pipe.tif")).status().unwrap().success());
    fs::write(path.join("kept.tif"), b"kept").unwrap();
    std::os::unix::fs::symlink("kept.tif", path.join("link.tif")).unwrap();
    std::os::unix::fs::symlink("/dev/null", path.join("device.tif")).unwrap();
    for (output, kind) in
        [("pipe.tif", "pipe or device"), ("link.tif", "symbolic link"), ("device.tif", "symbolic link")]
    {
        for arguments in [vec!["terrain", "gap", "-o", output], vec!["convert", "d.asc", output]] {
            let call = sastrugi_in(path, &arguments);
            let words = format!("{output}: is a {kind}, which the output would replace");
            assert!(call.code == 2 && call.stderr.contains(&words), "{arguments:?}: {} {}", call.code, call.stderr);
            assert!(!fs::symlink_metadata(path.join(output)).unwrap().is_file(), "{output}");
        }
    }
    assert_eq!(fs::read(path.join("kept.tif")).unwrap(), b"kept");
}

/// The files beside an output are outputs too, as are links to folders: refused before anything is read, made or written.
#[cfg(unix)]
#[test]
fn val_links_beside_an_output_are_not_replaced() {
    let folder = area();
    let path = folder.path();
    study(path);
    write(path, "e.asc", DEM);
    write(path, "images.toml", "images = [\"a.json\"]\n");
    fs::create_dir(path.join("fits")).unwrap();
    for (link, call) in [
        ("new.tif", "terrain gap -o new.tif"),
        ("new.flux.tif", "terrain cascade -o new.tif"),
        ("new.json", "render d.asc -o new.tif"),
        ("new.lit.tif", "photoclinometry images.toml -o new.tif"),
        ("maps.sigma.tif", "fit d.asc -o fit.json --local maps"),
        ("plot.svg", "fit d.asc -o fit.json --plot plot.svg"),
        ("fits/e.json", "fit d.asc e.asc -o fits --table fits.csv"),
        ("way.svg", "navigate d.asc --start 0,0 --goal 1,1 -o way.svg"),
    ] {
        for target in ["d.asc", "fits", "nothing"] {
            let target = path.join(target);
            std::os::unix::fs::symlink(&target, path.join(link)).unwrap();
            let before = names(path);
            let called = sastrugi_in(path, &call.split(' ').collect::<Vec<_>>());
            let words = format!("{link}: is a symbolic link, which the output would replace");
            assert!(called.code == 2 && called.stderr.contains(&words), "{call}: {} {}", called.code, called.stderr);
            assert!(fs::read_link(path.join(link)).unwrap() == target && names(path) == before, "{call}");
            fs::remove_file(path.join(link)).unwrap();
        }
    }
    for call in ["terrain gap -o folder.tif", "convert d.asc folder.tif"] {
        fs::create_dir_all(path.join("folder.tif")).unwrap();
        let called = sastrugi_in(path, &call.split(' ').collect::<Vec<_>>());
        let is_told = called.stderr.contains("folder.tif is a folder; name a file");
        assert!(called.code == 2 && is_told, "{call}: {} {}", called.code, called.stderr);
    }
}

/// A link to a folder, such as one on a large disk, is followed: the release is in that folder, and the link stays.
#[cfg(unix)]
#[test]
fn val_a_release_goes_where_a_link_leads() {
    let folder = area();
    let path = folder.path();
    study(path);
    assert_eq!(run(path, &[]).code, 0);
    fs::create_dir_all(path.join("scratch/x")).unwrap();
    std::os::unix::fs::symlink("scratch/x", path.join("results")).unwrap();
    for output in ["results", "results/", "results"] {
        let call = sastrugi_in(path, &["run", "study.toml", "-o", output, "--work", "release.work", "--quiet"]);
        assert_eq!(call.code, 0, "{output}: {}", call.stderr);
        assert_eq!(fs::read_link(path.join("results")).unwrap(), Path::new("scratch/x"));
        assert_eq!(sums(&path.join("scratch/x")), sums(&path.join("release")));
        assert_eq!(sastrugi_in(path, &["verify", output, "--quiet"]).code, 0);
    }
    fs::create_dir(path.join("scratch/page")).unwrap();
    std::os::unix::fs::symlink("scratch/page", path.join("page")).unwrap();
    for _ in 0..2 {
        let call = sastrugi_in(path, &["report", "results", "-o", "page", "--quiet"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
        assert!(path.join("page").is_symlink() && path.join("scratch/page/index.html").is_file());
    }
    let expected = ["d.asc", "page", "release", "release.work", "results", "scratch", "study.toml"];
    assert_eq!(names(path), expected);
    assert_eq!(names(&path.join("scratch")), ["page", "x"]);
    // So does the work area, unless another is named.
    assert_eq!(sastrugi_in(path, &["run", "study.toml", "-o", "results", "--quiet"]).code, 0);
    assert_eq!(names(path), expected);
    assert_eq!(names(&path.join("scratch")), ["page", "x", "x.work"]);
    // Nothing is there to be followed.
    std::os::unix::fs::symlink("scratch/y", path.join("later")).unwrap();
    for output in ["later", "later/"] {
        let call = sastrugi_in(path, &["run", "study.toml", "-o", output, "--work", "release.work", "--quiet"]);
        let words = format!("{output}: is a symbolic link");
        assert!(call.code == 2 && call.stderr.contains(&words), "{} {}", call.code, call.stderr);
    }
}

/// A folder in place of a DEM is called a folder, on the command line and in a study.
#[test]
fn val_folders_are_refused_as_input() {
    let folder = area();
    let path = folder.path();
    study(path);
    assert_eq!(run(path, &[]).code, 0);
    fs::create_dir(path.join("folder")).unwrap();
    let refused = |arguments: &[&str], words: &str| {
        let call = sastrugi_in(path, arguments);
        assert!(call.code == 65 && call.stderr.contains(words), "{arguments:?}: {} {}", call.code, call.stderr);
    };
    refused(&["traverse", "folder", "-o", "new"], "folder is a folder, not a file");
    refused(&["navigate", "folder", "--start", "0,0", "--goal", "1,1", "-o", "new"], "folder is a folder, not a file");
    write(path, "study.toml", &STUDY.replace("d.asc", "folder"));
    refused(&["plan", "study.toml"], "folder is a folder, not a file");
    fs::remove_file(path.join("release/manifest.json")).unwrap();
    fs::create_dir(path.join("release/manifest.json")).unwrap();
    for arguments in [&["verify", "release"][..], &["pack", "release", "-o", "a.tar"], &["info", "release"]] {
        refused(arguments, "is a folder, not a file");
    }
}

/// A pipe in place of a file of a work area holds nothing up: a result without its record is computed again, a mark is refused.
#[cfg(unix)]
#[test]
fn val_pipes_in_a_work_area_are_not_read() {
    let folder = area();
    let path = folder.path();
    study(path);
    assert_eq!(run(path, &[]).code, 0);
    let whole = sums(&path.join("release"));
    let piped = |file: &Path| {
        fs::remove_file(file).unwrap();
        assert!(Command::new("mkfifo").arg(file).status().unwrap().success());
    };
    let below = |folder: PathBuf| fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let results: Vec<PathBuf> = below(path.join("release.work/items")).flat_map(below).flat_map(below).collect();
    assert!(results.len() >= 2, "{results:?}");
    results.iter().for_each(|result| piped(&result.join("record.json")));
    piped(&path.join("release.work/timings.json"));
    let call = run(path, &["--json"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let summary: serde_json::Value = serde_json::from_str(&call.stdout).unwrap();
    assert_eq!(summary["computed"].as_u64(), Some(results.len() as u64));
    assert_eq!(sums(&path.join("release")), whole);
    piped(&path.join("release.work/CACHEDIR.TAG"));
    let call = run(path, &[]);
    assert!(call.code == 1 && call.stderr.contains("CACHEDIR.TAG: is a pipe"), "{} {}", call.code, call.stderr);
}

/// Out of memory, the call exits with the code for temporary failures and leaves nothing that looks complete.
#[cfg(unix)]
#[test]
fn val_a_lack_of_memory_does_not_crash() {
    let folder = area();
    let path = folder.path();
    write(path, "world.toml", "kind = \"multifractal\"\nseed = 1\nsize_px = [6000, 6000]\n");
    let limited = format!("ulimit -v 600000; exec {} terrain world.toml -o out.tif --threads 1", program().display());
    let call = called(Command::new("bash").args(["-c", &limited]).current_dir(path));
    assert!(call.code == 75 && call.stderr.contains("memory"), "{} {}", call.code, call.stderr);
    assert!(!path.join("out.tif").exists());
}

/// Wherever memory ends, in the reader, a kernel, the compressor or as threads start, the code is the same: of the file, nothing is wrong.
#[cfg(unix)]
#[test]
fn val_a_lack_of_memory_is_no_fault_of_the_file() {
    let folder = area();
    let path = folder.path();
    let size = "size_m=[300.0, 300.0]";
    let made = sastrugi_in(path, &["terrain", "mavs_perlin", "--set", size, "-o", "ground.tif"]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let (mut short, mut whole) = (0, 0);
    for kib in (100_000..300_000).step_by(8000) {
        for verb in ["convert ground.tif new.tif", "hillshade ground.tif -o new.png"] {
            let limited = format!("ulimit -v {kib}; exec {} {verb} --threads 2", program().display());
            let call = called(Command::new("bash").args(["-c", &limited]).current_dir(path));
            assert!([0, 75].contains(&call.code), "{verb}, {kib} KiB: {} {}", call.code, call.stderr);
            // An aborted process may leave a temporary file, which the next call removes.
            let outputs = ["new.tif", "new.png"].iter().filter(|name| path.join(name).exists()).count();
            assert_eq!(outputs, usize::from(call.code == 0), "{verb}, {kib} KiB: {:?}", names(path));
            *if outputs == 0 { &mut short } else { &mut whole } += 1;
            ["new.tif", "new.png"].iter().for_each(|name| fs::remove_file(path.join(name)).unwrap_or_default());
        }
    }
    assert!(short > 10 && whole > 4, "{short} {whole}");
}

/// A memory limit holds: no work is started that needs more. Without one, the same study runs, and `plan` states the memory that it needs.
#[test]
fn val_a_memory_limit_is_kept() {
    let folder = area();
    let path = folder.path();
    study(path);
    let plan = sastrugi_in(path, &["plan", "study.toml", "--json"]);
    let plan: serde_json::Value = serde_json::from_str(&plan.stdout).unwrap();
    let largest = plan["stale"].as_array().unwrap().iter().map(|s| s["memory_bytes"].as_u64().unwrap()).max().unwrap();
    let gib = largest as f64 / f64::from(1u32 << 30);
    let call = run(path, &["--memory", &format!("{:.4}", 0.9 * gib)]);
    assert!(call.code == 2 && call.stderr.contains("alone needs"), "{} {}", call.code, call.stderr);
    assert!(!path.join("release").exists());
    assert_eq!(run(path, &["--memory", &format!("{:.4}", 1.1 * gib)]).code, 0);
    // Finished results need no memory.
    assert_eq!(run(path, &["--memory", "0.001"]).code, 0);
    assert_eq!(run(path, &["--memory", "0"]).code, 2);
}

/// Resident memory of a run without large items, its report included: 59 to 61 MiB measured.
#[cfg(target_os = "linux")]
const BASE: u64 = 72 << 20;

/// Working memory of each item that a run of `study.toml` would compute, bytes.
#[cfg(target_os = "linux")]
fn stated(folder: &Path) -> Vec<u64> {
    let plan = sastrugi_in(folder, &["plan", "study.toml", "-o", "release", "--json"]);
    let plan: serde_json::Value = serde_json::from_str(&plan.stdout).unwrap();
    plan["stale"].as_array().unwrap().iter().map(|item| item["memory_bytes"].as_u64().unwrap()).collect()
}

/// Resident memory of a run stays within `--memory` and what a run without large items takes, although four threads could each compute an item that
/// takes nearly all of it.
#[cfg(target_os = "linux")]
#[test]
fn val_resident_memory_stays_within_the_limit() {
    let folder = area();
    let path = folder.path();
    let terrains =
        "[[terrain]]\nid = \"t\"\nkind = \"multifractal\"\nsize_px = [1000, 1000]\ncell_m = 0.05\ncount = 6\n";
    write(path, "study.toml", &format!("[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n{terrains}"));
    let stated = stated(path);
    let largest = *stated.iter().max().unwrap();
    assert!(stated.iter().filter(|bytes| 10 * **bytes > 9 * largest).count() >= 6, "{stated:?}");
    let limit = 1.1 * largest as f64;
    let gib = format!("{:.4}", limit / f64::from(1u32 << 30));
    let arguments = ["run", "study.toml", "-o", "release", "--memory", &gib, "--threads", "4", "--quiet"];
    let peak = 1024 * peak_kib_with(path, &arguments, &[]);
    println!("{:.0} MB resident, limit {:.0} MB", 1e-6 * peak as f64, 1e-6 * limit);
    assert!(peak as f64 <= limit + BASE as f64, "{peak} bytes, limit {limit}");
}

/// What glibc keeps of freed buffers for the next allocation is not working memory: buffers of this size go back to the system.
#[cfg(target_os = "linux")]
const RETURNED: (&str, &str) = ("MALLOC_MMAP_THRESHOLD_", "4194304");

/// The stage `roughness` and fits take the memory that `plan` states, and it states at most four times as much.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "slow: ./test --full"]
fn val_roughness_and_fits_take_the_memory_that_they_state() {
    let folder = area();
    let path = folder.path();
    let made = ["terrain", "multifractal", "--set", "size_px=[2000, 2000]", "--set", "cell_m=0.05", "-o", "ground.tif"];
    assert_eq!(sastrugi_in(path, &made).code, 0);
    let mut text =
        "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[dem]]\nid = \"d\"\nfile = \"ground.tif\"\n"
            .to_owned();
    let fits = [
        "bootstrap = 0",
        "bootstrap = 0\nmodel = \"empirical\"",
        "bootstrap = 0\nstatistics = true",
        "",
        "mode = \"paper\"",
    ];
    // First the DEM, whose largest item is that of its roughness; then each fit alone, since what is finished is not computed again.
    for (number, settings) in std::iter::once("").chain(fits).enumerate() {
        if number > 0 {
            text += &format!("\n[[fit]]\nid = \"f{number}\"\ndem = \"d\"\nouter_scale_m = 2.0\n{settings}\n");
        }
        write(path, "study.toml", &text);
        let items = stated(path);
        fs::remove_dir_all(path.join("release")).unwrap_or_default();
        let stated = *items.iter().max().unwrap();
        assert!(number == 0 || items.len() == 1, "{items:?}");
        let arguments = ["run", "study.toml", "-o", "release", "--quiet", "--threads", "2"];
        let peak = 1024 * peak_kib_with(path, &arguments, &[RETURNED]);
        println!("{settings:?}: {:.0} MB resident, stated {:.0} MB", 1e-6 * peak as f64, 1e-6 * stated as f64);
        assert!(peak <= stated + BASE && stated <= 4 * peak, "{settings}: {peak} bytes, stated {stated}");
    }
}

#[test]
fn val_a_good_release_is_not_replaced_by_a_worse_one() {
    let folder = area();
    let path = folder.path();
    study(path);
    assert_eq!(run(path, &[]).code, 0);
    let before = sums(&path.join("release"));
    write(path, "d.asc", "no raster");
    let call = run(path, &[]);
    assert!(call.code == 1 && call.stderr.contains("--replace"), "{} {}", call.code, call.stderr);
    assert_eq!(sums(&path.join("release")), before);
    assert_eq!(run(path, &["--replace"]).code, 3);
    assert_eq!(rows(&path.join("release"), "terrains").len(), 1);
    // As good as the one before, and better.
    assert_eq!(run(path, &[]).code, 3);
    write(path, "d.asc", DEM);
    assert_eq!(run(path, &[]).code, 0);
    assert_eq!(sums(&path.join("release")), before);

    let shard = |more: &[&str]| {
        let call = ["run", "study.toml", "-o", "shard", "--work", "release.work", "--shard", "1/1", "--quiet"];
        sastrugi_in(path, &[&call[..], more].concat())
    };
    assert_eq!(shard(&[]).code, 0);
    write(path, "d.asc", "no raster");
    let call = shard(&[]);
    assert!(call.code == 1 && call.stderr.contains("--replace"), "{} {}", call.code, call.stderr);
    assert_eq!(shard(&["--replace"]).code, 3);
    // A file of that name does not make a folder a shard.
    fs::create_dir(path.join("mine")).unwrap();
    write(path, "mine/shard.json", "{}");
    let call = sastrugi_in(path, &["run", "study.toml", "-o", "mine", "--shard", "1/1", "--quiet"]);
    assert_eq!(call.code, 2, "{}", call.stderr);
    assert_eq!(fs::read_to_string(path.join("mine/shard.json")).unwrap(), "{}");
}

/// A pipe or a folder in place of a release's list of files is unusable input, and nothing waits for the pipe.
#[cfg(unix)]
#[test]
fn val_lists_of_a_release_are_files() {
    let folder = area();
    let path = folder.path();
    study(path);
    assert_eq!(run(path, &[]).code, 0);
    let refused = |name: &str, words: &str| {
        for arguments in [&["verify", "release"][..], &["pack", "release", "-o", "a.tar"]] {
            let call = sastrugi_in(path, arguments);
            let is_told = call.stderr.contains(&format!("release/{name}")) && call.stderr.contains(words);
            assert!(call.code == 65 && is_told, "{name} {arguments:?}: {} {}", call.code, call.stderr);
        }
        assert!(!path.join("a.tar").exists());
    };
    for name in ["manifest.json", "SHA256SUMS"] {
        let list = path.join("release").join(name);
        let text = fs::read(&list).unwrap();
        fs::remove_file(&list).unwrap();
        assert!(Command::new("mkfifo").arg(&list).status().unwrap().success());
        refused(name, "is a pipe");
        fs::remove_file(&list).unwrap();
        fs::create_dir(&list).unwrap();
        refused(name, "is a folder, not a file");
        fs::remove_dir(&list).unwrap();
        fs::write(&list, text).unwrap();
    }
    assert_eq!(sastrugi_in(path, &["verify", "release"]).code, 0);
}

/// The covariance of such a texture is transformed on its complete torus before anything is drawn: without the memory for that, it is refused
/// in one sentence.
#[cfg(unix)]
#[test]
fn val_textures_of_measured_covariances_are_refused_before_they_need_memory() {
    let folder = area();
    let path = folder.path();
    write(path, "world.toml", "kind = \"multifractal\"\nseed = 1\nsize_px = [300, 300]\ncell_m = 0.1\n");
    for arguments in [
        &["terrain", "world.toml", "-o", "ground.tif"][..],
        &["fit", "ground.tif", "--outer-scale", "2", "--bootstrap", "0", "--model", "empirical", "-o", "measured.json"],
        &["fit", "ground.tif", "--outer-scale", "2", "--bootstrap", "0", "-o", "model.json"],
    ] {
        let call = sastrugi_in(path, arguments);
        assert_eq!(call.code, 0, "{arguments:?}: {}", call.stderr);
    }
    for texture in ["measured.json", "model.json --covariance residual"] {
        for kib in [100_000, 150_000] {
            let arguments = format!("texture {texture} --size 150x150 --cell 0.1 -o new.tif --threads 2");
            let limited = format!("ulimit -v {kib}; exec {} {arguments}", program().display());
            let call = called(Command::new("bash").args(["-c", &limited]).current_dir(path));
            let is_told = call.stderr.starts_with("sastrugi: the texture needs about");
            assert!(call.code == 75 && is_told, "{texture}, {kib} KiB: {} {}", call.code, call.stderr);
            assert!(call.stderr.trim_end().lines().count() == 1 && !path.join("new.tif").exists(), "{}", call.stderr);
        }
    }
}

/// An export that cannot be written leaves the earlier one in its folder as it was, and no folder where there was none.
#[cfg(unix)]
#[test]
fn val_a_failed_export_leaves_the_earlier_one() {
    let folder = area();
    let path = folder.path();
    write(path, "d.asc", DEM);
    let convert = |blocks: &str, out: &str| {
        let call = format!("ulimit -f {blocks}; exec {} convert d.asc {out} --for gazebo", program().display());
        called(Command::new("bash").args(["-c", &call]).current_dir(path))
    };
    let files = || {
        let read = |name: std::ffi::OsString| fs::read(path.join("gz").join(&name)).map(|bytes| (name, bytes)).unwrap();
        names(&path.join("gz")).into_iter().map(read).collect::<Vec<_>>()
    };
    let call = convert("unlimited", "gz");
    assert_eq!(call.code, 0, "{}", call.stderr);
    let earlier = files();
    write(path, "d.asc", &DEM.replace("4 5 6", "4 5 9"));
    // The image fits into 100 kB, the mesh does not.
    for out in ["gz", "new"] {
        let call = convert("100", out);
        assert!(call.code == 1 && call.stderr.contains("collision.obj"), "{out}: {} {}", call.code, call.stderr);
    }
    assert!(files() == earlier && !path.join("new").exists());
    assert_eq!(convert("unlimited", "gz").code, 0);
    assert!(files() != earlier && names(&path.join("gz")).len() == earlier.len());
}
