//! Wind: mean wind, gusts and turbulence.
//!
//! [`WindSpec`] describes the wind of a scenario; [`Wind`] is its realization in a run, with random turbulence. Mean
//! and gusts are functions of time and do not depend on position; turbulence is a random process.

mod air;
mod dryden;
mod normal;
mod spec;

pub use air::Wind;
pub use dryden::Dryden;
pub use normal::Normals;
pub use spec::{Gust, WindSpec};
