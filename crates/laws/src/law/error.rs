//! Errors of laws: undefined commands and invalid parameters.

use crate::formation::Formation;
use crate::graph::Graph;
use crate::space::{Metric, clearance_margin_m};
use tautline_core::failure::Failure;
use tautline_core::obstacle::Obstacle;
use tautline_core::swarm::{Pair, Swarm, first_row_not_finite, row};
use tautline_core::text::{beside_limit, exact};

use super::tension::TensionError;

/// Relative difference below which two distances are equal.
const ROUNDING: f64 = 1e-9;

/// Reason why a law is undefined for a state.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LawError {
    /// A custom law failed; its caller knows the reason.
    #[error("it failed")]
    Failed,
    /// A pair is at or inside the distance where its tension is infinite. This is a collision; values are not clamped.
    #[error(
        "vehicles {pair} are {} m apart, not more than the safety distance {} m",
        beside_limit(*separation_m, *delta_m, 3),
        exact(*delta_m)
    )]
    Collision {
        /// The first such pair in index order.
        pair: Pair,
        /// Its separation \[m\].
        separation_m: f64,
        /// The safety distance delta \[m\].
        delta_m: f64,
    },
    /// A vehicle is at or inside the clearance of an obstacle, where the law's tension is infinite.
    #[error(
        "vehicle {} is {} m from obstacle {}, not more than the clearance {} m",
        vehicle + 1,
        beside_limit(*distance_m, *clearance_m, 3),
        obstacle + 1,
        exact(*clearance_m)
    )]
    Obstacle {
        /// The first such vehicle, from 0.
        vehicle: usize,
        /// The first such obstacle, from 0.
        obstacle: usize,
        /// Distance of the vehicle from the obstacle's surface \[m\].
        distance_m: f64,
        /// Clearance of the obstacle \[m\].
        clearance_m: f64,
    },
    /// A pair is at or inside the barrier distance by a sensed or received state, though not in truth.
    #[error(
        "vehicles {pair} sense or receive a separation of {} m, not more than the safety distance {} m; their true \
         separation is {} m",
        beside_limit(*known_m, *delta_m, 3),
        exact(*delta_m),
        beside_limit(*true_m, *delta_m, 3)
    )]
    KnownCollision {
        /// The first such pair in index order.
        pair: Pair,
        /// Its separation by the states that a vehicle of the pair knows \[m\].
        known_m: f64,
        /// Its true separation \[m\].
        true_m: f64,
        /// The safety distance delta \[m\].
        delta_m: f64,
    },
    /// A vehicle is at or inside the clearance of an obstacle by its sensed position, though not in truth.
    #[error(
        "vehicle {} senses a distance of {} m from obstacle {}, not more than the clearance {} m; its true distance is \
         {} m",
        vehicle + 1,
        beside_limit(*known_m, *clearance_m, 3),
        obstacle + 1,
        exact(*clearance_m),
        beside_limit(*true_m, *clearance_m, 3)
    )]
    KnownObstacle {
        /// The first such vehicle, from 0.
        vehicle: usize,
        /// The first such obstacle, from 0.
        obstacle: usize,
        /// Distance from its surface by the sensed position \[m\].
        known_m: f64,
        /// True distance from its surface \[m\].
        true_m: f64,
        /// Clearance of the obstacle \[m\].
        clearance_m: f64,
    },
    /// A position or velocity is not a finite number.
    #[error("the state of vehicle {} is not a finite number", vehicle + 1)]
    NotFinite {
        /// The first such vehicle, from 0.
        vehicle: usize,
    },
    /// The state is finite, but distances, velocities or accelerations computed from it are not.
    #[error("the state of the swarm is too large for double precision")]
    OutOfRange,
    /// The slots of a pair are so close that its tension does not exist.
    #[error(
        "the slots of vehicles {pair} are {} m apart, not more than the safety distance {} m",
        beside_limit(*distance_m, *delta_m, 3),
        exact(*delta_m)
    )]
    Target {
        /// The first such pair in index order.
        pair: Pair,
        /// Distance of its slots \[m\].
        distance_m: f64,
        /// The safety distance delta \[m\].
        delta_m: f64,
    },
    /// The received and sensed states are of a swarm of another size.
    #[error("the law is for {count} vehicles; the received and sensed states are of another count")]
    Pictures {
        /// Number of vehicles of the law.
        count: usize,
    },
    /// The state or the table of accelerations is of a swarm of another size.
    #[error("the law is for {expected} vehicles and was given {found}")]
    WrongCount {
        /// Number of vehicles of the law.
        expected: usize,
        /// Number of vehicles given.
        found: usize,
    },
}

impl LawError {
    /// Whether a pair or a vehicle at an obstacle reached the barrier of the law, in truth or by sensed states.
    #[must_use]
    pub fn is_at_barrier(self) -> bool {
        matches!(
            self,
            Self::Collision { .. } | Self::Obstacle { .. } | Self::KnownCollision { .. } | Self::KnownObstacle { .. }
        )
    }

    /// Adds the true distance to an error that is based on sensed or received states, if the two distances differ.
    /// `metric` measures separations.
    #[must_use]
    pub fn with_true_distance(self, truth: &Swarm, metric: Metric, obstacles: &[Obstacle]) -> Self {
        let place = |vehicle: usize| row(&truth.positions_m, vehicle);
        let differs = |known_m: f64, true_m: f64| (known_m - true_m).abs() > ROUNDING * known_m.abs().max(true_m.abs());
        match self {
            Self::Collision { pair, separation_m: known_m, delta_m } => {
                let true_m = metric.scaled(place(pair.second()) - place(pair.first())).norm();
                if differs(known_m, true_m) { Self::KnownCollision { pair, known_m, true_m, delta_m } } else { self }
            }
            Self::Obstacle { vehicle, obstacle, distance_m: known_m, clearance_m } => {
                let Some(solid) = obstacles.get(obstacle) else { return self };
                let true_m = clearance_margin_m(solid, place(vehicle)).0 + solid.clearance_m;
                if differs(known_m, true_m) {
                    Self::KnownObstacle { vehicle, obstacle, known_m, true_m, clearance_m }
                } else {
                    self
                }
            }
            other => other,
        }
    }
}

/// Reason why a law cannot be built from its parameters.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// An edge has no tension.
    #[error("vehicles {pair}: {source}")]
    Tension {
        /// The first such edge in index order.
        pair: Pair,
        /// Reason why the tension does not exist.
        source: TensionError,
    },
    /// A slot is at or inside the clearance of an obstacle.
    #[error(
        "the slot of vehicle {} is {} m from obstacle {}, not more than the clearance {} m",
        vehicle + 1,
        beside_limit(*distance_m, *clearance_m, 3),
        obstacle + 1,
        exact(*clearance_m)
    )]
    ObstacleOverSlot {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The obstacle, from 0.
        obstacle: usize,
        /// Distance of the slot from its surface \[m\].
        distance_m: f64,
        /// Clearance of the obstacle \[m\].
        clearance_m: f64,
    },
    /// Graph and formation differ in their numbers of vehicles.
    #[error("the graph has {graph} vehicles and the formation has {formation}")]
    Counts {
        /// Number of vehicles of the graph.
        graph: usize,
        /// Number of slots of the formation.
        formation: usize,
    },
    /// The graph is not connected.
    #[error("the graph is not connected: no path joins vehicle {} to vehicle 1", vehicle + 1)]
    Disconnected {
        /// First vehicle without a path of links to vehicle 1, from 0.
        vehicle: usize,
    },
    /// The scenario has a reference, and no vehicle knows it.
    #[error("no vehicle knows the reference")]
    ReferenceUnknown,
    /// Some vehicles do not know the reference, and the law has no links over which they could follow it.
    #[error("the law has no links over which vehicles that do not know the reference could follow it")]
    ReferenceNotHeard,
    /// A gain is not a finite number.
    #[error("{name} is {value}; it must be a finite number")]
    NotFinite {
        /// Symbol of the gain in the equations.
        name: &'static str,
        /// Value of the gain.
        value: f64,
    },
    /// A key has no effect in the nominal variant of the law.
    #[error("{name} is {value}, and only the braking variant uses it")]
    OnlyBraking {
        /// Name of the key.
        name: &'static str,
        /// Value of the key.
        value: f64,
    },
    /// The velocity coefficient a22 accelerates a vehicle more than its brake decelerates it.
    #[error(
        "max_speed_m_s is {max_speed_m_s}: there a22 = {a22_per_s} 1/s accelerates by more than the brake of \
         {max_accel_m_s2} m/s^2"
    )]
    CannotBrake {
        /// Largest speed \[m/s\].
        max_speed_m_s: f64,
        /// Largest acceleration \[m/s^2\].
        max_accel_m_s2: f64,
        /// Velocity coefficient a22 \[1/s\].
        a22_per_s: f64,
    },
    /// A slot of the formation is not a finite number.
    #[error("the slot of vehicle {} is not a finite number", vehicle + 1)]
    Slot {
        /// The first such vehicle, from 0.
        vehicle: usize,
    },
    /// The edges do not fit in memory.
    #[error("{edges} edges do not fit in memory")]
    Memory {
        /// Number of edges.
        edges: usize,
    },
}

impl ParameterError {
    pub(super) fn check(graph: &Graph, formation: &Formation, gains: &[(&'static str, f64)]) -> Result<(), Self> {
        if graph.count() != formation.count() {
            return Err(Self::Counts { graph: graph.count(), formation: formation.count() });
        }
        if let Some(vehicle) = first_row_not_finite(&formation.slots_m) {
            return Err(Self::Slot { vehicle });
        }
        match gains.iter().find(|(_, value)| !value.is_finite()) {
            Some(&(name, value)) => Err(Self::NotFinite { name, value }),
            None => Ok(()),
        }
    }
}

impl From<ParameterError> for Failure {
    fn from(error: ParameterError) -> Self {
        Self::new("law/parameter", false, error.to_string())
    }
}
