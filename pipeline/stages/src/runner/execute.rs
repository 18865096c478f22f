//! Runs the items of a graph, parents first and each at most once, in parallel as far as workers and memory allow.

use super::cache::Cache;
use super::graph::Graph;
use super::progress::{End, Progress};
use crate::job::{Cause, ItemRef, JobError, Work};
use crate::machine::Fault;
use rayon::prelude::*;
use sastrugi_schemas::manifest::JsonText;
use sastrugi_store::atomic::Draft;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Limits of a run. They never change a byte of the result.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Maximum number of items running at the same time.
    pub workers: usize,
    /// Maximum total working memory of the items running at the same time, bytes.
    pub memory_bytes: u64,
    /// Whether an item that exceeds the memory limit by itself may run alone; otherwise nothing is run.
    pub beyond: bool,
}

/// An item without a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// The item.
    pub item: ItemRef,
    /// Why it failed.
    pub message: String,
    /// Whether the cause is in the input data.
    pub unusable_input: bool,
    /// The failed parent because of which this item was skipped.
    pub skipped_for: Option<ItemRef>,
    /// Its recipe, unless it was skipped.
    pub parameters: Option<JsonText>,
}

/// A run stopped early because an item met an error of the machine.
#[derive(Debug)]
pub struct Stopped {
    /// The item.
    pub item: ItemRef,
    /// The error.
    pub error: JobError,
}

/// Outcome of a run.
#[derive(Debug, Default)]
pub struct Execution {
    /// Positions with a result, sorted.
    pub done: Vec<usize>,
    /// Items without one, in graph order.
    pub failures: Vec<Failure>,
    /// Wall time of each item that was computed, s.
    pub seconds: BTreeMap<String, f64>,
}

/// An item with a result.
struct Ran {
    notes: Vec<String>,
    is_fetched: bool,
}

struct State {
    waiting_for: BTreeMap<usize, usize>,
    ready: Ready,
    running: usize,
    memory_bytes: u64,
    execution: Execution,
    failed: BTreeMap<usize, Failure>,
    stopped: Option<Stopped>,
}

/// Items that may start, in graph order and by the memory that they need.
#[derive(Default)]
struct Ready {
    in_order: BTreeSet<usize>,
    by_memory: BTreeSet<(u64, usize)>,
}

impl Ready {
    fn insert(&mut self, position: usize, memory_bytes: u64) {
        self.in_order.insert(position);
        self.by_memory.insert((memory_bytes, position));
    }

    fn remove(&mut self, position: usize, memory_bytes: u64) {
        self.in_order.remove(&position);
        self.by_memory.remove(&(memory_bytes, position));
    }

    /// The first item that fits among a few, or else the smallest. A search through all would take too long if very many are ready and memory
    /// is short.
    fn first_that_fits(&self, fits: impl Fn(usize) -> bool) -> Option<usize> {
        let mut first = self.in_order.iter().take(FIRST_READY).copied();
        let smallest = || self.by_memory.first().map(|&(_, position)| position).filter(|&position| fits(position));
        first.find(|&position| fits(position)).or_else(smallest)
    }
}

/// Number of ready items that are looked at in graph order.
const FIRST_READY: usize = 64;

struct Run<'a> {
    graph: &'a Graph,
    cache: &'a Cache,
    limits: Limits,
    progress: &'a dyn Progress,
    children: BTreeMap<usize, Vec<usize>>,
    state: Mutex<State>,
    changed: Condvar,
}

/// Computes results for the `needed` items, which must include their parents. With a shared cache behind the work area, what it has is
/// copied instead, and what it lacks is published, also results that were ready.
///
/// The process may be killed at any moment: an unfinished item leaves no result.
///
/// # Errors
/// The first error of the machine. Items already running are finished; no others are started.
pub fn execute(
    graph: &Graph,
    cache: &Cache,
    needed: &[usize],
    limits: Limits,
    progress: &dyn Progress,
) -> Result<Execution, Stopped> {
    if cache.shared().is_some() {
        // First, because a result that changed is removed instead, and then has to be computed.
        let records = needed.par_iter().filter_map(|&p| cache.load(&graph.node(p).item, graph.key(p)));
        records.for_each(|record| cache.publish_earlier(&record));
    }
    let (ready, missing): (Vec<usize>, Vec<usize>) =
        needed.iter().partition(|&&p| cache.holds(&graph.node(p).item, graph.key(p)));
    let seconds = missing.iter().map(|&p| graph.node(p).job.estimate().seconds).sum();
    progress.begin(needed.len(), ready.len(), seconds);
    let run = Run {
        graph,
        cache,
        limits,
        progress,
        children: children(graph, &missing),
        state: Mutex::new(initial(graph, &missing)),
        changed: Condvar::new(),
    };
    std::thread::scope(|scope| {
        for _ in 0..limits.workers.clamp(1, missing.len().max(1)) {
            scope.spawn(|| run.work());
        }
    });
    let state = run.state.into_inner().unwrap_or_else(PoisonError::into_inner);
    if let Some(stopped) = state.stopped {
        return Err(stopped);
    }
    let mut execution = state.execution;
    execution.done.extend(ready);
    execution.done.sort_unstable();
    execution.failures = state.failed.into_values().collect();
    Ok(execution)
}

fn children(graph: &Graph, missing: &[usize]) -> BTreeMap<usize, Vec<usize>> {
    let mut children: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for &position in missing {
        for parent in graph.parents(position) {
            children.entry(parent).or_default().push(position);
        }
    }
    children
}

fn initial(graph: &Graph, missing: &[usize]) -> State {
    let open: BTreeSet<usize> = missing.iter().copied().collect();
    let waiting_for: BTreeMap<usize, usize> =
        missing.iter().map(|&p| (p, graph.parents(p).filter(|q| open.contains(q)).count())).collect();
    let mut ready = Ready::default();
    for (&position, _) in waiting_for.iter().filter(|(_, n)| **n == 0) {
        ready.insert(position, graph.node(position).job.memory_bytes());
    }
    State {
        waiting_for,
        ready,
        running: 0,
        memory_bytes: 0,
        execution: Execution::default(),
        failed: BTreeMap::new(),
        stopped: None,
    }
}

impl Run<'_> {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        while let Some(position) = self.take() {
            let start = Instant::now();
            let end = self.run_item(position);
            self.settle(position, end, start.elapsed().as_secs_f64());
        }
    }

    /// Waits for the next item that may start; `None` when no more will.
    fn take(&self) -> Option<usize> {
        let mut state = self.lock();
        loop {
            if state.stopped.is_some() || state.ready.in_order.is_empty() && state.running == 0 {
                return None;
            }
            if let Some(position) = self.first_that_fits(&state) {
                let memory_bytes = self.memory_bytes(position);
                state.ready.remove(position, memory_bytes);
                state.running += 1;
                state.memory_bytes += memory_bytes;
                return Some(position);
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn first_that_fits(&self, state: &State) -> Option<usize> {
        let free =
            |position| state.memory_bytes.saturating_add(self.memory_bytes(position)) <= self.limits.memory_bytes;
        state.ready.first_that_fits(|position| state.running == 0 || free(position))
    }

    fn memory_bytes(&self, position: usize) -> u64 {
        self.graph.node(position).job.memory_bytes()
    }

    /// Copies a result from the shared cache, or computes it.
    fn run_item(&self, position: usize) -> Result<Ran, JobError> {
        if self.progress.is_cancelled() {
            return Err(JobError {
                message: "not started: interrupted".to_owned(),
                cause: Cause::Machine(Fault::Passing),
            });
        }
        let node = self.graph.node(position);
        self.progress.started(&node.item, node.job.estimate().seconds);
        let key = self.graph.key(position);
        if let Some(record) = self.cache.fetch(&node.item, key) {
            return Ok(Ran { notes: record.notes, is_fetched: true });
        }
        let folder = self.cache.begin(&node.item, key).map_err(JobError::io)?;
        let parents = self
            .graph
            .parents(position)
            .map(|p| {
                (self.graph.node(p).item.clone(), self.cache.result_folder(&self.graph.node(p).item, self.graph.key(p)))
            })
            .collect();
        let work = Work { folder: Draft(&folder), parents: &parents };
        // A panic is a bug; it must fail one item, not the run.
        let outcome = catch_unwind(AssertUnwindSafe(|| node.job.run(&work)))
            .unwrap_or_else(|panic| Err(JobError::new(format!("internal error: {}", panic_text(&*panic)))));
        let outcome = outcome.inspect_err(|error| {
            // Errors of the clean-up are ignored, because the reason of the failure matters more: the next run clears the folder and retries.
            let _ = std::fs::remove_dir_all(&folder);
            if !matches!(error.cause, Cause::Machine(_)) {
                let _ = self.cache.keep_failure(&node.item, key, &error.message);
            }
        })?;
        let record = self.cache.finish(self.graph, position, &folder, outcome).map_err(JobError::io)?;
        self.cache.publish(&record);
        Ok(Ran { notes: record.notes, is_fetched: false })
    }

    fn settle(&self, position: usize, end: Result<Ran, JobError>, seconds: f64) {
        let job = &self.graph.node(position).job;
        let item = &self.graph.node(position).item;
        let mut state = self.lock();
        state.running -= 1;
        state.memory_bytes -= job.memory_bytes();
        if !end.as_ref().is_ok_and(|ran| ran.is_fetched) {
            state.execution.seconds.insert(item.to_string(), seconds);
        }
        match end {
            Ok(Ran { notes, .. }) => {
                state.execution.done.push(position);
                self.release_children(&mut state, position);
                self.progress.ended(item, &End::Done(notes), job.estimate().seconds);
            }
            Err(error) if matches!(error.cause, Cause::Machine(_)) => {
                state.stopped.get_or_insert(Stopped { item: item.clone(), error });
            }
            Err(error) => {
                self.progress.ended(item, &End::Failed(error.message.clone()), job.estimate().seconds);
                let failure = Failure {
                    item: item.clone(),
                    message: error.message,
                    unusable_input: error.cause == Cause::Input,
                    skipped_for: None,
                    parameters: Some(JsonText::of_text(job.recipe_text())),
                };
                state.failed.insert(position, failure);
                self.skip_children(&mut state, position, item);
            }
        }
        drop(state);
        self.changed.notify_all();
    }

    fn release_children(&self, state: &mut State, position: usize) {
        for child in self.children.get(&position).into_iter().flatten() {
            if let Some(count) = state.waiting_for.get_mut(child) {
                *count -= 1;
                if *count == 0 && !state.failed.contains_key(child) {
                    state.ready.insert(*child, self.memory_bytes(*child));
                }
            }
        }
    }

    fn skip_children(&self, state: &mut State, position: usize, cause: &ItemRef) {
        for &child in self.children.get(&position).into_iter().flatten() {
            if state.failed.contains_key(&child) {
                continue;
            }
            let node = self.graph.node(child);
            let failure = Failure {
                item: node.item.clone(),
                message: format!("skipped, because {cause} failed"),
                unusable_input: false,
                skipped_for: Some(cause.clone()),
                parameters: None,
            };
            state.failed.insert(child, failure);
            self.progress.ended(&node.item, &End::Skipped(cause.clone()), node.job.estimate().seconds);
            self.skip_children(state, child, cause);
        }
    }
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "panic".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first in graph order that fits among those looked at; beyond them, the smallest one.
    #[test]
    fn val_the_next_item_fits() {
        let mut ready = Ready::default();
        let memory = |position: usize| if position < 100 { 1000 } else { 200 - position as u64 };
        (0..150).for_each(|position| ready.insert(position, memory(position)));
        let next = |ready: &Ready, free: u64| ready.first_that_fits(|position| memory(position) <= free);
        assert_eq!((next(&ready, 1000), next(&ready, 999), next(&ready, 51)), (Some(0), Some(149), Some(149)));
        assert_eq!(next(&ready, 50), None);
        (0..40).for_each(|position| ready.remove(position, memory(position)));
        // Position 100 is now among the first 64.
        assert_eq!((next(&ready, 1000), next(&ready, 999), next(&ready, 99)), (Some(40), Some(100), Some(101)));
        (40..150).for_each(|position| ready.remove(position, memory(position)));
        assert!(next(&ready, 1000).is_none() && ready.by_memory.is_empty());
    }
}
