use super::*;
use sastrugi_numeric::Surface;
use serde_json::json;

mod albedo;
mod altimetry;
mod bounds;
mod together;
mod windows;

/// A rough DEM with its south-west post at (100, 200) m.
fn site(rows: usize, cols: usize, cell: [f64; 2]) -> Grid {
    let params = json!({
        "cell_m": 1.28, "basic_spacing_m": 0.01, "size_px": [cols, rows],
        "processes": [{"kind": "base_slope", "gradient": [0.1, 0.05]}, {"kind": "texture", "roughness_m": 0.05, "hurst": 0.7}]
    });
    let made = crate::prepare("planetary", &params).unwrap().generate(&streams(), &[]).unwrap().heights;
    let origin = [100.0 - 0.5 * cell[0], 200.0 - 0.5 * cell[1]];
    Grid { geometry: Geometry { rows, cols, cell, origin }, values: made.values }
}

fn streams() -> Streams {
    Streams::for_seed(1, "terrain")
}

fn elaborate(params: Value) -> Box<dyn Generator> {
    let mut all = json!({"dem": "site", "cell_m": 0.16, "basic_spacing_m": 0.01});
    all.as_object_mut().unwrap().extend(params.as_object().unwrap().clone());
    crate::prepare(KIND, &all).unwrap()
}

fn refined(params: Value, dem: &Grid) -> Terrain {
    elaborate(params).generate(&streams(), &[dem.clone().into()]).unwrap()
}

fn processes() -> Value {
    json!([
        {"kind": "rocks", "coverage": 0.118},
        {"kind": "primary_craters", "density": 0.05, "diameter_min_m": 0.3},
        {"kind": "albedo"}
    ])
}

/// Posts on the lattice are kept to 1e-6, with texture, craters and rocks; also where the post spacing is not a power of 2 and
/// differs between north and east.
#[test]
fn val_posts_are_kept() {
    for cell in [[1.28, 1.28], [1.12, 1.6]] {
        let dem = site(24, 24, cell);
        let origin = [100.0 + 4.0 * cell[0], 200.0 + 4.0 * cell[1]];
        let made = refined(json!({"origin_m": origin, "size_px": [110, 110], "processes": processes()}), &dem);
        assert!(errors_at_posts(&made.heights, &dem, 60) < 1e-6, "{cell:?}");
        assert_eq!(made.maps.len(), 3);
    }
}

/// Posts off the lattice are kept to within the slope over half a basic spacing; bilinear interpolation between samples 2 cm apart adds
/// their texture, 6 mm between neighbours.
#[test]
fn val_posts_off_the_lattice_are_kept_to_the_slope() {
    let dem = site(24, 24, [1.123, 1.617]);
    let made = refined(json!({"cell_m": 0.02, "origin_m": [103.5, 205.1], "size_px": [700, 900]}), &dem);
    assert!(errors_at_posts(&made.heights, &dem, 100) < 0.03);
}

/// Largest difference at the posts inside, of which there must be at least `least`.
fn errors_at_posts(heights: &Grid, dem: &Grid, least: usize) -> f64 {
    let g = &dem.geometry;
    let cells = (0..g.rows).flat_map(|row| (0..g.cols).map(move |col| (row, col)));
    let difference = |(row, col)| Some((heights.height(g.x(col), g.y(row))? - dem.at(row, col)).abs());
    let all: Vec<f64> = cells.filter_map(difference).collect();
    assert!(all.len() >= least, "{}", all.len());
    all.into_iter().max_by(f64::total_cmp).unwrap()
}

/// The Hurst exponent of a DEM of known texture is recovered within 0.05, and the roughness over three posts, in the middle of
/// the lags, within 5 %. H of a DEM of 200 x 200 posts scatters by 0.01 (printed).
#[test]
fn stat_texture_parameters_are_recovered() {
    for hurst in [0.5, 0.7, 0.8, 0.9] {
        let fits: Vec<TextureFit> = (0..8)
            .map(|seed| {
                let params = json!({
                    "cell_m": 10.24, "basic_spacing_m": 0.01, "size_px": [200, 200],
                    "processes": [{"kind": "texture", "roughness_m": 0.03, "hurst": hurst}]
                });
                let dem = crate::prepare("planetary", &params).unwrap();
                fit(&dem.generate(&Streams::for_seed(seed, "terrain"), &[]).unwrap().heights, None).unwrap()
            })
            .collect();
        let mean =
            |f: &dyn Fn(&TextureFit) -> f64| sastrugi_numeric::sums::mean(&fits.iter().map(f).collect::<Vec<_>>());
        let over_three = |f: &TextureFit| f.roughness_m * libm::pow(3.0 * 10.24, f.hurst);
        let ratio = mean(&over_three) / over_three(&TextureFit { hurst, roughness_m: 0.03 });
        eprintln!(
            "H = {hurst}: {:.3} +- {:.3}, roughness {:.4} m, over three posts {ratio:.3}",
            mean(&|f| f.hurst),
            sastrugi_numeric::sums::variance(&fits.iter().map(|f| f.hurst).collect::<Vec<_>>()).sqrt(),
            mean(&|f| f.roughness_m)
        );
        assert!(fits.iter().all(|f| (f.hurst - hurst).abs() < 0.05));
        assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    }
}

/// Overlapping windows and different zooms agree bit by bit.
#[test]
fn prop_windows_agree() {
    let dem = site(30, 30, [1.28, 1.5]);
    let of = |cell_m: f64, origin: [f64; 2], px: [u32; 2]| {
        refined(json!({"cell_m": cell_m, "origin_m": origin, "size_px": px, "processes": processes()}), &dem)
    };
    let whole = of(0.08, [105.6, 206.4], [121, 101]);
    let part = of(0.08, [105.6 + 0.08 * 30.0, 206.4 + 0.08 * 20.0], [50, 60]);
    let coarse = of(0.16, [105.6, 206.4], [61, 51]);
    // Origins half a cell off the lattice; dividing them by the cell gives quotients on either side of a half.
    let (half, half_part) = (of(0.08, [105.64, 206.44], [60, 60]), of(0.08, [105.64 + 2.4, 206.44 + 1.6], [20, 20]));
    for (j, i) in (0..20).flat_map(|j| (0..20).map(move |i| (j, i))) {
        assert_eq!(half_part.heights.at(19 - j, i), half.heights.at(59 - (j + 20), i + 30));
    }
    let fields = |t: &Terrain| -> Vec<Grid> {
        std::iter::once(&t.heights).chain(t.maps.iter().map(|m| &m.values)).cloned().collect()
    };
    for ((whole, part), coarse) in fields(&whole).iter().zip(fields(&part)).zip(fields(&coarse)) {
        for (j, i) in (0..60).flat_map(|j| (0..50).map(move |i| (j, i))) {
            assert_eq!(part.at(59 - j, i), whole.at(100 - (j + 20), i + 30));
        }
        for (j, i) in (0..51).flat_map(|j| (0..61).map(move |i| (j, i))) {
            assert_eq!(coarse.at(50 - j, i), whole.at(100 - 2 * j, 2 * i));
        }
    }
}

/// Without texture and processes the result is the smooth background, to which the texture stage may add a texture.
#[test]
fn val_the_background_alone_is_smooth() {
    let dem = site(20, 20, [1.28, 1.28]);
    let made = refined(json!({"origin_m": [103.0, 204.0], "size_px": [80, 80], "texture": false}), &dem);
    assert!(made.maps.is_empty() && made.notes.is_empty());
    let background = Background::new(dem.clone());
    let g = &made.heights.geometry;
    for (row, col) in (0..80).flat_map(|r| (0..80).map(move |c| (r, c))) {
        assert!((made.heights.at(row, col) - background.at([g.x(col), g.y(row)])).abs() < 1e-12);
    }
    let rough = refined(json!({"origin_m": [103.0, 204.0], "size_px": [80, 80]}), &dem);
    assert!(rough.notes[0].contains("H = "), "{:?}", rough.notes);
    assert_ne!(rough.heights, made.heights);
}

fn refusal(params: Value, dem: &Grid) -> String {
    elaborate(params).generate(&streams(), &[dem.clone().into()]).unwrap_err().to_string()
}

#[test]
fn val_unusable_dems_are_refused() {
    let dem = site(20, 20, [1.28, 1.28]);
    let inside = json!({"origin_m": [105.0, 205.0], "size_px": [60, 60]});
    let with = |extra: Value| {
        let mut all = inside.clone();
        all.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        all
    };
    for (params, words) in [
        (with(json!({"origin_m": [99.0, 205.0]})), "do not lie between"),
        (with(json!({"size_px": [400, 60]})), "do not lie between"),
        (with(json!({"cell_m": 1.28})), "must be finer"),
        (with(json!({"processes": [{"kind": "primary_craters", "diameter_min_m": 3.0}]})), "wider than two"),
    ] {
        assert!(refusal(params.clone(), &dem).contains(words), "{params}: {}", refusal(params.clone(), &dem));
    }
    for (params, key) in [
        (with(json!({"origin_m": [99.0, 205.0]})), "origin_m"),
        (with(json!({"size_px": [400, 60]})), "origin_m"),
        (with(json!({"cell_m": 1.28})), "cell_m"),
        (with(json!({"processes": [{"kind": "primary_craters", "diameter_min_m": 3.0}]})), "processes"),
    ] {
        // Before the run, with the reason given in the run.
        let refused = elaborate(params.clone()).check_places(&[Some(dem.geometry)]).unwrap_err();
        let reason = refusal(params.clone(), &dem).split_once("it has").unwrap().1.to_owned();
        assert!(refused.key == key && refused.message.ends_with(&reason), "{params}: {refused}");
        assert_eq!(elaborate(params).check_places(&[None]), Ok(()));
    }
    assert_eq!(elaborate(inside.clone()).check_places(&[Some(dem.geometry)]), Ok(()));
    assert!(refusal(inside.clone(), &site(3, 20, [1.28, 1.28])).contains("at least 4 x 4"));
    let mut holed = dem.clone();
    holed.values[14 * 20 + 6] = f64::NAN;
    assert!(refusal(inside.clone(), &holed).contains("no data at"));
    holed = Grid { values: vec![f64::INFINITY; 400], ..dem.clone() };
    assert!(refusal(inside.clone(), &holed).contains("no data at"));
}

/// A slope of any steepness does not affect the fit: H and roughness are those of the level DEM, to rounding.
#[test]
fn prop_slopes_do_not_affect_the_fit() {
    let level = site(40, 30, [2.0, 3.0]);
    let g = level.geometry;
    let of = |[east, north]: [f64; 2]| {
        let tilted = (0..g.len()).map(|k| level.values[k] + east * g.x(k % g.cols) + north * g.y(k / g.cols) + 900.0);
        fit(&Grid::new(g, tilted.collect()), None).unwrap()
    };
    let expected = fit(&level, None).unwrap();
    assert!(expected.roughness_m > 0.001);
    for slope in [[0.01, 0.0], [0.3, -0.1], [-2.0, 1.0]] {
        let found = of(slope);
        assert!((found.hurst - expected.hurst).abs() < 1e-6, "{slope:?}: {found:?}, {expected:?}");
        assert!((found.roughness_m / expected.roughness_m - 1.0).abs() < 1e-6);
    }
}

/// Planes have no roughness; a DEM without data, or too small for three lags, has no fit.
#[test]
fn val_planes_have_no_roughness() {
    let g = Geometry::square(20, 20, 2.0);
    let plane = Grid::new(g, (0..400).map(|k| 0.3 * g.x(k % 20) - 0.1 * g.y(k / 20)).collect());
    assert_eq!(fit(&plane, None).unwrap().roughness_m, 0.0);
    assert_eq!(fit(&Grid::filled(g, 4.0), None).unwrap().roughness_m, 0.0);
    assert!(fit(&Grid::filled(g, f64::NAN), None).is_none());
    assert!(fit(&site(6, 20, [1.0, 1.0]), None).is_none() && fit(&site(7, 7, [1.0, 1.0]), None).is_some());
}

#[test]
fn val_bad_parameters_are_refused() {
    let refused = |params: Value| crate::prepare(KIND, &params).err().unwrap().key;
    assert_eq!(refused(json!({})), "dem");
    for (key, bad) in [
        ("hurst", json!({"dem": "a", "hurst": 1.5})),
        ("roughness_m", json!({"dem": "a", "roughness_m": -1.0})),
        ("origin_m", json!({"dem": "a", "origin_m": [1e300, 0.0]})),
        ("cell_m", json!({"dem": "a", "cell_m": 0.0})),
        ("processes.0.kind", json!({"dem": "a", "processes": [{"kind": "texture"}]})),
        ("processes.0.coverage", json!({"dem": "a", "processes": [{"kind": "rocks", "coverage": 0.7}]})),
    ] {
        assert_eq!(refused(bad.clone()), key, "{bad}");
    }
}
