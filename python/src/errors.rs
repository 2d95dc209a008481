//! Errors of the library as exceptions.

use pyo3::create_exception;
use pyo3::exceptions::{PyOSError, PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use tautline::preflight::Preflight;
use tautline::request::Failure;
use tautline::scenario::ScenarioError;
use tautline::sim::SimError;

create_exception!(
    tautline,
    Error,
    PyValueError,
    "The input is wrong: the message names the place, the value and the remedy, as the command line does."
);

/// The input is wrong.
pub(crate) fn wrong(message: impl Into<String>) -> PyErr {
    Error::new_err(message.into())
}

/// Something is not of the type that it must be.
pub(crate) fn wrong_type(message: impl Into<String>) -> PyErr {
    PyTypeError::new_err(message.into())
}

/// The library broke a promise.
pub(crate) fn broken(what: &str) -> PyErr {
    PyRuntimeError::new_err(format!("tautline failed inside, please report it: {what}"))
}

/// The library's errors, which another crate's exceptions cannot be made of by `From`.
pub(crate) trait Raised {
    /// The exception that says the same.
    fn raised(self) -> PyErr;
}

impl Raised for Failure {
    fn raised(self) -> PyErr {
        let text = self.to_string();
        coded(if self.is_machine() { PyOSError::new_err(text) } else { wrong(text) }, self.code())
    }
}

/// The input is wrong, with a code.
pub(crate) fn wrong_by(code: &str, message: impl Into<String>) -> PyErr {
    coded(wrong(message), code)
}

/// The exception with the stable name of the problem as its attribute `code`.
fn coded(error: PyErr, code: &str) -> PyErr {
    // Without the attribute the exception says the same in words.
    Python::attach(|py| error.value(py).setattr("code", code).ok());
    error
}

impl Raised for ScenarioError {
    fn raised(self) -> PyErr {
        coded(wrong(self.to_string()), self.code())
    }
}

impl Raised for SimError {
    fn raised(self) -> PyErr {
        Failure::from(self).raised()
    }
}

/// What is known before the first step, as JSON.
pub(crate) fn json(answer: &Preflight) -> PyResult<String> {
    serde_json::to_string(answer).map_err(|error| broken(&error.to_string()))
}
