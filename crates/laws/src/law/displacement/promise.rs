//! What the displacement law certifies.

use super::super::certificate::{Certificate, LegBound, Void};
use super::super::growth::Grown;
use super::DisplacementLaw;
use crate::formation::Formation;
use crate::observation::Observation;
use tautline_core::swarm::row;

impl DisplacementLaw {
    /// What the law promises from a state on, through these formations.
    pub(super) fn promise_through(&self, start: &Observation<'_>, ahead: &[&Formation]) -> Certificate {
        let energy = match self.try_energy(start) {
            Ok(energy) => energy,
            Err(fault) => return Certificate::void(Void::StartRefused(fault)),
        };
        let Grown { energy: most, until_s } = self.grown(energy, start, ahead);
        let legs = self.bounds(most, start.target.formation, ahead);
        let last = legs.last();
        let (certified_m, certified_room_m) =
            (last.and_then(|last| last.certified_m), last.and_then(|last| last.certified_room_m));
        let legs = if ahead.is_empty() { Vec::new() } else { legs };
        let closes_in = ahead.iter().any(|formation| self.rest_for(formation).1 < self.tension.rest_m());
        let promised = Certificate {
            certified_m,
            certified_until_s: until_s,
            certified_room_m,
            energy_initial: Some(energy),
            linked_m: None,
            void: Vec::new(),
            legs,
        }
        .void_where(closes_in, Void::TargetChanges);
        self.voids.iter().fold(promised, |promised, &void| promised.void_where(true, void))
    }

    /// What holds from a state of this energy on, and from each time that the slots become those of the next formation.
    fn bounds(&self, energy: f64, now: &Formation, ahead: &[&Formation]) -> Vec<LegBound> {
        let bound = |energy: f64| LegBound {
            energy,
            certified_m: self.has_pairs.then(|| self.tension.push_side_root(energy)),
            certified_room_m: self.clearance.map(|clearance| clearance.least_room_m(energy)),
        };
        let mut root = energy.sqrt();
        let mut bounds = vec![bound(energy)];
        for step in self.steps(now, ahead) {
            root += step;
            bounds.push(bound(root * root));
        }
        bounds
    }

    /// By how much sqrt E may grow where slots become those of the next formation \[m/s\].
    fn steps<'a>(&'a self, now: &'a Formation, ahead: &'a [&Formation]) -> impl Iterator<Item = f64> + 'a {
        std::iter::once(now)
            .chain(ahead.iter().copied())
            .zip(ahead)
            .map(|(before, next)| self.stretch(|i| row(&next.slots_m, i) - row(&before.slots_m, i)).sqrt())
    }

    /// The most that an energy becomes under the wind before the slots change: whatever it adds later it adds to more, and that
    /// is less. The promise ends where it could no longer be told from delta.
    fn grown(&self, energy: f64, start: &Observation<'_>, ahead: &[&Formation]) -> Grown {
        let Some(growth) = &self.growth else { return Grown { energy, until_s: None } };
        let borne = self.tension.value(self.delta_m + growth.resolution_m()).sqrt();
        let left = borne - self.steps(start.target.formation, ahead).sum::<f64>();
        growth.of(energy, start.time_s, left.max(0.0).powi(2))
    }
}
