//! Licence and attribution of measured data, propagated to everything derived from it.

use super::terms::{self, Objection};
use crate::error::Error;
use crate::job::ItemRef;
use crate::jobs::{dem, original};
use crate::runner::cache::Record;
use crate::study::Study;
use sastrugi_schemas::manifest::{ItemNote, Source};
use sastrugi_schemas::study::DemItem;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// Measured data of a study.
#[derive(Default)]
pub struct Sources {
    /// The measured data, in the study's order.
    pub list: Vec<Source>,
    /// Notes on unknown licences.
    pub notes: Vec<ItemNote>,
    /// Ids of the data that an item is derived from, by the item's name.
    behind: BTreeMap<String, BTreeSet<String>>,
}

impl Sources {
    /// Collects the measured data of a study.
    ///
    /// # Errors
    /// A section that cannot be read.
    pub fn of(study: &Study) -> Result<Self, Error> {
        let mut sources = Self::default();
        for entry in study.entries(dem::STAGE).map_err(Error::failed)? {
            let (item, _): (DemItem, Value) = entry.read().map_err(Error::failed)?;
            if let Some(Objection::Unknown(note)) = terms::objection(&item, &study.head.license) {
                sources.notes.push(ItemNote { stage: dem::STAGE.to_owned(), item: item.id.clone(), note });
            }
            let DemItem { id, license, attribution, citation, .. } = item;
            sources.list.push(Source { id, license, attribution, citation });
        }
        Ok(sources)
    }

    /// Traces an item to its data; call it after its parents.
    pub fn trace(&mut self, record: &Record) {
        let Record { item, ingredients, .. } = record;
        let of_parents = ingredients.parents.keys().filter_map(|parent| self.behind.get(parent)).flatten().cloned();
        let own = (item.stage == original::STAGE).then(|| item.id.clone());
        let ids: BTreeSet<String> = of_parents.chain(own).collect();
        if !ids.is_empty() {
            self.behind.insert(item.to_string(), ids);
        }
    }

    /// Ids of the data that an item is derived from.
    pub fn behind(&self, item: &ItemRef) -> Vec<String> {
        self.behind.get(&item.to_string()).into_iter().flatten().cloned().collect()
    }
}
