//! Settings of an audit, the limits that follow from them, and errors in the settings or in the recording.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use serde::Deserialize;

use crate::cylinder::Cylinder;
use crate::enclosure::Target;
use crate::envelope::{Envelope, Limit, Quantity};
use crate::obstacle::{MovingObstacle, ObstacleError};
use crate::sweep::{Interval, MAX_LENGTH_M, MIN_LIMIT_M};
use crate::well_clear::WellClear;
use tautline_core::option::{
    ABOVE, ACCEL_WINDOW, CYLINDER, DELTA, ELLIPSOID, FROM, LAND_ON, LIMIT, MAX_ACCEL, MAX_GAP, MOTION, OBSTACLES,
    OFFSET, Opt, RADIUS, UNTIL, WELL_CLEAR,
};

/// Largest accepted number: a length \[m\], a time \[s\] or an acceleration \[m/s^2\].
pub(super) const LARGEST: f64 = MAX_LENGTH_M;

/// Assumed motion of vehicles between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Interpolation {
    /// Straight line at constant speed. The sweep is exact.
    Linear,
    /// Rest, with a jump at each sample. A jump is swept like a straight flight of zero duration; vehicles that jump at
    /// the same instant are swept together.
    Hold,
    /// Curves of the recording; each minimum is enclosed to [`super::WIDTH_M`].
    Polynomial,
    /// Any path whose acceleration stays within a bound. The true distance lies within an interval around that of the
    /// line, or of the cubic if the recording has velocities.
    Bounded,
}

impl Interpolation {
    /// All kinds of interpolation.
    pub const ALL: [Self; 4] = [Self::Linear, Self::Hold, Self::Polynomial, Self::Bounded];

    /// Returns whether another unit of time changes the motion.
    #[must_use]
    pub fn rests_on_seconds(self) -> bool {
        match self {
            // Scaled times leave the path of each vehicle unchanged.
            Self::Linear | Self::Hold | Self::Polynomial => false,
            Self::Bounded => true,
        }
    }

    /// Returns the name of the interpolation.
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

/// Setting whose effect changes with the unit of time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TimedSetting {
    /// The setting.
    pub option: Opt,
    /// Name of the vehicle, limit, obstacle or motion, if the setting is given for several.
    pub of: Option<String>,
}

impl TimedSetting {
    fn new(option: Opt) -> Self {
        Self { option, of: None }
    }

    fn of(option: Opt, name: &str) -> Self {
        Self { option, of: Some(name.to_owned()) }
    }
}

/// Settings of one vehicle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VehicleSettings {
    /// Radius \[m\]; overrides that of the recording.
    pub radius_m: Option<f64>,
    /// Clock offset, added to the vehicle's times \[s\].
    pub offset_s: f64,
    /// Largest acceleration \[m/s^2\]; by default that of the [`Settings`].
    pub max_accel_m_s2: Option<f64>,
}

/// Settings of an audit.
///
/// Vehicles i and j must stay `max(delta, r_i + r_j)` apart, centre to centre, where a part that is not given is
/// ignored. A separation **strictly** below that is a violation. With an ellipsoid, lengths are first divided by its
/// axes. Two equal ellipsoids touch at a scaled distance of 2, and delta is a scaled distance too.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Safety distance delta \[m\].
    pub delta_m: Option<f64>,
    /// Motion between samples. The default `None` uses straight lines between samples, and the curves of the recording
    /// where it has curves.
    pub motion: Option<Interpolation>,
    /// Largest acceleration of every vehicle \[m/s^2\], for [`Interpolation::Bounded`].
    pub max_accel_m_s2: Option<f64>,
    /// Radius of every vehicle without its own setting \[m\]; overrides those of the recording.
    pub radius_m: Option<f64>,
    /// Half axes of the ellipsoid around each vehicle \[m\], for example for a downwash that extends far down.
    pub ellipsoid_m: Option<Vector3<f64>>,
    /// Upright cylinder around each vehicle that no other vehicle may enter. Distances are then scaled, and the limit
    /// is 1. It excludes delta, radii and the ellipsoid.
    pub cylinder: Option<Cylinder>,
    /// Thresholds of well clear of air traffic. If separations have no other limit, they are not judged.
    pub well_clear: Option<WellClear>,
    /// Start of the judged window \[s\].
    pub from_s: Option<f64>,
    /// End of the judged window \[s\].
    pub until_s: Option<f64>,
    /// Height at or below which vehicles are on the ground \[m\]. A pair of vehicles is not judged while both are.
    pub above_m: Option<f64>,
    /// Names of obstacles on which vehicles land, such as the ground or a pad. Their distance from a vehicle is not
    /// judged while the vehicle is on the ground. They need [`Self::above_m`].
    pub land_on: BTreeSet<String>,
    /// Largest time between two samples without a gap \[s\]; the motion in a gap is unknown. The default `None` uses
    /// one and a half of each vehicle's usual interval.
    pub max_gap_s: Option<f64>,
    /// Whether the verdict is undecided if a vehicle is not present over the whole window.
    pub require_presence: bool,
    /// Settings of single vehicles, by name.
    pub vehicles: BTreeMap<String, VehicleSettings>,
    /// Names of the vehicles to judge; `None` for all.
    pub only: Option<BTreeSet<String>>,
    /// Obstacles.
    pub obstacles: Vec<MovingObstacle>,
    /// Yaw setpoints of vehicles by name, for a limit of the yaw rate: times \[s\] in ascending order, and yaw \[deg\].
    pub yaw: BTreeMap<String, Vec<[f64; 2]>>,
    /// Limits on single vehicles. If they are the only limits, separations are not judged.
    pub envelope: Envelope,
    /// Length of the windows over which accelerations are averaged \[s\]: change of velocity over the window, divided
    /// by its length. `None` uses instantaneous accelerations, and does not compare corners of curves with a limit.
    pub accel_window_s: Option<f64>,
}

impl Settings {
    /// Creates settings with the safety distance delta \[m\].
    #[must_use]
    pub fn delta(delta_m: f64) -> Self {
        Self { delta_m: Some(delta_m), ..Self::default() }
    }

    /// Returns the settings whose effect changes with the unit of time. All other settings are lengths, names and
    /// choices: the smallest distance of two straight or polynomial motions does not change if all times are scaled.
    #[must_use]
    pub fn rests_on_seconds(&self) -> Vec<TimedSetting> {
        // Without `..`, a new setting does not compile until it is listed here.
        let Self {
            delta_m: _,
            motion,
            max_accel_m_s2,
            radius_m: _,
            ellipsoid_m: _,
            cylinder: _,
            well_clear,
            from_s,
            until_s,
            above_m: _,
            land_on: _,
            max_gap_s,
            require_presence: _,
            vehicles,
            only: _,
            obstacles,
            // Yaw setpoints count with a limit of the yaw rate only.
            yaw: _,
            envelope,
            accel_window_s,
        } = self;
        let motion = motion.filter(|motion| motion.rests_on_seconds());
        let mut timed: Vec<_> = motion.map(|motion| TimedSetting::of(MOTION, motion.name())).into_iter().collect();
        let mut add = |is_timed: bool, option: Opt| {
            timed.extend(is_timed.then(|| TimedSetting::new(option)));
        };
        add(from_s.is_some(), FROM);
        add(until_s.is_some(), UNTIL);
        // An infinite gap joins all samples, whatever their unit of time.
        add(max_gap_s.is_some_and(f64::is_finite), MAX_GAP);
        add(max_accel_m_s2.is_some(), MAX_ACCEL);
        add(accel_window_s.is_some(), ACCEL_WINDOW);
        add(well_clear.is_some_and(WellClear::rests_on_seconds), WELL_CLEAR);
        for (name, VehicleSettings { radius_m: _, offset_s, max_accel_m_s2 }) in vehicles {
            timed.extend((*offset_s != 0.0).then(|| TimedSetting::of(OFFSET, name)));
            timed.extend(max_accel_m_s2.map(|_| TimedSetting::of(MAX_ACCEL, name)));
        }
        let obstacles = obstacles.iter().filter(|obstacle| obstacle.rests_on_seconds());
        timed.extend(obstacles.map(|obstacle| TimedSetting::of(OBSTACLES, &obstacle.name)));
        let Envelope { limits, fence: _ } = envelope;
        let limits = limits.iter().map(|limit| limit.quantity).filter(|quantity| quantity.rests_on_seconds());
        timed.extend(limits.map(|quantity| TimedSetting::of(LIMIT, quantity.name())));
        timed
    }

    pub(super) fn window(&self) -> Interval {
        Interval { from_s: self.from_s.unwrap_or(f64::NEG_INFINITY), to_s: self.until_s.unwrap_or(f64::INFINITY) }
    }

    /// Returns whether the settings limit separations or distances from obstacles, apart from a recording's own radii.
    pub(super) fn has_separation_limit(&self, has_plan: bool) -> bool {
        let is_given =
            [self.delta_m.is_some(), self.ellipsoid_m.is_some(), self.cylinder.is_some(), self.radius_m.is_some()];
        is_given.contains(&true)
            || !self.obstacles.is_empty()
            || self.vehicles.values().any(|vehicle| vehicle.radius_m.is_some())
            || !self.judges_single_vehicles(has_plan)
    }

    /// Returns whether something else than separations is judged: limits of vehicles, a plan, or well clear.
    pub(super) fn judges_single_vehicles(&self, has_plan: bool) -> bool {
        !self.envelope.is_empty() || has_plan || self.well_clear.is_some()
    }

    pub(super) fn limits(&self) -> Limits {
        let touching = self.ellipsoid_m.map_or(0.0, |_| TOUCHING_ELLIPSOIDS);
        let touching = self.cylinder.map_or(touching, |_| TOUCHING_CYLINDER);
        Limits {
            delta: self.delta_m.unwrap_or(touching),
            by_radii: self.ellipsoid_m.is_none() && self.cylinder.is_none(),
            cylinder: self.cylinder,
            above: self.above_m.map(|above_m| self.ellipsoid_m.map_or(above_m, |axes| above_m / axes.z)),
        }
    }

    /// Checks that every number is in range.
    pub(super) fn check(&self) -> Result<(), RecordedError> {
        const POSITIVE: (f64, &str) = (MIN_LIMIT_M, "a finite number above 0");
        const NOT_NEGATIVE: (f64, &str) = (0.0, "a finite number of at least 0");
        const FINITE: (f64, &str) = (-LARGEST, "a finite number");
        let check_of = |option, name: Option<&str>, value: Option<f64>, (least, range): (f64, &'static str)| match value
        {
            Some(value) if !(least..=LARGEST).contains(&value) => {
                let is_of_range = value.is_finite() && value > 0.0 || value < -LARGEST;
                let range = if is_of_range { "a number of a size between 1e-70 and 1e70" } else { range };
                Err(RecordedError::OutOfRange { option, of: name.map(str::to_owned), range, value })
            }
            _ => Ok(()),
        };
        let check = |option, value, range| check_of(option, None, value, range);
        check(DELTA, self.delta_m, POSITIVE)?;
        check(RADIUS, self.radius_m, NOT_NEGATIVE)?;
        check(MAX_ACCEL, self.max_accel_m_s2, NOT_NEGATIVE)?;
        for axis in self.ellipsoid_m.iter().flatten() {
            check(ELLIPSOID, Some(*axis), POSITIVE)?;
        }
        if let Some(Cylinder { horizontal_m, vertical_m }) = self.cylinder {
            check(CYLINDER, Some(horizontal_m), POSITIVE)?;
            check(CYLINDER, Some(vertical_m), POSITIVE)?;
            let others = [
                (DELTA, self.delta_m.is_some()),
                (ELLIPSOID, self.ellipsoid_m.is_some()),
                (RADIUS, self.radius_m.is_some() || self.vehicles.values().any(|vehicle| vehicle.radius_m.is_some())),
                (OBSTACLES, !self.obstacles.is_empty()),
            ];
            if let Some((other, _)) = others.into_iter().find(|(_, is_given)| *is_given) {
                return Err(RecordedError::CylinderAnd { other });
            }
        }
        if let Some(WellClear { horizontal_m, vertical_m, tau_s }) = self.well_clear {
            check(WELL_CLEAR, Some(horizontal_m), POSITIVE)?;
            check(WELL_CLEAR, Some(vertical_m), POSITIVE)?;
            check(WELL_CLEAR, Some(tau_s), NOT_NEGATIVE)?;
            let motion = self.motion.filter(|motion| matches!(motion, Interpolation::Hold | Interpolation::Bounded));
            if let Some(motion) = motion {
                return Err(RecordedError::WellClearMotion { motion: motion.name() });
            }
            if self.ellipsoid_m.is_some() {
                return Err(RecordedError::WellClearAndEllipsoid);
            }
        }
        check(FROM, self.from_s, FINITE)?;
        check(UNTIL, self.until_s, FINITE)?;
        check(ABOVE, self.above_m, FINITE)?;
        // An infinite gap joins all samples.
        check(MAX_GAP, self.max_gap_s.filter(|gap_s| *gap_s != f64::INFINITY), NOT_NEGATIVE)?;
        let Interval { from_s, to_s } = self.window();
        if from_s > to_s {
            return Err(RecordedError::EmptyWindow { from_s, to_s });
        }
        for (name, vehicle) in &self.vehicles {
            check_of(RADIUS, Some(name), vehicle.radius_m, NOT_NEGATIVE)?;
            check_of(OFFSET, Some(name), Some(vehicle.offset_s), FINITE)?;
            check_of(MAX_ACCEL, Some(name), vehicle.max_accel_m_s2, NOT_NEGATIVE)?;
        }
        for Limit { quantity, allowed } in &self.envelope.limits {
            let is_height = quantity.derivative() == 0 || *quantity == Quantity::NavigationFloor;
            let range = if is_height { FINITE } else { POSITIVE };
            check_of(LIMIT, Some(quantity.name()), Some(*allowed), range)?;
        }
        check(ACCEL_WINDOW, self.accel_window_s, POSITIVE)?;
        let is_limited = self.envelope.limits.iter().any(|limit| limit.quantity == Quantity::Acceleration);
        if self.accel_window_s.is_some() && (!is_limited || self.motion == Some(Interpolation::Bounded)) {
            return Err(RecordedError::NoAccelWindow);
        }
        if let Some(quantity) = self.envelope.limited_motion().filter(|_| self.motion == Some(Interpolation::Hold)) {
            return Err(RecordedError::LimitOfJumps { limit: quantity.name() });
        }
        if self.ellipsoid_m.is_some() && !self.obstacles.is_empty() {
            return Err(RecordedError::ObstaclesAndEllipsoid);
        }
        if let Some(name) = self.land_on.first().filter(|_| self.above_m.is_none()) {
            return Err(RecordedError::NoGround { name: name.clone() });
        }
        let is_known = |name: &&String| self.obstacles.iter().any(|obstacle| obstacle.name == **name);
        if let Some(name) = self.land_on.iter().find(|name| !is_known(name)) {
            let known: Vec<_> = self.obstacles.iter().map(|obstacle| obstacle.name.as_str()).collect();
            return Err(RecordedError::UnknownObstacle { name: name.clone(), known: known.join(", ") });
        }
        let count = |name: &String| self.obstacles.iter().filter(|obstacle| obstacle.name == *name).count();
        if let Some(name) = self.land_on.iter().find(|name| count(name) > 1) {
            return Err(RecordedError::AmbiguousObstacle { name: name.clone(), count: count(name) });
        }
        self.obstacles.iter().try_for_each(|obstacle| Ok(obstacle.check()?))
    }
}

/// Scaled distance at which two equal ellipsoids touch.
pub const TOUCHING_ELLIPSOIDS: f64 = 2.0;

/// Scaled distance at which a vehicle touches the cylinder around another.
pub const TOUCHING_CYLINDER: f64 = 1.0;

/// Limits on distances, in metres, or relative to the half axes of the ellipsoid or to the cylinder.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Limit for any two vehicles.
    pub(super) delta: f64,
    /// Whether the vehicles' radii count.
    pub(super) by_radii: bool,
    /// Cylinder by which distances are scaled.
    pub(super) cylinder: Option<Cylinder>,
    /// Height at or below which vehicles are on the ground.
    pub(super) above: Option<f64>,
}

impl Limits {
    /// Returns the target of the distance of two vehicles.
    pub(super) fn target(&self) -> Target<'static> {
        self.cylinder.map_or(Target::Origin, Target::Cylinder)
    }

    /// Returns a bound on the distance along each axis \[m\] of two vehicles at a distance.
    pub(super) fn reach_m(&self, distance: f64) -> Vector3<f64> {
        match self.cylinder {
            None => Vector3::repeat(distance),
            Some(Cylinder { horizontal_m, vertical_m }) => {
                Vector3::new(horizontal_m, horizontal_m, vertical_m) * (distance * (1.0 + 4.0 * f64::EPSILON))
            }
        }
    }

    /// Returns a bound on the distance \[m\] of the centres of two vehicles at a distance.
    pub(super) fn farthest_m(&self, distance: f64) -> f64 {
        self.cylinder.map_or(distance, |Cylinder { horizontal_m, vertical_m }| {
            horizontal_m.hypot(vertical_m) * distance * (1.0 + 4.0 * f64::EPSILON)
        })
    }

    /// Returns the limit for the centres of two vehicles with these radii.
    pub(super) fn of_vehicles(self, first: f64, second: f64) -> f64 {
        if self.by_radii { self.delta.max(first + second) } else { self.delta }
    }

    /// Returns the limit for the centre of a vehicle with this radius and an obstacle's surface.
    pub(super) fn of_obstacle(self, obstacle: &MovingObstacle, radius: f64) -> f64 {
        obstacle.clearance_m.unwrap_or(if self.by_radii { (0.5 * self.delta).max(radius) } else { 0.5 * self.delta })
    }
}

/// Reason why a recording cannot be judged with the settings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordedError {
    /// A number of the settings is out of range.
    #[error(
        "{option}: must be {range}, got {}{value:?}",
        of.as_ref().map(|name| format!("{name}=")).unwrap_or_default()
    )]
    OutOfRange {
        /// The setting.
        option: Opt,
        /// Name of the vehicle or of the limit, if the setting is given for several.
        of: Option<String>,
        /// Allowed range.
        range: &'static str,
        /// Value.
        value: f64,
    },
    /// The window is empty.
    #[error("the window from {from_s:?} s to {to_s:?} s is empty; its end must not be before its start")]
    EmptyWindow {
        /// Start \[s\].
        from_s: f64,
        /// End \[s\].
        to_s: f64,
    },
    /// Bounded motion without a bound on the acceleration.
    #[error("bounded motion of vehicle {vehicle} needs its largest acceleration")]
    NoBound {
        /// Name of the vehicle.
        vehicle: String,
    },
    /// Neither a safety distance nor a radius is given.
    #[error("vehicle {vehicle} has no limit: neither delta nor its radius is given")]
    NoLimit {
        /// Name of the vehicle.
        vehicle: String,
    },
    /// The settings name a vehicle that the recording does not have.
    #[error("the recording has no vehicle {name}; it has {known}")]
    UnknownVehicle {
        /// Name in the settings.
        name: String,
        /// Names in the recording, shortened.
        known: String,
    },
    /// Vehicles land on an obstacle, but the settings give no height of the ground.
    #[error("{LAND_ON}: the obstacle `{name}` is exempt at or below a height, which is not given")]
    NoGround {
        /// Name of the obstacle.
        name: String,
    },
    /// Vehicles land on an obstacle whose name several obstacles have.
    #[error("{LAND_ON}: {count} obstacles have the name `{name}`")]
    AmbiguousObstacle {
        /// Name of the obstacles.
        name: String,
        /// Number of obstacles with this name.
        count: usize,
    },
    /// Vehicles land on an obstacle that the settings do not have.
    #[error("{LAND_ON}: there is no obstacle `{name}`; the obstacles are {known}")]
    UnknownObstacle {
        /// Name in the settings.
        name: String,
        /// Names of the obstacles; empty without obstacles.
        known: String,
    },
    /// The recording has samples, but the motion is polynomial.
    #[error("vehicle {vehicle} has samples and no curve; choose another motion between samples than polynomial")]
    NotACurve {
        /// Name of the vehicle.
        vehicle: String,
    },
    /// The recording has curves, but another motion is given.
    #[error("vehicle {vehicle} has a curve; a motion between samples cannot be chosen for it")]
    NotSamples {
        /// Name of the vehicle.
        vehicle: String,
    },
    /// A vehicle has no name.
    #[error("vehicle {} (from 1) has no name", vehicle + 1)]
    Unnamed {
        /// Index of the vehicle.
        vehicle: usize,
    },
    /// The time is not later than the previous one.
    #[error("vehicle {vehicle}: the time {time_s:?} s is not later than {previous_s:?} s before it")]
    TimeNotIncreasing {
        /// Name of the vehicle.
        vehicle: String,
        /// Previous time \[s\].
        previous_s: f64,
        /// Time \[s\].
        time_s: f64,
    },
    /// Items are out of order.
    #[error("the item of vehicle {vehicle} at {time_s:?} s comes after one at {previous_s:?} s")]
    OutOfOrder {
        /// Name of the vehicle.
        vehicle: String,
        /// Time of the previous item \[s\].
        previous_s: f64,
        /// Time \[s\].
        time_s: f64,
    },
    /// The times of two vehicles cannot come from one clock.
    #[error("the first samples of vehicles {first} and {second} are {days} days apart; their clocks differ")]
    TwoClocks {
        /// Name of the vehicle with the earliest first sample.
        first: String,
        /// Name of the vehicle with the latest first sample.
        second: String,
        /// Time between both \[days\].
        days: u64,
    },
    /// Invalid sample or curve: a number that is not finite or too large, or a curve without coefficients.
    #[error("vehicle {vehicle} at {time_s:?} s: {what}")]
    Item {
        /// Name of the vehicle.
        vehicle: String,
        /// Time \[s\].
        time_s: f64,
        /// Problem.
        what: String,
    },
    /// A vehicle has a clock offset in a recording with plans: the offset moves positions only.
    #[error("{OFFSET}: the recording has published plans, whose publication has another clock (vehicle {vehicle})")]
    OffsetOfPlans {
        /// Name of the vehicle.
        vehicle: String,
    },
    /// Each of some vehicles is farther from its own plans, at their starts, than another one of these vehicles, or
    /// than a vehicle without plans.
    #[error("the plans of vehicle {vehicle} start nearer to vehicle {other}, and the names could be exchanged")]
    ExchangedFlights {
        /// Name of the vehicle.
        vehicle: String,
        /// Name of the nearer vehicle.
        other: String,
    },
    /// The radius of a vehicle changes.
    #[error("vehicle {vehicle} at {time_s:?} s: the radius changes to {radius_m:?} m")]
    RadiusChanges {
        /// Name of the vehicle.
        vehicle: String,
        /// Time \[s\].
        time_s: f64,
        /// New radius \[m\].
        radius_m: f64,
    },
    /// A speed or an acceleration is limited for vehicles that jump.
    #[error("the limit of {limit} needs continuous motion; with motion hold, vehicles jump from sample to sample")]
    LimitOfJumps {
        /// Name of the limited quantity.
        limit: &'static str,
    },
    /// An averaging window without a limit on the acceleration, or with an assumed bound on it.
    #[error("the window of accelerations has no effect without a limit on the acceleration, or if motion is bounded")]
    NoAccelWindow,
    /// A cylinder is combined with another measure of separations.
    #[error("{CYLINDER}: cannot be combined with {other}; give one of them")]
    CylinderAnd {
        /// The other setting.
        other: Opt,
    },
    /// Well clear of motion without velocities.
    #[error("{WELL_CLEAR}: needs velocities, which motion {motion} does not define")]
    WellClearMotion {
        /// Motion between samples.
        motion: &'static str,
    },
    /// Well clear is combined with an ellipsoid.
    #[error("{WELL_CLEAR}: cannot be combined with an ellipsoid, which scales all lengths")]
    WellClearAndEllipsoid,
    /// Obstacles are combined with an ellipsoid.
    #[error("obstacles cannot be combined with an ellipsoid")]
    ObstaclesAndEllipsoid,
    /// The work was interrupted ([`super::TrackAuditor::with_interruption`]).
    #[error("interrupted")]
    Interrupted,
    /// Invalid obstacle.
    #[error(transparent)]
    Obstacle(#[from] ObstacleError),
}
