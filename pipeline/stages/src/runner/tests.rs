//! Keys, work area, plan and execution, with jobs that only write a line of text.

mod division;
mod shared;

use super::cache::{Cache, CacheError};
use super::execute::{Execution, Limits, execute};
use super::graph::{Graph, InputFile, Node};
use super::plan::{PlanSummary, plan};
use super::progress::{End, Progress, Silent};
use crate::job::{Cause, Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::machine::Fault;
use crate::revision::Room;
use sastrugi_schemas::manifest::JsonText;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;

const FILE: &str = "line.txt";

/// How a job ends.
#[derive(Clone, Copy)]
enum Ending {
    Written,
    Refused,
    Bug,
    NoSpace,
}

/// A job that writes its name, then the lines of its parents.
#[derive(Clone)]
struct Line {
    name: String,
    recipe: Value,
    packing: Value,
    rooms: &'static [Room],
    memory_bytes: u64,
    ending: Ending,
    /// Names of the jobs that ran.
    log: Arc<Mutex<Vec<String>>>,
    /// Memory of the jobs that are running, and the largest that ever was, bytes.
    memory: Arc<Mutex<[u64; 2]>>,
}

impl Line {
    /// Takes memory for a while.
    fn occupy(&self) {
        if self.memory_bytes == 0 {
            return;
        }
        let change = |by: i64| {
            let mut memory = self.memory.lock().unwrap();
            memory[0] = memory[0].wrapping_add_signed(by);
            memory[1] = memory[1].max(memory[0]);
        };
        change(self.memory_bytes as i64);
        std::thread::sleep(Duration::from_millis(5));
        change(-(self.memory_bytes as i64));
    }
}

impl Job for Line {
    fn recipe(&self) -> Value {
        self.recipe.clone()
    }

    fn packing(&self) -> Value {
        self.packing.clone()
    }

    fn rooms(&self) -> &'static [Room] {
        self.rooms
    }

    fn memory_bytes(&self) -> u64 {
        self.memory_bytes
    }

    fn estimate(&self) -> Estimate {
        Estimate { seconds: 2.0, bytes: 3.0 }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        self.log.lock().unwrap().push(self.name.clone());
        self.occupy();
        match self.ending {
            Ending::Written => {}
            Ending::Refused => return Err(JobError::input("the DEM is flat")),
            Ending::Bug => panic!("a bug"),
            Ending::NoSpace => {
                return Err(JobError { message: "no space".to_owned(), cause: Cause::Machine(Fault::Passing) });
            }
        }
        let mut text = self.name.clone();
        for item in work.parents.keys() {
            let path = work.parent(item, FILE)?;
            text += " < ";
            text += &fs::read_to_string(&path).map_err(|e| JobError::at(&path, e))?;
        }
        work.write(FILE, text.as_bytes())?;
        Ok(Outcome { products: vec![Product::internal(FILE)], notes: vec![format!("{} was written", self.name)] })
    }
}

/// A work area and what its jobs did.
struct Area {
    folder: tempfile::TempDir,
    log: Arc<Mutex<Vec<String>>>,
    memory: Arc<Mutex<[u64; 2]>>,
}

impl Area {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap(), log: Arc::default(), memory: Arc::default() }
    }

    fn line(&self, name: &str) -> Line {
        Line {
            name: name.to_owned(),
            recipe: json!({ "text": name, "size": 1 }),
            packing: Value::Null,
            rooms: &[],
            memory_bytes: 0,
            ending: Ending::Written,
            log: Arc::clone(&self.log),
            memory: Arc::clone(&self.memory),
        }
    }

    fn ending(&self, name: &str, ending: Ending) -> Line {
        Line { ending, ..self.line(name) }
    }

    fn cache(&self) -> Cache {
        Cache::open(self.folder.path()).unwrap()
    }

    /// Names of the jobs that ran since the last call.
    fn ran(&self) -> Vec<String> {
        std::mem::take(&mut *self.log.lock().unwrap())
    }
}

fn item(id: &str) -> ItemRef {
    ItemRef::new("s", id)
}

fn node(line: Line, parents: &[&str]) -> Node {
    Node {
        item: item(&line.name),
        parents: parents.iter().map(|id| item(id)).collect(),
        inputs: Vec::new(),
        stream: None,
        job: Box::new(line),
    }
}

fn graph(nodes: Vec<Node>) -> Graph {
    let mut graph = Graph::default();
    for node in nodes {
        assert!(graph.add(node));
    }
    graph
}

fn all(graph: &Graph) -> Vec<usize> {
    (0..graph.len()).collect()
}

fn limits(workers: usize) -> Limits {
    Limits { workers, memory_bytes: 130, beyond: true }
}

fn run(graph: &Graph, cache: &Cache, workers: usize) -> Execution {
    execute(graph, cache, &all(graph), limits(workers), &Silent).unwrap()
}

fn text_of(graph: &Graph, cache: &Cache, position: usize) -> String {
    let folder = cache.result_folder(&graph.node(position).item, graph.key(position));
    fs::read_to_string(folder.join(FILE)).unwrap()
}

/// Two items between one parent and one child.
fn diamond(area: &Area) -> Graph {
    graph(vec![
        node(area.line("a"), &[]),
        node(area.line("b"), &["a"]),
        node(area.line("c"), &["a"]),
        node(area.line("d"), &["b", "c"]),
    ])
}

#[test]
fn val_a_graph_refuses_repeated_names_and_missing_parents() {
    let area = Area::new();
    let mut graph = graph(vec![node(area.line("a"), &[])]);
    assert!(!graph.add(node(area.line("a"), &[])));
    assert!(!graph.add(node(area.line("c"), &["a", "b"])));
    assert_eq!((graph.len(), graph.find(&item("a")), graph.find(&item("c"))), (1, Some(0), None));
}

#[test]
fn val_the_closure_is_an_item_with_its_ancestors() {
    let area = Area::new();
    let graph = graph(vec![
        node(area.line("a"), &[]),
        node(area.line("b"), &["a"]),
        node(area.line("x"), &[]),
        node(area.line("c"), &["b"]),
        node(area.line("y"), &["x", "a"]),
    ]);
    assert_eq!(graph.closure([3]), [0, 1, 3]);
    assert_eq!(graph.closure([4]), [0, 2, 4]);
    assert_eq!(graph.closure([1, 2]), [0, 1, 2]);
    assert!(graph.closure([]).is_empty());
}

/// Whatever determines the bytes of a result changes its key, and nothing else does.
#[test]
fn val_keys_follow_what_determines_the_bytes() {
    let area = Area::new();
    let key = |line: Line, change: &dyn Fn(&mut Node)| {
        let mut one = node(line, &[]);
        change(&mut one);
        graph(vec![one]).key(0).to_owned()
    };
    let same = |_: &mut Node| {};
    let line = || area.line("a");
    let file = |path: &str, sha256: &str| InputFile { path: PathBuf::from(path), sha256: sha256.to_owned() };
    let plain = key(line(), &same);
    assert!(plain.len() == 32 && plain.bytes().all(|b| b.is_ascii_hexdigit()), "{plain}");
    let different = [
        plain.clone(),
        key(Line { recipe: json!({ "text": "b" }), ..line() }, &same),
        key(Line { packing: json!("cog"), ..line() }, &same),
        key(Line { rooms: &[Room::Terrain], ..line() }, &same),
        key(line(), &|node| node.stream = Some("seed/1".to_owned())),
        key(line(), &|node| node.inputs = vec![file("x", "ab")]),
        key(line(), &|node| node.inputs = vec![file("x", "ab"), file("y", "cd")]),
        key(line(), &|node| node.item = item("b")),
    ];
    assert_eq!(different.iter().collect::<BTreeSet<_>>().len(), different.len(), "{different:?}");
    assert_eq!(key(Line { memory_bytes: 9, ending: Ending::Bug, ..line() }, &same), plain);
    assert_eq!(key(line(), &|node| node.inputs = vec![file("elsewhere", "ab")]), different[5]);
}

/// A child reads the heights of its parents, however they are packed.
#[test]
fn val_keys_of_children_ignore_the_packing_of_their_parents() {
    let area = Area::new();
    let of_child = |parent: Line| {
        let both = graph(vec![node(parent, &[]), node(area.line("child"), &["a"])]);
        (both.key(1).to_owned(), both.ingredients(1).parents)
    };
    let plain = of_child(area.line("a"));
    assert_eq!(of_child(Line { packing: json!("cog"), ..area.line("a") }), plain);
    assert_ne!(of_child(Line { recipe: json!(2), ..area.line("a") }).0, plain.0);
    assert_eq!(plain.1.keys().collect::<Vec<_>>(), ["s/a"]);
}

/// Parents come first, each item runs once, and a second run has nothing to do.
#[test]
fn val_every_item_runs_once_after_its_parents() {
    for workers in [1, 4] {
        let area = Area::new();
        let (graph, cache) = (diamond(&area), area.cache());
        let execution = run(&graph, &cache, workers);
        assert_eq!((execution.done, execution.failures), (vec![0, 1, 2, 3], Vec::new()));
        assert_eq!(execution.seconds.keys().collect::<Vec<_>>(), ["s/a", "s/b", "s/c", "s/d"]);
        let ran = area.ran();
        assert_eq!((ran.len(), ran[0].as_str(), ran[3].as_str()), (4, "a", "d"), "{ran:?}");
        assert_eq!(text_of(&graph, &cache, 3), "d < b < a < c < a");
        let again = run(&graph, &cache, workers);
        assert_eq!((again.done, again.seconds.len(), area.ran().len()), (vec![0, 1, 2, 3], 0, 0));
    }
}

/// Notes what it is told.
#[derive(Default)]
struct Told(Mutex<Vec<String>>);

impl Progress for Told {
    fn begin(&self, total: usize, ready: usize, seconds: f64) {
        self.0.lock().unwrap().push(format!("{total} items, {ready} ready, {seconds} s"));
    }

    fn ended(&self, item: &ItemRef, end: &End, seconds: f64) {
        let how = match end {
            End::Done(notes) => notes.join(", "),
            End::Failed(message) => message.clone(),
            End::Skipped(parent) => format!("skipped for {parent}"),
        };
        self.0.lock().unwrap().push(format!("{item}: {how}, {seconds} s"));
    }
}

/// Whoever estimates the time left knows which items run: each is told at its start and at its end, and one that is skipped at its end only.
#[test]
fn val_the_start_of_an_item_is_told() {
    #[derive(Default)]
    struct Both(Mutex<Vec<String>>);
    impl Progress for Both {
        fn started(&self, item: &ItemRef, seconds: f64) {
            self.0.lock().unwrap().push(format!("{item} starts, {seconds} s"));
        }
        fn ended(&self, item: &ItemRef, _end: &End, _seconds: f64) {
            self.0.lock().unwrap().push(format!("{item} ended"));
        }
    }
    let area = Area::new();
    let graph = graph(vec![node(area.ending("a", Ending::Refused), &[]), node(area.line("b"), &["a"])]);
    let (cache, told) = (area.cache(), Both::default());
    execute(&graph, &cache, &all(&graph), limits(1), &told).unwrap();
    assert_eq!(*told.0.lock().unwrap(), ["s/a starts, 2 s", "s/a ended", "s/b ended"]);
}

/// Descendants of a failed item are skipped, whatever other parents they have; everything else runs.
#[test]
fn val_a_failure_skips_only_descendants() {
    let area = Area::new();
    let graph = graph(vec![
        node(area.ending("a", Ending::Refused), &[]),
        node(area.line("x"), &[]),
        node(area.line("b"), &["a", "x"]),
        node(area.line("c"), &["b"]),
        node(area.line("y"), &["x"]),
    ]);
    let (cache, told) = (area.cache(), Told::default());
    let execution = execute(&graph, &cache, &all(&graph), limits(1), &told).unwrap();
    assert_eq!((execution.done, area.ran()), (vec![1, 4], ["a", "x", "y"].map(str::to_owned).to_vec()));
    let failures: Vec<(&str, &str, bool)> = execution
        .failures
        .iter()
        .map(|failure| (failure.item.id.as_str(), failure.message.as_str(), failure.unusable_input))
        .collect();
    let skipped = "skipped, because s/a failed";
    assert_eq!(failures, [("a", "the DEM is flat", true), ("b", skipped, false), ("c", skipped, false)]);
    let causes: Vec<Option<ItemRef>> = execution.failures.iter().map(|failure| failure.skipped_for.clone()).collect();
    assert_eq!(causes, [None, Some(item("a")), Some(item("a"))]);
    let parameters: Vec<Option<&str>> =
        execution.failures.iter().map(|failure| failure.parameters.as_ref().map(JsonText::as_str)).collect();
    assert_eq!(parameters, [Some(r#"{"text":"a","size":1}"#), None, None]);
    let expected = [
        "5 items, 0 ready, 10 s",
        "s/a: the DEM is flat, 2 s",
        "s/b: skipped for s/a, 2 s",
        "s/c: skipped for s/a, 2 s",
        "s/x: x was written, 2 s",
        "s/y: y was written, 2 s",
    ];
    assert_eq!(told.0.into_inner().unwrap(), expected);
    assert_eq!(cache.failure(&item("a"), graph.key(0)).as_deref(), Some("the DEM is flat"));
    assert_eq!((cache.failure(&item("a"), graph.key(1)), cache.failure(&item("b"), graph.key(2))), (None, None));
}

/// A panic is a bug of one job, which must not end the run.
#[test]
fn val_a_panic_fails_one_item() {
    let area = Area::new();
    let graph = graph(vec![node(area.ending("a", Ending::Bug), &[]), node(area.line("b"), &[])]);
    let execution = run(&graph, &area.cache(), 2);
    assert_eq!((execution.done, execution.failures.len()), (vec![1], 1));
    let failure = &execution.failures[0];
    assert_eq!((failure.message.as_str(), failure.unusable_input), ("internal error: a bug", false));
}

/// An error of the machine says nothing about the item: nothing is kept of it, and nothing else is started.
#[test]
fn val_an_error_of_the_machine_stops_the_run() {
    let area = Area::new();
    let graph = graph(vec![node(area.ending("a", Ending::NoSpace), &[]), node(area.line("b"), &[])]);
    let cache = area.cache();
    let stopped = execute(&graph, &cache, &all(&graph), limits(1), &Silent).unwrap_err();
    assert_eq!((stopped.item, stopped.error.message.as_str()), (item("a"), "no space"));
    assert_eq!(area.ran(), ["a"]);
    assert_eq!(cache.failure(&item("a"), graph.key(0)), None);
    let reasons: Vec<String> =
        plan(&graph, &all(&graph), &cache).stale.into_iter().map(|stale| stale.reason.into_owned()).collect();
    assert_eq!(reasons, ["new", "new"]);
}

/// Whoever watches a run can end it: no further item starts, nothing counts as failed, and another run does the rest.
#[test]
fn val_a_cancelled_run_starts_no_further_item() {
    struct Once(Mutex<usize>);
    impl Progress for Once {
        fn ended(&self, _item: &ItemRef, _end: &End, _seconds: f64) {
            *self.0.lock().unwrap() += 1;
        }
        fn is_cancelled(&self) -> bool {
            *self.0.lock().unwrap() > 0
        }
    }
    let area = Area::new();
    let (graph, cache) = (graph(["a", "b", "c"].map(|name| node(area.line(name), &[])).into()), area.cache());
    let stopped = execute(&graph, &cache, &all(&graph), limits(1), &Once(Mutex::default())).unwrap_err();
    assert_eq!(stopped.error.cause, Cause::Machine(Fault::Passing));
    assert_eq!(area.ran(), ["a"]);
    let execution = run(&graph, &cache, 1);
    assert_eq!((execution.done, execution.failures.len()), (all(&graph), 0));
    assert_eq!(area.ran(), ["b", "c"]);
}

/// The items that run at the same time stay below the limit together; one beyond it runs alone.
#[test]
fn val_memory_is_limited() {
    let area = Area::new();
    let sized = |name: &str, memory_bytes: u64| node(Line { memory_bytes, ..area.line(name) }, &[]);
    let small = graph(["a", "b", "c", "d", "e", "f"].map(|name| sized(name, 60)).into());
    let cache = area.cache();
    assert_eq!(run(&small, &cache, 4).done.len(), 6);
    let [now, most] = *area.memory.lock().unwrap();
    assert!(now == 0 && (60..=120).contains(&most), "{now} {most}");
    let mixed = graph(vec![sized("large", 500), sized("g", 60), sized("h", 60)]);
    assert_eq!(run(&mixed, &cache, 4).done.len(), 3);
    assert_eq!(*area.memory.lock().unwrap(), [0, 500]);
}

/// A result counts only under its key, with its record, and with files of the recorded sizes.
#[test]
fn val_only_complete_results_count() {
    let area = Area::new();
    let (graph, cache) = (graph(vec![node(area.line("a"), &[])]), area.cache());
    assert!(!cache.knows(&item("a")) && !cache.holds(&item("a"), graph.key(0)));
    run(&graph, &cache, 1);
    let record = cache.load(&item("a"), graph.key(0)).unwrap();
    assert_eq!((record.item, record.key.as_str()), (item("a"), graph.key(0)));
    assert_eq!(record.notes, ["a was written"]);
    // SHA-256 of the letter a.
    let sha256 = "ca978112ca1bbdcafac231b39a23dc4da786eff8147c4e72b9807785afee48bb";
    assert_eq!((record.files.len(), record.files[0].bytes, record.files[0].sha256.as_str()), (1, 1, sha256));
    assert_eq!(cache.earlier(&item("a")), Some(graph.ingredients(0)));
    assert!(!cache.holds(&item("a"), &"0".repeat(32)) && !cache.holds(&item("b"), graph.key(0)));
    let folder = cache.result_folder(&item("a"), graph.key(0));
    fs::write(folder.join(FILE), b"longer").unwrap();
    assert!(!cache.holds(&item("a"), graph.key(0)) && cache.knows(&item("a")));
    assert_eq!(plan(&graph, &[0], &cache).stale[0].reason, "new");
    // The next run makes it again.
    assert_eq!((run(&graph, &cache, 1).done, text_of(&graph, &cache, 0)), (vec![0], "a".to_owned()));
    fs::remove_file(folder.join("record.json")).unwrap();
    assert!(!cache.holds(&item("a"), graph.key(0)));
}

/// What a killed run left unfinished is removed by the next one; results and other people's folders stay.
#[test]
fn val_unfinished_results_are_removed() {
    let area = Area::new();
    let graph = graph(vec![node(area.line("a"), &[])]);
    let cache = area.cache();
    run(&graph, &cache, 1);
    let key = "0123456789abcdef0123456789abcdef";
    let unfinished = cache.begin(&item("a"), key).unwrap();
    fs::write(unfinished.join(FILE), b"half").unwrap();
    let own = area.folder.path().join("items/s/a/my notes");
    fs::create_dir(&own).unwrap();
    drop(cache);
    let cache = area.cache();
    assert!(!unfinished.exists() && own.exists() && cache.holds(&item("a"), graph.key(0)));
}

#[test]
fn val_results_of_no_item_are_dropped() {
    let area = Area::new();
    let (old, cache) = (diamond(&area), area.cache());
    run(&old, &cache, 2);
    let new = graph(vec![node(area.line("a"), &[]), node(Line { recipe: json!(2), ..area.line("b") }, &["a"])]);
    run(&new, &cache, 2);
    // Of the diamond only `a` is left; `b` has another key, `c` and `d` are gone from the study.
    assert_eq!(cache.drop_orphans(&new).unwrap(), 3);
    let left = [0, 1, 2, 3].map(|p| cache.holds(&old.node(p).item, old.key(p)));
    assert_eq!(left, [true, false, false, false]);
    assert!(cache.holds(&item("b"), new.key(1)));
    assert_eq!(cache.drop_orphans(&new).unwrap(), 0);
}

/// One run at a time writes to a work area, and never to a folder with anything else in it.
#[test]
fn val_a_work_area_has_one_owner() {
    let area = Area::new();
    let cache = area.cache();
    assert!(matches!(Cache::open(area.folder.path()), Err(CacheError::Busy(_))));
    assert!(!Cache::look(area.folder.path()).holds(&item("a"), "0"));
    drop(cache);
    drop(area.cache());
    let foreign = tempfile::tempdir().unwrap();
    fs::write(foreign.path().join("thesis.tex"), b"x").unwrap();
    assert!(matches!(Cache::open(foreign.path()), Err(CacheError::NotOurs(_))));
    fs::write(foreign.path().join("CACHEDIR.TAG"), b"Signature: another program").unwrap();
    assert!(matches!(Cache::open(foreign.path()), Err(CacheError::NotOurs(_))));
    assert_eq!(fs::read_dir(foreign.path()).unwrap().count(), 2);
}

/// A link would lead out of the work area, where nothing may be removed.
#[cfg(unix)]
#[test]
fn val_links_in_a_work_area_are_refused() {
    let area = Area::new();
    let outside = tempfile::tempdir().unwrap();
    drop(area.cache());
    fs::create_dir_all(area.folder.path().join("items/s")).unwrap();
    std::os::unix::fs::symlink(outside.path(), area.folder.path().join("items/s/a")).unwrap();
    let refused = Cache::open(area.folder.path()).unwrap_err();
    assert!(matches!(&refused, CacheError::Link(path) if path.ends_with("items/s/a")), "{refused}");
}

/// A plan names each item to compute with the reason, and what it costs.
#[test]
fn val_a_plan_says_why() {
    let area = Area::new();
    let chain = |size: u32, ending: Ending| {
        let first = Line { recipe: json!({ "text": "a", "size": size }), ..area.line("a") };
        graph(vec![node(first, &[]), node(Line { memory_bytes: 7, ..area.ending("b", ending) }, &["a"])])
    };
    let reasons = |summary: &PlanSummary| -> Vec<String> {
        summary.stale.iter().map(|stale| format!("{}: {}", stale.item, stale.reason)).collect()
    };
    let (old, cache) = (chain(1, Ending::Refused), area.cache());
    let fresh = plan(&old, &all(&old), &cache);
    assert_eq!(reasons(&fresh), ["s/a: new", "s/b: new"]);
    assert_eq!((fresh.stale[1].seconds, fresh.stale[1].bytes, fresh.stale[1].memory_bytes), (2.0, 3.0, 7));
    // Assembly and report follow, on ready items as well.
    assert!(fresh.assembly_seconds > 0.5 && fresh.assembly_seconds < 0.6, "{}", fresh.assembly_seconds);
    run(&old, &cache, 1);
    let half = plan(&old, &all(&old), &cache);
    assert_eq!((half.items, half.ready, half.assembly_seconds), (2, 1, fresh.assembly_seconds));
    assert_eq!(reasons(&half), ["s/b: failed before: the DEM is flat"]);
    // The same recipe, which now works: nothing of the key has changed, so the item is only tried again.
    let mended = chain(1, Ending::Written);
    run(&mended, &cache, 1);
    assert_eq!((plan(&mended, &all(&mended), &cache).ready, plan(&mended, &[1], &cache).items), (2, 1));
    let new = chain(2, Ending::Written);
    let changed = ["s/a: changed: size 1 -> 2", "s/b: depends on s/a, which changed"];
    assert_eq!(reasons(&plan(&new, &all(&new), &cache)), changed);
}
