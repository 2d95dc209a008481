//! Supervisors: they change the target during a run.

use dyn_clone::DynClone;

use super::deadlock::{Change, DeadlockOptions, DeadlockResolver, SettlingMode};
use super::{Arrival, CurrentTarget, Leg, LegTrigger, Target, reassign};
use crate::formation::{Formation, Freedom};
use crate::graph::Graph;
use tautline_core::swarm::Swarm;

/// Reads the swarm as it is sensed and may change its target: from leg to leg, or within a leg.
///
/// Its memory is saved with a simulation, so it must be [`Clone`].
pub trait Supervisor: DynClone + Send {
    /// Reads the sensed states and may change the target. Called once per instant, before the law.
    fn supervise(&mut self, time_s: f64, sensed: &Swarm, target: &mut CurrentTarget);

    /// Whether the supervisor never changes the target; then it is not called.
    fn is_idle(&self) -> bool {
        false
    }

    /// Whether the supervisor goes through the formations of these legs in order, so that the certificate for them
    /// holds.
    fn follows_legs(&self, _legs: &[Leg]) -> bool {
        self.is_idle()
    }

    /// Takes the last change within a leg that invalidates the certificate, which is then computed again. Returns each
    /// change once.
    fn take_change(&mut self) -> Option<Change> {
        None
    }

    /// Returns the formations after the present target's.
    fn later_formations(&self, _target: &Target<'_>) -> Vec<&Formation> {
        Vec::new()
    }

    /// Restarts the random numbers of the supervisor.
    fn reseed(&mut self, _seed: u64) {}
}

dyn_clone::clone_trait_object!(Supervisor);

/// Goes from leg to leg by time, or when the previous leg has been reached and held. If the swarm is stalled, may
/// reassign interchangeable vehicles or spread the slots of a leg ([`DeadlockOptions`]).
#[derive(Clone, Debug)]
pub struct Schedule {
    legs: Vec<Leg>,
    links: Graph,
    arrival: Arrival,
    freedom: Freedom,
    /// Time since which the present leg has been within the limits \[s\].
    within_since_s: Option<f64>,
    resolver: Option<DeadlockResolver>,
    /// Last change, until it is taken.
    change: Option<Change>,
}

impl Schedule {
    /// Creates the schedule of these legs on a graph, at the first leg.
    #[must_use]
    pub fn new(legs: &[Leg], links: &Graph, arrival: Arrival) -> Self {
        Self {
            legs: legs.to_vec(),
            links: links.clone(),
            arrival,
            freedom: Freedom::RigidMotion,
            within_since_s: None,
            resolver: None,
            change: None,
        }
    }

    /// Sets the motions by which a reached formation may differ from its slots; any rigid motion by default.
    #[must_use]
    pub fn with_freedom(mut self, freedom: Freedom) -> Self {
        self.freedom = freedom;
        self
    }

    /// Enables deadlock recovery: spreads slots (about a leader's slot, if there is a leader) if the swarm is stalled.
    /// `settling` describes the law. Call after [`Schedule::with_freedom`].
    #[must_use]
    pub fn deadlock_recovery(
        mut self,
        deadlock: DeadlockOptions,
        settling: SettlingMode,
        leader: Option<usize>,
    ) -> Self {
        self.resolver =
            deadlock.is_on().then(|| DeadlockResolver::new(deadlock, settling, leader, self.arrival, self.freedom));
        self
    }

    /// Ignores the common position error of all vehicles in the detection of stalls if `is_blown`, because a wind keeps
    /// all vehicles off their slots. Call after [`Schedule::deadlock_recovery`].
    #[must_use]
    pub fn with_wind(mut self, is_blown: bool) -> Self {
        if let Some(resolver) = self.resolver.as_mut().filter(|_| is_blown) {
            resolver.ignore_common_errors();
        }
        self
    }

    fn is_due(&mut self, begins: LegTrigger, time_s: f64, sensed: &Swarm, target: &CurrentTarget) -> bool {
        match begins {
            LegTrigger::At(from_s) => time_s >= from_s,
            LegTrigger::Reached if self.resolver.as_ref().is_some_and(|resolver| !resolver.is_closed()) => false,
            LegTrigger::Reached => {
                let Target { formation, ref reference, .. } = target.view();
                let within = self.arrival.holds(sensed, formation, reference, &self.links, self.freedom);
                self.within_since_s = within.then(|| self.within_since_s.unwrap_or(time_s));
                self.within_since_s.is_some_and(|since_s| self.arrival.is_held(since_s, time_s))
            }
        }
    }
}

impl Supervisor for Schedule {
    fn supervise(&mut self, time_s: f64, sensed: &Swarm, target: &mut CurrentTarget) {
        while let Some(next) = self.legs.get(target.view().leg + 1) {
            let begins = next.begins;
            if !self.is_due(begins, time_s, sensed, target) {
                break;
            }
            let leg = target.view().leg + 1;
            target.begin(leg, &self.legs[leg].formation);
            self.within_since_s = None;
            if let Some(resolver) = &mut self.resolver {
                resolver.begin_leg();
            }
        }
        if let (Some(resolver), Some(leg)) = (&mut self.resolver, self.legs.get(target.view().leg)) {
            resolver.supervise(time_s, sensed, leg, target);
            if let Some(change) = resolver.take_change() {
                if let Change::Assigned { slots } = &change {
                    reassign(&mut self.legs, target.view().leg, slots);
                }
                self.change = Some(change);
            }
        }
    }

    fn is_idle(&self) -> bool {
        self.legs.len() < 2 && self.resolver.is_none()
    }

    fn follows_legs(&self, legs: &[Leg]) -> bool {
        self.is_idle() || self.legs == legs
    }

    fn take_change(&mut self) -> Option<Change> {
        self.change.take()
    }

    fn later_formations(&self, target: &Target<'_>) -> Vec<&Formation> {
        let from = if target.spread == 1.0 { target.leg + 1 } else { target.leg };
        self.legs.iter().skip(from).map(|leg| &leg.formation).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn legs(begins: [LegTrigger; 2]) -> Vec<Leg> {
        let leg = |spacing_m, begins| Leg { begins, ..Leg::first(Formation::line(2, spacing_m)) };
        vec![Leg::first(Formation::line(2, 1.0)), leg(2.0, begins[0]), leg(3.0, begins[1])]
    }

    /// Returns the leg at times 0, 0.5, 1, ... while the swarm is in the formation of leg `at(time)`.
    fn flown(legs: &[Leg], leg_at: impl Fn(f64) -> usize) -> Vec<usize> {
        let mut schedule = Schedule::new(legs, &Graph::complete(2), Arrival::default());
        let mut target = CurrentTarget::first_of(legs).expect("legs");
        (0..8)
            .map(|k| {
                let time_s = 0.5 * f64::from(k);
                let swarm = Swarm::at_rest(legs[leg_at(time_s)].formation.slots_m.clone());
                schedule.supervise(time_s, &swarm, &mut target);
                target.view().leg
            })
            .collect()
    }

    #[test]
    fn legs_begin_at_their_times_also_two_at_once() {
        assert_eq!(flown(&legs([LegTrigger::At(1.0), LegTrigger::At(2.5)]), |_| 0), [0, 0, 1, 1, 1, 2, 2, 2]);
        assert_eq!(flown(&legs([LegTrigger::At(1.0), LegTrigger::At(1.0)]), |_| 0), [0, 0, 2, 2, 2, 2, 2, 2]);
    }

    #[test]
    fn a_leg_ends_only_when_its_formation_is_held() {
        let legs = legs([LegTrigger::Reached, LegTrigger::Reached]);
        assert_eq!(flown(&legs, |time_s| usize::from(time_s > 1.0)), [0, 0, 1, 1, 1, 2, 2, 2]);
        assert_eq!(flown(&legs, |time_s| usize::from(time_s == 0.5)), [0, 0, 0, 0, 1, 1, 1, 1]);
    }
}
