//! Collisions of hulls. After the first collision the motion is not governed by the law alone.

use serde::Serialize;

use super::flight::FlightResult;
use tautline_audit::AuditOutcome;
use tautline_core::swarm::{Bounce, Pair};

/// Collisions of solid hulls, or the pair of points whose hulls would have collided.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Hulls {
    /// All collisions in order of time; null for a plant whose vehicles are points.
    pub bounces: Option<Vec<Bounce>>,
    /// The first pair that came closer than the sum of its hull radii without a collision: points, or hulls so fast
    /// that a step skipped the collision.
    pub passed_through: Option<PassedThrough>,
}

/// A pair that came closer than the sum of its hull radii without a collision.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PassedThrough {
    /// The two vehicles.
    pub pair: Pair,
    /// Time of `min_m` \[s\].
    pub min_at_s: f64,
    /// Smallest separation \[m\].
    pub min_m: f64,
    /// Sum of the two hull radii \[m\].
    pub touching_m: f64,
}

impl Hulls {
    /// Returns the collisions of a flight. A plant without an engine has point vehicles, which cannot collide.
    pub(super) fn of(result: &FlightResult<'_>) -> Self {
        let FlightResult { scenario, flight, .. } = *result;
        let audit = flight.in_metres.as_ref().unwrap_or(&flight.audit);
        let bounces = scenario.has_engine().then(|| flight.bounces.clone());
        Self::new(bounces, audit, &scenario.hull_radius_m, scenario.time.dt_s)
    }

    /// Returns the collisions `bounces` (`None`: point vehicles) of hulls of the radii `hull_radius_m` \[m\], flown in
    /// steps of `dt_s`. A pair passed through if it came below the sum of its radii in a violation without a collision.
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
}

/// Names the vehicles of a pair in words, such as `vehicles 2 and 3`.
pub(super) fn vehicles(pair: Pair) -> String {
    let [first, second] = pair.numbers();
    format!("vehicles {first} and {second}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_audit::{Auditor, Violation};
    use tautline_core::swarm::Rows;

    /// Returns an audit with violations of these smallest separations \[m\].
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
    fn points_pass_through_below_the_sum_of_their_hull_radii() {
        assert_eq!(of_points(&[]), Hulls::default());
        assert_eq!(of_points(&[0.75]).passed_through, None, "they touch");
        let through = of_points(&[1.0, 0.7, 0.1]);
        assert_eq!(through.passed_through.map(|first| (first.min_at_s, first.touching_m)), Some((1.25, 0.75)));
    }

    #[test]
    fn solid_hulls_can_pass_through_within_one_step() {
        let points = audit(&[0.1]);
        let leapt = Hulls::new(Some(Vec::new()), &points, &[0.25, 0.5], 0.004);
        assert!(leapt.passed_through.is_some());
        // A collision of the same pair in that violation clears it; one of another pair or time does not.
        let hit = |pair, time_s| [Bounce { pair, time_s, closing_m_s: 1.0 }];
        let of = |bounces: &[Bounce]| Hulls::new(Some(bounces.to_vec()), &points, &[0.25, 0.5], 0.004).passed_through;
        assert_eq!(of(&hit(Pair::new(0, 1), 0.2)), None);
        assert!(of(&hit(Pair::new(0, 2), 0.2)).is_some() && of(&hit(Pair::new(0, 1), 2.0)).is_some());
    }
}
