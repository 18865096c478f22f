//! Writing a study: starting studies, errors, and warnings about implausible settings.

use sastrugi_tests::{area, sastrugi_in, sums, write};
use serde_json::Value;
use std::path::Path;

const KINDS: [&str; 6] = ["terrain", "texture", "traverse", "navigate", "rover", "photoclinometry"];

fn planned(folder: &Path, study: &str) -> (Value, String) {
    let call = sastrugi_in(folder, &["plan", study, "--json"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    (serde_json::from_str(&call.stdout).unwrap(), call.stderr)
}

/// Every study to start from can be run as it is, once its DEM is there, and nothing of it is doubtful.
#[test]
fn val_studies_to_start_from_can_be_run() {
    let folder = area();
    let path = folder.path();
    std::fs::copy(sastrugi_fixtures::otira(), path.join("site.tif")).unwrap();
    for kind in KINDS {
        let file = format!("my-{kind}.toml");
        let call = sastrugi_in(path, &["init", kind, "-o", &file]);
        assert!(call.code == 0 && call.stdout.contains(&format!("sastrugi plan {file}")), "{kind}: {}", call.stderr);
        let text = std::fs::read_to_string(path.join(&file)).unwrap();
        assert!(text.starts_with("#:schema study.schema.json\n") && text.contains(&format!("sastrugi run {file}")));
        let (plan, warnings) = planned(path, &file);
        assert!(plan["items"].as_u64() > Some(3) && warnings.is_empty(), "{kind}: {warnings}");
    }
    // A schema of the program is replaced, another file of that name is not.
    let schema = path.join("study.schema.json");
    let own = std::fs::read(&schema).unwrap();
    std::fs::write(&schema, "{ \"title\": \"mine\" }").unwrap();
    let call = sastrugi_in(path, &["init", "-o", "other.toml"]);
    assert!(
        call.code == 2 && call.stderr.contains("study.schema.json is not a schema of this program"),
        "{}",
        call.stderr
    );
    assert!(!path.join("other.toml").exists());
    std::fs::write(&schema, own).unwrap();
    let call = sastrugi_in(path, &["init", "-o", "my-rover.toml"]);
    assert!(call.code == 2 && call.stderr.contains("exists"), "{}", call.stderr);
    assert!(std::fs::read_to_string(path.join("my-rover.toml")).unwrap().contains("sojourner_like"));
}

/// What is not a file is not a schema of the program either: it is not read, which could block for ever, and not replaced.
#[cfg(unix)]
#[test]
fn val_pipes_and_folders_are_not_schemas() {
    use std::os::unix::fs::FileTypeExt;
    let folder = area();
    let path = folder.path();
    let refused = |folder: &str| {
        let call = sastrugi_in(path, &["init", "-o", &format!("{folder}/study.toml")]);
        let words = "study.schema.json is not a schema of this program; move it";
        assert!(call.code == 2 && call.stderr.contains(words), "{folder}: {} {}", call.code, call.stderr);
        assert!(!path.join(folder).join("study.toml").exists());
    };
    std::fs::create_dir_all(path.join("folder/study.schema.json")).unwrap();
    refused("folder");
    std::fs::create_dir(path.join("pipe")).unwrap();
    let pipe = path.join("pipe/study.schema.json");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    refused("pipe");
    assert!(std::fs::metadata(&pipe).unwrap().file_type().is_fifo());
}

/// A link of the schema's name stays, whether it leads to nothing or to a schema of the program.
#[cfg(unix)]
#[test]
fn val_a_link_is_not_replaced_by_the_schema() {
    let folder = area();
    let path = folder.path();
    assert_eq!(sastrugi_in(path, &["init"]).code, 0);
    for target in ["nothing.json", "../study.schema.json"] {
        std::fs::create_dir_all(path.join("sub")).unwrap();
        let link = path.join("sub/study.schema.json");
        std::os::unix::fs::symlink(target, &link).unwrap();
        let call = sastrugi_in(path, &["init", "-o", "sub/study.toml"]);
        let words = "sub/study.schema.json: is a symbolic link, which the output would replace";
        assert!(call.code == 2 && call.stderr.contains(words), "{target}: {} {}", call.code, call.stderr);
        assert!(std::fs::read_link(&link).unwrap() == Path::new(target) && !path.join("sub/study.toml").exists());
        std::fs::remove_file(&link).unwrap();
    }
}

/// The terrains of the first study have a relief that a vehicle would notice and could drive on.
#[test]
fn val_the_first_study_gives_plausible_terrains() {
    let folder = area();
    let path = folder.path();
    assert_eq!(sastrugi_in(path, &["init", "terrain"]).code, 0);
    let call = sastrugi_in(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let mut terrains = 0;
    for file in std::fs::read_dir(path.join("release/terrain")).unwrap().map(|file| file.unwrap().path()) {
        let call = sastrugi_in(path, &["info", file.to_str().unwrap(), "--json"]);
        let info: Value = serde_json::from_str(&call.stdout).unwrap();
        let height = |key: &str| info[key].as_f64().unwrap_or_else(|| panic!("{key}: {info}"));
        let relief_m = height("height_max_m") - height("height_min_m");
        assert!((0.1..5.0).contains(&relief_m), "{}: {relief_m} m", file.display());
        terrains += 1;
    }
    assert_eq!(terrains, 11);
}

/// A plan with many items has a line for each stage, with the reasons of its items; before the first run it names no release.
#[test]
fn val_a_long_plan_is_told_by_stage() {
    let folder = area();
    let path = folder.path();
    let study = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\nlicense = \"CC0-1.0\"\n\n[[terrain]]\nid = \"a\"\n\
        kind = \"weierstrass_mandelbrot\"\nsize_px = [32, 32]\ncell_m = 0.2\ncount = 30\n";
    write(path, "study.toml", study);
    let call = sastrugi_in(path, &["plan", "study.toml"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let first = call.stdout;
    assert!(first.contains("; no results in ./release.work yet: all items are new\n"), "{first}");
    let lines: Vec<&str> = first.lines().skip(1).collect();
    let is_of = |line: &str, stage: &str| line.split_whitespace().take(3).eq([stage, "30", "items"]);
    assert!(lines.len() == 3 && is_of(lines[0], "terrain") && is_of(lines[1], "roughness"), "{first}");
    assert!(lines[0].ends_with("  new") && lines[2] == "  (--json lists all items)", "{first}");
    assert_eq!(planned(path, "study.toml").0["stale"].as_array().map(Vec::len), Some(60));
}

/// All that is wrong is told in one call, in the order of the text, and what follows from another error is not.
#[test]
fn val_all_errors_are_told_at_once() {
    let folder = area();
    let text = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-13-01\"\nauthors = [\"me\"]\n\n\
        [[dem]]\nid = \"site\"\npath = \"site.tif\"\n\n\
        [[fit]]\nid = \"snow\"\ndem = \"site\"\nouter_scale_m = 2.0\n\n\
        [[terrain]]\nid = \"a\"\nkind = \"multifractal\"\nn = 3\nresolution = 0.1\n\n\
        [[terrain]]\nid = \"b\"\nkind = \"multifractal\"\ncount = \"three\"\npng16 = 1\n\n\
        [[terrain]]\nid = \"c\"\nkind = \"gap\"\ncell_m = -1.0\n\n\
        [[missions]]\nid = \"m\"\nterrains = [\"a\", \"b\", \"d\"]\n\n\
        [[traverse]]\nid = \"t\"\nmissions = \"m\"\n\n\
        [[texture]]\nid = \"own\"\nfit = \"no-fit\"\nsize_m = [5.0, 5.0]\ncell_m = 0.1\n\n[more]\n";
    write(folder.path(), "study.toml", text);
    let call = sastrugi_in(folder.path(), &["plan", "study.toml"]);
    assert_eq!(call.code, 2, "{}", call.stderr);
    let told = [
        "YYYY-MM-DD",
        "unknown key `authors`",
        "did you mean `creators`?",
        "unknown key `path`",
        "did you mean `file`?",
        "unknown key `n`",
        "did you mean `count`?",
        "unknown key `resolution`",
        "did you mean `cell_m`?",
        "`count`",
        "`png16`",
        "`cell_m`",
        "`fit` names \"no-fit\"",
        "unknown section `more`",
    ];
    let mut rest = call.stderr.as_str();
    for words in told {
        let at = rest.find(words).unwrap_or_else(|| panic!("\"{words}\" is not in its place in: {}", call.stderr));
        rest = &rest[at + words.len()..];
    }
    assert!(call.stderr.contains("invalid study: 10 errors"), "{}", call.stderr);
    // The fit of a DEM that is refused, the missions on it and their traverse are not.
    for words in ["\"d\"", "names \"site\"", "names \"m\""] {
        assert!(!call.stderr.contains(words), "{}", call.stderr);
    }
}

/// An error far to the right in a line is given by line and column, and a long line beside one is not drawn: columns are counted in 16 bits where
/// lines are drawn, and such a line fills the screen.
#[test]
fn val_errors_in_long_lines_are_told_by_line_and_column() {
    let folder = area();
    let blanks = " ".repeat(70_000);
    let head =
        "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"t\"\nkind = \"multifractal\"\n";
    for (lines, words) in [
        (
            format!("high = {{{blanks}fractal_dimesion = 2.3}}\n"),
            "unknown key `high.fractal_dimesion` in terrain (line 9, column 70009)",
        ),
        (format!("size_px = [{blanks}64, 64] x\n"), "(line 9, column 70020)"),
        (format!("size_px = [{blanks}64, 64]\nsize_xp = 3\n"), "unknown key `size_xp` in terrain (line 10, column 1)"),
        (format!("size_xp = 3\nsize_px = [{blanks}64, 64]\n"), "unknown key `size_xp` in terrain (line 9, column 1)"),
    ] {
        write(folder.path(), "study.toml", &format!("{head}{lines}"));
        for arguments in [&["plan", "study.toml"][..], &["run", "study.toml", "-o", "release"]] {
            let call = sastrugi_in(folder.path(), arguments);
            assert_eq!(call.code, 2, "{}", call.stderr);
            let said: String = call.stderr.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
            assert!(said.contains(words), "\"{words}\" is not in: {said}");
            assert!(call.stderr.len() < 1000 && !call.stderr.contains("panicked"), "{} bytes", call.stderr.len());
        }
    }
    assert!(!folder.path().join("release").exists());
}

/// A table is read on without what is refused in it, so that its keys and its values are told in one call; suggestions are those of the table.
#[test]
fn val_all_errors_of_a_table_are_told_at_once() {
    let folder = area();
    let path = folder.path();
    assert_eq!(sastrugi_in(path, &["init", "traverse"]).code, 0);
    let text = std::fs::read_to_string(path.join("study.toml")).unwrap();
    let told = |from: &str, to: &str, words: &[&str]| {
        assert!(text.contains(from), "{from}");
        write(path, "wrong.toml", &text.replacen(from, to, 1));
        let call = sastrugi_in(path, &["plan", "wrong.toml"]);
        assert_eq!(call.code, 2, "{}", call.stderr);
        // Long sentences are wrapped, with a mark before the rest.
        let said: Vec<&str> = call.stderr.split_whitespace().filter(|word| *word != "│").collect();
        let said = said.join(" ");
        words.iter().for_each(|words| assert!(said.contains(words), "\"{words}\" is not in: {said}"));
        said
    };
    let all = ["3 errors", "unknown key `high.fractal_dimesion`", "`low.fractal_dimension`", "`png16`"];
    let wrong = "high.fractal_dimesion = 2.30\nlow.fractal_dimension = 9\npng16 = 1";
    let said = told("high.fractal_dimension = 2.30", wrong, &all);
    assert!(said.contains("did you mean `fractal_dimension`?") && !said.contains("missions \""), "{said}");
    told("speed_m_s = 1.0", "speed_m_s = -1.0\ntimeout_s = -1.0", &["2 errors", "`speed_m_s`", "`timeout_s`"]);
    told("\"multifractal\"", "\"multifractl\"", &["did you mean \"multifractal\"?"]);
    let vehicle = "speed_m_s = 1.0\nvehicle_changes.chassis.mas_kg = 60.0";
    told("speed_m_s = 1.0", vehicle, &["`mas_kg`", "did you mean `mass_kg`?"]);
    told("\"husky_a200\"", "\"husky_a20\"", &["did you mean \"husky_a200\"?"]);
    // `id` is given and so cannot be meant.
    let fit = |key: &str| format!("[[fit]]\nid = \"f\"\ndem = \"d2.30-0001\"\n{key} = 2.0\n\n[[missions]]");
    let said = told("[[missions]]", &fit("width_m"), &["unknown key `width_m` in fit"]);
    assert!(!said.contains("did you mean"), "{said}");
    told("[[missions]]", &fit("window"), &["unknown key `window` in fit", "did you mean `outer_scale_m`?"]);
    // A fit with an error of its own is there.
    let texture = "[[texture]]\nid = \"t\"\nfit = \"other\"\nsize_m = [5.0, 5.0]\ncell_m = 0.1\n\n[[missions]]";
    let both = fit("width_m").replace("[[missions]]", texture);
    told("[[missions]]", &both, &["`fit` names \"other\"", "in tables with errors: f"]);
}

/// What is wrong with a swept parameter is told at the sweep, not at the head of the table; a key of the table is not a parameter.
#[test]
fn val_errors_of_sweeps_are_told_at_the_sweep() {
    let folder = area();
    let head = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n\
        [[texture]]\nid = \"t\"\nfit = { model = \"exponential\", sigma_m = 0.03, range_m = 0.3 }\n";
    for (sweep, words) in [
        ("sweep.amplitude = [0.1, 0.2]", "`sweep` varies parameters, but `amplitude` is a key of [[texture]] itself"),
        ("sweep.onto = [\"a\", \"b\"]", "`onto` is a key of [[texture]] itself; write one [[texture]] for each value"),
        ("sweep.phases = [\"unit\"]", "`phases` is not a parameter of this method"),
        ("sweep.cell_m = [0.1, -1.0]", "`cell_m` is -1"),
    ] {
        write(folder.path(), "study.toml", &format!("{head}{sweep}\n"));
        let call = sastrugi_in(folder.path(), &["plan", "study.toml"]);
        let said: Vec<&str> = call.stderr.split_whitespace().filter(|word| *word != "│").collect();
        let said = said.join(" ");
        assert!(call.code == 2 && said.contains(words), "{} {said}", call.code);
        assert!(said.contains("[study.toml:9:") && said.contains(&format!("9 {sweep}")), "{said}");
    }
}

/// The parameters of a table with a wrong method, or with one that its fit does not permit, are not called unknown: they would be checked
/// against another method. Its other errors are told.
#[test]
fn val_parameters_of_a_wrong_method_are_not_checked() {
    let folder = area();
    let head = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n";
    let told = |table: &str, words: &[&str]| {
        write(folder.path(), "study.toml", &format!("{head}{table}"));
        let call = sastrugi_in(folder.path(), &["plan", "study.toml"]);
        assert_eq!(call.code, 2, "{}", call.stderr);
        let said: Vec<&str> = call.stderr.split_whitespace().filter(|word| *word != "│").collect();
        let said = said.join(" ");
        words.iter().for_each(|words| assert!(said.contains(words), "\"{words}\" is not in: {said}"));
        assert!(!said.contains("unknown key") && !said.contains("is not a parameter"), "{said}");
    };
    let texture = |more: &str| {
        format!("[[texture]]\nid = \"t\"\nfit = {{ model = \"exponential\", sigma_m = 0.03, range_m = 0.3 }}\n{more}\n")
    };
    let meant = "did you mean \"quasi_wavelets\"?";
    told(
        &texture("method = \"quasi_wavelet\"\nintermittency = 1.0"),
        &["invalid study ×", "`method` is `quasi_wavelet`", meant],
    );
    told(&texture("method = \"quasi_wavelet\"\nsweep.intermittency = [0.5, 1.0]"), &["invalid study ×", meant]);
    told(
        &texture("method = \"quasi_wavelet\"\nintermittency = 1.0\namplitude = -1.0"),
        &["2 errors", meant, "`amplitude` is -1"],
    );
    told(
        &texture("method = \"modulated\"\nlog_variance = 0.3"),
        &["invalid study ×", "needs the statistics of the residual"],
    );
}

/// Tables that refer to a refused table lack what it would define. That is not reported, but their own errors are, in the same call.
#[test]
fn val_errors_behind_a_refused_table_are_told_at_once() {
    let folder = area();
    let text = "[study]\nname = \"wrong\"\nseed = 1\ndate = \"2026-01-01\"\n\n\
        [[terrain]]\nid = \"t\"\nkind = \"gap\"\ncell_m = -1.0\n\n\
        [[fit]]\nid = \"f\"\ndem = \"t\"\nouter_scale_m = -1.0\n\n\
        [[texture]]\nid = \"x\"\nfit = \"f\"\nsize_m = [5.0, 5.0]\ncell_m = 0.1\namplitude = -1.0\n\n\
        [[image]]\nid = \"i\"\nsurface = \"t\"\nsamples = 0\n\n\
        [[photoclinometry]]\nid = \"p\"\nimages = [\"i\"]\nrounds = 99\n\n\
        [[missions]]\nid = \"m\"\nterrains = [\"t\"]\nlength_m = -1.0\n\n\
        [[missions]]\nid = \"w\"\nkind = \"routed\"\nof = \"m\"\nvehicle = \"tank\"\n\n\
        [[traverse]]\nid = \"d\"\nmissions = \"m\"\nspeed_m_s = -1.0\n\n\
        [[route]]\nid = \"r\"\nterrains = [\"t\"]\npairs = 0\n\n\
        [[navigate]]\nid = \"n\"\nroute = \"r\"\ncount = 0\n\n\
        [[rover]]\nid = \"v\"\nkind = \"sojourner_like\"\nterrains = [\"t\"]\nrovers = 0\n";
    write(folder.path(), "study.toml", text);
    let call = sastrugi_in(folder.path(), &["plan", "study.toml"]);
    assert!(call.code == 2 && call.stderr.contains("invalid study: 11 errors"), "{} {}", call.code, call.stderr);
    for key in [
        "cell_m",
        "outer_scale_m",
        "amplitude",
        "samples",
        "rounds",
        "length_m",
        "speed_m_s",
        "pairs",
        "count",
        "rovers",
    ] {
        assert!(call.stderr.contains(&format!("`{key}`")), "`{key}` is not in: {}", call.stderr);
    }
    assert!(call.stderr.contains("tank") && !call.stderr.contains("names \""), "{}", call.stderr);
}

/// A claim that so few terrains cannot support, and a vehicle that cannot be meant, are told before the run.
#[test]
fn val_doubts_are_told_before_the_run() {
    let folder = area();
    let path = folder.path();
    let call = sastrugi_in(path, &["init", "traverse"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let text = std::fs::read_to_string(path.join("study.toml")).unwrap();
    let told = |name: &str, text: &str, words: &[&str]| {
        write(path, name, text);
        let (plan, warnings) = planned(path, name);
        assert_eq!(plan["doubts"].as_array().map(Vec::len), Some(words.len()), "{warnings}");
        words.iter().for_each(|word| assert!(warnings.contains(word), "{word}: {warnings}"));
    };
    told("enough.toml", &text, &[]);
    let few = text.replace("count = 5", "count = 3");
    told(
        "few.toml",
        &few,
        &["with 3 and 3 terrains the smallest possible p is 0.10; use at least 4 terrains per group"],
    );
    let paired = text.replace("license =", "pairing = \"common\"\nlicense =");
    let words = "with 5 paired terrains the smallest possible p is 0.06; use at least 6 paired terrains";
    told("paired.toml", &paired, &[words]);
    let second = "\n[[hypothesis]]\nid = \"and-success\"\nstatistic = \"success\"\ngroups = [\"smooth\", \"rough\"]\ntest = \"difference\"\n";
    let family = text.replace("count = 5", "count = 4") + second;
    let words = "p is 0.06 over its family; use at least 5 terrains";
    told("family.toml", &family, &["\"rough-ground-shakes\" cannot", words]);
    let heavy = text.replace("speed_m_s = 1.0", "speed_m_s = 1.0\nvehicle_changes = { chassis = { mass_kg = 80.0 } }");
    told(
        "heavy.toml",
        &heavy,
        &["traverse \"husky\": chassis.mass_kg was changed to 80, but inertia_kg_m2 still belongs"],
    );
    let small = text.replacen("size_px = [1009, 1009]", "size_px = [600, 600]", 1);
    told(
        "small.toml",
        &small,
        &[
            "missions \"straight\" on \"d2.30-0001\" and on 4 more: cannot place missions of 35 m: the terrain is 30.00 x 30.00 m",
        ],
    );
    // Two weak claims of one family, and a strong one beside an equivalence, which Holm's steps leave alone.
    let mixed = text.replace("count = 5", "count = 4")
        + "\n[[hypothesis]]\nid = \"as-fast\"\nstatistic = \"time_s\"\ngroups = [\"smooth\", \"rough\"]\ntest = \"equivalence\"\nmargin = 2.0\n";
    told("mixed.toml", &mixed, &[]);
    // A shard is a part of the whole, with what it needs. Keys decide who drives the ten terrains: that one of four shards drives all has a chance of 4e-6.
    let count = |arguments: &[&str]| {
        let call = sastrugi_in(path, arguments);
        let plan: Value = serde_json::from_str(&call.stdout).unwrap();
        plan["items"].as_u64().unwrap()
    };
    let whole = count(&["plan", "enough.toml", "--json"]);
    let parts = ["1/4", "2/4", "3/4", "4/4"].map(|part| count(&["plan", "enough.toml", "--json", "--shard", part]));
    assert!(parts.iter().all(|part| *part < whole) && parts.iter().sum::<u64>() >= whole, "{parts:?} of {whole}");
}

/// Equivalence is tested with the scatter between terrains: with one terrain per group there is none, and no data can support the claim.
#[test]
fn val_an_equivalence_claim_needs_two_terrains_per_group() {
    let folder = area();
    let path = folder.path();
    assert_eq!(sastrugi_in(path, &["init", "traverse"]).code, 0);
    let text = std::fs::read_to_string(path.join("study.toml")).unwrap();
    let claim = text.replace("test = \"difference\"\ndirection = \"rises\"", "test = \"equivalence\"\nmargin = 2.0");
    assert_ne!(claim, text);
    let paired = claim.replace("license =", "pairing = \"common\"\nlicense =");
    for (text, with, name) in
        [(&claim, "1 and 1 terrains", "terrains"), (&paired, "1 paired terrain", "paired terrains")]
    {
        for (count, doubts) in [(1, 1), (2, 0)] {
            write(path, "claim.toml", &text.replace("count = 5", &format!("count = {count}")));
            let (plan, warnings) = planned(path, "claim.toml");
            assert_eq!(plan["doubts"].as_array().map(Vec::len), Some(doubts), "{count}: {warnings}");
            let words = format!("with {with} the smallest possible p is 1.00; use at least 2 {name} per group");
            assert_eq!(warnings.contains(&words), doubts == 1, "{count}: {warnings}");
        }
    }
}

/// A vehicle as `kinds` prints it is a vehicle file; a file with a base has what it does not change from there.
#[test]
fn val_vehicle_files_inherit() {
    let folder = area();
    let path = folder.path();
    let text = sastrugi_in(path, &["kinds", "husky_a200"]).stdout;
    for words in ["chassis.mass_kg", "46.034", "URDF, base_link inertial", "drive.torque_limit_n_m"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    write(path, "printed.json", &sastrugi_in(path, &["kinds", "husky_a200", "--json"]).stdout);
    write(path, "based.toml", "base = \"husky_a200\"\n[parameters.drive]\nspeed_limit_m_s = 0.8\n");
    write(path, "unchanged.toml", "base = \"husky_a200\"\n");
    write(path, "unknown.toml", "base = \"husky\"\n[parameters.drive]\nspeed_limit_m_s = 0.8\n");
    let terrain = ["terrain", "weierstrass_mandelbrot", "--set", "size_px=[200,200]", "-o", "t.tif"];
    assert_eq!(sastrugi_in(path, &terrain).code, 0);
    let drive = |vehicle: &str| {
        let arguments = ["traverse", "t.tif", "--vehicle", vehicle, "--missions", "1", "-o", "drive", "--quiet"];
        let more = ["--set-missions", "length_m=3.0", "--set-missions", "border_m=1.5"];
        let call = sastrugi_in(path, &[&arguments[..], &more].concat());
        let rows = (call.code == 0).then(|| sastrugi_tests::rows(&path.join("drive"), "parameters"));
        let _ = std::fs::remove_dir_all(path.join("drive"));
        let _ = std::fs::remove_dir_all(path.join("drive.work"));
        (call, rows.unwrap_or_default())
    };
    let value = |rows: &[sastrugi_tests::Row], name: &str| {
        let row = rows.iter().find(|row| row["parameter"] == name).unwrap_or_else(|| panic!("{name}"));
        row["value"].clone()
    };
    let (call, shipped) = drive("husky_a200");
    assert_eq!(call.code, 0, "{}", call.stderr);
    let (call, printed) = drive("printed.json");
    assert_eq!(call.code, 0, "{}", call.stderr);
    let (call, based) = drive("based.toml");
    assert_eq!(call.code, 0, "{}", call.stderr);
    for name in ["vehicle.chassis.mass_kg", "vehicle.tyre.rays", "vehicle.drive.torque_limit_n_m"] {
        let expected = value(&shipped, name);
        assert!(value(&printed, name) == expected && value(&based, name) == expected, "{name}");
    }
    assert_eq!(
        (value(&shipped, "vehicle.drive.speed_limit_m_s"), value(&based, "vehicle.drive.speed_limit_m_s")),
        ("1.0".into(), "0.8".into())
    );
    let (call, unchanged) = drive("unchanged.toml");
    assert_eq!((call.code, unchanged), (0, shipped), "{}", call.stderr);
    let (call, _) = drive("unknown.toml");
    let refused = "unknown.toml: `base` is `husky`; it must be one of ";
    assert!(call.code == 2 && call.stderr.contains(refused), "{}", call.stderr);
}

/// Twice the amplitude is twice the height of every cell, in a study and by the verb.
#[test]
fn val_textures_take_an_amplitude() {
    let folder = area();
    let path = folder.path();
    let study = |more: &str| {
        format!(
            "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n[[texture]]\nid = \"a\"\nseed = 4\n\
             fit = {{ model = \"exponential\", sigma_m = 0.03, range_m = 0.5 }}\nsize_m = [6.0, 6.0]\ncell_m = 0.1\n{more}"
        )
    };
    let roughness = |name: &str, more: &str| {
        write(path, "study.toml", &study(more));
        let call = sastrugi_in(path, &["run", "study.toml", "-o", name, "--quiet"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
        let row = &sastrugi_tests::rows(&path.join(name), "terrains")[0];
        assert_eq!(row["group"], "a", "labelled by its id");
        row["rms_height_m"].as_f64().unwrap()
    };
    let (plain, twice) = (roughness("plain", ""), roughness("twice", "amplitude = 2.0\n"));
    assert!((twice / plain - 2.0).abs() < 1e-6, "{plain} {twice}");
    write(path, "fit.json", "{ \"model\": \"exponential\", \"parameters\": { \"sigma_m\": 0.03, \"range_m\": 0.5 } }");
    let verb = [
        "texture",
        "fit.json",
        "--size",
        "6x6",
        "--cell",
        "0.1",
        "--seed",
        "4",
        "--amplitude",
        "2",
        "-o",
        "verb.tif",
        "--json",
    ];
    let call = sastrugi_in(path, &verb);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let heights = |name: &str| -> Vec<f64> {
        let call = sastrugi_in(path, &["convert", name, "heights.asc"]);
        assert_eq!(call.code, 0, "{name}: {}", call.stderr);
        let text = std::fs::read_to_string(path.join("heights.asc")).unwrap();
        let rows = text.lines().filter(|line| line.split_whitespace().count() > 2);
        rows.flat_map(str::split_whitespace).map(|z| z.parse().unwrap()).collect()
    };
    let [once, double] = ["plain/texture/a.tif", "twice/texture/a.tif"].map(heights);
    assert_eq!((once.len(), double.len()), (60 * 60, 60 * 60));
    assert!(once.iter().zip(&double).all(|(z, twice)| (2.0 * z - twice).abs() < 1e-6), "a cell is not twice as high");
    assert_eq!(heights("verb.tif"), double);
    for (more, words) in
        [("amplitude = 0.0\n", "above 0"), ("amplitude = 2.0\nmethods = \"all\"\n", "cannot be combined")]
    {
        write(path, "study.toml", &study(more));
        let call = sastrugi_in(path, &["plan", "study.toml"]);
        assert!(call.code == 2 && call.stderr.contains(words), "{more}: {}", call.stderr);
    }
    assert!(sums(&path.join("plain")).contains_key("texture/a.tif"));
}
