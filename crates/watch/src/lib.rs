//! Live monitor of separation: poses in, alarms out.
//!
//! | module | holds |
//! | --- | --- |
//! | [`Monitor`] | the core, without input, output or a clock: takes poses, judges the present and the past |
//! | [`pair`] | derivation and formulas of the time until which a pair is clear |

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod ahead;
mod clock;
mod event;
mod history;
mod monitor;
pub mod pair;
mod plan;
mod settings;
mod violations;

pub use clock::{DRIFT, STEP_S};
pub use event::{Assessment, Event, Fault, Pair, PairTime, Reason, Separation, State, Violation};
pub use history::HISTORY;
pub use monitor::{LONGEST_NAME, MOST_EVENTS, Monitor, Pose, Taken};
pub use plan::Plan;
pub use settings::{ClockScope, Expected, Settings, SettingsError, TimeBase};
pub use violations::MOST_OPEN;
