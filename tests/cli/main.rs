//! The command line: every verb on files, and every kind of bad input with its message and exit code.

#![allow(clippy::unwrap_used, reason = "a test may end where it stands")]

mod bad_input;
mod compare;
mod coregister;
mod fit_outputs;
mod lerobot;
mod metadata;
mod minus;
mod navigate;
mod pack;
mod snapshots;
mod sources;
mod study;
mod verbs;
