//! `[network]`: messages between vehicles, with delay and loss.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::failure::Failure;
use super::history::History;
use super::messages::Messages;
use super::sensing::StateSensor;
use super::{ImperfectionSpec, Traffic, latency};
use crate::scenario::{ErrorKind, MAX_MEMORY_BYTES, Scenario, ScenarioError, entry_key, is_default};
use tautline_core::record::Channel;
use tautline_core::swarm::{Rows, Swarm, row};
use tautline_laws::law::VoidReason;
use tautline_laws::observation::NeighbourState;

/// Messages between vehicles over links: without loss and delay, in continuous time unless given.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NetworkSpec {
    /// Delay of each message in s. A vehicle knows its own state without this delay.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub latency_s: f64,
    /// Extra delay of each message in s, uniform from 0 to `jitter_s`. Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub jitter_s: f64,
    /// Share of messages that are lost, from 0 to 1. Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0, "maximum" = 1))]
    pub loss: f64,
    /// Mean number of messages lost in a row, at least 1. Model of Gilbert and Elliott: a link loses all messages while
    /// it is bad, and none while it is good. Losses are independent unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 1))]
    pub loss_burst: Option<f64>,
    /// Messages a second in Hz; `sensing.rate_hz` unless given, and continuous if neither is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rate_hz: Option<f64>,
    /// Range of the radio in m: messages between vehicles farther apart are lost; no limit unless given. Needs
    /// `rate_hz`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub range_m: Option<f64>,
    /// Largest number of hops of a message: vehicles pass on the messages of others. Latency, jitter and loss apply to
    /// each hop. No relay unless given. Needs `rate_hz`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 1, "maximum" = 64))]
    pub relay_hops: Option<u32>,
    /// Estimate of the present state of another vehicle from its last message.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = StalePolicy::default()))]
    pub missing: StalePolicy,
    /// Source of the states of near vehicles, with or without a link.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = NearStates::default()))]
    pub near: NearStates,
    /// Links that are down for some time. Needs `rate_hz`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub failure: Vec<LinkFailure>,
}

/// Estimate of the present state of another vehicle from its last message.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StalePolicy {
    /// The state in the last message.
    #[default]
    Hold,
    /// The state in the last message, moved along its velocity to the time of the vehicle's own measurement.
    Extrapolate,
}

/// Source of the states of near vehicles.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NearStates {
    /// With a sensor on board, independent of the network.
    #[default]
    Sensed,
    /// By messages that each vehicle sends to all others.
    Received,
}

/// A link that is down for some time. Messages over it are lost in both directions.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinkFailure {
    /// The two vehicles, counted from 1.
    #[schemars(inner(range(min = 1)))]
    pub link: [u64; 2],
    /// Start time in s.
    pub from_s: f64,
    /// End time in s; the end of the flight unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64")]
    pub to_s: Option<f64>,
}

impl NetworkSpec {
    /// Returns the largest number of hops of a message.
    #[must_use]
    pub fn hops(&self) -> u32 {
        self.relay_hops.unwrap_or(1)
    }

    /// Returns whether messages may be lost.
    #[must_use]
    pub fn loses(&self) -> bool {
        self.loss > 0.0 || self.range_m.is_some() || !self.failure.is_empty()
    }
}

impl ImperfectionSpec for NetworkSpec {
    fn is_exact(&self) -> bool {
        let (missing, near) = (StalePolicy::Hold, NearStates::Sensed);
        Self { missing, near, loss_burst: None, relay_hops: None, ..self.clone() } == Self::default()
    }

    fn is_random(&self) -> bool {
        self.loss > 0.0 || self.jitter_s > 0.0
    }

    fn check(&self, scenario: &Scenario) -> Result<(), ScenarioError> {
        let NetworkSpec { latency_s, jitter_s, loss, loss_burst, rate_hz, .. } = *self;
        latency("network.latency_s", "the latency of messages", latency_s, scenario.time.duration_s)?;
        latency("network.jitter_s", "the jitter of messages", jitter_s, scenario.time.duration_s)?;
        check_loss(loss, loss_burst)?;
        if let Some(hops) = self.relay_hops.filter(|hops| !(1..=MOST_HOPS).contains(hops)) {
            let problem = format!("a message takes 1 to {MOST_HOPS} hops, got {hops}");
            return Err(ErrorKind::OutOfRange.at(&["network.relay_hops"], problem, "leave it out for no relay"));
        }
        if rate_hz.is_some() {
            scenario.check_sampled("network.rate_hz")?;
        }
        let needs_rate = [
            ("network.jitter_s", jitter_s > 0.0),
            ("network.loss", loss > 0.0),
            ("network.range_m", self.range_m.is_some()),
            ("network.relay_hops", self.relay_hops.is_some()),
            ("network.failure", !self.failure.is_empty()),
        ];
        for (key, _) in needs_rate.into_iter().filter(|&(_, is_used)| is_used) {
            scenario.check_messages(key)?;
        }
        self.failure.iter().enumerate().try_for_each(|(entry, failure)| scenario.check_link(entry, failure))?;
        scenario.check_message_memory()
    }

    fn voids(&self) -> Vec<VoidReason> {
        let is_late = self.latency_s > 0.0 || self.rate_hz.is_some();
        let voids = [(is_late, VoidReason::MessagesDelayed), (self.loses(), VoidReason::MessagesLost)];
        voids.into_iter().filter_map(|(is_void, void)| is_void.then_some(void)).collect()
    }
}

/// Largest number of hops of a message.
const MOST_HOPS: u32 = 64;
/// Largest number of messages that a vehicle sends in a step.
const MESSAGES_A_STEP: f64 = 10.0;
/// Expected memory of a link in one direction, for its last message \[bytes\].
const BYTES_PER_LINK: u128 = 80;
/// Expected memory of a message under way \[bytes\].
const BYTES_PER_MESSAGE: u128 = 8;

impl Scenario {
    /// Returns the rate of messages \[Hz\]; `None` for continuous communication.
    #[must_use]
    pub fn message_hz(&self) -> Option<f64> {
        self.network.rate_hz.or(self.sensing.rate_hz)
    }

    /// Refuses a key about single messages if no rate of messages is given.
    fn check_messages(&self, key: &'static str) -> Result<(), ScenarioError> {
        if self.message_hz().is_some() {
            return Ok(());
        }
        let problem = format!("{key} needs a rate of messages");
        Err(ErrorKind::MissingKey.at(&[key], problem, "set network.rate_hz, such as 50"))
    }

    fn check_link(&self, entry: usize, failure: &LinkFailure) -> Result<(), ScenarioError> {
        let &LinkFailure { link: [a, b], from_s, to_s } = failure;
        let refuse = |kind: ErrorKind, said: String, help: &str| {
            Err(kind.at(&[&entry_key("network.failure", entry)], said, help))
        };
        let index = |number: u64| usize::try_from(number).unwrap_or(usize::MAX).checked_sub(1);
        let is_link = match (index(a), index(b)) {
            (Some(i), Some(j)) if i != j && i.max(j) < self.count() => {
                self.shield.is_some() || self.network.near == NearStates::Received || self.graph.has_edge(i, j)
            }
            _ => false,
        };
        if !is_link {
            return refuse(
                ErrorKind::Edge,
                format!("the graph has no link between vehicles {a} and {b}"),
                "name the two ends of an edge of [graph], counted from 1",
            );
        }
        let until_s = to_s.unwrap_or(self.time.duration_s);
        if from_s >= 0.0 && from_s < until_s && from_s < self.time.duration_s {
            return Ok(());
        }
        refuse(
            ErrorKind::OutsideFlight,
            format!("the link of vehicles {a} and {b} must be down within the flight, got {from_s} s to {until_s} s"),
            "give from_s from 0 s to less than the end of the flight, and to_s more than from_s",
        )
    }

    fn check_message_memory(&self) -> Result<(), ScenarioError> {
        let Some(rate_hz) = self.message_hz() else { return Ok(()) };
        if self.network.is_exact() && self.sensing.is_exact() {
            return Ok(());
        }
        if rate_hz * self.time.dt_s > MESSAGES_A_STEP {
            let problem = format!(
                "{rate_hz} messages a second are more than {MESSAGES_A_STEP} messages in a step of {} s",
                self.time.dt_s
            );
            let help = format!("send at most {} a second, or reduce time.dt_s", MESSAGES_A_STEP / self.time.dt_s);
            return Err(ErrorKind::StepTooLong.at(&["network.rate_hz", "sensing.rate_hz"], problem, help));
        }
        let count = self.count() as u128;
        let pairs = count * count.saturating_sub(1);
        // With a relay, any two vehicles have a link.
        let has_all = self.network.near == NearStates::Received || self.network.hops() > 1;
        let received = if has_all { pairs } else { 2 * self.graph.edge_count() as u128 };
        let longest_s = (self.network.latency_s + self.network.jitter_s) * f64::from(self.network.hops());
        let under_way = (longest_s * rate_hz).ceil() + 2.0;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "more than 2; too many saturate")]
        let bytes = received.saturating_mul(BYTES_PER_LINK + BYTES_PER_MESSAGE * under_way as u128);
        if bytes <= MAX_MEMORY_BYTES {
            return Ok(());
        }
        let gib = MAX_MEMORY_BYTES >> 30;
        let problem = format!(
            "messages over {received} links need {} GiB of memory, more than the limit of {gib} GiB",
            bytes >> 30
        );
        let help = "choose a graph of fewer edges, such as [graph] kind = \"ring\", or send less often";
        Err(ErrorKind::Memory.at(&["network.rate_hz", "graph.kind"], problem, help))
    }
}

/// A share, and bursts that can make it up.
fn check_loss(loss: f64, burst: Option<f64>) -> Result<(), ScenarioError> {
    let Some(burst) = burst else { return Ok(()) };
    // A bad link follows a good one at most always.
    let least = if loss < 1.0 { (loss / (1.0 - loss)).max(1.0) } else { 1.0 };
    if burst >= least {
        return Ok(());
    }
    let problem = format!("bursts of {burst} lost messages in the mean cannot lose a share of {loss}");
    let help = format!("give at least {least}, or leave network.loss_burst out for independent losses");
    Err(ErrorKind::Inconsistent.at(&["network.loss_burst", "network.loss"], problem, help))
}

/// Communication between the vehicles of a flight.
#[derive(Clone, Debug)]
pub(super) enum Network {
    /// Measurements of the other vehicles, without delay.
    None,
    /// Measurements of the other vehicles after a constant delay.
    Delayed(DelayedStates),
    /// Single messages at a rate.
    Messages(Box<Messages>),
}

/// Communication with a constant delay.
#[derive(Clone, Debug)]
pub(super) struct DelayedStates {
    delay_s: f64,
    known: Swarm,
    measured_s: f64,
}

impl Network {
    pub(super) fn new(scenario: &Scenario, sensing: &StateSensor) -> Self {
        let late_s = scenario.network.latency_s;
        let has_messages = !scenario.network.is_exact() || scenario.failures.iter().any(Failure::is_silent);
        match scenario.message_hz().filter(|_| has_messages) {
            Some(rate_hz) => Self::Messages(Box::new(Messages::new(scenario, sensing, rate_hz))),
            None if late_s > 0.0 => {
                Self::Delayed(DelayedStates { delay_s: late_s, known: scenario.start.clone(), measured_s: 0.0 })
            }
            None => Self::None,
        }
    }

    /// Returns the state of `sender` that `receiver` knows at a time \[s\]; `None` without a delay or
    /// without a link.
    pub(super) fn received(&self, receiver: usize, sender: usize, time_s: f64) -> Option<NeighbourState> {
        match self {
            Self::None => None,
            Self::Delayed(delayed) => Some(NeighbourState::of(&delayed.known, sender, time_s - delayed.measured_s)),
            Self::Messages(messages) => messages.received(receiver, sender, time_s),
        }
    }

    /// Updates the delayed states to a time \[s\].
    pub(super) fn update(&mut self, time_s: f64, sensing: &StateSensor, history: &History) {
        if let Self::Delayed(delayed) = self {
            let sent_s = (time_s - delayed.delay_s).max(0.0);
            delayed.measured_s = sensing.measured_s(sent_s);
            sensing.measure(history, sent_s, None, &mut delayed.known);
        }
    }

    /// Sends and delivers the messages that are due by a time \[s\].
    pub(super) fn settle(&mut self, time_s: f64, sensing: &StateSensor, history: &History) {
        if let Self::Messages(messages) = self {
            messages.settle(time_s, sensing, history);
        }
    }

    /// Returns the largest distance \[m\] between the true position of a vehicle and its position as known to another;
    /// `own_m` without a delay.
    pub(super) fn largest_error_m(
        &self,
        positions_m: &Rows,
        extrapolated: impl Fn(NeighbourState) -> NeighbourState,
        time_s: f64,
        own_m: f64,
    ) -> f64 {
        match self {
            Self::None => own_m,
            Self::Delayed(delayed) => (0..delayed.known.count())
                .map(|i| NeighbourState::of(&delayed.known, i, time_s - delayed.measured_s))
                .enumerate()
                .map(|(i, received)| (extrapolated(received).position_m - row(positions_m, i)).norm())
                .fold(0.0, f64::max),
            Self::Messages(messages) => messages.largest_error_m(positions_m, extrapolated, time_s),
        }
    }

    /// Returns the constant delay \[s\], if the communication has one.
    pub(super) fn delay_s(&self) -> Option<f64> {
        if let Self::Delayed(delayed) = self { Some(delayed.delay_s) } else { None }
    }

    pub(super) fn channels(&self) -> Vec<Channel> {
        match self {
            Self::None => Vec::new(),
            Self::Delayed(_) | Self::Messages(_) => vec![Channel::new("message_age", &["oldest_s", "mean_s"])],
        }
    }

    pub(super) fn write_channels(&self, time_s: f64, count: usize, channels: &mut [Channel]) {
        let Some(ages) = channels.first_mut() else { return };
        ages.values.resize(2 * count, 0.0);
        match self {
            Self::None => {}
            Self::Delayed(delayed) => ages.values.fill(time_s - delayed.measured_s),
            Self::Messages(messages) => messages.write_ages(time_s, &mut ages.values),
        }
    }

    pub(super) fn traffic(&self) -> Option<Traffic> {
        let Self::Messages(messages) = self else { return None };
        let (sent, lost) = messages.counts();
        Some(Traffic { sent, lost, age_p95_s: messages.ages().quantile_s(0.95) })
    }

    pub(super) fn reseed(&mut self, seed: u64) {
        if let Self::Messages(messages) = self {
            messages.reseed(seed);
        }
    }
}
