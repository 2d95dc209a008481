//! Judges the plans of a recording of planners: each at its publication, and against recorded flights.

use std::path::Path;

use super::{AuditRequest, Failure, Monitor, OPENING, read_until};
use tautline_audit::recorded::{PlanAuditor, PlansOutcome, Settings};
use tautline_core::fact::{Fact, FactKind, FactValue};
use tautline_core::track::{PlanEnd, Tracks};
use tautline_recordings::read::ReadError;

impl AuditRequest<'_> {
    /// Returns the auditor of the plans of a recording; `None` if it has none.
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
        Ok(Some(auditor.with_interruption(monitor.interruption().clone())))
    }

    /// Judges the plans of a recording. If `flights` are given, the items of the recording are flights with these
    /// settings, and are read again.
    pub(super) fn judge_plans(
        &self,
        recording: &dyn Tracks<Error = ReadError>,
        mut auditor: PlanAuditor,
        flights: Option<&Settings>,
        monitor: &dyn Monitor,
    ) -> Result<PlansOutcome, Failure> {
        let called = self.subject.name();
        let failed = |error| Failure::from(error).of(Path::new(&called));
        if let Some(settings) = flights {
            auditor = auditor.with_flights(settings);
        }
        for plan in recording.plans() {
            auditor.push(recording.vehicles(), plan).map_err(failed)?;
        }
        if flights.is_some() {
            let (mut flights, mut items, mut more) = (self.subject.open()?, Vec::new(), true);
            while more {
                more = read_until(flights.as_mut(), &mut items, OPENING, monitor)?;
                auditor.push_flights(flights.vehicles(), &items).map_err(failed)?;
                items.clear();
            }
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
