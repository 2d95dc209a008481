//! Writes and reads `run.mcap`: a run as an [MCAP](https://mcap.dev/spec) file.
//!
//! Messages are in CDR (little-endian, as in ROS 2), schemas are ROS 2 message definitions in plain text. General MCAP
//! tools can therefore show every field. Five topics:
//!
//! | topic | schema | when | holds |
//! | --- | --- | --- | --- |
//! | `/scenario` | `tautline_msgs/msg/Scenario` | once, first | name, SHA-256 and text of the resolved scenario, N, delta |
//! | `/summary` | `tautline_msgs/msg/Summary` | each sample | closest approach and energy |
//! | `/swarm` | `tautline_msgs/msg/Swarm` | each sample | positions, velocities, controls |
//! | `/events` | `tautline_msgs/msg/Event` | at each event | kind, time, pair, a number, a sentence |
//! | `/audit` | `tautline_msgs/msg/Audit` | once, last | audit of the run, and a hash of all messages above |
//!
//! Each [`Channel`](tautline_core::record::Channel) of the samples has a topic `/vehicles/<name>` with the schema
//! `tautline_msgs/msg/Channel`, declared with its first values. An [`ExtraTopic`] adds a topic of another schema, such
//! as the 3-D scene on `/scene`, which readers ignore.
//!
//! The schemas document the fields and their units:
//!
//! ```text
#![doc = include_str!("scenario.msg")]
//! ```
//!
//! ```text
#![doc = include_str!("swarm.msg")]
//! ```
//!
//! ```text
#![doc = include_str!("summary.msg")]
//! ```
//!
//! ```text
#![doc = include_str!("event.msg")]
//! ```
//!
//! ```text
#![doc = include_str!("channel.msg")]
//! ```
//!
//! ```text
#![doc = include_str!("audit.msg")]
//! ```
//!
//! `log_time` and `publish_time` are simulated nanoseconds since the start. The file depends neither on the clock nor
//! on the machine, so two recordings of one run are equal byte for byte. The messages of a sample are in one chunk:
//! `/summary`, then the channels, then `/swarm`.
//!
//! A chunk stays in memory until it is complete and is then written at once: with the first message [`FLUSH_PERIOD_S`]
//! or more after the previous chunk, or at [`FLUSH_BYTES`]. If the process is killed, all written chunks remain
//! readable for [`McapRecording`].

mod framing;
mod message;
mod reader;
pub(crate) mod topic;
mod writer;

pub(crate) use message::{CHANNEL_SCHEMA, ChannelMessage, SWARM_SCHEMA, channel_topic, topic_of_channel};
pub use reader::{Entry, McapRecording, StoredAudit};
pub use topic::Topic;
pub use writer::{ExtraTopic, FLUSH_BYTES, FLUSH_PERIOD_S, McapRecorder};

use std::io;

use serde::{Deserialize, Serialize};

use tautline_core::record::{MessageHash, sha256_hex};

/// Description of a run: the fields of `scenario.msg`, in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Name of the scenario.
    pub scenario_name: String,
    /// SHA-256 of `scenario_toml`, 64 hexadecimal digits.
    pub scenario_sha256: String,
    /// Number of vehicles N.
    pub vehicles: usize,
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// The resolved scenario as TOML.
    pub scenario_toml: String,
}

/// Audit of every step by the run itself: the fields of `audit.msg`, in order.
///
/// Lengths are in metres, or relative to the half axes if the scenario has ellipsoids.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunAudit {
    /// `clear`, `violation` or `undecided`.
    pub status: String,
    /// Reason why the run ended early; empty if the run was flown to its end.
    pub ended_early: String,
    /// Whether the samples are all steps of the run and every step was straight.
    pub holds_every_step: bool,
    /// Smallest distance that two centres must keep \[m\].
    pub limit_m: f64,
    /// Time flown \[s\].
    pub duration_s: f64,
    /// Steps that were judged.
    pub steps: u64,
    /// Pairs that were swept, summed over the steps.
    pub pairs_checked: u64,
    /// Number of all violations.
    pub violations_count: u64,
    /// Closest approach of two vehicles, and the closest approaches to obstacles.
    pub closest: Vec<RunFinding>,
    /// Violations in order of time, at most a bounded number.
    pub violations: Vec<RunFinding>,
    /// Hash of the messages and of this audit, computed by [`McapRecorder::close`]. The hash reveals accidental changes
    /// and edits. It is not a signature: a program can recompute it.
    pub sha256: String,
}

/// An approach or a violation of a [`RunAudit`]. Vehicles and obstacles are numbered from 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunFinding {
    /// The vehicle.
    pub vehicle: u64,
    /// The other vehicle; 0 for an approach to an obstacle.
    pub other_vehicle: u64,
    /// The obstacle; 0 for an approach of two vehicles.
    pub obstacle: u64,
    /// Required distance \[m\].
    pub limit_m: f64,
    /// Start of the violation \[s\]; equal to `min_at_s` for an approach.
    pub from_s: f64,
    /// End of the violation \[s\]; equal to `min_at_s` for an approach.
    pub to_s: f64,
    /// Smallest distance \[m\].
    pub min_m: f64,
    /// Time of the smallest distance \[s\].
    pub min_at_s: f64,
}

impl RunAudit {
    /// Returns the hash of the messages followed by this audit.
    fn hash(&self, mut messages: MessageHash) -> io::Result<String> {
        let mut bytes = Vec::new();
        topic::encode(&Self { sha256: String::new(), ..self.clone() }, &mut bytes)?;
        messages.take(message::AUDIT.name, &bytes);
        Ok(messages.digits())
    }
}

impl Header {
    /// Returns the header of a run of this scenario and computes its hash.
    #[must_use]
    pub fn new(scenario_name: &str, scenario_toml: &str, vehicles: usize, delta_m: f64) -> Self {
        Self {
            scenario_name: scenario_name.to_owned(),
            scenario_toml: scenario_toml.to_owned(),
            scenario_sha256: sha256_hex(scenario_toml),
            vehicles,
            delta_m,
        }
    }
}
