use super::*;
use proptest::prelude::*;
use sastrugi_numeric::Geometry;
use std::path::PathBuf;

/// A DEM that ships with the product.
fn shipped(name: &str) -> PathBuf {
    sastrugi_fixtures::workspace_root().join("fixtures/dem").join(name)
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

/// Shape, type, value for no data, cells with data, south-west corner, EPSG code, one height (row, column), and content hash of all
/// heights of the shipped DEMs as rasterio 1.4.4 (GDAL 3.10.3) and numpy 2.4.6 read them (`tests/interop/check_dems.py`): identical
/// values. The files hold int16 in strips and float32 in tiles, all deflated; Otira names no reference system.
#[test]
fn val_shipped_dems_read_as_rasterio_reads_them() {
    type Row =
        (&'static str, [usize; 2], &'static str, f64, usize, [f64; 2], Option<u16>, (usize, usize, f64), &'static str);
    #[rustfmt::skip]
    let table: [Row; 3] = [
        ("jacksboro.tif", [344, 403], "int16", -32768.0, 138632, [-84.41375, 36.44625], Some(4326), (100, 200, 522.0),
         "bc526d81aad2579a12e73d81b1ef5138fdf50284c0f5263cb4d5be07dfdb54a9"),
        ("pozo_blanca.tif", [281, 271], "float32", -9999.0, 50882, [238933.0, 3765101.0], Some(26911), (0, 110, 358.7033386230469),
         "e3ba00d07438ff9deca15a906f877f5b5a1db16243e13b9ca73d9bcf0f9c1244"),
        ("otira.tif", [331, 423], "float32", -9999.0, 70732, [19.16, 13.2], None, (330, 293, -11.580495834350586),
         "fcb52e8c6815d4da2386c8003dd87179f3058d9fa67c3d84500094212df9ae82"),
    ];
    for (name, [rows, cols], dtype, nodata, valid, origin, epsg, (row, col, height), sha256) in table {
        let dem = read(&shipped(name)).unwrap();
        let g = dem.grid.geometry;
        assert_eq!((g.rows, g.cols, dem.info.dtype, dem.grid.finite_count()), (rows, cols, dtype, valid), "{name}");
        assert_eq!((dem.info.nodata, dem.info.crs.epsg), (Some(nodata), epsg), "{name}");
        assert_eq!(dem.info.crs.geographic, name == "jacksboro.tif");
        assert_eq!(dem.grid.at(row, col), height, "{name}");
        assert_eq!(crate::digest::heights(&dem.grid), sha256, "{name}");
        // Within a few units in the last place, because formats state different corners.
        assert!((0..2).all(|a| (g.origin[a] - origin[a]).abs() <= 1e-8), "{name}: {:?}", g.origin);
        assert!(dem.info.placed && !dem.info.pixel_is_point, "{name}");
    }
}

/// A raster of points in a local system that only has a name: read as rasterio 1.4.4 reads the same file, with the first post half a
/// cell from the north-western corner, and written with the same keys.
#[test]
fn val_reference_systems_are_recognised_and_preserved() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.tif");
    #[rustfmt::skip]
    let keys: [u16; 24] = [1, 1, 0, 5,  1024, 0, 1, 1,  1025, 0, 1, 2,  1026, 34737, 11, 0,  3072, 0, 1, 32767,  3076, 0, 1, 9001];
    sparse(&path, 64, NORTH_UP, (&keys, "Local grid|"), (10, 20), 5);
    let dem = read(&path).unwrap();
    assert_eq!((dem.grid.geometry.cell, dem.grid.geometry.origin), ([0.5; 2], [999.75, 2000.25 - 32.0]));
    assert_eq!((dem.grid.at(10, 20), dem.grid.geometry.x(20), dem.grid.geometry.y(10)), (5.0, 1010.0, 1995.0));
    assert!(dem.info.pixel_is_point && dem.info.crs.epsg.is_none() && !dem.info.crs.geographic);
    assert_eq!(dem.info.crs.name, "Local grid");
    let expected: [(u16, GeoKey); 4] = [
        (1024, GeoKey::Short(1)),
        (1026, GeoKey::Ascii("Local grid".to_owned())),
        (3072, GeoKey::Short(32767)),
        (3076, GeoKey::Short(9001)),
    ];
    assert_eq!(dem.info.crs.keys, expected);
    let copy = folder.path().join("copy.tif");
    for dem in [dem, read(&shipped("jacksboro.tif")).unwrap(), read(&shipped("pozo_blanca.tif")).unwrap()] {
        write(&copy, &dem.grid, &dem.info.crs, &WriteOptions::default()).unwrap();
        let again = read(&copy).unwrap();
        assert_eq!(again.info.crs, dem.info.crs);
        assert!(!again.info.pixel_is_point && same(&again.grid, &dem.grid), "{:?}", again.info);
    }
}

/// An ASCII grid names no system: one on the globe with cells of 3 arc seconds is in degrees, one with the same cells elsewhere is not,
/// and a `.prj` file beside it decides.
#[test]
fn val_degrees_are_recognised_in_ascii_grids() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.asc");
    let of = |west: f64, cell: f64| {
        let text = format!("ncols 2\nnrows 2\nxllcorner {west}\nyllcorner 40.1\ncellsize {cell}\n1 2 3 4\n");
        std::fs::write(&path, text).unwrap();
        read(&path).unwrap().info.crs.geographic
    };
    let seconds = 1.0 / 3600.0;
    assert!(of(-105.55, 3.0 * seconds) && of(-105.55, seconds));
    assert!(!of(400.0, 3.0 * seconds) && !of(-105.55, 0.5) && !of(-105.55, 3.1 * seconds));
    std::fs::write(path.with_extension("prj"), "PROJCS[\"plane\"]").unwrap();
    assert!(!of(-105.55, 3.0 * seconds));
    std::fs::write(path.with_extension("prj"), "GEOGCS[\"globe\"]").unwrap();
    assert!(of(-105.55, 0.5));
}

/// A `.prj` file states the kind of system in either form of well-known text, also within a compound system, or in the older form. One that
/// states none, is truncated or cannot be read is refused: a guess could take degrees for metres.
#[test]
fn val_prj_files_state_a_system_or_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.asc");
    let prj = path.with_extension("prj");
    std::fs::write(&path, "ncols 2\nnrows 1\nxllcorner 7\nyllcorner 40\ncellsize 0.5\n1 2\n").unwrap();
    let of = |text: &[u8]| {
        std::fs::write(&prj, text).unwrap();
        read(&path).map(|dem| (dem.info.crs.geographic, dem.info.crs.name)).map_err(|e| e.to_string())
    };
    for (text, geographic, name) in [
        (&b"\xef\xbb\xbfPROJCS[\"R\xe9seau\",GEOGCS[\"RGF93\"]]"[..], false, "R\u{fffd}seau"),
        (b"projcrs(\"plane\", basegeogcrs(\"globe\"))", false, "plane"),
        (b"GEODCRS[\"globe\",CS[ellipsoidal,2]]\n", true, "globe"),
        (b"COMPD_CS[\"PROJ of both\",GEOGCS[\"globe\"],VERT_CS[\"height\"]]", true, "PROJ of both"),
        (b"LOCAL_CS[\"site\",UNIT[\"metre\",1]]", false, "site"),
        (b"Projection    GEOGRAPHIC\r\nDatum WGS84\r\n", true, "GEOGRAPHIC"),
        (b"PROJECTION UTM\nZone 32\n", false, "UTM"),
    ] {
        assert_eq!(of(text), Ok((geographic, name.to_owned())), "{}", String::from_utf8_lossy(text));
    }
    for text in
        [&b""[..], b"\x00\xff", b"Projection", b"PROJCS[\"plane", b"GEOGCS[\"globe\",DATUM[", b"VERT_CS[\"height\"]"]
    {
        let refused = of(text).unwrap_err();
        let words = "a.asc: the file a.prj beside it does not state a projected or geographic coordinate system as well-known text; \
                     write the system of the grid as well-known text, or move the file elsewhere if it does not describe the grid";
        assert!(refused.ends_with(words), "{refused}");
        assert_eq!(claimed(&path, &ReadOptions::default()), None);
    }
    std::fs::remove_file(&prj).unwrap();
    std::fs::create_dir(&prj).unwrap();
    let error = read(&path).unwrap_err();
    let words = "the file a.prj beside it cannot be read (is a folder, not a file)";
    assert!(error.unusable_input() && error.to_string().contains(words), "{error}");
}

/// A tile holds big-endian posts from the north-west; the post of the south-west corner is on the whole degree that the name gives.
#[test]
fn val_a_tile_starts_in_the_north_west() {
    let mut bytes = vec![0; 1201 * 1201 * 2];
    for (row, col, height) in [(0, 1200, 258i16), (1200, 0, -2), (3, 7, i16::MIN)] {
        let at = 2 * (row * 1201 + col);
        bytes[at..at + 2].copy_from_slice(&height.to_be_bytes());
    }
    let dem = parse_any("N44W072.hgt", bytes).unwrap();
    let (grid, g) = (&dem.grid, dem.grid.geometry);
    assert_eq!((grid.at(0, 1200), grid.at(1200, 0), grid.at(0, 0), grid.at(7, 3)), (258.0, -2.0, 0.0, 0.0));
    assert!(grid.at(3, 7).is_nan() && grid.finite_count() == 1201 * 1201 - 1);
    assert!((g.x(0) + 72.0).abs() < 1e-12 && (g.y(1200) - 44.0).abs() < 1e-12, "{g:?}");
    assert!((g.x(1200) + 71.0).abs() < 1e-12 && (g.y(0) - 45.0).abs() < 1e-12, "{g:?}");
    assert!(dem.info.pixel_is_point && dem.info.crs.geographic && dem.info.dtype == "int16");
}

/// Arrays of several types, by rows and by columns, of both byte orders.
#[test]
fn val_arrays_of_every_order() {
    let npy = |descr: &str, fortran: &str, data: &[u8]| {
        let header = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': (2, 3), }}\n");
        let length = (header.len() as u16).to_le_bytes();
        [&b"\x93NUMPY\x01\0"[..], &length, header.as_bytes(), data].concat()
    };
    let by_rows: [i16; 6] = [1, -2, 258, 4, 5, 6];
    let by_columns = [1, 4, -2, 5, 258, 6];
    let big = |values: [i16; 6]| values.iter().flat_map(|v| v.to_be_bytes()).collect::<Vec<u8>>();
    let single = |values: [i16; 6]| values.iter().flat_map(|v| f32::from(*v).to_le_bytes()).collect::<Vec<u8>>();
    for (descr, fortran, data, dtype) in [
        (">i2", "False", big(by_rows), "int16"),
        (">i2", "True", big(by_columns), "int16"),
        ("<f4", "False", single(by_rows), "float32"),
        ("<f4", "True", single(by_columns), "float32"),
    ] {
        let dem = parse_any("a.npy", npy(descr, fortran, &data)).unwrap();
        assert_eq!((dem.grid.rows(), dem.grid.cols(), dem.info.dtype), (2, 3, dtype), "{descr} {fortran}");
        assert_eq!(dem.grid.values, by_rows.map(f64::from), "{descr} {fortran}");
    }
    let short = refusal("a.npy", &npy(">i2", "False", &big(by_rows)[1..]));
    assert!(short.contains("holds 11 bytes of data; 2 x 3 cells need 12"), "{short}");
}

#[test]
fn prop_written_rasters_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let grid = hilly(300, 270);
    for (name, options) in [
        ("a.tif", WriteOptions::default()),
        ("b.tif", WriteOptions { compression: Compression::None, ..WriteOptions::default() }),
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

/// A cloud-optimised file has the heights of a plain one, followed by overviews of means of the finite cells.
#[test]
fn val_overviews_are_means_of_finite_cells() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let grid = hilly(600, 530);
    let options = WriteOptions { cloud_optimised: true, ..WriteOptions::default() };
    write(&path, &grid, &Crs::wgs84(), &options).unwrap();
    assert!(same(&read(&path).unwrap().grid, &grid));
    let file = geotiff_reader::GeoTiffFile::open(&path).unwrap();
    assert_eq!(file.overview_count(), 2);
    let mut level = grid.as_stored();
    for number in 0..2 {
        let overview: Vec<f32> = file.read_overview(number).unwrap().iter().copied().collect();
        let (rows, cols) = (level.rows().div_ceil(2), level.cols().div_ceil(2));
        let mean = |at: usize| {
            let (row, col) = (2 * (at / cols), 2 * (at % cols));
            let cells = [(row, col), (row, col + 1), (row + 1, col), (row + 1, col + 1)];
            let inside = cells.into_iter().filter(|(r, c)| *r < level.rows() && *c < level.cols());
            let finite: Vec<f64> = inside.map(|(r, c)| level.at(r, c)).filter(|v| v.is_finite()).collect();
            (finite.iter().sum::<f64>() / finite.len() as f64) as f32
        };
        let expected: Vec<f32> = (0..rows * cols).map(mean).collect();
        assert_eq!(overview, expected);
        level = Grid::new(Geometry::square(rows, cols, 1.0), expected.into_iter().map(f64::from).collect());
    }
}

/// An overview of codes holds the north-western of each four cells: codes are not averaged.
#[test]
fn val_overviews_of_codes_are_codes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("codes.tif");
    let grid = Grid::new(Geometry::square(301, 270, 1.0), (0..301 * 270).map(|k| f64::from(k % 7)).collect());
    let values = Values::Codes { description: "kinds of ground".into() };
    let options = WriteOptions { cloud_optimised: true, values: values.clone(), ..WriteOptions::default() };
    write(&path, &grid, &Crs::default(), &options).unwrap();
    assert_eq!(read(&path).unwrap().info.values, values);
    let file = geotiff_reader::GeoTiffFile::open(&path).unwrap();
    assert_eq!(file.overview_count(), 1);
    let overview: Vec<f32> = file.read_overview(0).unwrap().iter().copied().collect();
    let expected: Vec<f32> = (0..151 * 135).map(|k| grid.at(2 * (k / 135), 2 * (k % 135)) as f32).collect();
    assert_eq!(overview, expected);
}

/// A small valid file of each format, to be damaged.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let folder = tempfile::tempdir().unwrap();
    let grid = hilly(40, 30);
    let mut samples = vec![];
    for (name, compression) in [
        ("a.tif", Compression::Deflate),
        ("b.tif", Compression::None),
        ("c.asc", Compression::None),
        ("d.npy", Compression::None),
        ("e.png", Compression::None),
    ] {
        let path = folder.path().join(name);
        write(&path, &grid, &Crs::wgs84(), &WriteOptions { compression, ..WriteOptions::default() }).unwrap();
        samples.push((name, std::fs::read(path).unwrap()));
    }
    samples
}

fn parse_any(name: &str, bytes: Vec<u8>) -> Result<Dem, Refusal> {
    parse(Path::new(name), bytes, &ReadOptions::default()).and_then(checked)
}

#[test]
fn prop_truncated_files_are_refused() {
    for (name, bytes) in samples() {
        for length in (0..bytes.len()).step_by(bytes.len() / 97 + 1) {
            let result = parse_any(name, bytes[..length].to_vec());
            // The last value of an ASCII grid may lose digits unnoticed; trailing blanks may be missing.
            assert!(result.is_err() || name == "c.asc" && length + 20 > bytes.len(), "{name} cut to {length}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn prop_damaged_files_never_panic(which in 0usize..5, at in any::<prop::sample::Index>(), bytes in prop::collection::vec(any::<u8>(), 1..6)) {
        let (name, mut file) = samples_once()[which].clone();
        let at = at.index(file.len());
        let end = (at + bytes.len()).min(file.len());
        file[at..end].copy_from_slice(&bytes[..end - at]);
        // What is read in spite of the damage is a raster with data.
        if let Ok(dem) = parse_any(name, file) {
            prop_assert!(dem.grid.finite_count() > 0 && dem.grid.values.iter().all(|z| !z.is_infinite()));
        }
    }

    #[test]
    fn prop_random_bytes_never_panic(which in 0usize..6, bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let starts: [&[u8]; 6] = [b"II*\0\x08\0\0\0", b"MM\0+\0\x08\0\0", b"\x93NUMPY\x01\0", b"\x89PNG\r\n\x1a\n", b"ncols ", b""];
        let _ = parse_any("N44W072.hgt", [starts[which], &bytes].concat());
    }
}

fn samples_once() -> &'static [(&'static str, Vec<u8>)] {
    static SAMPLES: std::sync::OnceLock<Vec<(&'static str, Vec<u8>)>> = std::sync::OnceLock::new();
    SAMPLES.get_or_init(samples)
}

fn refusal(name: &str, bytes: &[u8]) -> String {
    parse_any(name, bytes.to_vec()).unwrap_err().to_string()
}

#[test]
fn val_unusable_ascii_grids_are_refused_with_the_reason() {
    let head = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n";
    let with = |body: &str| refusal("a.asc", format!("{head}{body}").as_bytes());
    assert!(with("1 2 3 4 5").contains("5 of the 6"));
    assert!(with("1 2 3 4 5 6 7").contains("more than the 6"));
    assert!(with("1 2 3 4 5 six").contains("\"six\""));
    assert!(with("-9999 -9999 -9999 -9999 -9999 -9999").contains("holds data"));
    let absurd = head.replace("ncols 3", "ncols 4000000000").replace("nrows 2", "nrows 4000000000");
    assert!(refusal("a.asc", absurd.as_bytes()).starts_with("claims "));
    let large = head.replace("ncols 3", "ncols 10000").replace("nrows 2", "nrows 10000");
    assert!(refusal("a.asc", large.as_bytes()).contains("bytes"));
    assert!(refusal("a.asc", head.replace("ncols 3", "ncols -3").as_bytes()).contains("count"));
    let negative = head.replace("cellsize 1", "cellsize -1") + "1 2 3 4 5 6";
    assert!(refusal("a.asc", negative.as_bytes()).contains("cell size"));
    assert!(refusal("a.asc", b"").contains("empty"));
    assert!(refusal("a.txt", b"hello").contains("not a supported raster"));
}

/// A reason that begins with its verb has the file as its subject, without a colon between them.
#[test]
fn val_a_folder_is_not_a_raster() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    std::fs::create_dir(&path).unwrap();
    assert_eq!(read(&path).unwrap_err().to_string(), format!("{} is a folder, not a raster", path.display()));
}

#[test]
fn val_centres_and_uneven_cells_of_ascii_grids() {
    let text = "NROWS 2\nNCOLS 3\nXLLCENTER 10.5\nYLLCENTER 20.5\nDX 1\nDY 2\n1 2 3\n4 5 6.5\n";
    let dem = parse_any("a.asc", text.as_bytes().to_vec()).unwrap();
    let expected = Geometry { rows: 2, cols: 3, cell: [1.0, 2.0], origin: [10.0, 19.5] };
    assert_eq!(dem.grid, Grid::new(expected, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.5]));
}

#[test]
fn val_tiles_need_a_name_and_a_size() {
    assert!(refusal("N44W072.hgt", &[0; 10]).contains("10 bytes"));
    assert!(refusal("summit.hgt", &[0; 1201 * 1201 * 2]).contains("named after"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("S01E002.hgt");
    let mut grid = Grid::filled(Geometry::square(1201, 1201, 1.0), 7.0);
    grid.values[1] = f64::NAN;
    write(&path, &grid, &Crs::default(), &WriteOptions::default()).unwrap();
    let back = read(&path).unwrap();
    assert_eq!((back.grid.values[0], back.grid.geometry.x(0), back.grid.geometry.y(1200)), (7.0, 2.0, -1.0));
    assert!(back.grid.values[1].is_nan());
    assert!(
        write(&folder.path().join("S01E003.hgt"), &hilly(4, 4), &Crs::default(), &WriteOptions::default()).is_err()
    );
}

#[test]
fn val_heights_that_a_format_cannot_represent_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    for value in [NO_DATA, NO_DATA - 1e-6, 1e39] {
        let grid = Grid::filled(Geometry::square(2, 2, 1.0), value);
        assert!(write(&path, &grid, &Crs::default(), &WriteOptions::default()).is_err());
        assert!(!path.exists());
    }
    assert!(matches!(read(&folder.path().join("none.tif")), Err(DemError::Missing { .. })));
    assert!(read(folder.path()).unwrap_err().unusable_input());
}

/// Bytes of a deflated GeoTIFF, to detect a change of backend (through another crate's features, for example).
#[test]
fn gold_bytes_of_a_geotiff() {
    let bytes = tiff_writer::heights(&hilly(300, 270), &Crs::wgs84(), &WriteOptions::default()).unwrap();
    assert_eq!(crate::digest::of_bytes(&bytes), GOLD_GEOTIFF);
}
const GOLD_GEOTIFF: &str = "d7d725120c8b5f26bf817ad08e6cd612d8b2e5da3c6189f6540f42e6500ac24c";

#[test]
fn prop_png_levels_preserve_heights_to_half_a_step() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let grid = hilly(50, 60);
    let scale = write_png_heights(&path, &grid).unwrap();
    let back = read(&path).unwrap();
    let close = |a: &f64, b: &f64| (a - b).abs() <= 0.5001 * scale.step_m || a.is_nan() && b.is_nan();
    assert!(grid.values.iter().zip(&back.grid.values).all(|(a, b)| close(a, b)));
    let levels = Grid::new(Geometry::square(2, 3, 1.0), vec![0u16, 1, 65535, 7, 8, 9]);
    write_png16(&path, &levels).unwrap();
    assert_eq!(read(&path).unwrap().grid.values, [0.0, 1.0, 65535.0, 7.0, 8.0, 9.0]);
}

#[test]
fn prop_classes_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.tif");
    let codes = hilly(300, 270).map(|v| if v.is_nan() { 255 } else { (v.abs() as u8) % 3 });
    write_classes(&path, &codes, &Crs::default()).unwrap();
    assert_eq!(read_classes(&path).unwrap(), codes);
    write(&path, &hilly(3, 4), &Crs::default(), &WriteOptions::default()).unwrap();
    assert!(read_classes(&path).is_err());
}

/// Rows read a few at a time equal those of the whole raster.
fn blocks_agree(path: &Path) {
    let options = ReadOptions::default();
    let whole = read_with(path, &options).unwrap();
    let mut reader = open(path, &options).unwrap();
    assert_eq!((reader.geometry(), reader.info()), (whole.grid.geometry, &whole.info), "{}", path.display());
    let (rows, block) = (whole.grid.rows(), reader.block_rows());
    assert!((1..=rows).contains(&block));
    let mut ranges = vec![0..rows, 0..1, rows - 1..rows, rows / 3..rows / 3 + rows.div_ceil(3)];
    ranges.extend((0..rows).step_by(block).map(|first| first..(first + block).min(rows)).take(40));
    for range in ranges {
        let part = reader.read_rows(range.clone()).unwrap();
        let expected = whole.grid.window(range.start, 0, range.len(), whole.grid.cols());
        assert!(same(&part, &expected), "{}: rows {range:?}", path.display());
    }
    let cols = whole.grid.cols();
    for part in [0..1, cols - 1..cols, cols / 3..cols / 3 + cols.div_ceil(3)] {
        let expected = whole.grid.window(rows / 3, part.start, rows.div_ceil(3), part.len());
        let found = reader.read_part(rows / 3..rows / 3 + rows.div_ceil(3), part.clone()).unwrap();
        assert!(same(&found, &expected), "{}: columns {part:?}", path.display());
    }
    assert!(matches!(reader.read_part(0..1, cols..cols + 1), Err(DemError::Unfit { .. })));
    for range in [0..rows + 1, rows..rows + 1, 5..5] {
        assert!(matches!(reader.read_rows(range), Err(DemError::Unfit { .. })));
    }
}

#[test]
fn val_rows_of_rasters_of_every_format() {
    ["jacksboro.tif", "pozo_blanca.tif", "otira.tif"].map(shipped).iter().for_each(|path| blocks_agree(path));
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let tile = Grid::new(Geometry::square(1201, 1201, 1.0), (0..1201 * 1201).map(|k| f64::from(k % 977)).collect());
    write(&path("N44W072.hgt"), &tile, &Crs::default(), &WriteOptions::default()).unwrap();
    blocks_agree(&path("N44W072.hgt"));
    for name in ["a.asc", "a.npy", "a.png"] {
        write(&path(name), &hilly(60, 27), &Crs::default(), &WriteOptions::default()).unwrap();
        blocks_agree(&path(name));
    }
    sparse(&path("points.tif"), 256, NORTH_UP, (&[1, 1, 0, 1, 1025, 0, 1, 2], ""), (100, 20), 5);
    blocks_agree(&path("points.tif"));
}

#[test]
fn val_rows_of_written_rasters() {
    let folder = tempfile::tempdir().unwrap();
    let grid = hilly(600, 270);
    for compression in [Compression::None, Compression::Deflate, Compression::Zstd] {
        let path = folder.path().join("a.tif");
        write(&path, &grid, &Crs::wgs84(), &WriteOptions { compression, ..WriteOptions::default() }).unwrap();
        blocks_agree(&path);
        assert!(same(&read(&path).unwrap().grid, &grid), "{compression:?}");
        assert_eq!(open(&path, &ReadOptions::default()).unwrap().block_rows(), 256);
    }
}

/// Sizes claimed by a header equal those of the raster, without decoding.
#[test]
fn val_claims() {
    let folder = tempfile::tempdir().unwrap();
    let grid = hilly(60, 27);
    let claim = |name: &str, options: &ReadOptions| {
        let path = folder.path().join(name);
        write(&path, &grid, &Crs::default(), &Default::default()).unwrap();
        claimed(&path, options)
    };
    let cell_m = Some(grid.geometry.cell[0].min(grid.geometry.cell[1]));
    let none = ReadOptions::default();
    for name in ["a.tif", "a.asc"] {
        let claimed = claim(name, &none).unwrap();
        let geometry = read(&folder.path().join(name)).unwrap().grid.geometry;
        assert_eq!((claimed.cells, claimed.points, claimed.geographic), (60 * 27, 0, false), "{name}");
        assert_eq!((claimed.cell_m, claimed.geometry), (cell_m, Some(geometry)), "{name}");
    }
    // A format is recognised by its content, whatever the ending.
    for (name, other) in [("a.tif", "tif.dat"), ("a.asc", "asc.txt")] {
        std::fs::copy(folder.path().join(name), folder.path().join(other)).unwrap();
        assert_eq!(claimed(&folder.path().join(other), &none), claim(name, &none), "{other}");
    }
    // Rasters without georeferencing have their corner at (0, 0), and the cell size given by the caller.
    for name in ["a.png", "a.npy"] {
        let claimed = claim(name, &none).unwrap();
        assert_eq!((claimed.cells, claimed.cell_m), (60 * 27, None), "{name}");
        let sized = ReadOptions { cell_m: Some([0.5, 0.25]) };
        let geometry = read_with(&folder.path().join(name), &sized).unwrap().grid.geometry;
        let claimed = claim(name, &sized).unwrap();
        assert_eq!((claimed.cell_m, claimed.geometry), (Some(0.25), Some(geometry)), "{name}");
    }
    std::fs::write(folder.path().join("stub.png"), b"\x89PNG\r\n").unwrap();
    assert_eq!(claimed(&folder.path().join("stub.png"), &ReadOptions::default()), None);
    // A truncated number is not read as a shorter one.
    std::fs::write(folder.path().join("cut.asc"), "ncols 27\nnrows 60\nxllcorner 0\nyllcorner 0\ncellsize 1").unwrap();
    assert_eq!(claimed(&folder.path().join("cut.asc"), &none), None);
    assert_eq!(claimed(&folder.path().join("none.tif"), &ReadOptions::default()), None);
}

/// The `.prj` file of an ASCII grid belongs to it whatever the ending of the grid; beside other files it belongs to none.
#[test]
fn val_a_prj_file_belongs_to_an_ascii_grid() {
    let folder = tempfile::tempdir().unwrap();
    let beside = |name: &str, content: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        sidecar(&path)
    };
    let grid = b"\xef\xbb\xbfNCOLS 1\nnrows 1\ncellsize 1\n7.5\n";
    assert_eq!(beside("a.asc", grid), None);
    let prj = folder.path().join("a.prj");
    std::fs::write(&prj, "PROJCS[\"plane\"]").unwrap();
    for name in ["a.asc", "a.txt", "a.grd", "a"] {
        assert_eq!(beside(name, grid), Some(prj.clone()), "{name}");
    }
    assert_eq!(beside("a.asc", &[&[b'\n'; 100], &grid[3..]].concat()), Some(prj.clone()));
    assert_eq!(beside("a.csv", b"x,y,z\n0,0,1\n"), None);
    assert_eq!(sidecar(&folder.path().join("none.asc")), None);
}

/// Files of strips without georeferencing, with various types of heights, compressions and predictors.
#[test]
fn val_rows_of_plain_tiffs() {
    use tiff::encoder::{Compression as Packed, DeflateLevel, Predictor, TiffEncoder, colortype};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plain.tif");
    let (rows, cols) = (101u32, 37u32);
    macro_rules! strips {
        ($color:ty, $t:ty, $packed:expr, $predictor:expr) => {{
            let values: Vec<$t> = (0..rows * cols).map(|k| (k.wrapping_mul(2_654_435_761) >> 25) as $t).collect();
            let file = File::create(&path).unwrap();
            let mut encoder = TiffEncoder::new(file).unwrap().with_compression($packed).with_predictor($predictor);
            let mut image = encoder.new_image::<$color>(cols, rows).unwrap();
            image.rows_per_strip(16).unwrap();
            image.write_data(&values).unwrap();
            assert_eq!(open(&path, &ReadOptions::default()).unwrap().block_rows(), 16);
            blocks_agree(&path);
            let heights: Vec<f64> = values.iter().map(|&v| v as f64).collect();
            assert_eq!(read(&path).unwrap().grid.values, heights);
        }};
    }
    let deflate = || Packed::Deflate(DeflateLevel::Fast);
    strips!(colortype::Gray32Float, f32, Packed::Uncompressed, Predictor::None);
    strips!(colortype::Gray64Float, f64, deflate(), Predictor::None);
    strips!(colortype::Gray16, u16, Packed::Lzw, Predictor::Horizontal);
    strips!(colortype::GrayI16, i16, Packed::Packbits, Predictor::None);
    strips!(colortype::Gray8, u8, deflate(), Predictor::None);
    strips!(colortype::GrayI32, i32, Packed::Lzw, Predictor::None);
}

#[test]
fn prop_rows_of_damaged_files_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    for (name, bytes) in samples().into_iter().filter(|(name, _)| name.ends_with(".tif")) {
        for (k, at) in (0..bytes.len()).step_by(bytes.len() / 61 + 1).enumerate() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << (k % 8);
            if k % 2 == 0 {
                damaged.truncate(bytes.len() - at);
            }
            std::fs::write(&path, damaged).unwrap();
            if let Ok(mut reader) = open(&path, &ReadOptions::default()) {
                let g = reader.geometry();
                let rows = g.rows.min(50);
                if let Ok(part) = reader.read_rows(0..rows) {
                    assert_eq!((part.rows(), part.cols()), (rows, g.cols), "{name}");
                }
            }
        }
    }
}

/// A GeoTIFF of int16 in strips of 64 rows, all zero except one cell, written as a sparse file. A point (x, y, 0, 1) is the matrix
/// times (column, row, 0, 1); then come the key directory and its text.
fn sparse(
    path: &Path,
    side: u32,
    matrix: [f64; 16],
    (keys, text): (&[u16], &str),
    (row, col): (u64, u64),
    height: i16,
) {
    use std::io::{Seek, SeekFrom, Write};
    const STRIP_ROWS: u32 = 64;
    const DATA: u32 = 16384;
    let strip_bytes = STRIP_ROWS * side * 2;
    let strips = side / STRIP_ROWS;
    let longs = |values: Vec<u32>| values.into_iter().flat_map(u32::to_le_bytes).collect::<Vec<u8>>();
    let doubles = |values: &[f64]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let shorts = |values: &[u16]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let one = |value: u32| longs(vec![value]);
    // Tag, type (2 text, 3 short, 4 long, 12 double), count, value.
    let mut tags: Vec<(u16, u16, u32, Vec<u8>)> = vec![
        (256, 4, 1, one(side)),
        (257, 4, 1, one(side)),
        (258, 3, 1, one(16)),
        (259, 3, 1, one(1)),
        (262, 3, 1, one(1)),
        (273, 4, strips, longs((0..strips).map(|k| DATA + k * strip_bytes).collect())),
        (277, 3, 1, one(1)),
        (278, 4, 1, one(STRIP_ROWS)),
        (279, 4, strips, longs(vec![strip_bytes; strips as usize])),
        (339, 3, 1, one(2)),
        (34264, 12, 16, doubles(&matrix)),
        (34735, 3, keys.len() as u32, shorts(keys)),
    ];
    if !text.is_empty() {
        tags.push((34737, 2, text.len() as u32 + 1, [text.as_bytes(), b"\0"].concat()));
    }
    let (mut ifd, mut extra) = (shorts(&[tags.len() as u16]), Vec::new());
    let extra_at = 8 + 2 + 12 * tags.len() as u32 + 4;
    for (tag, kind, count, value) in tags {
        ifd.extend(shorts(&[tag, kind]));
        ifd.extend(one(count));
        if value.len() <= 4 {
            ifd.extend(value);
        } else {
            ifd.extend(one(extra_at + extra.len() as u32));
            extra.extend(value);
        }
    }
    ifd.extend(one(0));
    let mut file = File::create(path).unwrap();
    file.write_all(&[b"II*\0\x08\0\0\0", &ifd[..], &extra].concat()).unwrap();
    file.set_len(u64::from(DATA) + u64::from(side) * u64::from(side) * 2).unwrap();
    file.seek(SeekFrom::Start(u64::from(DATA) + (row * u64::from(side) + col) * 2)).unwrap();
    file.write_all(&height.to_le_bytes()).unwrap();
}

const NO_KEYS: (&[u16], &str) = (&[1, 1, 0, 0], "");
#[rustfmt::skip]
const NORTH_UP: [f64; 16] = [0.5, 0.0, 0.0, 1000.0,  0.0, -0.5, 0.0, 2000.0,  0.0, 0.0, 0.0, 0.0,  0.0, 0.0, 0.0, 1.0];

#[test]
fn val_rows_of_a_raster_that_starts_in_the_south() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("down.tif");
    let mut matrix = NORTH_UP;
    matrix[5] = 0.5;
    sparse(&path, 768, matrix, NO_KEYS, (10, 20), 5);
    let flipped = read(&path).unwrap();
    assert!(flipped.info.notes.iter().any(|note| note.contains("southern")), "{:?}", flipped.info.notes);
    assert_eq!((flipped.grid.geometry.origin, flipped.grid.at(767 - 10, 20)), ([1000.0, 2000.0], 5.0));
    blocks_agree(&path);
}

/// A raster too large to be read at once (2^30 cells) is read in rows.
#[test]
fn val_rows_of_a_raster_larger_than_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.tif");
    sparse(&path, 32768, NORTH_UP, NO_KEYS, (20_000, 31_000), -7);
    assert!(read(&path).unwrap_err().to_string().contains("at most"));
    let mut reader = open(&path, &ReadOptions::default()).unwrap();
    let g = reader.geometry();
    assert_eq!((g.rows, g.cols, g.cell, g.origin), (32768, 32768, [0.5; 2], [1000.0, 2000.0 - 16384.0]));
    let part = reader.read_rows(19_990..20_010).unwrap();
    assert_eq!((part.at(10, 31_000), part.values.iter().filter(|z| **z != 0.0).count()), (-7.0, 1));
    assert!(matches!(reader.read_rows(0..32768), Err(DemError::Unfit { .. })));
}

/// All rows of such a raster, one strip at a time: 0.2 GB of memory.
#[test]
#[ignore = "slow: ./test --full"]
fn val_all_rows_of_a_raster_larger_than_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.tif");
    sparse(&path, 32768, NORTH_UP, NO_KEYS, (20_000, 31_000), -7);
    let mut reader = open(&path, &ReadOptions::default()).unwrap();
    let (rows, step) = (reader.geometry().rows, reader.block_rows());
    let mut sum = 0.0;
    for first in (0..rows).step_by(step) {
        sum += reader.read_rows(first..first + step).unwrap().values.iter().sum::<f64>();
    }
    assert_eq!(sum, -7.0);
}
