//! Tile grids: a square of the plane, cut into tiles of 256 x 256 pixels, whose side halves from level to level.
//!
//! Pixels are cells: pixel `(r, c)` of the tile in `(row, col)` is the sample in the middle of its cell, half a pixel from the corner of the tile.
//! Rows are counted from the north, levels from the coarsest.

use serde_json::{Value, json};

/// Pixels along the side of a tile.
pub const TILE: usize = 256;

/// A tile grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileGrid {
    /// North-west corner, m.
    pub origin_m: [f64; 2],
    /// Size of what is covered east-west and north-south, m.
    pub size_m: [f64; 2],
    /// Side of a pixel of the finest level, m.
    pub finest_m: f64,
    /// Number of levels.
    pub levels: u32,
}

/// A tile of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TileIndex {
    /// Level, 0 the coarsest.
    pub level: u32,
    /// Row, from the north.
    pub row: u32,
    /// Column, from the west.
    pub col: u32,
}

impl TileGrid {
    /// Side of a pixel, m.
    pub fn resolution_m(&self, level: u32) -> f64 {
        self.finest_m * (1u64 << (self.levels - 1 - level)) as f64
    }

    /// Columns and rows of tiles.
    pub fn matrix(&self, level: u32) -> [u32; 2] {
        let side = self.resolution_m(level) * TILE as f64;
        self.size_m.map(|size| ((size / side - 1e-9).ceil() as u32).max(1))
    }

    /// Whether the grid has that tile.
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

    /// The coarsest level whose pixels are at most that wide; the finest where none is.
    pub fn level_of(&self, resolution_m: f64) -> u32 {
        let fits = |level: &u32| self.resolution_m(*level) <= resolution_m * (1.0 + 1e-9);
        (0..self.levels).find(fits).unwrap_or(self.levels - 1)
    }

    /// West, south, east and north edge, m.
    pub fn bounds_m(&self) -> [f64; 4] {
        let ([west, north], [across, up]) = (self.origin_m, self.size_m);
        [west, north - up, west + across, north]
    }

    /// For clients.
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

/// The level and tile of the synthetic window of web-Mercator clients: the tile of zoom 8 north-east of (0, 0) is the tile of level 0.
pub fn of_web_mercator(z: u32, x: u32, y: u32) -> Option<TileIndex> {
    let level = z.checked_sub(WINDOW_ZOOM)?;
    let first = |at: u32| at.checked_shl(level).filter(|v| v >> level == at);
    Some(TileIndex { level, row: y.checked_sub(first(WINDOW_TILE[1])?)?, col: x.checked_sub(first(WINDOW_TILE[0])?)? })
}

/// Zoom of the window's one tile.
pub const WINDOW_ZOOM: u32 = 8;
/// Column and row of that tile.
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

    /// Zoom 8 is level 0, zoom 24 the finest; beyond the window there is nothing.
    #[test]
    fn val_web_mercator_clients_see_the_square_in_one_tile() {
        assert_eq!(of_web_mercator(8, 128, 127), Some(TileIndex { level: 0, row: 0, col: 0 }));
        assert_eq!(of_web_mercator(9, 257, 255), Some(TileIndex { level: 1, row: 1, col: 1 }));
        assert_eq!(of_web_mercator(7, 64, 63), None);
        assert_eq!(of_web_mercator(9, 255, 255), None);
        assert_eq!(of_web_mercator(40, u32::MAX, u32::MAX), None);
    }
}
