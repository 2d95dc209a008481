//! Legs of a run as flown: when each began, and the assignment of vehicles to slots.

use super::Leg;
use crate::formation::Formation;
use tautline_core::record::Event;

/// Legs with their start times and with the times of new assignments, as recorded in the events of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LegHistory {
    /// Start time \[s\] and index of each leg except the first.
    begun: Vec<(f64, usize)>,
    /// Time \[s\] from which each assignment holds, with the legs as assigned; the first holds from the start.
    assigned: Vec<(f64, Vec<Leg>)>,
}

impl LegHistory {
    /// Creates the course of a run through these legs.
    #[must_use]
    pub fn new(legs: &[Leg]) -> Self {
        Self { begun: Vec::new(), assigned: vec![(f64::NEG_INFINITY, legs.to_vec())] }
    }

    /// Records that a leg (from 0) began at a time \[s\]. Calls must be in order of time.
    pub fn begin(&mut self, leg: usize, time_s: f64) {
        self.begun.push((time_s, leg));
    }

    /// Records an assignment at a time \[s\]: on the present leg and the following ones, vehicle i goes to the slot of
    /// vehicle `slots[i]` ([`reassign`]). Calls must be in order of time. Ignores `slots` that are not a
    /// permutation.
    pub fn assign(&mut self, slots: &[usize], time_s: f64) {
        let leg = self.leg_at(time_s);
        let Some((_, legs)) = self.assigned.last() else { return };
        let mut legs = legs.clone();
        if reassign(&mut legs, leg, slots) {
            self.assigned.push((time_s, legs));
        }
    }

    /// Records an event if it is the start of a leg or an assignment.
    pub fn note(&mut self, event: &Event) {
        match event {
            &Event::LegBegan { leg, time_s } => self.begin(leg, time_s),
            Event::Assigned { slots, time_s } => self.assign(slots, *time_s),
            _ => {}
        }
    }

    /// Number of legs.
    #[must_use]
    pub fn count(&self) -> usize {
        self.assigned.first().map_or(0, |(_, legs)| legs.len())
    }

    /// Returns the leg at a time \[s\], from 0.
    #[must_use]
    pub fn leg_at(&self, time_s: f64) -> usize {
        let begun = self.begun[..self.begun.partition_point(|&(from_s, _)| from_s <= time_s)].last();
        begun.map_or(0, |&(_, leg)| leg).min(self.count().saturating_sub(1))
    }

    /// Returns the formations in order, as assigned, each with the time \[s\] from which it is the target; the first
    /// holds from the start.
    #[must_use]
    pub fn formations(&self) -> Vec<(f64, &Formation)> {
        let mut times_s: Vec<f64> = self.assigned.iter().map(|&(from_s, _)| from_s).collect();
        times_s.extend(self.begun.iter().map(|&(from_s, _)| from_s));
        times_s.sort_unstable_by(f64::total_cmp);
        times_s.dedup();
        times_s.into_iter().filter_map(|from_s| Some((from_s, self.formation_at(from_s)?))).collect()
    }

    /// Returns the slots of the leg at a time \[s\], as assigned then; `None` without legs.
    #[must_use]
    pub fn formation_at(&self, time_s: f64) -> Option<&Formation> {
        let assigned = self.assigned.partition_point(|&(from_s, _)| from_s <= time_s);
        let (_, legs) = self.assigned.get(assigned.checked_sub(1)?)?;
        legs.get(self.leg_at(time_s)).map(|leg| &leg.formation)
    }
}

/// Gives vehicle i the slot of vehicle `slots[i]` on a leg (from 0) and on the following legs, as long as vehicles are
/// interchangeable there. Returns false, and changes nothing, if `slots` is not a permutation of the vehicles.
pub fn reassign(legs: &mut [Leg], leg: usize, slots: &[usize]) -> bool {
    let count = legs.get(leg).map_or(0, |leg| leg.formation.count());
    let mut taken = vec![false; count];
    let is_order = slots.len() == count
        && slots.iter().all(|&slot| taken.get_mut(slot).is_some_and(|taken| !std::mem::replace(taken, true)));
    if is_order {
        let (under_way, later) = legs[leg..].split_at_mut(1);
        let follow = later.iter_mut().take_while(|leg| leg.interchangeable && leg.formation.count() == count);
        under_way.iter_mut().chain(follow).for_each(|leg| leg.formation = leg.formation.reordered(slots));
    }
    is_order
}

#[cfg(test)]
mod tests {
    use super::*;

    fn legs(interchangeable: [bool; 3]) -> Vec<Leg> {
        interchangeable.map(|interchangeable| Leg { interchangeable, ..Leg::first(Formation::line(3, 2.0)) }).to_vec()
    }

    /// Returns x of the slots at a time.
    fn slots(course: &LegHistory, time_s: f64) -> Vec<f64> {
        course.formation_at(time_s).expect("a leg").slots_m.column(0).iter().copied().collect()
    }

    #[test]
    fn a_leg_lasts_until_the_next_one_begins() {
        let mut course = LegHistory::new(&[legs([false; 3]), legs([false; 3])].concat());
        course.begin(1, 2.0);
        course.begin(2, 2.0);
        course.begin(3, 5.0);
        assert_eq!([0.0, 1.9, 2.0, 4.9, 5.0, 9.0].map(|time_s| course.leg_at(time_s)), [0, 0, 2, 2, 3, 3]);
        course.begin(9, 10.0);
        assert_eq!((course.leg_at(11.0), course.count()), (5, 6), "there is no tenth leg");
        assert_eq!(LegHistory::default().formation_at(0.0), None);
    }

    #[test]
    fn an_assignment_holds_for_following_interchangeable_legs() {
        let mut course = LegHistory::new(&legs([true, true, false]));
        let given = slots(&course, 0.0);
        course.assign(&[2, 0, 1], 3.0);
        assert_eq!(slots(&course, 2.9), given);
        let anew = [given[2], given[0], given[1]];
        assert_eq!(slots(&course, 3.0), anew);
        course.begin(1, 5.0);
        assert_eq!(slots(&course, 5.0), anew, "interchangeable there too");
        course.assign(&[1, 0, 2], 6.0);
        assert_eq!(slots(&course, 6.0), [anew[1], anew[0], anew[2]]);
        course.begin(2, 7.0);
        assert_eq!(slots(&course, 7.0), given, "given slots are those of the file");
    }

    #[test]
    fn an_invalid_permutation_changes_nothing() {
        for wrong in [&[0, 1][..], &[0, 1, 1], &[0, 1, 3], &[0, 1, 2, 0]] {
            let mut course = LegHistory::new(&legs([true; 3]));
            course.assign(wrong, 1.0);
            assert_eq!(course, LegHistory::new(&legs([true; 3])), "{wrong:?}");
        }
        assert!(!reassign(&mut [], 0, &[0]));
    }
}
