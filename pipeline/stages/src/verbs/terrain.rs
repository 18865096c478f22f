//! `terrain`: generates one heightfield and writes it to a file.

use super::parameters;
use crate::arrays::Raster;
use crate::error::Error;
use crate::jobs::terrain::STAGE;
use crate::memory;
use crate::operations::inputs::{self, Loaded};
use crate::operations::terrains::{generate, values_of, write_png16};
use crate::remote::check_file;
use sastrugi_numeric::Streams;
use sastrugi_store::dem::{self, Crs, Format, WriteOptions};
use sastrugi_terrain::{Generator, Holds, Input, MAPS, Terrain};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// What to generate.
pub struct Request<'a> {
    /// A generator's name, or a TOML file with `kind` and its parameters.
    pub spec: &'a str,
    /// `name=value` pairs.
    pub set: &'a [String],
    /// Seed of the random streams; default: that of the file, or 0.
    pub seed: Option<u64>,
    /// Output file.
    pub output: &'a Path,
    /// How to write.
    pub options: WriteOptions,
}

/// Generates a terrain and writes it. An item of a study with the same parameters and an explicit `seed` has the same bytes.
/// Returns a description of the result.
///
/// # Errors
/// Unknown kinds and parameters, parameters out of range, too little memory, files that cannot be written, a link in place of the output or of
/// any map beside it.
pub fn terrain(request: &Request<'_>) -> Result<Value, Error> {
    let prepared = prepare(request.spec, request.set, request.seed)?;
    super::check_output(request.output)?;
    // Which of the maps there are is known only when they are made.
    let map_file = |name: &str| request.output.with_extension(format!("{name}.tif"));
    MAPS.iter().try_for_each(|map| check_file(&map_file(map.name)))?;
    let (made, crs) = prepared.make()?;
    let mut notes = prepared.notes();
    let Prepared { kind, generator, seed, streams } = prepared;
    notes.extend(made.notes);
    if Format::of_name(request.output) == Some(Format::Png) {
        notes.push(write_png16(generator.as_ref(), &made.heights, request.output)?);
    } else {
        let lost = dem::write(request.output, &made.heights, &crs, &request.options).map_err(super::write_error)?;
        notes.extend(lost);
    }
    let mut maps = Map::new();
    for map in &made.maps {
        let path = map_file(map.name);
        let options = WriteOptions { values: values_of(map), ..request.options.clone() };
        dem::write(&path, &map.values, &crs, &options).map_err(super::write_error)?;
        let kind = map.kind();
        let map = json!({ "file": path.display().to_string(), "unit": kind.unit, "description": kind.description });
        maps.insert(kind.name.to_owned(), map);
    }
    Ok(json!({
        "file": request.output.display().to_string(),
        "kind": kind,
        "seed": seed,
        "stream": streams.label(),
        "parameters": generator.parameters(),
        "grid": super::describe_grid(&made.heights),
        "maps": maps,
        "notes": notes,
    }))
}

/// Inputs of a generator that are not files, by the name that its parameters give them.
pub(crate) type Given<'a> = BTreeMap<&'a str, &'a Raster>;

/// A generator with its parameters and streams.
pub(crate) struct Prepared {
    kind: String,
    generator: Box<dyn Generator>,
    seed: u64,
    streams: Streams,
}

/// The generator of a specification; without `seed`, the seed of the file, or 0, is used.
pub(super) fn prepare(spec: &str, set: &[String], seed: Option<u64>) -> Result<Prepared, Error> {
    let (kind, mut params, own_seed) = read_spec(spec)?;
    parameters::assign(&mut params, set)?;
    Prepared::new(kind, &params, seed.or(own_seed).unwrap_or(0))
}

impl Prepared {
    /// The generator of this kind, with its parameters checked.
    pub(crate) fn new(kind: String, params: &Value, seed: u64) -> Result<Self, Error> {
        if let Some(known) = sastrugi_terrain::kinds().iter().find(|k| k.kind == kind) {
            parameters::check(params, known)?;
        }
        let generator = sastrugi_terrain::prepare(&kind, params)?;
        Ok(Self { kind, generator, seed, streams: Streams::for_seed(seed, STAGE) })
    }

    /// The generated terrain, and the coordinate system of its first input. Inputs are files.
    pub(super) fn make(&self) -> Result<(Terrain, Crs), Error> {
        self.make_from(&Given::new())
    }

    /// The same; inputs that are not `given` are files.
    pub(crate) fn make_from(&self, given: &Given<'_>) -> Result<(Terrain, Crs), Error> {
        memory::check("the terrain", self.generator.memory_bytes())?;
        check_given(self.generator.as_ref(), given)?;
        let (inputs, crs) = read_inputs(self.generator.as_ref(), given)?;
        Ok((generate(self.generator.as_ref(), &self.streams, &inputs)?, crs))
    }

    /// Name of the generator.
    pub(super) fn kind(&self) -> &str {
        &self.kind
    }

    /// Its full parameters.
    pub(crate) fn parameters(&self) -> Value {
        self.generator.parameters()
    }

    /// Its inputs.
    pub(super) fn inputs(&self) -> Result<Vec<Input>, Error> {
        Ok(read_inputs(self.generator.as_ref(), &Given::new())?.0)
    }

    /// Its random streams.
    pub(super) fn streams(&self) -> Streams {
        self.streams.clone()
    }

    /// Seed of its streams.
    pub(super) fn seed(&self) -> u64 {
        self.seed
    }

    /// Notes on its parameters.
    pub(crate) fn notes(&self) -> Vec<String> {
        self.generator.notes()
    }
}

/// Refuses inputs that no parameter names.
fn check_given(generator: &dyn Generator, given: &Given<'_>) -> Result<(), Error> {
    let names: Vec<String> = generator.inputs().into_iter().map(|input| input.name).collect();
    let Some(unused) = given.keys().find(|name| !names.iter().any(|known| known == *name)) else { return Ok(()) };
    let named =
        if names.is_empty() { "they name no input".to_owned() } else { format!("they name {}", names.join(", ")) };
    Err(Error::Usage(format!("no parameter names the input `{unused}`; {named}")))
}

/// A generator's inputs, surfaces in metres, and the coordinate system of the first; those that are not given are read.
fn read_inputs(generator: &dyn Generator, given: &Given<'_>) -> Result<(Vec<Input>, Crs), Error> {
    let mut read_inputs = Vec::new();
    let mut crs = None;
    for named in generator.inputs() {
        let path = Path::new(&named.name);
        let read = match (given.get(named.name.as_str()), named.holds) {
            (Some(raster), Holds::Heights | Holds::Values) => raster.loaded(),
            (None, Holds::Heights) => heights(path)?,
            (None, Holds::Values) | (_, Holds::Points) => inputs::read(&named, path)?,
        };
        if let Some(own) = read.crs {
            inputs::check_systems(&named, crs.as_ref(), &own)?;
            crs.get_or_insert(own);
        }
        read_inputs.push(read.input);
    }
    Ok((read_inputs, crs.unwrap_or_default()))
}

/// Heights, read as in a study.
fn heights(path: &Path) -> Result<Loaded, Error> {
    let read = super::read(path, &super::Reading::default())?.dem;
    Ok(Loaded { input: read.grid.as_stored().into(), crs: Some(read.info.crs) })
}

/// Kind, parameters and seed of a specification.
fn read_spec(spec: &str) -> Result<(String, Value, Option<u64>), Error> {
    if !spec.to_ascii_lowercase().ends_with(".toml") {
        return Ok((spec.to_owned(), json!({}), None));
    }
    let mut table = parameters::read_file(Path::new(spec))?;
    let map = table.as_object_mut().ok_or_else(|| Error::Usage(format!("{spec}: not a TOML table")))?;
    let Some(Value::String(kind)) = map.remove("kind") else {
        return Err(Error::Usage(format!("{spec}: missing `kind`, the name of a generator (see `sastrugi kinds`)")));
    };
    let seed =
        match map.remove("seed") {
            None => None,
            Some(seed) => Some(seed.as_u64().ok_or_else(|| {
                Error::Usage(format!("{spec}: `seed` must be a whole number, 0 or above, got {seed}"))
            })?),
        };
    Ok((kind, table, seed))
}
