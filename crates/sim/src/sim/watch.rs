//! What the target and the law's energy do from step to step.

use super::controller::Controller;
use crate::scenario::Scenario;
use tautline_core::record::{Breath, EnergyRise, Event, Reassignment};
use tautline_core::swarm::Swarm;
use tautline_laws::law::Certificate;
use tautline_laws::target::Change;

/// What the energy did since the target changed, the worst that it ever did, and the changes themselves.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    /// That of the target \[m^2/s^2\], by its revision.
    since: Option<(u64, f64)>,
    /// The rise that integration explains least. What rounding explains is the same for all of them.
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
        if self.worst.is_none_or(|worst| rise.unexplained() > worst.unexplained()) {
            self.worst = Some(rise);
        }
    }

    pub(super) fn worst(&self) -> Option<EnergyRise> {
        self.worst
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
        assert_eq!(watch.worst(), Some(EnergyRise { from: 2.0, to: 2.0 }), "it only fell");
        watch.take(2, Some(2.5));
        watch.take(2, Some(2.2));
        assert_eq!(watch.worst(), Some(EnergyRise { from: 2.0, to: 2.5 }));
    }

    #[test]
    fn a_ratio_of_next_to_nothing_does_not_hide_a_rise() {
        let mut watch = Watch::default();
        watch.take(0, Some(0.0));
        watch.take(0, Some(1e-3));
        assert_eq!(watch.worst(), Some(EnergyRise { from: 0.0, to: 1e-3 }));
        for (revision, energy) in [(1, 1e-16), (1, 1e-9), (2, 9.0), (2, 12.0), (3, 100.0), (3, 100.05)] {
            watch.take(revision, Some(energy));
        }
        assert_eq!(watch.worst(), Some(EnergyRise { from: 9.0, to: 12.0 }));
    }
}
