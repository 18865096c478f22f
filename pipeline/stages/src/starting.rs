//! Studies to start from: small, complete, with a comment on every line that a newcomer asks about.

/// A study to start from.
#[derive(Clone, Copy, Debug)]
pub struct Starting {
    /// The stage that it leads to.
    pub name: &'static str,
    /// What it makes.
    pub summary: &'static str,
    /// What has to be there before it can be planned.
    pub needs: Option<&'static str>,
    /// Its text.
    pub text: &'static str,
}

/// Name of the schema that the studies refer to, beside them.
pub const SCHEMA: &str = "study.schema.json";

/// All of them.
pub const STARTING: [Starting; 6] = [
    Starting {
        name: "terrain",
        summary: "generated terrains of several roughnesses",
        needs: None,
        text: include_str!("starting/terrain.toml"),
    },
    Starting {
        name: "texture",
        summary: "the covariance of a measured DEM, and synthetic surfaces that match it",
        needs: Some("put your DEM beside it as site.tif, or change `file` to its name"),
        text: include_str!("starting/texture.toml"),
    },
    Starting {
        name: "traverse",
        summary: "a vehicle driven over terrains, with a hypothesis",
        needs: None,
        text: include_str!("starting/traverse.toml"),
    },
    Starting {
        name: "navigate",
        summary: "planned routes, and teams in formation along them",
        needs: None,
        text: include_str!("starting/navigate.toml"),
    },
    Starting {
        name: "rover",
        summary: "rovers that find their way among rocks",
        needs: None,
        text: include_str!("starting/rover.toml"),
    },
    Starting {
        name: "photoclinometry",
        summary: "rendered images of a planet, and heights from them",
        needs: None,
        text: include_str!("starting/photoclinometry.toml"),
    },
];
