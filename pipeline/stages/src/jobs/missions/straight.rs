//! Straight missions drawn on the closed class map of each heightfield.

use super::{MISSIONS, STAGE};
use crate::builder::{BuildError, Builder, common};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::jobs::roughness;
use crate::operations::dem::input_error;
use crate::operations::drawn::{Drawn, Lines};
use crate::operations::room::{self, Lack};
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::Entry;
use sastrugi_mobility::missions::{
    MissionError, MissionParameters, MissionSettings, StartCells, check_size, draw_missions,
};
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_roughness::shares;
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::MissionsItem;
use sastrugi_store::dem;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Description of this kind of missions.
pub fn kind() -> Kind {
    Kind {
        family: "missions",
        kind: "straight",
        summary: "straight lines of equal length with random start and heading, from low roughness to low or semi roughness",
        source: "Majhor and Bos, section 2.3",
        parameters: schema_of::<MissionParameters>(),
    }
}

struct StraightJob {
    heightfield: String,
    settings: MissionSettings,
    start_cells: StartCells,
    streams: Streams,
    /// Number of cells of the heightfield.
    cells: u64,
    /// Radius of the closing applied to its class map, m.
    closing_radius_m: f64,
}

impl StraightJob {
    /// Advice on how to obtain cells to start from, based on the class map before closing.
    fn advice(&self, work: &Work<'_>, error: &MissionError) -> String {
        let MissionError::NoEligibleStart { border_m, .. } = error else { return String::new() };
        let path = work.parent(&roughness::item(&self.heightfield), roughness::CLASSES_RAW);
        let Some(raw) = path.ok().and_then(|path| dem::read_classes(&path).ok()) else { return String::new() };
        let percent = 100.0 * shares(&raw, *border_m).low;
        if percent > 0.0 {
            let radius_m = self.closing_radius_m;
            return format!(
                "; {percent:.2} % of the surface was low before closing with [roughness] closing_radius_m = {radius_m} m: reduce the radius if the \
                 vehicle is smaller, or raise `low_max`"
            );
        }
        "; every cell is steeper than [roughness] low_max: use a smoother terrain (a texture of smaller `amplitude`), larger cells, a narrower \
         `border_m` or a larger `low_max`"
            .to_owned()
    }
}

/// Adds the items of one table.
///
/// # Errors
/// An invalid item.
pub fn add(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    envelope: &MissionsItem,
    params: &Value,
) -> Result<(), BuildError> {
    if envelope.of.is_some() {
        return Err(entry
            .error("of", "`of` is for `kind = \"routed\"`; straight missions are drawn on `terrains`")
            .into());
    }
    entry.check_keys::<MissionsItem>(params, &schema_of::<MissionParameters>())?;
    let raw: MissionParameters = read_parameters(params).map_err(|e| entry.refuse(e))?;
    let settings = MissionSettings::try_from(raw).map_err(|e| entry.refuse(e))?;
    let heightfields = builder.families(entry, &envelope.terrains)?;
    let rules = Arc::new(json!(settings));
    let of = |id: String| Arc::new(lines(builder, &envelope.id, &rules, id));
    let lines: Vec<Arc<Lines>> = heightfields.into_iter().map(of).collect();
    check_geometry(builder, entry, &lines)?;
    room::check(builder, entry, lines.iter().map(|one| &one.heightfield), |_, terrain| {
        check_size(terrain, &settings).map_err(|e| Lack::new(e.key(), format!("cannot {e}")))
    })?;
    for one in &lines {
        let words = format!("{}@{}", envelope.id, one.word);
        let streams = builder.streams(STAGE, &words, envelope.seed, one.shared.unwrap_or(0));
        let stream = Some(streams.label());
        let job = StraightJob {
            heightfield: one.heightfield.clone(),
            settings: settings.clone(),
            start_cells: if one.shared.is_some() { StartCells::All } else { StartCells::Low },
            streams,
            cells: builder.heightfields.get(&one.heightfield).map_or(0, |field| field.cells),
            closing_radius_m: builder.study.roughness.closing_radius_m,
        };
        let parents = vec![roughness::item(&one.heightfield)];
        let item = one.item.clone();
        builder.node(Node { item, parents, inputs: Vec::new(), stream, job: Box::new(job) })?;
    }
    let drawn = Drawn { lines, count: settings.count(), length_m: settings.length_m() };
    builder.missions.insert(envelope.id.clone(), drawn);
    Ok(())
}

/// The missions of a heightfield, with its own draws or with those shared by all replicates of the same number.
fn lines(builder: &Builder<'_>, missions: &str, rules: &Arc<Value>, heightfield: String) -> Lines {
    let shared = builder.heightfields.get(&heightfield).and_then(|field| builder.shared(field));
    let item = ItemRef::new(STAGE, &format!("{missions}@{heightfield}"));
    Lines {
        pairs: item.id.clone(),
        item,
        word: shared.map_or_else(|| heightfield.clone(), common),
        rules: Arc::clone(rules),
        shared,
        heightfield,
    }
}

/// Refuses heightfields that share draws but have different cells, as far as this is known before the run.
fn check_geometry(builder: &Builder<'_>, entry: &Entry<'_>, lines: &[Arc<Lines>]) -> Result<(), BuildError> {
    let mut first: BTreeMap<u64, (&str, Geometry)> = BTreeMap::new();
    for one in lines {
        let geometry = builder.heightfields.get(&one.heightfield).and_then(|field| field.expected);
        let (Some(number), Some(geometry)) = (one.shared, geometry) else { continue };
        let (id, of_first) = *first.entry(number).or_insert((&one.heightfield, geometry));
        if of_first != geometry {
            let message = format!("`terrains`: {}", different_cells((id, &of_first), (&one.heightfield, &geometry)));
            return Err(entry.error("terrains", message).into());
        }
    }
    Ok(())
}

/// The message on two heightfields that cannot share missions.
fn different_cells((a, of_a): (&str, &Geometry), (b, of_b): (&str, &Geometry)) -> String {
    let cells = |g: &Geometry| {
        let ([x, y], [dx, dy]) = (g.origin, g.cell);
        format!("{} x {} cells of {dx} x {dy} m from ({x}, {y})", g.rows, g.cols)
    };
    format!(
        "with `pairing = \"common\"`, replicates with the same number share their draws and must have the same cells, but \"{a}\" has {} \
         and \"{b}\" has {}; list them in separate [[missions]]",
        cells(of_a),
        cells(of_b)
    )
}

impl Job for StraightJob {
    fn recipe(&self) -> Value {
        json!({ "heightfield": self.heightfield, "missions": self.settings, "cells": self.start_cells })
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility]
    }

    fn memory_bytes(&self) -> u64 {
        // The class map, and twice the indices of its cells.
        (64 << 20) + 17 * self.cells
    }

    fn estimate(&self) -> Estimate {
        Estimate { seconds: 0.03, bytes: 200.0 * self.settings.count() as f64 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let path = work.parent(&roughness::item(&self.heightfield), roughness::CLASSES)?;
        let classes = dem::read_classes(&path).map_err(input_error)?;
        let missions = draw_missions(&classes, &self.settings, self.start_cells, &self.streams)
            .map_err(|e| JobError::input(format!("cannot {e}{}", self.advice(work, &e))))?;
        let text = serde_json::to_vec(&missions).map_err(JobError::new)?;
        work.write(MISSIONS, &text)?;
        Ok(Outcome { products: vec![Product::internal(MISSIONS)], ..Outcome::default() })
    }
}
