//! The rows of a table in several files as one stream of Arrow record batches, for programs in other languages that take them without a
//! copy ([`FFI_ArrowArrayStream`]), and single columns of it.

use super::headers::Checked;
use super::{BATCH_ROWS, ColumnValues, TableError, decoding, open, schema};
pub use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{Array, BooleanArray, Float64Array, Int64Array, RecordBatch, RecordBatchReader, StringArray};
pub use arrow_schema::ffi::FFI_ArrowSchema;
use arrow_schema::{ArrowError, SchemaRef};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowPredicate, ArrowPredicateFn, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder, RowFilter,
};
use parquet::file::metadata::{ParquetMetaData, RowGroupMetaData};
use sastrugi_schemas::{Cell, ColumnType, Table};
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
/// let of_a = all.clone().selecting("surface_id", "a")?;
/// assert_eq!(of_a.column("bin")?, [1, 2, 3].map(Cell::I64));
/// assert_eq!(of_a.integers("bin")?, Some(vec![1, 2, 3]));
/// assert_eq!(all.between("surface_id", "b", "c")?.floats("frequency_cycles_m")?, [0.25]);
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
    /// Conditions on columns of text that rows must meet.
    wanted: Vec<Wanted>,
    schema: SchemaRef,
}

/// A column of text, by position, and the first and the last text wanted in it, in the order of their bytes.
#[derive(Clone, Debug)]
struct Wanted {
    column: usize,
    first: String,
    last: String,
}

/// Consecutive rows with the same text in one column, and the floats of other columns there.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// The text.
    pub text: String,
    /// The floats of each column, NaN for null.
    pub floats: Vec<Vec<f64>>,
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
    pub fn selecting(self, column: &str, text: &str) -> Result<Self, TableError> {
        self.between(column, text, text)
    }

    /// The rows among these whose text in a column lies between `first` and `last`, inclusive, in byte order. Row groups whose statistics exclude
    /// such rows are not decoded.
    ///
    /// # Errors
    /// As [`Self::selecting`].
    pub fn between(mut self, column: &str, first: &str, last: &str) -> Result<Self, TableError> {
        let position = self.typed(column, ColumnType::Text, "text")?;
        self.wanted.push(Wanted { column: position, first: first.to_owned(), last: last.to_owned() });
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
            let (mut rows, mut batches) = (0, self.batches_of(&[0]));
            while let Some(batch) = batches.advance() {
                rows += batch?.num_rows() as u64;
            }
            return Ok(rows);
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

    /// The values of a column of floats, NaN for null.
    ///
    /// # Errors
    /// As [`Self::column`]; a column of another type.
    pub fn floats(&self, name: &str) -> Result<Vec<f64>, TableError> {
        let place = self.typed(name, ColumnType::F64, "floats")?;
        let mut values = Vec::new();
        let mut batches = self.batches_of(&[place]);
        while let Some(batch) = batches.advance() {
            let batch = batch?;
            let column = self.column_of::<Float64Array>(&batch, &[place], place)?;
            values.extend((0..column.len()).map(|row| float(column, row)));
        }
        Ok(values)
    }

    /// The values of a column of integers; `None` if one is null.
    ///
    /// # Errors
    /// As [`Self::floats`].
    pub fn integers(&self, name: &str) -> Result<Option<Vec<i64>>, TableError> {
        let place = self.typed(name, ColumnType::I64, "integers")?;
        let mut values = Vec::new();
        let mut batches = self.batches_of(&[place]);
        while let Some(batch) = batches.advance() {
            let batch = batch?;
            let column = self.column_of::<Int64Array>(&batch, &[place], place)?;
            if column.null_count() > 0 {
                return Ok(None);
            }
            values.extend_from_slice(column.values());
        }
        Ok(Some(values))
    }

    /// Runs of rows with the same text in one column, with the floats of other columns, read in one pass. Null counts as an empty text.
    ///
    /// # Errors
    /// As [`Self::floats`].
    pub fn runs(&self, text: &str, floats: &[&str]) -> Result<Vec<Run>, TableError> {
        let own = self.typed(text, ColumnType::Text, "text")?;
        let others = floats.iter().map(|name| self.typed(name, ColumnType::F64, "floats"));
        let others = others.collect::<Result<Vec<usize>, TableError>>()?;
        let places: Vec<usize> = [own].into_iter().chain(others.iter().copied()).collect();
        let mut runs: Vec<Run> = Vec::new();
        let mut batches = self.batches_of(&places);
        while let Some(batch) = batches.advance() {
            let batch = batch?;
            let texts = self.column_of::<StringArray>(&batch, &places, own)?;
            let columns = others.iter().map(|place| self.column_of::<Float64Array>(&batch, &places, *place));
            let columns = columns.collect::<Result<Vec<&Float64Array>, TableError>>()?;
            extend_runs(&mut runs, texts, &columns);
        }
        runs.iter_mut().flat_map(|run| &mut run.floats).for_each(Vec::shrink_to_fit);
        Ok(runs)
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
        let mut batches = self.batches_of(&places);
        while let Some(batch) = batches.advance() {
            let batch = batch?;
            let values = places.iter().map(|place| ColumnValues::of(batch.columns().get(rank(&places, *place))?));
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

    /// The rows as record batches of these columns alone, in the order of the table.
    fn batches_of(&self, places: &[usize]) -> Batches {
        Batches { columns: Some(places.to_vec()), ..self.batches() }
    }

    /// A column in a batch of [`Self::batches_of`].
    fn column_of<'a, A: Array + 'static>(
        &self,
        batch: &'a RecordBatch,
        places: &[usize],
        place: usize,
    ) -> Result<&'a A, TableError> {
        let column = batch.columns().get(rank(places, place));
        let column = column.and_then(|column| column.as_any().downcast_ref::<A>());
        column.ok_or_else(|| self.unusable("has a column of unknown type"))
    }

    /// Position of a column that must have this type; `what` names the expected values in the error.
    fn typed(&self, column: &str, column_type: ColumnType, what: &str) -> Result<usize, TableError> {
        let position = self.position(column)?;
        if self.table.columns[position].column_type != column_type {
            return Err(self.unusable(format!("column {column} of table {} does not have {what}", self.table.name)));
        }
        Ok(position)
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
            let groups = self.groups(builder.metadata());
            let predicates = self.wanted.iter().map(|wanted| predicate(&builder, wanted.clone()));
            let filter = RowFilter::new(predicates.collect());
            builder = builder.with_row_groups(groups).with_row_filter(filter);
        }
        if let Some(columns) = columns {
            let mask = ProjectionMask::roots(builder.parquet_schema(), columns.iter().copied());
            builder = builder.with_projection(mask);
        }
        decoding(path, || builder.build())
    }

    /// The row groups that may have wanted rows, according to their statistics.
    pub(super) fn groups(&self, metadata: &ParquetMetaData) -> Vec<usize> {
        let may_hold = |group: &RowGroupMetaData, wanted: &Wanted| {
            let name = self.table.columns[wanted.column].name;
            let column = group.columns().iter().find(|column| column.column_path().parts() == [name]);
            // Long texts are truncated there, but the bounds always enclose those of the group.
            let stated = column.and_then(|column| column.statistics()).filter(|stated| !stated.is_min_max_deprecated());
            let ends = stated.and_then(|stated| Some((stated.min_bytes_opt()?, stated.max_bytes_opt()?)));
            ends.is_none_or(|(low, high)| low <= wanted.last.as_bytes() && wanted.first.as_bytes() <= high)
        };
        let groups = metadata.row_groups().iter().enumerate();
        let chosen = groups.filter(|(_, group)| self.wanted.iter().all(|wanted| may_hold(group, wanted)));
        chosen.map(|(number, _)| number).collect()
    }
}

/// Place of a column in a batch, which has the columns at `places` in the order of the table.
fn rank(places: &[usize], place: usize) -> usize {
    places.iter().filter(|other| **other < place).count()
}

fn float(column: &Float64Array, row: usize) -> f64 {
    if column.is_valid(row) { column.value(row) } else { f64::NAN }
}

/// Appends the rows of a batch to the last run, as long as the text stays the same, and to new ones.
fn extend_runs(runs: &mut Vec<Run>, texts: &StringArray, columns: &[&Float64Array]) {
    let text = |row: usize| if texts.is_valid(row) { texts.value(row) } else { "" };
    let mut start = 0;
    while start < texts.len() {
        let own = text(start);
        let end = (start..texts.len()).find(|row| text(*row) != own).unwrap_or(texts.len());
        if runs.last().is_none_or(|run| run.text != own) {
            runs.push(Run { text: own.to_owned(), floats: vec![Vec::new(); columns.len()] });
        }
        if let Some(run) = runs.last_mut() {
            for (values, column) in run.floats.iter_mut().zip(columns) {
                values.extend((start..end).map(|row| float(column, row)));
            }
        }
        start = end;
    }
}

/// Keeps rows with wanted text in a column.
fn predicate(builder: &ParquetRecordBatchReaderBuilder<Checked>, wanted: Wanted) -> Box<dyn ArrowPredicate> {
    let mask = ProjectionMask::roots(builder.parquet_schema(), [wanted.column]);
    Box::new(ArrowPredicateFn::new(mask, move |batch: RecordBatch| {
        let texts = batch.column(0).as_any().downcast_ref::<StringArray>();
        let texts = texts.ok_or_else(|| ArrowError::CastError("the column does not hold text".to_owned()))?;
        let is_wanted = |text: &str| wanted.first.as_str() <= text && text <= wanted.last.as_str();
        let has = |row: usize| texts.is_valid(row) && is_wanted(texts.value(row));
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
