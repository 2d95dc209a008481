//! Contract of two vehicles on the plane between them: two messages, without a clock or a bound on latency or loss.
//!
//! The vehicle with the smaller number is the owner of the pair, the other one is the follower. The owner proposes a
//! plane under a number that grows. It holds the proposed plane beside the old one until it hears the decision on that
//! number. The follower decides once on each number: it accepts the plane if its own segment is inside, and then holds
//! it in the place of the old one.
//!
//! # Lemma 3
//! At every time the two hold a common plane. The follower holds exactly one plane X. Claim: the owner always holds
//! X. The follower changes from X to Y only on a proposal of Y. The owner has held X and Y since before that message
//! was sent. It gives one of them up only on the decision on that very number, which the follower takes once. On "yes"
//! the owner keeps Y, and the follower held Y before it sent the message. On "no" the owner keeps X, and the follower
//! never decides on that number again. A new number is given only after that. The argument uses no clock, order,
//! latency or share of loss.
//!
//! The base case is the plane of the starts. Both vehicles compute it from the same two announced starts, and each of
//! them tests both segments against both of its sides (`divider_of_starts`). A pair that fails the test has no
//! contract.
//!
//! # Shared starts
//! Each message carries a hash of the two starts of the pair. A vehicle that reads another hash holds other starts than
//! its partner, and the base case fails. The contract is void from then on. The vehicle keeps its planes for ever,
//! brakes before them, and takes no proposal and no decision. It still sends messages, so that the partner reads the
//! other hash too. [`Counters::exceeded`](crate::Counters::exceeded) reports it.
//!
//! # Messages
//! Every message of an owner repeats the pending proposal, every one of a follower its segment and the last decision. A
//! message with a larger stamp therefore replaces all older ones. So only the newest message of a sender is stored.
//!
//! # When messages are sent
//! Lemma 3 allows the loss of any message, so it allows that none is sent. A contract is due in the periods of
//! `agenda`: in each one near the plane, and less often with more room.
//!
//! - An owner whose contract is due sends its pending proposal. Without one it proposes, unless both vehicles are far.
//! - A follower sends its segment and last decision whenever it has heard the owner. It also sends them if its contract
//!   is due and it is near the plane: an owner far away needs the segment.
//!
//! The owner repeats a proposal until it hears the decision, and each repetition is answered. A lost answer is
//! therefore sent again.

use serde::{Deserialize, Serialize};

use crate::agenda::Horizon;
use crate::choice::Reach;
use crate::log::ContractView;
use crate::plane::{Divider, Metric, Plane, Segment};
use crate::start::{Start, hash_of_pair};

/// Proposal of a plane by the owner of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Proposal {
    /// Number of the proposal, from 1 in each pair.
    pub number: u32,
    /// Proposed plane.
    pub divider: Divider,
}

/// Decision of the follower of a pair on the proposal with a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Decision {
    /// Number of the proposal.
    pub number: u32,
    /// Whether the follower holds the proposed plane.
    pub accepted: bool,
}

/// Message from one vehicle to another. It may arrive late, never, twice or after a later one.
/// [`Message::to_bytes`] gives its 64 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message {
    /// Sender, counted from 0.
    pub from: u16,
    /// Receiver, counted from 0.
    pub to: u16,
    /// Number of the sender's period, from 1.
    pub stamp: u32,
    /// Hash of the starts of the pair.
    pub starts: u64,
    /// Content, by the side of the sender.
    pub body: Body,
}

/// Content of a message. The sender is the owner of the pair if its number is the smaller one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// From the owner.
    Owner {
        /// Pending proposal.
        proposal: Option<Proposal>,
    },
    /// From the follower.
    Follower {
        /// Segment that the sender holds from its next instant on.
        segment: Segment,
        /// Last decision.
        decision: Option<Decision>,
    },
}

impl Message {
    /// Whether all numbers are ones that a vehicle sends.
    pub(crate) fn is_valid(&self) -> bool {
        let is_valid = match &self.body {
            Body::Owner { proposal } => {
                self.from < self.to && proposal.is_none_or(|proposal| proposal.divider.is_valid())
            }
            Body::Follower { segment, .. } => self.from > self.to && segment.is_finite(),
        };
        is_valid && self.stamp > 0
    }
}

/// Messages from one vehicle to others, with the segment once. It may arrive at each of them late, never, twice or
/// after a later one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Broadcast {
    /// Sender, counted from 0.
    pub from: u16,
    /// Number of the sender's period, from 1.
    pub stamp: u32,
    /// Segment that the sender holds from its next instant on.
    pub segment: Segment,
    /// Parts for single vehicles, by their number. A broadcast has no message to the others.
    pub entries: Vec<Entry>,
}

/// Part of a broadcast for one vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Receiver, counted from 0.
    pub to: u16,
    /// Hash of the starts of the pair.
    pub starts: u64,
    /// Pending proposal, if the sender owns the pair.
    pub proposal: Option<Proposal>,
    /// Last decision, if the sender is the follower of the pair.
    pub decision: Option<Decision>,
}

impl Broadcast {
    /// Largest number of entries for which memory is reserved. A vehicle is rarely near more planes.
    const RESERVED: usize = 128;

    /// Returns a broadcast without entries, with memory for those of a swarm of this number of vehicles.
    #[must_use]
    pub fn for_swarm(vehicles: usize) -> Self {
        Self { entries: Vec::with_capacity(vehicles.min(Self::RESERVED)), ..Self::default() }
    }

    /// Returns the message to a vehicle. `None` if the broadcast has none.
    #[inline]
    #[must_use]
    pub fn message(&self, to: u16) -> Option<Message> {
        let place = self.entries.binary_search_by_key(&to, |entry| entry.to).ok()?;
        Some(self.message_of(&self.entries[place]))
    }

    /// Returns the message of an entry.
    #[inline]
    #[must_use]
    pub fn message_of(&self, entry: &Entry) -> Message {
        entry.message(self.from, self.stamp, self.segment)
    }

    /// Messages to all vehicles with one, in their order.
    pub fn messages(&self) -> impl Iterator<Item = Message> + '_ {
        self.entries.iter().map(|entry| self.message_of(entry))
    }
}

impl Entry {
    /// Returns the message of a sender with this part.
    #[inline]
    pub(crate) fn message(&self, from: u16, stamp: u32, segment: Segment) -> Message {
        let Self { to, starts, proposal, decision } = *self;
        let body = if from < to { Body::Owner { proposal } } else { Body::Follower { segment, decision } };
        Message { from, to, stamp, starts, body }
    }
}

/// Margin of a vehicle from a divider, and the lengths of both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Side {
    pub(crate) margin_m: f64,
    pub(crate) metric: Metric,
}

impl Side {
    pub(crate) fn owner_plane(&self, divider: &Divider) -> Plane {
        divider.owner_plane(self.metric, self.margin_m)
    }

    pub(crate) fn follower_plane(&self, divider: &Divider) -> Plane {
        divider.follower_plane(self.metric, self.margin_m)
    }
}

/// Decisions that a vehicle took at an instant, and the largest age of a plane within reach, in periods.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Renewed {
    pub(crate) accepted: u32,
    pub(crate) refused: u32,
    pub(crate) oldest: u64,
}

const NO_DECISION: Decision = Decision { number: 0, accepted: false };
const NO_PROPOSAL: Proposal = Proposal { number: 0, divider: Divider { normal: [0.0; 3], offset_m: 0.0 } };

/// Room, in the reach of a period at full speed, beyond which a plane is not renewed. A vehicle needs several periods
/// for this distance, and planes beyond reach do not limit its choice.
const RENEWED: f64 = 2.0;

/// Result of a look at a contract: whether to send, and when to look again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seen {
    /// Whether a message to the other vehicle is to be sent.
    pub(crate) speaks: bool,
    /// Number of periods after which the contract is due again.
    pub(crate) sleeps: u64,
}

/// Own state at an instant, for all contracts.
pub(crate) struct Instant<'a> {
    pub(crate) period: u64,
    /// Segment from this instant on.
    pub(crate) segment: &'a Segment,
    pub(crate) side: &'a Side,
    /// Reach of a period from the position \[m\].
    pub(crate) reach_m: f64,
    /// Rooms of planes that need not be looked at, at the present speed and at the largest speed.
    pub(crate) horizons: [Horizon; 2],
}

/// Returns the plane between an owner and a follower at their starts, which both compute with the same numbers. `None`
/// unless both ends of both segments are inside, each on its side.
pub(crate) fn divider_of_starts(owner: &Start, follower: &Start) -> Option<Divider> {
    let divider = Divider::between(owner.metric, &owner.segment, &follower.segment, owner.margin_m, follower.margin_m)?;
    let is_inside = divider.owner_plane(owner.metric, owner.margin_m).contains(&owner.segment)
        && divider.follower_plane(follower.metric, follower.margin_m).contains(&follower.segment);
    is_inside.then_some(divider)
}

/// Hash of the starts on which both vehicles of a pair must agree, and the state of their agreement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Shared {
    /// Hash of the two starts; 0 until the contract has a record.
    pub(crate) hash: u64,
    pub(crate) state: Agreement,
}

/// Whether the partner holds the same starts, by its messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Agreement {
    /// No message has arrived.
    Unheard,
    /// The partner sent the same hash.
    Same,
    /// The partner sent another hash. The contract is void.
    Void,
}

/// Result of a received message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Heard {
    /// The message is stored.
    Stored,
    /// The message is to another vehicle, older than another one, or of a void contract.
    Ignored,
    /// The message has a number that no vehicle sends.
    Invalid,
    /// The sender holds other starts.
    OtherStarts,
    /// No start of the sender was announced.
    Unknown,
}

impl Shared {
    const UNHEARD: Self = Self { hash: 0, state: Agreement::Unheard };

    /// Compares the hash of a message. Returns whether the message may be read.
    #[inline]
    fn compare(&mut self, hash: u64) -> Result<(), Heard> {
        if hash != self.hash {
            self.state = Agreement::Void;
            return Err(Heard::OtherStarts);
        }
        match self.state {
            Agreement::Void => Err(Heard::Ignored),
            Agreement::Same => Ok(()),
            Agreement::Unheard => {
                self.state = Agreement::Same;
                Ok(())
            }
        }
    }

    fn is_void(&self) -> bool {
        self.state == Agreement::Void
    }
}

/// Contract of a vehicle as the owner, with the newest message heard from the follower. Number 0 stands for no
/// proposal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Owned {
    pub(crate) shared: Shared,
    /// Stamp, segment and decision of the newest message; at first the segment of the start.
    stamp: u32,
    segment: Segment,
    decision: Decision,
    /// Plane that both vehicles hold.
    pub(crate) held: Plane,
    /// Period in which the held plane was taken on.
    held_since: u64,
    /// Last proposal, held beside the other plane while its decision is pending.
    proposed: Proposal,
    is_pending: bool,
    /// Distance that the follower keeps from the divider \[m\].
    follower_margin_m: f64,
    /// Distances of the two vehicles from the owner's plane beyond which the plane is not renewed \[m\].
    far_m: [f64; 2],
    /// Period in which the contract is due.
    pub(crate) due: u64,
}

impl Owned {
    /// Returns the contract at the start, without its hash. `None` if the segments are closer than the margins.
    pub(crate) fn new(own: &Start, follower: &Start) -> Option<Self> {
        let held = divider_of_starts(own, follower)?.owner_plane(own.metric, own.margin_m);
        let renewed = RENEWED * own.reach_m.max(follower.reach_m);
        let between = (own.margin_m + follower.margin_m) * own.metric.widest();
        Some(Self {
            shared: Shared::UNHEARD,
            stamp: 0,
            segment: follower.segment,
            decision: NO_DECISION,
            held,
            held_since: 0,
            proposed: NO_PROPOSAL,
            is_pending: false,
            follower_margin_m: follower.margin_m,
            far_m: [renewed, renewed + between],
            due: 0,
        })
    }

    /// Returns the contract with the hash of its starts.
    pub(crate) fn with_hash(mut self, own: &Start, follower: &Start) -> Self {
        self.shared.hash = hash_of_pair(own, follower);
        self
    }

    /// Stores a valid message of the follower unless a later one was heard or the contract is void.
    #[inline]
    pub(crate) fn hear(&mut self, message: &Message) -> Heard {
        if let Err(heard) = self.shared.compare(message.starts) {
            return heard;
        }
        let Body::Follower { segment, decision } = message.body else { return Heard::Invalid };
        if message.stamp <= self.stamp {
            return Heard::Ignored;
        }
        self.stamp = message.stamp;
        self.segment = segment;
        self.decision = decision.unwrap_or(NO_DECISION);
        Heard::Stored
    }

    /// Reads the newest message at an instant of this vehicle, with its segment from this instant on. If due, proposes
    /// the divider of the present segments, unless a proposal is pending or both vehicles are far from the plane.
    /// Returns whether the follower is to get a message.
    #[inline]
    pub(crate) fn renew(&mut self, own: &Segment, side: &Side, period: u64, is_due: bool) -> bool {
        if self.shared.is_void() {
            return is_due && !self.is_far(own);
        }
        if self.is_pending {
            if self.decision.number != self.proposed.number {
                return is_due;
            }
            self.is_pending = false;
            if self.decision.accepted {
                (self.held, self.held_since) = (side.owner_plane(&self.proposed.divider), period);
            }
        }
        if !is_due || self.is_far(own) {
            return false;
        }
        // After the largest number the plane stays.
        if let Some(divider) = Divider::between(side.metric, own, &self.segment, side.margin_m, self.follower_margin_m)
            && side.owner_plane(&divider).contains(own)
            && let Some(number) = self.proposed.number.checked_add(1)
        {
            self.proposed = Proposal { number, divider };
            self.is_pending = true;
        }
        // Without a proposal, the message asks for the follower's segment.
        true
    }

    /// Returns whether both vehicles are far from the plane, with the own segment.
    #[inline]
    pub(crate) fn is_far(&self, own: &Segment) -> bool {
        let followers = -self.held.room_m(&self.segment.position());
        self.held.room_m(&own.position()) > self.far_m[0] && followers > self.far_m[1]
    }

    /// Renews the plane at an instant, and adds the planes within reach.
    #[inline]
    pub(crate) fn look(
        &mut self,
        instant: &Instant<'_>,
        is_due: bool,
        near: &mut Reach,
        renewed: &mut Renewed,
    ) -> Seen {
        let speaks = self.renew(instant.segment, instant.side, instant.period, is_due);
        let position = instant.segment.position();
        let mut room = self.held.room_m(&position);
        if room <= instant.reach_m {
            renewed.oldest = renewed.oldest.max(self.age(instant.period));
            near.push(self.held);
        }
        if let Some(pending) = self.pending(instant.side) {
            let beside = pending.room_m(&position);
            if beside <= instant.reach_m {
                near.push(pending);
            }
            room = room.min(beside);
        }
        let followers_room = -self.held.room_m(&self.segment.position()) - (self.far_m[1] - self.far_m[0]);
        let [own, fastest] = instant.horizons;
        Seen { speaks, sleeps: own.periods(room).min(fastest.periods(followers_room)) }
    }

    /// Returns the plane that both vehicles hold.
    #[cfg(test)]
    pub(crate) fn held(&self) -> Plane {
        self.held
    }

    /// Returns the proposed plane that is held beside the other one.
    #[inline]
    pub(crate) fn pending(&self, side: &Side) -> Option<Plane> {
        self.is_pending.then(|| side.owner_plane(&self.proposed.divider))
    }

    /// Returns the contract for a log.
    pub(crate) fn view(&self) -> ContractView {
        let pending = self.is_pending.then_some(self.proposed);
        ContractView::Owner { held: self.held, pending, heard: self.decision }
    }

    /// Returns the pending proposal to be sent.
    #[inline]
    pub(crate) fn proposal(&self) -> Option<Proposal> {
        (self.is_pending && !self.shared.is_void()).then_some(self.proposed)
    }

    /// Returns the number of periods since the held plane was taken on.
    #[inline]
    pub(crate) fn age(&self, period: u64) -> u64 {
        period - self.held_since
    }
}

/// Contract of a vehicle as the follower, with the newest message heard from the owner.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Followed {
    pub(crate) shared: Shared,
    /// Stamp and proposal of the newest message.
    stamp: u32,
    proposal: Proposal,
    /// Plane that both vehicles hold.
    pub(crate) held: Plane,
    /// Period in which the held plane was taken on.
    held_since: u64,
    /// Last decision.
    decided: Decision,
    /// Distance from the plane beyond which the owner needs no segment \[m\].
    pub(crate) far_m: f64,
    /// Period in which the contract is due.
    pub(crate) due: u64,
}

impl Followed {
    /// Returns the contract at the start, without its hash. `None` if the segments are closer than the margins.
    pub(crate) fn new(own: &Start, owner: &Start) -> Option<Self> {
        let held = divider_of_starts(owner, own)?.follower_plane(own.metric, own.margin_m);
        let far_m = RENEWED * own.reach_m.max(owner.reach_m);
        let (shared, proposal, decided) = (Shared::UNHEARD, NO_PROPOSAL, NO_DECISION);
        Some(Self { shared, stamp: 0, proposal, held, held_since: 0, decided, far_m, due: 0 })
    }

    /// Returns the contract with the hash of its starts.
    pub(crate) fn with_hash(mut self, own: &Start, owner: &Start) -> Self {
        self.shared.hash = hash_of_pair(owner, own);
        self
    }

    /// Stores a valid message of the owner unless a later one was heard or the contract is void.
    #[inline]
    pub(crate) fn hear(&mut self, message: &Message) -> Heard {
        if let Err(heard) = self.shared.compare(message.starts) {
            return heard;
        }
        let Body::Owner { proposal } = message.body else { return Heard::Invalid };
        if message.stamp <= self.stamp {
            return Heard::Ignored;
        }
        self.stamp = message.stamp;
        self.proposal = proposal.unwrap_or(NO_PROPOSAL);
        Heard::Stored
    }

    /// Decides on a new proposal at an instant of this vehicle, with its segment from this instant on.
    #[inline]
    pub(crate) fn decide(&mut self, own: &Segment, side: &Side, period: u64, counted: &mut Renewed) {
        if self.shared.is_void() || self.proposal.number <= self.decided.number {
            return;
        }
        let plane = side.follower_plane(&self.proposal.divider);
        let accepted = plane.contains(own);
        self.decided = Decision { number: self.proposal.number, accepted };
        counted.accepted += u32::from(accepted);
        counted.refused += u32::from(!accepted);
        if accepted {
            (self.held, self.held_since) = (plane, period);
        }
    }

    /// Decides at an instant, and adds the plane if it is within reach. Each message of the owner is answered.
    #[inline]
    pub(crate) fn look(
        &mut self,
        instant: &Instant<'_>,
        [is_due, has_news]: [bool; 2],
        near: &mut Reach,
        counted: &mut Renewed,
    ) -> Seen {
        self.decide(instant.segment, instant.side, instant.period, counted);
        let room = self.held.room_m(&instant.segment.position());
        if room <= instant.reach_m {
            counted.oldest = counted.oldest.max(self.age(instant.period));
            near.push(self.held);
        }
        Seen { speaks: has_news || (is_due && room <= self.far_m), sleeps: instant.horizons[0].periods(room) }
    }

    /// Returns the plane that both vehicles hold.
    #[cfg(test)]
    pub(crate) fn held(&self) -> Plane {
        self.held
    }

    /// Returns the contract for a log.
    pub(crate) fn view(&self) -> ContractView {
        ContractView::Follower { held: self.held, heard: self.proposal, decided: self.decided }
    }

    /// Returns the last decision.
    #[inline]
    pub(crate) fn decision(&self) -> Option<Decision> {
        (self.decided.number > 0).then_some(self.decided)
    }

    /// Returns the number of periods since the held plane was taken on.
    #[inline]
    pub(crate) fn age(&self, period: u64) -> u64 {
        period - self.held_since
    }
}

#[cfg(test)]
impl Owned {
    /// Holds a plane and proposes none from now on.
    pub(crate) fn hold(&mut self, plane: Plane) {
        self.held = plane;
        self.is_pending = false;
        self.far_m = [f64::NEG_INFINITY; 2];
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::Limits;
    use crate::settings::{ROUNDING_M, Settings};
    use crate::start::Start;

    /// Margin 0.5 m.
    fn limits() -> Limits {
        Settings::new(1.0 - ROUNDING_M, 0.05).limits().expect("defaults")
    }

    const SIDE: Side = Side { margin_m: 0.5, metric: Metric::BALL };

    fn at(x: f64) -> Segment {
        Segment::new(Vector3::new(x, 0.0, 0.0), Vector3::new(x, 0.0, 0.0))
    }

    fn slot(x: f64) -> Start {
        limits().slot(Vector3::x() * x)
    }

    /// Returns the owner at 0 and the follower at `x`.
    fn pair(x: f64) -> (Owned, Followed) {
        let (one, other) = (slot(0.0), slot(x));
        let owner = Owned::new(&one, &other).expect("apart").with_hash(&one, &other);
        (owner, Followed::new(&other, &one).expect("apart").with_hash(&other, &one))
    }

    /// Returns the message of vehicle 0, the owner.
    fn proposes(owner: &Owned, stamp: u32) -> Message {
        let body = Body::Owner { proposal: owner.proposal() };
        Message { from: 0, to: 1, stamp, starts: owner.shared.hash, body }
    }

    /// Returns the message of vehicle 1, the follower.
    fn decides(follower: &Followed, stamp: u32, x: f64) -> Message {
        let body = Body::Follower { segment: at(x), decision: follower.decision() };
        Message { from: 1, to: 0, stamp, starts: follower.shared.hash, body }
    }

    #[test]
    fn a_pair_that_starts_too_near_has_no_contract() {
        assert!(Owned::new(&slot(0.0), &slot(0.9)).is_none() && Followed::new(&slot(0.0), &slot(0.9)).is_none());
        assert!(Owned::new(&slot(0.0), &slot(1.0)).is_some() && Followed::new(&slot(0.0), &slot(1.0)).is_some());
    }

    #[test]
    fn the_owner_holds_both_planes_until_it_hears_the_decision_on_that_number() {
        let (mut owner, mut follower) = pair(4.0);
        let mut counted = Renewed::default();
        let old = owner.held();
        assert_eq!(old, Plane { normal: Vector3::x(), offset_m: 1.5 });
        // The follower has moved to 3; the owner hears it and proposes a plane at 1.5.
        owner.hear(&decides(&follower, 1, 3.0));
        owner.renew(&at(0.0), &SIDE, 1, true);
        let sent = proposes(&owner, 1);
        assert_eq!((owner.held(), owner.pending(&SIDE).map(|plane| plane.offset_m)), (old, Some(1.0)));
        // No second proposal while one is pending, and a decision on another number has no effect.
        owner.renew(&at(0.2), &SIDE, 1, true);
        assert_eq!(proposes(&owner, 1), sent);
        let decision = Some(Decision { number: 7, accepted: true });
        let stale = Message { body: Body::Follower { segment: at(3.0), decision }, ..decides(&follower, 2, 3.0) };
        owner.hear(&stale);
        owner.renew(&at(0.0), &SIDE, 2, true);
        assert_eq!((owner.held(), owner.pending(&SIDE).is_some()), (old, true));

        follower.hear(&sent);
        follower.decide(&at(3.0), &SIDE, 2, &mut counted);
        assert_eq!(follower.held(), Plane { normal: -Vector3::x(), offset_m: -2.0 });
        // A copy that arrives again has no effect.
        follower.hear(&sent);
        follower.decide(&at(9.0), &SIDE, 3, &mut counted);
        assert_eq!(counted, Renewed { accepted: 1, ..Renewed::default() });

        owner.hear(&decides(&follower, 3, 3.0));
        owner.renew(&at(0.0), &SIDE, 4, true);
        assert_eq!((owner.held().offset_m, owner.age(6)), (1.0, 2));
        assert_eq!(owner.proposal().map(|proposal| proposal.number), Some(2));
    }

    #[test]
    fn a_follower_outside_refuses_and_the_owner_keeps_the_old_plane() {
        let (mut owner, mut follower) = pair(4.0);
        let mut counted = Renewed::default();
        let (old, kept) = (owner.held(), follower.held());
        owner.renew(&at(0.5), &SIDE, 1, true);
        follower.hear(&proposes(&owner, 1));
        // The follower is at 2.6: inside the old plane, outside the proposed one at 2.25 plus 0.5.
        follower.decide(&at(2.6), &SIDE, 1, &mut counted);
        assert_eq!((counted, follower.held()), (Renewed { refused: 1, ..Renewed::default() }, kept));
        owner.hear(&decides(&follower, 1, 2.6));
        owner.renew(&at(0.5), &SIDE, 2, true);
        assert_eq!((owner.held(), owner.proposal().map(|proposal| proposal.number)), (old, Some(2)));
    }

    #[test]
    fn a_plane_is_renewed_when_one_of_the_two_comes_near() {
        let reach = slot(0.0).reach_m;
        let (mut owner, follower) = pair(20.0);
        owner.renew(&at(0.0), &SIDE, 1, true);
        assert_eq!(owner.proposal(), None);
        // The plane is at 10.
        let mut near = owner;
        near.hear(&decides(&follower, 1, 10.6 + 2.0 * reach));
        near.renew(&at(0.0), &SIDE, 1, true);
        assert_eq!(near.proposal(), None);
        near.hear(&decides(&follower, 2, 10.4 + 2.0 * reach));
        near.renew(&at(0.0), &SIDE, 1, true);
        assert!(near.proposal().is_some());
        owner.renew(&at(9.6 - 2.0 * reach), &SIDE, 1, true);
        assert!(owner.proposal().is_some());
    }

    #[test]
    fn older_and_invalid_messages_are_ignored() {
        let (mut owner, mut follower) = pair(4.0);
        assert_eq!(owner.hear(&decides(&follower, 5, 3.0)), Heard::Stored);
        let heard = owner;
        assert_eq!(owner.hear(&decides(&follower, 4, 2.0)), Heard::Ignored);
        assert_eq!(owner, heard);
        assert!(!decides(&follower, 6, f64::NAN).is_valid() && !decides(&follower, 0, 3.0).is_valid());
        let divider = Divider { normal: [2.0, 0.0, 0.0], offset_m: 0.0 };
        let body = Body::Owner { proposal: Some(Proposal { number: 1, divider }) };
        assert!(!Message { body, ..proposes(&owner, 7) }.is_valid());
        // A body of the other side.
        assert!(!Message { from: 1, to: 0, ..proposes(&owner, 7) }.is_valid());
        let unheard = follower;
        assert_eq!(
            follower.hear(&Message { body: decides(&follower, 7, 3.0).body, ..proposes(&owner, 7) }),
            Heard::Invalid
        );
        assert_eq!(Followed { shared: unheard.shared, ..follower }, unheard);
    }

    #[test]
    fn another_hash_voids_the_contract_for_ever() {
        let (mut owner, mut follower) = pair(4.0);
        owner.renew(&at(0.0), &SIDE, 1, true);
        let (sent, held) = (proposes(&owner, 1), owner.held());
        assert!(owner.proposal().is_some());
        let mut counted = Renewed::default();
        let other = Message { starts: sent.starts ^ 1, ..sent };
        assert_eq!((follower.hear(&other), follower.hear(&sent)), (Heard::OtherStarts, Heard::Ignored));
        let kept = follower.held();
        follower.decide(&at(4.0), &SIDE, 2, &mut counted);
        assert_eq!((follower.held(), follower.decision(), counted), (kept, None, Renewed::default()));

        let other = Message { starts: 0, ..decides(&follower, 9, 4.0) };
        let decision = Some(Decision { number: 1, accepted: true });
        let yes = Message { body: Body::Follower { segment: at(4.0), decision }, ..decides(&follower, 10, 4.0) };
        assert_eq!((owner.hear(&other), owner.hear(&yes)), (Heard::OtherStarts, Heard::Ignored));
        // Both planes are held for ever. The owner still sends, without a proposal.
        for period in 2..9 {
            assert!(owner.renew(&at(0.0), &SIDE, period, true));
            assert_eq!((owner.held(), owner.pending(&SIDE).is_some(), owner.proposal()), (held, true, None));
        }
    }

    #[test]
    fn a_normal_of_single_precision_leaves_both_vehicles_their_margins() {
        let mut random = crate::tests::Random::new(71);
        let metrics = [Metric::BALL, Metric::ellipsoid(1.0, 0.3), Metric::ellipsoid(1.0, 2.0)];
        for round in 0..3_000 {
            let metric = metrics[round % 3];
            // Rounded before it is proposed.
            #[allow(clippy::cast_possible_truncation)]
            let normal = <[f64; 3]>::from(random.direction()).map(|value| f64::from(value as f32));
            let divider = Divider { normal, offset_m: random.between(-100.0, 100.0) };
            assert!(divider.is_valid());
            let (mine, yours) = (random.between(0.1, 50.0), random.between(0.1, 50.0));
            let planes = [divider.owner_plane(metric, mine), divider.follower_plane(metric, yours)];
            assert!(planes.iter().all(|plane| (plane.normal.norm() - 1.0).abs() < 1e-12));
            let [one, other] = planes.map(|plane| {
                let point = random.vector(200.0);
                point + plane.normal * plane.room_m(&point).min(0.0)
            });
            assert!(metric.scaled(&(one - other)).norm() >= mine + yours - 1e-10, "{divider:?}");
        }
    }
}
