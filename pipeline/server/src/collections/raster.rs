//! The heights of a release, with the maps of the same cells: read when they are first asked for, thinned for coarse levels.

use crate::grid::{TILE, TileGrid, TileIndex};
use crate::http::Problem;
use crate::samples::Samples;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_stages::verbs::served::ServedRaster;
use sastrugi_store::dem::{self, Crs, ReadOptions};
use std::sync::{Arc, OnceLock};

/// Maps that are fields of a collection, and what they are called there.
const MAPS: [&str; 3] = ["albedo", "class", "rock-potential"];

/// The heights of a release.
pub struct Raster {
    /// Its files.
    pub files: ServedRaster,
    /// Shape and place.
    pub geometry: Geometry,
    /// Its tiles.
    pub grid: TileGrid,
    /// Coordinate reference system.
    pub crs: Crs,
    levels: OnceLock<Result<Arc<Vec<Level>>, String>>,
}

/// The samples of one level: those of the file, or means of 2 x 2 of the level below.
struct Level {
    geometry: Geometry,
    samples: Samples,
}

impl Raster {
    /// A raster whose header can be read.
    ///
    /// # Errors
    /// A sentence on what is wrong with the file.
    pub fn open(files: ServedRaster) -> Result<Self, String> {
        let reader = dem::open(&files.heights, &ReadOptions::default()).map_err(|e| e.to_string())?;
        let (geometry, crs) = (reader.geometry(), reader.info().crs.clone());
        let finest_m = geometry.cell[0].min(geometry.cell[1]);
        let size_m = geometry.size();
        let across = size_m[0].max(size_m[1]) / (finest_m * TILE as f64);
        let levels = (0..31).find(|l| across <= (1u64 << l) as f64 * (1.0 + 1e-9)).unwrap_or(31) + 1;
        let origin_m = [geometry.origin[0], geometry.origin[1] + size_m[1]];
        Ok(Self {
            files,
            geometry,
            grid: TileGrid { origin_m, size_m, finest_m, levels },
            crs,
            levels: OnceLock::new(),
        })
    }

    /// True where it has that map.
    pub fn has(&self, map: &str) -> bool {
        self.files.maps.contains_key(map)
    }

    /// Its levels, from the file's own to one of few samples. Reads the files when first called: not for the threads of the runtime.
    fn levels(&self) -> Result<Arc<Vec<Level>>, Problem> {
        self.levels.get_or_init(|| self.read().map(Arc::new)).clone().map_err(Problem::internal)
    }

    fn read(&self) -> Result<Vec<Level>, String> {
        let heights = dem::read(&self.files.heights).map_err(|e| e.to_string())?.grid;
        let map = |name: &str| -> Result<Option<Vec<f32>>, String> {
            let Some(file) = self.files.maps.get(name) else { return Ok(None) };
            let grid = dem::read(file).map_err(|e| e.to_string())?.grid;
            let same = (grid.rows(), grid.cols()) == (heights.rows(), heights.cols());
            if same {
                Ok(Some(single(&grid)))
            } else {
                Err(format!("{}: its cells are not those of the heights", file.display()))
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

    /// Samples at the places `(x0 + col step, y0 - row step)`, from cells about as wide as `step`.
    ///
    /// # Errors
    /// Files that cannot be read.
    pub fn samples(&self, [x0, y0]: [f64; 2], step_m: f64, shape: [usize; 2]) -> Result<Samples, Problem> {
        let levels = self.levels()?;
        let wanted = libm::log2(step_m / self.grid.finest_m * (1.0 + 1e-9)).floor().max(0.0) as usize;
        let level = &levels[wanted.min(levels.len() - 1)];
        Ok(level.at([x0, y0], step_m, shape))
    }

    /// The samples of a tile and one cell more on every side.
    ///
    /// # Errors
    /// Files that cannot be read.
    pub fn tile(&self, tile: TileIndex) -> Result<Samples, Problem> {
        let step_m = self.grid.resolution_m(tile.level);
        let [west, north] = self.grid.corner_m(tile);
        self.samples([west - 0.5 * step_m, north + 0.5 * step_m], step_m, [TILE + 2; 2])
    }
}

fn single(grid: &Grid) -> Vec<f32> {
    grid.values.iter().map(|v| *v as f32).collect()
}

impl Level {
    /// Means of 2 x 2 samples, of those with data.
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
        // From the north-west corner, where tiles begin.
        let north = self.geometry.origin[1] + self.geometry.size()[1];
        let origin = [self.geometry.origin[0], north - rows as f64 * cell[1]];
        Some(Self { geometry: Geometry { rows, cols, cell, origin }, samples })
    }

    /// Bilinear samples; within half a cell of the edge those of the edge, beyond it none.
    fn at(&self, [x0, y0]: [f64; 2], step_m: f64, [rows, cols]: [usize; 2]) -> Samples {
        let g = &self.geometry;
        let north = g.origin[1] + g.size()[1];
        let down = |r: usize| (north - (y0 - r as f64 * step_m)) / g.cell[1] - 0.5;
        let right = |c: usize| (x0 + c as f64 * step_m - g.origin[0]) / g.cell[0] - 0.5;
        // A place within rounding of a sample is that sample.
        let settle = |at: f64| if (at - at.round()).abs() < 1e-6 { at.round() } else { at };
        let inside = |at: f64, count: usize| at >= -0.5 - 1e-6 && at <= count as f64 - 0.5 + 1e-6;
        let clamp = |at: f64, count: usize| settle(at.clamp(0.0, (count - 1) as f64));
        let made = self.samples.between([rows, cols], |r, c| [clamp(down(r), g.rows), clamp(right(c), g.cols)]);
        let beyond = |k: usize| !(inside(down(k / cols), g.rows) && inside(right(k % cols), g.cols));
        made.without(beyond)
    }
}
