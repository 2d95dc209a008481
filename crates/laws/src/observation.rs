//! Input of a control law at one instant.
//!
//! Vehicle i knows its own state and the target. Of each other vehicle j it has two states. The *received* state came
//! over a link of the graph, with the age of the message. The *sensed* state is measured by its own sensor. If
//! every vehicle knows the true present state of every other, all of these are one shared table without copies.

use std::fmt;

use nalgebra::Vector3;

use crate::formation::Formation;
use crate::graph::Graph;
use crate::target::Target;
use tautline_core::obstacle::Obstacle;
use tautline_core::swarm::{Rows, Swarm, row};

/// Input of a control law at one instant. SI units, one inertial frame.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// Time of the flight \[s\].
    pub time_s: f64,
    /// Own states as the vehicles know them: row i is the state of vehicle i as vehicle i knows it.
    pub own: &'a Swarm,
    /// States of other vehicles as each vehicle knows them.
    pub others: OtherStates<'a>,
    /// Formation and reference to reach.
    pub target: Target<'a>,
    /// Communication links.
    pub links: &'a Graph,
    /// Pairs i < j within the law's sensing range ([`crate::law::Capabilities::sensing_range_m`]), in index order. May
    /// contain pairs that are slightly farther apart. Empty for a law without a sensing range.
    pub near: &'a [(usize, usize)],
    /// Obstacles in the world.
    pub obstacles: &'a [Obstacle],
}

/// States of other vehicles as each vehicle knows them.
#[derive(Clone, Copy, Debug)]
pub enum OtherStates<'a> {
    /// Every vehicle knows all own states exactly: [`Observation::own`] holds them.
    Shared,
    /// Each vehicle has its own received and sensed states of the others.
    PerVehicle(&'a dyn NeighbourStates),
}

/// Received and sensed states that each vehicle has of every other.
pub trait NeighbourStates: fmt::Debug + Sync {
    /// State of vehicle `j` as vehicle `i` last received it; without a link from j to i the value is unspecified.
    fn received(&self, i: usize, j: usize) -> NeighbourState;

    /// State of vehicle `j` as vehicle `i` senses it.
    fn sensed(&self, i: usize, j: usize) -> NeighbourState;

    /// Whether the tables are of `count` vehicles.
    fn matches_count(&self, count: usize) -> bool;

    /// First vehicle whose received or sensed state is not finite in some table.
    fn first_not_finite(&self) -> Option<usize> {
        None
    }

    /// Positions for the search of near pairs, with the distance \[m\] to add to the sensing range. With this addition
    /// the search finds every pair whose sensed separation is in range. `None`: own positions and no addition.
    fn near_search_positions(&self) -> Option<(&Rows, f64)> {
        None
    }
}

/// Received and sensed states as dense tables: 100 bytes per ordered pair of vehicles.
#[derive(Clone, Debug, PartialEq)]
pub struct StateTables {
    /// Row j of `received[i]` is the state of vehicle j that vehicle i last received.
    pub received: Vec<Swarm>,
    /// `ages_s[i][j]` is the present age of that state \[s\].
    pub ages_s: Vec<Vec<f64>>,
    /// Row j of `sensed[i]` is the state of vehicle j that vehicle i senses.
    pub sensed: Vec<Swarm>,
}

/// State of one vehicle as another knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeighbourState {
    /// Position \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity \[m/s\].
    pub velocity_m_s: Vector3<f64>,
    /// Age of the state \[s\].
    pub age_s: f64,
}

impl NeighbourStates for StateTables {
    fn received(&self, i: usize, j: usize) -> NeighbourState {
        NeighbourState::of(&self.received[i], j, self.ages_s[i][j])
    }

    fn sensed(&self, i: usize, j: usize) -> NeighbourState {
        NeighbourState::of(&self.sensed[i], j, 0.0)
    }

    fn matches_count(&self, count: usize) -> bool {
        let Self { received, ages_s, sensed } = self;
        let swarms = received.iter().chain(sensed);
        [received.len(), ages_s.len(), sensed.len()].iter().all(|&length| length == count)
            && ages_s.iter().all(|ages_s| ages_s.len() == count)
            && swarms.flat_map(|swarm| [&swarm.positions_m, &swarm.velocities_m_s]).all(|rows| rows.nrows() == count)
    }

    fn first_not_finite(&self) -> Option<usize> {
        self.received.iter().chain(&self.sensed).find_map(Swarm::first_not_finite)
    }
}

impl NeighbourState {
    /// Returns the state of vehicle `j` of a swarm with age `age_s` \[s\].
    #[must_use]
    pub fn of(swarm: &Swarm, j: usize, age_s: f64) -> Self {
        Self { position_m: row(&swarm.positions_m, j), velocity_m_s: row(&swarm.velocities_m_s, j), age_s }
    }
}

impl<'a> Observation<'a> {
    /// Observation where every vehicle knows the true present states and the target is a formation at rest. The caller
    /// adds near pairs and obstacles.
    #[must_use]
    pub fn exact(swarm: &'a Swarm, links: &'a Graph, formation: &'a Formation) -> Self {
        Self {
            time_s: 0.0,
            own: swarm,
            others: OtherStates::Shared,
            target: Target::at_rest(formation),
            links,
            near: &[],
            obstacles: &[],
        }
    }

    /// Returns the state table that all vehicles share, if they share one.
    #[must_use]
    pub fn shared(&self) -> Option<&'a Swarm> {
        matches!(self.others, OtherStates::Shared).then_some(self.own)
    }

    /// Returns the state of vehicle `j` that vehicle `i` received over a link.
    ///
    /// # Panics
    /// If a vehicle is out of range.
    #[must_use]
    pub fn received(&self, i: usize, j: usize) -> NeighbourState {
        match self.others {
            OtherStates::Shared => NeighbourState::of(self.own, j, 0.0),
            OtherStates::PerVehicle(held) => held.received(i, j),
        }
    }

    /// Returns the state of vehicle `j` that vehicle `i` senses.
    ///
    /// # Panics
    /// If a vehicle is out of range.
    #[must_use]
    pub fn sensed(&self, i: usize, j: usize) -> NeighbourState {
        match self.others {
            OtherStates::Shared => NeighbourState::of(self.own, j, 0.0),
            OtherStates::PerVehicle(held) => held.sensed(i, j),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn received_and_sensed_states_come_from_the_shared_table_or_from_each_vehicle() {
        let swarm_at = |x: f64| Swarm::at_rest(Formation::line(2, x).slots_m);
        let (own, graph, formation) = (swarm_at(1.0), Graph::complete(2), Formation::line(2, 1.0));
        let exact = Observation::exact(&own, &graph, &formation);
        assert_eq!(exact.shared(), Some(&own));
        assert_eq!(exact.received(0, 1), exact.sensed(0, 1));
        assert_eq!((exact.received(0, 1).position_m.x, exact.received(0, 1).age_s), (1.0, 0.0));

        let held = StateTables {
            received: vec![swarm_at(2.0), swarm_at(3.0)],
            ages_s: vec![vec![0.0, 0.5]; 2],
            sensed: vec![swarm_at(4.0), swarm_at(5.0)],
        };
        let late = Observation { others: OtherStates::PerVehicle(&held), ..exact };
        assert_eq!(late.shared(), None);
        assert_eq!((late.received(0, 1).position_m.x, late.received(0, 1).age_s), (2.0, 0.5));
        assert_eq!((late.received(1, 1).position_m.x, late.sensed(1, 1).position_m.x), (3.0, 5.0));
    }
}
