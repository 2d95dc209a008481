//! Findings on a recording that its replay jumps to.

use super::report::RecordedReport;
use super::report::{PairFinding, VehicleFinding};
use super::well_clear::WellClearFindings;
use super::words::interval;
use crate::replay::{JudgementContext, Kind, LONGEST_NAME, Moment, Span, cut};
use tautline_audit::envelope::Exceedance;
use tautline_audit::recorded::{Approach, Gap, ObjectPair, WellClearLoss};
use tautline_audit::{Undecided, Violation};

impl RecordedReport {
    /// Returns the closest approach, the violations, the undecided times and the gaps, the gravest first. Distances and
    /// times are those of the audit.
    #[must_use]
    pub fn moments(&self) -> Vec<Moment> {
        let over = |of: &Violation<ObjectPair>| of.min_m - of.limit_m;
        let mut violations: Vec<_> = self.violations.iter().map(PairFinding::short).collect();
        violations.sort_by(|a, b| over(&a.finding).total_cmp(&over(&b.finding)));
        let closest = self.closest.first().or(self.closest_to_obstacles.first());
        let unit = self.judgement().unit;
        let closest = closest.map(PairFinding::short).map(|of| {
            let &Approach { pair, lower_m, upper_m, time_s, limit_m } = &of.finding;
            let distance = format!("{} {unit}", interval(lower_m, upper_m, limit_m));
            Moment::closest(pair, &of.names(), &distance, time_s)
        });
        let violations = violations.iter().map(|of| Moment::violation(&of.finding, &of.names(), unit));
        let undecided = self.undecided.iter().map(|of| undecided(&of.short()));
        let gaps = self.gaps.iter().map(|of| unseen(&of.short()));
        let of_limits = self.moments_of_limits().into_iter().chain(self.moments_of_well_clear());
        let (beyond, open): (Vec<_>, Vec<_>) = of_limits.partition(|of| of.kind == Kind::Violation);
        closest.into_iter().chain(violations).chain(beyond).chain(undecided).chain(open).chain(gaps).collect()
    }

    /// Returns the limit of separations, and whether the audit decided everything else.
    #[must_use]
    pub fn judgement(&self) -> JudgementContext {
        JudgementContext { is_else_known: self.is_else_known, limit: self.question.delta, unit: self.unit() }
    }

    fn moments_of_limits(&self) -> Vec<Moment> {
        let of_limit = |limit: &super::envelope::LimitFindings| {
            let named = |kind: Kind| {
                move |of: &VehicleFinding<Exceedance>| {
                    let (of, Exceedance { vehicle, from_s, to_s, at_s, .. }) = (of.short(), of.finding);
                    let (brief, said) = (limit.in_short(&of), limit.in_words(&of, kind == Kind::Violation));
                    Moment {
                        kind,
                        vehicles: vec![vehicle],
                        obstacle: None,
                        span: Span { from_s, to_s, at_s },
                        brief,
                        said,
                    }
                }
            };
            let violations = limit.violations.iter().map(named(Kind::Violation));
            violations.chain(limit.undecided.iter().map(named(Kind::Undecided))).collect::<Vec<_>>()
        };
        self.limits.iter().flat_map(of_limit).collect()
    }

    fn moments_of_well_clear(&self) -> Vec<Moment> {
        let Some(found) = &self.well_clear else { return Vec::new() };
        let short = |of: &[PairFinding<WellClearLoss>]| of.iter().map(PairFinding::short).collect::<Vec<_>>();
        let found = WellClearFindings {
            violations: short(&found.violations),
            undecided: short(&found.undecided),
            ..found.clone()
        };
        let moment = |kind: Kind, of: &PairFinding<WellClearLoss>, said: &str| {
            let WellClearLoss { pair, from_s, to_s, .. } = of.finding;
            let span = Span { from_s, to_s, at_s: f64::midpoint(from_s, to_s) };
            let (how, verdict) = match kind {
                Kind::Violation => ("are not", "Violation"),
                _ => ("may not be", "Undecided"),
            };
            let brief = format!("{} {how} well clear", of.names());
            Moment::new(kind, ObjectPair::Vehicles(pair), span, brief, format!("{verdict}: {said}"))
        };
        let losses = found.violations.iter().zip(found.violations_in_words());
        let open = found.undecided.iter().zip(found.undecided_in_words());
        let losses = losses.map(|(of, said)| moment(Kind::Violation, of, &said));
        losses.chain(open.map(|(of, said)| moment(Kind::Undecided, of, &said))).collect()
    }
}

fn undecided(of: &PairFinding<Undecided<ObjectPair>>) -> Moment {
    let Undecided { pair, from_s, to_s, .. } = of.finding;
    let span = Span { from_s, to_s, at_s: f64::midpoint(from_s, to_s) };
    let brief = format!("{} may come too close", of.names());
    Moment::new(Kind::Undecided, pair, span, brief, format!("Undecided: {}", of.words()))
}

fn unseen(of: &VehicleFinding<Gap>) -> Moment {
    let Gap { vehicle, from_s, to_s, .. } = of.finding;
    let span = Span { from_s, to_s, at_s: f64::midpoint(from_s, to_s) };
    let (brief, said) = (format!("{} is not seen", of.vehicle), format!("Undecided: {}", of.words()));
    Moment { kind: Kind::Unseen, vehicles: vec![vehicle], obstacle: None, span, brief, said }
}

impl<T> PairFinding<T> {
    /// Returns the names of both vehicles, or of vehicle and obstacle.
    pub(super) fn names(&self) -> String {
        let [first, second] = &self.who;
        format!("{first} and {second}")
    }
}

impl<T: Clone> PairFinding<T> {
    /// Returns the finding with names cut to the length that a replay shows.
    fn short(&self) -> Self {
        Self { who: self.who.each_ref().map(|name| cut(name, LONGEST_NAME)), finding: self.finding.clone() }
    }
}

impl<T: Clone> VehicleFinding<T> {
    fn short(&self) -> Self {
        Self { vehicle: cut(&self.vehicle, LONGEST_NAME), finding: self.finding.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::Pair;
    use tautline_core::text::in_order;

    #[test]
    fn long_names_are_cut_and_direction_controls_are_replaced() {
        let pair = ObjectPair::Vehicles(Pair::new(0, 1));
        let finding = Violation { pair, from_s: 1.0, to_s: 2.0, min_m: 0.25, min_at_s: 1.5, limit_m: 1.0 };
        let of = PairFinding { who: ["ü".repeat(5000), "drone \u{202e}b".to_owned()], finding };
        let said = in_order(&Moment::violation(&finding, &of.short().names(), "m").said);
        let expected =
            "… and drone \u{fffd}b came to 0.250 m (limit 1.000) at 1.500 s, below it from 1.000 s to 2.000 s";
        assert!(said.ends_with(expected) && said.chars().count() < 150, "{said}");
    }
}
