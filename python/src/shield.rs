//! Shields for vehicles and simulators outside of the product.

use numpy::ndarray::ArrayView2;
use numpy::{PyArray2, PyReadonlyArray2, ToPyArray as _};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use tautline::shield::{Counters, Fleet, Message, Settings, Shield as VehicleShield, State};

use crate::errors::{internal_error, wrong_input, wrong_input_with_code};

/// Shields of all vehicles, or of one of them.
#[pyclass(module = "tautline._native")]
pub(crate) struct Shield {
    shields: Vec<VehicleShield>,
    count: usize,
}

fn state(positions_m: &ArrayView2<'_, f64>, velocities_m_s: &ArrayView2<'_, f64>, i: usize) -> State {
    State { position_m: vector(positions_m, i).into(), velocity_m_s: vector(velocities_m_s, i).into() }
}

fn vector(rows: &ArrayView2<'_, f64>, i: usize) -> [f64; 3] {
    [rows[(i, 0)], rows[(i, 1)], rows[(i, 2)]]
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
        "actuator_lag_s" => settings.actuator_lag_s = value,
        "tracking_error_m" => settings.tracking_error_m = Some(value),
        "path_error_m" => settings.path_error_m = value,
        "ease_m" => settings.ease_m = Some(value),
        "turn" => settings.turn = value,
        _ => return Err(internal_error(&format!("unknown setting {name}"))),
    }
    Ok(())
}

#[pymethods]
impl Shield {
    /// Creates the shields of vehicles at their starts: of all, or of the vehicle `index`.
    #[new]
    fn new(
        positions_m: PyReadonlyArray2<'_, f64>,
        velocities_m_s: PyReadonlyArray2<'_, f64>,
        delta_m: f64,
        period_s: f64,
        delay_periods: usize,
        others: Vec<(String, f64)>,
        index: Option<usize>,
    ) -> PyResult<Self> {
        let mut settings = Settings { measurement_delay_periods: delay_periods, ..Settings::new(delta_m, period_s) };
        others.iter().try_for_each(|(name, value)| set(&mut settings, name, *value))?;
        let refused = |error: &dyn std::fmt::Display| wrong_input_with_code("shield/refused", error.to_string());
        let limits = settings.limits().map_err(|error| refused(&error))?;
        let (positions_m, velocities_m_s) = (positions_m.as_array(), velocities_m_s.as_array());
        let count = positions_m.shape()[0];
        let states: Vec<_> = (0..count).map(|i| state(&positions_m, &velocities_m_s, i)).collect();
        let shields = match index {
            None => Fleet::new(&vec![limits; count], &states).map_err(|error| refused(&error))?.shields().to_vec(),
            Some(index) => {
                let starts = states.into_iter().map(|state| limits.start(state)).collect::<Result<Vec<_>, _>>();
                let starts = starts.map_err(|error| refused(&error))?;
                vec![VehicleShield::new(&limits, index, &starts).map_err(|error| refused(&error))?]
            }
        };
        Ok(Self { shields, count })
    }

    /// Returns the commands for the next period, a row for each shield.
    fn filter<'py>(
        &mut self,
        py: Python<'py>,
        positions_m: PyReadonlyArray2<'_, f64>,
        velocities_m_s: PyReadonlyArray2<'_, f64>,
        wanted_m_s2: PyReadonlyArray2<'_, f64>,
    ) -> Bound<'py, PyArray2<f64>> {
        let (positions, velocities) = (positions_m.as_array(), velocities_m_s.as_array());
        let mut commands = wanted_m_s2.as_array().to_owned();
        for (i, shield) in self.shields.iter_mut().enumerate() {
            let command = shield.filter(state(&positions, &velocities, i), vector(&wanted_m_s2.as_array(), i).into());
            (0..3).for_each(|axis| commands[(i, axis)] = command[axis]);
        }
        commands.to_pyarray(py)
    }

    /// Gives each message of a shield to its receiver, except the lost ones, N x N by sender and receiver.
    fn exchange(&mut self, lost: Option<PyReadonlyArray2<'_, bool>>) {
        let lost = lost.as_ref().map(PyReadonlyArray2::as_array);
        for sender in 0..self.shields.len() {
            let messages: Vec<_> = self.shields[sender].messages().collect();
            for message in messages {
                let receiver = message.to as usize;
                if lost.is_none_or(|lost| !lost[(sender, receiver)]) {
                    self.shields[receiver].hear(&message);
                }
            }
        }
    }

    /// Takes the messages to send after `filter`, each with its receiver.
    fn messages<'py>(&mut self, py: Python<'py>) -> PyResult<Vec<(u32, Bound<'py, PyBytes>)>> {
        let messages = self.shields.iter_mut().flat_map(VehicleShield::messages);
        let packed = messages.map(|message| {
            let bytes = serde_json::to_vec(&message).map_err(|error| internal_error(&error.to_string()))?;
            Ok((message.to, PyBytes::new(py, &bytes)))
        });
        packed.collect()
    }

    /// Takes a message that arrived.
    fn hear(&mut self, message: &[u8]) -> PyResult<()> {
        let message: Message = serde_json::from_slice(message)
            .map_err(|error| wrong_input(format!("message: {error}; give the bytes that `messages` returned")))?;
        self.shields.iter_mut().for_each(|shield| shield.hear(&message));
        Ok(())
    }

    /// Number of vehicles.
    #[getter]
    fn count(&self) -> usize {
        self.count
    }

    /// Certificate in words.
    #[getter]
    fn certificate(&self) -> String {
        self.shields.first().map(|shield| shield.limits().certificate()).unwrap_or_default()
    }

    /// Bound on the distance to the reference [m].
    #[getter]
    fn tube_m(&self) -> f64 {
        self.shields.first().map_or(0.0, |shield| shield.limits().tube().error_m)
    }

    /// Numbers so far as JSON, and the assumption that did not hold.
    fn report(&self) -> PyResult<(String, Option<String>)> {
        let mut counters = Counters::default();
        self.shields.iter().for_each(|shield| counters.merge(shield.counters()));
        let json = serde_json::to_string(&counters).map_err(|error| internal_error(&error.to_string()))?;
        Ok((json, counters.exceeded().map(|exceeded| exceeded.to_string())))
    }
}
