//! What is asked of a recording.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use serde::Deserialize;

use super::error::RecordedError;
use crate::envelope::{Envelope, Limit, Quantity};
use crate::limits::{Limits, TOUCHING_ELLIPSOIDS};
use crate::obstacle::Obstacle;
use crate::sweep::{Interval, MAX_LENGTH_M, MIN_LIMIT_M};

/// Largest number that is accepted, be it a length \[m\], a time \[s\] or an acceleration \[m/s^2\].
pub(super) const LARGEST: f64 = MAX_LENGTH_M;

/// How vehicles are taken to move between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Motion {
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

impl Motion {
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
    pub motion: Option<Motion>,
    /// Largest acceleration \[m/s^2\] of every vehicle, for [`Motion::Bounded`].
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
        if self.accel_window_s.is_some() && (!is_limited || self.motion == Some(Motion::Bounded)) {
            return Err(RecordedError::NoAccelWindow);
        }
        if let Some(quantity) = self.envelope.of_motion().filter(|_| self.motion == Some(Motion::Hold)) {
            return Err(RecordedError::LimitOfJumps { limit: quantity.name() });
        }
        if self.ellipsoid_m.is_some() && !self.obstacles.is_empty() {
            return Err(RecordedError::ObstaclesAndEllipsoid);
        }
        self.obstacles.iter().try_for_each(|obstacle| Ok(obstacle.check()?))
    }
}
