//! Sweep of two objects past each other, segment by segment.

use nalgebra::Vector3;

use super::cross_check::{KeepOut, cross_check, from_cylinder};
use super::cylinder::Cylinder;
use super::enclosure::{Minimum, Search, Target};
use super::exact::ExactMotion;
use super::ledger::Results;
use super::outcome::{Approach, ObjectPair, Undecided, Violation};
use super::segment::{Line, Segment};
use super::sweep::{ClosestPoint, Interval, RelativeMotion};

/// Sweep of two objects that must keep a distance.
#[derive(Debug)]
pub(super) struct PairSweep<'a> {
    pub(super) pair: ObjectPair,
    pub(super) target: Target<'a>,
    pub(super) keep_out: KeepOut,
    /// The distance must be below this value to be among the closest.
    pub(super) cutoff: f64,
    /// Whether the distance is compared with the limit. If not, only the closest approach is found.
    pub(super) judges: bool,
    /// Whether bounds on the motion allow the distance to fall below its limit; if so, the second detector runs too.
    pub(super) may_violate: bool,
    /// Height at or below which an object counts as on the ground.
    pub(super) above: Option<f64>,
}

/// Two segments and the time that they share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Overlap<'a> {
    pub(super) first: &'a Segment,
    pub(super) second: &'a Segment,
    pub(super) interval: Interval,
}

/// Calls `f` with the time that each segment of `first` shares with each segment of `second`, in order of time.
///
/// Segments are closed: a segment shares an instant with one that begins where it ends. If two segments end together,
/// the sweep advances in both, so that two jumps at one instant are swept together. If only one of the two has a
/// successor, the other is also swept with that successor, unless both are jumps.
pub(super) fn overlaps<'a>(first: &'a [Segment], second: &'a [Segment], mut f: impl FnMut(Overlap<'a>)) {
    let (mut a, mut b) = (0, 0);
    while let (Some(one), Some(other)) = (first.get(a), second.get(b)) {
        let (from_s, to_s) = (one.from_s.max(other.from_s), one.to_s.min(other.to_s));
        if from_s <= to_s {
            f(Overlap { first: one, second: other, interval: Interval { from_s, to_s } });
        }
        let (mut step_a, mut step_b) = (one.to_s <= to_s, other.to_s <= to_s);
        if step_a && step_b {
            let follows = |next: Option<&Segment>| next.is_some_and(|next| next.from_s <= to_s);
            let (next_a, next_b) = (follows(first.get(a + 1)), follows(second.get(b + 1)));
            if next_a != next_b && !(one.jumps() && other.jumps()) {
                (step_a, step_b) = (next_a, next_b);
            }
        }
        a += usize::from(step_a);
        b += usize::from(step_b);
    }
}

/// Smallest separation of straight segments below a cutoff. Rounded bounds select the candidates; their separations are
/// exact.
#[derive(Debug)]
struct SmallestSeparation<'a> {
    cutoff: f64,
    /// Upper bound of the smallest separation, and its square with a margin.
    upper: f64,
    upper_squared: f64,
    /// Candidates for the smallest separation: lower bound, fraction of the closest approach, and segments.
    candidates: Vec<(f64, f64, Overlap<'a>)>,
}

impl<'a> SmallestSeparation<'a> {
    /// Margin of the rough bound. With the resolution e, (x + e)^2 <= x^2 (1 + m) + e^2 (1 + 1 / m), and e^2 is 64
    /// eps^2 times the squared scale.
    const MARGIN: f64 = 1e-6;
    const OF_SCALE: f64 = 1e-23;

    fn with_cutoff(cutoff: f64) -> Self {
        Self { cutoff, upper: cutoff, upper_squared: cutoff * cutoff * (1.0 + Self::MARGIN), candidates: Vec::new() }
    }

    #[inline]
    fn add(&mut self, overlap: &Overlap<'a>, motion: &RelativeMotion, closest: ClosestPoint) {
        if closest.squared < self.upper_squared + Self::OF_SCALE * motion.scale_squared() {
            self.add_close(overlap, motion, closest);
        }
    }

    #[inline(never)]
    fn add_close(&mut self, overlap: &Overlap<'a>, motion: &RelativeMotion, closest: ClosestPoint) {
        let (separation, resolution) = (closest.separation_m(), motion.resolution_m());
        let (lower, upper) = (separation - resolution, separation + resolution);
        if lower < self.upper && !self.candidates.last().is_some_and(|(.., before)| before.is_same_rest(overlap)) {
            self.candidates.push((lower, closest.at, *overlap));
        }
        if upper < self.upper {
            (self.upper, self.upper_squared) = (upper, upper * upper * (1.0 + Self::MARGIN));
        }
    }

    /// Returns the smallest separation, rounded down to a double, and when it is first reached \[s\].
    fn finish(self) -> Option<(f64, f64)> {
        let mut found = None;
        let mut least = self.cutoff;
        for (lower, fraction, overlap) in self.candidates {
            if lower < least && lower <= self.upper {
                let exact = overlap.exact();
                if exact.is_below(least) {
                    least = exact.separation();
                    found = Some((least, overlap.interval.at(fraction)));
                }
            }
        }
        found
    }
}

/// Smallest scaled distance of a cylinder below a cutoff, and its time \[s\].
struct SmallestScaledDistance {
    least: f64,
    at_s: Option<f64>,
}

impl PairSweep<'_> {
    /// Judges a pair in a window. Straight segments are judged whole, so that findings do not depend on windows; curves
    /// are judged within the window.
    pub(super) fn judge(&self, first: &[Segment], second: &[Segment], window: Interval, results: &mut Results) {
        let mut nearest = SmallestSeparation::with_cutoff(self.cutoff);
        let mut scaled = SmallestScaledDistance { least: self.cutoff, at_s: None };
        let mut swept = 0;
        overlaps(first, second, |overlap| {
            if results.interruption.is_set() {
                return;
            }
            if self.is_on_ground(overlap.first, overlap.interval) && self.is_on_ground(overlap.second, overlap.interval)
            {
                return;
            }
            if let (Target::Cylinder(cylinder), true) = (self.target, overlap.is_straight()) {
                swept += 1;
                self.past_cylinder(&cylinder, &overlap, &mut scaled, results);
            } else if self.target.is_vehicle() && overlap.is_straight() {
                swept += 1;
                let motion = overlap.straight();
                let closest = motion.closest();
                nearest.add(&overlap, &motion, closest);
                if self.may_violate {
                    self.straight(&overlap, &motion, closest, results);
                }
            } else {
                let Interval { from_s, to_s } = overlap.interval;
                let interval = Interval { from_s: from_s.max(window.from_s), to_s: to_s.min(window.to_s) };
                if interval.from_s <= interval.to_s {
                    swept += 1;
                    self.curved(&Overlap { interval, ..overlap }, results);
                }
            }
        });
        results.swept += swept;
        let found = nearest.finish().or(scaled.at_s.map(|at_s| (scaled.least, at_s)));
        if let Some((separation_m, time_s)) = found {
            self.offer(separation_m, separation_m, time_s, results);
        }
    }

    /// Returns whether an object is on the ground during all of `interval`. If this is a single instant, the height at
    /// this instant counts, because a segment that takes off begins on the ground.
    #[inline]
    fn is_on_ground(&self, segment: &Segment, interval: Interval) -> bool {
        let starts_there = |above: f64| {
            interval.from_s >= interval.to_s
                && !segment.jumps()
                && segment.position(interval.from_s).z + segment.deviation_at(interval.from_s) <= above
        };
        segment.grounded == Some(true) || self.above.is_some_and(starts_there)
    }

    fn offer(&self, lower_m: f64, upper_m: f64, time_s: f64, results: &mut Results) {
        let Self { pair, keep_out, .. } = self;
        let approach = Approach { pair: *pair, lower_m, upper_m, time_s, limit_m: keep_out.delta_m };
        results.closest_pairs_mut(*pair).offer(approach);
    }

    /// Judges two straight segments by the closed form and by the cast.
    #[inline(never)]
    fn straight(&self, overlap: &Overlap<'_>, motion: &RelativeMotion, closest: ClosestPoint, results: &mut Results) {
        let contact = self.keep_out.cast(motion);
        if contact.is_some() || self.keep_out.is_near(motion, closest) {
            let exact = overlap.exact();
            results.ledger.judge_straight(self.pair, &self.keep_out, motion, contact, &exact, || exact.separation());
        }
    }

    /// Judges two straight segments by the scaled distance of a cylinder, in exact arithmetic where doubles do not
    /// decide.
    #[inline(never)]
    fn past_cylinder(
        &self,
        cylinder: &Cylinder,
        overlap: &Overlap<'_>,
        nearest: &mut SmallestScaledDistance,
        results: &mut Results,
    ) {
        let (motion, exact) = (overlap.straight(), overlap.exact());
        if cylinder.is_below(&motion, &exact, nearest.least) {
            nearest.least = cylinder.separation(&motion, &exact);
            nearest.at_s = Some(overlap.interval.at(cylinder.closest(&motion).1));
        }
        if !self.may_violate {
            return;
        }
        let (pair, limit_m) = (self.pair, self.keep_out.delta_m);
        let is_below = cylinder.is_below(&motion, &exact, limit_m);
        let (nearest_m, fraction) = cylinder.closest(&motion);
        let min_m = if is_below { cylinder.separation(&motion, &exact) } else { nearest_m };
        let found = Minimum { lower: min_m, upper: min_m, at: fraction };
        let rounding = motion.resolution_m() * cylinder.per_metre();
        let mut check = from_cylinder(cylinder, limit_m, &found, rounding, |u| motion.from + motion.by * u);
        check.agrees &= is_below || check.contact.is_none();
        let span = cylinder.below(&motion, limit_m);
        let [from_s, to_s, min_at_s] = [span.enter, span.exit, fraction].map(|u| overlap.interval.at(u));
        results.ledger.add_cross_check(pair, overlap.interval, min_m, is_below.then_some(span.enter), check);
        if is_below && !results.ledger.violations.is_from_earlier_window(to_s) {
            let from_start = exact.starts_within(cylinder, limit_m);
            results.ledger.add_violation(Violation { pair, from_s, to_s, min_m, min_at_s, limit_m }, from_start);
        }
    }

    /// Judges an interval in which one object is on a curve or is an obstacle.
    fn curved(&self, overlap: &Overlap<'_>, results: &mut Results) {
        let Overlap { first, second, interval } = *overlap;
        let (pair, limit_m) = (self.pair, self.keep_out.delta_m);
        let r = overlap.relative();
        let mut search = Search::new(self.target, &r);
        let per_metre = self.target.per_metre();
        let deviation = (first.deviation() + second.deviation()) * per_metre;
        // The distance of a straight motion from an obstacle is a closed form, not an enclosure.
        let rounding = if overlap.is_straight() { 0.0 } else { (first.rounding() + second.rounding()) * per_metre };
        let matters = if self.judges { limit_m.max(self.cutoff) } else { self.cutoff };
        let Some(drawn) = search.minimum(matters + deviation + rounding) else { return };

        let floor = if self.target.is_vehicle() { 0.0 } else { f64::NEG_INFINITY };
        let lower = |lowest: &Minimum| (lowest.lower - deviation - rounding).max(floor);
        let deviation_at =
            |u: f64| (first.deviation_at(interval.at(u)) + second.deviation_at(interval.at(u))) * per_metre;
        // The deviation is zero at a sample, so the distance at an end may be the smaller upper bound.
        let upper = |search: &Search<'_>, from: f64, to: f64, lowest: &Minimum| {
            let [start, end] = [from, to].map(|u| search.distance(u) + deviation_at(u));
            (lowest.upper + deviation_at(lowest.at)).min(start).min(end) + rounding
        };
        let undecided = |from_s: f64, to_s: f64, lower_m: f64, upper_m: f64, lowest: &Minimum| {
            let rate_hz = overlap.rate_hz((lowest.upper - limit_m).abs() / per_metre);
            Undecided { pair, from_s, to_s, lower_m, upper_m, limit_m, rate_hz }
        };
        let (lower_m, upper_m) = (lower(&drawn), upper(&search, 0.0, 1.0, &drawn));
        if lower_m < self.cutoff {
            self.offer(lower_m, upper_m, interval.at(drawn.at), results);
        }
        if !self.judges {
            return;
        }
        let mut enter = None;
        // A violation is certain only if at least one of the two is known to be in the air.
        let counts = [first, second].iter().any(|segment| segment.grounded == Some(false));
        if upper_m < limit_m && counts {
            for (from, to) in search.below(limit_m, drawn.at) {
                let holds = from <= drawn.at && drawn.at <= to;
                let other = if holds { None } else { search.minimum_within((from, to), f64::INFINITY) };
                let lowest = other.unwrap_or(drawn);
                let (from_s, to_s) = (interval.at(from), interval.at(to));
                let min_m = upper(&search, from, to, &lowest);
                if min_m < limit_m {
                    let from_start = from <= 0.0 && search.distance(0.0) < limit_m;
                    let min_at_s = interval.at(lowest.at);
                    results
                        .ledger
                        .add_violation(Violation { pair, from_s, to_s, min_m, min_at_s, limit_m }, from_start);
                    enter = enter.or(Some(from));
                } else {
                    results.add_undecided(undecided(from_s, to_s, lower(&lowest), min_m, &lowest));
                }
            }
        } else if lower_m < limit_m {
            results.add_undecided(undecided(interval.from_s, interval.to_s, lower_m, upper_m, &drawn));
        }
        if self.may_violate {
            let check = cross_check(&search, &self.keep_out, &drawn, rounding);
            results.ledger.add_cross_check(pair, interval, drawn.upper, enter, check);
        }
    }
}

impl Overlap<'_> {
    /// Returns whether both segments are straight.
    #[inline]
    fn is_straight(&self) -> bool {
        self.first.curve().is_none() && self.second.curve().is_none()
    }

    /// Returns whether both vehicles stand still at the same positions as in another overlap.
    #[inline]
    fn is_same_rest(&self, other: &Self) -> bool {
        let is_still = |segment: &Segment, other: &Segment| {
            segment.from == segment.to && segment.from == other.from && segment.to == other.to
        };
        is_still(self.first, other.first) && is_still(self.second, other.second)
    }

    /// Returns the relative motion of two straight segments over the time that they share.
    #[inline]
    pub(super) fn straight(&self) -> RelativeMotion {
        let (a, b) = (self.first, self.second);
        let are_samples = a.parent.is_none() && b.parent.is_none();
        if are_samples && a.from_s == b.from_s && a.to_s == b.to_s {
            RelativeMotion::new(b.from - a.from, b.to - a.to)
        } else {
            self.interpolated()
        }
    }

    /// Returns the relative motion of two straight segments with different times, or of parts of segments.
    /// Displacements are added to the difference of two starting points, which loses no digits far from the origin.
    #[inline(never)]
    fn interpolated(&self) -> RelativeMotion {
        let (a, b) = (self.first.line(), self.second.line());
        let (start, by_a, by_b) = (b.from - a.from, a.to - a.from, b.to - b.from);
        let position = |time_s: f64, end: bool| {
            let share =
                |line: &Line| if line.to_s <= line.from_s { f64::from(u8::from(end)) } else { line.fraction(time_s) };
            start + (by_b * share(&b) - by_a * share(&a))
        };
        RelativeMotion::interpolated(
            [position(self.interval.from_s, false), position(self.interval.to_s, true)],
            start,
            [by_a, by_b],
        )
    }

    /// Returns the exact motion of two straight segments.
    pub(super) fn exact(&self) -> ExactMotion {
        ExactMotion { first: self.first.line(), second: self.second.line(), interval: self.interval }
    }

    /// Returns the relative position as a polynomial of the fraction of the shared time. It has at least one
    /// coefficient; of several, the last is not zero.
    pub(super) fn relative(&self) -> Vec<Vector3<f64>> {
        let (a, b) = (self.first, self.second);
        if self.is_straight() {
            let motion = self.straight();
            return vec![motion.from, motion.by];
        }
        let mut r = b.local(self.interval);
        let less = a.local(self.interval);
        r.resize(r.len().max(less.len()).max(1), Vector3::zeros());
        for (r, less) in r.iter_mut().zip(&less) {
            *r -= less;
        }
        while r.len() > 1 && r.last().is_some_and(|c| *c == Vector3::zeros()) {
            r.pop();
        }
        r
    }

    /// Returns the sampling rate of both vehicles at which the deviation is at most the margin \[Hz\]. The deviation
    /// over intervals of h is the sum of c h^2, with c = peak / `h_now`^2 of each vehicle.
    fn rate_hz(&self, margin: f64) -> Option<f64> {
        let curves = [self.first, self.second].into_iter().filter_map(|segment| segment.curve());
        let per_s2: f64 = curves.map(|curve| curve.deviation.peak / (curve.to_s - curve.from_s).powi(2)).sum();
        let rate_hz = (per_s2 / margin).sqrt();
        (per_s2 > 0.0 && margin > 0.0 && rate_hz.is_finite()).then_some(rate_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn still(from_s: f64, to_s: f64, x: f64) -> Segment {
        Segment::straight(from_s, to_s, Vector3::new(x, 0.0, 0.0), Vector3::new(x, 0.0, 0.0))
    }

    fn jump(at_s: f64, x: [f64; 2]) -> Segment {
        let [from, to] = x.map(|x| Vector3::new(x, 0.0, 0.0));
        Segment::straight(at_s, at_s, from, to)
    }

    fn times(first: &[Segment], second: &[Segment]) -> Vec<(f64, f64)> {
        let mut times = Vec::new();
        overlaps(first, second, |overlap| times.push((overlap.interval.from_s, overlap.interval.to_s)));
        times
    }

    #[test]
    fn two_jumps_at_one_instant_are_swept_together() {
        let first = [still(0.0, 1.0, 0.0), jump(1.0, [0.0, 5.0]), still(1.0, 2.0, 5.0)];
        let second = [still(0.0, 1.0, 5.0), jump(1.0, [5.0, 10.0]), still(1.0, 2.0, 10.0)];
        let mut closest = f64::INFINITY;
        overlaps(&first, &second, |overlap| closest = closest.min(overlap.straight().closest().separation_m()));
        assert_eq!(closest, 5.0);
        assert_eq!(times(&first, &second), [(0.0, 1.0), (1.0, 1.0), (1.0, 2.0)]);
        // One vehicle jumps while the other stands: the jump passes the standing vehicle.
        let waiting = [still(0.5, 1.5, 3.0)];
        let mut closest = f64::INFINITY;
        overlaps(&first, &waiting, |overlap| closest = closest.min(overlap.straight().closest().separation_m()));
        assert_eq!(closest, 0.0);
    }

    #[test]
    fn a_segment_that_ends_where_the_other_begins_shares_an_instant() {
        assert_eq!(times(&[still(0.0, 1.0, 0.0)], &[still(1.0, 2.0, 0.0)]), [(1.0, 1.0)]);
        assert_eq!(times(&[still(0.0, 1.0, 0.0)], &[still(1.5, 2.0, 0.0)]), []);
        let first = [still(0.0, 1.0, 0.0)];
        assert_eq!(times(&first, &[still(0.0, 1.0, 3.0), jump(1.0, [3.0, 4.0])]), [(0.0, 1.0), (1.0, 1.0)]);
        let late = [still(0.0, 1.0, 0.0), still(5.0, 6.0, 0.0)];
        assert_eq!(times(&late, &[still(0.0, 9.0, 0.0)]), [(0.0, 1.0), (5.0, 6.0)]);
    }

    fn closest(first: &[Segment], second: &[Segment]) -> f64 {
        let mut closest = f64::INFINITY;
        overlaps(first, second, |overlap| closest = closest.min(overlap.straight().closest().separation_m()));
        closest
    }

    #[test]
    fn a_last_jump_is_swept_once_and_a_single_sample_meets_a_jump() {
        // Convoy: `tail` takes the place that `lead` leaves at the same instant; `lead` has no later sample.
        let lead = [still(0.0, 1.0, 0.0), jump(1.0, [0.0, 1.0])];
        let tail = [still(0.0, 1.0, -1.0), jump(1.0, [-1.0, 0.0]), still(1.0, 2.0, 0.0), jump(2.0, [0.0, 0.0])];
        assert_eq!((closest(&lead, &tail), closest(&tail, &lead)), (1.0, 1.0));
        // A single sample between two gaps, at the end of the other vehicle's jump.
        let seen_once = [still(0.0, 0.0, 50.0), still(1.0, 1.0, 0.0), still(3.0, 3.0, 50.0)];
        assert_eq!((closest(&seen_once, &tail), closest(&tail, &seen_once)), (0.0, 0.0));
        assert_eq!(closest(&[still(0.0, 0.0, 50.0), still(1.0, 1.0, 3.0), still(3.0, 3.0, 50.0)], &tail), 3.0);
    }
}
