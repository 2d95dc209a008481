//! What is to be flown: the validated scenario.
//!
//! A [`Scenario`] is plain data, complete and checked: everything downstream may rely on what [`Scenario::validate`]
//! promises. It is read from TOML by [`Scenario::read`], or built in code from [`Scenario::new`]. `document` holds the
//! keys of the TOML; [`Scenario::resolved_toml`] writes the same document with nothing left to be derived. `builtin`
//! holds the embedded scenarios.

mod build;
pub mod builtin;
mod check;
mod document;
mod error;
mod files;
mod formation;
mod graph;
mod limits;
mod obstacles;
mod reference;
mod resolution;
mod resolved;
mod schema;
mod source;
mod spec;
mod start;
mod template;
mod text;
mod time;
mod validate;
mod vehicle;

pub use crate::link::{ActuationSpec, Failure, FailureKind, LinkFailure, Missing, NearBy, NetworkSpec, SensingSpec};
pub use error::{Field, Place, ScenarioError};
pub use limits::{
    BYTES_PER_EDGE, BYTES_PER_VEHICLE, CONTACT_PREDICTION_M, LARGEST, MAX_HALVINGS, MAX_MEMORY_BYTES, MAX_NAME_CHARS,
    MAX_STEPS, SMALLEST,
};
pub use obstacles::{OBSTACLE_HELP, ObstacleTable, Solid};
pub use resolution::Drift;
pub use schema::{schema, takes_integers_only};
pub use source::{MAX_FILE_BYTES, Source};
pub use spec::{DEFAULT_HULL_RADIUS_M, DEFAULT_MASS_KG, PlantSpec, Safety, Scenario, Space};
pub use start::{offset, random, scatter};
pub use template::{Draw, NamedLaw, Template};
pub use text::Override;
pub use time::TimeSpec;
pub use vehicle::{DEFAULT_ATTITUDE_HZ, QUADROTOR_CONTROL_HZ, QUADROTOR_DT_S};
