//! Why a law has no answer, or does not exist.

use crate::formation::Formation;
use crate::graph::Graph;
use crate::space::{Metric, Obstacle};
use tautline_core::swarm::{Pair, Swarm, first_row_not_finite, row};

use super::tension::TensionError;

/// Distances that differ by no more than this part of them are the same.
const ROUNDING: f64 = 1e-9;

/// Why a law has no answer for a state.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LawError {
    /// A law that is not one of ours failed, for a reason that whoever brought it knows.
    #[error("it failed")]
    Failed,
    /// A pair is at or inside the distance where its tension is infinite: a collision, not a number to clamp.
    #[error("vehicles {pair} are {separation_m} m apart, not more than the safety distance {delta_m} m")]
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
        "vehicle {} is {distance_m} m from obstacle {}, not more than the clearance {clearance_m} m",
        vehicle + 1,
        obstacle + 1
    )]
    Obstacle {
        /// The first such vehicle, from 0.
        vehicle: usize,
        /// The first such obstacle, from 0.
        obstacle: usize,
        /// Distance from its surface \[m\].
        distance_m: f64,
        /// What must be kept \[m\].
        clearance_m: f64,
    },
    /// A pair is at or inside the distance where its tension is infinite by what the vehicles know, and not where they are.
    #[error(
        "by what they measured or heard of each other, vehicles {pair} are {known_m} m apart, not more than the safety distance \
         {delta_m} m; their true distance is {true_m} m"
    )]
    KnownCollision {
        /// The first such pair in index order.
        pair: Pair,
        /// Its separation by what a vehicle of the pair knows \[m\].
        known_m: f64,
        /// Its true separation \[m\].
        true_m: f64,
        /// The safety distance delta \[m\].
        delta_m: f64,
    },
    /// A vehicle is at or inside the clearance of an obstacle by what it knows, and not where it is.
    #[error(
        "by what it measured, vehicle {} is {known_m} m from obstacle {}, not more than the clearance {clearance_m} m; its true \
         distance is {true_m} m",
        vehicle + 1,
        obstacle + 1
    )]
    KnownObstacle {
        /// The first such vehicle, from 0.
        vehicle: usize,
        /// The first such obstacle, from 0.
        obstacle: usize,
        /// Distance from its surface by what the vehicle knows \[m\].
        known_m: f64,
        /// True distance from its surface \[m\].
        true_m: f64,
        /// What must be kept \[m\].
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
    /// Two slots of a leg are too near for the pair's tension to exist.
    #[error("the slots of vehicles {pair} are {distance_m} m apart, not more than the safety distance {delta_m} m")]
    Target {
        /// The first such pair in index order.
        pair: Pair,
        /// The distance of its slots \[m\].
        distance_m: f64,
        /// The safety distance delta \[m\].
        delta_m: f64,
    },
    /// What vehicles know of each other is of another swarm.
    #[error("the law is for {count} vehicles and was given what others know of each other")]
    Pictures {
        /// Number of vehicles of the law.
        count: usize,
    },
    /// The state or the table of accelerations is of another swarm.
    #[error("the law is for {expected} vehicles and was given {found}")]
    WrongCount {
        /// Number of vehicles of the law.
        expected: usize,
        /// Number of vehicles given.
        found: usize,
    },
}

impl LawError {
    /// Whether a pair, or a vehicle and an obstacle, came to the barrier of the law, in truth or by what vehicles know.
    #[must_use]
    pub fn is_at_a_barrier(self) -> bool {
        matches!(
            self,
            Self::Collision { .. } | Self::Obstacle { .. } | Self::KnownCollision { .. } | Self::KnownObstacle { .. }
        )
    }

    /// The same reason with the true distance beside the one that vehicles know, where the two differ. Separations are lengths of
    /// `metric`.
    #[must_use]
    pub fn against_truth(self, truth: &Swarm, metric: Metric, obstacles: &[Obstacle]) -> Self {
        let place = |vehicle: usize| row(&truth.positions_m, vehicle);
        let differs = |known_m: f64, true_m: f64| (known_m - true_m).abs() > ROUNDING * known_m.abs().max(true_m.abs());
        match self {
            Self::Collision { pair, separation_m: known_m, delta_m } => {
                let true_m = metric.scaled(place(pair.second()) - place(pair.first())).norm();
                if differs(known_m, true_m) { Self::KnownCollision { pair, known_m, true_m, delta_m } } else { self }
            }
            Self::Obstacle { vehicle, obstacle, distance_m: known_m, clearance_m } => {
                let Some(solid) = obstacles.get(obstacle) else { return self };
                let true_m = solid.room_m(place(vehicle)).0 + solid.clearance_m;
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

/// Why a law cannot be made from its parameters.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// An edge has no tension.
    #[error("vehicles {pair}: {source}")]
    Tension {
        /// The first such edge in index order.
        pair: Pair,
        /// What is wrong.
        source: TensionError,
    },
    /// A slot leaves a vehicle no room from an obstacle.
    #[error(
        "the slot of vehicle {} is {distance_m} m from obstacle {}, not more than the clearance {clearance_m} m",
        vehicle + 1,
        obstacle + 1
    )]
    ObstacleOverSlot {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The obstacle, from 0.
        obstacle: usize,
        /// Distance of the slot from its surface \[m\].
        distance_m: f64,
        /// What must be kept \[m\].
        clearance_m: f64,
    },
    /// Graph and formation are of different swarms.
    #[error("the graph has {graph} vehicles and the formation has {formation}")]
    Counts {
        /// Number of vehicles of the graph.
        graph: usize,
        /// Number of slots of the formation.
        formation: usize,
    },
    /// No path of links joins a vehicle to the first one.
    #[error("the graph is not connected: no path joins vehicle {} to vehicle 1", vehicle + 1)]
    Disconnected {
        /// The first such vehicle, from 0.
        vehicle: usize,
    },
    /// There is a reference, and no vehicle knows it.
    #[error("no vehicle knows the reference")]
    NobodyKnowsTheReference,
    /// The law has no links over which those who do not know the reference could learn of it.
    #[error("the law has no links over which vehicles that do not know the reference could follow it")]
    ReferenceNotHeard,
    /// A gain is not a finite number.
    #[error("{name} is {value}; it must be a finite number")]
    NotFinite {
        /// The gain, as in the equations.
        name: &'static str,
        /// As given.
        value: f64,
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
