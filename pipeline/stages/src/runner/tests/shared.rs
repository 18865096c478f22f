//! The shared cache, with jobs that only write a line of text.

use super::{Area, Ending, FILE, all, diamond, graph, item, limits, node, run, text_of};
use crate::error::Error;
use crate::loaded::{Loaded, load_text};
use crate::runner::cache::{Cache, Record};
use crate::runner::execute::execute;
use crate::runner::graph::Graph;
use crate::runner::progress::Silent;
use crate::runner::shared::{Entry, Folder, Keep, Objects, Shared, Sharing, Tally, prune};
use crate::studies::{RunRequest, RunSummary, run_ancestors};
use sastrugi_store::atomic::Draft;
use sastrugi_store::objects::Bucket;
use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime};

fn hours(count: u64) -> Duration {
    Duration::from_secs(3600 * count)
}

fn cache_of(area: &Area, shared: &Path) -> Cache {
    area.cache().sharing(Some(Sharing::new(Box::new(Folder::open(shared, false).unwrap()))))
}

/// Runs a graph in a new work area with the shared cache; returns the names of the jobs that ran, and what the cache did.
fn run_fresh(make: impl Fn(&Area) -> Graph, shared: &Path) -> (Vec<String>, Tally) {
    run_with(make, Box::new(Folder::open(shared, false).unwrap()))
}

/// The same with any place.
fn run_with(make: impl Fn(&Area) -> Graph, place: Box<dyn Shared>) -> (Vec<String>, Tally) {
    let area = Area::new();
    let (graph, cache) = (make(&area), area.cache().sharing(Some(Sharing::new(place))));
    assert_eq!(run(&graph, &cache, 2).done, all(&graph));
    assert_eq!(text_of(&graph, &cache, graph.len() - 1), "d < b < a < c < a");
    let mut ran = area.ran();
    ran.sort();
    (ran, cache.shared().unwrap().tally())
}

/// Folders of the entries of a cache, by the id of their items.
fn entry(shared: &Path, id: &str) -> PathBuf {
    let below = |folder: PathBuf| fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
    let entries = below(shared.join("entries")).into_iter().flat_map(below);
    let is_of = |folder: &PathBuf| {
        let record: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("record.json")).unwrap()).unwrap();
        record["item"]["id"] == id
    };
    entries.into_iter().find(is_of).unwrap()
}

fn drafts(shared: &Path) -> usize {
    fs::read_dir(shared.join("drafts")).unwrap().count()
}

/// A second work area computes nothing, and holds the same files.
#[test]
fn val_a_shared_cache_computes_each_item_once() {
    let shared = tempfile::tempdir().unwrap();
    let (ran, tally) = run_fresh(diamond, shared.path());
    assert_eq!((ran.len(), tally.fetched, tally.published), (4, 0, 4));
    let (ran, tally) = run_fresh(diamond, shared.path());
    assert_eq!((ran.len(), tally.fetched, tally.published), (0, 4, 0));
    assert_eq!((tally.damaged, tally.problems, drafts(shared.path())), (BTreeSet::new(), BTreeSet::new(), 0));
}

/// What a work area has already, or a killed run did not publish, is published by the next run.
#[test]
fn val_ready_results_are_published() {
    let (area, shared) = (Area::new(), tempfile::tempdir().unwrap());
    let graph = diamond(&area);
    run(&graph, &area.cache(), 1);
    let cache = cache_of(&area, shared.path());
    run(&graph, &cache, 1);
    assert_eq!(cache.shared().unwrap().tally().published, 4);
    assert!(run_fresh(diamond, shared.path()).0.is_empty());
}

/// A ready result that changed after it was written is removed instead of published, and computed in the same run.
#[test]
fn val_changed_results_are_not_published() {
    let shared = tempfile::tempdir().unwrap();
    let bucket = Bucket::in_memory("s3://bucket/cache").unwrap();
    let places: [Box<dyn Shared>; 2] =
        [Box::new(Folder::open(shared.path(), false).unwrap()), Box::new(Objects::new(Arc::new(bucket), false))];
    for place in places {
        let area = Area::new();
        let graph = diamond(&area);
        run(&graph, &area.cache(), 1);
        area.ran();
        let cache = area.cache().sharing(Some(Sharing::new(place)));
        fs::write(cache.result_folder(&item("b"), graph.key(1)).join(FILE), "b < A").unwrap();
        assert_eq!(run(&graph, &cache, 1).done, all(&graph));
        let tally = cache.shared().unwrap().tally();
        assert_eq!((area.ran(), tally.published, tally.problems), (vec!["b".to_owned()], 4, BTreeSet::new()));
        assert_eq!(tally.changed, BTreeSet::from(["s/b".to_owned()]));
        assert_eq!(text_of(&graph, &cache, 1), "b < a");
    }
}

/// Name of a damage, and what does it to an entry.
type Damage<'a> = (&'a str, &'a dyn Fn(&Path));

/// A flipped byte, a lost file, a record cut short or lost: the item is computed again, and its entry replaced.
#[test]
fn val_damaged_entries_are_computed_again() {
    let damages: [Damage; 5] = [
        ("flipped", &|entry| fs::write(entry.join(FILE), "b < A").unwrap()),
        ("lost", &|entry| fs::remove_file(entry.join(FILE)).unwrap()),
        ("cut", &|entry| {
            let record = fs::read(entry.join("record.json")).unwrap();
            fs::write(entry.join("record.json"), &record[..record.len() / 2]).unwrap();
        }),
        ("without a record", &|entry| fs::remove_file(entry.join("record.json")).unwrap()),
        ("of another item", &|to| {
            fs::copy(entry(to.ancestors().nth(3).unwrap(), "a").join("record.json"), to.join("record.json")).unwrap();
        }),
    ];
    for (name, damage) in damages {
        let shared = tempfile::tempdir().unwrap();
        run_fresh(diamond, shared.path());
        let damaged = entry(shared.path(), "b");
        damage(&damaged);
        let (ran, tally) = run_fresh(diamond, shared.path());
        assert_eq!((ran, tally.fetched, tally.published), (vec!["b".to_owned()], 3, 1), "{name}");
        // Without a record there is no entry at all.
        let expected: BTreeSet<String> = (name != "without a record").then(|| "s/b".to_owned()).into_iter().collect();
        assert_eq!(tally.damaged, expected, "{name}");
        assert_eq!(fs::read_to_string(damaged.join(FILE)).unwrap(), "b < a", "{name}");
        assert!(run_fresh(diamond, shared.path()).0.is_empty() && drafts(shared.path()) == 0, "{name}");
    }
}

/// A record must not name files elsewhere, neither to read nor to write.
#[test]
fn val_hostile_records_are_damage() {
    let shared = tempfile::tempdir().unwrap();
    run_fresh(diamond, shared.path());
    let path = entry(shared.path(), "b").join("record.json");
    let record = fs::read_to_string(&path).unwrap();
    for file in ["../line.txt", "/etc/passwd", "record.json", ".hidden", "folder/line.txt"] {
        fs::write(&path, record.replace(FILE, file)).unwrap();
        let (ran, tally) = run_fresh(diamond, shared.path());
        assert_eq!((ran, tally.damaged.len()), (vec!["b".to_owned()], 1), "{file}");
    }
}

/// A cache that is only read gives its entries, and nothing in it changes, not even a damaged entry.
#[test]
fn val_a_cache_can_be_only_read() {
    let shared = tempfile::tempdir().unwrap();
    run_fresh(diamond, shared.path());
    fs::write(entry(shared.path(), "b").join(FILE), "b < A").unwrap();
    fs::remove_dir_all(entry(shared.path(), "c")).unwrap();
    let used = || fs::metadata(entry(shared.path(), "a").join("record.json")).unwrap().modified().unwrap();
    let record = fs::File::open(entry(shared.path(), "a").join("record.json")).unwrap();
    record.set_modified(SystemTime::now() - hours(50)).unwrap();
    let before = used();
    let area = Area::new();
    let place = Folder::open(shared.path(), true).unwrap();
    let (graph, cache) = (diamond(&area), area.cache().sharing(Some(Sharing::new(Box::new(place)))));
    run(&graph, &cache, 1);
    let tally = cache.shared().unwrap().tally();
    assert_eq!((area.ran(), tally.read_only), (vec!["b".to_owned(), "c".to_owned()], true));
    assert_eq!((tally.fetched, tally.published, tally.problems), (2, 0, BTreeSet::new()));
    assert_eq!(fs::read_to_string(entry(shared.path(), "b").join(FILE)).unwrap(), "b < A");
    assert_eq!(used(), before, "an entry that was read keeps its age");
    assert_eq!(Folder::open(shared.path(), true).unwrap().list().unwrap().len(), 3);
}

/// A cache never takes over a folder with other files, and reading creates none.
#[test]
fn val_a_cache_has_its_own_folder() {
    let foreign = tempfile::tempdir().unwrap();
    fs::write(foreign.path().join("thesis.tex"), b"x").unwrap();
    let refused = |root: &Path, read_only: bool| Folder::open(root, read_only).unwrap_err().to_string();
    for read_only in [false, true] {
        assert!(refused(foreign.path(), read_only).contains("neither empty nor a shared cache"));
        assert!(
            refused(&foreign.path().join("thesis.tex"), read_only)
                .ends_with("this is a file; a shared cache must be a folder")
        );
    }
    let missing = foreign.path().join("none");
    assert!(
        refused(&missing, true).contains("not a shared cache; the folder is missing or empty") && !missing.exists()
    );
    // A work area is not a shared cache, nor the reverse.
    let area = Area::new();
    drop(area.cache());
    assert!(refused(area.folder.path(), false).contains("neither empty nor a shared cache"));
    let shared = tempfile::tempdir().unwrap();
    drop(Folder::open(shared.path(), false).unwrap());
    assert!(Cache::open(shared.path()).is_err());
}

/// Two runs at the same time on one cache: both have every result, and every entry is intact.
#[test]
fn val_two_runs_share_a_cache_at_the_same_time() {
    let shared = tempfile::tempdir().unwrap();
    let wide = |area: &Area| {
        let names: Vec<String> = (0..40).map(|k| format!("n{k:02}")).collect();
        let mut nodes = vec![node(area.line("a"), &[])];
        nodes.extend(names.iter().map(|name| node(area.line(name), &["a"])));
        graph(nodes)
    };
    let one = || {
        let area = Area::new();
        let (graph, cache) = (wide(&area), cache_of(&area, shared.path()));
        let execution = execute(&graph, &cache, &all(&graph), limits(2), &Silent).unwrap();
        assert_eq!(execution.done, all(&graph));
        for position in 1..graph.len() {
            let expected = format!("{} < a", graph.node(position).item.id);
            assert_eq!(text_of(&graph, &cache, position), expected);
        }
        cache.shared().unwrap().tally()
    };
    let tallies = std::thread::scope(|scope| {
        let runs: Vec<_> = (0..3).map(|_| scope.spawn(one)).collect();
        runs.into_iter().map(|run| run.join().unwrap()).collect::<Vec<_>>()
    });
    assert_eq!(tallies.iter().map(|tally| tally.published).sum::<usize>(), 41, "{tallies:?}");
    assert!(tallies.iter().all(|tally| tally.damaged.is_empty() && tally.problems.is_empty()), "{tallies:?}");
    let entries = Folder::open(shared.path(), true).unwrap().list().unwrap();
    assert!(entries.len() == 41 && entries.iter().all(|entry| entry.is_complete), "{entries:?}");
}

/// Entries age from their last use, and drafts go only when they are old.
#[test]
fn val_eviction() {
    let shared = tempfile::tempdir().unwrap();
    run_fresh(diamond, shared.path());
    let place = Folder::open(shared.path(), false).unwrap();
    let now = SystemTime::now();
    let used = |id: &str, ago: u64| {
        let record = fs::File::open(entry(shared.path(), id).join("record.json")).unwrap();
        record.set_modified(now - hours(ago)).unwrap();
    };
    ["a", "b", "c", "d"].iter().zip([50, 40, 30, 20]).for_each(|(id, ago)| used(id, ago));
    let draft = shared.path().join("drafts/1-0");
    fs::create_dir(&draft).unwrap();
    fs::write(draft.join(FILE), "half").unwrap();
    let all = prune(&place, Keep::default(), now).unwrap();
    assert_eq!((all.entries, all.drafts, all.removed), (4, 1, 0));
    assert!(all.unused_days.is_some_and(|days| (days - 50.0 / 24.0).abs() < 1e-6), "{all:?}");
    // Reading an entry is a use: `a` is then the newest.
    let area = Area::new();
    let cache = cache_of(&area, shared.path());
    assert!(cache.fetch(&item("a"), diamond(&area).key(0)).is_some());
    let left = prune(&place, Keep { age: Some(hours(35)), bytes: None }, now).unwrap();
    assert_eq!((left.entries, left.drafts, left.removed), (3, 1, 1));
    let left = prune(&place, Keep { age: None, bytes: Some(left.bytes - 1) }, now).unwrap();
    assert_eq!((left.entries, left.removed), (2, 1));
    entry(shared.path(), "a");
    entry(shared.path(), "d");
    let later = now + hours(25);
    let left = prune(&place, Keep { age: Some(hours(1000)), bytes: None }, later).unwrap();
    assert_eq!((left.entries, left.drafts, left.removed, draft.exists()), (2, 0, 1, false));
    // The run goes on with what is left.
    let (ran, tally) = run_fresh(diamond, shared.path());
    assert_eq!((ran, tally.fetched), (vec!["b".to_owned(), "c".to_owned()], 2));
}

/// An entry that is removed while it is read is computed; one that is published twice stays.
#[test]
fn val_vanished_and_repeated_entries() {
    let shared = tempfile::tempdir().unwrap();
    run_fresh(diamond, shared.path());
    let place = Folder::open(shared.path(), false).unwrap();
    let Entry { name, .. } = place.list().unwrap().swap_remove(0);
    place.remove(&name).unwrap();
    place.remove(&name).unwrap();
    assert!(!place.read(&name, "record.json", &mut Vec::new()).unwrap());
    let area = Area::new();
    let (graph, cache) = (diamond(&area), area.cache());
    run(&graph, &cache, 1);
    let records = all(&graph).into_iter().filter_map(|p| cache.load(&graph.node(p).item, graph.key(p)));
    let published: Vec<bool> = records
        .map(|record| {
            let folder = cache.result_folder(&record.item, &record.key);
            place.publish(&format!("entries/{}/{}", &record.key[..2], record.key), &record, &folder).unwrap()
        })
        .collect();
    assert_eq!(published.iter().filter(|is_new| **is_new).count(), 1, "{published:?}");
}

/// A bucket serves as a folder does: each item once, damage computed again, what a killed run left neither used nor in the way.
#[test]
fn val_a_bucket_is_a_shared_cache() {
    let bucket = Arc::new(Bucket::in_memory("s3://bucket/cache").unwrap());
    let place = |is_read_only: bool| -> Box<dyn Shared> { Box::new(Objects::new(Arc::clone(&bucket), is_read_only)) };
    let ran = || run_with(diamond, place(false));
    let (jobs, tally) = ran();
    assert_eq!((jobs.len(), tally.fetched, tally.published), (4, 0, 4));
    let (jobs, tally) = ran();
    assert_eq!((jobs.len(), tally.fetched, tally.published), (0, 4, 0));
    let entry_of = |id: &str| {
        let is_of = |name: &String| {
            let mut record = Vec::new();
            bucket.read(&format!("{name}/record.json"), &mut record).unwrap()
                && serde_json::from_slice::<serde_json::Value>(&record).unwrap()["item"]["id"] == id
        };
        place(false).list().unwrap().into_iter().map(|entry| entry.name).find(is_of).unwrap()
    };
    let other = tempfile::NamedTempFile::new().unwrap();
    fs::write(other.path(), "b < A").unwrap();
    let [b, c] = [entry_of("b"), entry_of("c")];
    bucket.replace_from(&format!("{b}/{FILE}"), other.path()).unwrap();
    bucket.remove(&format!("{c}/record.json")).unwrap();
    bucket.replace_from(&format!("{c}/{FILE}"), other.path()).unwrap();
    let drafts = || prune(&*place(false), Keep::default(), SystemTime::now()).unwrap().drafts;
    assert_eq!(drafts(), 1, "an entry without its record is a draft");
    let (jobs, tally) = run_with(diamond, place(true));
    assert_eq!((jobs, tally.published, tally.damaged.len()), (vec!["b".to_owned(), "c".to_owned()], 0, 1));
    let (jobs, tally) = ran();
    assert_eq!((jobs, tally.published, tally.damaged.len()), (vec!["b".to_owned(), "c".to_owned()], 2, 1));
    assert!(ran().0.is_empty() && drafts() == 0);
    let left = prune(&*place(false), Keep { bytes: Some(0), age: None }, SystemTime::now()).unwrap();
    assert_eq!((left.entries, left.removed, bucket.list("").unwrap().len()), (0, 4, 0));
    assert!(prune(&*place(true), Keep { bytes: Some(0), age: None }, SystemTime::now()).unwrap().removed == 0);
}

/// The address of a release is not a cache, also to read it.
#[test]
fn val_a_release_in_a_bucket_is_not_a_shared_cache() {
    for is_read_only in [false, true] {
        let bucket = Bucket::in_memory("s3://bucket/snow").unwrap();
        bucket.create("manifest.json", b"{}").unwrap();
        let refused = Objects::open(bucket, is_read_only).unwrap_err();
        assert!(matches!(&refused, Error::Usage(why) if why.starts_with("s3://bucket/snow is a release")), "{refused}");
    }
    assert!(Objects::open(Bucket::in_memory("s3://bucket/snow").unwrap(), false).is_ok());
}

/// Removing an entry leaves an unfinished upload of another run, which is newer than the record; without a record, uploads stay until they are old.
#[test]
fn val_removal_leaves_what_another_run_uploads() {
    let bucket = Arc::new(Bucket::in_memory("s3://bucket/cache").unwrap());
    let place = || Box::new(Objects::new(Arc::clone(&bucket), false));
    run_with(diamond, place());
    let Entry { name, .. } = place().list().unwrap().swap_remove(0);
    let [file, record] = [FILE, "record.json"].map(|file| format!("{name}/{file}"));
    let uploaded = tempfile::NamedTempFile::new().unwrap();
    bucket.replace_from(&file, uploaded.path()).unwrap();
    for _ in 0..2 {
        place().remove(&name).unwrap();
        assert!(bucket.contains(&file).unwrap() && !bucket.contains(&record).unwrap());
    }
    let Entry { name, .. } = place().list().unwrap().into_iter().find(|entry| entry.is_complete).unwrap();
    place().remove(&name).unwrap();
    assert!(bucket.list(&name).unwrap().is_empty());
}

/// A cache whose first entry disappears after its record was read, and perhaps comes back at once, as another run publishes it.
#[derive(Debug)]
struct Evicting {
    folder: Folder,
    root: PathBuf,
    aside: PathBuf,
    comes_back: bool,
    is_evicted: AtomicBool,
}

impl Shared for Evicting {
    fn read(&self, name: &str, file: &str, to: &mut dyn Write) -> Result<bool, Error> {
        if file != FILE || self.is_evicted.swap(true, Ordering::SeqCst) {
            return self.folder.read(name, file, to);
        }
        fs::rename(self.root.join(name), &self.aside).unwrap();
        let is_there = self.folder.read(name, file, to);
        if self.comes_back {
            fs::rename(&self.aside, self.root.join(name)).unwrap();
        }
        is_there
    }

    fn publish(&self, name: &str, record: &Record, folder: &Path) -> Result<bool, Error> {
        self.folder.publish(name, record, folder)
    }

    fn remove(&self, name: &str) -> Result<(), Error> {
        panic!("{name} is not damaged");
    }

    fn list(&self) -> Result<Vec<Entry>, Error> {
        self.folder.list()
    }

    fn is_read_only(&self) -> bool {
        false
    }
}

/// An entry that is evicted while it is copied is neither damaged nor removed: it may have been published again meanwhile.
#[test]
fn val_evicted_entries_are_not_damaged() {
    for comes_back in [false, true] {
        let (shared, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        run_fresh(diamond, shared.path());
        let place = Evicting {
            folder: Folder::open(shared.path(), false).unwrap(),
            root: shared.path().to_owned(),
            aside: elsewhere.path().join("entry"),
            comes_back,
            is_evicted: AtomicBool::new(false),
        };
        let (ran, tally) = run_with(diamond, Box::new(place));
        assert_eq!((tally.damaged, tally.problems), (BTreeSet::new(), BTreeSet::new()));
        assert_eq!((ran.len(), tally.fetched), if comes_back { (0, 4) } else { (1, 3) });
        assert!(run_fresh(diamond, shared.path()).0.is_empty());
    }
}

/// A work area that cannot be written to is not reported as a problem of the cache, whose entry stays.
#[test]
fn val_a_failing_work_area_is_not_blamed_on_the_cache() {
    let shared = tempfile::tempdir().unwrap();
    run_fresh(diamond, shared.path());
    let (area, file) = (Area::new(), tempfile::NamedTempFile::new().unwrap());
    let sharing = Sharing::new(Box::new(Folder::open(shared.path(), false).unwrap()));
    let below_a_file = file.path().join("folder");
    assert!(sharing.fetch(&item("a"), diamond(&area).key(0), Draft(&below_a_file)).is_none());
    assert_eq!(sharing.tally(), Tally::default());
    entry(shared.path(), "a");
}

/// The outcome of `run --ancestors` for two shards with one common ancestor, which ends in this way.
fn ancestors(ending: Ending, place: Box<dyn Shared>) -> Result<RunSummary, Error> {
    let area = Area::new();
    let mut nodes = vec![node(area.ending("a", ending), &[])];
    nodes.extend((0..30).map(|k| node(area.line(&format!("n{k:02}")), &["a"])));
    let text = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"t\"\nkind = \"multifractal\"\n\
        size_px = [64, 64]\n";
    let loaded = Loaded { graph: graph(nodes), ..load_text(text, "study", Path::new("")).unwrap() };
    let output = area.folder.path().join("none");
    let request = RunRequest {
        output: &output,
        work: Some(area.folder.path()),
        part: None,
        purpose: None,
        replace: false,
        limits: limits(1),
    };
    run_ancestors(&loaded, 2, &request, Sharing::new(place), &Silent)
}

/// Shards run even if all common ancestors failed: other items may have results.
#[test]
fn val_failed_ancestors_are_listed() {
    let shared = tempfile::tempdir().unwrap();
    let place = Folder::open(shared.path(), false).unwrap();
    let summary = ancestors(Ending::Refused, Box::new(place)).unwrap();
    assert_eq!((summary.items, summary.computed, summary.failures.len()), (1, 0, 1));
    assert_eq!(summary.failures[0].message, "the DEM is flat");
}

/// A cache to which nothing can be published, with the reason.
#[derive(Debug)]
struct Refusing(fn(String) -> Error);

impl Shared for Refusing {
    fn read(&self, _: &str, _: &str, _: &mut dyn Write) -> Result<bool, Error> {
        Ok(false)
    }

    fn publish(&self, _: &str, _: &Record, _: &Path) -> Result<bool, Error> {
        Err(self.0("no room".to_owned()))
    }

    fn remove(&self, _: &str) -> Result<(), Error> {
        Ok(())
    }

    fn list(&self) -> Result<Vec<Entry>, Error> {
        Ok(Vec::new())
    }

    fn is_read_only(&self) -> bool {
        false
    }
}

/// Ancestors that could not be published are retried only if that may help.
#[test]
fn val_problems_of_the_cache_keep_their_kind() {
    let said = |error: fn(String) -> Error| ancestors(Ending::Written, Box::new(Refusing(error))).unwrap_err();
    let missing = "some ancestors may be missing from the cache: no room; ";
    assert!(matches!(said(Error::Retry), Error::Retry(why) if why == format!("{missing}run again")));
    for lasting in [Error::Failed, Error::Input] {
        let expected = format!("{missing}fix the problem and run again");
        assert!(matches!(said(lasting), Error::Failed(why) if why == expected));
    }
}
