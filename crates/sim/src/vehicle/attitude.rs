//! The attitude loop: from a commanded acceleration to the thrust and torque that a vehicle asks of its rotors.
//!
//! Lee, Leok and `McClamroch`, *Geometric tracking control of a quadrotor UAV on SE(3)* (CDC 2010), with u commanded:
//!
//! ```text
//! F = m (u + g e3)                 the thrust is F.b3, and the body is turned towards F at a heading
//! M = -k_R e_R - k_W W + W x J W   k_R = J omega^2, k_W = 2 zeta omega J
//! ```
//!
//! Between two commands the attitude asked for stands still, so the rates that it would have are zero.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::model::{GRAVITY_M_S2, Model};

/// Least share of the weight that a command may ask the rotors to lift: one that asks for less would turn the vehicle over.
pub const LEAST_LIFT: f64 = 0.3;

/// Share of the most thrust that a command leaves to the attitude loop.
pub const THRUST_RESERVE: f64 = 0.1;

/// The attitude loop of a model. The heading it keeps is that of the world's x axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Attitude {
    mass_kg: f64,
    inertia_kg_m2: Vector3<f64>,
    rad_s: f64,
    damping: f64,
    weight_n: f64,
    most_n: f64,
}

impl Attitude {
    /// Of a model.
    #[must_use]
    pub fn of(model: &Model) -> Self {
        Self {
            mass_kg: model.mass_kg,
            inertia_kg_m2: model.inertia_kg_m2.into(),
            rad_s: model.attitude_rad_s,
            damping: model.attitude_damping,
            weight_n: model.weight_n(),
            most_n: (1.0 - THRUST_RESERVE) * model.most_thrust_n(),
        }
    }

    /// The force \[N\] that carries out an acceleration \[m/s^2\] against gravity, as far as the rotors can: what lifts comes
    /// first, from [`LEAST_LIFT`] of the weight to the most thrust less [`THRUST_RESERVE`], then as much sideways as that
    /// leaves. A vehicle that can barely fly keeps its weight.
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

    /// Thrust \[N\] and torque about the body's axes \[N m\] that turn the body towards a force \[N\], given its attitude and
    /// its rates about its own axes \[rad/s\].
    #[must_use]
    pub fn wrench(
        &self,
        force_n: Vector3<f64>,
        attitude: &UnitQuaternion<f64>,
        rates_rad_s: Vector3<f64>,
    ) -> (f64, Vector3<f64>) {
        let body = attitude.to_rotation_matrix().into_inner();
        let asked = facing(force_n);
        let off = asked.transpose() * body;
        let error = 0.5 * Vector3::new(off[(2, 1)] - off[(1, 2)], off[(0, 2)] - off[(2, 0)], off[(1, 0)] - off[(0, 1)]);
        let turn_rad_s2 = self.rad_s * (self.rad_s * error + 2.0 * self.damping * rates_rad_s);
        let momentum = self.inertia_kg_m2.component_mul(&rates_rad_s);
        let torque_n_m = rates_rad_s.cross(&momentum) - self.inertia_kg_m2.component_mul(&turn_rad_s2);
        (force_n.dot(&body.column(2)).max(0.0), torque_n_m)
    }
}

/// The attitude whose z axis is along a force and whose x axis heads for the world's, as a matrix of its axes.
fn facing(force_n: Vector3<f64>) -> Matrix3<f64> {
    let up = force_n.normalize();
    let left = up.cross(&Vector3::x()).normalize();
    Matrix3::from_columns(&[left.cross(&up), left, up])
}
