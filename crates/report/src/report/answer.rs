//! Answers to the parts of a question, the same for a flight and for a recording.

use std::collections::BTreeMap;
use std::iter;

use serde::{Serialize, Serializer};

use tautline_audit::envelope::{Exceedance, Limit};
use tautline_audit::recorded::{Counterpart, PlanApproach, PlanConflict, PlanReference, WellClearLoss};
use tautline_audit::{Approach, LISTED, ObjectPair, Status, Tally, Undecided, Violation, WellClear};
use tautline_core::fact::Fact;
use tautline_core::swarm::Pair;

/// Judgement of a flight or of a recording: the first keys of both reports.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Judgement {
    /// Version of the keys, [`SCHEMA_VERSION`](super::SCHEMA_VERSION).
    pub schema_version: u32,
    /// Worst status of all answers.
    pub status: Status,
    /// Whether the exit code is 0 by default. A recording passes if it is clear. A flight passes if there is also no
    /// reason against it.
    pub pass: bool,
    /// Whether the status is clear and rests on no assumption.
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

/// Question about a flight or a recording. Lengths are in metres. A key that the question does not use is null.
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
    /// Height at or below which pairs are exempt \[m\].
    pub above_m: Option<f64>,
    /// Given start of the window \[s\].
    pub from_s: Option<f64>,
    /// Given end of the window \[s\].
    pub to_s: Option<f64>,
}

/// Part of a question.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Part {
    /// Separations of vehicles, and their distances from obstacles.
    Separation,
    /// Limit of single vehicles.
    Limit(Limit),
    /// Well clear of air traffic, with its thresholds.
    WellClear(WellClear),
    /// Presence of all vehicles over the whole window.
    Presence,
    /// Distance from a plan.
    Plan,
    /// Separations of published plans: of each plan from those that were valid at its publication.
    PublishedPlans,
    /// Separations of published plans from the recorded flights of other vehicles.
    FlownPlans,
}

impl Part {
    /// Returns the name of the part in JSON, such as `separation` or `speed_m_s`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Separation => "separation",
            Self::Limit(limit) => limit.quantity.key(),
            Self::WellClear(_) => "well_clear",
            Self::Presence => "presence",
            Self::Plan => "plan",
            Self::PublishedPlans => "published_plans",
            Self::FlownPlans => "flown_plans",
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
    /// Status of the part; not clear if a flight ended early.
    pub status: Status,
    /// Status over the time that was flown.
    #[serde(skip)]
    pub status_so_far: Status,
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
    /// Returns an answer without findings.
    #[must_use]
    pub fn new(part: Part, status: Status) -> Self {
        let none = FindingList::new(Tally::all(0), Vec::new());
        let (closest, violations, undecided) = (Vec::new(), none.clone(), none);
        Self { part, status, status_so_far: status, closest, violations, undecided, detectors: None }
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
    /// Returns a list of findings with their number.
    #[must_use]
    pub fn new(tally: Tally, listed: Vec<Finding>) -> Self {
        Self { count: tally.count, is_exact: tally.is_exact, listed }
    }

    /// Returns a list of violations of distances. It counts all and holds the deepest [`LISTED`].
    #[must_use]
    pub(super) fn deepest(mut violations: Vec<Finding>) -> Self {
        let count = violations.len() as u64;
        if violations.len() > LISTED {
            violations.sort_by(|a, b| a.largest_margin().total_cmp(&b.largest_margin()));
            violations.truncate(LISTED);
        }
        let start_s = |finding: &Finding| finding.from_s.unwrap_or(f64::NEG_INFINITY);
        violations.sort_by(|a, b| start_s(a).total_cmp(&start_s(b)));
        Self { count, is_exact: true, listed: violations }
    }

    /// Returns whether the list holds fewer findings than were found.
    #[must_use]
    pub fn is_shortened(&self) -> bool {
        self.count > self.listed.len() as u64 || !self.is_exact
    }
}

/// Finding on one or two subjects. Times are null where they are not known.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Finding {
    /// Indices of the subjects.
    #[serde(skip)]
    pub objects: Objects,
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
    /// Smallest vertical distance of a loss of well clear \[m\], whose value is the horizontal one; absent for others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertical_m: Option<f64>,
    /// Published plans of the two vehicles, the later published one first, or plan of the first vehicle, whose
    /// counterpart is a flight; absent for others.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub plans: Vec<PublishedPlan>,
}

/// Plan that a vehicle published.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PublishedPlan {
    /// Number among the plans of its vehicle, from 1.
    pub number: u64,
    /// Instant of publication \[s\].
    pub published_s: f64,
}

impl From<PlanReference> for PublishedPlan {
    fn from(PlanReference { number, published_s, .. }: PlanReference) -> Self {
        Self { number, published_s }
    }
}

/// Returns a plan, and the plan that it is compared with.
fn published(plan: PlanReference, other: Counterpart) -> Vec<PublishedPlan> {
    iter::once(plan).chain(other.plan()).map(PublishedPlan::from).collect()
}

/// Indices of the subjects of a finding, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objects {
    /// Two vehicles, or a vehicle and an obstacle.
    Pair(ObjectPair),
    /// One vehicle.
    Vehicle(usize),
}

impl Finding {
    fn new(objects: Objects, subjects: impl Into<Vec<String>>, value: Enclosure, limit: Option<f64>) -> Self {
        let (subjects, plans) = (subjects.into(), Vec::new());
        let (from_s, to_s, at_s, rate_hz, vertical_m) = (None, None, None, None, None);
        Self { objects, subjects, from_s, to_s, at_s, value, limit, rate_hz, vertical_m, plans }
    }

    /// Sets start and end.
    pub(super) fn over(self, from_s: f64, to_s: f64) -> Self {
        Self { from_s: Some(from_s), to_s: Some(to_s), ..self }
    }

    fn at(self, at_s: f64) -> Self {
        Self { at_s: Some(at_s).filter(|at_s| at_s.is_finite()), ..self }
    }

    /// Returns the closest approach of a pair.
    pub(super) fn approach(found: &Approach, names: [String; 2], unit: &'static str) -> Self {
        let value = Enclosure::new(found.lower_m, found.upper_m, unit);
        Self::new(Objects::Pair(found.pair), names, value, Some(found.limit_m)).at(found.time_s)
    }

    /// Returns the violation of a pair. If `is_exact` is false, the smallest distance has only an upper bound.
    pub(super) fn violation<P: Copy + Into<ObjectPair>>(
        found: &Violation<P>,
        names: [String; 2],
        unit: &'static str,
        is_exact: bool,
    ) -> Self {
        let lower = if is_exact { found.min_m } else { f64::NEG_INFINITY };
        let value = Enclosure::new(lower, found.min_m, unit);
        let finding = Self::new(Objects::Pair(found.pair.into()), names, value, Some(found.limit_m));
        finding.over(found.from_s, found.to_s).at(found.min_at_s)
    }

    /// Returns an undecided time of a pair.
    pub(super) fn undecided(found: &Undecided<ObjectPair>, names: [String; 2], unit: &'static str) -> Self {
        let value = Enclosure::new(found.lower_m, found.upper_m, unit);
        let finding = Self::new(Objects::Pair(found.pair), names, value, Some(found.limit_m));
        Self { rate_hz: found.rate_hz, ..finding.over(found.from_s, found.to_s) }
    }

    /// Returns the value of a vehicle that is compared with a limit.
    pub(super) fn exceedance(found: &Exceedance, name: String, limit: Limit) -> Self {
        let value = Enclosure::new(found.lower, found.upper, limit.quantity.unit());
        let finding = Self::new(Objects::Vehicle(found.vehicle), [name], value, Some(limit.allowed));
        finding.over(found.from_s, found.to_s).at(found.at_s)
    }

    /// Returns the finding that the value of a vehicle is not known.
    pub(super) fn unknown(vehicle: usize, name: String, unit: &'static str, limit: Option<f64>) -> Self {
        let value = Enclosure { lower: None, upper: None, unit };
        Self::new(Objects::Vehicle(vehicle), [name], value, limit)
    }

    /// Returns a loss of well clear, with its horizontal and vertical distance.
    pub(super) fn well_clear(found: &WellClearLoss, names: [String; 2], limits: WellClear) -> Self {
        let value = Enclosure::new(found.horizontal_m, found.horizontal_m, "m");
        let objects = Objects::Pair(ObjectPair::Vehicles(found.pair));
        let finding = Self::new(objects, names, value, Some(limits.horizontal_m)).over(found.from_s, found.to_s);
        Self { vertical_m: Some(found.vertical_m), ..finding }
    }

    /// Returns the closest approach of a published plan; `names` are those of the two vehicles.
    pub(super) fn plan_approach(found: &PlanApproach, names: [String; 2], unit: &'static str) -> Self {
        Self { plans: published(found.plan, found.other), ..Self::approach(&found.approach, names, unit) }
    }

    /// Returns a time in which a published plan and its counterpart are, or may be, closer than their limit.
    pub(super) fn plan_conflict(found: &PlanConflict, names: [String; 2], unit: &'static str) -> Self {
        let objects = Objects::Pair(ObjectPair::Vehicles(Pair::new(found.plan.vehicle, found.other.vehicle())));
        let value = Enclosure::new(found.lower_m, found.upper_m, unit);
        let finding = Self::new(objects, names, value, Some(found.limit_m)).over(found.from_s, found.to_s);
        Self { at_s: found.min_at_s, plans: published(found.plan, found.other), ..finding }
    }

    /// Returns the distance of a vehicle from its plan.
    pub(super) fn distance(vehicle: usize, name: &str, value: Enclosure, limit: Option<f64>, at_s: f64) -> Self {
        Self::new(Objects::Vehicle(vehicle), [name.to_owned()], value, limit).at(at_s)
    }

    /// Returns whether the finding concerns an obstacle.
    #[must_use]
    pub fn is_of_obstacle(&self) -> bool {
        matches!(self.objects, Objects::Pair(ObjectPair::Obstacle { .. }))
    }

    /// Returns the value less its limit: negative for a distance below it. Unknown values count as infinite.
    #[must_use]
    pub fn margin(&self) -> f64 {
        self.value.lower_bound() - self.limit.unwrap_or(0.0)
    }

    /// Returns the upper bound of the value less its limit.
    pub(super) fn largest_margin(&self) -> f64 {
        self.value.upper_bound() - self.limit.unwrap_or(0.0)
    }
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
    /// Returns the interval between two bounds; an infinite bound is unknown.
    #[must_use]
    pub fn new(lower: f64, upper: f64, unit: &'static str) -> Self {
        let known = |bound: f64| Some(bound).filter(|bound| bound.is_finite());
        Self { lower: known(lower), upper: known(upper), unit }
    }

    /// Returns the lower bound; -inf if it is not known.
    #[must_use]
    pub fn lower_bound(&self) -> f64 {
        self.lower.unwrap_or(f64::NEG_INFINITY)
    }

    /// Returns the upper bound; inf if it is not known.
    #[must_use]
    pub fn upper_bound(&self) -> f64 {
        self.upper.unwrap_or(f64::INFINITY)
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
