//! Starting studies: small, complete and commented.

/// A starting study.
#[derive(Clone, Copy, Debug)]
pub struct Starting {
    /// Name of the study, after its last stage.
    pub name: &'static str,
    /// What it produces.
    pub summary: &'static str,
    /// What the user must provide before it can be planned.
    pub needs: Option<&'static str>,
    /// Its text.
    pub text: &'static str,
}

/// File name of the schema that the studies refer to, in the same folder.
pub const SCHEMA: &str = "study.schema.json";

/// All of them.
pub const STARTING: [Starting; 6] = [
    Starting {
        name: "terrain",
        summary: "generated terrains of different roughness",
        needs: None,
        text: include_str!("starting/terrain.toml"),
    },
    Starting {
        name: "texture",
        summary: "covariance fit of a measured DEM, and synthetic surfaces that match it",
        needs: Some("put your DEM next to the study as site.tif, or change `file` to its name"),
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
        summary: "rovers that find their own way among rocks",
        needs: None,
        text: include_str!("starting/rover.toml"),
    },
    Starting {
        name: "photoclinometry",
        summary: "rendered images of a planetary surface, and heights recovered from them",
        needs: None,
        text: include_str!("starting/photoclinometry.toml"),
    },
];
