//! Deadlock recovery: reassigns interchangeable vehicles of a stalled swarm, or spreads its slots for a while so that
//! vehicles can pass each other.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{Arrival, CurrentTarget, Leg, Target, spread_slots};
use crate::formation::{Formation, Freedom};
use crate::formation::{optimal_slots, optimal_slots_around};
use tautline_core::swarm::{Rows, Swarm, mean_row, row};

/// Condition for spreading slots or reassigning interchangeable vehicles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DeadlockMode {
    /// When the swarm is stalled, under a law whose certificate can be computed again.
    #[default]
    Auto,
    /// From the start of every leg, and when the swarm is stalled.
    Start,
    /// Never.
    Off,
}

/// Spreading of slots.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DeadlockOptions {
    /// Condition for spreading slots.
    pub mode: DeadlockMode,
    /// First scale of the slots about their centre; each further time on a leg it is larger by one.
    #[schemars(extend("minimum" = 1))]
    pub scale: f64,
    /// Largest number of times that slots are spread on a leg, and of reassignments of a stalled swarm on it.
    pub most: u32,
    /// Shortest time for which spread slots are held in s.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(extend("minimum" = 0, "default" = 0.0))]
    pub hold_s: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(hold_s: &f64) -> bool {
    *hold_s == 0.0
}

impl Default for DeadlockOptions {
    fn default() -> Self {
        Self { mode: DeadlockMode::Auto, scale: 2.0, most: 8, hold_s: 0.0 }
    }
}

impl DeadlockOptions {
    /// Whether slots may be spread at all.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.mode != DeadlockMode::Off && self.most > 0
    }
}

/// Settling of position errors under a law without contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettlingMode {
    /// Rate of the slowest mode \[1/s\].
    pub rate_per_s: f64,
    /// Time in which the commanded acceleration brings a vehicle from rest to the speed of that mode \[s\].
    pub response_s: f64,
}

/// Change of the target within a leg by a [supervisor](super::Supervisor).
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// Slots are spread.
    Spread {
        /// Scale of the slots about their centre, or about a leader's slot.
        scale: f64,
    },
    /// Vehicles are reassigned to slots.
    Assigned {
        /// Vehicle i goes to the slot of vehicle `slots[i]`.
        slots: Vec<usize>,
    },
}

/// Progress threshold: a root mean square speed below this fraction of (error times rate of the slowest mode) is no
/// progress.
const PROGRESS: f64 = 0.2;
/// Time without progress that counts as a stall \[s\], unless twice the time in which the law brings vehicles from rest
/// to the threshold speed is longer.
const STALLED_S: f64 = 2.0;
/// Smallest error that justifies spreading, in units of the arrival limit.
const MIN_ERROR: f64 = 2.0;
/// Time without progress after which spread slots are given up \[s\].
const GIVEN_UP_S: f64 = 10.0;
/// Largest error at which spread slots are closed, as a fraction of the smallest slot distance.
const SETTLED: f64 = 0.25;
/// Time constant with which spread slots close \[s\].
const CLOSING_S: f64 = 2.0;
/// Excess scale below which the slots are those of the leg again.
const CLOSED: f64 = 0.01;

/// Phase of the recovery.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Slots are those of the leg; no progress since this time \[s\].
    Flying { idle_since_s: Option<f64> },
    /// Slots have been spread since `since_s`, without progress towards them since `idle_since_s` \[s\]. `slots_m` is
    /// the smallest distance of two slots of the leg \[m\].
    Spread { scale: f64, since_s: f64, idle_since_s: Option<f64>, slots_m: f64 },
    /// Slots have been closing since this time \[s\].
    Closing { scale: f64, since_s: f64 },
}

/// Spreads the slots of a leg when the swarm is stalled.
///
/// The swarm is stalled if for 2 s or more two conditions hold:
///
/// - some vehicle is more than twice the arrival limit from its slot;
/// - the root mean square speed is below 0.2 of the rate of the law's slowest mode times the root mean square error
///   ([`SettlingMode`]).
///
/// Slots are then scaled about their centre, or about a leader's slot. They are held at least for `hold_s`, until every
/// vehicle is within a quarter of the smallest slot distance of its slot or there is no progress for 10 s. They close
/// with a time constant of 2 s.
///
/// Interchangeable vehicles are first reassigned to the slots with the least sum of squared distances. Slots are spread
/// if the assignment is optimal already, or after `most` assignments on the leg.
#[derive(Clone, Debug)]
pub(super) struct DeadlockResolver {
    deadlock: DeadlockOptions,
    settling: SettlingMode,
    tolerance_m: f64,
    freedom: Freedom,
    leader: Option<usize>,
    phase: Phase,
    recoveries: u32,
    assignments: u32,
    /// Last change, until it is taken.
    change: Option<Change>,
}

/// Errors and speeds after removal of the motions that the formation is free to make.
struct Errors {
    rms_m: f64,
    max_m: f64,
    rms_m_s: f64,
}

impl Errors {
    fn of(swarm: &Swarm, target: &Target<'_>, freedom: Freedom) -> Self {
        let slots_m = &target.formation.slots_m;
        let (place_m, velocity_m_s) = match freedom {
            Freedom::Fixed => (target.reference.position_m, target.reference.velocity_m_s),
            _ => (mean_row(&swarm.positions_m) - mean_row(slots_m), swarm.mean_velocity_m_s()),
        };
        let (mut squares, mut largest, mut speeds) = (0.0, 0.0, 0.0);
        for i in 0..swarm.count() {
            let error = (row(&swarm.positions_m, i) - row(slots_m, i) - place_m).norm_squared();
            squares += error;
            largest = f64::max(largest, error);
            speeds += (row(&swarm.velocities_m_s, i) - velocity_m_s).norm_squared();
        }
        let count = swarm.count().max(1) as f64;
        Self { rms_m: (squares / count).sqrt(), max_m: largest.sqrt(), rms_m_s: (speeds / count).sqrt() }
    }
}

impl DeadlockResolver {
    pub(super) fn new(
        deadlock: DeadlockOptions,
        settling: SettlingMode,
        leader: Option<usize>,
        arrival: Arrival,
        freedom: Freedom,
    ) -> Self {
        let phase = Phase::Flying { idle_since_s: None };
        let tolerance_m = MIN_ERROR * arrival.edge_error_m;
        Self { deadlock, settling, tolerance_m, freedom, leader, phase, recoveries: 0, assignments: 0, change: None }
    }

    /// Removes the common position error of all vehicles from the errors.
    pub(super) fn ignore_common_errors(&mut self) {
        self.freedom = Freedom::Translation;
    }

    /// Resets the recovery at the beginning of a leg.
    pub(super) fn begin_leg(&mut self) {
        self.phase = Phase::Flying { idle_since_s: None };
        (self.recoveries, self.assignments) = (0, 0);
    }

    /// Whether slots are those of the leg.
    pub(super) fn is_closed(&self) -> bool {
        matches!(self.phase, Phase::Flying { .. })
    }

    /// Takes the last change.
    pub(super) fn take_change(&mut self) -> Option<Change> {
        self.change.take()
    }

    fn is_idle(&self, errors: &Errors) -> bool {
        errors.max_m > self.tolerance_m && errors.rms_m_s < PROGRESS * self.settling.rate_per_s * errors.rms_m
    }

    /// Returns the time without progress that counts as a stall \[s\].
    fn stalled_s(&self) -> f64 {
        STALLED_S.max(2.0 * PROGRESS * self.settling.response_s)
    }

    /// Spreads the slots of a leg, unless the limit of times is reached.
    fn spread(&mut self, since_s: f64, leg: &Leg, target: &mut CurrentTarget) {
        if self.recoveries >= self.deadlock.most {
            return;
        }
        let scale = self.deadlock.scale + f64::from(self.recoveries);
        self.recoveries += 1;
        self.change = Some(Change::Spread { scale });
        let slots_m = leg.formation.min_distance().map_or(f64::INFINITY, |(_, distance_m)| distance_m);
        self.phase = Phase::Spread { scale, since_s, idle_since_s: None, slots_m };
        target.spread_formation(&leg.formation, scale, self.leader);
    }

    /// Reassigns interchangeable vehicles. Returns false if no assignment is better or the limit of assignments is
    /// reached.
    fn assign(&mut self, sensed: &Swarm, leg: &Leg, target: &mut CurrentTarget) -> bool {
        if !leg.interchangeable || self.assignments >= self.deadlock.most {
            return false;
        }
        let Some(slots) = better_assignment(&sensed.positions_m, &leg.formation, self.leader) else { return false };
        self.assignments += 1;
        target.set_formation(&leg.formation.reordered(&slots));
        self.change = Some(Change::Assigned { slots });
        self.phase = Phase::Flying { idle_since_s: None };
        true
    }

    /// Checks the progress of the swarm to the slots of `leg`, and may spread them or reassign vehicles.
    pub(super) fn supervise(&mut self, time_s: f64, sensed: &Swarm, leg: &Leg, target: &mut CurrentTarget) {
        let errors = Errors::of(sensed, &target.view(), self.freedom);
        match self.phase {
            Phase::Flying { idle_since_s } => {
                let first = self.deadlock.mode == DeadlockMode::Start && self.recoveries == 0;
                let since_s = self.is_idle(&errors).then(|| idle_since_s.unwrap_or(time_s));
                self.phase = Phase::Flying { idle_since_s: since_s };
                let stalled = since_s.is_some_and(|since_s| time_s - since_s >= self.stalled_s());
                if first || (stalled && !self.assign(sensed, leg, target)) {
                    self.spread(time_s, leg, target);
                }
            }
            Phase::Spread { scale, since_s, idle_since_s, slots_m } => {
                let idle_since_s = self.is_idle(&errors).then(|| idle_since_s.unwrap_or(time_s));
                self.phase = Phase::Spread { scale, since_s, idle_since_s, slots_m };
                // Vehicles without progress towards spread slots are not blocked by each other.
                let gives_up = idle_since_s.is_some_and(|since_s| time_s - since_s >= GIVEN_UP_S.max(self.stalled_s()));
                let is_held = time_s - since_s >= self.deadlock.hold_s;
                if is_held && (errors.max_m < SETTLED * slots_m || gives_up) {
                    self.phase = Phase::Closing { scale, since_s: time_s };
                }
            }
            Phase::Closing { scale, since_s } => {
                let beyond = (scale - 1.0) * libm::exp((since_s - time_s) / CLOSING_S);
                if beyond < CLOSED {
                    self.phase = Phase::Flying { idle_since_s: None };
                    target.set_formation(&leg.formation);
                } else {
                    target.spread_formation(&leg.formation, 1.0 + beyond, self.leader);
                }
            }
        }
    }
}

/// Relative decrease of the sum of squared distances that justifies a new assignment.
const IMPROVEMENT: f64 = 1e-9;

/// Returns the assignment with the least sum of squared distances if it is better than the present one; a leader keeps
/// its slot. The result does not depend on a translation of the formation.
fn better_assignment(positions_m: &Rows, formation: &Formation, leader: Option<usize>) -> Option<Vec<usize>> {
    let found = match leader {
        Some(leader) => optimal_slots_around(positions_m, formation, leader)?,
        None => optimal_slots(positions_m, formation, Freedom::Fixed)?,
    };
    let count = positions_m.nrows();
    let free = || (0..count).filter(|&i| Some(i) != leader);
    let way = |i: usize, slot: usize| row(positions_m, i) - row(&formation.slots_m, slot);
    let mean_m = free().map(|i| way(i, i)).sum::<Vector3<f64>>() / free().count().max(1) as f64;
    let sum = |slot: &dyn Fn(usize) -> usize| free().map(|i| (way(i, slot(i)) - mean_m).norm_squared()).sum::<f64>();
    (sum(&|i| found[i]) < sum(&|i| i) * (1.0 - IMPROVEMENT)).then_some(found)
}

impl Leg {
    /// Returns the slots scaled about the slot of a leader, or about their centre.
    #[must_use]
    pub fn spread(&self, scale: f64, leader: Option<usize>) -> Formation {
        let mut formation = self.formation.clone();
        spread_slots(&mut formation.slots_m, scale, leader);
        formation
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTLING: SettlingMode = SettlingMode { rate_per_s: 1.0, response_s: 1.0 };
    const ARRIVAL: Arrival = Arrival { edge_error_m: 0.01, disagreement_m_s: 0.01, hold_s: 1.0 };

    /// Returns the spread at times 0, 0.5, 1, ... while vehicle 2 is at x = `off_m(time)` \[m\].
    fn spreads(deadlock: DeadlockOptions, off_m: impl Fn(f64) -> f64, steps: u32) -> Vec<f64> {
        let leg = Leg::first(Formation::line(2, 2.0));
        let mut target = CurrentTarget::first_of(std::slice::from_ref(&leg)).expect("a leg");
        let mut resolver = DeadlockResolver::new(deadlock, SETTLING, None, ARRIVAL, Freedom::Fixed);
        (0..steps)
            .map(|k| {
                let time_s = 0.5 * f64::from(k);
                let mut swarm = Swarm::at_rest(target.view().formation.slots_m.clone());
                swarm.positions_m[(1, 1)] = off_m(time_s);
                resolver.supervise(time_s, &swarm, &leg, &mut target);
                target.view().spread
            })
            .collect()
    }

    #[test]
    fn slots_spread_after_a_stall_and_close_again() {
        let found = spreads(DeadlockOptions::default(), |time_s| if time_s < 6.0 { 0.5 } else { 0.0 }, 40);
        assert_eq!(found[..13], [1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0]);
        // Settled at 6 s: from then on 1 + exp(-t/2), until it falls below 1.01.
        assert!((found[14] - (1.0 + libm::exp(-0.5))).abs() < 1e-15, "{found:?}");
        assert!(found[15..].windows(2).all(|pair| pair[1] <= pair[0]) && found[39] == 1.0);
    }

    #[test]
    fn spread_slots_are_held_for_the_given_time() {
        let deadlock = DeadlockOptions { hold_s: 9.0, ..DeadlockOptions::default() };
        let found = spreads(deadlock, |time_s| if time_s < 6.0 { 0.5 } else { 0.0 }, 60);
        // Spread at 2 s, settled at 6 s, held to 11 s.
        assert!(found[4..=22].iter().all(|&spread| spread == 2.0), "{found:?}");
        assert!((found[23] - (1.0 + libm::exp(-0.25))).abs() < 1e-15, "{found:?}");
    }

    #[test]
    fn slots_spread_further_each_time_up_to_the_limit() {
        let deadlock = DeadlockOptions { most: 2, ..DeadlockOptions::default() };
        // Settles whenever slots are spread, and has an error again when they are not.
        let leg = Leg::first(Formation::line(2, 2.0));
        let mut target = CurrentTarget::first_of(std::slice::from_ref(&leg)).expect("a leg");
        let mut resolver = DeadlockResolver::new(deadlock, SETTLING, None, ARRIVAL, Freedom::Translation);
        let mut begun = Vec::new();
        for k in 0..400 {
            let mut swarm = Swarm::at_rest(target.view().formation.slots_m.clone());
            swarm.positions_m[(1, 1)] += if resolver.is_closed() { 0.5 } else { 0.0 };
            resolver.supervise(0.5 * f64::from(k), &swarm, &leg, &mut target);
            begun.extend(resolver.take_change());
        }
        assert_eq!(begun, [2.0, 3.0].map(|scale| Change::Spread { scale }));
        assert_eq!(target.view().spread, 1.0);
    }

    #[test]
    fn slots_stay_on_arrival_or_with_mode_off_and_spread_with_mode_start() {
        assert!(spreads(DeadlockOptions::default(), |_| 0.02, 20).iter().all(|&spread| spread == 1.0), "near enough");
        let off = DeadlockOptions { mode: DeadlockMode::Off, most: 0, ..DeadlockOptions::default() };
        assert!(spreads(off, |_| 0.5, 20).iter().all(|&spread| spread == 1.0));
        let start = DeadlockOptions { mode: DeadlockMode::Start, ..DeadlockOptions::default() };
        assert_eq!(spreads(start, |_| 0.0, 1), [2.0]);
    }

    /// Returns the changes while the vehicles stand at these places along x.
    fn changes(leg: &Leg, leader: Option<usize>, at_m: [f64; 3]) -> Vec<Change> {
        let mut target = CurrentTarget::first_of(std::slice::from_ref(leg)).expect("a leg");
        let mut leg = leg.clone();
        let mut resolver = DeadlockResolver::new(DeadlockOptions::default(), SETTLING, leader, ARRIVAL, Freedom::Fixed);
        let mut swarm = Swarm::at_rest(leg.formation.slots_m.clone());
        (0..3).for_each(|i| swarm.positions_m[(i, 0)] = at_m[i]);
        let mut found = Vec::new();
        for k in 0..20 {
            resolver.supervise(0.5 * f64::from(k), &swarm, &leg, &mut target);
            if let Some(change) = resolver.take_change() {
                if let Change::Assigned { slots } = &change {
                    super::super::reassign(std::slice::from_mut(&mut leg), 0, slots);
                    assert_eq!(target.view().formation, &leg.formation);
                }
                found.push(change);
            }
        }
        found
    }

    #[test]
    fn interchangeable_vehicles_are_reassigned_before_slots_spread() {
        let given = Leg::first(Formation::line(3, 2.0));
        let leg = Leg { interchangeable: true, ..given.clone() };
        let assigned = |slots: [usize; 3]| Change::Assigned { slots: slots.to_vec() };
        let spread = [Change::Spread { scale: 2.0 }];
        // With vehicles in each other's slots, the assignment leaves no error.
        assert_eq!(changes(&leg, None, [4.0, 0.0, 2.0]), [assigned([2, 0, 1])]);
        assert_eq!(changes(&leg, None, [4.5, 0.5, 2.5]), [assigned([2, 0, 1]), spread[0].clone()]);
        assert_eq!(changes(&leg, None, [0.5, 2.5, 4.5]), spread, "nothing is shorter");
        assert_eq!(changes(&given, None, [4.0, 0.0, 2.0]), spread, "each has its own");
        // A leader keeps its slot, and the others share the remaining ones.
        assert_eq!(changes(&leg, Some(0), [0.0, 4.0, 2.0]), [assigned([0, 2, 1])]);
        assert_eq!(changes(&leg, Some(1), [2.0, 2.0, 2.0]), spread);
    }

    #[test]
    fn slots_are_spread_about_their_centre_or_a_leader() {
        let leg = Leg::first(Formation::line(3, 2.0));
        let along = |leader| {
            let slots_m = leg.spread(2.0, leader).slots_m;
            [slots_m[(0, 0)], slots_m[(1, 0)], slots_m[(2, 0)]]
        };
        assert_eq!((along(None), along(Some(2))), ([-2.0, 2.0, 6.0], [-4.0, 0.0, 4.0]));
    }
}
