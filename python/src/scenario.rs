//! Scenarios.

use numpy::PyArray2;
use pyo3::prelude::*;
use tautline::preflight::Preflight;
use tautline::request::ScenarioRequest;
use tautline::scenario::{self, Override, Source};

use crate::errors::{IntoException as _, json, wrong_input};
use crate::numbers::table;
use crate::work::run_detached;

/// A complete and valid scenario.
#[pyclass(frozen, module = "tautline._native")]
pub(crate) struct Scenario {
    pub(crate) scenario: scenario::Scenario,
    /// Source of the scenario, for studies that vary it.
    pub(crate) request: ScenarioRequest,
}

#[pymethods]
impl Scenario {
    /// Reads a built-in scenario, a file, or a TOML text, with overrides in the form of `--set`.
    #[new]
    fn new(py: Python<'_>, source: String, is_text: bool, overrides: Vec<String>) -> PyResult<Self> {
        let read = || {
            let parsed = overrides.iter().map(|text| Override::parse(text)).collect::<Result<Vec<_>, _>>()?;
            let (argument, source) = if is_text {
                ("-".to_owned(), Source::Text { name: "TOML".to_owned(), text: source })
            } else {
                (source.clone(), Source::resolve(&source)?)
            };
            let scenario = scenario::Scenario::read(&source, &parsed)?;
            Ok(Self { scenario, request: ScenarioRequest { argument, source, overrides, external_law: None } })
        };
        run_detached(py, read)?.map_err(scenario::ScenarioError::into_exception)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.scenario.name
    }

    #[getter]
    fn count(&self) -> usize {
        self.scenario.count()
    }

    #[getter]
    fn delta_m(&self) -> f64 {
        self.scenario.delta_m
    }

    /// Unit of separations.
    #[getter]
    fn unit(&self) -> &str {
        if self.scenario.half_axes_m().is_some() { "m, scaled" } else { "m" }
    }

    #[getter]
    fn duration_s(&self) -> f64 {
        self.scenario.time.end_s(self.scenario.time.steps())
    }

    #[getter]
    fn dt_s(&self) -> f64 {
        self.scenario.time.dt_s
    }

    #[getter]
    fn steps(&self) -> u64 {
        self.scenario.time.steps()
    }

    #[getter]
    fn law(&self) -> PyResult<String> {
        let law = self.scenario.law().map_err(|error| wrong_input(error.to_string()))?;
        Ok(law.name().to_owned())
    }

    #[getter]
    fn positions_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        table(py, &self.scenario.start.positions_m)
    }

    #[getter]
    fn velocities_m_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        table(py, &self.scenario.start.velocities_m_s)
    }

    #[getter]
    fn slots_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        table(py, &self.scenario.formation().slots_m)
    }

    /// Linked vehicles, from 0.
    #[getter]
    fn links(&self) -> Vec<(usize, usize)> {
        self.scenario.graph.edges().collect()
    }

    /// The part that a learning environment ignores: key and reason.
    #[getter]
    fn part_ignored_by_environments(&self) -> Option<(&'static str, &'static str)> {
        self.scenario.part_ignored_by_environments().map(|part| (part.key, part.what))
    }

    /// Whether the vehicles stay in the plane z = 0.
    #[getter]
    fn is_plane(&self) -> bool {
        self.scenario.space == scenario::Space::Plane
    }

    /// Whether vehicles know the true present states.
    #[getter]
    fn is_exact(&self) -> bool {
        self.scenario.is_exact()
    }

    /// Number of obstacles.
    #[getter]
    fn obstacles(&self) -> usize {
        self.scenario.obstacles.len()
    }

    #[getter]
    fn toml(&self) -> String {
        self.scenario.resolved().toml
    }

    #[getter]
    fn sha256(&self) -> String {
        self.scenario.resolved().sha256
    }

    /// Checks the scenario. Returns whether it may fly, a headline, a summary, and the check as JSON.
    fn check(&self, py: Python<'_>) -> PyResult<(bool, String, String, String)> {
        let found =
            run_detached(py, || Preflight::of(&self.scenario))?.map_err(|error| wrong_input(error.to_string()))?;
        Ok((!found.refuses(), found.headline(), found.text(), json(&found)?))
    }
}
