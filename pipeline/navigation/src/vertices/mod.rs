//! Vertices: the nodes where the ground changes, so that few nodes suffice for routes (the thesis, section 3).
//!
//! In order: [`critical`] points that pass the [`filter`], [`singular`] points next to steps that are not allowed, rims of blocked cells, start and
//! goal, points that join isolated ones ([`alone`]), and points wherever the height has changed by a [`threshold`]. The thesis claims that a path is
//! found whenever one exists; joining isolated points does not guarantee that, [`repair`] does.

pub mod alone;
pub mod critical;
pub mod filter;
pub mod repair;
pub mod singular;
pub mod threshold;

use crate::map::{Neighbourhood, Node, TravelMap};
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[cfg(test)]
mod tests;

/// Selection of vertices.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct VertexSettings {
    /// Critical points that differ in height from the adjacent ones by no more than this are dropped, m; at least 0.
    pub step_over_m: f64,
    /// Change of height after which a line gets another vertex, m, above 0; none if absent (NoHDT).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold_m: Option<f64>,
    /// Whether to add vertices until they connect everything that the ground connects.
    pub repair: bool,
    /// Use the filter as printed in the thesis, which drops points that differ by more than `step_over_m`.
    pub literal_filter: bool,
    /// Use the border of obstacles as in the thesis: mark blocked nodes next to free ones, instead of the free ones next to them.
    pub literal_border: bool,
    /// Use the listing of Algorithm 3 as printed, which never joins isolated points.
    pub literal_alone: bool,
}

impl Default for VertexSettings {
    /// NoHDT, repaired, with corrected listings; the step of 1 m is our choice, as the thesis gives none.
    fn default() -> Self {
        Self {
            step_over_m: 1.0,
            threshold_m: None,
            repair: true,
            literal_filter: false,
            literal_border: false,
            literal_alone: false,
        }
    }
}

impl VertexSettings {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::not_negative("step_over_m", self.step_over_m)?;
        self.threshold_m.map(|m| ParameterError::positive("threshold_m", m)).transpose().map(drop)
    }
}

/// The vertices of a map.
#[derive(Clone, Debug)]
pub struct Vertices {
    /// Whether each node is a vertex.
    pub marks: Vec<bool>,
    /// Number of vertices that the repair added.
    pub repaired: usize,
}

impl Vertices {
    /// All free nodes.
    pub fn every(map: &TravelMap) -> Self {
        let marks = (0..map.len() as Node).map(|node| !map.is_blocked(node)).collect();
        Self { marks, repaired: 0 }
    }

    /// The nodes where the ground changes, and `ends`.
    pub fn of(map: &TravelMap, neighbourhood: Neighbourhood, settings: &VertexSettings, ends: &[Node]) -> Self {
        let mut marks = critical::marks(map);
        filter::filter(map, &mut marks, settings.step_over_m, settings.literal_filter);
        singular::mark(map, &mut marks, neighbourhood);
        match settings.literal_border {
            true => singular::mark_obstacles(map, &mut marks),
            false => singular::mark_rims(map, &mut marks),
        }
        ends.iter().filter(|node| !map.is_blocked(**node)).for_each(|node| marks[*node as usize] = true);
        if !settings.literal_alone {
            alone::mark(map, &mut marks);
        }
        if let Some(threshold_m) = settings.threshold_m {
            threshold::mark(map, &mut marks, threshold_m);
        }
        let repaired = if settings.repair { repair::mark(map, &mut marks, neighbourhood) } else { 0 };
        Self { marks, repaired }
    }

    /// Number of vertices.
    pub fn count(&self) -> usize {
        self.marks.iter().filter(|mark| **mark).count()
    }
}
