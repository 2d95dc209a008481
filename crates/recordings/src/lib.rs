//! Recordings: those of any origin as tracks, those of this program, and exports to other formats.
//!
//! | module | holds |
//! | --- | --- |
//! | [`read`] | recordings of any origin as tracks, one file a format |
//! | [`mcap`] | `run.mcap`, written as a flight goes and read back |
//! | [`export`] | recordings written in other formats, one file a format |
//!
//! Recordings are read, not trusted: a reader's memory grows with bytes that are really in the file, never with a length
//! that the file claims. What a file leaves open is asked of the user and never guessed.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod export;
pub mod mcap;
pub mod read;

pub use read::{ReadError, ReadOptions, Recording, open};
pub use tautline_core::track;
