//! Plain data shared by all crates of tautline: the state of a swarm, recorded motion, samples; and a projection.
//!
//! | module | holds |
//! | --- | --- |
//! | [`swarm`] | positions and velocities, a row per vehicle and a column per axis |
//! | [`track`] | recorded motion of any origin: instants, pieces of curves, clocks |
//! | [`record`] | a flight's samples as they are made, and the traits that receive them |
//! | [`fact`] | facts that a statement rests on, with their sources |
//! | [`option`] | options that messages name |
//! | [`text`] | formatting of numbers |
//! | [`failure`], [`monitor`] | errors of requests, and their interface to a caller |
//! | [`files`] | atomic writes |
//! | [`obstacle`] | obstacles at rest and their shapes |
//! | [`half_spaces`] | the point nearest to a wish in half-spaces and a ball, for laws and the shield |
//!
//! SI units; each name ends with its unit (`clearance_m`). One inertial frame, z up. Vehicles count from 0 in code and
//! from 1 in all output.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod fact;
pub mod failure;
pub mod files;
pub mod half_spaces;
pub mod monitor;
pub mod obstacle;
pub mod option;
pub mod record;
pub mod swarm;
pub mod text;
pub mod track;

pub use nalgebra;

/// Name of the program in its artefacts.
pub const PROGRAM: &str = "tautline";

/// Version of every crate of the workspace.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
