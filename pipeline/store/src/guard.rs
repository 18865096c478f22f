//! Third-party decoders that panic on some damaged files.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// Whether this thread runs a decoder whose panic is expected.
    static DECODING: Cell<bool> = const { Cell::new(false) };
}

/// Runs a decoder; `None` if it panics. The panic prints nothing: its caller reports the damaged file.
pub fn unless_panicking<T>(decode: impl FnOnce() -> T) -> Option<T> {
    silence_decoders();
    let before = DECODING.replace(true);
    let decoded = panic::catch_unwind(AssertUnwindSafe(decode));
    DECODING.set(before);
    decoded.ok()
}

/// Panics are reported as before, except those of a decoder.
fn silence_decoders() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !DECODING.get() {
                report(info);
            }
        }));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A panic yields `None` and clears the flag.
    #[test]
    fn val_a_panic_yields_none() {
        assert_eq!(unless_panicking(|| 7), Some(7));
        assert_eq!(unless_panicking(|| unless_panicking(|| Vec::<u8>::new()[3])), Some(None));
        assert!(!DECODING.get());
    }
}
