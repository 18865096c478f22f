//! Measured data behind the files of a release: what its makers ask for goes with everything that comes from it.

use super::assemble::{Contents, record};
use crate::error::Error;
use crate::jobs::{ItemRef, dem, original};
use crate::study::terms::{self, Objection};
use sastrugi_schemas::manifest::{ItemNote, Source};
use sastrugi_schemas::study::DemItem;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// Measured data of a study.
#[derive(Default)]
pub struct Sources {
    /// What is asked for each, in the study's order.
    pub list: Vec<Source>,
    /// Licences that the program does not know.
    pub notes: Vec<ItemNote>,
    /// Ids of the data that an item comes from, by the item's name.
    behind: BTreeMap<String, BTreeSet<String>>,
}

impl Sources {
    /// Measured data of a study, and what comes from it; `contents.items` has parents before children.
    ///
    /// # Errors
    /// A result that cannot be read.
    pub fn of(contents: &Contents<'_>) -> Result<Self, Error> {
        let mut sources = Self { list: Vec::new(), notes: Vec::new(), behind: BTreeMap::new() };
        for entry in contents.study.entries(dem::STAGE).map_err(Error::failed)? {
            let (item, _): (DemItem, Value) = entry.read().map_err(Error::failed)?;
            if let Some(Objection::Unknown(note)) = terms::objection(&item, &contents.study.head.license) {
                sources.notes.push(ItemNote { stage: dem::STAGE.to_owned(), item: item.id.clone(), note });
            }
            let DemItem { id, license, attribution, citation, .. } = item;
            sources.list.push(Source { id, license, attribution, citation });
        }
        if !sources.list.is_empty() {
            sources.trace(contents)?;
        }
        Ok(sources)
    }

    fn trace(&mut self, contents: &Contents<'_>) -> Result<(), Error> {
        for (item, folder) in &contents.items {
            let mut ids = BTreeSet::new();
            if item.stage == original::STAGE {
                ids.insert(item.id.clone());
            }
            if let Some(folder) = folder {
                let parents = record(folder)?.ingredients.parents;
                ids.extend(parents.keys().filter_map(|parent| self.behind.get(parent)).flatten().cloned());
            }
            if !ids.is_empty() {
                self.behind.insert(item.to_string(), ids);
            }
        }
        Ok(())
    }

    /// Ids of the data that an item comes from.
    pub fn behind(&self, item: &ItemRef) -> Vec<String> {
        self.behind.get(&item.to_string()).into_iter().flatten().cloned().collect()
    }
}
