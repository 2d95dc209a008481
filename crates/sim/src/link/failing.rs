//! Vehicles that command nothing any more, or what they commanded last.

use nalgebra::Vector3;

use super::sensing::SAME_S;
use crate::scenario::{FailureKind, Scenario};
use tautline_core::swarm::{Rows, row, set_row};

/// What becomes of the commands of vehicles of which a part fails.
#[derive(Clone, Debug)]
pub(super) struct Failing {
    all: Vec<Failed>,
}

#[derive(Clone, Debug)]
struct Failed {
    vehicle: usize,
    at_s: f64,
    /// What it commands then \[m/s^2\]; not known yet of one that keeps its command.
    kept: Option<Vector3<f64>>,
}

impl Failing {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let failed = scenario.failures.iter().filter_map(|failure| {
            let kept = match failure.kind {
                FailureKind::Dead {} => Some(Vector3::zeros()),
                FailureKind::Frozen {} => None,
                FailureKind::Silent {} | FailureKind::Rotor { .. } => return None,
            };
            Some(Failed { vehicle: failure.index(), at_s: failure.at_s, kept })
        });
        Self { all: failed.collect() }
    }

    /// Changes the commands that are given at a time \[s\].
    pub(super) fn act(&mut self, time_s: f64, command: &mut Rows) {
        for failed in self.all.iter_mut().filter(|failed| time_s + SAME_S >= failed.at_s) {
            let kept = *failed.kept.get_or_insert_with(|| row(command, failed.vehicle));
            set_row(command, failed.vehicle, kept);
        }
    }
}
