//! Builder of a study's graph: the items so far, and what later sections can refer to.

use crate::job::ItemRef;
use crate::jobs::fit::Site;
use crate::jobs::{terrain, texture};
use crate::operations::drawn::{Drawn, Routes};
use crate::registry::SECTIONS;
use crate::runner::graph::{Graph, InputFile, Node};
use crate::study::entry::{ITEMS_MAX, leave_out};
use crate::study::keys::{nearest, nearest_in, properties};
use crate::study::{Entry, Refusals, Study, StudyError, UNKNOWN_SECTION};
use sastrugi_imaging::Sun;
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_schemas::counted;
use sastrugi_schemas::fit::Source;
use sastrugi_schemas::study::Pairing;
use sastrugi_texture::Prospect;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Suffixes that file names in a release add to an id.
const RESERVED: [&str; 12] = [
    "license",
    "raw",
    "metric",
    "background",
    "residual",
    "mask",
    "uncertainty",
    "lit",
    "slope-sigma",
    "albedo-sigma",
    "condition",
    "leaning",
];

/// Memory of a height, bytes.
const BYTES_PER_HEIGHT: u64 = 8;

/// Sections of surfaces, whose `count` is a number of surfaces. Each of these is two items: it is generated, and its roughness measured.
const GENERATED: [&str; 2] = [terrain::STAGE, texture::STAGE];

/// Keys that choose the parameters of a table.
const CHOICES: [&str; 3] = ["kind", "method", "methods"];

/// Why a study has no graph.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The study is invalid.
    #[error(transparent)]
    Study(#[from] Refusals),
    /// An input file is missing or cannot be read.
    #[error("{0}")]
    Input(String),
}

impl BuildError {
    /// For an input file that cannot be read.
    pub fn reading(path: &Path, error: io::Error) -> Self {
        Self::Input(match error.kind() {
            io::ErrorKind::NotFound => format!("{}: no such file", path.display()),
            io::ErrorKind::IsADirectory => format!("{} is a folder, not a file", path.display()),
            _ => format!("{}: {error}", path.display()),
        })
    }
}

impl From<StudyError> for BuildError {
    fn from(error: StudyError) -> Self {
        Self::Study(error.into())
    }
}

/// Errors so far.
#[derive(Default)]
struct Refused {
    errors: Vec<StudyError>,
    /// Input files: the message, and the same at the table that names the file.
    inputs: Vec<(String, StudyError)>,
    /// Ids of refused tables; references to them are not reported as further errors.
    ids: BTreeSet<String>,
    /// True if a refused table has no readable id.
    nameless: bool,
}

impl Refused {
    /// Adds an error; `placed` puts that of an input file at its place in the study.
    fn add(&mut self, error: BuildError, placed: impl FnOnce(&str) -> StudyError) {
        match error {
            BuildError::Study(Refusals(errors)) => self.errors.extend(errors),
            BuildError::Input(message) => {
                let error = placed(&message);
                self.inputs.push((message, error));
            }
        }
    }

    fn table(&mut self, id: Option<&str>) {
        self.nameless |= id.is_none();
        self.ids.extend(id.map(str::to_owned));
    }

    /// True for the id of a refused table or of something derived from it (`<id>-0001`, `<id>.albedo`).
    fn holds(&self, id: &str) -> bool {
        let ends = id.match_indices(['-', '.']).map(|(at, _)| at).chain([id.len()]);
        self.nameless || ends.into_iter().any(|end| self.ids.contains(&id[..end]))
    }
}

/// File name of the heights of an item.
pub const HEIGHTS: &str = "heights.tif";

/// A heightfield that other items can refer to.
#[derive(Clone, Debug)]
pub struct Heightfield {
    /// The item that produces it; its file is [`HEIGHTS`].
    pub item: ItemRef,
    /// Label for statistics; for a DEM or texture without one, its id.
    pub group: Option<String>,
    /// True if the study gives the label.
    pub is_grouped: bool,
    /// Parameters that differ from other heightfields of the group.
    pub variant: Option<String>,
    /// Position among the replicates of its item, from 0; measured DEMs have none.
    pub replicate: Option<u64>,
    /// Generator, method or file format.
    pub kind: String,
    /// Full parameters.
    pub parameters: Arc<Value>,
    /// Its random streams; measured DEMs have none.
    pub streams: Option<Streams>,
    /// Its path in the release.
    pub release_path: String,
    /// Number of cells; for a measured DEM whose file does not state it, an upper bound.
    pub cells: u64,
    /// Number of cells of the complete raster of a measured DEM, of which it may be a window.
    pub raster_cells: Option<u64>,
    /// Smaller side of a cell, m, if known before the run.
    pub cell_m: Option<f64>,
    /// Geometry of a surface generated on its own cells, if known before the run.
    pub geometry: Option<Geometry>,
    /// Geometry, also of measured surfaces and of textures on them, if it follows before the run from parameters and file
    /// headers.
    pub expected: Option<Geometry>,
}

impl Heightfield {
    /// Label of its random streams.
    pub fn stream(&self) -> Option<String> {
        self.streams.as_ref().map(Streams::label)
    }

    /// Memory of its heights once they are read, bytes.
    pub fn heights_bytes(&self) -> u64 {
        BYTES_PER_HEIGHT * self.cells
    }
}

/// An image that other items can refer to.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Its id.
    pub id: String,
    /// The item that produces it; its files are those of `jobs::image`.
    pub item: ItemRef,
    /// Approximate number of pixels.
    pub pixels: u64,
    /// Id of the surface that it shows.
    pub surface: String,
    /// Its sun direction.
    pub sun: Sun,
}

/// A graph under construction, with what later sections can refer to.
pub struct Builder<'a> {
    /// The study.
    pub study: &'a Study,
    /// Heightfields by id.
    pub heightfields: BTreeMap<String, Heightfield>,
    /// Ids of heightfields that are exported for simulators.
    pub exported: BTreeSet<String>,
    /// Ids that an id in the study expands to (its replicates and sweeps).
    pub families: BTreeMap<String, Vec<String>>,
    /// Ids of fits.
    pub fits: Vec<String>,
    /// What is known about the fits before the run, by id.
    pub prospects: BTreeMap<String, Prospect>,
    /// The DEMs of the fits, by id of the fit.
    pub sites: BTreeMap<String, Site>,
    /// Missions by id, with their heightfields.
    pub missions: BTreeMap<String, Drawn>,
    /// Routes by id; a swept id has several searches.
    pub routes: BTreeMap<String, Vec<Routes>>,
    /// Images by id; the id of a table or of a swept value may have several.
    pub images: BTreeMap<String, Vec<Image>>,
    /// Path of each input file in the release.
    pub inputs: Vec<InputPlace>,
    /// The items so far.
    pub graph: Graph,
    /// Warnings before the run: what is allowed but makes no sense.
    pub doubts: Vec<String>,
    ids: BTreeMap<String, Origin>,
    refused: Refused,
    /// Maximum number of items.
    items_max: usize,
    /// True if an item was refused because there are too many.
    is_full: bool,
    /// True if the numbers that the tables state are too many, so that each is expanded to its first item only.
    is_limited: bool,
    /// True while a refused table is read again without what was refused.
    is_reading_on: bool,
}

/// The table of a study that an id comes from: its section, and its index in it.
pub type Origin = (&'static str, usize);

/// An input file and its path in the release.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputPlace {
    /// Path of its key in the study.
    pub key: Vec<String>,
    /// Path in the release.
    pub release_path: String,
}

impl<'a> Builder<'a> {
    /// Begins the graph of a study in which these errors were found already.
    pub fn new(study: &'a Study, errors: Vec<StudyError>) -> Self {
        Self {
            study,
            heightfields: BTreeMap::new(),
            exported: BTreeSet::new(),
            families: BTreeMap::new(),
            fits: Vec::new(),
            prospects: BTreeMap::new(),
            sites: BTreeMap::new(),
            missions: BTreeMap::new(),
            routes: BTreeMap::new(),
            images: BTreeMap::new(),
            inputs: Vec::new(),
            graph: Graph::default(),
            doubts: Vec::new(),
            ids: BTreeMap::new(),
            refused: Refused {
                // A section with a misspelt name may contain items that others refer to.
                nameless: errors.iter().any(|e| e.message.starts_with(UNKNOWN_SECTION) && e.help.is_some()),
                errors,
                ..Refused::default()
            },
            items_max: ITEMS_MAX,
            is_full: false,
            is_limited: false,
            is_reading_on: false,
        }
    }

    /// Refuses a study whose tables state too many items, before any is built. Its tables are then expanded to their first items, so that
    /// their other errors are found as well.
    pub fn limit(&mut self, sections: &[&'static str]) {
        let study = self.study;
        let entries: Vec<Entry<'_>> =
            sections.iter().flat_map(|&section| study.entries(section).unwrap_or_default()).collect();
        let most = self.items_max as u64;
        let mut total = 0_u64;
        let is_beyond = |entry: &&Entry<'_>| {
            total = total.saturating_add(items_stated(entry));
            total > most
        };
        let Some(beyond) = entries.iter().find(is_beyond) else { return };
        self.is_limited = true;
        self.refused.errors.push(beyond.error("count", too_many(self.items_max)));
        // References to items that are not built are not reported as further errors.
        entries.iter().for_each(|entry| self.refused.ids.extend(entry.id().map(str::to_owned)));
    }

    /// Adds the items of a section, table by table. Errors are collected for [`Self::check`]; reading continues with the next table
    /// unless there are too many items.
    ///
    /// # Errors
    /// A section that is not an array of tables.
    pub fn each(
        &mut self,
        section: &'static str,
        mut add: impl FnMut(&mut Self, &Entry<'_>) -> Result<(), BuildError>,
    ) -> Result<(), BuildError> {
        for entry in self.study.entries(section)? {
            if self.is_full {
                break;
            }
            let entry = if self.is_limited { entry.limited() } else { entry };
            let items = self.graph.len();
            let Err(error) = add(self, &entry) else { continue };
            let error = if self.is_full { entry.error("count", too_many(self.items_max)).into() } else { error };
            let told = self.refuse_table(&entry, error);
            if !self.is_full && self.graph.len() == items {
                self.read_on(&entry, told, &mut add);
            }
        }
        Ok(())
    }

    /// Records why a table is refused, and returns its errors in the study.
    fn refuse_table(&mut self, entry: &Entry<'_>, error: BuildError) -> Vec<StudyError> {
        let told = match error {
            BuildError::Study(Refusals(errors)) => {
                errors.into_iter().map(|error| self.explained(entry, error)).collect::<Vec<_>>()
            }
            input => {
                self.refused.add(input, |message| entry.error("", message));
                Vec::new()
            }
        };
        self.refused.table(entry.id());
        self.refused.errors.extend(told.iter().cloned());
        told
    }

    /// Reads a refused table again without what was refused, until no further key of it is. Later tables cannot refer to what it adds;
    /// that they miss it is not reported.
    fn read_on(
        &mut self,
        entry: &Entry<'_>,
        mut told: Vec<StudyError>,
        add: &mut impl FnMut(&mut Self, &Entry<'_>) -> Result<(), BuildError>,
    ) {
        let items = self.graph.len();
        let mut rest = Value::Object(entry.table().clone());
        let mut is_changed = leave_out(&mut rest, &told);
        let own = envelope_keys(entry);
        self.is_reading_on = true;
        while is_changed && self.graph.len() == items {
            let Some(table) = rest.as_object() else { break };
            let Err(BuildError::Study(Refusals(found))) = add(self, &entry.with(table).limited()) else { break };
            let is_new = |error: &StudyError| {
                entry.is_written(&error.key) && !told.iter().any(|other| concerns_same(other, error))
            };
            let found: Vec<StudyError> = found.into_iter().filter(is_new).collect();
            is_changed = leave_out(&mut rest, &found);
            // Without the kind or method that was meant, its parameters were checked against another.
            let is_by_choice = told.iter().any(|other| is_choice(other, &own));
            let found = found.into_iter().filter(|error| !(is_by_choice && is_parameter(error, &own)));
            let found: Vec<StudyError> = found.map(|error| self.explained(entry, error)).collect();
            self.refused.errors.extend(found.iter().cloned());
            told.extend(found);
        }
        self.is_reading_on = false;
        if self.is_full {
            self.refused.errors.push(entry.error("count", too_many(self.items_max)));
        }
        if self.graph.len() > items {
            self.hide(entry);
        }
    }

    /// Removes what a refused table has added, so that no later table can refer to it.
    fn hide(&mut self, entry: &Entry<'_>) {
        let origin: Origin = (entry.section(), entry.index());
        let own: BTreeSet<String> =
            self.ids.iter().filter(|(_, other)| **other == origin).map(|(id, _)| id.clone()).collect();
        for id in own.iter().map(String::as_str).chain(entry.id()) {
            self.heightfields.remove(id);
            self.missions.remove(id);
            self.routes.remove(id);
            self.images.remove(id);
        }
        self.fits.retain(|id| !own.contains(id));
    }

    /// An error of a table with a better suggestion, if there is one.
    fn explained(&self, entry: &Entry<'_>, error: StudyError) -> StudyError {
        let help = match &error.missing_id {
            Some(id) => self.where_it_is(entry, &error, id),
            None if error.help.is_some() => None,
            None => nearest_in(&error.message)
                .map(|word| format!("did you mean `{word}`?"))
                .or_else(|| nearest_kind(entry, &error).map(|kind| format!("did you mean \"{kind}\"?"))),
        };
        match help {
            Some(help) => error.with_help(Some(help)),
            None => error,
        }
    }

    /// Where a missing id is to be found: below its table, or in one that is refused.
    fn where_it_is(&self, entry: &Entry<'_>, error: &StudyError, id: &str) -> Option<String> {
        if self.replicates(id).is_some() {
            return None;
        }
        let section = entry.section();
        let names_surface = GENERATED.contains(&section) && error.key.first().is_some_and(|key| key != "fit");
        let tables = self.study.entries(section).unwrap_or_default();
        if names_surface && tables.iter().any(|other| other.index() > entry.index() && other.id() == Some(id)) {
            return Some(format!("[[{section}]] \"{id}\" comes after this table; move it above"));
        }
        let help = error.help.as_deref().filter(|help| !help.starts_with("did you mean"))?;
        let refused = || self.refused.ids.iter().map(String::as_str).filter(|other| Some(*other) != entry.id());
        if let Some(near) = nearest(id, refused()).filter(|near| *near != id) {
            return Some(format!("did you mean \"{near}\"?"));
        }
        let list: Vec<&str> = refused().collect();
        (!self.is_limited && !list.is_empty()).then(|| format!("{help}; in tables with errors: {}", list.join(", ")))
    }

    /// True if an item was refused because there are too many, so that the rest need not be read.
    pub fn is_full(&self) -> bool {
        self.is_full
    }

    /// Records an error of a section.
    pub fn refuse(&mut self, error: BuildError) {
        self.refused.table(None);
        self.refused.add(error, |message| StudyError::at(None, message));
    }

    /// True if there are errors.
    pub fn has_refused(&self) -> bool {
        !self.refused.errors.is_empty() || !self.refused.inputs.is_empty()
    }

    /// True if an item of that id may be missing because its table is refused.
    pub fn may_be_refused(&self, id: &str) -> bool {
        self.refused.holds(id)
    }

    /// Returns all errors at once.
    ///
    /// # Errors
    /// If there are any.
    pub fn check(&mut self) -> Result<(), BuildError> {
        let refused = std::mem::take(&mut self.refused);
        let is_own = |error: &StudyError| error.missing_id.as_ref().is_none_or(|id| !refused.holds(id));
        let mut errors: Vec<StudyError> = refused.errors.iter().filter(|error| is_own(error)).cloned().collect();
        let inputs = refused.inputs;
        if errors.is_empty() && inputs.is_empty() {
            // Tables that miss themselves or each other, or an id that begins like their own, do not excuse each other.
            errors = refused.errors;
        }
        if errors.is_empty() && !inputs.is_empty() {
            let messages: Vec<String> = inputs.into_iter().map(|(message, _)| message).collect();
            return Err(BuildError::Input(messages.join("; ")));
        }
        errors.extend(inputs.into_iter().map(|(_, error)| error));
        Ok(Refusals::none(errors)?)
    }

    /// Claims an id; ids are unique in a study, across sections.
    ///
    /// # Errors
    /// If it is taken.
    pub fn claim(&mut self, entry: &Entry<'_>, section: &'static str, id: &str) -> Result<(), StudyError> {
        let ending = id.rsplit_once('.').map_or("", |(_, ending)| ending);
        if RESERVED.contains(&ending) || sastrugi_terrain::MAPS.iter().any(|map| map.name == ending) {
            return Err(entry.error(
                "id",
                format!("the id \"{id}\" ends in .{ending}, a suffix reserved for files of the release"),
            ));
        }
        let origin: Origin = (section, entry.index());
        match self.ids.insert(id.to_owned(), origin) {
            None => Ok(()),
            // Its own claim, before it was refused.
            Some(other) if self.is_reading_on && other == origin => Ok(()),
            Some((other, _)) => {
                let message = format!("the id \"{id}\" is taken by an item of [[{other}]]; ids are unique in a study");
                Err(entry.error("id", message))
            }
        }
    }

    /// Takes the table of each claimed id; can be called once.
    pub fn take_origins(&mut self) -> BTreeMap<String, Origin> {
        std::mem::take(&mut self.ids)
    }

    /// Random streams of an item: from the study's seed, or from its explicit seed.
    pub fn streams(&self, stage: &str, id: &str, seed: Option<u64>, replicate: u64) -> Streams {
        match seed {
            Some(seed) => Streams::for_seed(seed.wrapping_add(replicate), stage),
            None => Streams::for_item(self.study.head.seed, stage, id),
        }
    }

    /// True when replicates with the same number share their random draws.
    pub fn is_paired(&self) -> bool {
        self.study.head.pairing == Pairing::Common
    }

    /// Number of the replicate whose draws a heightfield shares with the same replicate of others, from 0; none unless the study is paired. Only
    /// heightfields share draws whose cells are known before the run, since those of one number must have the same.
    pub fn shared(&self, field: &Heightfield) -> Option<u64> {
        field.replicate.filter(|_| self.is_paired() && field.expected.is_some())
    }

    /// Registers a family of ids, to which references resolve.
    ///
    /// # Errors
    /// If another family has that name.
    pub fn name_family(&mut self, entry: &Entry<'_>, name: &str, ids: Vec<String>) -> Result<(), StudyError> {
        match self.families.insert(name.to_owned(), ids) {
            None => Ok(()),
            Some(_) if self.is_reading_on => Ok(()),
            Some(_) => Err(entry.error("id", format!("the id \"{name}\" is taken; ids are unique in a study"))),
        }
    }

    /// Adds an item to the graph.
    ///
    /// # Errors
    /// If there are [`ITEMS_MAX`] already; if its name is taken or a parent is missing, because a stage is registered out of order.
    pub fn node(&mut self, node: Node) -> Result<(), StudyError> {
        if self.graph.len() >= self.items_max {
            self.is_full = true;
            return Err(StudyError::at(None, too_many(self.items_max)));
        }
        let name = node.item.to_string();
        let placed = self.graph.add(node);
        placed.then_some(()).ok_or_else(|| StudyError::at(None, format!("{name} cannot be placed in the graph")))
    }

    /// The heightfield that a key refers to.
    ///
    /// # Errors
    /// An id that is not an earlier heightfield.
    pub fn surface(&self, entry: &Entry<'_>, key: &str, id: &str) -> Result<&Heightfield, StudyError> {
        self.heightfields.get(id).ok_or_else(|| self.no_surface(entry, key, id))
    }

    /// The error for an id that no heightfield has. That of a table with several is told apart from an unknown one.
    pub fn no_surface(&self, entry: &Entry<'_>, key: &str, id: &str) -> StudyError {
        let family = self.families.get(id).filter(|ids| ids.iter().all(|id| self.heightfields.contains_key(id)));
        let Some([first, ..]) = family.map(Vec::as_slice) else {
            return unknown_id(entry, key, id, self.heightfields.keys());
        };
        let count = match self.replicates(id) {
            Some(ids) => counted(ids.len(), "replicate"),
            None => counted(family.map_or(0, Vec::len), "surface"),
        };
        let message = format!("`{key}` names \"{id}\", which has {count}; name one, such as \"{first}\"");
        StudyError { missing_id: Some(id.into()), ..entry.error(key, message) }
    }

    /// The surfaces of a table that differ only by their random draws, in order; `None` for any other id.
    pub fn replicates(&self, id: &str) -> Option<&[String]> {
        let ids = self.families.get(id)?;
        let is_next = |(k, id): (usize, &String)| {
            self.heightfields.get(id).is_some_and(|field| field.replicate == Some(k as u64))
        };
        (ids.len() > 1 && ids.iter().enumerate().all(is_next)).then_some(ids.as_slice())
    }

    /// The source recorded in a fit file: the measured file, or the generated heightfield's path in the release.
    pub fn source_of(&self, id: &str, field: &Heightfield) -> Source {
        let input = self.graph.find(&field.item).and_then(|p| self.graph.node(p).inputs.first());
        let window = field.parameters.get("window").and_then(|w| serde_json::from_value(w.clone()).ok());
        match input {
            Some(input) => Source {
                file: format!("{id}.{}", field.kind),
                sha256: input.sha256.clone(),
                window,
                ..Source::default()
            },
            None => Source { file: field.release_path.clone(), ..Source::default() },
        }
    }

    /// The ids that a reference expands to.
    ///
    /// # Errors
    /// An id that is not an earlier item.
    pub fn family(&self, entry: &Entry<'_>, key: &str, id: &str) -> Result<Vec<String>, StudyError> {
        if self.heightfields.contains_key(id) {
            return Ok(vec![id.to_owned()]);
        }
        // A refused table has named its family, but added no or not all of its items.
        let is_there =
            |ids: &&Vec<String>| ids.iter().all(|id| self.heightfields.contains_key(id)) || !self.refused.holds(id);
        let ids = self.families.get(id).filter(is_there);
        ids.cloned().ok_or_else(|| unknown_id(entry, key, id, self.families.keys()))
    }

    /// The ids that the references of a key `terrains` expand to.
    ///
    /// # Errors
    /// No reference, or an id that is not an earlier item.
    pub fn families(&self, entry: &Entry<'_>, named: &[String]) -> Result<BTreeSet<String>, StudyError> {
        if named.is_empty() {
            return Err(entry.error("terrains", "`terrains` is empty; name at least one terrain"));
        }
        let mut ids = BTreeSet::new();
        for (k, id) in named.iter().enumerate() {
            ids.extend(self.family(entry, &format!("terrains.{k}"), id)?);
        }
        Ok(ids)
    }
}

/// True if two errors refuse the same key, or one a key within that of the other.
fn concerns_same(one: &StudyError, other: &StudyError) -> bool {
    one.key.starts_with(&other.key) || other.key.starts_with(&one.key)
}

/// Keys of a table that are not parameters of its kind.
fn envelope_keys(entry: &Entry<'_>) -> Vec<String> {
    let envelope = SECTIONS.iter().find(|section| section.name == entry.section()).map(|section| section.envelope);
    envelope.map_or_else(Vec::new, |envelope| properties(&envelope()))
}

/// True if an error refuses the key that chooses the parameters of a table; `own` are its other keys.
fn is_choice(error: &StudyError, own: &[String]) -> bool {
    error.key.first().is_some_and(|key| CHOICES.contains(&key.as_str()) && own.contains(key))
}

/// True if an error refuses a parameter, written or swept; `own` are the other keys of its table.
fn is_parameter(error: &StudyError, own: &[String]) -> bool {
    error.key.first().is_some_and(|key| key == "sweep" || !own.contains(key))
}

/// The kind or vehicle that an error on an unknown one probably means.
fn nearest_kind(entry: &Entry<'_>, error: &StudyError) -> Option<&'static str> {
    let [key] = &*error.key else { return None };
    let kinds: Vec<&'static str> = match key.as_str() {
        "kind" | "method" => {
            let kinds = SECTIONS.iter().find(|section| section.name == entry.section()).map(|section| section.kinds)?;
            kinds().iter().map(|kind| kind.kind).collect()
        }
        "vehicle" => sastrugi_mobility::registry::kinds()
            .iter()
            .filter(|kind| kind.family == "vehicle")
            .map(|kind| kind.kind)
            .collect(),
        _ => return None,
    };
    let given = entry.table().get(key)?.as_str()?;
    nearest(given, kinds.into_iter()).filter(|kind| *kind != given)
}

/// Number of items that a table states, at least.
fn items_stated(entry: &Entry<'_>) -> u64 {
    let variants = entry.variants_stated();
    if GENERATED.contains(&entry.section()) {
        return variants.saturating_mul(entry.replicates_stated()).saturating_mul(2);
    }
    variants
}

/// Message for a study with too many items.
fn too_many(most: usize) -> String {
    format!(
        "the study expands to more than {most} items, the limit; split it into several studies (each surface counts as two items)"
    )
}

/// The error for an unknown id.
pub fn unknown_id<'s>(entry: &Entry<'_>, key: &str, id: &str, known: impl Iterator<Item = &'s String>) -> StudyError {
    let known: Vec<&str> = known.map(String::as_str).collect();
    let nearest = nearest(id, known.iter().copied()).map(|n| format!("did you mean \"{n}\"?"));
    let list = if known.is_empty() {
        format!("no valid table defines an id for `{key}`")
    } else {
        format!("known: {}", known.join(", "))
    };
    let error = entry.error(key, format!("`{key}` names \"{id}\", which is not an id that it can refer to"));
    StudyError { missing_id: Some(id.into()), ..error.with_help(Some(nearest.unwrap_or(list))) }
}

/// Label of the random streams that replicate `replicate` (from 0) shares with the same replicate of other items when paired.
pub fn common(replicate: u64) -> String {
    format!("common-{:04}", replicate + 1)
}

/// An input file: its length in bytes, and its hash.
///
/// # Errors
/// A file that is missing or cannot be read.
pub fn input_file(path: PathBuf) -> Result<(u64, InputFile), BuildError> {
    let (bytes, sha256) = sastrugi_store::digest::of_file(&path).map_err(|e| BuildError::reading(&path, e))?;
    Ok((bytes, InputFile { path, sha256 }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs;
    use std::path::Path;

    fn table(id: &str, count: u32) -> String {
        format!("[[terrain]]\nid = \"{id}\"\nkind = \"gap\"\nsize_px = [64, 64]\ncount = {count}\n")
    }

    /// Counts tell that there are too many items before any is built, and other errors are found nevertheless.
    #[test]
    fn val_counts_are_added_up_before_items_are_built() {
        let head = "[study]\nname = \"many\"\nseed = 1\ndate = \"2026-01-01\"\n";
        let read = |tables: &str| {
            let text = format!("{head}{tables}");
            let sections = crate::registry::section_names();
            let (study, errors) = Study::read(&text, Path::new(""), &sections).unwrap();
            let mut builder = Builder::new(&study, errors);
            builder.limit(&sections);
            let limited = builder.is_limited;
            if limited {
                jobs::terrain::add(&mut builder).unwrap();
            }
            let said = builder.check().map_or_else(|error| error.to_string(), |()| String::new());
            (limited, said, builder.graph.len())
        };
        let wrong = "[[terrain]]\nid = \"c\"\nkind = \"gap\"\ncell_m = -1.0\n";
        let on_a =
            "[[terrain]]\nid = \"d\"\nkind = \"compose\"\nsize_px = [64, 64]\nprocesses = [{ of = \"a-0007\" }]\n";
        let (limited, said, items) = read(&format!("{}{}{wrong}{on_a}", table("a", 400_000), table("b", 100_001)));
        assert!(limited && said.starts_with("terrain \"b\": the study expands to more than 1000000 items"), "{said}");
        assert!(said.contains("terrain \"c\": `cell_m`") && items <= 3 && !said.contains("a-0007"), "{said}");
        let (limited, said, _) = read(&format!("{}{}", table("a", 400_000), table("b", 99_999)));
        assert!(!limited && said.is_empty(), "{said}");
        let (limited, said, items) = read(&table("a", u32::MAX));
        assert!(limited && said.starts_with("terrain \"a\"") && items == 1, "{said}");
    }

    /// A study with tables of three, two and one terrains, with a limit on items: the error, and the number of items.
    fn refused(items_max: usize) -> (String, usize) {
        let text = format!(
            "[study]\nname = \"many\"\nseed = 1\ndate = \"2026-01-01\"\n{}{}{}",
            table("a", 3),
            table("b", 2),
            table("c", 1)
        );
        let (study, errors) = Study::read(&text, Path::new(""), &crate::registry::section_names()).unwrap();
        let mut builder = Builder { items_max, ..Builder::new(&study, errors) };
        jobs::terrain::add(&mut builder).unwrap();
        if !builder.is_full() {
            jobs::roughness::add(&mut builder).unwrap_or_else(|error| builder.refuse(error));
        }
        let said = builder.check().map_or_else(|error| error.to_string(), |()| String::new());
        (said, builder.graph.len())
    }

    /// Too many items in several tables are one error, at the table that exceeds the limit; later tables are not expanded.
    #[test]
    fn val_items_of_all_tables_are_limited_together() {
        assert_eq!(refused(12), (String::new(), 12));
        let (said, items) = refused(4);
        assert!(said.contains("terrain \"b\": the study expands to more than 4 items") && items == 4, "{said}");
        assert!(!said.contains("terrain \"c\""), "{said}");
        // The descriptions of the surfaces exceed the limit.
        let (said, items) = refused(8);
        assert!(said.contains("more than 8 items") && items == 8, "{said}");
    }
}
