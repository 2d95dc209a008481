//! What solid hulls did, or would have done: from the first time that two hit, what is flown is no longer the law's motion
//! alone.

use serde::{Deserialize, Serialize};

use super::flight::FlightResult;
use tautline_audit::AuditOutcome;
use tautline_core::swarm::{Bounce, Pair};
use tautline_core::text::{metres, metres_below, seconds};

/// What the hulls did.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hulls {
    /// Every time that two hulls hit, in order of time; null for a plant whose vehicles are points.
    pub bounces: Option<Vec<Bounce>>,
    /// The first two that came closer than their hulls are wide and did not hit: points, or hulls so fast that a step leapt
    /// over the hit. Null where none did.
    pub passed_through: Option<PassedThrough>,
}

/// Two points whose hulls would have hit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PassedThrough {
    /// Which.
    pub pair: Pair,
    /// When they were nearest \[s\].
    pub min_at_s: f64,
    /// How near that was \[m\].
    pub min_m: f64,
    /// Sum of the two radii \[m\].
    pub touching_m: f64,
}

impl Hulls {
    /// The hulls of a flight: solid in the engine, else those that points do not have.
    pub(super) fn of(result: &FlightResult<'_>) -> Self {
        let FlightResult { scenario, flight, .. } = *result;
        let audit = flight.in_metres.as_ref().unwrap_or(&flight.audit);
        let bounces = scenario.has_engine().then(|| flight.bounces.clone());
        Self::new(bounces, audit, &scenario.hull_radius_m, scenario.time.dt_s)
    }

    /// Hulls of these radii \[m\] with their hits in steps of `dt_s`, or of points without hits. The first pair that came closer
    /// than its hulls are wide in a violation without a hit passed through each other.
    fn new(bounces: Option<Vec<Bounce>>, audit: &AuditOutcome, hull_radius_m: &[f64], dt_s: f64) -> Self {
        let through = audit.violations.iter().filter_map(|found| {
            let touching_m = hull_radius_m[found.pair.first()] + hull_radius_m[found.pair.second()];
            let (pair, min_at_s, min_m) = (found.pair, found.min_at_s, found.min_m);
            let is_hit = bounces.iter().flatten().any(|bounce| {
                bounce.pair == pair && (found.from_s - dt_s..=found.to_s + dt_s).contains(&bounce.time_s)
            });
            (min_m < touching_m && !is_hit).then_some(PassedThrough { pair, min_at_s, min_m, touching_m })
        });
        let passed_through = through.min_by(|a, b| a.min_at_s.total_cmp(&b.min_at_s));
        Self { bounces, passed_through }
    }

    /// In a few words, where there is something to say.
    pub(super) fn brief(&self) -> Option<String> {
        let through = self.passed_through.map(|through| {
            let how = if self.bounces.is_none() { "as points" } else { "in one step" };
            format!("passed through each other: {}, {how}", vehicles(through.pair))
        });
        let hits = self.hits();
        through.into_iter().chain(hits).reduce(|all, next| all + "; " + &next)
    }

    fn hits(&self) -> Option<String> {
        let bounces = self.bounces.as_deref().unwrap_or_default();
        let &Bounce { pair, time_s, closing_m_s } = bounces.first()?;
        let first = format!("{} at {} with {} m/s", vehicles(pair), seconds(time_s), metres(closing_m_s));
        Some(match bounces.len() {
            1 => format!("hulls hit once: {first}"),
            times => format!("hulls hit {times} times: first {first}"),
        })
    }

    /// In a sentence that says what it means for the flight.
    pub(super) fn reason(&self) -> Option<String> {
        let through = self.passed_through.map(|PassedThrough { pair, min_at_s, min_m, touching_m }| {
            let [first, second] = pair.numbers();
            let why = match self.bounces {
                None => "The ideal plant's vehicles are points",
                Some(_) => "A step leapt over the hit: shorten time.dt_s",
            };
            format!(
                "Vehicles {first} and {second} passed through each other: their hulls touch at {} m, and they came to {} m at {}. {why}; from \
                 then on solid ones fly otherwise.",
                metres(touching_m),
                metres_below(min_m, touching_m),
                seconds(min_at_s)
            )
        });
        let hits = self.hits().map(|hits| {
            let (first, rest) = hits.split_at(1);
            format!(
                "{}{rest}. What was flown from then on is a bounce of the engine's, and not the law's motion; points, such as \
                 the ideal plant's, fly otherwise.",
                first.to_uppercase()
            )
        });
        through.into_iter().chain(hits).reduce(|all, next| all + " " + &next)
    }
}

/// The vehicles of a pair in words, such as `vehicles 2 and 3`.
pub(super) fn vehicles(pair: Pair) -> String {
    let [first, second] = pair.numbers();
    format!("vehicles {first} and {second}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_audit::{Auditor, Violation};
    use tautline_core::swarm::Rows;

    /// An audit that found these violations.
    fn audit(distances_m: &[f64]) -> AuditOutcome {
        let mut auditor = Auditor::new(2, 2.0).expect("a judge");
        auditor.start(0.0, &Rows::from_row_slice(&[0.0, 0.0, 0.0, 9.0, 0.0, 0.0])).expect("judged");
        let mut audit = auditor.finish();
        let violation = |(k, &min_m): (usize, &f64)| Violation {
            pair: Pair::new(0, 1),
            from_s: k as f64,
            to_s: k as f64 + 0.5,
            min_m,
            min_at_s: k as f64 + 0.25,
            limit_m: 2.0,
        };
        audit.violations = distances_m.iter().enumerate().map(violation).collect();
        audit
    }

    fn of_points(distances_m: &[f64]) -> Hulls {
        Hulls::new(None, &audit(distances_m), &[0.25, 0.5], 0.004)
    }

    #[test]
    fn points_pass_through_each_other_where_they_are_nearer_than_their_hulls_are_wide() {
        assert_eq!(of_points(&[]), Hulls::default());
        assert_eq!(of_points(&[0.75]).passed_through, None, "they touch");
        let through = of_points(&[1.0, 0.7, 0.1]);
        assert_eq!(through.passed_through.map(|first| (first.min_at_s, first.touching_m)), Some((1.25, 0.75)));
        let reason = through.reason().expect("a reason");
        assert!(
            reason.starts_with("Vehicles 1 and 2 passed through each other: their hulls touch at 0.750 m"),
            "{reason}"
        );
    }

    #[test]
    fn solid_hulls_say_how_often_they_hit_and_who_was_first() {
        let first = Bounce { pair: Pair::new(1, 2), time_s: 3.625, closing_m_s: 1.25 };
        let solid = |bounces: &[Bounce]| Hulls { bounces: Some(bounces.to_vec()), passed_through: None };
        assert_eq!(solid(&[]).brief(), None);
        assert_eq!(solid(&[]).reason(), None);
        assert_eq!(
            solid(&[first]).brief().as_deref(),
            Some("hulls hit once: vehicles 2 and 3 at 3.62 s with 1.250 m/s")
        );
        let reason = solid(&[first, first]).reason().expect("a reason");
        assert!(
            reason.starts_with("Hulls hit 2 times: first vehicles 2 and 3 at 3.62 s with 1.250 m/s. What"),
            "{reason}"
        );
    }

    #[test]
    fn solid_hulls_that_a_step_leapt_over_are_not_said_to_have_missed() {
        let points = audit(&[0.1]);
        let leapt = Hulls::new(Some(Vec::new()), &points, &[0.25, 0.5], 0.004);
        assert_eq!(leapt.brief().as_deref(), Some("passed through each other: vehicles 1 and 2, in one step"));
        assert!(leapt.reason().is_some_and(|reason| reason.contains("A step leapt over the hit: shorten time.dt_s")));
        // They hit in that violation, or another pair did.
        let hit = |pair, time_s| [Bounce { pair, time_s, closing_m_s: 1.0 }];
        let of = |bounces: &[Bounce]| Hulls::new(Some(bounces.to_vec()), &points, &[0.25, 0.5], 0.004).passed_through;
        assert_eq!(of(&hit(Pair::new(0, 1), 0.2)), None);
        assert!(of(&hit(Pair::new(0, 2), 0.2)).is_some() && of(&hit(Pair::new(0, 1), 2.0)).is_some());
    }
}
