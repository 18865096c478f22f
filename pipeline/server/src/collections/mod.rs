//! What is served: worlds, of which any patch can be made, and the rasters of releases.

pub mod raster;
pub mod tracks;
pub mod world;

pub use raster::Raster;
pub use world::World;

use crate::grid::TileGrid;
use sastrugi_stages::Error;
use sastrugi_stages::verbs::served::{Served, served};
use sastrugi_store::release::Release;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// One thing that is served.
pub struct Collection {
    /// Its id in addresses.
    pub id: String,
    /// File or release that it comes from, as it was given.
    pub source: String,
    /// Its ground.
    pub ground: Ground,
    /// The release that it stands in.
    pub release: Option<Arc<Release>>,
    /// Hash of all that its samples depend on.
    pub digest: String,
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
            Ground::World(w) => [w.has("albedo"), w.has("rocks"), w.has("rocks")],
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
            "source": self.source,
            "release": self.release.as_ref().map(|r| r.manifest().name.clone()),
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
        let has = |layer: &&crate::layers::Layer| layer.field().is_none_or(|field| fields.contains(&field));
        crate::layers::ALL.iter().filter(has).map(|l| l.name()).collect()
    }
}

/// Reads everything that was named on the command line.
///
/// # Errors
/// A file that has nothing to serve, or two things of one id.
pub fn open(paths: &[PathBuf]) -> Result<Collections, Error> {
    let mut all = Collections::new();
    for path in paths {
        let source = path.display().to_string();
        let found = match served(path)? {
            Served::Worlds(worlds) => worlds
                .into_iter()
                .map(|w| World::open(w).map(|w| (w.id().to_owned(), Ground::World(Arc::new(w)), None)))
                .collect::<Result<Vec<_>, _>>()?,
            Served::Release(release, rasters) => {
                let release = Arc::new(*release);
                let name = release.manifest().name.clone();
                let open = |files| {
                    let raster = Raster::open(files).map_err(Error::Input)?;
                    let id = format!("{name}.{}", raster.files.id);
                    Ok((id, Ground::Raster(Arc::new(raster)), Some(Arc::clone(&release))))
                };
                rasters.into_iter().map(open).collect::<Result<Vec<_>, Error>>()?
            }
        };
        for (id, ground, release) in found {
            if let Some(other) = all.get(&id) {
                return Err(Error::Usage(format!(
                    "{source}: \"{id}\" is served from {} already; give one of the two another name",
                    other.source
                )));
            }
            let digest = digest(&ground);
            all.insert(id.clone(), Arc::new(Collection { id, source: source.clone(), ground, release, digest }));
        }
    }
    Ok(all)
}

/// Hash of all that samples depend on: parameters, streams and sources of the generator, or the files.
fn digest(ground: &Ground) -> String {
    let what = match ground {
        Ground::World(world) => world.identity(),
        Ground::Raster(raster) => format!("{} {}", crate::revision(), raster.files.content),
    };
    blake3::hash(what.as_bytes()).to_hex()[..32].to_owned()
}
