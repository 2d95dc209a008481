//! What the judge says of a recording.

use super::obstacle::ObstacleError;
use crate::audit::Status;
use crate::swarm::Pair;

/// Who came close to whom. Indices count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Who {
    /// Two vehicles.
    Pair(Pair),
    /// A vehicle and an obstacle.
    Obstacle {
        /// The vehicle.
        vehicle: usize,
        /// The obstacle, an index into [`super::Question::obstacles`].
        obstacle: usize,
    },
}

impl Who {
    /// The two vehicles, if it is two.
    #[must_use]
    pub fn pair(self) -> Option<Pair> {
        match self {
            Self::Pair(pair) => Some(pair),
            Self::Obstacle { .. } => None,
        }
    }
}

impl Approach {
    /// One number for the smallest distance \[m\]: what is reached where the motion is known, and what it is at least where
    /// it is not.
    #[must_use]
    pub fn certain_m(&self) -> f64 {
        if self.upper_m - self.lower_m <= 2.0 * super::WIDTH_M { self.upper_m } else { self.lower_m }
    }
}

/// The closest that two came.
///
/// Lengths are distances of two centres, or of a centre from an obstacle's surface, in metres; with an ellipsoid they are
/// scaled distances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Who.
    pub who: Who,
    /// It is at least this \[m\].
    pub lower_m: f64,
    /// It is at most this \[m\]; the same as `lower_m` where the motion is exact, and within [`super::WIDTH_M`] of it on
    /// curves.
    pub upper_m: f64,
    /// When the motion as drawn is closest \[s\].
    pub time_s: f64,
    /// What it must not fall below \[m\].
    pub limit_m: f64,
}

/// A time during which two were closer than they may be, without a break.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Violation {
    /// Who.
    pub who: Who,
    /// When the distance fell below the limit \[s\].
    pub from_s: f64,
    /// When it was back, or the end of what was judged \[s\].
    pub to_s: f64,
    /// Smallest distance within \[m\]; under bounded acceleration an upper bound of it.
    pub min_m: f64,
    /// When that was \[s\].
    pub min_at_s: f64,
    /// What the distance must not fall below \[m\].
    pub limit_m: f64,
}

/// A time over which it cannot be told whether two came too close.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Undecided {
    /// Who.
    pub who: Who,
    /// From \[s\].
    pub from_s: f64,
    /// To \[s\].
    pub to_s: f64,
    /// Their distance is at least this \[m\].
    pub lower_m: f64,
    /// Its smallest value is at most this \[m\].
    pub upper_m: f64,
    /// What it must not fall below \[m\].
    pub limit_m: f64,
    /// The sampling rate that decides where the vehicles fly as drawn between samples \[Hz\]; `None` where the drawn motion
    /// meets the limit to the last digit, or the limit lies within the width or rounding of an exact motion.
    pub rate_hz: Option<f64>,
}

/// A time during which a vehicle was not seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// The vehicle.
    pub vehicle: usize,
    /// When it was last seen before \[s\].
    pub from_s: f64,
    /// When it was seen again \[s\].
    pub to_s: f64,
}

/// When a vehicle is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Presence {
    /// First seen \[s\].
    pub from_s: f64,
    /// Last seen \[s\].
    pub to_s: f64,
}

/// Where a recording contradicts the bound on acceleration that it is judged by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contradiction {
    /// The vehicle.
    pub vehicle: usize,
    /// When \[s\].
    pub time_s: f64,
    /// The samples there need at least this \[m/s^2\].
    pub needs_m_s2: f64,
    /// What was assumed \[m/s^2\].
    pub assumed_m_s2: f64,
}

/// Two detectors, two answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disagreement {
    /// Who.
    pub who: Who,
    /// Start of the stretch \[s\].
    pub from_s: f64,
    /// End of the stretch \[s\].
    pub to_s: f64,
    /// Smallest distance by the closed form \[m\].
    pub min_m: f64,
    /// First contact by the second detector \[s\]; `None` where it sees none, NaN where it cannot tell.
    pub second_s: Option<f64>,
}

/// The verdict and what it rests on.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Clear where everything asked for was judged and nothing came too close; undecided where something could not be
    /// told; a violation, whatever else there was, where two came too close.
    pub status: Status,
    /// Names of the vehicles, as the recording has them; those that were not asked for are among them.
    pub vehicles: Vec<String>,
    /// When each vehicle is there within what was asked; `None` where it is not, or was not asked for.
    pub presence: Vec<Option<Presence>>,
    /// Longest interval between two samples of each vehicle that was no gap \[s\]: as asked, or one and a half of the
    /// usual one.
    pub max_gaps_s: Vec<f64>,
    /// First and last instant judged \[s\]; `None` where there was nothing to judge.
    pub span_s: Option<(f64, f64)>,
    /// The ten pairs that came closest, the closest first, each at its closest.
    pub closest: Vec<Approach>,
    /// The ten closest approaches to obstacles, likewise.
    pub obstacles: Vec<Approach>,
    /// Every violation, in order of time.
    pub violations: Vec<Violation>,
    /// Every time that could not be decided, in order of time.
    pub undecided: Vec<Undecided>,
    /// Every gap, in order of time. A gap that somebody could have used is undecided.
    pub gaps: Vec<Gap>,
    /// The largest contradiction to the assumed bound on acceleration, if there is one: then nothing is proved clear.
    pub contradiction: Option<Contradiction>,
    /// Stretches of motion that were judged, over all vehicles.
    pub stretches: u64,
    /// Stretches of pairs (and of vehicles and obstacles) that were swept; all others were proved, by bounds on where
    /// vehicles were, to be neither too close nor among the closest.
    pub swept: u64,
    /// Earliest contact by the second detector \[s\].
    pub min_toi_s: Option<f64>,
    /// Stretches on which the two detectors contradict each other by more than rounding explains: each is an error.
    pub disagreements: u64,
    /// The first of them.
    pub first_disagreement: Option<Disagreement>,
}

/// Why a recording cannot be judged as asked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordedError {
    /// A number of the question is out of range.
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
    /// A number that is not finite, or too large to judge.
    #[error("vehicle {vehicle} at {time_s:?} s: {what} is not a finite number below 1e70")]
    NotFinite {
        /// The vehicle.
        vehicle: String,
        /// When \[s\].
        time_s: f64,
        /// Which number.
        what: &'static str,
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
    /// A curve that is none.
    #[error("vehicle {vehicle} at {time_s:?} s: {what}")]
    Piece {
        /// The vehicle.
        vehicle: String,
        /// Where the piece begins \[s\].
        time_s: f64,
        /// What is wrong with it.
        what: &'static str,
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
    /// Obstacles and an ellipsoid.
    #[error("obstacles cannot be judged by an ellipsoid")]
    ObstaclesAndEllipsoid,
    /// An obstacle that is none.
    #[error(transparent)]
    Obstacle(#[from] ObstacleError),
}
