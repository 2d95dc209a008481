//! Contract of two vehicles on the plane between them: two messages, without a clock or a bound on latency or loss.
//!
//! The vehicle with the smaller number is the owner of the pair, the other one is the follower. The owner proposes a
//! plane under a number that grows. It holds the proposed plane beside the old one until it hears the decision on that
//! number. The follower decides once on each number: it accepts the plane if its own segment is inside, and then holds it
//! in the place of the old one.
//!
//! # Lemma 3
//! At every time the two hold a common plane. The follower holds exactly one plane X; claim: the owner holds X at all
//! times. The follower changes from X to Y only on a proposal of Y. The owner has held X and Y since before that message
//! was sent. It gives one of them up only on the decision on that very number, which the follower takes once. On "yes"
//! the owner keeps Y, and the follower held Y before it sent the message. On "no" the owner keeps X, and the follower
//! never decides on that number again. A new number is given only after that. The argument uses no clock, order,
//! latency or share of loss.
//!
//! Every message repeats the present segment, the pending proposal and the last decision. A message with a larger stamp
//! therefore contains all that an older one can still say, and the newest message of a sender is the only one stored.

use serde::{Deserialize, Serialize};

use crate::plane::{Divider, Plane, Segment};

/// Proposal of a plane by the owner of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Proposal {
    /// Number of the proposal, from 1 in each pair.
    pub number: u64,
    /// Proposed plane.
    pub divider: Divider,
}

/// Decision of the follower of a pair on the proposal with a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Decision {
    /// Number of the proposal.
    pub number: u64,
    /// Whether the follower holds the proposed plane.
    pub accepted: bool,
}

/// Message from one vehicle to another. It may arrive late, never, twice or after a later one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Message {
    /// Sender, counted from 0.
    pub from: u32,
    /// Receiver, counted from 0.
    pub to: u32,
    /// Number of the sender's period, from 1.
    pub stamp: u64,
    /// Segment that the sender holds from its next instant on.
    pub segment: Segment,
    /// Pending proposal, if the sender owns the pair.
    pub proposal: Option<Proposal>,
    /// Last decision, if the sender is the follower of the pair.
    pub decision: Option<Decision>,
}

impl Message {
    /// Whether all numbers are finite and a proposed normal has length 1.
    fn is_valid(&self) -> bool {
        self.segment.is_finite() && self.proposal.is_none_or(|proposal| proposal.divider.is_valid())
    }
}

/// Decisions that a vehicle took or heard in one period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Decided {
    pub(crate) accepted: u32,
    pub(crate) refused: u32,
}

/// Side of a vehicle in the contract with one other vehicle, and the newest message heard from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Contract {
    /// The other vehicle.
    other: u32,
    /// Whether this vehicle is the owner of the pair.
    is_owner: bool,
    /// Whether the newest message has not been read.
    is_fresh: bool,
    /// Distance that this vehicle keeps from the divider \[m\].
    margin_m: f64,
    /// Distance that the other vehicle keeps \[m\].
    other_margin_m: f64,
    /// Plane that both vehicles hold.
    held: Plane,
    /// Period in which the held plane was taken on.
    held_since: u64,
    /// Proposed plane that the owner holds beside the other one until it hears the decision.
    pending: Option<(Plane, Proposal)>,
    /// Number of the last proposal that the owner made.
    proposed: u64,
    /// Last decision that the follower took.
    decided: Option<Decision>,
    /// Segment of the other vehicle, from the start or the newest message.
    heard: Segment,
    /// Stamp of the newest message.
    stamp: u64,
    /// Proposal and decision of the newest message.
    news: (Option<Proposal>, Option<Decision>),
}

impl Contract {
    /// Returns the contract at the start: both vehicles hold the divider of their announced segments. `None` if these are
    /// closer than the margins.
    pub(crate) fn new(own: (u32, Segment, f64), other: (u32, Segment, f64)) -> Option<Self> {
        let ((number, segment, margin_m), (other, heard, other_margin_m)) = (own, other);
        let is_owner = number < other;
        // Both vehicles compute the same numbers.
        let held = if is_owner {
            Divider::between(&segment, &heard, margin_m, other_margin_m)?.owner_plane(margin_m)
        } else {
            Divider::between(&heard, &segment, other_margin_m, margin_m)?.follower_plane(margin_m)
        };
        Some(Self {
            other,
            is_owner,
            is_fresh: false,
            margin_m,
            other_margin_m,
            held,
            held_since: 0,
            pending: None,
            proposed: 0,
            decided: None,
            heard,
            stamp: 0,
            news: (None, None),
        })
    }

    /// Stores a message of the other vehicle unless a later one was heard or its numbers are invalid.
    #[inline]
    pub(crate) fn hear(&mut self, message: &Message) {
        if message.stamp > self.stamp && message.is_valid() {
            self.stamp = message.stamp;
            self.heard = message.segment;
            self.news = (message.proposal, message.decision);
            self.is_fresh = true;
        }
    }

    /// Reads the newest message at an instant of this vehicle, with its segment from this instant on.
    #[inline]
    pub(crate) fn read(&mut self, own: &Segment, period: u64, decided: &mut Decided) {
        if !self.is_fresh {
            return;
        }
        self.is_fresh = false;
        if self.is_owner {
            let Some((plane, proposal)) = self.pending else { return };
            let Some(decision) = self.news.1.filter(|decision| decision.number == proposal.number) else { return };
            if decision.accepted {
                (self.held, self.held_since) = (plane, period);
            }
            self.pending = None;
        } else {
            let last = self.decided.map_or(0, |decision| decision.number);
            let Some(proposal) = self.news.0.filter(|proposal| proposal.number > last) else { return };
            let plane = proposal.divider.follower_plane(self.margin_m);
            let accepted = plane.contains(own);
            if accepted {
                (self.held, self.held_since) = (plane, period);
                decided.accepted += 1;
            } else {
                decided.refused += 1;
            }
            self.decided = Some(Decision { number: proposal.number, accepted });
        }
    }

    /// Proposes the divider of the present segments, as the owner without a pending proposal.
    #[inline]
    pub(crate) fn propose(&mut self, own: &Segment) {
        if !self.is_owner || self.pending.is_some() {
            return;
        }
        let Some(divider) = Divider::between(own, &self.heard, self.margin_m, self.other_margin_m) else { return };
        let plane = divider.owner_plane(self.margin_m);
        if plane.contains(own) {
            self.proposed += 1;
            self.pending = Some((plane, Proposal { number: self.proposed, divider }));
        }
    }

    /// Returns the planes that this vehicle holds against the other one.
    #[inline]
    pub(crate) fn planes(&self) -> (Plane, Option<Plane>) {
        (self.held, self.pending.map(|(plane, _)| plane))
    }

    /// Returns the message to the other vehicle.
    #[inline]
    pub(crate) fn message(&self, from: u32, stamp: u64, segment: Segment) -> Message {
        let proposal = self.pending.map(|(_, proposal)| proposal);
        Message { from, to: self.other, stamp, segment, proposal, decision: self.decided }
    }

    /// Returns the number of periods since the held plane was taken on.
    #[inline]
    pub(crate) fn age(&self, period: u64) -> u64 {
        period - self.held_since
    }

    /// Defect for tests: holds the divider of the present segment and the one heard last, without the contract. Returns
    /// whether there is one.
    #[cfg(test)]
    pub(crate) fn hold_heard(&mut self, own: &Segment) -> bool {
        self.is_owner = false;
        let divider = Divider::between(own, &self.heard, self.margin_m, self.other_margin_m);
        divider.map(|divider| self.held = divider.owner_plane(self.margin_m)).is_some()
    }
}
