//! Findings on a flight that its replay jumps to.

use super::flight::{self, Report};
use super::obstacles::{ObstacleApproach, ObstacleViolation};
use crate::replay::{JudgementContext, LONGEST_NAME, Moment, cut};
use tautline_audit::{ObjectPair, Status, Violation};
use tautline_core::swarm::Pair;
use tautline_core::text::beside_limit;

impl Report {
    /// Returns the closest approach, the violations of pairs and those of these obstacles, the gravest first. Distances
    /// and times are those of the audit.
    #[must_use]
    pub fn moments(&self, obstacles: &[String]) -> Vec<Moment> {
        let (delta_m, unit) = (self.separation.delta_m, self.judgement().unit);
        let closest = self.separation.closest().map(|of| {
            let distance = format!("{} {unit}", beside_limit(of.separation_m, delta_m, 6));
            Moment::closest(ObjectPair::Vehicles(of.pair), &names_of(of.pair), &distance, of.time_s)
        });
        let pair = |of: &ObstacleApproach| {
            let obstacle = obstacles.iter().position(|name| *name == of.obstacle).unwrap_or(obstacles.len());
            ObjectPair::Obstacle { vehicle: of.vehicle - 1, obstacle }
        };
        let names = |of: &ObstacleApproach| format!("{} and {}", of.vehicle, cut(&of.obstacle, LONGEST_NAME));
        let nearest = self.obstacles.iter().flat_map(|of| &of.closest).next();
        let closest = closest.or_else(|| {
            let distance = format!("{} m", beside_limit(nearest?.min_m, nearest?.clearance_m, 6));
            nearest.map(|of| Moment::closest(pair(of), &names(of), &distance, of.min_at_s))
        });
        let mut violations: Vec<_> = self.audit.violations.iter().collect();
        violations.sort_by(|a, b| a.min_m.total_cmp(&b.min_m));
        let violations = violations.into_iter().map(|found| {
            let &flight::Violation { pair, from_s, to_s, min_m, min_at_s } = found;
            let (names, pair) = (names_of(pair), ObjectPair::Vehicles(pair));
            Moment::violation(&Violation { pair, from_s, to_s, min_m, min_at_s, limit_m: delta_m }, &names, unit)
        });
        let mut too_near: Vec<_> = self.obstacles.iter().flat_map(|of| &of.violations).collect();
        too_near.sort_by(|a, b| a.approach.min_m.total_cmp(&b.approach.min_m));
        let too_near = too_near.into_iter().map(|ObstacleViolation { approach, from_s, to_s }| {
            let &ObstacleApproach { clearance_m: limit_m, min_m, min_at_s, .. } = approach;
            let (pair, from_s, to_s) = (pair(approach), *from_s, *to_s);
            let found = Violation { pair, from_s, to_s, min_m, min_at_s, limit_m };
            Moment::violation(&found, &names(approach), "m")
        });
        let mut moments: Vec<_> = closest.into_iter().chain(violations).chain(too_near).collect();
        for moment in &mut moments {
            moment.obstacle = moment.obstacle.filter(|&obstacle| obstacle < obstacles.len());
        }
        moments
    }

    /// Returns the limit of separations, and whether the audit decided everything else.
    #[must_use]
    pub fn judgement(&self) -> JudgementContext {
        let unit = if self.separation.ellipsoid.is_some() { "m, scaled" } else { "m" };
        let of_pairs = self.audit.undecided == 0 && self.audit.parry.disagreements == 0;
        let of_obstacles = self.obstacles.iter().all(|of| of.undecided == 0 && of.disagreements == 0);
        let is_judged = self.audit.status != Status::Undecided || self.is_clear_until_its_early_end();
        let is_else_known = is_judged && of_pairs && of_obstacles;
        JudgementContext { is_else_known, limit: Some(self.separation.delta_m), unit }
    }
}

/// The numbers of a pair in words, such as `2 and 3`.
fn names_of(pair: Pair) -> String {
    let [first, second] = pair.numbers();
    format!("{first} and {second}")
}
