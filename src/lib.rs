//! Flies formations of vehicles in a rigid-body engine and proves that no two come too close.
//!
//! A control law steers N vehicles into a formation. Vehicles are rigid bodies in Rapier. An independent judge sweeps
//! every step of every pair and reports whether two came closer than a safety distance delta. This crate re-exports the
//! crates of the workspace and contains the command line. Data flows one way:
//!
//! ```text
//! scenario -> sim ( advance -> judge -> sense -> command -> actuate -> apply ) -> samples -> report
//! ```
//!
//! # Fly a scenario
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use tautline::scenario::{Override, Scenario, Source};
//! use tautline::sim::{self, Components};
//! use tautline::audit;
//!
//! let shorter = Override::parse("time.duration_s=5")?;
//! let scenario = Scenario::read(&Source::resolve("pentagon")?, &[shorter])?;
//! let parts = Components::of(&scenario)?;
//! let flight = sim::fly(&scenario, parts, &mut (), &mut |_step| ControlFlow::Continue(()))?;
//! assert_eq!(flight.audit.status, audit::Status::Clear);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Judge positions of your own
//!
//! [`audit::Auditor`] needs only times and positions. [`law::Law`] and [`plant::Plant`] are traits: implement your own
//! law (`examples/own_law.rs`) or your own vehicle.
//!
//! # Units and frames
//!
//! SI units, in the names (`clearance_m`, `a22_per_s`). One inertial frame, z up. Tables of vectors are N x 3, a row
//! per vehicle. Vehicles are counted from 0 in code and from 1 in output. Equation numbers are those of "Collision-free
//! vehicle formation control using graph Laplacian and edge-tension function".

pub mod cli;

pub use tautline_audit as audit;
pub use tautline_core::{fact, failure, files, monitor, nalgebra, obstacle, option, record, swarm, text, track};
pub use tautline_laws::{formation, graph, law, observation, space, target, wind};
pub use tautline_recordings::{export, mcap, read};
#[cfg(feature = "viewer")]
pub use tautline_render as render;
pub use tautline_report::{figures, flight_log, replay, report, request, run};
pub use tautline_shield as shield;
pub use tautline_sim::{continuous, link, metrics, plan, plant, preflight, scenario, sim, vehicle};
pub use tautline_studies as studies;
pub use tautline_studies::{attack, campaign, compare, margin, splitting, statistics, sweep};
pub use tautline_validate as validate;
pub use tautline_watch as watch;
