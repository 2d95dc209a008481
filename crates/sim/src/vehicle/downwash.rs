//! The air that rotors blow downwards: a widening jet below each.

use nalgebra::Vector3;

/// Density of air at sea level \[kg/m^3\].
pub const AIR_DENSITY_KG_M3: f64 = 1.225;

/// Speed of a round jet on its axis: 6.6 sqrt(T/rho)/z in its far field.
const FAR_FIELD: f64 = 6.6;

/// Farther from a jet's axis than so many of its widths nothing is felt.
const WIDTHS: f64 = 4.0;

/// Farther below a rotor nothing is felt \[m\].
const REACH_M: f64 = 20.0;

/// The jet of one rotor, which blows straight down.
///
/// Momentum theory and a textbook's round jet: the induced speed v = sqrt(T/(2 rho A)) becomes 2 v in the wake, and the speed
/// on the axis falls as U1 = min(2 v, 6.6 sqrt(T/rho)/z), over a width b = sqrt(2 T/(pi rho))/U1 that keeps the momentum.
/// Jets add up by their squares: U^2 = sum U1^2 exp(-2 r^2/b^2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Downwash {
    /// Where the rotor is \[m\].
    place_m: Vector3<f64>,
    /// sqrt(T/rho) \[m^2/s\].
    strength: f64,
    wake_m_s: f64,
}

impl Downwash {
    /// Below a rotor at a place \[m\], of a radius \[m\] and a thrust \[N\].
    #[must_use]
    pub fn new(place_m: Vector3<f64>, radius_m: f64, thrust_n: f64) -> Self {
        let strength = (thrust_n.max(0.0) / AIR_DENSITY_KG_M3).sqrt();
        let wake_m_s = 2.0 * strength / (radius_m * (2.0 * std::f64::consts::PI).sqrt());
        Self { place_m, strength, wake_m_s }
    }

    /// Square of the speed at which it blows downwards at a point \[m^2/s^2\].
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
