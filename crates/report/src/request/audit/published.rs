//! Judges the plans of a recording of planners: each at its publication, and against recorded flights.

use std::path::Path;

use super::{AuditRequest, Failure, Monitor};
use tautline_audit::recorded::{PlanAuditor, PlansOutcome, Settings};
use tautline_core::fact::{Fact, FactKind, FactValue};
use tautline_core::track::{PlanEnd, Tracks};
use tautline_recordings::read::ReadError;

impl AuditRequest<'_> {
    /// Returns the auditor of the plans of a recording, and of flights if the recording has positions; `None` without
    /// plans.
    pub(super) fn plan_auditor(
        &self,
        recording: &dyn Tracks<Error = ReadError>,
        settings: &Settings,
        monitor: &dyn Monitor,
    ) -> Result<Option<PlanAuditor>, Failure> {
        if recording.plans().is_empty() {
            return Ok(None);
        }
        let end = recording.facts().iter().find_map(plan_end).unwrap_or(PlanEnd::Unknown);
        let auditor = PlanAuditor::new(settings.clone(), end)
            .map_err(|error| Failure::from(error).of(Path::new(&self.subject.name())))?;
        let auditor = auditor.with_interruption(monitor.interruption().clone());
        let are_flown = recording.facts().iter().any(|fact| fact.kind == FactKind::FlownPlans);
        Ok(Some(if are_flown { auditor.with_flights(settings) } else { auditor }))
    }

    /// Judges the plans of a recording, after its flights.
    pub(super) fn judge_plans(
        &self,
        recording: &dyn Tracks<Error = ReadError>,
        mut auditor: PlanAuditor,
    ) -> Result<PlansOutcome, Failure> {
        let called = self.subject.name();
        let failed = |error| Failure::from(error).of(Path::new(&called));
        for plan in recording.plans() {
            auditor.push(recording.vehicles(), plan).map_err(failed)?;
        }
        auditor.finish().map_err(failed)
    }
}

/// Returns the motion after the end of plans that a fact states.
fn plan_end(fact: &Fact) -> Option<PlanEnd> {
    match &fact.value {
        Some(FactValue::Name(name)) if fact.kind == FactKind::PlanEnd => name.parse().ok(),
        _ => None,
    }
}
