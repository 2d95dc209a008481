//! One vehicle of a recording, from items to segments.

use nalgebra::Vector3;

use super::outcome::{Contradiction, Gap, Presence};
use super::settings::{Interpolation, RecordedError, Settings};
use crate::envelope::Seen;
use crate::exact::compare_height;
use crate::polynomial::{BernsteinBasis, parts_told};
use crate::segment::{Curve, Deviation, Segment};
use crate::sweep::{Interval, MAX_LENGTH_M, MIN_LIMIT_M};
use tautline_core::track::{Item, Piece, Sample};

/// Pieces of a curve that follow each other within this \[s\] leave no gap: files write times with about this resolution. A
/// jump of the position is swept.
const SAME_INSTANT_S: f64 = 1e-6;
/// Shortest part of a curve, as a fraction of it, that is looked at for when the ground is left.
const SHORTEST_PART: f64 = 1e-12;
/// Parts of a curve that are looked at for that.
const MOST_PARTS: usize = 2000;
/// Coefficients of a piece of a curve: the work on a part of it grows with their square.
const MOST_COEFFICIENTS: usize = 64;
/// Shortest interval between two samples of a vehicle \[s\]: it can be divided by, twice.
const SHORTEST_INTERVAL_S: f64 = 1e-70;
/// Relative excess over the assumed acceleration that rounding explains.
const ROUNDING: f64 = 1e-9;

/// A vehicle as far as it has been read, and how it is judged.
#[derive(Clone, Debug)]
pub(super) struct Vehicle {
    pub(super) name: String,
    /// Whether it is judged.
    pub(super) asked_for: bool,
    offset_s: f64,
    motion: Option<Interpolation>,
    /// Largest acceleration \[m/s^2\]; NaN where none is given.
    max_accel_m_s2: f64,
    /// 1 over the axes of the ellipsoid.
    scale: Option<Vector3<f64>>,
    window: Interval,
    above_m: Option<f64>,
    pub(super) max_gap_s: f64,
    /// Radius \[m\]; none where neither the recording nor the settings have one.
    pub(super) radius_m: Option<f64>,
    /// Whether the radius was taken from the recording and must not change.
    radius_recorded: bool,
    /// Segments not yet done with, in order of time.
    pub(super) segments: Vec<Segment>,
    /// When the vehicle was there, as far as it was forgotten.
    pub(super) presence: Option<Presence>,
    /// Where it was last seen, by its clock.
    last: Option<Sample>,
    /// How many intervals between samples were joined, and how long they were in all \[s\].
    joined: (u64, f64),
    /// Speed over the last interval \[m/s\] and its length \[s\].
    last_interval: Option<(Vector3<f64>, f64)>,
    pub(super) contradiction: Option<Contradiction>,
}

impl Vehicle {
    pub(super) fn new(name: &str, settings: &Settings, max_gap_s: f64) -> Self {
        let own = settings.vehicles.get(name).copied().unwrap_or_default();
        let radius_m = own.radius_m.or(settings.radius_m);
        Self {
            name: name.to_owned(),
            asked_for: settings.only.as_ref().is_none_or(|only| only.contains(name)),
            offset_s: own.offset_s,
            motion: settings.motion,
            max_accel_m_s2: own.max_accel_m_s2.or(settings.max_accel_m_s2).unwrap_or(f64::NAN),
            scale: settings.ellipsoid_m.map(|axes| axes.map(f64::recip)),
            window: settings.window(),
            above_m: settings.above_m,
            max_gap_s,
            radius_m,
            radius_recorded: radius_m.is_none(),
            segments: Vec::new(),
            presence: None,
            last: None,
            joined: (0, 0.0),
            last_interval: None,
            contradiction: None,
        }
    }

    /// Whether it can be judged, once it was seen.
    pub(super) fn check(&self, settings: &Settings) -> Result<(), RecordedError> {
        if self.motion == Some(Interpolation::Bounded) && self.max_accel_m_s2.is_nan() {
            return Err(RecordedError::NoBound { vehicle: self.name.clone() });
        }
        if settings.asks_for_separation() && !self.has_limit(settings) {
            return Err(RecordedError::NoLimit { vehicle: self.name.clone() });
        }
        Ok(())
    }

    /// Whether something says how close another may come to it.
    pub(super) fn has_limit(&self, settings: &Settings) -> bool {
        let limited = settings.delta_m.is_some() || settings.ellipsoid_m.is_some();
        limited || self.radius_m.is_some_and(|radius_m| radius_m >= MIN_LIMIT_M)
    }

    /// Whether it was asked for and there.
    pub(super) fn is_judged(&self) -> bool {
        self.asked_for && self.presence.is_some()
    }

    /// How its items are taken by what follows it alone.
    pub(super) fn seen(&self, after_gap: bool) -> Seen {
        let bounded_by_m_s2 = (self.motion == Some(Interpolation::Bounded)).then_some(self.max_accel_m_s2);
        Seen { offset_s: self.offset_s, after_gap, bounded_by_m_s2 }
    }

    #[inline]
    pub(super) fn is_unseen(&self) -> bool {
        self.last.is_none()
    }

    /// Mean interval between two of its samples \[s\]; 0 of curves.
    pub(super) fn mean_interval_s(&self) -> f64 {
        let (count, all_s) = self.joined;
        if count > 0 { all_s / count as f64 } else { 0.0 }
    }

    /// Up to when the vehicle is known \[s\].
    pub(super) fn known_s(&self) -> f64 {
        self.last.map_or(f64::NEG_INFINITY, |last| last.time_s)
    }

    /// Takes what is said of it next; returns the gap before it, if there is one.
    #[inline]
    pub(super) fn take(&mut self, item: &Item) -> Result<Option<Gap>, RecordedError> {
        match item {
            Item::Sample(sample) => self.sample(sample),
            Item::Piece(piece) => self.piece(piece),
        }
    }

    /// Takes a sample; returns the gap before it, if there is one.
    #[inline]
    fn sample(&mut self, sample: &Sample) -> Result<Option<Gap>, RecordedError> {
        let motion = self.motion.unwrap_or(Interpolation::Linear);
        if motion == Interpolation::Polynomial {
            return Err(RecordedError::NotACurve { vehicle: self.name.clone() });
        }
        self.check_sample(sample)?;
        let time_s = sample.time_s + self.offset_s;
        let seen = Sample { time_s, ..*sample };
        if let Some(last) = &self.last
            && time_s - last.time_s < SHORTEST_INTERVAL_S
        {
            return Err(self.not_increasing(last.time_s, time_s));
        }
        if self.radius_recorded && sample.radius_m != self.radius_m {
            if self.last.is_some() {
                let radius_m = sample.radius_m.unwrap_or(0.0);
                return Err(RecordedError::RadiusChanges { vehicle: self.name.clone(), time_s, radius_m });
            }
            self.radius_m = sample.radius_m;
        }
        let mut gap = None;
        match &self.last {
            Some(last) if time_s - last.time_s <= self.max_gap_s => {
                let (from_s, from) = (last.time_s, self.scaled(last.position_m));
                self.joined = (self.joined.0 + 1, self.joined.1 + (time_s - from_s));
                let to = self.scaled(sample.position_m);
                match motion {
                    Interpolation::Linear | Interpolation::Polynomial => self.keep_straight((from_s, time_s), from, to),
                    Interpolation::Hold => {
                        self.keep_straight((from_s, time_s), from, from);
                        self.keep_straight((time_s, time_s), from, to);
                    }
                    Interpolation::Bounded => {
                        let last = *last;
                        self.compare_with_bound(&last, &seen);
                        self.keep_bounded(&last, &seen);
                    }
                }
            }
            last => {
                gap = last.map(|last| Gap::new(sample.vehicle, last.time_s, time_s));
                self.last_interval = None;
                let at = self.scaled(sample.position_m);
                self.keep_straight((time_s, time_s), at, at);
            }
        }
        self.last = Some(seen);
        Ok(gap)
    }

    /// Takes a piece of a curve; returns the gap before it, if there is one.
    fn piece(&mut self, piece: &Piece) -> Result<Option<Gap>, RecordedError> {
        if !matches!(self.motion, None | Some(Interpolation::Polynomial)) {
            return Err(RecordedError::NotSamples { vehicle: self.name.clone() });
        }
        let (from_s, to_s) = (piece.from_s + self.offset_s, piece.to_s + self.offset_s);
        let coefficients: Vec<_> = piece.coefficients.iter().map(|c| self.scaled(*c)).collect();
        let segment = self.curve(Curve { from_s, to_s, coefficients, deviation: Deviation::default() })?;
        let (start, end) = (segment.from, segment.to);
        let seen = Sample { vehicle: piece.vehicle, time_s: to_s, position_m: end, velocity_m_s: None, radius_m: None };
        let mut gap = None;
        match self.last.replace(seen) {
            Some(last) if from_s < last.time_s - SAME_INSTANT_S => {
                return Err(self.not_increasing(last.time_s, from_s));
            }
            Some(last) if from_s - last.time_s <= self.max_gap_s.max(SAME_INSTANT_S) => {
                if last.position_m != start || last.time_s != from_s {
                    self.keep_straight((last.time_s.min(from_s), from_s), last.position_m, start);
                }
            }
            last => gap = last.map(|last| Gap::new(piece.vehicle, last.time_s, from_s)),
        }
        self.keep(&segment);
        Ok(gap)
    }

    fn curve(&self, curve: Curve) -> Result<Segment, RecordedError> {
        let wrong = |what: &str| Err(self.wrong(curve.from_s, what.to_owned()));
        if !(1..=MOST_COEFFICIENTS).contains(&curve.coefficients.len()) {
            let count = curve.coefficients.len();
            return wrong(&format!(
                "the piece has {count} coefficients, and can be judged with 1 to {MOST_COEFFICIENTS}"
            ));
        }
        if !(curve.from_s.is_finite() && curve.to_s.is_finite() && curve.to_s > curve.from_s) {
            return wrong("the piece does not end after it begins");
        }
        let length = curve.to_s - curve.from_s;
        let reach = curve.coefficients.iter().rev().fold(0.0, |sum, c| sum * length + c.abs().sum());
        if reach.is_nan() || reach > MAX_LENGTH_M {
            return wrong("a coefficient is not a finite number, or leads beyond 1e70 m");
        }
        Ok(Segment::curved(curve))
    }

    /// Keeps the chord, or the cubic, between two samples, and how far the vehicle can be from it.
    #[inline(never)]
    fn keep_bounded(&mut self, last: &Sample, seen: &Sample) {
        let h = seen.time_s - last.time_s;
        let (from, to) = (self.scaled(last.position_m), self.scaled(seen.position_m));
        // Lengths are divided by the axes of the ellipsoid, so deviations by its shortest.
        let accel = self.max_accel_m_s2 * self.scale.map_or(1.0, |scale| scale.max()) * (1.0 + 4.0 * f64::EPSILON);
        let (coefficients, deviation) = match last.velocity_m_s.zip(seen.velocity_m_s) {
            Some((start, end)) => {
                let (by, start, end) = (to - from, self.scaled(start), self.scaled(end));
                let second = (by * 3.0 / h - start * 2.0 - end) / h;
                let third = (start + end - by * 2.0 / h) / (h * h);
                (vec![from, start, second, third], Deviation { peak: accel * h * h / 16.0, hermite: true })
            }
            None => (vec![from, (to - from) / h], Deviation { peak: accel * h * h / 8.0, hermite: false }),
        };
        let curve = Curve { from_s: last.time_s, to_s: seen.time_s, coefficients, deviation };
        self.keep(&Segment { from, to, ..Segment::curved(curve) });
    }

    /// Notes where two samples, or three without velocities, cannot be joined within the bound.
    fn compare_with_bound(&mut self, last: &Sample, seen: &Sample) {
        let h = seen.time_s - last.time_s;
        let mean = (seen.position_m - last.position_m) / h;
        let rounding = 4.0 * f64::EPSILON * (seen.position_m.norm() + last.position_m.norm()) / (h * h);
        let mut needs = 0.0_f64;
        if let Some((before, before_s)) = self.last_interval {
            let apart_s = 0.5 * (before_s + h);
            needs = (mean - before).norm() / apart_s - rounding * (h + h * h / before_s) / apart_s;
        }
        if let Some(start) = last.velocity_m_s {
            needs = needs.max(2.0 * (mean - start).norm() / h - 2.0 * rounding);
        }
        if let Some(end) = seen.velocity_m_s {
            needs = needs.max(2.0 * (end - mean).norm() / h - 2.0 * rounding);
        }
        if let Some((start, end)) = last.velocity_m_s.zip(seen.velocity_m_s) {
            needs = needs.max((end - start).norm() / h);
        }
        self.last_interval = Some((mean, h));
        let assumed_m_s2 = self.max_accel_m_s2;
        let excess = needs > assumed_m_s2 * (1.0 + ROUNDING);
        let judged = self.window.from_s <= seen.time_s && last.time_s <= self.window.to_s;
        if excess && judged && self.contradiction.is_none_or(|largest| needs > largest.needs_m_s2) {
            let (vehicle, time_s) = (seen.vehicle, last.time_s);
            self.contradiction = Some(Contradiction { vehicle, time_s, needs_m_s2: needs, assumed_m_s2 });
        }
    }

    /// Keeps what is asked for of a straight segment. Where that is all of it, it is written in place: it is what most
    /// recordings consist of.
    #[inline]
    fn keep_straight(&mut self, (from_s, to_s): (f64, f64), from: Vector3<f64>, to: Vector3<f64>) {
        if self.window.from_s <= from_s && to_s <= self.window.to_s && self.above_m.is_none() {
            self.segments.push(Segment::straight(from_s, to_s, from, to));
        } else {
            self.keep(&Segment::straight(from_s, to_s, from, to));
        }
    }

    /// Keeps what is asked for of any segment.
    #[inline(never)]
    fn keep(&mut self, segment: &Segment) {
        let Some(segment) = segment.clipped(self.window) else { return };
        match self.above_m {
            None => self.segments.push(segment),
            Some(above_m) => {
                let height = above_m * self.scale.map_or(1.0, |scale| scale.z) - segment.deviation();
                split_at_height(segment, height, &mut self.segments);
            }
        }
    }

    #[inline]
    fn scaled(&self, v: Vector3<f64>) -> Vector3<f64> {
        match &self.scale {
            None => v,
            Some(scale) => v.component_mul(scale),
        }
    }

    #[inline]
    fn check_sample(&self, sample: &Sample) -> Result<(), RecordedError> {
        let what = if !sample.time_s.is_finite() {
            "the time"
        } else if !is_near(&sample.position_m) {
            "the position"
        } else if sample.velocity_m_s.is_some_and(|v| !is_near(&v)) {
            "the velocity"
        } else if sample.radius_m.is_some_and(|radius_m| !(0.0..=MAX_LENGTH_M).contains(&radius_m)) {
            "the radius, which must not be below 0 m,"
        } else {
            return Ok(());
        };
        Err(self.wrong(sample.time_s, format!("{what} is not a finite number below 1e70")))
    }

    #[cold]
    fn wrong(&self, time_s: f64, what: String) -> RecordedError {
        RecordedError::Item { vehicle: self.name.clone(), time_s, what }
    }

    #[cold]
    fn not_increasing(&self, previous_s: f64, time_s: f64) -> RecordedError {
        RecordedError::TimeNotIncreasing { vehicle: self.name.clone(), previous_s, time_s }
    }

    /// Forgets what ended by a time, and says how many segments that were.
    pub(super) fn forget(&mut self, until_s: f64) -> usize {
        let all = self.segments.last().is_none_or(|last| last.to_s <= until_s);
        let done = if all { self.segments.len() } else { self.segments.partition_point(|part| part.to_s <= until_s) };
        if let Some((first, last)) = self.segments[..done].first().zip(self.segments[..done].last()) {
            self.presence.get_or_insert(Presence { from_s: first.from_s, to_s: first.to_s }).to_s = last.to_s;
        }
        self.segments.drain(..done);
        done
    }
}

fn is_near(v: &Vector3<f64>) -> bool {
    (v.x.abs() <= MAX_LENGTH_M) & (v.y.abs() <= MAX_LENGTH_M) & (v.z.abs() <= MAX_LENGTH_M)
}

/// Splits a segment where it passes a height and says which parts are on the ground. A jump is on the ground if both ends
/// are; what cannot be told on a curve within some work is left open.
fn split_at_height(segment: Segment, height: f64, into: &mut Vec<Segment>) {
    let (low, high) = (segment.from.z.min(segment.to.z), segment.from.z.max(segment.to.z));
    if segment.curve().is_some() {
        split_curve_at_height(&segment, height, into);
    } else if segment.to_s <= segment.from_s || high <= height || low > height {
        into.push(Segment { grounded: Some(high <= height), ..segment });
    } else {
        let share = (height - segment.from.z) / (segment.to.z - segment.from.z);
        let starts_low = segment.from.z <= height;
        let mut at_s = segment.from_s + (segment.to_s - segment.from_s) * share.clamp(0.0, 1.0);
        // Rounded towards the time on the ground, so that no time in the air is left out.
        let line = segment.line();
        while segment.from_s < at_s && at_s < segment.to_s && compare_height(&line, at_s, height).is_gt() {
            at_s = if starts_low { at_s.next_down() } else { at_s.next_up() };
        }
        for (from_s, to_s, grounded) in [(segment.from_s, at_s, starts_low), (at_s, segment.to_s, !starts_low)] {
            if to_s > from_s {
                let part = segment.clipped(Interval { from_s, to_s });
                into.extend(part.map(|part| Segment { grounded: Some(grounded), ..part }));
            }
        }
    }
}

fn split_curve_at_height(segment: &Segment, height: f64, into: &mut Vec<Segment>) {
    let length_s = segment.to_s - segment.from_s;
    let at = |u: f64| if u >= 1.0 { segment.to_s } else { segment.from_s + length_s * u };
    let on_ground = |start: f64, length: f64| {
        let [from_s, to_s] = [start, start + length].map(|u| segment.from_s + length_s * u);
        let mut above: Vec<f64> = segment.local(Interval { from_s, to_s }).iter().map(|c| c.z).collect();
        above[0] -= height;
        match BernsteinBasis::of_degree(above.len() - 1).range(&above) {
            (_, high) if high <= 0.0 => Some(true),
            (low, _) if low > 0.0 => Some(false),
            // Where the height is passed: so short that it is not worth a doubt.
            _ if length <= SHORTEST_PART => Some(false),
            _ => None,
        }
    };
    for (start, end, grounded) in parts_told(0.0, MOST_PARTS, on_ground) {
        let part = segment.clipped(Interval { from_s: at(start), to_s: at(end) });
        into.extend(part.map(|part| Segment { grounded, ..part }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(segment: Segment, height: f64) -> Vec<(f64, f64, bool)> {
        let mut into = Vec::new();
        split_at_height(segment, height, &mut into);
        into.iter().map(|part| (part.from_s, part.to_s, part.grounded == Some(true))).collect()
    }

    #[test]
    fn a_climb_leaves_the_ground_where_it_passes_the_height() {
        let climb = Segment::straight(0.0, 4.0, Vector3::zeros(), Vector3::new(0.0, 0.0, 2.0));
        assert_eq!(parts(climb.clone(), 0.5), [(0.0, 1.0, true), (1.0, 4.0, false)]);
        assert_eq!(parts(climb.clone(), 2.0), [(0.0, 4.0, true)]);
        assert_eq!(parts(climb.clone(), -1.0), [(0.0, 4.0, false)]);
        let fall = Segment::straight(0.0, 4.0, climb.to, climb.from);
        assert_eq!(parts(fall, 0.5), [(0.0, 3.0, false), (3.0, 4.0, true)]);
    }

    #[test]
    fn a_hop_on_a_curve_is_above_between_its_two_crossings() {
        // z = 4 u (1 - u): above 0.75 between 1/4 and 3/4.
        let coefficients = vec![Vector3::zeros(), Vector3::new(0.0, 0.0, 4.0), Vector3::new(0.0, 0.0, -4.0)];
        let hop = Segment::curved(Curve { from_s: 0.0, to_s: 1.0, coefficients, deviation: Deviation::default() });
        let found = parts(hop, 0.75);
        assert_eq!(found.iter().map(|part| part.2).collect::<Vec<_>>(), [true, false, true]);
        assert!((found[0].1 - 0.25).abs() < 1e-9 && (found[1].1 - 0.75).abs() < 1e-9, "{found:?}");
    }
}
