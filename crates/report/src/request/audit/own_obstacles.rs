//! What a recording of `tautline run` says of the obstacles that were flown past.

use tautline_audit::recorded::{Approach, ObjectPair, Outcome, Settings};
use tautline_audit::{Obstacle, Undecided, Violation};
use tautline_core::record::Event;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim;

/// Obstacles of a recording, and the times that the run saw a vehicle too near to one of them.
#[derive(Clone, Debug, Default)]
pub(super) struct OwnObstacles {
    /// As its scenario has them.
    pub(super) obstacles: Vec<Obstacle>,
    told: Vec<Violation<ObjectPair>>,
    /// The closest approaches that the run saw.
    closest: Vec<Approach>,
}

impl OwnObstacles {
    /// Those of a scenario, with lengths that are taken for `scale` times as long.
    pub(super) fn of(scenario: &Scenario, scale: f64) -> Self {
        let obstacles = scenario.obstacles.iter().map(|obstacle| sim::judged(obstacle).scaled(scale)).collect();
        Self { obstacles, ..Self::default() }
    }

    fn limit_m(&self, obstacle: usize) -> f64 {
        self.obstacles.get(obstacle).and_then(|of| of.clearance_m).unwrap_or(f64::MAX)
    }

    /// Takes note of what the run saw, in lengths that are taken for `scale` times as long.
    pub(super) fn note(&mut self, event: &Event, scale: f64) {
        match *event {
            Event::ObstacleViolationBegan { vehicle, obstacle, time_s } => {
                let limit_m = self.limit_m(obstacle);
                self.told.push(Violation {
                    pair: ObjectPair::Obstacle { vehicle, obstacle },
                    from_s: time_s,
                    to_s: f64::INFINITY,
                    min_m: limit_m.next_down(),
                    min_at_s: time_s,
                    limit_m,
                });
            }
            Event::ObstacleViolationEnded { vehicle, obstacle, time_s, min_m } => {
                let pair = ObjectPair::Obstacle { vehicle, obstacle };
                if let Some(told) = self.told.iter_mut().rev().find(|told| told.pair == pair) {
                    (told.to_s, told.min_m) = (time_s, told.min_m.min(min_m * scale));
                }
            }
            Event::ObstacleApproach { vehicle, obstacle, time_s, distance_m } => {
                let (pair, lower_m) = (ObjectPair::Obstacle { vehicle, obstacle }, distance_m * scale);
                let limit_m = self.limit_m(obstacle);
                self.closest.push(Approach { pair, lower_m, upper_m: lower_m, time_s, limit_m });
            }
            _ => {}
        }
    }

    /// Nothing between samples counts where every step is a sample.
    pub(super) fn forget_what_was_seen(&mut self) {
        self.told.clear();
        self.closest.clear();
    }

    /// The closest that the run saw in a part of a violation \[m\], and when \[s\].
    fn deepest(&self, told: &Violation<ObjectPair>, offset_s: f64, [from_s, to_s]: [f64; 2]) -> Option<(f64, f64)> {
        let known = self.closest.iter().filter(|known| known.pair == told.pair);
        let known = known.map(|known| (known.lower_m, known.time_s + offset_s));
        let within = known.filter(|(near_m, at_s)| *near_m < told.limit_m && (from_s..=to_s).contains(at_s));
        within.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Removes the obstacle violations that only straight lines between samples show, for a run that judged every step clear.
    ///
    /// `samples_s` are the times of the samples \[s\]. A violation that lasts over a sample time stays.
    pub(super) fn refute(&self, outcome: &mut Outcome, settings: &Settings, samples_s: &[f64]) {
        let has_sample = |from_s: f64, to_s: f64| {
            samples_s.get(samples_s.partition_point(|&at_s| at_s < from_s)).is_some_and(|&at_s| at_s <= to_s)
        };
        let is_refuted = |found: &Violation<ObjectPair>| {
            matches!(found.pair, ObjectPair::Obstacle { .. }) && !has_sample(found.from_s, found.to_s)
        };
        outcome.refute_violations(is_refuted, settings);
        let are_left = |pair| outcome.violations.iter().any(|found| found.pair == pair);
        let mut obstacles = outcome.obstacles.clone();
        for of in obstacles.iter_mut().filter(|of| !are_left(of.pair)) {
            let told = self.closest.iter().filter(|told| told.pair == of.pair);
            let told = told.min_by(|a, b| a.lower_m.total_cmp(&b.lower_m));
            let is_in = |at_s: f64| outcome.span_s.is_some_and(|(from_s, to_s)| (from_s..=to_s).contains(&at_s));
            match told {
                Some(told) if is_in(told.time_s) => *of = Approach { limit_m: of.limit_m, ..*told },
                told => {
                    of.lower_m = of.lower_m.max(told.map_or(of.limit_m, |told| told.lower_m));
                    of.upper_m = of.upper_m.max(of.lower_m);
                }
            }
        }
        obstacles.sort_by(|a, b| a.lower_m.total_cmp(&b.lower_m));
        outcome.obstacles = obstacles;
    }

    /// Adds to what was found in a recording what the run saw between its samples: a violation, or a time that cannot be
    /// told where heights count and are not known; and how close vehicles came.
    pub(super) fn bind(&self, outcome: &mut Outcome, settings: &Settings) {
        let Some(&(first_s, last_s)) = outcome.span_s.as_ref() else { return };
        let offset_s = |outcome: &Outcome, pair: ObjectPair| {
            let ObjectPair::Obstacle { vehicle, .. } = pair else { return None };
            outcome.presence.get(vehicle).copied().flatten()?;
            Some(settings.vehicles.get(&outcome.name(vehicle)).map_or(0.0, |of| of.offset_s))
        };
        if outcome.separation.is_none() {
            return;
        }
        for told in &self.told {
            let Some(offset_s) = offset_s(outcome, told.pair) else { continue };
            let (from_s, to_s) = ((told.from_s + offset_s).max(first_s), (told.to_s + offset_s).min(last_s));
            if from_s > to_s {
                continue;
            }
            let &Violation { pair, limit_m, .. } = told;
            let lasts =
                |found: &Violation<ObjectPair>| found.pair == pair && found.from_s <= to_s && from_s <= found.to_s;
            if settings.above_m.is_some() {
                if !outcome.violations.iter().any(lasts) {
                    let (lower_m, upper_m, rate_hz) = (told.min_m, f64::INFINITY, None);
                    outcome.leave_open(Undecided { pair, from_s, to_s, lower_m, upper_m, limit_m, rate_hz });
                }
                continue;
            }
            let drawn =
                outcome.violations.iter().filter(|found| lasts(found)).map(|found| (found.min_m, found.min_at_s));
            let drawn = drawn.min_by(|a, b| a.0.total_cmp(&b.0));
            let is_whole = (from_s, to_s) == (told.from_s + offset_s, told.to_s + offset_s);
            let (min_m, min_at_s) = match (self.deepest(told, offset_s, [from_s, to_s]), drawn) {
                (Some(deepest), _) => deepest,
                (None, drawn) if is_whole => (told.min_m, drawn.map_or(to_s, |(_, at_s)| at_s)),
                (None, Some((drawn_m, at_s))) => (drawn_m.min(limit_m.next_down()), at_s),
                (None, None) => (limit_m.next_down(), from_s),
            };
            outcome.retain_violations(|found| !lasts(found));
            outcome.violate(Violation { pair, from_s, to_s, min_m, min_at_s, limit_m });
        }
        for told in self.closest.iter().filter(|_| settings.above_m.is_none()) {
            let Some(offset_s) = offset_s(outcome, told.pair) else { continue };
            let time_s = told.time_s + offset_s;
            if (first_s..=last_s).contains(&time_s) {
                outcome.offer_past_obstacle(Approach { time_s, ..*told });
            }
        }
        outcome.violations.sort_by(|a, b| a.from_s.total_cmp(&b.from_s).then(a.pair.cmp(&b.pair)));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use tautline_audit::recorded::audit;
    use tautline_audit::{Shape, Status};
    use tautline_core::track::{Item, Sample};

    const BALL: ObjectPair = ObjectPair::Obstacle { vehicle: 0, obstacle: 0 };

    /// What a run saw between two samples 10 s apart, that straight lines do not: 0.2 m from the ball for 2 s, and 0.1 m
    /// while it lasted.
    fn seen() -> OwnObstacles {
        let ball = Obstacle {
            name: "ball".to_owned(),
            shape: Shape::Ball { radius_m: 1.0 },
            clearance_m: Some(0.5),
            path: vec![(0.0, Vector3::zeros())],
        };
        let mut own = OwnObstacles { obstacles: vec![ball], ..OwnObstacles::default() };
        let (vehicle, obstacle) = (0, 0);
        own.note(&Event::ObstacleViolationBegan { vehicle, obstacle, time_s: 4.0 }, 1.0);
        own.note(&Event::ObstacleViolationEnded { vehicle, obstacle, time_s: 6.0, min_m: 0.2 }, 1.0);
        own.note(&Event::ObstacleApproach { vehicle, obstacle, time_s: 5.5, distance_m: 0.1 }, 1.0);
        own
    }

    /// Two that stand 4 m beside the ball at both samples, asked about with the ball.
    fn judged(own: &OwnObstacles, asked: Settings) -> Outcome {
        let at = |vehicle: usize, time_s: f64| {
            let position_m = Vector3::new(5.0, 9.0 * vehicle as f64, 1.0);
            Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
        };
        let items: Vec<_> = [(0, 0.0), (1, 0.0), (0, 10.0), (1, 10.0)].map(|(k, time_s)| at(k, time_s)).into();
        let settings = Settings { delta_m: Some(1.0), obstacles: own.obstacles.clone(), ..asked };
        let names = ["1".to_owned(), "2".to_owned()];
        let mut outcome = audit(&names, &items, settings.clone()).expect("judged");
        assert_eq!(outcome.status, Status::Clear, "straight lines see nothing");
        own.bind(&mut outcome, &settings);
        outcome
    }

    #[test]
    fn what_the_run_saw_of_obstacles_between_samples_is_a_violation_with_its_deepest_approach() {
        let outcome = judged(&seen(), Settings::default());
        let [found] = outcome.violations[..] else { panic!("{outcome:?}") };
        assert_eq!((outcome.status, found.pair, found.from_s, found.to_s), (Status::Violation, BALL, 4.0, 6.0));
        assert_eq!(outcome.separation, Some(Status::Violation));
        assert_eq!((found.min_m, found.min_at_s, outcome.obstacles[0].lower_m), (0.1, 5.5, 0.1));
        let mut every_step = seen();
        every_step.forget_what_was_seen();
        assert_eq!(judged(&every_step, Settings::default()).status, Status::Clear, "nothing is between its samples");
    }

    #[test]
    fn of_a_part_no_more_is_said_than_is_known_of_it() {
        let window =
            |from_s: f64, to_s: f64| Settings { from_s: Some(from_s), to_s: Some(to_s), ..Settings::default() };
        for ((from_s, to_s), expected) in [
            ((0.0, 5.0), (4.0, 5.0, 0.5_f64.next_down(), 4.0)),
            ((5.0, 10.0), (5.0, 6.0, 0.1, 5.5)),
            ((5.6, 10.0), (5.6, 6.0, 0.5_f64.next_down(), 5.6)),
        ] {
            let [found] = judged(&seen(), window(from_s, to_s)).violations[..] else { panic!("{from_s} {to_s}") };
            assert_eq!((found.from_s, found.to_s, found.min_m, found.min_at_s), expected);
        }
    }

    #[test]
    fn what_the_run_saw_takes_the_place_of_what_is_drawn_of_it() {
        let mut outcome = judged(&seen(), Settings::default());
        let drawn = Violation { from_s: 5.75, to_s: 6.0, min_m: 0.4, min_at_s: 5.9, ..outcome.violations[0] };
        outcome.violations = vec![drawn, Violation { from_s: 7.0, to_s: 8.0, ..drawn }];
        seen().bind(&mut outcome, &Settings::default());
        let found: Vec<_> = outcome.violations.iter().map(|v| (v.from_s, v.to_s, v.min_m, v.min_at_s)).collect();
        assert_eq!(found, [(4.0, 6.0, 0.1, 5.5), (7.0, 8.0, 0.4, 5.9)]);
    }

    #[test]
    fn only_the_window_and_the_vehicles_that_are_asked_about_count_and_heights_leave_it_open() {
        let before = Settings { to_s: Some(3.0), ..Settings::default() };
        assert_eq!(judged(&seen(), before).status, Status::Clear);
        let other = Settings { only: Some(["2".to_owned()].into()), ..Settings::default() };
        assert_eq!(judged(&seen(), other).status, Status::Clear);
        let heights = judged(&seen(), Settings { above_m: Some(0.5), ..Settings::default() });
        assert_eq!((heights.status, heights.undecided.len()), (Status::Undecided, 1));
        assert_eq!(heights.separation, Some(Status::Undecided));
    }

    #[test]
    fn a_violation_between_samples_is_dropped_and_one_at_a_sample_stays() {
        let clear = OwnObstacles { closest: seen().closest, ..seen() };
        for (samples_s, is_dropped) in [([0.0, 10.0], true), ([0.0, 5.0], false), ([4.0, 10.0], false)] {
            let mut outcome = judged(&seen(), Settings::default());
            clear.refute(&mut outcome, &Settings::default(), &samples_s);
            let expected = if is_dropped { Status::Clear } else { Status::Violation };
            assert_eq!((outcome.status, outcome.violations.is_empty()), (expected, is_dropped), "{samples_s:?}");
            assert_eq!(outcome.tallies.violations.count, u64::from(!is_dropped));
        }
    }
}
