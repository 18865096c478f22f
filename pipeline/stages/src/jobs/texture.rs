//! Stage `texture`: a field that matches a fit, alone or on a base heightfield.

use super::dem::{HEIGHTS, input_error};
use super::surface::{Surface, describe_residual};
use super::{Estimate, ItemRef, Job, JobError, Outcome, Product, Rows, Work, fit};
use crate::registry::{BuildError, Builder, Heightfield, unknown_id};
use crate::revision::Room;
use crate::runner::graph::Node;
use sastrugi_numeric::{Grid, Streams};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::study::TextureItem;
use sastrugi_schemas::{Kind, ParameterError};
use sastrugi_store::dem::{self, Crs};
use sastrugi_store::digest;
use sastrugi_texture::{Synthesis, TextureOutcome};
use serde_json::{Map, Value, json};

/// Name of the stage.
pub const STAGE: &str = "texture";

/// Synthesis methods.
pub fn kinds() -> Vec<Kind> {
    sastrugi_texture::kinds().into_iter().filter(|k| k.family == "texture").collect()
}

struct TextureJob {
    id: String,
    fit: ItemRef,
    base: Option<ItemRef>,
    method: String,
    /// Prepared with a stand-in fit: shape, memory and parameters do not depend on the fit's numbers.
    draft: Box<dyn Synthesis>,
    streams: Streams,
}

/// Adds the items of `[[texture]]`.
///
/// # Errors
/// A wrong item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    let kinds = kinds();
    for entry in builder.study.entries(STAGE)? {
        let (item, params): (TextureItem, Value) = entry.read()?;
        if let Some(kind) = kinds.iter().find(|k| k.kind == item.method) {
            entry.check_keys::<TextureItem>(&params, &kind.parameters)?;
        }
        if !builder.fits.contains(&item.fit) {
            return Err(unknown_id(&entry, "fit", &item.fit, builder.fits.iter()).into());
        }
        let base_cells = item.onto.as_ref().and_then(|id| builder.heightfields.get(id)).map(|f| f.cells);
        let base = match &item.onto {
            None => None,
            Some(id) => match builder.heightfields.get(id) {
                Some(field) => Some(field.item.clone()),
                None => return Err(unknown_id(&entry, "onto", id, builder.heightfields.keys()).into()),
            },
        };
        let expanded = entry.expand(&item.id, item.count, &item.sweep, &params)?;
        let ids = expanded.iter().map(|e| e.id.clone()).collect();
        for one in expanded {
            builder.claim(&entry, STAGE, &one.id)?;
            let draft = draft(&item.method, &one.params).map_err(|e| entry.refuse(e))?;
            let streams = builder.streams(STAGE, &one.id, item.seed, one.replicate);
            let field = Heightfield {
                item: ItemRef::new(STAGE, &one.id),
                group: item.group.clone().or(one.sweep_group),
                kind: item.method.clone(),
                parameters: parameters(&item, draft.as_ref()),
                stream: Some(streams.label()),
                release_path: format!("texture/{}.tif", one.id),
                cells: base_cells.unwrap_or(draft.geometry().len() as u64),
            };
            let fit = ItemRef::new(fit::STAGE, &item.fit);
            let parents = [fit.clone()].into_iter().chain(base.clone()).collect();
            let method = item.method.clone();
            let job = TextureJob { id: one.id.clone(), fit, base: base.clone(), method, draft, streams };
            let stream = field.stream.clone();
            let node = Node { item: field.item.clone(), parents, inputs: Vec::new(), stream, job: Box::new(job) };
            builder.node(&entry, node)?;
            builder.heightfield(&entry, &one.id, field)?;
        }
        builder.families.insert(item.id, ids);
    }
    Ok(())
}

/// The method with its parameters checked against a stand-in fit.
fn draft(method: &str, params: &Value) -> Result<Box<dyn Synthesis>, ParameterError> {
    let parameters = [("sigma_m".to_owned(), 1.0), ("range_m".to_owned(), 1.0)].into();
    let height_quantiles_m = vec![-1.0, 1.0];
    let fit = FitFile { model: "exponential".to_owned(), parameters, height_quantiles_m, ..FitFile::default() };
    sastrugi_texture::prepare(method, params, &fit)
}

/// What the table `terrains` says of a texture.
fn parameters(item: &TextureItem, draft: &dyn Synthesis) -> Value {
    let mut all = Map::new();
    all.insert("fit".to_owned(), json!(item.fit));
    if let Some(onto) = &item.onto {
        all.insert("onto".to_owned(), json!(onto));
    }
    if let Value::Object(own) = draft.parameters() {
        all.extend(own);
    }
    Value::Object(all)
}

/// Base plus texture; a texture that does not repeat without seams must cover the base.
///
/// # Errors
/// Cell sizes that differ, or a base larger than such a texture.
pub fn lay_onto(base: &Grid, texture: &Grid, parameters: &Value) -> Result<Grid, JobError> {
    let larger = base.rows() > texture.rows() || base.cols() > texture.cols();
    if larger && parameters["periodic"] == json!(false) {
        return Err(JobError::new(format!(
            "the base of {} x {} cells is larger than the texture of {} x {}, which does not repeat without seams; make the \
             texture larger or periodic",
            base.rows(),
            base.cols(),
            texture.rows(),
            texture.cols()
        )));
    }
    sastrugi_texture::onto(base, texture).map_err(JobError::new)
}

impl TextureJob {
    /// The texture, without its base, detrended and trimmed as the fit's residual was: what that residual is compared with.
    fn alike(&self, texture: &Grid, fit: &FitFile) -> Rows {
        let Some(residual) = sastrugi_texture::shown::alike(texture, fit) else { return Rows::default() };
        let id = format!("{}.residual", self.id);
        let surface = Surface { id: &id, stage: "alike", fit_id: Some(&self.fit.id), grid: &residual };
        describe_residual(&surface, fit)
    }
}

impl Job for TextureJob {
    fn recipe(&self) -> Value {
        let base = self.base.as_ref().map(ToString::to_string);
        json!({ "method": self.method, "params": self.draft.parameters(), "fit": self.fit.id, "onto": base })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Roughness, Room::Statistics, Room::Texture]
    }

    fn memory_bytes(&self) -> u64 {
        // The texture, and what describes it once it is detrended as the fit's residual was.
        self.draft.memory_bytes().max((64 << 20) + 110 * self.draft.geometry().len() as u64)
    }

    fn estimate(&self) -> Estimate {
        let cells = self.draft.geometry().len() as f64;
        Estimate { seconds: 0.02 + 3e-7 * cells, bytes: 3.5 * cells }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let bytes = std::fs::read(work.parent(&self.fit, fit::FIT)?).map_err(JobError::new)?;
        let fit: FitFile = serde_json::from_slice(&bytes).map_err(JobError::new)?;
        let synthesis =
            sastrugi_texture::prepare(&self.method, &self.draft.parameters(), &fit).map_err(JobError::new)?;
        let TextureOutcome { grid, covariance_error_max_m2, clip_share } =
            synthesis.generate(&self.streams).map_err(JobError::new)?;
        let mut notes = synthesis.notes();
        if clip_share > 0.0 {
            notes.push(format!(
                "{clip_share:.1e} of the spectrum was negative and set to 0; the covariance is off by at most {covariance_error_max_m2:.1e} m2"
            ));
        }
        let rows = self.alike(&grid, &fit);
        let (heights, crs) = match &self.base {
            None => (grid, Crs::default()),
            Some(base) => {
                let base = dem::read(&work.parent(base, HEIGHTS)?).map_err(|e| input_error(&e))?;
                (lay_onto(&base.grid, &grid, &synthesis.parameters())?, base.info.crs)
            }
        };
        dem::write(&work.output(HEIGHTS), &heights, &crs, &Default::default()).map_err(JobError::new)?;
        let content = digest::heights(&heights);
        let products = vec![Product::released(HEIGHTS, format!("texture/{}.tif", self.id), Some(content))];
        Ok(Outcome { products, rows, notes })
    }
}
