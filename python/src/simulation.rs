//! Simulations that the caller steps.

use std::sync::{Arc, Mutex, TryLockError};
use std::time::{Duration, Instant};

use numpy::PyArray2;
use numpy::PyUntypedArrayMethods as _;
use numpy::ndarray::Ix2;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use tautline::law::Law as _;
use tautline::sim::{self, Components, Ending, SimError};
use tautline::swarm::{Pair, Rows, first_row_not_finite};

use crate::errors::{IntoException as _, wrong_input};
use crate::history::{History, Part, Saved};
use crate::law::{PythonLaw, catch_exception, record_calls};
use crate::numbers::{borrowed, shape_text, table, to_rows};
use crate::scenario::Scenario;
use crate::work::run_detached;

/// Time between two checks for Ctrl-C.
const AT_ONCE: Duration = Duration::from_millis(50);

/// A flight in progress.
#[pyclass(frozen, module = "tautline._native")]
pub(crate) struct Simulation {
    count: usize,
    /// Name of the law, if it is written in Python.
    python_law: Option<String>,
    state: Mutex<State>,
}

/// A simulation with its history.
#[derive(Clone)]
struct State {
    simulation: sim::Simulation,
    history: History,
}

/// Numbers of a pair in violation, begin and end \[s\], smallest separation \[m\] and its time \[s\].
type Violation = ((usize, usize), f64, f64, f64, f64);

/// Numbers of the closest pair, separation \[m\] and time \[s\].
type Closest = ((usize, usize), f64, f64);

impl Simulation {
    /// Returns a simulation that was a world of many.
    pub(crate) fn of_world(simulation: sim::Simulation) -> Self {
        let (count, history) = (simulation.state().count(), History::of_world());
        Self { count, python_law: None, state: Mutex::new(State { simulation, history }) }
    }

    /// Calls `work` with the simulation. Raises `Error` while another call uses it.
    fn with<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut sim::Simulation) -> T + Send) -> PyResult<T> {
        self.with_history(py, |state| work(&mut state.simulation))
    }

    /// As [`Simulation::with`], with the history.
    fn with_history<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut State) -> T + Send) -> PyResult<T> {
        let done = run_detached(py, || match self.state.try_lock() {
            Ok(mut state) => Ok(work(&mut state)),
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
        if self.python_law.is_none() {
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

impl State {
    /// Flies some steps and adds them to the history. Returns their number; all that are left after the end.
    fn advance(&mut self, commands: Option<&Arc<Rows>>, left: u64) -> Result<u64, SimError> {
        let (began, mut flown) = (Instant::now(), 0);
        let mut ended = Ok(false);
        while flown < left && began.elapsed() < AT_ONCE {
            ended = self.step(commands.map(Arc::as_ref));
            match ended {
                Ok(false) => flown += 1,
                Ok(true) | Err(_) => break,
            }
        }
        // A flight has less than 2^64 steps.
        let _ = self.history.add_steps(commands, flown);
        ended.map(|is_over| if is_over { left } else { flown })
    }

    /// Flies a step. Returns true if the flight had ended before.
    fn step(&mut self, commands: Option<&Rows>) -> Result<bool, SimError> {
        if self.simulation.ending().is_some() {
            return Ok(true);
        }
        match commands {
            Some(commands) => self.simulation.step_with(commands)?,
            None => self.simulation.step(),
        }
        // Events and samples are not recorded here.
        self.simulation.events().for_each(drop);
        self.simulation.sample();
        Ok(false)
    }

    fn reseed(&mut self, seed: u64) {
        let saved = self.simulation.save();
        self.simulation.load(&saved, Some(seed));
        self.history.reseed(seed);
    }
}

impl Simulation {
    /// Starts a flight. Returns it with the exception that its law raised.
    fn begin(py: Python<'_>, scenario: &Scenario, law: Option<PythonLaw>) -> PyResult<(Self, Option<PyErr>)> {
        let scenario = &scenario.scenario;
        let python_law = law.as_ref().map(|law| law.name().to_owned());
        let begin = || -> Result<_, SimError> {
            let parts = match law {
                Some(law) => Components::with_law(scenario, Box::new(law)),
                None => Components::of(scenario)?,
            };
            sim::Simulation::awaiting_commands(scenario, parts)
        };
        let ((made, calls), raised) = run_detached(py, || catch_exception(|| record_calls(begin)))?;
        let mut history = History::default();
        history.add_calls(calls);
        let state = State { simulation: made.map_err(SimError::into_exception)?, history };
        Ok((Self { count: scenario.count(), python_law, state: Mutex::new(state) }, raised))
    }

    /// Flies a number of steps, fewer where the flight ends. Returns the exception that the law raised.
    fn advance(&self, py: Python<'_>, commands: Option<&Arc<Rows>>, steps: u64) -> PyResult<Option<PyErr>> {
        let mut left = steps;
        while left > 0 {
            let (flown, raised) = self.with_history(py, |state| {
                catch_exception(|| {
                    let (flown, calls) = record_calls(|| state.advance(commands, left));
                    state.history.add_calls(calls);
                    flown
                })
            })?;
            if raised.is_some() {
                return Ok(raised);
            }
            left -= flown.map_err(SimError::into_exception)?;
            py.check_signals()?;
        }
        Ok(None)
    }
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (scenario, law))]
    fn new(py: Python<'_>, scenario: &Scenario, law: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let law = law.map(|law| PythonLaw::new(law, Some(&scenario.scenario))).transpose()?;
        let (simulation, raised) = Self::begin(py, scenario, law)?;
        simulation.raise(py, raised)?;
        Ok(simulation)
    }

    /// Returns the resolved scenario and the name of the law in Python of a saved simulation.
    #[staticmethod]
    fn saved(data: &[u8]) -> PyResult<(String, Option<String>)> {
        Saved::read(data).map(|saved| (saved.toml, saved.law))
    }

    /// Repeats a saved simulation under its scenario, and under its law in Python if it has one.
    #[staticmethod]
    fn load(py: Python<'_>, scenario: &Scenario, law: Option<&Bound<'_, PyAny>>, data: &[u8]) -> PyResult<Self> {
        let saved = Saved::read(data)?;
        if saved.positions_m.nrows() != scenario.scenario.count() {
            return Err(wrong_input("data: the number of vehicles is not that of the scenario; the bytes are damaged"));
        }
        let law = law.map(|law| PythonLaw::new(law, Some(&scenario.scenario))).transpose()?;
        let given = law.as_ref().map(|law| law.name().to_owned());
        if given != saved.law {
            let named = |law: Option<&str>| law.map_or_else(|| "none".to_owned(), |law| format!("`{law}`"));
            let (saved, given) = (named(saved.law.as_deref()), named(given.as_deref()));
            return Err(wrong_input(format!(
                "law: the law in Python of the saved simulation is needed, {saved}, got {given}"
            )));
        }
        let law = law.map(|law| law.repeating(saved.history.calls.clone()));
        let (simulation, raised) = Self::begin(py, scenario, law)?;
        let mut raised = raised;
        for part in &saved.history.parts {
            if let Some(raised) = raised {
                return Err(raised);
            }
            raised = match part {
                Part::Own(steps) => simulation.advance(py, None, *steps)?,
                Part::Outside(commands, steps) => simulation.advance(py, Some(commands), *steps)?,
                Part::Reseed(seed) => {
                    simulation.with_history(py, |state| state.reseed(*seed))?;
                    None
                }
            };
        }
        let is_equal = simulation.with(py, |simulation| saved.is_state(simulation.state()))?;
        if !is_equal {
            return Err(wrong_input("data: the repeated flight ends in another state; the bytes are damaged"));
        }
        Ok(simulation)
    }

    /// Returns the simulation as bytes.
    fn save<'py>(&self, py: Python<'py>, scenario: &Scenario) -> PyResult<Bound<'py, PyBytes>> {
        let (law, toml) = (self.python_law.as_deref(), scenario.scenario.resolved().toml);
        let bytes = self.with_history(py, |state| state.history.save(&toml, law, state.simulation.state()))??;
        Ok(PyBytes::new(py, &bytes))
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
        if let Some(vehicle) = commands.as_ref().and_then(first_row_not_finite) {
            let step = self.with(py, |simulation| simulation.steps())? + 1;
            return Err(wrong_input(format!(
                "step {step}: the command for vehicle {} is not a finite number",
                vehicle + 1
            )));
        }
        let raised = self.advance(py, commands.map(Arc::new).as_ref(), steps)?;
        self.raise(py, raised)
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
        let found =
            flight.audit.violations.iter().map(|of| (numbers(of.pair), of.from_s, of.to_s, of.min_m, of.min_at_s));
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
        let copied = self.with_history(py, |state| {
            let mut copy = state.clone();
            if let Some(seed) = noise_seed {
                copy.reseed(seed);
            }
            copy
        })?;
        Ok(Self { count: self.count, python_law: self.python_law.clone(), state: Mutex::new(copied) })
    }
}

fn numbers(pair: Pair) -> (usize, usize) {
    let [first, second] = pair.numbers();
    (first, second)
}
