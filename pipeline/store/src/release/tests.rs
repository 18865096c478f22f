use super::*;
use sastrugi_schemas::manifest::{FailedItem, Origin};
use sastrugi_schemas::tables::{CovarianceRow, PsdRow};
use std::fs::{self, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};

const STUDY_TEXT: &str = "[study]\n";

fn head() -> Head {
    Head {
        name: "demo".to_owned(),
        study_sha256: digest::of_bytes(STUDY_TEXT.as_bytes()),
        seed: 7,
        version: "0.1.0".to_owned(),
        license: "CC-BY-4.0".to_owned(),
    }
}

fn rows(n: i64) -> Vec<PsdRow> {
    let row = |bin: i64| PsdRow {
        surface_id: "a".to_owned(),
        bin,
        frequency_cycles_m: 0.1 * bin as f64,
        psd_m4: if bin == 3 { f64::NAN } else { 1.0 / (1.0 + bin as f64) },
        modes: bin * 8,
    };
    (0..n).map(row).collect()
}

fn sealed(dest: &Path) -> Release {
    let mut builder = ReleaseBuilder::beside(dest, head()).unwrap();
    builder.write_text("README.md", "# Demo\n", Origin::default()).unwrap();
    builder.write_text(STUDY, STUDY_TEXT, Origin::default()).unwrap();
    builder.write_text("fit/a.json", "{}\n", Origin { stage: "fit".to_owned(), ..Origin::default() }).unwrap();
    let single = |table| TablePart { table, name: TablePart::WHOLE.to_owned(), origin: Default::default() };
    let fill = |part: &TablePart, writer: &mut PartWriter<'_>| {
        let rows = if part.table.name == PsdRow::TABLE.name { rows(9000) } else { Vec::new() };
        rows.iter().try_for_each(|row| writer.push(row.cells()))
    };
    builder.write_tables(vec![single(&PsdRow::TABLE), single(&CovarianceRow::TABLE)], fill).unwrap();
    builder.seal(dest).unwrap();
    Release::open(dest).unwrap()
}

#[test]
fn val_a_release_opens_verifies_and_returns_its_rows() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("release");
    sealed(&dest);
    let release = Release::open(&dest).unwrap();
    assert_eq!(verify(&dest).unwrap().problems, vec![]);
    let back: Vec<PsdRow> = release.rows().unwrap();
    assert_eq!(back.len(), 9000);
    assert!(back[3].psd_m4.is_nan());
    assert_eq!(back[8999], rows(9000)[8999]);
    assert!(release.table_files("covariance").is_empty());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left next to the release");
}

#[test]
fn prop_same_release_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    sealed(&a);
    sealed(&b);
    sealed(&b);
    assert_eq!(fs::read(a.join(SUMS)).unwrap(), fs::read(b.join(SUMS)).unwrap());
}

#[test]
fn prop_every_flipped_byte_is_found_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("release");
    let release = sealed(&dest);
    let names: Vec<String> = release.manifest().artifacts.iter().map(|a| a.path.clone()).collect();
    for name in names.iter().map(String::as_str).chain([MANIFEST, SUMS]) {
        let length = fs::metadata(dest.join(name)).unwrap().len();
        for at in (0..length).step_by((length as usize / 40).max(1)) {
            flip(&dest.join(name), at);
            let problems = verify(&dest).unwrap().problems;
            assert!(problems.iter().any(|p| p.path == name), "{name} byte {at}: {problems:?}");
            flip(&dest.join(name), at);
        }
    }
    assert_eq!(verify(&dest).unwrap().problems, vec![]);
}

fn flip(path: &Path, at: u64) {
    let mut file = OpenOptions::new().read(true).write(true).open(path).unwrap();
    let mut byte = [0];
    file.seek(SeekFrom::Start(at)).unwrap();
    file.read_exact(&mut byte).unwrap();
    file.seek(SeekFrom::Start(at)).unwrap();
    file.write_all(&[byte[0] ^ 1]).unwrap();
}

/// Paths outside the release are never accessed, whatever its lists contain; a list has each file once, in order; an empty folder is extra.
#[test]
fn val_hostile_folders_are_refused() {
    let root = tempfile::tempdir().unwrap();
    let dest = root.path().join("demo");
    sealed(&dest);
    fs::write(root.path().join("secret"), "secret").unwrap();
    let manifest = fs::read_to_string(dest.join(MANIFEST)).unwrap();
    let first = Release::open(&dest).unwrap().manifest().artifacts[0].path.clone();
    let outside = root.path().join("secret").display().to_string();
    for path in ["../secret", outside.as_str(), "a/../../secret", ".hidden", MANIFEST] {
        fs::write(dest.join(MANIFEST), manifest.replacen(&first, path, 1)).unwrap();
        let refused = Release::open(&dest).unwrap_err();
        assert!(refused.unusable_input() && refused.to_string().contains("invalid path"), "{path}: {refused}");
        let problems = verify(&dest).unwrap().problems;
        assert!(problems.iter().any(|p| p.path == MANIFEST && p.kind == ProblemKind::Inconsistent), "{problems:?}");
    }
    let second = Release::open(&rebuilt(&dest, &manifest)).unwrap().manifest().artifacts[1].path.clone();
    fs::write(dest.join(MANIFEST), manifest.replacen(&second, &first, 1)).unwrap();
    assert!(Release::open(&dest).unwrap_err().to_string().contains("twice"));
    assert!(for_each_artifact(&dest, drop).unwrap_err().to_string().contains("twice"));
    let mut reversed: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    reversed["artifacts"].as_array_mut().unwrap().reverse();
    fs::write(dest.join(MANIFEST), reversed.to_string()).unwrap();
    assert!(Release::open(&dest).unwrap_err().to_string().contains("out of order"));
    assert!(for_each_artifact(&dest, drop).unwrap_err().to_string().contains("out of order"));
    let problems = verify(&dest).unwrap().problems;
    assert!(problems.iter().any(|p| p.path == MANIFEST && p.message.contains("out of order")), "{problems:?}");
    // Without a manifest the checksums are used.
    let sums = fs::read_to_string(dest.join(SUMS)).unwrap();
    fs::remove_file(dest.join(MANIFEST)).unwrap();
    fs::write(dest.join(SUMS), sums.replacen(&first, "../secret", 1)).unwrap();
    let problems = verify(&dest).unwrap().problems;
    assert!(problems.iter().any(|p| p.path == SUMS && p.message.contains("../secret")), "{problems:?}");
    assert!(problems.iter().all(|p| p.path != "../secret"), "{problems:?}");
    fs::write(dest.join(SUMS), sums).unwrap();
    rebuilt(&dest, &manifest);
    assert_eq!(verify(&dest).unwrap().problems, []);
    fs::create_dir_all(dest.join("more/folders")).unwrap();
    let problems = verify(&dest).unwrap().problems;
    assert_eq!((problems.len(), problems[0].path.as_str(), problems[0].kind), (1, "more/folders/", ProblemKind::Extra));
}

/// The study and each table must be of the study that the manifest states; one line names both hashes.
#[test]
fn val_files_of_another_study_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("release");
    sealed(&dest);
    let text = fs::read_to_string(dest.join(MANIFEST)).unwrap();
    let own = digest::of_bytes(STUDY_TEXT.as_bytes());
    let forge = |text: &str| {
        fs::write(dest.join(MANIFEST), text).unwrap();
        let manifest: Manifest = serde_json::from_str(text).unwrap();
        fs::write(dest.join(SUMS), sums_text(&manifest, &digest::of_bytes(text.as_bytes()))).unwrap();
        let problems = verify(&dest).unwrap().problems;
        assert!(problems.iter().all(|p| p.kind == ProblemKind::Inconsistent), "{problems:?}");
        problems.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let other = "cd".repeat(32);
    let stated = format!("`study_sha256` in manifest.json is {other}");
    let key = "\"study_sha256\": \"";
    let table = |name: &str| {
        format!("tables/{name}/part-0000.parquet: was made from the study with SHA-256 {own}, but {stated}")
    };
    assert_eq!(
        forge(&text.replacen(&format!("{key}{own}"), &format!("{key}{other}"), 1)),
        [format!("study.toml: has SHA-256 {own}, but {stated}"), table("psd")]
    );
    fs::rename(dest.join(STUDY), dest.join("other.toml")).unwrap();
    let unlisted = forge(&text.replacen("\"study.toml\"", "\"other.toml\"", 1));
    assert_eq!(unlisted, [format!("study.toml: is not listed, but `study_sha256` in manifest.json is {own}")]);
}

fn sums_text(manifest: &Manifest, manifest_sha256: &str) -> Vec<u8> {
    verify::sums_of(manifest, manifest_sha256).unwrap()
}

fn rebuilt(dest: &Path, manifest: &str) -> PathBuf {
    fs::write(dest.join(MANIFEST), manifest).unwrap();
    dest.to_owned()
}

/// The files one by one and the rest are the manifest that is read at once; what that refuses is refused.
#[test]
fn prop_a_manifest_read_piece_by_piece_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("release");
    let release = sealed(&dest);
    let mut artifacts = Vec::new();
    let rest = for_each_artifact(&dest, |artifact| artifacts.push(artifact)).unwrap();
    assert_eq!(&Manifest { artifacts, ..rest }, release.manifest());
    let text = fs::read_to_string(dest.join(MANIFEST)).unwrap();
    for (from, to) in [
        ("\"program\": \"sastrugi\"", "\"program\": \"other\""),
        ("\"format\": 1", "\"format\": 2"),
        ("README.md", "../README.md"),
        ("\"artifacts\": [", "\"artifacts\": {"),
    ] {
        assert!(text.contains(from), "{from}");
        fs::write(dest.join(MANIFEST), text.replace(from, to)).unwrap();
        let refused = for_each_artifact(&dest, drop).map(drop);
        assert!(matches!(refused, Err(ReleaseError::NotARelease { .. })), "{to}: {refused:?}");
        assert!(Release::open(&dest).is_err(), "{to}");
    }
    for (key, value) in [("seed", "7"), ("artifacts", "[]"), ("failed", "[]")] {
        let from = format!("\"{key}\": ");
        assert!(text.contains(&from), "{from}");
        fs::write(dest.join(MANIFEST), text.replacen(&from, &format!("{from}{value}, {from}"), 1)).unwrap();
        let refused = for_each_artifact(&dest, drop).unwrap_err().to_string();
        assert!(refused.contains(&format!("duplicate field `{key}`")), "{refused}");
        assert!(Release::open(&dest).unwrap_err().to_string().contains(&format!("duplicate field `{key}`")), "{key}");
    }
}

/// A file that is added from the same file system is not copied, and has its own hash.
#[test]
fn val_added_files_have_their_hashes() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("made.bin");
    fs::write(&source, b"made").unwrap();
    let mut builder = ReleaseBuilder::beside(&folder.path().join("release"), head()).unwrap();
    let incoming = |path: &str| Incoming { path: path.to_owned(), source: source.clone(), origin: Origin::default() };
    let sums = builder.add_files(vec![incoming("a/made.bin"), incoming("b/made.bin")]).unwrap();
    assert_eq!(sums, [digest::of_bytes(b"made"), digest::of_bytes(b"made")]);
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        // The file itself and its two places.
        assert_eq!(fs::metadata(&source).unwrap().nlink(), 3);
    }
    assert!(builder.add_files(vec![incoming("a/made.bin")]).is_err());
    builder.write_text(STUDY, STUDY_TEXT, Origin::default()).unwrap();
    builder.seal(&folder.path().join("release")).unwrap();
    assert_eq!(verify(&folder.path().join("release")).unwrap().problems, vec![]);
    assert_eq!(fs::read(&source).unwrap(), b"made");
}

#[test]
fn val_missing_extra_and_truncated_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("release");
    let release = sealed(&dest);
    let names: Vec<String> = release.manifest().artifacts.iter().map(|a| a.path.clone()).collect();
    let found = |path: &str, kind| verify(&dest).unwrap().problems.iter().any(|p| p.path == path && p.kind == kind);
    for name in names.iter().map(String::as_str).chain([MANIFEST, SUMS]) {
        let bytes = fs::read(dest.join(name)).unwrap();
        fs::remove_file(dest.join(name)).unwrap();
        assert!(found(name, ProblemKind::Missing), "{name}");
        fs::write(dest.join(name), &bytes[..bytes.len() - 1]).unwrap();
        assert!(verify(&dest).unwrap().problems.iter().any(|p| p.path == name), "{name}");
        fs::write(dest.join(name), &bytes).unwrap();
    }
    fs::create_dir(dest.join("more")).unwrap();
    fs::write(dest.join("more/file"), "x").unwrap();
    assert!(found("more/file", ProblemKind::Extra));
}

#[test]
fn val_other_folders_are_left_untouched() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("mine");
    fs::create_dir(&dest).unwrap();
    ReleaseBuilder::beside(&dest, head()).unwrap().seal(&dest).unwrap();
    fs::remove_file(dest.join(MANIFEST)).unwrap();
    assert!(matches!(ReleaseBuilder::beside(&dest, head()), Err(ReleaseError::Occupied { .. })));
    assert!(dest.join(SUMS).exists());
    let refused = |path: &Path| {
        let error = verify(path).unwrap_err();
        assert!(error.unusable_input() && matches!(error, ReleaseError::NotARelease { .. }), "{error}");
        error.to_string()
    };
    assert!(refused(&folder.path().join("nowhere")).ends_with("not a sastrugi release: no such folder"));
    assert!(refused(folder.path()).contains("it has neither"), "{}", refused(folder.path()));
    let file = folder.path().join("file");
    fs::write(&file, "text").unwrap();
    assert!(refused(&file).ends_with("it is a file, not a folder"));
}

/// A release is written into the folder that a link leads to, also where it replaces another; the link stays, and nothing is left beside it or
/// beside the folder.
#[cfg(unix)]
#[test]
fn val_a_link_to_a_folder_stays_and_is_followed() {
    let [home, scratch] = [(), ()].map(|()| tempfile::tempdir().unwrap());
    let (link, dest) = (home.path().join("release"), scratch.path().join("x"));
    fs::create_dir(&dest).unwrap();
    std::os::unix::fs::symlink(&dest, &link).unwrap();
    for named in [link.clone(), link.join(""), link.clone()] {
        sealed(&named);
        assert!(link.is_symlink() && !dest.is_symlink());
        assert_eq!(verify(&dest).unwrap().problems, vec![]);
        for folder in [&home, &scratch] {
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "{}", named.display());
        }
        let mut readme = OpenOptions::new().append(true).open(dest.join("README.md")).unwrap();
        readme.write_all(b"changed").unwrap();
    }
}

#[test]
fn val_a_changed_table_description_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("release");
    sealed(&dest);
    let path = dest.join("tables/psd/part-0000.parquet");
    let error = crate::parquet::check_table(&path, &CovarianceRow::TABLE).unwrap_err();
    assert!(error.to_string().contains("surface_id"), "{error}");
    assert_eq!(crate::parquet::check_table(&path, &PsdRow::TABLE).unwrap().rows, 9000);
}

#[test]
fn val_rows_of_a_changed_table_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("release");
    let release = sealed(&dest);
    flip(&dest.join("tables/psd/part-0000.parquet"), 700);
    assert!(matches!(release.rows::<PsdRow>(), Err(ReleaseError::Changed { .. })));
}

#[test]
fn val_paths_stay_inside() {
    let folder = tempfile::tempdir().unwrap();
    let mut builder = ReleaseBuilder::beside(&folder.path().join("s"), head()).unwrap();
    assert!(check_path(ZENODO).is_ok());
    for path in ["../x", "/x", "a//b", ".hidden", "a/.zenodo.json", MANIFEST, "a/../b", "a\nb", ""] {
        let result = builder.write_text(path, "", Origin::default());
        assert!(matches!(result, Err(ReleaseError::Path { .. })), "{path:?}");
    }
    builder.write_text("a", "", Origin::default()).unwrap();
    assert!(builder.write_text("a", "", Origin::default()).is_err());
    builder.failed(FailedItem {
        stage: "terrain".to_owned(),
        item: "b".to_owned(),
        error: "no".to_owned(),
        parameters: None,
    });
    let dest = folder.path().join("d");
    builder.seal(&dest).unwrap();
    assert_eq!(Release::open(&dest).unwrap().manifest().failed.len(), 1);
}

/// A pipe or a folder in place of a list of the release is unusable input.
#[cfg(unix)]
#[test]
fn val_lists_that_are_not_files_are_unusable_input() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("release");
    sealed(&dest);
    let refused = |name: &str, opened: bool| {
        let errors = [Some(verify(&dest).unwrap_err()), opened.then(|| Release::open(&dest).unwrap_err())];
        for error in errors.into_iter().flatten() {
            assert!(error.unusable_input() && error.to_string().contains(name), "{error}");
        }
    };
    for (name, opened) in [(MANIFEST, true), (SUMS, false)] {
        let list = dest.join(name);
        let bytes = fs::read(&list).unwrap();
        fs::remove_file(&list).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&list).status().unwrap().success());
        refused(name, opened);
        fs::remove_file(&list).unwrap();
        fs::create_dir(&list).unwrap();
        refused(name, opened);
        fs::remove_dir(&list).unwrap();
        fs::write(&list, bytes).unwrap();
    }
    assert_eq!(verify(&dest).unwrap().problems, vec![]);
}
