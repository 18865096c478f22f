//! Removes from a shared cache entries unused for too long, the least recently used entries while the rest is too large, and old drafts.

use super::{Entry, Shared};
use crate::error::Error;
use serde::Serialize;
use std::time::{Duration, SystemTime};

/// Age from which a draft is taken for what a killed run left. A draft that is written to is never that old.
pub const DRAFT_AGE_MAX: Duration = Duration::from_secs(24 * 3600);

/// What a cache keeps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Keep {
    /// Maximum size of all entries, bytes.
    pub bytes: Option<u64>,
    /// Maximum time since the last use.
    pub age: Option<Duration>,
}

/// A cache after eviction.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Pruned {
    /// Entries left.
    pub entries: usize,
    /// Their size, bytes.
    pub bytes: u64,
    /// Time since the last use of the least recently used one, days.
    pub unused_days: Option<f64>,
    /// Drafts left, of running and killed runs.
    pub drafts: usize,
    /// Entries and drafts removed.
    pub removed: usize,
    /// Their size, bytes.
    pub removed_bytes: u64,
}

/// Removes what is not to be kept; without limits, only counts. Running readers compute again what disappears under their hands.
///
/// # Errors
/// The place cannot be listed or written to.
pub fn prune(place: &dyn Shared, keep: Keep, now: SystemTime) -> Result<Pruned, Error> {
    let (evicted, left) = divide(place.list()?, keep, now);
    if !evicted.is_empty() && place.is_read_only() {
        return Err(Error::Usage("the cache cannot be written to, so nothing can be removed from it".to_owned()));
    }
    evicted.iter().try_for_each(|entry| place.remove(&entry.name))?;
    let size = |entries: &[Entry]| -> u64 { entries.iter().map(|entry| entry.bytes).sum() };
    let (complete, drafts): (Vec<Entry>, Vec<Entry>) = left.into_iter().partition(|entry| entry.is_complete);
    let oldest = complete.iter().map(|entry| age(entry, now)).max();
    Ok(Pruned {
        entries: complete.len(),
        bytes: size(&complete),
        unused_days: oldest.map(|age| age.as_secs_f64() / 86_400.0),
        drafts: drafts.len(),
        removed: evicted.len(),
        removed_bytes: size(&evicted),
    })
}

/// Time since the last use; zero if clocks disagree.
fn age(entry: &Entry, now: SystemTime) -> Duration {
    now.duration_since(entry.used).unwrap_or_default()
}

/// The entries to remove and those to keep, each sorted from the least recently used.
fn divide(mut entries: Vec<Entry>, keep: Keep, now: SystemTime) -> (Vec<Entry>, Vec<Entry>) {
    if keep == Keep::default() {
        return (Vec::new(), entries);
    }
    entries.sort_by(|a, b| (a.used, &a.name).cmp(&(b.used, &b.name)));
    let mut bytes: u64 = entries.iter().filter(|entry| entry.is_complete).map(|entry| entry.bytes).sum();
    entries.into_iter().partition(|entry| {
        if !entry.is_complete {
            return age(entry, now) > DRAFT_AGE_MAX;
        }
        let is_old = keep.age.is_some_and(|max| age(entry, now) > max);
        let is_evicted = is_old || keep.bytes.is_some_and(|max| bytes > max);
        if is_evicted {
            bytes -= entry.bytes;
        }
        is_evicted
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn hours(count: u64) -> Duration {
        Duration::from_secs(3600 * count)
    }

    fn entries() -> impl Strategy<Value = Vec<Entry>> {
        let entry = (0u64..1000, 0u64..100, prop::bool::weighted(0.8));
        prop::collection::vec(entry, 0..40).prop_map(|all| {
            let entry = |(number, (bytes, at, is_complete)): (usize, (u64, u64, bool))| Entry {
                name: format!("{number:02}"),
                bytes,
                used: SystemTime::UNIX_EPOCH + hours(at),
                is_complete,
            };
            all.into_iter().enumerate().map(entry).collect()
        })
    }

    proptest! {
        /// Entries stay within the limits, those used last are kept, and no more go than must.
        #[test]
        fn prop_eviction_removes_the_longest_unused_and_no_more(
            all in entries(),
            max_bytes in prop::option::of(0u64..20_000),
            max_hours in prop::option::of(0u64..110),
        ) {
            let now = SystemTime::UNIX_EPOCH + hours(100);
            let keep = Keep { bytes: max_bytes, age: max_hours.map(hours) };
            let (evicted, left) = divide(all.clone(), keep, now);
            prop_assert_eq!(evicted.len() + left.len(), all.len());
            let complete = |entries: &[Entry]| -> Vec<Entry> {
                entries.iter().filter(|entry| entry.is_complete).cloned().collect()
            };
            let (gone, kept) = (complete(&evicted), complete(&left));
            let size = |entries: &[Entry]| -> u64 { entries.iter().map(|entry| entry.bytes).sum() };
            prop_assert!(keep.bytes.is_none_or(|max| size(&kept) <= max));
            prop_assert!(keep.age.is_none_or(|max| kept.iter().all(|entry| age(entry, now) <= max)));
            let newest_gone = gone.iter().map(|entry| entry.used).max();
            prop_assert!(newest_gone.is_none_or(|at| kept.iter().all(|entry| entry.used >= at)));
            // The last one to go was too old, or too much for what is kept.
            if let Some(last) = gone.last() {
                let is_old = keep.age.is_some_and(|max| age(last, now) > max);
                prop_assert!(is_old || keep.bytes.is_some_and(|max| size(&kept) + last.bytes > max));
            }
            // Drafts go by age alone, and only if there is a limit at all.
            let is_limited = keep != Keep::default();
            for draft in all.iter().filter(|entry| !entry.is_complete) {
                prop_assert_eq!(evicted.contains(draft), is_limited && age(draft, now) > hours(24));
            }
        }
    }
}
