//! Timeline of a recorded flight, which can be drawn at any time.

use std::path::Path;
use std::sync::Arc;

use crate::error::{RenderError, check_lengths};
use tautline_audit::{ObjectPair, Status, Violation};
use tautline_core::record::{Event, Sample};
use tautline_laws::space::Metric;
use tautline_recordings::mcap::{Entry, McapRecording, StoredAudit};
use tautline_report::drawing::{Rotors, UNKNOWN_RADIUS_M};
use tautline_report::flight_log::FlightLog;
use tautline_sim::plan::Plan;
use tautline_sim::scenario::{Scenario, Source};

mod tracks;

pub use tracks::TracksError;

/// Flight with everything that its pictures show: the log, and data that are constant over the flight.
#[derive(Clone, Debug)]
pub struct Timeline {
    /// Name of the flight.
    pub name: String,
    /// Names of the vehicles.
    pub vehicles: Vec<String>,
    /// Radius of each vehicle's hull \[m\].
    pub radius_m: Vec<f64>,
    /// Safety distance delta \[m\], if the flight is judged by one.
    pub delta_m: Option<f64>,
    /// Rotors of every vehicle, if the flight has a model.
    pub rotors: Option<Rotors>,
    /// Formation and graph, if the flight has them.
    pub plan: Option<Plan>,
    /// Notes on how the flight was read, one sentence each.
    pub notes: Vec<String>,
    /// Motion, closest approaches and violations.
    pub log: Arc<FlightLog>,
    /// Status of the whole flight, once it was judged to its end.
    pub(crate) status: Option<Status>,
    /// Time from which on the audit is undecided \[s\].
    pub(crate) undecided_s: Option<f64>,
    /// Whether the recording has a radius for every vehicle; without delta the radii are the limits.
    by_radii: bool,
    /// Whether the audit assumed straight lines between samples.
    pub(crate) assumes_straight: bool,
    /// Whether the audit refused the motion.
    refused: bool,
}

impl Timeline {
    /// Creates an empty flight with this name and number of vehicles, numbered from 1.
    #[must_use]
    pub fn new(name: &str, vehicles: usize) -> Self {
        Self {
            name: name.to_owned(),
            vehicles: (1..=vehicles).map(|number| number.to_string()).collect(),
            radius_m: vec![UNKNOWN_RADIUS_M; vehicles],
            delta_m: None,
            rotors: None,
            plan: None,
            notes: Vec::new(),
            log: Arc::default(),
            status: None,
            undecided_s: None,
            by_radii: false,
            assumes_straight: false,
            refused: false,
        }
    }

    /// Creates an empty flight of this scenario.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self::flown(scenario, Arc::new(FlightLog::of(scenario)))
    }

    /// Creates a flight of this scenario with its log.
    #[must_use]
    pub fn flown(scenario: &Scenario, log: Arc<FlightLog>) -> Self {
        let mut plan = Plan::of(scenario);
        log.targets().iter().for_each(|event| plan.note(event));
        Self {
            radius_m: scenario.hull_radius_m.clone(),
            delta_m: Some(scenario.delta_m),
            rotors: Rotors::of(scenario),
            plan: Some(plan),
            log,
            ..Self::new(&scenario.name, scenario.count())
        }
    }

    /// Returns the flight with the status of its audit, which the last picture shows.
    #[must_use]
    pub fn judged(self, status: Status) -> Self {
        Self { status: Some(status), ..self }
    }

    /// Reads a recording of this program. If its scenario cannot be read, formation and graph are unknown.
    ///
    /// The result may have no keyframes.
    ///
    /// # Errors
    /// [`RenderError`] if it cannot be read, or a vehicle is beyond [`FARTHEST_M`](crate::FARTHEST_M).
    pub fn read_mcap(path: &Path) -> Result<Self, RenderError> {
        let mut recording = McapRecording::open(path)?;
        let header = recording.header().clone();
        let source = Source::Text { name: header.scenario_name.clone(), text: header.scenario_toml.clone() };
        let mut timeline = match Scenario::read(&source, &[]) {
            Ok(scenario) if scenario.count() == header.vehicles => Self::of(&scenario),
            _ => Self {
                delta_m: Some(header.delta_m),
                log: Arc::new(FlightLog::new(Metric::default(), header.delta_m)),
                ..Self::new(&header.scenario_name, header.vehicles)
            },
        };
        for entry in recording.by_ref() {
            match entry? {
                Entry::Sample(sample) => timeline.take_checked(&sample.as_sample())?,
                Entry::Event(event) => timeline.note(&event),
            }
        }
        let stored = recording.stored_audit();
        if let StoredAudit::AsWritten(audit) = &stored {
            timeline.status = match audit.status.as_str() {
                "clear" => Some(Status::Clear),
                "violation" => Some(Status::Violation),
                _ => Some(Status::Undecided),
            };
        }
        if let StoredAudit::AsWritten(audit) = stored
            && let Some(closest) = audit.closest.iter().find(|approach| approach.other_vehicle > 0)
        {
            // The audit of ellipsoids counts in half axes, and its limit is 2. The log counts in units of delta.
            let scale = if audit.limit_m == header.delta_m { 1.0 } else { header.delta_m / audit.limit_m };
            Arc::make_mut(&mut timeline.log).conclude(closest.min_m * scale, closest.min_at_s);
        }
        if !recording.is_complete() {
            let note = "the recording was not closed: it is drawn up to its last complete part";
            timeline.notes.push(note.to_owned());
        }
        Ok(timeline)
    }

    /// Returns the number of vehicles N.
    #[must_use]
    pub fn count(&self) -> usize {
        self.vehicles.len()
    }

    /// Returns the radius around a vehicle that must stay empty \[m\]: half of delta, half of an ellipsoid's longer
    /// axis, or its own radius if that is larger.
    pub(crate) fn keep_out_m(&self, vehicle: usize) -> f64 {
        self.delta_m.map_or(0.0, |delta_m| self.log.metric().longest_m(delta_m) / 2.0).max(self.radius_m[vehicle])
    }

    /// Returns the violations of two vehicles that began by a time \[s\]; at the end of the flight all of them.
    pub(crate) fn violations_by(&self, time_s: f64) -> impl Iterator<Item = Violation> {
        let until_s = self.until_s(time_s);
        self.log.violations().of_vehicles().filter(move |violation| violation.from_s <= until_s)
    }

    /// Returns the violations of obstacles that began by a time \[s\], each with its vehicle and obstacle; at the end
    /// of the flight all of them.
    pub(crate) fn obstacle_violations_by(
        &self,
        time_s: f64,
    ) -> impl Iterator<Item = (&Violation<ObjectPair>, [usize; 2])> {
        let until_s = self.until_s(time_s);
        self.log.violations().of_obstacles().filter(move |(found, _)| found.from_s <= until_s)
    }

    /// Returns whether the flight has a violation so far.
    pub(crate) fn has_violations(&self) -> bool {
        !self.log.violations().all().is_empty()
    }

    fn until_s(&self, time_s: f64) -> f64 {
        if time_s < self.log.range_s()[1] { time_s } else { f64::INFINITY }
    }

    /// Returns the name of an obstacle in quotes, or its number if it is unknown.
    pub(crate) fn obstacle(&self, k: usize) -> String {
        let known = self.plan.as_ref().and_then(|plan| plan.obstacles.get(k));
        known.map_or_else(|| format!("obstacle {}", k + 1), |obstacle| format!("`{}`", obstacle.name))
    }

    /// Returns the reason why nothing is judged, if so.
    pub(crate) fn unjudged(&self) -> Option<&'static str> {
        match self.delta_m {
            None if !self.by_radii => Some("no delta"),
            _ if self.refused => Some("refused"),
            _ => None,
        }
    }

    /// Adds a sample, which must be later than the last one.
    pub fn take(&mut self, sample: &Sample<'_>) {
        Arc::make_mut(&mut self.log).take(sample);
    }

    /// Adds a sample, unless a vehicle is too far away to be drawn.
    pub(crate) fn take_checked(&mut self, sample: &Sample<'_>) -> Result<(), RenderError> {
        for (k, place) in sample.swarm.positions_m.row_iter().enumerate() {
            let name = || self.vehicles.get(k).map_or_else(|| (k + 1).to_string(), Clone::clone);
            check_lengths(place.iter(), "coordinate", sample.time_s, name)?;
        }
        self.take(sample);
        Ok(())
    }

    /// Adds an event of the audit.
    pub fn note(&mut self, event: &Event) {
        if let Some(plan) = &mut self.plan {
            plan.note(event);
        }
        Arc::make_mut(&mut self.log).note(event);
    }
}

#[cfg(test)]
mod tests;
