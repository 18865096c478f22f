//! Missions and routes that one section makes for another, and their names.

use crate::job::ItemRef;
use sastrugi_mobility::missions::Mission;
use sastrugi_navigation::parameters::RouteParameters;
use serde_json::Value;

/// Missions that a traverse can refer to.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// What is drawn on each heightfield.
    pub lines: Vec<Lines>,
    /// Missions on each.
    pub count: usize,
    /// Length, m.
    pub length_m: f64,
}

/// The missions of one heightfield.
#[derive(Clone, Debug)]
pub struct Lines {
    /// Heightfield.
    pub heightfield: String,
    /// Item that draws them.
    pub item: ItemRef,
    /// Random streams are named by this: the heightfield, or what it shares with others.
    pub word: String,
    /// Rules that they were made by.
    pub rules: Value,
    /// Item that drew their starts and goals.
    pub pairs: String,
    /// Number of the replicates that share draws with this one, from 0.
    pub shared: Option<u64>,
}

impl Lines {
    /// Name of a mission's start and goal, for one-by-one comparison.
    pub fn pair_id(&self, mission: &Mission) -> String {
        match self.shared {
            None => format!("{}-{:04}", self.pairs, mission.index + 1),
            // The same draw is the same line on all that share it.
            Some(_) => format!("{}-{:04}.{}", self.block(), mission.index + 1, mission.draws),
        }
    }

    /// Name of what shares draws: `<missions>-<replicate>`.
    fn block(&self) -> String {
        let missions = self.pairs.split_once('@').map_or("", |(missions, _)| missions);
        format!("{missions}-{:04}", self.shared.unwrap_or(0) + 1)
    }
}

/// The routes of one search on one terrain, to which a team can refer.
#[derive(Clone, Debug)]
pub struct Routes {
    /// Id of the search.
    pub search: String,
    /// Swept parameters of the search.
    pub variant: Option<String>,
    /// Parameters of the search.
    pub parameters: RouteParameters,
    /// Terrain.
    pub terrain: String,
    /// Item that plans them.
    pub item: ItemRef,
    /// Number of them.
    pub count: usize,
}
