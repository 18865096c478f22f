//! Rendered pictures of planetary and elaborated terrains.

use super::made_up::{self, Shelf};
use super::{assert_sound, report, rows};
use crate::data::Data;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::tables::TerrainRow;

/// Planetary worlds of one group and elaborated ones of another, 32 x 32 cells of 0.5 m.
fn planets(planetary: usize, elaborate: usize) -> Data {
    let (mut data, mut shelf) = (made_up::empty(), Shelf::default());
    for (kind, n) in [("elaborate", elaborate), ("planetary", planetary)] {
        for k in 0..n {
            let g = Geometry::square(32, 32, 0.5);
            let id = format!("{kind}-{k:04}");
            let height = |c: usize| 0.2 * libm::sin((g.x(c % 32) + k as f64) * 1.3) * libm::cos(g.y(c / 32));
            let grid = Grid::new(g, (0..g.len()).map(height).collect());
            let path = format!("terrain/{id}.tif");
            let row = made_up::row(&id, "terrain", &path, &grid);
            data.terrains.push(TerrainRow { kind: kind.into(), rms_slope: 0.1 + 0.001 * k as f64, ..row });
            if kind == "planetary" {
                shelf.grids.insert(format!("terrain/{id}.albedo.tif"), grid.map(|z| 0.25 + 0.1 * z));
            }
            shelf.grids.insert(path, grid);
        }
    }
    data.files = Box::new(shelf);
    data
}

/// Every terrain has a picture: a large one for the terrain with the median slope of each group, thumbnails for the others, each with its row of numbers.
#[test]
fn val_every_planetary_terrain_is_rendered() {
    let (files, summary) = report(&planets(6, 3));
    assert_sound(&files);
    let large: Vec<&String> = summary.figures.iter().filter(|f| f.starts_with("rendered-")).collect();
    assert_eq!(large, ["rendered-elaborate-0001", "rendered-planetary-0002"]);
    let sheets = [("elaborate", 2), ("planetary", 5)].map(|(kind, n)| {
        let found = rows(&files, &format!("thumbnails-{kind}-{kind}-0000"));
        assert_eq!(found.len(), n);
        assert!(found.iter().all(|row| row[1] == 32 && row[3] == 0.5), "{found:?}");
        let svg = &files[&format!("figures/thumbnails-{kind}-{kind}-0000.svg")];
        assert_eq!(svg.matches("<image").count(), n);
        found
    });
    let drawn = sheets.iter().flatten().filter_map(|row| row[0].as_str()).collect::<Vec<_>>();
    assert!(!drawn.contains(&"terrain/planetary-0002.tif") && drawn.contains(&"terrain/planetary-0005.tif"));
    let page = &files["index.html"];
    assert!(page.contains("5 terrains from above with mapped albedo and cast shadows, pixels of 0.500 m"));
    assert!(
        page.contains("2 terrains from above with uniform albedo")
            && page.contains("sun from 315 degrees (north-west), 25 degrees above the horizon")
    );
    assert!(!page.contains("are not rendered here") && !page.contains("would look blank"));
    assert!(page.contains("Rendered view, group planetary."));
}

/// Terrains that would look blank are not drawn; the page counts them by group.
#[test]
fn val_blank_terrains_are_counted() {
    let (mut data, mut shelf) = (planets(2, 2), Shelf::default());
    for terrain in &mut data.terrains {
        let grid = data.files.grid(&terrain.path).unwrap().unwrap();
        let flat = terrain.kind == "elaborate";
        shelf.grids.insert(terrain.path.clone(), if flat { grid.map(|_| 0.0) } else { grid });
    }
    data.files = Box::new(shelf);
    let (files, summary) = report(&data);
    assert_sound(&files);
    assert!(summary.figures.iter().all(|f| !f.starts_with("rendered-elaborate")), "{:?}", summary.figures);
    let words = "2 terrains would look blank, because the brightness in their pictures varies by less than 10 %: elaborate (2).";
    assert!(files["index.html"].contains(words));
}

/// A page has at most 96 thumbnails and states how many terrains it leaves out.
#[test]
fn val_thumbnails_are_bounded() {
    let (files, _) = report(&planets(100, 0));
    assert_eq!(rows(&files, "thumbnails-planetary-planetary-0000").len(), 96);
    assert!(files["index.html"].contains("3 of 100 planetary and elaborated terrains are not rendered here"));
}
