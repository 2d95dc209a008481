//! Parameters of a quadrotor, and their checks.

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::rotors::Mixer;
use super::tracking::Tracking;
use crate::scenario::{ErrorKind, ScenarioError, TomlSchema};
use tautline_core::failure::Place;
use tautline_core::option::IDENTIFY;

/// Standard acceleration of gravity \[m/s^2\]. Some published models use 9.8 or 9.81.
pub const GRAVITY_M_S2: f64 = 9.80665;

/// Model of a quadrotor: the keys of a TOML file. The files of the built-in models are examples.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Name of the model.
    pub name: String,
    /// Mass in kg.
    pub mass_kg: f64,
    /// Moments of inertia about the body axes in kg m^2, rotors included.
    pub inertia_kg_m2: [f64; 3],
    /// Radius of a ball around the hull, propellers included, in m.
    pub hull_radius_m: f64,
    /// Positions of the rotors relative to the centre of mass, x ahead and y to the left, in m.
    pub rotor_positions_m: [[f64; 2]; 4],
    /// Direction of rotation of each rotor, seen from above.
    pub rotor_turns: [RotorDirection; 4],
    /// Radius of a rotor in m.
    pub rotor_radius_m: f64,
    /// Coefficient a of the thrust a n^2 + b n of a rotor in N, with n in revolutions per minute.
    pub thrust_n_per_rpm2: f64,
    /// Coefficient b of the thrust a n^2 + b n of a rotor; 0 unless given.
    #[serde(default)]
    pub thrust_n_per_rpm: f64,
    /// Largest thrust of a rotor in N.
    pub max_thrust_n: f64,
    /// Reaction torque of a rotor over its thrust, in m.
    pub torque_per_thrust_m: f64,
    /// Time constant of a rotor's speed when it increases, in s.
    pub lag_up_s: f64,
    /// Time constant of a rotor's speed when it decreases, in s.
    pub lag_down_s: f64,
    /// Drag coefficient of all rotors in hover along the body axes in N s/m; that of a rotor is proportional to its
    /// speed.
    #[serde(default)]
    pub rotor_drag_n_s_m: [f64; 3],
    /// Drag coefficient of the body along its axes in N s^2/m^2, for the square of the speed.
    #[serde(default)]
    pub parasitic_drag_n_s2_m2: [f64; 3],
    /// Coefficient k of the ground effect: the thrust has the factor 1 + k (r/4h)^2 at a height h above a ground.
    #[serde(default)]
    pub ground_effect: f64,
    /// Natural frequency of the attitude loop in rad/s.
    pub attitude_rad_s: f64,
    /// Damping ratio of the attitude loop.
    pub attitude_damping: f64,
    /// Measured distance to the reference of a shield, an assumption.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Tracking")]
    pub tracking: Option<Tracking>,
}

/// Direction of rotation of a rotor, seen from above.
#[derive(Clone, Copy, Debug, Deserialize, Eq, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RotorDirection {
    /// Counterclockwise; the reaction turns the body clockwise.
    Ccw,
    /// Clockwise; the reaction turns the body counterclockwise.
    Cw,
}

/// Quadrotor with the options of a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Quadrotor {
    /// Parameters of the quadrotor.
    pub model: Model,
    /// Rate of its attitude loop \[Hz\].
    pub attitude_hz: f64,
    /// Whether thrust grows near the ground, which is a half-space among the obstacles.
    pub ground_effect: bool,
    /// Whether downwash acts on vehicles below.
    pub downwash: bool,
}

impl RotorDirection {
    /// Returns the sign of the rotor's reaction torque on the body about z.
    pub(super) fn reaction(self) -> f64 {
        match self {
            Self::Ccw => -1.0,
            Self::Cw => 1.0,
        }
    }
}

impl Model {
    /// Returns the largest thrust of all rotors \[N\].
    #[must_use]
    pub fn most_thrust_n(&self) -> f64 {
        4.0 * self.max_thrust_n
    }

    /// Returns the weight \[N\].
    #[must_use]
    pub fn weight_n(&self) -> f64 {
        self.mass_kg * GRAVITY_M_S2
    }

    /// Returns the longer of a rotor's two time constants \[s\].
    #[must_use]
    pub fn lag_s(&self) -> f64 {
        self.lag_up_s.max(self.lag_down_s)
    }
}

/// Built-in models: names and texts of their files.
pub const MODELS: [(&str, &str); 3] = [
    ("crazyflie", embedded!("vehicles/crazyflie.toml")),
    ("crazyflie-brushless", embedded!("vehicles/crazyflie-brushless.toml")),
    ("hummingbird", embedded!("vehicles/hummingbird.toml")),
];

/// Reads and checks a model; `name` is the source in messages.
///
/// # Errors
/// [`ScenarioError`] with its place if the text is not TOML, has a missing or unknown key, or the model is invalid.
pub fn read(name: &str, text: &str) -> Result<Model, ScenarioError> {
    static KEYS: LazyLock<TomlSchema> = LazyLock::new(TomlSchema::of::<Model>);
    let locate = |span| Place::new(name, text, span);
    let read = || {
        let not_toml = |error: toml::de::Error| {
            let help = "a model has the keys of the built-in ones, which docs/scenario.md lists";
            ErrorKind::File.at(&[], error.message(), help).with_place(locate(error.span().unwrap_or_default()))
        };
        let keys = DeTable::parse(text).map_err(not_toml)?;
        let mut file = Spanned::new(0..0, DeValue::Table(keys.get_ref().clone()));
        KEYS.check("model", &mut file, &locate)?;
        let model: Model = toml::from_str(text).map_err(not_toml)?;
        model.check().map_err(|error| {
            let span = error.keys.first().and_then(|key| Some(keys.get_ref().get(&**key)?.span()));
            error.with_place(locate(span.unwrap_or_default()))
        })?;
        Ok(model)
    };
    read().map_err(|error: ScenarioError| ScenarioError { kind: ErrorKind::File, ..error })
}

/// Returns the built-in model with a name.
#[must_use]
pub fn built_in(name: &str) -> Option<Model> {
    let (name, text) = MODELS.iter().find(|(known, _)| *known == name)?;
    read(name, text).ok()
}

/// Smallest and largest magnitude of a positive number of a model, in its unit.
const BOUNDS: (f64, f64) = (1e-12, 1e6);

impl Model {
    /// Checks that a model can fly: positive numbers, a possible inertia, and rotors that lift it, turn it about every
    /// axis and are fast enough for its attitude loop.
    ///
    /// # Errors
    /// [`ScenarioError`] for the first violated condition, with its key of the model.
    pub fn check(&self) -> Result<(), ScenarioError> {
        self.check_numbers()?;
        self.check_body()?;
        if self.most_thrust_n() <= self.weight_n() {
            return Err(ErrorKind::Inconsistent.at(
                &["max_thrust_n"],
                format!(
                    "the largest thrust of four rotors is {} N, not more than the weight of {:.6} N",
                    self.most_thrust_n(),
                    self.weight_n()
                ),
                format!("give more than {:.6} N per rotor", 0.25 * self.weight_n()),
            ));
        }
        if Mixer::new(self).is_none() {
            return Err(ErrorKind::Inconsistent.at(
                &["rotor_positions_m"],
                "the rotors cannot lift, roll, pitch and yaw the vehicle independently",
                "place them around the centre of mass, two of the four turning each way",
            ));
        }
        self.check_attitude(0.0)
    }

    /// Checks that the attitude loop is stable with a mean delay of `wait_s`. With a lag tau the characteristic
    /// polynomial is tau s^3 + s^2 + 2 zeta omega s + omega^2.
    ///
    /// # Errors
    /// [`ScenarioError`] with the inequality.
    pub fn check_attitude(&self, wait_s: f64) -> Result<(), ScenarioError> {
        let (zeta, omega, lag_s) = (self.attitude_damping, self.attitude_rad_s, self.lag_s() + wait_s);
        if 2.0 * zeta > omega * lag_s {
            return Ok(());
        }
        Err(ErrorKind::Inconsistent.at(
            &["attitude_rad_s"],
            format!(
                "the attitude loop is unstable. It needs 2 zeta > omega tau, got 2 * {zeta} <= {omega} rad/s * {lag_s} \
                 s (lag of the rotors and half a period of the loop)"
            ),
            format!("set attitude_rad_s to about {:.3}, which is 0.4/tau, and attitude_damping to 1", 0.4 / lag_s),
        ))
    }

    fn check_numbers(&self) -> Result<(), ScenarioError> {
        if self.name.trim().is_empty() {
            return Err(ErrorKind::Inconsistent.at(&["name"], "the name is empty", "name the model"));
        }
        let [jx, jy, jz] = self.inertia_kg_m2;
        let positive = [
            ("mass_kg", self.mass_kg),
            ("inertia_kg_m2", jx),
            ("inertia_kg_m2", jy),
            ("inertia_kg_m2", jz),
            ("hull_radius_m", self.hull_radius_m),
            ("rotor_radius_m", self.rotor_radius_m),
            ("thrust_n_per_rpm2", self.thrust_n_per_rpm2),
            ("max_thrust_n", self.max_thrust_n),
            ("torque_per_thrust_m", self.torque_per_thrust_m),
            ("lag_up_s", self.lag_up_s),
            ("lag_down_s", self.lag_down_s),
            ("attitude_rad_s", self.attitude_rad_s),
            ("attitude_damping", self.attitude_damping),
        ];
        let (least, most) = BOUNDS;
        if let Some((key, number)) = positive.into_iter().find(|(_, number)| !(least..=most).contains(number)) {
            let help = format!("it must be from {least:e} to {most:e}");
            return Err(ErrorKind::Inconsistent.at(&[key], format!("{key} is {number}"), help));
        }
        let from_zero = self.rotor_drag_n_s_m.map(|drag| ("rotor_drag_n_s_m", drag));
        let squared = self.parasitic_drag_n_s2_m2.map(|drag| ("parasitic_drag_n_s2_m2", drag));
        let mut from_zero = from_zero.into_iter().chain(squared).chain([("ground_effect", self.ground_effect)]);
        if let Some((key, number)) = from_zero.find(|(_, number)| !(0.0..=most).contains(number)) {
            let help = format!("it must be from 0 to {most:e}");
            return Err(ErrorKind::Inconsistent.at(&[key], format!("{key} is {number}"), help));
        }
        let of_search = |tracking: &Tracking| tracking.search.as_ref()?.contradiction(tracking.error_m);
        if let Some(problem) = self.tracking.as_ref().and_then(of_search) {
            let command = format!("tautline check {}", IDENTIFY.argument());
            let help = format!("measure the table with `{command}`, or leave out tracking.search");
            return Err(ErrorKind::Inconsistent.at(&["tracking"], problem, help));
        }
        let places = self.rotor_positions_m.iter().flatten().map(|&place| ("rotor_positions_m", place));
        let mut others = places.chain([("thrust_n_per_rpm", self.thrust_n_per_rpm)]);
        match others.find(|(_, number)| !(-most..=most).contains(number)) {
            Some((key, number)) => {
                Err(ErrorKind::Inconsistent.at(&[key], format!("{key} is {number}"), "give a finite number"))
            }
            None => Ok(()),
        }
    }

    /// Checks that no moment of inertia exceeds the sum of the other two, as for any mass distribution.
    fn check_body(&self) -> Result<(), ScenarioError> {
        let [x, y, z] = self.inertia_kg_m2;
        let Some((largest, rest)) = [(x, y + z), (y, x + z), (z, x + y)].into_iter().find(|(one, rest)| one > rest)
        else {
            return Ok(());
        };
        Err(ErrorKind::Inconsistent.at(
            &["inertia_kg_m2"],
            format!("a moment of inertia of {largest:e} kg m^2 is more than the other two together, {rest:e} kg m^2"),
            "reduce it: each is at most the sum of the other two",
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_model_is_valid_and_has_its_name() {
        for (name, text) in MODELS {
            assert_eq!(read(name, text).expect("a model").name, name);
        }
    }

    #[test]
    fn errors_of_a_model_have_their_place() {
        let (_, text) = MODELS[0];
        for (before, after, said) in [
            ("mass_kg = 0.0328", "mass_kg = -1.0", "mass_kg is -1"),
            ("16.8e-6, 16.8e-6, 29.8e-6", "16.8e-6, -16.8e-6, 29.8e-6", "inertia_kg_m2 is -0.0000168"),
            ("16.8e-6, 16.8e-6, 29.8e-6", "16.8e-6, 16.8e-6, 39.8e-6", "more than the other two together"),
            ("max_thrust_n = 0.12", "max_thrust_n = 0.08", "not more than the weight of 0.321658 N"),
            ("attitude_rad_s = 6.0", "attitude_rad_s = 31.0", "2 zeta > omega tau"),
            ("\"ccw\", \"cw\", \"ccw\", \"cw\"", "\"cw\", \"cw\", \"cw\", \"cw\"", "independently"),
            ("lag_up_s = 0.065", "lag_up_s = nan", "`lag_up_s` must be a finite number, got nan"),
            ("ground_effect = 11", "ground_effects = 11", "unknown key `ground_effects`"),
        ] {
            let wrong = text.replace(before, after);
            assert_ne!(wrong, text, "{before}");
            let error = read("wrong.toml", &wrong).expect_err(after);
            assert!(error.message.contains(said), "{}", error.message);
            let key = after.split(' ').next().unwrap_or_default();
            let span = error.place.expect("a place").span;
            let line = &wrong[..span.end];
            let line = &line[line.rfind('\n').map_or(0, |end| end + 1)..];
            assert!(span.start > 0 && (line.contains(key) || !after.contains('=')), "{after}: {line}");
        }
    }
}
