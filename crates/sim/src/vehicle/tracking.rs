//! Measured tracking error of a quadrotor, an assumption of the shield.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::dynamics::{LEAST_LIFT, THRUST_RESERVE};
use super::model::{GRAVITY_M_S2, Model};
use crate::scenario::{DEFAULT_ATTITUDE_HZ, QUADROTOR_DT_S};
use tautline_core::record::sha256_hex;

/// Distance of a quadrotor to the reference of a shield, with the conditions under which it was measured: the table
/// `[tracking]` of a model. `tautline check --identify` measures it. It is an assumption, not a proved bound.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tracking {
    /// Assumed bound on the distance to the reference in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub error_m: f64,
    /// Largest command in m/s^2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub accel_m_s2: f64,
    /// Push in m/s^2 from which the shield computes the share of commands reserved for feedback.
    #[schemars(extend("minimum" = 0))]
    pub disturbance_m_s2: f64,
    /// Largest speed of the reference in m/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_speed_m_s: f64,
    /// Gain of the tracker in 1/s^2 on the distance to the reference.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub tracker_per_s2: f64,
    /// Gain of the tracker in 1/s on the velocity relative to the reference.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub tracker_per_s: f64,
    /// Rate of held commands in Hz.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub control_hz: f64,
    /// Rate of the attitude loop in Hz.
    #[serde(default = "attitude_hz")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub attitude_hz: f64,
    /// Longest step of the simulation in s.
    #[serde(default = "dt_s")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub dt_s: f64,
    /// Fastest wind in m/s.
    #[schemars(extend("minimum" = 0))]
    pub wind_m_s: f64,
    /// Error of the measured own position in m.
    #[schemars(extend("minimum" = 0))]
    pub position_error_m: f64,
    /// Error of the measured own velocity in m/s.
    #[schemars(extend("minimum" = 0))]
    pub velocity_error_m_s: f64,
    /// Search that measured the error. A table without a search is an assumption of its author.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "TrackingSearch")]
    pub search: Option<TrackingSearch>,
}

fn attitude_hz() -> f64 {
    DEFAULT_ATTITUDE_HZ
}

fn dt_s() -> f64 {
    QUADROTOR_DT_S
}

/// Search for the largest tracking error of a model.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrackingSearch {
    /// Number of flights of the search.
    #[schemars(extend("minimum" = 1))]
    pub flights: u64,
    /// Largest distance to the reference that the search found in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub largest_error_m: f64,
    /// Factor from the largest error to `error_m`, at least 1.
    #[schemars(extend("minimum" = 1))]
    pub margin: f64,
    /// Numbers of dimensions in which the model flew: 2 for the plane z = 0, 3 for space. In others the table is an
    /// assumption.
    pub dimensions: Vec<usize>,
    /// Fingerprint of the model that flew and of all numbers of its table. An edited table is an assumption, and so is
    /// that of another model.
    pub model: String,
}

/// Relative rounding of `error_m` over its product.
const ROUNDING: f64 = 1e-9;
/// Number of hexadecimal digits of a fingerprint.
const FINGERPRINT_DIGITS: usize = 16;

impl TrackingSearch {
    /// Returns why the search does not support a bound \[m\].
    pub(super) fn contradiction(&self, error_m: f64) -> Option<String> {
        let &Self { largest_error_m, margin, .. } = self;
        let needed_m = margin * largest_error_m;
        let is_covered = needed_m > 0.0 && needed_m <= error_m * (1.0 + ROUNDING);
        (!is_covered).then(|| {
            format!("tracking.error_m is {error_m}, not at least {margin} times the largest error {largest_error_m}")
        })
    }
}

impl Model {
    /// Returns the fingerprint of a measurement: of all keys of the model and of its table `[tracking]`, without the
    /// name and the fingerprint itself.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let mut keys = Self { name: String::new(), ..self.clone() };
        if let Some(search) = keys.tracking.as_mut().and_then(|tracking| tracking.search.as_mut()) {
            search.model.clear();
        }
        let mut digits = sha256_hex(toml::to_string(&keys).unwrap_or_default());
        digits.truncate(FINGERPRINT_DIGITS);
        digits
    }

    /// Returns the search that measured this very table with this very model; `None` for a table without a search, with
    /// an edited number, or of another model.
    #[must_use]
    pub fn tracking_search(&self) -> Option<&TrackingSearch> {
        let search = self.tracking.as_ref()?.search.as_ref()?;
        (search.model == self.fingerprint()).then_some(search)
    }

    /// Returns the largest acceleration \[m/s^2\] that lift and thrust allow in every direction. In the plane the
    /// rotors carry the weight, and the rest of the thrust accelerates sideways.
    #[must_use]
    pub fn most_accel_m_s2(&self, is_plane: bool) -> f64 {
        let thrust_m_s2 = (1.0 - THRUST_RESERVE) * self.most_thrust_n() / self.mass_kg;
        if is_plane {
            return (thrust_m_s2.powi(2) - GRAVITY_M_S2.powi(2)).max(0.0).sqrt();
        }
        (thrust_m_s2 - GRAVITY_M_S2).clamp(0.0, (1.0 - LEAST_LIFT) * GRAVITY_M_S2)
    }

    /// Returns the drag of the rotors over mass in level hover \[1/s\].
    #[must_use]
    pub fn hover_drag_per_s(&self) -> f64 {
        self.rotor_drag_n_s_m[0].max(self.rotor_drag_n_s_m[1]) / self.mass_kg
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::{MODELS, read};
    use super::{Model, Tracking, TrackingSearch};

    #[test]
    fn built_in_tables_have_their_fingerprints() {
        for (name, text) in MODELS {
            let model = read(name, text).expect("a model");
            let search = model.tracking.as_ref().and_then(|tracking| tracking.search.as_ref()).expect("a search");
            assert_eq!(search.model, model.fingerprint(), "tracking.search.model of {name}");
        }
    }

    #[test]
    fn a_fingerprint_covers_each_number_of_the_table_and_of_its_search() {
        let changes: [fn(&mut Tracking); 12] = [
            |table| table.error_m *= 2.0,
            |table| table.accel_m_s2 *= 2.0,
            |table| table.disturbance_m_s2 *= 0.5,
            |table| table.max_speed_m_s *= 2.0,
            |table| table.tracker_per_s2 *= 2.0,
            |table| table.tracker_per_s *= 2.0,
            |table| table.control_hz *= 2.0,
            |table| table.attitude_hz *= 0.5,
            |table| table.dt_s *= 2.0,
            |table| table.wind_m_s *= 2.0,
            |table| table.position_error_m += 0.1,
            |table| table.velocity_error_m_s += 0.1,
        ];
        let of_search: [fn(&mut TrackingSearch); 4] = [
            |search| search.flights += 1,
            |search| search.largest_error_m *= 0.5,
            |search| search.margin *= 0.9,
            |search| search.dimensions = vec![2, 3],
        ];
        let model = read(MODELS[0].0, MODELS[0].1).expect("a model");
        assert!(model.tracking_search().is_some());
        let edited = |change: &dyn Fn(&mut Tracking)| {
            let mut edited = model.clone();
            change(edited.tracking.as_mut().expect("a table"));
            edited
        };
        let unsearched: Vec<Model> = (changes.iter().map(|change| edited(change)))
            .chain(of_search.iter().map(|change| edited(&|table| change(table.search.as_mut().expect("a search")))))
            .collect();
        assert!(unsearched.iter().all(|model| model.tracking_search().is_none()));
        let renamed = Model { name: "own".to_owned(), ..model };
        assert!(renamed.tracking_search().is_some());
    }

    #[test]
    fn acceleration_in_every_direction_is_limited_by_climb_or_sinking() {
        let most = MODELS.map(|(name, text)| {
            let model = read(name, text).expect("a model");
            [false, true].map(|is_plane| (model.most_accel_m_s2(is_plane) * 100.0).round() / 100.0)
        });
        // 0.9 T/m - g climbs; 0.7 g sinks; sqrt((0.9 T/m)^2 - g^2) sideways.
        assert_eq!(most, [[3.36, 8.79], [6.78, 13.38], [6.86, 28.53]]);
    }
}
