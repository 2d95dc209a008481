//! Monitor of the limits on single vehicles while a recording is read.

use nalgebra::Vector3;

use super::extremum::{
    EnclosedValue, Enclosure, MeanAcceleration, Precision, Velocity, WIDTH, derivative, largest, largest_of,
};
use super::fence::Fence;
use super::limit::{Corner, Corners, Envelope, EnvelopeOutcome, Exceedance, Limit, LimitOutcome, Quantity};
use super::navigation::{lowness_along, lowness_at, lowness_between, yaw_rates};
use crate::findings::{Finding, LISTED, Shortlist, Tally};
use crate::ledger::Interruption;
use crate::outcome::Status;
use crate::polynomial::{chord_deviation, rescale, value};
use crate::sweep::Interval;
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::track::{Item, Piece, Sample};

/// Largest jump at which two pieces form one smooth curve: of the position \[m\] and of the velocity \[m/s\]. Files
/// write coefficients with about this resolution.
const SMOOTH: f64 = 1e-3;
/// Largest time between two pieces that meet \[s\].
const SAME_INSTANT_S: f64 = 1e-6;
/// Resolution of the smallest clearance margin of a curve, as a fraction of the margin.
const COARSE: f64 = 1e-3;
/// Context in which an item is judged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ItemContext {
    /// Clock offset, added to the item's times \[s\].
    pub(crate) offset_s: f64,
    /// Whether a gap precedes the item.
    pub(crate) after_gap: bool,
    /// Largest acceleration between samples \[m/s^2\]; `None` if samples are joined by straight lines.
    pub(crate) bounded_by_m_s2: Option<f64>,
}

/// Monitors every limit, vehicle by vehicle.
#[derive(Clone, Debug)]
pub(crate) struct LimitMonitor {
    fence: Option<MonitoredFence>,
    window: Interval,
    of: Vec<LimitRecord>,
    vehicles: Vec<LastState>,
    /// Length of the averaging window of accelerations \[s\], and the recent velocities of each vehicle.
    accel_window_s: Option<f64>,
    means: Vec<MeanAcceleration>,
}

/// Fence with the flag that ends the search for the clearance margin.
#[derive(Clone, Debug)]
struct MonitoredFence {
    fence: Fence,
    interruption: Interruption,
}

impl MonitoredFence {
    fn clearance_margin_m(&self, from: Vector3<f64>, to: Vector3<f64>) -> f64 {
        self.fence.margin_until(from, to, &self.interruption)
    }
}

/// Last state of a vehicle.
#[derive(Clone, Copy, Debug, Default)]
struct LastState {
    sample: Option<Sample>,
    /// Velocity at the end of the last piece \[m/s\].
    curve_end: Option<Vector3<f64>>,
    /// Mean velocity over the last interval \[m/s\], and its length \[s\].
    interval: Option<(Vector3<f64>, f64)>,
}

impl LimitMonitor {
    pub(crate) fn new(envelope: &Envelope, window: Interval, accel_window_s: Option<f64>) -> Self {
        let records = envelope.all().into_iter().map(LimitRecord::new).collect();
        let fence = envelope.fence.clone().map(|fence| MonitoredFence { fence, interruption: Interruption::default() });
        Self { fence, window, of: records, vehicles: Vec::new(), accel_window_s, means: Vec::new() }
    }

    pub(crate) fn set_interruption(&mut self, interruption: Interruption) {
        if let Some(fence) = &mut self.fence {
            fence.interruption = interruption;
        }
    }

    /// Adds the next item of a vehicle.
    pub(crate) fn take(&mut self, item: &Item, seen: ItemContext) {
        let vehicle = item.vehicle();
        if self.vehicles.len() <= vehicle {
            self.vehicles.resize(vehicle + 1, LastState::default());
            self.means.resize(vehicle + 1, MeanAcceleration::default());
        }
        if seen.after_gap {
            self.means[vehicle].restart();
        }
        let last = std::mem::take(&mut self.vehicles[vehicle]);
        let last = if seen.after_gap { LastState::default() } else { last };
        self.vehicles[vehicle] = match item {
            Item::Sample(sample) => {
                self.sample(last, Sample { time_s: sample.time_s + seen.offset_s, ..*sample }, seen)
            }
            Item::Piece(piece) => self.piece(last, piece, seen.offset_s),
        };
    }

    fn sample(&mut self, last: LastState, seen: Sample, ItemContext { bounded_by_m_s2, .. }: ItemContext) -> LastState {
        let Some(before) = last.sample else {
            self.judge_instant(&seen);
            return LastState { sample: Some(seen), ..LastState::default() };
        };
        let over = Interval { from_s: before.time_s, to_s: seen.time_s };
        let h = over.to_s - over.from_s;
        let mean = (seen.position_m - before.position_m) / h;
        let bound_m_s2 = bounded_by_m_s2.unwrap_or(0.0);
        let rounding_m_s = 2.0 * rounding_m(&before, &seen) / h;
        self.observe_navigation(seen.vehicle, over);
        self.each(seen.vehicle, |limit, fence, window, known| match limit.quantity.derivative() {
            _ if limit.quantity == Quantity::NavigationFloor => {
                lowness_between(window, (&before, &seen), mean, bound_m_s2, rounding_m_s)
            }
            0 => position_value_between(limit, fence, window, (&before, &seen), (bound_m_s2, known)),
            1 => speed_between(limit, window, (&before, &seen), mean, bound_m_s2),
            _ => None,
        });
        if self.accel_window_s.is_some() {
            self.judge_mean_accelerations(seen.vehicle, &Velocity { over, coefficients: vec![mean], rounding_m_s });
        } else {
            self.judge_acceleration(&before, &seen, (last.interval, mean), bounded_by_m_s2);
        }
        LastState { sample: Some(seen), interval: Some((mean, h)), curve_end: None }
    }

    /// Judges mean accelerations over windows that end in the interval of a velocity.
    fn judge_mean_accelerations(&mut self, vehicle: usize, velocity: &Velocity) {
        let Some(length_s) = self.accel_window_s else { return };
        let accelerations = self.of.iter_mut().filter(|record| record.limit.quantity == Quantity::Acceleration);
        for record in accelerations {
            let (known, bound, width) = (record.known(), record.limit.bound(), WIDTH * record.limit.allowance());
            let goal = Precision { known, bound, width, coarse: 0.0 };
            for found in self.means[vehicle].take(velocity.clone(), length_s, self.window, goal) {
                record.note(vehicle, Some(found));
            }
            record.assumes = Some(Fact::number(FactKind::MeanAcceleration, Source::Declared, length_s, "s"));
        }
    }

    /// Judges accelerations around a sample, from the mean velocities on both sides and the recorded velocities.
    fn judge_acceleration(
        &mut self,
        before: &Sample,
        seen: &Sample,
        (last, mean): (Option<(Vector3<f64>, f64)>, Vector3<f64>),
        bounded_by_m_s2: Option<f64>,
    ) {
        let h = seen.time_s - before.time_s;
        let shortest_s = last.map_or(h, |(_, h_before)| h.min(h_before));
        let rounding = 4.0 * rounding_m(before, seen) / (h * shortest_s);
        let needs = [
            last.map(|(mean_before, h_before)| 2.0 * (mean - mean_before).norm() / (h_before + h)),
            before.velocity_m_s.map(|start| 2.0 * (mean - start).norm() / h),
            seen.velocity_m_s.map(|end| 2.0 * (end - mean).norm() / h),
        ];
        let needed = needs.into_iter().flatten().reduce(f64::max).map(|needed| (needed - rounding).max(0.0));
        let from_s = before.time_s - last.map_or(0.0, |(_, h_before)| h_before);
        self.each(seen.vehicle, |limit, _, window, _| {
            let needed = needed.filter(|_| limit.quantity == Quantity::Acceleration)?;
            // A bounded motion has this acceleration somewhere between the samples; the instant is unknown.
            let is_whole = window.from_s <= from_s && seen.time_s <= window.to_s;
            let lower = if is_whole || bounded_by_m_s2.is_none() { needed } else { f64::NEG_INFINITY };
            let upper = bounded_by_m_s2.map_or(lower, |most| most.max(lower));
            let over = Interval { from_s: from_s.max(window.from_s), to_s: seen.time_s.min(window.to_s) };
            let fraction =
                if over.to_s > over.from_s { (before.time_s - over.from_s) / (over.to_s - over.from_s) } else { 0.0 };
            (over.from_s < over.to_s).then_some((over, Enclosure { lower, upper, at: fraction }))
        });
        if bounded_by_m_s2.is_none() {
            let limits = self.of.iter_mut().filter(|limit| limit.limit.quantity == Quantity::Acceleration);
            limits.for_each(|limit| limit.assumes = Some(Fact::new(FactKind::SampledAcceleration, Source::Default)));
        }
    }

    /// Judges the first sample of a vehicle, or the first sample after a gap.
    fn judge_instant(&mut self, seen: &Sample) {
        let over = Interval { from_s: seen.time_s, to_s: seen.time_s };
        self.observe_navigation(seen.vehicle, over);
        self.each(seen.vehicle, |limit, fence, window, _| {
            let is_in_window = window.from_s <= seen.time_s && seen.time_s <= window.to_s;
            let exact = match (limit.quantity, limit.quantity.derivative()) {
                (Quantity::Fence, _) => -fence?.clearance_margin_m(seen.position_m, seen.position_m),
                (Quantity::NavigationFloor, _) => lowness_at(seen.position_m, seen.velocity_m_s?)?,
                (quantity, 0) => quantity.of(seen.position_m),
                (quantity, 1) => quantity.of(seen.velocity_m_s?),
                _ => return None,
            };
            is_in_window.then_some((over, Enclosure { lower: exact, upper: exact, at: 0.0 }))
        });
    }

    fn piece(&mut self, last: LastState, piece: &Piece, offset_s: f64) -> LastState {
        let over = Interval { from_s: piece.from_s + offset_s, to_s: piece.to_s + offset_s };
        let (vehicle, length_s) = (piece.vehicle, over.to_s - over.from_s);
        let mut whole = piece.coefficients.clone();
        rescale(&mut whole, 0.0, length_s);
        let (start, start_m_s) = (whole[0], derivative(&whole, length_s)[0]);
        let (end, end_m_s) = (value(&whole, 1.0), value(&derivative(&whole, length_s), 1.0));
        self.judge_transition(&last, vehicle, (over.from_s, start), start_m_s);
        let clip = Interval { from_s: over.from_s.max(self.window.from_s), to_s: over.to_s.min(self.window.to_s) };
        if clip.from_s < clip.to_s {
            let mut part = piece.coefficients.clone();
            let clipped_s = clip.to_s - clip.from_s;
            rescale(&mut part, clip.from_s - over.from_s, clipped_s);
            let first = derivative(&part, clipped_s);
            let second = derivative(&first, clipped_s);
            let is_mean = self.accel_window_s.is_some();
            self.observe_navigation(vehicle, clip);
            for record in
                self.of.iter_mut().filter(|record| !(is_mean && record.limit.quantity == Quantity::Acceleration))
            {
                let goal = Precision {
                    known: record.known(),
                    bound: record.limit.bound(),
                    width: WIDTH * record.limit.allowance(),
                    coarse: 0.0,
                };
                let found = match (record.limit.quantity, record.limit.quantity.derivative()) {
                    (Quantity::Fence, _) => {
                        self.fence.as_ref().map(|fence| outside(fence, &part, Precision { coarse: COARSE, ..goal }))
                    }
                    (Quantity::NavigationFloor, _) => {
                        Some(lowness_along(&part, &first, goal)).filter(|found| found.upper > f64::NEG_INFINITY)
                    }
                    (Quantity::YawRate, _) => None,
                    (quantity, order) => Some(largest_of(quantity, [&part, &first, &second][order], goal)),
                };
                record.note(vehicle, found.map(|found| (clip, found)));
            }
        }
        if self.accel_window_s.is_some() {
            let coefficients = derivative(&whole, length_s);
            self.judge_mean_accelerations(vehicle, &Velocity { over, coefficients, rounding_m_s: 0.0 });
        }
        let sample = Sample { vehicle, time_s: over.to_s, position_m: end, velocity_m_s: None, radius_m: None };
        LastState { sample: Some(sample), curve_end: Some(end_m_s), interval: None }
    }

    /// Judges the transition between two pieces: no speed is known across a position jump, and a velocity jump is a
    /// corner.
    fn judge_transition(
        &mut self,
        last: &LastState,
        vehicle: usize,
        (from_s, start): (f64, Vector3<f64>),
        start_m_s: Vector3<f64>,
    ) {
        let Some((before, end_m_s)) = last.sample.zip(last.curve_end) else { return };
        let jumps = (start - before.position_m).norm() > SMOOTH;
        let by_m_s = (start_m_s - end_m_s).norm();
        // Pieces that are separated in time are joined by a straight line.
        let apart_s = from_s - before.time_s;
        let (is_separated, is_mean) = (apart_s > SAME_INSTANT_S, self.accel_window_s.is_some());
        let over = Interval { from_s: before.time_s.min(from_s), to_s: from_s };
        let is_in = |window: Interval| window.from_s <= from_s && from_s <= window.to_s;
        self.each(vehicle, |limit, fence, window, _| {
            let lower = match limit.quantity.derivative() {
                0 if limit.quantity == Quantity::Fence => -fence?.clearance_margin_m(before.position_m, start),
                0 => limit.quantity.of(before.position_m).max(limit.quantity.of(start)),
                _ if limit.quantity == Quantity::YawRate => return None,
                _ if jumps => f64::NEG_INFINITY,
                2 if is_separated && !is_mean && by_m_s > SMOOTH => by_m_s / apart_s,
                _ => return None,
            };
            let upper = if limit.quantity.derivative() == 0 { lower } else { f64::INFINITY };
            is_in(window).then_some((over, Enclosure { lower, upper, at: 1.0 }))
        });
        if jumps {
            self.means[vehicle].restart();
        } else if is_separated {
            let coefficients = vec![(start - before.position_m) / apart_s];
            self.judge_mean_accelerations(vehicle, &Velocity { over, coefficients, rounding_m_s: 0.0 });
        } else if by_m_s > SMOOTH && !is_mean && is_in(self.window) {
            let accelerations = self.of.iter_mut().filter(|record| record.limit.quantity == Quantity::Acceleration);
            accelerations.for_each(|record| record.note_corner(vehicle, from_s, by_m_s));
        }
    }

    /// Records that a vehicle is seen in the window, which decides the navigation floor if it never moves horizontally.
    fn observe_navigation(&mut self, vehicle: usize, over: Interval) {
        let is_in_window = over.from_s <= self.window.to_s && self.window.from_s <= over.to_s;
        let floors =
            self.of.iter_mut().filter(|record| record.limit.quantity == Quantity::NavigationFloor && is_in_window);
        floors.for_each(|record| record.observe(vehicle));
    }

    /// Judges the yaw rate of a vehicle by its setpoints of time \[s\] and yaw \[deg\].
    pub(crate) fn judge_yaw(&mut self, vehicle: usize, setpoints: &[[f64; 2]]) {
        for record in self.of.iter_mut().filter(|record| record.limit.quantity == Quantity::YawRate) {
            let still = Enclosure { lower: 0.0, upper: 0.0, at: 0.0 };
            let at_s = setpoints.first().map_or(0.0, |[time_s, _]| *time_s);
            record.note(vehicle, Some((Interval { from_s: at_s, to_s: at_s }, still)));
            for found in yaw_rates(setpoints, self.window) {
                record.note(vehicle, Some(found));
            }
        }
    }

    /// Calls `find` for each limit with its worst known value, and records the result.
    fn each(
        &mut self,
        vehicle: usize,
        mut find: impl FnMut(Limit, Option<&MonitoredFence>, Interval, f64) -> Option<EnclosedValue>,
    ) {
        let Self { fence, window, of: records, .. } = self;
        for record in records {
            let known = record.known();
            record.note(vehicle, find(record.limit, fence.as_ref(), *window, known));
        }
    }

    /// Returns the verdicts for the judged vehicles. `is_whole` states that no motion was missed and no assumption
    /// contradicted.
    pub(crate) fn finish(self, judged: &[bool], is_whole: bool) -> EnvelopeOutcome {
        EnvelopeOutcome { limits: self.of.into_iter().map(|record| record.finish(judged, is_whole)).collect() }
    }
}

/// Encloses heights and the clearance margin of a fence between two samples: those of the straight line, widened by A
/// h^2 / 8.
fn position_value_between(
    limit: Limit,
    fence: Option<&MonitoredFence>,
    window: Interval,
    (before, seen): (&Sample, &Sample),
    (bound_m_s2, known): (f64, f64),
) -> Option<EnclosedValue> {
    let whole_s = seen.time_s - before.time_s;
    let over = Interval { from_s: before.time_s.max(window.from_s), to_s: seen.time_s.min(window.to_s) };
    let place = |time_s: f64| before.position_m.lerp(&seen.position_m, (time_s - before.time_s) / whole_s);
    let from = if over.from_s > before.time_s { place(over.from_s) } else { before.position_m };
    let to = if over.to_s < seen.time_s { place(over.to_s) } else { seen.position_m };
    let deviation_m = bound_m_s2 * whole_s * whole_s / 8.0;
    let (first, second, drawn) = match fence.filter(|_| limit.quantity == Quantity::Fence) {
        None => {
            let ends = [from, to].map(|here| limit.quantity.of(here));
            (ends[0], ends[1], ends[0].max(ends[1]))
        }
        Some(fence) => {
            let drawn = -fence.clearance_margin_m(from, to);
            // The end matters only where the value is worse than the worst known value.
            let [first, second] = if deviation_m == 0.0 && drawn <= known.min(limit.bound()) {
                [drawn; 2]
            } else {
                [from, to].map(|here| -fence.clearance_margin_m(here, here))
            };
            (first, second, drawn)
        }
    };
    let is_seen = |time_s: f64| time_s == before.time_s || time_s == seen.time_s;
    let ends = [(over.from_s, first), (over.to_s, second)].into_iter().filter(|&(time_s, _)| is_seen(time_s));
    let lower = if deviation_m == 0.0 { drawn } else { ends.map(|(_, value)| value).fold(f64::NEG_INFINITY, f64::max) };
    let fraction = if second > first { 1.0 } else { 0.0 };
    (over.from_s <= over.to_s).then_some((over, Enclosure { lower, upper: drawn + deviation_m, at: fraction }))
}

/// Encloses speeds between two samples from the mean velocity, the recorded velocities, and the bound on acceleration.
fn speed_between(
    limit: Limit,
    window: Interval,
    (before, seen): (&Sample, &Sample),
    mean: Vector3<f64>,
    bound_m_s2: f64,
) -> Option<EnclosedValue> {
    let over = Interval { from_s: before.time_s.max(window.from_s), to_s: seen.time_s.min(window.to_s) };
    let recorded = |sample: &Sample| {
        let in_window = window.from_s <= sample.time_s && sample.time_s <= window.to_s;
        sample.velocity_m_s.filter(|_| in_window).map(|velocity| limit.quantity.of(velocity))
    };
    let (start, end) = (recorded(before), recorded(seen));
    let added = bound_m_s2 * (seen.time_s - before.time_s);
    // The rounding of positions counts as no speed.
    let drawn = limit.quantity.of(mean) - 2.0 * rounding_m(before, seen) / (seen.time_s - before.time_s);
    let drawn = if over.from_s < over.to_s { drawn } else { f64::NEG_INFINITY };
    let is_whole = over.from_s == before.time_s && over.to_s == seen.time_s;
    let of_mean = if is_whole || bound_m_s2 == 0.0 { drawn } else { f64::NEG_INFINITY };
    let largest_recorded = start.into_iter().chain(end).fold(f64::NEG_INFINITY, f64::max);
    let lower = of_mean.max(largest_recorded);
    let by_ends = start.zip(end).map_or(f64::INFINITY, |(start, end)| 0.5 * (start + end + added));
    let upper = if bound_m_s2 == 0.0 { lower } else { lower.max((drawn + 0.5 * added).min(by_ends)) };
    let fraction = if end == Some(lower) { 1.0 } else { 0.0 };
    let is_observed = over.from_s < over.to_s || (over.from_s == over.to_s && largest_recorded.is_finite());
    is_observed.then_some((over, Enclosure { lower, upper, at: fraction }))
}

/// Returns a bound on the rounding of the positions of two samples \[m\].
fn rounding_m(before: &Sample, seen: &Sample) -> f64 {
    f64::EPSILON * before.position_m.amax().max(seen.position_m.amax())
}

/// Encloses the largest distance of a curve outside the fence.
fn outside(fence: &MonitoredFence, part: &[Vector3<f64>], goal: Precision) -> Enclosure {
    largest(part, goal, |part, _| {
        let (from, to) = (part[0], value(part, 1.0));
        [
            -fence.clearance_margin_m(from, from),
            -fence.clearance_margin_m(to, to),
            chord_deviation(part) - fence.clearance_margin_m(from, to),
        ]
    })
}

/// Findings for a limit so far.
#[derive(Clone, Debug)]
pub(super) struct LimitRecord {
    pub(super) limit: Limit,
    extreme: Option<Exceedance>,
    violations: ExceedanceIntervals,
    undecided: ExceedanceIntervals,
    /// Whether any value is known, for each vehicle.
    observed: Vec<bool>,
    /// Assumption about the quantity.
    pub(super) assumes: Option<Fact>,
    /// Corners at which a velocity jumps; these are not compared with the limit.
    corners: Option<Corners>,
}

impl LimitRecord {
    pub(super) fn new(limit: Limit) -> Self {
        let (violations, undecided) = (ExceedanceIntervals::default(), ExceedanceIntervals::default());
        Self { limit, extreme: None, violations, undecided, observed: Vec::new(), assumes: None, corners: None }
    }

    /// Returns the worst known value.
    pub(super) fn known(&self) -> f64 {
        self.extreme.map_or(f64::NEG_INFINITY, |extreme| extreme.lower)
    }

    fn observe(&mut self, vehicle: usize) {
        if self.observed.len() <= vehicle {
            self.observed.resize(vehicle + 1, false);
        }
        self.observed[vehicle] = true;
    }

    pub(super) fn note(&mut self, vehicle: usize, found: Option<EnclosedValue>) {
        let Some((over, Enclosure { lower, upper, at: fraction })) = found else { return };
        self.observe(vehicle);
        let at_s = over.from_s + fraction * (over.to_s - over.from_s);
        let found = Exceedance { vehicle, from_s: over.from_s, to_s: over.to_s, lower, upper, at_s };
        let bound = self.limit.bound();
        if lower > bound {
            self.violations.add(found);
        } else if upper > bound {
            self.undecided.add(found);
        }
        let extreme = self.extreme.get_or_insert(found);
        if found.lower > extreme.lower {
            *extreme = Exceedance { upper: extreme.upper.max(upper), ..found };
        } else {
            extreme.upper = extreme.upper.max(upper);
        }
    }

    /// Records a corner at which the velocity jumps \[m/s\].
    pub(super) fn note_corner(&mut self, vehicle: usize, at_s: f64, by_m_s: f64) {
        let corner = Corner { vehicle, at_s, by_m_s };
        let corners = self.corners.get_or_insert(Corners { count: 0, largest: corner });
        corners.count += 1;
        if by_m_s > corners.largest.by_m_s {
            corners.largest = corner;
        }
    }

    pub(super) fn finish(self, judged: &[bool], is_whole: bool) -> LimitOutcome {
        let Self { limit, extreme, violations, undecided, observed, assumes, corners } = self;
        let is_observed = |vehicle: usize| observed.get(vehicle).copied().unwrap_or(false);
        let unknown: Vec<_> = judged
            .iter()
            .enumerate()
            .filter(|&(vehicle, &is_judged)| is_judged && !is_observed(vehicle))
            .map(|(k, _)| k)
            .collect();
        let signed = |exceedance: Exceedance| {
            let (lower, upper) = if limit.quantity.is_least() {
                (-exceedance.upper, -exceedance.lower)
            } else {
                (exceedance.lower, exceedance.upper)
            };
            Exceedance { lower, upper, ..exceedance }
        };
        let listed = |times: ExceedanceIntervals| {
            let (list, tally) = times.finish();
            (list.into_iter().map(signed).collect::<Vec<_>>(), tally)
        };
        let ((violations, violations_tally), (undecided, undecided_tally)) = (listed(violations), listed(undecided));
        // Without horizontal motion no height counts.
        let has_value = extreme.is_some() || limit.quantity == Quantity::NavigationFloor;
        let decided = is_whole && undecided.is_empty() && unknown.is_empty() && has_value;
        LimitOutcome {
            status: Status::new(!violations.is_empty(), decided),
            extreme: extreme.map(signed),
            violations,
            undecided,
            violations_tally,
            undecided_tally,
            unknown,
            assumes,
            corners,
            limit,
        }
    }
}

/// Intervals of vehicles, merged where they touch. All are counted; the worst and the first of each vehicle are kept.
#[derive(Clone, Debug)]
struct ExceedanceIntervals {
    /// Last interval of each vehicle, which may be extended.
    open: Vec<Option<Exceedance>>,
    ended: Shortlist<Exceedance>,
    count: u64,
}

impl ExceedanceIntervals {
    fn add(&mut self, found: Exceedance) {
        if self.open.len() <= found.vehicle {
            self.open.resize(found.vehicle + 1, None);
        }
        let last = &mut self.open[found.vehicle];
        if let Some(previous) = last.as_mut().filter(|previous| previous.to_s >= found.from_s) {
            previous.to_s = previous.to_s.max(found.to_s);
            previous.upper = previous.upper.max(found.upper);
            if found.lower > previous.lower {
                (previous.lower, previous.at_s) = (found.lower, found.at_s);
            }
        } else {
            self.count += 1;
            self.ended.extend(last.replace(found));
        }
    }

    /// Returns the kept intervals in order of time, and their number.
    fn finish(mut self) -> (Vec<Exceedance>, Tally) {
        self.ended.extend(self.open.into_iter().flatten());
        let list = self.ended.into_list();
        let tally = Tally { count: self.count, listed: list.len(), is_exact: true };
        (list, tally)
    }
}

impl Default for ExceedanceIntervals {
    fn default() -> Self {
        Self { open: Vec::new(), ended: Shortlist::new(LISTED), count: 0 }
    }
}

impl Finding for Exceedance {
    type Subject = usize;

    fn subject(&self) -> usize {
        self.vehicle
    }

    fn span_s(&self) -> [f64; 2] {
        [self.from_s, self.to_s]
    }

    /// Returns the certain excess, or the possible one if none is certain.
    fn excess(&self) -> f64 {
        if self.lower == f64::NEG_INFINITY { self.upper } else { self.lower }
    }
}
