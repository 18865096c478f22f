//! Results of the work area that changed after they were made.

use crate::error::Error;
use crate::job::ItemRef;
use std::path::Path;

/// A result that is not what it was when it was made is dropped, so that the next run makes it again.
pub fn damaged(folder: &Path, item: &ItemRef, file: &str) -> Error {
    let dropped = std::fs::remove_dir_all(folder).is_ok();
    let advice = if dropped { "it was dropped; run again" } else { "remove it and run again" };
    Error::Failed(format!("{item}: {file} was changed in the work area {}; {advice}", folder.display()))
}
