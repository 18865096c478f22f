use super::*;
use proptest::prelude::*;
use sastrugi_schemas::tables::{self, CovarianceRow, PsdRow, SampleRow};
use std::fs;
use std::ops::ControlFlow;

fn metadata() -> TableMetadata {
    TableMetadata {
        study_sha256: "ab".repeat(32),
        seed: 7,
        version: "0.1.0".to_owned(),
        license: "CC-BY-4.0".to_owned(),
    }
}

fn row(fit: u32, bin: i64, value: f64) -> CovarianceRow {
    CovarianceRow {
        fit_id: format!("fit-{fit:03}"),
        bin,
        lag_m: value,
        azimuth_deg: (bin % 2 == 0).then_some(value),
        covariance_m2: -value,
        pairs: bin * 3,
        model_m2: value * 1e300,
        surface_model_m2: f64::NAN,
        covariance_low_m2: -value,
        covariance_high_m2: value,
    }
}

/// A row of a table with lists, each with the given values.
fn row_of_lists(number: i64, values: &[f64]) -> SampleRow {
    let cell = |column: &Column| match column.column_type {
        ColumnType::Text => Cell::Text("a".to_owned()),
        ColumnType::F64 => Cell::F64(number as f64),
        ColumnType::I64 => Cell::I64(number),
        ColumnType::Bool => Cell::Bool(true),
        ColumnType::F32List => Cell::F32List(values.iter().map(|v| *v as f32).collect()),
        ColumnType::F64List => Cell::F64List(values.to_vec()),
    };
    SampleRow::from_cells(SampleRow::TABLE.columns.iter().map(cell).collect()).unwrap()
}

fn rows_of_lists(lists: &[Vec<f64>]) -> Vec<SampleRow> {
    lists.iter().zip(0..).map(|(values, number)| row_of_lists(number, values)).collect()
}

/// The values of rows as text, in which NaN equals NaN.
fn shown<R: Record>(rows: &[R]) -> Vec<String> {
    rows.iter().map(|row| format!("{:?}", row.cells())).collect()
}

/// Lists of zero to six floats, some of them NaN.
fn lists(floats: impl Strategy<Value = f64>) -> impl Strategy<Value = Vec<Vec<f64>>> {
    let value = prop::option::of(floats).prop_map(|v| v.unwrap_or(f64::NAN));
    prop::collection::vec(prop::collection::vec(value, 0..7), 1..200)
}

fn write<R: Record>(path: &Path, rows: &[R]) -> TableSummary {
    write_table(path, rows.iter().cloned(), Some(&metadata())).unwrap()
}

fn same(a: &CovarianceRow, b: &CovarianceRow) -> bool {
    a.cells() == b.cells()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]

    #[test]
    fn prop_rows_are_read_back(values in prop::collection::vec(any::<f64>(), 1..400)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        let rows: Vec<_> = values.iter().zip(0..).map(|(&v, n)| row(n / 40, i64::from(n % 40), v)).collect();
        let summary = write(&path, &rows);
        let back: Vec<CovarianceRow> = read_table(&path).unwrap();
        prop_assert_eq!(summary.rows, rows.len() as u64);
        prop_assert!(back.len() == rows.len() && back.iter().zip(&rows).all(|(a, b)| same(a, b)));
        let again = write(&folder.path().join("u.parquet"), &back);
        prop_assert_eq!(again, summary);
        prop_assert_eq!(fs::read(path).unwrap(), fs::read(folder.path().join("u.parquet")).unwrap());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]

    #[test]
    fn prop_lists_are_read_back(lists in lists(any::<f64>())) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        let rows = rows_of_lists(&lists);
        let summary = write(&path, &rows);
        let back: Vec<SampleRow> = read_table(&path).unwrap();
        prop_assert_eq!(shown(&back), shown(&rows));
        prop_assert_eq!(write(&folder.path().join("u.parquet"), &back), summary);
        prop_assert_eq!(fs::read(path).unwrap(), fs::read(folder.path().join("u.parquet")).unwrap());
    }
}

/// Distributing the same elements over different lists, or a missing element, changes the content hash.
#[test]
fn val_the_content_hash_depends_on_where_lists_end() {
    let folder = tempfile::tempdir().unwrap();
    let content = |lists: &[Vec<f64>]| write(&folder.path().join("t.parquet"), &rows_of_lists(lists)).content_sha256;
    let found = [
        content(&[vec![1.0, 2.0], vec![]]),
        content(&[vec![1.0], vec![2.0]]),
        content(&[vec![], vec![1.0, 2.0]]),
        content(&[vec![1.0], vec![f64::NAN]]),
        content(&[vec![1.0], vec![]]),
    ];
    let different: std::collections::BTreeSet<_> = found.iter().collect();
    assert_eq!(different.len(), found.len());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    /// A truncated table is an error; one with other bytes is an error or has values, never a panic.
    #[test]
    fn prop_truncated_tables_are_errors_and_damaged_ones_never_panic(
        at in any::<prop::sample::Index>(),
        bytes in prop::collection::vec(any::<u8>(), 1..5),
        cut in any::<Option<prop::sample::Index>>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        fs::write(&path, damaged(sample(), at, &bytes, cut)).unwrap();
        let flat = read_table::<CovarianceRow>(&path);
        fs::write(&path, damaged(sample_of_lists(), at, &bytes, cut)).unwrap();
        let nested = read_table::<SampleRow>(&path);
        prop_assert!(cut.is_none() || flat.is_err() && nested.is_err());
    }
}

/// A file with some bytes replaced, and optionally truncated.
fn damaged(file: &[u8], at: prop::sample::Index, bytes: &[u8], cut: Option<prop::sample::Index>) -> Vec<u8> {
    let mut file = file.to_vec();
    let at = at.index(file.len());
    let end = (at + bytes.len()).min(file.len());
    file[at..end].copy_from_slice(&bytes[..end - at]);
    if let Some(cut) = cut {
        file.truncate(cut.index(file.len()));
    }
    file
}

fn sample() -> &'static [u8] {
    static SAMPLE: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
    SAMPLE.get_or_init(|| {
        let rows: Vec<_> = (0..200).map(|n| row(n / 40, i64::from(n % 40), f64::from(n).sqrt())).collect();
        written(&rows)
    })
}

fn sample_of_lists() -> &'static [u8] {
    static SAMPLE: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
    SAMPLE.get_or_init(|| {
        let value = |n: i64| if n % 7 == 0 { f64::NAN } else { n as f64 };
        let rows: Vec<_> =
            (0..200).map(|n| row_of_lists(n, &[value(n), value(3 * n + 1)][..(n % 3) as usize])).collect();
        written(&rows)
    })
}

fn written<R: Record>(rows: &[R]) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    write(&path, rows);
    fs::read(path).unwrap()
}

#[test]
fn val_rows_out_of_order_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    let mut writer = TableWriter::create(&path, &CovarianceRow::TABLE, None).unwrap();
    writer.push(row(0, 1, 0.0).cells()).unwrap();
    for bin in [1, 0] {
        assert!(matches!(writer.push(row(0, bin, 0.0).cells()), Err(TableError::Order { row: 1, .. })));
    }
    writer.push(row(1, 0, 0.0).cells()).unwrap();
    assert!(!path.exists());
    drop(writer);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn val_many_rows_stream_through() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    let psd =
        |bin: i64| PsdRow { surface_id: "a".to_owned(), bin, frequency_cycles_m: bin as f64, psd_m4: 1.0, modes: bin };
    let mut writer = TableWriter::create(&path, &PsdRow::TABLE, None).unwrap();
    let count = 2 * ROW_GROUP_ROWS as i64 + 17;
    (0..count).for_each(|bin| writer.push(psd(bin).cells()).unwrap());
    // Rows not yet in the file are fewer than a row group, so memory does not grow with the number of rows.
    assert!(writer.writer.in_progress_rows() < ROW_GROUP_ROWS);
    assert_eq!(writer.writer.flushed_row_groups().len(), 2);
    writer.finish().unwrap();
    let groups = open(&path, &PsdRow::TABLE).unwrap().metadata().row_groups().to_vec();
    let rows: Vec<i64> = groups.iter().map(|group| group.num_rows()).collect();
    assert_eq!(rows, [ROW_GROUP_ROWS as i64, ROW_GROUP_ROWS as i64, 17]);
    let mut expected = 0;
    for_each_row(&path, |row: PsdRow| {
        assert_eq!(row, psd(expected));
        expected += 1;
    })
    .unwrap();
    assert_eq!(expected, count);
    assert_eq!(check_table(&path, &PsdRow::TABLE).unwrap().rows, count as u64);
}

/// Columns come in the order in which they are named, whatever their order in the table, from one file after the other until `f` breaks.
#[test]
fn val_columns_are_visited_in_the_named_order() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a", "b"].map(|name| folder.path().join(format!("{name}.parquet")));
    for (fit, path) in (0..).zip(&paths) {
        write_table(path, (0..3).map(|bin| row(fit, bin, 0.5 * bin as f64)), None).unwrap();
    }
    let files = TableFiles::new(&CovarianceRow::TABLE, paths.to_vec()).unwrap();
    let visited = |files: &TableFiles, most: usize| {
        let mut seen = Vec::new();
        let visit = |[pairs, fit, lag]: [Cell; 3]| {
            seen.push([pairs, fit, lag]);
            if seen.len() < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        files.visit(["pairs", "fit_id", "lag_m"], visit).unwrap();
        seen
    };
    let expected =
        |fit: u32, bin: i64| [Cell::I64(3 * bin), Cell::Text(format!("fit-{fit:03}")), Cell::F64(0.5 * bin as f64)];
    assert_eq!(visited(&files, 4), [expected(0, 0), expected(0, 1), expected(0, 2), expected(1, 0)]);
    let second = files.clone().selecting("fit_id", "fit-001").unwrap();
    assert_eq!(visited(&second, 9), [0, 1, 2].map(|bin| expected(1, bin)));
    assert!(files.visit(["pairs", "wheels"], |_| ControlFlow::Continue(())).is_err());
}

/// A footer of 15 kB with lists of up to 2^31 booleans in unknown fields, each skipped one by one: found by the fuzz target `tables`.
#[test]
fn val_lists_that_are_not_there_are_not_skipped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    fs::write(&path, include_bytes!("../../../../fuzz/seeds/tables/booleans.parquet")).unwrap();
    let error = read_table::<SampleRow>(&path).unwrap_err().to_string();
    assert!(error.contains("fields that Parquet does not define"), "{error}");
}

/// Lists of 2^31 booleans in the first page header, in place of its type and in an unknown field: the crate would take seconds for each.
#[test]
fn val_damaged_page_headers_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    write(&path, &(0..1000).map(|bin| row(0, bin, 0.5)).collect::<Vec<_>>());
    let bytes = fs::read(&path).unwrap();
    for lists in [&[0x19, 0xf1, 0xff, 0xff, 0xff, 0xff, 7][..], &[0x99, 0xf1, 0xff, 0xff, 0xff, 0xff, 7]] {
        let mut damaged = bytes.clone();
        // The first page follows the four bytes of the format's mark.
        damaged[4..4 + lists.len()].copy_from_slice(lists);
        fs::write(&path, damaged).unwrap();
        let error = read_table::<CovarianceRow>(&path).unwrap_err().to_string();
        assert!(error.contains("no valid page header at byte 4, or one that claims more than"), "{error}");
    }
}

/// Columns of numbers are read without going through cells. A null is NaN among floats; a column of integers with a null is not an array.
#[test]
fn val_columns_of_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a", "b"].map(|name| folder.path().join(format!("{name}.parquet")));
    for (fit, path) in (0..).zip(&paths) {
        write_table(path, (0..3).map(|bin| row(fit, bin, 0.5 * bin as f64)), None).unwrap();
    }
    let files = TableFiles::new(&CovarianceRow::TABLE, paths.to_vec()).unwrap();
    assert_eq!(files.floats("lag_m").unwrap(), [0.0, 0.5, 1.0, 0.0, 0.5, 1.0]);
    assert_eq!(files.integers("pairs").unwrap(), Some(vec![0, 3, 6, 0, 3, 6]));
    let azimuth = files.clone().selecting("fit_id", "fit-001").unwrap().floats("azimuth_deg").unwrap();
    assert!(azimuth[1].is_nan() && [azimuth[0], azimuth[2]] == [0.0, 1.0], "{azimuth:?}");
    let refused = |column: &str| files.floats(column).unwrap_err().to_string();
    assert!(refused("pairs").ends_with("column pairs of table covariance does not have floats"));
    assert!(refused("wheels").contains("has no column wheels"));
    assert!(files.integers("lag_m").is_err() && files.clone().between("lag_m", "a", "b").is_err());
    // As `column` gives them, cell by cell.
    let cells = files.column("covariance_m2").unwrap();
    assert_eq!(cells, files.floats("covariance_m2").unwrap().into_iter().map(Cell::F64).collect::<Vec<_>>());
}

/// A run goes on from one batch, and one file, to the next.
#[test]
fn val_rows_come_in_runs_of_the_same_text() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a", "b"].map(|name| folder.path().join(format!("{name}.parquet")));
    let bins = |fit: u32, bins: std::ops::Range<i64>| bins.map(move |bin| row(fit, bin, bin as f64));
    let long = BATCH_ROWS as i64 + 3;
    write_table(&paths[0], bins(0, 0..long).chain(bins(1, 0..2)), None).unwrap();
    write_table(&paths[1], bins(1, 2..4), None).unwrap();
    let files = TableFiles::new(&CovarianceRow::TABLE, paths.to_vec()).unwrap();
    let runs = files.runs("fit_id", &["covariance_m2", "azimuth_deg", "lag_m"]).unwrap();
    assert_eq!(runs.iter().map(|run| run.text.as_str()).collect::<Vec<_>>(), ["fit-000", "fit-001"]);
    assert_eq!(runs[0].floats[2], (0..long).map(|bin| bin as f64).collect::<Vec<_>>());
    let [covariance, azimuth, lag] = &runs[1].floats[..] else { panic!("{runs:?}") };
    assert_eq!((&covariance[..], &lag[..]), (&[0.0, -1.0, -2.0, -3.0][..], &[0.0, 1.0, 2.0, 3.0][..]));
    assert!([1, 3].iter().all(|k| azimuth[*k].is_nan()) && [azimuth[0], azimuth[2]] == [0.0, 2.0], "{azimuth:?}");
    assert_eq!(files.clone().between("fit_id", "fit-0005", "fit-1").unwrap().runs("fit_id", &[]).unwrap().len(), 1);
    assert!(files.runs("fit_id", &["pairs"]).is_err() && files.runs("bin", &[]).is_err());
}

/// Row groups that cannot hold the wanted text are not read, and others row by row.
#[test]
fn val_row_groups_without_wanted_text_are_skipped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    let psd = |k: usize| {
        let surface = if k < ROW_GROUP_ROWS + 10 { "b" } else { "c" };
        PsdRow { surface_id: surface.to_owned(), bin: k as i64, frequency_cycles_m: 1.0, psd_m4: 1.0, modes: 1 }
    };
    write_table(&path, (0..2 * ROW_GROUP_ROWS).map(psd), None).unwrap();
    let files = TableFiles::new(&PsdRow::TABLE, vec![path.clone()]).unwrap();
    let found = |first: &str, last: &str| {
        let files = files.clone().between("surface_id", first, last).unwrap();
        let groups = files.groups(open(&path, &PsdRow::TABLE).unwrap().metadata());
        (groups, files.rows().unwrap() as usize)
    };
    assert_eq!(found("b", "b"), (vec![0, 1], ROW_GROUP_ROWS + 10));
    assert_eq!(found("a", "bz"), (vec![0, 1], ROW_GROUP_ROWS + 10));
    assert_eq!(found("c", "d"), (vec![1], ROW_GROUP_ROWS - 10));
    assert_eq!(found("", "c"), (vec![0, 1], 2 * ROW_GROUP_ROWS));
    assert_eq!([found("", "a"), found("d", "e")], [(vec![], 0), (vec![], 0)]);
}

#[test]
fn val_unusable_tables_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    assert!(read_table::<PsdRow>(&path).unwrap_err().unusable_input());
    fs::write(&path, b"PAR1").unwrap();
    assert!(read_table::<PsdRow>(&path).unwrap_err().unusable_input());
    fs::write(&path, sample()).unwrap();
    assert!(read_table::<PsdRow>(&path).unwrap_err().unusable_input());
}

#[test]
fn prop_every_table_has_keys_first_and_a_schema() {
    for table in tables::ALL {
        let keys = table.key_count();
        assert!(keys > 0 && table.columns.iter().skip(keys).all(|c| !c.key), "{}", table.name);
        assert_eq!(schema(table, None).fields().len(), table.columns.len());
        assert!(properties(table, Some(&metadata())).is_ok());
    }
}

/// The provenance is in the metadata that pyarrow shows for a table's schema.
#[test]
fn val_the_schema_has_the_provenance() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    fs::write(&path, sample()).unwrap();
    let found = open(&path, &CovarianceRow::TABLE).unwrap().schema().metadata().clone();
    let expected = metadata().pairs(CovarianceRow::TABLE.name);
    assert!(expected.iter().all(|(key, value)| found.get(key) == Some(value)), "{found:?}");
    assert_eq!(found.get("description").map(String::as_str), Some(CovarianceRow::TABLE.description));
}

/// Tables of another build are read although their columns are described in other words; not with another unit, type or nullability.
#[test]
fn val_a_column_may_be_described_in_other_words() {
    let column = |unit: &'static str, description: &'static str, data_type: DataType, is_nullable: bool| {
        Field::new("x", data_type, is_nullable).with_metadata([("unit", unit), ("description", description)])
    };
    let ours = column("m", "Height.", DataType::Float64, true);
    assert!(is_same_column(&column("m", "Height above the plane.", DataType::Float64, true), &ours));
    assert!(!is_same_column(&column("cm", "Height.", DataType::Float64, true), &ours));
    assert!(!is_same_column(&column("m", "Height.", DataType::Int64, true), &ours));
    assert!(!is_same_column(&column("m", "Height.", DataType::Float64, false), &ours));
}

/// Bytes of a table, to detect a change of encoder.
#[test]
fn gold_bytes_of_a_table() {
    assert_eq!(crate::digest::of_bytes(sample()), GOLD_TABLE);
}
const GOLD_TABLE: &str = "fba78a1d36dd4dbc9c91c4676447536be9fbc16933b4ff70ff41ed92df304338";
