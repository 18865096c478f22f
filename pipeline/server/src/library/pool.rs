//! Threads that generate tiles, and the queues of tiles waiting for them.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Priority of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Priority {
    /// A client is waiting for the tile.
    Answer,
    /// The tile is generated in advance; no client is waiting.
    Background,
}

/// The queue is full.
#[derive(Debug)]
pub struct Full;

type Work = Box<dyn FnOnce() + Send>;

/// Work taken from the queue.
struct Taken {
    work: Work,
    priority: Priority,
}

struct Waiting {
    cancel: Arc<AtomicBool>,
    work: Work,
}

#[derive(Clone, Copy, Default)]
struct Running {
    answers: usize,
    ahead: usize,
}

impl Running {
    fn of(&mut self, priority: Priority) -> &mut usize {
        match priority {
            Priority::Answer => &mut self.answers,
            Priority::Background => &mut self.ahead,
        }
    }
}

#[derive(Default)]
struct Queue {
    answers: VecDeque<Waiting>,
    background: VecDeque<Waiting>,
    /// Numbers of threads working for a waiting client, and in advance.
    running: Running,
    closed: bool,
}

struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
    dropped: AtomicU64,
    workers: usize,
}

/// A fixed number of threads with bounded queues.
pub struct Pool {
    shared: Arc<Shared>,
    limit: usize,
}

impl Shared {
    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the next work; `None` when the pool is closed.
    fn next(&self) -> Option<Taken> {
        let mut queue = self.queue();
        loop {
            if queue.closed {
                return None;
            }
            match queue.take(self.workers) {
                Some((waiting, _)) if waiting.cancel.load(Ordering::Relaxed) => {
                    self.dropped.fetch_add(1, Ordering::Relaxed);
                }
                Some((Waiting { work, .. }, priority)) => {
                    *queue.running.of(priority) += 1;
                    return Some(Taken { work, priority });
                }
                None => queue = self.changed.wait(queue).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }

    /// Takes and runs work until the pool is closed.
    fn work(&self) {
        while let Some(Taken { work, priority }) = self.next() {
            work();
            *self.queue().running.of(priority) -= 1;
        }
    }
}

impl Queue {
    /// Takes the next work from the queues. Tiles generated in advance may take long, so they leave one thread in addition to `workers` free for
    /// waiting clients.
    fn take(&mut self, workers: usize) -> Option<(Waiting, Priority)> {
        let Running { answers, ahead } = self.running;
        let answer = (answers < workers).then(|| self.answers.pop_front()).flatten();
        if let Some(waiting) = answer {
            return Some((waiting, Priority::Answer));
        }
        let waiting = (answers + ahead < workers).then(|| self.background.pop_front()).flatten();
        waiting.map(|waiting| (waiting, Priority::Background))
    }
}

impl Pool {
    /// Starts `workers` threads named after `name`, and one more for a client that finds all of them busy in advance. Each of the two queues holds at
    /// most `limit` items.
    pub fn new(name: &str, workers: usize, limit: usize) -> Self {
        let workers = workers.max(1);
        let shared =
            Arc::new(Shared { queue: Mutex::default(), changed: Condvar::new(), dropped: AtomicU64::new(0), workers });
        for number in 0..=workers {
            let shared = Arc::clone(&shared);
            let started = std::thread::Builder::new().name(format!("{name}-{number}")).spawn(move || shared.work());
            if let Err(error) = started {
                tracing::warn!(%error, "a worker thread could not be started");
            }
        }
        Self { shared, limit }
    }

    /// Queues work; cancelled work is dropped without being run.
    ///
    /// # Errors
    /// The queue is full.
    pub fn push(&self, priority: Priority, cancel: Arc<AtomicBool>, work: Work) -> Result<(), Full> {
        let mut queue = self.shared.queue();
        let line = match priority {
            Priority::Answer => &mut queue.answers,
            Priority::Background => &mut queue.background,
        };
        if line.len() >= self.limit {
            let before = line.len();
            line.retain(|waiting| !waiting.cancel.load(Ordering::Relaxed));
            self.shared.dropped.fetch_add((before - line.len()) as u64, Ordering::Relaxed);
        }
        if line.len() >= self.limit {
            return Err(Full);
        }
        line.push_back(Waiting { cancel, work });
        self.shared.changed.notify_one();
        Ok(())
    }

    /// Moves queued background work, identified by its flag, to the queue of waiting clients.
    pub fn promote(&self, cancel: &Arc<AtomicBool>) {
        let mut queue = self.shared.queue();
        let place = queue.background.iter().position(|waiting| Arc::ptr_eq(&waiting.cancel, cancel));
        if let Some(waiting) = place.and_then(|place| queue.background.remove(place)) {
            queue.answers.push_back(waiting);
            self.shared.changed.notify_one();
        }
    }

    /// Number of queued items.
    pub fn queued(&self) -> usize {
        let queue = self.shared.queue();
        let wanted = |line: &VecDeque<Waiting>| line.iter().filter(|w| !w.cancel.load(Ordering::Relaxed)).count();
        wanted(&queue.answers) + wanted(&queue.background)
    }

    /// Number of busy threads.
    pub fn running(&self) -> u64 {
        let Running { answers, ahead } = self.shared.queue().running;
        (answers + ahead) as u64
    }

    /// Number of items dropped without being run.
    pub fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.shared.queue().closed = true;
        self.shared.changed.notify_all();
    }
}
