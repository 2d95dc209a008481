//! The command line.

use std::ffi::OsString;

use pyo3::prelude::*;
use tautline::request::Failure;
use tautline::{cli, option};

use crate::law::{catch_exception, load_law};
use crate::options::as_argument;
use crate::work::run_detached;

/// Exit code of a law in Python that raised an exception: wrong input.
const RAISED: u8 = 2;

/// Runs the program and returns its exit code. The first argument is the program's name. Laws `MODULE:CLASS` of
/// campaigns are imported.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<u8> {
    let load = |name: &str| {
        let loaded = || {
            Python::attach(|py| load_law(py, name)).map_err(|error| {
                let remedy = "give MODULE:CLASS; the module is in the working folder, in PYTHONPATH or installed";
                Failure::input("request/python-law", format!("law: {error}"), remedy)
            })
        };
        name.contains(':').then(loaded)
    };
    let (exit, raised) = run_detached(py, || {
        let ended = catch_exception(|| cli::entry_with(&arguments, &load));
        option::spell_with(as_argument);
        ended
    })?;
    Ok(raised.map_or(exit, |raised| {
        raised.display(py);
        RAISED
    }))
}
