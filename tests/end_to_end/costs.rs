//! Estimates of `plan` and measured times of a run, stage by stage: a table to look at, since no test can fix the speed of a machine.

use sastrugi_tests::{area, sastrugi_in};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;

/// Estimated and measured seconds of the stages of the quick start on one thread. Times are wall-clock times: run it alone on an idle machine.
///
///     cargo test --release --workspace --test end_to_end costs -- --ignored --nocapture
#[test]
#[ignore = "measures: run it alone, with --nocapture"]
fn val_estimates_and_measured_times() {
    let folder = area();
    let study = sastrugi_fixtures::workspace_root().join("fixtures/studies/quickstart.toml");
    let study = study.display().to_string();
    let plan = sastrugi_in(folder.path(), &["plan", &study, "-o", "release", "--json"]);
    assert_eq!(plan.code, 0, "{}", plan.stderr);
    let run = sastrugi_in(folder.path(), &["run", &study, "-o", "release", "--threads", "1", "--quiet"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let plan: Value = serde_json::from_str(&plan.stdout).unwrap();
    let timings: BTreeMap<String, f64> =
        serde_json::from_slice(&fs::read(folder.path().join("release.work/timings.json")).unwrap()).unwrap();
    let mut stages: BTreeMap<&str, [f64; 2]> = BTreeMap::new();
    for item in plan["stale"].as_array().unwrap() {
        let (name, estimated_s) = (item["item"].as_str().unwrap(), item["seconds"].as_f64().unwrap());
        let stage = name.split('/').next().unwrap_or_default();
        let sums = stages.entry(stage).or_default();
        sums[0] += estimated_s;
        sums[1] += timings.get(name).copied().unwrap_or(0.0);
    }
    println!("{:<16} {:>10} {:>10} {:>6}", "stage", "estimated", "measured", "ratio");
    for (stage, [estimated_s, measured_s]) in &stages {
        println!("{stage:<16} {estimated_s:>8.2} s {measured_s:>8.2} s {:>6.2}", estimated_s / measured_s);
        assert!(estimated_s.is_finite() && *estimated_s > 0.0 && *measured_s > 0.0, "{stage}");
    }
}
