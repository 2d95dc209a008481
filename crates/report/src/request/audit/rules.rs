//! Rules of a request: named safety shapes, thresholds of well clear, and limits that a show or a preset states.

use std::str::FromStr;

use nalgebra::Vector3;

use super::{AuditRequest, Failure};
use tautline_audit::envelope::{Fence, Limit, Quantity};
use tautline_audit::recorded::Settings;
use tautline_audit::{Cylinder, WellClear};
use tautline_core::option::{DELTA, FENCE, LIMIT, RULES};
use tautline_recordings::read::{ShowPolygon, ShowRules};

/// Half axes of ellipsoids by their names \[m\].
///
/// `crazyswarm` is that of the collision avoidance of Crazyswarm (`RADII` in its tests), `crazyflie-firmware` that of
/// the firmware (`ellipsoidRadii` of `collision_avoidance.c`).
pub const ELLIPSOIDS: [(&str, [f64; 3]); 2] =
    [("crazyswarm", [0.125, 0.125, 0.375]), ("crazyflie-firmware", [0.3, 0.3, 0.9])];

/// Origin of the limits that a request leaves open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rules {
    /// The recording, if it states limits.
    #[default]
    Recording,
    /// Defaults of Skybrush Studio, and the geofence of the recording.
    Skybrush,
    /// No origin: only the request limits.
    None,
}

impl Rules {
    /// All origins by their names.
    pub const NAMES: [(&'static str, Self); 3] =
        [("recording", Self::Recording), ("skybrush", Self::Skybrush), ("none", Self::None)];
}

impl FromStr for Rules {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        named(text, &Self::NAMES).ok_or_else(|| format!("unknown rules `{text}`; give {}", names(&Self::NAMES)))
    }
}

/// Parses the name of an ellipsoid or three half axes \[m\].
///
/// # Errors
/// The problem and the remedy in a sentence.
pub fn ellipsoid(text: &str) -> Result<Vector3<f64>, String> {
    if let Some(axes_m) = named(text, &ELLIPSOIDS) {
        return Ok(Vector3::from(axes_m));
    }
    numbers::<3>(text).map(Vector3::from).ok_or_else(|| {
        format!("`{text}` is no ellipsoid; write three half axes, such as 0.125,0.125,0.375, or {}", names(&ELLIPSOIDS))
    })
}

/// Parses the horizontal and the vertical distance of a cylinder \[m\].
///
/// # Errors
/// The problem and the remedy in a sentence.
pub fn cylinder(text: &str) -> Result<Cylinder, String> {
    let [horizontal_m, vertical_m] = numbers(text).ok_or_else(|| {
        format!("`{text}` is no cylinder; write the horizontal and the vertical distance, such as 2,4")
    })?;
    Ok(Cylinder { horizontal_m, vertical_m })
}

/// Parses the name of thresholds of well clear, or the three thresholds \[m, m, s\].
///
/// # Errors
/// The problem and the remedy in a sentence.
pub fn well_clear(text: &str) -> Result<WellClear, String> {
    if let Some(thresholds) = named(text, &WellClear::PRESETS) {
        return Ok(thresholds);
    }
    let [horizontal_m, vertical_m, tau_s] = numbers(text).ok_or_else(|| {
        let presets = names(&WellClear::PRESETS);
        format!("`{text}` is no preset; give {presets}, or distances and modified tau such as 1219.2,137.16,35")
    })?;
    Ok(WellClear { horizontal_m, vertical_m, tau_s })
}

fn named<T: Copy>(text: &str, all: &[(&str, T)]) -> Option<T> {
    all.iter().find(|(name, _)| *name == text.trim()).map(|(_, value)| *value)
}

fn names<T>(all: &[(&str, T)]) -> String {
    all.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(" or ")
}

/// Returns exactly this number of finite numbers between commas.
fn numbers<const COUNT: usize>(text: &str) -> Option<[f64; COUNT]> {
    let numbers = text.split(',').map(|word| word.trim().parse::<f64>().ok().filter(|number| number.is_finite()));
    numbers.collect::<Option<Vec<_>>>()?.try_into().ok()
}

/// Returns the defaults of Skybrush Studio (`SafetyCheckParams` in `sbstudio/model/safety_check.py`).
fn skybrush() -> ShowRules {
    ShowRules {
        min_distance_m: Some(3.0),
        max_height_m: Some(150.0),
        max_horizontal_m_s: Some(8.0),
        max_climb_m_s: Some(3.0),
        max_descent_m_s: Some(3.0),
        max_accel_m_s2: Some(4.0),
        navigation_floor_m: Some(2.5),
        max_yaw_rate_deg_s: Some(30.0),
        ..ShowRules::default()
    }
}

/// Fills limits that the settings leave open. Returns notes on the limits taken and on those that are not judged.
///
/// # Errors
/// [`Failure`] if a rule of the show cannot be read, and no option replaces it.
pub(super) fn fill(
    settings: &mut Settings,
    request: &AuditRequest<'_>,
    show: Option<&ShowRules>,
) -> Result<Vec<String>, Failure> {
    let mut notes = Vec::new();
    show.map_or(Ok(()), |show| check(settings, request, show))?;
    settings.yaw = show.map(|show| show.yaw.clone()).unwrap_or_default();
    let (numbers, origin) = match request.options.rules.unwrap_or_default() {
        Rules::None => return Ok(notes),
        Rules::Recording => (show.cloned().unwrap_or_default(), "the show file"),
        Rules::Skybrush => (skybrush(), "Skybrush Studio"),
    };
    let mut taken = Vec::new();
    if let Some(delta_m) = numbers.min_distance_m.filter(|_| request.options.is_silent()) {
        settings.delta_m = Some(delta_m);
        taken.push(format!("distance {delta_m:?} m"));
    }
    let is_limited = |quantity: Quantity| settings.envelope.limits.iter().any(|limit| limit.quantity == quantity);
    let limits = [
        (Quantity::HorizontalSpeed, numbers.max_horizontal_m_s),
        (Quantity::Climb, numbers.max_climb_m_s),
        (Quantity::Descent, numbers.max_descent_m_s),
        (Quantity::Acceleration, numbers.max_accel_m_s2),
        (Quantity::Height, numbers.max_height_m),
        (Quantity::NavigationFloor, numbers.navigation_floor_m),
        (Quantity::YawRate, numbers.max_yaw_rate_deg_s),
    ];
    let limits = limits.into_iter().filter(|(quantity, _)| !is_limited(*quantity));
    let mut limits: Vec<_> =
        limits.filter_map(|(quantity, allowed)| Some(Limit { quantity, allowed: allowed? })).collect();
    let mut not_judged = show.map_or_else(Vec::new, |show| show.not_judged.clone());
    if settings.yaw.is_empty() && limits.iter().any(|limit| limit.quantity == Quantity::YawRate) {
        limits.retain(|limit| limit.quantity != Quantity::YawRate);
        not_judged.push("the yaw rate, since the recording has no yaw".to_owned());
    }
    taken.extend(
        limits.iter().map(|Limit { quantity, allowed }| format!("{} {allowed:?} {}", quantity.name(), quantity.unit())),
    );
    settings.envelope.limits.extend(limits);
    if !taken.is_empty() {
        notes.push(format!("limits of {origin}: {} ({} ignores them)", taken.join(", "), RULES.set("none")));
    }
    if let Some(show) = show.filter(|show| !show.polygons.is_empty() && settings.envelope.fence.is_none()) {
        settings.envelope.fence =
            Some(fence(show).map_err(|problem| unreadable(request, &problem, Some(FENCE.to_string())))?);
        notes.push(format!("the fence is that of the show file, {} polygons", show.polygons.len()));
    }
    if !not_judged.is_empty() {
        notes.push(format!("not judged: {}", not_judged.join(", ")));
    }
    Ok(notes)
}

/// Rejects rules of a show that cannot be read, unless an option replaces them or no limit needs them.
fn check(settings: &Settings, request: &AuditRequest<'_>, show: &ShowRules) -> Result<(), Failure> {
    let is_limited = |quantity: Quantity| settings.envelope.limits.iter().any(|limit| limit.quantity == quantity);
    let rules = request.options.rules.unwrap_or_default();
    for (key, problem) in &show.unreadable {
        let is_of_validation = key.starts_with("validation");
        if rules == Rules::None || (is_of_validation && rules == Rules::Skybrush) {
            continue;
        }
        let quantities: &[Quantity] = match key.strip_prefix("validation.") {
            Some("maxAltitude") => &[Quantity::Height],
            Some("maxVelocityXY") => &[Quantity::HorizontalSpeed],
            // This key limits the climb rate too, unless the show limits it separately.
            Some("maxVelocityZ") if show.max_climb_m_s.is_none() => &[Quantity::Descent, Quantity::Climb],
            Some("maxVelocityZ") => &[Quantity::Descent],
            Some("maxVelocityZUp") => &[Quantity::Climb],
            Some("maxAccelerationXY" | "maxAccelerationZ") => &[Quantity::Acceleration],
            Some("minNavAltitude") => &[Quantity::NavigationFloor],
            Some("maxYawRate") => &[Quantity::YawRate],
            _ => &[],
        };
        let named = quantities.iter().map(|quantity| LIMIT.set(format!("{}=NUMBER", quantity.name())).to_string());
        let (is_replaced, option) = match &**key {
            "validation.minDistance" => (!request.options.is_silent(), Some(DELTA.to_string())),
            "geofence" => (settings.envelope.fence.is_some(), Some(FENCE.to_string())),
            _ if quantities.is_empty() => (false, None),
            _ => (quantities.iter().all(|of| is_limited(*of)), Some(named.collect::<Vec<_>>().join(" and "))),
        };
        if !is_replaced {
            return Err(unreadable(request, problem, option));
        }
    }
    let is_yaw_limited_by_rules = match rules {
        Rules::None => false,
        Rules::Recording => show.max_yaw_rate_deg_s.is_some(),
        Rules::Skybrush => true,
    };
    match show.unreadable_yaw.first() {
        Some(problem) if is_limited(Quantity::YawRate) => {
            let message = format!("{}: {problem}", request.subject.name());
            let help = format!("correct the show, or leave {} out", LIMIT.set("yaw-rate=NUMBER"));
            Err(Failure::input("recording/malformed", message, help))
        }
        Some(problem) if is_yaw_limited_by_rules => Err(unreadable(request, problem, None)),
        _ => Ok(()),
    }
}

/// Returns the failure for a rule that cannot be read. `option` replaces the rule.
fn unreadable(request: &AuditRequest<'_>, problem: &str, option: Option<String>) -> Failure {
    let option = option.map_or(String::new(), |option| format!("replace the rule with {option}, or "));
    let help = format!("correct the show, or {option}ignore all rules with {}", RULES.set("none"));
    Failure::input("recording/malformed", format!("{}: {problem}", request.subject.name()), help)
}

/// Returns the fence of a show: vehicles stay inside every inclusion and outside every exclusion.
fn fence(show: &ShowRules) -> Result<Fence, String> {
    let polygon = |(index, ShowPolygon { is_inclusion, corners_m }): (usize, &ShowPolygon)| {
        let fence = Fence::new(corners_m, None, 0.0);
        let fence = fence.map_err(|error| format!("polygon {} of `settings.geofence`: {error}", index + 1))?;
        Ok(if *is_inclusion { fence } else { fence.as_exclusion() })
    };
    let mut polygons = show.polygons.iter().enumerate().map(polygon).collect::<Result<Vec<_>, String>>()?;
    let first = polygons.remove(0);
    Ok(first.with(polygons))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_are_read() {
        assert_eq!(ellipsoid("crazyswarm"), Ok(Vector3::new(0.125, 0.125, 0.375)));
        assert_eq!(ellipsoid("crazyflie-firmware"), ellipsoid("0.3,0.3,0.9"));
        assert_eq!(cylinder(" 2, 4"), Ok(Cylinder { horizontal_m: 2.0, vertical_m: 4.0 }));
        assert_eq!(well_clear("do-365"), Ok(WellClear::DO_365));
        assert_eq!(well_clear("600,75,0"), Ok(WellClear { horizontal_m: 600.0, vertical_m: 75.0, tau_s: 0.0 }));
        assert_eq!("skybrush".parse(), Ok(Rules::Skybrush));
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_known_ones() {
        assert!(ellipsoid("crazyfly").unwrap_err().contains("crazyswarm or crazyflie-firmware"));
        assert!(cylinder("2").unwrap_err().contains("such as 2,4"));
        assert!(cylinder("2,nan").is_err());
        assert!(well_clear("do-178").unwrap_err().contains("do-365 or f3442"));
        assert!("all".parse::<Rules>().unwrap_err().contains("recording or skybrush or none"));
    }
}
