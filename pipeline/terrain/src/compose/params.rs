//! Parameters of a composition.

use super::trail::{RawTrail, Trail};
use crate::generator::{Generator, NamedInput};
use crate::size::{MIN_SIDE_PX, Size};
use sastrugi_numeric::Geometry;
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

/// Cells if no size is given.
const DEFAULT_SIZE_PX: [u32; 2] = [512, 512];
/// Maximum number of processes of one surface.
const PROCESSES_MAX: usize = 64;
/// Keys that the composition sets for the generators of its processes.
pub(super) const COMMON: [&str; 4] = ["size_m", "size_px", "cell_m", "origin_m"];

/// Surfaces combined by an ordered list of processes.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawCompose {
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Number of cells east and north; 512 x 512 if no size is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Side of a cell, m.
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// South-west corner, m, in the coordinates of the study's surfaces that are used as operands.
    pub origin_m: [f64; 2],
    /// The processes, in order; by default hills with a rough surface added.
    #[schemars(length(min = 1, max = PROCESSES_MAX))]
    pub processes: Vec<RawProcess>,
}

impl Default for RawCompose {
    fn default() -> Self {
        let add = |kind: &str, parameters: Value| RawProcess {
            kind: Some(kind.to_owned()),
            parameters: parameters.as_object().cloned().unwrap_or_default(),
            ..RawProcess::default()
        };
        let hills = add("spheroids", json!({ "preset": "rough", "major_max_px": 60, "minor_max_px": 20 }));
        let rough = add("weierstrass_mandelbrot", json!({ "fractal_dimension": 2.3, "sampling_length_m": 25.0 }));
        let scale = |relief_m| RawProcess {
            operation: Operation::ScaleToRelief,
            relief_m: Some(relief_m),
            ..RawProcess::default()
        };
        let processes = vec![hills, RawProcess { factor: 2.0, ..rough }, scale(3.0)];
        Self { size_m: None, size_px: None, cell_m: 0.1, origin_m: [0.0; 2], processes }
    }
}

/// What a process does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Operation {
    /// The operand is added.
    #[default]
    Add,
    /// Heights are multiplied by the operand.
    Multiply,
    /// The operand replaces the heights, by the weight of the region.
    Blend,
    /// Heights are kept inside the region and become `outside_m` elsewhere.
    Mask,
    /// Heights are limited to two bounds.
    Clip,
    /// Heights are scaled to a relief.
    ScaleToRelief,
    /// A vehicle trail is pressed into the heights.
    Trail,
}

/// One process.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, expecting = "a process, given as a table")]
pub struct RawProcess {
    /// What the process does; `add` by default.
    pub operation: Operation,
    /// Generator of the operand (see `sastrugi kinds`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// Parameters of that generator, except size, cell and origin, which the composition sets.
    #[serde(skip_serializing_if = "Map::is_empty")]
    pub parameters: Map<String, Value>,
    /// Id of a DEM or an earlier terrain of the study; alternative to `kind`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Factor of the operand; 1 by default.
    #[serde(skip_serializing_if = "is_one")]
    pub factor: f64,
    /// Where the process takes effect; everywhere by default. For `mask`, where heights are kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub region: Option<RawRegion>,
    /// For `mask`: height outside the region, m; 0 by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outside_m: Option<f64>,
    /// For `clip`: lower bound of the heights, m; by default none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub low_m: Option<f64>,
    /// For `clip`: upper bound of the heights, m; by default none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub high_m: Option<f64>,
    /// For `scale_to_relief`: highest minus lowest height, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub relief_m: Option<f64>,
    /// For `trail`: course and shape of the trail; along ridges by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trail: Option<RawTrail>,
}

impl Default for RawProcess {
    fn default() -> Self {
        Self {
            operation: Operation::Add,
            kind: None,
            parameters: Map::new(),
            of: None,
            factor: 1.0,
            region: None,
            outside_m: None,
            low_m: None,
            high_m: None,
            relief_m: None,
            trail: None,
        }
    }
}

fn is_one(factor: &f64) -> bool {
    *factor == 1.0
}

/// Where a process takes effect, defined by the values of a surface.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a region, given as a table")]
pub struct RawRegion {
    /// Generator of that surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// Parameters of that generator, as in a process.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub parameters: Map<String, Value>,
    /// Id of a DEM or an earlier terrain of the study; alternative to `kind`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Value at which the weight starts to rise from 0.
    pub from: f64,
    /// Value at which the weight reaches 1.
    pub to: f64,
}

/// The surface that a process or a region uses.
pub(super) enum Operand {
    /// A generator on the same cells, and the key of its parameters.
    Generator { generator: Box<dyn Generator>, key: String },
    /// Another surface.
    Surface(NamedInput),
}

/// A checked region.
pub(super) struct Region {
    pub(super) operand: Operand,
    pub(super) from: f64,
    pub(super) to: f64,
}

/// How an operand is combined with the heights.
#[derive(Clone, Copy)]
pub(super) enum Join {
    Add,
    Multiply,
    Blend,
}

/// What a process does.
pub(super) enum Step {
    Join { join: Join, operand: Operand, factor: f64, region: Option<Region> },
    Mask { region: Region, outside_m: f64 },
    Clip { low_m: f64, high_m: f64 },
    ScaleToRelief { relief_m: f64 },
    Trail(Box<Trail>),
}

/// A checked process.
pub(super) struct Process {
    pub(super) step: Step,
}

impl Process {
    /// Operand and region, in the order in which they are generated.
    pub(super) fn operands(&self) -> Vec<&Operand> {
        self.parts().into_iter().map(|(_, operand)| operand).collect()
    }

    fn parts(&self) -> Vec<(Part, &Operand)> {
        match &self.step {
            Step::Join { operand, region, .. } => {
                let region = region.as_ref().map(|r| (Part::Region, &r.operand));
                std::iter::once((Part::Operand, operand)).chain(region).collect()
            }
            Step::Mask { region, .. } => vec![(Part::Region, &region.operand)],
            Step::Clip { .. } | Step::ScaleToRelief { .. } | Step::Trail(_) => Vec::new(),
        }
    }
}

/// Role of a generator in its process.
#[derive(Clone, Copy)]
pub(super) enum Part {
    Operand,
    Region,
}

impl Part {
    /// A note of the generator alone, which need not hold for the composition. Processes count from 1.
    pub(super) fn note(self, number: usize, note: &str) -> String {
        match self {
            Self::Operand => format!("process {number} alone: {note}"),
            Self::Region => format!("region of process {number} alone: {note}"),
        }
    }
}

/// Checked parameters of a composition.
pub struct Compose {
    pub(super) geometry: Geometry,
    pub(super) processes: Vec<Process>,
    pub(super) parameters: Value,
    pub(super) notes: Vec<String>,
}

impl TryFrom<RawCompose> for Compose {
    type Error = ParameterError;

    fn try_from(raw: RawCompose) -> Result<Self, ParameterError> {
        let size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        if !raw.origin_m.iter().all(|o| o.is_finite()) {
            return Err(ParameterError::new("origin_m", "must be two finite numbers"));
        }
        check_count(&raw.processes)?;
        let whole = Whole { size, origin_m: raw.origin_m };
        let mut processes = Vec::new();
        for (k, process) in raw.processes.iter().enumerate() {
            let key = format!("processes.{k}");
            let step = whole.step(&key, process).map_err(|e| e.within(&key))?;
            processes.push(Process { step });
        }
        let geometry = Geometry { origin: raw.origin_m, ..size.geometry() };
        let raw = RawCompose { size_m: None, size_px: Some(size.px), ..raw };
        let mut parameters = serde_json::to_value(&raw).unwrap_or_default();
        fill_in(&mut parameters, &processes);
        let notes = notes(&size, &processes);
        Ok(Self { geometry, processes, parameters, notes })
    }
}

/// The cells of the composition, common to all processes.
struct Whole {
    size: Size,
    origin_m: [f64; 2],
}

impl Whole {
    fn step(&self, at: &str, raw: &RawProcess) -> Result<Step, ParameterError> {
        refuse_foreign_keys(raw)?;
        let region = raw.region.as_ref().map(|region| self.region(at, region).map_err(|e| e.within("region")));
        let region = region.transpose()?;
        match (raw.operation, region) {
            (Operation::Add, region) => self.join(at, Join::Add, raw, region),
            (Operation::Multiply, region) => self.join(at, Join::Multiply, raw, region),
            (Operation::Blend, region) => self.join(at, Join::Blend, raw, region),
            (Operation::Mask, Some(region)) => {
                Ok(Step::Mask { region, outside_m: finite("outside_m", raw.outside_m.unwrap_or(0.0))? })
            }
            (Operation::Mask, None) => {
                Err(ParameterError::new("region", "is missing; `mask` needs a region in which heights are kept"))
            }
            (Operation::Clip, _) => clip(raw),
            (Operation::ScaleToRelief, _) => {
                let relief_m = raw.relief_m.ok_or_else(|| {
                    let message = "is missing; `scale_to_relief` needs the relief, highest minus lowest height, in m";
                    ParameterError::new("relief_m", message)
                })?;
                Ok(Step::ScaleToRelief { relief_m: ParameterError::positive("relief_m", relief_m)? })
            }
            (Operation::Trail, _) => {
                let geometry = Geometry { origin: self.origin_m, ..self.size.geometry() };
                let trail = Trail::new(&raw.trail.clone().unwrap_or_default(), &geometry);
                Ok(Step::Trail(Box::new(trail.map_err(|e| e.within("trail"))?)))
            }
        }
    }

    fn join(&self, at: &str, join: Join, raw: &RawProcess, region: Option<Region>) -> Result<Step, ParameterError> {
        let operand = self.operand(at, raw.kind.as_deref(), &raw.parameters, raw.of.as_deref())?;
        let factor = finite("factor", raw.factor)?;
        Ok(Step::Join { join, operand, factor, region })
    }

    fn region(&self, at: &str, raw: &RawRegion) -> Result<Region, ParameterError> {
        let at = format!("{at}.region");
        let operand = self.operand(&at, raw.kind.as_deref(), &raw.parameters, raw.of.as_deref())?;
        let (from, to) = (finite("from", raw.from)?, finite("to", raw.to)?);
        if from == to {
            let message =
                format!("is {to}, the same as `from`; the weight rises between two values, which must differ");
            return Err(ParameterError::new("to", message));
        }
        Ok(Region { operand, from, to })
    }

    fn operand(
        &self,
        at: &str,
        kind: Option<&str>,
        parameters: &Map<String, Value>,
        of: Option<&str>,
    ) -> Result<Operand, ParameterError> {
        match (kind, of) {
            (Some(kind), None) => {
                let generator = self.generator(kind, parameters)?;
                Ok(Operand::Generator { generator, key: format!("{at}.parameters") })
            }
            (None, Some(_)) if !parameters.is_empty() => Err(ParameterError::new(
                "parameters",
                "belong to a generator; a surface named by `of` has no parameters",
            )),
            (None, Some(id)) => Ok(Operand::Surface(NamedInput::heights(&format!("{at}.of"), id))),
            (None, None) => {
                Err(ParameterError::new("kind", "is missing; name a generator here, or a surface with `of`"))
            }
            (Some(_), Some(_)) => Err(ParameterError::new("of", "conflicts with `kind`; give only one of them")),
        }
    }

    /// A generator on the cells of the composition.
    fn generator(&self, kind: &str, parameters: &Map<String, Value>) -> Result<Box<dyn Generator>, ParameterError> {
        if let Some(key) = COMMON.into_iter().find(|key| parameters.contains_key(*key)) {
            let message = "is set by the composition as a whole; leave it out here";
            return Err(ParameterError::new(key, message).within("parameters"));
        }
        let mut all = parameters.clone();
        all.insert("size_px".to_owned(), json!(self.size.px));
        all.insert("cell_m".to_owned(), json!(self.size.cell_m));
        if crate::registry::has_parameter(kind, "origin_m") {
            all.insert("origin_m".to_owned(), json!(self.origin_of(kind)));
        }
        let generator = crate::prepare(kind, &Value::Object(all)).map_err(|e| match e.key.as_str() {
            "kind" => e,
            key if COMMON.contains(&key) => {
                let message = format!("is `{kind}`, which cannot use the `{key}` of the composition: it {}", e.message);
                ParameterError::new("kind", message)
            }
            _ => e.within("parameters"),
        })?;
        self.check_cells(kind, &generator.geometry())?;
        Ok(generator)
    }

    /// The `origin_m` of a generator. `elaborate` uses a DEM in the study's coordinates, and its origin is the sample in the
    /// centre of the south-western cell; worlds of `planetary` have their own coordinates.
    fn origin_of(&self, kind: &str) -> [f64; 2] {
        let half = if kind == crate::elaborate::KIND { 0.5 * self.size.cell_m } else { 0.0 };
        self.origin_m.map(|at| at + half)
    }

    /// Published listings may choose their own cells.
    fn check_cells(&self, kind: &str, own: &Geometry) -> Result<(), ParameterError> {
        let whole = self.size.geometry();
        if (own.rows, own.cols, own.cell) == (whole.rows, whole.cols, whole.cell) {
            return Ok(());
        }
        let message = format!(
            "make `{kind}` choose {} x {} cells of {} m instead of {} x {} of {} m; define it as a separate terrain and use `of`",
            own.cols, own.rows, own.cell[0], whole.cols, whole.rows, whole.cell[0]
        );
        Err(ParameterError::new("parameters", message))
    }
}

fn check_count(processes: &[RawProcess]) -> Result<(), ParameterError> {
    let refuse = |message: String| Err(ParameterError::new("processes", message));
    match processes.first().map(|p| p.operation) {
        None => refuse("is empty; it needs at least one process".to_owned()),
        Some(Operation::Add | Operation::Blend) if processes.len() <= PROCESSES_MAX => Ok(()),
        Some(Operation::Add | Operation::Blend) => {
            refuse(format!("has {} entries; at most {PROCESSES_MAX} are allowed", processes.len()))
        }
        Some(_) => refuse("starts from heights of 0 m everywhere; its first entry must be `add` or `blend`".to_owned()),
    }
}

/// Refuses keys of other operations, which would have no effect.
fn refuse_foreign_keys(raw: &RawProcess) -> Result<(), ParameterError> {
    let joins = matches!(raw.operation, Operation::Add | Operation::Multiply | Operation::Blend);
    let masks = raw.operation == Operation::Mask;
    let given = [
        ("kind", raw.kind.is_some(), joins),
        ("parameters", !raw.parameters.is_empty(), joins),
        ("of", raw.of.is_some(), joins),
        ("factor", !is_one(&raw.factor), joins),
        ("region", raw.region.is_some(), joins || masks),
        ("outside_m", raw.outside_m.is_some(), masks),
        ("low_m", raw.low_m.is_some(), raw.operation == Operation::Clip),
        ("high_m", raw.high_m.is_some(), raw.operation == Operation::Clip),
        ("relief_m", raw.relief_m.is_some(), raw.operation == Operation::ScaleToRelief),
        ("trail", raw.trail.is_some(), raw.operation == Operation::Trail),
    ];
    match given.into_iter().find(|(_, given, taken)| *given && !*taken) {
        Some((key, ..)) => {
            let operation = json!(raw.operation);
            let operation = operation.as_str().unwrap_or_default();
            Err(ParameterError::new(key, format!("is not used by the operation `{operation}`; remove it")))
        }
        None => Ok(()),
    }
}

fn clip(raw: &RawProcess) -> Result<Step, ParameterError> {
    let low_m = raw.low_m.map_or(Ok(f64::NEG_INFINITY), |v| finite("low_m", v))?;
    let high_m = raw.high_m.map_or(Ok(f64::INFINITY), |v| finite("high_m", v))?;
    if raw.low_m.is_none() && raw.high_m.is_none() {
        return Err(ParameterError::new("low_m", "is missing, and so is `high_m`; `clip` needs at least one of them"));
    }
    if low_m < high_m {
        Ok(Step::Clip { low_m, high_m })
    } else {
        Err(ParameterError::new("low_m", format!("is {low_m}; it must lie below `high_m`, {high_m}")))
    }
}

fn finite(key: &str, value: f64) -> Result<f64, ParameterError> {
    if value.is_finite() { Ok(value) } else { Err(ParameterError::new(key, format!("is {value}; it must be finite"))) }
}

/// Notes of the composition and its generators before they run; a rounded size is noted only once.
fn notes(size: &Size, processes: &[Process]) -> Vec<String> {
    let mut notes: Vec<String> = size.note().into_iter().collect();
    for (k, process) in processes.iter().enumerate() {
        if let Step::Trail(trail) = &process.step {
            notes.extend(trail.note(size.cell_m).map(|note| format!("process {}: {note}", k + 1)));
        }
        for (part, operand) in process.parts() {
            let Operand::Generator { generator, .. } = operand else { continue };
            let own = generator.notes().into_iter().filter(|note| size.note().as_ref() != Some(note));
            notes.extend(own.map(|note| part.note(k + 1, &note)));
        }
    }
    notes
}

/// Writes the full checked parameters of the generators and trails into the raw ones.
fn fill_in(parameters: &mut Value, processes: &[Process]) {
    for (k, process) in processes.iter().enumerate() {
        if let (Step::Trail(trail), Some(raw)) = (&process.step, parameters.pointer_mut(&format!("/processes/{k}"))) {
            raw["trail"] = json!(trail.parameters);
        }
    }
    for operand in processes.iter().flat_map(Process::operands) {
        let Operand::Generator { generator, key } = operand else { continue };
        let pointer = format!("/{}", key.replace('.', "/"));
        let Some((parent, _)) = pointer.rsplit_once('/') else { continue };
        if let Some(process) = parameters.pointer_mut(parent) {
            let mut own = generator.parameters();
            if let Some(own) = own.as_object_mut() {
                own.retain(|key, _| !COMMON.contains(&key.as_str()));
            }
            process["parameters"] = own;
        }
    }
}
