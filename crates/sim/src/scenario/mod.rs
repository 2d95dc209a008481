//! Scenarios: validated descriptions of a flight.
//!
//! A [`Scenario`] is plain data that holds a whole flight; [`Scenario::validate`] lists its invariants.
//! [`Scenario::read`] reads it from TOML, [`Scenario::new`] builds it in code. Data flow of a file: `source` -> `text`
//! (TOML and overrides) -> `check` (schema) -> `document` (keys) -> `build` -> `validate`. [`Scenario::resolved`]
//! writes a scenario back as TOML with every default and random number written out.

mod build;
pub mod builtin;
mod check;
mod document;
#[cfg(feature = "drawn")]
mod drawing;
mod environment;
mod error;
mod external;
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

pub use crate::link::{
    ActuationSpec, Failure, FailureKind, LinkFailure, NearStates, NetworkSpec, SensingSpec, StalePolicy,
};
pub use crate::shield::ShieldSpec;
pub(crate) use document::is_default;
pub use environment::IgnoredPart;
pub(crate) use error::entry_key;
pub use error::{ErrorKind, ScenarioError, edit_distance};
pub use external::ExternalLaw;
pub use limits::{
    BYTES_PER_EDGE, BYTES_PER_VEHICLE, CONTACT_PREDICTION_M, LARGEST, MAX_HALVINGS, MAX_MEMORY_BYTES, MAX_NAME_CHARS,
    MAX_STEPS, SMALLEST,
};
pub use obstacles::{OBSTACLE_HELP, ObstacleTable};
pub use resolution::Drift;
pub use resolved::Resolved;
pub use schema::{TomlSchema, key_choices, key_paths, schema};
pub use source::{MAX_FILE_BYTES, Source, takes_integers_only};
pub use spec::{DEFAULT_HULL_RADIUS_M, DEFAULT_MASS_KG, PlantSpec, Safety, Scenario, Space};
pub(crate) use start::unit;
pub use start::{offset, random, scatter};
pub use template::{Draw, NamedLaw, Template};
pub use text::Override;
pub use time::TimeSpec;
pub use vehicle::{DEFAULT_ATTITUDE_HZ, QUADROTOR_CONTROL_HZ, QUADROTOR_DT_S};
