//! The native module of the Python package: converts arrays, releases the interpreter's lock, and calls laws in Python.
//!
//! `tautline/*.py` is the public interface. The crate `tautline` audits, flies and reads; this crate only translates.

#![allow(rustdoc::broken_intra_doc_links, reason = "comments are docstrings of Python, where [m] is a unit")]
#![expect(clippy::needless_pass_by_value, reason = "Python passes arguments by value")]

mod arrays;
mod audit;
mod errors;
mod flight;
mod history;
mod law;
mod numbers;
mod observation;
mod options;
mod program;
mod read;
mod request;
mod scenario;
mod shield;
mod simulation;
mod studies;
mod vector;
mod work;

use pyo3::prelude::*;

/// Native module of `tautline/*.py`.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::audit::{FlightFindings, audit_arrays, audit_files, audit_in_rust, audit_table};
    #[pymodule_export]
    use super::errors::Error;
    #[pymodule_export]
    use super::flight::{FlightData, fly};
    #[pymodule_export]
    use super::observation::Observation;
    #[pymodule_export]
    use super::program::main;
    #[pymodule_export]
    use super::read::{Columns, read};
    #[pymodule_export]
    use super::request::{AuditOptions, ReadOptions};
    #[pymodule_export]
    use super::scenario::Scenario;
    #[pymodule_export]
    use super::shield::Shield;
    #[pymodule_export]
    use super::simulation::Simulation;
    #[pymodule_export]
    use super::studies::{
        CampaignFolder, attack, campaign, compare, export, margin, proportion, scenarios, sweep, validate,
    };
    #[pymodule_export]
    use super::vector::VectorSimulation;

    #[pymodule_export]
    use super::numbers::separation_text;

    /// Initialises the module. Campaigns record the hash of this library as their program, not that of the interpreter.
    #[pymodule_init]
    fn init(module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        use pyo3::types::PyAnyMethods as _;
        crate::work::remember_process();
        tautline::option::spell_with(crate::options::as_argument);
        // Errors that are raised in Python have no code.
        module.getattr("Error")?.setattr("code", module.py().None())?;
        let origin: std::path::PathBuf = module.getattr("__spec__")?.getattr("origin")?.extract()?;
        tautline::campaign::Program::set_library_file(origin);
        Ok(())
    }
}
