//! Whether the numbers that the plant computes in still tell positions apart.

use nalgebra::Vector3;

use super::ending::Breakdown;
use crate::scenario::Scenario;
use crate::swarm::{Swarm, mean_row, row};

/// What positions a flight needs to tell apart, and how far out its plant still does.
#[derive(Clone, Copy)]
pub(super) struct Resolution {
    /// The middle of the start, from where a plant counts positions.
    origin_m: Vector3<f64>,
    epsilon: f64,
    needed_m: f64,
}

impl Resolution {
    pub(super) fn of(scenario: &Scenario) -> Self {
        Self {
            origin_m: mean_row(&scenario.start.positions_m),
            epsilon: scenario.plant.epsilon(),
            needed_m: scenario.arrival.edge_error_m,
        }
    }

    /// Refuses a state in which a vehicle is so far out that neighbouring numbers are farther apart than what counts as
    /// reached: O(N).
    pub(super) fn check(&self, swarm: &Swarm, step: u64) -> Result<(), Breakdown> {
        let &Self { origin_m, epsilon, needed_m } = self;
        let far_m = (0..swarm.count()).map(|i| (row(&swarm.positions_m, i) - origin_m).amax()).fold(0.0, f64::max);
        let spacing_m = epsilon * far_m;
        if spacing_m > needed_m { Err(Breakdown::Unresolved { step, spacing_m, needed_m }) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formation::Formation;
    use crate::swarm::Rows;

    #[test]
    fn a_swarm_far_from_its_start_is_refused_and_one_that_starts_far_out_is_not() {
        let start = Swarm::at_rest(Rows::from_row_slice(&[1e6, 0.0, 0.0, 1e6 + 4.0, 0.0, 0.0]));
        let scenario = Scenario::new("pair", start.clone(), Formation::line(2, 3.0), 2.0, 1.0);
        let resolution = Resolution::of(&scenario);
        assert_eq!(resolution.check(&start, 0), Ok(()));
        let mut gone = start;
        // 0.01 m are 24 bits of 84 km.
        gone.positions_m.column_mut(1).fill(8.3e4);
        assert_eq!(resolution.check(&gone, 1), Ok(()));
        gone.positions_m.column_mut(1).fill(8.5e4);
        let refused = resolution.check(&gone, 1).expect_err("refused");
        assert!(matches!(refused, Breakdown::Unresolved { step: 1, spacing_m, .. } if spacing_m > 0.01), "{refused}");
    }
}
