//! `[network]`: what vehicles hear of each other, and when.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::ScenarioError;
use super::limits::{MAX_MEMORY_BYTES, at_least_zero, positive, require_finite};
use super::sensing::{is_off, latency};
use super::spec::Scenario;

/// Memory expected for a link in one direction: what was heard over it last \[bytes\].
const BYTES_PER_LINK: u128 = 80;
/// And for each message that may be under way on it.
const BYTES_PER_MESSAGE: u128 = 8;

/// What vehicles hear of others over links: all, at once and all the time unless given.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct NetworkSpec {
    /// How long a message takes, in s: delays what is heard of others, and not what a vehicle knows of itself.
    #[serde(skip_serializing_if = "is_off")]
    #[cfg_attr(feature = "schema", schemars(extend("default" = 0.0, "minimum" = 0)))]
    pub latency_s: f64,
    /// Each message takes up to so much longer, in s, all of it alike likely. Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_off")]
    #[cfg_attr(feature = "schema", schemars(extend("default" = 0.0, "minimum" = 0)))]
    pub jitter_s: f64,
    /// Share of messages that are lost, from 0 to 1. Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_off")]
    #[cfg_attr(feature = "schema", schemars(extend("default" = 0.0, "minimum" = 0, "maximum" = 1)))]
    pub loss: f64,
    /// How many messages are lost one after the other in the mean, from 1 on (Gilbert and Elliott: all are lost while a link
    /// is bad, and none while it is good); unless given, each message is lost or not by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(extend("minimum" = 1)))]
    pub loss_burst: Option<f64>,
    /// Messages a second in Hz; `sensing.rate_hz` unless given, and where there is none either, all the time.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(extend("exclusiveMinimum" = 0)))]
    pub rate_hz: Option<f64>,
    /// What a vehicle takes for the present state of another of which it has an old message.
    #[serde(skip_serializing_if = "is_default")]
    pub missing: Missing,
    /// How a vehicle knows whoever is near, with or without a link.
    #[serde(skip_serializing_if = "is_default")]
    pub near: NearBy,
    /// Links that are down for a while. Needs `rate_hz`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub failure: Vec<LinkFailure>,
}

/// What stands for a message that has not come.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Missing {
    /// What was heard last.
    #[default]
    Hold,
    /// What was heard last, carried along its velocity up to the time of the vehicle's own measurement.
    Extrapolate,
}

/// How a vehicle knows whoever is near.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum NearBy {
    /// With a sensor on board, whatever the network does.
    #[default]
    Seen,
    /// By messages that everybody sends to everybody.
    Heard,
}

/// A link that is down for a while: what is sent over it is lost, both ways.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LinkFailure {
    /// The two vehicles, counted from 1.
    #[cfg_attr(feature = "schema", schemars(inner(range(min = 1))))]
    pub link: [u64; 2],
    /// From when on in s.
    pub from_s: f64,
    /// Until when in s; to the end of the flight unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "f64"))]
    pub to_s: Option<f64>,
}

impl NetworkSpec {
    /// Whether everything that is sent is heard at once.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        Self { missing: Missing::Hold, near: NearBy::Seen, ..self.clone() } == Self::default()
    }

    /// Whether messages may be missing.
    #[must_use]
    pub fn loses(&self) -> bool {
        self.loss > 0.0 || !self.failure.is_empty()
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
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
        if let Some(rate_hz) = rate_hz {
            positive("network.rate_hz", "the rate of messages", rate_hz)?;
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
            .with_help("set network.rate_hz, such as 50")
            .at(key))
    }

    fn check_link(&self, entry: usize, failure: &LinkFailure) -> Result<(), ScenarioError> {
        let &LinkFailure { link: [a, b], from_s, to_s } = failure;
        let refuse =
            |said: String, help: &str| Err(ScenarioError::new(said).with_help(help).at_entry("network.failure", entry));
        let index = |number: u64| usize::try_from(number).unwrap_or(usize::MAX).checked_sub(1);
        let is_link = match (index(a), index(b)) {
            (Some(i), Some(j)) if i != j && i.max(j) < self.count() => {
                self.network.near == NearBy::Heard || self.graph.has_edge(i, j)
            }
            _ => false,
        };
        if !is_link {
            return refuse(
                format!("the graph has no link between vehicles {a} and {b} that could be down"),
                "name the two ends of an edge of [graph], counted from 1",
            );
        }
        let until_s = to_s.unwrap_or(self.time.duration_s);
        let times = [("the beginning of a link failure", from_s), ("the end of a link failure", until_s)];
        for (what, time_s) in times {
            require_finite(what, time_s).map_err(|error| error.at_entry("network.failure", entry))?;
        }
        if from_s >= 0.0 && from_s < until_s && from_s < self.time.duration_s {
            return Ok(());
        }
        refuse(
            format!("the link of vehicles {a} and {b} is down from {from_s} s to {until_s} s"),
            "it is down from 0 s or later, before the end of the flight, and until later than that",
        )
    }

    fn check_message_memory(&self) -> Result<(), ScenarioError> {
        let Some(rate_hz) = self.message_hz() else { return Ok(()) };
        if self.network.is_exact() && self.sensing.is_exact() {
            return Ok(());
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
        .with_help("choose a graph of fewer edges, such as [graph] kind = \"ring\", or send less often")
        .at("network.rate_hz")
        .at("graph.kind"))
    }
}

/// A share, and bursts that can make it up.
fn check_loss(loss: f64, burst: Option<f64>) -> Result<(), ScenarioError> {
    at_least_zero("network.loss", "the share of messages that are lost", loss)?;
    if loss > 1.0 {
        return Err(ScenarioError::new(format!("the share of messages that are lost is {loss}"))
            .with_help("it is at most 1; 0.02 is two in a hundred")
            .at("network.loss"));
    }
    let Some(burst) = burst else { return Ok(()) };
    require_finite("the mean burst of lost messages", burst).map_err(|error| error.at("network.loss_burst"))?;
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
