//! Sweeps of plans past other plans, or past recorded flights.

use std::collections::BTreeMap;
use std::mem;

use nalgebra::Vector3;

use super::plans::{Counterpart, PlanApproach, PlanConflict, PlanReference, PlanSeparations};
use super::settings::Limits;
use crate::cross_check::KeepOut;
use crate::findings::{LISTED, Shortlist, Tally};
use crate::ledger::{Interruption, Results};
use crate::outcome::{ObjectPair, Status};
use crate::pair_sweep::{PairSweep, overlaps};
use crate::polynomial::motion_deviation;
use crate::segment::Segment;
use crate::sweep::{Interval, RelativeMotion};
use tautline_core::swarm::Pair;

/// Rounding of bounds on positions, relative to their coordinates: at most sixteen operations.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Uniform motion over a segment, with a bound on the distance of the segment from it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chord {
    from_s: f64,
    to_s: f64,
    from: Vector3<f64>,
    to: Vector3<f64>,
    deviation_m: f64,
}

impl Chord {
    pub(super) fn new(segment: &Segment) -> Self {
        let Segment { from_s, to_s, from, to, .. } = *segment;
        let curved = segment.curve().map_or(0.0, |_| motion_deviation(&segment.local(Interval { from_s, to_s })));
        let curved = curved + segment.deviation();
        let rounding = segment.rounding() + ROUNDING * (from.amax() + to.amax());
        Self { from_s, to_s, from, to, deviation_m: curved + rounding }
    }

    #[inline]
    fn position(&self, time_s: f64) -> Vector3<f64> {
        let length_s = self.to_s - self.from_s;
        let share = if length_s > 0.0 { ((time_s - self.from_s) / length_s).clamp(0.0, 1.0) } else { 0.0 };
        self.from + (self.to - self.from) * share
    }

    /// Returns a lower bound on the distance from another chord while both last; infinite if they share no instant.
    #[inline]
    fn distance_m(&self, other: &Self) -> f64 {
        let (from_s, to_s) = (self.from_s.max(other.from_s), self.to_s.min(other.to_s));
        if from_s > to_s {
            return f64::INFINITY;
        }
        let deviation_m = self.deviation_m + other.deviation_m;
        // A jump has two positions at one instant.
        if self.from_s >= self.to_s || other.from_s >= other.to_s {
            let reach_m = (self.to - self.from).norm() + (other.to - other.from).norm();
            return (self.from - other.from).norm() - reach_m - deviation_m;
        }
        let [start, end] = [from_s, to_s].map(|time_s| self.position(time_s) - other.position(time_s));
        RelativeMotion::new(start, end).closest().separation_m() * (1.0 - ROUNDING) - deviation_m
    }
}

/// Box around the motion, without the motion after its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Extent {
    pub(super) fn new(chords: &[Chord]) -> Self {
        let empty = Self { low: Vector3::repeat(f64::INFINITY), high: Vector3::repeat(f64::NEG_INFINITY) };
        chords.iter().fold(empty, |all, chord| {
            let aside = Vector3::repeat(chord.deviation_m);
            Self {
                low: all.low.inf(&(chord.from.inf(&chord.to) - aside)),
                high: all.high.sup(&(chord.from.sup(&chord.to) + aside)),
            }
        })
    }

    #[inline]
    pub(super) fn is_within(&self, other: &Self, distance_m: f64) -> bool {
        let aside = (self.low - other.high).sup(&(other.low - self.high));
        aside.max() <= distance_m
    }
}

/// Motion during a comparison.
#[derive(Clone, Debug)]
pub(super) struct Motion<'a> {
    pub(super) segments: &'a [Segment],
    /// Bounds on the segments, one each.
    pub(super) chords: &'a [Chord],
    /// Motion after the last segment.
    pub(super) tail: Option<Segment>,
    pub(super) radius_m: f64,
}

impl Motion<'_> {
    /// Returns the bounds on the segments and on the motion after them.
    fn chords(&self) -> impl Iterator<Item = Chord> + '_ {
        self.chords.iter().copied().chain(self.tail.as_ref().map(Chord::new))
    }

    fn segments_in(&self, window: Interval) -> Vec<Segment> {
        self.segments.iter().chain(&self.tail).filter_map(|segment| segment.clipped(window)).collect()
    }

    /// Returns whether two motions could come within a distance.
    fn may_come_within(&self, other: &Self, distance_m: f64) -> bool {
        let others: Vec<_> = other.chords().collect();
        let mut start = 0;
        self.chords().any(|chord| {
            while others.get(start).is_some_and(|other| other.to_s < chord.from_s) {
                start += 1;
            }
            let shared = others[start..].iter().take_while(|other| other.from_s <= chord.to_s);
            shared.into_iter().any(|other| chord.distance_m(other) <= distance_m)
        })
    }
}

/// Findings of comparisons.
#[derive(Clone, Debug)]
pub(super) struct Comparisons {
    limits: Limits,
    /// Whether the smallest distance of a violation is known, not only an upper bound of it.
    is_exact: bool,
    count: u64,
    /// Whether a motion is unknown during a comparison.
    pub(super) has_unknown: bool,
    results: Results,
    /// Plan and counterpart of the closest approaches.
    closest: BTreeMap<Pair, (PlanReference, Counterpart)>,
    violations: Shortlist<PlanConflict>,
    undecided: Shortlist<PlanConflict>,
    /// Numbers of violations and of undecided times.
    found: [u64; 2],
    are_counts_exact: bool,
    disagreements: u64,
}

impl Comparisons {
    pub(super) fn new(limits: Limits, is_exact: bool) -> Self {
        Self {
            limits,
            is_exact,
            count: 0,
            has_unknown: false,
            results: Results::default(),
            closest: BTreeMap::new(),
            violations: Shortlist::new(LISTED),
            undecided: Shortlist::new(LISTED),
            found: [0; 2],
            are_counts_exact: true,
            disagreements: 0,
        }
    }

    pub(super) fn set_interruption(&mut self, interruption: Interruption) {
        self.results.interruption = interruption;
    }

    pub(super) fn interruption(&self) -> Interruption {
        self.results.interruption.clone()
    }

    pub(super) fn is_interrupted(&self) -> bool {
        self.results.interruption.is_set()
    }

    /// Returns the distance within which the motions of two vehicles must be swept.
    pub(super) fn reach_m(&self, pair: Pair, radii_m: [f64; 2]) -> f64 {
        let limit_m = self.limits.of_vehicles(radii_m[0], radii_m[1]);
        let cutoff = self.results.closest.cutoff(ObjectPair::Vehicles(pair), limit_m);
        self.limits.farthest_m(limit_m.max(cutoff))
    }

    /// Counts the comparison of two motions in a window. Returns `false` without a time at which one of them is above
    /// the ground.
    pub(super) fn count_judged(&mut self, motion: &Motion<'_>, other: &Motion<'_>, window: Interval) -> bool {
        let mut is_judged = self.limits.above.is_none();
        if !is_judged {
            overlaps(&motion.segments_in(window), &other.segments_in(window), |overlap| {
                is_judged |= [overlap.first, overlap.second].iter().any(|segment| segment.grounded != Some(true));
            });
        }
        self.count += u64::from(is_judged);
        is_judged
    }

    /// Compares a plan with another motion in a window; returns the violations and the undecided times.
    pub(super) fn compare(
        &mut self,
        (plan, motion): (PlanReference, &Motion<'_>),
        (other, other_motion): (Counterpart, &Motion<'_>),
        window: Interval,
    ) -> Vec<PlanConflict> {
        let pair = Pair::new(plan.vehicle, other.vehicle());
        let radii_m = [motion.radius_m, other_motion.radius_m];
        if !motion.may_come_within(other_motion, self.reach_m(pair, radii_m)) {
            return Vec::new();
        }
        let [mut first, mut second] = [motion, other_motion].map(|motion| motion.segments_in(window));
        if plan.vehicle > other.vehicle() {
            mem::swap(&mut first, &mut second);
        }
        let objects = ObjectPair::Vehicles(pair);
        let limit_m = self.limits.of_vehicles(radii_m[0], radii_m[1]);
        let before = self.results.closest.kept.iter().find(|kept| kept.pair == objects).copied();
        let mut results = Results {
            closest: mem::take(&mut self.results.closest),
            ..Results::bounded(self.results.interruption.clone())
        };
        let sweep = PairSweep {
            pair: objects,
            target: self.limits.target(),
            keep_out: KeepOut::new(limit_m),
            cutoff: results.closest.cutoff(objects, limit_m),
            judges: true,
            may_violate: true,
            above: self.limits.above,
        };
        sweep.judge(&first, &second, window, &mut results);
        self.results.closest = results.closest;
        let after = self.results.closest.kept.iter().find(|kept| kept.pair == objects).copied();
        if after.is_some() && after != before {
            self.closest.insert(pair, (plan, other));
        }
        let disagreements = results.ledger.parry.disagreements;
        self.disagreements += disagreements;
        let lists = results.ledger.into_lists();
        let violations = lists.violations.iter().map(|found| PlanConflict {
            plan,
            other,
            from_s: found.from_s,
            to_s: found.to_s,
            lower_m: if self.is_exact { found.min_m } else { f64::NEG_INFINITY },
            upper_m: found.min_m,
            min_at_s: Some(found.min_at_s),
            limit_m,
        });
        let mut found: Vec<_> = violations.collect();
        let violations = found.len();
        let undecided = lists.undecided.iter().map(|found| PlanConflict {
            plan,
            other,
            from_s: found.from_s,
            to_s: found.to_s,
            lower_m: found.lower_m,
            upper_m: found.upper_m,
            min_at_s: None,
            limit_m,
        });
        found.extend(undecided);
        self.violations.extend(found[..violations].iter().copied());
        self.undecided.extend(found[violations..].iter().copied());
        let tallies = [lists.violations_tally, lists.undecided_tally];
        for (count, tally) in self.found.iter_mut().zip(tallies) {
            *count += tally.count;
            self.are_counts_exact &= tally.is_exact;
        }
        if found.is_empty() && disagreements > 0 {
            let Interval { from_s, to_s } = window;
            found.push(PlanConflict {
                plan,
                other,
                from_s,
                to_s,
                lower_m: 0.0,
                upper_m: limit_m,
                min_at_s: None,
                limit_m,
            });
        }
        found
    }

    /// Returns the verdict over all comparisons.
    pub(super) fn finish(self) -> PlanSeparations {
        let [violations, undecided] = [self.violations, self.undecided].map(Shortlist::into_list);
        let is_decided = self.count > 0 && undecided.is_empty() && self.disagreements == 0 && !self.has_unknown;
        let tally = |count, listed| Tally { count, listed, is_exact: self.are_counts_exact };
        let closest = self.results.closest.kept.iter().filter_map(|approach| {
            let (plan, other) = *self.closest.get(&approach.pair.vehicles()?)?;
            Some(PlanApproach { plan, other, approach: *approach })
        });
        PlanSeparations {
            status: Status::new(!violations.is_empty(), is_decided),
            comparisons: self.count,
            violations_tally: tally(self.found[0], violations.len()),
            undecided_tally: tally(self.found[1], undecided.len()),
            violations,
            undecided,
            closest: closest.collect(),
            disagreements: self.disagreements,
        }
    }
}
