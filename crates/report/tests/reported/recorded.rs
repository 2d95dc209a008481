//! A run hands its samples to the sink that it was given, and hashes the states that a simulation steps through.

use tautline_core::record::{Event, RecordError, Sample, Sink, StateHash};
use tautline_report::run::run;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{SimError, Simulation};

use crate::flight::{Log, builtin};

/// The hash of all samples, stepped one by one.
fn stepped(scenario: &Scenario) -> String {
    let (mut simulation, mut hash) = (Simulation::new(scenario).expect("a simulation"), StateHash::new());
    loop {
        if let Some(sample) = simulation.sample() {
            hash.observe(&sample);
        }
        if simulation.ending().is_some() {
            return hash.finish();
        }
        simulation.step();
    }
}

/// So many vehicles that samples are recorded in a thread of their own.
fn crowd() -> Scenario {
    builtin("thousand", &["time.duration_s=0.1", "arrival.hold_s=0.05"])
}

#[test]
fn a_run_has_the_bits_of_a_simulation_that_is_stepped_and_hands_over_all_samples() {
    for scenario in [builtin("pentagon", &["time.duration_s=3"]), crowd()] {
        let mut log = Log::default();
        let report = run(&scenario, &mut log).expect("a report");
        assert_eq!(report.run.state_hash, stepped(&scenario));
        let mut hash = StateHash::new();
        log.samples.iter().for_each(|sample| hash.observe(&sample.as_sample()));
        assert_eq!(report.run.state_hash, hash.finish());
    }
}

/// A sink that refuses.
struct Full;

impl Sink for Full {
    fn sample(&mut self, _: &Sample<'_>) -> Result<(), RecordError> {
        Err(RecordError::Write { path: "disk".to_owned(), source: std::io::Error::other("full") })
    }

    fn event(&mut self, _: &Event) -> Result<(), RecordError> {
        Ok(())
    }
}

#[test]
fn a_sink_that_cannot_keep_a_sample_ends_the_run_with_its_error() {
    for scenario in [builtin("pentagon", &["time.duration_s=1"]), crowd()] {
        assert!(matches!(run(&scenario, &mut Full), Err(SimError::Record(_))));
    }
}
