//! The judge's place in the loop: every way is swept, and what it finds is kept for the next sample.

use super::ending::SimError;
use crate::plant::{HullContact, Path, Plant};
use crate::scenario::Scenario;
use tautline_audit as audit;
use tautline_audit::{
    AuditError, AuditOutcome, Auditor, ClearanceAuditor, ClearanceFinding, ClearanceOutcome, ObjectPair, Obstacle,
    Status, StepFinding, Violation, swept_distance_m, swept_separation_m,
};
use tautline_core::record::Event;
use tautline_core::swarm::{Bounce, ClosestApproach, Pair, Rows, Swarm, row};
use tautline_laws::graph::Graph;
use tautline_laws::law::Law;
use tautline_laws::space::{self, Metric, NearPairs};

/// The auditor with what the loop asks of it from step to step.
#[derive(Clone)]
pub(super) struct Judge {
    auditor: Auditor,
    /// Where what must stay empty around a vehicle is an ellipsoid: the judge of distances in metres, by the widest hulls.
    in_metres: Option<Auditor>,
    metric: Metric,
    /// Positions in the lengths that the first is told.
    scaled: Rows,
    delta_m: f64,
    /// Sweeps that were clear of everything by less than paths may bend away from what was swept.
    bent: u64,
    bent_past_obstacles: u64,
    /// By how much the motion that is judged may err from the law's \[m\], once a step was too long for the law.
    error_m: Option<f64>,
    /// Whether a violation of two vehicles, and one of an obstacle's clearance, is deeper than the error of its time.
    beyond_error: [bool; 2],
    /// What judges the way past obstacles, where there are any, and these.
    clearance: Option<ClearanceAuditor>,
    obstacles: Vec<Obstacle>,
    /// The least that any vehicle has beyond an obstacle's clearance now.
    pub(super) room_m: f64,
    /// Closest approach since the last sample.
    pub(super) closest: Option<ClosestApproach>,
    /// Smallest separation over the last sweep: bounds from below how near any pair is now.
    pub(super) nearest_m: f64,
    /// Pairs that a step may have brought too near.
    near: NearPairs,
    pub(super) engine_contacts: Vec<Pair>,
    contacts_now: Vec<Pair>,
    pub(super) bounces: Vec<Bounce>,
    /// Hulls that pushed each other in the last step, and in the one before.
    hulls_now: Vec<HullContact>,
    hulls_before: Vec<HullContact>,
}

/// What is known of a flight in the end.
pub(super) struct Judged {
    pub(super) audit: AuditOutcome,
    pub(super) in_metres: Option<AuditOutcome>,
    pub(super) clearance: Option<ClearanceOutcome>,
    pub(super) engine_contacts: Vec<Pair>,
    pub(super) bounces: Vec<Bounce>,
}

impl Judge {
    pub(super) fn new(scenario: &Scenario) -> Result<Self, SimError> {
        let count = scenario.count();
        let obstacles: Vec<_> = scenario.obstacles.iter().map(judged).collect();
        let clearance = if obstacles.is_empty() { None } else { Some(ClearanceAuditor::new(count, &obstacles)?) };
        let metric = scenario.metric();
        let widest_m = 2.0 * scenario.hull_radius_m.iter().copied().fold(0.0, f64::max);
        let in_metres = (!metric.is_metres()).then(|| Auditor::new(count, widest_m)).transpose()?;
        Ok(Self {
            auditor: Auditor::new(count, scenario.delta_m)?,
            in_metres,
            metric,
            scaled: Rows::zeros(0),
            delta_m: scenario.delta_m,
            bent: 0,
            bent_past_obstacles: 0,
            error_m: None,
            beyond_error: [false; 2],
            clearance,
            obstacles,
            room_m: f64::INFINITY,
            closest: None,
            nearest_m: 0.0,
            near: NearPairs::default(),
            engine_contacts: Vec::new(),
            contacts_now: Vec::new(),
            bounces: Vec::new(),
            hulls_now: Vec::new(),
            hulls_before: Vec::new(),
        })
    }

    pub(super) fn start(&mut self, time_s: f64, positions_m: &Rows, events: &mut Vec<Event>) -> Result<(), AuditError> {
        let Self { auditor, in_metres, metric, scaled, .. } = self;
        if let Some(in_metres) = in_metres {
            in_metres.start(time_s, positions_m)?;
        }
        let finding = auditor.start(time_s, told(*metric, positions_m, scaled))?;
        note(finding, &mut self.closest, &mut self.nearest_m, events);
        self.clear_of_obstacles(time_s, positions_m, 0.0, events)
    }

    /// Sweeps the straight line to these positions, from which no true path leaves by more than `bend_m` \[m\].
    pub(super) fn sweep(
        &mut self,
        time_s: f64,
        positions_m: &Rows,
        bend_m: f64,
        events: &mut Vec<Event>,
    ) -> Result<(), AuditError> {
        let Self { auditor, in_metres, metric, scaled, .. } = self;
        if let Some(in_metres) = in_metres {
            in_metres.step(time_s, positions_m)?;
        }
        let finding = auditor.step(time_s, told(*metric, positions_m, scaled))?;
        if let Some(closest) = finding.closest {
            let nearer_m = 2.0 * metric.most_scaled(bend_m);
            self.bent += u64::from(is_open(closest.separation_m, nearer_m, self.delta_m));
        }
        note(finding, &mut self.closest, &mut self.nearest_m, events);
        self.clear_of_obstacles(time_s, positions_m, bend_m, events)?;
        if let Some(error_m) = self.error_m {
            self.beyond_error[0] |= self.delta_m - self.nearest_m > self.metric.most_scaled(error_m);
            self.beyond_error[1] |= -self.room_m > error_m;
        }
        Ok(())
    }

    /// Takes note that what is swept from now on may err from the law's motion by `error_m` \[m\]. Violations up to now are exact.
    pub(super) fn may_err_by(&mut self, error_m: f64) {
        if self.error_m.replace(error_m).is_none() {
            self.beyond_error = self.violated();
        }
    }

    /// Whether two vehicles violated delta, and whether one violated an obstacle's clearance.
    fn violated(&self) -> [bool; 2] {
        let mut past_obstacles = self.clearance.iter().flat_map(ClearanceAuditor::violations);
        [!self.auditor.violations().is_empty(), past_obstacles.next().is_some()]
    }

    fn clear_of_obstacles(
        &mut self,
        time_s: f64,
        positions_m: &Rows,
        bend_m: f64,
        events: &mut Vec<Event>,
    ) -> Result<(), AuditError> {
        if let Some(clearance) = &mut self.clearance {
            let ClearanceFinding { least_room_m, began, ended } = clearance.step(time_s, positions_m)?;
            self.room_m = least_room_m;
            self.bent_past_obstacles += u64::from(is_open(least_room_m, bend_m, 0.0));
            for &Violation { pair, from_s: time_s, .. } in began {
                if let ObjectPair::Obstacle { vehicle, obstacle } = pair {
                    events.push(Event::ObstacleViolationBegan { vehicle, obstacle, time_s });
                }
            }
            for ended @ &Violation { pair, to_s: time_s, min_m, .. } in ended {
                if let ObjectPair::Obstacle { vehicle, obstacle } = pair {
                    events.extend(deepest_past_obstacle(ended));
                    events.push(Event::ObstacleViolationEnded { vehicle, obstacle, time_s, min_m });
                }
            }
        }
        Ok(())
    }

    /// The smallest clearance so far \[m\], below 0 exactly where there is a violation.
    pub(super) fn least_clearance_m(&self) -> Option<f64> {
        let pairs = self.auditor.closest().map(|closest| closest.separation_m - self.delta_m);
        let obstacles = self.clearance.as_ref().and_then(|clearance| clearance.closest().first());
        let beyond = obstacles.map(|approach| approach.upper_m - approach.limit_m);
        let least_m = pairs.into_iter().chain(beyond).reduce(f64::min)?;
        // Rounding never moves a distance across its limit.
        Some(if self.violated().contains(&true) { least_m.min(-f64::MIN_POSITIVE) } else { least_m.max(0.0) })
    }

    /// The closest that two vehicles came so far.
    pub(super) fn least_separation(&self) -> Option<ClosestApproach> {
        self.auditor.closest()
    }

    /// The closest approaches of violations that last to an instant.
    pub(super) fn lasting(&self, time_s: f64) -> impl Iterator<Item = Event> + '_ {
        let pairs = self.auditor.violations().iter().filter(move |violation| violation.to_s == time_s).map(deepest);
        let past_obstacles = self.clearance.iter().flat_map(ClearanceAuditor::violations);
        pairs.chain(past_obstacles.filter(move |violation| violation.to_s == time_s).filter_map(deepest_past_obstacle))
    }

    /// Who came closest to which obstacle so far.
    pub(super) fn closest_to_obstacles(&self) -> impl Iterator<Item = Event> + '_ {
        let closest = self.clearance.iter().flat_map(ClearanceAuditor::closest);
        closest.filter_map(|approach| match approach.pair {
            ObjectPair::Obstacle { vehicle, obstacle } => {
                let (time_s, distance_m) = (approach.time_s, approach.lower_m);
                Some(Event::ObstacleApproach { vehicle, obstacle, time_s, distance_m })
            }
            ObjectPair::Vehicles(_) => None,
        })
    }

    /// Whether the move from `start` to `end` takes more than half of some pair's clearance above the law's barrier, or of what
    /// a vehicle has beyond an obstacle's clearance where the law keeps clear of obstacles.
    pub(super) fn refuses(
        &mut self,
        (law, links): (&dyn Law, &Graph),
        (start, path, end): (&Swarm, &Path, &Swarm),
        moved_m: f64,
    ) -> bool {
        let Some(barrier_m) = law.capabilities().barrier_m else { return false };
        let start = &start.positions_m;
        let instants = || path.passed().map(|(_, rows)| rows).chain([&end.positions_m]);
        if moved_m > 0.5 * self.room_m
            && law.capabilities().avoids_obstacles
            && self.nears_an_obstacle(start, path, end)
        {
            return true;
        }
        // No pair is nearer than `nearest_m` and none closes by more than twice the longest move.
        if 2.0 * moved_m <= 0.5 * self.metric.shortest_m(self.nearest_m - barrier_m) {
            return false;
        }
        let metric = self.metric;
        let loses_half = |(i, j): (usize, usize)| {
            let apart = |rows: &Rows| metric.scaled(row(rows, j) - row(rows, i));
            let mut from = apart(start);
            let least_m = barrier_m + 0.5 * (from.norm() - barrier_m);
            instants().map(apart).any(|to| swept_separation_m(std::mem::replace(&mut from, to), to) < least_m)
        };
        if law.capabilities().sensing_range_m.is_none() {
            return links.edges().any(loses_half);
        }
        // A pair that begins farther apart keeps half of its clearance.
        self.near.update(start, metric.longest_m(barrier_m) + 4.0 * metric.ratio().max(1.0 / metric.ratio()) * moved_m);
        self.near.pairs().iter().copied().any(loses_half)
    }

    /// Lower bound of the present separations of the pairs that the law acts on, in the judge's lengths: all pairs where the
    /// law senses, else those with a link. It costs a look at every edge of a graph that is not complete.
    pub(super) fn nearest_acted_on_m(&self, law: &dyn Law, links: &Graph, state: &Swarm) -> f64 {
        if law.capabilities().sensing_range_m.is_some() || links.is_complete() {
            return self.nearest_m;
        }
        let apart = |(i, j)| self.metric.scaled(row(&state.positions_m, j) - row(&state.positions_m, i)).norm();
        links.edges().map(apart).fold(f64::INFINITY, f64::min)
    }

    /// The smallest separation of any pair that the law joins or senses over the move from `start` to `end`, on which no vehicle
    /// moves farther than `moved_m`, in the judge's lengths; or a bound of it from below that is `enough`.
    pub(super) fn nearest_over(
        &mut self,
        (law, links): (&dyn Law, &Graph),
        (start, path, end): (&Swarm, &Path, &Swarm),
        moved_m: f64,
        enough: impl Fn(f64) -> bool,
    ) -> f64 {
        let start = &start.positions_m;
        let instants = || path.passed().map(|(_, rows)| rows).chain([&end.positions_m]);
        let least_m = self.nearest_m - self.metric.most_scaled(2.0 * moved_m);
        if enough(least_m) {
            return least_m;
        }
        let metric = self.metric;
        let swept_m = |(i, j): (usize, usize)| {
            let apart = |rows: &Rows| metric.scaled(row(rows, j) - row(rows, i));
            let mut from = apart(start);
            let passes = instants().map(apart).map(|to| swept_separation_m(std::mem::replace(&mut from, to), to));
            passes.fold(f64::INFINITY, f64::min)
        };
        if law.capabilities().sensing_range_m.is_none() {
            links.edges().map(swept_m).fold(f64::INFINITY, f64::min)
        } else {
            let ratio = metric.ratio().max(1.0 / metric.ratio());
            self.near.update(start, metric.longest_m(self.nearest_m.max(0.0)) + 4.0 * ratio * moved_m);
            self.near.pairs().iter().copied().map(swept_m).fold(f64::INFINITY, f64::min)
        }
    }

    fn nears_an_obstacle(&self, start: &Rows, path: &Path, end: &Swarm) -> bool {
        (0..start.nrows()).any(|i| {
            self.obstacles.iter().any(|obstacle| {
                let limit_m = obstacle.clearance_m.unwrap_or_default();
                let mut from = row(start, i);
                let least_m = limit_m + 0.5 * (swept_distance_m(obstacle, from, from) - limit_m);
                path.passed().map(|(_, rows)| rows).chain([&end.positions_m]).any(|rows| {
                    let to = row(rows, i);
                    swept_distance_m(obstacle, std::mem::replace(&mut from, to), to) < least_m
                })
            })
        })
    }

    /// Keeps the pairs whose keep-out balls the engine sees overlap for the first time, in index order.
    pub(super) fn note_engine_contacts(&mut self, plant: &dyn Plant, time_s: f64, events: &mut Vec<Event>) {
        self.contacts_now.clear();
        plant.keep_out_contacts(&mut self.contacts_now);
        for &pair in &self.contacts_now {
            if let Err(place) = self.engine_contacts.binary_search(&pair) {
                self.engine_contacts.insert(place, pair);
                events.push(Event::EngineContact { pair, time_s });
            }
        }
    }

    /// Keeps the pairs whose hulls begin to push each other in the step that began at `from_s`, in index order.
    pub(super) fn note_bounces(&mut self, plant: &dyn Plant, from_s: f64, events: &mut Vec<Event>) {
        std::mem::swap(&mut self.hulls_now, &mut self.hulls_before);
        self.hulls_now.clear();
        plant.hull_contacts(&mut self.hulls_now);
        for &HullContact { pair, closing_m_s } in &self.hulls_now {
            if self.hulls_before.binary_search_by_key(&pair, |before| before.pair).is_err() {
                self.bounces.push(Bounce { pair, time_s: from_s, closing_m_s });
                events.push(Event::HullsHit { pair, time_s: from_s, closing_m_s });
            }
        }
    }

    pub(super) fn finish(self) -> Judged {
        let in_doubt = self.beyond_error.map(|is_beyond| self.error_m.is_some() && !is_beyond);
        let unless = |open: u64, is_in_doubt: bool, status: Status| match status {
            Status::Clear if open > 0 => Status::Undecided,
            Status::Violation if is_in_doubt => Status::Undecided,
            known => known,
        };
        let mut audit = self.auditor.finish();
        audit.unresolved += self.bent;
        audit.status = unless(self.bent, in_doubt[0], audit.status);
        let mut clearance = self.clearance.map(ClearanceAuditor::finish);
        if let Some(clearance) = &mut clearance {
            clearance.unresolved += self.bent_past_obstacles;
            clearance.status = unless(self.bent_past_obstacles, in_doubt[1], clearance.status);
        }
        Judged {
            audit,
            in_metres: self.in_metres.map(Auditor::finish),
            clearance,
            engine_contacts: self.engine_contacts,
            bounces: self.bounces,
        }
    }
}

/// How far any vehicle gets from where it is at `start`, on its way to `end` \[m\].
pub(super) fn longest_move_m(start: &Swarm, path: &Path, end: &Swarm) -> f64 {
    let start = &start.positions_m;
    path.passed()
        .map(|(_, rows)| rows)
        .chain([&end.positions_m])
        .flat_map(|rows| (0..start.nrows()).map(move |i| (row(rows, i) - row(start, i)).norm()))
        .fold(0.0, f64::max)
}

/// Positions in the lengths that the judge is told: the same where these are metres.
fn told<'a>(metric: Metric, positions_m: &'a Rows, scaled: &'a mut Rows) -> &'a Rows {
    if metric.is_metres() {
        return positions_m;
    }
    metric.scale(positions_m, scaled);
    scaled
}

/// Whether it cannot be told that a limit is kept by what was swept at a distance and may be nearer by so much.
fn is_open(distance_m: f64, nearer_m: f64, limit_m: f64) -> bool {
    distance_m >= limit_m && distance_m - nearer_m < limit_m
}

/// The closest that a pair came in a violation.
fn deepest(violation: &Violation) -> Event {
    Event::Approach { pair: violation.pair, time_s: violation.min_at_s, separation_m: violation.min_m }
}

/// As [`deepest`], of a vehicle and an obstacle.
fn deepest_past_obstacle(violation: &Violation<ObjectPair>) -> Option<Event> {
    match violation.pair {
        ObjectPair::Obstacle { vehicle, obstacle } => {
            let (time_s, distance_m) = (violation.min_at_s, violation.min_m);
            Some(Event::ObstacleApproach { vehicle, obstacle, time_s, distance_m })
        }
        ObjectPair::Vehicles(_) => None,
    }
}

/// Keeps what the judge found in a sweep.
fn note(finding: StepFinding<'_>, closest: &mut Option<ClosestApproach>, nearest_m: &mut f64, events: &mut Vec<Event>) {
    if let Some(new) = finding.closest {
        *nearest_m = new.separation_m;
        *closest = closest.filter(|before| before.separation_m <= new.separation_m).or(Some(new));
    }
    for violation in finding.began {
        events.push(Event::ViolationBegan { pair: violation.pair, time_s: violation.from_s });
    }
    for violation in finding.ended {
        let &Violation { pair, to_s, min_m, .. } = violation;
        events.push(deepest(violation));
        events.push(Event::ViolationEnded { pair, time_s: to_s, min_m });
    }
}

/// An obstacle at rest, as it is judged.
#[must_use]
pub fn judged(obstacle: &space::Obstacle) -> audit::Obstacle {
    audit::Obstacle {
        name: obstacle.name.clone(),
        shape: judged_shape(obstacle.shape),
        clearance_m: Some(obstacle.clearance_m),
        path: vec![(0.0, obstacle.place_m)],
    }
}

/// A shape, as it is judged.
#[must_use]
pub fn judged_shape(shape: space::Shape) -> audit::Shape {
    match shape {
        space::Shape::Ball { radius_m } => audit::Shape::Ball { radius_m },
        space::Shape::Box { half_m, yaw_deg } => audit::Shape::Box { half_m, yaw_rad: yaw_deg.to_radians() },
        space::Shape::Capsule { from_m, to_m, radius_m } => audit::Shape::Capsule { from_m, to_m, radius_m },
        space::Shape::HalfSpace { normal } => audit::Shape::HalfSpace { normal },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_laws::formation::Formation;

    #[test]
    fn a_distance_is_clear_only_beyond_what_paths_may_bend() {
        let line = |spacing_m: f64| Formation::line(2, spacing_m).slots_m;
        let judged = |bend_m: f64, past_m: f64| {
            let scenario = Scenario::new("two", Swarm::at_rest(line(3.0)), Formation::line(2, 3.0), 2.0, 1.0);
            let (mut judge, mut events) = (Judge::new(&scenario).expect("a judge"), Vec::new());
            judge.start(0.0, &line(3.0), &mut events).expect("judged");
            judge.sweep(1.0, &line(past_m), bend_m, &mut events).expect("judged");
            let audit = judge.finish().audit;
            (audit.status, audit.unresolved)
        };
        assert_eq!(judged(0.0, 2.0 + 1e-6), (Status::Clear, 0));
        assert_eq!(judged(1e-6, 2.0 + 1e-6), (Status::Undecided, 1), "each of the two may be nearer");
        assert_eq!(judged(1e-6, 2.0 + 3e-6), (Status::Clear, 0));
        assert_eq!(judged(1e-6, 2.0 - 1e-6).0, Status::Violation);
    }

    #[test]
    fn what_bends_past_an_obstacle_counts_beside_a_violation() {
        let line = |from_m: f64| Rows::from_row_slice(&[from_m, 0.0, 0.0, from_m + 9.0, 0.0, 0.0]);
        let mut scenario = Scenario::new("two", Swarm::at_rest(line(3.0)), Formation::line(2, 9.0), 2.0, 2.0);
        scenario.obstacles = vec![tautline_laws::space::Obstacle {
            name: "ball".to_owned(),
            place_m: nalgebra::Vector3::zeros(),
            shape: tautline_laws::space::Shape::Ball { radius_m: 1.0 },
            clearance_m: 1.0,
        }];
        let (mut judge, mut events) = (Judge::new(&scenario).expect("a judge"), Vec::new());
        judge.start(0.0, &line(3.0), &mut events).expect("judged");
        judge.sweep(1.0, &line(2.0 + 1e-6), 2e-6, &mut events).expect("judged");
        judge.sweep(2.0, &line(1.5), 0.0, &mut events).expect("judged");
        let clearance = judge.finish().clearance.expect("judged");
        assert_eq!((clearance.status, clearance.unresolved), (Status::Violation, 1));
    }
}
