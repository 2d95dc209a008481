//! Motion as it is taken, in bounded memory.

use nalgebra::Vector3;

use super::choice::{Span, around};
use tautline_audit::{Approach, ObjectPair, Slice, Slices};
use tautline_core::record::{Event, RecordError, Sample, Sink};
use tautline_core::swarm::{ClosestApproach, Rows, row};
use tautline_sim::plan::Plan;

/// Memory for positions \[bytes\]; beyond, every second instant is dropped.
const BUDGET_BYTES: usize = 64 << 20;
/// Most times in which something happened that instants are kept for while a flight is taken.
const MOST_SPANS: usize = 1000;
/// Fewest instants that are thinned.
const FEWEST: usize = 8;

/// Positions at instants, and how near any two were, by the judge.
///
/// It is a [`Sink`] and can watch a flight. What goes beyond 64 MiB is thinned; instants around violations and around the
/// closest approach stay.
#[derive(Clone, Debug, Default)]
pub struct Film {
    /// In order of time \[s\].
    pub(super) times_s: Vec<f64>,
    /// N x 3 each \[m\]; NaN for a vehicle that is not there.
    pub(super) positions_m: Vec<Rows>,
    pub(super) nearest: Slices,
    /// When the last instant was taken \[s\].
    taken_s: Option<f64>,
    /// Vehicles that were not there from one time \[s\] to another.
    pub(super) gaps: Vec<(usize, [f64; 2])>,
    /// Whether vehicles rest between two instants, and do not move straight.
    pub(super) holds: bool,
    /// What changes the target, and legs and slots with it.
    pub(super) events: Vec<Event>,
    /// Samples taken.
    pub(super) samples: usize,
    /// The number of each instant that is kept, from 0, and one in how many stays whatever happened.
    pub(super) numbers: Vec<usize>,
    every: usize,
    violations: Vec<(ObjectPair, Span)>,
    budget_bytes: Option<usize>,
}

impl Film {
    /// Nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Of instants that are known, `samples` in the recording: N x 3 positions \[m\] at each time \[s\], NaN for a vehicle that
    /// is not there.
    #[must_use]
    pub fn of(times_s: Vec<f64>, positions_m: Vec<Rows>, nearest: Slices, samples: usize) -> Self {
        let numbers = (0..times_s.len()).collect();
        Self { times_s, positions_m, nearest, samples, numbers, ..Self::default() }
    }

    /// The same, of vehicles that were not there from one time \[s\] to another.
    #[must_use]
    pub fn with_gaps(self, gaps: Vec<(usize, [f64; 2])>) -> Self {
        Self { gaps, ..self }
    }

    /// The same, of vehicles that rest between two instants.
    #[must_use]
    pub fn holding(self, holds: bool) -> Self {
        Self { holds, ..self }
    }

    #[cfg(test)]
    pub(super) fn within(self, budget_bytes: usize) -> Self {
        Self { budget_bytes: Some(budget_bytes), ..self }
    }

    /// Takes the next instant: a time \[s\] later than the one before it, and N x 3 positions \[m\].
    pub fn take(&mut self, time_s: f64, positions_m: &Rows, closest: Option<ClosestApproach>) {
        if self.positions_m.first().is_some_and(|first| first.nrows() != positions_m.nrows()) {
            return;
        }
        self.numbers.push(self.samples);
        self.samples += 1;
        self.times_s.push(time_s);
        self.positions_m.push(positions_m.clone());
        let from_s = self.taken_s.replace(time_s).unwrap_or(time_s);
        if let Some(ClosestApproach { pair, separation_m, time_s: at_s }) = closest {
            let (pair, lower_m, upper_m) = (ObjectPair::Vehicles(pair), separation_m, separation_m);
            let closest = Approach { pair, lower_m, upper_m, time_s: at_s, limit_m: 0.0 };
            self.nearest.take(Slice { from_s, to_s: time_s, closest, is_whole: true });
        }
        let bytes = positions_m.len() * size_of::<f64>() * self.times_s.len();
        if bytes > self.budget_bytes.unwrap_or(BUDGET_BYTES) && self.times_s.len() > FEWEST {
            self.thin();
        }
    }

    /// Drops half of the instants at least.
    fn thin(&mut self) {
        let most = self.times_s.len() / 2;
        let mut kept = self.even();
        while kept.len() > most {
            self.every = 2 * self.every.max(1);
            kept = self.even();
        }
        let mut all: Vec<_> = std::mem::take(&mut self.positions_m).into_iter().map(Some).collect();
        self.positions_m = kept.iter().filter_map(|&k| all[k].take()).collect();
        self.times_s = kept.iter().map(|&k| self.times_s[k]).collect();
        self.numbers = kept.iter().map(|&k| self.numbers[k]).collect();
    }

    /// Indices of the instants that are as dense at the end as at the beginning: one in so many, the first and the last, and those
    /// around what happened, which take a quarter of the room at most.
    pub(super) fn even(&self) -> Vec<usize> {
        let closest = self.nearest.closest().map(|closest| closest.time_s);
        let closest = closest.map(|at_s| Span { from_s: at_s, to_s: at_s, at_s });
        let spans = closest.into_iter().chain(self.violations.iter().map(|(_, span)| *span));
        let spans: Vec<_> = spans.collect();
        let mut kept = around(&self.times_s, &spans, self.times_s.len() / 4);
        let one_in = self.every.max(1);
        kept.extend((0..self.numbers.len()).filter(|&k| self.numbers[k].is_multiple_of(one_in)));
        kept.into_iter().collect()
    }

    /// A plan with what was told in the course of the flight.
    pub(super) fn noted(&self, mut plan: Option<Plan>) -> Option<Plan> {
        if let Some(plan) = &mut plan {
            self.events.iter().for_each(|event| plan.note(event));
        }
        plan
    }

    /// Where some vehicles are at an instant \[m\], those that are there.
    pub(super) fn places(&self, instant: usize, vehicles: &[usize]) -> impl Iterator<Item = Option<Vector3<f64>>> {
        let there = |at: Vector3<f64>| at.iter().all(|x| x.is_finite()).then_some(at);
        vehicles.iter().map(move |&vehicle| there(row(&self.positions_m[instant], vehicle)))
    }

    fn begin(&mut self, whose: ObjectPair, time_s: f64) {
        if self.violations.len() < MOST_SPANS {
            self.violations.push((whose, Span { from_s: time_s, to_s: f64::INFINITY, at_s: time_s }));
        }
    }

    fn end(&mut self, whose: ObjectPair, time_s: f64) {
        if let Some((_, span)) = self.violations.iter_mut().rev().find(|(other, _)| *other == whose) {
            span.to_s = time_s;
        }
    }
}

impl Sink for Film {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.take(sample.time_s, &sample.swarm.positions_m, sample.separation);
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        let of_obstacle = |vehicle, obstacle| ObjectPair::Obstacle { vehicle, obstacle };
        match *event {
            Event::LegBegan { .. } | Event::Assigned { .. } => self.events.push(event.clone()),
            Event::ViolationBegan { pair, time_s } => self.begin(ObjectPair::Vehicles(pair), time_s),
            Event::ViolationEnded { pair, time_s, .. } => self.end(ObjectPair::Vehicles(pair), time_s),
            Event::ObstacleViolationBegan { vehicle, obstacle, time_s } => {
                self.begin(of_obstacle(vehicle, obstacle), time_s);
            }
            Event::ObstacleViolationEnded { vehicle, obstacle, time_s, .. } => {
                self.end(of_obstacle(vehicle, obstacle), time_s);
            }
            _ => {}
        }
        Ok(())
    }

    fn looks_at_steps(&self) -> bool {
        false
    }
}
