//! Findings on a flight against its plan.

use serde::Serialize;

use super::report::VehicleFinding;
use crate::report::answer::{Answer, Enclosure, Finding, FindingList, Part};
use crate::report::section::Section;
use tautline_audit::recorded::{Outcome, PlanFindings};
use tautline_audit::{Status, Tally, recorded};
use tautline_core::option::{FROM, UNTIL};
use tautline_core::text::{at_least, at_most, beside_limit, exact, fixed, seconds};

/// Findings on a flight against its plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PlanReport {
    /// Path of the plan.
    pub file: String,
    /// Status: clear if every distance is known and within the tube, if one is given.
    pub status: Status,
    /// Time of the report at which the plan has time 0 \[s\]; for a plan with an epoch, less the difference of the
    /// epochs.
    pub delay_s: f64,
    /// Range of delays among which it was estimated \[s\]; null if it was given.
    pub searched_s: Option<(f64, f64)>,
    /// Allowed distance from the plan \[m\]; null if none was given.
    pub tube_m: Option<f64>,
    /// Whether the plan or the flight has no heights, so that distances are those in the plane of x and y.
    pub planar: bool,
    /// Largest distance of each vehicle from its plan.
    pub vehicles: Vec<VehicleFinding<PlanDistance>>,
    /// Time to which the status is limited \[s\], with an estimated delay; null if it covers the whole window.
    pub common_s: Option<(f64, f64)>,
    /// Times in which a distance is not known.
    pub unknown: Vec<VehicleFinding<PlanUnknown>>,
    /// Separation that follows from the plan; null if nothing follows.
    pub certificate: Option<PlanCertificate>,
}

/// Largest distance of a vehicle from its plan, between the samples too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlanDistance {
    /// Upper bound \[m\].
    pub upper_m: f64,
    /// Distance that is certainly reached \[m\].
    pub lower_m: f64,
    /// Time of the largest distance of the drawn motion \[s\].
    pub at_s: f64,
    /// Root of the mean squared distance at the samples \[m\].
    pub rms_m: f64,
}

/// Time in which the distance of a vehicle from its plan is not known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlanUnknown {
    /// Start \[s\].
    pub from_s: f64,
    /// End \[s\].
    pub to_s: f64,
    /// What is missing: `plan` or `flight`.
    pub missing: &'static str,
}

/// Separation of the flight that follows from the separations of the plan. Each pair of the plan must keep the limit of
/// the flight and the distances of both vehicles from the plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanCertificate {
    /// Whether the plan keeps all of these separations.
    pub holds: bool,
    /// The two vehicles with the least margin.
    pub who: [String; 2],
    /// Their smallest separation in the plan \[m\].
    pub plan_m: f64,
    /// Separation that the plan must keep between them \[m\].
    pub needs_m: f64,
    /// Time of the report \[s\].
    pub at_s: f64,
}

impl PlanReport {
    /// Returns the findings of a comparison; `audited` is the audit of the plan for the certificate.
    #[must_use]
    pub fn new(file: String, found: &PlanFindings, outcome: &Outcome, audited: Option<&Outcome>) -> Self {
        let distance = |of: &recorded::PlanDeviation| PlanDistance {
            upper_m: of.upper_m,
            lower_m: of.lower_m,
            at_s: of.at_s,
            rms_m: of.rms_m,
        };
        let unknown = |of: &recorded::PlanUnknown| PlanUnknown {
            from_s: of.from_s,
            to_s: of.to_s,
            missing: if of.is_flown { "plan" } else { "flight" },
        };
        let is_contradictory = outcome.contradiction.is_some();
        Self {
            file,
            status: if is_contradictory { found.status.and(Status::Undecided) } else { found.status },
            delay_s: found.delay_s,
            searched_s: found.searched_s,
            tube_m: found.tube_m,
            planar: false,
            vehicles: found
                .deviations
                .iter()
                .map(|of| VehicleFinding::new(outcome, of.vehicle, distance(of)))
                .collect(),
            unknown: found.unknown.iter().map(|of| VehicleFinding::new(outcome, of.vehicle, unknown(of))).collect(),
            common_s: found.common_s,
            certificate: audited.filter(|_| !is_contradictory).and_then(PlanCertificate::of),
        }
    }

    /// Returns the vehicle with the largest distance.
    fn farthest(&self) -> Option<&VehicleFinding<PlanDistance>> {
        self.vehicles.iter().max_by(|a, b| a.finding.upper_m.total_cmp(&b.finding.upper_m))
    }

    /// Returns the time to which the status is limited.
    fn common(&self) -> String {
        self.common_s.map_or(String::new(), |(from_s, to_s)| {
            format!(" from {} s to {} s, the common time of flight and plan", fixed(from_s, 3), fixed(to_s, 3))
        })
    }

    /// Returns the answer on the distances from the plan. A distance without a tube has no limit.
    pub(super) fn answer(&self) -> Answer {
        let distance = |(k, VehicleFinding { vehicle, finding }): (usize, &VehicleFinding<PlanDistance>)| {
            let value = Enclosure::new(finding.lower_m, finding.upper_m, "m");
            Finding::distance(k, vehicle, value, self.tube_m, finding.at_s)
        };
        let all: Vec<_> = self.vehicles.iter().enumerate().map(distance).collect();
        let unknown = self.unknown.iter().enumerate().map(|(k, VehicleFinding { vehicle, finding })| {
            Finding::unknown(k, vehicle.clone(), "m", self.tube_m).over(finding.from_s, finding.to_s)
        });
        let is_beyond = |finding: &&Finding| finding.limit.is_some() && finding.margin() > 0.0;
        let is_open =
            |finding: &&Finding| finding.limit.is_some() && finding.largest_margin() > 0.0 && !is_beyond(finding);
        let beyond: Vec<_> = all.iter().filter(is_beyond).cloned().collect();
        let mut open: Vec<_> = all.iter().filter(is_open).cloned().chain(unknown).collect();
        let start_s = |finding: &Finding| finding.from_s.or(finding.at_s).unwrap_or(f64::NEG_INFINITY);
        open.sort_by(|a, b| start_s(a).total_cmp(&start_s(b)));
        let farthest = all.iter().max_by(|a, b| a.value.upper_bound().total_cmp(&b.value.upper_bound()));
        Answer {
            closest: farthest.cloned().into_iter().collect(),
            violations: FindingList::new(Tally::all(beyond.len()), beyond),
            undecided: FindingList::new(Tally::all(open.len()), open),
            ..Answer::new(Part::Plan, self.status)
        }
    }

    /// Returns the findings in the words of a status.
    pub(super) fn brief_as(&self, status: Status) -> String {
        let delay =
            format!("delay {} s{}", fixed(self.delay_s, 3), if self.searched_s.is_some() { " estimated" } else { "" });
        let tube = self.tube_m.map_or(String::new(), |m| format!("tube {} m, ", exact(m)));
        let axes = if self.planar { " in the plane of x and y" } else { "" };
        let farthest = self.farthest().map(|VehicleFinding { vehicle, finding }| (vehicle, finding));
        match (status, farthest) {
            (Status::Clear, Some((vehicle, PlanDistance { upper_m, at_s, .. }))) => {
                let (most, at) = (at_most(*upper_m, 6), seconds(*at_s));
                let certified = self.certificate.as_ref().map_or(String::new(), |of| {
                    let then = if self.common_s.is_some() { " in this time" } else { "" };
                    format!("; {}{then}", of.words())
                });
                let common = self.common();
                format!("within {most} m of the plan{axes}{common}, {vehicle} at {at} ({tube}{delay}){certified}")
            }
            (Status::Violation, _) => {
                let left = self.vehicles.iter().max_by(|a, b| a.finding.lower_m.total_cmp(&b.finding.lower_m));
                left.map_or(String::new(), |VehicleFinding { vehicle, finding }| {
                    let least = match self.tube_m {
                        Some(tube_m) => beside_limit(finding.lower_m, tube_m, 6),
                        None => at_least(finding.lower_m, 6),
                    };
                    let at = seconds(finding.at_s);
                    format!("{vehicle} is {least} m from the plan{axes} at {at} ({tube}{delay})")
                })
            }
            (_, farthest) => match (self.unknown.first(), farthest) {
                (Some(VehicleFinding { vehicle, finding: PlanUnknown { from_s, to_s, missing } }), _) => {
                    let (from, to) = (fixed(*from_s, 3), fixed(*to_s, 3));
                    format!(
                        "the distance of {vehicle} from the plan is not known from {from} s to {to} s: no {missing}; \
                         {FROM} and {UNTIL} select the time to judge ({delay})"
                    )
                }
                (None, Some((vehicle, PlanDistance { upper_m, lower_m, .. }))) => {
                    let (low, high) = (at_least(*lower_m, 6), at_most(*upper_m, 6));
                    format!("{vehicle} is between {low} m and {high} m from the plan{axes} ({tube}{delay})")
                }
                (None, None) => "no vehicle is present together with its plan".to_owned(),
            },
        }
    }

    /// Returns the sections of the text and of the page.
    pub(super) fn sections(&self) -> [Section; 2] {
        let searched = self.searched_s.map_or("given".to_owned(), |(from_s, to_s)| {
            format!("of least mean squared distance at the samples, of all from {from_s} s to {to_s} s")
        });
        let certificate =
            self.certificate.as_ref().map_or("no separation follows from the plan".to_owned(), PlanCertificate::words);
        let caption =
            format!("{}{}, delay {} s ({searched}); {certificate}", self.file, self.common(), fixed(self.delay_s, 6));
        let row = |VehicleFinding { vehicle, finding }: &VehicleFinding<PlanDistance>| {
            let PlanDistance { upper_m, lower_m, at_s, rms_m } = *finding;
            let verdict = match self.tube_m {
                None => "measured",
                Some(tube_m) if lower_m > tube_m => "beyond the tube",
                Some(tube_m) if upper_m <= tube_m => "within the tube",
                Some(_) => "undecided",
            };
            [
                vehicle.clone(),
                at_most(upper_m, 6),
                at_least(lower_m, 6),
                fixed(at_s, 3),
                fixed(rms_m, 6),
                verdict.to_owned(),
            ]
        };
        let columns = &["vehicle", "at most [m]", "at least [m]", "at [s]", "rms [m]", "verdict"];
        let mut rows: Vec<_> = self.vehicles.iter().collect();
        rows.sort_by(|a, b| b.finding.upper_m.total_cmp(&a.finding.upper_m));
        let unknown = self.unknown.iter().map(|VehicleFinding { vehicle, finding }| {
            let (from, to) = (fixed(finding.from_s, 3), fixed(finding.to_s, 3));
            format!("{vehicle} from {from} s to {to} s: no {}", finding.missing)
        });
        [
            Section::table("Against the plan", caption, columns, rows.into_iter().map(row)),
            Section::list("Distance from the plan not known", "times", unknown.collect()),
        ]
    }
}

impl PlanCertificate {
    /// Returns the certificate of an audited plan; `None` if no pair was judged.
    fn of(audited: &Outcome) -> Option<Self> {
        let deepest = audited.violations.iter().min_by(|a, b| (a.min_m - a.limit_m).total_cmp(&(b.min_m - b.limit_m)));
        let nearest = audited.closest.iter().min_by(|a, b| (a.lower_m - a.limit_m).total_cmp(&(b.lower_m - b.limit_m)));
        let (pair, plan_m, needs_m, at_s) = match deepest {
            Some(of) => (of.pair, of.min_m, of.limit_m, of.min_at_s),
            None => nearest.map(|of| (of.pair, of.lower_m, of.limit_m, of.time_s))?,
        };
        let who = audited.names(pair, &[]);
        Some(Self { holds: audited.status == Status::Clear, who, plan_m, needs_m, at_s })
    }

    fn words(&self) -> String {
        let Self { holds, who: [first, second], plan_m, needs_m, at_s } = self;
        let (keeps, needs, at) = (at_least(*plan_m, 6), at_most(*needs_m, 6), seconds(*at_s));
        if *holds {
            format!(
                "the plan keeps delta + 2e, so the flight within e of it keeps delta ({first} and {second}: {keeps} m \
                 at {at}, {needs} m needed)"
            )
        } else {
            format!("the plan does not keep delta + 2e ({first} and {second}: {keeps} m at {at}, {needs} m needed)")
        }
    }
}
