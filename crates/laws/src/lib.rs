//! Formation control laws, with graphs, formations, targets, obstacles and wind.
//!
//! | module | holds |
//! | --- | --- |
//! | [`law`] | one file per law: scenario keys, bounds, energy, certificate; [`law::Law`] is the trait for custom laws |
//! | [`observation`] | input of a law: own state, received and sensed states of other vehicles, target |
//! | [`graph`] | which vehicles exchange states: Laplacians, algebraic connectivity |
//! | [`formation`] | target shapes, desired distances, the error of a shape up to a rigid motion |
//! | [`target`] | legs of formations, arrival criteria, assignment of vehicles to slots |
//! | [`space`] | neighbours by distance, point sets with a minimum spacing, shapes of obstacles |
//! | [`wind`] | mean wind, gusts and turbulence by exact filters |
//!
//! The feature `drawn`, on by default, holds formations drawn as letters, SVG and PNG pictures: `formation::Drawing`.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod formation;
pub mod graph;
pub mod law;
pub mod observation;
pub mod space;
pub mod target;
pub mod wind;

pub use nalgebra;
