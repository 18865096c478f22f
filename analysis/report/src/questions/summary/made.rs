//! The contents of the release in a sentence: surfaces, fits and images. Routes, teams, rovers and missions have sentences of their own.

use crate::data::{Data, Group};
use crate::render::number as set;
use sastrugi_schemas::tables::TerrainRow;

/// Counts by kind; `None` where the release has none of these.
pub fn in_words(data: &Data) -> Option<String> {
    let stage = |name: &str| data.of_stage(name).count();
    let others = [
        (stage("dem"), "measured DEM"),
        (data.fits.len(), "covariance fit"),
        (stage("texture"), "texture"),
        (data.images.len(), "rendered image"),
    ];
    let others = others.into_iter().filter(|(n, _)| *n > 0).map(|(n, what)| set::counted(n, what));
    let parts: Vec<String> = terrains(data).into_iter().chain(others).collect();
    (!parts.is_empty()).then(|| format!("The release has {}.", set::listed(&parts)))
}

/// Generated terrains with the ranges of their slope and relief; `None` where there are none.
fn terrains(data: &Data) -> Option<String> {
    let all: Vec<&TerrainRow> = data.of_stage("terrain").collect();
    let groups = data.terrain_groups();
    let in_groups = match groups.len() {
        n if n > 1 && grouped(&groups) == all.len() => format!(" in {} groups", set::count(n)),
        _ => String::new(),
    };
    let ranges = [
        ("RMS slope", range(all.iter().map(|t| t.rms_slope), "")),
        ("relief", range(all.iter().map(|t| t.relief_m), "m")),
    ];
    let ranges: Vec<String> =
        ranges.into_iter().filter_map(|(name, range)| Some(format!("{name} {}", range?))).collect();
    let ranges = if ranges.is_empty() { String::new() } else { format!(" ({})", ranges.join(", ")) };
    (!all.is_empty()).then(|| format!("{}{in_groups}{ranges}", set::counted(all.len(), "terrain")))
}

/// Number of terrains in all groups, which leave out variants.
fn grouped(groups: &[Group<TerrainRow>]) -> usize {
    groups.iter().map(|group| group.rows.len()).sum()
}

/// The least and the greatest finite value, or the only one; `None` without any.
fn range(values: impl Iterator<Item = f64>, unit: &str) -> Option<String> {
    let values: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    let words = |v: f64| set::with_unit(v, 3, unit);
    let least = words(values.iter().copied().reduce(f64::min)?);
    let greatest = words(values.iter().copied().reduce(f64::max)?);
    Some(if least == greatest { least } else { format!("{least} to {greatest}") })
}
