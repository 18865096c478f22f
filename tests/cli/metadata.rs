//! What a release says of itself: licences, sources, citation.

use sastrugi_tests::{area, sastrugi_in, small_study, write};
use serde_json::Value;
use std::path::Path;

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
}

/// The small study without missions, with lines of its own for `[study]` and its DEM.
fn study(head: &str, dem: &str) -> String {
    let driven = small_study();
    let rest = driven.split("[[missions]]").next().unwrap();
    rest.replace("seed = 7\n", &format!("seed = 7\n{head}"))
        .replace("id = \"site\"\n", &format!("id = \"site\"\n{dem}"))
}

#[test]
fn val_a_licence_that_the_data_does_not_permit_is_refused() {
    let folder = area();
    for (license, words) in [
        ("CC-BY-SA-4.0", "must be \"CC-BY-SA-4.0\" as well"),
        ("CC-BY-NC-4.0", "must be non-commercial too"),
        ("CC-BY-ND-4.0", "permits no derivatives"),
    ] {
        write(folder.path(), "study.toml", &study("", &format!("license = \"{license}\"\n")));
        let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release"]);
        let said = call.stderr.split_whitespace().collect::<Vec<_>>().join(" ").replace(" │ ", " ");
        assert!(call.code == 2 && said.contains(words), "{license}: {} {}", call.code, call.stderr);
        assert!(!folder.path().join("release").exists());
    }
}

#[test]
fn val_what_the_data_asks_for_goes_with_everything_made_from_it() {
    let folder = area();
    let head = "version = \"2.1\"\ndoi = \"10.5281/zenodo.1234567\"\nurl = \"https://example.org/rough\"\ncreators = [\"A. Person\"]\n";
    let dem =
        "license = \"Terms of the agency\"\nattribution = \"The agency\"\ncitation = \"Agency (2000), Heights\"\n";
    write(folder.path(), "study.toml", &study(head, dem));
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    assert!(call.stderr.contains("is not known here"), "{}", call.stderr);
    let release = folder.path().join("release");
    for name in ["README.md", "CITATION.cff", "LICENSE"] {
        let text = read(&release, name);
        for words in ["Terms of the agency", "The agency", "Agency (2000), Heights"] {
            assert!(text.contains(words), "{name} does not name {words}:\n{text}");
        }
    }
    let citation = read(&release, "CITATION.cff");
    for line in ["version: \"2.1\"", "doi: \"10.5281/zenodo.1234567\"", "url: \"https://example.org/rough\""] {
        assert!(citation.contains(line), "{citation}");
    }
    let manifest: Value = serde_json::from_str(&read(&release, "manifest.json")).unwrap();
    assert_eq!(manifest["sources"][0]["attribution"], "The agency");
    assert!(manifest["notes"].as_array().unwrap().iter().any(|n| n["item"] == "site" && n["stage"] == "dem"));
    for artifact in manifest["artifacts"].as_array().unwrap() {
        let path = artifact["path"].as_str().unwrap();
        let of_site =
            ["dem/site", "fit/", "texture/tile", "classes/site", "classes/tile"].iter().any(|p| path.starts_with(p));
        let named = artifact["sources"].as_array().is_some_and(|s| s == &["site"]);
        assert_eq!(named, of_site, "{path}: {artifact}");
    }
}
