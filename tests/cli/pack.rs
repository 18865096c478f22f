//! `pack`: a release as one archive.

use sastrugi_tests::{area, called, sastrugi_in, small_study, write};
use serde_json::Value;
use std::fs::{self, File, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, SystemTime};

/// A sealed release of a few terrains, driven on one of them.
fn release(folder: &Path) {
    let study =
        small_study().replace("[[fit]]\nid = \"fit\"\ndem = \"site\"\nouter_scale_m = 1000.0\nbootstrap = 39\n", "");
    write(folder, "study.toml", &study);
    let call = sastrugi_in(folder, &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
}

fn pack(folder: &Path, output: &str) -> Value {
    let call = sastrugi_in(folder, &["pack", "release", "-o", output, "--json", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    serde_json::from_str(&call.stdout).unwrap()
}

/// Other dates and permissions, as another umask or a copy gives them.
fn disguise(folder: &Path) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            disguise(&path);
            continue;
        }
        File::options()
            .write(true)
            .open(&path)
            .unwrap()
            .set_modified(SystemTime::UNIX_EPOCH + Duration::from_secs(1))
            .unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o600)).unwrap();
    }
}

#[test]
fn gold_an_archive_has_the_same_bytes_wherever_it_is_packed() {
    let folder = area();
    let path = folder.path();
    release(path);
    let first = pack(path, "a.tar");
    disguise(&path.join("release"));
    let second = pack(path, "deeper/b.tar");
    assert_eq!(first["sha256"], second["sha256"]);
    assert_eq!(fs::read(path.join("a.tar")).unwrap(), fs::read(path.join("deeper/b.tar")).unwrap());
    let call = called(Command::new("sha256sum").arg(path.join("a.tar")));
    assert!(call.stdout.starts_with(first["sha256"].as_str().unwrap()), "{}", call.stdout);
}

/// Where stderr is not a terminal: what is checked, what is packed, and how long it takes where it takes long; no line for each file.
#[test]
fn val_packing_tells_its_progress_in_a_few_lines() {
    let folder = area();
    release(folder.path());
    let call = sastrugi_in(folder.path(), &["pack", "release", "-o", "a.tar"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let lines: Vec<&str> = call.stderr.lines().collect();
    assert!((2..=3).contains(&lines.len()) && lines[0] == "checking files", "{lines:?}");
    assert!(lines[1].starts_with("packing ") && lines[1].ends_with(" files"), "{lines:?}");
}

/// GNU tar and Python's tarfile read the archive, and what they unpack is the release.
#[test]
fn val_others_unpack_the_release() {
    let folder = area();
    let path = folder.path();
    release(path);
    pack(path, "a.tar");
    fs::create_dir_all(path.join("gnu")).unwrap();
    let call = called(Command::new("tar").arg("-xf").arg(path.join("a.tar")).arg("-C").arg(path.join("gnu")));
    assert_eq!((call.code, call.stderr.as_str()), (0, ""));
    assert_eq!(sastrugi_in(path, &["verify", "gnu/small", "--quiet"]).code, 0);
    let script = "import sys, tarfile\n\
        archive = tarfile.open(sys.argv[1])\n\
        members = archive.getmembers()\n\
        assert {(m.mode, m.uid, m.gid, m.uname, m.gname, m.mtime) for m in members} == {(0o644, 0, 0, '', '', 1767225600)}, members\n\
        names = [m.name for m in members]\n\
        assert names == sorted(names, key=str.encode) and all(m.isreg() for m in members), names\n\
        archive.extractall(sys.argv[2])\n";
    let call = called(Command::new("python3").args(["-c", script]).arg(path.join("a.tar")).arg(path.join("python")));
    assert_eq!(call.code, 0, "{}", call.stderr);
    let call = called(Command::new("diff").arg("-r").arg(path.join("release")).arg(path.join("python/small")));
    assert_eq!((call.code, call.stdout.as_str()), (0, ""));
}

#[test]
fn val_only_whole_releases_are_packed() {
    let folder = area();
    let path = folder.path();
    release(path);
    let refused = |arguments: &[&str], code: i32, words: &str| {
        let call = sastrugi_in(path, arguments);
        let said = format!("{}{}", call.stdout, call.stderr);
        assert!(call.code == code && said.contains(words), "{arguments:?}: {} {said}", call.code);
    };
    refused(&["pack", "release", "-o", "release/a.tar"], 2, "sealed");
    refused(&["pack", "release", "-o", "."], 2, "folder");
    refused(&["pack", "nowhere", "-o", "a.tar"], 65, "not a sastrugi release");
    fs::create_dir(path.join("empty")).unwrap();
    refused(&["pack", "empty", "-o", "a.tar"], 65, "not a sastrugi release");
    let shard = sastrugi_in(path, &["run", "study.toml", "--shard", "1/2", "-o", "shard", "--quiet"]);
    assert_eq!(shard.code, 0, "{}", shard.stderr);
    for arguments in [
        &["pack", "shard", "-o", "a.tar"][..],
        &["compare", "shard", "release"],
        &["info", "shard"],
        &["report", "shard", "-o", "r"],
        &["verify", "shard"],
    ] {
        refused(arguments, 65, "the shards first: `sastrugi merge");
    }
    fs::write(path.join("release/README.md"), "changed").unwrap();
    refused(&["pack", "release", "-o", "a.tar"], 4, "README.md");
    assert!(!path.join("a.tar").exists());
    let left =
        fs::read_dir(path).unwrap().filter(|e| e.as_ref().unwrap().file_name().to_string_lossy().starts_with('.'));
    assert_eq!(left.count(), 0);
}
