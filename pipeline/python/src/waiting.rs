//! Long calls: the work runs on a thread of its own, while the caller waits for it, reports its progress, and watches for Ctrl-C.
//!
//! Kernels cannot be stopped halfway. On Ctrl-C the caller gets its `KeyboardInterrupt` within about two seconds; a run starts no further items, and
//! what is in progress ends in the background. Its result is dropped; a file that it was to write may still appear, complete.

use crate::errors::{refused, usage};
use pyo3::prelude::*;
use sastrugi_schemas::counted;
use sastrugi_stages::Error;
use sastrugi_stages::job::ItemRef;
use sastrugi_stages::runner::progress::{End, Progress};
use std::process;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, OnceLock};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// Time between two looks at Python's signals.
const POLL: Duration = Duration::from_millis(50);
/// Time that an interrupted call waits for its work to end, so that the work area is free again.
const GRACE: Duration = Duration::from_secs(2);

/// Items done, items in total, and what happened.
type Step = (usize, usize, String);

/// The listener of the work: passes on its progress, and tells it when the caller has been interrupted. The work has ended when it is dropped.
pub struct Watched {
    steps: Sender<Step>,
    cancelled: Arc<AtomicBool>,
    done: AtomicUsize,
    total: AtomicUsize,
}

impl Watched {
    fn tell(&self, text: String) {
        let (done, total) = (self.done.load(Ordering::SeqCst), self.total.load(Ordering::SeqCst));
        // The caller may be gone.
        let _ = self.steps.send((done, total, text));
    }
}

impl Progress for Watched {
    fn begin(&self, total: usize, ready: usize, _seconds: f64) {
        self.done.store(ready, Ordering::SeqCst);
        self.total.store(total, Ordering::SeqCst);
        self.tell(format!("{}, {ready} already computed", counted(total, "item")));
    }

    fn ended(&self, item: &ItemRef, end: &End, _seconds: f64) {
        self.done.fetch_add(1, Ordering::SeqCst);
        self.tell(match end {
            End::Done(_) => item.to_string(),
            End::Failed(why) => format!("{item} failed: {why}"),
            End::Skipped(parent) => format!("{item} skipped because {parent} failed"),
        });
    }

    fn phase(&self, text: &str) {
        self.tell(text.to_owned());
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::SeqCst)
    }
}

/// The process that has begun to compute: the threads that work is divided among belong to it.
static COMPUTING: OnceLock<u32> = OnceLock::new();

/// Refuses work in a process that was forked from one that had begun to compute: it would wait for threads that a fork does not copy.
fn check_process() -> PyResult<()> {
    let own = process::id();
    if *COMPUTING.get_or_init(|| own) == own {
        return Ok(());
    }
    Err(usage(
        "this process was forked from one that had used sastrugi, and a fork does not copy the threads that compute; use the start method `spawn`",
    ))
}

/// Does work that does not tell how far it is.
pub fn waited<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    watched(py, None, move |_| work())
}

/// Does work that reports to a listener; `progress(done, total, what)` is called on the caller's thread.
pub fn watched<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watched) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    check_process()?;
    let (steps, told) = channel();
    let cancelled = Arc::new(AtomicBool::new(false));
    let listener =
        Watched { steps, cancelled: Arc::clone(&cancelled), done: AtomicUsize::new(0), total: AtomicUsize::new(0) };
    let worker = Builder::new().name("sastrugi".to_owned()).spawn(move || work(&listener))?;
    match listen(py, progress, told) {
        Ok(()) => joined(py, worker),
        Err((interrupt, told)) => {
            cancelled.store(true, Ordering::SeqCst);
            py.detach(move || await_end(&told));
            Err(interrupt)
        }
    }
}

/// Passes steps on until the work ends, or until the callback raises or a signal arrives.
fn listen(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    mut told: Receiver<Step>,
) -> Result<(), (PyErr, Receiver<Step>)> {
    loop {
        let (back, step) = py.detach(move || {
            let step = told.recv_timeout(POLL);
            (told, step)
        });
        told = back;
        let heard = match (step, progress) {
            (Err(RecvTimeoutError::Disconnected), _) => return Ok(()),
            (Ok(step), Some(progress)) => progress.call1(step).map(drop),
            (Ok(_), None) | (Err(RecvTimeoutError::Timeout), _) => Ok(()),
        };
        if let Err(interrupt) = heard.and_then(|()| py.check_signals()) {
            return Err((interrupt, told));
        }
    }
}

/// The result of work that has ended.
fn joined<T: Send>(py: Python<'_>, worker: JoinHandle<Result<T, Error>>) -> PyResult<T> {
    match py.detach(move || worker.join()) {
        Ok(result) => result.map_err(refused),
        Err(_) => Err(refused(Error::failed("internal error: the computation ended without a result"))),
    }
}

/// Waits a moment for the end of cancelled work.
fn await_end(told: &Receiver<Step>) {
    let start = Instant::now();
    while let Some(left) = GRACE.checked_sub(start.elapsed()) {
        if told.recv_timeout(left).is_err() {
            return;
        }
    }
}
