//! Imperfections between the true world and the law, and their absence.

use dyn_clone::DynClone;
use serde::{Deserialize, Serialize};

use tautline_core::record::Channel;
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::observation::Others;

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
