//! Single messages: sent at a rate, delayed, and possibly lost.

use std::collections::VecDeque;

use super::failure::FailureKind;
use super::history::History;
use super::network::{NearStates, NetworkSpec};
use super::noise::{Noise, NoiseSource};
use super::sensing::{SAME_S, StateSensor};
use crate::scenario::Scenario;
use tautline_core::swarm::{Rows, Swarm, row};
use tautline_laws::graph::Graph;
use tautline_laws::observation::NeighbourState;

/// Random doubles per message on a link: one for its loss, one for its jitter.
const DRAWS: usize = 2;

/// Messages that all vehicles send at one instant.
#[derive(Clone, Debug)]
struct Broadcast {
    /// Number, from 1; 0 stands for the state before the first message.
    number: u64,
    sent_s: f64,
    /// Time of the measurement that the message holds \[s\].
    measured_s: f64,
    states: Swarm,
    /// Arrival over each link \[s\]; infinite for a lost message.
    arrives_s: Vec<f64>,
}

/// Last message received over a link.
#[derive(Clone, Copy, Debug)]
struct ReceivedMessage {
    number: u64,
    neighbour: NeighbourState,
    measured_s: f64,
}

/// Two vehicles whose link is down for some time.
#[derive(Clone, Copy, Debug)]
struct LinkOutage {
    ends: [usize; 2],
    from_s: f64,
    to_s: f64,
}

/// User of a radio. Each has its own random numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) enum RadioUse {
    /// States of vehicles, for laws.
    States,
    /// Contracts of shields.
    Contracts,
}

/// Fate of single messages: delay, loss, links that are down and vehicles that are silent. It depends only on the seed,
/// the use, the sender, the number of the message and the place of the link in the list.
#[derive(Clone, Debug)]
pub(crate) struct Radio {
    latency_s: f64,
    jitter_s: f64,
    /// Range \[m\]; infinite without a limit.
    range_m: f64,
    loss: Option<Loss>,
    noise: Noise,
    used_for: RadioUse,
    down: Vec<LinkOutage>,
    silent_from_s: Vec<f64>,
    /// Whether the last message on each link was lost; `None` before the first.
    lost_before: Vec<Option<bool>>,
    sent: u64,
    lost: u64,
}

impl Radio {
    /// Returns the radio of a scenario with this number of directed links.
    pub(crate) fn new(scenario: &Scenario, links: usize, used_for: RadioUse) -> Self {
        let NetworkSpec { latency_s, jitter_s, loss, loss_burst, range_m, .. } = scenario.network;
        let count = scenario.count();
        let index = |number: u64| usize::try_from(number.saturating_sub(1)).unwrap_or(usize::MAX);
        let down = scenario.network.failure.iter().map(|failure| LinkOutage {
            ends: failure.link.map(index),
            from_s: failure.from_s,
            to_s: failure.to_s.unwrap_or(f64::INFINITY),
        });
        let mut silent_from_s = vec![f64::INFINITY; count];
        for failure in scenario.failures.iter().filter(|failure| matches!(failure.kind, FailureKind::Silent {})) {
            silent_from_s[failure.index()] = failure.at_s.min(silent_from_s[failure.index()]);
        }
        Self {
            latency_s,
            jitter_s,
            range_m: range_m.unwrap_or(f64::INFINITY),
            loss: (loss > 0.0).then(|| Loss::new(loss, loss_burst)),
            noise: Noise::new(scenario.noise_seed, NoiseSource::Messages),
            used_for,
            down: down.collect(),
            silent_from_s,
            lost_before: vec![None; links],
            sent: 0,
            lost: 0,
        }
    }

    /// Changes the seed for messages after number `made`.
    pub(crate) fn reseed(&mut self, seed: u64, made: u64) {
        self.noise.reseed(seed, made);
    }

    /// Returns the numbers of messages sent and lost.
    pub(crate) fn counts(&self) -> (u64, u64) {
        (self.sent, self.lost)
    }

    /// Returns the longest delay of a message that arrives \[s\].
    pub(crate) fn longest_s(&self) -> f64 {
        self.latency_s + self.jitter_s
    }

    /// Adds the arrival times \[s\] of a message of a sender, its number counted from 1, over these links of at most
    /// `most`, each with its receiver. A message that is lost arrives at infinity. The positions decide which vehicles
    /// are within range.
    pub(crate) fn send(
        &mut self,
        (sender, number, sent_s): (usize, u64, f64),
        positions_m: &Rows,
        (links, most): (impl Iterator<Item = (usize, usize)>, usize),
        arrives_s: &mut Vec<f64>,
    ) {
        if sent_s + SAME_S >= self.silent_from_s[sender] {
            arrives_s.extend(links.map(|_| f64::INFINITY));
            return;
        }
        let is_random = self.loss.is_some() || self.jitter_s > 0.0;
        let mut draw = is_random.then(|| self.noise.draw(sender, self.used_for as usize, number, DRAWS * most));
        for (link, receiver) in links {
            let [unit, jitter] = draw.as_mut().map_or([0.0; DRAWS], |draw| [draw.unit(), draw.unit()]);
            let by_chance = self.loss.is_some_and(|loss| {
                let is_lost = loss.next(self.lost_before[link], unit);
                self.lost_before[link] = Some(is_lost);
                is_lost
            });
            let is_beyond = self.range_m < f64::INFINITY
                && (row(positions_m, receiver) - row(positions_m, sender)).norm() > self.range_m;
            let is_lost = by_chance || is_beyond || self.down.iter().any(|down| down.blocks(sender, receiver, sent_s));
            self.sent += 1;
            self.lost += u64::from(is_lost);
            arrives_s.push(if is_lost { f64::INFINITY } else { sent_s + self.latency_s + self.jitter_s * jitter });
        }
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
    radio: Radio,
    /// Number of the next message, from 1.
    next: u64,
    under_way: VecDeque<Broadcast>,
    spare: Vec<Broadcast>,
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
            let start =
                ReceivedMessage { number: 0, neighbour: NeighbourState::of(&known, sender, 0.0), measured_s: 0.0 };
            received.extend(links.from(sender).map(|_| start));
        }
        Self {
            rate_hz,
            begins_s: sensing.latency_s(),
            radio: Radio::new(scenario, links.len(), RadioUse::States),
            next: 1,
            under_way: VecDeque::new(),
            spare: Vec::new(),
            received,
            links,
            ages: Ages::default(),
        }
    }

    pub(super) fn reseed(&mut self, seed: u64) {
        self.radio.reseed(seed, self.next - 1);
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
            let sent_s = self.begins_s + (self.next - 1) as f64 / self.rate_hz;
            if sent_s > time_s + SAME_S {
                break;
            }
            self.send(sent_s, sensing, history);
        }
        self.deliver(time_s);
    }

    fn send(&mut self, sent_s: f64, sensing: &StateSensor, history: &History) {
        let mut broadcast = self.spare.pop().unwrap_or_else(|| Broadcast {
            number: 0,
            sent_s,
            measured_s: 0.0,
            states: Swarm::at_rest(Rows::zeros(self.links.count())),
            arrives_s: Vec::with_capacity(self.links.len()),
        });
        broadcast.arrives_s.clear();
        (broadcast.number, broadcast.sent_s) = (self.next, sent_s);
        broadcast.measured_s = sensing.measured_s(sent_s);
        sensing.measure(history, sent_s, None, &mut broadcast.states);
        for sender in 0..self.links.count() {
            let links = self.links.from(sender);
            let most = links.len();
            let Broadcast { states, arrives_s, .. } = &mut broadcast;
            // Links are numbered by sender.
            self.radio.send((sender, self.next, sent_s), &states.positions_m, (links, most), arrives_s);
        }
        self.received.iter().for_each(|received| self.ages.take(sent_s - received.measured_s));
        self.next += 1;
        self.under_way.push_back(broadcast);
    }

    /// Delivers messages that have arrived; an older message never replaces a newer one.
    fn deliver(&mut self, time_s: f64) {
        for broadcast in &self.under_way {
            if broadcast.sent_s + self.radio.latency_s > time_s + SAME_S {
                break;
            }
            for sender in 0..self.links.count() {
                for (link, _) in self.links.from(sender) {
                    if broadcast.arrives_s[link] <= time_s + SAME_S && broadcast.number > self.received[link].number {
                        self.received[link] = ReceivedMessage {
                            number: broadcast.number,
                            neighbour: NeighbourState::of(&broadcast.states, sender, 0.0),
                            measured_s: broadcast.measured_s,
                        };
                    }
                }
            }
        }
        let longest_s = self.radio.longest_s();
        while self.under_way.front().is_some_and(|first| first.sent_s + longest_s <= time_s + SAME_S) {
            self.spare.extend(self.under_way.pop_front());
        }
    }

    /// Returns the last state of vehicle `j` that vehicle `i` received, at a time \[s\]; `None` without a link.
    pub(super) fn received(&self, i: usize, j: usize, time_s: f64) -> Option<NeighbourState> {
        let received = self.received[self.links.find(i, j)?];
        Some(NeighbourState { age_s: (time_s - received.measured_s).max(0.0), ..received.neighbour })
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
                let received = self.received[link];
                let held = extrapolated(NeighbourState {
                    age_s: (time_s - received.measured_s).max(0.0),
                    ..received.neighbour
                });
                largest_error_m.max((held.position_m - place_m).norm())
            })
        })
    }

    /// Writes the age of the oldest received state and the mean age for each vehicle, alternating \[s\].
    pub(super) fn write_ages(&self, time_s: f64, oldest_and_mean_s: &mut [f64]) {
        oldest_and_mean_s.fill(0.0);
        for sender in 0..self.links.count() {
            for (link, receiver) in self.links.from(sender) {
                let age_s = (time_s - self.received[link].measured_s).max(0.0);
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

impl LinkOutage {
    fn blocks(&self, sender: usize, receiver: usize, sent_s: f64) -> bool {
        let [a, b] = self.ends;
        let is_this = (sender, receiver) == (a, b) || (sender, receiver) == (b, a);
        is_this && (self.from_s..self.to_s).contains(&(sent_s + SAME_S))
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

/// Losses after Gilbert and Elliott. A link loses all messages while it is bad and none while it is good. With each
/// message, a good link turns bad with probability p and a bad link turns good with probability r. The share of lost
/// messages is p/(p + r), the mean length of a burst 1/r. Losses are independent for p + r = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Loss {
    share: f64,
    turns_bad: f64,
    turns_good: f64,
}

impl Loss {
    /// Returns losses of this share, in bursts of a mean length, or independent losses.
    pub(super) fn new(share: f64, burst: Option<f64>) -> Self {
        let turns_good = burst.map_or(1.0 - share, |burst| if share < 1.0 { 1.0 / burst } else { 0.0 });
        let turns_bad = if share < 1.0 { (turns_good * share / (1.0 - share)).min(1.0) } else { 1.0 };
        Self { share, turns_bad, turns_good }
    }

    /// Returns whether a message is lost; `before` is whether the previous message on the same link was lost, `unit` is
    /// uniform in \[0, 1).
    pub(super) fn next(&self, before: Option<bool>, unit: f64) -> bool {
        match before {
            None => unit < self.share,
            Some(false) => unit < self.turns_bad,
            Some(true) => unit >= self.turns_good,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::noise::{Noise, NoiseSource};

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

    /// Returns the share of lost messages and the mean length of a burst on a link.
    fn measured(loss: Loss, messages: u64) -> (f64, f64) {
        // Numbers are drawn in runs, because each draw begins a block of the generator.
        const RUN: usize = 4096;
        let noise = Noise::new(3, NoiseSource::Messages);
        let mut draw = noise.draw(0, 0, 0, RUN);
        let (mut before, mut lost, mut bursts) = (None, 0_u64, 0_u64);
        for number in 0..messages {
            if number.is_multiple_of(RUN as u64) {
                draw = noise.draw(0, 0, number / RUN as u64, RUN);
            }
            let is_lost = loss.next(before, draw.unit());
            bursts += u64::from(is_lost && before != Some(true));
            lost += u64::from(is_lost);
            before = Some(is_lost);
        }
        (lost as f64 / messages as f64, lost as f64 / bursts as f64)
    }

    #[test]
    fn the_share_lost_and_the_mean_burst_match_the_model() {
        for (share, burst) in [(0.02, None), (0.3, None), (0.1, Some(5.0)), (0.5, Some(20.0)), (0.05, Some(1.0))] {
            // Standard errors of both are below 1 %.
            let (lost, length) = measured(Loss::new(share, burst), 1_000_000);
            let expected = burst.unwrap_or(1.0 / (1.0 - share));
            assert!((lost / share - 1.0).abs() < 0.02, "{share} {burst:?}: {lost}");
            assert!((length / expected - 1.0).abs() < 0.02, "{share} {burst:?}: bursts of {length}");
        }
        // Losses in bursts differ from independent losses.
        assert!(measured(Loss::new(0.1, None), 100_000).1 < 1.2);
    }

    #[test]
    fn nothing_and_everything_can_be_lost() {
        for burst in [None, Some(3.0)] {
            assert_eq!(measured(Loss::new(1.0, burst), 1000).0, 1.0);
            assert_eq!(measured(Loss::new(0.0, burst), 1000).0, 0.0);
        }
    }
}
