//! Signal handlers: orderly termination on request, and exit codes for conditions that the system reports by signal.

use crate::failure::Code;
use crate::output::warn;
use crate::verbs::serve::{self, Interrupt};
use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;
use signal_hook::iterator::Signals;
use std::io;
use std::panic;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Installs the handlers.
///
/// # Errors
/// If a handler cannot be registered or the thread cannot be started.
pub fn listen() -> io::Result<()> {
    // A write beyond `ulimit -f` then fails with an error that names the file, instead of killing the process.
    flag::register(SIGXFSZ, Arc::default())?;
    // When an allocation fails, the standard library prints a message and aborts. The call may succeed with more memory.
    flag::register_conditional_shutdown(SIGABRT, i32::from(Code::Retry as u8), Arc::new(AtomicBool::new(true)))?;
    abort_where_zlib_lacks_memory();
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || signals.forever().for_each(|_| interrupted()))?;
    Ok(())
}

/// zlib-rs panics where it cannot allocate; that then ends as other failed allocations do.
fn abort_where_zlib_lacks_memory() {
    let report = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        let place = info.location().map_or("", |place| place.file());
        let message = info.payload().downcast_ref::<String>().map_or("", String::as_str);
        if place.contains("zlib-rs") && message.contains("MemError") {
            warn(
                "sastrugi: not enough memory to compress the output; no output file is left incomplete; free some memory and rerun",
            );
            std::process::abort();
        }
        report(info);
    }));
}

/// Files appear only when they are complete, so the process may exit at any time. What it leaves under temporary names, the next run removes.
fn interrupted() {
    match serve::interrupted() {
        Some(Interrupt::First) => return,
        Some(Interrupt::Again) => warn("\nsastrugi: stopped immediately; open requests were cut off"),
        None => warn("\nsastrugi: interrupted; no output file is left incomplete; rerun to resume"),
    }
    std::process::exit(i32::from(Code::Retry as u8));
}
