//! Bad input gives one clear message and the documented exit code, writes no file, and never panics.

use sastrugi_tests::{Called, area, sastrugi_in, small_study, write};
use std::path::Path;

const USAGE: i32 = 2;
const INPUT: i32 = 65;

/// The call is refused with the code and the words, nothing is written, nothing panics.
fn refused(folder: &Path, arguments: &[&str], code: i32, words: &[&str]) {
    let before = listing(folder);
    let Called { code: found, stdout, stderr } = sastrugi_in(folder, arguments);
    assert_eq!(found, code, "{arguments:?}: {stdout}{stderr}");
    assert!(!stderr.contains("panicked") && !stderr.contains("RUST_BACKTRACE"), "{arguments:?}: {stderr}");
    for word in words {
        assert!(stderr.contains(word), "{arguments:?}: \"{word}\" is not in: {stderr}");
    }
    assert_eq!(listing(folder), before, "{arguments:?} left files behind");
}

fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A study with one change is refused before anything is written.
fn study_refused(from: &str, to: &str, words: &[&str]) {
    let folder = area();
    let text = small_study();
    assert!(text.contains(from), "{from}");
    write(folder.path(), "study.toml", &text.replacen(from, to, 1));
    refused(folder.path(), &["run", "study.toml"], USAGE, words);
}

#[test]
fn val_studies_are_refused_with_the_line() {
    study_refused("seed = 7", "seed = ", &["not valid TOML", "study.toml"]);
    study_refused("seed = 7", "sead = 7", &["unknown key `sead`", "did you mean `seed`?"]);
    study_refused("outer_scale_m = 4000.0", "outer_scale = 4000.0", &["unknown key `outer_scale`", "outer_scale_m"]);
    study_refused("kind = \"multifractal\"", "kind = \"multifactal\"", &["multifactal", "weierstrass_mandelbrot"]);
    study_refused("size_px = [320, 300]", "size_px = [-320, 300]", &["size_px"]);
    study_refused("size_px = [320, 300]", "size_px = [2, 300]", &["size_px"]);
    study_refused("size_px = [320, 300]", "cell_m = nan", &["not finite"]);
    study_refused("size_px = [320, 300]", "cell_m = 0.0", &["cell_m", "above 0"]);
    study_refused("fit = \"naive\"", "fit = \"naif\"", &["naif", "did you mean \"naive\"?"]);
    study_refused("terrains = [\"rough\", \"smooth\"]", "terrains = [\"ruff\"]", &["ruff"]);
    study_refused("id = \"tile\"", "id = \"site\"", &["is taken"]);
    study_refused("count = 2", "count = 0", &["1 or more"]);
    study_refused("missions = \"short\"", "missions = \"short\"\nvehicle = \"tank\"", &["tank", "husky_a200"]);
    study_refused("missions = \"short\"", "missions = \"short\"\nimu_rate_hz = 7", &["imu_rate_hz", "divide"]);
    study_refused("missions = \"short\"", "missions = \"short\"\nstep_rate_hz = 100", &["step_rate_hz", "unstable"]);
    study_refused(
        "size_px = [320, 300]",
        "size_px = [320, 300]\ncell_m = 0.9",
        &["cells of 0.9 m", "wheelbase", "missions"],
    );
    study_refused("[[fit]]", "[[fitt]]", &["unknown section `fitt`"]);
    let joined =
        "[[terrain]]\nid = \"joined\"\nkind = \"compose\"\nprocesses = [\n{ kind = \"cascade\" },\n5,\n]\n\n[[fit]]";
    study_refused("[[fit]]", joined, &["processes.1", "must be a process"]);
    study_refused("date = \"2026-01-01\"", "date = \"yesterday\"", &["YYYY-MM-DD"]);
}

/// Exports that no simulator takes: one sentence with what would be right, and no file.
#[test]
fn val_exports_are_refused() {
    study_refused("count = 2", "exports = [\"unrael\"]", &["unrael", "unreal", "mujoco"]);
    study_refused(
        "size_px = [320, 300]",
        "size_px = [4200, 300]\nexports = [\"unity\"]",
        &["unity", "4097 posts a side"],
    );
    let folder = area();
    let path = folder.path();
    let head = "ncols 3\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 0.5\nnodata_value -9999\n";
    write(path, "holed.asc", &format!("{head}1 2 3\n4 -9999 6\n7 8 9\n"));
    write(path, "row.asc", &format!("{}1 2 3\n", head.replace("nrows 3", "nrows 1")));
    write(path, "file", "");
    for target in ["unreal", "unity", "gazebo", "mujoco"] {
        refused(
            path,
            &["convert", "holed.asc", "out", "--for", target],
            USAGE,
            &[target, "has 1 cell without data", "--fill"],
        );
    }
    refused(path, &["convert", "row.asc", "out.glb"], USAGE, &["out.glb", "no three neighbouring cells"]);
    refused(
        path,
        &["convert", "holed.asc", "out", "--for", "unreal", "--crop"],
        USAGE,
        &["fewer than 127 posts a side"],
    );
    refused(path, &["convert", "holed.asc", "out.tif", "--crop"], USAGE, &["--for"]);
    refused(
        path,
        &["convert", "row.asc", "out", "--for", "isaac"],
        USAGE,
        &["isaac", "a surface needs at least 2 x 2 cells, got 3 x 1"],
    );
    refused(path, &["convert", "holed.asc", "out", "--for", "blender"], USAGE, &["blender", "unreal", "isaac"]);
    refused(path, &["convert", "holed.asc", "file", "--for", "isaac"], USAGE, &["file is a file"]);
    refused(path, &["convert", "holed.asc", "out", "--for", "isaac", "--cog"], USAGE, &["--cog requires a GeoTIFF"]);
    refused(path, &["convert", "holed.asc", "out"], USAGE, &["unknown extension", ".usda"]);
}

/// Windows beyond their surface and cells that do not go together are refused before anything runs, with the place in the study and what
/// would be right.
#[test]
fn val_places_are_refused_before_the_run() {
    let folder = area();
    let path = folder.path();
    let head = "ncols 10\nnrows 10\nxllcorner 100\nyllcorner 200\ncellsize 2\nnodata_value -9999\n";
    write(path, "site.asc", &format!("{head}{}", "1 2 1.5 2.5 1 2 1 3 2 1\n".repeat(10)));
    let told = |tables: &str| {
        let study = "[study]\nname = \"places\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"site\"\nfile = \"site.asc\"\n";
        write(path, "study.toml", &format!("{study}{tables}"));
        let call = sastrugi_in(path, &["plan", "study.toml"]);
        // Long sentences are wrapped, with a mark before the rest.
        let words: Vec<&str> = call.stderr.split_whitespace().filter(|word| *word != "│").collect();
        (call.code, words.join(" "))
    };
    let fine = |origin: &str| {
        format!(
            "[[terrain]]\nid = \"fine\"\nkind = \"elaborate\"\ndem = \"site\"\norigin_m = {origin}\nsize_px = [20, 20]\ncell_m = 0.5\n"
        )
    };
    let joined = |origin: &str, of: &str| {
        format!(
            "[[terrain]]\nid = \"small\"\nkind = \"spheroids\"\nsize_px = [8, 8]\ncell_m = 1.0\n\
             [[terrain]]\nid = \"joined\"\nkind = \"compose\"\nsize_px = [20, 20]\ncell_m = 0.5\norigin_m = {origin}\n\
             processes = [{{ of = \"{of}\" }}]\n"
        )
    };
    let texture = |model: &str, more: &str| {
        format!(
            "[[fit]]\nid = \"f\"\ndem = \"site\"\nmodel = \"{model}\"\nouter_scale_m = 6.0\n\
             [[texture]]\nid = \"t\"\nfit = \"f\"\nsize_m = [60.0, 60.0]\n{more}\n"
        )
    };
    let posts = "x 101 to 119, y 201 to 219 m";
    for (tables, words) in [
        (
            "window = [0.0, 0.0, 10.0, 10.0]\n".to_owned(),
            &["dem \"site\"", "which covers [100.0, 200.0, 120.0, 220.0]"],
        ),
        (fine("[90.0, 205.0]"), &["terrain \"fine\": `origin_m`", posts]),
        (joined("[115.0, 205.0]", "site"), &["terrain \"joined\": `processes.0.of` names \"site\"", posts]),
        (joined("[0.0, 0.0]", "small"), &["names \"small\"", "x 0.5 to 7.5, y 0.5 to 7.5 m"]),
        (
            texture("empirical", "cell_m = 3.0"),
            &["texture \"t\": `cell_m`", "whole multiples of the measured covariance's, 2 x 2 m"],
        ),
        (texture("empirical", "cell_m = 2.0\nmethod = \"gaussians\""), &["`method`", "only `fft_ma` can synthesise"]),
        (
            texture("exponential", "").replace("outer_scale_m = 6.0", "outer_scale_m = 7.0"),
            &["fit \"f\"", "the outer scale of 7 m is more than a third of the DEM; it must be at most 6.66"],
        ),
        // One value of a sweep is enough: it is named, and the sweep is shown.
        (
            texture("exponential", "").replace("outer_scale_m = 6.0", "sweep.outer_scale_m = [6.0, 7.0]"),
            &["the outer scale of 7 m is more than a third of the DEM", "sweep.outer_scale_m = [6.0, 7.0]"],
        ),
        (
            texture("exponential", "").replace("outer_scale_m = 6.0", "outer_scale_m = 5.0"),
            &["fit \"f\"", "the outer scale of 5 m is less than three cells of 2 m"],
        ),
        (
            texture("exponential", "").replace("outer_scale_m = 6.0", "outer_scale_m = 6.0\nmax_lag_m = 11.0"),
            &["fit \"f\"", "`max_lag_m` is 11 m; it must be at most half the DEM's side, 10 m"],
        ),
        (
            texture("exponential", "cell_m = 1.0\nonto = \"site\""),
            &["`cell_m`", "generate the texture at the base's cell size, or leave out `cell_m`"],
        ),
        (
            fine("[105.0, 205.0]") + &texture("exponential", "method = \"quilting\"\nonto = \"fine\""),
            &["`onto` does not match the site", "`quilting` works only on the cells of the site"],
        ),
    ] {
        let (code, told) = told(&tables);
        assert_eq!(code, USAGE, "{tables}: {told}");
        words.iter().for_each(|word| assert!(told.contains(word), "{tables}: \"{word}\" is not in: {told}"));
    }
    for tables in [
        fine("[105.0, 205.0]"),
        joined("[105.0, 205.0]", "site"),
        texture("empirical", "cell_m = 4.0"),
        texture("exponential", "cell_m = 2.0\nonto = { background = \"f\" }"),
    ] {
        assert_eq!(told(&tables).0, 0, "{tables}: {}", told(&tables).1);
    }
}

/// Options of meshes for what holds none, limits that make no sense, and vehicles that are not known.
#[test]
fn val_vehicles_and_decimations_are_refused() {
    study_refused("count = 2", "exports = [\"unity\"]\nexport_max_error_m = 0.1", &["export_max_error_m", "isaac"]);
    study_refused(
        "count = 2",
        "exports = [\"isaac\"]\nexport_max_error_m = -0.1",
        &["is -0.1; it must be a finite number"],
    );
    let folder = area();
    let path = folder.path();
    write(path, "a.asc", "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3 5\n");
    refused(
        path,
        &["convert", "a.asc", "b.tif", "--max-error", "1"],
        USAGE,
        &["b.tif", "apply to meshes only", ".glb"],
    );
    refused(path, &["convert", "a.asc", "b", "--for", "unity", "--triangles", "9"], USAGE, &["isaac"]);
    refused(path, &["convert", "a.asc", "b.obj", "--max-error", "-1"], USAGE, &["must be 0 m or more, got -1 m"]);
    refused(path, &["convert", "a.asc", "b.obj", "--triangles", "1"], USAGE, &["take 2 triangles"]);
    refused(path, &["convert", "a.asc", "b.obj", "--surface", "ice"], USAGE, &["--surface applies to vehicles only"]);
    refused(path, &["convert", "husky", "b.xml"], USAGE, &["`husky`", "`husky_a200`"]);
    refused(path, &["convert", "husky_a200", "b.obj"], USAGE, &["is a vehicle", ".urdf"]);
    refused(path, &["convert", "husky_a200", "b.urdf", "--surface", "mud"], USAGE, &["mud", "hard_soil"]);
    refused(
        path,
        &["convert", "husky_a200", "b.urdf", "--window", "0,0,1,1"],
        USAGE,
        &["the only option for a vehicle is --surface"],
    );
    refused(path, &["convert", "none.toml", "b.urdf"], INPUT, &["none.toml"]);
}

/// A wheel meets the longer side of a cell.
#[test]
fn val_oblong_cells_are_judged_by_their_longer_side() {
    let folder = area();
    let study = small_study().replace("cell_m = 90.0", "cell_m = [0.4, 90.0]");
    let study = study.replace("terrains = [\"rough\", \"smooth\"]", "terrains = [\"tile\"]");
    write(folder.path(), "study.toml", &study);
    refused(folder.path(), &["plan", "study.toml"], USAGE, &["cells of 90 m", "wheelbase", "missions"]);
}

/// A hypothesis that cannot be tested is refused before anything runs, with its place.
#[test]
fn val_hypotheses_are_refused_with_the_line() {
    let good =
        "\n[[hypothesis]]\nid = \"h\"\nstatistic = \"success\"\ngroups = [\"a\", \"b\"]\ntest = \"difference\"\n";
    let refused = |from: &str, to: &str, words: &[&str]| {
        assert!(good.contains(from), "{from}");
        study_refused(
            "missions = \"short\"\n",
            &format!("missions = \"short\"\n{}", good.replacen(from, to, 1)),
            words,
        );
    };
    refused("success", "sucess", &["sucess", "rms_pitch_rate_deg_s", "statistic"]);
    refused("\"b\"", "\"c\"", &["no missions are driven in group \"c\"", "known: a, b"]);
    refused("\"b\"", "\"a\"", &["twice"]);
    refused("difference", "trend", &["three or more"]);
    refused("difference", "same", &["same", "equivalence"]);
    refused("\"difference\"", "\"equivalence\"", &["margin", "is missing"]);
    refused("\"difference\"", "\"difference\"\nmargin = 1", &["margin", "equivalence"]);
    refused("\"difference\"", "\"difference\"\nalpha = 0.6", &["alpha", "below 0.5"]);
    refused("\"difference\"", "\"difference\"\nalpa = 0.1", &["unknown key `alpa`", "did you mean `alpha`?"]);
    refused("\"h\"", "\"husky\"", &["is taken by an item of [[traverse]]"]);
    refused("[[hypothesis]]", &format!("{good}[[hypothesis]]"), &["\"h\"", "is taken"]);
    refused("\"difference\"", "\"difference\"\ntraverse = \"nobody\"", &["traverse", "nobody", "husky"]);
    let second = "[[traverse]]\nid = \"again\"\nmissions = \"short\"\n\n[[hypothesis]]";
    refused("[[hypothesis]]", second, &["traverse", "is missing", "again, husky"]);
    let swept = "missions = \"short\"\nsweep.speed_m_s = [0.5, 1.0]\n";
    let hypothesis = format!("{swept}{good}");
    study_refused("missions = \"short\"\n", &hypothesis, &["traverse", "no traverse without a sweep"]);
    let other = good.replace("\"h\"", "\"k\"") + "alpha = 0.01\n";
    study_refused(
        "missions = \"short\"\n",
        &format!("missions = \"short\"\n{good}{other}"),
        &["alpha", "shares one level"],
    );
}

#[test]
fn val_missing_files_are_input_errors() {
    let folder = area();
    refused(folder.path(), &["run", "nothing.toml"], INPUT, &["nothing.toml", "no such file"]);
    refused(folder.path(), &["info", "nothing.tif"], INPUT, &["nothing.tif", "no such file"]);
    std::fs::create_dir(folder.path().join("missions")).unwrap();
    write(&folder.path().join("missions"), "part-0000.parquet", "");
    refused(folder.path(), &["info", "missions"], INPUT, &["a folder of Parquet files; name one of them"]);
    refused(folder.path(), &["verify", "nothing"], INPUT, &["nothing"]);
    refused(folder.path(), &["merge", "nothing", "-o", "x"], INPUT, &["nothing"]);
    refused(folder.path(), &["fit", "nothing.tif", "-o", "fit.json"], INPUT, &["no such file"]);
    refused(folder.path(), &["texture", "nothing.json", "-o", "t.tif"], INPUT, &["nothing.json"]);
    refused(folder.path(), &["traverse", "nothing.tif"], INPUT, &["no such file"]);
    refused(folder.path(), &["report", "nothing"], INPUT, &["nothing"]);
    refused(folder.path(), &["report", "nothing", "--against", "none"], INPUT, &["nothing"]);
    // A path that leads through a file.
    write(folder.path(), "file", "");
    for verb in ["roughness", "analyze", "plan", "traverse"] {
        refused(folder.path(), &[verb, "file/x"], INPUT, &["file/x: no such file"]);
    }
    let study = small_study().replace("jacksboro.tif", "gone.tif");
    write(folder.path(), "study.toml", &study);
    refused(folder.path(), &["run", "study.toml"], INPUT, &["gone.tif", "no such file"]);
}

/// A folder that is not a release is refused as such, although the output lies inside it, and before any progress is shown.
#[test]
fn val_other_folders_are_not_called_releases() {
    let folder = area();
    std::fs::write(folder.path().join("diary.txt"), "mine").unwrap();
    let verbs: [&[&str]; 5] = [
        &["report", ".", "-o", "page"],
        &["pack", ".", "-o", "a.tar"],
        &["pack", ".", "-o", "../no-release.tar"],
        &["convert", ".", "dataset", "--for", "lerobot"],
        &["verify", "."],
    ];
    for arguments in verbs {
        let call = sastrugi_in(folder.path(), arguments);
        let is_refused = call.code == INPUT && call.stderr.contains(".: not a sastrugi release: it has n");
        assert!(is_refused && call.stderr.lines().count() == 1, "{arguments:?}: {} {}", call.code, call.stderr);
        assert_eq!(listing(folder.path()), ["diary.txt"], "{arguments:?}");
    }
}

#[test]
fn val_bad_calls_are_usage_errors() {
    let folder = area();
    let run = |arguments: &[&str], words: &[&str]| refused(folder.path(), arguments, USAGE, words);
    run(&["terrain", "nothing", "-o", "t.tif"], &["nothing", "multifractal"]);
    run(&["terrain", "multifractal", "--set", "hight=1", "-o", "t.tif"], &["hight", "high"]);
    run(
        &["terrain", "multifractal", "--set", "high.fractal_dimension=3.5", "-o", "t.tif"],
        &["fractal_dimension", "3.5"],
    );
    run(&["terrain", "multifractal", "--set", "size_m=[-1.0,1.0]", "-o", "t.tif"], &["size_m"]);
    run(&["terrain", "multifractal", "-o", "t.xyz"], &["t.xyz", ".tif"]);
    run(&["terrain", "multifractal", "--set", "size_px=[64,64]", "-o", "t.hgt"], &["t.hgt"]);
    run(&["frobnicate"], &["frobnicate"]);
    run(&["run"], &["STUDY"]);
    run(&["kinds", "multifractl"], &["did you mean `multifractal`?"]);
    run(&["schema", "nothing"], &["missions"]);
    run(&["terrain", "multifractal", "--threads", "0", "-o", "t.tif"], &["--threads"]);
    write(folder.path(), "study.toml", &small_study());
    run(&["run", "study.toml", "--shard", "4/3"], &["1 <= I <= N"]);
    run(&["fit", "a.tif", "--outer-scale", "two"], &["two", "expected a number"]);
    run(&["traverse", "a.tif", "--missions", "many"], &["many", "expected a whole number"]);
    run(&["run", "study.toml", "--memory", "-1"], &["--memory"]);
    std::fs::create_dir(folder.path().join("mine")).unwrap();
    write(&folder.path().join("mine"), "thesis.txt", "precious");
    run(&["run", "study.toml", "-o", "mine"], &["not empty"]);
    run(&["run", "study.toml", "-o", "study.toml"], &["is a file"]);
}

#[test]
fn val_bad_rasters_are_input_errors() {
    let folder = area();
    let path = folder.path();
    let grid =
        |text: &str| format!("ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n{text}");
    write(path, "empty.tif", "");
    std::fs::write(
        path.join("random.tif"),
        (0..4096u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 13) as u8).collect::<Vec<u8>>(),
    )
    .unwrap();
    let jacksboro = std::fs::read(sastrugi_fixtures::jacksboro()).unwrap();
    std::fs::write(path.join("truncated.tif"), &jacksboro[..jacksboro.len() / 2]).unwrap();
    std::fs::write(path.join("stub.tif"), &jacksboro[..40]).unwrap();
    write(path, "short.asc", &grid("1 2 3\n4 5\n"));
    write(path, "long.asc", &grid("1 2 3\n4 5 6 7\n"));
    write(path, "words.asc", &grid("1 2 3\n4 five 6\n"));
    write(path, "void.asc", &grid("-9999 -9999 -9999\n-9999 -9999 -9999\n"));
    write(path, "huge.asc", "ncols 99999999999\nnrows 99999999999\nxllcorner 0\nyllcorner 0\ncellsize 1\n1\n");
    write(path, "negative.asc", "ncols -3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1\n");
    write(path, "odd.hgt", "12345");
    write(path, "bad.npy", "\u{93}NUMPY nonsense");
    for name in [
        "empty.tif",
        "random.tif",
        "truncated.tif",
        "stub.tif",
        "short.asc",
        "long.asc",
        "words.asc",
        "void.asc",
        "huge.asc",
        "negative.asc",
        "odd.hgt",
        "bad.npy",
    ] {
        refused(path, &["info", name], INPUT, &[name]);
        refused(path, &["convert", name, "out.tif"], INPUT, &[name]);
        refused(path, &["fit", name, "-o", "fit.json"], INPUT, &[name]);
        refused(path, &["roughness", name], INPUT, &[name]);
    }
}

/// A band that is invalid, that the DEM does not hold, or whose metrics cannot be compared.
#[test]
fn val_bands_of_vehicles_are_refused() {
    let folder = area();
    let path = folder.path();
    let level = "1 ".repeat(64 * 64);
    write(path, "dem.asc", &format!("ncols 64\nnrows 64\nxllcorner 0\nyllcorner 0\ncellsize 0.2\n{level}\n"));
    let roughness = |more: &[&str], code: i32, words: &[&str]| {
        refused(path, &[&["roughness", "dem.asc"], more].concat(), code, words);
    };
    roughness(&["--vehicle", "wb=2.7"], USAGE, &["wb=WHEELBASE,r=TYRE_RADIUS"]);
    roughness(&["--vehicle", "wb=2.7,r=big"], USAGE, &["wb=WHEELBASE,r=TYRE_RADIUS"]);
    roughness(&["--vehicle", "wb=0,r=0.4"], USAGE, &["wheelbase must be positive"]);
    roughness(&["--vehicle", "wb=1,r=-0.4"], USAGE, &["tyre radius must be positive"]);
    roughness(&["--vehicle", "wb=0.1,r=0.4"], USAGE, &["limits of a wavelength band", "increasing"]);
    roughness(&["--vehicle", "tank"], USAGE, &["tank", "husky_a200"]);
    roughness(&["--band", "0.4"], USAGE, &["MIN:MAX"]);
    roughness(&["--band", "3:0.4"], USAGE, &["limits of a wavelength band", "increasing", "3 to 0.4 m"]);
    roughness(
        &["--vehicle", "wb=1,r=0.33"],
        INPUT,
        &["cells of 0.2 m are too coarse", "at most 0.165 m", "--allow-coarse"],
    );
    roughness(&["--band", "0.4:4"], INPUT, &["at least 16 m"]);
    roughness(&["--detrend", "ma"], USAGE, &["--vehicle", "--band"]);
    roughness(&["--rms-map", "rms.txt"], USAGE, &["--vehicle", "--band"]);
    roughness(&["--band", "0.4:3", "--vehicle", "husky_a200"], USAGE, &["cannot be used with"]);
    let map = ["--band", "0.4:3", "--rms-map", "rms.txt", "--rms-predicted", "dem.asc"];
    roughness(&[&map[..], &["--detrend", "ma"]].concat(), USAGE, &["results of other detrenders are not comparable"]);
    write(path, "other.asc", "ncols 3\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 0.2\n1 1 1 1 1 1 1 1 1\n");
    let other = ["--band", "0.4:3", "--rms-map", "rms.txt", "--rms-predicted", "other.asc"];
    roughness(&other, INPUT, &["other.asc", "cells"]);
}

/// A wind that has no direction, and scales that the DEM does not hold.
#[test]
fn val_winds_are_refused() {
    let folder = area();
    let path = folder.path();
    let level = "1 ".repeat(64 * 64);
    write(path, "dem.asc", &format!("ncols 64\nnrows 64\nxllcorner 0\nyllcorner 0\ncellsize 0.2\n{level}\n"));
    let roughness = |more: &[&str], code: i32, words: &[&str]| {
        refused(path, &[&["roughness", "dem.asc"], more].concat(), code, words);
    };
    roughness(&["--wind-from", "north"], USAGE, &["--wind-from", "north"]);
    roughness(&["--wind-from", "0,nan"], USAGE, &["finite number of degrees"]);
    roughness(&["--wind=0"], USAGE, &["--wind"]);
    roughness(&["--wind", "--wind-from", "0"], USAGE, &["cannot be used with"]);
    roughness(&["--outer-scale", "2"], USAGE, &["--wind"]);
    roughness(&["--wind", "--outer-scale", "-2"], USAGE, &["positive length"]);
    roughness(&["--wind", "--outer-scale", "0.2"], INPUT, &["at least 3 cells"]);
    roughness(&["--wind", "--outer-scale", "50"], INPUT, &["too wide", "12.8 x 12.8 m"]);
}

#[test]
fn val_rasters_that_cannot_be_fitted_say_why() {
    let folder = area();
    let path = folder.path();
    let flat = "1 ".repeat(64 * 64);
    write(path, "flat.asc", &format!("ncols 64\nnrows 64\nxllcorner 0\nyllcorner 0\ncellsize 0.1\n{flat}\n"));
    refused(path, &["fit", "flat.asc", "--outer-scale", "1", "-o", "fit.json"], INPUT, &["flat or a plane"]);
    refused(path, &["fit", "flat.asc", "--outer-scale", "5", "-o", "fit.json"], INPUT, &["outer scale of 5 m"]);
    refused(path, &["fit", "flat.asc", "--outer-scale", "-1", "-o", "fit.json"], USAGE, &["outer_scale_m"]);
    refused(path, &["fit", "flat.asc", "--trim", "0.7", "-o", "fit.json"], USAGE, &["trim"]);
    refused(path, &["fit", "flat.asc", "--window", "9,9,10,10", "-o", "fit.json"], INPUT, &["window"]);
    refused(path, &["fit", "flat.asc", "--mode", "magic", "-o", "fit.json"], USAGE, &["magic"]);
    write(path, "fit.json", "{\"model\": \"exponential\", \"parameters\": {\"sigma_m\": -1.0, \"range_m\": 0.3}}");
    refused(path, &["texture", "fit.json", "-o", "t.tif"], USAGE, &["sigma_m"]);
    write(path, "not.json", "{\"a\": 1}");
    refused(path, &["texture", "not.json", "-o", "t.tif"], INPUT, &["not a fit file"]);
}

/// An ESRI ASCII grid of 96 x 96 cells of 0.1 m.
fn ascii(cell_m: f64, height: impl Fn(u32, u32) -> f64) -> String {
    let mut text = format!("ncols 96\nnrows 96\nxllcorner 0\nyllcorner 0\ncellsize {cell_m}\nNODATA_value -9999\n");
    for row in 0..96 {
        let line: Vec<String> = (0..96).map(|col| height(row, col).to_string()).collect();
        text.push_str(&line.join(" "));
        text.push('\n');
    }
    text
}

/// Heights without any relation between neighbours.
fn noise(row: u32, col: u32) -> f64 {
    let mut bits = row.wrapping_mul(0x9E37_79B9) ^ col.wrapping_mul(0x85EB_CA6B);
    for _ in 0..3 {
        bits = (bits ^ (bits >> 15)).wrapping_mul(0x2C1B_3C6D);
    }
    f64::from(bits >> 16) / 65536.0
}

/// Everything that a fit cannot use: one sentence and the code, no file.
#[test]
fn val_everything_that_a_fit_refuses() {
    let folder = area();
    let path = folder.path();
    write(path, "white.asc", &ascii(0.1, noise));
    write(path, "flat.asc", &ascii(0.1, |_, _| 3.0));
    write(path, "void.asc", &ascii(0.1, |_, _| -9999.0));
    write(path, "sparse.asc", &ascii(0.1, |row, col| if (row + col) % 4 == 0 { noise(row, col) } else { -9999.0 }));
    let fit = |dem: &str, more: &[&str], code: i32, words: &[&str]| {
        let arguments = [&["fit", dem, "-o", "fit.json"], more].concat();
        refused(path, &arguments, code, words);
        let stderr = sastrugi_in(path, &arguments).stderr;
        assert_eq!(stderr.lines().count(), 1, "one sentence: {stderr}");
    };
    let scale = |metres| ["--outer-scale", metres];
    fit("white.asc", &scale("5"), INPUT, &["9.6 m x 9.6 m", "outer scale of 5 m", "at most a third"]);
    fit("white.asc", &scale("4"), INPUT, &["outer scale of 4 m", "a third of the DEM", "3.2"]);
    fit("white.asc", &scale("0.2"), INPUT, &["outer scale of 0.2 m", "three cells"]);
    fit("white.asc", &scale("0"), USAGE, &["outer_scale_m", "above 0"]);
    fit("white.asc", &scale("nan"), USAGE, &["outer"]);
    fit("white.asc", &scale("1"), INPUT, &["white", "0.1 m", "no covariance to fit"]);
    fit("white.asc", &[&scale("1")[..], &["--mode", "paper"]].concat(), INPUT, &["white"]);
    fit("white.asc", &["--trim", "0"], USAGE, &["trim"]);
    fit("white.asc", &["--trim", "0.5"], USAGE, &["trim"]);
    fit("flat.asc", &scale("1"), INPUT, &["flat or a plane", "rounding error"]);
    fit("void.asc", &scale("1"), INPUT, &["void.asc", "none of the 96 x 96 cells holds data"]);
    fit("sparse.asc", &scale("1"), INPUT, &["0.5 of its window", "min_valid_share"]);
    let ring = "[[-1, -1], [99, -1], [99, 99], [-1, 99], [-1, -1]]";
    write(path, "all.geojson", &format!("{{\"type\": \"Polygon\", \"coordinates\": [{ring}]}}"));
    fit("white.asc", &["--exclude", "all.geojson"], INPUT, &["none of the DEM's cells"]);
}

#[test]
fn val_everything_that_a_texture_refuses() {
    let folder = area();
    let path = folder.path();
    let fit = |sigma_m: f64, range_m: f64| {
        let parameters = format!("{{\"sigma_m\": {sigma_m}, \"range_m\": {range_m}}}");
        write(path, "fit.json", &format!("{{\"model\": \"exponential\", \"parameters\": {parameters}}}"));
    };
    let texture = ["texture", "fit.json", "--size", "8x8", "--cell", "0.1", "-o", "t.tif"];
    for (sigma_m, range_m, key) in [(0.0, 0.3, "sigma_m"), (-1.0, 0.3, "sigma_m"), (0.1, 0.0, "range_m")] {
        fit(sigma_m, range_m);
        refused(path, &texture, USAGE, &[key, "above 0"]);
    }
    let notes = |arguments: &[&str]| {
        let call = sastrugi_in(path, arguments);
        assert_eq!(call.code, 0, "{}", call.stderr);
        call.stdout
    };
    fit(0.1, 0.15);
    assert!(notes(&texture).contains("more than half the range"), "{}", notes(&texture));
    fit(0.1, 3.0);
    let cropped = [&texture[..], &["--set", "periodic=false"]].concat();
    refused(path, &texture, USAGE, &["not positive definite", "periodic = false"]);
    assert!(!notes(&cropped).contains("half the range"));
}

/// Degrees become metres with a note that says where; a point cloud in degrees is refused by its reader.
#[test]
fn val_a_geographic_raster_is_converted_with_a_note() {
    let folder = area();
    let dem = sastrugi_fixtures::jacksboro();
    let arguments = ["fit", dem.to_str().unwrap(), "--outer-scale", "4000", "--mode", "paper", "-o", "fit.json"];
    let call = sastrugi_in(folder.path(), &arguments);
    assert_eq!(call.code, 0, "{}", call.stderr);
    assert!(call.stdout.contains("note: geographic raster converted to metres at its centre latitude 36."));
}

#[test]
fn val_bad_masks_are_input_errors() {
    let folder = area();
    let path = folder.path();
    std::fs::copy(sastrugi_fixtures::jacksboro(), path.join("site.tif")).unwrap();
    write(path, "point.geojson", "{\"type\": \"Point\", \"coordinates\": [1, 2]}");
    write(path, "broken.geojson", "{\"type\": \"Polygon\", \"coord");
    let square = |low: i32, high: i32| {
        let ring = format!("[{low}, {low}], [{high}, {low}], [{high}, {high}], [{low}, {high}], [{low}, {low}]");
        format!("{{\"type\": \"Polygon\", \"coordinates\": [[{ring}]]}}")
    };
    write(path, "metres.geojson", &square(1000, 2000));
    write(path, "all.geojson", &square(-100, 100));
    write(path, "words.txt", "all but the trees");
    let fit = |option: &str, mask: &str, words: &[&str]| {
        let arguments = ["fit", "site.tif", "--outer-scale", "4000", option, mask, "-o", "fit.json"];
        refused(path, &arguments, INPUT, words);
        let stderr = sastrugi_in(path, &arguments).stderr;
        assert_eq!(stderr.lines().count(), 1, "one sentence: {stderr}");
    };
    fit("--mask", "nothing.geojson", &["nothing.geojson", "no such file"]);
    fit("--mask", "point.geojson", &["point.geojson", "contains a Point"]);
    fit("--mask", "broken.geojson", &["broken.geojson", "not GeoJSON"]);
    fit("--mask", "metres.geojson", &["metres.geojson", "none of the DEM's cells", "coordinates"]);
    fit("--exclude", "all.geojson", &["all.geojson", "none of the DEM's cells"]);
    fit("--mask", "words.txt", &["words.txt", "not a supported raster"]);
    // What the mask keeps lies outside of the window.
    let ring = "[-84.6, 36.4], [-84.3, 36.4], [-84.3, 36.7], [-84.6, 36.7], [-84.6, 36.4]";
    write(path, "west.geojson", &format!("{{\"type\": \"Polygon\", \"coordinates\": [[{ring}]]}}"));
    let arguments = ["fit", "site.tif", "--window", "-84.25,36.46,-84.20,36.66", "--mask", "west.geojson"];
    refused(path, &[&arguments[..], &["-o", "fit.json"]].concat(), INPUT, &["masks leave no cell"]);
    let study = |mask: &str| {
        format!(
            "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"a\"\nfile = \"site.tif\"\n\
             [[fit]]\nid = \"f\"\ndem = \"a\"\nouter_scale_m = 4000.0\nbootstrap = 0\nmask = {mask}\n"
        )
    };
    write(path, "study.toml", &study("\"nothing.geojson\""));
    refused(path, &["run", "study.toml"], INPUT, &["nothing.geojson", "no such file"]);
    write(path, "study.toml", &study("7"));
    refused(path, &["run", "study.toml"], USAGE, &["mask", "a file name or a list of file names"]);
    write(path, "study.toml", &study("\"metres.geojson\""));
    let call = sastrugi_in(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    assert!(call.code == 3 && call.stderr.contains("mask/f-1.geojson: keeps none"), "{}", call.stderr);
}

#[test]
fn val_bad_transects_are_input_errors() {
    let folder = area();
    let path = folder.path();
    write(path, "words.csv", "x,a\n0,1\n1,two\n2,3\n");
    write(path, "uneven.csv", "x,a\n0,1\n1,2\n3,4\n4,5\n");
    write(path, "heights.csv", "1\n2\n4\n");
    for verb in [&["info"][..], &["fit", "-o", "fit.json"]] {
        let call = |name| [verb, &[name]].concat();
        refused(path, &call("words.csv"), INPUT, &["words.csv: line 3, column 2", "\"two\" is not a number"]);
        refused(path, &call("uneven.csv"), INPUT, &["uneven.csv: line 3, column 1", "not evenly spaced"]);
        refused(path, &call("heights.csv"), USAGE, &["heights.csv", "give the spacing", "cell size"]);
    }
    refused(path, &["fit", "heights.csv", "--window", "0,0,1,1", "-o", "f.json"], USAGE, &["transects", "window"]);
}

#[test]
fn val_settings_of_point_clouds_are_refused_elsewhere() {
    let folder = area();
    let path = folder.path();
    std::fs::copy(sastrugi_fixtures::jacksboro(), path.join("site.tif")).unwrap();
    let words = ["site.tif", "not a point cloud"];
    for more in [&["--statistic", "median"][..], &["--fill", "2"], &["--ground"]] {
        refused(path, &[&["fit", "site.tif", "-o", "fit.json"], more].concat(), USAGE, &words);
        refused(path, &[&["convert", "site.tif", "b.tif"], more].concat(), USAGE, &words);
    }
    refused(path, &["convert", "site.tif", "b.tif", "--statistic", "p101"], USAGE, &["p101", "p0 to p100"]);
    let study = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"a\"\nfile = \"site.tif\"\n";
    write(path, "study.toml", &format!("{study}statistic = \"mode\"\n"));
    refused(path, &["run", "study.toml"], USAGE, &["statistic", "mode", "median"]);
    let mut cloud = b"LASF".to_vec();
    cloud.resize(400, 0);
    std::fs::write(path.join("cloud.laz"), cloud).unwrap();
    for verb in ["fit", "roughness", "info"] {
        let output = if verb == "fit" { &["-o", "fit.json"][..] } else { &[] };
        refused(path, &[&[verb, "cloud.laz"], output].concat(), INPUT, &["cloud.laz"]);
    }
}

/// Items that cannot succeed are reported with their parameters; the others go on, and the release is sealed.
#[test]
fn val_a_failed_item_costs_itself_only() {
    let folder = area();
    write(folder.path(), "study.toml", &small_study().replace("length_m = 5.0", "length_m = 17.6"));
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 3, "{}", call.stderr);
    assert!(
        call.stderr.contains("missions/short@rough-0001 failed") && call.stderr.contains("17.6 m away"),
        "{}",
        call.stderr
    );
    let manifest = std::fs::read_to_string(folder.path().join("release/manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    let failed = manifest["failed"].as_array().unwrap();
    assert_eq!(failed.len(), 6);
    assert!(failed.iter().any(|f| f["parameters"]["missions"]["length_m"] == 17.6));
    let verify = sastrugi_in(folder.path(), &["verify", "release", "--quiet"]);
    assert_eq!(verify.code, 0, "{}{}", verify.stdout, verify.stderr);
}

#[test]
fn val_a_study_whose_every_item_fails_fails() {
    let folder = area();
    write(folder.path(), "broken.tif", "II*\0nonsense");
    let study = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"a\"\nfile = \"broken.tif\"\n";
    write(folder.path(), "study.toml", study);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, INPUT, "{}", call.stderr);
    assert!(call.stderr.contains("dem/a.tif"), "the file as the release calls it: {}", call.stderr);
    assert!(!folder.path().join("release").exists());
}

/// A missing file, or a folder in place of a file, is refused in the same words by every verb that reads one.
#[test]
fn val_unreadable_files_are_named_in_plain_words() {
    let folder = area();
    let path = folder.path();
    std::fs::create_dir(path.join("folder")).unwrap();
    for (name, words) in [("none", "none: no such file\n"), ("folder", "folder is a folder, not a file\n")] {
        refused(path, &["run", name], INPUT, &[words]);
        refused(path, &["plan", name], INPUT, &[words]);
        refused(path, &["texture", name, "--size", "8x8", "--cell", "0.1", "-o", "a.tif"], INPUT, &[words]);
    }
    refused(path, &["analyze", "none.mcap"], INPUT, &["none.mcap: no such file\n"]);
}
