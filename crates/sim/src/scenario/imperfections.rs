//! What imperfections must be for a swarm to be flown with them.

use super::error::ScenarioError;
use super::failure::{Failure, FailureKind};
use super::limits::MAX_MEMORY_BYTES;
use super::network::{LinkFailure, NearBy, NetworkSpec};
use super::sensing::SensingSpec;
use super::spec::Scenario;
use crate::vehicle::RotorFailure;

/// Most messages that a vehicle sends in a step.
const MESSAGES_A_STEP: f64 = 10.0;
/// Memory expected for a link in one direction: what was heard over it last \[bytes\].
const BYTES_PER_LINK: u128 = 80;
/// And for each message that may be under way on it.
const BYTES_PER_MESSAGE: u128 = 8;
/// Shortest latency that is not none \[s\].
const SHORTEST_S: f64 = 1e-6;

impl Scenario {
    /// Whether another seed of noise gives another flight.
    #[must_use]
    pub fn is_random_in_flight(&self) -> bool {
        let Self { wind, sensing, network, .. } = self;
        wind.turbulence.is_some() || sensing.is_noisy() || network.loss > 0.0 || network.jitter_s > 0.0
    }

    /// Errors and times that are such, errors with a rate at which they are drawn, and nothing that continuous time cannot have.
    pub(super) fn check_sensing(&self) -> Result<(), ScenarioError> {
        let SensingSpec { rate_hz, latency_s, near_latency_s, .. } = self.sensing;
        let noises = [
            ("sensing.position_noise_m", "the error of a measured position", self.sensing.position_noise_m),
            ("sensing.velocity_noise_m_s", "the error of a measured velocity", self.sensing.velocity_noise_m_s),
        ];
        for (key, what, noise) in noises {
            if noise > 0.0 && rate_hz.is_none() {
                return Err(ScenarioError::new(format!(
                    "{what} is drawn anew with each measurement, and none has a time"
                ))
                .coded("scenario/missing-key")
                .with_help("say how often it is measured: sensing.rate_hz, such as 100")
                .at(key));
            }
        }
        if rate_hz.is_some() {
            self.check_sampled("sensing.rate_hz")?;
        }
        latency("sensing.latency_s", "the latency of measurements", latency_s, self.time.duration_s)?;
        let near = "the latency of what is seen of near ones";
        latency("sensing.near_latency_s", near, near_latency_s.unwrap_or(0.0), self.time.duration_s).map(|_| ())
    }

    /// Refuses what happens at instants of its own where time is continuous.
    pub(super) fn check_sampled(&self, key: &'static str) -> Result<(), ScenarioError> {
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

impl Scenario {
    /// Messages a second \[Hz\], where they are not sent all the time.
    #[must_use]
    pub fn message_hz(&self) -> Option<f64> {
        self.network.rate_hz.or(self.sensing.rate_hz)
    }

    /// Times, shares and links that are such, and rates for whatever happens to a message.
    pub(super) fn check_network(&self) -> Result<(), ScenarioError> {
        let NetworkSpec { latency_s, jitter_s, loss, loss_burst, rate_hz, .. } = self.network;
        latency("network.latency_s", "the latency of messages", latency_s, self.time.duration_s)?;
        latency("network.jitter_s", "the jitter of messages", jitter_s, self.time.duration_s)?;
        check_loss(loss, loss_burst)?;
        if rate_hz.is_some() {
            self.check_sampled("network.rate_hz")?;
        }
        let needs_rate = [
            ("network.jitter_s", jitter_s > 0.0),
            ("network.loss", loss > 0.0),
            ("network.failure", !self.network.failure.is_empty()),
        ];
        for (key, _) in needs_rate.into_iter().filter(|&(_, is_used)| is_used) {
            self.check_messages(key)?;
        }
        self.network.failure.iter().enumerate().try_for_each(|(entry, failure)| self.check_link(entry, failure))?;
        self.check_message_memory()
    }

    /// Refuses what happens to messages where nothing says when they are sent.
    pub(super) fn check_messages(&self, key: &'static str) -> Result<(), ScenarioError> {
        if self.message_hz().is_some() {
            return Ok(());
        }
        Err(ScenarioError::new(format!("{key} is about messages, and nothing says how often they are sent"))
            .coded("scenario/missing-key")
            .with_help("set network.rate_hz, such as 50")
            .at(key))
    }

    fn check_link(&self, entry: usize, failure: &LinkFailure) -> Result<(), ScenarioError> {
        let &LinkFailure { link: [a, b], from_s, to_s } = failure;
        let refuse = |code, said: String, help: &str| {
            Err(ScenarioError::new(said).coded(code).with_help(help).at_entry("network.failure", entry))
        };
        let index = |number: u64| usize::try_from(number).unwrap_or(usize::MAX).checked_sub(1);
        let is_link = match (index(a), index(b)) {
            (Some(i), Some(j)) if i != j && i.max(j) < self.count() => {
                self.network.near == NearBy::Heard || self.graph.has_edge(i, j)
            }
            _ => false,
        };
        if !is_link {
            return refuse(
                "scenario/edge",
                format!("the graph has no link between vehicles {a} and {b} that could be down"),
                "name the two ends of an edge of [graph], counted from 1",
            );
        }
        let until_s = to_s.unwrap_or(self.time.duration_s);
        if from_s >= 0.0 && from_s < until_s && from_s < self.time.duration_s {
            return Ok(());
        }
        refuse(
            "scenario/outside-flight",
            format!("the link of vehicles {a} and {b} is down from {from_s} s to {until_s} s"),
            "it is down from 0 s or later, before the end of the flight, and until later than that",
        )
    }

    fn check_message_memory(&self) -> Result<(), ScenarioError> {
        let Some(rate_hz) = self.message_hz() else { return Ok(()) };
        if self.network.is_exact() && self.sensing.is_exact() {
            return Ok(());
        }
        if rate_hz * self.time.dt_s > MESSAGES_A_STEP {
            return Err(ScenarioError::new(format!(
                "{rate_hz} messages a second are more than {MESSAGES_A_STEP} in a step of {} s, and only the last one counts",
                self.time.dt_s
            )).coded("scenario/step-too-long")
            .with_help(format!("send at most {} a second, or reduce time.dt_s", MESSAGES_A_STEP / self.time.dt_s))
            .at("network.rate_hz")
            .at("sensing.rate_hz"));
        }
        let count = self.count() as u128;
        let pairs = count * count.saturating_sub(1);
        let heard = if self.network.near == NearBy::Heard { pairs } else { 2 * self.graph.edge_count() as u128 };
        let under_way = ((self.network.latency_s + self.network.jitter_s) * rate_hz).ceil() + 2.0;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "more than 2; too many saturate")]
        let bytes = heard.saturating_mul(BYTES_PER_LINK + BYTES_PER_MESSAGE * under_way as u128);
        if bytes <= MAX_MEMORY_BYTES {
            return Ok(());
        }
        let gib = MAX_MEMORY_BYTES >> 30;
        Err(ScenarioError::new(format!(
            "messages over {heard} links would take {} GiB of memory; at most {gib} GiB are used",
            bytes >> 30
        ))
        .coded("scenario/memory")
        .with_help("choose a graph of fewer edges, such as [graph] kind = \"ring\", or send less often")
        .at("network.rate_hz")
        .at("graph.kind"))
    }
}

impl Scenario {
    /// A limit that lets vehicles move, and a lag that the plant can have.
    pub(super) fn check_actuation(&self) -> Result<(), ScenarioError> {
        if self.actuation.lag_s == 0.0 || self.plant.holds_commands() {
            return Ok(());
        }
        Err(ScenarioError::new("the ideal plant's vehicles are accelerated as they are commanded, without a lag")
            .coded("scenario/unsupported-by-plant")
            .with_help("leave out actuation.lag_s, or set plant.kind to \"rapier\"")
            .at("actuation.lag_s")
            .at("plant.kind"))
    }
}

impl Scenario {
    /// Vehicles that there are, times within the flight, and nothing that continuous time cannot have.
    pub(super) fn check_failures(&self) -> Result<(), ScenarioError> {
        for (entry, failure) in self.failures.iter().enumerate() {
            let &Failure { vehicle, at_s, kind } = failure;
            if vehicle == 0 || failure.index() >= self.count() {
                return Err(ScenarioError::new(format!(
                    "vehicle {vehicle} is to fail, and there are {}",
                    self.count()
                ))
                .coded("scenario/unknown-vehicle")
                .with_help("vehicles are counted from 1")
                .at_entry("failure", entry));
            }
            if !(0.0..self.time.duration_s).contains(&at_s) {
                return Err(ScenarioError::new(format!(
                    "vehicle {vehicle} is to fail at {at_s} s, in a flight from 0 s to {} s",
                    self.time.duration_s
                ))
                .coded("scenario/outside-flight")
                .with_help("let it fail within the flight")
                .at_entry("failure", entry)
                .at("time.duration_s"));
            }
            match kind {
                FailureKind::Dead {} => {}
                FailureKind::Rotor { share, .. } => self.check_rotor(entry, share)?,
                FailureKind::Silent {} => self.check_silent(entry)?,
                FailureKind::Frozen {} => self.check_frozen(entry)?,
            }
        }
        Ok(())
    }

    fn check_rotor(&self, entry: usize, share: f64) -> Result<(), ScenarioError> {
        let (code, said, help) = if self.airframe.quadrotor().is_none() {
            (
                "scenario/unsupported-by-vehicle",
                "a rotor is to fail, and vehicles are points".to_owned(),
                "set vehicle.model to a quadrotor, or kind to \"dead\"",
            )
        } else if !(0.0..1.0).contains(&share) {
            (
                "scenario/out-of-range",
                format!("a rotor that fails still gives a share of {share} of its thrust"),
                "set share from 0 to less than 1",
            )
        } else {
            return Ok(());
        };
        Err(ScenarioError::new(said).coded(code).with_help(help).at_entry("failure", entry))
    }

    /// What becomes of rotors.
    pub(super) fn rotor_failures(&self) -> Vec<RotorFailure> {
        let of_rotors = |failure: &Failure| {
            let (rotor, share) = match failure.kind {
                FailureKind::Dead {} => (None, 0.0),
                FailureKind::Rotor { rotor, share } => (Some(usize::try_from(rotor.checked_sub(1)?).ok()?), share),
                FailureKind::Silent {} | FailureKind::Frozen {} => return None,
            };
            Some(RotorFailure { vehicle: failure.index(), rotor, at_s: failure.at_s, share })
        };
        let exists =
            |failure: &RotorFailure| failure.vehicle < self.count() && failure.rotor.is_none_or(|rotor| rotor < 4);
        self.failures.iter().filter_map(of_rotors).filter(exists).collect()
    }

    fn check_frozen(&self, entry: usize) -> Result<(), ScenarioError> {
        if self.plant.holds_commands() || self.time.control_hz.is_some() {
            return Ok(());
        }
        Err(ScenarioError::new("the ideal plant's vehicles hold no command that could stay as it was")
            .coded("scenario/unsupported-by-plant")
            .with_help("set time.control_hz, or plant.kind to \"rapier\"")
            .at_entry("failure", entry)
            .at("plant.kind"))
    }

    fn check_silent(&self, entry: usize) -> Result<(), ScenarioError> {
        if self.message_hz().is_some() {
            return Ok(());
        }
        Err(ScenarioError::new("a vehicle is to send nothing any more, and nothing says how often messages are sent")
            .coded("scenario/missing-key")
            .with_help("set network.rate_hz, such as 50")
            .at_entry("failure", entry))
    }
}

/// The latency, if it is 0, or at least a microsecond and no longer than the flight.
pub(super) fn latency(key: &'static str, what: &str, latency_s: f64, duration_s: f64) -> Result<f64, ScenarioError> {
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

/// A share, and bursts that can make it up.
fn check_loss(loss: f64, burst: Option<f64>) -> Result<(), ScenarioError> {
    let Some(burst) = burst else { return Ok(()) };
    // A bad link follows a good one at most always.
    let least = if loss < 1.0 { (loss / (1.0 - loss)).max(1.0) } else { 1.0 };
    if burst >= least {
        return Ok(());
    }
    Err(ScenarioError::new(format!("bursts of {burst} lost messages in the mean cannot lose a share of {loss}"))
        .with_help(format!("give at least {least}, or leave network.loss_burst out: then each is lost by itself"))
        .at("network.loss_burst")
        .at("network.loss"))
}
