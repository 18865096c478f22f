//! Tile grids: a square of the plane, divided into tiles of 256 x 256 pixels whose side halves from level to level.
//!
//! Pixels are cells: pixel `(r, c)` of tile `(row, col)` is the sample at the centre of its cell, so the first lies half a pixel from the tile's
//! corner. Rows are counted from the north, levels from the coarsest.

use serde_json::{Value, json};

/// Pixels along the side of a tile.
pub const TILE: usize = 256;

/// A tile grid.
///
/// # Examples
/// ```
/// use sastrugi_server::grid::{TileGrid, TileIndex};
///
/// // 1000 m x 300 m with pixels of 4, 2 and 1 m.
/// let grid = TileGrid { origin_m: [0.0, 300.0], size_m: [1000.0, 300.0], finest_m: 1.0, levels: 3 };
/// assert_eq!([0, 1, 2].map(|level| grid.resolution_m(level)), [4.0, 2.0, 1.0]);
/// // Columns and rows of tiles of 256 pixels.
/// assert_eq!([0, 1, 2].map(|level| grid.matrix(level)), [[1, 1], [2, 1], [4, 2]]);
/// // North-west corner of a tile: rows count from the north.
/// assert_eq!(grid.corner_m(TileIndex { level: 2, row: 1, col: 3 }), [768.0, 44.0]);
/// assert_eq!(grid.level_of(2.5), 1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileGrid {
    /// North-west corner, m.
    pub origin_m: [f64; 2],
    /// East-west and north-south extent, m.
    pub size_m: [f64; 2],
    /// Pixel size at the finest level, m.
    pub finest_m: f64,
    /// Number of levels.
    pub levels: u32,
}

/// A tile of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TileIndex {
    /// Level; 0 is the coarsest.
    pub level: u32,
    /// Row, from the north.
    pub row: u32,
    /// Column, from the west.
    pub col: u32,
}

impl TileGrid {
    /// Pixel size, m.
    pub fn resolution_m(&self, level: u32) -> f64 {
        self.finest_m * (1u64 << (self.levels - 1 - level)) as f64
    }

    /// Columns and rows of tiles at a level.
    pub fn matrix(&self, level: u32) -> [u32; 2] {
        let side = self.resolution_m(level) * TILE as f64;
        self.size_m.map(|size| ((size / side - 1e-9).ceil() as u32).max(1))
    }

    /// Whether the grid contains this tile.
    pub fn has(&self, tile: TileIndex) -> bool {
        tile.level < self.levels && {
            let [cols, rows] = self.matrix(tile.level);
            tile.row < rows && tile.col < cols
        }
    }

    /// North-west corner of a tile, m.
    pub fn corner_m(&self, tile: TileIndex) -> [f64; 2] {
        let side = self.resolution_m(tile.level) * TILE as f64;
        [self.origin_m[0] + f64::from(tile.col) * side, self.origin_m[1] - f64::from(tile.row) * side]
    }

    /// The coarsest level with pixels of at most `resolution_m`; the finest level if there is none.
    pub fn level_of(&self, resolution_m: f64) -> u32 {
        let fits = |level: &u32| self.resolution_m(*level) <= resolution_m * (1.0 + 1e-9);
        (0..self.levels).find(fits).unwrap_or(self.levels - 1)
    }

    /// West, south, east and north edges, m.
    pub fn bounds_m(&self) -> [f64; 4] {
        let ([west, north], [across, up]) = (self.origin_m, self.size_m);
        [west, north - up, west + across, north]
    }

    /// Description for clients.
    pub fn describe(&self, id: &str) -> Value {
        let levels = 0..self.levels;
        json!({
            "id": id,
            "tile_size": TILE,
            "origin_m": self.origin_m,
            "levels": self.levels,
            "resolutions_m": levels.clone().map(|l| self.resolution_m(l)).collect::<Vec<_>>(),
            "matrix_sizes": levels.map(|l| self.matrix(l)).collect::<Vec<_>>(),
        })
    }
}

/// Level and tile for web-Mercator clients. They see the grid in a synthetic window: the zoom-8 tile north-east of (0, 0) is the tile of level 0.
///
/// # Examples
/// ```
/// use sastrugi_server::grid::{TileIndex, of_web_mercator};
///
/// assert_eq!(of_web_mercator(8, 128, 127), Some(TileIndex { level: 0, row: 0, col: 0 }));
/// // The south-east quarter of that tile.
/// assert_eq!(of_web_mercator(9, 257, 255), Some(TileIndex { level: 1, row: 1, col: 1 }));
/// assert_eq!(of_web_mercator(8, 127, 127), None);
/// ```
pub fn of_web_mercator(z: u32, x: u32, y: u32) -> Option<TileIndex> {
    let level = z.checked_sub(WINDOW_ZOOM)?;
    let first = |at: u32| at.checked_shl(level).filter(|v| v >> level == at);
    Some(TileIndex { level, row: y.checked_sub(first(WINDOW_TILE[1])?)?, col: x.checked_sub(first(WINDOW_TILE[0])?)? })
}

/// Zoom of the window tile.
pub const WINDOW_ZOOM: u32 = 8;
/// Column and row of the window tile.
pub const WINDOW_TILE: [u32; 2] = [128, 127];

#[cfg(test)]
mod tests {
    use super::*;

    fn plane() -> TileGrid {
        let side = 0.01 * 256.0 * 65536.0;
        TileGrid { origin_m: [-0.5 * side, 0.5 * side], size_m: [side; 2], finest_m: 0.01, levels: 17 }
    }

    #[test]
    fn val_the_square_of_a_world_has_the_stated_side() {
        let grid = plane();
        assert_eq!(grid.size_m[0], 167_772.16);
        assert_eq!(grid.resolution_m(0), 655.36);
        assert_eq!((grid.matrix(0), grid.matrix(16)), ([1, 1], [65536, 65536]));
        assert_eq!(grid.corner_m(TileIndex { level: 1, row: 1, col: 1 }), [0.0, 0.0]);
        assert_eq!(grid.level_of(0.01), 16);
        assert_eq!(grid.level_of(0.009), 16);
        assert_eq!(grid.level_of(1000.0), 0);
        assert!(
            !grid.has(TileIndex { level: 17, row: 0, col: 0 }) && !grid.has(TileIndex { level: 0, row: 1, col: 0 })
        );
    }

    /// Zoom 8 is level 0, zoom 24 the finest; there are no tiles outside the window.
    #[test]
    fn val_web_mercator_clients_see_the_square_in_one_tile() {
        assert_eq!(of_web_mercator(8, 128, 127), Some(TileIndex { level: 0, row: 0, col: 0 }));
        assert_eq!(of_web_mercator(9, 257, 255), Some(TileIndex { level: 1, row: 1, col: 1 }));
        assert_eq!(of_web_mercator(7, 64, 63), None);
        assert_eq!(of_web_mercator(9, 255, 255), None);
        assert_eq!(of_web_mercator(40, u32::MAX, u32::MAX), None);
    }

    /// 1000 m x 300 m with pixels of 4, 2 and 1 m, whose tiles are 1024, 512 and 256 m wide.
    #[test]
    fn val_tiles_of_an_oblong_grid() {
        let grid = TileGrid { origin_m: [100.0, 900.0], size_m: [1000.0, 300.0], finest_m: 1.0, levels: 3 };
        assert_eq!([0, 1, 2].map(|level| grid.matrix(level)), [[1, 1], [2, 1], [4, 2]]);
        assert_eq!(grid.corner_m(TileIndex { level: 2, row: 1, col: 3 }), [868.0, 644.0]);
        assert_eq!(grid.bounds_m(), [100.0, 600.0, 1100.0, 900.0]);
        assert_eq!([5.0, 4.0, 3.0, 2.0, 1.0, 0.5].map(|resolution_m| grid.level_of(resolution_m)), [0, 0, 1, 1, 2, 2]);
        assert!(grid.has(TileIndex { level: 2, row: 1, col: 3 }));
        assert!(!grid.has(TileIndex { level: 2, row: 2, col: 3 }) && !grid.has(TileIndex { level: 2, row: 1, col: 4 }));
        // A grid of whole tiles has no empty ones beyond its edge.
        assert_eq!(TileGrid { size_m: [512.0, 256.0], ..grid }.matrix(2), [2, 1]);
    }

    #[test]
    fn prop_web_mercator_tiles_are_those_of_the_grid() {
        for level in 0..=16u32 {
            let last = (1 << level) - 1;
            for (row, col) in [(0, 0), (last, 0), (0, last), (last / 3, last / 2)] {
                let (x, y) = ((WINDOW_TILE[0] << level) + col, (WINDOW_TILE[1] << level) + row);
                assert_eq!(of_web_mercator(WINDOW_ZOOM + level, x, y), Some(TileIndex { level, row, col }));
            }
        }
    }
}
