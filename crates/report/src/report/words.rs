//! Report of a flight in words: a verdict line and a table.

use super::flight::{Ellipsoid, FailedVehicle, Performance, Report, VehicleNumbers, Verification};
use super::obstacles::Obstacles;
use super::shield::ShieldNumbers;
use super::verdict::{UnmetCriterion, breaks_certificate, is_unresolved_by_step};
use tautline_audit::Status;
use tautline_core::text::{at_least, below_bound, beside_limit, counted, exact, metres, seconds, table};
use tautline_sim::link::Traffic;

impl Report {
    /// Returns the verdict in one line. It begins with `CLEAR` only if the flight passes, otherwise with what failed:
    ///
    /// - `CLEAR: never closer than 2.460 m (delta 2.000 m), formation reached at 36.42 s`
    /// - `VIOLATION: vehicles 2 and 3 came to 1.532 m (delta 2.000 m) at 3.63 s`
    /// - `NOT REACHED: largest edge error 0.838 m, at rest elsewhere (clear: never closer than 2.660 m, delta 2.000 m)`
    /// - `UNDECIDED: the flight ended early at 3.20 s; until then never closer than 2.435 m (delta 2.000 m)`
    #[must_use]
    pub fn headline(&self) -> String {
        let (failures, is_clear) = (self.failures(), self.audit.status == Status::Clear);
        let findings = match self.audit.status {
            Status::Clear if self.verdict.pass => {
                vec![format!("CLEAR: {}, {}", self.clearance([" (", ")"]), self.arrival())]
            }
            Status::Clear => match failures.split_first() {
                Some((first, rest)) => [&[capital_label(first)], rest].concat(),
                None => vec![format!("NOT PASSED: {}", self.verdict.reasons.join(" ").trim_end_matches('.'))],
            },
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

    /// Returns the failures beside the status of the audit, as `label: detail`, in the order of the reasons of the
    /// verdict.
    fn failures(&self) -> Vec<String> {
        let has_no_violation = self.audit.status != Status::Violation;
        let codes = &self.verdict.refused;
        let refused = (!codes.is_empty()).then(|| format!("refused by check: {}", codes.join(", ")));
        let broken =
            self.separation.certified_m.filter(|_| has_no_violation && self.breaks_certificate()).map(|certified_m| {
                let closest = self.separation.closest().map(|closest| {
                    let [first, second] = closest.pair.numbers();
                    let [min, certified] = below_bound(closest.separation_m, certified_m);
                    let at = seconds(closest.time_s);
                    format!("vehicles {first} and {second} came to {min} m at {at}, certified {certified} m")
                });
                format!("certificate broken: {}", closest.unwrap_or_default())
            });
        let past_obstacles =
            self.obstacles.as_ref().filter(|_| has_no_violation).and_then(Obstacles::broken_certificate);
        let past_obstacles = past_obstacles.map(|broken| format!("certificate broken: {broken}"));
        let overlong = self.run.overlong_steps;
        let overlong = (overlong > 0)
            .then(|| format!("step too long: {} longer than the law allows", counted(overlong, "step", "steps")));
        let rose = self.energy.rose.then(|| match self.energy.max_over_leg_start {
            Some(ratio) => format!("energy rose: to {ratio:.3} of its start"),
            None => "energy rose: it is proved never to grow".to_owned(),
        });
        let is_in_lead = self.is_clear_until_its_early_end();
        let ended = (self.run.ended_early.is_some() && !is_in_lead)
            .then(|| format!("the flight ended early at {}", seconds(self.run.duration_s)));
        [
            refused,
            past_obstacles,
            self.hulls.brief(),
            self.shield.as_ref().and_then(ShieldNumbers::brief),
            broken,
            overlong,
            rose.filter(|_| has_no_violation),
            ended,
            self.missing().filter(|_| has_no_violation),
            super::legs::missed(&self.legs).filter(|_| has_no_violation && self.formation.reached),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// Returns the words that mark a scaled length.
    fn scaled(&self) -> &'static str {
        if self.separation.ellipsoid.is_some() { " scaled to ellipsoids" } else { "" }
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
        let both = self.separation.min_m.zip(self.separation.certified_m);
        let breaks = |(min_m, certified_m)| breaks_certificate(min_m, certified_m, self.separation.delta_m);
        // The shield certifies only while its bounds hold.
        let holds = self.shield.as_ref().is_none_or(|shield| shield.exceeded.is_none());
        holds && both.is_some_and(breaks) && self.separation.is_promised()
    }

    /// Returns why the audit is undecided, and the arrival if the formation was reached.
    fn undecided_in_words(&self) -> String {
        if self.is_clear_until_its_early_end() {
            let at = seconds(self.run.duration_s);
            return format!("the flight ended early at {at}; until then {}", self.clearance([" (", ")"]));
        }
        let delta = exact(self.separation.delta_m);
        let why = if self.audit.parry.disagreements > 0 {
            format!("the two detectors disagree (delta {delta} m)")
        } else if self.is_unresolved_by_step() {
            format!("the step cannot resolve this, as flown {}", self.deepest_in_words())
        } else {
            format!("not everything could be judged (delta {delta} m)")
        };
        if self.formation.reached { format!("{why}, {}", self.arrival()) } else { why }
    }

    /// Returns whether the flight ended early and was clear up to its end.
    pub(super) fn is_clear_until_its_early_end(&self) -> bool {
        let audit = &self.audit;
        let of_obstacles = self.obstacles.as_ref().map_or(0, |of| of.undecided + of.disagreements);
        let is_open = audit.undecided + audit.parry.disagreements + of_obstacles > 0;
        let is_judged = self.run.vehicles < 2 || self.separation.min_m.is_some();
        self.run.ended_early.is_some()
            && audit.status == Status::Undecided
            && is_judged
            && !is_open
            && !self.is_unresolved_by_step()
    }

    /// Returns the smallest separation, delta between two brackets, and the distance beyond obstacles.
    fn clearance(&self, [open, close]: [&str; 2]) -> String {
        let delta_m = self.separation.delta_m;
        let closest = self.separation.min_m.map(|min_m| beside_limit(min_m, delta_m, 3));
        let closest = closest.map_or("no two vehicles".to_owned(), |min| format!("never closer than {min} m"));
        let room = self.obstacles.as_ref().and_then(Obstacles::room);
        let room = room.map(|room| format!(", {room}")).unwrap_or_default();
        format!("{closest}{}{open}delta {} m{close}{room}", self.scaled(), exact(delta_m))
    }

    /// Returns whether integration may have caused all violations.
    fn is_unresolved_by_step(&self) -> bool {
        let past_obstacles = self.obstacles.as_ref().map_or(0, |obstacles| obstacles.violations.len());
        let violations = self.audit.violations.len() + past_obstacles;
        is_unresolved_by_step(self.audit.status, self.run.overlong_steps, violations)
    }

    /// Returns the arrival in words.
    fn arrival(&self) -> String {
        let at = self.formation.reached_at_s.map(|at_s| format!(" at {}", seconds(at_s)));
        format!("formation reached{}", at.unwrap_or_default())
    }

    /// Returns the criterion that keeps the formation from being reached, as `not reached: detail`. If the formation
    /// had been reached before an early end, the failure is the early end alone.
    fn missing(&self) -> Option<String> {
        let formation = &self.formation;
        let (what, number, unit) = match formation.fails? {
            UnmetCriterion::EndedEarly => return None,
            UnmetCriterion::Unknown => return Some("not reached: no state at the end is known".to_owned()),
            UnmetCriterion::HeldS => {
                let held_s = formation.held_s.unwrap_or_default();
                return Some(format!("not reached: kept for the last {} only", seconds(held_s)));
            }
            UnmetCriterion::MaxEdgeErrorM => ("largest edge error", formation.max_edge_error_m, "m"),
            UnmetCriterion::MaxPositionErrorM => {
                ("another shape or place, largest position error", formation.max_position_error_m, "m")
            }
            UnmetCriterion::Disagreement => ("largest relative speed", self.velocity.disagreement_m_s, "m/s"),
        };
        let then = match formation.at_rest {
            Some(true) => ", at rest elsewhere",
            Some(false) => ", still moving",
            None => "",
        };
        Some(format!("not reached: {what} {} {unit}{then}", or_dash(number)))
    }

    fn deepest_in_words(&self) -> String {
        let of_obstacles = self.obstacles.as_ref().and_then(Obstacles::brief);
        if let Some(of_obstacles) = of_obstacles {
            let is_alone = self.audit.violations.is_empty();
            return if is_alone { of_obstacles } else { format!("{}; {of_obstacles}", self.deepest_pair_in_words()) };
        }
        self.deepest_pair_in_words()
    }

    fn deepest_pair_in_words(&self) -> String {
        let Self { separation, .. } = self;
        let delta_m = separation.delta_m;
        let (Some([first, second]), Some(min_m)) = (separation.min_pair, separation.min_m) else {
            return format!("two vehicles came closer than {} m", exact(delta_m));
        };
        let at = separation.min_at_s.map(|at_s| format!(" at {}", seconds(at_s))).unwrap_or_default();
        format!(
            "vehicles {first} and {second} came to {} m{} (delta {} m){at}",
            beside_limit(min_m, delta_m, 3),
            self.scaled(),
            exact(delta_m)
        )
    }

    /// Returns the findings as a short table, a line each, with a final line break.
    #[must_use]
    pub fn text(&self) -> String {
        let times = self.performance.map(|times| ("performance".to_owned(), times.line()));
        table(self.rows().into_iter().chain(times))
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
            ("ellipsoids", self.separation.ellipsoid.as_ref().map(Ellipsoid::line)),
            ("obstacles", self.obstacles.as_ref().map(Obstacles::line)),
            ("network", self.network.as_ref().map(network_line)),
            ("shield", self.shield.as_ref().map(ShieldNumbers::line)),
            ("failed", failed),
            ("vehicle", self.vehicle.as_ref().map(VehicleNumbers::line)),
        ];
        let rest = [
            ("formation", Some(self.formation_line())),
            ("energy", Some(self.energy_line())),
            ("control", Some(format!("peak {peak}, final {last} m/s^2"))),
            ("velocity", Some(format!("disagreement {disagreement}, common {common} m/s"))),
            ("run", Some(self.run_line())),
            ("verified", self.verification.as_ref().map(Verification::line)),
        ];
        let named = |(name, line): (&str, Option<String>)| Some((name.to_owned(), line?));
        let legs = super::legs::lines(&self.legs);
        first.into_iter().filter_map(named).chain(legs).chain(rest.into_iter().filter_map(named)).collect()
    }

    fn separation_line(&self) -> String {
        let separation = &self.separation;
        let delta_m = separation.delta_m;
        let pair = separation.min_pair.map(|[first, second]| format!(", vehicles {first} and {second}"));
        let at = separation.min_at_s.map(|at_s| format!(" at {}", seconds(at_s)));
        let certified = match separation.certified_m {
            Some(certified_m) => {
                let until = separation.certified_until_s.map(|until_s| format!(" until {}", seconds(until_s)));
                format!("certified {} m{}", beside_limit(certified_m, delta_m, 6), until.unwrap_or_default())
            }
            None => "not certified".to_owned(),
        };
        format!(
            "{} m{}{}{} (delta {} m, {certified})",
            separation.min_m.map_or("-".to_owned(), |min_m| beside_limit(min_m, delta_m, 6)),
            self.scaled(),
            at.unwrap_or_default(),
            pair.unwrap_or_default(),
            exact(delta_m),
        )
    }

    fn audit_line(&self) -> String {
        let audit = &self.audit;
        let detectors = match audit.parry.disagreements {
            0 => "both detectors agree".to_owned(),
            n => format!("{} of the two detectors", counted(n, "disagreement", "disagreements")),
        };
        let contacts = audit
            .rapier
            .contact_pairs
            .map(|pairs| counted(pairs, "contact pair of keep-out shells", "contact pairs of keep-out shells"))
            .map(|pairs| format!(", {pairs} seen by the engine"));
        format!(
            "{} in {}, {} swept; {detectors}{}",
            counted(audit.violations.len() as u64, "violation", "violations"),
            counted(audit.steps, "step", "steps"),
            counted(audit.pairs_checked, "pair", "pairs"),
            contacts.unwrap_or_default()
        )
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
            or_dash(energy.initial),
            or_dash(energy.at_end),
            ratio.unwrap_or_default()
        )
    }

    fn run_line(&self) -> String {
        let run = &self.run;
        format!(
            "{} vehicles, {} s in {} steps of {:.3} ms, state {}",
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
            (true, false) => "DOES NOT PASS at half the step either (firm)",
            (false, true) => "NOT FIRM, the outcome depends on the step: at half the step it passes",
            (false, false) => "NOT FIRM, the outcome depends on the step: at half the step it does not pass",
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

fn or_dash(number: Option<f64>) -> String {
    number.map_or("-".to_owned(), metres)
}
