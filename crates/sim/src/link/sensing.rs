//! `[sensing]`: measurements of the own state and of near vehicles, with latency, rate and errors.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::history::History;
use super::noise::{Noise, NoiseSource};
use super::{ImperfectionSpec, latency};
use crate::scenario::{ErrorKind, Scenario, ScenarioError, is_default};
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_laws::law::VoidReason;
use tautline_laws::observation::NeighbourState;

/// Measurements of the vehicles: exact, without latency and in continuous time unless given.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensingSpec {
    /// Standard deviation in m, along each axis, of the error of a measured position, drawn for each measurement
    /// (motion capture 0.001, ultra-wide band 0.1, satellites 1). Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub position_noise_m: f64,
    /// Standard deviation in m, along each axis, of a constant error of the own position, drawn once a flight.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub position_bias_m: f64,
    /// Standard deviation in m/s, along each axis, of the error of a measured velocity, drawn for each measurement.
    /// Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub velocity_noise_m_s: f64,
    /// Measurements a second in Hz, held in between; continuous unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rate_hz: Option<f64>,
    /// Delay of each measurement in s, of the own state and of other vehicles.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub latency_s: f64,
    /// Delay of measurements of near vehicles by a sensor on board in s; `latency_s` unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub near_latency_s: Option<f64>,
}

impl SensingSpec {
    /// Returns whether measurements have errors.
    #[must_use]
    pub fn is_noisy(&self) -> bool {
        self.position_noise_m > 0.0 || self.velocity_noise_m_s > 0.0 || self.position_bias_m > 0.0
    }

    /// Returns the delay of measurements of near vehicles \[s\].
    #[must_use]
    pub fn near_s(&self) -> f64 {
        self.near_latency_s.unwrap_or(self.latency_s)
    }
}

impl ImperfectionSpec for SensingSpec {
    fn is_exact(&self) -> bool {
        *self == Self::default() || (Self { near_latency_s: None, ..*self } == Self::default() && self.near_s() == 0.0)
    }

    fn is_random(&self) -> bool {
        self.is_noisy()
    }

    fn check(&self, scenario: &Scenario) -> Result<(), ScenarioError> {
        let SensingSpec { rate_hz, latency_s, near_latency_s, .. } = *self;
        let noises = [
            ("sensing.position_noise_m", "the error of a measured position", self.position_noise_m),
            ("sensing.velocity_noise_m_s", "the error of a measured velocity", self.velocity_noise_m_s),
        ];
        for (key, what, noise) in noises {
            if noise > 0.0 && rate_hz.is_none() {
                let problem = format!("{what} needs a rate of measurements");
                let help = "set sensing.rate_hz, such as 100";
                return Err(ErrorKind::MissingKey.at(&[key], problem, help));
            }
        }
        if rate_hz.is_some() {
            scenario.check_sampled("sensing.rate_hz")?;
        }
        latency("sensing.latency_s", "the latency of measurements", latency_s, scenario.time.duration_s)?;
        let near = "the latency of measurements of near vehicles";
        latency("sensing.near_latency_s", near, near_latency_s.unwrap_or(0.0), scenario.time.duration_s).map(|_| ())
    }

    fn voids(&self) -> Vec<VoidReason> {
        let is_late = self.latency_s > 0.0 || self.near_s() > 0.0 || self.rate_hz.is_some();
        let voids = [(is_late, VoidReason::SensingDelayed), (self.is_noisy(), VoidReason::SensingInexact)];
        voids.into_iter().filter_map(|(is_void, void)| is_void.then_some(void)).collect()
    }
}

/// Tolerance of equal instants \[s\]: a millionth of the shortest period, and more than the rounding of times of a
/// flight.
pub(super) const SAME_S: f64 = 1e-9;

/// Returns the number of the current period of a rate that began at time 0; 0 also before it.
pub(crate) fn period(time_s: f64, rate_hz: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 0; a flight is bounded")]
    let number = ((time_s + SAME_S) * rate_hz).floor().max(0.0) as u64;
    number
}

/// Sensor: the times of its measurements and their errors.
#[derive(Clone, Debug)]
pub(super) struct Sensor {
    rate_hz: Option<f64>,
    latency_s: f64,
    /// Standard deviations of errors along each axis \[m\] and \[m/s\].
    position_m: f64,
    velocity_m_s: f64,
    axes: usize,
    noise: Noise,
    /// Number of the held measurement.
    held: Option<u64>,
}

impl Sensor {
    fn new(scenario: &Scenario, latency_s: f64, source: NoiseSource) -> Self {
        let SensingSpec { rate_hz, position_noise_m, velocity_noise_m_s, .. } = scenario.sensing;
        Self {
            rate_hz,
            latency_s,
            position_m: position_noise_m,
            velocity_m_s: velocity_noise_m_s,
            axes: scenario.space.dimensions(),
            noise: Noise::new(scenario.noise_seed, source),
            held: None,
        }
    }

    /// Returns the latency \[s\].
    pub(super) fn latency_s(&self) -> f64 {
        self.latency_s
    }

    /// Returns the required length of the history \[s\].
    pub(super) fn span_s(&self) -> f64 {
        self.latency_s + self.rate_hz.map_or(0.0, |rate_hz| 1.0 / rate_hz) + SAME_S
    }

    /// Returns the time of the measurement that is available at a time \[s\], and its number.
    fn latest(&self, time_s: f64) -> (f64, u64) {
        let late_s = (time_s - self.latency_s).max(0.0);
        self.rate_hz.map_or((late_s, 0), |rate_hz| {
            let number = period(late_s, rate_hz);
            (number as f64 / rate_hz, number)
        })
    }

    /// Holds the measurement that is available at a time \[s\]. Returns whether it is another one than before.
    fn hold_latest(&mut self, time_s: f64) -> bool {
        let number = self.rate_hz.map(|_| self.latest(time_s).1);
        number.is_none() || std::mem::replace(&mut self.held, number) != number
    }

    /// Drops measurements made after a time \[s\].
    pub(super) fn forget_after(&mut self, time_s: f64) {
        let (_, number) = self.latest(time_s);
        self.held = self.held.filter(|&held| held <= number);
    }

    /// Returns the errors of position \[m\] and velocity \[m/s\] of a measurement by a vehicle of another; zero for an
    /// exact sensor.
    fn errors(&self, vehicle: usize, other: usize, number: u64) -> (Vector3<f64>, Vector3<f64>) {
        if !self.is_noisy() {
            return (Vector3::zeros(), Vector3::zeros());
        }
        let normals = self.noise.draw(vehicle, other, number, 6).six_normals();
        let along = |from: usize, deviation: f64| {
            Vector3::from_fn(|axis, _| if axis < self.axes { deviation * normals[from + axis] } else { 0.0 })
        };
        (along(0, self.position_m), along(3, self.velocity_m_s))
    }

    fn is_noisy(&self) -> bool {
        self.position_m != 0.0 || self.velocity_m_s != 0.0
    }
}

/// Vehicles' measurements of themselves.
#[derive(Clone, Debug)]
pub(super) struct StateSensor {
    pub(super) sensor: Sensor,
    /// Constant errors, N x 3 \[m\].
    bias_m: Rows,
    is_biased: bool,
}

impl StateSensor {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let SensingSpec { latency_s, position_bias_m, .. } = scenario.sensing;
        let mut bias_m = Rows::zeros(scenario.count());
        let bias = Sensor::new(scenario, 0.0, NoiseSource::Bias);
        let bias = Sensor { position_m: position_bias_m, velocity_m_s: 0.0, ..bias };
        (0..scenario.count()).for_each(|vehicle| set_row(&mut bias_m, vehicle, bias.errors(vehicle, 0, 0).0));
        let sensor = Sensor::new(scenario, latency_s, NoiseSource::Own);
        Self { sensor, bias_m, is_biased: position_bias_m > 0.0 }
    }

    /// Changes the seed of later measurements; the held measurement and constant errors stay.
    pub(super) fn reseed(&mut self, seed: u64) {
        self.sensor.noise.reseed(seed, self.sensor.held.unwrap_or_default());
    }

    /// Returns whether vehicles know their true present state.
    pub(super) fn is_exact(&self) -> bool {
        self.sensor.rate_hz.is_none() && self.sensor.latency_s == 0.0 && !self.has_errors()
    }

    /// Returns whether measurements have errors.
    fn has_errors(&self) -> bool {
        self.sensor.is_noisy() || self.is_biased
    }

    /// Returns the time of the measurement that is available at a time \[s\].
    pub(super) fn measured_s(&self, time_s: f64) -> f64 {
        self.sensor.latest(time_s).0
    }

    /// Updates `known` to the present measurement. `known` must hold the result of the previous call.
    pub(super) fn update(&mut self, history: &History, time_s: f64, now: &Swarm, known: &mut Swarm) {
        if self.sensor.hold_latest(time_s) {
            self.measure(history, time_s, Some(now), known);
        }
    }

    /// Writes the measurement that is available at a present or past time; `now` is the state at that time if it is the
    /// present.
    pub(super) fn measure(&self, history: &History, time_s: f64, now: Option<&Swarm>, known: &mut Swarm) {
        let (measured_s, number) = self.sensor.latest(time_s);
        read_state(history, measured_s, now.filter(|_| measured_s >= time_s), known);
        if !self.has_errors() {
            return;
        }
        for vehicle in 0..known.count() {
            let (off_m, off_m_s) = self.sensor.errors(vehicle, 0, number);
            let position_m = row(&known.positions_m, vehicle) + row(&self.bias_m, vehicle) + off_m;
            let velocity_m_s = row(&known.velocities_m_s, vehicle) + off_m_s;
            set_row(&mut known.positions_m, vehicle, position_m);
            set_row(&mut known.velocities_m_s, vehicle, velocity_m_s);
        }
    }
}

/// Writes the state at a present or past time.
fn read_state(history: &History, time_s: f64, now: Option<&Swarm>, state: &mut Swarm) {
    match now {
        Some(now) => state.copy_from(now),
        None => history.at(time_s, state),
    }
}

/// Vehicles' measurements of near vehicles with a sensor on board: relative position, and velocity.
///
/// Errors of the observer's own position do not enter. Errors have the standard deviations of its own measurements,
/// drawn for each observed vehicle.
#[derive(Clone, Debug)]
pub(super) struct RelativeSensor {
    pub(super) sensor: Sensor,
    /// Measured true state, and the number of the measurement.
    sensed: Swarm,
    number: u64,
    age_s: f64,
    /// Whether vehicles measure each other at their own measured states.
    uses_own_measurements: bool,
}

impl RelativeSensor {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let sensing = scenario.sensing;
        Self {
            sensor: Sensor::new(scenario, sensing.near_s(), NoiseSource::RelativeSensor),
            sensed: scenario.start.clone(),
            number: 0,
            age_s: 0.0,
            uses_own_measurements: !sensing.is_noisy() && sensing.near_s() == sensing.latency_s,
        }
    }

    /// Changes the seed of later measurements.
    pub(super) fn reseed(&mut self, seed: u64) {
        self.sensor.noise.reseed(seed, self.number);
    }

    /// Returns whether vehicles measure each other at their own measured states.
    pub(super) fn uses_own_measurements(&self) -> bool {
        self.uses_own_measurements
    }

    /// Returns the true positions at the time of the measurement \[m\].
    pub(super) fn true_positions_m(&self) -> &Rows {
        &self.sensed.positions_m
    }

    /// Measures at a time at which the true state is `now`.
    pub(super) fn measure(&mut self, history: &History, time_s: f64, now: &Swarm) {
        let (seen_s, number) = self.sensor.latest(time_s);
        if self.sensor.hold_latest(time_s) {
            read_state(history, seen_s, Some(now).filter(|_| seen_s >= time_s), &mut self.sensed);
        }
        (self.number, self.age_s) = (number, time_s - seen_s);
    }

    /// Returns the measurement of vehicle `j` by vehicle `i`, whose own measurement is its row of `own`.
    pub(super) fn of(&self, own: &Swarm, i: usize, j: usize) -> NeighbourState {
        let sensed = NeighbourState::of(&self.sensed, j, self.age_s);
        if self.uses_own_measurements {
            return sensed;
        }
        let from = NeighbourState::of(&self.sensed, i, 0.0);
        let (off_m, off_m_s) = self.sensor.errors(i, j, self.number);
        NeighbourState {
            position_m: row(&own.positions_m, i) + (sensed.position_m - from.position_m) + off_m,
            velocity_m_s: row(&own.velocities_m_s, i) + (sensed.velocity_m_s - from.velocity_m_s) + off_m_s,
            age_s: self.age_s,
        }
    }
}
