//! Vehicles that command nothing any more, or what they commanded last.

use nalgebra::Vector3;

use super::sensing::SAME_S;
use crate::scenario::{FailureKind, Scenario};
use crate::swarm::{Rows, row, set_row};

/// What becomes of the commands of vehicles of which a part fails.
#[derive(Clone, Debug)]
pub(super) struct Failing {
    all: Vec<Failed>,
}

#[derive(Clone, Debug)]
struct Failed {
    vehicle: usize,
    at_s: f64,
    /// Of one that keeps its command: nothing until it fails.
    keeps: Option<Option<Vector3<f64>>>,
}

impl Failing {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let failed = scenario.failures.iter().filter_map(|failure| {
            let keeps = match failure.kind {
                FailureKind::Dead {} => None,
                FailureKind::Frozen {} => Some(None),
                FailureKind::Silent {} | FailureKind::Rotor { .. } => return None,
            };
            Some(Failed { vehicle: failure.index(), at_s: failure.at_s, keeps })
        });
        Self { all: failed.collect() }
    }

    /// Changes the commands that are given at a time \[s\].
    pub(super) fn act(&mut self, time_s: f64, command: &mut Rows) {
        for failed in self.all.iter_mut().filter(|failed| time_s + SAME_S >= failed.at_s) {
            let kept = match &mut failed.keeps {
                None => Vector3::zeros(),
                Some(kept) => *kept.get_or_insert_with(|| row(command, failed.vehicle)),
            };
            set_row(command, failed.vehicle, kept);
        }
    }
}
