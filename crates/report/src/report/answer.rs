//! Answers to the parts of a question, the same for a flight and for a recording.

use std::collections::BTreeMap;

use serde::{Serialize, Serializer};

use tautline_audit::{LISTED, Status, Tally};
use tautline_core::fact::Fact;

/// Statement on a flight or on a recording: the first keys of both reports.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Judgement {
    /// Version of the keys, [`SCHEMA_VERSION`](super::SCHEMA_VERSION).
    pub schema_version: u32,
    /// The worst status of all answers.
    pub status: Status,
    /// Whether the exit code is 0 by default. A recording passes if it is clear. A flight passes if there is also no
    /// reason against it.
    pub pass: bool,
    /// Whether the status is clear, and no fact that it rests on is an assumption.
    pub proved: bool,
    /// The question, with all limits.
    pub question: Question,
    /// Answers to all asked parts.
    pub answers: Vec<Answer>,
    /// Facts that the answers rest on, each with its source.
    pub facts: Vec<Fact>,
    /// Judged time \[s\]; null if nothing was judged.
    pub window_s: Option<(f64, f64)>,
    /// Names of the vehicles.
    pub vehicles: Vec<String>,
}

/// Question to a flight or to a recording. Lengths are in metres. A key is null if the question does not have it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Question {
    /// Safety distance delta \[m\], or as a scaled length with an ellipsoid or a cylinder.
    pub delta: Option<f64>,
    /// Unit of separations: `m`; `ellipsoids` or `cylinders` if they are scaled by half axes or by a cylinder; `m,
    /// scaled` if only heights are scaled.
    pub unit: &'static str,
    /// Radius of every vehicle without one of its own \[m\].
    pub radius_m: Option<f64>,
    /// Half axes of the ellipsoid around each vehicle \[m\].
    pub ellipsoid_m: Option<[f64; 3]>,
    /// Horizontal and vertical distance of the cylinder around each vehicle \[m\].
    pub cylinder_m: Option<[f64; 2]>,
    /// Names of the obstacles.
    pub obstacles: Vec<String>,
    /// Limits of single vehicles, such as `speed_m_s`, with their values.
    pub limits: BTreeMap<&'static str, f64>,
    /// Thresholds of well clear: horizontal distance \[m\], vertical distance \[m\], modified tau \[s\].
    pub well_clear: Option<[f64; 3]>,
    /// Whether each vehicle must be present over the whole window.
    pub require_presence: bool,
    /// File of the plan.
    pub plan: Option<String>,
    /// Height at or below which vehicles are not judged among each other \[m\].
    pub above_m: Option<f64>,
    /// Asked start and end \[s\].
    pub from_s: Option<f64>,
    /// Asked end \[s\].
    pub to_s: Option<f64>,
}

/// Part of a question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Part {
    /// Separations of vehicles, and their distances from obstacles.
    Separation,
    /// Limit of single vehicles, by its key such as `speed_m_s`.
    Limit(&'static str),
    /// Well clear of air traffic.
    WellClear,
    /// Presence of all vehicles over the whole window.
    Presence,
    /// Distance from a plan.
    Plan,
}

impl Part {
    /// Returns the name of the part in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Separation => "separation",
            Self::Limit(key) => key,
            Self::WellClear => "well_clear",
            Self::Presence => "presence",
            Self::Plan => "plan",
        }
    }
}

impl Serialize for Part {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// Answer to a part of a question.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Answer {
    /// The part.
    pub part: Part,
    /// Its status. At best undecided if a flight ended early.
    pub status: Status,
    /// Findings nearest to their limits, at most ten of vehicles and ten of obstacles, the nearest first of each.
    pub closest: Vec<Finding>,
    /// Times beyond a limit.
    pub violations: FindingList,
    /// Times that are not decided.
    pub undecided: FindingList,
    /// Results of the detectors; null for a part that has one detector.
    pub detectors: Option<Detectors>,
}

impl Answer {
    /// Answer without findings.
    #[must_use]
    pub fn new(part: Part, status: Status) -> Self {
        let none = FindingList::new(Tally::all(0), Vec::new());
        Self { part, status, closest: Vec::new(), violations: none.clone(), undecided: none, detectors: None }
    }
}

/// Findings of one kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FindingList {
    /// Number of findings; a lower bound if `is_exact` is false.
    pub count: u64,
    /// Whether the number is exact.
    pub is_exact: bool,
    /// Listed findings in order of time; of many the worst, and the first of each pair or vehicle.
    pub listed: Vec<Finding>,
}

impl FindingList {
    /// List of findings with their number.
    #[must_use]
    pub fn new(tally: Tally, listed: Vec<Finding>) -> Self {
        Self { count: tally.count, is_exact: tally.is_exact, listed }
    }

    /// List of all violations of distances. Of many the deepest [`LISTED`] are listed.
    #[must_use]
    pub(super) fn deepest(mut violations: Vec<Finding>) -> Self {
        let count = violations.len() as u64;
        let excess = |of: &Finding| of.value.upper.zip(of.limit).map_or(0.0, |(min, limit)| min - limit);
        if violations.len() > LISTED {
            violations.sort_by(|a, b| excess(a).total_cmp(&excess(b)));
            violations.truncate(LISTED);
        }
        let start_s = |of: &Finding| of.from_s.unwrap_or(f64::NEG_INFINITY);
        violations.sort_by(|a, b| start_s(a).total_cmp(&start_s(b)));
        Self { count, is_exact: true, listed: violations }
    }
}

/// Finding on one or two subjects. Times are null where they are not known.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Finding {
    /// Names: two vehicles, a vehicle and an obstacle, or one vehicle.
    pub subjects: Vec<String>,
    /// Start \[s\]; null for a closest approach.
    pub from_s: Option<f64>,
    /// End \[s\]; null for a closest approach.
    pub to_s: Option<f64>,
    /// Time of the value \[s\].
    pub at_s: Option<f64>,
    /// Interval that contains the value.
    pub value: Enclosure,
    /// Limit of the value; null without a limit.
    pub limit: Option<f64>,
    /// Sampling rate that would decide an undecided time \[Hz\]; null for other findings, or if no rate would.
    pub rate_hz: Option<f64>,
}

/// Interval that contains a value; an end is null where it is not known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Enclosure {
    /// Lower bound.
    pub lower: Option<f64>,
    /// Upper bound.
    pub upper: Option<f64>,
    /// Unit of both.
    pub unit: &'static str,
}

impl Enclosure {
    /// Interval between two bounds; an infinite bound is unknown.
    #[must_use]
    pub fn new(lower: f64, upper: f64, unit: &'static str) -> Self {
        let known = |bound: f64| Some(bound).filter(|bound| bound.is_finite());
        Self { lower: known(lower), upper: known(upper), unit }
    }
}

/// Results of the detectors of separations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Detectors {
    /// Steps of a flight that were swept; null for a recording that is judged by its samples.
    pub steps: Option<u64>,
    /// Segments of motion between two samples of a vehicle that were swept; null for a flight.
    pub segments: Option<u64>,
    /// Pairs swept in closed form, summed over steps or segments. All others were excluded by bounds.
    pub pairs_swept: u64,
    /// Time of the first contact of two keep-out balls by parry \[s\]; null without a contact.
    pub parry_contact_s: Option<f64>,
    /// Number of casts of parry that contradict the closed form.
    pub parry_disagreements: u64,
    /// Number of pairs whose keep-out balls overlapped in the engine at the end of a step; null without an engine.
    pub rapier_contact_pairs: Option<u64>,
}
