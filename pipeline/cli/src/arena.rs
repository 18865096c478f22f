//! A single allocation arena of the C library for all threads, where memory is limited.
//!
//! glibc gives each thread an arena, which keeps freed memory for the thread's next allocation, in pieces of up to 32 MiB. Threads that compute one
//! item after another therefore hold more memory than the items in progress need, but `--memory` counts only the latter. The number of arenas is read
//! from the environment when a program starts.

use std::env;
use std::ffi::OsStr;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Environment variable of glibc for the largest number of arenas.
const ARENAS: &str = "MALLOC_ARENA_MAX";
/// The running program.
const PROGRAM: &str = "/proc/self/exe";

/// Starts the program again with one arena if an argument limits its memory and the environment does not set the number of arenas. Otherwise, and where
/// the program cannot be started again, returns.
pub fn share() {
    let mut arguments = env::args_os();
    let Some(name) = arguments.next() else { return };
    let arguments: Vec<_> = arguments.collect();
    let is_limited = arguments.iter().any(|argument| limits_memory(argument));
    if is_limited && env::var_os(ARENAS).is_none() && can_start_again() {
        // Does not return, unless it fails.
        let _ = Command::new(PROGRAM).arg0(name).args(arguments).env(ARENAS, "1").exec();
    }
}

/// Whether the program can be started again: not without /proc, nor where the dynamic loader was given the program to start, since /proc then names
/// the loader. A failed start changes how signals are handled, so it is not simply tried.
fn can_start_again() -> bool {
    let program = std::fs::read_link(PROGRAM);
    program.is_ok_and(|path| path.file_name().is_some_and(|name| !name.as_encoded_bytes().starts_with(b"ld")))
}

fn limits_memory(argument: &OsStr) -> bool {
    let bytes = argument.as_encoded_bytes();
    bytes == b"--memory" || bytes.starts_with(b"--memory=")
}
