//! Judges the plans of a recording of planners: each at its publication, and against recorded flights.

use std::path::Path;

use super::{AuditRequest, Failure, Monitor, OPENING, read_until};
use tautline_audit::recorded::{Outcome, PlanAuditor, PlansOutcome, Settings};
use tautline_core::fact::{Fact, FactKind, FactValue};
use tautline_core::track::{PlanEnd, Tracks};
use tautline_recordings::read::ReadError;

impl AuditRequest<'_> {
    /// Judges the plans of a recording, if it has some and separations are judged. If `are_flown` is true, the items of
    /// the recording are flights, which are read again.
    pub(super) fn judge_plans(
        &self,
        recording: &dyn Tracks<Error = ReadError>,
        settings: &Settings,
        outcome: &Outcome,
        are_flown: bool,
        monitor: &dyn Monitor,
    ) -> Result<Option<PlansOutcome>, Failure> {
        let plans = recording.plans();
        if plans.is_empty() || outcome.separation.is_none() {
            return Ok(None);
        }
        let called = self.subject.name();
        let failed = |error| Failure::from(error).of(Path::new(&called));
        let end = recording.facts().iter().find_map(plan_end).unwrap_or(PlanEnd::Unknown);
        let auditor = PlanAuditor::new(settings.clone(), end).map_err(failed)?;
        let mut auditor = auditor.with_interruption(monitor.interruption().clone());
        if are_flown {
            auditor = auditor.with_flights(settings);
        }
        for plan in plans {
            auditor.push(recording.vehicles(), plan).map_err(failed)?;
        }
        let (mut flights, mut items) = (self.subject.open()?, Vec::new());
        let mut more = are_flown;
        while more {
            more = read_until(flights.as_mut(), &mut items, OPENING, monitor)?;
            auditor.push_flights(flights.vehicles(), &items).map_err(failed)?;
            items.clear();
        }
        auditor.finish().map(Some).map_err(failed)
    }
}

/// Returns the motion after the end of plans that a fact states.
fn plan_end(fact: &Fact) -> Option<PlanEnd> {
    match &fact.value {
        Some(FactValue::Name(name)) if fact.kind == FactKind::PlanEnd => name.parse().ok(),
        _ => None,
    }
}
