//! What a law is told at one instant.
//!
//! Vehicle i knows its own state, the target, and of each other vehicle j what it *heard* (over a link of the graph, with
//! the age of the message) and what it *sees* (with a sensor of its own). Where every vehicle knows the true present
//! state of every other, all of these are one table that nobody copies.

use std::fmt;

use nalgebra::Vector3;

use crate::formation::Formation;
use crate::graph::Graph;
use crate::space::Obstacle;
use crate::target::Target;
use tautline_core::swarm::{Rows, Swarm, row};

/// What a law is told at one instant. SI units, one inertial frame.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// Time of the flight \[s\].
    pub time_s: f64,
    /// What each vehicle knows of itself: row i is vehicle i's own.
    pub own: &'a Swarm,
    /// What vehicles know of each other.
    pub others: Others<'a>,
    /// Where they shall go.
    pub target: Target<'a>,
    /// Who talks to whom.
    pub links: &'a Graph,
    /// Pairs i < j within the law's sensing range ([`crate::law::Capabilities::sensing_range_m`]) of each other, and perhaps some a
    /// little farther apart, in index order; none for a law that senses nobody.
    pub near: &'a [(usize, usize)],
    /// What stands in the way.
    pub obstacles: &'a [Obstacle],
}

/// What vehicles know of each other.
#[derive(Clone, Copy, Debug)]
pub enum Others<'a> {
    /// Everybody knows what everybody knows of himself: [`Observation::own`] is all there is.
    Shared,
    /// Each vehicle holds its own picture of the others.
    Held(&'a dyn Picture),
}

/// What each vehicle knows of each other, however it is kept.
pub trait Picture: fmt::Debug + Sync {
    /// What vehicle `i` heard of vehicle `j` over a link; of one without a link whatever is at hand.
    fn heard(&self, i: usize, j: usize) -> Neighbour;

    /// What vehicle `i` sees of vehicle `j`.
    fn seen(&self, i: usize, j: usize) -> Neighbour;

    /// Whether it is of so many vehicles.
    fn is_of(&self, count: usize) -> bool;

    /// The first vehicle of which somebody holds what is not finite.
    fn first_not_finite(&self) -> Option<usize> {
        None
    }

    /// Where vehicles are found to be near each other, and by how much more than the sensing range apart \[m\] they may be
    /// there who hold each other for near; their own states unless given.
    fn near_from(&self) -> Option<(&Rows, f64)> {
        None
    }
}

/// A picture of the swarm for each vehicle, as tables: 100 bytes for every two vehicles.
#[derive(Clone, Debug, PartialEq)]
pub struct Held {
    /// `heard[i]` has in row j what vehicle i last heard of vehicle j.
    pub heard: Vec<Swarm>,
    /// `ages_s[i][j]` is how old that was when it was heard and since \[s\].
    pub ages_s: Vec<Vec<f64>>,
    /// `seen[i]` has in row j what vehicle i sees of vehicle j.
    pub seen: Vec<Swarm>,
}

/// What one vehicle knows of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Position \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity \[m/s\].
    pub velocity_m_s: Vector3<f64>,
    /// Time since this was so \[s\].
    pub age_s: f64,
}

impl Picture for Held {
    fn heard(&self, i: usize, j: usize) -> Neighbour {
        Neighbour::of(&self.heard[i], j, self.ages_s[i][j])
    }

    fn seen(&self, i: usize, j: usize) -> Neighbour {
        Neighbour::of(&self.seen[i], j, 0.0)
    }

    fn is_of(&self, count: usize) -> bool {
        let Self { heard, ages_s, seen } = self;
        let swarms = heard.iter().chain(seen);
        [heard.len(), ages_s.len(), seen.len()].iter().all(|&length| length == count)
            && ages_s.iter().all(|ages_s| ages_s.len() == count)
            && swarms.flat_map(|swarm| [&swarm.positions_m, &swarm.velocities_m_s]).all(|rows| rows.nrows() == count)
    }

    fn first_not_finite(&self) -> Option<usize> {
        self.heard.iter().chain(&self.seen).find_map(Swarm::first_not_finite)
    }
}

impl Neighbour {
    /// State of vehicle `j` of a swarm, `age_s` old \[s\].
    #[must_use]
    pub fn of(swarm: &Swarm, j: usize, age_s: f64) -> Self {
        Self { position_m: row(&swarm.positions_m, j), velocity_m_s: row(&swarm.velocities_m_s, j), age_s }
    }
}

impl<'a> Observation<'a> {
    /// The true present state, known to everybody, of a swarm on its way to a formation at rest. Near pairs and obstacles
    /// are for the caller to add.
    #[must_use]
    pub fn exact(swarm: &'a Swarm, links: &'a Graph, formation: &'a Formation) -> Self {
        Self {
            time_s: 0.0,
            own: swarm,
            others: Others::Shared,
            target: Target::at_rest(formation),
            links,
            near: &[],
            obstacles: &[],
        }
    }

    /// The one state that all vehicles share, where they do.
    #[must_use]
    pub fn shared(&self) -> Option<&'a Swarm> {
        matches!(self.others, Others::Shared).then_some(self.own)
    }

    /// What vehicle `i` heard of vehicle `j` over a link.
    ///
    /// # Panics
    /// If a vehicle is out of range.
    #[must_use]
    pub fn heard(&self, i: usize, j: usize) -> Neighbour {
        match self.others {
            Others::Shared => Neighbour::of(self.own, j, 0.0),
            Others::Held(held) => held.heard(i, j),
        }
    }

    /// What vehicle `i` sees of vehicle `j`.
    ///
    /// # Panics
    /// If a vehicle is out of range.
    #[must_use]
    pub fn seen(&self, i: usize, j: usize) -> Neighbour {
        match self.others {
            Others::Shared => Neighbour::of(self.own, j, 0.0),
            Others::Held(held) => held.seen(i, j),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shared_state_is_what_everybody_hears_and_sees_and_a_held_one_is_each_vehicles_own() {
        let at = |x: f64| Swarm::at_rest(Formation::line(2, x).slots_m);
        let (own, graph, formation) = (at(1.0), Graph::complete(2), Formation::line(2, 1.0));
        let exact = Observation::exact(&own, &graph, &formation);
        assert_eq!(exact.shared(), Some(&own));
        assert_eq!(exact.heard(0, 1), exact.seen(0, 1));
        assert_eq!((exact.heard(0, 1).position_m.x, exact.heard(0, 1).age_s), (1.0, 0.0));

        let held =
            Held { heard: vec![at(2.0), at(3.0)], ages_s: vec![vec![0.0, 0.5]; 2], seen: vec![at(4.0), at(5.0)] };
        let late = Observation { others: Others::Held(&held), ..exact };
        assert_eq!(late.shared(), None);
        assert_eq!((late.heard(0, 1).position_m.x, late.heard(0, 1).age_s), (2.0, 0.5));
        assert_eq!((late.heard(1, 1).position_m.x, late.seen(1, 1).position_m.x), (3.0, 5.0));
    }
}
