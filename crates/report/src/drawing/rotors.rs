//! Bodies of quadrotors.

use nalgebra::Vector3;
use serde::Serialize;

use tautline_sim::scenario::Scenario;

/// Distance of the rotors from the centre, and their radius, over the radius of the hull, for an unknown model.
const OUT: f64 = 0.66;
const ROTOR: f64 = 0.33;
/// Height of the rotors above the body's centre, relative to the arm.
const ABOVE: f64 = 0.18;

/// Rotors of a quadrotor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotors {
    /// Centres relative to the centre of the body, x ahead and y to the left \[m\].
    pub at_m: [[f64; 2]; 4],
    /// Radius of each rotor \[m\].
    pub radius_m: f64,
}

/// Quadrotor as data of a page \[m\].
#[derive(Clone, Copy, Debug, Serialize)]
#[expect(clippy::struct_field_names, reason = "all are lengths in metres")]
pub(crate) struct Airframe {
    /// Ends of the arms, at the rotors, and the mark ahead, relative to the centre of the body.
    ends_m: [[f64; 3]; 5],
    rotor_m: f64,
    body_m: f64,
    arm_m: f64,
}

impl Rotors {
    /// Radius of the body, relative to the arm.
    pub const BODY: f64 = 0.3;
    /// Width of an arm, relative to its length.
    pub const WIDTH: f64 = 0.11;
    /// Distance of the mark ahead from the centre, relative to the arm.
    pub const AHEAD: f64 = 0.72;

    /// Returns the rotors of a scenario's model, if its vehicles are quadrotors.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Option<Self> {
        let model = &scenario.airframe.quadrotor()?.model;
        Some(Self { at_m: model.rotor_positions_m, radius_m: model.rotor_radius_m })
    }

    /// Creates four rotors within a hull of this radius \[m\].
    #[must_use]
    pub fn within(hull_radius_m: f64) -> Self {
        let out = hull_radius_m * OUT * std::f64::consts::FRAC_1_SQRT_2;
        let at_m = [[1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]].map(|at: [f64; 2]| at.map(|side| side * out));
        Self { at_m, radius_m: hull_radius_m * ROTOR }
    }

    /// Returns the rotors at another scale.
    #[must_use]
    pub fn scaled(&self, scale: f64) -> Self {
        Self { at_m: self.at_m.map(|at| at.map(|side| side * scale)), radius_m: self.radius_m * scale }
    }

    /// Returns the centres of the rotors relative to the centre of the body \[m\].
    #[must_use]
    pub fn places_m(&self) -> [Vector3<f64>; 4] {
        let above_m = ABOVE * self.arm_m();
        self.at_m.map(|[x, y]| Vector3::new(x, y, above_m))
    }

    /// Returns the mark ahead relative to the centre of the body \[m\].
    #[must_use]
    pub fn nose_m(&self) -> Vector3<f64> {
        Vector3::x() * (Self::AHEAD * self.arm_m())
    }

    /// Returns the horizontal distance of the outermost rotor from the centre \[m\].
    #[must_use]
    pub fn arm_m(&self) -> f64 {
        self.at_m.iter().map(|[x, y]| Vector3::new(*x, *y, 0.0).norm()).fold(0.0, f64::max)
    }

    /// Returns the quadrotor as data of a page.
    pub(crate) fn airframe(&self) -> Airframe {
        let [a, b, c, d] = self.places_m();
        let ends_m = [a, b, c, d, self.nose_m()].map(Into::into);
        let arm_m = self.arm_m();
        Airframe { ends_m, rotor_m: self.radius_m, body_m: Self::BODY * arm_m, arm_m }
    }
}
