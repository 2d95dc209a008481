//! What `[breathing]` of a scenario must be.

use super::error::ScenarioError;
use super::limits::{at_least_zero, positive};
use super::spec::Scenario;
use tautline_laws::target::BreathingMode;

impl Scenario {
    pub(super) fn check_breathing(&self) -> Result<(), ScenarioError> {
        let scale = positive("breathing.scale", "the scale of a breath", self.breathing.scale)?;
        let hold_s =
            at_least_zero("breathing.hold_s", "the time for which spread slots are held", self.breathing.hold_s)?;
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
        if scale >= 1.0 {
            return Ok(());
        }
        Err(ScenarioError::new(format!("a breath scales slots by {scale}, which brings them nearer to each other"))
            .coded("scenario/out-of-range")
            .with_help("it must be at least 1; the default is 2")
            .at("breathing.scale"))
    }
}
