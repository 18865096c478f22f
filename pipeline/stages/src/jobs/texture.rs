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
use sastrugi_texture::{Cost, Method, Needs, OntoError, Prospect, SlopeFactors, Synthesis, TextureOutcome, needs};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "texture";

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
    let table = Table::read(builder, entry)?;
    let (mut ids, mut costs) = (Vec::new(), Costs::new());
    for one in entry.expand(&table.item.id, table.item.count, &table.item.sweep, &table.params)? {
        let one = One::of(&table, one);
        let mut entrants = Vec::new();
        let mut refusal = None;
        for method in &table.methods {
            let (entrant, checked) = one.entrant(builder, method, &mut costs)?;
            entrants.push(entrant);
            match checked {
                Ok(checked) => ids.push(one.add(builder, method, checked)?),
                Err(error) => refusal = refusal.or(Some(error)),
            }
        }
        if let Some(error) = refusal.filter(|_| entrants.iter().all(|e| e.cost.is_none())) {
            return Err(entry.refuse(error).into());
        }
        if table.is_side_by_side() && one.expanded.replicate == 0 {
            one.add_scoreboard(builder, entrants)?;
        }
    }
    builder.name_family(entry, &table.item.id, ids)?;
    Ok(())
}

/// Costs by item without its replicate number, and by method: replicates cost the same, and to state the cost of a covariance may take a
/// transform.
type Costs = BTreeMap<(Arc<str>, String), Cost>;

/// What all items of a table share.
struct Table<'e> {
    entry: &'e Entry<'e>,
    item: TextureItem,
    /// Parameters of the methods, as they are written.
    params: Value,
    /// All methods that there are.
    kinds: Vec<Kind>,
    /// Those of this table.
    methods: Vec<String>,
    matched: Matched,
    /// What is known about the fit before the run.
    prospect: Option<Prospect>,
    /// The DEM of the fit.
    site: Option<Site>,
    bases: Vec<Base>,
    /// The DEM whose holes are filled.
    fill: Option<Heightfield>,
    modulation: Option<Modulation>,
}

impl<'e> Table<'e> {
    fn read(builder: &Builder<'_>, entry: &'e Entry<'e>) -> Result<Self, BuildError> {
        let kinds = kinds();
        let (item, params): (TextureItem, Value) = entry.read()?;
        let matched = matched(builder, entry, &item);
        let fit = matched.as_ref().ok().and_then(Matched::parent);
        let prospect = fit.as_ref().and_then(|fit| builder.prospects.get(&fit.id)).copied();
        let has_statistics = matched.is_err() || prospect.is_some_and(|fit| fit.has_statistics);
        let methods = methods(entry, &item, &kinds, has_statistics)?;
        if item.methods.is_none() {
            sastrugi_texture::check_keys(&item.method, &params).map_err(|e| entry.refuse(e))?;
        }
        entry.check_keys::<TextureItem>(&params, &joined_schema(&kinds, &methods))?;
        check_purpose(entry, &item, &params)?;
        let matched = matched?;
        let site = fit.and_then(|fit| builder.sites.get(&fit.id)).cloned();
        let bases = Base::all(builder, entry, &item, &matched)?;
        let fill = item.fill.as_deref().map(|id| builder.surface(entry, "fill", id).cloned()).transpose()?;
        let modulation = modulation(builder, entry, &item)?;
        Ok(Self { entry, item, params, kinds, methods, matched, prospect, site, bases, fill, modulation })
    }

    /// Whether methods are compared.
    fn is_side_by_side(&self) -> bool {
        self.item.methods.is_some()
    }

    /// A name, followed by that of the method if several are compared.
    fn named(&self, name: &str, method: &str) -> String {
        if self.is_side_by_side() { format!("{name}-{}", method.replace('_', "-")) } else { name.to_owned() }
    }

    /// The DEM of the fit, if the method copies from its residual.
    fn exemplar_of(&self, method: &str) -> Option<Site> {
        self.site.clone().filter(|_| needs(method) == Some(Needs::Residual))
    }
}

/// One item of a table, at which each of its methods makes a texture.
struct One<'t> {
    table: &'t Table<'t>,
    expanded: Expanded,
    base: Option<&'t Base>,
}

/// A method that accepts the parameters of an item.
struct Checked {
    synthesis: Box<dyn Method>,
    cost: Cost,
}

impl<'t> One<'t> {
    fn of(table: &'t Table<'t>, expanded: Expanded) -> Self {
        let base = table.bases.get(expanded.replicate as usize).or(table.bases.first());
        Self { table, expanded: on_background(expanded, base, &table.matched, &table.item), base }
    }

    /// A method with its parameters, and whether it accepts them.
    fn entrant(
        &self,
        builder: &mut Builder<'_>,
        method: &str,
        costs: &mut Costs,
    ) -> Result<(Entrant, Result<Checked, ParameterError>), StudyError> {
        let mut parameters = self.parameters(method)?;
        let states_size = states_size(&parameters);
        let checked = self.synthesis(method, &mut parameters).and_then(|synthesis| {
            self.check(method, synthesis.as_ref())?;
            let cost = self.cost(builder, method, synthesis.as_ref(), costs)?;
            Ok(Checked { synthesis, cost })
        });
        if let Some(Checked { synthesis, .. }) = checked.as_ref().ok().filter(|_| states_size) {
            self.doubt_size(builder, &synthesis.geometry());
        }
        let cost = checked.as_ref().ok().map(|checked| checked.cost);
        Ok((Entrant { method: method.to_owned(), parameters, cost }, checked))
    }

    /// The parameters of a method. Cells that are not stated are those of the site or of the DEM that is filled, where the method has no others.
    fn parameters(&self, method: &str) -> Result<Value, StudyError> {
        let Table { entry, kinds, prospect, fill, .. } = self.table;
        let params = &self.expanded.params;
        let mut own = match self.table.is_side_by_side() {
            true => own_parameters(params, kinds, method),
            false => Value::clone(params),
        };
        on_site_cells(method, &mut own, prospect.and_then(|fit| fit.cell_m));
        if let Some(dem) = fill.as_ref().filter(|_| needs(method) != Some(Needs::Covariance)) {
            on_cells_of(dem, &mut own).map_err(|message| entry.error("fill", message))?;
        }
        Ok(own)
    }

    /// The method with these parameters, to which those that follow from the base are added.
    fn synthesis(&self, method: &str, own: &mut Value) -> Result<Box<dyn Method>, ParameterError> {
        match self.place() {
            Some(place) => on_base(&place, method, own),
            None => sastrugi_texture::method(method, own),
        }
    }

    /// Geometry of the base, if it is known before the run. Methods that are compared keep the default size and cells, on which the scoreboard
    /// compares them.
    fn place(&self) -> Option<Geometry> {
        self.base.and_then(|base| base.expected).filter(|_| !self.table.is_side_by_side())
    }

    /// Refuses a texture that is known before the run to fail.
    fn check(&self, method: &str, synthesis: &dyn Method) -> Result<(), ParameterError> {
        let Table { prospect, fill, .. } = self.table;
        // When methods are compared, the scoreboard lists those that fail; filling a DEM does not use a tile.
        if !self.table.is_side_by_side() && fill.is_none() {
            return check_before_run(prospect.as_ref(), self.base, method, synthesis);
        }
        match prospect.filter(|_| needs(method) != Some(Needs::Covariance)) {
            Some(fit) => synthesis.check_prospect(&fit),
            None => Ok(()),
        }
    }

    fn cost(
        &self,
        builder: &Builder<'_>,
        method: &str,
        synthesis: &dyn Method,
        costs: &mut Costs,
    ) -> Result<Cost, ParameterError> {
        let alike = (Arc::clone(&self.expanded.part), method.to_owned());
        if let Some(known) = costs.get(&alike) {
            return Ok(*known);
        }
        let cost = self.table.matched.cost(synthesis, &builder.prospects)?;
        costs.insert(alike, cost);
        Ok(cost)
    }

    /// Tells, once, that the stated size of a texture is not that of its base.
    fn doubt_size(&self, builder: &mut Builder<'_>, stated: &Geometry) {
        let Some(doubt) = self.place().and_then(|place| size_doubt(&place, stated)) else { return };
        let doubt = format!("texture \"{}\": {doubt}", self.table.item.id);
        if !builder.doubts.contains(&doubt) {
            builder.doubts.push(doubt);
        }
    }

    /// Adds the texture of a method; returns its id.
    fn add(&self, builder: &mut Builder<'_>, method: &str, checked: Checked) -> Result<String, StudyError> {
        let (table, item) = (self.table, &self.table.item);
        let id = table.named(&self.expanded.id, method);
        builder.claim(table.entry, STAGE, &id)?;
        let streams = builder.streams(STAGE, &id, item.seed, self.expanded.replicate);
        let field = self.field(&id, method, checked.synthesis.as_ref(), &streams);
        let job = TextureJob {
            id: id.clone(),
            matched: table.matched.clone(),
            base: self.base.cloned(),
            amplitude: item.amplitude,
            modulation: table.modulation.clone(),
            fill: table.fill.as_ref().map(|dem| dem.item.clone()),
            exemplar: table.exemplar_of(method),
            method: method.to_owned(),
            synthesis: checked.synthesis,
            cost: checked.cost,
            one_of_many: item.count.is_some_and(|count| count > 1),
            cells: field.cells,
            streams,
            geotiff: builder.study.head.geotiff,
        };
        let (parents, stream) = (job.parents(), field.stream());
        builder.node(Node { item: field.item.clone(), parents, inputs: Vec::new(), stream, job: Box::new(job) })?;
        builder.heightfields.insert(id.clone(), field);
        Ok(id)
    }

    /// The heightfield that a method makes. On a base, or where it fills a DEM, it has the cells of that.
    fn field(&self, id: &str, method: &str, synthesis: &dyn Method, streams: &Streams) -> Heightfield {
        let Table { item, matched, bases, fill, .. } = self.table;
        let Expanded { replicate, sweep, .. } = &self.expanded;
        let tile = synthesis.geometry();
        let (cells, geometry, expected) = match (self.base, fill.as_ref()) {
            (Some(base), _) => (base.cells, None, base.expected),
            (None, Some(dem)) => (dem.cells, None, dem.expected),
            (None, None) => (tile.len() as u64, Some(tile), Some(tile)),
        };
        let own_base = self.base.filter(|_| bases.len() > 1);
        Heightfield {
            item: ItemRef::new(STAGE, id),
            group: item.group.clone().or_else(|| sweep.clone()).or(Some(self.table.named(&item.id, method))),
            is_grouped: item.group.is_some() || sweep.is_some(),
            variant: sweep.clone().filter(|_| item.group.is_some()),
            replicate: Some(*replicate),
            kind: method.to_owned(),
            parameters: Arc::new(parameters(item, own_base, matched, synthesis)),
            streams: Some(streams.clone()),
            release_path: format!("texture/{id}.tif"),
            cells,
            raster_cells: None,
            cell_m: Some(tile.cell.into_iter().fold(f64::INFINITY, f64::min)),
            geometry,
            expected,
        }
    }

    /// Adds the scoreboard of the methods.
    fn add_scoreboard(&self, builder: &mut Builder<'_>, entrants: Vec<Entrant>) -> Result<(), StudyError> {
        let (table, id) = (self.table, &self.expanded.id);
        builder.claim(table.entry, scoreboard::STAGE, id)?;
        let exemplar = entrants.iter().filter(|e| e.cost.is_some()).find_map(|e| table.exemplar_of(&e.method));
        let parents: BTreeSet<ItemRef> =
            table.matched.parent().into_iter().chain(exemplar.iter().flat_map(Site::parents)).collect();
        let streams = builder.streams(STAGE, id, table.item.seed, self.expanded.replicate);
        let stream = Some(streams.label());
        let job = ScoreboardJob {
            id: id.clone(),
            matched: table.matched.clone(),
            entrants,
            realisations: table.item.realisations,
            exemplar,
            streams,
        };
        let (item, parents) = (ItemRef::new(scoreboard::STAGE, id), parents.into_iter().collect());
        builder.node(Node { item, parents, inputs: Vec::new(), stream, job: Box::new(job) })
    }
}

/// Sets the cells of a texture to those of the DEM whose holes it fills.
fn on_cells_of(dem: &Heightfield, parameters: &mut Value) -> Result<(), String> {
    let Some(Geometry { rows, cols, cell, .. }) = dem.expected else {
        return Err(format!(
            "the cells of \"{}\" are not known before the run, but a texture that repeats a site needs them; convert it to GeoTIFF, or fill \
             with `fft_ma`",
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
    method: &str,
    synthesis: &dyn Method,
) -> Result<(), ParameterError> {
    prospect.map_or(Ok(()), |fit| synthesis.check_prospect(fit))?;
    let Some(place) = base.and_then(|base| base.expected) else { return Ok(()) };
    let geometry = synthesis.geometry();
    sastrugi_texture::check_cells(place.cell, geometry.cell)
        .map_err(|error| other_cells(&error, method, prospect.and_then(|fit| fit.cell_m)))?;
    let key = if synthesis.parameters()["size_px"].is_null() { "size_m" } else { "size_px" };
    match uncovered(&place, &geometry).filter(|_| !synthesis.is_periodic()) {
        Some(why) => Err(ParameterError::new(key, format!("is too small: {why}, or leave out `{key}`"))),
        None => Ok(()),
    }
}

/// The error for cells that are not those of the base. A method that repeats a site makes no others than the site's, whether they are stated or not.
fn other_cells(error: &OntoError, method: &str, site_m: Option<[f64; 2]>) -> ParameterError {
    match site_m.filter(|_| needs(method) != Some(Needs::Covariance)) {
        Some(_) => {
            let message = format!(
                "does not match the site: {error} with a method such as `fft_ma` (`{method}` works only on the cells of the site), or \
                 resample the base"
            );
            ParameterError::new("onto", message)
        }
        None => ParameterError::new("cell_m", format!("does not match `onto`: {error}, or leave out `cell_m`")),
    }
}

/// On a measured DEM or the background of a fit, a texture defaults to the covariance of the residual, which such a base lacks.
fn on_background(mut one: Expanded, base: Option<&Base>, matched: &Matched, item: &TextureItem) -> Expanded {
    let measured = base.is_some_and(|base| [dem_job::STAGE, fit::STAGE].contains(&base.item.stage.as_str()));
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
            "`fill` cannot be combined with `onto` or `methods`, and needs `fft_ma` or a method that repeats the site";
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
    let most = TextureItem::REALISATIONS_MAX;
    if item.realisations == 0 || item.realisations > most {
        let message = format!("`realisations` is {}; it must lie in 1 to {most}", item.realisations);
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
        let is_periodic = synthesis.is_periodic();
        // It may hold a spectrum.
        drop(synthesis);
        // Computed before the amplitude is applied, so that it can be compared with the residual of the fit.
        let residual = self.residual(&grid, &fit);
        let grid = scaled(grid, self.amplitude);
        let (heights, crs) = match &self.base {
            None => (grid, Crs::default()),
            Some(base) => {
                let base = dem::read(&work.parent(&base.item, base.file)?).map_err(input_error)?;
                let factors = self.factors(work, &base.grid)?;
                (lay_onto(&base.grid, &grid, is_periodic, factors.as_ref())?, base.info.crs)
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
    /// The items whose artifacts it reads.
    fn parents(&self) -> Vec<ItemRef> {
        let raster = match &self.modulation {
            Some(Modulation::Raster(raster)) => Some(raster.item.clone()),
            _ => None,
        };
        let others = [self.matched.parent(), self.fill.clone(), raster].into_iter().flatten();
        let of_site = self.exemplar.iter().flat_map(Site::parents);
        let all: BTreeSet<ItemRef> = others.chain(of_site).chain(self.base.iter().flat_map(Base::parents)).collect();
        all.into_iter().collect()
    }

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
