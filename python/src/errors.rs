//! Converts errors of the library into exceptions.

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
    "Wrong input. The message has the place, the problem, the value and the remedy."
);

/// Returns an exception for wrong input.
pub(crate) fn wrong(message: impl Into<String>) -> PyErr {
    Error::new_err(message.into())
}

/// Returns an exception for an argument of a wrong type.
pub(crate) fn wrong_type(message: impl Into<String>) -> PyErr {
    PyTypeError::new_err(message.into())
}

/// Returns an exception for an internal error.
pub(crate) fn broken(what: &str) -> PyErr {
    PyRuntimeError::new_err(format!("internal error of tautline: {what}; please report it"))
}

/// Conversion into an exception: orphan rules forbid `From` for types of two other crates.
pub(crate) trait Raised {
    /// Returns the exception with the message of the error.
    fn raised(self) -> PyErr;
}

impl Raised for Failure {
    fn raised(self) -> PyErr {
        let text = self.to_string();
        coded(if self.is_machine() { PyOSError::new_err(text) } else { wrong(text) }, self.code())
    }
}

/// Returns an exception for wrong input with a code.
pub(crate) fn wrong_by(code: &str, message: impl Into<String>) -> PyErr {
    coded(wrong(message), code)
}

/// Sets the attribute `code` of an exception to the stable code of the problem.
fn coded(error: PyErr, code: &str) -> PyErr {
    // A failure to set it is ignored: the message is complete without it.
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

/// Returns a check as JSON.
pub(crate) fn json(answer: &Preflight) -> PyResult<String> {
    serde_json::to_string(answer).map_err(|error| broken(&error.to_string()))
}
