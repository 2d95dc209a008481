//! Two that are near each other, stretch by stretch.

use nalgebra::Vector3;

use super::WIDTH_M;
use super::enclosure::{Minimum, Search, Target};
use super::findings::{Below, Findings};
use super::outcome::{Approach, Disagreement, Undecided, Violation, Who};
use super::second::{self, Opinion};
use super::segment::Segment;
use crate::audit::judge::NEGLIGIBLE_RESOLUTION;
use crate::audit::parry::KeepOut;
use crate::audit::sweep::{RESOLUTION, RelativeMotion, Span};

/// Two that must keep a distance.
#[derive(Debug)]
pub(super) struct Meeting<'a> {
    pub(super) who: Who,
    pub(super) target: Target<'a>,
    pub(super) keep_out: KeepOut,
    /// What the distance must come below to be among the closest.
    pub(super) cutoff: f64,
    /// Whether bounds on the motion leave it open that the distance falls below its limit: then it is judged twice.
    pub(super) may_violate: bool,
    /// Height at or below which both are on the ground.
    pub(super) above: Option<f64>,
}

/// The time that two stretches share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shared<'a> {
    pub(super) first: &'a Segment,
    pub(super) second: &'a Segment,
    pub(super) from_s: f64,
    pub(super) to_s: f64,
}

/// The closest of the straight stretches so far.
#[derive(Clone, Copy, Debug)]
struct Nearest {
    squared: f64,
    from_s: f64,
    to_s: f64,
    at: f64,
}

/// The time at a fraction of a stretch, exact at both ends.
fn time_at(from_s: f64, to_s: f64, fraction: f64) -> f64 {
    ((1.0 - fraction) * from_s + fraction * to_s).max(from_s).min(to_s)
}

/// Calls `f` with the time that each stretch of one shares with each of the other, in order of time.
///
/// Stretches are closed: one that ends where another begins shares that instant with it. Where two end together the next
/// two follow, so that two jumps at one instant are swept together; one that nothing follows waits for what follows the
/// other, unless the two were such jumps.
pub(super) fn shared<'a>(first: &'a [Segment], second: &'a [Segment], mut f: impl FnMut(Shared<'a>)) {
    let (mut a, mut b) = (0, 0);
    while let (Some(one), Some(other)) = (first.get(a), second.get(b)) {
        let (from_s, to_s) = (one.from_s.max(other.from_s), one.to_s.min(other.to_s));
        if from_s <= to_s {
            f(Shared { first: one, second: other, from_s, to_s });
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

impl Meeting<'_> {
    /// Judges what two vehicles, or an obstacle and a vehicle, do in a window. Straight stretches are judged whole, so that
    /// what is found does not depend on windows; curves within the window.
    pub(super) fn judge(&self, first: &[Segment], second: &[Segment], window_s: (f64, f64), findings: &mut Findings) {
        let mut nearest = Nearest { squared: f64::INFINITY, from_s: 0.0, to_s: 0.0, at: 0.0 };
        let pair = matches!(self.target, Target::Origin);
        let mut swept = 0;
        shared(first, second, |shared| {
            if self.on_ground(shared.first, &shared) && self.on_ground(shared.second, &shared) {
                return;
            }
            if pair && shared.first.curve.is_none() && shared.second.curve.is_none() {
                swept += 1;
                self.straight(shared, &mut nearest, findings);
            } else {
                let (from_s, to_s) = (shared.from_s.max(window_s.0), shared.to_s.min(window_s.1));
                if from_s <= to_s {
                    swept += 1;
                    self.curved(&Shared { from_s, to_s, ..shared }, findings);
                }
            }
        });
        findings.swept += swept;
        let lower_m = nearest.squared.sqrt();
        if lower_m < self.cutoff {
            let time_s = time_at(nearest.from_s, nearest.to_s, nearest.at);
            self.offer(lower_m, lower_m, time_s, findings);
        }
    }

    /// Whether one of two is on the ground for all of the time that they share. A stretch that leaves the ground begins on
    /// it, which matters where no more than that instant is shared.
    #[inline]
    fn on_ground(&self, of: &Segment, shared: &Shared<'_>) -> bool {
        let starts_there = |above: f64| {
            shared.from_s >= shared.to_s
                && !of.jumps()
                && of.position(shared.from_s).z + of.slack_at(shared.from_s) <= above
        };
        of.grounded || self.above.is_some_and(starts_there)
    }

    fn offer(&self, lower_m: f64, upper_m: f64, time_s: f64, findings: &mut Findings) {
        let approach = Approach { who: self.who, lower_m, upper_m, time_s, limit_m: self.keep_out.delta_m };
        findings.table(self.who).offer(approach);
    }

    #[inline]
    fn straight(&self, shared: Shared<'_>, nearest: &mut Nearest, findings: &mut Findings) {
        let approach = shared.straight().closest();
        if approach.squared < nearest.squared {
            *nearest = Nearest { squared: approach.squared, from_s: shared.from_s, to_s: shared.to_s, at: approach.at };
        }
        if self.may_violate {
            self.twice(&shared, findings);
        }
    }

    /// Judges a straight stretch by the sweep and by the cast.
    #[inline(never)]
    fn twice(&self, shared: &Shared<'_>, findings: &mut Findings) {
        let motion = shared.straight();
        let cast = self.keep_out.cast(&motion);
        if cast.is_some() || self.keep_out.is_near(&motion, motion.closest()) {
            self.near(shared, &motion, cast, findings);
        }
    }

    /// A straight stretch that is below the limit, close to it, or in contact by the cast.
    #[cold]
    fn near(&self, shared: &Shared<'_>, motion: &RelativeMotion, cast: Option<f64>, findings: &mut Findings) {
        let approach = motion.closest();
        let (limit, min_m) = (self.keep_out.delta_m, approach.separation_m());
        let span = (min_m < limit).then(|| motion.below(limit, approach));
        if let Some(Span { enter, exit }) = span {
            let from_start = motion.from_squared.sqrt() < limit;
            self.violated(shared, (enter, exit), (min_m, approach.at), from_start, findings);
        } else if is_coarse(motion, min_m, limit) {
            self.unknown(shared, min_m, min_m, None, findings);
        }
        let agrees = self.keep_out.agrees(motion, approach, span, cast);
        self.hear(shared, Opinion { contact: cast, agrees }, min_m, findings);
    }

    /// A stretch on which somebody is on a curve, or an obstacle is in the way.
    fn curved(&self, shared: &Shared<'_>, findings: &mut Findings) {
        let r = shared.relative();
        let limit = self.keep_out.delta_m;
        let slack = shared.first.slack() + shared.second.slack();
        let straight = r.len() <= 2;
        let exact = straight && matches!(self.target, Target::Origin);
        let rounding = if straight { 0.0 } else { shared.first.rounding() + shared.second.rounding() };
        let cutoff = limit.max(self.cutoff) + slack + rounding;
        let mut search = Search::new(self.target, &r);
        let motion = RelativeMotion::new(r[0], if r.len() > 1 { r[0] + r[1] } else { r[0] });
        let drawn = if straight {
            let (lower, at) = match self.target {
                Target::Origin => {
                    let approach = motion.closest();
                    (approach.separation_m(), approach.at)
                }
                Target::Shape(shape) => shape.closest(motion.from, motion.to),
            };
            (lower < cutoff).then_some(Minimum { lower, upper: lower, at })
        } else {
            search.minimum(cutoff, WIDTH_M)
        };
        let Some(drawn) = drawn else { return };

        let at = |u: f64| time_at(shared.from_s, shared.to_s, u);
        let slack_at = |u: f64| shared.first.slack_at(at(u)) + shared.second.slack_at(at(u));
        let floor = if matches!(self.target, Target::Origin) { 0.0 } else { f64::NEG_INFINITY };
        let least = |lowest: &Minimum| (lowest.lower - slack - rounding).max(floor);
        let lower = least(&drawn);
        let upper = upper_over(&search, (0.0, 1.0), &drawn, slack_at) + rounding;
        if lower < self.cutoff {
            self.offer(lower, upper, at(drawn.at), findings);
        }
        if upper < limit {
            let spans = if exact {
                let Span { enter, exit } = motion.below(limit, motion.closest());
                vec![(enter, exit)]
            } else {
                search.below(limit, drawn.at)
            };
            for (from, to) in spans {
                let holds = from <= drawn.at && drawn.at <= to;
                let other = if holds { None } else { search.minimum_within((from, to), f64::INFINITY, WIDTH_M) };
                let lowest = other.unwrap_or(drawn);
                let upper = upper_over(&search, (from, to), &lowest, slack_at) + rounding;
                if upper < limit {
                    let from_start = from <= 0.0 && search.distance(0.0) < limit;
                    self.violated(shared, (from, to), (upper, lowest.at), from_start, findings);
                } else {
                    let (part, lower) = (Shared { from_s: at(from), to_s: at(to), ..*shared }, least(&lowest));
                    self.unknown(&part, lower, upper, shared.rate_hz((lowest.upper - limit).abs()), findings);
                }
            }
        } else if lower < limit || (exact && slack == 0.0 && is_coarse(&motion, lower, limit)) {
            self.unknown(shared, lower, upper, shared.rate_hz((drawn.upper - limit).abs()), findings);
        }
        if self.may_violate {
            let opinion = self.second_opinion(&r, exact, &motion, &drawn, rounding, &search);
            self.hear(shared, opinion, drawn.upper, findings);
        }
    }

    fn second_opinion(
        &self,
        r: &[Vector3<f64>],
        exact: bool,
        motion: &RelativeMotion,
        drawn: &Minimum,
        rounding: f64,
        search: &Search<'_>,
    ) -> Opinion {
        let limit = self.keep_out.delta_m;
        match self.target {
            Target::Origin if exact => {
                let (approach, contact) = (motion.closest(), self.keep_out.cast(motion));
                let span = (approach.separation_m() < limit).then(|| motion.below(limit, approach));
                Opinion { contact, agrees: self.keep_out.agrees(motion, approach, span, contact) }
            }
            Target::Origin => second::along_chords(&self.keep_out, r, drawn, rounding),
            Target::Shape(shape) => second::from_shape(shape, limit, drawn, |u| search.position(u)),
        }
    }

    fn violated(
        &self,
        shared: &Shared<'_>,
        (enter, exit): (f64, f64),
        (min_m, at): (f64, f64),
        from_start: bool,
        findings: &mut Findings,
    ) {
        let time = |u: f64| time_at(shared.from_s, shared.to_s, u);
        let violation = Violation {
            who: self.who,
            from_s: time(enter),
            to_s: time(exit),
            min_m,
            min_at_s: time(at),
            limit_m: self.keep_out.delta_m,
        };
        findings.violated(Below { violation, from_start });
    }

    fn unknown(&self, shared: &Shared<'_>, lower_m: f64, upper_m: f64, rate_hz: Option<f64>, findings: &mut Findings) {
        let (from_s, to_s) = (shared.from_s, shared.to_s);
        let limit_m = self.keep_out.delta_m;
        findings.unknown(Undecided { who: self.who, from_s, to_s, lower_m, upper_m, limit_m, rate_hz });
    }

    fn hear(&self, shared: &Shared<'_>, opinion: Opinion, min_m: f64, findings: &mut Findings) {
        let second_s = opinion.contact.map(|u| time_at(shared.from_s, shared.to_s, u));
        if let Some(time_s) = second_s.filter(|time_s| !time_s.is_nan()) {
            findings.contact(time_s);
        }
        if !opinion.agrees {
            let (from_s, to_s) = (shared.from_s, shared.to_s);
            findings.disagree(Disagreement { who: self.who, from_s, to_s, min_m, second_s });
        }
    }
}

/// What the smallest distance over a part of a stretch is at most: what the ends say is a fact where they are samples.
fn upper_over(search: &Search<'_>, (from, to): (f64, f64), lowest: &Minimum, slack_at: impl Fn(f64) -> f64) -> f64 {
    let [start, end] = [from, to].map(|u| search.distance(u) + slack_at(u));
    (lowest.upper + slack_at(lowest.at)).min(start).min(end)
}

/// Whether a separation is clear by less than rounding, where that is no longer negligible against the limit.
fn is_coarse(motion: &RelativeMotion, min_m: f64, limit: f64) -> bool {
    let resolution = RESOLUTION * motion.from_squared.max(motion.to_squared).sqrt();
    resolution > NEGLIGIBLE_RESOLUTION * limit && min_m - limit < resolution
}

impl Shared<'_> {
    /// The relative motion of two straight stretches over the time that they share.
    #[inline]
    pub(super) fn straight(&self) -> RelativeMotion {
        let (a, b) = (self.first, self.second);
        if a.from_s == b.from_s && a.to_s == b.to_s {
            RelativeMotion::new(b.from - a.from, b.to - a.to)
        } else {
            let (from, to) = self.cut();
            RelativeMotion::new(from, to)
        }
    }

    /// The relative positions at both ends of the shared time, where the stretches are not over the same time.
    /// Displacements are added to the difference of two starting points, never positions to positions: far from the
    /// origin that loses nothing.
    #[inline(never)]
    fn cut(&self) -> (Vector3<f64>, Vector3<f64>) {
        let (a, b) = (self.first, self.second);
        let (start, by_a, by_b) = (b.from - a.from, a.to - a.from, b.to - b.from);
        let at = |time_s: f64, end: bool| {
            let share = |segment: &Segment| {
                if segment.to_s <= segment.from_s { f64::from(u8::from(end)) } else { segment.fraction(time_s) }
            };
            start + (by_b * share(b) - by_a * share(a))
        };
        (at(self.from_s, false), at(self.to_s, true))
    }

    /// The relative position as a polynomial of the fraction of the time that is shared: at least one coefficient, the last
    /// one of several not zero.
    pub(super) fn relative(&self) -> Vec<Vector3<f64>> {
        let (a, b) = (self.first, self.second);
        if a.curve.is_none() && b.curve.is_none() {
            let motion = self.straight();
            return vec![motion.from, motion.by];
        }
        let mut r = b.local(self.from_s, self.to_s);
        let less = a.local(self.from_s, self.to_s);
        r.resize(r.len().max(less.len()).max(1), Vector3::zeros());
        for (r, less) in r.iter_mut().zip(&less) {
            *r -= less;
        }
        while r.len() > 1 && r.last().is_some_and(|c| *c == Vector3::zeros()) {
            r.pop();
        }
        r
    }

    /// The sampling rate of both at which the slack is no more than the margin: over intervals of h it is the sum of what
    /// each has now, c = peak / `h_now`^2, times h^2.
    fn rate_hz(&self, margin: f64) -> Option<f64> {
        let curves = [self.first, self.second].into_iter().filter_map(|stretch| stretch.curve.as_ref());
        let per_s2: f64 = curves.map(|curve| curve.slack.peak() / (curve.to_s - curve.from_s).powi(2)).sum();
        (per_s2 > 0.0 && margin > 0.0).then(|| (per_s2 / margin).sqrt())
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
        shared(first, second, |shared| times.push((shared.from_s, shared.to_s)));
        times
    }

    #[test]
    fn two_jumps_at_one_instant_are_swept_together() {
        let first = [still(0.0, 1.0, 0.0), jump(1.0, [0.0, 5.0]), still(1.0, 2.0, 5.0)];
        let second = [still(0.0, 1.0, 5.0), jump(1.0, [5.0, 10.0]), still(1.0, 2.0, 10.0)];
        let mut closest = f64::INFINITY;
        shared(&first, &second, |shared| closest = closest.min(shared.straight().closest().separation_m()));
        assert_eq!(closest, 5.0);
        assert_eq!(times(&first, &second), [(0.0, 1.0), (1.0, 1.0), (1.0, 2.0)]);
        // One jumps while the other stands: the jump meets it where it stands.
        let waiting = [still(0.5, 1.5, 3.0)];
        let mut closest = f64::INFINITY;
        shared(&first, &waiting, |shared| closest = closest.min(shared.straight().closest().separation_m()));
        assert_eq!(closest, 0.0);
    }

    #[test]
    fn what_ends_where_the_other_begins_shares_an_instant() {
        assert_eq!(times(&[still(0.0, 1.0, 0.0)], &[still(1.0, 2.0, 0.0)]), [(1.0, 1.0)]);
        assert_eq!(times(&[still(0.0, 1.0, 0.0)], &[still(1.5, 2.0, 0.0)]), []);
        let first = [still(0.0, 1.0, 0.0)];
        assert_eq!(times(&first, &[still(0.0, 1.0, 3.0), jump(1.0, [3.0, 4.0])]), [(0.0, 1.0), (1.0, 1.0)]);
        let late = [still(0.0, 1.0, 0.0), still(5.0, 6.0, 0.0)];
        assert_eq!(times(&late, &[still(0.0, 9.0, 0.0)]), [(0.0, 1.0), (5.0, 6.0)]);
    }

    fn closest(first: &[Segment], second: &[Segment]) -> f64 {
        let mut closest = f64::INFINITY;
        shared(first, second, |shared| closest = closest.min(shared.straight().closest().separation_m()));
        closest
    }

    #[test]
    fn a_last_jump_is_swept_once_and_one_seen_once_meets_the_jump_of_the_other() {
        // In convoy: one takes the place that the other leaves at the same instant, and the other is not seen again.
        let lead = [still(0.0, 1.0, 0.0), jump(1.0, [0.0, 1.0])];
        let tail = [still(0.0, 1.0, -1.0), jump(1.0, [-1.0, 0.0]), still(1.0, 2.0, 0.0), jump(2.0, [0.0, 0.0])];
        assert_eq!((closest(&lead, &tail), closest(&tail, &lead)), (1.0, 1.0));
        // Seen once between two gaps, where the other's jump leads.
        let seen_once = [still(0.0, 0.0, 50.0), still(1.0, 1.0, 0.0), still(3.0, 3.0, 50.0)];
        assert_eq!((closest(&seen_once, &tail), closest(&tail, &seen_once)), (0.0, 0.0));
        assert_eq!(closest(&[still(0.0, 0.0, 50.0), still(1.0, 1.0, 3.0), still(3.0, 3.0, 50.0)], &tail), 3.0);
    }
}
