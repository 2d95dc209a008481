//! A run passes all samples to its sink, and its hash is that of a simulation that is stepped.

use tautline_core::record::{Event, RecordError, Sample, Sink, StateHash};
use tautline_report::run::run;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{SimError, Simulation};

use crate::flight::{Log, builtin};

/// Returns the hash of all samples of a simulation that is stepped.
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

/// Returns a scenario whose samples are recorded in a thread of their own.
fn crowd() -> Scenario {
    builtin("thousand", &["time.duration_s=0.1", "arrival.hold_s=0.05"])
}

#[test]
fn run_matches_a_stepped_simulation_and_passes_all_samples() {
    for scenario in [builtin("pentagon", &["time.duration_s=3"]), crowd()] {
        let mut log = Log::default();
        let report = run(&scenario, &mut log).expect("a report");
        assert_eq!(report.run.state_hash, stepped(&scenario));
        let mut hash = StateHash::new();
        log.samples.iter().for_each(|sample| hash.observe(&sample.as_sample()));
        assert_eq!(report.run.state_hash, hash.finish());
    }
}

/// A sink that rejects every sample.
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
fn error_of_the_sink_ends_the_run() {
    for scenario in [builtin("pentagon", &["time.duration_s=1"]), crowd()] {
        assert!(matches!(run(&scenario, &mut Full), Err(SimError::Record(_))));
    }
}
