//! What the target and the law's energy do from step to step.

use super::controller::Controller;
use crate::law::Certificate;
use crate::record::{Breath, EnergyRise, Event, Reassignment};
use crate::scenario::Scenario;
use crate::swarm::Swarm;
use crate::target::Change;

/// What the energy did since the target changed, the worst that it ever did, and the changes themselves.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    /// That of the target \[m^2/s^2\], by its revision.
    since: Option<(u64, f64)>,
    worst: Option<EnergyRise>,
    leg: usize,
    pub(super) breaths: Vec<Breath>,
    pub(super) assignments: Vec<Reassignment>,
}

impl Watch {
    /// Tells what the supervisor has changed at an instant, and renews what the law promised where it must.
    pub(super) fn look(
        &mut self,
        scenario: &Scenario,
        controller: &mut Controller,
        (time_s, state): (f64, &Swarm),
        certificate: &mut Certificate,
        events: &mut Vec<Event>,
    ) {
        let leg = controller.target.view().leg;
        events.extend((self.leg + 1..=leg).map(|leg| Event::LegBegan { leg, time_s }));
        self.leg = leg;
        let Some((change, promise)) = controller.change(time_s, state) else { return };
        certificate.renew(&scenario.as_far_as_told(promise), leg);
        let certified_m = certificate.certified_m;
        events.push(match change {
            Change::Spread { scale } => {
                self.breaths.push(Breath { time_s, scale, certified_m });
                Event::Breath { time_s, scale }
            }
            Change::Assigned { slots } => {
                let vehicles = slots.iter().enumerate().filter(|&(i, &slot)| i != slot).count();
                self.assignments.push(Reassignment { time_s, vehicles, certified_m });
                Event::Assigned { time_s, slots }
            }
        });
    }

    /// Takes the energy of the next instant, under the target of this revision.
    pub(super) fn take(&mut self, revision: u64, energy: Option<f64>) {
        let Some(energy) = energy else { return };
        let from = match self.since {
            Some((of, from)) if of == revision => from,
            _ => {
                self.since = Some((revision, energy));
                energy
            }
        };
        let rise = EnergyRise { from, to: energy };
        if self.worst.is_none_or(|worst| is_worse(rise, worst)) {
            self.worst = Some(rise);
        }
    }

    pub(super) fn worst(&self) -> Option<EnergyRise> {
        self.worst
    }
}

/// Whether the energy rose by a larger ratio; from nothing to anything is the largest of all, and more of it larger still.
fn is_worse(rise: EnergyRise, than: EnergyRise) -> bool {
    let from_nothing = |rise: EnergyRise| rise.from <= 0.0 && rise.to > 0.0;
    match (from_nothing(rise), from_nothing(than)) {
        (true, true) => rise.to > than.to,
        (one, other) if one != other => one,
        _ => rise.to * than.from > than.to * rise.from,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rise_is_told_within_a_target_and_not_from_one_to_the_next() {
        let mut watch = Watch::default();
        assert_eq!(watch.worst(), None);
        watch.take(0, None);
        for (revision, energy) in [(0, 4.0), (0, 3.0), (1, 9.0), (1, 8.0), (2, 2.0)] {
            watch.take(revision, Some(energy));
        }
        assert_eq!(watch.worst(), Some(EnergyRise { from: 4.0, to: 4.0 }));
        watch.take(2, Some(2.5));
        watch.take(2, Some(2.2));
        assert_eq!(watch.worst(), Some(EnergyRise { from: 2.0, to: 2.5 }));
    }

    #[test]
    fn what_rises_from_nothing_is_the_worst() {
        let mut watch = Watch::default();
        watch.take(0, Some(0.0));
        watch.take(0, Some(1e-3));
        watch.take(1, Some(1.0));
        watch.take(1, Some(5.0));
        assert_eq!(watch.worst(), Some(EnergyRise { from: 0.0, to: 1e-3 }));
    }
}
