//! Simulations that the caller steps.

use std::sync::{Mutex, TryLockError};
use std::time::{Duration, Instant};

use numpy::PyArray2;
use numpy::PyUntypedArrayMethods as _;
use numpy::ndarray::Ix2;
use pyo3::prelude::*;
use tautline::sim::{self, Components, Ending, SimError};
use tautline::swarm::{Pair, first_row_not_finite};

use crate::errors::{IntoException as _, wrong_input};
use crate::law::{PythonLaw, catch_exception};
use crate::numbers::{borrowed, shape_text, table, to_rows};
use crate::scenario::Scenario;
use crate::work::run_detached;

/// Time between two checks for Ctrl-C.
const AT_ONCE: Duration = Duration::from_millis(50);

/// A flight in progress.
#[pyclass(frozen, module = "tautline._native")]
pub(crate) struct Simulation {
    count: usize,
    /// Whether the law is written in Python.
    is_of_python: bool,
    state: Mutex<sim::Simulation>,
}

/// Numbers of a pair in violation, begin and end \[s\], and smallest separation \[m\].
type Violation = ((usize, usize), f64, f64, f64);

/// Numbers of the closest pair, separation \[m\] and time \[s\].
type Closest = ((usize, usize), f64, f64);

impl Simulation {
    /// Returns a simulation under a law of this library.
    pub(crate) fn of(simulation: sim::Simulation) -> Self {
        Self { count: simulation.state().count(), is_of_python: false, state: Mutex::new(simulation) }
    }

    /// Calls `work` with the simulation. Raises `Error` while another call uses it.
    fn with<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut sim::Simulation) -> T + Send) -> PyResult<T> {
        let done = run_detached(py, || match self.state.try_lock() {
            Ok(mut simulation) => Ok(work(&mut simulation)),
            Err(TryLockError::WouldBlock) => {
                Err("the simulation is being stepped, by another thread or by its own law")
            }
            Err(TryLockError::Poisoned(_)) => Err("the simulation failed before; make a new one"),
        })?;
        done.map_err(wrong_input)
    }

    /// Raises the exception of the law, or an `Error` for a command that is not finite.
    fn raise(&self, py: Python<'_>, raised: Option<PyErr>) -> PyResult<()> {
        if let Some(raised) = raised {
            return Err(raised);
        }
        if !self.is_of_python {
            return Ok(());
        }
        match self.with(py, |simulation| simulation.ending().cloned())? {
            Some(Ending::BrokeDown(why @ sim::Breakdown::CommandNotFinite { .. })) => {
                Err(wrong_input(format!("{why} (elements of `out` that `control` does not write are NaN)")))
            }
            _ => Ok(()),
        }
    }
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (scenario, law))]
    fn new(py: Python<'_>, scenario: &Scenario, law: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let scenario = &scenario.scenario;
        let law = law.map(|law| PythonLaw::new(law, scenario)).transpose()?;
        let is_of_python = law.is_some();
        let begin = || -> Result<_, SimError> {
            let parts = match law {
                Some(law) => Components::with_law(scenario, Box::new(law)),
                None => Components::of(scenario)?,
            };
            sim::Simulation::with(scenario, parts)
        };
        let (made, raised) = run_detached(py, || catch_exception(begin))?;
        let state = Mutex::new(made.map_err(SimError::into_exception)?);
        let simulation = Self { count: scenario.count(), is_of_python, state };
        simulation.raise(py, raised)?;
        Ok(simulation)
    }

    /// Flies a number of steps, fewer where the flight ends, with these accelerations if given.
    fn step(&self, py: Python<'_>, commands: Option<&Bound<'_, PyAny>>, steps: u64) -> PyResult<()> {
        let commands = match commands {
            None => None,
            Some(given) => {
                let given = borrowed::<Ix2>(given, "u", "(N, 3) or (N, 2)")?;
                if given.shape()[0] != self.count || !matches!(given.shape()[1], 2 | 3) {
                    let (count, shape) = (self.count, shape_text(given.shape()));
                    return Err(wrong_input(format!("u: accelerations of shape ({count}, 3) are needed, not {shape}")));
                }
                Some(to_rows(given.as_array()))
            }
        };
        let commands = commands.as_ref();
        if let Some(vehicle) = commands.and_then(first_row_not_finite) {
            let step = self.with(py, |simulation| simulation.steps())? + 1;
            return Err(wrong_input(format!(
                "step {step}: the command for vehicle {} is not a finite number",
                vehicle + 1
            )));
        }
        let mut left = steps;
        while left > 0 {
            let some_steps = |simulation: &mut sim::Simulation| -> Result<u64, SimError> {
                let (began, mut flown) = (Instant::now(), 0);
                while flown < left && began.elapsed() < AT_ONCE {
                    if simulation.ending().is_some() {
                        return Ok(left);
                    }
                    match commands {
                        Some(commands) => simulation.step_with(commands)?,
                        None => simulation.step(),
                    }
                    // Events and samples are not recorded here.
                    simulation.events().for_each(drop);
                    simulation.sample();
                    flown += 1;
                }
                Ok(flown)
            };
            let (flown, raised) = self.with(py, |simulation| catch_exception(|| some_steps(simulation)))?;
            self.raise(py, raised)?;
            left -= flown.map_err(SimError::into_exception)?;
            py.check_signals()?;
        }
        Ok(())
    }

    #[getter]
    fn t(&self, py: Python<'_>) -> PyResult<f64> {
        self.with(py, |simulation| simulation.time_s())
    }

    #[getter]
    fn steps(&self, py: Python<'_>) -> PyResult<u64> {
        self.with(py, |simulation| simulation.steps())
    }

    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        table(py, &self.with(py, |simulation| simulation.state().positions_m.clone())?)
    }

    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        table(py, &self.with(py, |simulation| simulation.state().velocities_m_s.clone())?)
    }

    /// Current commands; empty where the law failed.
    #[getter]
    fn commands<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        table(py, &self.with(py, |simulation| simulation.control().clone())?)
    }

    /// Smallest separation over the last audited interval.
    #[getter]
    fn separation_m(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        self.with(py, |simulation| simulation.closest().map(|_| simulation.separation_m()))
    }

    /// Closest approach so far.
    #[getter]
    fn closest(&self, py: Python<'_>) -> PyResult<Option<Closest>> {
        let closest = self.with(py, |simulation| simulation.closest())?;
        Ok(closest.map(|closest| (numbers(closest.pair), closest.separation_m, closest.time_s)))
    }

    #[getter]
    fn least_clearance_m(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        self.with(py, |simulation| simulation.least_clearance_m())
    }

    /// Verdict so far, or of the whole flight after its end, and violations of pairs.
    fn judged(&self, py: Python<'_>) -> PyResult<(String, Vec<Violation>)> {
        let (flight, is_over) =
            self.with(py, |simulation| (simulation.clone().finish(), simulation.ending().is_some()))?;
        let found = flight.audit.violations.iter().map(|of| (numbers(of.pair), of.from_s, of.to_s, of.min_m));
        let status = if is_over { flight.status() } else { flight.status_so_far() };
        Ok((status.name().to_owned(), found.collect()))
    }

    /// `completed`, or the reason of an early end; `None` before the end.
    #[getter]
    fn ending(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let ending = self.with(py, |simulation| simulation.ending().cloned())?;
        Ok(ending.map(|ending| ending.reason().unwrap_or_else(|| "completed".to_owned())))
    }

    /// Returns an independent copy, with other random numbers if a seed is given.
    fn copy(&self, py: Python<'_>, noise_seed: Option<u64>) -> PyResult<Self> {
        let copied = self.with(py, |simulation| {
            let mut copy = simulation.clone();
            if noise_seed.is_some() {
                copy.load(&simulation.save(), noise_seed);
            }
            copy
        })?;
        Ok(Self { count: self.count, is_of_python: self.is_of_python, state: Mutex::new(copied) })
    }
}

fn numbers(pair: Pair) -> (usize, usize) {
    let [first, second] = pair.numbers();
    (first, second)
}
