//! Audit of a flight among obstacles: straight steps of all vehicles, one after the other.

use super::auditor::{AuditError, check_instant};
use super::cross_check::KeepOut;
use super::enclosure::Target;
use super::ledger::{ClosestPairs, Lists, Results};
use super::obstacle::{self, MovingObstacle, ObstacleError, ObstacleFault};
use super::outcome::{Approach, ObjectPair, ParryEvidence, Status, Undecided, Violation};
use super::pair_sweep::PairSweep;
use super::segment::Segment;
use super::sweep::{Interval, MIN_LIMIT_M};
use tautline_core::obstacle::Obstacle;
use tautline_core::swarm::{Rows, row};

/// Rounding of a distance from a surface, relative to the lengths that it is computed from.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Audits a flight past obstacles at rest, instant by instant.
///
/// Each straight step is judged in closed form, with parry as the second detector, as in [`Auditor`](super::Auditor).
///
/// Each obstacle has its own clearance ([`Obstacle::clearance_m`]). A distance changes by at most the distance that the
/// vehicle moves. A vehicle and an obstacle that were too far apart for an approach over the step are not swept.
#[derive(Clone, Debug)]
pub struct ClearanceAuditor {
    obstacles: Vec<GuardedObstacle>,
    vehicles: usize,
    time_s: Option<f64>,
    positions_m: Rows,
    /// Distances at the last instant \[m\], grouped by vehicle, and whether they are below the limit.
    distances_m: Vec<f64>,
    is_below: Vec<bool>,
    smallest_margin_m: f64,
    results: Results,
    began: Vec<Violation<ObjectPair>>,
    ended: Vec<Violation<ObjectPair>>,
    refused: u64,
}

#[derive(Clone, Debug)]
struct GuardedObstacle {
    obstacle: Obstacle,
    keep_out: KeepOut,
}

/// Findings of one step, or of the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClearanceFinding<'a> {
    /// Smallest distance beyond the clearance of any vehicle and obstacle at the end of the step \[m\].
    pub smallest_margin_m: f64,
    /// Violations that began in this step.
    pub began: &'a [Violation<ObjectPair>],
    /// Violations that ended in this step, complete. A violation that began and ended in this step is in both lists.
    pub ended: &'a [Violation<ObjectPair>],
}

/// Verdict on a flight past obstacles, with its evidence.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ClearanceOutcome {
    /// Verdict.
    pub status: Status,
    /// Approaches of different pairs that came closest to their limits, at most ten, the closest first.
    pub closest: Vec<Approach>,
    /// All violations, ordered by their start.
    pub violations: Vec<Violation<ObjectPair>>,
    /// All undecided times.
    pub undecided: Vec<Undecided<ObjectPair>>,
    /// Number of steps on which paths may bend by more than the margin.
    pub unresolved: u64,
    /// Result of the second detector.
    pub parry: ParryEvidence<ObjectPair>,
    /// Number of calls that returned an error. Their input was not judged.
    pub refused: u64,
}

impl ClearanceAuditor {
    /// Creates an auditor of `vehicles` vehicles among obstacles at rest.
    ///
    /// # Errors
    /// [`ObstacleError`] if an obstacle is invalid, or has no clearance above zero.
    pub fn new(vehicles: usize, obstacles: &[Obstacle]) -> Result<Self, ObstacleError> {
        let judged = obstacles.iter().map(|obstacle| {
            MovingObstacle::from(obstacle).check()?;
            if obstacle.clearance_m < MIN_LIMIT_M {
                return Err(ObstacleError { name: obstacle.name.clone(), fault: ObstacleFault::NoClearance });
            }
            Ok(GuardedObstacle { obstacle: obstacle.clone(), keep_out: KeepOut::new(obstacle.clearance_m) })
        });
        Ok(Self {
            obstacles: judged.collect::<Result<_, _>>()?,
            vehicles,
            time_s: None,
            positions_m: Rows::zeros(0),
            distances_m: vec![0.0; vehicles * obstacles.len()],
            is_below: vec![false; vehicles * obstacles.len()],
            smallest_margin_m: f64::INFINITY,
            results: Results { obstacles: ClosestPairs::to_limits(), ..Results::default() },
            began: Vec::new(),
            ended: Vec::new(),
            refused: 0,
        })
    }

    /// Judges the first instant, or the straight motion from the last instant to this one: `positions_m` is N x 3
    /// \[m\].
    ///
    /// # Errors
    /// [`AuditError`] if the instant cannot be judged. Only the count of refusals changes then, which keeps the outcome
    /// from being clear.
    pub fn step(&mut self, time_s: f64, positions_m: &Rows) -> Result<ClearanceFinding<'_>, AuditError> {
        let checked = match self.time_s {
            Some(previous_s) if time_s <= previous_s => Err(AuditError::TimeNotIncreasing { previous_s, time_s }),
            _ => check_instant(self.vehicles, time_s, positions_m),
        };
        self.refused += u64::from(checked.is_err());
        checked?;
        if self.time_s.is_none() {
            self.positions_m.clone_from(positions_m);
        }
        let step = Interval { from_s: self.time_s.unwrap_or(time_s), to_s: time_s };
        self.began.clear();
        self.ended.clear();
        self.smallest_margin_m = f64::INFINITY;
        for vehicle in 0..self.vehicles {
            self.sweep(step, vehicle, positions_m);
        }
        self.positions_m.copy_from(positions_m);
        self.time_s = Some(time_s);
        Ok(ClearanceFinding { smallest_margin_m: self.smallest_margin_m, began: &self.began, ended: &self.ended })
    }

    /// Sweeps the path of a vehicle past every obstacle.
    fn sweep(&mut self, step: Interval, vehicle: usize, positions_m: &Rows) {
        let (from, to) = (row(&self.positions_m, vehicle), row(positions_m, vehicle));
        let (moved_m, is_first) = ((to - from).norm(), self.time_s.is_none());
        for index in 0..self.obstacles.len() {
            let GuardedObstacle { obstacle: Obstacle { place_m, shape, .. }, keep_out } = &self.obstacles[index];
            let (place, limit_m) = (vehicle * self.obstacles.len() + index, keep_out.delta_m);
            let end_m = obstacle::distance(shape, to - place_m);
            let start_m = if is_first { end_m } else { self.distances_m[place] };
            self.distances_m[place] = end_m;
            self.smallest_margin_m = self.smallest_margin_m.min(end_m - limit_m);
            let pair = ObjectPair::Obstacle { vehicle, obstacle: index };
            let rounding_m = ROUNDING * ((from - place_m).norm() + (to - place_m).norm() + limit_m);
            let least_m = 0.5 * (start_m + end_m - moved_m) - rounding_m;
            let cutoff = self.results.obstacles.cutoff(pair, limit_m);
            if least_m >= limit_m.max(cutoff) {
                continue;
            }
            let known = self.results.ledger.violations.len();
            let (target, may_violate) = (Target::Shape(shape), least_m < limit_m);
            let standing = Segment::straight(step.from_s, step.to_s, *place_m, *place_m);
            let flying = Segment::straight(step.from_s, step.to_s, from, to);
            PairSweep { pair, target, keep_out: keep_out.clone(), cutoff, judges: true, may_violate, above: None }
                .judge(&[standing], &[flying], step, &mut self.results);
            self.began.extend_from_slice(&self.results.ledger.violations[known..]);
            let was_below = std::mem::replace(&mut self.is_below[place], end_m < limit_m);
            let of_step = self.results.ledger.violations.len() > known;
            if (was_below || of_step) && end_m >= limit_m {
                let last = self.results.ledger.violations.iter().rev().find(|violation| violation.pair == pair);
                self.ended.extend(last);
            }
        }
    }

    /// Returns the approaches that came closest to their limits so far, the closest first.
    #[must_use]
    pub fn closest(&self) -> &[Approach] {
        &self.results.obstacles.kept
    }

    /// Returns the times so far at which a vehicle was below the clearance of an obstacle, in the order in which they
    /// were found.
    #[must_use]
    pub fn violations(&self) -> &[Violation<ObjectPair>] {
        &self.results.ledger.violations
    }

    /// Returns the verdict over all judged steps.
    #[must_use]
    pub fn finish(self) -> ClearanceOutcome {
        let Results { ledger, obstacles, .. } = self.results;
        let (parry, decided) = (ledger.parry, self.time_s.is_some() && self.refused == 0 && ledger.is_decided());
        let Lists { violations, undecided, .. } = ledger.into_lists();
        let status = Status::new(!violations.is_empty(), decided);
        let (closest, refused) = (obstacles.kept, self.refused);
        ClearanceOutcome { status, closest, violations, undecided, unresolved: 0, parry, refused }
    }
}

/// Returns the smallest distance \[m\] of a point on a straight path from the surface of an obstacle at rest; negative
/// inside.
#[must_use]
pub fn swept_distance_m(obstacle: &Obstacle, from: nalgebra::Vector3<f64>, to: nalgebra::Vector3<f64>) -> f64 {
    obstacle::closest(&obstacle.shape, from - obstacle.place_m, to - obstacle.place_m).0
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;
    use crate::obstacle::one_of_each;
    use tautline_core::obstacle::Shape;

    fn obstacle_at_origin(shape: Shape, clearance_m: f64) -> Obstacle {
        Obstacle { name: "o".to_owned(), place_m: Vector3::zeros(), shape, clearance_m }
    }

    fn fly(auditor: &mut ClearanceAuditor, way: &[[f64; 3]]) -> (usize, usize) {
        let (mut began, mut ended) = (0, 0);
        for (k, point) in way.iter().enumerate() {
            let finding = auditor.step(k as f64, &Rows::from_row_slice(point)).unwrap();
            began += finding.began.len();
            ended += finding.ended.len();
        }
        (began, ended)
    }

    #[test]
    fn a_vehicle_that_passes_an_obstacle_between_two_instants_is_found() {
        for shape in one_of_each() {
            let mut auditor = ClearanceAuditor::new(1, &[obstacle_at_origin(shape, 0.5)]).unwrap();
            let along = if matches!(shape, Shape::HalfSpace { .. }) {
                [[0.0, 0.0, 9.0], [0.0, 0.0, 0.5], [0.0, 0.0, 9.0]]
            } else {
                [[-9.0, 0.1, 0.0], [9.0, 0.1, 0.0], [9.0, 20.0, 0.0]]
            };
            let counts = fly(&mut auditor, &along);
            let outcome = auditor.finish();
            assert_eq!((counts, outcome.status, outcome.violations.len()), ((1, 1), Status::Violation, 1), "{shape:?}");
            assert_eq!(outcome.parry.disagreements, 0, "{shape:?}");
            let mut clear = ClearanceAuditor::new(1, &[obstacle_at_origin(shape, 0.5)]).unwrap();
            assert_eq!(fly(&mut clear, &[[-9.0, 9.0, 9.0], [9.0, 9.0, 9.0]]), (0, 0));
            assert_eq!(clear.finish().status, Status::Clear, "{shape:?}");
        }
    }

    #[test]
    fn a_violation_over_several_steps_is_one_and_may_last_to_the_end() {
        let ball = Shape::Ball { radius_m: 1.0 };
        let mut auditor = ClearanceAuditor::new(1, &[obstacle_at_origin(ball, 1.0)]).unwrap();
        let way = [[-4.0, 0.0, 0.0], [-1.5, 0.0, 0.0], [1.5, 0.0, 0.0], [4.0, 0.0, 0.0], [1.5, 0.0, 0.0]];
        assert_eq!(fly(&mut auditor, &way), (2, 1));
        let outcome = auditor.finish();
        let times: Vec<_> = outcome.violations.iter().map(|v| (v.from_s, v.to_s, v.min_m)).collect();
        assert_eq!(times.len(), 2);
        assert!((times[0].0 - 0.8).abs() < 1e-9 && (times[0].1 - 2.2).abs() < 1e-9 && times[0].2 == -1.0, "{times:?}");
        assert!((times[1].0 - 3.8).abs() < 1e-9 && times[1].1 == 4.0, "{times:?}");
        assert_eq!(outcome.closest.len(), 1);
    }

    #[test]
    fn invalid_input_is_refused_and_keeps_the_outcome_undecided() {
        let ball = obstacle_at_origin(Shape::Ball { radius_m: 1.0 }, 1.0);
        for wrong in [
            Obstacle { clearance_m: 0.0, ..ball.clone() },
            Obstacle { shape: Shape::Ball { radius_m: -1.0 }, ..ball.clone() },
        ] {
            assert!(ClearanceAuditor::new(1, &[wrong]).is_err());
        }
        let mut auditor = ClearanceAuditor::new(1, &[ball]).unwrap();
        let rows = |x: f64| Rows::from_row_slice(&[x, 0.0, 0.0]);
        assert_eq!(auditor.clone().finish().status, Status::Undecided, "nothing was judged");
        auditor.step(0.0, &rows(9.0)).unwrap();
        assert_eq!(auditor.clone().finish().status, Status::Clear);
        for (time_s, x) in [(0.0, 9.0), (1.0, f64::NAN), (f64::NAN, 9.0), (1.0, 1e80)] {
            assert!(auditor.step(time_s, &rows(x)).is_err());
        }
        assert_eq!((auditor.clone().finish().status, auditor.finish().refused), (Status::Undecided, 4));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn the_smallest_distance_equals_that_of_a_full_sweep(
            ways in prop::collection::vec(prop::collection::vec(prop::array::uniform3(-6.0..6.0_f64), 12), 1..4),
            clearance_m in 0.05..1.5_f64,
        ) {
            let limit_m = |k: usize| clearance_m * (1.0 + 2.0 * k as f64);
            let obstacles: Vec<_> =
                one_of_each().into_iter().enumerate().map(|(k, shape)| obstacle_at_origin(shape, limit_m(k))).collect();
            let mut auditor = ClearanceAuditor::new(ways.len(), &obstacles).unwrap();
            for k in 0..12 {
                let rows: Vec<_> = ways.iter().flat_map(|way| way[k]).collect();
                auditor.step(k as f64, &Rows::from_row_slice(&rows)).unwrap();
            }
            let outcome = auditor.finish();
            let swept = |way: &[[f64; 3]], obstacle: &Obstacle| {
                let steps = way.windows(2).map(|ends| swept_distance_m(obstacle, ends[0].into(), ends[1].into()));
                steps.fold(f64::INFINITY, f64::min)
            };
            let all: Vec<_> = ways.iter().flat_map(|way| obstacles.iter().map(|o| swept(way, o))).collect();
            let margins = all.iter().enumerate().map(|(k, m)| m - limit_m(k % obstacles.len()));
            let least = margins.clone().fold(f64::INFINITY, f64::min);
            prop_assert!((outcome.closest[0].lower_m - outcome.closest[0].limit_m - least).abs() < 1e-12);
            prop_assert_eq!(outcome.status == Status::Violation, least < 0.0);
            let too_close = margins.filter(|&margin_m| margin_m < 0.0).count();
            let mut pairs: Vec<_> = outcome.violations.iter().map(|violation| violation.pair).collect();
            pairs.sort_unstable();
            pairs.dedup();
            prop_assert_eq!(pairs.len(), too_close);
            prop_assert_eq!(outcome.parry.disagreements, 0);
        }
    }
}
