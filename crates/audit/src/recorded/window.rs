//! Selection of the pairs to sweep in a window of time.
//!
//! Over the window every vehicle is near its chord: the uniform motion between its positions at both ends. Its
//! deviation is the largest distance of its corners from the chord at the same time. Two vehicles are at least as far
//! apart as their chords, less both deviations. This is one closed form for a whole window, and equally sharp for
//! swarms at rest and in common motion. Sort and sweep along the longest axis finds the pairs to compare. A window with
//! too many remaining pairs is halved.

use std::collections::BTreeSet;
use std::mem;
use std::ops::Range;

use nalgebra::Vector3;

use super::settings::Limits;
use super::vehicle::Vehicle;
use crate::cross_check::KeepOut;
use crate::cylinder::Cylinder;
use crate::enclosure::Target;
use crate::ledger::{MAX_KEPT, Results};
use crate::obstacle::{self, MovingObstacle};
use crate::outcome::ObjectPair;
use crate::pair_sweep::PairSweep;
use crate::polynomial::motion_deviation;
use crate::segment::Segment;
use crate::sweep::{Interval, RelativeMotion, larger};
use tautline_core::swarm::Pair;

/// Number of remaining pairs per vehicle above which a window is halved.
const PAIRS_PER_VEHICLE: usize = 4;
/// Number of listed pairs in a window that is not halved above which they are swept before others are collected.
const MAX_LISTED: usize = 1 << 20;
/// Smallest number of segments per vehicle in a window that is halved, unless the window has curves.
const MIN_SEGMENTS: usize = 4;
/// Largest number of times that a window is halved.
const MAX_HALVINGS: u32 = 12;
/// Number of neighbours in sort order that are compared first, for a rough bound of the closest pairs.
const FIRST_NEIGHBOURS: u32 = 12;
/// Rounding of a distance from a chord, and of the distance of two chords, relative to their coordinates: at most
/// sixteen operations.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Bounds of the positions of a vehicle over a window.
#[derive(Clone, Debug)]
struct Extent {
    low: Vector3<f64>,
    high: Vector3<f64>,
    chord: Chord,
    radius: f64,
    grounded: bool,
    vehicle: usize,
    segments: Range<usize>,
}

/// Selects and sweeps the pairs of a recording, window after window; reuses its memory.
#[derive(Clone, Debug)]
pub(super) struct Windows {
    limits: Limits,
    /// Whether distances are compared with the limits. If not, only the closest pairs are found.
    judges: bool,
    obstacles: Vec<JudgedObstacle>,
    extents: Vec<Extent>,
    /// Axis of the sort, which is the first axis of the extents.
    axis: usize,
    near: Vec<ExtentPair>,
    /// Number of these pairs whose chords are too far apart, so that only the deviations keep them.
    by_deviation: usize,
}

/// Obstacle with its path.
#[derive(Clone, Debug)]
struct JudgedObstacle {
    obstacle: MovingObstacle,
    path: Vec<Segment>,
    /// Whether vehicles land on the obstacle, which exempts it while they are on the ground.
    is_landed_on: bool,
}

/// Pair of extents with the smallest distance of their chords, which is scaled with a cylinder.
#[derive(Clone, Copy, Debug)]
struct ExtentPair {
    first: u32,
    second: u32,
    /// Smallest squared distance of the chords.
    squared: f64,
    /// Sum of both deviations.
    motion_deviation: f64,
}

impl ExtentPair {
    #[inline]
    fn new(extents: &[Extent], first: u32, second: u32, cylinder: Option<&Cylinder>) -> Self {
        let (a, b) = (&extents[first as usize].chord, &extents[second as usize].chord);
        let motion = RelativeMotion::new(b.from - a.from, b.to - a.to);
        let motion_deviation = a.motion_deviation + b.motion_deviation;
        match cylinder {
            None => Self { first, second, squared: motion.closest().squared, motion_deviation },
            Some(cylinder) => {
                let squared = cylinder.lower_bound(&motion).powi(2);
                Self { first, second, squared, motion_deviation: motion_deviation * cylinder.per_metre() }
            }
        }
    }

    /// Returns whether the two could come closer than a distance. The deviations include the rounding of positions.
    #[inline]
    fn may_come_within(&self, distance: f64) -> bool {
        let reach = (distance + self.motion_deviation) * (1.0 + ROUNDING);
        self.squared < reach * reach
    }
}

impl Windows {
    /// Returns windows that judge separations, and distances from obstacles; vehicles land on those in `land_on`.
    pub(super) fn new(limits: Limits, obstacles: &[MovingObstacle], land_on: &BTreeSet<String>) -> Self {
        let judged = |obstacle: &MovingObstacle| {
            let is_landed_on = land_on.contains(&obstacle.name);
            // A pair is skipped if both objects are on the ground.
            let placed = |part| Segment { grounded: Some(is_landed_on), ..part };
            let path = obstacle.segments().into_iter().map(placed).collect();
            JudgedObstacle { obstacle: obstacle.clone(), path, is_landed_on }
        };
        let obstacles = obstacles.iter().map(judged).collect();
        Self { limits, judges: true, obstacles, extents: Vec::new(), axis: 0, near: Vec::new(), by_deviation: 0 }
    }

    /// Returns windows that find only the closest pairs.
    pub(super) fn of_closest(limits: Limits) -> Self {
        Self { judges: false, ..Self::new(limits, &[], &BTreeSet::new()) }
    }

    /// Judges all pairs in a window.
    pub(super) fn judge(&mut self, vehicles: &[Vehicle], window: Interval, results: &mut Results) {
        self.judge_or_halve(vehicles, window, 0, results);
    }

    fn judge_or_halve(&mut self, vehicles: &[Vehicle], window: Interval, halvings: u32, results: &mut Results) {
        results.ledger.begin_window(window);
        self.extents.clear();
        self.extents
            .extend(vehicles.iter().enumerate().filter_map(|(k, vehicle)| Extent::of_window(k, vehicle, window)));
        let count = self.extents.len();
        if count > 1 {
            self.sort();
            let few = count * (count - 1) / 2 <= MAX_KEPT;
            if halvings == 0 && !few && results.closest.threshold == f64::INFINITY {
                self.compare_neighbours(vehicles, window, results);
            }
            let segments: usize = self.extents.iter().map(|extent| extent.segments.len()).sum();
            let curved = self.extents.iter().any(|extent| extent.chord.curved);
            let is_fine = segments < MIN_SEGMENTS * count && !curved;
            let middle_s = 0.5 * (window.from_s + window.to_s);
            let is_whole = halvings == MAX_HALVINGS || !(window.from_s < middle_s && middle_s < window.to_s);
            let mut max_pairs = if is_whole { MAX_LISTED } else { PAIRS_PER_VEHICLE * count };
            let mut done = self.collect_pairs(results, 0, max_pairs);
            if !is_whole && done < count {
                // Shorter windows of a few segments help only where vehicles turn within the window.
                if !is_fine || 2 * self.by_deviation > self.near.len() {
                    self.judge_or_halve(vehicles, Interval { to_s: middle_s, ..window }, halvings + 1, results);
                    self.judge_or_halve(vehicles, Interval { from_s: middle_s, ..window }, halvings + 1, results);
                    return;
                }
                max_pairs = MAX_LISTED;
            }
            loop {
                for near in &self.near {
                    self.sweep_vehicles(vehicles, near, window, results);
                }
                if done == count || results.interruption.is_set() {
                    break;
                }
                done = self.collect_pairs(results, done, max_pairs);
            }
        }
        self.sweep_obstacles(vehicles, window, results);
    }

    /// Sorts the extents by lower end along the axis on which the swarm is longest.
    fn sort(&mut self) {
        let Some(first) = self.extents.first() else { return };
        let (mut low, mut high) = (first.low, first.low);
        for extent in &self.extents {
            (low, high) = (low.inf(&extent.low), high.sup(&extent.low));
        }
        let axis = (high - low).imax();
        self.axis = axis;
        // From here on the first axis is the axis of the sort.
        if axis != 0 {
            for extent in &mut self.extents {
                extent.low.swap_rows(0, axis);
                extent.high.swap_rows(0, axis);
            }
        }
        self.extents.sort_unstable_by(|a, b| a.low[0].total_cmp(&b.low[0]).then(a.vehicle.cmp(&b.vehicle)));
    }

    /// Sweeps neighbours to bound the closest distances. Its findings are dropped; every pair that matters is swept
    /// later.
    fn compare_neighbours(&self, vehicles: &[Vehicle], window: Interval, results: &mut Results) {
        let interruption = results.interruption.clone();
        let mut rough = Results { closest: mem::take(&mut results.closest), interruption, ..Results::default() };
        let count = self.extents.len();
        let pairs = |apart: u32| (0..).zip(apart..).take(count.saturating_sub(apart as usize));
        for (a, b) in (1..=FIRST_NEIGHBOURS).flat_map(pairs) {
            self.sweep_vehicles(
                vehicles,
                &ExtentPair::new(&self.extents, a, b, self.limits.cylinder.as_ref()),
                window,
                &mut rough,
            );
        }
        results.closest = rough.closest;
    }

    /// Lists the pairs that could matter, of the extents from `from` on with later ones, until they exceed `max_pairs`.
    /// Returns the index of the next extent.
    fn collect_pairs(&mut self, results: &Results, from: usize, max_pairs: usize) -> usize {
        let Self { extents, near, by_deviation, limits, judges, axis, .. } = self;
        let limit = |first: f64, second: f64| if *judges { limits.of_vehicles(first, second) } else { 0.0 };
        near.clear();
        *by_deviation = 0;
        let radius = extents.iter().map(|extent| extent.radius).fold(0.0, f64::max);
        let threshold = results.closest.threshold;
        let mut reach = limits.reach_m(threshold.max(limit(radius, radius)));
        reach.swap_rows(0, *axis);
        for (k, a) in (0_u32..).zip(extents.iter()).skip(from) {
            if results.interruption.is_set() {
                return extents.len();
            }
            let until = a.high[0] + reach[0];
            for (l, b) in (k + 1..).zip(extents[k as usize + 1..].iter()).take_while(|(_, b)| b.low[0] <= until) {
                let aside = |axis: usize| (a.low[axis] - b.high[axis]).max(b.low[axis] - a.high[axis]);
                if aside(1) <= reach[1] && aside(2) <= reach[2] && !(a.grounded && b.grounded) {
                    let of_both = ExtentPair::new(extents, k, l, limits.cylinder.as_ref());
                    let distance = threshold.max(limit(a.radius, b.radius));
                    if of_both.may_come_within(distance) {
                        *by_deviation += usize::from(of_both.squared >= distance * distance);
                        near.push(of_both);
                    }
                }
            }
            if near.len() > max_pairs {
                return k as usize + 1;
            }
        }
        extents.len()
    }

    fn sweep_vehicles(&self, vehicles: &[Vehicle], near: &ExtentPair, window: Interval, results: &mut Results) {
        if !results.settle_and_continue() {
            return;
        }
        let (a, b) = (&self.extents[near.first as usize], &self.extents[near.second as usize]);
        let (a, b) = if a.vehicle < b.vehicle { (a, b) } else { (b, a) };
        let pair = ObjectPair::Vehicles(Pair::new(a.vehicle, b.vehicle));
        let limit = self.limits.of_vehicles(a.radius, b.radius);
        let cutoff = results.closest.cutoff(pair, limit);
        let may_violate = self.judges && near.may_come_within(limit);
        if may_violate || near.may_come_within(cutoff) {
            let (target, keep_out, above) = (self.limits.target(), KeepOut::new(limit), self.limits.above);
            PairSweep { pair, target, keep_out, cutoff, judges: self.judges, may_violate, above }.judge(
                a.segments(vehicles),
                b.segments(vehicles),
                window,
                results,
            );
        }
    }

    fn sweep_obstacles(&self, vehicles: &[Vehicle], window: Interval, results: &mut Results) {
        for (index, JudgedObstacle { obstacle, path, is_landed_on }) in self.obstacles.iter().enumerate() {
            let path = &path[within(path, window)];
            let place = Chord::of_window(path, window);
            let above = self.limits.above.filter(|_| *is_landed_on);
            for extent in self.extents.iter().filter(|extent| !(extent.grounded && *is_landed_on)) {
                if !results.settle_and_continue() {
                    return;
                }
                let pair = ObjectPair::Obstacle { vehicle: extent.vehicle, obstacle: index };
                let limit = self.limits.of_obstacle(obstacle, extent.radius);
                let (cutoff, chord) = (results.obstacles.cutoff(pair, limit), &extent.chord);
                let between = obstacle::closest(&obstacle.shape, chord.from - place.from, chord.to - place.to).0;
                let least = between - chord.motion_deviation - place.motion_deviation;
                if least < limit.max(cutoff) {
                    let (target, keep_out) = (Target::Shape(&obstacle.shape), KeepOut::new(limit));
                    let may_violate = least < limit;
                    PairSweep { pair, target, keep_out, cutoff, judges: self.judges, may_violate, above }.judge(
                        path,
                        extent.segments(vehicles),
                        window,
                        results,
                    );
                }
            }
        }
    }
}

/// Uniform motion over a window, with the largest distance of segments from it.
#[derive(Clone, Copy, Debug)]
struct Chord {
    from: Vector3<f64>,
    to: Vector3<f64>,
    motion_deviation: f64,
    curved: bool,
}

impl Chord {
    /// Creates the chord of segments that meet the window, at least one. At times without a segment the last position
    /// is kept, which only increases the deviation.
    #[inline]
    fn of_window(parts: &[Segment], window: Interval) -> Self {
        let (Some(first), Some(last)) = (parts.first(), parts.last()) else {
            return Self {
                from: Vector3::zeros(),
                to: Vector3::zeros(),
                motion_deviation: f64::INFINITY,
                curved: false,
            };
        };
        let Interval { from_s, to_s } = window;
        let (from, to) = (first.position(from_s.max(first.from_s)), last.position(to_s));
        let by = to - from;
        let per_s = if to_s > from_s { 1.0 / (to_s - from_s) } else { 0.0 };
        let off =
            |time_s: f64, point: &Vector3<f64>| (point - (from + by * ((time_s - from_s) * per_s))).norm_squared();
        let mut squared = 0.0;
        // End of the segment before, or the start of the motion: usually the start of the next segment.
        let (mut end_s, mut end) = (from_s, from);
        for part in parts {
            let follows = part.from_s == end_s && part.from.x == end.x && part.from.y == end.y && part.from.z == end.z;
            if !follows && part.from_s >= from_s {
                squared = larger(squared, off(part.from_s, &part.from));
            }
            if part.to_s <= to_s {
                squared = larger(squared, off(part.to_s, &part.to));
            }
            (end_s, end) = (part.to_s, part.to);
        }
        let curved = parts.iter().any(|part| part.curve().is_some());
        let beyond = if curved { deviation_of_curves(parts, window) } else { 0.0 };
        // The ends of the chord are interpolated on the first and the last segment.
        let rounding = ROUNDING * (from.amax() + to.amax()) + first.rounding() + last.rounding();
        // In a window too short to divide by, the motion is unbounded.
        let motion_deviation =
            if per_s.is_finite() { squared.sqrt() * (1.0 + ROUNDING) + beyond + rounding } else { f64::INFINITY };
        Self { from, to, motion_deviation, curved }
    }
}

/// Returns a bound on the distance of curves from the chords of their corners.
#[cold]
fn deviation_of_curves(parts: &[Segment], window: Interval) -> f64 {
    let curves = parts.iter().filter(|part| part.curve().is_some());
    let deviations = curves.map(|part| {
        let (from_s, to_s) = (part.from_s.max(window.from_s), part.to_s.min(window.to_s));
        motion_deviation(&part.local(Interval { from_s, to_s })) + part.deviation() + part.rounding()
    });
    deviations.fold(0.0, larger)
}

/// Returns the range of segments that meet a window, in most cases all.
pub(super) fn within(segments: &[Segment], Interval { from_s, to_s }: Interval) -> Range<usize> {
    let all_end_late = segments.first().is_none_or(|part| part.to_s >= from_s);
    let first = if all_end_late { 0 } else { segments.partition_point(|part| part.to_s < from_s) };
    let all_begin_early = segments.last().is_none_or(|part| part.from_s <= to_s);
    let end = if all_begin_early { segments.len() } else { segments.partition_point(|part| part.from_s <= to_s) };
    first..end.max(first)
}

impl Extent {
    /// Returns the extent of the segments of a vehicle that meet the window; `None` without such segments.
    #[inline]
    fn of_window(vehicle: usize, state: &Vehicle, window: Interval) -> Option<Self> {
        let segments = within(&state.segments, window);
        let parts = &state.segments[segments.clone()];
        if parts.is_empty() {
            return None;
        }
        let chord = Chord::of_window(parts, window);
        let aside = Vector3::repeat(chord.motion_deviation);
        Some(Self {
            low: chord.from.inf(&chord.to) - aside,
            high: chord.from.sup(&chord.to) + aside,
            chord,
            radius: state.radius_m.unwrap_or(0.0),
            grounded: parts.iter().all(|part| part.grounded == Some(true)),
            vehicle,
            segments,
        })
    }

    fn segments<'a>(&self, vehicles: &'a [Vehicle]) -> &'a [Segment] {
        &vehicles[self.vehicle].segments[self.segments.clone()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recorded::Settings;
    use crate::segment::{Curve, Deviation};

    #[test]
    fn the_deviation_of_a_vehicle_is_that_of_its_corners() {
        let point = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        let parts = [
            Segment::straight(0.0, 1.0, point(0.0, 0.0), point(1.0, 0.5)),
            Segment::straight(1.0, 2.0, point(1.0, 0.5), point(2.0, 0.0)),
        ];
        let way = Chord::of_window(&parts, Interval { from_s: 0.0, to_s: 2.0 });
        assert_eq!((way.from, way.to), (point(0.0, 0.0), point(2.0, 0.0)));
        assert!((way.motion_deviation - 0.5).abs() < 1e-12 && way.motion_deviation >= 0.5);
        // A vehicle that covers the chord at the wrong time deviates along it.
        let hurried = [
            Segment::straight(0.0, 0.5, point(0.0, 0.0), point(1.5, 0.0)),
            Segment::straight(0.5, 2.0, point(1.5, 0.0), point(2.0, 0.0)),
        ];
        assert!((Chord::of_window(&hurried, Interval { from_s: 0.0, to_s: 2.0 }).motion_deviation - 1.0).abs() < 1e-12);
        // A vehicle that appears late counts as at its first position before.
        let late = [Segment::straight(1.0, 2.0, point(5.0, 0.0), point(5.0, 1.0))];
        let way = Chord::of_window(&late, Interval { from_s: 0.0, to_s: 2.0 });
        assert_eq!(way.from, point(5.0, 0.0));
        assert!((way.motion_deviation - 0.5).abs() < 1e-12);
        // A vehicle deviates where it appears again after a gap.
        let away = [
            Segment::straight(0.0, 1.0, point(0.0, 0.0), point(1.0, 0.0)),
            Segment::straight(3.0, 4.0, point(3.0, 2.0), point(4.0, 0.0)),
        ];
        assert!((Chord::of_window(&away, Interval { from_s: 0.0, to_s: 4.0 }).motion_deviation - 2.0).abs() < 1e-12);
        // In a window too short to divide by, a vehicle may be anywhere.
        let instant = [Segment::straight(0.0, 3e-310, point(0.0, 0.0), point(1.0, 0.0))];
        assert_eq!(Chord::of_window(&instant, Interval { from_s: 0.0, to_s: 3e-310 }).motion_deviation, f64::INFINITY);
    }

    #[test]
    fn only_segments_that_meet_a_window_are_used() {
        let parts = [0.0, 1.0, 2.0].map(|t| Segment::straight(t, t + 1.0, Vector3::zeros(), Vector3::zeros()));
        for ((from_s, to_s), expected) in
            [((0.0, 3.0), 0..3), ((0.5, 1.5), 0..2), ((1.0, 2.0), 0..3), ((2.5, 9.0), 2..3), ((4.0, 9.0), 3..3)]
        {
            assert_eq!(within(&parts, Interval { from_s, to_s }), expected, "{from_s} {to_s}");
        }
        assert_eq!(within(&[], Interval { from_s: 0.0, to_s: 1.0 }), 0..0);
    }

    #[test]
    fn the_closest_pairs_are_the_same_without_limits() {
        // Forty vehicles that fly through each other, every third of them on a curve with a deviation.
        let sample_at = |k: u32, by: f64| {
            Vector3::new(f64::from(k * k % 41) + by, f64::from(k * 17 % 37) * (1.0 - by), f64::from(k % 3))
        };
        let part = |k: u32, from_s: u32| {
            let (from_s, by) = (f64::from(from_s), f64::from(from_s) / 8.0);
            let (from, to) = (sample_at(k, by), sample_at(k, by + 0.125));
            let deviation = Deviation { peak: 0.01, hermite: false };
            let curve = Curve { from_s, to_s: from_s + 1.0, coefficients: vec![from, to - from], deviation };
            if k.is_multiple_of(3) { Segment::curved(curve) } else { Segment::straight(from_s, from_s + 1.0, from, to) }
        };
        let settings = Settings { delta_m: Some(2.0), radius_m: Some(5.0), ..Settings::default() };
        let vehicle = |k: u32| {
            let mut vehicle = Vehicle::new("", &settings, 1.0);
            vehicle.segments = (0..8).map(|from_s| part(k, from_s)).collect();
            vehicle
        };
        let vehicles: Vec<_> = (0..40).map(vehicle).collect();
        let found = [Windows::new(settings.limits(), &[], &BTreeSet::new()), Windows::of_closest(settings.limits())]
            .map(|mut windows| {
                let mut results = Results::default();
                windows.judge(&vehicles, Interval { from_s: 0.0, to_s: 8.0 }, &mut results);
                results
            });
        let [judged, closest] = found;
        assert_eq!(judged.closest.kept, closest.closest.kept);
        assert!(
            closest.closest.kept[0].limit_m == 10.0 && closest.swept < judged.swept / 2,
            "{} and {}",
            closest.swept,
            judged.swept
        );
        assert!(!judged.ledger.violations.is_empty() && judged.ledger.parry.min_toi_s.is_some());
        assert!(
            closest.ledger.violations.is_empty()
                && closest.ledger.is_decided()
                && closest.ledger.parry.min_toi_s.is_none()
        );
    }
}
