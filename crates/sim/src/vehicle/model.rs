//! The numbers of a quadrotor.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Standard acceleration of gravity \[m/s^2\]. Some published models use 9.8 or 9.81.
pub const GRAVITY_M_S2: f64 = 9.80665;

/// A quadrotor: what its file in TOML holds, for which the files of the built-in models are patterns.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// What it is called.
    pub name: String,
    /// Mass in kg.
    pub mass_kg: f64,
    /// Moments of inertia about the body's axes in kg m^2, rotors included.
    pub inertia_kg_m2: [f64; 3],
    /// Radius of the ball that stands for the hull, propellers included, in m.
    pub hull_radius_m: f64,
    /// Where the rotors are from the centre of mass, x ahead and y to the left, in m.
    pub rotor_positions_m: [[f64; 2]; 4],
    /// Which way each rotor turns, seen from above.
    pub rotor_turns: [Turn; 4],
    /// Radius of a rotor in m.
    pub rotor_radius_m: f64,
    /// a of the thrust a n^2 + b n of a rotor in N, n in revolutions per minute.
    pub thrust_n_per_rpm2: f64,
    /// b of it.
    #[serde(default)]
    pub thrust_n_per_rpm: f64,
    /// Most thrust of a rotor in N.
    pub max_thrust_n: f64,
    /// Torque that turning a rotor takes, over its thrust, in m.
    pub torque_per_thrust_m: f64,
    /// Time constant of a rotor's speed where it grows, in s.
    pub lag_up_s: f64,
    /// Where it falls, in s.
    pub lag_down_s: f64,
    /// Drag of all rotors in hover along the body's axes in N s/m; a rotor's grows with its speed.
    #[serde(default)]
    pub rotor_drag_n_s_m: [f64; 3],
    /// Drag of the body along its axes in N s^2/m^2, times the square of the speed.
    #[serde(default)]
    pub parasitic_drag_n_s2_m2: [f64; 3],
    /// k of the thrust's factor 1 + k (r/4h)^2 at a height h above a ground.
    #[serde(default)]
    pub ground_effect: f64,
    /// Frequency that the attitude loop asks for, in rad/s.
    pub attitude_rad_s: f64,
    /// Damping ratio that it asks for.
    pub attitude_damping: f64,
}

/// Which way a rotor turns, seen from above.
#[derive(Clone, Copy, Debug, Deserialize, Eq, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Turn {
    /// Counterclockwise: the body is turned clockwise.
    Ccw,
    /// Clockwise.
    Cw,
}

/// A quadrotor as it is flown.
#[derive(Clone, Debug, PartialEq)]
pub struct Quadrotor {
    /// Its numbers.
    pub model: Model,
    /// How often its attitude loop runs \[Hz\].
    pub attitude_hz: f64,
    /// Whether thrust grows near a ground: a half-space among the obstacles.
    pub ground_effect: bool,
    /// Whether rotors blow on vehicles below.
    pub downwash: bool,
}

impl Turn {
    /// Sign of the torque about z that turning the rotor puts on the body.
    pub(super) fn reaction(self) -> f64 {
        match self {
            Self::Ccw => -1.0,
            Self::Cw => 1.0,
        }
    }
}

impl Model {
    /// Most thrust of all rotors \[N\].
    #[must_use]
    pub fn most_thrust_n(&self) -> f64 {
        4.0 * self.max_thrust_n
    }

    /// Weight \[N\].
    #[must_use]
    pub fn weight_n(&self) -> f64 {
        self.mass_kg * GRAVITY_M_S2
    }

    /// The slower of a rotor's two time constants \[s\].
    #[must_use]
    pub fn lag_s(&self) -> f64 {
        self.lag_up_s.max(self.lag_down_s)
    }
}
