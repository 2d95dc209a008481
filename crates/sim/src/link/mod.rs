//! What lies between the true world and the laws: sensors and network on the way in, actuators on the way out.
//!
//! An imperfection is a file here: its table of the scenario, which checks itself and names what it voids
//! ([`ImperfectionSpec`]), and its part of the link. [`of`] combines the parts into one [`Imperfections`]. [`Direct`] has
//! none: laws see the true state itself, and nothing is copied. docs/imperfections.md has the equations.
//!
//! Whatever happens at instants of its own (measurements, messages) happens when the flight has come to them
//! ([`Imperfections::settle`]). It depends on the seed, the vehicle and the number of the event alone: not on steps, on trial
//! states, or on threads.

mod actuation;
mod failure;
mod history;
mod messages;
mod network;
mod noise;
mod sensing;
mod world;

use dyn_clone::DynClone;
use serde::{Deserialize, Serialize};

pub use actuation::ActuationSpec;
pub use failure::{Failure, FailureKind};
pub use history::History;
pub use network::{LinkFailure, Missing, NearBy, NetworkSpec};
pub use sensing::SensingSpec;
pub use world::of;

use crate::scenario::{Scenario, ScenarioError};
use tautline_core::record::Channel;
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::law::Void;
use tautline_laws::observation::Others;

/// A table of the scenario that describes an imperfection.
pub trait ImperfectionSpec {
    /// Whether it changes nothing.
    fn is_exact(&self) -> bool;

    /// Whether another seed of noise gives another flight.
    fn is_random(&self) -> bool {
        false
    }

    /// Checks it against the other tables of the scenario.
    ///
    /// # Errors
    /// [`ScenarioError`] where the scenario cannot be flown with it.
    fn check(&self, scenario: &Scenario) -> Result<(), ScenarioError>;

    /// The reasons for which no certificate holds with it.
    fn voids(&self) -> Vec<Void>;
}

impl Scenario {
    /// The imperfections of the scenario: what adds one adds it here, and to [`of`].
    pub(crate) fn imperfections(&self) -> [&dyn ImperfectionSpec; 4] {
        [&self.sensing, &self.network, &self.actuation, &self.failures]
    }

    /// Whether another seed of noise gives another flight.
    #[must_use]
    pub fn is_random_in_flight(&self) -> bool {
        self.wind.turbulence.is_some() || self.imperfections().iter().any(|imperfection| imperfection.is_random())
    }

    /// Whether vehicles know the true present state, and are accelerated as they are commanded.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.imperfections().iter().all(|imperfection| imperfection.is_exact())
    }

    /// Refuses what happens at instants of its own where time is continuous.
    fn check_sampled(&self, key: &'static str) -> Result<(), ScenarioError> {
        if self.plant.holds_commands() || self.time.control_hz.is_some() {
            return Ok(());
        }
        Err(ScenarioError::new(format!(
            "{key} makes what is known jump, and the ideal plant asks the law in continuous time, where nothing does"
        ))
        .coded("scenario/unsupported-by-plant")
        .with_help("set time.control_hz, at which commands are made and held, or plant.kind to \"rapier\"")
        .at(key)
        .at("plant.kind"))
    }
}

/// Turns the true state into what the vehicles know, and the commands of the law into accelerations: noise, delay, loss and
/// limits.
///
/// All of its memory (filters, messages under way, random numbers) is saved with a simulation, so it must be [`Clone`].
pub trait Imperfections: DynClone + Send {
    /// What the vehicles know at a time \[s\] at which the true state is `truth`.
    ///
    /// In continuous time this is asked about trial states too, in any order of time; only what [`Imperfections::accept`] is told
    /// has happened.
    fn sense<'a>(&'a mut self, time_s: f64, truth: &'a Swarm) -> Sensed<'a>;

    /// Changes the commanded accelerations \[m/s^2\], N x 3, into those that reach the vehicles. At instants of a flight
    /// at which no command is made this is told the one that is held; it may be told two at the same instant, of which the
    /// last counts.
    fn actuate(&mut self, _time_s: f64, _command: &mut Rows) {}

    /// The swarm has come to this state, in the order of time.
    fn accept(&mut self, _time_s: f64, _truth: &Swarm) {}

    /// What was accepted after this time has not happened: a step was refused.
    fn forget_after(&mut self, _time_s: f64) {}

    /// What was accepted up to this time stays.
    fn settle(&mut self, _time_s: f64) {}

    /// Whether every vehicle knows the true present state of all, and commands arrive as given: what certificates assume.
    fn is_exact(&self) -> bool {
        false
    }

    /// Longest step of continuous time that its memory allows \[s\].
    fn longest_step_s(&self) -> f64 {
        f64::INFINITY
    }

    /// What is known of it for every vehicle: a channel each, without values yet.
    fn channels(&self) -> Vec<Channel> {
        Vec::new()
    }

    /// Writes the present values into channels of [`Imperfections::channels`], in their order.
    fn write_channels(&self, _channels: &mut [Channel]) {}

    /// What was sent over its network, where messages are sent one by one.
    fn traffic(&self) -> Option<Traffic> {
        None
    }

    /// Begins its random numbers anew.
    fn reseed(&mut self, _seed: u64) {}
}

dyn_clone::clone_trait_object!(Imperfections);

/// What the vehicles know at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Sensed<'a> {
    /// Each vehicle of itself.
    pub own: &'a Swarm,
    /// Vehicles of each other.
    pub others: Others<'a>,
}

/// Messages of a network up to now.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Traffic {
    /// Messages, one for each who may hear it.
    pub sent: u64,
    /// Those of them that never arrive.
    pub lost: u64,
    /// The age \[s\] that 95 % of what vehicles hold of each other does not exceed, over all links, looked at whenever messages
    /// are sent, to a hundredth.
    pub age_p95_s: Option<f64>,
}

/// Nothing between truth and law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Direct;

impl Imperfections for Direct {
    fn sense<'a>(&'a mut self, _time_s: f64, truth: &'a Swarm) -> Sensed<'a> {
        Sensed { own: truth, others: Others::Shared }
    }

    fn is_exact(&self) -> bool {
        true
    }
}

/// Shortest latency that is not none \[s\].
const SHORTEST_S: f64 = 1e-6;

/// The latency, if it is 0, or at least a microsecond and no longer than the flight.
fn latency(key: &'static str, what: &str, latency_s: f64, duration_s: f64) -> Result<f64, ScenarioError> {
    if latency_s == 0.0 || (SHORTEST_S..=duration_s).contains(&latency_s) {
        return Ok(latency_s);
    }
    let (code, said, help) = if latency_s < SHORTEST_S {
        (
            "scenario/out-of-range",
            format!("{what} is {latency_s} s"),
            format!("give at least {SHORTEST_S} s, or 0 for none"),
        )
    } else {
        (
            "scenario/outside-flight",
            format!("{what} is {latency_s} s in a flight of {duration_s} s"),
            "nothing would ever be known but the start: give less, or enlarge time.duration_s".to_owned(),
        )
    };
    Err(ScenarioError::new(said).coded(code).with_help(help).at(key).at("time.duration_s"))
}

/// Whether a number is 0, which stands for none.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_off(number: &f64) -> bool {
    *number == 0.0
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
