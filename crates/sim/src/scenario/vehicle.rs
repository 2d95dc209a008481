//! `[vehicle]` of the scenario file: the model of the vehicles.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::document::is_default;
use super::error::{ErrorKind, ScenarioError, entry_key, suggest};
use super::files;
use super::spec::{PlantSpec, Scenario, Space};
use crate::vehicle::{self, Airframe, Fleet, Ground, Heading, MODELS, Model, Quadrotor, Unicycle};
use tautline_core::obstacle::{Obstacle, Shape};
use tautline_core::swarm::row;

const MODEL: &str = "vehicle.model";
const POINT: &str = "point";
const UNICYCLE: &str = "unicycle";

/// Model of the vehicles.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct VehicleTable {
    /// Model of the vehicles; `point` unless given. `point` executes accelerations exactly; `unicycle` moves along its
    /// heading and cannot stop. A quadrotor is `crazyflie`, `crazyflie-brushless`, `hummingbird`, the path of a TOML
    /// file with a model, or a table with the keys of a model.
    model: ModelKey,
    /// Rate of the attitude loop of quadrotors in Hz, at most once per step; 500 unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    attitude_hz: Option<f64>,
    /// Natural frequency of the attitude loop in rad/s; that of the model unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    attitude_rad_s: Option<f64>,
    /// Damping ratio of the attitude loop; that of the model unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    attitude_damping: Option<f64>,
    /// Whether the thrust of quadrotors grows near the ground, which is a half-space among the obstacles; false unless
    /// given.
    #[serde(skip_serializing_if = "Option::is_none")]
    ground_effect: Option<bool>,
    /// Whether the downwash of quadrotors acts on vehicles below; false unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    downwash: Option<bool>,
    /// Smallest speed of unicycles in m/s, more than 0; 0.2 unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    min_speed_m_s: Option<f64>,
    /// Largest speed of unicycles in m/s; 3 unless given. If it equals the smallest speed, the speed is constant.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    max_speed_m_s: Option<f64>,
    /// Largest turn rate of unicycles in rad/s; 2 unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    max_turn_rad_s: Option<f64>,
    /// Largest acceleration of unicycles along their heading in m/s^2; 2 unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    max_accel_m_s2: Option<f64>,
    /// Drag of points over mass in 1/s, linear in the velocity relative to the air; 0 unless given. In a wind W,
    /// p'' = a22 v + u + drag (W - v). The drag of quadrotors is part of their model.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("minimum" = 0))]
    pub(super) drag_per_s: f64,
}

/// Model by name, by file, or with all of its keys.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
enum ModelKey {
    /// Name of a built-in model, or path of a file.
    Named(String),
    /// Keys of the model.
    Given(Box<Model>),
}

impl Default for ModelKey {
    fn default() -> Self {
        Self::Named(POINT.to_owned())
    }
}

impl VehicleTable {
    /// Reads the file of a model, named relative to a folder.
    pub(super) fn resolve_path(&mut self, folder: &Path) -> Result<(), ScenarioError> {
        if let ModelKey::Named(name) = &self.model
            && name.contains(['/', '\\', '.'])
        {
            self.model = ModelKey::Given(Box::new(read(&folder.join(name))?));
        }
        Ok(())
    }

    /// Returns whether vehicles are points.
    pub(super) fn is_point(&self) -> bool {
        matches!(&self.model, ModelKey::Named(name) if name == POINT)
    }

    /// Returns the airframe that the table describes.
    pub(super) fn airframe(&self) -> Result<Airframe, ScenarioError> {
        match &self.model {
            ModelKey::Named(name) if name == POINT => {
                self.without_rotors("a point")?;
                self.without_limits("a point")?;
                Ok(Airframe::Point)
            }
            ModelKey::Named(name) if name == UNICYCLE => {
                self.without_rotors("a unicycle")?;
                Ok(Airframe::Unicycle(self.unicycle()))
            }
            _ => {
                self.without_limits("a quadrotor")?;
                self.quadrotor()
            }
        }
    }

    fn unicycle(&self) -> Unicycle {
        let Unicycle { min_speed_m_s, max_speed_m_s, max_turn_rad_s, max_accel_m_s2 } = Unicycle::default();
        Unicycle {
            min_speed_m_s: self.min_speed_m_s.unwrap_or(min_speed_m_s),
            max_speed_m_s: self.max_speed_m_s.unwrap_or(max_speed_m_s),
            max_turn_rad_s: self.max_turn_rad_s.unwrap_or(max_turn_rad_s),
            max_accel_m_s2: self.max_accel_m_s2.unwrap_or(max_accel_m_s2),
        }
    }

    fn quadrotor(&self) -> Result<Airframe, ScenarioError> {
        let mut model = match &self.model {
            ModelKey::Given(model) => Model::clone(model),
            ModelKey::Named(name) => {
                let known = MODELS.map(|(known, _)| known);
                vehicle::built_in(name).ok_or_else(|| {
                    let known: Vec<_> = [POINT, UNICYCLE].into_iter().chain(known).collect();
                    let help = format!("{}; for another model give the path of a TOML file", suggest(name, &known));
                    let problem = format!("no model has the name `{name}`");
                    ErrorKind::UnknownChoice.at(&[MODEL], problem, help)
                })?
            }
        };
        let of_model = (model.attitude_rad_s, model.attitude_damping);
        model.attitude_rad_s = self.attitude_rad_s.unwrap_or(model.attitude_rad_s);
        model.attitude_damping = self.attitude_damping.unwrap_or(model.attitude_damping);
        if (model.attitude_rad_s, model.attitude_damping) != of_model {
            // Measured with another attitude loop.
            model.tracking = None;
        }
        Ok(Airframe::Quadrotor(Box::new(Quadrotor {
            model,
            attitude_hz: self.attitude_hz.unwrap_or(DEFAULT_ATTITUDE_HZ),
            ground_effect: self.ground_effect.unwrap_or_default(),
            downwash: self.downwash.unwrap_or_default(),
        })))
    }

    /// Refuses the keys of quadrotors.
    fn without_rotors(&self, what: &str) -> Result<(), ScenarioError> {
        let given = [
            ("vehicle.attitude_hz", self.attitude_hz.is_some()),
            ("vehicle.attitude_rad_s", self.attitude_rad_s.is_some()),
            ("vehicle.attitude_damping", self.attitude_damping.is_some()),
            ("vehicle.ground_effect", self.ground_effect.is_some()),
            ("vehicle.downwash", self.downwash.is_some()),
        ];
        refuse_given(given, &format!("{what} has neither attitude nor rotors"), "a quadrotor such as \"crazyflie\"")
    }

    /// Refuses the keys of unicycles.
    fn without_limits(&self, what: &str) -> Result<(), ScenarioError> {
        let given = [
            ("vehicle.min_speed_m_s", self.min_speed_m_s.is_some()),
            ("vehicle.max_speed_m_s", self.max_speed_m_s.is_some()),
            ("vehicle.max_turn_rad_s", self.max_turn_rad_s.is_some()),
            ("vehicle.max_accel_m_s2", self.max_accel_m_s2.is_some()),
        ];
        refuse_given(given, &format!("{what} has no such limit"), "\"unicycle\"")
    }
}

/// Refuses the first given key that the model does not use.
fn refuse_given<const N: usize>(
    keys: [(&'static str, bool); N],
    said: &str,
    other_model: &str,
) -> Result<(), ScenarioError> {
    let Some((key, _)) = keys.into_iter().find(|(_, is_given)| *is_given) else { return Ok(()) };
    let help = format!("leave this key out, or set vehicle.model to {other_model}");
    Err(ErrorKind::UnsupportedByVehicle.at(&[key, MODEL], said, help))
}

/// Converts the airframe back: a built-in model to its name, any other model to its keys.
impl From<&Scenario> for VehicleTable {
    fn from(scenario: &Scenario) -> Self {
        let drag_per_s = scenario.drag_per_s;
        let quadrotor = match &scenario.airframe {
            Airframe::Point => return Self { drag_per_s, ..Self::default() },
            Airframe::Unicycle(unicycle) => return Self { drag_per_s, ..Self::from(unicycle) },
            Airframe::Quadrotor(quadrotor) => quadrotor,
        };
        let model = &quadrotor.model;
        let built_in = MODELS.iter().filter_map(|(name, text)| Some((*name, vehicle::read(name, text).ok()?)));
        let is_it = |(_, other): &(&str, Model)| {
            let (attitude_rad_s, attitude_damping) = (model.attitude_rad_s, model.attitude_damping);
            let is_same_loop = (attitude_rad_s, attitude_damping) == (other.attitude_rad_s, other.attitude_damping);
            // Another attitude loop drops the measured tracking error.
            let tracking = other.tracking.clone().filter(|_| is_same_loop);
            Model { attitude_rad_s, attitude_damping, tracking, ..other.clone() } == *model
        };
        let name = built_in.into_iter().find(is_it).map(|(name, _)| name.to_owned());
        Self {
            model: name.map_or_else(|| ModelKey::Given(Box::new(model.clone())), ModelKey::Named),
            attitude_hz: Some(quadrotor.attitude_hz),
            attitude_rad_s: Some(model.attitude_rad_s),
            attitude_damping: Some(model.attitude_damping),
            ground_effect: Some(quadrotor.ground_effect),
            downwash: Some(quadrotor.downwash),
            drag_per_s,
            ..Self::default()
        }
    }
}

impl From<&Unicycle> for VehicleTable {
    fn from(unicycle: &Unicycle) -> Self {
        Self {
            model: ModelKey::Named(UNICYCLE.to_owned()),
            min_speed_m_s: Some(unicycle.min_speed_m_s),
            max_speed_m_s: Some(unicycle.max_speed_m_s),
            max_turn_rad_s: Some(unicycle.max_turn_rad_s),
            max_accel_m_s2: Some(unicycle.max_accel_m_s2),
            ..Self::default()
        }
    }
}

/// Reads the file of a model.
fn read(path: &Path) -> Result<Model, ScenarioError> {
    let shown = path.display().to_string();
    let text = String::from_utf8(files::bytes(path, MODEL)?)
        .map_err(|_| ErrorKind::File.at(&[MODEL], format!("{shown} is not UTF-8"), "save the file as UTF-8 text"))?;
    vehicle::read(&shown, &text)
}

/// Default rate of the attitude loop \[Hz\].
pub const DEFAULT_ATTITUDE_HZ: f64 = 500.0;
/// Default step of quadrotors \[s\].
pub const QUADROTOR_DT_S: f64 = 1.0 / 500.0;
/// Default rate of commands to quadrotors \[Hz\].
pub const QUADROTOR_CONTROL_HZ: f64 = 100.0;

/// Relative rounding by which a step may exceed a period.
const ROUNDING: f64 = 1e-6;

impl Scenario {
    /// Returns the quadrotors at the start, trimmed for hover; `None` for other vehicles.
    #[must_use]
    pub fn fleet(&self) -> Option<Fleet> {
        let ground = |obstacle: &Obstacle| match obstacle.shape {
            Shape::HalfSpace { normal } => Some(Ground { place_m: obstacle.place_m, normal: normal.normalize() }),
            _ => None,
        };
        let grounds: Vec<_> = self.obstacles.iter().filter_map(ground).collect();
        let fleet = Fleet::trimmed(self.airframe.quadrotor()?, &grounds, &self.start, self.space == Space::Plane);
        let fleet = fleet.with_failures(self.rotor_failures());
        Some(if self.wind.is_still() { fleet } else { fleet.with_wind(self.air()) })
    }

    /// Sets the airframe of all vehicles, and the mass, hull and default rates that belong to it. Quadrotors have no
    /// point drag.
    pub fn set_airframe(&mut self, airframe: Airframe) {
        if let Some(quadrotor) = airframe.quadrotor() {
            self.mass_kg.fill(quadrotor.model.mass_kg);
            self.hull_radius_m.fill(quadrotor.model.hull_radius_m);
            self.a22_per_s = 0.0;
            self.time.dt_s = QUADROTOR_DT_S;
            self.time.control_hz = Some(QUADROTOR_CONTROL_HZ);
        }
        self.airframe = airframe;
    }

    /// Checks that the airframe can be flown and that steps resolve the attitude loop.
    pub(super) fn check_airframe(&self) -> Result<(), ScenarioError> {
        self.check_unicycle()?;
        let Some(Quadrotor { model, attitude_hz, .. }) = self.airframe.quadrotor() else { return Ok(()) };
        let refuse = |error: ScenarioError| {
            let own = match &*error.keys[0] {
                "attitude_rad_s" => "vehicle.attitude_rad_s",
                "attitude_damping" => "vehicle.attitude_damping",
                _ => "vehicle.model",
            };
            let keys = [own, "vehicle.attitude_damping", "vehicle.model"];
            ScenarioError { keys: keys.map(str::to_owned).to_vec(), ..error }
        };
        model.check().map_err(refuse)?;
        if attitude_hz * self.time.dt_s > 1.0 + ROUNDING {
            let problem =
                format!("an attitude loop of {attitude_hz} Hz runs more than once in a step of {} s", self.time.dt_s);
            let help = format!(
                "reduce vehicle.attitude_hz to at most {}, or time.dt_s to at most {}",
                1.0 / self.time.dt_s,
                1.0 / attitude_hz
            );
            return Err(ErrorKind::StepTooLong.at(&["vehicle.attitude_hz", "time.dt_s"], problem, help));
        }
        model.check_attitude(0.5 / attitude_hz).map_err(|error| refuse(error).at(&["vehicle.attitude_hz"]))
    }
}

/// Relative rounding by which the speed at the start may exceed a limit.
const SPEED_ROUNDING: f64 = 1e-9;

impl Scenario {
    /// Checks the limits of unicycles, and that their start in the plane satisfies them.
    pub(super) fn check_unicycle(&self) -> Result<(), ScenarioError> {
        let Some(unicycle) = self.airframe.unicycle() else { return Ok(()) };
        let Unicycle { min_speed_m_s, max_speed_m_s, .. } = *unicycle;
        if min_speed_m_s > max_speed_m_s {
            let problem =
                format!("the smallest speed must be at most the largest, {max_speed_m_s} m/s, got {min_speed_m_s} m/s");
            let help = "reduce vehicle.min_speed_m_s, or enlarge vehicle.max_speed_m_s";
            return Err(ErrorKind::Inconsistent.at(&["vehicle.min_speed_m_s", "vehicle.max_speed_m_s"], problem, help));
        }
        if self.space != Space::Plane {
            let problem = "unicycles need the plane z = 0, but the swarm has three dimensions";
            let help = "set every z to 0 and swarm.dimensions to 2, or fly another vehicle.model";
            return Err(ErrorKind::Plane.at(&["vehicle.model", "swarm.dimensions"], problem, help));
        }
        if !matches!(self.plant, PlantSpec::Rapier) {
            let problem = "the ideal plant does not support unicycles";
            let help = "leave out plant.kind: the motion of a unicycle is solved in closed form";
            return Err(ErrorKind::UnsupportedByPlant.at(&["plant.kind", "vehicle.model"], problem, help));
        }
        if self.a22_per_s != 0.0 {
            let problem = "a unicycle has no velocity coefficient a22";
            let help = "leave out swarm.a22_per_s";
            return Err(ErrorKind::UnsupportedByVehicle.at(&["swarm.a22_per_s", "vehicle.model"], problem, help));
        }
        if self.drag_per_s != 0.0 || !self.wind.is_still() {
            let key = if self.drag_per_s == 0.0 { "wind" } else { "vehicle.drag_per_s" };
            let problem = "wind and drag do not act on unicycles";
            let help = "leave out [wind] and vehicle.drag_per_s, or fly another vehicle.model";
            return Err(ErrorKind::UnsupportedByVehicle.at(&[key, "vehicle.model"], problem, help));
        }
        for i in 0..self.count() {
            let speed_m_s = Heading::of(row(&self.start.velocities_m_s, i)).speed_m_s;
            let (least, most) = (min_speed_m_s * (1.0 - SPEED_ROUNDING), max_speed_m_s * (1.0 + SPEED_ROUNDING));
            if !(least..=most).contains(&speed_m_s) {
                let problem = format!(
                    "the start speed of vehicle {} must be {min_speed_m_s} to {max_speed_m_s} m/s, got {speed_m_s} m/s",
                    i + 1
                );
                let help = "give start.velocities_m_s, a velocity for each vehicle, or change the limits of its speed";
                let start = entry_key("start.velocities_m_s", i);
                let keys = [&*start, "vehicle.min_speed_m_s", "vehicle.model"];
                return Err(ErrorKind::OutOfRange.at(&keys, problem, help));
            }
        }
        Ok(())
    }
}
