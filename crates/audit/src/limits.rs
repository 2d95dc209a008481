//! How close two may come.

use super::obstacle::Obstacle;

/// Scaled distance at which two equal ellipsoids touch.
pub const TOUCHING_ELLIPSOIDS: f64 = 2.0;

/// What keeps two apart: lengths in metres or, around ellipsoids, over their half axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Distance that any two vehicles must keep.
    pub(super) delta: f64,
    /// Whether the vehicles' radii count.
    pub(super) by_radii: bool,
    /// Height at or below which two need not keep it.
    pub(super) above: Option<f64>,
}

impl Limits {
    /// What two vehicles of these radii must keep between their centres.
    pub(super) fn of_vehicles(self, first: f64, second: f64) -> f64 {
        if self.by_radii { self.delta.max(first + second) } else { self.delta }
    }

    /// What the centre of a vehicle of this radius must keep from an obstacle's surface.
    pub(super) fn of_obstacle(self, obstacle: &Obstacle, radius: f64) -> f64 {
        obstacle.clearance_m.unwrap_or(if self.by_radii { (0.5 * self.delta).max(radius) } else { 0.5 * self.delta })
    }
}
