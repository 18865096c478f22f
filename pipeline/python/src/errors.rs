//! Errors of the program as the one exception of the package.

use pyo3::PyErr;
use pyo3::import_exception;
use sastrugi_cli::Code;
use sastrugi_stages::Error;

import_exception!(sastrugi._errors, SastrugiError);

/// The exception with the program's sentence and exit code. Options of the program are arguments here.
pub fn refused(error: Error) -> PyErr {
    let code = Code::of(&error) as u8;
    SastrugiError::new_err((error.to_string().replace("`--", "`"), code))
}

/// Bad usage.
pub fn usage(message: impl std::fmt::Display) -> PyErr {
    refused(Error::Usage(message.to_string()))
}
