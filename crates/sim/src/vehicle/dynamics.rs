//! Forces and torques on a quadrotor, and the two halves of a second-order step.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3, Vector4};

use super::model::{GRAVITY_M_S2, Model, Quadrotor};
use super::rotors::{Downwash, Mixer, RotorCurve, RotorLag};

/// State of a quadrotor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Centre of mass \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity of the centre of mass \[m/s\].
    pub velocity_m_s: Vector3<f64>,
    /// Rotation from body to world.
    pub attitude: UnitQuaternion<f64>,
    /// Angular rates about the body axes \[rad/s\].
    pub rates_rad_s: Vector3<f64>,
    /// Speed of each rotor \[rpm\].
    pub rotors_rpm: Vector4<f64>,
    /// Share of its thrust that each rotor gives: 1 unless it has failed.
    pub shares: Vector4<f64>,
}

/// Force and torque on a quadrotor, without gravity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force in the world frame \[N\].
    pub force_n: Vector3<f64>,
    /// Torque about the body axes \[N m\].
    pub torque_n_m: Vector3<f64>,
}

/// Plane with a ground effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Point of the plane \[m\].
    pub place_m: Vector3<f64>,
    /// Outward unit normal.
    pub normal: Vector3<f64>,
}

/// First half of a step: the motion and rotation of the body over the whole step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Velocity \[m/s\].
    pub velocity_m_s: Vector3<f64>,
    /// Angular velocity in the world frame \[rad/s\].
    pub turn_rad_s: Vector3<f64>,
    /// Angular momentum in the world frame \[kg m^2/s\].
    momentum: Vector3<f64>,
    /// Kick of the first half, which predicts that of the second.
    kick_m_s: Vector3<f64>,
    twist: Vector3<f64>,
}

/// Equations of motion of a quadrotor.
#[derive(Clone, Debug, PartialEq)]
pub struct Dynamics {
    model: Model,
    inertia_kg_m2: Vector3<f64>,
    /// Position of each rotor relative to the centre of mass \[m\].
    arms_m: [Vector3<f64>; 4],
    /// Torque about z over thrust of each rotor \[m\].
    reactions_m: [f64; 4],
    /// Drag coefficient of a rotor over its speed \[N s/m/rpm\].
    drag: Vector3<f64>,
    parasitic_n_s2_m2: Vector3<f64>,
    curve: RotorCurve,
    mixer: Mixer,
    attitude: Attitude,
    hover_rpm: f64,
    grounds: Vec<Ground>,
    downwash: bool,
}

impl Dynamics {
    /// Creates the equations of a quadrotor above grounds, if it has a ground effect. A model that [`Model::check`]
    /// refuses gets no mixing of rotors.
    #[must_use]
    pub fn new(quadrotor: &Quadrotor, grounds: &[Ground]) -> Self {
        let (model, curve) = (quadrotor.model.clone(), RotorCurve::of(&quadrotor.model));
        let hover_rpm = curve.speed_rpm(0.25 * model.weight_n());
        Self {
            mixer: Mixer::new(&model).unwrap_or_default(),
            attitude: Attitude::of(&model),
            inertia_kg_m2: model.inertia_kg_m2.into(),
            arms_m: model.rotor_positions_m.map(|[x, y]| Vector3::new(x, y, 0.0)),
            reactions_m: model.rotor_turns.map(|turn| turn.reaction() * model.torque_per_thrust_m),
            drag: Vector3::from(model.rotor_drag_n_s_m) * (0.25 / hover_rpm),
            parasitic_n_s2_m2: model.parasitic_drag_n_s2_m2.into(),
            hover_rpm,
            curve,
            grounds: if quadrotor.ground_effect { grounds.to_vec() } else { Vec::new() },
            downwash: quadrotor.downwash,
            model,
        }
    }

    /// Returns the model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Returns the moments of inertia about the body axes \[kg m^2\].
    #[must_use]
    pub fn inertia_kg_m2(&self) -> Vector3<f64> {
        self.inertia_kg_m2
    }

    /// Returns the speed of a rotor that carries a quarter of the weight \[rpm\].
    #[must_use]
    pub fn hover_rpm(&self) -> f64 {
        self.hover_rpm
    }

    /// Returns a level state at a position \[m\] with a velocity \[m/s\] and rotors at hover speed.
    #[must_use]
    pub fn trimmed(&self, position_m: Vector3<f64>, velocity_m_s: Vector3<f64>) -> State {
        State {
            position_m,
            velocity_m_s,
            attitude: UnitQuaternion::identity(),
            rates_rad_s: Vector3::zeros(),
            rotors_rpm: Vector4::repeat(self.hover_rpm),
            shares: Vector4::repeat(1.0),
        }
    }

    /// Returns the thrust of each rotor \[N\] with the ground effect.
    #[must_use]
    pub fn thrusts_n(&self, state: &State) -> Vector4<f64> {
        let thrust_n = |speed_rpm: f64, share: f64| share * self.curve.thrust_n(speed_rpm);
        let mut thrusts_n = state.rotors_rpm.zip_map(&state.shares, thrust_n);
        if !self.grounds.is_empty() {
            for (rotor, thrust_n) in thrusts_n.iter_mut().enumerate() {
                *thrust_n *= self.ground_factor(state, rotor);
            }
        }
        thrusts_n
    }

    /// Returns the factor 1 + k (r/4h)^2 of the thrust of a rotor at a height h above a ground, with h at least the
    /// rotor's radius. It is 1 for a rotor below the ground or with its wake away from it.
    fn ground_factor(&self, state: &State, rotor: usize) -> f64 {
        let place_m = state.position_m + state.attitude * self.arms_m[rotor];
        let up = state.attitude * Vector3::z();
        let radius_m = self.model.rotor_radius_m;
        let grounds = self.grounds.iter().filter(|ground| up.dot(&ground.normal) > 0.0);
        grounds
            .map(|ground| (place_m - ground.place_m).dot(&ground.normal))
            .filter(|&height_m| height_m > 0.0)
            .map(|height_m| 1.0 + self.model.ground_effect * (0.25 * radius_m / height_m.max(radius_m)).powi(2))
            .fold(1.0, f64::max)
    }

    /// Returns force and torque without gravity, in a wind \[m/s\] and the downwash on each rotor \[m/s\].
    #[must_use]
    pub fn wrench(&self, state: &State, wind_m_s: Vector3<f64>, downwash_m_s: [f64; 4]) -> Wrench {
        let body = state.attitude.to_rotation_matrix().into_inner();
        let (up, past_m_s) = (body.row(2).transpose(), body.tr_mul(&(state.velocity_m_s - wind_m_s)));
        let thrusts_n = self.thrusts_n(state);
        let (mut force_n, mut torque_n_m) = (Vector3::zeros(), Vector3::zeros());
        for (rotor, arm_m) in self.arms_m.iter().enumerate() {
            let rotor_m_s = past_m_s + state.rates_rad_s.cross(arm_m) + up * downwash_m_s[rotor];
            let mut rotor_n = self.drag.component_mul(&rotor_m_s) * -state.rotors_rpm[rotor];
            rotor_n.z += thrusts_n[rotor];
            force_n += rotor_n;
            torque_n_m += arm_m.cross(&rotor_n);
            torque_n_m.z += self.reactions_m[rotor] * thrusts_n[rotor];
        }
        if self.parasitic_n_s2_m2 != Vector3::zeros() {
            let past_m_s = past_m_s + up * (0.25 * downwash_m_s.iter().sum::<f64>());
            force_n -= past_m_s.norm() * self.parasitic_n_s2_m2.component_mul(&past_m_s);
        }
        Wrench { force_n: body * force_n, torque_n_m }
    }

    /// Returns the downwash of other vehicles' rotors on each rotor of a vehicle, at least 0 \[m/s\].
    #[must_use]
    pub fn downwash_m_s(&self, vehicle: usize, state: &State, jets: &[Downwash]) -> [f64; 4] {
        if jets.is_empty() {
            return [0.0; 4];
        }
        self.arms_m.map(|arm_m| {
            let place_m = state.position_m + state.attitude * arm_m;
            let others = jets.iter().enumerate().filter(|(jet, _)| jet / 4 != vehicle);
            others.map(|(_, jet)| jet.squared_m2_s2(place_m)).sum::<f64>().sqrt()
        })
    }

    /// Writes the jets of all rotors of these vehicles, four each, if the model has downwash.
    pub fn jets<'a>(&self, states: impl Iterator<Item = &'a State>, jets: &mut Vec<Downwash>) {
        jets.clear();
        if self.downwash {
            for state in states {
                let thrusts_n = self.thrusts_n(state);
                jets.extend((0..4).map(|rotor| {
                    let place_m = state.position_m + state.attitude * self.arms_m[rotor];
                    Downwash::new(place_m, self.model.rotor_radius_m, thrusts_n[rotor])
                }));
            }
        }
    }

    /// Returns the rotor speeds \[rpm\] that execute an acceleration \[m/s^2\] in this state, within the limits of the
    /// rotors.
    #[must_use]
    pub fn commanded_rpm(&self, state: &State, acceleration_m_s2: Vector3<f64>) -> Vector4<f64> {
        let force_n = self.attitude.force_n(acceleration_m_s2);
        let (lift_n, torque_n_m) = self.attitude.wrench(force_n, &state.attitude, state.rates_rad_s);
        self.mixer.thrusts_n(lift_n, torque_n_m).map(|thrust_n| self.curve.speed_rpm(thrust_n))
    }

    /// Returns the lag of the rotors over a time \[s\].
    #[must_use]
    pub fn rotor_lag(&self, dt_s: f64) -> RotorLag {
        RotorLag::for_time(&self.model, dt_s)
    }

    /// Returns the rates of change of the velocity \[m/s^2\] and of the rates about the body axes \[rad/s^2\].
    #[must_use]
    pub fn accelerations(&self, state: &State, wrench: &Wrench) -> (Vector3<f64>, Vector3<f64>) {
        let momentum = self.inertia_kg_m2.component_mul(&state.rates_rad_s);
        let turning = wrench.torque_n_m - state.rates_rad_s.cross(&momentum);
        (self.acceleration_m_s2(wrench), turning.component_div(&self.inertia_kg_m2))
    }

    fn acceleration_m_s2(&self, wrench: &Wrench) -> Vector3<f64> {
        wrench.force_n / self.model.mass_kg - GRAVITY_M_S2 * Vector3::z()
    }

    /// Returns the first half of a step: half of the kick of `wrench`, and the angular velocity in the middle of the
    /// step. Without torque the angular momentum in the world frame is constant, which is the gyroscopic term.
    #[must_use]
    pub fn begin_step(&self, state: &State, wrench: &Wrench, dt_s: f64) -> Drift {
        let kick_m_s = 0.5 * dt_s * self.acceleration_m_s2(wrench);
        let twist = state.attitude * (0.5 * dt_s * wrench.torque_n_m);
        let momentum = state.attitude * self.inertia_kg_m2.component_mul(&state.rates_rad_s) + twist;
        let middle = rotated(&state.attitude, self.turn_rad_s(&state.attitude, momentum), 0.5 * dt_s);
        Drift {
            velocity_m_s: state.velocity_m_s + kick_m_s,
            turn_rad_s: self.turn_rad_s(&middle, momentum),
            momentum,
            kick_m_s,
            twist,
        }
    }

    /// Returns the angular velocity in the world frame \[rad/s\] of an angular momentum \[kg m^2/s\].
    fn turn_rad_s(&self, attitude: &UnitQuaternion<f64>, momentum: Vector3<f64>) -> Vector3<f64> {
        attitude * attitude.inverse_transform_vector(&momentum).component_div(&self.inertia_kg_m2)
    }

    /// Predicts velocity and rates at the end of a drift; position, attitude and rotors of `state` must be those at its
    /// end.
    pub fn predict(&self, state: &mut State, drift: &Drift) {
        let momentum = drift.momentum + drift.twist;
        state.velocity_m_s = drift.velocity_m_s + drift.kick_m_s;
        state.rates_rad_s = state.attitude.inverse_transform_vector(&momentum).component_div(&self.inertia_kg_m2);
    }

    /// Applies the second half of a step, with the wrench at its end.
    pub fn end_step(&self, state: &mut State, drift: &Drift, wrench: &Wrench, dt_s: f64) {
        state.velocity_m_s = drift.velocity_m_s + 0.5 * dt_s * self.acceleration_m_s2(wrench);
        let momentum = state.attitude.inverse_transform_vector(&drift.momentum) + 0.5 * dt_s * wrench.torque_n_m;
        state.rates_rad_s = momentum.component_div(&self.inertia_kg_m2);
    }

    /// Adds the changes of velocity \[m/s\] and angular velocity \[rad/s\] by a collision to a drift.
    pub fn add_impulse(
        &self,
        drift: &mut Drift,
        attitude: &UnitQuaternion<f64>,
        by_m_s: Vector3<f64>,
        by_rad_s: Vector3<f64>,
    ) {
        drift.velocity_m_s += by_m_s;
        let by = attitude.inverse_transform_vector(&by_rad_s);
        drift.momentum += attitude * self.inertia_kg_m2.component_mul(&by);
    }
}

/// Rotates an attitude by an angular velocity in the world frame \[rad/s\] for a time \[s\], as the engine does. The
/// angle is 2 atan(|w| t/2), which is |w| t to second order.
fn rotated(attitude: &UnitQuaternion<f64>, turn_rad_s: Vector3<f64>, dt_s: f64) -> UnitQuaternion<f64> {
    let half = 0.5 * dt_s * turn_rad_s;
    UnitQuaternion::new_normalize(Quaternion::new(1.0, half.x, half.y, half.z) * attitude.into_inner())
}

/// Smallest commanded lift as a share of the weight. With less lift, a command would turn the vehicle over.
pub const LEAST_LIFT: f64 = 0.3;

/// Share of the largest thrust that is reserved for the attitude loop.
pub const THRUST_RESERVE: f64 = 0.1;

/// Largest vertical thrust while the body turns towards a force, over the vertical part of the force. A body halfway to
/// a steep tilt would climb otherwise. A turn to less than 48 degrees stays below it.
const TURNING_LIFT: f64 = 1.25;

/// Attitude loop of a model. It keeps the heading along the world's x axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Attitude {
    mass_kg: f64,
    inertia_kg_m2: Vector3<f64>,
    rad_s: f64,
    damping: f64,
    weight_n: f64,
    most_n: f64,
    /// Largest acceleration about level axes that the loop commands \[rad/s^2\].
    most_turn_rad_s2: f64,
    /// Largest error about level axes that counts. It turns the body at the fastest rate that this acceleration stops.
    most_error: f64,
}

impl Attitude {
    /// Creates the attitude loop of a model.
    #[must_use]
    pub fn of(model: &Model) -> Self {
        let inertia_kg_m2 = model.inertia_kg_m2.into();
        let most_turn_rad_s2 = Mixer::new(model).map_or(0.0, |mixer| mixer.turn_rad_s2(&inertia_kg_m2));
        Self {
            most_turn_rad_s2,
            most_error: (2.0 * model.attitude_damping / model.attitude_rad_s).powi(2) * most_turn_rad_s2,
            mass_kg: model.mass_kg,
            inertia_kg_m2,
            rad_s: model.attitude_rad_s,
            damping: model.attitude_damping,
            weight_n: model.weight_n(),
            most_n: (1.0 - THRUST_RESERVE) * model.most_thrust_n(),
        }
    }

    /// Returns the force \[N\] that executes an acceleration \[m/s^2\] against gravity, within the limits of the
    /// rotors. Lift has priority, from [`LEAST_LIFT`] of the weight to the largest thrust less [`THRUST_RESERVE`]; the
    /// horizontal part gets the rest. A vehicle that can barely fly carries its weight.
    #[must_use]
    pub fn force_n(&self, acceleration_m_s2: Vector3<f64>) -> Vector3<f64> {
        let most_n = self.most_n.max(self.weight_n);
        let asked_n = self.mass_kg * (acceleration_m_s2 + GRAVITY_M_S2 * Vector3::z());
        let lift_n = asked_n.z.clamp(LEAST_LIFT * self.weight_n, most_n);
        let aside_n = Vector3::new(asked_n.x, asked_n.y, 0.0);
        let left_n = (most_n * most_n - lift_n * lift_n).max(0.0).sqrt();
        let share = if aside_n.norm() > left_n { left_n / aside_n.norm() } else { 1.0 };
        aside_n * share + Vector3::z() * lift_n
    }

    /// Returns the thrust \[N\] and the torque about the body axes \[N m\] that turn the body towards a force \[N\].
    /// `rates_rad_s` are about the body axes.
    ///
    /// An error e alone turns the body at omega e/(2 zeta). An acceleration of 2 zeta omega times this rate stops it.
    /// The loop commands no faster rate and no larger acceleration than the rotors give at every commanded thrust.
    /// Otherwise, commands that reverse faster than the body turns get more torque to one side than to the other.
    #[must_use]
    pub fn wrench(
        &self,
        force_n: Vector3<f64>,
        attitude: &UnitQuaternion<f64>,
        rates_rad_s: Vector3<f64>,
    ) -> (f64, Vector3<f64>) {
        let body = attitude.to_rotation_matrix().into_inner();
        let asked = attitude_along(force_n);
        let off = asked.transpose() * body;
        let up = body.column(2);
        let climbing_n = if up.z > 0.0 { TURNING_LIFT * force_n.z / up.z } else { f64::INFINITY };
        let lift_n = force_n.dot(&up).max(0.0).min(climbing_n);
        let mut error =
            0.5 * Vector3::new(off[(2, 1)] - off[(1, 2)], off[(0, 2)] - off[(2, 0)], off[(1, 0)] - off[(0, 1)]);
        let tilt = error.x.hypot(error.y);
        if tilt > self.most_error {
            error.x *= self.most_error / tilt;
            error.y *= self.most_error / tilt;
        }
        let mut turn_rad_s2 = self.rad_s * (self.rad_s * error + 2.0 * self.damping * rates_rad_s);
        let level_rad_s2 = turn_rad_s2.x.hypot(turn_rad_s2.y);
        if level_rad_s2 > self.most_turn_rad_s2 {
            turn_rad_s2.x *= self.most_turn_rad_s2 / level_rad_s2;
            turn_rad_s2.y *= self.most_turn_rad_s2 / level_rad_s2;
        }
        let momentum = self.inertia_kg_m2.component_mul(&rates_rad_s);
        let torque_n_m = rates_rad_s.cross(&momentum) - self.inertia_kg_m2.component_mul(&turn_rad_s2);
        (lift_n, torque_n_m)
    }
}

/// Returns the attitude with its z axis along a force and its x axis towards the world's x axis, as a matrix of its
/// axes.
fn attitude_along(force_n: Vector3<f64>) -> Matrix3<f64> {
    let up = force_n.normalize();
    let left = up.cross(&Vector3::x()).normalize();
    Matrix3::from_columns(&[left.cross(&up), left, up])
}
