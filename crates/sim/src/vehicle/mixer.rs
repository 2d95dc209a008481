//! From a thrust and three torques to four rotors that can only push so hard.

use nalgebra::{Matrix4, Vector3, Vector4};

use super::model::Model;

/// Determinant, with lengths in arms, from which four rotors set thrust and torques each by itself.
const LEAST_DETERMINANT: f64 = 1e-3;

/// The shares of each rotor in a thrust and in the torques about the body's axes; by default none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mixer {
    /// Thrust of each rotor for a unit of all thrust, with no torque.
    lift: Vector4<f64>,
    /// Thrust \[N\] of each rotor for a torque of 1 N m about x, y and z, without thrust.
    turns: [Vector4<f64>; 3],
    most_n: f64,
}

impl Mixer {
    /// Of a model; none where its rotors cannot set thrust and torques each by itself, all pushing.
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
        (lift.min() > 0.0).then_some(Self { lift, turns, most_n: model.max_thrust_n })
    }

    /// The thrust of each rotor \[N\], from 0 to its most, that gives a thrust \[N\] and a torque about the body's axes \[N m\]
    /// as far as they go: roll and pitch as much as there is, then yaw, then thrust.
    #[must_use]
    pub fn thrusts_n(&self, lift_n: f64, torque_n_m: Vector3<f64>) -> Vector4<f64> {
        let [roll, pitch, yaw] = &self.turns;
        let all = roll * torque_n_m.x + pitch * torque_n_m.y + yaw * torque_n_m.z + self.lift * lift_n;
        if all.iter().all(|thrust_n| (0.0..=self.most_n).contains(thrust_n)) {
            return all;
        }
        let level = roll * torque_n_m.x + pitch * torque_n_m.y;
        let level = level * self.largest_share(&Vector4::zeros(), &level);
        let yaw = yaw * torque_n_m.z;
        let turning = level + yaw * self.largest_share(&level, &yaw);
        let (mut least_n, mut most_n) = (0.0_f64, f64::INFINITY);
        for (turn, lift) in turning.iter().zip(&self.lift) {
            least_n = least_n.max(-turn / lift);
            most_n = most_n.min((self.most_n - turn) / lift);
        }
        let lift_n = lift_n.min(most_n).max(least_n);
        (turning + self.lift * lift_n).map(|thrust_n| thrust_n.clamp(0.0, self.most_n))
    }

    /// The largest share of `more`, up to all of it, for which some thrust keeps every rotor within its limits; for none of it
    /// there is one.
    fn largest_share(&self, base: &Vector4<f64>, more: &Vector4<f64>) -> f64 {
        let mut share = 1.0_f64;
        for i in 0..4 {
            for j in 0..4 {
                // The thrust that rotor i needs for its least must not be more than rotor j allows for its most.
                let spread = |of: &Vector4<f64>| of[j] / self.lift[j] - of[i] / self.lift[i];
                let (room, grows) = (self.most_n / self.lift[j] - spread(base), spread(more));
                if grows > 0.0 {
                    share = share.min((room / grows).max(0.0));
                }
            }
        }
        share
    }
}
