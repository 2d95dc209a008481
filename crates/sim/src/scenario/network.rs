//! `[network]`: what vehicles hear of each other, and when.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::sensing::is_off;

/// What vehicles hear of others over links: all, at once and all the time unless given.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NetworkSpec {
    /// How long a message takes, in s: delays what is heard of others, and not what a vehicle knows of itself.
    #[serde(skip_serializing_if = "is_off")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub latency_s: f64,
    /// Each message takes up to so much longer, in s, all of it alike likely. Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_off")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub jitter_s: f64,
    /// Share of messages that are lost, from 0 to 1. Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_off")]
    #[schemars(extend("default" = 0.0, "minimum" = 0, "maximum" = 1))]
    pub loss: f64,
    /// How many messages are lost one after the other in the mean, from 1 on (Gilbert and Elliott: all are lost while a link
    /// is bad, and none while it is good); unless given, each message is lost or not by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 1))]
    pub loss_burst: Option<f64>,
    /// Messages a second in Hz; `sensing.rate_hz` unless given, and where there is none either, all the time.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rate_hz: Option<f64>,
    /// What a vehicle takes for the present state of another of which it has an old message.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = Missing::default()))]
    pub missing: Missing,
    /// How a vehicle knows whoever is near, with or without a link.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = NearBy::default()))]
    pub near: NearBy,
    /// Links that are down for a while. Needs `rate_hz`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub failure: Vec<LinkFailure>,
}

/// What stands for a message that has not come.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Missing {
    /// What was heard last.
    #[default]
    Hold,
    /// What was heard last, carried along its velocity up to the time of the vehicle's own measurement.
    Extrapolate,
}

/// How a vehicle knows whoever is near.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NearBy {
    /// With a sensor on board, whatever the network does.
    #[default]
    Seen,
    /// By messages that everybody sends to everybody.
    Heard,
}

/// A link that is down for a while: what is sent over it is lost, both ways.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinkFailure {
    /// The two vehicles, counted from 1.
    #[schemars(inner(range(min = 1)))]
    pub link: [u64; 2],
    /// From when on in s.
    pub from_s: f64,
    /// Until when in s; to the end of the flight unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64")]
    pub to_s: Option<f64>,
}

impl NetworkSpec {
    /// Whether everything that is sent is heard at once.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        Self { missing: Missing::Hold, near: NearBy::Seen, loss_burst: None, ..self.clone() } == Self::default()
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
