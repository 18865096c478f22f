//! Vertices: the nodes where the ground changes, so that few of them carry the routes (the thesis, section 3).
//!
//! In order: [`critical`] points that the [`filter`] leaves, [`singular`] points beside steps that may not be taken, the rims of what is
//! blocked, start and goal, [`alone`] points that join lone ones, and points wherever the ground has changed by a [`threshold`]. The
//! thesis claims that a path is found whenever there is one; joining lone points does not give that, [`repair`] does.

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

/// Which nodes become vertices.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct VertexSettings {
    /// Critical points that differ from the next ones by no more than this are dropped, m; 0 or above.
    pub step_over_m: f64,
    /// Change of height after which a line gets another vertex, m, above 0; without one there are none of these (NoHDT).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold_m: Option<f64>,
    /// Whether vertices are added until they connect what the ground connects.
    pub repair: bool,
    /// The filter as the thesis prints it: points that differ by more than `step_over_m` are dropped.
    pub literal_filter: bool,
    /// The border of obstacles as the thesis has it: blocked nodes beside free ones are marked, in place of the free ones beside them.
    pub literal_border: bool,
    /// The listing of Algorithm 3 as printed, which joins no lone points.
    pub literal_alone: bool,
}

impl Default for VertexSettings {
    /// NoHDT, repaired, with the listings put right; the step of 1 m is ours, as the thesis prints none.
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
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// The first one.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::not_negative("step_over_m", self.step_over_m)?;
        self.threshold_m.map(|m| ParameterError::positive("threshold_m", m)).transpose().map(drop)
    }
}

/// The vertices of a map.
#[derive(Clone, Debug)]
pub struct Vertices {
    /// Whether each node is one.
    pub marks: Vec<bool>,
    /// How many of them the repair added.
    pub repaired: usize,
}

impl Vertices {
    /// Every free node.
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
