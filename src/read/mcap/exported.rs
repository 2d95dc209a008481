//! The messages that an exported recording consists of.
//!
//! ```text
#![doc = include_str!("vehicles.msg")]
//! ```
//!
//! ```text
#![doc = include_str!("tracks.msg")]
//! ```

use byteorder::LittleEndian;
use serde::{Deserialize, Serialize};

/// A channel of an exported recording.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Channel {
    pub(crate) topic: &'static str,
    pub(crate) schema: &'static str,
    pub(crate) text: &'static str,
}

/// Where the vehicles are named.
pub(crate) const VEHICLES: Channel =
    Channel { topic: "/vehicles", schema: "tautline_msgs/msg/Vehicles", text: include_str!("vehicles.msg") };

/// Where the motion is.
pub(crate) const TRACKS: Channel =
    Channel { topic: "/tracks", schema: "tautline_msgs/msg/Tracks", text: include_str!("tracks.msg") };

/// The fields of `vehicles.msg`, in order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Vehicles {
    pub(crate) names: Vec<String>,
    pub(crate) epoch_ns: i64,
}

/// The fields of `tracks.msg`, in order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Instant {
    pub(crate) time_s: f64,
    pub(crate) vehicles: Vec<u64>,
    pub(crate) positions_m: Vec<f64>,
    pub(crate) velocities_m_s: Vec<f64>,
    pub(crate) radii_m: Vec<f64>,
}

/// How ROS 2 marks plain little-endian CDR at the head of each message.
const CDR_LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// A message in CDR.
pub(crate) fn encode(message: &impl Serialize) -> Result<Vec<u8>, cdr_encoding::Error> {
    let mut bytes = CDR_LITTLE_ENDIAN.to_vec();
    cdr_encoding::to_writer::<_, LittleEndian, _>(&mut bytes, message)?;
    Ok(bytes)
}

/// A message out of CDR; the error says what is wrong with it.
pub(super) fn decode<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, String> {
    let body = bytes.strip_prefix(&CDR_LITTLE_ENDIAN).ok_or("it does not begin as little-endian CDR does")?;
    cdr_encoding::from_bytes::<T, LittleEndian>(body).map(|(message, _)| message).map_err(|error| error.to_string())
}
