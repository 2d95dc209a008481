//! Decides which steps are free of the engine, where a caller allows that: vector simulations, studies, `--free-steps`.
//!
//! Bodies of the engine act on each other only through contacts of hulls. The engine solves such contacts only for
//! pairs within a reach: two hulls, or a hull and an obstacle, within the contact prediction. While every pair is
//! farther apart at the beginning of a step, the engine moves each body by its own velocity alone. The plants then do
//! the same operations without the engine's step (a *free* step). The bits are the same: the tests of this module fly
//! with and without free steps.
//!
//! The engine also reports overlaps of keep-out balls, which change no motion. Where its free steps are compared, every
//! pair must be beyond this reach too, so that all overlaps are those of the engine. In trusted free steps the overlaps
//! follow from the distances of the pairs. A pair whose distance is close to that of touching balls needs the engine's
//! own decision: such a step is not free.
//!
//! After contacts, a free step follows only a step of the engine that began beyond the reach as well. That step removes
//! all contact points, so that no old impulse waits for the next contact. A new engine solves the next contacts
//! (`super::world::Engine`).

use std::ops::ControlFlow;
use std::sync::Arc;

use rapier3d::prelude::Collider;

use super::world::to_engine;
use crate::plant::{COMPARED_EACH, FreeSteps};
use crate::scenario::{CONTACT_PREDICTION_M, Scenario};
use tautline_core::swarm::{Pair, Rows, row};
use tautline_laws::space::CellList;

/// Up to this number of vehicles every pair is compared, which is faster than a list of cells.
const ALL_PAIRS_UP_TO: usize = 64;
/// Range of a search by cells, relative to the reach. A longer range finds more pairs, but is valid for more steps.
const RANGE_FACTOR: f64 = 2.0;
/// Distance beyond the engine's reach from which a step is free, and distance from touching at which the engine decides
/// whether two keep-out balls overlap \[m\]. It exceeds any rounding.
const MARGIN_M: f64 = 1e-3;

/// What makes a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Maker {
    Engine,
    /// The plant alone.
    FreeStep,
    /// The plant and the engine, from the same state.
    Both,
}

/// Distance of the nearest pair from the engine's reach, with the memory that bounds it from step to step.
#[derive(Clone, Debug)]
pub(super) struct Proximity {
    /// Distance of two centres below which the engine may report contacts \[m\].
    reach_m: f64,
    /// Distance of two centres below which the engine may solve a contact of hulls \[m\].
    hull_reach_m: f64,
    /// Distance of a centre from an obstacle below which the engine may solve a contact with its hull \[m\].
    obstacle_reach_m: f64,
    /// Obstacles of the engine.
    obstacles: Arc<[Collider]>,
    /// Search of near pairs of many vehicles.
    cells: CellList,
    /// Distance of two centres whose keep-out balls touch \[m\].
    keep_out_m: f64,
    /// Pairs whose keep-out balls overlapped at the beginning of the last step, if it was free, in index order.
    overlaps: Vec<Pair>,
    /// Treatment of free steps; `None` if none are allowed.
    free: Option<FreeSteps>,
    /// Number of free steps since the last comparison.
    unseen: u32,
    /// Number of steps that the engine made.
    engine_steps: u64,
    /// Lower bound of the distance of any pair beyond the reach \[m\]; not positive if unknown.
    beyond_m: f64,
    /// Whether the last step began with every pair beyond the reach of contacts that prevent free steps.
    began_beyond: bool,
}

impl Proximity {
    pub(super) fn new(scenario: &Scenario, obstacles: Arc<[Collider]>) -> Self {
        let hull_m = scenario.hull_radius_m.iter().copied().fold(0.0, f64::max);
        let keep_out_m = scenario.metric().shortest_m(scenario.delta_m);
        let reach = |touching_m: f64| touching_m + 2.0 * CONTACT_PREDICTION_M + MARGIN_M;
        Self {
            reach_m: reach(keep_out_m.max(2.0 * hull_m)),
            hull_reach_m: reach(2.0 * hull_m),
            obstacle_reach_m: reach(hull_m),
            obstacles,
            cells: CellList::default(),
            keep_out_m,
            overlaps: Vec::new(),
            free: None,
            unseen: 0,
            engine_steps: 0,
            beyond_m: 0.0,
            // A new engine has no contacts.
            began_beyond: true,
        }
    }

    /// Allows free steps.
    pub(super) fn allow_free_steps(&mut self, free: FreeSteps) {
        self.free = Some(free);
        // The last step of the engine may have had contacts.
        self.began_beyond &= self.engine_steps == 0;
    }

    /// Returns the number of steps that the engine made.
    pub(super) fn engine_steps(&self) -> u64 {
        self.engine_steps
    }

    /// Returns whether no step of the engine repeats a free step.
    pub(super) fn trusts_free_steps(&self) -> bool {
        self.free == Some(FreeSteps::Trusted)
    }

    /// Returns the pairs whose keep-out balls overlapped at the beginning of the last step, if it was free.
    pub(super) fn overlaps(&self) -> &[Pair] {
        &self.overlaps
    }

    /// Returns what makes the step from these positions, relative to the engine's origin \[m\].
    pub(super) fn begin_step(&mut self, positions_m: &Rows) -> Maker {
        let allowed = self.free;
        let free = allowed.filter(|_| self.is_free(positions_m));
        let maker = if let Some(free) = free {
            self.unseen = (self.unseen + 1) % COMPARED_EACH;
            if free == FreeSteps::Compared && self.unseen == 0 { Maker::Both } else { Maker::FreeStep }
        } else {
            // Contacts may move vehicles farther than their velocities do.
            self.forget();
            Maker::Engine
        };
        self.engine_steps += u64::from(maker != Maker::FreeStep);
        maker
    }

    /// Returns whether the step from these positions is free.
    fn is_free(&mut self, positions_m: &Rows) -> bool {
        self.overlaps.clear();
        let (mut is_beyond, mut is_decided) = (true, true);
        if self.beyond_m <= 0.0 || self.beyond_m.is_nan() {
            (is_beyond, is_decided) = self.search(positions_m, positions_m.nrows() <= ALL_PAIRS_UP_TO);
        }
        std::mem::replace(&mut self.began_beyond, is_beyond) && is_beyond && is_decided
    }

    /// Searches near pairs and obstacles, over all pairs or by cells: updates the distance of the nearest pair beyond
    /// the reach, and the overlaps. Returns whether every pair is beyond the reach of contacts that prevent free steps,
    /// and whether the overlaps are certain.
    fn search(&mut self, positions_m: &Rows, over_all_pairs: bool) -> (bool, bool) {
        self.beyond_m = 0.0;
        let beyond_obstacles_m = self.beyond_obstacles_m(positions_m);
        if beyond_obstacles_m <= 0.0 || !positions_m.iter().all(|x| x.is_finite()) {
            return (false, false);
        }
        let reach_m = if self.trusts_free_steps() { self.hull_reach_m } else { self.reach_m };
        let [reach, may_overlap, overlaps] = [reach_m, self.keep_out_m + MARGIN_M, self.keep_out_m - MARGIN_M]
            .map(|distance_m| distance_m.max(0.0) * distance_m.max(0.0));
        let (mut least, mut is_decided) = (f64::INFINITY, true);
        let visit = |first, second, squared: f64| {
            if squared <= reach {
                return ControlFlow::Break(());
            }
            least = squared.min(least);
            if squared < overlaps {
                self.overlaps.push(Pair::new(first, second));
            } else {
                is_decided &= squared > may_overlap;
            }
            ControlFlow::Continue(())
        };
        let range_m = if over_all_pairs { f64::INFINITY } else { RANGE_FACTOR * self.reach_m };
        let searched = if over_all_pairs {
            search_all_pairs(positions_m, visit)
        } else {
            self.cells.search(positions_m, range_m, visit)
        };
        if searched.is_break() {
            return (false, false);
        }
        self.overlaps.sort_unstable();
        self.beyond_m = (least.sqrt().min(range_m) - self.reach_m).min(beyond_obstacles_m);
        (true, is_decided)
    }

    /// Returns the distance of the nearest vehicle beyond the reach of obstacles \[m\]; 0 if some vehicle is within it.
    fn beyond_obstacles_m(&self, positions_m: &Rows) -> f64 {
        let mut least_m = f64::INFINITY;
        for obstacle in &*self.obstacles {
            for vehicle in 0..positions_m.nrows() {
                let centre = to_engine(row(positions_m, vehicle));
                let distance_m = obstacle.shape().distance_to_point(obstacle.position(), centre, true);
                if distance_m.is_nan() || distance_m <= self.obstacle_reach_m {
                    return 0.0;
                }
                least_m = least_m.min(distance_m - self.obstacle_reach_m);
            }
        }
        least_m
    }

    /// Takes into account that no vehicle moved farther than given \[m\].
    pub(super) fn note_move(&mut self, longest_m: f64) {
        self.beyond_m -= 2.0 * longest_m;
    }

    /// Forgets the distances, because the positions changed.
    pub(super) fn forget(&mut self) {
        self.beyond_m = 0.0;
    }

    /// Makes every step free, whatever the distances.
    #[cfg(test)]
    pub(super) fn with_free_steps_only(&mut self) {
        (self.reach_m, self.hull_reach_m, self.keep_out_m, self.obstacles) = (0.0, 0.0, -MARGIN_M, Arc::new([]));
        (self.beyond_m, self.began_beyond) = (f64::INFINITY, true);
        self.allow_free_steps(FreeSteps::Trusted);
    }
}

/// Calls `visit` for every pair in index order with the square of its distance until it breaks. Returns whether it did.
fn search_all_pairs(
    positions_m: &Rows,
    mut visit: impl FnMut(usize, usize, f64) -> ControlFlow<()>,
) -> ControlFlow<()> {
    for first in 0..positions_m.nrows() {
        let from_m = row(positions_m, first);
        for second in first + 1..positions_m.nrows() {
            visit(first, second, (row(positions_m, second) - from_m).norm_squared())?;
        }
    }
    ControlFlow::Continue(())
}

#[cfg(test)]
mod tests {
    use super::super::bodies::Bodies;
    use super::super::quadrotors::Fliers;
    use super::*;
    use crate::plant::{HullContact, Plant, StepPath};
    use crate::scenario::{Override, Source};
    use nalgebra::Vector3;
    use proptest::prelude::*;
    use tautline_core::obstacle::{Obstacle, Shape};
    use tautline_core::swarm::Swarm;

    /// Number of random flights with collisions.
    const FLIGHTS: usize = 200;

    /// A plant that shows which steps were free.
    trait Free: Plant {
        fn was_free(&self) -> bool;
    }

    impl Free for Bodies {
        fn was_free(&self) -> bool {
            Bodies::was_free(self)
        }
    }

    impl Free for Fliers {
        fn was_free(&self) -> bool {
            Fliers::was_free(self)
        }
    }

    fn scenario(name: &str, sets: &[&str]) -> Scenario {
        let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
        Scenario::read(&Source::Builtin(name.to_owned()), &overrides).expect("a scenario")
    }

    fn points(scenario: &Scenario) -> Bodies {
        Bodies::new(scenario)
    }

    fn fliers(scenario: &Scenario) -> Fliers {
        Fliers::new(scenario, scenario.fleet().expect("quadrotors"))
    }

    /// What a flight shows: bits of positions and velocities, contacts, and whether the step was free.
    #[derive(Default)]
    struct Seen {
        bits: Vec<u64>,
        keep_out: Vec<Pair>,
        hulls: Vec<HullContact>,
        free_steps: usize,
    }

    /// Flies steps under commands. Every 50th step is undone once and flown again in halves.
    fn fly(plant: &mut dyn Free, dt_s: f64, steps: usize, command: impl Fn(usize, &Swarm) -> Rows) -> Seen {
        let count = plant.count();
        let mut state = Swarm::at_rest(Rows::zeros(count));
        plant.observe(&mut state);
        let (mut next, mut path, mut seen) = (state.clone(), StepPath::default(), Seen::default());
        plant.apply(&command(0, &state), &mut state);
        for step in 1..=steps {
            let parts = if step % 50 == 0 { &[1.0, 0.5, 0.5][..] } else { &[1.0] };
            for (k, part) in parts.iter().enumerate() {
                plant.advance(part * dt_s, &mut next, &mut path).expect("finite");
                if parts.len() > 1 && k == 0 {
                    plant.restore(&state);
                    continue;
                }
                std::mem::swap(&mut state, &mut next);
                plant.apply(&command(step, &state), &mut state);
                let numbers = state.positions_m.iter().chain(state.velocities_m_s.iter());
                seen.bits.extend(numbers.map(|x| x.to_bits()));
                plant.keep_out_contacts(&mut seen.keep_out);
                plant.hull_contacts(&mut seen.hulls);
                seen.free_steps += usize::from(plant.was_free());
            }
        }
        seen
    }

    /// Asserts that a flight with and without free steps is the same. Returns what it shows.
    fn assert_same(
        make: impl Fn() -> Box<dyn Free>,
        dt_s: f64,
        steps: usize,
        command: impl Fn(usize, &Swarm) -> Rows,
    ) -> Seen {
        let mut free = make();
        free.allow_free_steps(FreeSteps::Trusted);
        let with = fly(free.as_mut(), dt_s, steps, &command);
        let mut compared = make();
        compared.allow_free_steps(FreeSteps::Compared);
        let shown = fly(compared.as_mut(), dt_s, steps, &command);
        assert_eq!((&shown.bits, &shown.keep_out, &shown.hulls), (&with.bits, &with.keep_out, &with.hulls));
        // Undone steps count too.
        let made = compared.engine_steps().expect("an engine");
        let expected = (shown.bits.len() / (6 * compared.count()) - shown.free_steps) as u64;
        assert!((expected..expected + expected / 8 + 20).contains(&made), "{made} steps, expected {expected}");
        let without = fly(make().as_mut(), dt_s, steps, &command);
        assert_eq!(without.free_steps, 0);
        let differing = with.bits.iter().zip(&without.bits).position(|(a, b)| a != b);
        assert_eq!(differing, None, "first different number");
        assert_eq!((&with.keep_out, &with.hulls), (&without.keep_out, &without.hulls));
        with
    }

    /// Accelerations of a few m/s^2 that change at every step, with exact zeros of both signs.
    fn shaken(step: usize, state: &Swarm) -> Rows {
        Rows::from_fn(state.count(), |i, axis| match (step / 7 + i + axis) % 5 {
            0 => 0.0,
            1 => -0.0,
            k => 3.0 * libm::sin(0.37 * step as f64 + 1.3 * i as f64 + axis as f64) / k as f64,
        })
    }

    #[test]
    fn free_steps_of_points_have_the_bits_of_the_engine() {
        for sets in [
            &[][..],
            &["swarm.a22_per_s=-0.3", "swarm.mass_kg=[1.0, 0.3, 7.1, 0.1, 2.9]"],
            &["wind={mean_m_s=[1.0, 0.5, 0.0]}", "vehicle={model=\"point\", drag_per_s=0.4}"],
            &["start.positions_m=[[30, -5, 1], [90, -5, 2], [60, 5, 3], [0, 5, -4], [120, 5, 7.1]]"],
        ] {
            let scenario = scenario("pentagon", sets);
            let seen = assert_same(|| Box::new(points(&scenario)), scenario.time.dt_s, 400, shaken);
            assert!(seen.free_steps > 300, "{sets:?}: {} free steps", seen.free_steps);
        }
    }

    #[test]
    fn free_steps_of_quadrotors_have_the_bits_of_the_engine() {
        for sets in [&[][..], &["vehicle.downwash=true"], &["wind={mean_m_s=[1.0, 0.5, 0.0]}"]] {
            let scenario = scenario("crazyflies", sets);
            let seen = assert_same(|| Box::new(fliers(&scenario)), scenario.time.dt_s, 400, shaken);
            assert!(seen.free_steps > 300, "{sets:?}: {} free steps", seen.free_steps);
        }
    }

    /// Commands that move two vehicles to a distance that swings about delta, beyond the reach of hulls.
    fn swinging(scenario: &Scenario) -> impl Fn(usize, &Swarm) -> Rows {
        let (delta_m, dt_s) = (scenario.delta_m, scenario.time.dt_s);
        move |step, state| {
            let half_m = 0.5 * delta_m * (0.9 + 0.25 * libm::sin(2.0 * dt_s * step as f64));
            let middle = state.positions_m.row_mean();
            Rows::from_fn(2, |i, axis| {
                let goal = middle[axis] + if axis > 0 { 0.0 } else { [-half_m, half_m][i] };
                4.0 * (goal - state.positions_m[(i, axis)]) - 3.0 * state.velocities_m_s[(i, axis)]
            })
        }
    }

    #[test]
    fn overlaps_of_keep_out_balls_in_free_steps_are_those_of_the_engine() {
        let two = |name: &str, spacing_m: f64| {
            let positions = format!("start.positions_m=[[0, 0, 1], [{spacing_m}, 0, 1]]");
            let formation = format!("formation={{shape=\"line\", spacing_m={spacing_m}}}");
            scenario(name, &[&positions, &formation, "graph.kind=\"complete\""])
        };
        let (of_points, of_quadrotors) = (two("pentagon", 3.0), two("crazyflies", 0.6));
        let steps = 3000;
        for (seen, scenario) in [
            (
                assert_same(|| Box::new(points(&of_points)), of_points.time.dt_s, steps, swinging(&of_points)),
                &of_points,
            ),
            (
                assert_same(
                    || Box::new(fliers(&of_quadrotors)),
                    of_quadrotors.time.dt_s,
                    steps,
                    swinging(&of_quadrotors),
                ),
                &of_quadrotors,
            ),
        ] {
            let overlaps = seen.keep_out.len();
            assert!(seen.free_steps > 9 * steps / 10, "{}: {} free steps", scenario.name, seen.free_steps);
            assert!(overlaps > steps / 4 && overlaps < steps, "{}: {overlaps} overlaps", scenario.name);
            assert!(seen.hulls.is_empty());
        }
    }

    #[test]
    fn the_engine_decides_whether_balls_that_touch_overlap() {
        let scenario = scenario("pentagon", &[]);
        let maker = |distance_m: f64, free: FreeSteps| {
            let mut proximity = Proximity::new(&scenario, Arc::new([]));
            proximity.allow_free_steps(free);
            let positions_m = Rows::from_row_slice(&[0.0, 0.0, 0.0, 10.0, 0.0, 0.0, 10.0 + distance_m, 0.0, 0.0]);
            (proximity.begin_step(&positions_m), proximity.overlaps().to_vec())
        };
        let (delta_m, hulls_m) = (scenario.delta_m, 2.0 * scenario.hull_radius_m[0]);
        let pair = vec![Pair::new(1, 2)];
        for (distance_m, trusted) in [
            (delta_m + 0.1, (Maker::FreeStep, vec![])),
            (delta_m + 2e-3, (Maker::FreeStep, vec![])),
            (delta_m, (Maker::Engine, vec![])),
            (delta_m - 2e-3, (Maker::FreeStep, pair.clone())),
            (hulls_m + 0.1, (Maker::FreeStep, pair)),
            (hulls_m, (Maker::Engine, vec![])),
            (f64::NAN, (Maker::Engine, vec![])),
        ] {
            assert_eq!(maker(distance_m, FreeSteps::Trusted), trusted, "{distance_m} m apart");
            let is_free = maker(distance_m, FreeSteps::Compared).0 == Maker::FreeStep;
            assert_eq!(is_free, distance_m > delta_m + 0.01, "{distance_m} m apart");
        }
    }

    /// Coordinate in units of the range of a search: anywhere, on borders of cells, and at extremes.
    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![
            8 => -3.0..3.0,
            4 => (-3..4_i32).prop_map(f64::from),
            2 => (-3..4_i32).prop_map(|k| f64::from(k).next_up()),
            1 => prop::sample::select(vec![0.0, -0.0, 1e6, -1e9, 1e300, -1e300, f64::MAX, f64::NAN, f64::INFINITY]),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]

        #[test]
        fn cells_decide_like_all_pairs(
            points in prop::collection::vec([coordinate(), coordinate(), coordinate()], 2..40),
            scale in prop_oneof![Just(1.0), 0.0..1.0, 1.0..30.0],
            free in prop::sample::select(vec![FreeSteps::Trusted, FreeSteps::Compared]),
        ) {
            let scenario = scenario("pentagon", &[]);
            let mut of_all = Proximity::new(&scenario, Arc::new([]));
            of_all.allow_free_steps(free);
            let range_m = RANGE_FACTOR * of_all.reach_m;
            let points: Vec<f64> = points.into_iter().flatten().map(|x| scale * range_m * x).collect();
            let positions_m = Rows::from_row_slice(&points);
            let mut of_cells = of_all.clone();
            let decided = of_all.search(&positions_m, true);
            prop_assert_eq!(of_cells.search(&positions_m, false), decided);
            if decided.0 {
                prop_assert_eq!(of_cells.overlaps(), of_all.overlaps());
                prop_assert_eq!(of_cells.beyond_m, of_all.beyond_m.min(range_m - of_all.reach_m));
            }
        }
    }

    #[test]
    fn cells_decide_like_all_pairs_in_large_swarms() {
        let scenario = scenario("pentagon", &[]);
        for free in [FreeSteps::Trusted, FreeSteps::Compared] {
            let mut decisions = Vec::new();
            for share in [0.02, 0.3, 0.6, 0.9, 0.999, 1.0, 1.001, 1.2, 2.0, 2.001, 9.0] {
                for far_m in [0.0, 1e7] {
                    let mut of_all = Proximity::new(&scenario, Arc::new([]));
                    of_all.allow_free_steps(free);
                    let spacing_m = share * of_all.reach_m;
                    // A cubic lattice, moved a little, so that pairs differ in length.
                    let positions_m = Rows::from_fn(600, |i, axis| {
                        let place = [i % 9, i / 9 % 9, i / 81][axis] as f64;
                        far_m + spacing_m * (place + 1e-3 * ((7 * i + 3 * axis) % 11) as f64)
                    });
                    let mut of_cells = of_all.clone();
                    let decided = of_all.search(&positions_m, true);
                    assert_eq!(of_cells.search(&positions_m, false), decided, "{share} of the reach");
                    decisions.push(decided);
                    if decided.0 {
                        assert_eq!(of_cells.overlaps(), of_all.overlaps());
                        let longest_m = (RANGE_FACTOR - 1.0) * of_all.reach_m;
                        assert!((of_cells.beyond_m - of_all.beyond_m.min(longest_m)).abs() < 1e-9);
                    }
                }
            }
            assert!(decisions.contains(&(false, false)) && decisions.contains(&(true, true)));
        }
    }

    #[test]
    fn free_steps_of_large_swarms_have_the_bits_of_the_engine() {
        for (count, steps) in [(100, 200), (1000, 40)] {
            let scenario = scenario("thousand", &[&format!("swarm.count={count}")]);
            let seen = assert_same(|| Box::new(points(&scenario)), scenario.time.dt_s, steps, shaken);
            assert!(seen.free_steps > steps / 2, "{count} vehicles: {} free steps", seen.free_steps);
        }
    }

    /// Vehicles that are pulled to the middle, collide and fly on, twice.
    fn colliding(step: usize, state: &Swarm) -> Rows {
        let sign = if (step / 600).is_multiple_of(2) { -1.0 } else { 1.0 };
        let middle = state.positions_m.row_mean();
        Rows::from_fn(state.count(), |i, axis| sign * 0.5 * (state.positions_m[(i, axis)] - middle[axis]))
    }

    #[test]
    fn collisions_between_free_steps_have_the_bits_of_the_engine() {
        let scenario = scenario(
            "pentagon",
            &[
                "start.positions_m=[[0, 0], [4, 0]]",
                "formation={shape=\"line\", spacing_m=3}",
                "graph.kind=\"complete\"",
            ],
        );
        let seen = assert_same(|| Box::new(points(&scenario)), scenario.time.dt_s, 2400, colliding);
        let engine_steps = seen.bits.len() / 12 - seen.free_steps;
        assert!(engine_steps > 5 && engine_steps < 200, "{engine_steps} steps of the engine");
        assert!(!seen.hulls.is_empty() && !seen.keep_out.is_empty());

        // Without the search of near pairs, vehicles pass through each other unseen.
        let mut blind = points(&scenario);
        Proximity::with_free_steps_only(Bodies::proximity(&mut blind));
        let blind = fly(&mut blind, scenario.time.dt_s, 2400, colliding);
        assert!(blind.hulls.is_empty() && blind.bits != seen.bits);

        // The comparison finds that, for keep-out balls too, which change no motion.
        for hull_radius_m in [scenario.hull_radius_m.clone(), vec![1e-3; 2]] {
            let scenario = Scenario { hull_radius_m, ..scenario.clone() };
            let mut checked = points(&scenario);
            Proximity::with_free_steps_only(Bodies::proximity(&mut checked));
            checked.allow_free_steps(FreeSteps::Compared);
            let (mut state, mut path) = (scenario.start.clone(), StepPath::default());
            let found = (0..2400).find_map(|step| {
                checked.apply(&colliding(step, &state), &mut state);
                checked.advance(scenario.time.dt_s, &mut state, &mut path).err()
            });
            assert_eq!(found, Some(crate::plant::PlantError::EngineDiffers { vehicle: 0 }));
        }
    }

    #[test]
    fn collisions_of_several_hulls_have_the_bits_of_the_engine() {
        // Strong commands that are held: many hulls collide, some of them in the same step.
        let scenario = scenario("gusts", &[]);
        let mut seed = 1_u64;
        let mut collisions = 0;
        for _ in 0..FLIGHTS {
            let mut draw = || {
                // Knuth's generator; the sum of four draws is close to normal.
                let mut uniform = || {
                    seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (seed >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
                };
                100.0 * (uniform() + uniform() + uniform() + uniform())
            };
            let held = Rows::from_fn(scenario.count(), |_, axis| if axis < 2 { draw() } else { 0.0 });
            let seen = assert_same(|| Box::new(points(&scenario)), scenario.time.dt_s, 80, |_, _| held.clone());
            collisions += usize::from(!seen.hulls.is_empty());
        }
        assert!(collisions > FLIGHTS / 2, "{collisions} flights with collisions");
    }

    #[test]
    fn collisions_in_a_large_swarm_have_the_bits_of_the_engine() {
        let scenario = scenario("thousand", &["swarm.count=150"]);
        let rushing = |step: usize, state: &Swarm| 20.0 * colliding(15 * step, state);
        let seen = assert_same(|| Box::new(points(&scenario)), scenario.time.dt_s, 160, rushing);
        assert!(!seen.hulls.is_empty() && seen.free_steps > 10, "{} free steps", seen.free_steps);
    }

    #[test]
    fn collisions_with_obstacles_between_free_steps_have_the_bits_of_the_engine() {
        let along = Vector3::new(0.0, 1.0, 0.3);
        for (shape, place_m) in [
            (Shape::Ball { radius_m: 2.0 }, [4.0, 1.0, 0.5]),
            (Shape::Box { half_m: Vector3::new(1.0, 4.0, 2.0), yaw_deg: 30.0 }, [5.0, 0.0, 1.0]),
            (Shape::Capsule { from_m: -9.0 * along, to_m: 9.0 * along, radius_m: 1.0 }, [5.0, 0.0, 1.0]),
            (Shape::HalfSpace { normal: Vector3::new(-1.0, 0.2, 0.3) }, [4.0, 0.0, 0.0]),
        ] {
            for (name, make, further_m) in [
                ("obstacles", (|scenario| Box::new(points(scenario))) as fn(&Scenario) -> Box<dyn Free>, 6.0),
                ("crazyflies", |scenario| Box::new(fliers(scenario)), 3.0),
            ] {
                let mut scenario = scenario(name, &[]);
                let place_m = Vector3::from(place_m) + Vector3::x() * further_m;
                let solid = Obstacle { name: "solid".to_owned(), place_m, shape, clearance_m: 0.1 };
                scenario.obstacles = vec![solid];
                // The swarm is pulled from its start through the obstacle and back, within 2 pi seconds.
                let (dt_s, start_m) = (scenario.time.dt_s, scenario.start.positions_m.clone());
                let steps = 1600;
                let way_m = 1.3 * (place_m.transpose() - start_m.row_mean());
                let pulled = |step: usize, state: &Swarm| {
                    let share = 0.5 - 0.5 * libm::cos(dt_s * step as f64);
                    Rows::from_fn(state.count(), |i, axis| {
                        let goal_m = start_m[(i, axis)] + share * way_m[axis];
                        8.0 * (goal_m - state.positions_m[(i, axis)]) - 4.0 * state.velocities_m_s[(i, axis)]
                    })
                };
                let seen = assert_same(|| make(&scenario), scenario.time.dt_s, steps, pulled);
                let free_steps = seen.free_steps;
                assert!(free_steps > steps / 8 && free_steps < steps, "{name}, {shape:?}: {free_steps} free steps");
                scenario.obstacles.clear();
                let without = assert_same(|| make(&scenario), scenario.time.dt_s, steps, pulled);
                assert!(without.bits != seen.bits, "{name}, {shape:?}: no collision");
            }
        }
    }

    #[test]
    fn a_free_step_that_differs_from_the_engine_is_an_error() {
        let scenario = scenario("pentagon", &[]);
        let mut plant = points(&scenario);
        plant.allow_free_steps(FreeSteps::Compared);
        // Another inverse mass than that of the engine's body, in the last bit.
        plant.change_inverse_mass(2);
        let (mut state, mut path) = (scenario.start.clone(), StepPath::default());
        let mut steps = 0;
        let error = loop {
            plant.apply(&shaken(steps, &state), &mut state);
            steps += 1;
            if let Err(error) = plant.advance(scenario.time.dt_s, &mut state, &mut path) {
                break error;
            }
        };
        assert_eq!(error, crate::plant::PlantError::EngineDiffers { vehicle: 2 });
        assert!(steps.is_multiple_of(8) && steps < 100, "found in step {steps}");
    }

    #[test]
    fn a_state_that_is_not_finite_is_an_error_of_the_vehicle() {
        let scenario = scenario("pentagon", &["swarm={a22_per_s=0, mass_kg=10}"]);
        let mut plant = points(&scenario);
        plant.allow_free_steps(FreeSteps::Trusted);
        let (mut state, mut path) = (scenario.start.clone(), StepPath::default());
        let mut held = Rows::zeros(scenario.count());
        for step in 0..4 {
            held[(3, 1)] = if step == 3 { f64::MAX } else { 0.0 };
            plant.apply(&held, &mut state);
            let moved = plant.advance(0.01, &mut state, &mut path);
            assert_eq!(moved.is_err(), step == 3);
            if let Err(error) = moved {
                assert_eq!(error, crate::plant::PlantError::NotFinite { vehicle: 3 });
            }
        }
        assert!(plant.was_free());
    }
}
