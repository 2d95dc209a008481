//! Findings on the distances of vehicles from obstacles.

use serde::Serialize;

use super::flight::{FlightResult, finite};
use super::section::Section;
use super::verdict::INTEGRATION;
use tautline_audit::{Approach, ClearanceOutcome, ObjectPair, Status, Violation};
use tautline_core::text::{at_least, beside_limit, counted, exact, seconds, separation, up_to};
use tautline_sim::sim::Ending;

/// Findings of the audit on obstacles.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacles {
    /// Status of obstacles alone, which is also part of the status of the audit. At best undecided if the flight ended
    /// early.
    pub status: Status,
    /// Distance beyond the clearance of every obstacle that the law certifies for every vehicle \[m\].
    pub certified_clearance_margin_m: Option<f64>,
    /// Closest approaches of different vehicles and obstacles, at most ten, the closest first.
    pub closest: Vec<ObstacleApproach>,
    /// Intervals in which a vehicle was closer to an obstacle than its clearance.
    pub violations: Vec<ObstacleViolation>,
    /// Number of undecided times.
    pub undecided: u64,
    /// Number of distances at which the second detector (parry) contradicts the closed form.
    pub disagreements: u64,
}

/// Closest approach of a vehicle to an obstacle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ObstacleApproach {
    /// Number of the vehicle, from 1.
    pub vehicle: usize,
    /// Name of the obstacle.
    pub obstacle: String,
    /// Distance that the centre of the vehicle must keep from the surface \[m\].
    pub clearance_m: f64,
    /// Smallest distance from the surface, negative inside \[m\].
    pub min_m: f64,
    /// Time of `min_m` \[s\].
    pub min_at_s: f64,
}

/// An interval in which a vehicle was closer to an obstacle than its clearance.
#[derive(Clone, Debug, PartialEq)]
pub struct ObstacleViolation {
    /// Vehicle, obstacle and smallest distance.
    pub approach: ObstacleApproach,
    /// Start \[s\].
    pub from_s: f64,
    /// End, or the end of the run \[s\].
    pub to_s: f64,
}

impl Obstacles {
    pub(super) fn of(result: &FlightResult<'_>) -> Option<Self> {
        let (outcome, obstacles) = (result.flight.clearance.as_ref()?, &result.scenario.obstacles);
        let approach = |pair: ObjectPair, clearance_m: f64, min_m: f64, min_at_s: f64| match pair {
            ObjectPair::Obstacle { vehicle, obstacle } => Some(ObstacleApproach {
                vehicle: vehicle + 1,
                obstacle: obstacles.get(obstacle).map(|obstacle| obstacle.name.clone()).unwrap_or_default(),
                clearance_m,
                min_m,
                min_at_s,
            }),
            ObjectPair::Vehicles(_) => None,
        };
        let ClearanceOutcome { status, closest, violations, undecided, unresolved, parry, refused, .. } = outcome;
        let of_violation = |found: &Violation<ObjectPair>| {
            let &Violation { pair, from_s, to_s, min_m, min_at_s, limit_m } = found;
            Some(ObstacleViolation { approach: approach(pair, limit_m, min_m, min_at_s)?, from_s, to_s })
        };
        let of_closest = |found: &Approach| approach(found.pair, found.limit_m, found.certain_m(), found.time_s);
        Some(Self {
            status: if result.flight.ending == Ending::Completed { *status } else { status.and(Status::Undecided) },
            certified_clearance_margin_m: result.flight.certificate.certified_clearance_margin_m.and_then(finite),
            closest: closest.iter().filter_map(of_closest).collect(),
            violations: violations.iter().filter_map(of_violation).collect(),
            undecided: undecided.len() as u64 + unresolved + refused,
            disagreements: parry.disagreements,
        })
    }

    /// Returns the deepest violation.
    pub(super) fn deepest(&self) -> Option<&ObstacleApproach> {
        let room = |approach: &ObstacleApproach| approach.min_m - approach.clearance_m;
        let approaches = self.violations.iter().map(|violation| &violation.approach);
        approaches.min_by(|a, b| room(a).total_cmp(&room(b)))
    }

    /// Returns the approach with the smallest distance beyond its clearance, and that distance \[m\].
    fn tightest(&self) -> Option<(f64, &ObstacleApproach)> {
        let rooms = self.closest.iter().map(|approach| (approach.min_m - approach.clearance_m, approach));
        rooms.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Returns the deepest violation in a few words.
    pub(super) fn brief(&self) -> Option<String> {
        self.deepest().map(ObstacleApproach::brief)
    }

    /// Returns the smallest distance beyond a clearance in a few words.
    pub(super) fn room(&self) -> Option<String> {
        self.tightest().map(|(clearance_margin_m, _)| {
            format!("{} m beyond every obstacle's clearance", at_least(clearance_margin_m, 3))
        })
    }

    /// Returns the certified distance beyond every clearance \[m\] and the approach that breaks it by more than the
    /// error of integration.
    pub(super) fn broken_certificate(&self) -> Option<(f64, &ObstacleApproach)> {
        let certified_m = self.certified_clearance_margin_m?;
        let (clearance_margin_m, tightest) = self.tightest()?;
        (clearance_margin_m < certified_m * (1.0 - INTEGRATION)).then_some((certified_m, tightest))
    }

    /// Returns the sections of the closest approaches and of the violations.
    pub(super) fn sections(&self) -> [Section; 2] {
        let cells = |approach: &ObstacleApproach| {
            let ObstacleApproach { vehicle, obstacle, clearance_m, min_m, min_at_s } = approach;
            let near = shown(*min_m, *clearance_m);
            [vehicle.to_string(), obstacle.clone(), exact(*clearance_m), near, seconds(*min_at_s)]
        };
        let certified = match self.certified_clearance_margin_m {
            Some(clearance_margin_m) => {
                format!("closest approaches; certified {} m beyond every clearance", at_least(clearance_margin_m, 6))
            }
            None => "closest approaches; nothing is certified".to_owned(),
        };
        let violations = self.violations.iter().map(|violation| {
            let [vehicle, obstacle, clearance, min, at] = cells(&violation.approach);
            [vehicle, obstacle, clearance, min, at, seconds(violation.from_s), seconds(violation.to_s)]
        });
        let columns = &["Vehicle", "Obstacle", "Clearance in m", "Smallest distance in m", "At"];
        let longer = &["Vehicle", "Obstacle", "Clearance in m", "Smallest distance in m", "At", "From", "To"];
        [
            Section::table("Obstacles", certified, columns, self.closest.iter().map(cells)),
            Section::table(
                "Violations of clearance",
                "intervals in which a vehicle was below its clearance",
                longer,
                violations,
            ),
        ]
    }

    /// Returns the findings in one line.
    pub(super) fn line(&self) -> String {
        let closest = self.tightest().map_or("-".to_owned(), |(_, tightest)| {
            let ObstacleApproach { vehicle, obstacle, clearance_m, min_m, min_at_s } = tightest;
            let at = seconds(*min_at_s);
            format!(
                "{} m at {at}, vehicle {vehicle} from obstacle {obstacle} (clearance {} m",
                shown(*min_m, *clearance_m),
                exact(*clearance_m)
            )
        });
        let certified = match self.certified_clearance_margin_m {
            Some(clearance_margin_m) => format!("certified {} m beyond it", at_least(clearance_margin_m, 6)),
            None => "not certified".to_owned(),
        };
        let violations = counted(self.violations.len() as u64, "violation", "violations");
        format!("{closest}, {certified}); {violations}")
    }
}

impl ObstacleApproach {
    pub(super) fn brief(&self) -> String {
        let Self { vehicle, obstacle, clearance_m, min_m, min_at_s } = self;
        let (clearance, at) = (exact(*clearance_m), seconds(*min_at_s));
        if *min_m < 0.0 {
            let deep = up_to(-min_m);
            let clearance = format!("clearance {clearance} m");
            return format!("vehicle {vehicle} was {deep} m inside obstacle {obstacle} at {at} ({clearance})");
        }
        let near = beside_limit(*min_m, *clearance_m, 3);
        format!("vehicle {vehicle} came to {near} m from obstacle {obstacle} at {at} (clearance {clearance} m)")
    }
}

/// Formats a distance beside its clearance, rounded down.
fn shown(distance_m: f64, clearance_m: f64) -> String {
    if distance_m < 0.0 { separation(distance_m) } else { beside_limit(distance_m, clearance_m, 6) }
}
