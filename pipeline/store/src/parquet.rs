//! Parquet tables of a release: writes and reads the rows of `sastrugi-schemas`.
//!
//! Each field's metadata holds its unit and description. The file's metadata holds the provenance (`sastrugi.study_sha256`,
//! `.seed`, `.version`, `.license`, `.table`), repeated in the metadata of the Arrow schema for readers that show only that. Rows
//! are sorted by their keys, which are never null; a `NaN` is stored as null, also within a list. Memory is bounded by one row
//! group, whatever the number of rows.

mod headers;
mod stream;
#[cfg(test)]
mod tests;

pub use stream::{Batches, FFI_ArrowArrayStream, FFI_ArrowSchema, Run, TableFiles};

use crate::PROGRAM;
use crate::atomic::{AtomicFile, Refused, Target};
use crate::digest::ContentHash;
use crate::guard::unless_panicking;
use arrow_array::builder::{BooleanBuilder, Float32Builder, Float64Builder, Int64Builder, ListBuilder, StringBuilder};
use arrow_array::types::{ArrowPrimitiveType, Float32Type, Float64Type};
use arrow_array::{
    Array, ArrayRef, BooleanArray, Float64Array, Int64Array, ListArray, PrimitiveArray, RecordBatch, StringArray,
};
use arrow_schema::{DataType, Field, FieldRef, Schema, SchemaRef};
use headers::Checked;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::{KeyValue, SortingColumn};
use parquet::file::properties::WriterProperties;
use parquet::schema::types::ColumnPath;
use sastrugi_schemas::tables::compare_keys;
use sastrugi_schemas::{Cell, Column, ColumnType, Record, Table, counted};
use std::cmp::Ordering;
use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Rows collected before they are encoded.
const BATCH_ROWS: usize = 4096;
/// Rows of a row group: about 28 MiB in memory for the widest table.
const ROW_GROUP_ROWS: usize = 1 << 16;
/// Name that Parquet gives the elements of a list.
pub(crate) const ELEMENT: &str = "element";
/// Zstandard level: the fastest; higher levels gain 3 % on samples.
const ZSTD_LEVEL: i32 = 1;

/// Failure to write or read a table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file is not a complete Parquet file of the table.
    #[error("{}: {reason}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The rows to write are not sorted by their keys, or a key is duplicated.
    #[error("{}: row {row} of table {table} is out of order: its key must be greater than that of the row before", path.display())]
    Order {
        /// The file.
        path: PathBuf,
        /// The table.
        table: &'static str,
        /// Number of the row, from 0.
        row: u64,
    },
    /// The rows could not be encoded.
    #[error("{}: could not encode the rows: {source}", path.display())]
    Encoding {
        /// The file.
        path: PathBuf,
        /// What failed.
        source: ParquetError,
    },
    /// The file system failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What failed.
        source: io::Error,
    },
}

impl TableError {
    /// True if the cause is the given file (missing or unusable), not the file system.
    pub fn unusable_input(&self) -> bool {
        match self {
            Self::Unusable { .. } => true,
            Self::Io { source, .. } => source.kind() == io::ErrorKind::NotFound,
            Self::Order { .. } | Self::Encoding { .. } => false,
        }
    }

    fn unusable(path: &Path, reason: impl ToString) -> Self {
        Self::Unusable { path: path.to_owned(), reason: reason.to_string() }
    }

    /// An error of the encoder, or of the file system behind it.
    pub(crate) fn encoding(path: &Path, source: ParquetError, refused: &Refused) -> Self {
        match refused.error() {
            Some(error) => Self::io(path, error),
            None => Self::Encoding { path: path.to_owned(), source },
        }
    }

    pub(crate) fn io(path: &Path, source: io::Error) -> Self {
        Self::Io { path: path.to_owned(), source }
    }
}

/// Provenance of a table, stored in the file's metadata.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TableMetadata {
    /// SHA-256 of the study.
    pub study_sha256: String,
    /// Seed of the study.
    pub seed: u64,
    /// Version of the program.
    pub version: String,
    /// Licence of the release, SPDX.
    pub license: String,
}

impl TableMetadata {
    fn pairs(&self, table: &str) -> [(String, String); 5] {
        let pair = |key: &str, value: &str| (key_of(key), value.to_owned());
        [
            pair("table", table),
            pair("study_sha256", &self.study_sha256),
            pair("seed", &self.seed.to_string()),
            pair("version", &self.version),
            pair("license", &self.license),
        ]
    }
}

/// Key of a part of the provenance in the metadata of a file.
fn key_of(part: &str) -> String {
    format!("sastrugi.{part}")
}

/// Summary of a written table.
#[derive(Clone, Debug, PartialEq)]
pub struct TableSummary {
    /// Number of rows.
    pub rows: u64,
    /// Keys of the first and the last row.
    pub ends: [Vec<Cell>; 2],
    /// Hash of the decoded rows: names of table and columns, then every value in order.
    pub content_sha256: String,
}

/// The Arrow schema of a table, with its provenance if given.
fn schema(table: &Table, provenance: Option<&TableMetadata>) -> SchemaRef {
    let field = |column: &Column| {
        let metadata = [("unit", column.unit), ("description", column.description)];
        Field::new(column.name, data_type(column.column_type), !column.key).with_metadata(metadata)
    };
    let pairs = provenance.into_iter().flat_map(|p| p.pairs(table.name));
    let metadata = pairs.chain([("description".to_owned(), table.description.to_owned())]).collect::<HashMap<_, _>>();
    Arc::new(Schema::new(table.columns.iter().map(field).collect::<Vec<_>>()).with_metadata(metadata))
}

fn data_type(column: ColumnType) -> DataType {
    match column {
        ColumnType::Text => DataType::Utf8,
        ColumnType::F64 => DataType::Float64,
        ColumnType::I64 => DataType::Int64,
        ColumnType::Bool => DataType::Boolean,
        ColumnType::F32List => DataType::List(element(DataType::Float32)),
        ColumnType::F64List => DataType::List(element(DataType::Float64)),
    }
}

/// The field of a list's elements.
pub(crate) fn element(data_type: DataType) -> FieldRef {
    Arc::new(Field::new(ELEMENT, data_type, true))
}

/// Parquet path of the floats in a column; `None` if it has none.
fn float_path(column: &Column) -> Option<ColumnPath> {
    match column.column_type {
        ColumnType::F64 => Some(ColumnPath::from(column.name)),
        ColumnType::F32List | ColumnType::F64List => {
            Some(ColumnPath::new([column.name, "list", ELEMENT].map(str::to_owned).into()))
        }
        ColumnType::Text | ColumnType::I64 | ColumnType::Bool => None,
    }
}

fn properties(table: &Table, metadata: Option<&TableMetadata>) -> Result<WriterProperties, ParquetError> {
    let pairs = |m: &TableMetadata| m.pairs(table.name).map(|(key, value)| KeyValue::new(key, value)).to_vec();
    let sorting = |index: usize| SortingColumn { column_idx: index as i32, descending: false, nulls_first: false };
    let mut builder = WriterProperties::builder()
        .set_created_by(PROGRAM.to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(ZSTD_LEVEL)?))
        .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
        .set_sorting_columns(Some((0..table.key_count()).map(sorting).collect()))
        .set_key_value_metadata(metadata.map(pairs));
    // Measured floats rarely repeat: byte planes compress better than a dictionary.
    for path in table.columns.iter().filter_map(float_path) {
        builder = builder
            .set_column_dictionary_enabled(path.clone(), false)
            .set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT);
    }
    Ok(builder.build())
}

/// Writes one table row by row. The file appears once [`TableWriter::finish`] has succeeded.
pub struct TableWriter {
    path: PathBuf,
    table: &'static Table,
    writer: ArrowWriter<AtomicFile>,
    schema: SchemaRef,
    columns: Vec<ColumnBuilder>,
    waiting: usize,
    rows: u64,
    /// Keys of the first row, and of the last one so far.
    ends: Option<[Vec<Cell>; 2]>,
    content: ContentHash,
    refused: Refused,
}

impl TableWriter {
    /// Starts a table in a file; `metadata` is `None` for files outside a release.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create<'a>(
        target: impl Into<Target<'a>>,
        table: &'static Table,
        metadata: Option<&TableMetadata>,
    ) -> Result<Self, TableError> {
        let target = target.into();
        let path = target.path;
        let encoding = |source| TableError::Encoding { path: path.to_owned(), source };
        let schema = schema(table, metadata);
        let file = AtomicFile::create(target).map_err(|e| TableError::io(path, e))?;
        let refused = file.refused();
        let properties = properties(table, metadata).map_err(encoding)?;
        let writer = ArrowWriter::try_new(file, schema.clone(), Some(properties)).map_err(encoding)?;
        Ok(Self {
            path: path.to_owned(),
            table,
            writer,
            schema,
            columns: table.columns.iter().map(|c| ColumnBuilder::new(c.column_type)).collect(),
            waiting: 0,
            rows: 0,
            ends: None,
            content: content_hash(table),
            refused,
        })
    }

    /// Appends a row, with its values in column order; its key must be greater than that of the previous row.
    ///
    /// # Errors
    /// [`TableError::Order`], or the file cannot be written.
    pub fn push(&mut self, mut cells: Vec<Cell>) -> Result<(), TableError> {
        let keys = self.table.key_count();
        let last = self.ends.as_ref().map(|[_, last]| last).filter(|_| keys > 0);
        if last.is_some_and(|last| compare_keys(last, &cells[..keys]) != Ordering::Less) {
            return Err(TableError::Order { path: self.path.clone(), table: self.table.name, row: self.rows });
        }
        for (column, cell) in self.columns.iter_mut().zip(&cells) {
            column.push(cell);
            hash_cell(&mut self.content, cell);
        }
        cells.truncate(keys);
        match &mut self.ends {
            Some([_, last]) => *last = cells,
            None => self.ends = Some([cells.clone(), cells]),
        }
        self.rows += 1;
        self.waiting += 1;
        if self.waiting == BATCH_ROWS { self.encode() } else { Ok(()) }
    }

    fn encode(&mut self) -> Result<(), TableError> {
        self.waiting = 0;
        let arrays = self.columns.iter_mut().map(ColumnBuilder::finish).collect();
        let batch = RecordBatch::try_new(self.schema.clone(), arrays).map_err(ParquetError::from);
        let written = batch.and_then(|batch| self.writer.write(&batch));
        written.map_err(|source| TableError::encoding(&self.path, source, &self.refused))
    }

    /// Completes the file and syncs it to disk under its name.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> Result<TableSummary, TableError> {
        if self.waiting > 0 {
            self.encode()?;
        }
        let Self { path, writer, rows, ends, content, refused, .. } = self;
        let file = writer.into_inner().map_err(|source| TableError::encoding(&path, source, &refused))?;
        file.commit().map_err(|e| TableError::io(&path, e))?;
        Ok(TableSummary { rows, ends: ends.unwrap_or_default(), content_sha256: content.finish() })
    }
}

fn content_hash(table: &Table) -> ContentHash {
    let mut hash = ContentHash::new("table");
    hash.text(table.name);
    hash.u64(table.columns.len() as u64);
    for column in table.columns {
        hash.text(column.name);
    }
    hash
}

fn hash_cell(hash: &mut ContentHash, cell: &Cell) {
    match cell {
        Cell::Null => hash.raw(&[0]),
        Cell::Text(v) => {
            hash.raw(&[1]);
            hash.text(v);
        }
        Cell::F64(v) => hash_float(hash, *v),
        Cell::I64(v) => {
            hash.raw(&[3]);
            hash.raw(&v.to_le_bytes());
        }
        Cell::Bool(v) => hash.raw(&[4, u8::from(*v)]),
        Cell::F32List(v) => hash_list(hash, v.iter().map(|v| f64::from(*v))),
        Cell::F64List(v) => hash_list(hash, v.iter().copied()),
    }
}

fn hash_float(hash: &mut ContentHash, value: f64) {
    hash.raw(&[2]);
    hash.f64(value);
}

fn hash_list(hash: &mut ContentHash, values: impl ExactSizeIterator<Item = f64>) {
    hash.raw(&[5]);
    hash.u64(values.len() as u64);
    for value in values {
        if value.is_nan() { hash.raw(&[0]) } else { hash_float(hash, value) }
    }
}

enum ColumnBuilder {
    Text(StringBuilder),
    F64(Float64Builder),
    I64(Int64Builder),
    Bool(BooleanBuilder),
    F32List(ListBuilder<Float32Builder>),
    F64List(ListBuilder<Float64Builder>),
}

impl ColumnBuilder {
    fn new(column: ColumnType) -> Self {
        match column {
            ColumnType::Text => Self::Text(StringBuilder::new()),
            ColumnType::F64 => Self::F64(Float64Builder::new()),
            ColumnType::I64 => Self::I64(Int64Builder::new()),
            ColumnType::Bool => Self::Bool(BooleanBuilder::new()),
            ColumnType::F32List => {
                Self::F32List(ListBuilder::new(Float32Builder::new()).with_field(element(DataType::Float32)))
            }
            ColumnType::F64List => {
                Self::F64List(ListBuilder::new(Float64Builder::new()).with_field(element(DataType::Float64)))
            }
        }
    }

    /// Appends a value; one of another type (which a row type cannot produce) counts as null.
    fn push(&mut self, cell: &Cell) {
        match (self, cell) {
            (Self::Text(b), Cell::Text(v)) => b.append_value(v),
            (Self::F64(b), Cell::F64(v)) => b.append_value(*v),
            (Self::I64(b), Cell::I64(v)) => b.append_value(*v),
            (Self::Bool(b), Cell::Bool(v)) => b.append_value(*v),
            (Self::F32List(b), Cell::F32List(v)) => b.append_value(v.iter().map(|v| (!v.is_nan()).then_some(*v))),
            (Self::F64List(b), Cell::F64List(v)) => b.append_value(v.iter().map(|v| (!v.is_nan()).then_some(*v))),
            (Self::Text(b), _) => b.append_null(),
            (Self::F64(b), _) => b.append_null(),
            (Self::I64(b), _) => b.append_null(),
            (Self::Bool(b), _) => b.append_null(),
            (Self::F32List(b), _) => b.append_null(),
            (Self::F64List(b), _) => b.append_null(),
        }
    }

    fn finish(&mut self) -> ArrayRef {
        match self {
            Self::Text(b) => Arc::new(b.finish()),
            Self::F64(b) => Arc::new(b.finish()),
            Self::I64(b) => Arc::new(b.finish()),
            Self::Bool(b) => Arc::new(b.finish()),
            Self::F32List(b) => Arc::new(b.finish()),
            Self::F64List(b) => Arc::new(b.finish()),
        }
    }
}

/// Rows of a table, their values in column order, read one batch at a time.
pub struct TableReader {
    path: PathBuf,
    batches: ParquetRecordBatchReader,
    batch: Vec<ColumnValues>,
    row: usize,
    rows: usize,
    broken: bool,
}

impl TableReader {
    /// Opens a file of a table.
    ///
    /// # Errors
    /// The file is missing, is not a Parquet file, or has different columns from the table.
    pub fn open(path: &Path, table: &Table) -> Result<Self, TableError> {
        let builder = open(path, table)?;
        let batches = decoding(path, || builder.with_batch_size(BATCH_ROWS).build())?;
        Ok(Self { path: path.to_owned(), batches, batch: vec![], row: 0, rows: 0, broken: false })
    }

    /// Loads the next batch that has rows; false at the end.
    fn advance(&mut self) -> Result<bool, TableError> {
        while self.row == self.rows {
            let batches = &mut self.batches;
            let Some(batch) = decoding(&self.path, || batches.next().transpose())? else { return Ok(false) };
            let values = batch.columns().iter().map(ColumnValues::of).collect::<Option<Vec<_>>>();
            self.batch = values.ok_or_else(|| TableError::unusable(&self.path, "has a column of unknown type"))?;
            (self.row, self.rows) = (0, batch.num_rows());
        }
        Ok(true)
    }

    fn read(&mut self) -> Vec<Cell> {
        let cells = self.batch.iter().map(|column| column.cell(self.row)).collect();
        self.row += 1;
        cells
    }
}

impl Iterator for TableReader {
    type Item = Result<Vec<Cell>, TableError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.broken {
            return None;
        }
        match self.advance() {
            Ok(more) => more.then(|| Ok(self.read())),
            Err(error) => {
                self.broken = true;
                Some(Err(error))
            }
        }
    }
}

enum ColumnValues {
    Text(StringArray),
    F64(Float64Array),
    I64(Int64Array),
    Bool(BooleanArray),
    F32List(Lists<Float32Type>),
    F64List(Lists<Float64Type>),
}

impl ColumnValues {
    fn of(array: &ArrayRef) -> Option<Self> {
        let any = array.as_any();
        match array.data_type() {
            DataType::Utf8 => any.downcast_ref().cloned().map(Self::Text),
            DataType::Float64 => any.downcast_ref().cloned().map(Self::F64),
            DataType::Int64 => any.downcast_ref().cloned().map(Self::I64),
            DataType::Boolean => any.downcast_ref().cloned().map(Self::Bool),
            DataType::List(element) if *element.data_type() == DataType::Float32 => Lists::of(array).map(Self::F32List),
            DataType::List(element) if *element.data_type() == DataType::Float64 => Lists::of(array).map(Self::F64List),
            _ => None,
        }
    }

    fn cell(&self, row: usize) -> Cell {
        match self {
            Self::Text(a) if a.is_valid(row) => Cell::Text(a.value(row).to_owned()),
            Self::F64(a) if a.is_valid(row) => Cell::F64(a.value(row)),
            Self::I64(a) if a.is_valid(row) => Cell::I64(a.value(row)),
            Self::Bool(a) if a.is_valid(row) => Cell::Bool(a.value(row)),
            Self::F32List(a) => a.row(row, f32::NAN).map_or(Cell::Null, Cell::F32List),
            Self::F64List(a) => a.row(row, f64::NAN).map_or(Cell::Null, Cell::F64List),
            _ => Cell::Null,
        }
    }
}

/// Lists of floats, with their elements stored one list after the other.
struct Lists<T: ArrowPrimitiveType> {
    lists: ListArray,
    elements: PrimitiveArray<T>,
}

impl<T: ArrowPrimitiveType> Lists<T> {
    fn of(array: &ArrayRef) -> Option<Self> {
        let lists: ListArray = array.as_any().downcast_ref().cloned()?;
        let elements = lists.values().as_any().downcast_ref().cloned()?;
        Some(Self { lists, elements })
    }

    /// A row's values, `absent` for an element that is null; `None` for a list that is null or reaches beyond the elements.
    fn row(&self, row: usize, absent: T::Native) -> Option<Vec<T::Native>> {
        let offset = |row: usize| usize::try_from(*self.lists.value_offsets().get(row)?).ok();
        let range = offset(row)?..offset(row + 1)?;
        let values = self.elements.values().get(range.clone()).filter(|_| self.lists.is_valid(row))?;
        let value = |(at, value): (usize, &T::Native)| if self.elements.is_valid(at) { *value } else { absent };
        Some(range.zip(values).map(value).collect())
    }
}

fn open(path: &Path, table: &Table) -> Result<ParquetRecordBatchReaderBuilder<Checked>, TableError> {
    let io = |e| TableError::io(path, e);
    let file = crate::file::open(path).map_err(io)?;
    let Some(file) = Checked::of(file).map_err(io)? else {
        return Err(TableError::unusable(
            path,
            "the file is damaged: its footer has fields that Parquet does not define",
        ));
    };
    let builder = decoding(path, || ParquetRecordBatchReaderBuilder::try_new(file))?;
    let found = builder.schema();
    for (column, expected) in schema(table, None).fields().iter().enumerate() {
        let Some(field) = found.fields().get(column) else {
            let reason = format!("column {} of table {} is missing", expected.name(), table.name);
            return Err(TableError::unusable(path, reason));
        };
        if !is_same_column(field, expected) {
            let reason = format!(
                "column {column} of table {} is {}, but this version expects {}",
                table.name,
                describe(field),
                describe(expected)
            );
            return Err(TableError::unusable(path, reason));
        }
    }
    if found.fields().len() > table.columns.len() {
        let extra = counted(found.fields().len() - table.columns.len(), "unexpected column");
        let reason = format!("table {} has {extra}", table.name);
        return Err(TableError::unusable(path, reason));
    }
    Ok(builder)
}

/// Runs the decoder, which panics on some damaged files, and turns a panic into an error.
fn decoding<T, E: ToString>(path: &Path, decode: impl FnOnce() -> Result<T, E>) -> Result<T, TableError> {
    match unless_panicking(decode) {
        Some(decoded) => decoded.map_err(|e| TableError::unusable(path, e)),
        None => Err(TableError::unusable(path, "the file is damaged: decoding failed")),
    }
}

/// Whether a column can be read as the expected one. Its description is for people, and may be worded differently in another build.
fn is_same_column(found: &Field, expected: &Field) -> bool {
    let kind = |field: &Field| (field.name().clone(), field.data_type().clone(), field.is_nullable());
    kind(found) == kind(expected) && found.metadata().get("unit") == expected.metadata().get("unit")
}

fn describe(field: &Field) -> String {
    let unit = field.metadata().get("unit").map_or("", String::as_str);
    format!("{} ({}, unit \"{unit}\", {})", field.name(), field.data_type(), nullability(field))
}

fn nullability(field: &Field) -> &'static str {
    if field.is_nullable() { "nullable" } else { "never null" }
}

/// Writes a table of rows sorted by key to a file.
///
/// # Errors
/// As [`TableWriter::push`] and [`TableWriter::finish`].
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_schemas::tables::PsdRow;
/// use sastrugi_store::parquet::{TableError, read_table, write_table};
///
/// let row = |bin: i64, psd_m4: f64| PsdRow {
///     surface_id: "a".to_owned(),
///     bin,
///     frequency_cycles_m: 0.25 * bin as f64,
///     psd_m4,
///     modes: 8,
/// };
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("psd.parquet");
/// let summary = write_table(&path, [row(1, 0.5), row(2, f64::NAN)], None)?;
/// assert_eq!(summary.rows, 2);
/// let back: Vec<PsdRow> = read_table(&path)?;
/// assert_eq!(back[0], row(1, 0.5));
/// assert!(back[1].psd_m4.is_nan());
///
/// // Keys must increase.
/// assert!(matches!(write_table(&path, [row(2, 1.0), row(1, 1.0)], None), Err(TableError::Order { row: 1, .. })));
/// # Ok(())
/// # }
/// ```
pub fn write_table<'a, R: Record>(
    target: impl Into<Target<'a>>,
    rows: impl IntoIterator<Item = R>,
    metadata: Option<&TableMetadata>,
) -> Result<TableSummary, TableError> {
    let mut writer = TableWriter::create(target, &R::TABLE, metadata)?;
    rows.into_iter().try_for_each(|row| writer.push(row.cells()))?;
    writer.finish()
}

/// All rows of a file.
///
/// # Errors
/// As [`TableReader::open`]; also if the rows cannot be decoded.
pub fn read_table<R: Record>(path: &Path) -> Result<Vec<R>, TableError> {
    let mut rows = Vec::new();
    for_each_row(path, |row| rows.push(row))?;
    Ok(rows)
}

/// Calls `f` with every row of a file.
///
/// # Errors
/// As [`read_table`].
pub fn for_each_row<R: Record>(path: &Path, mut f: impl FnMut(R)) -> Result<(), TableError> {
    let lacking = || TableError::unusable(path, "has a null in a column that requires a value");
    TableReader::open(path, &R::TABLE)?.try_for_each(|cells| {
        f(R::from_cells(cells?).ok_or_else(lacking)?);
        Ok(())
    })
}

/// Human-readable description of a Parquet file of a release.
///
/// # Errors
/// As [`TableReader::open`]; also a file that is not a table of a release.
pub fn describe_file(path: &Path) -> Result<serde_json::Value, TableError> {
    for table in sastrugi_schemas::tables::ALL {
        match open(path, table) {
            Ok(builder) => {
                let rows = builder.metadata().file_metadata().num_rows();
                return Ok(serde_json::json!({
                    "what": "table",
                    "table": table.name,
                    "description": table.description,
                    "rows": rows,
                    "columns": table.columns.len(),
                }));
            }
            Err(error @ TableError::Io { .. }) => return Err(error),
            Err(_) => {}
        }
    }
    Err(TableError::Unusable { path: path.to_owned(), reason: "is not a table of a release".to_owned() })
}

/// What a file of a table states about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stated {
    /// Number of rows.
    pub rows: u64,
    /// SHA-256 of the study that it was made from, if it has a provenance.
    pub study_sha256: Option<String>,
}

/// Checks that a file has a table's columns, types, units and descriptions; returns what it states.
///
/// # Errors
/// As [`TableReader::open`].
pub fn check_table(path: &Path, table: &Table) -> Result<Stated, TableError> {
    let builder = open(path, table)?;
    let stated = builder.metadata().file_metadata();
    let mut pairs = stated.key_value_metadata().into_iter().flatten();
    let study = pairs.find(|pair| pair.key == key_of("study_sha256"));
    Ok(Stated { rows: stated.num_rows().unsigned_abs(), study_sha256: study.and_then(|pair| pair.value.clone()) })
}
