//! What a replay of a flight jumps to.

use super::flight::{Report, Violation};
use super::obstacles::{ObstacleApproach, ObstacleViolation};
use crate::replay::{Judged, Kind, LONGEST_NAME, Moment, Span, cut};
use tautline_audit::Status;
use tautline_core::swarm::ClosestApproach;
use tautline_core::text::{at_least, exact, metres_below, seconds};

impl Report {
    /// The closest approach, every violation and every time that a vehicle was too near to one of these obstacles, the weightiest
    /// first, with the judge's distances and times.
    #[must_use]
    pub fn moments(&self, obstacles: &[String]) -> Vec<Moment> {
        let mut violations: Vec<&Violation> = self.audit.violations.iter().collect();
        violations.sort_by(|a, b| a.min_m.total_cmp(&b.min_m));
        let mut too_near: Vec<&ObstacleViolation> = self.obstacles.iter().flat_map(|of| &of.violations).collect();
        too_near.sort_by(|a, b| a.approach.min_m.total_cmp(&b.approach.min_m));
        let too_near = too_near.into_iter().map(|found| of_obstacle(found, obstacles));
        let violations = violations.into_iter().map(|found| self.of_pair(found));
        let nearest = self.obstacles.iter().flat_map(|of| &of.closest).next();
        let closest = self.closest_moment().or_else(|| nearest.map(|found| closest_to_obstacle(found, obstacles)));
        closest.into_iter().chain(violations).chain(too_near).collect()
    }

    /// What is known of all, and what distances of two vehicles are held against.
    #[must_use]
    pub fn judgement(&self) -> Judged {
        let unit = if self.separation.ellipsoid.is_some() { "m, scaled" } else { "m" };
        let of_pairs = self.audit.undecided == 0 && self.audit.parry.disagreements == 0;
        let of_obstacles = self.obstacles.iter().all(|of| of.undecided == 0 && of.disagreements == 0);
        let is_judged = self.audit.status != Status::Undecided || self.is_clear_until_its_early_end();
        let is_else_known = is_judged && of_pairs && of_obstacles;
        Judged { is_else_known, limit: Some(self.separation.delta_m), unit }
    }

    fn closest_moment(&self) -> Option<Moment> {
        let ClosestApproach { pair, separation_m, time_s: at_s } = self.separation.closest()?;
        let (least, unit, at) = (at_least(separation_m, 6), self.judgement().unit, seconds(at_s));
        Some(Moment {
            kind: Kind::Closest,
            vehicles: vec![pair.first(), pair.second()],
            obstacle: None,
            span: Span { from_s: at_s, to_s: at_s, at_s },
            brief: String::new(),
            said: format!("Closest approach: {least} {unit}, vehicles {pair} at {at}"),
        })
    }

    fn of_pair(&self, found: &Violation) -> Moment {
        let &Violation { pair, from_s, to_s, min_m, min_at_s } = found;
        let delta_m = self.separation.delta_m;
        let (least, limit, unit) = (metres_below(min_m, delta_m), exact(delta_m), self.judgement().unit);
        Moment {
            kind: Kind::Violation,
            vehicles: vec![pair.first(), pair.second()],
            obstacle: None,
            span: Span { from_s, to_s, at_s: min_at_s },
            brief: format!("{pair} come to {least} {unit} (limit {limit})"),
            said: format!(
                "Violation: vehicles {pair} came to {} {} (δ {}) at {}, too close from {} to {}",
                least,
                unit,
                limit,
                seconds(min_at_s),
                seconds(from_s),
                seconds(to_s)
            ),
        }
    }
}

fn closest_to_obstacle(found: &ObstacleApproach, obstacles: &[String]) -> Moment {
    let &ObstacleApproach { vehicle, min_m, min_at_s, .. } = found;
    let (least, obstacle, at) = (at_least(min_m, 6), cut(&found.obstacle, LONGEST_NAME), seconds(min_at_s));
    Moment {
        kind: Kind::Closest,
        vehicles: vec![vehicle - 1],
        obstacle: obstacles.iter().position(|name| *name == found.obstacle),
        span: Span { from_s: min_at_s, to_s: min_at_s, at_s: min_at_s },
        brief: String::new(),
        said: format!("Closest approach: {least} m, vehicle {vehicle} and {obstacle} at {at}"),
    }
}

fn of_obstacle(found: &ObstacleViolation, obstacles: &[String]) -> Moment {
    let ObstacleViolation { approach, from_s, to_s } = found;
    let (vehicle, obstacle) = (approach.vehicle, cut(&approach.obstacle, LONGEST_NAME));
    let (least, limit) = (metres_below(approach.min_m, approach.clearance_m), exact(approach.clearance_m));
    Moment {
        kind: Kind::Violation,
        vehicles: vec![approach.vehicle - 1],
        obstacle: obstacles.iter().position(|name| *name == approach.obstacle),
        span: Span { from_s: *from_s, to_s: *to_s, at_s: approach.min_at_s },
        brief: format!("{vehicle} and {obstacle} come to {least} m (limit {limit})"),
        said: format!(
            "Violation: vehicle {} came to {} m from {} (clearance {}) at {}, too near from {} to {}",
            vehicle,
            least,
            obstacle,
            limit,
            seconds(approach.min_at_s),
            seconds(*from_s),
            seconds(*to_s)
        ),
    }
}
