//! Stage `texture`: synthesises a texture that matches a fit, alone or on a base surface.

use super::dem as dem_job;
use super::fit::{self, Site};
use super::matched::{Matched, seconds_per_operation};
use super::rasters::{Raster, SECONDS_PER_WRITTEN_CELL, raster_options, raster_packing};
use super::scoreboard::{self, Entrant, ScoreboardJob};
use super::surface::{Surface, SurfaceRows};
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield, unknown_id};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::operations::dem::input_error;
use crate::operations::textures::{
    completes_background, fill_note, has_its_texture, lay_onto, notes_on_filling, on_base_cells, on_base_size,
    on_site_cells, scaled, size_doubt, states_size, uncovered,
};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::{Entry, Expanded, StudyError};
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::study::{FitReference, GeoTiff, Methods, Modulate, Onto, TextureItem};
use sastrugi_schemas::{Kind, ParameterError};
use sastrugi_store::dem::{self, Crs};
use sastrugi_store::digest;
use sastrugi_texture::covariance::Covariance;
use sastrugi_texture::synth::{conditional, fft_ma};
use sastrugi_texture::{Cost, Method, Needs, Prospect, SlopeFactors, Synthesis, TextureOutcome, needs};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "texture";
/// Maximum number of realisations of a scoreboard.
const REALISATIONS_MAX: u32 = TextureItem::REALISATIONS_MAX;

/// Approximate time to detrend, trim and describe one cell of a texture, s.
const SECONDS_PER_DESCRIBED_CELL: f64 = 6e-7;

/// Approximate time to compute the residual of one cell of a site, s.
const SECONDS_PER_DETRENDED_CELL: f64 = 1e-6;

/// Synthesis methods.
pub fn kinds() -> Vec<Kind> {
    sastrugi_texture::kinds().into_iter().filter(|k| k.family == "texture").collect()
}

/// Factor by which a texture is scaled on its base.
#[derive(Clone)]
enum Modulation {
    Raster(Raster),
    Slope(SlopeFactors),
}

/// The surface to which a texture is added.
#[derive(Clone)]
struct Base {
    /// The item that produces it.
    item: ItemRef,
    /// Its file in the item's folder.
    file: &'static str,
    /// The DEM from which a background was computed; both must share a split.
    dem: Option<ItemRef>,
    /// Number of cells.
    cells: u64,
    /// Shape and position, if known before the run.
    expected: Option<Geometry>,
    /// Whether it is the DEM to which the texture's model was fitted.
    was_fitted: bool,
}

impl Base {
    /// The bases of an item: one for all its replicates, or one for each if `onto` names as many replicates; none without `onto`.
    fn all(
        builder: &Builder<'_>,
        entry: &Entry<'_>,
        item: &TextureItem,
        matched: &Matched,
    ) -> Result<Vec<Self>, BuildError> {
        let of = |onto: &Onto| Self::of(builder, entry, onto, matched);
        let each = match &item.onto {
            Some(Onto::Id(id)) => builder.replicates(id).map(|replicates| (id, replicates)),
            _ => None,
        };
        match each {
            None => item.onto.iter().map(of).collect(),
            Some((_, replicates)) if item.count.is_some_and(|count| count as usize == replicates.len()) => {
                replicates.iter().map(|id| of(&Onto::Id(id.clone()))).collect()
            }
            Some((id, replicates)) => {
                let help = format!("or set `count = {}`: each replicate is then added to its own", replicates.len());
                Err(builder.no_surface(entry, "onto", id).with_help(Some(help)).into())
            }
        }
    }

    fn of(builder: &Builder<'_>, entry: &Entry<'_>, onto: &Onto, matched: &Matched) -> Result<Self, BuildError> {
        match onto {
            Onto::Id(id) => {
                let Heightfield { item, cells, expected, .. } = builder.surface(entry, "onto", id)?.clone();
                let was_fitted = matched.parent().and_then(|fit| fitted_dem(builder, &fit)) == Some(&item);
                Ok(Self { item, file: HEIGHTS, dem: None, cells, expected, was_fitted })
            }
            Onto::Background { background } => {
                let item = ItemRef::new(fit::STAGE, background);
                let Some(dem) = fitted_dem(builder, &item) else {
                    return Err(unknown_id(entry, "onto.background", background, builder.fits.iter()).into());
                };
                let field = builder.heightfields.get(&dem.id);
                let (cells, expected) = field.map_or((0, None), |field| (field.cells, field.expected));
                Ok(Self { item, file: fit::BACKGROUND, dem: Some(dem.clone()), cells, expected, was_fitted: false })
            }
        }
    }

    fn parents(&self) -> impl Iterator<Item = ItemRef> {
        [&self.item].into_iter().chain(&self.dem).cloned()
    }

    /// Its name in a recipe.
    fn name(&self) -> String {
        if self.file == HEIGHTS { self.item.to_string() } else { format!("{}: {}", self.item, self.file) }
    }
}

/// The DEM of a fit, which is the first of its parents.
fn fitted_dem<'b>(builder: &'b Builder<'_>, fit: &ItemRef) -> Option<&'b ItemRef> {
    let graph = &builder.graph;
    graph.find(fit).and_then(|p| graph.parents(p).next()).map(|dem| &graph.node(dem).item)
}

struct TextureJob {
    id: String,
    matched: Matched,
    base: Option<Base>,
    amplitude: f64,
    modulation: Option<Modulation>,
    /// The DEM whose holes are filled.
    fill: Option<ItemRef>,
    /// The DEM of the fit, if the method copies from its residual.
    exemplar: Option<Site>,
    method: String,
    synthesis: Box<dyn Method>,
    cost: Cost,
    /// Whether it is one of several realisations.
    one_of_many: bool,
    /// Number of cells of the heightfield written.
    cells: u64,
    streams: Streams,
    geotiff: GeoTiff,
}

/// Adds the items of `[[texture]]`.
///
/// # Errors
/// An invalid item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    builder.each(STAGE, add_table)
}

fn add_table(builder: &mut Builder<'_>, entry: &Entry<'_>) -> Result<(), BuildError> {
    let kinds = kinds();
    let (item, params): (TextureItem, Value) = entry.read()?;
    let matched = matched(builder, entry, &item);
    let fit = matched.as_ref().ok().and_then(Matched::parent);
    let prospect = fit.and_then(|fit| builder.prospects.get(&fit.id)).copied();
    let methods = methods(entry, &item, &kinds, matched.is_err() || prospect.is_some_and(|fit| fit.has_statistics))?;
    if item.methods.is_none() {
        sastrugi_texture::check_keys(&item.method, &params).map_err(|e| entry.refuse(e))?;
    }
    entry.check_keys::<TextureItem>(&params, &joined_schema(&kinds, &methods))?;
    check_purpose(entry, &item, &params)?;
    let matched = matched?;
    let site = matched.parent().and_then(|fit| builder.sites.get(&fit.id)).cloned();
    let exemplar_of = |method: &str| site.clone().filter(|_| needs(method) == Some(Needs::Residual));
    let bases = Base::all(builder, entry, &item, &matched)?;
    let fill = item.fill.as_deref().map(|id| builder.surface(entry, "fill", id).cloned()).transpose()?;
    let modulation = modulation(builder, entry, &item)?;
    let mut ids = Vec::new();
    // Replicates cost the same. To state the cost of a covariance may take a transform.
    let mut costs: BTreeMap<(Arc<str>, String), Cost> = BTreeMap::new();
    for one in entry.expand(&item.id, item.count, &item.sweep, &params)? {
        let side_by_side = item.methods.is_some();
        let base = bases.get(one.replicate as usize).or(bases.first()).cloned();
        let one = on_background(one, &base, &matched, &item);
        let streams = builder.streams(STAGE, &one.id, item.seed, one.replicate);
        let mut entrants = Vec::new();
        let mut refusal = None;
        for method in &methods {
            let mut own =
                if side_by_side { own_parameters(&one.params, &kinds, method) } else { Value::clone(&one.params) };
            on_site_cells(method, &mut own, prospect.and_then(|fit| fit.cell_m));
            if let Some(field) = fill.as_ref().filter(|_| needs(method) != Some(Needs::Covariance)) {
                on_cells_of(field, &mut own).map_err(|message| entry.error("fill", message))?;
            }
            // Methods that are compared keep the default size and cells, on which the scoreboard compares them.
            let place = base.as_ref().and_then(|base| base.expected).filter(|_| !side_by_side);
            let states_size = states_size(&own);
            let made = match &place {
                Some(place) => on_base(place, method, &mut own),
                None => sastrugi_texture::method(method, &own),
            };
            let alike = (Arc::clone(&one.part), method.clone());
            let known = costs.get(&alike).copied();
            let checked = made.and_then(|synthesis| {
                // When methods are compared, the scoreboard lists those that fail; filling a DEM does not use a tile.
                if !side_by_side && fill.is_none() {
                    check_before_run(prospect.as_ref(), base.as_ref(), synthesis.as_ref())?;
                } else if let Some(fit) = prospect.filter(|_| needs(method) != Some(Needs::Covariance)) {
                    synthesis.check_prospect(&fit)?;
                }
                let cost = known.map_or_else(|| matched.cost(synthesis.as_ref(), &builder.prospects), Ok)?;
                Ok((cost, synthesis))
            });
            let cost = checked.as_ref().ok().map(|(cost, _)| *cost);
            costs.extend(cost.map(|cost| (alike, cost)));
            let stated = checked.as_ref().ok().filter(|_| states_size).map(|(_, synthesis)| synthesis.geometry());
            let doubt = place.zip(stated).and_then(|(place, stated)| size_doubt(&place, &stated));
            if let Some(doubt) = doubt.map(|doubt| format!("texture \"{}\": {doubt}", item.id))
                && !builder.doubts.contains(&doubt)
            {
                builder.doubts.push(doubt);
            }
            entrants.push(Entrant { method: method.clone(), parameters: own, cost });
            let (cost, synthesis) = match checked {
                Ok(checked) => checked,
                Err(error) => {
                    refusal = refusal.or(Some(error));
                    continue;
                }
            };
            let id = if side_by_side { format!("{}-{}", one.id, method.replace('_', "-")) } else { one.id.clone() };
            builder.claim(entry, STAGE, &id)?;
            let streams =
                if side_by_side { builder.streams(STAGE, &id, item.seed, one.replicate) } else { streams.clone() };
            let own_label =
                if side_by_side { format!("{}-{}", item.id, method.replace('_', "-")) } else { item.id.clone() };
            let field = Heightfield {
                item: ItemRef::new(STAGE, &id),
                group: item.group.clone().or_else(|| one.sweep.clone()).or(Some(own_label)),
                is_grouped: item.group.is_some() || one.sweep.is_some(),
                variant: one.sweep.clone().filter(|_| item.group.is_some()),
                replicate: Some(one.replicate),
                kind: method.clone(),
                parameters: Arc::new(parameters(
                    &item,
                    base.as_ref().filter(|_| bases.len() > 1),
                    &matched,
                    synthesis.as_ref(),
                )),
                streams: Some(streams.clone()),
                release_path: format!("texture/{id}.tif"),
                cells: match (&base, &fill) {
                    (Some(Base { cells, .. }), _) | (None, Some(Heightfield { cells, .. })) => *cells,
                    (None, None) => synthesis.geometry().len() as u64,
                },
                raster_cells: None,
                cell_m: Some(synthesis.geometry().cell.into_iter().fold(f64::INFINITY, f64::min)),
                geometry: (base.is_none() && fill.is_none()).then(|| synthesis.geometry()),
                expected: match (&base, &fill) {
                    (Some(Base { expected, .. }), _) | (None, Some(Heightfield { expected, .. })) => *expected,
                    (None, None) => Some(synthesis.geometry()),
                },
            };
            let cells = field.cells;
            let one_of_many = item.count.is_some_and(|count| count > 1);
            let (base, fill) = (base.clone(), fill.as_ref().map(|field| field.item.clone()));
            let raster = match &modulation {
                Some(Modulation::Raster(raster)) => Some(raster.item.clone()),
                _ => None,
            };
            let exemplar = exemplar_of(method);
            let others = [matched.parent(), fill.clone(), raster].into_iter().flatten();
            let of_site = exemplar.iter().flat_map(Site::parents);
            let parents: BTreeSet<ItemRef> = others.chain(of_site).chain(base.iter().flat_map(Base::parents)).collect();
            let parents = parents.into_iter().collect();
            let (method, matched, modulation) = (method.clone(), matched.clone(), modulation.clone());
            let job = TextureJob {
                id: id.clone(),
                matched,
                base,
                amplitude: item.amplitude,
                modulation,
                fill,
                exemplar,
                method,
                synthesis,
                cost,
                one_of_many,
                cells,
                streams,
                geotiff: builder.study.head.geotiff,
            };
            let stream = field.stream();
            let node = Node { item: field.item.clone(), parents, inputs: Vec::new(), stream, job: Box::new(job) };
            builder.node(node)?;
            builder.heightfields.insert(id.clone(), field);
            ids.push(id);
        }
        if let Some(error) = refusal.filter(|_| entrants.iter().all(|e| e.cost.is_none())) {
            return Err(entry.refuse(error).into());
        }
        if side_by_side && one.replicate == 0 {
            builder.claim(entry, scoreboard::STAGE, &one.id)?;
            let stream = Some(streams.label());
            let realisations = item.realisations;
            let matched = matched.clone();
            let exemplar = entrants.iter().filter(|e| e.cost.is_some()).find_map(|e| exemplar_of(&e.method));
            let parents: BTreeSet<ItemRef> =
                matched.parent().into_iter().chain(exemplar.iter().flat_map(Site::parents)).collect();
            let parents = parents.into_iter().collect();
            let job = ScoreboardJob { id: one.id.clone(), matched, entrants, realisations, exemplar, streams };
            let item = ItemRef::new(scoreboard::STAGE, &one.id);
            builder.node(Node { item, parents, inputs: Vec::new(), stream, job: Box::new(job) })?;
        }
    }
    builder.name_family(entry, &item.id, ids)?;
    Ok(())
}

/// Sets the cells of a texture to those of the DEM whose holes it fills.
fn on_cells_of(dem: &Heightfield, parameters: &mut Value) -> Result<(), String> {
    let Some(Geometry { rows, cols, cell, .. }) = dem.expected else {
        return Err(format!(
            "\"{}\" does not state its cells before the run, which a texture that repeats a site needs; convert it to GeoTIFF, or fill with \
             `fft_ma`",
            dem.item.id
        ));
    };
    let own = json!({ "size_px": [cols, rows], "cell_m": cell, "periodic": false });
    own.as_object().into_iter().flatten().for_each(|(key, value)| parameters[key] = value.clone());
    Ok(())
}

/// The method for a texture on a base. Cells and size that are not stated are the base's where the defaults do not suit it: other cells, or a
/// texture that does not repeat and is smaller.
fn on_base(place: &Geometry, method: &str, own: &mut Value) -> Result<Box<dyn Method>, ParameterError> {
    let states_size = states_size(own);
    on_base_cells(place, own);
    let made = sastrugi_texture::method(method, own);
    let suits = |made: &dyn Method| made.is_periodic() || uncovered(place, &made.geometry()).is_none();
    if states_size || made.as_ref().is_ok_and(|made| suits(made.as_ref())) {
        return made;
    }
    on_base_size(place, own);
    sastrugi_texture::method(method, own)
}

/// Refuses, before the fit is computed, a texture that is known not to match the fit, and one whose cells do not match those of the base or
/// that does not cover it.
fn check_before_run(
    prospect: Option<&Prospect>,
    base: Option<&Base>,
    synthesis: &dyn Method,
) -> Result<(), ParameterError> {
    prospect.map_or(Ok(()), |fit| synthesis.check_prospect(fit))?;
    let Some(place) = base.and_then(|base| base.expected) else { return Ok(()) };
    let geometry = synthesis.geometry();
    sastrugi_texture::check_cells(place.cell, geometry.cell).map_err(|error| {
        ParameterError::new("cell_m", format!("does not match `onto`: {error}, or leave out `cell_m`"))
    })?;
    let key = if synthesis.parameters()["size_px"].is_null() { "size_m" } else { "size_px" };
    match uncovered(&place, &geometry).filter(|_| !synthesis.is_periodic()) {
        Some(why) => Err(ParameterError::new(key, format!("is too small: {why}, or leave out `{key}`"))),
        None => Ok(()),
    }
}

/// On a measured DEM or the background of a fit, a texture defaults to the covariance of the residual, which such a base lacks.
fn on_background(mut one: Expanded, base: &Option<Base>, matched: &Matched, item: &TextureItem) -> Expanded {
    let measured = base.as_ref().is_some_and(|base| [dem_job::STAGE, fit::STAGE].contains(&base.item.stage.as_str()));
    let fitted = matches!(matched, Matched::Item(_)) && item.methods.is_none() && completes_background(&item.method);
    if measured && fitted && one.params["covariance"].is_null() {
        Arc::make_mut(&mut one.params)["covariance"] = json!(fft_ma::CovarianceOf::Residual);
    }
    one
}

/// Refuses keys that cannot be combined.
fn check_purpose(entry: &Entry<'_>, item: &TextureItem, params: &Value) -> Result<(), StudyError> {
    ParameterError::positive("amplitude", item.amplitude).map_err(|e| entry.refuse(e))?;
    if item.amplitude != 1.0 && (item.methods.is_some() || item.fill.is_some()) {
        let message = "`amplitude` cannot be combined with `methods` or `fill`";
        return Err(entry.error("amplitude", message));
    }
    if item.modulate.is_some() && item.onto.is_none() {
        return Err(entry.error("modulate", "`modulate` needs `onto`, the base on which it scales the texture"));
    }
    let fills = item.method == fft_ma::kind().kind || needs(&item.method) != Some(Needs::Covariance);
    if item.fill.is_some() && (item.onto.is_some() || item.methods.is_some() || !fills) {
        let message =
            "`fill` cannot be combined with `onto` or `methods`, and takes `fft_ma` or a method that repeats the site";
        return Err(entry.error("fill", message));
    }
    let keys = params.as_object().into_iter().flat_map(|p| p.keys()).chain(item.sweep.keys());
    if let Some(name) = keys.into_iter().find(|_| item.fill.is_some()) {
        let message = format!("`fill` takes its cells from the DEM and its covariance from the fit; remove `{name}`");
        return Err(entry.error(name, message));
    }
    Ok(())
}

fn modulation(builder: &Builder<'_>, entry: &Entry<'_>, item: &TextureItem) -> Result<Option<Modulation>, StudyError> {
    Ok(match item.modulate.clone() {
        None => None,
        Some(Modulate::Raster(id)) => Some(Modulation::Raster(builder.surface(entry, "modulate", &id)?.into())),
        Some(Modulate::Slope { slope_deg, factor }) => {
            let factors = SlopeFactors { slope_deg, factor };
            factors.check().map_err(|e| entry.refuse(e))?;
            Some(Modulation::Slope(factors))
        }
    })
}

/// The methods of an item.
///
/// `all` are those that reproduce a covariance; with the statistics of the residual, also those that repeat it.
fn methods(
    entry: &Entry<'_>,
    item: &TextureItem,
    kinds: &[Kind],
    has_statistics: bool,
) -> Result<Vec<String>, StudyError> {
    let known: Vec<String> = kinds.iter().map(|k| k.kind.to_owned()).collect();
    let all = || known.iter().filter(|name| has_statistics || needs(name) == Some(Needs::Covariance)).cloned();
    let (key, wanted) = match &item.methods {
        None => ("method", vec![item.method.clone()]),
        Some(Methods::Word(word)) if word == "all" => ("methods", all().collect()),
        Some(Methods::Word(word)) => ("methods", vec![word.clone()]),
        Some(Methods::List(list)) => ("methods", list.clone()),
    };
    if item.realisations == 0 || item.realisations > REALISATIONS_MAX {
        let message = format!("`realisations` is {}; it must lie in 1 to {REALISATIONS_MAX}", item.realisations);
        return Err(entry.error("realisations", message));
    }
    match wanted.iter().find(|w| !known.contains(w)) {
        Some(other) => {
            let message = format!("`{key}` is `{other}`; known texture methods: {}", known.join(", "));
            Err(entry.error(key, message))
        }
        None if (1..wanted.len()).any(|k| wanted[..k].contains(&wanted[k])) => {
            Err(entry.error(key, "`methods` names a method twice"))
        }
        None if wanted.is_empty() => Err(entry.error(key, "`methods` is empty; name at least one, or \"all\"")),
        None => Ok(wanted),
    }
}

/// The fit that the item matches.
fn matched(builder: &Builder<'_>, entry: &Entry<'_>, item: &TextureItem) -> Result<Matched, BuildError> {
    match &item.fit {
        FitReference::Id(id) if builder.fits.contains(id) => Ok(Matched::Item(ItemRef::new(fit::STAGE, id))),
        FitReference::Id(id) => Err(unknown_id(entry, "fit", id, builder.fits.iter()).into()),
        FitReference::Stated { model, parameters } => {
            let fit = FitFile { model: model.clone(), parameters: parameters.clone(), ..FitFile::default() };
            Covariance::of_fit(&fit).map_err(|e| entry.refuse(e.within("fit")))?;
            Ok(Matched::Stated(Box::new(fit)))
        }
    }
}

/// JSON Schema that joins the parameters of several methods.
fn joined_schema(kinds: &[Kind], methods: &[String]) -> Value {
    let mut joined = json!({ "properties": {}, "$defs": {} });
    for kind in kinds.iter().filter(|k| methods.iter().any(|m| m == k.kind)) {
        for part in ["properties", "$defs"] {
            for (key, value) in kind.parameters[part].as_object().into_iter().flatten() {
                joined[part][key] = value.clone();
            }
        }
    }
    joined
}

/// The subset of the parameters that a method accepts.
fn own_parameters(params: &Value, kinds: &[Kind], method: &str) -> Value {
    let known = kinds.iter().find(|k| k.kind == method).map(|k| &k.parameters["properties"]);
    let has = |key: &String| known.is_some_and(|properties| properties.get(key).is_some());
    Value::Object(
        params.as_object().into_iter().flatten().filter(|(k, _)| has(k)).map(|(k, v)| (k.clone(), v.clone())).collect(),
    )
}

/// The parameters of a texture for the table `terrains`; `own` is its base, if its replicates have one each.
fn parameters(item: &TextureItem, own: Option<&Base>, matched: &Matched, synthesis: &dyn Method) -> Value {
    let mut all = Map::new();
    all.insert("fit".to_owned(), matched.describe());
    let more = [
        ("onto", own.map(|base| json!(base.item.id)).or_else(|| item.onto.as_ref().map(|onto| json!(onto)))),
        ("amplitude", (item.amplitude != 1.0).then(|| json!(item.amplitude))),
        ("modulate", item.modulate.as_ref().map(|m| json!(m))),
        ("fill", item.fill.as_ref().map(|id| json!(id))),
    ];
    all.extend(more.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))));
    if let Value::Object(own) = synthesis.parameters() {
        all.extend(own);
    }
    Value::Object(all)
}

impl Job for TextureJob {
    fn recipe(&self) -> Value {
        let base = self.base.as_ref().map(Base::name);
        let mut recipe = json!({
            "method": self.method,
            "params": self.synthesis.parameters(),
            "fit": self.matched.describe(),
            "onto": base,
        });
        // Determines whether a note is written.
        if self.one_of_many {
            recipe["one_of_many"] = json!(true);
        }
        if self.amplitude != 1.0 {
            recipe["amplitude"] = json!(self.amplitude);
        }
        match &self.modulation {
            None => {}
            Some(Modulation::Raster(raster)) => recipe["modulate"] = json!(raster.item.to_string()),
            Some(Modulation::Slope(f)) => recipe["modulate"] = json!({ "slope_deg": f.slope_deg, "factor": f.factor }),
        }
        if let Some(dem) = &self.fill {
            recipe["fill"] = json!(dem.to_string());
        }
        recipe
    }

    fn packing(&self) -> Value {
        raster_packing(self.geotiff)
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Roughness, Room::Statistics, Room::Texture]
    }

    fn memory_bytes(&self) -> u64 {
        // The texture, the statistics of its residual (detrended like the fit's), and a base or a DEM to fill.
        let factors = match &self.modulation {
            Some(Modulation::Raster(raster)) => raster.bytes,
            _ => 0,
        };
        let texture = self.cost.memory_bytes.max((64 << 20) + 110 * self.cells + factors);
        self.exemplar.as_ref().map_or(texture, |site| texture + site.memory_bytes())
    }

    fn estimate(&self) -> Estimate {
        let cells = self.synthesis.geometry().len() as f64;
        // A texture that matches a fit also gets the surface statistics of its residual.
        let described =
            if self.matched.parent().is_some() && self.fill.is_none() { SECONDS_PER_DESCRIBED_CELL } else { 0.0 };
        let seconds = 0.02
            + seconds_per_operation(&self.method) * self.cost.operations
            + SECONDS_PER_WRITTEN_CELL * self.cells as f64
            + described * cells
            + self.exemplar.as_ref().map_or(0.0, |site| SECONDS_PER_DETRENDED_CELL * site.cells() as f64);
        Estimate { seconds, bytes: 3.5 * self.cells as f64 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let fit = self.matched.read(work)?;
        if let Some(dem) = &self.fill {
            return self.filled(work, dem, &fit);
        }
        let (synthesis, made) = self.made(work, &fit)?;
        let TextureOutcome { grid, covariance_error_max_m2, clip_share, notes: on_this } = made;
        let mut notes = sastrugi_texture::fit_notes(&fit);
        notes.extend(synthesis.notes().into_iter().chain(on_this));
        if self.one_of_many && synthesis.parameters()["phase"] == "unit" {
            notes.push(
                "one of several textures with unit phases, which vary too little between realisations: use phase = \"gaussian\" for a realistic spread"
                    .to_owned(),
            );
        }
        if clip_share > 0.0 && covariance_error_max_m2.is_finite() {
            notes.push(format!(
                "{clip_share:.1e} of the spectrum was negative and set to 0; the error of the covariance is at most {covariance_error_max_m2:.1e} m2"
            ));
        }
        if self.amplitude != 1.0 {
            notes.push(format!("heights scaled by {}", self.amplitude));
        }
        if self.base.as_ref().is_some_and(|base| base.was_fitted) {
            notes.push(has_its_texture("onto = { background = \"<fit id>\" }"));
        }
        // Computed before the amplitude is applied, so that it can be compared with the residual of the fit.
        let residual = self.residual(&grid, &fit);
        let grid = scaled(grid, self.amplitude);
        let (heights, crs) = match &self.base {
            None => (grid, Crs::default()),
            Some(base) => {
                let base = dem::read(&work.parent(&base.item, base.file)?).map_err(input_error)?;
                let factors = self.factors(work, &base.grid)?;
                (lay_onto(&base.grid, &grid, synthesis.is_periodic(), factors.as_ref())?, base.info.crs)
            }
        };
        let mut outcome = self.released(work, &heights, &crs, notes)?;
        if let Some(rows) = residual {
            rows.write(work, &mut outcome)?;
        }
        Ok(outcome)
    }
}

impl TextureJob {
    /// The method bound to the fit, and its texture.
    fn made(&self, work: &Work<'_>, fit: &FitFile) -> Result<(Box<dyn Synthesis>, TextureOutcome), JobError> {
        let measured = self.exemplar.as_ref().map(|site| site.residual(work)).transpose()?.map(Arc::new);
        let synthesis = self.synthesis.bind(fit, measured.as_ref()).map_err(JobError::new)?;
        let made = synthesis.generate(&self.streams).map_err(JobError::new)?;
        Ok((synthesis, made))
    }

    /// The texture without its base, detrended and trimmed like the residual of the fit, for comparison with that residual.
    fn residual(&self, texture: &Grid, fit: &FitFile) -> Option<SurfaceRows> {
        let Matched::Item(item) = &self.matched else { return None };
        let residual = sastrugi_texture::shown::texture_residual(texture, fit)?;
        let id = format!("{}.residual", self.id);
        let surface = Surface { id: &id, stage: "texture_residual", fit_id: Some(&item.id), grid: &residual };
        Some(SurfaceRows::of_residual(&surface, fit))
    }

    /// The DEM with its holes filled.
    fn filled(&self, work: &Work<'_>, dem: &ItemRef, fit: &FitFile) -> Result<Outcome, JobError> {
        let dem = dem::read(&work.parent(dem, HEIGHTS)?).map_err(input_error)?;
        let covariance = Covariance::of_fit(fit).map_err(JobError::new)?;
        let (filled, mut notes) = match needs(&self.method) {
            Some(Needs::Covariance) => (conditional::fill(&dem.grid, &covariance, &self.streams), Vec::new()),
            _ => {
                let (synthesis, made) = self.made(work, fit)?;
                let notes = notes_on_filling(synthesis.notes()).chain(made.notes).collect();
                (conditional::fill_with(&dem.grid, &covariance, &made.grid), notes)
            }
        };
        let filled = filled.map_err(JobError::new)?;
        notes.extend([filled.to_string()].into_iter().chain(fill_note(fit, &self.method)));
        self.released(work, &filled.grid, &dem.info.crs, notes)
    }

    /// The factor of the texture at each cell of its base.
    fn factors(&self, work: &Work<'_>, base: &Grid) -> Result<Option<Grid>, JobError> {
        Ok(match &self.modulation {
            None => None,
            Some(Modulation::Slope(factors)) => Some(factors.over(base)),
            Some(Modulation::Raster(raster)) => {
                let factors = raster.read(work)?.grid;
                Some(sastrugi_texture::amplitude(base, &factors).map_err(JobError::input)?)
            }
        })
    }

    fn released(&self, work: &Work<'_>, heights: &Grid, crs: &Crs, notes: Vec<String>) -> Result<Outcome, JobError> {
        dem::write(&work.output(HEIGHTS), heights, crs, &raster_options(self.geotiff)).map_err(JobError::io)?;
        let content = digest::heights(heights);
        let products = vec![Product::released(HEIGHTS, format!("texture/{}.tif", self.id), Some(content))];
        Ok(Outcome { products, notes })
    }
}
