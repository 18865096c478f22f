//! `serve`: finds the worlds and rasters to serve in a file or a release.

use super::terrain::prepare;
use crate::error::Error;
use crate::loaded;
use crate::revision::Room;
use sastrugi_numeric::{Grid, Streams};
use sastrugi_schemas::manifest::Source;
use sastrugi_schemas::tables::TerrainRow;
use sastrugi_store::release::Release;
use sastrugi_terrain::elaborate::{self, Elaborate, Elaborated, RawElaborate};
use sastrugi_terrain::planetary::{self, Planetary, RawPlanetary, RawProcess};
use sastrugi_terrain::{Generator, Input, TerrainError, Windows};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Name of the heights in metres of a DEM in degrees.
const METRIC: &str = "metric";

/// A world, of which any patch can be generated.
#[derive(Clone)]
pub struct ServedWorld {
    /// Name of the file, or id of the item in its study.
    pub id: String,
    /// Its generator.
    pub surface: Surface,
    /// Its inputs.
    pub inputs: Vec<Input>,
    /// Its full parameters.
    pub parameters: Value,
    /// Its random streams.
    pub streams: Streams,
    /// Licence of its study, SPDX.
    pub license: Option<String>,
}

/// A generator for arbitrary windows.
#[derive(Clone)]
pub enum Surface {
    /// An unbounded world, with its inputs.
    Planetary(Box<Planetary>),
    /// A DEM with finer detail.
    Elaborate(Arc<Elaborated>),
}

impl ServedWorld {
    /// The ground with only the selected processes, by index from 0; the random draws of each process do not change.
    ///
    /// # Errors
    /// The raster of rock potential is missing.
    pub fn ground(&self, acts: impl Fn(usize) -> bool) -> Result<Arc<dyn Windows>, Error> {
        Ok(match &self.surface {
            Surface::Planetary(world) => Arc::new(world.world_of(&self.streams, acts)?),
            Surface::Elaborate(all) => Arc::new(all.selecting(&self.streams, acts)),
        })
    }

    /// Name of its generator.
    pub fn kind(&self) -> &'static str {
        match &self.surface {
            Surface::Planetary(_) => planetary::KIND,
            Surface::Elaborate(_) => elaborate::KIND,
        }
    }

    /// Basic spacing, m.
    pub fn spacing_m(&self) -> f64 {
        match &self.surface {
            Surface::Planetary(world) => world.spacing_m(),
            Surface::Elaborate(all) => all.spacing_m(),
        }
    }

    /// Position of lattice point 0, m.
    pub fn offset_m(&self) -> [f64; 2] {
        match &self.surface {
            Surface::Planetary(_) => [0.0; 2],
            Surface::Elaborate(all) => all.offset_m(),
        }
    }

    /// The window of its file: position of the south-west sample and sample spacing, m, and columns and rows.
    pub fn window(&self) -> ([f64; 2], f64, Option<[u32; 2]>) {
        match &self.surface {
            Surface::Planetary(world) => (world.raw().origin_m, world.raw().cell_m, world.raw().size_px),
            Surface::Elaborate(all) => (all.raw().origin_m, all.raw().cell_m, all.raw().size_px),
        }
    }

    /// Its processes.
    pub fn processes(&self) -> &[RawProcess] {
        match &self.surface {
            Surface::Planetary(world) => &world.raw().processes,
            Surface::Elaborate(all) => &all.raw().processes,
        }
    }

    /// The DEM that bounds it, if any.
    pub fn dem(&self) -> Option<&Grid> {
        match (&self.surface, self.inputs.first()) {
            (Surface::Elaborate(_), Some(Input::Grid(dem))) => Some(dem),
            _ => None,
        }
    }
}

/// A file of a release.
#[derive(Clone, Debug)]
pub struct SealedFile {
    /// Path.
    pub path: PathBuf,
    /// SHA-256 from the manifest.
    pub sha256: String,
}

/// Heights of a release, with the maps of the same cells.
#[derive(Clone, Debug)]
pub struct ServedRaster {
    /// Id of the terrain.
    pub id: String,
    /// `terrain`, `dem` or `texture`.
    pub stage: String,
    /// Lowest and highest height, m.
    pub height_range_m: [f64; 2],
    /// File of the heights.
    pub heights: SealedFile,
    /// Files of its maps by name, such as `class`.
    pub maps: BTreeMap<String, SealedFile>,
    /// Licence, SPDX: that of its measured data if there is any, else that of the release.
    pub license: String,
    /// Attribution.
    pub credit: Option<String>,
}

/// Contents of a file or folder that can be served.
#[derive(Clone)]
pub enum Served {
    /// Worlds of a file.
    Worlds(Vec<ServedWorld>),
    /// Heights of a release.
    Release(Box<Release>, Vec<ServedRaster>),
}

/// Finds what can be served: the `planetary` or `elaborate` surface of a terrain file, the `planetary` worlds of a study, or the heights of a release.
///
/// # Errors
/// A file that is none of these or invalid; one without anything to serve.
pub fn served(path: &Path) -> Result<Served, Error> {
    if path.is_dir() {
        let release = Release::open(path)?;
        let rasters = rasters(&release)?;
        return Ok(Served::Release(Box::new(release), rasters));
    }
    if !path.exists() {
        return Err(Error::Input(format!("{}: no such file or folder", path.display())));
    }
    if !path.to_string_lossy().to_ascii_lowercase().ends_with(".toml") {
        return Err(Error::Usage(format!(
            "{}: not a world or study (.toml) or a release folder; to serve a DEM, write a TOML file with `kind = \"{}\"` and `dem = \"...\"`",
            path.display(),
            elaborate::KIND
        )));
    }
    let text = loaded::read(path)?;
    let is_study = text.parse::<toml_edit::DocumentMut>().is_ok_and(|file| file.contains_key("study"));
    let worlds = if is_study { worlds_of_study(path, &text)? } else { vec![world_of_file(path)?] };
    if worlds.is_empty() {
        return Err(Error::Usage(format!(
            "{}: no [[terrain]] of kind `{}`; run the study and serve its release",
            path.display(),
            planetary::KIND
        )));
    }
    Ok(Served::Worlds(worlds))
}

/// The world of a terrain file: `kind`, `seed` and parameters, as read by the verb `terrain`.
fn world_of_file(path: &Path) -> Result<ServedWorld, Error> {
    let spec = path.display().to_string();
    let prepared = prepare(&spec, &[], None)?;
    let (parameters, inputs) = (prepared.parameters(), || prepared.inputs());
    let (surface, inputs) = match prepared.kind() {
        planetary::KIND => {
            let inputs = inputs()?;
            let world = world(&parameters)?.with_inputs(&inputs).map_err(unusable)?;
            (Surface::Planetary(Box::new(world)), inputs)
        }
        elaborate::KIND => {
            let raw: RawElaborate = sastrugi_schemas::kind::read_parameters(&parameters)?;
            let inputs = inputs()?;
            let all = Elaborate::try_from(raw)?.elaborated(&prepared.streams(), &inputs);
            (Surface::Elaborate(Arc::new(all.map_err(unusable)?)), inputs)
        }
        kind => {
            let (world, dem) = (planetary::KIND, elaborate::KIND);
            let message = format!("{spec}: `kind` is `{kind}`; only `{world}` and `{dem}` can be served");
            return Err(Error::Usage(message));
        }
    };
    let id = id_of(&path.file_stem().unwrap_or_default().to_string_lossy());
    Ok(ServedWorld { id, surface, inputs, parameters, streams: prepared.streams(), license: None })
}

fn unusable(error: TerrainError) -> Error {
    Error::Input(format!("failed to {error}"))
}

/// An id for URLs and studies from a file name: lower case, with `-` for all characters except letters, digits, `-` and `_`.
fn id_of(name: &str) -> String {
    let kept = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c.to_ascii_lowercase() } else { '-' };
    let id: String = name.chars().map(kept).collect();
    let id = id.trim_matches('-');
    if id.is_empty() { "world".to_owned() } else { id.to_owned() }
}

fn world(parameters: &Value) -> Result<Planetary, Error> {
    let raw: RawPlanetary = sastrugi_schemas::kind::read_parameters(parameters)?;
    Ok(Planetary::try_from(raw)?)
}

/// The worlds of a study, except those that depend on the map of another item and so need its files.
fn worlds_of_study(path: &Path, text: &str) -> Result<Vec<ServedWorld>, Error> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let loaded = loaded::load_text(text, &path.display().to_string(), folder)?;
    let license = Some(loaded.study.head.license.clone());
    let mut worlds = Vec::new();
    for (id, field) in &loaded.heightfields {
        if let (true, Some(streams)) = (field.kind == planetary::KIND, &field.streams) {
            let (world, parameters) = (world(&field.parameters)?, Value::clone(&field.parameters));
            if !world.inputs().is_empty() {
                continue;
            }
            worlds.push(ServedWorld {
                id: id.clone(),
                surface: Surface::Planetary(Box::new(world)),
                inputs: Vec::new(),
                parameters,
                streams: streams.clone(),
                license: license.clone(),
            });
        }
    }
    Ok(worlds)
}

/// A section `[[terrain]]` of a study; `head` contains the line of the id.
///
/// # Errors
/// Parameters that TOML cannot hold.
pub fn section(head: &str, seed: Option<u64>, kind: &str, parameters: &Value) -> Result<String, Error> {
    let mut text = format!("[[terrain]]\n{head}kind = \"{kind}\"\n");
    if let Some(seed) = seed {
        text.push_str(&format!("seed = {seed}\n"));
    }
    for (key, value) in parameters.as_object().into_iter().flatten().filter(|(_, v)| !v.is_null()) {
        text.push_str(&format!("{key} = {}\n", super::parameters::to_toml(value)?.to_string().trim()));
    }
    Ok(text)
}

/// Revision of everything that determines the samples of worlds and releases, for the entity tags of the server.
pub fn revision() -> String {
    crate::revision::revision(&[Room::Roughness, Room::Terrain, Room::Imaging])
}

/// The heights of a release: all rows of its table `terrains` whose file is in the manifest.
fn rasters(release: &Release) -> Result<Vec<ServedRaster>, Error> {
    let manifest = release.manifest();
    let rows: Vec<TerrainRow> = release.rows()?;
    let mut rasters = Vec::new();
    for row in rows {
        let (stage, id) = (row.stage.clone(), row.terrain_id.clone());
        let start = format!("{stage}/{id}.");
        let mut heights = None;
        let (mut maps, mut sources) = (BTreeMap::new(), Vec::new());
        for artifact in manifest.artifacts.iter().filter(|a| a.origin.stage == stage && a.origin.item == id) {
            let Some(name) = artifact.path.strip_prefix(&start) else { continue };
            let file = SealedFile { path: release.path(&artifact.path), sha256: artifact.sha256.clone() };
            match name.strip_suffix(".tif") {
                None if name == "tif" => heights = Some(file),
                Some(map) => drop(maps.insert(map.to_owned(), file)),
                None => continue,
            }
            sources.extend(artifact.origin.sources.iter().cloned());
        }
        // A DEM in degrees is analysed, and served, in metres.
        let Some(heights) = maps.remove(METRIC).or(heights) else { continue };
        let measured: Vec<&Source> = manifest.sources.iter().filter(|s| sources.contains(&s.id)).collect();
        let license = measured.iter().find_map(|s| s.license.clone()).unwrap_or_else(|| manifest.license.clone());
        let credit = measured.iter().find_map(|s| s.attribution.clone());
        let height_range_m = [row.height_min_m, row.height_max_m];
        rasters.push(ServedRaster { id, stage, height_range_m, heights, maps, license, credit });
    }
    Ok(rasters)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_ids_are_fit_for_addresses() {
        let table = [("planet", "planet"), ("Ünï World?#%2f", "n--world---2f"), ("..", "world"), ("a.b_c", "a-b_c")];
        for (name, id) in table {
            assert_eq!(id_of(name), id);
        }
    }
}
