//! Numbers up to which parts of a drawing are shown, and sizes.

use serde::Serialize;

/// Largest number of drawn links. More links would hide each other.
pub const MOST_LINKS: usize = 2100;
/// Largest drawn radius of a vehicle with unknown radius \[m\].
pub const UNKNOWN_RADIUS_M: f64 = 0.1;
/// Tangent of half the vertical angle of view of a camera in perspective, which is 35 degrees.
pub const TAN_HALF_VIEW: f64 = 0.315_298_788_878_983_7;
/// Direction of the light in the axes of the camera: from above its left shoulder.
pub const LIGHT: [f64; 3] = [-0.408, 0.577, 0.707];
/// Clearance with the last colour of a vehicle without a safety distance, in radii.
const CLEAR_RADII: f64 = 10.0;

/// Numbers up to which parts of a drawing are shown. More would hide the formation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Limits {
    /// Vehicles that all have names. Of more, only important ones have.
    pub named: usize,
    /// Vehicles with trails of the whole flight, and with trails of 5 s. More have trails of 1 s.
    pub trails: [usize; 2],
    /// Vehicles with lines to the ground.
    pub drops: usize,
    /// Vehicles with slots at first.
    pub slots: usize,
    /// Links that are shown at first.
    pub links: usize,
    /// Vehicles with colours of their own. More have one colour.
    pub colours: usize,
}

/// Limits of pictures and replays.
pub const LIMITS: Limits = Limits { named: 24, trails: [24, 99], drops: 300, slots: 60, links: 40, colours: 199 };

/// Returns the width \[px\] and the opacity of a link at rest among this number of links.
#[must_use]
pub fn link_look(links: usize) -> (f32, f32) {
    let many = links as f32;
    ((2.2 - many / 200.0).clamp(1.0, 2.2), (36.0 / many).clamp(0.08, 0.9))
}

/// Returns the clearance that has the last colour \[m\], for a safety distance and the radii of the vehicles \[m\].
#[must_use]
pub fn max_clearance_m(delta_m: Option<f64>, radii_m: impl IntoIterator<Item = f64>) -> f64 {
    delta_m.unwrap_or_else(|| CLEAR_RADII * radii_m.into_iter().fold(0.0, f64::max))
}
