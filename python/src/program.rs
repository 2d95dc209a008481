//! The command line.

use std::ffi::OsString;

use pyo3::prelude::*;
use tautline::{cli, option};

use crate::options::as_argument;
use crate::work::run_detached;

/// Runs the program and returns its exit code. The first argument is the program's name.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<u8> {
    run_detached(py, || {
        let exit = cli::entry(&arguments);
        option::spell_with(as_argument);
        exit
    })
}
