//! `[safety]` of the scenario file: the shape of what must stay empty around a vehicle.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::ScenarioError;
use super::limits::require_positive;
use super::spec::{Safety, Scenario};

/// Two safety distances that differ by less than this part are the same.
const ROUNDING: f64 = 1e-9;

/// What must stay empty around a vehicle.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SafetyTable {
    /// A ball of half of `law.delta_m`, or an upright ellipsoid.
    shape: SafetyKind,
    /// Half axes of the ellipsoid in m: the two level ones are the same, and `law.delta_m`, if given, is twice that.
    #[serde(skip_serializing_if = "Option::is_none")]
    half_axes_m: Option<[f64; 3]>,
}

/// A shape.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum SafetyKind {
    /// Two vehicles keep delta.
    #[default]
    Ball,
    /// Two ellipsoids keep from overlapping: what lies above and below counts for more, such as a downwash.
    Ellipsoid,
}

impl SafetyTable {
    /// The safety distance \[m\], which `[law]` may have given, and the shape that it is the width of.
    pub(super) fn resolve(self, delta_m: Option<f64>) -> Result<(f64, Safety), ScenarioError> {
        let wrong = |said: String, help: &str| ScenarioError::new(said).with_help(help).at("safety.half_axes_m");
        match (self.shape, self.half_axes_m, delta_m) {
            (SafetyKind::Ball, None, Some(delta_m)) => Ok((delta_m, Safety::Ball)),
            (SafetyKind::Ball, None, None) => Err(ScenarioError::new("missing key `delta_m`")
                .coded("scenario/missing-key")
                .with_help("give the safety distance")
                .at("law")),
            (SafetyKind::Ball, Some(_), _) => Err(wrong(
                "half axes of a ball".to_owned(),
                "set safety.shape to \"ellipsoid\", or leave them out: a ball is half of law.delta_m in radius",
            )),
            (SafetyKind::Ellipsoid, None, _) => Err(ScenarioError::new("an ellipsoid without half axes")
                .coded("scenario/missing-key")
                .with_help("give safety.half_axes_m, for example [0.125, 0.125, 0.375]")
                .at("safety.shape")),
            (SafetyKind::Ellipsoid, Some(half_m), delta_m) => of_ellipsoid(half_m, delta_m),
        }
    }

    /// What a scenario has.
    pub(super) fn of(scenario: &Scenario) -> Self {
        let half_axes_m = scenario.half_axes_m();
        let shape = if half_axes_m.is_some() { SafetyKind::Ellipsoid } else { SafetyKind::Ball };
        Self { shape, half_axes_m }
    }
}

fn of_ellipsoid(half_m @ [a_m, b_m, c_m]: [f64; 3], delta_m: Option<f64>) -> Result<(f64, Safety), ScenarioError> {
    let key = "safety.half_axes_m";
    for half_m in half_m {
        require_positive("a half axis", half_m).map_err(|error| error.at(key))?;
    }
    if a_m != b_m {
        return Err(ScenarioError::new(format!("an ellipsoid with level half axes of {a_m} m and {b_m} m"))
            .with_help("vehicles turn: give both the same, the larger one")
            .at(key));
    }
    let width_m = 2.0 * a_m;
    match delta_m {
        Some(delta_m) if (delta_m - width_m).abs() > ROUNDING * width_m => Err(ScenarioError::new(format!(
            "a safety distance of {delta_m} m, and ellipsoids that touch side by side at {width_m} m"
        ))
        .with_help("leave law.delta_m out: it is twice the level half axes")
        .at("law.delta_m")
        .at(key)),
        _ => Ok((delta_m.unwrap_or(width_m), Safety::Ellipsoid { half_height_m: c_m })),
    }
}
