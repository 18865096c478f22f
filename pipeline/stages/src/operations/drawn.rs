//! Missions and routes that one section of a study provides for another, and their ids.

use crate::job::ItemRef;
use sastrugi_mobility::missions::Mission;
use sastrugi_navigation::parameters::RouteParameters;
use serde_json::Value;
use std::sync::Arc;

/// Missions that a traverse can refer to.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// The missions of each heightfield.
    pub lines: Vec<Arc<Lines>>,
    /// Number of missions on each heightfield.
    pub count: usize,
    /// Length of a mission, m.
    pub length_m: f64,
}

/// The missions of one heightfield.
#[derive(Clone, Debug)]
pub struct Lines {
    /// Heightfield.
    pub heightfield: String,
    /// Item that draws them.
    pub item: ItemRef,
    /// Names the random streams: the heightfield, or a word shared by heightfields with common draws.
    pub word: String,
    /// Rules by which the missions are drawn or routed, shared by all heightfields.
    pub rules: Arc<Value>,
    /// Item that drew their starts and goals.
    pub pairs: String,
    /// Number of the replicates that share draws with this one, from 0.
    pub shared: Option<u64>,
}

impl Lines {
    /// Id of the start and goal of a mission, for comparison pair by pair.
    pub fn pair_id(&self, mission: &Mission) -> String {
        match self.shared {
            None => format!("{}-{:04}", self.pairs, mission.index + 1),
            // The same draw gives the same line on all heightfields that share it.
            Some(_) => format!("{}-{:04}.{}", self.block(), mission.index + 1, mission.draws),
        }
    }

    /// Name of the shared draws: `<missions>-<replicate>`.
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
    /// Number of routes.
    pub count: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Missions that share draws have the same id on all heightfields, and another one for each number of draws.
    #[test]
    fn val_ids_of_pairs() {
        let lines = |heightfield: &str, shared: Option<u64>| Lines {
            heightfield: heightfield.to_owned(),
            item: ItemRef::new("missions", &format!("m@{heightfield}")),
            word: "word".to_owned(),
            rules: Arc::default(),
            pairs: format!("m@{heightfield}"),
            shared,
        };
        let mission = Mission { index: 2, start_m: [0.0; 2], goal_m: [1.0; 2], heading_rad: 0.0, draws: 3, line: None };
        assert_eq!(lines("a", None).pair_id(&mission), "m@a-0003");
        assert_eq!(lines("a", Some(4)).pair_id(&mission), "m-0005-0003.3");
        assert_eq!(lines("b", Some(4)).pair_id(&mission), "m-0005-0003.3");
        assert_eq!(lines("b", Some(4)).pair_id(&Mission { draws: 1, ..mission }), "m-0005-0003.1");
    }
}
