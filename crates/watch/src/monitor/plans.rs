//! Published plans of planners: each is judged at its arrival against the plans of other drones that are valid then.
//!
//! Messages of planners name no vehicle of the positions, so drones have names of their own: their numbers. A plan
//! starts at a time of the planners' clock, on which plans are judged. The present time of this clock follows from the
//! clock of the positions if these have a common one, and otherwise from that of this machine. The choice may change
//! between two plans, but does not move them against each other. A start that is more than [`LARGEST_LEAD_S`] from the
//! arrival contradicts the choice.

use std::collections::hash_map::DefaultHasher;
use std::collections::{BTreeMap, VecDeque};
use std::hash::{Hash as _, Hasher as _};

use super::Monitor;
use crate::event::{Event, Fault, PlanClock, Problem};
use crate::settings::TimeBase;
use crate::source::PlanMessage;
use tautline_audit::recorded::{self, Counterpart, PlanAuditor, PlanConflict, PlanReference};
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::track::{Piece, Plan, PlanEnd};
use tautline_recordings::read::LivePlan;

/// Largest time between the arrival of a plan and its start \[s\].
const LARGEST_LEAD_S: f64 = 60.0;
const NS_PER_S: i64 = 1_000_000_000;
/// Largest number of pieces of a plan.
const MOST_PIECES: usize = 1000;
/// Largest number of plans of a drone that are valid or start later.
const MOST_VALID: usize = 100;
/// Number of the newest plans of a drone by which a repetition is recognised.
const MOST_SEEN: usize = 1024;
/// Largest number of conflicts that are kept for the state.
const MOST_CONFLICTS: usize = 4096;

/// Plans of all drones. Times are those of the planners' clock since its second of the first plan \[s\].
#[derive(Clone, Debug)]
pub(super) struct PublishedPlans {
    auditor: PlanAuditor,
    /// Numbers of the drones in order of their first plans.
    names: Vec<String>,
    drones: BTreeMap<i32, Drone>,
    /// Time of the last publication \[s\].
    published_s: f64,
    /// Conflicts that are not over.
    conflicts: Vec<PlanConflict>,
    /// Number of plans, and of conflicts.
    counts: [u64; 2],
    /// Whether each plan so far is of a planner that holds the last point.
    are_held: bool,
    clock: PlanClock,
    /// Time of this machine since 1970 at time 0 of the caller \[ns\].
    machine_ns: Option<i64>,
    /// Time of the planners' clock at time 0 here \[ns\].
    zero_ns: Option<i64>,
    /// Time of the caller's clock less that of the planners' clock, at the last plan \[s\].
    offset_s: f64,
}

#[derive(Clone, Debug)]
struct Drone {
    /// Index of its name.
    index: usize,
    /// Starts of its plans that are valid or start later, in order \[s\].
    starts_s: Vec<f64>,
    /// Starts \[ns\] and digests of its newest plans.
    seen: VecDeque<(i64, u64)>,
    /// Latest start among older plans \[ns\].
    forgotten_ns: Option<i64>,
}

impl PublishedPlans {
    fn new(delta_m: f64, end: PlanEnd) -> Result<Self, Problem> {
        let auditor = PlanAuditor::new(recorded::Settings::delta(delta_m), end).map_err(|error| wrong(&error))?;
        Ok(Self {
            auditor,
            names: Vec::new(),
            drones: BTreeMap::new(),
            published_s: f64::NEG_INFINITY,
            conflicts: Vec::new(),
            counts: [0; 2],
            are_held: true,
            clock: PlanClock::Positions,
            machine_ns: None,
            zero_ns: None,
            offset_s: 0.0,
        })
    }

    /// Returns a time of this machine since 1970 \[ns\] as a time of the caller's clock \[s\]. The times of an arrival
    /// on both clocks give their offset.
    ///
    /// The arrivals are read one after the other, so that a delay makes their difference larger. The smallest one is
    /// kept until the clock of this machine steps.
    fn of_machine_s(&mut self, time_ns: i64, arrival_ns: i64, arrival_s: f64) -> f64 {
        #[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
        let seen_ns = arrival_ns.saturating_sub((arrival_s * 1e9).round() as i64);
        let is_delay = |known_ns: &i64| (0..NS_PER_S).contains(&seen_ns.saturating_sub(*known_ns));
        let zero_ns = self.machine_ns.filter(is_delay).unwrap_or(seen_ns);
        self.machine_ns = Some(zero_ns);
        time_ns.saturating_sub(zero_ns) as f64 * 1e-9
    }

    /// Returns whether the plan was published before. A repetition is no new publication.
    fn is_repeated(&self, plan: &LivePlan) -> Result<bool, Problem> {
        let LivePlan { drone, start_ns, .. } = plan;
        let Some(known) = self.drones.get(drone) else { return Ok(false) };
        match known.seen.iter().find(|(seen_ns, _)| seen_ns == start_ns) {
            // A plan among older starts may be a repetition.
            None if known.forgotten_ns.is_some_and(|forgotten_ns| *start_ns <= forgotten_ns) => Err(wrong(&format!(
                "drone {drone}: a new plan must start after all plans before the newest {MOST_SEEN}, got {start_ns} ns"
            ))),
            None => Ok(false),
            Some((_, known)) if *known == digest(plan) => Ok(true),
            Some(_) => Err(wrong(&format!("another plan of drone {drone} starts at {start_ns} ns"))),
        }
    }

    /// Takes a plan that starts at a time and was published at another one \[s\]. Returns its conflicts.
    fn take(&mut self, plan: &LivePlan, start_s: f64, published_s: f64) -> Result<Vec<PlanConflict>, Problem> {
        let index = self.drones.get(&plan.drone).map_or(self.names.len(), |drone| drone.index);
        if index == self.names.len() {
            self.names.push(plan.drone.to_string());
            let (starts_s, seen) = (Vec::new(), VecDeque::new());
            self.drones.insert(plan.drone, Drone { index, starts_s, seen, forgotten_ns: None });
        }
        self.published_s = self.published_s.max(published_s);
        let published_s = self.published_s;
        let Some(drone) = self.drones.get_mut(&plan.drone) else { return Ok(Vec::new()) };
        // A plan is over when the next one has started.
        let over = drone.starts_s.partition_point(|other_s| *other_s <= published_s).saturating_sub(1);
        drone.starts_s.drain(..over);
        if drone.starts_s.partition_point(|other_s| *other_s < start_s) >= MOST_VALID {
            return Err(wrong(&format!(
                "drone {} has {MOST_VALID} valid or later plans that start before this plan",
                plan.drone
            )));
        }
        let pieces = plan.pieces.iter().map(|piece| Piece {
            vehicle: index,
            from_s: piece.from_s + start_s,
            to_s: piece.to_s + start_s,
            coefficients: piece.coefficients.clone(),
        });
        let published = Plan { vehicle: index, published_s, pieces: pieces.collect() };
        let found = self.auditor.push(&self.names, &published).map_err(|error| wrong(&error))?;
        drone.starts_s.retain(|other_s| *other_s < start_s);
        drone.starts_s.push(start_s);
        if drone.seen.len() == MOST_SEEN
            && let Some((start_ns, _)) = drone.seen.pop_front()
        {
            drone.forgotten_ns = drone.forgotten_ns.max(Some(start_ns));
        }
        drone.seen.push_back((plan.start_ns, digest(plan)));
        self.are_held &= plan.is_held;
        self.counts[0] += 1;
        self.counts[1] += found.len() as u64;
        self.replace(index, start_s);
        let room = MOST_CONFLICTS - self.conflicts.len();
        self.conflicts.extend(found.iter().take(room));
        Ok(found)
    }

    /// Ends the conflicts of the earlier plans of a drone at the start of its new plan \[s\].
    fn replace(&mut self, drone: usize, start_s: f64) {
        self.conflicts.retain_mut(|conflict| {
            if ![conflict.plan.vehicle, conflict.other.vehicle()].contains(&drone) {
                return true;
            }
            conflict.to_s = conflict.to_s.min(start_s);
            conflict.from_s < start_s
        });
    }
}

impl Monitor {
    /// Takes a plan of a planner. Its arrival is its publication. A repetition is ignored.
    ///
    /// # Errors
    /// [`Problem`] if the plan cannot be used; the caller reports it as [`Fault::Garbage`].
    pub fn take_plan(&mut self, message: &PlanMessage) -> Result<(), Problem> {
        let PlanMessage { plan, arrival_s, arrival_ns, .. } = message;
        let now_s = match self.settings.time_base {
            TimeBase::Arrival => {
                self.now_s = self.now_s.max(self.time_of_arrival(*arrival_s));
                *arrival_s
            }
            TimeBase::Stamps if self.now_s.is_finite() => self.now_s - self.shift_s,
            TimeBase::Stamps => *arrival_s,
        };
        if plan.pieces.len() > MOST_PIECES {
            return Err(wrong(&format!("it has {} pieces, more than {MOST_PIECES}", plan.pieces.len())));
        }
        let end = self.settings.plan_end.unwrap_or(PlanEnd::Hold);
        let plans = match &mut self.plans {
            Some(plans) => plans,
            none => none.insert(PublishedPlans::new(self.settings.delta_m, end)?),
        };
        if plans.is_repeated(plan)? {
            return Ok(());
        }
        let (start_s, clock) = match self.clock {
            Some(clock) => (clock.time_of(plan.start_ns as f64 * 1e-9) - self.shift_s, PlanClock::Positions),
            None => (plans.of_machine_s(plan.start_ns, *arrival_ns, now_s), PlanClock::Machine),
        };
        if (start_s - now_s).abs() > LARGEST_LEAD_S {
            return Err(Problem::OtherPlanClock(start_s - now_s, clock));
        }
        if plans.names.len() >= self.settings.max_vehicles && !plans.drones.contains_key(&plan.drone) {
            self.fault(Fault::TooManyVehicles, None, *arrival_s);
            return Ok(());
        }
        let zero_ns = *plans.zero_ns.get_or_insert(plan.start_ns.div_euclid(NS_PER_S).saturating_mul(NS_PER_S));
        let planned_s = plan.start_ns.saturating_sub(zero_ns) as f64 * 1e-9;
        let published_s = planned_s - (start_s - now_s);
        // With an inferred clock, a plan that seems to be late is judged from its start on.
        let published_s = if clock == PlanClock::Machine { published_s.min(planned_s) } else { published_s };
        let found = plans.take(plan, planned_s, published_s)?;
        plans.offset_s = start_s - planned_s;
        if clock == PlanClock::Machine {
            plans.clock = clock;
        }
        let (at_s, shift_s) = (now_s + self.shift_s, self.shift_s + plans.offset_s);
        for conflict in found {
            let conflict = later(conflict, shift_s);
            self.emit(Event::PlanConflict { conflict, left_s: (conflict.from_s - at_s).max(0.0), at_s });
        }
        Ok(())
    }

    /// Returns the number of a drone as text. Indices are those of [`PlanReference`].
    #[must_use]
    pub fn drone(&self, index: usize) -> &str {
        self.plans.as_ref().and_then(|plans| plans.names.get(index)).map_or("", String::as_str)
    }

    /// Returns the number of plans and of their conflicts so far; `None` before the first plan.
    #[must_use]
    pub fn plan_counts(&self) -> Option<[u64; 2]> {
        self.plans.as_ref().map(|plans| plans.counts)
    }

    /// Returns the facts on which the judgement of plans rests; none before the first plan.
    #[must_use]
    pub fn plan_facts(&self) -> Vec<Fact> {
        let Some(plans) = &self.plans else { return Vec::new() };
        let (source, clock) = match plans.clock {
            PlanClock::Positions => (self.settings.source_of_clocks(), "that of the positions"),
            PlanClock::Machine => (Source::Inferred, "that of this machine"),
        };
        let (end, source_of_end) = match self.settings.plan_end {
            Some(end) => (end, Source::Declared),
            None if plans.are_held => (PlanEnd::Hold, Source::Convention),
            None => (PlanEnd::Hold, Source::Default),
        };
        vec![
            Fact::name(FactKind::PlanPublication, Source::Observed, "their arrival"),
            Fact::name(FactKind::Clock, source, clock).about("plans"),
            Fact::name(FactKind::PlanEnd, source_of_end, end.name()),
        ]
    }

    /// Returns the conflict of plans with the earliest start that is not over, and forgets those that are.
    pub(super) fn plan_conflict(&mut self) -> Option<PlanConflict> {
        let plans = self.plans.as_mut()?;
        let shift_s = self.shift_s + plans.offset_s;
        let now_s = self.now_s - shift_s;
        plans.conflicts.retain(|conflict| conflict.to_s >= now_s);
        let first = plans.conflicts.iter().min_by(|a, b| a.from_s.total_cmp(&b.from_s))?;
        Some(later(*first, shift_s))
    }
}

/// Returns the conflict with its times later by `shift_s`.
fn later(conflict: PlanConflict, shift_s: f64) -> PlanConflict {
    let reference = |plan: PlanReference| PlanReference { published_s: plan.published_s + shift_s, ..plan };
    PlanConflict {
        plan: reference(conflict.plan),
        other: match conflict.other {
            Counterpart::Plan(plan) => Counterpart::Plan(reference(plan)),
            flight @ Counterpart::Flight(_) => flight,
        },
        from_s: conflict.from_s + shift_s,
        to_s: conflict.to_s + shift_s,
        min_at_s: conflict.min_at_s.map(|at_s| at_s + shift_s),
        ..conflict
    }
}

/// Returns the digest of the pieces of a plan.
fn digest(plan: &LivePlan) -> u64 {
    let mut hasher = DefaultHasher::new();
    for piece in &plan.pieces {
        [piece.from_s, piece.to_s].map(f64::to_bits).hash(&mut hasher);
        piece.coefficients.len().hash(&mut hasher);
        for number in piece.coefficients.iter().flatten() {
            number.to_bits().hash(&mut hasher);
        }
    }
    hasher.finish()
}

fn wrong(why: &impl ToString) -> Problem {
    Problem::WrongPlan(why.to_string())
}
