//! Albedo maps that keep a measured albedo.

use super::*;

/// A measured albedo with cells of 2.56 m, centred on every second post of the site.
fn measured() -> Grid {
    let g = Geometry { rows: 12, cols: 12, cell: [2.56, 2.56], origin: [98.72, 198.72] };
    Grid::new(g, (0..144).map(|k| 0.1 + 0.02 * f64::from((k * 5) % 17)).collect())
}

fn params(processes: Value) -> Value {
    json!({"origin_m": [104.0, 204.0], "size_px": [100, 100], "albedo": "bright", "processes": processes})
}

fn made(processes: Value, albedo: Grid) -> Result<Terrain, String> {
    let dem = site(24, 24, [1.28, 1.28]);
    let inputs = [dem.into(), albedo.into()];
    elaborate(params(processes)).generate(&streams(), &inputs).map_err(|e| e.to_string())
}

fn map(made: &Terrain) -> &Grid {
    &made.maps.iter().find(|m| m.name == "albedo").unwrap().values
}

/// At its cell centres the map equals the measurement, with sand, rocks and dust in between; heights do not change.
#[test]
fn val_measured_albedo_is_kept() {
    let list = json!([{"kind": "rocks", "coverage": 0.2}, {"kind": "albedo"}, {"kind": "dust"}]);
    let with = made(list.clone(), measured()).unwrap();
    assert!(errors_at_posts(map(&with), &measured(), 20) < 1e-6);
    let mut plain = params(list);
    plain.as_object_mut().unwrap().remove("albedo");
    let plain = refined(plain, &site(24, 24, [1.28, 1.28]));
    assert_eq!(plain.heights, with.heights);
    // The contrast between rocks and sand is the same as in the map without a measurement.
    let class = &with.maps[0].values;
    let background = Background::new(measured());
    let g = class.geometry;
    let mean = |of: &Grid, code: f64, less: &dyn Fn(usize) -> f64| {
        let all: Vec<f64> = (0..g.len()).filter(|k| class.values[*k] == code).map(|k| of.values[k] - less(k)).collect();
        sastrugi_numeric::sums::mean(&all)
    };
    let from = |k: usize| background.at([g.x(k % g.cols), g.y(k / g.cols)]);
    let contrast = mean(map(&with), 0.0, &from) - mean(map(&with), 1.0, &from);
    let expected = mean(map(&plain), 0.0, &|_| 0.0) - mean(map(&plain), 1.0, &|_| 0.0);
    assert!((contrast - expected).abs() < 0.01 && expected > 0.03, "{contrast} {expected}");
    // The detail that the processes add has zero mean: for sand, to a tenth of its deviation.
    assert!(mean(map(&with), 0.0, &from).abs() < 0.02);
}

/// Without an `albedo` process the map is the smooth background of the measurement.
#[test]
fn val_without_a_process_the_map_is_smooth() {
    let with = made(json!([]), measured()).unwrap();
    let background = Background::new(measured());
    let g = map(&with).geometry;
    for k in 0..g.len() {
        let expected = background.at([g.x(k % g.cols), g.y(k / g.cols)]).clamp(0.0, 1.0);
        assert!((map(&with).values[k] - expected).abs() < 1e-12);
    }
}

#[test]
fn val_unusable_albedos_are_refused() {
    let refused = |albedo: Grid| made(json!([{"kind": "albedo"}]), albedo).unwrap_err();
    let mut bright = measured();
    bright.values[60] = 25.0;
    assert!(refused(bright).contains("\"bright\": it has an albedo of 25 at x = "));
    let mut holed = measured();
    holed.values[60] = f64::NAN;
    assert!(refused(holed).contains("no data at"));
    let away = Grid { geometry: Geometry { origin: [500.0, 198.72], ..measured().geometry }, ..measured() };
    assert!(refused(away).contains("do not lie between"));
    let fine = Grid { geometry: Geometry { cell: [0.1, 0.1], ..measured().geometry }, ..measured() };
    assert!(refused(fine).contains("must be finer"));
    let missing = elaborate(params(json!([]))).generate(&streams(), &[site(24, 24, [1.28, 1.28]).into()]);
    assert!(missing.unwrap_err().to_string().contains("\"bright\": it is missing"));
}
