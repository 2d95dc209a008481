//! Judges the plans of a recording of planners, each at its publication.

use std::path::Path;

use super::{AuditRequest, Failure, Monitor};
use tautline_audit::recorded::{Outcome, PlanAuditor, PlansOutcome, Settings};
use tautline_core::fact::{Fact, FactKind, FactValue, Source};
use tautline_core::option::PLAN_END;
use tautline_core::track::{PlanEnd, Tracks};
use tautline_recordings::read::ReadError;

impl AuditRequest<'_> {
    /// Judges the plans of a recording, if it has some and separations are judged. The motion after the end of a plan
    /// is that of the options, or the rule of the format, or the default: the last point is held.
    pub(super) fn judge_plans(
        &self,
        recording: &dyn Tracks<Error = ReadError>,
        settings: &Settings,
        outcome: &Outcome,
        facts: &mut Vec<Fact>,
        monitor: &dyn Monitor,
    ) -> Result<Option<PlansOutcome>, Failure> {
        let given = self.options.plan_end;
        let plans = recording.plans();
        let called = self.subject.name();
        if plans.is_empty() || outcome.separation.is_none() {
            return match given {
                None => Ok(None),
                Some(_) => {
                    let without = if plans.is_empty() { "published plans" } else { "a limit on separations" };
                    let message = format!("{called}: {PLAN_END}: the question is one without {without}");
                    let help = format!("omit {PLAN_END}, or audit a recording of planners with a limit on separations");
                    Err(Failure::input("audit/no-plans", message, help))
                }
            };
        }
        let of_format = facts.iter().find(|fact| fact.kind == FactKind::PlanEnd).and_then(named_end);
        let end = given.or(of_format).unwrap_or(PlanEnd::Hold);
        let source = match (given, of_format) {
            (Some(_), _) => Source::Declared,
            (None, Some(_)) => Source::Convention,
            (None, None) => Source::Default,
        };
        facts.retain(|fact| fact.kind != FactKind::PlanEnd);
        facts.push(Fact::name(FactKind::PlanEnd, source, end.name()));
        let failed = |error| Failure::from(error).of(Path::new(&called));
        let auditor = PlanAuditor::new(settings.clone(), end).map_err(failed)?;
        let mut auditor = auditor.with_interruption(monitor.interruption().clone());
        for plan in plans {
            auditor.push(recording.vehicles(), plan).map_err(failed)?;
        }
        Ok(Some(auditor.finish()))
    }
}

fn named_end(fact: &Fact) -> Option<PlanEnd> {
    match &fact.value {
        Some(FactValue::Name(name)) => name.parse().ok(),
        _ => None,
    }
}
