//! The keyframes of a flight, as they are taken and as they are looked up.

use std::collections::BTreeMap;
use std::path::Path;

use super::airframe::{Attitudes, QuadrotorShape, attitudes_of, between};
use super::frame::{Frame, Keyframe, nearest_present};
use super::obstacles::{AllTooNear, TooNear};
use crate::error::{RenderError, check_lengths};
use tautline_audit::Violation;
use tautline_core::record::{Event, RecordError, Sample, Sink};
use tautline_core::swarm::{ClosestApproach, Pair, Rows, row};
use tautline_laws::space::Metric;
use tautline_recordings::mcap::{Entry, McapRecording};
use tautline_sim::plan::Plan;
use tautline_sim::scenario::{Scenario, Source};

/// Violations that have a picture of their own, at most: their worst moments are never thinned out.
pub(crate) const PICTURED: usize = 10;
/// Most memory that the keyframes of a flight take \[bytes\]; beyond it every second one is dropped.
pub(super) const BUDGET_BYTES: usize = 256 << 20;
/// Most vehicles whose closest pair is sought anew for each frame.
const SEARCHED_VEHICLES: usize = 2000;
/// Radius of a vehicle of which nothing is known \[m\].
pub(super) const UNKNOWN_RADIUS_M: f64 = 0.1;

/// A flight in memory: keyframes in order of time, and what its judge says of it.
///
/// It is a [`Sink`] and can watch a flight as it is flown. What goes beyond 256 MiB is thinned: pictures are then drawn
/// from every second, fourth, ... sample, the last one, and those around the closest approach and the worst moments of
/// the first ten violations; the closest approach stays that of all.
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
    /// Where the rotors of every vehicle are, where the flight says it.
    pub shape: Option<QuadrotorShape>,
    /// The lengths that delta is one of: metres unless ellipsoids stay empty.
    pub metric: Metric,
    /// Formation and graph, where the flight has them.
    pub plan: Option<Plan>,
    /// What a person should know about how it was read, a sentence each.
    pub notes: Vec<String>,
    pub(super) keyframes: Vec<Keyframe>,
    pub(super) violations: Vec<Violation>,
    too_near: AllTooNear,
    /// Index of the violation of every pair that is in one.
    open: BTreeMap<Pair, usize>,
    /// When hulls hit first, whose, and how fast their centres neared each other \[m/s\].
    pub(crate) hit: Option<(f64, Pair, f64)>,
    /// From when on the judge cannot tell whether two were too close \[s\].
    pub(crate) undecided_s: Option<f64>,
    /// Every vehicle has a radius of its own in the recording, which is judged by where there is no delta.
    pub(super) by_radii: bool,
    /// What is judged was drawn straight between samples: nobody knows better.
    pub(crate) assumes_straight: bool,
    /// The judge refused the motion.
    pub(super) refused: bool,
    /// Times of the samples around the closest approach (0), and around the worst moment of the k-th violation (k).
    moments_s: BTreeMap<usize, [f64; 2]>,
    /// One in so many samples is kept.
    every: usize,
    /// Samples taken.
    taken: usize,
    pub(super) budget_bytes: usize,
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
            shape: None,
            metric: Metric::default(),
            plan: None,
            notes: Vec::new(),
            keyframes: Vec::new(),
            violations: Vec::new(),
            too_near: AllTooNear::default(),
            open: BTreeMap::new(),
            hit: None,
            undecided_s: None,
            by_radii: false,
            assumes_straight: false,
            refused: false,
            moments_s: BTreeMap::new(),
            every: 1,
            taken: 0,
            budget_bytes: BUDGET_BYTES,
        }
    }

    /// No keyframes yet of a flight of this scenario.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self {
            radius_m: scenario.hull_radius_m.clone(),
            delta_m: Some(scenario.delta_m),
            shape: QuadrotorShape::of(scenario),
            metric: scenario.metric(),
            plan: Some(Plan::of(scenario)),
            ..Self::new(&scenario.name, scenario.count())
        }
    }

    /// Reads a recording of this program. Where its scenario cannot be understood, formation and graph are not known.
    ///
    /// The result may be without keyframes.
    ///
    /// # Errors
    /// [`RenderError`] when it cannot be read, or a vehicle is beyond [`FARTHEST_M`](crate::FARTHEST_M).
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

    /// How far around a vehicle nothing may be: half of delta, half of an ellipsoid's longer axis, or its own radius where that is
    /// more \[m\].
    pub(crate) fn keep_out_m(&self, vehicle: usize) -> f64 {
        self.delta_m.map_or(0.0, |delta_m| self.metric.longest_m(delta_m) / 2.0).max(self.radius_m[vehicle])
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

    /// Every time that a pair was closer than it may come, by the judge, in order of its beginning. One that lasts still
    /// has no end (infinity).
    #[must_use]
    pub fn violations(&self) -> &[Violation] {
        &self.violations
    }

    /// The violations that have begun by a time \[s\]; at the end of the flight all of them.
    pub(crate) fn begun(&self, time_s: f64) -> impl Iterator<Item = &Violation> {
        let until_s = if time_s < self.range_s()[1] { time_s } else { f64::INFINITY };
        self.violations.iter().filter(move |violation| violation.from_s <= until_s)
    }

    /// Every time that a vehicle was nearer to an obstacle than its clearance, in order of its beginning.
    #[must_use]
    pub fn too_near(&self) -> &[TooNear] {
        &self.too_near.0
    }

    /// Those that have begun by a time \[s\]; at the end of the flight all of them.
    pub(crate) fn too_near_by(&self, time_s: f64) -> impl Iterator<Item = &TooNear> {
        let until_s = if time_s < self.range_s()[1] { time_s } else { f64::INFINITY };
        self.too_near().iter().filter(move |near| near.from_s <= until_s)
    }

    /// Name of an obstacle, in quotes; its number where it is not known.
    pub(crate) fn obstacle(&self, k: usize) -> String {
        let known = self.plan.as_ref().and_then(|plan| plan.obstacles.get(k));
        known.map_or_else(|| format!("obstacle {}", k + 1), |obstacle| format!("`{}`", obstacle.name))
    }

    /// Why nothing is judged, where that is so.
    pub(crate) fn unjudged(&self) -> Option<&'static str> {
        match self.delta_m {
            None if !self.by_radii => Some("no delta"),
            _ if self.refused => Some("refused"),
            _ => None,
        }
    }

    /// The flight at a time \[s\], which is brought into its range; between two keyframes every vehicle moves on a straight
    /// line. None before there is a keyframe.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<Frame> {
        let [first_s, last_s] = self.range_s();
        let time_s = if time_s.is_nan() { first_s } else { time_s.clamp(first_s, last_s) };
        let positions_m = self.positions_m(time_s)?;
        let keyframe = self.keyframes.partition_point(|keyframe| keyframe.time_s <= time_s).checked_sub(1)?;
        let before = &self.keyframes[keyframe];
        let (mut so_far, mut around) = (before.so_far, before.closest);
        if let Some(after) = self.keyframes.get(keyframe + 1).filter(|_| time_s > before.time_s) {
            so_far = nearer(so_far, after.closest.filter(|approach| approach.time_s <= time_s));
            around = after.closest;
        }
        // Of many vehicles the nearest pair is taken to be the one that was nearest just before.
        let pair = match (around, before.closest) {
            (Some(around), _) if around.time_s == time_s => Some(around.pair),
            (_, Some(before)) if self.count() > SEARCHED_VEHICLES => Some(before.pair),
            _ => nearest_present(&positions_m, self.metric),
        };
        let control_m_s2 = before.control_m_s2.clone();
        let (attitudes, metric, nearest) = (self.attitudes(time_s, keyframe), self.metric, None);
        let mut frame =
            Frame { time_s, positions_m, attitudes, control_m_s2, metric, nearest, so_far, around, keyframe };
        frame.nearest = pair.map(|pair| (pair, frame.distance_m(pair)));
        let now = frame.nearest.filter(|(_, distance_m)| distance_m.is_finite());
        frame.so_far = nearer(so_far, now.map(|(pair, separation_m)| ClosestApproach { pair, separation_m, time_s }));
        Some(frame)
    }

    /// Where the vehicles are at a time \[s\] that is not before the first keyframe: N x 3 \[m\].
    pub(crate) fn positions_m(&self, time_s: f64) -> Option<Rows> {
        let next = self.keyframes.partition_point(|keyframe| keyframe.time_s <= time_s);
        let before = &self.keyframes[next.checked_sub(1)?];
        let mut positions_m = before.positions_m.clone();
        if let Some(after) = self.keyframes.get(next).filter(|_| time_s > before.time_s) {
            let part = (time_s - before.time_s) / (after.time_s - before.time_s);
            positions_m.zip_apply(&after.positions_m, |here, there| *here += (there - *here) * part);
        }
        Some(positions_m)
    }

    /// How the vehicles stand in space at a time \[s\] that is not before this keyframe and before the next.
    fn attitudes(&self, time_s: f64, keyframe: usize) -> Attitudes {
        let before = &self.keyframes[keyframe];
        match self.keyframes.get(keyframe + 1) {
            Some(after) if time_s > before.time_s => {
                let part = (time_s - before.time_s) / (after.time_s - before.time_s);
                between(&before.attitudes, &after.attitudes, part)
            }
            _ => before.attitudes.clone(),
        }
    }

    /// Takes one sample, which must be later than the one before.
    pub fn take(&mut self, sample: &Sample<'_>) {
        self.push(Keyframe {
            time_s: sample.time_s,
            positions_m: sample.swarm.positions_m.clone(),
            attitudes: attitudes_of(sample),
            control_m_s2: Some(sample.control.clone()),
            closest: sample.separation.filter(|approach| self.has(approach.pair)),
            so_far: None,
            number: 0,
        });
    }

    /// Takes one sample unless a vehicle of it is too far away to be drawn.
    pub(crate) fn take_checked(&mut self, sample: &Sample<'_>) -> Result<(), RenderError> {
        for (k, place) in sample.swarm.positions_m.row_iter().enumerate() {
            let name = || self.vehicles.get(k).map_or_else(|| (k + 1).to_string(), Clone::clone);
            check_lengths(place.iter(), "coordinate", sample.time_s, name)?;
        }
        self.take(sample);
        Ok(())
    }

    /// Takes one event of the judge of the flight.
    pub fn note(&mut self, event: &Event) {
        if let Some(plan) = &mut self.plan {
            plan.note(event);
        }
        self.too_near.note(event, self.vehicles.len());
        match *event {
            Event::ViolationBegan { pair, time_s } if self.has(pair) => {
                self.open.insert(pair, self.violations.len());
                let (limit_m, min_m) = (self.delta_m.unwrap_or(f64::NAN), f64::INFINITY);
                let (from_s, to_s, min_at_s) = (time_s, f64::INFINITY, time_s);
                self.violations.push(Violation { pair, from_s, to_s, min_m, min_at_s, limit_m });
            }
            Event::Approach { pair, time_s, separation_m } => {
                if let Some(&k) = self.open.get(&pair) {
                    (self.violations[k].min_m, self.violations[k].min_at_s) = (separation_m, time_s);
                }
            }
            Event::ViolationEnded { pair, time_s, min_m } => {
                if let Some(k) = self.open.remove(&pair) {
                    let violation = &mut self.violations[k];
                    if violation.min_m.is_infinite() {
                        // It was between two samples, and another pair was nearer.
                        violation.min_at_s = f64::midpoint(violation.from_s, time_s);
                    }
                    (violation.to_s, violation.min_m) = (time_s, min_m);
                }
            }
            Event::HullsHit { pair, time_s, closing_m_s } if self.has(pair) => {
                self.hit = self.hit.or(Some((time_s, pair, closing_m_s)));
            }
            _ => {}
        }
    }

    /// Whether both of a pair are vehicles of the flight: a file may say anything.
    fn has(&self, pair: Pair) -> bool {
        pair.second() < self.count()
    }

    pub(super) fn push(&mut self, mut keyframe: Keyframe) {
        let (time_s, closest) = (keyframe.time_s, self.closest());
        (keyframe.number, keyframe.so_far) = (self.taken, nearer(closest, keyframe.closest));
        self.taken += 1;
        let around_s = [self.keyframes.last().map_or(time_s, |last| last.time_s), time_s];
        if keyframe.so_far != closest {
            self.moments_s.insert(0, around_s);
        }
        for (&pair, &k) in &self.open {
            let violation = &mut self.violations[k];
            let apart_m = row(&keyframe.positions_m, pair.second()) - row(&keyframe.positions_m, pair.first());
            let separation_m = self.metric.scaled(apart_m).norm();
            let recorded = keyframe.closest.filter(|at| at.pair == pair && at.time_s >= violation.from_s);
            let nearest = nearer(recorded, Some(ClosestApproach { pair, separation_m, time_s }));
            if let Some(nearest) = nearest.filter(|nearest| nearest.separation_m < violation.min_m) {
                (violation.min_m, violation.min_at_s) = (nearest.separation_m, nearest.time_s);
                if k < PICTURED {
                    self.moments_s.insert(k + 1, around_s);
                }
            }
        }
        self.keyframes.push(keyframe);
        // What was around a moment so far may be so no longer.
        self.sift(self.keyframes.len().saturating_sub(3));
        let turns = self.keyframes.last().map_or(0, |last| size_of_val(&*last.attitudes));
        let bytes_each = self.count() * 6 * size_of::<f64>() + turns + size_of::<Keyframe>();
        if self.keyframes.len() >= 16 && self.keyframes.len() * bytes_each > self.budget_bytes {
            self.every *= 2;
            self.sift(0);
        }
    }

    /// Whether a keyframe is one in [`Timeline::every`], or needed for a moment that is looked at.
    fn stays(&self, keyframe: &Keyframe) -> bool {
        let of_moment = || self.moments_s.values().any(|around_s| around_s.contains(&keyframe.time_s));
        keyframe.number.is_multiple_of(self.every) || of_moment()
    }

    /// Drops what need not stay of the keyframes from this one on; the last one is always there.
    fn sift(&mut self, from: usize) {
        let mut dropped = None;
        for mut keyframe in self.keyframes.split_off(from) {
            keyframe.closest = nearer(dropped.take(), keyframe.closest);
            if keyframe.number + 1 == self.taken || self.stays(&keyframe) {
                self.keyframes.push(keyframe);
            } else {
                dropped = keyframe.closest;
            }
        }
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

    fn looks_at_steps(&self) -> bool {
        false
    }
}

/// The nearer of two approaches, the earlier one among equals.
pub(super) fn nearer(a: Option<ClosestApproach>, b: Option<ClosestApproach>) -> Option<ClosestApproach> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.separation_m < a.separation_m { b } else { a }),
        (a, b) => a.or(b),
    }
}
