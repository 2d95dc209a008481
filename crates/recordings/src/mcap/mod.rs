//! `run.mcap`: a run as an [MCAP](https://mcap.dev/spec) file.
//!
//! Messages are in CDR (little-endian, as ROS 2 writes it), schemas are ROS 2 message definitions in plain text, so
//! general MCAP tools show every field without knowing this program. Five topics:
//!
//! | topic | schema | when | holds |
//! | --- | --- | --- | --- |
//! | `/scenario` | `tautline_msgs/msg/Scenario` | once, first | name, SHA-256 and text of the resolved scenario, N, delta |
//! | `/summary` | `tautline_msgs/msg/Summary` | each sample | closest approach and energy |
//! | `/swarm` | `tautline_msgs/msg/Swarm` | each sample | positions, velocities, controls |
//! | `/events` | `tautline_msgs/msg/Event` | as they happen | kind, time, pair, a number, a sentence |
//! | `/verdict` | `tautline_msgs/msg/Verdict` | once, last | the run's verdict, and hashes of everything before it |
//!
//! Each [`Channel`](tautline_core::record::Channel) of the samples has a topic `/vehicles/<name>` of `tautline_msgs/msg/Channel`, declared
//! with its first values. An [`ExtraTopic`] may add one of another kind, such as the 3-D scene on `/scene`; readers pass
//! over it.
//!
//! The fields, with their units, are in the schemas themselves:
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
#![doc = include_str!("verdict.msg")]
//! ```
//!
//! `log_time` and `publish_time` are simulated nanoseconds since the start; nothing in the file depends on the clock
//! or the machine, so two recordings of one run are equal byte for byte. The messages of a sample are always in the
//! same chunk, `/summary` first and `/swarm` behind the channels.
//!
//! A chunk is kept in memory until it is complete and is then handed to the system at once: when a message is
//! [`FLUSH_PERIOD_S`] or more after the last chunk, or when [`FLUSH_BYTES`] are waiting. A process that is killed leaves
//! every chunk up to then readable, and [`McapRecording`] reads such a file.

mod framing;
mod message;
mod reader;
pub(crate) mod topic;
mod writer;

pub(crate) use message::{CHANNEL_SCHEMA, ChannelMessage, SWARM_SCHEMA, channel_topic, topic_of_channel};
pub use reader::{Entry, McapRecording};
pub use topic::Topic;
pub use writer::{ExtraTopic, FLUSH_BYTES, FLUSH_PERIOD_S, McapRecorder};

use serde::{Deserialize, Serialize};

use tautline_core::record::sha256_hex;

/// What a recording says about the run as a whole: the fields of `scenario.msg`, in order.
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

/// What a run says of itself when it closes its recording: the fields of `verdict.msg`, in order.
///
/// The hashes tell whether the recording is what the run wrote. They are no signature: a program that changes a recording can
/// compute them anew.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunVerdict {
    /// `clear`, `violation` or `undecided`: the run's judge, over every step and every obstacle.
    pub status: String,
    /// Why the run ended before its time; empty where it was flown to its end.
    pub ended_early: String,
    /// Smallest distance of two centres over the run \[m\]; NaN where that is not known.
    pub separation_m: f64,
    /// When it occurred \[s\].
    pub separation_time_s: f64,
    /// The pair, numbered from 1; zeros where that is not known.
    pub pair: [u64; 2],
    /// Steps that were judged.
    pub steps: u64,
    /// Time flown \[s\].
    pub duration_s: f64,
    /// [`StateHash`](tautline_core::record::StateHash) of every sample.
    pub state_sha256: String,
    /// Hash of the messages of `/scenario`, `/summary` and `/events`; the recorder computes it.
    pub told_sha256: String,
}

impl Header {
    /// The header of a run of this scenario; its hash is computed here.
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
