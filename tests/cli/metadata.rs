//! What a release says about itself: licences, sources, citation.

use sastrugi_tests::{area, rows, sastrugi_in, small_study, sums, write};
use serde_json::Value;
use std::collections::BTreeMap;
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
        ("CC-BY-SA-4.0", "must also be \"CC-BY-SA-4.0\""),
        ("CC-BY-NC-4.0", "must also be non-commercial"),
        ("CC-BY-ND-4.0", "permits no derivatives"),
    ] {
        write(folder.path(), "study.toml", &study("", &format!("license = \"{license}\"\n")));
        let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release"]);
        let said = call.stderr.split_whitespace().collect::<Vec<_>>().join(" ").replace(" │ ", " ");
        assert!(call.code == 2 && said.contains(words), "{license}: {} {}", call.code, call.stderr);
        assert!(!folder.path().join("release").exists());
    }
}

/// A wrong ORCID iD is told before anything runs, at its place.
#[test]
fn val_an_orcid_that_cannot_be_is_refused_at_plan() {
    let folder = area();
    let head = "creators = [{ name = \"Person, A.\", orcid = \"0000-0002-1825-0079\" }]\n";
    write(folder.path(), "study.toml", &study(head, ""));
    let call = sastrugi_in(folder.path(), &["plan", "study.toml"]);
    let said = call.stderr.split_whitespace().collect::<Vec<_>>().join(" ").replace(" │ ", " ");
    assert!(call.code == 2 && said.contains("checksum is wrong"), "{} {}", call.code, call.stderr);
}

#[test]
fn val_what_the_data_asks_for_goes_with_everything_made_from_it() {
    let folder = area();
    let head = "version = \"2.1\"\ndoi = \"10.5281/zenodo.1234567\"\nurl = \"https://example.org/rough\"\n\
        creators = [{ name = \"Person, A.\", orcid = \"0000-0002-1825-0097\", affiliation = \"A <lab>\" }, \"A group\"]\n\
        organizations = [\"A group\"]\nkeywords = [\"snow\"]\nfunding = [\"10.13039/501100000780::101122956\", \"A fund\"]\n";
    write(folder.path(), "terms.txt", "The agency's terms, whole.\n");
    let dem = "license = \"Terms of the agency\"\nlicense_file = \"terms.txt\"\nattribution = \"The agency\"\ncitation = \"Agency (2000), Heights\"\n";
    write(folder.path(), "study.toml", &study(head, dem));
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let release = folder.path().join("release");
    assert!(read(&release, "manifest.json").contains("it is unknown whether data under"));
    assert_eq!(read(&release, "dem/site.license.txt"), "The agency's terms, whole.\n");
    assert!(read(&release, "study.toml").contains("license_file = \"dem/site.license.txt\""));
    for name in ["README.md", "CITATION.cff", "LICENSE"] {
        let text = read(&release, name);
        for words in ["Terms of the agency", "The agency", "Agency (2000), Heights"] {
            assert!(text.contains(words), "{name} does not name {words}:\n{text}");
        }
    }
    let json = |name: &str| -> Value { serde_json::from_str(&read(&release, name)).unwrap() };
    let croissant = json("croissant.json");
    let kinds: Vec<&str> =
        croissant["creator"].as_array().unwrap().iter().filter_map(|c| c["@type"].as_str()).collect();
    assert_eq!(kinds, ["sc:Person", "sc:Organization"]);
    let crate_graph = json("ro-crate-metadata.json")["@graph"].clone();
    let group = crate_graph.as_array().unwrap().iter().find(|entity| entity["name"] == "A group").unwrap();
    assert_eq!(group["@type"], "Organization");
    let info = sastrugi_in(folder.path(), &["info", "release", "--json"]);
    assert_eq!(info.code, 0, "{}", info.stderr);
    let info: Value = serde_json::from_str(&info.stdout).unwrap();
    assert_eq!((&info["version"], &info["doi"]), (&"2.1".into(), &"10.5281/zenodo.1234567".into()));
    assert!(info["program"].as_str().unwrap().starts_with("sastrugi "), "{info}");
    let person = crate_graph.as_array().unwrap().iter().find(|entity| entity["name"] == "Person, A.").unwrap();
    assert_eq!(person["@id"], "https://orcid.org/0000-0002-1825-0097");
    let lab = crate_graph.as_array().unwrap().iter().find(|entity| entity["name"] == "A <lab>").unwrap();
    assert_eq!(person["affiliation"]["@id"], lab["@id"]);
    let deposit = json(".zenodo.json");
    assert_eq!(
        deposit["creators"],
        serde_json::json!([
            { "name": "Person, A.", "orcid": "0000-0002-1825-0097", "affiliation": "A <lab>" },
            { "name": "A group" },
        ])
    );
    assert_eq!(deposit["grants"], serde_json::json!([{ "id": "10.13039/501100000780::101122956" }]));
    assert_eq!((&deposit["license"], &deposit["version"]), (&"cc-by-4.0".into(), &"2.1".into()));
    assert_eq!((&deposit["keywords"][0], &deposit["notes"]), (&"snow".into(), &"Funding: A fund.".into()));
    let citation = read(&release, "CITATION.cff");
    assert!(citation.contains("    orcid: \"https://orcid.org/0000-0002-1825-0097\"\n    affiliation: \"A <lab>\"\n"));
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

/// Files that were there before are read by the stages and made by none; people whose names are spelled alike stay two.
#[test]
fn val_the_crate_tells_what_was_given_from_what_was_made() {
    let folder = area();
    write(folder.path(), "plot.geojson", PLOT);
    let masked = study("creators = [\"J. Doe\", \"J- Doe\"]\n", "").replacen(
        "bootstrap = 39\n",
        "bootstrap = 39\nmask = \"plot.geojson\"\n",
        1,
    );
    write(folder.path(), "study.toml", &masked);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let text = read(&folder.path().join("release"), "ro-crate-metadata.json");
    let graph = serde_json::from_str::<Value>(&text).unwrap()["@graph"].as_array().unwrap().clone();
    let mut ids: Vec<&str> = graph.iter().map(|entity| entity["@id"].as_str().unwrap()).collect();
    let count = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), count, "an id is there twice: {text}");
    let people = graph.iter().filter(|entity| entity["@type"] == "Person");
    assert_eq!(people.map(|person| &person["name"]).collect::<Vec<_>>(), ["J. Doe", "J- Doe"]);
    let linked = |stage: &str, key: &str| -> Vec<&str> {
        let action = graph.iter().find(|entity| entity["name"] == format!("stage {stage}"));
        let linked = action.and_then(|action| action[key].as_array()).into_iter().flatten();
        linked.filter_map(|entity| entity["@id"].as_str()).collect()
    };
    assert_eq!(linked("dem", "object"), ["dem/site.tif", "study.toml"]);
    assert_eq!(linked("dem", "result"), ["dem/site.metric.tif"]);
    assert_eq!(linked("fit", "object"), ["dem/site.metric.tif", "mask/fit-1.geojson", "study.toml"]);
    assert_eq!(linked("terrain", "object"), ["study.toml"]);
    for stage in ["original", "mask"] {
        assert!(linked(stage, "result").is_empty(), "stage {stage} makes nothing: {text}");
    }
}

/// West half of the fixture's window.
const PLOT: &str = r#"{"type": "Polygon", "coordinates":
    [[[-84.6, 36.4], [-84.2683, 36.4], [-84.2911, 36.7], [-84.6, 36.7], [-84.6, 36.4]]]}"#;

/// A part for every terrain, in tables and shards alike; the same release from one run, from shards, and computed again.
#[test]
fn val_terrains_are_split_the_same_everywhere() {
    let folder = area();
    let path = folder.path();
    let two = "[study]\nname = \"two\"\nseed = 5\ndate = \"2026-01-01\"\nsplit = [0.5, 0.25, 0.25]\n\n\
        [[terrain]]\nid = \"a\"\nkind = \"multifractal\"\ngroup = \"a\"\ncount = 4\nsize_px = [200, 200]\n\n\
        [[terrain]]\nid = \"b\"\nkind = \"weierstrass_mandelbrot\"\nsize_px = [64, 64]\n\n\
        [[missions]]\nid = \"m\"\nterrains = [\"a\"]\ncount = 1\nlength_m = 4.0\nborder_m = 1.5\n\n\
        [[traverse]]\nid = \"h\"\nmissions = \"m\"\n";
    write(path, "study.toml", two);
    let ok = |arguments: &[&str]| {
        let call = sastrugi_in(path, arguments);
        assert_eq!(call.code, 0, "{arguments:?}: {}{}", call.stdout, call.stderr);
    };
    ok(&["run", "study.toml", "-o", "release", "--quiet"]);
    let release = path.join("release");
    let parts: BTreeMap<String, Value> =
        rows(&release, "terrains").into_iter().map(|row| (text(&row["terrain_id"]), row["split"].clone())).collect();
    let count = |part: &str| parts.values().filter(|p| *p == part).count();
    assert_eq!((count("train"), count("validation"), count("test"), parts["b"].clone()), (2, 1, 1, Value::Null));
    let missions = rows(&release, "missions");
    assert!(!missions.is_empty());
    for mission in missions {
        assert_eq!(mission["split"], parts[&text(&mission["terrain_id"])], "{mission:?}");
    }
    let samples = rows(&release, "samples");
    assert!(!samples.is_empty());
    for sample in samples {
        assert_eq!(sample["split"], parts[&text(&sample["terrain_id"])], "{sample:?}");
    }
    let card = read(&release, "README.md");
    for words in [
        "  - config_name: missions\n    default: true\n    data_files:\n      - split: train\n        path:\n          - \"tables/missions/part-train.parquet\"\n",
        "      - split: other\n        path:\n          - \"tables/terrains/part-other.parquet\"\n",
        "  - config_name: samples\n    data_files:\n      - split: train\n        path:\n          - \"tables/samples/part-a-000",
    ] {
        assert!(card.contains(words), "{card}");
    }
    ok(&["verify", "release", "--recompute", "20", "--quiet"]);
    for shard in ["1/2", "2/2"] {
        ok(&["run", "study.toml", "-o", &format!("part{}", &shard[..1]), "--shard", shard, "--quiet"]);
    }
    ok(&["merge", "part1", "part2", "-o", "merged", "--quiet"]);
    assert_eq!(sums(&release), sums(&path.join("merged")));
    // Another split makes nothing again.
    write(path, "study.toml", &two.replace("[0.5, 0.25, 0.25]", "[0.25, 0.25, 0.5]"));
    let plan = sastrugi_in(path, &["plan", "study.toml", "-o", "release"]);
    assert!(plan.stdout.contains("0 to compute"), "{}", plan.stdout);
}

/// What a DEM's maker asks for, and how its heights are packed, decide no mission: the same release as from scratch, and only
/// the packed file is made again.
#[test]
fn val_a_citation_drives_no_mission_again() {
    let folder = area();
    let path = folder.path();
    let ok = |arguments: &[&str]| {
        let call = sastrugi_in(path, &[arguments, &["--json", "--quiet"]].concat());
        assert_eq!(call.code, 0, "{arguments:?}: {}{}", call.stdout, call.stderr);
        serde_json::from_str::<Value>(&call.stdout).unwrap()
    };
    ok(&["terrain", "multifractal", "--set", "size_px=[320, 300]", "--seed", "7", "-o", "site.tif"]);
    let study = "[study]\nname = \"cited\"\nseed = 7\ndate = \"2026-01-01\"\n\n\
        [[dem]]\nid = \"site\"\nfile = \"site.tif\"\nlicense = \"CC0-1.0\"\nattribution = \"Agency\"\ncitation = \"Agency (2000)\"\n\n\
        [[missions]]\nid = \"m\"\nterrains = [\"site\"]\ncount = 2\nlength_m = 5.0\nborder_m = 1.5\n\n\
        [[traverse]]\nid = \"h\"\nmissions = \"m\"\n";
    write(path, "study.toml", study);
    let computed = |study: &str, output: &str| {
        write(path, "study.toml", study);
        ok(&["run", "study.toml", "-o", output])["computed"].as_u64().unwrap()
    };
    assert_eq!(computed(study, "release"), 5);
    let cited = study.replace("CC0-1.0", "CC-BY-4.0").replace("Agency", "Survey").replace("(2000)", "(2001)");
    assert_eq!(computed(&cited, "release"), 0);
    let release = path.join("release");
    let documents = [
        "study.toml",
        "README.md",
        "CITATION.cff",
        "LICENSE",
        "croissant.json",
        "ro-crate-metadata.json",
        ".zenodo.json",
        "manifest.json",
    ];
    for name in documents {
        let text = read(&release, name);
        assert!(text.contains("Survey (2001)") && !text.contains("Agency"), "{name}:\n{text}");
    }
    let packed = cited.replace("seed = 7\n", "seed = 7\ngeotiff = \"cog\"\n");
    assert_eq!(computed(&packed, "release"), 1);
    assert_eq!(computed(&packed, "fresh"), 5);
    assert_eq!(sums(&release), sums(&path.join("fresh")));
    assert_eq!(ok(&["verify", "release", "--recompute", "5"])["differences"], serde_json::json!([]));
}

/// A texture that becomes one of several, or is alone again, gets and loses its note: the same release as from scratch.
#[test]
fn val_notes_follow_the_number_of_textures() {
    let folder = area();
    let path = folder.path();
    let ok = |arguments: &[&str]| {
        let call = sastrugi_in(path, &[arguments, &["--quiet"]].concat());
        assert_eq!(call.code, 0, "{arguments:?}: {}{}", call.stdout, call.stderr);
    };
    for (count, notes) in [(1, 0), (2, 2), (1, 0)] {
        let study = format!(
            "[study]\nname = \"tx\"\nseed = 7\ndate = \"2026-01-01\"\n\n[[texture]]\nid = \"tx\"\ncount = {count}\n\
             fit = {{ model = \"exponential\", sigma_m = 0.03, range_m = 0.28 }}\nphase = \"unit\"\nsize_m = [6.0, 6.0]\ncell_m = 0.1\n"
        );
        write(path, "study.toml", &study);
        ok(&["run", "study.toml", "-o", "release"]);
        let _ = std::fs::remove_dir_all(path.join("fresh"));
        let _ = std::fs::remove_dir_all(path.join("fresh.work"));
        ok(&["run", "study.toml", "-o", "fresh"]);
        assert_eq!(sums(&path.join("release")), sums(&path.join("fresh")));
        let manifest = read(&path.join("release"), "manifest.json");
        assert_eq!(manifest.matches("one of several textures").count(), notes, "{manifest}");
    }
}

fn text(value: &Value) -> String {
    value.as_str().unwrap().to_owned()
}
