//! Stage `terrain`: generates one terrain.

use super::exports::Exports;
use super::inputs::{Copies, Sources};
use super::rasters::{SECONDS_PER_WRITTEN_CELL, raster_options, raster_packing};
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield, common};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work, parsed};
use crate::operations::terrains::{generate, values_of, write_png16};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::entry::Expanded;
use crate::study::{Entry, StudyError};
use sastrugi_numeric::{Grid, Streams};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::study::{GeoTiff, TerrainItem};
use sastrugi_store::dem::simulators::has_mesh;
use sastrugi_store::dem::{self, Crs, WriteOptions};
use sastrugi_store::{digest, geojson};
use sastrugi_terrain::{Generator, Line, planetary};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "terrain";
/// The trails of a terrain, for missions along them.
const LINES: &str = "lines.json";
/// The same trails, for the release.
const TRAILS: &str = "trails.geojson";

struct TerrainJob {
    id: String,
    made: Arc<Made>,
    streams: Streams,
}

/// What the replicates of a terrain share.
struct Made {
    /// Their id without the number of the replicate.
    part: Arc<str>,
    generator: Box<dyn Generator>,
    /// Its parameters in full.
    parameters: Arc<Value>,
    /// The recipe, as JSON text.
    recipe: String,
    /// Inputs of the generator.
    inputs: Sources,
    png16: bool,
    exports: Exports,
    geotiff: GeoTiff,
}

impl Made {
    fn of(
        builder: &mut Builder<'_>,
        (entry, item): (&Entry<'_>, &TerrainItem),
        one: &Expanded,
        copies: &mut Copies,
    ) -> Result<Self, BuildError> {
        let generator = sastrugi_terrain::prepare(&item.kind, &one.params).map_err(|e| entry.refuse(e))?;
        let inputs = Sources::find(builder, (entry, item), generator.as_ref(), copies)?;
        generator.check_places(&inputs.places()).map_err(|e| entry.refuse(e))?;
        // Parameters use the paths of files in the release instead of their present ones.
        let released = inputs.as_released(&one.params);
        let generator = sastrugi_terrain::prepare(&item.kind, &released).map_err(|e| entry.refuse(e))?;
        let exports = Exports::new(&item.exports, &generator.geometry()).map_err(|e| entry.error("exports", e))?;
        let parameters = generator.parameters();
        Ok(Self {
            part: Arc::clone(&one.part),
            recipe: json!({ "kind": generator.kind(), "params": parameters }).to_string(),
            parameters: Arc::new(parameters),
            generator,
            inputs,
            png16: item.png16,
            exports: exports.decimated(item.export_max_error_m),
            geotiff: builder.study.head.geotiff,
        })
    }
}

/// Adds the items of `[[terrain]]`.
///
/// # Errors
/// An invalid item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    builder.each(STAGE, add_table)
}

fn add_table(builder: &mut Builder<'_>, entry: &Entry<'_>) -> Result<(), BuildError> {
    let kinds = sastrugi_terrain::kinds();
    let (item, params): (TerrainItem, Value) = entry.read()?;
    if let Some(kind) = kinds.iter().find(|k| k.kind == item.kind) {
        entry.check_keys::<TerrainItem>(&params, &kind.parameters)?;
    }
    check_decimation(entry, &item)?;
    let expanded = entry.expand(&item.id, item.count, &item.sweep, &params)?;
    name_families(builder, entry, &item.id, &expanded)?;
    let mut copies = Copies::new();
    let mut made: Option<Arc<Made>> = None;
    for one in expanded {
        builder.claim(entry, STAGE, &one.id)?;
        let made = match made.take().filter(|made| made.part == one.part) {
            Some(known) => made.insert(known),
            None => made.insert(Arc::new(Made::of(builder, (entry, &item), &one, &mut copies)?)),
        };
        add_one(builder, &item, made, one)?;
    }
    Ok(())
}

/// Adds one replicate.
fn add_one(builder: &mut Builder<'_>, item: &TerrainItem, made: &Arc<Made>, one: Expanded) -> Result<(), BuildError> {
    let shared = builder.is_paired().then(|| common(one.replicate));
    let streams = builder.streams(STAGE, shared.as_ref().unwrap_or(&one.id), item.seed, one.replicate);
    let geometry = made.generator.geometry();
    let field = Heightfield {
        item: ItemRef::new(STAGE, &one.id),
        group: item.group.clone().or_else(|| one.sweep.clone()),
        is_grouped: item.group.is_some() || one.sweep.is_some(),
        variant: one.sweep.filter(|_| item.group.is_some()),
        replicate: Some(one.replicate),
        kind: item.kind.clone(),
        parameters: Arc::clone(&made.parameters),
        streams: Some(streams.clone()),
        release_path: format!("terrain/{}.tif", one.id),
        cells: geometry.len() as u64,
        raster_cells: None,
        cell_m: Some(geometry.cell.into_iter().fold(f64::INFINITY, f64::min)),
        geometry: Some(geometry),
        expected: Some(geometry),
    };
    let sources = made.inputs.0.iter().map(|s| s.item.clone()).collect::<BTreeSet<_>>();
    let job = TerrainJob { id: one.id.clone(), made: Arc::clone(made), streams };
    builder.node(Node {
        item: field.item.clone(),
        parents: sources.into_iter().collect(),
        inputs: Vec::new(),
        stream: field.stream(),
        job: Box::new(job),
    })?;
    if !item.exports.is_empty() {
        builder.exported.insert(one.id.clone());
    }
    builder.heightfields.insert(one.id, field);
    Ok(())
}

/// Checks the error limit of exported meshes, which needs at least one export with a mesh.
fn check_decimation(entry: &Entry<'_>, item: &TerrainItem) -> Result<(), StudyError> {
    let Some(error_max_m) = item.export_max_error_m else { return Ok(()) };
    let key = "export_max_error_m";
    ParameterError::not_negative(key, error_max_m).map_err(|e| entry.refuse(e))?;
    if item.exports.iter().any(|&simulator| has_mesh(simulator)) {
        return Ok(());
    }
    let message = "decimates meshes, but `exports` names no simulator that uses a mesh: add `gazebo` or `isaac`";
    Err(entry.refuse(ParameterError::new(key, message)))
}

/// The id of an item refers to everything it expands to, and the id of each swept part to its replicates.
fn name_families(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    id: &str,
    expanded: &[Expanded],
) -> Result<(), BuildError> {
    let mut parts: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for one in expanded {
        parts.entry(&one.part).or_default().push(one.id.clone());
    }
    parts.insert(id, expanded.iter().map(|one| one.id.clone()).collect());
    parts.into_iter().try_for_each(|(name, ids)| builder.name_family(entry, name, ids))?;
    Ok(())
}

/// The trails of a terrain; empty if it has none.
///
/// # Errors
/// When the item is not a parent, or its file cannot be read.
pub fn lines(work: &Work<'_>, item: &ItemRef) -> Result<Vec<Line>, JobError> {
    let path = work.parent(item, LINES)?;
    let bytes = match sastrugi_store::file::read(&path) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        read => read.map_err(|e| JobError::at(&path, e))?,
    };
    let stored: Vec<(String, Vec<[f64; 3]>)> = serde_json::from_slice(&bytes).map_err(JobError::new)?;
    Ok(stored.into_iter().map(|(name, points_m)| Line { name, points_m }).collect())
}

impl Job for TerrainJob {
    fn recipe(&self) -> Value {
        parsed(&self.made.recipe)
    }

    fn recipe_text(&self) -> String {
        self.made.recipe.clone()
    }

    fn packing(&self) -> Value {
        let raster = raster_packing(self.made.geotiff);
        self.made.exports.packing(if self.made.png16 { json!({ "raster": raster, "png16": true }) } else { raster })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Roughness, Room::Terrain]
    }

    fn memory_bytes(&self) -> u64 {
        let cells = self.made.generator.geometry().len() as u64;
        let after = dem::writing_bytes(cells).max(self.made.exports.memory_bytes(cells));
        self.made.generator.memory_bytes() + self.made.inputs.reading_bytes() + after
    }

    fn estimate(&self) -> Estimate {
        let cells = self.made.generator.geometry().len() as f64;
        let seconds = self.made.generator.seconds() + SECONDS_PER_WRITTEN_CELL * cells;
        Estimate { seconds, bytes: 3.0 * cells + self.made.exports.bytes() }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let (inputs, crs) = self.made.inputs.read(work)?;
        let made = generate(self.made.generator.as_ref(), &self.streams, &inputs)?;
        let options = raster_options(self.made.geotiff);
        let mut products = vec![self.write(work, HEIGHTS, "", &made.heights, &crs, &options)?];
        for map in &made.maps {
            let (file, ending) = (format!("{}.tif", map.name), format!(".{}", map.name));
            let options = WriteOptions { values: values_of(map), ..options.clone() };
            products.push(self.write(work, &file, &ending, &map.values, &crs, &options)?);
        }
        products.extend(self.write_lines(work, &made.lines, &crs)?);
        if self.made.generator.kind() == planetary::KIND {
            // Rovers drive on the world beyond the window, which is generated from the same inputs.
            products.extend(self.made.inputs.keep(work)?);
        }
        let mut notes = self.made.generator.notes();
        notes.extend(made.notes);
        if self.made.png16 {
            let note = write_png16(self.made.generator.as_ref(), &made.heights, &work.output("heights.png"))?;
            products.push(Product::released("heights.png", format!("terrain/{}.png", self.id), None));
            notes.push(note);
        }
        let mut outcome = Outcome { products, notes };
        self.made.exports.write(work, &self.id, &made.heights, &mut outcome)?;
        Ok(outcome)
    }
}

impl TerrainJob {
    /// Writes the trails, if there are any, for missions along them and as GeoJSON.
    fn write_lines(&self, work: &Work<'_>, lines: &[Line], crs: &Crs) -> Result<Vec<Product>, JobError> {
        if lines.is_empty() {
            return Ok(Vec::new());
        }
        let line = |line: &Line| (line.name.clone(), line.points_m.clone());
        let stored: Vec<(String, Vec<[f64; 3]>)> = lines.iter().map(line).collect();
        work.write(LINES, &serde_json::to_vec(&stored).map_err(JobError::new)?)?;
        let feature = |line: &Line| geojson::Route {
            positions: line.points_m.clone(),
            properties: [("name".to_owned(), json!(line.name))].into_iter().collect(),
        };
        let features: Vec<geojson::Route> = lines.iter().map(feature).collect();
        geojson::write_routes(&work.output(TRAILS), Some(crs), &features).map_err(JobError::io)?;
        let released = Product::released(TRAILS, format!("terrain/{}.trails.geojson", self.id), None);
        Ok(vec![Product::internal(LINES), released])
    }

    /// Writes a raster that is released as `terrain/<id><ending>.tif`.
    fn write(
        &self,
        work: &Work<'_>,
        file: &str,
        ending: &str,
        values: &Grid,
        crs: &Crs,
        options: &WriteOptions,
    ) -> Result<Product, JobError> {
        dem::write(&work.output(file), values, crs, options).map_err(JobError::io)?;
        let content = digest::heights(values);
        Ok(Product::released(file, format!("terrain/{}{ending}.tif", self.id), Some(content)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_store::atomic::Draft;
    use std::path::Path;

    /// Without a file there is no trail; a folder in its place is an error.
    #[test]
    fn val_trails_that_cannot_be_read_are_not_absent() {
        let (folder, item) = (tempfile::tempdir().unwrap(), ItemRef::new(STAGE, "a"));
        let parents = BTreeMap::from([(item.clone(), folder.path().to_owned())]);
        let work = Work { folder: Draft(Path::new("unused")), parents: &parents };
        assert_eq!(lines(&work, &item).unwrap().len(), 0);
        std::fs::create_dir(folder.path().join(LINES)).unwrap();
        let error = lines(&work, &item).unwrap_err();
        assert!(error.message.ends_with("lines.json: is a folder, not a file"), "{error}");
    }
}
