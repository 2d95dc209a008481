//! The history of a flight in bounded memory, for figures, replay and pictures.
//!
//! A [`FlightLog`] is a [`Sink`]. It holds keyframes, the extremes between keyframes, and the findings of the judge.
//! Thinning keyframes out does not change closest approach, violations and peaks: they are over every step.

mod frame;
mod series;
mod violations;

pub use frame::{Attitudes, Frame, attitudes_of};
pub(crate) use series::{ROTORS, SERIES};
pub use violations::Violations;

use std::collections::BTreeMap;

pub(crate) use frame::nearest_present;
use frame::{apart, first_of_ties};
use tautline_audit::{Approach, ObjectPair, Slice, Slices};
use tautline_core::record::{Event, RecordError, Sample, Sink};
use tautline_core::swarm::{Bounce, ClosestApproach, Rows, row, separation};
use tautline_laws::space::Metric;
use tautline_recordings::mcap::Entry;
use tautline_sim::scenario::Scenario;

/// Memory of the keyframes \[bytes\]. Every second keyframe is dropped above this limit.
pub const BUDGET_BYTES: usize = 256 << 20;
/// Smallest number of keyframes that are thinned out.
const FEWEST_KEYFRAMES: usize = 16;
/// Number of violations whose worst moments are never thinned out. Each of these has its own picture.
pub const PICTURED: usize = 10;
/// Samples within violations take at most one part in `VIOLATION_SHARE` of the memory.
const VIOLATION_SHARE: usize = 4;
/// Largest number of stored hits of hulls.
const MOST_HITS: usize = 100;
/// Largest number of vehicles for which the smallest distance of every pair is stored.
pub(crate) const FEW_VEHICLES: usize = 12;

/// A flight in bounded memory: keyframes in order of time, and the findings of the judge.
///
/// Every second keyframe is dropped above 256 MiB. These keyframes stay: the first, the last, those around the closest
/// approach and around the worst moments of the first ten violations. Keyframes within violations stay as long as they
/// take at most a quarter of the memory. A keyframe absorbs the extremes of dropped keyframes before it.
#[derive(Clone, Debug)]
pub struct FlightLog {
    metric: Metric,
    /// Safety distance delta \[m\]; NaN if unknown.
    delta_m: f64,
    keyframes: Vec<Keyframe>,
    /// Every `every`-th sample is a keyframe, independent of findings.
    every: usize,
    samples: usize,
    violations: Violations,
    energy_initial: Option<f64>,
    /// Largest control effort of any vehicle over all steps and its time \[m/s^2\], \[s\].
    peak_control: Option<[f64; 2]>,
    /// Changes of the target: a new leg, or other slots of vehicles.
    targets: Vec<Event>,
    /// First hits of hulls, and the number of all.
    hits: Vec<Bounce>,
    hit_count: usize,
    /// Numbers of the samples around the closest approach (0), and around the worst moment of the k-th violation (k).
    moments: BTreeMap<usize, [usize; 2]>,
    /// Number of keyframes that stay because of a violation.
    kept_for_violations: usize,
    /// Vehicles that were absent from one time \[s\] to another, between two samples of a recording.
    pub gaps: Vec<(usize, [f64; 2])>,
    /// Whether vehicles rest between two keyframes, rather than move straight.
    pub holds: bool,
    /// Closest approaches from the audit of a whole recording.
    nearest: Option<Slices>,
    budget_bytes: usize,
}

/// A time at which every position is known.
#[derive(Clone, Debug, Default)]
pub struct Keyframe {
    /// The time \[s\].
    pub time_s: f64,
    /// Positions \[m\], N x 3; NaN for an absent vehicle.
    pub positions_m: Rows,
    /// Rotation from the body of each vehicle to the world, if recorded; otherwise empty.
    pub attitudes: Attitudes,
    /// Commanded accelerations \[m/s^2\], if recorded.
    pub control_m_s2: Option<Rows>,
    /// Closest approach since the previous keyframe.
    pub closest: Option<ClosestApproach>,
    /// Closest approach since the start.
    pub so_far: Option<ClosestApproach>,
    /// Number of the sample, from 0.
    pub(crate) number: usize,
    /// Whether the keyframe stays because of a violation.
    is_of_violation: bool,
    /// Extremes since the previous keyframe.
    pub(crate) extremes: Extremes,
}

/// Extremes over some samples.
#[derive(Clone, Debug, Default)]
pub(crate) struct Extremes {
    /// Largest control effort |u| of each vehicle at the samples \[m/s^2\].
    pub(crate) control_m_s2: Vec<f64>,
    /// Largest control effort of any vehicle over all steps \[m/s^2\].
    pub(crate) peak_control_m_s2: f64,
    /// Largest numbers of each vehicle in the channels; empty for a channel that is not recorded.
    pub(crate) series: [Vec<f64>; series::COUNT],
    /// Largest speed relative to the mean velocity \[m/s\].
    pub(crate) disagreement_m_s: f64,
    /// Largest energy over all steps \[m^2/s^2\].
    pub(crate) energy: Option<f64>,
    /// Smallest distance of each pair at the samples \[m\], pairs in index order; empty for more than
    /// [`FEW_VEHICLES`].
    pub(crate) pair_min_m: Vec<f64>,
}

impl Default for FlightLog {
    fn default() -> Self {
        Self::new(Metric::default(), f64::NAN)
    }
}

impl FlightLog {
    /// Returns an empty log with distances in `metric`, for a flight with this safety distance \[m\].
    #[must_use]
    pub fn new(metric: Metric, delta_m: f64) -> Self {
        Self {
            metric,
            delta_m,
            keyframes: Vec::new(),
            every: 1,
            samples: 0,
            violations: Violations::default(),
            energy_initial: None,
            peak_control: None,
            targets: Vec::new(),
            hits: Vec::new(),
            hit_count: 0,
            moments: BTreeMap::new(),
            kept_for_violations: 0,
            gaps: Vec::new(),
            holds: false,
            nearest: None,
            budget_bytes: BUDGET_BYTES,
        }
    }

    /// Returns an empty log of a flight of this scenario.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self::new(scenario.metric(), scenario.delta_m)
    }

    /// Reads the entries of a recording in order.
    ///
    /// # Errors
    /// The first error of the recording.
    pub fn read(entries: impl IntoIterator<Item = Result<Entry, RecordError>>) -> Result<Self, RecordError> {
        let mut log = Self::default();
        for entry in entries {
            match entry? {
                Entry::Sample(sample) => log.take(&sample.as_sample()),
                Entry::Event(event) => log.note(&event),
            }
        }
        Ok(log)
    }

    /// Returns the log of a recording with `samples` samples, from known positions, N x 3 \[m\] at each time \[s\], and
    /// closest approaches. No keyframe is dropped.
    #[must_use]
    pub fn recorded(times_s: Vec<f64>, positions_m: Vec<Rows>, nearest: Slices, samples: usize) -> Self {
        let keyframe =
            |(number, (time_s, positions_m))| Keyframe { time_s, positions_m, number, ..Keyframe::default() };
        let keyframes = std::iter::zip(times_s, positions_m).enumerate().map(keyframe).collect();
        Self { keyframes, samples, nearest: Some(nearest), ..Self::default() }
    }

    /// Returns the same log with another limit of memory for keyframes \[bytes\].
    #[must_use]
    pub fn within(self, budget_bytes: usize) -> Self {
        Self { budget_bytes, ..self }
    }

    /// Takes a sample, later than the previous one. Ignores a sample with another number of vehicles than the first.
    pub fn take(&mut self, sample: &Sample<'_>) {
        let positions_m = &sample.swarm.positions_m;
        let count = positions_m.nrows();
        let has = |approach: &ClosestApproach| approach.pair.second() < count && approach.separation_m.is_finite();
        self.push(Keyframe {
            time_s: sample.time_s,
            positions_m: positions_m.clone(),
            attitudes: attitudes_of(sample),
            control_m_s2: Some(sample.control.clone()).filter(|control| control.nrows() == count),
            closest: sample.separation.filter(has),
            extremes: Extremes::of(sample, self.metric),
            ..Keyframe::default()
        });
    }

    /// Takes positions, N x 3 \[m\], at a time \[s\] later than the previous one.
    pub fn take_positions(&mut self, time_s: f64, positions_m: Rows) {
        self.push(Keyframe { time_s, positions_m, ..Keyframe::default() });
    }

    /// Takes one event.
    pub fn note(&mut self, event: &Event) {
        let vehicles = if self.keyframes.is_empty() { usize::MAX } else { self.count() };
        self.violations.note(event, self.delta_m, vehicles);
        match *event {
            Event::LegBegan { .. } | Event::Assigned { .. } => self.targets.push(event.clone()),
            Event::HullsHit { pair, time_s, closing_m_s } => {
                self.hit_count += 1;
                if self.hits.len() < MOST_HITS {
                    self.hits.push(Bounce { pair, time_s, closing_m_s });
                }
            }
            _ => {}
        }
    }

    /// Replaces closest approaches, in order of time, and violations by those of the audit of the whole recording.
    pub fn judge(&mut self, closest: impl IntoIterator<Item = ClosestApproach>, violations: Violations) {
        self.violations = violations;
        let (mut closest, last_s) = (closest.into_iter().peekable(), self.range_s()[1]);
        let mut so_far = None;
        for keyframe in &mut self.keyframes {
            let until_s = if keyframe.time_s < last_s { keyframe.time_s } else { f64::INFINITY };
            keyframe.closest = None;
            while let Some(approach) = closest.next_if(|approach| approach.time_s <= until_s) {
                keyframe.closest = closer(keyframe.closest, Some(approach));
            }
            so_far = closer(so_far, keyframe.closest);
            keyframe.so_far = so_far;
        }
    }

    /// Takes the smallest separation of the whole flight \[m\] and its time \[s\] from the judge at the end of the
    /// flight. The separation in the log may be larger by rounding. A larger difference means another flight; the log
    /// ignores it.
    pub fn conclude(&mut self, separation_m: f64, time_s: f64) {
        const ROUNDING: f64 = 1e-9;
        let Some(closest) = self.closest().filter(|closest| closest.time_s == time_s) else { return };
        if (closest.separation_m - separation_m).abs() <= ROUNDING * closest.separation_m {
            let approaches =
                self.keyframes.iter_mut().flat_map(|keyframe| [&mut keyframe.closest, &mut keyframe.so_far]);
            let same = approaches.flatten().filter(|approach| **approach == closest);
            same.for_each(|approach| approach.separation_m = separation_m);
        }
    }

    /// Returns the number of vehicles N; 0 without keyframes.
    #[must_use]
    pub fn count(&self) -> usize {
        self.keyframes.first().map_or(0, |first| first.positions_m.nrows())
    }

    /// Returns the keyframes in order of time.
    #[must_use]
    pub fn keyframes(&self) -> &[Keyframe] {
        &self.keyframes
    }

    /// Returns the number of samples from one regular keyframe to the next.
    #[must_use]
    pub fn every(&self) -> usize {
        self.every
    }

    /// Returns the number of samples taken.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Returns the metric of distances between vehicles.
    #[must_use]
    pub fn metric(&self) -> Metric {
        self.metric
    }

    /// Returns the first and last time \[s\]; both 0 without keyframes.
    #[must_use]
    pub fn range_s(&self) -> [f64; 2] {
        [self.keyframes.first(), self.keyframes.last()].map(|keyframe| keyframe.map_or(0.0, |keyframe| keyframe.time_s))
    }

    /// Returns the closest approach of the whole flight, between samples too.
    #[must_use]
    pub fn closest(&self) -> Option<ClosestApproach> {
        self.keyframes.last().and_then(|last| last.so_far)
    }

    /// Returns every violation, of two vehicles and of obstacles.
    #[must_use]
    pub fn violations(&self) -> &Violations {
        &self.violations
    }

    /// Returns the energy of the first sample with an energy \[m^2/s^2\].
    #[must_use]
    pub fn energy_initial(&self) -> Option<f64> {
        self.energy_initial
    }

    /// Returns the largest control effort of any vehicle over all steps \[m/s^2\], and the time of the sample that
    /// reported it \[s\].
    #[must_use]
    pub fn peak_control(&self) -> Option<[f64; 2]> {
        self.peak_control
    }

    /// Returns the first hits of hulls, at most 100, and the number of all hits.
    #[must_use]
    pub fn hits(&self) -> (&[Bounce], usize) {
        (&self.hits, self.hit_count)
    }

    /// Returns the changes of the target in order of time.
    #[must_use]
    pub fn targets(&self) -> &[Event] {
        &self.targets
    }

    /// Returns the distance of two centres at the time of a hit of their hulls \[m\], scaled with ellipsoids.
    ///
    /// The distance is on straight lines between keyframes. A smaller closest approach of the pair in the next keyframe
    /// replaces it.
    #[must_use]
    pub fn hit_distance_m(&self, hit: &Bounce) -> Option<f64> {
        let positions_m = self.positions_m(hit.time_s).filter(|at| hit.pair.second() < at.nrows())?;
        let between_m = apart(&positions_m, hit.pair, self.metric).norm();
        let after = self.keyframes.partition_point(|keyframe| keyframe.time_s <= hit.time_s);
        let closest = self.keyframes.get(after).or(self.keyframes.last())?.closest;
        Some(closest.filter(|closest| closest.pair == hit.pair).map_or(between_m, |of| of.separation_m.min(between_m)))
    }

    /// Returns the closest approaches in slices of time: between keyframes, or from the audit of the recording.
    #[must_use]
    pub fn nearest(&self) -> Slices {
        if let Some(nearest) = &self.nearest {
            return nearest.clone();
        }
        let mut slices = Slices::default();
        let mut from_s = self.range_s()[0];
        for keyframe in &self.keyframes {
            if let Some(ClosestApproach { pair, separation_m, time_s }) = keyframe.closest {
                let (pair, lower_m, upper_m) = (ObjectPair::Vehicles(pair), separation_m, separation_m);
                let closest = Approach { pair, lower_m, upper_m, time_s, limit_m: 0.0 };
                slices.take(Slice { from_s, to_s: keyframe.time_s, closest, is_whole: true });
            }
            from_s = keyframe.time_s;
        }
        slices
    }

    fn push(&mut self, mut keyframe: Keyframe) {
        if !self.keyframes.is_empty() && keyframe.positions_m.nrows() != self.count() {
            return;
        }
        if self.keyframes.is_empty() {
            self.violations.keep_within(keyframe.positions_m.nrows());
            // Starts are often symmetric: the closest of several pairs is the first one.
            if let Some(closest) = &mut keyframe.closest {
                closest.pair = first_of_ties(&keyframe.positions_m, closest.pair, self.metric);
            }
        }
        let (time_s, before) = (keyframe.time_s, self.closest());
        keyframe.number = self.samples;
        keyframe.so_far = closer(before, keyframe.closest);
        self.samples += 1;
        self.energy_initial = self.energy_initial.or(keyframe.extremes.energy);
        let peak_m_s2 = keyframe.extremes.peak_control_m_s2;
        if peak_m_s2.is_finite() && self.peak_control.is_none_or(|[known, _]| peak_m_s2 > known) {
            self.peak_control = Some([peak_m_s2, time_s]);
        }
        let around = [keyframe.number.saturating_sub(1), keyframe.number];
        if keyframe.so_far != before {
            self.moments.insert(0, around);
        }
        let (metric, positions_m, closest) = (self.metric, &keyframe.positions_m, keyframe.closest);
        let worse = self.violations.lower(|found| {
            let pair = found.pair.vehicles().filter(|pair| pair.second() < positions_m.nrows())?;
            let sampled_m = apart(positions_m, pair, metric).norm();
            let measured = closest.filter(|at| at.pair == pair && at.time_s >= found.from_s);
            let sampled = ClosestApproach { pair, separation_m: sampled_m, time_s };
            closer(measured, Some(sampled)).map(|nearest| (nearest.separation_m, nearest.time_s))
        });
        for k in worse.into_iter().filter(|&k| k < PICTURED) {
            self.moments.insert(k + 1, around);
        }
        let bytes_each = keyframe.bytes();
        if self.violations.open().next().is_some()
            && (self.kept_for_violations + 1) * bytes_each <= self.budget_bytes / VIOLATION_SHARE
        {
            keyframe.is_of_violation = true;
            self.kept_for_violations += 1;
        }
        self.keyframes.push(keyframe);
        // Keyframes around an earlier moment may no longer need to stay.
        self.sift(self.keyframes.len().saturating_sub(3));
        if self.keyframes.len() >= FEWEST_KEYFRAMES && self.keyframes.len() * bytes_each > self.budget_bytes {
            self.every *= 2;
            self.sift(0);
        }
    }

    /// Returns whether a keyframe stays, because of its number or because of a finding.
    fn stays(&self, keyframe: &Keyframe) -> bool {
        let is_of_moment = || self.moments.values().any(|around| around.contains(&keyframe.number));
        keyframe.number.is_multiple_of(self.every) || keyframe.is_of_violation || is_of_moment()
    }

    /// Drops keyframes from this index on that need not stay; the last keyframe always stays.
    fn sift(&mut self, from: usize) {
        if self.every == 1 {
            return;
        }
        let mut dropped: Option<Keyframe> = None;
        for mut keyframe in self.keyframes.split_off(from) {
            if let Some(dropped) = dropped.take() {
                keyframe.absorb(&dropped);
            }
            if keyframe.number + 1 == self.samples || self.stays(&keyframe) {
                self.keyframes.push(keyframe);
            } else {
                dropped = Some(keyframe);
            }
        }
    }
}

impl Sink for FlightLog {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.take(sample);
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.note(event);
        Ok(())
    }

    fn needs_steps(&self) -> bool {
        false
    }
}

impl Keyframe {
    /// Merges the extremes of an earlier keyframe.
    fn absorb(&mut self, earlier: &Self) {
        self.closest = closer(earlier.closest, self.closest);
        self.extremes.absorb(&earlier.extremes);
    }

    /// Returns the memory of the keyframe \[bytes\].
    fn bytes(&self) -> usize {
        let Extremes { control_m_s2, series, pair_min_m, .. } = &self.extremes;
        let numbers = self.positions_m.len() + self.control_m_s2.as_ref().map_or(0, Rows::len);
        let numbers = numbers + control_m_s2.len() + pair_min_m.len() + series.iter().map(Vec::len).sum::<usize>();
        size_of::<Self>() + size_of_val(&*self.attitudes) + numbers * size_of::<f64>()
    }
}

impl Extremes {
    fn of(sample: &Sample<'_>, metric: Metric) -> Self {
        let positions_m = &sample.swarm.positions_m;
        let count = positions_m.nrows();
        let effort = |i: usize| if i < sample.control.nrows() { row(sample.control, i).norm() } else { f64::NAN };
        let control_m_s2: Vec<_> = (0..count).map(effort).collect();
        let pair_min_m = if count <= FEW_VEHICLES {
            let scaled = metric.scaled_rows(positions_m);
            pairs(count).map(|(i, j)| separation(&scaled, i, j)).collect()
        } else {
            Vec::new()
        };
        Self {
            peak_control_m_s2: control_m_s2.iter().copied().chain(sample.peaks.control_m_s2).fold(f64::NAN, f64::max),
            control_m_s2,
            series: series::numbers_of(sample),
            disagreement_m_s: sample.swarm.disagreement_m_s(),
            energy: larger(sample.energy, sample.peaks.energy),
            pair_min_m,
        }
    }

    /// Merges the extremes of other samples.
    pub(crate) fn absorb(&mut self, other: &Self) {
        let raise = |kept: &mut f64, other: f64| *kept = kept.max(other);
        self.control_m_s2.iter_mut().zip(&other.control_m_s2).for_each(|(kept, &other)| raise(kept, other));
        self.pair_min_m.iter_mut().zip(&other.pair_min_m).for_each(|(kept, &other)| *kept = kept.min(other));
        for (kept, other) in self.series.iter_mut().zip(&other.series) {
            if kept.is_empty() {
                kept.clone_from(other);
            } else {
                kept.iter_mut().zip(other).for_each(|(kept, &other)| raise(kept, other));
            }
        }
        raise(&mut self.peak_control_m_s2, other.peak_control_m_s2);
        raise(&mut self.disagreement_m_s, other.disagreement_m_s);
        self.energy = larger(self.energy, other.energy);
    }
}

/// Returns the larger of two numbers; an unknown number counts as smaller.
fn larger(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.into_iter().chain(b).reduce(f64::max)
}

/// Returns all pairs of `count` vehicles in index order.
pub(crate) fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> + Clone {
    (0..count).flat_map(move |i| (i + 1..count).map(move |j| (i, j)))
}

/// Returns the closer of two approaches; the first of equal ones.
pub(crate) fn closer(a: Option<ClosestApproach>, b: Option<ClosestApproach>) -> Option<ClosestApproach> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.separation_m < a.separation_m { b } else { a }),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests;
