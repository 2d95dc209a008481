//! What is to be flown: the validated scenario.
//!
//! A [`Scenario`] is plain data, complete and checked: everything downstream may rely on what [`Scenario::validate`]
//! promises. It is read from TOML by [`Scenario::read`], or built in code from [`Scenario::new`]. `document` holds the
//! keys of the TOML; [`Scenario::resolved_toml`] writes the same document with nothing left to be derived. `builtin`
//! holds the embedded scenarios.

mod actuation;
mod breathing;
#[cfg(feature = "files")]
mod build;
#[cfg(feature = "files")]
pub mod builtin;
#[cfg(feature = "files")]
mod chance;
#[cfg(feature = "shapes")]
mod columns;
#[cfg(feature = "files")]
mod deserializer;
#[cfg(feature = "files")]
mod document;
#[cfg(feature = "shapes")]
mod drawn;
mod error;
mod failure;
#[cfg(feature = "files")]
mod files;
#[cfg(feature = "files")]
mod graph;
mod imperfections;
#[cfg(feature = "files")]
mod laws;
#[cfg(feature = "files")]
mod legs;
mod limits;
mod network;
#[cfg(feature = "files")]
mod noise;
#[cfg(feature = "files")]
mod obstacles;
#[cfg(feature = "files")]
mod overrides;
#[cfg(feature = "shapes")]
mod points;
#[cfg(feature = "files")]
mod reference;
mod resolution;
#[cfg(feature = "files")]
mod resolved;
#[cfg(feature = "files")]
mod safety;
#[cfg(feature = "schema")]
mod schema;
mod sensing;
mod shape_of_safety;
#[cfg(feature = "files")]
mod shapes;
#[cfg(feature = "files")]
mod slots;
#[cfg(feature = "files")]
mod source;
mod spec;
#[cfg(feature = "files")]
mod start;
mod step;
#[cfg(feature = "files")]
mod suggest;
mod surroundings;
#[cfg(feature = "files")]
mod template;
#[cfg(feature = "files")]
mod text;
mod time;
#[cfg(feature = "files")]
mod time_table;
mod unicycle;
mod validate;
#[cfg(feature = "files")]
mod values;
mod vehicle;
#[cfg(feature = "files")]
mod vehicle_table;
mod weather;
#[cfg(feature = "reports")]
mod whole;
#[cfg(feature = "files")]
mod wind;

pub use actuation::ActuationSpec;
#[cfg(feature = "reports")]
pub(crate) use chance::random;
pub use error::{Field, Place, ScenarioError};
pub use failure::{Failure, FailureKind};
pub use limits::{
    BYTES_PER_EDGE, BYTES_PER_VEHICLE, CONTACT_PREDICTION_M, LARGEST, MAX_HALVINGS, MAX_MEMORY_BYTES, MAX_NAME_CHARS,
    MAX_STEPS, SMALLEST,
};
pub use network::{LinkFailure, Missing, NearBy, NetworkSpec};
#[cfg(feature = "program")]
pub(crate) use obstacles::{OBSTACLE_HELP, ObstacleTable, Solid};
#[cfg(feature = "files")]
pub use overrides::Override;
pub use resolution::Drift;
#[cfg(feature = "schema")]
pub use schema::schema;
pub use sensing::SensingSpec;
#[cfg(feature = "files")]
pub use source::{MAX_FILE_BYTES, Source};
pub use spec::{DEFAULT_HULL_RADIUS_M, DEFAULT_MASS_KG, PlantSpec, Safety, Scenario, Space};
#[cfg(feature = "reports")]
pub(crate) use start::{offset, scatter};
#[cfg(feature = "files")]
pub use template::{Draw, NamedLaw, Template};
pub use time::TimeSpec;
pub use vehicle::{DEFAULT_ATTITUDE_HZ, QUADROTOR_CONTROL_HZ, QUADROTOR_DT_S};
#[cfg(feature = "reports")]
pub(crate) use whole::takes_whole_numbers_alone;
