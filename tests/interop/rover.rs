//! A study of rovers, some of which arrive, recorded in both flavours, and the script that reads it.

use super::{check, python};
use sastrugi_tests::{area, sastrugi_in, write};

const STUDY: &str = r#"
[study]
name = "rovers"
seed = 5
date = "2026-01-01"

[[terrain]]
id = "rocks"
kind = "planetary"
size_m = [10.0, 10.0]
cell_m = 0.16
basic_spacing_m = 0.02
origin_m = [-4.96, -4.96]
processes = [{ kind = "texture", roughness_m = 0.003 }, { kind = "rocks", coverage = 0.1, diameter_min_m = 0.1 }]

[[rover]]
id = "rays"
kind = "sojourner_like"
terrains = ["rocks"]
rovers = 1
radius_m = 6.0
sample_m = 0.0

[[rover]]
id = "gives-up"
kind = "sojourner_like"
terrains = ["rocks"]
rovers = 1
radius_m = 6.0
sample_m = 0.0
distance_limit_m = 2.0

[[rover]]
id = "boxes"
kind = "schoppers_like"
terrains = ["rocks"]
rovers = 1
radius_m = 6.0
sample_m = 0.0

[[rover]]
id = "plans"
kind = "planner"
sensor = "rectangles"
terrains = ["rocks"]
rovers = 1
radius_m = 6.0
sample_m = 0.0
"#;

/// Recordings of rovers, read by mcap-protobuf-support and rosbags: every cycle, pose, plan and event agrees with the rows of the tables.
#[test]
fn val_readers_agree_with_rovers() {
    let Some(python) = python() else { return };
    let folders = [area(), area()];
    let releases = [("", &folders[0]), ("mcap = \"ros2\"\n", &folders[1])].map(|(flavour, folder)| {
        write(folder.path(), "study.toml", &STUDY.replace("seed = 5\n", &format!("seed = 5\n{flavour}")));
        let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
        folder.path().join("release")
    });
    let call = check(&python, "check_rover.py", &[&releases[0], &releases[1]]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    assert!(call.stdout.lines().count() == 8, "{}", call.stdout);
}
