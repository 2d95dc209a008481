//! Output of the monitor as plain data. Vehicles are indices into [`Monitor::names`](crate::Monitor::names).

use tautline_audit::recorded::PlanConflict;
use tautline_audit::{Status, Violation};
use tautline_core::{coded, impl_coded};

/// Two vehicles, the lower index first.
pub type Pair = [u32; 2];

/// Reason why separation is undecided, or why a sign-off is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// Fewer than two vehicles were heard: their number.
    TooFew(usize),
    /// Expected vehicles were not heard: number heard, number expected.
    Missing([usize; 2]),
    /// Fewer than two vehicles are present, because others signed off: the number of present ones.
    SignedOff(usize),
    /// A vehicle is stale: its age \[s\].
    Stale(u32, f64),
    /// The velocity of a vehicle is not known yet.
    VelocityUnknown(u32),
    /// The error of the positions of a vehicle is not known: no bound is given, and the source reports none.
    ErrorUnknown(u32),
    /// An error of the input less than the largest age ago, or one that lasts for a vehicle.
    Fault(Fault, Option<u32>),
    /// The bounds allow a pair to be closer than delta: the smallest possible separation \[m\].
    Uncertain(Pair, f64),
    /// The plans of two drones are closer than delta, now or later. Times are those of the monitor \[s\].
    PlanConflict(PlanConflict),
    /// A pair is in a measured violation. Only of a sign-off.
    Violation(Pair),
    /// The stamp of a sign-off is older than the newest position of its vehicle: both stamps \[s\].
    Late([f64; 2]),
    /// The vehicle of a sign-off has signed off: stamps of the sign-off and of the newest position \[s\].
    Repeated([f64; 2]),
}

impl_coded! { Reason {
    Self::TooFew(_) => "too-few",
    Self::Missing(_) => "missing",
    Self::SignedOff(_) => "signed-off",
    Self::Stale(..) => "stale",
    Self::VelocityUnknown(_) => "velocity-unknown",
    Self::ErrorUnknown(_) => "error-unknown",
    Self::Fault(..) => "fault",
    Self::Uncertain(..) => "uncertain",
    Self::PlanConflict(_) => "plan-conflict",
    Self::Violation(_) => "violation",
    Self::Late(_) => "late",
    Self::Repeated(_) => "repeated",
} }

impl Reason {
    /// Returns whether the reason is normal before all vehicles are heard.
    #[must_use]
    pub fn is_of_start(&self) -> bool {
        matches!(self, Self::TooFew(_) | Self::Missing(_) | Self::VelocityUnknown(_) | Self::ErrorUnknown(_))
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
    Undecided(Reason),
    /// A pair is closer than delta: the pair, and its distance \[m\].
    Violation(Pair, f64),
}

impl State {
    /// Returns the status of the separation.
    #[must_use]
    pub fn status(self) -> Status {
        match self {
            Self::Clear => Status::Clear,
            Self::Undecided(_) => Status::Undecided,
            Self::Violation(..) => Status::Violation,
        }
    }

    /// Returns the pair in violation.
    pub(crate) fn violated(self) -> Option<Pair> {
        if let Self::Violation(pair, _) = self { Some(pair) } else { None }
    }
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

coded! {
    /// Error of the input.
    Fault {
        /// A message cannot be read, for the reason in a [`MessageError`].
        Garbage = "garbage",
        /// A number of a message is not finite or beyond the largest that is read.
        OutOfRange = "out-of-range",
        /// A message of a vehicle beyond the largest number of vehicles.
        TooManyVehicles = "too-many-vehicles",
        /// The clock of a source stepped, or its stamps run faster than they arrive.
        ClockStep = "clock-step",
        /// A vehicle has two positions at one time.
        Conflict = "conflict",
        /// A vehicle moved farther than its bounds allow.
        OutOfBounds = "out-of-bounds",
        /// The velocities that a vehicle sends contradict its positions.
        VelocityDisagrees = "velocity-disagrees",
        /// The bound on the error of positions is smaller than the accuracy that the source reports.
        Inaccurate = "inaccurate",
        /// The messages of a vehicle are those of two vehicles with one name.
        TwoStreams = "two-streams",
        /// Messages came faster than they were read, and some were dropped.
        Dropped = "dropped",
        /// A vehicle sent too many messages between two messages of another one. The past of this pair is not judged.
        NotJudged = "not-judged",
        /// The sign-off of a vehicle was refused or ignored, for a [`Reason`].
        SignOff = "sign-off-refused",
        /// A vehicle sent a pose after its sign-off, so its separation since the sign-off is undecided.
        Returned = "pose-after-sign-off",
        /// An ignored message that is older than the newest one of its vehicle.
        Reordered = "reordered",
        /// An ignored message that is a repetition.
        Duplicate = "duplicate",
    }
}

impl Fault {
    /// Returns whether the state is not CLEAR for the largest age after this fault.
    #[must_use]
    pub fn gives_doubt(self) -> bool {
        !matches!(self, Self::SignOff | Self::Reordered | Self::Duplicate)
    }
}

/// Message that cannot be read.
#[derive(Clone, Debug, PartialEq)]
pub struct MessageError {
    /// Place of the message, such as `line 7` or its topic.
    pub place: String,
    /// Reason.
    pub problem: Problem,
}

/// Reason why a message cannot be read. Strings are parts of the message, or words of its decoder or sender.
#[derive(Clone, Debug, PartialEq)]
pub enum Problem {
    /// The line is longer than the largest number of bytes that is read.
    TooLong,
    /// The line is not a pose: words of the parser, and the line.
    NotPose(String, String),
    /// Some axes of the velocity are missing.
    VelocityIncomplete,
    /// The name of the vehicle is empty.
    NoName,
    /// A sign-off has a position.
    SignOffWithPosition,
    /// The event is unknown.
    UnknownEvent(String),
    /// The vehicle of a sign-off was not heard: its name.
    NotHeard(String),
    /// The bytes, the place on the Earth or the text cannot be decoded: words of the decoder.
    NotDecoded(String),
    /// The server reports an error.
    ServerError(String),
    /// The message has no stamp.
    NoStamp,
    /// The position is on the Earth, and no origin is given.
    NoOrigin,
    /// Transforms have several frames, and none is given.
    NoFrame,
    /// The position is in another frame than those before: both frames.
    OtherFrame([String; 2]),
    /// The vehicle has another topic: its name and this topic.
    OtherTopic([String; 2]),
    /// More topics than are read.
    TooManyTopics,
    /// The datagram ends within a frame of `MAVLink`.
    CutFrame,
    /// A frame of `MAVLink` 2 has unknown incompatible flags.
    UnknownFlags(u8),
    /// A frame of `MAVLink` does not begin with this byte.
    NoFrameStart(u8),
    /// The checksum of a message of a system is wrong: ids of both.
    WrongChecksum([u32; 2]),
    /// The message is not one of a topic.
    NotOfTopic,
    /// The message has no position that is read: its topic.
    NoPosition(String),
    /// The message has no subscription.
    NoSubscription,
    /// The plan of a planner cannot be used: the reason.
    WrongPlan(String),
    /// The plan of a planner starts more than a minute from its arrival: start after the arrival \[s\], and the clock.
    OtherPlanClock(f64, PlanClock),
}

/// Clock by which the starts of plans are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanClock {
    /// Common clock of the positions.
    Positions,
    /// Clock of this machine.
    Machine,
}

impl_coded! { Problem {
    Self::TooLong => "too-long",
    Self::NotPose(..) => "not-pose",
    Self::VelocityIncomplete => "velocity-incomplete",
    Self::NoName => "no-name",
    Self::SignOffWithPosition => "sign-off-with-position",
    Self::UnknownEvent(_) => "unknown-event",
    Self::NotHeard(_) => "not-heard",
    Self::NotDecoded(_) => "not-decoded",
    Self::ServerError(_) => "server-error",
    Self::NoStamp => "no-stamp",
    Self::NoOrigin => "no-origin",
    Self::NoFrame => "no-frame",
    Self::OtherFrame(_) => "other-frame",
    Self::OtherTopic(_) => "other-topic",
    Self::TooManyTopics => "too-many-topics",
    Self::CutFrame => "cut-frame",
    Self::UnknownFlags(_) => "unknown-flags",
    Self::NoFrameStart(_) => "no-frame-start",
    Self::WrongChecksum(_) => "wrong-checksum",
    Self::NotOfTopic => "not-of-topic",
    Self::NoPosition(_) => "no-position",
    Self::NoSubscription => "no-subscription",
    Self::WrongPlan(_) => "wrong-plan",
    Self::OtherPlanClock(..) => "other-plan-clock",
} }

/// Loss of a source.
#[derive(Clone, Debug, PartialEq)]
pub enum Loss {
    /// The connection failed: words of the system.
    Failed(String),
    /// The server is silent.
    Silent,
    /// The server closed the connection.
    Closed,
}

impl_coded! { Loss {
    Self::Failed(_) => "failed",
    Self::Silent => "silent",
    Self::Closed => "closed",
} }

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
    Began(Violation<Pair>),
    /// A measured violation ended.
    Ended(Violation<Pair>),
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
    /// A plan of a planner is closer to another one than delta. Times are those of the monitor.
    PlanConflict {
        /// The two plans, and the time of the conflict.
        conflict: PlanConflict,
        /// Time from the arrival of the later plan to the start of the conflict \[s\].
        left_s: f64,
        /// Time of the arrival \[s\].
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
        /// Reason of the last refused sign-off, with [`Fault::SignOff`].
        refusal: Option<Reason>,
        /// Time \[s\].
        at_s: f64,
    },
}
