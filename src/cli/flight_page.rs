//! The page on a flight that a program flies itself.

use super::{pictures, replays};
use crate::figures::RunHistory;
use crate::preflight::Preflight;
use crate::record::{Event, RecordError, Sample, Sink, Step};
use crate::replay::{Film, PAGE_BYTES};
use crate::report::{Report, RunPage};
use crate::scenario::Scenario;

/// Watches a flight for its page.
pub struct FlightWatch((RunHistory, Film));

impl FlightWatch {
    /// A watch of a flight of this scenario.
    #[must_use]
    pub fn new(scenario: &Scenario) -> Self {
        Self((RunHistory::new().scaled_by(scenario.metric()), Film::new()))
    }

    /// The page on the flight, which `command` flies again: with replay and figures, without pictures.
    #[must_use]
    pub fn page(&self, scenario: &Scenario, preflight: &Preflight, report: &Report, command: &str) -> String {
        let Self((history, film)) = self;
        let warnings = preflight.warnings.iter();
        let warnings: Vec<_> = warnings.map(|warning| (warning.code.name().to_owned(), warning.message.clone())).collect();
        let figures = pictures::figures(scenario, history, report);
        let replay = &replays::of_flight(scenario, film, report, PAGE_BYTES);
        report.to_html(&RunPage { scenario, warnings: &warnings, replay, figures: &figures, pictures: &[], command })
    }
}

impl Sink for FlightWatch {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.0.sample(sample)
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.0.event(event)
    }

    fn step(&mut self, step: &Step<'_>) {
        self.0.step(step);
    }

    fn looks_at_steps(&self) -> bool {
        self.0.looks_at_steps()
    }
}
