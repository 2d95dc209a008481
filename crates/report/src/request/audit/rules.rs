//! Rules of a request: named safety shapes, thresholds of well clear, and limits that a show or a preset states.

use std::str::FromStr;

use nalgebra::Vector3;

use super::AuditRequest;
use tautline_audit::envelope::{Fence, FenceError, Limit, Quantity};
use tautline_audit::recorded::Settings;
use tautline_audit::{Cylinder, WellClear};
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
pub(super) fn fill(settings: &mut Settings, request: &AuditRequest<'_>, show: Option<&ShowRules>) -> Vec<String> {
    let mut notes = Vec::new();
    settings.yaw = show.map(|show| show.yaw.clone()).unwrap_or_default();
    let (numbers, origin) = match request.rules {
        Rules::None => return notes,
        Rules::Recording => (show.cloned().unwrap_or_default(), "the show file"),
        Rules::Skybrush => (skybrush(), "Skybrush Studio"),
    };
    let mut taken = Vec::new();
    if let Some(delta_m) = numbers.min_distance_m.filter(|_| request.is_silent()) {
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
        notes.push(format!("limits of {origin}: {} (--rules none ignores them)", taken.join(", ")));
    }
    match show.filter(|show| !show.polygons.is_empty() && settings.envelope.fence.is_none()).map(fence) {
        Some(Ok(fence)) => {
            let count = show.map_or(0, |show| show.polygons.len());
            notes.push(format!("the fence is that of the show file, {count} polygons"));
            settings.envelope.fence = Some(fence);
        }
        Some(Err(error)) => not_judged.push(format!("the geofence: {error}")),
        None => {}
    }
    if !not_judged.is_empty() {
        notes.push(format!("not judged: {}", not_judged.join(", ")));
    }
    notes
}

/// Returns the fence of a show: vehicles stay inside every inclusion and outside every exclusion.
fn fence(show: &ShowRules) -> Result<Fence, FenceError> {
    let polygon = |ShowPolygon { is_inclusion, corners_m }: &ShowPolygon| {
        let fence = Fence::new(corners_m, None, 0.0)?;
        Ok(if *is_inclusion { fence } else { fence.as_exclusion() })
    };
    let mut polygons = show.polygons.iter().map(polygon).collect::<Result<Vec<_>, FenceError>>()?;
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
