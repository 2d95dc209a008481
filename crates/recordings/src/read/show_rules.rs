//! Rules that a Skybrush show states itself: limits for its validation, geofence, and yaw of its drones.
//!
//! Limits are in metres, metres per second and degrees per second, and apply to each drone. Polygons of the geofence
//! are in the flat coordinate system of the show, in metres. Yaw is in degrees, and linear between setpoints. Facts
//! from `skybrush-io/live`, `skybrush-io/viewer` and `skybrush-io/studio-blender`.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

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
    /// Rules of the file that are not read, a clause each.
    pub not_judged: Vec<String>,
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
        if let Some(validation) = settings.get("validation").and_then(Value::as_object) {
            rules.read_validation(validation, metres);
        }
        match settings.get("geofence") {
            None | Some(Value::Null) => {}
            Some(Value::Object(fence)) if fence.get("enabled") == Some(&Value::Bool(false)) => {
                rules.not_judged.push("the geofence, which is disabled".to_owned());
            }
            Some(Value::Object(_)) if !are_axes_kept => {
                rules.not_judged.push("the geofence, since --axes or --scale map the axes".to_owned());
            }
            Some(Value::Object(fence)) => rules.read_geofence(fence, metres),
            Some(_) => rules.not_judged.push("the geofence, which is no object".to_owned()),
        }
        rules
    }

    fn read_validation(&mut self, validation: &Map<String, Value>, metres: f64) {
        let mut problems = Vec::new();
        let mut number = |key: &str, unit: f64| {
            let value = validation.get(key).filter(|value| !value.is_null())?;
            let number = value.as_f64().map(|number| number * unit);
            let number = number.filter(|number| number.is_finite() && *number > 0.0);
            if number.is_none() {
                problems.push(format!("`{key}`, which is not above 0 ({value})"));
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
        match [number("maxAccelerationXY", metres), number("maxAccelerationZ", metres)] {
            [Some(level), Some(vertical)] if level == vertical => self.max_accel_m_s2 = Some(level),
            [None, None] => {}
            _ => problems.push("`maxAccelerationXY` and `maxAccelerationZ`, which differ".to_owned()),
        }
        let unknown = validation.keys().filter(|key| !KEYS.contains(&key.as_str()));
        problems.extend(unknown.map(|key| format!("`{key}`")));
        self.not_judged.extend(problems);
    }

    fn read_geofence(&mut self, fence: &Map<String, Value>, metres: f64) {
        let others = fence.iter().filter(|(key, value)| !GEOFENCE_KEYS.contains(&key.as_str()) && !value.is_null());
        self.not_judged.extend(others.map(|(key, _)| format!("`{key}` of the geofence")));
        let polygons = fence.get("polygons").and_then(Value::as_array);
        for (index, polygon) in polygons.into_iter().flatten().enumerate() {
            match ShowPolygon::read(polygon, metres) {
                Some(polygon) => self.polygons.push(polygon),
                None => self.not_judged.push(format!("polygon {} of the geofence, which has no corners", index + 1)),
            }
        }
    }

    /// Adds the yaw control of a drone, whose times count from its take-off \[s\].
    pub(super) fn read_yaw(&mut self, name: &str, control: &Value, takeoff_s: f64) {
        if control.get("autoYaw").and_then(Value::as_bool) == Some(true) {
            return;
        }
        let Some(list) = control.get("setpoints").and_then(Value::as_array) else { return };
        let setpoints: Option<Vec<_>> = list.iter().map(|point| point_of(point, 1.0)).collect();
        let is_in_order = |of: &Vec<[f64; 2]>| of.windows(2).all(|two| two[0][0] < two[1][0]);
        match setpoints.filter(is_in_order) {
            Some(setpoints) => {
                let moved = setpoints.into_iter().map(|[time_s, yaw_deg]| [time_s + takeoff_s, yaw_deg]);
                self.yaw.insert(name.to_owned(), moved.collect());
            }
            None => self.not_judged.push(format!("the yaw of `{name}`, whose setpoints are not in order of time")),
        }
    }
}

impl ShowPolygon {
    fn read(polygon: &Value, metres: f64) -> Option<Self> {
        let points = polygon.get("points")?.as_array()?;
        let corners_m: Option<Vec<_>> = points.iter().map(|point| point_of(point, metres)).collect();
        // Without a flag the polygon is the region of the show.
        let is_inclusion = polygon.get("isInclusion").and_then(Value::as_bool).unwrap_or(true);
        Some(Self { is_inclusion, corners_m: corners_m.filter(|corners| !corners.is_empty())? })
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
        assert_eq!(rules.polygons.iter().map(|of| of.is_inclusion).collect::<Vec<_>>(), [true, false]);
        assert_eq!(rules.polygons[0].corners_m[1], [9.0, 0.0]);
        assert!(rules.not_judged.is_empty(), "{:?}", rules.not_judged);
    }

    #[test]
    fn what_is_not_read_is_named() {
        let settings = json!({
            "validation": {"minDistance": -1, "maxJerk": 3, "maxAccelerationXY": 4},
            "geofence": {"maxDistance": 200, "polygons": [{"points": []}]},
        });
        let rules = ShowRules::read(&settings, 1.0, true);
        assert_eq!(rules.min_distance_m, None);
        for expected in ["minDistance", "maxJerk", "maxAccelerationXY", "maxDistance", "polygon 1"] {
            assert!(rules.not_judged.iter().any(|what| what.contains(expected)), "{expected}: {:?}", rules.not_judged);
        }
    }

    #[test]
    fn yaw_counts_from_take_off_and_must_be_in_order() {
        let mut rules = ShowRules::default();
        rules.read_yaw("a", &json!({"version": 1, "setpoints": [[0, 0], [2, 90]]}), 5.0);
        rules.read_yaw("b", &json!({"autoYaw": true, "setpoints": []}), 0.0);
        rules.read_yaw("c", &json!({"setpoints": [[2, 0], [2, 90]]}), 0.0);
        assert_eq!(rules.yaw.get("a"), Some(&vec![[5.0, 0.0], [7.0, 90.0]]));
        assert_eq!((rules.yaw.len(), rules.not_judged.len()), (1, 1));
    }
}
