//! Air that moves: a mean wind, gusts and turbulence.
//!
//! [`WindSpec`] says what blows; [`Wind`] is that wind in flight, with the chance in it. Mean and gusts are functions of
//! time, the same wherever a vehicle is; turbulence is a random process.

mod air;
mod dryden;
mod normal;
mod spec;

pub use air::Wind;
pub use dryden::Dryden;
pub use normal::Normals;
pub use spec::{Gust, WindSpec};
