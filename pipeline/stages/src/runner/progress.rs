//! What a run tells while it goes on. The runner prints nothing itself.

use crate::job::ItemRef;

/// Listener of a run; called from several threads.
pub trait Progress: Sync {
    /// `total` items are needed, `ready` of them are there already; `seconds` is the estimated work of the rest on one core.
    fn begin(&self, total: usize, ready: usize, seconds: f64) {
        let _ = (total, ready, seconds);
    }
    /// An item ended; `seconds` is its share of the estimate.
    fn ended(&self, item: &ItemRef, end: &End, seconds: f64) {
        let _ = (item, end, seconds);
    }
    /// So many bytes of one long work are done; called with 0 when it begins.
    fn copied(&self, done: u64, total: u64) {
        let _ = (done, total);
    }
    /// A phase after the items began: assembling, report, checksums.
    fn phase(&self, text: &str) {
        let _ = text;
    }
    /// A part of a phase, of interest while it goes on.
    fn step(&self, text: &str) {
        let _ = text;
    }
}

/// How an item ended.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// Done, with sentences that a reader must know.
    Done(Vec<String>),
    /// No result, and why.
    Failed(String),
    /// Not tried, because this parent has no result.
    Skipped(ItemRef),
}

/// Tells nothing.
pub struct Silent;

impl Progress for Silent {}
