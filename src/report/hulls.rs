//! What solid hulls did, or would have done: from the first time that two hit, what is flown is no longer the law's motion
//! alone.

use serde::{Deserialize, Serialize};

use crate::audit::AuditOutcome;
use crate::swarm::{Bounce, Pair};
use crate::text::{metres, metres_below, seconds};

/// What the hulls did.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hulls {
    /// Every time that two hulls hit, in order of time; null for a plant whose vehicles are points.
    pub bounces: Option<Vec<Bounce>>,
    /// The first two points that came closer than their hulls are wide, and so passed through each other; null where none
    /// did, and for a plant whose hulls are solid.
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
    /// Of solid hulls that hit so.
    #[must_use]
    pub fn solid(bounces: &[Bounce]) -> Self {
        Self { bounces: Some(bounces.to_vec()), passed_through: None }
    }

    /// Of points, with the radius of each hull that they do not have \[m\].
    #[must_use]
    pub fn of_points(audit: &AuditOutcome, hull_radius_m: &[f64]) -> Self {
        let through = audit.violations.iter().filter_map(|found| {
            let touching_m = hull_radius_m[found.pair.first()] + hull_radius_m[found.pair.second()];
            (found.min_m < touching_m).then_some(PassedThrough {
                pair: found.pair,
                min_at_s: found.min_at_s,
                min_m: found.min_m,
                touching_m,
            })
        });
        Self { bounces: None, passed_through: through.min_by(|a, b| a.min_at_s.total_cmp(&b.min_at_s)) }
    }

    /// In a few words, where there is something to say.
    pub(super) fn brief(&self) -> Option<String> {
        if let Some(through) = self.passed_through {
            return Some(format!("vehicles {} passed through each other as points", through.pair));
        }
        let bounces = self.bounces.as_deref().unwrap_or_default();
        let &Bounce { pair, time_s, closing_m_s } = bounces.first()?;
        let first = format!("vehicles {pair} at {} with {} m/s", seconds(time_s), metres(closing_m_s));
        Some(match bounces.len() {
            1 => format!("hulls hit once: {first}"),
            times => format!("hulls hit {times} times, first {first}"),
        })
    }

    /// In a sentence that says what it means for the flight.
    pub(super) fn reason(&self) -> Option<String> {
        if let Some(PassedThrough { pair, min_at_s, min_m, touching_m }) = self.passed_through {
            return Some(format!(
                "Vehicles {pair} passed through each other: their hulls touch at {} m, and they came to {} m at {}. The \
                 ideal plant's vehicles are points; from then on solid ones fly otherwise.",
                metres(touching_m),
                metres_below(min_m, touching_m),
                seconds(min_at_s)
            ));
        }
        let brief = self.brief()?;
        let (first, rest) = brief.split_at(1);
        Some(format!(
            "{}{rest}. What was flown from then on is a bounce of the engine's, and not the law's motion; points, such as \
             the ideal plant's, fly otherwise.",
            first.to_uppercase()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::audit::{Auditor, Violation};
    use crate::swarm::Rows;

    fn of_points(distances_m: &[f64]) -> Hulls {
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
        Hulls::of_points(&audit, &[0.25, 0.5])
    }

    #[test]
    fn points_pass_through_each_other_where_they_are_nearer_than_their_hulls_are_wide() {
        assert_eq!(of_points(&[]), Hulls::default());
        assert_eq!(of_points(&[0.75]).passed_through, None, "they touch");
        let through = of_points(&[1.0, 0.7, 0.1]);
        assert_eq!(through.passed_through.map(|first| (first.min_at_s, first.touching_m)), Some((1.25, 0.75)));
        let reason = through.reason().expect("a reason");
        assert!(reason.starts_with("Vehicles 1-2 passed through each other: their hulls touch at 0.750 m"), "{reason}");
    }

    #[test]
    fn solid_hulls_say_how_often_they_hit_and_who_was_first() {
        let first = Bounce { pair: Pair::new(1, 2), time_s: 3.625, closing_m_s: 1.25 };
        assert_eq!(Hulls::solid(&[]).brief(), None);
        assert_eq!(Hulls::solid(&[]).reason(), None);
        assert_eq!(
            Hulls::solid(&[first]).brief().as_deref(),
            Some("hulls hit once: vehicles 2-3 at 3.62 s with 1.250 m/s")
        );
        let reason = Hulls::solid(&[first, first]).reason().expect("a reason");
        assert!(reason.starts_with("Hulls hit 2 times, first vehicles 2-3 at 3.62 s with 1.250 m/s. What"), "{reason}");
    }
}
