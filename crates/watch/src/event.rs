//! Output of the monitor as plain data. Vehicles are indices into [`Monitor::names`](crate::Monitor::names).

/// Two vehicles, the lower index first.
pub type Pair = [u32; 2];

/// Reason why separation is not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// Fewer than two vehicles were heard: their number.
    TooFew(usize),
    /// Expected vehicles were not heard: number heard, number expected.
    Missing([usize; 2]),
    /// An expected vehicle was not heard: its index into [`Expected::Names`](crate::Expected::Names).
    MissingName(usize),
    /// Fewer than two vehicles are present, because others signed off: the number of present ones.
    SignedOff(usize),
    /// A vehicle is stale: its age \[s\].
    Stale(u32, f64),
    /// The velocity of a vehicle is not known yet.
    SpeedUnknown(u32),
    /// The error of the positions of a vehicle is not known: no bound is given, and the source reports none.
    ErrorUnknown(u32),
    /// The messages of a vehicle are those of two vehicles with one name.
    TwoStreams(u32),
    /// The clock of a vehicle stepped, and no message has arrived since.
    ClockStepped(u32),
    /// A vehicle sent two positions with one stamp.
    Conflict(u32),
    /// An error event less than the largest age ago.
    Doubt(Fault),
    /// The bounds allow a pair to be closer than delta: the smallest possible separation \[m\].
    Uncertain(Pair, f64),
}

impl Reason {
    /// Returns whether the reason is normal before all vehicles are heard.
    #[must_use]
    pub fn is_of_start(&self) -> bool {
        matches!(
            self,
            Self::TooFew(_) | Self::Missing(_) | Self::MissingName(_) | Self::SpeedUnknown(_) | Self::ErrorUnknown(_)
        )
    }

    /// Returns whether the reason is normal after all vehicles but one have signed off. It is normal only in the last
    /// interval of a watch, without another state or a return of a vehicle up to the end.
    #[must_use]
    pub fn is_of_end(&self) -> bool {
        matches!(self, Self::SignedOff(_))
    }
}

/// State of a watch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum State {
    /// Every pair of the heard vehicles keeps delta at the present, by the bounds.
    Clear,
    /// Neither CLEAR nor VIOLATION is established.
    NotKnown(Reason),
    /// A pair is closer than delta: the pair, and its distance \[m\].
    Violation(Pair, f64),
}

/// Separation of the closest pair at the present.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// The pair.
    pub pair: Pair,
    /// Separation by constant velocity since the stamps \[m\].
    pub nominal_m: f64,
    /// Smallest separation that the bounds allow \[m\].
    pub least_m: f64,
}

/// Time of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairTime {
    /// The pair.
    pub pair: Pair,
    /// Time of the monitor \[s\].
    pub at_s: f64,
}

/// Judgement of the present.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assessment {
    /// Time of the judgement \[s\].
    pub now_s: f64,
    /// State.
    pub state: State,
    /// Number of vehicles that were ever heard.
    pub heard: usize,
    /// Number of vehicles that signed off and were not heard since. The state holds for the other ones.
    pub signed_off: usize,
    /// Closest pair of vehicles that are not stale.
    pub closest: Option<Separation>,
    /// Time until which every pair keeps delta, with the pair that limits it; only in the state CLEAR.
    pub clear_until: Option<PairTime>,
    /// Whether `clear_until` is the end of the examined time.
    pub is_clear_to_horizon: bool,
    /// First violation by constant velocity.
    pub nominal_violation: Option<PairTime>,
    /// Last moment to brake of the pair with the earliest one.
    pub last_brake: Option<PairTime>,
    /// Vehicle with the largest deviation from the plan \[m\].
    pub deviation: Option<(u32, f64)>,
}

/// Error of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// A message cannot be read.
    Garbage,
    /// A number of a message is not finite or beyond the largest that is read.
    OutOfRange,
    /// A message of a vehicle beyond the largest number of vehicles.
    TooManyVehicles,
    /// The clock of a source stepped, or its stamps run faster than they arrive.
    ClockStep,
    /// A vehicle has two positions at one time.
    Conflict,
    /// A vehicle moved farther than its bounds allow.
    OutOfBounds,
    /// The velocities that a vehicle sends contradict its positions.
    VelocityDisagrees,
    /// The bound on the error of positions is smaller than the accuracy that the source reports.
    Inaccurate,
    /// The messages of a vehicle are those of two vehicles with one name.
    TwoStreams,
    /// Messages came faster than they were read, and some were dropped.
    Dropped,
    /// A vehicle sent too many messages between two messages of another one. The past of this pair is not judged.
    NotJudged,
    /// The sign-off of a vehicle was refused or ignored, for the cause in a [`Refusal`].
    SignOff,
    /// A vehicle sent a pose after its sign-off, so its separation since the sign-off is not known.
    Returned,
    /// An ignored message that is older than the newest one of its vehicle.
    Reordered,
    /// An ignored message that is a repetition.
    Duplicate,
}

impl Fault {
    /// All faults.
    pub const ALL: [Self; 15] = [
        Self::Garbage,
        Self::OutOfRange,
        Self::TooManyVehicles,
        Self::ClockStep,
        Self::Conflict,
        Self::OutOfBounds,
        Self::VelocityDisagrees,
        Self::Inaccurate,
        Self::TwoStreams,
        Self::Dropped,
        Self::NotJudged,
        Self::SignOff,
        Self::Returned,
        Self::Reordered,
        Self::Duplicate,
    ];

    /// Returns the name in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Garbage => "garbage",
            Self::OutOfRange => "out-of-range",
            Self::TooManyVehicles => "too-many-vehicles",
            Self::ClockStep => "clock-step",
            Self::Conflict => "conflict",
            Self::OutOfBounds => "out-of-bounds",
            Self::VelocityDisagrees => "velocity-disagrees",
            Self::Inaccurate => "inaccurate",
            Self::TwoStreams => "two-streams",
            Self::Dropped => "dropped",
            Self::NotJudged => "not-judged",
            Self::SignOff => "sign-off-refused",
            Self::Returned => "pose-after-sign-off",
            Self::Reordered => "reordered",
            Self::Duplicate => "duplicate",
        }
    }

    /// Returns whether the state is not CLEAR for the largest age after this fault.
    #[must_use]
    pub fn gives_doubt(self) -> bool {
        !matches!(self, Self::SignOff | Self::Reordered | Self::Duplicate)
    }
}

/// Cause for which a sign-off was refused or ignored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// Its stamp \[s\] is older than the newest one of the vehicle \[s\].
    Late {
        /// Stamp of the sign-off \[s\].
        t_s: f64,
        /// Stamp of the newest position \[s\].
        newest_s: f64,
    },
    /// The vehicle has signed off, and its newest position has this stamp \[s\].
    Repeated {
        /// Stamp of the sign-off \[s\].
        t_s: f64,
        /// Stamp of the newest position \[s\].
        newest_s: f64,
    },
    /// An error of the input gives doubt.
    Doubt(Fault),
    /// The vehicle is in a measured violation with another one.
    Violation(Pair),
    /// A vehicle is stale, or was not heard since the step of its clock.
    Stale(u32),
    /// The messages of a vehicle are those of two vehicles with one name.
    TwoStreams(u32),
    /// The velocity of a vehicle is not known, or it has two positions at one time.
    NoPrediction(u32),
    /// The bounds allow a pair to be closer than delta: the smallest possible separation \[m\].
    Uncertain(Pair, f64),
}

/// Violation by measured positions, with straight motion between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Violation {
    /// The pair.
    pub pair: Pair,
    /// Start \[s\].
    pub from_s: f64,
    /// End, or the time up to which it was judged \[s\].
    pub to_s: f64,
    /// Smallest distance \[m\].
    pub min_m: f64,
    /// Time of the smallest distance \[s\].
    pub min_at_s: f64,
}

/// Event of the monitor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A vehicle was heard for the first time.
    Heard {
        /// The vehicle.
        vehicle: u32,
        /// Time \[s\].
        at_s: f64,
    },
    /// A vehicle became stale.
    Stale {
        /// The vehicle.
        vehicle: u32,
        /// Its age \[s\].
        age_s: f64,
        /// Time \[s\].
        at_s: f64,
    },
    /// A vehicle signed off.
    SignedOff {
        /// The vehicle.
        vehicle: u32,
        /// Time \[s\].
        at_s: f64,
    },
    /// A vehicle that was stale or had signed off was heard again.
    Back {
        /// The vehicle.
        vehicle: u32,
        /// Time of its sign-off \[s\]; `None` if it was stale.
        signed_off_s: Option<f64>,
        /// Time \[s\].
        at_s: f64,
    },
    /// A measured violation began.
    Began(Violation),
    /// A measured violation ended.
    Ended(Violation),
    /// A vehicle left the tube around its plan, or returned.
    Plan {
        /// The vehicle.
        vehicle: u32,
        /// Its deviation \[m\].
        deviation_m: f64,
        /// Whether the deviation is above the limit.
        is_outside: bool,
        /// Time \[s\].
        at_s: f64,
    },
    /// Errors of the input since the last event of this kind.
    Fault {
        /// Kind.
        fault: Fault,
        /// Number of errors.
        count: u64,
        /// Vehicle of the last error.
        vehicle: Option<u32>,
        /// Cause of the last refused sign-off, with [`Fault::SignOff`].
        refusal: Option<Refusal>,
        /// Time \[s\].
        at_s: f64,
    },
}
