//! Arrival criteria: when a formation counts as reached.

use serde::{Deserialize, Serialize};

use super::Reference;
use crate::formation::{Formation, Freedom, PositionError, largest_edge_error_m};
use crate::graph::Graph;
use tautline_core::swarm::{Swarm, row, separation};

/// Tolerance of `hold_s` \[s\], because times are sums and products of steps.
const TIME_ROUNDING_S: f64 = 1e-9;

/// Arrival criteria. To the end of the run, and at least for `hold_s`, both limits must hold, and every vehicle must be
/// within `edge_error_m` of its slot in the fitted formation.
///
/// Under a law that controls distances the fit may rotate, mirror and translate the formation. Under a law that
/// controls displacements it may translate it. Under a law that follows a reference, the slots move with the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Arrival {
    /// Largest error of a desired distance over the graph's edges, and of a vehicle's position in the formation, in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub edge_error_m: f64,
    /// Largest speed relative to the swarm's mean velocity, or to the reference's if one is followed, in m/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub disagreement_m_s: f64,
    /// Shortest time for which all limits must hold in s.
    #[schemars(extend("minimum" = 0))]
    pub hold_s: f64,
}

impl Default for Arrival {
    fn default() -> Self {
        Self { edge_error_m: 0.01, disagreement_m_s: 0.01, hold_s: 1.0 }
    }
}

/// Errors of a swarm with respect to its formation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FormationError {
    /// Largest error of a desired distance over the graph's edges \[m\].
    pub max_edge_error_m: f64,
    /// Root mean square distance from the fitted formation \[m\]. The fit may rotate and mirror it if the law allows
    /// this.
    pub rms_position_error_m: f64,
    /// Largest distance of a vehicle from its slot in the fitted formation \[m\].
    pub max_position_error_m: f64,
    /// Largest speed relative to the mean velocity, or to the reference's if one is followed \[m/s\].
    pub disagreement_m_s: f64,
}

impl FormationError {
    /// Computes the errors of a swarm with respect to a formation at the reference, fitted within `freedom`. Takes
    /// O(edges), or O(N) if [`largest_edge_error_m`] uses its bound.
    #[must_use]
    pub fn of(swarm: &Swarm, formation: &Formation, reference: &Reference, graph: &Graph, freedom: Freedom) -> Self {
        let error = PositionError::of(&swarm.positions_m, formation, reference.position_m, freedom);
        Self {
            max_edge_error_m: largest_edge_error_m(&swarm.positions_m, formation, graph),
            rms_position_error_m: error.rms_m,
            max_position_error_m: error.max_m,
            disagreement_m_s: Self::disagreement_m_s(swarm, reference, freedom),
        }
    }

    /// Returns the largest speed relative to the common velocity \[m/s\].
    fn disagreement_m_s(swarm: &Swarm, reference: &Reference, freedom: Freedom) -> f64 {
        let relative_m_s = |i: usize| (row(&swarm.velocities_m_s, i) - reference.velocity_m_s).norm();
        match freedom {
            Freedom::Fixed => (0..swarm.count()).map(relative_m_s).fold(0.0, f64::max),
            Freedom::Translation | Freedom::RigidMotion => swarm.disagreement_m_s(),
        }
    }

    /// Returns the errors of a run without samples: all NaN.
    #[must_use]
    pub fn unknown() -> Self {
        Self {
            max_edge_error_m: f64::NAN,
            rms_position_error_m: f64::NAN,
            max_position_error_m: f64::NAN,
            disagreement_m_s: f64::NAN,
        }
    }
}

impl Arrival {
    /// Whether a swarm is within the limits, as [`Arrival::is_within`] of its [`FormationError::of`].
    ///
    /// Checks speeds first, then some edges, then positions. Checks all edges only if positions do not decide: vehicles
    /// within e of their slots have distances within 2 e of the desired ones. O(N) except near the limits, without
    /// allocation.
    #[must_use]
    pub fn holds(
        &self,
        swarm: &Swarm,
        formation: &Formation,
        reference: &Reference,
        graph: &Graph,
        freedom: Freedom,
    ) -> bool {
        let positions_m = &swarm.positions_m;
        let has_length = |(i, j): (usize, usize)| {
            (separation(positions_m, i, j) - formation.desired_distance(i, j)).abs() <= self.edge_error_m
        };
        let is_slow = FormationError::disagreement_m_s(swarm, reference, freedom) <= self.disagreement_m_s;
        let may_hold = is_slow && formation.count() == swarm.count();
        if !may_hold || !graph.edges().take(swarm.count()).all(has_length) {
            return false;
        }
        let error_m = PositionError::of(positions_m, formation, reference.position_m, freedom).max_m;
        error_m <= self.edge_error_m
            && (2.0 * error_m <= self.edge_error_m
                || largest_edge_error_m(positions_m, formation, graph) <= self.edge_error_m)
    }

    /// Whether all errors are within the limits; false for values that are not finite.
    #[must_use]
    pub fn is_within(&self, distance: &FormationError) -> bool {
        distance.max_edge_error_m <= self.edge_error_m
            && distance.max_position_error_m <= self.edge_error_m
            && distance.disagreement_m_s <= self.disagreement_m_s
    }

    /// Whether limits that held from one time to another \[s\] held long enough.
    #[must_use]
    pub fn is_held(&self, since_s: f64, until_s: f64) -> bool {
        until_s - since_s >= self.hold_s - TIME_ROUNDING_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::set_row;

    #[test]
    fn each_arrival_limit_counts_and_nan_is_outside() {
        let arrival = Arrival::default();
        let good = FormationError {
            max_edge_error_m: 0.01,
            rms_position_error_m: 0.01,
            max_position_error_m: 0.01,
            disagreement_m_s: 0.01,
        };
        assert!(arrival.is_within(&good));
        for bad in [0.011, f64::NAN] {
            assert!(!arrival.is_within(&FormationError { max_edge_error_m: bad, ..good }));
            assert!(!arrival.is_within(&FormationError { max_position_error_m: bad, ..good }));
            assert!(!arrival.is_within(&FormationError { disagreement_m_s: bad, ..good }));
        }
    }

    #[test]
    fn one_displaced_vehicle_prevents_arrival_without_edge_errors() {
        let count = 400;
        let formation = Formation::grid(count, 2.0);
        let graph = Graph::star(count);
        let hub_m = row(&formation.slots_m, 0);
        let mut swarm = Swarm::at_rest(formation.slots_m.clone());
        // The displacement is across the edge to the hub, whose length changes only to second order.
        let along = (row(&swarm.positions_m, 399) - hub_m).normalize();
        let off_m = row(&swarm.positions_m, 399) + 0.19 * nalgebra::Vector3::new(-along.y, along.x, 0.0);
        set_row(&mut swarm.positions_m, 399, off_m);
        let arrival = Arrival::default();
        for freedom in [Freedom::Fixed, Freedom::Translation, Freedom::RigidMotion] {
            let distance = FormationError::of(&swarm, &formation, &Reference::at_rest(), &graph, freedom);
            assert!(distance.max_edge_error_m < 0.01 && distance.rms_position_error_m < 0.01, "{distance:?}");
            assert!(!arrival.is_within(&distance), "{distance:?}");
            assert!(!arrival.holds(&swarm, &formation, &Reference::at_rest(), &graph, freedom));
        }
    }

    #[test]
    fn hold_time_tolerates_rounding() {
        let arrival = Arrival { hold_s: 0.3, ..Arrival::default() };
        assert!(arrival.is_held(0.1, 0.1 + 0.1 + 0.2) && !arrival.is_held(0.1, 0.399));
    }
}
