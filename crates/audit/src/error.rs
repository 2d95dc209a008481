//! Why a motion cannot be judged.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::obstacle::Obstacle;

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

/// Scaled distance at which two equal ellipsoids touch.
pub const TOUCHING_ELLIPSOIDS: f64 = 2.0;

/// What keeps two apart: lengths in metres or, around ellipsoids, over their half axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Distance that any two vehicles must keep.
    pub(super) delta: f64,
    /// Whether the vehicles' radii count.
    pub(super) by_radii: bool,
    /// Height at or below which two need not keep it.
    pub(super) above: Option<f64>,
}

impl Limits {
    /// What two vehicles of these radii must keep between their centres.
    pub(super) fn of_vehicles(self, first: f64, second: f64) -> f64 {
        if self.by_radii { self.delta.max(first + second) } else { self.delta }
    }

    /// What the centre of a vehicle of this radius must keep from an obstacle's surface.
    pub(super) fn of_obstacle(self, obstacle: &Obstacle, radius: f64) -> f64 {
        obstacle.clearance_m.unwrap_or(if self.by_radii { (0.5 * self.delta).max(radius) } else { 0.5 * self.delta })
    }
}

/// Says whether the work is to stop. Loops that may take long look at it, and leave what they found incomplete: who started
/// the work looks at it too, and drops the result.
#[derive(Clone, Debug, Default)]
pub(super) struct Interruption(Option<Arc<AtomicBool>>);

impl Interruption {
    pub(super) fn new(flag: Arc<AtomicBool>) -> Self {
        Self(Some(flag))
    }

    #[inline]
    pub(super) fn is_set(&self) -> bool {
        self.0.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }
}
