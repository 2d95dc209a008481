//! Comparison of a recorded flight with its plan: the largest distance of each vehicle from its planned curve.
//!
//! The distance is bounded at every instant at which both are known, between the samples too. The difference of two
//! curves is a polynomial, enclosed by Bernstein coefficients. A bound on the motion between samples is added.
//!
//! Let p and q be the flown and the planned positions, and e the largest distance of a vehicle from its plan. If the
//! plan keeps the separation L + e + e' of a pair, the flight keeps L:
//!
//! ```text
//! |p - p'| >= |q - q'| - |p - q| - |p' - q'|
//! ```

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::outcome::Outcome;
use super::settings::{RecordedError, Settings, VehicleSettings};
use super::vehicle::Vehicle;
use crate::enclosure::{Search, Target};
use crate::outcome::Status;
use crate::pair_sweep::overlaps;
use crate::segment::Segment;
use crate::sweep::Interval;
use tautline_core::track::Item;

/// Largest delay that is tried \[s\].
const MOST_DELAY_S: f64 = 60.0;
/// Interval between two delays that are tried \[s\].
const DELAY_STEP_S: f64 = 0.05;
/// Width to which the interval around the best delay is narrowed \[s\].
const DELAY_WIDTH_S: f64 = 1e-7;
/// Largest number of positions by which the delay is estimated.
const MOST_POSITIONS: usize = 2000;
/// Number of instants of a curve among these positions, before thinning.
const INSTANTS_OF_A_CURVE: usize = 16;
/// Largest number of instants of a vehicle that are kept for a figure.
const MOST_INSTANTS: usize = 1024;
/// Number of parts of a curve between which it is sampled for a figure.
const PARTS_OF_A_CURVE: u32 = 4;
/// Shortest unknown time at an end of the window that counts \[s\].
const SHORTEST_UNKNOWN_S: f64 = 1e-6;
/// Least common time of flight and plan to which a verdict may be limited, as a share of the shorter of both.
const LEAST_COMMON: f64 = 0.5;
/// Relative excess that covers the rounding of summed deviations.
const ROUNDING: f64 = 1e-12;

/// Largest distance of a vehicle from its plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Deviation {
    /// Index of the vehicle in the flight.
    pub vehicle: usize,
    /// Upper bound of the distance over the shared time \[m\].
    pub upper_m: f64,
    /// Distance that is certainly reached \[m\].
    pub lower_m: f64,
    /// Time of the largest distance of the drawn motion \[s\], on the clock of the flight.
    pub at_s: f64,
    /// Root of the mean squared distance at the samples \[m\].
    pub rms_m: f64,
    /// Distance over time: time \[s\], distance \[m\] and its bound beyond the drawn motion \[m\]. NaN breaks the line.
    pub series: Vec<(f64, f64, f64)>,
}

/// Time in which the distance of a vehicle from its plan is not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unknown {
    /// Index of the vehicle in the flight.
    pub vehicle: usize,
    /// Start \[s\].
    pub from_s: f64,
    /// End \[s\].
    pub to_s: f64,
    /// Whether the flight is present, but not the plan.
    pub is_flown: bool,
}

/// Result of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanFindings {
    /// Verdict: clear if every distance is known and, with a tube, within the tube.
    pub status: Status,
    /// Time of the flight at which the plan has time 0 \[s\].
    pub delay_s: f64,
    /// Range of delays of the search \[s\]; `None` if the delay was given.
    pub searched_s: Option<(f64, f64)>,
    /// Allowed distance \[m\], if given.
    pub tube_m: Option<f64>,
    /// Whether the plan has curves. The samples of another plan are joined by straight lines.
    pub has_curves: bool,
    /// Distances of the vehicles, by index. A vehicle without shared time has none.
    pub deviations: Vec<Deviation>,
    /// Time to which the verdict is limited \[s\]: with an estimated delay, the common time of the flight as a whole
    /// and the plan as a whole. `None` if the verdict covers the whole window.
    pub common_s: Option<(f64, f64)>,
    /// Times in which a distance is not known, by vehicle.
    pub unknown: Vec<Unknown>,
}

impl PlanFindings {
    /// Returns the settings with which the plan is audited. Its limit for a pair is that of the flight plus the
    /// distances of both from the plan, or twice the tube. `None` if nothing follows for the flight: there is no limit,
    /// lengths are scaled, a distance is unknown, or a vehicle may have left the tube.
    ///
    /// `names` are those of the flight, and `shift_s` is added to the times of the plan.
    #[must_use]
    pub fn settings_of_plan(&self, settings: &Settings, names: &[String], shift_s: f64) -> Option<Settings> {
        let is_in_metres = settings.ellipsoid_m.is_none() && settings.cylinder.is_none();
        let is_limited = settings.delta_m.is_some() && is_in_metres;
        if !is_limited || self.status != Status::Clear {
            return None;
        }
        let mut vehicles = BTreeMap::new();
        for deviation in &self.deviations {
            let name = names.get(deviation.vehicle)?;
            let given =
                settings.vehicles.get(name).and_then(|vehicle| vehicle.radius_m).or(settings.radius_m).unwrap_or(0.0);
            let half = (0.5 * settings.delta_m.unwrap_or(0.0)).max(given);
            let apart = self.tube_m.unwrap_or(deviation.upper_m);
            let radius_m = Some((half + apart) * (1.0 + ROUNDING));
            vehicles.insert(name.clone(), VehicleSettings { radius_m, offset_s: shift_s, max_accel_m_s2: None });
        }
        let only = Some(vehicles.keys().cloned().collect());
        let (from_s, until_s) =
            self.common_s.map_or((settings.from_s, settings.until_s), |span_s| (Some(span_s.0), Some(span_s.1)));
        // A flight above the ground is planned above it, less the largest distance.
        let most_m =
            self.deviations.iter().map(|deviation| deviation.upper_m).fold(self.tube_m.unwrap_or(0.0), f64::max);
        let above_m = settings.above_m.map(|above_m| above_m - most_m * (1.0 + ROUNDING) - ROUNDING * above_m.abs());
        let max_gap_s = (!self.has_curves).then_some(f64::INFINITY);
        Some(Settings { from_s, until_s, above_m, max_gap_s, vehicles, only, ..Settings::default() })
    }
}

/// Compares a flight with a plan. Both are held in memory.
#[derive(Clone, Debug)]
pub struct PlanComparison {
    settings: Settings,
    flight: Vec<Vehicle>,
    /// Names of the plan's vehicles, and their items in order of time.
    plan: Vec<(String, Vec<Item>)>,
}

impl PlanComparison {
    /// Creates the comparison of a flight that was audited with these settings and this outcome.
    #[must_use]
    pub fn new(settings: &Settings, outcome: &Outcome) -> Self {
        // Distances from a plan are in metres and count on the ground too.
        let settings = Settings { ellipsoid_m: None, above_m: None, ..settings.clone() };
        let gaps_s = outcome.vehicles.iter().zip(&outcome.max_gaps_s);
        let flight = gaps_s.map(|(name, &max_gap_s)| Vehicle::new(name, &settings, max_gap_s)).collect();
        Self { settings, flight, plan: Vec::new() }
    }

    /// Adds the next items of the flight.
    ///
    /// # Errors
    /// [`RecordedError`] if an item is invalid.
    pub fn push_flight(&mut self, items: &[Item]) -> Result<(), RecordedError> {
        for item in items {
            if let Some(vehicle) = self.flight.get_mut(item.vehicle()).filter(|vehicle| vehicle.is_selected) {
                vehicle.take(item)?;
            }
        }
        Ok(())
    }

    /// Adds the next items of the plan; `names` are those of its vehicles known so far.
    pub fn push_plan(&mut self, names: &[String], items: Vec<Item>) {
        for name in names.iter().skip(self.plan.len()) {
            self.plan.push((name.clone(), Vec::new()));
        }
        for item in items {
            if let Some((_, of_vehicle)) = self.plan.get_mut(item.vehicle()) {
                of_vehicle.push(item);
            }
        }
    }

    /// Returns the selected vehicles of the flight, and those of the plan.
    #[must_use]
    pub fn names(&self) -> [Vec<&str>; 2] {
        let is_selected = |name: &str| self.settings.only.as_ref().is_none_or(|only| only.contains(name));
        let flown = self.flight.iter().map(|vehicle| vehicle.name.as_str()).filter(|name| is_selected(name));
        [flown.collect(), self.plan.iter().map(|(name, _)| name.as_str()).filter(|name| is_selected(name)).collect()]
    }

    /// Returns the distances. `delay_s` is added to the times of the plan, and `shift_s`, the difference of the epochs.
    /// `None` estimates the delay. Of the delays within a minute, it takes the one of least mean squared distance at
    /// the samples, and of several the smallest. Beyond its ends a plan counts as standing for this estimate alone.
    ///
    /// An estimated delay moves the ends of the plan away from those of the flight, by at most the delay and a mean
    /// sampling interval. The verdict is then limited to the common time of the flight as a whole, from its first to
    /// its last sample, and the plan as a whole. It is not limited if an end differs by more, or if the common time is
    /// below half of flight and plan. A vehicle that vanishes in the common time is unknown.
    ///
    /// # Errors
    /// [`RecordedError`] if an item of the plan is invalid.
    pub fn finish(
        self,
        shift_s: f64,
        delay_s: Option<f64>,
        tube_m: Option<f64>,
    ) -> Result<PlanFindings, RecordedError> {
        let is_estimated = delay_s.is_none();
        let delay_s = match delay_s {
            Some(delay_s) => delay_s,
            None => self.estimated_delay(shift_s)?,
        };
        let plan = self.planned(shift_s + delay_s, self.settings.from_s, self.settings.until_s)?;
        let (mut deviations, mut unknown) = (Vec::new(), Vec::new());
        for (index, vehicle) in self.flight.iter().enumerate() {
            let Some(planned) = plan.get(&vehicle.name).filter(|_| vehicle.is_selected) else { continue };
            deviations.extend(deviation(index, &vehicle.segments, planned));
            let shortest_s = vehicle.mean_interval_s().max(SHORTEST_UNKNOWN_S);
            unknown.extend(unknown_times(index, &vehicle.segments, planned, shortest_s));
        }
        let common_s = if is_estimated { self.common_time(&plan, delay_s) } else { None }.filter(|common_s| {
            let within: Vec<_> = unknown.iter().filter_map(|unknown| self.unknown_within(unknown, *common_s)).collect();
            let is_limited = within != unknown;
            unknown = within;
            is_limited
        });
        let known = deviations.len() == self.flight.iter().filter(|vehicle| vehicle.is_selected).count();
        let has_left = |deviation: &Deviation| tube_m.is_some_and(|tube_m| deviation.lower_m > tube_m);
        let is_within = |deviation: &Deviation| tube_m.is_none_or(|tube_m| deviation.upper_m <= tube_m);
        let is_decided = known && !deviations.is_empty() && unknown.is_empty() && deviations.iter().all(is_within);
        let searched_s = is_estimated.then_some((-MOST_DELAY_S, MOST_DELAY_S));
        let status = Status::new(deviations.iter().any(has_left), is_decided);
        let has_curves = self.plan.iter().flat_map(|(_, items)| items).all(|item| matches!(item, Item::Piece(_)));
        Ok(PlanFindings { status, delay_s, searched_s, tube_m, has_curves, deviations, common_s, unknown })
    }

    /// Returns the segments of the plan, with times later by `offset_s`, within a window.
    fn planned(
        &self,
        offset_s: f64,
        from_s: Option<f64>,
        until_s: Option<f64>,
    ) -> Result<BTreeMap<String, Vec<Segment>>, RecordedError> {
        let of_vehicle = |(name, items): &(String, Vec<Item>)| {
            let own = VehicleSettings { offset_s, ..VehicleSettings::default() };
            let settings = Settings { vehicles: [(name.clone(), own)].into(), from_s, until_s, ..Settings::default() };
            // Samples of a plan are joined by straight lines, however far apart they are.
            let is_curve = items.iter().all(|item| matches!(item, Item::Piece(_)));
            let mut vehicle = Vehicle::new(name, &settings, if is_curve { 0.0 } else { f64::INFINITY });
            for item in items {
                vehicle.take(item)?;
            }
            Ok((name.clone(), vehicle.segments))
        };
        self.plan.iter().map(of_vehicle).collect()
    }

    /// Returns the common time of the flight as a whole and the plan as a whole; an end of the window that is given
    /// stays. `None` if another end differs by more than the delay and a sampling interval, or if the common time is
    /// below [`LEAST_COMMON`] of the flight and of the plan.
    fn common_time(&self, plan: &BTreeMap<String, Vec<Segment>>, delay_s: f64) -> Option<(f64, f64)> {
        let ends = |segments: &[Segment]| Some((segments.first()?.from_s, segments.last()?.to_s));
        let (mut flown, mut planned, mut interval_s) = (Vec::new(), Vec::new(), 0.0_f64);
        for vehicle in self.flight.iter().filter(|vehicle| vehicle.is_selected) {
            flown.push(ends(&vehicle.segments)?);
            planned.push(ends(plan.get(&vehicle.name)?)?);
            interval_s = interval_s.max(vehicle.mean_interval_s());
        }
        let whole = |spans: &[(f64, f64)]| {
            let from_s = spans.iter().map(|span| span.0).fold(f64::INFINITY, f64::min);
            (from_s, spans.iter().map(|span| span.1).fold(f64::NEG_INFINITY, f64::max))
        };
        let (flown, planned) = (whole(&flown), whole(&planned));
        let most_s = delay_s.abs() + interval_s.max(SHORTEST_UNKNOWN_S);
        let is_explained = |given: Option<f64>, apart_s: f64| given.is_some() || apart_s.abs() <= most_s;
        let is_explained = is_explained(self.settings.from_s, flown.0 - planned.0)
            && is_explained(self.settings.until_s, flown.1 - planned.1);
        let from_s = self.settings.from_s.unwrap_or(flown.0.max(planned.0));
        let to_s = self.settings.until_s.unwrap_or(flown.1.min(planned.1));
        let least_s = LEAST_COMMON * (flown.1 - flown.0).min(planned.1 - planned.0);
        (is_explained && to_s > from_s && to_s - from_s >= least_s).then_some((from_s, to_s))
    }

    /// Returns the part of an unknown time within the common time. At its ends, a planned time shorter than a sampling
    /// interval does not count, because the vehicles of a flight are rarely sampled at the same instants.
    fn unknown_within(&self, unknown: &Unknown, (from_s, to_s): (f64, f64)) -> Option<Unknown> {
        let part = Unknown { from_s: unknown.from_s.max(from_s), to_s: unknown.to_s.min(to_s), ..*unknown };
        let is_at_end = part.from_s == from_s || part.to_s == to_s;
        let interval_s =
            if unknown.is_flown || !is_at_end { 0.0 } else { self.flight[unknown.vehicle].mean_interval_s() };
        let shortest_s = if is_at_end { interval_s.max(SHORTEST_UNKNOWN_S) } else { 0.0 };
        (part.to_s > part.from_s && part.to_s - part.from_s >= shortest_s).then_some(part)
    }

    fn estimated_delay(&self, shift_s: f64) -> Result<f64, RecordedError> {
        let plan = self.planned(shift_s, None, None)?;
        // Starts of straight segments are samples; curves have several instants each.
        let parts = |segment: &Segment| match segment.curve() {
            _ if segment.jumps() => 0,
            Some(curve) if curve.coefficients.len() > 2 => INSTANTS_OF_A_CURVE,
            _ => 1,
        };
        let count: usize = self.flight.iter().flat_map(|vehicle| &vehicle.segments).map(parts).sum();
        let stride = count.div_ceil(MOST_POSITIONS).max(1);
        let mut positions: Vec<(&[Segment], f64, Vector3<f64>)> = Vec::new();
        for vehicle in &self.flight {
            let Some(planned) = plan.get(&vehicle.name).filter(|planned| !planned.is_empty()) else { continue };
            let instants = vehicle.segments.iter().flat_map(|segment| {
                let parts = parts(segment);
                let time_s = move |k: usize| segment.from_s + (segment.to_s - segment.from_s) * k as f64 / parts as f64;
                (0..parts).map(move |k| (segment, time_s(k)))
            });
            let instants = instants.step_by(stride);
            positions.extend(instants.map(|(segment, time_s)| (&planned[..], time_s, segment.position(time_s))));
        }
        let cost = |delay_s: f64| {
            positions
                .iter()
                .map(|(planned, time_s, position_m)| {
                    (position_at(planned, time_s - delay_s) - position_m).norm_squared()
                })
                .sum()
        };
        Ok(best_delay(cost))
    }
}

/// Returns the delay of least cost within [`MOST_DELAY_S`], the smallest of several.
fn best_delay(cost: impl Fn(f64) -> f64) -> f64 {
    let (mut best_s, mut least) = (0.0, cost(0.0));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small constant")]
    let steps = (MOST_DELAY_S / DELAY_STEP_S).round() as u32;
    for delay_s in (1..=steps).flat_map(|k| [1.0, -1.0].map(|sign| sign * f64::from(k) * DELAY_STEP_S)) {
        let found = cost(delay_s);
        if found < least {
            (best_s, least) = (delay_s, found);
        }
    }
    // Golden section between the neighbours of the best delay.
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut from_s, mut to_s) = (best_s - DELAY_STEP_S, best_s + DELAY_STEP_S);
    let mut inner = [to_s - ratio * (to_s - from_s), from_s + ratio * (to_s - from_s)];
    let mut costs = inner.map(&cost);
    while to_s - from_s > DELAY_WIDTH_S {
        if costs[0] <= costs[1] {
            to_s = inner[1];
            inner = [to_s - ratio * (to_s - from_s), inner[0]];
            costs = [cost(inner[0]), costs[0]];
        } else {
            from_s = inner[0];
            inner = [inner[1], from_s + ratio * (to_s - from_s)];
            costs = [costs[1], cost(inner[1])];
        }
    }
    let middle_s = f64::midpoint(from_s, to_s);
    if cost(middle_s) < least { middle_s } else { best_s }
}

/// Returns the position on segments in order of time, or that of the nearest end; there is at least one segment.
fn position_at(segments: &[Segment], time_s: f64) -> Vector3<f64> {
    let after = segments.partition_point(|segment| segment.to_s < time_s);
    segments[after.min(segments.len() - 1)].position(time_s)
}

/// Returns the largest distance between the segments of a vehicle and those of its plan; `None` without shared time.
fn deviation(vehicle: usize, flown: &[Segment], planned: &[Segment]) -> Option<Deviation> {
    let (mut largest, mut drawn_m) = (None::<Deviation>, f64::NEG_INFINITY);
    let (mut series, mut squares, mut count, mut known_s) = (Series::default(), 0.0, 0_u64, f64::NEG_INFINITY);
    overlaps(flown, planned, |overlap| {
        let Interval { from_s, to_s } = overlap.interval;
        let (first, second) = (overlap.first, overlap.second);
        let found = largest.get_or_insert_with(|| Deviation {
            vehicle,
            upper_m: 0.0,
            lower_m: 0.0,
            at_s: from_s,
            rms_m: 0.0,
            series: Vec::new(),
        });
        let over = Interval { from_s, to_s };
        let relative = if from_s < to_s || first.jumps() || second.jumps() {
            difference(first.local_within(over), second.local_within(over))
        } else {
            vec![first.position(from_s) - second.position(from_s)]
        };
        let (bound_m, rounding_m) = (first.deviation(), first.rounding() + second.rounding());
        let mut search = Search::new(Target::Origin, &relative);
        let most = search.maximum((found.upper_m - bound_m - rounding_m).max(0.0));
        found.upper_m = found.upper_m.max((most.upper + bound_m + rounding_m).next_up());
        let at_s = from_s + (to_s - from_s) * most.at;
        for (u, time_s) in [(0.0, from_s), (most.at, at_s), (1.0, to_s)] {
            let certain_m = search.distance(u) - first.deviation_at(time_s) - rounding_m;
            found.lower_m = found.lower_m.max(certain_m);
        }
        if most.lower > drawn_m {
            (drawn_m, found.at_s) = (most.lower, at_s);
        }
        let start_m = search.distance(0.0);
        (squares, count) = (squares + start_m * start_m, count + 1);
        if from_s > known_s && known_s.is_finite() {
            series.push((from_s, f64::NAN, 0.0));
        }
        known_s = known_s.max(to_s);
        let parts = if relative.len() > 2 { PARTS_OF_A_CURVE } else { 1 };
        for k in 0..=parts {
            let u = f64::from(k) / f64::from(parts);
            let time_s = from_s + (to_s - from_s) * u;
            series.push((time_s, search.distance(u), first.deviation_at(time_s)));
        }
        if most.at > 0.0 && most.at < 1.0 {
            series.push((at_s, most.lower, first.deviation_at(at_s)));
        }
    });
    let found = largest?;
    Some(Deviation { rms_m: (squares / count.max(1) as f64).sqrt(), series: series.finish(), ..found })
}

/// Returns the difference of two polynomials.
fn difference(mut first: Vec<Vector3<f64>>, second: Vec<Vector3<f64>>) -> Vec<Vector3<f64>> {
    first.resize(first.len().max(second.len()), Vector3::zeros());
    for (a, b) in first.iter_mut().zip(second) {
        *a -= b;
    }
    first
}

/// Points of a line over time, at most [`MOST_INSTANTS`]; of several neighbours the largest is kept.
#[derive(Default)]
struct Series(Vec<(f64, f64, f64)>);

impl Series {
    fn push(&mut self, point: (f64, f64, f64)) {
        self.0.push(point);
        if self.0.len() >= 16 * MOST_INSTANTS {
            self.thin(4 * MOST_INSTANTS);
        }
    }

    fn thin(&mut self, most: usize) {
        self.0.sort_by(|a, b| a.0.total_cmp(&b.0));
        let width = self.0.len().div_ceil(most);
        let kept = |points: &[(f64, f64, f64)]| {
            let is_gap = points.iter().find(|point| point.1.is_nan());
            let largest = points.iter().max_by(|a, b| (a.1 + a.2).total_cmp(&(b.1 + b.2)));
            is_gap.or(largest).copied()
        };
        self.0 = self.0.chunks(width).filter_map(kept).collect();
    }

    fn finish(mut self) -> Vec<(f64, f64, f64)> {
        self.thin(MOST_INSTANTS);
        self.0
    }
}

/// Returns the times in which only one of two is present. At either end of both, a planned time shorter than
/// `shortest_s` does not count, because samples rarely begin and end with the plan.
fn unknown_times(vehicle: usize, flown: &[Segment], planned: &[Segment], shortest_s: f64) -> Vec<Unknown> {
    let (flown, planned) = (runs(flown), runs(planned));
    let mut ends_s: Vec<f64> = flown.iter().chain(&planned).flat_map(|run| [run.from_s, run.to_s]).collect();
    ends_s.sort_unstable_by(f64::total_cmp);
    ends_s.dedup();
    let (first_s, last_s) = (ends_s.first().copied(), ends_s.last().copied());
    let is_in = |runs: &[Interval], time_s: f64| {
        let after = runs.partition_point(|run| run.to_s < time_s);
        runs.get(after).is_some_and(|run| run.from_s <= time_s)
    };
    let mut found: Vec<Unknown> = Vec::new();
    for pair in ends_s.windows(2) {
        let middle_s = f64::midpoint(pair[0], pair[1]);
        let (is_flown, is_planned) = (is_in(&flown, middle_s), is_in(&planned, middle_s));
        if is_flown == is_planned {
            continue;
        }
        match found.last_mut().filter(|last| last.to_s == pair[0] && last.is_flown == is_flown) {
            Some(last) => last.to_s = pair[1],
            None => found.push(Unknown { vehicle, from_s: pair[0], to_s: pair[1], is_flown }),
        }
    }
    found.retain(|finding| {
        let is_at_end = Some(finding.from_s) == first_s || Some(finding.to_s) == last_s;
        let allowed_s = if finding.is_flown { SHORTEST_UNKNOWN_S } else { shortest_s };
        !is_at_end || finding.to_s - finding.from_s >= allowed_s
    });
    found
}

/// Returns the uninterrupted intervals of segments in order of time.
fn runs(segments: &[Segment]) -> Vec<Interval> {
    let mut runs: Vec<Interval> = Vec::new();
    for segment in segments {
        match runs.last_mut().filter(|run| segment.from_s <= run.to_s) {
            Some(run) => run.to_s = run.to_s.max(segment.to_s),
            None => runs.push(Interval { from_s: segment.from_s, to_s: segment.to_s }),
        }
    }
    runs
}

impl Segment {
    /// Returns the segment as a polynomial of the fraction of an interval within it; a constant for an instant of a
    /// longer segment.
    fn local_within(&self, over: Interval) -> Vec<Vector3<f64>> {
        if over.to_s <= over.from_s && self.from_s < self.to_s {
            return vec![self.position(over.from_s)];
        }
        self.local(over)
    }
}
