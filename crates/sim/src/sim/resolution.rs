//! How far rounding may have moved the vehicles of a flight.

use nalgebra::Vector3;

use super::ending::Breakdown;
use crate::scenario::Scenario;
use tautline_core::swarm::{Rows, Swarm, mean_row};

/// Roundings of a velocity in one step: two half kicks and the drift between them.
const VELOCITY_ROUNDINGS: f64 = 3.0;

/// Upper bound of what rounding has moved any coordinate by since the start.
///
/// Every step rounds a position x, counted from the middle of the start, to half a unit in the last place, and a velocity v a
/// few times; what a velocity is off by moves the vehicle from then on:
///
/// ```text
/// e_v' = e_v + 3 (eps/2) |v|        e_x' = e_x + e_v' dt + (eps/2) |x|        eps = 2^-52
/// ```
///
/// A vehicle whose displacement in a step is below half a unit in the last place of its position stands still: what it does not
/// move by is part of the bound.
#[derive(Clone, Copy)]
pub(super) struct Resolution {
    /// Middle of the start, from which a plant counts positions \[m\].
    origin_m: Vector3<f64>,
    required_m: f64,
    velocity_m_s: f64,
    position_m: f64,
    /// Rounding of the present positions, which are counted from the scenario's origin \[m\].
    present_m: f64,
}

impl Resolution {
    pub(super) fn of(scenario: &Scenario) -> Self {
        Self {
            origin_m: mean_row(&scenario.start.positions_m),
            required_m: scenario.arrival.edge_error_m,
            velocity_m_s: 0.0,
            position_m: 0.0,
            present_m: 0.0,
        }
    }

    /// Takes a step of `dt_s` \[s\] that ended in a state: O(N).
    ///
    /// # Errors
    /// [`Breakdown::Unresolved`] where the bound exceeds the position error that counts as reached.
    pub(super) fn take(&mut self, swarm: &Swarm, dt_s: f64, step: u64) -> Result<(), Breakdown> {
        let half_unit = 0.5 * f64::EPSILON;
        let far_m = largest_coordinate(&swarm.positions_m, self.origin_m);
        self.velocity_m_s +=
            VELOCITY_ROUNDINGS * half_unit * largest_coordinate(&swarm.velocities_m_s, Vector3::zeros());
        self.position_m += self.velocity_m_s * dt_s + half_unit * far_m;
        self.present_m = half_unit * (far_m + self.origin_m.amax());
        let (rounding_m, required_m) = (self.rounding_m(), self.required_m);
        if rounding_m > required_m { Err(Breakdown::Unresolved { step, rounding_m, required_m }) } else { Ok(()) }
    }

    /// The bound for one coordinate \[m\].
    pub(super) fn rounding_m(&self) -> f64 {
        self.position_m + self.present_m
    }
}

/// Largest magnitude of a coordinate counted from an origin.
fn largest_coordinate(rows: &Rows, origin: Vector3<f64>) -> f64 {
    let largest = |axis: usize| rows.column(axis).iter().fold(0.0_f64, |most, x| most.max((x - origin[axis]).abs()));
    largest(0).max(largest(1)).max(largest(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_laws::formation::Formation;

    /// How many steps of `dt_s` two vehicles fly at rest or at a speed until the bound is exceeded; at most 100,000.
    fn steps(from_m: f64, at_m: f64, speed_m_s: f64, dt_s: f64) -> u64 {
        let rows = |x_m: f64| Rows::from_row_slice(&[x_m, 0.0, 0.0, x_m + 4.0, 0.0, 0.0]);
        let scenario = Scenario::new("pair", Swarm::at_rest(rows(from_m)), Formation::line(2, 3.0), 2.0, 1.0);
        let mut resolution = Resolution::of(&scenario);
        let mut state = Swarm::at_rest(rows(at_m));
        state.velocities_m_s.column_mut(1).fill(speed_m_s);
        let is_exceeded = |step: &u64| match resolution.take(&state, dt_s, *step) {
            Err(Breakdown::Unresolved { step: at, rounding_m, required_m }) => {
                assert!(at == *step && rounding_m > required_m && required_m == 0.01);
                true
            }
            other => {
                assert_eq!(other, Ok(()));
                false
            }
        };
        (1..=100_000).find(is_exceeded).unwrap_or(100_000)
    }

    #[test]
    fn a_swarm_far_from_its_start_is_refused_after_the_steps_that_round_it_away() {
        // Half a unit of 2^30 m is 1.2e-7 m, of 2^40 m 1.2e-4 m.
        assert_eq!(steps(0.0, 2.0_f64.powi(30), 0.0, 0.01), 83_886);
        assert!(steps(0.0, 2.0_f64.powi(40), 0.0, 0.01) < 90);
        assert_eq!(steps(1e6, 1e6, 0.0, 0.01), 100_000, "it starts there");
    }

    #[test]
    fn what_velocities_are_off_by_adds_up_with_time() {
        assert_eq!(steps(0.0, 0.0, 1.0, 1.0 / 240.0), 100_000);
        // 3.3e-16 of 1e6 m/s a step, 1 s each: 0.01 m after some 7,700 steps.
        assert!((7_000..8_500).contains(&steps(0.0, 0.0, 1e6, 1.0)));
    }
}
