//! The heights of a release, with the maps on the same cells. Files are read and checked against their checksums on first use, and kept in memory
//! while there is room.
//!
//! Points and patches are interpolated between the cells of the file, at any sample spacing; map tiles of coarse levels are drawn from means of
//! cells.

use super::sealed;
use crate::grid::{TILE, TileGrid, TileIndex};
use crate::http::Problem;
use crate::library::undivided;
use crate::samples::Samples;
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_stages::verbs::served::{SealedFile, ServedRaster};
use sastrugi_store::dem::{self, Crs, ReadOptions};
use std::sync::Arc;

/// Maps of a release that become fields of the collection, by their names in the release.
const MAPS: [&str; 3] = ["albedo", "class", "rock-potential"];

/// A raster of heights of a release.
pub struct Raster {
    /// Its files.
    pub files: ServedRaster,
    /// Shape and position.
    pub geometry: Geometry,
    /// Its tile grid.
    pub grid: TileGrid,
    /// Coordinate reference system.
    pub crs: Crs,
    /// Hash of its files and of the program's revision.
    pub digest: String,
    memory: Arc<Memory>,
}

/// Cache of rasters.
pub struct Memory(Cache<String, Arc<Pyramid>, Bytes>);

#[derive(Clone)]
struct Bytes;

impl Weighter<String, Arc<Pyramid>> for Bytes {
    fn weight(&self, _: &String, pyramid: &Arc<Pyramid>) -> u64 {
        pyramid.iter().map(|level| level.samples.bytes()).sum()
    }
}

impl Memory {
    /// A cache of that many bytes.
    pub fn new(bytes: u64) -> Arc<Self> {
        Arc::new(Self(undivided(64, bytes, Bytes)))
    }
}

/// The levels of a raster, from that of the file to one of at most 2 x 2 samples.
pub type Pyramid = Vec<Level>;

/// The samples of one level: those of the file, or means of 2 x 2 samples of the next finer level.
pub struct Level {
    geometry: Geometry,
    samples: Samples,
}

impl Raster {
    /// Opens a raster by reading its header.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn open(files: ServedRaster, memory: &Arc<Memory>) -> Result<Self, String> {
        let reader = dem::open(&files.heights.path, &ReadOptions::default()).map_err(|e| e.to_string())?;
        let (geometry, crs) = (reader.geometry(), reader.info().crs.clone());
        let finest_m = geometry.cell[0].min(geometry.cell[1]);
        let size_m = geometry.size();
        let across = size_m[0].max(size_m[1]) / (finest_m * TILE as f64);
        let levels = (0..31).find(|l| across <= (1u64 << l) as f64 * (1.0 + 1e-9)).unwrap_or(31) + 1;
        let origin_m = [geometry.origin[0], geometry.origin[1] + size_m[1]];
        let grid = TileGrid { origin_m, size_m, finest_m, levels };
        let sums = std::iter::once(&files.heights).chain(files.maps.values()).map(|file| file.sha256.as_str());
        let digest = super::digest(&format!("{} {}", crate::revision(), sums.collect::<Vec<_>>().join(",")));
        Ok(Self { files, geometry, grid, crs, digest, memory: Arc::clone(memory) })
    }

    /// Whether it has this map.
    pub fn has(&self, map: &str) -> bool {
        self.files.maps.contains_key(map)
    }

    /// Its levels, from memory or from `read`. Concurrent requests share one read.
    ///
    /// # Errors
    /// Those of `read`.
    pub async fn levels(
        &self,
        read: impl Future<Output = Result<Arc<Pyramid>, Problem>>,
    ) -> Result<Arc<Pyramid>, Problem> {
        self.memory.0.get_or_insert_async(&self.digest, read).await
    }

    /// Reads its levels from its files.
    ///
    /// # Errors
    /// Files that are unreadable, or changed since the release was sealed.
    pub fn read(&self) -> Result<Arc<Pyramid>, Problem> {
        self.pyramid().map(Arc::new).map_err(Problem::internal)
    }

    fn pyramid(&self) -> Result<Pyramid, String> {
        let heights = read(&self.files.heights)?;
        let map = |name: &str| -> Result<Option<Vec<f32>>, String> {
            let Some(file) = self.files.maps.get(name) else { return Ok(None) };
            let grid = read(file)?;
            let same = (grid.rows(), grid.cols()) == (heights.rows(), heights.cols());
            if same {
                Ok(Some(single(&grid)))
            } else {
                Err(format!("{}: its grid differs from that of the heights", sealed::name(&file.path)))
            }
        };
        let [albedo, rock, rock_potential] = MAPS.map(map);
        let (rows, cols) = (heights.rows(), heights.cols());
        let samples = Samples {
            rows,
            cols,
            heights: single(&heights),
            albedo: albedo?,
            rock: rock?,
            rock_potential: rock_potential?,
        };
        let mut levels = vec![Level { geometry: heights.geometry, samples }];
        while let Some(next) = levels.last().and_then(Level::halved) {
            levels.push(next);
        }
        Ok(levels)
    }

    /// Samples at the positions `(x0 + col step, y0 - row step)`, bilinear between the cells of the file, which is the first level.
    pub fn samples(&self, levels: &Pyramid, [x0, y0]: [f64; 2], step_m: f64, shape: [usize; 2]) -> Samples {
        levels[0].at(&self.geometry, [x0, y0], step_m, shape)
    }

    /// Samples of a tile with a margin of one on every side, from means of cells about as wide as a pixel.
    pub fn tile(&self, levels: &Pyramid, tile: TileIndex) -> Samples {
        let step_m = self.grid.resolution_m(tile.level);
        let [west, north] = self.grid.corner_m(tile);
        let level = (self.grid.levels - 1 - tile.level) as usize;
        let level = &levels[level.min(levels.len() - 1)];
        level.at(&self.geometry, [west - 0.5 * step_m, north + 0.5 * step_m], step_m, [TILE + 2; 2])
    }
}

/// Values of a file after checking that it has not changed since its release was sealed.
fn read(file: &SealedFile) -> Result<Grid, String> {
    sealed::check(file)?;
    Ok(dem::read(&file.path).map_err(|e| sealed::unreadable(&file.path, &e))?.grid)
}

fn single(grid: &Grid) -> Vec<f32> {
    grid.values.iter().map(|v| *v as f32).collect()
}

impl Level {
    /// Means of the samples with data in blocks of 2 x 2.
    fn halved(&self) -> Option<Self> {
        let s = &self.samples;
        if s.rows.max(s.cols) <= 2 {
            return None;
        }
        let (rows, cols) = (s.rows.div_ceil(2), s.cols.div_ceil(2));
        let of = |values: &[f32]| -> Vec<f32> {
            let mean = |k: usize| {
                let (row, col) = (2 * (k / cols), 2 * (k % cols));
                let (mut sum, mut count) = (0.0, 0.0);
                for r in row..(row + 2).min(s.rows) {
                    for v in &values[r * s.cols + col..r * s.cols + (col + 2).min(s.cols)] {
                        if v.is_finite() {
                            sum += f64::from(*v);
                            count += 1.0;
                        }
                    }
                }
                (sum / count) as f32
            };
            (0..rows * cols).map(mean).collect()
        };
        let samples = Samples {
            rows,
            cols,
            heights: of(&s.heights),
            albedo: s.albedo.as_deref().map(&of),
            rock: s.rock.as_deref().map(&of),
            rock_potential: s.rock_potential.as_deref().map(&of),
        };
        let cell = self.geometry.cell.map(|c| 2.0 * c);
        // Aligned with the north-west corner, where tiles begin.
        let north = self.geometry.origin[1] + self.geometry.size()[1];
        let origin = [self.geometry.origin[0], north - rows as f64 * cell[1]];
        Some(Self { geometry: Geometry { rows, cols, cell, origin }, samples })
    }

    /// Bilinear samples. Within half a cell of the edge they take the value of the edge; outside the file's cells, `whole`, there is no data.
    fn at(&self, whole: &Geometry, [x0, y0]: [f64; 2], step_m: f64, [rows, cols]: [usize; 2]) -> Samples {
        let (x, y) = (|c: usize| x0 + c as f64 * step_m, |r: usize| y0 - r as f64 * step_m);
        let g = &self.geometry;
        let down = |r: usize| (g.origin[1] + g.size()[1] - y(r)) / g.cell[1] - 0.5;
        let right = |c: usize| (x(c) - g.origin[0]) / g.cell[0] - 0.5;
        // A position within rounding of a sample is that sample.
        let settle = |at: f64| if (at - at.round()).abs() < 1e-6 { at.round() } else { at };
        let clamp = |at: f64, count: usize| settle(at.clamp(0.0, (count - 1) as f64));
        let down: Vec<f64> = (0..rows).map(|r| clamp(down(r), g.rows)).collect();
        let right: Vec<f64> = (0..cols).map(|c| clamp(right(c), g.cols)).collect();
        let made = self.samples.between(&down, &right);
        let inside = |at: f64, axis: usize| {
            let from = (at - whole.origin[axis]) / whole.cell[axis];
            (-1e-6..=whole.size()[axis] / whole.cell[axis] + 1e-6).contains(&from)
        };
        let (cols_in, rows_in): (Vec<bool>, Vec<bool>) =
            ((0..cols).map(|c| inside(x(c), 0)).collect(), (0..rows).map(|r| inside(y(r), 1)).collect());
        if cols_in.iter().chain(&rows_in).all(|is_in| *is_in) {
            return made;
        }
        made.without(|k| !(rows_in[k / cols] && cols_in[k % cols]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level([rows, cols]: [usize; 2], heights: Vec<f32>) -> Level {
        let geometry = Geometry { rows, cols, cell: [1.0, 2.0], origin: [10.0, 20.0] };
        Level { geometry, samples: Samples { heights, ..Samples::empty(rows, cols) } }
    }

    /// Blocks count from the north-west; those at the edges have fewer samples, and holes do not count.
    #[test]
    fn val_halved_levels_are_means_of_what_there_is() {
        let halved = level([3, 3], (0..9).map(|k| k as f32).collect()).halved().unwrap();
        assert_eq!(halved.samples.heights, [2.0, 3.5, 6.5, 8.0]);
        // Cells of 2 m x 4 m; the north edge, at 26 m, stays.
        assert_eq!(halved.geometry, Geometry { rows: 2, cols: 2, cell: [2.0, 4.0], origin: [10.0, 18.0] });
        let mut heights: Vec<f32> = (0..9).map(|k| k as f32).collect();
        (heights[0], heights[8]) = (f32::NAN, f32::NAN);
        let halved = level([3, 3], heights).halved().unwrap().samples.heights;
        assert!((halved[0] - 8.0 / 3.0).abs() < 1e-6 && halved[3].is_nan(), "{halved:?}");
        assert!(level([2, 2], vec![0.0; 4]).halved().is_none());
        assert!(level([1, 3], vec![0.0; 3]).halved().is_some());
    }

    /// Heights that are eastings: bilinear between centres of cells, level within half a cell of the edge, and none outside.
    #[test]
    fn val_samples_between_cells_are_bilinear() {
        let of_x = level([2, 4], [10.5, 11.5, 12.5, 13.5].repeat(2));
        let whole = of_x.geometry;
        let at = |x: f64, y: f64| of_x.at(&whole, [x, y], 0.25, [1, 1]).heights[0];
        assert_eq!([at(10.5, 22.0), at(11.0, 22.0), at(12.75, 21.3)], [10.5, 11.0, 12.75]);
        assert_eq!([at(10.0, 22.0), at(10.2, 20.0), at(14.0, 24.0)], [10.5, 10.5, 13.5]);
        for (x, y) in [(9.9, 22.0), (14.1, 22.0), (12.0, 19.9), (12.0, 24.1)] {
            assert!(at(x, y).is_nan(), "{x} {y}");
        }
        // Southward by rows, eastward by columns.
        let of_y = level([2, 2], vec![23.0, 23.0, 21.0, 21.0]);
        let made = of_y.at(&of_y.geometry, [10.5, 23.0], 1.0, [3, 2]);
        assert_eq!(made.heights, [23.0, 23.0, 22.0, 22.0, 21.0, 21.0]);
    }
}
