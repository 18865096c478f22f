//! Progress on stderr. Of a run: a bar with ETA on a terminal, plain lines otherwise, only failures when quiet. Of a verb without items: what it
//! does and the time so far, on a terminal only.

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

/// Reports the progress of a run.
pub struct Reporter {
    quiet: bool,
    bar: Option<ProgressBar>,
    state: Mutex<State>,
    start: Instant,
}

#[derive(Default)]
struct State {
    total: usize,
    ended: usize,
    seconds_total: f64,
    seconds_done: f64,
    /// Start of the current copy, until its remaining time has been reported.
    copy_start: Option<Instant>,
    last_line: Option<Instant>,
}

impl State {
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
        Self { quiet, bar, state: Mutex::default(), start: Instant::now() }
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
        state.seconds_done += seconds;
        let counts = format!("{}/{}", state.ended, counted(state.total, "item"));
        match &self.bar {
            Some(bar) => {
                bar.set_position((state.seconds_done * TICKS_PER_SECOND) as u64);
                bar.set_message(format!("{counts}, {item}"));
            }
            None if state.is_time() => self.say(&format!("{counts}, {item}{}", self.remaining(&state))),
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

    /// Time left, from the share of the estimated work that is done.
    fn remaining(&self, state: &State) -> String {
        if state.seconds_done <= 0.0 || state.ended >= state.total {
            return String::new();
        }
        let share = state.seconds_done / state.seconds_total.max(state.seconds_done);
        let left = self.start.elapsed().as_secs_f64() * (1.0 / share - 1.0);
        format!(", about {} left", crate::output::seconds(left))
    }
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
        *state = State { total: total - ready, seconds_total: seconds, ..State::default() };
        drop(state);
        if let Some(bar) = &self.bar {
            bar.set_length((seconds * TICKS_PER_SECOND) as u64);
        }
        self.say(&format!("{}, {ready} already computed", counted(total, "item")));
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

    /// Without finished work nothing is known of the rest, and at the end there is none.
    #[test]
    fn val_time_left_is_told_when_known() {
        let reporter = Reporter::new(true);
        let state =
            |ended, seconds_done| State { total: 2, ended, seconds_total: 8.0, seconds_done, ..State::default() };
        assert_eq!(reporter.remaining(&state(1, 0.0)), "");
        assert_eq!(reporter.remaining(&state(2, 8.0)), "");
        let told = reporter.remaining(&state(1, 4.0));
        assert!(told.starts_with(", about ") && told.ends_with(" left"), "{told}");
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
