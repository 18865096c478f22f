//! Turns errors of the program into the package's only exception.

use pyo3::PyErr;
use pyo3::import_exception;
use sastrugi_cli::Code;
use sastrugi_stages::Error;

import_exception!(sastrugi._errors, SastrugiError);

/// Options in the sentences of the program, and the arguments that take their place here.
const ARGUMENTS: [(&str, &str); 11] = [
    ("use --replace to", "use `replace=True` to"),
    ("with --statistics", "with `statistics=True`"),
    ("with --exemplar", "as `exemplar`"),
    ("with `--allow-coarse`", "with `allow_coarse=True`"),
    ("`--rate ", "`rate_hz "),
    ("with --work", "as `work`"),
    ("another --work", "another `work`"),
    ("with `-o DIR`", "as `output`"),
    ("-o must be", "`output` must be"),
    (" with -o", ""),
    ("`--", "`"),
];

/// The exception with the program's sentence and exit code. Options of the program are arguments here.
pub fn refused(error: Error) -> PyErr {
    let code = Code::of(&error) as u8;
    let sentence = ARGUMENTS.iter().fold(error.to_string(), |said, (option, argument)| said.replace(option, argument));
    SastrugiError::new_err((sentence, code))
}

/// Bad usage.
pub fn usage(message: impl std::fmt::Display) -> PyErr {
    refused(Error::Usage(message.to_string()))
}
