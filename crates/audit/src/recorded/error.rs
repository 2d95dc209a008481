//! Why a recording cannot be judged as asked.

use crate::obstacle::ObstacleError;

/// Why a recording cannot be judged as asked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordedError {
    /// A number of the settings is out of range.
    #[error("{what} must be {range}, not {value:?}")]
    OutOfRange {
        /// What it is.
        what: String,
        /// What it may be.
        range: &'static str,
        /// What was given.
        value: f64,
    },
    /// The window is empty.
    #[error("the window from {from_s:?} s to {to_s:?} s holds no time")]
    EmptyWindow {
        /// Its start \[s\].
        from_s: f64,
        /// Its end \[s\].
        to_s: f64,
    },
    /// Bounded motion without a bound.
    #[error("bounded motion of vehicle {vehicle} needs its largest acceleration")]
    NoBound {
        /// The vehicle.
        vehicle: String,
    },
    /// Neither a safety distance nor a radius.
    #[error("nothing says how close vehicle {vehicle} may come: there is no delta, and no radius for it")]
    NoLimit {
        /// The vehicle.
        vehicle: String,
    },
    /// Something was said of a vehicle that is not there.
    #[error("the recording has no vehicle {name}; it has {known}")]
    UnknownVehicle {
        /// The name.
        name: String,
        /// The names there are, shortened.
        known: String,
    },
    /// Samples where curves were asked for.
    #[error("vehicle {vehicle} has samples and no curve: what happens between samples must be stated")]
    NotACurve {
        /// The vehicle.
        vehicle: String,
    },
    /// Curves where a motion between samples was asked for.
    #[error("vehicle {vehicle} has a curve: there is nothing between samples to be stated")]
    NotSamples {
        /// The vehicle.
        vehicle: String,
    },
    /// A vehicle that has no name.
    #[error("there is no name for vehicle {} (from 1)", vehicle + 1)]
    Unnamed {
        /// The vehicle.
        vehicle: usize,
    },
    /// A time not later than the one before.
    #[error("vehicle {vehicle}: the time {time_s:?} s is not later than {previous_s:?} s before it")]
    TimeNotIncreasing {
        /// The vehicle.
        vehicle: String,
        /// The time before \[s\].
        previous_s: f64,
        /// The time \[s\].
        time_s: f64,
    },
    /// Items out of order.
    #[error("the item of vehicle {vehicle} at {time_s:?} s comes after one at {previous_s:?} s")]
    OutOfOrder {
        /// The vehicle.
        vehicle: String,
        /// The time before \[s\].
        previous_s: f64,
        /// The time \[s\].
        time_s: f64,
    },
    /// Vehicles whose times cannot be of one clock.
    #[error("vehicles {first} and {second} are first seen {days} days apart, which is no flight by one clock")]
    TwoClocks {
        /// The one that is seen first.
        first: String,
        /// The one that is seen last.
        second: String,
        /// How long after it \[days\].
        days: u64,
    },
    /// A sample or a curve that is none: a number that is not finite or too large, no coefficients.
    #[error("vehicle {vehicle} at {time_s:?} s: {what}")]
    Item {
        /// The vehicle.
        vehicle: String,
        /// When \[s\].
        time_s: f64,
        /// What is wrong with it.
        what: String,
    },
    /// A radius that is not the same throughout.
    #[error("vehicle {vehicle} at {time_s:?} s: the radius changes to {radius_m:?} m")]
    RadiusChanges {
        /// The vehicle.
        vehicle: String,
        /// When \[s\].
        time_s: f64,
        /// What it changes to \[m\].
        radius_m: f64,
    },
    /// A limit on speeds or accelerations of vehicles that jump.
    #[error("vehicles that are held between samples jump: nothing can be said of their {limit}")]
    LimitOfJumps {
        /// What was to be limited.
        limit: &'static str,
    },
    /// A window of accelerations where none are limited, or where a bound on them is assumed.
    #[error(
        "a window of accelerations says nothing where no acceleration is limited, or where accelerations are bounded"
    )]
    NoAccelWindow,
    /// Obstacles and an ellipsoid.
    #[error("obstacles cannot be judged by an ellipsoid")]
    ObstaclesAndEllipsoid,
    /// The work was interrupted ([`super::TrackAuditor::with_interruption`]).
    #[error("interrupted")]
    Interrupted,
    /// An obstacle that is none.
    #[error(transparent)]
    Obstacle(#[from] ObstacleError),
}
