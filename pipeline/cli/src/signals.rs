//! Signals: ends that are asked for, and those that the system would make of an error.

use crate::failure::Code;
use crate::output::warn;
use crate::verbs::serve::{self, Interrupt};
use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;
use signal_hook::iterator::Signals;
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Answers signals from here on.
///
/// # Errors
/// The system takes no handler, or starts no thread.
pub fn listen() -> io::Result<()> {
    // Writes beyond `ulimit -f` are then errors that name their file.
    flag::register(SIGXFSZ, Arc::default())?;
    // Where memory is out, the standard library says so and aborts. With more of it the same call may work.
    flag::register_conditional_shutdown(SIGABRT, i32::from(Code::Retry as u8), Arc::new(AtomicBool::new(true)))?;
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || signals.forever().for_each(|_| interrupted()))?;
    Ok(())
}

/// Every file appears whole or not at all, so the process may end here and now.
fn interrupted() {
    match serve::interrupted() {
        Some(Interrupt::First) => return,
        Some(Interrupt::Again) => warn("\nsastrugi: stopped immediately; open requests were cut off"),
        None => warn(
            "\nsastrugi: interrupted; nothing half-written bears its name, and a run goes on from what it finished",
        ),
    }
    std::process::exit(i32::from(Code::Retry as u8));
}
