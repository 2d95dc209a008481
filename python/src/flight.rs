//! Flights from start to end.

use std::ops::ControlFlow;
use std::path::PathBuf;

use numpy::{PyArray1, PyArray3};
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use tautline::flight_log::FlightLog;
use tautline::mcap::{Header, McapRecorder};
use tautline::preflight::Preflight;
use tautline::record::{Event, RecordError, Sample, Sink};
use tautline::report::Report;
use tautline::request::{flight_page, run_audit};
use tautline::run::run_with;
use tautline::sim::{Breakdown, Components, Ending, SimError};

use crate::audit::FlightFindings;
use crate::errors::{IntoException as _, internal_error, wrong_input};
use crate::law::{PythonLaw, catch_exception};
use crate::numbers::{by_row, cube};
use crate::scenario::Scenario;
use crate::work::{Signals, run_detached};

/// Samples of a flight in memory.
#[derive(Default)]
struct Samples {
    is_kept: bool,
    vehicles: usize,
    times_s: Vec<f64>,
    positions_m: Vec<f64>,
    velocities_m_s: Vec<f64>,
    commands_m_s2: Vec<f64>,
    separations_m: Vec<f64>,
    /// Name of the law, if it differs from the scenario's.
    other_law: Option<String>,
    /// Reason of an early end.
    ended_early: Option<String>,
}

impl Sink for Samples {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        if !self.is_kept {
            return Ok(());
        }
        self.times_s.push(sample.time_s);
        self.positions_m.extend(by_row(&sample.swarm.positions_m));
        self.velocities_m_s.extend(by_row(&sample.swarm.velocities_m_s));
        self.commands_m_s2.extend(by_row(sample.control));
        // The law failed: the missing commands are NaN.
        self.commands_m_s2.resize(self.positions_m.len(), f64::NAN);
        self.separations_m.push(sample.separation.map_or(f64::NAN, |closest| closest.separation_m));
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        match event {
            Event::OtherLaw { name, .. } => self.other_law = Some(name.clone()),
            Event::EndedEarly { reason, .. } => self.ended_early = Some(reason.clone()),
            _ => {}
        }
        Ok(())
    }

    fn needs_steps(&self) -> bool {
        false
    }
}

/// Result of a flight: its report in words and as JSON, and its samples.
#[pyclass(frozen, get_all, module = "tautline._native")]
pub(crate) struct FlightData {
    headline: String,
    text: String,
    report: String,
    t: Py<PyArray1<f64>>,
    positions: Py<PyArray3<f64>>,
    velocities: Py<PyArray3<f64>>,
    commands: Py<PyArray3<f64>>,
    separations_m: Py<PyArray1<f64>>,
    findings: Py<FlightFindings>,
}

impl FlightData {
    fn new(py: Python<'_>, report: &Report, samples: Samples, findings: FlightFindings) -> PyResult<Self> {
        let shape = [samples.times_s.len(), samples.vehicles, 3];
        Ok(Self {
            headline: report.headline(),
            text: report.text(),
            report: serde_json::to_string(report).map_err(|error| internal_error(&error.to_string()))?,
            t: PyArray1::from_vec(py, samples.times_s).unbind(),
            positions: cube(py, samples.positions_m, shape)?.unbind(),
            velocities: cube(py, samples.velocities_m_s, shape)?.unbind(),
            commands: cube(py, samples.commands_m_s2, shape)?.unbind(),
            separations_m: PyArray1::from_vec(py, samples.separations_m).unbind(),
            findings: Py::new(py, findings)?,
        })
    }
}

/// Recording and page of a flight.
#[derive(Default)]
struct OutputFiles {
    recording: Option<McapRecorder>,
    page: Option<FlightLog>,
}

impl Sink for OutputFiles {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.recording.as_mut().map_or(Ok(()), |recording| recording.sample(sample))?;
        self.page.as_mut().map_or(Ok(()), |page| page.sample(sample))
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.recording.as_mut().map_or(Ok(()), |recording| recording.event(event))?;
        self.page.as_mut().map_or(Ok(()), |page| page.event(event))
    }

    fn needs_steps(&self) -> bool {
        false
    }
}

/// Flies a scenario to its end, under a law in Python if given.
#[pyfunction]
#[pyo3(signature = (scenario, law, record, html, command, keep))]
pub(crate) fn fly(
    py: Python<'_>,
    scenario: &Scenario,
    law: Option<&Bound<'_, PyAny>>,
    record: Option<PathBuf>,
    html: Option<PathBuf>,
    command: &str,
    keep: bool,
) -> PyResult<FlightData> {
    let scenario = &scenario.scenario;
    let law = law.map(|law| PythonLaw::new(law, Some(scenario))).transpose()?;
    let is_of_python = law.is_some();
    let samples = Samples { is_kept: keep, vehicles: scenario.count(), ..Samples::default() };
    let mut signals = Signals::new();
    let flight = || -> Result<_, SimError> {
        let preflight = match &law {
            Some(law) => Preflight::with_law(scenario, law),
            None => Preflight::of(scenario)?,
        };
        let parts = match law {
            Some(law) => Components::with_law(scenario, Box::new(law)),
            None => Components::of(scenario)?,
        };
        let recording = record.as_deref().map(|path| {
            let header = Header::new(&scenario.name, &preflight.resolved.toml, scenario.count(), scenario.delta_m);
            McapRecorder::create(path, &header)
        });
        let page = html.is_some().then(|| FlightLog::of(scenario));
        let mut sinks = (samples, OutputFiles { recording: recording.transpose()?, page });
        let mut carry_on = |_| if signals.are_silent() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
        let flown = run_with(scenario, &preflight, parts, &mut sinks, &mut carry_on);
        let (samples, OutputFiles { recording, page }) = sinks;
        let closed = recording.map_or(Ok(()), |recording| match &flown {
            Ok((report, _)) => recording.close(run_audit(scenario, report)),
            Err(_) => recording.finish(),
        });
        let (report, ending) = flown?;
        closed?;
        let page = page.map(|log| flight_page(scenario, &preflight, log, &report, command));
        Ok((report, ending, samples, page))
    };
    let (flown, raised) = run_detached(py, || catch_exception(flight))?;
    if let Some(raised) = signals.raised.or(raised) {
        return Err(raised);
    }
    let (report, ending, samples, page) = flown.map_err(SimError::into_exception)?;
    if let (Ending::BrokeDown(why @ Breakdown::CommandNotFinite { .. }), true) = (&ending, is_of_python) {
        return Err(wrong_input(format!("{why} (elements of `out` that `control` does not write are NaN)")));
    }
    if let (Some(page), Some(path)) = (page, html) {
        tautline::files::write_atomically(&path, page.as_bytes())
            .map_err(|error| PyOSError::new_err(error.to_string()))?;
    }
    let (other_law, reason) = (samples.other_law.clone(), samples.ended_early.clone());
    let findings = FlightFindings::of(scenario, run_audit(scenario, &report), other_law, reason)?;
    FlightData::new(py, &report, samples, findings)
}
