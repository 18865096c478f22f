//! Progress reports of a run. The runner itself prints nothing.

use crate::job::ItemRef;

/// Listener of a run; called from several threads.
pub trait Progress: Sync {
    /// `total` items are needed and `ready` of them exist already; `seconds` is the estimated time of the rest on one core, s.
    fn begin(&self, total: usize, ready: usize, seconds: f64) {
        let _ = (total, ready, seconds);
    }
    /// An item starts; `seconds` is its share of the estimated time, s.
    fn started(&self, item: &ItemRef, seconds: f64) {
        let _ = (item, seconds);
    }
    /// An item ended, or is skipped without having started; `seconds` is its share of the estimated time, s.
    fn ended(&self, item: &ItemRef, end: &End, seconds: f64) {
        let _ = (item, end, seconds);
    }
    /// `done` of `total` bytes of one long operation are copied; called with 0 when it begins.
    fn copied(&self, done: u64, total: u64) {
        let _ = (done, total);
    }
    /// A phase after the items has begun: assembling, report, checksums.
    fn phase(&self, text: &str) {
        let _ = text;
    }
    /// A step of a phase, of interest only while it runs.
    fn step(&self, text: &str) {
        let _ = text;
    }
    /// Asked before each item. Once true, no item starts any more, and the run ends with [`crate::Error::Retry`]; results so far are kept.
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// How an item ended.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// Done, with its notes.
    Done(Vec<String>),
    /// Failed, with the reason.
    Failed(String),
    /// Skipped, because this parent has no result.
    Skipped(ItemRef),
}

/// Reports nothing.
pub struct Silent;

impl Progress for Silent {}
