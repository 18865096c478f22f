//! The collections that are served: worlds, whose patches are generated on demand, and the rasters of releases.

pub mod raster;
mod sealed;
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

/// A world or raster that is served.
pub struct Collection {
    /// Its id in URLs.
    pub id: String,
    /// Study, world file or release that it comes from, as given on the command line. Clients see its name, not its path.
    pub source: PathBuf,
    /// Source of its samples.
    pub ground: Ground,
    /// Missions and rovers of the release that it belongs to.
    pub drives: Option<Arc<Drives>>,
}

/// Source of samples.
pub enum Ground {
    /// Generated on demand.
    World(Arc<World>),
    /// Read from a release.
    Raster(Arc<Raster>),
}

/// All collections by id.
pub type Collections = BTreeMap<String, Arc<Collection>>;

impl Collection {
    /// Hash of everything its samples depend on.
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

    /// Its available fields.
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

    /// Default and finest sample spacing, m.
    pub fn spacings_m(&self) -> [f64; 2] {
        match &self.ground {
            Ground::World(world) => [world.cell_m(), world.spacing_m()],
            Ground::Raster(raster) => [raster.grid.finest_m; 2],
        }
    }

    /// Spacing of the samples that values are interpolated between when they are requested `step_m` apart: that of a lattice of a world, that of the
    /// file of a raster.
    pub fn between_m(&self, step_m: f64) -> f64 {
        match &self.ground {
            Ground::World(world) => world.lattice_m(step_m),
            Ground::Raster(raster) => raster.grid.finest_m,
        }
    }

    /// Description for clients.
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

    /// Display name.
    pub fn title(&self) -> &str {
        match &self.ground {
            Ground::World(_) => &self.id,
            Ground::Raster(raster) => &raster.files.id,
        }
    }

    /// Available layers of map tiles.
    pub fn layers(&self) -> Vec<&'static str> {
        let fields = self.fields();
        let has = |layer: &&Layer| layer.field().is_none_or(|field| fields.contains(&field));
        crate::layers::ALL.iter().filter(has).map(|l| l.name()).collect()
    }

    /// The layer with this name.
    ///
    /// # Errors
    /// A layer that the collection does not have.
    pub fn layer(&self, name: &str) -> Result<Layer, Problem> {
        let known = self.layers();
        Layer::of_name(name)
            .filter(|layer| known.contains(&layer.name()))
            .ok_or_else(|| Problem::not_found(format!("no such layer; \"{}\" has {}", self.id, known.join(", "))))
    }
}

/// Opens everything named on the command line.
///
/// # Errors
/// A file with nothing to serve, or two collections with the same id.
pub fn open(paths: &[PathBuf], raster_bytes: u64) -> Result<Collections, Error> {
    let (mut all, memory) = (Collections::new(), raster::Memory::new(raster_bytes));
    for path in paths {
        let found = match served(path)? {
            Served::Worlds(worlds) => worlds
                .into_iter()
                .map(|w| World::open(w).map(|w| (w.id().to_owned(), Ground::World(Arc::new(w)), None)))
                .collect::<Result<Vec<_>, _>>()?,
            Served::Release(release, rasters) => {
                let drives = Arc::new(Drives::open(*release));
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
                    "{}: \"{id}\" is already served from {}; rename one of them, or name the file only once",
                    path.display(),
                    other.source.display()
                )));
            }
            all.insert(id.clone(), Arc::new(Collection { id, source: path.clone(), ground, drives }));
        }
    }
    Ok(all)
}

/// Hash of a text that names everything samples depend on.
fn digest(what: &str) -> String {
    blake3::hash(what.as_bytes()).to_hex()[..32].to_owned()
}
