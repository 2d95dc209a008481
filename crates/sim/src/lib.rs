//! Scenarios, and the simulation of vehicles in a rigid-body engine under a control law.
//!
//! [`Scenario`] is a validated flight, read from TOML or made in code; [`Simulation`] is stepped, saved and loaded. A law of
//! your own implements [`Law`], a vehicle [`Plant`], an imperfection between the world and the law
//! [`Imperfections`]. Data flows one way:
//!
//! ```text
//! scenario -> sim ( advance -> judge -> sense -> command -> actuate -> apply ) -> samples and events
//! ```
//!
//! | module | holds |
//! | --- | --- |
//! | [`scenario`] | the validated flight; `document` holds the keys of its file |
//! | [`preflight`] | checks before a flight: stability, certificate, step, traps, rigidity |
//! | [`sim`] | the loop |
//! | [`plant`] | vehicles that hold a command over a step; `rapier` is the physics engine |
//! | [`vehicle`] | bodies that are more than points: models, forces, rotors, the attitude loop |
//! | [`link`] | imperfections between truth and law: radio, sensing, actuation |
//! | [`continuous`] | the equations of motion solved, for points with the law inside |
//! | [`metrics`] | numbers folded from recorded samples |
//! | [`plan`] | formations of a flight, their placement over the swarm, and edge tensions |

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod continuous;
pub mod link;
pub mod metrics;
pub mod plan;
pub mod plant;
pub mod preflight;
pub mod scenario;
pub mod sim;
pub mod vehicle;

pub use link::Imperfections;
pub use plant::Plant;
pub use scenario::Scenario;
pub use sim::Simulation;
pub use tautline_audit as audit;
pub use tautline_core::{record, swarm};
pub use tautline_laws::law::Law;
pub use tautline_laws::{formation, graph, law, observation, space, target, wind};
