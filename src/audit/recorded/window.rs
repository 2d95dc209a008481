//! A window of time: which pairs can matter in it.
//!
//! Over the window every vehicle is near the straight way between where it is at both ends; how far it strays from that
//! way is the largest distance at its own corners, each against the place on the way at the same time. So two vehicles
//! are at least as far apart as their straight ways are, less what both stray: one closed form for a whole window, which
//! is as sharp for a swarm that flies together as for one that rests. Sort and sweep along the longest axis finds the pairs
//! to compare. A window in which too many pairs remain is halved.

use std::mem;

use nalgebra::Vector3;

use super::enclosure::{Target, stray};
use super::findings::{Closest, Findings, KEPT};
use super::meeting::Meeting;
use super::obstacle::{Obstacle, Shape};
use super::outcome::Who;
use super::segment::Segment;
use super::vehicle::Vehicle;
use crate::audit::parry::KeepOut;
use crate::audit::sweep::RelativeMotion;
use crate::swarm::Pair;

/// With more pairs left than this for each vehicle a window is halved.
const PAIRS_PER_VEHICLE: usize = 4;
/// A window is not halved below so many stretches for each vehicle, unless there are curves in it.
const FEWEST_STRETCHES: usize = 4;
/// A window is not halved more often than this.
const MOST_HALVINGS: u32 = 12;
/// Neighbours in the order of the sort that are compared first, so that the closest pairs are known roughly.
const FIRST_NEIGHBOURS: u32 = 12;
/// Rounding of a straight way, relative to the coordinates it joins: three operations on them, and two differences.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// A pair among the closest is looked at again only where it could come closer by more than this, relative to its
/// distance: vehicles that stand, or fly side by side, are as close all the time but for rounding.
const TIE: f64 = 1e-12;

/// What keeps two apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Distance that any two must keep \[m\].
    pub(super) delta: f64,
    /// Whether the vehicles' radii count.
    pub(super) by_radii: bool,
    /// Height at or below which two vehicles need not keep it, scaled like positions.
    pub(super) above: Option<f64>,
}

impl Limits {
    /// What two vehicles must keep.
    pub(super) fn of_pair(self, first: f64, second: f64) -> f64 {
        if self.by_radii { self.delta.max(first + second) } else { self.delta }
    }

    /// What a vehicle must keep of an obstacle.
    fn of_obstacle(self, obstacle: &Obstacle, radius: f64) -> f64 {
        obstacle.clearance_m.unwrap_or(if self.by_radii { (0.5 * self.delta).max(radius) } else { 0.5 * self.delta })
    }
}

/// Where a vehicle is over a window.
#[derive(Clone, Copy, Debug)]
struct Hull {
    low: Vector3<f64>,
    high: Vector3<f64>,
    from: Vector3<f64>,
    to: Vector3<f64>,
    stray: f64,
    radius: f64,
    grounded: bool,
    curved: bool,
    vehicle: usize,
    first: usize,
    end: usize,
}

/// The windows of a recording, one after the other; keeps its memory.
#[derive(Clone, Debug)]
pub(super) struct Windows {
    pub(super) limits: Limits,
    /// Obstacles, each with its way.
    pub(super) obstacles: Vec<(Obstacle, Vec<Segment>)>,
    hulls: Vec<Hull>,
    near: Vec<Near>,
}

/// Two hulls, and how close their straight ways come.
#[derive(Clone, Copy, Debug)]
struct Near {
    first: u32,
    second: u32,
    /// Smallest distance of the ways, squared.
    squared: f64,
    /// What both stray.
    stray: f64,
}

impl Near {
    #[inline]
    fn new(hulls: &[Hull], first: u32, second: u32) -> Self {
        let (a, b) = (&hulls[first as usize], &hulls[second as usize]);
        let squared = RelativeMotion::new(b.from - a.from, b.to - a.to).closest().squared;
        Self { first, second, squared, stray: a.stray + b.stray }
    }

    /// Whether the two could come closer than a distance; what rounding adds lies within what they stray.
    #[inline]
    fn may_come_within(&self, distance: f64) -> bool {
        let reach = distance + self.stray;
        self.squared < reach * reach
    }
}

impl Windows {
    pub(super) fn new(limits: Limits, obstacles: Vec<Obstacle>) -> Self {
        let obstacles = obstacles
            .into_iter()
            .map(|obstacle| {
                // The ground is where nothing but the vehicle matters, so an obstacle always counts as on it.
                let way = obstacle.segments().into_iter().map(|part| Segment { grounded: true, ..part }).collect();
                (obstacle, way)
            })
            .collect();
        Self { limits, obstacles, hulls: Vec::new(), near: Vec::new() }
    }

    /// Judges everything between two times.
    pub(super) fn judge(&mut self, vehicles: &[Vehicle], from_s: f64, to_s: f64, findings: &mut Findings) {
        self.halve(vehicles, (from_s, to_s), 0, findings);
    }

    fn halve(&mut self, vehicles: &[Vehicle], window_s: (f64, f64), halvings: u32, findings: &mut Findings) {
        self.hulls.clear();
        let mut stretches = 0;
        let mut curved = false;
        for (vehicle, of) in vehicles.iter().enumerate() {
            if let Some(hull) = hull(vehicle, of, window_s) {
                stretches += hull.end - hull.first;
                curved |= hull.curved;
                self.hulls.push(hull);
            }
        }
        let count = self.hulls.len();
        if count == 0 {
            return;
        }
        if count > 1 {
            self.sort();
            let few = count * (count - 1) / 2 <= KEPT;
            if halvings == 0 && !few && findings.closest.threshold() == f64::INFINITY {
                self.compare_neighbours(vehicles, window_s, &mut findings.closest);
            }
            let fine = stretches < FEWEST_STRETCHES * count && !curved;
            let middle_s = 0.5 * (window_s.0 + window_s.1);
            let whole = fine || halvings == MOST_HALVINGS || !(window_s.0 < middle_s && middle_s < window_s.1);
            let most = if whole { usize::MAX } else { PAIRS_PER_VEHICLE * count };
            if !self.collect(findings, most) {
                self.halve(vehicles, (window_s.0, middle_s), halvings + 1, findings);
                self.halve(vehicles, (middle_s, window_s.1), halvings + 1, findings);
                return;
            }
            for near in &self.near {
                self.meet(vehicles, near, window_s, findings);
            }
        }
        self.meet_obstacles(vehicles, window_s, findings);
    }

    /// Sorts by the lower end along the axis on which the swarm is longest.
    fn sort(&mut self) {
        let Some(first) = self.hulls.first() else { return };
        let (mut low, mut high) = (first.low, first.low);
        for hull in &self.hulls {
            (low, high) = (low.inf(&hull.low), high.sup(&hull.low));
        }
        let axis = (high - low).imax();
        // The axis of the sort is the first one from here on.
        if axis != 0 {
            for hull in &mut self.hulls {
                hull.low.swap_rows(0, axis);
                hull.high.swap_rows(0, axis);
            }
        }
        self.hulls.sort_unstable_by(|a, b| a.low[0].total_cmp(&b.low[0]).then(a.vehicle.cmp(&b.vehicle)));
    }

    /// Finds out how close the closest pairs come, and no more: every pair that matters is met after this.
    fn compare_neighbours(&self, vehicles: &[Vehicle], window_s: (f64, f64), closest: &mut Closest) {
        let mut rough = Findings { closest: mem::take(closest), ..Findings::default() };
        let count = self.hulls.len();
        let pairs = |apart: u32| (0..).zip(apart..).take(count.saturating_sub(apart as usize));
        let mut neighbours = (1..=FIRST_NEIGHBOURS).flat_map(pairs);
        while rough.closest.threshold() == f64::INFINITY
            && let Some((a, b)) = neighbours.next()
        {
            self.meet(vehicles, &Near::new(&self.hulls, a, b), window_s, &mut rough);
        }
        *closest = rough.closest;
    }

    /// Lists the pairs that could matter; `false` if they are more than `most`.
    fn collect(&mut self, findings: &Findings, most: usize) -> bool {
        let Self { hulls, near, limits, .. } = self;
        near.clear();
        let radius = hulls.iter().map(|hull| hull.radius).fold(0.0, f64::max);
        let threshold = findings.closest.threshold();
        let reach = threshold.max(limits.of_pair(radius, radius));
        for (k, a) in (0_u32..).zip(hulls.iter()) {
            let until = a.high[0] + reach;
            for (l, b) in (k + 1..).zip(hulls[k as usize + 1..].iter()).take_while(|(_, b)| b.low[0] <= until) {
                let aside = (a.low[1] - b.high[1])
                    .max(b.low[1] - a.high[1])
                    .max(a.low[2] - b.high[2])
                    .max(b.low[2] - a.high[2]);
                if aside <= reach && !(a.grounded && b.grounded) {
                    let of_both = Near::new(hulls, k, l);
                    if of_both.may_come_within(threshold.max(limits.of_pair(a.radius, b.radius))) {
                        near.push(of_both);
                    }
                }
            }
            if near.len() > most {
                return false;
            }
        }
        true
    }

    fn meet(&self, vehicles: &[Vehicle], near: &Near, window_s: (f64, f64), findings: &mut Findings) {
        let (a, b) = (&self.hulls[near.first as usize], &self.hulls[near.second as usize]);
        let (a, b) = if a.vehicle < b.vehicle { (a, b) } else { (b, a) };
        let who = Who::Pair(Pair::new(a.vehicle, b.vehicle));
        let (limit, cutoff) = (self.limits.of_pair(a.radius, b.radius), findings.closest.cutoff(who));
        if !near.may_come_within(limit.max(cutoff * (1.0 - TIE))) {
            return;
        }
        let may_violate = near.may_come_within(limit);
        let (target, keep_out, above) = (Target::Origin, KeepOut::new(limit), self.limits.above);
        let meeting = Meeting { who, target, keep_out, cutoff, may_violate, above };
        let first = &vehicles[a.vehicle].segments[a.first..a.end];
        let second = &vehicles[b.vehicle].segments[b.first..b.end];
        meeting.judge(first, second, window_s, findings);
    }

    fn meet_obstacles(&self, vehicles: &[Vehicle], window_s: (f64, f64), findings: &mut Findings) {
        for (index, (obstacle, way)) in self.obstacles.iter().enumerate() {
            let first = way.partition_point(|part| part.to_s < window_s.0);
            let end = way.partition_point(|part| part.from_s <= window_s.1);
            let way = &way[first..end];
            let place = Straight::over(way, window_s);
            for hull in &self.hulls {
                if hull.grounded {
                    continue;
                }
                let who = Who::Obstacle { vehicle: hull.vehicle, obstacle: index };
                let limit = self.limits.of_obstacle(obstacle, hull.radius);
                let cutoff = findings.obstacles.cutoff(who);
                let shape: &Shape = &obstacle.shape;
                let least = shape.closest(hull.from - place.from, hull.to - place.to).0 - hull.stray - place.stray;
                if least < limit.max(cutoff * (1.0 - TIE)) {
                    let target = Target::Shape(shape);
                    let may_violate = least < limit;
                    let (keep_out, above) = (KeepOut::new(limit), self.limits.above);
                    let meeting = Meeting { who, target, keep_out, cutoff, may_violate, above };
                    let course = &vehicles[hull.vehicle].segments[hull.first..hull.end];
                    meeting.judge(way, course, window_s, findings);
                }
            }
        }
    }
}

/// The larger of two finite numbers; cheaper than `f64::max`, which looks for NaN.
#[inline]
fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// The straight way over a window, and how far from it stretches stray.
#[derive(Clone, Copy, Debug)]
struct Straight {
    from: Vector3<f64>,
    to: Vector3<f64>,
    stray: f64,
    curved: bool,
}

impl Straight {
    /// Of stretches that meet the window, at least one. Where there is none the last place is kept; that only widens.
    #[inline]
    fn over(parts: &[Segment], (from_s, to_s): (f64, f64)) -> Self {
        let (Some(first), Some(last)) = (parts.first(), parts.last()) else {
            return Self { from: Vector3::zeros(), to: Vector3::zeros(), stray: f64::INFINITY, curved: false };
        };
        let (from, to) = (first.position(from_s.max(first.from_s)), last.position(to_s));
        let by = to - from;
        let per_s = if to_s > from_s { 1.0 / (to_s - from_s) } else { 0.0 };
        let off = |time_s: f64, at: &Vector3<f64>| (at - (from + by * ((time_s - from_s) * per_s))).norm_squared();
        let mut squared = 0.0;
        // Where the stretch before ends, or the way begins: mostly where the next stretch begins.
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
        let curved = parts.iter().any(|part| part.curve.is_some());
        let beyond = if curved { stray_of_curves(parts, (from_s, to_s)) } else { 0.0 };
        let rounding = ROUNDING * (from.amax() + to.amax());
        // Over a time too short to divide by nothing is known of the way.
        let stray =
            if per_s.is_finite() { squared.sqrt() * (1.0 + ROUNDING) + beyond + rounding } else { f64::INFINITY };
        Self { from, to, stray, curved }
    }
}

/// How far curves stray from the chords of their corners, at most.
#[cold]
fn stray_of_curves(parts: &[Segment], (from_s, to_s): (f64, f64)) -> f64 {
    let curves = parts.iter().filter(|part| part.curve.is_some());
    let strays = curves.map(|part| {
        let local = part.local(part.from_s.max(from_s), part.to_s.min(to_s));
        stray(&local) + part.slack() + part.rounding()
    });
    strays.fold(0.0, larger)
}

/// The stretches that meet a window, from the first to before the last; mostly all of them.
fn meeting_window(segments: &[Segment], (from_s, to_s): (f64, f64)) -> (usize, usize) {
    let all_end_late = segments.first().is_none_or(|part| part.to_s >= from_s);
    let first = if all_end_late { 0 } else { segments.partition_point(|part| part.to_s < from_s) };
    let all_begin_early = segments.last().is_none_or(|part| part.from_s <= to_s);
    let end = if all_begin_early { segments.len() } else { segments.partition_point(|part| part.from_s <= to_s) };
    (first, end.max(first))
}

#[inline]
fn hull(vehicle: usize, of: &Vehicle, window_s: (f64, f64)) -> Option<Hull> {
    let segments = &of.segments;
    let (first, end) = meeting_window(segments, window_s);
    let parts = &segments[first..end];
    if parts.is_empty() {
        return None;
    }
    let Straight { from, to, stray, curved } = Straight::over(parts, window_s);
    let aside = Vector3::repeat(stray);
    Some(Hull {
        low: from.inf(&to) - aside,
        high: from.sup(&to) + aside,
        from,
        to,
        stray,
        radius: of.radius_m.unwrap_or(0.0),
        grounded: parts.iter().all(|part| part.grounded),
        curved,
        vehicle,
        first,
        end,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vehicle_strays_from_its_straight_way_as_far_as_its_corners() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        let parts = [
            Segment::straight(0.0, 1.0, at(0.0, 0.0), at(1.0, 0.5)),
            Segment::straight(1.0, 2.0, at(1.0, 0.5), at(2.0, 0.0)),
        ];
        let way = Straight::over(&parts, (0.0, 2.0));
        assert_eq!((way.from, way.to), (at(0.0, 0.0), at(2.0, 0.0)));
        assert!((way.stray - 0.5).abs() < 1e-12 && way.stray >= 0.5);
        // Half of the way at the wrong time strays along it.
        let hurried = [
            Segment::straight(0.0, 0.5, at(0.0, 0.0), at(1.5, 0.0)),
            Segment::straight(0.5, 2.0, at(1.5, 0.0), at(2.0, 0.0)),
        ];
        assert!((Straight::over(&hurried, (0.0, 2.0)).stray - 1.0).abs() < 1e-12);
        // A late vehicle is where it appears.
        let late = [Segment::straight(1.0, 2.0, at(5.0, 0.0), at(5.0, 1.0))];
        let way = Straight::over(&late, (0.0, 2.0));
        assert_eq!(way.from, at(5.0, 0.0));
        assert!((way.stray - 0.5).abs() < 1e-12);
        // One that was away strays where it appears again.
        let away = [
            Segment::straight(0.0, 1.0, at(0.0, 0.0), at(1.0, 0.0)),
            Segment::straight(3.0, 4.0, at(3.0, 2.0), at(4.0, 0.0)),
        ];
        assert!((Straight::over(&away, (0.0, 4.0)).stray - 2.0).abs() < 1e-12);
        // Over a time that cannot be divided by, a vehicle may be anywhere.
        let instant = [Segment::straight(0.0, 3e-310, at(0.0, 0.0), at(1.0, 0.0))];
        assert_eq!(Straight::over(&instant, (0.0, 3e-310)).stray, f64::INFINITY);
    }

    #[test]
    fn only_stretches_that_meet_a_window_are_looked_at() {
        let parts = [0.0, 1.0, 2.0].map(|t| Segment::straight(t, t + 1.0, Vector3::zeros(), Vector3::zeros()));
        for (window_s, expected) in [
            ((0.0, 3.0), (0, 3)),
            ((0.5, 1.5), (0, 2)),
            ((1.0, 2.0), (0, 3)),
            ((2.5, 9.0), (2, 3)),
            ((4.0, 9.0), (3, 3)),
        ] {
            assert_eq!(meeting_window(&parts, window_s), expected, "{window_s:?}");
        }
        assert_eq!(meeting_window(&[], (0.0, 1.0)), (0, 0));
    }
}
