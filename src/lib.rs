//! tautline flies a swarm into formation inside a rigid-body engine and proves that nothing touched.
//!
//! A control law steers N vehicles into a formation; vehicles are rigid bodies in Rapier; an independent judge sweeps
//! every step of every pair and says whether any two came closer than a safety distance delta. Data flows one way:
//!
//! ```text
//! scenario -> sim ( sense -> law -> actuate -> plant -> observe ) -> record -> audit / metrics / figures -> report
//! ```
//!
//! # Fly a scenario
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use tautline::scenario::{Override, Scenario, Source};
//! use tautline::sim::{self, Parts};
//! use tautline::audit;
//!
//! let shorter = Override::parse("time.duration_s=5")?;
//! let scenario = Scenario::read(&Source::resolve("pentagon")?, &[shorter])?;
//! let parts = Parts::of(&scenario)?;
//! let flight = sim::fly(&scenario, parts, &mut (), &mut |_step| ControlFlow::Continue(()))?;
//! assert_eq!(flight.audit.status, audit::Status::Clear);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Judge positions of your own
//!
//! [`audit::Auditor`] needs nothing but times and positions. [`law::Law`] and [`plant::Plant`] are traits: bring your
//! own law (`examples/own_law.rs`), or your own vehicle.
//!
//! # Units and frames
//!
//! SI units, in the names (`clearance_m`, `a22_per_s`). One inertial frame, z up. Tables of vectors are N x 3, a row
//! per vehicle. Vehicles are counted from 0 in code and from 1 in everything a person reads. Equation numbers are those
//! of "Collision-free vehicle formation control using graph Laplacian and edge-tension function".

#[cfg(feature = "reports")]
pub mod attack;
pub mod audit;
#[cfg(feature = "campaigns")]
pub mod campaign;
#[cfg(feature = "program")]
pub mod cli;
#[cfg(feature = "reports")]
pub mod compare;
#[cfg(feature = "ideal")]
pub mod continuous;
#[cfg(feature = "recordings")]
pub mod export;
pub mod feedback;
#[cfg(feature = "reports")]
pub mod figures;
pub mod formation;
pub mod graph;
pub mod law;
pub mod link;
#[cfg(feature = "reports")]
pub mod margin;
pub mod metrics;
pub mod observation;
#[cfg(any(feature = "pictures", feature = "reports"))]
pub mod plan;
pub mod plant;
pub mod preflight;
#[cfg(feature = "recordings")]
pub mod read;
pub mod record;
#[cfg(feature = "pictures")]
pub mod render;
#[cfg(feature = "reports")]
pub mod replay;
#[cfg(feature = "reports")]
pub mod report;
#[cfg(feature = "reports")]
pub mod run;
pub mod scenario;
pub mod sim;
pub mod space;
#[cfg(feature = "reports")]
pub mod splitting;
#[cfg(feature = "reports")]
pub mod statistics;
pub mod swarm;
pub mod target;
mod text;
pub mod track;
#[cfg(feature = "reports")]
pub mod validate;
pub mod vehicle;
pub mod wind;
