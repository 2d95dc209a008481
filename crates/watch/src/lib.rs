//! Live monitor of separation: poses in, alarms out.
//!
//! | module | holds |
//! | --- | --- |
//! | [`Monitor`] | the core, without input, output or a clock: takes poses, judges the present and the past |
//! | [`source`] | standard input, MAVLink, rosbridge and Foxglove, each in a thread |
//! | [`watch`] | a watch from its first input to its end, with [`Notice`]s as text and JSON |
//! | [`Record`] | recording of the poses that the monitor used |
//! | [`page`] | server of the live page |
//! | [`foxglove_server`] | server for Foxglove |
//! | `velocity` | derivation of the enclosure of velocities, and the test whether sent velocities agree |
//! | `streams` | evidence that one name carries the messages of two vehicles |
//! | [`pair`] | derivation and formulas of the time until which a pair is clear |

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod absences;
mod ahead;
mod clock;
mod event;
pub mod foxglove_server;
mod history;
mod monitor;
mod notice;
pub mod page;
pub mod pair;
mod plan;
mod record;
mod session;
mod settings;
pub mod source;
mod streams;
mod velocity;
mod violations;
mod words;

pub use clock::{DRIFT, STEP_S};
pub use event::{
    Assessment, Event, Fault, Loss, MessageError, Pair, PairTime, PlanClock, Problem, Reason, Separation, State,
};
pub use history::HISTORY;
pub use monitor::{LONGEST_NAME, MOST_EVENTS, Monitor, Pose, Taken};
pub use notice::{Notice, Statement};
pub use plan::Plan;
pub use record::Record;
pub use session::{ASSESS_PERIOD_S, LINE_PERIOD_S, Output, Summary, watch};
pub use settings::{
    Bound, ClockScope, DEFAULT_ACCEL_M_S2, Expected, REPORTED_DEVIATIONS, Settings, SettingsError, TimeBase,
};
pub use tautline_audit::recorded::{Counterpart, PlanConflict, PlanReference};
pub use tautline_audit::{Status, Violation};
pub use tautline_core::track::PlanEnd;
pub use violations::MOST_OPEN;
