use super::polygons::{inside, oracle};
use super::*;
use crate::dem::{Crs, WriteOptions};
use crate::geojson::documents::documents;
use crate::geojson::polygons::Polygon;
use proptest::prelude::*;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::fs;

fn mask_of(name: &str, bytes: &[u8], geometry: &Geometry, options: &MaskOptions) -> Result<Vec<bool>, MaskError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    read_with(&path, geometry, options)
}

fn of_text(text: &str, geometry: &Geometry) -> Result<Vec<bool>, String> {
    mask_of("mask.geojson", text.as_bytes(), geometry, &MaskOptions::default()).map_err(|e| e.to_string())
}

fn polygon_text(rings: &str) -> String {
    format!("{{\"type\": \"Polygon\", \"coordinates\": [{rings}]}}")
}

fn count(cells: &[bool]) -> usize {
    cells.iter().filter(|kept| **kept).count()
}

/// A rectangle: centres on its western and southern sides are inside, those on the other sides are not.
fn square(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    vec![vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]]
}

/// A lake with an island and a MultiPolygon that reaches beyond the grid, as `rasterio.features.rasterize` (GDAL) marks
/// the cells whose centres it finds inside: their number, and the SHA-256 of one byte per cell.
#[test]
fn val_cells_agree_with_an_independent_reader() {
    let expected: serde_json::Value = serde_json::from_str(include_str!("island.json")).unwrap();
    let grid = &expected["grid"];
    let (number, pair) =
        (|v: &serde_json::Value| v.as_f64().unwrap(), |v: &serde_json::Value| [v[0].clone(), v[1].clone()]);
    let geometry = Geometry {
        rows: number(&grid["rows"]) as usize,
        cols: number(&grid["cols"]) as usize,
        cell: pair(&grid["cell"]).map(|v| number(&v)),
        origin: pair(&grid["origin"]).map(|v| number(&v)),
    };
    let keep = of_text(&expected["mask"].to_string(), &geometry).unwrap();
    assert_eq!(count(&keep) as u64, expected["kept"].as_u64().unwrap());
    let bytes: Vec<u8> = keep.iter().map(|&kept| u8::from(kept)).collect();
    let sha256: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(sha256, expected["sha256"].as_str().unwrap());
}

#[test]
fn val_polygons_that_share_an_edge_share_no_cell() {
    let g = Geometry::square(4, 6, 1.0);
    // The common edge runs through the centres of column 2.
    let (west, east) = (square(0.0, 0.5, 2.5, 3.5), square(2.5, 0.5, 6.0, 3.5));
    let [a, b] = [west.clone(), east.clone()].map(|p| inside(&[p], &g));
    assert!(a.iter().zip(&b).all(|(a, b)| !(a & b)));
    assert_eq!((count(&a), count(&b)), (2 * 3, 4 * 3));
    assert_eq!(count(&inside(&[west, east], &g)), 6 * 3);
}

#[test]
fn val_holes_and_islands_in_holes() {
    let g = Geometry::square(9, 9, 1.0);
    let rings = |sides: &[(f64, f64)]| sides.iter().flat_map(|&(low, high)| square(low, low, high, high)).collect();
    let island: Polygon = rings(&[(0.0, 9.0), (2.0, 7.0), (4.0, 5.0)]);
    let cells = inside(std::slice::from_ref(&island), &g);
    assert_eq!(count(&cells), 81 - 25 + 1);
    assert!(cells[4 * 9 + 4] && !cells[3 * 9 + 4] && cells[9 + 1]);
    // The direction of a ring does not matter, and a ring need not be closed.
    let turned: Polygon = island.iter().map(|ring| ring.iter().rev().skip(1).copied().collect()).collect();
    assert_eq!(inside(&[turned], &g), cells);
    // A polygon in the hole of another is a union, not a difference.
    assert_eq!(count(&inside(&[rings(&[(0.0, 9.0), (2.0, 7.0)]), square(3.0, 3.0, 4.0, 4.0)], &g)), 81 - 25 + 1);
}

/// A cut from the outer ring into a hole and back: both passes cross every ray, and cancel.
#[test]
fn val_antiparallel_edges_cancel() {
    let g = Geometry::square(10, 10, 0.5);
    let cut: Polygon = vec![vec![
        [0.25, 0.25],
        [4.75, 0.25],
        [4.75, 4.75],
        [0.25, 4.75],
        [0.25, 0.25], // round
        [1.25, 1.25],
        [1.25, 3.75],
        [3.75, 3.75],
        [3.75, 1.25],
        [1.25, 1.25], // round the hole, by the same cut
        [0.25, 0.25],
    ]];
    let mut holed = square(0.25, 0.25, 4.75, 4.75);
    holed.extend(square(1.25, 1.25, 3.75, 3.75));
    assert_eq!(inside(&[cut], &g), inside(&[holed], &g));
}

#[test]
fn val_every_kind_of_geojson() {
    let g = Geometry::square(4, 4, 1.0);
    let polygon = polygon_text("[[0, 0], [2, 0], [2, 2], [0, 2], [0, 0]]");
    let expected = of_text(&polygon, &g).unwrap();
    assert_eq!(
        expected.iter().map(|k| u8::from(*k)).collect::<Vec<_>>(),
        [0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0]
    );
    let feature = format!("{{\"type\": \"Feature\", \"properties\": null, \"geometry\": {polygon}}}");
    let nowhere = "{\"type\": \"Feature\", \"properties\": {}, \"geometry\": null}";
    let multi =
        "{\"type\": \"MultiPolygon\", \"coordinates\": [[[[0, 0, 9], [2, 0, 9], [2, 2, 9], [0, 2, 9], [0, 0, 9]]]]}";
    for text in [
        feature.clone(),
        multi.to_owned(),
        format!("\u{feff}\n{{\"type\": \"FeatureCollection\", \"features\": [{nowhere}, {feature}]}}"),
    ] {
        assert_eq!(of_text(&text, &g).unwrap(), expected, "{text}");
    }
    let inverted = mask_of("m.json", polygon.as_bytes(), &g, &MaskOptions { invert: true }).unwrap();
    assert!(inverted.iter().zip(&expected).all(|(a, b)| a != b));
}

#[test]
fn val_unusable_masks_are_refused() {
    let g = Geometry::square(4, 4, 1.0);
    let far = polygon_text("[[50, 50], [60, 50], [60, 60], [50, 50]]");
    let all = polygon_text("[[-1, -1], [9, -1], [9, 9], [-1, 9], [-1, -1]]");
    let refused = [
        ("{", "not GeoJSON"),
        ("{\"a\": 1}", "has no \"type\""),
        ("{\"type\": \"Topology\"}", "contains a Topology"),
        (
            "{\"type\": \"Point\", \"coordinates\": [1, 2]}",
            "contains a Point; only Polygon and MultiPolygon are supported",
        ),
        ("{\"type\": \"FeatureCollection\"}", "\"features\" is missing"),
        ("{\"type\": \"FeatureCollection\", \"features\": []}", "contains no polygons"),
        ("{\"type\": \"Polygon\", \"coordinates\": 3}", "\"coordinates\" is missing or not a list"),
        (&polygon_text("[[0, 0], [1, 1]]"), "has 2 corners"),
        (&polygon_text("[[0, 0], [1, \"a\"], [2, 2]]"), "not a list of [x, y] positions"),
        (&far, "keeps none of the DEM's cells (x 0 to 4, y 0 to 4)"),
    ];
    for (text, words) in refused {
        let message = of_text(text, &g).unwrap_err();
        assert!(message.contains(words) && message.contains("mask.geojson"), "{text}: {message}");
    }
    let none = mask_of("m.json", all.as_bytes(), &g, &MaskOptions { invert: true }).unwrap_err();
    assert!(none.unusable_input() && none.to_string().contains("keeps none"), "{none}");
    let missing = read(Path::new("nothing.geojson"), &g).unwrap_err();
    assert!(missing.unusable_input() && missing.to_string().contains("no such file"), "{missing}");
    let text = mask_of("mask.txt", b"keep the west", &g, &MaskOptions::default()).unwrap_err();
    assert!(text.unusable_input() && text.to_string().contains("not a supported raster"), "{text}");
}

/// A georeferenced raster: each cell of the DEM takes the mask cell under its centre; beyond the mask nothing is kept.
#[test]
fn val_a_georeferenced_raster_is_sampled_at_each_centre() {
    let folder = tempfile::tempdir().unwrap();
    let marks = Geometry { rows: 2, cols: 2, cell: [2.0, 1.5], origin: [101.0, 50.0] };
    let grid = Grid::new(marks, vec![1.0, 0.0, f64::NAN, -3.0]);
    let dem = Geometry { rows: 4, cols: 6, cell: [1.0; 2], origin: [100.0, 49.5] };
    for name in ["mask.tif", "mask.asc"] {
        if name == "mask.asc" && marks.cell[0] != marks.cell[1] {
            let square = Grid::new(Geometry { cell: [1.5; 2], ..marks }, grid.values.clone());
            dem::write(&folder.path().join(name), &square, &Crs::default(), &WriteOptions::default()).unwrap();
        } else {
            dem::write(&folder.path().join(name), &grid, &Crs::default(), &WriteOptions::default()).unwrap();
        }
        let path = folder.path().join(name);
        let marks = dem::read(&path).unwrap().grid;
        let keep = read(&path, &dem).unwrap();
        for row in 0..dem.rows {
            for col in 0..dem.cols {
                let (x, y) = (dem.x(col), dem.y(row));
                let (west, south) = (marks.geometry.origin[0], marks.geometry.origin[1]);
                let [wide, high] = marks.geometry.cell;
                let (i, j) = ((x - west) / wide, 2.0 - (y - south) / high);
                let outside = i < 0.0 || j < 0.0 || i >= 2.0 || j >= 2.0;
                let expected = !outside && [[true, false], [false, true]][j as usize][i as usize];
                assert_eq!(keep[row * dem.cols + col], expected, "{name} at {x}, {y}");
            }
        }
    }
}

#[test]
fn val_a_raster_without_georeferencing_is_applied_cell_by_cell() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mask.npy");
    let marks = Grid::new(Geometry::square(2, 3, 1.0), vec![1.0, 0.0, f64::NAN, 0.0, 2.0, 0.5]);
    dem::write(&path, &marks, &Crs::default(), &WriteOptions::default()).unwrap();
    let far = Geometry { rows: 2, cols: 3, cell: [10.0, 20.0], origin: [5e5, 6e6] };
    assert_eq!(read(&path, &far).unwrap(), [true, false, false, false, true, true]);
    let error = read(&path, &Geometry::square(3, 2, 1.0)).unwrap_err();
    let words = "has no georeferencing, so it must have the DEM's 3 x 2 cells; it has 2 x 3";
    assert!(error.unusable_input() && error.to_string().contains(words), "{error}");
}

/// Rings with many positions on cell centres, and many edges along rows and columns of centres.
fn rings() -> impl Strategy<Value = Polygon> {
    let position = (-4i32..44, -4i32..44).prop_map(|(i, j)| [f64::from(i) * 0.25, f64::from(j) * 0.25]);
    prop::collection::vec(prop::collection::vec(position, 3..9), 1..4)
}

/// Memory for reading a mask is known before: two numbers in a list of four for each position of a text, with the place of that list and the
/// position itself, and at most three times as much; 16 bytes for each cell that a header states, or for each byte without one.
#[test]
fn val_memory_for_reading_is_known_before() {
    let folder = tempfile::tempdir().unwrap();
    let needed = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        reading_bytes(&path).unwrap()
    };
    let ring = |corners: usize| polygon_text(&format!("[{}[0,1]]", "[0,1],".repeat(corners - 1)));
    let more = needed("large.geojson", &ring(3000)) - needed("small.geojson", &ring(1000));
    let least = 2000 * (5 * size_of::<serde_json::Value>() as u64 + 16);
    assert!((least..3 * least).contains(&more), "{more} {least}");
    let grid = "ncols 4096\nnrows 2048\nxllcorner 0\nyllcorner 0\ncellsize 1\n1\n";
    assert_eq!(needed("a.asc", grid), 16 * 4096 * 2048 + 2 * grid.len() as u64);
    assert_eq!(needed("a.tif", &"damaged".repeat(100)), 18 * 700);
    assert!(reading_bytes(&folder.path().join("none.tif")).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// The row sweep agrees with the definition at every point, also for self-crossing rings and empty spikes.
    #[test]
    fn prop_cells_are_those_of_the_definition(
        polygons in prop::collection::vec(rings(), 1..3),
        shift in prop::sample::select(vec![[0.0, 0.0], [0.125, 0.0], [0.1, 0.3], [3.0, -2.0]]),
        cell in prop::sample::select(vec![[0.5, 0.5], [0.25, 1.0], [0.3, 0.7]]),
    ) {
        let g = Geometry { rows: 18, cols: 21, cell, origin: shift };
        let cells = inside(&polygons, &g);
        for row in 0..g.rows {
            for col in 0..g.cols {
                let expected = polygons.iter().any(|p| oracle::contains(p, g.x(col), g.y(row)));
                prop_assert_eq!(cells[row * g.cols + col], expected, "at {}, {}", g.x(col), g.y(row));
            }
        }
    }

    /// The triangles of a fan cover their polygon exactly once, also where centres lie on their edges.
    #[test]
    fn prop_parts_add_up(x in -2i32..26, y in -2i32..26) {
        let g = Geometry::square(12, 12, 1.0);
        let corners = [[0.5, 0.5], [11.5, 0.5], [11.5, 11.5], [0.5, 11.5]];
        let middle = [f64::from(x.clamp(1, 23)) * 0.5, f64::from(y.clamp(1, 23)) * 0.5];
        let fan: Vec<Vec<bool>> =
            (0..4).map(|k| inside(&[vec![vec![corners[k], corners[(k + 1) % 4], middle]]], &g)).collect();
        let times: BTreeSet<usize> = (0..g.len())
            .map(|cell| {
                let within = g.x(cell % 12) < 11.5 && g.y(cell / 12) < 11.5;
                fan.iter().filter(|part| part[cell]).count() + usize::from(!within)
            })
            .collect();
        prop_assert_eq!(times, BTreeSet::from([1]));
    }

    /// A mask keeps the cells whose centres are inside its polygons, or says that there are none; a damaged one is refused with the
    /// reason.
    #[test]
    fn prop_documents_are_masks_or_refused_with_the_reason(document in documents()) {
        let g = Geometry { rows: 15, cols: 12, cell: [2e5, 1.6e5], origin: [-1.2e6; 2] };
        let within = |polygons: &[Polygon], k: usize| {
            polygons.iter().any(|p| oracle::contains(p, g.x(k % g.cols), g.y(k / g.cols)))
        };
        match (of_text(&document.text, &g), &document.expected) {
            (Ok(keep), Ok(polygons)) => {
                let expected: Vec<bool> = (0..g.len()).map(|k| within(polygons, k)).collect();
                prop_assert_eq!(keep, expected);
            }
            (Err(message), Ok(polygons)) => {
                prop_assert!(message.contains("keeps none of the DEM's cells"), "{}", message);
                prop_assert!((0..g.len()).all(|k| !within(polygons, k)));
            }
            (Err(message), Err(words)) => prop_assert!(message.contains(words), "{}", message),
            (Ok(_), Err(words)) => prop_assert!(false, "not refused: {}", words),
        }
    }
}
