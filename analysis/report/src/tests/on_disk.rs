//! Reports of releases that `sastrugi-store` wrote.

use super::{assert_sound, made_up};
use crate::data::Data;
use crate::{Companions, ReportError, Summary, render, render_with};
use sastrugi_schemas::Record;
use sastrugi_schemas::manifest::{FailedItem, JsonText, Origin};
use sastrugi_schemas::tables::{PsdRow, StructureRow, SurfaceRow, TerrainRow};
use sastrugi_store::dem::{self, Crs};
use sastrugi_store::release::{Head, PartWriter, ReleaseBuilder, TablePart, for_each_artifact};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

const STUDY: &str =
    "[study]\nname = \"made-up\"\ntitle = \"A <title>\"\nseed = 7\ndate = \"2026-11-21\"\ncreators = [\"A\", \"B\"]\n";

fn write_table<R: Record + Sync>(builder: &mut ReleaseBuilder, name: &str, rows: Vec<R>) {
    let part = TablePart { table: &R::TABLE, name: name.to_owned(), origin: Default::default() };
    let fill = |_: &TablePart, writer: &mut PartWriter<'_>| rows.iter().try_for_each(|row| writer.push(row.cells()));
    builder.write_tables(vec![part], fill).unwrap();
}

fn head() -> Head {
    Head {
        name: "made-up".into(),
        study_sha256: "0".repeat(64),
        seed: 7,
        version: "0.1.0".into(),
        license: "CC-BY-4.0".into(),
    }
}

/// Reads a release, with the curves that are drawn.
fn open(release: &Path) -> Result<Data, ReportError> {
    Data::open(release, crate::questions::texture::undrawn)
}

/// A release that will be `dest`, not sealed.
fn assembled(dest: &Path) -> ReleaseBuilder {
    assembled_of(dest, made_up::parts(2, 40))
}

fn assembled_of(dest: &Path, (data, shelf): (Data, made_up::Shelf)) -> ReleaseBuilder {
    let mut builder = ReleaseBuilder::beside(dest, head()).unwrap();
    let folder = builder.staging().to_owned();
    for (path, grid) in &shelf.grids {
        dem::write(&folder.join(path), grid, &Crs::default(), &Default::default()).unwrap();
    }
    for (path, codes) in &shelf.classes {
        dem::write_classes(&folder.join(path), codes, &Crs::default()).unwrap();
    }
    shelf.grids.keys().chain(shelf.classes.keys()).for_each(|path| builder.adopt(path, Origin::default()).unwrap());
    for (path, fit) in &shelf.fits {
        builder.write_text(path, &serde_json::to_string(fit).unwrap(), Origin::default()).unwrap();
    }
    builder.write_text("study.toml", STUDY, Origin::default()).unwrap();
    write_table(&mut builder, TablePart::WHOLE, data.terrains);
    write_table(&mut builder, TablePart::WHOLE, data.fits);
    write_table(&mut builder, TablePart::WHOLE, data.covariance);
    write_table(&mut builder, TablePart::WHOLE, data.candidates);
    write_table(&mut builder, TablePart::WHOLE, data.candidate_curves);
    write_table(&mut builder, TablePart::WHOLE, data.likelihood_profile);
    write_table(&mut builder, TablePart::WHOLE, data.surfaces);
    write_table(&mut builder, TablePart::WHOLE, data.structure);
    write_table(&mut builder, TablePart::WHOLE, data.profile_psd);
    write_table(&mut builder, TablePart::WHOLE, data.psd);
    write_table(&mut builder, TablePart::WHOLE, data.heights);
    write_table(&mut builder, TablePart::WHOLE, data.missions);
    write_table(&mut builder, TablePart::WHOLE, data.replicates);
    write_table(&mut builder, TablePart::WHOLE, data.routes);
    write_table(&mut builder, TablePart::WHOLE, shelf.route_points);
    write_table(&mut builder, TablePart::WHOLE, data.formations);
    write_table(&mut builder, TablePart::WHOLE, data.formation_events);
    for (terrain, samples) in shelf.formation_samples {
        write_table(&mut builder, &terrain, samples);
    }
    for (terrain, samples) in shelf.samples {
        write_table(&mut builder, &terrain, samples);
    }
    builder
}

fn report(release: &Path) -> (BTreeMap<String, String>, Summary) {
    let out = tempfile::tempdir().unwrap();
    let summary = render(release, out.path(), &|_| ()).unwrap();
    let read =
        |path: &std::path::PathBuf| (path.display().to_string(), fs::read_to_string(out.path().join(path)).unwrap());
    (summary.files.iter().map(read).collect(), summary)
}

#[test]
fn prop_a_release_reads_the_same_before_and_after_sealing() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("release");
    let builder = assembled(&dest);
    let before = report(builder.staging());
    assert_sound(&before.0);
    for of in ["mission-", "routes-", "formation-tracks-", "loss-errors-"] {
        assert!(before.1.figures.iter().any(|f| f.starts_with(of)), "{of}: {:?}", before.1.figures);
    }
    assert!(before.0["index.html"].contains("<h1>A &lt;title&gt;</h1>"));
    builder.seal(&dest).unwrap();
    assert_eq!(before, report(&dest));
}

/// Missions in one file per split are those of a single file, in the order of their keys, and share their names.
#[test]
fn prop_missions_of_several_files_are_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let missions = made_up::parts(2, 24).0.missions;
    let stored = |name: &str, files: usize| {
        let mut builder = ReleaseBuilder::beside(&folder.path().join(name), head()).unwrap();
        for file in 0..files {
            let rows = missions.iter().enumerate().filter(|(k, _)| k % files == file).map(|(_, m)| m.clone()).collect();
            write_table(&mut builder, &format!("{file:04}"), rows);
        }
        open(builder.staging()).unwrap().missions
    };
    let cells = |missions: Vec<crate::data::Mission>| missions.iter().map(Record::cells).collect::<Vec<_>>();
    let whole = cells(stored("whole", 1));
    assert_eq!(whole, cells(missions.clone()));
    assert_eq!(cells(stored("parts", 3)), whole);
}

/// Of textures, the curves of those that are drawn are read: one that does not match its site, the last of seven, is one of them. Of the others only
/// the structure function of the residual over all directions is held, with which they are judged.
#[test]
fn val_curves_of_the_textures_that_are_drawn_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let (mut data, shelf) = made_up::parts(1, 24);
    let texture = data.of_stage("texture").next().unwrap().clone();
    let surface = data.surface("texture.residual").unwrap().clone();
    let psd = data.spectrum("texture")[0].clone();
    data.fits.iter_mut().for_each(|fit| fit.stationarity_p = 0.5);
    for k in 1..=6 {
        let id = format!("u-{k}");
        let sq_m = if k == 6 { 4.0 * surface.sq_m } else { surface.sq_m };
        data.terrains.push(TerrainRow { terrain_id: id.clone(), ..texture.clone() });
        data.psd.push(PsdRow { surface_id: id.clone(), ..psd.clone() });
        let surface_id = format!("{id}.residual");
        data.surfaces.push(SurfaceRow { surface_id, cells: 2_000_000, sq_m, ..surface.clone() });
        // At a lag that the site lacks, so that it does not enter the answer.
        let lag = StructureRow { lag_m: 1e6, ..data.structure_of("texture", "all")[0].clone() };
        let directions = [("", "all"), (".residual", "all"), (".residual", "x")];
        data.structure.extend(directions.map(|(end, direction)| StructureRow {
            surface_id: format!("{id}{end}"),
            direction: direction.into(),
            ..lag.clone()
        }));
    }
    data.structure.sort_by(|a, b| a.surface_id.cmp(&b.surface_id));
    let builder = assembled_of(&folder.path().join("release"), (data, shelf));
    let read = open(builder.staging()).unwrap();
    let is_read = |id: &str| read.psd.iter().any(|row| row.surface_id == id);
    assert_eq!(["texture", "u-1", "u-2", "u-6"].map(is_read), [true; 4]);
    assert_eq!(["u-3", "u-4", "u-5"].map(is_read), [false; 3]);
    let structures = |id: &str| read.structure.iter().filter(|row| row.surface_id == id).count();
    assert_eq!(["u-6", "u-6.residual", "u-5", "u-5.residual"].map(structures), [1, 2, 0, 1]);
    assert!(read.without_curves.contains("u-5.residual") && !read.without_curves.contains("u-6.residual"));
}

#[test]
fn val_failed_items_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("release");
    let mut builder = assembled(&dest);
    let parameters = Some(JsonText::from(&serde_json::json!({ "size_m": [1, 1] })));
    builder.failed(FailedItem { stage: "terrain".into(), item: "x".into(), error: "too small".into(), parameters });
    builder.seal(&dest).unwrap();
    let (files, _) = report(&dest);
    assert!(files["index.html"].contains("1 item of the study failed"));
    assert!(files["data/failed.json"].contains("too small"));
    assert!(files["data/failed.json"].contains(r#"{\"size_m\":[1,1]}"#), "{}", files["data/failed.json"]);
}

/// Hypotheses are read from the study file; an invalid one makes the file unreadable.
#[test]
fn val_hypotheses_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let builder = assembled(&folder.path().join("release"));
    let staging = builder.staging().to_owned();
    let claim =
        "[[hypothesis]]\nid = \"h\"\nstatistic = \"success\"\ngroups = [\"2.30\", \"2.60\"]\ntest = \"equivalence\"\n";
    fs::write(staging.join("study.toml"), format!("{STUDY}{claim}margin = 10\nalpha = 0.1\n")).unwrap();
    let (files, _) = report(&staging);
    assert!(files["data/hypotheses.json"].contains("differ by less than 10 points"));
    fs::write(staging.join("study.toml"), format!("{STUDY}{claim}")).unwrap();
    let error = render(&staging, &folder.path().join("out"), &|_| ()).unwrap_err();
    assert!(error.to_string().contains("margin"), "{error}");
}

/// The disk of the class maps is read from the study, also as an integer.
#[test]
fn val_roughness_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let builder = assembled(&folder.path().join("release"));
    let staging = builder.staging().to_owned();
    let radius_m = || open(&staging).unwrap().study.roughness.closing_radius_m;
    assert_eq!(radius_m(), 0.57);
    fs::write(staging.join("study.toml"), format!("{STUDY}[roughness]\nclosing_radius_m = 1\n")).unwrap();
    assert_eq!(radius_m(), 1.0);
}

/// An unusable companion is refused in one sentence.
#[test]
fn val_unusable_companions_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let builder = assembled(&folder.path().join("release"));
    let staging = builder.staging().to_owned();
    let error = |companions: Companions| {
        let error = render_with(&staging, &companions, &folder.path().join("out"), &|_| ()).unwrap_err();
        assert!(error.unusable_input());
        error.to_string()
    };
    let against = |path: &Path| error(Companions { against: Some(path.to_owned()), ..Companions::default() });
    assert!(against(&folder.path().join("nowhere")).contains("not a sastrugi release"));
    let logs = |path: &Path| error(Companions { logs: vec![path.to_owned()], ..Companions::default() });
    assert!(logs(&folder.path().join("no.parquet")).contains("sastrugi analyze -o"));
    assert!(logs(&staging.join("tables/missions/part-0000.parquet")).contains("sastrugi analyze -o"));
    assert!(logs(&staging.join("study.toml")).contains("sastrugi analyze -o"));
}

/// A file in place of the report, of the folder above it or of a folder in it, and files of others in it: each is named, and stays.
#[test]
fn val_what_is_in_the_way_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let [release, page] = ["release", "page"].map(|name| folder.path().join(name));
    fs::create_dir(&release).unwrap();
    fs::write(release.join("study.toml"), STUDY).unwrap();
    let refused = |out: &Path| {
        let error = render(&release, out, &|_| ()).unwrap_err();
        assert!(matches!(error, ReportError::Occupied { .. }) && !error.unusable_input(), "{error}");
        error.to_string()
    };
    fs::write(&page, "mine").unwrap();
    let is_file = format!("{} is a file, not a folder; choose another folder with -o", page.display());
    assert_eq!([refused(&page), refused(&page.join("below"))], [is_file.as_str(); 2]);
    assert_eq!(fs::read_to_string(&page).unwrap(), "mine");
    fs::remove_file(&page).unwrap();
    for (file, named) in [
        ("thesis.tex", "thesis.tex"),
        ("figures", "figures"),
        ("data", "data"),
        ("index.html/x", "index.html"),
        ("figures/a.png", "figures/a.png"),
        ("data/a.svg", "data/a.svg"),
        ("data/without-ending", "data/without-ending"),
    ] {
        let path = page.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, "mine").unwrap();
        let expected = format!(
            "{} contains {named}, which is not part of a report; choose another folder with -o",
            page.display()
        );
        assert_eq!(refused(&page), expected);
        assert_eq!(fs::read_to_string(&path).unwrap(), "mine", "{file}");
        fs::remove_dir_all(&page).unwrap();
    }
    // Files of an earlier report are replaced.
    for file in ["index.html", "figures/old.svg", "data/old.json"] {
        let path = page.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "old").unwrap();
    }
    render(&release, &page, &|_| ()).unwrap();
    assert!(fs::read_to_string(page.join("index.html")).unwrap().starts_with("<!DOCTYPE html>"));
    assert!(!page.join("figures/old.svg").exists() && !page.join("data/old.json").exists());
}

/// Paths in tables are those of the release: whatever leads out of it counts as missing, although the file exists.
#[test]
fn val_paths_lead_to_files_of_the_release() {
    let folder = tempfile::tempdir().unwrap();
    let builder = assembled(&folder.path().join("release"));
    let staging = builder.staging().to_owned();
    let inside = "dem/jacksboro.metric.tif";
    let outside = staging.parent().unwrap().join("outside.tif");
    fs::copy(staging.join(inside), &outside).unwrap();
    let files = open(&staging).unwrap().files;
    assert!(files.grid(inside).unwrap().is_some());
    let absolute = outside.display().to_string();
    for path in ["../outside.tif", "dem/../../outside.tif", absolute.as_str(), "dem/missing.tif", "dem"] {
        assert!(files.grid(path).unwrap().is_none(), "{path}");
    }
}

/// The head of the page has what the study states; creators are texts or tables.
#[test]
fn val_the_study_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let study = |more: &str| {
        fs::write(folder.path().join("study.toml"), format!("{STUDY}license = \"CC0-1.0\"\n{more}")).unwrap();
        open(folder.path()).unwrap().study
    };
    let plain = study("description = \"Two hills.\"\n");
    assert_eq!((plain.name.as_str(), plain.title.as_str(), plain.seed), ("made-up", "A <title>", 7));
    assert_eq!((plain.date.as_str(), plain.license.as_str()), ("2026-11-21", "CC0-1.0"));
    assert_eq!((plain.description.as_str(), plain.creators), ("Two hills.", vec!["A".to_owned(), "B".to_owned()]));
    assert_eq!((plain.version.as_str(), study("version = \"1.2\"\n").version.as_str()), ("", "1.2"));
    let facts = |version: &str| format!("<dt>version</dt><dd>{version}</dd>");
    let page = report(folder.path()).0.remove("index.html").unwrap();
    assert!(page.contains(&facts("1.2")), "the head of the page names the version of the dataset");
    study("");
    assert!(!report(folder.path()).0["index.html"].contains("<dt>version</dt>"));
    let creators = |toml: &str| {
        fs::write(folder.path().join("study.toml"), format!("[study]\n{toml}")).unwrap();
        open(folder.path()).unwrap().study.creators
    };
    assert_eq!(creators("creators = [{ name = \"A\", orcid = \"0\" }, \"B\"]\n"), ["A", "B"]);
    assert_eq!(creators("[[study.creators]]\nname = \"C\"\n[[study.creators]]\nname = \"D\"\n"), ["C", "D"]);
}

/// Why a release cannot be read; `None` if it can.
fn refusal(release: &Path) -> Option<String> {
    let error = open(release).err()?;
    assert!(error.unusable_input(), "{error}");
    Some(error.to_string())
}

/// Of a sealed release, every file that the manifest lists and the report reads must be there: one that is missing, or that a folder
/// replaces, is named. Recordings are not read. Without a manifest, whatever is missing is left out.
#[test]
fn val_listed_files_must_be_there() {
    let folder = tempfile::tempdir().unwrap();
    let [dest, aside, out] = ["release", "aside", "out"].map(|name| folder.path().join(name));
    let mut builder = assembled(&dest);
    builder.write_text("mcap/a/1.mcap", "recorded", Origin::default()).unwrap();
    builder.seal(&dest).unwrap();
    assert_eq!(refusal(&dest), None);
    let mut listed = Vec::new();
    for_each_artifact(&dest, |artifact| listed.push(artifact.path)).unwrap();
    for kind in
        ["study.toml", "classes/", "dem/", "fit/", "tables/missions/", "tables/samples/", "terrain/", "texture/"]
    {
        assert!(listed.iter().any(|path| path.starts_with(kind)), "{kind}");
    }
    let refused = |path: &str, fault: &str| {
        format!(
            "read {path} of the release: {fault}, although manifest.json lists it; `sastrugi verify` finds all such files"
        )
    };
    for path in listed.iter().filter(|path| !path.starts_with("mcap/")) {
        let file = dest.join(path);
        fs::rename(&file, &aside).unwrap();
        assert_eq!(refusal(&dest), Some(refused(path, "missing")));
        fs::create_dir(&file).unwrap();
        assert_eq!(refusal(&dest), Some(refused(path, "not a regular file")));
        fs::remove_dir(&file).unwrap();
        fs::rename(&aside, &file).unwrap();
    }
    fs::remove_file(dest.join("mcap/a/1.mcap")).unwrap();
    assert_eq!(refusal(&dest), None);

    // The same of the release to compare with; nothing is written.
    let table = "tables/missions/part-0000.parquet";
    fs::remove_file(dest.join(table)).unwrap();
    let companions = Companions { against: Some(dest.clone()), ..Companions::default() };
    let whole = assembled(&folder.path().join("whole"));
    let error = render_with(whole.staging(), &companions, &out, &|_| ()).unwrap_err();
    assert!(error.unusable_input() && error.to_string().contains(&format!("{table}: missing")), "{error}");
    assert!(!out.exists());
    fs::remove_file(dest.join("manifest.json")).unwrap();
    assert_eq!(refusal(&dest), None);
}

/// A pipe in place of the manifest or of a file is refused, neither taken for a missing file nor waited for.
#[cfg(unix)]
#[test]
fn val_pipes_are_not_missing_files() {
    let folder = tempfile::tempdir().unwrap();
    let dest = folder.path().join("release");
    assembled(&dest).seal(&dest).unwrap();
    let replaced_by_a_pipe = |path: &str| {
        let file = dest.join(path);
        fs::remove_file(&file).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&file).status().unwrap().success());
        let refused = refusal(&dest).unwrap();
        fs::remove_file(&file).unwrap();
        refused
    };
    for path in ["tables/missions/part-0000.parquet", "manifest.json", "tables/fits/part-0000.parquet"] {
        let refused = replaced_by_a_pipe(path);
        assert!(refused.starts_with(&format!("read {path} of the release: ")), "{refused}");
    }
}

#[test]
fn val_unusable_releases_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let error = |release: &Path| render(release, &folder.path().join("out"), &|_| ()).unwrap_err();
    let said = |path: &Path| match error(path) {
        refused @ ReportError::NotARelease { .. } => refused.to_string(),
        other => panic!("{other}"),
    };
    assert!(said(&folder.path().join("nowhere")).ends_with(": not a sastrugi release: no such folder"));
    assert!(said(folder.path()).ends_with("it has neither study.toml nor tables/"));
    let file = folder.path().join("file");
    fs::write(&file, "text").unwrap();
    assert!(said(&file).ends_with("it is a file, not a folder"));
    let builder = assembled(&folder.path().join("release"));
    let staging = builder.staging().to_owned();
    let damage = |path: &str, bytes: &[u8]| {
        let whole = fs::read(staging.join(path)).unwrap();
        fs::write(staging.join(path), bytes).unwrap();
        let error = error(&staging);
        fs::write(staging.join(path), whole).unwrap();
        (matches!(&error, ReportError::Read { path: named, .. } if named == path), error.unusable_input())
    };
    for path in
        ["tables/missions/part-0000.parquet", "fit/jacksboro-paper.json", "dem/jacksboro.metric.tif", "study.toml"]
    {
        assert_eq!(damage(path, b"\x00[["), (true, true), "{path}");
    }
    assert!(render(&staging, &folder.path().join("out"), &|_| ()).is_ok());
}
