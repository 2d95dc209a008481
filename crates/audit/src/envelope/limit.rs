//! Limits on single vehicles, and what was found of each limit.

use nalgebra::Vector3;
use serde::Serialize;

use super::fence::Fence;
use crate::findings::Tally;
use crate::outcome::Status;

/// Part of a limit, or of 1 where it is less, by which it counts as exceeded.
const ALLOWANCE: f64 = 1e-9;

/// What of a vehicle's motion is limited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Its speed \[m/s\].
    Speed,
    /// Its speed over ground, along x and y \[m/s\].
    HorizontalSpeed,
    /// How fast it rises along z \[m/s\].
    Climb,
    /// How fast it sinks along z \[m/s\].
    Descent,
    /// Its acceleration \[m/s^2\].
    Acceleration,
    /// Its height z, from above \[m\].
    Height,
    /// Its height z, from below \[m\].
    Floor,
    /// Its room to the fence, from below \[m\].
    Fence,
}

impl Quantity {
    /// Those that are limited by a number alone.
    pub const NUMBERS: [Self; 7] =
        [Self::Speed, Self::HorizontalSpeed, Self::Climb, Self::Descent, Self::Acceleration, Self::Height, Self::Floor];

    /// Name on the command line, key in files, and unit.
    fn names(self) -> [&'static str; 3] {
        match self {
            Self::Speed => ["speed", "speed_m_s", "m/s"],
            Self::HorizontalSpeed => ["horizontal", "horizontal_speed_m_s", "m/s"],
            Self::Climb => ["climb", "climb_m_s", "m/s"],
            Self::Descent => ["descent", "descent_m_s", "m/s"],
            Self::Acceleration => ["accel", "accel_m_s2", "m/s^2"],
            Self::Height => ["height", "height_m", "m"],
            Self::Floor => ["floor", "floor_m", "m"],
            Self::Fence => ["fence", "fence_room_m", "m"],
        }
    }

    /// Name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.names()[0]
    }

    /// Key in files, with the unit.
    #[must_use]
    pub fn key(self) -> &'static str {
        self.names()[1]
    }

    /// Unit.
    #[must_use]
    pub fn unit(self) -> &'static str {
        self.names()[2]
    }

    /// Whether it depends on heights, and has no value in the plane of x and y.
    #[must_use]
    pub fn needs_height(self) -> bool {
        matches!(self, Self::Climb | Self::Descent | Self::Height | Self::Floor)
    }

    /// Whether it depends on what positions are measured from.
    #[must_use]
    pub fn needs_origin(self) -> bool {
        matches!(self, Self::Height | Self::Floor | Self::Fence)
    }

    /// Whether it must not fall below its limit, where the others must not exceed theirs.
    #[must_use]
    pub fn is_least(self) -> bool {
        matches!(self, Self::Floor | Self::Fence)
    }

    /// Which derivative of the position it is a function of.
    pub(crate) fn derivative(self) -> usize {
        match self {
            Self::Height | Self::Floor | Self::Fence => 0,
            Self::Acceleration => 2,
            _ => 1,
        }
    }

    /// What must not exceed its bound, of that derivative: convex, and no steeper than 1.
    pub(super) fn of(self, derivative: Vector3<f64>) -> f64 {
        match self {
            Self::Speed | Self::Acceleration => derivative.norm(),
            Self::HorizontalSpeed => derivative.xy().norm(),
            Self::Climb | Self::Height => derivative.z,
            Self::Descent | Self::Floor => -derivative.z,
            Self::Fence => f64::NAN,
        }
    }
}

/// A quantity and what it may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// What is limited.
    pub quantity: Quantity,
    /// What it must not exceed, or fall below ([`Quantity::is_least`]), in its unit.
    pub allowed: f64,
}

impl Limit {
    /// What must not be exceeded, with what rounding may cost: least quantities are turned around.
    pub(super) fn bound(self) -> f64 {
        self.turned(self.allowed) + self.allowance()
    }

    pub(super) fn allowance(self) -> f64 {
        ALLOWANCE * self.allowed.abs().max(1.0)
    }

    /// Between what must not be exceeded and what is said of it.
    pub(super) fn turned(self, value: f64) -> f64 {
        if self.quantity.is_least() { -value } else { value }
    }
}

/// Everything that is asked of each vehicle by itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Envelope {
    /// Limits by a number alone.
    pub limits: Vec<Limit>,
    /// Where each must stay.
    pub fence: Option<Fence>,
}

impl Envelope {
    /// Whether nothing is asked.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.limits.is_empty() && self.fence.is_none()
    }

    /// All limits, that of the fence last.
    pub(super) fn all(&self) -> Vec<Limit> {
        let fence = self.fence.as_ref().map(|fence| Limit { quantity: Quantity::Fence, allowed: fence.margin_m() });
        self.limits.iter().copied().chain(fence).collect()
    }

    /// Some quantity of a derivative of the position, which vehicles that jump do not have.
    pub(crate) fn of_motion(&self) -> Option<Quantity> {
        self.limits.iter().map(|limit| limit.quantity).find(|quantity| quantity.derivative() > 0)
    }
}

/// What was found of all that is asked of each vehicle by itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EnvelopeOutcome {
    /// Limit by limit, in the order in which they were given; that of the fence last.
    pub limits: Vec<LimitOutcome>,
}

/// What was found of one limit.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitOutcome {
    /// What was asked.
    pub limit: Limit,
    /// The verdict.
    pub status: Status,
    /// The value that came nearest to the limit, or went farthest beyond it; none where nothing tells any.
    pub extreme: Option<Exceeding>,
    /// Times that a vehicle was beyond it, in order of time; of many the worst, and the first of each vehicle.
    pub violations: Vec<Exceeding>,
    /// Times of which it cannot be told, likewise.
    pub undecided: Vec<Exceeding>,
    /// How many times a vehicle was beyond it.
    pub violations_tally: Tally,
    /// How many times it cannot be told.
    pub undecided_tally: Tally,
    /// Vehicles of which nothing tells it at all.
    pub unknown: Vec<usize>,
    /// What was taken for granted to tell it, beyond what happens between samples.
    pub assumes: Option<String>,
    /// Corners of curves, which are not held against it; none where there are none.
    pub corners: Option<Corners>,
}

/// Instants at which the velocity of a recorded curve jumps: no vehicle flies them as they are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners {
    /// How many there are, of all vehicles.
    pub count: u64,
    /// The one at which the velocity jumps most.
    pub largest: Corner,
}

/// An instant at which a velocity jumps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Corner {
    /// The vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// When \[s\].
    pub at_s: f64,
    /// By how much \[m/s\].
    pub by_m_s: f64,
}

/// A vehicle over a time. The time is that of the samples or pieces around.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Exceeding {
    /// The vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// From \[s\].
    pub from_s: f64,
    /// To \[s\].
    pub to_s: f64,
    /// The worst value within is at least this, in the unit of its limit.
    pub lower: f64,
    /// And at most this.
    pub upper: f64,
    /// When the worst that is certain is reached \[s\].
    pub at_s: f64,
}

impl EnvelopeOutcome {
    /// Whether some limit is exceeded.
    #[must_use]
    pub fn is_exceeded(&self) -> bool {
        self.limits.iter().any(|limit| limit.status == Status::Violation)
    }

    /// Whether everything is known of every limit but for what it lists as undecided.
    #[must_use]
    pub fn is_else_known(&self) -> bool {
        let is_listed = |limit: &LimitOutcome| {
            let is_whole = !limit.violations_tally.is_shortened() && !limit.undecided_tally.is_shortened();
            is_whole && (limit.status != Status::Undecided || !limit.undecided.is_empty())
        };
        self.limits.iter().all(|limit| limit.unknown.is_empty() && is_listed(limit))
    }

    /// Whether every limit is known to be kept, or nothing is asked.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.limits.iter().all(|limit| limit.status == Status::Clear)
    }
}
