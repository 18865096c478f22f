//! The published study of traversal beside an independent prototype. Tests begin in the order of their names: this one, which keeps two cores busy for
//! minutes, is under way while those of the recipes wait for their clusters.

use super::traverse::{run, text};
use sastrugi_tests::{Row, area, rows};

/// A hundred terrains for each published fractal dimension, eight missions each, with a separate seed.
const LARGE: &str = r#"
[study]
name = "large"
seed = 77
date = "2026-11-22"
[[terrain]]
id = "d2.30"
kind = "multifractal"
group = "2.30"
count = 100
high.fractal_dimension = 2.30
[[terrain]]
id = "d2.45"
kind = "multifractal"
group = "2.45"
count = 100
high.fractal_dimension = 2.45
[[terrain]]
id = "d2.60"
kind = "multifractal"
group = "2.60"
count = 100
high.fractal_dimension = 2.60
[[missions]]
id = "straight"
terrains = ["d2.30", "d2.45", "d2.60"]
count = 8
[[traverse]]
id = "husky"
missions = "straight"
"#;

/// Results of an independent prototype of the same reading of the paper, on its own 20 terrains for each fractal dimension: success of 400
/// missions, %; medians of RMS vertical acceleration, m/s2, pitch rate and roll rate, deg/s, of successful missions.
const PROTOTYPE: [(&str, [f64; 4]); 3] =
    [("2.30", [96.5, 0.55, 12.7, 9.2]), ("2.45", [88.0, 0.88, 16.5, 12.4]), ("2.60", [66.5, 1.24, 19.3, 14.7])];

/// Every metric grows (success falls) with the fractal dimension and lies within 15 % of the prototype's. One fixed seed, so this is
/// not a statistical test; standard errors over our 100 terrains are 1 to 3 % for success and 3 to 6 % for the others,
/// those of the prototype's 20 about twice as large.
#[test]
#[ignore = "slow: ./test --full"]
fn val_the_default_reading_meets_the_prototype() {
    let folder = area();
    run(folder.path(), LARGE, "2");
    let missions = rows(&folder.path().join("release"), "missions");
    let figures = |group: &str| -> [f64; 4] {
        let all: Vec<&Row> = missions.iter().filter(|row| text(row, "group") == group).collect();
        let goals: Vec<&&Row> = all.iter().filter(|row| text(row, "outcome") == "success").collect();
        let median = |column: &str| {
            let mut values: Vec<f64> = goals.iter().map(|row| row[column].as_f64().unwrap()).collect();
            values.sort_by(f64::total_cmp);
            0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2])
        };
        let [acceleration, pitch, roll] =
            ["rms_vertical_acceleration_m_s2", "rms_pitch_rate_deg_s", "rms_roll_rate_deg_s"].map(median);
        [100.0 * goals.len() as f64 / all.len() as f64, acceleration, pitch, roll]
    };
    let found = PROTOTYPE.map(|(group, _)| figures(group));
    println!("success %, acceleration, pitch rate, roll rate: {found:?}");
    for (ours, (group, prototype)) in found.iter().zip(PROTOTYPE) {
        for (a, b) in ours.iter().zip(prototype) {
            assert!((a / b - 1.0).abs() < 0.15, "{group}: {ours:?} {prototype:?}");
        }
    }
    for pair in found.windows(2) {
        assert!(pair[0][0] > pair[1][0] && (1..4).all(|i| pair[0][i] < pair[1][i]), "{found:?}");
    }
}
