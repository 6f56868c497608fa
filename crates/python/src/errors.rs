//! Errors and panics as Python exceptions, and computing without the interpreter's lock.

use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;
use std::error::Error;
use std::fmt::Display;
use std::io::{self, ErrorKind};
use std::panic::{AssertUnwindSafe, catch_unwind};

create_exception!(
    trepan,
    TrepanError,
    PyException,
    "A file's content or a computation is at fault; the text says what, where and the remedy."
);

/// A wrong argument.
pub fn value(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A wrong file content.
pub fn content(error: impl Display) -> PyErr {
    TrepanError::new_err(error.to_string())
}

/// The exception for a file: an `OSError` where the system refused it, else a `TrepanError`.
pub fn of_file(error: impl Error) -> PyErr {
    let system = error.source().and_then(|source| source.downcast_ref::<io::Error>());
    let of_content = [ErrorKind::InvalidData, ErrorKind::UnexpectedEof, ErrorKind::InvalidInput, ErrorKind::Other];
    match system.map(io::Error::kind) {
        Some(kind) if !of_content.contains(&kind) => io::Error::new(kind, error.to_string()).into(),
        _ => content(error),
    }
}

/// Computes while other Python threads run; a panic becomes a `TrepanError`.
pub fn compute<T: Send>(py: Python<'_>, f: impl FnOnce() -> T + Send) -> PyResult<T> {
    py.detach(|| catch_unwind(AssertUnwindSafe(f))).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no text");
        content(format!("Trepan failed inside ({text}); this is a fault of Trepan: report it with the arguments"))
    })
}

/// Panics, so that a test can see what becomes of it.
#[pyfunction]
pub fn _panic(py: Python<'_>) -> PyResult<()> {
    compute(py, || panic!("a test asked for it"))
}
