//! What every crate of tautline speaks of, as plain data: the state of a swarm, recorded motion and samples.
//!
//! | module | holds |
//! | --- | --- |
//! | [`swarm`] | positions and velocities, a row per vehicle and a column per axis |
//! | [`track`] | recorded motion of any origin: instants, pieces of curves, clocks |
//! | [`record`] | a flight's samples as they are made, and the traits that receive them |
//! | [`text`] | numbers as people read them |
//!
//! SI units, named at the end of each name (`clearance_m`). One inertial frame, z up. Vehicles are counted from 0 in code
//! and from 1 in everything a person reads.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod record;
pub mod swarm;
pub mod text;
pub mod track;

/// The program's name, as its artefacts tell who made them.
pub const PROGRAM: &str = "tautline";

/// The version of every crate of the program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
