//! Checks before the run that surfaces have room for the missions and routes on them, as far as their sizes are known.

use crate::builder::{Builder, Heightfield};
use crate::study::{Entry, StudyError};
use sastrugi_numeric::Geometry;
use sastrugi_schemas::ParameterError;

/// Why a surface has no room.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lack {
    /// The key that asks for too much; empty if there are several.
    pub key: String,
    /// One sentence.
    pub why: String,
}

impl Lack {
    /// A lack of room for what `key` states.
    pub fn new(key: impl Into<String>, why: impl Into<String>) -> Self {
        Self { key: key.into(), why: why.into() }
    }
}

impl From<ParameterError> for Lack {
    fn from(error: ParameterError) -> Self {
        let why = error.to_string();
        Self { key: error.key, why }
    }
}

/// The surfaces that have no room.
struct Small {
    /// The first of them, and the number of the others.
    place: String,
    lack: Lack,
    /// True if no surface has room.
    is_all: bool,
}

/// The surfaces, of these, that have no room according to `room`; `None` if there are none. Those of unknown size count as large enough.
fn small<'s>(
    builder: &Builder<'_>,
    surfaces: impl IntoIterator<Item = &'s String>,
    room: impl Fn(&Heightfield, &Geometry) -> Result<(), Lack>,
) -> Option<Small> {
    let (mut count, mut without, mut first) = (0_usize, 0_usize, None);
    for id in surfaces {
        count += 1;
        let Some(field) = builder.heightfields.get(id) else { continue };
        let Some(Err(lack)) = field.expected.map(|geometry| room(field, &geometry)) else { continue };
        without += 1;
        first.get_or_insert((id, lack));
    }
    let (id, lack) = first?;
    let others = if without > 1 { format!(" and on {} more", without - 1) } else { String::new() };
    Some(Small { place: format!("on \"{id}\"{others}"), lack, is_all: without == count })
}

/// Refuses an item that has room on none of its surfaces. If only some have none, the results there will be missing, which is a doubt.
///
/// # Errors
/// No room on any surface.
pub fn check<'s>(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    surfaces: impl IntoIterator<Item = &'s String>,
    room: impl Fn(&Heightfield, &Geometry) -> Result<(), Lack>,
) -> Result<(), StudyError> {
    match small(builder, surfaces, room) {
        Some(Small { place, lack, is_all: true }) => Err(entry.error(&lack.key, format!("{place}: {}", lack.why))),
        Some(small) => {
            tell(builder, entry, &small);
            Ok(())
        }
        None => Ok(()),
    }
}

/// Warns if surfaces have no room for an item that runs all the same.
pub fn doubt<'s>(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    surfaces: impl IntoIterator<Item = &'s String>,
    room: impl Fn(&Heightfield, &Geometry) -> Result<(), Lack>,
) {
    if let Some(small) = small(builder, surfaces, room) {
        tell(builder, entry, &small);
    }
}

fn tell(builder: &mut Builder<'_>, entry: &Entry<'_>, small: &Small) {
    let Small { place, lack, .. } = small;
    let doubt = format!("{} \"{}\" {place}: {}", entry.section(), entry.id().unwrap_or_default(), lack.why);
    // The values of a sweep may lack the same, which is listed once.
    if !builder.doubts.contains(&doubt) {
        builder.doubts.push(doubt);
    }
}
