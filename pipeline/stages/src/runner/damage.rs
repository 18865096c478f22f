//! Results that changed after they were written.

use crate::error::Error;
use crate::job::ItemRef;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// The results that changed after they were written. All of them are found before the run ends: a program that changes files in place
/// seldom changes one.
#[derive(Debug, Default)]
pub struct Changed(Mutex<BTreeMap<PathBuf, String>>);

impl Changed {
    /// Notes a result with a file that changed.
    pub fn note(&self, folder: &Path, item: &ItemRef, file: &str) {
        let mut found = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        found.entry(folder.to_owned()).or_insert_with(|| format!("{item}: {file}"));
    }

    /// These results by folder, each with its item and the first file that changed.
    pub fn into_found(self) -> BTreeMap<PathBuf, String> {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    /// Removes these results of a work area, so that the next run recomputes them.
    ///
    /// # Errors
    /// Any such result; the first is named.
    pub fn remove(self) -> Result<(), Error> {
        let found = self.into_found();
        let Some((folder, what)) = found.first_key_value() else { return Ok(()) };
        let others = and_others(found.len());
        let left: Vec<&PathBuf> = found.keys().filter(|folder| fs::remove_dir_all(folder).is_err()).collect();
        let advice = match (left.as_slice(), found.len()) {
            ([], 1) => "that result was removed; run again".to_owned(),
            ([], _) => "these results were removed; run again".to_owned(),
            ([one], _) => format!("remove {} and run again", one.display()),
            ([first, more @ ..], _) => {
                format!("remove {} and {} more of these folders, and run again", first.display(), more.len())
            }
        };
        Err(Error::Failed(format!("{what} was changed in the work area {}{others}; {advice}", folder.display())))
    }
}

/// The clause on all results but the first that is named.
pub(super) fn and_others(results: usize) -> String {
    match results {
        0 | 1 => String::new(),
        2 => ", and so was 1 other result".to_owned(),
        n => format!(", and so were {} other results", n - 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All results with changed files are removed; the first is named, and one that cannot be removed.
    #[test]
    fn val_changed_results_are_removed_together() {
        let area = tempfile::tempdir().unwrap();
        let folder = |id: &str| area.path().join(id);
        let check = |ids: &[&str], others: &str, advice: &str| {
            let changed = Changed::default();
            for id in ids {
                // A folder that does not exist cannot be removed.
                if *id != "none" {
                    fs::create_dir(folder(id)).unwrap();
                }
                ["x.tif", "y.tif"].iter().for_each(|file| changed.note(&folder(id), &ItemRef::new("fit", id), file));
            }
            let error = changed.remove().unwrap_err().to_string();
            let first = ids.iter().min().unwrap();
            let place = folder(first).display().to_string();
            assert_eq!(error, format!("fit/{first}: x.tif was changed in the work area {place}{others}; {advice}"));
            assert!(ids.iter().all(|id| !folder(id).exists()));
        };
        Changed::default().remove().unwrap();
        check(&["a"], "", "that result was removed; run again");
        check(&["b", "a"], ", and so was 1 other result", "these results were removed; run again");
        check(&["c", "b", "a"], ", and so were 2 other results", "these results were removed; run again");
        let left = format!("remove {} and run again", folder("none").display());
        check(&["a", "none"], ", and so was 1 other result", &left);
    }
}
