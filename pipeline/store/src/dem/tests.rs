use super::*;
use sastrugi_numeric::Geometry;
use std::path::PathBuf;

fn data(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if !path.exists() {
        eprintln!("skipped: ../shared/data/{name} is absent");
        return None;
    }
    Some(path)
}

fn hilly(rows: usize, cols: usize) -> Grid {
    let geometry = Geometry { rows, cols, cell: [0.5, 0.25], origin: [1000.5, -20.25] };
    let height = |r: usize, c: usize| {
        if (r, c) == (1, 2) { f64::NAN } else { f64::from((r as f32 * 0.37 - c as f32 * 1.13) * 3.3) }
    };
    Grid::new(geometry, (0..rows).flat_map(|r| (0..cols).map(move |c| height(r, c))).collect())
}

fn same(a: &Grid, b: &Grid) -> bool {
    a.geometry == b.geometry && a.values.iter().zip(&b.values).all(|(x, y)| x == y || (x.is_nan() && y.is_nan()))
}

/// Figures from rasterio 1.4.4 and numpy 2.4.6 (tests/interop/check_dems.py compares every value).
#[test]
fn val_shared_data_reads_as_rasterio_reads_it() {
    struct Expected(&'static str, usize, usize, [f64; 2], [f64; 2], &'static str);
    let table = [
        Expected("N44W072.hgt", 1201, 1201, [1.0 / 1200.0; 2], [-72.00041666666667, 43.99958333333333], "int16"),
        Expected("ryggfonn_dhm.asc", 633, 459, [5.0; 2], [408397.75, 6870084.11], "float32"),
        Expected("akl_lidar.tif", 860, 600, [1.0; 2], [2667405.0, 6478705.0], "float32"),
        Expected("avaAlr.tif", 915, 417, [5.0; 2], [255202.0828, 377305.9942], "float64"),
        Expected("otira_grid_2cm.tif", 331, 423, [0.02; 2], [19.16, 13.2], "float32"),
        Expected(
            "wbt_DEM.tif",
            188,
            237,
            [89.98349566172115, 90.02153730932424],
            [664692.0589773272, 4878903.550862964],
            "float32",
        ),
        Expected("mars_hirise_1m.npy", 120, 70, [1.0; 2], [0.0; 2], "float32"),
    ];
    for Expected(name, rows, cols, cell, origin, dtype) in table {
        let Some(path) = data(name) else { continue };
        let dem = read(&path).unwrap();
        let g = dem.grid.geometry;
        assert_eq!((g.rows, g.cols, dem.info.dtype), (rows, cols, dtype), "{name}");
        for axis in 0..2 {
            assert!((g.cell[axis] - cell[axis]).abs() <= 1e-12 * cell[axis], "{name} cell {:?}", g.cell);
            assert!((g.origin[axis] - origin[axis]).abs() <= 1e-6, "{name} origin {:?}", g.origin);
        }
    }
}

#[test]
fn val_reference_systems_are_recognised_and_carried() {
    let Some(path) = data("wbt_DEM.tif") else { return };
    let dem = read(&path).unwrap();
    assert!(dem.info.pixel_is_point && dem.info.crs.epsg.is_none() && !dem.info.crs.geographic);
    assert!(!dem.info.crs.keys.is_empty());
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("copy.tif");
    write(&copy, &dem.grid, &dem.info.crs, &WriteOptions::default()).unwrap();
    let again = read(&copy).unwrap();
    assert_eq!(again.info.crs, dem.info.crs);
    assert!(same(&again.grid, &dem.grid));
    let Some(path) = data("srtmgl3_boulder.asc") else { return };
    assert!(read(&path).unwrap().info.crs.geographic);
}

#[test]
fn prop_every_format_returns_what_it_was_given() {
    let folder = tempfile::tempdir().unwrap();
    let grid = hilly(300, 270);
    for (name, options) in [
        ("a.tif", WriteOptions::default()),
        ("b.tif", WriteOptions { compression: Compression::None }),
        ("c.asc", WriteOptions::default()),
        ("d.npy", WriteOptions::default()),
    ] {
        let path = folder.path().join(name);
        write(&path, &grid, &Crs::default(), &options).unwrap();
        let cell_m = Some(grid.geometry.cell);
        let mut back = read_with(&path, &ReadOptions { cell_m }).unwrap().grid;
        if name.ends_with(".npy") {
            back.geometry.origin = grid.geometry.origin;
        }
        assert!(same(&back, &grid), "{name}: {:?} {:?}", back.geometry, grid.geometry);
        assert_eq!(crate::digest::heights(&back), crate::digest::heights(&grid));
    }
}
