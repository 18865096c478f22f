//! Ground of a world, generated on demand.
//!
//! Samples are generated in square tiles of 256 cells and kept in single precision, as in files: every point has the bits of a patch of the
//! complete surface. Tiles are shared by all users; the least recently used ones are evicted, which changes no value.
//! Memory: about 0.6 MB per tile.

use super::World;
use super::levels::{Window, spacing};
use super::params::{LATTICE_MAX, Lattice, Planetary};
use sastrugi_numeric::{Geometry, Grid, Ground, GroundGrid, GroundPoint, NoGround, Streams};
use sastrugi_schemas::ParameterError;
use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Cells along the side of a tile.
const TILE: i64 = 256;
/// Tiles that a view caches.
const AT_HAND: usize = 8;
/// Memory of a tile, bytes: 4 each for height and albedo, 1 for the class.
pub const BYTES_PER_TILE: u64 = 9 * ((TILE + 1) * (TILE + 1)) as u64;

/// A disk without rocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearing {
    /// Centre, m.
    pub centre_m: [f64; 2],
    /// Radius, m.
    pub radius_m: f64,
}

/// Column and row of a tile.
type Place = [i64; 2];
type Tile = Arc<OnceLock<GroundGrid>>;

/// Ground of a world, at every point.
pub struct WorldGround {
    world: World,
    zoom: u32,
    cell_m: f64,
    /// Maximum number of tiles kept.
    capacity: usize,
    tiles: Mutex<Tiles>,
}

#[derive(Default)]
struct Tiles {
    /// Tiles with the number of their last request.
    kept: HashMap<Place, (Tile, u64)>,
    requests: u64,
    made: u64,
}

impl Planetary {
    /// Ground of the world with samples `cell_m` apart, without the rocks that reach into clearings. Keeps at most `tiles` tiles.
    ///
    /// # Errors
    /// A sample spacing that is not the basic spacing times a power of 2, or an input that has not been read ([`Self::with_inputs`]).
    ///
    /// # Examples
    /// ```
    /// use sastrugi_numeric::{Ground, Streams};
    /// use sastrugi_terrain::planetary::{Planetary, RawPlanetary};
    /// use serde_json::json;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let raw: RawPlanetary = serde_json::from_value(json!({
    ///     "basic_spacing_m": 0.01, "processes": [{"kind": "base_slope", "gradient": [0.5, 0.0]}]
    /// }))?;
    /// let ground = Planetary::try_from(raw)?.ground(&Streams::for_seed(1, "terrain"), 0.02, &[], 4)?;
    /// let here = ground.view().at(1.23, -7.7)?;
    /// assert!((here.height_m - 0.5 * 1.23).abs() < 1e-6);
    /// assert_eq!(ground.tiles_made(), 1);
    /// # Ok(())
    /// # }
    /// ```
    pub fn ground(
        &self,
        streams: &Streams,
        cell_m: f64,
        clearings: &[Clearing],
        tiles: usize,
    ) -> Result<WorldGround, ParameterError> {
        self.check_inputs()?;
        let lattice = Lattice::check(Some(self.spacing_m), cell_m)?;
        let mut world = self.world(streams);
        if let Some((rocks, _)) = &mut world.rocks {
            let disk = |c: &Clearing| (c.centre_m.map(|at| at / self.spacing_m), c.radius_m / self.spacing_m);
            rocks.keep_out(clearings.iter().map(disk).collect());
        }
        let (zoom, cell_m) = (lattice.zoom, lattice.cell_m);
        Ok(WorldGround { world, zoom, cell_m, capacity: tiles.max(1), tiles: Mutex::default() })
    }
}

impl WorldGround {
    /// A view for one moving user: it caches the last few tiles.
    pub fn view(&self) -> View<'_> {
        View { ground: self, at_hand: RefCell::default() }
    }

    /// Number of tiles generated so far, counting evicted tiles again.
    pub fn tiles_made(&self) -> u64 {
        self.tiles.lock().unwrap_or_else(PoisonError::into_inner).made
    }

    fn tile(&self, place: Place) -> Tile {
        let tile = self.entry(place);
        let mut made = false;
        tile.get_or_init(|| {
            made = true;
            self.make(place)
        });
        if made {
            self.tiles.lock().unwrap_or_else(PoisonError::into_inner).made += 1;
        }
        tile
    }

    /// The entry of a tile, which may not have been generated yet; evicts the least recently used tile if necessary.
    fn entry(&self, place: Place) -> Tile {
        let mut tiles = self.tiles.lock().unwrap_or_else(PoisonError::into_inner);
        tiles.requests += 1;
        let now = tiles.requests;
        if let Some((tile, asked)) = tiles.kept.get_mut(&place) {
            *asked = now;
            return Arc::clone(tile);
        }
        if tiles.kept.len() >= self.capacity {
            let oldest = tiles.kept.iter().min_by_key(|(_, (_, asked))| *asked).map(|(place, _)| *place);
            oldest.and_then(|place| tiles.kept.remove(&place));
        }
        let tile = Tile::default();
        tiles.kept.insert(place, (Arc::clone(&tile), now));
        tile
    }

    /// A tile, in cells from its south-west sample, with the first column and row of its neighbours, so that heights in between can be
    /// interpolated.
    fn make(&self, [col, row]: Place) -> GroundGrid {
        let side = TILE as usize + 1;
        let window =
            Window { zoom: self.zoom, west: TILE * col, south: TILE * row, cols: side, rows: side, centred: false };
        let patch = self.world.patch(&window);
        let geometry = Geometry { origin: [-0.5; 2], ..Geometry::square(side, side, 1.0) };
        GroundGrid {
            heights: Grid::new(geometry, from_north(&patch.heights, side, |z| z as f32)),
            class: self.world.rocks.is_some().then(|| from_north(&patch.class, side, |c| c)),
            albedo: self.world.albedo.is_some().then(|| from_north(&patch.albedo, side, |a| a as f32)),
        }
    }
}

/// Rows from the south as rows from the north.
fn from_north<T: Copy, U>(values: &[T], cols: usize, of: impl Fn(T) -> U) -> Vec<U> {
    values.chunks_exact(cols).rev().flatten().map(|v| of(*v)).collect()
}

/// A view of the ground for one moving user.
pub struct View<'a> {
    ground: &'a WorldGround,
    /// The last used in front.
    at_hand: RefCell<Vec<(Place, Tile)>>,
}

impl View<'_> {
    /// The ground at a position in cells that lies in the tile.
    fn sample(&self, place: Place, position: [f64; 2]) -> Option<GroundPoint> {
        let mut at_hand = self.at_hand.borrow_mut();
        match at_hand.iter().position(|(known, _)| *known == place) {
            Some(0) => {}
            Some(k) => at_hand[..=k].rotate_right(1),
            None => {
                at_hand.truncate(AT_HAND - 1);
                at_hand.insert(0, (place, self.ground.tile(place)));
            }
        }
        let [x, y] = [0, 1].map(|axis| position[axis] - (TILE * place[axis]) as f64);
        at_hand[0].1.get().and_then(|tile| tile.sample(x, y))
    }
}

impl Ground for View<'_> {
    fn at(&self, x_m: f64, y_m: f64) -> Result<GroundPoint, NoGround> {
        let position = [x_m, y_m].map(|at| at / self.ground.cell_m);
        let end = LATTICE_MAX / spacing(self.ground.zoom) - TILE as f64;
        let known = position.iter().all(|p| p.abs() < end);
        let place = position.map(|p| (p.floor() as i64).div_euclid(TILE));
        known.then(|| self.sample(place, position)).flatten().ok_or(NoGround { x_m, y_m })
    }

    fn cell_m(&self) -> f64 {
        self.ground.cell_m
    }
}
