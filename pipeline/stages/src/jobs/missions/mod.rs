//! Stage `missions`: defines the missions on each heightfield. One file per kind.

mod routed;
mod straight;
mod trail;

use crate::builder::{BuildError, Builder};
use crate::job::{ItemRef, JobError, Work};
use crate::study::Entry;
use sastrugi_mobility::missions::Mission;
use sastrugi_schemas::Kind;
use sastrugi_schemas::study::{MissionKind, MissionsItem};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Name of the stage.
pub const STAGE: &str = "missions";
/// The missions of an item.
const MISSIONS: &str = "missions.json";

/// The kinds of missions.
pub fn kinds() -> Vec<Kind> {
    vec![straight::kind(), routed::kind(), trail::kind()]
}

/// Adds the items of `[[missions]]`.
///
/// # Errors
/// An invalid item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    builder.each(STAGE, add_table)
}

fn add_table(builder: &mut Builder<'_>, entry: &Entry<'_>) -> Result<(), BuildError> {
    let (envelope, params): (MissionsItem, Value) = entry.read()?;
    builder.claim(entry, STAGE, &envelope.id)?;
    match envelope.kind {
        MissionKind::Straight => straight::add(builder, entry, &envelope, &params)?,
        MissionKind::Routed => routed::add(builder, entry, &envelope, &params)?,
        MissionKind::Trail => trail::add(builder, entry, &envelope, &params)?,
    }
    Ok(())
}

/// The missions of an item.
///
/// `folder_file` is the path from [`fn@file`].
///
/// # Errors
/// A file that cannot be read.
pub fn read(folder_file: &Path) -> Result<Vec<Mission>, JobError> {
    let bytes = std::fs::read(folder_file).map_err(|e| JobError::at(folder_file, e))?;
    serde_json::from_slice(&bytes).map_err(JobError::new)
}

/// Path of the missions of an item.
///
/// # Errors
/// When the item is not a parent.
pub fn file(work: &Work<'_>, item: &ItemRef) -> Result<PathBuf, JobError> {
    work.parent(item, MISSIONS)
}
