//! What a replay of a recording jumps to.

use super::named::OfPair;
use super::report::RecordedReport;
use super::words::interval;
use crate::audit::envelope::Exceeding;
use crate::audit::recorded::{Approach, ObjectPair};
use crate::audit::{Undecided, Violation};
use crate::replay::{Judged, Kind, Moment, Span};

impl RecordedReport {
    /// The closest approach, every violation and every time that cannot be decided, the weightiest first, with the judge's
    /// distances and times; behind them those of single vehicles.
    #[must_use]
    pub fn moments(&self) -> Vec<Moment> {
        let over = |of: &Violation<ObjectPair>| of.min_m - of.limit_m;
        let mut violations: Vec<_> = self.violations.iter().collect();
        violations.sort_by(|a, b| over(&a.finding).total_cmp(&over(&b.finding)));
        let closest = self.closest.first().into_iter().map(|of| self.closest_moment(of));
        let violations = violations.into_iter().map(|of: &OfPair<Violation<ObjectPair>>| {
            let Violation { pair, from_s, to_s, min_at_s, .. } = of.finding;
            moment(Kind::Violation, pair, Span { from_s, to_s, at_s: min_at_s }, format!("Violation: {}", of.words()))
        });
        let undecided = self.undecided.iter().map(|of: &OfPair<Undecided<ObjectPair>>| {
            let Undecided { pair, from_s, to_s, .. } = of.finding;
            let span = Span { from_s, to_s, at_s: f64::midpoint(from_s, to_s) };
            moment(Kind::Undecided, pair, span, format!("Undecided: {}", of.words()))
        });
        let limits = self.limits.iter().flat_map(|limit| {
            let violations = limit.violations.iter().zip(limit.violations_in_words()).map(|of| (Kind::Violation, of));
            let undecided = limit.undecided.iter().zip(limit.undecided_in_words()).map(|of| (Kind::Undecided, of));
            violations.chain(undecided).map(|(kind, (of, said))| {
                let Exceeding { vehicle, from_s, to_s, at_s, .. } = of.finding;
                Moment { kind, vehicles: vec![vehicle], obstacle: None, span: Span { from_s, to_s, at_s }, said }
            })
        });
        closest.chain(violations).chain(undecided).chain(limits).collect()
    }

    /// The verdict, and what distances of two vehicles are held against.
    #[must_use]
    pub fn judgement(&self) -> Judged {
        let unit = if self.measure == "metres" { "m" } else { "ellipsoids" };
        Judged { status: self.status, limit: self.separation.delta_m, unit }
    }

    fn closest_moment(&self, OfPair { who: [first, second], finding }: &OfPair<Approach>) -> Moment {
        let &Approach { pair, lower_m, upper_m, time_s, .. } = finding;
        let (apart, unit) = (interval(lower_m, upper_m), self.judgement().unit);
        let said = format!("Closest approach: {apart} {unit}, {first} and {second} at {time_s:.3} s");
        moment(Kind::Closest, pair, Span { from_s: time_s, to_s: time_s, at_s: time_s }, said)
    }
}

fn moment(kind: Kind, pair: ObjectPair, span: Span, said: String) -> Moment {
    let (vehicles, obstacle) = match pair {
        ObjectPair::Vehicles(pair) => (vec![pair.first(), pair.second()], None),
        ObjectPair::Obstacle { vehicle, obstacle } => (vec![vehicle], Some(obstacle)),
    };
    Moment { kind, vehicles, obstacle, span, said }
}
