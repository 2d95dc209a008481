//! Rotors: thrust curve, lag, mixing and downwash.

use nalgebra::{Matrix4, Vector3, Vector4};

use super::model::Model;

/// Thrust a n^2 + b n of a rotor \[N\] at n revolutions per minute, never below zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorCurve {
    a: f64,
    b: f64,
}

impl RotorCurve {
    /// Creates the curve of a model.
    #[must_use]
    pub fn of(model: &Model) -> Self {
        Self { a: model.thrust_n_per_rpm2, b: model.thrust_n_per_rpm }
    }

    /// Returns the thrust at a speed \[N\].
    #[must_use]
    pub fn thrust_n(self, speed_rpm: f64) -> f64 {
        (speed_rpm * (self.a * speed_rpm + self.b)).max(0.0)
    }

    /// Returns the speed of a thrust \[rpm\]: n = (-b + sqrt(b^2 + 4 a f))/(2 a).
    #[must_use]
    pub fn speed_rpm(self, thrust_n: f64) -> f64 {
        let Self { a, b } = self;
        ((b * b + 4.0 * a * thrust_n.max(0.0)).sqrt() - b).max(0.0) / (2.0 * a)
    }
}

/// Lag of rotors over a time: the difference from the commanded speed shrinks by exp(-dt/lag).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorLag {
    up: f64,
    down: f64,
}

impl RotorLag {
    pub(super) fn for_time(model: &Model, dt_s: f64) -> Self {
        Self { up: libm::exp(-dt_s / model.lag_up_s), down: libm::exp(-dt_s / model.lag_down_s) }
    }

    /// Returns the exact speeds \[rpm\] after this time with constant `commanded_rpm`. A speed never crosses its
    /// command.
    #[must_use]
    pub fn after(self, rotors_rpm: Vector4<f64>, commanded_rpm: Vector4<f64>) -> Vector4<f64> {
        rotors_rpm.zip_map(&commanded_rpm, |speed_rpm, commanded_rpm| {
            let left = if commanded_rpm > speed_rpm { self.up } else { self.down };
            commanded_rpm + (speed_rpm - commanded_rpm) * left
        })
    }
}

/// Smallest determinant of the mixing matrix, with lengths relative to the arms, for independent thrust and torques.
const LEAST_DETERMINANT: f64 = 1e-3;

/// Share of the weight to which torques may raise a smaller total thrust. It is below 1, so that a vehicle whose
/// attitude loop saturates can still descend.
const RAISED_LIFT: f64 = 0.7;

/// Mixing of rotors: their shares in thrust and torques about the body axes; all 0 by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mixer {
    /// Thrust of each rotor for a unit of total thrust, without torque.
    lift: Vector4<f64>,
    /// Thrust \[N\] of each rotor for a torque of 1 N m about x, y and z, without total thrust.
    turns: [Vector4<f64>; 3],
    most_n: f64,
    /// Total thrust to which torques may raise a smaller one \[N\].
    raised_n: f64,
}

impl Mixer {
    /// Creates the mixing of a model; `None` if its rotors, which only push, cannot set thrust and torques
    /// independently.
    #[must_use]
    pub fn new(model: &Model) -> Option<Self> {
        let places = model.rotor_positions_m.map(|[x, y]| [x, y]);
        let arm_m = places.iter().flatten().fold(0.0, |most: f64, place| most.max(place.abs()));
        let rows = Matrix4::from_fn(|effect, rotor| match effect {
            0 => 1.0,
            1 => places[rotor][1] / arm_m,
            2 => -places[rotor][0] / arm_m,
            _ => model.rotor_turns[rotor].reaction(),
        });
        let inverse = rows.try_inverse().filter(|_| rows.determinant().abs() >= LEAST_DETERMINANT)?;
        let share = |effect: usize, unit: f64| Vector4::from(inverse.column(effect)) / unit;
        let lift = share(0, 1.0);
        let turns = [share(1, arm_m), share(2, arm_m), share(3, model.torque_per_thrust_m)];
        let (most_n, raised_n) = (model.max_thrust_n, RAISED_LIFT * model.weight_n());
        (lift.min() > 0.0).then_some(Self { lift, turns, most_n, raised_n })
    }

    /// Returns the thrust of each rotor \[N\], from 0 to its largest, for a total thrust \[N\] and a torque about the
    /// body axes \[N m\].
    ///
    /// Where rotors saturate, roll and pitch have priority, then yaw, then thrust. Torques may lower the total thrust,
    /// but raise it only to 0.7 of the weight. Beyond that they are scaled down: a repeated torque must not lift the
    /// vehicle.
    #[must_use]
    pub fn thrusts_n(&self, lift_n: f64, torque_n_m: Vector3<f64>) -> Vector4<f64> {
        let [roll, pitch, yaw] = &self.turns;
        let all = roll * torque_n_m.x + pitch * torque_n_m.y + yaw * torque_n_m.z + self.lift * lift_n;
        if all.iter().all(|thrust_n| (0.0..=self.most_n).contains(thrust_n)) {
            return all;
        }
        let raised_n = lift_n.max(self.raised_n);
        let level = roll * torque_n_m.x + pitch * torque_n_m.y;
        let level = level * self.largest_share(raised_n, &Vector4::zeros(), &level);
        let yaw = yaw * torque_n_m.z;
        let turning = level + yaw * self.largest_share(raised_n, &level, &yaw);
        let (mut least_n, mut most_n) = (0.0_f64, f64::INFINITY);
        for (turn, lift) in turning.iter().zip(&self.lift) {
            least_n = least_n.max(-turn / lift);
            most_n = most_n.min((self.most_n - turn) / lift);
        }
        let lift_n = lift_n.min(most_n).max(least_n);
        (turning + self.lift * lift_n).map(|thrust_n| thrust_n.clamp(0.0, self.most_n))
    }

    /// Returns the largest share of `more`, at most 1, for which some total thrust up to `raised_n` keeps every rotor
    /// within its limits. For a share of 0 there must be such a thrust.
    fn largest_share(&self, raised_n: f64, base: &Vector4<f64>, more: &Vector4<f64>) -> f64 {
        let mut share = 1.0_f64;
        let mut limit = |room: f64, grows: f64| {
            if grows > 0.0 {
                share = share.min((room / grows).max(0.0));
            }
        };
        for i in 0..4 {
            // The total thrust that rotor i needs for its minimum must not exceed the largest one.
            let needed = |turn: &Vector4<f64>| -turn[i] / self.lift[i];
            limit(raised_n - needed(base), needed(more));
            for j in 0..4 {
                // Nor must it exceed the total thrust at which rotor j reaches its maximum.
                let spread = |turn: &Vector4<f64>| turn[j] / self.lift[j] + needed(turn);
                limit(self.most_n / self.lift[j] - spread(base), spread(more));
            }
        }
        share
    }

    /// Returns the largest acceleration \[rad/s^2\] about any level axis that a body gets at every commanded thrust, by
    /// its moments of inertia \[kg m^2\]. It is that at a thrust of 0.7 of the weight.
    pub(super) fn turn_rad_s2(&self, inertia_kg_m2: &Vector3<f64>) -> f64 {
        let [roll, pitch, _] = &self.turns;
        (0..4)
            .map(|i| self.raised_n * self.lift[i] / (roll[i] * inertia_kg_m2.x).hypot(pitch[i] * inertia_kg_m2.y))
            .fold(f64::INFINITY, f64::min)
    }
}

/// Density of air at sea level \[kg/m^3\].
pub const AIR_DENSITY_KG_M3: f64 = 1.225;

/// Coefficient of the speed of a round jet on its axis in its far field: 6.6 sqrt(T/rho)/z.
const FAR_FIELD: f64 = 6.6;

/// Distance from the axis of a jet, in jet widths, beyond which it is neglected.
const WIDTHS: f64 = 4.0;

/// Distance below a rotor beyond which its jet is neglected \[m\].
const REACH_M: f64 = 20.0;

/// Vertical jet of one rotor.
///
/// Momentum theory and a textbook round jet: the induced speed v = sqrt(T/(2 rho A)) becomes 2 v in the wake. The speed
/// on the axis falls as U1 = min(2 v, 6.6 sqrt(T/rho)/z), over a width b = sqrt(2 T/(pi rho))/U1 that conserves
/// momentum. Jets add by squares: U^2 = sum U1^2 exp(-2 r^2/b^2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Downwash {
    /// Position of the rotor \[m\].
    place_m: Vector3<f64>,
    /// sqrt(T/rho) \[m^2/s\].
    strength: f64,
    wake_m_s: f64,
}

impl Downwash {
    /// Creates the jet of a rotor with a position \[m\], a radius \[m\] and a thrust \[N\].
    #[must_use]
    pub fn new(place_m: Vector3<f64>, radius_m: f64, thrust_n: f64) -> Self {
        let strength = (thrust_n.max(0.0) / AIR_DENSITY_KG_M3).sqrt();
        let wake_m_s = 2.0 * strength / (radius_m * (2.0 * std::f64::consts::PI).sqrt());
        Self { place_m, strength, wake_m_s }
    }

    /// Returns the square of the downward speed at a point \[m^2/s^2\].
    #[must_use]
    pub fn squared_m2_s2(&self, point_m: Vector3<f64>) -> f64 {
        let from_m = point_m - self.place_m;
        let below_m = -from_m.z;
        if below_m <= 0.0 || below_m > REACH_M || self.strength == 0.0 {
            return 0.0;
        }
        let axis_m_s = self.wake_m_s.min(FAR_FIELD * self.strength / below_m);
        let width_m = self.strength * (2.0 / std::f64::consts::PI).sqrt() / axis_m_s;
        let squared = (from_m.x * from_m.x + from_m.y * from_m.y) / (width_m * width_m);
        if squared > WIDTHS * WIDTHS { 0.0 } else { axis_m_s * axis_m_s * libm::exp(-2.0 * squared) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::{MODELS, read};
    use super::*;

    #[test]
    fn torques_beyond_the_rotors_are_scaled_and_raise_only_a_small_thrust() {
        for (name, text) in MODELS {
            let model = read(name, text).expect("a model");
            let (mixer, weight_n) = (Mixer::new(&model).expect("independent rotors"), model.weight_n());
            let arm_m = model.rotor_positions_m[0][0].hypot(model.rotor_positions_m[0][1]);
            for (lift, direction) in [
                (0.0, Vector3::x()),
                (0.3, Vector3::y()),
                (1.0, Vector3::new(1.0, -2.0, 0.0)),
                (1.2, Vector3::new(-1.0, 1.0, 0.5)),
                (1.0, Vector3::z()),
            ] {
                let torque_n_m = direction * (10.0 * weight_n * arm_m);
                let thrusts_n = mixer.thrusts_n(lift * weight_n, torque_n_m);
                let most_n = lift.max(RAISED_LIFT) * weight_n * (1.0 + 1e-12);
                assert!(thrusts_n.sum() <= most_n && thrusts_n.min() >= 0.0, "{name}, {lift}: {thrusts_n}");
                // Roll and pitch keep their direction.
                let places_m = model.rotor_positions_m;
                let roll: f64 = (0..4).map(|i| places_m[i][1] * thrusts_n[i]).sum();
                let pitch: f64 = (0..4).map(|i| -places_m[i][0] * thrusts_n[i]).sum();
                let across = roll * direction.y - pitch * direction.x;
                assert!(across.abs() < 1e-9 * weight_n && roll * direction.x + pitch * direction.y >= -1e-12, "{name}");
                assert!(roll.hypot(pitch) > 0.05 * weight_n * arm_m || direction.xy().norm() == 0.0, "{name}, {lift}");
            }
        }
    }

    #[test]
    fn thrusts_within_the_limits_are_exact() {
        let model = read(MODELS[0].0, MODELS[0].1).expect("a model");
        let mixer = Mixer::new(&model).expect("independent rotors");
        let (lift_n, torque_n_m) = (model.weight_n(), Vector3::new(2e-4, -1e-4, 1e-5));
        let thrusts_n = mixer.thrusts_n(lift_n, torque_n_m);
        let roll: f64 = (0..4).map(|i| model.rotor_positions_m[i][1] * thrusts_n[i]).sum();
        assert!((thrusts_n.sum() - lift_n).abs() < 1e-12 && (roll - torque_n_m.x).abs() < 1e-15, "{thrusts_n}");
    }
}
