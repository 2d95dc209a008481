//! Radio: rounds of messages under way, delayed and possibly lost. The network and the shield use it.

use std::collections::VecDeque;

use super::failure::FailureKind;
use super::network::NetworkSpec;
use super::noise::{Noise, NoiseSource};
use super::sensing::SAME_S;
use crate::scenario::Scenario;
use tautline_core::swarm::{Rows, row};

/// Random doubles per message on a link: one for its loss, one for its jitter.
const DRAWS: usize = 2;

/// Messages that all vehicles send at one instant.
#[derive(Clone, Debug)]
pub(crate) struct Round<T> {
    /// Time of the round \[s\].
    pub(crate) sent_s: f64,
    pub(crate) content: T,
    /// Arrival of each message \[s\], in the order of sending; infinite for a lost message.
    pub(crate) arrives_s: Vec<f64>,
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

impl RadioUse {
    /// Returns the shortest delay \[s\]. A contract is heard at a later instant.
    fn shortest_s(self) -> f64 {
        match self {
            Self::States => 0.0,
            Self::Contracts => 2.0 * SAME_S,
        }
    }
}

/// Radio of a flight: rounds of messages under way, with delay, loss, links that are down and vehicles that are silent.
///
/// The random numbers of a message depend only on the seed, the use, the sender, the number of the round and the place
/// of the link in the list.
#[derive(Clone, Debug)]
pub(crate) struct Radio<T> {
    latency_s: f64,
    jitter_s: f64,
    /// Range \[m\]; infinite without a limit.
    range_m: f64,
    /// Hops of messages, if vehicles pass on those of others.
    relay: Option<Relay>,
    loss: Option<Loss>,
    noise: Noise,
    used_for: RadioUse,
    down: Vec<LinkOutage>,
    silent_from_s: Vec<f64>,
    /// Whether the last message on each link was lost; `None` before the first. With a relay, any two vehicles have a
    /// link in each direction.
    lost_before: Vec<Option<bool>>,
    sent: u64,
    lost: u64,
    /// Number of rounds so far.
    rounds: u64,
    under_way: VecDeque<Round<T>>,
    /// Memory of earlier rounds, for reuse.
    spare: Vec<Round<T>>,
    /// Time up to which arrived messages have been delivered \[s\].
    delivered_s: f64,
}

impl<T> Radio<T> {
    /// Returns the radio of a scenario with this number of directed links.
    pub(crate) fn new(scenario: &Scenario, links: usize, used_for: RadioUse) -> Self {
        let NetworkSpec { latency_s, jitter_s, loss, loss_burst, range_m, .. } = scenario.network;
        let count = scenario.count();
        // A path visits each vehicle at most once.
        let hops = scenario.network.hops().min(u32::try_from(count).unwrap_or(u32::MAX).saturating_sub(1));
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
            relay: (hops > 1).then(|| Relay::new(hops, count)),
            loss: (loss > 0.0).then(|| Loss::new(loss, loss_burst)),
            noise: Noise::new(scenario.noise_seed, NoiseSource::Messages),
            used_for,
            down: down.collect(),
            silent_from_s,
            lost_before: vec![None; if hops > 1 { count * count } else { links }],
            sent: 0,
            lost: 0,
            rounds: 0,
            under_way: VecDeque::new(),
            spare: Vec::new(),
            delivered_s: f64::NEG_INFINITY,
        }
    }

    /// Changes the seed for later rounds.
    pub(crate) fn reseed(&mut self, seed: u64) {
        self.noise.reseed(seed, self.rounds);
    }

    /// Returns the number of rounds so far.
    pub(super) fn rounds(&self) -> u64 {
        self.rounds
    }

    /// Returns the numbers of messages sent and lost.
    pub(crate) fn counts(&self) -> (u64, u64) {
        (self.sent, self.lost)
    }

    /// Returns a round to fill, with the memory of an earlier one.
    pub(crate) fn round(&mut self, new: impl FnOnce() -> T) -> Round<T> {
        let links = self.lost_before.len();
        self.spare.pop().unwrap_or_else(|| Round { sent_s: 0.0, content: new(), arrives_s: Vec::with_capacity(links) })
    }

    /// Keeps the memory of a round for reuse.
    pub(crate) fn recycle(&mut self, mut round: Round<T>) {
        round.arrives_s.clear();
        self.spare.push(round);
    }

    /// Adds the arrival times \[s\] of the messages of a sender over these links of at most `most`, each with its
    /// receiver. A message that is lost arrives at infinity. The positions decide which vehicles are within range.
    pub(crate) fn send(
        &mut self,
        (sender, sent_s): (usize, f64),
        positions_m: &Rows,
        (links, most): (impl Iterator<Item = (usize, usize)>, usize),
        arrives_s: &mut Vec<f64>,
    ) {
        if sent_s + SAME_S >= self.silent_from_s[sender] {
            arrives_s.extend(links.map(|_| f64::INFINITY));
            return;
        }
        let mut relay = self.relay.take();
        if let Some(relay) = &mut relay {
            relay.count_hops(sender, |from, to| self.is_linked((from, to), sent_s, positions_m));
        }
        let is_random = self.loss.is_some() || self.jitter_s > 0.0;
        let draws = DRAWS * most * relay.as_ref().map_or(1, |relay| relay.most as usize);
        let mut draw = is_random.then(|| self.noise.draw(sender, self.used_for as usize, self.rounds + 1, draws));
        for (link, receiver) in links {
            let (hops, is_reached) = match &relay {
                Some(relay) => (relay.hops[receiver], relay.hops[receiver] > 0),
                None => (1, self.is_linked((sender, receiver), sent_s, positions_m)),
            };
            let (mut by_chance, mut jitters) = (false, 0.0);
            let mut pass = |link: usize| {
                let [unit, jitter] = draw.as_mut().map_or([0.0; DRAWS], |draw| [draw.unit(), draw.unit()]);
                by_chance |= self.loss.is_some_and(|loss| {
                    let is_lost = loss.next(self.lost_before[link], unit);
                    self.lost_before[link] = Some(is_lost);
                    is_lost
                });
                jitters += jitter;
            };
            match &relay {
                Some(relay) => {
                    for (from, to) in relay.path(receiver) {
                        pass(from * relay.hops.len() + to);
                    }
                }
                None => pass(link),
            }
            let is_lost = by_chance || !is_reached;
            self.sent += 1;
            self.lost += u64::from(is_lost);
            let arrival_s = sent_s + self.latency_s * f64::from(hops) + self.jitter_s * jitters;
            let arrival_s = arrival_s.max(sent_s + self.used_for.shortest_s());
            arrives_s.push(if is_lost { f64::INFINITY } else { arrival_s });
        }
        self.relay = relay;
    }

    /// Whether a message reaches a vehicle in one hop, if it is not lost by chance.
    fn is_linked(&self, (sender, receiver): (usize, usize), sent_s: f64, positions_m: &Rows) -> bool {
        let is_within = self.range_m == f64::INFINITY
            || (row(positions_m, receiver) - row(positions_m, sender)).norm() <= self.range_m;
        let is_silent = sent_s + SAME_S >= self.silent_from_s[sender];
        is_within && !is_silent && !self.down.iter().any(|down| down.blocks(sender, receiver, sent_s))
    }

    /// Ends a round, whose messages were sent at a time \[s\].
    pub(crate) fn end(&mut self, round: Round<T>, sent_s: f64) {
        self.rounds += 1;
        self.under_way.push_back(Round { sent_s, ..round });
    }

    /// Delivers the messages that arrived since the last call, up to a time \[s\]. `deliver` gets each round under way,
    /// with whether each of its messages arrived.
    pub(crate) fn deliver(&mut self, time_s: f64, mut deliver: impl FnMut(&Round<T>, &mut dyn Iterator<Item = bool>)) {
        let (from_s, to_s) = (self.delivered_s, time_s + SAME_S);
        for round in self.under_way.iter().take_while(|round| round.sent_s + self.latency_s <= to_s) {
            deliver(round, &mut round.arrives_s.iter().map(|arrives_s| *arrives_s > from_s && *arrives_s <= to_s));
        }
        self.delivered_s = to_s;
        let hops = self.relay.as_ref().map_or(1, |relay| relay.most);
        let longest_s = ((self.latency_s + self.jitter_s) * f64::from(hops)).max(self.used_for.shortest_s());
        while let Some(round) = self.under_way.pop_front_if(|first| first.sent_s + longest_s <= to_s) {
            self.recycle(round);
        }
    }
}

/// Relay of messages: each vehicle passes on a message that it receives first, up to a number of hops.
#[derive(Clone, Debug)]
struct Relay {
    most: u32,
    /// Smallest number of hops from the present sender to each vehicle; 0 for the sender, and without a path.
    hops: Vec<u32>,
    /// Vehicle from which each vehicle has the message, if a message reached it.
    passed_by: Vec<usize>,
    /// Vehicles that a message reached, in the order of their hops.
    reached: Vec<usize>,
}

impl Relay {
    fn new(most: u32, count: usize) -> Self {
        Self { most, hops: vec![0; count], passed_by: vec![0; count], reached: Vec::with_capacity(count) }
    }

    /// Hops of the message to a vehicle, the last one first; none if no message reached it.
    fn path(&self, receiver: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let mut to = receiver;
        (0..self.hops[receiver]).map(move |_| {
            let hop = (self.passed_by[to], to);
            to = hop.0;
            hop
        })
    }

    /// Counts the hops of a message from a sender, while the vehicles stay where they are.
    fn count_hops(&mut self, sender: usize, is_linked: impl Fn(usize, usize) -> bool) {
        self.hops.fill(0);
        self.reached.clear();
        self.reached.push(sender);
        let mut next = 0;
        while let Some(&from) = self.reached.get(next) {
            next += 1;
            if self.hops[from] == self.most {
                break;
            }
            for to in 0..self.hops.len() {
                if to != sender && self.hops[to] == 0 && is_linked(from, to) {
                    self.hops[to] = self.hops[from] + 1;
                    self.passed_by[to] = from;
                    self.reached.push(to);
                }
            }
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

    #[test]
    fn messages_take_the_fewest_hops_up_to_their_largest_number() {
        // Vehicles on a line, and one apart from it.
        let neighbours = |from: usize, to: usize| from < 5 && to < 5 && from.abs_diff(to) == 1;
        let mut relay = Relay::new(3, 6);
        relay.count_hops(1, neighbours);
        assert_eq!(relay.hops, [1, 0, 1, 2, 3, 0]);
        assert_eq!(relay.path(4).collect::<Vec<_>>(), [(3, 4), (2, 3), (1, 2)]);
        assert_eq!((relay.path(1).count(), relay.path(5).count()), (0, 0));
        relay.count_hops(0, neighbours);
        assert_eq!(relay.hops, [0, 1, 2, 3, 0, 0]);
        // A vehicle that passes on nothing ends the path.
        relay.count_hops(1, |from, to| from != 2 && neighbours(from, to));
        assert_eq!(relay.hops, [1, 0, 1, 0, 0, 0]);
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
