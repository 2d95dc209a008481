//! The command line, for a process and for a call.

use std::ffi::OsString;
use std::sync::Arc;

use pyo3::prelude::*;
use tautline::cli;

use crate::errors::Raised;
use crate::work::{away_with_threads, here};

/// Runs the program with these arguments, the first of which is its own name, as a process of it would, and gives its exit
/// code.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<u8> {
    here(py, || cli::entry(&arguments))
}

/// Runs a command without printing: whether its exit code is 0, and what it wrote for programs. A scenario `-` is the text.
#[pyfunction]
#[pyo3(signature = (words, text=None))]
pub(crate) fn call(py: Python<'_>, words: Vec<String>, text: Option<String>) -> PyResult<(bool, String)> {
    let interrupted = Arc::default();
    let answer = away_with_threads(py, &interrupted, || cli::call(&words, text.as_deref(), &interrupted))?;
    let answer = answer.map_err(Raised::raised)?;
    Ok((answer.is_good, answer.data))
}
