//! One-sided tension between vehicles and the surfaces of fixed obstacles.

use super::error::{LawError, ParameterError};
use super::interface::LawContext;
use super::tension::{EdgeTension, TensionError};
use crate::observation::Observation;
use crate::space::clearance_margin_m;
use crate::target::Leg;
use tautline_core::obstacle::Obstacle;
use tautline_core::swarm::{Rows, row, set_row};

/// Edge tension on the clearance margin of a vehicle at an obstacle: its distance from the surface less the clearance.
/// It pushes where the margin is below a range, and becomes infinite as the margin vanishes.
///
/// Along the gradient of the margin at a convex obstacle the Hessian of V is V''. Across it the Hessian is V' times a
/// curvature >= 0, and V' < 0. Hence the Hessian is at most V''.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClearanceTension {
    /// Tension with its barrier at margin 0.
    tension: EdgeTension,
}

impl ClearanceTension {
    /// Builds the tension of scale `alpha` \[m^2/s^2\] that acts where the margin is below `range_m`.
    pub(super) fn new(alpha: f64, range_m: f64) -> Result<Self, TensionError> {
        EdgeTension::new(alpha, 0.0, range_m).map(|tension| Self { tension })
    }

    /// Adds the push of the obstacles to the row of each vehicle, and returns the sum of the tensions \[m^2/s^2\].
    pub(super) fn add_pushes(&self, observation: &Observation<'_>, sums: &mut Rows) -> Result<f64, LawError> {
        self.sum_tensions(observation.obstacles, &observation.own.positions_m, |vehicle, push| {
            let sum = row(sums, vehicle) + push;
            set_row(sums, vehicle, sum);
        })
    }

    /// Sum of the tensions over all vehicles and obstacles \[m^2/s^2\].
    pub(super) fn potential(&self, obstacles: &[Obstacle], positions_m: &Rows) -> Result<f64, LawError> {
        self.sum_tensions(obstacles, positions_m, |_, _| {})
    }

    fn sum_tensions(
        &self,
        obstacles: &[Obstacle],
        positions_m: &Rows,
        mut pushed: impl FnMut(usize, nalgebra::Vector3<f64>),
    ) -> Result<f64, LawError> {
        let mut potential = 0.0;
        for vehicle in 0..positions_m.nrows() {
            let position_m = row(positions_m, vehicle);
            for (obstacle, solid) in obstacles.iter().enumerate() {
                let (clearance_margin_m, outward) = clearance_margin_m(solid, position_m);
                if clearance_margin_m >= self.tension.rest_m() {
                    continue;
                }
                if clearance_margin_m <= 0.0 {
                    let clearance_m = solid.clearance_m;
                    let distance_m = clearance_margin_m + clearance_m;
                    return Err(LawError::Obstacle { vehicle, obstacle, distance_m, clearance_m });
                }
                pushed(vehicle, outward * -self.tension.derivative(clearance_margin_m));
                potential += self.tension.value(clearance_margin_m);
            }
        }
        Ok(potential)
    }

    /// Returns V'' at a margin \[1/s^2\]; 0 out of range.
    pub(super) fn rate_squared(&self, clearance_margin_m: f64) -> f64 {
        if clearance_margin_m < self.tension.rest_m() {
            self.tension.second_derivative(clearance_margin_m)
        } else {
            0.0
        }
    }

    /// Returns the smallest margin that an energy \[m^2/s^2\] allows \[m\].
    pub(super) fn smallest_clearance_margin_m(&self, energy: f64) -> f64 {
        self.tension.push_side_root(energy)
    }
}

/// Returns the smallest margin of any slot of any leg \[m\] for a reference at rest; infinite if slots have no fixed
/// place.
pub(super) fn slot_clearance_margin_m(context: &LawContext<'_>) -> Result<f64, ParameterError> {
    let Some(guidance) = context.guidance.filter(|guidance| guidance.motion.is_at_rest()) else {
        return Ok(f64::INFINITY);
    };
    let place_m = guidance.motion.at(0.0).position_m;
    let mut least_m = f64::INFINITY;
    let later = context.later.iter().map(|Leg { formation, .. }| formation);
    for formation in std::iter::once(context.formation).chain(later) {
        for vehicle in 0..formation.count() {
            for (obstacle, solid) in context.obstacles.iter().enumerate() {
                let (clearance_margin_m, _) = clearance_margin_m(solid, row(&formation.slots_m, vehicle) + place_m);
                if clearance_margin_m <= 0.0 {
                    let clearance_m = solid.clearance_m;
                    let distance_m = clearance_margin_m + clearance_m;
                    return Err(ParameterError::ObstacleOverSlot { vehicle, obstacle, distance_m, clearance_m });
                }
                least_m = least_m.min(clearance_margin_m);
            }
        }
    }
    Ok(least_m)
}
