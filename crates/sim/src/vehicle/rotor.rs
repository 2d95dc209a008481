//! A rotor: its thrust at a speed, and the speed that lags behind what is asked for.

use nalgebra::Vector4;

use super::model::Model;

/// Thrust a n^2 + b n of a rotor \[N\] at n revolutions per minute, never below zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorCurve {
    a: f64,
    b: f64,
}

impl RotorCurve {
    /// Of a model.
    #[must_use]
    pub fn of(model: &Model) -> Self {
        Self { a: model.thrust_n_per_rpm2, b: model.thrust_n_per_rpm }
    }

    /// Thrust at a speed \[N\].
    #[must_use]
    pub fn thrust_n(self, speed_rpm: f64) -> f64 {
        (speed_rpm * (self.a * speed_rpm + self.b)).max(0.0)
    }

    /// Speed that gives a thrust of 0 or more \[rpm\]: n = (-b + sqrt(b^2 + 4 a f))/(2 a).
    #[must_use]
    pub fn speed_rpm(self, thrust_n: f64) -> f64 {
        let Self { a, b } = self;
        ((b * b + 4.0 * a * thrust_n.max(0.0)).sqrt() - b).max(0.0) / (2.0 * a)
    }
}

/// How far rotors come towards the speeds that are asked for within a time: exp(-dt/lag) of the difference is left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorLag {
    up: f64,
    down: f64,
}

impl RotorLag {
    pub(super) fn over(model: &Model, dt_s: f64) -> Self {
        Self { up: libm::exp(-dt_s / model.lag_up_s), down: libm::exp(-dt_s / model.lag_down_s) }
    }

    /// The speeds \[rpm\] after this time where `asked_rpm` are held: exact, for a speed does not pass what is asked for.
    #[must_use]
    pub fn after(self, rotors_rpm: Vector4<f64>, asked_rpm: Vector4<f64>) -> Vector4<f64> {
        rotors_rpm.zip_map(&asked_rpm, |speed_rpm, asked_rpm| {
            let left = if asked_rpm > speed_rpm { self.up } else { self.down };
            asked_rpm + (speed_rpm - asked_rpm) * left
        })
    }
}
