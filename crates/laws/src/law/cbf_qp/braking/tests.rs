use proptest::prelude::*;

use super::super::{CbfQpKeys, CbfQpLaw, CbfQpVariant};
use super::*;
use crate::formation::Formation;
use crate::graph::Graph;
use crate::law::{Law, LawContext};
use crate::observation::Observation;
use crate::space::{CellList, closest_pair};
use crate::wind::Normals;
use tautline_core::swarm::{Rows, Swarm, row, set_row};

const DELTA_M: f64 = 1.0;

fn braking(a22_per_s: f64) -> Braking {
    Braking { max_accel_m_s2: 5.0, max_speed_m_s: 3.0, a22_per_s, apart_m: DELTA_M, approach_per_s: 5.0 }
}

fn distance_m(braking: &Braking, own: State, other: State) -> f64 {
    let (own_m, other_m) = closest_points(braking.segment(own), braking.segment(other));
    (own_m - other_m).norm()
}

/// Returns a state after a time at constant acceleration.
fn after((position_m, velocity_m_s): State, acceleration: Vector3<f64>, time_s: f64) -> State {
    let moved_m = velocity_m_s * time_s + acceleration * (0.5 * time_s * time_s);
    (position_m + moved_m, velocity_m_s + acceleration * time_s)
}

fn vectors(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

/// Generates directions of flight that are often parallel, opposite, level or zero.
fn velocities() -> impl Strategy<Value = Vector3<f64>> {
    let special = prop::sample::select(vec![
        Vector3::zeros(),
        Vector3::x(),
        -Vector3::x(),
        2.5 * Vector3::x(),
        Vector3::y(),
        Vector3::new(1.0, 1e-9, 0.0),
    ]);
    prop_oneof![vectors(1.7), special, vectors(1.7).prop_map(|v| Vector3::new(v.x, v.y, 0.0))]
}

fn drags() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), -1.0..1.0_f64]
}

#[test]
fn the_braking_path_matches_a_hand_calculation() {
    // Up to 0.25 m/s the path is v/20; beyond, the square of the speed grows by 10 m/s^2 times the path.
    let still = braking(0.0);
    for (speed_m_s, path_m, slope_s) in [(0.0, 0.0, 0.05), (0.2, 0.01, 0.05), (2.25, 0.5125, 0.45)] {
        assert!((still.path_m(speed_m_s) - path_m).abs() < 1e-12, "{speed_m_s}");
        assert!((still.slope_s(speed_m_s) - slope_s).abs() < 1e-12, "{speed_m_s}");
    }
    // Drag does not lengthen the path, and a22 > 0 does.
    assert!((braking(-0.7).path_m(2.0) - still.path_m(2.0)).abs() < 1e-12);
    assert!(braking(0.5).path_m(2.0) > 1.2 * still.path_m(2.0));
    // The half-space of a vehicle that closes at 2.25 m/s, 0.6 m from the stop point to the mid-plane.
    let own = (Vector3::new(-1.1125, 0.0, 0.0), Vector3::new(2.25, 0.0, 0.0));
    let other = (Vector3::new(0.6, 0.0, 0.0), Vector3::zeros());
    let found = still.half_space(own, other).expect("a plane");
    // n = -x, c = 0.6 - 0.5: -(2.25 + 0.45 u) >= -5 * 0.1.
    assert!((found.normal + Vector3::x()).norm() < 1e-12 && (found.offset - (2.25 - 0.5) / 0.45).abs() < 1e-9);
}

#[test]
fn closest_points_of_crossing_and_parallel_segments() {
    let segment = |from: [f64; 3], to: [f64; 3]| [Vector3::from(from), Vector3::from(to)];
    let (one, other) =
        closest_points(segment([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]), segment([0.5, -1.0, 2.0], [0.5, 1.0, 2.0]));
    assert!((one - Vector3::new(0.5, 0.0, 0.0)).norm() < 1e-12 && (other - Vector3::new(0.5, 0.0, 2.0)).norm() < 1e-12);
    let (one, other) =
        closest_points(segment([0.0, 0.0, 0.0], [2.0, 0.0, 0.0]), segment([3.0, 1.0, 0.0], [1.0, 1.0, 0.0]));
    assert!(((one - other) - Vector3::new(0.0, -1.0, 0.0)).norm() < 1e-12);
}

proptest! {
    /// A dense grid of points of both segments has no closer pair, apart from its spacing.
    #[test]
    fn closest_points_are_closest(
        one in prop::array::uniform2(vectors(2.0)), along in velocities(), turned in velocities(), from in vectors(2.0),
    ) {
        for [one, other] in [[one, [from, from + along]], [[one[0], one[0] + turned], [from, from + along]]] {
            let (own_m, other_m) = closest_points(one, other);
            let on = |segment: [Vector3<f64>; 2], k: u32| segment[0] + (segment[1] - segment[0]) * f64::from(k) / 20.0;
            for (k, l) in (0..=20).flat_map(|k| (0..=20).map(move |l| (k, l))) {
                let apart_m = (on(one, k) - on(other, l)).norm();
                prop_assert!((own_m - other_m).norm() <= apart_m + 1e-9);
            }
        }
    }

    #[test]
    fn the_slope_is_the_derivative_of_the_path_and_covers_the_brake(
        a22_per_s in drags(), speed_m_s in 0.001..3.0_f64,
    ) {
        const STEP: f64 = 1e-6;
        let braking = braking(a22_per_s);
        prop_assume!((speed_m_s - braking.slow_m_s()).abs() > 2.0 * STEP);
        let difference = (braking.path_m(speed_m_s + STEP) - braking.path_m(speed_m_s - STEP)) / (2.0 * STEP);
        prop_assert!((difference - braking.slope_s(speed_m_s)).abs() < 1e-6 * (1.0 + difference));
        // The stop point does not advance: v <= L' times the deceleration that the brake reaches.
        let velocity_m_s = Vector3::new(speed_m_s, 0.0, 0.0);
        let deceleration_m_s2 = -(braking.command_m_s2(velocity_m_s).x + a22_per_s * speed_m_s);
        prop_assert!(speed_m_s <= braking.slope_s(speed_m_s) * deceleration_m_s2 * (1.0 + 1e-12));
        prop_assert!(braking.path_m(speed_m_s) <= speed_m_s * braking.slope_s(speed_m_s) * (1.0 + 1e-12));
    }

    /// The half-space of a vehicle is that of the derivative of its stop point along the normal.
    #[test]
    fn the_half_space_matches_finite_differences_of_the_stop_point(
        a22_per_s in drags(), apart in vectors(3.0), own_m_s in velocities(), other_m_s in velocities(),
        command in vectors(5.0),
    ) {
        const STEP_S: f64 = 1e-6;
        let braking = braking(a22_per_s);
        prop_assume!((own_m_s.norm() - braking.slow_m_s()).abs() > 1e-4);
        let (own, other) = ((apart, own_m_s), (Vector3::zeros(), other_m_s));
        prop_assume!(distance_m(&braking, own, other) > 0.1);
        let half_space = braking.half_space(own, other).expect("a plane");
        let (normal, middle_m) =
            braking.mid_plane(braking.segment(own), braking.segment(other)).expect("a plane");
        let acceleration = command + a22_per_s * own_m_s;
        let stop_m = |time_s: f64| normal.dot(&braking.segment(after(own, acceleration, time_s))[1]);
        let rate_m_s = (stop_m(STEP_S) - stop_m(-STEP_S)) / (2.0 * STEP_S);
        let clearance_m = stop_m(0.0) - normal.dot(&middle_m) - 0.5 * braking.apart_m;
        // Scaling a half-space keeps it, so the two spares have the ratio of the gradient's length.
        let spare_m_s = rate_m_s + braking.approach_per_s * clearance_m;
        let spare_m_s2 = half_space.normal.dot(&command) - half_space.offset;
        let gradient_s = {
            let pushed = |push: Vector3<f64>| {
                let stop = |time_s: f64| normal.dot(&braking.segment(after(own, acceleration + push, time_s))[1]);
                (stop(STEP_S) - stop(-STEP_S)) / (2.0 * STEP_S) - rate_m_s
            };
            Vector3::new(pushed(Vector3::x()), pushed(Vector3::y()), pushed(Vector3::z()))
        };
        prop_assert!((half_space.normal - gradient_s.normalize()).norm() < 1e-5, "{gradient_s}");
        prop_assert!((spare_m_s2 * gradient_s.norm() - spare_m_s).abs() < 1e-5, "{spare_m_s2} {spare_m_s}");
    }

    /// h' >= -kappa h for all accelerations in both half-spaces, also at parallel segments, where h has a kink.
    #[test]
    fn accelerations_in_both_half_spaces_keep_the_rate_of_the_barrier(
        a22_per_s in drags(), apart in vectors(3.0), velocities_m_s in prop::array::uniform2(velocities()),
        wishes in prop::array::uniform2(vectors(8.0)),
    ) {
        const STEP_S: f64 = 1e-6;
        let braking = braking(a22_per_s);
        let [own, other] = [(apart, velocities_m_s[0]), (Vector3::zeros(), velocities_m_s[1])];
        let before_m = distance_m(&braking, own, other);
        prop_assume!(before_m > DELTA_M);
        let chosen = |own: State, other: State, wish: Vector3<f64>| {
            let half_space = braking.half_space(own, other).expect("a plane");
            let missing = (half_space.offset - half_space.normal.dot(&wish)).max(0.0);
            wish + half_space.normal * missing + a22_per_s * own.1
        };
        let moved = |own: State, other: State, wish| after(own, chosen(own, other, wish), STEP_S);
        let after_m = distance_m(&braking, moved(own, other, wishes[0]), moved(other, own, wishes[1]));
        let rate_m_s = (after_m - before_m) / STEP_S;
        prop_assert!(rate_m_s >= -5.0 * (before_m - DELTA_M) - 3e-4, "{rate_m_s} {before_m}");
    }

    /// Braking is in all half-spaces of a vehicle, and in the ball of commands, while all barriers hold.
    #[test]
    fn braking_is_feasible_while_barriers_hold(
        a22_per_s in drags(), own_m_s in velocities(),
        others in prop::collection::vec((vectors(3.0), velocities()), 1..8),
    ) {
        let braking = braking(a22_per_s);
        prop_assume!(own_m_s.norm() <= 3.0);
        let own = (Vector3::zeros(), own_m_s);
        let deceleration_per_s = 1.0 / braking.slope_s(own_m_s.norm());
        let command = own_m_s * -(deceleration_per_s + a22_per_s);
        prop_assert!(command.norm() <= 5.0 * (1.0 + 1e-12));
        for other in others.into_iter().filter(|&other| distance_m(&braking, own, other) >= DELTA_M) {
            let half_space = braking.half_space(own, other).expect("a plane");
            prop_assert!(half_space.normal.dot(&command) >= half_space.offset - 1e-9);
        }
        if let Some(limit) = braking.speed_limit(own_m_s) {
            prop_assert!(limit.normal.dot(&command) >= limit.offset - 1e-9);
        }
    }

    #[test]
    fn beyond_the_range_half_spaces_contain_every_allowed_acceleration(
        a22_per_s in drags(), direction in vectors(1.0), beyond in 1.0..2.0_f64,
        velocities_m_s in prop::array::uniform2(vectors(1.7)),
    ) {
        let braking = braking(a22_per_s);
        prop_assume!(direction.norm() > 0.1 && velocities_m_s.iter().all(|v| v.norm() <= 3.0));
        let apart_m = direction.normalize() * (braking.range_m() * beyond);
        let found = braking.half_space((apart_m, velocities_m_s[0]), (Vector3::zeros(), velocities_m_s[1]));
        prop_assert!(found.expect("a plane").offset <= -5.0 + 1e-9);
    }
}

/// Duration of a flight of a crowd \[s\].
const DURATION_S: f64 = 8.0;

/// Vehicles with starts whose barriers hold, and slots.
struct Crowd {
    start: Swarm,
    formation: Formation,
    a22_per_s: f64,
}

impl Crowd {
    /// Returns moving vehicles whose slots have no relation to their starts.
    fn random(seed: u64, count: usize, is_planar: bool, a22_per_s: f64) -> Self {
        let extent_m = if is_planar { 2.4 * (count as f64).sqrt() } else { 2.2 * (count as f64).cbrt() };
        let mut normals = Normals::new(seed, 0);
        let mut vector = |size: f64| {
            let [x, y, z] = [(); 3].map(|()| size * (normals.unit() - 0.5));
            Vector3::new(x, y, if is_planar { 0.0 } else { z })
        };
        let braking = braking(a22_per_s);
        let (mut starts, mut slots_m) = (Vec::<State>::new(), Vec::<Vector3<f64>>::new());
        while starts.len() < count {
            let state = (vector(extent_m), vector(2.0));
            if starts.iter().all(|&other| distance_m(&braking, state, other) > 1.05 * DELTA_M) {
                starts.push(state);
            }
        }
        while slots_m.len() < count {
            let slot_m = vector(extent_m);
            if slots_m.iter().all(|other| (slot_m - other).norm() > 1.2 * DELTA_M) {
                slots_m.push(slot_m);
            }
        }
        Self::new(&starts, &slots_m, a22_per_s)
    }

    /// Returns vehicles on a circle with a jitter of 0.1 m that change places with those opposite.
    fn circle(seed: u64, count: usize, a22_per_s: f64) -> Self {
        let mut normals = Normals::new(seed, 0);
        let mut jitter_m = || 0.1 * (2.0 * normals.unit() - 1.0);
        let radius_m = 0.5 * count as f64;
        let on_circle = |i: usize| {
            let (sine, cosine) = libm::sincos(std::f64::consts::TAU * i as f64 / count as f64);
            Vector3::new(radius_m * cosine, radius_m * sine, 0.0)
        };
        let slots_m: Vec<_> = (0..count).map(|i| -on_circle(i)).collect();
        let start = |i: usize| (on_circle(i) + Vector3::new(jitter_m(), jitter_m(), 0.0), Vector3::zeros());
        Self::new(&(0..count).map(start).collect::<Vec<_>>(), &slots_m, a22_per_s)
    }

    fn new(starts: &[State], slots_m: &[Vector3<f64>], a22_per_s: f64) -> Self {
        let count = starts.len();
        let positions_m = Rows::from_fn(count, |i, axis| starts[i].0[axis]);
        let velocities_m_s = Rows::from_fn(count, |i, axis| starts[i].1[axis]);
        let formation = Formation::points(Rows::from_fn(count, |i, axis| slots_m[i][axis]));
        Self { start: Swarm { positions_m, velocities_m_s }, formation, a22_per_s }
    }

    /// Flies the crowd with commands that are held for a step. Returns the smallest separation at the steps \[m\].
    fn fly(&self, keys: &CbfQpKeys, step_s: f64) -> f64 {
        let (mut swarm, count) = (self.start.clone(), self.start.count());
        let links = Graph::complete(count);
        let context = LawContext::new(&links, &self.formation, DELTA_M, self.a22_per_s);
        let mut law = CbfQpLaw::new(&context, keys.clone()).expect("a law");
        let (mut near, mut command, mut least_m) = (CellList::default(), Rows::zeros(count), f64::INFINITY);
        let mut time_s = 0.0;
        while time_s < DURATION_S {
            time_s += step_s;
            near.update(&swarm.positions_m, law.range_m);
            let at = Observation { near: near.pairs(), ..Observation::exact(&swarm, &links, &self.formation) };
            if law.command(&at, &mut command).is_err() {
                return 0.0;
            }
            for i in 0..count {
                let (position_m, velocity_m_s) = (row(&swarm.positions_m, i), row(&swarm.velocities_m_s, i));
                let push = |velocity_m_s: Vector3<f64>| row(&command, i) + self.a22_per_s * velocity_m_s;
                // The midpoint rule: its error of the third order is far below that of holding commands.
                let middle_m_s = velocity_m_s + push(velocity_m_s) * (0.5 * step_s);
                set_row(&mut swarm.positions_m, i, position_m + middle_m_s * step_s);
                set_row(&mut swarm.velocities_m_s, i, velocity_m_s + push(middle_m_s) * step_s);
            }
            least_m = least_m.min(closest_pair(&swarm.positions_m).map_or(f64::INFINITY, |(_, apart_m)| apart_m));
        }
        least_m
    }
}

/// Returns crowds in the plane, in space and on circles, with a22 of -0.3, 0 and 0.3.
fn crowds(rounds: u64) -> impl Iterator<Item = Crowd> {
    (0..rounds).flat_map(|seed| {
        let a22_per_s = 0.3 * (seed % 3) as f64 - 0.3;
        [
            Crowd::random(seed, 12, true, a22_per_s),
            Crowd::random(seed, 12, false, a22_per_s),
            Crowd::circle(seed, 12, a22_per_s),
        ]
    })
}

fn keys(variant: CbfQpVariant, margin_m: Option<f64>) -> CbfQpKeys {
    CbfQpKeys { variant, max_speed_m_s: 3.0, margin_m, ..CbfQpKeys::default() }
}

/// Returns the smallest separation of crowds \[m\], and the number of those that violate.
fn flown(rounds: u64, keys: &CbfQpKeys, step_s: f64) -> (f64, u32) {
    let flights = crowds(rounds).map(|crowd| crowd.fly(keys, step_s));
    flights.fold((f64::INFINITY, 0), |(closest_m, violating), least_m| {
        (closest_m.min(least_m), violating + u32::from(least_m < DELTA_M))
    })
}

#[test]
fn crowds_keep_delta_under_braking_barriers_and_not_under_nominal_ones() {
    let rounds = if std::env::var_os("TAUTLINE_LONG").is_some() { 200 } else { 10 };
    let (least_m, _) = flown(rounds, &keys(CbfQpVariant::Braking, Some(0.0)), 0.01);
    let (nominal_m, violating) = flown(rounds, &keys(CbfQpVariant::Nominal, None), 0.01);
    assert!(least_m > DELTA_M - 1e-9, "{least_m}");
    let is_expected = u64::from(violating) >= rounds + rounds / 2 && nominal_m < 0.855;
    assert!(is_expected, "nominal barriers violate in {violating} of {}: {nominal_m} m", 3 * rounds);
}

/// The braking rate at low speed is 20/s: commands that are held for more than its inverse break the barriers.
#[test]
fn commands_that_are_held_for_long_break_the_barriers() {
    let keys = keys(CbfQpVariant::Braking, Some(0.0));
    let losses_m = [0.2, 0.1, 0.05, 0.025].map(|step_s| DELTA_M - flown(10, &keys, step_s).0);
    assert!((losses_m[0] - 0.796).abs() < 0.005 && (losses_m[1] - 0.0355).abs() < 0.001, "{losses_m:?}");
    assert!(losses_m[2..].iter().all(|&loss_m| loss_m < 1e-9), "{losses_m:?}");
}

/// Two vehicles whose segments cross have no feasible command.
#[test]
fn states_with_broken_barriers_are_commanded_to_brake() {
    let formation = Formation::points(Rows::from_row_slice(&[5.0, 0.0, 0.0, -5.0, 0.0, 0.0]));
    let links = Graph::complete(2);
    let context = LawContext::new(&links, &formation, DELTA_M, 0.0);
    let mut law = CbfQpLaw::new(&context, keys(CbfQpVariant::Braking, None)).expect("a law");
    let mut swarm = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 1.1, 0.0, 0.0]));
    (swarm.velocities_m_s[(0, 0)], swarm.velocities_m_s[(1, 0)]) = (3.0, -3.0);
    let mut command = Rows::zeros(2);
    let at = Observation { near: &[(0, 1)], ..Observation::exact(&swarm, &links, &formation) };
    law.command(&at, &mut command).expect("a command");
    assert_eq!((row(&command, 0), row(&command, 1)), (Vector3::new(-5.0, 0.0, 0.0), Vector3::new(5.0, 0.0, 0.0)));
}
