//! The trait of all jobs, with their inputs and outcomes.

use crate::machine::{Fault, fault};
use crate::revision::Room;
use sastrugi_schemas::{Cell, Record, Table};
use sastrugi_store::atomic::{self, Draft, DraftFile};
use sastrugi_store::parquet::{TableError, TableSummary, TableWriter};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt;
use std::io::ErrorKind;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

/// Name of an item: its stage and its id.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ItemRef {
    /// Stage, such as `terrain`.
    pub stage: String,
    /// Id, unique within the stage.
    pub id: String,
}

impl ItemRef {
    /// The item `id` of `stage`.
    pub fn new(stage: &str, id: &str) -> Self {
        Self { stage: stage.to_owned(), id: id.to_owned() }
    }
}

impl fmt::Display for ItemRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.stage, self.id)
    }
}

/// The work of one item. A job is glue: it reads the artifacts of its parents, calls a kernel, and writes files.
pub trait Job: Send + Sync {
    /// Everything in the study that determines the content of the result, with defaults filled in.
    fn recipe(&self) -> Value;
    /// The same as JSON text, which goes into the key. Jobs of which a study may have very many keep the part that they share.
    fn recipe_text(&self) -> String {
        self.recipe().to_string()
    }
    /// Settings that determine only how the same content is packed; changing them does not invalidate dependants. Null for the default.
    fn packing(&self) -> Value {
        Value::Null
    }
    /// Rooms whose code determines the result, besides those that all jobs depend on.
    fn rooms(&self) -> &'static [Room];
    /// Peak working memory, bytes.
    fn memory_bytes(&self) -> u64;
    /// Rough cost, for `plan` and the progress bar.
    fn estimate(&self) -> Estimate;
    /// Does the work.
    ///
    /// # Errors
    /// Why this item has no result; other items continue.
    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError>;
}

/// One JSON object with the keys of several, in their order: the recipe of a job from the part that it shares with others and its own.
///
/// # Panics
/// When a text is not that of an object (a bug).
pub(crate) fn joined(objects: &[&str]) -> String {
    let inner = |object: &&str| object.strip_prefix('{').and_then(|rest| rest.strip_suffix('}')).map(str::to_owned);
    let parts: Option<Vec<String>> = objects.iter().map(inner).collect();
    format!("{{{}}}", parts.unwrap_or_else(|| panic!("{objects:?} are not all JSON objects")).join(","))
}

/// A recipe from its text.
///
/// # Panics
/// When the text is not JSON (a bug): another value would hide what the key was made from.
pub(crate) fn parsed(recipe: &str) -> Value {
    serde_json::from_str(recipe).unwrap_or_else(|e| panic!("{recipe:?} is not JSON: {e}"))
}

/// Rough cost of an item on one core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Estimate {
    /// Time, s.
    pub seconds: f64,
    /// Bytes of its artifacts.
    pub bytes: f64,
}

/// Input and output folders of a job.
pub struct Work<'a> {
    /// Folder for the outputs.
    pub folder: Draft<'a>,
    /// Folders of the parents' artifacts.
    pub parents: &'a BTreeMap<ItemRef, PathBuf>,
}

impl Work<'_> {
    /// A file of a parent.
    ///
    /// # Errors
    /// If the item is not a parent (a bug in the stage's registration).
    pub fn parent(&self, item: &ItemRef, file: &str) -> Result<PathBuf, JobError> {
        let folder = self.parents.get(item).ok_or_else(|| JobError::new(format!("{item} is not a parent")))?;
        Ok(folder.join(file))
    }

    /// An output.
    pub fn output(&self, file: &str) -> DraftFile {
        self.folder.file(file)
    }

    /// Removes the folder's path from an error of the item: messages are part of the release, which must not depend on where it was made.
    fn without_folder(&self, error: JobError) -> JobError {
        let folder = format!("{}/", self.folder.0.display());
        if error.cause == Cause::Item { error.reworded(|words| words.replace(&folder, "")) } else { error }
    }

    /// Writes an output of a few bytes.
    ///
    /// # Errors
    /// File-system errors.
    pub fn write(&self, file: &str, bytes: &[u8]) -> Result<(), JobError> {
        atomic::write(&self.output(file), bytes).map_err(|e| JobError::at(&self.folder.0.join(file), e))
    }
}

/// Result of a job.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Outcome {
    /// Files in the item's folder.
    pub products: Vec<Product>,
    /// Notes for the reader.
    pub notes: Vec<String>,
}

impl Outcome {
    /// Writes the item's rows of a table, sorted by key; without rows, no file is written. The release merges the rows of all items.
    ///
    /// # Errors
    /// Rows that are not sorted, or a table written twice by the item (both bugs); a file that cannot be written.
    pub fn write_rows<R: Record>(
        &mut self,
        work: &Work<'_>,
        rows: impl IntoIterator<Item = R>,
    ) -> Result<(), JobError> {
        let mut writer = RowWriter::new(work);
        writer.push(rows)?;
        writer.finish(self)
    }
}

/// Writes the item's rows of a table as they are computed, sorted by key, so that not all need be in memory. Without rows, no file is written.
pub struct RowWriter<'w, R> {
    work: &'w Work<'w>,
    /// Created with the first row.
    writer: Option<TableWriter>,
    rows: PhantomData<R>,
}

impl<'w, R: Record> RowWriter<'w, R> {
    /// A table without rows.
    pub fn new(work: &'w Work<'w>) -> Self {
        Self { work, writer: None, rows: PhantomData }
    }

    /// Appends rows, whose keys must be greater than those before.
    ///
    /// # Errors
    /// Rows that are not sorted (a bug); a file that cannot be written.
    pub fn push(&mut self, rows: impl IntoIterator<Item = R>) -> Result<(), JobError> {
        for row in rows {
            self.write(row.cells()).map_err(|e| self.work.without_folder(JobError::io(e)))?;
        }
        Ok(())
    }

    fn write(&mut self, cells: Vec<Cell>) -> Result<(), TableError> {
        if self.writer.is_none() {
            self.writer = Some(TableWriter::create(&self.work.output(&Self::file()), &R::TABLE, None)?);
        }
        self.writer.as_mut().map_or(Ok(()), |writer| writer.push(cells))
    }

    /// Completes the file and lists it among the products.
    ///
    /// # Errors
    /// A table written twice by the item (a bug); a file that cannot be written.
    pub fn finish(self, outcome: &mut Outcome) -> Result<(), JobError> {
        let Some(writer) = self.writer else { return Ok(()) };
        let file = Self::file();
        if outcome.products.iter().any(|product| product.file == file) {
            return Err(JobError::new(format!("{file} was written twice")));
        }
        let summary = writer.finish().map_err(|e| self.work.without_folder(JobError::io(e)))?;
        outcome.products.push(Product::fragment(file, &R::TABLE, summary));
        Ok(())
    }

    fn file() -> String {
        format!("{}.parquet", R::TABLE.name)
    }
}

/// One file written by a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Product {
    /// Name in the item's folder.
    pub file: String,
    /// Path in the release; absent for files that only later stages use.
    pub release_path: Option<String>,
    /// Hash of the decoded content (heights, rows, messages), if any.
    pub content: Option<String>,
    /// Number of messages of a recording, or of rows.
    pub records: Option<u64>,
    /// The rows in it, if it contains rows of a table of the release.
    #[serde(default)]
    pub fragment: Option<Fragment>,
}

/// Rows of a table from one item.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fragment {
    /// The table.
    pub table: String,
    /// Keys of the first and the last row.
    pub ends: [Vec<Cell>; 2],
}

impl Product {
    /// A file that goes into the release.
    pub fn released(file: &str, release_path: String, content: Option<String>) -> Self {
        Self { release_path: Some(release_path), content, ..Self::internal(file) }
    }

    /// A file for later stages.
    pub fn internal(file: &str) -> Self {
        Self { file: file.to_owned(), release_path: None, content: None, records: None, fragment: None }
    }

    fn fragment(file: String, table: &Table, summary: TableSummary) -> Self {
        let TableSummary { rows, ends, content_sha256 } = summary;
        let fragment = Some(Fragment { table: table.name.to_owned(), ends });
        Self { file, release_path: None, content: Some(content_sha256), records: Some(rows), fragment }
    }
}

/// Why an item has no result.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{message}")]
pub struct JobError {
    /// One sentence.
    pub message: String,
    /// Cause of the failure.
    pub cause: Cause,
}

/// Cause of a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The item itself; other items are not affected.
    Item,
    /// The item's input data.
    Input,
    /// The machine; every item would fail.
    Machine(Fault),
}

impl JobError {
    /// A failure of the item, with its reason.
    pub fn new(message: impl fmt::Display) -> Self {
        Self { message: message.to_string(), cause: Cause::Item }
    }

    /// A failure caused by the input data.
    pub fn input(message: impl fmt::Display) -> Self {
        Self { message: message.to_string(), cause: Cause::Input }
    }

    /// A failure to read or write, attributed to the machine or the item according to the error.
    pub fn io(error: impl std::error::Error + 'static) -> Self {
        let cause = fault(&error).map_or(Cause::Item, Cause::Machine);
        Self { message: error.to_string(), cause }
    }

    /// The same for a file; one that is not a regular file is unusable input.
    pub fn at(path: &Path, error: std::io::Error) -> Self {
        match error.kind() {
            ErrorKind::InvalidInput | ErrorKind::IsADirectory => Self::input(format!("{}: {error}", path.display())),
            _ => Self::io(error).reworded(|words| format!("{}: {words}", path.display())),
        }
    }

    /// The same with another message.
    pub fn reworded(self, words: impl FnOnce(&str) -> String) -> Self {
        Self { message: words(&self.message), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_schemas::tables::PsdRow;

    fn row(bin: i64) -> PsdRow {
        let frequency_cycles_m = 0.1 * bin as f64;
        PsdRow {
            surface_id: "a".to_owned(),
            bin,
            frequency_cycles_m,
            psd_m4: 1.0 / (1.0 + frequency_cycles_m),
            modes: 3,
        }
    }

    /// Rows written in pieces of any size give the same file and product as rows written at once; without rows there is none.
    #[test]
    fn prop_rows_in_pieces_make_the_same_file() {
        const ROWS: i64 = 5000;
        let parents = BTreeMap::new();
        let written = |piece: usize| {
            let folder = tempfile::tempdir().unwrap();
            let work = Work { folder: Draft(folder.path()), parents: &parents };
            let (mut outcome, mut rows) = (Outcome::default(), RowWriter::new(&work));
            for first in (0..ROWS).step_by(piece) {
                rows.push((first..ROWS.min(first + piece as i64)).map(row)).unwrap();
            }
            rows.finish(&mut outcome).unwrap();
            let again = outcome.write_rows(&work, [row(0)]).unwrap_err().message;
            assert_eq!(again, "psd.parquet was written twice");
            (std::fs::read(folder.path().join("psd.parquet")).unwrap(), outcome.products)
        };
        let whole = written(ROWS as usize);
        assert_eq!(whole.1[0].records, Some(ROWS as u64));
        for piece in [1, 700, 1024] {
            assert!(written(piece) == whole, "{piece}");
        }
        let folder = tempfile::tempdir().unwrap();
        let work = Work { folder: Draft(folder.path()), parents: &parents };
        let mut outcome = Outcome::default();
        outcome.write_rows::<PsdRow>(&work, []).unwrap();
        assert!(outcome.products.is_empty() && std::fs::read_dir(folder.path()).unwrap().next().is_none());
    }
}
