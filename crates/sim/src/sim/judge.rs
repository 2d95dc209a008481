//! Connects the audit with the simulation loop: sweeps every step and collects findings for the next sample.

use nalgebra::Vector3;

use super::ending::SimError;
use crate::plant::{HullContact, Plant, StepPath};
use crate::scenario::Scenario;
use tautline_audit::{
    AuditError, AuditOutcome, Auditor, ClearanceAuditor, ClearanceFinding, ClearanceOutcome, ObjectPair, Status,
    StepFinding, Violation, swept_distance_m, swept_separation_m,
};
use tautline_core::obstacle::Obstacle;
use tautline_core::record::Event;
use tautline_core::swarm::{Bounce, ClosestApproach, Pair, Rows, Swarm, row};
use tautline_laws::graph::Graph;
use tautline_laws::law::Law;
use tautline_laws::space::{CellList, Metric};

/// Auditor with the state that the loop needs from step to step.
#[derive(Clone)]
pub(super) struct Judge {
    auditor: Auditor,
    /// Auditor of separations in metres, by the widest hulls, if the safety shape is an ellipsoid.
    in_metres: Option<Auditor>,
    metric: Metric,
    /// Positions scaled for the first auditor.
    scaled: Rows,
    delta_m: f64,
    /// Number of sweeps that are clear by less than the bend of the paths.
    undecided_by_bend: u64,
    obstacles_undecided_by_bend: u64,
    /// Bound of the distance between the audited motion and that of the law \[m\], once a step was too long for the
    /// law.
    error_m: Option<f64>,
    /// Whether a violation exceeds the integration error: first for separations, then for obstacles.
    beyond_error: [bool; 2],
    /// Auditor of obstacles, if there are any, and the obstacles.
    clearance: Option<ClearanceAuditor>,
    obstacles: Vec<Obstacle>,
    /// Smallest present distance of a vehicle beyond the clearance of an obstacle \[m\].
    pub(super) clearance_margin_m: f64,
    /// Closest approach since the last sample.
    pub(super) closest: Option<ClosestApproach>,
    /// Smallest separation over the last sweep: a lower bound of the present separations.
    pub(super) nearest_m: f64,
    /// Pairs that a step may bring too close.
    near: CellList,
    pub(super) engine_contacts: Vec<Pair>,
    contacts_now: Vec<Pair>,
    pub(super) bounces: Vec<Bounce>,
    /// Hulls in contact in the last step, and in the one before.
    hulls_now: Vec<HullContact>,
    hulls_before: Vec<HullContact>,
}

/// Checks that the flight of a scenario can be judged.
///
/// # Errors
/// As [`Judge::new`].
pub(crate) fn check_judge(scenario: &Scenario) -> Result<(), SimError> {
    Judge::new(scenario).map(drop)
}

/// Results of the audit of a whole flight.
pub(super) struct AuditResults {
    pub(super) audit: AuditOutcome,
    pub(super) in_metres: Option<AuditOutcome>,
    pub(super) clearance: Option<ClearanceOutcome>,
    pub(super) engine_contacts: Vec<Pair>,
    pub(super) bounces: Vec<Bounce>,
}

impl Judge {
    pub(super) fn new(scenario: &Scenario) -> Result<Self, SimError> {
        let count = scenario.count();
        let obstacles = scenario.obstacles.clone();
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
            undecided_by_bend: 0,
            obstacles_undecided_by_bend: 0,
            error_m: None,
            beyond_error: [false; 2],
            clearance,
            obstacles,
            clearance_margin_m: f64::INFINITY,
            closest: None,
            nearest_m: 0.0,
            near: CellList::default(),
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
        let finding = auditor.start(time_s, in_metric(*metric, positions_m, scaled))?;
        note(finding, &mut self.closest, &mut self.nearest_m, events);
        self.sweep_obstacles(time_s, positions_m, 0.0, events)
    }

    /// Sweeps the straight line to these positions; true paths deviate by at most `bend_m` \[m\].
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
        let finding = auditor.step(time_s, in_metric(*metric, positions_m, scaled))?;
        if let Some(closest) = finding.closest {
            let nearer_m = 2.0 * metric.most_scaled(bend_m);
            self.undecided_by_bend += u64::from(is_undecided(closest.separation_m, nearer_m, self.delta_m));
        }
        note(finding, &mut self.closest, &mut self.nearest_m, events);
        self.sweep_obstacles(time_s, positions_m, bend_m, events)?;
        if let Some(error_m) = self.error_m {
            self.beyond_error[0] |= self.delta_m - self.nearest_m > self.metric.most_scaled(error_m);
            self.beyond_error[1] |= -self.clearance_margin_m > error_m;
        }
        Ok(())
    }

    /// Records that later sweeps may differ from the law's motion by `error_m` \[m\]. Earlier violations are exact.
    pub(super) fn note_integration_error(&mut self, error_m: f64) {
        if self.error_m.replace(error_m).is_none() {
            self.beyond_error = self.violated();
        }
    }

    /// Returns whether a pair came closer than delta, and whether a vehicle violated the clearance of an obstacle.
    fn violated(&self) -> [bool; 2] {
        let mut past_obstacles = self.clearance.iter().flat_map(ClearanceAuditor::violations);
        [!self.auditor.violations().is_empty(), past_obstacles.next().is_some()]
    }

    fn sweep_obstacles(
        &mut self,
        time_s: f64,
        positions_m: &Rows,
        bend_m: f64,
        events: &mut Vec<Event>,
    ) -> Result<(), AuditError> {
        if let Some(clearance) = &mut self.clearance {
            let ClearanceFinding { smallest_margin_m, began, ended } = clearance.step(time_s, positions_m)?;
            self.clearance_margin_m = smallest_margin_m;
            self.obstacles_undecided_by_bend += u64::from(is_undecided(smallest_margin_m, bend_m, 0.0));
            for &Violation { pair, from_s: time_s, .. } in began {
                if let ObjectPair::Obstacle { vehicle, obstacle } = pair {
                    events.push(Event::ObstacleViolationBegan { vehicle, obstacle, time_s });
                }
            }
            for ended @ &Violation { pair, to_s: time_s, min_m, .. } in ended {
                if let ObjectPair::Obstacle { vehicle, obstacle } = pair {
                    events.extend(obstacle_violation_event(ended));
                    events.push(Event::ObstacleViolationEnded { vehicle, obstacle, time_s, min_m });
                }
            }
        }
        Ok(())
    }

    /// Returns the smallest clearance so far \[m\]; negative exactly if there is a violation.
    pub(super) fn least_clearance_m(&self) -> Option<f64> {
        let pairs = self.auditor.closest().map(|closest| closest.separation_m - self.delta_m);
        let obstacles = self.clearance.as_ref().and_then(|clearance| clearance.closest().first());
        let beyond = obstacles.map(|approach| approach.upper_m - approach.limit_m);
        let least_m = pairs.into_iter().chain(beyond).reduce(f64::min)?;
        // The sign must agree with the violations in spite of rounding.
        Some(if self.violated().contains(&true) { least_m.min(-f64::MIN_POSITIVE) } else { least_m.max(0.0) })
    }

    /// Returns the closest approach of two vehicles so far.
    pub(super) fn least_separation(&self) -> Option<ClosestApproach> {
        self.auditor.closest()
    }

    /// Returns the closest approaches of violations that last until an instant.
    pub(super) fn ongoing_violations(&self, time_s: f64) -> impl Iterator<Item = Event> + '_ {
        let pairs =
            self.auditor.violations().iter().filter(move |violation| violation.to_s == time_s).map(violation_event);
        let past_obstacles = self.clearance.iter().flat_map(ClearanceAuditor::violations);
        pairs.chain(
            past_obstacles.filter(move |violation| violation.to_s == time_s).filter_map(obstacle_violation_event),
        )
    }

    /// Returns the closest approaches of vehicles to obstacles so far.
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

    /// Returns whether the move from `start` to `end` takes more than half of the clearance of some pair above the
    /// law's barrier. For a law that avoids obstacles, clearances of vehicles from obstacles count as well.
    pub(super) fn is_step_too_long(
        &mut self,
        (law, links): (&dyn Law, &Graph),
        (start, path, end): (&Swarm, &StepPath, &Swarm),
        moved_m: f64,
    ) -> bool {
        let Some(barrier_m) = law.capabilities().barrier_m else { return false };
        if moved_m > 0.5 * self.clearance_margin_m
            && law.capabilities().avoids_obstacles
            && self.comes_near_obstacle(start, path, end)
        {
            return true;
        }
        // No pair is closer than `nearest_m`, and none approaches by more than twice the longest move.
        if 2.0 * moved_m <= 0.5 * self.metric.shortest_m(self.nearest_m - barrier_m) {
            return false;
        }
        let metric = self.metric;
        let loses_half = |pair| {
            let (from, swept_m) = swept(metric, (start, path, end), pair);
            swept_m < barrier_m + 0.5 * (from.norm() - barrier_m)
        };
        if law.capabilities().sensing_range_m.is_none() {
            return links.edges().any(loses_half);
        }
        // Pairs beyond this distance keep half of their clearance.
        let range_m = metric.longest_m(barrier_m) + 4.0 * metric.ratio().max(1.0 / metric.ratio()) * moved_m;
        self.near.update(&start.positions_m, range_m);
        self.near.pairs().iter().copied().any(loses_half)
    }

    /// Returns a lower bound of the separations of the pairs that the law acts on, in the auditor's metric: all pairs
    /// for a law that senses, otherwise linked pairs. Visits every edge of an incomplete graph.
    pub(super) fn smallest_separation_of_law_m(&self, law: &dyn Law, links: &Graph, state: &Swarm) -> f64 {
        if law.capabilities().sensing_range_m.is_some() || links.is_complete() {
            return self.nearest_m;
        }
        let apart = |(i, j)| self.metric.scaled(row(&state.positions_m, j) - row(&state.positions_m, i)).norm();
        links.edges().map(apart).fold(f64::INFINITY, f64::min)
    }

    /// Returns the smallest separation of a pair that the law acts on over the move from `start` to `end`, in the
    /// auditor's metric. No vehicle moves farther than `moved_m`. A lower bound that is at least `enough` may replace
    /// the exact value.
    pub(super) fn smallest_separation_of_move(
        &mut self,
        (law, links): (&dyn Law, &Graph),
        (start, path, end): (&Swarm, &StepPath, &Swarm),
        moved_m: f64,
        enough: impl Fn(f64) -> bool,
    ) -> f64 {
        let least_m = self.nearest_m - self.metric.most_scaled(2.0 * moved_m);
        if enough(least_m) {
            return least_m;
        }
        let metric = self.metric;
        let swept_m = |pair| swept(metric, (start, path, end), pair).1;
        if law.capabilities().sensing_range_m.is_none() {
            links.edges().map(swept_m).fold(f64::INFINITY, f64::min)
        } else {
            let ratio = metric.ratio().max(1.0 / metric.ratio());
            let range_m = metric.longest_m(self.nearest_m.max(0.0)) + 4.0 * ratio * moved_m;
            self.near.update(&start.positions_m, range_m);
            self.near.pairs().iter().copied().map(swept_m).fold(f64::INFINITY, f64::min)
        }
    }

    fn comes_near_obstacle(&self, start: &Swarm, path: &StepPath, end: &Swarm) -> bool {
        (0..start.count()).any(|i| {
            self.obstacles.iter().any(|obstacle| {
                let limit_m = obstacle.clearance_m;
                let mut from = row(&start.positions_m, i);
                let least_m = limit_m + 0.5 * (swept_distance_m(obstacle, from, from) - limit_m);
                passed(path, end).any(|rows| {
                    let to = row(rows, i);
                    swept_distance_m(obstacle, std::mem::replace(&mut from, to), to) < least_m
                })
            })
        })
    }

    /// Records the pairs whose keep-out balls begin to overlap in the engine, in index order.
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

    /// Records the pairs whose hulls begin to touch in the step that began at `from_s`, in index order.
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

    pub(super) fn finish(self) -> AuditResults {
        let in_doubt = self.beyond_error.map(|is_beyond| self.error_m.is_some() && !is_beyond);
        let unless = |open: u64, is_in_doubt: bool, status: Status| match status {
            Status::Clear if open > 0 => Status::Undecided,
            Status::Violation if is_in_doubt => Status::Undecided,
            known => known,
        };
        let mut audit = self.auditor.finish();
        audit.unresolved += self.undecided_by_bend;
        audit.status = unless(self.undecided_by_bend, in_doubt[0], audit.status);
        let mut clearance = self.clearance.map(ClearanceAuditor::finish);
        if let Some(clearance) = &mut clearance {
            clearance.unresolved += self.obstacles_undecided_by_bend;
            clearance.status = unless(self.obstacles_undecided_by_bend, in_doubt[1], clearance.status);
        }
        AuditResults {
            audit,
            in_metres: self.in_metres.map(Auditor::finish),
            clearance,
            engine_contacts: self.engine_contacts,
            bounces: self.bounces,
        }
    }
}

/// Returns the largest distance of a vehicle from its position at `start`, on its path to `end` \[m\].
pub(super) fn longest_move_m(start: &Swarm, path: &StepPath, end: &Swarm) -> f64 {
    let start = &start.positions_m;
    passed(path, end)
        .flat_map(|rows| (0..start.nrows()).map(move |i| (row(rows, i) - row(start, i)).norm()))
        .fold(0.0, f64::max)
}

/// Returns the positions at the instants of a path and at its end \[m\].
fn passed<'a>(path: &'a StepPath, end: &'a Swarm) -> impl Iterator<Item = &'a Rows> {
    path.instants().map(|(_, rows)| rows).chain([&end.positions_m])
}

/// Returns the distance vector of a pair at the start of a move, and its smallest separation on the way, scaled.
fn swept(
    metric: Metric,
    (start, path, end): (&Swarm, &StepPath, &Swarm),
    (i, j): (usize, usize),
) -> (Vector3<f64>, f64) {
    let apart = |rows: &Rows| metric.scaled(row(rows, j) - row(rows, i));
    let from = apart(&start.positions_m);
    let mut before = from;
    let passes = passed(path, end).map(apart).map(|to| swept_separation_m(std::mem::replace(&mut before, to), to));
    (from, passes.fold(f64::INFINITY, f64::min))
}

/// Returns the positions in the auditor's metric; unchanged if that is in metres.
fn in_metric<'a>(metric: Metric, positions_m: &'a Rows, scaled: &'a mut Rows) -> &'a Rows {
    if metric.is_metres() {
        return positions_m;
    }
    metric.scale(positions_m, scaled);
    scaled
}

/// Returns whether a limit may be violated: the swept distance keeps it, but the true distance may be smaller by
/// `nearer_m`.
fn is_undecided(distance_m: f64, nearer_m: f64, limit_m: f64) -> bool {
    distance_m >= limit_m && distance_m - nearer_m < limit_m
}

/// Returns the closest approach of a violation as an event.
fn violation_event(violation: &Violation) -> Event {
    Event::Approach { pair: violation.pair, time_s: violation.min_at_s, separation_m: violation.min_m }
}

/// Returns the closest approach of a violation of an obstacle's clearance as an event.
fn obstacle_violation_event(violation: &Violation<ObjectPair>) -> Option<Event> {
    match violation.pair {
        ObjectPair::Obstacle { vehicle, obstacle } => {
            let (time_s, distance_m) = (violation.min_at_s, violation.min_m);
            Some(Event::ObstacleApproach { vehicle, obstacle, time_s, distance_m })
        }
        ObjectPair::Vehicles(_) => None,
    }
}

/// Records the findings of a sweep.
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
        events.push(violation_event(violation));
        events.push(Event::ViolationEnded { pair, time_s: to_s, min_m });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::obstacle::Shape;
    use tautline_laws::formation::Formation;

    #[test]
    fn a_distance_is_clear_only_beyond_the_bend_of_paths() {
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
        assert_eq!(judged(1e-6, 2.0 + 1e-6), (Status::Undecided, 1), "both vehicles may deviate");
        assert_eq!(judged(1e-6, 2.0 + 3e-6), (Status::Clear, 0));
        assert_eq!(judged(1e-6, 2.0 - 1e-6).0, Status::Violation);
    }

    #[test]
    fn a_bend_past_an_obstacle_counts_beside_a_violation() {
        let line = |from_m: f64| Rows::from_row_slice(&[from_m, 0.0, 0.0, from_m + 9.0, 0.0, 0.0]);
        let mut scenario = Scenario::new("two", Swarm::at_rest(line(3.0)), Formation::line(2, 9.0), 2.0, 2.0);
        scenario.obstacles = vec![Obstacle {
            name: "ball".to_owned(),
            place_m: Vector3::zeros(),
            shape: Shape::Ball { radius_m: 1.0 },
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
