//! Audits of arrays and files.

use std::path::PathBuf;
use std::time::Instant;

use numpy::ndarray::{Ix1, Ix3};
use numpy::{PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use tautline::audit::recorded::{self, Settings};
use tautline::fact::Fact;
use tautline::mcap::RunAudit;
use tautline::read::{self, ReadError};
use tautline::report::recorded::RecordedReport;
use tautline::request::audit::Open;
use tautline::request::{self, AuditRequest, Failure, Monitor as _, OwnRecording, Silent, Subject};
use tautline::scenario::Scenario;
use tautline::track::Tracks as _;

use crate::arrays::{Arrays, notes_of_absence};
use crate::errors::{IntoException as _, internal_error, wrong_input};
use crate::numbers::{borrowed, shape_text};
use crate::request::{AuditOptions, ReadOptions};
use crate::work::run_in_thread;

/// Verdict in words, headline, summary, report as JSON, and whether each of its facts is an assumption.
type AuditOutcome = (String, String, String, String, Vec<bool>);

fn judged(report: &RecordedReport) -> PyResult<AuditOutcome> {
    let json = serde_json::to_string(report).map_err(|error| internal_error(&error.to_string()))?;
    let assumed = report.source.facts.iter().map(Fact::is_assumption).collect();
    Ok((report.verdict(), report.headline(), report.text(), json, assumed))
}

/// Limits, obstacles and audit of a flight, as in its recording.
#[pyclass(frozen, module = "tautline._native")]
pub(crate) struct FlightFindings {
    own: OwnRecording,
    /// Audit of the run, name of another law, and reason of an early end, as JSON.
    #[pyo3(get)]
    json: String,
}

impl FlightFindings {
    pub(crate) fn of(
        scenario: &Scenario,
        audit: RunAudit,
        other_law: Option<String>,
        reason: Option<String>,
    ) -> PyResult<Self> {
        let json = serde_json::to_string(&(&audit, &other_law, &reason));
        let json = json.map_err(|error| internal_error(&error.to_string()))?;
        Ok(Self { own: OwnRecording::of_run(scenario, audit, other_law, reason), json })
    }
}

#[pymethods]
impl FlightFindings {
    /// Restores the findings of a flight of a scenario from their JSON.
    #[new]
    fn new(scenario: &crate::scenario::Scenario, json: &str) -> PyResult<Self> {
        let (audit, other_law, reason) =
            serde_json::from_str(json).map_err(|error| wrong_input(format!("findings: {error}")))?;
        Self::of(&scenario.scenario, audit, other_law, reason)
    }
}

/// Arrays of an audit.
struct AuditArrays<'py> {
    times: PyReadonlyArray1<'py, f64>,
    positions: PyReadonlyArray3<'py, f64>,
    velocities: Option<PyReadonlyArray3<'py, f64>>,
}

impl<'py> AuditArrays<'py> {
    fn new(
        times: &Bound<'py, PyAny>,
        positions: &Bound<'py, PyAny>,
        velocities: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let given = Self {
            times: borrowed::<Ix1>(times, "t", "(T,)")?,
            positions: borrowed::<Ix3>(positions, "positions", "(T, N, 3) or (T, N, 2)")?,
            velocities: velocities.map(|of| borrowed::<Ix3>(of, "velocities", "(T, N, 3)")).transpose()?,
        };
        given.check()?;
        Ok(given)
    }

    fn check(&self) -> PyResult<()> {
        let (instants, shape) = (self.times.len(), self.positions.shape());
        if !matches!(shape[2], 2 | 3) {
            let shape = shape_text(shape);
            return Err(wrong_input(format!(
                "positions: the last axis is x, y and z, or x and y; the shape is {shape}"
            )));
        }
        if shape[0] != instants {
            let help = if shape[1] == instants { "; the first axis is time: give .swapaxes(0, 1)" } else { "" };
            return Err(wrong_input(format!(
                "positions: they are of shape {} for {instants} times{help}",
                shape_text(shape)
            )));
        }
        if let Some(velocities) = self.velocities.as_ref().filter(|of| of.shape() != shape) {
            let (found, expected) = (shape_text(velocities.shape()), shape_text(shape));
            return Err(wrong_input(format!(
                "velocities: they are of shape {found}, and positions of shape {expected}"
            )));
        }
        if self.positions.len() == 0 {
            let shape = shape_text(shape);
            return Err(wrong_input(format!("positions: they are of shape {shape}, which holds nothing to judge")));
        }
        Ok(())
    }
}

/// Audits a recording, in one file or in a file for each vehicle. Writes a page to `html`, if given.
#[pyfunction]
pub(crate) fn audit_files(
    py: Python<'_>,
    question: &AuditOptions,
    command: &str,
    paths: Vec<PathBuf>,
    options: &ReadOptions,
    html: Option<PathBuf>,
) -> PyResult<AuditOutcome> {
    let subject = Subject::Files { paths, options: Box::new(options.0.clone()) };
    let monitor = Silent::default();
    let request = AuditRequest { command: command.to_owned(), html, ..AuditRequest::new(subject, question.0.clone()) };
    let audited = run_in_thread(py, monitor.interruption(), || request::audit_files(&request, &monitor))?;
    judged(&audited.map_err(Failure::into_exception)?.report)
}

/// Audits a table in memory, which is in a file of Parquet. Writes a page to `html`, if given.
#[pyfunction]
pub(crate) fn audit_table(
    py: Python<'_>,
    question: &AuditOptions,
    command: &str,
    table: PathBuf,
    options: &ReadOptions,
    html: Option<PathBuf>,
) -> PyResult<AuditOutcome> {
    const NAME: &str = "table";
    let monitor = Silent::default();
    let open: &Open<'_> = &|| {
        read::open(&table, &options.0)
            .map(|recording| recording as _)
            .map_err(|error| ReadError { file: NAME.to_owned(), ..error })
    };
    let subject = Subject::InMemory { name: NAME, own: None, open };
    let request = AuditRequest { command: command.to_owned(), html, ..AuditRequest::new(subject, question.0.clone()) };
    let audited = run_in_thread(py, monitor.interruption(), || request::audit_files(&request, &monitor))?;
    judged(&audited.map_err(Failure::into_exception)?.report)
}

/// Audits arrays of positions. Writes a page to `html`, if given.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one for each keyword of Python")]
pub(crate) fn audit_arrays<'py>(
    py: Python<'py>,
    question: &AuditOptions,
    command: &str,
    times: &Bound<'py, PyAny>,
    positions: &Bound<'py, PyAny>,
    velocities: Option<&Bound<'py, PyAny>>,
    names: Vec<String>,
    findings: Option<&FlightFindings>,
    html: Option<PathBuf>,
) -> PyResult<AuditOutcome> {
    let given = AuditArrays::new(times, positions, velocities)?;
    if names.len() != given.positions.shape()[1] {
        return Err(wrong_input(format!("names: {} for {} vehicles", names.len(), given.positions.shape()[1])));
    }
    let (times, positions) = (given.times.as_array(), given.positions.as_array());
    let velocities = given.velocities.as_ref().map(PyReadonlyArray3::as_array);
    let is_plane = positions.shape()[2] == 2;
    let plane = is_plane
        .then(|| "positions have two axes and no height: the recording is judged in the plane of x and y".to_owned());
    let notes: Vec<String> = plane.into_iter().chain(notes_of_absence(positions, &names)).collect();
    let arrays = Arrays::new(times, positions, velocities, &names, &notes);
    let own = findings.map(|findings| &findings.own);
    let monitor = Silent::default();
    let work = || {
        let open: &Open<'_> = &|| Ok(Box::new(arrays.clone()));
        let subject = Subject::InMemory { name: "arrays", own, open };
        let request = AuditRequest::new(subject, question.0.clone());
        request::audit_files(&AuditRequest { command: command.to_owned(), html, ..request }, &monitor)
    };
    let audited = run_in_thread(py, monitor.interruption(), work)?;
    judged(&audited.map_err(Failure::into_exception)?.report)
}

/// Measures an audit in Rust \[s\], without and with the conversion of the arrays into items.
///
/// `bench/ratios.py` compares `audit` with it.
#[pyfunction]
pub(crate) fn audit_in_rust(
    times: &Bound<'_, PyAny>,
    positions: &Bound<'_, PyAny>,
    delta_m: f64,
) -> PyResult<(f64, f64)> {
    let given = AuditArrays::new(times, positions, None)?;
    let names: Vec<_> = (1..=given.positions.shape()[1]).map(|number| number.to_string()).collect();
    let began = Instant::now();
    let mut items = Vec::with_capacity(given.positions.len() / 3);
    let mut arrays = Arrays::new(given.times.as_array(), given.positions.as_array(), None, &names, &[]);
    while arrays.read(&mut items).map_err(|error| wrong_input(error.to_string()))? {}
    let made_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let outcome =
        recorded::audit(&names, &items, Settings::delta(delta_m)).map_err(|error| wrong_input(error.to_string()))?;
    let judged_s = began.elapsed().as_secs_f64();
    drop(outcome);
    Ok((judged_s, made_s + judged_s))
}
