//! The one-sided tension between vehicles and the surfaces of obstacles at rest.

use super::error::{LawError, ParameterError};
use super::interface::LawContext;
use super::tension::{EdgeTension, TensionError};
use crate::observation::Observation;
use crate::space::Obstacle;
use crate::target::Leg;
use tautline_core::swarm::{Rows, row, set_row};

/// The edge tension on the room that a vehicle has from an obstacle: its distance from the surface less the clearance. It
/// pushes while that is less than a range, and without bound as it vanishes.
///
/// Along the direction in which the room of a convex obstacle grows the Hessian of V is V'', across it it is V' times a
/// curvature that is not negative, with V' < 0: so it is at most V''.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClearanceTension {
    /// Of a barrier at no room at all.
    tension: EdgeTension,
}

impl ClearanceTension {
    /// The tension of scale `alpha` \[m^2/s^2\] that is felt where there is less room than `range_m`.
    pub(super) fn new(alpha: f64, range_m: f64) -> Result<Self, TensionError> {
        EdgeTension::new(alpha, 0.0, range_m).map(|tension| Self { tension })
    }

    /// Adds to the row of each vehicle what the obstacles do to it, and sums the tensions \[m^2/s^2\].
    pub(super) fn add_pushes(&self, at: &Observation<'_>, sums: &mut Rows) -> Result<f64, LawError> {
        self.walk(at.obstacles, &at.own.positions_m, |vehicle, push| {
            let sum = row(sums, vehicle) + push;
            set_row(sums, vehicle, sum);
        })
    }

    /// Sum of the tensions over all vehicles and obstacles \[m^2/s^2\].
    pub(super) fn potential(&self, obstacles: &[Obstacle], positions_m: &Rows) -> Result<f64, LawError> {
        self.walk(obstacles, positions_m, |_, _| {})
    }

    fn walk(
        &self,
        obstacles: &[Obstacle],
        positions_m: &Rows,
        mut pushed: impl FnMut(usize, nalgebra::Vector3<f64>),
    ) -> Result<f64, LawError> {
        let mut potential = 0.0;
        for vehicle in 0..positions_m.nrows() {
            let position_m = row(positions_m, vehicle);
            for (obstacle, solid) in obstacles.iter().enumerate() {
                let (room_m, outward) = solid.room_m(position_m);
                if room_m >= self.tension.rest_m() {
                    continue;
                }
                if room_m <= 0.0 {
                    let clearance_m = solid.clearance_m;
                    let distance_m = room_m + clearance_m;
                    return Err(LawError::Obstacle { vehicle, obstacle, distance_m, clearance_m });
                }
                pushed(vehicle, outward * -self.tension.derivative(room_m));
                potential += self.tension.value(room_m);
            }
        }
        Ok(potential)
    }

    /// V'' of a vehicle that has so little room \[1/s^2\].
    pub(super) fn rate_squared(&self, room_m: f64) -> f64 {
        if room_m < self.tension.rest_m() { self.tension.second_derivative(room_m) } else { 0.0 }
    }

    /// The least room that a vehicle can be left by so much energy \[m\].
    pub(super) fn least_room_m(&self, energy: f64) -> f64 {
        self.tension.push_side_root(energy)
    }
}

/// The least room that a slot of any leg has from an obstacle \[m\], where slots are places that stay.
pub(super) fn slot_room_m(context: &LawContext<'_>) -> Result<f64, ParameterError> {
    let Some(guidance) = context.guidance.filter(|guidance| guidance.motion.is_at_rest()) else {
        return Ok(f64::INFINITY);
    };
    let place_m = guidance.motion.at(0.0).position_m;
    let mut least_m = f64::INFINITY;
    let later = context.later.iter().map(|Leg { formation, .. }| formation);
    for formation in std::iter::once(context.formation).chain(later) {
        for vehicle in 0..formation.count() {
            for (obstacle, solid) in context.obstacles.iter().enumerate() {
                let (room_m, _) = solid.room_m(row(&formation.slots_m, vehicle) + place_m);
                if room_m <= 0.0 {
                    let clearance_m = solid.clearance_m;
                    let distance_m = room_m + clearance_m;
                    return Err(ParameterError::ObstacleOverSlot { vehicle, obstacle, distance_m, clearance_m });
                }
                least_m = least_m.min(room_m);
            }
        }
    }
    Ok(least_m)
}
