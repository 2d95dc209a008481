//! Scenarios read and flown, with everything that was recorded kept in memory.

use std::ops::ControlFlow;

use tautline::law::Law;
use tautline::record::{Event, OwnedSample, RecordError, Sample, Sink};
use tautline::scenario::{Override, Scenario, Source};
use tautline::sim::{self, Flight, Motion, Parts, SimError};

/// A built-in scenario with some keys set.
pub(crate) fn builtin(name: &str, sets: &[&str]) -> Scenario {
    let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
    Scenario::read(&Source::Builtin(name.to_owned()), &overrides).unwrap_or_else(|error| panic!("{error}"))
}

/// A scenario of this text.
pub(crate) fn read(toml: &str) -> Scenario {
    let source = Source::Text { name: "test".to_owned(), text: toml.to_owned() };
    Scenario::read(&source, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// Keeps every sample and every event.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Log {
    pub(crate) samples: Vec<OwnedSample>,
    pub(crate) events: Vec<Event>,
}

impl Sink for Log {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.samples.push(sample.into());
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.events.push(event.clone());
        Ok(())
    }
}

/// Flies the scenario with its own law and plant.
pub(crate) fn fly(scenario: &Scenario) -> (Flight, Log) {
    let law = scenario.law().expect("the law of a valid scenario");
    let (flown, log) = fly_with(scenario, law, Motion::of(scenario));
    (flown.expect("a flight"), log)
}

/// Flies the scenario with another law or plant.
pub(crate) fn fly_with(
    scenario: &Scenario,
    law: Box<dyn Law>,
    motion: impl Into<Motion>,
) -> (Result<Flight, SimError>, Log) {
    let mut log = Log::default();
    let parts = Parts { motion: motion.into(), ..Parts::under(scenario, law) };
    let flown = sim::fly(scenario, parts, &mut log, &mut |_step| ControlFlow::Continue(()));
    (flown, log)
}
