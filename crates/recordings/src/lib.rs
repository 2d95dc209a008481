//! Reads recordings of any origin as tracks, writes and reads `run.mcap`, and exports to other formats.
//!
//! | module | holds |
//! | --- | --- |
//! | [`read`] | recordings of any origin as tracks, one file per format or family of formats |
//! | [`mcap`] | `run.mcap`, written as a flight goes and read back |
//! | [`export`] | recordings written in other formats, one file per format |
//!
//! Memory grows with the bytes read, not with lengths that a file claims. Ambiguous input is an error that names the option
//! to set.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod export;
pub mod mcap;
pub mod read;

pub use read::{ReadError, ReadOptions, Recording, open};
pub use tautline_core::track;
