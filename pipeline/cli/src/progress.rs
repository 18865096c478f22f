//! Progress on stderr. For a run: a bar with ETA on a terminal, plain lines otherwise, only failures when quiet. For a verb without items: what
//! it does and the elapsed time, on a terminal only.

use crate::output::warn;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sastrugi_schemas::counted;
use sastrugi_stages::job::ItemRef;
use sastrugi_stages::runner::progress::{End, Progress};
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Steps of the bar per estimated second.
const TICKS_PER_SECOND: f64 = 1000.0;
/// Time after which the speed of a copy can be estimated, s.
const KNOWN_AFTER_S: f64 = 2.0;

/// Minimum time between two lines of progress without a bar, s.
const LINE_EVERY_S: f64 = 1.0;

/// Wall time for which the plan is taken to have been right before a run, s: the first items are short, and their times say little of the others.
const PLAN_TRUSTED_S: f64 = 2.0;

/// Reports the progress of a run.
pub struct Reporter {
    quiet: bool,
    bar: Option<ProgressBar>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    total: usize,
    ended: usize,
    seconds_total: f64,
    /// Estimated time of the items that ended, s.
    seconds_ended: f64,
    running: Vec<Running>,
    start: Option<Instant>,
    /// Start of the current copy, until its remaining time has been reported.
    copy_start: Option<Instant>,
    last_line: Option<Instant>,
}

/// An item that runs.
struct Running {
    item: ItemRef,
    start: Instant,
    /// Estimated time, s.
    seconds: f64,
}

impl State {
    /// Estimated time of what is done, s. Of an item that runs it is the time so far, because one long item would otherwise make all the others look slow.
    fn seconds_done(&self, now: Instant) -> f64 {
        let part = |r: &Running| now.saturating_duration_since(r.start).as_secs_f64().min(r.seconds);
        self.running.iter().fold(self.seconds_ended, |sum, running| sum + part(running))
    }

    /// The time left as text; nothing at the end.
    fn remaining(&self, now: Instant) -> String {
        let Some(start) = self.start.filter(|_| self.ended < self.total && self.seconds_total > 0.0) else {
            return String::new();
        };
        let elapsed_s = now.saturating_duration_since(start).as_secs_f64();
        let left_s = seconds_left(elapsed_s, self.seconds_done(now), self.seconds_total, rayon::current_num_threads());
        format!(", about {} left", crate::output::seconds(left_s))
    }

    /// True when the last line is old enough, and at the last item.
    fn is_time(&mut self) -> bool {
        let is_time =
            self.ended == self.total || self.last_line.is_none_or(|at| at.elapsed().as_secs_f64() >= LINE_EVERY_S);
        if is_time {
            self.last_line = Some(Instant::now());
        }
        is_time
    }
}

/// A line of this style that is redrawn repeatedly, unless quiet or stderr is not a terminal.
fn on_terminal(quiet: bool, style: &str) -> Option<ProgressBar> {
    (!quiet && std::io::stderr().is_terminal()).then(|| {
        let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::stderr());
        bar.set_style(ProgressStyle::with_template(style).unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar
    })
}

/// Does the work of a verb, which may take minutes; meanwhile a terminal shows `doing` and the time so far.
pub fn waiting<T>(doing: &str, quiet: bool, work: impl FnOnce() -> T) -> T {
    let spinner = on_terminal(quiet, "{spinner} {msg}, {elapsed}");
    if let Some(spinner) = &spinner {
        spinner.set_message(doing.to_owned());
        spinner.enable_steady_tick(Duration::from_millis(200));
    }
    let done = work();
    if let Some(spinner) = &spinner {
        spinner.finish_and_clear();
    }
    done
}

impl Reporter {
    /// A reporter; `quiet` suppresses everything but failures.
    pub fn new(quiet: bool) -> Self {
        let bar = on_terminal(quiet, "{bar:32} {percent:>3}%  {elapsed} elapsed, {eta} left  {msg}");
        Self { quiet, bar, state: Mutex::default() }
    }

    /// Prints a permanent line.
    pub fn say(&self, line: &str) {
        if self.quiet {
            return;
        }
        self.print(line);
    }

    fn print(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| warn(line)),
            None => warn(line),
        }
    }

    /// Removes the bar.
    pub fn close(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    fn advance(&self, item: &ItemRef, seconds: f64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.ended += 1;
        state.seconds_ended += seconds;
        state.running.retain(|running| running.item != *item);
        let now = Instant::now();
        let counts = format!("{}/{}", state.ended, counted(state.total, "item"));
        match &self.bar {
            Some(bar) => {
                bar.set_position((state.seconds_done(now) * TICKS_PER_SECOND) as u64);
                bar.set_message(format!("{counts}, {item}"));
            }
            None if state.is_time() => self.say(&format!("{counts}, {item}{}", state.remaining(now))),
            None => {}
        }
    }

    /// Reports once how long a copy will take, from its speed so far.
    fn report_copy(&self, done: u64, total: u64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if done == 0 {
            state.copy_start = Some(Instant::now());
        }
        let elapsed = state.copy_start.map_or(0.0, |start| start.elapsed().as_secs_f64());
        if let Some(line) = rest_of_copy(elapsed, done, total) {
            state.copy_start = None;
            self.say(&line);
        }
    }
}

/// Time left, s, when of `total_s` estimated seconds on one core `done_s` are done: at the pace so far, and at the beginning at that of the plan on
/// all threads.
fn seconds_left(elapsed_s: f64, done_s: f64, total_s: f64, threads: usize) -> f64 {
    let pace = (elapsed_s + PLAN_TRUSTED_S) / (done_s + PLAN_TRUSTED_S * threads as f64);
    (total_s - done_s).max(0.0) * pace
}

/// How much of a copy is done and how long the rest takes at the speed so far; `None` too early to know, and at the end.
fn rest_of_copy(elapsed_s: f64, done: u64, total: u64) -> Option<String> {
    if elapsed_s < KNOWN_AFTER_S || done == 0 || done >= total {
        return None;
    }
    let (part, whole) = (done as f64, total as f64);
    let left = crate::output::seconds(elapsed_s * (whole / part - 1.0));
    let [part, whole] = [part, whole].map(crate::output::bytes);
    Some(format!("{part} of {whole}, about {left} left"))
}

impl Progress for Reporter {
    fn begin(&self, total: usize, ready: usize, seconds: f64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let start = Some(Instant::now());
        *state = State { total: total - ready, seconds_total: seconds, start, ..State::default() };
        drop(state);
        if let Some(bar) = &self.bar {
            bar.set_length((seconds * TICKS_PER_SECOND) as u64);
        }
        self.say(&format!("{}, {ready} already computed", counted(total, "item")));
    }

    fn started(&self, item: &ItemRef, seconds: f64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.running.push(Running { item: item.clone(), start: Instant::now(), seconds });
    }

    fn ended(&self, item: &ItemRef, end: &End, seconds: f64) {
        // Notes, and the items that a failed one leaves without input, are printed at the end of the run.
        if let End::Failed(why) = end {
            self.print(&format!("sastrugi: {item} failed: {why}"));
        }
        self.advance(item, seconds);
    }

    fn copied(&self, done: u64, total: u64) {
        let Some(bar) = &self.bar else { return self.report_copy(done, total) };
        if done == 0 {
            bar.set_length(total);
            bar.reset_eta();
        }
        bar.set_position(done);
    }

    fn phase(&self, text: &str) {
        self.step(text);
        if self.bar.is_none() {
            self.say(text);
        }
    }

    fn step(&self, text: &str) {
        if let Some(bar) = &self.bar {
            bar.set_message(text.to_owned());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first line comes at once, the next after a second, and the last in any case.
    #[test]
    fn val_lines_are_sparse() {
        let mut state = State { total: 3, ended: 1, ..State::default() };
        assert!(state.is_time());
        state.ended = 2;
        assert!(!state.is_time());
        state.ended = 3;
        assert!(state.is_time());
    }

    /// At the end nothing is left.
    #[test]
    fn val_time_left_is_told_until_the_end() {
        let now = Instant::now();
        let state = |ended| State { total: 2, ended, seconds_total: 8.0, start: Some(now), ..State::default() };
        let told = state(1).remaining(now);
        assert!(told.starts_with(", about ") && told.ends_with(" left"), "{told}");
        assert_eq!(state(2).remaining(now), "");
        assert_eq!(State::default().remaining(now), "");
    }

    /// At first the plan decides, divided among the threads, and later the pace of the run.
    #[test]
    fn val_the_pace_of_the_run_replaces_that_of_the_plan() {
        assert_eq!(seconds_left(0.0, 0.0, 8.0, 1), 8.0);
        assert_eq!(seconds_left(0.0, 0.0, 8.0, 2), 4.0);
        // The first item, a short one, took five times its estimate: 40 s would be left at its pace.
        assert!((8.0..9.0).contains(&seconds_left(0.05, 0.01, 8.0, 1)));
        // Everything takes twice as long as planned.
        assert!((190.0..200.0).contains(&seconds_left(200.0, 100.0, 200.0, 1)));
        assert_eq!(seconds_left(9.0, 9.0, 8.0, 1), 0.0);
    }

    /// A long item counts while it runs, up to its estimate. Without it, six seconds for the others would look like a minute for the rest.
    #[test]
    fn val_an_item_counts_while_it_runs() {
        let start = Instant::now();
        let item = ItemRef::new("fit", "snow");
        let running = vec![Running { item, start, seconds: 3.0 }];
        let state = State { seconds_ended: 1.0, running, ..State::default() };
        let done = |after_s| state.seconds_done(start + Duration::from_secs(after_s));
        assert_eq!([0, 2, 3, 6].map(done), [1.0, 3.0, 4.0, 4.0]);
    }

    /// At 250 MB/s, after the two seconds from which on a speed can be told.
    #[test]
    fn val_the_rest_of_a_copy_takes_as_long_for_each_byte() {
        let told = |elapsed_s, done| rest_of_copy(elapsed_s, done, 3_000_000_000);
        assert_eq!(told(2.0, 500_000_000).as_deref(), Some("500.0 MB of 3.0 GB, about 10.0 s left"));
        assert_eq!(told(11.0, 2_750_000_000).as_deref(), Some("2.8 GB of 3.0 GB, about 1.0 s left"));
        assert_eq!([told(1.9, 475_000_000), told(2.0, 0), told(12.0, 3_000_000_000)], [None, None, None]);
    }
}
