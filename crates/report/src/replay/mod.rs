//! Flights packed into a page, where a script replays them.
//!
//! A [`FlightLog`](crate::flight_log::FlightLog) holds the motion. A [`Stage`] holds vehicles, shells, obstacles and
//! slots. [`Moment`]s are the findings of the audit. [`Replay::new`] packs the three into JSON of a bounded size, which
//! the page holds as data. `assets/replay.js` draws it.
//!
//! Packed positions serve the drawing only: they are rounded to a grid ([`Replay::rounding_m`]) and thinned. Every
//! displayed distance, time and verdict is that of the audit. Equal flights give equal bytes.

mod chart;
mod data;
mod decimate;
mod motion;
mod obstacle_meshes;
mod stage;
mod statements;

pub use chart::Chart;
pub use data::{JudgementContext, Replay};
pub use decimate::{MOST_INSTANTS, MOST_VEHICLES, Span, chosen};
pub use stage::Stage;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use nalgebra::Vector3;

/// Largest size of the replays of a page \[bytes\].
pub const PAGE_BYTES: usize = 1_000_000;
/// Largest length of a name in characters.
pub const LONGEST_NAME: usize = 40;
/// Largest length of a sentence in characters.
const LONGEST_SENTENCE: usize = 240;

/// Kind of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Closest approach of all pairs.
    Closest,
    /// Two vehicles were too close, or a vehicle was too close to an obstacle.
    Violation,
    /// The audit cannot decide.
    Undecided,
    /// A vehicle was not seen, so the audit cannot decide.
    Unseen,
}

impl Kind {
    /// Returns the name of the kind in the data of a page.
    fn name(self) -> &'static str {
        match self {
            Self::Closest => "closest",
            Self::Violation => "violation",
            Self::Undecided | Self::Unseen => "undecided",
        }
    }
}

/// A finding of the audit, to which a replay can jump.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Kind of the finding.
    pub kind: Kind,
    /// Vehicles, from 0.
    pub vehicles: Vec<usize>,
    /// Obstacle, from 0, if one is involved.
    pub obstacle: Option<usize>,
    /// Start, end and worst instant \[s\].
    pub span: Span,
    /// Finding in a few words, shown while it lasts.
    pub brief: String,
    /// Finding in a sentence, with the distance and time of the audit.
    pub said: String,
}

/// Reason why a flight has no replay.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoReplay {
    /// No vehicle is ever present.
    #[error("no vehicle is ever present")]
    Empty,
    /// A position is too far away for single precision.
    #[error("vehicle {name} is farther than {farthest_m:e} m from the origin at {time_s} s")]
    TooFar {
        /// Name of the vehicle.
        name: String,
        /// Time \[s\].
        time_s: f64,
        /// Largest drawn coordinate \[m\].
        farthest_m: f64,
    },
    /// Two instants do not fit.
    #[error("it does not fit into {room_bytes} bytes")]
    NoRoom {
        /// Largest size \[bytes\].
        room_bytes: usize,
    },
}

/// Cuts a text after `most` characters.
#[must_use]
pub fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        None => text.to_owned(),
        Some((end, _)) => format!("{}…", &text[..end]),
    }
}

/// Returns doubles as base64 of their little-endian bytes.
fn doubles(numbers: impl Iterator<Item = f64>) -> String {
    base64_of(numbers.flat_map(f64::to_le_bytes))
}

/// Returns positions in single precision as base64 of their little-endian bytes.
#[expect(clippy::cast_possible_truncation, reason = "drawn in single precision")]
fn singles<'a>(places: impl IntoIterator<Item = &'a Vector3<f64>>) -> String {
    base64_of(places.into_iter().flatten().flat_map(|&x| (x as f32).to_le_bytes()))
}

fn base64_of(bytes: impl Iterator<Item = u8>) -> String {
    BASE64.encode(bytes.collect::<Vec<_>>())
}

/// Returns the length of the base64 of this many bytes.
fn base64_bytes(bytes: usize) -> usize {
    4 * bytes.div_ceil(3)
}

#[cfg(test)]
mod tests;
