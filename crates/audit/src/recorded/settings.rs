//! Settings of an audit, the limits that follow from the settings, and errors in the settings or in the recording.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use serde::Deserialize;

use crate::envelope::{Envelope, Limit, Quantity};
use crate::obstacle::{Obstacle, ObstacleError};
use crate::sweep::{Interval, MAX_LENGTH_M, MIN_LIMIT_M};

/// Largest number that is accepted, be it a length \[m\], a time \[s\] or an acceleration \[m/s^2\].
pub(super) const LARGEST: f64 = MAX_LENGTH_M;

/// How vehicles are taken to move between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Interpolation {
    /// On a straight line at constant speed. The sweep is exact.
    Linear,
    /// Not at all, with a jump at each sample. The jump is swept like a straight flight that takes no time; vehicles that
    /// jump at the same instant are swept together.
    Hold,
    /// On the curves that the recording holds; each minimum is enclosed to [`super::WIDTH_M`].
    Polynomial,
    /// On any path whose acceleration stays within a bound: true distances lie within an interval around those of the
    /// line, or of the cubic where the recording has velocities.
    Bounded,
}

impl Interpolation {
    /// All motions.
    pub const ALL: [Self; 4] = [Self::Linear, Self::Hold, Self::Polynomial, Self::Bounded];

    /// The name of the motion for `--motion`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Hold => "hold",
            Self::Polynomial => "polynomial",
            Self::Bounded => "bounded",
        }
    }
}

/// What is said of one vehicle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VehicleSettings {
    /// Radius \[m\]; where the recording has one, this one counts.
    pub radius_m: Option<f64>,
    /// Added to the vehicle's times \[s\].
    pub offset_s: f64,
    /// Largest acceleration \[m/s^2\]; without it, that of the [`Settings`].
    pub max_accel_m_s2: Option<f64>,
}

/// What is asked.
///
/// Two vehicles i and j must stay `max(delta, r_i + r_j)` apart, centre to centre, where each part counts that is given.
/// A separation **strictly** below that is a violation. With an ellipsoid lengths are divided by its axes first, so two
/// equal ellipsoids touch at a scaled distance of 2, and delta, if given, is a scaled distance too.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Safety distance delta \[m\].
    pub delta_m: Option<f64>,
    /// What happens between samples. `None` asks for straight lines between samples, and curves where the recording has
    /// curves.
    pub motion: Option<Interpolation>,
    /// Largest acceleration \[m/s^2\] of every vehicle, for [`Interpolation::Bounded`].
    pub max_accel_m_s2: Option<f64>,
    /// Radius \[m\] of every vehicle of which nothing else is said; it goes before those of the recording.
    pub radius_m: Option<f64>,
    /// Half axes \[m\] of the ellipsoid around each vehicle, such as a downwash that reaches far down.
    pub ellipsoid_m: Option<Vector3<f64>>,
    /// Judge from here on \[s\].
    pub from_s: Option<f64>,
    /// Judge up to here \[s\].
    pub to_s: Option<f64>,
    /// Pairs are not judged while both vehicles are at or below this height \[m\], and obstacles not while the vehicle is.
    pub above_m: Option<f64>,
    /// Samples farther apart in time than this \[s\] have a gap between them, which nothing is known of. `None` lets each
    /// vehicle's usual interval decide: a gap is more than one and a half of it.
    pub max_gap_s: Option<f64>,
    /// Whether it is undecided where a vehicle is not seen over the whole window.
    pub require_presence: bool,
    /// What is said of single vehicles, by name.
    pub vehicles: BTreeMap<String, VehicleSettings>,
    /// The vehicles to judge, by name; `None` for all.
    pub only: Option<BTreeSet<String>>,
    /// What else is in the way.
    pub obstacles: Vec<Obstacle>,
    /// What each vehicle may do by itself. Where it is all that is asked, nothing is said of how close two came.
    pub envelope: Envelope,
    /// Accelerations are means over windows of this length \[s\]: how much the velocity changes over one, over its length.
    /// `None` takes accelerations at instants, and does not hold corners of curves against a limit.
    pub accel_window_s: Option<f64>,
    /// Whether delta or the ellipsoid are what the recording says of itself: beside an `envelope` that asks nothing of a
    /// vehicle that is alone, without an obstacle.
    pub is_own_limit: bool,
}

impl Settings {
    /// Whether any two vehicles came closer than delta \[m\].
    #[must_use]
    pub fn delta(delta_m: f64) -> Self {
        Self { delta_m: Some(delta_m), ..Self::default() }
    }

    pub(super) fn window(&self) -> Interval {
        Interval { from_s: self.from_s.unwrap_or(f64::NEG_INFINITY), to_s: self.to_s.unwrap_or(f64::INFINITY) }
    }

    /// Whether something beside a recording's own radii says how close two may come, or a vehicle and an obstacle.
    pub(super) fn asks_for_separation(&self) -> bool {
        let asks = [self.delta_m.is_some(), self.ellipsoid_m.is_some(), self.radius_m.is_some()];
        asks.contains(&true)
            || !self.obstacles.is_empty()
            || self.vehicles.values().any(|of| of.radius_m.is_some())
            || self.envelope.is_empty()
    }

    pub(super) fn limits(&self) -> Limits {
        let touching = self.ellipsoid_m.map_or(0.0, |_| TOUCHING_ELLIPSOIDS);
        Limits {
            delta: self.delta_m.unwrap_or(touching),
            by_radii: self.ellipsoid_m.is_none(),
            above: self.above_m.map(|above_m| self.ellipsoid_m.map_or(above_m, |axes| above_m / axes.z)),
        }
    }

    /// Whether every number is in range.
    pub(super) fn check(&self) -> Result<(), RecordedError> {
        const POSITIVE: (f64, &str) = (MIN_LIMIT_M, "above 0, and finite");
        const RADIUS: (f64, &str) = (0.0, "0 m or more, and finite");
        const ACCELERATION: (f64, &str) = (0.0, "0 or more, and finite");
        const FINITE: (f64, &str) = (-LARGEST, "a finite number");
        let check = |what: &str, value: Option<f64>, (least, range): (f64, &'static str)| match value {
            Some(value) if !(least..=LARGEST).contains(&value) => {
                Err(RecordedError::OutOfRange { what: what.to_owned(), range, value })
            }
            _ => Ok(()),
        };
        check("delta", self.delta_m, POSITIVE)?;
        check("the radius", self.radius_m, RADIUS)?;
        check("the largest acceleration", self.max_accel_m_s2, ACCELERATION)?;
        for axis in self.ellipsoid_m.iter().flatten() {
            check("each axis of the ellipsoid", Some(*axis), POSITIVE)?;
        }
        check("the start of the window", self.from_s, FINITE)?;
        check("its end", self.to_s, FINITE)?;
        check("the height", self.above_m, FINITE)?;
        if let Some(value) = self.max_gap_s.filter(|gap_s| gap_s.is_nan() || *gap_s < 0.0) {
            return Err(RecordedError::OutOfRange { what: "the longest gap".to_owned(), range: "0 s or more", value });
        }
        let Interval { from_s, to_s } = self.window();
        if from_s > to_s {
            return Err(RecordedError::EmptyWindow { from_s, to_s });
        }
        for (name, of) in &self.vehicles {
            check(&format!("the radius of {name}"), of.radius_m, RADIUS)?;
            check(&format!("the clock offset of {name}"), Some(of.offset_s), FINITE)?;
            check(&format!("the largest acceleration of {name}"), of.max_accel_m_s2, ACCELERATION)?;
        }
        for Limit { quantity, allowed } in &self.envelope.limits {
            let range = if quantity.derivative() == 0 { FINITE } else { POSITIVE };
            check(&format!("the limit of {}", quantity.name()), Some(*allowed), range)?;
        }
        check("the window of accelerations", self.accel_window_s, POSITIVE)?;
        let is_limited = self.envelope.limits.iter().any(|limit| limit.quantity == Quantity::Acceleration);
        if self.accel_window_s.is_some() && (!is_limited || self.motion == Some(Interpolation::Bounded)) {
            return Err(RecordedError::NoAccelWindow);
        }
        if let Some(quantity) = self.envelope.of_motion().filter(|_| self.motion == Some(Interpolation::Hold)) {
            return Err(RecordedError::LimitOfJumps { limit: quantity.name() });
        }
        if self.ellipsoid_m.is_some() && !self.obstacles.is_empty() {
            return Err(RecordedError::ObstaclesAndEllipsoid);
        }
        self.obstacles.iter().try_for_each(|obstacle| Ok(obstacle.check()?))
    }
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
    /// Invalid sample or curve: a number that is not finite or too large, or a curve without coefficients.
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
    /// Invalid obstacle.
    #[error(transparent)]
    Obstacle(#[from] ObstacleError),
}
