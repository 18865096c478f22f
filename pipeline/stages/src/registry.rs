//! The registry of sections and stages.

use crate::builder::{BuildError, Builder};
use crate::hypotheses;
use crate::jobs;
use crate::study::keys::properties;
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::study as envelope;
use serde_json::Value;

/// One section of a study, and the stage behind it.
pub struct Section {
    /// Its name.
    pub name: &'static str,
    /// Table or array of tables.
    pub form: Form,
    /// JSON Schema of the envelope.
    pub envelope: fn() -> Value,
    /// Kinds, whose parameters are given along with the envelope's keys.
    pub kinds: fn() -> Vec<Kind>,
    /// Adds the section's items to the graph.
    pub add: fn(&mut Builder<'_>) -> Result<(), BuildError>,
}

/// Keys that select the kind of a table.
const SELECTORS: [&str; 2] = ["kind", "method"];

impl Section {
    /// The envelope's key that selects the kind of a table, if there is one.
    pub fn selector(&self) -> Option<&'static str> {
        let keys = properties(&(self.envelope)());
        SELECTORS.into_iter().find(|selector| keys.iter().any(|key| key == selector))
    }

    /// The kinds whose tables have their own keys; only the first if all have the same keys and no key of the envelope selects them.
    pub fn distinct_kinds(&self) -> Vec<Kind> {
        let mut kinds = (self.kinds)();
        let own = |kind: &Kind| kind.parameters["properties"].clone();
        if self.selector().is_none() && kinds.iter().all(|kind| own(kind) == own(&kinds[0])) {
            kinds.truncate(1);
        }
        kinds
    }
}

/// Form of a section in a study.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// `[name]`, once: settings of a stage whose items follow from the items of others.
    Table,
    /// `[[name]]`, once for each item.
    Array,
}

/// Sections in the order in which they may refer to one another.
pub const SECTIONS: [Section; 13] = [
    Section {
        name: "dem",
        form: Form::Array,
        envelope: schema_of::<envelope::DemItem>,
        kinds: Vec::new,
        add: jobs::dem::add,
    },
    Section {
        name: "terrain",
        form: Form::Array,
        envelope: schema_of::<envelope::TerrainItem>,
        kinds: sastrugi_terrain::kinds,
        add: jobs::terrain::add,
    },
    Section {
        name: "fit",
        form: Form::Array,
        envelope: schema_of::<envelope::FitItem>,
        kinds: jobs::fit::kinds,
        add: jobs::fit::add,
    },
    Section {
        name: "texture",
        form: Form::Array,
        envelope: schema_of::<envelope::TextureItem>,
        kinds: jobs::texture::kinds,
        add: jobs::texture::add,
    },
    Section {
        name: "image",
        form: Form::Array,
        envelope: schema_of::<envelope::ImageItem>,
        kinds: jobs::image::kinds,
        add: jobs::image::add,
    },
    Section {
        name: "photoclinometry",
        form: Form::Array,
        envelope: schema_of::<envelope::PhotoclinometryItem>,
        kinds: jobs::photoclinometry::kinds,
        add: jobs::photoclinometry::add,
    },
    Section {
        name: "roughness",
        form: Form::Table,
        envelope: schema_of::<envelope::RoughnessSection>,
        kinds: Vec::new,
        add: jobs::roughness::add,
    },
    Section {
        name: "missions",
        form: Form::Array,
        envelope: schema_of::<envelope::MissionsItem>,
        kinds: jobs::missions::kinds,
        add: jobs::missions::add,
    },
    Section {
        name: "traverse",
        form: Form::Array,
        envelope: schema_of::<envelope::TraverseItem>,
        kinds: jobs::traverse::kinds,
        add: jobs::traverse::add,
    },
    Section {
        name: "route",
        form: Form::Array,
        envelope: schema_of::<envelope::RouteItem>,
        kinds: jobs::route::kinds,
        add: jobs::route::add,
    },
    Section {
        name: "navigate",
        form: Form::Array,
        envelope: schema_of::<envelope::NavigateItem>,
        kinds: jobs::navigate::kinds,
        add: jobs::navigate::add,
    },
    Section {
        name: "rover",
        form: Form::Array,
        envelope: schema_of::<envelope::RoverItem>,
        kinds: jobs::rover::kinds,
        add: jobs::rover::add,
    },
    Section {
        name: hypotheses::SECTION,
        form: Form::Array,
        envelope: schema_of::<envelope::HypothesisItem>,
        kinds: Vec::new,
        add: hypotheses::check,
    },
];

/// Names of the sections except `[study]`.
pub fn section_names() -> Vec<&'static str> {
    SECTIONS.iter().map(|s| s.name).collect()
}

/// Every generator, fit, covariance model, method, mission rule, run, vehicle.
///
/// ```
/// use sastrugi_stages::registry::kinds;
///
/// let kinds = kinds();
/// let husky = kinds.iter().find(|kind| kind.kind == "husky_a200").ok_or("no such kind")?;
/// assert_eq!(husky.family, "vehicle");
/// // A vehicle states its values, and the source of each.
/// assert!(husky.values().is_some() && husky.sources().is_some());
/// # Ok::<(), &str>(())
/// ```
pub fn kinds() -> Vec<Kind> {
    let models = sastrugi_texture::kinds().into_iter().filter(|k| k.family == "covariance");
    SECTIONS.iter().flat_map(|s| (s.kinds)()).chain(models).chain(sastrugi_mobility::registry::kinds()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parameter with the name of an envelope key would never reach its generator.
    #[test]
    fn val_no_parameter_has_the_name_of_an_envelope_key() {
        let mut parameters = 0;
        for section in &SECTIONS {
            let envelope = properties(&(section.envelope)());
            assert_eq!(section.form == Form::Array, envelope.iter().any(|key| key == "id"), "{}", section.name);
            for kind in (section.kinds)() {
                let own = properties(&kind.parameters);
                let shared: Vec<&String> = own.iter().filter(|key| envelope.contains(key)).collect();
                assert!(shared.is_empty(), "[[{}]] {}: {shared:?}", section.name, kind.kind);
                parameters += own.len();
            }
        }
        assert!(parameters > 100, "{parameters}");
    }

    /// The key that selects the kind of a table.
    #[test]
    fn val_selectors() {
        let selector = |name: &str| SECTIONS.iter().find(|section| section.name == name).unwrap().selector();
        assert_eq!(["terrain", "missions", "rover"].map(selector), [Some("kind"); 3]);
        assert_eq!(selector("texture"), Some("method"));
        assert_eq!(["dem", "fit", "roughness", "traverse", "hypothesis"].map(selector), [None; 5]);
    }

    /// A table may refer to tables of earlier sections only.
    #[test]
    fn val_sections_stand_after_those_that_they_refer_to() {
        let names = section_names();
        let place = |name: &str| names.iter().position(|other| *other == name).unwrap();
        for (earlier, later) in [
            ("dem", "terrain"),
            ("terrain", "fit"),
            ("fit", "texture"),
            ("texture", "image"),
            ("image", "photoclinometry"),
            ("photoclinometry", "missions"),
            ("missions", "traverse"),
            ("route", "navigate"),
            ("texture", "rover"),
            ("traverse", "hypothesis"),
        ] {
            assert!(place(earlier) < place(later), "[[{later}]] refers to [[{earlier}]]");
        }
    }
}
