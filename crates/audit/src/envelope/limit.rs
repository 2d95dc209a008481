//! Limits on single vehicles, and the findings for each limit.

use nalgebra::Vector3;
use serde::Serialize;

use super::fence::Fence;
use crate::findings::Tally;
use crate::outcome::Status;
use tautline_core::fact::Fact;

/// Excess that counts as rounding, as a fraction of the limit or of 1, whichever is larger.
const ALLOWANCE: f64 = 1e-9;

/// Limited quantity of a vehicle's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Speed \[m/s\].
    Speed,
    /// Horizontal speed, along x and y \[m/s\].
    HorizontalSpeed,
    /// Climb rate along z \[m/s\].
    Climb,
    /// Sink rate along z \[m/s\].
    Descent,
    /// Acceleration \[m/s^2\].
    Acceleration,
    /// Height z, with an upper limit \[m\].
    Height,
    /// Height z, with a lower limit \[m\].
    Floor,
    /// Height z while the vehicle moves horizontally, with a lower limit \[m\].
    NavigationFloor,
    /// Rate of the yaw between setpoints \[deg/s\].
    YawRate,
    /// Clearance margin inside the fence, with a lower limit \[m\].
    Fence,
}

impl Quantity {
    /// Quantities that are limited by a number alone.
    pub const NUMBERS: [Self; 9] = [
        Self::Speed,
        Self::HorizontalSpeed,
        Self::Climb,
        Self::Descent,
        Self::Acceleration,
        Self::Height,
        Self::Floor,
        Self::NavigationFloor,
        Self::YawRate,
    ];

    /// Returns the name on the command line, the key in files, and the unit.
    fn names(self) -> [&'static str; 3] {
        match self {
            Self::Speed => ["speed", "speed_m_s", "m/s"],
            Self::HorizontalSpeed => ["horizontal", "horizontal_speed_m_s", "m/s"],
            Self::Climb => ["climb", "climb_m_s", "m/s"],
            Self::Descent => ["descent", "descent_m_s", "m/s"],
            Self::Acceleration => ["accel", "accel_m_s2", "m/s^2"],
            Self::Height => ["height", "height_m", "m"],
            Self::Floor => ["floor", "floor_m", "m"],
            Self::NavigationFloor => ["navigation-floor", "navigation_floor_m", "m"],
            Self::YawRate => ["yaw-rate", "yaw_rate_deg_s", "deg/s"],
            Self::Fence => ["fence", "fence_margin_m", "m"],
        }
    }

    /// Returns the name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.names()[0]
    }

    /// Returns the key in files, with the unit.
    #[must_use]
    pub fn key(self) -> &'static str {
        self.names()[1]
    }

    /// Returns the unit.
    #[must_use]
    pub fn unit(self) -> &'static str {
        self.names()[2]
    }

    /// Returns whether the quantity depends on heights, and so is unknown in the plane of x and y.
    #[must_use]
    pub fn needs_height(self) -> bool {
        matches!(self, Self::Climb | Self::Descent | Self::Height | Self::Floor | Self::NavigationFloor)
    }

    /// Returns whether the quantity depends on the origin of the positions.
    #[must_use]
    pub fn needs_origin(self) -> bool {
        matches!(self, Self::Height | Self::Floor | Self::NavigationFloor | Self::Fence)
    }

    /// Returns whether another unit of time changes the quantity.
    #[must_use]
    pub fn rests_on_seconds(self) -> bool {
        match self {
            Self::Speed
            | Self::HorizontalSpeed
            | Self::Climb
            | Self::Descent
            | Self::Acceleration
            | Self::YawRate
            // The floor counts while the vehicle moves at a speed.
            | Self::NavigationFloor => true,
            Self::Height | Self::Floor | Self::Fence => false,
        }
    }

    /// Returns whether the quantity must not fall below its limit; the others must not exceed theirs.
    #[must_use]
    pub fn is_least(self) -> bool {
        matches!(self, Self::Floor | Self::NavigationFloor | Self::Fence)
    }

    /// Returns the order of the highest derivative of the position that the quantity is a function of. The yaw is no
    /// function of the position and counts as of order 3.
    pub(crate) fn derivative(self) -> usize {
        match self {
            Self::Height | Self::Floor | Self::Fence => 0,
            Self::Acceleration => 2,
            Self::YawRate => 3,
            _ => 1,
        }
    }

    /// Returns the value for this derivative, negated if it must not fall below its limit. It is convex, and no steeper
    /// than 1.
    pub(super) fn of(self, derivative: Vector3<f64>) -> f64 {
        match self {
            Self::Speed | Self::Acceleration => derivative.norm(),
            Self::HorizontalSpeed => derivative.xy().norm(),
            Self::Climb | Self::Height => derivative.z,
            Self::Descent | Self::Floor => -derivative.z,
            Self::NavigationFloor | Self::YawRate | Self::Fence => f64::NAN,
        }
    }
}

/// Limit of a quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// Limited quantity.
    pub quantity: Quantity,
    /// Largest allowed value, or the least if [`Quantity::is_least`], in the unit of the quantity.
    pub allowed: f64,
}

impl Limit {
    /// Returns the upper bound of the normalized value, with an allowance for rounding.
    pub(super) fn bound(self) -> f64 {
        self.normalized(self.allowed) + self.allowance()
    }

    pub(super) fn allowance(self) -> f64 {
        ALLOWANCE * self.allowed.abs().max(1.0)
    }

    /// Returns the value, negated if the quantity must not fall below its limit.
    pub(super) fn normalized(self, value: f64) -> f64 {
        if self.quantity.is_least() { -value } else { value }
    }
}

/// All limits on single vehicles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Envelope {
    /// Limits by a number alone.
    pub limits: Vec<Limit>,
    /// Fence in which each vehicle must stay.
    pub fence: Option<Fence>,
}

impl Envelope {
    /// Returns whether no limit is given.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.limits.is_empty() && self.fence.is_none()
    }

    /// Returns all limits, that of the fence last.
    pub(super) fn all(&self) -> Vec<Limit> {
        let fence = self.fence.as_ref().map(|fence| Limit { quantity: Quantity::Fence, allowed: fence.margin_m() });
        self.limits.iter().copied().chain(fence).collect()
    }

    /// Returns a limited speed or acceleration of the position, if any; these are undefined for vehicles that jump.
    pub(crate) fn limited_motion(&self) -> Option<Quantity> {
        let mut quantities = self.limits.iter().map(|limit| limit.quantity);
        quantities.find(|quantity| quantity.derivative() > 0 && *quantity != Quantity::YawRate)
    }
}

/// Findings for all limits on single vehicles.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct EnvelopeOutcome {
    /// Findings for each limit, in the given order; that of the fence last.
    pub limits: Vec<LimitOutcome>,
}

/// Findings for one limit.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LimitOutcome {
    /// Limit.
    pub limit: Limit,
    /// Verdict.
    pub status: Status,
    /// Value that came nearest to the limit, or went farthest beyond it; `None` if no value is known.
    pub extreme: Option<Exceedance>,
    /// Times at which a vehicle was beyond the limit, in order of time. A long list is shortened to the worst and the
    /// first of each vehicle.
    pub violations: Vec<Exceedance>,
    /// Undecided times, shortened likewise.
    pub undecided: Vec<Exceedance>,
    /// Number of times at which a vehicle was beyond the limit.
    pub violations_tally: Tally,
    /// Number of undecided times.
    pub undecided_tally: Tally,
    /// Vehicles for which no value is known.
    pub unknown: Vec<usize>,
    /// Assumption about the quantity, in addition to the motion between samples.
    pub assumes: Option<Fact>,
    /// Corners of curves, which are not compared with the limit; `None` without corners.
    pub corners: Option<Corners>,
}

/// Instants at which the velocity of a recorded curve jumps. No vehicle can fly them exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners {
    /// Number of corners of all vehicles.
    pub count: u64,
    /// Corner with the largest velocity jump.
    pub largest: Corner,
}

/// Instant at which a velocity jumps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Corner {
    /// Index of the vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// Time \[s\].
    pub at_s: f64,
    /// Size of the velocity jump \[m/s\].
    pub by_m_s: f64,
}

/// Value of a vehicle over an interval of time, which is that of the surrounding samples or pieces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Exceedance {
    /// Index of the vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// Start \[s\].
    pub from_s: f64,
    /// End \[s\].
    pub to_s: f64,
    /// Lower bound of the worst value in the interval, in the unit of the limit.
    pub lower: f64,
    /// Upper bound of the worst value.
    pub upper: f64,
    /// Time at which the certain value is reached \[s\].
    pub at_s: f64,
}

impl EnvelopeOutcome {
    /// Returns whether some limit is exceeded.
    #[must_use]
    pub fn is_exceeded(&self) -> bool {
        self.limits.iter().any(|limit| limit.status == Status::Violation)
    }

    /// Returns whether everything except the listed undecided times is known for every limit.
    #[must_use]
    pub fn is_else_known(&self) -> bool {
        let is_listed = |limit: &LimitOutcome| {
            let is_whole = !limit.violations_tally.is_shortened() && !limit.undecided_tally.is_shortened();
            is_whole && (limit.status != Status::Undecided || !limit.undecided.is_empty())
        };
        self.limits.iter().all(|limit| limit.unknown.is_empty() && is_listed(limit))
    }

    /// Returns whether every limit is known to be kept, or no limit is given.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.limits.iter().all(|limit| limit.status == Status::Clear)
    }
}
