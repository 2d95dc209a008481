//! Targets of a swarm: timed legs of formations, the reference motion that moves them, and the present target.
//!
//! A [`Leg`] is a formation and the event that begins it. A [`Target`] is the view that a law has of the present leg. A
//! [`Supervisor`] reads the sensed states and may change the target; [`Schedule`] is the one that goes from leg to leg.

mod arrival;
mod course;
mod deadlock;
mod reference;
mod supervisor;

pub use arrival::{Arrival, FormationError};
pub use course::{LegHistory, reassign};
pub use deadlock::{Change, DeadlockMode, DeadlockOptions, SettlingMode};
pub use reference::{Guidance, Reference, ReferenceMotion, Spline};
pub use supervisor::{Schedule, Supervisor};

use nalgebra::{Rotation3, Vector3};

use crate::formation::Formation;
use tautline_core::swarm::{Rows, mean_row, row, set_row};

/// One formation of a run, the target until the next leg begins.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Slots of the leg.
    pub formation: Formation,
    /// Event that begins this leg and ends the previous one. Ignored for the first leg, which begins with the run.
    pub begins: LegTrigger,
    /// Whether any vehicle may go to any slot. A stalled swarm is then reassigned before its slots are spread.
    pub interchangeable: bool,
}

/// Event that begins a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LegTrigger {
    /// A time of the run \[s\].
    At(f64),
    /// Arrival at the previous leg, held for [`Arrival::hold_s`].
    Reached,
}

impl Leg {
    /// Creates the first leg of a run.
    #[must_use]
    pub fn first(formation: Formation) -> Self {
        Self { formation, begins: LegTrigger::At(0.0), interchangeable: false }
    }

    /// Returns the leg with its slots scaled by `scale` and rotated by `yaw_rad` (counterclockwise seen from above)
    /// about their centre, and then moved by `offset_m`.
    #[must_use]
    pub fn placed(mut self, scale: f64, yaw_rad: f64, offset_m: Vector3<f64>) -> Self {
        let slots_m = &mut self.formation.slots_m;
        let centre_m = mean_row(slots_m);
        let (sin, cos) = libm::sincos(yaw_rad);
        let turn = Rotation3::from_matrix_unchecked(nalgebra::matrix![cos, -sin, 0.0; sin, cos, 0.0; 0.0, 0.0, 1.0]);
        for i in 0..slots_m.nrows() {
            let from_centre_m = turn * (row(slots_m, i) - centre_m) * scale;
            set_row(slots_m, i, centre_m + from_centre_m + offset_m);
        }
        self
    }
}

/// Scales slots about the slot of a leader, or about their centre.
fn spread_slots(slots_m: &mut Rows, scale: f64, leader: Option<usize>) {
    if scale == 1.0 {
        return;
    }
    let fixed_m = leader.map_or_else(|| mean_row(slots_m), |leader| row(slots_m, leader));
    for i in (0..slots_m.nrows()).filter(|&i| Some(i) != leader) {
        let slot_m = fixed_m + (row(slots_m, i) - fixed_m) * scale;
        set_row(slots_m, i, slot_m);
    }
}

/// Target of the vehicles at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target<'a> {
    /// The leg, from 0.
    pub leg: usize,
    /// Counter that grows whenever a distance between two slots changes; 0 for the first leg as given.
    pub revision: u64,
    /// Slots h.
    pub formation: &'a Formation,
    /// Scale of the slots about their centre, or about a leader's slot; 1 for the leg as given.
    pub spread: f64,
    /// Reference motion r(t) that moves the formation.
    pub reference: Reference,
}

impl<'a> Target<'a> {
    /// Target of a formation at rest, as the first leg of a run.
    #[must_use]
    pub fn at_rest(formation: &'a Formation) -> Self {
        Self { leg: 0, revision: 0, formation, spread: 1.0, reference: Reference::at_rest() }
    }
}

/// Target of a run in progress. A [`Supervisor`] changes it, and a [`Target`] is a view of it.
#[derive(Clone, Debug, PartialEq)]
pub struct CurrentTarget {
    leg: usize,
    revision: u64,
    formation: Formation,
    spread: f64,
    reference: Reference,
}

impl CurrentTarget {
    /// Creates the target of the first of these legs; `None` without legs.
    #[must_use]
    pub fn first_of(legs: &[Leg]) -> Option<Self> {
        let formation = legs.first()?.formation.clone();
        Some(Self { leg: 0, revision: 0, formation, spread: 1.0, reference: Reference::at_rest() })
    }

    /// Returns the view that a law has.
    #[must_use]
    pub fn view(&self) -> Target<'_> {
        let &Self { leg, revision, ref formation, spread, reference } = self;
        Target { leg, revision, formation, spread, reference }
    }

    /// Goes on to another leg.
    pub fn begin(&mut self, leg: usize, formation: &Formation) {
        self.leg = leg;
        self.set_formation(formation);
    }

    /// Changes the slots within the leg.
    pub fn set_formation(&mut self, formation: &Formation) {
        self.spread_formation(formation, 1.0, None);
    }

    /// Sets the slots within the leg to these, scaled by `spread` about the slot of a leader, or about their centre.
    /// Allocates nothing if the number of slots stays the same.
    pub fn spread_formation(&mut self, formation: &Formation, spread: f64, leader: Option<usize>) {
        if self.formation.count() == formation.count() {
            self.formation.slots_m.copy_from(&formation.slots_m);
        } else {
            self.formation.clone_from(formation);
        }
        spread_slots(&mut self.formation.slots_m, spread, leader);
        self.spread = spread;
        self.revision += 1;
    }

    /// Moves the reference; slots keep their distances.
    pub fn set_reference(&mut self, reference: Reference) {
        self.reference = reference;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placing_a_leg_scales_rotates_and_then_moves_it() {
        let leg =
            Leg::first(Formation::line(2, 2.0)).placed(3.0, std::f64::consts::FRAC_PI_2, Vector3::new(10.0, 0.0, 5.0));
        let slots = &leg.formation.slots_m;
        let expected = [Vector3::new(11.0, -3.0, 5.0), Vector3::new(11.0, 3.0, 5.0)];
        for (i, slot) in expected.into_iter().enumerate() {
            assert!((row(slots, i) - slot).norm() < 1e-14, "{slots}");
        }
    }

    #[test]
    fn new_slots_raise_the_revision() {
        let legs = [Leg::first(Formation::line(2, 2.0)), Leg::first(Formation::line(2, 3.0))];
        let mut target = CurrentTarget::first_of(&legs).expect("legs");
        assert_eq!(target.view(), Target::at_rest(&legs[0].formation));
        target.set_reference(Reference { velocity_m_s: Vector3::x(), ..Reference::at_rest() });
        assert_eq!(target.view().revision, 0);
        target.begin(1, &legs[1].formation);
        assert_eq!((target.view().leg, target.view().revision, target.view().formation), (1, 1, &legs[1].formation));
        assert_eq!(CurrentTarget::first_of(&[]), None);
    }
}
