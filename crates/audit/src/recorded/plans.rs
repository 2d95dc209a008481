//! Audit of published plans: each plan against all plans that were valid at its publication.
//!
//! At its publication a plan P replaces earlier plans of its vehicle from its start on. It is compared with the latest
//! plans of all other vehicles that were published before, over the whole time in which both are known. Its vehicle
//! could know these plans. Every pair of plans is thus compared once, when the later of the two is published.
//!
//! A plan that ends is held, flown on, or unknown ([`PlanEnd`]). Held and continued plans are compared until both have
//! ended.
//!
//! The distances are those of [`audit`](super::audit): enclosed on curves by Bernstein coefficients, and checked by
//! parry. A bound on the motion of two plans leaves out those that are neither below their limit nor among the
//! closest.

use std::collections::BTreeMap;
use std::mem;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;

use super::settings::{Limits, RecordedError, Settings};
use super::vehicle::Vehicle;
use crate::cross_check::KeepOut;
use crate::findings::{Finding, LISTED, Shortlist, Tally};
use crate::ledger::{Interruption, Results};
use crate::outcome::{Approach, ObjectPair, Status};
use crate::pair_sweep::PairSweep;
use crate::polynomial::{derivative, motion_deviation};
use crate::segment::Segment;
use crate::sweep::{Interval, RelativeMotion};
use tautline_core::swarm::Pair;
use tautline_core::track::{Item, Plan, PlanEnd};

/// Rounding of bounds on positions, relative to their coordinates: at most sixteen operations.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Plan of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanReference {
    /// Index of the vehicle.
    pub vehicle: usize,
    /// Number of the plan among those of its vehicle, from 1, in order of publication.
    pub number: u64,
    /// Instant of publication \[s\].
    pub published_s: f64,
}

/// Time during which two plans are, or may be, closer than their limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanConflict {
    /// Plan that was published last.
    pub plan: PlanReference,
    /// Plan that was valid at this publication.
    pub other: PlanReference,
    /// Start \[s\].
    pub from_s: f64,
    /// End \[s\].
    pub to_s: f64,
    /// Bounds of the smallest distance \[m\]; equal for a violation.
    pub lower_m: f64,
    /// See `lower_m`.
    pub upper_m: f64,
    /// Instant of the smallest distance \[s\]; `None` for an undecided time.
    pub min_at_s: Option<f64>,
    /// Limit \[m\].
    pub limit_m: f64,
}

impl Finding for PlanConflict {
    type Subject = [(usize, u64); 2];

    fn subject(&self) -> Self::Subject {
        [self.plan, self.other].map(|plan| (plan.vehicle, plan.number))
    }

    fn span_s(&self) -> [f64; 2] {
        [self.from_s, self.to_s]
    }

    fn excess(&self) -> f64 {
        self.limit_m - self.lower_m
    }
}

/// Closest approach of the plans of two vehicles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanApproach {
    /// Plan that was published last.
    pub plan: PlanReference,
    /// Plan that was valid at this publication.
    pub other: PlanReference,
    /// Distance and time.
    pub approach: Approach,
}

/// Result of an audit of plans.
#[derive(Clone, Debug, PartialEq)]
pub struct PlansOutcome {
    /// Verdict; undecided if no two plans were compared.
    pub status: Status,
    /// Motion after the end of a plan.
    pub end: PlanEnd,
    /// Number of plans.
    pub plans: u64,
    /// Number of comparisons of a plan with the plans of another vehicle.
    pub comparisons: u64,
    /// Times below the limit, by start; of a long list the worst, and the first of each two plans.
    pub violations: Vec<PlanConflict>,
    /// Undecided times, shortened likewise.
    pub undecided: Vec<PlanConflict>,
    /// Number of violations.
    pub violations_tally: Tally,
    /// Number of undecided times.
    pub undecided_tally: Tally,
    /// Closest plans, of at most ten pairs of vehicles.
    pub closest: Vec<PlanApproach>,
    /// Number of intervals in which the two detectors contradict each other.
    pub disagreements: u64,
}

/// Uniform motion over a segment, with a bound on the distance of the segment from it.
#[derive(Clone, Copy, Debug)]
struct Chord {
    from_s: f64,
    to_s: f64,
    from: Vector3<f64>,
    to: Vector3<f64>,
    deviation_m: f64,
}

impl Chord {
    fn new(segment: &Segment) -> Self {
        let Segment { from_s, to_s, from, to, .. } = *segment;
        let curved = segment.curve().map_or(0.0, |_| motion_deviation(&segment.local(Interval { from_s, to_s })));
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
struct Extent {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Extent {
    fn new(chords: &[Chord]) -> Self {
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
    fn is_within(&self, other: &Self, distance_m: f64) -> bool {
        let aside = (self.low - other.high).sup(&(other.low - self.high));
        aside.max() <= distance_m
    }
}

/// Published plan as segments.
#[derive(Clone, Debug)]
struct Known {
    reference: PlanReference,
    segments: Vec<Segment>,
    chords: Vec<Chord>,
    extent: Extent,
    /// Start and end of the pieces \[s\].
    from_s: f64,
    to_s: f64,
    /// Position and velocity at the end.
    last: (Vector3<f64>, Vector3<f64>),
    /// Start of the next plan of the vehicle, which replaces this one \[s\].
    until_s: f64,
    radius_m: f64,
}

impl Known {
    /// Returns the motion after the end until an instant.
    fn tail(&self, end: PlanEnd, until_s: f64) -> Option<Segment> {
        let until_s = until_s.min(self.until_s);
        let (from, velocity) = self.last;
        let to = match end {
            PlanEnd::Hold => from,
            PlanEnd::Continue => from + velocity * (until_s - self.to_s),
            PlanEnd::Unknown => return None,
        };
        // A vehicle that lands stays on the ground.
        let grounded = self.segments.last().filter(|_| end == PlanEnd::Hold).and_then(|last| last.grounded);
        let tail = Segment::straight(self.to_s, until_s, from, to);
        (until_s > self.to_s).then(|| Segment { grounded: grounded.or(tail.grounded), ..tail })
    }
}

/// Audits published plans in order of publication.
#[derive(Clone, Debug)]
pub struct PlanAuditor {
    /// Settings without the ends of the judged time, which apply to the motion after the end of a plan too.
    settings: Settings,
    judged: Interval,
    limits: Limits,
    end: PlanEnd,
    /// Valid plans of each vehicle, in order of their starts.
    fleet: Vec<Vec<Known>>,
    /// Number of plans of each vehicle.
    counts: Vec<u64>,
    now_s: f64,
    comparisons: u64,
    results: Results,
    /// Plans of the closest approaches.
    closest: BTreeMap<Pair, [PlanReference; 2]>,
    violations: Shortlist<PlanConflict>,
    undecided: Shortlist<PlanConflict>,
    /// Numbers of violations and of undecided times.
    found: [u64; 2],
    are_counts_exact: bool,
    disagreements: u64,
}

impl PlanAuditor {
    /// Creates an auditor with the limits on separations, ends of the judged time, offsets and selected vehicles of
    /// these settings.
    ///
    /// # Errors
    /// [`RecordedError`] if a number of the settings is out of range.
    pub fn new(settings: Settings, end: PlanEnd) -> Result<Self, RecordedError> {
        settings.check()?;
        Ok(Self {
            limits: settings.limits(),
            judged: settings.window(),
            settings: Settings { from_s: None, until_s: None, ..settings },
            end,
            fleet: Vec::new(),
            counts: Vec::new(),
            now_s: f64::NEG_INFINITY,
            comparisons: 0,
            results: Results::default(),
            closest: BTreeMap::new(),
            violations: Shortlist::new(LISTED),
            undecided: Shortlist::new(LISTED),
            found: [0; 2],
            are_counts_exact: true,
            disagreements: 0,
        })
    }

    /// Stops soon after the flag is set: [`push`](Self::push) then returns [`RecordedError::Interrupted`].
    #[must_use]
    pub fn with_interruption(mut self, flag: Arc<AtomicBool>) -> Self {
        self.results.interruption = Interruption::new(flag);
        self
    }

    /// Judges the next plan; returns the times at which it is below its limit. `names` are those of all vehicles.
    ///
    /// # Errors
    /// [`RecordedError`] if the plan is invalid, was published before the last one, or the work is interrupted.
    pub fn push(&mut self, names: &[String], plan: &Plan) -> Result<Vec<PlanConflict>, RecordedError> {
        let Some(name) = names.get(plan.vehicle) else {
            return Err(RecordedError::Unnamed { vehicle: plan.vehicle });
        };
        let published_s = plan.published_s;
        if !published_s.is_finite() {
            let what = "the instant of publication is not a finite number".to_owned();
            return Err(RecordedError::Item { vehicle: name.clone(), time_s: published_s, what });
        }
        if published_s < self.now_s {
            return Err(RecordedError::OutOfOrder {
                vehicle: name.clone(),
                previous_s: self.now_s,
                time_s: published_s,
            });
        }
        self.now_s = published_s;
        let vehicles = names.len().max(self.fleet.len());
        self.fleet.resize_with(vehicles, Vec::new);
        self.counts.resize(vehicles, 0);
        self.counts[plan.vehicle] += 1;
        if self.settings.only.as_ref().is_some_and(|only| !only.contains(name)) {
            return Ok(Vec::new());
        }
        let reference = PlanReference { vehicle: plan.vehicle, number: self.counts[plan.vehicle], published_s };
        let Some(known) = self.known(name, plan, reference)? else { return Ok(Vec::new()) };
        let mut conflicts = Vec::new();
        for other in 0..self.fleet.len() {
            if other != plan.vehicle {
                self.compare(&known, other, &mut conflicts);
            }
            if self.results.interruption.is_set() {
                return Err(RecordedError::Interrupted);
            }
        }
        self.replace(known);
        Ok(conflicts)
    }

    /// Returns the plan as segments; `None` if nothing of it is in the judged time.
    fn known(&self, name: &str, plan: &Plan, reference: PlanReference) -> Result<Option<Known>, RecordedError> {
        let mut vehicle = Vehicle::new(name, &self.settings, f64::INFINITY);
        for piece in &plan.pieces {
            vehicle.take(&Item::Piece(piece.clone()))?;
        }
        vehicle.check(&self.settings, false)?;
        let segments = mem::take(&mut vehicle.segments);
        let (Some(first), Some(last)) = (segments.first(), segments.last()) else { return Ok(None) };
        let velocity = last
            .curve()
            .map_or_else(Vector3::zeros, |curve| derivative(&curve.coefficients, curve.to_s - curve.from_s));
        let chords: Vec<_> = segments.iter().map(Chord::new).collect();
        Ok(Some(Known {
            reference,
            extent: Extent::new(&chords),
            chords,
            from_s: first.from_s,
            to_s: last.to_s,
            last: (last.to, velocity),
            until_s: f64::INFINITY,
            radius_m: vehicle.radius_m.unwrap_or(0.0),
            segments,
        }))
    }

    /// Replaces the motion of the vehicle from the start of its new plan on, and forgets plans of the past.
    fn replace(&mut self, known: Known) {
        let plans = &mut self.fleet[known.reference.vehicle];
        plans.retain(|earlier| earlier.from_s < known.from_s);
        if let Some(last) = plans.last_mut() {
            last.until_s = last.until_s.min(known.from_s);
        }
        plans.push(known);
        let now_s = self.now_s;
        plans.retain(|plan| plan.until_s > now_s);
    }

    /// Compares a new plan with the valid plans of another vehicle.
    fn compare(&mut self, known: &Known, other: usize, conflicts: &mut Vec<PlanConflict>) {
        let plans = mem::take(&mut self.fleet[other]);
        let ends = plans.iter().map(|plan| plan.to_s.min(plan.until_s)).fold(known.to_s, f64::max);
        for plan in &plans {
            self.compare_two(known, plan, ends, conflicts);
        }
        self.fleet[other] = plans;
    }

    /// Compares two plans up to an instant.
    fn compare_two(&mut self, known: &Known, other: &Known, until_s: f64, conflicts: &mut Vec<PlanConflict>) {
        let judged = self.judged;
        let from_s = known.from_s.max(known.reference.published_s).max(other.from_s).max(judged.from_s);
        let window = Interval { from_s, to_s: until_s.min(other.until_s).min(judged.to_s) };
        if window.from_s > window.to_s {
            return;
        }
        let tails = [known, other].map(|plan| plan.tail(self.end, window.to_s));
        if self.end == PlanEnd::Unknown && known.to_s.min(other.to_s) < window.from_s {
            return;
        }
        self.comparisons += 1;
        let pair = Pair::new(known.reference.vehicle, other.reference.vehicle);
        let objects = ObjectPair::Vehicles(pair);
        let limit_m = self.limits.of_vehicles(known.radius_m, other.radius_m);
        let cutoff = self.results.closest.cutoff(objects, limit_m);
        let reach_m = self.limits.reach_m(limit_m.max(cutoff)).max();
        if !may_come_within([known, other], &tails, reach_m) {
            return;
        }
        let in_window = |(plan, tail): (&Known, Option<Segment>)| -> Vec<Segment> {
            plan.segments.iter().cloned().chain(tail).filter_map(|segment| segment.clipped(window)).collect()
        };
        let [known_tail, other_tail] = tails;
        let [mut first, mut second] = [(known, known_tail), (other, other_tail)].map(in_window);
        if known.reference.vehicle > other.reference.vehicle {
            mem::swap(&mut first, &mut second);
        }
        let before = self.results.closest.kept.iter().find(|kept| kept.pair == objects).copied();
        let mut results = Results {
            closest: mem::take(&mut self.results.closest),
            interruption: self.results.interruption.clone(),
            ..Results::bounded(self.results.interruption.clone())
        };
        let (target, keep_out, above) = (self.limits.target(), KeepOut::new(limit_m), self.limits.above);
        PairSweep { pair: objects, target, keep_out, cutoff, judges: true, may_violate: true, above }.judge(
            &first,
            &second,
            window,
            &mut results,
        );
        self.results.closest = results.closest;
        let after = self.results.closest.kept.iter().find(|kept| kept.pair == objects).copied();
        let [plan, other] = [known, other].map(|known| known.reference);
        if after.is_some() && after != before {
            self.closest.insert(pair, [plan, other]);
        }
        self.disagreements += results.ledger.parry.disagreements;
        let lists = results.ledger.into_lists();
        let violations = lists.violations.iter().map(|found| PlanConflict {
            plan,
            other,
            from_s: found.from_s,
            to_s: found.to_s,
            lower_m: found.min_m,
            upper_m: found.min_m,
            min_at_s: Some(found.min_at_s),
            limit_m,
        });
        let violations: Vec<_> = violations.collect();
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
        self.violations.extend(violations.iter().copied());
        self.undecided.extend(undecided);
        let tallies = [lists.violations_tally, lists.undecided_tally];
        for (found, tally) in self.found.iter_mut().zip(tallies) {
            *found += tally.count;
            self.are_counts_exact &= tally.is_exact;
        }
        conflicts.extend(violations);
    }

    /// Returns the verdict over all plans.
    #[must_use]
    pub fn finish(self) -> PlansOutcome {
        let [violations, undecided] = [self.violations, self.undecided].map(Shortlist::into_list);
        let is_decided = self.comparisons > 0 && undecided.is_empty() && self.disagreements == 0;
        let tally = |count, listed| Tally { count, listed, is_exact: self.are_counts_exact };
        let closest = self.results.closest.kept.iter().filter_map(|approach| {
            let [plan, other] = *self.closest.get(&approach.pair.vehicles()?)?;
            Some(PlanApproach { plan, other, approach: *approach })
        });
        PlansOutcome {
            status: Status::new(!violations.is_empty(), is_decided),
            end: self.end,
            plans: self.counts.iter().sum(),
            comparisons: self.comparisons,
            violations_tally: tally(self.found[0], violations.len()),
            undecided_tally: tally(self.found[1], undecided.len()),
            violations,
            undecided,
            closest: closest.collect(),
            disagreements: self.disagreements,
        }
    }
}

/// Returns whether two plans, with the motions after their ends, could come within a distance.
fn may_come_within([first, second]: [&Known; 2], tails: &[Option<Segment>; 2], distance_m: f64) -> bool {
    let has_moving_tail = tails.iter().flatten().any(|tail| tail.from != tail.to);
    // A held point is in the box of its plan.
    if !has_moving_tail && !first.extent.is_within(&second.extent, distance_m) {
        return false;
    }
    let [first_tail, second_tail] = tails.each_ref().map(|tail| tail.as_ref().map(Chord::new));
    let second: Vec<_> = second.chords.iter().copied().chain(second_tail).collect();
    let mut start = 0;
    first.chords.iter().copied().chain(first_tail).any(|chord| {
        while second.get(start).is_some_and(|other| other.to_s < chord.from_s) {
            start += 1;
        }
        let shared = second[start..].iter().take_while(|other| other.from_s <= chord.to_s);
        shared.into_iter().any(|other| chord.distance_m(other) <= distance_m)
    })
}
