//! A flight packed into a page, where a script replays it.
//!
//! A [`Film`] takes a flight as it is flown, or as it is read again, in bounded memory. A [`Stage`] says what stands still: who
//! flies, what must stay empty, what is in the way, where the slots are. [`Moment`]s are what the judge found. [`Replay::new`]
//! packs the three into JSON of at most so many bytes, which the page holds as data; `assets/replay.js` draws it.
//!
//! Packed positions are for the eye. They are rounded to a grid ([`Replay::rounding_m`]) and thinned; every distance, time and
//! verdict that is shown is the judge's own. The same flight gives the same bytes.

mod bytes;
mod cast;
mod chart;
mod choice;
mod data;
mod error;
mod extent;
mod film;
mod mesh;
mod moment;
mod motion;
mod nearest;
mod stage;
mod targets;
mod things;
mod verdict;
mod words;

pub use cast::MOST_VEHICLES;
pub use chart::Chart;
pub use choice::{MOST_INSTANTS, Span, chosen};
pub use data::{Judged, Replay};
pub use error::NoReplay;
pub use film::Film;
pub use moment::{Kind, Moment};
pub use motion::Motion;
pub use stage::Stage;
pub use words::{LONGEST_NAME, cut};

/// Room for the replays of a page \[bytes\].
pub const PAGE_BYTES: usize = 1_000_000;

#[cfg(test)]
mod tests;
