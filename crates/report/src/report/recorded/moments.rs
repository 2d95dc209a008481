//! Findings on a recording that its replay jumps to.

use super::report::{RecordedReport, VehicleFinding};
use crate::replay::{JudgementContext, Kind, LONGEST_NAME, Moment, Span, cut};
use crate::report::findings::moments;
use tautline_audit::recorded::Gap;

impl RecordedReport {
    /// Returns the closest approach, the violations, the undecided times and the gaps, the gravest first. Distances and
    /// times are those of the audit.
    #[must_use]
    pub fn moments(&self) -> Vec<Moment> {
        moments(&self.answers).chain(self.gaps.iter().map(unseen)).collect()
    }

    /// Returns the limit of separations, and whether the audit decided everything else.
    #[must_use]
    pub fn judgement(&self) -> JudgementContext {
        JudgementContext { is_else_known: self.is_else_known, limit: self.question.delta, unit: self.unit() }
    }
}

fn unseen(gap: &VehicleFinding<Gap>) -> Moment {
    let gap = VehicleFinding { vehicle: cut(&gap.vehicle, LONGEST_NAME), finding: gap.finding };
    let Gap { vehicle, from_s, to_s, .. } = gap.finding;
    let span = Span { from_s, to_s, at_s: f64::midpoint(from_s, to_s) };
    let (brief, said) = (format!("{} is not seen", gap.vehicle), format!("Undecided: {}", gap.words()));
    Moment { kind: Kind::Unseen, vehicles: vec![vehicle], obstacle: None, span, brief, said }
}
