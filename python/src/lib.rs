//! The native half of the Python package: arrays in and out, calls without the interpreter's lock, laws that are asked in
//! Python. What a user sees is in `tautline/*.py`.
//!
//! Nothing here judges, flies or reads: `tautline` does, and this crate translates.

#![allow(rustdoc::broken_intra_doc_links, reason = "a comment is a docstring of Python, where [m] is a unit")]
#![expect(clippy::needless_pass_by_value, reason = "Python gives what it hands over")]

mod arrays;
mod audit;
mod errors;
mod flight;
mod law;
mod numbers;
mod observation;
mod program;
mod read;
mod request;
mod scenario;
mod simulation;
mod studies;
mod work;

use pyo3::prelude::*;

/// What `tautline/*.py` is built on.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::audit::{Seen, audit_arrays, audit_files, audit_in_rust};
    #[pymodule_export]
    use super::errors::Error;
    #[pymodule_export]
    use super::flight::{Flown, fly};
    #[pymodule_export]
    use super::observation::Observation;
    #[pymodule_export]
    use super::program::main;
    #[pymodule_export]
    use super::read::{Columns, read};
    #[pymodule_export]
    use super::request::{Question, ReadOptions};
    #[pymodule_export]
    use super::scenario::Scenario;
    #[pymodule_export]
    use super::simulation::Simulation;
    #[pymodule_export]
    use super::studies::{attack, campaign, compare, export, margin, scenarios, sweep, validate};

    /// A campaign knows by this file what flew it, and not by the interpreter's.
    #[pymodule_init]
    fn init(module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        use pyo3::types::PyAnyMethods as _;
        crate::work::at_home();
        // Errors of Python's own checks have no code.
        module.getattr("Error")?.setattr("code", module.py().None())?;
        let origin: std::path::PathBuf = module.getattr("__spec__")?.getattr("origin")?.extract()?;
        tautline::campaign::Program::is_in(origin);
        Ok(())
    }
}
