//! `identify`: measures the tracking error of a scenario's quadrotors, and writes it into the file of a model.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use super::{Failure, ScenarioRequest, Silent, outputs};
use tautline_core::option::IDENTIFY;
use tautline_sim::shield::Identification;
use tautline_sim::vehicle::{self, MODELS, Model, Tracking};

/// Reads the scenario with any tracking error. Scenarios under a shield need one, which the measurement replaces.
const ANY_TRACKING_ERROR: &str = "shield.tracking_error_m=0.001";

/// Measured tracking error, and its table for a model.
#[derive(Clone, Debug)]
pub struct IdentifiedModel {
    /// The measurement.
    pub measured: Identification,
    /// Table `[tracking]` of a model, as TOML with comments.
    pub table: String,
}

/// Measures the tracking error of the quadrotors of a scenario under its shield, or under a shield with defaults. With
/// a file, writes the model with the measured table. An existing file of the same model keeps its comments.
///
/// # Errors
/// [`Failure`] if the scenario is wrong, the error cannot be measured, or the file cannot be written.
pub fn identify(what: &ScenarioRequest, out: Option<&Path>) -> Result<IdentifiedModel, Failure> {
    let overrides = what.overrides.iter().cloned().chain([ANY_TRACKING_ERROR.to_owned()]).collect();
    let scenario = ScenarioRequest { overrides, ..what.clone() }.read()?;
    let text = match (out, scenario.airframe.quadrotor()) {
        (Some(path), Some(quadrotor)) => Some((path, model_text(path, &quadrotor.model)?)),
        _ => None,
    };
    let measured = scenario.identify()?;
    let table = tracking_table(&measured.tracking, &measured);
    if let Some((path, text)) = text {
        outputs::write(path, format!("{}{table}", without_table(&text)).as_bytes(), &Silent::default())?;
    }
    Ok(IdentifiedModel { measured, table })
}

/// Returns the text of a model: that of the file if it holds the model, of the built-in model, or of its keys.
fn model_text(path: &Path, model: &Model) -> Result<String, Failure> {
    let is_same = |text: &str| {
        vehicle::read(&model.name, text)
            .is_ok_and(|other| Model { tracking: model.tracking.clone(), ..other } == *model)
    };
    match std::fs::read_to_string(path) {
        Ok(text) if is_same(&text) => return Ok(text),
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        _ => {
            let message = format!("{}: exists and is not the model of the scenario", path.display());
            return Err(Failure::input("files/exists", message, "give a new file, or the file of vehicle.model"));
        }
    }
    if let Some((_, text)) = MODELS.iter().find(|(_, text)| is_same(text)) {
        return Ok((*text).to_owned());
    }
    let keys = Model { tracking: None, ..model.clone() };
    toml::to_string(&keys).map_err(|error| Failure::machine("files/cannot-write", error.to_string()))
}

/// Returns the text of a model without its table `[tracking]` and the comments directly above it.
fn without_table(text: &str) -> String {
    let lines: Vec<_> = text.lines().collect();
    let Some(at) = lines.iter().position(|line| line.trim() == "[tracking]") else {
        return format!("{}\n", text.trim_end());
    };
    let comments = lines[..at].iter().rev().take_while(|line| line.starts_with('#')).count();
    let is_other = |line: &&str| line.starts_with('[') && !line.starts_with("[tracking.");
    let after = lines[at + 1..].iter().position(is_other).map_or(lines.len(), |next| at + 1 + next);
    let kept: Vec<_> = lines[..at - comments].iter().chain(&lines[after..]).copied().collect();
    format!("{}\n", kept.join("\n").trim_end())
}

/// Returns the table `[tracking]` with comments.
fn tracking_table(tracking: &Tracking, measured: &Identification) -> String {
    let table = BTreeMap::from([("tracking", tracking)]);
    let keys = toml::to_string(&table).unwrap_or_default();
    format!(
        "\n# Measured by `tautline check {}`, not proved: the largest error of the search times a margin.\n# \
         Worst: {}.\n{keys}",
        IDENTIFY.argument(),
        measured.sequence
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_keeps_its_comments_and_gets_one_table() {
        for (_, text) in MODELS {
            let bare = without_table(text);
            assert!(bare.starts_with("# ") && !bare.contains("tracking") && bare.ends_with("attitude_damping = 1.0\n"));
            let old = "\n# Measured by hand.\n[tracking]\nerror_m = 1.0\n\n[tracking.search]\nflights = 1\n";
            assert_eq!(without_table(&format!("{bare}{old}")), bare);
            assert_eq!(without_table(&bare), bare);
        }
    }
}
