//! The command line as a process of it would be.

use std::ffi::OsString;

use pyo3::prelude::*;
use tautline::cli;

use crate::work::here;

/// Runs the program with these arguments, the first of which is its own name, as a process of it would, and gives its exit
/// code.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<u8> {
    here(py, || cli::entry(&arguments))
}
