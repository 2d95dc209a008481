//! A recorded flight, ready to be drawn at any time of it.

pub(super) mod stretch;
mod tracks;

use std::path::Path;

use crate::formation::Formation;
use crate::graph::Graph;
use crate::law::EdgeTension;
use crate::law::{EdgeTensionKeys, LawSpec};
use crate::record::mcap::{Entry, McapRecording};
use crate::record::{Event, RecordError, Sample, Sink};
use crate::scenario::{Scenario, Source};
use crate::swarm::{ClosestApproach, Pair, Rows, separation};
use stretch::Stretch;
pub use tracks::TracksError;

/// Most memory that the instants of a flight take \[bytes\]; beyond it every second one is dropped.
pub const BUDGET_BYTES: usize = 256 << 20;
/// Most vehicles whose closest pair is sought anew at each instant that is drawn.
const SEARCHED_VEHICLES: usize = 2000;
/// Largest coordinate and radius that are drawn \[m\]: more than twice as far as the Moon. Pictures are made in single
/// precision, where fourth powers of lengths must have room.
pub const FARTHEST_M: f64 = 1e9;
/// Radius of a vehicle of which nothing is known \[m\].
const UNKNOWN_RADIUS_M: f64 = 0.1;
/// What a part of a position is called.
const COORDINATE: &str = "coordinate";

/// A flight in memory: instants in order of time, and what is known about it.
///
/// It is a [`Sink`] and can watch a flight as it is flown. What goes beyond [`BUDGET_BYTES`] is thinned: pictures are
/// then drawn from every second, fourth, ... sample and the last one; the closest approach stays that of all.
#[derive(Clone, Debug)]
pub struct Footage {
    /// What was flown.
    pub name: String,
    /// Names of the vehicles.
    pub vehicles: Vec<String>,
    /// Radius of each vehicle's hull \[m\].
    pub radius_m: Vec<f64>,
    /// Safety distance delta \[m\], where one is judged by.
    pub delta_m: Option<f64>,
    /// Formation and graph, where the flight has them.
    pub plan: Option<Plan>,
    /// What a person should know about how it was read, a sentence each.
    pub notes: Vec<String>,
    instants: Vec<Instant>,
    spans: Vec<Span>,
    closest: Option<ClosestApproach>,
    /// One in so many samples is kept.
    every: usize,
    /// Samples since the last one that stays.
    since_kept: usize,
    budget_bytes: usize,
}

/// Formation, graph and how hard an edge pulls.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The slots to be reached.
    pub formation: Formation,
    /// Who senses whom.
    pub graph: Graph,
    law: LawSpec,
    delta_m: f64,
}

/// A time at which every position is known.
#[derive(Clone, Debug)]
struct Instant {
    time_s: f64,
    positions_m: Rows,
    control_m_s2: Option<Rows>,
    /// Closest approach since the instant before.
    here: Option<ClosestApproach>,
    /// Closest approach since the start.
    so_far: Option<ClosestApproach>,
}

/// A time during which a pair was closer than delta.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// The pair.
    pub pair: Pair,
    /// When it began \[s\].
    pub from_s: f64,
    /// When it ended \[s\]; infinite while it lasts.
    pub to_s: f64,
}

/// A flight at a time of it.
#[derive(Clone, Debug)]
pub struct Moment {
    /// The time \[s\].
    pub time_s: f64,
    /// Positions \[m\], N x 3; NaN for a vehicle that is not there.
    pub positions_m: Rows,
    /// Commanded accelerations \[m/s^2\] at the last sample, where they were recorded.
    pub control_m_s2: Option<Rows>,
    /// The two nearest vehicles and their distance \[m\].
    pub nearest: Option<(Pair, f64)>,
    /// Closest approach up to this time.
    pub so_far: Option<ClosestApproach>,
    /// Closest approach between the instants around this time.
    around: Option<ClosestApproach>,
    /// The last instant at or before this time.
    pub(super) last: usize,
}

/// Why there is nothing to draw.
#[derive(Debug, thiserror::Error)]
pub enum FootageError {
    /// The recording cannot be read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A length is too large to be drawn.
    #[error(
        "vehicle {vehicle} has a {what} of {value_m:?} m at {time_s} s; what is beyond {FARTHEST_M:e} m cannot be drawn"
    )]
    TooFar {
        /// The vehicle.
        vehicle: String,
        /// Which of its lengths.
        what: &'static str,
        /// The length \[m\].
        value_m: f64,
        /// When \[s\].
        time_s: f64,
    },
    /// It holds no instant.
    #[error("{name} holds no samples, so there is nothing to draw")]
    Empty {
        /// The recording.
        name: String,
    },
}

impl FootageError {
    /// Refuses lengths that are too large to be drawn.
    fn check<'a>(
        lengths_m: impl IntoIterator<Item = &'a f64>,
        what: &'static str,
        time_s: f64,
        vehicle: impl FnOnce() -> String,
    ) -> Result<(), Self> {
        let too_far = lengths_m.into_iter().find(|length_m| length_m.abs() > FARTHEST_M);
        too_far.map_or(Ok(()), |&value_m| Err(Self::TooFar { vehicle: vehicle(), what, value_m, time_s }))
    }
}

impl Moment {
    /// Distance of a pair \[m\]; NaN where one of the two is not there.
    ///
    /// It is the recorded one where the closest approach was, and is nowhere below it: curves that are drawn as straight
    /// lines come nearer than they were flown.
    #[must_use]
    pub fn distance_m(&self, pair: Pair) -> f64 {
        let drawn_m = separation(&self.positions_m, pair.first(), pair.second());
        match self.around {
            Some(around) if around.pair == pair && around.time_s == self.time_s => around.separation_m,
            Some(around) if drawn_m < around.separation_m => around.separation_m,
            _ => drawn_m,
        }
    }
}

impl Plan {
    /// Formation, graph and law of a scenario.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self {
            formation: scenario.formation().clone(),
            graph: scenario.graph.clone(),
            law: scenario.law.clone(),
            delta_m: scenario.delta_m,
        }
    }

    /// How hard the edge between two vehicles pulls (above 0) or pushes (below 0) at a distance \[m\], from -1 to 1.
    ///
    /// For an edge tension it is V'(l) over its limit alpha/K, which is 1 far away and reaches -1 at
    /// `l = delta + K asinh(1/sqrt 2)`. Any other law is taken for a spring: the stretch over the desired distance.
    #[must_use]
    pub fn tension(&self, pair: Pair, distance_m: f64) -> f64 {
        let tension = match self.edge_tension(pair) {
            Some((alpha, edge)) => edge.derivative(distance_m) * edge.k_m() / alpha,
            None => self.stretch(pair, distance_m),
        };
        tension.clamp(-1.0, 1.0)
    }

    /// How hard the law accelerates a vehicle along its edge to another at a distance \[m\], in m/s^2: V'(l)/N, above 0
    /// where it pulls, below 0 where it pushes, minus infinity at or inside delta. None under a law without an edge tension.
    #[must_use]
    pub fn pull_m_s2(&self, pair: Pair, distance_m: f64) -> Option<f64> {
        let vehicles = self.formation.slots_m.nrows() as f64;
        self.edge_tension(pair).map(|(_, edge)| edge.derivative(distance_m) / vehicles)
    }

    /// How much longer a distance \[m\] is than the desired one, over that one.
    #[must_use]
    pub fn stretch(&self, pair: Pair, distance_m: f64) -> f64 {
        let rest_m = self.formation.desired_distance(pair.first(), pair.second());
        (distance_m - rest_m) / rest_m
    }

    /// Alpha \[m^2/s^2\] and the tension of an edge, where the law has one.
    fn edge_tension(&self, pair: Pair) -> Option<(f64, EdgeTension)> {
        let LawSpec::EdgeTension(EdgeTensionKeys { alpha }) = self.law else { return None };
        let rest_m = self.formation.desired_distance(pair.first(), pair.second());
        Some((alpha, EdgeTension::new(alpha, self.delta_m, rest_m).ok()?))
    }
}

impl Footage {
    /// No instants yet of a flight of this name by so many vehicles, numbered from 1.
    #[must_use]
    pub fn new(name: &str, vehicles: usize) -> Self {
        Self {
            name: name.to_owned(),
            vehicles: (1..=vehicles).map(|number| number.to_string()).collect(),
            radius_m: vec![UNKNOWN_RADIUS_M; vehicles],
            delta_m: None,
            plan: None,
            notes: Vec::new(),
            instants: Vec::new(),
            spans: Vec::new(),
            closest: None,
            every: 1,
            since_kept: 0,
            budget_bytes: BUDGET_BYTES,
        }
    }

    /// No instants yet of a flight of this scenario.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self {
            radius_m: scenario.hull_radius_m.clone(),
            delta_m: Some(scenario.delta_m),
            plan: Some(Plan::of(scenario)),
            ..Self::new(&scenario.name, scenario.count())
        }
    }

    /// Reads a recording of this program. Where its scenario cannot be understood, formation and graph are not known.
    ///
    /// # Errors
    /// [`FootageError`] when it cannot be read, holds no samples, or a vehicle is beyond [`FARTHEST_M`].
    pub fn read_mcap(path: &Path) -> Result<Self, FootageError> {
        let mut recording = McapRecording::open(path)?;
        let header = recording.header().clone();
        let source = Source::Text { name: header.scenario_name.clone(), text: header.scenario_toml.clone() };
        let mut footage = match Scenario::read(&source, &[]) {
            Ok(scenario) if scenario.count() == header.vehicles => Self::of(&scenario),
            _ => Self { delta_m: Some(header.delta_m), ..Self::new(&header.scenario_name, header.vehicles) },
        };
        for entry in recording.by_ref() {
            match entry? {
                Entry::Sample(sample) => {
                    footage.check(&sample.as_sample())?;
                    footage.take(&sample.as_sample());
                }
                Entry::Event(event) => footage.note(&event),
            }
        }
        if !recording.is_complete() {
            footage
                .notes
                .push("the recording was not closed: it is drawn up to the last part that was written".to_owned());
        }
        footage.complete(&path.display().to_string())
    }

    fn complete(self, name: &str) -> Result<Self, FootageError> {
        if self.instants.is_empty() { Err(FootageError::Empty { name: name.to_owned() }) } else { Ok(self) }
    }

    /// Number of vehicles N.
    #[must_use]
    pub fn count(&self) -> usize {
        self.vehicles.len()
    }

    /// Number of instants in memory.
    #[must_use]
    pub fn instants(&self) -> usize {
        self.instants.len()
    }

    /// One in so many samples is in memory.
    #[must_use]
    pub fn every(&self) -> usize {
        self.every
    }

    /// First and last time \[s\]; both 0 before there is one.
    #[must_use]
    pub fn range_s(&self) -> [f64; 2] {
        [self.instants.first(), self.instants.last()].map(|instant| instant.map_or(0.0, |instant| instant.time_s))
    }

    /// Closest approach of the whole flight.
    #[must_use]
    pub fn closest(&self) -> Option<ClosestApproach> {
        self.closest
    }

    /// Every time that a pair was closer than delta, in order of its beginning.
    #[must_use]
    pub fn violations(&self) -> &[Span] {
        &self.spans
    }

    /// When a pair came closest while it was closer than delta \[s\], as far as the samples tell.
    #[must_use]
    pub fn worst_s(&self, span: &Span) -> f64 {
        let recorded = self.instants.iter().filter_map(|instant| instant.here).filter(|here| here.pair == span.pair);
        let drawn = self.instants.iter().zip(self.instants.iter().skip(1)).filter_map(|(before, after)| {
            let stretch = Stretch {
                times_s: [before.time_s, after.time_s],
                positions_m: [&before.positions_m, &after.positions_m],
            };
            let approach = stretch.approach(span.pair)?;
            let least_m = after.here.map_or(0.0, |here| here.separation_m);
            Some(ClosestApproach { separation_m: approach.separation_m.max(least_m), ..approach })
        });
        let within = recorded.chain(drawn).filter(|approach| (span.from_s..=span.to_s).contains(&approach.time_s));
        let worst = within.min_by(|a, b| a.separation_m.total_cmp(&b.separation_m));
        worst.map_or(span.from_s, |worst| worst.time_s)
    }

    /// Times and positions in memory, in order.
    pub(super) fn positions(&self) -> impl ExactSizeIterator<Item = (f64, &Rows)> {
        self.instants.iter().map(|instant| (instant.time_s, &instant.positions_m))
    }

    /// Time \[s\] and positions \[m\] of an instant in memory.
    pub(super) fn instant(&self, k: usize) -> (f64, &Rows) {
        (self.instants[k].time_s, &self.instants[k].positions_m)
    }

    /// Times in memory \[s\], in order.
    pub fn times(&self) -> impl Iterator<Item = f64> + '_ {
        self.instants.iter().map(|instant| instant.time_s)
    }

    /// Times \[s\] and the separation \[m\] that was smallest since the time before.
    pub fn separations(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.instants.iter().filter_map(|instant| Some([instant.time_s, instant.here?.separation_m]))
    }

    /// The flight at a time \[s\], which is brought into its range; between two instants every vehicle moves on a straight
    /// line. None before there is an instant.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<Moment> {
        let [first_s, last_s] = self.range_s();
        let time_s = if time_s.is_nan() { first_s } else { time_s.clamp(first_s, last_s) };
        let last = self.instants.partition_point(|instant| instant.time_s <= time_s).checked_sub(1)?;
        let before = &self.instants[last];
        let mut positions_m = before.positions_m.clone();
        let (mut so_far, mut around) = (before.so_far, before.here);
        if let Some(after) = self.instants.get(last + 1).filter(|_| time_s > before.time_s) {
            let part = (time_s - before.time_s) / (after.time_s - before.time_s);
            positions_m.zip_apply(&after.positions_m, |here, there| *here += (there - *here) * part);
            so_far = nearer(so_far, after.here.filter(|approach| approach.time_s <= time_s));
            around = after.here;
        }
        let nearest = match around {
            Some(around) if around.time_s == time_s => Some(around.pair),
            _ => self.nearest(&positions_m, before.here.map(|approach| approach.pair)),
        };
        let control_m_s2 = before.control_m_s2.clone();
        let mut moment = Moment { time_s, positions_m, control_m_s2, nearest: None, so_far, around, last };
        moment.nearest = nearest.map(|pair| (pair, moment.distance_m(pair)));
        let now = moment.nearest.filter(|(_, distance_m)| distance_m.is_finite());
        moment.so_far = nearer(so_far, now.map(|(pair, separation_m)| ClosestApproach { pair, separation_m, time_s }));
        Some(moment)
    }

    /// The nearest two vehicles; of many vehicles the pair that was nearest just before.
    fn nearest(&self, positions_m: &Rows, recorded: Option<Pair>) -> Option<Pair> {
        let recorded = recorded.filter(|_| self.count() > SEARCHED_VEHICLES);
        recorded.or_else(|| tracks::nearest_present(positions_m).map(|(pair, _)| pair))
    }

    /// Whether both of a pair are vehicles of the flight: a file may say anything.
    fn has(&self, pair: Pair) -> bool {
        pair.second() < self.count()
    }

    /// Refuses a sample with a vehicle that is too far away to be drawn.
    pub(super) fn check(&self, sample: &Sample<'_>) -> Result<(), FootageError> {
        sample.swarm.positions_m.row_iter().enumerate().try_for_each(|(k, place)| {
            FootageError::check(place.iter(), COORDINATE, sample.time_s, || {
                self.vehicles.get(k).map_or_else(|| (k + 1).to_string(), Clone::clone)
            })
        })
    }

    /// Takes one sample, which must be later than the one before.
    pub fn take(&mut self, sample: &Sample<'_>) {
        self.push(Instant {
            time_s: sample.time_s,
            positions_m: sample.swarm.positions_m.clone(),
            control_m_s2: Some(sample.control.clone()),
            here: sample.separation.filter(|approach| self.has(approach.pair)),
            so_far: None,
        });
    }

    fn push(&mut self, mut instant: Instant) {
        self.closest = nearer(self.closest, instant.here);
        instant.so_far = self.closest;
        // The last instant is always there; it makes room for the next one unless its turn has come.
        if self.since_kept > 0
            && let Some(last) = self.instants.pop()
        {
            instant.here = nearer(last.here, instant.here);
        }
        self.since_kept = (self.since_kept + 1) % self.every;
        self.instants.push(instant);
        let bytes_each = self.count() * 6 * size_of::<f64>() + size_of::<Instant>();
        if self.instants.len() >= 16 && self.instants.len() * bytes_each > self.budget_bytes {
            self.thin();
        }
    }

    /// Drops every second instant, but neither the first nor the last.
    fn thin(&mut self) {
        let last = self.instants.len() - 1;
        let mut dropped = None;
        let mut k = 0;
        self.instants.retain_mut(|instant| {
            let keep = k % 2 == 0 || k == last;
            instant.here = nearer(dropped.take(), instant.here);
            if !keep {
                dropped = instant.here;
            }
            k += 1;
            keep
        });
        self.every *= 2;
        self.since_kept = if last.is_multiple_of(2) { 0 } else { self.every / 2 };
    }

    /// Takes one event.
    pub fn note(&mut self, event: &Event) {
        match *event {
            Event::ViolationBegan { pair, time_s } if self.has(pair) => {
                self.spans.push(Span { pair, from_s: time_s, to_s: f64::INFINITY });
            }
            Event::ViolationEnded { pair, time_s, .. } => {
                if let Some(span) = self.spans.iter_mut().rev().find(|span| span.pair == pair) {
                    span.to_s = time_s;
                }
            }
            _ => {}
        }
    }
}

impl Sink for Footage {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.take(sample);
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.note(event);
        Ok(())
    }
}

/// The nearer of two approaches, the earlier one among equals.
fn nearer(a: Option<ClosestApproach>, b: Option<ClosestApproach>) -> Option<ClosestApproach> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.separation_m < a.separation_m { b } else { a }),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests;
