//! What the numbers of a quadrotor must be.

use super::mixer::Mixer;
use super::model::Model;

/// Least and largest magnitude of a positive number of a model, in its unit.
const BOUNDS: (f64, f64) = (1e-12, 1e6);

/// What is wrong with a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct ModelError {
    /// The key of the model.
    pub key: &'static str,
    /// What is wrong with it, in a sentence.
    pub message: String,
    /// What to do about it.
    pub help: String,
}

impl Model {
    /// Whether it can be flown: positive numbers, a body that can exist, rotors that lift it, turn it about every axis and
    /// are fast enough for its attitude loop.
    ///
    /// # Errors
    /// [`ModelError`] for the first that does not hold.
    pub fn check(&self) -> Result<(), ModelError> {
        self.check_numbers()?;
        self.check_body()?;
        if self.most_thrust_n() <= self.weight_n() {
            return Err(refuse(
                "max_thrust_n",
                format!(
                    "the most thrust of four rotors is {} N, not more than the weight of {:.6} N",
                    self.most_thrust_n(),
                    self.weight_n()
                ),
                format!("it must lift the vehicle: more than {:.6} N a rotor", 0.25 * self.weight_n()),
            ));
        }
        if Mixer::new(self).is_none() {
            return Err(refuse(
                "rotor_positions_m",
                "the rotors cannot lift, roll, pitch and yaw the vehicle each by itself".to_owned(),
                "stand them around the centre of mass, two of the four turning each way".to_owned(),
            ));
        }
        self.check_attitude(0.0)
    }

    /// Whether the attitude loop is stable where it waits for `wait_s` on the average before it acts: with a lag tau the
    /// attitude obeys tau s^3 + s^2 + 2 zeta omega s + omega^2.
    ///
    /// # Errors
    /// [`ModelError`] with the inequality.
    pub fn check_attitude(&self, wait_s: f64) -> Result<(), ModelError> {
        let (zeta, omega, lag_s) = (self.attitude_damping, self.attitude_rad_s, self.lag_s() + wait_s);
        if 2.0 * zeta > omega * lag_s {
            return Ok(());
        }
        Err(refuse(
            "attitude_rad_s",
            format!(
                "the attitude loop is unstable: 2 zeta > omega tau is needed, and 2 * {zeta} <= {omega} rad/s * {lag_s} s, \
                 the lag of the rotors and half of a period of the loop"
            ),
            format!("set attitude_rad_s to about {:.3}, which is 0.4/tau, and attitude_damping to 1", 0.4 / lag_s),
        ))
    }

    fn check_numbers(&self) -> Result<(), ModelError> {
        if self.name.trim().is_empty() {
            return Err(refuse("name", "the model has no name".to_owned(), "give it one".to_owned()));
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
            return Err(refuse(key, format!("{key} is {number}"), help));
        }
        let from_zero = self.rotor_drag_n_s_m.map(|drag| ("rotor_drag_n_s_m", drag));
        let squared = self.parasitic_drag_n_s2_m2.map(|drag| ("parasitic_drag_n_s2_m2", drag));
        let mut from_zero = from_zero.into_iter().chain(squared).chain([("ground_effect", self.ground_effect)]);
        if let Some((key, number)) = from_zero.find(|(_, number)| !(0.0..=most).contains(number)) {
            return Err(refuse(key, format!("{key} is {number}"), format!("it must be from 0 to {most:e}")));
        }
        let places = self.rotor_positions_m.iter().flatten().map(|&place| ("rotor_positions_m", place));
        let mut others = places.chain([("thrust_n_per_rpm", self.thrust_n_per_rpm)]);
        match others.find(|(_, number)| !(-most..=most).contains(number)) {
            Some((key, number)) => Err(refuse(key, format!("{key} is {number}"), "give a finite number".to_owned())),
            None => Ok(()),
        }
    }

    /// No mass distribution has a moment of inertia above the sum of the other two.
    fn check_body(&self) -> Result<(), ModelError> {
        let [x, y, z] = self.inertia_kg_m2;
        let Some((largest, rest)) = [(x, y + z), (y, x + z), (z, x + y)].into_iter().find(|(one, rest)| one > rest)
        else {
            return Ok(());
        };
        Err(refuse(
            "inertia_kg_m2",
            format!("a moment of inertia of {largest:e} kg m^2 is more than the other two together, {rest:e} kg m^2"),
            "no body is so: each is at most the sum of the other two".to_owned(),
        ))
    }
}

fn refuse(key: &'static str, message: String, help: String) -> ModelError {
    ModelError { key, message, help }
}
