//! Debug and release builds compute the same bits.

use std::fmt::Write as _;
use std::ops::ControlFlow;

use tautline_core::record::{Event, RecordError, Sample, Sink, StateHash, sha256_hex};
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::formation::Formation;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{self, Components};

/// Hash of the states, and separations and energies as text that keeps all bits.
#[derive(Default)]
struct Record {
    states: StateHash,
    others: String,
}

impl Sink for Record {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        let closest = sample.separation.map(|closest| (closest.separation_m, closest.time_s));
        // Writing to a string cannot fail.
        let _ = writeln!(self.others, "{} {closest:?} {:?}", sample.step, sample.energy);
        self.states.sample(sample)
    }

    fn event(&mut self, _event: &Event) -> Result<(), RecordError> {
        Ok(())
    }
}

/// Returns the hashes of the states, and of separations and energies.
fn hashes(scenario: &Scenario) -> [String; 2] {
    scenario.validate().expect("a valid scenario");
    let mut record = Record::default();
    let parts = Components::of(scenario).expect("a law");
    sim::fly(scenario, parts, &mut record, &mut |_| ControlFlow::Continue(())).expect("a flight");
    [record.states.finish(), sha256_hex(&record.others)]
}

/// The built-in scenario `pentagon`.
#[test]
fn the_pentagon_has_its_golden_bits() {
    let start = [[3.0, -0.05, 0.0], [9.0, -0.05, 0.0], [6.0, 0.05, 0.0], [0.0, 0.05, 0.0], [12.0, 0.05, 0.0]];
    let start = Swarm::at_rest(Rows::from_row_slice(start.as_flattened()));
    let mut pentagon = Scenario::new("pentagon", start, Formation::pentagon(3.0), 2.0, 120.0);
    pentagon.a22_per_s = 0.1;
    let golden = [
        "1ef867d816a4b35d28b03a15974b51e54e41794d8fda8a7d4904816baed91ae3",
        "bf07c1c6d11730270a28df3cd175b78fea174bc925c3fc2895b548d725b0e9b6",
    ];
    assert_eq!(hashes(&pentagon), golden);
}

/// Enough vehicles for law and audit to run concurrently if there are two threads.
#[test]
fn a_crowd_has_its_golden_bits() {
    let count = 520;
    let jitter = |i: usize, axis: usize| [0.02, 0.03, 0.0][axis] * ((7 * i + axis) % 11) as f64;
    let grid = Formation::grid(count, 3.0).slots_m;
    let start = Rows::from_fn(count, |i, axis| grid[(i, axis)] + jitter(i, axis));
    let mut crowd = Scenario::new("crowd", Swarm::at_rest(start), Formation::circle(count, 200.0), 2.0, 0.1);
    crowd.a22_per_s = 0.1;
    crowd.arrival.hold_s = 0.1;
    let golden = [
        "2b17cfe925afefe48acab15bf20cd8b97e6ec6b07dd2fcf9ad217d7c494be684",
        "b526fcb81af0a313acf01fab672b2b0115970dcf2de3af0cb452a46f06043c39",
    ];
    assert_eq!(hashes(&crowd), golden);
}
