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
pub(crate) fn wrong_input(message: impl Into<String>) -> PyErr {
    let message: String = message.into();
    // A failure shortens long numbers.
    Error::new_err(Failure::new("", false, message).message().to_owned())
}

/// Returns an exception for an argument of a wrong type.
pub(crate) fn wrong_type(message: impl Into<String>) -> PyErr {
    PyTypeError::new_err(message.into())
}

/// Returns an exception for an internal error.
pub(crate) fn internal_error(what: &str) -> PyErr {
    PyRuntimeError::new_err(format!("internal error of tautline: {what}; please report it"))
}

/// Conversion into an exception: orphan rules forbid `From` for types of two other crates.
pub(crate) trait IntoException {
    /// Returns the exception with the message of the error.
    fn into_exception(self) -> PyErr;
}

impl IntoException for Failure {
    fn into_exception(self) -> PyErr {
        let text = self.to_string();
        let is_of_system = self.is_machine() || self.code() == "files/no-folder";
        with_code(if is_of_system { PyOSError::new_err(text) } else { wrong_input(text) }, self.code())
    }
}

/// Returns an exception for wrong input with a code.
pub(crate) fn wrong_input_with_code(code: &str, message: impl Into<String>) -> PyErr {
    with_code(wrong_input(message), code)
}

/// Sets the attribute `code` of an exception to the stable code of the problem.
fn with_code(error: PyErr, code: &str) -> PyErr {
    // A failure to set it is ignored: the message is complete without it.
    Python::attach(|py| error.value(py).setattr("code", code).ok());
    error
}

impl IntoException for ScenarioError {
    fn into_exception(self) -> PyErr {
        with_code(wrong_input(self.to_string()), self.code())
    }
}

impl IntoException for SimError {
    fn into_exception(self) -> PyErr {
        Failure::from(self).into_exception()
    }
}

/// Returns a check as JSON.
pub(crate) fn json(answer: &Preflight) -> PyResult<String> {
    serde_json::to_string(answer).map_err(|error| internal_error(&error.to_string()))
}
