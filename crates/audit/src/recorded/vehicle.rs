//! One vehicle of a recording: turns items into segments.

use nalgebra::Vector3;

use super::outcome::{Contradiction, Gap, Presence};
use super::settings::{Interpolation, RecordedError, Settings};
use crate::envelope::ItemContext;
use crate::exact::compare_height;
use crate::polynomial::{BernsteinBasis, classify_parts};
use crate::segment::{Curve, Deviation, Segment};
use crate::sweep::{Interval, MAX_LENGTH_M, MIN_LIMIT_M};
use tautline_core::track::{Item, Piece, Sample};

/// Largest time between two pieces of a curve without a gap \[s\]: files write times with about this resolution. A jump
/// of the position is swept.
const SAME_INSTANT_S: f64 = 1e-6;
/// Shortest part of a curve, as a fraction of it, to which the crossing of the ground is narrowed.
const SHORTEST_PART: f64 = 1e-12;
/// Largest number of parts of a curve that are examined for it.
const MAX_PARTS: usize = 2000;
/// Largest number of coefficients of a piece of a curve: the work on a part grows with their square.
const MAX_COEFFICIENTS: usize = 64;
/// Shortest interval between two samples of a vehicle \[s\]: it can be divided by twice without overflow.
const SHORTEST_INTERVAL_S: f64 = 1e-70;
/// Relative excess over the assumed acceleration that rounding explains.
const ROUNDING: f64 = 1e-9;

/// Vehicle with its current segments and settings.
#[derive(Clone, Debug)]
pub(super) struct Vehicle {
    pub(super) name: String,
    /// Whether the settings select the vehicle.
    pub(super) is_selected: bool,
    offset_s: f64,
    motion: Option<Interpolation>,
    /// Largest acceleration \[m/s^2\]; NaN if none is given.
    max_accel_m_s2: f64,
    /// Reciprocal axes of the ellipsoid.
    scale: Option<Vector3<f64>>,
    window: Interval,
    above_m: Option<f64>,
    pub(super) max_gap_s: f64,
    /// Radius \[m\]; `None` if neither the recording nor the settings have one.
    pub(super) radius_m: Option<f64>,
    /// Whether the radius was taken from the recording and must not change.
    radius_recorded: bool,
    /// Segments that are still needed, in order of time.
    pub(super) segments: Vec<Segment>,
    /// Interval covered by the discarded segments.
    pub(super) presence: Option<Presence>,
    /// Last sample, with the clock offset.
    last: Option<Sample>,
    /// Number of joined intervals between samples, and their total length \[s\].
    joined: (u64, f64),
    /// Mean velocity over the last interval \[m/s\], and its length \[s\].
    last_interval: Option<(Vector3<f64>, f64)>,
    pub(super) contradiction: Option<Contradiction>,
}

impl Vehicle {
    pub(super) fn new(name: &str, settings: &Settings, max_gap_s: f64) -> Self {
        let own = settings.vehicles.get(name).copied().unwrap_or_default();
        let radius_m = own.radius_m.or(settings.radius_m);
        Self {
            name: name.to_owned(),
            is_selected: settings.only.as_ref().is_none_or(|only| only.contains(name)),
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

    /// Checks after the first sample that the vehicle can be judged.
    pub(super) fn check(&self, settings: &Settings, has_plan: bool) -> Result<(), RecordedError> {
        if self.motion == Some(Interpolation::Bounded) && self.max_accel_m_s2.is_nan() {
            return Err(RecordedError::NoBound { vehicle: self.name.clone() });
        }
        if settings.has_separation_limit(has_plan) && !self.has_limit(settings) {
            return Err(RecordedError::NoLimit { vehicle: self.name.clone() });
        }
        Ok(())
    }

    /// Returns whether the vehicle has a limit on its separation.
    pub(super) fn has_limit(&self, settings: &Settings) -> bool {
        let limited = settings.delta_m.is_some() || settings.ellipsoid_m.is_some() || settings.cylinder.is_some();
        limited || self.radius_m.is_some_and(|radius_m| radius_m >= MIN_LIMIT_M)
    }

    /// Returns whether the vehicle is selected and present.
    pub(super) fn is_judged(&self) -> bool {
        self.is_selected && self.presence.is_some()
    }

    /// Returns the context for the limits on single vehicles.
    pub(super) fn item_context(&self, after_gap: bool) -> ItemContext {
        let bounded_by_m_s2 = (self.motion == Some(Interpolation::Bounded)).then_some(self.max_accel_m_s2);
        ItemContext { offset_s: self.offset_s, after_gap, bounded_by_m_s2 }
    }

    #[inline]
    pub(super) fn is_unseen(&self) -> bool {
        self.last.is_none()
    }

    /// Returns the mean interval between two samples \[s\]; 0 for curves.
    pub(super) fn mean_interval_s(&self) -> f64 {
        let (count, all_s) = self.joined;
        if count > 0 { all_s / count as f64 } else { 0.0 }
    }

    /// Returns the time up to which the motion is known \[s\].
    pub(super) fn known_s(&self) -> f64 {
        self.last.map_or(f64::NEG_INFINITY, |last| last.time_s)
    }

    /// Adds the next item; returns the gap before it, if any.
    #[inline]
    pub(super) fn take(&mut self, item: &Item) -> Result<Option<Gap>, RecordedError> {
        match item {
            Item::Sample(sample) => self.sample(sample),
            Item::Piece(piece) => self.piece(piece),
        }
    }

    /// Adds a sample; returns the gap before it, if any.
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
                    Interpolation::Linear | Interpolation::Polynomial => self.add_straight((from_s, time_s), from, to),
                    Interpolation::Hold => {
                        self.add_straight((from_s, time_s), from, from);
                        self.add_straight((time_s, time_s), from, to);
                    }
                    Interpolation::Bounded => {
                        let last = *last;
                        self.check_bound(&last, &seen);
                        self.add_bounded(&last, &seen);
                    }
                }
            }
            last => {
                gap = last.map(|last| Gap::new(sample.vehicle, last.time_s, time_s));
                self.last_interval = None;
                let position = self.scaled(sample.position_m);
                self.add_straight((time_s, time_s), position, position);
            }
        }
        self.last = Some(seen);
        Ok(gap)
    }

    /// Adds a piece of a curve; returns the gap before it, if any.
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
                    self.add_straight((last.time_s.min(from_s), from_s), last.position_m, start);
                }
            }
            last => gap = last.map(|last| Gap::new(piece.vehicle, last.time_s, from_s)),
        }
        self.add_segment(&segment);
        Ok(gap)
    }

    fn curve(&self, curve: Curve) -> Result<Segment, RecordedError> {
        let invalid = |what: &str| Err(self.invalid(curve.from_s, what.to_owned()));
        if !(1..=MAX_COEFFICIENTS).contains(&curve.coefficients.len()) {
            let count = curve.coefficients.len();
            return invalid(&format!("the piece must have 1 to {MAX_COEFFICIENTS} coefficients, got {count}"));
        }
        if !(curve.from_s.is_finite() && curve.to_s.is_finite() && curve.to_s > curve.from_s) {
            return invalid("the piece must end after it begins");
        }
        let length = curve.to_s - curve.from_s;
        let reach = curve.coefficients.iter().rev().fold(0.0, |sum, c| sum * length + c.abs().sum());
        if reach.is_nan() || reach > MAX_LENGTH_M {
            return invalid("a coefficient is not a finite number, or exceeds 1e70 m");
        }
        Ok(Segment::curved(curve))
    }

    /// Adds the chord, or the cubic, between two samples, with the bound on the vehicle's distance from it.
    #[inline(never)]
    fn add_bounded(&mut self, last: &Sample, seen: &Sample) {
        let h = seen.time_s - last.time_s;
        let (from, to) = (self.scaled(last.position_m), self.scaled(seen.position_m));
        // Lengths are divided by the axes of the ellipsoid, so deviations by its shortest axis.
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
        self.add_segment(&Segment { from, to, ..Segment::curved(curve) });
    }

    /// Records a contradiction if two samples, or three without velocities, cannot be joined within the bound.
    fn check_bound(&mut self, last: &Sample, seen: &Sample) {
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

    /// Adds the part of a straight segment in the window. The common case of a whole segment is written in place.
    #[inline]
    fn add_straight(&mut self, (from_s, to_s): (f64, f64), from: Vector3<f64>, to: Vector3<f64>) {
        if self.window.from_s <= from_s && to_s <= self.window.to_s && self.above_m.is_none() {
            self.segments.push(Segment::straight(from_s, to_s, from, to));
        } else {
            self.add_segment(&Segment::straight(from_s, to_s, from, to));
        }
    }

    /// Adds the part of a segment in the window, split at the height of the ground.
    #[inline(never)]
    fn add_segment(&mut self, segment: &Segment) {
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
        } else if !is_in_range(&sample.position_m) {
            "the position"
        } else if sample.velocity_m_s.is_some_and(|v| !is_in_range(&v)) {
            "the velocity"
        } else if sample.radius_m.is_some_and(|radius_m| !(0.0..=MAX_LENGTH_M).contains(&radius_m)) {
            "the radius, which must not be below 0 m,"
        } else {
            return Ok(());
        };
        Err(self.invalid(sample.time_s, format!("{what} is not a finite number below 1e70")))
    }

    #[cold]
    fn invalid(&self, time_s: f64, what: String) -> RecordedError {
        RecordedError::Item { vehicle: self.name.clone(), time_s, what }
    }

    #[cold]
    fn not_increasing(&self, previous_s: f64, time_s: f64) -> RecordedError {
        RecordedError::TimeNotIncreasing { vehicle: self.name.clone(), previous_s, time_s }
    }

    /// Discards the segments that ended by a time; returns their number.
    pub(super) fn discard_until(&mut self, until_s: f64) -> usize {
        let all = self.segments.last().is_none_or(|last| last.to_s <= until_s);
        let done = if all { self.segments.len() } else { self.segments.partition_point(|part| part.to_s <= until_s) };
        if let Some((first, last)) = self.segments[..done].first().zip(self.segments[..done].last()) {
            self.presence.get_or_insert(Presence { from_s: first.from_s, to_s: first.to_s }).to_s = last.to_s;
        }
        self.segments.drain(..done);
        done
    }
}

fn is_in_range(v: &Vector3<f64>) -> bool {
    (v.x.abs() <= MAX_LENGTH_M) & (v.y.abs() <= MAX_LENGTH_M) & (v.z.abs() <= MAX_LENGTH_M)
}

/// Splits a segment where it passes a height and marks the parts on the ground. A jump is on the ground if both ends
/// are. A part of a curve that is not classified within the allowed work stays unknown.
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
        // Rounded towards the time on the ground, so that no time in the air is lost.
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
    let time_at = |u: f64| if u >= 1.0 { segment.to_s } else { segment.from_s + length_s * u };
    let on_ground = |start: f64, length: f64| {
        let [from_s, to_s] = [start, start + length].map(|u| segment.from_s + length_s * u);
        let mut above: Vec<f64> = segment.local(Interval { from_s, to_s }).iter().map(|c| c.z).collect();
        above[0] -= height;
        match BernsteinBasis::of_degree(above.len() - 1).range(&above) {
            (_, high) if high <= 0.0 => Some(true),
            (low, _) if low > 0.0 => Some(false),
            // The height is crossed here; so short a part counts as in the air.
            _ if length <= SHORTEST_PART => Some(false),
            _ => None,
        }
    };
    for (start, end, grounded) in classify_parts(0.0, MAX_PARTS, on_ground) {
        let part = segment.clipped(Interval { from_s: time_at(start), to_s: time_at(end) });
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
    fn a_climb_is_split_at_the_height_of_the_ground() {
        let climb = Segment::straight(0.0, 4.0, Vector3::zeros(), Vector3::new(0.0, 0.0, 2.0));
        assert_eq!(parts(climb.clone(), 0.5), [(0.0, 1.0, true), (1.0, 4.0, false)]);
        assert_eq!(parts(climb.clone(), 2.0), [(0.0, 4.0, true)]);
        assert_eq!(parts(climb.clone(), -1.0), [(0.0, 4.0, false)]);
        let fall = Segment::straight(0.0, 4.0, climb.to, climb.from);
        assert_eq!(parts(fall, 0.5), [(0.0, 3.0, false), (3.0, 4.0, true)]);
    }

    #[test]
    fn a_curve_is_split_at_both_crossings_of_the_ground() {
        // z = 4 u (1 - u): above 0.75 between 1/4 and 3/4.
        let coefficients = vec![Vector3::zeros(), Vector3::new(0.0, 0.0, 4.0), Vector3::new(0.0, 0.0, -4.0)];
        let hop = Segment::curved(Curve { from_s: 0.0, to_s: 1.0, coefficients, deviation: Deviation::default() });
        let found = parts(hop, 0.75);
        assert_eq!(found.iter().map(|part| part.2).collect::<Vec<_>>(), [true, false, true]);
        assert!((found[0].1 - 0.25).abs() < 1e-9 && (found[1].1 - 0.75).abs() < 1e-9, "{found:?}");
    }
}
