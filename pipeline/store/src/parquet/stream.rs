//! The rows of a table in several files as one stream of Arrow record batches, for programs in other languages that take them without a
//! copy ([`FFI_ArrowArrayStream`]), and single columns of it.

use super::{BATCH_ROWS, ColumnValues, TableError, decoding, open, schema};
pub use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{Array, BooleanArray, RecordBatch, RecordBatchReader, StringArray};
pub use arrow_schema::ffi::FFI_ArrowSchema;
use arrow_schema::{ArrowError, SchemaRef};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowPredicate, ArrowPredicateFn, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder, RowFilter,
};
use sastrugi_schemas::{Cell, ColumnType, Table};
use std::fs::File;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// The files of a table, and which of its rows are wanted.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_schemas::tables::PsdRow;
/// use sastrugi_schemas::{Cell, Record};
/// use sastrugi_store::parquet::{TableFiles, write_table};
/// use std::ops::ControlFlow;
///
/// let row = |surface: &str, bin: i64| PsdRow {
///     surface_id: surface.to_owned(),
///     bin,
///     frequency_cycles_m: 0.25 * bin as f64,
///     psd_m4: 1.0,
///     modes: 8,
/// };
/// let folder = tempfile::tempdir()?;
/// let paths = ["a", "b"].map(|name| folder.path().join(format!("{name}.parquet")));
/// write_table(&paths[0], [row("a", 1), row("a", 2)], None)?;
/// write_table(&paths[1], [row("a", 3), row("b", 1)], None)?;
///
/// let all = TableFiles::new(&PsdRow::TABLE, paths.to_vec())?;
/// assert_eq!(all.rows()?, 4);
/// let of_a = all.selecting("surface_id", "a")?;
/// assert_eq!(of_a.column("bin")?, [1, 2, 3].map(Cell::I64));
/// let mut seen = Vec::new();
/// of_a.visit(["bin", "surface_id"], |[bin, _]| {
///     seen.push(bin);
///     if seen.len() < 2 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
/// })?;
/// assert_eq!(seen, [1, 2].map(Cell::I64));
/// assert_eq!(of_a.batches().map(|batch| batch.map(|b| b.num_rows())).sum::<Result<usize, _>>()?, 3);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct TableFiles {
    table: &'static Table,
    paths: Vec<PathBuf>,
    /// Columns of text, by position, and the text that rows must have there.
    wanted: Vec<(usize, String)>,
    schema: SchemaRef,
}

impl TableFiles {
    /// The rows of these files, one file after the other. Only the first is opened here, for the schema with its provenance.
    ///
    /// # Errors
    /// A first file that is missing, or is not a file of the table.
    pub fn new(table: &'static Table, paths: Vec<PathBuf>) -> Result<Self, TableError> {
        let schema = match paths.first() {
            Some(path) => open(path, table)?.schema().clone(),
            None => schema(table, None),
        };
        Ok(Self { table, paths, wanted: Vec::new(), schema })
    }

    /// The table.
    pub fn table(&self) -> &'static Table {
        self.table
    }

    /// The rows among these that have this text in a column.
    ///
    /// # Errors
    /// A column that the table does not have, or that does not hold text.
    pub fn selecting(mut self, column: &str, text: &str) -> Result<Self, TableError> {
        let position = self.position(column)?;
        if self.table.columns[position].column_type != ColumnType::Text {
            return Err(self.unusable(format!("column {column} of table {} does not hold text", self.table.name)));
        }
        self.wanted.push((position, text.to_owned()));
        Ok(self)
    }

    /// The rows as record batches.
    pub fn batches(&self) -> Batches {
        Batches { files: self.clone(), columns: None, next: 0, current: None }
    }

    /// The rows as a stream of the Arrow C data interface.
    pub fn stream(&self) -> FFI_ArrowArrayStream {
        FFI_ArrowArrayStream::new(Box::new(self.batches()))
    }

    /// The schema in the form of the Arrow C data interface.
    ///
    /// # Errors
    /// A schema that the interface cannot express (a bug).
    pub fn c_schema(&self) -> Result<FFI_ArrowSchema, TableError> {
        FFI_ArrowSchema::try_from(self.schema.as_ref()).map_err(|e| self.unusable(e))
    }

    /// Number of rows. Without a selection only the ends of the files are read.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn rows(&self) -> Result<u64, TableError> {
        if !self.wanted.is_empty() {
            return Ok(self.column(self.table.columns[0].name)?.len() as u64);
        }
        self.paths.iter().map(|path| Ok(super::check_table(path, self.table)?.rows)).sum()
    }

    /// The values of a column.
    ///
    /// # Errors
    /// A column that the table does not have; a file that cannot be read.
    pub fn column(&self, name: &str) -> Result<Vec<Cell>, TableError> {
        let mut values = Vec::new();
        self.visit([name], |[value]| {
            values.push(value);
            ControlFlow::Continue(())
        })?;
        Ok(values)
    }

    /// Calls `f` with the values of these columns, row by row, until it breaks. Other columns are not decoded.
    ///
    /// # Errors
    /// As [`Self::column`].
    pub fn visit<const N: usize>(
        &self,
        columns: [&str; N],
        mut f: impl FnMut([Cell; N]) -> ControlFlow<()>,
    ) -> Result<(), TableError> {
        let mut places = [0; N];
        for (place, column) in places.iter_mut().zip(columns) {
            *place = self.position(column)?;
        }
        let mut batches = Batches { columns: Some(places.to_vec()), ..self.batches() };
        while let Some(batch) = batches.advance() {
            let batch = batch?;
            // A batch has its columns in the order of the table.
            let rank = |place: &usize| places.iter().filter(|other| *other < place).count();
            let values = places.iter().map(|place| ColumnValues::of(batch.columns().get(rank(place))?));
            let values: Option<Vec<ColumnValues>> = values.collect();
            let values = values.ok_or_else(|| self.unusable("has a column of unknown type"))?;
            for row in 0..batch.num_rows() {
                if f(std::array::from_fn(|k| values[k].cell(row))).is_break() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    fn position(&self, column: &str) -> Result<usize, TableError> {
        self.table.position(column).ok_or_else(|| {
            let known: Vec<&str> = self.table.columns.iter().map(|c| c.name).collect();
            self.unusable(format!("table {} has no column {column}; known: {}", self.table.name, known.join(", ")))
        })
    }

    fn unusable(&self, reason: impl ToString) -> TableError {
        TableError::unusable(self.paths.first().map_or(Path::new(self.table.name), PathBuf::as_path), reason)
    }

    /// A reader of one file; with `columns`, of those alone.
    fn reader(&self, path: &Path, columns: Option<&[usize]>) -> Result<ParquetRecordBatchReader, TableError> {
        let mut builder = open(path, self.table)?.with_batch_size(BATCH_ROWS);
        if !self.wanted.is_empty() {
            let predicates = self.wanted.iter().map(|(column, text)| predicate(&builder, *column, text.clone()));
            let filter = RowFilter::new(predicates.collect());
            builder = builder.with_row_filter(filter);
        }
        if let Some(columns) = columns {
            let mask = ProjectionMask::roots(builder.parquet_schema(), columns.iter().copied());
            builder = builder.with_projection(mask);
        }
        decoding(path, || builder.build())
    }
}

/// Keeps rows with this text in a column.
fn predicate(builder: &ParquetRecordBatchReaderBuilder<File>, column: usize, text: String) -> Box<dyn ArrowPredicate> {
    let mask = ProjectionMask::roots(builder.parquet_schema(), [column]);
    Box::new(ArrowPredicateFn::new(mask, move |batch: RecordBatch| {
        let texts = batch.column(0).as_any().downcast_ref::<StringArray>();
        let texts = texts.ok_or_else(|| ArrowError::CastError("the column does not hold text".to_owned()))?;
        let has = |row: usize| texts.is_valid(row) && texts.value(row) == text;
        Ok((0..texts.len()).map(|row| Some(has(row))).collect::<BooleanArray>())
    }))
}

/// The rows of [`TableFiles`], a batch at a time.
pub struct Batches {
    files: TableFiles,
    /// The only columns that are read, by position.
    columns: Option<Vec<usize>>,
    /// Place of the next file.
    next: usize,
    current: Option<(PathBuf, ParquetRecordBatchReader)>,
}

impl Batches {
    /// The next batch; `None` at the end, and after an error.
    fn advance(&mut self) -> Option<Result<RecordBatch, TableError>> {
        let batch = self.try_advance().transpose();
        if let Some(Err(_)) = &batch {
            (self.current, self.next) = (None, self.files.paths.len());
        }
        batch
    }

    fn try_advance(&mut self) -> Result<Option<RecordBatch>, TableError> {
        loop {
            if let Some((path, reader)) = &mut self.current {
                if let Some(batch) = decoding(path, || reader.next().transpose())? {
                    return Ok(Some(batch));
                }
                self.current = None;
            }
            let Some(path) = self.files.paths.get(self.next).cloned() else { return Ok(None) };
            self.next += 1;
            let reader = self.files.reader(&path, self.columns.as_deref())?;
            self.current = Some((path, reader));
        }
    }
}

impl Iterator for Batches {
    type Item = Result<RecordBatch, ArrowError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.advance().map(|batch| batch.map_err(|e| ArrowError::ExternalError(Box::new(e))))
    }
}

impl RecordBatchReader for Batches {
    fn schema(&self) -> SchemaRef {
        self.files.schema.clone()
    }
}
