//! Reads recordings of many formats as tracks, writes and reads `run.mcap`, and exports recordings.
//!
//! | module | holds |
//! | --- | --- |
//! | [`read`] | readers: one file per format or family of formats |
//! | [`mcap`] | `run.mcap`, written during a flight and read back |
//! | [`export`] | writers of other formats, one file per format |
//!
//! Memory grows with the bytes read, not with the lengths in file headers. Ambiguous input is an error that names the
//! option to set.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod export;
pub mod mcap;
pub mod read;
mod segments;

pub use nalgebra;
pub use read::{ReadError, ReadOptions, Recording, open, open_plan};
pub use tautline_core::track;
