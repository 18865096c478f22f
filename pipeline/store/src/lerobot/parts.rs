//! Numbered Parquet files that are filled one after the other.

use super::CHUNK_FILES;
use crate::PROGRAM;
use crate::atomic::{AtomicFile, Refused};
use crate::parquet::TableError;
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{ArrowError, SchemaRef};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::schema::types::ColumnPath;
use std::path::PathBuf;

/// How files are written: Zstandard at its fastest level; row groups of at most so many rows; floats, which rarely repeat, as byte planes.
pub(super) fn properties(group_rows: usize, floats: impl Iterator<Item = ColumnPath>) -> WriterProperties {
    let builder = WriterProperties::builder()
        .set_created_by(PROGRAM.to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_dictionary_enabled(false)
        .set_max_row_group_row_count(Some(group_rows));
    floats.fold(builder, |builder, path| builder.set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT)).build()
}

/// One file under construction.
pub(super) struct Part {
    path: PathBuf,
    schema: SchemaRef,
    writer: ArrowWriter<AtomicFile>,
    refused: Refused,
    rows: u64,
}

impl Part {
    pub(super) fn create(path: PathBuf, schema: SchemaRef, properties: WriterProperties) -> Result<Self, TableError> {
        let file = AtomicFile::create(&path).map_err(|e| TableError::io(&path, e))?;
        let refused = file.refused();
        let writer = ArrowWriter::try_new(file, schema.clone(), Some(properties));
        let writer = writer.map_err(|source| TableError::encoding(&path, source, &refused))?;
        Ok(Self { path, schema, writer, refused, rows: 0 })
    }

    /// Appends rows, column by column.
    pub(super) fn write(&mut self, columns: Vec<Result<ArrayRef, ArrowError>>) -> Result<(), TableError> {
        let columns: Result<Vec<ArrayRef>, ArrowError> = columns.into_iter().collect();
        let batch = columns.and_then(|columns| RecordBatch::try_new(self.schema.clone(), columns));
        let rows = batch.as_ref().map_or(0, RecordBatch::num_rows);
        let written = batch.map_err(ParquetError::from).and_then(|batch| self.writer.write(&batch));
        written.map_err(|source| TableError::encoding(&self.path, source, &self.refused))?;
        self.rows += rows as u64;
        Ok(())
    }

    pub(super) fn finish(self) -> Result<(), TableError> {
        let Self { path, writer, refused, .. } = self;
        let file = writer.into_inner().map_err(|source| TableError::encoding(&path, source, &refused))?;
        file.commit().map_err(|e| TableError::io(&path, e))
    }

    /// True if so many further rows of the same average size would fill the file.
    fn is_full_with(&self, rows: u64, file_bytes: u64) -> bool {
        let bytes = (self.writer.bytes_written() + self.writer.in_progress_size()) as u64;
        self.rows > 0 && bytes * (self.rows + rows) >= file_bytes * self.rows
    }
}

/// The files of a folder, `chunk-000/file-000.parquet` and so on.
pub(super) struct Parts {
    folder: PathBuf,
    schema: SchemaRef,
    properties: WriterProperties,
    file_bytes: u64,
    open: Option<Part>,
    /// Files that are complete.
    complete: u64,
}

impl Parts {
    pub(super) fn new(folder: PathBuf, schema: SchemaRef, properties: WriterProperties, file_bytes: u64) -> Self {
        Self { folder, schema, properties, file_bytes, open: None, complete: 0 }
    }

    /// Opens the file to which the next so many rows go; returns the numbers of its folder and of the file in it.
    pub(super) fn place(&mut self, rows: u64) -> Result<[i64; 2], TableError> {
        if self.open.as_ref().is_some_and(|part| part.is_full_with(rows, self.file_bytes)) {
            self.close()?;
        }
        let [chunk, file] = [self.complete / CHUNK_FILES, self.complete % CHUNK_FILES];
        if self.open.is_none() {
            let path = self.folder.join(format!("chunk-{chunk:03}/file-{file:03}.parquet"));
            self.open = Some(Part::create(path, self.schema.clone(), self.properties.clone())?);
        }
        Ok([chunk as i64, file as i64])
    }

    /// Appends rows to the open file, column by column.
    pub(super) fn write(&mut self, columns: Vec<Result<ArrayRef, ArrowError>>) -> Result<(), TableError> {
        self.open.as_mut().map_or(Ok(()), |part| part.write(columns))
    }

    /// Completes the open file.
    pub(super) fn close(&mut self) -> Result<(), TableError> {
        let Some(part) = self.open.take() else { return Ok(()) };
        self.complete += 1;
        part.finish()
    }
}
