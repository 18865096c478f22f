//! A small study of every section and every kind, on which processors and builds of the program are compared.

use sastrugi_fixtures::{jacksboro, otira, pozo_blanca};
use sastrugi_stages::registry::{kinds, section_names};
use sastrugi_stages::study::StudyText;
use sastrugi_tests::{area, called, sastrugi_in, sums, write};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

const STUDY: &str = include_str!("every_stage.toml");
/// Other flavours of recordings and rasters.
const FLAVOURS: &str = include_str!("flavours.toml");

/// The covariance of the snow that lies on one of the DEMs.
const SNOW: &str = r#"{"model": "exponential", "parameters": {"sigma_m": 0.1, "range_m": 3.0}}"#;

/// A folder with the study and its DEMs.
pub struct EveryStage {
    folder: tempfile::TempDir,
}

impl EveryStage {
    pub fn new() -> Self {
        let folder = area();
        let path = folder.path();
        write(path, "study.toml", STUDY);
        write(path, "flavours.toml", FLAVOURS);
        for dem in [jacksboro(), pozo_blanca(), otira()] {
            std::fs::copy(&dem, path.join(dem.file_name().unwrap())).unwrap();
        }
        write(path, "snow.json", SNOW);
        let snow = ["texture", "snow.json", "--size", "271x281", "--cell", "1", "--phase", "gaussian"];
        let call = sastrugi_in(path, &[&snow[..], &["--onto", "pozo_blanca.tif", "-o", "snow.tif"]].concat());
        assert_eq!(call.code, 0, "{}", call.stderr);
        Self { folder }
    }

    /// The checksums of the release that `program`, perhaps within an emulator, makes of the study in a folder of this name.
    pub fn release(&self, name: &str, program: &mut Command) -> BTreeMap<String, String> {
        self.run("study.toml", name, program)
    }

    /// The same of the study of other flavours.
    pub fn flavours(&self, name: &str, program: &mut Command) -> BTreeMap<String, String> {
        self.run("flavours.toml", &format!("flavours-{name}"), program)
    }

    fn run(&self, study: &str, name: &str, program: &mut Command) -> BTreeMap<String, String> {
        let path = self.folder.path();
        let call = called(program.args(["run", study, "-o", name, "--quiet"]).current_dir(path));
        assert_eq!(call.code, 0, "{name}: {}", call.stderr);
        sums(&path.join(name))
    }
}

/// The words of a text such as `"exponential+nugget,gaussian"`, or of a list of texts.
fn words(value: &Value) -> Vec<String> {
    let texts = value.as_array().map_or(vec![value], |list| list.iter().collect());
    texts.into_iter().filter_map(Value::as_str).flat_map(|text| text.split([',', '+'])).map(str::to_owned).collect()
}

/// Adds the words of all keys that name kinds, at any depth.
fn add_named(value: &Value, named: &mut BTreeSet<String>) {
    const KEYS: [&str; 7] = ["kind", "method", "methods", "model", "formation", "vehicle", "preset"];
    if let Value::Array(list) = value {
        list.iter().for_each(|entry| add_named(entry, named));
    }
    for (key, entry) in value.as_object().into_iter().flatten() {
        if KEYS.contains(&key.as_str()) {
            named.extend(words(entry));
        }
        add_named(entry, named);
    }
}

/// A new section or kind takes its place in the study, so that the comparisons miss nothing.
#[test]
fn val_the_study_has_every_section_and_every_kind() {
    let root = StudyText::parse(STUDY).unwrap().to_json().unwrap();
    let sections: Vec<&str> = section_names().into_iter().filter(|name| root.get(name).is_none()).collect();
    assert_eq!(sections, [""; 0], "sections that every_stage.toml lacks");
    let mut named = BTreeSet::new();
    add_named(&root, &mut named);
    let kinds = kinds();
    let missing: Vec<&str> = kinds.iter().map(|kind| kind.kind).filter(|kind| !named.contains(*kind)).collect();
    // Sections with one kind, which a study does not name.
    let only = ["covariance", "image", "photoclinometry", "pure_pursuit"];
    assert_eq!(missing, only, "kinds that every_stage.toml lacks");
}
