//! Many worlds of a scenario that the caller steps together.

use std::sync::{Mutex, TryLockError};

use numpy::ndarray::{ArrayView3, Dimension, IntoDimension, Ix3};
use numpy::{
    BorrowError, Element, PyArray, PyArray1, PyArray3, PyArray4, PyArrayDescrMethods as _, PyArrayMethods as _,
    PyReadonlyArray1, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods as _, dtype,
};
use pyo3::prelude::*;
use tautline::law::{Law, LawError};
use tautline::observation::Observation;
use tautline::scenario::{ExternalLaw, Override, Template};
use tautline::sim::{self, GivenStarts, SeedChoice, StatesMut, Threads, VectorError};
use tautline::swarm::Rows;

use crate::errors::{IntoException as _, internal_error, wrong_input, wrong_input_with_code, wrong_type};
use crate::numbers::shape_text;
use crate::scenario::Scenario;
use crate::simulation::Simulation;
use crate::work::{ProcessPool, Signals, run_detached};

/// Worlds in progress, and the arrays that hold their states.
#[pyclass(frozen, module = "tautline._native")]
pub(crate) struct VectorSimulation {
    /// Numbers of worlds and of vehicles.
    shape: [usize; 2],
    worlds: Mutex<sim::VectorSimulation>,
    threads: Workers,
    positions: Py<PyArray3<f64>>,
    velocities: Py<PyArray3<f64>>,
    least_clearance_m: Py<PyArray1<f64>>,
    is_over: Py<PyArray1<bool>>,
}

/// Threads of the worlds.
enum Workers {
    /// One for each core, which the process shares.
    Shared,
    /// The calling thread alone.
    One,
    /// The calling thread and a pool.
    Own(ProcessPool),
}

impl Workers {
    fn of(threads: usize) -> Self {
        match threads {
            0 => Self::Shared,
            1 => Self::One,
            _ => Self::Own(ProcessPool::new(threads - 1)),
        }
    }

    /// Returns the threads of a call.
    fn now(&self) -> PyResult<Threads> {
        Ok(match self {
            Self::Shared => Threads::Current,
            Self::One => Threads::One,
            Self::Own(pool) => Threads::With(pool.get().map_err(|error| internal_error(&error.to_string()))?),
        })
    }
}

impl VectorSimulation {
    /// Calls `work` with the worlds and the memory of the arrays. Raises `Error` while another call uses them, and for
    /// an array that the caller made read-only.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut sim::VectorSimulation, &mut StatesMut<'_>) -> T + Send,
    ) -> PyResult<T> {
        const BUSY: &str = "the worlds are being stepped by another thread";
        let refused = |name: &'static str| {
            move |error| match error {
                BorrowError::NotWriteable => {
                    wrong_input(format!("{name}: the array is read-only; call {name}.setflags(write=True)"))
                }
                _ => wrong_input(BUSY),
            }
        };
        let mut positions = self.positions.bind(py).try_readwrite().map_err(refused("positions"))?;
        let mut velocities = self.velocities.bind(py).try_readwrite().map_err(refused("velocities"))?;
        let clearances = self.least_clearance_m.bind(py).try_readwrite();
        let mut least_clearance_m = clearances.map_err(refused("least_clearance_m"))?;
        let mut is_over = self.is_over.bind(py).try_readwrite().map_err(refused("is_over"))?;
        let split = |_| internal_error("an array is not contiguous");
        let mut states = StatesMut {
            positions_m: positions.as_slice_mut().map_err(split)?,
            velocities_m_s: velocities.as_slice_mut().map_err(split)?,
            least_clearance_m: least_clearance_m.as_slice_mut().map_err(split)?,
            is_over: is_over.as_slice_mut().map_err(split)?,
        };
        let threads = self.threads.now()?;
        let guarded = || match self.worlds.try_lock() {
            Ok(mut worlds) => {
                worlds.set_threads(threads);
                Ok(work(&mut worlds, &mut states))
            }
            Err(TryLockError::WouldBlock) => Err(BUSY),
            Err(TryLockError::Poisoned(_)) => Err("the worlds failed before; make new ones"),
        };
        run_detached(py, guarded)?.map_err(wrong_input)
    }

    /// Copies commands (E, N, 3) or (E, N, 2) of float32 or float64 in any memory order.
    fn take_commands(&self, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
        let [worlds, vehicles] = self.shape;
        let Ok(array) = given.cast::<PyUntypedArray>() else {
            let kind = given.get_type().qualname()?;
            return Err(wrong_type(format!("u: a NumPy array is needed, not {kind}; give numpy.asarray(...)")));
        };
        if given.hasattr("mask")? {
            return Err(wrong_type("u: a masked array has unknown numbers; give it as .filled(0.0)"));
        }
        let kind = array.dtype();
        let is_single = kind.is_equiv_to(&dtype::<f32>(given.py()));
        if !is_single && !kind.is_equiv_to(&dtype::<f64>(given.py())) {
            let problem = format!("u: an array of float32 or float64 is needed, not of {kind}");
            return Err(wrong_type(format!("{problem}; give it as .astype(float)")));
        }
        let shape = array.shape();
        if shape.len() != 3 || shape[..2] != self.shape || !matches!(shape[2], 2 | 3) {
            let found = shape_text(shape);
            return Err(wrong_input(format!(
                "u: accelerations of shape ({worlds}, {vehicles}, 3) are needed, not {found}"
            )));
        }
        if !array.is_aligned() {
            return Err(wrong_type("u: its numbers are not aligned in memory; give a copy, numpy.array(...)"));
        }
        if is_single { copied::<f32>(given) } else { copied::<f64>(given) }
    }

    fn of(py: Python<'_>, worlds: sim::VectorSimulation, threads: Workers) -> PyResult<Self> {
        let shape = [worlds.count(), worlds.vehicles()];
        let [count, vehicles] = shape;
        let made = Self {
            shape,
            worlds: Mutex::new(worlds),
            threads,
            positions: PyArray3::zeros(py, [count, vehicles, 3], false).unbind(),
            velocities: PyArray3::zeros(py, [count, vehicles, 3], false).unbind(),
            least_clearance_m: PyArray1::zeros(py, count, false).unbind(),
            is_over: PyArray1::from_vec(py, vec![false; count]).unbind(),
        };
        made.with(py, sim::VectorSimulation::write)?.map_err(raised)?;
        Ok(made)
    }

    /// Returns a new array that `write` fills.
    fn written<'py, D: Dimension>(
        &self,
        py: Python<'py>,
        shape: impl IntoDimension<Dim = D>,
        write: impl FnOnce(&mut sim::VectorSimulation, &mut [f64]) -> Result<(), VectorError> + Send,
    ) -> PyResult<Bound<'py, PyArray<f64, D>>> {
        let shape = shape.into_dimension();
        let mut numbers = vec![0.0; shape.size()];
        self.with(py, |worlds, _| write(worlds, &mut numbers))?.map_err(raised)?;
        PyArray1::from_vec(py, numbers).reshape(shape)
    }

    fn filled<T: Element + Copy>(py: Python<'_>, numbers: impl Iterator<Item = T>) -> Bound<'_, PyArray1<T>> {
        PyArray1::from_iter(py, numbers)
    }
}

#[pymethods]
impl VectorSimulation {
    /// Creates one world for each seed, at its start. `threads` is 0 for all. The worlds of an environment fly a policy
    /// in the place of the scenario's law, and go on to later seeds where a seed has no valid start.
    #[new]
    fn new(
        py: Python<'_>,
        scenario: &Scenario,
        seeds: Vec<u64>,
        threads: usize,
        autoreset: bool,
        is_environment: bool,
    ) -> PyResult<Self> {
        let request = &scenario.request;
        let seeds: Vec<_> = seeds.into_iter().map(seed_choice(is_environment)).collect();
        let workers = Workers::of(threads);
        let now = workers.now()?;
        let mut signals = Signals::new();
        let begin = || -> Result<_, PyErr> {
            let parsed = request.overrides.iter().map(|text| Override::parse(text)).collect::<Result<Vec<_>, _>>();
            let template = parsed.and_then(|parsed| Template::read(&request.source, &parsed));
            let template = template.map_err(tautline::scenario::ScenarioError::into_exception)?;
            if template.own() != &scenario.scenario {
                return Err(wrong_input(format!(
                    "{}: a file has changed since it was read; create a new Scenario",
                    request.argument
                )));
            }
            let policy = is_environment.then(|| ExternalLaw::new(Policy));
            let template = if policy.is_some() { template.with_external_law(policy) } else { template };
            let made = sim::VectorSimulation::with_seeds_while(template, &seeds, now, &mut || signals.are_silent());
            let mut worlds = made.map_err(raised)?;
            worlds.set_autoreset(autoreset);
            Ok(worlds)
        };
        let worlds = run_detached(py, begin)?;
        Self::of(py, signals.raised.map_or(worlds, Err)?, workers)
    }

    /// Returns an independent copy.
    fn copy(&self, py: Python<'_>) -> PyResult<Self> {
        let threads = match &self.threads {
            Workers::Shared => Workers::Shared,
            Workers::One => Workers::One,
            Workers::Own(pool) => Workers::Own(ProcessPool::new(pool.threads())),
        };
        Self::of(py, self.with(py, |worlds, _| worlds.clone())?, threads)
    }

    /// Largest number of worlds of a scenario.
    #[staticmethod]
    fn most_worlds(scenario: &Scenario) -> usize {
        sim::VectorSimulation::most_worlds(&scenario.scenario)
    }

    /// Flies a number of steps in every world, with these accelerations if given.
    fn step(&self, py: Python<'_>, commands: Option<&Bound<'_, PyAny>>, steps: u64) -> PyResult<()> {
        let given = commands.map(|given| self.take_commands(given)).transpose()?;
        let fly = |worlds: &mut sim::VectorSimulation, states: &mut StatesMut<'_>| {
            let mut signals = Signals::new();
            let flown = worlds.step_while(given.as_deref(), steps, states, &mut || signals.are_silent());
            (flown, signals.raised)
        };
        let (flown, raised_by_signal) = self.with(py, fly)?;
        raised_by_signal.map_or_else(|| flown.map_err(raised), Err)
    }

    /// Resets the chosen worlds, to these seeds if given, else to the next seed of each, and to the given positions and
    /// velocities, (E, N, 3). The worlds of an environment go on to later seeds where a seed has no valid start.
    fn reset(
        &self,
        py: Python<'_>,
        chosen: PyReadonlyArray1<'_, bool>,
        seeds: Option<Vec<Option<u64>>>,
        given: Option<(PyReadonlyArray3<'_, f64>, PyReadonlyArray3<'_, f64>)>,
        is_environment: bool,
    ) -> PyResult<()> {
        let chosen = copied_mask(chosen);
        let seed = |k: usize| seeds.as_ref().and_then(|seeds| seeds.get(k).copied().flatten());
        let choices: Vec<_> =
            (0..chosen.len()).map(|k| seed(k).map_or(SeedChoice::Next, seed_choice(is_environment))).collect();
        let given = given.map(|(p, v)| [p, v].map(|rows| rows.as_array().iter().copied().collect::<Vec<_>>()));
        let starts = given.as_ref().map(|[p, v]| GivenStarts { positions_m: p, velocities_m_s: v });
        let reset = |worlds: &mut sim::VectorSimulation, states: &mut StatesMut<'_>| {
            let mut signals = Signals::new();
            let reset = worlds.reset_while(&chosen, Some(&choices), starts, states, &mut || signals.are_silent());
            (reset, signals.raised)
        };
        let (reset, raised_by_signal) = self.with(py, reset)?;
        raised_by_signal.map_or_else(|| reset.map_err(raised), Err)
    }

    /// (E, N, 3) positions [m].
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        self.positions.bind(py).clone()
    }

    /// (E, N, 3) velocities [m/s].
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        self.velocities.bind(py).clone()
    }

    /// (E, N, 3) present slots [m].
    fn slots<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let [worlds, vehicles] = self.shape;
        self.written(py, [worlds, vehicles, 3], |worlds, slots_m| worlds.write_slots(slots_m))
    }

    /// Two arrays (E, N, 3): positions [m] and velocities [m/s] that the vehicles measure of themselves.
    fn measured<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray4<f64>>> {
        let [worlds, vehicles] = self.shape;
        self.written(py, [2, worlds, vehicles, 3], |worlds, states| {
            let (positions_m, velocities_m_s) = states.split_at_mut(states.len() / 2);
            worlds.write_measured(positions_m, velocities_m_s)
        })
    }

    /// (E, N, N, 3) positions [m] of vehicle j that vehicle i last received; NaN without a link.
    fn received<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray4<f64>>> {
        let [worlds, vehicles] = self.shape;
        self.written(py, [worlds, vehicles, vehicles, 3], sim::VectorSimulation::write_received)
    }

    /// (E, N, K, 3) vectors from each vehicle to the nearest point of each of K obstacles [m].
    fn obstacles<'py>(&self, py: Python<'py>, count: usize) -> PyResult<Bound<'py, PyArray4<f64>>> {
        let [worlds, vehicles] = self.shape;
        self.written(py, [worlds, vehicles, count, 3], |worlds, vectors_m| worlds.write_obstacles(vectors_m))
    }

    /// Numbers of the commands of each world under its shield, and of those that the shield changed; zeros without one.
    fn shield_counts(&self, py: Python<'_>) -> PyResult<Vec<(u64, u64)>> {
        self.each(py, |world| {
            let report = world.shield_report();
            report.map_or((0, 0), |report| (report.counters.commands, report.counters.changed))
        })
    }

    /// (E,) smallest clearances so far [m].
    #[getter]
    fn least_clearance_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.least_clearance_m.bind(py).clone()
    }

    /// (E,) whether each world has ended.
    #[getter]
    fn is_over<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.is_over.bind(py).clone()
    }

    /// (E,) seeds.
    #[getter]
    fn seeds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u64>>> {
        Ok(Self::filled(py, self.with(py, |worlds, _| worlds.seeds().collect::<Vec<_>>())?.into_iter()))
    }

    /// (E,) times flown [s].
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(Self::filled(py, self.each(py, sim::Simulation::time_s)?.into_iter()))
    }

    /// (E,) whole steps flown.
    #[getter]
    fn steps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u64>>> {
        Ok(Self::filled(py, self.each(py, sim::Simulation::steps)?.into_iter()))
    }

    /// `completed` or the reason of an early end of each world; None before the end.
    #[getter]
    fn endings(&self, py: Python<'_>) -> PyResult<Vec<Option<String>>> {
        let reason = |ending: &sim::Ending| ending.reason().unwrap_or_else(|| "completed".to_owned());
        self.each(py, |world| world.ending().map(reason))
    }

    /// Verdicts of the chosen worlds: so far, or of the whole flight after its end.
    fn statuses(&self, py: Python<'_>, chosen: PyReadonlyArray1<'_, bool>) -> PyResult<Vec<Option<&'static str>>> {
        let chosen = copied_mask(chosen);
        let judge = |world: &sim::Simulation| {
            let (flight, is_over) = (world.clone().finish(), world.ending().is_some());
            if is_over { flight.status() } else { flight.status_so_far() }.name()
        };
        let judge_all = |worlds: &mut sim::VectorSimulation, _: &mut StatesMut<'_>| {
            let places = chosen.iter().enumerate().take(worlds.count());
            places.map(|(k, chosen)| chosen.then(|| judge(worlds.world(k)))).collect()
        };
        self.with(py, judge_all)
    }

    /// Returns an independent copy of a world.
    fn world(&self, py: Python<'_>, world: usize) -> PyResult<Simulation> {
        let copy = |worlds: &mut sim::VectorSimulation, _: &mut StatesMut<'_>| {
            (world < worlds.count()).then(|| worlds.world(world).clone())
        };
        let of = self.shape[0];
        let missing = || wrong_input(format!("world: must be below {of}, the number of worlds, got {world}"));
        Ok(Simulation::of_world(self.with(py, copy)?.ok_or_else(missing)?))
    }
}

impl VectorSimulation {
    /// Returns a value of each world.
    fn each<T: Send>(&self, py: Python<'_>, of: impl Fn(&sim::Simulation) -> T + Send + Sync) -> PyResult<Vec<T>> {
        self.with(py, |worlds, _| (0..worlds.count()).map(|k| of(worlds.world(k))).collect())
    }
}

/// Law of the worlds of an environment, which give all commands themselves.
#[derive(Clone)]
struct Policy;

impl Law for Policy {
    fn name(&self) -> &'static str {
        "policy"
    }

    fn command(&mut self, _at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        command.fill(0.0);
        Ok(())
    }
}

fn seed_choice(is_environment: bool) -> fn(u64) -> SeedChoice {
    if is_environment { SeedChoice::From } else { SeedChoice::Exactly }
}

/// Returns a copy of a mask, and ends the loan of its array: the mask may be `is_over` itself.
#[expect(clippy::needless_pass_by_value, reason = "ends the loan")]
fn copied_mask(mask: PyReadonlyArray1<'_, bool>) -> Vec<bool> {
    mask.as_array().to_vec()
}

/// Returns the numbers of an array (E, N, 3) or (E, N, 2), vehicle by vehicle; the third axis of the latter is 0.
fn copied<T: Element + Copy + Into<f64>>(given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = given.cast::<PyArray<T, Ix3>>()?;
    let array = array.try_readonly().map_err(|error| wrong_input(format!("u: {error}; give a copy")))?;
    let view: ArrayView3<'_, T> = array.as_array();
    if let (Some(numbers), 3) = (view.as_slice(), view.shape()[2]) {
        return Ok(numbers.iter().map(|&x| x.into()).collect());
    }
    let vehicles = view.rows().into_iter();
    Ok(vehicles.flat_map(|row| (0..3).map(move |axis| row.get(axis).map_or(0.0, |&x| x.into()))).collect())
}

/// Returns the exception of an error.
fn raised(error: VectorError) -> PyErr {
    let text = error.to_string();
    match error {
        VectorError::Seed { why, .. } | VectorError::Start { why, .. } | VectorError::NoSeed { why, .. } => {
            wrong_input_with_code(why.code(), text)
        }
        VectorError::Sim(why) => why.into_exception(),
        _ => wrong_input(text),
    }
}
