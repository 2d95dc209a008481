//! All imperfections of a scenario in one link.

use super::actuation::Actuation;
use super::failure::Failing;
use super::history::History;
use super::network::{Missing, NearBy, Network};
use super::sensing::{Sensing, Sight};
use super::{Direct, Imperfections, Sensed, Traffic};
use crate::scenario::Scenario;
use tautline_core::record::Channel;
use tautline_core::swarm::{Rows, Swarm, row};
use tautline_laws::observation::{Neighbour, Others, Picture};

/// Solver steps of continuous time within the shortest delay, so that the past is interpolated finely enough.
const STEPS_PER_DELAY: f64 = 8.0;

/// What lies between truth and law in a scenario, [`Direct`] where nothing does. A law may sense who is near, or not.
#[must_use]
pub fn of(scenario: &Scenario, senses: bool) -> Box<dyn Imperfections> {
    if scenario.is_exact() { Box::new(Direct) } else { Box::new(World::new(scenario, senses)) }
}

/// Sensors, network and actuators of a scenario.
#[derive(Clone, Debug)]
struct World {
    history: History,
    sensing: Sensing,
    sight: Sight,
    network: Network,
    actuation: Actuation,
    failing: Failing,
    missing: Missing,
    near: NearBy,
    /// Whether what vehicles know of themselves is all that anybody knows.
    is_shared: bool,
    /// Whether vehicles know their own present state.
    knows_itself: bool,
    time_s: f64,
    own: Swarm,
    /// How far anybody is, or is held by another, from where it is seen \[m\].
    slack_m: f64,
}

impl World {
    fn new(scenario: &Scenario, senses: bool) -> Self {
        let (sensing, sight) = (Sensing::new(scenario), Sight::new(scenario));
        let network = Network::new(scenario, &sensing);
        let span_s = sensing.span_s().max(sight.span_s()) + scenario.network.latency_s;
        Self {
            history: History::new(span_s),
            is_shared: matches!(network, Network::None) && (!senses || sight.is_own()),
            knows_itself: sensing.is_exact(),
            sensing,
            sight,
            network,
            actuation: Actuation::new(scenario),
            failing: Failing::new(scenario),
            missing: scenario.network.missing,
            near: scenario.network.near,
            time_s: 0.0,
            own: scenario.start.clone(),
            slack_m: 0.0,
        }
    }

    /// What stands for a message, old as it is, at the time of a vehicle's own measurement.
    fn carried(&self, heard: Neighbour) -> Neighbour {
        if self.missing == Missing::Hold {
            return heard;
        }
        let own_age_s = self.time_s - self.sensing.measured_s(self.time_s);
        let ahead_s = (heard.age_s - own_age_s).max(0.0);
        Neighbour { position_m: heard.position_m + heard.velocity_m_s * ahead_s, ..heard }
    }

    /// Who is near where vehicles know each other by messages is found where they are, and they hold each other elsewhere.
    fn find_slack(&mut self, truth: &Swarm) {
        let own = (0..self.own.count())
            .map(|i| (row(&self.own.positions_m, i) - row(&truth.positions_m, i)).norm())
            .fold(0.0, f64::max);
        let carried = |heard: Neighbour| self.carried(heard);
        let others = self.network.farthest_m(&truth.positions_m, carried, self.time_s, own);
        self.slack_m = own + others;
    }
}

impl Picture for World {
    fn heard(&self, i: usize, j: usize) -> Neighbour {
        let heard = self.network.heard(i, j, self.time_s).map(|heard| self.carried(heard));
        heard.unwrap_or_else(|| Neighbour::of(&self.own, j, self.time_s - self.sensing.measured_s(self.time_s)))
    }

    fn seen(&self, i: usize, j: usize) -> Neighbour {
        match self.near {
            NearBy::Seen => self.sight.of(&self.own, i, j),
            NearBy::Heard => self.heard(i, j),
        }
    }

    fn is_of(&self, count: usize) -> bool {
        self.own.count() == count
    }

    fn near_from(&self) -> Option<(&Rows, f64)> {
        Some((self.sight.seen_m(), self.slack_m))
    }
}

impl Imperfections for World {
    fn sense<'a>(&'a mut self, time_s: f64, truth: &'a Swarm) -> Sensed<'a> {
        self.time_s = time_s;
        if self.is_shared {
            if self.knows_itself {
                return Sensed { own: truth, others: Others::Shared };
            }
            self.sensing.know_now(&self.history, time_s, truth, &mut self.own);
            return Sensed { own: &self.own, others: Others::Shared };
        }
        self.sensing.know_now(&self.history, time_s, truth, &mut self.own);
        self.sight.look(&self.history, time_s, truth);
        self.network.hear(time_s, &self.sensing, &self.history);
        if self.near == NearBy::Heard {
            // What is seen is the truth here, from which the others' pictures are told.
            self.find_slack(truth);
        }
        Sensed { own: &self.own, others: Others::Held(self) }
    }

    fn actuate(&mut self, time_s: f64, command: &mut Rows) {
        self.failing.act(time_s, command);
        self.actuation.act(time_s, command);
    }

    fn accept(&mut self, time_s: f64, truth: &Swarm) {
        self.history.push(time_s, truth);
    }

    fn forget_after(&mut self, time_s: f64) {
        self.history.forget_after(time_s);
        self.sensing.forget_after(time_s);
        self.sight.forget_after(time_s);
    }

    fn settle(&mut self, time_s: f64) {
        self.network.settle(time_s, &self.sensing, &self.history);
        self.history.settle(time_s);
    }

    fn longest_step_s(&self) -> f64 {
        let heard_s = self.network.delay_s().map_or(0.0, |delay_s| self.sensing.latency_s() + delay_s);
        let delays = [self.sensing.latency_s(), self.sight.latency_s(), heard_s];
        let shortest_s = delays.into_iter().filter(|delay_s| *delay_s > 0.0).fold(f64::INFINITY, f64::min);
        shortest_s / STEPS_PER_DELAY
    }

    fn channels(&self) -> Vec<Channel> {
        self.network.channels()
    }

    fn write_channels(&self, channels: &mut [Channel]) {
        self.network.write_channels(self.time_s, self.own.count(), channels);
    }

    fn traffic(&self) -> Option<Traffic> {
        self.network.traffic()
    }

    fn reseed(&mut self, seed: u64) {
        self.sensing.reseed(seed);
        self.sight.reseed(seed);
        self.network.reseed(seed);
    }
}
