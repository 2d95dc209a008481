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
//! Every message repeats the present segment, the pending proposal and the last decision. A message with a larger stamp
//! therefore contains all that an older one can still say, and the newest message of a sender is the only one stored.

use serde::{Deserialize, Serialize};

use crate::plane::{Divider, Metric, Plane, Segment};
use crate::settings::Start;

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

/// Margin of a vehicle from a divider, and the lengths of both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Side {
    pub(crate) margin_m: f64,
    pub(crate) metric: Metric,
}

impl Side {
    fn owner_plane(&self, divider: &Divider) -> Plane {
        divider.owner_plane(self.metric, self.margin_m)
    }

    fn follower_plane(&self, divider: &Divider) -> Plane {
        divider.follower_plane(self.metric, self.margin_m)
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
    /// Plane that both vehicles hold.
    held: Plane,
    /// Period in which the held plane was taken on.
    held_since: u64,
    role: Role,
    /// Segment of the other vehicle, from the start or the newest message.
    heard: Segment,
    /// Stamp of the newest message.
    stamp: u64,
    /// Distance that the other vehicle keeps from the divider \[m\].
    other_margin_m: f64,
    /// The other vehicle.
    other: u32,
    /// Whether the newest message has not been read.
    is_fresh: bool,
}

/// Role in a pair, with what was sent and heard in it. Number 0 stands for no proposal.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Role {
    Owner {
        /// Last proposal, held beside the other plane while its decision is pending.
        proposed: Proposal,
        is_pending: bool,
        /// Decision of the newest message.
        heard: Decision,
    },
    Follower {
        /// Last decision.
        decided: Decision,
        /// Proposal of the newest message.
        heard: Proposal,
    },
}

const NO_DECISION: Decision = Decision { number: 0, accepted: false };
const NO_PROPOSAL: Proposal = Proposal { number: 0, divider: Divider { normal: [0.0; 3], offset_m: 0.0 } };

impl Contract {
    /// Returns the contract at the start: both vehicles hold the divider of their announced segments. Each vehicle is
    /// its number and start. `None` if the segments are closer than the margins.
    pub(crate) fn new(own: (u32, &Start), other: (u32, &Start)) -> Option<Self> {
        let ((number, own), (other, start)) = (own, other);
        let (metric, margin_m, other_margin_m) = (own.metric, own.margin_m, start.margin_m);
        // Both vehicles compute the same numbers.
        let (held, role) = if number < other {
            let divider = Divider::between(metric, &own.segment, &start.segment, margin_m, other_margin_m)?;
            let role = Role::Owner { proposed: NO_PROPOSAL, is_pending: false, heard: NO_DECISION };
            (divider.owner_plane(metric, margin_m), role)
        } else {
            let divider = Divider::between(metric, &start.segment, &own.segment, other_margin_m, margin_m)?;
            (divider.follower_plane(metric, margin_m), Role::Follower { decided: NO_DECISION, heard: NO_PROPOSAL })
        };
        let heard = start.segment;
        Some(Self { held, held_since: 0, role, heard, stamp: 0, other_margin_m, other, is_fresh: false })
    }

    /// Stores a message of the other vehicle unless a later one was heard or its numbers are invalid.
    #[inline]
    pub(crate) fn hear(&mut self, message: &Message) {
        if message.stamp <= self.stamp || !message.is_valid() {
            return;
        }
        self.stamp = message.stamp;
        self.heard = message.segment;
        self.is_fresh = true;
        match &mut self.role {
            Role::Owner { heard, .. } => *heard = message.decision.unwrap_or(NO_DECISION),
            Role::Follower { heard, .. } => *heard = message.proposal.unwrap_or(NO_PROPOSAL),
        }
    }

    /// Reads the newest message at an instant of this vehicle, with its segment from this instant on and its margin.
    #[inline]
    pub(crate) fn read(&mut self, own: &Segment, side: &Side, period: u64, counted: &mut Decided) {
        if !std::mem::take(&mut self.is_fresh) {
            return;
        }
        match &mut self.role {
            Role::Owner { proposed, is_pending, heard } => {
                if *is_pending && heard.number == proposed.number {
                    *is_pending = false;
                    if heard.accepted {
                        (self.held, self.held_since) = (side.owner_plane(&proposed.divider), period);
                    }
                }
            }
            Role::Follower { decided, heard } => {
                if heard.number > decided.number {
                    let plane = side.follower_plane(&heard.divider);
                    let accepted = plane.contains(own);
                    *decided = Decision { number: heard.number, accepted };
                    counted.accepted += u32::from(accepted);
                    counted.refused += u32::from(!accepted);
                    if accepted {
                        (self.held, self.held_since) = (plane, period);
                    }
                }
            }
        }
    }

    /// Proposes the divider of the present segments, as the owner without a pending proposal.
    #[inline]
    pub(crate) fn propose(&mut self, own: &Segment, side: &Side) {
        if let Role::Owner { proposed, is_pending: is_pending @ false, .. } = &mut self.role
            && let Some(divider) = Divider::between(side.metric, own, &self.heard, side.margin_m, self.other_margin_m)
            && side.owner_plane(&divider).contains(own)
        {
            *proposed = Proposal { number: proposed.number + 1, divider };
            *is_pending = true;
        }
    }

    /// Returns the plane that both vehicles hold.
    #[inline]
    pub(crate) fn held(&self) -> Plane {
        self.held
    }

    /// Returns the proposed plane that is held beside the other one.
    #[inline]
    pub(crate) fn pending(&self, side: &Side) -> Option<Plane> {
        match &self.role {
            Role::Owner { proposed, is_pending: true, .. } => Some(side.owner_plane(&proposed.divider)),
            _ => None,
        }
    }

    /// Returns the message to the other vehicle.
    #[inline]
    pub(crate) fn message(&self, from: u32, stamp: u64, segment: Segment) -> Message {
        let (proposal, decision) = match self.role {
            Role::Owner { proposed, is_pending, .. } => (is_pending.then_some(proposed), None),
            Role::Follower { decided, .. } => (None, (decided.number > 0).then_some(decided)),
        };
        Message { from, to: self.other, stamp, segment, proposal, decision }
    }

    /// Returns the number of periods since the held plane was taken on.
    #[inline]
    pub(crate) fn age(&self, period: u64) -> u64 {
        period - self.held_since
    }

    /// Defect for tests: holds the divider of the present segment and the one heard last, without the contract. Returns
    /// whether there is one.
    #[cfg(test)]
    pub(crate) fn hold_heard(&mut self, own: &Segment, side: &Side) -> bool {
        self.role = Role::Follower { decided: NO_DECISION, heard: NO_PROPOSAL };
        let divider = Divider::between(side.metric, own, &self.heard, side.margin_m, self.other_margin_m);
        divider.map(|divider| self.held = side.owner_plane(&divider)).is_some()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::Limits;
    use crate::settings::{ROUNDING_M, Settings};

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
    fn pair(x: f64) -> (Contract, Contract) {
        let contract = |own, other| Contract::new(own, other).expect("apart");
        let (owner, follower) = (slot(0.0), slot(x));
        (contract((0, &owner), (1, &follower)), contract((1, &follower), (0, &owner)))
    }

    #[test]
    fn a_pair_that_starts_too_near_has_no_contract() {
        assert!(Contract::new((0, &slot(0.0)), (1, &slot(0.9))).is_none());
        assert!(Contract::new((1, &slot(0.0)), (0, &slot(1.0))).is_some());
    }

    #[test]
    fn the_owner_holds_both_planes_until_it_hears_the_decision_on_that_number() {
        let (mut owner, mut follower) = pair(4.0);
        let mut counted = Decided::default();
        let old = owner.held();
        assert_eq!(old, Plane { normal: Vector3::x(), offset_m: 1.5 });
        // The follower has moved to 3; the owner hears it and proposes a plane at 1.5.
        owner.hear(&follower.message(1, 1, at(3.0)));
        owner.read(&at(0.0), &SIDE, 1, &mut counted);
        owner.propose(&at(0.0), &SIDE);
        let sent = owner.message(0, 1, at(0.0));
        assert_eq!((owner.held(), owner.pending(&SIDE).map(|plane| plane.offset_m)), (old, Some(1.0)));
        // No second proposal while one is pending, and a decision on another number has no effect.
        owner.propose(&at(0.2), &SIDE);
        assert_eq!(owner.message(0, 1, at(0.0)), sent);
        let mut stale = follower.message(1, 2, at(3.0));
        stale.decision = Some(Decision { number: 7, accepted: true });
        owner.hear(&stale);
        owner.read(&at(0.0), &SIDE, 2, &mut counted);
        assert_eq!((owner.held(), owner.pending(&SIDE).is_some()), (old, true));

        follower.hear(&sent);
        follower.read(&at(3.0), &SIDE, 2, &mut counted);
        assert_eq!(follower.held(), Plane { normal: -Vector3::x(), offset_m: -2.0 });
        // A copy that arrives again has no effect.
        follower.hear(&sent);
        follower.read(&at(9.0), &SIDE, 3, &mut counted);
        assert_eq!(counted, Decided { accepted: 1, refused: 0 });

        owner.hear(&follower.message(1, 3, at(3.0)));
        owner.read(&at(0.0), &SIDE, 4, &mut counted);
        assert_eq!((owner.held().offset_m, owner.pending(&SIDE), owner.age(6)), (1.0, None, 2));
    }

    #[test]
    fn a_follower_outside_refuses_and_the_owner_keeps_the_old_plane() {
        let (mut owner, mut follower) = pair(4.0);
        let mut counted = Decided::default();
        let (old, kept) = (owner.held(), follower.held());
        owner.propose(&at(0.5), &SIDE);
        follower.hear(&owner.message(0, 1, at(0.5)));
        // The follower is at 2.6: inside the old plane, outside the proposed one at 2.25 plus 0.5.
        follower.read(&at(2.6), &SIDE, 1, &mut counted);
        assert_eq!((counted, follower.held()), (Decided { accepted: 0, refused: 1 }, kept));
        owner.hear(&follower.message(1, 1, at(2.6)));
        owner.read(&at(0.5), &SIDE, 2, &mut counted);
        assert_eq!((owner.held(), owner.pending(&SIDE)), (old, None));
    }

    #[test]
    fn older_and_invalid_messages_are_ignored() {
        let (mut owner, follower) = pair(4.0);
        owner.hear(&follower.message(1, 5, at(3.0)));
        let heard = owner;
        owner.hear(&follower.message(1, 4, at(2.0)));
        owner.hear(&follower.message(1, 6, at(f64::NAN)));
        let divider = Divider { normal: [2.0, 0.0, 0.0], offset_m: 0.0 };
        let forged = Some(Proposal { number: 1, divider });
        owner.hear(&Message { proposal: forged, ..follower.message(1, 7, at(3.0)) });
        assert_eq!(owner, heard);
    }
}
