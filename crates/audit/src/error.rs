//! Why a motion cannot be judged.

/// Why something could not be judged. Nothing changes then, except that the outcome is no longer clear.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AuditError {
    /// The safety distance is not a positive number within range.
    #[error("the safety distance must be between {min_m:e} m and {max_m:e} m, not {delta_m} m")]
    Delta {
        /// The safety distance offered \[m\].
        delta_m: f64,
        /// Smallest that is accepted \[m\].
        min_m: f64,
        /// Largest that is accepted \[m\].
        max_m: f64,
    },
    /// More vehicles than can be numbered.
    #[error("{vehicles} vehicles are more than can be judged ({max})", max = u32::MAX)]
    TooManyVehicles {
        /// How many were asked for.
        vehicles: usize,
    },
    /// A step came before the start.
    #[error("a step was offered before the start")]
    NotStarted,
    /// A second start came.
    #[error("a second start was offered")]
    AlreadyStarted,
    /// Positions of another number of vehicles.
    #[error("expected the positions of {expected} vehicles, found {found}")]
    WrongCount {
        /// Vehicles that are judged.
        expected: usize,
        /// Vehicles offered.
        found: usize,
    },
    /// A time that is not a finite number.
    #[error("the time {time_s} s is not a finite number")]
    TimeNotFinite {
        /// The time offered \[s\].
        time_s: f64,
    },
    /// A time not later than the one before.
    #[error("the time {time_s} s is not later than the time before, {previous_s} s")]
    TimeNotIncreasing {
        /// The time before \[s\].
        previous_s: f64,
        /// The time offered \[s\].
        time_s: f64,
    },
    /// A position that is not a finite number.
    #[error("the position of vehicle {} at {time_s} s is not a finite number", vehicle + 1)]
    NotFinite {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The time \[s\].
        time_s: f64,
    },
    /// A position whose square could overflow.
    #[error("the position of vehicle {} at {time_s} s is beyond {limit_m:e} m, too far to judge", vehicle + 1)]
    TooFar {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The time \[s\].
        time_s: f64,
        /// Largest coordinate that is accepted \[m\].
        limit_m: f64,
    },
}
