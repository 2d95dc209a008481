//! Imperfections between true state and law: sensors and network before the law, actuators after it.
//!
//! Each imperfection is a file of this module. The file holds the table of the scenario, which implements
//! [`ImperfectionSpec`], and its simulation in flight. [`of`] combines all of them into one [`Imperfections`].
//! Without imperfections ([`NoImperfections`]), laws read the true state without a copy. docs/scenario.md has the
//! equations.
//!
//! Sensors measure and vehicles send at fixed times, which need not be the ends of steps. [`Imperfections::settle`]
//! makes the measurements and messages that are due. Each depends only on the seed, the vehicle and its sequence
//! number, and not on steps, trial states or threads.

mod actuation;
mod failure;
mod history;
mod messages;
mod network;
mod noise;
mod radio;
mod sensing;

pub use actuation::ActuationSpec;
pub use failure::{Failure, FailureKind};
pub use history::History;
pub use network::{LinkFailure, NearStates, NetworkSpec, StalePolicy};
pub(crate) use radio::{Radio, RadioUse, Round};
pub use sensing::SensingSpec;
pub(crate) use sensing::period;

use actuation::Actuation;
use dyn_clone::DynClone;
use failure::FailureEffects;
use network::Network;
use sensing::{RelativeSensor, StateSensor};
use serde::{Deserialize, Serialize};

use crate::scenario::{ErrorKind, Scenario, ScenarioError};
use tautline_core::record::Channel;
use tautline_core::swarm::{Rows, Swarm, row};
use tautline_laws::law::VoidReason;
use tautline_laws::observation::{NeighbourState, NeighbourStates, OtherStates};

/// A table of the scenario that describes an imperfection.
pub trait ImperfectionSpec {
    /// Returns whether the imperfection changes nothing.
    fn is_exact(&self) -> bool;

    /// Returns whether the flight depends on the seed of noise.
    fn is_random(&self) -> bool {
        false
    }

    /// Checks the imperfection against the other tables of the scenario.
    ///
    /// # Errors
    /// [`ScenarioError`] if the scenario cannot be flown with the imperfection.
    fn check(&self, scenario: &Scenario) -> Result<(), ScenarioError>;

    /// Returns the reasons why no certificate holds with the imperfection.
    fn voids(&self) -> Vec<VoidReason>;
}

impl Scenario {
    /// Returns the imperfections of the scenario. A new imperfection is added here and to [`of`].
    pub(crate) fn imperfections(&self) -> [&dyn ImperfectionSpec; 4] {
        [&self.sensing, &self.network, &self.actuation, &self.failures]
    }

    /// Returns whether the flight depends on the seed of noise.
    #[must_use]
    pub fn is_random_in_flight(&self) -> bool {
        self.wind.turbulence.is_some() || self.imperfections().iter().any(|imperfection| imperfection.is_random())
    }

    /// Returns whether vehicles know the true present state, and their accelerations are the commands.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.imperfections().iter().all(|imperfection| imperfection.is_exact())
    }

    /// Refuses a sampled imperfection if the plant evaluates the law in continuous time.
    fn check_sampled(&self, key: &'static str) -> Result<(), ScenarioError> {
        if self.plant.holds_commands() || self.time.control_hz.is_some() {
            return Ok(());
        }
        let problem = format!("{key} samples the state, but the ideal plant evaluates the law in continuous time");
        let help = "set time.control_hz, the rate of held commands, or set plant.kind to \"rapier\"";
        Err(ErrorKind::UnsupportedByPlant.at(&[key, "plant.kind"], problem, help))
    }
}

/// Noise, delay, loss and limits between true state and law. Turns the true state into the knowledge of the vehicles,
/// and the commands of the law into accelerations.
///
/// A saved simulation holds the whole memory of the link (filters, messages under way, random numbers), so an
/// implementation must be [`Clone`].
pub trait Imperfections: DynClone + Send {
    /// Returns the knowledge of the vehicles at a time \[s\] at which the true state is `truth`.
    ///
    /// In continuous time the integrator also calls this for trial states, in any order of time. Only states that
    /// [`Imperfections::accept`] receives are part of the flight.
    fn sense<'a>(&'a mut self, time_s: f64, truth: &'a Swarm) -> StateEstimates<'a>;

    /// Changes the commanded accelerations \[m/s^2\], N x 3, into those that reach the vehicles. Between two commands
    /// of the law, `_command` is the held command. Of two calls for the same instant the last counts.
    fn actuate(&mut self, _time_s: f64, _command: &mut Rows) {}

    /// As [`Imperfections::actuate`], for a command that begins at this time and is no continuation of earlier ones.
    fn actuate_anew(&mut self, time_s: f64, command: &mut Rows) {
        self.actuate(time_s, command);
    }

    /// Takes the next state of the flight, in the order of time.
    fn accept(&mut self, _time_s: f64, _truth: &Swarm) {}

    /// Drops the states that were accepted after this time: their step was refused.
    fn forget_after(&mut self, _time_s: f64) {}

    /// Makes the accepted states up to this time final, and all measurements and messages that are due by then.
    fn settle(&mut self, _time_s: f64) {}

    /// Returns whether every vehicle knows the true present state of all vehicles and commands arrive unchanged, as
    /// certificates assume.
    fn is_exact(&self) -> bool {
        false
    }

    /// Returns the longest solver step \[s\] in continuous time at which delayed states can be interpolated.
    fn longest_step_s(&self) -> f64 {
        f64::INFINITY
    }

    /// Returns the channels of the link, without values.
    fn channels(&self) -> Vec<Channel> {
        Vec::new()
    }

    /// Writes the present values into the channels of [`Imperfections::channels`], in the same order.
    fn write_channels(&self, _channels: &mut [Channel]) {}

    /// Returns the counts of messages, if the network sends single messages.
    fn traffic(&self) -> Option<Traffic> {
        None
    }

    /// Restarts the random numbers from another seed.
    fn reseed(&mut self, _seed: u64) {}
}

dyn_clone::clone_trait_object!(Imperfections);

/// Knowledge of the vehicles at one instant.
#[derive(Clone, Copy, Debug)]
pub struct StateEstimates<'a> {
    /// Knowledge of each vehicle of its own state.
    pub own: &'a Swarm,
    /// Knowledge of the vehicles of each other.
    pub others: OtherStates<'a>,
}

/// Messages of a network up to now.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Traffic {
    /// Number of messages, one for each receiver.
    pub sent: u64,
    /// Number of messages that never arrive.
    pub lost: u64,
    /// 95th percentile of the age of the last message of each link \[s\], with a relative error of a hundredth. Ages
    /// are taken whenever messages are sent.
    pub age_p95_s: Option<f64>,
}

/// A link without imperfections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoImperfections;

impl Imperfections for NoImperfections {
    fn sense<'a>(&'a mut self, _time_s: f64, truth: &'a Swarm) -> StateEstimates<'a> {
        StateEstimates { own: truth, others: OtherStates::Shared }
    }

    fn is_exact(&self) -> bool {
        true
    }
}

/// Smallest nonzero latency \[s\].
const SHORTEST_S: f64 = 1e-6;

/// Returns the latency if it is 0, or at least [`SHORTEST_S`] and at most the duration of the flight.
fn latency(key: &'static str, what: &str, latency_s: f64, duration_s: f64) -> Result<f64, ScenarioError> {
    if latency_s == 0.0 || (SHORTEST_S..=duration_s).contains(&latency_s) {
        return Ok(latency_s);
    }
    let (kind, said, help) = if latency_s < SHORTEST_S {
        (
            ErrorKind::OutOfRange,
            format!("{what} must be 0 or at least {SHORTEST_S} s, got {latency_s} s"),
            "give 0 for no latency",
        )
    } else {
        (
            ErrorKind::OutsideFlight,
            format!("{what} must be at most the {duration_s} s of the flight, got {latency_s} s"),
            "reduce the latency, or increase time.duration_s",
        )
    };
    Err(kind.at(&[key, "time.duration_s"], said, help))
}

/// Solver steps of continuous time within the shortest delay, so that the past is interpolated finely enough.
const STEPS_PER_DELAY: f64 = 8.0;

/// Returns the imperfections of a scenario, [`NoImperfections`] if it has none. `senses` is whether the law senses near
/// vehicles.
#[must_use]
pub fn of(scenario: &Scenario, senses: bool) -> Box<dyn Imperfections> {
    if scenario.is_exact() { Box::new(NoImperfections) } else { Box::new(ScenarioImperfections::new(scenario, senses)) }
}

/// Sensors, network and actuators of a scenario.
#[derive(Clone, Debug)]
struct ScenarioImperfections {
    history: History,
    sensing: StateSensor,
    relative_sensor: RelativeSensor,
    network: Network,
    actuation: Actuation,
    failures: FailureEffects,
    missing: StalePolicy,
    near: NearStates,
    /// Whether all vehicles use each sender's knowledge of its own state, without communication effects.
    is_shared: bool,
    /// Whether vehicles know their true present state.
    has_exact_own_state: bool,
    time_s: f64,
    own: Swarm,
    /// Bound on the difference between a separation in the law and the same separation in the search for near
    /// vehicles \[m\].
    slack_m: f64,
}

impl ScenarioImperfections {
    fn new(scenario: &Scenario, senses: bool) -> Self {
        let (sensing, relative_sensor) = (StateSensor::new(scenario), RelativeSensor::new(scenario));
        let network = Network::new(scenario, &sensing);
        let span_s = sensing.sensor.span_s().max(relative_sensor.sensor.span_s()) + scenario.network.latency_s;
        Self {
            history: History::new(span_s),
            is_shared: matches!(network, Network::None) && (!senses || relative_sensor.uses_own_measurements()),
            has_exact_own_state: sensing.is_exact(),
            sensing,
            relative_sensor,
            network,
            actuation: Actuation::new(scenario),
            failures: FailureEffects::new(scenario),
            missing: scenario.network.missing,
            near: scenario.network.near,
            time_s: 0.0,
            own: scenario.start.clone(),
            slack_m: 0.0,
        }
    }

    /// Extrapolates a received state to the time of the receiver's own measurement, unless states are held.
    fn extrapolated(&self, received: NeighbourState) -> NeighbourState {
        if self.missing == StalePolicy::Hold {
            return received;
        }
        let own_age_s = self.time_s - self.sensing.measured_s(self.time_s);
        let ahead_s = (received.age_s - own_age_s).max(0.0);
        NeighbourState { position_m: received.position_m + received.velocity_m_s * ahead_s, ..received }
    }

    /// Updates the slack. Near vehicles are searched for at true positions, but the law uses own positions as known
    /// and positions as received.
    fn update_slack(&mut self, truth: &Swarm) {
        let own = (0..self.own.count())
            .map(|i| (row(&self.own.positions_m, i) - row(&truth.positions_m, i)).norm())
            .fold(0.0, f64::max);
        let extrapolated = |received: NeighbourState| self.extrapolated(received);
        let others = self.network.largest_error_m(&truth.positions_m, extrapolated, self.time_s, own);
        self.slack_m = own + others;
    }
}

impl NeighbourStates for ScenarioImperfections {
    fn received(&self, i: usize, j: usize) -> NeighbourState {
        let received = self.network.received(i, j, self.time_s).map(|received| self.extrapolated(received));
        received.unwrap_or_else(|| NeighbourState::of(&self.own, j, self.time_s - self.sensing.measured_s(self.time_s)))
    }

    fn sensed(&self, i: usize, j: usize) -> NeighbourState {
        match self.near {
            NearStates::Sensed => self.relative_sensor.of(&self.own, i, j),
            NearStates::Received => self.received(i, j),
        }
    }

    fn matches_count(&self, count: usize) -> bool {
        self.own.count() == count
    }

    fn near_search_positions(&self) -> Option<(&Rows, f64)> {
        Some((self.relative_sensor.true_positions_m(), self.slack_m))
    }
}

impl Imperfections for ScenarioImperfections {
    fn sense<'a>(&'a mut self, time_s: f64, truth: &'a Swarm) -> StateEstimates<'a> {
        self.time_s = time_s;
        if self.is_shared {
            if self.has_exact_own_state {
                return StateEstimates { own: truth, others: OtherStates::Shared };
            }
            self.sensing.update(&self.history, time_s, truth, &mut self.own);
            return StateEstimates { own: &self.own, others: OtherStates::Shared };
        }
        self.sensing.update(&self.history, time_s, truth, &mut self.own);
        self.relative_sensor.measure(&self.history, time_s, truth);
        self.network.update(time_s, &self.sensing, &self.history);
        if self.near == NearStates::Received {
            // Sensed positions are the true ones here; the slack covers the difference to received positions.
            self.update_slack(truth);
        }
        StateEstimates { own: &self.own, others: OtherStates::PerVehicle(self) }
    }

    fn actuate(&mut self, time_s: f64, command: &mut Rows) {
        self.failures.act(time_s, command);
        self.actuation.act(time_s, command, false);
    }

    fn actuate_anew(&mut self, time_s: f64, command: &mut Rows) {
        self.failures.act(time_s, command);
        self.actuation.act(time_s, command, true);
    }

    fn accept(&mut self, time_s: f64, truth: &Swarm) {
        self.history.push(time_s, truth);
    }

    fn forget_after(&mut self, time_s: f64) {
        self.history.forget_after(time_s);
        self.sensing.sensor.forget_after(time_s);
        self.relative_sensor.sensor.forget_after(time_s);
    }

    fn settle(&mut self, time_s: f64) {
        self.network.settle(time_s, &self.sensing, &self.history);
        self.history.settle(time_s);
    }

    fn longest_step_s(&self) -> f64 {
        let received_s = self.network.delay_s().map_or(0.0, |delay_s| self.sensing.sensor.latency_s() + delay_s);
        let delays = [self.sensing.sensor.latency_s(), self.relative_sensor.sensor.latency_s(), received_s];
        let shortest_s = delays.into_iter().filter(|delay_s| *delay_s > 0.0).fold(f64::INFINITY, f64::min);
        shortest_s / STEPS_PER_DELAY
    }

    fn channels(&self) -> Vec<Channel> {
        self.network.channels()
    }

    fn write_channels(&self, channels: &mut [Channel]) {
        self.network.write_channels(self.time_s, self.own.count(), channels);
    }

    fn traffic(&self) -> Option<Traffic> {
        self.network.traffic()
    }

    fn reseed(&mut self, seed: u64) {
        self.sensing.reseed(seed);
        self.relative_sensor.reseed(seed);
        self.network.reseed(seed);
    }
}
