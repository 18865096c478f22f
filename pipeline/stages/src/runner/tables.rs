//! The tables of a release: the rows that items left, merged by key, whichever stage made them.
//!
//! Each item leaves one sorted file of rows for a table, its fragment. Fragments whose keys do not overlap follow one another as they
//! are read, a batch at a time; overlapping ones are held together and sorted. Fragments with the same rows (the parameters of one run
//! on many terrains) count once.

use super::cache::{Record, StoredFile};
use crate::error::Error;
use crate::splits::{self, Splits};
use sastrugi_schemas::manifest::Origin;
use sastrugi_schemas::tables::{self, compare_keys};
use sastrugi_schemas::{Cell, Table};
use sastrugi_store::parquet::TableReader;
use sastrugi_store::release::{PartWriter, ReleaseBuilder, TablePart};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

/// The fragments of all items.
#[derive(Default)]
pub struct Fragments(BTreeMap<String, OfTable>);

/// The fragments of one table.
#[derive(Default)]
struct OfTable {
    stages: BTreeSet<String>,
    /// What the items were made from that leave no other file which could say so.
    parents: BTreeSet<String>,
    fragments: Vec<Fragment>,
}

struct Fragment {
    /// Folder of the item's result.
    folder: Arc<Path>,
    file: String,
    /// Hash of the rows.
    content: Option<String>,
    /// Keys of the first and the last row.
    ends: [Vec<Cell>; 2],
}

impl Fragments {
    /// Takes the fragments of an item, whose result is in `folder`.
    pub fn add(&mut self, record: &Record, folder: &Path) {
        let folder: Arc<Path> = folder.into();
        let files = record.files.iter();
        let releases_no_file = files.clone().all(|file| file.product.release_path.is_none());
        for (StoredFile { product, .. }, rows) in files.filter_map(|file| Some((file, file.product.fragment.as_ref()?)))
        {
            let of_table = self.0.entry(rows.table.clone()).or_default();
            of_table.stages.insert(record.item.stage.clone());
            if releases_no_file {
                of_table.parents.extend(record.ingredients.parents.keys().cloned());
            }
            of_table.fragments.push(Fragment {
                folder: Arc::clone(&folder),
                file: product.file.clone(),
                content: product.content.clone(),
                ends: rows.ends.clone(),
            });
        }
    }

    /// Writes all tables, several files at a time.
    ///
    /// # Errors
    /// Fragments that cannot be read or contradict each other; a file that cannot be written.
    pub fn write(mut self, builder: &mut ReleaseBuilder, splits: &Splits) -> Result<(), Error> {
        let mut parts = Vec::new();
        let mut fragments = BTreeMap::new();
        for table in tables::ALL {
            let Some(of_table) = self.0.remove(table.name) else { continue };
            let origin = of_table.origin();
            for (name, of_part) in of_table.parts(table) {
                parts.push(TablePart { table, name: name.clone(), origin: origin.clone() });
                fragments.insert((table.name, name), of_part);
            }
        }
        builder.write_tables(parts, |part, writer| {
            let of_part = fragments.get(&(part.table.name, part.name.clone()));
            merge(part.table, of_part.map_or(&[], Vec::as_slice), splits, writer)
        })
    }
}

impl OfTable {
    fn origin(&self) -> Origin {
        let stages: Vec<&str> = self.stages.iter().map(String::as_str).collect();
        let parents = self.parents.iter().cloned().collect();
        Origin { stage: stages.join("+"), parents, ..Origin::default() }
    }

    /// The fragments of each file of the table, sorted by their keys, each once.
    fn parts(mut self, table: &Table) -> BTreeMap<String, Vec<Fragment>> {
        self.fragments.sort_by(Fragment::compare);
        self.fragments.dedup_by(|a, b| a.compare(b) == Ordering::Equal);
        let column = table.file_per.and_then(|key| table.position(key));
        let mut parts: BTreeMap<String, Vec<Fragment>> = BTreeMap::new();
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

impl Fragment {
    /// Orders by keys; equal are fragments with the same rows.
    fn compare(&self, other: &Self) -> Ordering {
        let of_end = |end: usize| compare_keys(&self.ends[end], &other.ends[end]);
        of_end(0).then_with(|| of_end(1)).then_with(|| self.content.cmp(&other.content))
    }

    fn rows(&self, table: &Table) -> Result<TableReader, Error> {
        TableReader::open(&self.folder.join(&self.file), table).map_err(Error::io)
    }
}

/// Writes the rows of fragments that are sorted by their first keys.
fn merge(table: &Table, fragments: &[Fragment], splits: &Splits, writer: &mut PartWriter<'_>) -> Result<(), Error> {
    let mut push = |mut cells: Vec<Cell>| {
        splits::fill(table, &mut cells, splits);
        writer.push(cells).map_err(Error::from)
    };
    let mut rest = fragments;
    while !rest.is_empty() {
        let (overlapping, others) = rest.split_at(overlapping(rest));
        match overlapping {
            [one] => one.rows(table)?.try_for_each(|row| push(row.map_err(Error::io)?))?,
            several => sorted_rows(table, several)?.into_iter().try_for_each(&mut push)?,
        }
        rest = others;
    }
    Ok(())
}

/// How many fragments from the first on overlap.
fn overlapping(fragments: &[Fragment]) -> usize {
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

/// The rows of fragments together, sorted by key. Rows that are there twice are kept once; the writer refuses two rows of one key.
fn sorted_rows(table: &Table, fragments: &[Fragment]) -> Result<Vec<Vec<Cell>>, Error> {
    let mut rows = Vec::new();
    for fragment in fragments {
        for row in fragment.rows(table)? {
            rows.push(row.map_err(Error::io)?);
        }
    }
    let keys = table.key_count();
    rows.sort_by(|a, b| compare_keys(&a[..keys], &b[..keys]));
    rows.dedup();
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{ItemRef, Outcome, Product};
    use crate::runner::graph::Ingredients;
    use sastrugi_schemas::Record as Row;
    use sastrugi_schemas::tables::{CandidateCurveRow, ParameterRow};
    use sastrugi_store::parquet::write_table;
    use sastrugi_store::release::{Head, Release};
    use std::path::PathBuf;

    /// A work area and a release of it.
    struct Area {
        folder: tempfile::TempDir,
        fragments: Fragments,
        items: usize,
    }

    impl Area {
        fn new() -> Self {
            Self { folder: tempfile::tempdir().unwrap(), fragments: Fragments::default(), items: 0 }
        }

        /// An item of `stage` that leaves these rows, and another file in the release if it `releases`.
        fn leave<R: Row>(&mut self, stage: &str, rows: Vec<R>, releases: bool) {
            self.items += 1;
            let folder: PathBuf = self.folder.path().join(self.items.to_string());
            std::fs::create_dir(&folder).unwrap();
            let path = folder.join("rows.parquet");
            let summary = write_table(path.as_path(), rows, None).unwrap();
            let mut outcome = Outcome::default();
            let mut product = Product::internal("rows.parquet");
            product.content = Some(summary.content_sha256);
            product.fragment = Some(crate::job::Fragment { table: R::TABLE.name.to_owned(), ends: summary.ends });
            outcome.products.push(product);
            if releases {
                outcome.products.push(Product::released("a", "a".to_owned(), None));
            }
            let stored = |product| StoredFile { product, bytes: 0, sha256: String::new() };
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
            self.fragments.add(&record, &folder);
        }

        fn release(&mut self) -> Result<Release, Error> {
            let head = Head {
                name: "x".to_owned(),
                study_sha256: String::new(),
                seed: 1,
                version: "0".to_owned(),
                license: String::new(),
            };
            let dest = self.folder.path().join("release");
            let mut builder = ReleaseBuilder::beside(&dest, head)?;
            std::mem::take(&mut self.fragments).write(&mut builder, &Splits::new())?;
            Ok(builder.seal(&dest)?)
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
        // Interleaved with two others, which begin and end before and behind each other.
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
    fn val_equal_rows_count_once_and_others_contradict() {
        let mut area = Area::new();
        let of_run = |value: &str| vec![parameter("run", "mass_kg", value), parameter("run", "speed_m_s", "1.0")];
        (0..3).for_each(|_| area.leave("traverse", of_run("50.0"), true));
        // Overlapping fragments may share rows as well.
        area.leave("traverse", vec![parameter("run", "speed_m_s", "1.0"), parameter("walk", "mass_kg", "3.0")], true);
        let rows: Vec<ParameterRow> = area.release().unwrap().rows().unwrap();
        assert_eq!(rows, [of_run("50.0"), vec![parameter("walk", "mass_kg", "3.0")]].concat());

        let mut area = Area::new();
        ["50.0", "51.0"].into_iter().for_each(|mass| area.leave("traverse", of_run(mass), true));
        let error = area.release().unwrap_err().to_string();
        assert!(error.contains("order of its keys"), "{error}");
    }

    #[test]
    fn val_a_table_names_its_stages_and_what_no_other_file_names() {
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
}
