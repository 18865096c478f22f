//! Errors of the machine: no space, no memory, no permission, a failing device. They do not depend on the study, so they stop a
//! run and never count as failed items.

use std::error::Error;
use std::io::{self, ErrorKind};
use std::iter::successors;

/// Linux numbers of errors that the standard library does not name.
mod os {
    /// Input or output failed.
    pub const EIO: i32 = 5;
    /// The system limit on open files is reached.
    pub const ENFILE: i32 = 23;
    /// The process limit on open files is reached.
    pub const EMFILE: i32 = 24;
}

/// Whether the same call may succeed later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It may: out of space, quota, memory or open files; a network file system that does not answer.
    Passing,
    /// Not until the cause is fixed: read-only file system, no permission, file-size limit exceeded, failing device.
    Lasting,
}

/// The fault of the machine behind an error; `None` if the cause lies elsewhere.
pub fn fault(error: &(dyn Error + 'static)) -> Option<Fault> {
    successors(Some(error), |&e| e.source()).find_map(|e| of_io(e.downcast_ref()?))
}

fn of_io(error: &io::Error) -> Option<Fault> {
    match (error.kind(), error.raw_os_error()) {
        (ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::OutOfMemory, _) => Some(Fault::Passing),
        (ErrorKind::TimedOut | ErrorKind::StaleNetworkFileHandle, _) => Some(Fault::Passing),
        (_, Some(os::EMFILE | os::ENFILE)) => Some(Fault::Passing),
        (ErrorKind::FileTooLarge | ErrorKind::ReadOnlyFilesystem | ErrorKind::PermissionDenied, _) => {
            Some(Fault::Lasting)
        }
        (_, Some(os::EIO)) => Some(Fault::Lasting),
        // An error that wraps another reports only its own kind.
        _ => error.get_ref().and_then(|inner| fault(inner)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("outer")]
    struct Outer {
        source: io::Error,
    }

    #[test]
    fn val_faults_are_distinguished_from_other_errors() {
        let passing = [28, 122, 12, 24, 23, 110, 116];
        let lasting = [27, 5, 30, 13, 1];
        let cases = passing.map(|n| (n, Fault::Passing)).into_iter().chain(lasting.map(|n| (n, Fault::Lasting)));
        for (number, expected) in cases {
            let error = io::Error::from_raw_os_error(number);
            assert_eq!(fault(&error), Some(expected), "{error}");
            let wrapped = io::Error::other(Outer { source: error });
            assert_eq!(fault(&wrapped), Some(expected), "{wrapped:?}");
        }
        for other in [io::Error::from(ErrorKind::NotFound), io::Error::other("words"), ErrorKind::InvalidData.into()] {
            assert_eq!(fault(&other), None, "{other}");
        }
    }
}
