//! What `[breathing]` of a scenario must be.

use super::error::ScenarioError;
use super::spec::Scenario;
use tautline_laws::target::BreathingMode;

impl Scenario {
    pub(super) fn check_breathing(&self) -> Result<(), ScenarioError> {
        let hold_s = self.breathing.hold_s;
        if hold_s >= self.time.duration_s {
            let duration_s = self.time.duration_s;
            return Err(ScenarioError::new(format!(
                "spread slots are held for {hold_s} s of a flight of {duration_s} s"
            ))
            .coded("scenario/outside-flight")
            .with_help("shorten breathing.hold_s or lengthen time.duration_s: slots must come together again")
            .at("breathing.hold_s")
            .at("time.duration_s"));
        }
        if self.breathing.mode == BreathingMode::Start
            && let Ok(law) = self.law()
            && law.capabilities().settling.is_none()
        {
            return Err(ScenarioError::new(format!("the law `{}` is never given spread slots", law.name()))
                .coded("scenario/unsupported-by-law")
                .with_help("leave out breathing.mode, or set law.kind to \"displacement\"")
                .at("breathing.mode")
                .at("law.kind"));
        }
        Ok(())
    }
}
