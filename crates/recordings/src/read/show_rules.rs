//! Rules that a Skybrush show states itself: limits for its validation, geofence, and yaw of its drones.
//!
//! Limits are in metres, metres per second and degrees per second, and apply to each drone. Polygons of the geofence
//! are in the flat coordinate system of the show, in metres. Yaw is in degrees, and linear between setpoints. Facts
//! from `skybrush-io/live`, `skybrush-io/viewer` and `skybrush-io/studio-blender`.

use std::collections::BTreeMap;

use serde_json::{Map, Value};
use tautline_core::option::{AXES, SCALE};

/// Rules of a show.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShowRules {
    /// Smallest distance of two drones \[m\].
    pub min_distance_m: Option<f64>,
    /// Largest height \[m\].
    pub max_height_m: Option<f64>,
    /// Largest horizontal speed \[m/s\].
    pub max_horizontal_m_s: Option<f64>,
    /// Largest climb rate \[m/s\].
    pub max_climb_m_s: Option<f64>,
    /// Largest sink rate \[m/s\].
    pub max_descent_m_s: Option<f64>,
    /// Largest acceleration \[m/s^2\].
    pub max_accel_m_s2: Option<f64>,
    /// Height below which drones do not move horizontally \[m\].
    pub navigation_floor_m: Option<f64>,
    /// Largest yaw rate \[deg/s\].
    pub max_yaw_rate_deg_s: Option<f64>,
    /// Polygons of the geofence.
    pub polygons: Vec<ShowPolygon>,
    /// Yaw setpoints of drones by name: times \[s\] in ascending order, and yaw \[deg\]. A drone without yaw control,
    /// or with automatic yaw, is absent.
    pub yaw: BTreeMap<String, Vec<[f64; 2]>>,
    /// Rules of the file that are not judged, a clause each.
    pub not_judged: Vec<String>,
    /// Rules of the file that cannot be read: keys, such as `validation.minDistance`, and problems. Problems of the
    /// geofence have the key `geofence`, and the whole settings the key `settings`.
    pub unreadable: Vec<(String, String)>,
    /// Yaw controls that cannot be read, a problem each.
    pub unreadable_yaw: Vec<String>,
}

/// Polygon of a geofence, seen from above.
#[derive(Clone, Debug, PartialEq)]
pub struct ShowPolygon {
    /// Whether drones must stay inside; if not, outside.
    pub is_inclusion: bool,
    /// Corners x, y \[m\].
    pub corners_m: Vec<[f64; 2]>,
}

/// Keys of the validation settings that are read.
const KEYS: [&str; 9] = [
    "minDistance",
    "maxAltitude",
    "maxVelocityXY",
    "maxVelocityZ",
    "maxVelocityZUp",
    "maxAccelerationXY",
    "maxAccelerationZ",
    "minNavAltitude",
    "maxYawRate",
];
/// Keys of a geofence without a rule, or with the polygons.
const GEOFENCE_KEYS: [&str; 6] = ["version", "polygons", "action", "enabled", "rallyPoints", "id"];

impl ShowRules {
    /// Reads `settings` of a show. `metres` is the length of its unit of length \[m\].
    pub(super) fn read(settings: &Value, metres: f64, are_axes_kept: bool) -> Self {
        let mut rules = Self::default();
        if !settings.is_object() && !settings.is_null() {
            rules.refuse("settings", format!("`settings` must be an object ({})", shown(settings)));
        }
        if let Some(validation) = rules.section(settings, "validation") {
            rules.read_validation(validation, metres);
        }
        if let Some(fence) = rules.section(settings, "geofence") {
            rules.read_geofence(fence, metres, are_axes_kept);
        }
        rules
    }

    /// Returns a part of the settings, if there is one.
    fn section<'a>(&mut self, settings: &'a Value, key: &str) -> Option<&'a Map<String, Value>> {
        let part = settings.get(key).filter(|part| !part.is_null())?;
        if !part.is_object() {
            self.refuse(key, format!("`settings.{key}` must be an object ({})", shown(part)));
        }
        part.as_object()
    }

    fn refuse(&mut self, key: &str, problem: String) {
        self.unreadable.push((key.to_owned(), problem));
    }

    fn read_validation(&mut self, validation: &Map<String, Value>, metres: f64) {
        let mut problems = Vec::new();
        let mut number = |key: &str, unit: f64| {
            let value = validation.get(key).filter(|value| !value.is_null())?;
            let number = value.as_f64().map(|number| number * unit);
            let number = number.filter(|number| number.is_finite() && *number > 0.0);
            if number.is_none() {
                let key = format!("validation.{key}");
                let problem = format!("`settings.{key}` must be a number above 0 ({})", shown(value));
                problems.push((key, problem));
            }
            number
        };
        self.min_distance_m = number("minDistance", metres);
        self.max_height_m = number("maxAltitude", metres);
        self.max_horizontal_m_s = number("maxVelocityXY", metres);
        self.max_descent_m_s = number("maxVelocityZ", metres);
        self.max_climb_m_s = number("maxVelocityZUp", metres).or(self.max_descent_m_s);
        self.navigation_floor_m = number("minNavAltitude", metres);
        self.max_yaw_rate_deg_s = number("maxYawRate", 1.0);
        // Skybrush Studio writes its limit of the whole acceleration for both parts.
        let accelerations = [number("maxAccelerationXY", metres), number("maxAccelerationZ", metres)];
        self.unreadable.extend(problems);
        let not_judged = match accelerations {
            [Some(level), Some(vertical)] if level == vertical => {
                self.max_accel_m_s2 = Some(level);
                None
            }
            [Some(_), Some(_)] => Some("`maxAccelerationXY` and `maxAccelerationZ`, which differ"),
            [Some(_), None] => Some("`maxAccelerationXY`, since `maxAccelerationZ` is missing"),
            [None, Some(_)] => Some("`maxAccelerationZ`, since `maxAccelerationXY` is missing"),
            [None, None] => None,
        };
        self.not_judged.extend(not_judged.map(str::to_owned));
        let unknown = validation.keys().filter(|key| !KEYS.contains(&key.as_str()));
        self.not_judged.extend(unknown.map(|key| format!("`{key}`")));
    }

    fn read_geofence(&mut self, fence: &Map<String, Value>, metres: f64, are_axes_kept: bool) {
        match fence.get("enabled") {
            None | Some(Value::Bool(true)) => {}
            Some(Value::Bool(false)) => return self.not_judged.push("the geofence, which is disabled".to_owned()),
            Some(other) => {
                let problem = format!("`enabled` of `settings.geofence` must be true or false ({})", shown(other));
                self.refuse("geofence", problem);
            }
        }
        if !are_axes_kept {
            self.not_judged.push(format!("the geofence, since {AXES} or {SCALE} map the axes"));
            return;
        }
        let others = fence.iter().filter(|(key, value)| !GEOFENCE_KEYS.contains(&key.as_str()) && !value.is_null());
        self.not_judged.extend(others.map(|(key, _)| format!("`{key}` of the geofence")));
        let polygons = match fence.get("polygons") {
            None | Some(Value::Null) => return,
            Some(Value::Array(polygons)) => polygons,
            Some(other) => {
                let problem = format!("`polygons` of `settings.geofence` must be a list ({})", shown(other));
                return self.refuse("geofence", problem);
            }
        };
        for (index, polygon) in polygons.iter().enumerate() {
            match ShowPolygon::read(polygon, metres) {
                Ok(polygon) => self.polygons.push(polygon),
                Err(problem) => {
                    self.refuse("geofence", format!("polygon {} of `settings.geofence`: {problem}", index + 1));
                }
            }
        }
    }

    /// Adds the yaw control of a drone, whose times count from its take-off \[s\].
    pub(super) fn read_yaw(&mut self, name: &str, control: &Value, takeoff_s: f64) {
        match setpoints(control) {
            Ok(None) => {}
            Ok(Some(setpoints)) => {
                let moved = setpoints.into_iter().map(|[time_s, yaw_deg]| [time_s + takeoff_s, yaw_deg]);
                self.yaw.insert(name.to_owned(), moved.collect());
            }
            Err(problem) => self.unreadable_yaw.push(format!("yaw of `{name}`: {problem}")),
        }
    }
}

impl ShowPolygon {
    fn read(polygon: &Value, metres: f64) -> Result<Self, String> {
        let is_inclusion = match polygon.get("isInclusion") {
            // Without a flag the polygon is the region of the show.
            None => true,
            Some(Value::Bool(is_inclusion)) => *is_inclusion,
            Some(other) => return Err(format!("`isInclusion` must be true or false ({})", shown(other))),
        };
        let points = polygon.get("points").and_then(Value::as_array);
        let points = points.ok_or_else(|| format!("`points` must be a list of corners ({})", shown(polygon)))?;
        let corner = |point: &Value| {
            point_of(point, metres).ok_or_else(|| format!("a corner must be a list of x and y ({})", shown(point)))
        };
        Ok(Self { is_inclusion, corners_m: points.iter().map(corner).collect::<Result<_, _>>()? })
    }
}

/// Returns the setpoints of a yaw control, or nothing without yaw control or with automatic yaw.
fn setpoints(control: &Value) -> Result<Option<Vec<[f64; 2]>>, String> {
    if !control.is_object() && !control.is_null() {
        return Err(format!("`yawControl` must be an object ({})", shown(control)));
    }
    match control.get("autoYaw") {
        None | Some(Value::Null | Value::Bool(false)) => {}
        Some(Value::Bool(true)) => return Ok(None),
        Some(other) => return Err(format!("`autoYaw` must be true or false ({})", shown(other))),
    }
    let list = match control.get("setpoints") {
        None | Some(Value::Null) => return Ok(None),
        Some(Value::Array(list)) => list,
        Some(other) => return Err(format!("`setpoints` must be a list ({})", shown(other))),
    };
    let mut setpoints: Vec<[f64; 2]> = Vec::new();
    for point in list {
        let read = point_of(point, 1.0);
        let read = read.ok_or_else(|| format!("a setpoint must be a list of time and yaw ({})", shown(point)))?;
        if setpoints.last().is_some_and(|before| before[0] >= read[0]) {
            return Err(format!("times of setpoints must increase ({})", shown(point)));
        }
        setpoints.push(read);
    }
    Ok(Some(setpoints))
}

/// Returns the first characters of a value, for an error message.
fn shown(value: &Value) -> String {
    const LONGEST: usize = 60;
    let text = value.to_string();
    match text.char_indices().nth(LONGEST) {
        None => text,
        Some((end, _)) => format!("{}…", &text[..end]),
    }
}

/// Returns the first two numbers of a list.
fn point_of(point: &Value, unit: f64) -> Option<[f64; 2]> {
    let numbers = point.as_array()?;
    let number = |k: usize| numbers.get(k)?.as_f64().map(|x| x * unit).filter(|x| x.is_finite());
    Some([number(0)?, number(1)?])
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn limits_and_polygons_of_a_show_are_read() {
        let inside = json!({"isInclusion": true, "points": [[0, 0, 0], [9, 0, 0], [9, 9, 0]]});
        let outside = json!({"isInclusion": false, "points": [[1, 1], [2, 1], [2, 2]]});
        let settings = json!({
            "validation": {
                "minDistance": 2.5, "maxAltitude": 100, "maxVelocityXY": 8, "maxVelocityZ": 3, "maxVelocityZUp": 2,
                "maxAccelerationXY": 4, "maxAccelerationZ": 4, "minNavAltitude": 2.5,
            },
            "geofence": {"version": 1, "polygons": [inside, outside]},
        });
        let rules = ShowRules::read(&settings, 1.0, true);
        assert_eq!((rules.min_distance_m, rules.max_height_m), (Some(2.5), Some(100.0)));
        assert_eq!((rules.max_climb_m_s, rules.max_descent_m_s), (Some(2.0), Some(3.0)));
        assert_eq!((rules.max_accel_m_s2, rules.navigation_floor_m), (Some(4.0), Some(2.5)));
        assert_eq!(rules.polygons.iter().map(|polygon| polygon.is_inclusion).collect::<Vec<_>>(), [true, false]);
        assert_eq!(rules.polygons[0].corners_m[1], [9.0, 0.0]);
        assert!(rules.not_judged.is_empty(), "{:?}", rules.not_judged);
    }

    fn unreadable(settings: &Value) -> Vec<String> {
        ShowRules::read(settings, 1.0, true).unreadable.into_iter().map(|(_, problem)| problem).collect()
    }

    #[test]
    fn readable_rules_that_are_not_judged_are_noted() {
        let settings = json!({
            "validation": {"maxJerk": 3, "maxAccelerationXY": 4}, "geofence": {"maxDistance": 200, "polygons": []},
        });
        let rules = ShowRules::read(&settings, 1.0, true);
        let expected = ["`maxAccelerationXY`, since `maxAccelerationZ` is missing", "`maxJerk`"];
        assert_eq!(rules.not_judged, [&expected[..], &["`maxDistance` of the geofence"]].concat());
        assert!(rules.unreadable.is_empty(), "{:?}", rules.unreadable);
        let unequal = json!({"validation": {"maxAccelerationXY": 4, "maxAccelerationZ": 3}});
        assert!(ShowRules::read(&unequal, 1.0, true).not_judged[0].ends_with("which differ"));
    }

    #[test]
    fn unreadable_rules_have_key_and_value() {
        let fence = |polygon: Value| json!({"geofence": {"polygons": [polygon]}});
        let corners = json!([[0, 0], [9, 0], [9, 9]]);
        for (settings, key, value) in [
            (json!([1]), "`settings`", "([1])"),
            (json!({"validation": [3]}), "`settings.validation`", "([3])"),
            (json!({"validation": {"minDistance": "6"}}), "`settings.validation.minDistance`", "(\"6\")"),
            (json!({"validation": {"maxAltitude": -1}}), "`settings.validation.maxAltitude`", "(-1)"),
            (json!({"geofence": 4}), "`settings.geofence`", "(4)"),
            (json!({"geofence": {"enabled": 1}}), "`enabled`", "(1)"),
            (json!({"geofence": {"polygons": "x"}}), "`polygons`", "(\"x\")"),
            (json!({"geofence": {"polygons": {}}}), "`polygons`", "({})"),
            (fence(json!({"isInclusion": 0, "points": corners})), "`isInclusion`", "(0)"),
            (fence(json!({"isInclusion": "false", "points": corners})), "`isInclusion`", "(\"false\")"),
            (fence(json!({"isInclusion": null, "points": corners})), "`isInclusion`", "(null)"),
            (fence(json!({"points": [[0, 0], [1]]})), "polygon 1", "([1])"),
            (fence(json!({"points": 3})), "`points`", "({\"points\":3})"),
        ] {
            let found = unreadable(&settings);
            assert!(found.len() == 1 && found[0].contains(key) && found[0].ends_with(value), "{settings}: {found:?}");
        }
        for readable in [json!(null), json!({}), fence(json!({"points": corners})), json!({"validation": null})] {
            assert_eq!(unreadable(&readable), [""; 0], "{readable}");
        }
    }

    #[test]
    fn yaw_counts_from_take_off_and_its_times_increase() {
        let mut rules = ShowRules::default();
        rules.read_yaw("a", &json!({"version": 1, "setpoints": [[0, 0], [2, 90]]}), 5.0);
        rules.read_yaw("b", &json!({"autoYaw": true, "setpoints": []}), 0.0);
        rules.read_yaw("c", &Value::Null, 0.0);
        assert_eq!(rules.yaw.get("a"), Some(&vec![[5.0, 0.0], [7.0, 90.0]]));
        assert_eq!((rules.yaw.len(), rules.unreadable_yaw.len()), (1, 0));
        let wrong = [
            json!({"setpoints": [[2, 0], [2, 90]]}),
            json!({"setpoints": [[2]]}),
            json!({"setpoints": 2}),
            json!({"autoYaw": 1}),
            json!([2]),
        ];
        for control in &wrong {
            rules.read_yaw("d", control, 0.0);
        }
        assert_eq!((rules.yaw.len(), rules.unreadable_yaw.len()), (1, 5));
        assert_eq!(rules.unreadable_yaw[0], "yaw of `d`: times of setpoints must increase ([2,90])");
    }
}
