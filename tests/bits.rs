//! Every build flies the same bits: debug or release, the core alone or with everything.

use std::fmt::Write as _;
use std::ops::ControlFlow;

use tautline::formation::Formation;
use tautline::record::{Event, RecordError, Sample, Sink, StateHash, sha256_hex};
use tautline::scenario::Scenario;
use tautline::sim::{self, Parts};
use tautline::swarm::{Rows, Swarm};

/// The states, and separations and energies in words that read back to the same bits.
#[derive(Default)]
struct Everything {
    states: StateHash,
    others: String,
}

impl Sink for Everything {
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

/// Hashes of the states, and of separations and energies.
fn hashes(scenario: &Scenario) -> [String; 2] {
    scenario.validate().expect("a scenario that can be flown");
    let mut everything = Everything::default();
    let parts = Parts::of(scenario).expect("a law");
    sim::fly(scenario, parts, &mut everything, &mut |_| ControlFlow::Continue(())).expect("a flight");
    [everything.states.finish(), sha256_hex(&everything.others)]
}

/// `pentagon` as it is built in.
#[test]
fn the_pentagon_has_its_golden_bits() {
    let start = [[3.0, -0.05, 0.0], [9.0, -0.05, 0.0], [6.0, 0.05, 0.0], [0.0, 0.05, 0.0], [12.0, 0.05, 0.0]];
    let start = Swarm::at_rest(Rows::from_row_slice(start.as_flattened()));
    let mut pentagon = Scenario::new("pentagon", start, Formation::pentagon(3.0), 2.0, 120.0);
    pentagon.a22_per_s = 0.1;
    let golden = [
        "cb8600eeaf2d0bdf6cd1d145ef66db49c2f9082475d1cb470bc3ad9fb7f29241",
        "94c9d6c6d6d7680972e8b661409e572a7b317cd85912e9fa874378c567c2dd7a",
    ];
    assert_eq!(hashes(&pentagon), golden);
}

/// As many vehicles as it takes for law and audit to run side by side where there are two threads.
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
        "7ded5f55f0653343b2984df32e3b6708f150b32cafe005f80ece4f735bceab73",
        "e7b2327b0433eb1210ee42b545705cdcf6de322140e89169dcbd26c9110bdc05",
    ];
    assert_eq!(hashes(&crowd), golden);
}
