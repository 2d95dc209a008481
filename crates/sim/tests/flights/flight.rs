//! Helpers that read and fly scenarios and keep their recording in memory.

use std::ops::ControlFlow;

use tautline_core::record::{Event, OwnedSample, RecordError, Sample, Sink};
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::formation::Formation;
use tautline_laws::law::Law;
use tautline_sim::plant::{self, Plant};
use tautline_sim::scenario::{Override, PlantSpec, Scenario, Source};
use tautline_sim::sim::{self, Components, Flight, SimError};

/// Reads a built-in scenario with overrides.
pub(crate) fn builtin(name: &str, sets: &[&str]) -> Scenario {
    let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
    Scenario::read(&Source::Builtin(name.to_owned()), &overrides).unwrap_or_else(|error| panic!("{error}"))
}

/// Reads a scenario from its text.
pub(crate) fn read(toml: &str) -> Scenario {
    let source = Source::Text { name: "test".to_owned(), text: toml.to_owned() };
    Scenario::read(&source, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// Sink that keeps every sample and event.
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

/// Flies a scenario with its own law and plant.
pub(crate) fn fly(scenario: &Scenario) -> (Flight, Log) {
    let law = scenario.law().expect("the law of a valid scenario");
    let (flown, log) = fly_with(scenario, law, plant::of(scenario));
    (flown.expect("a flight"), log)
}

/// Flies a scenario with another law or plant.
pub(crate) fn fly_with(
    scenario: &Scenario,
    law: Box<dyn Law>,
    plant: Box<dyn Plant>,
) -> (Result<Flight, SimError>, Log) {
    let mut log = Log::default();
    let parts = Components { plant, ..Components::with_law(scenario, law) };
    let flown = sim::fly(scenario, parts, &mut log, &mut |_step| ControlFlow::Continue(()));
    (flown, log)
}

/// Returns a scenario of two vehicles on the x axis with these velocities \[m/s\], and a distant third one.
pub(crate) fn duel(x_m: [f64; 2], speeds_m_s: [f64; 2], delta_m: f64, dt_s: f64, duration_s: f64) -> Scenario {
    let mut start = Swarm::at_rest(Rows::from_row_slice(&[x_m[0], 0.0, 0.0, x_m[1], 0.0, 0.0, 0.0, 60.0, 0.0]));
    start.velocities_m_s[(0, 0)] = speeds_m_s[0];
    start.velocities_m_s[(1, 0)] = speeds_m_s[1];
    let slots = Rows::from_row_slice(&[0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 4.0, 0.0]);
    let mut scenario = Scenario::new("duel", start, Formation::points(slots), delta_m, duration_s);
    scenario.time.dt_s = dt_s;
    scenario.plant = PlantSpec::Rapier;
    scenario
}
