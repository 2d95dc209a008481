//! The keyframes of a flight, as they are taken and as they are looked up.

use std::collections::BTreeMap;
use std::path::Path;

use super::frame::{Frame, Keyframe};
use super::interval::{Interval, nearest_present};
use super::plan::Plan;
use crate::record::mcap::{Entry, McapRecording};
use crate::record::{Event, RecordError, Sample, Sink};
use crate::render::error::{RenderError, check_lengths};
use crate::scenario::{Scenario, Source};
use crate::swarm::{ClosestApproach, Pair};

/// Most memory that the keyframes of a flight take \[bytes\]; beyond it every second one is dropped.
pub(super) const BUDGET_BYTES: usize = 256 << 20;
/// Most vehicles whose closest pair is sought anew for each frame.
const SEARCHED_VEHICLES: usize = 2000;
/// Radius of a vehicle of which nothing is known \[m\].
pub(super) const UNKNOWN_RADIUS_M: f64 = 0.1;

/// A flight in memory: keyframes in order of time, and what is known about it.
///
/// It is a [`Sink`] and can watch a flight as it is flown. What goes beyond 256 MiB is thinned: pictures are
/// then drawn from every second, fourth, ... sample and the last one; the closest approach stays that of all.
#[derive(Clone, Debug)]
pub struct Timeline {
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
    pub(super) keyframes: Vec<Keyframe>,
    pub(super) violations: Vec<ViolationSpan>,
    /// Index of the last violation of every pair that had one.
    pub(super) latest: BTreeMap<Pair, usize>,
    /// One in so many samples is kept.
    every: usize,
    /// Samples since the last one that stays.
    since_kept: usize,
    pub(super) budget_bytes: usize,
}

/// A time during which a pair was closer than delta.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViolationSpan {
    /// The pair.
    pub pair: Pair,
    /// When it began \[s\].
    pub from_s: f64,
    /// When it ended \[s\]; infinite while it lasts.
    pub to_s: f64,
}

impl Timeline {
    /// No keyframes yet of a flight of this name by so many vehicles, numbered from 1.
    #[must_use]
    pub fn new(name: &str, vehicles: usize) -> Self {
        Self {
            name: name.to_owned(),
            vehicles: (1..=vehicles).map(|number| number.to_string()).collect(),
            radius_m: vec![UNKNOWN_RADIUS_M; vehicles],
            delta_m: None,
            plan: None,
            notes: Vec::new(),
            keyframes: Vec::new(),
            violations: Vec::new(),
            latest: BTreeMap::new(),
            every: 1,
            since_kept: 0,
            budget_bytes: BUDGET_BYTES,
        }
    }

    /// No keyframes yet of a flight of this scenario.
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
    /// The result may be without keyframes.
    ///
    /// # Errors
    /// [`RenderError`] when it cannot be read, or a vehicle is beyond [`FARTHEST_M`](crate::render::FARTHEST_M).
    pub fn read_mcap(path: &Path) -> Result<Self, RenderError> {
        let mut recording = McapRecording::open(path)?;
        let header = recording.header().clone();
        let source = Source::Text { name: header.scenario_name.clone(), text: header.scenario_toml.clone() };
        let mut timeline = match Scenario::read(&source, &[]) {
            Ok(scenario) if scenario.count() == header.vehicles => Self::of(&scenario),
            _ => Self { delta_m: Some(header.delta_m), ..Self::new(&header.scenario_name, header.vehicles) },
        };
        for entry in recording.by_ref() {
            match entry? {
                Entry::Sample(sample) => timeline.take_checked(&sample.as_sample())?,
                Entry::Event(event) => timeline.note(&event),
            }
        }
        if !recording.is_complete() {
            let note = "the recording was not closed: it is drawn up to the last part that was written";
            timeline.notes.push(note.to_owned());
        }
        Ok(timeline)
    }

    /// Number of vehicles N.
    #[must_use]
    pub fn count(&self) -> usize {
        self.vehicles.len()
    }

    /// How far around a vehicle nothing may be: half of delta, or its own radius where that is more \[m\].
    pub(in crate::render) fn keep_out_m(&self, vehicle: usize) -> f64 {
        self.delta_m.map_or(0.0, |delta_m| delta_m / 2.0).max(self.radius_m[vehicle])
    }

    /// What is in memory, in order of time.
    #[must_use]
    pub fn keyframes(&self) -> &[Keyframe] {
        &self.keyframes
    }

    /// One in so many samples is in memory.
    #[must_use]
    pub fn every(&self) -> usize {
        self.every
    }

    /// First and last time \[s\]; both 0 before there is one.
    #[must_use]
    pub fn range_s(&self) -> [f64; 2] {
        [self.keyframes.first(), self.keyframes.last()].map(|keyframe| keyframe.map_or(0.0, |keyframe| keyframe.time_s))
    }

    /// Closest approach of the whole flight.
    #[must_use]
    pub fn closest(&self) -> Option<ClosestApproach> {
        self.keyframes.last().and_then(|last| last.so_far)
    }

    /// Every time that a pair was closer than delta, in order of its beginning.
    #[must_use]
    pub fn violations(&self) -> &[ViolationSpan] {
        &self.violations
    }

    /// When a pair came closest while it was closer than delta \[s\], as far as the samples tell.
    #[must_use]
    pub fn worst_s(&self, span: &ViolationSpan) -> f64 {
        let recorded = self.keyframes.iter().filter_map(|keyframe| keyframe.closest.filter(|at| at.pair == span.pair));
        let drawn = self.keyframes.windows(2).filter_map(|ends| {
            let approach = Interval::between(&ends[0], &ends[1]).approach(span.pair)?;
            let least_m = ends[1].closest.map_or(0.0, |closest| closest.separation_m);
            Some(ClosestApproach { separation_m: approach.separation_m.max(least_m), ..approach })
        });
        let within = recorded.chain(drawn).filter(|approach| (span.from_s..=span.to_s).contains(&approach.time_s));
        let worst = within.min_by(|a, b| a.separation_m.total_cmp(&b.separation_m));
        worst.map_or(span.from_s, |worst| worst.time_s)
    }

    /// The flight at a time \[s\], which is brought into its range; between two keyframes every vehicle moves on a straight
    /// line. None before there is a keyframe.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<Frame> {
        let [first_s, last_s] = self.range_s();
        let time_s = if time_s.is_nan() { first_s } else { time_s.clamp(first_s, last_s) };
        let keyframe = self.keyframes.partition_point(|keyframe| keyframe.time_s <= time_s).checked_sub(1)?;
        let before = &self.keyframes[keyframe];
        let mut positions_m = before.positions_m.clone();
        let (mut so_far, mut around) = (before.so_far, before.closest);
        if let Some(after) = self.keyframes.get(keyframe + 1).filter(|_| time_s > before.time_s) {
            let part = (time_s - before.time_s) / (after.time_s - before.time_s);
            positions_m.zip_apply(&after.positions_m, |here, there| *here += (there - *here) * part);
            so_far = nearer(so_far, after.closest.filter(|approach| approach.time_s <= time_s));
            around = after.closest;
        }
        // Of many vehicles the nearest pair is taken to be the one that was nearest just before.
        let pair = match (around, before.closest) {
            (Some(around), _) if around.time_s == time_s => Some(around.pair),
            (_, Some(before)) if self.count() > SEARCHED_VEHICLES => Some(before.pair),
            _ => nearest_present(&positions_m).map(|(pair, _)| pair),
        };
        let control_m_s2 = before.control_m_s2.clone();
        let mut frame = Frame { time_s, positions_m, control_m_s2, nearest: None, so_far, around, keyframe };
        frame.nearest = pair.map(|pair| (pair, frame.distance_m(pair)));
        let now = frame.nearest.filter(|(_, distance_m)| distance_m.is_finite());
        frame.so_far = nearer(so_far, now.map(|(pair, separation_m)| ClosestApproach { pair, separation_m, time_s }));
        Some(frame)
    }

    /// Takes one sample, which must be later than the one before.
    pub fn take(&mut self, sample: &Sample<'_>) {
        self.push(Keyframe {
            time_s: sample.time_s,
            positions_m: sample.swarm.positions_m.clone(),
            control_m_s2: Some(sample.control.clone()),
            closest: sample.separation.filter(|approach| self.has(approach.pair)),
            so_far: None,
        });
    }

    /// Takes one sample unless a vehicle of it is too far away to be drawn.
    pub(in crate::render) fn take_checked(&mut self, sample: &Sample<'_>) -> Result<(), RenderError> {
        for (k, place) in sample.swarm.positions_m.row_iter().enumerate() {
            let name = || self.vehicles.get(k).map_or_else(|| (k + 1).to_string(), Clone::clone);
            check_lengths(place.iter(), "coordinate", sample.time_s, name)?;
        }
        self.take(sample);
        Ok(())
    }

    /// Takes one event.
    pub fn note(&mut self, event: &Event) {
        match *event {
            Event::ViolationBegan { pair, time_s } if self.has(pair) => self.violated(pair, [time_s, f64::INFINITY]),
            Event::ViolationEnded { pair, time_s, .. } => {
                if let Some(&k) = self.latest.get(&pair) {
                    self.violations[k].to_s = time_s;
                }
            }
            _ => {}
        }
    }

    /// Takes a new violation.
    pub(super) fn violated(&mut self, pair: Pair, [from_s, to_s]: [f64; 2]) {
        self.latest.insert(pair, self.violations.len());
        self.violations.push(ViolationSpan { pair, from_s, to_s });
    }

    /// Whether both of a pair are vehicles of the flight: a file may say anything.
    fn has(&self, pair: Pair) -> bool {
        pair.second() < self.count()
    }

    pub(super) fn push(&mut self, mut keyframe: Keyframe) {
        keyframe.so_far = nearer(self.closest(), keyframe.closest);
        // The last keyframe is always there; it makes room for the next one unless its turn has come.
        if self.since_kept > 0
            && let Some(last) = self.keyframes.pop()
        {
            keyframe.closest = nearer(last.closest, keyframe.closest);
        }
        self.since_kept = (self.since_kept + 1) % self.every;
        self.keyframes.push(keyframe);
        let bytes_each = self.count() * 6 * size_of::<f64>() + size_of::<Keyframe>();
        if self.keyframes.len() >= 16 && self.keyframes.len() * bytes_each > self.budget_bytes {
            self.thin();
        }
    }

    /// Drops every second keyframe, but neither the first nor the last.
    fn thin(&mut self) {
        let last = self.keyframes.len() - 1;
        let mut dropped = None;
        let mut k = 0;
        self.keyframes.retain_mut(|keyframe| {
            let keep = k % 2 == 0 || k == last;
            keyframe.closest = nearer(dropped.take(), keyframe.closest);
            if !keep {
                dropped = keyframe.closest;
            }
            k += 1;
            keep
        });
        self.every *= 2;
        self.since_kept = if last.is_multiple_of(2) { 0 } else { self.every / 2 };
    }
}

impl Sink for Timeline {
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
pub(super) fn nearer(a: Option<ClosestApproach>, b: Option<ClosestApproach>) -> Option<ClosestApproach> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.separation_m < a.separation_m { b } else { a }),
        (a, b) => a.or(b),
    }
}
