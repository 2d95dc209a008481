//! Shields for vehicles and simulators outside of the product.

use std::fmt::Display;

use numpy::ndarray::ArrayView2;
use numpy::{PyArray2, PyReadonlyArray2, ToPyArray as _};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use tautline::fact::Coded as _;
use tautline::shield::{Fleet, Limits, Message, SavedShield, Settings, Shield as VehicleShield, Start, State, Timing};

use crate::errors::{internal_error, wrong_input_with_code};

/// Shields of all vehicles, or of one of them.
#[pyclass(module = "tautline._native")]
pub(crate) struct Shield {
    shields: Shields,
    count: usize,
}

#[expect(clippy::large_enum_variant, reason = "one per object in Python")]
enum Shields {
    All(Fleet),
    One(VehicleShield),
}

impl Shields {
    fn get(&self) -> &[VehicleShield] {
        match self {
            Self::All(fleet) => fleet.shields(),
            Self::One(shield) => std::slice::from_ref(shield),
        }
    }

    fn get_mut(&mut self) -> &mut [VehicleShield] {
        match self {
            Self::All(fleet) => fleet.shields_mut(),
            Self::One(shield) => std::slice::from_mut(shield),
        }
    }
}

/// Settings with a safety distance, a period, a delay of measurements and missed instants, and others by name.
type Given = (f64, f64, [usize; 2], Vec<(String, f64)>);

/// Time since the last instant and age of the measurement \[s\]. `None` for the period.
type Times = (Option<f64>, f64);

fn limits((delta_m, period_s, [measurement_delay_periods, hang_periods], others): Given) -> PyResult<Limits> {
    let mut settings = Settings { measurement_delay_periods, hang_periods, ..Settings::new(delta_m, period_s) };
    others.iter().try_for_each(|(name, value)| set(&mut settings, name, *value))?;
    settings.limits().map_err(refused)
}

#[allow(clippy::needless_pass_by_value, reason = "for `map_err`")]
fn refused(error: impl Display) -> PyErr {
    wrong_input_with_code("shield/refused", error.to_string())
}

fn state(positions_m: &ArrayView2<'_, f64>, velocities_m_s: &ArrayView2<'_, f64>, i: usize) -> State {
    State { position_m: vector(positions_m, i).into(), velocity_m_s: vector(velocities_m_s, i).into() }
}

fn vector(rows: &ArrayView2<'_, f64>, i: usize) -> [f64; 3] {
    [rows[(i, 0)], rows[(i, 1)], rows[(i, 2)]]
}

/// Returns the times of an instant of a shield.
fn timing(shield: &VehicleShield, (elapsed_s, age_s): Times) -> Timing {
    Timing { elapsed_s: elapsed_s.unwrap_or(shield.limits().settings().period_s), age_s }
}

/// Sets a setting by its name.
fn set(settings: &mut Settings, name: &str, value: f64) -> PyResult<()> {
    match name {
        "accel_m_s2" => settings.accel_m_s2 = value,
        "brake_m_s2" => settings.brake_m_s2 = Some(value),
        "max_speed_m_s" => settings.max_speed_m_s = value,
        "position_error_m" => settings.position_error_m = value,
        "velocity_error_m_s" => settings.velocity_error_m_s = value,
        "disturbance_m_s2" => settings.disturbance_m_s2 = value,
        "a22_per_s" => settings.a22_per_s = value,
        "tracker_per_s2" => settings.tracker_per_s2 = value,
        "tracker_per_s" => settings.tracker_per_s = value,
        "period_tolerance" => settings.period_tolerance = value,
        "elapsed_error_s" => settings.elapsed_error_s = value,
        "measurement_age_s" => settings.measurement_age_s = value,
        "actuator_lag_s" => settings.actuator_lag_s = value,
        "tracking_error_m" => settings.tracking_error_m = Some(value),
        "path_error_m" => settings.path_error_m = value,
        "half_height_m" => settings.half_height_m = Some(value),
        "ease_m" => settings.ease_m = Some(value),
        "turn" => settings.turn = value,
        _ => return Err(internal_error(&format!("unknown setting {name}"))),
    }
    Ok(())
}

#[pymethods]
impl Shield {
    /// Creates the shields of all vehicles at their starts.
    #[new]
    fn new(
        positions_m: PyReadonlyArray2<'_, f64>,
        velocities_m_s: PyReadonlyArray2<'_, f64>,
        settings: Given,
    ) -> PyResult<Self> {
        let limits = limits(settings)?;
        let (positions_m, velocities_m_s) = (positions_m.as_array(), velocities_m_s.as_array());
        let count = positions_m.shape()[0];
        let states: Vec<_> = (0..count).map(|i| state(&positions_m, &velocities_m_s, i)).collect();
        let fleet = Fleet::new(&vec![limits; count], &states).map_err(refused)?;
        Ok(Self { shields: Shields::All(fleet), count })
    }

    /// Returns the bytes of the start of a vehicle.
    #[staticmethod]
    fn start<'py>(
        py: Python<'py>,
        position_m: PyReadonlyArray2<'_, f64>,
        velocity_m_s: PyReadonlyArray2<'_, f64>,
        flight: u64,
        settings: Given,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let start = limits(settings)?.start(state(&position_m.as_array(), &velocity_m_s.as_array(), 0));
        Ok(PyBytes::new(py, &start.map_err(refused)?.with_flight(flight).to_bytes()))
    }

    /// Creates the shield of the vehicle `index` among announced starts.
    #[staticmethod]
    fn of_starts(starts: Vec<Vec<u8>>, index: usize, settings: Given) -> PyResult<Self> {
        let limits = limits(settings)?;
        let read = starts
            .iter()
            .enumerate()
            .map(|(i, bytes)| Start::from_bytes(bytes).map_err(|error| refused(format!("starts[{i}]: {error}"))));
        let read = read.collect::<PyResult<Vec<_>>>()?;
        let shield = VehicleShield::new(&limits, index, &read).map_err(refused)?;
        Ok(Self { shields: Shields::One(shield), count: read.len() })
    }

    /// Returns the commands for the next period, a row for each shield.
    fn filter<'py>(
        &mut self,
        py: Python<'py>,
        positions_m: PyReadonlyArray2<'_, f64>,
        velocities_m_s: PyReadonlyArray2<'_, f64>,
        wanted_m_s2: PyReadonlyArray2<'_, f64>,
        times: Option<Times>,
    ) -> Bound<'py, PyArray2<f64>> {
        let (positions, velocities) = (positions_m.as_array(), velocities_m_s.as_array());
        let mut commands = wanted_m_s2.as_array().to_owned();
        for (i, shield) in self.shields.get_mut().iter_mut().enumerate() {
            let (measured, wanted) = (state(&positions, &velocities, i), vector(&wanted_m_s2.as_array(), i).into());
            let command = match times {
                None => shield.filter(measured, wanted),
                Some(times) => shield.filter_timed(measured, wanted, timing(shield, times)),
            };
            (0..3).for_each(|axis| commands[(i, axis)] = command[axis]);
        }
        commands.to_pyarray(py)
    }

    /// Returns the commands of the brake for the next period, a row for each shield.
    fn brake<'py>(
        &mut self,
        py: Python<'py>,
        positions_m: PyReadonlyArray2<'_, f64>,
        velocities_m_s: PyReadonlyArray2<'_, f64>,
        times: Option<Times>,
    ) -> Bound<'py, PyArray2<f64>> {
        let (positions, velocities) = (positions_m.as_array(), velocities_m_s.as_array());
        let mut commands = positions.to_owned();
        for (i, shield) in self.shields.get_mut().iter_mut().enumerate() {
            let measured = state(&positions, &velocities, i);
            let command = match times {
                None => shield.brake(measured),
                Some(times) => shield.brake_timed(measured, timing(shield, times)),
            };
            (0..3).for_each(|axis| commands[(i, axis)] = command[axis]);
        }
        commands.to_pyarray(py)
    }

    /// Gives each message of a shield to its receiver, except the lost ones, N x N by sender and receiver.
    fn exchange(&mut self, lost: Option<PyReadonlyArray2<'_, bool>>) {
        let lost = lost.as_ref().map(PyReadonlyArray2::as_array);
        let shields = self.shields.get_mut();
        for sender in 0..shields.len() {
            let messages: Vec<_> = shields[sender].messages().collect();
            for message in messages {
                let receiver = usize::from(message.to);
                if lost.is_none_or(|lost| !lost[(sender, receiver)]) {
                    // As over a radio, so that shields of one vehicle each get the same numbers.
                    shields[receiver].hear_bytes(&message.to_bytes());
                }
            }
        }
    }

    /// Takes the messages to send after `filter`, each with its receiver.
    fn messages<'py>(&mut self, py: Python<'py>) -> Vec<(u16, Bound<'py, PyBytes>)> {
        let messages = self.shields.get_mut().iter_mut().flat_map(VehicleShield::messages);
        messages.map(|message: Message| (message.to, PyBytes::new(py, &message.to_bytes()))).collect()
    }

    /// Takes a message that arrived. Other bytes are dropped and counted.
    fn hear(&mut self, message: &[u8]) {
        self.shields.get_mut().iter_mut().for_each(|shield| shield.hear_bytes(message));
    }

    /// Records true states, `since_s` after the last commands.
    fn observe(
        &mut self,
        positions_m: PyReadonlyArray2<'_, f64>,
        velocities_m_s: PyReadonlyArray2<'_, f64>,
        since_s: f64,
    ) {
        let (positions, velocities) = (positions_m.as_array(), velocities_m_s.as_array());
        for (i, shield) in self.shields.get_mut().iter_mut().enumerate() {
            shield.observe(since_s, &state(&positions, &velocities, i));
        }
    }

    /// Records measurements and the true states that they measured.
    fn observe_measurement(
        &mut self,
        positions_m: PyReadonlyArray2<'_, f64>,
        velocities_m_s: PyReadonlyArray2<'_, f64>,
        true_positions_m: PyReadonlyArray2<'_, f64>,
        true_velocities_m_s: PyReadonlyArray2<'_, f64>,
    ) {
        let measured = (positions_m.as_array(), velocities_m_s.as_array());
        let truth = (true_positions_m.as_array(), true_velocities_m_s.as_array());
        for (i, shield) in self.shields.get_mut().iter_mut().enumerate() {
            shield.observe_measurement(&state(&measured.0, &measured.1, i), &state(&truth.0, &truth.1, i));
        }
    }

    /// Number of vehicles.
    #[getter]
    fn count(&self) -> usize {
        self.count
    }

    /// Certificate in words.
    #[getter]
    fn certificate(&self) -> String {
        self.shields.get().first().map(|shield| shield.limits().certificate()).unwrap_or_default()
    }

    /// Bound on the distance to the reference [m].
    #[getter]
    fn tube_m(&self) -> f64 {
        self.shields.get().first().map_or(0.0, |shield| shield.limits().tube().error_m)
    }

    /// Numbers so far and assumptions as JSON; text and code of the assumption that did not hold.
    #[allow(clippy::type_complexity)]
    fn report(&self) -> PyResult<(String, String, Option<(String, &'static str)>)> {
        let (counters, assumptions) = match &self.shields {
            Shields::All(fleet) => (fleet.report(), fleet.assumptions()),
            Shields::One(shield) => (*shield.counters(), shield.assumptions()),
        };
        let internal = |error: serde_json::Error| internal_error(&error.to_string());
        let exceeded = counters.exceeded().map(|exceeded| (exceeded.to_string(), exceeded.code()));
        let counters = serde_json::to_string(&counters).map_err(internal)?;
        Ok((counters, serde_json::to_string(&assumptions).map_err(internal)?, exceeded))
    }

    /// Returns a shield that continues from saved data.
    #[staticmethod]
    fn load(saved: &[u8]) -> PyResult<Self> {
        let wrong = |error: serde_json::Error| refused(format!("saved: {error}; give unaltered data"));
        let (is_fleet, saved): (bool, Vec<SavedShield>) = serde_json::from_slice(saved).map_err(wrong)?;
        let fleet = Fleet::load(&saved).map_err(refused)?;
        let count = saved.first().map_or(0, SavedShield::vehicles);
        let first = fleet.shields().first().filter(|_| !is_fleet).cloned();
        Ok(Self { shields: first.map_or(Shields::All(fleet), Shields::One), count })
    }

    /// Returns the state of the shield, for `load`.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let saved: Option<Vec<_>> = self.shields.get().iter().map(VehicleShield::save).collect();
        let saved = saved.ok_or_else(|| internal_error("a shield with obstacles"))?;
        let is_fleet = matches!(self.shields, Shields::All(_));
        let json = serde_json::to_vec(&(is_fleet, saved)).map_err(|error| internal_error(&error.to_string()))?;
        Ok(PyBytes::new(py, &json))
    }
}
