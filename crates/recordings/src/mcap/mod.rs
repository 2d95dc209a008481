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
pub use message::{Header, RunAudit, RunFinding};
pub use reader::{Entry, McapRecording, StoredAudit};
pub use topic::Topic;
pub use writer::{ExtraTopic, FLUSH_BYTES, FLUSH_PERIOD_S, McapRecorder};
