use super::*;
use crate::dem::{self, Crs, ReadOptions, WriteOptions};
use las::point::Classification;
use las::{Builder, Color, Transform, Vector, Vlr, Writer};
use proptest::prelude::*;
use sastrugi_numeric::{Geometry, Streams};
use std::collections::BTreeMap;

/// x, y, z in millimetres, class, withheld.
type Shot = ([i32; 3], u8, bool);

fn ground(places: &[[i32; 3]]) -> Vec<Shot> {
    places.iter().map(|place| (*place, 2, false)).collect()
}

fn header(format: u8, extra_bytes: u16) -> Builder {
    let mut builder = Builder::from((1, 4));
    builder.point_format = las::point::Format::new(format).unwrap();
    builder.point_format.extra_bytes = extra_bytes;
    let transform = Transform { scale: 0.001, offset: 0.0 };
    builder.transforms = Vector { x: transform, y: transform, z: transform };
    // Keep test files independent of the clock.
    builder.date = None;
    builder
}

/// A file in memory; compressed or not.
fn file(shots: &[Shot], mut builder: Builder, compressed: bool) -> Vec<u8> {
    builder.point_format.is_compressed = compressed;
    let header = builder.into_header().unwrap();
    let format = *header.point_format();
    let mut writer = Writer::new(std::io::Cursor::new(vec![]), header).unwrap();
    for (i, ([x, y, z], class, withheld)) in shots.iter().enumerate() {
        let metres = |mm: &i32| f64::from(*mm) * 0.001;
        writer
            .write_point(las::Point {
                x: metres(x),
                y: metres(y),
                z: metres(z),
                classification: Classification::new(*class).unwrap(),
                is_withheld: *withheld,
                return_number: 1,
                number_of_returns: 1,
                gps_time: format.has_gps_time.then_some(i as f64),
                color: format.has_color.then(|| Color::new(1, i as u16, 3)),
                nir: format.has_nir.then_some(i as u16),
                extra_bytes: vec![i as u8; usize::from(format.extra_bytes)],
                ..las::Point::default()
            })
            .unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

fn plain(shots: &[Shot]) -> Vec<u8> {
    file(shots, header(1, 0), false)
}

fn grid_bytes(bytes: &[u8], settings: &GridSettings) -> Result<Gridded, DemError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.laz");
    std::fs::write(&path, bytes).unwrap();
    read(&path, settings)
}

fn of(cell_m: f64, statistic: Statistic) -> GridSettings {
    GridSettings { cell_m: Some(cell_m), statistic, ..GridSettings::default() }
}

fn refusal(bytes: &[u8]) -> String {
    let error = grid_bytes(bytes, &of(1.0, Statistic::Mean)).unwrap_err();
    assert!(error.unusable_input(), "{error}");
    error.to_string()
}

#[test]
fn val_statistics_of_four_points() {
    let shots = ground(&[[100, 100, 1000], [200, 900, 4000], [900, 100, 2000], [500, 500, 3000]]);
    let bytes = plain(&shots);
    let statistics = [
        (Statistic::Mean, 2.5),
        (Statistic::Median, 2.5),
        (Statistic::Percentile(0.0), 1.0),
        (Statistic::Percentile(25.0), 1.75),
        (Statistic::Percentile(90.0), 3.7),
        (Statistic::Percentile(100.0), 4.0),
        (Statistic::Min, 1.0),
        (Statistic::Max, 4.0),
    ];
    for (statistic, expected) in statistics {
        let gridded = grid_bytes(&bytes, &of(1.0, statistic)).unwrap();
        assert_eq!(gridded.counts.values, [4]);
        assert!((gridded.dem.grid.values[0] - expected).abs() < 1e-12, "{statistic:?}");
    }
}

/// A point on a border belongs to the eastern or southern cell, and one on the southern border of the grid to the last row.
#[test]
fn val_points_on_borders() {
    let shots = ground(&[[0, 0, 1000], [1000, 1000, 2000], [2000, 2000, 3000], [500, 1500, 4000]]);
    let gridded = grid_bytes(&plain(&shots), &of(1.0, Statistic::Mean)).unwrap();
    let expected = Geometry { rows: 2, cols: 3, cell: [1.0; 2], origin: [0.0; 2] };
    assert_eq!(gridded.dem.grid.geometry, expected);
    assert_eq!(gridded.counts.values, [1, 0, 1, 1, 1, 0]);
    assert_eq!(gridded.dem.grid.at(0, 2), 3.0);
    let at = expected.cell_at(1.0, 1.0).unwrap();
    assert_eq!((at, gridded.dem.grid.at(1, 1)), ((1, 1), 2.0));
    assert!(gridded.dem.grid.at(0, 1).is_nan());
}

#[test]
fn val_clouds_of_one_site_share_their_cells() {
    let west =
        grid_bytes(&plain(&ground(&[[-2300, 700, 1000], [400, 2100, 2000]])), &of(0.5, Statistic::Mean)).unwrap();
    let east =
        grid_bytes(&plain(&ground(&[[410, 2110, 3000], [9000, 9000, 1000]])), &of(0.5, Statistic::Mean)).unwrap();
    let (west, east) = (west.dem.grid, east.dem.grid);
    assert_eq!(west.geometry.origin, [-2.5, 0.5]);
    for axis in 0..2 {
        let cells = (east.geometry.origin[axis] - west.geometry.origin[axis]) / 0.5;
        assert_eq!(cells, cells.round());
    }
}

#[test]
fn val_noise_and_other_classes_are_left_out() {
    let shots = [
        ([100, 100, 1000], 2, false),
        ([100, 100, 9000], 7, false),
        ([100, 100, 9000], 18, false),
        ([100, 100, 9000], 2, true),
        ([100, 100, 3000], 5, false),
    ];
    let mut settings = of(1.0, Statistic::Mean);
    for format in [1, 6] {
        // Five bits hold classes up to 31, so 18 can be stored in both formats.
        let bytes = file(&shots, header(format, 0), false);
        settings.ground_only = false;
        let all = grid_bytes(&bytes, &settings).unwrap();
        assert_eq!((all.counts.values[0], all.dem.grid.values[0]), (2, 2.0));
        assert!(all.dem.info.notes.iter().any(|note| note.starts_with("left out 3 points marked as withheld")));
        settings.ground_only = true;
        let bare = grid_bytes(&bytes, &settings).unwrap();
        assert_eq!((bare.counts.values[0], bare.dem.grid.values[0]), (1, 1.0));
        assert!(bare.dem.info.notes.iter().any(|note| note == "left out 1 point not of class 2, ground"));
    }
    let error = grid_bytes(&plain(&shots[4..]), &settings).unwrap_err();
    assert!(error.to_string().contains("has 1 point, but none of class 2, ground"), "{error}");
    assert!(refusal(&plain(&shots[1..4])).contains("every point is withheld or noise, 3 points in all"));
    assert!(refusal(&plain(&shots[1..2])).contains("every point is withheld or noise, 1 point in all"));
}

/// Reference: cells in a map, statistics from sorted lists.
fn slow(shots: &[Shot], cell: f64, statistic: Statistic) -> BTreeMap<(i64, i64), (u32, f64)> {
    let low = shots.iter().map(|([_, y, _], ..)| f64::from(*y) * 0.001).fold(f64::INFINITY, f64::min);
    let mut cells: BTreeMap<(i64, i64), Vec<f64>> = BTreeMap::new();
    for ([x, y, z], ..) in shots {
        let [x, y, z] = [x, y, z].map(|v| f64::from(*v) * 0.001);
        let south = ((y / cell).ceil() - 1.0).max((low / cell).floor());
        cells.entry(((x / cell).floor() as i64, south as i64)).or_default().push(z);
    }
    let value = |heights: &mut Vec<f64>| {
        heights.sort_by(f64::total_cmp);
        let n = heights.len();
        let percentile = |p: f64| {
            let rank = (n - 1) as f64 * p / 100.0;
            let (low, high) = (heights[rank.floor() as usize], heights[rank.ceil() as usize]);
            low + (rank - rank.floor()) * (high - low)
        };
        let height = match statistic {
            Statistic::Mean => heights.iter().sum::<f64>() / n as f64,
            Statistic::Min => heights[0],
            Statistic::Max => heights[n - 1],
            Statistic::Median => percentile(50.0),
            Statistic::Percentile(p) => percentile(p),
        };
        (n as u32, height)
    };
    cells.into_iter().map(|(cell, mut heights)| (cell, value(&mut heights))).collect()
}

fn shots() -> impl Strategy<Value = Vec<Shot>> {
    let place = (-20_000i32..20_000, -20_000i32..20_000, -5000i32..5000);
    prop::collection::vec(place.prop_map(|(x, y, z)| ([x, y, z], 2, false)), 1..300)
}

fn statistics() -> impl Strategy<Value = Statistic> {
    prop_oneof![
        Just(Statistic::Mean),
        Just(Statistic::Median),
        Just(Statistic::Min),
        Just(Statistic::Max),
        (0.0..=100.0).prop_map(Statistic::Percentile),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn prop_cells_agree_with_the_reference(
        shots in shots(),
        statistic in statistics(),
        cell in prop::sample::select(vec![0.1, 0.25, 0.7, 1.0, 3.0, 50.0]),
        format in prop::sample::select(vec![0u8, 1, 2, 3, 6, 7, 8]),
        extra in 0u16..6,
        compressed in any::<bool>(),
    ) {
        let bytes = file(&shots, header(format, extra), compressed);
        let gridded = grid_bytes(&bytes, &of(cell, statistic)).unwrap();
        let grid = &gridded.dem.grid;
        let expected = slow(&shots, cell, statistic);
        prop_assert_eq!(grid.finite_count(), expected.len());
        let g = grid.geometry;
        let [west, south] = g.origin.map(|o| (o / cell).round() as i64);
        for ((i, j), (n, height)) in expected {
            let (row, col) = (g.rows - 1 - (j - south) as usize, (i - west) as usize);
            prop_assert_eq!(gridded.counts.at(row, col), n);
            prop_assert!((grid.at(row, col) - height).abs() < 1e-9);
        }
    }

    /// The result does not depend on the order of the points.
    #[test]
    fn prop_order_does_not_matter(shots in shots(), statistic in statistics()) {
        let settings = GridSettings { statistic, fill_cells: 2, ..GridSettings::default() };
        let forward = grid_bytes(&plain(&shots), &settings).unwrap();
        let backward = grid_bytes(&plain(&shots.iter().rev().copied().collect::<Vec<_>>()), &settings).unwrap();
        let bits = |g: &Gridded| g.dem.grid.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&forward), bits(&backward));
        prop_assert_eq!(forward.dem.info.notes, backward.dem.info.notes);
    }
}

/// Enough points for several chunks: LASzip starts a new one after 50 000.
fn many() -> Vec<Shot> {
    (0..120_000).map(|i: i32| ([i % 400 * 50, i / 400 * 50, i.wrapping_mul(7919) % 1000], 2, false)).collect()
}

#[test]
fn val_compressed_chunks_hold_the_same_points() {
    let shots = many();
    for format in [1, 7] {
        let settings = of(0.2, Statistic::Mean);
        let plain = grid_bytes(&file(&shots, header(format, 2), false), &settings).unwrap();
        let compressed = grid_bytes(&file(&shots, header(format, 2), true), &settings).unwrap();
        assert_eq!(plain, compressed);
        assert_eq!(plain.counts.values.iter().map(|n| u64::from(*n)).sum::<u64>(), 120_000);
    }
}

/// Points on a lattice: the chosen cell size is its spacing, and a note states it.
#[test]
fn val_a_cell_size_is_chosen() {
    let gridded = grid_bytes(&plain(&many()), &GridSettings::default()).unwrap();
    assert_eq!(gridded.dem.grid.geometry.cell, [0.05; 2]);
    assert!(
        gridded.dem.info.notes.iter().any(|note| note.contains("0.05 m was chosen")),
        "{:?}",
        gridded.dem.info.notes
    );
    for places in [vec![[5, 5, 5]], vec![[5, 5, 5], [5, 9005, 5]], vec![[0, 0, 0]; 9]] {
        let few = grid_bytes(&plain(&ground(&places)), &GridSettings::default()).unwrap();
        assert!(few.dem.info.notes.iter().any(|note| note.contains("was chosen")));
    }
}

/// However thin a cloud, its grid has few more cells than the cloud has points: 7 points along 4.98 m need cells of 0.99 m.
#[test]
fn val_a_thin_cloud_gets_few_cells() {
    let places: Vec<[i32; 3]> = (0..7).map(|i| [100 + 830 * i, 100 + i % 2, 0]).collect();
    for places in [places.clone(), places.iter().map(|[x, y, z]| [*y, *x, *z]).collect()] {
        let gridded = grid_bytes(&plain(&ground(&places)), &GridSettings::default()).unwrap();
        let g = gridded.dem.grid.geometry;
        assert_eq!((g.cell, g.rows.min(g.cols), g.rows.max(g.cols)), ([1.0; 2], 1, 6));
    }
}

/// Evenly scattered points, n per square metre: a share 1 - exp(-n c^2) of cells of side c holds some. For n = 100 the shares at 0.1 m
/// and 0.2 m are 0.63 and 0.98, whose sum is above 3/2, so the finer size is chosen; for n = 60 they are 0.45 and 0.91: the coarser. With
/// 10 000 cells or more the shares are known to 0.005.
#[test]
fn stat_the_chosen_cell_size_follows_the_density() {
    let mut stream = Streams::for_seed(1, "points-test").stream("scattered");
    for (per_square_metre, cell) in [(100, 0.1), (60, 0.2)] {
        let mut millimetres = || (stream.uniform() * 20_000.0) as i32;
        let shots: Vec<Shot> =
            (0..400 * per_square_metre).map(|_| ([millimetres(), millimetres(), 0], 2, false)).collect();
        let gridded = grid_bytes(&plain(&shots), &GridSettings::default()).unwrap();
        assert_eq!(gridded.dem.grid.geometry.cell, [cell; 2], "{per_square_metre} points per square metre");
    }
}

/// 60 000 points without order, of which 141 lie on borders between columns and 120 on borders between rows.
fn scattered() -> Vec<Shot> {
    let shot = |i: i64| {
        let place = [
            (31 * i * i + 7919 * i) % 40_009 - 20_000,
            (17 * i * i + 104_729 * i) % 30_011 - 10_000,
            (13 * i * i + 7 * i) % 5003 - 1000,
        ];
        (place.map(|v| v as i32), 2, false)
    };
    (0..60_000).map(shot).collect()
}

/// Shape, points per cell (SHA-256 of 32-bit numbers from the north-west) and mean heights (content hash) of the same points as written
/// and read by laspy 2.7.0 and gridded by numpy 2.4.6, by the rule for borders in whole millimetres.
#[test]
fn val_cells_hold_the_points_that_numpy_finds() {
    for (format, compressed) in [(1, false), (3, true), (7, true)] {
        let bytes = file(&scattered(), header(format, 0), compressed);
        let gridded = grid_bytes(&bytes, &of(0.5, Statistic::Mean)).unwrap();
        let g = gridded.dem.grid.geometry;
        assert_eq!((g.rows, g.cols, g.origin), (61, 81, [-20.0, -10.0]));
        assert_eq!(gridded.dem.grid.finite_count(), 4824);
        assert_eq!(gridded.counts.values[60 * 81 + 76..], [11, 10, 19, 13, 0]);
        let counts: Vec<u8> = gridded.counts.values.iter().flat_map(|n| n.to_le_bytes()).collect();
        let sha256 = "3a17e63f7ba315a5b3b5a10c8fd7ace81a806c44f07bf41f0fcb83ff7a5505fb";
        assert_eq!(crate::digest::of_bytes(&counts), sha256, "format {format}");
        let sha256 = "b521c80fdd5bf7a2e7d9739c7aad817968deb35ddfc8576776d4c3e8138af9f3";
        assert_eq!(crate::digest::heights(&gridded.dem.grid), sha256, "format {format}");
    }
}

/// Points 50 mm apart in a strip across a box of 60 m, of which it fills a tenth: 1200 x 1200 cells for 141 540 points. Memory is planned for
/// four cells per point, at least 1024. More are refused only where memory was planned and no cell size is given: also of masks, obstacles and
/// inputs of terrains, which have none.
#[test]
fn val_a_strip_across_its_box_takes_no_more_cells_than_planned() {
    let across = |i: i32| (i - 60).max(0)..=(i + 60).min(1199);
    let places: Vec<[i32; 3]> = (0..1200).flat_map(|i| across(i).map(move |j| [50 * i + 25, 50 * j + 25, 0])).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("strip.las");
    std::fs::write(&path, plain(&ground(&places))).unwrap();
    let planned = dem::claimed(&path, &ReadOptions::default()).unwrap().cells;
    assert_eq!((places.len(), planned), (141_540, 4 * 141_540));
    let limited = |planned: u64| GridSettings { planned_cells: Some(planned), ..GridSettings::default() };
    let error = read(&path, &limited(planned)).unwrap_err();
    let words = "strip.las: its 141540 points lie in a box of 1200 x 1200 cells of 0.05 m, more than the 566160 cells planned for them; \
                 convert it to a raster, or, if it is a [[dem]], set its `cell_m`";
    assert!(error.unusable_input() && error.to_string().ends_with(words), "{error}");
    let square = Geometry::square(60, 60, 1.0);
    for refused in [
        dem::read_as_claimed(&path).unwrap_err().to_string(),
        crate::mask::read(&path, &square).unwrap_err().to_string(),
        crate::mask::read_obstacles(&path, &square).unwrap_err().to_string(),
    ] {
        assert!(refused.ends_with(words), "{refused}");
    }
    for settings in [GridSettings::default(), limited(1_440_000), GridSettings { cell_m: Some(0.5), ..limited(1) }] {
        assert!(read(&path, &settings).is_ok(), "{settings:?}");
    }
    std::fs::write(&path, plain(&ground(&places[..5]))).unwrap();
    assert_eq!(dem::claimed(&path, &ReadOptions::default()).unwrap().cells, 1024);
}

/// The size claimed by a header, without decoding: (19.95 / 0.5 + 1) (14.95 / 0.5 + 1) cells of 0.5 m, or 4 cells for every point.
#[test]
fn val_claims_of_a_cloud() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.laz");
    std::fs::write(&path, file(&many(), header(1, 0), true)).unwrap();
    let sized = dem::claimed(&path, &ReadOptions { cell_m: Some([0.5; 2]) }).unwrap();
    assert_eq!((sized.points, sized.cells, sized.cell_m, sized.geometry), (120_000, 1263, Some(0.5), None));
    let unsized_claim = dem::claimed(&path, &ReadOptions::default()).unwrap();
    assert_eq!((unsized_claim.points, unsized_claim.cells, unsized_claim.cell_m), (120_000, 480_000, None));
}

#[test]
fn val_clouds_are_read_like_rasters() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.las");
    std::fs::write(&path, plain(&ground(&[[100, 100, 1000], [2100, 100, 3000]]))).unwrap();
    let dem = dem::read_with(&path, &ReadOptions { cell_m: Some([1.0; 2]) }).unwrap();
    assert_eq!((dem.grid.cols(), dem.info.format.name(), dem.info.dtype), (3, "las", "int32"));
    let filling = GridSettings { fill_cells: 1, ..GridSettings::default() };
    let filled = dem::read_gridded(&path, &ReadOptions { cell_m: Some([1.0; 2]) }, &filling).unwrap();
    assert_eq!(filled.grid.values, [1.0, 2.0, 3.0]);
    for words in ["gridded 2 points into 2 of 3 cells (", "filled 1 gap cell, up to 1 cell from points"] {
        assert!(filled.info.notes.iter().any(|note| note.starts_with(words)), "{words}: {:?}", filled.info.notes);
    }
    let oblong = dem::read_with(&path, &ReadOptions { cell_m: Some([1.0, 2.0]) }).unwrap_err();
    assert!(oblong.to_string().contains("square") && !oblong.unusable_input());
    let written = dem::write(&path, &dem.grid, &Crs::default(), &WriteOptions::default()).unwrap_err();
    assert!(written.to_string().contains("not written"));
    let copy = folder.path().join("copy.tif");
    dem::write(&copy, &filled.grid, &filled.info.crs, &WriteOptions::default()).unwrap();
    assert_eq!(dem::read(&copy).unwrap().grid, filled.grid);
}

#[test]
fn val_settings_out_of_range_are_refused() {
    let bytes = plain(&ground(&[[0, 0, 0], [9000, 9000, 0]]));
    let wrong = [
        of(0.0, Statistic::Mean),
        of(f64::NAN, Statistic::Mean),
        of(1.0, Statistic::Percentile(101.0)),
        of(1.0, Statistic::Percentile(f64::NAN)),
        GridSettings { fill_cells: 101, ..GridSettings::default() },
    ];
    for settings in wrong {
        assert!(matches!(grid_bytes(&bytes, &settings), Err(DemError::Unfit { .. })), "{settings:?}");
    }
    let fine = grid_bytes(&bytes, &of(1e-4, Statistic::Mean)).unwrap_err().to_string();
    assert!(fine.contains("at most 268435456 cells"), "{fine}");
    for (cell_m, words) in [
        (1e-12, "covers 9 x 9 m, which is 9000000000000 x 9000000000001 cells of 1e-12 m"),
        (1e-300, "its points from [0, 0] to [9, 9] m are too far from the origin for cells of 1e-300 m"),
    ] {
        let error = grid_bytes(&bytes, &of(cell_m, Statistic::Mean)).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

fn with_record(record_id: u16, data: Vec<u8>, well_known_text: bool) -> Result<Gridded, DemError> {
    let mut builder = header(6, 0);
    builder.has_wkt_crs = well_known_text;
    builder.vlrs.push(Vlr { user_id: "LASF_Projection".to_owned(), record_id, description: String::new(), data });
    grid_bytes(&file(&ground(&[[0, 0, 0]]), builder, false), &of(1.0, Statistic::Mean))
}

fn keys(entries: &[[u16; 4]]) -> Vec<u8> {
    let head = [1, 1, 0, entries.len() as u16];
    head.iter().chain(entries.iter().flatten()).flat_map(|v| v.to_le_bytes()).collect()
}

const WKT1: &str = r#"COMPD_CS["NAD83 / UTM zone 11N + NAVD88 height (ftUS)",
    PROJCS["NAD83 / UTM zone 11N", GEOGCS["NAD83", DATUM["North_American_Datum_1983",
        SPHEROID["GRS 1980",6378137,298.257222101, AUTHORITY["EPSG","7019"]]], PRIMEM["Greenwich",0],
        UNIT["degree",0.0174532925199433], AUTHORITY["EPSG","4269"]],
        PROJECTION["Transverse_Mercator"], PARAMETER["central_meridian",-117], UNIT["metre",1, AUTHORITY["EPSG","9001"]],
        AXIS["Easting",EAST], AUTHORITY["EPSG","26911"]],
    VERT_CS["NAVD88 height (ftUS)", VERT_DATUM["North American Vertical Datum 1988",2005],
        UNIT["US survey foot",0.304800609601219], AXIS["Up",UP], AUTHORITY["EPSG","6360"]]]"#;

#[test]
fn val_reference_systems_are_found() {
    let found = |record, data, text| with_record(record, data, text).unwrap().dem.info;
    let text = found(2112, WKT1.as_bytes().to_vec(), true);
    assert_eq!(
        (text.crs.epsg, text.crs.name.as_str(), text.crs.geographic),
        (Some(26911), "NAD83 / UTM zone 11N", false)
    );
    assert!(text.notes.iter().any(|note| note.contains("heights are in the unit EPSG:9003")), "{:?}", text.notes);
    let newer = r#"PROJCRS["WGS 84 / UTM zone 33N",BASEGEOGCRS["WGS 84",ID["EPSG",4326]],CONVERSION["UTM zone 33N",METHOD["Transverse Mercator"]],CS[Cartesian,2],AXIS["(E)",east,ORDER[1],LENGTHUNIT["metre",1]],ID["EPSG",32633]]"#;
    assert_eq!(found(2112, newer.as_bytes().to_vec(), true).crs.epsg, Some(32633));
    let feet = keys(&[[1024, 0, 1, 1], [3072, 0, 1, 2992], [3076, 0, 1, 9002]]);
    let feet = found(34735, feet, false);
    assert_eq!(feet.crs.epsg, Some(2992));
    assert!(feet.notes.iter().any(|note| note.contains("EPSG:9002")));
    let none = grid_bytes(&plain(&ground(&[[0, 0, 0]])), &of(1.0, Statistic::Mean)).unwrap().dem.info;
    assert!(none.crs == Crs::default() && none.notes.iter().any(|note| note.contains("names no reference system")));
}

#[test]
fn val_degrees_are_refused() {
    let degrees = keys(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]]);
    let error = with_record(34735, degrees, false).unwrap_err().to_string();
    assert!(error.contains("degrees of longitude and latitude (EPSG:4326)"), "{error}");
    let text = br#"GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0]]"#;
    assert!(with_record(2112, text.to_vec(), true).unwrap_err().to_string().contains("degrees"));
}

proptest! {
    /// Damaged well-known text yields some system or none, never a panic.
    #[test]
    fn prop_damaged_text_never_panics(cut in 0..WKT1.len(), at in 0..WKT1.len(), with in "[\\[\\](),\"a\u{e9}]{0,3}") {
        let mut text: String = WKT1.chars().take(cut.max(1)).collect();
        let at = at.min(text.len());
        text.insert_str(at, &with);
        let _ = crs::of_text(&text);
        let _ = crs::of_text(&"A[".repeat(cut));
    }
}

fn patched(bytes: &[u8], at: usize, with: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + with.len()].copy_from_slice(with);
    bytes
}

/// Headers that claim more than the file can hold are refused before memory is allocated.
#[test]
fn val_impossible_claims_are_refused() {
    let las = plain(&ground(&[[0, 0, 0], [5, 5, 5]]));
    assert!(refusal(&patched(&las, 107, &u32::MAX.to_le_bytes())).contains("claims 4294967295 points"));
    let long = patched(&patched(&las, 107, &[0; 4]), 247, &u64::MAX.to_le_bytes());
    assert!(refusal(&long).contains("claims 18446744073709551615 points"));
    assert!(refusal(&patched(&patched(&las, 107, &[0; 4]), 247, &[0; 8])).contains("has no points"));
    assert!(refusal(&las[..las.len() - 1]).contains("at most 1"));
    assert!(refusal(&las[..100]).contains("bytes"));
    assert!(refusal(&patched(&las, 131, &f64::NAN.to_le_bytes())).contains("scale"));
    assert!(refusal(&patched(&las, 139, &0f64.to_le_bytes())).contains("scale"));
    assert!(refusal(&patched(&las, 163, &f64::INFINITY.to_le_bytes())).contains("offset"));
    assert!(refusal(&patched(&las, 131, &1e300f64.to_le_bytes())).contains("too far"));
    assert!(refusal(&patched(&las, 25, &[9])).contains("LAS 1.9"));
    assert!(refusal(&patched(&las, 104, &[11])).contains("point format 11"));
    assert!(refusal(&patched(&las, 105, &[20, 0])).contains("20 bytes"));
    assert!(refusal(&patched(&las, 100, &u32::MAX.to_le_bytes())).contains("4294967295 records"));
    assert!(refusal(&patched(&las, 96, &u32::MAX.to_le_bytes())).contains("4294967295"));
    let extended = patched(&patched(&las, 235, &300u64.to_le_bytes()), 243, &1u32.to_le_bytes());
    assert!(refusal(&patched(&extended, 320, &(1u64 << 40).to_le_bytes())).contains("extended record"));
    assert!(refusal(&patched(&extended, 235, &u64::MAX.to_le_bytes())).contains("extended records"));
    assert!(refusal(b"ply\nformat").contains("LASF"));
}

#[test]
fn val_impossible_claims_of_compressed_files_are_refused() {
    for format in [1u8, 6] {
        let laz = file(&many()[..1000], header(format, 0), true);
        let start = u32::from_le_bytes(laz[96..100].try_into().unwrap()) as usize;
        let table = u64::from_le_bytes(laz[start..start + 8].try_into().unwrap()) as usize;
        assert!(refusal(&patched(&laz, table + 4, &u32::MAX.to_le_bytes())).contains("4294967295 chunks"));
        assert!(refusal(&laz[..table]).contains("truncated"));
        assert!(refusal(&patched(&laz, 107, &u32::MAX.to_le_bytes())).contains("claims 4294967295 points"));
        // A point or two may be left in the last bytes; many more are not.
        let more = refusal(&patched(&patched(&laz, 107, &2000u32.to_le_bytes()), 247, &2000u64.to_le_bytes()));
        assert!(more.contains(if format == 6 { "its chunks hold 1000" } else { "truncated" }), "{more}");
        // The LASzip record: no fields, and a wrong size of the first one.
        let fields = 375 + 54 + 32;
        assert!(refusal(&patched(&laz, fields, &[0, 0])).contains("LASzip record"));
        assert!(refusal(&patched(&laz, fields + 4, &[255, 255])).contains("LASzip record"));
        assert!(refusal(&patched(&laz, 375 + 2, b"nobody")).contains("no LASzip record"));
        if format == 6 {
            let layer = start + 8 + 30 + 4;
            assert!(refusal(&patched(&laz, layer, &u32::MAX.to_le_bytes())).contains("damaged after 0 of"));
            // The decoder goes by the chunk size of the record, and then reads layers of any length after the last chunk: found by the fuzz
            // target `points`, 4 GB for a file of 2 kB.
            let size = 375 + 54 + 12;
            assert!(refusal(&patched(&laz, size, &1u32.to_le_bytes())).contains("its chunks hold 1"));
        }
    }
}

/// Runs of 0xff amid points with times: a decoder that recurses with each code would overflow its stack, which cannot be caught.
#[test]
fn val_endless_switches_are_refused() {
    let shots: Vec<Shot> = many().into_iter().cycle().take(40_000).collect();
    for format in [1, 3] {
        let laz = file(&shots, header(format, 0), true);
        let start = u32::from_le_bytes(laz[96..100].try_into().unwrap()) as usize;
        for (at, length) in [(3000, 20_000), (30_000, 40_000), (100, laz.len() - start - 4000)] {
            let refused = refusal(&patched(&laz, start + at, &vec![0xff; length]));
            assert!(refused.contains("damaged: times switch"), "{refused}");
        }
    }
    // Layers that are not used, such as times, are not decoded.
    for format in [6, 7] {
        let laz = file(&shots, header(format, 0), true);
        let start = u32::from_le_bytes(laz[96..100].try_into().unwrap()) as usize;
        let _ =
            grid_bytes(&patched(&laz, start + 100, &vec![0xff; laz.len() - start - 4000]), &of(1.0, Statistic::Mean));
    }
}

/// A point outside the box of the header, as after a flipped bit, would make the grid larger than what memory is planned for. Boxes that are
/// rounded by up to a cell, or too large, are accepted.
#[test]
fn val_points_outside_the_stated_box_are_refused() {
    let las = plain(&ground(&[[0, 0, 0], [5000, 4000, 0]]));
    let point = u32::from_le_bytes(las[96..100].try_into().unwrap()) as usize + 28;
    let far = refusal(&patched(&las, point + 3, &[1]));
    assert!(far.contains("its header states x from 0 to 5 m, but its points reach from 0 to 16782.2"), "{far}");
    let low = refusal(&patched(&las, point + 7, &[0xff]));
    assert!(low.contains("its header states y from 0 to 4 m, but its points reach from -16773.2"), "{low}");
    // Highest x, lowest x, highest y, lowest y.
    for (at, accepted, refused, axis) in
        [(179, 4.1, 3.9, "x"), (187, 0.9, 1.1, "x"), (195, 3.1, 2.9, "y"), (203, 0.9, 1.1, "y")]
    {
        let stated = |value: f64| patched(&las, at, &value.to_le_bytes());
        assert!(grid_bytes(&stated(accepted), &of(1.0, Statistic::Mean)).is_ok(), "{at}");
        assert!(refusal(&stated(refused)).contains(&format!("its header states {axis} from")), "{at}");
    }
    let large = patched(&patched(&las, 179, &1e6f64.to_le_bytes()), 187, &(-1e6f64).to_le_bytes());
    assert!(grid_bytes(&large, &of(1.0, Statistic::Mean)).is_ok());
    // Without a given cell size as well.
    let scattered = plain(&many());
    let point = u32::from_le_bytes(scattered[96..100].try_into().unwrap()) as usize;
    let far = grid_bytes(&patched(&scattered, point + 3, &[1]), &GridSettings::default()).unwrap_err();
    assert!(far.unusable_input() && far.to_string().contains("its header states x from"), "{far}");
}

/// A small file of each kind, to be damaged.
fn samples() -> &'static [Vec<u8>] {
    static SAMPLES: std::sync::OnceLock<Vec<Vec<u8>>> = std::sync::OnceLock::new();
    SAMPLES.get_or_init(|| {
        let shots = &many()[..500];
        vec![
            file(shots, header(1, 0), false),
            file(shots, header(3, 2), true),
            file(shots, header(6, 0), true),
            file(shots, header(8, 3), true),
        ]
    })
}

#[test]
fn prop_truncated_files_are_refused() {
    for bytes in samples() {
        for length in (0..bytes.len()).step_by(7) {
            assert!(grid_bytes(&bytes[..length], &of(1.0, Statistic::Mean)).is_err(), "{length} of {}", bytes.len());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn prop_damaged_files_never_panic(which in 0usize..4, at in any::<prop::sample::Index>(), bytes in prop::collection::vec(any::<u8>(), 1..6)) {
        let file = &samples()[which];
        let at = at.index(file.len());
        let end = (at + bytes.len()).min(file.len());
        let damaged = patched(file, at, &bytes[..end - at]);
        let settings = GridSettings { fill_cells: 1, ..GridSettings::default() };
        // What is read in spite of the damage is a grid with points.
        if let Ok(gridded) = grid_bytes(&damaged, &settings) {
            let held = gridded.counts.values.iter().filter(|n| **n > 0).count();
            prop_assert!((1..=held + gridded.filled).contains(&gridded.dem.grid.finite_count()));
        }
    }

    #[test]
    fn prop_damaged_headers_never_panic(which in 0usize..4, at in 0usize..600, bytes in prop::collection::vec(any::<u8>(), 1..9)) {
        let file = &samples()[which];
        let damaged = patched(file, at, &bytes);
        let _ = grid_bytes(&damaged, &GridSettings::default());
    }
}
