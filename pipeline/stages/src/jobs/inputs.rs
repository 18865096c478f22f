//! Inputs of generators in a study: surfaces of other items, their maps, and files.
//!
//! Files are copied into the release unchanged (stage [`INPUT_STAGE`]), one copy for all replicates of an item.

use super::original::{self, INPUT_STAGE, Original};
use super::terrain;
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield, InputPlace};
use crate::job::{ItemRef, JobError, Product, Work};
use crate::operations::inputs::{check_systems, kept, read};
use crate::study::Entry;
use sastrugi_numeric::Geometry;
use sastrugi_schemas::study::TerrainItem;
use sastrugi_store::dem::{self, Crs, Format, ReadOptions};
use sastrugi_store::{altimetry, atomic};
use sastrugi_terrain::{Generator, Holds, Input, MAPS, NamedInput};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Where an input comes from.
#[derive(Clone, Debug)]
pub struct Source {
    named: NamedInput,
    /// The item that produces or copies it.
    pub item: ItemRef,
    /// Its file in the item's folder.
    file: String,
    /// Path in the release, for messages about a file.
    release_path: Option<String>,
    /// Approximate memory for reading it, bytes.
    reading_bytes: u64,
    /// Shape and position of a raster, if known before the run.
    place: Option<Geometry>,
}

/// The inputs of a generator.
#[derive(Clone, Debug, Default)]
pub struct Sources(pub Vec<Source>);

/// Copies of an entry's files, by name.
pub type Copies = BTreeMap<String, (ItemRef, String)>;

impl Sources {
    /// Finds the inputs of a generator, and adds the items that copy files.
    ///
    /// # Errors
    /// An unknown name, a missing file, or a sweep over files.
    pub fn find(
        builder: &mut Builder<'_>,
        (entry, item): (&Entry<'_>, &TerrainItem),
        generator: &dyn Generator,
        copies: &mut Copies,
    ) -> Result<Self, BuildError> {
        let one = |named: NamedInput| match of_item(builder, entry, &named)? {
            Some(source) => Ok(source),
            None => of_file(builder, (entry, item), named, copies),
        };
        generator.inputs().into_iter().map(one).collect::<Result<_, _>>().map(Self)
    }

    /// Parameters in which file names are replaced by paths in the release.
    pub fn as_released(&self, params: &Value) -> Value {
        let mut params = params.clone();
        for source in &self.0 {
            let place = params.pointer_mut(&format!("/{}", source.named.key.replace('.', "/")));
            if let (Some(name), Some(path)) = (place, &source.release_path) {
                *name = Value::from(path.as_str());
            }
        }
        params
    }

    /// Approximate memory for reading them, bytes.
    pub fn reading_bytes(&self) -> u64 {
        self.0.iter().map(|s| s.reading_bytes).sum()
    }

    /// Shape and position of each input, if known before the run.
    pub fn places(&self) -> Vec<Option<Geometry>> {
        self.0.iter().map(|s| s.place).collect()
    }

    /// The inputs, and the coordinate system of the first.
    ///
    /// # Errors
    /// Files that cannot be read, or rasters in another coordinate system than the heights.
    pub fn read(&self, work: &Work<'_>) -> Result<(Vec<Input>, Crs), JobError> {
        let mut inputs = Vec::new();
        let mut crs = None;
        for source in &self.0 {
            let path = work.parent(&source.item, &source.file)?;
            let read = read(&source.named, &path).map_err(|e| source.with_release_path(e, &path))?;
            if let Some(own) = read.crs {
                check_systems(&source.named, crs.as_ref(), &own)?;
                crs.get_or_insert(own);
            }
            inputs.push(read.input);
        }
        Ok((inputs, crs.unwrap_or_default()))
    }

    /// Copies the files next to the heights, for ground that is generated on demand.
    ///
    /// # Errors
    /// A file cannot be read or written.
    pub fn keep(&self, work: &Work<'_>) -> Result<Vec<Product>, JobError> {
        let one = |(k, source): (usize, &Source)| {
            let from = work.parent(&source.item, &source.file)?;
            let name = format!("{}.{}", kept(k), original::extension(&source.file));
            let bytes = sastrugi_store::file::read(&from).map_err(|e| JobError::at(&from, e))?;
            atomic::write(&work.output(&name), &bytes).map_err(|e| JobError::at(&work.folder.0.join(&name), e))?;
            Ok(Product::internal(&name))
        };
        self.0.iter().enumerate().map(one).collect()
    }
}

impl Source {
    /// Messages are part of the release, so they use the file's path in the release.
    fn with_release_path(&self, error: JobError, path: &Path) -> JobError {
        match &self.release_path {
            Some(released) => error.reworded(|words| words.replace(&path.display().to_string(), released)),
            None => error,
        }
    }
}

/// The heights or a map of an earlier item; `None` if the name refers to neither.
fn of_item(builder: &Builder<'_>, entry: &Entry<'_>, named: &NamedInput) -> Result<Option<Source>, BuildError> {
    let source = |field: &Heightfield, file: String| Source {
        named: named.clone(),
        item: field.item.clone(),
        file,
        release_path: None,
        reading_bytes: field.heights_bytes(),
        place: field.expected,
    };
    match named.holds {
        Holds::Points => return Ok(None),
        Holds::Heights => {
            let field = builder.surface(entry, &named.key, &named.name)?;
            return Ok(Some(source(field, HEIGHTS.to_owned())));
        }
        Holds::Values => {}
    }
    if let Some(field) = builder.heightfields.get(&named.name) {
        return Ok(Some(source(field, HEIGHTS.to_owned())));
    }
    let map = named.name.rsplit_once('.').filter(|(_, map)| MAPS.iter().any(|known| known.name == *map));
    let Some((id, map)) = map else { return Ok(None) };
    let field = builder.surface(entry, &named.key, id)?;
    if field.item.stage != terrain::STAGE {
        let message = format!("`{}` names the map `{map}` of \"{id}\", which is not a [[terrain]]", named.key);
        return Err(entry.error(&named.key, message).into());
    }
    Ok(Some(source(field, format!("{map}.tif"))))
}

/// A file next to the study.
fn of_file(
    builder: &mut Builder<'_>,
    (entry, item): (&Entry<'_>, &TerrainItem),
    named: NamedInput,
    copies: &mut Copies,
) -> Result<Source, BuildError> {
    let path = builder.study.folder.join(&named.name);
    let is_raster = Format::of_name(&path).is_some() || path.is_file();
    if named.holds == Holds::Values && !is_raster {
        return Err(builder.no_surface(entry, &named.key, &named.name).into());
    }
    if item.sweep.contains_key(&named.key) {
        let message =
            format!("`{}` cannot sweep over files; sweep over ids of [[dem]], or write one item per file", named.key);
        return Err(entry.error("sweep", message).into());
    }
    let claimed = dem::claimed(&path, &ReadOptions::default()).filter(|_| named.holds != Holds::Points);
    // Rasters in degrees are refused when the file is read.
    let place = claimed.filter(|claimed| !claimed.geographic).and_then(|claimed| claimed.geometry);
    let (copy, release_path) = match copies.get(&named.name) {
        Some(known) => known.clone(),
        None => {
            let id = format!("{}-{}", item.id, copies.len() + 1);
            let copy = Original::of(&format!("input/{id}"), &builder.study.folder, &named.name)?;
            let release_path = copy.release_path().to_owned();
            let node = copy.node(INPUT_STAGE, &id);
            let made = (node.item.clone(), release_path);
            builder.node(node)?;
            copies.insert(named.name.clone(), made.clone());
            made
        }
    };
    let reading_bytes = match named.holds {
        Holds::Points => altimetry::reading_bytes(&path),
        Holds::Heights | Holds::Values => dem::reading_bytes(&path),
    };
    let reading_bytes = reading_bytes.map_err(|e| BuildError::reading(&path, e))?;
    let key = entry.path_of_dotted(&named.key);
    let stated = InputPlace { key, release_path: release_path.clone() };
    if !builder.inputs.contains(&stated) {
        builder.inputs.push(stated);
    }
    let file = original::name(&release_path).to_owned();
    Ok(Source { named, item: copy, file, release_path: Some(release_path), reading_bytes, place })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Study;

    /// Files count as memory before the run: a raster by its header, or by its bytes if the header cannot be read; points by their bytes.
    #[test]
    fn val_files_count_as_memory() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        let large = "ncols 8192\nnrows 8192\nxllcorner 0\nyllcorner 0\ncellsize 1\n1\n";
        write("large.asc", large);
        write("damaged.tif", &"damaged".repeat(100));
        write("laser.csv", "0 0 0\n1 0 0\n");
        let text =
            "[study]\nname = \"a\"\nseed = 1\ndate = \"2026-01-01\"\n[[terrain]]\nid = \"a\"\nkind = \"planetary\"\n";
        let (study, errors) = Study::read(text, folder.path(), &["terrain"]).unwrap();
        let entry = study.entries("terrain").unwrap().remove(0);
        let (item, _): (TerrainItem, Value) = entry.read().unwrap();
        let (mut builder, mut copies) = (Builder::new(&study, errors), Copies::new());
        let mut needed = |name: &str, holds: Holds| {
            let named = NamedInput { key: "potential".to_owned(), name: name.to_owned(), holds };
            of_file(&mut builder, (&entry, &item), named, &mut copies).unwrap().reading_bytes
        };
        assert_eq!(needed("large.asc", Holds::Values), (16 << 26) + 2 * large.len() as u64);
        assert_eq!(needed("damaged.tif", Holds::Values), 18 * 700);
        assert_eq!(needed("laser.csv", Holds::Points), 12 * 12);
    }
}
