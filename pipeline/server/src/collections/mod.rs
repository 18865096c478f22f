//! What is served: worlds, of which any patch can be made, and the rasters of releases.

pub mod raster;
pub mod tracks;
pub mod world;

pub use raster::Raster;
use tracks::Drives;
pub use world::World;

use crate::grid::TileGrid;
use crate::http::Problem;
use crate::layers::Layer;
use sastrugi_stages::Error;
use sastrugi_stages::verbs::served::{Served, served};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// One thing that is served.
pub struct Collection {
    /// Its id in addresses.
    pub id: String,
    /// File or release that it comes from, as it was given. Clients learn its name, not where it lies.
    pub source: PathBuf,
    /// Its ground.
    pub ground: Ground,
    /// What was driven in the release that it stands in.
    pub drives: Option<Arc<Drives>>,
}

/// Where samples come from.
pub enum Ground {
    /// Made on demand.
    World(Arc<World>),
    /// Read from a release.
    Raster(Arc<Raster>),
}

/// Everything that is served, by id.
pub type Collections = BTreeMap<String, Arc<Collection>>;

impl Collection {
    /// Hash of all that its samples depend on.
    pub fn digest(&self) -> &str {
        match &self.ground {
            Ground::World(world) => &world.digest,
            Ground::Raster(raster) => &raster.digest,
        }
    }

    /// Its tile grid.
    pub fn grid(&self) -> &TileGrid {
        match &self.ground {
            Ground::World(world) => &world.grid,
            Ground::Raster(raster) => &raster.grid,
        }
    }

    /// Its fields.
    pub fn fields(&self) -> Vec<&'static str> {
        let [albedo, class, potential] = match &self.ground {
            Ground::World(w) => {
                let [albedo, rocks] = w.has();
                [albedo, rocks, rocks]
            }
            Ground::Raster(r) => [r.has("albedo"), r.has("class"), r.has("rock-potential")],
        };
        let fields =
            [("elevation", true), ("albedo", albedo), ("class", class), ("rock_potential", potential), ("image", true)];
        fields.into_iter().filter(|(_, there)| *there).map(|(name, _)| name).collect()
    }

    /// Distance of samples unasked, and the finest there is, m.
    pub fn spacings_m(&self) -> [f64; 2] {
        match &self.ground {
            Ground::World(world) => [world.cell_m(), world.spacing_m()],
            Ground::Raster(raster) => [raster.grid.finest_m; 2],
        }
    }

    /// What clients are told of it.
    pub fn describe(&self) -> Value {
        let [cell_m, spacing_m] = self.spacings_m();
        let mut all = json!({
            "id": self.id,
            "title": self.title(),
            "kind": match self.ground { Ground::World(_) => "world", Ground::Raster(_) => "raster" },
            "source": self.source.file_name().unwrap_or_default().to_string_lossy(),
            "release": self.drives.as_ref().map(|d| d.release.manifest().name.clone()),
            "bounds_m": self.grid().bounds_m(),
            "cell_m": cell_m,
            "spacing_m": spacing_m,
            "fields": self.fields(),
            "layers": self.layers(),
            "tile_grid": self.grid().describe(&self.id),
            "tracks": self.tracks(),
        });
        let more = match &self.ground {
            Ground::World(w) => json!({
                "home_m": w.home_m(), "phenomena": w.phenomena(), "height_range_m": w.height_range_m(),
                "license": w.license(), "credit": null,
            }),
            Ground::Raster(r) => json!({
                "home_m": self.grid().bounds_m(), "phenomena": [], "height_range_m": r.files.height_range_m,
                "license": r.files.license, "credit": r.files.credit,
            }),
        };
        if let (Value::Object(all), Value::Object(more)) = (&mut all, more) {
            all.extend(more);
        }
        all
    }

    /// A name for people.
    pub fn title(&self) -> &str {
        match &self.ground {
            Ground::World(_) => &self.id,
            Ground::Raster(raster) => &raster.files.id,
        }
    }

    /// The layers of its map tiles.
    pub fn layers(&self) -> Vec<&'static str> {
        let fields = self.fields();
        let has = |layer: &&Layer| layer.field().is_none_or(|field| fields.contains(&field));
        crate::layers::ALL.iter().filter(has).map(|l| l.name()).collect()
    }

    /// The layer of a name.
    ///
    /// # Errors
    /// One that it does not have.
    pub fn layer(&self, name: &str) -> Result<Layer, Problem> {
        let known = self.layers();
        Layer::of_name(name).filter(|layer| known.contains(&layer.name())).ok_or_else(|| {
            Problem::not_found(format!("\"{}\" has no such layer; it has {}", self.id, known.join(", ")))
        })
    }
}

/// Reads everything that was named on the command line.
///
/// # Errors
/// A file that has nothing to serve, or two things of one id.
pub fn open(paths: &[PathBuf], raster_bytes: u64) -> Result<Collections, Error> {
    let (mut all, memory) = (Collections::new(), raster::Memory::new(raster_bytes));
    for path in paths {
        let found = match served(path)? {
            Served::Worlds(worlds) => worlds
                .into_iter()
                .map(|w| World::open(w).map(|w| (w.id().to_owned(), Ground::World(Arc::new(w)), None)))
                .collect::<Result<Vec<_>, _>>()?,
            Served::Release(release, rasters) => {
                let drives = Arc::new(Drives::new(*release));
                let name = drives.release.manifest().name.clone();
                let open = |files| {
                    let raster = Raster::open(files, &memory).map_err(Error::Input)?;
                    let id = format!("{name}.{}", raster.files.id);
                    Ok((id, Ground::Raster(Arc::new(raster)), Some(Arc::clone(&drives))))
                };
                rasters.into_iter().map(open).collect::<Result<Vec<_>, Error>>()?
            }
        };
        for (id, ground, drives) in found {
            if let Some(other) = all.get(&id) {
                return Err(Error::Usage(format!(
                    "{}: \"{id}\" is served from {} already; rename one of them, or name the file once",
                    path.display(),
                    other.source.display()
                )));
            }
            all.insert(id.clone(), Arc::new(Collection { id, source: path.clone(), ground, drives }));
        }
    }
    Ok(all)
}

/// A short name for a text that says all that samples depend on.
fn digest(what: &str) -> String {
    blake3::hash(what.as_bytes()).to_hex()[..32].to_owned()
}
