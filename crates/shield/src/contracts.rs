//! Contracts of a vehicle with all others. Each period tests only those whose planes may come within reach.

use std::cmp::Ordering;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::agenda::Agenda;
use crate::choice::Reach;
use crate::contract::{
    Agreement, Broadcast, Entry, Followed, Heard, Instant, Message, Owned, Renewed, divider_of_starts,
};
use crate::fleet::{PairRoom, closest_starts};
use crate::log::ContractView;
use crate::plane::Segment;
use crate::report::SharedStarts;
use crate::settings::{ShieldError, ShieldFault};
use crate::start::{Start, hash_of_pair};
#[cfg(test)]
use crate::{contract::Side, plane::Divider};

/// Contracts of a vehicle as they are saved.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SavedContracts {
    index: u16,
    places: Vec<u32>,
    followed: Vec<Followed>,
    owned: Vec<Owned>,
    agenda: Agenda,
}

/// Contracts of a vehicle with all others. A contract has a record from the first instant or message at which it is
/// more than the plane of the starts, which both vehicles can compute again.
#[derive(Clone, Debug)]
pub(crate) struct Contracts {
    index: u16,
    starts: Arc<[Start]>,
    /// Place of the record of each other vehicle, from 1; 0 without a record.
    places: Vec<u32>,
    /// Contracts with vehicles of smaller numbers.
    followed: Vec<Followed>,
    /// Contracts with vehicles of larger numbers.
    owned: Vec<Owned>,
    agenda: Agenda,
}

impl Contracts {
    /// Returns the contracts at the start.
    ///
    /// # Errors
    /// If the number is not in the list, or the vehicle starts too near to another one.
    pub(crate) fn new(index: usize, starts: Arc<[Start]>) -> Result<Self, ShieldError> {
        let count = starts.len();
        let (Some(own), Ok(number)) = (starts.get(index), u16::try_from(index)) else {
            let problem = format!("the number of the vehicle is not among {count} starts of at most 65536");
            return Err(ShieldError::new(
                ShieldFault::Mismatch,
                "index",
                problem,
                index as f64,
                "count vehicles from 0",
            ));
        };
        let has_plane = |owner: &Start, follower: &Start| divider_of_starts(owner, follower).is_some();
        let (before, after) = (&starts[..index], &starts[index + 1..]);
        if before.iter().all(|owner| has_plane(owner, own)) && after.iter().all(|follower| has_plane(own, follower)) {
            // The memory is reserved here, and first written when a record is made.
            let (followed, owned) = (Vec::with_capacity(index), Vec::with_capacity(count - index - 1));
            let (places, agenda) = (vec![0; count], Agenda::new(count));
            return Ok(Self { index: number, starts, places, followed, owned, agenda });
        }
        let apart = |other: usize| PairRoom::of(&starts, index.min(other), index.max(other));
        let others = (0..count).filter(|other| *other != index).map(apart);
        let worst = others.min_by(|a, b| a.room_m().total_cmp(&b.room_m())).or_else(|| closest_starts(&starts));
        Err(worst.map_or_else(
            || ShieldError::new(ShieldFault::Mismatch, "start", "a vehicle has no pair".into(), 0.0, "give two starts"),
            |worst| worst.too_near(),
        ))
    }

    /// Returns the contracts to be saved.
    pub(crate) fn save(&self) -> SavedContracts {
        let Self { index, starts: _, places, followed, owned, agenda } = self.clone();
        SavedContracts { index, places, followed, owned, agenda }
    }

    /// Returns saved contracts among these starts.
    ///
    /// # Errors
    /// If the data do not fit the starts.
    pub(crate) fn load(saved: &SavedContracts, starts: Arc<[Start]>) -> Result<Self, ShieldError> {
        let mut contracts = Self::new(saved.index as usize, starts)?;
        let SavedContracts { index, places, followed, owned, agenda } = saved;
        // Each record belongs to one place, on its side.
        let mut records = [vec![false; followed.len()], vec![false; owned.len()]];
        let mut fits = places.len() == contracts.places.len() && agenda.is_of(places.len());
        for (other, place) in places.iter().enumerate().filter(|(_, place)| **place > 0) {
            let record = records[usize::from(other > *index as usize)].get_mut(*place as usize - 1);
            fits &= other != *index as usize && record.is_some_and(|record| !std::mem::replace(record, true));
        }
        fits &= records.iter().flatten().all(|is_used| *is_used);
        for (other, place) in places.iter().enumerate().filter(|(_, place)| **place > 0) {
            if !fits {
                break;
            }
            let (own, partner) = (contracts.starts[*index as usize], contracts.starts[other]);
            let place = *place as usize - 1;
            fits = if other < *index as usize {
                followed[place].shared.hash == hash_of_pair(&partner, &own)
            } else {
                owned[place].shared.hash == hash_of_pair(&own, &partner)
            };
        }
        if !fits {
            let problem = "the saved contracts do not fit the starts".into();
            return Err(ShieldError::new(
                ShieldFault::Altered,
                "saved",
                problem,
                places.len() as f64,
                "give unaltered data",
            ));
        }
        contracts.places.copy_from_slice(places);
        contracts.followed.extend_from_slice(followed);
        contracts.owned.extend_from_slice(owned);
        contracts.agenda = agenda.clone();
        Ok(contracts)
    }

    /// Number of the vehicle.
    pub(crate) fn index(&self) -> u16 {
        self.index
    }

    /// Announced starts of all vehicles.
    pub(crate) fn starts(&self) -> &[Start] {
        &self.starts
    }

    /// Announced start of the vehicle.
    pub(crate) fn own(&self) -> &Start {
        &self.starts[self.index as usize]
    }

    /// Returns the contract with another vehicle, for a log. `None` while it is that of the starts.
    pub(crate) fn view(&self, other: usize) -> Option<ContractView> {
        let place = (*self.places.get(other)? as usize).checked_sub(1)?;
        if other < self.index as usize {
            self.followed.get(place).map(Followed::view)
        } else {
            self.owned.get(place).map(Owned::view)
        }
    }

    /// Returns the contract with a vehicle of a larger number, at the start.
    fn owned_at_start(&self, other: usize) -> Option<Owned> {
        Owned::new(&self.starts[self.index as usize], self.starts.get(other)?)
    }

    /// Returns the contract with a vehicle of a smaller number, at the start.
    fn followed_at_start(&self, other: usize) -> Option<Followed> {
        Followed::new(&self.starts[self.index as usize], self.starts.get(other)?)
    }

    /// Returns the place of the record of another vehicle. Makes the record at first.
    #[inline]
    fn place(&mut self, other: usize) -> Option<usize> {
        let place = *self.places.get(other)?;
        if place == 0 { self.add(other) } else { Some(place as usize - 1) }
    }

    fn add(&mut self, other: usize) -> Option<usize> {
        // `new` has found a plane for each pair.
        let (own, partner) = (&self.starts[self.index as usize], self.starts.get(other)?);
        let count = match other.cmp(&(self.index as usize)) {
            Ordering::Less => {
                self.followed.push(self.followed_at_start(other)?.with_hash(own, partner));
                self.followed.len()
            }
            Ordering::Greater => {
                self.owned.push(self.owned_at_start(other)?.with_hash(own, partner));
                self.owned.len()
            }
            Ordering::Equal => return None,
        };
        self.places[other] = u32::try_from(count).ok()?;
        Some(count - 1)
    }

    /// Stores a message to this vehicle. Messages to other vehicles have no effect.
    #[inline]
    pub(crate) fn hear(&mut self, message: &Message) -> Heard {
        let from = message.from as usize;
        if message.to != self.index {
            return Heard::Ignored;
        }
        if !message.is_valid() {
            return Heard::Invalid;
        }
        let Some(place) = self.place(from) else { return Heard::Unknown };
        let heard = if message.from < self.index {
            self.followed[place].hear(message)
        } else {
            self.owned[place].hear(message)
        };
        // A void contract is looked at too, so that the partner hears this vehicle's hash.
        if matches!(heard, Heard::Stored | Heard::OtherStarts) {
            self.agenda.hear(from);
        }
        heard
    }

    /// Returns how many other vehicles sent the hash of the same starts.
    pub(crate) fn shared_starts(&self) -> SharedStarts {
        let followed = self.followed.iter().map(|contract| contract.shared);
        let shared = followed.chain(self.owned.iter().map(|contract| contract.shared));
        let agreed = shared.filter(|shared| shared.state == Agreement::Same).count();
        SharedStarts { partners: self.starts.len() - 1, agreed, is_one_list: false }
    }

    /// Reads the newest messages, decides and proposes at an instant, in the order of the other vehicles. Adds the
    /// planes within reach.
    pub(crate) fn renew(&mut self, instant: &Instant<'_>, near: &mut Reach) -> Renewed {
        let mut renewed = Renewed::default();
        for word in 0..self.agenda.words() {
            let [fired, heard] = self.agenda.take(word, instant.period);
            let mut open = fired | heard;
            while open != 0 {
                let other = 64 * word + open.trailing_zeros() as usize;
                let bit = open & open.wrapping_neg();
                open ^= bit;
                self.look(other, [fired & bit != 0, heard & bit != 0], instant, near, &mut renewed);
            }
        }
        self.agenda.end(instant.period);
        renewed
    }

    /// Looks at the contract with a vehicle whose period has come or that has news.
    #[inline]
    fn look(
        &mut self,
        other: usize,
        [has_come, has_news]: [bool; 2],
        instant: &Instant<'_>,
        near: &mut Reach,
        renewed: &mut Renewed,
    ) {
        if self.places.get(other) == Some(&0)
            && let Some(room) = self.room_at_start(other, instant)
        {
            self.agenda.schedule(other, instant.period + instant.horizons[0].periods(room));
            return;
        }
        let Some(place) = self.place(other) else { return };
        // A period noted before a message or a proposal set another one is passed over.
        let is_due = |due: u64| has_come && due <= instant.period;
        let (seen, due) = if other < self.index as usize {
            let contract = &mut self.followed[place];
            let is_due = is_due(contract.due);
            if !(is_due || has_news) {
                return;
            }
            (contract.look(instant, [is_due, has_news], near, renewed), &mut contract.due)
        } else {
            let contract = &mut self.owned[place];
            let is_due = is_due(contract.due);
            if !(is_due || has_news) {
                return;
            }
            (contract.look(instant, is_due, near, renewed), &mut contract.due)
        };
        let next = instant.period + seen.sleeps;
        if *due <= instant.period || next < *due {
            *due = next;
            self.agenda.schedule(other, next);
        }
        if seen.speaks {
            self.agenda.speak(other);
        }
    }

    /// Returns the room of the plane of the starts \[m\], if both vehicles are far from it.
    fn room_at_start(&self, other: usize, instant: &Instant<'_>) -> Option<f64> {
        let (held, is_far) = match other.cmp(&(self.index as usize)) {
            Ordering::Less => {
                let contract = self.followed_at_start(other)?;
                (contract.held, contract.held.room_m(&instant.segment.position()) > contract.far_m)
            }
            Ordering::Greater => {
                let contract = self.owned_at_start(other)?;
                (contract.held, contract.is_far(instant.segment))
            }
            Ordering::Equal => return None,
        };
        is_far.then(|| held.room_m(&instant.segment.position()))
    }

    /// Takes the next part of the messages that are to be sent.
    #[inline]
    fn next_entry(&mut self) -> Option<Entry> {
        let to = self.agenda.next_outgoing()?;
        let (to, place) = (u16::try_from(to).ok()?, self.place(to)?);
        Some(if to < self.index {
            let contract = &self.followed[place];
            Entry { to, starts: contract.shared.hash, proposal: None, decision: contract.decision() }
        } else {
            let contract = &self.owned[place];
            Entry { to, starts: contract.shared.hash, proposal: contract.proposal(), decision: None }
        })
    }

    /// Takes the messages that are to be sent.
    pub(crate) fn messages(&mut self, period: u64, segment: Segment) -> impl Iterator<Item = Message> + '_ {
        let from = self.index;
        std::iter::from_fn(move || {
            let stamp = stamp(period)?;
            Some(self.next_entry()?.message(from, stamp, segment))
        })
    }

    /// Takes the messages that are to be sent, as one.
    pub(crate) fn write_broadcast(&mut self, period: u64, segment: Segment, broadcast: &mut Broadcast) {
        broadcast.entries.clear();
        let Some(stamp) = stamp(period) else { return };
        (broadcast.from, broadcast.stamp, broadcast.segment) = (self.index, stamp, segment);
        while let Some(entry) = self.next_entry() {
            broadcast.entries.push(entry);
        }
    }
}

/// Returns the stamp of a period. After 2^32 periods, 1.3 years at 100 Hz, a vehicle is silent: the others stay behind
/// their last planes.
fn stamp(period: u64) -> Option<u32> {
    u32::try_from(period).ok()
}

/// Defects for tests: planes without the contract.
#[cfg(test)]
impl Contracts {
    /// Holds the planes between its own segment and these segments of all vehicles, as for equal vehicles. Returns
    /// whether every pair has one.
    pub(crate) fn hold_heard(&mut self, own: &Segment, side: &Side, heard: &[Segment]) -> bool {
        let plane = |other: &Segment| {
            let divider = Divider::between(side.metric, own, other, side.margin_m, side.margin_m);
            divider.map(|divider| side.owner_plane(&divider))
        };
        let mut has_all = true;
        for (other, segment) in heard.iter().enumerate() {
            let Some(place) = self.place(other) else { continue };
            match plane(segment) {
                None => has_all = false,
                Some(plane) if other < self.index as usize => self.followed[place].held = plane,
                Some(plane) => self.owned[place].hold(plane),
            }
            self.agenda.hear(other);
            self.agenda.speak(other);
        }
        has_all
    }

    /// Returns the number of the pending proposal to a vehicle.
    pub(crate) fn pending_number(&self, to: u16) -> Option<u32> {
        let place = *self.places.get(to as usize).filter(|place| to > self.index && **place > 0)?;
        Some(self.owned[place as usize - 1].proposal()?.number)
    }
}
