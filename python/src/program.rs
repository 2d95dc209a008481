//! The command line.

use std::ffi::OsString;

use pyo3::prelude::*;
use tautline::cli;

use crate::work::here;

/// Runs the program and returns its exit code. The first argument is the program's name.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<u8> {
    here(py, || cli::entry(&arguments))
}
