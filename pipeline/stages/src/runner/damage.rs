//! Results in the work area that changed after they were written.

use crate::error::Error;
use crate::job::ItemRef;
use std::path::Path;

/// Removes a result that changed after it was written, so that the next run recomputes it.
pub fn damaged(folder: &Path, item: &ItemRef, file: &str) -> Error {
    let dropped = std::fs::remove_dir_all(folder).is_ok();
    let advice = if dropped { "that result was removed; run again" } else { "remove that folder and run again" };
    Error::Failed(format!("{item}: {file} was changed in the work area {}; {advice}", folder.display()))
}
