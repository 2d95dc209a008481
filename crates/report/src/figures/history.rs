//! A run thinned to what a figure can show.

use super::axis::{Axis, extent};
use super::beside::{self, numbers_of};
use tautline_core::record::{Event, RecordError, Sample, Sink};
use tautline_core::swarm::{ClosestApproach, Pair, Rows, row, separation};
use tautline_laws::space::Metric;
use tautline_recordings::mcap::Entry;

/// Most spans of time that are kept: some four for each pixel of a figure's width.
const MOST_SPANS: usize = 2048;
/// Fewest that are kept, however many vehicles there are.
const FEWEST_SPANS: usize = 64;
/// Memory for the spans of a large swarm \[bytes\].
const MEMORY_BYTES: usize = 32 * 1024 * 1024;
/// Memory of one vehicle in one span \[bytes\]: a position and a control effort.
const BYTES_PER_VEHICLE: usize = 32;
/// And each number that a channel has of it.
const BYTES_PER_NUMBER: usize = 8;

/// Most hits of hulls that are marked one by one.
const MOST_HITS: usize = 100;

/// Up to this many vehicles every pair has a line of its own in a figure.
pub(super) const FEW_VEHICLES: usize = 12;

/// What figures need of a run, folded from its samples in bounded memory.
///
/// Time is cut into spans of equally many samples; when there are too many, neighbours are merged. A span keeps the
/// state at its start and the extremes within: the closest approach, the largest energy, control effort and velocity
/// disagreement. So what a figure must show, the extreme, is never thinned out. Memory is at most some 32 MiB for up
/// to 16 000 vehicles, whatever the length of the run.
///
/// It is a [`Sink`]: it can watch a run as it is flown, or [`RunHistory::read`] a recording.
#[derive(Clone, Debug, Default)]
pub struct RunHistory {
    /// What distances between vehicles are counted in.
    metric: Metric,
    vehicles: usize,
    most_spans: usize,
    samples_per_span: u64,
    samples: u64,
    spans: Vec<Span>,
    /// The last sample, where no span begins with it.
    last: Option<Span>,
    closest: Option<ClosestApproach>,
    energy_initial: Option<f64>,
    /// Where the target changed: a leg began, or vehicles were given other slots.
    pub(super) turns: Vec<Event>,
    /// The first times that hulls hit \[s\], and how often they did.
    hits: Vec<(f64, Pair)>,
    hit_count: usize,
}

/// A span of time.
#[derive(Clone, Debug, Default)]
pub(super) struct Span {
    /// Its start \[s\].
    pub(super) time_s: f64,
    /// Positions at its start \[m\].
    pub(super) positions_m: Rows,
    /// Largest control effort |u| of each vehicle within \[m/s^2\].
    pub(super) control_m_s2: Vec<f64>,
    /// Largest numbers of each vehicle that channels have within; none of a channel that there is not.
    pub(super) beside: [Vec<f64>; beside::COUNT],
    /// Largest speed relative to the mean velocity within \[m/s\].
    pub(super) disagreement_m_s: f64,
    /// Largest energy within \[m^2/s^2\].
    pub(super) energy: Option<f64>,
    /// Closest approach within, between samples too.
    pub(super) closest: Option<ClosestApproach>,
    /// Smallest distance of each pair within \[m\], of the samples; empty for a large swarm. Pairs in index order.
    pub(super) pair_min_m: Vec<f64>,
}

impl RunHistory {
    /// A history without samples.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// With distances between vehicles in these lengths; before the first sample.
    #[must_use]
    pub fn scaled_by(self, metric: Metric) -> Self {
        Self { metric, ..self }
    }

    /// What distances between vehicles are counted in.
    pub(super) fn metric(&self) -> Metric {
        self.metric
    }

    /// The history of a recording, read one sample at a time.
    ///
    /// # Errors
    /// The first error of the recording.
    pub fn read(recording: impl IntoIterator<Item = Result<Entry, RecordError>>) -> Result<Self, RecordError> {
        let mut history = Self::new();
        for entry in recording {
            match entry? {
                Entry::Sample(sample) => history.observe(&sample.as_sample()),
                Entry::Event(event) => history.note(&event),
            }
        }
        Ok(history)
    }

    /// Takes one sample, in the order of time. One of another number of vehicles than the first is passed over.
    pub fn observe(&mut self, sample: &Sample<'_>) {
        let count = sample.swarm.count();
        if self.samples == 0 {
            self.vehicles = count;
            let numbers: usize = numbers_of(sample).iter().map(Vec::len).sum();
            let affordable = MEMORY_BYTES / (BYTES_PER_VEHICLE * count.max(1) + BYTES_PER_NUMBER * numbers);
            self.most_spans = affordable.clamp(FEWEST_SPANS, MOST_SPANS);
            self.samples_per_span = 1;
        }
        if count != self.vehicles {
            return;
        }
        let instant = Span::at(sample, self.metric);
        self.closest = closer(self.closest, instant.closest);
        self.energy_initial = self.energy_initial.or(instant.energy);
        if self.samples.is_multiple_of(self.samples_per_span) && self.spans.len() == self.most_spans {
            self.halve();
        }
        match self.spans.last_mut() {
            Some(span) if !self.samples.is_multiple_of(self.samples_per_span) => {
                span.absorb(&instant);
                self.last = Some(instant);
            }
            _ => {
                self.spans.push(instant);
                self.last = None;
            }
        }
        self.samples += 1;
    }

    fn note(&mut self, event: &Event) {
        if let Event::LegBegan { .. } | Event::Assigned { .. } = event {
            self.turns.push(event.clone());
        }
        if let Event::HullsHit { pair, time_s, .. } = *event {
            self.hit_count += 1;
            if self.hits.len() < MOST_HITS {
                self.hits.push((time_s, pair));
            }
        }
    }

    /// Merges every two spans into one.
    fn halve(&mut self) {
        let mut spans = std::mem::take(&mut self.spans).into_iter();
        while let Some(mut span) = spans.next() {
            if let Some(next) = spans.next() {
                span.absorb(&next);
            }
            self.spans.push(span);
        }
        self.samples_per_span *= 2;
    }

    /// Number of vehicles N; 0 without samples.
    #[must_use]
    pub fn vehicles(&self) -> usize {
        self.vehicles
    }

    /// Samples seen.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Time of the last sample \[s\]; 0 without samples.
    #[must_use]
    pub fn end_s(&self) -> f64 {
        self.spans().last().map_or(0.0, |last| last.time_s)
    }

    /// The closest that any pair came, between samples too where the recording says so.
    #[must_use]
    pub fn closest(&self) -> Option<ClosestApproach> {
        self.closest
    }

    /// Energy of the first sample that has one \[m^2/s^2\].
    #[must_use]
    pub fn energy_initial(&self) -> Option<f64> {
        self.energy_initial
    }

    /// The first times that hulls hit \[s\], with the distance of the two centres \[m\]: by straight lines between spans,
    /// or the closest approach where that is theirs.
    pub(super) fn hits(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let apart = |span: &Span, pair: Pair| {
            self.metric.scaled(row(&span.positions_m, pair.second()) - row(&span.positions_m, pair.first()))
        };
        self.hits.iter().filter(|(_, pair)| pair.second() < self.vehicles).filter_map(move |&(time_s, pair)| {
            let before = self.spans().take_while(|span| span.time_s <= time_s).last()?;
            let after = self.spans().find(|span| span.time_s > time_s).unwrap_or(before);
            let length_s = after.time_s - before.time_s;
            let part = if length_s > 0.0 { (time_s - before.time_s) / length_s } else { 0.0 };
            let between_m = apart(before, pair).lerp(&apart(after, pair), part).norm();
            let known_m = after.closest.filter(|closest| closest.pair == pair).map(|closest| closest.separation_m);
            Some((time_s, known_m.unwrap_or(between_m).min(between_m)))
        })
    }

    /// How often hulls hit.
    pub(super) fn hit_count(&self) -> usize {
        self.hit_count
    }

    /// All spans in order of time; the last is the last sample alone.
    pub(super) fn spans(&self) -> impl Iterator<Item = &Span> + Clone {
        self.spans.iter().chain(&self.last)
    }

    /// The axis of time \[s\].
    pub(super) fn time_axis(&self) -> Axis {
        Axis::time(self.spans().next().map_or(0.0, |span| span.time_s), self.end_s())
    }

    /// At most `most` of the spans (at least two), evenly spread, the first and the last among them.
    pub(super) fn spread(&self, most: usize) -> Vec<&Span> {
        let all: Vec<_> = self.spans().collect();
        let most = most.max(2);
        if all.len() <= most {
            return all;
        }
        (0..most).map(|k| all[k * (all.len() - 1) / (most - 1)]).collect()
    }

    /// Whether every vehicle stays in one plane of constant z, up to rounding.
    #[must_use]
    pub fn is_level(&self) -> bool {
        const FLATNESS: f64 = 1e-6;
        let [x, y, z] = [0, 1, 2].map(|axis| self.extent(axis).map_or(0.0, |(low, high)| high - low));
        z <= FLATNESS * x.max(y)
    }

    /// Smallest and largest coordinate along an axis \[m\]; none where nothing has a place on one.
    pub(super) fn extent(&self, axis: usize) -> Option<(f64, f64)> {
        extent(self.spans().flat_map(|span| (0..self.vehicles).map(move |i| span.positions_m[(i, axis)])))
    }
}

impl Sink for RunHistory {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.observe(sample);
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

impl Span {
    fn at(sample: &Sample<'_>, metric: Metric) -> Self {
        let positions_m = &sample.swarm.positions_m;
        let count = positions_m.nrows();
        let effort = |i: usize| if i < sample.control.nrows() { row(sample.control, i).norm() } else { f64::NAN };
        let few = count <= FEW_VEHICLES;
        Self {
            time_s: sample.time_s,
            positions_m: positions_m.clone(),
            control_m_s2: (0..count).map(effort).collect(),
            beside: numbers_of(sample),
            disagreement_m_s: sample.swarm.disagreement_m_s(),
            energy: sample.energy,
            closest: sample.separation,
            pair_min_m: if few {
                let scaled = metric.scaled_rows(positions_m);
                pairs(count).map(|(i, j)| separation(&scaled, i, j)).collect()
            } else {
                Vec::new()
            },
        }
    }

    /// Control efforts that are numbers \[m/s^2\].
    pub(super) fn finite_control(&self) -> impl Iterator<Item = f64> {
        self.control_m_s2.iter().copied().filter(|effort| effort.is_finite())
    }

    /// Takes in the extremes of a later span.
    fn absorb(&mut self, later: &Self) {
        let raise = |kept: &mut f64, other: f64| *kept = kept.max(other);
        self.control_m_s2.iter_mut().zip(&later.control_m_s2).for_each(|(kept, &other)| raise(kept, other));
        self.pair_min_m.iter_mut().zip(&later.pair_min_m).for_each(|(kept, &other)| *kept = kept.min(other));
        for (kept, later) in self.beside.iter_mut().zip(&later.beside) {
            if kept.is_empty() {
                kept.clone_from(later);
            } else {
                kept.iter_mut().zip(later).for_each(|(kept, &other)| raise(kept, other));
            }
        }
        raise(&mut self.disagreement_m_s, later.disagreement_m_s);
        self.energy = match (self.energy, later.energy) {
            (Some(kept), Some(other)) => Some(kept.max(other)),
            (kept, other) => kept.or(other),
        };
        self.closest = closer(self.closest, later.closest);
    }
}

/// All pairs of `count` vehicles in index order.
pub(super) fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> + Clone {
    (0..count).flat_map(move |i| (i + 1..count).map(move |j| (i, j)))
}

/// The `k`-th of numbers below `count` that fill them evenly and follow no order of theirs: multiples of the golden ratio
/// spread over the unit interval.
pub(super) fn evenly(k: usize, count: usize) -> usize {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
    let number = ((golden * k as f64).fract() * count as f64) as usize;
    number.min(count - 1)
}

/// The closer approach; the first of equals, and never one that is not a number.
fn closer(a: Option<ClosestApproach>, b: Option<ClosestApproach>) -> Option<ClosestApproach> {
    let known = [a, b].into_iter().flatten().filter(|closest| closest.separation_m.is_finite());
    known.reduce(|first, second| if second.separation_m < first.separation_m { second } else { first })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::{Pair, Swarm};

    /// Two vehicles on the x axis, sampled every 0.01 s; sample `k` has distance, energy and effort of `f(k)`.
    fn history(samples: u64, f: impl Fn(u64) -> f64) -> RunHistory {
        let mut history = RunHistory::new();
        for k in 0..samples {
            let value = f(k);
            let time_s = k as f64 * 0.01;
            let swarm = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, value, 0.0, 0.0]));
            let control = Rows::from_row_slice(&[value, 0.0, 0.0, 0.0, 1.0, 0.0]);
            let separation = ClosestApproach { pair: Pair::new(0, 1), separation_m: value, time_s };
            history.observe(&Sample {
                separation: Some(separation),
                energy: Some(value),
                ..Sample::new(time_s, k, &swarm, &control)
            });
        }
        history
    }

    #[test]
    fn a_long_run_keeps_a_bounded_number_of_spans_and_both_of_its_ends() {
        for samples in [1, 2, 2047, 2048, 2049, 100_000] {
            let history = history(samples, |_| 3.0);
            let spans: Vec<_> = history.spans().collect();
            assert!(spans.len() <= MOST_SPANS + 1, "{} spans of {samples} samples", spans.len());
            assert_eq!(spans[0].time_s, 0.0);
            assert_eq!(spans[spans.len() - 1].time_s, (samples - 1) as f64 * 0.01);
            assert!(spans.is_sorted_by(|a, b| a.time_s < b.time_s));
        }
    }

    #[test]
    fn an_extreme_of_one_sample_survives_every_thinning() {
        let samples = 50_000;
        for at in [1, 777, 12_345, samples - 1] {
            let low = history(samples, |k| if k == at { 0.5 } else { 3.0 });
            let smallest = low.spans().map(|span| span.pair_min_m[0]).fold(f64::INFINITY, f64::min);
            assert_eq!(smallest, 0.5);
            assert_eq!(
                low.closest().map(|closest| (closest.separation_m, closest.time_s)),
                Some((0.5, at as f64 * 0.01))
            );
            let high = history(samples, |k| if k == at { 9.0 } else { 3.0 });
            assert_eq!(high.spans().map(|span| span.control_m_s2[0]).fold(0.0, f64::max), 9.0);
            assert_eq!(high.spans().filter_map(|span| span.energy).fold(0.0, f64::max), 9.0);
        }
    }

    #[test]
    fn a_history_without_samples_has_nothing() {
        let history = RunHistory::new();
        assert_eq!((history.vehicles(), history.samples(), history.end_s()), (0, 0, 0.0));
        assert!(history.spans().next().is_none() && history.spread(8).is_empty() && history.extent(0).is_none());
        assert!(history.is_level());
    }

    #[test]
    fn samples_of_another_swarm_and_numbers_that_are_not_finite_are_passed_over() {
        let mut history = history(3, |k| if k == 1 { f64::NAN } else { 3.0 });
        let (swarm, control) = (Swarm::at_rest(Rows::zeros(5)), Rows::zeros(0));
        history.observe(&Sample::new(9.0, 9, &swarm, &control));
        assert_eq!((history.samples(), history.end_s()), (3, 0.02));
        assert_eq!(history.closest().map(|closest| closest.separation_m), Some(3.0));
        assert_eq!(history.extent(0), Some((0.0, 3.0)));
    }
}
