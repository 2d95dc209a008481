//! Findings on a flight that its replay jumps to.

use super::findings::moments;
use super::flight::Report;
use crate::replay::{JudgementContext, Moment};
use tautline_audit::Status;

impl Report {
    /// Returns the closest approach and the violations, the gravest first. Distances and times are those of the audit.
    #[must_use]
    pub fn moments(&self) -> Vec<Moment> {
        moments(&[self.answer()]).collect()
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
