//! Periods at which a vehicle looks at its contracts: only those with a plane that may come within reach, or with news.
//!
//! # Planes that are left out
//! Let a plane have the room R to the reference at the speed v. In k periods the reference moves by at most k h w, with
//! w = min(V, v + k A h) the largest speed until then. Its reach does not decrease with the speed. If
//!
//! ```text
//! R > reach(w) + (k - 1) h w,   w = min(V, v + (k - 1) A h)
//! ```
//!
//! the plane is beyond reach at the next k - 1 instants and need not be looked at before the k-th. A plane beyond reach
//! limits no choice (tests compare both), so the commands have the same bits as if all planes were tested. A change of
//! the plane takes a message or a proposal, and each of them sets a new period.
//!
//! Lemmas 2 and 3 hold unchanged: a vehicle may propose, decide and send at any of its instants, or not. A contract
//! that is not looked at keeps its planes.

use serde::{Deserialize, Serialize};

/// Numbers of periods after which a contract is looked at again, while its plane has the room for it.
const SLEEPS: [u64; 7] = [2, 4, 8, 16, 32, 64, 128];
/// Number of periods for which contracts are noted, above the longest of [`SLEEPS`].
const BUCKETS: usize = 256;
/// Room that is added because of rounding \[m\].
const SLACK_M: f64 = 1e-6;

/// Rooms beyond which a plane need not be looked at for some periods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Horizon {
    rooms_m: [f64; SLEEPS.len()],
}

impl Horizon {
    /// Returns the rooms from the largest reach at the next this many instants, with the way until then \[m\].
    pub(crate) fn new(farthest_m: impl Fn(u64) -> f64) -> Self {
        Self { rooms_m: SLEEPS.map(|periods| farthest_m(periods - 1) + SLACK_M) }
    }

    /// Returns the number of periods after which a plane with this room \[m\] must be looked at again.
    #[inline]
    pub(crate) fn periods(&self, room_m: f64) -> u64 {
        // The rooms ascend. Each one that is exceeded doubles the number.
        1 << self.rooms_m.iter().map(|least_m| u32::from(room_m > *least_m)).sum::<u32>()
    }
}

/// Sets of contracts, one bit for each vehicle: to be looked at in a period, with news, and to be written to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Agenda {
    /// Words of a set.
    words: usize,
    /// Last period whose contracts were taken.
    taken: u64,
    /// Sets of the next periods, by the remainder of the period.
    due: Vec<u64>,
    heard: Vec<u64>,
    outgoing: Vec<u64>,
}

impl Agenda {
    /// Returns the agenda of a vehicle among this many. All contracts are due in period 1.
    pub(crate) fn new(count: usize) -> Self {
        let words = count.div_ceil(64);
        let mut due = vec![0; BUCKETS * words];
        due[words..2 * words].fill(u64::MAX);
        Self { words, taken: 0, due, heard: vec![0; words], outgoing: vec![0; words] }
    }

    /// Whether the sets have the sizes of a swarm of this many vehicles.
    pub(crate) fn is_of(&self, count: usize) -> bool {
        let words = count.div_ceil(64);
        let sizes = [self.due.len(), self.heard.len(), self.outgoing.len()];
        self.words == words && sizes == [BUCKETS * words, words, words]
    }

    /// Number of words of a set.
    pub(crate) fn words(&self) -> usize {
        self.words
    }

    /// Takes the contracts of a word that are due up to a period, and those with news.
    #[inline]
    pub(crate) fn take(&mut self, word: usize, period: u64) -> [u64; 2] {
        let mut due = 0;
        // All buckets, if that many periods have passed.
        for passed in (self.taken + 1).max((period + 1).saturating_sub(BUCKETS as u64))..=period {
            due |= std::mem::take(&mut self.due[bucket(passed) * self.words + word]);
        }
        [due, std::mem::take(&mut self.heard[word])]
    }

    /// Ends the taking of all words in a period.
    pub(crate) fn end(&mut self, period: u64) {
        self.taken = period;
    }

    /// Sets a contract to be looked at in a later period, at most the longest sleep away.
    #[inline]
    pub(crate) fn schedule(&mut self, other: usize, period: u64) {
        self.due[bucket(period) * self.words + other / 64] |= bit(other);
    }

    /// Notes news from a vehicle.
    #[inline]
    pub(crate) fn hear(&mut self, other: usize) {
        self.heard[other / 64] |= bit(other);
    }

    /// Notes that a message to a vehicle is to be sent.
    #[inline]
    pub(crate) fn speak(&mut self, other: usize) {
        self.outgoing[other / 64] |= bit(other);
    }

    /// Takes the first vehicle to which a message is to be sent.
    pub(crate) fn next_outgoing(&mut self) -> Option<usize> {
        let (word, set) = self.outgoing.iter_mut().enumerate().find(|(_, set)| **set != 0)?;
        let place = set.trailing_zeros() as usize;
        *set &= *set - 1;
        Some(64 * word + place)
    }
}

#[inline]
fn bit(other: usize) -> u64 {
    1 << (other % 64)
}

#[inline]
fn bucket(period: u64) -> usize {
    // Below BUCKETS.
    #[allow(clippy::cast_possible_truncation)]
    let remainder = (period % BUCKETS as u64) as usize;
    remainder
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::tests::Random;
    use crate::{Settings, State};

    /// Returns how many planes came within reach before the period in which they are looked at again. Each one is
    /// approached at the largest acceleration and speed. The rooms of the horizon are multiplied by a factor.
    fn missed(factor: f64) -> u32 {
        let limits = Settings::new(1.0, 0.05).limits().expect("defaults");
        let mut random = Random::new(31);
        let mut missed = 0;
        for _ in 0..3_000 {
            let velocity_m_s = Vector3::x() * random.between(-2.0, 2.0);
            let mut state = State { position_m: Vector3::zeros(), velocity_m_s };
            let plane_m = random.between(0.0, 16.0);
            let mut horizon = limits.horizon(velocity_m_s.norm());
            horizon.rooms_m.iter_mut().for_each(|room_m| *room_m *= factor);
            for _ in 1..horizon.periods(plane_m) {
                let command = limits.envelope.cut(&state.velocity_m_s, Vector3::x() * 9.0);
                state = state.after(command, 0.05);
                let reach_m = limits.envelope.reach_m(&state, limits.choice);
                missed += u32::from(plane_m - state.position_m.x <= reach_m);
            }
        }
        missed
    }

    #[test]
    fn no_plane_comes_within_reach_before_it_is_looked_at_again() {
        assert_eq!(missed(1.0), 0);
        assert!(missed(0.5) > 100);
    }

    #[test]
    fn contracts_are_taken_once_in_their_period_or_a_later_one() {
        let mut agenda = Agenda::new(70);
        let all = |agenda: &mut Agenda, period: u64| {
            let found = [0, 1].map(|word| agenda.take(word, period));
            agenda.end(period);
            found
        };
        assert_eq!(all(&mut agenda, 1), [[u64::MAX, 0]; 2]);
        agenda.schedule(3, 5);
        agenda.schedule(66, 129);
        agenda.hear(65);
        assert_eq!(all(&mut agenda, 2), [[0, 0], [0, 2]]);
        // Periods that passed without a call are caught up.
        assert_eq!(all(&mut agenda, 9), [[8, 0], [0, 0]]);
        assert_eq!(all(&mut agenda, 1_000), [[0, 0], [4, 0]]);
        agenda.speak(66);
        agenda.speak(4);
        assert_eq!([(); 3].map(|()| agenda.next_outgoing()), [Some(4), Some(66), None]);
    }
}
