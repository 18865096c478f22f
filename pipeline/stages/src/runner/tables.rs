//! The tables of a release: the rows written by all items, merged by key.
//!
//! For each table, an item writes its rows to one sorted file, its fragment. Fragments with disjoint key ranges are copied one after the
//! other, a batch at a time; overlapping fragments are loaded together and sorted. Fragments with identical rows (the parameters of one run on
//! many terrains) are kept once. If the study splits its terrains, tables with a column for the split have one file per split.

use super::cache::Record;
use super::damage::Changed;
use crate::error::Error;
use crate::job::{Fragment, ItemRef};
use crate::splits::{self, Splits};
use sastrugi_schemas::manifest::Origin;
use sastrugi_schemas::tables::{self, compare_keys};
use sastrugi_schemas::{Cell, Table};
use sastrugi_store::digest;
use sastrugi_store::parquet::TableReader;
use sastrugi_store::release::{PartWriter, ReleaseBuilder, TablePart};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The fragments of all items.
#[derive(Default)]
pub struct Fragments(BTreeMap<&'static str, TableFragments>);

/// The fragments of one table.
#[derive(Default)]
struct TableFragments {
    stages: BTreeSet<String>,
    /// Parents of items that release no other file; the manifest lists them with the table.
    parents: BTreeSet<String>,
    fragments: Vec<LocatedFragment>,
}

/// A fragment and its location.
struct LocatedFragment {
    result: Arc<ItemResult>,
    file: String,
    /// Hash of the file: equal rows have equal bytes.
    sha256: String,
    /// Keys of the first and the last row.
    ends: [Vec<Cell>; 2],
}

/// A file of a table: the fragments from which its rows come.
struct TableFile {
    fragments: Arc<Vec<LocatedFragment>>,
    /// The split to which its rows are restricted.
    part: Option<&'static str>,
}

/// A result of an item in the work area.
struct ItemResult {
    folder: PathBuf,
    item: ItemRef,
}

impl Fragments {
    /// Adds the fragments of an item, whose result is in `folder`.
    ///
    /// # Errors
    /// Rows of an unknown table, or rows that belong to more than one file of a table.
    pub fn add(&mut self, record: &Record, folder: &Path) -> Result<(), Error> {
        let result = Arc::new(ItemResult { folder: folder.to_owned(), item: record.item.clone() });
        let releases_no_file = record.files.iter().all(|file| file.product.release_path.is_none());
        for file in &record.files {
            let Some(rows) = &file.product.fragment else { continue };
            let table = table_of(&record.item, rows)?;
            let of_table = self.0.entry(table.name).or_default();
            of_table.stages.insert(record.item.stage.clone());
            if releases_no_file {
                of_table.parents.extend(record.ingredients.parents.keys().cloned());
            }
            of_table.fragments.push(LocatedFragment {
                result: Arc::clone(&result),
                file: file.product.file.clone(),
                sha256: file.sha256.clone(),
                ends: rows.ends.clone(),
            });
        }
        Ok(())
    }

    /// Writes all tables, several files at a time. Fragments that changed after they were written are noted and left out.
    ///
    /// # Errors
    /// Fragments that cannot be read or that contradict each other, or a file that cannot be written.
    pub fn write(mut self, builder: &mut ReleaseBuilder, splits: &Splits, changed: &Changed) -> Result<(), Error> {
        let mut parts = Vec::new();
        let mut files = BTreeMap::new();
        for table in tables::ALL {
            let Some(of_table) = self.0.remove(table.name) else { continue };
            let origin = Arc::new(of_table.origin());
            for (name, file) in of_table.files(table, splits) {
                parts.push(TablePart { table, name: name.clone(), origin: Arc::clone(&origin) });
                files.insert((table.name, name), file);
            }
        }
        builder.write_tables(parts, |part, writer| match files.get(&(part.table.name, part.name.clone())) {
            Some(file) => merge(part.table, file, splits, changed, writer),
            None => Ok(()),
        })
    }
}

impl TableFragments {
    fn origin(&self) -> Origin {
        let stages: Vec<&str> = self.stages.iter().map(String::as_str).collect();
        let parents = self.parents.iter().cloned().collect();
        Origin { stage: stages.join("+"), parents, ..Origin::default() }
    }

    /// The files of the table by name.
    fn files(self, table: &Table, splits: &Splits) -> Vec<(String, TableFile)> {
        let named = splits::files(table, splits);
        let file = |(name, fragments): (String, Vec<LocatedFragment>)| {
            let fragments = Arc::new(fragments);
            let whole = named.is_empty().then(|| (name, TableFile { fragments: Arc::clone(&fragments), part: None }));
            let of_part = |part: &'static str| {
                (part.to_owned(), TableFile { fragments: Arc::clone(&fragments), part: Some(part) })
            };
            whole.into_iter().chain(named.iter().copied().map(of_part)).collect::<Vec<_>>()
        };
        self.parts(table).into_iter().flat_map(file).collect()
    }

    /// The distinct fragments of the table, or of the file of each terrain, sorted by their keys.
    fn parts(mut self, table: &Table) -> BTreeMap<String, Vec<LocatedFragment>> {
        self.fragments.sort_by(LocatedFragment::compare);
        self.fragments.dedup_by(|a, b| a.compare(b) == Ordering::Equal);
        let column = table.file_per.and_then(|key| table.position(key));
        let mut parts: BTreeMap<String, Vec<LocatedFragment>> = BTreeMap::new();
        for fragment in self.fragments {
            let name = match column.and_then(|column| fragment.ends[0].get(column)) {
                Some(Cell::Text(value)) => value.clone(),
                _ => TablePart::WHOLE.to_owned(),
            };
            parts.entry(name).or_default().push(fragment);
        }
        parts
    }
}

/// The table of a fragment.
///
/// # Errors
/// An unknown table, keys that do not match the table, or rows that belong to more than one file of a table.
pub fn table_of(item: &ItemRef, rows: &Fragment) -> Result<&'static Table, Error> {
    let name = &rows.table;
    let Some(table) = tables::by_name(name) else {
        return Err(Error::Failed(format!("{item} wrote rows of an unknown table `{name}`")));
    };
    let column = table.file_per.and_then(|key| table.position(key));
    let one_file = column.is_none_or(|column| rows.ends[0].get(column) == rows.ends[1].get(column));
    if rows.ends.iter().all(|end| end.len() == table.key_count()) && one_file {
        return Ok(table);
    }
    Err(Error::Failed(format!("{item} wrote rows of the table `{name}` with keys that do not match it")))
}

impl LocatedFragment {
    /// Orders by keys; fragments with identical rows are equal.
    fn compare(&self, other: &Self) -> Ordering {
        let of_end = |end: usize| compare_keys(&self.ends[end], &other.ends[end]);
        of_end(0).then_with(|| of_end(1)).then_with(|| self.sha256.cmp(&other.sha256))
    }

    /// The rows; `None`, and noted, if the file changed after it was written.
    fn rows(&self, table: &Table, changed: &Changed) -> Result<Option<TableReader>, Error> {
        let ItemResult { folder, item } = &*self.result;
        let path = folder.join(&self.file);
        let (_, sha256) = digest::of_file(&path).map_err(|e| Error::at(&path, e))?;
        if sha256 != self.sha256 {
            changed.note(folder, item, &self.file);
            return Ok(None);
        }
        TableReader::open(&path, table).map(Some).map_err(Error::io)
    }
}

/// Writes the rows of a file, whose fragments are sorted by their first keys.
fn merge(
    table: &Table,
    file: &TableFile,
    splits: &Splits,
    changed: &Changed,
    writer: &mut PartWriter<'_>,
) -> Result<(), Error> {
    let mut push = |mut cells: Vec<Cell>| {
        splits::fill(table, &mut cells, splits);
        match file.part.is_none_or(|part| splits::is_in_file(table, &cells, part)) {
            true => writer.push(cells).map_err(Error::from),
            false => Ok(()),
        }
    };
    let mut rest = file.fragments.as_slice();
    while !rest.is_empty() {
        let (overlapping, others) = rest.split_at(overlapping(rest));
        match overlapping {
            [one] => {
                let mut rows = one.rows(table, changed)?.into_iter().flatten();
                rows.try_for_each(|row| push(row.map_err(Error::io)?))?;
            }
            several => sorted_rows(table, several, changed)?.into_iter().try_for_each(&mut push)?,
        }
        rest = others;
    }
    Ok(())
}

/// Number of fragments, from the first, that overlap without a gap.
fn overlapping(fragments: &[LocatedFragment]) -> usize {
    let mut last = &fragments[0].ends[1];
    let mut count = 1;
    while let Some(next) = fragments.get(count).filter(|next| compare_keys(&next.ends[0], last) != Ordering::Greater) {
        if compare_keys(&next.ends[1], last) == Ordering::Greater {
            last = &next.ends[1];
        }
        count += 1;
    }
    count
}

/// The rows of several fragments, sorted by key. Duplicate rows are kept once. (Every table has keys.)
fn sorted_rows(table: &Table, fragments: &[LocatedFragment], changed: &Changed) -> Result<Vec<Vec<Cell>>, Error> {
    let mut rows = Vec::new();
    for fragment in fragments {
        for row in fragment.rows(table, changed)?.into_iter().flatten() {
            rows.push((row.map_err(Error::io)?, &fragment.result.item));
        }
    }
    let keys = table.key_count();
    rows.sort_by(|(a, _), (b, _)| compare_keys(&a[..keys], &b[..keys]));
    rows.dedup_by(|(a, _), (b, _)| a == b);
    let contradict = |pair: &[(Vec<Cell>, _)]| compare_keys(&pair[0].0[..keys], &pair[1].0[..keys]) == Ordering::Equal;
    let Some(pair) = rows.windows(2).find(|pair| contradict(pair)) else {
        return Ok(rows.into_iter().map(|(row, _)| row).collect());
    };
    let mut items = [pair[0].1.to_string(), pair[1].1.to_string()];
    items.sort();
    let (key, items) = (serde_json::json!(pair[0].0[..keys]), items.join(" and "));
    Err(Error::Failed(format!("table {}: conflicting rows for the key {key}, from {items}", table.name)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{Outcome, Product};
    use crate::runner::cache::StoredFile;
    use crate::runner::graph::Ingredients;
    use sastrugi_schemas::tables::{CandidateCurveRow, ParameterRow, SampleRow, TerrainRow};
    use sastrugi_schemas::{ColumnType, Record as Row};
    use sastrugi_store::parquet::write_table;
    use sastrugi_store::release::{Head, Release};

    /// A work area and a release assembled from it.
    struct Area {
        folder: tempfile::TempDir,
        fragments: Fragments,
        items: usize,
    }

    impl Area {
        fn new() -> Self {
            Self { folder: tempfile::tempdir().unwrap(), fragments: Fragments::default(), items: 0 }
        }

        /// Adds an item of `stage` that writes these rows, and another file of the release if `releases` is true.
        fn leave<R: Row>(&mut self, stage: &str, rows: Vec<R>, releases: bool) {
            self.items += 1;
            let folder: PathBuf = self.folder.path().join(self.items.to_string());
            std::fs::create_dir(&folder).unwrap();
            let path = folder.join("rows.parquet");
            let summary = write_table(path.as_path(), rows, None).unwrap();
            let mut outcome = Outcome::default();
            let fragment = Some(Fragment { table: R::TABLE.name.to_owned(), ends: summary.ends });
            outcome.products.push(Product { fragment, ..Product::internal("rows.parquet") });
            if releases {
                outcome.products.push(Product::released("a", "a".to_owned(), None));
            }
            let (_, sha256) = digest::of_file(&path).unwrap();
            let stored = |product| StoredFile { product, bytes: 0, sha256: sha256.clone() };
            let ingredients = Ingredients {
                recipe: serde_json::Value::Null,
                packing: serde_json::Value::Null,
                stream: None,
                inputs: Vec::new(),
                parents: [("fit/x".to_owned(), String::new())].into(),
                revision: String::new(),
            };
            let record = Record {
                item: ItemRef::new(stage, &self.items.to_string()),
                key: String::new(),
                ingredients,
                files: outcome.products.into_iter().map(stored).collect(),
                notes: Vec::new(),
            };
            self.fragments.add(&record, &folder).unwrap();
        }

        fn release(&mut self) -> Result<Release, Error> {
            self.release_with(&Splits::new())
        }

        fn release_with(&mut self, splits: &Splits) -> Result<Release, Error> {
            let head = Head {
                name: "x".to_owned(),
                study_sha256: String::new(),
                seed: 1,
                version: "0".to_owned(),
                license: String::new(),
            };
            let dest = self.folder.path().join("release");
            let mut builder = ReleaseBuilder::beside(&dest, head)?;
            let changed = Changed::default();
            std::mem::take(&mut self.fragments).write(&mut builder, splits, &changed)?;
            changed.remove()?;
            builder.seal(&dest)?;
            Ok(Release::open(&dest)?)
        }
    }

    fn parameter(run: &str, name: &str, value: &str) -> ParameterRow {
        let [traverse_id, parameter, value] = [run, name, value].map(str::to_owned);
        ParameterRow { traverse_id, parameter, value, source: None }
    }

    fn curve(fit: &str, rank: i64, bin: i64) -> CandidateCurveRow {
        CandidateCurveRow { fit_id: fit.to_owned(), rank, bin, lag_m: rank as f64, model_m2: bin as f64 }
    }

    #[test]
    fn val_fragments_are_merged_by_key() {
        let mut area = Area::new();
        // The first three fragments overlap: their key ranges start and end in different orders.
        area.leave("fit", vec![curve("a", 1, 5), curve("b", 1, 0)], true);
        area.leave("fit", vec![curve("a", 1, 6), curve("a", 2, 0)], true);
        area.leave("fit", vec![curve("a", 1, 0), curve("c", 0, 0)], true);
        area.leave("fit", vec![curve("d", 1, 0)], true);
        let rows: Vec<CandidateCurveRow> = area.release().unwrap().rows().unwrap();
        let keys: Vec<(&str, i64, i64)> = rows.iter().map(|r| (r.fit_id.as_str(), r.rank, r.bin)).collect();
        let expected = [("a", 1, 0), ("a", 1, 5), ("a", 1, 6), ("a", 2, 0), ("b", 1, 0), ("c", 0, 0), ("d", 1, 0)];
        assert_eq!(keys, expected);
    }

    #[test]
    fn val_equal_rows_are_kept_once_and_conflicting_rows_are_refused() {
        let mut area = Area::new();
        let of_run = |value: &str| vec![parameter("run", "mass_kg", value), parameter("run", "speed_m_s", "1.0")];
        (0..3).for_each(|_| area.leave("traverse", of_run("50.0"), true));
        // Overlapping fragments may also share rows.
        area.leave("traverse", vec![parameter("run", "speed_m_s", "1.0"), parameter("walk", "mass_kg", "3.0")], true);
        let rows: Vec<ParameterRow> = area.release().unwrap().rows().unwrap();
        assert_eq!(rows, [of_run("50.0"), vec![parameter("walk", "mass_kg", "3.0")]].concat());

        let mut area = Area::new();
        ["50.0", "51.0"].into_iter().for_each(|mass| area.leave("traverse", of_run(mass), true));
        let error = area.release().unwrap_err().to_string();
        assert!(error.contains("[\"run\",\"mass_kg\"], from traverse/1 and traverse/2"), "{error}");
    }

    #[test]
    fn val_a_table_lists_its_stages_and_the_parents_no_other_file_lists() {
        let mut area = Area::new();
        area.leave("texture", vec![curve("a", 1, 0)], true);
        area.leave("fit", vec![curve("b", 1, 0)], true);
        area.leave("traverse", vec![parameter("run", "a", "1")], false);
        let release = area.release().unwrap();
        let origin = |table: &str| {
            let path = format!("tables/{table}/part-0000.parquet");
            release.manifest().artifacts.iter().find(|a| a.path == path).unwrap().origin.clone()
        };
        let (curves, parameters) = (origin("candidate_curves"), origin("parameters"));
        assert_eq!((curves.stage.as_str(), curves.parents.len()), ("fit+texture", 0));
        assert_eq!((parameters.stage.as_str(), parameters.parents), ("traverse", vec!["fit/x".to_owned()]));
    }

    fn any<R: Row>(set: impl Fn(&str) -> Option<Cell>) -> R {
        let cell = |column: &sastrugi_schemas::Column| match (set(column.name), column.column_type) {
            (Some(cell), _) => cell,
            (None, ColumnType::Text) => Cell::Text(String::new()),
            (None, ColumnType::I64) => Cell::I64(0),
            (None, ColumnType::Bool) => Cell::Bool(false),
            (None, ColumnType::F64) => Cell::F64(0.0),
            (None, ColumnType::F32List) => Cell::F32List(Vec::new()),
            (None, ColumnType::F64List) => Cell::F64List(Vec::new()),
        };
        R::from_cells(R::TABLE.columns.iter().map(cell).collect()).unwrap()
    }

    /// Samples have one file per terrain; terrains get their split.
    #[test]
    fn val_files_by_key_and_splits_are_filled() {
        let mut area = Area::new();
        let of = |terrain: &'static str, mission: &'static str| -> SampleRow {
            any(|name| match name {
                "terrain_id" => Some(Cell::Text(terrain.to_owned())),
                "mission_id" => Some(Cell::Text(mission.to_owned())),
                _ => None,
            })
        };
        area.leave("traverse", vec![of("b", "run-0001")], true);
        area.leave("traverse", vec![of("a", "walk-0001")], true);
        area.leave("traverse", vec![of("a", "run-0001")], true);
        let terrain =
            |id: &'static str| any::<TerrainRow>(|name| (name == "terrain_id").then(|| Cell::Text(id.to_owned())));
        area.leave("roughness", vec![terrain("b")], true);
        area.leave("roughness", vec![terrain("a")], true);
        let release = area.release_with(&[("a".to_owned(), "test".to_owned())].into()).unwrap();
        let names = |table: &str| -> Vec<String> {
            let files = release.table_files(table);
            files.iter().map(|path| path.file_name().unwrap().to_string_lossy().into_owned()).collect()
        };
        assert_eq!(names("samples"), ["part-a.parquet", "part-b.parquet"]);
        let samples: Vec<SampleRow> = release.rows().unwrap();
        let missions: Vec<&str> = samples.iter().map(|r| r.mission_id.as_str()).collect();
        assert_eq!(missions, ["run-0001", "walk-0001", "run-0001"]);
        let splits: Vec<Option<&str>> = samples.iter().map(|r| r.split.as_deref()).collect();
        assert_eq!(splits, [Some("test"), Some("test"), None]);
        let splits: Vec<Option<String>> = release.rows::<TerrainRow>().unwrap().into_iter().map(|r| r.split).collect();
        assert_eq!(splits, [Some("test".to_owned()), None]);
        assert_eq!(names("terrains"), ["part-other.parquet", "part-test.parquet"]);
    }

    /// Files that changed after they were written are removed with the results of their items, so that the next run recomputes them; also
    /// files of different tables, and of keys that overlap.
    #[test]
    fn val_changed_fragments_are_removed() {
        let mut area = Area::new();
        area.leave("fit", vec![curve("a", 1, 0)], true);
        area.leave("fit", vec![curve("b", 1, 0), curve("c", 1, 0)], true);
        area.leave("fit", vec![curve("b", 1, 1)], true);
        area.leave("traverse", vec![parameter("run", "a", "1")], true);
        let path = |item: usize| area.folder.path().join(format!("{item}/rows.parquet"));
        for path in [1, 2, 4].map(path) {
            let mut bytes = std::fs::read(&path).unwrap();
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
            std::fs::write(&path, bytes).unwrap();
        }
        let left = [1, 2, 3, 4].map(path);
        let error = area.release().unwrap_err().to_string();
        assert!(error.contains("fit/1: rows.parquet was changed"), "{error}");
        assert!(error.ends_with(", and so were 2 other results; these results were removed; run again"), "{error}");
        assert_eq!(left.map(|path| path.exists()), [false, false, true, false]);
    }

    #[test]
    fn val_rows_that_match_no_table_are_refused() {
        let item = ItemRef::new("fit", "a");
        let text = |words: &[&str]| words.iter().map(|w| Cell::Text((*w).to_owned())).collect::<Vec<_>>();
        let refused = |table: &str, first: &[&str], last: &[&str]| {
            let rows = Fragment { table: table.to_owned(), ends: [text(first), text(last)] };
            table_of(&item, &rows).err().map(|e| e.to_string()).unwrap_or_default()
        };
        assert!(refused("crests", &["a"], &["b"]).contains("fit/a wrote rows of an unknown table `crests`"));
        assert!(refused("fits", &["a", "b"], &["b", "c"]).contains("do not match it"));
        assert!(refused("samples", &["a", "m", "0"], &["b", "m", "0"]).contains("do not match it"));
        assert_eq!(refused("fits", &["a"], &["b"]), "");
    }
}
