//! Audit of published plans: each plan against all plans that were valid at its publication.
//!
//! At its publication a plan P replaces earlier plans of its vehicle from its start on. P is compared with the valid
//! plans of all other vehicles, over the whole time in which both motions are known. These plans were available at the
//! publication of P. Every pair of plans is thus compared once, when the later of the two is published.
//!
//! A plan that ends is held, flown on, or unknown ([`PlanEnd`]). Held and continued plans are compared until both have
//! ended.
//!
//! If the positions of the vehicles are recorded too, each plan is also compared with the flights of all other
//! vehicles, until the next plan of its vehicle replaces it. The largest distance of each flight from its own plan is
//! found at the recorded positions.
//!
//! The distances are those of [`audit`](super::audit): enclosed on curves by Bernstein coefficients, and checked by
//! parry. A bound on the motion of two plans leaves out pairs that are neither below their limit nor among the closest.

use std::collections::BTreeMap;
use std::iter;
use std::mem;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;

use super::flights::Flights;
use super::plan_sweep::{Chord, Comparisons, Extent, Motion};
use super::settings::{RecordedError, Settings};
use super::vehicle::Vehicle;
use crate::findings::{Finding, Tally};
use crate::ledger::Interruption;
use crate::outcome::{Approach, Status};
use crate::polynomial::derivative;
use crate::segment::Segment;
use crate::sweep::Interval;
use tautline_core::swarm::Pair;
use tautline_core::track::{Item, Plan, PlanEnd};

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

/// Motion that a plan is compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Counterpart {
    /// Plan of another vehicle.
    Plan(PlanReference),
    /// Recorded flight of another vehicle, given by its index.
    Flight(usize),
}

impl Counterpart {
    /// Returns the index of the vehicle.
    #[must_use]
    pub fn vehicle(self) -> usize {
        match self {
            Self::Plan(plan) => plan.vehicle,
            Self::Flight(vehicle) => vehicle,
        }
    }

    /// Returns the plan; `None` for a flight.
    #[must_use]
    pub fn plan(self) -> Option<PlanReference> {
        match self {
            Self::Plan(plan) => Some(plan),
            Self::Flight(_) => None,
        }
    }
}

/// Time during which a plan and its counterpart are, or may be, closer than their limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanConflict {
    /// Plan; of two, the one that was published last.
    pub plan: PlanReference,
    /// Plan that was valid at this publication, or flight.
    pub other: Counterpart,
    /// Start \[s\].
    pub from_s: f64,
    /// End \[s\].
    pub to_s: f64,
    /// Bounds of the smallest distance \[m\]; equal for a violation. With a bounded motion of flights, a violation has
    /// no lower bound.
    pub lower_m: f64,
    /// See `lower_m`.
    pub upper_m: f64,
    /// Instant of the smallest distance \[s\]; `None` for an undecided time, and if the two detectors contradict each
    /// other.
    pub min_at_s: Option<f64>,
    /// Limit \[m\].
    pub limit_m: f64,
}

impl Finding for PlanConflict {
    type Subject = [(usize, u64); 2];

    fn subject(&self) -> Self::Subject {
        // Numbers of plans begin at 1.
        let other = self.other.plan().map_or(0, |plan| plan.number);
        [(self.plan.vehicle, self.plan.number), (self.other.vehicle(), other)]
    }

    fn span_s(&self) -> [f64; 2] {
        [self.from_s, self.to_s]
    }

    fn excess(&self) -> f64 {
        self.limit_m - if self.min_at_s.is_some() { self.upper_m } else { self.lower_m }
    }
}

/// Closest approach of the plan of a vehicle to the plans, or to the flight, of another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanApproach {
    /// Plan; of two, the one that was published last.
    pub plan: PlanReference,
    /// Plan that was valid at this publication, or flight.
    pub other: Counterpart,
    /// Distance and time.
    pub approach: Approach,
}

/// Separations of plans from other plans, or from flights.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanSeparations {
    /// Verdict. Without a violation, the verdict is undecided if nothing was compared, or if the motion of a flight is
    /// unknown during a comparison. The same holds if a vehicle begins to fly a plan farther than its limit from it.
    pub status: Status,
    /// Number of comparisons of a plan with a plan, or with a flight. A comparison of two vehicles that are on the
    /// ground throughout does not count.
    pub comparisons: u64,
    /// Times below the limit, by start; of a long list the worst, and the first of each two motions.
    pub violations: Vec<PlanConflict>,
    /// Undecided times, shortened likewise.
    pub undecided: Vec<PlanConflict>,
    /// Number of violations.
    pub violations_tally: Tally,
    /// Number of undecided times.
    pub undecided_tally: Tally,
    /// Closest approaches, of at most ten pairs of vehicles.
    pub closest: Vec<PlanApproach>,
    /// Number of intervals in which the two detectors contradict each other.
    pub disagreements: u64,
}

/// Distance of a flight from the plan of its vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackingError {
    /// Plan.
    pub plan: PlanReference,
    /// Instant \[s\].
    pub at_s: f64,
    /// Distance \[m\].
    pub distance_m: f64,
}

/// Result of an audit of plans.
#[derive(Clone, Debug, PartialEq)]
pub struct PlansOutcome {
    /// Motion after the end of a plan.
    pub end: PlanEnd,
    /// Number of plans.
    pub plans: u64,
    /// Separations of each plan from the plans that were valid at its publication.
    pub published: PlanSeparations,
    /// Separations of each plan from the flights of other vehicles; `None` without flights.
    pub flown: Option<PlanSeparations>,
    /// Largest distance of a flight from its plan at the recorded positions; `None` without flights of planned
    /// vehicles.
    pub tracking_error: Option<TrackingError>,
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
    /// Start of the next plan of the vehicle, which replaces this one, or its publication if that is later \[s\].
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

    /// Returns the motion up to an instant.
    fn motion(&self, end: PlanEnd, until_s: f64) -> Motion<'_> {
        let tail = self.tail(end, until_s);
        Motion { segments: &self.segments, chords: &self.chords, tail, radius_m: self.radius_m }
    }

    /// Returns the time in which the vehicle flies the plan.
    fn flown(&self) -> Interval {
        Interval { from_s: self.from_s.max(self.reference.published_s), to_s: self.until_s }
    }

    /// Returns the position at an instant from the start on; `None` if the motion is unknown.
    fn position(&self, end: PlanEnd, time_s: f64) -> Option<Vector3<f64>> {
        let next = self.segments.partition_point(|segment| segment.to_s < time_s);
        let tail = || self.tail(end, time_s).map(|tail| tail.to);
        self.segments.get(next).map_or_else(tail, |segment| Some(segment.position(time_s)))
    }
}

/// Audits published plans in order of publication, then flights.
#[derive(Clone, Debug)]
pub struct PlanAuditor {
    /// Settings of plans. The ends of the judged time apply to the motion after the end of a plan too, and are left out
    /// here.
    settings: Settings,
    judged: Interval,
    end: PlanEnd,
    /// Valid plans of each vehicle, in order of their starts.
    fleet: Vec<Vec<Known>>,
    /// Plans that are no longer valid, for the comparison with flights.
    past: Vec<Known>,
    flights: Option<Flights>,
    /// Numbers of plans of each vehicle.
    counts: Vec<u64>,
    now_s: f64,
    published: Comparisons,
}

impl PlanAuditor {
    /// Creates an auditor with the limits on separations, ends of the judged time and selected vehicles of these
    /// settings.
    ///
    /// # Errors
    /// [`RecordedError`] if a number of the settings is out of range, or a vehicle has a clock offset.
    pub fn new(settings: Settings, end: PlanEnd) -> Result<Self, RecordedError> {
        settings.check()?;
        if let Some((name, _)) = settings.vehicles.iter().find(|(_, vehicle)| vehicle.offset_s != 0.0) {
            return Err(RecordedError::OffsetOfPlans { vehicle: name.clone() });
        }
        Ok(Self {
            published: Comparisons::new(settings.limits(), true),
            judged: settings.window(),
            settings: Settings { from_s: None, until_s: None, motion: None, ..settings },
            end,
            fleet: Vec::new(),
            past: Vec::new(),
            flights: None,
            counts: Vec::new(),
            now_s: f64::NEG_INFINITY,
        })
    }

    /// Stops soon after the flag is set: [`push`](Self::push) and [`finish`](Self::finish) then return
    /// [`RecordedError::Interrupted`].
    #[must_use]
    pub fn with_interruption(mut self, flag: Arc<AtomicBool>) -> Self {
        self.published.set_interruption(Interruption::new(flag));
        self
    }

    /// Also compares the plans with flights, whose items [`push_flights`](Self::push_flights) takes. The memory grows
    /// with the number of items and of plans. `settings` are those of the flights. Call it before the first
    /// [`push`](Self::push).
    #[must_use]
    pub fn with_flights(self, settings: &Settings) -> Self {
        Self { flights: Some(Flights::new(settings)), ..self }
    }

    /// Takes the next items of flights, in order of time. `names` are those of all vehicles.
    ///
    /// # Errors
    /// [`RecordedError`] if an item is invalid.
    pub fn push_flights(&mut self, names: &[String], items: &[Item]) -> Result<(), RecordedError> {
        self.flights.as_mut().map_or(Ok(()), |flights| flights.push(names, items))
    }

    /// Judges the next plan; returns the times at which it is, or may be, below its limit. `names` are those of all
    /// vehicles.
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
            if self.published.is_interrupted() {
                return Err(RecordedError::Interrupted);
            }
        }
        self.replace(known);
        Ok(conflicts)
    }

    /// Returns the plan as segments; `None` if it has none.
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

    /// Replaces the motion of the vehicle from the start of its new plan on, but not before its publication. Forgets
    /// plans of the past.
    fn replace(&mut self, known: Known) {
        let (now_s, plans) = (self.now_s, &mut self.fleet[known.reference.vehicle]);
        for earlier in plans.iter_mut() {
            earlier.until_s = earlier.until_s.min(known.from_s.max(now_s));
        }
        plans.push(known);
        let is_over = |plan: &mut Known| plan.until_s <= now_s.max(plan.from_s);
        let over = plans.extract_if(.., is_over);
        if self.flights.is_some() {
            self.past.extend(over);
        } else {
            over.for_each(drop);
        }
    }

    /// Compares a new plan with the valid plans of another vehicle.
    fn compare(&mut self, known: &Known, other: usize, conflicts: &mut Vec<PlanConflict>) {
        let plans = mem::take(&mut self.fleet[other]);
        let ends = plans.iter().map(|plan| plan.to_s.min(plan.until_s)).fold(known.to_s, f64::max);
        // If both plans have ended at the publication, the vehicles are compared at this instant.
        let ends = if self.end == PlanEnd::Unknown { ends } else { ends.max(known.reference.published_s) };
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
        if window.from_s > window.to_s || self.end == PlanEnd::Unknown && known.to_s.min(other.to_s) < window.from_s {
            return;
        }
        let [motion, other_motion] = [known, other].map(|plan| plan.motion(self.end, window.to_s));
        if !self.published.count_judged(&motion, &other_motion, window) {
            return;
        }
        // A held point is in the box of its plan.
        let has_moving_tail =
            [&motion, &other_motion].into_iter().flat_map(|motion| &motion.tail).any(|tail| tail.from != tail.to);
        let pair = Pair::new(known.reference.vehicle, other.reference.vehicle);
        let reach_m = self.published.reach_m(pair, [known.radius_m, other.radius_m]);
        if has_moving_tail || known.extent.is_within(&other.extent, reach_m) {
            let other = (Counterpart::Plan(other.reference), &other_motion);
            conflicts.extend(self.published.compare((known.reference, &motion), other, window));
        }
    }

    /// Returns the verdict over all plans and flights.
    ///
    /// # Errors
    /// [`RecordedError`] if vehicles may have exchanged names in plans and flights, or the work is interrupted.
    pub fn finish(mut self) -> Result<PlansOutcome, RecordedError> {
        let (mut flown, mut tracking_error) = (None, None);
        if let Some(flights) = self.flights.take() {
            let mut plans = mem::take(&mut self.past);
            plans.extend(mem::take(&mut self.fleet).into_iter().flatten());
            plans.sort_by(|a, b| a.reference.published_s.total_cmp(&b.reference.published_s));
            // Plans that were replaced before their start are not flown.
            plans.retain(|plan| plan.flown().from_s < plan.flown().to_s);
            self.refuse_exchanged(&flights, &plans)?;
            flown = Some(self.compare_with_flights(&flights, &plans)?);
            tracking_error = self.tracking_error(&flights, &plans);
        }
        let plans = self.counts.iter().sum();
        Ok(PlansOutcome { end: self.end, plans, published: self.published.finish(), flown, tracking_error })
    }

    /// Compares each plan with the flights of all other vehicles, while its vehicle flies it.
    fn compare_with_flights(&self, flights: &Flights, plans: &[Known]) -> Result<PlanSeparations, RecordedError> {
        let mut comparisons = Comparisons::new(self.settings.limits(), flights.are_exact());
        comparisons.set_interruption(self.published.interruption());
        comparisons.has_unknown = flights.has_contradiction();
        for plan in plans {
            comparisons.has_unknown |= self.is_astray(flights, plan);
            for other in (0..flights.count()).filter(|other| *other != plan.reference.vehicle) {
                if comparisons.is_interrupted() {
                    return Err(RecordedError::Interrupted);
                }
                let (flown, Some(end_s)) = (plan.flown(), flights.end_s(other)) else { continue };
                let known_s = if self.end == PlanEnd::Unknown { plan.to_s } else { f64::INFINITY };
                let to_s = flown.to_s.min(self.judged.to_s).min(known_s).min(end_s);
                let window = Interval { from_s: flown.from_s.max(self.judged.from_s), to_s };
                let Some(part) = flights.part(other, window) else { continue };
                comparisons.has_unknown |= part.has_gap;
                let (radius_m, tail) = (flights.radius_m(other), None);
                let flight = Motion { segments: &part.segments, chords: &part.chords, tail, radius_m };
                let motion = plan.motion(self.end, to_s);
                if !comparisons.count_judged(&motion, &flight, window) {
                    continue;
                }
                comparisons.compare((plan.reference, &motion), (Counterpart::Flight(other), &flight), window);
            }
        }
        Ok(comparisons.finish())
    }

    /// Returns whether a vehicle is farther than its limit from its plan when it begins to fly the plan. Names, frames
    /// or clocks of plans and flights may then differ.
    fn is_astray(&self, flights: &Flights, plan: &Known) -> bool {
        let (vehicle, start_s, limits) = (plan.reference.vehicle, plan.flown().from_s, self.settings.limits());
        let limit_m = limits.farthest_m(limits.of_vehicles(plan.radius_m, plan.radius_m));
        let both = plan.position(self.end, start_s).zip(flights.position(vehicle, start_s));
        both.is_some_and(|(planned, flown)| (planned - flown).norm() > limit_m)
    }

    /// Refuses plans whose vehicles may have exchanged names. At the starts of its plans each of these vehicles is, on
    /// average, farther away from its own plans than another one of them, or than a vehicle without plans.
    fn refuse_exchanged(&self, flights: &Flights, plans: &[Known]) -> Result<(), RecordedError> {
        // By planned and by other vehicle: the distances from the own flight less those from the other one.
        let mut excess: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for plan in plans {
            let (vehicle, start_s) = (plan.reference.vehicle, plan.flown().from_s);
            let excess = excess.entry(vehicle).or_insert_with(|| vec![0.0; flights.count()]);
            let both = plan.position(self.end, start_s).zip(flights.position(vehicle, start_s));
            let Some((planned, own)) = both else { continue };
            for (other, excess) in excess.iter_mut().enumerate() {
                if let Some(place) = flights.position(other, start_s) {
                    *excess += flights.distance_m(planned, own) - flights.distance_m(planned, place);
                }
            }
        }
        let nearest = excess.iter().filter_map(|(vehicle, excess)| {
            let (other, most) = excess.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
            (*most > 0.0).then_some((*vehicle, other))
        });
        let nearest: BTreeMap<usize, usize> = nearest.collect();
        for (vehicle, other) in &nearest {
            let chain = iter::successors(Some(*other), |next| nearest.get(next).copied()).take(flights.count());
            let is_exchanged = chain.clone().any(|next| next == *vehicle)
                || chain.last().is_some_and(|last| !excess.contains_key(&last));
            if is_exchanged {
                let (vehicle, other) = (flights.name(*vehicle), flights.name(*other));
                return Err(RecordedError::ExchangedFlights { vehicle, other });
            }
        }
        Ok(())
    }

    /// Returns the largest distance of a flight from its plan at the recorded positions.
    fn tracking_error(&self, flights: &Flights, plans: &[Known]) -> Option<TrackingError> {
        let errors = plans.iter().flat_map(|plan| {
            let (vehicle, flown) = (plan.reference.vehicle, plan.flown());
            let (from_s, to_s) = (flown.from_s.max(self.judged.from_s), flown.to_s.min(self.judged.to_s));
            flights.instants_s(vehicle, Interval { from_s, to_s }).filter_map(move |at_s| {
                let (planned, flown) = plan.position(self.end, at_s).zip(flights.position(vehicle, at_s))?;
                Some(TrackingError { plan: plan.reference, at_s, distance_m: flights.distance_m(planned, flown) })
            })
        });
        errors.max_by(|a, b| a.distance_m.total_cmp(&b.distance_m))
    }
}
