//! Images, altimetry, albedo and a rock potential combined.

use super::*;

fn raster(low: f64, step: f64) -> Grid {
    let g = Geometry { rows: 20, cols: 20, cell: [2.5, 2.5], origin: [95.0, 195.0] };
    Grid::new(g, (0..400).map(|k| low + step * f64::from((k * 7) % 11)).collect())
}

fn everything(cell_m: f64, origin_m: [f64; 2], size_px: [u32; 2]) -> Terrain {
    let params = json!({
        "cell_m": cell_m, "origin_m": origin_m, "size_px": size_px, "image_resolution_m": 0.5, "albedo": "bright", "altimetry": "laser",
        "processes": [
            {"kind": "rocks", "coverage": 0.118, "potential": "shares"},
            {"kind": "primary_craters", "density": 0.01, "diameter_min_m": 0.3},
            {"kind": "albedo"}
        ]
    });
    let laser: Vec<[f64; 4]> = (0..40)
        .map(|k| {
            [104.2 + 0.71 * f64::from(k % 8), 205.3 + 1.13 * f64::from(k / 8), f64::from(k % 5), f64::from(k % 3) * 0.1]
        })
        .collect();
    let inputs =
        [site(30, 30, [1.28, 1.5]).into(), raster(0.1, 0.03).into(), raster(0.0, 0.05).into(), Input::Points(laser)];
    elaborate(params).generate(&streams(), &inputs).unwrap()
}

fn fields(made: &Terrain) -> Vec<Grid> {
    std::iter::once(&made.heights).chain(made.maps.iter().map(|m| &m.values)).cloned().collect()
}

/// Windows, zooms, and 1 and 8 threads agree bit by bit in heights and maps.
#[test]
fn prop_windows_zooms_and_threads_agree() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| everything(0.08, [104.0, 204.8], [121, 101]))
    };
    let whole = on(1);
    assert!(whole == on(8));
    assert_eq!(whole.maps.len(), 3);
    let (whole, part) = (fields(&whole), fields(&everything(0.08, [104.0 + 2.4, 204.8 + 1.6], [50, 60])));
    let coarse = fields(&everything(0.16, [104.0, 204.8], [61, 51]));
    for ((whole, part), coarse) in whole.iter().zip(&part).zip(&coarse) {
        for (j, i) in (0..60).flat_map(|j| (0..50).map(move |i| (j, i))) {
            assert_eq!(part.at(59 - j, i).to_bits(), whole.at(100 - (j + 20), i + 30).to_bits());
        }
        for (j, i) in (0..51).flat_map(|j| (0..61).map(move |i| (j, i))) {
            assert_eq!(coarse.at(50 - j, i).to_bits(), whole.at(100 - 2 * j, 2 * i).to_bits());
        }
    }
    assert!(whole[1].values.contains(&1.0));
}

/// Inputs are named in the order in which they are passed, and parameters read back.
#[test]
fn val_inputs_are_named() {
    let params = json!({
        "dem": "d", "cell_m": 0.16, "basic_spacing_m": 0.01, "albedo": "a", "altimetry": "l",
        "processes": [{"kind": "dust"}, {"kind": "rocks", "potential": "p"}]
    });
    let generator = crate::prepare(KIND, &params).unwrap();
    let named: Vec<(String, String)> = generator.inputs().into_iter().map(|i| (i.key, i.name)).collect();
    let expected = [("dem", "d"), ("albedo", "a"), ("processes.1.potential", "p"), ("altimetry", "l")];
    assert_eq!(named, expected.map(|(k, n)| (k.to_owned(), n.to_owned())));
    let again = crate::prepare(KIND, &generator.parameters()).unwrap();
    assert_eq!(again.inputs(), generator.inputs());
    let inputs = [site(24, 24, [1.28, 1.28]).into()];
    let missing = generator.generate(&streams(), &inputs).unwrap_err().to_string();
    assert!(missing.contains("\"a\": it is missing"), "{missing}");
}

/// The rock potential is read in the DEM's coordinates, whatever the lattice's shift.
#[test]
fn val_the_potential_lies_in_the_dems_coordinates() {
    let dem = site(24, 24, [1.28, 1.28]);
    let shares = raster(0.0, 0.05);
    let params = json!({
        "origin_m": [104.037, 204.011], "size_px": [60, 60],
        "processes": [{"kind": "rocks", "potential": "shares"}]
    });
    let made = elaborate(params).generate(&streams(), &[dem.into(), shares.clone().into()]).unwrap();
    let potential = &made.maps.iter().find(|m| m.name == "rock-potential").unwrap().values;
    let g = potential.geometry;
    for k in 0..g.len() {
        let expected = shares.height(g.x(k % g.cols), g.y(k / g.cols)).unwrap();
        assert!((potential.values[k] - expected).abs() < 1e-9);
    }
}
