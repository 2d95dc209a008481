//! States of vehicles in single messages, sent at a rate.

use super::history::History;
use super::network::NearStates;
use super::radio::{Radio, RadioUse};
use super::sensing::{SAME_S, StateSensor};
use crate::scenario::Scenario;
use tautline_core::swarm::{Rows, Swarm, row};
use tautline_laws::graph::Graph;
use tautline_laws::observation::NeighbourState;

/// Measurements that the messages of a round hold.
#[derive(Clone, Debug)]
struct Measurements {
    measured_s: f64,
    states: Swarm,
}

/// Last message received over a link.
#[derive(Clone, Copy, Debug)]
struct ReceivedMessage {
    /// Time of sending \[s\]; -infinity for the state before the first message.
    sent_s: f64,
    neighbour: NeighbourState,
    measured_s: f64,
}

impl ReceivedMessage {
    /// Returns the state in the message, with its age at a time \[s\].
    fn at(&self, time_s: f64) -> NeighbourState {
        NeighbourState { age_s: (time_s - self.measured_s).max(0.0), ..self.neighbour }
    }
}

/// Network of a flight: messages under way, and the last message received over each link.
///
/// All vehicles send message k to all neighbours k/`rate_hz` after the first measurement is available. It holds the
/// sender's knowledge of its own state at that time. Its delay and loss depend only on the seed, the link and k.
#[derive(Clone, Debug)]
pub(super) struct Messages {
    links: Links,
    rate_hz: f64,
    begins_s: f64,
    radio: Radio<Measurements>,
    received: Vec<ReceivedMessage>,
    ages: Ages,
}

impl Messages {
    pub(super) fn new(scenario: &Scenario, sensing: &StateSensor, rate_hz: f64) -> Self {
        let count = scenario.count();
        let links = match scenario.network.near {
            NearStates::Sensed => Links::of(&scenario.graph),
            NearStates::Received => Links::of(&Graph::complete(count)),
        };
        let mut known = scenario.start.clone();
        sensing.measure(&History::new(0.0), 0.0, Some(&scenario.start), &mut known);
        let mut received = Vec::with_capacity(links.len());
        for sender in 0..count {
            let neighbour = NeighbourState::of(&known, sender, 0.0);
            let start = ReceivedMessage { sent_s: f64::NEG_INFINITY, neighbour, measured_s: 0.0 };
            received.extend(links.from(sender).map(|_| start));
        }
        Self {
            rate_hz,
            begins_s: sensing.sensor.latency_s(),
            radio: Radio::new(scenario, links.len(), RadioUse::States),
            received,
            links,
            ages: Ages::default(),
        }
    }

    pub(super) fn reseed(&mut self, seed: u64) {
        self.radio.reseed(seed);
    }

    /// Returns the numbers of messages sent and lost.
    pub(super) fn counts(&self) -> (u64, u64) {
        self.radio.counts()
    }

    /// Returns the ages of received states, over all links and messages.
    pub(super) fn ages(&self) -> &Ages {
        &self.ages
    }

    /// Sends the messages that are due up to a time \[s\], and delivers those that have arrived.
    pub(super) fn settle(&mut self, time_s: f64, sensing: &StateSensor, history: &History) {
        loop {
            let sent_s = self.begins_s + self.radio.rounds() as f64 / self.rate_hz;
            if sent_s > time_s + SAME_S {
                break;
            }
            self.send(sent_s, sensing, history);
        }
        self.deliver(time_s);
    }

    fn send(&mut self, sent_s: f64, sensing: &StateSensor, history: &History) {
        let Self { links, radio, received, ages, .. } = self;
        let at_rest = || Swarm::at_rest(Rows::zeros(links.count()));
        let mut round = radio.round(|| Measurements { measured_s: 0.0, states: at_rest() });
        round.content.measured_s = sensing.measured_s(sent_s);
        sensing.measure(history, sent_s, None, &mut round.content.states);
        for sender in 0..links.count() {
            let over = links.from(sender);
            let most = over.len();
            // Links are numbered by sender.
            radio.send((sender, sent_s), &round.content.states.positions_m, (over, most), &mut round.arrives_s);
        }
        for received in received.iter() {
            ages.take(sent_s - received.measured_s);
        }
        radio.end(round, sent_s);
    }

    /// Delivers messages that have arrived; an older message never replaces a newer one.
    fn deliver(&mut self, time_s: f64) {
        let Self { links, radio, received, .. } = self;
        radio.deliver(time_s, |round, has_arrived| {
            let sent_s = round.sent_s;
            let Measurements { measured_s, ref states } = round.content;
            for sender in 0..links.count() {
                for ((link, _), has_arrived) in links.from(sender).zip(&mut *has_arrived) {
                    if has_arrived && sent_s > received[link].sent_s {
                        let neighbour = NeighbourState::of(states, sender, 0.0);
                        received[link] = ReceivedMessage { sent_s, neighbour, measured_s };
                    }
                }
            }
        });
    }

    /// Returns the last state of vehicle `j` that vehicle `i` received, at a time \[s\]; `None` without a link.
    pub(super) fn received(&self, i: usize, j: usize, time_s: f64) -> Option<NeighbourState> {
        Some(self.received[self.links.find(i, j)?].at(time_s))
    }

    /// Returns the largest distance \[m\] of a received position from the true position of its sender.
    pub(super) fn largest_error_m(
        &self,
        positions_m: &Rows,
        extrapolated: impl Fn(NeighbourState) -> NeighbourState,
        time_s: f64,
    ) -> f64 {
        (0..self.links.count()).fold(0.0, |largest_error_m, sender| {
            let place_m = row(positions_m, sender);
            self.links.from(sender).fold(largest_error_m, |largest_error_m: f64, (link, _)| {
                let held = extrapolated(self.received[link].at(time_s));
                largest_error_m.max((held.position_m - place_m).norm())
            })
        })
    }

    /// Writes the age of the oldest received state and the mean age for each vehicle, alternating \[s\].
    pub(super) fn write_ages(&self, time_s: f64, oldest_and_mean_s: &mut [f64]) {
        oldest_and_mean_s.fill(0.0);
        for sender in 0..self.links.count() {
            for (link, receiver) in self.links.from(sender) {
                let age_s = self.received[link].at(time_s).age_s;
                let [oldest_s, sum_s] = [2 * receiver, 2 * receiver + 1];
                oldest_and_mean_s[oldest_s] = oldest_and_mean_s[oldest_s].max(age_s);
                oldest_and_mean_s[sum_s] += age_s;
            }
        }
        for receiver in 0..self.links.count() {
            // Links are bidirectional: a vehicle receives from as many vehicles as it sends to.
            let neighbours = self.links.from(receiver).len().max(1);
            oldest_and_mean_s[2 * receiver + 1] /= neighbours as f64;
        }
    }
}

/// Smallest age that is distinguished from 0 \[s\].
const LEAST_S: f64 = 1e-5;
/// Ratio of the bounds of a class, for a relative error of quantiles of a hundredth.
const RATIO: f64 = 1.01;
/// Number of classes, up to an age of 4 weeks.
const CLASSES: usize = 2600;

/// Histogram of ages.
#[derive(Clone, Debug)]
pub(super) struct Ages {
    counts: Vec<u64>,
    total: u64,
}

impl Default for Ages {
    fn default() -> Self {
        Self { counts: vec![0; CLASSES], total: 0 }
    }
}

impl Ages {
    /// Counts an age \[s\].
    pub(super) fn take(&mut self, age_s: f64) {
        let class = (libm::log(age_s.max(LEAST_S) / LEAST_S) / libm::log(RATIO)).ceil();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at least 0; larger values saturate"
        )]
        let class = (class as usize).min(CLASSES - 1);
        self.counts[class] += 1;
        self.total += 1;
    }

    /// Returns a quantile of the ages \[s\], with a relative error of a hundredth; `None` without ages.
    pub(super) fn quantile_s(&self, share: f64) -> Option<f64> {
        let wanted = share * self.total as f64;
        let mut counted = 0;
        let class = self.counts.iter().position(|count| {
            counted += count;
            counted > 0 && counted as f64 >= wanted
        })?;
        #[expect(clippy::cast_precision_loss, reason = "some thousands")]
        let power = class as f64;
        Some(if class == 0 { 0.0 } else { LEAST_S * libm::pow(RATIO, power) })
    }
}

/// Links of a graph, one for each direction, ordered by sender and then by receiver.
#[derive(Clone, Debug)]
pub(super) struct Links {
    count: usize,
    /// Receivers of vehicle j: `receivers[offsets[j]..offsets[j + 1]]`, ascending.
    offsets: Vec<usize>,
    receivers: Vec<usize>,
}

impl Links {
    pub(super) fn of(graph: &Graph) -> Self {
        let count = graph.count();
        let mut offsets = vec![0; count + 1];
        for (i, j) in graph.edges() {
            offsets[i + 1] += 1;
            offsets[j + 1] += 1;
        }
        (0..count).for_each(|i| offsets[i + 1] += offsets[i]);
        let (mut next, mut receivers) = (offsets.clone(), vec![0; 2 * graph.edge_count()]);
        for (i, j) in graph.edges() {
            for (from, to) in [(i, j), (j, i)] {
                receivers[next[from]] = to;
                next[from] += 1;
            }
        }
        // Edges come in row order: each vehicle gets its receivers of smaller index before those of larger index.
        Self { count, offsets, receivers }
    }

    /// Returns the number of directed links.
    pub(super) fn len(&self) -> usize {
        self.receivers.len()
    }

    /// Returns the number of vehicles.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Returns the links of a sender, each with its receiver.
    pub(super) fn from(&self, sender: usize) -> impl ExactSizeIterator<Item = (usize, usize)> + '_ {
        let places = self.offsets[sender]..self.offsets[sender + 1];
        places.clone().zip(&self.receivers[places]).map(|(link, &receiver)| (link, receiver))
    }

    /// Returns the link from a sender to a receiver.
    pub(super) fn find(&self, receiver: usize, sender: usize) -> Option<usize> {
        let from = self.offsets[sender];
        self.receivers[from..self.offsets[sender + 1]].binary_search(&receiver).ok().map(|place| from + place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_known_to_a_hundredth() {
        let mut ages = Ages::default();
        assert_eq!(ages.quantile_s(0.95), None);
        (1..=1000).for_each(|k| ages.take(0.001 * f64::from(k)));
        for (share, expected) in [(0.5, 0.5), (0.95, 0.95), (1.0, 1.0)] {
            let found = ages.quantile_s(share).expect("ages");
            assert!((found / expected - 1.0).abs() < 0.0101, "{share}: {found}");
        }
        let mut none = Ages::default();
        (0..20).for_each(|_| none.take(0.0));
        assert_eq!(none.quantile_s(0.95), Some(0.0));
    }

    #[test]
    fn every_link_is_found_both_ways_and_no_other() {
        for graph in [Graph::complete(5), Graph::star(5), Graph::ring(6), Graph::path(4)] {
            let links = Links::of(&graph);
            assert_eq!((links.len(), links.count()), (2 * graph.edge_count(), graph.count()));
            let mut met = vec![false; links.len()];
            for sender in 0..graph.count() {
                for (link, receiver) in links.from(sender) {
                    assert!(graph.has_edge(sender, receiver) && links.find(receiver, sender) == Some(link));
                    met[link] = true;
                }
                assert_eq!(links.find(sender, sender), None);
            }
            assert!(met.iter().all(|met| *met));
        }
        assert_eq!(Links::of(&Graph::star(4)).find(1, 2), None);
    }
}
