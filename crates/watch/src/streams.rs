//! Evidence that one name carries the messages of two vehicles.
//!
//! Two vehicles with one name look like one, and the watch then judges neither. The evidence is the order of messages:
//!
//! - The stamps of one vehicle increase, apart from messages that overtake each other. A message that overtook leaves
//!   a gap between two stamps, which the late message fills. Late messages between regular stamps are those of
//!   another clock. [`StampOrder`] counts them.
//! - A clock that steps back and later returns to its former time, again and again, is two clocks. A restart steps
//!   back once.
//! - `MAVLink` counts the messages of a component from 0 to 255. Lost messages leave out numbers, and a restart begins
//!   again once. Numbers that go back and forth are two counts. [`SequenceOrder`] finds them.
//!
//! A copy of a message by another link is no evidence. It has the number and the checksum, or the stamp and the
//! position, of the original.

use crate::clock::STEP_S;

/// Number of changes between two orders that is evidence.
const CHANGES: usize = 3;
/// Time within which the changes must come \[s\].
const CHANGES_S: f64 = 10.0;
/// Number of returns of a clock to its former time that is evidence.
const RETURNS: u32 = 2;
/// Largest gap between two stamps that no message left, as a multiple of the smallest gap.
const REGULAR: f64 = 1.5;

/// Counts how often messages change from one order to another one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Changes {
    /// Times of the newest changes \[s\], in a ring.
    times_s: [f64; CHANGES],
    next: usize,
    /// Whether a message in order came since the last one out of order.
    is_in_order: bool,
}

impl Default for Changes {
    fn default() -> Self {
        Self { times_s: [f64::NEG_INFINITY; CHANGES], next: 0, is_in_order: false }
    }
}

impl Changes {
    fn in_order(&mut self) {
        self.is_in_order = true;
    }

    /// Takes a message out of order. Returns whether the order changed often enough.
    fn out_of_order(&mut self, at_s: f64) -> bool {
        if !std::mem::take(&mut self.is_in_order) {
            return false;
        }
        self.times_s[self.next] = at_s;
        self.next = (self.next + 1) % CHANGES;
        at_s - self.times_s[self.next] <= CHANGES_S
    }
}

/// Order of the stamps of one name.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StampOrder {
    changes: Changes,
    /// Newest stamp \[s\].
    newest_s: Option<f64>,
    /// Stamps before and after the newest step back \[s\].
    step_s: Option<[f64; 2]>,
    returns: u32,
}

impl StampOrder {
    /// Takes a message in order with its stamp \[s\]. Returns whether there are two clocks.
    ///
    /// The stamps since the step give the time that passed, so that the times of arrival do not matter.
    pub(crate) fn take(&mut self, t_s: f64) -> bool {
        self.changes.in_order();
        let Some(before_s) = self.newest_s.replace(t_s) else { return false };
        if t_s < before_s - STEP_S {
            self.step_s = Some([before_s, t_s]);
        } else if let Some([former_s, after_s]) = self.step_s
            && t_s > before_s + STEP_S
            && (t_s - former_s - (before_s - after_s)).abs() <= STEP_S
        {
            self.step_s = None;
            self.returns += 1;
        }
        self.returns >= RETURNS
    }

    /// Takes a late message between two stamps with a distance, or before all stamps, with the smallest distance of
    /// two stamps in order \[s\]. Returns whether there are two clocks.
    pub(crate) fn take_late(&mut self, gap_s: Option<f64>, least_gap_s: f64, at_s: f64) -> bool {
        let fills = gap_s.is_some_and(|gap_s| gap_s >= REGULAR * least_gap_s);
        !fills && self.changes.out_of_order(at_s)
    }
}

/// Distance of a number before the newest one up to which a message may be late.
const LATE: u8 = 64;
/// Number of successive messages out of order after which a count has begun again.
const RESTART: u32 = 4;
/// Time from the first message in which messages from before it may come late \[s\].
const START_S: f64 = 2.0;

/// Place of a message in the count of its sender.
#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    /// Number of the message, without the limit of a byte.
    number: u64,
    checksum: u16,
}

/// Order of the numbers of one sender.
#[derive(Clone, Debug)]
pub(crate) struct SequenceOrder {
    slots: Box<[Slot; 256]>,
    /// Newest number, without the limit of a byte.
    newest: u64,
    first: u64,
    started_s: f64,
    /// Successive messages out of order.
    run: u32,
    changes: Changes,
}

impl SequenceOrder {
    /// Returns the order after a first message.
    pub(crate) fn new(number: u8, checksum: u16, at_s: f64) -> Self {
        let newest = 256 + u64::from(number);
        let mut slots = Box::new([Slot::default(); 256]);
        slots[usize::from(number)] = Slot { number: newest, checksum };
        Self { slots, newest, first: newest, started_s: at_s, run: 0, changes: Changes::default() }
    }

    /// Takes a message. Returns whether there are two counts.
    pub(crate) fn take(&mut self, number: u8, checksum: u16, at_s: f64) -> bool {
        let ahead = u64::from(number.wrapping_sub(self.newest.to_le_bytes()[0]));
        let slot = self.slots[usize::from(number)];
        if slot.number > 0 && slot.checksum == checksum {
            return false;
        }
        if (1..128).contains(&ahead) {
            self.newest += ahead;
            self.slots[usize::from(number)] = Slot { number: self.newest, checksum };
            self.run = 0;
            self.changes.in_order();
            return false;
        }
        let behind = if ahead == 0 { 0 } else { 256 - ahead };
        let own = self.newest - behind;
        let is_early = own < self.first && at_s - self.started_s < START_S;
        if is_early || (behind <= u64::from(LATE) && slot.number < own) {
            self.slots[usize::from(number)] = Slot { number: own, checksum };
            return false;
        }
        self.run += 1;
        if self.run >= RESTART {
            self.newest = own + 256;
            self.slots[usize::from(number)] = Slot { number: self.newest, checksum };
            self.run = 0;
        }
        self.changes.out_of_order(at_s)
    }
}

#[cfg(test)]
mod tests {
    use super::{SequenceOrder, StampOrder};

    /// Returns the index of the message at which two counts are found. A message is its number and its checksum.
    fn two_counts(messages: impl IntoIterator<Item = (u64, u16)>, rate_hz: f64) -> Option<usize> {
        let mut order: Option<SequenceOrder> = None;
        messages.into_iter().enumerate().position(|(k, (number, checksum))| {
            let (number, at_s) = (number.to_le_bytes()[0], k as f64 / rate_hz);
            if let Some(order) = &mut order {
                return order.take(number, checksum, at_s);
            }
            order = Some(SequenceOrder::new(number, checksum, at_s));
            false
        })
    }

    fn checksum(stream: u64, number: u64) -> u16 {
        let mixed = (stream * 1_000_003 + number).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        u16::from_le_bytes([mixed.to_le_bytes()[5], mixed.to_le_bytes()[6]])
    }

    #[test]
    fn two_counts_that_alternate_are_found_at_every_distance() {
        for distance in 1..=255_u64 {
            let both = (0..600_u64).map(|k| (k / 2 + distance * (k % 2), checksum(k % 2, k / 2)));
            // At most 64 missing messages are filled first.
            let found = two_counts(both, 40.0).expect("two counts");
            assert!(found < 2 * 64 + 90, "{distance}: {found}");
        }
        // In bursts of five, and one message of ten.
        let bursts =
            (0..300_u64).map(|k| (k / 10 * 5 + k % 5 + 90 * (k / 5 % 2), checksum(k / 5 % 2, k / 10 * 5 + k % 5)));
        assert!(two_counts(bursts, 50.0).is_some());
        let rare = (0..600_u64).map(|k| if k % 10 == 9 { (k / 10 + 100, checksum(1, k)) } else { (k, checksum(0, k)) });
        assert!(two_counts(rare, 50.0).is_some());
    }

    #[test]
    fn loss_copies_late_messages_and_one_restart_are_one_count() {
        let count = |numbers: Vec<u64>| two_counts(numbers.into_iter().map(|k| (k, checksum(0, k))), 50.0);
        // Loss of every third message, and of a long run.
        assert_eq!(count((0..2000).filter(|k| k % 3 != 0 && !(500..640).contains(k)).collect()), None);
        // Neighbours that overtake each other, and single messages that are late by 40.
        assert_eq!(count((0..2000).map(|k| k ^ 1).collect()), None);
        let late = (0..2000).flat_map(|k| match k % 50 {
            10 => vec![],
            0 if k > 0 => vec![k, k - 40],
            _ => vec![k],
        });
        assert_eq!(count(late.collect()), None);
        // A second link repeats each message, 30 and 100 messages later; the first link loses some.
        for lag in [30, 100_u64] {
            assert_eq!(count((0..2000_u64).flat_map(|k| [k, k.saturating_sub(lag)]).collect()), None, "{lag}");
        }
        let lossy = (0..2000_u64).flat_map(|k| {
            let first = (k % 7 != 3).then_some(k);
            first.into_iter().chain(k.checked_sub(30))
        });
        assert_eq!(count(lossy.collect()), None);
        // Restarts at each distance from 0.
        for end in 1000..1256 {
            let restart = (0..end).map(|k| (k, checksum(0, k))).chain((0..400).map(|k| (k, checksum(1, k))));
            assert_eq!(two_counts(restart, 50.0), None, "{end}");
        }
    }

    #[test]
    fn a_clock_that_steps_back_and_returns_twice_is_two_clocks() {
        let found = |stamps: &[f64]| {
            let mut order = StampOrder::default();
            stamps.iter().any(|&t_s| order.take(t_s))
        };
        let line = |k: usize, offset_s: f64| offset_s + 0.1 * k as f64;
        let stamps = |offset: fn(usize) -> f64| (0..60).map(|k| line(k, offset(k))).collect::<Vec<_>>();
        assert!(found(&stamps(|k| if k % 2 == 0 { 500.0 } else { 300.0 })));
        assert!(found(&stamps(|k| if k % 10 == 9 { 300.0 } else { 500.0 })));
        // One restart, two restarts, and a clock that is set wrong once.
        assert!(!found(&stamps(|k| if k < 30 { 500.0 } else { 0.0 })));
        assert!(!found(&stamps(|k| [500.0, 0.0, -3.0][k / 20])));
        assert!(!found(&stamps(|k| if (20..40).contains(&k) { 505.0 } else { 500.0 })));
    }

    #[test]
    fn late_stamps_between_regular_ones_are_two_clocks() {
        let found = |messages: &[f64]| {
            let (mut order, mut kept) = (StampOrder::default(), Vec::<f64>::new());
            messages.iter().enumerate().any(|(k, &t_s)| {
                let at_s = 0.05 * k as f64;
                let Some(&newest_s) = kept.last().filter(|&&newest_s| newest_s > t_s) else {
                    kept.push(t_s);
                    return order.take(t_s);
                };
                assert!(newest_s - t_s < 1.0);
                let after = kept.iter().position(|&other_s| other_s > t_s).expect("a later stamp");
                let gap_s = after.checked_sub(1).map(|before| kept[after] - kept[before]);
                let least_s = kept.windows(2).map(|two| two[1] - two[0]).fold(f64::INFINITY, f64::min);
                order.take_late(gap_s, least_s, at_s)
            })
        };
        // A second clock is 0.33 s behind.
        let both: Vec<_> = (0..40).map(|k| 0.1 * f64::from(k / 2) - if k % 2 == 1 { 0.33 } else { 0.0 }).collect();
        assert!(found(&both));
        // Every fifth message is overtaken.
        let places = (0..60).zip([0, 0, 0, 1, -1].into_iter().cycle());
        let overtaken: Vec<_> = places.map(|(k, change)| 0.1 * f64::from(k + change)).collect();
        assert!(!found(&overtaken));
    }
}
