//! LeRobot datasets: pyarrow and numpy read them beside the release, and LeRobot's own loader opens them.

use super::check;
use sastrugi_tests::{area, called, sastrugi_in, write};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Three rough terrains, one in each split, with three missions each; some end beside the border.
const STUDY: &str = r#"
[study]
name = "learning"
seed = 7
date = "2026-01-01"
license = "CC0-1.0"
creators = ["Doe, Jane"]
split = [0.4, 0.3, 0.3]

[[terrain]]
id = "rough"
kind = "multifractal"
group = "a"
count = 3
size_px = [120, 100]
cell_m = 0.2

[[missions]]
id = "short"
terrains = ["rough"]
count = 3
length_m = 5.0
border_m = 1.5

[[traverse]]
id = "husky"
missions = "short"
timeout_s = 20.0
"#;

/// Makes `release` and its `dataset`, whose patches are wide enough to reach beyond the terrain.
fn make(folder: &Path) {
    write(folder, "study.toml", STUDY);
    let run = ["run", "study.toml", "-o", "release", "--quiet"];
    let convert =
        ["convert", "release", "dataset", "--for", "lerobot", "--patch", "6.4", "--patch-cell", "0.4", "--quiet"];
    for arguments in [&run[..], &convert[..]] {
        let call = sastrugi_in(folder, arguments);
        assert_eq!(call.code, 0, "{arguments:?}: {}", call.stderr);
    }
}

/// Every frame, height patch, label and statistic follows from the tables and rasters of the release.
#[test]
fn val_readers_agree_with_a_lerobot_dataset() {
    let Some(python) = super::python() else { return };
    let folder = area();
    make(folder.path());
    let [release, dataset] = ["release", "dataset"].map(|name| folder.path().join(name));
    let call = check(&python, "check_lerobot.py", &[&release, &dataset]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    let found: Value = serde_json::from_str(&call.stdout).unwrap();
    assert_eq!((&found["episodes"], &found["tasks"]), (&9.into(), &1.into()), "{found}");
    assert_eq!(found["splits"], serde_json::json!({"train": "0:3", "validation": "3:6", "test": "6:9"}));
    assert!(found["unknown"].as_u64() > Some(0), "no patch reaches beyond its terrain: {found}");
}

/// LeRobot 0.4.4 with PyTorch, and Hugging Face datasets on the release itself.
#[test]
#[ignore = "slow: ./test --full"]
fn val_lerobot_opens_the_dataset() {
    let Some(python) = sastrugi_tests::python("lerobot", "./test --full") else { return };
    let folder = area();
    make(folder.path());
    let script = sastrugi_fixtures::workspace_root().join("tests/interop/load_lerobot.py");
    let mut command = Command::new(python);
    command.arg(script).args(["release", "dataset"]).current_dir(folder.path());
    let offline = [("HF_HUB_OFFLINE", "1"), ("HF_DATASETS_OFFLINE", "1"), ("CUDA_VISIBLE_DEVICES", "")];
    command.envs(offline).env("HF_HOME", folder.path().join("cache")).env("PYTHONDONTWRITEBYTECODE", "1");
    let call = called(&mut command);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    let found: Value = serde_json::from_str(call.stdout.lines().last().unwrap_or_default()).unwrap();
    assert!(found["episodes"] == 9 && found["frames"].as_u64() > Some(100), "{found}");
    println!("{found}");
}
