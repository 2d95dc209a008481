//! Findings on the shield of a scenario: its tube, the room of starts and slots, and warnings about slots.

use serde::Serialize;

use crate::scenario::Scenario;
use crate::shield::TrackingBasis;
use tautline_core::fact::Fact;
use tautline_core::text::{exact, separation, significant, up_to};
use tautline_shield::fleet::PairRoom;

/// Shield of a scenario, in SI units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShieldCheck {
    /// Certificate in words, with its assumptions.
    pub certificate: String,
    /// Facts that the certificate rests on.
    pub facts: Vec<Fact>,
    /// Bound on the distance of a vehicle to its reference \[m\].
    pub tube_m: f64,
    /// Bound on the feedback of the tracker \[m/s^2\].
    pub feedback_m_s2: f64,
    /// Largest acceleration left for the reference \[m/s^2\].
    pub reference_m_s2: f64,
    /// Deceleration of the brake \[m/s^2\].
    pub brake_m_s2: f64,
    /// Period of held commands \[s\].
    pub period_s: f64,
    /// Distance that the reserved segments of two vehicles must keep \[m\].
    pub required_m: f64,
    /// Pair of starts with the least room, counted from 1.
    pub start_pair: [usize; 2],
    /// Distance of their reserved segments beyond the required one \[m\].
    pub start_room_m: f64,
    /// Pair of slots with the least room, counted from 1.
    pub slot_pair: [usize; 2],
    /// Distance of these slots beyond the required one \[m\].
    pub slot_room_m: f64,
    /// Gap that vehicles keep by choice \[m\].
    pub ease_m: f64,
    #[serde(skip)]
    pub(super) basis: TrackingBasis,
}

impl ShieldCheck {
    /// Returns the findings; `None` without a shield, or for a scenario that is not valid.
    pub(super) fn of(scenario: &Scenario) -> Option<Self> {
        let limits = scenario.shield_limits().ok()??;
        let ((start, slot), basis) = (scenario.shield_rooms()?, scenario.tracking_basis()?);
        let numbers = |room: &PairRoom| [room.pair.0 + 1, room.pair.1 + 1];
        Some(Self {
            certificate: basis.certificate(&limits),
            facts: basis.facts(limits.tube().error_m),
            tube_m: limits.tube().error_m,
            feedback_m_s2: limits.tube().feedback_m_s2,
            reference_m_s2: limits.reference_m_s2(),
            brake_m_s2: limits.brake().deceleration_m_s2(),
            period_s: limits.settings().period_s,
            required_m: start.required_m,
            start_pair: numbers(&start),
            start_room_m: start.room_m(),
            slot_pair: numbers(&slot),
            slot_room_m: slot.room_m(),
            ease_m: limits.ease_m(),
            basis,
        })
    }

    /// Returns the separation \[m\] with the basis of the tracking error, a part of the headline.
    pub(super) fn brief(&self, certified_m: f64) -> String {
        let never = format!("never closer than {} m by the shield", exact(certified_m));
        match self.basis {
            TrackingBasis::Proved => format!("certified {never}"),
            TrackingBasis::Searched(flights) => {
                format!("certified {never} within a tracking error measured by a search of {flights} flights")
            }
            TrackingBasis::Assumed => {
                format!("{never} if the assumed tracking error of {} m holds", up_to(self.tube_m))
            }
        }
    }

    /// Returns the certificate and the worst pairs, one line.
    pub(super) fn line(&self) -> String {
        let [i, j] = self.start_pair;
        format!(
            "{}; reference acceleration up to {} m/s^2; starts of vehicles {i} and {j} have {} m of room",
            self.certificate,
            significant(self.reference_m_s2, 4),
            separation(self.start_room_m)
        )
    }

    /// Returns a warning about slots that vehicles never reach: the shield keeps them farther apart.
    pub(super) fn slots_too_near(&self) -> Option<String> {
        let [i, j] = self.slot_pair;
        (self.slot_room_m < 0.0).then(|| {
            format!(
                "The shield keeps vehicles {} m apart, and the slots of vehicles {i} and {j} are {} m closer: they \
                 are never reached. Enlarge the formation, or lower the errors that the shield assumes.",
                up_to(self.required_m),
                up_to(-self.slot_room_m)
            )
        })
    }

    /// Returns a warning about slots that vehicles may not reach, because they keep a gap by choice.
    pub(super) fn slots_within_ease(&self) -> Option<String> {
        let [i, j] = self.slot_pair;
        (0.0..self.ease_m).contains(&self.slot_room_m).then(|| {
            format!(
                "The slots of vehicles {i} and {j} leave {} m beyond what the shield requires, less than its ease of \
                 {} m: vehicles may wait near them. Enlarge the formation, or reduce shield.ease_m.",
                separation(self.slot_room_m),
                up_to(self.ease_m)
            )
        })
    }
}
