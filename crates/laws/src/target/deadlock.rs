//! Deadlock recovery: a stalled swarm first reassigns the slots of interchangeable vehicles, then spreads its slots for a time.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{Arrival, CurrentTarget, Leg, Target, spread_slots};
use crate::formation::{Formation, Freedom};
use crate::formation::{optimal_slots, optimal_slots_around};
use tautline_core::swarm::{Rows, Swarm, mean_row, row};

/// When slots are spread, or interchangeable vehicles get others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DeadlockMode {
    /// When the swarm is stalled, under a law whose promise is renewed then.
    #[default]
    Auto,
    /// From the start of every leg, and when the swarm is stalled.
    Start,
    /// Never.
    Off,
}

/// How slots are spread.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DeadlockOptions {
    /// When.
    pub mode: DeadlockMode,
    /// By how much the first time, about their centre; each time by one more.
    #[schemars(extend("minimum" = 1))]
    pub scale: f64,
    /// How often on a leg, at most.
    pub most: u32,
    /// How long spread slots are held at least in s.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(extend("minimum" = 0, "default" = 0.0))]
    pub hold_s: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_zero(hold_s: &f64) -> bool {
    *hold_s == 0.0
}

impl Default for DeadlockOptions {
    fn default() -> Self {
        Self { mode: DeadlockMode::Auto, scale: 2.0, most: 8, hold_s: 0.0 }
    }
}

impl DeadlockOptions {
    /// Whether slots are spread at all.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.mode != DeadlockMode::Off && self.most > 0
    }
}

/// How errors of position settle under a law where nothing stands in their way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settling {
    /// Rate of the slowest mode \[1/s\].
    pub rate_per_s: f64,
    /// Time in which the commanded acceleration brings a vehicle from rest to the speed of that mode \[s\].
    pub response_s: f64,
}

/// What a [supervisor](super::Supervisor) changed within a leg.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// A deadlock recovery began: the slots are spread.
    Spread {
        /// They are scaled by this about their centre, or about a leader's slot.
        scale: f64,
    },
    /// Vehicles go to other slots.
    Assigned {
        /// Vehicle i goes to the slot that was vehicle `slots[i]`'s.
        slots: Vec<usize>,
    },
}

/// The root mean square speed below this part of the error times the rate of the law's slowest mode is no progress.
const SLOW: f64 = 0.2;
/// No progress for this long is a stall \[s\]; for twice as long as a law takes to bring vehicles from rest to that speed, where
/// that is longer.
const STALLED_S: f64 = 2.0;
/// Smallest error that starts a deadlock recovery, in multiples of the limit of arrival.
const WORTH: f64 = 2.0;
/// After so long without progress spread slots are given up \[s\].
const GIVEN_UP_S: f64 = 10.0;
/// Spread slots are held until no vehicle is farther from its own than this part of the distance of the slots.
const SETTLED: f64 = 0.25;
/// Slots then come together with this e-folding time \[s\].
const FOLDING_S: f64 = 2.0;
/// Spread by less than this they are those of the leg again.
const CLOSED: f64 = 0.01;

/// Phase of a deadlock recovery.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Slots are those of the leg; no progress has been made since this time \[s\].
    Flying { idle_since_s: Option<f64> },
    /// Slots are spread since the one time, and no progress towards them has been made since the other \[s\].
    Spread { scale: f64, since_s: f64, idle_since_s: Option<f64> },
    /// Slots come together since this time \[s\].
    Closing { scale: f64, since_s: f64 },
}

/// Spreads the slots of a leg when the swarm is stalled.
///
/// Stalled is a swarm whose vehicles are more than twice the limit of arrival from their slots and for 2 s or more move slower, root
/// mean square, than 0.2 of the rate of the law's slowest mode times their root mean square error ([`Settling`]). Slots are then scaled about their centre, or
/// about a leader's slot, held until every vehicle is within a quarter of the smallest slot distance of its own or no progress
/// is made for 10 s, but at least for `hold_s`, and come together with an e-folding time of 2 s.
///
/// Where vehicles are interchangeable, they are first given the slots with the shortest ways from where they are; slots are
/// spread where they have them already, or have been given others `most` times on the leg.
#[derive(Clone, Debug)]
pub(super) struct DeadlockResolver {
    deadlock: DeadlockOptions,
    settling: Settling,
    tolerance_m: f64,
    freedom: Freedom,
    leader: Option<usize>,
    phase: Phase,
    recoveries: u32,
    assignments: u32,
    /// Until it is taken.
    change: Option<Change>,
}

/// Errors and speeds relative to what the formation may be moved by.
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
        settling: Settling,
        leader: Option<usize>,
        arrival: Arrival,
        freedom: Freedom,
    ) -> Self {
        let phase = Phase::Flying { idle_since_s: None };
        let tolerance_m = WORTH * arrival.edge_error_m;
        Self { deadlock, settling, tolerance_m, freedom, leader, phase, recoveries: 0, assignments: 0, change: None }
    }

    /// Looks at errors apart from what all have in common.
    pub(super) fn forgive_common_errors(&mut self) {
        self.freedom = Freedom::Translation;
    }

    /// A leg has begun with its slots as they are given.
    pub(super) fn begin_leg(&mut self) {
        self.phase = Phase::Flying { idle_since_s: None };
        (self.recoveries, self.assignments) = (0, 0);
    }

    /// Whether slots are those of the leg.
    pub(super) fn is_closed(&self) -> bool {
        matches!(self.phase, Phase::Flying { .. })
    }

    /// What has been changed since this was taken.
    pub(super) fn take_change(&mut self) -> Option<Change> {
        self.change.take()
    }

    fn is_idle(&self, errors: &Errors) -> bool {
        errors.max_m > self.tolerance_m && errors.rms_m_s < SLOW * self.settling.rate_per_s * errors.rms_m
    }

    /// No progress for this long is a stall \[s\].
    fn stalled_s(&self) -> f64 {
        STALLED_S.max(2.0 * SLOW * self.settling.response_s)
    }

    /// Spreads the slots of a leg, once more.
    fn spread(&mut self, since_s: f64, leg: &Leg, target: &mut CurrentTarget) {
        if self.recoveries >= self.deadlock.most {
            return;
        }
        let scale = self.deadlock.scale + f64::from(self.recoveries);
        self.recoveries += 1;
        self.change = Some(Change::Spread { scale });
        self.phase = Phase::Spread { scale, since_s, idle_since_s: None };
        target.spread_formation(&leg.formation, scale, self.leader);
    }

    /// Gives interchangeable vehicles slots with shorter ways. Whether there are any.
    fn assign(&mut self, sensed: &Swarm, leg: &Leg, target: &mut CurrentTarget) -> bool {
        if !leg.interchangeable || self.assignments >= self.deadlock.most {
            return false;
        }
        let Some(slots) = shorter_ways(&sensed.positions_m, &leg.formation, self.leader) else { return false };
        self.assignments += 1;
        target.set_formation(&leg.formation.reordered(&slots));
        self.change = Some(Change::Assigned { slots });
        self.phase = Phase::Flying { idle_since_s: None };
        true
    }

    /// Looks at the swarm on its way to the slots of `leg` and may spread them, or give vehicles others.
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
            Phase::Spread { scale, since_s, idle_since_s } => {
                let slots_m = leg.formation.min_distance().map_or(f64::INFINITY, |(_, distance_m)| distance_m);
                let idle_since_s = self.is_idle(&errors).then(|| idle_since_s.unwrap_or(time_s));
                self.phase = Phase::Spread { scale, since_s, idle_since_s };
                // Those who come no nearer to spread slots either are not in each other's way.
                let gives_up = idle_since_s.is_some_and(|since_s| time_s - since_s >= GIVEN_UP_S.max(self.stalled_s()));
                let is_held = time_s - since_s >= self.deadlock.hold_s;
                if is_held && (errors.max_m < SETTLED * slots_m || gives_up) {
                    self.phase = Phase::Closing { scale, since_s: time_s };
                }
            }
            Phase::Closing { scale, since_s } => {
                let beyond = (scale - 1.0) * libm::exp((since_s - time_s) / FOLDING_S);
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

/// The sum of squared ways must become less by more than this part of it.
const SHORTER: f64 = 1e-9;

/// Whose slot each vehicle gets so that the sum of squared ways is least, where that is less than it is; a leader keeps its
/// own. Wherever the formation is moved to, the same ones are best.
fn shorter_ways(positions_m: &Rows, formation: &Formation, leader: Option<usize>) -> Option<Vec<usize>> {
    let found = match leader {
        Some(leader) => optimal_slots_around(positions_m, formation, leader)?,
        None => optimal_slots(positions_m, formation, Freedom::Fixed)?,
    };
    let count = positions_m.nrows();
    let free = || (0..count).filter(|&i| Some(i) != leader);
    let way = |i: usize, slot: usize| row(positions_m, i) - row(&formation.slots_m, slot);
    let mean_m = free().map(|i| way(i, i)).sum::<Vector3<f64>>() / free().count().max(1) as f64;
    let sum = |slot: &dyn Fn(usize) -> usize| free().map(|i| (way(i, slot(i)) - mean_m).norm_squared()).sum::<f64>();
    (sum(&|i| found[i]) < sum(&|i| i) * (1.0 - SHORTER)).then_some(found)
}

impl Leg {
    /// Its slots scaled about the slot of a leader, or about their centre.
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

    const SETTLING: Settling = Settling { rate_per_s: 1.0, response_s: 1.0 };
    const ARRIVAL: Arrival = Arrival { edge_error_m: 0.01, disagreement_m_s: 0.01, hold_s: 1.0 };

    /// The spread of the target at times 0, 0.5, 1, ... while vehicle 2 is `off(time)` m from its slot of the leg.
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
    fn a_stalled_swarm_spreads_its_slots_after_the_stall_time() {
        let found = spreads(DeadlockOptions::default(), |time_s| if time_s < 6.0 { 0.5 } else { 0.0 }, 40);
        assert_eq!(found[..13], [1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0]);
        // Settled at 6 s: from then on 1 + exp(-t/2), until that is 1.01.
        assert!((found[14] - (1.0 + libm::exp(-0.5))).abs() < 1e-15, "{found:?}");
        assert!(found[15..].windows(2).all(|pair| pair[1] <= pair[0]) && found[39] == 1.0);
    }

    #[test]
    fn spread_slots_are_held_as_long_as_is_asked_for() {
        let deadlock = DeadlockOptions { hold_s: 9.0, ..DeadlockOptions::default() };
        let found = spreads(deadlock, |time_s| if time_s < 6.0 { 0.5 } else { 0.0 }, 60);
        // Spread at 2 s, settled at 6 s, held to 11 s.
        assert!(found[4..=22].iter().all(|&spread| spread == 2.0), "{found:?}");
        assert!((found[23] - (1.0 + libm::exp(-0.25))).abs() < 1e-15, "{found:?}");
    }

    #[test]
    fn each_recovery_spreads_further_up_to_the_largest_number() {
        let deadlock = DeadlockOptions { most: 2, ..DeadlockOptions::default() };
        // Settles whenever slots are spread, and is off again when they are not.
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
    fn slots_are_spread_only_if_the_mode_and_the_errors_require_it() {
        assert!(spreads(DeadlockOptions::default(), |_| 0.02, 20).iter().all(|&spread| spread == 1.0), "near enough");
        let off = DeadlockOptions { mode: DeadlockMode::Off, most: 0, ..DeadlockOptions::default() };
        assert!(spreads(off, |_| 0.5, 20).iter().all(|&spread| spread == 1.0));
        let start = DeadlockOptions { mode: DeadlockMode::Start, ..DeadlockOptions::default() };
        assert_eq!(spreads(start, |_| 0.0, 1), [2.0]);
    }

    /// What is changed while vehicles stand so far from their first slots along x.
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
                    super::super::assign_anew(std::slice::from_mut(&mut leg), 0, slots);
                    assert_eq!(target.view().formation, &leg.formation);
                }
                found.push(change);
            }
        }
        found
    }

    #[test]
    fn interchangeable_vehicles_are_reassigned_before_slots_are_spread() {
        let given = Leg::first(Formation::line(3, 2.0));
        let leg = Leg { interchangeable: true, ..given.clone() };
        let assigned = |slots: [usize; 3]| Change::Assigned { slots: slots.to_vec() };
        let spread = [Change::Spread { scale: 2.0 }];
        // In the slots of others, and at rest there: then nobody is anywhere else.
        assert_eq!(changes(&leg, None, [4.0, 0.0, 2.0]), [assigned([2, 0, 1])]);
        assert_eq!(changes(&leg, None, [4.5, 0.5, 2.5]), [assigned([2, 0, 1]), spread[0].clone()]);
        assert_eq!(changes(&leg, None, [0.5, 2.5, 4.5]), spread, "nothing is shorter");
        assert_eq!(changes(&given, None, [4.0, 0.0, 2.0]), spread, "each has its own");
        // A leader keeps its slot, and the others share what is left.
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
