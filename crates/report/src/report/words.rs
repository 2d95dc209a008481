//! Report of a flight in words: reasons, a verdict line and a table.

use std::fmt::{self, Display, Formatter};

use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use super::answer::Finding;
use super::flight::{Ellipsoid, FailedVehicle, Performance, Report, VehicleNumbers, Verification};
use super::hulls::{PassedThrough, vehicles};
use super::shield::ShieldNumbers;
use super::verdict::{Reason, UnmetCriterion, breaks_certificate};
use tautline_audit::Status;
use tautline_core::fact::Coded;
use tautline_core::swarm::Bounce;
use tautline_core::text::{
    at_least, below_bound, beside_limit, capitalised, counted, exact, metres, seconds, separation, table, up_to,
};
use tautline_sim::link::Traffic;
use tautline_sim::scenario::TimeSpec;
use tautline_sim::sim::{Breakdown, Ending};

/// Serialises a reason as an object with `code`, `text` and `data`.
impl Serialize for Reason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        struct Data<'a>(&'a Reason);
        impl Serialize for Data<'_> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                Reason::serialize(self.0, serializer)
            }
        }
        let mut object = serializer.serialize_struct("Reason", 3)?;
        object.serialize_field("code", self.code())?;
        object.serialize_field("text", &self.to_string())?;
        object.serialize_field("data", &Data(self))?;
        object.end()
    }
}

/// Serialises an early end as an object with `code` and `text`.
#[expect(clippy::ref_option, reason = "the form that serde calls")]
pub(super) fn serialize_early_end<S: Serializer>(end: &Option<Ending>, serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct EarlyEnd {
        code: &'static str,
        text: String,
    }
    end.as_ref().map(|end| EarlyEnd { code: end.code(), text: early_end(end) }).serialize(serializer)
}

/// Returns the reason of an early end, with a remedy.
pub(super) fn early_end(end: &Ending) -> String {
    match end {
        Ending::BrokeDown(why @ Breakdown::Unresolved { .. }) => {
            format!("{why}; shorten time.duration_s, or reduce the drift of the mean velocity")
        }
        Ending::BrokeDown(why) => format!("{why}; shorten time.dt_s, or look for speeds and gains that grow"),
        ending => ending.reason().unwrap_or_default(),
    }
}

/// Returns the number of further violations in a sentence.
fn others(violations: usize) -> String {
    match violations.saturating_sub(1) {
        0 => String::new(),
        1 => " There is 1 other violation.".to_owned(),
        n => format!(" There are {n} other violations."),
    }
}

/// Returns a smallest distance of two vehicles, with the words `limit` behind it, or of a vehicle from an obstacle.
fn came_to(found: &Finding, limit: &str) -> String {
    let (min_m, limit_m) = (found.value.upper_bound(), found.limit.unwrap_or_default());
    let at = seconds(found.at_s.unwrap_or_default());
    let near = beside_limit(min_m, limit_m, 3);
    let (vehicle, obstacle) = match &found.subjects[..] {
        [vehicle, obstacle] if found.is_of_obstacle() => (vehicle, obstacle),
        _ => return format!("vehicles {} came to {near} m{limit} at {at}", found.names()),
    };
    let clearance = exact(limit_m);
    if min_m < 0.0 {
        let deep = up_to(-min_m);
        return format!("vehicle {vehicle} was {deep} m inside obstacle {obstacle} at {at} (clearance {clearance} m)");
    }
    format!("vehicle {vehicle} came to {near} m from obstacle {obstacle} at {at} (clearance {clearance} m)")
}

/// Returns the words behind a distance that is scaled by an ellipsoid.
fn scaled(found: &Finding) -> &'static str {
    if found.value.unit == "m" { "" } else { " scaled to ellipsoids" }
}

/// Returns a smallest separation below a certified one, in metres each.
fn below_certified(found: &Finding) -> [String; 2] {
    below_bound(found.value.upper_bound(), found.limit.unwrap_or_default())
}

/// Writes the reason in sentences, with a remedy.
impl Display for Reason {
    #[expect(clippy::too_many_lines, reason = "one text for each reason")]
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused { warnings } => write!(out, "The check refuses the flight: {}.", warnings.join(", ")),
            Self::Violation { deepest, violations } => write!(
                out,
                "{}; the safety distance is {} m.{}",
                capitalised(&came_to(deepest, scaled(deepest))),
                exact(deepest.limit.unwrap_or_default()),
                others(*violations)
            ),
            Self::UnresolvedByStep(deepest) => write!(
                out,
                "The step cannot resolve whether the safety distance of {} m is kept. In the flown motion {}, but the \
                 integration error of steps that are too long for the law may be larger.",
                exact(deepest.limit.unwrap_or_default()),
                came_to(deepest, scaled(deepest))
            ),
            Self::ObstacleViolation { deepest, violations } => {
                write!(out, "A vehicle came too near to an obstacle: {}.{}", came_to(deepest, ""), others(*violations))
            }
            Self::ObstacleCertificateBroken { approach, certified_clearance_margin_m } => write!(
                out,
                "The law certifies {} m beyond every clearance in continuous time, and {}: the flown motion is not \
                 the one that the proof covers. Shorten time.dt_s.",
                separation(*certified_clearance_margin_m),
                came_to(approach, "")
            ),
            Self::ObstacleDetectorsDisagree { disagreements } => write!(
                out,
                "The two detectors disagree {} on the distance from an obstacle, so one of them is wrong.",
                counted(*disagreements, "time", "times")
            ),
            Self::ObstacleUnresolvedByStep(deepest) => write!(
                out,
                "The step cannot resolve whether the clearance of obstacles is kept. In the flown motion {}, but the \
                 integration error of steps that are too long for the law may be larger.",
                came_to(deepest, "")
            ),
            Self::ObstacleUndecided { .. } => {
                out.write_str("The audit cannot decide whether every vehicle kept its clearance from the obstacles.")
            }
            Self::PassedThrough { through: PassedThrough { pair, min_at_s, min_m, touching_m }, are_points } => write!(
                out,
                "{} passed through each other: their hulls touch at {} m, and they came to {} m at {}. {}. Solid \
                 hulls would move otherwise from then on.",
                capitalised(&vehicles(*pair)),
                exact(*touching_m),
                beside_limit(*min_m, *touching_m, 3),
                seconds(*min_at_s),
                if *are_points {
                    "Vehicles of the ideal plant are points"
                } else {
                    "A step skipped the collision: shorten time.dt_s"
                }
            ),
            Self::HullsHit { first, collisions } => write!(
                out,
                "{}. After the first collision the motion is not governed by the law; the point vehicles of the ideal \
                 plant move otherwise.",
                capitalised(&hits(first, *collisions))
            ),
            Self::DetectorsDisagree { disagreements, first } => {
                let times = if *disagreements == 1 { "once".to_owned() } else { format!("{disagreements} times") };
                write!(out, "The two detectors of the audit disagree {times}, so one of them is wrong.")?;
                first.as_ref().map_or(Ok(()), |first| write!(out, " First: {first}."))
            }
            Self::PathsBend { .. } => out.write_str(
                "Two vehicles came so close to delta that the audit cannot decide: the bound on the bend of their \
                 paths within a step exceeds their distance from delta.",
            ),
            Self::NotJudged {} => {
                out.write_str("The audit could not judge every pair and step, so it does not exclude a violation.")
            }
            Self::CertificateBroken { approach, by_shield } => {
                let ([min, certified], pair) = (below_certified(approach), approach.names());
                let broken =
                    format!("vehicles {pair} came to {min} m: the flown motion is not the one that the proof covers");
                if *by_shield {
                    return write!(out, "The assumptions of the shield held and imply {certified} m, but {broken}.");
                }
                write!(
                    out,
                    "The law certifies {certified} m in continuous time, but {broken}. Shorten time.dt_s, and look for \
                     positions so large that their differences lose digits."
                )
            }
            Self::ShieldBoundExceeded { exceeded } => write!(
                out,
                "A bound that the shield assumes was exceeded ({exceeded}), so its certificate does not cover this \
                 flight. Raise the bound in [shield], or reduce the errors, the wind or the lag."
            ),
            Self::LawFailed { instants } => write!(
                out,
                "The law failed or commanded numbers that are not finite at {}, where the shield braked. Correct the \
                 law: it gives every vehicle a finite command at every instant.",
                counted(*instants, "instant", "instants")
            ),
            Self::StepsTooLong { steps } => write!(
                out,
                "{} longer than the law allows, even after all halvings: the flown motion is not that of the law. \
                 Shorten time.dt_s, raise time.max_halvings, leave time.max_rate_dt at no more than {}, or make the \
                 law gentler.",
                counted(*steps, "step was", "steps were"),
                TimeSpec::DEFAULT_MAX_RATE_DT
            ),
            Self::EnergyRose { from, to, explained } => write!(
                out,
                "The energy rose from {from:.4e} to {to:.4e} m^2/s^2, although the law never lets it grow. Integration \
                 and rounding explain {explained:.4e}. The flown motion is not that of the law. Shorten time.dt_s, or \
                 raise time.max_halvings."
            ),
            Self::EndedEarly { at_s, cause, .. } => {
                let why = early_end(cause);
                write!(out, "The run ended early, at {}: {}.", seconds(*at_s), why.trim_end_matches('.'))
            }
            Self::NotReached { criterion, value, limit, at_rest, more_time_may_help, failed } => {
                let (value, limit) = (value.unwrap_or(f64::NAN), limit.unwrap_or(f64::NAN));
                let why = match criterion {
                    UnmetCriterion::EndedEarly | UnmetCriterion::Unknown => "no state at the end is known".to_owned(),
                    UnmetCriterion::HeldS => {
                        format!("it was kept for the last {} only; {} is required", seconds(value), seconds(limit))
                    }
                    UnmetCriterion::MaxEdgeErrorM => {
                        format!("at the end the largest edge error is {} m (limit {limit} m)", up_to(value))
                    }
                    UnmetCriterion::MaxPositionErrorM => format!(
                        "at the end every edge error is within its limit, but the shape, its attitude or its place \
                         differs: the largest position error is {} m (limit {limit} m)",
                        up_to(value)
                    ),
                    UnmetCriterion::Disagreement => format!(
                        "at the end the largest speed relative to the mean velocity, or to that of the reference, is \
                         {} m/s (limit {limit} m/s)",
                        up_to(value)
                    ),
                };
                write!(out, "The formation was not reached: {why}.")?;
                if !failed.is_empty() {
                    return write!(out, " Failed: {}.", FailedVehicle::line(failed));
                }
                match at_rest {
                    _ if *criterion == UnmetCriterion::HeldS => Ok(()),
                    Some(true) => out.write_str(
                        " The vehicles have come to rest elsewhere: ten times the duration would not suffice.",
                    ),
                    Some(false) if *more_time_may_help => {
                        out.write_str(" The vehicles are still moving: more time may help.")
                    }
                    Some(false) => out.write_str(" The vehicles are still moving."),
                    None => Ok(()),
                }
            }
            Self::LegNotReached { leg, until_s } => {
                let time = until_s.map(seconds).unwrap_or_default();
                write!(out, "Leg {leg} was not reached before leg {} began at {time}.", leg + 1)
            }
            Self::LegNeverBegan { leg, is_before_reached: true } => {
                write!(out, "Leg {leg} never began: the flight ended before.")
            }
            Self::LegNeverBegan { leg, is_before_reached: false } => {
                write!(out, "Leg {leg} never began: leg {} was not reached.", leg - 1)
            }
            Self::StartTooFlat { start_dimension, formation_dimension } => {
                let (start, trap) = match start_dimension {
                    0 => ("at one point", "point"),
                    1 => ("on a line", "line"),
                    _ => ("in a plane", "plane"),
                };
                let formation = match formation_dimension {
                    1 => "a line",
                    2 => "a plane",
                    _ => "space",
                };
                write!(
                    out,
                    "The start lies {start}, but the formation needs {formation}: a law that acts along the lines \
                     between vehicles never leaves that {trap}."
                )
            }
        }
    }
}

impl Reason {
    /// Returns the reason in a few words, as `label: detail`; `None` for a reason that the status of the audit states.
    fn brief(&self) -> Option<String> {
        Some(match self {
            Self::Refused { warnings } => format!("refused by check: {}", warnings.join(", ")),
            Self::ObstacleCertificateBroken { approach, certified_clearance_margin_m } => format!(
                "certificate broken: {}, certified {} m beyond it",
                came_to(approach, ""),
                separation(*certified_clearance_margin_m)
            ),
            Self::PassedThrough { through, are_points } => format!(
                "passed through each other: {}, {}",
                vehicles(through.pair),
                if *are_points { "as points" } else { "in one step" }
            ),
            Self::HullsHit { first, collisions } => hits(first, *collisions),
            Self::CertificateBroken { approach, .. } => {
                let ([min, certified], pair) = (below_certified(approach), approach.names());
                let time = seconds(approach.at_s.unwrap_or_default());
                format!("certificate broken: vehicles {pair} came to {min} m at {time}, certified {certified} m")
            }
            Self::ShieldBoundExceeded { exceeded } => format!("bound of the shield exceeded: {exceeded}"),
            Self::LawFailed { instants } => format!("law failed: at {}", counted(*instants, "instant", "instants")),
            Self::StepsTooLong { steps } => {
                format!("step too long: {} longer than the law allows", counted(*steps, "step", "steps"))
            }
            Self::EnergyRose { from, to, .. } if (to / from).is_finite() => {
                format!("energy rose: to {:.3} of its start", to / from)
            }
            Self::EnergyRose { .. } => "energy rose: it is proved never to grow".to_owned(),
            Self::EndedEarly { at_s, .. } => format!("the flight ended early at {}", seconds(*at_s)),
            Self::NotReached { criterion, value, at_rest, .. } => {
                let number = value.map_or("-".to_owned(), up_to);
                let what = match criterion {
                    UnmetCriterion::EndedEarly | UnmetCriterion::Unknown => {
                        return Some("not reached: no state at the end is known".to_owned());
                    }
                    UnmetCriterion::HeldS => {
                        let held = seconds(value.unwrap_or_default());
                        return Some(format!("not reached: kept for the last {held} only"));
                    }
                    UnmetCriterion::MaxEdgeErrorM => format!("largest edge error {number} m"),
                    UnmetCriterion::MaxPositionErrorM => {
                        format!("another shape or place, largest position error {number} m")
                    }
                    UnmetCriterion::Disagreement => format!("largest relative speed {number} m/s"),
                };
                let then = match at_rest {
                    Some(true) => ", at rest elsewhere",
                    Some(false) => ", still moving",
                    None => "",
                };
                format!("not reached: {what}{then}")
            }
            Self::LegNotReached { leg, until_s } => {
                let until = until_s.map(|until_s| format!(" until {}", seconds(until_s)));
                format!("not reached: leg {leg}{}", until.unwrap_or_default())
            }
            Self::LegNeverBegan { leg, .. } => format!("not reached: leg {leg}"),
            Self::Violation { .. }
            | Self::UnresolvedByStep(_)
            | Self::ObstacleViolation { .. }
            | Self::ObstacleDetectorsDisagree { .. }
            | Self::ObstacleUnresolvedByStep(_)
            | Self::ObstacleUndecided { .. }
            | Self::DetectorsDisagree { .. }
            | Self::PathsBend { .. }
            | Self::NotJudged {}
            | Self::StartTooFlat { .. } => return None,
        })
    }

    /// Returns whether the reason concerns the law or the goal. A violation makes such a reason meaningless.
    fn is_of_law(&self) -> bool {
        matches!(
            self,
            Self::ObstacleCertificateBroken { .. }
                | Self::CertificateBroken { .. }
                | Self::EnergyRose { .. }
                | Self::NotReached { .. }
                | Self::LegNotReached { .. }
                | Self::LegNeverBegan { .. }
        )
    }
}

/// Returns the number of collisions of hulls, and the first one.
fn hits(&Bounce { pair, time_s, closing_m_s }: &Bounce, collisions: usize) -> String {
    let first = format!("{} at {} with {} m/s", vehicles(pair), seconds(time_s), up_to(closing_m_s));
    match collisions {
        1 => format!("hulls hit once: {first}"),
        times => format!("hulls hit {times} times: first {first}"),
    }
}

impl Report {
    /// Returns the verdict in one line. It begins with `CLEAR` only if the flight passes, otherwise with what failed:
    ///
    /// - `CLEAR: never closer than 2.460 m (delta 2.000 m), formation reached at 36.42 s`
    /// - `VIOLATION: vehicles 2 and 3 came to 1.532 m (delta 2.000 m) at 3.63 s`
    /// - `NOT REACHED: largest edge error 0.838 m, at rest elsewhere (clear: never closer than 2.660 m, delta 2.000 m)`
    /// - `UNDECIDED: the flight ended early at 3.20 s; until then never closer than 2.435 m (delta 2.000 m)`
    #[must_use]
    pub fn headline(&self) -> String {
        let (failures, is_clear) = (self.failures(), self.answer.status == Status::Clear);
        let findings = match self.answer.status {
            Status::Clear if self.verdict.pass => {
                vec![format!("CLEAR: {}, {}", self.clearance([" (", ")"]), self.arrival())]
            }
            Status::Clear => {
                let reasons = || self.verdict.reasons.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
                let alone = || vec![format!("NOT REACHED: {}", reasons().trim_end_matches('.'))];
                let labelled = |(first, rest): (&String, &[String])| [&[capital_label(first)], rest].concat();
                failures.split_first().map_or_else(alone, labelled)
            }
            Status::Violation => [&[format!("VIOLATION: {}", self.deepest_in_words())], &failures[..]].concat(),
            Status::Undecided => [&[format!("UNDECIDED: {}", self.undecided_in_words())], &failures[..]].concat(),
        };
        let clear = (is_clear && !self.verdict.pass).then(|| {
            let reached = self.formation.reached.then(|| format!(", {}", self.arrival()));
            format!(" (clear: {}{})", self.clearance([", ", ""]), reached.unwrap_or_default())
        });
        let notes = super::legs::brief(&self.legs).into_iter().chain(self.changes()).map(|note| format!("; {note}"));
        findings.join("; ") + &clear.unwrap_or_default() + &notes.collect::<String>()
    }

    /// Returns the failures beside the status of the audit, as `label: detail`.
    fn failures(&self) -> Vec<String> {
        let is_violation = self.answer.status == Status::Violation;
        let is_in_lead = self.is_clear_until_its_early_end();
        let is_told = |reason: &&Reason| match reason {
            Reason::EndedEarly { .. } => !is_in_lead,
            // The errors at the end are those of the last leg that began.
            Reason::LegNotReached { .. } | Reason::LegNeverBegan { .. } => !is_violation && self.formation.reached,
            reason => !(is_violation && reason.is_of_law()),
        };
        self.verdict.reasons.iter().filter(is_told).filter_map(Reason::brief).collect()
    }

    /// Returns the reasons beside those that the headline states in full: the deepest violation of two vehicles, if it
    /// is the only one.
    pub(super) fn reasons_beside_headline(&self) -> Vec<String> {
        let reasons = self.verdict.reasons.iter().map(|reason| match reason {
            Reason::Violation { violations, .. } => others(*violations).trim().to_owned(),
            reason => reason.to_string(),
        });
        reasons.filter(|reason| !reason.is_empty()).collect()
    }

    /// Returns the words that mark a scaled length.
    fn scaled(&self) -> &'static str {
        if self.ellipsoid.is_some() { " scaled to ellipsoids" } else { "" }
    }

    /// Returns how often slots were spread and vehicles were assigned anew; `None` if never.
    pub(super) fn changes(&self) -> Option<String> {
        let counts = [
            (self.deadlock_recoveries.len(), "deadlock recovery", "deadlock recoveries"),
            (self.assignments.len(), "new assignment", "new assignments"),
        ];
        let some = counts.into_iter().filter(|&(n, ..)| n > 0);
        let said: Vec<_> = some.map(|(n, one, many)| counted(n as u64, one, many)).collect();
        (!said.is_empty()).then(|| said.join(" and "))
    }

    /// Returns whether a pair came closer than certified by more than the error of integration.
    #[must_use]
    pub fn breaks_certificate(&self) -> bool {
        let (Some(closest), Some(certified_m)) = (self.closest_pair(), self.certificate.separation_m) else {
            return false;
        };
        // The shield certifies only while its bounds hold.
        let holds = self.shield.as_ref().is_none_or(|shield| shield.exceeded.is_none());
        holds
            && breaks_certificate(closest.separation_m, certified_m, self.delta_m())
            && self.certificate.until_s.is_none_or(|until_s| closest.time_s <= until_s)
    }

    /// Returns why the audit is undecided, and the arrival if the formation was reached.
    fn undecided_in_words(&self) -> String {
        if self.is_clear_until_its_early_end() {
            let at = seconds(self.run.duration_s);
            return format!("the flight ended early at {at}; until then {}", self.clearance([" (", ")"]));
        }
        let (delta, deepest) = (exact(self.delta_m()), self.deepest_in_words());
        let why = if self.disagreements() > 0 {
            format!("the two detectors disagree (delta {delta} m)")
        } else if deepest.is_empty() {
            format!("not everything could be judged (delta {delta} m)")
        } else {
            format!("the step cannot resolve this, as flown {deepest}")
        };
        if self.formation.reached { format!("{why}, {}", self.arrival()) } else { why }
    }

    /// Returns whether the flight ended early and was clear up to its end.
    fn is_clear_until_its_early_end(&self) -> bool {
        (self.answer.status, self.answer.status_so_far) == (Status::Undecided, Status::Clear)
    }

    /// Returns the smallest separation, delta between two brackets, and the distance beyond obstacles.
    fn clearance(&self, [open, close]: [&str; 2]) -> String {
        let delta_m = self.delta_m();
        let closest = self.min_separation_m().map(|min_m| beside_limit(min_m, delta_m, 3));
        let closest = closest.map_or("no two vehicles".to_owned(), |min| format!("never closer than {min} m"));
        let margin = self.closest_obstacle().map_or(String::new(), |found| {
            format!(", {} m beyond every obstacle's clearance", at_least(found.margin(), 3))
        });
        format!("{closest}{}{open}delta {} m{close}{margin}", self.scaled(), exact(delta_m))
    }

    /// Returns the arrival in words.
    fn arrival(&self) -> String {
        let at = self.formation.reached_at_s.map(|at_s| format!(" at {}", seconds(at_s)));
        format!("formation reached{}", at.unwrap_or_default())
    }

    /// Returns the deepest violation of two vehicles and of an obstacle, also those that integration may have caused.
    fn deepest_in_words(&self) -> String {
        let limit = format!("{} (delta {} m)", self.scaled(), exact(self.delta_m()));
        let deepest = self.verdict.reasons.iter().filter_map(|reason| match reason {
            Reason::Violation { deepest, .. }
            | Reason::UnresolvedByStep(deepest)
            | Reason::ObstacleViolation { deepest, .. }
            | Reason::ObstacleUnresolvedByStep(deepest) => Some(came_to(deepest, &limit)),
            _ => None,
        });
        deepest.collect::<Vec<_>>().join("; ")
    }

    /// Returns the findings as a short table, a line each, with a final line break.
    #[must_use]
    pub fn text(&self) -> String {
        let times = self.performance.map(|times| ("performance".to_owned(), times.line()));
        table(self.rows().into_iter().chain(times))
    }

    /// Returns the lines of [`Report::text`] on distances, the audit and the verification.
    #[must_use]
    pub fn brief(&self) -> String {
        let is_brief = |name: &str| matches!(name, "separation" | "obstacles" | "audit" | "verified");
        table(self.rows().into_iter().filter(|(name, _)| is_brief(name)))
    }

    /// Returns the name of each part of the flight and the finding on it, without wall-clock times.
    pub(super) fn rows(&self) -> Vec<(String, String)> {
        let (control, velocity) = (&self.control, &self.velocity);
        let [peak, last] = [control.peak_m_s2, control.final_m_s2].map(or_dash);
        let [disagreement, common] = [velocity.disagreement_m_s, velocity.common_m_s].map(or_dash);
        let failed = (!self.failures.is_empty()).then(|| FailedVehicle::line(&self.failures));
        let first = [
            ("separation", Some(self.separation_line())),
            ("audit", Some(self.audit_line())),
            ("ellipsoids", self.ellipsoid.as_ref().map(Ellipsoid::line)),
            ("obstacles", self.closest_obstacle().map(|found| self.obstacle_line(found))),
            ("network", self.network.as_ref().map(network_line)),
            ("shield", self.shield.as_ref().map(ShieldNumbers::line)),
            ("failed", failed),
            ("vehicle", self.vehicle.as_ref().map(VehicleNumbers::line)),
        ];
        let rest = [
            ("formation", Some(self.formation_line())),
            ("energy", Some(self.energy_line())),
            ("control", Some(format!("peak {peak}, final {last} m/s^2"))),
            ("velocity", Some(format!("final mean {common} m/s, relative to it at most {disagreement} m/s"))),
            ("run", Some(self.run_line())),
            ("verified", self.verification.as_ref().map(Verification::line)),
        ];
        let named = |(name, line): (&str, Option<String>)| Some((name.to_owned(), line?));
        let legs = super::legs::lines(&self.legs);
        first.into_iter().filter_map(named).chain(legs).chain(rest.into_iter().filter_map(named)).collect()
    }

    fn separation_line(&self) -> String {
        let (delta_m, closest) = (self.delta_m(), self.closest_pair());
        let pair = closest.map(|closest| format!(" at {}, {}", seconds(closest.time_s), vehicles(closest.pair)));
        let certified = match self.certificate.separation_m {
            Some(certified_m) => {
                let until = self.certificate.until_s.map(|until_s| format!(" until {}", seconds(until_s)));
                format!("certified {} m{}", beside_limit(certified_m, delta_m, 6), until.unwrap_or_default())
            }
            None => "not certified".to_owned(),
        };
        format!(
            "{} m{}{} (delta {} m, {certified})",
            closest.map_or("-".to_owned(), |closest| beside_limit(closest.separation_m, delta_m, 6)),
            self.scaled(),
            pair.unwrap_or_default(),
            exact(delta_m),
        )
    }

    fn obstacle_line(&self, found: &Finding) -> String {
        let (min_m, clearance_m) = (found.value.upper_bound(), found.limit.unwrap_or_default());
        let near = if min_m < 0.0 { separation(min_m) } else { beside_limit(min_m, clearance_m, 6) };
        let certified = match self.certificate.clearance_margin_m {
            Some(margin_m) => format!("certified {} m beyond it", at_least(margin_m, 6)),
            None => "not certified".to_owned(),
        };
        format!(
            "{near} m at {}, vehicle {} (clearance {} m, {certified})",
            seconds(found.at_s.unwrap_or_default()),
            found.subjects.join(" from obstacle "),
            exact(clearance_m)
        )
    }

    fn audit_line(&self) -> String {
        let detectors = match self.disagreements() {
            0 => "both detectors agree".to_owned(),
            n => format!("{} of the two detectors", counted(n, "disagreement", "disagreements")),
        };
        let swept = self.answer.detectors.map_or(String::new(), |swept| {
            let contacts = swept.rapier_contact_pairs.map(|pairs| match pairs {
                0 => ", no keep-out balls overlap in the engine".to_owned(),
                _ => format!(", keep-out balls of {} overlap in the engine", counted(pairs, "pair", "pairs")),
            });
            format!(
                " in {}, {} swept; {detectors}{}",
                counted(swept.steps.unwrap_or_default(), "step", "steps"),
                counted(swept.pairs_swept, "pair", "pairs"),
                contacts.unwrap_or_default()
            )
        });
        counted(self.answer.violations.count, "violation", "violations") + &swept
    }

    fn formation_line(&self) -> String {
        let formation = &self.formation;
        let reached =
            formation.reached_at_s.map_or("not reached".to_owned(), |at_s| format!("reached at {}", seconds(at_s)));
        format!(
            "{reached}, largest edge error {} m, largest position error {} m",
            or_dash(formation.max_edge_error_m),
            or_dash(formation.max_position_error_m)
        )
    }

    fn energy_line(&self) -> String {
        let energy = &self.energy;
        let ratio = energy.max_over_initial.map(|ratio| match ratio {
            ..1e3 => format!(", at most {ratio:.6} of the initial"),
            _ => format!(", at most {ratio:.1e} of the initial"),
        });
        format!(
            "initial {}, final {} m^2/s^2{}",
            energy.initial.map_or("-".to_owned(), metres),
            energy.at_end.map_or("-".to_owned(), metres),
            ratio.unwrap_or_default()
        )
    }

    fn run_line(&self) -> String {
        let run = &self.run;
        let by_engine = run.engine_steps.filter(|&steps| steps < run.steps);
        let by_engine = by_engine.map_or_else(String::new, |steps| format!(", {steps} steps of the engine"));
        format!(
            "{} vehicles, {} s in {} steps of {:.3} ms{by_engine}, hash of the final state {}",
            run.vehicles,
            // To a microsecond, without trailing zeros.
            (run.duration_s * 1e6).round() / 1e6,
            run.steps,
            run.dt_s * 1e3,
            run.state_hash.get(..12).unwrap_or(&run.state_hash)
        )
    }
}

impl Performance {
    pub(super) fn line(self) -> String {
        let Self { wall_s, real_time_factor, law_s, energy_s, physics_s, airframe_s, audit_s, record_s } = self;
        let airframe = if airframe_s > 0.0 { format!(", {airframe_s:.3} of it airframes") } else { String::new() };
        let factor = real_time_factor.map_or("-".to_owned(), |factor| format!("{factor:.1}"));
        format!(
            "{wall_s:.3} s wall, {factor} x real time (law {law_s:.3}, energy {energy_s:.3}, physics \
             {physics_s:.3}{airframe}, audit {audit_s:.3}, record {record_s:.3} s)"
        )
    }
}

impl Ellipsoid {
    fn line(&self) -> String {
        let axes = self.half_axes_m.map(metres).join(", ");
        let closest = self.min_distance_m.map_or("-".to_owned(), |min_m| at_least(min_m, 6));
        let pair = self.min_distance_pair.map(|[first, second]| format!(", vehicles {first} and {second}"));
        let at = self.min_distance_at_s.map(|at_s| format!(" at {}", seconds(at_s)));
        format!(
            "half axes {axes} m; unscaled, centres never closer than {closest} m{}{}",
            at.unwrap_or_default(),
            pair.unwrap_or_default()
        )
    }
}

impl FailedVehicle {
    /// Lists failed vehicles in one line.
    pub(super) fn line(failed: &[Self]) -> String {
        let one = |failed: &Self| format!("vehicle {} ({}) at {} s", failed.vehicle, failed.kind, failed.at_s);
        failed.iter().map(one).collect::<Vec<_>>().join(", ")
    }
}

impl VehicleNumbers {
    fn line(&self) -> String {
        let Self { model, max_tilt_deg, thrust_share } = self;
        format!(
            "{model}, tilt at most {max_tilt_deg:.1} degrees, rotor thrust at most {:.0} % of the maximum",
            100.0 * thrust_share
        )
    }
}

impl Verification {
    fn line(&self) -> String {
        let found = match (self.firm, self.pass) {
            (true, true) => "firm: at half the step it passes",
            (true, false) => "firm: at half the step it does not pass either",
            (false, true) => "not firm, the outcome depends on the step: at half the step it passes",
            (false, false) => "not firm, the outcome depends on the step: at half the step it does not pass",
        };
        let min_m = self.min_m.map_or("-".to_owned(), |min_m| at_least(min_m, 6));
        let reached =
            self.reached_at_s.map_or("not reached".to_owned(), |at_s| format!("reached at {}", seconds(at_s)));
        format!("{found}, never closer than {min_m} m, formation {reached}")
    }
}

fn network_line(&Traffic { sent, lost, age_p95_s }: &Traffic) -> String {
    let share = 100.0 * lost as f64 / sent.max(1) as f64;
    let age = age_p95_s
        .map_or_else(String::new, |age_s| format!("; 95 % of the states held were no older than {age_s:.3} s"));
    format!("{lost} of {sent} messages lost ({share:.1} %){age}")
}

/// Writes the label of `label: detail` in capitals.
fn capital_label(failure: &str) -> String {
    let (label, detail) = failure.split_at(failure.find(':').unwrap_or(failure.len()));
    label.to_uppercase() + detail
}

/// Formats a number, rounded up as [`up_to`] does.
fn or_dash(number: Option<f64>) -> String {
    number.map_or("-".to_owned(), up_to)
}
